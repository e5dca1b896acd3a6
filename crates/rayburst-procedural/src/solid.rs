//! Shapes with an inside.

use std::{ops::ControlFlow, sync::Arc};

use rayburst_math::{Aabb, Ray};

use crate::{IntervalList, Line, Shape, ShapeHit};

/// A bounded shape with an inside, where normals point out of it.
///
/// Knowing all of a line that is inside is what [`Csg`](crate::Csg) needs. A line that only touches the
/// surface is not inside there; one that slides along a flat face is.
pub trait Solid: Shape {
    /// Replaces what is in `list` by the parts of the line inside the solid, all of the line, behind
    /// the ray's origin too.
    fn intervals(&self, line: &Line, list: &mut IntervalList);
}

impl<S: Shape + ?Sized> Shape for Box<S> {
    fn bounds(&self) -> Aabb {
        (**self).bounds()
    }

    fn hits(&self, ray: &Ray, report: &mut dyn FnMut(ShapeHit) -> ControlFlow<()>) {
        (**self).hits(ray, report);
    }

    fn nearest(&self, ray: &Ray) -> Option<ShapeHit> {
        (**self).nearest(ray)
    }
}

impl<S: Shape + ?Sized> Shape for Arc<S> {
    fn bounds(&self) -> Aabb {
        (**self).bounds()
    }

    fn hits(&self, ray: &Ray, report: &mut dyn FnMut(ShapeHit) -> ControlFlow<()>) {
        (**self).hits(ray, report);
    }

    fn nearest(&self, ray: &Ray) -> Option<ShapeHit> {
        (**self).nearest(ray)
    }
}

impl<S: Solid + ?Sized> Solid for Box<S> {
    fn intervals(&self, line: &Line, list: &mut IntervalList) {
        (**self).intervals(line, list);
    }
}

impl<S: Solid + ?Sized> Solid for Arc<S> {
    fn intervals(&self, line: &Line, list: &mut IntervalList) {
        (**self).intervals(line, list);
    }
}
