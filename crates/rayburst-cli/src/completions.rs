//! `rayburst completions`.

use clap::CommandFactory as _;

use crate::{
    args::{Cli, verbs::CompletionsArgs},
    error::{CliError, Result},
    terminal,
};

/// Prints the script.
pub(crate) fn run(args: &CompletionsArgs) -> Result<()> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::command(), "rayburst", &mut script);
    let script = String::from_utf8(script)
        .map_err(|_| CliError::failed("the completion script is not text"))?;
    terminal::result(script.trim_end())
}
