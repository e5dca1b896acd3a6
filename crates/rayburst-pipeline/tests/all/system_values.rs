//! System values: what each shader type is told of its launch, ray, instance, primitive and hit.

use std::sync::Mutex;

use glam::{Affine3A, DAffine3, DVec3, UVec3, Vec3};
use rayburst_accel::{BuildOptions, RayFlags};
use rayburst_math::{HitKind, Ray};
use rayburst_pipeline::{HitGroup, ShaderTable};

use crate::{
    harness::{self, SolidAttributes, structure},
    model::{Instance, Scene, kind},
    scenes::{ball, sheet, solids, transforms, triangles},
};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    RayGeneration,
    Intersection,
    AnyHit,
    ClosestHit,
    Miss,
    Callable,
}
use Stage::{AnyHit, Callable, ClosestHit, Intersection, Miss, RayGeneration};

/// All values that a shader may see.
#[derive(Clone, Copy, Debug)]
struct Values {
    stage: Stage,
    launch_index: UVec3,
    launch_dimensions: UVec3,
    ray: Option<(Ray, RayFlags)>,
    of_instance: Option<OfInstance>,
    of_hit: Option<OfHit>,
    /// `RayTCurrent` of any stage that has it.
    t: Option<f32>,
}

#[derive(Clone, Copy, Debug)]
struct OfInstance {
    primitive: u32,
    geometry: u32,
    index: u32,
    id: u32,
    object_ray: Ray,
    object_to_world: Affine3A,
    world_to_object: Affine3A,
}

#[derive(Clone, Copy, Debug)]
struct OfHit {
    kind: u8,
    is_front_face: bool,
    position: Vec3,
    hit: rayburst_math::Hit,
}

macro_rules! values {
    ($stage:ident, $shader:ident) => {
        Values {
            stage: $stage,
            launch_index: $shader.launch_index(),
            launch_dimensions: $shader.launch_dimensions(),
            ray: None,
            of_instance: None,
            of_hit: None,
            t: None,
        }
    };
}

macro_rules! of_ray {
    ($shader:ident) => {
        Some((*$shader.world_ray(), $shader.ray_flags()))
    };
}

macro_rules! of_instance {
    ($shader:ident) => {
        Some(OfInstance {
            primitive: $shader.primitive_index(),
            geometry: $shader.geometry_index(),
            index: $shader.instance_index(),
            id: $shader.instance_id(),
            object_ray: $shader.object_ray(),
            object_to_world: $shader.object_to_world(),
            world_to_object: $shader.world_to_object(),
        })
    };
}

macro_rules! of_hit {
    ($stage:ident, $shader:ident) => {
        Values {
            ray: of_ray!($shader),
            of_instance: of_instance!($shader),
            of_hit: Some(OfHit {
                kind: $shader.hit_kind(),
                is_front_face: $shader.is_front_face(),
                position: $shader.world_position(),
                hit: *$shader.hit(),
            }),
            t: Some($shader.t()),
            ..values!($stage, $shader)
        }
    };
}

/// Each transform's instance has two sheets and a ball, far from the others along x.
fn scene() -> Scene {
    let ball = |z| ball(z, 0.5);
    let geometries = vec![
        triangles(vec![sheet(-20.0), sheet(0.0)], false),
        solids(vec![ball(30.0), ball(-30.0), ball(2.0)], false),
    ];
    let instances = transforms().into_iter().zip(0..).map(|(transform, number)| {
        let apart = DAffine3::from_translation(DVec3::new(200.0 * f64::from(number), 0.0, 0.0));
        Instance { id: 1000 + 7 * number, ..Instance::new(0, apart * transform) }
    });
    Scene { instances: instances.collect(), blases: vec![geometries] }
}

const GRID: UVec3 = UVec3::new(6, 2, 2);
const FLAGS: RayFlags = RayFlags::FORCE_NON_OPAQUE;
const T_MIN: f32 = 0.25;
const T_MAX: f32 = 100.0;

/// The ray of a launch: x is its instance, y decides whether it goes there or away, z whether it starts
/// between ball and sheet or before both.
fn ray_of(at: UVec3) -> Ray {
    let instance = &scene().instances[at.x as usize];
    let start = DVec3::new(0.125, 0.0625, if at.z == 0 { 7.0 } else { 1.25 });
    let along = if at.y == 0 { -0.5 } else { 0.5 };
    let origin = instance.transform.transform_point3(start).as_vec3();
    let direction = instance.transform.transform_vector3(DVec3::Z * along).as_vec3();
    let direction = if at.y == 0 { direction } else { Vec3::new(0.0, 40.0, 300.0) };
    Ray::with_interval(origin, direction, T_MIN, T_MAX)
}

/// What all shaders of a dispatch see.
fn observe() -> Vec<Values> {
    let (scene, seen) = (scene(), Mutex::new(vec![]));
    let tlas = structure(&scene, &BuildOptions::default());
    let solids = match &scene.blases[0][1].shape {
        crate::model::Shape::Solids(solids) => solids.clone(),
        crate::model::Shape::Triangles(_) => panic!("solids expected"),
    };
    {
        let note = |values| seen.lock().unwrap().push(values);
        let mut table = ShaderTable::new();
        let ray_type = table.ray_type::<u32>("ray", 0, 1, 0);
        let callable = table.callable(|shader, _: &mut u32| note(values!(Callable, shader)));
        table.miss("miss", |miss, _: &mut u32| {
            note(Values { ray: of_ray!(miss), ..values!(Miss, miss) });
        });
        let group = HitGroup::triangles("sheets").any_hit(|hit, _: &mut u32| {
            note(of_hit!(AnyHit, hit));
            hit.accept_hit()
        });
        table.hit(&group.closest_hit(|hit, _| note(of_hit!(ClosestHit, hit))), ());
        let group = HitGroup::<u32, SolidAttributes>::procedural("balls", |shader| {
            let (ray, t) = (of_ray!(shader), Some(shader.t_current()));
            let of_instance = of_instance!(shader);
            note(Values { ray, of_instance, t, ..values!(Intersection, shader) });
            harness::intersect(shader, &solids);
        });
        let group = group.any_hit(|hit, _| {
            note(of_hit!(AnyHit, hit));
            hit.accept_hit()
        });
        table.hit(&group.closest_hit(|hit, _| note(of_hit!(ClosestHit, hit))), ());
        let generate = table.ray_generation(|launch| {
            note(values!(RayGeneration, launch));
            launch.call_shader(callable, &mut 0);
            let ray = ray_of(launch.launch_index());
            launch.trace_ray(ray_type, FLAGS, 0xFF, &ray, &mut 0);
        });
        let pipeline = table.build(1).unwrap();
        pipeline.dispatch_rays(&tlas, generate, GRID.x, GRID.y, GRID.z).unwrap();
    }
    seen.into_inner().unwrap()
}

/// Values of a stage, which must not be none.
fn at(stage: Stage) -> Vec<Values> {
    let seen: Vec<_> = observe().into_iter().filter(|values| values.stage == stage).collect();
    assert!(!seen.is_empty());
    seen
}

/// Tests of each stage that is told a value.
macro_rules! values_of {
    ($($module:ident { $($name:ident = $stage:ident),* $(,)? } $check:expr)*) => {
        $(
            mod $module {
                use super::*;
                $(
                    #[test]
                    fn $name() {
                        let check: fn(&Values) = $check;
                        at($stage).iter().for_each(check);
                    }
                )*
            }
        )*
    };
}

fn instance_of(values: &Values) -> OfInstance {
    values.of_instance.expect("values of an instance")
}

fn hit_of(values: &Values) -> OfHit {
    values.of_hit.expect("values of a hit")
}

fn is_near(a: Vec3, b: Vec3) -> bool {
    a.distance(b) < 1e-3 * (1.0 + a.length())
}

fn product_is_one(a: Affine3A, b: Affine3A) -> bool {
    (a * b).abs_diff_eq(Affine3A::IDENTITY, 1e-3)
}

values_of! {
    dispatch_rays_index {
        in_ray_generation = RayGeneration,
        in_intersection = Intersection,
        in_any_hit = AnyHit,
        in_closest_hit = ClosestHit,
        in_miss = Miss,
        in_callable = Callable,
    } |values| {
        assert!(values.launch_index.cmplt(GRID).all());
        if let Some(of_instance) = values.of_instance {
            // Each launch goes to its own instance.
            assert_eq!(values.launch_index.x, of_instance.index);
        }
    }

    dispatch_rays_dimensions {
        in_ray_generation = RayGeneration,
        in_intersection = Intersection,
        in_any_hit = AnyHit,
        in_closest_hit = ClosestHit,
        in_miss = Miss,
        in_callable = Callable,
    } |values| assert_eq!(values.launch_dimensions, GRID)

    world_ray {
        in_intersection = Intersection,
        in_any_hit = AnyHit,
        in_closest_hit = ClosestHit,
        in_miss = Miss,
    } |values| {
        let (ray, flags) = values.ray.expect("a ray");
        assert_eq!(ray, ray_of(values.launch_index));
        assert_eq!((ray.t_min, flags), (T_MIN, FLAGS));
    }

    object_ray {
        in_intersection = Intersection,
        in_any_hit = AnyHit,
        in_closest_hit = ClosestHit,
    } |values| {
        let at = values.launch_index;
        let local = instance_of(values).object_ray;
        assert!(is_near(local.origin, Vec3::new(0.125, 0.0625, if at.z == 0 { 7.0 } else { 1.25 })));
        assert!(is_near(local.direction, Vec3::Z * -0.5), "not normalised, {local:?}");
        assert_eq!((local.t_min, local.t_max), (T_MIN, T_MAX));
    }

    object_to_world {
        in_intersection = Intersection,
        in_any_hit = AnyHit,
        in_closest_hit = ClosestHit,
    } |values| {
        let transform = scene().instances[values.launch_index.x as usize].transform;
        let seen = instance_of(values).object_to_world;
        for point in [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z] {
            let expected = transform.transform_point3(point.as_dvec3()).as_vec3();
            assert!(is_near(seen.transform_point3(point), expected));
        }
    }

    world_to_object {
        in_intersection = Intersection,
        in_any_hit = AnyHit,
        in_closest_hit = ClosestHit,
    } |values| {
        let seen = instance_of(values);
        assert!(product_is_one(seen.object_to_world, seen.world_to_object), "{seen:?}");
        assert!(product_is_one(seen.world_to_object, seen.object_to_world), "{seen:?}");
    }

    instance_index {
        in_intersection = Intersection,
        in_any_hit = AnyHit,
        in_closest_hit = ClosestHit,
    } |values| assert_eq!(instance_of(values).index, values.launch_index.x)

    instance_id {
        in_intersection = Intersection,
        in_any_hit = AnyHit,
        in_closest_hit = ClosestHit,
    } |values| assert_eq!(instance_of(values).id, 1000 + 7 * values.launch_index.x)

    geometry_index {
        in_intersection = Intersection,
        in_any_hit = AnyHit,
        in_closest_hit = ClosestHit,
    } |values| {
        let is_ball = match values.of_hit {
            Some(hit) => matches!(hit.kind, kind::ENTRY | kind::EXIT),
            None => true,
        };
        assert_eq!(instance_of(values).geometry, u32::from(is_ball));
    }

    primitive_index {
        in_intersection = Intersection,
        in_any_hit = AnyHit,
        in_closest_hit = ClosestHit,
    } |values| {
        let seen = instance_of(values);
        let sheets = seen.geometry == 0;
        let heights: &[f32] = if sheets { &[-20.0, 0.0] } else { &[30.0, -30.0, 2.0] };
        if let Some(t) = values.t.filter(|_| values.of_hit.is_some()) {
            let z = seen.object_ray.at(t).z;
            assert!((z - heights[seen.primitive as usize]).abs() <= 0.5);
        } else {
            assert!(matches!(seen.primitive, 1 | 2), "the first ball is behind the ray");
        }
    }

    ray_t_current {
        in_any_hit = AnyHit,
        in_closest_hit = ClosestHit,
    } |values| {
        let t = values.t.expect("a distance");
        let (sheet, z) = (instance_of(values).geometry == 0, hit_of(values).position);
        let of_point = instance_of(values).world_to_object.transform_point3(z).z;
        let start = if values.launch_index.z == 0 { 7.0 } else { 1.25 };
        assert!((start - 0.5 * t - of_point).abs() < 1e-3, "{values:?}");
        if sheet {
            let expected = [2.0 * (start + 20.0), 2.0 * start];
            assert!((t - expected[instance_of(values).primitive as usize]).abs() < 1e-3);
        }
        assert_eq!(t, hit_of(values).hit.t);
    }

    hit_kind {
        in_any_hit = AnyHit,
        in_closest_hit = ClosestHit,
    } |values| {
        let (seen, of_hit) = (instance_of(values), hit_of(values));
        if seen.geometry == 0 {
            // The sheets face +z in their own space, where the ray comes down.
            assert_eq!((of_hit.kind, of_hit.is_front_face), (kind::FRONT, true));
            assert_eq!(of_hit.hit.kind, HitKind::TRIANGLE_FRONT);
        } else {
            assert_eq!((of_hit.kind, of_hit.is_front_face), (kind::ENTRY, false));
            assert_eq!(of_hit.hit.kind, HitKind::procedural(kind::ENTRY));
        }
    }

    hit_as_plain_data {
        in_any_hit = AnyHit,
        in_closest_hit = ClosestHit,
    } |values| {
        let (seen, hit) = (instance_of(values), hit_of(values).hit);
        assert_eq!(
            (hit.instance, hit.geometry, hit.primitive),
            (seen.index, seen.geometry, seen.primitive)
        );
    }
}

#[test]
fn ray_t_current_in_intersection_is_where_the_interval_ends() {
    for values in at(Intersection) {
        let t = values.t.expect("a distance");
        let start = if values.launch_index.z == 0 { 7.0 } else { 1.25 };
        // The end of the ray, or a sheet that was found before.
        let sheets = [2.0 * start, 2.0 * (start + 20.0), T_MAX];
        assert!(sheets.iter().any(|end| (t - end).abs() < 1e-3), "{t}");
    }
}

#[test]
fn what_runs_where() {
    let seen = observe();
    let count =
        |stage, y| seen.iter().filter(|v| v.stage == stage && v.launch_index.y == y).count();
    for y in 0..2 {
        assert_eq!(count(RayGeneration, y), 12);
        assert_eq!(count(Callable, y), 12);
    }
    assert_eq!((count(ClosestHit, 0), count(ClosestHit, 1)), (12, 0));
    assert_eq!((count(Miss, 0), count(Miss, 1)), (0, 12));
    assert!(count(AnyHit, 0) >= 12 && count(Intersection, 0) >= 6);
    // Half of the rays start before the ball, half behind it.
    let balls = |values: &&Values| {
        values.stage == ClosestHit && values.of_instance.is_some_and(|of| of.geometry == 1)
    };
    assert_eq!(seen.iter().filter(balls).count(), 6);
}
