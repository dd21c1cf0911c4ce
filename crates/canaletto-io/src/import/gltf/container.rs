//! The container: JSON alone, or GLB with its chunks (glTF 2.0, 4.4).

use super::fault::Fault;
use super::schema::Document;
use serde_json::Value;

const MAGIC: &[u8; 4] = b"glTF";
const JSON: u32 = 0x4E4F_534A;
const BIN: u32 = 0x004E_4942;

/// A file: the text of its document, and the bytes of the binary chunk, if there is one.
pub(super) struct Container<'a> {
    pub(super) json: &'a str,
    pub(super) binary_chunk: Option<&'a [u8]>,
    /// Whether the file is GLB.
    pub(super) is_binary: bool,
}

/// Opens a file: its chunks, if it has some.
pub(super) fn open<'a>(bytes: &'a [u8], warnings: &mut Vec<Fault>) -> Result<Container<'a>, Fault> {
    let is_binary = bytes.starts_with(MAGIC);
    let (json, binary_chunk) = if is_binary { chunks(bytes, warnings)? } else { (bytes, None) };
    let mark = json.strip_prefix(b"\xEF\xBB\xBF");
    if mark.is_some() {
        warnings.push(Fault::new("the JSON begins with a byte order mark, which it must not have"));
    }
    let json = std::str::from_utf8(mark.unwrap_or(json)).map_err(|e| {
        Fault::new(format!("the JSON isn't UTF-8: byte {} can't be read", e.valid_up_to()))
            .help("a binary glTF starts with the letters glTF; this may be another format")
    })?;
    Ok(Container { json, binary_chunk, is_binary })
}

/// Reads the document of a text.
pub(super) fn document(json: &str) -> Result<Document, Fault> {
    let mut reader = serde_json::Deserializer::from_str(json);
    let document: Document = match serde_path_to_error::deserialize(&mut reader) {
        Ok(document) => {
            reader.end().map_err(|e| Fault::new(format!("something follows the JSON: {e}")))?;
            document
        }
        Err(error) => with_whole_numbers(json).ok_or_else(|| Fault::of_json(&error))?,
    };
    check_version(&document)?;
    Ok(document)
}

/// The document of a text whose whole numbers are written as `1.0`, which JSON allows.
fn with_whole_numbers(json: &str) -> Option<Document> {
    fn whole(value: &mut Value) {
        match value {
            Value::Number(number) => {
                // Up to 2⁵³ each whole number is one of `f64`.
                let exact = number.as_f64().filter(|v| v.fract() == 0.0 && (0.0..9e15).contains(v));
                if let Some(exact) = exact.filter(|_| !number.is_u64()) {
                    *value = Value::from(exact as u64);
                }
            }
            Value::Array(list) => list.iter_mut().for_each(whole),
            Value::Object(object) => object.values_mut().for_each(whole),
            _ => {}
        }
    }
    let mut value: Value = serde_json::from_str(json).ok()?;
    whole(&mut value);
    serde_json::from_value(value).ok()
}

fn word(bytes: &[u8], at: usize) -> Option<u32> {
    bytes.get(at..)?.first_chunk().map(|word| u32::from_le_bytes(*word))
}

fn chunks<'a>(bytes: &'a [u8], warnings: &mut Vec<Fault>) -> Result<(&'a [u8], Option<&'a [u8]>), Fault> {
    let cut_off = || Fault::new("the file ends too early").help("the file may have been cut off");
    let version = word(bytes, 4).ok_or_else(cut_off)?;
    if version != 2 {
        return Err(Fault::new(format!("its container has version {version}; version 2 is read")));
    }
    let length = word(bytes, 8).ok_or_else(cut_off)? as usize;
    if length > bytes.len() {
        let message = format!("its header announces {length} bytes, but it has {}", bytes.len());
        return Err(Fault::new(message).help("the file may have been cut off"));
    }
    if length < bytes.len() {
        let message = format!("its header announces {length} bytes, and {} follow them", bytes.len() - length);
        warnings.push(Fault::new(message));
    }
    let bytes = &bytes[..length];
    let (mut at, mut number) = (12, 0);
    let (mut json, mut bin) = (None, None);
    while at < bytes.len() {
        let (size, kind) = word(bytes, at).zip(word(bytes, at + 4)).ok_or_else(cut_off)?;
        let chunk = bytes.get(at + 8..).and_then(|rest| rest.get(..size as usize)).ok_or_else(|| {
            Fault::new(format!("the chunk at byte {at} announces {size} bytes, more than follow it"))
                .help("the file may have been cut off")
        })?;
        match kind {
            JSON if json.is_none() => json = Some(chunk),
            BIN if json.is_some() && bin.is_none() => {
                if number != 1 {
                    warnings.push(Fault::new(format!("the binary chunk at byte {at} isn't the second chunk")));
                }
                bin = Some(chunk);
            }
            JSON => return Err(Fault::new(format!("the chunk at byte {at} is a second JSON chunk"))),
            BIN => return Err(Fault::new(format!("the binary chunk at byte {at} isn't the second chunk"))),
            // Chunks of other kinds may follow and are skipped.
            _ if json.is_some() => {}
            _ => return Err(Fault::new("its first chunk isn't JSON")),
        }
        if size % 4 != 0 {
            let message = format!("the chunk at byte {at} has {size} bytes; it must have a multiple of 4");
            warnings.push(Fault::new(message));
        }
        // A size that isn't a multiple of 4 is padded by some programs all the same.
        at += 8 + (size as usize);
        number += 1;
    }
    json.map(|json| (json, bin)).ok_or_else(|| Fault::new("it has no JSON chunk"))
}

/// Checks that the document is of a version that is read: 2.x, unless it needs a later one.
fn check_version(document: &Document) -> Result<(), Fault> {
    let asset = &document.asset;
    let (version, place) = match &asset.min_version {
        Some(version) => (version, "/asset/minVersion"),
        None => (&asset.version, "/asset/version"),
    };
    let parts: Option<(u32, u32)> =
        version.split_once('.').and_then(|(major, minor)| Some((major.parse().ok()?, minor.parse().ok()?)));
    match parts {
        Some((2, minor)) if minor == 0 || place == "/asset/version" => Ok(()),
        Some((1, _)) => {
            let help = "Blender, or gltf-pipeline of npm, converts it to glTF 2.0";
            Err(Fault::new(format!("it is glTF {version}; glTF 2.0 is read")).at(place).help(help))
        }
        Some(_) => Err(Fault::new(format!("it is glTF {version}; glTF 2.0 is read")).at(place)),
        None if version.is_empty() => Err(Fault::new("the version is missing; it should be \"2.0\"").at(place)),
        None => Err(Fault::new(format!("{version:?} is no version; it should be \"2.0\"")).at(place)),
    }
}
