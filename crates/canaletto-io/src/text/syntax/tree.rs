//! The syntax tree of a file.

use crate::text::animate::Keys;
use crate::text::arithmetic::Repeat;
use crate::text::nodes::{INSTANCE, LIGHT, MATERIAL_NODE, OF};
use std::num::NonZeroU8;
use std::sync::Arc;

/// A range of bytes of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Span {
    /// The file's number in [`crate::text::files::Files`].
    pub(crate) file: u16,
    pub(crate) start: u32,
    pub(crate) end: u32,
}

/// `name value key=value { children }`
#[derive(Clone, Debug)]
pub(crate) struct Node {
    pub(crate) name: Box<str>,
    pub(crate) name_span: Span,
    pub(crate) span: Span,
    pub(crate) values: Vec<Value>,
    pub(crate) properties: Vec<Property>,
    pub(crate) children: Vec<Node>,
    /// Whether a mistake in its values was reported, so that their number and types mean nothing.
    pub(crate) broken: bool,
    /// The number of nodes that a packed node represents. Its name is that of the first; most of its values and its
    /// children are omitted and must be parsed again: see [`super::unpack`].
    pub(crate) packed: Option<NonZeroU8>,
    /// How the copies of a `repeat` differ, once it is prepared.
    pub(crate) repeat: Option<Arc<Repeat>>,
    /// The keys, once they are moved out of the children.
    pub(crate) keys: Option<Arc<Keys>>,
    /// The values at the sample times while the shutter is open, if keys change them; otherwise empty.
    pub(crate) moving: Vec<Vec<Value>>,
}

/// `key=value`
#[derive(Clone, Debug)]
pub(crate) struct Property {
    pub(crate) key: Box<str>,
    pub(crate) key_span: Span,
    pub(crate) value: Value,
}

/// A value and its span.
#[derive(Clone, Debug)]
pub(crate) struct Value {
    pub(crate) kind: ValueKind,
    pub(crate) span: Span,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) enum ValueKind {
    Number(f64),
    Text(Box<str>),
    Flag(bool),
    Null,
}

impl Node {
    pub(crate) fn new(name: &str, span: Span) -> Node {
        Node {
            name: name.into(),
            name_span: span,
            span,
            values: Vec::new(),
            properties: Vec::new(),
            children: Vec::new(),
            broken: false,
            packed: None,
            repeat: None,
            keys: None,
            moving: Vec::new(),
        }
    }

    pub(crate) fn clone_without_children(&self) -> Node {
        Node {
            name: self.name.clone(),
            values: self.values.clone(),
            properties: self.properties.clone(),
            children: Vec::new(),
            repeat: self.repeat.clone(),
            keys: self.keys.clone(),
            moving: self.moving.clone(),
            ..*self
        }
    }

    /// Removes the values and children that take most memory. The target of an instance and the name of a material
    /// stay.
    pub(crate) fn pack(&mut self) {
        self.packed = Some(NonZeroU8::MIN);
        self.children = Vec::new();
        if *self.name == *INSTANCE.schema.name {
            let target = |value: Value| Property { key: OF.name().into(), key_span: value.span, value };
            self.properties.extend(self.values.drain(..).map(target));
        }
        self.values.retain(|_| *self.name == *MATERIAL_NODE.name);
        self.values.shrink_to_fit();
        self.properties.retain(|property| *property.key == *OF.name());
        self.properties.shrink_to_fit();
    }

    /// Merges the packed node `next`, which follows directly in the text, into this one. Returns it if they can't be
    /// merged: if their kinds (light, instance, material or other) differ, if one is a material, or if the count is at
    /// its limit.
    pub(crate) fn join(&mut self, next: Node) -> Option<Node> {
        let kind = |node: &Node| {
            [LIGHT, INSTANCE.schema.name, MATERIAL_NODE.name].iter().position(|kind| *kind == &*node.name)
        };
        let Some(packed) = self.packed.and_then(|packed| packed.checked_add(1)) else { return Some(next) };
        if next.packed.is_none()
            || kind(self) != kind(&next)
            || !next.values.is_empty()
            || self.span.file != next.span.file
        {
            return Some(next);
        }
        self.packed = Some(packed);
        self.span.end = next.span.end;
        for property in next.properties {
            if self.properties.iter().all(|known| known.value.kind != property.value.kind) {
                self.properties.push(property);
            }
        }
        None
    }

    /// The text of `key`, if it is a property or child with that single text, without validation.
    pub(crate) fn text(&self, key: &str) -> Option<(&str, Span)> {
        let property = self.properties.iter().find(|p| &*p.key == key).map(|p| &p.value);
        let value = property.or_else(|| self.children.iter().find(|c| &*c.name == key)?.values.first())?;
        value.as_text().map(|text| (text, value.span))
    }
}

impl Value {
    pub(crate) fn as_text(&self) -> Option<&str> {
        if let ValueKind::Text(text) = &self.kind { Some(text) } else { None }
    }

    pub(crate) fn as_number(&self) -> Option<f64> {
        if let ValueKind::Number(number) = self.kind { Some(number) } else { None }
    }
}
