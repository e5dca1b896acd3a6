//! Motion vectors: where a pixel's point was in the frame before.
//!
//! The point keeps its barycentric coordinates on its triangle, so whatever moves the triangle is found:
//! the camera, an instance, a skin, a morph.

use rayburst_math::{
    Hit, Ray,
    glam::{Vec2, Vec3},
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

    /// Of a point that a hit names: before minus now, pixels; zero where it was behind the eye.
    #[inline]
    pub fn of_hit(&self, scene: &FlatScene, hit: &Hit, position: Vec3) -> Vec2 {
        let Some((view, other)) = self.before else { return Vec2::ZERO };
        let (instance, geometry) = scene.records(hit);
        let (old_instance, old_geometry) = other.records(hit);
        let still = instance.object_to_world == old_instance.object_to_world
            && std::sync::Arc::ptr_eq(&geometry.primitive, &old_geometry.primitive)
            && geometry.transform == old_geometry.transform;
        let before = if still {
            position
        } else {
            let [a, b, c] = other.world_triangle(hit.instance, hit.geometry, hit.primitive).points;
            (1.0 - hit.u - hit.v) * a + hit.u * b + hit.v * c
        };
        self.between(view.project(before), self.view.project(position))
    }

    /// Of what lies infinitely far in a ray's direction.
    #[inline]
    pub fn of_sky(&self, ray: &Ray) -> Vec2 {
        let Some((view, _)) = self.before else { return Vec2::ZERO };
        let far = |view: &FrameView| view.project(view.camera().eye() + ray.direction);
        self.between(far(&view), far(&self.view))
    }

    #[inline]
    fn between(&self, before: Option<Vec2>, now: Option<Vec2>) -> Vec2 {
        before.zip(now).map_or(Vec2::ZERO, |(before, now)| before - now)
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
