//! Primary visibility: what every pixel of a picture sees, by rasterising or by tracing.
//!
//! Both ways give the same values. The rasteriser finds the triangle of each pixel; where the pixel's ray
//! meets it is then computed as traversal would, and the few rays that miss it by rounding are traced, as are
//! those of pixels where surfaces lie in each other.

use std::sync::Arc;

use rayburst_accel::CandidateFilter;
use rayburst_image::Plane;
use rayburst_math::{
    Hit, HitKind, Ray,
    glam::{Affine3A, Vec3},
};
use rayburst_raster::{
    Candidate, Clusters, Coverage, IsaLevel, Mesh, RasterError, Rasteriser, View, Visibility,
};
use rayburst_scene::{AlphaFilter, FlatScene, Primitive};
use rayburst_simd::{Isa, Kernel, Meetings, Pairs, meet_each};
use rayon::prelude::*;

use super::{pass::isa_of, view::FrameView};

/// Pixels along a side of the squares in which rays are traced.
const SQUARE: u32 = 8;
/// Squares in a batch of rays.
const SQUARES: u32 = 32;
/// Pixels whose rays are intersected side by side.
const LANES: usize = 16;

/// What rasterising scenes keeps from picture to picture: the rasteriser's memory, and geometry that stays
/// where it is, cut into clusters.
#[derive(Debug)]
pub struct PrimaryRaster {
    isa: IsaLevel,
    rasteriser: Rasteriser,
    visibility: Visibility,
    /// By geometry of the scene.
    kept: Vec<Kept>,
    placements: Vec<Placement>,
    /// Pixels of each band whose rays must be traced.
    missed: Vec<Vec<u32>>,
}

/// A geometry as it was when last drawn.
#[derive(Debug)]
struct Kept {
    primitive: Arc<Primitive>,
    transform: Affine3A,
    clusters: Clusters,
}

/// How rays enter a mesh.
#[derive(Clone, Copy, Debug)]
struct Placement {
    inverse: Affine3A,
    identity: bool,
}

impl Placement {
    /// A ray in the mesh's space, with the bits of traversal.
    #[inline(always)]
    fn local(&self, ray: &Ray) -> Ray {
        if self.identity {
            return *ray;
        }
        let origin = self.inverse.transform_point3(ray.origin);
        Ray { origin, direction: self.inverse.transform_vector3(ray.direction), ..*ray }
    }
}

impl PrimaryRaster {
    /// One that uses an instruction set.
    pub fn new(isa: IsaLevel) -> Self {
        Self {
            isa,
            rasteriser: Rasteriser::new(isa),
            visibility: Visibility::default(),
            kept: Vec::new(),
            placements: Vec::new(),
            missed: Vec::new(),
        }
    }

    /// Cuts geometry into clusters, but what is as it was; what has only moved keeps its clusters.
    fn update(&mut self, scene: &FlatScene) {
        self.kept.truncate(scene.geometries.len());
        let transform = |t: Affine3A| (t != Affine3A::IDENTITY).then_some(t);
        self.kept.par_iter_mut().zip(&scene.geometries).for_each(|(kept, geometry)| {
            let (old, new) = (&kept.primitive, &geometry.primitive);
            if Arc::ptr_eq(old, new) && kept.transform == geometry.transform {
                return;
            }
            let place = transform(geometry.transform);
            let same = Arc::ptr_eq(old, new) || old.indices == new.indices;
            if !(same && kept.clusters.refit(&new.positions, place)) {
                kept.clusters = Clusters::new(&new.positions, &new.indices, place);
            }
            (kept.primitive, kept.transform) = (new.clone(), geometry.transform);
        });
        let known = self.kept.len();
        self.kept.par_extend(scene.geometries[known..].par_iter().map(|geometry| {
            let primitive = geometry.primitive.clone();
            let place = transform(geometry.transform);
            let clusters = Clusters::new(&primitive.positions, &primitive.indices, place);
            Kept { primitive, transform: geometry.transform, clusters }
        }));
    }
}

/// Finds what the pixels of a picture see, row by row from the top left: the hits of the rays through their
/// centres, jitter in pixels added, as [`trace_primary`] finds them but for a few pixels that edges go
/// through. The camera's lens is ignored.
///
/// `keys` are the roots of alpha decisions, one a pixel, as [`AlphaFilter`] takes them; those that are missing
/// are zero.
pub fn rasterise(
    raster: &mut PrimaryRaster,
    scene: &FlatScene,
    view: &FrameView,
    keys: &[u32],
    hits: &mut Vec<Hit>,
) -> Result<(), RasterError> {
    let (rays, size) = (view, view.size());
    raster.update(scene);
    let PrimaryRaster { isa, rasteriser, visibility, kept, placements, missed } = raster;
    let mut meshes = Vec::new();
    list(scene, kept, &mut meshes, placements);
    let keys = padded(keys, size);
    let alpha = AlphaFilter::new(scene, &keys);
    let coverage = Alpha { rays, width: size.0, meshes: &meshes, placements, alpha };
    let result = rasteriser.draw(&rays.to_raster(), &meshes, &coverage, visibility);
    if result.is_ok() {
        hits.resize(size.0 as usize * size.1 as usize, Hit::MISS);
        let bands = (size.1 as usize).div_ceil(SQUARE as usize);
        missed.resize_with(bands.max(missed.len()), Vec::new);
        let resolve = Resolve { rays, meshes: &meshes, placements, visibility, width: size.0 };
        hits.par_chunks_mut((size.0 * SQUARE) as usize).zip(missed).enumerate().for_each(
            |(band, (hits, missed))| {
                missed.clear();
                let top = band as u32 * SQUARE;
                isa.dispatch(ResolveBand { resolve: &resolve, top, hits, missed });
                for &pixel in missed.iter() {
                    let number = (top * size.0 + pixel) as usize;
                    let ray = rays.ray(pixel % size.0, top + pixel / size.0);
                    hits[pixel as usize] = scene.closest_hit(&ray, Some(keys[number]));
                }
            },
        );
    }
    result
}

/// Lists the meshes of a scene and how rays enter them.
fn list<'a>(
    scene: &FlatScene,
    kept: &'a [Kept],
    meshes: &mut Vec<Mesh<'a>>,
    placements: &mut Vec<Placement>,
) {
    placements.clear();
    for (number, (instance, placed)) in
        scene.instances.iter().zip(scene.tlas.instances()).enumerate()
    {
        let infos = scene.tlas.blases()[placed.blas as usize].geometries();
        let placement = Placement {
            inverse: scene.tlas.world_to_object(number as u32),
            identity: placed.transform == Affine3A::IDENTITY,
        };
        for geometry in 0..instance.geometry_count {
            meshes.push(Mesh {
                clusters: &kept[(instance.first_geometry + geometry) as usize].clusters,
                transform: placed.transform,
                instance: number as u32,
                geometry,
                opaque: infos.get(geometry as usize).is_none_or(|info| info.opaque),
            });
            placements.push(placement);
        }
    }
}

/// Draws how far everything is from a light, along the view: for shadow maps. Alpha is decided as by rays,
/// by the place on the triangle that a texel's centre sees.
pub(crate) fn draw_depth(
    raster: &mut PrimaryRaster,
    scene: &FlatScene,
    view: &View,
    depth: &mut Plane,
) -> Result<(), RasterError> {
    raster.update(scene);
    let PrimaryRaster { rasteriser, kept, placements, .. } = raster;
    let mut meshes = Vec::new();
    list(scene, kept, &mut meshes, placements);
    rasteriser.draw_depth(view, &meshes, &TexelAlpha { scene }, depth)
}

/// Asks alpha about candidates in a shadow map.
struct TexelAlpha<'a> {
    scene: &'a FlatScene,
}

impl Coverage for TexelAlpha<'_> {
    fn covers(&self, pixel: u32, candidate: &Candidate) -> bool {
        let hit = Hit {
            t: 1.0,
            u: candidate.u,
            v: candidate.v,
            primitive: candidate.primitive,
            geometry: candidate.geometry,
            instance: candidate.instance,
            kind: HitKind::TRIANGLE_FRONT,
            reserved: 0,
        };
        let keys = [pixel];
        let alpha = AlphaFilter::new(self.scene, &keys);
        alpha.accept(0, &Ray::new(Vec3::ZERO, Vec3::Z), &hit)
    }
}

/// The twin of [`rasterise`] that traces a ray a pixel, 8×8 pixels after each other.
pub fn trace_primary(scene: &FlatScene, view: &FrameView, keys: &[u32], hits: &mut Vec<Hit>) {
    let size = view.size();
    let opaque = scene.is_opaque();
    let all_keys = if opaque { (&[]).into() } else { padded(keys, size) };
    let isa = isa_of(scene);
    let (width, height) = size;
    hits.clear();
    hits.resize(width as usize * height as usize, Hit::MISS);
    if hits.is_empty() {
        return;
    }
    hits.par_chunks_mut((width * SQUARE) as usize).enumerate().for_each_init(
        || (Vec::new(), Vec::new(), Vec::new(), Vec::new()),
        |(rays, keys, found, pixels): &mut (Vec<Ray>, Vec<u32>, Vec<Hit>, Vec<u32>),
         (band, hits)| {
            let top = band as u32 * SQUARE;
            let rows = SQUARE.min(height - top);
            for first in (0..width).step_by((SQUARE * SQUARES) as usize) {
                rays.clear();
                keys.clear();
                pixels.clear();
                for left in (first..width.min(first + SQUARE * SQUARES)).step_by(SQUARE as usize) {
                    for y in 0..rows {
                        let columns = left..width.min(left + SQUARE);
                        isa.dispatch(RowOfRays {
                            view,
                            columns: columns.clone(),
                            y: top + y,
                            rays,
                        });
                        pixels.extend(columns.map(|x| y * width + x));
                    }
                }
                if !opaque {
                    keys.extend(pixels.iter().map(|&at| all_keys[(top * width + at) as usize]));
                }
                found.clear();
                found.resize(rays.len(), Hit::MISS);
                scene.closest_hits(rays, (!opaque).then_some(&keys[..]), found);
                for (&pixel, hit) in pixels.iter().zip(&*found) {
                    hits[pixel as usize] = *hit;
                }
            }
        },
    );
}

/// Lists the rays through a square's row of pixels.
struct RowOfRays<'a> {
    view: &'a FrameView,
    columns: std::ops::Range<u32>,
    y: u32,
    rays: &'a mut Vec<Ray>,
}

impl Kernel for RowOfRays<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, _: I) {
        let Self { view, columns, y, rays } = self;
        let [dx, dy, dz] = view.directions::<{ SQUARE as usize }>(columns.start, y);
        let eye = view.origin(columns.start, y);
        let still = view.is_perspective();
        for lane in 0..columns.len() {
            let direction = Vec3::new(dx[lane], dy[lane], dz[lane]);
            let origin = if still { eye } else { view.origin(columns.start + lane as u32, y) };
            rays.push(Ray::new(origin, direction));
        }
    }
}

/// As many keys as there are pixels.
fn padded(keys: &[u32], size: (u32, u32)) -> std::borrow::Cow<'_, [u32]> {
    let count = size.0 as usize * size.1 as usize;
    if keys.len() >= count {
        return keys.into();
    }
    let mut all = keys.to_vec();
    all.resize(count, 0);
    all.into()
}

/// Asks alpha about candidates of the rasteriser.
struct Alpha<'a> {
    rays: &'a FrameView,
    width: u32,
    meshes: &'a [Mesh<'a>],
    placements: &'a [Placement],
    alpha: AlphaFilter<'a>,
}

impl Coverage for Alpha<'_> {
    fn covers(&self, pixel: u32, candidate: &Candidate) -> bool {
        let mesh = candidate.mesh as usize;
        let ray = self.rays.ray(pixel % self.width, pixel / self.width);
        let mut pair = Pairs::<1>::NONE;
        let corners = self.meshes[mesh].clusters.triangle(candidate.primitive);
        let Some(corners) = corners else { return false };
        let local = self.placements[mesh].local(&ray);
        for axis in 0..3 {
            pair.origin[axis] = [local.origin[axis]];
            pair.direction[axis] = [local.direction[axis]];
            for corner in 0..3 {
                pair.corners[corner][axis] = [corners[corner][axis]];
            }
        }
        let met = meet_each(&pair);
        let mut hit = Hit {
            t: met.t[0],
            u: met.u[0],
            v: met.v[0],
            primitive: candidate.primitive,
            geometry: candidate.geometry,
            instance: candidate.instance,
            kind: kind(met.front[0]),
            reserved: 0,
        };
        if !met.met[0] {
            // Beside the triangle by rounding: the rasteriser's own values.
            (hit.u, hit.v) = (candidate.u, candidate.v);
        }
        self.alpha.accept(pixel, &ray, &hit)
    }
}

fn kind(front: bool) -> HitKind {
    if front { HitKind::TRIANGLE_FRONT } else { HitKind::TRIANGLE_BACK }
}

/// Turns triangles of pixels into hits of their rays.
struct Resolve<'a> {
    rays: &'a FrameView,
    meshes: &'a [Mesh<'a>],
    placements: &'a [Placement],
    visibility: &'a Visibility,
    width: u32,
}

/// Does so for some rows.
struct ResolveBand<'a> {
    resolve: &'a Resolve<'a>,
    top: u32,
    hits: &'a mut [Hit],
    missed: &'a mut Vec<u32>,
}

impl Kernel for ResolveBand<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, _: I) {
        let Self { resolve, top, hits, missed } = self;
        let mut pairs = Pairs::<LANES>::NONE;
        // The mesh found last, its first triangle and the one after its last.
        let (mut mesh, mut first, mut end) = (0, 0, 0);
        // The triangle found last, and its corners.
        let (mut last, mut corners) = (u32::MAX, [[0.0; 3]; 3]);
        for (row, hits) in hits.chunks_mut(resolve.width as usize).enumerate() {
            let y = top + row as u32;
            let ids = resolve.visibility.triangles.row(y);
            for (start, (hits, ids)) in hits.chunks_mut(LANES).zip(ids.chunks(LANES)).enumerate() {
                let x = (start * LANES) as u32;
                if ids.iter().all(|&id| id == u32::MAX) {
                    hits.fill(Hit::MISS);
                    continue;
                }
                pairs.direction = resolve.rays.directions(x, y);
                let mut active = 0u32;
                for (lane, (hit, &id)) in hits.iter_mut().zip(ids).enumerate() {
                    if id < first || id >= end {
                        let Some((found, primitive)) = resolve.visibility.identify(id) else {
                            *hit = Hit::MISS;
                            continue;
                        };
                        let count = resolve.meshes[found].clusters.primitive_count();
                        (mesh, first, end) = (found, id - primitive, id - primitive + count);
                    }
                    let drawn = &resolve.meshes[mesh];
                    if id != last {
                        let Some(found) = drawn.clusters.triangle(id - first) else {
                            *hit = Hit::MISS;
                            continue;
                        };
                        (last, corners) = (id, found.map(Into::into));
                    }
                    let placement = &resolve.placements[mesh];
                    let mut origin = resolve.rays.origin(x + lane as u32, y);
                    if !placement.identity {
                        let direction = pairs.direction.each_ref().map(|axis| axis[lane]).into();
                        let ray = placement.local(&Ray::new(origin, direction));
                        origin = ray.origin;
                        for axis in 0..3 {
                            pairs.direction[axis][lane] = ray.direction[axis];
                        }
                    }
                    for axis in 0..3 {
                        pairs.origin[axis][lane] = origin[axis];
                        for corner in 0..3 {
                            pairs.corners[corner][axis][lane] = corners[corner][axis];
                        }
                    }
                    (hit.primitive, hit.geometry, hit.instance) =
                        (id - first, drawn.geometry, drawn.instance);
                    hit.reserved = 0;
                    active |= 1 << lane;
                }
                let met: Meetings<LANES> = meet_each(&pairs);
                for (lane, hit) in hits.iter_mut().enumerate() {
                    if active >> lane & 1 == 0 {
                        continue;
                    }
                    (hit.t, hit.u, hit.v) = (met.t[lane], met.u[lane], met.v[lane]);
                    hit.kind = kind(met.front[lane]);
                    if !met.met[lane] || resolve.visibility.is_contested(x + lane as u32, y) {
                        missed.push(row as u32 * resolve.width + x + lane as u32);
                    }
                }
            }
        }
    }
}
