//! A binary hierarchy of boxes over patches.

use glam::DVec3;

use super::intersect::{Found, intersect};
use super::patches::Patch;
use crate::segment::{Segment, padded};

#[derive(Clone, Debug)]
struct Node {
    lower: DVec3,
    upper: DVec3,
    /// Of a leaf the patch; of an inner node its first child follows it, and this is the second one.
    to: usize,
    is_leaf: bool,
}

/// Halves of as many patches each: 64 levels are enough for all that fits into memory.
const STACK: usize = 64;

#[derive(Clone, Debug)]
pub(super) struct Tree {
    nodes: Vec<Node>,
}

impl Tree {
    pub(super) fn new(patches: &[Patch]) -> Self {
        let boxes: Vec<(DVec3, DVec3)> = patches
            .iter()
            .map(|patch| {
                let first = patch.points[0];
                let (lower, upper) =
                    patch.points.iter().fold((first, first), |(a, b), &p| (a.min(p), b.max(p)));
                padded(lower, upper)
            })
            .collect();
        let mut order: Vec<usize> = (0..patches.len()).collect();
        let mut nodes = Vec::with_capacity(2 * patches.len());
        grow(&boxes, &mut order, &mut nodes);
        Self { nodes }
    }

    /// A box around all patches.
    pub(super) fn bounds(&self) -> (DVec3, DVec3) {
        (self.nodes[0].lower, self.nodes[0].upper)
    }

    /// The nearest hit.
    pub(super) fn nearest(&self, patches: &[Patch], segment: &Segment) -> Option<Found> {
        let mut best: Option<Found> = None;
        self.visit(patches, segment, &mut |found| {
            if best.is_none_or(|best| found.s < best.s) {
                best = Some(found);
            }
            best.map_or(f64::INFINITY, |best| best.s)
        });
        best
    }

    /// The first hits after a place, in order; those that are no farther from each other than `same`
    /// and on the same side are one.
    pub(super) fn collect(
        &self,
        patches: &[Patch],
        segment: &Segment,
        after: f64,
        same: f64,
    ) -> Hits {
        let mut hits = Hits { hits: [Found::default(); Hits::MOST], count: 0 };
        self.visit(patches, segment, &mut |found| {
            if found.s > after {
                hits.insert(found, same);
            }
            if hits.is_full() { hits.hits[Hits::MOST - 1].s } else { f64::INFINITY }
        });
        hits
    }

    /// Gives hits, nearer boxes first, to a function that says up to where it wants more.
    fn visit(&self, patches: &[Patch], segment: &Segment, report: &mut dyn FnMut(Found) -> f64) {
        let mut limit = f64::INFINITY;
        let mut stack = [(0, 0.0); STACK];
        let mut count = usize::from(entry(&self.nodes[0], segment).is_some());
        while count > 0 {
            count -= 1;
            let (index, near) = stack[count];
            if near > limit {
                continue;
            }
            let node = &self.nodes[index];
            if node.is_leaf {
                let patch = node.to;
                intersect(&patches[patch].points, segment, limit, &mut |found| {
                    limit = report(Found { patch, ..found });
                });
                continue;
            }
            let children =
                [index + 1, node.to].map(|i| entry(&self.nodes[i], segment).map(|s| (i, s)));
            let (far, near) = match children {
                [Some(a), Some(b)] if a.1 < b.1 => (Some(b), Some(a)),
                [a, b] => (a, b),
            };
            for child in [far, near].into_iter().flatten() {
                stack[count] = child;
                count += 1;
            }
        }
    }
}

fn grow(boxes: &[(DVec3, DVec3)], order: &mut [usize], nodes: &mut Vec<Node>) {
    let all = |of: &dyn Fn(usize) -> (DVec3, DVec3), order: &[usize]| {
        order
            .iter()
            .map(|&i| of(i))
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(lower, upper), (a, b)| {
                (lower.min(a), upper.max(b))
            })
    };
    let (lower, upper) = all(&|i| boxes[i], order);
    let index = nodes.len();
    if let [patch] = *order {
        nodes.push(Node { lower, upper, to: patch, is_leaf: true });
        return;
    }
    nodes.push(Node { lower, upper, to: 0, is_leaf: false });
    let centre = |i: usize| boxes[i].0 + boxes[i].1;
    let (a, b) = all(&|i| (centre(i), centre(i)), order);
    let axis = (b - a).max_position();
    let middle = order.len() / 2;
    order.select_nth_unstable_by(middle, |&i, &j| centre(i)[axis].total_cmp(&centre(j)[axis]));
    let (left, right) = order.split_at_mut(middle);
    grow(boxes, left, nodes);
    nodes[index].to = nodes.len();
    grow(boxes, right, nodes);
}

/// Where the segment enters the box.
fn entry(node: &Node, segment: &Segment) -> Option<f64> {
    let (mut near, mut far) = (0.0f64, segment.length);
    for axis in 0..3 {
        let (o, d) = (segment.origin[axis], segment.direction[axis]);
        let (a, b) = (node.lower[axis] - o, node.upper[axis] - o);
        if d == 0.0 {
            if a > 0.0 || b < 0.0 {
                return None;
            }
        } else {
            near = near.max((a / d).min(b / d));
            far = far.min((a / d).max(b / d));
        }
    }
    (near <= far).then_some(near)
}

/// The first hits, in order.
pub(super) struct Hits {
    hits: [Found; Hits::MOST],
    count: usize,
}

impl Hits {
    const MOST: usize = 64;

    pub(super) fn as_slice(&self) -> &[Found] {
        &self.hits[..self.count]
    }

    pub(super) fn is_full(&self) -> bool {
        self.count == Self::MOST
    }

    fn insert(&mut self, found: Found, same: f64) {
        let hits = &mut self.hits[..self.count];
        let twin = |hit: &&mut Found| hit.front == found.front && (hit.s - found.s).abs() <= same;
        if let Some(hit) = hits.iter_mut().find(twin) {
            if found.s < hit.s {
                *hit = found;
            }
            // It may have passed one of the other side.
            hits.sort_unstable_by(|a, b| a.s.total_cmp(&b.s));
            return;
        }
        let place = hits.partition_point(|hit| hit.s <= found.s);
        if place == Self::MOST {
            return;
        }
        self.count = (self.count + 1).min(Self::MOST);
        self.hits[place..self.count].rotate_right(1);
        self.hits[place] = found;
    }
}
