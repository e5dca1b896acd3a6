//! Finding and reading the scene that the user names, and posing it.

use std::{path::Path, time::Instant};

use rayburst::scene::{
    Pose, Scene,
    builtin::{self, BuiltinError},
    import::{self, LoadOptions},
};

use crate::{
    args::scene::InstantArgs,
    error::{CliError, Result},
    names, terminal,
};

/// A scene with what the command line adds to it.
pub(crate) struct Loaded {
    pub(crate) scene: Scene,
    /// As the user names it.
    pub(crate) name: String,
    /// The picture's size that the scene is composed for.
    pub(crate) size: Option<(u32, u32)>,
    /// How long it took.
    pub(crate) seconds: f64,
}

/// Warnings of one scene that are shown.
const MAX_WARNINGS: usize = 12;

/// Reads a file or makes a built-in scene; warnings go to stderr.
pub(crate) fn load(name: &str, args: &InstantArgs) -> Result<Loaded> {
    let start = Instant::now();
    let path = Path::new(name);
    let options = LoadOptions {
        allow_external: args.allow_external,
        view: args.view.clone(),
        ..LoadOptions::default()
    };
    let is_there = path.exists() && !path.is_dir();
    let (scene, size) = if is_there || has_scene_ending(path) {
        (import::load(path, &options)?, None)
    } else {
        let mut scene = builtin::build(name).map_err(|e| unknown_scene(path, &e))?;
        if let Some(view) = &args.view {
            import::apply_view(&mut scene, view)?;
        }
        let base = name.split(':').next().unwrap_or(name);
        (scene, builtin::list().iter().find(|b| b.name == base).map(|b| b.size))
    };
    for warning in scene.warnings.iter().take(MAX_WARNINGS) {
        terminal::warn(warning);
    }
    if scene.warnings.len() > MAX_WARNINGS {
        let more = scene.warnings.len() - MAX_WARNINGS;
        terminal::warn(format!("and {more} more; `rayburst info {name} --json` lists them all"));
    }
    Ok(Loaded { scene, name: name.to_owned(), size, seconds: start.elapsed().as_secs_f64() })
}

fn has_scene_ending(path: &Path) -> bool {
    let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase());
    ending.is_some_and(|e| ["gltf", "glb", "obj", "ply"].contains(&e.as_str()))
}

fn unknown_scene(path: &Path, error: &BuiltinError) -> CliError {
    if path.is_dir() {
        return CliError::failed(format!(
            "{} is a folder; name the .gltf, .glb, .obj or .ply file in it",
            path.display()
        ));
    }
    match error {
        BuiltinError::UnknownScene { .. } if path.components().count() > 1 => {
            CliError::failed(format!("{}: there is no such file", path.display()))
        }
        BuiltinError::UnknownScene { .. } => {
            let known: Vec<&str> = builtin::list().iter().map(|s| s.name).collect();
            let name = path.display().to_string();
            CliError::usage(format!(
                "{}; nor is there a file of that name",
                names::unknown("scene", &name, &known)
            ))
        }
        other => CliError::usage(other.to_string()),
    }
}

/// Which animations play: the one that is named, or those that can play together.
pub(crate) fn animations(scene: &Scene, args: &InstantArgs) -> Result<Vec<usize>> {
    let Some(given) = &args.animation else { return Ok(scene.default_animations()) };
    let all: Vec<&str> = scene.animations.iter().map(|a| a.name.as_str()).collect();
    pick("animation", given, &all).map(|index| vec![index])
}

/// The pose at a time; without one, the pose as authored.
pub(crate) fn pose(scene: &Scene, animations: &[usize], time: Option<f32>) -> Pose {
    time.map_or_else(|| Pose::rest(scene), |time| Pose::at(scene, animations, time))
}

/// The index of a thing that the user names or numbers.
pub(crate) fn pick(kind: &str, given: &str, all: &[&str]) -> Result<usize> {
    if let Some(index) = all.iter().position(|name| *name == given) {
        return Ok(index);
    }
    if let Ok(index) = given.parse::<usize>() {
        if index < all.len() {
            return Ok(index);
        }
        let count = all.len();
        return Err(CliError::usage(format!(
            "there is no {kind} number {index}: the scene has {count}, counted from 0"
        )));
    }
    if all.is_empty() {
        return Err(CliError::usage(format!("the scene has no {kind}")));
    }
    let shown: Vec<String> = all
        .iter()
        .enumerate()
        .map(|(i, name)| if name.is_empty() { i.to_string() } else { (*name).to_owned() })
        .collect();
    let shown: Vec<&str> = shown.iter().map(String::as_str).collect();
    Err(CliError::usage(names::unknown(kind, given, &shown)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn things_are_named_or_numbered() {
        let all = ["left", "", "7"];
        assert_eq!(pick("camera", "left", &all).unwrap(), 0);
        assert_eq!(pick("camera", "1", &all).unwrap(), 1);
        assert_eq!(pick("camera", "7", &all).unwrap(), 2, "names come first");
        let error = pick("camera", "lfet", &all).unwrap_err().to_string();
        assert!(error.contains("did you mean 'left'? (known: left, 1, 7)"), "{error}");
        assert!(pick("camera", "3", &all).unwrap_err().to_string().contains("has 3"));
    }
}
