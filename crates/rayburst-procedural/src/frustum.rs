//! What cylinder and cone share: the solid between two disks across one axis.

use glam::{DVec3, Vec2, Vec3};
use rayburst_math::{Aabb, Frame};

use crate::Line;
use crate::crossed::{End, Ends};
use crate::line::{enclosing_box, turn};

const SIDE: u8 = 0;
const FROM: u8 = 1;
const TO: u8 = 2;

/// The solid between two disks across one axis.
///
/// The side is a quadratic along the line, solved from the point nearest to the solid's centre. Its
/// discriminant is a difference of two squares (by Lagrange's identity), which loses less to
/// cancellation than `b² − ac`; the roots come from the sum that does not cancel (Press, Teukolsky,
/// Vetterling, Flannery: "Numerical Recipes", 3rd edition 2007, section 5.6).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Frustum {
    centre: DVec3,
    /// Unit vector from one end to the other.
    axis: DVec3,
    /// Half the distance between the ends.
    half: f64,
    /// Radii of the two ends.
    ends: (f64, f64),
    /// Radius half way.
    radius: f64,
    /// How much the radius grows along the axis.
    slope: f64,
}

/// The line seen from the frustum.
pub(crate) struct Local {
    frustum: Frustum,
    /// Along the axis, of the nearest point and of the direction.
    along: (f64, f64),
    /// Across the axis, likewise.
    across: (DVec3, DVec3),
}

/// The box around two disks across one axis.
pub(crate) fn bounds_of_disks(axis: DVec3, disks: [(Vec3, f32); 2]) -> Aabb {
    disks
        .map(|(centre, radius)| {
            let squares = axis * axis;
            let across = DVec3::new(
                (squares.y + squares.z).sqrt(),
                (squares.z + squares.x).sqrt(),
                (squares.x + squares.y).sqrt(),
            );
            let reach = f64::from(radius) * across;
            enclosing_box(centre.as_dvec3() - reach, centre.as_dvec3() + reach)
        })
        .into_iter()
        .fold(Aabb::EMPTY, Aabb::union)
}

impl Frustum {
    /// From the centres and radii of the two disks: none unless all is finite, the ends are apart,
    /// no radius is negative and one is positive.
    #[inline]
    pub(crate) fn new(from: Vec3, to: Vec3, from_radius: f32, to_radius: f32) -> Option<Self> {
        let (from_radius, to_radius) = (f64::from(from_radius), f64::from(to_radius));
        let (from, to) = (from.as_dvec3(), to.as_dvec3());
        let length = (to - from).length();
        let good = length > 0.0
            && length.is_finite()
            && from_radius >= 0.0
            && to_radius >= 0.0
            && from_radius + to_radius > 0.0
            && (from_radius + to_radius).is_finite();
        good.then(|| Self {
            centre: 0.5 * (from + to),
            axis: (to - from) / length,
            half: 0.5 * length,
            ends: (from_radius, to_radius),
            radius: 0.5 * (from_radius + to_radius),
            slope: (to_radius - from_radius) / length,
        })
    }

    /// The unit vector from one end to the other.
    pub(crate) fn axis(&self) -> DVec3 {
        self.axis
    }

    /// All crossings of the line, if any.
    #[inline]
    pub(crate) fn cross(self, line: &Line) -> Option<(Local, Ends)> {
        let (distance, nearest) = line.approach(self.centre);
        let widest = self.ends.0.max(self.ends.1);
        if nearest.length_squared() > (self.half * self.half + widest * widest) * (1.0 + 1e-9) {
            return None;
        }
        let along = (nearest.dot(self.axis), line.direction.dot(self.axis));
        let across = (nearest - along.0 * self.axis, line.direction - along.1 * self.axis);
        let local = Local { frustum: self, along, across };

        let (first, last) = local.between_planes()?;
        let (enter, leave) = local.in_side()?;
        let entry = if first.0 >= enter { first } else { (enter, SIDE) };
        let exit = if last.0 <= leave { last } else { (leave, SIDE) };
        let end = |(at, face)| End { distance: distance + at, local: at, face };
        let mut ends = Ends::NONE;
        ends.push_pair(end(entry), end(exit));
        Some((local, ends))
    }
}

impl Local {
    /// Where the line is between the planes of the two disks, and which of them are its ends.
    #[inline]
    fn between_planes(&self) -> Option<((f64, u8), (f64, u8))> {
        let half = self.frustum.half;
        let (p, d) = self.along;
        if d == 0.0 {
            return (p.abs() <= half).then_some(((f64::NEG_INFINITY, FROM), (f64::INFINITY, TO)));
        }
        let (from, to) = (((-half - p) / d, FROM), ((half - p) / d, TO));
        Some(if d > 0.0 { (from, to) } else { (to, from) })
    }

    /// Where the line is inside the side, as if that had no ends.
    #[inline]
    fn in_side(&self) -> Option<(f64, f64)> {
        const ALL: (f64, f64) = (f64::NEG_INFINITY, f64::INFINITY);
        let (p, d) = self.across;
        // Radius and its growth along the line, from the nearest point on.
        let radius = self.frustum.radius + self.frustum.slope * self.along.0;
        let growth = self.frustum.slope * self.along.1;
        let a = (d.length() - growth.abs()) * (d.length() + growth.abs());
        let b = p.dot(d) - radius * growth;
        let c = (p.length() - radius.abs()) * (p.length() + radius.abs());
        let (plus, minus) = ((radius * d - growth * p).length(), p.cross(d).length());
        let discriminant = (plus - minus) * (plus + minus);
        if discriminant.is_nan() || discriminant <= 0.0 {
            return if a > 0.0 {
                None
            } else if a < 0.0 {
                // Through the tip.
                Some(if growth > 0.0 { (-b / a, ALL.1) } else { (ALL.0, -b / a) })
            } else {
                // Along the side.
                (c < 0.0).then_some(ALL)
            };
        }
        let q = -(b + discriminant.sqrt().copysign(b));
        let (one, other) = (c / q, q / a);
        Some(if a > 0.0 {
            (one.min(other), one.max(other))
        } else if a < 0.0 {
            // The line is inside both ends of the double cone; this is the end with a radius.
            if growth > 0.0 { (one.max(other), ALL.1) } else { (ALL.0, one.min(other)) }
        } else if growth > 0.0 {
            (one, ALL.1)
        } else {
            (ALL.0, one)
        })
    }

    /// The outward unit normal and the coordinates of a crossing.
    #[inline]
    pub(crate) fn surface(&self, end: &End) -> (DVec3, Vec2) {
        let Frustum { axis, half, ends, slope, .. } = self.frustum;
        let across = self.across.0 + end.local * self.across.1;
        let from_axis = across.length();
        let frame = Frame::from_normal(axis.as_vec3());
        let u = turn(across.dot(frame.bitangent.as_dvec3()), across.dot(frame.tangent.as_dvec3()));
        let part = |x: f64| (x as f32).clamp(0.0, 1.0);
        match end.face {
            FROM => (-axis, Vec2::new(u, part(from_axis / ends.0.max(f64::MIN_POSITIVE)))),
            TO => (axis, Vec2::new(u, part(from_axis / ends.1.max(f64::MIN_POSITIVE)))),
            _ => {
                let along = self.along.0 + end.local * self.along.1;
                let normal = if from_axis > 0.0 {
                    (across / from_axis - slope * axis).normalize()
                } else {
                    // The tip.
                    axis * -slope.signum()
                };
                (normal, Vec2::new(u, part(0.5 + 0.5 * along / half)))
            }
        }
    }
}
