//! Which Embree is measured: `embree:QUALITY:WIDTH[:coherent][:robust][:compact]`.

use std::fmt;

/// Build qualities of Embree.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Quality {
    /// By Morton codes.
    Low = 0,
    /// Binned surface area heuristic.
    Medium = 1,
    /// With spatial splits.
    High = 2,
}

impl Quality {
    /// All of them with their names.
    pub const ALL: [(&'static str, Self); 3] =
        [("low", Self::Low), ("medium", Self::Medium), ("high", Self::High)];

    /// The quality's name.
    pub fn name(self) -> &'static str {
        Self::ALL.iter().find(|(_, quality)| *quality == self).map_or("", |(name, _)| name)
    }

    /// What kind of builder Embree uses.
    pub fn builder(self) -> &'static str {
        match self {
            Self::Low => "morton",
            Self::Medium => "binned-sah",
            Self::High => "spatial-splits",
        }
    }
}

/// How many rays a call takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Width {
    /// `rtcIntersect1`.
    One,
    /// `rtcIntersect8`.
    Eight,
    /// `rtcIntersect16`.
    Sixteen,
}

impl Width {
    /// All of them with their names.
    pub const ALL: [(&'static str, Self); 3] =
        [("1", Self::One), ("8", Self::Eight), ("16", Self::Sixteen)];
}

/// How a scene is built.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct SceneConfig {
    /// The build's quality.
    pub quality: Quality,
    /// With `RTC_SCENE_FLAG_ROBUST`: no hits lost at edges.
    pub robust: bool,
    /// With `RTC_SCENE_FLAG_COMPACT`: less memory.
    pub compact: bool,
}

/// How a scene is built and traced.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Config {
    /// How it is built.
    pub scene: SceneConfig,
    /// Rays a call.
    pub width: Width,
    /// With `RTC_RAY_QUERY_FLAG_COHERENT`.
    pub coherent: bool,
}

impl Config {
    /// What is measured when nothing else is asked for.
    pub const DEFAULT: [&'static str; 11] = [
        "embree:medium:1",
        "embree:high:1",
        "embree:medium:8",
        "embree:medium:16",
        "embree:high:8",
        "embree:high:16",
        "embree:medium:8:coherent",
        "embree:medium:16:coherent",
        "embree:high:8:coherent",
        "embree:high:16:coherent",
        "embree:medium:1:robust",
    ];

    /// Every configuration.
    pub fn all() -> Vec<Self> {
        let mut all = Vec::new();
        for (compact, robust, coherent) in
            (0..8).map(|bits| (bits & 4 != 0, bits & 2 != 0, bits & 1 != 0))
        {
            for (_, quality) in Quality::ALL {
                let scene = SceneConfig { quality, robust, compact };
                all.extend(Width::ALL.map(|(_, width)| Self { scene, width, coherent }));
            }
        }
        all
    }

    /// The configuration of a name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::all().into_iter().find(|config| config.to_string() == name)
    }
}

impl fmt::Display for Config {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let width = Width::ALL.iter().find(|(_, w)| *w == self.width).map_or("", |(name, _)| name);
        write!(f, "embree:{}:{width}", self.scene.quality.name())?;
        let flags = [
            ("coherent", self.coherent),
            ("robust", self.scene.robust),
            ("compact", self.scene.compact),
        ];
        for (name, _) in flags.iter().filter(|(_, set)| *set) {
            write!(f, ":{name}")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_configurations_match() {
        let all = Config::all();
        assert_eq!(all.len(), 72);
        for config in &all {
            assert_eq!(Config::from_name(&config.to_string()), Some(*config));
        }
        let config = Config::from_name("embree:high:16:coherent:robust").unwrap();
        assert_eq!((config.scene.quality, config.width), (Quality::High, Width::Sixteen));
        assert!(config.coherent && config.scene.robust && !config.scene.compact);
        for wrong in ["embree", "embree:high", "embree:high:4", "embree:high:1:", "obvhs:cwbvh"] {
            assert_eq!(Config::from_name(wrong), None, "{wrong}");
        }
        for name in Config::DEFAULT {
            assert!(Config::from_name(name).is_some(), "{name}");
        }
    }
}
