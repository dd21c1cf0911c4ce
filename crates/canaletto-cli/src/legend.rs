//! The look of texts in pictures: colours, margins, sizes and wrapping.

/// The colour behind texts, in display values.
pub(crate) const PAPER: [f32; 3] = [0.12; 3];
/// The colour of texts.
pub(crate) const INK: [f32; 3] = [0.93; 3];
/// The pixels around texts, at scale 1.
pub(crate) const MARGIN: u32 = 6;

/// The words of a text in lines of at most this many characters. Longer words have lines of their own.
pub(crate) fn wrapped(text: &str, characters: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split(' ') {
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= characters => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_are_wrapped_between_words() {
        assert_eq!(wrapped("aa bb cc", 5), ["aa bb", "cc"]);
        assert_eq!(wrapped("aaaaaaa b", 3), ["aaaaaaa", "b"]);
    }
}
