//! What is measured: anything that answers batches of rays.

use std::sync::Arc;

use rayburst_accel::{
    AcceptAll, Blas, BuildOptions, BuildQuality, Builder, Counters, Layout, TraceMode, TraceOptions,
};
use rayburst_math::{Hit, Ray};

use crate::peers::embree::Quality;

/// What is asked of the rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Query {
    /// The nearest hit.
    Closest,
    /// Whether anything is hit.
    Any,
}

/// An engine with its structure built.
pub trait Engine: Sync {
    /// Name in the rows, such as `rayburst:balanced:auto` or `embree:medium:1`.
    fn name(&self) -> String;
    /// Whether the engine is one to be compared with.
    fn is_peer(&self) -> bool;
    /// Whether each ray is a call of its own.
    fn takes_single_rays(&self) -> bool;
    /// Rays of a batch: small enough to balance the threads' work, large enough for the engine.
    fn batch(&self) -> usize {
        4096
    }
    /// What each ray of a batch visits, if the engine can tell.
    fn count(&self, _query: Query, _rays: &[Ray]) -> Option<Vec<Counters>> {
        None
    }
    /// Answers a batch on the calling thread. The answers are stored in `hits` (`Closest`) or
    /// `occluded` (`Any`), as a renderer would.
    fn trace(&self, query: Query, rays: &[Ray], hits: &mut [Hit], occluded: &mut [bool]);
}

/// A build preset of Rayburst; its name tells it apart from the others.
#[derive(Clone, Copy, Debug)]
pub struct Preset {
    /// Its name.
    pub name: &'static str,
    /// What it asks of the build.
    options: fn() -> BuildOptions<'static>,
    /// The builder that it uses.
    pub builder: &'static str,
    /// Embree's build quality that makes the same trade.
    pub embree: Quality,
}

impl PartialEq for Preset {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

impl Preset {
    const FAST: Self = Self {
        name: "fast",
        options: || BuildOptions { quality: BuildQuality::Fast, ..BuildOptions::default() },
        builder: "hlbvh",
        embree: Quality::Low,
    };
    const BALANCED: Self = Self {
        name: "balanced",
        options: BuildOptions::default,
        builder: "binned-sah",
        embree: Quality::Medium,
    };
    const BEST: Self = Self {
        name: "best",
        options: || BuildOptions { quality: BuildQuality::Best, ..BuildOptions::default() },
        builder: "spatial-splits",
        embree: Quality::High,
    };

    /// The presets that are measured unless others are named: one for each quality.
    pub const USUAL: [Self; 3] = [Self::FAST, Self::BALANCED, Self::BEST];

    /// All presets: those, `balanced` in the compressed layout, and one for each builder.
    pub const ALL: [Self; 9] = [
        Self::FAST,
        Self::BALANCED,
        Self::BEST,
        Self {
            name: "compressed",
            options: || BuildOptions { layout: Layout::Compressed, ..BuildOptions::default() },
            ..Self::BALANCED
        },
        Self::built("lbvh", Quality::Low, || by(Builder::Lbvh)),
        Self::built("hlbvh", Quality::Low, || by(Builder::Hlbvh)),
        Self::built("ploc", Quality::Low, || by(Builder::Ploc)),
        Self::built("binned-sah", Quality::Medium, || by(Builder::BinnedSah)),
        Self::built("spatial-splits", Quality::High, || by(Builder::SpatialSplits)),
    ];

    /// A preset that is called after its builder.
    const fn built(
        name: &'static str,
        embree: Quality,
        options: fn() -> BuildOptions<'static>,
    ) -> Self {
        Self { name, options, builder: name, embree }
    }

    /// Options of a build.
    pub fn options(&self) -> BuildOptions<'static> {
        (self.options)()
    }
}

/// Options of a build by this builder.
fn by(builder: Builder) -> BuildOptions<'static> {
    BuildOptions { builder: Some(builder), ..BuildOptions::default() }
}

/// How Rayburst is asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Batches, traced as the library sees fit.
    Auto,
    /// Batches, one ray after another.
    Single,
    /// Batches, several rays in flight.
    Interleaved,
    /// Bundles where that can be, interleaved where not.
    Packet,
    /// Batches sorted first, then several rays in flight.
    Stream,
    /// One call a ray.
    Call,
}

impl Mode {
    /// All modes with their names.
    pub const ALL: [(&'static str, Self); 6] = [
        ("auto", Self::Auto),
        ("single", Self::Single),
        ("interleaved", Self::Interleaved),
        ("packet", Self::Packet),
        ("stream", Self::Stream),
        ("call", Self::Call),
    ];

    /// The modes that are measured unless others are named.
    pub const USUAL: [Self; 2] = [Self::Auto, Self::Call];

    /// The mode's name.
    pub fn name(self) -> &'static str {
        Self::ALL.iter().find(|(_, mode)| *mode == self).map_or("", |(name, _)| name)
    }

    /// Options of the queries.
    fn options(self) -> TraceOptions {
        let mode = match self {
            Self::Auto | Self::Call => TraceMode::Auto,
            Self::Single => TraceMode::Single,
            Self::Interleaved => TraceMode::Interleaved,
            Self::Packet => TraceMode::Packet,
            Self::Stream => TraceMode::Stream,
        };
        TraceOptions { mode, ..TraceOptions::default() }
    }
}

/// Rayburst's own structure.
#[derive(Clone, Debug)]
pub struct Rayburst {
    /// The structure.
    pub blas: Arc<Blas>,
    /// How it was built.
    pub preset: Preset,
    /// How it is asked.
    pub mode: Mode,
}

impl Engine for Rayburst {
    fn name(&self) -> String {
        format!("rayburst:{}:{}", self.preset.name, self.mode.name())
    }

    fn is_peer(&self) -> bool {
        false
    }

    fn takes_single_rays(&self) -> bool {
        self.mode == Mode::Call
    }

    fn batch(&self) -> usize {
        // As many as are sorted at a time.
        if self.mode == Mode::Stream { 1 << 16 } else { 4096 }
    }

    fn count(&self, query: Query, rays: &[Ray]) -> Option<Vec<Counters>> {
        // One ray a call is one after another.
        let mode = if self.mode == Mode::Call { Mode::Single } else { self.mode };
        let (options, mut counts) = (mode.options(), vec![Counters::default(); rays.len()]);
        match query {
            Query::Closest => {
                let mut hits = vec![Hit::MISS; rays.len()];
                self.blas.closest_hits_counted(rays, &mut hits, &mut counts, &options, &AcceptAll);
            }
            Query::Any => {
                let mut occluded = vec![false; rays.len()];
                let answers = &mut occluded;
                self.blas.any_hits_counted(rays, answers, &mut counts, &options, &AcceptAll);
            }
        }
        Some(counts)
    }

    fn trace(&self, query: Query, rays: &[Ray], hits: &mut [Hit], occluded: &mut [bool]) {
        let options = self.mode.options();
        match (self.mode, query) {
            (Mode::Call, Query::Closest) => {
                for (ray, hit) in rays.iter().zip(hits) {
                    *hit = self.blas.closest_hit(ray, &options, &AcceptAll);
                }
            }
            (Mode::Call, Query::Any) => {
                for (ray, occluded) in rays.iter().zip(occluded) {
                    *occluded = self.blas.any_hit(ray, &options, &AcceptAll);
                }
            }
            (_, Query::Closest) => self.blas.closest_hits(rays, hits, &options, &AcceptAll),
            (_, Query::Any) => self.blas.any_hits(rays, occluded, &options, &AcceptAll),
        }
    }
}
