//! Ray recursion limit.

use glam::{UVec3, Vec3};
use rayburst_accel::{BuildOptions, RayFlags, Tlas};
use rayburst_math::Ray;
use rayburst_pipeline::{
    DispatchError, HitGroup, MAX_RECURSION_DEPTH, PipelineError, RwBuffer, ShaderTable,
};

use crate::{
    dispatch_rays::{nothing, with_threads},
    harness::{ray, structure},
    scenes::{down, scene_of, sheet, triangles},
};

fn one_sheet() -> Tlas {
    let scene = scene_of(vec![vec![triangles(vec![sheet(0.0)], true)]]);
    structure(&scene, &BuildOptions::default())
}

/// What happens when closest hit shaders trace until the payload, counted down at each, is zero: the
/// depths that shaders have left, how many rays are traced, and the result.
fn bounce(declared: u32, wanted: u32, misses: bool) -> (Vec<u32>, u32, Result<(), DispatchError>) {
    let (left, count) = (RwBuffer::<u32>::new(40), RwBuffer::<u32>::new(1));
    let result = {
        let mut table = ShaderTable::new();
        let ray_type = table.ray_type::<u32>("ray", 0, 1, 0);
        let next = |wanted: &mut u32| {
            *wanted -= 1;
            let direction = if misses { Vec3::Z } else { -Vec3::Z };
            (*wanted > 0).then(|| Ray { direction, ..ray(&down(5.0)) })
        };
        let note = |remaining| {
            let index = count.atomic_add(0, 1);
            left.store(index as usize, remaining);
        };
        table.miss("miss", move |miss, wanted: &mut u32| {
            note(miss.remaining_depth());
            if let Some(ray) = next(wanted) {
                miss.trace_ray(ray_type, RayFlags::empty(), 0xFF, &ray, wanted);
            }
        });
        let group = HitGroup::triangles("sheet").closest_hit(move |hit, wanted: &mut u32| {
            note(hit.remaining_depth());
            if let Some(ray) = next(wanted) {
                hit.trace_ray(ray_type, RayFlags::empty(), 0xFF, &ray, wanted);
            }
        });
        table.hit(&group, ());
        let generate = table.ray_generation(|launch| {
            assert_eq!(launch.remaining_depth(), declared);
            let mut wanted = wanted + 1;
            if let Some(ray) = next(&mut wanted) {
                launch.trace_ray(ray_type, RayFlags::empty(), 0xFF, &ray, &mut wanted);
            }
        });
        table.build(declared).unwrap().dispatch_rays(&one_sheet(), generate, 1, 1, 1)
    };
    let count = count.load(0);
    (left.to_vec()[..count as usize].to_vec(), count, result)
}

macro_rules! depths {
    ($($name:ident = $declared:literal;)*) => {
        $(
            mod $name {
                use super::*;

                #[test]
                fn is_reached() {
                    for misses in [false, true] {
                        let (left, count, result) = bounce($declared, $declared, misses);
                        assert_eq!((count, result), ($declared, Ok(())));
                        assert_eq!(left, (0..$declared).rev().collect::<Vec<u32>>());
                    }
                }

                #[test]
                fn is_not_exceeded() {
                    for misses in [false, true] {
                        let (left, count, result) = bounce($declared, $declared + 3, misses);
                        assert_eq!(count, $declared, "nothing is traced beyond");
                        assert_eq!(left.len() as u32, $declared);
                        let limit = $declared;
                        let launch = UVec3::ZERO;
                        assert_eq!(result, Err(DispatchError::RecursionDepth { launch, limit }));
                    }
                }
            }
        )*
    };
}

depths! {
    depth_of_0 = 0;
    depth_of_1 = 1;
    depth_of_2 = 2;
    depth_of_7 = 7;
    depth_of_31 = 31;
}

#[test]
fn more_than_31_cannot_be_declared() {
    assert_eq!(MAX_RECURSION_DEPTH, 31);
    for depth in [32, u32::MAX] {
        let error = ShaderTable::new().build(depth).err();
        assert_eq!(error, Some(PipelineError::RecursionDepth { depth, limit: 31 }));
    }
}

#[test]
fn the_message_names_launch_limit_and_fix() {
    let message = bounce(2, 3, false).2.unwrap_err().to_string();
    for part in ["launch [0, 0, 0]", "depth is 2", "declare more", "`remaining_depth`"] {
        assert!(message.contains(part), "{message}");
    }
}

#[test]
fn beyond_it_the_payload_stays() {
    let payload = RwBuffer::<u32>::new(1);
    let mut table = ShaderTable::new();
    let ray_type = table.ray_type::<u32>("ray", 0, 1, 0);
    table.miss("miss", |_, payload: &mut u32| *payload = 1);
    table.no_hit();
    let generate = table.ray_generation(|launch| {
        let mut value = 42;
        launch.trace_ray(ray_type, RayFlags::empty(), 0xFF, &ray(&down(5.0)), &mut value);
        payload.store(0, value);
    });
    let result = table.build(0).unwrap().dispatch_rays(&one_sheet(), generate, 1, 1, 1);
    assert!(result.is_err());
    assert_eq!(payload.load(0), 42);
}

/// Whichever thread fails first, the first launch that fails is named, and all others run.
macro_rules! threads {
    ($($name:ident = $threads:literal;)*) => {
        $(
            #[test]
            fn $name() {
                fails_first(UVec3::new(19, 11, 3), $threads, |at| at == UVec3::new(7, 10, 2));
                fails_first(UVec3::new(19, 11, 3), $threads, |at| at.x >= 9 && at.y >= 5);
                fails_first(UVec3::new(33, 40, 1), $threads, |at| at.x + at.y > 20);
                fails_first(UVec3::new(64, 1, 1), $threads, |at| at.x % 2 == 1);
                fails_first(UVec3::new(8, 8, 8), $threads, |_| true);
            }
        )*
    };
}

threads! {
    first_failing_launch_of_one_thread = 1;
    first_failing_launch_of_two_threads = 2;
    first_failing_launch_of_three_threads = 3;
    first_failing_launch_of_eight_threads = 8;
}

fn fails_first(size: UVec3, threads: usize, fails: fn(UVec3) -> bool) {
    let runs = RwBuffer::<u32>::new(1);
    let mut table = ShaderTable::new();
    let ray_type = table.ray_type::<u32>("ray", 0, 1, 0);
    table.miss("miss", move |miss, _: &mut u32| {
        let up = Ray::new(Vec3::ZERO, Vec3::Z);
        if fails(miss.launch_index()) {
            miss.trace_ray(ray_type, RayFlags::empty(), 0xFF, &up, &mut 0);
        }
    });
    let generate = table.ray_generation(|launch| {
        runs.atomic_add(0, 1);
        let up = Ray::new(Vec3::ZERO, Vec3::Z);
        launch.trace_ray(ray_type, RayFlags::empty(), 0xFF, &up, &mut 0);
    });
    let pipeline = table.build(1).unwrap();
    let all = (0..size.z).flat_map(|z| (0..size.y).map(move |y| (y, z)));
    let all = all.flat_map(|(y, z)| (0..size.x).map(move |x| UVec3::new(x, y, z)));
    let first = all.into_iter().find(|&at| fails(at)).unwrap();
    with_threads(threads, || {
        for _ in 0..5 {
            let result = pipeline.dispatch_rays(&nothing(), generate, size.x, size.y, size.z);
            assert_eq!(result, Err(DispatchError::RecursionDepth { launch: first, limit: 1 }));
        }
    });
    drop(pipeline);
    assert_eq!(runs.load(0), 5 * size.element_product());
}

/// A dispatch that fails leaves nothing behind for the next.
#[test]
fn the_next_dispatch_is_not_concerned() {
    let mut table = ShaderTable::new();
    let ray_type = table.ray_type::<u32>("ray", 0, 1, 0);
    table.no_miss();
    let up = Ray::new(Vec3::ZERO, Vec3::Z);
    let fails = table.ray_generation(move |launch| {
        launch.trace_ray(ray_type, RayFlags::empty(), 0xFF, &up, &mut 0);
    });
    let works = table.ray_generation(|_| {});
    let pipeline = table.build(0).unwrap();
    assert!(pipeline.dispatch_rays(&nothing(), fails, 1, 1, 1).is_err());
    assert!(pipeline.dispatch_rays(&nothing(), works, 1, 1, 1).is_ok());
}
