//! `TraceRay`: which rays there are, what comes back, and who may call.

use std::sync::Mutex;

use glam::{DVec3, Vec3};
use rayburst_accel::{AcceptAll, BuildOptions, RayFlags};
use rayburst_math::Ray;
use rayburst_pipeline::{HitGroup, RwBuffer, ShaderTable};

use crate::{
    harness::{once, ray, structure, verify},
    model::{RayType, Scene, Table},
    scenes::{
        RICH_TYPES, ball, clear, down, rays, rich, scene_of, sheet, solids, triangles, without_ends,
    },
};

/// A sheet and a ball.
pub fn both() -> Scene {
    scene_of(vec![vec![triangles(vec![sheet(0.0)], false), solids(vec![ball(2.0, 0.5)], false)]])
}

fn is_missed(ray: Ray) {
    let tlas = structure(&both(), &BuildOptions::default());
    let misses = RwBuffer::<u32>::new(1);
    let mut table = ShaderTable::new();
    let ray_type = table.ray_type::<u32>("ray", 0, 1, 0);
    table.miss("miss", |_, count: &mut u32| *count += 1);
    table.hit(
        &HitGroup::triangles("sheet")
            .closest_hit(|_, _: &mut u32| panic!("no hit"))
            .any_hit(|_, _| panic!("no hit")),
        (),
    );
    table.hit(
        &HitGroup::<u32, f32>::procedural("ball", |_| panic!("no box is met"))
            .closest_hit(|_, _| panic!("no hit")),
        (),
    );
    let generate = table.ray_generation(|launch| {
        for flags in [RayFlags::empty(), RayFlags::ACCEPT_FIRST_HIT_AND_END_SEARCH] {
            let mut count = 0;
            launch.trace_ray(ray_type, flags, 0xFF, &ray, &mut count);
            misses.atomic_add(0, count);
        }
    });
    once(table, &tlas, generate);
    assert_eq!(misses.load(0), 2, "the miss shader runs once a ray");
}

macro_rules! missed {
    ($($name:ident = $change:expr;)*) => {
        $(
            #[test]
            fn $name() {
                let mut ray = ray(&down(5.0));
                let change: fn(&mut Ray) = $change;
                change(&mut ray);
                is_missed(ray);
            }
        )*
    };
}

missed! {
    nan_in_origin_x_misses = |ray| ray.origin.x = f32::NAN;
    nan_in_origin_y_misses = |ray| ray.origin.y = f32::NAN;
    nan_in_origin_z_misses = |ray| ray.origin.z = f32::NAN;
    nan_in_direction_x_misses = |ray| ray.direction.x = f32::NAN;
    nan_in_direction_y_misses = |ray| ray.direction.y = f32::NAN;
    nan_in_direction_z_misses = |ray| ray.direction.z = f32::NAN;
    nan_in_t_min_misses = |ray| ray.t_min = f32::NAN;
    nan_in_t_max_misses = |ray| ray.t_max = f32::NAN;
    nan_everywhere_misses = |ray| *ray = Ray::with_interval(Vec3::NAN, Vec3::NAN, f32::NAN, f32::NAN);
    infinite_origin_misses = |ray| ray.origin.z = f32::INFINITY;
    infinite_direction_misses = |ray| ray.direction.z = f32::NEG_INFINITY;
    zero_direction_misses = |ray| ray.direction = Vec3::ZERO;
    empty_interval_misses = |ray| (ray.t_min, ray.t_max) = (10.0, 1.0);
    interval_before_all_misses = |ray| ray.t_max = 1.0;
    interval_behind_all_misses = |ray| ray.t_min = 100.0;
    other_direction_misses = |ray| ray.direction = Vec3::Z;
}

/// Distances are in units of the direction, whatever its length.
macro_rules! lengths {
    ($($name:ident = $length:expr;)*) => {
        $(
            #[test]
            fn $name() {
                let length: f64 = $length;
                let scene = both();
                let table = Table::fit(&scene, &crate::scenes::ONE_TYPE, without_ends);
                for flags in [0, crate::model::flag::SKIP_PROCEDURAL] {
                    let ray = crate::model::Ray {
                        direction: -DVec3::Z * length,
                        t_max: 20.0 / length,
                        flags,
                        ..down(5.0)
                    };
                    let tlas = structure(&scene, &BuildOptions::default());
                    let seen = &crate::harness::run(&scene, &table, &[ray], &tlas)[0];
                    let [hit] = seen.closest_hits[..] else { panic!("one hit expected") };
                    let expected = if flags == 0 { hit.t * length < 3.0 } else { hit.t == 5.0 / length };
                    assert!(expected, "{hit:?}");
                }
            }
        )*
    };
}

lengths! {
    direction_of_a_millionth = f64::from(2.0f32.powi(-20));
    direction_of_an_eighth = 0.125;
    direction_of_one = 1.0;
    direction_of_sixteen = 16.0;
    direction_of_a_million = f64::from(2.0f32.powi(20));
}

#[test]
fn everything_at_once() {
    let scene = rich();
    let table = Table::fit(&scene, &RICH_TYPES, without_ends);
    let tally = verify(&scene, &table, &rays(&scene, &table, 1500, 0, 97));
    assert_eq!(tally.closest_hits + tally.misses, 1500);
    assert_eq!(tally.exact, 1500);
    assert!(tally.closest_hits > 400 && tally.misses > 300, "{tally:?}");
}

#[test]
fn everything_at_once_with_ends() {
    let scene = rich();
    let table = Table::fit(&scene, &RICH_TYPES, crate::scenes::with_ends);
    let tally = verify(&scene, &table, &rays(&scene, &table, 1500, 0, 98));
    assert_eq!(tally.closest_hits + tally.misses, 1500);
    assert!(tally.exact < 1500, "the order of hits matters to some");
}

#[test]
fn one_after_another_with_one_payload() {
    let tlas = structure(&both(), &BuildOptions::default());
    let notes = Mutex::new(vec![]);
    let mut table = ShaderTable::new();
    let ray_type = table.ray_type::<Vec<&'static str>>("ray", 0, 1, 0);
    table.miss("miss", |_, notes: &mut Vec<&'static str>| notes.push("miss"));
    let sheet = HitGroup::triangles("sheet");
    table.hit(&sheet.closest_hit(|_, notes: &mut Vec<&'static str>| notes.push("sheet")), ());
    table.no_hit();
    let generate = table.ray_generation(|launch| {
        let mut payload = vec!["begin"];
        let (down, up) = (ray(&down(5.0)), Ray::new(Vec3::ZERO, Vec3::Z));
        for ray in [down, up, up, down] {
            launch.trace_ray(ray_type, RayFlags::empty(), 0xFF, &ray, &mut payload);
            payload.push("back");
        }
        *notes.lock().unwrap() = payload;
    });
    once(table, &tlas, generate);
    let expected = ["begin", "sheet", "back", "miss", "back", "miss", "back", "sheet", "back"];
    assert_eq!(*notes.lock().unwrap(), expected);
}

#[test]
fn from_closest_hit_and_miss() {
    // Down to the sheet, from there up into nothing, from there down again, three rays inside each other.
    let tlas = structure(&both(), &BuildOptions::default());
    let notes = Mutex::new(vec![]);
    let mut table = ShaderTable::new();
    let ray_type = table.ray_type::<Vec<u32>>("ray", 0, 1, 0);
    table.miss("miss", move |miss, notes: &mut Vec<u32>| {
        notes.push(100 + miss.remaining_depth());
        if notes.len() < 3 {
            let ray = ray(&down(-1.0 + 6.0));
            miss.trace_ray(ray_type, RayFlags::empty(), 0xFF, &ray, notes);
        }
    });
    table.hit(
        &HitGroup::triangles("sheet").closest_hit(move |hit, notes: &mut Vec<u32>| {
            notes.push(200 + hit.remaining_depth());
            if notes.len() < 3 {
                let ray = Ray::new(hit.world_position() - Vec3::Z, -Vec3::Z);
                hit.trace_ray(ray_type, RayFlags::empty(), 0xFF, &ray, notes);
            }
        }),
        (),
    );
    table.no_hit();
    let generate = table.ray_generation(|launch| {
        let mut seen = vec![];
        launch.trace_ray(ray_type, RayFlags::empty(), 0xFF, &ray(&down(5.0)), &mut seen);
        *notes.lock().unwrap() = seen;
    });
    table.build(3).unwrap().dispatch_rays(&tlas, generate, 1, 1, 1).unwrap();
    assert_eq!(*notes.lock().unwrap(), [202, 101, 200]);
}

#[test]
fn ray_types_have_their_own_shaders() {
    let scene = rich();
    let types = [
        RayType { contribution: 0, multiplier: 2, miss: 0 },
        RayType { contribution: 1, multiplier: 2, miss: 1 },
    ];
    let table = Table::fit(&scene, &types, |record| {
        // The shadow type's hit groups accept all, the standard type's none.
        if record % 2 == 0 { crate::model::Policy::Ignore } else { crate::model::Policy::End }
    });
    let found = rays(&scene, &table, 300, 0, 15);
    let tally = verify(&scene, &table, &found);
    assert!(tally.any_hits > 50 && tally.closest_hits > 50, "{tally:?}");
    assert!(found.iter().any(|(ray, _)| ray.ray_type == 0));
    assert!(found.iter().any(|(ray, _)| ray.ray_type == 1));
}

/// Shaders may also ask the structure without shaders.
#[test]
fn queries_without_shaders() {
    let tlas = structure(&both(), &BuildOptions::default());
    let distance = RwBuffer::<f32>::new(1);
    let mut table = ShaderTable::new();
    let generate = table.ray_generation(|launch| {
        let options = RayFlags::FORCE_OPAQUE.options(0xFF);
        let hit = launch.structure().closest_hit(&ray(&down(5.0)), &options, &AcceptAll);
        distance.store(0, hit.t);
    });
    once(table, &tlas, generate);
    assert_eq!(distance.load(0), 5.0);
}

#[test]
fn a_dozen_scenes_of_random_triangles_and_solids() {
    use crate::scenes::{Random, some_solids, some_triangles, transforms};
    for seed in 0..12 {
        let mut random = Random(seed);
        let mut geometries = vec![];
        for _ in 0..1 + random.below(4) {
            let (count, opaque) = (1 + random.below(20), random.below(2) == 0);
            geometries.push(if random.below(2) == 0 {
                triangles(some_triangles(&mut random, count), opaque)
            } else {
                solids(some_solids(&mut random, count / 3 + 1), opaque)
            });
        }
        let mut scene = scene_of(vec![geometries]);
        scene.instances = transforms()[..1 + random.below(6)]
            .iter()
            .map(|&transform| crate::model::Instance::new(0, transform))
            .collect();
        let table = Table::fit(&scene, &crate::scenes::ONE_TYPE, without_ends);
        verify(&scene, &table, &rays(&scene, &table, 100, 0, seed));
    }
    let scene = both();
    let table = Table::fit(&scene, &crate::scenes::ONE_TYPE, |_| crate::model::Policy::Absent);
    assert_eq!(verify(&scene, &table, &[clear(&scene, &table, down(5.0))]).closest_hits, 1);
}
