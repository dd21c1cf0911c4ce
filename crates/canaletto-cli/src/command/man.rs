//! `canaletto man`: manual pages.

use crate::exit::Exit;
use crate::failure::{Failure, reason};
use crate::output::write_file;
use crate::stdout::print;
use clap::Args;
use std::path::PathBuf;

/// Prints the manual page, or writes a page for every command.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct ManFlags {
    /// The folder for canaletto.1, canaletto-render.1, ...; it is made if there is none
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

const EXAMPLES: &str = "\
Examples:
  canaletto man | man -l -
  canaletto man --out ~/.local/share/man/man1";

/// Runs the command.
pub(crate) fn run(flags: &ManFlags, mut command: clap::Command) -> Result<Exit, Failure> {
    let cant = |e: &std::io::Error| Failure::new(Exit::Failed, format!("can't make the manual: {}", reason(e)));
    let source = concat!("canaletto ", env!("CARGO_PKG_VERSION"));
    let page = |command: clap::Command| {
        let mut page = Vec::new();
        clap_mangen::Man::new(command)
            .source(source)
            .manual("Canaletto")
            .render(&mut page)
            .map(|()| page)
            .map_err(|e| cant(&e))
    };
    command.build();
    let Some(folder) = &flags.out else {
        print(&String::from_utf8_lossy(&page(command)?))?;
        return Ok(Exit::Done);
    };
    std::fs::create_dir_all(folder)
        .map_err(|e| Failure::new(Exit::Failed, format!("can't make {}: {}", folder.display(), reason(&e))))?;
    for subcommand in command.get_subcommands().filter(|c| !c.is_hide_set() && c.get_name() != "help") {
        let file = format!("canaletto-{}.1", subcommand.get_name());
        write_file(&folder.join(file), &page(subcommand.clone())?)?;
    }
    write_file(&folder.join("canaletto.1"), &page(command)?)?;
    Ok(Exit::Done)
}
