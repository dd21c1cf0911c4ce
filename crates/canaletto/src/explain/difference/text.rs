//! Differences as text.

use super::{TermDifference, TreeDifference};
use crate::explain::number::{Digits, Number};
use crate::explain::term::TermValue;
use crate::explain::text_writer::counted;
use crate::math::Rgb;

/// The digits of numbers that look different with them.
const USUAL_DIGITS: u8 = 6;

impl TreeDifference {
    /// The difference as text. Numbers have this many digits, 6 if none is given, and more where only more digits show
    /// the difference.
    pub fn text(&self, digits: Option<u8>) -> String {
        let digits = digits.unwrap_or(USUAL_DIGITS);
        let mut out = String::new();
        match &self.first {
            None => out += &format!("nothing differs: {} are equal\n", counted(self.equal_terms, "term")),
            Some(first) => {
                out += &format!("first difference, after {}\n", counted(self.equal_terms, "equal term"));
                write(&mut out, first, digits);
            }
        }
        if !self.following.is_empty() {
            out += "summands that differ\n";
            self.following.iter().for_each(|term| write(&mut out, term, digits));
        }
        if self.more_following > 0 {
            out += &format!("  {} with smaller changes\n", counted(self.more_following, "other summand"));
        }
        let colors = self.colors.map(|color| TermValue::Numbers(color.to_array().map(f64::from).to_vec()));
        let [a, b] = shown(&colors, digits);
        out += &format!("colour  A {a}\n        B {b}\n");
        if let [Some(a), Some(b)] = self.bytes {
            let words = |bytes: [u8; 3]| bytes.map(|v| v.to_string()).join(" ");
            out += &format!("bytes   A {}\n        B {}\n", words(a), words(b));
        }
        out
    }
}

fn write(out: &mut String, term: &TermDifference, digits: u8) {
    let TermDifference { place, term, equation, values, reasons, change } = term;
    let way = if place.is_empty() { String::new() } else { format!("{}: ", place.join(" > ")) };
    let equation = equation.map_or(String::new(), |number| format!("  ({number})"));
    *out += &format!("  {way}{term}{equation}\n");
    for ((name, value), reason) in ["A", "B"].into_iter().zip(shown(values, digits)).zip(reasons) {
        let reason = reason.as_ref().map_or(String::new(), |reason| format!("  {reason}"));
        *out += &format!("    {name} {value}{reason}\n");
    }
    if let Some(Rgb { r, g, b }) = change {
        let [r, g, b] = [r, g, b].map(|v| Number(*v, Digits::Significant(digits)));
        *out += &format!("    changes the pixel by ({r}, {g}, {b})\n");
    }
}

/// Both values with so many digits that they differ.
fn shown(values: &[TermValue; 2], digits: u8) -> [String; 2] {
    let of = |digits: Digits| values.each_ref().map(|value| words(value, digits));
    let all = (digits..=17).map(|digits| of(Digits::Significant(digits)));
    all.into_iter().find(|[a, b]| a != b).unwrap_or_else(|| of(Digits::Significant(digits)))
}

fn words(value: &TermValue, digits: Digits) -> String {
    match value {
        TermValue::None => "none".into(),
        TermValue::Word(word) if word.is_empty() => "none".into(),
        TermValue::Word(word) => word.clone(),
        TermValue::Number(v) => Number(*v, digits).to_string(),
        TermValue::Numbers(all) => {
            let numbers: Vec<String> = all.iter().map(|v| Number(*v, digits).to_string()).collect();
            format!("({})", numbers.join(", "))
        }
    }
}
