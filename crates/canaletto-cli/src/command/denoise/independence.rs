//! Whether two pictures can be two halves: each must have noise of its own.

use crate::exit::Exit;
use crate::failure::Failure;
use canaletto_io::file_id::FileId;
use canaletto_io::picture::{Decoded, SAMPLES_TEXT};
use std::ops::Range;
use std::path::Path;

/// The failure of a file that is given twice.
pub(super) fn check_files([a, b]: [&Path; 2]) -> Result<(), Failure> {
    match (FileId::of(a), FileId::of(b)) {
        (Ok(first), Ok(second)) if first == second => {
            let what = match (a.display(), b.display()) {
                (name, _) if a == b => format!("{name} is given twice"),
                (name, other) => format!("{name} and {other} are one file"),
            };
            Err(Failure::usage(format!("{what}, but two halves need noise of their own"))
                .help(advice(1, None) + ", or give one picture alone"))
        }
        _ => Ok(()),
    }
}

/// The failure of two pictures that have the same samples. Pictures without texts are told by their colours, which
/// `same_colors` compares.
pub(super) fn check(
    names: [&Path; 2],
    pictures: [&Decoded; 2],
    same_colors: impl FnOnce() -> bool,
) -> Result<(), Failure> {
    let [a, b] = names.map(Path::display);
    let failed = |why: String| Failure::new(Exit::Scene, format!("{a} and {b} aren't independent: {why}"));
    let samples = pictures.map(Samples::of);
    let [Some(first), Some(second)] = &samples else {
        return if same_colors() {
            Err(failed("all their colours are equal".into()).help(advice(1, None)))
        } else {
            Ok(())
        };
    };
    if !first.meet(second) {
        return Ok(());
    }
    let [words, others] = [first, second].map(Samples::words);
    let seed = &first.seed;
    let what = if words == others {
        format!("both have {words} of seed {seed}")
    } else {
        format!("they have {words} and {others} of one seed, {seed}")
    };
    let end = first.numbers.end.max(second.numbers.end);
    let next = seed.parse::<u64>().map_or(1, |seed| seed.wrapping_add(1));
    let after = (first.is_path && end < u32::MAX).then_some(end);
    Err(failed(what).help(advice(next, after)))
}

/// How to make a second half.
fn advice(seed: u64, first_sample: Option<u32>) -> String {
    let after = first_sample.map_or_else(String::new, |first| {
        format!(", or with samples that follow those of the other: --first-sample {first}")
    });
    format!("render one of them with another seed, such as --seed {seed}{after}")
}

/// The samples of a picture by this program, as its texts tell.
struct Samples {
    seed: String,
    /// The sampler and the frame, which change the random numbers as seeds do.
    source: [Option<String>; 2],
    /// The numbers of each pixel's samples.
    numbers: Range<u32>,
    /// Whether paths made the picture, which can begin at any sample.
    is_path: bool,
}

impl Samples {
    fn of(picture: &Decoded) -> Option<Samples> {
        let text = |key: &str| picture.metadata.iter().find(|(k, _)| k == key).map(|(_, text)| text.as_str());
        let seed = text("seed")?.to_owned();
        let first = text("first-sample").and_then(|first| first.parse().ok()).unwrap_or(0);
        // The most samples of a pixel: "16", "16 to 64", or "16 rays per pixel, sobol" in pictures without passes.
        let most = text(SAMPLES_TEXT).and_then(|samples| samples.rsplit(' ').next());
        let most = most.or_else(|| text("sampling").and_then(|sampling| sampling.split(' ').next()));
        let most = most.and_then(|most| most.parse().ok()).unwrap_or(u32::MAX);
        let source = ["sampler", "frame"].map(|key| text(key).map(str::to_owned));
        let is_path = text("integrator") == Some("path");
        Some(Samples { seed, source, numbers: first..u32::saturating_add(first, most), is_path })
    }

    /// Whether samples belong to both.
    fn meet(&self, other: &Samples) -> bool {
        self.seed == other.seed
            && self.source == other.source
            && self.numbers.start.max(other.numbers.start) < self.numbers.end.min(other.numbers.end)
    }

    /// The numbers of the samples in words.
    fn words(&self) -> String {
        let Range { start, end } = self.numbers;
        match end {
            u32::MAX => format!("samples from {start} on"),
            end if end - start == 1 => format!("sample {start}"),
            end => format!("samples {start} to {}", end - 1),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use canaletto_io::picture::{EncodeSettings, Image, PictureFormat, decode};

    fn picture(texts: &[(&str, &str)]) -> Decoded {
        let texts: Vec<_> = texts.iter().map(|(key, text)| ((*key).to_owned(), (*text).to_owned())).collect();
        let image = Image::from_rgb(1, 1, [[0.5; 3]].into_iter());
        let exr = PictureFormat::all().find(|format| format.extension() == "exr").unwrap();
        decode(&exr.encode_image(&image, Default::default(), &EncodeSettings::default(), &texts).unwrap()).unwrap()
    }

    /// Whether two pictures are refused, and with which words.
    fn refused(a: &[(&str, &str)], b: &[(&str, &str)], same_colors: bool) -> Option<[String; 2]> {
        let failure = check([Path::new("a"), Path::new("b")], [&picture(a), &picture(b)], || same_colors).err()?;
        let Failure::Message { message, help: Some(help), .. } = failure else { panic!("{failure:?}") };
        Some([message, help])
    }

    #[test]
    fn seeds_and_numbers_of_samples_tell_halves() {
        let path = [("integrator", "path"), ("seed", "6"), ("samples", "16")];
        let other_seed = [("integrator", "path"), ("seed", "7"), ("samples", "16")];
        let after = [("seed", "6"), ("first-sample", "16"), ("samples", "16")];
        let across = [("seed", "6"), ("first-sample", "15"), ("samples", "8 to 20")];
        let other_sampler = [("seed", "6"), ("samples", "16"), ("sampler", "independent")];
        let without_passes = [("seed", "6"), ("sampling", "9 rays per pixel, regular")];
        for other in [&other_seed[..], &after, &other_sampler] {
            assert_eq!(refused(&path, other, true), None, "{other:?}");
        }
        let [message, help] = refused(&path, &path, false).unwrap();
        assert_eq!(message, "a and b aren't independent: both have samples 0 to 15 of seed 6");
        assert!(help.contains("--seed 7") && help.contains("--first-sample 16"), "{help}");
        let [message, help] = refused(&path, &across, false).unwrap();
        assert!(message.contains("they have samples 0 to 15 and samples 15 to 34 of one seed, 6"), "{message}");
        assert!(help.contains("--first-sample 35"), "{help}");
        assert_eq!(refused(&across, &path, false).map(|[message, _]| message.contains("15 to 34")), Some(true));
        let [message, help] = refused(&without_passes, &path, false).unwrap();
        assert!(message.contains("samples 0 to 8 and") && !help.contains("--first-sample"), "{message} {help}");
    }

    #[test]
    fn pictures_of_other_programs_must_differ() {
        assert_eq!(refused(&[], &[], false), None);
        assert_eq!(refused(&[], &[("seed", "1")], false), None);
        let [message, help] = refused(&[], &[("seed", "1")], true).unwrap();
        assert!(message.contains("all their colours are equal") && help.contains("--seed 1"), "{message} {help}");
    }
}
