//! Partition of primitives without branches on where they go, in parallel for many.

use rayon::prelude::*;

use super::primitives::PrimitiveRef;

/// Slices of more primitives are partitioned by several tasks, this many primitives each.
pub(super) const CHUNK: usize = 1 << 16;

/// Moves the primitives that go left to the front; returns their number.
pub(super) fn partition(
    refs: &mut [PrimitiveRef],
    goes_left: impl Fn(&PrimitiveRef) -> bool + Copy + Sync,
) -> usize {
    if refs.len() <= CHUNK {
        return partition_chunk(refs, goes_left);
    }
    let lefts: Vec<usize> =
        refs.par_chunks_mut(CHUNK).map(|chunk| partition_chunk(chunk, goes_left)).collect();
    let middle = lefts.iter().sum();
    gather(refs, &lefts, middle);
    middle
}

fn partition_chunk(refs: &mut [PrimitiveRef], goes_left: impl Fn(&PrimitiveRef) -> bool) -> usize {
    let mut middle = 0;
    for i in 0..refs.len() {
        let reference = refs[i];
        let left = goes_left(&refs[i]);
        refs[i] = refs[middle];
        refs[middle] = reference;
        middle += usize::from(left);
    }
    middle
}

/// Swaps the right parts of chunks before the middle with the left parts of chunks behind it.
fn gather(refs: &mut [PrimitiveRef], lefts: &[usize], middle: usize) {
    let count = refs.len();
    let (front, back) = refs.split_at_mut(middle);
    let rights = lefts.iter().enumerate().flat_map(|(chunk, &left)| {
        chunk * CHUNK + left..((chunk + 1) * CHUNK).min(count).min(middle)
    });
    let misplaced = lefts
        .iter()
        .enumerate()
        .flat_map(|(chunk, &left)| (chunk * CHUNK).max(middle)..(chunk * CHUNK + left).max(middle));
    for (i, j) in rights.zip(misplaced) {
        std::mem::swap(&mut front[i], &mut back[j - middle]);
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use rayburst_math::Aabb;

    use super::*;

    #[test]
    fn many_are_partitioned_as_few_are() {
        for count in [0, 1, 5, CHUNK, 3 * CHUNK + 17] {
            for modulus in [1, 2, 7] {
                let of = |i| PrimitiveRef::new(&Aabb::of_point(Vec3::ZERO), i);
                let mut refs: Vec<_> = (0..count as u32).map(of).collect();
                let left = |r: &PrimitiveRef| !(r.index() / 1000).is_multiple_of(modulus);
                let middle = partition(&mut refs, left);
                assert!(refs[..middle].iter().all(left) && !refs[middle..].iter().any(left));
                let mut all: Vec<u32> = refs.iter().map(PrimitiveRef::index).collect();
                all.sort_unstable();
                assert!(all.into_iter().eq(0..count as u32));
            }
        }
    }
}
