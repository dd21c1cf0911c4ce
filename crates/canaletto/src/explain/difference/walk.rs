//! The walk through two trees: how values are compared, and what is kept of the differences.

use super::{MOST_FOLLOWING, TermDifference, TermValue, TreeDifference};
use crate::explain::number::{Digits, Number};
use crate::explain::patch::RadiosityTerms;
use crate::math::Rgb;
use glam::DVec3;
use std::collections::BTreeMap;

/// What leads to both values of a term.
pub(super) type Reasons = [Option<String>; 2];

/// No reasons.
pub(super) const UNKNOWN: Reasons = [None, None];

/// A walk through two trees in step.
pub(super) struct Walk<'t> {
    /// What lights the patches in both trees.
    pub(super) terms: [&'t RadiosityTerms; 2],
    /// Whether both trees explain one ray, such that what follows from the ray is compared.
    pub(super) is_one_ray: bool,
    digits: Option<u8>,
    first: Option<TermDifference>,
    equal_terms: usize,
    summands: Vec<TermDifference>,
    place: Vec<String>,
    /// The factor of the current ray's colour in the pixel.
    pub(super) weight: DVec3,
}

/// How much a summand changes the pixel.
fn size(summand: &TermDifference) -> f64 {
    summand.change.map_or(0.0, |change| wide(change).abs().max_element())
}

/// The name of a sample in places.
pub(super) fn sample_name(index: usize) -> String {
    format!("{SAMPLE}{}", index + 1)
}

const SAMPLE: &str = "sample ";

/// The summands with those of several samples as one. It has the values of the sample in which it changes most.
fn folded(all: Vec<TermDifference>) -> Vec<TermDifference> {
    let below = |term: &TermDifference| {
        let is_sample = term.place.first().is_some_and(|name| name.starts_with(SAMPLE));
        (term.place[usize::from(is_sample)..].to_vec(), term.term.clone())
    };
    let mut folded: Vec<(TermDifference, DVec3, usize)> = Vec::new();
    let mut places = BTreeMap::new();
    for term in all {
        let change = term.change.map_or(DVec3::ZERO, wide);
        let index = *places.entry(below(&term)).or_insert(folded.len());
        match folded.get_mut(index) {
            None => folded.push((term, change, 1)),
            Some((largest, sum, count)) => {
                (*sum, *count) = (*sum + change, *count + 1);
                if size(&term) > size(largest) {
                    *largest = term;
                }
            }
        }
    }
    let whole = |(mut term, sum, count): (TermDifference, DVec3, usize)| {
        term.change = Some(sum.as_vec3().to_array().into());
        if count > 1 {
            term.place[0] = format!("{count} samples, such as {}", term.place[0]);
        }
        term
    };
    folded.into_iter().map(whole).collect()
}

/// A number with the digits that identify the `f32`.
pub(super) fn exact(v: f32) -> f64 {
    v.to_string().parse().unwrap_or(v.into())
}

pub(super) fn wide(color: Rgb) -> DVec3 {
    DVec3::from(color.to_array().map(f64::from))
}

pub(super) fn vector(v: [f32; 3]) -> TermValue {
    TermValue::Numbers(v.map(exact).to_vec())
}

pub(super) fn word(word: &str) -> TermValue {
    TermValue::Word(word.to_owned())
}

impl<'t> Walk<'t> {
    pub(super) fn new(terms: [&'t RadiosityTerms; 2], is_one_ray: bool, digits: Option<u8>) -> Walk<'t> {
        Walk {
            terms,
            is_one_ray,
            digits,
            first: None,
            equal_terms: 0,
            summands: Vec::new(),
            place: Vec::new(),
            weight: DVec3::ONE,
        }
    }

    /// Walks below a node of this name, if it has one.
    pub(super) fn below(&mut self, name: Option<String>, walk: impl FnOnce(&mut Self)) {
        let depth = self.place.len();
        self.place.extend(name);
        walk(self);
        self.place.truncate(depth);
    }

    fn is_same(&self, [a, b]: [&TermValue; 2]) -> bool {
        let is_near = |a: f64, b: f64| match self.digits {
            _ if a == b || (a.is_nan() && b.is_nan()) => true,
            Some(digits) => {
                let [a, b] = [a, b].map(|v| Number(v, Digits::Significant(digits)).to_string());
                a == b
            }
            None => false,
        };
        match (a, b) {
            (TermValue::Number(a), TermValue::Number(b)) => is_near(*a, *b),
            (TermValue::Numbers(a), TermValue::Numbers(b)) => {
                a.len() == b.len() && a.iter().zip(b).all(|(a, b)| is_near(*a, *b))
            }
            _ => a == b,
        }
    }

    fn difference(
        &self,
        term: &str,
        equation: Option<&'static str>,
        values: [TermValue; 2],
        reasons: Reasons,
    ) -> TermDifference {
        TermDifference { place: self.place.clone(), term: term.to_owned(), equation, values, reasons, change: None }
    }

    /// Compares a term.
    pub(super) fn term(
        &mut self,
        term: &str,
        equation: Option<&'static str>,
        values: [TermValue; 2],
        reasons: impl FnOnce() -> Reasons,
    ) {
        if self.first.is_some() {
            return;
        }
        if self.is_same([&values[0], &values[1]]) {
            self.equal_terms += 1;
            return;
        }
        self.first = Some(self.difference(term, equation, values, reasons()));
    }

    pub(super) fn number(&mut self, term: &str, equation: Option<&'static str>, values: [f64; 2]) {
        self.term(term, equation, values.map(TermValue::Number), || UNKNOWN);
    }

    pub(super) fn numbers(&mut self, term: &str, equation: Option<&'static str>, values: [&[f64]; 2]) {
        self.term(term, equation, values.map(|v| TermValue::Numbers(v.to_vec())), || UNKNOWN);
    }

    pub(super) fn words(&mut self, term: &str, values: [&str; 2]) {
        self.term(term, None, values.map(word), || UNKNOWN);
    }

    /// Compares a colour that isn't a summand of its own.
    pub(super) fn color(&mut self, term: &str, equation: Option<&'static str>, values: [Rgb; 2]) {
        self.term(term, equation, values.map(|color| vector(color.to_array())), || UNKNOWN);
    }

    /// Compares a summand of the current ray's colour.
    pub(super) fn summand(
        &mut self,
        term: &str,
        equation: Option<&'static str>,
        values: [Option<Rgb>; 2],
        reasons: impl FnOnce() -> Reasons,
    ) {
        let [a, b] = values.map(|color| color.map_or(DVec3::ZERO, wide));
        self.changed_summand(term, equation, values, b - a, reasons);
    }

    /// Compares a summand that changes the current ray's colour by `change`.
    pub(super) fn changed_summand(
        &mut self,
        term: &str,
        equation: Option<&'static str>,
        values: [Option<Rgb>; 2],
        change: DVec3,
        reasons: impl FnOnce() -> Reasons,
    ) {
        let values = values.map(|color| color.map_or(TermValue::None, |color| vector(color.to_array())));
        if self.is_same([&values[0], &values[1]]) {
            self.equal_terms += usize::from(self.first.is_none());
            return;
        }
        let change = Some((self.weight * change).as_vec3().to_array().into());
        let difference = TermDifference { change, ..self.difference(term, equation, values, reasons()) };
        // Of two rays, all summands differ a little. The largest one counts.
        if self.first.is_none() && self.is_one_ray {
            self.first = Some(difference.clone());
        }
        self.summands.push(difference);
    }

    /// The difference with the colours of both pixels and their bytes.
    pub(super) fn finished(self, colors: [Rgb; 2], bytes: [Option<[u8; 3]>; 2]) -> TreeDifference {
        let Walk { first, equal_terms, summands, .. } = self;
        let mut summands = folded(summands);
        let largest = summands.iter().max_by(|a, b| size(a).total_cmp(&size(b)));
        let first = first.or_else(|| largest.cloned());
        let is_first = |term: &TermDifference| {
            first.as_ref().is_some_and(|first| first.place == term.place && first.term == term.term)
        };
        summands.retain(|term| !is_first(term));
        // The largest ones, in the order of the walk.
        let mut order: Vec<usize> = (0..summands.len()).collect();
        order.sort_by(|&a, &b| size(&summands[b]).total_cmp(&size(&summands[a])).then(a.cmp(&b)));
        order.truncate(MOST_FOLLOWING);
        order.sort_unstable();
        let following: Vec<TermDifference> = order.iter().map(|&index| summands[index].clone()).collect();
        let more_following = summands.len() - following.len();
        TreeDifference { first, equal_terms, following, more_following, colors, bytes }
    }
}
