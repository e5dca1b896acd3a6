//! Eight by eight pixels of a picture, and the planes of a triangle over them.
//!
//! Edge functions are those of Pineda, "A parallel algorithm for polygon rasterization", 1988: linear over
//! the picture, not negative inside. A fourth plane is the triangle's *nearness*, greater for what is
//! nearer.

/// What a triangle is over a square of 64 pixels a side: functions `(at_origin + y·py) + x·px` of a pixel's
/// column and row, rounded in this order. Rounding is monotonic, so over a rectangle of pixels the greatest
/// computed value is the one at a corner.
///
/// Edge functions are scaled so that they are wrong by less than [`PixelPlanes::DOUBT`]: what is nearer to
/// zero is decided in `f64`.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(16))]
pub struct PixelPlanes {
    /// Slopes along x of three edge functions and of nearness.
    pub x: [f32; 4],
    /// Slopes along y.
    pub y: [f32; 4],
    /// Values at the pixel (0, 0).
    pub at_origin: [f32; 4],
    /// The greatest nearness that counts.
    pub limit: f32,
    /// The nearness of the triangle's nearest corner: what is greater is rounded.
    pub nearest: f32,
}

impl PixelPlanes {
    /// Planes of zeros.
    pub const NONE: Self =
        Self { x: [0.0; 4], y: [0.0; 4], at_origin: [0.0; 4], limit: 0.0, nearest: 0.0 };

    /// Coefficients of edge functions are such that none of the three is as large as 2 at any pixel of the
    /// square. Seven roundings of that, half a unit in the last place each or twice of that, are less than this.
    pub const DOUBT: f32 = 1.0 / (1 << 20) as f32;

    /// Two triangles are equally near, but for rounding, if their nearness differs by no more than this times as
    /// much.
    pub const CLOSE: f32 = 1.0 / (1 << 17) as f32;

    /// The triangle's nearness at a pixel.
    #[inline(always)]
    pub fn nearness(&self, x: f32, y: f32) -> f32 {
        lesser(self.at(3, x, y), self.nearest)
    }

    /// The value of a plane at a pixel.
    #[inline(always)]
    pub fn at(&self, plane: usize, x: f32, y: f32) -> f32 {
        (self.at_origin[plane % 4] + self.y[plane % 4] * y) + self.x[plane % 4] * x
    }
}

/// The lesser of two numbers, the second if one is not a number: what vector instructions give.
#[inline(always)]
fn lesser(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// A triangle as given: what decides where planes do not.
#[derive(Clone, Copy, Debug)]
pub struct PixelTriangle<'a> {
    /// Homogeneous picture coordinates (x, y, w), in pixels, and nearness: 1/w in perspective; else w is 1.
    pub corners: &'a [[f32; 4]; 3],
    /// The centre of the pixel (0, 0).
    pub first: [f64; 2],
    /// Whether the determinant is negative.
    pub turned: bool,
}

impl PixelTriangle<'_> {
    /// Whether the triangle covers a pixel's centre: inside, or on a left or a top edge.
    ///
    /// Corners are seen from the centre, so one that is there is zero, and so are its edges' functions; those of
    /// a shared edge are the same for both triangles but for the sign.
    #[cold]
    #[inline(never)]
    pub fn covers(&self, x: f32, y: f32) -> bool {
        let at = [self.first[0] + f64::from(x), self.first[1] + f64::from(y)];
        let corners = self.corners.map(|[x, y, w, _]| {
            let w = f64::from(w);
            [f64::from(x) - at[0] * w, f64::from(y) - at[1] * w, w]
        });
        (0..3).all(|edge| {
            let ([x1, y1, w1], [x2, y2, w2]) = (corners[(edge + 1) % 3], corners[(edge + 2) % 3]);
            let turn = |x: f64| if self.turned { -x } else { x };
            let value = turn(x1 * y2 - y1 * x2);
            if value != 0.0 {
                return value > 0.0;
            }
            let (px, py) = (turn(y1 * w2 - w1 * y2), turn(w1 * x2 - x1 * w2));
            px > 0.0 || px == 0.0 && py > 0.0
        })
    }
}

/// What is seen in eight by eight pixels, row by row.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub struct PixelTile {
    /// Nearness of what is seen.
    pub nearness: [f32; 64],
    /// What is seen.
    pub ids: [u32; 64],
}

/// The part of a tile that a triangle may cover.
#[derive(Clone, Copy, Debug)]
pub struct TilePart {
    /// The tile's first pixel in the coordinates of [`PixelPlanes`].
    pub first: [f32; 2],
    /// The first and the last column, less than eight.
    pub columns: [u32; 2],
    /// The first and the last row, less than eight.
    pub rows: [u32; 2],
}

/// [`crate::Isa::cover_tile`], pixel by pixel.
#[inline(always)]
pub(crate) fn cover_tile<const IDS: bool, const WRITE: bool>(
    planes: &PixelPlanes,
    triangle: &PixelTriangle<'_>,
    part: &TilePart,
    id: u32,
    tile: &mut PixelTile,
) -> [u64; 2] {
    let (mut covered, mut close) = (0, 0);
    let [top, bottom] = part.rows;
    for row in top..=bottom.min(7) {
        let y = part.first[1] + row as f32;
        for column in 0..8 {
            let x = part.first[0] + column as f32;
            let pixel = (8 * row + column) as usize;
            let (seen, seen_id) = (tile.nearness[pixel], tile.ids[pixel]);
            let nearness = planes.nearness(x, y);
            let inside = [0, 1, 2].map(|edge| planes.at(edge, x, y));
            let inside = lesser(lesser(inside[0], inside[1]), inside[2]);
            let passes = column >= part.columns[0]
                && column <= part.columns[1]
                && inside >= -PixelPlanes::DOUBT
                && planes.at(3, x, y) <= planes.limit;
            let differs = (nearness - seen).abs();
            if IDS && passes && differs <= nearness.abs() * PixelPlanes::CLOSE {
                close |= 1 << pixel;
            }
            let wins = nearness > seen || IDS && nearness == seen && id <= seen_id;
            if !(passes && wins) || inside <= PixelPlanes::DOUBT && !triangle.covers(x, y) {
                continue;
            }
            covered |= 1 << pixel;
            if WRITE {
                tile.nearness[pixel] = nearness;
                if IDS {
                    tile.ids[pixel] = id;
                }
            }
        }
    }
    [covered, close]
}

/// Of pixels of a row, or two rows, those that a triangle covers, given those in doubt.
#[cold]
#[inline(never)]
#[cfg_attr(not(target_arch = "x86_64"), allow(dead_code))]
pub(crate) fn settle(
    triangle: &PixelTriangle<'_>,
    first: [f32; 2],
    covered: u32,
    mut doubtful: u32,
) -> u32 {
    let mut settled = covered;
    while doubtful != 0 {
        let pixel = doubtful.trailing_zeros();
        doubtful &= doubtful - 1;
        if !triangle.covers(first[0] + (pixel % 8) as f32, first[1] + (pixel / 8) as f32) {
            settled &= !(1 << pixel);
        }
    }
    settled
}

/// What is known of a triangle over pixels, and is not a plane.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub struct PixelEdges {
    /// The edge functions along x, along y and at the pixel (0, 0), neither scaled nor turned.
    pub edges: [[f64; 4]; 3],
    /// Their sum at the pixel where it is the triangle's volume: negative if corners wind
    /// counter-clockwise as they are seen.
    pub det: f64,
}

/// Bits of an exponent of `f64`.
const EXPONENT: u64 = 0x7FF << 52;
/// What exponents are subtracted from: the bits of a power of two that brings a number to about one.
pub(crate) const LARGEST_EXPONENT: u64 = 0x7FE << 52;

/// Pixels along a side of the square that planes are for.
pub(crate) const SIDE: f64 = 64.0;

/// Of four lanes, those that follow in a triangle; the last has no meaning.
#[inline(always)]
fn following(lanes: &[f64; 4]) -> [f64; 4] {
    [lanes[1], lanes[2], lanes[0], lanes[3]]
}

/// `p·q − r·s`, lane by lane.
#[inline(always)]
fn cross(p: &[f64; 4], q: &[f64; 4], r: &[f64; 4], s: &[f64; 4]) -> [f64; 4] {
    let mut result = [0.0; 4];
    for lane in 0..4 {
        result[lane] = p[lane] * q[lane] - r[lane] * s[lane];
    }
    result
}

/// [`crate::Isa::pixel_planes`].
#[inline(always)]
pub(crate) fn pixel_planes<const PERSPECTIVE: bool>(
    corners: &[[f32; 4]; 3],
    first: [f64; 2],
    planes: &mut PixelPlanes,
) -> PixelEdges {
    let [a, b, c] = corners;
    let row = |i: usize| [f64::from(a[i]), f64::from(b[i]), f64::from(c[i]), 0.0];
    let (mut x, mut y, w, n) = (row(0), row(1), row(2), row(3));
    for lane in 0..4 {
        x[lane] -= first[0] * w[lane];
        y[lane] -= first[1] * w[lane];
    }
    let (x1, y1, w1) = (following(&x), following(&y), following(&w));
    let (x2, y2, w2) = (following(&x1), following(&y1), following(&w1));
    let edges = [cross(&y1, &w2, &w1, &y2), cross(&w1, &x2, &x1, &w2), cross(&x1, &y2, &y1, &x2)];
    let det = (x[0] * edges[0][0] + y[0] * edges[1][0]) + w[0] * edges[2][0];
    // Nearness: Σ nᵢ wᵢ Eᵢ ÷ det, with nᵢ wᵢ = 1 in perspective and wᵢ = 1 without.
    let inverse = 1.0 / det;
    let share = if PERSPECTIVE { [inverse; 4] } else { n.map(|n| n * inverse) };
    let greater = |x: f32, y: f32| if x > y { x } else { y };
    planes.nearest = greater(greater(a[3], b[3]), c[3]);
    planes.limit = if PERSPECTIVE { f32::MAX } else { 0.0 };
    let to = [&mut planes.x, &mut planes.y, &mut planes.at_origin];
    for (to, from) in to.into_iter().zip(&edges) {
        to[3] = ((share[0] * from[0] + share[1] * from[1]) + share[2] * from[2]) as f32;
    }
    // Each edge is scaled by a power of two of its own, the same for both of its triangles: exact.
    let sign = det.to_bits() & (1 << 63);
    for lane in 0..3 {
        let greater = |x: f64, y: f64| if x > y { x } else { y };
        let [ex, ey, e0] = edges.map(|edge| edge[lane].abs());
        let exponent = greater(SIDE * greater(ex, ey), e0).to_bits() & EXPONENT;
        let scale = f64::from_bits(LARGEST_EXPONENT.wrapping_sub(exponent) | sign);
        planes.x[lane] = (edges[0][lane] * scale) as f32;
        planes.y[lane] = (edges[1][lane] * scale) as f32;
        planes.at_origin[lane] = (edges[2][lane] * scale) as f32;
    }
    PixelEdges { edges, det }
}
