//! The values of a node, by the types of their fields: expressions become numbers, names of colours three numbers.

use super::color::{SRGB, color_of, linear};
use super::media::{eta_of, takes_media};
use super::repeat::{Piece, Slot, SlotSource, SlotValue};
use super::{Evaluator, Place, closest_name, seems_arithmetic};
use crate::text::nodes::{self, CAMERA, CAMERA_FOLLOW, FOLLOW, KEY, POINT_FOLLOW};
use crate::text::report::Message;
use crate::text::schema::{FieldSchema, NodeSchema, ValueType};
use crate::text::syntax::{Node, Span, Value, ValueKind};

/// The places in a repeat that change from copy to copy.
pub(super) struct Slots {
    /// The path to the node that is visited, by numbers of children.
    pub(super) path: Vec<u32>,
    pub(super) found: Vec<Slot>,
}

/// What a field's values are.
#[derive(Clone, Copy)]
enum Role {
    Number,
    Color,
    /// Numbers with colours among them.
    Colors,
    Eta,
    /// A number or one of these words.
    NumberOrWord(&'static [&'static str]),
    Other,
}

fn role_of(field: &FieldSchema) -> Role {
    match field.value_type {
        ValueType::Rgb => Role::Color,
        ValueType::Many(_) if field.colors => Role::Colors,
        ValueType::Numbers(_) if takes_media(field.name) => Role::Eta,
        ValueType::Numbers(_) | ValueType::Count | ValueType::Counts(_) | ValueType::Many(_) => Role::Number,
        ValueType::Node(words) => words.argument.as_ref().map_or(Role::Other, role_of),
        ValueType::NumberOrKeyword(words) => Role::NumberOrWord(words),
        ValueType::Flag | ValueType::FlagOrKeyword(_) | ValueType::Text | ValueType::Keyword(_) => Role::Other,
    }
}

impl Evaluator<'_> {
    /// Evaluates the values in a node of this schema, except the objects inside of it. In a repeat, `slots` takes what
    /// changes from copy to copy.
    pub(super) fn fields(&mut self, node: &mut Node, words: &'static NodeSchema, slots: &mut Option<Slots>) {
        if node.packed.is_some() {
            // Nodes with expressions aren't packed.
            return;
        }
        let role = words.argument.as_ref().map_or(Role::Other, role_of);
        self.values(&mut node.values, 0, role, slots);
        self.keys(node, role, slots);
        self.properties(node, words, slots);
        for index in 0..node.children.len() {
            let name = &*node.children[index].name;
            let follows = *name == *FOLLOW.name && (words.transforms || std::ptr::eq(words, &CAMERA));
            let inner = match nodes::field(words, name) {
                _ if follows && std::ptr::eq(words, &CAMERA) => Some(Err(&CAMERA_FOLLOW)),
                _ if follows => Some(Err(&FOLLOW)),
                Some(field) => match field.value_type {
                    ValueType::Node(inner) => Some(Err(inner)),
                    _ => Some(Ok(field)),
                },
                None => None,
            };
            let Some(inner) = inner else { continue };
            if let Some(slots) = slots {
                slots.path.push(index as u32);
            }
            match inner {
                Ok(field) => self.field(&mut node.children[index], field, slots),
                Err(schema) => self.fields(&mut node.children[index], schema, slots),
            }
            if let Some(slots) = slots {
                slots.path.pop();
            }
        }
    }

    /// Evaluates a field with its keys.
    fn field(&mut self, node: &mut Node, field: &'static FieldSchema, slots: &mut Option<Slots>) {
        let role = role_of(field);
        self.values(&mut node.values, 0, role, slots);
        self.keys(node, role, slots);
    }

    /// Evaluates the keys of a node's values, and a path in their place.
    fn keys(&mut self, node: &mut Node, role: Role, slots: &mut Option<Slots>) {
        for index in 0..node.children.len() {
            if let Some(slots) = slots {
                slots.path.push(index as u32);
            }
            let child = &mut node.children[index];
            if &*child.name == KEY {
                let mut values = child.values.split_off(child.values.len().min(1));
                self.values(&mut child.values, 0, Role::Number, slots);
                self.values(&mut values, 1, role, slots);
                child.values.append(&mut values);
            } else if *child.name == *FOLLOW.name && matches!(role, Role::Number) {
                self.fields(child, &POINT_FOLLOW, slots);
            }
            if let Some(slots) = slots {
                slots.path.pop();
            }
        }
    }

    /// Evaluates the properties of a node. Colours become children, since they are three numbers.
    fn properties(&mut self, node: &mut Node, words: &'static NodeSchema, slots: &mut Option<Slots>) {
        let mut index = 0;
        while index < node.properties.len() {
            let property = &node.properties[index];
            let role = nodes::field(words, &property.key).map_or(Role::Other, role_of);
            let mut values = vec![property.value.clone()];
            match role {
                Role::Color | Role::Colors => self.colors(&mut values),
                Role::Number | Role::Eta | Role::NumberOrWord(_) | Role::Other => {}
            }
            if values.len() > 1 {
                let property = node.properties.remove(index);
                let span = Span { end: property.value.span.end, ..property.key_span };
                let mut child = Node::new(&property.key, property.key_span);
                (child.span, child.values) = (span, values);
                node.children.push(child);
                continue;
            }
            self.value(&mut node.properties[index].value, SlotValue::Property(index as u32), role, slots);
            index += 1;
        }
    }

    /// Evaluates values. `offset` is the number of the node's values before them.
    fn values(&mut self, values: &mut Vec<Value>, offset: u32, role: Role, slots: &mut Option<Slots>) {
        if !values.iter().any(|value| value.as_text().is_some()) {
            return;
        }
        if let Role::Color | Role::Colors = role {
            self.colors(values);
        }
        for (index, value) in (offset..).zip(values) {
            self.value(value, SlotValue::Value(index), role, slots);
        }
    }

    /// Replaces colours among values by three numbers each.
    fn colors(&mut self, values: &mut Vec<Value>) {
        let mut all = Vec::with_capacity(values.len() + 2);
        let mut rest = std::mem::take(values).into_iter().peekable();
        let single = rest.len() == 1;
        while let Some(value) = rest.next() {
            let text = value.as_text().unwrap_or_default();
            let is_number = self.names.iter().any(|name| *name.text == *text);
            let (span, color) = match text {
                SRGB if !single && !is_number => {
                    let is_color = |text: &str| text.starts_with('#') || color_of(text).is_some();
                    let has_color = rest.peek().and_then(Value::as_text).is_some_and(is_color);
                    let given: Vec<Value> = rest.by_ref().take(if has_color { 1 } else { 3 }).collect();
                    let end = given.last().map_or(value.span.end, |last| last.span.end);
                    let span = Span { end, ..value.span };
                    let color = self.encoded(&given);
                    if color.is_none() {
                        let message = "srgb takes a colour, or red, green and blue from 0 to 1";
                        let help = "for example: srgb \"#ff8800\"; copies of a repeat have the same one";
                        self.report.push(Message::error(span, message).help(help));
                    }
                    (span, Some(color.unwrap_or_default()))
                }
                _ if is_number => (value.span, None),
                _ => (value.span, color_of(text)),
            };
            match color {
                Some(color) => all.extend(color.map(|v| Value { kind: ValueKind::Number(v), span })),
                None => all.push(value),
            }
        }
        *values = all;
    }

    /// The linear colour of values on the sRGB curve: one colour, or three numbers that are the same in all copies of a
    /// repeat.
    fn encoded(&self, values: &[Value]) -> Option<[f64; 3]> {
        if let [value] = values {
            return color_of(value.as_text()?);
        }
        let number = |value: &Value| match value.as_text() {
            None => value.as_number(),
            Some(text) => {
                let expression = self.parse(text).ok()?;
                let is_constant = !expression.needs(self.numbers.len());
                if is_constant { expression.value(&self.numbers, &mut Vec::new()).ok() } else { None }
            }
        };
        let numbers: Vec<f64> = values.iter().filter_map(number).filter(|v| (0.0..=1.0).contains(v)).collect();
        <[f64; 3]>::try_from(numbers).ok().map(linear)
    }

    /// Evaluates one value.
    fn value(&mut self, value: &mut Value, at: SlotValue, role: Role, slots: &mut Option<Slots>) {
        let Some(text) = value.as_text() else { return };
        if let Role::Other = role {
            if slots.is_some() && text.contains(['{', '}']) {
                self.insertions(value, at, slots);
            }
            return;
        }
        if let Role::NumberOrWord(words) = role
            && words.contains(&text)
        {
            return;
        }
        if let (Role::Eta, Some(eta)) = (role, eta_of(text)) {
            value.kind = ValueKind::Number(eta);
            return;
        }
        let expression = match self.parse(text) {
            Ok(expression) => expression,
            // Words that no number is called are other mistakes, unless they are nearly its name.
            Err(_) if !seems_arithmetic(text) && closest_name(&self.names, text).is_none() => return,
            Err(mistake) => {
                let text = text.to_owned();
                self.mistake(value, 0, &text, mistake);
                value.kind = ValueKind::Number(1.0);
                return;
            }
        };
        match slots {
            Some(slots) if expression.needs(self.numbers.len()) => {
                let place = Place { span: value.span, from: 0 };
                let source = SlotSource::Number(expression, text.into());
                slots.found.push(Slot { path: slots.path.as_slice().into(), at, source, place });
            }
            _ => {
                let number = self.constant(&expression, value);
                value.kind = ValueKind::Number(number.unwrap_or(1.0));
            }
        }
    }

    /// Notes the numbers in braces that a text in a repeat holds.
    fn insertions(&mut self, value: &Value, at: SlotValue, slots: &mut Option<Slots>) {
        let text = value.as_text().unwrap_or_default();
        let mut pieces = Vec::new();
        let mut from = 0;
        while let Some(open) = text[from..].find(['{', '}']).map(|open| from + open) {
            let end = text[open..].find('}').map(|end| open + end);
            let Some(end) = end.filter(|_| text[open..].starts_with('{')) else {
                let message = "a { or } of this text has no other one";
                let help = "in a repeat, braces in a text hold a number: name=\"ball {i}\"";
                self.report.push(Message::error(value.span, message).help(help));
                return;
            };
            let inner = &text[open + 1..end];
            match self.parse(inner) {
                Ok(expression) => {
                    pieces.push(Piece::Text(text[from..open].into()));
                    pieces.push(Piece::Number(expression));
                }
                Err(mistake) => {
                    let text = text.to_owned();
                    return self.mistake(value, open + 1, &text, mistake);
                }
            }
            from = end + 1;
        }
        pieces.push(Piece::Text(text[from..].into()));
        let place = Place { span: value.span, from: 0 };
        if let Some(slots) = slots {
            let source = SlotSource::Text(pieces.into());
            slots.found.push(Slot { path: slots.path.as_slice().into(), at, source, place });
        }
    }
}
