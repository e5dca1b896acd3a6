//! Signs that several diagrams share.

use rayburst::glam::Vec2;

use super::canvas::{Canvas, Pen, ink};

/// A point light.
pub(super) fn lamp(canvas: &mut Canvas, at: Vec2) {
    for i in 0..12 {
        let d = Vec2::from_angle(i as f32 * std::f32::consts::TAU / 12.0);
        canvas.line(at + 8.0 * d, at + 12.0 * d, Pen::new(ink::YELLOW, 2.0));
    }
    canvas.circle(at, 6.0, ink::YELLOW, Some(Pen::new(ink::ORANGE, 1.0)));
}

/// An eye that looks to the right.
pub(super) fn eye(canvas: &mut Canvas, at: Vec2) {
    let left = at - Vec2::new(16.0, 0.0);
    canvas.line(left, at + Vec2::new(3.0, -9.0), Pen::new(ink::BLACK, 1.6));
    canvas.line(left, at + Vec2::new(3.0, 9.0), Pen::new(ink::BLACK, 1.6));
    canvas.arc(left, 20.0, -0.45, 0.45, Pen::new(ink::BLACK, 1.6));
    canvas.circle(at, 3.4, ink::BLACK, None);
}

/// What ends a shadow ray.
pub(super) fn cross(canvas: &mut Canvas, at: Vec2) {
    for d in [Vec2::new(5.0, 5.0), Vec2::new(5.0, -5.0)] {
        canvas.line(at - d, at + d, Pen::new(ink::ORANGE, 2.2));
    }
}
