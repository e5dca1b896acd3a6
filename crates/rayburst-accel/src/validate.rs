//! Proof that a structure is what its builder meant.

use thiserror::Error;

/// What is wrong with a structure.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum BvhDefect {
    /// A primitive that can be hit is in no leaf.
    #[error("primitive {0} is in no leaf")]
    Missing(u32),
    /// A primitive is in several leaves.
    #[error("primitive {0} is in more than one leaf")]
    Repeated(u32),
    /// A primitive in a leaf is not one that can be hit, or differs from its source.
    #[error("the leaves hold primitive {0}, which is inactive, unknown or altered")]
    Foreign(u32),
    /// A box does not hold what is below it.
    #[error("child {slot} of node {node} does not enclose what is below it")]
    NotEnclosing {
        /// Which node.
        node: u32,
        /// Which of its children.
        slot: u32,
    },
    /// A reference leads out of the structure, or twice to the same place.
    #[error("child {slot} of node {node} leads nowhere, or where another child leads")]
    BadReference {
        /// Which node.
        node: u32,
        /// Which of its children.
        slot: u32,
    },
    /// The structure is deeper than the traversal's stack allows.
    #[error("the structure is {depth} levels deep, more than the {limit} that traversal allows")]
    TooDeep {
        /// How deep.
        depth: usize,
        /// How deep it may be.
        limit: usize,
    },
}

/// What a walk over a valid structure saw.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ValidationReport {
    /// Inner nodes.
    pub nodes: usize,
    /// Leaves.
    pub leaves: usize,
    /// Primitives in them.
    pub primitives: usize,
    /// Inner nodes on the longest path.
    pub depth: usize,
    /// Cost by the surface area heuristic.
    pub sah_cost: f32,
}
