//! What is measured: anything that answers batches of rays.

use std::sync::Arc;

use rayburst_accel::{
    AcceptAll, Blas, BuildOptions, BuildQuality, Layout, TraceMode, TraceOptions,
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
    /// Answers a batch on the calling thread. The answers are stored in `hits` (`Closest`) or
    /// `occluded` (`Any`), as a renderer would.
    fn trace(&self, query: Query, rays: &[Ray], hits: &mut [Hit], occluded: &mut [bool]);
}

/// A build preset of Rayburst.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Preset {
    /// Its name.
    pub name: &'static str,
    /// What it asks of the build.
    pub quality: BuildQuality,
    /// How it lays out the structure.
    pub layout: Layout,
    /// The builder that it uses.
    pub builder: &'static str,
    /// Embree's build quality that makes the same trade.
    pub embree: Quality,
}

impl Preset {
    /// The presets that are measured unless others are named.
    pub const USUAL: [Self; 3] = [
        Self {
            name: "fast",
            quality: BuildQuality::Fast,
            layout: Layout::Wide,
            builder: "hlbvh",
            embree: Quality::Low,
        },
        Self {
            name: "balanced",
            quality: BuildQuality::Balanced,
            layout: Layout::Wide,
            builder: "binned-sah",
            embree: Quality::Medium,
        },
        Self {
            name: "best",
            quality: BuildQuality::Best,
            layout: Layout::Wide,
            builder: "spatial-splits",
            embree: Quality::High,
        },
    ];

    /// All presets: the usual ones, and `balanced` in the compressed layout.
    pub const ALL: [Self; 4] = {
        let [fast, balanced, best] = Self::USUAL;
        [fast, balanced, best, Self { name: "compressed", layout: Layout::Compressed, ..balanced }]
    };

    /// Options of a build.
    pub fn options(&self) -> BuildOptions<'static> {
        BuildOptions { quality: self.quality, layout: self.layout, ..BuildOptions::default() }
    }
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
    /// One call a ray.
    Call,
}

impl Mode {
    /// All modes with their names.
    pub const ALL: [(&'static str, Self); 5] = [
        ("auto", Self::Auto),
        ("single", Self::Single),
        ("interleaved", Self::Interleaved),
        ("packet", Self::Packet),
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
