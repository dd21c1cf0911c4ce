//! The place that the rest of a path leads to: from a node through its blocks to a field, whose values are replaced.
//! Blocks that aren't there are made. What is wrong in them is told when the scene is decoded.

use super::super::nodes::{self, ALIASES, ALTERNATIVES, EASE, FOLLOW, KEY, POINT_FOLLOW, TURN};
use super::super::report::Message;
use super::super::schema::{NodeSchema, ValueType};
use super::super::syntax::{Node, Span, Value, ValueKind};
use crate::diagnostic::{closest_word, word_list};

/// A word of a path, between its dots.
#[derive(Clone, Debug)]
pub(super) struct Part {
    pub(super) text: String,
    pub(super) span: Span,
}

/// Whether the first part leads into a node of this schema: to a block, or to the keys of a field.
pub(super) fn leads_into(schema: &'static NodeSchema, path: &[Part]) -> bool {
    let [first, second, ..] = path else { return false };
    match nodes::field(schema, &first.text).map(|field| field.value_type) {
        Some(ValueType::Node(_)) => true,
        Some(_) => is_of_time(&second.text),
        None => false,
    }
}

/// What stands in a field in place of its values, or beside its keys.
fn is_of_time(word: &str) -> bool {
    [KEY, EASE.name(), TURN.name(), FOLLOW.name].contains(&word)
}

/// Replaces the values at the end of `path` below `node`, whose schema is unknown if its kind is a mistake.
///
/// # Errors
/// The first part that the node doesn't have.
pub(super) fn place(
    node: &mut Node,
    schema: Option<&'static NodeSchema>,
    path: &[Part],
    value: &Node,
) -> Result<(), Message> {
    let [part, inner @ ..] = path else { return Ok(()) };
    let [next, ..] = inner else {
        put(node, value.clone());
        return Ok(());
    };
    // The decoder tells the mistake in the node's kind.
    let Some(schema) = schema else { return Ok(()) };
    match nodes::field(schema, &part.text).map(|field| field.value_type) {
        Some(ValueType::Node(block)) => in_blocks(node, block, part, inner, value),
        Some(_) if is_of_time(&next.text) => in_time(entered(node, part), part, inner, value),
        Some(_) => {
            let message = format!("{} has values, and no {} in it", part.text, next.text);
            Err(Message::error(next.span, message).help(format!("it is set as a whole: {}=…", part.text)))
        }
        None => Err(unknown(part, schema)),
    }
}

/// Goes on in the blocks of a node: in those of a name, else in all. The name of a block is the text after its word.
fn in_blocks(
    node: &mut Node,
    schema: &'static NodeSchema,
    part: &Part,
    inner: &[Part],
    value: &Node,
) -> Result<(), Message> {
    let own = |block: &Node, name: &str| block.values.first().and_then(Value::as_text) == Some(name);
    let is_word = |name: &str| nodes::field(schema, name).is_some();
    let exists = node.children.iter().any(|child| *child.name == *part.text)
        || node.properties.iter().any(|property| *property.key == *part.text);
    let first = entered(node, part);
    let (name, inner) = match inner {
        [name, rest @ ..] if !rest.is_empty() && !is_word(&name.text) => {
            if !exists && schema.argument.is_some() {
                first.values.push(Value { kind: ValueKind::Text(name.text.as_str().into()), span: name.span });
            }
            (Some(name), rest)
        }
        _ => (None, inner),
    };
    let mut changed = Err(None);
    for block in node.children.iter_mut().filter(|child| *child.name == *part.text) {
        if name.is_none_or(|name| own(block, &name.text)) {
            match place(block, Some(schema), inner, value) {
                Ok(()) => changed = Ok(()),
                Err(message) => changed = changed.map_err(|first: Option<Message>| first.or(Some(message))),
            }
        }
    }
    let [last] = inner else { return changed.map_err(|message| message.unwrap_or_else(|| unknown(part, schema))) };
    for [field, block, field_in_block] in ALIASES {
        if changed.is_ok() && part.text == *block && last.text == *field_in_block {
            remove(node, field);
        }
    }
    changed.map_err(|message| message.unwrap_or_else(|| unknown(name.unwrap_or(part), schema)))
}

/// Sets a key, or a word beside the keys, in the node of a field.
fn in_time(field: &mut Node, part: &Part, inner: &[Part], value: &Node) -> Result<(), Message> {
    match inner {
        [word, time] if word.text == KEY => {
            let Ok(number) = time.text.parse::<f64>() else {
                let message = Message::error(time.span, "key takes its time");
                return Err(message.help(format!("for example: {}.key.50=…, or .key.\"2.5\"=…", part.text)));
            };
            let mut key = Node { name: KEY.into(), ..value.clone() };
            key.values.insert(0, Value { kind: ValueKind::Number(number), span: time.span });
            // Keys take the place of values.
            field.values.clear();
            let time_of =
                |child: &Node| child.values.first().and_then(Value::as_number).filter(|_| *child.name == *KEY);
            field.children.retain(|child| time_of(child) != Some(number));
            let later = field.children.iter().position(|child| time_of(child).is_some_and(|other| other > number));
            field.children.insert(later.unwrap_or(field.children.len()), key);
            Ok(())
        }
        [word, ..] if word.text == FOLLOW.name => match inner {
            [_] => {
                put(field, value.clone());
                Ok(())
            }
            [_, rest @ ..] => in_blocks(field, &POINT_FOLLOW, word, rest, value),
            [] => Ok(()),
        },
        [word] if word.text != KEY => {
            put(field, value.clone());
            Ok(())
        }
        _ => {
            let message = Message::error(part.span, format!("{} has no such word beside its keys", part.text));
            Err(message.help(format!("it has {0}.key.TIME=…, {0}.ease=…, {0}.turn=…", part.text)))
        }
    }
}

/// The node's first child of this word. It is made if it isn't there; a property becomes a child.
fn entered<'n>(node: &'n mut Node, part: &Part) -> &'n mut Node {
    if !node.children.iter().any(|child| *child.name == *part.text) {
        let mut child = Node::new(&part.text, part.span);
        if let Some(at) = node.properties.iter().position(|property| *property.key == *part.text) {
            let property = node.properties.remove(at);
            child.values.push(property.value);
        }
        exclude(node, &part.text);
        node.children.push(child);
    }
    let at = node.children.iter().position(|child| *child.name == *part.text).unwrap_or_default();
    &mut node.children[at]
}

fn unknown(part: &Part, schema: &'static NodeSchema) -> Message {
    let allowed = nodes::allowed(schema);
    let message = Message::error(part.span, format!("{} has no {}", schema.name, part.text));
    message.help(match closest_word(&part.text, allowed.iter().copied()) {
        Some(right) => format!("did you mean {right}?"),
        None => format!("it has {}", word_list(&allowed, "and")),
    })
}

/// Removes a field.
fn remove(node: &mut Node, field: &str) {
    node.properties.retain(|property| *property.key != *field);
    node.children.retain(|child| *child.name != *field);
}

/// Removes the fields that this one excludes.
fn exclude(node: &mut Node, field: &str) {
    for pair in ALTERNATIVES.iter().filter(|pair| pair.contains(&field)) {
        pair.iter().filter(|other| **other != field).for_each(|other| remove(node, other));
    }
}

/// Replaces the node's child or property of that name, and removes those that it excludes. Where the node says the same
/// in a block, it is replaced there.
fn put(node: &mut Node, mut value: Node) {
    let says = |block: &Node, field: &str| {
        let has_property = block.properties.iter().any(|property| *property.key == *field);
        has_property || block.children.iter().any(|child| *child.name == *field)
    };
    for [field, block, inner] in ALIASES {
        if *value.name == *field {
            let mut blocks = node.children.iter_mut();
            if let Some(block) = blocks.find(|child| *child.name == *block && says(child, inner)) {
                value.name = inner.into();
                return put(block, value);
            }
        } else if *value.name == *block && says(&value, inner) {
            remove(node, field);
        }
    }
    exclude(node, &value.name);
    let place = node.children.iter().position(|child| child.name == value.name);
    remove(node, &value.name);
    node.children.insert(place.unwrap_or(node.children.len()), value);
}
