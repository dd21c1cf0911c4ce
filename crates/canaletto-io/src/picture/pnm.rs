//! PPM and PGM (Netpbm): text (`P2`, `P3`) and binary (`P5`, `P6`), with 8 or 16 bits. Values are taken as sRGB, as
//! most programs write them.

use super::format::FormatInfo;
use super::{Channel, Decoded, Image, MAX_PIXELS, PictureError, Window, no_pixels};
use crate::image::ImageError;

const NAME: &str = "PPM";

/// PPM and PGM in the table of picture formats.
pub(super) const FORMAT: FormatInfo = FormatInfo {
    names: [NAME, NAME],
    extension: "ppm",
    recognises: is_pnm,
    decode: decode_pnm,
    size: None,
    encoder: None,
    off: None,
};

/// Whether the bytes begin like a PPM or PGM.
fn is_pnm(bytes: &[u8]) -> bool {
    matches!(bytes, [b'P', b'2' | b'3' | b'5' | b'6', space, ..] if space.is_ascii_whitespace() || *space == b'#')
}

/// Reads a PPM or PGM. Bytes after its picture are ignored.
///
/// # Errors
/// [`PictureError`] if the picture can't be read.
fn decode_pnm(bytes: &[u8]) -> Result<Decoded, PictureError> {
    let (binary, names): (bool, &[&str]) = match bytes[1] {
        b'2' => (false, &["Y"]),
        b'3' => (false, &["R", "G", "B"]),
        b'5' => (true, &["Y"]),
        _ => (true, &["R", "G", "B"]),
    };
    let mut text = Text { bytes, at: 2 };
    let (width, height, most) = (text.number()?, text.number()?, text.number()?);
    if width == 0 || height == 0 {
        return Err(no_pixels());
    }
    if u64::from(width) * u64::from(height) > MAX_PIXELS {
        let (width, height) = (width.into(), height.into());
        return Err(ImageError::TooLarge { format: NAME, width, height }.into());
    }
    if !(1..=65_535).contains(&most) {
        return Err(damaged(format!("its largest number is {most}; it must be between 1 and 65535")));
    }
    let count = width as usize * height as usize * names.len();
    let wide = most > 255;
    // Each number takes a byte or more, so memory is bounded by the file's size.
    let least = if binary && wide { count * 2 } else { count };
    let start = text.at + 1;
    if bytes.len().saturating_sub(start) < least {
        return Err(damaged("it ends too early".into()));
    }
    let mut channels: Vec<Channel> =
        names.iter().map(|name| Channel::new(*name, Vec::with_capacity(count / names.len()))).collect();
    for index in 0..count {
        let value = match (binary, wide) {
            (true, false) => u32::from(bytes[start + index]),
            (true, true) => u32::from(u16::from_be_bytes([bytes[start + 2 * index], bytes[start + 2 * index + 1]])),
            (false, _) => text.number()?,
        };
        if value > most {
            return Err(damaged(format!("it has a number {value}, but says that the largest is {most}")));
        }
        channels[index % names.len()].data.push(value as f32 / most as f32);
    }
    Ok(Decoded {
        image: Image { width, height, channels },
        bits: if wide { 16 } else { 8 },
        transfer: None,
        metadata: Vec::new(),
        window: Window::whole(width, height),
        left_out: Vec::new(),
        is_changed: false,
        display_referred: true,
    })
}

fn damaged(reason: String) -> PictureError {
    ImageError::Damaged { format: NAME, reason }.into()
}

/// A cursor for the numbers of the header, and of a picture in text form.
struct Text<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Text<'_> {
    /// The next number, after white space and comments.
    fn number(&mut self) -> Result<u32, PictureError> {
        loop {
            match self.bytes.get(self.at) {
                Some(b'#') => {
                    let rest = &self.bytes[self.at..];
                    self.at += rest.iter().position(|b| matches!(b, b'\n' | b'\r')).unwrap_or(rest.len());
                }
                Some(byte) if byte.is_ascii_whitespace() => self.at += 1,
                _ => break,
            }
        }
        let digits = self.bytes[self.at..].iter().take_while(|b| b.is_ascii_digit()).count();
        let text = std::str::from_utf8(&self.bytes[self.at..self.at + digits]).unwrap_or_default();
        self.at += digits;
        text.parse().map_err(|_| match digits {
            0 => damaged("a number is missing".into()),
            _ => damaged(format!("a number of {digits} digits is too large")),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_four_kinds_are_read() {
        let colors = |bytes: &[u8]| {
            let read = decode_pnm(bytes).unwrap();
            let rgb = read.image.rgb().unwrap().map(<[f32]>::to_vec);
            (read.image.width, read.image.height, read.bits, rgb)
        };
        let expected = (2, 1, 8, [vec![1.0, 0.0], vec![0.0, 1.0], vec![0.2, 0.4]]);
        assert_eq!(colors(b"P3 # a comment\n2 1\n255\n255 0 51  0 255 102\n"), expected);
        assert_eq!(colors(b"P6\n2 1 255\n\xff\x00\x33\x00\xff\x66 and more"), expected);
        assert_eq!(
            colors(b"P5 1 2 65535\n\xff\xff\x33\x33"),
            (1, 2, 16, [vec![1.0, 0.2], vec![1.0, 0.2], vec![1.0, 0.2]])
        );
        assert_eq!(colors(b"P2 1 1 4 1").3[0], [0.25]);
    }

    #[test]
    fn damage_is_told() {
        let wrong = |bytes: &[u8]| decode_pnm(bytes).unwrap_err().to_string();
        assert!(wrong(b"P6 2 1 255\nabcde").contains("ends too early"));
        assert!(wrong(b"P6 2 1 70000\nabcdef").contains("70000"));
        assert!(wrong(b"P3 1 1 9 1 2 x").contains("a number is missing"));
        assert!(wrong(b"P3 1 1 9 1 2 10").contains("the largest is 9"));
        assert!(wrong(b"P6 0 1 255\n").contains("at least one pixel"));
        assert!(wrong(b"P6 99999999999 1 255\n").contains("too large"));
        assert!(matches!(decode_pnm(b"P6 65536 65536 255\n"), Err(PictureError::Image(ImageError::TooLarge { .. }))));
        assert!(is_pnm(b"P6\n") && !is_pnm(b"P7\n") && !is_pnm(b"PK"));
    }
}
