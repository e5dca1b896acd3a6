//! Every verb does its work.

use crate::program::Place;

#[test]
fn scenes_are_listed_and_described() {
    let place = Place::new();
    let list = place.good("scenes").stdout;
    for name in ["cornell", "spheres", "furnace", "hemisphere-room", "stadium", "veach-mis", "dof"]
    {
        assert!(list.lines().any(|l| l.starts_with(name)), "{name} is not in\n{list}");
    }
    assert!(list.contains("Fig. 26.24"));
    let all = place.good("scenes --json").json();
    assert!(all.as_array().unwrap().len() >= 10);
    assert_eq!(all[0]["name"], "cornell");
}

#[test]
fn info_tells_what_is_in_a_scene() {
    let place = Place::new();
    let json = place.good("info cornell --json").json();
    for key in [
        "triangles",
        "instances",
        "meshes",
        "materials",
        "textures",
        "lights",
        "cameras",
        "animations",
        "bounds",
        "warnings",
    ] {
        assert!(!json[key].is_null(), "{key}: {json}");
    }
    assert!(json["triangles"].as_u64().unwrap() >= 30);
    assert_eq!(json["cameras"][0], "front");
    let text = place.good("info cornell").stdout;
    assert!(text.contains("triangles") && text.contains("front"), "{text}");
    let complaint = place.bad(1, "info missing.gltf");
    assert!(complaint.contains("missing.gltf"), "{complaint}");
}

#[test]
fn pictures_are_compared() {
    let place = Place::new();
    place.good("render --size 32x32 --spp 1 -o a.exr");
    place.good("render --size 32x32 --spp 4 -o b.exr");
    let same = place.good("compare a.exr a.exr --metric rmse,flip,ssim,psnr --json").json();
    assert_eq!((same["rmse"].as_f64(), same["flip"].as_f64()), (Some(0.0), Some(0.0)));
    assert!((same["ssim"].as_f64().unwrap() - 1.0).abs() < 1e-6);
    assert!(same["psnr"].is_null(), "infinite: {same}");
    let text = place.good("compare a.exr b.exr --heatmap map.png").stdout;
    assert!(text.contains("hdr-flip") && text.contains("relmse"), "{text}");
    assert!(place.read("map.png").starts_with(b"\x89PNG"));
    place.good("render --size 16x32 --spp 1 -o c.exr");
    let complaint = place.bad(1, "compare a.exr c.exr");
    assert!(complaint.contains("32x32 and 16x32"), "{complaint}");
    place.bad(1, "compare a.exr nothing.exr");
    place.write("not.png", "no picture");
    place.bad(1, "compare a.exr not.png");
}

#[test]
fn drawn_figures_print_their_property() {
    let place = Place::new();
    for (figure, words) in [
        ("26.2", "Eq. 26.2"),
        ("26.3", "0 of"),
        ("26.4", "sum − 1"),
        ("26.5", "difference in standard deviations"),
        ("26.7", "reported outside of the interval"),
        ("26.8", "bytes of the bottom level"),
        ("26.16", "rays that visit together"),
    ] {
        let ran = place.good(&format!("figure {figure}"));
        assert!(ran.stdout.contains(words), "{figure}: {}", ran.stdout);
        assert!(place.read(&format!("figure-{figure}.png")).starts_with(b"\x89PNG"));
    }
}

#[test]
fn completions_name_verbs_and_options() {
    let place = Place::new();
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let script = place.good(&format!("completions {shell}")).stdout;
        assert!(script.contains("environment-rotation"), "{shell}");
    }
}

#[test]
fn rays_are_benchmarked() {
    let place = Place::new();
    let line = "bench rays cornell --repeat 1 --seconds 0.001 --resolution 32 --sets primary,ao";
    let ran = place.good(&format!("{line} --json rows.json"));
    assert!(ran.stdout.contains("Mrays/s"), "{ran:?}");
    let rows: serde_json::Value = serde_json::from_slice(&place.read("rows.json")).unwrap();
    assert_eq!(rows[0]["ray_set"], "primary");
    assert!(rows[0]["value"].as_f64().unwrap() > 0.0);
    let engines =
        ["fast:auto", "fast:call", "balanced:auto", "balanced:call", "best:auto", "best:call"];
    let names = |rows: &serde_json::Value| -> Vec<String> {
        let rows = rows.as_array().unwrap().iter();
        rows.map(|row| row["engine"].as_str().unwrap().replace("rayburst:", "")).collect()
    };
    assert_eq!(names(&rows), [engines, engines].concat());
    for row in rows.as_array().unwrap() {
        for text in ["bench", "scene", "ray_set", "unit", "machine", "isa", "date"] {
            assert!(row[text].is_string(), "{text}: {row}");
        }
        for number in [
            "threads",
            "repeats",
            "min",
            "max",
            "rays",
            "hits",
            "triangles",
            "nodes",
            "leaves",
            "packet_share",
            "in_flight",
        ] {
            assert!(row[number].is_number(), "{number}: {row}");
        }
        assert!(row.get("ratio").is_none() && row.get("best_peer").is_none());
        assert_eq!(row["hits"], rows[if row["ray_set"] == "ao" { 6 } else { 0 }]["hits"]);
    }
    place.good(&format!("{line} --engines rayburst:fast --mode call --json few.json"));
    let few: serde_json::Value = serde_json::from_slice(&place.read("few.json")).unwrap();
    assert_eq!(names(&few), ["fast:call", "fast:call"]);
    assert_eq!((&few[0]["packet_share"], &few[0]["in_flight"]), (&0.0.into(), &1.0.into()));
    let every = "auto,single,interleaved,packet,stream,call";
    place.good(&format!("{line} --engines rayburst:ploc --mode {every} --json ploc.json"));
    let ploc: serde_json::Value = serde_json::from_slice(&place.read("ploc.json")).unwrap();
    let all: Vec<String> = every.split(',').map(|mode| format!("ploc:{mode}")).collect();
    assert_eq!(names(&ploc), [all.clone(), all].concat());
    assert!(ploc[3]["packet_share"] == 1.0 && ploc[3]["in_flight"].as_f64() > Some(16.0));
    assert!(ploc[4]["packet_share"] == 0.0 && ploc[4]["in_flight"].as_f64() > Some(16.0));
    let complaint = place.bad(1, &format!("{line} --peer embree=missing.so"));
    assert!(complaint.contains("missing.so"), "{complaint}");
}

#[test]
fn builds_are_benchmarked() {
    let place = Place::new();
    let line = "bench build cornell spheres --repeat 1 --seconds 0.001";
    let ran = place.good(&format!("{line} --json rows.json --plot bars.png"));
    assert!(ran.stdout.contains("Mtri/s") && ran.stdout.contains("SAH cost"), "{ran:?}");
    let rows: serde_json::Value = serde_json::from_slice(&place.read("rows.json")).unwrap();
    let rows = rows.as_array().unwrap();
    // Of each scene two figures of three presets, and refitting all and a few triangles.
    let builders =
        ["hlbvh", "hlbvh", "binned-sah", "binned-sah", "spatial-splits", "spatial-splits"];
    assert_eq!(rows.len(), 2 * (builders.len() + 2));
    let is_build = |row: &&serde_json::Value| row["depth"].is_number();
    let (built, fitted): (Vec<_>, Vec<_>) = rows.iter().partition(is_build);
    assert!(fitted.iter().all(|row| row["engine"].as_str().unwrap().starts_with("rayburst:refit")));
    assert!(fitted.iter().all(|row| row["unit"] == "Mtri/s" && row["value"].as_f64() > Some(0.0)));
    let units = ["Mtri/s", "B/tri"].iter().cycle();
    for ((row, unit), builder) in built.iter().zip(units).zip(builders.iter().cycle()) {
        assert_eq!((&row["bench"], &row["unit"]), (&"build".into(), &(*unit).into()));
        assert_eq!(row["builder"], *builder);
        assert!(row["value"].as_f64().unwrap() > 0.0 && row["sah_cost"].as_f64().unwrap() > 0.0);
        assert!(row["depth"].as_u64().unwrap() >= 1);
        assert!(row.get("ratio").is_none(), "no peer: {row}");
    }
    assert!(place.read("bars.png").starts_with(b"\x89PNG"));
    let ran = place.good("bench build cornell --preset lbvh,ploc --repeat 1 --seconds 0.001");
    assert!(ran.stdout.contains("rayburst:lbvh") && ran.stdout.contains("rayburst:ploc"));
    let complaint = place.bad(1, &format!("{line} --peer embree=missing.so"));
    assert!(complaint.contains("missing.so"), "{complaint}");
}

#[test]
fn pipelines_are_benchmarked() {
    let place = Place::new();
    let line = "bench pipeline cornell --repeat 1 --seconds 0.0001 --resolution 24 --json p.json";
    let ran = place.good(line);
    for form in ["query", "batch", "portable", "recursive:4", "any-hit", "recursive:256"] {
        assert!(ran.stdout.contains(form), "{form}: {}", ran.stdout);
    }
    let rows: serde_json::Value = serde_json::from_slice(&place.read("p.json")).unwrap();
    let rows = rows.as_array().unwrap();
    assert_eq!(rows.len(), 9);
    assert!(rows.iter().all(|row| row["bench"] == "pipeline" && row["unit"] == "Mrays/s"));
    assert!(rows[1..].iter().all(|row| row["ratio"].as_f64() > Some(0.0)));
}

#[test]
fn updates_are_benchmarked() {
    let place = Place::new();
    let line = "bench update --scale 0.002 --repeat 1 --seconds 0.0001";
    let ran = place.good(&format!("{line} --json rows.json"));
    assert!(ran.stdout.contains("Minst/s") && ran.stdout.contains("times as fast"), "{ran:?}");
    let rows: serde_json::Value = serde_json::from_slice(&place.read("rows.json")).unwrap();
    let rows = rows.as_array().unwrap();
    for row in rows {
        assert_eq!(row["bench"], "update");
        for text in ["case", "policy", "scene", "unit", "machine", "date"] {
            assert!(row[text].is_string(), "{text}: {row}");
        }
        assert!(row["value"].as_f64() > Some(0.0) && row["min"].as_f64() <= row["max"].as_f64());
    }
    let of = |case: &str| rows.iter().filter(|row| row["case"] == case).collect::<Vec<_>>();
    let [deform, instances, twist, particles] =
        ["deform", "instances", "twist", "particles"].map(of);
    let counts = [deform.len(), instances.len(), twist.len(), particles.len()];
    assert_eq!(counts, [11, 10, 24, 32]);
    assert!(instances.iter().all(|row| row["instances"] == 200));
    assert!(twist.iter().all(|row| row["frames"] == 40));
    let all = twist.iter().find(|row| row["policy"] == "rebuild").unwrap();
    assert!(all["rebuilds"] == 40 && all["longest"].as_f64() >= all["value"].as_f64());
    let ran = place.good(&format!("{line} cornell --cases deform,twist"));
    assert!(ran.stdout.contains("cornell") && !ran.stdout.contains("Minst/s"), "{ran:?}");
}

#[test]
fn an_inspected_path_is_the_renderers() {
    let place = Place::new();
    let numbers = |text: &str| -> Vec<f64> {
        let inside = text.split(['(', ')']).nth(1).unwrap_or_default();
        inside.split(", ").map(|n| n.parse().unwrap()).collect()
    };
    let mut lit = 0;
    for (scene, pixel) in [("cornell", "80,370"), ("veach-mis", "300,300"), ("spheres", "200,200")]
    {
        let told = place.good(&format!("inspect {scene} --pixel {pixel} --samples 8")).stdout;
        assert!(told.contains("eye ray from") && told.contains("nodes"), "{told}");
        // Glass does not look for light.
        let searches = told.contains("looks for light") && told.contains("pdf");
        assert!(searches || scene == "spheres", "{told}");
        let mut samples = 0;
        for line in told.lines().filter(|l| l.trim_start().starts_with("radiance (")) {
            let (own, reference) = line.split_once("reference").unwrap();
            let (own, reference) = (numbers(own), numbers(reference));
            for (a, b) in own.iter().zip(&reference) {
                assert!((a - b).abs() <= 1e-3 * b.abs().max(1e-3), "{scene}: {line}");
                lit += u32::from(*b > 0.0);
            }
            samples += 1;
        }
        assert_eq!(samples, 8, "{told}");
    }
    assert!(lit > 20, "only {lit} values above 0");
}
