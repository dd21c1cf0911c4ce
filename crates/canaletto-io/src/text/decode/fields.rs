//! The fields of a node, validated against the schema.

use crate::text::closest_word::closest_word;
use crate::text::files::Files;
use crate::text::report::{Message, Report};
use crate::text::schema::{self, FieldSchema, NodeSchema, SYNONYMS, TRANSFORMS, ValueType, objects};
use crate::text::syntax::{Node, Span, Value, ValueKind};
use canaletto::Named;
use canaletto::math::Rgb;
use glam::{DVec3, Vec3};

/// The fields of a node, each value validated. Mistakes were reported.
pub(crate) struct Fields<'a> {
    pub(crate) node: &'a Node,
    got: Vec<Entry<'a>>,
    /// The transforms in the order in which they are written.
    pub(crate) transforms: Vec<Entry<'a>>,
    /// The objects and lights in the node.
    pub(crate) objects: Vec<&'a Node>,
    /// Whether all fields are valid and none is missing.
    pub(crate) valid: bool,
    /// The fields that misspelled words probably mean, so that they aren't reported as missing.
    meant: Vec<&'static str>,
}

/// A field with its values.
pub(crate) struct Entry<'a> {
    pub(crate) word: &'static FieldSchema,
    pub(crate) values: &'a [Value],
    /// The node of the values; `None` for a property.
    pub(crate) node: Option<&'a Node>,
    pub(crate) span: Span,
    good: bool,
}

/// The context of validation: the report and the files.
pub(crate) struct Validator<'a> {
    pub(crate) files: &'a Files,
    pub(crate) report: Report,
    /// The number of suggestions that were computed for unknown names.
    guesses: usize,
}

/// The largest number of unknown names for which suggestions are computed.
const MAX_GUESSES: usize = 50;

impl<'a> Validator<'a> {
    pub(crate) fn new(files: &'a Files, report: Report) -> Validator<'a> {
        Validator { files, report, guesses: 0 }
    }

    /// Validates the fields of a node. `title` is its name in messages.
    pub(crate) fn fields<'n>(&mut self, node: &'n Node, words: &'static NodeSchema, title: &str) -> Fields<'n> {
        let mut fields = Fields {
            node,
            got: Vec::new(),
            transforms: Vec::new(),
            objects: Vec::new(),
            valid: !node.broken,
            meant: Vec::new(),
        };
        self.argument(node, words, title, &mut fields);
        for property in &node.properties {
            let values = std::slice::from_ref(&property.value);
            let span = Span { end: property.value.span.end, ..property.key_span };
            match find(words, &property.key) {
                Some(word) => {
                    let got = Entry { word, values, node: None, span, good: true };
                    self.add(&mut fields, got, property.key_span, title);
                }
                None => {
                    fields.valid = false;
                    fields.meant.extend(self.unknown(&property.key, property.key_span, words, title));
                }
            }
        }
        for child in &node.children {
            if child.name.is_empty() {
                continue;
            }
            match find(words, &child.name) {
                Some(word) => {
                    let got = Entry { word, values: &child.values, node: Some(child), span: child.span, good: true };
                    self.add(&mut fields, got, child.name_span, title);
                }
                None if words.objects && objects().any(|name| *name == *child.name) => fields.objects.push(child),
                None => {
                    fields.valid = false;
                    fields.meant.extend(self.unknown(&child.name, child.name_span, words, title));
                }
            }
        }
        self.missing(words, title, &mut fields);
        fields
    }

    /// Validates the values right after the node's name.
    fn argument<'n>(&mut self, node: &'n Node, words: &'static NodeSchema, title: &str, fields: &mut Fields<'n>) {
        let (Some(first), Some(last)) = (node.values.first(), node.values.last()) else { return };
        let span = Span { end: last.span.end, ..first.span };
        let Some(word) = &words.argument else {
            if node.broken {
                return;
            }
            fields.valid = false;
            let mut message = Message::error(span, format!("{title} takes no values right after its name"));
            if let (Some(text), Some(_)) = (first.as_text(), words.word("name")) {
                message = message.help(format!("a name is written name={text:?}"));
            } else {
                message = message.help(format!("its words stand in braces: {}", words.allowed().join(", ")));
            }
            self.report.push(message);
            return;
        };
        let got = Entry { word, values: &node.values, node: None, span, good: !node.broken };
        let good = got.good && self.validator(title, word, &got);
        fields.valid &= good;
        fields.got.push(Entry { good, ..got });
    }

    fn add<'n>(&mut self, fields: &mut Fields<'n>, mut got: Entry<'n>, key: Span, title: &str) {
        let repeatable = TRANSFORMS.iter().any(|word| std::ptr::eq(word, got.word));
        let earlier = fields.got.iter().find(|other| other.word.name == got.word.name).map(|other| other.span);
        if let Some(earlier) = earlier.filter(|_| !repeatable && !got.word.many) {
            let place = self.files.first(earlier, key);
            let message = Message::error(key, format!("{title} has two {}", plural(got.word.name)));
            self.report.push(message.label(place));
            fields.valid = false;
            return;
        }
        got.good = match got.node {
            Some(node) if node.broken => false,
            // A field with a block is validated when the block is read.
            Some(_) if matches!(got.word.value_type, ValueType::Node(_)) => true,
            Some(node) => self.plain(node) && self.validator(got.word.name, got.word, &got),
            None => self.validator(got.word.name, got.word, &got),
        };
        fields.valid &= got.good;
        if repeatable { fields.transforms.push(got) } else { fields.got.push(got) }
    }

    fn missing(&mut self, words: &'static NodeSchema, title: &str, fields: &mut Fields) {
        let has = |word: &FieldSchema| {
            fields.got.iter().any(|got| got.word.name == word.name) || fields.meant.contains(&word.name)
        };
        let needed = words.argument.iter().chain(words.own()).filter(|word| word.needed);
        let missing: Vec<&str> = needed.filter(|word| !has(word)).map(|word| word.name).collect();
        fields.valid &= fields.meant.is_empty();
        if missing.is_empty() {
            return;
        }
        let its = if words.argument.as_ref().is_some_and(|word| missing[0] == word.name) { "its " } else { "" };
        // After a mistake in the node itself, a field that seems missing may be the part that couldn't be read.
        if !fields.node.broken {
            let list = match missing.as_slice() {
                [most @ .., last] if !most.is_empty() => format!("{} and {last}", most.join(", ")),
                _ => missing.join(""),
            };
            let mut message = Message::error(fields.node.name_span, format!("{title} needs {its}{list}"));
            if !words.example.is_empty() {
                message = message.help(format!("for example: {}", words.example));
            }
            self.report.push(message);
        }
        fields.valid = false;
    }

    /// Reports a word that is unknown here; returns the one that is probably meant.
    fn unknown(&mut self, name: &str, span: Span, words: &'static NodeSchema, title: &str) -> Option<&'static str> {
        let allowed = words.allowed();
        let message = Message::error(span, format!("{title} has no \"{}\"", short(name)));
        let elsewhere = schema::top().into_iter().any(|word| word == name);
        let (meant, mut help) = suggestion(name, &allowed);
        if name == "key" {
            help = "keys stand in the braces of what moves: translate { key 1  0 0 0; key 50  10 0 0 }".into();
        } else if name == "include" {
            help = "include stands at the top of a file, outside of everything".into();
        } else if elsewhere && !words.objects {
            help = format!("{name} is a node of its own, outside of {title}");
        }
        self.report.push(message.help(help));
        meant
    }

    /// Reports an unknown node at the top level of a file.
    pub(crate) fn unknown_node(&mut self, node: &Node) {
        if node.name.is_empty() {
            return;
        }
        let allowed = schema::top();
        let message = Message::error(node.name_span, format!("there is no node \"{}\"", short(&node.name)));
        let home = schema::home(&node.name);
        self.report.push(message.help(match home {
            Some(home) if closest_word(&node.name, allowed.iter().copied()).is_none() => {
                format!("{} belongs into the braces of {home}", node.name)
            }
            _ => suggestion(&node.name, &allowed).1,
        }));
    }

    /// Reports a name that isn't defined.
    pub(crate) fn unknown_name<'n>(
        &mut self,
        what: &str,
        name: &str,
        span: Span,
        known: impl Iterator<Item = &'n str> + Clone,
    ) {
        if self.files.incomplete {
            // The name may be defined in the part that couldn't be read.
            return;
        }
        let message = Message::error(span, format!("there is no {what} \"{}\"", short(name)));
        self.guesses += 1;
        if self.guesses > MAX_GUESSES {
            self.report.push(message);
            return;
        }
        let help = match closest_word(name, known.clone()) {
            Some(right) => format!("did you mean \"{right}\"?"),
            None => {
                // In order, since names come from tables that have none.
                let mut names: Vec<&str> = known.collect();
                names.sort_unstable();
                let more = if names.len() > 20 { ", …" } else { "" };
                names.truncate(20);
                match names.as_slice() {
                    [] => format!("the scene names no {what}"),
                    _ => format!("the scene has: {}{more}", names.join(", ")),
                }
            }
        };
        self.report.push(message.help(help));
    }

    /// Whether the values match the field; mistakes are reported. `node` is the node that contains them.
    pub(crate) fn values(&mut self, subject: &str, word: &'static FieldSchema, values: &[Value], node: &Node) -> bool {
        self.validator(subject, word, &Entry { word, values, node: Some(node), span: node.span, good: true })
    }

    /// Whether the node consists of values only; reports if not.
    pub(crate) fn plain(&mut self, node: &Node) -> bool {
        let extra = node.properties.first().map(|p| p.key_span).or(node.children.first().map(|c| c.name_span));
        if let Some(extra) = extra {
            let message = Message::error(extra, format!("{} takes nothing but values", node.name));
            self.report.push(message.help("values stand right after the word, with blanks between them"));
        }
        extra.is_none()
    }

    /// The field of this name in the schema of a node.
    pub(crate) fn find(words: &'static NodeSchema, name: &str) -> Option<&'static FieldSchema> {
        find(words, name)
    }

    /// Whether the values match the field; reports if not.
    fn validator(&mut self, subject: &str, word: &FieldSchema, got: &Entry) -> bool {
        let values = got.values;
        let counts: &[usize] = match word.value_type {
            ValueType::Numbers(counts) => counts,
            ValueType::Rgb => &[1, 3],
            ValueType::Counts(2) => &[2],
            ValueType::Counts(3) => &[3],
            ValueType::Counts(_) => &[4],
            ValueType::Flag if got.node.is_some() => &[0, 1],
            ValueType::Many(n) => return self.many(subject, n, got),
            _ => &[1],
        };
        if !counts.contains(&values.len()) {
            let message = if counts.len() == 1 && values.is_empty() {
                format!("{subject} takes {}, got nothing", word.value_type)
            } else if counts == [1] || matches!(word.value_type, ValueType::Flag) {
                format!("{subject} takes one value, {}, got {} values", word.value_type, values.len())
            } else {
                format!("{subject} takes {}, got {}", word.value_type, values.len())
            };
            let mut message = Message::error(got.span, message);
            if got.node.is_none() && !counts.contains(&1) {
                message = message.help(format!("several values stand in braces: {{ {} … }}", word.name));
            } else if values.iter().any(|value| value.as_text() == Some(",")) {
                message = message.help("numbers stand with blanks between them, without commas");
            } else if let Some(text) = values.iter().find_map(|v| v.as_text().filter(|t| schema::home(t).is_some())) {
                message = message.help(format!("is a ; missing before {text}?"));
            }
            self.report.push(message);
            return false;
        }
        let mut good = true;
        for value in values {
            good &= self.one(subject, word, value);
        }
        good
    }

    fn many(&mut self, subject: &str, n: usize, got: &Entry) -> bool {
        let Some(wrong) = got.values.iter().find(|v| !v.as_number().is_some_and(is_usable)) else {
            let count = got.values.len();
            if count == 0 || !count.is_multiple_of(n) {
                let message = format!("{subject} takes {n} numbers for each, but {count} can't be divided by {n}");
                let message =
                    if count == 0 { format!("{subject} takes {n} numbers for each, got none") } else { message };
                self.report.error(got.node.map_or(got.span, |node| node.name_span), message);
                return false;
            }
            return true;
        };
        self.number(subject, ValueType::Many(n), wrong)
    }

    /// Whether a single value matches.
    fn one(&mut self, subject: &str, word: &FieldSchema, value: &Value) -> bool {
        match (word.value_type, &value.kind) {
            (ValueType::Numbers(_) | ValueType::Rgb, _) => self.number(subject, word.value_type, value),
            (ValueType::Count | ValueType::Counts(_), _) => {
                let Some(number) = value.as_number().filter(|n| n.is_finite()) else {
                    return self.number(subject, word.value_type, value);
                };
                let whole = number.fract() == 0.0 && (0.0..=f64::from(u32::MAX)).contains(&number);
                if !whole {
                    self.report.error(value.span, format!("{subject} takes whole numbers from 0, got {number}"));
                }
                whole
            }
            (ValueType::Flag, ValueKind::Flag(_)) | (ValueType::Text, ValueKind::Text(_)) => true,
            (ValueType::Keyword(allowed), ValueKind::Text(text)) => {
                let known = allowed.contains(&&**text);
                if !known {
                    let message = Message::error(value.span, format!("{subject} can't be \"{}\"", short(text)));
                    self.report.push(message.help(match closest_word(text, allowed.iter().copied()) {
                        Some(right) => format!("did you mean \"{right}\"? It can be {}", word.value_type),
                        None => format!("it can be {}", word.value_type),
                    }));
                }
                known
            }
            (ValueType::Node(words), _) => match &words.argument {
                Some(argument) => self.one(subject, argument, value),
                None => true,
            },
            (value_type, _) => {
                let mut message =
                    Message::error(value.span, format!("{subject} takes {value_type}, got {}", describe(value)));
                match (value_type, value.as_text()) {
                    (ValueType::Flag, Some("yes" | "on")) => message = message.help("write #true"),
                    (ValueType::Flag, Some("no" | "off")) => message = message.help("write #false"),
                    (ValueType::Flag, Some(text @ ("true" | "false"))) => {
                        message = message.help(format!("write #{text}"))
                    }
                    (ValueType::Text | ValueType::Keyword(_), None) => message = message.help("texts stand in quotes"),
                    _ => {}
                }
                self.report.push(message);
                false
            }
        }
    }

    /// Whether the value is a number that is finite in `f32`; reports if not.
    fn number(&mut self, subject: &str, value_type: ValueType, value: &Value) -> bool {
        let (message, help) = match value.kind {
            ValueKind::Number(number) if is_usable(number) => return true,
            ValueKind::Number(number) if number.is_finite() => {
                (format!("{subject} is {number:e}, beyond what can be computed with"), "numbers go up to 3.4e38")
            }
            ValueKind::Number(number) if number.is_nan() => (format!("{subject} is #nan, which is no number"), ""),
            ValueKind::Number(_) => (format!("{subject} is infinite, but must be finite"), "numbers go up to 3.4e38"),
            _ => {
                let help = match value.as_text() {
                    Some(",") => "numbers stand with blanks between them, without commas",
                    Some(text) if text.parse::<f64>().is_ok() => "write the number without quotes",
                    Some(text) if text.starts_with('#') && text.len() == 7 => {
                        "colours are linear: 3 numbers, red, green and blue from 0 to 1"
                    }
                    _ => "",
                };
                (format!("{subject} takes {value_type}, got {}", describe(value)), help)
            }
        };
        let message = Message::error(value.span, message);
        self.report.push(if help.is_empty() { message } else { message.help(help) });
        false
    }
}

impl<'a> Fields<'a> {
    fn got(&self, name: &str) -> Option<&Entry<'a>> {
        self.got.iter().find(|got| got.word.name == name)
    }

    /// All entries of a field that may occur more than once.
    pub(crate) fn every(&self, name: &str) -> impl Iterator<Item = &Entry<'a>> {
        self.got.iter().filter(move |got| got.word.name == name && got.good)
    }

    /// Whether the field is present.
    pub(crate) fn has(&self, name: &str) -> bool {
        self.got(name).is_some()
    }

    /// The span of the field, or else of the node's name.
    pub(crate) fn span(&self, name: &str) -> Span {
        self.got(name).map_or(self.node.name_span, |got| got.span)
    }

    /// The field's entry, if its values are valid.
    pub(crate) fn raw(&self, name: &str) -> Option<&Entry<'a>> {
        self.got(name).filter(|got| got.good)
    }

    pub(crate) fn numbers<const N: usize>(&self, name: &str) -> Option<[f64; N]> {
        self.raw(name)?.numbers()
    }

    /// All numbers of a field.
    pub(crate) fn all(&self, name: &str) -> Option<Vec<f64>> {
        Some(self.raw(name)?.values.iter().filter_map(Value::as_number).collect())
    }

    pub(crate) fn number(&self, name: &str) -> Option<f64> {
        self.numbers(name).map(|[number]| number)
    }

    pub(crate) fn real(&self, name: &str) -> Option<f32> {
        self.number(name).map(|number| number as f32)
    }

    pub(crate) fn dvec(&self, name: &str) -> Option<DVec3> {
        self.numbers(name).map(DVec3::from_array)
    }

    pub(crate) fn vec(&self, name: &str) -> Option<Vec3> {
        self.dvec(name).map(|v| v.as_vec3())
    }

    pub(crate) fn rgb(&self, name: &str) -> Option<Rgb> {
        let gray = self.numbers(name).map(|[v]| Rgb::gray(v as f32));
        gray.or_else(|| self.vec(name).map(|v| Rgb::from(v.to_array())))
    }

    pub(crate) fn counts<const N: usize>(&self, name: &str) -> Option<[u32; N]> {
        Some(self.numbers::<N>(name)?.map(|number| number as u32))
    }

    pub(crate) fn count(&self, name: &str) -> Option<u32> {
        self.counts(name).map(|[count]| count)
    }

    pub(crate) fn flag(&self, name: &str) -> Option<bool> {
        match self.raw(name)?.values {
            [] => Some(true),
            [Value { kind: ValueKind::Flag(flag), .. }] => Some(*flag),
            _ => None,
        }
    }

    pub(crate) fn text(&self, name: &str) -> Option<&'a str> {
        self.raw(name)?.values.first()?.as_text()
    }

    /// The value of a closed set that the field's word stands for.
    pub(crate) fn named<T: Named>(&self, name: &str) -> Option<T> {
        T::from_name(self.text(name)?)
    }
}

impl Entry<'_> {
    pub(crate) fn numbers<const N: usize>(&self) -> Option<[f64; N]> {
        if !self.good || self.values.len() != N {
            return None;
        }
        let mut out = [0.0; N];
        for (number, value) in out.iter_mut().zip(self.values) {
            *number = value.as_number()?;
        }
        Some(out)
    }

    /// The first number at each sample time while the shutter is open; empty if it is constant.
    pub(crate) fn moving(&self) -> Vec<f64> {
        let moving = self.node.map_or(&[][..], |node| &node.moving);
        moving.iter().filter_map(|values| values.first()?.as_number()).collect()
    }

    /// The entry with its values at a sample time while the shutter is open; its own values if they are constant.
    pub(crate) fn at(&self, moment: usize) -> Entry<'_> {
        let values = self.node.and_then(|node| node.moving.get(moment)).map_or(self.values, Vec::as_slice);
        Entry { word: self.word, values, node: self.node, span: self.span, good: self.good }
    }

    /// Whether keys change the values while the shutter is open.
    pub(crate) fn moves(&self) -> bool {
        self.good && self.node.is_some_and(|node| !node.moving.is_empty())
    }

    /// Whether the values are valid.
    pub(crate) fn is_good(&self) -> bool {
        self.good
    }
}

fn find(words: &'static NodeSchema, name: &str) -> Option<&'static FieldSchema> {
    let motion = || (words.may_move() && name == schema::MOTION_WORD.name).then_some(&schema::MOTION_WORD);
    let transform = || TRANSFORMS.iter().find(|word| words.transforms && word.name == name);
    words.word(name).or_else(transform).or_else(motion)
}

fn is_usable(number: f64) -> bool {
    number.abs() <= f64::from(f32::MAX)
}

/// The nearest allowed word, and a list of all.
fn suggestion(wrong: &str, allowed: &[&'static str]) -> (Option<&'static str>, String) {
    let lower = wrong.to_lowercase().replace('_', "-");
    let right = allowed
        .iter()
        .find(|word| ***word == lower)
        .or_else(|| allowed.iter().find(|word| SYNONYMS.contains(&(lower.as_str(), **word))))
        .copied()
        .or_else(|| closest_word(&lower, allowed.iter().copied()));
    let list = match allowed {
        [] => "nothing can stand here".to_owned(),
        _ => format!("possible here: {}", allowed.join(", ")),
    };
    let help = match right {
        Some(right) => format!("did you mean {right}? {}{}", list[..1].to_uppercase(), &list[1..]),
        None => list,
    };
    (right, help)
}

fn describe(value: &Value) -> String {
    match &value.kind {
        ValueKind::Number(number) => format!("the number {number}"),
        ValueKind::Text(text) => format!("the text \"{}\"", short(text)),
        ValueKind::Flag(flag) => format!("#{flag}"),
        ValueKind::Null => "#null".into(),
    }
}

fn short(text: &str) -> String {
    if text.chars().count() <= 40 { text.into() } else { text.chars().take(39).chain(['…']).collect() }
}

fn plural(word: &str) -> String {
    match word {
        "axis" => "axes".into(),
        "radius" => "radii".into(),
        "box" | "matrix" | "axes" | "points" | "caps" | "shadows" | "data" | "kd" | "ks" => format!("\"{word}\""),
        _ if word.len() <= 2 || word.contains('-') => format!("\"{word}\""),
        _ => format!("{word}s"),
    }
}
