//! The valid fields of a node, and their values.

use super::nodes::TransformField;
use super::schema::{Field, FieldSchema, NUMBER, NodeSchema, Numbers, POINT, Text, ValueType};
use super::syntax::{Node, Span, Value, ValueKind};
use canaletto::Named;
use canaletto::math::Rgb;
use canaletto::scene::Exposure;
use glam::{DVec3, Vec3};

/// The fields of a node, each value validated. Mistakes were reported.
pub(crate) struct Fields<'a> {
    pub(crate) node: &'a Node,
    pub(super) words: &'static NodeSchema,
    pub(super) got: Vec<Entry<'a>>,
    /// The transforms in the order in which they are written.
    pub(crate) transforms: Vec<TransformEntry<'a>>,
    /// The objects and lights in the node.
    pub(crate) objects: Vec<&'a Node>,
    /// Whether all fields are valid and none is missing.
    pub(crate) valid: bool,
    /// The fields that misspelled words probably mean, so that they aren't reported as missing.
    pub(super) meant: Vec<&'static str>,
}

/// A field with its values.
pub(crate) struct Entry<'a> {
    pub(crate) word: &'static FieldSchema,
    pub(crate) values: &'a [Value],
    /// The node of the values; `None` for a property.
    pub(crate) node: Option<&'a Node>,
    pub(crate) span: Span,
    pub(super) good: bool,
}

/// A transform with its values.
pub(crate) struct TransformEntry<'a> {
    pub(crate) transform: &'static TransformField,
    pub(crate) entry: Entry<'a>,
}

/// A type of values that a field can have.
pub(crate) trait FieldValue: Sized {
    /// What the scene text must hold for it.
    const TYPE: ValueType;

    /// The value of an entry with valid values.
    fn read(entry: &Entry) -> Option<Self>;
}

impl FieldValue for f64 {
    const TYPE: ValueType = NUMBER;

    fn read(entry: &Entry) -> Option<f64> {
        entry.numbers().map(|[number]| number)
    }
}

impl FieldValue for f32 {
    const TYPE: ValueType = NUMBER;

    fn read(entry: &Entry) -> Option<f32> {
        f64::read(entry).map(|number| number as f32)
    }
}

impl FieldValue for [f64; 2] {
    const TYPE: ValueType = ValueType::Numbers(&[2]);

    fn read(entry: &Entry) -> Option<[f64; 2]> {
        entry.numbers()
    }
}

impl FieldValue for DVec3 {
    const TYPE: ValueType = POINT;

    fn read(entry: &Entry) -> Option<DVec3> {
        entry.numbers().map(DVec3::from_array)
    }
}

impl FieldValue for Vec3 {
    const TYPE: ValueType = POINT;

    fn read(entry: &Entry) -> Option<Vec3> {
        DVec3::read(entry).map(|v| v.as_vec3())
    }
}

impl FieldValue for Rgb {
    const TYPE: ValueType = ValueType::Rgb;

    fn read(entry: &Entry) -> Option<Rgb> {
        let gray = entry.numbers().map(|[v]| Rgb::gray(v as f32));
        gray.or_else(|| Vec3::read(entry).map(|v| Rgb::from(v.to_array())))
    }
}

impl FieldValue for u32 {
    const TYPE: ValueType = ValueType::Count;

    fn read(entry: &Entry) -> Option<u32> {
        f64::read(entry).map(|number| number as u32)
    }
}

impl FieldValue for Exposure {
    const TYPE: ValueType = ValueType::NumberOrKeyword(&[Exposure::AUTO]);

    fn read(entry: &Entry) -> Option<Exposure> {
        let word = entry.good.then(|| entry.values.first()?.as_text()).flatten();
        word.map_or_else(|| f32::read(entry).map(Exposure::Stops), |word| word.parse().ok())
    }
}

impl<const N: usize> FieldValue for [u32; N] {
    const TYPE: ValueType = ValueType::Counts(N);

    fn read(entry: &Entry) -> Option<[u32; N]> {
        Some(entry.numbers::<N>()?.map(|number| number as u32))
    }
}

impl FieldValue for bool {
    const TYPE: ValueType = ValueType::Flag;

    fn read(entry: &Entry) -> Option<bool> {
        match entry.values {
            [] => Some(true),
            [Value { kind: ValueKind::Flag(flag), .. }] => Some(*flag),
            _ => None,
        }
    }
}

impl<'a> Fields<'a> {
    fn got(&self, name: &str) -> Option<&Entry<'a>> {
        self.got.iter().find(|got| got.word.name == name)
    }

    /// All entries of a field that may occur more than once.
    pub(crate) fn every<T>(&self, field: &Field<T>) -> impl Iterator<Item = &Entry<'a>> {
        #[cfg(test)]
        super::nodes::tests::note_read(self.words, field.name());
        let name = field.name();
        self.got.iter().filter(move |got| got.word.name == name && got.good)
    }

    /// Whether the field is present.
    pub(crate) fn has<T>(&self, field: &Field<T>) -> bool {
        self.got(field.name()).is_some()
    }

    /// Whether the field of this name is present.
    pub(crate) fn has_named(&self, name: &str) -> bool {
        self.got(name).is_some()
    }

    /// The span of the field, or else of the node's name.
    pub(crate) fn span<T>(&self, field: &Field<T>) -> Span {
        self.span_of(field.name())
    }

    /// The span of the field of this name, or else of the node's name.
    pub(crate) fn span_of(&self, name: &str) -> Span {
        self.got(name).map_or(self.node.name_span, |got| got.span)
    }

    /// The field's entry, if its values are valid.
    pub(crate) fn raw<T>(&self, field: &Field<T>) -> Option<&Entry<'a>> {
        #[cfg(test)]
        super::nodes::tests::note_read(self.words, field.name());
        self.got(field.name()).filter(|got| got.good)
    }

    /// The field's value.
    pub(crate) fn get<T: FieldValue>(&self, field: &Field<T>) -> Option<T> {
        T::read(self.raw(field)?)
    }

    /// The value of a field of a flag or word, if it is a flag.
    pub(crate) fn flag<T>(&self, field: &Field<T>) -> Option<bool> {
        bool::read(self.raw(field)?)
    }

    /// The value of a closed set that the field's word stands for.
    pub(crate) fn word<T: Named>(&self, field: &Field<T>) -> Option<T> {
        T::from_name(self.raw(field)?.values.first()?.as_text()?)
    }

    pub(crate) fn text(&self, field: &Field<Text>) -> Option<&'a str> {
        self.raw(field)?.values.first()?.as_text()
    }

    /// The numbers of a field, if there are this many.
    pub(crate) fn numbers<const N: usize>(&self, field: &Field<Numbers>) -> Option<[f64; N]> {
        self.raw(field)?.numbers()
    }

    /// All numbers of a field.
    pub(crate) fn all(&self, field: &Field<Numbers>) -> Option<Vec<f64>> {
        Some(self.raw(field)?.values.iter().filter_map(Value::as_number).collect())
    }

    /// Whether the field's values stand right after the node's name.
    pub(crate) fn is_argument<T>(&self, field: &Field<T>) -> bool {
        self.words.argument.is_some_and(|argument| argument.name == field.name())
    }

    /// The points in double precision that place the object, in the order of its schema.
    pub(crate) fn places(&self) -> Vec<DVec3> {
        let entry = |word: &FieldSchema| self.got.iter().find(|got| got.word.name == word.name && got.good);
        self.words.own().filter(|word| word.places).filter_map(|word| DVec3::read(entry(word)?)).collect()
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
