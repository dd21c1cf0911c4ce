//! The validation of nodes against their schema.

use super::arithmetic::{MEDIA, closest_color, closest_medium, takes_media};
use super::files::Files;
use super::nodes::{self, TRANSFORMS};
use super::reader::{Entry, Fields, TransformEntry};
use super::report::{Message, Report};
use super::schema::{FieldSchema, NUMBER, NodeSchema, ValueType};
use super::suggest::{described, shortened};
use super::syntax::{Node, Span, Value, ValueKind};
use crate::diagnostic::{closest_word, word_list};

/// The context of validation: the report and the files.
pub(crate) struct Validator<'a> {
    pub(crate) files: &'a Files,
    pub(crate) report: Report,
    /// The number of suggestions that were computed for unknown names.
    pub(super) guesses: usize,
}

impl<'a> Validator<'a> {
    pub(crate) fn new(files: &'a Files, report: Report) -> Validator<'a> {
        Validator { files, report, guesses: 0 }
    }

    /// Validates the fields of a node. `title` is its name in messages.
    pub(crate) fn fields<'n>(&mut self, node: &'n Node, words: &'static NodeSchema, title: &str) -> Fields<'n> {
        let mut fields = Fields {
            node,
            words,
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
            match nodes::field(words, &property.key) {
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
            match nodes::field(words, &child.name) {
                Some(word) => {
                    let got = Entry { word, values: &child.values, node: Some(child), span: child.span, good: true };
                    self.add(&mut fields, got, child.name_span, title);
                }
                None if words.objects && nodes::is_object(&child.name) => fields.objects.push(child),
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
            let message = Message::error(span, format!("{title} takes no values right after its name"));
            let help = format!("its words stand in braces: {}", nodes::allowed(words).join(", "));
            self.report.push(message.help(help));
            return;
        };
        if matches!(word.value_type, ValueType::Text) && words.transforms && first.as_text().is_none() && !node.broken {
            fields.valid = false;
            let message = Message::error(span, format!("{title} takes only a name right after its word"));
            let help = format!("its words stand in braces: {}", nodes::allowed(words).join(", "));
            self.report.push(message.help(help));
            return;
        }
        let got = Entry { word, values: &node.values, node: None, span, good: !node.broken };
        let good = got.good && self.is_valid(title, word, &got);
        fields.valid &= good;
        fields.got.push(Entry { good, ..got });
    }

    fn add<'n>(&mut self, fields: &mut Fields<'n>, mut got: Entry<'n>, key: Span, title: &str) {
        let transform = TRANSFORMS.iter().find(|transform| std::ptr::eq(&raw const transform.schema, got.word));
        let earlier = fields.got.iter().find(|other| other.word.name == got.word.name).map(|other| other.span);
        if let Some(earlier) = earlier.filter(|_| transform.is_none() && !got.word.many) {
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
            Some(node) => self.plain(node) && self.is_valid(got.word.name, got.word, &got),
            None => self.is_valid(got.word.name, got.word, &got),
        };
        fields.valid &= got.good;
        match transform {
            Some(transform) => fields.transforms.push(TransformEntry { transform, entry: got }),
            None => fields.got.push(got),
        }
    }

    fn missing(&mut self, words: &'static NodeSchema, title: &str, fields: &mut Fields) {
        let has = |word: &FieldSchema| {
            fields.got.iter().any(|got| got.word.name == word.name) || fields.meant.contains(&word.name)
        };
        let needed = words.argument.iter().chain(words.beside_argument()).filter(|word| word.needed);
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

    /// Whether the values match the field; mistakes are reported. `node` is the node that contains them.
    pub(crate) fn values(&mut self, subject: &str, word: &'static FieldSchema, values: &[Value], node: &Node) -> bool {
        self.is_valid(subject, word, &Entry { word, values, node: Some(node), span: node.span, good: true })
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

    /// Whether the values match the field; reports if not.
    fn is_valid(&mut self, subject: &str, word: &FieldSchema, got: &Entry) -> bool {
        let values = got.values;
        let counts: &[usize] = match word.value_type {
            ValueType::Numbers(counts) => counts,
            ValueType::Rgb => &[1, 3],
            ValueType::Counts(2) => &[2],
            ValueType::Counts(3) => &[3],
            ValueType::Counts(_) => &[4],
            ValueType::Flag | ValueType::FlagOrKeyword(_) if got.node.is_some() => &[0, 1],
            ValueType::Many(n) => return self.many(subject, n, got),
            _ => &[1],
        };
        if !counts.contains(&values.len()) {
            let message = if counts.len() == 1 && values.is_empty() {
                format!("{subject} takes {}, got nothing", word.value_type)
            } else if counts == [1] || matches!(word.value_type, ValueType::Flag) {
                format!("{subject} takes one value, {}, got {} values", word.value_type, values.len())
            } else if matches!(word.value_type, ValueType::Rgb) {
                format!("{subject} takes a colour: 1 or 3 numbers, or a name; got {} values", values.len())
            } else {
                format!("{subject} takes {}, got {}", word.value_type, values.len())
            };
            let mut message = Message::error(got.span, message);
            let name = values.get(1).and_then(Value::as_text).filter(|_| got.node.is_none() && word.name == "kind");
            if let Some(name) = name {
                message = message.help(format!("a name is written name=\"{name}\""));
            } else if got.node.is_none() && !counts.contains(&1) {
                message = message.help(format!("several values stand in braces: {{ {} … }}", word.name));
            } else if values.iter().any(|value| value.as_text() == Some(",")) {
                message = message.help("numbers stand with blanks between them, without commas");
            } else if let Some(text) = values.iter().find_map(|v| v.as_text().filter(|t| nodes::home(t).is_some())) {
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
            (ValueType::NumberOrKeyword(_), ValueKind::Number(_)) => self.number(subject, NUMBER, value),
            (ValueType::Flag | ValueType::FlagOrKeyword(_), ValueKind::Flag(_))
            | (ValueType::Text, ValueKind::Text(_)) => true,
            (
                ValueType::Keyword(allowed) | ValueType::FlagOrKeyword(allowed) | ValueType::NumberOrKeyword(allowed),
                ValueKind::Text(text),
            ) => {
                let known = allowed.contains(&&**text);
                if !known {
                    let message = Message::error(value.span, format!("{subject} can't be \"{}\"", shortened(text)));
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
                    Message::error(value.span, format!("{subject} takes {value_type}, got {}", described(value)));
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
                (format!("{subject} is {number:e}, beyond what can be computed with"), LARGEST.to_owned())
            }
            ValueKind::Number(number) if number.is_nan() => {
                (format!("{subject} is #nan, which is no number"), String::new())
            }
            ValueKind::Number(_) => (format!("{subject} is infinite, but must be finite"), LARGEST.to_owned()),
            _ => {
                let help = match value.as_text() {
                    Some(",") => "numbers stand with blanks between them, without commas".into(),
                    Some(text) if matches!(value_type, ValueType::Rgb) => match closest_color(text) {
                        Some(color) => format!("did you mean \"{color}\"?"),
                        None => {
                            "a colour is 3 linear numbers, a gray, a name such as orange, or srgb \"#ff8800\"".into()
                        }
                    },
                    Some(text) if takes_media(subject) => match closest_medium(text) {
                        Some(medium) => format!("did you mean \"{medium}\"?"),
                        None => format!("media have these names: {}", word_list(&MEDIA.map(|(name, ..)| name), "and")),
                    },
                    _ => String::new(),
                };
                (format!("{subject} takes {value_type}, got {}", described(value)), help)
            }
        };
        let message = Message::error(value.span, message);
        self.report.push(if help.is_empty() { message } else { message.help(help) });
        false
    }
}

const LARGEST: &str = "numbers go up to 3.4e38";

fn is_usable(number: f64) -> bool {
    number.abs() <= f64::from(f32::MAX)
}

fn plural(word: &str) -> String {
    match word {
        "axis" => "axes".into(),
        "radius" => "radii".into(),
        "box" | "matrix" | "axes" | "points" | "caps" | "shadows" | "data" | "kd" | "ks" => format!("\"{word}\""),
        _ if word.ends_with("ss") => format!("{word}es"),
        _ if word.ends_with("ty") || word.ends_with("py") => format!("{}ies", &word[..word.len() - 1]),
        _ if word.len() <= 2 || word.ends_with('s') || word.contains('-') => format!("\"{word}\""),
        _ => format!("{word}s"),
    }
}
