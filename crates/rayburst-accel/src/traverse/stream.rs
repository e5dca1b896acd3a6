//! Rays of a batch in an order in which neighbours need the same memory.
//!
//! Rays are sorted by a key of quantised origin and direction, in pieces that fit into a cache, and go
//! into flight in that order (Boulos, Wald, Benthin, "Adaptive ray packet reordering", 2008; Garanzha,
//! Loop, "Fast ray sorting and breadth-first packet traversal for GPU ray tracing", 2010; keys compared
//! by Meister, Bogolepov, Guthe, Bittner, "On ray reordering techniques for faster GPU ray tracing",
//! 2020).
//!
//! Changed: the key is short, since a piece has few rays: the signs of the direction above a Morton
//! code of the origin, so that two passes of a radix sort are enough. Longer keys, more of the
//! direction, and the direction first gained no more in tracing than they cost in sorting. Sorted rays
//! stay single: as bundles they are slower than before, since rays that start close to each other and
//! share signs still go different ways.

use std::cell::Cell;

use glam::Vec3;
use rayburst_math::Ray;

use super::prepare::MAX_ORIGIN;

/// Rays that are sorted at a time.
pub(crate) const PIECE: usize = 1 << INDEX_BITS;
const INDEX_BITS: u32 = 16;
/// Bits of an axis of the origin.
const AXIS_BITS: u32 = 6;
/// Bits that a pass sorts by; two passes sort by a key.
const DIGIT_BITS: u32 = 11;
const DIGITS: usize = 1 << DIGIT_BITS;

/// Keys above indices, in the order of a pass and of the next.
type Keys = [Vec<u64>; 2];

thread_local! {
    /// Memory of the sort, kept between batches.
    static KEYS: Cell<Keys> = const { Cell::new([vec![], vec![]]) };
}

/// Appends the indices of a piece of a batch that starts at `first` to `order`, sorted.
///
/// Not inlined: once for thousands of rays, and there is nothing for wide registers to do.
#[inline(never)]
pub(crate) fn sort(piece: &[Ray], first: u32, order: &mut Vec<u32>) {
    let mut keys = KEYS.take();
    let [from, to] = &mut keys;
    let grid = Grid::around(piece);
    let mut ends = [[0; DIGITS]; 2];
    from.clear();
    for (index, ray) in (0..).zip(piece) {
        let key = grid.key(ray);
        let [low, high] = &mut ends;
        low[digit(key, 0)] += 1;
        high[digit(key, 1)] += 1;
        from.push(u64::from(key) << INDEX_BITS | index);
    }
    // Every place is written by the first pass.
    to.resize(piece.len(), 0);
    for (pass, ends) in (0..).zip(&mut ends) {
        let mut sum = 0;
        for end in ends.iter_mut() {
            sum += std::mem::replace(end, sum);
        }
        for &entry in from.iter() {
            let place = &mut ends[digit((entry >> INDEX_BITS) as u32, pass)];
            to[*place] = entry;
            *place += 1;
        }
        std::mem::swap(from, to);
    }
    order.extend(from.iter().map(|&entry| first + (entry as u32 & (PIECE - 1) as u32)));
    KEYS.set(keys);
}

#[inline(always)]
fn digit(key: u32, pass: u32) -> usize {
    (key >> (pass * DIGIT_BITS)) as usize % DIGITS
}

/// A grid over the origins of a piece.
struct Grid {
    lower: Vec3,
    scale: Vec3,
}

impl Grid {
    fn around(piece: &[Ray]) -> Self {
        let (mut lower, mut upper) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for ray in piece {
            // Rays from nowhere have no say.
            let able = ray.origin.abs().cmple(Vec3::splat(MAX_ORIGIN));
            lower = lower.min(Vec3::select(able, ray.origin, lower));
            upper = upper.max(Vec3::select(able, ray.origin, upper));
        }
        let scale = (1u32 << AXIS_BITS) as f32 / (upper - lower);
        let scale = Vec3::select(scale.is_finite_mask(), scale, Vec3::ZERO);
        Self { lower, scale }
    }

    /// A ray's key; those of invalid rays are any.
    #[inline(always)]
    fn key(&self, ray: &Ray) -> u32 {
        // Conversion saturates, and makes a NaN a 0.
        let cell = ((ray.origin - self.lower) * self.scale).to_array();
        let [x, y, z] = cell.map(|cell| spread((cell as u32).min((1 << AXIS_BITS) - 1)));
        let [a, b, c] = ray.direction.to_array().map(|d| d.to_bits() >> 31);
        (a << 2 | b << 1 | c) << (3 * AXIS_BITS) | x << 2 | y << 1 | z
    }
}

/// The bits of a coordinate, two places after each.
#[inline(always)]
fn spread(x: u32) -> u32 {
    let x = (x | x << 8) & 0x0000_F00F;
    let x = (x | x << 4) & 0x000C_30C3;
    (x | x << 2) & 0x0024_9249
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sorted(rays: &[Ray]) -> Vec<u32> {
        let mut order = vec![];
        sort(rays, 100, &mut order);
        order
    }

    #[test]
    fn every_ray_has_one_place() {
        assert_eq!(sorted(&[]), []);
        let odd = [f32::NAN, f32::INFINITY, -3.0, 0.0, 1e-40, f32::MAX, -f32::MAX, 7.0, 1e30];
        for count in [1, 2, 100, PIECE] {
            let ray = |i: usize| {
                let at = |k: usize| odd[(i * k + i / 7) % odd.len()];
                Ray::new(Vec3::new(at(1), at(2), at(5)), Vec3::new(at(4), at(3), -at(1)))
            };
            let rays: Vec<Ray> = (0..count).map(ray).collect();
            let mut order = sorted(&rays);
            let grid = Grid::around(&rays);
            let keys: Vec<u32> = order.iter().map(|&i| grid.key(&rays[i as usize - 100])).collect();
            assert!(keys.is_sorted() && keys.iter().all(|&key| key < 1 << 21));
            order.sort_unstable();
            assert!(order.into_iter().eq((100..).take(count)));
        }
    }

    #[test]
    fn neighbours_go_the_same_way_from_the_same_place() {
        assert_eq!(spread(0b11_1111), 0b001_001_001_001_001_001);
        let mut rays = vec![];
        for i in 0..64u32 {
            let at = |shift: u32| (i >> shift & 3) as f32;
            for sign in [1.0, -1.0] {
                let direction = Vec3::new(sign, 0.3, sign * at(0));
                rays.push(Ray::new(Vec3::new(at(0), at(2), at(4)), direction));
            }
        }
        let order = sorted(&rays);
        let of = |at: usize| &rays[order[at] as usize - 100];
        // First all that go one way; of those, eight at a time from a cube of cells.
        assert!((0..64).all(|i| of(i).direction.x > 0.0));
        for cube in 0..16 {
            let origins: Vec<Vec3> = (8 * cube..8 * cube + 8).map(|i| of(i).origin).collect();
            assert!(origins.iter().all(|o| (*o - origins[0]).abs().max_element() <= 1.0));
        }
        // Rays of the same key stay in their order.
        assert_eq!(sorted(&[rays[0]; 5]), [100, 101, 102, 103, 104]);
    }
}
