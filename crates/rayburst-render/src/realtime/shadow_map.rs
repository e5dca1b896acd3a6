//! Shadow maps of punctual lights: what rasterising engines do in place of shadow rays, and what rays are
//! measured against (chapter 26.4: sampled at the light's frequency, not at the screen's).
//!
//! Williams: "Casting Curved Shadows on Curved Surfaces", SIGGRAPH 1978. A sun has one orthographic map of
//! the whole scene, a point light the six faces of a cube, a spot light one map. Shadows are hard, whatever the
//! size of the sun.

use rayburst_image::Plane;
use rayburst_math::glam::{Vec2, Vec3};
use rayburst_raster::{Projection, View};
use rayburst_scene::{FlatScene, Light, LightKind};

use super::visibility::{PrimaryRaster, draw_depth};
use crate::Result;

/// Texels along a side of a sun's map, and of each other map.
const SUN_TEXELS: u32 = 2048;
const TEXELS: u32 = 1024;

/// Texels by which the depths of a map may be wrong, for a surface at 45°.
const BIAS_TEXELS: f32 = 1.5;

/// One map.
#[derive(Debug)]
struct Map {
    view: View,
    depth: Plane,
}

/// The maps of one light.
#[derive(Debug, Default)]
pub(crate) struct ShadowMaps {
    maps: Vec<Map>,
}

/// A frame that looks along a direction: right, up, into the scene.
fn frame(towards: Vec3) -> [Vec3; 3] {
    let v = towards.normalize_or(-Vec3::Z);
    let up = if v.y.abs() > 0.9 { Vec3::X } else { Vec3::Y };
    let r = v.cross(up).normalize_or(Vec3::X);
    [r, r.cross(v), v]
}

impl ShadowMaps {
    /// Draws the maps of a light.
    pub(crate) fn draw(
        &mut self,
        raster: &mut PrimaryRaster,
        scene: &FlatScene,
        light: &Light,
    ) -> Result<()> {
        let views = views(scene, light);
        self.maps.truncate(views.len());
        for (i, view) in views.into_iter().enumerate() {
            if i >= self.maps.len() {
                self.maps.push(Map { view, depth: Plane::default() });
            }
            let map = &mut self.maps[i];
            map.view = view;
            draw_depth(raster, scene, &view, &mut map.depth)?;
        }
        Ok(())
    }

    /// Whether nothing is between a point of a surface and the light. `normal` is on the light's side.
    #[inline]
    pub(crate) fn is_lit(&self, point: Vec3, normal: Vec3) -> bool {
        self.maps.iter().find_map(|map| map.is_lit(point, normal)).unwrap_or(true)
    }
}

/// The views of a light's maps.
fn views(scene: &FlatScene, light: &Light) -> Vec<View> {
    let square = |texels| (texels, texels);
    let from = |eye, towards, tangent: f32| View {
        eye,
        frame: frame(towards),
        projection: Projection::Perspective { half: Vec2::splat(tangent) },
        size: square(TEXELS),
        jitter: Vec2::ZERO,
    };
    match light.kind {
        LightKind::Directional { direction, .. } => {
            let radius = 0.5 * scene.bounds.diagonal().max(f32::MIN_POSITIVE);
            let towards = direction.normalize_or(-Vec3::Y);
            vec![View {
                eye: scene.bounds.centre() - 1.01 * radius * towards,
                frame: frame(towards),
                projection: Projection::Orthographic { half: Vec2::splat(radius) },
                size: square(SUN_TEXELS),
                jitter: Vec2::ZERO,
            }]
        }
        LightKind::Point { position } => [Vec3::X, Vec3::Y, Vec3::Z]
            .into_iter()
            .flat_map(|axis| [axis, -axis])
            .map(|axis| from(position, axis, 1.0))
            .collect(),
        LightKind::Spot { position, direction, cos_outer, .. } => {
            // Wide spots need a cube as points do.
            if cos_outer < 0.5 {
                let point = Light { kind: LightKind::Point { position }, ..*light };
                return views(scene, &point);
            }
            let tangent = (1.0 - cos_outer * cos_outer).sqrt() / cos_outer;
            vec![from(position, direction, 1.05 * tangent.max(1e-3))]
        }
    }
}

impl Map {
    /// Whether a point is lit; `None` outside the map.
    #[inline]
    fn is_lit(&self, point: Vec3, normal: Vec3) -> Option<bool> {
        let View { eye, frame: [r, u, v], projection, size, .. } = self.view;
        let to = point - eye;
        let depth = to.dot(v);
        let (half, scale) = match projection {
            Projection::Perspective { half } if depth > 0.0 => (half, depth),
            Projection::Perspective { .. } => return None,
            Projection::Orthographic { half } => (half, 1.0),
        };
        let at = Vec2::new(to.dot(r), -to.dot(u)) / (scale * half);
        if at.abs().max_element() >= 1.0 || at.is_nan() {
            return None;
        }
        let texel = 0.5 * (at + Vec2::ONE) * Vec2::new(size.0 as f32, size.1 as f32);
        let nearest = self.depth.get_clamped(texel.x as i32, texel.y as i32);
        // What the surface's slope moves within a texel.
        let width = 2.0 * half.x * scale / size.0 as f32;
        let cosine = normal.dot(v).abs().max(0.05);
        let slope = (1.0 - cosine * cosine).max(0.0).sqrt() / cosine;
        Some(depth <= nearest + BIAS_TEXELS * width * (1.0 + slope))
    }
}
