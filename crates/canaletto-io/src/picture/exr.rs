//! OpenEXR: linear `f32` channels of one part, ZIP-compressed, with texts as attributes. All texts and names are UTF-8,
//! as in the OpenEXR library.

use super::channels::{fill_channel, picture_channels};
use super::exr_part::write_exr_part;
use super::format::{Capabilities, EncodeSettings, Encoder, FormatInfo, GoesOn};
use super::pixel_hash::{PIXEL_HASH, PixelHash};
use super::{Channel, Compression, Decoded, Image, PictureError, SOFTWARE, Window, check};
use crate::codec::is_exr;
use crate::image::ImageError;
use crate::image::exr::{File, floats, size};
use ::exr::meta::attribute::SampleType;
use ::exr::meta::header::Header;
use ::exr::prelude as ex;
use ::exr::prelude::WritableImage;
use canaletto::scene::Transfer;
use std::io::{self, Cursor, Seek, SeekFrom, Write};
use std::ops::Range;

/// OpenEXR in the table of picture formats.
pub(super) const FORMAT: FormatInfo = FormatInfo {
    names: ["OpenEXR", "EXR"],
    extension: "exr",
    recognises: is_exr,
    decode: decode_exr,
    size: Some(size),
    encoder: Some(Encoder {
        capabilities: Capabilities {
            summary: "Linear light in 32-bit floats, with any number of layers (OpenEXR)",
            bits: &[32, 16],
            linear: true,
            alpha: true,
            layers: true,
            texts: true,
            compression: false,
            lossy: false,
            whole_ids: true,
        },
        encode: |rendered, settings, texts, goes_on| {
            let image = Image::from_picture(rendered.picture);
            let bytes = encode_exr_while(image, ExrOptions::from(settings), texts, goes_on)?;
            Ok(bytes.unwrap_or_default())
        },
        encode_image: |image, _, settings, texts| encode_exr(image, ExrOptions::from(settings), texts),
        stored_bits: |settings, channels| {
            let options = ExrOptions::from(settings);
            bits(channels.iter().map(|name| (name.as_str(), kind(name, options) == Kind::Half)))
        },
        write_rows: Some(|rendered, settings, texts, out, goes_on| {
            let picture = rendered.picture;
            let names: Vec<String> = picture_channels(picture).collect();
            let fill = |channel, range, values: &mut [f32]| fill_channel(picture, channel, range, values);
            let size = [picture.width, picture.height];
            write_exr_part(size, &names, &fill, ExrOptions::from(settings), texts, out, goes_on).map(|_| ())
        }),
    }),
    off: None,
};

/// The number of bits of colours, or of the widest channel where there are none. Channels are named, and are half
/// floats or not.
pub(super) fn bits<'a>(channels: impl Iterator<Item = (&'a str, bool)> + Clone) -> u8 {
    let is_color = |channel: &(&str, bool)| ["R", "G", "B", "Y"].contains(&channel.0);
    let has_colors = channels.clone().any(|channel| is_color(&channel));
    let mut counted = channels.filter(|channel| !has_colors || is_color(channel));
    if counted.all(|(_, is_half)| is_half) { 16 } else { 32 }
}

impl From<&EncodeSettings> for ExrOptions {
    fn from(settings: &EncodeSettings) -> ExrOptions {
        ExrOptions {
            uncompressed: settings.compression == Compression::Fast,
            half: settings.bits == Some(16),
            uint_ids: settings.whole_ids,
            window: settings.window,
        }
    }
}

/// Options of writing an EXR.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct ExrOptions {
    /// Whether to write without compression.
    pub(super) uncompressed: bool,
    /// Whether to write colours (channels `R`, `G`, `B`, `A`, `Y`, also of layers) as 16-bit floats. Other channels
    /// stay `f32`.
    pub(super) half: bool,
    /// Whether to write channels of layers whose name ends in `_id` as 32-bit unsigned integers (UINT) instead of
    /// floats. Channels with [`Channel::ids`] are always UINT.
    pub(super) uint_ids: bool,
    /// The position in a larger picture; `None` if the picture is the whole.
    pub(super) window: Option<Window>,
}

/// The bytes of an EXR with all channels. They don't depend on the number of threads.
///
/// # Errors
/// [`PictureError::Unfit`] if a channel has no or too few values, or if a name is used twice, is empty, is longer than
/// 255 bytes or contains a NUL character.
pub(super) fn encode_exr(
    image: &Image,
    options: ExrOptions,
    metadata: &[(String, String)],
) -> Result<Vec<u8>, PictureError> {
    Ok(encode_exr_while(image.clone(), options, metadata, &|| true)?.unwrap_or_default())
}

/// As [`encode_exr`], but ends soon without bytes when `goes_on` returns false.
fn encode_exr_while(
    image: Image,
    options: ExrOptions,
    metadata: &[(String, String)],
    goes_on: GoesOn<'_>,
) -> Result<Option<Vec<u8>>, PictureError> {
    check(&image)?;
    let name = |text: &str| {
        if text.is_empty() || text.len() > 255 || text.contains('\0') {
            let message = format!("{text:?} can't be a name in an EXR file: it needs 1 to 255 bytes, none of them 0");
            return Err(PictureError::Unfit(message));
        }
        Ok(to_utf8(text))
    };
    let mut attributes = ex::LayerAttributes { software_name: Some(SOFTWARE.into()), ..Default::default() };
    let stored = |channel: &Channel, kind: Kind, pixel: usize| match channel.ids.get(pixel) {
        Some(id) => *id as f32,
        None => kind.stored(channel.data[pixel]),
    };
    let kind_of = |channel: &Channel| kind(&channel.name, options);
    let pixels = (PIXEL_HASH.to_owned(), hash(&image, kind_of, stored).text());
    for (key, value) in metadata.iter().filter(|(key, _)| key != PIXEL_HASH).chain([&pixels]) {
        attributes.other.insert(name(key)?, ex::AttributeValue::Text(to_utf8(value)));
    }
    let compression = if options.uncompressed { ex::Compression::Uncompressed } else { ex::Compression::ZIP16 };
    let encoding = ex::Encoding { compression, blocks: ex::Blocks::ScanLines, line_order: ex::LineOrder::Increasing };
    let window = options.window.unwrap_or(Window::whole(image.width, image.height));
    let [width, height] = window.whole.map(|side| side as usize);
    attributes.layer_position = ex::Vec2(window.at[0], window.at[1]);
    let whole = ex::ImageAttributes::new(ex::IntegerBounds::new((0, 0), (width, height)));
    let size = (image.width as usize, image.height as usize);
    let mut channels = Vec::new();
    for channel in image.channels {
        if channels.iter().any(|c: &ex::AnyChannel<_>| c.name == to_utf8(&channel.name)) {
            return Err(PictureError::Unfit(format!("channel {} is there twice", channel.name)));
        }
        channels.push(ex::AnyChannel::new(name(&channel.name)?, samples(channel, options)));
    }
    let layer = ex::Layer::new(size, attributes, encoding, ex::AnyChannels::sort(channels.into_iter().collect()));
    let mut out = Stopping { bytes: Cursor::new(Vec::new()), goes_on };
    if let Err(error) = ex::Image::new(whole, layer).write().to_buffered(&mut out) {
        return if goes_on() { Err(PictureError::Unfit(error.to_string())) } else { Ok(None) };
    }
    let mut bytes = out.bytes.into_inner();
    sort_attributes(&mut bytes);
    Ok(Some(bytes))
}

/// Bytes in memory that can't be written any more when `goes_on` returns false.
struct Stopping<'a> {
    bytes: Cursor<Vec<u8>>,
    goes_on: GoesOn<'a>,
}

impl Write for Stopping<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if (self.goes_on)() { self.bytes.write(bytes) } else { Err(io::Error::other("stopped")) }
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Seek for Stopping<'_> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.bytes.seek(to)
    }
}

/// The samples of a channel in the type that the options select.
fn samples(channel: Channel, options: ExrOptions) -> ex::FlatSamples {
    match kind(&channel.name, options) {
        Kind::Half => ex::FlatSamples::F16(channel.data.iter().map(|v| Kind::half(*v)).collect()),
        _ if !channel.ids.is_empty() => ex::FlatSamples::U32(channel.ids),
        Kind::Uint => ex::FlatSamples::U32(channel.data.iter().map(|v| *v as u32).collect()),
        Kind::Float => ex::FlatSamples::F32(channel.data),
    }
}

/// The sample types.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Half,
    Uint,
    Float,
}

/// The type that the options select for a channel of this name.
pub(super) fn kind(name: &str, options: ExrOptions) -> Kind {
    let (layer, last) = name.rsplit_once('.').unwrap_or(("", name));
    // `Y` without a layer is grey; in a layer it is the second of three coordinates.
    if options.half && (COLORS.contains(&last) || name == "Y") {
        Kind::Half
    } else if options.uint_ids && layer.ends_with("_id") {
        Kind::Uint
    } else {
        Kind::Float
    }
}

/// The channels of colours and coverage.
const COLORS: [&str; 4] = ["R", "G", "B", "A"];

/// Encodes a text as UTF-8: the crate stores one byte per character.
fn to_utf8(text: &str) -> ex::Text {
    ex::Text::new_or_panic(text.bytes().map(char::from).collect::<String>())
}

/// Decodes a text as UTF-8, or else as Latin-1, as in files of older programs.
pub(super) fn from_utf8(text: &ex::Text) -> String {
    String::from_utf8(text.bytes().to_vec()).unwrap_or_else(|_| text.to_string())
}

/// Sorts the header's attributes by name. The crate writes them in the order of a hash map, which differs from run to
/// run.
fn sort_attributes(bytes: &mut [u8]) {
    let ranges = attributes(bytes);
    let (Some(first), Some(last)) = (ranges.first(), ranges.last()) else { return };
    let all = first.start..last.end;
    let mut attributes: Vec<Vec<u8>> = ranges.iter().map(|range| bytes[range.clone()].to_vec()).collect();
    attributes.sort();
    bytes[all].copy_from_slice(&attributes.concat());
}

/// The byte ranges of the attributes in a file's first header.
pub(super) fn attributes(bytes: &[u8]) -> Vec<Range<usize>> {
    let mut ranges = Vec::new();
    let mut at = 8; // after the magic number and the version
    while bytes.get(at).is_some_and(|byte| *byte != 0) {
        // Layout: name, 0, type, 0, size, value.
        let Some(end) = text_end(bytes, at).and_then(|end| text_end(bytes, end)) else { break };
        let Some(size) = bytes.get(end..end + 4) else { break };
        let end = end + 4 + u32::from_le_bytes([size[0], size[1], size[2], size[3]]) as usize;
        if end > bytes.len() {
            break;
        }
        ranges.push(at..end);
        at = end;
    }
    ranges
}

fn text_end(bytes: &[u8], at: usize) -> Option<usize> {
    bytes[at..].iter().position(|b| *b == 0).map(|length| at + length + 1)
}

/// Reads an EXR. Channels of further parts get the name of their part as a prefix before a point.
///
/// # Errors
/// [`PictureError`] if the file can't be read.
pub(super) fn decode_exr(bytes: &[u8]) -> Result<Decoded, PictureError> {
    let damaged = |reason: &str| ImageError::Damaged { format: "OpenEXR", reason: reason.into() };
    let file = File::open(bytes)?;
    let many = file.parts().len() > 1;
    let main = file.parts().iter().position(|part| part.channels.list.iter().any(|c| is_color(&c.name))).unwrap_or(0);
    let first = file.parts().get(main).ok_or_else(|| damaged("it has no picture"))?;
    let (size, position) = (first.layer_size, first.own_attributes.layer_position);
    let window = window_of(first);
    // Parts of another size, such as proxies, aren't aligned with the picture. They are only listed by name.
    let fits = |part: &Header| part.layer_size == size && part.own_attributes.layer_position == position;
    let (width, height) = (size.x(), size.y());
    let channels: usize = file.parts().iter().filter(|part| fits(part)).map(|part| part.channels.list.len()).sum();
    let memory = 4 * (width * height) as u64 * channels as u64;
    for (number, part) in file.parts().iter().enumerate() {
        if fits(part) {
            file.check(number, memory)?;
        }
    }
    let mut image = Image { width: width as u32, height: height as u32, channels: Vec::new() };
    let mut left_out = Vec::new();
    let mut metadata = Vec::new();
    let mut are_half = Vec::new();
    for (number, header) in file.parts().iter().enumerate() {
        let attributes = &header.own_attributes;
        let part = attributes.layer_name.as_ref().map_or_else(|| number.to_string(), from_utf8);
        if !fits(header) {
            left_out.push(part);
            continue;
        }
        metadata.extend(texts_of(header));
        let list = &header.channels.list;
        let first = image.channels.len();
        for channel in list {
            let name = from_utf8(&channel.name);
            let prefixed = name.strip_prefix(&part).is_some_and(|rest| rest.starts_with('.'));
            let name = if many && number != main && !prefixed { format!("{part}.{name}") } else { name };
            are_half.push(channel.sample_type == SampleType::F16);
            image.channels.push(Channel::new(name, zeros(width * height)?));
        }
        let all: Vec<usize> = (0..list.len()).collect();
        let mut rounded = Vec::new();
        file.rows(number, &all, |channel, y, x, row| {
            let to = &mut image.channels[first + channel].data[y * width + x..];
            to.iter_mut().zip(floats(list[channel].sample_type, row)).for_each(|(v, number)| *v = number);
            let rounds = |bytes: &[u8; 4]| u32::from_ne_bytes(*bytes) >> f32::MANTISSA_DIGITS > 0;
            if list[channel].sample_type == SampleType::U32
                && row.as_chunks().0.iter().any(rounds)
                && !rounded.contains(&channel)
            {
                rounded.push(channel);
            }
        })?;
        for channel in &rounded {
            image.channels[first + channel].ids = zeros(width * height)?;
        }
        if !rounded.is_empty() {
            file.rows(number, &rounded, |place, y, x, row| {
                let to = &mut image.channels[first + rounded[place]].ids[y * width + x..];
                to.iter_mut().zip(row.as_chunks().0).for_each(|(v, bytes)| *v = u32::from_ne_bytes(*bytes));
            })?;
        }
    }
    metadata.sort();
    check(&image)?;
    let bits = bits(image.channels.iter().map(|channel| channel.name.as_str()).zip(are_half));
    let told = metadata.iter().position(|(key, _)| key == PIXEL_HASH).map(|place| metadata.remove(place).1);
    let is_changed =
        told.is_some_and(|told| !many && told != hash(&image, |_| Kind::Float, |channel, _, v| channel.data[v]).text());
    Ok(Decoded {
        image,
        bits,
        transfer: Some(Transfer::None),
        metadata,
        window,
        left_out,
        is_changed,
        display_referred: false,
    })
}

/// The place of a part in the whole picture.
pub(super) fn window_of(header: &Header) -> Window {
    let (position, display) = (header.own_attributes.layer_position, header.shared_attributes.display_window);
    Window {
        at: [position.x() - display.position.x(), position.y() - display.position.y()],
        whole: [display.size.x() as u32, display.size.y() as u32],
    }
}

/// The texts of a part, in no order.
pub(super) fn texts_of(header: &Header) -> Vec<(String, String)> {
    let attributes = &header.own_attributes;
    let mut texts = Vec::new();
    for (key, value) in &attributes.other {
        if let ex::AttributeValue::Text(text) = value {
            texts.push((from_utf8(key), from_utf8(text)));
        }
    }
    texts.extend(attributes.software_name.as_ref().map(|name| ("Software".to_owned(), from_utf8(name))));
    texts
}

/// The hash of an image whose channels have these types, and these values at a pixel.
fn hash(image: &Image, kind: impl Fn(&Channel) -> Kind, value: impl Fn(&Channel, Kind, usize) -> f32) -> PixelHash {
    let (mut hash, width) = (PixelHash::default(), image.width as usize);
    for channel in &image.channels {
        let kind = kind(channel);
        for row in 0..image.height as usize {
            let pixels = row * width..(row + 1) * width;
            hash.add_row(&channel.name, row, pixels.map(|pixel| value(channel, kind, pixel)));
        }
    }
    hash
}

/// Whether a channel is red, green, blue or grey of the picture itself.
fn is_color(channel: &ex::Text) -> bool {
    ["R", "G", "B", "Y"].iter().any(|name| channel.eq(name))
}

/// A vector of `count` zeros, if memory can be allocated.
fn zeros<T: Clone + Default>(count: usize) -> Result<Vec<T>, ImageError> {
    let mut data = Vec::new();
    data.try_reserve_exact(count).map_err(|_| ImageError::NoMemory(4 * count as u64))?;
    data.resize(count, T::default());
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
        Image { width: 50, height: 40, channels: channels.map(|(c, name)| Channel::new(*name, data(c))).collect() }
    }

    fn texts() -> Vec<(String, String)> {
        (0..20).map(|i| (format!("setting{i:02}"), format!("value {i}"))).collect()
    }

    #[test]
    fn every_bit_comes_back() {
        let mut image = picture();
        image.channels[3].data[5] = f32::INFINITY;
        image.channels[3].data[6] = 1e-40;
        let read = decode_exr(&encode_exr(&image, ExrOptions::default(), &texts()).unwrap()).unwrap();
        assert_eq!((read.bits, read.transfer), (32, Some(Transfer::None)));
        for channel in &image.channels {
            assert_eq!(read.image.channel(&channel.name).unwrap(), channel.data, "{}", channel.name);
        }
        let uncompressed = ExrOptions { uncompressed: true, ..ExrOptions::default() };
        assert_eq!(decode_exr(&encode_exr(&image, uncompressed, &texts()).unwrap()).unwrap(), read);
        assert!(texts().iter().all(|text| read.metadata.contains(text)));
        assert!(read.metadata.iter().any(|(k, v)| k == "Software" && v.starts_with("Canaletto")));
    }

    #[test]
    fn texts_are_utf8() {
        let mut image = picture();
        image.channels[1].name = "水.X".into();
        let texts: Vec<_> =
            ["Grün", "水 😀", "a\nb\u{7f}", ""].map(|text| (format!("key {text}"), text.to_owned())).into();
        let bytes = encode_exr(&image, ExrOptions::default(), &texts).unwrap();
        assert!(bytes.windows(5).any(|part| part == "Grün".as_bytes()));
        let read = decode_exr(&bytes).unwrap();
        assert!(texts.iter().all(|text| read.metadata.contains(text)), "{:?}", read.metadata);
        assert!(read.image.channel("水.X").is_some());
        // Files of older programs contain Latin-1.
        let mut latin = bytes.clone();
        let at = latin.windows(5).rposition(|part| part == "Grün".as_bytes()).unwrap();
        latin[at..at + 5].copy_from_slice(b"Gr\xfcn ");
        let read = decode_exr(&latin).unwrap();
        assert!(read.metadata.iter().any(|(_, value)| value == "Grün "), "{:?}", read.metadata);
    }

    #[test]
    fn a_part_keeps_its_place_in_the_whole() {
        let window = Window { at: [10, 5], whole: [640, 480] };
        let options = ExrOptions { window: Some(window), ..ExrOptions::default() };
        let bytes = encode_exr(&picture(), options, &[]).unwrap();
        // The layout is xMin yMin xMax yMax; the last pixel is included.
        let box_of = |name: &str| {
            let at = bytes.windows(name.len()).position(|part| part == name.as_bytes()).unwrap() + name.len() + 10;
            [0, 4, 8, 12].map(|i| i32::from_le_bytes(bytes[at + i..at + i + 4].try_into().unwrap()))
        };
        assert_eq!((box_of("dataWindow\0"), box_of("displayWindow\0")), ([10, 5, 59, 44], [0, 0, 639, 479]));
        assert_eq!(decode_exr(&bytes).unwrap().window, window);
        let whole = decode_exr(&encode_exr(&picture(), ExrOptions::default(), &[]).unwrap()).unwrap();
        assert_eq!(whole.window, Window::whole(50, 40));
    }

    #[test]
    fn parts_are_read_with_their_names_before_the_channels() {
        let layer = |name: &str, channels: &[(&str, f32)]| {
            let channel = |(name, v): &(&str, f32)| ex::AnyChannel::new(*name, ex::FlatSamples::F32(vec![*v; 12]));
            let list = ex::AnyChannels::sort(channels.iter().map(channel).collect());
            ex::Layer::new((4, 3), ex::LayerAttributes::named(name), ex::Encoding::UNCOMPRESSED, list)
        };
        let layers: ex::Layers<_> = [
            layer("depth", &[("Z", 7.0)]),
            layer("rgba", &[("R", 0.1), ("G", 0.2), ("B", 0.3)]),
            layer("View.Normal", &[("View.Normal.X", 1.0), ("View.Normal.Y", 2.0)]),
        ]
        .into_iter()
        .collect();
        let mut out = Cursor::new(Vec::new());
        let whole = ex::ImageAttributes::new(ex::IntegerBounds::from_dimensions((4, 3)));
        ex::Image::from_layers(whole, layers).write().to_buffered(&mut out).unwrap();
        let read = decode_exr(out.get_ref()).unwrap();
        let value = |name: &str| read.image.channel(name).map(|data| data[0]);
        assert_eq!(["depth.Z", "R", "G", "B"].map(value), [Some(7.0), Some(0.1), Some(0.2), Some(0.3)]);
        assert_eq!(["View.Normal.X", "View.Normal.Y"].map(value), [Some(1.0), Some(2.0)], "its own prefix is enough");
        assert_eq!((read.image.channels.len(), read.left_out.len()), (6, 0));
    }

    #[test]
    fn colours_may_be_half_floats_and_ids_whole_numbers() {
        let mut image = picture();
        image.channels[7].name = "object_id.X".into();
        image.channels[7].data = (0..50 * 40).map(|i| i as f32).collect();
        image.channels[0].data[3] = 1e9;
        let options = ExrOptions { half: true, uint_ids: true, ..ExrOptions::default() };
        let bytes = encode_exr(&image, options, &[]).unwrap();
        let read = decode_exr(&bytes).unwrap().image;
        let half = |v: f32| ex::f16::from_f32(v).to_f32();
        assert_eq!(read.channel("G").unwrap()[7], half(image.channels[1].data[7]));
        assert_eq!(read.channel("R").unwrap()[3], 65_504.0);
        assert_eq!(read.channel("depth.Z").unwrap(), image.channels[3].data);
        assert_eq!(read.channel("object_id.X").unwrap(), image.channels[7].data);
        // The pixel types in the channel list: 0 UINT, 1 HALF, 2 FLOAT.
        let kind = |name: &str| {
            bytes[bytes.windows(name.len()).position(|part| part == name.as_bytes()).unwrap() + name.len()]
        };
        assert_eq!(["object_id.X\0", "depth.Z\0", "normal.X\0", "normal.Y\0"].map(kind), [0, 2, 2, 2]);
    }

    #[test]
    fn numbers_that_f32_rounds_stay_whole() {
        let mut image = picture();
        let ids: Vec<u32> = (0..50 * 40).map(|i| u32::MAX - 3 * i).collect();
        image.channels[7].data = ids.iter().map(|id| *id as f32).collect();
        image.channels[7].ids = ids;
        for options in [ExrOptions::default(), ExrOptions { uint_ids: true, uncompressed: true, ..Default::default() }]
        {
            let read = decode_exr(&encode_exr(&image, options, &[]).unwrap()).unwrap().image;
            let named = |image: &Image| image.channels.iter().find(|c| c.name == "objectId.id").cloned();
            assert_eq!(named(&read), named(&image));
            assert!(read.channels.iter().all(|c| c.ids.is_empty() || c.name == "objectId.id"));
        }
    }

    #[test]
    fn bytes_are_the_same_for_any_number_of_threads() {
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| encode_exr(&picture(), ExrOptions::default(), &texts()).unwrap())
        };
        assert!(with(1) == with(4) && with(4) == with(4));
    }

    #[test]
    fn what_is_wrong_is_told() {
        let mut image = picture();
        image.channels[1].name = "R".into();
        assert_eq!(encode_exr(&image, ExrOptions::default(), &[]).unwrap_err().to_string(), "channel R is there twice");
        for name in ["", "a\0b", &"水".repeat(86)] {
            image.channels[1].name = name.into();
            assert!(
                encode_exr(&image, ExrOptions::default(), &[]).unwrap_err().to_string().contains("can't be a name")
            );
        }
        assert!(decode_exr(b"v/1\x01").is_err());
    }

    #[test]
    fn damage_never_panics() {
        let channels = picture().channels.into_iter().take(2);
        let small = channels.map(|c| Channel::new(c.name, c.data[..36].to_vec())).collect();
        let whole =
            encode_exr(&Image { width: 6, height: 6, channels: small }, ExrOptions::default(), &texts()[..1]).unwrap();
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
