//! Text encodings other than UTF-8.

use std::borrow::Cow;

/// The text as UTF-8 if it is UTF-16: it has a byte order mark, or every other byte of its first two characters is 0.
pub(super) fn from_utf16(bytes: &[u8]) -> Option<Vec<u8>> {
    let read = order(bytes)?;
    let units = bytes.chunks_exact(2).map(|pair| read([pair[0], pair[1]]));
    let mut out = Vec::with_capacity(bytes.len() / 2);
    for unit in char::decode_utf16(units) {
        let character = unit.unwrap_or(char::REPLACEMENT_CHARACTER);
        out.extend_from_slice(character.encode_utf8(&mut [0; 4]).as_bytes());
    }
    Some(out)
}

/// The number of bytes that [`is_utf16`] needs.
pub(super) const START: usize = 4;

/// Whether a file with these first bytes is UTF-16.
pub(super) fn is_utf16(start: &[u8]) -> bool {
    order(start).is_some()
}

/// The bytes as they are, or their text as UTF-8 if it is UTF-16.
pub(super) fn utf8(bytes: &[u8]) -> Cow<'_, [u8]> {
    from_utf16(bytes).map_or(Cow::Borrowed(bytes), Cow::Owned)
}

/// Bytes after a text in files of old systems: Ctrl-Z, and zeros that pad a block.
const FILLERS: [u8; 2] = [0, 0x1a];

/// The text of a file as UTF-8, without the padding at its end.
pub(super) fn text(bytes: &[u8]) -> Cow<'_, [u8]> {
    let end = |text: &[u8]| text.iter().rposition(|byte| !FILLERS.contains(byte)).map_or(0, |last| last + 1);
    match utf8(bytes) {
        Cow::Borrowed(text) => Cow::Borrowed(&text[..end(text)]),
        Cow::Owned(mut text) => {
            text.truncate(end(&text));
            Cow::Owned(text)
        }
    }
}

fn order(start: &[u8]) -> Option<fn([u8; 2]) -> u16> {
    match start {
        // UTF-32 has an equal mark, followed by zeros.
        [0xff, 0xfe, 0, 0, ..] => None,
        [0xff, 0xfe, ..] => Some(u16::from_le_bytes),
        [0xfe, 0xff, ..] => Some(u16::from_be_bytes),
        [a, 0, b, 0, ..] if *a != 0 && *b != 0 => Some(u16::from_le_bytes),
        [0, a, 0, b, ..] if *a != 0 && *b != 0 => Some(u16::from_be_bytes),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_orders_are_read_with_a_mark_and_without() {
        let text = "\u{feff}v 1 2 3\n# \u{1f600} \u{e9}\n";
        for text in [text, &text[3..]] {
            let little: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
            let big: Vec<u8> = text.encode_utf16().flat_map(u16::to_be_bytes).collect();
            for bytes in [little, big] {
                assert!(is_utf16(&bytes[..START]));
                assert_eq!(from_utf16(&bytes).as_deref(), Some(text.as_bytes()));
                // Half a character at the end is dropped.
                assert!(from_utf16(&bytes[..bytes.len() - 1]).is_some());
            }
        }
        let lone = [0xff, 0xfe, b'a', 0, 0, 0xd8];
        assert_eq!(from_utf16(&lone).as_deref(), Some("\u{feff}a\u{fffd}".as_bytes()));
    }

    #[test]
    fn what_fills_up_the_end_is_left_out() {
        assert_eq!(&text(b"x 1\n\x1a\0\0")[..], b"x 1\n");
        assert_eq!(&text(b"\xff\xfex\0 \x001\0\x1a\0")[..], "\u{feff}x 1".as_bytes());
        assert_eq!(&text(b"\0\x1a")[..], b"");
    }

    #[test]
    fn other_text_is_left_as_it_is() {
        for text in [&b"v 1 2 3"[..], b"", b"v", b"\xef\xbb\xbfv 1", b"\xff\xfe\0\0v\0\0\0"] {
            assert_eq!(utf8(text), text);
            assert_eq!(super::text(text), text.strip_suffix(b"\0\0\0").unwrap_or(text));
        }
    }
}
