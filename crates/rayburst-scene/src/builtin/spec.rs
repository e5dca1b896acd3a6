//! Names and parameters of built-in scenes: `NAME`, `NAME:VALUE`, `NAME:KEY=VALUE,KEY=VALUE`.

use std::fmt;

use super::BuiltinScene;

/// A parameter of a built-in scene.
#[derive(Clone, Copy, Debug)]
pub struct Parameter {
    /// Its key. The first parameter of a scene is also set by a value without a key.
    pub name: &'static str,
    /// What it does.
    pub meaning: &'static str,
    /// What it may be.
    pub kind: ParameterKind,
}

/// What a parameter may be.
#[derive(Clone, Copy, Debug)]
pub enum ParameterKind {
    /// A number in `min..=max`.
    Number {
        /// Without the parameter.
        default: f64,
        /// Smallest.
        min: f64,
        /// Largest.
        max: f64,
    },
    /// One of some words; the first is the default.
    Choice(&'static [&'static str]),
}

impl fmt::Display for Parameter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { name, meaning, kind } = self;
        match kind {
            ParameterKind::Number { default, min, max } => {
                write!(f, "{name}={min}..{max} ({default}): {meaning}")
            }
            ParameterKind::Choice(words) => {
                write!(f, "{name}={} ({}): {meaning}", words.join("|"), words[0])
            }
        }
    }
}

/// Why there is no such built-in scene.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BuiltinError {
    /// No scene has this name.
    #[error("no built-in scene '{name}'; did you mean '{nearest}'? There are: {known}")]
    UnknownScene {
        /// The name.
        name: String,
        /// The most similar one.
        nearest: &'static str,
        /// All of them.
        known: String,
    },
    /// The scene has no such parameter.
    #[error("built-in scene '{scene}' has no parameter '{name}'; it takes {known}")]
    UnknownParameter {
        /// The scene.
        scene: &'static str,
        /// The parameter.
        name: String,
        /// What it takes.
        known: String,
    },
    /// A value does not fit its parameter.
    #[error("built-in scene '{scene}': {parameter}={value}: expected {expected}")]
    BadValue {
        /// The scene.
        scene: &'static str,
        /// The parameter.
        parameter: &'static str,
        /// The value.
        value: String,
        /// What it may be.
        expected: String,
    },
}

/// The values of a scene's parameters, in the order of [`BuiltinScene::parameters`].
#[derive(Clone, Debug)]
pub(super) struct Values {
    parameters: &'static [Parameter],
    values: Vec<f64>,
}

impl Values {
    /// All defaults.
    fn defaults(parameters: &'static [Parameter]) -> Self {
        let values = parameters
            .iter()
            .map(|p| match p.kind {
                ParameterKind::Number { default, .. } => default,
                ParameterKind::Choice(_) => 0.0,
            })
            .collect();
        Self { parameters, values }
    }

    /// The value of a number; of a choice, its index.
    pub(super) fn get(&self, name: &str) -> f64 {
        let index = self.parameters.iter().position(|p| p.name == name);
        debug_assert!(index.is_some(), "the scene declares no parameter {name}");
        index.map_or(0.0, |i| self.values[i])
    }

    /// The chosen word.
    pub(super) fn word(&self, name: &str) -> &'static str {
        self.parameters
            .iter()
            .zip(&self.values)
            .find_map(|(p, &v)| match p.kind {
                ParameterKind::Choice(words) if p.name == name => words.get(v as usize).copied(),
                _ => None,
            })
            .unwrap_or_default()
    }
}

/// Splits a specification and checks it against the list of scenes.
pub(super) fn parse(
    spec: &str,
    scenes: &'static [BuiltinScene],
) -> Result<(&'static BuiltinScene, Values), BuiltinError> {
    let (name, settings) = spec.split_once(':').unwrap_or((spec, ""));
    let Some(scene) = scenes.iter().find(|s| s.name == name) else {
        return Err(BuiltinError::UnknownScene {
            name: name.to_owned(),
            nearest: nearest(name, scenes.iter().map(|s| s.name)),
            known: scenes.iter().map(|s| s.name).collect::<Vec<_>>().join(", "),
        });
    };
    let mut values = Values::defaults(scene.parameters);
    for setting in settings.split(',').map(str::trim).filter(|s| !s.is_empty()) {
        let (index, value) = match setting.split_once('=') {
            Some((key, value)) => {
                (scene.parameters.iter().position(|p| p.name == key.trim()), value.trim())
            }
            None => ((!scene.parameters.is_empty()).then_some(0), setting),
        };
        let Some(index) = index else {
            return Err(unknown_parameter(scene, setting));
        };
        values.values[index] = read(scene, &scene.parameters[index], value)?;
    }
    Ok((scene, values))
}

fn unknown_parameter(scene: &'static BuiltinScene, setting: &str) -> BuiltinError {
    let known = match scene.parameters {
        [] => "none".to_owned(),
        some => some.iter().map(|p| p.name).collect::<Vec<_>>().join(", "),
    };
    let name = setting.split('=').next().unwrap_or_default().trim().to_owned();
    BuiltinError::UnknownParameter { scene: scene.name, name, known }
}

fn read(
    scene: &'static BuiltinScene,
    parameter: &Parameter,
    value: &str,
) -> Result<f64, BuiltinError> {
    let (parsed, expected) = match parameter.kind {
        ParameterKind::Number { min, max, .. } => (
            value.replace('_', "").parse::<f64>().ok().filter(|v| (min..=max).contains(v)),
            format!("a number from {min} to {max}"),
        ),
        ParameterKind::Choice(words) => (
            words.iter().position(|&w| w == value).map(|i| i as f64),
            format!("one of {}", words.join(", ")),
        ),
    };
    parsed.ok_or_else(|| BuiltinError::BadValue {
        scene: scene.name,
        parameter: parameter.name,
        value: value.to_owned(),
        expected,
    })
}

/// The candidate with the smallest edit distance (Levenshtein); the first of equals.
fn nearest(word: &str, candidates: impl Iterator<Item = &'static str>) -> &'static str {
    candidates.min_by_key(|c| distance(word, c)).unwrap_or_default()
}

fn distance(a: &str, b: &str) -> usize {
    // A long word is far from everything; cutting it bounds the work.
    let a: Vec<char> = a.chars().take(64).collect();
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, &ca) in a.iter().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, &cb) in b.iter().enumerate() {
            let substituted = diagonal + usize::from(!ca.eq_ignore_ascii_case(&cb));
            diagonal = row[j + 1];
            row[j + 1] = substituted.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_edits() {
        assert_eq!(distance("kitten", "sitting"), 3);
        assert_eq!(distance("", "abc"), 3);
        assert_eq!(distance("City", "city"), 0);
    }
}
