//! `canaletto man`: manual pages.

use crate::exit::Exit;
use crate::failure::{Failure, reason};
use crate::instructions::VARIABLE;
use crate::output::write_file;
use crate::stdout::print;
use canaletto::InstructionSet;
use canaletto_io::diagnostic::word_list;
use canaletto_io::import::FORMATS;
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
    command.build();
    let pages = pages(&command);
    let page = |command: clap::Command| page(&command, source, &pages).map_err(|e| cant(&e));
    let Some(folder) = &flags.out else {
        print(&String::from_utf8_lossy(&page(command)?))?;
        return Ok(Exit::Done);
    };
    std::fs::create_dir_all(folder)
        .map_err(|e| Failure::new(Exit::Failed, format!("can't make {}: {}", folder.display(), reason(&e))))?;
    for subcommand in command.get_subcommands().filter(|c| has_page(c)) {
        let file = format!("canaletto-{}.1", subcommand.get_name());
        write_file(&folder.join(file), &page(subcommand.clone())?)?;
    }
    write_file(&folder.join("canaletto.1"), &page(command)?)?;
    Ok(Exit::Done)
}

/// Whether a subcommand has a page.
fn has_page(command: &clap::Command) -> bool {
    !command.is_hide_set() && command.get_name() != "help"
}

/// The names of all pages.
fn pages(command: &clap::Command) -> Vec<String> {
    let subcommands = command.get_subcommands().filter(|c| has_page(c));
    let subcommands = subcommands.map(|subcommand| format!("canaletto-{}", subcommand.get_name()));
    ["canaletto".to_owned()].into_iter().chain(subcommands).collect()
}

/// A manual page in the order of man-pages(7). `pages` are the names of all pages.
fn page(command: &clap::Command, source: &str, pages: &[String]) -> io::Result<Vec<u8>> {
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
        writeln!(page, ".SH COMMANDS")?;
        for subcommand in command.get_subcommands().filter(|c| has_page(c)) {
            let about = subcommand.get_about().map(ToString::to_string).unwrap_or_default();
            write!(page, ".TP\n{}\n{}\n", reference(&format!("canaletto-{}", subcommand.get_name())), escaped(&about))?;
        }
    }
    let help = command.get_after_long_help().or(command.get_after_help()).map(ToString::to_string).unwrap_or_default();
    let (mut notes, mut examples) = (String::new(), String::new());
    for paragraph in help.split("\n\n") {
        match paragraph.strip_prefix(EXAMPLES_HEAD) {
            Some(rest) => examples += &as_written(rest),
            // Exit codes have a section of their own on the page.
            None if paragraph.starts_with(EXIT_HEAD) => {}
            // A table has several lines. Text is one long line, which troff fills.
            None if paragraph.trim().contains('\n') => notes += &format!(".PP\n{}", as_written(paragraph)),
            None => notes += &format!(".PP\n{}\n", escaped(paragraph.trim())),
        }
    }
    writeln!(page, ".SH \"EXIT STATUS\"")?;
    for (exit, meaning) in Exit::ALL {
        write!(page, ".TP\n{}\n{}\n", exit.code(), escaped(meaning))?;
    }
    for (heading, entries) in [("ENVIRONMENT", environment(command)), ("FILES", files(command))] {
        if !entries.is_empty() {
            writeln!(page, ".SH {heading}")?;
        }
        for (name, meaning) in entries {
            write!(page, ".TP\n\\fI{}\\fR\n{}\n", escaped(&name), escaped(&meaning))?;
        }
    }
    if !notes.is_empty() {
        write!(page, ".SH NOTES\n{notes}")?;
    }
    if !examples.is_empty() {
        write!(page, ".SH EXAMPLES\n{examples}")?;
    }
    let own = command.get_display_name().unwrap_or_default();
    let others = pages.iter().filter(|name| *name != own);
    let others: Vec<String> = others.map(|name| reference(name)).collect();
    write!(page, ".SH \"SEE ALSO\"\n{}\n", others.join(",\n"))?;
    Ok(page)
}

/// The name of a page with its section.
fn reference(page: &str) -> String {
    format!("\\fB{}\\fR(1)", escaped(page))
}

/// Whether a command, or any of its subcommands, has an argument.
fn has(command: &clap::Command, id: &str) -> bool {
    let own = command.get_arguments().any(|arg| arg.get_id() == id);
    own || command.get_subcommands().any(|subcommand| has(subcommand, id))
}

/// The variables that a command reads, with their meanings.
fn environment(command: &clap::Command) -> Vec<(String, String)> {
    let mut all = vec![(
        "NO_COLOR, TERM",
        "Messages have no colours if NO_COLOR isn't empty or TERM is dumb. Only terminals get colours.".to_owned(),
    )];
    if has(command, "scene") {
        let sets: Vec<&str> = InstructionSet::ALL.iter().map(|set| set.name()).collect();
        let meaning = format!(
            "The most that is used of the processor's instructions: {}. No picture depends on it.",
            word_list(&sets, "or")
        );
        all.push((VARIABLE, meaning));
    }
    if has(command, "fps") {
        all.push(("PATH", "The program ffmpeg is looked for in it. Some formats of films need it.".to_owned()));
    }
    all.into_iter().map(|(name, meaning)| (name.to_owned(), meaning)).collect()
}

/// The files that a command reads and writes, with their meanings.
fn files(command: &clap::Command) -> Vec<(String, String)> {
    let mut all = Vec::new();
    if has(command, "scene") || has(command, "scenes") {
        let models: Vec<String> = FORMATS.iter().flat_map(|f| f.extensions).map(|e| format!("name.{e}")).collect();
        all.push(("name.kdl".to_owned(), "A scene text. It names only files below its own folder.".to_owned()));
        all.push((models.join(", "), "Models, and scenes of other programs.".to_owned()));
    }
    if has(command, "output") {
        let temporary = "A file that is being written. It gets its name when it is complete. The next run in its folder \
                         removes those that a killed program left.";
        all.push((".canaletto-*.tmp".to_owned(), temporary.to_owned()));
    }
    if has(command, "preview") {
        let part = "The finished part of a picture whose render was interrupted. The next complete picture removes it.";
        all.push(("name.partial.png".to_owned(), part.to_owned()));
    }
    all
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
        let pages = pages(&command);
        let command = command.find_subcommand(name).unwrap_or(&command);
        String::from_utf8(page(command, "canaletto", &pages).unwrap()).unwrap()
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
    fn pages_tell_of_files_environment_and_each_other() {
        let render = text_of("render");
        for part in [
            r".canaletto\-*.tmp",
            "name.kdl",
            "name.partial.png",
            "NO_COLOR",
            VARIABLE,
            "ffmpeg",
            r"\fBcanaletto\-info\fR(1)",
            r"\fBcanaletto\fR(1)",
        ] {
            assert!(render.contains(part), "{part}");
        }
        let other = render.split(".SH \"SEE ALSO\"\n").nth(1).unwrap();
        assert!(!other.contains(r"canaletto\-render") && !other.contains("help"), "{other}");
        assert!(!text_of("compare").contains("name.kdl") && !text_of("compare").contains("ffmpeg"));
        assert!(text_of("check").contains("name.kdl"));
        assert!(!text_of("").contains(r"canaletto\-help"));
        // Text is filled, tables keep their lines.
        let notes = render.split(".SH NOTES\n").nth(1).unwrap();
        assert!(notes.contains(".PP\nCtrl\\-C stops") && notes.contains(".nf\nA PNG layer"), "{notes}");
    }

    #[test]
    fn lines_begin_no_request() {
        assert_eq!(escaped(".obj and -o \\"), "\\&.obj and \\-o \\e");
        assert_eq!(as_written("a\n  b\n"), ".nf\na\n  b\n.fi\n");
    }
}
