//! Clusters: parts of a space-filling curve that share the high bits of their codes.
//!
//! After Pantaleoni, Luebke, "HLBVH: hierarchical LBVH construction for real-time ray tracing of
//! dynamic geometry", 2010.
//!
//! Changed: how many bits a cluster shares is not fixed; a part of the order is divided by its codes
//! until no part holds more than some number of primitives. Dense regions so get as fine clusters as
//! sparse ones.

use rayon::prelude::*;

use super::morton::Keys;

/// Parts of the order that are cut by one task.
const CUT_TASK: usize = 1 << 14;

/// The first key of each cluster, and after the last the number of keys, of which there must be some.
pub(crate) fn clusters(keys: &Keys, most: usize) -> Vec<u32> {
    let mut parts = Vec::new();
    cut(keys, 0, keys.len(), CUT_TASK, &mut parts);
    parts.push(keys.len() as u32);
    let cut_part = |part: &[u32]| {
        let mut starts = Vec::with_capacity(2 * CUT_TASK / most);
        cut(keys, part[0] as usize, part[1] as usize, most, &mut starts);
        starts
    };
    let cut_parts: Vec<Vec<u32>> = parts.par_windows(2).map(cut_part).collect();
    let mut starts = Vec::with_capacity(cut_parts.iter().map(Vec::len).sum::<usize>() + 1);
    cut_parts.iter().for_each(|part| starts.extend(part));
    starts.push(keys.len() as u32);
    starts
}

/// Notes the first key of each part of at most so many keys.
fn cut(keys: &Keys, first: usize, end: usize, most: usize, starts: &mut Vec<u32>) {
    if end - first <= most {
        starts.push(first as u32);
        return;
    }
    let middle = keys.divide(first, end).unwrap_or(first + (end - first) / 2);
    cut(keys, first, middle, most, starts);
    cut(keys, middle, end, most, starts);
}
