//! The walk through two trees: how values are compared, and what is kept of the differences.

use super::{MOST_FOLLOWING, TermDifference, TreeDifference};
use crate::explain::number::{Digits, Number};
use crate::explain::patch::RadiosityTerms;
use crate::explain::term::{Line, Term, TermValue, wide};
use crate::math::Rgb;
use glam::DVec3;
use std::collections::{BTreeMap, BTreeSet};

/// The digits of numbers in reasons.
const REASON_DIGITS: Digits = Digits::Significant(6);

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

/// Terms of one name. One that only the other tree has comes before the next common one.
fn pairs<'l>([own, other]: [Vec<Term<'l>>; 2]) -> Vec<[Option<Term<'l>>; 2]> {
    let names: BTreeSet<String> = own.iter().map(|term| term.name.to_string()).collect();
    let mut others: Vec<Option<Term>> = other.into_iter().map(Some).collect();
    let mut pairs = Vec::new();
    for term in own {
        let partner = others.iter().position(|other| other.as_ref().is_some_and(|other| other.name == term.name));
        let is_alone = |other: &Option<Term>| other.as_ref().is_some_and(|other| !names.contains(&*other.name));
        let before = others[..partner.unwrap_or(0)].iter_mut().filter(|other| is_alone(other));
        pairs.extend(before.map(|other| [None, other.take()]));
        pairs.push([Some(term), partner.and_then(|index| others[index].take())]);
    }
    pairs.extend(others.into_iter().flatten().map(|other| [None, Some(other)]));
    pairs
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

    /// Compares the terms of two nodes by their names, in their order. Summands come after all other terms.
    pub(super) fn lines<'l>(&mut self, lines: [impl IntoIterator<Item = Line<'l>>; 2]) {
        let is_compared = |term: &Term| self.is_one_ray || !term.is_of_ray;
        let terms = lines.map(|lines| lines.into_iter().flat_map(Line::terms).filter(is_compared).collect());
        let is_summand = |pair: &[Option<Term>; 2]| pair.iter().flatten().any(|term| term.amount.is_some());
        let (summands, others): (Vec<_>, Vec<_>) = pairs(terms).into_iter().partition(is_summand);
        others.into_iter().chain(summands).for_each(|pair| self.pair(pair));
    }

    /// Compares a term of both trees.
    pub(super) fn pair(&mut self, pair: [Option<Term>; 2]) {
        let both = pair.each_ref().map(Option::as_ref);
        let Some(either) = both[0].or(both[1]) else { return };
        if either.amount.is_none() && self.first.is_some() {
            return;
        }
        let values = both.map(|term| term.map_or(TermValue::None, |term| (&term.value).into()));
        if self.is_same([&values[0], &values[1]]) {
            self.equal_terms += usize::from(self.first.is_none());
            return;
        }
        let [a, b] = both.map(|term| term.and_then(|term| term.amount));
        let change = a.or(b).map(|_| self.weight * (b.unwrap_or_default() - a.unwrap_or_default()));
        let difference = TermDifference {
            place: self.place.clone(),
            term: either.name.to_string(),
            equation: either.equation,
            values,
            reasons: both.map(|term| term?.reason.as_ref()?()?.text(REASON_DIGITS)),
            change: change.map(|change| change.as_vec3().to_array().into()),
        };
        // Of two rays, all summands differ a little. The largest one counts.
        if self.first.is_none() && (change.is_none() || self.is_one_ray) {
            self.first = Some(difference.clone());
        }
        if change.is_some() {
            self.summands.push(difference);
        }
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
