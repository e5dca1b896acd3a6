//! The names of engines: which there are, and which a user means.

use std::fmt;

use crate::{
    engine::{Mode, Preset},
    peers::embree::Config,
};

/// An engine before anything is built for it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum EngineSpec {
    /// `rayburst:PRESET:MODE`.
    Rayburst(Preset, Mode),
    /// `embree:QUALITY:WIDTH[:coherent][:robust][:compact]`.
    Embree(Config),
    /// `obvhs:cwbvh`.
    #[cfg(feature = "peers")]
    Obvhs,
}

/// The form of the names of this engine's builders, for messages.
pub const BUILDER_NAMES: &str = "rayburst:lbvh|hlbvh|ploc|binned-sah|spatial-splits[:MODE]";
/// The form of Embree's names, for messages.
pub const EMBREE_NAMES: &str = "embree:low|medium|high:1|8|16[:coherent][:robust][:compact]";

impl fmt::Display for EngineSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Rayburst(preset, mode) => write!(f, "rayburst:{}:{}", preset.name, mode.name()),
            Self::Embree(config) => config.fmt(f),
            #[cfg(feature = "peers")]
            Self::Obvhs => f.write_str(crate::peers::obvhs::NAME),
        }
    }
}

impl EngineSpec {
    /// What is measured when no engine is named: these presets in these modes, and the peers'
    /// usual configurations.
    pub fn usual(presets: &[Preset], modes: &[Mode]) -> Vec<Self> {
        let own = presets.iter().flat_map(|p| modes.iter().map(|m| Self::Rayburst(*p, *m)));
        let embree = Config::DEFAULT.iter().filter_map(|name| Config::from_name(name));
        own.chain(embree.map(Self::Embree)).chain(Self::crates()).collect()
    }

    /// Every engine there is.
    pub fn all() -> Vec<Self> {
        let own = Preset::ALL.into_iter().flat_map(|preset| {
            Mode::ALL.into_iter().map(move |(_, mode)| Self::Rayburst(preset, mode))
        });
        own.chain(Config::all().into_iter().map(Self::Embree)).chain(Self::crates()).collect()
    }

    /// Peers that are crates.
    fn crates() -> Vec<Self> {
        #[cfg(feature = "peers")]
        return vec![Self::Obvhs];
        #[cfg(not(feature = "peers"))]
        Vec::new()
    }

    /// Whether a peer's shared library must be named.
    pub fn needs_library(&self) -> bool {
        matches!(self, Self::Embree(_))
    }

    /// The engines that a name or the beginning of a name means: the one of exactly that name, else
    /// those of `usual` that begin so, else those of any preset in the modes of `usual`, else all that
    /// begin so.
    pub fn named(name: &str, usual: &[Self]) -> Vec<Self> {
        let all = Self::all();
        let begins = |specs: &[Self]| -> Vec<Self> {
            specs.iter().filter(|s| s.to_string().starts_with(name)).copied().collect()
        };
        if let Some(exact) = all.iter().find(|spec| spec.to_string() == name) {
            return vec![*exact];
        }
        let modes: Vec<Mode> = usual.iter().filter_map(Self::mode).collect();
        let of_any_preset: Vec<Self> =
            all.iter().filter(|s| s.mode().is_some_and(|m| modes.contains(&m))).copied().collect();
        let lists = [usual, &of_any_preset, &all].map(begins);
        lists.into_iter().find(|list| !list.is_empty()).unwrap_or_default()
    }

    /// How this engine is asked, if it is one of ours.
    fn mode(&self) -> Option<Mode> {
        match self {
            Self::Rayburst(_, mode) => Some(*mode),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named(name: &str) -> Vec<String> {
        let usual = EngineSpec::usual(&Preset::USUAL, &Mode::USUAL);
        EngineSpec::named(name, &usual).iter().map(ToString::to_string).collect()
    }

    #[test]
    fn names_are_unique() {
        let mut names: Vec<String> = EngineSpec::all().iter().map(ToString::to_string).collect();
        let count = names.len();
        names.sort();
        names.dedup();
        assert_eq!(names.len(), count);
    }

    #[test]
    fn a_whole_name_means_itself_and_a_beginning_the_usual_ones() {
        assert_eq!(named("embree:medium:1"), ["embree:medium:1"]);
        assert_eq!(
            named("rayburst:balanced"),
            ["rayburst:balanced:auto", "rayburst:balanced:call"]
        );
        #[cfg(feature = "peers")]
        assert_eq!(named("obvhs"), ["obvhs:cwbvh"]);
        assert_eq!(named("rayburst:ploc"), ["rayburst:ploc:auto", "rayburst:ploc:call"]);
        assert_eq!(named("rayburst:lbvh:stream"), ["rayburst:lbvh:stream"]);
        assert_eq!(named("rayburst").len(), 6);
        assert_eq!(named("embree").len(), Config::DEFAULT.len());
        assert_eq!(named("embree:low:8:r"), ["embree:low:8:robust", "embree:low:8:robust:compact"]);
        assert!(named("embre:medium").is_empty());
    }
}
