//! Images (glTF 2.0, 3.8.3): those that nothing draws are looked at, too, but only their first bytes.

use super::broken::Broken;
use super::buffers::media_type;
use super::form::short;
use super::json::{Value, list, named};
use super::place::Place;
use super::views::{Use, Uses};
use crate::import::gltf::buffers::Buffers;

pub(super) fn check(json: &Value, uses: &mut Uses, broken: &mut Broken) {
    let images = Place::Root.key("images");
    for (i, image) in list(json, "images").iter().enumerate().filter(|(_, image)| image.is_object()) {
        let place = images.item(i);
        match (image.get("uri"), image.get("bufferView")) {
            (Some(_), Some(_)) => broken.tell(&place, "it has both uri and bufferView; one of them is expected"),
            (None, None) => broken.tell(&place, "it has neither uri nor bufferView"),
            _ => {}
        }
        let view_place = place.key("bufferView");
        if image.get("bufferView").is_some() && image.get("mimeType").is_none() {
            broken.tell(&view_place, "its image has no mimeType, which it needs");
        }
        uses.note(json, image, Use::Image, &view_place, broken);
        if named(json, "bufferViews", image, "bufferView").is_some_and(|(_, view)| view.get("byteStride").is_some()) {
            broken.tell(&view_place, "it has a byteStride; only vertices may have one");
        }
    }
}

/// Checks the first bytes of all images.
pub(super) fn check_data(json: &Value, buffers: &Buffers, broken: &mut Broken) {
    let images = Place::Root.key("images");
    for (i, image) in list(json, "images").iter().enumerate() {
        let place = images.item(i);
        let uri = image.get("uri").and_then(Value::as_str);
        let uri_place = place.key("uri");
        let start = match (uri, named(json, "bufferViews", image, "bufferView")) {
            (Some(uri), None) => buffers.files().start(uri).map_err(|fault| fault.at(uri_place.to_string())),
            (None, Some((view, _))) => match buffers.start(view) {
                Some(start) => start,
                None => continue,
            },
            _ => continue,
        };
        let (start, is_all) = match start {
            Ok(start) => start,
            Err(fault) => {
                broken.fault_if_first(fault);
                continue;
            }
        };
        let found = media_type_of(&start);
        if let Some(wrong) = damage(&start, is_all) {
            broken.tell(&place, wrong);
        }
        let said =
            [(uri.and_then(media_type), "uri"), (image.get("mimeType").and_then(Value::as_str).map(Ok), "mimeType")];
        for (said, name) in said {
            match (said, found) {
                (Some(Err(wrong)), _) => broken.tell(&place.key(name), wrong),
                (Some(Ok(said)), Some(found)) if said != found => {
                    let message = format!("its media type is {:?}, but its bytes are {found}", short(said));
                    broken.tell(&place.key(name), message);
                }
                _ => {}
            }
        }
    }
}

const PNG: &[u8] = b"\x89PNG\r\n\x1a\n";
const JPEG: &[u8] = b"\xff\xd8\xff";
const KTX2: &[u8] = b"\xabKTX 20\xbb\r\n\x1a\n";

/// The media type of an image by its first bytes.
fn media_type_of(start: &[u8]) -> Option<&'static str> {
    if start.starts_with(PNG) {
        return Some("image/png");
    }
    if start.starts_with(JPEG) {
        return Some("image/jpeg");
    }
    if start.starts_with(KTX2) {
        return Some("image/ktx2");
    }
    (start.starts_with(b"RIFF") && start.get(8..12) == Some(b"WEBP")).then_some("image/webp")
}

/// What is wrong with the first bytes of an image, which may be all.
fn damage(start: &[u8], is_all: bool) -> Option<&'static str> {
    /// The signature of PNG, its first chunk, and the shortest further ones.
    const LEAST_PNG: usize = 8 + 25 + 12 + 12;
    if start.starts_with(PNG) && is_all && start.len() < LEAST_PNG {
        return Some("its PNG ends too early");
    }
    // The length of a segment of JPEG counts its own two bytes.
    let length = start.get(4..6).filter(|_| start.starts_with(JPEG)).map(|two| u16::from_be_bytes([two[0], two[1]]));
    if length.is_some_and(|length| length < 2) {
        return Some("its JPEG is damaged: its first segment is shorter than its own length");
    }
    None
}
