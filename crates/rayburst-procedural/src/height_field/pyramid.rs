//! Smallest and largest heights of blocks of cells.

/// Level `k` holds the ranges of blocks of `2^k` by `2^k` cells, from 1 up to one block that holds
/// all; those of single cells are their four heights.
#[derive(Clone, Debug)]
pub(super) struct Pyramid {
    levels: Vec<Level>,
}

#[derive(Clone, Debug)]
struct Level {
    columns: usize,
    ranges: Vec<[f32; 2]>,
}

impl Pyramid {
    pub(super) fn new(columns: usize, rows: usize, heights: &[f32]) -> Self {
        let (mut width, mut depth) = (columns - 1, rows - 1);
        let mut levels: Vec<Level> = Vec::new();
        while width > 1 || depth > 1 {
            let (below_width, below_depth) = (width, depth);
            (width, depth) = (width.div_ceil(2), depth.div_ceil(2));
            let mut ranges = Vec::with_capacity(width * depth);
            for z in 0..depth {
                for x in 0..width {
                    let mut range = [f32::INFINITY, f32::NEG_INFINITY];
                    for zz in 2 * z..(2 * z + 2).min(below_depth) {
                        for xx in 2 * x..(2 * x + 2).min(below_width) {
                            let [a, b] = match levels.last() {
                                Some(level) => level.ranges[zz * level.columns + xx],
                                None => cell_range(&cell_heights(columns, heights, xx, zz)),
                            };
                            range = [range[0].min(a), range[1].max(b)];
                        }
                    }
                    ranges.push(range);
                }
            }
            levels.push(Level { columns: width, ranges });
        }
        Self { levels }
    }

    /// The level of the one block that holds all cells.
    pub(super) fn top(&self) -> usize {
        self.levels.len()
    }

    /// The range of the block that holds the cell, on a level above 0.
    pub(super) fn range(&self, level: usize, x: usize, z: usize) -> [f32; 2] {
        let Level { columns, ranges } = &self.levels[level - 1];
        ranges[(z >> level) * columns + (x >> level)]
    }
}

/// Heights of a cell's corners: at (x, z), (x + 1, z), (x, z + 1), (x + 1, z + 1).
pub(super) fn cell_heights(columns: usize, heights: &[f32], x: usize, z: usize) -> [f32; 4] {
    let i = z * columns + x;
    [heights[i], heights[i + 1], heights[i + columns], heights[i + columns + 1]]
}

pub(super) fn cell_range(h: &[f32; 4]) -> [f32; 2] {
    [h[0].min(h[1]).min(h[2].min(h[3])), h[0].max(h[1]).max(h[2].max(h[3]))]
}
