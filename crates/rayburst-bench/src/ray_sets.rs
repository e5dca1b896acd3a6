//! The ray sets of the benchmarks, made once from a fixed seed.

use glam::{Vec2, Vec3};
use rayburst_accel::{AcceptAll, Blas, TraceOptions};
use rayburst_math::{
    Frame, Hit, Ray,
    hash::{self, Rng},
    offset::{interpolation_error, intersection_error, spawn_origin},
    warp,
};
use rayburst_scene::Camera;

use crate::FlatMesh;

/// Which rays a set holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RaySetKind {
    /// Eye rays, 8×8 pixels at a time.
    Primary,
    /// From the primary hits to the light; any hit.
    Shadow,
    /// Four cosine-distributed rays a primary hit, as long as a tenth of the scene; any hit.
    Ao,
    /// One cosine-distributed ray a primary hit, in pixel order.
    Diffuse,
    /// The same, shuffled.
    DiffuseShuffled,
    /// One cosine-distributed ray from each hit of `Diffuse`.
    SecondBounce,
}

impl RaySetKind {
    /// All sets with their names.
    pub const ALL: [(&'static str, Self); 6] = [
        ("primary", Self::Primary),
        ("shadow", Self::Shadow),
        ("ao", Self::Ao),
        ("diffuse", Self::Diffuse),
        ("diffuse_shuffled", Self::DiffuseShuffled),
        ("second_bounce", Self::SecondBounce),
    ];

    /// The set's name.
    pub fn name(self) -> &'static str {
        Self::ALL.iter().find(|(_, kind)| *kind == self).map_or("", |(name, _)| name)
    }

    /// Whether any hit answers the question.
    pub fn is_any_hit(self) -> bool {
        matches!(self, Self::Shadow | Self::Ao)
    }
}

/// Rays of one kind.
#[derive(Clone, Debug)]
pub struct RaySet {
    /// Which.
    pub kind: RaySetKind,
    /// The rays.
    pub rays: Vec<Ray>,
}

/// Makes all sets for one view, `size × size` pixels.
pub fn ray_sets(mesh: &FlatMesh, blas: &Blas, camera: &Camera, size: u32) -> Vec<RaySet> {
    let primary = primary(camera, size);
    let primary_hits = trace(blas, &primary);
    let bounds = mesh.bounds();
    let centre = bounds.centre();
    let light = mesh.light.unwrap_or(Vec3::new(
        centre.x,
        bounds.lower.y + 0.75 * (bounds.upper.y - bounds.lower.y),
        centre.z,
    ));
    let points = surface_points(mesh, &primary, &primary_hits);
    let shadow = points.iter().map(|p| p.towards(light)).collect();
    let reach = 0.1 * bounds.diagonal();
    let ao = points.iter().flat_map(|p| (0..4).map(|i| p.cosine(i, reach))).collect();
    let diffuse: Vec<Ray> = points.iter().map(|p| p.cosine(4, f32::INFINITY)).collect();
    let diffuse_hits = trace(blas, &diffuse);
    let second = surface_points(mesh, &diffuse, &diffuse_hits)
        .iter()
        .map(|p| p.cosine(5, f32::INFINITY))
        .collect();
    let mut shuffled = diffuse.clone();
    shuffle(&mut shuffled);
    [
        (RaySetKind::Primary, primary),
        (RaySetKind::Shadow, shadow),
        (RaySetKind::Ao, ao),
        (RaySetKind::Diffuse, diffuse),
        (RaySetKind::DiffuseShuffled, shuffled),
        (RaySetKind::SecondBounce, second),
    ]
    .into_iter()
    .map(|(kind, rays)| RaySet { kind, rays })
    .collect()
}

fn primary(camera: &Camera, size: u32) -> Vec<Ray> {
    let mut rays = Vec::with_capacity((size * size) as usize);
    for tile_y in (0..size).step_by(8) {
        for tile_x in (0..size).step_by(8) {
            for y in tile_y..(tile_y + 8).min(size) {
                for x in tile_x..(tile_x + 8).min(size) {
                    let pixel = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
                    rays.push(camera.ray(pixel, (size, size), Vec2::splat(0.5)).0);
                }
            }
        }
    }
    rays
}

fn trace(blas: &Blas, rays: &[Ray]) -> Vec<Hit> {
    let mut hits = vec![Hit::MISS; rays.len()];
    blas.closest_hits(rays, &mut hits, &TraceOptions::default(), &AcceptAll);
    hits
}

/// A point on a surface, seen from where the ray came.
struct SurfacePoint {
    position: Vec3,
    error: Vec3,
    normal: Vec3,
    seed: u32,
}

fn surface_points(mesh: &FlatMesh, rays: &[Ray], hits: &[Hit]) -> Vec<SurfacePoint> {
    rays.iter()
        .zip(hits)
        .enumerate()
        .filter(|(_, (_, hit))| hit.is_hit())
        .map(|(index, (ray, hit))| {
            let corners = mesh.indices[hit.primitive as usize];
            let [a, b, c] = corners.map(|i| mesh.positions[i as usize]);
            let normal = mesh.normal(hit.primitive);
            let edges = [b - a, c - a];
            let own = intersection_error(edges, edges[0].cross(edges[1]).length());
            SurfacePoint {
                position: (1.0 - hit.u - hit.v) * a + hit.u * b + hit.v * c,
                error: interpolation_error(a, b, c, hit.u, hit.v) + Vec3::splat(own),
                normal: if normal.dot(ray.direction) > 0.0 { -normal } else { normal },
                seed: hash::pcg(index as u32),
            }
        })
        .collect()
}

impl SurfacePoint {
    fn towards(&self, light: Vec3) -> Ray {
        let origin = spawn_origin(self.position, self.error, self.normal, light - self.position);
        Ray::with_interval(origin, light - origin, 0.0, 1.0)
    }

    fn cosine(&self, dimension: u32, t_max: f32) -> Ray {
        let mut rng = Rng::new(u64::from(hash::combine(self.seed, dimension)));
        let direction =
            Frame::from_normal(self.normal).to_world(warp::cosine_hemisphere(rng.vec2()));
        let origin = spawn_origin(self.position, self.error, self.normal, direction);
        Ray::with_interval(origin, direction, 0.0, t_max)
    }
}

/// Fisher and Yates' shuffle.
fn shuffle(rays: &mut [Ray]) {
    let mut rng = Rng::new(42);
    for i in (1..rays.len()).rev() {
        rays.swap(i, rng.below(i as u32 + 1) as usize);
    }
}
