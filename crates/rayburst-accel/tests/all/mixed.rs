//! Scenes of triangles and procedural primitives, interleaved, and what their rules make of both.

use std::{cell::Cell, sync::Arc};

use glam::{DVec3, Vec3, Vec3Swizzles};
use rayburst_accel::{
    Blas, BuildOptions, CandidateFilter, Cull, Geometry, Instance, ProceduralBoxes, RayFlags, Tlas,
    TraceOptions, TriangleMesh,
};
use rayburst_math::{Aabb, Hit, HitKind, Ray};

use crate::{
    instances::transform,
    meshes::{Mesh, Random, soup},
};

/// A geometry with its data.
pub enum Part {
    Triangles(Mesh, bool),
    Boxes(Vec<Aabb>, bool),
}

impl Part {
    pub fn geometry(&self) -> Geometry<'_> {
        match self {
            Self::Triangles(mesh, opaque) => {
                TriangleMesh { opaque: *opaque, ..mesh.geometry() }.into()
            }
            Self::Boxes(boxes, opaque) => {
                ProceduralBoxes { opaque: *opaque, ..ProceduralBoxes::new(boxes) }.into()
            }
        }
    }

    pub fn is_opaque(&self) -> bool {
        match self {
            Self::Triangles(_, opaque) | Self::Boxes(_, opaque) => *opaque,
        }
    }
}

/// A BLAS over some geometries.
pub fn blas(parts: &[Part], options: &BuildOptions<'_>) -> Blas {
    let geometries: Vec<_> = parts.iter().map(Part::geometry).collect();
    Blas::of_geometries(&geometries, options).unwrap()
}

/// A procedural primitive.
#[derive(Clone, Copy, Debug)]
pub struct Primitive {
    pub geometry: u32,
    pub primitive: u32,
    pub bounds: Aabb,
    pub opaque: bool,
}

/// The procedural primitives of some geometries that can be met.
pub fn primitives(parts: &[Part]) -> Vec<Primitive> {
    let mut all = vec![];
    for (part, geometry) in parts.iter().zip(0..) {
        if let Part::Boxes(boxes, opaque) = part {
            let opaque = *opaque;
            let boxes = boxes.iter().zip(0..).filter(|(bounds, _)| is_active(bounds));
            all.extend(boxes.map(|(&bounds, primitive)| Primitive {
                geometry,
                primitive,
                bounds,
                opaque,
            }));
        }
    }
    all
}

fn is_active(bounds: &Aabb) -> bool {
    let within = |x: f32| x.abs() <= rayburst_accel::MAX_COORDINATE;
    (0..3).all(|axis| {
        let (lower, upper) = (bounds.lower[axis], bounds.upper[axis]);
        within(lower) && within(upper) && lower <= upper
    })
}

/// Where a ray is in a box that is larger by `margin` on all sides, in `f64`.
pub fn slabs(bounds: &Aabb, ray: &Ray, margin: f64) -> Option<[f64; 2]> {
    let (origin, direction) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
    let lower = bounds.lower.as_dvec3() - DVec3::splat(margin);
    let upper = bounds.upper.as_dvec3() + DVec3::splat(margin);
    // Distances that `f32` cannot express are none.
    let clamp = |t: f32| f64::from(t.clamp(-f32::MAX, f32::MAX));
    let (mut near, mut far) = (clamp(ray.t_min), clamp(ray.t_max));
    for axis in 0..3 {
        let (a, b) = (lower[axis] - origin[axis], upper[axis] - origin[axis]);
        if direction[axis] == 0.0 {
            if a > 0.0 || b < 0.0 {
                return None;
            }
            continue;
        }
        let (a, b) = (a / direction[axis], b / direction[axis]);
        near = near.max(a.min(b));
        far = far.min(a.max(b));
    }
    (near <= far).then_some([near, far])
}

/// Random boxes in [−1, 1]³ of some size, some flat, some points, some that can never be met.
pub fn random_boxes(seed: u64, count: usize, size: f32) -> Vec<Aabb> {
    let mut random = Random::new(seed);
    let mut repeated = Aabb::EMPTY;
    let boxes = (0..count).map(|i| {
        let centre = random.vector();
        let half = 0.5 * size * random.vector().abs();
        let bounds = Aabb { lower: centre - half, upper: centre + half };
        let nan = Vec3::new(f32::NAN, 0.0, 0.0);
        match i % 24 {
            0 => Aabb::of_point(centre),
            1 => Aabb { upper: bounds.upper.with_y(bounds.lower.y), ..bounds },
            2 => Aabb { lower: bounds.lower + nan, ..bounds },
            3 => Aabb { lower: bounds.upper + nan.yyx(), ..bounds },
            4 => Aabb { lower: bounds.upper, upper: bounds.lower - Vec3::X },
            5 => Aabb { upper: bounds.upper.with_z(f32::INFINITY), ..bounds },
            6 => Aabb { lower: Vec3::splat(-2e18), ..bounds },
            7 => {
                repeated = bounds;
                bounds
            }
            8 | 9 => repeated,
            10 => Aabb { lower: centre - 0.3, upper: centre + 0.3 },
            _ => bounds,
        }
    });
    boxes.collect()
}

/// Boxes for spheres: those of random spheres in [−1, 1]³.
pub fn spheres(seed: u64, count: usize, radius: f32) -> Vec<Aabb> {
    let mut random = Random::new(seed);
    let sphere = |_| {
        let centre = random.vector();
        let radius = Vec3::splat(radius * (0.2 + random.unit()));
        Aabb { lower: centre - radius, upper: centre + radius }
    };
    (0..count).map(sphere).collect()
}

/// Both distances at which a ray meets the sphere in a box, a bit smaller than the box. Made in `f64`.
pub fn sphere_hits(bounds: &Aabb, ray: &Ray) -> Option<[f32; 2]> {
    let centre = 0.5 * (bounds.lower.as_dvec3() + bounds.upper.as_dvec3());
    let radius = 0.475 * f64::from(bounds.extent().min_element());
    let (o, d) = (ray.origin.as_dvec3() - centre, ray.direction.as_dvec3());
    let (a, b) = (d.length_squared(), o.dot(d));
    let discriminant = b * b - a * (o.length_squared() - radius * radius);
    let root = discriminant.sqrt();
    (root >= 0.0).then(|| [((-b - root) / a) as f32, ((-b + root) / a) as f32])
}

/// Instances of BLASes of triangles, procedural primitives, and both.
pub struct World {
    pub parts: Vec<Vec<Part>>,
    pub instances: Vec<Instance>,
}

impl World {
    pub fn new(seed: u64, boxes: impl Fn(u64, usize, f32) -> Vec<Aabb>) -> Self {
        let triangles =
            |k, count, size, opaque| Part::Triangles(soup(seed + k, count, size), opaque);
        let boxes = |k, count, size, opaque| Part::Boxes(boxes(seed + k, count, size), opaque);
        let parts = vec![
            vec![
                triangles(1, 40, 0.4, true),
                boxes(2, 60, 0.2, true),
                triangles(3, 40, 0.4, false),
                boxes(4, 60, 0.2, false),
            ],
            vec![
                boxes(5, 50, 0.2, false),
                Part::Boxes(vec![], true),
                Part::Triangles(Mesh::default(), false),
                triangles(6, 50, 0.4, false),
            ],
            vec![boxes(7, 30, 0.3, true), boxes(8, 30, 0.3, false)],
            vec![triangles(9, 60, 0.4, true), triangles(10, 60, 0.3, false)],
        ];
        let mut random = Random::new(seed);
        let instances = (0..24).map(|i| {
            let blas = random.below(parts.len()) as u32;
            let mut instance = Instance::new(blas, transform(&mut random, i));
            if i % 8 == 7 {
                instance.transform = glam::Affine3A::IDENTITY;
            }
            instance.mask = 1 + random.below(255) as u8;
            instance.flags.cull_disable = random.below(3) == 0;
            instance.flags.front_clockwise = random.below(2) == 0;
            instance.flags.force_opaque = [None, Some(false), Some(true)][random.below(3)];
            instance.id = 1000 + i as u32;
            instance.contribution = 7 * i as u32;
            instance
        });
        let instances = instances.collect();
        Self { parts, instances }
    }

    pub fn tlas(&self, options: &BuildOptions<'_>) -> Tlas {
        let blases = self.parts.iter().map(|parts| Arc::new(blas(parts, options))).collect();
        Tlas::build(blases, &self.instances, options).unwrap()
    }
}

/// A ray in the space of an instance, as it is traced there.
pub fn local(tlas: &Tlas, instance: u32, ray: &Ray) -> Ray {
    let to_object = tlas.world_to_object(instance);
    Ray {
        origin: to_object.transform_point3(ray.origin),
        direction: to_object.transform_vector3(ray.direction),
        ..*ray
    }
}

/// Rules about what is there for a ray, in their own words.
#[derive(Clone, Copy, Debug)]
pub struct Rules {
    pub mask: u8,
    pub force: Option<bool>,
    pub skips_opaque: bool,
    pub skips_translucent: bool,
    pub skips_triangles: bool,
    pub skips_boxes: bool,
    pub culls_front: bool,
    pub culls_back: bool,
}

impl Rules {
    pub fn of_options(options: &TraceOptions) -> Self {
        Self {
            mask: options.mask,
            force: options.force_opaque,
            skips_opaque: options.skip.opaque,
            skips_translucent: options.skip.non_opaque,
            skips_triangles: options.skip.triangles,
            skips_boxes: options.skip.procedural,
            culls_front: options.cull == Cull::Front || options.cull == Cull::Both,
            culls_back: options.cull == Cull::Back || options.cull == Cull::Both,
        }
    }

    /// By the bits that DXR gives the flags.
    pub fn of_flags(flags: RayFlags, mask: u8) -> Self {
        let has = |bit: u32| flags.bits() & bit != 0;
        Self {
            mask,
            force: if has(0x1) { Some(true) } else { has(0x2).then_some(false) },
            skips_opaque: has(0x40),
            skips_translucent: has(0x80),
            skips_triangles: has(0x100),
            skips_boxes: has(0x200),
            culls_front: has(0x20),
            culls_back: has(0x10),
        }
    }

    /// Whether something is opaque in an instance, if rays that obey the rules can meet it there.
    pub fn opacity(&self, instance: &Instance, geometry_is_opaque: bool) -> Option<bool> {
        let forced = self.force.or(instance.flags.force_opaque);
        let opaque = forced.unwrap_or(geometry_is_opaque);
        let skipped = if opaque { self.skips_opaque } else { self.skips_translucent };
        (instance.mask & self.mask != 0 && !skipped).then_some(opaque)
    }

    /// Whether a triangle that was hit is opaque, if it is there.
    pub fn triangle(&self, instance: &Instance, part: &Part, hit: &Hit) -> Option<bool> {
        let culled =
            if hit.kind == HitKind::TRIANGLE_FRONT { self.culls_front } else { self.culls_back };
        let culled = culled && !instance.flags.cull_disable;
        let opacity = self.opacity(instance, part.is_opaque());
        opacity.filter(|_| !culled && !self.skips_triangles)
    }
}

/// When a filter ends a search.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Ends {
    Never,
    AtOnce,
    /// Nobody may ask.
    Unasked,
}

/// A filter that counts how often it is asked. One type for many tests: each makes all kernels anew.
pub struct Probe {
    pub passes: fn(&Hit) -> bool,
    pub ends: Ends,
    pub asked: Cell<usize>,
}

impl Probe {
    pub fn new(passes: fn(&Hit) -> bool, ends: Ends) -> Self {
        Self { passes, ends, asked: Cell::new(0) }
    }
}

impl CandidateFilter for Probe {
    const ENDS: bool = true;

    fn accept(&self, _: u32, _: &Ray, hit: &Hit) -> bool {
        self.asked.set(self.asked.get() + 1);
        (self.passes)(hit)
    }

    fn ends(&self) -> bool {
        assert!(self.ends != Ends::Unasked, "batches do not ask");
        self.ends == Ends::AtOnce
    }
}

/// Whether translucent hits are let through.
pub fn passes(hit: &Hit) -> bool {
    !(hit.primitive + hit.instance).is_multiple_of(3)
}
