//! The 8-wide tree straight from triangles in the order of a Morton curve, for the fastest builds.
//!
//! After Lauterbach, Garland, Sengupta, Luebke, Manocha, "Fast BVH construction on GPUs", 2009: a node
//! holds a part of the sorted order and divides where the highest differing bit of its codes changes.
//!
//! Changed: nodes have eight children at once, no binary tree is made. Parts of at most 32 triangles
//! become one node of full leaves of four consecutive triangles, whatever their codes. A first pass
//! over the codes alone plans all nodes and places them in memory; a second one reads the triangles and
//! writes leaves and boxes bottom-up. Equal codes divide in the middle, so the depth is at most the
//! bits of a code plus the logarithm of the number of triangles.

use rayon::prelude::*;

use super::{
    arena::{Line, allocate_parts},
    bvh2::Bvh2,
    bvh8::{Bvh8, NODE_LINES, Node8, Reference, Shape},
    curve_leaves::{Bounds, CurveLeaves, LEAF_WORDS, leaf_lines},
    triangles::{BLOCK, TriangleLeaves},
};
use crate::{BuildError, build::morton::Keys};

/// Triangles of a part that is planned and written by one task.
const TASK: usize = 1 << 12;
/// Triangles of a node that has leaves only, at most.
pub(crate) const NODE_TRIANGLES: usize = 8 * BLOCK;

/// What a child is.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Leaf,
    /// A planned node of the same plan.
    Node(u32),
    /// The root of a task's plan.
    Task(u32),
}

/// A node to be written.
struct Planned {
    /// Where it starts, in lines from the start of its part of the memory.
    at: u32,
    children: u32,
    /// Child `i` holds the keys from `ends[i]` to `ends[i + 1]`.
    ends: [u32; 9],
    kinds: [Kind; 8],
}

impl Planned {
    /// Lines of the node with its leaves.
    fn lines(&self) -> usize {
        let kinds = &self.kinds[..self.children as usize];
        NODE_LINES + leaf_lines(kinds.iter().filter(|&&kind| kind == Kind::Leaf).count())
    }
}

/// Nodes in depth-first order.
#[derive(Default)]
struct Plan {
    nodes: Vec<Planned>,
    lines: usize,
    leaves: usize,
    depth: usize,
    /// What comes after what in the memory, nodes and tasks; empty in the plan of a task.
    sequence: Vec<Kind>,
    /// Parts left to tasks; empty in the plan of a task itself.
    tasks: Vec<Part>,
    /// The level of each task's root.
    levels: Vec<usize>,
}

/// Consecutive keys.
#[derive(Clone, Copy)]
struct Part {
    first: usize,
    end: usize,
}

impl Part {
    fn len(&self) -> usize {
        self.end - self.first
    }
}

/// What the writing of a part gives.
struct Written {
    bounds: Bounds,
    /// Of all nodes and leaves.
    area: f64,
}

impl Bvh8 {
    /// Builds over the triangles of sorted keys.
    pub(crate) fn from_keys(
        keys: &Keys,
        triangles: &TriangleLeaves<'_>,
    ) -> Result<Self, BuildError> {
        if keys.len() == 0 {
            return Self::collapse(&Bvh2::default(), triangles);
        }
        let all = Part { first: 0, end: keys.len() };
        let mut top = Plan::default();
        let root = plan_top(keys, all, 1, &mut top);
        let plans: Vec<Plan> = top
            .tasks
            .par_iter()
            .zip(&top.levels)
            .map(|(&part, &level)| {
                let mut plan = Plan::default();
                plan_node(keys, part, level, &mut plan);
                plan
            })
            .collect();
        // Depth-first: a top node with its leaves, then what is below it.
        let mut sizes = Vec::with_capacity(top.sequence.len());
        let mut starts = vec![0; plans.len()];
        let mut next = 0;
        for &item in &top.sequence {
            let size = match item {
                Kind::Task(task) => {
                    starts[task as usize] = next;
                    plans[task as usize].lines
                }
                Kind::Node(node) => {
                    top.nodes[node as usize].at = next as u32;
                    top.nodes[node as usize].lines()
                }
                Kind::Leaf => 0,
            };
            sizes.push(size);
            next += size;
        }
        let (mut lines, written) = allocate_parts(&sizes, 0, |number, lines| {
            let Kind::Task(task) = top.sequence[number] else { return None };
            let start = starts[task as usize];
            let leaves = CurveLeaves::new(keys, triangles);
            let mut writer = Writer { leaves, start, tasks: &[] };
            Some(writer.write(&plans[task as usize], lines))
        })?;
        // Tasks are in the sequence in their own order.
        let parts: Vec<(usize, Written)> =
            starts.iter().copied().zip(written.into_iter().flatten()).collect();
        let written = match root {
            Kind::Node(_) => {
                let leaves = CurveLeaves::new(keys, triangles);
                let mut writer = Writer { leaves, start: 0, tasks: &parts };
                let written = writer.write(&top, &mut lines);
                let area = written.area + parts.iter().map(|(_, part)| part.area).sum::<f64>();
                Written { area, ..written }
            }
            // The only task holds all.
            _ => match parts.into_iter().next() {
                Some((_, written)) => written,
                None => Written { bounds: Bounds::EMPTY, area: 0.0 },
            },
        };
        let every = || std::iter::once(&top).chain(&plans);
        let bounds = written.bounds.aabb();
        let root_area = f64::from(bounds.half_area()).max(f64::MIN_POSITIVE);
        let shape = Shape {
            nodes: every().map(|plan| plan.nodes.len()).sum(),
            leaves: every().map(|plan| plan.leaves).sum(),
            depth: every().map(|plan| plan.depth).max().unwrap_or_default(),
            sah_cost: (written.area / root_area) as f32,
        };
        Ok(Self::of_lines(lines, bounds, shape))
    }
}

/// Divides a part into up to eight; the largest first.
fn divide(keys: &Keys, part: Part, ends: &mut [u32; 9]) -> usize {
    if part.len() <= NODE_TRIANGLES {
        let count = part.len().div_ceil(BLOCK);
        for child in 0..count {
            ends[child] = (part.first + child * BLOCK) as u32;
        }
        ends[count] = part.end as u32;
        return count;
    }
    let mut count = 1;
    ends[0] = part.first as u32;
    ends[1] = part.end as u32;
    while count < 8 {
        let (mut largest, mut size) = (0, 0);
        for child in 0..count {
            let own = ends[child + 1] - ends[child];
            if own > size {
                (largest, size) = (child, own);
            }
        }
        if size as usize <= BLOCK {
            break;
        }
        let (first, end) = (ends[largest] as usize, ends[largest + 1] as usize);
        let middle = keys.divide(first, end).unwrap_or_else(|| {
            // Whole leaves on the left.
            first + ((end - first) / 2).next_multiple_of(BLOCK).min(end - first - 1)
        });
        ends.copy_within(largest + 1..=count, largest + 2);
        ends[largest + 1] = middle as u32;
        count += 1;
    }
    count
}

/// Plans the nodes of many triangles and notes the parts below as tasks.
fn plan_top(keys: &Keys, part: Part, level: usize, plan: &mut Plan) -> Kind {
    if part.len() <= TASK {
        plan.sequence.push(Kind::Task(plan.tasks.len() as u32));
        plan.tasks.push(part);
        plan.levels.push(level);
        return Kind::Task(plan.tasks.len() as u32 - 1);
    }
    plan.sequence.push(Kind::Node(plan.nodes.len() as u32));
    plan_children(keys, part, level, plan, plan_top)
}

/// Plans a node and all below it.
fn plan_node(keys: &Keys, part: Part, level: usize, plan: &mut Plan) -> Kind {
    plan_children(keys, part, level, plan, plan_node)
}

#[inline(always)]
fn plan_children(
    keys: &Keys,
    part: Part,
    level: usize,
    plan: &mut Plan,
    below: fn(&Keys, Part, usize, &mut Plan) -> Kind,
) -> Kind {
    let index = plan.nodes.len();
    let mut node =
        Planned { at: plan.lines as u32, children: 0, ends: [0; 9], kinds: [Kind::Leaf; 8] };
    let children = divide(keys, part, &mut node.ends);
    node.children = children as u32;
    let ends = node.ends;
    let is_leaf = |child: usize| (ends[child + 1] - ends[child]) as usize <= BLOCK;
    let leaves = (0..children).filter(|&child| is_leaf(child)).count();
    plan.nodes.push(node);
    plan.lines += NODE_LINES + leaf_lines(leaves);
    plan.leaves += leaves;
    plan.depth = plan.depth.max(level);
    if leaves < children {
        for child in (0..children).filter(|&child| !is_leaf(child)) {
            let part = Part { first: ends[child] as usize, end: ends[child + 1] as usize };
            let kind = below(keys, part, level + 1, plan);
            plan.nodes[index].kinds[child] = kind;
        }
    }
    Kind::Node(index as u32)
}

/// Writes the nodes of a plan.
struct Writer<'a> {
    leaves: CurveLeaves<'a>,
    /// The first line of the plan's part.
    start: usize,
    /// Where the roots of tasks are, and what was written there.
    tasks: &'a [(usize, Written)],
}

impl Writer<'_> {
    fn write(&mut self, plan: &Plan, lines: &mut [Line]) -> Written {
        let mut bounds = vec![Bounds::EMPTY; plan.nodes.len()];
        let mut area = 0.0;
        // Children come after their parents.
        for (index, planned) in plan.nodes.iter().enumerate().rev() {
            let mut node = Node8::EMPTY;
            let mut all = Bounds::EMPTY;
            let (node_lines, rest) = lines[planned.at as usize..].split_at_mut(NODE_LINES);
            let words: &mut [u32] = bytemuck::cast_slice_mut(rest);
            let mut leaf = 0;
            for child in 0..planned.children as usize {
                let (own, reference) = match planned.kinds[child] {
                    Kind::Leaf => {
                        let own = self.leaves.write(
                            planned.ends[child] as usize,
                            planned.ends[child + 1] as usize,
                            &mut words[leaf * LEAF_WORDS..][..LEAF_WORDS],
                        );
                        let at = 2 * (self.start + planned.at as usize + NODE_LINES)
                            + leaf * (LEAF_WORDS / 8);
                        leaf += 1;
                        area += f64::from(own.half_area());
                        (own, Reference::leaf(at as u32))
                    }
                    Kind::Node(below) => {
                        let at = self.start + plan.nodes[below as usize].at as usize;
                        (bounds[below as usize], Reference::node(at as u32))
                    }
                    Kind::Task(task) => {
                        let (at, written) = &self.tasks[task as usize];
                        (written.bounds, Reference::node(*at as u32))
                    }
                };
                node.set(child, &own, reference);
                all.grow(own.lower, own.upper);
            }
            area += f64::from(all.half_area());
            bounds[index] = all;
            node_lines.copy_from_slice(bytemuck::cast_slice(std::slice::from_ref(&node)));
        }
        Written { bounds: bounds[0], area }
    }
}
