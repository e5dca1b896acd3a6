//! Closest hit shaders: once for a ray that hits, with the nearest accepted hit.

use std::sync::Mutex;

use glam::{DVec3, Vec3};
use rayburst_accel::{BuildOptions, RayFlags};
use rayburst_pipeline::{Barycentrics, HitGroup, RwBuffer, ShaderTable};

use crate::{
    harness::{once, ray, structure, verify},
    model::{Policy, Table, flag},
    scenes::{
        ONE_TYPE, RICH_TYPES, Random, clear, down, rays, rich, scene_of, sheet, some_triangles,
        triangles,
    },
};

#[test]
fn once_a_ray_that_hits() {
    let scene = rich();
    let table = Table::fit(&scene, &RICH_TYPES, |_| Policy::Absent);
    let tally = verify(&scene, &table, &rays(&scene, &table, 600, 0, 101));
    assert_eq!(tally.closest_hits + tally.misses, 600);
    assert_eq!((tally.any_hits, tally.exact), (0, 600));
    assert!(tally.closest_hits > 200, "{tally:?}");
}

/// The nearest of many layers, in any order of their indices.
#[test]
fn the_nearest_of_many() {
    let mut random = Random(103);
    for _ in 0..10 {
        let mut heights: Vec<f64> = (0..60).map(|n| f64::from(n) * 0.05).collect();
        for n in (1..heights.len()).rev() {
            heights.swap(n, random.below(n + 1));
        }
        let sheets = heights.iter().map(|&z| sheet(z)).collect();
        let scene = scene_of(vec![vec![triangles(sheets, true)]]);
        let table = Table::fit(&scene, &ONE_TYPE, |_| Policy::Absent);
        let found = clear(&scene, &table, down(5.0));
        let stop = found.1.candidates[found.1.stops[0].unwrap()].event;
        assert_eq!(heights[stop.place.primitive as usize], f64::from(59) * 0.05);
        assert_eq!(verify(&scene, &table, &[found]).closest_hits, 1);
    }
}

#[test]
fn barycentrics_weigh_second_and_third_vertex() {
    let corners = [DVec3::ZERO, DVec3::X * 4.0, DVec3::Y * 4.0];
    let scene = scene_of(vec![vec![triangles(vec![corners], true)]]);
    let seen = Mutex::new(vec![]);
    let mut table = ShaderTable::new();
    let ray_type = table.ray_type::<Vec<Barycentrics>>("ray", 0, 1, 0);
    table.no_miss();
    let group = HitGroup::triangles("triangle").closest_hit(|hit, seen: &mut Vec<Barycentrics>| {
        assert_eq!((hit.hit().u, hit.hit().v), (hit.attributes().u, hit.attributes().v));
        seen.push(hit.attributes());
    });
    table.hit(&group, ());
    let generate = table.ray_generation(|launch| {
        for (x, y) in [(1.0, 0.5), (0.25, 3.0), (2.0, 1.5)] {
            let ray = rayburst_math::Ray::new(Vec3::new(x, y, 3.0), -Vec3::Z);
            let mut seen = seen.lock().unwrap();
            launch.trace_ray(ray_type, RayFlags::empty(), 0xFF, &ray, &mut seen);
        }
    });
    once(table, &structure(&scene, &BuildOptions::default()), generate);
    let expected = [(0.25, 0.125), (0.0625, 0.75), (0.5, 0.375)];
    assert_eq!(*seen.lock().unwrap(), expected.map(|(u, v)| Barycentrics { u, v }));
}

#[test]
fn skip_closest_hit_shader_still_hits() {
    let scene = rich();
    let table = Table::fit(&scene, &RICH_TYPES, |_| Policy::Absent);
    let with = verify(&scene, &table, &rays(&scene, &table, 300, 0, 107));
    let found = rays(&scene, &table, 300, flag::SKIP_CLOSEST_HIT, 107);
    let without = verify(&scene, &table, &found);
    assert_eq!((without.closest_hits, without.misses), (0, with.misses));
}

/// Local shading: records carry their own data.
#[test]
fn record_data() {
    let geometries = (0..5).map(|n| triangles(vec![sheet(f64::from(n))], true)).collect();
    let scene = scene_of(vec![geometries]);
    let name = Mutex::new(String::new());
    let mut table = ShaderTable::new();
    let ray_type = table.ray_type::<String>("ray", 0, 1, 0);
    table.no_miss();
    let group = HitGroup::triangles("named").closest_hit(
        |hit: &rayburst_pipeline::ClosestHit<'_, _, (String, [u32; 3])>, name: &mut String| {
            *name = format!("{} {:?}", hit.record().0, hit.record().1);
        },
    );
    for n in 0..5 {
        table.hit(&group, (format!("record {n}"), [n, 2 * n, 3 * n]));
    }
    let generate = table.ray_generation(|launch| {
        let mut name = name.lock().unwrap();
        launch.trace_ray(ray_type, RayFlags::empty(), 0xFF, &ray(&down(9.0)), &mut name);
    });
    once(table, &structure(&scene, &BuildOptions::default()), generate);
    assert_eq!(*name.lock().unwrap(), "record 4 [4, 8, 12]");
}

/// Two thousand triangles in instances of all sorts.
#[test]
fn many_triangles() {
    let mut random = Random(109);
    let geometries =
        (0..4).map(|n| triangles(some_triangles(&mut random, 60), n % 2 == 0)).collect();
    let mut scene = scene_of(vec![geometries]);
    scene.instances = crate::scenes::transforms()
        .map(|transform| crate::model::Instance::new(0, transform))
        .to_vec();
    let table = Table::fit(&scene, &ONE_TYPE, |_| Policy::IgnoreFront);
    let tally = verify(&scene, &table, &rays(&scene, &table, 200, 0, 113));
    assert!(tally.closest_hits > 120, "{tally:?}");
}

/// Every launch shades its own hit.
#[test]
fn launches_at_the_same_time() {
    let sheets = (0..256).map(|n| {
        let x = f64::from(n) * 20.0;
        sheet(f64::from(n % 7)).map(|corner| corner + DVec3::new(x, 0.0, 0.0))
    });
    let scene = scene_of(vec![vec![triangles(sheets.collect(), true)]]);
    let heights = RwBuffer::<f32>::new(256);
    let mut table = ShaderTable::new();
    let ray_type = table.ray_type::<f32>("ray", 0, 1, 0);
    table.no_miss();
    let group = HitGroup::triangles("sheet").closest_hit(|hit, height: &mut f32| {
        assert_eq!(hit.primitive_index(), hit.launch_index().x);
        *height = hit.world_position().z;
    });
    table.hit(&group, ());
    let generate = table.ray_generation(|launch| {
        let x = launch.launch_index().x;
        let origin = Vec3::new(20.0 * x as f32, 0.0, 10.0);
        let mut height = -1.0;
        let ray = rayburst_math::Ray::new(origin, -Vec3::Z);
        launch.trace_ray(ray_type, RayFlags::empty(), 0xFF, &ray, &mut height);
        heights.store(x as usize, height);
    });
    let tlas = structure(&scene, &BuildOptions::default());
    table.build(1).unwrap().dispatch_rays(&tlas, generate, 256, 1, 1).unwrap();
    assert!(heights.to_vec().into_iter().zip(0..).all(|(z, n): (f32, u32)| z == (n % 7) as f32));
}
