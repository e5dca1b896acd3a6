//! Four triangles and the ray that meets them: the watertight triangle test.
//!
//! After Woop, Benthin, Wald: "Watertight Ray/Triangle Intersection", JCGT 2(1), 2013. The vertices
//! are moved to the ray's origin and sheared so that the ray runs along +z; three edge functions then
//! decide. Two triangles that share an edge compute the same sheared vertices, and edge functions are
//! right but for their last bits ([`cross`]), so they have the signs of their exact values, and only
//! zeros need care: they are decided in `f64`, where products of `f32` are exact.
//!
//! Changed: edge functions are that accurate not for their signs alone. They are the weights of the
//! distance, and rounded term by term those of a sliver would be wrong by as much as it is longer than
//! wide: the hit could lie outside of the triangle's box. `f64` also takes over where edge functions
//! come near the ends of `f32`'s range, and the distance is divided rather than multiplied by a
//! reciprocal. Whether signs are mixed is seen in the greater of the least edge function and minus the
//! greatest ([`margin`]).

use bytemuck::{Pod, Zeroable};

/// Four triangles, `vertices[corner][axis][lane]`. The lanes that are not used hold NaN.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C, align(32))]
pub struct Triangles4 {
    /// The corners.
    pub vertices: [[[f32; 4]; 3]; 3],
    /// What the triangles are, as their owner likes.
    pub ids: [u32; 4],
}

pub(crate) const ROW_BYTES: u32 = 16;

/// The permutations of the axes by the longest one, first of directions forwards along it, then
/// backwards: swapping x and y keeps the winding, and with it the sign of the determinant.
pub(crate) const AXES: [[u8; 3]; 6] =
    [[1, 2, 0], [2, 0, 1], [0, 1, 2], [2, 1, 0], [0, 2, 1], [1, 0, 2]];

/// Sixteen times those axes, at the longest one, plus four if backwards.
const ROWS: [[u32; 4]; 8] = {
    let mut rows = [[0; 4]; 8];
    let mut index = 0;
    while index < 6 {
        let mut k = 0;
        while k < 3 {
            rows[index % 3 + 4 * (index / 3)][k] = ROW_BYTES * AXES[index][k] as u32;
            k += 1;
        }
        index += 1;
    }
    rows
};

/// Three numbers and a zero.
#[inline(always)]
fn pad([x, y, z]: &[f32; 3]) -> [f32; 4] {
    [*x, *y, *z, 0.0]
}

/// A ray prepared for [`Triangles4`].
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct ShearRay {
    /// The fourth number does not matter, here and below.
    origin: [f32; 4],
    shear: [f32; 4],
    /// Sixteen times the axes.
    rows: [u32; 3],
}

impl ShearRay {
    /// From an origin and a direction whose longest component is neither huge nor tiny; `scale`
    /// multiplies the direction.
    #[inline(always)]
    pub fn new(origin: &[f32; 3], direction: &[f32; 3], scale: f32) -> Self {
        let (x, y, z) = (direction[0].abs(), direction[1].abs(), direction[2].abs());
        // Arithmetic instead of branches: no ray predicts the next one's axis.
        let longest = usize::from((y > x) & (y >= z)) | usize::from((z > x) & (z > y)) << 1;
        let [dx, dy, dz] = *direction;
        let signs = [dx.to_bits() >> 31, dy.to_bits() >> 31, dz.to_bits() >> 31, 0];
        let backwards = signs[longest & 3] as usize;
        let [i, j, k, _] = ROWS[(longest | backwards << 2) % 8];
        let (origin, direction) = (pad(origin), pad(direction));
        let pick = |v: &[f32; 4], row: u32| v[(row / ROW_BYTES) as usize & 3];
        let rows = [i, j, k];
        let (dx, dy, dz) =
            (pick(&direction, i) * scale, pick(&direction, j) * scale, pick(&direction, k) * scale);
        let (ox, oy, oz) = (pick(&origin, i), pick(&origin, j), pick(&origin, k));
        Self { origin: [ox, oy, oz, 0.0], shear: [dx / dz, dy / dz, 1.0 / dz, 0.0], rows }
    }

    /// The origin along the axes that become x, y and z.
    #[inline(always)]
    pub fn origin(&self) -> [f32; 3] {
        let [x, y, z, _] = self.origin;
        [x, y, z]
    }

    /// Where the rows of those axes start in a corner of [`Triangles4`], in bytes.
    #[inline(always)]
    #[cfg_attr(not(target_arch = "x86_64"), allow(dead_code))]
    pub(crate) fn rows(&self) -> [usize; 3] {
        let [x, y, z] = self.rows;
        [x as usize, y as usize, z as usize]
    }

    /// The axes that become x, y and z, each less than three.
    #[inline(always)]
    pub fn axes(&self) -> [usize; 3] {
        self.rows.map(|row| (row / ROW_BYTES) as usize)
    }

    /// Shears of x and y, scale of z.
    #[inline(always)]
    pub fn shear(&self) -> [f32; 3] {
        let [x, y, z, _] = self.shear;
        [x, y, z]
    }

    /// Both, four numbers each.
    #[inline(always)]
    #[cfg_attr(not(target_arch = "x86_64"), allow(dead_code))]
    pub(crate) fn fours(&self) -> [&[f32; 4]; 2] {
        [&self.origin, &self.shear]
    }
}

/// Where a ray meets [`Triangles4`]; lanes without a hit hold anything.
#[derive(Clone, Copy, Debug, Default)]
pub struct TriangleHits {
    /// Distance in units of the prepared direction.
    pub t: [f32; 4],
    /// Barycentric coordinate of the second corner.
    pub u: [f32; 4],
    /// Barycentric coordinate of the third corner.
    pub v: [f32; 4],
    /// Lanes that are hit, as bits.
    pub mask: u32,
    /// Lanes that wind counter-clockwise seen from the origin, as bits.
    pub front: u32,
}

impl TriangleHits {
    /// No hit.
    pub const NONE: Self = Self { t: [0.0; 4], u: [0.0; 4], v: [0.0; 4], mask: 0, front: 0 };
}

/// The nearest of four triangles that a ray meets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    /// Its distance; infinite if none is met.
    pub t: f32,
    /// Its lane; of several equally near ones the first.
    pub lane: u32,
    /// Lanes that are met, as bits.
    pub mask: u32,
    /// Whether lanes need to be decided exactly or several are equally near: then the rest is
    /// meaningless, and [`crate::Isa::triangles4`] must be asked.
    pub doubtful: bool,
}

impl Nearest {
    /// No hit.
    pub const NONE: Self = Self { t: f32::INFINITY, lane: 0, mask: 0, doubtful: false };
}

/// `p·q − r·s`, wrong by at most two units in the last place unless products underflow, and zero only if it
/// is: Kahan's algorithm (Jeannerod, Louvet, Muller, "Further analysis of Kahan's algorithm for the accurate
/// computation of 2 × 2 determinants", 2013).
///
/// In plain Rust the fused operations are calls of the C library: slow, but the same bits as the
/// instructions.
#[inline(always)]
#[allow(clippy::disallowed_methods, reason = "all instruction sets must round alike")]
pub(crate) fn cross(p: f32, q: f32, r: f32, s: f32) -> f32 {
    let rounded = r * s;
    p.mul_add(q, -rounded) - r.mul_add(s, -rounded)
}

/// By how much edge functions have the same sign: the least magnitude of them, or less than zero if their
/// signs are mixed. Up to [`SMALL`] on either side of zero products may underflow, and `f64` decides.
#[inline(always)]
pub(crate) fn margin(u: f32, v: f32, w: f32) -> f32 {
    // Comparisons and not `min` and `max`, which look for NaN.
    let least = |x: f32, y: f32| if x < y { x } else { y };
    let greatest = |x: f32, y: f32| if x > y { x } else { y };
    greatest(least(least(u, v), w), -greatest(greatest(u, v), w))
}

/// Edge functions of smaller magnitude are evaluated in `f64`: the products that they are differences of
/// may be so small that what rounding takes from them underflows.
pub(crate) const SMALL: f32 = f32::from_bits((127 - 100) << 23);
/// Determinants of larger magnitude are evaluated in `f64`.
pub(crate) const LARGE: f32 = f32::from_bits((127 + 60) << 23);

/// The corners of the triangle in one lane.
#[inline(always)]
pub fn corners(block: &Triangles4, lane: usize) -> [[f32; 3]; 3] {
    let corner = |i: usize| {
        let [x, y, z] = &block.vertices[i];
        [x[lane % 4], y[lane % 4], z[lane % 4]]
    };
    [corner(0), corner(1), corner(2)]
}

/// The corners of the triangle in one lane, their coordinates in the order of the ray's axes.
#[inline(always)]
pub fn corners_along(block: &Triangles4, lane: usize, ray: &ShearRay) -> [[f32; 3]; 3] {
    // Only what is asked for is loaded: all nine at first would be stored and loaded again.
    let [i, j, k] = ray.axes();
    let [a, b, c] = &block.vertices;
    let lane = lane % 4;
    [
        [a[i % 3][lane], a[j % 3][lane], a[k % 3][lane]],
        [b[i % 3][lane], b[j % 3][lane], b[k % 3][lane]],
        [c[i % 3][lane], c[j % 3][lane], c[k % 3][lane]],
    ]
}

/// Corners with their coordinates in the order of the ray's axes.
#[inline(always)]
pub fn along(corners: &[[f32; 3]; 3], ray: &ShearRay) -> [[f32; 3]; 3] {
    let [i, j, k] = ray.axes();
    let [a, b, c] = corners;
    [[a[i % 3], a[j % 3], a[k % 3]], [b[i % 3], b[j % 3], b[k % 3]], [c[i % 3], c[j % 3], c[k % 3]]]
}

/// A corner, its coordinates in the order of the ray's axes, as the ray sees it: moved to its origin
/// and sheared.
#[inline(always)]
pub(crate) fn sheared([x, y, z]: &[f32; 3], ray: &ShearRay) -> (f32, f32, f32) {
    let z = z - ray.origin[2];
    let x = x - ray.origin[0] - ray.shear[0] * z;
    (x, y - ray.origin[1] - ray.shear[1] * z, ray.shear[2] * z)
}

/// The barycentric coordinates of the second and the third corner where a ray meets a triangle, and
/// whether that winds counter-clockwise seen from the origin; coordinates of corners are in the order
/// of the ray's axes.
///
/// Has the bits of [`crate::Isa::triangles4`], and is meaningful only if the ray meets the triangle. One
/// triangle is less work than four.
#[inline(always)]
pub fn barycentric(corners: &[[f32; 3]; 3], ray: &ShearRay) -> (f32, f32, bool) {
    let (ax, ay, _) = sheared(&corners[0], ray);
    let (bx, by, _) = sheared(&corners[1], ray);
    let (cx, cy, _) = sheared(&corners[2], ray);
    let u = cross(cx, by, cy, bx);
    let v = cross(ax, cy, ay, cx);
    let w = cross(bx, ay, by, ax);
    let det = u + v + w;
    if margin(u, v, w) <= SMALL || det.abs() > LARGE {
        let mut hits = TriangleHits::NONE;
        decide_exactly(corners, ray, 0, f32::NEG_INFINITY, f32::INFINITY, &mut hits);
        return (hits.u[0], hits.v[0], hits.front & 1 != 0);
    }
    (v / det, w / det, det > 0.0)
}

/// Decides one lane in `f64` from the same sheared corners, replacing what `hits` says of it;
/// coordinates of corners are in the order of the ray's axes.
#[cold]
#[inline(never)]
pub(crate) fn decide_exactly(
    corners: &[[f32; 3]; 3],
    ray: &ShearRay,
    lane: usize,
    t_min: f32,
    t_max: f32,
    hits: &mut TriangleHits,
) {
    let corner = |i: usize| {
        let (x, y, z) = sheared(&corners[i], ray);
        (f64::from(x), f64::from(y), f64::from(z))
    };
    let ((ax, ay, az), (bx, by, bz), (cx, cy, cz)) = (corner(0), corner(1), corner(2));
    let u = cx * by - cy * bx;
    let v = ax * cy - ay * cx;
    let w = bx * ay - by * ax;
    let bit = 1 << lane;
    hits.mask &= !bit;
    hits.front &= !bit;
    let mixed = u.min(v).min(w) < 0.0 && u.max(v).max(w) > 0.0;
    let det = u + v + w;
    if mixed || det == 0.0 {
        return;
    }
    let t = ((u * az + v * bz + w * cz) / det) as f32;
    if t >= t_min && t <= t_max {
        hits.t[lane] = t;
        hits.u[lane] = (v / det) as f32;
        hits.v[lane] = (w / det) as f32;
        hits.mask |= bit;
        hits.front |= if det > 0.0 { bit } else { 0 };
    }
}
