//! Leaves written anew from vertices that moved.
//!
//! A leaf tells its triangles, these their vertices, and these their places: a chain of loads, each of
//! which may wait for memory. So leaves are worked on in batches: what a step needs is asked for in the
//! step before, for all leaves of the batch.

use glam::{BVec4A, Mat4, Vec3, Vec4};
use rayburst_simd::{Isa, Triangles4};

use crate::{
    MAX_COORDINATE, TriangleMesh,
    build::triangle_keys::{AREA_ERROR, hittable},
    layout::{
        arena::Line,
        curve_leaves::{Bounds, LEAF_WORDS},
        triangles::{BLOCK, TriangleId},
    },
};

/// Leaves of a batch.
pub(super) const BATCH: usize = 32;

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

/// A triangle's vertices; at first only its place among those of its geometry.
#[derive(Clone, Copy, Default)]
struct Vertices {
    geometry: u32,
    corners: [u32; 3],
}

/// The triangle that was looked up last, with the numbers of its geometry's triangles.
struct Finder<'a> {
    source: Source<'a>,
    geometry: usize,
    first: u32,
    end: u32,
}

impl<'a> Finder<'a> {
    fn new(source: Source<'a>) -> Self {
        Self { source, geometry: 0, first: 0, end: 0 }
    }

    /// The geometry and primitive of a triangle.
    #[inline(always)]
    fn find(&mut self, triangle: u32) -> (usize, u32) {
        if triangle < self.first || triangle >= self.end {
            let starts = self.source.starts;
            self.geometry = starts.partition_point(|&start| start <= triangle) - 1;
            self.first = starts[self.geometry];
            self.end = starts.get(self.geometry + 1).copied().unwrap_or(u32::MAX);
        }
        (self.geometry, triangle - self.first)
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
        let words: &mut [u32] = bytemuck::cast_slice_mut(lines);
        let mut hidden = 0;
        let mut vertices = [[Vertices::default(); BLOCK]; BATCH];
        for batch in jobs.chunks(BATCH) {
            for (job, vertices) in batch.iter().zip(&mut vertices) {
                let block = block_of(words, first_line, job);
                let first = TriangleId::of_lane(block, 0);
                for lane in 0..BLOCK {
                    let id = TriangleId::of_lane(block, lane);
                    // Lanes that are not used repeat the first triangle.
                    let id = if id == TriangleId::NONE { first } else { id };
                    let (geometry, primitive) = finder.find(id.triangle());
                    let indices = self.geometries[geometry].indices.as_ptr();
                    isa.prefetch(indices.wrapping_add(primitive as usize));
                    vertices[lane] =
                        Vertices { geometry: geometry as u32, corners: [primitive; 3] };
                }
            }
            for vertices in &mut vertices[..batch.len()] {
                for Vertices { geometry, corners } in vertices {
                    let mesh = &self.geometries[*geometry as usize];
                    *corners = mesh.indices[corners[0] as usize];
                    let positions = mesh.positions.as_ptr();
                    isa.prefetch(positions.wrapping_add(corners[0] as usize));
                    isa.prefetch(positions.wrapping_add(corners[1] as usize));
                    isa.prefetch(positions.wrapping_add(corners[2] as usize));
                }
            }
            for (job, vertices) in batch.iter().zip(&vertices) {
                let block = block_of(words, first_line, job);
                let (bounds, lost) = self.rewrite(block, vertices);
                boxes[job.slot as usize] = bounds;
                hidden += lost;
            }
        }
        hidden
    }

    /// Writes a leaf; returns its box and how many of its triangles cannot be hit.
    #[inline(always)]
    fn rewrite(&self, block: &mut Triangles4, vertices: &[Vertices; BLOCK]) -> (Bounds, usize) {
        let mut bounds = Bounds::EMPTY;
        let mut corners = [[Vec4::ZERO; BLOCK]; 3];
        for lane in 0..BLOCK {
            let Vertices { geometry, corners: [a, b, c] } = vertices[lane];
            let mesh = &self.geometries[geometry as usize];
            let (a, b, c) = (place(mesh, a), place(mesh, b), place(mesh, c));
            bounds.grow(a.min(b).min(c), a.max(b).max(c));
            (corners[0][lane], corners[1][lane], corners[2][lane]) = (a, b, c);
        }
        // Added to a lane: NaN where there is no triangle; −0 changes nothing.
        let mut absent = [0.0; BLOCK];
        for (absent, &id) in absent.iter_mut().zip(&block.ids) {
            *absent = if id == TriangleId::NONE.word() { f32::NAN } else { -0.0 };
        }
        let absent = Vec4::from_array(absent);
        let [a, b, c] = &corners;
        let rows = [rows_of(a, absent), rows_of(b, absent), rows_of(c, absent)];
        for corner in 0..3 {
            for axis in 0..3 {
                block.vertices[corner][axis] = rows[corner][axis].to_array();
            }
        }
        let used = TriangleId::used_lanes(block);
        if surely_hittable(&rows) == (1 << used) - 1 {
            return (bounds, 0);
        }
        self.careful_rewrite(block, &vertices[..used as usize])
    }

    /// A leaf some of whose triangles might not be hit.
    #[cold]
    fn careful_rewrite(&self, block: &mut Triangles4, vertices: &[Vertices]) -> (Bounds, usize) {
        let (mut bounds, mut hidden) = (Bounds::EMPTY, 0);
        for (lane, vertices) in vertices.iter().enumerate() {
            let mesh = &self.geometries[vertices.geometry as usize];
            let corners = vertices.corners.map(|index| place(mesh, index).truncate());
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
}

/// The block of a leaf, given the words from some line on.
#[inline(always)]
fn block_of<'w>(words: &'w mut [u32], first_line: usize, job: &Job) -> &'w mut Triangles4 {
    let first = (job.half_line as usize - 2 * first_line) * 8;
    &mut bytemuck::cast_slice_mut(&mut words[first..first + LEAF_WORDS])[0]
}

/// Where a vertex is; the last lane is meaningless.
#[inline(always)]
fn place(mesh: &TriangleMesh<'_>, index: u32) -> Vec4 {
    let numbers: &[f32] = bytemuck::cast_slice(mesh.positions);
    let first = 3 * index as usize;
    let place = match numbers.get(first..first + 4) {
        Some(numbers) => Vec4::from_slice(numbers),
        // The last vertex of all.
        None => mesh.positions[index as usize].extend(0.0),
    };
    match &mesh.transform {
        None => place,
        Some(transform) => {
            let [x, y, z, _] = place.to_array();
            transform.transform_point3(Vec3::new(x, y, z)).extend(0.0)
        }
    }
}

/// The coordinates of four corners, something added.
#[inline(always)]
fn rows_of(corners: &[Vec4; BLOCK], more: Vec4) -> [Vec4; 3] {
    let [a, b, c, d] = *corners;
    let rows = Mat4::from_cols(a, b, c, d).transpose();
    [rows.x_axis + more, rows.y_axis + more, rows.z_axis + more]
}

/// The lanes whose triangles can be hit for sure, as [`hittable`] decides; the others may be.
#[inline(always)]
fn surely_hittable(rows: &[[Vec4; 3]; 3]) -> u32 {
    let [a, b, c] = rows;
    let (p, q) = (difference(b, a), difference(c, a));
    let has_area = has_area(&p, &q, 1, 2) | has_area(&p, &q, 2, 0) | has_area(&p, &q, 0, 1);
    // False for NaN.
    let inside = (length(a) + length(b) + length(c)).cmple(Vec4::splat(MAX_COORDINATE));
    (inside & has_area).bitmask()
}

#[inline(always)]
fn difference(a: &[Vec4; 3], b: &[Vec4; 3]) -> [Vec4; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
fn length(a: &[Vec4; 3]) -> Vec4 {
    a[0].abs() + a[1].abs() + a[2].abs()
}

/// The lanes of triangles whose area, seen along an axis, is not zero for sure.
#[inline(always)]
fn has_area(p: &[Vec4; 3], q: &[Vec4; 3], i: usize, j: usize) -> BVec4A {
    let (first, second) = (p[i] * q[j], p[j] * q[i]);
    let error = (first.abs() + second.abs()) * AREA_ERROR.0 + Vec4::splat(AREA_ERROR.1);
    (first - second).abs().cmpgt(error)
}
