//! A gallery without a triangle: intersection shaders of all shapes, on pedestals.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use rayburst::{
    math::Sampler,
    pipeline::{ClosestHit, Intersection, RayType},
    prelude::*,
    procedural::{
        Cone, Csg, Cuboid, Curve, Cylinder, Disk, DistanceField, HeightField, Landscape, Metaball,
        Metaballs, Quad, Sphere, Subdivision, Torus,
    },
};

mod common;

use common::{
    Eye, Result, arguments,
    daylight::{SHADOW_FLAGS, Shadow, daylight, sky},
    picture, save,
};

// ANCHOR: exhibit
/// What a record of the hit group holds: a shape and how it looks.
struct Exhibit {
    shape: Box<dyn Shape>,
    color: Vec3,
    /// How much of the surroundings it reflects when seen from the front.
    mirror: f32,
}

/// What the intersection shader tells the closest hit shader.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Attributes {
    normal: Vec3,
}
// ANCHOR_END: exhibit

/// What an eye ray or a reflected ray carries.
struct Seen {
    sampler: Sampler,
    depth: u32,
    color: Vec3,
}

// ANCHOR: intersection
/// Reports where a ray meets the shape of the record; the same for every type of ray.
fn intersect<P: 'static>(shader: &mut Intersection<'_, '_, P, Attributes, Arc<Exhibit>>) {
    let ray = Ray { t_max: shader.t_current(), ..shader.object_ray() };
    if let Some(hit) = shader.record().shape.nearest(&ray) {
        shader.report_hit(hit.t, 0, Attributes { normal: hit.normal });
    }
}
// ANCHOR_END: intersection

// ANCHOR: closest
/// Daylight on a surface, and what it reflects.
fn shade(
    hit: &ClosestHit<'_, Attributes, Arc<Exhibit>>,
    seen: &mut Seen,
    (eye_ray, shadow_ray): (RayType<Seen>, RayType<Shadow>),
) {
    let to_world = hit.world_to_object().matrix3.transpose();
    let direction = hit.world_ray().direction.normalize();
    let mut normal = (to_world * hit.attributes().normal).normalize();
    if normal.dot(direction) > 0.0 {
        normal = -normal;
    }
    let (position, exhibit) = (hit.world_position(), hit.record());
    let light = daylight(position, normal, &seen.sampler, 4 + 4 * seen.depth, |ray| {
        let mut shadow = Shadow::default();
        hit.trace_ray(shadow_ray, SHADOW_FLAGS, 0xFF, ray, &mut shadow);
        shadow.lit
    });
    seen.color = exhibit.color * light;
    // Schlick: "An Inexpensive BRDF Model for Physically-based Rendering", Eurographics 1994.
    let grazing = (1.0 + normal.dot(direction)).clamp(0.0, 1.0).powi(5);
    let share = exhibit.mirror + (1.0 - exhibit.mirror) * grazing;
    if exhibit.mirror > 0.0 && seen.depth < 3 {
        let reflected = direction.reflect(normal);
        let ray = Ray::with_interval(position, reflected, 1e-3, f32::INFINITY);
        let mut next = Seen { depth: seen.depth + 1, color: Vec3::ZERO, ..*seen };
        hit.trace_ray(eye_ray, RayFlags::empty(), 0xFF, &ray, &mut next);
        seen.color = seen.color.lerp(next.color, share);
    }
}
// ANCHOR_END: closest

// ANCHOR: shapes
/// All shapes, each about the origin and about two units large.
fn shapes() -> Result<Vec<Box<dyn Shape>>> {
    let ball = |x, y, z, radius| Metaball { centre: Vec3::new(x, y, z), radius, weight: 1.0 };
    let blob = vec![
        ball(-0.35, -0.3, 0.0, 1.0),
        ball(0.45, -0.2, 0.1, 0.95),
        ball(0.0, 0.5, -0.1, 0.85),
        ball(0.1, 0.0, 0.55, 0.7),
    ];
    let gyroid = |p: Vec3| {
        let q = 5.0 * p;
        let (s, c) = (q.map(f32::sin), q.map(f32::cos));
        let sheet = (s.x * c.y + s.y * c.z + s.z * c.x).abs() / 10.0 - 0.05;
        sheet.max(p.length() - 0.95)
    };
    let unit = Aabb { lower: Vec3::NEG_ONE, upper: Vec3::ONE };
    let drill = |axis: Vec3| Cylinder { from: -1.2 * axis, to: 1.2 * axis, radius: 0.48 };
    let die = Csg::intersection(
        Cuboid { lower: Vec3::splat(-0.8), upper: Vec3::splat(0.8) },
        Sphere { centre: Vec3::ZERO, radius: 1.08 },
    );
    let drills = Csg::union(Csg::union(drill(Vec3::X), drill(Vec3::Y)), drill(Vec3::Z));
    let landscape =
        Landscape { seed: 3, level: 7, frequency: 1.6, octaves: 6, gain: 0.3, ridges: 0.0 };
    // It lies on its pedestal.
    let heights = landscape.heights().iter().map(|h| 1.1 * h - 0.62).collect();
    let (side, edge) = (landscape.size(), Vec2::splat(0.68));
    let (corners, sizes, faces) = cross();
    Ok(vec![
        Box::new(Sphere { centre: Vec3::ZERO, radius: 0.95 }),
        Box::new(Cuboid { lower: Vec3::splat(-0.72), upper: Vec3::splat(0.72) }),
        Box::new(Cylinder { from: -0.9 * Vec3::Y, to: 0.9 * Vec3::Y, radius: 0.65 }),
        Box::new(Cone::with_tip(-0.9 * Vec3::Y, 0.85, 1.0 * Vec3::Y)),
        Box::new(Torus { centre: Vec3::ZERO, major: 0.66, minor: 0.28 }),
        Box::new(Disk {
            inner_radius: 0.4,
            ..Disk::new(Vec3::ZERO, Vec3::new(0.2, 0.5, 1.0), 0.95)
        }),
        Box::new(HeightField::new(side, side, heights, -edge, edge)?),
        Box::new(Csg::difference(die, drills)),
        Box::new(Metaballs::new(blob, 0.35)?),
        Box::new(DistanceField::new(gyroid, unit, 1.0)?),
        Box::new(Quad {
            corner: Vec3::new(-0.8, -0.9, 0.2),
            edge_u: Vec3::new(1.6, 0.0, 0.0),
            edge_v: Vec3::new(0.0, 1.7, -0.5),
        }),
        Box::new(Subdivision::new(&corners, &sizes, &faces, Subdivision::DEPTH)?),
        Box::new(Curve::new(
            [
                Vec3::new(-0.7, -0.8, 0.3),
                Vec3::new(2.2, -0.6, -0.9),
                Vec3::new(-2.2, 0.7, -0.3),
                Vec3::new(0.7, 0.8, 0.4),
            ],
            [0.3, 0.08],
        )?),
    ])
}
// ANCHOR_END: shapes

/// The cage of a rounded cross: a cube with a cube on each face.
fn cross() -> (Vec<Vec3>, Vec<u32>, Vec<u32>) {
    let mut corners: Vec<Vec3> = Vec::new();
    let mut faces = Vec::new();
    let mut index = |p: Vec3| {
        let known = corners.iter().position(|q| q.distance(p) < 1e-3);
        known.unwrap_or_else(|| {
            corners.push(p);
            corners.len() - 1
        }) as u32
    };
    for (axis, side, up) in
        [(Vec3::X, Vec3::Y, Vec3::Z), (Vec3::Y, Vec3::Z, Vec3::X), (Vec3::Z, Vec3::X, Vec3::Y)]
    {
        for sign in [1.0, -1.0] {
            let (axis, up) = (sign * axis, sign * up);
            let ring = [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)];
            let at = |(s, u): (f32, f32), out: f32| 0.38 * (s * side + u * up) + out * axis;
            for k in 0..4 {
                let (a, b) = (ring[k], ring[(k + 1) % 4]);
                faces.extend([at(a, 0.38), at(b, 0.38), at(b, 1.05), at(a, 1.05)].map(&mut index));
            }
            faces.extend(ring.map(|p| index(at(p, 1.05))));
        }
    }
    let sizes = vec![4; faces.len() / 4];
    (corners, sizes, faces)
}

/// Where the exhibits stand: in two rows.
fn place(number: usize) -> Vec3 {
    let (row, column) = if number < 7 { (0, number) } else { (1, number - 7) };
    let columns = if row == 0 { 7.0 } else { 6.0 };
    let x = 2.7 * (column as f32 - 0.5 * (columns - 1.0));
    Vec3::new(x, if row == 0 { 1.9 } else { 3.9 }, if row == 0 { 1.2 } else { -2.2 })
}

/// The gallery as seen by so many samples a pixel.
pub(crate) fn render(size: (u32, u32), samples: u32) -> Result<RgbImage> {
    // ANCHOR: boxes
    let mut exhibits = Vec::new();
    let mut places = Vec::new();
    for (number, shape) in shapes()?.into_iter().enumerate() {
        let hue = number as f32 / 13.0 * std::f32::consts::TAU;
        let color = 0.5 + 0.33 * Vec3::new(hue.cos(), (hue - 2.1).cos(), (hue + 2.1).cos());
        exhibits.push(Arc::new(Exhibit { shape, color, mirror: 0.05 }));
        let turn = Affine3A::from_rotation_y(0.5);
        places.push(Affine3A::from_translation(place(number)) * turn);
        let (top, radius) = (place(number) - 1.1 * Vec3::Y, 1.0);
        let pedestal = Cylinder { from: Vec3::new(top.x, -0.1, top.z), to: top, radius };
        let color = Vec3::splat(0.62);
        exhibits.push(Arc::new(Exhibit { shape: Box::new(pedestal), color, mirror: 0.0 }));
        places.push(Affine3A::IDENTITY);
    }
    let floor = Disk::new(Vec3::ZERO, Vec3::Y, 400.0);
    let color = Vec3::new(0.52, 0.50, 0.47);
    exhibits.push(Arc::new(Exhibit { shape: Box::new(floor), color, mirror: 0.02 }));
    places.push(Affine3A::IDENTITY);

    let mut blases = Vec::new();
    let mut instances = Vec::new();
    for (exhibit, &transform) in exhibits.iter().zip(&places) {
        let boxes = [exhibit.shape.bounds()];
        let geometry = ProceduralBoxes::new(&boxes);
        blases.push(Arc::new(Blas::of_geometries(&[geometry.into()], &BuildOptions::default())?));
        let blas = instances.len() as u32;
        instances.push(Instance { contribution: 2 * blas, ..Instance::new(blas, transform) });
    }
    let tlas = Tlas::build(blases, &instances, &BuildOptions::default())?;
    // ANCHOR_END: boxes

    let eye = Eye::look_at(Vec3::new(0.0, 6.8, 21.0), Vec3::new(0.0, 2.0, 0.0), 26.5);
    let texels = RwTexture::<Vec3>::new(size.0, size.1);

    let mut table = ShaderTable::new();
    let eye_ray = table.ray_type::<Seen>("eye", 0, 0, 0);
    let shadow_ray = table.ray_type::<Shadow>("shadow", 1, 0, 1);
    table.miss("sky", |miss, seen: &mut Seen| seen.color = sky(miss.world_ray().direction));
    table.miss("nothing in between", |_, shadow: &mut Shadow| shadow.lit = true);
    // ANCHOR: records
    let shown = HitGroup::procedural("exhibit", intersect)
        .closest_hit(|hit, seen: &mut Seen| shade(hit, seen, (eye_ray, shadow_ray)));
    let in_the_way = HitGroup::procedural("shadow", intersect::<Shadow>);
    for exhibit in &exhibits {
        table.hit(&shown, exhibit.clone());
        table.hit(&in_the_way, exhibit.clone());
    }
    // ANCHOR_END: records

    let generate = table.ray_generation(|launch| {
        let mut sum = Vec3::ZERO;
        for sample in 0..samples {
            let (ray, sampler) = eye.ray(launch.launch_index(), launch.launch_dimensions(), sample);
            let mut seen = Seen { sampler, depth: 0, color: Vec3::ZERO };
            launch.trace_ray(eye_ray, RayFlags::empty(), 0xFF, &ray, &mut seen);
            sum += seen.color;
        }
        texels.store(launch.launch_index().truncate(), sum / samples as f32);
    });
    table.build(5)?.dispatch_rays(&tlas, generate, size.0, size.1, 1)?;
    Ok(picture(&texels, size))
}

fn main() -> Result<()> {
    let (path, size) = arguments("procedural_gallery", (960, 480))?;
    save(&render(size, 64)?, path)
}
