//! Portable shaders of procedural primitives, beside triangles, find what recursive ones do.

use std::sync::Mutex;

use glam::UVec3;
use rayburst_accel::{BuildOptions, RayFlags, Tlas};
use rayburst_math::{Hit, Ray};
use rayburst_pipeline::{
    AnyHitResult, DispatchError, HitGroup, MAX_PORTABLE_REPORTS, Next, PipelineError,
    PortableCandidate, PortableHit, PortableHitGroup, PortablePipeline, PortableReports,
    PortableTable, RayType, ShaderTable, TraceRequest,
};

use crate::{
    harness::{SolidAttributes, intersect, structure},
    model::{Decision, Policy, Scene, Shape, kind},
    scenes::{
        ONE_TYPE, RICH_TYPES, Random, ball, rich, scene_of, sheet, solids, triangles, with_ends,
        without_ends,
    },
    solids::Solid,
};

/// What a ray finds: the hit, its attributes and record, or the miss record.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Found {
    hit: Option<(Hit, SolidAttributes, usize)>,
    miss: Option<u32>,
    /// Solids of some indices are not there for rays of this number.
    salt: u32,
}

/// A ray with all that is asked of it.
#[derive(Clone, Copy, Debug)]
struct Ask {
    ray: Ray,
    flags: RayFlags,
    mask: u8,
    ray_type: usize,
    salt: u32,
}

/// Records of the rich scene's six instances.
const RECORDS: usize = 48;

fn solids_of(scene: &Scene, instance: u32, geometry: u32) -> &[Solid] {
    match &scene.blases[scene.instances[instance as usize].blas][geometry as usize].shape {
        Shape::Solids(solids) => solids,
        Shape::Triangles(_) => panic!("solids expected"),
    }
}

/// What a record is for, if rays can find it.
fn is_procedural(scene: &Scene, record: usize) -> Option<bool> {
    scene.instances.iter().find_map(|instance| {
        let within = record.checked_sub(instance.contribution as usize)?;
        let geometry = scene.blases[instance.blas].get(within / 2).filter(|_| within < 8)?;
        Some(matches!(geometry.shape, Shape::Solids(_)))
    })
}

fn is_there(salt: u32, primitive: u32) -> bool {
    !(salt + primitive).is_multiple_of(5)
}

fn triangle_attributes(u: f32, v: f32) -> SolidAttributes {
    [u, v, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
}

fn decide(policy: Policy, hit: &Hit) -> AnyHitResult {
    match policy.decide(hit.primitive, hit.kind.code()) {
        Decision::Ignore => AnyHitResult::Ignore,
        Decision::Accept => AnyHitResult::Accept,
        Decision::End => AnyHitResult::AcceptAndEndSearch,
    }
}

fn recursive(scene: &Scene, tlas: &Tlas, policy: fn(usize) -> Policy, asks: &[Ask]) -> Vec<Found> {
    let answers = Mutex::new(vec![Found::default(); asks.len()]);
    let mut table = ShaderTable::new();
    let types: [RayType<Found>; 2] =
        RICH_TYPES.map(|t| table.ray_type("ray", t.contribution, t.multiplier, t.miss));
    for number in 0..2 {
        table.miss("miss", move |_, found: &mut Found| found.miss = Some(number));
    }
    for record in 0..RECORDS {
        let policy = policy(record);
        if is_procedural(scene, record) == Some(true) {
            let group = HitGroup::procedural("solids", move |shader| {
                let (instance, geometry) = (shader.instance_index(), shader.geometry_index());
                let salt = shader.payload().map_or(0, |found: &Found| found.salt);
                if is_there(salt, shader.primitive_index()) {
                    intersect(shader, solids_of(scene, instance, geometry));
                }
            });
            let group = group.any_hit(move |hit, _| decide(policy, hit.hit()));
            let group = group.closest_hit(|hit, found: &mut Found| {
                found.hit = Some((*hit.hit(), hit.attributes(), *hit.record()));
            });
            table.hit(&group, record);
        } else {
            let group = HitGroup::triangles("triangles");
            let group = group.any_hit(move |hit, _| decide(policy, hit.hit()));
            let group = group.closest_hit(|hit, found: &mut Found| {
                let attributes = triangle_attributes(hit.attributes().u, hit.attributes().v);
                found.hit = Some((*hit.hit(), attributes, *hit.record()));
            });
            table.hit(&group, record);
        }
    }
    let generate = table.ray_generation(|launch| {
        let index = launch.launch_index().x as usize;
        let Ask { ray, flags, mask, ray_type, salt } = asks[index];
        let mut found = Found { salt, ..Found::default() };
        launch.trace_ray(types[ray_type], flags, mask, &ray, &mut found);
        answers.lock().unwrap()[index] = found;
    });
    let pipeline = table.build(1).unwrap();
    pipeline.dispatch_rays(tlas, generate, asks.len() as u32, 1, 1).unwrap();
    drop(pipeline);
    answers.into_inner().unwrap()
}

/// Reports entry and exit, as the recursive shader does.
fn report<R>(
    scene: &Scene,
    candidate: &PortableCandidate<'_, R>,
) -> PortableReports<SolidAttributes> {
    let (primitive, local) = (candidate.primitive, candidate.object_ray());
    assert_eq!(local.t_max, candidate.t_current);
    assert!(candidate.t_current <= candidate.ray.ray.t_max);
    let solid =
        &solids_of(scene, primitive.instance, primitive.geometry)[primitive.primitive as usize];
    let meets = solid.meet(local.origin.as_dvec3(), local.direction.as_dvec3());
    let Ok(Some((entry, exit))) = meets else { return PortableReports::none() };
    let reports = [(entry, kind::ENTRY), (exit, kind::EXIT)].into_iter();
    reports.fold(PortableReports::none(), |all, (t, kind)| {
        let t = t as f32;
        let at = local.at(t);
        let ids = [primitive.instance, primitive.geometry, primitive.primitive];
        let [i, g, p] = ids.map(|id| id as f32);
        all.and(t, kind, [at.x, at.y, at.z, t, i, g, p, f32::from(kind)])
    })
}

fn portable(scene: &Scene, tlas: &Tlas, policy: fn(usize) -> Policy, asks: &[Ask]) -> Vec<Found> {
    let answers = Mutex::new(vec![Found::default(); asks.len()]);
    let mut table = PortableTable::<Found>::new();
    let types = RICH_TYPES.map(|t| table.ray_type("ray", t.contribution, t.multiplier, t.miss));
    for number in 0..2 {
        table.miss(move |_, found| (Found { miss: Some(number), ..found }, Next::Done));
    }
    for record in 0..RECORDS {
        let policy = policy(record);
        if is_procedural(scene, record) == Some(true) {
            let group = PortableHitGroup::procedural("solids", |candidate, found: &Found| {
                if is_there(found.salt, candidate.primitive.primitive) {
                    report(scene, candidate)
                } else {
                    PortableReports::none()
                }
            });
            let group = group.any_hit(move |hit, _| decide(policy, hit.hit));
            let group =
                group.closest_hit(|hit: &PortableHit<'_, SolidAttributes, usize>, found| {
                    (
                        Found { hit: Some((*hit.hit, hit.attributes, *hit.record)), ..found },
                        Next::Done,
                    )
                });
            table.hit(&group, record);
        } else {
            let group = PortableHitGroup::triangles("triangles");
            let group = group.any_hit(move |hit, _| decide(policy, hit.hit));
            let group = group.closest_hit(|hit, found: Found| {
                let attributes = triangle_attributes(hit.attributes.u, hit.attributes.v);
                (Found { hit: Some((*hit.hit, attributes, *hit.record)), ..found }, Next::Done)
            });
            table.hit(&group, record);
        }
    }
    let pipeline = table.build(1).unwrap();
    let generate = |at: UVec3| {
        let Ask { ray, flags, mask, ray_type, salt } = asks[at.x as usize];
        let request = TraceRequest { ray_type: types[ray_type], flags, mask, ray };
        (Found { salt, ..Found::default() }, Next::Trace(request))
    };
    let finish = |at: UVec3, found| answers.lock().unwrap()[at.x as usize] = found;
    pipeline.dispatch_rays(tlas, [asks.len() as u32, 1, 1], generate, finish).unwrap();
    drop(pipeline);
    answers.into_inner().unwrap()
}

/// Rays with every combination of flags.
fn asks(scene: &Scene, each: usize, seed: u64) -> Vec<Ask> {
    let mut random = Random(seed);
    let every = (0..each).flat_map(|_| 0..RayFlags::all().bits() + 1);
    let ask = |flags| {
        let instance = &scene.instances[random.below(scene.instances.len())];
        let origin = random.in_cube(7.0);
        let target = instance.transform.transform_point3(random.in_cube(1.2));
        let (t_min, t_max) = match random.below(3) {
            0 => (random.range(-2.0, 6.0), random.range(6.0, 12.0)),
            _ => (0.0, f64::INFINITY),
        };
        Ask {
            ray: Ray {
                origin: origin.as_vec3(),
                t_min: t_min as f32,
                direction: (target - origin).normalize().as_vec3(),
                t_max: t_max as f32,
            },
            flags: RayFlags::from_bits_retain(flags),
            mask: if random.below(3) == 0 { 1 << random.below(8) } else { 0xFF },
            ray_type: random.below(2),
            salt: random.below(100) as u32,
        }
    };
    every.map(ask).collect()
}

#[test]
fn triangles_and_procedurals_are_found_as_by_recursion_with_all_flags() {
    let scene = rich();
    let tlas = structure(&scene, &BuildOptions::default());
    let asks = asks(&scene, 40, 91);
    let first = RayFlags::ACCEPT_FIRST_HIT_AND_END_SEARCH;
    let expected = recursive(&scene, &tlas, without_ends, &asks);
    let found = portable(&scene, &tlas, without_ends, &asks);
    let (mut solids, mut sheets, mut misses, mut exits) = (0, 0, 0, 0);
    for ((ask, expected), found) in asks.iter().zip(&expected).zip(&found) {
        if ask.flags.contains(first) {
            // Any hit may be the first.
            assert_eq!(expected.hit.is_some(), found.hit.is_some(), "{ask:?}");
            assert_eq!(expected.miss, found.miss, "{ask:?}");
        } else {
            assert_eq!(expected, found, "{ask:?}");
        }
        misses += usize::from(found.miss.is_some());
        if let Some((hit, ..)) = found.hit {
            let is_solid = hit.kind.code() < 128;
            solids += usize::from(is_solid);
            sheets += usize::from(!is_solid);
            exits += usize::from(hit.kind.code() == kind::EXIT);
        }
    }
    let counts = [solids, sheets, misses, exits];
    assert!(counts.iter().all(|&count| count > 50), "{counts:?}");
}

/// Portable any hit shaders that end a search accept: the nearest of what is accepted is found.
#[test]
fn shaders_that_end_searches_accept() {
    let scene = rich();
    let tlas = structure(&scene, &BuildOptions::default());
    let accepts = |record| match with_ends(record) {
        Policy::End => Policy::Accept,
        Policy::EndEven => Policy::IgnoreOdd,
        other => other,
    };
    let asks = asks(&scene, 4, 92);
    let found = portable(&scene, &tlas, with_ends, &asks);
    assert!(found == portable(&scene, &tlas, accepts, &asks));
    let hits = found.iter().filter(|found| found.hit.is_some()).count();
    assert!(hits > 50, "{hits}");
}

#[test]
fn hits_do_not_depend_on_threads() {
    let scene = rich();
    let tlas = structure(&scene, &BuildOptions::default());
    let asks = asks(&scene, 4, 93);
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| portable(&scene, &tlas, without_ends, &asks))
    };
    assert!(with(1) == with(3));
}

/// A ball behind a sheet, seen down the z axis from 5, with a shader that reports some distances.
fn nearest(reports: &[f32], any_hit: impl Fn(u8) -> bool + Send + Sync) -> Option<(f32, u8)> {
    let sheet = triangles(vec![sheet(-3.0)], true);
    let scene = scene_of(vec![vec![solids(vec![ball(0.0, 1.0)], false), sheet]]);
    let tlas = structure(&scene, &BuildOptions::default());
    let mut table = PortableTable::<Option<(f32, u8)>>::new();
    let t = &ONE_TYPE[0];
    let ray_type = table.ray_type("ray", t.contribution, t.multiplier, t.miss);
    table.no_miss();
    let group = PortableHitGroup::procedural("ball", |_, _| {
        let all = reports.iter().zip(0..);
        all.fold(PortableReports::none(), |all, (&t, number)| all.and(t, number, f32::from(number)))
    });
    let group = group.any_hit(|hit, _| {
        assert_eq!(hit.attributes, f32::from(hit.hit.kind.code()));
        if any_hit(hit.hit.kind.code()) { AnyHitResult::Accept } else { AnyHitResult::Ignore }
    });
    let group = group.closest_hit(|hit, _| {
        assert_eq!(hit.attributes, f32::from(hit.hit.kind.code()));
        (Some((hit.hit.t, hit.hit.kind.code())), Next::Done)
    });
    table.hit(&group, ());
    table.hit(&PortableHitGroup::triangles("sheet"), ());
    let pipeline = table.build(1).unwrap();
    let ray = Ray::new(glam::Vec3::new(0.125, 0.0625, 5.0), -glam::Vec3::Z);
    let request = TraceRequest { ray_type, flags: RayFlags::empty(), mask: 0xFF, ray };
    let found = Mutex::new(None);
    let finish = |_, payload| *found.lock().unwrap() = payload;
    let generate = |_| (None, Next::Trace(request));
    pipeline.dispatch_rays(&tlas, [1, 1, 1], generate, finish).unwrap();
    drop(pipeline);
    found.into_inner().unwrap()
}

#[test]
fn of_several_reports_the_nearest_that_is_accepted_remains() {
    let reports = [5.5, 4.5, 7.0, 4.25, 9.0];
    assert_eq!(nearest(&reports, |_| true), Some((4.25, 3)));
    assert_eq!(nearest(&reports, |kind| kind != 3), Some((4.5, 1)));
    assert_eq!(nearest(&reports, |kind| kind == 2), Some((7.0, 2)));
    // The sheet is at 8.
    assert_eq!(nearest(&reports, |kind| kind == 4), None);
    assert_eq!(nearest(&[-1.0, f32::NAN, f32::INFINITY], |_| true), None);
    assert_eq!(nearest(&[], |_| true), None);
    let many: Vec<f32> = (0..12).map(|n| 7.5 - 0.25 * n as f32).collect();
    let last = MAX_PORTABLE_REPORTS - 1;
    assert_eq!(nearest(&many, |_| true), Some((many[last], last as u8)));
}

#[test]
fn a_group_for_the_other_kind_of_geometry_is_an_error() {
    let scene = scene_of(vec![vec![solids(vec![ball(0.0, 1.0)], true)]]);
    let tlas = structure(&scene, &BuildOptions::default());
    let mut table = PortableTable::<u32>::new();
    table.ray_type("ray", 0, 1, 0);
    table.no_miss();
    table.hit(&PortableHitGroup::triangles("leaves"), ());
    let error = table.build(1).unwrap().check(&tlas).unwrap_err();
    assert!(matches!(&error, PipelineError::HitKind { group, .. } if group == "leaves"));
    assert!(error.to_string().contains("`PortableHitGroup::procedural`"), "{error}");
}

/// Null records: solids do not stop rays, and neither does what is in no record.
#[test]
fn procedurals_without_a_shader_are_passed() {
    let scene = scene_of(vec![vec![solids(vec![ball(0.0, 1.0)], true)]]);
    let tlas = structure(&scene, &BuildOptions::default());
    let mut table = PortableTable::<u32>::new();
    let ray_type = table.ray_type("ray", 0, 1, 0);
    table.miss(|_, _| (1, Next::Done));
    table.no_hit();
    let ball = PortableHitGroup::procedural("ball", |_, _| PortableReports::one(4.0, 0, ()));
    table.hit(&ball, ());
    let pipeline: PortablePipeline<'_, u32> = table.build(1).unwrap();
    let ray = Ray::new(glam::Vec3::new(0.0, 0.0, 5.0), -glam::Vec3::Z);
    let generate =
        |_| (0, Next::Trace(TraceRequest { ray_type, flags: RayFlags::empty(), mask: 0xFF, ray }));
    let finish = |_, payload| assert_eq!(payload, 1);
    pipeline.dispatch_rays(&tlas, [3, 3, 1], generate, finish).unwrap();
}

#[test]
fn a_ray_type_of_another_table_is_an_error_and_the_others_run() {
    let tlas = structure(&scene_of(vec![]), &BuildOptions::default());
    let foreign = PortableTable::<u32>::new().ray_type("ray", 0, 0, 0);
    let mut table = PortableTable::<u32>::new();
    let ray_type = table.ray_type("ray", 0, 0, 0);
    table.no_miss();
    let ray = Ray::new(glam::Vec3::ZERO, glam::Vec3::Z);
    let generate = |at: UVec3| {
        let is_foreign = at.x % 40 == 7;
        let ray_type = if is_foreign { foreign } else { ray_type };
        let request = TraceRequest { ray_type, flags: RayFlags::empty(), mask: 0xFF, ray };
        (at.x, Next::Trace(request))
    };
    let finished = std::sync::atomic::AtomicU32::new(0);
    let finish = |_, x| {
        assert_ne!(x % 40, 7);
        finished.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
    };
    let pipeline = table.build(1).unwrap();
    let error = pipeline.dispatch_rays(&tlas, [80, 2, 1], generate, finish).unwrap_err();
    let launch = UVec3::new(7, 0, 0);
    assert_eq!(error, DispatchError::OtherPipeline { launch, payload: "u32" });
    assert_eq!(finished.into_inner(), 160 - 4);
}
