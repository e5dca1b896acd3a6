//! Pictures: contents, options, sequences, determinism.

use std::path::Path;

use rayburst::image::{RgbImage, read_exr, read_picture};

use crate::program::Place;

const TINY: &str = "render cornell --size 24x24 --spp 4";

fn picture(place: &Place, name: &str) -> RgbImage {
    read_picture(&place.path(name)).unwrap()
}

#[test]
fn the_json_object_has_the_contracts_keys() {
    let place = Place::new();
    let ran = place.good(&format!("{TINY} --json -o a.png"));
    assert_eq!(ran.stdout.lines().count(), 1);
    let json = ran.json();
    for key in [
        "scene",
        "size",
        "spp",
        "integrator",
        "mrays_per_second",
        "triangles",
        "instances",
        "peak_memory_bytes",
        "output",
    ] {
        assert!(!json[key].is_null(), "{key}: {json}");
    }
    for key in ["load", "build", "render", "denoise", "write"] {
        assert!(json["seconds"][key].as_f64().unwrap() >= 0.0, "{key}: {json}");
    }
    let rays = &json["rays"];
    let count = |key: &str| rays[key].as_u64().unwrap();
    assert_eq!(count("camera"), 24 * 24 * 4);
    assert_eq!(count("total"), count("camera") + count("shadow") + count("indirect"));
    assert_eq!((&json["scene"], &json["output"]), (&"cornell".into(), &"a.png".into()));
    let quiet = place.good(&format!("{TINY} -o b.png"));
    assert!(quiet.stdout.is_empty(), "the picture is the result: {quiet:?}");
}

#[test]
fn the_default_output_is_named_after_the_program() {
    let place = Place::new();
    place.good("render --size 8x8 --spp 1");
    assert_eq!(place.files(), ["rayburst.png"]);
    assert_eq!(
        (picture(&place, "rayburst.png").width, picture(&place, "rayburst.png").height),
        (8, 8)
    );
}

#[test]
fn the_same_seed_gives_the_same_bytes_for_any_number_of_threads() {
    let place = Place::new();
    for threads in [1, 2, 7] {
        place.good(&format!("{TINY} --seed 5 --threads {threads} -o t{threads}.exr"));
        place.good(&format!("{TINY} --seed 5 --threads {threads} -o t{threads}.png"));
    }
    for name in ["t2", "t7"] {
        assert!(place.read("t1.exr") == place.read(&format!("{name}.exr")), "{name}");
        assert!(place.read("t1.png") == place.read(&format!("{name}.png")), "{name}");
    }
    place.good(&format!("{TINY} --seed 6 -o other.exr"));
    assert!(picture(&place, "t1.exr") != picture(&place, "other.exr"));
}

#[test]
fn a_resumed_render_is_the_uninterrupted_one() {
    let place = Place::new();
    let line = "render cornell --size 24x24 --aov albedo,normal,depth,variance";
    place.good(&format!("{line} --spp 11 -o whole.exr"));
    for spp in [1, 4, 11] {
        place.good(&format!("{line} --spp {spp} --resume -o part.exr"));
    }
    assert!(place.read("whole.exr") == place.read("part.exr"));
    // Nothing to do is fine too.
    let ran = place.good(&format!("{line} --spp 11 --resume -o part.exr --json"));
    assert_eq!(ran.json()["rays"]["total"], 0);
    assert_eq!(ran.json()["spp"], 11);
}

#[test]
fn a_render_of_something_else_is_not_continued() {
    let place = Place::new();
    place.good("render cornell --size 16x16 --spp 2 -o a.exr");
    let before = place.read("a.exr");
    let again = "render cornell --size 16x16 --spp 4 --resume -o a.exr";
    for (change, words) in [
        ("--seed 1", "seed"),
        ("--max-depth 3", "max_depth"),
        ("--sampler independent", "sampler"),
        ("--filter box", "filter"),
        ("--integrator ao", "integrator"),
        ("--eye 0.2,0.2,-1", "camera"),
        ("--aov albedo", "aovs"),
    ] {
        let complaint = place.bad(1, &format!("{again} {change}"));
        assert!(complaint.contains(words), "{change}: {complaint}");
    }
    let size = place.bad(1, "render cornell --size 16x8 --spp 4 --resume -o a.exr");
    assert!(size.contains("16x16"), "{size}");
    let scene = place.bad(1, "render furnace --size 16x16 --spp 4 --resume -o a.exr");
    assert!(scene.contains("its scene is 'cornell'"), "{scene}");
    place.write("no.exr", "not a picture");
    place.bad(1, "render cornell --size 16x16 --resume -o no.exr");
    assert!(place.read("a.exr") == before);
}

#[test]
fn sequences_are_numbered_and_skip_finished_frames() {
    let place = Place::new();
    let line = "render cornell --size 8x8 --spp 1 --frames 3..5";
    place.good(&format!("{line} -o f.####.png"));
    assert_eq!(place.files(), ["f.0003.png", "f.0004.png", "f.0005.png"]);
    std::fs::remove_file(place.path("f.0004.png")).unwrap();
    let kept = std::fs::metadata(place.path("f.0003.png")).unwrap().modified().unwrap();
    let ran = place.good(&format!("{line} -o f.####.png --resume --json"));
    assert_eq!(ran.json()["frames"], 1);
    assert_eq!(std::fs::metadata(place.path("f.0003.png")).unwrap().modified().unwrap(), kept);
    place.good(&format!("{line} -o g{{frame}}.hdr"));
    assert!(place.files().contains(&"g5.hdr".to_owned()));
    place.good(&format!("{line} -o film.gif --fps 10"));
    assert!(place.read("film.gif").starts_with(b"GIF89a"));
}

#[test]
fn a_sequence_of_layers_goes_on_where_it_stopped() {
    let place = Place::new();
    let line = "render cornell --size 8x8 --frames 0..1 -o f{frame}.exr --resume";
    place.good(&format!("{line} --spp 2"));
    let ran = place.good(&format!("{line} --spp 5 --json"));
    assert_eq!(ran.json()["rays"]["camera"], 2 * 8 * 8 * 3);
    place.good("render cornell --size 8x8 --spp 5 --time 0 -o whole.exr");
    assert!(place.read("f0.exr") == place.read("whole.exr"));
}

#[test]
fn a_film_needs_ffmpeg() {
    let place = Place::new();
    let mut command = crate::program::command(place.folder());
    command
        .env("PATH", place.folder())
        .args(["render", "--size", "8x8", "--spp", "1", "--frames", "0..1", "-o", "film.mp4"]);
    let ran = crate::program::Ran::new(command.output());
    assert_eq!(ran.code, Some(1));
    assert!(ran.complaint("mp4").contains("needs ffmpeg"), "{ran:?}");
    assert!(place.files().is_empty());
}

#[test]
#[cfg(unix)]
fn frames_go_to_the_encoder() {
    use std::os::unix::fs::PermissionsExt as _;
    let place = Place::new();
    // Stands for ffmpeg: keeps what comes in, under the name of the last argument.
    let script = "#!/bin/sh\nfor last; do :; done\nif [ -e fail ]; then echo no codec >&2; exit 1; fi\nexec /bin/cat > \"$last\"\n";
    place.write("ffmpeg", script);
    let mode = std::fs::Permissions::from_mode(0o755);
    std::fs::set_permissions(place.path("ffmpeg"), mode).unwrap();
    let run = || {
        let mut command = crate::program::command(place.folder());
        let line = "render --size 8x6 --spp 1 --frames 0..2 -o film.mp4";
        command.env("PATH", place.folder()).args(line.split(' '));
        crate::program::Ran::new(command.output())
    };
    let ran = run();
    assert_eq!(ran.code, Some(0), "{ran:?}");
    assert_eq!(place.read("film.mp4").len(), 3 * 8 * 6 * 3, "three frames of bytes");
    place.write("fail", "");
    let ran = run();
    assert_eq!(ran.code, Some(1), "{ran:?}");
    assert!(ran.complaint("mp4").contains("no codec"), "{ran:?}");
    assert_eq!(place.files(), ["fail", "ffmpeg", "film.mp4"]);
}

#[test]
fn aovs_are_layers() {
    let place = Place::new();
    place.good(&format!("{TINY} -o a.exr --aov albedo,normal,depth,position,instance,material"));
    let image = read_exr(&place.path("a.exr")).unwrap();
    for layer in ["", "albedo", "normal", "depth", "position", "instance", "material"] {
        assert!(image.layer(layer).is_some(), "{layer}");
    }
    let depth = image.rgb("depth").unwrap();
    assert!(depth.get(12, 12).x > 0.5 && depth.get(12, 12).x < 3.0, "metres");
}

#[test]
fn the_camera_can_be_moved() {
    let place = Place::new();
    let line = "render cornell --size 16x16 --spp 1 --integrator depth";
    let middle = |options: &str| {
        place.good(&format!("{line} {options} -o d.exr"));
        picture(&place, "d.exr").get(8, 8).x
    };
    let near = middle("--eye 0.278,0.273,-0.4 --target 0.278,0.273,0");
    let far = middle("--eye 0.278,0.273,-0.8 --target 0.278,0.273,0");
    assert!((far - near - 0.4).abs() < 0.02, "{near} {far}");
    assert!(middle("--camera 0") > 0.5);
    assert_eq!(middle("--camera front"), middle("--camera 0"));
    assert_ne!(middle("--fov 90"), middle("--fov 20"));
}

#[test]
fn the_time_can_be_limited() {
    let place = Place::new();
    let ran = place.good("render --size 64x64 --budget 0.3 --json -o a.exr");
    assert!(ran.json()["seconds"]["render"].as_f64().unwrap() < 5.0);
    assert!(ran.stderr.contains("the time is up"), "{ran:?}");
    let ran = place.good("render --size 16x16 --noise 0.5 --json -o b.exr");
    assert!(ran.json()["spp"].as_u64().unwrap() >= 2);
    assert!(ran.stderr.contains("the noise is low enough"), "{ran:?}");
}

#[test]
fn exposure_and_tone_map_change_the_png() {
    let place = Place::new();
    let auto = place.good(&format!("{TINY} -o auto.png"));
    let printed = auto.stderr.lines().find_map(|l| l.split("--exposure ").nth(1)).unwrap();
    place.good(&format!("{TINY} --exposure {printed} -o same.png"));
    let mean = |name: &str| {
        let p = picture(&place, name);
        p.pixels.iter().map(|v| v.element_sum()).sum::<f32>() / p.pixels.len() as f32
    };
    assert!((mean("auto.png") / mean("same.png") - 1.0).abs() < 0.01);
    place.good(&format!("{TINY} --exposure -12 -o dark.png"));
    assert!(mean("dark.png") < 0.8 * mean("auto.png"));
    for map in ["none", "reinhard", "aces", "agx", "neutral"] {
        place.good(&format!("{TINY} --tone-map {map} -o {map}.png"));
    }
    assert!(place.read("aces.png") != place.read("agx.png"));
}

#[test]
fn environments_light_a_scene() {
    let place = Place::new();
    let line = "render furnace --size 8x8 --spp 1";
    place.good(&format!("{line} --environment sky -o a.exr"));
    place.good(&format!("{line} --environment sky --environment-intensity 2 -o b.exr"));
    let (a, b) = (picture(&place, "a.exr").get(0, 0), picture(&place, "b.exr").get(0, 0));
    assert!((b.y / a.y - 2.0).abs() < 1e-3, "{a} {b}");
    place.good(&format!("{line} --environment none -o c.exr"));
    assert_eq!(picture(&place, "c.exr").get(0, 0).y, 0.0);
    let complaint = place.bad(1, &format!("{line} --environment missing.hdr -o d.exr"));
    assert!(complaint.contains("missing.hdr"), "{complaint}");
}

#[test]
fn a_scene_without_camera_and_light_is_framed_and_lit() {
    let place = Place::new();
    place.write("tri.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let ran = place.good("render tri.obj --size 16x16 --spp 2 -o a.exr");
    assert!(ran.stderr.contains("camera") && ran.stderr.contains("sky"), "{ran:?}");
    assert!(picture(&place, "a.exr").pixels.iter().all(|p| p.is_finite()));
}

#[test]
fn scenes_of_the_collection_load() {
    let root = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/scenes"));
    let scene = root.join("fox/Fox.glb");
    if !scene.exists() {
        eprintln!("skipped: {} is not there", scene.display());
        return;
    }
    let place = Place::new();
    let scene = scene.display();
    let info = place.good(&format!("info {scene} --json")).json();
    assert_eq!(info["triangles"], 576);
    assert_eq!(info["animations"].as_array().unwrap().len(), 3);
    let line = format!("render {scene} --size 16x16 --spp 1 --integrator depth");
    place.good(&format!("{line} --animation Run --time 0.3 -o a.exr"));
    place.good(&format!("{line} --animation Run --time 0.6 -o b.exr"));
    assert!(place.read("a.exr") != place.read("b.exr"));
}
