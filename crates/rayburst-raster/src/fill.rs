//! The second half of the work: a bin's triangles, pixel by pixel.

use std::sync::atomic::{AtomicBool, Ordering};

use glam::{DVec2, Vec3, Vec4};
use rayburst_simd::{Isa, PixelPlanes, PixelTile, TilePart};

use crate::{
    Candidate, Coverage, Mesh,
    bins::{BIN, Bin, TILE, TILES},
    mesh::Placed,
    planes::Planes,
    project::{Chunk, Record, TRANSLUCENT},
    rasteriser::Visible,
};

/// What filling a bin needs to know.
pub(crate) struct Filling<'a, C> {
    pub(crate) chunks: &'a [Chunk],
    pub(crate) meshes: &'a [Mesh<'a>],
    pub(crate) placed: &'a [Placed],
    /// What the sources of records count.
    pub(crate) clusters: &'a [Visible],
    /// Whether they were seen when they were drawn.
    pub(crate) shown: &'a [AtomicBool],
    pub(crate) coverage: &'a C,
    pub(crate) width: u32,
}

impl<C: Coverage> Filling<'_, C> {
    /// Adds all chunks' triangles to the bin in this column and row; `first` is the centre of its first pixel.
    #[inline(always)]
    pub(crate) fn fill<I: Isa, const PERSPECTIVE: bool, const IDS: bool>(
        &self,
        isa: I,
        bin: &mut Bin,
        (column, row, index): (u32, u32, usize),
        first: DVec2,
    ) {
        for chunk in self.chunks {
            for &record in chunk.of_bin(index) {
                let record = &chunk.records[record as usize];
                self.add::<I, PERSPECTIVE, IDS>(isa, bin, (column * BIN, row * BIN), first, record);
            }
        }
    }

    #[inline(always)]
    fn add<I: Isa, const PERSPECTIVE: bool, const IDS: bool>(
        &self,
        isa: I,
        bin: &mut Bin,
        corner: (u32, u32),
        first: DVec2,
        record: &Record,
    ) {
        let clip = |first: u16, last: u16, start: u32| {
            (u32::from(first).max(start) - start, (u32::from(last) - start).min(BIN - 1))
        };
        let (x0, x1) = clip(record.first[0], record.last[0], corner.0);
        let (y0, y1) = clip(record.first[1], record.last[1], corner.1);
        let (left, right, top, bottom) = (x0 / TILE, x1 / TILE, y0 / TILE, y1 / TILE);
        let [a, b, c] = &record.corners;
        let nearest = a.w.max(b.w).max(c.w);
        let single = left == right && top == bottom;
        if single && nearest < bin.least((top * TILES + left) as usize % 64) {
            return;
        }
        let Some(planes) = Planes::new::<I, PERSPECTIVE>(isa, &record.corners, first) else {
            return;
        };
        let pixels = [x0, y0, x1, y1];
        // By itself, so that nothing is prepared for tiles that do not follow.
        if single {
            self.cover::<I, PERSPECTIVE, IDS>(
                isa,
                bin,
                corner,
                &planes,
                record,
                (left, top),
                pixels,
            );
            return;
        }
        let mut tile_row = top;
        while tile_row <= bottom {
            let mut tile_column = left;
            while tile_column <= right {
                let tile = (tile_row * TILES + tile_column) as usize % 64;
                let at = (tile_column * TILE, tile_row * TILE);
                if may_cover(&planes, at, nearest, bin.least(tile)) {
                    let at = (tile_column, tile_row);
                    self.cover::<I, PERSPECTIVE, IDS>(
                        isa, bin, corner, &planes, record, at, pixels,
                    );
                }
                tile_column += 1;
            }
            tile_row += 1;
        }
    }

    /// Covers a tile, but no pixels outside of the first and the last.
    #[inline(always)]
    fn cover<I: Isa, const PERSPECTIVE: bool, const IDS: bool>(
        &self,
        isa: I,
        bin: &mut Bin,
        corner: (u32, u32),
        planes: &Planes,
        record: &Record,
        tile: (u32, u32),
        [x0, y0, x1, y1]: [u32; 4],
    ) {
        let at = (tile.0 * TILE, tile.1 * TILE);
        let part = TilePart {
            first: [at.0 as f32, at.1 as f32],
            columns: [x0.max(at.0) - at.0, x1.min(at.0 + TILE - 1) - at.0],
            rows: [y0.max(at.1) - at.1, y1.min(at.1 + TILE - 1) - at.1],
        };
        let number = (tile.1 * TILES + tile.0) as usize % 64;
        let tile = &mut bin.tiles[number];
        let (pixels, triangle) = (&planes.pixels, planes.triangle());
        let (covered, close) = if record.source & TRANSLUCENT == 0 {
            let [covered, close] =
                isa.cover_tile::<IDS, true>(pixels, &triangle, &part, record.id, tile);
            (covered, close)
        } else {
            let [open, close] =
                isa.cover_tile::<IDS, false>(pixels, &triangle, &part, record.id, tile);
            let at = (corner.0 + at.0, corner.1 + at.1);
            let covered = self.ask::<PERSPECTIVE, IDS>(tile, open, at, planes, &part, record);
            (covered, close & (covered | !open))
        };
        if IDS && (covered | close) != 0 {
            let contested = &mut bin.contested[number];
            *contested = *contested & !covered | close;
        }
        if covered != 0 {
            bin.written[number] += covered.count_ones();
            let shown = &self.shown[(record.source & !TRANSLUCENT) as usize];
            if !shown.load(Ordering::Relaxed) {
                shown.store(true, Ordering::Relaxed);
            }
        }
    }

    /// Covers those of the `open` pixels of a tile where the caller says so; `at` is the tile's first pixel.
    #[inline(never)]
    fn ask<const PERSPECTIVE: bool, const IDS: bool>(
        &self,
        tile: &mut PixelTile,
        mut open: u64,
        at: (u32, u32),
        planes: &Planes,
        part: &TilePart,
        record: &Record,
    ) -> u64 {
        let mut covered = 0;
        let number = self.clusters[(record.source & !TRANSLUCENT) as usize].mesh;
        let (placed, mesh) = (&self.placed[number as usize], &self.meshes[number as usize]);
        while open != 0 {
            let pixel = open.trailing_zeros();
            open &= open - 1;
            let (column, row) = (pixel % TILE, pixel / TILE);
            let (fx, fy) = (part.first[0] + column as f32, part.first[1] + row as f32);
            let nearness = planes.pixels.nearness(fx, fy);
            let (u, v) = planes.barycentric(fx, fy);
            let candidate = Candidate {
                depth: depth::<PERSPECTIVE>(nearness),
                u,
                v,
                mesh: number,
                instance: mesh.instance,
                geometry: mesh.geometry,
                primitive: record.id - placed.first_id,
                front: planes.counter_clockwise() != placed.mirrored,
            };
            let pixel_number = (at.1 + row) * self.width + at.0 + column;
            if self.coverage.covers(pixel_number, &candidate) {
                tile.nearness[pixel as usize] = nearness;
                if IDS {
                    tile.ids[pixel as usize] = record.id;
                }
                covered |= 1 << pixel;
            }
        }
        covered
    }
}

/// The depth of a nearness.
#[inline(always)]
pub(crate) fn depth<const PERSPECTIVE: bool>(nearness: f32) -> f32 {
    if PERSPECTIVE { 1.0 / nearness } else { -nearness }
}

/// Whether a triangle may be seen in a tile: not if an edge function is out of bounds at the corner where it is
/// greatest, nor if nearness there is less than the tile's least.
#[inline(always)]
fn may_cover(planes: &Planes, at: (u32, u32), nearest: f32, least: f32) -> bool {
    let pixels = &planes.pixels;
    let (px, py) = (Vec4::from(pixels.x), Vec4::from(pixels.y));
    let (near, far) = (Vec4::splat(at.0 as f32), Vec4::splat((at.0 + TILE - 1) as f32));
    let x = Vec4::select(px.cmpgt(Vec4::ZERO), far, near);
    let (near, far) = (Vec4::splat(at.1 as f32), Vec4::splat((at.1 + TILE - 1) as f32));
    let y = Vec4::select(py.cmpgt(Vec4::ZERO), far, near);
    let greatest = (Vec4::from(pixels.at_origin) + py * y) + px * x;
    let doubt = Vec3::splat(-PixelPlanes::DOUBT);
    greatest.cmpge(doubt.extend(least)).all() && nearest >= least
}
