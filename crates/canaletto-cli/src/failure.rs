//! Errors of commands: every command returns a [`Failure`], and `main` prints it.

use crate::exit::Exit;
use crate::terminal::Paint;
use annotate_snippets::renderer::DecorStyle;
use annotate_snippets::{AnnotationKind, Group, Level, Origin, Renderer, Snippet};
use canaletto::memory::NoMemory;
use canaletto_io::diagnostic::{Diagnostic, Diagnostics, Severity, visible};
use serde_json::json;
use std::fmt::Display;
use std::io::{self, ErrorKind};

/// The reason for which a command failed.
#[derive(Debug)]
pub(crate) enum Failure {
    /// One sentence, with an optional hint.
    Message {
        /// The exit code.
        exit: Exit,
        /// The error message.
        message: String,
        /// A hint about the correction.
        help: Option<String>,
    },
    /// Mistakes in files.
    Diagnostics(Diagnostics),
    /// The messages are already printed.
    Reported(Exit),
}

impl Failure {
    pub(crate) fn new(exit: Exit, message: impl Display) -> Failure {
        Failure::Message { exit, message: message.to_string(), help: None }
    }

    /// A mistake on the command line.
    pub(crate) fn usage(message: impl Display) -> Failure {
        Failure::new(Exit::Usage, message)
    }

    /// Adds a hint to the failure.
    pub(crate) fn help(mut self, hint: impl Display) -> Failure {
        if let Failure::Message { help, .. } = &mut self {
            *help = Some(hint.to_string());
        }
        self
    }

    /// A failure to write results to stdout. A closed pipe counts as success, since its reader needs no more.
    pub(crate) fn stdout(error: &io::Error) -> Failure {
        match error.kind() {
            ErrorKind::BrokenPipe | ErrorKind::ConnectionReset => Failure::Reported(Exit::Done),
            _ => Failure::new(Exit::Failed, format!("can't write to the standard output: {}", reason(error))),
        }
    }

    /// Adds the frame's number to the failure.
    pub(crate) fn at_frame(mut self, frame: u32) -> Failure {
        match &mut self {
            Failure::Message { message, .. } => *message += &format!(" (at frame {frame})"),
            Failure::Diagnostics(all) => all.map_messages(|message| format!("{message} (at frame {frame})")),
            Failure::Reported(_) => {}
        }
        self
    }

    pub(crate) fn exit(&self) -> Exit {
        match self {
            Failure::Message { exit, .. } | Failure::Reported(exit) => *exit,
            // Mistakes in --set alone are mistakes on the command line.
            Failure::Diagnostics(all) if all.iter().all(|d| d.file == "--set") => Exit::Usage,
            // Lack of memory isn't a mistake in a file.
            Failure::Diagnostics(all) if all.iter().any(|d| d.message.contains(NoMemory::WORDS)) => Exit::Failed,
            Failure::Diagnostics(_) => Exit::Scene,
        }
    }

    /// Prints the failure on stderr.
    pub(crate) fn print(&self, json: bool) {
        match self {
            Failure::Reported(_) => {}
            _ if json => eprint_line(&self.json().to_string()),
            Failure::Message { message, help, .. } => {
                let paint = Paint::stderr();
                eprint_line(&format!("{} {}", paint.red("error:"), visible(message)));
                if let Some(help) = help {
                    eprint_line(&format!("{} {}", paint.cyan("help:"), visible(help)));
                }
            }
            Failure::Diagnostics(all) => print_diagnostics(all, false),
        }
    }

    fn json(&self) -> serde_json::Value {
        let mut event = json!({ "event": "error", "exit": self.exit().code() });
        match self {
            Failure::Message { message, help, .. } => {
                event["message"] = json!(message);
                event["help"] = json!(help);
            }
            Failure::Diagnostics(all) => event["diagnostics"] = json!(all),
            Failure::Reported(_) => {}
        }
        event
    }
}

impl From<Diagnostics> for Failure {
    fn from(all: Diagnostics) -> Failure {
        Failure::Diagnostics(all)
    }
}

pub(crate) use canaletto_io::assets::reason;

/// Prints a line on stderr. Errors are ignored, since they can't be reported.
pub(crate) fn eprint_line(line: &str) {
    use io::Write;
    let _ = writeln!(io::stderr().lock(), "{line}");
}

/// Prints messages about files with the lines that they refer to, then their number.
pub(crate) fn print_diagnostics(all: &Diagnostics, json: bool) {
    if json {
        if !all.is_empty() {
            eprint_line(&json!({ "event": "diagnostics", "diagnostics": all }).to_string());
        }
        return;
    }
    let paint = Paint::stderr();
    let renderer = if paint.on() { Renderer::styled() } else { Renderer::plain() }.decor_style(DecorStyle::Ascii);
    let more: Vec<Diagnostic> = all.more().collect();
    for diagnostic in all.iter().chain(&more) {
        eprint_line(&show(all, diagnostic, &renderer));
        eprint_line("");
    }
    let (errors, warnings) = (all.errors(), all.warnings());
    if errors > 1 {
        let more = if warnings > 0 { format!(" and {}", plural(warnings, "warning")) } else { String::new() };
        eprint_line(&format!("{}{more}", plural(errors, "error")));
    }
}

/// A number with its noun, such as "1 ray" and "2 rays".
pub(crate) fn plural(count: usize, noun: &str) -> String {
    format!("{count} {noun}{}", if count == 1 { "" } else { "s" })
}

/// Lines longer than this many bytes are cut around the place of the mistake and printed without the renderer.
const LONG_LINE: usize = 400;

fn show(all: &Diagnostics, diagnostic: &Diagnostic, renderer: &Renderer) -> String {
    let level = match diagnostic.severity {
        Severity::Error => Level::ERROR,
        Severity::Warning => Level::WARNING,
    };
    let file = visible(&diagnostic.file);
    let mut group: Group = level.primary_title(visible(&diagnostic.message)).element(match excerpt(all, diagnostic) {
        Some(excerpt) => {
            let mark = AnnotationKind::Primary.span(excerpt.mark);
            let mark = if diagnostic.label.is_empty() { mark } else { mark.label(visible(&diagnostic.label)) };
            annotate_snippets::Element::from(
                Snippet::source(excerpt.text).line_start(excerpt.first_line).path(&*file).annotation(mark),
            )
        }
        None if diagnostic.span.is_some() && all.source(&diagnostic.file).is_some() => {
            return all.render(diagnostic).trim_end().to_owned();
        }
        None => Origin::path(&*file).into(),
    });
    if excerpt(all, diagnostic).is_none() && !diagnostic.label.is_empty() {
        group = group.element(Level::NOTE.message(visible(&diagnostic.label)));
    }
    if let Some(help) = &diagnostic.help {
        group = group.element(Level::HELP.message(visible(help)));
    }
    renderer.render(&[group])
}

/// The lines around a place. The excerpt avoids a search through a large file for each message.
struct Excerpt<'a> {
    text: &'a str,
    first_line: usize,
    mark: std::ops::Range<usize>,
}

fn excerpt<'a>(all: &'a Diagnostics, diagnostic: &Diagnostic) -> Option<Excerpt<'a>> {
    let source = all.source(&diagnostic.file)?;
    let span = diagnostic.span.as_ref()?;
    let line = all.start(diagnostic)?.line;
    let on_boundary = source.get(span.start..span.end.min(source.len()))?;
    let start = source[..span.start].rfind('\n').map_or(0, |at| at + 1);
    // A span of several lines is shown on its first line.
    let length = on_boundary.find('\n').unwrap_or(on_boundary.len());
    let end = source[span.start + length..].find('\n').map_or(source.len(), |at| span.start + length + at);
    let text = source[start..end].trim_end_matches('\r');
    let mark = span.start - start..(span.start - start + length).min(text.len().max(span.start - start));
    (text.len() <= LONG_LINE).then_some(Excerpt { text, first_line: line, mark })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_is_shown_with_its_line() {
        let text = "a 1\n  sphre 2 {\n}\n";
        let mut all = Diagnostics::from(
            Diagnostic::error("s.kdl", "there is no \"sphre\"").at(6..16).label("unknown").help("did you mean sphere?"),
        );
        all.add_source("s.kdl", text);
        let diagnostic = all.iter().next().unwrap();
        let shown = show(&all, diagnostic, &Renderer::plain().decor_style(DecorStyle::Ascii));
        assert!(shown.contains("--> s.kdl:2:3"), "{shown}");
        assert!(shown.contains("2 |   sphre 2 {") && shown.contains("help: did you mean sphere?"), "{shown}");
    }

    #[test]
    fn places_at_the_end_and_odd_spans_do_not_panic() {
        for (text, span) in [("", 0..0), ("ab", 2..2), ("ab\r\n", 1..4), ("é", 1..2), ("x", 5..9)] {
            let mut all = Diagnostics::from(Diagnostic::error("s", "wrong").at(span));
            all.add_source("s", text);
            show(&all, all.iter().next().unwrap(), &Renderer::plain());
        }
    }

    #[test]
    fn the_system_speaks_without_numbers() {
        assert_eq!(reason(&io::Error::from_raw_os_error(2)), "no such file or directory");
    }
}
