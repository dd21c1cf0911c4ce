//! Parts of JSON that may have any type.

use serde_json::Value;

/// The elements of a list; none if there is no list.
pub(super) fn list<'a>(value: &'a Value, name: &str) -> &'a [Value] {
    value.get(name).and_then(Value::as_array).map_or(&[], Vec::as_slice)
}

/// A whole number, which may be written as `1.0`.
pub(super) fn whole(value: Option<&Value>) -> Option<usize> {
    let value = value?;
    let real = || value.as_f64().filter(|v| v.fract() == 0.0 && (0.0..9e15).contains(v)).map(|v| v as u64);
    value.as_u64().or_else(real).and_then(|v| usize::try_from(v).ok())
}

/// The element of a list of the document that a property names.
pub(super) fn named<'a>(json: &'a Value, of: &str, from: &Value, property: &str) -> Option<(usize, &'a Value)> {
    let index = whole(from.get(property))?;
    list(json, of).get(index).map(|element| (index, element))
}

/// The numbers of a list.
pub(super) fn numbers(value: Option<&Value>) -> Option<Vec<f64>> {
    value?.as_array()?.iter().map(Value::as_f64).collect()
}
