//! The command line's verbs and options.

pub(crate) mod bench;
pub(crate) mod frames;
pub(crate) mod render;
pub(crate) mod scene;
pub(crate) mod values;
pub(crate) mod verbs;

use clap::{Parser, Subcommand};

/// Real-time ray tracing on any CPU.
#[derive(Parser, Debug)]
#[command(
    name = "rayburst",
    version,
    max_term_width = 100,
    arg_required_else_help = true,
    subcommand_required = true,
    after_help = "Example:\n  rayburst render        the Cornell box, to rayburst.png"
)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) verb: Verb,
}

/// What to do.
#[derive(Subcommand, Debug)]
pub(crate) enum Verb {
    Render(Box<render::RenderArgs>),
    Info(verbs::InfoArgs),
    Scenes(verbs::ScenesArgs),
    Compare(verbs::CompareArgs),
    Inspect(Box<verbs::InspectArgs>),
    Figure(verbs::FigureArgs),
    Bench(bench::BenchArgs),
    Completions(verbs::CompletionsArgs),
}
