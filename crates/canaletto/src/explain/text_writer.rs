//! The text that a tree is written to, with how its numbers look and what is folded.

use super::number::Digits;
use super::patch::RadiosityTerms;
use super::term::Line;
use std::collections::BTreeSet;
use std::fmt::{Arguments, Write};

/// How the text of a tree is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct TextStyle {
    /// Whether all samples, all points of lights and all links are written. If not, what is alike is folded into one
    /// line.
    pub is_full: bool,
    /// The level of the deepest rays that are written; camera rays have level 1. None stands for all rays of a full
    /// text. A folded text then has as many levels as its lines allow.
    pub levels: Option<u32>,
    /// The significant digits of numbers. None stands for those from which the number can be read back.
    pub digits: Option<u8>,
}

impl TextStyle {
    /// All of a tree, with numbers that read back exactly.
    pub const FULL: TextStyle = TextStyle { is_full: true, levels: None, digits: None };

    /// The text that fits on a few screens, with numbers for people.
    pub const SHORT: TextStyle = TextStyle { is_full: false, levels: None, digits: Some(6) };
}

/// The text of a tree while it is written.
pub(super) struct TextWriter<'t> {
    pub(super) text: String,
    pub(super) is_full: bool,
    /// The level of the deepest rays that are written.
    pub(super) levels: u32,
    digits: Digits,
    /// What lights the patches and the places under a pixel. In a full text each is written once.
    pub(super) terms: &'t RadiosityTerms,
    /// The patches that are written already.
    pub(super) told: BTreeSet<u32>,
    /// The indices of the places that are written already.
    pub(super) told_places: BTreeSet<usize>,
}

impl<'t> TextWriter<'t> {
    pub(super) fn new(style: &TextStyle, levels: u32, terms: &'t RadiosityTerms) -> Self {
        let digits = style.digits.map_or(Digits::Exact, Digits::Significant);
        let (is_full, told, told_places) = (style.is_full, BTreeSet::new(), BTreeSet::new());
        TextWriter { text: String::new(), is_full, levels, digits, terms, told, told_places }
    }

    /// Writes for `write!` and `writeln!`.
    pub(super) fn write_fmt(&mut self, arguments: Arguments) {
        // A string takes all that is written.
        let _ = self.text.write_fmt(arguments);
    }

    /// Writes lines behind an indent.
    pub(super) fn lines<'a>(&mut self, indent: &str, lines: impl IntoIterator<Item = Line<'a>>) {
        lines.into_iter().for_each(|line| self.line(indent, &line));
    }

    pub(super) fn line(&mut self, indent: &str, line: &Line) {
        if let Some(line) = line.text(self.digits) {
            writeln!(self, "{indent}{line}");
        }
    }
}

/// A number with its noun, such as "1 ray" or "2 rays".
pub(super) fn counted(count: usize, noun: &str) -> String {
    format!("{count} {noun}{}", if count == 1 { "" } else { "s" })
}
