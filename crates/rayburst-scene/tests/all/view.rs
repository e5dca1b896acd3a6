//! View files: what they set, in which units, and what they refuse.

use std::fs;

use glam::Vec3;
use rayburst_image::{RgbImage, write_hdr};
use rayburst_scene::{
    Environment, LightKind, Projection, Scene,
    import::{LoadOptions, apply_view, load},
};

fn apply(json: &str) -> Result<Scene, String> {
    let dir = tempfile::tempdir().expect("temporary folder");
    let path = dir.path().join("a.view.json");
    fs::write(&path, json).expect("file");
    let mut scene = Scene { metres_per_unit: 1.0, ..Scene::default() };
    apply_view(&mut scene, &path).map(|()| scene).map_err(|e| {
        let text = e.to_string();
        assert!(text.contains("a.view.json"), "{text}");
        text
    })
}

#[test]
fn all_fields_are_read() {
    let scene = apply(
        r#"{ "metres_per_unit": 0.001, "exposure": -3.5, "environment": "none",
          "cameras": [
            { "name": "door", "eye": [0, 0, 10], "target": [0, 0, 0], "up": [0, 1, 0], "fov": 90,
              "aperture": 2, "focus": 7 },
            { "eye": [1, 2, 3], "target": [1, 2, 0] }],
          "sun": { "direction": [0, -2, 0], "illuminance": 5000 },
          "lights": [
            { "type": "point", "position": [1, 2, 3], "intensity": 300, "color": [1, 0.5, 0] },
            { "type": "spot", "position": [0, 5, 0], "direction": [0, -3, 0], "intensity": 10,
              "inner": 0, "outer": 60 },
            { "type": "directional", "direction": [1, 0, 0], "intensity": 7 }] }"#,
    )
    .expect("view");
    assert_eq!((scene.metres_per_unit, scene.exposure), (0.001, Some(-3.5)));
    assert!(matches!(scene.environment, Some(Environment::None)));

    assert_eq!((scene.views[0].name.as_str(), scene.views[1].name.as_str()), ("door", "1"));
    let camera = scene.views[0].camera;
    assert_eq!((camera.eye(), camera.aperture, camera.focus), (Vec3::Z * 10.0, 2.0, 7.0));
    let Projection::Perspective { fov } = camera.projection else { panic!("orthographic") };
    assert!((fov - std::f32::consts::FRAC_PI_2).abs() < 1e-6);
    assert_eq!(scene.views[1].camera.focus, 3.0);

    let [point, spot, directional, sun] = scene.world_lights[..] else { panic!("four lights") };
    assert_eq!(point.kind, LightKind::Point { position: Vec3::new(1.0, 2.0, 3.0) });
    assert_eq!(directional.intensity, Vec3::splat(7.0));
    assert_eq!(sun.intensity, Vec3::splat(5000.0));
    let LightKind::Directional { direction, .. } = sun.kind else { panic!("sun") };
    assert_eq!(direction, -Vec3::Y);
    let LightKind::Spot { direction, cos_inner, cos_outer, .. } = spot.kind else { panic!("spot") };
    assert_eq!((direction, cos_inner), (-Vec3::Y, 1.0));
    assert!((cos_outer - 0.5).abs() < 1e-6);

    // 300 cd seen from 2 m away make 75 lux, in a scene of millimetres too.
    let distance_in_units = 2.0 / scene.metres_per_unit;
    let lux = point.intensity / (distance_in_units * distance_in_units);
    assert!(lux.abs_diff_eq(Vec3::new(75.0, 37.5, 0.0), 1e-3), "{lux}");
}

#[test]
fn an_empty_view_changes_nothing() {
    let scene = apply("{}").expect("view");
    assert!(scene.views.is_empty() && scene.world_lights.is_empty());
    assert!(scene.environment.is_none() && scene.exposure.is_none());
}

#[test]
fn the_sky_has_one_sun_from_the_views_direction() {
    let scene = apply(
        r#"{ "environment": "sky", "sun": { "direction": [0.5, -1, 0], "illuminance": 60000 } }"#,
    )
    .expect("view");
    assert!(matches!(scene.environment, Some(Environment::Map(_))));
    let [sun] = scene.world_lights[..] else { panic!("one sun") };
    let lux = rayburst_image::colour::luminance(sun.intensity);
    assert!((lux - 60_000.0).abs() < 10.0, "{lux}");
    let LightKind::Directional { direction, .. } = sun.kind else { panic!("sun") };
    assert!(direction.abs_diff_eq(Vec3::new(0.5, -1.0, 0.0).normalize(), 1e-5));
    assert_eq!(apply(r#"{ "environment": "sky" }"#).expect("view").world_lights.len(), 1);
}

#[test]
fn problems_are_told_with_their_place_and_the_nearest_name() {
    let camera = |fields: &str| format!(r#"{{ "cameras": [{{ "eye": [0,0,0], {fields} }}] }}"#);
    let light = |fields: &str| format!(r#"{{ "lights": [{{ "intensity": 1, {fields} }}] }}"#);
    for (json, parts) in [
        (r#"{ "camras": [] }"#.to_owned(), vec!["camras", "did you mean 'cameras'"]),
        (camera(r#""targt": [1,0,0]"#), vec!["cameras[0]", "did you mean 'target'"]),
        (camera(r#""fov": 40"#), vec!["cameras[0].target", "missing"]),
        (camera(r#""target": [0,0,0]"#), vec!["cameras[0].target", "same point"]),
        (camera(r#""target": [1,0,0], "fov": 180"#), vec!["cameras[0].fov", "below 180"]),
        (camera(r#""target": [1,0]"#), vec!["cameras[0].target", "three finite numbers"]),
        (camera(r#""target": [1,0,"x"]"#), vec!["three finite numbers"]),
        (camera(r#""target": [1,0,1e39]"#), vec!["three finite numbers"]),
        (camera(r#""target": [1,0,0], "name": 5"#), vec!["cameras[0].name", "a text"]),
        (light(r#""type": "pont""#), vec!["lights[0].type", "did you mean 'point'"]),
        (light(r#""type": "point""#), vec!["lights[0].position", "missing"]),
        (light(r#""type": "directional", "direction": [0,0,0]"#), vec!["must not be zero"]),
        (r#"{ "lights": {} }"#.to_owned(), vec!["lights", "a list"]),
        (r#"{ "sun": { "illuminance": 3 } }"#.to_owned(), vec!["sun.direction", "missing"]),
        (r#"{ "metres_per_unit": 0 }"#.to_owned(), vec!["metres_per_unit", "above 0"]),
        (r#"{ "exposure": "automatic" }"#.to_owned(), vec!["exposure", "auto"]),
        (r#"{ "environment": "skye" }"#.to_owned(), vec!["environment", "sky, none or"]),
        (r#"{ "environment": "/etc/x.hdr" }"#.to_owned(), vec!["relative"]),
        (r#"{ "environment": "missing.hdr" }"#.to_owned(), vec!["cannot read", "missing.hdr"]),
        ("{ \"cameras\":\n [}".to_owned(), vec!["line 2"]),
        ("[]".to_owned(), vec!["must be an object"]),
        (String::new(), vec!["line 1"]),
        ("[".repeat(100_000), vec!["line 1"]),
    ] {
        let dir = tempfile::tempdir().expect("temporary folder");
        let path = dir.path().join("a.view.json");
        fs::write(&path, &json).expect("file");
        let mut scene = Scene::default();
        let error = apply_view(&mut scene, &path).expect_err(&json).to_string();
        assert!(parts.iter().all(|part| error.contains(part)), "{error} lacks {parts:?}");
        assert!(scene.views.is_empty() && scene.world_lights.is_empty());
    }
}

#[test]
fn views_beside_a_scene_or_given_are_applied_when_loading() {
    let dir = tempfile::tempdir().expect("temporary folder");
    let obj = dir.path().join("my.scene.obj");
    fs::write(&obj, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").expect("obj");
    let picture = RgbImage::new(4, 2, Vec3::splat(0.5));
    fs::create_dir(dir.path().join("env")).expect("folder");
    write_hdr(&dir.path().join("env/e.hdr"), &picture).expect("hdr");
    fs::write(dir.path().join("my.scene.view.json"), r#"{ "environment": "env\\e.hdr" }"#)
        .expect("view");
    let other = dir.path().join("other.json");
    fs::write(&other, r#"{ "exposure": 2 }"#).expect("view");

    let scene = load(&obj, &LoadOptions::default()).expect("scene");
    let Some(Environment::Map(map)) = &scene.environment else { panic!("no map") };
    assert_eq!(map.size, (4, 2));
    let options = LoadOptions { view: Some(other), ..LoadOptions::default() };
    let scene = load(&obj, &options).expect("scene");
    assert!(scene.environment.is_none() && scene.exposure == Some(2.0));
    let options = LoadOptions { view: Some("nowhere.json".into()), ..LoadOptions::default() };
    assert!(load(&obj, &options).is_err());
    fs::write(dir.path().join("my.scene.view.json"), "{ broken").expect("view");
    assert!(load(&obj, &LoadOptions::default()).is_err());
}

#[test]
fn every_shared_view_is_read() {
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/scenes");
    let Ok(folders) = fs::read_dir(root) else {
        eprintln!("skipped: {root} is not there");
        return;
    };
    let files = folders.flatten().filter_map(|f| fs::read_dir(f.path()).ok()).flatten().flatten();
    let mut count = 0;
    for file in files.filter(|f| f.file_name().to_string_lossy().ends_with(".view.json")) {
        let mut scene = Scene::default();
        apply_view(&mut scene, &file.path()).unwrap_or_else(|e| panic!("{e}"));
        assert!(!scene.views.is_empty() && scene.environment.is_some());
        count += 1;
    }
    assert!(count >= 8, "{count}");
}
