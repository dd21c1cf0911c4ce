//! `canaletto man`: manual pages.

use crate::exit::Exit;
use crate::failure::{Failure, reason};
use crate::output::write_file;
use crate::stdout::print;
use clap::Args;
use std::io::{self, Write};
use std::path::PathBuf;

/// Prints the manual page, or writes a page for every command.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct ManFlags {
    /// Sets the folder for canaletto.1, canaletto-render.1, ...; creates it if it doesn't exist
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

const EXAMPLES: &str = "\
Examples:
  canaletto man | man -l -
  canaletto man --out ~/.local/share/man/man1";

/// Runs the command.
pub(crate) fn run(flags: &ManFlags, mut command: clap::Command) -> Result<Exit, Failure> {
    let cant = |e: &io::Error| Failure::new(Exit::Failed, format!("can't make the manual: {}", reason(e)));
    let source = concat!("canaletto ", env!("CARGO_PKG_VERSION"));
    let page = |command: clap::Command| page(&command, source).map_err(|e| cant(&e));
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

/// A manual page in the order of man-pages(7).
fn page(command: &clap::Command, source: &str) -> io::Result<Vec<u8>> {
    let man = clap_mangen::Man::new(command.clone()).source(source).manual("Canaletto");
    let mut page = Vec::new();
    man.render_title(&mut page)?;
    man.render_name_section(&mut page)?;
    man.render_synopsis_section(&mut page)?;
    man.render_description_section(&mut page)?;
    if command.get_arguments().any(|arg| !arg.is_hide_set()) {
        man.render_options_section(&mut page)?;
    }
    if command.has_subcommands() {
        man.render_subcommands_section(&mut page)?;
    }
    let help = command.get_after_long_help().or(command.get_after_help()).map(ToString::to_string).unwrap_or_default();
    let (mut notes, mut examples) = (String::new(), String::new());
    for paragraph in help.split("\n\n") {
        match paragraph.strip_prefix(EXAMPLES_HEAD) {
            Some(rest) => examples += &as_written(rest),
            // Exit codes have a section of their own on the page.
            None if paragraph.starts_with(EXIT_HEAD) => {}
            None => notes += &format!(".PP\n{}", as_written(paragraph)),
        }
    }
    if !notes.is_empty() {
        write!(page, ".SH NOTES\n{notes}")?;
    }
    writeln!(page, ".SH \"EXIT STATUS\"")?;
    for (exit, meaning) in Exit::ALL {
        write!(page, ".TP\n{}\n{}\n", exit.code(), escaped(meaning))?;
    }
    if !examples.is_empty() {
        write!(page, ".SH EXAMPLES\n{examples}")?;
    }
    Ok(page)
}

/// The heading of the examples in help texts.
const EXAMPLES_HEAD: &str = "Examples:\n";
/// The heading of the table of exit codes in help texts.
const EXIT_HEAD: &str = "Exit codes:\n";

/// Formats lines without filling. troff would fill them into a paragraph.
fn as_written(text: &str) -> String {
    let lines: String = text.trim_end().lines().map(|line| format!("{}\n", escaped(line))).collect();
    format!(".nf\n{lines}.fi\n")
}

/// A line with the characters escaped that troff interprets.
fn escaped(line: &str) -> String {
    let line = line.replace('\\', "\\e").replace('-', "\\-");
    if line.starts_with(['.', '\'']) { format!("\\&{line}") } else { line }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    fn text_of(name: &str) -> String {
        let mut command = crate::Cli::command();
        command.build();
        let command = command.find_subcommand(name).unwrap_or(&command);
        String::from_utf8(page(command, "canaletto").unwrap()).unwrap()
    }

    #[test]
    fn every_page_has_examples_and_exit_codes_line_by_line() {
        for name in ["", "render", "explain", "info", "compare", "check", "completions", "man"] {
            let page = text_of(name);
            let sections: Vec<&str> = page.lines().filter_map(|line| line.strip_prefix(".SH ")).collect();
            assert_eq!(sections.iter().filter(|s| **s == "EXAMPLES").count(), 1, "{name}: {sections:?}");
            assert_eq!(sections.iter().filter(|s| **s == "\"EXIT STATUS\"").count(), 1, "{name}: {sections:?}");
            assert_eq!(sections[..2], ["NAME", "SYNOPSIS"], "{name}");
            let examples = page.split(".SH EXAMPLES\n").nth(1).unwrap();
            assert!(examples.starts_with(".nf\n  canaletto "), "{name}: {examples}");
            assert!(page.contains("\n.TP\n130\n"), "{name}");
            assert_eq!(page.matches(EXIT_HEAD.trim()).count(), 0, "{name}");
        }
    }

    #[test]
    fn lines_begin_no_request() {
        assert_eq!(escaped(".obj and -o \\"), "\\&.obj and \\-o \\e");
        assert_eq!(as_written("a\n  b\n"), ".nf\na\n  b\n.fi\n");
    }
}
