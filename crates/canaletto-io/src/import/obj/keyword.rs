//! The keywords of the lines of an OBJ file.

use super::super::lines::{Token, Tokens};

/// The kind of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Keyword {
    Position,
    TexCoord,
    Normal,
    Face,
    Object,
    Group,
    Material,
    Library,
    Smoothing,
    /// Lines and points, which have no area.
    Thin,
    Comment,
    Other,
}

impl Keyword {
    fn named(text: &[u8]) -> Keyword {
        match text {
            b"v" => Keyword::Position,
            b"vt" => Keyword::TexCoord,
            b"vn" => Keyword::Normal,
            b"f" | b"fo" => Keyword::Face,
            b"o" => Keyword::Object,
            b"g" => Keyword::Group,
            b"usemtl" => Keyword::Material,
            b"mtllib" => Keyword::Library,
            b"s" => Keyword::Smoothing,
            b"l" | b"p" => Keyword::Thin,
            // Zeros and Ctrl-Z pad the end of old files.
            [b'#' | 0 | 0x1a, ..] => Keyword::Comment,
            _ => Keyword::Other,
        }
    }

    /// The keyword of a line, with its word and the words after it. Capitals are accepted, as are numbers that follow
    /// without a space.
    pub(super) fn of(line: Token<'_>) -> Option<(Keyword, Token<'_>, Tokens<'_>)> {
        const LONGEST: usize = 6;
        let mut words = line.words();
        let word = words.next()?;
        let keyword = Keyword::named(word.text);
        if keyword != Keyword::Other {
            return Some((keyword, word, words));
        }
        let letters = word.text.iter().position(|byte| !byte.is_ascii_alphabetic()).unwrap_or(word.text.len());
        let mut lower = [0; LONGEST];
        let lower = lower.get_mut(..letters).unwrap_or_default();
        lower.copy_from_slice(&word.text[..lower.len()]);
        lower.make_ascii_lowercase();
        let keyword = Keyword::named(lower);
        if letters == word.text.len() {
            return Some((keyword, word, words));
        }
        let numbers = matches!(word.text[letters], b'0'..=b'9' | b'-' | b'+' | b'.');
        let takes = matches!(keyword, Keyword::Position | Keyword::TexCoord | Keyword::Normal | Keyword::Face);
        if !(numbers && takes) {
            return Some((Keyword::Other, word, words));
        }
        let (first, rest) = line.text.split_at(letters);
        let words = Token { start: line.start + letters, text: rest }.words();
        Some((keyword, Token { start: line.start, text: first }, words))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn capitals_and_missing_spaces_are_read() {
        let of = |text: &str| {
            let (keyword, word, words) = Keyword::of(Token { start: 5, text: text.as_bytes() }).unwrap();
            (keyword, word.string(), words.map(|w| (w.start, w.string())).collect::<Vec<_>>())
        };
        let numbers = |start: usize| vec![(start, "-1".to_owned()), (start + 3, "2".to_owned())];
        assert_eq!(of("v -1 2"), (Keyword::Position, "v".into(), numbers(7)));
        assert_eq!(of("VN -1 2"), (Keyword::Normal, "VN".into(), numbers(8)));
        assert_eq!(of("vt-1 2"), (Keyword::TexCoord, "vt".into(), numbers(7)));
        assert_eq!(of("F-1 2"), (Keyword::Face, "F".into(), numbers(6)));
        assert_eq!(of("UseMtl a").0, Keyword::Material);
        for text in ["vp 1", "v_ 1", "o1 2", "group 1", "surfaces 1", "verylongword1 2", "1 2", "\u{e9} 1"] {
            assert_eq!(of(text).0, Keyword::Other, "{text}");
        }
        assert_eq!(of("#v 1").0, Keyword::Comment);
    }
}
