//! Four triangles and the ray that meets them: the watertight triangle test.
//!
//! After Woop, Benthin, Wald: "Watertight Ray/Triangle Intersection", JCGT 2(1), 2013. The vertices
//! are moved to the ray's origin and sheared so that the ray runs along +z; three edge functions then
//! decide. Two triangles that share an edge compute the same sheared vertices, and `a·b − c·d` rounded
//! term by term has the sign of its exact value or is zero, so only zeros need care: they are decided
//! in `f64`, where products of `f32` are exact. (A fused multiply-add would break this; none is used,
//! and so all instruction sets give the same bits.)
//!
//! Changed: `f64` also takes over where determinants come near the ends of `f32`'s range, and the
//! distance is divided rather than multiplied by a reciprocal. Whether signs are mixed is seen in the
//! product of the least and the greatest edge function, which is zero where one of them is, or where
//! both are tiny: then `f64` decides too.

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

/// A ray prepared for [`Triangles4`].
#[derive(Clone, Copy, Debug)]
pub struct ShearRay {
    origin: [f32; 3],
    /// Sixteen times the axes.
    rows: [u32; 3],
    shear: [f32; 3],
}

impl ShearRay {
    /// From an origin and a direction whose longest component is neither huge nor tiny; `scale`
    /// multiplies the direction.
    #[inline(always)]
    pub fn new(origin: &[f32; 3], direction: &[f32; 3], scale: f32) -> Self {
        let (x, y, z) = (direction[0].abs(), direction[1].abs(), direction[2].abs());
        // Arithmetic instead of branches: no ray predicts the next one's axis.
        let longest = usize::from(y > x) * usize::from(y >= z) + 2 * usize::from(z > x.max(y));
        let backwards = direction[longest % 3].to_bits() >> 31;
        let axes = AXES[(longest + 3 * backwards as usize) % 6];
        let pick = |v: &[f32; 3]| axes.map(|axis| v[axis as usize % 3]);
        let [dx, dy, dz] = pick(direction).map(|d| d * scale);
        let rows = axes.map(|axis| ROW_BYTES * u32::from(axis));
        Self { origin: pick(origin), rows, shear: [dx / dz, dy / dz, 1.0 / dz] }
    }

    /// The origin along the axes that become x, y and z.
    #[inline(always)]
    pub fn origin(&self) -> [f32; 3] {
        self.origin
    }

    /// Where the rows of those axes start in a corner of [`Triangles4`], in bytes.
    #[inline(always)]
    #[cfg_attr(not(target_arch = "x86_64"), allow(dead_code))]
    pub(crate) fn rows(&self) -> [usize; 3] {
        self.rows.map(|row| row as usize)
    }

    /// The axes that become x, y and z, each less than three.
    #[inline(always)]
    pub fn axes(&self) -> [usize; 3] {
        self.rows.map(|row| (row / ROW_BYTES) as usize)
    }

    /// Shears of x and y, scale of z.
    #[inline(always)]
    pub fn shear(&self) -> [f32; 3] {
        self.shear
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

/// Determinants of smaller magnitude are evaluated in `f64`.
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

/// A corner as the ray sees it: moved to its origin and sheared.
#[inline(always)]
pub(crate) fn sheared(corner: &[f32; 3], ray: &ShearRay) -> (f32, f32, f32) {
    let [i, j, k] = ray.axes();
    let z = corner[k % 3] - ray.origin[2];
    let x = corner[i % 3] - ray.origin[0] - ray.shear[0] * z;
    (x, corner[j % 3] - ray.origin[1] - ray.shear[1] * z, ray.shear[2] * z)
}

/// The barycentric coordinates of the second and the third corner where a ray meets a triangle, and
/// whether that winds counter-clockwise seen from the origin.
///
/// Has the bits of [`crate::Isa::triangles4`], and is meaningful only if the ray meets the triangle. One
/// triangle is less work than four.
#[inline(always)]
pub fn barycentric(corners: &[[f32; 3]; 3], ray: &ShearRay) -> (f32, f32, bool) {
    let (ax, ay, _) = sheared(&corners[0], ray);
    let (bx, by, _) = sheared(&corners[1], ray);
    let (cx, cy, _) = sheared(&corners[2], ray);
    let u = cx * by - cy * bx;
    let v = ax * cy - ay * cx;
    let w = bx * ay - by * ax;
    let det = u + v + w;
    let size = det.abs();
    let signs = u.min(v).min(w) * u.max(v).max(w);
    if signs == 0.0 || !(SMALL..=LARGE).contains(&size) {
        let mut hits = TriangleHits::NONE;
        decide_exactly(corners, ray, 0, f32::NEG_INFINITY, f32::INFINITY, &mut hits);
        return (hits.u[0], hits.v[0], hits.front & 1 != 0);
    }
    (v / det, w / det, det > 0.0)
}

/// Decides one lane in `f64` from the same sheared corners, replacing what `hits` says of it.
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
