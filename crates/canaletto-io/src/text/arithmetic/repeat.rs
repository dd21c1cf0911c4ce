//! `repeat`: copies of nodes with numbers that change from one to the next.

use super::expression::{Expression, ExpressionError};
use super::fields::Slots;
use super::{Evaluator, LET, Name, Place};
use crate::text::files::Files;
use crate::text::nodes::{self, MATERIAL, PROTOTYPE};
use crate::text::report::Message;
use crate::text::schema::NodeSchema;
use crate::text::syntax::{Node, Span, Value, ValueKind};
use std::fmt::Write;
use std::sync::Arc;

/// The node of copies.
pub(crate) static REPEAT: NodeSchema = NodeSchema::new("repeat", "Copies of what stands in it.", &[]).objects();

/// The most copies that all repeats of a scene make.
pub(crate) const MAX_COPIES: u64 = 1 << 22;
/// The most copies of objects with names or keys, and of materials, textures and other settings. Each is kept as text.
pub(crate) const MAX_KEPT_COPIES: usize = 1 << 16;

/// The name of the number of a copy, if none is given.
pub(crate) const DEFAULT_INDEX: &str = "i";

/// How the copies of a node differ. The node's children are what is copied.
#[derive(Debug)]
pub(crate) struct Repeat {
    span: Span,
    /// The place of the first index in the list of numbers. The other indices and the block's named numbers follow it.
    first: usize,
    counts: Vec<Count>,
    lets: Vec<Number>,
    slots: Vec<Slot>,
}

/// How often an index counts.
#[derive(Debug)]
struct Count {
    number: Number,
    name: Box<str>,
}

/// An expression with its text.
#[derive(Debug)]
struct Number {
    expression: Expression,
    text: Box<str>,
    place: Place,
}

/// A value that changes from copy to copy.
#[derive(Debug)]
pub(super) struct Slot {
    /// The path to its node, by numbers of children.
    pub(super) path: Box<[u32]>,
    pub(super) at: SlotValue,
    pub(super) source: SlotSource,
    pub(super) place: Place,
}

/// The value of a node that changes.
#[derive(Clone, Copy, Debug)]
pub(super) enum SlotValue {
    /// The value with this number.
    Value(u32),
    /// The property with this number.
    Property(u32),
}

/// What a changing value is made of.
#[derive(Debug)]
pub(super) enum SlotSource {
    /// An expression with its text.
    Number(Expression, Box<str>),
    Text(Box<[Piece]>),
}

/// A part of a text.
#[derive(Debug)]
pub(super) enum Piece {
    Text(Box<str>),
    Number(Expression),
}

impl Evaluator<'_> {
    /// Prepares a repeat. Its copies are added to `all` if they must be kept, else the repeat itself.
    pub(super) fn repeat(&mut self, mut node: Node, all: &mut Vec<Node>) {
        let errors = self.report.count();
        if !self.prepare(&mut node) || self.report.count() > errors {
            return;
        }
        if node.children.iter().all(is_plain) {
            all.push(node);
            return;
        }
        let mut numbers = self.numbers.clone();
        if let Err(message) = self.expand(&node, &mut numbers, all) {
            self.report.push(message);
        }
    }

    /// Replaces the node's block by what is copied, with the places that change. Returns whether it could be read.
    fn prepare(&mut self, node: &mut Node) -> bool {
        if node.broken {
            return false;
        }
        let first = self.names.len();
        let Some(counts) = self.counts(node) else { return false };
        for count in &counts {
            if !self.check_name(&count.name, count.number.place.span) {
                self.names.truncate(first);
                return false;
            }
            self.names.push(Name { text: count.name.clone(), span: count.number.place.span });
        }
        let mut children = std::mem::take(&mut node.children);
        let mut lets = Vec::new();
        for node in children.extract_if(.., |child| *child.name == *LET.name) {
            for property in self.definitions(node) {
                lets.extend(self.number(&property.value));
                if self.check_name(&property.key, property.key_span) {
                    self.names.push(Name { text: property.key, span: property.key_span });
                }
            }
        }
        let mut slots = Some(Slots { path: Vec::new(), found: Vec::new() });
        let good = self.inner(&mut children, &mut slots);
        node.children = children;
        self.names.truncate(first);
        let slots = slots.map(|slots| slots.found).unwrap_or_default();
        node.repeat = Some(Arc::new(Repeat { span: node.name_span, first, counts, lets, slots }));
        good
    }

    /// Evaluates what is copied.
    fn inner(&mut self, children: &mut [Node], slots: &mut Option<Slots>) -> bool {
        let mut good = true;
        for (index, child) in (0..).zip(children) {
            if *child.name == *REPEAT.name {
                good &= self.prepare(child);
                continue;
            }
            let Some(schema) = nodes::schema(child) else { continue };
            if let Some(slots) = slots {
                slots.path.push(index);
            }
            self.fields(child, schema, slots);
            if schema.objects {
                good &= self.objects(child, slots);
            }
            if let Some(slots) = slots {
                slots.path.pop();
            }
        }
        good
    }

    /// Evaluates the objects in a group.
    fn objects(&mut self, group: &mut Node, slots: &mut Option<Slots>) -> bool {
        let mut good = true;
        for index in 0..group.children.len() {
            if nodes::is_object(&group.children[index].name) {
                if let Some(slots) = slots {
                    slots.path.push(index as u32);
                }
                let child = &mut group.children[index];
                if *child.name == *REPEAT.name {
                    good &= self.prepare(child);
                } else if let Some(schema) = nodes::schema(child) {
                    self.fields(child, schema, slots);
                    good &= !schema.objects || self.objects(child, slots);
                }
                if let Some(slots) = slots {
                    slots.path.pop();
                }
            }
        }
        good
    }

    /// The indices of a repeat, the outermost first.
    fn counts(&mut self, node: &Node) -> Option<Vec<Count>> {
        let given: Vec<(&str, &Value)> = match (node.values.as_slice(), node.properties.as_slice()) {
            ([value], []) => vec![(DEFAULT_INDEX, value)],
            ([], [_, ..]) => node.properties.iter().map(|property| (&*property.key, &property.value)).collect(),
            _ => {
                let help = "for example: repeat 12 { … } with the index i from 0 to 11, or repeat x=8 z=8 { … }";
                let message = "repeat takes how many copies there are, or names with their counts";
                self.report.push(Message::error(node.name_span, message).help(help));
                return None;
            }
        };
        let mut counts = Vec::with_capacity(given.len());
        for (name, value) in given {
            counts.push(Count { number: self.number(value)?, name: name.into() });
        }
        Some(counts)
    }

    /// The expression of a value. Mistakes are reported.
    fn number(&mut self, value: &Value) -> Option<Number> {
        let place = Place { span: value.span, from: 0 };
        match &value.kind {
            ValueKind::Number(number) if number.is_finite() => {
                let expression = Expression::of_number(*number);
                Some(Number { expression, text: "".into(), place })
            }
            ValueKind::Text(text) => Some(Number { text: text.clone(), expression: self.parsed(value)?, place }),
            _ => {
                self.report.error(value.span, "repeat takes a number or an expression in quotes");
                None
            }
        }
    }

    /// Adds the copies of a repeat to `all`.
    fn expand(&mut self, node: &Node, numbers: &mut Vec<f64>, all: &mut Vec<Node>) -> Result<(), Message> {
        let Some(mut copies) = Copies::of(node) else { return Ok(()) };
        while copies.next(numbers, self.files, &mut self.copies)? {
            for child in copies.nodes() {
                if child.repeat.is_some() {
                    self.expand(child, numbers, all)?;
                } else {
                    let copy = self.expanded(child, numbers)?;
                    all.push(copy);
                }
            }
        }
        copies.end(numbers);
        Ok(())
    }

    /// A copy of a node, with the copies of the repeats inside of it.
    fn expanded(&mut self, node: &Node, numbers: &mut Vec<f64>) -> Result<Node, Message> {
        self.kept_copies += 1;
        if self.kept_copies > MAX_KEPT_COPIES {
            let message =
                format!("the repeats make more than {MAX_KEPT_COPIES} objects with names or keys, or settings");
            let help = format!("up to {MAX_COPIES} copies may have no names and keys; clouds hold millions of spheres");
            return Err(Message::error(node.name_span, message).help(help));
        }
        let mut copy = Node { children: Vec::with_capacity(node.children.len()), ..node.clone_without_children() };
        for child in &node.children {
            if child.repeat.is_some() {
                self.expand(child, numbers, &mut copy.children)?;
            } else if nodes::is_object(&child.name) {
                let child = self.expanded(child, numbers)?;
                copy.children.push(child);
            } else {
                copy.children.push(child.clone());
            }
        }
        Ok(copy)
    }
}

/// Whether copies of a node are made while they are decoded: an object that nothing refers to, that no key moves, and
/// whose files are the same in all copies.
fn is_plain(node: &Node) -> bool {
    fn is_still(node: &Node) -> bool {
        !nodes::is_of_time(&node.name) && node.children.iter().all(is_still)
    }
    // The name of a material is looked up for each copy.
    let is_same =
        |name: &str, value: &Value| name == MATERIAL.name() || value.as_text().is_none_or(|text| !text.contains('{'));
    nodes::is_object(&node.name)
        && *node.name != *PROTOTYPE.schema.name
        && nodes::name_of(node).is_none()
        && node.values.iter().all(|value| is_same("", value))
        && node.properties.iter().all(|property| is_same(&property.key, &property.value))
        && node.children.iter().all(|child| match nodes::is_object(&child.name) {
            true => is_plain(child),
            false => is_still(child) && child.values.iter().all(|value| is_same(&child.name, value)),
        })
}

/// The copies of a repeat, one after the other.
pub(crate) struct Copies {
    repeat: Arc<Repeat>,
    /// What is copied, with the values of the present copy.
    nodes: Vec<Node>,
    /// How often each index counts; empty before the first copy.
    counts: Vec<u64>,
    indices: Vec<u64>,
    stack: Vec<f64>,
}

impl Copies {
    /// The copies of a node; none of a node that isn't a repeat.
    pub(crate) fn of(node: &Node) -> Option<Copies> {
        let repeat = Arc::clone(node.repeat.as_ref()?);
        let nodes = node.children.clone();
        Some(Copies { repeat, nodes, counts: Vec::new(), indices: Vec::new(), stack: Vec::new() })
    }

    /// The nodes of the present copy. A repeat among them needs the numbers of this copy.
    pub(crate) fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// Goes to the next copy; returns whether there is one. `numbers` holds the numbers around the repeat, and takes
    /// its own. `made` counts the copies of all repeats.
    pub(crate) fn next(&mut self, numbers: &mut Vec<f64>, files: &Files, made: &mut u64) -> Result<bool, Message> {
        let repeat = Arc::clone(&self.repeat);
        numbers.truncate(repeat.first);
        if self.counts.is_empty() {
            self.begin(numbers, files)?;
            if self.counts.contains(&0) {
                return Ok(false);
            }
        } else if !self.advance() {
            return Ok(false);
        }
        *made += 1;
        if *made > MAX_COPIES {
            return Err(too_many(repeat.span));
        }
        numbers.extend(self.indices.iter().map(|index| *index as f64));
        for number in &repeat.lets {
            let value = number.value(numbers, &mut self.stack, files)?;
            numbers.push(value);
        }
        for slot in &repeat.slots {
            let kind = slot.value(numbers, &mut self.stack, files)?;
            if let Some(value) = slot.find(&mut self.nodes) {
                value.kind = kind;
            }
        }
        Ok(true)
    }

    /// Removes the repeat's numbers.
    pub(crate) fn end(self, numbers: &mut Vec<f64>) {
        numbers.truncate(self.repeat.first);
    }

    /// Finds how often each index counts.
    fn begin(&mut self, numbers: &[f64], files: &Files) -> Result<(), Message> {
        let mut all = 1u64;
        for Count { number, name } in &self.repeat.counts {
            let count = number.value(numbers, &mut self.stack, files)?;
            if count < 0.0 || count.fract() != 0.0 {
                let message = format!("{name} counts to {count}, which is no whole number from 0 on");
                return Err(Message::error(number.place.span, message).help("floor and round make whole numbers"));
            }
            all = all.saturating_mul(count as u64);
            self.counts.push(count as u64);
        }
        self.indices = vec![0; self.counts.len()];
        if all > MAX_COPIES { Err(too_many(self.repeat.span)) } else { Ok(()) }
    }

    /// Advances the indices, the last one fastest; returns whether there is another copy.
    fn advance(&mut self) -> bool {
        for (index, count) in self.indices.iter_mut().zip(&self.counts).rev() {
            *index += 1;
            if *index < *count {
                return true;
            }
            *index = 0;
        }
        false
    }
}

fn too_many(span: Span) -> Message {
    let message = format!("the repeats of the scene make more than {MAX_COPIES} copies");
    Message::error(span, message).help("clouds hold more: spheres file=\"points.csv\"")
}

impl Number {
    fn value(&self, numbers: &[f64], stack: &mut Vec<f64>, files: &Files) -> Result<f64, Message> {
        self.expression.value(numbers, stack).map_err(|mistake| self.place.message(files, &self.text, mistake))
    }
}

impl Slot {
    fn value(&self, numbers: &[f64], stack: &mut Vec<f64>, files: &Files) -> Result<ValueKind, Message> {
        match &self.source {
            SlotSource::Number(expression, text) => match expression.value(numbers, stack) {
                Ok(number) => Ok(ValueKind::Number(number)),
                Err(mistake) => Err(self.place.message(files, text, mistake)),
            },
            SlotSource::Text(pieces) => {
                let mut text = String::new();
                for piece in pieces {
                    match piece {
                        Piece::Text(piece) => text += piece,
                        Piece::Number(expression) => {
                            let number = expression.value(numbers, stack);
                            let number = number.map_err(|mistake| self.whole(mistake))?;
                            let _ = write!(text, "{number}");
                        }
                    }
                }
                Ok(ValueKind::Text(text.into()))
            }
        }
    }

    /// The message of a mistake in a text, at the whole text.
    fn whole(&self, mistake: ExpressionError) -> Message {
        Message::error(self.place.span, mistake.message)
    }

    fn find<'n>(&self, nodes: &'n mut [Node]) -> Option<&'n mut Value> {
        let (first, rest) = self.path.split_first()?;
        let mut node = nodes.get_mut(*first as usize)?;
        for index in rest {
            node = node.children.get_mut(*index as usize)?;
        }
        match self.at {
            SlotValue::Value(index) => node.values.get_mut(index as usize),
            SlotValue::Property(index) => node.properties.get_mut(index as usize).map(|property| &mut property.value),
        }
    }
}
