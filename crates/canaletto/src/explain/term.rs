//! Terms: the named values of an explanation, in lines of words. A node makes its lines once. Texts write them, and
//! differences compare the terms in them.

use super::number::{Digits, Number};
use crate::math::Rgb;
use glam::DVec3;
use serde::Serialize;
use std::borrow::Cow;

/// The value of a term.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
#[non_exhaustive]
pub enum TermValue {
    /// There is no such term.
    None,
    /// A name or a word.
    Word(String),
    /// A number.
    Number(f64),
    /// A vector or a colour.
    Numbers(Vec<f64>),
}

/// A value as a node has it. A single number has no brackets.
pub(super) enum Value<'t> {
    None,
    Word(Cow<'t, str>),
    Singles(Vec<f32>),
    Doubles(Vec<f64>),
}

/// A value with its name, which is empty for a value that isn't compared.
pub(super) struct Term<'t> {
    pub(super) name: Cow<'t, str>,
    pub(super) equation: Option<&'static str>,
    pub(super) value: Value<'t>,
    /// Whether it follows from the ray, such that two rays always differ in it.
    pub(super) is_of_ray: bool,
    /// What a summand adds to the colour of its ray.
    pub(super) amount: Option<DVec3>,
    /// What leads to the value.
    pub(super) reason: Option<Box<dyn Fn() -> Option<Line<'t>> + 't>>,
}

/// A line: words, each with the term that follows them.
pub(super) struct Line<'t> {
    parts: Vec<(&'static str, Option<Term<'t>>)>,
    is_written: bool,
}

/// A line from its words and the values between them. `{n.L}` is the place of a term, `{f_s:5.39a}` that of a term with
/// an equation. A value at `{}` has the name that it was given, or is only written.
macro_rules! line {
    ($words:literal $(, $term:expr)* $(,)?) => {
        $crate::explain::term::Line::new($words, vec![$($crate::explain::term::Term::from($term)),*])
    };
}
pub(super) use line;

impl<'t> Line<'t> {
    pub(super) fn new(mut words: &'static str, terms: Vec<Term<'t>>) -> Line<'t> {
        debug_assert_eq!(words.matches('{').count(), terms.len(), "{words}");
        let mut parts = Vec::with_capacity(terms.len() + 1);
        for term in terms {
            let (before, place) = words.split_once('{').unwrap_or((words, ""));
            let (place, after) = place.split_once('}').unwrap_or_default();
            let (name, equation) = place.split_once(':').map_or((place, term.equation), |(name, of)| (name, Some(of)));
            let name = if name.is_empty() { term.name } else { name.into() };
            parts.push((before, Some(Term { name, equation, ..term })));
            words = after;
        }
        parts.push((words, None));
        Line { parts, is_written: true }
    }

    /// The line with another one behind it.
    pub(super) fn and(mut self, other: Line<'t>) -> Line<'t> {
        self.parts.extend(other.parts);
        self
    }

    /// The line with a list behind it.
    pub(super) fn list(self, items: impl IntoIterator<Item = Line<'t>>) -> Line<'t> {
        let with_comma = |(index, item)| if index > 0 { line!(", ").and(item) } else { item };
        items.into_iter().enumerate().map(with_comma).fold(self, Line::and)
    }

    /// The line with terms that follow from the ray.
    pub(super) fn of_ray(mut self) -> Line<'t> {
        self.parts.iter_mut().filter_map(|(_, term)| term.as_mut()).for_each(|term| term.is_of_ray = true);
        self
    }

    /// The line, which texts have on a condition.
    pub(super) fn written_if(self, is_written: bool) -> Line<'t> {
        Line { is_written, ..self }
    }

    /// The text of the line with these digits, if it is written.
    pub(super) fn text(&self, digits: Digits) -> Option<String> {
        let value = |term: &Option<Term>| term.as_ref().map_or(String::new(), |term| term.value.text(digits));
        let part = |(words, term): &(&str, _)| [(*words).to_owned(), value(term)];
        self.is_written.then(|| self.parts.iter().flat_map(part).collect())
    }

    /// Its terms that have names and values.
    pub(super) fn terms(self) -> impl Iterator<Item = Term<'t>> {
        let terms = self.parts.into_iter().filter_map(|(_, term)| term);
        terms.filter(|term| !term.name.is_empty() && !matches!(term.value, Value::None))
    }
}

/// A summand of a ray's colour.
pub(super) fn summand<'t>(color: Rgb) -> Term<'t> {
    Term { amount: Some(wide(color)), ..color.into() }
}

/// A term that follows from the ray.
pub(super) fn of_ray<'t>(value: impl Into<Value<'t>>) -> Term<'t> {
    Term { is_of_ray: true, ..value.into().into() }
}

impl<'t> Term<'t> {
    pub(super) fn named(self, name: impl Into<Cow<'t, str>>) -> Term<'t> {
        Term { name: name.into(), ..self }
    }

    pub(super) fn of(self, equation: &'static str) -> Term<'t> {
        Term { equation: Some(equation), ..self }
    }

    /// The term with what leads to its value.
    pub(super) fn because(self, reason: impl Fn() -> Option<Line<'t>> + 't) -> Term<'t> {
        Term { reason: Some(Box::new(reason)), ..self }
    }
}

impl<'t, V: Into<Value<'t>>> From<V> for Term<'t> {
    fn from(value: V) -> Term<'t> {
        let (name, value) = ("".into(), value.into());
        Term { name, value, equation: None, is_of_ray: false, amount: None, reason: None }
    }
}

impl Value<'_> {
    pub(super) fn text(&self, digits: Digits) -> String {
        let numbers: Vec<String> = match self {
            Value::None => return String::new(),
            Value::Word(word) => return word.to_string(),
            Value::Singles(all) => all.iter().map(|v| Number(*v, digits).to_string()).collect(),
            Value::Doubles(all) => all.iter().map(|v| Number(*v, digits).to_string()).collect(),
        };
        let list = numbers.join(", ");
        if numbers.len() == 1 { list } else { format!("({list})") }
    }
}

impl From<&Value<'_>> for TermValue {
    fn from(value: &Value) -> TermValue {
        // The digits that identify the `f32`.
        let exact = |v: &f32| v.to_string().parse().unwrap_or(f64::from(*v));
        let numbers = match value {
            Value::None => return TermValue::None,
            Value::Word(word) => return TermValue::Word(word.to_string()),
            Value::Singles(all) => all.iter().map(exact).collect(),
            Value::Doubles(all) => all.clone(),
        };
        if let [number] = numbers[..] { TermValue::Number(number) } else { TermValue::Numbers(numbers) }
    }
}

pub(super) fn wide(color: Rgb) -> DVec3 {
    DVec3::from(color.to_array().map(f64::from))
}

macro_rules! values {
    ($($from:ty, $v:ident => $value:expr;)*) => {
        $(impl<'t> From<$from> for Value<'t> { fn from($v: $from) -> Value<'t> { $value } })*
    };
}
values! {
    &'t str, v => Value::Word(v.into());
    &'t String, v => Value::Word(v.into());
    String, v => Value::Word(v.into());
    usize, v => Value::Doubles(vec![v as f64]);
    u32, v => Value::Doubles(vec![v.into()]);
    f32, v => Value::Singles(vec![v]);
    f64, v => Value::Doubles(vec![v]);
    Rgb, v => Value::Singles(v.to_array().into());
    &'t [f32], v => Value::Singles(v.into());
    [f32; 2], v => Value::Singles(v.into());
    [f32; 3], v => Value::Singles(v.into());
    [f32; 4], v => Value::Singles(v.into());
    [f64; 2], v => Value::Doubles(v.into());
    [f64; 3], v => Value::Doubles(v.into());
}

impl<'t, V: Into<Value<'t>>> From<Option<V>> for Value<'t> {
    fn from(v: Option<V>) -> Self {
        v.map_or(Value::None, V::into)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_has_words_for_texts_and_terms_for_differences() {
        let f_s = Term::from(0.25f32).because(|| Some(line!("blocked by {}", "a {box}")));
        let line = line!("f_s = {f_s:5.39a} of {}", f_s, "{lamp}").and(line!(" at {p}", [1.0, 2.5, -0.1]).of_ray());
        let line = line.and(line!(": ").list([line!("{}", 1usize), line!("{}{none}", "b", None::<f64>)]));
        assert_eq!(line.text(Digits::Exact).as_deref(), Some("f_s = 0.25 of {lamp} at (1, 2.5, -0.1): 1, b"));
        let terms: Vec<Term> = line.terms().collect();
        let names: Vec<_> = terms.iter().map(|term| (&*term.name, term.equation, term.is_of_ray)).collect();
        assert_eq!(names, [("f_s", Some("5.39a"), false), ("p", None, true)]);
        assert_eq!(TermValue::from(&terms[1].value), TermValue::Numbers(vec![1.0, 2.5, -0.1]));
        let reason = terms[0].reason.as_ref().and_then(|reason| reason()?.text(Digits::Exact));
        assert_eq!(reason.as_deref(), Some("blocked by a {box}"));
        assert_eq!(line!("{l}", summand(Rgb::WHITE)).written_if(false).text(Digits::Exact), None);
    }

    #[test]
    fn an_f32_has_the_digits_that_identify_it() {
        assert_eq!(TermValue::from(&Value::from(0.1f32)), TermValue::Number(0.1));
        assert_eq!(TermValue::from(&Value::from(Rgb::gray(0.1))), TermValue::Numbers(vec![0.1; 3]));
    }
}
