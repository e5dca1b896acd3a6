//! Leaves written anew from vertices that moved.
//!
//! A leaf tells its triangles, these their vertices, and these their places: a chain of loads, each of
//! which may wait for memory. So leaves are worked on in batches: what a step needs is asked for in the
//! step before, for all leaves of the batch.

use glam::{Mat4, Vec3, Vec4};
use rayburst_simd::{Isa, Triangles4};

use super::block_mut;
use crate::{
    MAX_COORDINATE, TriangleMesh,
    build::triangle_keys::{AREA_ERROR, hittable},
    layout::{
        arena::Line,
        curve_leaves::Bounds,
        triangles::{BLOCK, TriangleId, locate},
    },
};

/// Leaves of a batch.
const BATCH: usize = 32;

/// Where the triangles are now.
#[derive(Clone, Copy)]
pub(super) struct Source<'a> {
    pub(super) geometries: &'a [TriangleMesh<'a>],
    /// The number of each geometry's first triangle.
    pub(super) starts: &'a [u32],
}

/// A leaf to be written.
#[derive(Clone, Copy, Debug)]
pub(super) struct Job {
    /// Half lines from the start of the structure to its block.
    pub(super) half_line: u32,
    /// Which box is its.
    pub(super) slot: u32,
}

impl Job {
    /// The half line of its block, counted from some line.
    #[inline(always)]
    fn place(&self, first_line: usize) -> usize {
        self.half_line as usize - 2 * first_line
    }
}

/// What is known of a leaf so far.
#[derive(Clone, Copy, Default)]
struct Draft {
    /// The geometry of its triangles, or [`MIXED`].
    geometry: u32,
    /// The vertices of its triangles; at first only their places among those of the geometry.
    corners: [[u32; 3]; BLOCK],
}

/// Marks leaves with triangles of several geometries.
const MIXED: u32 = u32::MAX;

/// The geometry that was looked up last.
struct Finder<'a> {
    starts: &'a [u32],
    geometry: u32,
    /// The number of its first triangle.
    first: u32,
    /// How many it has.
    count: u32,
}

impl<'a> Finder<'a> {
    fn new(source: Source<'a>) -> Self {
        Self { starts: source.starts, geometry: 0, first: 0, count: 0 }
    }

    /// Whether all of some triangles are in the geometry.
    #[inline(always)]
    fn holds(&self, triangles: &[u32; BLOCK]) -> bool {
        // Those before the first wrap around.
        let [a, b, c, d] = triangles;
        let (a, b) = (a.wrapping_sub(self.first), b.wrapping_sub(self.first));
        let (c, d) = (c.wrapping_sub(self.first), d.wrapping_sub(self.first));
        a.max(b).max(c.max(d)) < self.count
    }

    /// Goes to the geometry of a triangle.
    #[inline(never)]
    fn look_up(&mut self, triangle: u32) {
        let after = self.starts.partition_point(|&start| start <= triangle);
        self.geometry = after as u32 - 1;
        self.first = self.starts[after - 1];
        self.count = self.starts.get(after).map_or(u32::MAX, |&end| end) - self.first;
    }
}

impl Source<'_> {
    /// Writes leaves, given the lines from some line on; notes their boxes. Returns how many lanes hold a
    /// triangle that cannot be hit.
    #[inline(always)]
    pub(super) fn write<I: Isa>(
        &self,
        isa: I,
        jobs: &[Job],
        first_line: usize,
        lines: &mut [Line],
        boxes: &mut [Bounds],
    ) -> usize {
        let mut finder = Finder::new(*self);
        let mut hidden = 0;
        let mut drafts = [Draft::default(); BATCH];
        for batch in jobs.chunks(BATCH) {
            for (job, draft) in batch.iter().zip(&mut drafts) {
                let triangles = triangles_of(block_mut(lines, job.place(first_line)));
                if !finder.holds(&triangles) {
                    finder.look_up(triangles[0]);
                }
                if !finder.holds(&triangles) {
                    draft.geometry = MIXED;
                    continue;
                }
                draft.geometry = finder.geometry;
                let indices = self.geometries[finder.geometry as usize].indices.as_ptr();
                for lane in 0..BLOCK {
                    let primitive = triangles[lane] - finder.first;
                    isa.prefetch(indices.wrapping_add(primitive as usize));
                    draft.corners[lane][0] = primitive;
                }
            }
            for draft in &mut drafts[..batch.len()] {
                if draft.geometry == MIXED {
                    continue;
                }
                let mesh = &self.geometries[draft.geometry as usize];
                let positions = mesh.positions.as_ptr();
                for corners in &mut draft.corners {
                    *corners = mesh.indices[corners[0] as usize];
                    isa.prefetch(positions.wrapping_add(corners[0] as usize));
                    isa.prefetch(positions.wrapping_add(corners[1] as usize));
                    isa.prefetch(positions.wrapping_add(corners[2] as usize));
                }
            }
            for (job, draft) in batch.iter().zip(&drafts) {
                let block = block_mut(lines, job.place(first_line));
                let corners = if draft.geometry == MIXED {
                    None
                } else {
                    corners_of(&self.geometries[draft.geometry as usize], &draft.corners)
                };
                let corners = match corners {
                    Some(corners) => corners,
                    None => self.corners_of_any(&triangles_of(block)),
                };
                let bounds = match rewrite(block, &corners) {
                    Some(bounds) => bounds,
                    None => {
                        let (bounds, lost) = check_lanes(block);
                        hidden += lost;
                        bounds
                    }
                };
                boxes[job.slot as usize] = bounds;
            }
        }
        hidden
    }

    /// The corners of triangles of any geometries.
    #[cold]
    fn corners_of_any(&self, triangles: &[u32; BLOCK]) -> [[Vec4; BLOCK]; 3] {
        let mut corners = [[Vec4::ZERO; BLOCK]; 3];
        for (lane, &triangle) in triangles.iter().enumerate() {
            let (geometry, primitive) = locate(self.starts, triangle);
            let places = self.geometries[geometry as usize].triangle(primitive as usize);
            for (lanes, place) in corners.iter_mut().zip(places) {
                lanes[lane] = place.extend(0.0);
            }
        }
        corners
    }
}

/// The triangles of a block; lanes that are not used repeat the first one.
#[inline(always)]
fn triangles_of(block: &Triangles4) -> [u32; BLOCK] {
    let first = TriangleId::of_lane(block, 0).triangle();
    let mut triangles = [first; BLOCK];
    for lane in 1..BLOCK {
        let id = TriangleId::of_lane(block, lane);
        triangles[lane] = if id == TriangleId::NONE { first } else { id.triangle() };
    }
    triangles
}

/// The corners of triangles of a mesh, given their vertices. `None` if the last of all vertices is among
/// them, behind which nothing can be read.
#[inline(always)]
fn corners_of(mesh: &TriangleMesh<'_>, vertices: &[[u32; 3]; BLOCK]) -> Option<[[Vec4; BLOCK]; 3]> {
    let numbers: &[f32] = bytemuck::cast_slice(mesh.positions);
    let mut corners = [[Vec4::ZERO; BLOCK]; 3];
    for lane in 0..BLOCK {
        let [a, b, c] = vertices[lane];
        corners[0][lane] = place(numbers, a)?;
        corners[1][lane] = place(numbers, b)?;
        corners[2][lane] = place(numbers, c)?;
    }
    if let Some(transform) = &mesh.transform {
        for corner in corners.as_flattened_mut() {
            *corner = transform.transform_point3(corner.truncate()).extend(0.0);
        }
    }
    Some(corners)
}

/// Where a vertex is; the last lane is meaningless.
#[inline(always)]
fn place(numbers: &[f32], index: u32) -> Option<Vec4> {
    let first = 3 * index as usize;
    Some(Vec4::from_slice(numbers.get(first..first + 4)?))
}

/// Writes a leaf; returns its box, unless some triangle might not be hit.
#[inline(always)]
fn rewrite(block: &mut Triangles4, corners: &[[Vec4; BLOCK]; 3]) -> Option<Bounds> {
    let [a, b, c] = corners;
    let mut bounds = Bounds::EMPTY;
    for lane in 0..BLOCK {
        bounds.grow(a[lane].min(b[lane]).min(c[lane]), a[lane].max(b[lane]).max(c[lane]));
    }
    // Added to a lane: NaN where there is no triangle; −0 changes nothing.
    let mut absent = [0.0; BLOCK];
    for (absent, &id) in absent.iter_mut().zip(&block.ids) {
        *absent = if id == TriangleId::NONE.word() { f32::NAN } else { -0.0 };
    }
    let absent = Vec4::from_array(absent);
    let rows = [rows_of(a), rows_of(b), rows_of(c)];
    for corner in 0..3 {
        for axis in 0..3 {
            block.vertices[corner][axis] = (rows[corner][axis] + absent).to_array();
        }
    }
    surely_hittable(&rows, &bounds).then_some(bounds)
}

/// Makes what cannot be hit NaN in a leaf; returns the box of the others and how many it was.
#[cold]
fn check_lanes(block: &mut Triangles4) -> (Bounds, usize) {
    let (mut bounds, mut hidden) = (Bounds::EMPTY, 0);
    for lane in 0..TriangleId::used_lanes(block) as usize {
        let corners = block.vertices.map(|rows| Vec3::from_array(rows.map(|row| row[lane])));
        match hittable(corners) {
            Some([a, b, c]) => bounds.grow(a.min(b).min(c), a.max(b).max(c)),
            None => {
                hidden += 1;
                block.vertices.iter_mut().flatten().for_each(|row| row[lane] = f32::NAN);
            }
        }
    }
    (bounds, hidden)
}

/// The coordinates of four corners.
#[inline(always)]
fn rows_of(corners: &[Vec4; BLOCK]) -> [Vec4; 3] {
    let [a, b, c, d] = *corners;
    let rows = Mat4::from_cols(a, b, c, d).transpose();
    [rows.x_axis, rows.y_axis, rows.z_axis]
}

/// Whether all four triangles, which are in a box unless they are not numbers, can be hit for sure, as
/// [`hittable`] decides.
#[inline(always)]
fn surely_hittable(rows: &[[Vec4; 3]; 3], bounds: &Bounds) -> bool {
    let [a, b, c] = rows;
    let (p, q) = (difference(b, a), difference(c, a));
    // Twice the area seen along each axis, and how much of it may be rounding. If the sum of the one
    // is greater than that of the other, it is for one axis at least; and what is not finite makes
    // the comparison false.
    let (x, y, z) = (products(&p, &q, 1, 2), products(&p, &q, 2, 0), products(&p, &q, 0, 1));
    let area = (x.0 - x.1).abs() + (y.0 - y.1).abs() + (z.0 - z.1).abs();
    let sizes = (x.0.abs() + x.1.abs()) + (y.0.abs() + y.1.abs()) + (z.0.abs() + z.1.abs());
    let has_area = area.cmpgt(sizes * ERROR.0 + Vec4::splat(ERROR.1));
    let limit = Vec4::splat(MAX_COORDINATE);
    let inside = bounds.lower.cmpge(-limit) & bounds.upper.cmple(limit);
    has_area.bitmask() == 0b1111 && inside.bitmask() & 0b111 == 0b111
}

/// [`AREA_ERROR`] of a sum over three axes, which is rounded, too.
const ERROR: (f32, f32) = (2.0 * AREA_ERROR.0, 4.0 * AREA_ERROR.1);

#[inline(always)]
fn difference(a: &[Vec4; 3], b: &[Vec4; 3]) -> [Vec4; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// What is subtracted for the area of triangles seen along an axis.
#[inline(always)]
fn products(p: &[Vec4; 3], q: &[Vec4; 3], i: usize, j: usize) -> (Vec4, Vec4) {
    (p[i] * q[j], p[j] * q[i])
}
