//! Frames in real time: pictures, layers, sequences, their options, and their benchmark.

use rayburst::image::{LayeredImage, RgbImage, read_exr, read_picture};

use crate::program::Place;

/// A small picture whose eye rays are traced, of an integrator to be named.
const TINY: &str = "render cornell --size 24x16 --techniques gbuffer=rays --integrator";

fn picture(place: &Place, name: &str) -> RgbImage {
    read_picture(&place.path(name)).unwrap()
}

fn layers(place: &Place, name: &str) -> LayeredImage {
    read_exr(&place.path(name)).unwrap()
}

fn mean(picture: &RgbImage) -> f32 {
    picture.pixels.iter().map(|p| p.element_sum()).sum::<f32>() / picture.pixels.len() as f32
}

/// A triangle that moves half a unit to the right in a second, seen so that 32 rows are 3.64 units high.
fn moving_triangle(place: &Place) -> String {
    const DATA: &str = "AACAvwAAgL8AAAAAAACAPwAAgL8AAAAAAAAAAAAAgD8AAAAAAAAAAAAAgD8AAAAAAAAAAAAAAAAAAAA/AAAAAAAAAAA=";
    let view = |offset: u32, length: u32| serde_json::json!({ "buffer": 0, "byteOffset": offset, "byteLength": length });
    let accessor = |view: u32, count: u32, kind: &str, least: &[f32], most: &[f32]| {
        serde_json::json!({ "bufferView": view, "componentType": 5126, "count": count, "type": kind,
            "min": least, "max": most })
    };
    let scene = serde_json::json!({
        "asset": { "version": "2.0" },
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 } }] }],
        "buffers": [{ "byteLength": 68, "uri": format!("data:application/octet-stream;base64,{DATA}") }],
        "bufferViews": [view(0, 36), view(36, 8), view(44, 24)],
        "accessors": [
            accessor(0, 3, "VEC3", &[-1.0, -1.0, 0.0], &[1.0, 1.0, 0.0]),
            accessor(1, 2, "SCALAR", &[0.0], &[1.0]),
            accessor(2, 2, "VEC3", &[0.0, 0.0, 0.0], &[0.5, 0.0, 0.0]),
        ],
        "animations": [{
            "samplers": [{ "input": 1, "output": 2 }],
            "channels": [{ "sampler": 0, "target": { "node": 0, "path": "translation" } }],
        }],
    });
    place.write("moving.gltf", scene.to_string());
    "render moving.gltf --eye 0,0,5 --target 0,0,0 --fov 40 --size 48x32 --frames 0..1 --fps 1"
        .into()
}

#[test]
fn frames_become_pictures() {
    let place = Place::new();
    for mode in ["hybrid", "realtime-path"] {
        let ran = place.good(&format!("{TINY} {mode} --json -o {mode}.png"));
        let json = ran.json();
        assert_eq!((&json["integrator"], &json["spp"]), (&mode.into(), &1.into()));
        assert_eq!(json["size"], serde_json::json!([24, 16]));
        let count = |key: &str| json["rays"][key].as_u64().unwrap();
        assert_eq!(count("camera"), 24 * 16);
        assert!(count("shadow") > 0 && count("indirect") > 0, "{json}");
        assert_eq!(count("total"), count("camera") + count("shadow") + count("indirect"));
        assert!(json["seconds"]["render"].as_f64().unwrap() > 0.0);
        assert!(ran.stderr.contains("24x16, 1 samples a pixel;"), "{ran:?}");
        let shown = picture(&place, &format!("{mode}.png"));
        assert_eq!((shown.width, shown.height), (24, 16));
        assert!(mean(&shown) > 0.1, "the box is lit");
    }
    // Not the same way to the picture, nor the same seed.
    assert!(place.read("hybrid.png") != place.read("realtime-path.png"));
    place.good(&format!("{TINY} hybrid --seed 3 -o other.png"));
    assert!(place.read("hybrid.png") != place.read("other.png"));
}

#[test]
fn frames_do_not_depend_on_threads() {
    let place = Place::new();
    for threads in [1, 2, 5] {
        let line =
            format!("{TINY} hybrid --spp 3 --threads {threads} --aov motion,variance,normal");
        place.good(&format!("{line} -o t{threads}.exr"));
    }
    assert!(place.read("t1.exr") == place.read("t2.exr"));
    assert!(place.read("t1.exr") == place.read("t5.exr"));
}

#[test]
fn several_frames_of_an_instant_have_a_mean() {
    let place = Place::new();
    let aov = "--aov albedo,depth,instance,direct_diffuse,variance";
    let line = "render cornell --size 24x16 --max-depth 16";
    for spp in [1, 2, 64] {
        let options =
            format!("--integrator realtime-path --techniques gbuffer=rays {aov} --spp {spp}");
        let ran = place.good(&format!("{line} {options} --json -o {spp}.exr"));
        assert_eq!(ran.json()["spp"], spp);
        assert_eq!(ran.json()["rays"]["camera"], 24 * 16 * spp);
    }
    place.good(&format!("{line} --spp 256 --filter box -o reference.exr"));
    let error = |name: &str| {
        let ran = place.good(&format!("compare reference.exr {name} --metric relmse --json"));
        ran.json()["relmse"].as_f64().unwrap()
    };
    let [one, two, many] = ["1.exr", "2.exr", "64.exr"].map(error);
    assert!(two < one && many < 0.05 * one, "{one} {two} {many}");
    let [one, two] = ["1.exr", "2.exr"].map(|name| layers(&place, name));
    // What has no mean is the first frame's.
    for (layer, channel) in [("depth", "Z"), ("instance", "id")] {
        let of =
            |image: &LayeredImage| image.layer(layer).unwrap().channel(channel).unwrap().to_vec();
        assert_eq!(of(&one), of(&two), "{layer}");
    }
    assert!(one.rgb("direct_diffuse") != two.rgb("direct_diffuse"));
    assert_eq!(two.attributes["rayburst.integrator"], "realtime-path");
    assert_eq!(two.attributes["rayburst.samples"], "2");
}

#[test]
fn all_signals_are_layers() {
    let place = Place::new();
    let names = "albedo,normal,depth,position,instance,material,variance,motion,geometric_normal,\
                 roughness,metallic,emitted,direct_diffuse,direct_specular,analytic_diffuse,\
                 analytic_specular,shadow,shadow_distance,indirect_diffuse,\
                 indirect_specular,diffuse_reflectance,specular_reflectance,transparency,\
                 ambient_occlusion,diffuse_hit_distance,specular_hit_distance";
    let line = "render cornell --size 48x48";
    place.good(&format!("{line} --integrator hybrid --aov {names} -o frame.exr"));
    let frame = layers(&place, "frame.exr");
    assert!(names.split(',').all(|name| frame.layer(name).is_some()));
    assert_eq!(frame.layers.len(), names.split(',').count() + 1);
    // The surfaces are those of the other renderer, in the same units.
    let shared = "albedo,normal,depth,position,instance,material";
    let slow = "--spp 64 --filter box --max-depth 1";
    place.good(&format!("{line} {slow} --aov {shared} -o slow.exr"));
    let slow = layers(&place, "slow.exr");
    for (layer, channel, off) in [
        ("albedo", "R", 0.05),
        ("normal", "Z", 0.1),
        ("depth", "Z", 0.05),
        ("position", "Y", 0.05),
        ("instance", "id", 0.0),
        ("material", "id", 0.0),
    ] {
        let [a, b] = [&frame, &slow].map(|i| i.layer(layer).unwrap().channel(channel).unwrap());
        let alike = a.iter().zip(b).filter(|(a, b)| (**a - **b).abs() <= off).count();
        assert!(alike * 10 > 8 * a.len(), "{layer}: {alike} of {}", a.len());
    }
}

#[test]
fn the_rendered_size_is_written() {
    let place = Place::new();
    let ran = place.good(&format!("{TINY} hybrid --render-scale 0.5 --json -o half.png"));
    let half = picture(&place, "half.png");
    assert_eq!((half.width, half.height), (12, 8));
    assert_eq!(ran.json()["size"], serde_json::json!([12, 8]));
    assert_eq!(ran.json()["rays"]["camera"], 12 * 8);
}

#[test]
fn passes_can_be_left_out() {
    let place = Place::new();
    let line = "render cornell --size 24x16 --integrator hybrid --spp 8";
    let run = |options: &str, name: &str| {
        let rays =
            place.good(&format!("{line} {options} --json -o {name}.exr")).json()["rays"].clone();
        (rays, mean(&picture(&place, &format!("{name}.exr"))))
    };
    let (all, whole) = run("", "all");
    let (rays, direct) = run("--passes direct,shadows,emission", "direct");
    assert!(all["indirect"].as_u64() > Some(0));
    assert_eq!(rays["indirect"], 0);
    assert!(direct > 0.0 && direct < whole, "{direct} {whole}");
    let (rays, _) = run("--passes emission", "emission");
    assert_eq!((&rays["shadow"], &rays["indirect"]), (&0.into(), &0.into()));
    let (rays, _) = run("--max-depth 1", "shallow");
    assert_eq!(rays["indirect"], 0);
    let rays = "--techniques gbuffer=rays,shadows=rays,reflections=rays,ambient-occlusion=rays";
    assert_eq!(run(rays, "rays").0["camera"], 24 * 16 * 8);
    assert_eq!(run("--techniques gbuffer=raster", "raster").0["camera"], 0);
}

#[test]
fn a_sequence_knows_how_things_move() {
    let place = Place::new();
    let line = moving_triangle(&place);
    for spp in [1, 2] {
        let options = "--integrator hybrid --aov motion,instance";
        let ran =
            place.good(&format!("{line} {options} --spp {spp} --json -o s{spp}.{{frame}}.exr"));
        assert_eq!(ran.json()["frames"], 2);
        let [first, second] = ["0", "1"].map(|n| layers(&place, &format!("s{spp}.{n}.exr")));
        let of = |image: &LayeredImage, layer: &str, channel: &str| {
            image.layer(layer).unwrap().channel(channel).unwrap().to_vec()
        };
        assert!(of(&first, "motion", "X").iter().all(|x| *x == 0.0), "nothing before it");
        let expected = -0.5 * 16.0 / (5.0 * 20.0f32.to_radians().tan());
        let (ids, x) = (of(&second, "instance", "id"), of(&second, "motion", "X"));
        let y = of(&second, "motion", "Y");
        let mut covered = 0;
        for ((id, x), y) in ids.iter().zip(&x).zip(&y) {
            let wanted = if *id >= 0.0 { expected } else { 0.0 };
            assert!((x - wanted).abs() < 1e-3 && y.abs() < 1e-3, "{x} {y} for {wanted}");
            covered += usize::from(*id >= 0.0);
        }
        assert!(covered > 50, "{covered}");
    }
    place.good(&format!("{line} --integrator realtime-path -o film.gif"));
    assert!(place.read("film.gif").starts_with(b"GIF89a"));
    place.good(&format!("{line} --integrator hybrid -o f.####.hdr"));
    assert!(place.files().contains(&"f.0001.hdr".to_owned()));
}

#[test]
fn what_does_not_fit_frames_is_refused_with_a_reason() {
    let place = Place::new();
    for (line, words) in [
        ("render --integrator hybrid --resume -o a.exr", "the frames before it"),
        ("render --integrator realtime-path --budget 3", "--budget does not fit"),
        ("render --integrator hybrid --noise 0.1", "--noise does not fit"),
        ("render --integrator hybrid --filter box", "without a filter"),
        ("render --integrator hybrid --aperture 0.1", "pinhole"),
        ("render --integrator hybrid --focus 2", "pinhole"),
        ("render --render-scale 0.5", "--integrator hybrid or realtime-path"),
        ("render --techniques shadows=rays --integrator whitted", "--techniques is about frames"),
        ("render --passes direct", "--passes is about frames"),
        ("render --aov motion -o a.exr", "--integrator path has no AOV 'motion'; it has albedo,"),
        ("render --integrator hybrid --aov moton -o a.exr", "did you mean 'motion'?"),
        ("render --integrator hybrid --aov motion", "-o NAME.exr"),
        ("render --integrator hybird", "hybrid"),
        ("render --integrator hybrid --render-scale 0.4", "from 0.5 to 1"),
        ("render --integrator hybrid --render-scale nan", "finite"),
        ("render --integrator hybrid --techniques gbuffer=fast", "known: auto, raster, rays"),
        ("render --integrator hybrid --techniques gbufer=rays", "'gbuffer'"),
        ("render --integrator hybrid --techniques raster", "shadows=rays"),
        ("render --integrator hybrid --passes directs", "did you mean 'direct'?"),
        ("render --integrator hybrid --passes ,", "no pass is named"),
        ("bench frame --frames 63", "64"),
        ("bench frame --modes path", "hybrid, realtime-path"),
        ("bench frame --render-scales 1,2", "from 0.5 to 1"),
        ("bench frame --repeat 0", "--repeat"),
        ("bench frame --size 0x4", "empty"),
    ] {
        let ran = place.run(line);
        assert_eq!(ran.code, Some(2), "{line}: {ran:?}");
        ran.complaint(line);
        assert!(ran.stderr.contains(words), "{line}: '{words}' is not in {}", ran.stderr);
    }
    assert!(place.files().is_empty());
}

#[test]
fn a_frame_is_not_continued_as_something_else() {
    let place = Place::new();
    place.good(&format!("{TINY} hybrid -o a.exr"));
    let complaint = place.bad(1, "render cornell --size 24x16 --spp 2 --resume -o a.exr");
    assert!(complaint.contains("integrator is hybrid"), "{complaint}");
}

#[test]
fn frames_are_benchmarked() {
    let place = Place::new();
    let line =
        "bench frame cornell --size 20x12 --threads 2 --json rows.json --techniques gbuffer=rays";
    let ran = place.good(line);
    for text in [
        "cornell, 20x12, hybrid, render scale 1, 2 threads",
        "cornell, 20x12, hybrid, render scale 0.5, 2 threads",
        "cornell, 20x12, realtime-path, render scale 0.5, 2 threads",
        "rays/pixel",
        "visibility",
        "fps",
    ] {
        assert!(ran.stdout.contains(text), "{text}: {}", ran.stdout);
    }
    let rows: serde_json::Value = serde_json::from_slice(&place.read("rows.json")).unwrap();
    let rows = rows.as_array().unwrap();
    for row in rows {
        for text in ["bench", "scene", "mode", "denoiser", "pass", "unit", "machine", "isa", "date"]
        {
            assert!(row[text].is_string(), "{text}: {row}");
        }
        for number in
            ["threads", "render_scale", "rays_per_pixel", "value", "min", "max", "repeats"]
        {
            assert!(row[number].is_number(), "{number}: {row}");
        }
        assert_eq!((&row["bench"], &row["denoiser"]), (&"frame".into(), &"none".into()));
        assert_eq!((&row["threads"], &row["frames"]), (&2.into(), &64.into()));
    }
    for mode in ["hybrid", "realtime-path"] {
        for scale in [1.0, 0.5] {
            let of = |unit: &str| -> Vec<&serde_json::Value> {
                let mine = |row: &&serde_json::Value| {
                    row["mode"] == mode && row["render_scale"] == scale && row["unit"] == unit
                };
                rows.iter().filter(mine).collect()
            };
            let (times, rates) = (of("ms"), of("fps"));
            let (whole, parts) = times.split_last().unwrap();
            assert!(whole["pass"] == "frame" && parts.len() >= 5);
            assert_eq!((rates.len(), &rates[0]["pass"]), (1, &"frame".into()));
            let eye = parts.iter().find(|row| row["pass"] == "visibility").unwrap();
            assert_eq!(eye["rays_per_pixel"], 1.0);
            assert!(whole["rays_per_pixel"].as_f64() > Some(1.0));
        }
    }
    let few = "--modes hybrid --render-scales 0.75 --passes direct,shadows";
    place.good(&format!("{line} {few} --environment none --eye 0.3,0.3,-0.7 --target 0.3,0.3,0"));
    let rows: serde_json::Value = serde_json::from_slice(&place.read("rows.json")).unwrap();
    let rows = rows.as_array().unwrap();
    assert!(rows.iter().all(|row| row["mode"] == "hybrid" && row["render_scale"] == 0.75));
    let indirect = rows.iter().find(|row| row["pass"] == "indirect");
    assert!(indirect.is_none_or(|row| row["rays_per_pixel"] == 0.0));
}

#[test]
fn filtered_frames_are_the_last_ones_and_as_large_as_asked_for() {
    let place = Place::new();
    let line = "render cornell --size 32x24 --integrator hybrid --spp 6 --aov depth,direct_diffuse";
    place.good(&format!("{line} -o plain.exr"));
    for name in ["atrous", "svgf", "asvgf", "effects"] {
        place.good(&format!("{line} --denoise {name} -o {name}.exr"));
        let (plain, filtered) =
            (picture(&place, "plain.exr"), picture(&place, &format!("{name}.exr")));
        assert!(plain != filtered, "{name}");
        // The lamp aside, which a single frame shows as it is.
        assert!((mean(&filtered) / mean(&plain) - 1.0).abs() < 0.4, "{name}");
    }
    let scaled = format!("{line} --denoise effects --antialias --render-scale 0.5");
    place.good(&format!("{scaled} -o large.exr"));
    let large = layers(&place, "large.exr");
    assert_eq!((large.width, large.height), (32, 24));
    let depth = large.layers.iter().find(|layer| layer.name == "depth").unwrap();
    let values = depth.channel("Z").unwrap();
    assert_eq!(values.len(), 32 * 24);
    assert!(
        (0..12).all(|x| values[2 * x] == values[2 * x + 1] && values[2 * x] == values[32 + 2 * x])
    );
    let errors = [
        ("render cornell --denoise svgf -o a.png", "--denoise is about frames in real time"),
        ("render cornell --antialias -o a.png", "--antialias is about frames in real time"),
        ("render cornell --integrator hybrid --denoise svg -o a.png", "did you mean 'svgf'?"),
    ];
    for (line, message) in errors {
        let said = place.bad(2, line);
        assert!(said.contains(message), "{line}: {said}");
    }
}
