//! JPEG (ITU-T T.81), baseline and progressive, grey and in colour.
//!
//! The decoder's kernels for single machines are off, so that the same file has the same texels everywhere.

use super::{ImageError, judge, room};
use canaletto::texture::{ColorSpace, Image, Samples};
use std::io::Cursor;
use zune_core::colorspace::ColorSpace as Layout;
use zune_core::options::DecoderOptions;
use zune_jpeg::JpegDecoder;
use zune_jpeg::errors::DecodeErrors;

const FORMAT: &str = "JPEG";

/// Reads a JPEG. Colour profiles and the orientation of cameras are ignored.
pub(super) fn read(bytes: &[u8]) -> Result<Image, ImageError> {
    let options = DecoderOptions::default().set_max_width(1 << 16).set_max_height(1 << 16).set_strict_mode(true);
    let mut decoder = JpegDecoder::new_with_options(Cursor::new(bytes), options);
    decoder.decode_headers().map_err(damaged)?;
    let Some((width, height)) = decoder.dimensions() else {
        return Err(ImageError::Damaged { format: FORMAT, reason: "it has no size".into() });
    };
    // Every block of 8 × 8 takes a bit at least, the one that says how bright it is.
    judge(FORMAT, width as u64, height as u64, bytes.len() as u64 * 8 * 64, bytes.len())?;
    let gray = decoder.input_colorspace() == Some(Layout::Luma);
    let layout = if gray { Layout::Luma } else { Layout::RGB };
    decoder.set_options(options.jpeg_set_out_colorspace(layout));
    let channels = if gray { 1 } else { 3 };
    let count = width * height * usize::from(channels);
    let mut data: Vec<u8> = room(count)?;
    data.resize(count, 0);
    decoder.decode_into(&mut data).map_err(damaged)?;
    let (width, height, samples) = (width as u32, height as u32, Samples::U8(data));
    Ok(Image { name: String::new(), width, height, channels, samples, space: ColorSpace::Srgb, premultiplied: false })
}

fn damaged(error: DecodeErrors) -> ImageError {
    match error {
        DecodeErrors::ZeroError => ImageError::Empty { format: FORMAT, width: 0, height: 0 },
        DecodeErrors::IoErrors(_) | DecodeErrors::ExhaustedData => {
            ImageError::Damaged { format: FORMAT, reason: "it ends too early".into() }
        }
        DecodeErrors::Unsupported(what) => ImageError::Unsupported { format: FORMAT, what: format!("{what:?}") },
        other => ImageError::Damaged { format: FORMAT, reason: other.to_string().trim().replace('\n', " ") },
    }
}
