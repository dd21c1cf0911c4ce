//! Buffers (glTF 2.0, 3.6.1.1): those that nothing reads are looked for, too.

use super::broken::Broken;
use super::form::short;
use super::json::{Value, list};
use super::place::Place;
use crate::import::gltf::buffers::Buffers;

pub(super) fn check(json: &Value, buffers: &Buffers, is_binary: bool, broken: &mut Broken) {
    const TYPES: [&str; 2] = ["application/octet-stream", "application/gltf-buffer"];
    let places = Place::Root.key("buffers");
    for (i, buffer) in list(json, "buffers").iter().enumerate() {
        let place = places.item(i);
        match buffer.get("uri").and_then(Value::as_str).and_then(media_type) {
            Some(Err(wrong)) => broken.tell(&place.key("uri"), wrong),
            Some(Ok(kind)) if !TYPES.contains(&kind) => {
                let message = format!("its media type is {:?}; it must be {}", short(kind), TYPES.join(" or "));
                broken.tell(&place.key("uri"), message);
            }
            _ => {}
        }
        // The first buffer of a binary file is its chunk. A fallback of compressed views has no bytes.
        let is_chunk = i == 0 && is_binary && buffer.get("extensions").is_none();
        if buffer.get("uri").is_some() || is_chunk {
            buffers.check(i).unwrap_or_else(|fault| broken.fault_if_first(fault));
        }
    }
}

/// The media type of a data URI (RFC 2397); none of other URIs.
pub(super) fn media_type(uri: &str) -> Option<Result<&str, String>> {
    let start = uri.get(..5)?;
    if !start.eq_ignore_ascii_case("data:") {
        return None;
    }
    let Some((header, _)) = uri[5..].split_once(',') else {
        return Some(Err("the data URI is damaged: it has no comma".to_owned()));
    };
    let mut words = header.split(';');
    let kind = words.next().unwrap_or_default();
    let is_word = |word: &str| word.contains('=') || word.eq_ignore_ascii_case("base64");
    Some(match words.find(|word| !is_word(word)) {
        Some(word) => Err(format!("the data URI is damaged: {:?} is no parameter of its media type", short(word))),
        None => Ok(kind),
    })
}
