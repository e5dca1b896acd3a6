//! What all shapes can do.

use std::ops::ControlFlow;

use glam::{Vec2, Vec3};
use rayburst_math::{Aabb, Ray};

/// Where a ray meets a shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShapeHit {
    /// Distance in units of the ray's direction.
    pub t: f32,
    /// The unit normal in object space. Of a solid it points outwards, of a sheet to the side that its
    /// documentation names the front.
    pub normal: Vec3,
    /// Coordinates on the surface, as the shape's documentation says.
    pub uv: Vec2,
}

impl ShapeHit {
    /// Whether the ray meets the front: the side that the normal points to.
    pub fn is_front(&self, ray: &Ray) -> bool {
        self.normal.dot(ray.direction) < 0.0
    }
}

/// A surface in object space that rays can be intersected with.
pub trait Shape: Send + Sync {
    /// A box around the shape; hits lie in it up to rounding.
    fn bounds(&self) -> Aabb;

    /// Gives every hit in the ray's interval to `report`, nearest first, until it breaks.
    fn hits(&self, ray: &Ray, report: &mut dyn FnMut(ShapeHit) -> ControlFlow<()>);

    /// The nearest hit in the ray's interval.
    fn nearest(&self, ray: &Ray) -> Option<ShapeHit> {
        let mut nearest = None;
        self.hits(ray, &mut |hit| {
            nearest = Some(hit);
            ControlFlow::Break(())
        });
        nearest
    }
}
