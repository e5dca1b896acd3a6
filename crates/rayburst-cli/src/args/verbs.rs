//! Options of the smaller verbs.

use std::path::PathBuf;

use super::{scene::InstantArgs, values};

/// Tell what is in a scene.
#[derive(clap::Args, Clone, Debug)]
#[command(after_help = "\
Examples:
  rayburst info sponza.gltf
  rayburst info cornell --json")]
pub(crate) struct InfoArgs {
    /// A .gltf, .glb, .obj or .ply file, or a built-in scene's name
    #[arg(value_name = "SCENE")]
    pub(crate) scene: String,
    #[command(flatten)]
    pub(crate) instant: InstantArgs,
    /// Print one JSON object
    #[arg(long)]
    pub(crate) json: bool,
}

/// List the built-in scenes, each with the figure of the chapter that it follows.
#[derive(clap::Args, Clone, Debug)]
#[command(after_help = "\
Examples:
  rayburst scenes
  rayburst render veach-mis -o veach.png")]
pub(crate) struct ScenesArgs {
    /// Print one JSON array
    #[arg(long)]
    pub(crate) json: bool,
}

/// Draw what a figure of the chapter shows, and print its property as a number.
#[derive(clap::Args, Clone, Debug)]
#[command(after_help = crate::figure::help())]
pub(crate) struct FigureArgs {
    /// Number of the figure
    #[arg(value_name = "26.N", value_parser = values::choice(crate::figure::FIGURES))]
    pub(crate) figure: crate::figure::Figure,
    /// Picture to write [default: figure-26.N.png]
    #[arg(short, long, value_name = "PATH")]
    pub(crate) output: Option<PathBuf>,
    /// Threads [default: one a core]
    #[arg(long, value_name = "N", value_parser = values::threads)]
    pub(crate) threads: Option<usize>,
}

/// Print a completion script for a shell.
#[derive(clap::Args, Clone, Debug)]
#[command(after_help = "\
Example:
  rayburst completions bash > ~/.local/share/bash-completion/completions/rayburst")]
pub(crate) struct CompletionsArgs {
    /// Which shell
    pub(crate) shell: clap_complete::Shell,
}
