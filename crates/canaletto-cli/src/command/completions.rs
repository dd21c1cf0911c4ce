//! `canaletto completions`: shell scripts that complete commands and flags.

use crate::exit::Exit;
use crate::failure::Failure;
use crate::stdout::print;
use clap::Args;
use clap_complete::Shell;

/// Prints a script that lets a shell complete canaletto's commands and flags.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct CompletionsFlags {
    /// The shell
    #[arg(value_name = "SHELL")]
    pub shell: Shell,
}

const EXAMPLES: &str = "\
Examples:
  canaletto completions bash > ~/.local/share/bash-completion/completions/canaletto
  canaletto completions fish > ~/.config/fish/completions/canaletto.fish
  canaletto completions zsh > ~/.zfunc/_canaletto";

/// Runs the command.
pub(crate) fn run(flags: &CompletionsFlags, mut command: clap::Command) -> Result<Exit, Failure> {
    let mut document = Vec::new();
    clap_complete::generate(flags.shell, &mut command, "canaletto", &mut document);
    print(&String::from_utf8_lossy(&document))?;
    Ok(Exit::Done)
}
