//! Lamps' distributions of light: ANSI/IES LM-63 (1986 to 2019).
//!
//! A file has lines of keywords up to `TILT=`. Numbers follow, broken into lines anywhere: ten about the lamp, three
//! about its power, the vertical angles, the horizontal angles, and for each horizontal angle the intensities at all
//! vertical ones. Commas separate numbers as spaces do. Only the proportions of intensities are used, so that factors
//! for all of them are read and left out. So is `TILT=INCLUDE`, which describes how the lamp's flux depends on its
//! tilt.
//!
//! Tables of type C that are usual and not of the standard are brought into its form by [`normalize`].

use super::lines::{ImportError, Lines, Token, Tokens, lines};
use super::{attach_source, encoding, unreadable};
use crate::assets::{AssetPath, Assets, reason};
use crate::diagnostic::{Diagnostic, Diagnostics};
use canaletto::light::{IesProfile, Photometry};

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

/// Intensities below 0 are errors of measurement if none is lower than this share of the largest.
const MOST_NEGATIVE: f32 = 0.05;

/// Reads the profile that the file `from` names. The diagnostics are warnings.
///
/// # Errors
/// The mistakes in the file, with their lines. If it can't be opened, the message is about the whole file.
pub(crate) fn read_ies(
    path: &str,
    assets: &dyn Assets,
    from: &AssetPath,
) -> Result<(IesProfile, Option<Diagnostic>), Diagnostics> {
    let asset = assets.open(path, from).map_err(|error| Diagnostic::error(path, reason(&error)))?;
    let file = asset.path.name();
    let bytes = asset.content.view().whole().map_err(|e| unreadable(&e).error(file))?;
    let bytes = encoding::text(&bytes);
    // Places stay the same, so that messages show the file as it is.
    let spaced: Vec<u8> = bytes.iter().map(|byte| if *byte == b',' { b' ' } else { *byte }).collect();
    let read = Reader::new(&spaced).and_then(|mut reader| reader.profile());
    let warned = |(profile, warning): (IesProfile, Option<String>)| {
        (profile, warning.map(|message| Diagnostic::warning(file, message)))
    };
    read.map(warned).map_err(|complaint| {
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
        let Some((line, tilt)) = lines.find_map(|line| tilt(line.text).map(|tilt| (line, tilt))) else {
            let message = "there is no line that starts with TILT=";
            return Err(ImportError::file(message).help("is it an IES file (IESNA LM-63)?"));
        };
        let mut reader = Reader { lines, words: None };
        match tilt {
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
                let help = "copy that file's numbers behind TILT=INCLUDE, or write TILT=NONE: only the proportions of \
                            intensities are used";
                return Err(line.wrong(message).help(help));
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

    /// The profile, and a warning.
    fn profile(&mut self) -> Result<(IesProfile, Option<String>), ImportError> {
        let mut header = Vec::new();
        for what in HEADER {
            header.push(self.number(what)?);
        }
        let count = |i: usize| Self::count(header[i].0, &header[i].1, HEADER[i]);
        let (vertical, horizontal) = (count(3)?, count(4)?);
        let (kind, at) = &header[5];
        let photometry = match *kind {
            1.0 => Photometry::C,
            2.0 => Photometry::B,
            3.0 => Photometry::A,
            _ => {
                let message = format!("the photometric type is {kind}; it must be 1 (C), 2 (B) or 3 (A)");
                return Err(at.wrong(message).help("most files of lamps for rooms and streets are of type 1"));
            }
        };
        let mut profile = IesProfile {
            photometry,
            vertical: self.numbers(vertical, "vertical angle")?,
            horizontal: self.numbers(horizontal, "horizontal angle")?,
            candela: self.numbers(vertical * horizontal, "intensity")?,
        };
        if photometry == Photometry::C {
            normalize(&mut profile);
        }
        let warning = clamp_noise(&mut profile);
        match profile.check() {
            Ok(()) => Ok((profile, warning)),
            Err(problem) => Err(ImportError::file(format!("it {}", problem.problem))),
        }
    }
}

/// What follows `TILT=` on a line that starts so; spaces may stand around the sign.
fn tilt(line: &[u8]) -> Option<&[u8]> {
    let (start, rest) = line.trim_ascii().split_at_checked(4)?;
    let value = rest.trim_ascii_start().strip_prefix(b"=")?;
    start.eq_ignore_ascii_case(b"TILT").then(|| value.trim_ascii())
}

/// Makes intensities that are a little below 0 dark, as a sensor's noise is, and says so.
fn clamp_noise(profile: &mut IesProfile) -> Option<String> {
    let largest = profile.candela.iter().copied().fold(0.0, f32::max);
    let least = profile.candela.iter().copied().fold(0.0, f32::min);
    if least >= 0.0 || least < -MOST_NEGATIVE * largest {
        return None;
    }
    let negative = profile.candela.iter_mut().filter(|v| **v < 0.0);
    let count = negative.map(|v| *v = 0.0).count();
    let are = if count == 1 { "intensity is" } else { "intensities are" };
    Some(format!("{count} {are} negative, down to {least}; they count as 0"))
}

/// Brings a table of type C into the standard's form: a turn that lacks its last angle gets it, horizontal angles below
/// 0 are turned by 360 degrees, and vertical angles below 0 become those of the opposite plane. Other tables are left
/// as they are, for [`IesProfile::check`].
fn normalize(profile: &mut IesProfile) {
    let rows = profile.vertical.len();
    let mut columns: Vec<(f32, Vec<f32>)> = profile
        .horizontal
        .iter()
        .zip(profile.candela.chunks(rows))
        .map(|(angle, candela)| (*angle, candela.to_vec()))
        .collect();
    let rises = |angles: &[f32]| angles.is_sorted_by(|a, b| a < b);
    if !rises(&profile.vertical) || !rises(&profile.horizontal) {
        return;
    }
    if profile.vertical[0] < 0.0 {
        let Some(whole) = of_opposite_planes(&mut profile.vertical, &columns) else { return };
        columns = whole;
    }
    let [first, last] = [columns[0].0, columns[columns.len() - 1].0];
    if [first, last] == [-90.0, 90.0] {
        // The mirror image, from 90 to 270.
        columns.iter_mut().for_each(|(angle, _)| *angle = 180.0 - *angle);
        columns.reverse();
    } else if first < 0.0 && last - first <= 360.0 {
        if last - first == 360.0 {
            columns.pop();
        }
        columns.iter_mut().filter(|(angle, _)| *angle < 0.0).for_each(|(angle, _)| *angle += 360.0);
        columns.sort_by(|a, b| a.0.total_cmp(&b.0));
    }
    let [first, last] = [columns[0].0, columns[columns.len() - 1].0];
    let step = columns.windows(2).map(|pair| pair[1].0 - pair[0].0).fold(0.0, f32::max);
    // The gap that is left is one more step, up to rounding.
    if first == 0.0 && last > 180.0 && last < 360.0 && 360.0 - last <= step * 1.01 {
        let again = columns[0].1.clone();
        columns.push((360.0, again));
    }
    profile.horizontal = columns.iter().map(|(angle, _)| *angle).collect();
    profile.candela = columns.into_iter().flat_map(|(_, candela)| candela).collect();
}

/// The planes of a whole turn, where those of half a turn have vertical angles below 0, too. None unless the planes are
/// a single one, or go from 0 to 180 degrees.
fn of_opposite_planes(vertical: &mut Vec<f32>, half: &[(f32, Vec<f32>)]) -> Option<Vec<(f32, Vec<f32>)>> {
    if !matches!([half[0].0, half[half.len() - 1].0], [0.0, 0.0 | 180.0]) {
        return None;
    }
    let mut angles: Vec<f32> = vertical.iter().map(|angle| angle.abs()).collect();
    angles.sort_by(f32::total_cmp);
    angles.dedup();
    // The intensity at a vertical angle of a plane, dark outside of its angles.
    let at = |plane: &[f32], angle: f32| {
        let next = vertical.partition_point(|v| *v < angle);
        match (next.checked_sub(1), vertical.get(next)) {
            (_, Some(found)) if *found == angle => plane[next],
            (Some(before), Some(after)) => {
                let share = (angle - vertical[before]) / (after - vertical[before]);
                plane[before] + (plane[next] - plane[before]) * share
            }
            _ => 0.0,
        }
    };
    let side = |plane: &[f32], sign: f32| angles.iter().map(|angle| at(plane, sign * angle)).collect::<Vec<f32>>();
    let mut whole: Vec<(f32, Vec<f32>)> = half.iter().map(|(angle, plane)| (*angle, side(plane, 1.0))).collect();
    // The plane at 180 degrees is given from both sides if half a turn is.
    let opposite = half.iter().map(|(angle, plane)| (angle + 180.0, side(plane, -1.0)));
    let last = whole[whole.len() - 1].0;
    whole.extend(opposite.filter(|(angle, _)| *angle > last && *angle < 360.0));
    whole.push((360.0, side(&half[0].1, 1.0)));
    *vertical = angles;
    Some(whole)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assets::MemoryAssets;

    const LAMP: &str = "IESNA:LM-63-2002\r\n[TEST] none\r\nTILT=NONE\r\n1 1000 1.0 3 2 1 2 0.1 0.1\r\n0.05\r\n1 1 20\r\n\
                        0 45 90\r\n0 90\r\n100 50\r\n0 100 80 10\r\n";

    fn read(text: &str) -> Result<IesProfile, String> {
        let assets = MemoryAssets::new().with("lamp.ies", text);
        read_ies("lamp.ies", &assets, &AssetPath::base())
            .map(|(profile, _)| profile)
            .map_err(|errors| errors.to_string())
    }

    #[test]
    fn profiles_are_read() {
        let expected = IesProfile {
            photometry: Photometry::C,
            vertical: vec![0.0, 45.0, 90.0],
            horizontal: vec![0.0, 90.0],
            candela: vec![100.0, 50.0, 0.0, 100.0, 80.0, 10.0],
        };
        assert_eq!(read(LAMP), Ok(expected.clone()));
        let tilted = LAMP.replace("TILT=NONE", "TILT=INCLUDE\n1\n2\n0 90\n1 0.9");
        assert_eq!(read(&tilted), Ok(expected));
    }

    /// All the ways in which makers write the same table.
    #[test]
    fn tables_that_say_the_same_are_equal() {
        let expected = read(LAMP).unwrap();
        let (start, numbers) = LAMP.split_once("TILT=NONE").unwrap();
        for same in [
            LAMP.replace("0 45 90", "0,45,90").replace("100 50", "100, 50 ,"),
            LAMP.replace("TILT=NONE", "TILT = NONE"),
            LAMP.replace("TILT=NONE", "  tilt =none  "),
            LAMP.replace("\r\n", "\n"),
            format!("TILT=NONE{numbers}"),
            format!("[MORE] TILT\n[MANUFAC] a, b\n{start}TILT=NONE\n{}", numbers.trim_start().replace("\r\n", " ")),
            format!("Acme 12\nTILT=NONE\n{}", numbers.replace(' ', "\n")),
            LAMP.replace("0 100 80 10", "-0.5 100 80 10"),
        ] {
            assert_eq!(read(&same).as_ref(), Ok(&expected), "{same}");
        }
    }

    /// A table of type C with these counts and numbers.
    fn table(counts: &str, numbers: &str) -> String {
        format!("TILT=NONE\n1 1000 1 {counts} 1 2 0 0 0 1 1 10\n{numbers}\n")
    }

    #[test]
    fn tables_beside_the_standard_are_brought_into_its_form() {
        for (counts, numbers, same_counts, same_numbers) in [
            // Without the last angle of a turn.
            ("2 4", "0 90  0 90 180 270  5 1 5 2 5 3 5 4", "2 5", "0 90  0 90 180 270 360  5 1 5 2 5 3 5 4 5 1"),
            // From −180 to 180, and from −90 to 90.
            (
                "2 5",
                "0 90  -180 -90 0 90 180  5 3 5 4 5 1 5 2 5 3",
                "2 5",
                "0 90  0 90 180 270 360  5 1 5 2 5 3 5 4 5 1",
            ),
            ("2 3", "0 90  -90 0 90  5 1 5 2 5 3", "2 3", "0 90  90 180 270  5 3 5 2 5 1"),
            // Half a turn of whole planes, and a single one.
            ("3 3", "-90 0 90  0 90 180  3 5 1 4 5 2 1 5 3", "2 5", "0 90  0 90 180 270 360  5 1 5 2 5 3 5 4 5 1"),
            ("3 1", "-90 0 90  0  2 5 1", "2 3", "0 90  0 180 360  5 1 5 2 5 1"),
        ] {
            let found = read(&table(counts, numbers));
            assert_eq!(found, read(&table(same_counts, same_numbers)), "{numbers}");
            assert!(found.is_ok(), "{found:?}");
        }
        for (counts, numbers, part) in [
            ("2 3", "0 90  0 90 200  5 1 5 2 5 3", "from 0 to 200"),
            ("3 2", "-90 0 90  0 90  1 5 1 1 5 1", "vertical angle"),
        ] {
            let message = read(&table(counts, numbers)).unwrap_err();
            assert!(message.contains(part), "{numbers}: {message}");
        }
    }

    #[test]
    fn noise_below_zero_is_dark_and_told_of() {
        let assets = MemoryAssets::new().with("lamp.ies", LAMP.replace("0 100 80 10", "-2 100 80 -0.5"));
        let (profile, warning) = read_ies("lamp.ies", &assets, &AssetPath::base()).unwrap();
        assert_eq!(profile.candela, [100.0, 50.0, 0.0, 100.0, 80.0, 0.0]);
        assert_eq!(warning.unwrap().message, "2 intensities are negative, down to -2; they count as 0");
    }

    #[test]
    fn mistakes_are_named_with_their_lines() {
        for (from, to, parts) in [
            ("TILT=NONE", "TLT=NONE", &["no line that starts with TILT="][..]),
            ("TILT=NONE", "TILT=other.tlt", &["lamp.ies:3", "names a file of tilts"]),
            ("3 2 1 2", "3 2 4 2", &["lamp.ies:4", "photometric type is 4; it must be 1 (C), 2 (B) or 3 (A)"]),
            ("0 45 90", "-90 0 90", &["vertical angle that isn't between 0 and 180"]),
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
