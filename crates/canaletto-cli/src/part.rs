//! `--part K/N`: a part of a growing picture, which `canaletto merge` joins with the others to the bytes of one render.

use crate::failure::Failure;
use crate::frames::Frames;
use canaletto::Named;
use canaletto::render::{Aov, Job};
use canaletto::scene::Sampling;
use canaletto_io::picture::MAX_PIXELS;
use clap::{Args, ValueEnum};
use serde::{Deserialize, Serialize};
use std::fmt;

/// Flags about parts.
#[derive(Args, Clone, Debug, Default)]
pub(crate) struct PartFlags {
    /// Renders part K of N of a growing picture into an EXR, for canaletto merge
    ///
    /// The parts may be made by any machines in any order. Denoising and tone come when they are merged, and the bytes
    /// are those of one render. A part that is there already is kept. With --split frames a part is some of the frames.
    #[arg(long, value_name = "K/N", value_parser = part, help_heading = "Sampling")]
    pub part: Option<Part>,

    /// Sets what the parts share among them [default: samples]
    #[arg(long, value_name = "HOW", help_heading = "Sampling")]
    pub split: Option<Split>,
}

/// A part of N, counted from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Part {
    number: u32,
    count: u32,
}

/// What the parts of a picture share among them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum Split {
    /// Each part has all pixels, and some of their samples
    #[default]
    Samples,
    /// Each part has some rows of pixels, and all of their samples. Where parts outnumber the eighths of rows, each has
    /// some of the samples
    Tiles,
    /// Each part has some frames of numbered pictures. They need no merge, unless a film is made of them
    Frames,
}

fn part(text: &str) -> Result<Part, String> {
    let numbers = text.split_once('/').and_then(|(k, n)| Some((k.trim().parse().ok()?, n.trim().parse().ok()?)));
    match numbers {
        Some((number, count)) if (1..=count).contains(&number) => Ok(Part { number, count }),
        _ => Err("write K/N, such as 3/8 for the third of eight parts".into()),
    }
}

impl fmt::Display for Part {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.number, self.count)
    }
}

/// The samples and pixels of a part, as its file tells.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Cut {
    /// The number of the first sample, and the number after the last one.
    pub samples: [u32; 2],
    /// x, y, width and height of the pixels in the camera's picture.
    pub area: [u32; 4],
    /// The same of the whole picture.
    pub of_samples: [u32; 2],
    pub of_area: [u32; 4],
}

/// Parts begin and end at multiples of this many rows.
const ROWS: u32 = 8;
/// Each part has about this many blocks of samples, so that parts are about equal.
const BLOCKS: u32 = 8;

impl PartFlags {
    /// The flags of a part.
    pub(crate) fn one(number: u32, count: u32, split: Split) -> PartFlags {
        PartFlags { part: Some(Part { number, count }), split: Some(split) }
    }

    /// Whether the render is a part of a picture.
    pub(crate) fn is_of_picture(&self) -> bool {
        self.part.is_some() && self.split != Some(Split::Frames)
    }

    /// Checks that the flags suit each other, and the frames that are asked for.
    pub(crate) fn check(&self, has_frames: bool) -> Result<(), Failure> {
        match self {
            PartFlags { part: None, split: Some(_) } => Err(Failure::usage(
                "--split says what parts share, but no part \
                is asked for",
            )
            .help("add --part, such as --part 1/8")),
            PartFlags { part: Some(part), split: Some(Split::Frames) } if !has_frames => {
                let failure = Failure::usage(format!("--part {part} --split frames: there is one picture"));
                Err(failure.help("add --frames, such as --frames all, or leave --split out"))
            }
            _ => Ok(()),
        }
    }

    /// The frames of the part.
    pub(crate) fn frames(&self, all: Frames) -> Result<Frames, Failure> {
        let (Some(part), Some(Split::Frames)) = (self.part, self.split) else { return Ok(all) };
        let count = all.count() as u32; // A run has at most a million frames.
        let [from, to] = share(part, count);
        let frame = |index: u32| all.first + index * all.step;
        match from == to {
            true => Err(too_many(part, &format!("there are {count} frames"))),
            false => Ok(Frames { first: frame(from), last: frame(to - 1), ..all }),
        }
    }

    /// The part of a job.
    pub(crate) fn cut(&self, job: &Job) -> Result<Option<Cut>, Failure> {
        let Some(part) = self.part else { return Ok(None) };
        let (area, first, count) = (job.window(), job.first_sample, job.film.sampling.count());
        let whole = Cut { samples: [first, first + count], area, of_samples: [first, first + count], of_area: area };
        Ok(Some(match self.split.unwrap_or_default() {
            Split::Frames => return Ok(None),
            Split::Samples => {
                let Some(samples) = share_of_samples(part, count) else {
                    return Err(too_many(part, &format!("the picture has {count} samples")));
                };
                Cut { samples: samples.map(|at| first + at), ..whole }
            }
            Split::Tiles => {
                let [x, y, width, height] = area;
                let bands = height.div_ceil(ROWS);
                let (band, of_band) = part.of_bands(bands);
                let Some(samples) = share_of_samples(of_band, count) else {
                    let words = format!("the picture has {count} samples of {bands} bands of {ROWS} rows");
                    return Err(too_many(part, &words));
                };
                let [from, to] = share(band, bands).map(|at| (at * ROWS).min(height));
                Cut { samples: samples.map(|at| first + at), area: [x, y + from, width, to - from], ..whole }
            }
        }))
    }
}

impl Part {
    /// The bands of a part, and its part of their samples. Each band is of one part, or of several that share its
    /// samples.
    fn of_bands(self, bands: u32) -> (Part, Part) {
        let Part { number, count } = self;
        if count <= bands {
            return (self, Part { number: 1, count: 1 });
        }
        let [index, bands, count] = [number - 1, bands, count].map(u64::from);
        let band = index * bands / count;
        let [start, end] = [band, band + 1].map(|band| (band * count).div_ceil(bands));
        let part = |index: u64, count: u64| Part { number: index as u32 + 1, count: count as u32 };
        (part(band, bands), part(index - start, end - start))
    }
}

/// The share of a part of `count` samples: the first, and the one after the last. None if there are fewer than parts.
fn share_of_samples(part: Part, count: u32) -> Option<[u32; 2]> {
    // The largest power of two of samples of which each part gets some.
    let block = (count / part.count.saturating_mul(BLOCKS)).max(1);
    let block = 1 << block.ilog2();
    let [from, to] = share(part, count.div_ceil(block)).map(|at| (at * block).min(count));
    (from < to).then_some([from, to])
}

fn too_many(part: Part, what: &str) -> Failure {
    Failure::usage(format!("--part {part}: there are fewer parts than that: {what}")).help("make fewer parts")
}

/// The things of a part, of `all`: from the first to the one after the last.
fn share(part: Part, all: u32) -> [u32; 2] {
    [part.number - 1, part.number].map(|k| (u64::from(all) * u64::from(k) / u64::from(part.count)) as u32)
}

impl Cut {
    /// Whether the part lies in a picture that can be.
    fn is_sound(&self) -> bool {
        let within = |from: u32, size: u32, [start, whole]: [u32; 2]| {
            size > 0 && from >= start && u64::from(from) + u64::from(size) <= u64::from(start) + u64::from(whole)
        };
        let ([x, y, width, height], [left, top, all_width, all_height]) = (self.area, self.of_area);
        let ([first, end], [start, stop]) = (self.samples, self.of_samples);
        let is_possible = u64::from(all_width) * u64::from(all_height) <= MAX_PIXELS && stop <= Sampling::MAX_SAMPLES;
        is_possible
            && within(x, width, [left, all_width])
            && within(y, height, [top, all_height])
            && start <= first
            && first < end
            && end <= stop
    }

    /// The part that the texts of a file tell, if they do.
    pub(crate) fn of_texts(texts: &[(String, String)]) -> Option<Cut> {
        let (_, text) = texts.iter().find(|(key, _)| key == PART)?;
        serde_json::from_str(text).ok().filter(Cut::is_sound)
    }

    /// Its samples and rows in words.
    pub(crate) fn words(&self) -> String {
        let range = |[from, end]: [u32; 2]| format!("{from} to {}", end - 1);
        let rows = |[_, y, _, height]: [u32; 4]| range([y, y + height]);
        let [samples, of_samples] = [self.samples, self.of_samples].map(range);
        format!("samples {samples} of {of_samples}, rows {} of {}", rows(self.area), rows(self.of_area))
    }

    /// Whether it has the first samples of its pixels.
    pub(crate) fn is_first(&self) -> bool {
        self.samples[0] == self.of_samples[0]
    }

    /// The job of the part.
    pub(crate) fn of_job(&self, job: &Job) -> Job {
        let mut own = job.clone();
        (own.first_sample, own.end_sample) = (self.samples[0], Some(self.samples[1]));
        own.film.crop = Some(self.area);
        own
    }
}

/// Checks that a job can be made in parts.
pub(crate) fn check(job: &Job) -> Result<(), Failure> {
    let why = [
        (job.noise.is_some(), "--noise", "where pixels stop depends on their neighbours in all samples"),
        (job.film.alpha, "--background", "the alpha of a picture is made of all of its samples"),
        (job.film.sampling == Sampling::Center, "--samples 1", "a single sample has no parts"),
    ];
    why.into_iter().find(|(is_given, ..)| *is_given).map_or(Ok(()), |(_, flag, why)| Err(not_in_parts(flag, why)))
}

/// The error of a flag that parts can't have.
pub(crate) fn not_in_parts(flag: &str, why: &str) -> Failure {
    Failure::usage(format!("--part: {flag} can't be had in parts, since {why}"))
        .help("leave it out, or render the picture whole")
}

/// Whether parts of a picture may be asked for a layer: merging makes it, or the first samples do.
pub(crate) fn is_in_parts(aov: Aov) -> bool {
    aov.is_of_denoising() || aov.is_of_samples() || aov.is_of_first_hit() && aov != Aov::Alpha
}

/// The layers that a part renders, of those that the whole picture has.
pub(crate) fn layers_of_part(cut: &Cut, aovs: &[Aov]) -> Vec<Aov> {
    let is_made = |aov: &Aov| aov.is_half() || cut.is_first() && ![Aov::Samples, Aov::Noisy].contains(aov);
    aovs.iter().copied().filter(is_made).collect()
}

/// The keys of the texts of a part's file: the part, the texts of the whole picture in their order, and its layers.
pub(crate) const PART: &str = "part";
pub(crate) const PICTURE_TEXTS: &str = "picture-texts";
const LAYERS: &str = "layers";

/// The texts of a part's file, besides those by which it is compared. `texts` are those of the whole picture.
pub(crate) fn texts_of_part(cut: &Cut, texts: &[(String, String)], aovs: &[Aov]) -> Vec<(String, String)> {
    // Structs of numbers and lists of texts are JSON.
    let json = |value: serde_json::Result<String>| value.unwrap_or_default();
    let mut own = vec![
        (PART.into(), json(serde_json::to_string(cut))),
        (PICTURE_TEXTS.into(), json(serde_json::to_string(texts))),
    ];
    if !aovs.is_empty() {
        own.push((LAYERS.into(), aovs.iter().map(|aov| aov.name()).collect::<Vec<_>>().join(",")));
    }
    own
}

/// The layers of the whole picture, as the texts of a part tell.
pub(crate) fn layers_of_texts(texts: &[(String, String)]) -> Vec<Aov> {
    let told = texts.iter().find(|(key, _)| key == LAYERS);
    told.map_or_else(Vec::new, |(_, names)| names.split(',').filter_map(Aov::from_name).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use canaletto::camera::Camera;
    use canaletto::scene::{Extrinsics, FilmSettings, Intrinsics, PathSettings};

    /// Parts of frames follow each other, with the step of all.
    #[test]
    fn parts_of_frames_are_all_frames() {
        for (first, last, step, count) in [(1, 100, 1, 8), (3, 50, 4, 5), (7, 7, 1, 1), (0, 999_999, 1, 1000)] {
            let all = Frames::new(first, last, step).unwrap();
            let parts = (1..=count).flat_map(|number| {
                let flags = PartFlags { part: Some(Part { number, count }), split: Some(Split::Frames) };
                flags.frames(all).unwrap().iter()
            });
            assert!(parts.eq(all.iter()), "{all}");
        }
        let flags = PartFlags { part: Some(Part { number: 2, count: 3 }), split: Some(Split::Frames) };
        assert!(flags.frames(Frames::one(4)).is_err());
        assert!(flags.check(false).is_err() && flags.check(true).is_ok());
    }

    /// The parts of any number follow each other, and are about equal.
    #[test]
    fn parts_are_the_whole() {
        let intrinsics = Intrinsics { width: 30, height: 100, ..Intrinsics::default() };
        let camera = Camera::new(&intrinsics, &Extrinsics::default()).unwrap();
        for (samples, count) in [(64, 8), (64, 3), (1000, 7), (4096, 10_000), (5, 5), (65_536, 10_000)] {
            let film = FilmSettings { sampling: Sampling::Sampled(samples), ..FilmSettings::default() };
            let job = Job::new(camera.clone(), film, PathSettings::DEFAULT);
            for (split, possible) in [(Split::Samples, samples), (Split::Tiles, 13 * samples)] {
                // The next row and sample.
                let (mut row, mut sample) = (0, 0);
                let (mut least, mut most) = (u32::MAX, 0);
                for number in 1..=count {
                    let flags = PartFlags { part: Some(Part { number, count }), split: Some(split) };
                    let Ok(Some(cut)) = flags.cut(&job) else {
                        assert!(count > possible / 2, "{samples} {count}");
                        continue;
                    };
                    let ([from, to], [_, top, _, height]) = (cut.samples, cut.area);
                    assert_eq!((top, from), (row, sample), "{samples} {count}");
                    (least, most) = (least.min((to - from) * height), most.max((to - from) * height));
                    (row, sample) = if to == samples { (row + height, 0) } else { (row, to) };
                }
                assert_eq!((row, sample), (100, 0), "{samples} {count}");
                if split == Split::Samples && samples > 8 * count {
                    assert!(f64::from(most) <= 1.3 * f64::from(least), "{samples} {count}: {least} to {most}");
                }
            }
        }
    }
}
