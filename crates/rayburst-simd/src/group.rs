//! Sixteen rays that go the same way, side by side: what bundles of coherent rays are made of.
//!
//! The rays of a group agree in the signs of their directions and in the longest component
//! ([`GroupAxes`]), so that all of them meet the same planes first and permute their axes alike. The
//! tests are those of [`crate::SlabRay`] and [`crate::ShearRay`], one box or triangle against sixteen
//! rays; the triangle test gives the bits of the others.

use crate::{
    Boxes8, Triangles4,
    triangles::{AXES, LARGE, ROW_BYTES as TRIANGLE_ROW, SMALL, cross, margin},
};

/// Rays in a group.
pub const GROUP: usize = 16;

/// A number for each ray of a group.
pub type Row16 = [f32; GROUP];

/// Sixteen prepared rays and what they have found.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub struct Group16 {
    /// One over the direction.
    pub inverse: [Row16; 3],
    /// What is subtracted from the distance to planes that are met first.
    pub near_offset: [Row16; 3],
    /// What is subtracted from the distance to the other planes.
    pub far_offset: [Row16; 3],
    /// The origin along the axes that become x, y and z.
    pub origin: [Row16; 3],
    /// Shears of x and y, scale of z.
    pub shear: [Row16; 3],
    /// Where the interval starts, not negative.
    pub t_min: Row16,
    /// Where it ends: at the nearest hit so far. −1 for rays that are not traced.
    pub t_max: Row16,
    /// Distance of the waist from the origin.
    pub shift: Row16,
    /// Barycentric coordinate of the second corner.
    pub u: Row16,
    /// Barycentric coordinate of the third corner.
    pub v: Row16,
    /// Which triangle was hit; [`Group16::NO_ID`] if none.
    pub id: [u32; GROUP],
    /// Rays whose triangle winds counter-clockwise, as bits.
    pub front: u32,
}

impl Group16 {
    /// Greater than the ids of triangles.
    pub const NO_ID: u32 = i32::MAX as u32;

    /// A group of no rays.
    pub const NONE: Self = Self {
        inverse: [[1.0; GROUP]; 3],
        near_offset: [[0.0; GROUP]; 3],
        far_offset: [[0.0; GROUP]; 3],
        origin: [[0.0; GROUP]; 3],
        shear: [[0.0; GROUP]; 3],
        t_min: [0.0; GROUP],
        t_max: [-1.0; GROUP],
        shift: [0.0; GROUP],
        u: [0.0; GROUP],
        v: [0.0; GROUP],
        id: [Self::NO_ID; GROUP],
        front: 0,
    };
}

/// What the rays of a group have in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GroupAxes {
    /// Where the rows of the planes met first start in [`Boxes8`], in bytes.
    near_row: [u32; 3],
    /// Where the rows of the permuted axes start in a corner of [`Triangles4`], in bytes.
    rows: [u32; 3],
}

impl GroupAxes {
    /// For directions with these signs whose component of this axis is the longest.
    pub fn new(negative: [bool; 3], longest: usize) -> Self {
        let longest = longest % 3;
        let axes = AXES[longest + 3 * usize::from(negative[longest])];
        let near = |axis: usize| (2 * axis as u32 + u32::from(negative[axis])) * 32;
        Self {
            near_row: [near(0), near(1), near(2)],
            rows: axes.map(|axis| TRIANGLE_ROW * u32::from(axis)),
        }
    }

    /// The axes that become x, y and z.
    #[inline(always)]
    pub fn axes(&self) -> [usize; 3] {
        self.rows.map(|row| (row / TRIANGLE_ROW) as usize)
    }

    /// The rows of [`Boxes8::planes`] that are met first; the others are these with the lowest bit
    /// flipped.
    #[inline(always)]
    pub fn near_plane(&self) -> [usize; 3] {
        self.near_row.map(|row| (row / 32) as usize)
    }

    #[inline(always)]
    #[cfg_attr(not(target_arch = "x86_64"), allow(dead_code))]
    pub(crate) fn near_row(&self) -> [usize; 3] {
        self.near_row.map(|row| row as usize)
    }

    #[inline(always)]
    #[cfg_attr(not(target_arch = "x86_64"), allow(dead_code))]
    pub(crate) fn rows(&self) -> [usize; 3] {
        self.rows.map(|row| row as usize)
    }
}

/// Sixteen rays side by side as they are given.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub struct Rays16 {
    /// The origin.
    pub origin: [Row16; 3],
    /// Where the interval starts.
    pub t_min: Row16,
    /// The direction.
    pub direction: [Row16; 3],
    /// Where the interval ends.
    pub t_max: Row16,
}

impl Rays16 {
    /// Zeros.
    pub const ZERO: Self = Self {
        origin: [[0.0; GROUP]; 3],
        t_min: [0.0; GROUP],
        direction: [[0.0; GROUP]; 3],
        t_max: [0.0; GROUP],
    };
}

/// What [`crate::Isa::prepare16`] needs besides the rays.
#[derive(Clone, Copy, Debug)]
pub struct Preparation16 {
    /// Lanes that hold rays of the bundle, as bits.
    pub lanes: u32,
    /// Origin and direction that the other lanes get.
    pub spare: [[f32; 3]; 2],
    /// What directions are multiplied by, a power of two.
    pub scale: f32,
    /// One over the scale.
    pub unscale: f32,
    /// The signs of the direction, as ones.
    pub sign: [f32; 3],
    /// By how much planes are moved.
    pub error: [f32; 3],
    /// The least magnitude of the scaled direction's components.
    pub smallest: f32,
    /// The coordinate on the longest axis at which the rays are nearest to each other.
    pub waist: f32,
}

/// Between which numbers the rays of a bundle are, lane by lane.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub struct Extent16 {
    /// The least and the greatest inverse direction.
    pub inverse: [[Row16; 2]; 3],
    /// The least and the greatest coordinate at the waist, along the axes that become x and y.
    pub points: [[Row16; 2]; 2],
    /// The greatest distance of the waist from an origin, either way.
    pub shift: Row16,
    /// The earliest start of an interval, from the waist on.
    pub t_min: Row16,
}

impl Extent16 {
    /// Of no rays.
    pub const NONE: Self = Self {
        inverse: [[[f32::INFINITY; GROUP], [f32::NEG_INFINITY; GROUP]]; 3],
        points: [[[f32::INFINITY; GROUP], [f32::NEG_INFINITY; GROUP]]; 2],
        shift: [0.0; GROUP],
        t_min: [f32::INFINITY; GROUP],
    };
}

/// An interval of rays: every ray of it has, along each axis, one of its inverse directions and
/// offsets within these bounds.
///
/// The distance to plane `p` of an axis is no less than the lesser of
/// `p · scale[i] − near_offset[i]`, and no greater than the greater of `p · scale[i] − far_offset[i]`,
/// for `i` zero and one (interval arithmetic; Boulos, Wald, Shirley, "Geometric and arithmetic culling
/// methods for entire ray packets", 2006).
#[derive(Clone, Copy, Debug, Default)]
pub struct Frustum {
    /// The least and the greatest inverse direction.
    pub scale: [[f32; 2]; 3],
    /// The greatest offset of a near plane at each scale.
    pub near_offset: [[f32; 2]; 3],
    /// The least offset of a far plane at each scale.
    pub far_offset: [[f32; 2]; 3],
}

#[inline(always)]
fn least(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[inline(always)]
fn greatest(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// [`crate::Isa::prepare16`] in plain Rust.
#[inline(always)]
pub(crate) fn prepare16(
    rays: &Rays16,
    how: &Preparation16,
    axes: &GroupAxes,
    group: &mut Group16,
    extent: &mut Extent16,
) {
    let [kx, ky, kz] = axes.axes();
    for ray in 0..GROUP {
        let member = how.lanes >> ray & 1 != 0;
        let [mut origin, mut direction] = how.spare;
        if member {
            origin = rays.origin.map(|row| row[ray]);
            direction = rays.direction.map(|row| row[ray]);
        }
        let direction = direction.map(|d| d * how.scale);
        for axis in 0..3 {
            let size = greatest(direction[axis].abs(), how.smallest) * how.sign[axis];
            let inverse = 1.0 / size;
            let centre = origin[axis] * inverse;
            let margin = how.error[axis] * inverse.abs() + f32::MIN_POSITIVE;
            group.inverse[axis][ray] = inverse;
            group.near_offset[axis][ray] = centre + margin;
            group.far_offset[axis][ray] = centre - margin;
            let [low, high] = &mut extent.inverse[axis];
            low[ray] = least(low[ray], inverse);
            high[ray] = greatest(high[ray], inverse);
        }
        for (row, axis) in group.origin.iter_mut().zip([kx, ky, kz]) {
            row[ray] = origin[axis];
        }
        group.shear[0][ray] = direction[kx] / direction[kz];
        group.shear[1][ray] = direction[ky] / direction[kz];
        group.shear[2][ray] = 1.0 / direction[kz];
        // Adding zero makes −0 a 0.
        let internal = |t: f32| least(least(t, f32::MAX) * how.unscale, f32::MAX) + 0.0;
        let (start, end) = (internal(rays.t_min[ray]), internal(rays.t_max[ray]));
        group.t_min[ray] = start;
        group.t_max[ray] = if member { end } else { -1.0 };
        let way = how.waist - group.origin[2][ray];
        let shift = way * group.shear[2][ray];
        group.shift[ray] = shift;
        extent.shift[ray] = greatest(extent.shift[ray], shift.abs());
        for (k, [low, high]) in extent.points.iter_mut().enumerate() {
            let point = group.origin[k][ray] + way * group.shear[k][ray];
            (low[ray], high[ray]) = (least(low[ray], point), greatest(high[ray], point));
        }
        let start = if member { start - shift } else { f32::INFINITY };
        extent.t_min[ray] = least(extent.t_min[ray], start);
    }
}

/// [`crate::Isa::end16`] in plain Rust.
#[inline(always)]
pub(crate) fn end16(group: &Group16, active: u32) -> f32 {
    (0..GROUP)
        .filter(|ray| active >> ray & 1 != 0)
        .fold(f32::NEG_INFINITY, |end, ray| greatest(end, group.t_max[ray] - group.shift[ray]))
}

/// [`crate::Isa::ends16`] in plain Rust.
#[inline(always)]
pub(crate) fn ends16([low, high]: &[Row16; 2]) -> [f32; 2] {
    [
        low.iter().copied().fold(f32::INFINITY, least),
        high.iter().copied().fold(f32::NEG_INFINITY, greatest),
    ]
}

/// [`crate::Isa::frustum8`] in plain Rust.
#[inline(always)]
pub(crate) fn frustum8(
    boxes: &Boxes8,
    axes: &GroupAxes,
    frustum: &Frustum,
    t_min: f32,
    t_max: f32,
    distances: &mut [f32; 8],
) -> u32 {
    let (mut near, mut far) = ([t_min; 8], [t_max; 8]);
    for axis in 0..3 {
        let row = axes.near_plane()[axis];
        let (near_planes, far_planes) = (&boxes.planes[row], &boxes.planes[row ^ 1]);
        let [a, b] = frustum.scale[axis];
        let [near_a, near_b] = frustum.near_offset[axis];
        let [far_a, far_b] = frustum.far_offset[axis];
        for slot in 0..8 {
            let (p, q) = (near_planes[slot], far_planes[slot]);
            near[slot] = near[slot].max((p * a - near_a).min(p * b - near_b));
            far[slot] = far[slot].min((q * a - far_a).max(q * b - far_b));
        }
    }
    *distances = near;
    (0..8).fold(0, |mask, slot| mask | (u32::from(near[slot] <= far[slot]) << slot))
}

/// [`crate::Isa::box16`] in plain Rust.
#[inline(always)]
pub(crate) fn box16(boxes: &Boxes8, slot: usize, axes: &GroupAxes, group: &Group16) -> u32 {
    let (mut near, mut far) = (group.t_min, group.t_max);
    for axis in 0..3 {
        let row = axes.near_plane()[axis];
        let (p, q) = (boxes.planes[row][slot % 8], boxes.planes[row ^ 1][slot % 8]);
        for ray in 0..GROUP {
            let inverse = group.inverse[axis][ray];
            near[ray] = near[ray].max(p * inverse - group.near_offset[axis][ray]);
            far[ray] = far[ray].min(q * inverse - group.far_offset[axis][ray]);
        }
    }
    (0..GROUP).fold(0, |mask, ray| mask | (u32::from(near[ray] <= far[ray]) << ray))
}

/// [`crate::Isa::triangle16`] in plain Rust.
#[inline(always)]
pub(crate) fn triangle16<const NEAREST: bool>(
    block: &Triangles4,
    lane: usize,
    axes: &GroupAxes,
    group: &mut Group16,
    question: &Question16,
) -> (u32, u32) {
    let (mut met, mut doubtful) = (0, 0);
    for ray in (0..GROUP).filter(|ray| question.active >> ray & 1 != 0) {
        let bit = 1 << ray;
        let corner = |corner: usize| {
            let relative =
                |k: usize| block.vertices[corner][axes.axes()[k]][lane % 4] - group.origin[k][ray];
            let z = relative(2);
            (
                relative(0) - group.shear[0][ray] * z,
                relative(1) - group.shear[1][ray] * z,
                group.shear[2][ray] * z,
            )
        };
        let ((ax, ay, az), (bx, by, bz), (cx, cy, cz)) = (corner(0), corner(1), corner(2));
        let u = cross(cx, by, cy, bx);
        let v = cross(ax, cy, ay, cx);
        let w = cross(bx, ay, by, ax);
        let margin = margin(u, v, w);
        if margin < -SMALL {
            continue;
        }
        let det = u + v + w;
        let delicate = (margin <= SMALL) | (det.abs() > LARGE);
        let t = (u * az + v * bz + w * cz) / det;
        let within = t >= group.t_min[ray] && t <= group.t_max[ray];
        let kept = question.keep[usize::from(det <= 0.0)] != 0;
        // Of two at the same distance the lesser id wins.
        let wins = t < group.t_max[ray] || !NEAREST || question.id < group.id[ray];
        if delicate || (within && t.abs() < question.smallest) {
            doubtful |= bit;
        } else if within && kept && wins {
            met |= bit;
            if NEAREST {
                // Makes −0 a 0.
                group.t_max[ray] = t + 0.0;
                (group.u[ray], group.v[ray]) = (v / det, w / det);
                group.id[ray] = question.id;
                group.front = (group.front & !bit) | if det > 0.0 { bit } else { 0 };
            }
        }
    }
    (met, doubtful)
}

/// What [`crate::Isa::triangle16`] is asked.
#[derive(Clone, Copy, Debug)]
pub struct Question16 {
    /// Rays that are asked about, as bits.
    pub active: u32,
    /// Whether triangles may be met that wind counter-clockwise seen from the origin, and clockwise:
    /// all bits or none.
    pub keep: [u32; 2],
    /// The least distance that is beyond doubt.
    pub smallest: f32,
    /// What becomes the id of rays that meet the triangle, less than [`Group16::NO_ID`].
    pub id: u32,
}
