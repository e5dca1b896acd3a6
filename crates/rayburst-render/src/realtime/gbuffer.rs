//! The G-buffer: what every pixel's eye ray meets, as planes that all later passes read.
//!
//! Where it comes from, rasterising or tracing, does not matter: both give hits, and [`GBuffer::resolve`]
//! makes the planes of them.

use std::ops::Range;

use rayburst_image::{Band, Band3, Plane, Plane3};
use rayburst_math::{
    Frame, Hit,
    glam::Vec3,
    lanes::{
        F32x16, Frame16, LANES, Mask16, Select, U32x16, Vec2x16, Vec3x16,
        spawn_origin as spawn_origin16,
    },
    offset::spawn_origin,
};
use rayburst_scene::{
    Bsdf, FlatScene, ShadingModel, ShadingOptions, TextureLod,
    wide::{Footprint16, Lobes16, Surface16},
};
use rayburst_simd::{Isa, Kernel};
use rayon::prelude::*;

use super::{motion::Motion, pass::isa_of, view::FrameView};
use crate::{RayFootprint, Result};

/// Rows that a thread works on at a time, and the side of the squares that their pixels are visited in.
pub(crate) const BAND: u32 = 8;

/// What is at a pixel, in [`GBuffer::kind`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum PixelKind {
    /// Nothing: the ray leaves the scene.
    Nothing = 0,
    /// A surface that scatters light from all directions.
    Surface = 1,
    /// A perfect mirror or glass: light comes from one or two directions.
    Specular = 2,
    /// A surface that only shines.
    Emitter = 3,
}

/// The planes of a frame's first hits. World space; zero where nothing is.
#[derive(Clone, Debug, Default)]
pub struct GBuffer {
    /// The hits, row by row without padding.
    pub hits: Vec<Hit>,
    /// A [`PixelKind`].
    pub kind: Plane<u32>,
    /// Distance along the viewing direction; infinite where nothing is.
    pub depth: Plane,
    /// Position.
    pub position: Plane3,
    /// Bound of the position's error in every coordinate: how far rays keep off.
    pub error: Plane,
    /// Unit normal of the triangle, on the side of the eye.
    pub geometric_normal: Plane3,
    /// Unit normal of shading, on the side of the eye.
    pub normal: Plane3,
    /// Base colour.
    pub albedo: Plane3,
    /// Metalness.
    pub metallic: Plane,
    /// Perceptual roughness.
    pub roughness: Plane,
    /// Radiance that leaves towards the eye by itself: emission, or what lies behind everything.
    pub emitted: Plane3,
    /// Number of the material plus one; 0 where nothing is.
    pub material: Plane<u32>,
    /// Number of the node plus one; 0 where nothing is.
    pub instance: Plane<u32>,
    /// Where the same point of the surface was in the frame before, minus where it is now, in pixels.
    pub motion: [Plane; 2],
    /// How deep that point was along the viewing direction of the frame before, minus how deep it is now.
    pub depth_motion: Plane,
    /// Diameter of the pixel's cone at the surface, world units.
    pub footprint: Plane,
}

/// Rows of all planes.
struct Rows<'a> {
    hits: &'a [Hit],
    kind: Band<'a, u32>,
    depth: Band<'a>,
    position: Band3<'a>,
    error: Band<'a>,
    geometric_normal: Band3<'a>,
    normal: Band3<'a>,
    albedo: Band3<'a>,
    metallic: Band<'a>,
    roughness: Band<'a>,
    emitted: Band3<'a>,
    material: Band<'a, u32>,
    instance: Band<'a, u32>,
    motion: [Band<'a>; 2],
    depth_motion: Band<'a>,
    footprint: Band<'a>,
}

impl GBuffer {
    /// Planes of a size, empty.
    pub fn new(size: (u32, u32)) -> Result<Self> {
        let plane = || Plane::new(size.0, size.1);
        let ids = || Plane::new(size.0, size.1);
        let vector = || Plane3::new(size.0, size.1);
        Ok(Self {
            hits: vec![Hit::MISS; size.0 as usize * size.1 as usize],
            kind: ids()?,
            depth: plane()?,
            position: vector()?,
            error: plane()?,
            geometric_normal: vector()?,
            normal: vector()?,
            albedo: vector()?,
            metallic: plane()?,
            roughness: plane()?,
            emitted: vector()?,
            material: ids()?,
            instance: ids()?,
            motion: [plane()?, plane()?],
            depth_motion: plane()?,
            footprint: plane()?,
        })
    }

    /// Width and height.
    pub fn size(&self) -> (u32, u32) {
        self.depth.size()
    }

    fn rows(&mut self) -> Vec<Rows<'_>> {
        let width = self.depth.width() as usize;
        let mut hits = self.hits.chunks(width * BAND as usize);
        let mut kind = self.kind.bands_mut(BAND);
        let mut depth = self.depth.bands_mut(BAND);
        let mut position = self.position.bands_mut(BAND);
        let mut error = self.error.bands_mut(BAND);
        let mut geometric_normal = self.geometric_normal.bands_mut(BAND);
        let mut normal = self.normal.bands_mut(BAND);
        let mut albedo = self.albedo.bands_mut(BAND);
        let mut metallic = self.metallic.bands_mut(BAND);
        let mut roughness = self.roughness.bands_mut(BAND);
        let mut emitted = self.emitted.bands_mut(BAND);
        let mut material = self.material.bands_mut(BAND);
        let mut instance = self.instance.bands_mut(BAND);
        let [x, y] = &mut self.motion;
        let (mut x, mut y) = (x.bands_mut(BAND), y.bands_mut(BAND));
        let mut depth_motion = self.depth_motion.bands_mut(BAND);
        let mut footprint = self.footprint.bands_mut(BAND);
        std::iter::from_fn(|| {
            Some(Rows {
                hits: hits.next()?,
                kind: kind.next()?,
                depth: depth.next()?,
                position: position.next()?,
                error: error.next()?,
                geometric_normal: geometric_normal.next()?,
                normal: normal.next()?,
                albedo: albedo.next()?,
                metallic: metallic.next()?,
                roughness: roughness.next()?,
                emitted: emitted.next()?,
                material: material.next()?,
                instance: instance.next()?,
                motion: [x.next()?, y.next()?],
                depth_motion: depth_motion.next()?,
                footprint: footprint.next()?,
            })
        })
        .collect()
    }

    /// Makes all planes of the hits, for a view, and the motion since another.
    pub fn resolve(
        &mut self,
        scene: &FlatScene,
        view: &FrameView,
        motion: &Motion<'_>,
        shading: &ShadingOptions,
        sky: impl Fn(Vec3) -> Vec3 + Sync,
    ) {
        let isa = isa_of(scene);
        let resolve = Resolve { scene, view, motion, shading, sky, width: self.depth.width() };
        self.rows().into_par_iter().for_each(|mut rows| {
            isa.dispatch(ResolveBand { resolve: &resolve, rows: &mut rows });
        });
    }

    /// Whether any pixel shows a perfect mirror or glass.
    pub(crate) fn has_mirrors(&self) -> bool {
        self.kind.values().contains(&(PixelKind::Specular as u32))
    }

    /// What is at a pixel.
    #[inline]
    pub fn kind_at(&self, x: u32, y: u32) -> PixelKind {
        match self.kind.get(x, y) {
            1 => PixelKind::Surface,
            2 => PixelKind::Specular,
            3 => PixelKind::Emitter,
            _ => PixelKind::Nothing,
        }
    }

    /// Where a pixel's surface is that scatters light; `None` elsewhere.
    #[inline]
    pub(crate) fn place_at(&self, (x, y): (u32, u32)) -> Option<Place> {
        let at = self.kind.index(x, y);
        (self.kind.at(at) == PixelKind::Surface as u32).then(|| Place {
            position: self.position.at(at),
            error: self.error.at(at),
            geometric_normal: self.geometric_normal.at(at),
            normal: self.normal.at(at),
        })
    }

    /// A pixel's surface that scatters light, as passes need it; `None` elsewhere.
    #[inline]
    pub(crate) fn surface_at(
        &self,
        scene: &FlatScene,
        view: &FrameView,
        options: &ShadingOptions,
        (x, y): (u32, u32),
    ) -> Option<PixelSurface> {
        let place = self.place_at((x, y))?;
        let at = self.kind.index(x, y);
        let material = &scene.materials[self.material.at(at) as usize - 1];
        let frame = Frame::from_normal(place.normal);
        let bsdf = Bsdf::metallic_roughness(
            self.albedo.at(at),
            self.metallic.at(at),
            self.roughness.at(at),
            material.ior,
            options.energy_compensation,
        )
        .with_geometric_normal(frame.to_local(place.geometric_normal));
        let wo = -view.ray(x, y).direction;
        Some(PixelSurface { place, frame, bsdf, wo: frame.to_local(wo) })
    }
}

impl GBuffer {
    /// The surfaces of sixteen pixels that scatter light; `None` if there are none.
    #[inline(always)]
    pub(crate) fn surfaces_at(
        &self,
        scene: &FlatScene,
        view: &FrameView,
        options: &ShadingOptions,
        pixels: &Pixels,
    ) -> Option<PixelSurfaces> {
        let places = self.places_at(pixels)?;
        let mut ior = F32x16::ONE;
        refraction(scene, &pixels.load(&self.material), &mut ior);
        let frame = Frame16::from_normal(places.normal);
        let lobes = Lobes16::new(
            pixels.of3(&self.albedo),
            pixels.of(&self.metallic),
            pixels.of(&self.roughness),
            ior,
            options.energy_compensation,
            frame.to_local(places.geometric_normal),
        );
        let wo = frame.to_local(-view.directions_at(&pixels.x, &pixels.y));
        Some(PixelSurfaces { places, frame, lobes, wo })
    }

    /// Where the surfaces of sixteen pixels are that scatter light; `None` if there are none.
    #[inline(always)]
    pub(crate) fn places_at(&self, pixels: &Pixels) -> Option<Places> {
        let kinds = U32x16(pixels.load(&self.kind));
        let some = pixels.some & kinds.is_equal(U32x16::splat(PixelKind::Surface as u32));
        if !some.any() {
            return None;
        }
        Some(Places {
            some,
            position: pixels.of3(&self.position),
            error: pixels.of(&self.error),
            geometric_normal: pixels.of3(&self.geometric_normal),
            normal: pixels.of3(&self.normal),
        })
    }
}

/// Indices of refraction of materials, given by their numbers plus one.
#[inline(never)]
pub(crate) fn refraction(scene: &FlatScene, materials: &[u32; LANES], ior: &mut F32x16) {
    for (ior, &material) in ior.0.iter_mut().zip(materials) {
        let material = (material as usize).checked_sub(1).and_then(|i| scene.materials.get(i));
        *ior = material.map_or(1.0, |material| material.ior);
    }
}

/// Where a pixel's surface is, taken from the planes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    pub(crate) position: Vec3,
    error: f32,
    pub(crate) geometric_normal: Vec3,
    pub(crate) normal: Vec3,
}

impl Place {
    /// Where a ray starts that leaves towards `direction`.
    #[inline]
    pub(crate) fn spawn(&self, direction: Vec3) -> Vec3 {
        let error = Vec3::splat(self.error);
        spawn_origin(self.position, error, self.geometric_normal, direction)
    }
}

/// A pixel's surface, taken from the planes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PixelSurface {
    pub(crate) place: Place,
    pub(crate) frame: Frame,
    pub(crate) bsdf: Bsdf,
    /// Towards the eye, in the frame.
    pub(crate) wo: Vec3,
}

/// Where sixteen surfaces are that scatter light, taken from the planes; the twin of [`Place`].
#[derive(Clone, Debug)]
pub(crate) struct Places {
    /// Lanes with such a surface.
    pub(crate) some: Mask16,
    pub(crate) position: Vec3x16,
    error: F32x16,
    pub(crate) geometric_normal: Vec3x16,
    pub(crate) normal: Vec3x16,
}

impl Places {
    /// Where rays start that leave towards `direction`.
    #[inline(always)]
    pub(crate) fn spawn(&self, direction: Vec3x16) -> Vec3x16 {
        let error = Vec3x16 { x: self.error, y: self.error, z: self.error };
        spawn_origin16(self.position, error, self.geometric_normal, direction)
    }
}

/// Sixteen surfaces that scatter light, taken from the planes; the twin of [`PixelSurface`].
#[derive(Clone, Debug)]
pub(crate) struct PixelSurfaces {
    pub(crate) places: Places,
    pub(crate) frame: Frame16,
    pub(crate) lobes: Lobes16,
    /// Towards the eye, in the frames.
    pub(crate) wo: Vec3x16,
}

/// Sixteen pixels.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pixels {
    pub(crate) x: [u32; LANES],
    pub(crate) y: [u32; LANES],
    /// Which of them count.
    pub(crate) some: Mask16,
    at: At,
}

#[derive(Clone, Copy, Debug)]
enum At {
    /// Side by side from an index on.
    Row(usize),
    Anywhere([usize; LANES]),
}

impl Pixels {
    /// Pixels side by side, as many as there are; `x` is a multiple of their number.
    #[inline(always)]
    pub(crate) fn row((left, y): (u32, u32), (width, height): (u32, u32)) -> Self {
        let (mut x, mut some) = ([left; LANES], Mask16::NONE);
        for lane in 0..LANES {
            x[lane] += lane as u32;
            some.set_lane(lane, x[lane] < width && y < height);
        }
        let index = y as usize * (width as usize).next_multiple_of(LANES) + left as usize;
        Self { x, y: [y; LANES], some, at: At::Row(index) }
    }

    /// Any pixels.
    pub(crate) fn anywhere(pixels: &[(u32, u32)], (width, _): (u32, u32)) -> Self {
        let stride = (width as usize).next_multiple_of(LANES);
        let (mut x, mut y, mut some) = ([0; LANES], [0; LANES], Mask16::NONE);
        let mut at = [0; LANES];
        for (lane, pixel) in pixels.iter().take(LANES).enumerate() {
            (x[lane], y[lane]) = *pixel;
            some.set_lane(lane, true);
            at[lane] = pixel.1 as usize * stride + pixel.0 as usize;
        }
        Self { x, y, some, at: At::Anywhere(at) }
    }

    #[inline(always)]
    fn load<T: Copy + Default>(&self, plane: &Plane<T>) -> [T; LANES] {
        match self.at {
            At::Row(index) => plane.lanes(index),
            At::Anywhere(at) => {
                let mut out = [T::default(); LANES];
                for lane in 0..LANES {
                    out[lane] = plane.at(at[lane]);
                }
                out
            }
        }
    }

    /// The values of a plane.
    #[inline(always)]
    pub(crate) fn of(&self, plane: &Plane) -> F32x16 {
        F32x16(self.load(plane))
    }

    /// The values of three planes.
    #[inline(always)]
    pub(crate) fn of3(&self, planes: &Plane3) -> Vec3x16 {
        let [x, y, z] = &planes.channels;
        Vec3x16 { x: self.of(x), y: self.of(y), z: self.of(z) }
    }
}

/// The pixels of a band, in squares, so that neighbours in this order are neighbours in the picture.
pub(crate) fn squares(width: u32, rows: Range<u32>) -> impl Iterator<Item = (u32, u32)> {
    (0..width).step_by(BAND as usize).flat_map(move |left| {
        let rows = rows.clone();
        rows.flat_map(move |y| (left..(left + BAND).min(width)).map(move |x| (x, y)))
    })
}

/// What the planes of a frame are made of.
struct Resolve<'a, S> {
    scene: &'a FlatScene,
    view: &'a FrameView,
    motion: &'a Motion<'a>,
    shading: &'a ShadingOptions,
    sky: S,
    width: u32,
}

struct ResolveBand<'a, 'r, S> {
    resolve: &'a Resolve<'a, S>,
    rows: &'a mut Rows<'r>,
}

impl<S: Fn(Vec3) -> Vec3> Kernel for ResolveBand<'_, '_, S> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, _: I) {
        let Self { resolve, rows } = self;
        let (top, bottom) = (rows.depth.top(), rows.depth.top() + rows.depth.rows());
        for y in top..bottom {
            for x in (0..resolve.width).step_by(LANES) {
                resolve.pixels(rows, (x, y));
            }
        }
    }
}

impl<S: Fn(Vec3) -> Vec3> Resolve<'_, S> {
    /// Sixteen pixels side by side, or as many as there are.
    #[inline(always)]
    fn pixels(&self, rows: &mut Rows<'_>, at: (u32, u32)) {
        let (x, y) = at;
        let Self { scene, view, shading, .. } = *self;
        let first = ((y - rows.depth.top()) * self.width + x) as usize;
        let count = LANES.min((self.width - x) as usize);
        let (hits, met) = lanes_of(&rows.hits[first..first + count]);
        let [dx, dy, dz] = view.directions::<LANES>(x, y);
        let directions = Vec3x16 { x: F32x16(dx), y: F32x16(dy), z: F32x16(dz) };
        if !met.any() {
            self.nothing(rows, at, count, directions);
            return;
        }
        let mut t = F32x16::ZERO;
        for lane in 0..LANES {
            t.0[lane] = hits[lane].t;
        }
        let surface = scene.surface16(&hits);
        let width = view.cone_width16(directions, t);
        let mut footprint = Footprint16::cones(width);
        if shading.lod == TextureLod::Differentials {
            differentials(view, at, count, &hits, &surface.geometric_normal, &mut footprint);
        }
        let point = scene.shading_point16(&surface, -directions, &footprint, shading);
        let (moved, deeper) = self.motion.of_hits(scene, &hits, surface.position);
        let depth = view.depth16(surface.position);

        let kept = |value: F32x16| met.select(value, F32x16::ZERO);
        put(&mut rows.depth, at, met.select(depth, F32x16::splat(f32::INFINITY)));
        put3(&mut rows.position, at, met, surface.position);
        put(&mut rows.error, at, kept(surface.error.max_element()));
        put3(&mut rows.geometric_normal, at, met, point.geometric_normal);
        put3(&mut rows.normal, at, met, point.normal);
        put3(&mut rows.albedo, at, met, point.base_color);
        put(&mut rows.metallic, at, kept(point.metallic));
        put(&mut rows.roughness, at, kept(point.roughness));
        put3(&mut rows.emitted, at, met, point.emitted);
        put(&mut rows.footprint, at, kept(width));
        put(&mut rows.depth_motion, at, kept(deeper));
        let moved = if met.all() {
            moved
        } else {
            Vec2x16::select(met, moved, self.motion.of_sky(directions))
        };
        put(&mut rows.motion[0], at, moved.x);
        put(&mut rows.motion[1], at, moved.y);
        self.numbers(rows, at, count, met, &surface);
        if !met.all() {
            self.sky(rows, at, count, met, directions);
        }
    }

    /// Where nothing is.
    #[inline(always)]
    fn nothing(&self, rows: &mut Rows<'_>, at: (u32, u32), count: usize, directions: Vec3x16) {
        let zero = F32x16::ZERO;
        put(&mut rows.depth, at, F32x16::splat(f32::INFINITY));
        let planes = [
            &mut rows.error,
            &mut rows.metallic,
            &mut rows.roughness,
            &mut rows.footprint,
            &mut rows.depth_motion,
        ];
        for plane in planes {
            put(plane, at, zero);
        }
        let planes = [
            &mut rows.position,
            &mut rows.geometric_normal,
            &mut rows.normal,
            &mut rows.albedo,
            &mut rows.emitted,
        ];
        for plane in planes {
            put3(plane, at, Mask16::NONE, Vec3x16::ZERO);
        }
        for plane in [&mut rows.kind, &mut rows.material, &mut rows.instance] {
            plane.from_pixel_mut(at.0, at.1)[..LANES].fill(0);
        }
        let moved = self.motion.of_sky(directions);
        put(&mut rows.motion[0], at, moved.x);
        put(&mut rows.motion[1], at, moved.y);
        self.sky(rows, at, count, Mask16::NONE, directions);
    }

    #[inline(never)]
    fn sky(
        &self,
        rows: &mut Rows<'_>,
        (x, y): (u32, u32),
        count: usize,
        met: Mask16,
        directions: Vec3x16,
    ) {
        for lane in (0..count).filter(|&lane| !met.lane(lane)) {
            rows.emitted.set(x + lane as u32, y, (self.sky)(directions.lane(lane)));
        }
    }

    /// Kinds, materials and instances.
    #[inline(never)]
    fn numbers(
        &self,
        rows: &mut Rows<'_>,
        (x, y): (u32, u32),
        count: usize,
        met: Mask16,
        surface: &Surface16,
    ) {
        let kinds = rows.kind.from_pixel_mut(x, y);
        let materials = rows.material.from_pixel_mut(x, y);
        let instances = rows.instance.from_pixel_mut(x, y);
        for lane in 0..count {
            let number = surface.material[lane];
            let kind = match self.scene.materials[number as usize].model() {
                ShadingModel::Dielectric | ShadingModel::Mirror => PixelKind::Specular,
                ShadingModel::Unlit => PixelKind::Emitter,
                ShadingModel::MetallicRoughness => PixelKind::Surface,
            };
            let (kind, material, instance) = match met.lane(lane) {
                true => (kind, number + 1, surface.node[lane] + 1),
                false => (PixelKind::Nothing, 0, 0),
            };
            (kinds[lane], materials[lane], instances[lane]) = (kind as u32, material, instance);
        }
    }
}

/// Hits of pixels, some hit in place of those that are missing, and which there are.
#[inline(never)]
fn lanes_of(hits: &[Hit]) -> ([Hit; LANES], Mask16) {
    let mut met = Mask16::NONE;
    let mut lanes = [Hit::MISS; LANES];
    let Some(some) = hits.iter().find(|hit| hit.is_hit()) else { return (lanes, met) };
    lanes = [*some; LANES];
    for (lane, hit) in hits.iter().enumerate().filter(|(_, hit)| hit.is_hit()) {
        lanes[lane] = *hit;
        met.set_lane(lane, true);
    }
    (lanes, met)
}

/// What one pixel to the right and one down are on the surfaces, by ray differentials.
#[inline(never)]
fn differentials(
    view: &FrameView,
    (x, y): (u32, u32),
    count: usize,
    hits: &[Hit; LANES],
    normals: &Vec3x16,
    footprint: &mut Footprint16,
) {
    let mut axes = [Vec3x16::ZERO; 2];
    for lane in 0..count {
        let at = (x + lane as u32, y);
        let footprint = view.footprint(TextureLod::Differentials, at);
        if let RayFootprint::Differential(differential) = footprint {
            let direction = view.ray(at.0, at.1).direction;
            let at_hit = differential.transfer(direction, hits[lane].t, normals.lane(lane));
            axes[0].set_lane(lane, at_hit.origin_dx);
            axes[1].set_lane(lane, at_hit.origin_dy);
        }
    }
    *footprint = Footprint16::axes(axes);
}

/// Writes sixteen values from a pixel on.
#[inline(always)]
fn put(rows: &mut Band<'_>, (x, y): (u32, u32), values: F32x16) {
    values.store(rows.from_pixel_mut(x, y));
}

/// Writes sixteen vectors from a pixel on, zero where nothing is.
#[inline(always)]
fn put3(rows: &mut Band3<'_>, (x, y): (u32, u32), met: Mask16, values: Vec3x16) {
    let [a, b, c] = rows.from_pixel_mut(x, y);
    met.select(values.x, F32x16::ZERO).store(a);
    met.select(values.y, F32x16::ZERO).store(b);
    met.select(values.z, F32x16::ZERO).store(c);
}
