//! Seeing each other is mutual.

use glam::Vec3;
use rayburst_math::hash::Rng;
use rayburst_render::visible;
use rayburst_scene::{Material, Scene};

use crate::scenes::{flat, floor, zoo};

#[test]
fn a_sheet_hides_what_is_behind_it() {
    let mut scene = Scene::default();
    let grey = scene.add_material("grey", Material::diffuse(Vec3::ONE));
    scene.add_mesh("sheet", vec![floor(1.0, 0.0).into_primitive(grey)]);
    let up = Vec3::Y;
    let far = Vec3::new(3.0, 0.0, 0.0);
    let pairs = [(up, -up), (up, 2.0 * up), (up + far, -up + far), (up, up)];
    assert_eq!(visible(&flat(&scene), &pairs), [false, true, true, true]);
}

#[test]
fn visibility_is_symmetric() {
    let (scene, _) = zoo();
    let mut rng = Rng::new(8);
    let mut point = || scene.bounds.lower + scene.bounds.extent() * rng.vec3();
    let pairs: Vec<(Vec3, Vec3)> = (0..20_000).map(|_| (point(), point())).collect();
    let reversed: Vec<(Vec3, Vec3)> = pairs.iter().map(|&(a, b)| (b, a)).collect();
    let seen = visible(&scene, &pairs);
    assert_eq!(seen, visible(&scene, &reversed));
    let count = seen.iter().filter(|&&s| s).count();
    assert!((1000..19_000).contains(&count), "{count}");
}
