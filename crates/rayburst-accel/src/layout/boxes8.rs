//! The 8-wide tree over boxes in the order of a curve: the fast build over instances and procedural primitives.
//!
//! After Pantaleoni, Luebke, "HLBVH: hierarchical LBVH construction for real-time ray tracing of
//! dynamic geometry", 2010, as [`super::hlbvh8`] is, whose nodes above clusters are used here.
//!
//! Changed: leaves are the boxes themselves, so that a cluster is a node of up to eight of them, and
//! nothing is stored but nodes. Their layout: the root, then those of clusters in the order of the
//! curve, then those above clusters, parents first.

use rayburst_math::Aabb;
use rayon::prelude::*;

use super::{
    arena::{Line, allocate},
    bvh8::{Bvh8, NODE_LINES, Node8, Reference, Shape},
    curve_leaves::Bounds,
    hlbvh8::{Above, Item},
};
use crate::{
    BuildError,
    build::{
        binned_sah::{BinnedSah, MAX_DEPTH},
        clusters::clusters,
        monitor::Monitor,
        morton::Keys,
        primitives::PrimitiveRef,
    },
};

/// Boxes of a cluster, at most.
const MOST: usize = 8;
/// Clusters of more boxes than this are nodes.
const BARE: usize = 2;
/// Clusters that one task works on.
const TASK: usize = 512;

/// Some clusters in the order of the curve.
struct Part<'a, B> {
    keys: &'a Keys,
    bounds_of: &'a B,
    /// The first key of each cluster, and the end of the last one's.
    starts: &'a [u32],
}

/// What the clusters of a part are to the nodes above.
#[derive(Default)]
struct Measured {
    items: Vec<Item>,
    /// Of all boxes and of the clusters' nodes.
    area: f64,
}

impl Bvh8 {
    /// Builds over boxes, given their sorted keys, of which there must be some. The value of a leaf is
    /// the index of its box.
    pub(crate) fn over_boxes(
        keys: &Keys,
        bounds_of: impl Fn(u32) -> Aabb + Sync,
        bins: usize,
    ) -> Result<Self, BuildError> {
        let starts = clusters(keys, MOST);
        let parts: Vec<Part<'_, _>> = (0..starts.len() - 1)
            .step_by(TASK)
            .map(|first| &starts[first..(first + TASK + 1).min(starts.len())])
            .map(|starts| Part { keys, bounds_of: &bounds_of, starts })
            .collect();
        // The node of each part's first cluster; the root comes before all.
        let mut nodes = 1;
        let mut firsts = Vec::with_capacity(parts.len());
        for part in &parts {
            firsts.push(nodes);
            nodes += part.nodes();
        }
        let measured: Vec<Measured> =
            parts.par_iter().zip(&firsts).map(|(part, &first)| part.measure(first)).collect();
        let items: Vec<&Item> = measured.iter().flat_map(|part| &part.items).collect();
        let reference = |i: usize| PrimitiveRef::new(&items[i].bounds.aabb(), i as u32);
        let refs = (0..items.len()).into_par_iter().with_min_len(1024).map(reference).collect();
        // Leaves room for a cluster's own node.
        let (max_depth, monitor) = (MAX_DEPTH - 1, Monitor::default());
        let tree = BinnedSah { bins, leaf_size: 1, max_depth, monitor }.build(refs)?;
        let start = nodes * NODE_LINES;
        let (above, depth) = Above::new(&tree, &items, start)?;
        let mut lines = allocate(above.end())?;
        above.write_all(&mut lines);
        let mut rest = &mut lines[NODE_LINES..start];
        let mut tasks = Vec::with_capacity(parts.len());
        for part in &parts {
            let (own, others) = rest.split_at_mut(part.nodes() * NODE_LINES);
            tasks.push((part, own));
            rest = others;
        }
        tasks.into_par_iter().for_each(|(part, lines)| part.write(lines));
        let bounds = tree.nodes[0].bounds;
        let area = above.area() + measured.iter().map(|part| part.area).sum::<f64>();
        let root = f64::from(bounds.half_area()).max(f64::MIN_POSITIVE);
        let shape = Shape {
            nodes: above.nodes() + nodes - 1,
            leaves: keys.len(),
            depth,
            sah_cost: (area / root) as f32,
        };
        Ok(Self::of_lines(lines, bounds, shape).with_nodes_above(start))
    }
}

impl<B: Fn(u32) -> Aabb> Part<'_, B> {
    /// How many clusters are nodes.
    fn nodes(&self) -> usize {
        self.starts.windows(2).filter(|part| (part[1] - part[0]) as usize > BARE).count()
    }

    /// The boxes of a cluster and their indices.
    fn cluster(&self, part: &[u32]) -> impl Iterator<Item = (Bounds, u32)> {
        (part[0]..part[1]).map(|at| {
            let index = self.keys.index(at as usize);
            let Aabb { lower, upper } = (self.bounds_of)(index);
            (Bounds { lower: lower.extend(0.0), upper: upper.extend(0.0) }, index)
        })
    }

    /// What the nodes above must know, given the node of the first cluster that is one.
    fn measure(&self, first: usize) -> Measured {
        let mut measured = Measured::default();
        let mut node = first;
        for part in self.starts.windows(2) {
            let is_node = (part[1] - part[0]) as usize > BARE;
            let mut all = Bounds::EMPTY;
            for (bounds, index) in self.cluster(part) {
                measured.area += f64::from(bounds.half_area());
                all.grow(bounds.lower, bounds.upper);
                if !is_node {
                    measured.items.push(Item { bounds, reference: Reference::leaf(index) });
                }
            }
            if is_node {
                measured.area += f64::from(all.half_area());
                let reference = Reference::node((node * NODE_LINES) as u32);
                measured.items.push(Item { bounds: all, reference });
                node += 1;
            }
        }
        measured
    }

    /// Writes the clusters that are nodes.
    fn write(&self, lines: &mut [Line]) {
        let is_node = |part: &&[u32]| (part[1] - part[0]) as usize > BARE;
        let clusters = self.starts.windows(2).filter(is_node);
        for (part, lines) in clusters.zip(lines.chunks_exact_mut(NODE_LINES)) {
            let mut node = Node8::EMPTY;
            for (slot, (bounds, index)) in self.cluster(part).enumerate() {
                node.set(slot, &bounds, Reference::leaf(index));
            }
            lines.copy_from_slice(bytemuck::cast_slice(std::slice::from_ref(&node)));
        }
    }
}
