//! Any hit shaders: `IgnoreHit`, `AcceptHitAndEndSearch`, in no particular order.

use std::sync::Mutex;

use rayburst_accel::{BuildOptions, BuildQuality, RayFlags, Tlas};
use rayburst_pipeline::{AnyHitResult, HitGroup, RwBuffer, ShaderTable};

use crate::{
    harness::{once, ray, structure, verify},
    model::{Policy, RayType, Scene, Table, flag},
    scenes::{RICH_TYPES, Random, clear, down, rays, rich, scene_of, sheet, solids, triangles},
};

/// So many sheets, the topmost first, at 0, -1, -2 …
fn layers(count: usize, opaque: bool) -> Scene {
    scene_of(vec![vec![triangles((0..count).map(|n| sheet(-(n as f64))).collect(), opaque)]])
}

/// The same in another order: the heights of primitives are `-order[primitive]`.
fn shuffled(order: &[usize]) -> Scene {
    scene_of(vec![vec![triangles(order.iter().map(|&n| sheet(-(n as f64))).collect(), false)]])
}

fn tlas(scene: &Scene) -> Tlas {
    structure(scene, &BuildOptions::default())
}

/// Traces one ray through layers with an any hit shader; gives payloads and the distance it stops at.
fn through(
    tlas: &Tlas,
    flags: RayFlags,
    any_hit: impl Fn(f32, &mut Vec<f32>) -> AnyHitResult + Send + Sync,
) -> (Vec<f32>, Option<f32>) {
    let result = Mutex::new((vec![], None));
    {
        let mut table = ShaderTable::new();
        let ray_type = table.ray_type::<(Vec<f32>, Option<f32>)>("ray", 0, 0, 0);
        table.no_miss();
        let group = HitGroup::triangles("layer")
            .any_hit(|hit, (seen, _): &mut (Vec<f32>, Option<f32>)| any_hit(hit.t(), seen))
            .closest_hit(|hit, (_, stop)| *stop = Some(hit.t()));
        table.hit(&group, ());
        let generate = table.ray_generation(|launch| {
            let mut result = result.lock().unwrap();
            launch.trace_ray(ray_type, flags, 0xFF, &ray(&down(5.0)), &mut result);
        });
        once(table, tlas, generate);
    }
    result.into_inner().unwrap()
}

fn sorted(mut list: Vec<f32>) -> Vec<f32> {
    list.sort_by(f32::total_cmp);
    list
}

const NONE: RayFlags = RayFlags::empty();

#[test]
fn ignore_hit() {
    let (seen, stop) = through(&tlas(&layers(6, false)), NONE, |t, seen| {
        seen.push(t);
        AnyHitResult::Ignore
    });
    assert_eq!(sorted(seen), [5.0, 6.0, 7.0, 8.0, 9.0, 10.0]);
    assert_eq!(stop, None);
}

#[test]
fn ignore_hit_of_some() {
    let (seen, stop) = through(&tlas(&layers(6, false)), NONE, |t, seen| {
        seen.push(t);
        if t < 8.0 { AnyHitResult::Ignore } else { AnyHitResult::Accept }
    });
    let seen = sorted(seen);
    assert_eq!(seen[..4], [5.0, 6.0, 7.0, 8.0], "all up to the stop, then perhaps others");
    assert_eq!(stop, Some(8.0));
}

#[test]
fn ignored_hits_change_the_payload_all_the_same() {
    let (seen, stop) = through(&tlas(&layers(3, false)), NONE, |_, seen| {
        if seen.is_empty() {
            seen.push(0.0);
        }
        seen[0] += 1.0;
        AnyHitResult::Ignore
    });
    assert_eq!((seen, stop), (vec![3.0], None));
}

#[test]
fn accept_hit() {
    let (seen, stop) = through(&tlas(&layers(6, false)), NONE, |t, seen| {
        seen.push(t);
        AnyHitResult::Accept
    });
    assert!(seen.contains(&5.0));
    // Nothing behind an accepted hit is asked after it.
    assert!(seen.is_sorted_by(|a, b| a > b), "{seen:?}");
    assert_eq!(stop, Some(5.0));
}

#[test]
fn accept_hit_and_end_search() {
    let (seen, stop) = through(&tlas(&layers(6, false)), NONE, |t, seen| {
        seen.push(t);
        AnyHitResult::AcceptAndEndSearch
    });
    assert_eq!(seen.len(), 1);
    assert_eq!(stop, Some(seen[0]));
}

#[test]
fn accept_hit_and_end_search_at_the_last() {
    for last in [5.0, 7.0, 10.0] {
        let (seen, stop) = through(&tlas(&layers(6, false)), NONE, |t, seen| {
            seen.push(t);
            if t == last { AnyHitResult::AcceptAndEndSearch } else { AnyHitResult::Ignore }
        });
        assert_eq!(seen.last(), Some(&last));
        assert_eq!(stop, Some(last));
    }
}

#[test]
fn accept_first_hit_and_end_search() {
    let flags = RayFlags::ACCEPT_FIRST_HIT_AND_END_SEARCH;
    let (seen, stop) = through(&tlas(&layers(6, false)), flags, |t, seen| {
        seen.push(t);
        AnyHitResult::Accept
    });
    assert_eq!(seen.len(), 1);
    assert_eq!(stop, Some(seen[0]));
}

#[test]
fn accept_first_hit_passes_what_is_ignored() {
    let flags = RayFlags::ACCEPT_FIRST_HIT_AND_END_SEARCH;
    let (seen, stop) = through(&tlas(&layers(6, false)), flags, |t, seen| {
        seen.push(t);
        if t == 9.0 { AnyHitResult::Accept } else { AnyHitResult::Ignore }
    });
    assert_eq!(seen.last(), Some(&9.0));
    assert_eq!(stop, Some(9.0));
}

#[test]
fn opaque_geometry_does_not_ask() {
    let (seen, stop) =
        through(&tlas(&layers(6, true)), NONE, |_, _| panic!("opaque geometry asks"));
    assert_eq!((seen, stop), (vec![], Some(5.0)));
}

#[test]
fn force_opaque_does_not_ask() {
    let flags = RayFlags::FORCE_OPAQUE;
    let (seen, stop) =
        through(&tlas(&layers(6, false)), flags, |_, _| panic!("opaque geometry asks"));
    assert_eq!((seen, stop), (vec![], Some(5.0)));
}

#[test]
fn force_non_opaque_asks() {
    let (seen, stop) = through(&tlas(&layers(6, true)), RayFlags::FORCE_NON_OPAQUE, |t, seen| {
        seen.push(t);
        AnyHitResult::Ignore
    });
    assert_eq!((seen.len(), stop), (6, None));
}

/// A shader whose answers depend on the hit alone gives the same results in any order.
#[test]
fn results_do_not_depend_on_the_order() {
    let mut random = Random(61);
    let mut order: Vec<usize> = (0..24).collect();
    let mut results = vec![];
    for round in 0..12 {
        let quality = [BuildQuality::Fast, BuildQuality::Balanced, BuildQuality::Best][round % 3];
        let options = BuildOptions { quality, ..BuildOptions::default() };
        let (seen, stop) = through(&structure(&shuffled(&order), &options), NONE, |t, seen| {
            // A sum of whole numbers: exact in any order.
            seen.resize(1, 0.0);
            if t < 20.0 {
                seen[0] += t;
                AnyHitResult::Ignore
            } else {
                AnyHitResult::Accept
            }
        });
        results.push((seen, stop));
        for n in (1..order.len()).rev() {
            order.swap(n, random.below(n + 1));
        }
    }
    assert_eq!(results[0], (vec![(5..20).sum::<i32>() as f32], Some(20.0)));
    assert!(results.iter().all(|result| *result == results[0]), "{results:?}");
}

/// The nearest layers kept sorted in the payload, for blending them from front to back.
#[test]
fn nearest_layers_sorted_in_the_payload() {
    let order = [7, 2, 9, 0, 5, 1, 8, 3, 6, 4];
    let (seen, stop) = through(&tlas(&shuffled(&order)), NONE, |t, nearest| {
        let at = nearest.partition_point(|&other| other < t);
        nearest.insert(at, t);
        nearest.truncate(4);
        AnyHitResult::Ignore
    });
    assert_eq!((seen, stop), (vec![5.0, 6.0, 7.0, 8.0], None));
}

/// Each primitive is asked about once where there are no spatial splits.
#[test]
fn no_duplicate_any_hit() {
    let scene = rich();
    let table = Table::fit(&scene, &RICH_TYPES, |_| Policy::Ignore);
    let tally = verify(&scene, &table, &rays(&scene, &table, 300, flag::FORCE_NON_OPAQUE, 67));
    assert_eq!(tally.closest_hits, 0);
    assert_eq!(tally.misses, 300);
    assert!(tally.any_hits > 200, "{tally:?}");
}

/// Any hit shaders of solids are asked for each report, and may end the search too.
macro_rules! policies {
    ($($name:ident = $policy:ident;)*) => {
        mod policy {
            use super::*;
            $(
                #[test]
                fn $name() {
                    let scene = rich();
                    let table = Table::fit(&scene, &RICH_TYPES, |_| Policy::$policy);
                    for flags in [
                        0,
                        flag::FORCE_NON_OPAQUE,
                        flag::FORCE_NON_OPAQUE | flag::SKIP_TRIANGLES,
                        flag::FORCE_NON_OPAQUE | flag::ACCEPT_FIRST,
                    ] {
                        let found = rays(&scene, &table, 150, flags, 71);
                        let tally = verify(&scene, &table, &found);
                        assert!(tally.any_hits > 20 || Policy::$policy == Policy::Absent, "{tally:?}");
                    }
                }
            )*
        }
    };
}

policies! {
    absent = Absent;
    accept = Accept;
    ignore = Ignore;
    ignore_odd_primitives = IgnoreOdd;
    ignore_front_faces_and_entries = IgnoreFront;
    end = End;
    ignore_odd_primitives_and_end_at_even = EndEven;
}

/// A shadow ray: a miss shader says that the light is seen.
#[test]
fn shadow_rays_through_cut_outs() {
    let mut scene = layers(3, false);
    scene.blases[0].push(solids(vec![crate::scenes::ball(-4.0, 0.5)], false));
    let types = [RayType { contribution: 0, multiplier: 1, miss: 0 }];
    for (policy, is_lit) in [(Policy::Ignore, true), (Policy::Accept, false), (Policy::End, false)]
    {
        let table = Table::fit(&scene, &types, |_| policy);
        let flags = flag::ACCEPT_FIRST | flag::SKIP_CLOSEST_HIT;
        let ray = clear(&scene, &table, crate::model::Ray { flags, ..down(5.0) });
        let tally = verify(&scene, &table, &[ray]);
        assert_eq!((tally.closest_hits, tally.misses), (0, usize::from(is_lit)));
    }
}

/// The context's methods are the results.
#[test]
fn results_by_name() {
    let calls = RwBuffer::<u32>::new(3);
    let tlas = tlas(&layers(1, false));
    let mut table = ShaderTable::new();
    let ray_type = table.ray_type::<u32>("ray", 0, 0, 0);
    table.miss("miss", |_, stops: &mut u32| *stops = 0);
    let group = HitGroup::triangles("layer")
        .any_hit(|hit, which: &mut u32| {
            let results = [hit.ignore_hit(), hit.accept_hit(), hit.accept_hit_and_end_search()];
            results[*which as usize]
        })
        .closest_hit(|_, which| *which = 10);
    table.hit(&group, ());
    let generate = table.ray_generation(|launch| {
        for which in 0..3 {
            let mut payload = which;
            launch.trace_ray(ray_type, NONE, 0xFF, &ray(&down(5.0)), &mut payload);
            calls.store(which as usize, payload);
        }
    });
    once(table, &tlas, generate);
    assert_eq!(calls.to_vec(), [0, 10, 10]);
}
