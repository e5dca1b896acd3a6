//! Clusters along a space-filling curve, and above them a tree by the surface area heuristic.
//!
//! After Pantaleoni, Luebke, "HLBVH: hierarchical LBVH construction for real-time ray tracing of
//! dynamic geometry", 2010, and Garanzha, Pantaleoni, McAllister, "Simpler and faster HLBVH with work
//! queues", 2011: primitives whose codes share their high bits form clusters, whose insides follow the
//! curve ([`super::curve_order`]); the clusters themselves are primitives of a binned build
//! ([`super::binned_sah`]).
//!
//! Changed: how many bits a cluster shares is not fixed; a part of the order is divided by its codes
//! until no part holds more than [`CLUSTER`] primitives. Dense regions so get as fine clusters as
//! sparse ones. The tree above may be [`TOP_DEPTH`] deep, which leaves room for any cluster below.

use rayon::prelude::*;

use super::{
    binned_sah::{BinnedSah, MAX_DEPTH, Slots, nodes_below},
    curve_order::{Grower, Ordered},
    monitor::Monitor,
    morton::Keys,
    primitives::PrimitiveRef,
};
use crate::{
    BuildError, Curve,
    layout::bvh2::{Bvh2, Node2},
};

/// Primitives in a cluster, at most: a cluster of `n` is at most `n − 1` levels deep.
pub(crate) const CLUSTER: usize = 32;
/// Levels above the clusters, at most.
pub(crate) const TOP_DEPTH: usize = MAX_DEPTH - CLUSTER;
/// Parts of the order that are cut by one task.
const CUT_TASK: usize = 1 << 14;

/// Options of the builder.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Hlbvh<'a> {
    /// Which curve.
    pub(crate) curve: Curve,
    /// Bins an axis above the clusters, at most 32.
    pub(crate) bins: usize,
    /// Primitives in a leaf, at most.
    pub(crate) leaf_size: usize,
    /// Whom progress is told.
    pub(crate) monitor: Monitor<'a>,
}

impl Hlbvh<'_> {
    /// Builds the tree over some primitives.
    pub(crate) fn build(&self, refs: &[PrimitiveRef]) -> Result<Bvh2, BuildError> {
        if refs.is_empty() {
            return Ok(Bvh2::default());
        }
        let ordered = Ordered::new(refs, self.curve);
        self.monitor.check()?;
        let starts = clusters(&ordered.keys, CLUSTER);
        let count = starts.len() - 1;
        let top_nodes = 1 + nodes_below(count);
        let mut nodes = Node2::allocate(1 + nodes_below(refs.len()))?;
        let (top, mut below) = nodes.split_at_mut(top_nodes);
        // A cluster of `n` primitives has room for the nodes below its root.
        let mut tasks = Vec::with_capacity(count);
        let mut base = top_nodes;
        for part in starts.windows(2) {
            let (first, end) = (part[0] as usize, part[1] as usize);
            let (own, others) = below.split_at_mut(nodes_below(end - first));
            tasks.push((first, end, Slots { nodes: own, base: base as u32 }));
            base += nodes_below(end - first);
            below = others;
        }
        let grower = Grower { ordered: &ordered, leaf_size: self.leaf_size };
        let roots: Vec<Node2> = tasks
            .into_par_iter()
            .with_min_len(64)
            .map(|(first, end, slots)| {
                self.monitor.advance(end - first);
                grower.subtree(first, end, slots)
            })
            .collect();
        self.monitor.check()?;
        let of_root = |(root, index): (&Node2, u32)| PrimitiveRef::new(&root.bounds, index);
        let clusters = roots.iter().zip(0..).map(of_root).collect();
        let monitor = self.monitor.silent();
        let above = BinnedSah { bins: self.bins, leaf_size: 1, max_depth: TOP_DEPTH, monitor };
        let above = above.build(clusters)?;
        self.monitor.check()?;
        // Leaves above are clusters.
        for (node, source) in top.iter_mut().zip(&above.nodes) {
            *node = match source.count {
                0 => *source,
                _ => roots[above.order[source.first as usize] as usize],
            };
        }
        Ok(Bvh2 { nodes, order: ordered.order() })
    }
}

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
