//! The rays of a bundle, prepared: groups, the interval around them, and what they have found.

use rayburst_math::{Aabb, Ray};
use rayburst_simd::{Extent16, Frustum, GROUP, Group16, GroupAxes, Isa, Preparation16, Rays16};

use super::{
    super::{
        prepare,
        query::{Candidate, OneHit, Place},
    },
    GROUPS,
};

/// A bundle on its way.
pub(super) struct Bundle {
    pub(super) axes: GroupAxes,
    pub(super) frustum: Frustum,
    pub(super) groups: [Group16; GROUPS],
    /// Rays of each group that are still looking.
    pub(super) active: [u32; GROUPS],
    /// Rays of each group that are left to other ways of tracing.
    pub(super) left: [u32; GROUPS],
    /// Where the first ray starts, from the waist on.
    pub(super) t_min: f32,
    /// Where the last ray of each group ends, and of all, from the waist on.
    ends: [f32; GROUPS],
    pub(super) t_max: f32,
    /// What distances from the waist on may be wrong by.
    slack: f32,
    /// Lesser distances are in doubt.
    pub(super) smallest: f32,
    /// From internal distances to those in units of the direction.
    scale: f32,
}

impl Bundle {
    /// The bundle of the rays of `members`, of which two are given; all have the same key.
    #[inline(always)]
    pub(super) fn new<I: Isa>(
        isa: I,
        rays: &[Rays16; GROUPS],
        members: [u32; GROUPS],
        [chief, other]: [&Ray; 2],
        key: u32,
        bounds: &Aabb,
    ) -> Self {
        let negative = [key & 1 != 0, key & 2 != 0, key & 4 != 0];
        let longest = (key >> 3 & 3) as usize % 3;
        let axes = GroupAxes::new(negative, longest);
        let exponent = key >> 5;
        let scale = f32::from_bits((254 - exponent) << 23);
        let unscale = f32::from_bits(exponent << 23);
        let origins = origins(isa, rays, members, chief);
        let (mut reach, mut error) = ([0.0f32; 3], [0.0; 3]);
        for axis in 0..3 {
            let [low, high] = origins[axis];
            reach[axis] = (high - bounds.lower[axis]).abs().max((bounds.upper[axis] - low).abs());
        }
        for axis in 0..3 {
            let [low, high] = origins[axis];
            error[axis] =
                prepare::box_error(reach[axis], reach[longest], low.abs().max(high.abs()));
        }
        let mut how = Preparation16 {
            lanes: 0,
            spare: [chief.origin.into(), chief.direction.into()],
            scale,
            unscale,
            sign: negative.map(|negative| if negative { -1.0 } else { 1.0 }),
            error,
            smallest: prepare::SMALLEST_COMPONENT,
            waist: waist(axes.axes(), [chief, other], bounds),
        };
        // In place: groups are large.
        let mut bundle = Self {
            axes,
            frustum: Frustum::default(),
            groups: [Group16::NONE; GROUPS],
            active: members,
            left: [0; GROUPS],
            t_min: 0.0,
            ends: [f32::NEG_INFINITY; GROUPS],
            t_max: f32::NEG_INFINITY,
            slack: 0.0,
            smallest: f32::MIN_POSITIVE * unscale.max(1.0),
            scale,
        };
        let mut extent = Extent16::NONE;
        for (g, group) in bundle.groups.iter_mut().enumerate() {
            how.lanes = members[g];
            if how.lanes != 0 {
                isa.prepare16(&rays[g], &how, &axes, group, &mut extent);
            }
        }
        let [start, shift] = isa.ends16(&[extent.t_min, extent.shift]);
        let mut points = [[how.waist; 2]; 3];
        for (k, axis) in axes.axes().into_iter().enumerate().take(2) {
            points[axis % 3] = isa.ends16(&extent.points[k]);
        }
        let frustum = &mut bundle.frustum;
        for axis in 0..3 {
            let [low, high] = points[axis];
            // Twice, for what is rounded here, and for the way to the waist, of at most twice the shift.
            let way = 2.0 * shift;
            let error = 2.0 * error[axis]
                + 2.0 * prepare::box_error(way, way, low.abs().max(high.abs()) + way);
            let ends = isa.ends16(&extent.inverse[axis]);
            frustum.scale[axis] = ends;
            frustum.near_offset[axis] = ends.map(|scale| {
                (low * scale).max(high * scale) + error * scale.abs() + 2.0 * f32::MIN_POSITIVE
            });
            frustum.far_offset[axis] = ends.map(|scale| {
                (low * scale).min(high * scale) - error * scale.abs() - 2.0 * f32::MIN_POSITIVE
            });
        }
        bundle.slack = 8.0 * f32::EPSILON * shift;
        bundle.t_min = start - bundle.slack - 4.0 * f32::EPSILON * start.abs();
        for g in 0..GROUPS {
            bundle.shorten(isa, g);
        }
        bundle
    }

    /// Finds where the last ray of a group ends, at first and after some have met triangles.
    #[inline(always)]
    pub(super) fn shorten<I: Isa>(&mut self, isa: I, g: usize) {
        let end = isa.end16(&self.groups[g], self.active[g]);
        self.ends[g] = end + self.slack + 4.0 * f32::EPSILON * end.abs().min(f32::MAX);
        let [a, b, c, d] = self.ends;
        self.t_max = a.max(b).max(c.max(d));
    }

    /// The query of a ray as it stands.
    #[inline(always)]
    pub(super) fn query<Q: OneHit>(
        &self,
        group: usize,
        lane: usize,
        ray: &Ray,
        place: &Place<'_>,
    ) -> Q {
        let g = &self.groups[group];
        let found = if Q::ORDERED {
            g.id[lane] != Group16::NO_ID
        } else {
            self.active[group] >> lane & 1 == 0
        };
        let candidate = found.then(|| Candidate {
            t: g.t_max[lane] * self.scale,
            u: g.u[lane],
            v: g.v[lane],
            triangle: g.id[lane],
            front: place.front(g.front) >> lane & 1 != 0,
        });
        Q::resume(ray, place, candidate.as_ref())
    }
}

/// Between which coordinates the origins are, by axis.
#[inline(always)]
fn origins<I: Isa>(
    isa: I,
    rays: &[Rays16; GROUPS],
    members: [u32; GROUPS],
    chief: &Ray,
) -> [[f32; 2]; 3] {
    let mut origins = [[0.0; 2]; 3];
    for (axis, ends) in origins.iter_mut().enumerate() {
        let spare = chief.origin.to_array()[axis];
        let mut both = [[spare; GROUP]; 2];
        let [low, high] = &mut both;
        for (rays, lanes) in rays.iter().zip(members) {
            for lane in 0..GROUP {
                let o = rays.origin[axis][lane];
                let o = if lanes >> lane & 1 != 0 { o } else { spare };
                low[lane] = if o < low[lane] { o } else { low[lane] };
                high[lane] = if o > high[lane] { o } else { high[lane] };
            }
        }
        *ends = isa.ends16(&both);
    }
    origins
}

/// The coordinate on the last of the axes at which two rays are nearest to each other: that of the
/// point which primary rays come from, or shadow rays go to. The interval of rays is tightest if it is
/// of their points there.
#[inline(always)]
fn waist([x, y, z]: [usize; 3], [a, b]: [&Ray; 2], bounds: &Aabb) -> f32 {
    let [x, y, z] = [x % 3, y % 3, z % 3];
    let slope = |ray: &Ray| {
        let d = ray.direction.to_array();
        [d[x] / d[z], d[y] / d[z]]
    };
    let (o, p) = (a.origin.to_array(), b.origin.to_array());
    let ([ax, ay], [bx, by]) = (slope(a), slope(b));
    // How the rays differ at the first one's origin, and how that changes.
    let back = o[z] - p[z];
    let gap = [p[x] - o[x] + back * bx, p[y] - o[y] + back * by];
    let turn = [bx - ax, by - ay];
    let way = -(gap[0] * turn[0] + gap[1] * turn[1]) / (turn[0] * turn[0] + turn[1] * turn[1]);
    let way = if way.is_finite() { way } else { 0.0 };
    // Not too far away: coordinates there should be as exact as those of the scene.
    let (low, high) = (bounds.lower.to_array()[z].min(o[z]), bounds.upper.to_array()[z].max(o[z]));
    (o[z] + way).max(2.0 * low - high).min(2.0 * high - low)
}
