//! Accessors: their bytes within buffer views, their alignment, and what their fields say of each other (glTF 2.0,
//! 3.6.2).

use super::broken::Broken;
use super::json::{Value, list, named, whole};
use super::place::Place;
use super::views::{Use, Uses};
use crate::import::gltf::accessor::shape;
use std::fmt;

/// The type of an accessor's elements.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Format<'a> {
    kind: &'a str,
    component: &'static str,
    is_normalized: bool,
}

impl<'a> Format<'a> {
    pub(super) fn of(accessor: &'a Value<'a>) -> Format<'a> {
        Format {
            kind: accessor.get("type").and_then(Value::as_str).unwrap_or_default(),
            component: component(accessor.get("componentType")),
            is_normalized: accessor.get("normalized").is_some_and(|value| *value == Value::Bool(true)),
        }
    }

    /// Whether the type is one of these, and its components, too. Those of normalized integers end in `_NORMALIZED`.
    pub(super) fn is(&self, kinds: &[&str], components: &[&str]) -> bool {
        let is_own = |name: &&str| match name.strip_suffix("_NORMALIZED") {
            Some(name) => self.is_normalized && name == self.component,
            None => !self.is_normalized && *name == self.component,
        };
        kinds.contains(&self.kind) && components.iter().any(is_own)
    }

    /// Whether the type is that of numbers that a file says wrongly, which is told elsewhere.
    pub(super) fn is_unknown(&self) -> bool {
        self.component.is_empty() || shape(self.kind).is_none()
    }

    pub(super) fn has_component(&self, name: &str) -> bool {
        self.component == name
    }

    /// The bytes of a component.
    fn component_size(&self) -> usize {
        match self.component {
            "BYTE" | "UNSIGNED_BYTE" => 1,
            "SHORT" | "UNSIGNED_SHORT" => 2,
            _ => 4,
        }
    }

    /// The numbers of an element.
    pub(super) fn width(&self) -> usize {
        shape(self.kind).map_or(0, |[columns, rows]| columns * rows)
    }

    /// The bytes of an element, and those from one element to the next. Each column of a matrix starts at a multiple of
    /// 4 bytes.
    pub(super) fn size_and_stride(&self) -> [usize; 2] {
        let [columns, rows] = shape(self.kind).unwrap_or([1, 0]);
        let own = self.component_size() * rows;
        let column = if columns == 1 { own } else { own.next_multiple_of(4) };
        [column * (columns - 1) + own, column * columns]
    }

    fn is_matrix(&self) -> bool {
        self.kind.starts_with("MAT")
    }

    /// The largest number of an integer type; 1 of others.
    pub(super) fn most(&self) -> f64 {
        match self.component {
            "BYTE" => 127.0,
            "UNSIGNED_BYTE" => 255.0,
            "SHORT" => 32767.0,
            "UNSIGNED_SHORT" => 65535.0,
            "UNSIGNED_INT" => 4_294_967_295.0,
            _ => 1.0,
        }
    }
}

impl fmt::Display for Format<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} of {}{}", self.kind, self.component, if self.is_normalized { ", normalized" } else { "" })
    }
}

fn component(code: Option<&Value>) -> &'static str {
    match whole(code) {
        Some(5120) => "BYTE",
        Some(5121) => "UNSIGNED_BYTE",
        Some(5122) => "SHORT",
        Some(5123) => "UNSIGNED_SHORT",
        Some(5125) => "UNSIGNED_INT",
        Some(5126) => "FLOAT",
        _ => "",
    }
}

/// Whether the buffer view of an accessor has a stride.
pub(super) fn has_stride(json: &Value, accessor: &Value) -> bool {
    named(json, "bufferViews", accessor, "bufferView").is_some_and(|(_, view)| view.get("byteStride").is_some())
}

pub(super) fn check(json: &Value, uses: &mut Uses, broken: &mut Broken) {
    let accessors = Place::Root.key("accessors");
    for (i, accessor) in list(json, "accessors").iter().enumerate() {
        let place = accessors.item(i);
        let format = Format::of(accessor);
        if format.is_unknown() {
            continue;
        }
        if format.is_normalized && matches!(format.component, "FLOAT" | "UNSIGNED_INT") {
            let message = format!("{} can't be normalized; only bytes and shorts can", format.component);
            broken.tell(&place.key("normalized"), message);
        }
        for name in ["min", "max"] {
            let count = accessor.get(name).and_then(Value::as_list).map(<[Value]>::len);
            if let Some(count) = count.filter(|count| *count != format.width() && *count > 0) {
                let message = format!("it has {count} numbers, but its elements have {}", format.width());
                broken.tell(&place.key(name), message);
            }
        }
        bytes(json, accessor, &format, &place, broken);
        if let Some(values) = accessor.get("sparse") {
            let place = place.key("sparse");
            for name in ["indices", "values"] {
                let part = values.get(name).unwrap_or(&Value::Null);
                uses.note(json, part, Use::Other, &place.key(name).key("bufferView"), broken);
            }
            sparse(json, accessor, values, &format, &place, broken);
        }
    }
}

fn bytes(json: &Value, accessor: &Value, format: &Format, place: &Place, broken: &mut Broken) {
    let offset = whole(accessor.get("byteOffset"));
    if offset.is_some() && accessor.get("bufferView").is_none() {
        broken.tell(&place.key("byteOffset"), "it has no bufferView, which a byteOffset needs");
    }
    if format.is_matrix() && offset.is_some_and(|offset| offset % 4 != 0) {
        let message = format!("is {}; matrices start at multiples of 4 bytes", offset.unwrap_or(0));
        broken.tell(&place.key("byteOffset"), message);
    }
    let Some((number, view)) = named(json, "bufferViews", accessor, "bufferView") else { return };
    let ([size, packed], stride) = (format.size_and_stride(), whole(view.get("byteStride")));
    if let Some(stride) = stride.filter(|stride| *stride < size) {
        let message = format!("its elements of {size} bytes don't fit the byteStride {stride} of buffer view {number}");
        broken.tell(place, message);
    }
    let count = whole(accessor.get("count")).unwrap_or(1).max(1);
    let length = (count - 1).saturating_mul(stride.unwrap_or(packed)).saturating_add(size);
    within(view, number, accessor, [format.component_size(), length], place, broken);
}

/// Checks the bytes of a part of a buffer view, from the byteOffset of an object on: their alignment and their end.
fn within(view: &Value, number: usize, object: &Value, [unit, length]: [usize; 2], place: &Place, broken: &mut Broken) {
    let own = whole(object.get("byteOffset")).unwrap_or(0);
    let start = whole(view.get("byteOffset")).unwrap_or(0).saturating_add(own);
    if !own.is_multiple_of(unit) {
        let message = format!("is {own}; components of {unit} bytes start at multiples of {unit}");
        broken.tell(&place.key("byteOffset"), message);
    }
    if !start.is_multiple_of(unit) {
        let message = format!("it starts at byte {start} of its buffer; components of {unit} bytes start at multiples");
        broken.tell(place, message);
    }
    let Some(size) = whole(view.get("byteLength")) else { return };
    if own.saturating_add(length) > size {
        let message =
            format!("it has {length} bytes from {own} on, more than the {size} bytes of buffer view {number}");
        broken.tell(place, message);
    }
}

fn sparse(json: &Value, accessor: &Value, sparse: &Value, format: &Format, place: &Place, broken: &mut Broken) {
    let count = whole(sparse.get("count")).unwrap_or(0);
    if let Some(all) = whole(accessor.get("count")).filter(|all| count > *all) {
        broken.tell(&place.key("count"), format!("is {count}, more than the {all} elements of the accessor"));
    }
    for name in ["indices", "values"] {
        let Some(part) = sparse.get(name) else { continue };
        let Some((number, view)) = named(json, "bufferViews", part, "bufferView") else { continue };
        let place = place.key(name);
        let own = Format { kind: "SCALAR", component: component(part.get("componentType")), is_normalized: false };
        let format = if name == "indices" { &own } else { format };
        let [size, packed] = format.size_and_stride();
        let length = count.saturating_sub(1).saturating_mul(packed).saturating_add(size);
        within(view, number, part, [format.component_size(), length], &place, broken);
        if view.get("byteStride").is_some() {
            broken.tell(&place.key("bufferView"), "it has a byteStride; only vertices may have one");
        }
    }
}
