//! Rays against triangles, boxes and solids in `f64`, each saying when it is not sure.

use glam::DVec3;

use crate::model::Unclear;

/// A box and what is in it.
#[derive(Clone, Copy, Debug)]
pub struct Solid {
    pub low: DVec3,
    pub high: DVec3,
    pub form: Form,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// A ball about the centre, of 0.9 of the least half extent.
    Ball,
    /// A block about the centre, of 0.75 of the extents.
    Block,
    /// Nothing at all.
    Void,
}

impl Solid {
    pub fn centre(&self) -> DVec3 {
        (self.low + self.high) / 2.0
    }

    pub fn radius(&self) -> f64 {
        0.9 * ((self.high - self.low) / 2.0).min_element()
    }

    /// The corners of the block.
    pub fn block(&self) -> [DVec3; 2] {
        let half = 0.75 * (self.high - self.low) / 2.0;
        [self.centre() - half, self.centre() + half]
    }

    /// Where a ray enters and leaves.
    pub fn meet(&self, origin: DVec3, direction: DVec3) -> Result<Option<(f64, f64)>, Unclear> {
        match self.form {
            Form::Ball => {
                let radius = self.radius();
                let way = direction.length();
                let unit = direction / way;
                let middle = (self.centre() - origin).dot(unit);
                let distance = (origin + middle * unit - self.centre()).length();
                if (distance / radius - 1.0).abs() < 0.01 {
                    return Err(Unclear);
                }
                let half = (radius * radius - distance * distance).max(0.0).sqrt();
                Ok((distance < radius).then(|| ((middle - half) / way, (middle + half) / way)))
            }
            Form::Block => {
                let [low, high] = self.block();
                meet_box(origin, direction, low, high)
            }
            Form::Void => Ok(None),
        }
    }
}

fn slabs(origin: DVec3, direction: DVec3, low: DVec3, high: DVec3) -> Option<(f64, f64)> {
    let (mut entry, mut exit) = (f64::NEG_INFINITY, f64::INFINITY);
    for axis in 0..3 {
        if direction[axis] == 0.0 {
            if origin[axis] < low[axis] || origin[axis] > high[axis] {
                return None;
            }
            continue;
        }
        let a = (low[axis] - origin[axis]) / direction[axis];
        let b = (high[axis] - origin[axis]) / direction[axis];
        (entry, exit) = (entry.max(a.min(b)), exit.min(a.max(b)));
    }
    (entry <= exit).then_some((entry, exit))
}

/// Where a line enters and leaves a box.
pub fn meet_box(
    origin: DVec3,
    direction: DVec3,
    low: DVec3,
    high: DVec3,
) -> Result<Option<(f64, f64)>, Unclear> {
    let rim = DVec3::splat(0.005 * (high - low).max_element());
    let larger = slabs(origin, direction, low - rim, high + rim);
    let smaller = slabs(origin, direction, low + rim, high - rim);
    if larger.is_some() != smaller.is_some() {
        return Err(Unclear);
    }
    Ok(slabs(origin, direction, low, high))
}

#[derive(Clone, Copy, Debug)]
pub struct TriangleHit {
    pub t: f64,
    pub u: f64,
    pub v: f64,
    /// Whether the corners wind counter-clockwise, seen from where the ray comes.
    pub is_counter_clockwise: bool,
}

/// Where a line meets a triangle (Tomas Möller and Ben Trumbore, "Fast, Minimum Storage Ray/Triangle
/// Intersection", 1997).
pub fn meet_triangle(
    origin: DVec3,
    direction: DVec3,
    [a, b, c]: &[DVec3; 3],
) -> Result<Option<TriangleHit>, Unclear> {
    let (ab, ac) = (*b - *a, *c - *a);
    let normal = ab.cross(ac);
    if normal == DVec3::ZERO || !normal.is_finite() {
        return Ok(None);
    }
    let slope = direction.dot(normal) / (direction.length() * normal.length());
    let towards = *a - origin;
    let determinant = direction.dot(normal);
    let side = direction.cross(towards);
    let u = -side.dot(ac) / determinant;
    let v = side.dot(ab) / determinant;
    let margin = u.min(v).min(1.0 - u - v);
    if slope.abs() < 0.01 {
        // Seen from the edge: clear only if it is far away.
        let centre = (*a + *b + *c) / 3.0;
        let reach = [a, b, c].map(|corner| corner.distance(centre)).into_iter().fold(0.0, f64::max);
        let line = direction.normalize();
        let offset = (centre - origin).cross(line).length();
        return if offset > 1.5 * reach { Ok(None) } else { Err(Unclear) };
    }
    if margin.abs() < 2e-3 {
        return Err(Unclear);
    }
    let t = towards.dot(normal) / determinant;
    let is_counter_clockwise = determinant < 0.0;
    Ok((margin > 0.0).then_some(TriangleHit { t, u, v, is_counter_clockwise }))
}
