//! The G-buffer: what every pixel's eye ray meets, as planes that all later passes read.
//!
//! Where it comes from, rasterising or tracing, does not matter: both give hits, and [`GBuffer::resolve`]
//! makes the planes of them.

use std::ops::Range;

use rayburst_image::{Band, Band3, Plane, Plane3};
use rayburst_math::{
    Frame, Hit,
    glam::{Vec2, Vec3},
    offset::spawn_origin,
};
use rayburst_scene::{Bsdf, FlatScene, ShadingModel, ShadingOptions};
use rayon::prelude::*;

use super::{motion::Motion, view::FrameView};
use crate::Result;

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
        let width = self.depth.width();
        self.rows().into_par_iter().for_each(|mut rows| {
            let range = rows.depth.top()..rows.depth.top() + rows.depth.rows();
            for y in range.clone() {
                for x in 0..width {
                    let hit = rows.hits[((y - range.start) * width + x) as usize];
                    resolve_pixel(scene, view, motion, shading, &sky, &mut rows, (x, y), &hit);
                }
            }
        });
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

/// The pixels of a band, in squares, so that neighbours in this order are neighbours in the picture.
pub(crate) fn squares(width: u32, rows: Range<u32>) -> impl Iterator<Item = (u32, u32)> {
    (0..width).step_by(BAND as usize).flat_map(move |left| {
        let rows = rows.clone();
        rows.flat_map(move |y| (left..(left + BAND).min(width)).map(move |x| (x, y)))
    })
}

#[inline]
fn resolve_pixel(
    scene: &FlatScene,
    view: &FrameView,
    motion: &Motion<'_>,
    shading: &ShadingOptions,
    sky: &impl Fn(Vec3) -> Vec3,
    rows: &mut Rows<'_>,
    (x, y): (u32, u32),
    hit: &Hit,
) {
    let ray = view.ray(x, y);
    if !hit.is_hit() {
        rows.kind.set(x, y, PixelKind::Nothing as u32);
        rows.depth.set(x, y, f32::INFINITY);
        for plane in [&mut rows.position, &mut rows.geometric_normal, &mut rows.normal] {
            plane.set(x, y, Vec3::ZERO);
        }
        rows.albedo.set(x, y, Vec3::ZERO);
        for plane in [&mut rows.error, &mut rows.metallic, &mut rows.roughness] {
            plane.set(x, y, 0.0);
        }
        rows.footprint.set(x, y, 0.0);
        rows.emitted.set(x, y, sky(ray.direction));
        rows.material.set(x, y, 0);
        rows.instance.set(x, y, 0);
        set_motion(rows, (x, y), motion.of_sky(&ray));
        return;
    }
    let surface = scene.surface(hit);
    let width = view.cone(ray.direction).width_at(hit.t);
    let seen = view.footprint(shading.lod, (x, y)).at(&ray, hit, &surface);
    let point = scene.shading_point(&surface, -ray.direction, seen, shading);
    let kind = if point.bsdf.is_specular_only() {
        PixelKind::Specular
    } else if scene.materials[surface.material as usize].model() == ShadingModel::Unlit {
        PixelKind::Emitter
    } else {
        PixelKind::Surface
    };
    rows.kind.set(x, y, kind as u32);
    rows.depth.set(x, y, view.depth(surface.position));
    rows.position.set(x, y, surface.position);
    rows.error.set(x, y, surface.error.max_element());
    rows.geometric_normal.set(x, y, surface.normal_towards(-ray.direction));
    rows.normal.set(x, y, point.frame.normal);
    rows.albedo.set(x, y, point.base_color);
    rows.metallic.set(x, y, point.metallic);
    rows.roughness.set(x, y, point.roughness);
    rows.emitted.set(x, y, point.emitted);
    rows.material.set(x, y, surface.material + 1);
    rows.instance.set(x, y, surface.node + 1);
    rows.footprint.set(x, y, width);
    set_motion(rows, (x, y), motion.of_hit(scene, hit, surface.position));
}

fn set_motion(rows: &mut Rows<'_>, (x, y): (u32, u32), motion: Vec2) {
    rows.motion[0].set(x, y, motion.x);
    rows.motion[1].set(x, y, motion.y);
}
