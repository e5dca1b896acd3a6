//! The first half of the work: triangles of clusters as the picture shows them, sorted into bins.

use glam::{DVec2, Vec2, Vec4, Vec4Swizzles};

use crate::{
    bins::{BIN, BinGrid},
    clusters::{CLUSTER, CLUSTER_VERTICES, Clusters},
    mesh::Placed,
    view::View,
};

/// A triangle that may cover a pixel's centre: one line of the cache.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(crate) struct Record {
    /// Homogeneous picture coordinates, in pixels from the centre, and nearness (infinite at the eye or
    /// behind it).
    pub(crate) corners: [Vec4; 3],
    /// The first and the last column and row of pixels whose centres it may cover.
    pub(crate) first: [u16; 2],
    pub(crate) last: [u16; 2],
    /// The number of the triangle.
    pub(crate) id: u32,
    /// The cluster, by its place among those drawn, and [`TRANSLUCENT`] if coverage must be asked.
    pub(crate) source: u32,
}

/// Marks sources.
pub(crate) const TRANSLUCENT: u32 = 1 << 31;

/// Some clusters' triangles by bin. Everything is kept from picture to picture.
#[derive(Debug, Default)]
pub(crate) struct Chunk {
    pub(crate) records: Vec<Record>,
    /// Bin and record of each place where a triangle meets a bin.
    pairs: Vec<(u32, u32)>,
    /// Where the records of each bin begin in `sorted`, and where those of the last one end.
    starts: Vec<u32>,
    sorted: Vec<u32>,
}

/// Sums with this have no fraction.
const WHOLE: f32 = 1.5 * (1u32 << 23) as f32;

/// What does not change from triangle to triangle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Screen {
    pub(crate) grid: BinGrid,
    /// From (x, y, −x, −y) in pixels from the centre to first and last pixels.
    offset: Vec4,
    limits: Vec4,
    /// Half the picture, and a little.
    half: Vec2,
    first_centre: DVec2,
}

impl Screen {
    pub(crate) fn new(view: &View) -> Self {
        let extent = view.extent();
        let first_centre = view.first_centre();
        let first = first_centre.as_vec2();
        // More than projected coordinates are wrong by.
        let margin = 1.0 / 512.0 + extent.max_element() / (1 << 20) as f32;
        let last = extent - Vec2::ONE;
        Self {
            grid: BinGrid::new(view.size),
            offset: Vec4::new(-first.x, -first.y, first.x, first.y)
                + Vec4::splat(0.5 - 2.0 * margin),
            limits: Vec4::new(0.0, 0.0, -last.x, -last.y),
            half: 0.5 * extent + 2.0,
            first_centre,
        }
    }

    /// The first and the last pixels whose centres are within bounds (x, y, −x, −y), the latter negated;
    /// `None` if there are none.
    #[inline(always)]
    pub(crate) fn pixels(&self, bounds: Vec4) -> Option<Vec4> {
        // Rounding to the nearest after adding half and subtracting twice the margin rounds up, or at ties one
        // further, which the other margin is for.
        let span = (bounds + self.offset).max(self.limits) + Vec4::splat(WHOLE);
        let span = span - Vec4::splat(WHOLE);
        // False for NaN.
        ((span + span.zwxy()).cmple(Vec4::ZERO).bitmask() & 3 == 3).then_some(span)
    }

    /// The pixel coordinates of pixel centres start here, seen from the picture's centre.
    pub(crate) fn first_centre(&self) -> DVec2 {
        self.first_centre
    }

    /// The bounds of what the picture shows of a triangle that reaches the plane of the eye: that part,
    /// clipped (Sutherland, Hodgman, "Reentrant polygon clipping", 1974).
    #[cold]
    fn clipped_bounds(&self, corners: &[Vec4; 3]) -> Option<Vec4> {
        let half = self.half.as_dvec2();
        // The plane of the eye and the picture's sides: not negative inside.
        let sides = [
            [0.0, 0.0, 1.0],
            [1.0, 0.0, half.x],
            [-1.0, 0.0, half.x],
            [0.0, 1.0, half.y],
            [0.0, -1.0, half.y],
        ];
        // Each side adds a corner at most.
        let (mut polygon, mut count) = ([[0.0f64; 3]; 8], 3);
        for (to, from) in polygon.iter_mut().zip(corners) {
            *to = [f64::from(from.x), f64::from(from.y), f64::from(from.z)];
        }
        for [x, y, w] in sides {
            let side = |p: &[f64; 3]| x * p[0] + y * p[1] + w * p[2];
            let (mut clipped, mut kept) = ([[0.0f64; 3]; 8], 0);
            for i in 0..count {
                let (a, b) = (polygon[i], polygon[(i + 1) % count]);
                let (at_a, at_b) = (side(&a), side(&b));
                if at_a >= 0.0 && kept < 8 {
                    clipped[kept] = a;
                    kept += 1;
                }
                if (at_a < 0.0) != (at_b < 0.0) && kept < 8 {
                    let t = at_a / (at_a - at_b);
                    clipped[kept] = [0, 1, 2].map(|k| a[k] + t * (b[k] - a[k]));
                    kept += 1;
                }
            }
            (polygon, count) = (clipped, kept);
        }
        let mut bounds = Vec4::INFINITY;
        for [x, y, w] in &polygon[..count] {
            // At the eye itself: everywhere.
            let inverse = 1.0 / w;
            let (x, y) = ((x * inverse) as f32, (y * inverse) as f32);
            let (x, y) = (x.clamp(-self.half.x, self.half.x), y.clamp(-self.half.y, self.half.y));
            if !x.is_finite() || !y.is_finite() {
                return Some(Vec4::splat(-self.half.max_element()));
            }
            bounds = bounds.min(Vec4::new(x, y, -x, -y));
        }
        (count > 0).then_some(bounds)
    }
}

/// Room for the vertices of a cluster.
pub(crate) struct Vertices {
    /// As in [`Record::corners`].
    corners: [Vec4; CLUSTER_VERTICES],
    /// (x, y, −x, −y) in pixels from the centre.
    shown: [Vec4; CLUSTER_VERTICES],
}

impl Vertices {
    pub(crate) const NONE: Self =
        Self { corners: [Vec4::ZERO; CLUSTER_VERTICES], shown: [Vec4::ZERO; CLUSTER_VERTICES] };
}

/// Coordinates are divided by depths that are at least this much of them.
const STEEPEST: f32 = 1.0 / (1u32 << 30) as f32;

impl Chunk {
    pub(crate) fn clear(&mut self) {
        self.records.clear();
        self.pairs.clear();
    }

    /// Adds what may be seen of a cluster.
    #[inline(always)]
    pub(crate) fn add_cluster<const PERSPECTIVE: bool>(
        &mut self,
        screen: &Screen,
        (placed, source): (&Placed, u32),
        clusters: &Clusters,
        index: usize,
        vertices: &mut Vertices,
    ) {
        let cluster = &clusters.clusters[index];
        let positions = &clusters.vertices[cluster.first_vertex as usize..];
        let positions = &positions[..cluster.vertex_count as usize];
        let source = source | if placed.opaque { 0 } else { TRANSLUCENT };
        let [cx, cy, cz] = placed.columns;
        let mut all_in_front = true;
        let Vertices { corners, shown } = vertices;
        for ((p, corner), shown) in positions.iter().zip(&mut *corners).zip(&mut *shown) {
            let d = *p - placed.origin;
            let at = cx * d.xxxx() + cy * d.yyyy() + cz * d.zzzz();
            let sides = Vec4::new(at.x, at.y, -at.x, -at.y);
            if PERSPECTIVE {
                let inverse = 1.0 / at.z;
                let in_front = at.z > 0.0 && sides.max_element() * STEEPEST <= at.z;
                all_in_front &= in_front;
                *corner = at.xyz().extend(if in_front { inverse } else { f32::INFINITY });
                *shown = sides * inverse;
            } else {
                *corner = Vec4::new(at.x, at.y, 1.0, -at.z);
                *shown = sides;
            }
        }
        let triangles = &clusters.triangles[index * CLUSTER..];
        for triangle in &triangles[..cluster.triangle_count as usize] {
            let [a, b, c, _] =
                triangle.corners.map(|corner| usize::from(corner) % CLUSTER_VERTICES);
            let mut bounds = shown[a].min(shown[b]).min(shown[c]);
            if PERSPECTIVE && !all_in_front {
                let triangle = [corners[a], corners[b], corners[c]];
                if triangle.iter().any(|p| p.w == f32::INFINITY) {
                    match screen.clipped_bounds(&triangle) {
                        Some(clipped) => bounds = clipped,
                        None => continue,
                    }
                }
            }
            let Some(span) = screen.pixels(bounds) else { continue };
            let number = self.records.len() as u32;
            let record = Record {
                corners: [corners[a], corners[b], corners[c]],
                first: [span.x as u16, span.y as u16],
                last: [-span.z as u16, -span.w as u16],
                id: placed.first_id + triangle.primitive,
                source,
            };
            self.records.push(record);
            let [left, top] = record.first.map(|x| u32::from(x) / BIN);
            let [right, bottom] = record.last.map(|x| u32::from(x) / BIN);
            let mut row = top;
            while row <= bottom {
                let mut column = left;
                while column <= right {
                    self.pairs.push((row * screen.grid.columns + column, number));
                    column += 1;
                }
                row += 1;
            }
        }
    }

    /// Sorts by bin, in the order in which triangles came.
    pub(crate) fn sort(&mut self, bins: usize) {
        self.starts.clear();
        self.starts.resize(bins + 1, 0);
        for &(bin, _) in &self.pairs {
            self.starts[bin as usize] += 1;
        }
        // Ends first; filled from the back, they become starts.
        let mut end = 0;
        for start in &mut self.starts {
            end += *start;
            *start = end;
        }
        self.sorted.clear();
        self.sorted.resize(self.pairs.len(), 0);
        for &(bin, record) in self.pairs.iter().rev() {
            let place = &mut self.starts[bin as usize];
            *place -= 1;
            self.sorted[*place as usize] = record;
        }
    }

    /// The records of a bin.
    pub(crate) fn of_bin(&self, bin: usize) -> &[u32] {
        &self.sorted[self.starts[bin] as usize..self.starts[bin + 1] as usize]
    }
}
