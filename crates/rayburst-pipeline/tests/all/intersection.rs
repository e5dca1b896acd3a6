//! Intersection shaders and `ReportHit`.

use std::sync::Mutex;

use glam::Vec3;
use rayburst_accel::{BuildOptions, RayFlags, Tlas};
use rayburst_math::{HitKind, Ray};
use rayburst_pipeline::{HitGroup, Intersection, ShaderTable};

use crate::{
    harness::{once, ray, structure, verify},
    model::{Policy, Table, flag},
    scenes::{ONE_TYPE, Random, ball, down, rays, scene_of, sheet, solids, some_solids, triangles},
};

/// What a ray came to.
#[derive(Clone, Debug, Default, PartialEq)]
struct Outcome {
    any_hits: Vec<(f32, u8)>,
    stop: Option<(f32, u8, [f32; 2])>,
    misses: u32,
}

type Shader<'a, 'b, 'c> = &'a mut Intersection<'b, 'c, Outcome, [f32; 2], ()>;

/// Traces a ray to a box about the origin; what `shader` says goes through an any hit shader that ignores
/// kinds of 100 and more and ends at kind 50.
fn run(
    opaque: bool,
    flags: RayFlags,
    shader: impl Fn(Shader<'_, '_, '_>) + Send + Sync,
) -> Outcome {
    let scene = scene_of(vec![vec![solids(vec![ball(0.0, 2.0)], opaque)]]);
    let tlas = structure(&scene, &BuildOptions::default());
    let outcome = Mutex::new(Outcome::default());
    {
        let mut table = ShaderTable::new();
        let ray_type = table.ray_type::<Outcome>("ray", 0, 1, 0);
        table.miss("miss", |_, outcome: &mut Outcome| outcome.misses += 1);
        let group = HitGroup::procedural("solid", shader)
            .any_hit(|hit, outcome: &mut Outcome| {
                outcome.any_hits.push((hit.t(), hit.hit_kind()));
                match hit.hit_kind() {
                    100.. => hit.ignore_hit(),
                    50 => hit.accept_hit_and_end_search(),
                    _ => hit.accept_hit(),
                }
            })
            .closest_hit(|hit, outcome| {
                assert_eq!(outcome.stop, None, "one closest hit a ray");
                assert!(!hit.is_front_face());
                assert_eq!(hit.hit().kind, HitKind::procedural(hit.hit_kind()));
                outcome.stop = Some((hit.t(), hit.hit_kind(), hit.attributes()));
            });
        table.hit(&group, ());
        let generate = table.ray_generation(|launch| {
            let ray = Ray::with_interval(Vec3::new(0.0, 0.0, 5.0), -Vec3::Z, 1.0, 20.0);
            let mut outcome = outcome.lock().unwrap();
            launch.trace_ray(ray_type, flags, 0xFF, &ray, &mut outcome);
        });
        once(table, &tlas, generate);
    }
    outcome.into_inner().unwrap()
}

const NONE: RayFlags = RayFlags::empty();

#[test]
fn no_report_is_no_hit() {
    assert_eq!(run(false, NONE, |_| {}), Outcome { misses: 1, ..Outcome::default() });
}

#[test]
fn report_hit() {
    let outcome = run(false, NONE, |shader| {
        assert_eq!(shader.t_current(), 20.0);
        assert!(shader.report_hit(4.0, 3, [1.0, 2.0]));
        assert_eq!(shader.t_current(), 4.0);
    });
    assert_eq!(outcome.any_hits, [(4.0, 3)]);
    assert_eq!(outcome.stop, Some((4.0, 3, [1.0, 2.0])));
    assert_eq!(outcome.misses, 0);
}

#[test]
fn ignored_reports_leave_the_interval() {
    let outcome = run(false, NONE, |shader| {
        assert!(!shader.report_hit(4.0, 100, [0.0; 2]));
        assert_eq!(shader.t_current(), 20.0);
        assert!(shader.report_hit(6.0, 7, [3.0; 2]));
        assert_eq!(shader.t_current(), 6.0);
        assert!(!shader.report_hit(5.0, 120, [9.0; 2]));
        assert_eq!(shader.t_current(), 6.0);
    });
    assert_eq!(outcome.any_hits, [(4.0, 100), (6.0, 7), (5.0, 120)]);
    assert_eq!(outcome.stop, Some((6.0, 7, [3.0; 2])));
}

#[test]
fn opaque_primitives_do_not_ask() {
    for flags in [NONE, RayFlags::FORCE_OPAQUE] {
        let outcome =
            run(flags == NONE, flags, |shader| assert!(shader.report_hit(4.0, 100, [5.0; 2])));
        assert_eq!(outcome.any_hits, []);
        assert_eq!(outcome.stop, Some((4.0, 100, [5.0; 2])));
    }
}

#[test]
fn reports_outside_the_interval() {
    let outcome = run(false, NONE, |shader| {
        for t in [0.5, -1.0, 20.5, f32::INFINITY, f32::NEG_INFINITY, f32::NAN] {
            assert!(!shader.report_hit(t, 0, [0.0; 2]), "{t}");
        }
        assert_eq!(shader.t_current(), 20.0);
    });
    assert_eq!(outcome, Outcome { misses: 1, ..Outcome::default() });
}

#[test]
fn the_nearest_of_several_reports() {
    let outcome = run(false, NONE, |shader| {
        let answers = [8.0, 9.0, 5.0, 7.0, 4.0, 4.5].map(|t| shader.report_hit(t, t as u8, [t; 2]));
        assert_eq!(answers, [true, false, true, false, true, false]);
    });
    assert_eq!(outcome.any_hits, [(8.0, 8), (5.0, 5), (4.0, 4)]);
    assert_eq!(outcome.stop, Some((4.0, 4, [4.0; 2])));
}

/// The end of the interval is included, even where it is an accepted hit's.
#[test]
fn reports_at_the_current_end() {
    let outcome = run(false, NONE, |shader| {
        assert!(shader.report_hit(5.0, 1, [1.0; 2]));
        assert!(shader.report_hit(5.0, 2, [2.0; 2]));
    });
    assert_eq!(outcome.any_hits.len(), 2);
    assert_eq!(outcome.stop, Some((5.0, 2, [2.0; 2])));
}

#[test]
fn nothing_is_accepted_after_the_end_of_the_search() {
    let outcome = run(false, NONE, |shader| {
        assert!(shader.report_hit(6.0, 50, [1.0; 2]));
        assert!(!shader.report_hit(5.0, 1, [2.0; 2]));
    });
    assert_eq!(outcome.any_hits, [(6.0, 50)]);
    assert_eq!(outcome.stop, Some((6.0, 50, [1.0; 2])));
    let outcome = run(false, RayFlags::ACCEPT_FIRST_HIT_AND_END_SEARCH, |shader| {
        assert!(!shader.report_hit(7.0, 100, [1.0; 2]));
        assert!(shader.report_hit(6.0, 1, [1.0; 2]));
        assert!(!shader.report_hit(5.0, 1, [2.0; 2]));
    });
    assert_eq!(outcome.any_hits, [(7.0, 100), (6.0, 1)]);
    assert_eq!(outcome.stop, Some((6.0, 1, [1.0; 2])));
}

#[test]
fn skip_closest_hit_shader() {
    let outcome = run(false, RayFlags::SKIP_CLOSEST_HIT_SHADER, |shader| {
        assert!(shader.report_hit(5.0, 1, [1.0; 2]));
    });
    assert_eq!(outcome, Outcome { any_hits: vec![(5.0, 1)], ..Outcome::default() });
}

#[test]
fn skip_procedural_primitives() {
    let outcome = run(false, RayFlags::SKIP_PROCEDURAL_PRIMITIVES, |_| panic!("not skipped"));
    assert_eq!(outcome, Outcome { misses: 1, ..Outcome::default() });
}

/// Culling by facing is for triangles.
#[test]
fn culling_does_not_concern_procedural_primitives() {
    let flags = RayFlags::CULL_BACK_FACING_TRIANGLES | RayFlags::CULL_FRONT_FACING_TRIANGLES;
    let outcome = run(false, flags, |shader| assert!(shader.report_hit(5.0, 1, [1.0; 2])));
    assert_eq!(outcome.stop, Some((5.0, 1, [1.0; 2])));
}

#[test]
fn the_payload_can_be_read() {
    let outcome = run(false, NONE, |shader| {
        assert_eq!(shader.payload().map(|outcome| outcome.any_hits.len()), Some(0));
        shader.report_hit(6.0, 1, [1.0; 2]);
        assert_eq!(shader.payload().map(|outcome| outcome.any_hits.len()), Some(1));
    });
    assert_eq!(outcome.any_hits.len(), 1);
}

macro_rules! hit_kinds {
    ($($name:ident = $reported:literal => $kind:literal;)*) => {
        $(
            #[test]
            fn $name() {
                let outcome = run(true, NONE, |shader| {
                    assert!(shader.report_hit(4.0, $reported, [1.0; 2]));
                });
                assert_eq!(outcome.stop, Some((4.0, $kind, [1.0; 2])));
            }
        )*
    };
}

hit_kinds! {
    hit_kind_0 = 0 => 0;
    hit_kind_1 = 1 => 1;
    hit_kind_127 = 127 => 127;
    hit_kind_128_is_0 = 128 => 0;
    hit_kind_254_is_not_a_front_face = 254 => 126;
    hit_kind_255_is_not_a_back_face = 255 => 127;
}

/// Attributes of a size come back as they were reported, to both shaders.
fn check_attributes<A: bytemuck::Pod + PartialEq + std::fmt::Debug + Send + Sync>(
    value: A,
    other: A,
) {
    let scene = scene_of(vec![vec![solids(vec![ball(0.0, 2.0)], false)]]);
    let tlas = structure(&scene, &BuildOptions::default());
    let seen = Mutex::new(vec![]);
    let mut table = ShaderTable::new();
    let ray_type = table.ray_type::<u32>("ray", 0, 1, 0);
    table.no_miss();
    let group = HitGroup::<u32, A>::procedural("solid", move |shader| {
        assert!(shader.report_hit(6.0, 0, other));
        assert!(shader.report_hit(5.0, 0, value));
        assert!(!shader.report_hit(5.5, 0, other));
    });
    let group = group
        .any_hit(|hit, _| {
            seen.lock().unwrap().push(hit.attributes());
            hit.accept_hit()
        })
        .closest_hit(|hit, _| seen.lock().unwrap().push(hit.attributes()));
    table.hit(&group, ());
    let generate = table.ray_generation(|launch| {
        launch.trace_ray(ray_type, NONE, 0xFF, &ray(&down(5.0)), &mut 0);
    });
    once(table, &tlas, generate);
    assert_eq!(*seen.lock().unwrap(), [other, value, value]);
}

macro_rules! attributes {
    ($($name:ident = $value:expr, $other:expr;)*) => {
        $(
            #[test]
            fn $name() {
                check_attributes($value, $other);
            }
        )*
    };
}

attributes! {
    attributes_of_no_bytes = (), ();
    attributes_of_one_byte = 7u8, 9u8;
    attributes_of_two_bytes = 0xABCDu16, 5u16;
    attributes_of_four_bytes = 1.5f32, -1.0f32;
    attributes_of_five_bytes = [1u8, 2, 3, 4, 5], [9; 5];
    attributes_of_twelve_bytes = Vec3::new(1.0, 2.0, 3.0), Vec3::NEG_ONE;
    attributes_of_sixteen_bytes = 0x0123_4567_89AB_CDEF_0123_4567_89AB_CDEFu128, u128::MAX;
    attributes_of_31_bytes = [31u8; 31], [0; 31];
    attributes_of_32_bytes = [1.0f32, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0], [-1.0; 8];
    attributes_of_32_bytes_in_doubles = [1.0f64, 2.0, 3.0, 4.0], [0.5; 4];
}

/// The shader runs if the ray meets the box in its interval, and only then.
fn runs(change: impl Fn(&mut Ray) + Send + Sync) -> u32 {
    let scene = scene_of(vec![vec![solids(vec![ball(0.0, 1.0)], false)]]);
    let count = Mutex::new(0);
    let tlas = structure(&scene, &BuildOptions::default());
    let mut table = ShaderTable::new();
    let ray_type = table.ray_type::<u32>("ray", 0, 1, 0);
    table.no_miss();
    table.hit(&HitGroup::<u32, ()>::procedural("box", |_| *count.lock().unwrap() += 1), ());
    let generate = table.ray_generation(|launch| {
        let mut ray = ray(&down(5.0));
        change(&mut ray);
        launch.trace_ray(ray_type, NONE, 0xFF, &ray, &mut 0);
    });
    once(table, &tlas, generate);
    *count.lock().unwrap()
}

macro_rules! boxes {
    ($($name:ident = $count:literal, $change:expr;)*) => {
        $(
            #[test]
            fn $name() {
                assert_eq!(runs($change), $count);
            }
        )*
    };
}

boxes! {
    box_is_met = 1, |_| {};
    box_is_met_from_inside = 1, |ray| ray.origin.z = 0.5;
    box_is_met_along_the_interval_inside_of_it = 1, |ray| (ray.t_min, ray.t_max) = (4.5, 5.0);
    box_is_missed_beside = 0, |ray| ray.origin.x = 1.5;
    box_is_missed_behind = 0, |ray| ray.direction = Vec3::Z;
    box_is_missed_before = 0, |ray| ray.t_max = 3.75;
    box_is_missed_after = 0, |ray| ray.t_min = 6.5;
    box_is_missed_by_a_slanted_ray = 0, |ray| ray.direction = Vec3::new(1.0, 0.0, -1.0);
}

/// Behind a triangle nothing is intersected: its distance is the end of the interval.
#[test]
fn triangles_shorten_the_interval() {
    for (height, is_met) in [(3.0, false), (0.0, true), (-3.0, true)] {
        let scene = scene_of(vec![vec![
            solids(vec![ball(0.0, 1.0)], true),
            triangles(vec![sheet(height)], true),
        ]]);
        let table = Table::fit(&scene, &ONE_TYPE, |_| Policy::Absent);
        let found = crate::scenes::clear(&scene, &table, down(5.0));
        let stop = found.1.stops[0].map(|at| found.1.candidates[at].event.place.geometry);
        assert_eq!(stop, Some(u32::from(!is_met)));
        // Triangles come first: a box behind the nearest is not asked about.
        let tally = verify(&scene, &table, &[found]);
        assert_eq!(tally.intersections, usize::from(is_met));
    }
}

/// Accepted hits shorten the interval for other boxes too.
#[test]
fn accepted_hits_shorten_the_interval() {
    let balls = (0..64).map(|n| ball(-f64::from(n), 0.25)).collect();
    let scene = scene_of(vec![vec![solids(balls, true)]]);
    let table = Table::fit(&scene, &ONE_TYPE, |_| Policy::Absent);
    let tally = verify(&scene, &table, &[crate::scenes::clear(&scene, &table, down(5.0))]);
    assert!(tally.intersections < 16, "{tally:?}");
}

/// Of hits at one distance the least indices win, whatever is asked first.
#[test]
fn hits_at_one_distance() {
    let distance_of = |scene: &crate::model::Scene| {
        let tlas: Tlas = structure(scene, &BuildOptions::default());
        let stop = Mutex::new(None);
        let mut table = ShaderTable::new();
        let ray_type = table.ray_type::<Option<u32>>("ray", 0, 1, 0);
        table.no_miss();
        for geometry in &scene.blases[0] {
            match geometry.shape {
                crate::model::Shape::Triangles(_) => table.hit(
                    &HitGroup::triangles("sheet").closest_hit(|hit, stop: &mut Option<u32>| {
                        *stop = Some(hit.geometry_index())
                    }),
                    (),
                ),
                crate::model::Shape::Solids(_) => table.hit(
                    &HitGroup::<Option<u32>, ()>::procedural("box", |shader| {
                        shader.report_hit(5.0, 0, ());
                    })
                    .closest_hit(|hit, stop| *stop = Some(hit.geometry_index())),
                    (),
                ),
            };
        }
        let generate = table.ray_generation(|launch| {
            let mut payload = None;
            launch.trace_ray(ray_type, NONE, 0xFF, &ray(&down(5.0)), &mut payload);
            *stop.lock().unwrap() = payload;
        });
        once(table, &tlas, generate);
        *stop.lock().unwrap()
    };
    let (sheet, solid) =
        (|| triangles(vec![sheet(0.0)], true), || solids(vec![ball(0.0, 1.0)], true));
    assert_eq!(distance_of(&scene_of(vec![vec![sheet(), solid()]])), Some(0));
    assert_eq!(distance_of(&scene_of(vec![vec![solid(), sheet()]])), Some(0));
    assert_eq!(distance_of(&scene_of(vec![vec![solid(), solid(), solid()]])), Some(0));
}

/// Many solids, alone in their structures.
#[test]
fn procedural_primitives_alone() {
    let mut random = Random(83);
    for opaque in [false, true] {
        let mut scene = scene_of(vec![vec![solids(some_solids(&mut random, 40), opaque)]]);
        scene.instances = crate::scenes::transforms()
            .map(|transform| crate::model::Instance::new(0, transform))
            .to_vec();
        for policy in [Policy::IgnoreOdd, Policy::IgnoreFront, Policy::EndEven] {
            let table = Table::fit(&scene, &ONE_TYPE, |_| policy);
            for flags in [0, flag::ACCEPT_FIRST] {
                let found = rays(&scene, &table, 150, flags, 89);
                let tally = verify(&scene, &table, &found);
                assert!(tally.closest_hits > 50 && tally.intersections > 100, "{tally:?}");
                assert_eq!(tally.any_hits > 0, !opaque);
            }
        }
    }
}
