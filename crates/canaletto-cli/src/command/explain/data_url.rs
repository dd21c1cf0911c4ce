//! Pictures inside of drawings and pages, as `data:` URLs (RFC 2397).

use crate::failure::Failure;
use crate::output::unfit;
use canaletto::explain::OutsidePicture;
use canaletto::scene::Transfer;
use canaletto_io::picture::{Channel, EncodeSettings, Image, PictureFormat};

/// A picture as a PNG in a `data:` URL.
pub(super) fn data_url(picture: &OutsidePicture) -> Result<String, Failure> {
    let channel =
        |index: usize, name: &str| Channel::new(name, picture.pixels.iter().map(|pixel| pixel[index]).collect());
    let channels = ["R", "G", "B", "A"].into_iter().enumerate().map(|(index, name)| channel(index, name)).collect();
    let image = Image { width: picture.width, height: picture.height, channels };
    let png = PictureFormat::Png.encode_image(&image, Transfer::Srgb, &EncodeSettings::default(), &[]);
    Ok(format!("data:image/png;base64,{}", base64(&png.map_err(|e| unfit(&e))?)))
}

/// Bytes in base 64 (RFC 4648).
fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for group in bytes.chunks(3) {
        let bits = (0..3).fold(0, |bits, index| bits << 8 | u32::from(group.get(index).copied().unwrap_or(0)));
        for index in 0..4 {
            let digit = DIGITS[(bits >> (18 - 6 * index)) as usize & 63];
            text.push(if index <= group.len() { char::from(digit) } else { '=' });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The test vectors of RFC 4648, section 10.
    #[test]
    fn base_64_has_the_test_vectors() {
        let vectors =
            [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foob", "Zm9vYg=="), ("fooba", "Zm9vYmE=")];
        vectors.into_iter().for_each(|(bytes, text)| assert_eq!(base64(bytes.as_bytes()), text));
        assert_eq!(base64(&[251, 255]), "+/8=");
    }
}
