//! Codes of places along space-filling curves, and their parallel sort.
//!
//! Morton codes interleave the bits of a place's cell coordinates (Morton, "A computer oriented
//! geodetic data base", 1966); Hilbert codes follow a curve without jumps, by the transposition of
//! Skilling, "Programming the Hilbert curve", 2004. Sorting is a stable least-digit-first radix sort
//! with a histogram for each task (Zagha, Blelloch, "Radix sort for vector multiprocessors", 1991).
//!
//! Changed: Morton cells are cubes, not scaled copies of the scene's box, and bits that no place
//! can set are left out, so that long scenes spend their bits on their long axes (after Vinkler,
//! Bittner, Havran, "Extended Morton codes for high performance bounding volume hierarchy
//! construction", 2017). A key holds the code above the primitive's index, so keys are distinct
//! and their order is unique.

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use glam::Vec4;
use rayon::prelude::*;

use crate::Curve;

/// Bits of a code.
pub(crate) const CODE_BITS: u32 = 32;
const INDEX_BITS: u32 = 29;
/// The key of what is in no tree sorts behind all codes.
pub(crate) const INACTIVE: u64 = u64::MAX >> (63 - INDEX_BITS - CODE_BITS);
/// Bits of one axis, at most.
const AXIS_BITS: u32 = 16;
/// Bits of each axis of the Hilbert curve's cube.
const HILBERT_BITS: u32 = 10;

/// A grid over a box; gives keys to the places in it.
pub(crate) struct Grid {
    curve: Curve,
    lower: Vec4,
    scale: Vec4,
    limit: Vec4,
    /// Where the bits of the low and the high byte of each coordinate go.
    spread: Box<[[[u64; 256]; 2]; 3]>,
}

impl Grid {
    /// A grid over the box between two corners, of which w is ignored.
    pub(crate) fn new(lower: Vec4, upper: Vec4, curve: Curve) -> Self {
        let extent = (upper - lower).truncate().max(glam::Vec3::ZERO);
        let axes = match curve {
            Curve::Morton => interleave(extent),
            Curve::Hilbert => (0..3 * HILBERT_BITS as usize).map(|i| 2 - i % 3).collect(),
        };
        let bits = [0, 1, 2].map(|axis| axes.iter().filter(|&&a| a == axis).count() as u32);
        // The axis whose cells are largest sets the size of all.
        let cells = glam::Vec3::from_array(bits.map(|b| (1u32 << b) as f32));
        let scale = cells / extent;
        let scale = scale.min_element();
        let scale = if scale.is_finite() { scale } else { 0.0 };
        let mut spread = Box::new([[[0; 256]; 2]; 3]);
        let mut used = [0; 3];
        // From the least bit of the code.
        for (position, &axis) in axes.iter().enumerate() {
            let (byte, bit) = (used[axis] / 8, used[axis] % 8);
            for value in (0..256).filter(|value| value >> bit & 1 == 1) {
                spread[axis][byte][value] |= 1 << (INDEX_BITS as usize + position);
            }
            used[axis] += 1;
        }
        Self {
            curve,
            lower,
            scale: Vec4::new(scale, scale, scale, 0.0),
            limit: (cells - 1.0).extend(0.0),
            spread,
        }
    }

    /// The key of a primitive at a place; places outside count as the nearest inside.
    #[inline(always)]
    pub(crate) fn key(&self, place: Vec4, index: u32) -> u64 {
        let cell = ((place - self.lower) * self.scale).max(Vec4::ZERO).min(self.limit);
        let [mut x, mut y, mut z] = [cell.x as u32, cell.y as u32, cell.z as u32];
        if self.curve == Curve::Hilbert {
            [x, y, z] = hilbert([x, y, z]);
        }
        let spread = |axis: usize, value: u32| {
            let tables = &self.spread[axis];
            tables[0][value as usize & 255] | tables[1][value as usize >> 8 & 255]
        };
        spread(0, x) | spread(1, y) | spread(2, z) | u64::from(index)
    }
}

/// The axis of each bit of a Morton code, least bit first: from the top, each halves the longest
/// side of what is left.
fn interleave(extent: glam::Vec3) -> Vec<usize> {
    let mut side = extent;
    let mut used = [0; 3];
    let mut axes = Vec::with_capacity(CODE_BITS as usize);
    while axes.len() < CODE_BITS as usize {
        let open = |&axis: &usize| used[axis] < AXIS_BITS && side[axis] > 0.0;
        let Some(axis) = (0..3).filter(open).max_by(|&a, &b| side[a].total_cmp(&side[b])) else {
            break;
        };
        axes.push(axis);
        side[axis] *= 0.5;
        used[axis] += 1;
    }
    axes.reverse();
    axes
}

/// Coordinates whose interleaved bits, x first, are the distance along the Hilbert curve.
fn hilbert(mut x: [u32; 3]) -> [u32; 3] {
    let mut bit = 1 << (HILBERT_BITS - 1);
    while bit > 1 {
        let below = bit - 1;
        for axis in 0..3 {
            if x[axis] & bit != 0 {
                x[0] ^= below;
            } else {
                let swapped = (x[0] ^ x[axis]) & below;
                x[0] ^= swapped;
                x[axis] ^= swapped;
            }
        }
        bit >>= 1;
    }
    x[1] ^= x[0];
    x[2] ^= x[1];
    let mut flip = 0;
    let mut bit = 1 << (HILBERT_BITS - 1);
    while bit > 1 {
        if x[2] & bit != 0 {
            flip ^= bit - 1;
        }
        bit >>= 1;
    }
    x.map(|value| value ^ flip)
}

/// Keys, once sorted.
pub(crate) struct Keys(Vec<AtomicU64>);

const DIGIT_BITS: u32 = 11;
const DIGITS: usize = 1 << DIGIT_BITS;
/// Keys of one task of the sort.
const SORT_TASK: usize = 1 << 15;
/// Fewer keys than this are sorted by comparing.
const FEW: usize = 1 << 10;

impl Keys {
    /// Sorts keys and drops the inactive ones.
    pub(crate) fn sort(mut keys: Vec<AtomicU64>) -> Self {
        if keys.len() < FEW {
            keys.sort_unstable_by_key(|key| key.load(Relaxed));
        } else {
            let mut other: Vec<AtomicU64> = Vec::new();
            (0..keys.len()).into_par_iter().map(|_| AtomicU64::new(0)).collect_into_vec(&mut other);
            for shift in (INDEX_BITS..=INDEX_BITS + CODE_BITS).step_by(DIGIT_BITS as usize) {
                if sort_digit(&keys, &other, shift) {
                    std::mem::swap(&mut keys, &mut other);
                }
            }
        }
        let active = keys.partition_point(|key| key.load(Relaxed) < INACTIVE);
        keys.truncate(active);
        Self(keys)
    }

    pub(crate) fn len(&self) -> usize {
        self.0.len()
    }

    /// The index of the primitive at a place in the order.
    #[inline(always)]
    pub(crate) fn index(&self, at: usize) -> u32 {
        self.0[at].load(Relaxed) as u32 & ((1 << INDEX_BITS) - 1)
    }

    /// The code at a place in the order.
    #[inline(always)]
    pub(crate) fn code(&self, at: usize) -> u64 {
        self.0[at].load(Relaxed) >> INDEX_BITS
    }

    /// Where a part of the order, of at least two keys, divides at the highest bit in which its
    /// codes differ; `None` if they are all the same.
    #[inline]
    pub(crate) fn divide(&self, first: usize, end: usize) -> Option<usize> {
        let bit = (self.code(first) ^ self.code(end - 1)).checked_ilog2()?;
        let mask = 1u64 << (bit + INDEX_BITS);
        Some(first + self.0[first..end].partition_point(|key| key.load(Relaxed) & mask == 0))
    }
}

/// Moves keys to the order of one digit, if they are not in it; tells whether they moved.
fn sort_digit(from: &[AtomicU64], to: &[AtomicU64], shift: u32) -> bool {
    let digit = |key: u64| (key >> shift) as usize % DIGITS;
    let mut counts: Vec<Vec<u32>> = from
        .par_chunks(SORT_TASK)
        .map(|keys| {
            let mut counts = vec![0; DIGITS];
            for key in keys {
                counts[digit(key.load(Relaxed))] += 1;
            }
            counts
        })
        .collect();
    let mut next = 0;
    for digit in 0..DIGITS {
        let begin = next;
        for task in &mut counts {
            let count = task[digit];
            task[digit] = next;
            next += count;
        }
        if (next - begin) as usize == from.len() {
            return false;
        }
    }
    from.par_chunks(SORT_TASK).zip(counts).for_each(|(keys, mut places)| {
        for key in keys {
            let key = key.load(Relaxed);
            let place = &mut places[digit(key)];
            to[*place as usize].store(key, Relaxed);
            *place += 1;
        }
    });
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    fn code(grid: &Grid, place: [u32; 3]) -> u64 {
        let [x, y, z] = place.map(|c| c as f32 + 0.5);
        grid.key(Vec4::new(x, y, z, 0.0), 0) >> INDEX_BITS
    }

    #[test]
    fn a_morton_code_halves_the_longest_side_first() {
        let grid = Grid::new(Vec4::ZERO, Vec4::new(64.0, 4.0, 4.0, 0.0), Curve::Morton);
        let top = |place| code(&grid, place) >> (CODE_BITS - 4);
        // Four halvings of x alone.
        for x in 0..16 {
            assert_eq!(top([4 * x, 3, 1]), u64::from(x));
        }
        // A point has no bits to spend, and what is outside counts as the border.
        let point = Grid::new(Vec4::ONE, Vec4::ONE, Curve::Morton);
        assert_eq!(code(&point, [7, 8, 9]), 0);
        assert_eq!(code(&grid, [100, 4, 4]), code(&grid, [64, 4, 4]));
    }

    #[test]
    fn the_hilbert_curve_visits_every_cell_without_jumps() {
        let side = 1 << HILBERT_BITS;
        let grid = Grid::new(Vec4::ZERO, Vec4::splat(side as f32), Curve::Hilbert);
        let mut cells: Vec<(u64, [u32; 3])> = (0..16u32)
            .flat_map(|x| (0..16).flat_map(move |y| (0..16).map(move |z| [x, y, z])))
            .map(|cell| (code(&grid, cell), cell))
            .collect();
        cells.sort_unstable();
        for (pair, at) in cells.windows(2).zip(0..) {
            let steps: u32 = (0..3).map(|a| pair[0].1[a].abs_diff(pair[1].1[a])).sum();
            assert_eq!(steps, 1, "{at}: {pair:?}");
        }
        assert_eq!((cells[0].0, cells[4095].0), (0, 4095));
    }

    #[test]
    fn keys_are_sorted_and_inactive_ones_dropped() {
        for count in [0u64, 1, 2, 100, 1500, 200_000] {
            let mut state = 7u64;
            let mut plain: Vec<u64> = (0..count)
                .map(|i| {
                    state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                    // Many equal codes, and some of all bits.
                    let code = (state >> 33 & 0xFFFF_FFFF) >> (i % 3 * 14);
                    if i % 11 == 5 { INACTIVE } else { code << INDEX_BITS | i }
                })
                .collect();
            let keys = Keys::sort(plain.iter().map(|&key| AtomicU64::new(key)).collect());
            plain.sort_unstable();
            plain.retain(|&key| key != INACTIVE);
            let sorted: Vec<u64> = keys.0.iter().map(|key| key.load(Relaxed)).collect();
            assert_eq!(sorted, plain);
        }
    }
}
