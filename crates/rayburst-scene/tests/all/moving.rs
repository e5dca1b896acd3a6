//! Deforming meshes from instant to instant: what is hit at one does not depend on those before.

use glam::{Affine3A, Mat4, Quat, Vec2, Vec3};
use rayburst_accel::{AcceptAll, BuildOptions, BuildQuality, TraceOptions, UpdatePolicy};
use rayburst_math::Ray;
use rayburst_scene::{
    FlatScene, Flattener, Material, MorphTarget, Pose, Primitive, Scene, Skin, VertexSkin,
};

const SIDE: u32 = 40;

/// A sheet in the plane z = 0, from (−1, −1) to (1, 1).
fn sheet() -> Primitive {
    let place = |i: u32| i as f32 / SIDE as f32 * 2.0 - 1.0;
    let all = || (0..=SIDE).flat_map(move |y| (0..=SIDE).map(move |x| (place(x), place(y))));
    let quads = (0..SIDE).flat_map(|y| (0..SIDE).map(move |x| y * (SIDE + 1) + x));
    Primitive {
        positions: all().map(|(x, y)| Vec3::new(x, y, 0.0)).collect(),
        normals: Some(all().map(|_| Vec3::Z).collect()),
        uvs: vec![all().map(|(x, y)| Vec2::new(x, y)).collect()],
        indices: quads
            .flat_map(|a| [[a, a + 1, a + SIDE + 2], [a, a + SIDE + 2, a + SIDE + 1]])
            .collect(),
        ..Primitive::default()
    }
}

/// A sheet that follows two joints, one that follows two targets, in two places, and one at rest.
/// Returns the second joint's node and that of the targets, too.
fn scene() -> (Scene, usize, usize) {
    let mut scene = Scene::default();
    scene.add_material("white", Material::diffuse(Vec3::ONE));
    let mut skinned = sheet();
    let follows = |p: &Vec3| {
        let second = 0.5 + 0.5 * p.y;
        let mut weights = [0.0; 8];
        weights[..2].copy_from_slice(&[1.0 - second, second]);
        VertexSkin { joints: [0, 1, 0, 0, 0, 0, 0, 0], weights }
    };
    skinned.skin = Some(skinned.positions.iter().map(follows).collect());
    let skinned = scene.add_mesh("skinned", vec![skinned]) as usize;
    let mut morphed = sheet();
    let target = |to: fn(Vec3) -> Vec3| MorphTarget {
        positions: Some(morphed.positions.iter().map(|&p| to(p)).collect()),
        ..MorphTarget::default()
    };
    morphed.targets = vec![
        target(|p| Vec3::new(0.0, 0.0, (5.0 * p.x).sin())),
        // Quads become needles, and some triangles nothing at all where the weight is 1.
        target(|p| Vec3::new(-p.x, 0.3 * p.x, 0.0)),
    ];
    let morphed = scene.add_mesh("morphed", vec![morphed]) as usize;
    scene.nodes[morphed].instances =
        vec![Affine3A::from_translation(Vec3::X * 3.0), Affine3A::from_translation(Vec3::X * 6.0)];
    let rest = scene.add_mesh("rest", vec![sheet()]) as usize;
    scene.nodes[rest].instances = vec![Affine3A::from_translation(Vec3::X * -3.0)];
    let first = scene.nodes.len();
    scene.nodes.extend([rayburst_scene::Node::default(), rayburst_scene::Node::default()]);
    scene.skins.push(Skin {
        joints: vec![first as u32, first as u32 + 1],
        inverse_bind: vec![Mat4::IDENTITY; 2],
    });
    scene.nodes[skinned].skin = Some(0);
    (scene, first + 1, morphed)
}

/// The instant of a number.
fn pose(scene: &Scene, joint: usize, morphed: usize, instant: usize) -> Pose {
    let mut pose = Pose::rest(scene);
    let at = instant as f32 / 7.0;
    pose.world[joint] = Affine3A::from_rotation_translation(
        Quat::from_rotation_y(2.5 * at) * Quat::from_rotation_x(-at),
        Vec3::new(0.0, 0.2 * at, 0.5 * at),
    );
    pose.weights[morphed] = vec![at, [0.0, 0.4, 0.8, 1.0][instant % 4]];
    pose
}

/// All that can be known of the hits of some rays.
fn seen(flat: &FlatScene) -> (String, usize) {
    let mut hits = 0;
    let mut text = format!("{:?} {:?} ", flat.bounds, flat.instances);
    for i in 0..600u32 {
        // Low-discrepancy numbers.
        let part = |step: f32| (i as f32 * step).fract();
        let from = Vec3::new(11.0 * part(0.755) - 4.0, 3.0 * part(0.57) - 1.5, 4.0);
        let to = Vec3::new(11.0 * part(0.819) - 4.0, 2.4 * part(0.671) - 1.2, 0.0);
        let ray = Ray::new(from, (to - from) * Vec3::new(0.1, 1.0, 1.0));
        let hit = flat.tlas.closest_hit(&ray, &TraceOptions::default(), &AcceptAll);
        text += &format!("{hit:?}");
        if hit.is_hit() {
            hits += 1;
            text += &format!("{:?}", flat.surface(&hit));
        }
    }
    (text, hits)
}

#[test]
fn an_instant_does_not_depend_on_those_before() {
    let (scene, joint, morphed) = scene();
    let policies = [
        UpdatePolicy::default(),
        UpdatePolicy::RefitAlways,
        UpdatePolicy::RebuildAlways,
        UpdatePolicy::EveryFrames(3),
        UpdatePolicy::TimeBudget { seconds: 1e-4 },
    ];
    for quality in [BuildQuality::Fast, BuildQuality::Balanced, BuildQuality::Best] {
        let options = BuildOptions { quality, ..BuildOptions::default() };
        let anew: Vec<String> = (0..8)
            .map(|instant| {
                let pose = pose(&scene, joint, morphed, instant);
                let (text, hits) = seen(&Flattener::new(&scene, options).at(&pose).unwrap());
                assert!(hits > 100, "{hits}");
                text
            })
            .collect();
        assert!(anew[0] != anew[1] && anew[1] != anew[7]);
        for policy in policies {
            let mut flattener = Flattener::new(&scene, options).with_policy(policy);
            let mut held = vec![];
            for instant in [0, 1, 2, 3, 4, 5, 6, 7, 3, 3, 0, 6, 1] {
                let pose = pose(&scene, joint, morphed, instant);
                let flat = flattener.at(&pose).unwrap();
                assert!(seen(&flat).0 == anew[instant], "{policy:?}, {quality:?}, {instant}");
                held.push((instant, flat));
                // Those in use are not changed by what comes after.
                if held.len() > 3 {
                    let (instant, flat) = held.remove(0);
                    assert!(seen(&flat).0 == anew[instant], "{policy:?}, {quality:?}, {instant}");
                }
            }
        }
    }
}
