//! Colours by name or as hexadecimal numbers, both on the sRGB curve.

use super::color_names::COLOR_NAMES;
use crate::diagnostic::closest_word;
use canaletto::math::Rgb;
use canaletto::texture::srgb_decode;

/// The word before a colour on the sRGB curve.
pub(crate) const SRGB: &str = "srgb";

/// The linear colour that a word stands for: `#rrggbb`, `#rgb`, or a name of CSS. `None` for any other word.
pub fn color(word: &str) -> Option<Rgb> {
    color_of(word).map(|color| Rgb::from(color.map(|v| v as f32)))
}

/// The linear colour that a text stands for: `#rrggbb`, `#rgb`, or a name of CSS. `None` for any other text.
pub(crate) fn color_of(text: &str) -> Option<[f64; 3]> {
    match text.strip_prefix('#') {
        Some(digits) => of_digits(digits),
        None => named(text),
    }
}

/// The linear colour of red, green and blue on the sRGB curve, from 0 to 1.
pub(crate) fn linear(color: [f64; 3]) -> [f64; 3] {
    color.map(|v| f64::from(srgb_decode(v as f32)))
}

fn of_bytes(color: u32) -> [f64; 3] {
    linear([16, 8, 0].map(|shift| f64::from((color >> shift) & 0xff) / 255.0))
}

fn of_digits(digits: &str) -> Option<[f64; 3]> {
    if !digits.bytes().all(|b| b.is_ascii_hexdigit()) {
        return None;
    }
    let number = u32::from_str_radix(digits, 16).ok()?;
    match digits.len() {
        6 => Some(of_bytes(number)),
        // Each digit stands for two equal ones.
        3 => Some(of_bytes((number >> 8) * 0x11_0000 + ((number >> 4) & 0xf) * 0x1100 + (number & 0xf) * 0x11)),
        _ => None,
    }
}

fn named(name: &str) -> Option<[f64; 3]> {
    let place = COLOR_NAMES.binary_search_by(|(known, _)| (*known).cmp(name)).ok()?;
    Some(of_bytes(COLOR_NAMES[place].1))
}

/// The name of a colour that is nearest to a misspelled one.
pub(crate) fn closest_color(name: &str) -> Option<&'static str> {
    closest_word(name, COLOR_NAMES.iter().map(|(name, _)| *name))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_in_order_and_have_their_colors() {
        assert!(COLOR_NAMES.is_sorted_by(|a, b| a.0 < b.0) && COLOR_NAMES.len() == 148);
        assert_eq!(color_of("white"), Some([1.0; 3]));
        assert_eq!(color_of("lime"), Some([0.0, 1.0, 0.0]));
        assert_eq!(color_of("rebeccapurple"), color_of("#663399"));
        assert_eq!(color_of("#f80"), color_of("#FF8800"));
        assert_eq!(color_of("darkgrey"), color_of("darkgray"));
        for wrong in ["", "#", "#12345", "#1234567", "#gggggg", "#+12345", "Red", "reddish", "ff8800"] {
            assert_eq!(color_of(wrong), None, "{wrong}");
        }
        assert_eq!(closest_color("orang"), Some("orange"));
    }

    /// IEC 61966-2-1 by its formula: 128 / 255 is 0.2158605.
    #[test]
    fn colors_are_linear() {
        let [r, g, b] = color_of("#800a00").unwrap();
        assert!((r - 0.215_860_5).abs() < 1e-6 && (g - 10.0 / 255.0 / 12.92).abs() < 1e-8 && b == 0.0);
    }
}
