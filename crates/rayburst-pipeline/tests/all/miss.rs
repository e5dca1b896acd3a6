//! Miss shaders: they run if and only if nothing is hit.

use glam::Vec3;
use rayburst_accel::{BuildOptions, RayFlags};
use rayburst_math::Ray;
use rayburst_pipeline::{HitGroup, RwBuffer, ShaderTable};

use crate::{
    dispatch_rays::nothing,
    harness::{once, ray, structure, verify},
    model::{Policy, Table, flag},
    scenes::{ONE_TYPE, RICH_TYPES, clear, down, rays, rich, scene_of, sheet, triangles},
};

#[test]
fn if_and_only_if_nothing_is_hit() {
    let scene = rich();
    let table = Table::fit(&scene, &RICH_TYPES, |_| Policy::IgnoreOdd);
    let found = rays(&scene, &table, 500, 0, 127);
    let expected = found.iter().filter(|(_, expected)| expected.stops == [None]).count();
    let tally = verify(&scene, &table, &found);
    assert_eq!(tally.misses, expected);
    assert!(expected > 100 && expected < 400, "{tally:?}");
}

#[test]
fn where_everything_is_ignored() {
    let scene = scene_of(vec![vec![triangles(vec![sheet(0.0), sheet(1.0)], false)]]);
    let table = Table::fit(&scene, &ONE_TYPE, |_| Policy::Ignore);
    let tally = verify(&scene, &table, &[clear(&scene, &table, down(5.0))]);
    assert_eq!((tally.any_hits, tally.closest_hits, tally.misses), (2, 0, 1));
}

#[test]
fn where_everything_is_culled() {
    let scene = scene_of(vec![vec![triangles(vec![sheet(0.0)], true)]]);
    let table = Table::fit(&scene, &ONE_TYPE, |_| Policy::Absent);
    for flags in [flag::CULL_FRONT, flag::CULL_OPAQUE, flag::SKIP_TRIANGLES] {
        let ray = crate::model::Ray { flags, ..down(5.0) };
        let tally = verify(&scene, &table, &[clear(&scene, &table, ray)]);
        assert_eq!((tally.closest_hits, tally.misses), (0, 1));
    }
}

#[test]
fn skip_closest_hit_shader_does_not_skip_miss_shaders() {
    let scene = scene_of(vec![vec![triangles(vec![sheet(0.0)], true)]]);
    let table = Table::fit(&scene, &ONE_TYPE, |_| Policy::Absent);
    for (direction, misses) in [(glam::DVec3::Z, 1), (-glam::DVec3::Z, 0)] {
        let ray = crate::model::Ray { direction, flags: flag::SKIP_CLOSEST_HIT, ..down(5.0) };
        let tally = verify(&scene, &table, &[clear(&scene, &table, ray)]);
        assert_eq!((tally.closest_hits, tally.misses), (0, misses));
    }
}

#[test]
fn in_an_empty_structure() {
    let count = RwBuffer::<u32>::new(1);
    let mut table = ShaderTable::new();
    let ray_type = table.ray_type::<u32>("ray", 0, 0, 0);
    table.miss("miss", |_, payload: &mut u32| *payload += 1);
    let generate = table.ray_generation(|launch| {
        let mut payload = 0;
        launch.trace_ray(ray_type, RayFlags::empty(), 0xFF, &ray(&down(5.0)), &mut payload);
        count.atomic_add(0, payload);
    });
    let pipeline = table.build(1).unwrap();
    pipeline.dispatch_rays(&nothing(), generate, 100, 1, 1).unwrap();
    drop(pipeline);
    assert_eq!(count.load(0), 100);
}

/// An environment looked up in the miss shader is the one looked up by hand.
#[test]
fn environment() {
    fn environment(direction: Vec3) -> Vec3 {
        let up = direction.normalize().z;
        Vec3::new(0.5 + 0.5 * up, direction.normalize().x.abs(), 1.0)
    }
    let scene = scene_of(vec![vec![triangles(vec![sheet(-100.0)], true)]]);
    let colours = RwBuffer::<Vec3>::new(64);
    let mut table = ShaderTable::new();
    let ray_type = table.ray_type::<Vec3>("ray", 0, 0, 0);
    table.miss("sky", |miss, colour: &mut Vec3| *colour = environment(miss.world_ray().direction));
    let black =
        HitGroup::triangles("floor").closest_hit(|_, colour: &mut Vec3| *colour = Vec3::ZERO);
    table.hit(&black, ());
    let direction_of = |x: u32| Vec3::new((x as f32).sin(), (x as f32).cos(), 0.1 * x as f32 + 0.1);
    let generate = table.ray_generation(|launch| {
        let x = launch.launch_index().x;
        let mut colour = Vec3::NAN;
        let ray = Ray::new(Vec3::ZERO, direction_of(x));
        launch.trace_ray(ray_type, RayFlags::empty(), 0xFF, &ray, &mut colour);
        colours.store(x as usize, colour);
    });
    let tlas = structure(&scene, &BuildOptions::default());
    table.build(1).unwrap().dispatch_rays(&tlas, generate, 64, 1, 1).unwrap();
    for (colour, x) in colours.to_vec().into_iter().zip(0..) {
        assert_eq!(colour, environment(direction_of(x)));
    }
}

#[test]
fn ray_and_flags_are_those_of_the_call() {
    let seen = RwBuffer::<u32>::new(1);
    let given = Ray::with_interval(Vec3::new(1.0, 2.0, 3.0), Vec3::new(0.0, 0.5, 2.0), 0.25, 7.0);
    let flags = RayFlags::CULL_OPAQUE | RayFlags::SKIP_TRIANGLES;
    let mut table = ShaderTable::new();
    let ray_type = table.ray_type::<u32>("ray", 0, 0, 0);
    table.miss("miss", move |miss, payload: &mut u32| {
        assert_eq!(*miss.world_ray(), given);
        assert_eq!(miss.ray_flags(), flags);
        *payload = 1;
    });
    let generate = table.ray_generation(|launch| {
        let mut payload = 0;
        launch.trace_ray(ray_type, flags, 0xFF, &given, &mut payload);
        seen.store(0, payload);
    });
    once(table, &nothing(), generate);
    assert_eq!(seen.load(0), 1);
}
