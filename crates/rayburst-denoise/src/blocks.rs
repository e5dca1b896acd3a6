//! Which blocks of pixels a filter of shares has anything to do in: where only open or only blocked rays are
//! within its reach, it changes nothing.

use rayon::prelude::*;

use crate::{
    lanes::{LANES, greater, lesser},
    scratch::BAND,
};

/// Bits of a block's kind: shares above zero, shares below one.
const OPEN: u8 = 1;
const BLOCKED: u8 = 2;

/// Blocks of [`LANES`] pixels by [`BAND`] rows of a picture of shares between 0 and 1.
#[derive(Clone, Debug, Default)]
pub(crate) struct Blocks {
    columns: usize,
    kinds: Vec<u8>,
    changes: Vec<bool>,
}

impl Blocks {
    /// Makes place for a picture.
    pub(crate) fn resize(&mut self, size: (u32, u32)) {
        let rows = (size.1 as usize).div_ceil(BAND);
        self.columns = (size.0 as usize).div_ceil(LANES);
        self.kinds.resize(self.columns * rows, 0);
        self.changes.resize(self.columns * rows, false);
    }

    /// The kinds of a band's blocks, to be found in parallel: zero at first, then by [`note`].
    pub(crate) fn kinds_mut(&mut self) -> rayon::slice::ChunksMut<'_, u8> {
        self.kinds.fill(0);
        self.kinds.par_chunks_mut(self.columns.max(1))
    }

    /// Finds the blocks that have both kinds of shares within a reach in pixels.
    pub(crate) fn classify(&mut self, reach: f32) {
        let (columns, kinds) = (self.columns.max(1), &self.kinds);
        let rows = kinds.len() / columns;
        let across = (reach / LANES as f32).ceil() as usize;
        let down = (reach / BAND as f32).ceil() as usize;
        self.changes.par_chunks_mut(columns).enumerate().for_each(|(j, changes)| {
            for (i, changes) in changes.iter_mut().enumerate() {
                let mut kind = 0;
                for row in j.saturating_sub(down)..=(j + down).min(rows - 1) {
                    for column in i.saturating_sub(across)..=(i + across).min(columns - 1) {
                        kind |= kinds[row * columns + column];
                    }
                }
                *changes = kind == OPEN | BLOCKED;
            }
        });
    }

    /// Whether a block has anything to filter, by a row and the block's number in it.
    #[inline(always)]
    pub(crate) fn changes(&self, y: usize, block: usize) -> bool {
        self.changes[y / BAND * self.columns + block]
    }
}

/// Adds a row of shares to the kinds of its blocks.
#[inline(always)]
pub(crate) fn note(kinds: &mut [u8], row: &[f32]) {
    for block in 0..kinds.len() {
        let end = (block + 1) * LANES;
        let end = if end < row.len() { end } else { row.len() };
        let (mut least, mut most) = (1.0f32, 0.0f32);
        for x in block * LANES..end {
            least = lesser(row[x], least);
            most = greater(row[x], most);
        }
        kinds[block] |= if most > 0.0 { OPEN } else { 0 } | if least < 1.0 { BLOCKED } else { 0 };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_change_where_both_kinds_are_in_reach() {
        let mut blocks = Blocks::default();
        blocks.resize((70, 30));
        // Five by four blocks: only one pixel is blocked, in the last block of the second row.
        blocks.kinds_mut().enumerate().for_each(|(j, kinds)| {
            let mut row = [1.0; 70];
            note(kinds, &row);
            row[69] = if j == 1 { 0.0 } else { 1.0 };
            note(kinds, &row);
        });
        blocks.classify(1.0);
        for block in 0..5 {
            assert_eq!(blocks.changes(0, block), block >= 3);
            assert!(!blocks.changes(29, block));
        }
        blocks.classify(0.0);
        assert!(blocks.changes(8, 4) && !blocks.changes(8, 3) && !blocks.changes(7, 4));
    }
}
