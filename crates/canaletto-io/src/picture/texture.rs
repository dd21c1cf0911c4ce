//! Formats that are read for textures and never written: JPEG, WebP, Radiance HDR.

use super::{Channel, Decoded, Image, Window};
use ::exr::prelude::f16;
use canaletto::scene::Transfer;
use canaletto::texture::{self, Samples};

/// The picture of a texture's image.
pub(super) fn picture(image: &texture::Image) -> Decoded {
    let names: &[&str] =
        [&["Y"][..], &["Y", "A"], &["R", "G", "B"], &["R", "G", "B", "A"]][usize::from(image.channels.clamp(1, 4)) - 1];
    let channel = |index: usize| -> Vec<f32> {
        let every = names.len();
        match &image.samples {
            Samples::U8(data) => data[index..].iter().step_by(every).map(|v| f32::from(*v) / 255.0).collect(),
            Samples::U16(data) => data[index..].iter().step_by(every).map(|v| f32::from(*v) / 65535.0).collect(),
            Samples::F16(data) => data[index..].iter().step_by(every).map(|v| f16::from_bits(*v).to_f32()).collect(),
            Samples::F32(data) => data[index..].iter().step_by(every).copied().collect(),
        }
    };
    let channels = names.iter().enumerate().map(|(i, name)| Channel { name: (*name).into(), data: channel(i) });
    let (bits, display_referred) = match image.samples {
        Samples::U8(_) => (8, true),
        Samples::U16(_) => (16, true),
        Samples::F16(_) => (16, false),
        Samples::F32(_) => (32, false),
    };
    Decoded {
        image: Image { width: image.width, height: image.height, channels: channels.collect() },
        bits,
        transfer: Some(if display_referred { Transfer::Srgb } else { Transfer::None }),
        metadata: Vec::new(),
        window: Window::whole(image.width, image.height),
        left_out: Vec::new(),
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
