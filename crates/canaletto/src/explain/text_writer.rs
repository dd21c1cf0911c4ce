//! The text that a tree is written to, with how its numbers look and what is folded.

use super::number::{Digits, Number};
use super::patch::RadiosityTerms;
use crate::math::Rgb;
use std::collections::BTreeSet;
use std::fmt::{Arguments, Display, LowerExp, Write};

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
    pub(super) lit: LitPlaces<'t>,
}

/// What lights the patches and the places under a pixel. In a full text each is written once.
pub(super) struct LitPlaces<'t> {
    pub(super) terms: &'t RadiosityTerms,
    /// The patches that are written already.
    pub(super) told: BTreeSet<u32>,
    /// The indices of the places that are written already.
    pub(super) told_places: BTreeSet<usize>,
}

impl<'t> TextWriter<'t> {
    pub(super) fn new(style: &TextStyle, levels: u32, terms: &'t RadiosityTerms) -> Self {
        let digits = style.digits.map_or(Digits::Exact, Digits::Significant);
        let lit = LitPlaces { terms, told: BTreeSet::new(), told_places: BTreeSet::new() };
        TextWriter { text: String::new(), is_full: style.is_full, levels, digits, lit }
    }

    /// Writes for `write!` and `writeln!`.
    pub(super) fn write_fmt(&mut self, arguments: Arguments) {
        // A string takes all that is written.
        let _ = self.text.write_fmt(arguments);
    }

    pub(super) fn number<T: Copy + Display + LowerExp + Into<f64>>(&self, value: T) -> Number<T> {
        Number(value, self.digits)
    }

    pub(super) fn rgb(&self, color: Rgb) -> String {
        self.vector(color.to_array())
    }

    pub(super) fn vector<T: Copy + Display + LowerExp + Into<f64>>(&self, v: [T; 3]) -> String {
        format!("({})", self.list(&v))
    }

    /// Numbers with commas between them.
    pub(super) fn list<T: Copy + Display + LowerExp + Into<f64>>(&self, numbers: &[T]) -> String {
        numbers.iter().map(|v| self.number(*v).to_string()).collect::<Vec<_>>().join(", ")
    }

    /// A length or an area with the digits of `f32`, since no sum depends on it.
    pub(super) fn size(&self, size: f64) -> Number<f32> {
        self.number(size as f32)
    }
}

/// A number with its noun, such as "1 ray" or "2 rays".
pub(super) fn counted(count: usize, noun: &str) -> String {
    format!("{count} {noun}{}", if count == 1 { "" } else { "s" })
}
