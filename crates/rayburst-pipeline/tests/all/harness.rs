//! The scenes of the model in the engine: runs shaders that note all they see, and compares.

use std::sync::{Arc, Mutex};

use glam::{Affine3A, DVec3, Vec3};
use rayburst_accel::{
    Blas, BuildOptions, Geometry, Instance, InstanceFlags, ProceduralBoxes, RayFlags, Tlas,
    TriangleMesh,
};
use rayburst_math::{Aabb, Ray};
use rayburst_pipeline::{
    AnyHit, AnyHitResult, Barycentrics, ClosestHit, HitGroup, Intersection, MAX_RECURSION_DEPTH,
    RayGenerationId, ShaderTable,
};

use crate::{
    model::{self, Decision, Event, Expected, Place, Policy, Record, Scene, Seen, Table},
    solids::Solid,
};

/// Attributes of solids: 32 bytes.
pub type SolidAttributes = [f32; 8];

/// The structure of a scene.
pub fn structure(scene: &Scene, options: &BuildOptions<'_>) -> Tlas {
    let blases = scene.blases.iter().map(|geometries| blas(geometries, options));
    let instances: Vec<_> = scene.instances.iter().map(instance).collect();
    Tlas::build(blases.collect(), &instances, options).expect("the scene builds")
}

pub fn instance(instance: &model::Instance) -> Instance {
    let (matrix, translation) = (instance.transform.matrix3, instance.transform.translation);
    Instance {
        blas: instance.blas as u32,
        transform: Affine3A::from_mat3_translation(matrix.as_mat3(), translation.as_vec3()),
        mask: instance.mask,
        flags: InstanceFlags {
            cull_disable: instance.cull_disable,
            front_clockwise: instance.front_clockwise,
            force_opaque: instance.force_opaque,
        },
        id: instance.id,
        contribution: instance.contribution,
    }
}

fn blas(geometries: &[model::Geometry], options: &BuildOptions<'_>) -> Arc<Blas> {
    enum Data {
        Triangles(Vec<Vec3>, Vec<[u32; 3]>),
        Boxes(Vec<Aabb>),
    }
    let data = geometries.iter().map(|geometry| match &geometry.shape {
        model::Shape::Triangles(triangles) => {
            let positions = triangles.iter().flatten().map(|corner| corner.as_vec3()).collect();
            let indices = (0..triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]);
            Data::Triangles(positions, indices.collect())
        }
        model::Shape::Solids(solids) => Data::Boxes(solids.iter().map(bounds).collect()),
    });
    let data: Vec<_> = data.collect();
    let geometries = data.iter().zip(geometries).map(|(data, of)| match data {
        Data::Triangles(positions, indices) => Geometry::from(TriangleMesh {
            opaque: of.opaque,
            no_duplicate_any_hit: of.no_duplicate_any_hit,
            ..TriangleMesh::new(positions, indices)
        }),
        Data::Boxes(boxes) => Geometry::from(ProceduralBoxes {
            boxes,
            opaque: of.opaque,
            no_duplicate_any_hit: of.no_duplicate_any_hit,
        }),
    });
    let geometries: Vec<_> = geometries.collect();
    Arc::new(Blas::of_geometries(&geometries, options).expect("the geometries build"))
}

pub fn bounds(solid: &Solid) -> Aabb {
    Aabb { lower: solid.low.as_vec3(), upper: solid.high.as_vec3() }
}

pub fn ray(ray: &model::Ray) -> Ray {
    Ray {
        origin: ray.origin.as_vec3(),
        t_min: ray.t_min as f32,
        direction: ray.direction.as_vec3(),
        t_max: ray.t_max as f32,
    }
}

fn point(t: f32, ray: &Ray) -> Vec3 {
    ray.at(t)
}

/// Reports the entry, and the exit if that is not accepted.
pub fn intersect<P: 'static, R>(
    shader: &mut Intersection<'_, '_, P, SolidAttributes, R>,
    solids: &[Solid],
) {
    let local = shader.object_ray();
    let solid = &solids[shader.primitive_index() as usize];
    let (origin, direction) = (local.origin.as_dvec3(), local.direction.as_dvec3());
    let Ok(Some((entry, exit))) = solid.meet(origin, direction) else { return };
    for (t, kind) in [(entry, model::kind::ENTRY), (exit, model::kind::EXIT)] {
        let t = t as f32;
        let at = point(t, &local);
        let ids = [shader.instance_index(), shader.geometry_index(), shader.primitive_index()];
        let [i, g, p] = ids.map(|id| id as f32);
        if shader.report_hit(t, kind, [at.x, at.y, at.z, t, i, g, p, f32::from(kind)]) {
            return;
        }
    }
}

fn result_of(decision: Decision) -> AnyHitResult {
    match decision {
        Decision::Ignore => AnyHitResult::Ignore,
        Decision::Accept => AnyHitResult::Accept,
        Decision::End => AnyHitResult::AcceptAndEndSearch,
    }
}

/// The parts of an event by the methods of hit shaders.
macro_rules! event {
    ($hit:ident, $attributes:expr) => {{
        let place = Place {
            instance: $hit.instance_index(),
            geometry: $hit.geometry_index(),
            primitive: $hit.primitive_index(),
        };
        let attributes: DVec3 = $attributes;
        let (t, kind) = (f64::from($hit.t()), $hit.hit_kind());
        Event { place, record: *$hit.record(), t, kind, attributes }
    }};
}

fn of_triangle(attributes: Barycentrics) -> DVec3 {
    DVec3::new(f64::from(attributes.u), f64::from(attributes.v), 0.0)
}

/// The point; all eight numbers must be those of one report.
fn of_solid(
    [x, y, z, t, instance, geometry, primitive, kind]: SolidAttributes,
    seen: [f32; 5],
) -> DVec3 {
    assert_eq!([t, instance, geometry, primitive, kind], seen, "attributes of another hit");
    Vec3::new(x, y, z).as_dvec3()
}

macro_rules! solid_event {
    ($hit:ident) => {{
        let ids = [$hit.instance_index(), $hit.geometry_index(), $hit.primitive_index()];
        let [i, g, p] = ids.map(|id| id as f32);
        let seen = [$hit.t(), i, g, p, f32::from($hit.hit_kind())];
        event!($hit, of_solid($hit.attributes(), seen))
    }};
}

type TriangleGroup<'s> = HitGroup<'s, Seen, Barycentrics, usize>;
type SolidGroup<'s> = HitGroup<'s, Seen, SolidAttributes, usize>;

fn triangle_group<'s>(policy: Policy, closest_hit: bool) -> TriangleGroup<'s> {
    let mut group = TriangleGroup::triangles("triangles");
    if policy != Policy::Absent {
        group = group.any_hit(move |hit: &AnyHit<'_, _, _>, seen: &mut Seen| {
            seen.any_hits.push(event!(hit, of_triangle(hit.attributes())));
            result_of(policy.decide(hit.primitive_index(), hit.hit_kind()))
        });
    }
    if closest_hit {
        group = group.closest_hit(|hit: &ClosestHit<'_, _, _>, seen| {
            seen.closest_hits.push(event!(hit, of_triangle(hit.attributes())));
        });
    }
    group
}

/// Intersection shaders must not change the payload: what they see is noted aside, by launch.
type Notes = Mutex<Vec<(u32, Place, usize)>>;

fn solid_group<'s>(
    scene: &'s Scene,
    notes: &'s Notes,
    policy: Policy,
    closest_hit: bool,
) -> SolidGroup<'s> {
    let mut group = SolidGroup::procedural("solids", move |shader| {
        let place = Place {
            instance: shader.instance_index(),
            geometry: shader.geometry_index(),
            primitive: shader.primitive_index(),
        };
        notes.lock().unwrap().push((shader.launch_index().x, place, *shader.record()));
        let instance = &scene.instances[place.instance as usize];
        let geometry = &scene.blases[instance.blas][place.geometry as usize];
        let model::Shape::Solids(solids) = &geometry.shape else { panic!("solids expected") };
        intersect(shader, solids);
    });
    if policy != Policy::Absent {
        group = group.any_hit(move |hit: &AnyHit<'_, _, _>, seen: &mut Seen| {
            seen.any_hits.push(solid_event!(hit));
            result_of(policy.decide(hit.primitive_index(), hit.hit_kind()))
        });
    }
    if closest_hit {
        group = group.closest_hit(|hit: &ClosestHit<'_, _, _>, seen| {
            seen.closest_hits.push(solid_event!(hit));
        });
    }
    group
}

/// Traces rays, one a launch.
pub fn run(scene: &Scene, table: &Table, rays: &[model::Ray], tlas: &Tlas) -> Vec<Seen> {
    let (notes, answers) = (Notes::default(), Mutex::new(vec![Seen::default(); rays.len()]));
    let mut shaders = ShaderTable::new();
    let ray_types = table
        .ray_types
        .iter()
        .map(|t| shaders.ray_type::<Seen>("ray", t.contribution, t.multiplier, t.miss));
    let ray_types: Vec<_> = ray_types.collect();
    for (&has_shader, index) in table.misses.iter().zip(0..) {
        let at = if has_shader {
            shaders.miss("miss", move |_, seen: &mut Seen| seen.misses.push(index))
        } else {
            shaders.no_miss()
        };
        assert_eq!(at, index);
    }
    for (record, index) in table.records.iter().zip(0..) {
        let at = match *record {
            Record::Null => shaders.no_hit(),
            Record::Triangles { any_hit, closest_hit } => {
                shaders.hit(&triangle_group(any_hit, closest_hit), index)
            }
            Record::Solids { any_hit, closest_hit } => {
                shaders.hit(&solid_group(scene, &notes, any_hit, closest_hit), index)
            }
        };
        assert_eq!(at as usize, index);
    }
    let all = &answers;
    let generate = shaders.ray_generation(move |launch| {
        let index = launch.launch_index().x as usize;
        let of = &rays[index];
        let flags = RayFlags::from_bits_retain(of.flags);
        let mut seen = Seen::default();
        launch.trace_ray(ray_types[of.ray_type], flags, of.mask, &ray(of), &mut seen);
        all.lock().unwrap()[index] = seen;
    });
    let pipeline = shaders.build(1).expect("the table fits");
    pipeline.dispatch_rays(tlas, generate, rays.len() as u32, 1, 1).expect("no launch fails");
    drop(pipeline);
    let mut answers = answers.into_inner().unwrap();
    for (launch, place, record) in notes.into_inner().unwrap() {
        answers[launch as usize].intersections.push((place, record));
    }
    answers
}

/// Runs one launch that must not fail.
pub fn once(table: ShaderTable<'_>, tlas: &Tlas, shader: RayGenerationId) {
    let pipeline = table.build(MAX_RECURSION_DEPTH).expect("the table fits");
    pipeline.dispatch_rays(tlas, shader, 1, 1, 1).expect("the launch does not fail");
}

/// How often things happened: a test of nothing is none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    pub any_hits: usize,
    pub closest_hits: usize,
    pub misses: usize,
    pub intersections: usize,
    /// Rays that may stop at one place only.
    pub exact: usize,
}

/// Compares the engine with the model, ray by ray.
pub fn verify(scene: &Scene, table: &Table, rays: &[(model::Ray, Expected)]) -> Tally {
    verify_in(scene, table, rays, &structure(scene, &BuildOptions::default()))
}

pub fn verify_in(
    scene: &Scene,
    table: &Table,
    rays: &[(model::Ray, Expected)],
    tlas: &Tlas,
) -> Tally {
    let list: Vec<_> = rays.iter().map(|(ray, _)| *ray).collect();
    let mut tally = Tally::default();
    for ((ray, expected), seen) in rays.iter().zip(run(scene, table, &list, tlas)) {
        if let Err(reason) = expected.check(&seen) {
            panic!("{ray:?}: {reason}");
        }
        tally.any_hits += seen.any_hits.len();
        tally.closest_hits += seen.closest_hits.len();
        tally.misses += seen.misses.len();
        tally.intersections += seen.intersections.len();
        tally.exact += usize::from(expected.is_exact());
    }
    tally
}
