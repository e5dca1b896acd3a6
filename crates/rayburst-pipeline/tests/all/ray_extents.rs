//! Ray extents: triangles are hit for `t_min < t < t_max`, procedural primitives for `t_min ≤ t ≤ t_max`.

use std::sync::Mutex;

use glam::Vec3;
use rayburst_accel::{BuildOptions, RayFlags};
use rayburst_math::Ray;
use rayburst_pipeline::{HitGroup, ShaderTable};

use crate::{
    harness::{once, structure},
    scenes::{ball, scene_of, sheet, solids, triangles},
};

/// What happens to a ray down from 4 to a sheet at 0, at `t` = 4 sharp: closest hits and any hits.
fn at_sheet(t_min: f32, t_max: f32, flags: RayFlags) -> [u32; 2] {
    let scene = scene_of(vec![vec![triangles(vec![sheet(0.0)], false)]]);
    let counts = Mutex::new([0; 2]);
    let mut table = ShaderTable::new();
    let ray_type = table.ray_type::<[u32; 2]>("ray", 0, 1, 0);
    table.no_miss();
    let group = HitGroup::triangles("sheet").closest_hit(|hit, counts: &mut [u32; 2]| {
        assert_eq!(hit.t(), 4.0);
        counts[0] += 1;
    });
    let group = group.any_hit(|hit, counts| {
        counts[1] += 1;
        hit.accept_hit()
    });
    table.hit(&group, ());
    let generate = table.ray_generation(|launch| {
        let ray = Ray::with_interval(Vec3::new(0.0, 0.0, 4.0), -Vec3::Z, t_min, t_max);
        launch.trace_ray(ray_type, flags, 0xFF, &ray, &mut counts.lock().unwrap());
    });
    once(table, &structure(&scene, &BuildOptions::default()), generate);
    counts.into_inner().unwrap()
}

/// The same for a procedural primitive that reports 4, and with all that `report_hit` said.
fn at_point(t_min: f32, t_max: f32, flags: RayFlags) -> ([u32; 2], Vec<bool>) {
    let scene = scene_of(vec![vec![solids(vec![ball(0.0, 0.5)], false)]]);
    let (counts, answers) = (Mutex::new([0; 2]), Mutex::new(vec![]));
    let mut table = ShaderTable::new();
    let ray_type = table.ray_type::<[u32; 2]>("ray", 0, 1, 0);
    table.no_miss();
    let group = HitGroup::<[u32; 2], ()>::procedural("point", |shader| {
        assert_eq!(shader.t_current(), t_max);
        let accepted = shader.report_hit(4.0, 0, ());
        answers.lock().unwrap().push(accepted);
    });
    let group = group.closest_hit(|hit, counts| {
        assert_eq!(hit.t(), 4.0);
        counts[0] += 1;
    });
    let group = group.any_hit(|hit, counts| {
        counts[1] += 1;
        hit.accept_hit()
    });
    table.hit(&group, ());
    let generate = table.ray_generation(|launch| {
        let ray = Ray::with_interval(Vec3::new(0.0, 0.0, 4.0), -Vec3::Z, t_min, t_max);
        launch.trace_ray(ray_type, flags, 0xFF, &ray, &mut counts.lock().unwrap());
    });
    once(table, &structure(&scene, &BuildOptions::default()), generate);
    let (counts, answers) = (*counts.lock().unwrap(), answers.lock().unwrap().clone());
    (counts, answers)
}

const INFINITY: f32 = f32::INFINITY;

/// An interval, and whether it holds 4 without its ends, and with them.
macro_rules! intervals {
    ($($name:ident = ($t_min:expr, $t_max:expr, $open:literal, $closed:literal);)*) => {
        mod triangles_exclude_the_ends {
            use super::*;
            $(
                #[test]
                fn $name() {
                    let hits = u32::from($open);
                    assert_eq!(at_sheet($t_min, $t_max, RayFlags::empty()), [hits, hits]);
                    let opaque = RayFlags::FORCE_OPAQUE;
                    assert_eq!(at_sheet($t_min, $t_max, opaque), [hits, 0]);
                    let first = RayFlags::ACCEPT_FIRST_HIT_AND_END_SEARCH;
                    assert_eq!(at_sheet($t_min, $t_max, first), [hits, hits]);
                    assert_eq!(at_sheet($t_min, $t_max, first | opaque), [hits, 0]);
                }
            )*
        }
        mod procedural_primitives_include_the_ends {
            use super::*;
            $(
                #[test]
                fn $name() {
                    let hits = u32::from($closed);
                    let first = RayFlags::ACCEPT_FIRST_HIT_AND_END_SEARCH;
                    for flags in [RayFlags::empty(), first] {
                        let (counts, answers) = at_point($t_min, $t_max, flags);
                        assert_eq!(counts, [hits, hits]);
                        // The shader may be left out, but never says that a hit outside is accepted.
                        assert!(answers.iter().all(|&accepted| accepted == $closed), "{answers:?}");
                        let flags = flags | RayFlags::FORCE_OPAQUE;
                        assert_eq!(at_point($t_min, $t_max, flags).0, [hits, 0]);
                    }
                }
            )*
        }
    };
}

intervals! {
    whole = (0.0, INFINITY, true, true);
    both_ends_infinite = (f32::NEG_INFINITY, INFINITY, true, true);
    around = (3.5, 4.25, true, true);
    begins_there = (4.0, INFINITY, false, true);
    begins_just_before = (4.0f32.next_down(), INFINITY, true, true);
    begins_just_after = (4.0f32.next_up(), INFINITY, false, false);
    ends_there = (0.0, 4.0, false, true);
    ends_just_before = (0.0, 4.0f32.next_down(), false, false);
    ends_just_after = (0.0, 4.0f32.next_up(), true, true);
    only_there = (4.0, 4.0, false, true);
    from_just_before_to_just_after = (4.0f32.next_down(), 4.0f32.next_up(), true, true);
    before = (0.0, 3.0, false, false);
    after = (5.0, INFINITY, false, false);
    backwards = (5.0, 3.0, false, false);
    negative = (-10.0, -1.0, false, false);
}

/// Behind the origin.
#[test]
fn negative_distances() {
    let scene = scene_of(vec![vec![triangles(vec![sheet(6.0)], true)]]);
    let distance = Mutex::new(0.0);
    let mut table = ShaderTable::new();
    let ray_type = table.ray_type::<f32>("ray", 0, 1, 0);
    table.miss("miss", |_, t: &mut f32| *t = f32::INFINITY);
    table.hit(&HitGroup::triangles("sheet").closest_hit(|hit, t: &mut f32| *t = hit.t()), ());
    let generate = table.ray_generation(|launch| {
        for (t_min, t) in [(-2.0, INFINITY), (-3.0, -2.0), (0.0, INFINITY)] {
            let ray = Ray::with_interval(Vec3::new(0.0, 0.0, 4.0), -Vec3::Z, t_min, INFINITY);
            let mut distance = distance.lock().unwrap();
            launch.trace_ray(ray_type, RayFlags::empty(), 0xFF, &ray, &mut distance);
            assert_eq!(*distance, t);
        }
    });
    once(table, &structure(&scene, &BuildOptions::default()), generate);
}
