//! What a render tells while it runs, and when it ends.

use std::{
    ops::{Add, AddAssign, Range},
    time::Duration,
};

/// Rays traced, by what they were for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RayCounts {
    /// From the eye.
    pub camera: u64,
    /// Towards lights, or occlusion rays: any hit ends them.
    pub shadow: u64,
    /// Everything further along a path: reflections, refractions, bounces.
    pub indirect: u64,
}

impl RayCounts {
    /// All of them.
    pub fn total(&self) -> u64 {
        self.camera + self.shadow + self.indirect
    }

    /// Those counted after `earlier`.
    #[must_use]
    pub fn since(&self, earlier: Self) -> Self {
        Self {
            camera: self.camera - earlier.camera,
            shadow: self.shadow - earlier.shadow,
            indirect: self.indirect - earlier.indirect,
        }
    }
}

impl Add for RayCounts {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            camera: self.camera + other.camera,
            shadow: self.shadow + other.shadow,
            indirect: self.indirect + other.indirect,
        }
    }
}

impl AddAssign for RayCounts {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

/// How far a render is. A pass gives every pixel the same further samples; it counts when complete.
#[derive(Clone, Debug, PartialEq)]
pub struct Progress {
    /// Samples that every pixel has, resumed ones included.
    pub samples: u32,
    /// Samples that every pixel shall have.
    pub target: u32,
    /// The samples of the pass that is under way; empty between passes.
    pub pass: Range<u32>,
    /// Tiles of the pass that are finished.
    pub tiles_done: usize,
    /// Tiles of a pass.
    pub tiles: usize,
    /// Rays of complete passes of this render.
    pub rays: RayCounts,
    /// Since the render began.
    pub elapsed: Duration,
    /// Estimated relative error of the picture so far, see [`crate::Renderer::noise`]; `None` until
    /// two samples are there.
    pub noise: Option<f32>,
}

impl Progress {
    /// Samples a pixel that are done, with the share of the pass under way.
    pub fn samples_done(&self) -> f64 {
        let pass = f64::from(self.pass.end - self.pass.start);
        f64::from(self.samples) + pass * self.tiles_done as f64 / self.tiles.max(1) as f64
    }
}

/// When to end a render early.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Limits {
    /// No longer than this; the first pass is always finished.
    pub budget: Option<Duration>,
    /// No more samples once [`crate::Renderer::noise`] is at or below this.
    pub noise: Option<f32>,
}

/// Why a render ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StopReason {
    /// All samples are there.
    Complete,
    /// The caller's control said so; the pass under way was dropped.
    Interrupted,
    /// The time is up.
    Budget,
    /// The noise is low enough.
    Noise,
}

/// What a render did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outcome {
    /// Why it ended.
    pub reason: StopReason,
    /// Samples that every pixel has, resumed ones included.
    pub samples: u32,
    /// Rays of complete passes of this render.
    pub rays: RayCounts,
    /// Time it took.
    pub elapsed: Duration,
}
