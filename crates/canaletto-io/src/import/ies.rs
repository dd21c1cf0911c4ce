//! Lamps' distributions of light: ANSI/IES LM-63 (1986 to 2019), photometry of type C.
//!
//! A file has lines of keywords up to `TILT=`. Numbers follow, broken into lines anywhere: ten about the lamp, three
//! about its power, the vertical angles, the horizontal angles, and for each horizontal angle the intensities at all
//! vertical ones. Only their proportions are used, so that factors for all of them are read and left out. So is
//! `TILT=INCLUDE`, which describes how the lamp's flux depends on its tilt.

use super::lines::{ImportError, Lines, Token, Tokens, lines};
use super::{attach_source, encoding, unreadable};
use crate::assets::{AssetPath, Assets, reason};
use crate::diagnostic::{Diagnostic, Diagnostics};
use canaletto::light::IesProfile;

/// The numbers before the angles.
const HEADER: [&str; 13] = [
    "the number of lamps",
    "the lumens per lamp",
    "the candela multiplier",
    "the number of vertical angles",
    "the number of horizontal angles",
    "the photometric type",
    "the type of units",
    "the width",
    "the length",
    "the height",
    "the ballast factor",
    "the ballast-lamp factor",
    "the input watts",
];

/// Reads the profile that the file `from` names.
///
/// # Errors
/// The mistakes in the file, with their lines. If it can't be opened, the message is about the whole file.
pub(crate) fn read_ies(path: &str, assets: &dyn Assets, from: &AssetPath) -> Result<IesProfile, Diagnostics> {
    let asset = assets.open(path, from).map_err(|error| Diagnostic::error(path, reason(&error)))?;
    let file = asset.path.name();
    let bytes = asset.content.view().whole().map_err(|e| unreadable(&e).error(file))?;
    let bytes = encoding::text(&bytes);
    Reader::new(&bytes).and_then(|mut reader| reader.profile()).map_err(|complaint| {
        let mut errors = Diagnostics::from(complaint.error(file));
        attach_source(&mut errors, file, bytes[..].into());
        errors
    })
}

/// The numbers after `TILT=`.
struct Reader<'a> {
    lines: Lines<'a>,
    words: Option<Tokens<'a>>,
}

impl<'a> Reader<'a> {
    fn new(bytes: &'a [u8]) -> Result<Reader<'a>, ImportError> {
        let mut lines = lines(bytes);
        let tilt = |line: &Token| line.text.get(..5).is_some_and(|start| start.eq_ignore_ascii_case(b"TILT="));
        let Some(line) = lines.find(tilt) else {
            let message = "there is no line that starts with TILT=";
            return Err(ImportError::file(message).help("is it an IES file (IESNA LM-63)?"));
        };
        let mut reader = Reader { lines, words: None };
        match line.text[5..].trim_ascii() {
            value if value.eq_ignore_ascii_case(b"NONE") => {}
            value if value.eq_ignore_ascii_case(b"INCLUDE") => {
                reader.number("the lamp's position")?;
                let (count, at) = reader.number("the number of tilts")?;
                for _ in 0..2 * Self::count(count, &at, "the number of tilts")? {
                    reader.number("a tilt or its factor")?;
                }
            }
            _ => {
                let message = format!("\"{}\" names a file of tilts, which isn't read", line.shown());
                return Err(line.wrong(message).help("TILT=NONE and TILT=INCLUDE are known"));
            }
        }
        Ok(reader)
    }

    /// The next number and its word.
    fn number(&mut self, what: &str) -> Result<(f32, Token<'a>), ImportError> {
        loop {
            if let Some(word) = self.words.as_mut().and_then(Tokens::next) {
                return word.number().map(|number| (number, word)).map_err(|complaint| complaint.within(what));
            }
            match self.lines.next() {
                Some(line) => self.words = Some(line.words()),
                None => return Err(ImportError::file(format!("the file ends before {what}"))),
            }
        }
    }

    fn count(value: f32, at: &Token, what: &str) -> Result<usize, ImportError> {
        let most = IesProfile::MAX_ANGLES as f32;
        if value.fract() == 0.0 && (1.0..=most).contains(&value) {
            Ok(value as usize)
        } else {
            Err(at.wrong(format!("{what} is {value}; it must be a whole number from 1 to {most}")))
        }
    }

    fn numbers(&mut self, count: usize, what: &str) -> Result<Vec<f32>, ImportError> {
        // Memory grows with the numbers that are there.
        let mut numbers = Vec::new();
        for i in 0..count {
            numbers.push(self.number(&format!("{what} {} of {count}", i + 1))?.0);
        }
        Ok(numbers)
    }

    fn profile(&mut self) -> Result<IesProfile, ImportError> {
        let mut header = Vec::new();
        for what in HEADER {
            header.push(self.number(what)?);
        }
        let count = |i: usize| Self::count(header[i].0, &header[i].1, HEADER[i]);
        let (vertical, horizontal) = (count(3)?, count(4)?);
        let (kind, at) = &header[5];
        if *kind != 1.0 {
            let name = match *kind {
                2.0 => " (B)",
                3.0 => " (A)",
                _ => "",
            };
            let message = format!("the photometric type is {kind}{name}; it must be 1 (C)");
            return Err(at
                .wrong(message)
                .help("the lamp's maker may have the file in type C, which is usual for rooms"));
        }
        let profile = IesProfile {
            vertical: self.numbers(vertical, "vertical angle")?,
            horizontal: self.numbers(horizontal, "horizontal angle")?,
            candela: self.numbers(vertical * horizontal, "intensity")?,
        };
        match profile.check() {
            Ok(()) => Ok(profile),
            Err(problem) => Err(ImportError::file(format!("it {}", problem.problem))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assets::MemoryAssets;

    const LAMP: &str = "IESNA:LM-63-2002\r\n[TEST] none\r\nTILT=NONE\r\n1 1000 1.0 3 2 1 2 0.1 0.1\r\n0.05\r\n1 1 20\r\n\
                        0 45 90\r\n0 90\r\n100 50\r\n0 100 80 10\r\n";

    fn read(text: &str) -> Result<IesProfile, String> {
        let assets = MemoryAssets::new().with("lamp.ies", text);
        read_ies("lamp.ies", &assets, &AssetPath::base()).map_err(|errors| errors.to_string())
    }

    #[test]
    fn profiles_are_read() {
        let expected = IesProfile {
            vertical: vec![0.0, 45.0, 90.0],
            horizontal: vec![0.0, 90.0],
            candela: vec![100.0, 50.0, 0.0, 100.0, 80.0, 10.0],
        };
        assert_eq!(read(LAMP), Ok(expected.clone()));
        let tilted = LAMP.replace("TILT=NONE", "TILT=INCLUDE\n1\n2\n0 90\n1 0.9");
        assert_eq!(read(&tilted), Ok(expected));
    }

    #[test]
    fn mistakes_are_named_with_their_lines() {
        for (from, to, parts) in [
            ("TILT=NONE", "TLT=NONE", &["no line that starts with TILT="][..]),
            ("TILT=NONE", "TILT=other.tlt", &["lamp.ies:3", "names a file of tilts"]),
            ("3 2 1 2", "3 2 2 2", &["lamp.ies:4", "photometric type is 2 (B)"]),
            ("3 2 1 2", "3 x 1 2", &["lamp.ies:4", "the number of horizontal angles", "not a number"]),
            ("3 2 1 2", "3 2.5 1 2", &["lamp.ies:4", "whole number"]),
            ("0 100 80 10", "0 100", &["ends before intensity 5 of 6"]),
            ("0 45 90", "0 95 90", &["vertical angles that don't rise"]),
            ("0 90\r\n100", "0 50\r\n100", &["horizontal angles from 0 to 50"]),
            ("100 50\r\n0", "100 -50\r\n0", &["isn't 0 or more"]),
        ] {
            let text = LAMP.replacen(from, to, 1);
            assert_ne!(text, LAMP);
            let message = read(&text).unwrap_err();
            assert!(parts.iter().all(|part| message.contains(part)), "{from} -> {to}: {message}");
        }
    }
}
