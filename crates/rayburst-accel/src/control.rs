//! Watching and stopping a build from another thread.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Shared with a build in progress: how far it is, and whether to give up.
#[derive(Debug, Default)]
pub struct BuildControl {
    cancelled: AtomicBool,
    done: AtomicUsize,
    total: AtomicUsize,
}

impl BuildControl {
    /// What a build spends on the tree; the rest lays it out.
    const TREE: f32 = 0.8;

    /// A control for one build after another.
    pub const fn new() -> Self {
        Self {
            cancelled: AtomicBool::new(false),
            done: AtomicUsize::new(0),
            total: AtomicUsize::new(0),
        }
    }

    /// Makes the build, and every later one, return [`crate::BuildError::Cancelled`] soon.
    pub fn cancel(&self) {
        self.cancelled.store(true, Ordering::Relaxed);
    }

    /// Whether [`Self::cancel`] was called.
    pub fn is_cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }

    /// How far the build is: 0 before it begins, 1 when it is done.
    pub fn progress(&self) -> f32 {
        let total = self.total.load(Ordering::Relaxed);
        match self.done.load(Ordering::Relaxed) {
            Self::DONE => 1.0,
            done if total > 0 => Self::TREE * done.min(total) as f32 / total as f32,
            _ => 0.0,
        }
    }

    const DONE: usize = usize::MAX;

    pub(crate) fn begin(&self, primitives: usize) {
        self.done.store(0, Ordering::Relaxed);
        self.total.store(primitives, Ordering::Relaxed);
    }

    pub(crate) fn advance(&self, primitives: usize) {
        self.done.fetch_add(primitives, Ordering::Relaxed);
    }

    pub(crate) fn finish(&self) {
        self.done.store(Self::DONE, Ordering::Relaxed);
    }
}
