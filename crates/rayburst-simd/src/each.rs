//! Rays and triangles in pairs: where each ray meets the triangle beside it.
//!
//! Lanes are written so that compilers vectorise them in the region of a token, and have the bits of
//! [`crate::Isa::triangles4`] everywhere.

use crate::{
    ShearRay, TriangleHits,
    triangles::{LARGE, SMALL, along, cross, decide_exactly, margin},
};

/// Rays over `0 ≤ t < ∞`, a triangle each; `[axis][lane]`.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub struct Pairs<const N: usize> {
    /// Origins.
    pub origin: [[f32; N]; 3],
    /// Directions; longest components must be neither subnormal nor infinite.
    pub direction: [[f32; N]; 3],
    /// Corners of the triangles, the first index.
    pub corners: [[[f32; N]; 3]; 3],
}

impl<const N: usize> Pairs<N> {
    /// Rays and triangles of zeros, which do not meet.
    pub const NONE: Self =
        Self { origin: [[0.0; N]; 3], direction: [[0.0; N]; 3], corners: [[[0.0; N]; 3]; 3] };
}

/// Where they meet; lanes that do not hold anything.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub struct Meetings<const N: usize> {
    /// Distance in units of the direction.
    pub t: [f32; N],
    /// Barycentric coordinate of the second corner.
    pub u: [f32; N],
    /// Barycentric coordinate of the third corner.
    pub v: [f32; N],
    /// Whether they meet.
    pub met: [bool; N],
    /// Whether the triangle winds counter-clockwise seen from the origin.
    pub front: [bool; N],
}

/// Where each ray meets its triangle, as [`crate::Isa::triangles4`] would find it.
#[inline(always)]
pub fn meet_each<const N: usize>(pairs: &Pairs<N>) -> Meetings<N> {
    let mut meetings =
        Meetings { t: [0.0; N], u: [0.0; N], v: [0.0; N], met: [false; N], front: [false; N] };
    let (mut margins, mut dets) = ([0.0f32; N], [0.0f32; N]);
    let Pairs { origin, direction, corners } = pairs;
    for lane in 0..N {
        let (dx, dy, dz) = (direction[0][lane], direction[1][lane], direction[2][lane]);
        let (x, y, z) = (dx.abs(), dy.abs(), dz.abs());
        let (by_y, by_z) = ((y > x) & (y >= z), (z > x) & (z > y));
        let longest = if by_z {
            dz
        } else if by_y {
            dy
        } else {
            dx
        };
        let backwards = longest < 0.0;
        // The order of axes of `ShearRay`.
        let turn = |x: f32, y: f32, z: f32| {
            let i = if by_z {
                x
            } else if by_y {
                z
            } else {
                y
            };
            let j = if by_z {
                y
            } else if by_y {
                x
            } else {
                z
            };
            let k = if by_z {
                z
            } else if by_y {
                y
            } else {
                x
            };
            (if backwards { j } else { i }, if backwards { i } else { j }, k)
        };
        let exponent = (longest.abs().to_bits() >> 23).clamp(1, 253);
        let scale = f32::from_bits((254 - exponent) << 23);
        let (di, dj, dk) = turn(dx, dy, dz);
        let (di, dj, dk) = (di * scale, dj * scale, dk * scale);
        let (shear_x, shear_y, shear_z) = (di / dk, dj / dk, 1.0 / dk);
        let corner = |i: usize| {
            let [x, y, z] = &corners[i];
            let (x, y, z) = turn(
                x[lane] - origin[0][lane],
                y[lane] - origin[1][lane],
                z[lane] - origin[2][lane],
            );
            (x - shear_x * z, y - shear_y * z, shear_z * z)
        };
        let ((ax, ay, az), (bx, by, bz), (cx, cy, cz)) = (corner(0), corner(1), corner(2));
        let u = cross(cx, by, cy, bx);
        let v = cross(ax, cy, ay, cx);
        let w = cross(bx, ay, by, ax);
        let det = u + v + w;
        let t = (u * az + v * bz + w * cz) / det;
        margins[lane] = margin(u, v, w);
        dets[lane] = det;
        meetings.t[lane] = (t + 0.0) * scale;
        meetings.u[lane] = v / det;
        meetings.v[lane] = w / det;
        meetings.met[lane] = (margins[lane] > SMALL) & (0.0..=f32::MAX).contains(&t);
        meetings.front[lane] = det > 0.0;
    }
    for lane in 0..N {
        if margins[lane] >= -SMALL && (margins[lane] <= SMALL || dets[lane].abs() > LARGE) {
            meet_exactly(pairs, lane, &mut meetings);
        }
    }
    meetings
}

/// Decides one lane in `f64`.
#[cold]
#[inline(never)]
fn meet_exactly<const N: usize>(pairs: &Pairs<N>, lane: usize, meetings: &mut Meetings<N>) {
    let at = |v: &[[f32; N]; 3]| [v[0][lane], v[1][lane], v[2][lane]];
    let direction = at(&pairs.direction);
    let longest = direction.iter().fold(0.0f32, |m, d| m.max(d.abs()));
    let exponent = (longest.to_bits() >> 23).clamp(1, 253);
    let scale = f32::from_bits((254 - exponent) << 23);
    let ray = ShearRay::new(&at(&pairs.origin), &direction, scale);
    let corners = along(&pairs.corners.each_ref().map(at), &ray);
    let mut hits = TriangleHits::NONE;
    decide_exactly(&corners, &ray, 0, 0.0, f32::MAX, &mut hits);
    meetings.met[lane] = hits.mask & 1 != 0;
    meetings.front[lane] = hits.front & 1 != 0;
    meetings.t[lane] = (hits.t[0] + 0.0) * scale;
    (meetings.u[lane], meetings.v[lane]) = (hits.u[0], hits.v[0]);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Isa, IsaLevel, Kernel, Scalar, Triangles4, tests::Random};

    struct Meet<'a>(&'a Pairs<16>);

    impl Kernel for Meet<'_> {
        type Output = Meetings<16>;

        #[inline(always)]
        fn run<I: Isa>(self, _: I) -> Meetings<16> {
            meet_each(self.0)
        }
    }

    #[test]
    fn pairs_meet_as_a_ray_meets_a_block_bit_for_bit() {
        let mut random = Random(17);
        let (mut met, mut exact) = (0, 0);
        for i in 0..20_000 {
            let mut pairs = Pairs::<16>::NONE;
            for lane in 0..16 {
                let mut point = |size: f32| {
                    let v = random.vector().map(|x| x * size);
                    if i % 2 == 0 { v.map(|x| (2.0 * x).round()) } else { v }
                };
                let (origin, mut direction) = (point(1.0), point(1.0));
                if direction == [0.0; 3] {
                    direction = [0.0, -1.0, 0.0];
                }
                let corners = [point(1.0), point(1.0), point(1.0)];
                for axis in 0..3 {
                    pairs.origin[axis][lane] = origin[axis];
                    pairs.direction[axis][lane] = direction[axis];
                    for corner in 0..3 {
                        pairs.corners[corner][axis][lane] = corners[corner][axis];
                    }
                }
            }
            for level in IsaLevel::available() {
                let found = level.dispatch(Meet(&pairs));
                for lane in 0..16 {
                    let at = |v: &[[f32; 16]; 3]| [v[0][lane], v[1][lane], v[2][lane]];
                    let direction = at(&pairs.direction);
                    let longest = direction.iter().fold(0.0f32, |m, d| m.max(d.abs()));
                    let scale = f32::from_bits((254 - (longest.to_bits() >> 23)) << 23);
                    let ray = ShearRay::new(&at(&pairs.origin), &direction, scale);
                    let mut block = Triangles4 { vertices: [[[f32::NAN; 4]; 3]; 3], ids: [0; 4] };
                    for corner in 0..3 {
                        for axis in 0..3 {
                            block.vertices[corner][axis][0] = pairs.corners[corner][axis][lane];
                        }
                    }
                    let mut hits = TriangleHits::NONE;
                    let mask = Scalar.triangles4(&block, &ray, 0.0, f32::MAX, &mut hits);
                    assert_eq!(found.met[lane], mask & 1 != 0, "{}", level.name());
                    if found.met[lane] {
                        met += 1;
                        exact += usize::from(hits.u[0] == 0.0 || hits.v[0] == 0.0);
                        let bits = |x: [f32; 3]| x.map(f32::to_bits);
                        let expected = [(hits.t[0] + 0.0) * scale, hits.u[0], hits.v[0]];
                        assert_eq!(
                            bits([found.t[lane], found.u[lane], found.v[lane]]),
                            bits(expected)
                        );
                        assert_eq!(found.front[lane], hits.front & 1 != 0);
                    }
                }
            }
        }
        assert!(met > 1000 && exact > 100, "{met} {exact}");
    }
}
