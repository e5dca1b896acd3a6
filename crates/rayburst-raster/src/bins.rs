//! Bins: squares of the picture that one thread fills at a time, and how near what they show is.
//!
//! For each tile of 8×8 pixels a bin knows the least nearness it shows: what is farther everywhere is
//! hidden there (after Greene, Kass, Miller, "Hierarchical Z-buffer visibility", 1993).

use rayburst_simd::{PixelPlanes, PixelTile};

/// Pixels along a side of a bin.
pub(crate) const BIN: u32 = 64;
/// Pixels along a side of a tile.
pub(crate) const TILE: u32 = 8;
/// Tiles along a side of a bin.
pub(crate) const TILES: u32 = BIN / TILE;
/// What a pixel's number of a triangle is if it shows nothing.
pub(crate) const NOTHING: u32 = u32::MAX;

/// How a picture is cut into bins.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct BinGrid {
    pub(crate) columns: u32,
    pub(crate) rows: u32,
}

impl BinGrid {
    pub(crate) fn new((width, height): (u32, u32)) -> Self {
        Self { columns: width.div_ceil(BIN), rows: height.div_ceil(BIN) }
    }

    pub(crate) fn count(&self) -> usize {
        self.columns as usize * self.rows as usize
    }
}

/// One of them.
#[derive(Clone, Debug)]
pub(crate) struct Bin {
    pub(crate) tiles: [PixelTile; (TILES * TILES) as usize],
    /// The least nearness in each tile, or less.
    pub(crate) least: [f32; (TILES * TILES) as usize],
    /// Pixels written since `least` was found.
    pub(crate) written: [u32; (TILES * TILES) as usize],
    /// Pixels of each tile, as bits, where triangles are as near as the one that is seen, but for rounding.
    pub(crate) contested: [u64; (TILES * TILES) as usize],
}

/// After so many pixels a tile's least nearness is found anew when it is asked for.
const STALE: u32 = 32;

impl Bin {
    pub(crate) fn new() -> Self {
        let count = (TILES * TILES) as usize;
        let tile = PixelTile { nearness: [0.0; 64], ids: [NOTHING; 64] };
        let tiles = [tile; (TILES * TILES) as usize];
        debug_assert_eq!(tiles.len(), count);
        Self {
            tiles,
            least: [0.0; (TILES * TILES) as usize],
            contested: [0; (TILES * TILES) as usize],
            written: [0; (TILES * TILES) as usize],
        }
    }

    pub(crate) fn clear(&mut self, empty: f32, ids: bool) {
        for tile in &mut self.tiles {
            tile.nearness.fill(empty);
            if ids {
                tile.ids.fill(NOTHING);
            }
        }
        self.least.fill(empty);
        self.contested.fill(0);
        self.written.fill(0);
    }

    /// No more than the least nearness in a tile: what is farther is not even as near but for rounding.
    #[inline(always)]
    pub(crate) fn least(&mut self, tile: usize) -> f32 {
        if self.written[tile] >= STALE {
            self.find_least(tile);
        }
        let least = self.least[tile];
        least - least.abs() * (2.0 * PixelPlanes::CLOSE)
    }

    #[inline(always)]
    fn find_least(&mut self, tile: usize) {
        let mut rows = [f32::INFINITY; 8];
        let (seen, _) = self.tiles[tile].nearness.as_chunks::<8>();
        for row in seen {
            for (least, &nearness) in rows.iter_mut().zip(row) {
                *least = if nearness < *least { nearness } else { *least };
            }
        }
        let mut least = f32::INFINITY;
        for nearness in rows {
            least = if nearness < least { nearness } else { least };
        }
        (self.least[tile], self.written[tile]) = (least, 0);
    }

    /// Finds the least nearness of all tiles that were written to.
    #[inline(always)]
    pub(crate) fn settle(&mut self) {
        for tile in 0..self.tiles.len() {
            if self.written[tile] > 0 {
                self.find_least(tile);
            }
        }
    }
}
