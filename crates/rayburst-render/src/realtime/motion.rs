//! Motion vectors: where a pixel's point was in the frame before.
//!
//! The point keeps its barycentric coordinates on its triangle, so whatever moves the triangle is found:
//! the camera, an instance, a skin, a morph.

use rayburst_math::{
    Hit,
    glam::Vec3,
    lanes::{F32x16, LANES, Mask16, Vec2x16, Vec3x16},
};
use rayburst_scene::FlatScene;

use super::view::FrameView;

/// What the frame before looked like.
#[derive(Clone, Copy, Debug)]
pub struct Motion<'a> {
    view: FrameView,
    /// The view and the scene of the frame before.
    before: Option<(FrameView, &'a FlatScene)>,
}

impl<'a> Motion<'a> {
    /// The motion to `view` from the frame before. Without one, or if its scene is another, nothing
    /// moves.
    pub fn new(
        view: FrameView,
        scene: &FlatScene,
        before: Option<(FrameView, &'a FlatScene)>,
    ) -> Self {
        Self { view, before: before.filter(|(_, other)| is_same_scene(scene, other)) }
    }

    /// Of sixteen points that hits name: where they were before minus where they are now, pixels, and how
    /// much deeper they were, world units; zero where one was behind the eye.
    #[inline(always)]
    pub(crate) fn of_hits(
        &self,
        scene: &FlatScene,
        hits: &[Hit; LANES],
        position: Vec3x16,
    ) -> (Vec2x16, F32x16) {
        let Some((view, other)) = self.before else { return (Vec2x16::ZERO, F32x16::ZERO) };
        let mut before = position;
        if !std::ptr::eq(scene, other) {
            where_before(scene, other, hits, &mut before);
        }
        self.between(&view, before, position)
    }

    /// Of what lies infinitely far in sixteen directions.
    #[inline(always)]
    pub(crate) fn of_sky(&self, directions: Vec3x16) -> Vec2x16 {
        let Some((view, _)) = self.before else { return Vec2x16::ZERO };
        let far = |view: &FrameView| Vec3x16::splat(view.camera().eye()) + directions;
        self.between(&view, far(&view), far(&self.view)).0
    }

    #[inline(always)]
    fn between(&self, view: &FrameView, before: Vec3x16, now: Vec3x16) -> (Vec2x16, F32x16) {
        let (pixel_before, depth_before, seen_before) = view.project16(before);
        let (pixel, depth, seen) = self.view.project16(now);
        let both: Mask16 = seen_before & seen;
        let moved = both.select(pixel_before - pixel, Vec2x16::ZERO);
        (moved, both.select(depth_before - depth, F32x16::ZERO))
    }
}

/// Replaces the positions of what has moved since by what they were.
#[inline(never)]
fn where_before(
    scene: &FlatScene,
    other: &FlatScene,
    hits: &[Hit; LANES],
    positions: &mut Vec3x16,
) {
    for (lane, hit) in hits.iter().enumerate() {
        let (instance, geometry) = scene.records(hit);
        let (old_instance, old_geometry) = other.records(hit);
        let still = instance.object_to_world == old_instance.object_to_world
            && std::sync::Arc::ptr_eq(&geometry.primitive, &old_geometry.primitive)
            && geometry.transform == old_geometry.transform;
        if !still {
            let [a, b, c] = other.world_triangle(hit.instance, hit.geometry, hit.primitive).points;
            let before: Vec3 = (1.0 - hit.u - hit.v) * a + hit.u * b + hit.v * c;
            positions.set_lane(lane, before);
        }
    }
}

/// Whether a hit of one scene names a triangle of the other, too.
pub(crate) fn is_same_scene(a: &FlatScene, b: &FlatScene) -> bool {
    std::ptr::eq(a, b)
        || (a.instances.len() == b.instances.len()
            && a.geometries.len() == b.geometries.len()
            && a.instances.iter().zip(&b.instances).all(|(a, b)| {
                (a.first_geometry, a.geometry_count) == (b.first_geometry, b.geometry_count)
            })
            && a.geometries.iter().zip(&b.geometries).all(|(a, b)| {
                let (p, q) = (&a.primitive, &b.primitive);
                std::sync::Arc::ptr_eq(p, q)
                    || (p.indices.len() == q.indices.len()
                        && p.positions.len() == q.positions.len())
            }))
}
