//! Buffer views and their uses (glTF 2.0, 3.6.1): each has one use alone.

use super::broken::Broken;
use super::json::{Value, list, named, whole};
use super::place::Place;

/// The use of a buffer view.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Use {
    Vertices,
    Indices,
    Matrices,
    Image,
    Other,
}

impl Use {
    fn words(self) -> &'static str {
        match self {
            Use::Vertices => "vertices",
            Use::Indices => "indices of vertices",
            Use::Matrices => "inverse bind matrices",
            Use::Image => "a picture",
            Use::Other => "keys of animations or sparse elements",
        }
    }
}

/// The uses of the buffer views so far.
pub(super) struct Uses(Vec<Option<Use>>);

impl Uses {
    /// The uses that the targets say.
    pub(super) fn new(json: &Value) -> Uses {
        let of = |view: &Value| match whole(view.get("target")) {
            Some(34962) => Some(Use::Vertices),
            Some(34963) => Some(Use::Indices),
            _ => None,
        };
        Uses(list(json, "bufferViews").iter().map(of).collect())
    }

    /// Notes the use of the buffer view of an object. A second use is told.
    pub(super) fn note(&mut self, json: &Value, object: &Value, own: Use, place: &Place, broken: &mut Broken) {
        let Some((number, _)) = named(json, "bufferViews", object, "bufferView") else { return };
        let first = *self.0[number].get_or_insert(own);
        if first != own {
            let (own, first) = (own.words(), first.words());
            broken
                .tell(place, format!("buffer view {number} holds {own} here, but elsewhere or by its target {first}"));
        }
    }
}

pub(super) fn check(json: &Value, broken: &mut Broken) {
    let views = Place::Root.key("bufferViews");
    for (i, view) in list(json, "bufferViews").iter().enumerate() {
        let place = views.item(i);
        let [offset, length, stride] = ["byteOffset", "byteLength", "byteStride"].map(|name| whole(view.get(name)));
        if let Some(stride) = stride {
            let place = place.key("byteStride");
            if stride % 4 != 0 {
                broken.tell(&place, format!("is {stride}; it must be a multiple of 4"));
            }
            if let Some(length) = length.filter(|length| stride > *length) {
                broken.tell(&place, format!("is {stride}, more than the {length} bytes of the view"));
            }
            if whole(view.get("target")) == Some(34963) {
                broken.tell(&place, "its target says indices; only vertices may have a byteStride");
            }
        }
        let buffer = named(json, "buffers", view, "buffer").and_then(|(_, buffer)| whole(buffer.get("byteLength")));
        let (Some(size), offset) = (buffer, offset.unwrap_or(0)) else { continue };
        if offset >= size {
            broken.tell(&place.key("byteOffset"), format!("is {offset}, but its buffer has {size} bytes"));
        } else if length.is_some_and(|length| offset.saturating_add(length) > size) {
            let message = format!("from byte {offset} on it goes beyond the {size} bytes of its buffer");
            broken.tell(&place.key("byteLength"), message);
        }
    }
}
