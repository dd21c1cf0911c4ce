//! OpenEXR: linear `f32` channels of one part, ZIP-compressed, with texts as attributes. All texts and names are UTF-8,
//! as the format's own library has them.

use super::{Channel, Decoded, Image, PictureError, SOFTWARE, check};
use crate::image::ImageError;
use crate::image::exr::{File, floats};
use ::exr::meta::attribute::SampleType;
use ::exr::prelude as ex;
use ::exr::prelude::WritableImage;
use canaletto::scene::Transfer;
use std::io::Cursor;

/// The bytes of an EXR of all channels. The same bytes for any number of threads.
///
/// # Errors
/// [`PictureError::Unfit`] if a channel has no or too few values, or a name is used twice, is empty, longer than 255 bytes or
/// holds a NUL character.
pub fn encode_exr(image: &Image, metadata: &[(String, String)]) -> Result<Vec<u8>, PictureError> {
    encode(image, metadata, ex::Compression::ZIP16)
}

/// The same without compression, for when time is short.
///
/// # Errors
/// As [`encode_exr`].
pub fn encode_exr_quickly(image: &Image, metadata: &[(String, String)]) -> Result<Vec<u8>, PictureError> {
    encode(image, metadata, ex::Compression::Uncompressed)
}

fn encode(image: &Image, metadata: &[(String, String)], compression: ex::Compression) -> Result<Vec<u8>, PictureError> {
    check(image)?;
    let name = |text: &str| {
        if text.is_empty() || text.len() > 255 || text.contains('\0') {
            let message = format!("{text:?} can't be a name in an EXR file: it needs 1 to 255 bytes, none of them 0");
            return Err(PictureError::Unfit(message));
        }
        Ok(to_utf8(text))
    };
    let mut channels = Vec::new();
    for channel in &image.channels {
        if channels.iter().any(|c: &ex::AnyChannel<_>| c.name == to_utf8(&channel.name)) {
            return Err(PictureError::Unfit(format!("channel {} is there twice", channel.name)));
        }
        channels.push(ex::AnyChannel::new(name(&channel.name)?, ex::FlatSamples::F32(channel.data.clone())));
    }
    let mut attributes = ex::LayerAttributes { software_name: Some(SOFTWARE.into()), ..Default::default() };
    for (key, value) in metadata {
        attributes.other.insert(name(key)?, ex::AttributeValue::Text(to_utf8(value)));
    }
    let encoding = ex::Encoding { compression, blocks: ex::Blocks::ScanLines, line_order: ex::LineOrder::Increasing };
    let size = (image.width as usize, image.height as usize);
    let layer = ex::Layer::new(size, attributes, encoding, ex::AnyChannels::sort(channels.into_iter().collect()));
    let mut out = Cursor::new(Vec::new());
    ex::Image::from_layer(layer).write().to_buffered(&mut out).map_err(|e| PictureError::Unfit(e.to_string()))?;
    let mut bytes = out.into_inner();
    sort_attributes(&mut bytes);
    Ok(bytes)
}

/// A text whose bytes are UTF-8: the crate has a byte for each letter.
fn to_utf8(text: &str) -> ex::Text {
    ex::Text::new_or_panic(text.bytes().map(char::from).collect::<String>())
}

/// The text of such bytes; what isn't UTF-8 is Latin-1, as in files of older programs.
fn from_utf8(text: &ex::Text) -> String {
    String::from_utf8(text.bytes().to_vec()).unwrap_or_else(|_| text.to_string())
}

/// Brings the header's attributes into the order of their names; the crate's order is a hash map's, another one in
/// every run.
fn sort_attributes(bytes: &mut [u8]) {
    const START: usize = 8; // the magic number and the version
    let mut attributes: Vec<Vec<u8>> = Vec::new();
    let mut at = START;
    while bytes.get(at).is_some_and(|byte| *byte != 0) {
        // name 0 type 0 size value
        let Some(end) = text_end(bytes, at).and_then(|end| text_end(bytes, end)) else { return };
        let Some(size) = bytes.get(end..end + 4) else { return };
        let end = end + 4 + u32::from_le_bytes([size[0], size[1], size[2], size[3]]) as usize;
        let Some(attribute) = bytes.get(at..end) else { return };
        attributes.push(attribute.to_vec());
        at = end;
    }
    attributes.sort();
    bytes[START..at].copy_from_slice(&attributes.concat());
}

fn text_end(bytes: &[u8], at: usize) -> Option<usize> {
    bytes[at..].iter().position(|b| *b == 0).map(|length| at + length + 1)
}

/// Reads an EXR. Channels of several parts have their part's name before a point.
///
/// # Errors
/// [`PictureError`] says why not.
pub fn decode_exr(bytes: &[u8]) -> Result<Decoded, PictureError> {
    let damaged = |reason: &str| ImageError::Damaged { format: "OpenEXR", reason: reason.into() };
    let file = File::open(bytes)?;
    let many = file.parts().len() > 1;
    let size = file.parts().first().map(|part| part.layer_size).ok_or_else(|| damaged("it has no picture"))?;
    if file.parts().iter().any(|part| part.layer_size != size) {
        return Err(damaged("its parts have different sizes").into());
    }
    let (width, height) = (size.x(), size.y());
    let channels: usize = file.parts().iter().map(|part| part.channels.list.len()).sum();
    let memory = 4 * (width * height) as u64 * channels as u64;
    for part in 0..file.parts().len() {
        file.check(part, memory)?;
    }
    let mut image = Image { width: width as u32, height: height as u32, channels: Vec::new() };
    let mut metadata = Vec::new();
    let mut bits = 16;
    for (number, header) in file.parts().iter().enumerate() {
        let attributes = &header.own_attributes;
        let part = attributes.layer_name.as_ref().map_or_else(|| number.to_string(), from_utf8);
        for (key, value) in &attributes.other {
            if let ex::AttributeValue::Text(text) = value {
                metadata.push((from_utf8(key), from_utf8(text)));
            }
        }
        metadata.extend(attributes.software_name.as_ref().map(|name| ("Software".to_owned(), from_utf8(name))));
        let list = &header.channels.list;
        let first = image.channels.len();
        for channel in list {
            let name = from_utf8(&channel.name);
            let name = if many { format!("{part}.{name}") } else { name };
            bits = bits.max(if channel.sample_type == SampleType::F16 { 16 } else { 32 });
            image.channels.push(Channel { name, data: zeros(width * height)? });
        }
        let all: Vec<usize> = (0..list.len()).collect();
        file.rows(number, &all, |channel, y, x, row| {
            let to = &mut image.channels[first + channel].data[y * width + x..];
            to.iter_mut().zip(floats(list[channel].sample_type, row)).for_each(|(v, number)| *v = number);
        })?;
    }
    metadata.sort();
    check(&image)?;
    Ok(Decoded { image, bits, transfer: Some(Transfer::None), metadata })
}

/// Room for numbers, if there is memory.
fn zeros(count: usize) -> Result<Vec<f32>, ImageError> {
    let mut data = Vec::new();
    data.try_reserve_exact(count).map_err(|_| ImageError::NoMemory(4 * count as u64))?;
    data.resize(count, 0.0);
    Ok(data)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture() -> Image {
        let value = |i: usize, c: usize| ((i * 7 + c * 13) % 101) as f32 * 0.37 - 3.0;
        let names = ["R", "G", "B", "depth.Z", "normal.X", "normal.Y", "normal.Z", "objectId.id"];
        let channels = names.iter().enumerate();
        let data = |c: usize| (0..50 * 40).map(|i| value(i, c)).collect();
        Image {
            width: 50,
            height: 40,
            channels: channels.map(|(c, name)| Channel { name: (*name).into(), data: data(c) }).collect(),
        }
    }

    fn texts() -> Vec<(String, String)> {
        (0..20).map(|i| (format!("setting{i:02}"), format!("value {i}"))).collect()
    }

    #[test]
    fn every_bit_comes_back() {
        let mut image = picture();
        image.channels[3].data[5] = f32::INFINITY;
        image.channels[3].data[6] = 1e-40;
        let read = decode_exr(&encode_exr(&image, &texts()).unwrap()).unwrap();
        assert_eq!((read.bits, read.transfer), (32, Some(Transfer::None)));
        for channel in &image.channels {
            assert_eq!(read.image.channel(&channel.name).unwrap(), channel.data, "{}", channel.name);
        }
        assert_eq!(decode_exr(&encode_exr_quickly(&image, &texts()).unwrap()).unwrap(), read);
        assert!(texts().iter().all(|text| read.metadata.contains(text)));
        assert!(read.metadata.iter().any(|(k, v)| k == "Software" && v.starts_with("Canaletto")));
    }

    #[test]
    fn texts_are_utf8() {
        let mut image = picture();
        image.channels[1].name = "水.X".into();
        let texts: Vec<_> =
            ["Grün", "水 😀", "a\nb\u{7f}", ""].map(|text| (format!("key {text}"), text.to_owned())).into();
        let bytes = encode_exr(&image, &texts).unwrap();
        assert!(bytes.windows(5).any(|part| part == "Grün".as_bytes()));
        let read = decode_exr(&bytes).unwrap();
        assert!(texts.iter().all(|text| read.metadata.contains(text)), "{:?}", read.metadata);
        assert!(read.image.channel("水.X").is_some());
        // Files of older programs have Latin-1.
        let mut latin = bytes.clone();
        let at = latin.windows(5).rposition(|part| part == "Grün".as_bytes()).unwrap();
        latin[at..at + 5].copy_from_slice(b"Gr\xfcn ");
        let read = decode_exr(&latin).unwrap();
        assert!(read.metadata.iter().any(|(_, value)| value == "Grün "), "{:?}", read.metadata);
    }

    #[test]
    fn bytes_are_the_same_for_any_number_of_threads() {
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| encode_exr(&picture(), &texts()).unwrap())
        };
        assert!(with(1) == with(4) && with(4) == with(4));
    }

    #[test]
    fn what_is_wrong_is_told() {
        let mut image = picture();
        image.channels[1].name = "R".into();
        assert_eq!(encode_exr(&image, &[]).unwrap_err().to_string(), "channel R is there twice");
        for name in ["", "a\0b", &"水".repeat(86)] {
            image.channels[1].name = name.into();
            assert!(encode_exr(&image, &[]).unwrap_err().to_string().contains("can't be a name"));
        }
        assert!(decode_exr(b"v/1\x01").is_err());
    }

    #[test]
    fn damage_never_panics() {
        let channels = picture().channels.into_iter().take(2);
        let small = channels.map(|c| Channel { name: c.name, data: c.data[..36].to_vec() }).collect();
        let whole = encode_exr(&Image { width: 6, height: 6, channels: small }, &texts()[..1]).unwrap();
        for at in 0..whole.len() {
            for flip in [1, 0x80, 0xff] {
                let mut bytes = whole.clone();
                bytes[at] ^= flip;
                let _ = decode_exr(&bytes);
            }
            let _ = decode_exr(&whole[..at]);
        }
    }
}
