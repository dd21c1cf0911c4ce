//! Formats that are read for textures and never written: Radiance HDR, and formats without their codec.

use super::format::FormatInfo;
use super::{Channel, Decoded, Image, PictureError, Window};
use crate::codec::CodecOff;
use crate::image::{hdr, unpack};
use canaletto::scene::Transfer;
use canaletto::texture::{self, Samples, from_half};

/// JPEG without its codec.
#[cfg(not(feature = "jpeg"))]
pub(super) const JPEG: FormatInfo = read_only(["JPEG"; 2], "jpg", crate::codec::is_jpeg, Some(crate::codec::JPEG));
/// WebP without its codec.
#[cfg(not(feature = "webp"))]
pub(super) const WEBP: FormatInfo = read_only(["WebP"; 2], "webp", crate::codec::is_webp, Some(crate::codec::WEBP));
/// Radiance HDR in the table of picture formats.
pub(super) const HDR: FormatInfo = read_only(["Radiance HDR", "HDR"], "hdr", hdr::is_hdr, None);
/// PNG without its codec.
#[cfg(not(feature = "png"))]
pub(super) const PNG: FormatInfo = read_only(["PNG"; 2], "png", crate::codec::is_png, Some(crate::codec::PNG));
/// OpenEXR without its codec.
#[cfg(not(feature = "exr"))]
pub(super) const EXR: FormatInfo = read_only(["OpenEXR", "EXR"], "exr", crate::codec::is_exr, Some(crate::codec::EXR));

const fn read_only(
    names: [&'static str; 2],
    extension: &'static str,
    recognises: fn(&[u8]) -> bool,
    off: Option<CodecOff>,
) -> FormatInfo {
    FormatInfo { names, extension, recognises, decode, size: None, encoder: None, off }
}

pub(super) fn decode(bytes: &[u8]) -> Result<Decoded, PictureError> {
    Ok(picture(&unpack(bytes)?.0))
}

/// Samples as named channels, according to their number from one to four. Integers are divided by the largest value of
/// their type.
pub(super) fn named(channels: u8, samples: &Samples) -> Vec<Channel> {
    let names: &[&str] =
        [&["Y"][..], &["Y", "A"], &["R", "G", "B"], &["R", "G", "B", "A"]][usize::from(channels.clamp(1, 4)) - 1];
    fn each<T: Copy>(data: &[T], first: usize, every: usize, number: impl Fn(T) -> f32) -> Vec<f32> {
        data[first..].iter().step_by(every).map(|v| number(*v)).collect()
    }
    let channel = |first: usize| match samples {
        Samples::U8(data) => each(data, first, names.len(), |v| f32::from(v) / 255.0),
        Samples::U16(data) => each(data, first, names.len(), |v| f32::from(v) / 65535.0),
        Samples::F16(data) => each(data, first, names.len(), from_half),
        Samples::F32(data) => each(data, first, names.len(), |v| v),
    };
    names.iter().enumerate().map(|(i, name)| Channel::new(*name, channel(i))).collect()
}

/// The numbers of a texture image as named channels.
pub(crate) fn image_of_texture(image: &texture::Image) -> Image {
    Image { width: image.width, height: image.height, channels: named(image.channels, &image.samples) }
}

/// The picture of a texture image.
fn picture(image: &texture::Image) -> Decoded {
    let (bits, display_referred) = match image.samples {
        Samples::U8(_) => (8, true),
        Samples::U16(_) => (16, true),
        Samples::F16(_) => (16, false),
        Samples::F32(_) => (32, false),
    };
    Decoded {
        image: image_of_texture(image),
        bits,
        transfer: Some(if display_referred { Transfer::Srgb } else { Transfer::None }),
        metadata: Vec::new(),
        window: Window::whole(image.width, image.height),
        left_out: Vec::new(),
        is_changed: false,
        display_referred,
    }
}

#[cfg(test)]
mod tests {
    use crate::picture::decode;
    use canaletto::scene::Transfer;

    #[test]
    fn jpeg_webp_and_hdr_are_pictures() {
        let jpeg = decode(include_bytes!("../image/testdata/ramp.jpg")).unwrap();
        assert_eq!((jpeg.bits, jpeg.transfer, jpeg.display_referred), (8, Some(Transfer::Srgb), true));
        assert!(jpeg.image.rgb().is_some());
        assert!(decode(include_bytes!("../image/testdata/ramp.webp")).unwrap().image.rgb().is_some());
        let hdr = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 1\n\x80\x40\x20\x82";
        let hdr = decode(hdr).unwrap();
        assert_eq!(hdr.image.rgb().unwrap().map(|c| c[0]), [2.0, 1.0, 0.5]);
        assert!(!hdr.display_referred);
    }
}
