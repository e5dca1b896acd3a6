//! What simple solids share: from crossings along a line to hits and intervals. Normals and
//! coordinates are computed only of crossings that are asked for.

use std::ops::ControlFlow;

use glam::{DVec3, Vec2};
use rayburst_math::Ray;

use crate::{Crossing, IntervalList, Line, ShapeHit};

/// Where a line crosses a surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct End {
    /// Distance from the ray's origin.
    pub(crate) distance: f64,
    /// Distance from the point that the solid's equation was solved from.
    pub(crate) local: f64,
    /// Which of the solid's faces, in its own numbering.
    pub(crate) face: u8,
}

/// At most four crossings, in and out by turns.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ends {
    ends: [End; 4],
    len: usize,
}

impl Ends {
    pub(crate) const NONE: Self =
        Self { ends: [End { distance: 0.0, local: 0.0, face: 0 }; 4], len: 0 };

    /// Appends a way in and a way out, unless nothing lies between them. A third pair is no pair of
    /// a solid here.
    #[inline]
    pub(crate) fn push_pair(&mut self, entry: End, exit: End) {
        if entry.distance < exit.distance && self.len < 4 {
            self.ends[self.len] = entry;
            self.ends[self.len + 1] = exit;
            self.len += 2;
        }
    }

    #[inline]
    fn as_slice(&self) -> &[End] {
        &self.ends[..self.len]
    }
}

/// A solid that a line goes through at most twice.
pub(crate) trait Crossed {
    /// What is known of a line in the solid's own space.
    type Local;

    /// All crossings of the line, if any.
    fn cross(&self, line: &Line) -> Option<(Self::Local, Ends)>;

    /// The outward unit normal and the coordinates of a crossing.
    fn surface(&self, local: &Self::Local, end: &End) -> (DVec3, Vec2);
}

/// `t` as reported, if it is in the ray's interval.
pub(crate) enum InInterval {
    /// Before the interval.
    Before,
    /// In it.
    At(f32),
    /// Beyond it.
    Beyond,
}

impl InInterval {
    #[inline]
    pub(crate) fn of(t: f64, ray: &Ray) -> Self {
        let t = t as f32;
        if t < ray.t_min || t == f32::NEG_INFINITY {
            Self::Before
        } else if t <= ray.t_max && t < f32::INFINITY {
            Self::At(t)
        } else {
            Self::Beyond
        }
    }
}

/// [`Shape::hits`](crate::Shape::hits) of a simple solid.
#[inline]
pub(crate) fn hits<S: Crossed>(
    solid: &S,
    ray: &Ray,
    report: &mut dyn FnMut(ShapeHit) -> ControlFlow<()>,
) {
    let Some(line) = Line::of(ray) else { return };
    let Some((local, ends)) = solid.cross(&line) else { return };
    for end in ends.as_slice() {
        let t = match InInterval::of(line.t(end.distance), ray) {
            InInterval::Before => continue,
            InInterval::At(t) => t,
            InInterval::Beyond => return,
        };
        let (normal, uv) = solid.surface(&local, end);
        if report(ShapeHit { t, normal: normal.as_vec3(), uv }).is_break() {
            return;
        }
    }
}

/// [`Solid::intervals`](crate::Solid::intervals) of a simple solid.
#[inline]
pub(crate) fn intervals<S: Crossed>(solid: &S, line: &Line, list: &mut IntervalList) {
    list.clear();
    let Some((local, ends)) = solid.cross(line) else { return };
    let crossing = |end: &End| {
        let (normal, uv) = solid.surface(&local, end);
        Crossing { t: line.t(end.distance), normal: normal.as_vec3(), uv }
    };
    for pair in ends.as_slice().chunks_exact(2) {
        list.push(crossing(&pair[0]), crossing(&pair[1]));
    }
}
