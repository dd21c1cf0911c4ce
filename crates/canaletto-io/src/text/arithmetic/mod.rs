//! Arithmetic in the scene text: named numbers (`let`), expressions in place of numbers, colours by name, and `repeat`.
//!
//! All of it is replaced by numbers before the scene is read, except in repeats of plain objects. These are made copy
//! by copy while they are decoded. So their number costs no memory for nodes of text.

mod color;
mod color_names;
mod expression;
mod fields;
mod media;
mod repeat;
#[cfg(test)]
mod tests;

pub(crate) use color::closest_color;
pub use color::color;
pub(crate) use expression::{CONSTANTS, FUNCTIONS};
pub(crate) use media::{DIELECTRIC, MEDIA, closest_medium, takes_media};
pub(crate) use repeat::{Copies, DEFAULT_INDEX, MAX_COPIES, MAX_KEPT_COPIES, REPEAT, Repeat};

use super::files::Files;
use super::nodes;
use super::report::{Message, Report};
use super::schema::NodeSchema;
use super::syntax::{Node, Property, Span, Value, ValueKind};
use crate::diagnostic::closest_word;
use expression::{Expression, ExpressionError, is_name, is_taken};

/// The node of named numbers.
pub(crate) static LET: NodeSchema = NodeSchema::new("let", "Names for numbers.", &[]);

/// Replaces named numbers, expressions and colours by numbers, and prepares repeats. Returns the named numbers, which
/// repeats need while they are decoded.
pub(crate) fn evaluate(nodes: &mut Vec<Node>, files: &Files, report: &mut Report) -> Vec<f64> {
    let mut evaluator = Evaluator { files, report, names: Vec::new(), numbers: Vec::new(), copies: 0, kept_copies: 0 };
    evaluator.define(nodes);
    evaluator.nodes(nodes);
    evaluator.numbers
}

/// A name in a scope.
struct Name {
    text: Box<str>,
    span: Span,
}

struct Evaluator<'a> {
    files: &'a Files,
    report: &'a mut Report,
    /// The names in scope: first the named numbers of the whole scene, then those of the repeats around.
    names: Vec<Name>,
    /// The named numbers of the whole scene.
    numbers: Vec<f64>,
    /// The number of copies that were made so far.
    copies: u64,
    /// The number of nodes in them.
    kept_copies: usize,
}

impl Evaluator<'_> {
    /// Takes the named numbers of the whole scene out of the nodes. A later file changes numbers of earlier ones.
    fn define(&mut self, nodes: &mut Vec<Node>) {
        let mut definitions: Vec<Property> = Vec::new();
        for node in nodes.extract_if(.., |node| *node.name == *LET.name) {
            for property in self.definitions(node) {
                let known = definitions.iter_mut().find(|known| known.key == property.key);
                match known {
                    Some(known) if known.key_span.file == property.key_span.file => {
                        let place = self.files.first(known.key_span, property.key_span);
                        let message = format!("two numbers are called {}", property.key);
                        self.report.push(Message::error(property.key_span, message).label(place));
                    }
                    Some(known) => known.value = property.value,
                    None => definitions.push(property),
                }
            }
        }
        for Property { key, key_span, value } in definitions {
            let number = match value.kind {
                ValueKind::Number(number) => number,
                _ => match self.parsed(&value) {
                    Some(expression) => self.constant(&expression, &value).unwrap_or(1.0),
                    None => 1.0,
                },
            };
            if self.check_name(&key, key_span) {
                self.names.push(Name { text: key, span: key_span });
                self.numbers.push(number);
            }
        }
    }

    /// The definitions in a `let` node.
    fn definitions(&mut self, node: Node) -> Vec<Property> {
        let other = node.values.first().map(|value| value.span).or(node.children.first().map(|child| child.name_span));
        let wrong = other.or(node.properties.is_empty().then_some(node.name_span));
        if let Some(span) = wrong.filter(|_| !node.broken) {
            let message = Message::error(span, "let takes names with their numbers");
            self.report.push(message.help("for example: let r=2 step=\"360 / 12\""));
        }
        let is_number = |property: &Property| match &property.value.kind {
            ValueKind::Number(number) => number.is_finite(),
            ValueKind::Text(_) => true,
            ValueKind::Flag(_) | ValueKind::Null => false,
        };
        let mut kept = Vec::new();
        for property in node.properties {
            if is_number(&property) {
                kept.push(property);
            } else {
                let message = format!("{} takes a finite number or an expression in quotes", property.key);
                self.report.error(property.value.span, message);
            }
        }
        kept
    }

    /// Whether a new name can stand in expressions and is not in use; reports if not.
    fn check_name(&mut self, name: &str, span: Span) -> bool {
        let message = if !is_name(name) {
            let help = "a name has letters, digits and _, and starts with a letter; - is a minus";
            Message::error(span, format!("\"{name}\" can't be the name of a number")).help(help)
        } else if is_taken(name) {
            Message::error(span, format!("{name} has a meaning in all expressions")).help("take another name")
        } else if let Some(known) = self.names.iter().find(|known| *known.text == *name) {
            let place = self.files.first(known.span, span);
            let message = Message::error(span, format!("another number is called {name}")).label(place);
            message.help("repeats inside each other need different names: repeat j=5")
        } else {
            return true;
        };
        self.report.push(message);
        false
    }

    /// The expression of a text, with the names in scope.
    fn parse(&self, text: &str) -> Result<Expression, ExpressionError> {
        Expression::parse(text, self.names.iter().map(|name| &*name.text))
    }

    /// The expression of a text. Mistakes are reported.
    fn parsed(&mut self, value: &Value) -> Option<Expression> {
        let text = value.as_text()?;
        match self.parse(text) {
            Ok(expression) => Some(expression),
            Err(mistake) => {
                self.mistake(value, 0, text, mistake);
                None
            }
        }
    }

    /// The value of an expression of the scene's named numbers. Mistakes are reported.
    fn constant(&mut self, expression: &Expression, value: &Value) -> Option<f64> {
        match expression.value(&self.numbers, &mut Vec::new()) {
            Ok(number) => Some(number),
            Err(mistake) => {
                self.mistake(value, 0, value.as_text().unwrap_or_default(), mistake);
                None
            }
        }
    }

    /// Reports a mistake in an expression that starts at byte `from` of a text.
    fn mistake(&mut self, value: &Value, from: usize, text: &str, mistake: ExpressionError) {
        let place = Place { span: value.span, from };
        self.report.push(place.message(self.files, text, mistake));
    }

    /// Evaluates nodes in one block. Repeats of plain objects stay, other repeats are replaced by their copies.
    fn nodes(&mut self, nodes: &mut Vec<Node>) {
        let repeats = nodes.iter().any(|node| *node.name == *REPEAT.name);
        for node in nodes.iter_mut().filter(|node| *node.name != *REPEAT.name) {
            self.node(node);
        }
        if !repeats {
            return;
        }
        let mut all = Vec::with_capacity(nodes.len());
        for node in nodes.drain(..) {
            if *node.name == *REPEAT.name { self.repeat(node, &mut all) } else { all.push(node) }
        }
        *nodes = all;
    }

    /// Evaluates a node outside of repeats.
    fn node(&mut self, node: &mut Node) {
        if let Some(schema) = nodes::schema(node) {
            self.fields(node, schema, &mut None);
            if schema.objects {
                self.nodes(&mut node.children);
            }
        }
    }
}

/// Where an expression stands, for messages.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    /// The text that it stands in.
    span: Span,
    /// The first byte of the expression in that text.
    from: usize,
}

impl Place {
    /// The message of a mistake. It points into the text if that is written without escapes.
    fn message(self, files: &Files, text: &str, mistake: ExpressionError) -> Message {
        let raw = files.slice(self.span);
        let quoted = raw.strip_prefix('"').and_then(|raw| raw.strip_suffix('"'));
        let start = if raw == text {
            Some(self.span.start)
        } else {
            quoted.filter(|inner| *inner == text).map(|_| self.span.start + 1)
        };
        let at = |byte: usize, start: u32| start + (self.from + byte) as u32;
        let span = match start {
            Some(start) => Span { start: at(mistake.start, start), end: at(mistake.end, start), ..self.span },
            None => self.span,
        };
        let message = Message::error(span, mistake.message);
        if mistake.help.is_empty() { message } else { message.help(mistake.help) }
    }
}

/// Whether a text that isn't an expression is meant as one.
fn seems_arithmetic(text: &str) -> bool {
    let has = |list: &str| text.chars().any(|c| list.contains(c));
    let several = text.contains(',') && !text.contains('(');
    !several && (text.starts_with(|c: char| c.is_ascii_digit()) || has("+*/×÷−·^()"))
}

/// The name of a number that is nearest to a misspelled one.
fn closest_name<'n>(names: &'n [Name], wrong: &str) -> Option<&'n str> {
    closest_word(wrong, names.iter().map(|name| &*name.text))
}
