//! Hit group table indexing: the ray's contribution + its multiplier × the geometry's index + the
//! instance's contribution; miss and callable table indexing.

use std::sync::Mutex;

use glam::{DAffine3, DVec3};
use rayburst_accel::{BuildOptions, RayFlags};
use rayburst_pipeline::{CallableId, DispatchError, HitGroup, PipelineError, ShaderTable};

use crate::{
    harness::{ray, structure, verify},
    model::{Instance, Policy, RayType, Scene, Table},
    scenes::{
        Random, ball, down, rays, scene_of, sheet, solids, some_solids, some_triangles, triangles,
        without_ends,
    },
};

/// Three instances of three geometries.
fn scene(contributions: [u32; 3]) -> Scene {
    let mut random = Random(23);
    let geometries = (0..3).map(|n| triangles(some_triangles(&mut random, 8), n == 1)).collect();
    let places = [DVec3::ZERO, DVec3::new(2.5, 0.0, 0.0), DVec3::new(-2.5, 1.0, 0.5)];
    let instances = places.iter().zip(contributions).map(|(place, contribution)| Instance {
        contribution,
        ..Instance::new(0, DAffine3::from_translation(*place))
    });
    Scene { instances: instances.collect(), blases: vec![geometries] }
}

fn check(contribution: u32, multiplier: u32, instances: [u32; 3]) {
    let scene = scene(instances);
    let types = [
        RayType { contribution, multiplier, miss: 0 },
        RayType { contribution: (contribution + 1) % 16, multiplier, miss: 2 },
    ];
    let table = Table::fit(&scene, &types, without_ends);
    assert_eq!(
        table.records.len() as u32,
        types.iter().map(|t| t.contribution).max().unwrap()
            + 2 * multiplier
            + instances.iter().max().unwrap()
            + 1
    );
    let rays = rays(&scene, &table, 100, 0, 31);
    let tally = verify(&scene, &table, &rays);
    assert!(tally.closest_hits > 20 && tally.any_hits > 20 && tally.misses > 10, "{tally:?}");
}

macro_rules! grid {
    ($($name:ident = $contribution:literal;)*) => {
        $(
            mod $name {
                grid!(@multiplier multiplier_0, $contribution, 0);
                grid!(@multiplier multiplier_1, $contribution, 1);
                grid!(@multiplier multiplier_2, $contribution, 2);
                grid!(@multiplier multiplier_15, $contribution, 15);
            }
        )*
    };
    (@multiplier $name:ident, $contribution:literal, $multiplier:literal) => {
        mod $name {
            use super::super::*;

            #[test]
            fn instances_share_records() {
                check($contribution, $multiplier, [0; 3]);
            }

            #[test]
            fn instances_have_their_own() {
                check($contribution, $multiplier, [0, 46, 92]);
            }

            #[test]
            fn instances_overlap() {
                check($contribution, $multiplier, [5, 1, 3]);
            }
        }
    };
}

grid! {
    contribution_0 = 0;
    contribution_1 = 1;
    contribution_7 = 7;
    contribution_15 = 15;
}

#[test]
fn geometries_of_both_kinds_count_together() {
    let mut random = Random(5);
    let geometries = vec![
        solids(some_solids(&mut random, 4), false),
        triangles(some_triangles(&mut random, 6), false),
        solids(some_solids(&mut random, 4), true),
        triangles(some_triangles(&mut random, 6), true),
    ];
    let scene = scene_of(vec![geometries]);
    let types = [RayType { contribution: 2, multiplier: 3, miss: 0 }];
    let table = Table::fit(&scene, &types, without_ends);
    assert_eq!(table.records.len(), 2 + 3 * 3 + 1);
    let tally = verify(&scene, &table, &rays(&scene, &table, 200, 0, 37));
    assert!(tally.closest_hits > 50 && tally.intersections > 50);
}

/// By hand: geometry 2 of an instance of contribution 100, for rays of contribution 3, multiplier 4.
#[test]
fn the_formula_by_hand() {
    let away = || triangles(vec![sheet(90.0)], true);
    let mut scene = scene_of(vec![vec![away(), away(), triangles(vec![sheet(0.0)], true)]]);
    scene.instances[0].contribution = 100;
    let tlas = structure(&scene, &BuildOptions::default());
    let found = Mutex::new(0);
    let mut table = ShaderTable::new();
    let ray_type = table.ray_type::<u32>("ray", 3, 4, 0);
    table.no_miss();
    let group = HitGroup::triangles("group").closest_hit(
        |hit: &rayburst_pipeline::ClosestHit<'_, _, u32>, found: &mut u32| {
            *found = *hit.record();
        },
    );
    for record in 0..112 {
        assert_eq!(table.hit(&group, 1000 + record), record);
    }
    let generate = table.ray_generation(|launch| {
        let mut record = 0;
        launch.trace_ray(ray_type, RayFlags::empty(), 0xFF, &ray(&down(5.0)), &mut record);
        *found.lock().unwrap() = record;
    });
    table.build(1).unwrap().dispatch_rays(&tlas, generate, 1, 1, 1).unwrap();
    assert_eq!(*found.lock().unwrap(), 1000 + 3 + 4 * 2 + 100);
}

#[test]
fn null_records() {
    // Triangles of null records stop rays without a shader, procedural primitives do not stop them.
    let geometries = vec![solids(vec![ball(1.0, 0.5)], false), triangles(vec![sheet(0.0)], false)];
    let scene = scene_of(vec![geometries]);
    let mut table = Table::fit(&scene, &crate::scenes::ONE_TYPE, |_| Policy::Accept);
    let at = [crate::scenes::clear(&scene, &table, down(5.0))];
    assert_eq!(verify(&scene, &table, &at).intersections, 1);
    table.records.fill(crate::model::Record::Null);
    let at = [crate::scenes::clear(&scene, &table, down(5.0))];
    assert_eq!(at[0].1.candidates.len(), 1);
    assert_eq!(
        verify(&scene, &table, &at),
        crate::harness::Tally { exact: 1, ..Default::default() }
    );
}

#[test]
fn hit_groups_without_closest_hit_shaders() {
    let geometries = vec![triangles(vec![sheet(1.0)], false), triangles(vec![sheet(0.0)], true)];
    let scene = scene_of(vec![geometries]);
    let mut table = Table::fit(&scene, &crate::scenes::ONE_TYPE, |_| Policy::Accept);
    let crate::model::Record::Triangles { closest_hit, .. } = &mut table.records[0] else {
        panic!("triangles expected");
    };
    *closest_hit = false;
    let at = [crate::scenes::clear(&scene, &table, down(5.0))];
    let tally = verify(&scene, &table, &at);
    assert_eq!((tally.any_hits, tally.closest_hits, tally.misses), (1, 0, 0));
}

macro_rules! misses {
    ($($name:ident = $index:literal;)*) => {
        $(
            #[test]
            fn $name() {
                let scene = scene_of(vec![vec![triangles(vec![sheet(0.0)], true)]]);
                let types = [RayType { contribution: 0, multiplier: 0, miss: $index }];
                let mut table = Table::fit(&scene, &types, without_ends);
                table.misses = vec![true; 5];
                let up = crate::model::Ray { direction: DVec3::Z, ..down(5.0) };
                let up = [crate::scenes::clear(&scene, &table, up)];
                let seen = crate::harness::run(
                    &scene,
                    &table,
                    &[up[0].0],
                    &structure(&scene, &BuildOptions::default()),
                );
                assert_eq!(seen[0].misses, [$index]);
            }
        )*
    };
}

misses! {
    miss_index_0 = 0;
    miss_index_1 = 1;
    miss_index_4 = 4;
}

#[test]
fn null_miss_records_leave_the_payload() {
    let scene = scene_of(vec![vec![triangles(vec![sheet(0.0)], true)]]);
    let mut table = Table::fit(&scene, &crate::scenes::ONE_TYPE, without_ends);
    table.misses = vec![false];
    let up = crate::model::Ray { direction: DVec3::Z, ..down(5.0) };
    let up = [crate::scenes::clear(&scene, &table, up)];
    assert_eq!(
        verify(&scene, &table, &up),
        crate::harness::Tally { exact: 1, ..Default::default() }
    );
}

#[test]
fn callables_by_index_at_run_time() {
    let tlas = structure(&Scene::default(), &BuildOptions::default());
    let results = Mutex::new(vec![0u32; 24]);
    let mut table = ShaderTable::new();
    let shaders: Vec<CallableId<u32>> =
        (0..8).map(|n| table.callable(move |_, data: &mut u32| *data = 10 * *data + n)).collect();
    let all = &results;
    let generate = table.ray_generation(move |launch| {
        let x = launch.launch_index().x;
        let mut data = x;
        launch.call_shader(shaders[x as usize % 8], &mut data);
        all.lock().unwrap()[x as usize] = data;
    });
    table.build(0).unwrap().dispatch_rays(&tlas, generate, 24, 1, 1).unwrap();
    let results = results.into_inner().unwrap();
    assert_eq!(results, (0..24).map(|x| 10 * x + x % 8).collect::<Vec<_>>());
}

/// The sum may exceed what the parts may be.
#[test]
fn greatest_contributions() {
    let mut scene =
        scene_of(vec![vec![triangles(vec![sheet(0.0)], true), triangles(vec![sheet(1.0)], true)]]);
    scene.instances[0].contribution = 0xFF_FFFF;
    let tlas = structure(&scene, &BuildOptions::default());
    let mut table = ShaderTable::new();
    table.ray_type::<u32>("ray", 15, 15, 0);
    table.no_miss();
    table.no_hit();
    let generate = table.ray_generation(|_| panic!("nothing may run"));
    let error = table.build(1).unwrap().dispatch_rays(&tlas, generate, 1, 1, 1).unwrap_err();
    let expected = PipelineError::NoHitRecord {
        ray_type: "ray".to_owned(),
        instance: 0,
        geometry: 0,
        index: 0xFF_FFFF + 15,
        records: 1,
    };
    assert_eq!(error, DispatchError::Pipeline(expected));
}
