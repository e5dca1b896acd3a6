//! All ways to build and to trace, from the lists of `rayburst-accel`.

use rayburst_accel::{BuildOptions, BuildQuality, Builder, IsaLevel, Layout, TraceMode};

/// A way to build: a new quality or builder joins by itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Build {
    /// The quality.
    pub quality: BuildQuality,
    /// The builder.
    pub builder: Builder,
    /// The layout.
    pub layout: Layout,
}

impl Build {
    /// Every quality with every builder in every layout.
    pub fn all() -> Vec<Self> {
        let with = |(quality, builder)| Layout::ALL.map(|layout| Self { quality, builder, layout });
        let pair = |quality| Builder::ALL.map(|builder| (quality, builder));
        BuildQuality::ALL.into_iter().flat_map(pair).flat_map(with).collect()
    }

    /// The options of this build for an instruction set.
    pub fn options(self, isa: IsaLevel) -> BuildOptions<'static> {
        BuildOptions {
            quality: self.quality,
            builder: Some(self.builder),
            layout: self.layout,
            isa: Some(isa),
            ..BuildOptions::default()
        }
    }
}

impl std::fmt::Display for Build {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:?}/{:?}/{:?}", self.quality, self.builder, self.layout)
    }
}

/// What is asked of rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Query {
    /// The nearest hit.
    Closest,
    /// Whether there is a hit.
    Any,
}

/// Every mode with every query.
pub fn traces() -> Vec<(TraceMode, Query)> {
    let with = |mode| [(mode, Query::Closest), (mode, Query::Any)];
    TraceMode::ALL.into_iter().flat_map(with).collect()
}
