//! JSON of any form. Its texts stay where they are in the file's own text, so that nothing is copied.

use serde::de::{Deserialize, Deserializer, Error, MapAccess, SeqAccess, Visitor};
use std::borrow::Cow;
use std::fmt;

/// A value of any type. Numbers are exact up to 2⁵³, as indices and counts are.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::import::gltf) enum Value<'a> {
    Null,
    Bool(bool),
    Number(f64),
    Text(Cow<'a, str>),
    List(Vec<Value<'a>>),
    Object(Object<'a>),
}

/// The properties of an object, in the order of their names.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::import::gltf) struct Object<'a>(Vec<(Cow<'a, str>, Value<'a>)>);

impl<'a> Object<'a> {
    pub(super) fn get(&self, name: &str) -> Option<&Value<'a>> {
        self.0.binary_search_by(|(own, _)| own.as_ref().cmp(name)).ok().map(|found| &self.0[found].1)
    }

    pub(super) fn contains_key(&self, name: &str) -> bool {
        self.get(name).is_some()
    }

    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The names and values.
    pub(super) fn iter(&self) -> impl Iterator<Item = (&str, &Value<'a>)> {
        self.0.iter().map(|(name, value)| (name.as_ref(), value))
    }
}

impl<'a> Value<'a> {
    /// The property of an object.
    pub(super) fn get(&self, name: &str) -> Option<&Value<'a>> {
        self.as_object()?.get(name)
    }

    pub(super) fn as_object(&self) -> Option<&Object<'a>> {
        if let Value::Object(object) = self { Some(object) } else { None }
    }

    pub(super) fn as_list(&self) -> Option<&[Value<'a>]> {
        if let Value::List(list) = self { Some(list) } else { None }
    }

    pub(super) fn as_str(&self) -> Option<&str> {
        if let Value::Text(text) = self { Some(text) } else { None }
    }

    pub(super) fn as_f64(&self) -> Option<f64> {
        if let Value::Number(number) = self { Some(*number) } else { None }
    }

    pub(super) fn is_object(&self) -> bool {
        self.as_object().is_some()
    }

    /// The properties of an object with their names; none of others.
    pub(super) fn properties(&self) -> impl Iterator<Item = (&str, &Value<'a>)> {
        self.as_object().into_iter().flat_map(Object::iter)
    }
}

impl<'de> Deserialize<'de> for Value<'de> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Value<'de>, D::Error> {
        deserializer.deserialize_any(Reader)
    }
}

/// A text that stands in the file's own text, unless it has escapes.
struct Name<'a>(Cow<'a, str>);

impl<'de> Deserialize<'de> for Name<'de> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Name<'de>, D::Error> {
        match deserializer.deserialize_str(Reader)? {
            Value::Text(text) => Ok(Name(text)),
            _ => Err(D::Error::custom("a name is a text")),
        }
    }
}

struct Reader;

impl<'de> Visitor<'de> for Reader {
    type Value = Value<'de>;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("a value of JSON")
    }

    fn visit_unit<E>(self) -> Result<Value<'de>, E> {
        Ok(Value::Null)
    }

    fn visit_bool<E>(self, value: bool) -> Result<Value<'de>, E> {
        Ok(Value::Bool(value))
    }

    fn visit_u64<E>(self, value: u64) -> Result<Value<'de>, E> {
        Ok(Value::Number(value as f64))
    }

    fn visit_i64<E>(self, value: i64) -> Result<Value<'de>, E> {
        Ok(Value::Number(value as f64))
    }

    fn visit_f64<E>(self, value: f64) -> Result<Value<'de>, E> {
        Ok(Value::Number(value))
    }

    fn visit_borrowed_str<E>(self, text: &'de str) -> Result<Value<'de>, E> {
        Ok(Value::Text(Cow::Borrowed(text)))
    }

    fn visit_str<E>(self, text: &str) -> Result<Value<'de>, E> {
        Ok(Value::Text(Cow::Owned(text.to_owned())))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut elements: A) -> Result<Value<'de>, A::Error> {
        let mut list = Vec::new();
        while let Some(element) = elements.next_element()? {
            list.push(element);
        }
        Ok(Value::List(list))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut entries: A) -> Result<Value<'de>, A::Error> {
        let mut object = Vec::new();
        while let Some((Name(name), value)) = entries.next_entry()? {
            object.push((name, value));
        }
        object.sort_by(|(a, _), (b, _)| a.cmp(b));
        Ok(Value::Object(Object(object)))
    }
}

/// The elements of a list; none if there is no list.
pub(super) fn list<'v>(value: &'v Value<'v>, name: &str) -> &'v [Value<'v>] {
    value.get(name).and_then(Value::as_list).unwrap_or_default()
}

/// A whole number from 0 on, which may be written as `1.0`.
pub(super) fn whole(value: Option<&Value>) -> Option<usize> {
    value?.as_f64().filter(|v| v.fract() == 0.0 && (0.0..9e15).contains(v)).map(|v| v as usize)
}

/// The element of a list of the document that a property names.
pub(super) fn named<'v>(json: &'v Value<'v>, of: &str, from: &Value, property: &str) -> Option<(usize, &'v Value<'v>)> {
    let index = whole(from.get(property))?;
    list(json, of).get(index).map(|element| (index, element))
}

/// The numbers of a list.
pub(super) fn numbers(value: Option<&Value>) -> Option<Vec<f64>> {
    value?.as_list()?.iter().map(Value::as_f64).collect()
}
