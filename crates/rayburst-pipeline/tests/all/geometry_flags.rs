//! Geometry flags: opacity, and `NO_DUPLICATE_ANYHIT_INVOCATION`, for all builds.

use glam::{DAffine3, DVec3};
use rayburst_accel::{BuildOptions, BuildQuality, Builder, Layout};

use crate::{
    harness::{structure, verify_in},
    model::{Geometry, Instance, Policy, Scene, Shape, Table},
    scenes::{ONE_TYPE, Random, rays, scene_of, some_solids},
};

/// Long slivers, which spatial splits cut.
fn slivers(random: &mut Random, count: usize) -> Vec<[DVec3; 3]> {
    let one = |random: &mut Random| {
        let (start, end, side) = (random.in_cube(2.0), random.in_cube(2.0), random.in_cube(0.3));
        [start, end, end + side].map(|corner| corner.as_vec3().as_dvec3())
    };
    (0..count).map(|_| one(random)).collect()
}

fn scene(procedural: bool, opaque: bool, no_duplicate_any_hit: bool) -> Scene {
    let mut random = Random(41);
    let shape = if procedural {
        Shape::Solids(some_solids(&mut random, 12))
    } else {
        Shape::Triangles(slivers(&mut random, 200))
    };
    let mut scene = scene_of(vec![vec![Geometry { shape, opaque, no_duplicate_any_hit }]]);
    let moved = DAffine3::from_translation(DVec3::new(0.5, -0.5, 0.25));
    scene.instances.push(Instance::new(0, moved));
    scene
}

/// Any hits of all rays.
fn check(
    options: &BuildOptions<'_>,
    procedural: bool,
    opaque: bool,
    no_duplicate: bool,
    policy: Policy,
) -> usize {
    let scene = scene(procedural, opaque, no_duplicate);
    let table = Table::fit(&scene, &ONE_TYPE, |_| policy);
    let tlas = structure(&scene, options);
    let mut rays = rays(&scene, &table, 150, 0, 43);
    for (_, expected) in &mut rays {
        expected.may_repeat = tlas.blases()[0].may_ask_twice() && !no_duplicate && !procedural;
    }
    let tally = verify_in(&scene, &table, &rays, &tlas);
    assert_eq!(tally.any_hits > 0, !opaque, "{tally:?}");
    tally.any_hits
}

fn options(quality: BuildQuality) -> BuildOptions<'static> {
    BuildOptions { quality, reference_budget: Some(4.0), ..BuildOptions::default() }
}

/// Tests of both kinds of geometry, both opacities, with and without the flag, for a build.
macro_rules! builds {
    ($($name:ident = $options:expr;)*) => {
        $(
            mod $name {
                builds!(@kind triangles, $options, false);
                builds!(@kind procedural_primitives, $options, true);
            }
        )*
    };
    (@kind $name:ident, $options:expr, $procedural:literal) => {
        mod $name {
            use super::super::*;
            builds!(@flags plain, $options, $procedural, false, false);
            builds!(@flags opaque, $options, $procedural, true, false);
            builds!(@flags no_duplicate_any_hit, $options, $procedural, false, true);
            builds!(@flags opaque_and_no_duplicate_any_hit, $options, $procedural, true, true);
        }
    };
    (@flags $name:ident, $options:expr, $procedural:literal, $opaque:literal, $once:literal) => {
        #[test]
        fn $name() {
            for policy in [Policy::Ignore, Policy::IgnoreOdd, Policy::IgnoreFront, Policy::EndEven] {
                check(&$options, $procedural, $opaque, $once, policy);
            }
        }
    };
}

builds! {
    fast = options(BuildQuality::Fast);
    balanced = options(BuildQuality::Balanced);
    best = options(BuildQuality::Best);
    compressed = BuildOptions { layout: Layout::Compressed, ..options(BuildQuality::Best) };
}

/// The flag does something: without it spatial splits ask again, with it they ask as often as a tree
/// without splits.
#[test]
fn spatial_splits_ask_again_unless_told_not_to() {
    let splits =
        BuildOptions { builder: Some(Builder::SpatialSplits), ..options(BuildQuality::Best) };
    let scene = scene(false, false, true);
    assert!(structure(&scene, &splits).blases()[0].may_ask_twice());
    let whole = options(BuildQuality::Balanced);
    let any_hits =
        |options, no_duplicate| check(options, false, false, no_duplicate, Policy::Ignore);
    let once = any_hits(&whole, false);
    assert_eq!(any_hits(&splits, true), once);
    assert!(any_hits(&splits, false) > once);
}
