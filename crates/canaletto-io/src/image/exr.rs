//! OpenEXR: the first part with colour or grey, in single or half precision as it is.

use super::{ImageError, judge, room};
use ::exr::block::samples::FromNativeSample;
use ::exr::meta::MetaData;
use ::exr::meta::attribute::SampleType;
use ::exr::meta::header::Header;
use ::exr::prelude as ex;
use ::exr::prelude::{ReadChannels, ReadLayers, ReadSpecificChannel, f16};
use canaletto::texture::{ColorSpace, Image, Samples};
use std::cell::RefCell;
use std::io::Cursor;

const FORMAT: &str = "OpenEXR";
/// Up to this size nobody asks how it was packed.
const SMALL: u64 = 1 << 26;

/// Room for the texels, asked for before the decoder starts; it then fills what it is handed.
fn prepared<N: Clone + Default>(count: usize) -> Result<RefCell<Vec<N>>, ImageError> {
    let mut data: Vec<N> = room(count)?;
    data.resize(count, N::default());
    Ok(RefCell::new(data))
}

/// Where texels are put as they are unpacked: the width, and the numbers.
type Target<N> = (usize, Vec<N>);

fn put<N: Copy, const K: usize>(target: &mut Target<N>, at: ex::Vec2<usize>, channels: usize, texel: [N; K]) {
    let start = (at.y() * target.0 + at.x()) * channels;
    if let Some(place) = target.1.get_mut(start..start + channels) {
        place.copy_from_slice(&texel[..channels]);
    }
}

/// Reads colours; the reader's types have no name that a function could take.
macro_rules! color {
    ($bytes:expr, $channels:expr, $count:expr, $number:ty, $sample:ty, $keep:expr) => {{
        let data = prepared::<$number>($count)?;
        let one = <$sample as FromNativeSample>::from_f32(1.0);
        let reader = ex::read().no_deep_data().largest_resolution_level().specific_channels();
        let reader = reader.required("R").required("G").required("B").optional("A", one).collect_pixels(
            move |size: ex::Vec2<usize>, _: &_| (size.x(), data.take()),
            move |target: &mut Target<$number>, at, (r, g, b, a): ($sample, $sample, $sample, $sample)| {
                put(target, at, $channels, [r, g, b, a].map($keep));
            },
        );
        let read = reader.first_valid_layer().all_attributes().from_buffered($bytes).map_err(damaged);
        read.map(|image| image.layer_data.channel_data.pixels.1)
    }};
}

/// Reads greys.
macro_rules! gray {
    ($bytes:expr, $channels:expr, $count:expr, $number:ty, $sample:ty, $keep:expr) => {{
        let data = prepared::<$number>($count)?;
        let one = <$sample as FromNativeSample>::from_f32(1.0);
        let reader = ex::read().no_deep_data().largest_resolution_level().specific_channels();
        let reader = reader.required("Y").optional("A", one).collect_pixels(
            move |size: ex::Vec2<usize>, _: &_| (size.x(), data.take()),
            move |target: &mut Target<$number>, at, (y, a): ($sample, $sample)| {
                put(target, at, $channels, [y, a].map($keep));
            },
        );
        let read = reader.first_valid_layer().all_attributes().from_buffered($bytes).map_err(damaged);
        read.map(|image| image.layer_data.channel_data.pixels.1)
    }};
}

/// Reads an EXR: the channels R, G, B or Y, and A. The image is the part's data window.
pub(super) fn read(bytes: &[u8]) -> Result<Image, ImageError> {
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(damaged)?;
    for header in &meta.headers {
        // All parts are gone through, so all are judged. Its packing makes at most about 1000 bytes of one; Huffman's of
        // PIZ could more, of large empty pictures.
        let (width, height) = (header.layer_size.x() as u64, header.layer_size.y() as u64);
        let texel: u64 = header.channels.list.iter().map(|c| c.sample_type.bytes_per_sample() as u64).sum();
        let explained = (bytes.len() as u64 * 1032).max(SMALL) / texel.max(1);
        judge(FORMAT, width, height, explained, bytes.len())?;
    }
    let has = |header: &Header, name: &str| header.channels.list.iter().any(|c| c.name == *name);
    let color = |header: &Header| ["R", "G", "B"].iter().all(|name| has(header, name));
    let Some(header) = meta.headers.iter().find(|header| color(header) || has(header, "Y")) else {
        let names = meta.headers.iter().flat_map(|header| header.channels.list.iter().map(|c| c.name.to_string()));
        let names: Vec<String> = names.take(20).collect();
        let what = format!("the channels {} instead of R G B or Y", names.join(", "));
        return Err(ImageError::Unsupported { format: FORMAT, what });
    };
    let gray = !color(header);
    if gray && (has(header, "RY") || has(header, "BY")) {
        let what = "colour as luminance and chroma (Y RY BY)".into();
        return Err(ImageError::Unsupported { format: FORMAT, what });
    }
    let alpha = has(header, "A");
    let channels = if gray { 1 } else { 3 } + usize::from(alpha);
    let wanted: &[&str] = if gray { &["Y", "A"] } else { &["R", "G", "B", "A"] };
    let mut used = header.channels.list.iter().filter(|c| wanted.iter().any(|name| c.name == **name));
    let half = used.all(|c| c.sample_type == SampleType::F16);
    let (width, height) = (header.layer_size.x(), header.layer_size.y());
    let count = width * height * channels;
    let bytes = Cursor::new(bytes);
    let samples = match (half, gray) {
        (true, false) => Samples::F16(color!(bytes, channels, count, u16, f16, f16::to_bits)?),
        (false, false) => Samples::F32(color!(bytes, channels, count, f32, f32, |v| v)?),
        (true, true) => Samples::F16(gray!(bytes, channels, count, u16, f16, f16::to_bits)?),
        (false, true) => Samples::F32(gray!(bytes, channels, count, f32, f32, |v| v)?),
    };
    Ok(Image {
        name: String::new(),
        width: width as u32,
        height: height as u32,
        channels: channels as u8,
        samples,
        space: ColorSpace::Linear,
        premultiplied: alpha,
    })
}

fn damaged(error: ::exr::error::Error) -> ImageError {
    match error {
        ::exr::error::Error::NotSupported(what) => ImageError::Unsupported { format: FORMAT, what: what.into_owned() },
        ::exr::error::Error::Invalid(what) => ImageError::Damaged { format: FORMAT, reason: what.into_owned() },
        other => ImageError::Damaged { format: FORMAT, reason: other.to_string() },
    }
}
