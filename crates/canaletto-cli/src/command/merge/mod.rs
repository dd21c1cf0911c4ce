//! `canaletto merge`: the parts of a picture or the frames of a film as one, with the bytes of one render.

mod film;
mod join;

use crate::command_files::CommandFiles;
use crate::denoiser::{Denoiser, FEATURES, lacks, of_rendering, told};
use crate::digest::{FileChange, changed_file};
use crate::exit::Exit;
use crate::failure::{Failure, eprint_line, reason};
use crate::format::{count, plural};
use crate::frames::fps;
use crate::output::{Output, OutputFlags, unfit};
use crate::output_format::Format;
use crate::part::{Cut, PART, PICTURE_TEXTS, layers_of_texts};
use crate::partial::UNFINISHED;
use crate::sample_file::{SCENE, SCENE_DIGEST, SCENE_FILES, nameless, picture_texts, sample_texts, text_of};
use crate::source::on_threads;
use crate::told_developing::{METERED_EXPOSURE, ToldDeveloping};
use canaletto::film::{Layer, Picture};
use canaletto::render::Aov;
use canaletto::scene::Developing;
use canaletto_io::picture::{
    Compression, EncodeSettings, PictureFormat, Rendered, SAMPLES_TEXT, ScanLineError, ScanLineFile, Window,
};
use clap::{Args, ValueEnum};
use join::{Made, join};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Joins the parts of a picture that `render --part` made, or numbered pictures to a film.
///
/// The order of the parts doesn't matter, and the bytes are those of one render of the whole picture. Denoising and
/// tone are those that the parts were rendered with. Parts may be joined to larger parts first.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct MergeFlags {
    /// The parts, or folders with nothing but parts
    #[arg(value_name = "PART", required = true)]
    pub parts: Vec<PathBuf>,

    #[command(flatten)]
    pub output: OutputFlags,

    /// Sets the frames per second of a film [default: the frames', or 25]
    #[arg(long, allow_hyphen_values = true, value_name = "N", value_parser = fps)]
    pub fps: Option<f64>,

    /// Writes a larger part, for another merge, in place of the picture
    #[arg(long)]
    pub as_part: bool,

    /// Makes the picture of the parts that are there, and says how much of it that is
    #[arg(long, conflicts_with = "as_part")]
    pub partial: bool,

    /// Sets the number of threads [default: all processors]
    #[arg(long, value_name = "N")]
    pub threads: Option<u16>,

    /// Prints errors only
    #[arg(short, long)]
    pub quiet: bool,
}

const EXAMPLES: &str = "\
Examples:
  canaletto render scenes/path.kdl --samples 64 --part 1/2 -o part-1.exr
  canaletto render scenes/path.kdl --samples 64 --part 2/2 -o part-2.exr
  canaletto merge part-1.exr part-2.exr -o room.png
  canaletto render scenes/chapter/bouncing-ball.kdl --frames all -o frames/ball.####.png --mkdir
  canaletto merge frames -o ball.gif";

/// Runs the command.
pub(crate) fn run(flags: &MergeFlags) -> Result<Exit, Failure> {
    on_threads(flags.threads, || merge(flags))?
}

/// A part, whose pixels are in its file.
struct PartFile<'f> {
    path: &'f Path,
    file: ScanLineFile,
    cut: Cut,
    /// The texts by which parts are compared.
    texts: Vec<(String, String)>,
}

/// The texts that differ from part to part.
const OWN: [&str; 3] = [PART, SAMPLES_TEXT, UNFINISHED];

fn merge(flags: &MergeFlags) -> Result<Exit, Failure> {
    if flags.output.output.is_none() {
        return Err(Failure::usage("there is no --output").help("name the file of the whole, such as -o room.png"));
    }
    let output = Output::new(&flags.output, "", false, false)?;
    let file = output.path(0);
    if flags.as_part && output.format != Format::Picture(PictureFormat::Exr) {
        return Err(Failure::usage(format!("--output {}: end the name in .exr", file.display())));
    }
    let paths = files_of(&flags.parts)?;
    let files = CommandFiles::default().reads("PART", &paths).writes("--output", [file.clone()]);
    files.check()?;
    flags.output.folder.make_folders(&files)?;
    output.check([file.clone()])?;
    let format = match output.format {
        Format::Picture(format) => format,
        Format::Movie(format) => return film::film(flags, &paths, &output, format),
    };
    let mut parts = paths.iter().map(|path| read(path)).collect::<Result<Vec<_>, Failure>>()?;
    parts.iter().skip(1).try_for_each(|part| compare(&parts[0], part))?;
    parts.sort_by_key(|part| (part.cut.samples[0], part.cut.area[1]));
    let whole = extent(&parts, flags.as_part);
    check_cover(&parts, &whole, flags.partial)?;
    if !output.format.has_layers() && !layers_of_texts(&parts[0].texts).is_empty() {
        let name = output.format.short_name();
        return Err(Failure::usage(format!("--output {}: the parts have layers, and {name} has none", file.display()))
            .help("end the name in .exr"));
    }
    let made = join(&parts, whole, flags.partial)?;
    let is_whole = made.share == 1.0;
    let bytes = match flags.as_part {
        true => encode_part(made, &parts[0], whole)?,
        false => encode_picture(made, (format, &output.settings), &parts[0], &whole, flags)?,
    };
    output.write(&file, &bytes)?;
    if !flags.quiet {
        let share = if is_whole { "" } else { ", of parts that are there" };
        let parts = plural(parts.len() as u64, "part");
        let [_, _, width, height] = whole.area;
        let [from, to] = whole.samples;
        let samples = count((to - from).into());
        eprint_line(&format!(
            "{}: {width} x {height} pixels, {samples} samples per pixel, of {parts}{share}",
            file.display()
        ));
    }
    Ok(Exit::Done)
}

/// The files of the parts. Those of a folder are in the order of their names, without what unfinished renders left.
fn files_of(parts: &[PathBuf]) -> Result<Vec<PathBuf>, Failure> {
    let mut files = Vec::new();
    for part in parts {
        if !part.is_dir() {
            files.push(part.clone());
            continue;
        }
        let unreadable = |error: io::Error| failed(part, Exit::PartUnreadable, &reason(&error));
        let mut own = Vec::new();
        for entry in fs::read_dir(part).map_err(unreadable)? {
            let name = entry.map_err(unreadable)?.file_name();
            let text = name.to_string_lossy();
            let extension = Path::new(&*text).extension().map(|extension| extension.to_string_lossy().to_lowercase());
            let is_picture = extension.is_some_and(|extension| Format::of_extension(&extension).is_some());
            let is_rest = text.starts_with('.') || [".checkpoint", ".partial"].iter().any(|rest| text.contains(rest));
            if is_picture && !is_rest {
                own.push(part.join(&name));
            }
        }
        if own.is_empty() {
            return Err(failed(part, Exit::PartMissing, "the folder has no parts"));
        }
        own.sort();
        files.extend(own);
    }
    Ok(files)
}

impl PartFile<'_> {
    /// A text of the file.
    fn text(&self, key: &str) -> Option<String> {
        text_of(&self.texts, key)
    }

    /// The width and height of the camera's picture.
    fn whole_size(&self) -> [u32; 2] {
        let size = self.text("size");
        let size = size.as_deref().and_then(|text| text.split_once(' '));
        let size = size.and_then(|(width, height)| Some([width.parse().ok()?, height.parse().ok()?]));
        let [x, y, width, height] = self.cut.of_area;
        size.unwrap_or([x.saturating_add(width), y.saturating_add(height)])
    }
}

/// An error of a part's file.
fn failed(path: &Path, exit: Exit, message: &str) -> Failure {
    Failure::new(exit, format!("{}: {message}", path.display()))
}

/// Why a file can't be read.
fn why(error: &ScanLineError) -> String {
    match error {
        ScanLineError::Io(error) => reason(error),
        other => other.to_string(),
    }
}

/// Reads a part without its pixels.
fn read(path: &Path) -> Result<PartFile<'_>, Failure> {
    let unreadable = |message: &str| failed(path, Exit::PartUnreadable, message);
    let file = ScanLineFile::open(path).map_err(|error| unreadable(&why(&error)))?;
    let texts = file.texts();
    let Some(cut) = Cut::of_texts(texts) else {
        return Err(unreadable("it is no part of a picture that canaletto render --part made"));
    };
    if text_of(texts, UNFINISHED).is_some() {
        return Err(unreadable("it was interrupted, and isn't whole").help("the command that made it goes on with it"));
    }
    if file.size() != cut.area[2..] {
        return Err(unreadable("its size isn't the one that its text says"));
    }
    let texts = texts.iter().filter(|(key, _)| !OWN.contains(&key.as_str())).cloned().collect();
    Ok(PartFile { path, file, cut, texts })
}

/// Checks that two parts are of one picture.
fn compare(first: &PartFile, part: &PartFile) -> Result<(), Failure> {
    let of = PartFile::text;
    let refuse = |exit: Exit, what: String| {
        let [a, b] = [part, first].map(|part| part.path.display());
        Err(Failure::new(exit, format!("{a} is of another picture than {b}: {what}")))
    };
    if of(first, "Software") != of(part, "Software") {
        let [a, b] = [part, first].map(|part| of(part, "Software").unwrap_or_default());
        return refuse(Exit::PartVersion, format!("it was made by {a}, and the other one by {b}"));
    }
    if of(first, SCENE_DIGEST) != of(part, SCENE_DIGEST) {
        let [now, then] = [part, first].map(|part| of(part, SCENE_FILES).unwrap_or_default());
        let what = match changed_file(&now, &then) {
            Some(FileChange::Edited(name)) => format!("{name} has changed between them"),
            Some(FileChange::Added(name)) => format!("its scene names {name}, and the other one doesn't"),
            Some(FileChange::Removed(name)) => format!("its scene doesn't name {name}, and the other one does"),
            None => "the scenes differ".to_owned(),
        };
        return refuse(Exit::PartScene, what);
    }
    // The scene counts by its contents. What the others follow from comes first, and what follows from others last.
    let is_compared = |key: &&str| ![PICTURE_TEXTS, SCENE, SCENE_FILES, METERED_EXPOSURE].contains(key);
    let keys = first.texts.iter().chain(&part.texts).map(|(key, _)| key.as_str()).filter(is_compared);
    for key in ["integrator", "size", "camera", "seed", "tone"].into_iter().chain(keys).chain([METERED_EXPOSURE]) {
        let [a, b] = [part, first].map(|part| of(part, key).unwrap_or_else(|| "none".to_owned()));
        if a != b {
            return refuse(Exit::PartSetting, format!("its {key} is {a}, not {b}"));
        }
    }
    if (part.cut.of_samples, part.cut.of_area) != (first.cut.of_samples, first.cut.of_area)
        || nameless(picture_texts(&part.texts)) != nameless(picture_texts(&first.texts))
    {
        return refuse(Exit::PartSetting, "the whole pictures differ".into());
    }
    Ok(())
}

/// What the parts are to make: the whole picture, or the box around them.
fn extent(parts: &[PartFile], as_part: bool) -> Cut {
    let first = parts[0].cut;
    if !as_part {
        return Cut { samples: first.of_samples, area: first.of_area, ..first };
    }
    let all = || parts.iter().map(|part| part.cut);
    let low = |of: fn(&Cut) -> u32| all().map(|cut| of(&cut)).min().unwrap_or(0);
    let high = |of: fn(&Cut) -> u32| all().map(|cut| of(&cut)).max().unwrap_or(0);
    let [x, y] = [low(|cut| cut.area[0]), low(|cut| cut.area[1])];
    let [right, bottom] = [high(|cut| cut.area[0] + cut.area[2]), high(|cut| cut.area[1] + cut.area[3])];
    let samples = [low(|cut| cut.samples[0]), high(|cut| cut.samples[1])];
    Cut { samples, area: [x, y, right - x, bottom - y], ..first }
}

/// Whether two ranges have something in common.
fn meet(a: [u32; 2], b: [u32; 2]) -> bool {
    a[0] < b[1] && b[0] < a[1]
}

fn rows(cut: &Cut) -> [u32; 2] {
    [cut.area[1], cut.area[1] + cut.area[3]]
}

/// Checks that no samples are there twice, and none are missing.
fn check_cover(parts: &[PartFile], whole: &Cut, is_partial: bool) -> Result<(), Failure> {
    for (index, a) in parts.iter().enumerate() {
        for b in &parts[index + 1..] {
            let [left, right] = [a, b].map(|part| part.path.display());
            if a.cut == b.cut {
                return Err(Failure::new(Exit::PartDouble, format!("{left} and {right} are the same part")));
            }
            if meet(a.cut.samples, b.cut.samples) && meet(rows(&a.cut), rows(&b.cut)) {
                let [from, to] = [a.cut.samples[0].max(b.cut.samples[0]), a.cut.samples[1].min(b.cut.samples[1])];
                let message = format!("{left} and {right} have samples {from} to {} in common", to - 1);
                return Err(Failure::new(Exit::PartOverlap, message));
            }
        }
    }
    let missing = missing(parts, whole);
    if missing.is_empty() || is_partial {
        return Ok(());
    }
    let words = |([from, to], [top, bottom]): &([u32; 2], [u32; 2])| {
        format!("samples {from} to {} of rows {top} to {}", to - 1, bottom - 1)
    };
    let some: Vec<String> = missing.iter().take(5).map(words).collect();
    let more = if missing.len() > 5 { format!(", and {} more ranges", missing.len() - 5) } else { String::new() };
    Err(Failure::new(Exit::PartMissing, format!("parts are missing: {}{more}", some.join(", ")))
        .help("render them, or give --partial for the picture of the parts that are there"))
}

/// The ranges of samples and of rows that are missing.
fn missing(parts: &[PartFile], whole: &Cut) -> Vec<([u32; 2], [u32; 2])> {
    let mut edges: Vec<u32> = parts.iter().flat_map(|part| rows(&part.cut)).chain(rows(whole)).collect();
    edges.sort_unstable();
    edges.dedup();
    let mut missing: Vec<([u32; 2], [u32; 2])> = Vec::new();
    for band in edges.windows(2).map(|pair| [pair[0], pair[1]]) {
        let mut at = whole.samples[0];
        let of_band = parts.iter().filter(|part| meet(rows(&part.cut), band)).map(|part| part.cut.samples);
        for [from, to] in of_band.chain([[whole.samples[1], whole.samples[1]]]) {
            if from > at {
                // Bands that lack the same samples are one.
                match missing.iter_mut().find(|(samples, rows)| *samples == [at, from] && rows[1] == band[0]) {
                    Some((_, rows)) => rows[1] = band[1],
                    None => missing.push(([at, from], band)),
                }
            }
            at = at.max(to);
        }
    }
    missing
}

/// The bytes of a larger part.
fn encode_part(made: Made, first: &PartFile, cut: Cut) -> Result<Vec<u8>, Failure> {
    let mut picture = made.samples.picture();
    picture.layers = made.features;
    picture.layers.extend(made.samples.layers(&picture.pixels));
    picture.layers.extend(made.samples.half_layers());
    let mut texts = first.texts.clone();
    texts.retain(|(key, _)| key != "Software");
    texts.push((PART.to_owned(), serde_json::to_string(&cut).unwrap_or_default()));
    texts.extend(sample_texts(&made.samples));
    drop(made.samples);
    let window = Window { at: [cut.area[0] as i32, cut.area[1] as i32], whole: first.whole_size() };
    let settings = EncodeSettings { compression: Compression::Fast, window: Some(window), ..EncodeSettings::default() };
    let rendered = Rendered { picture: &picture, developing: Developing::default() };
    PictureFormat::Exr.encode(&rendered, &settings, &texts, &|| true).map_err(|e| unfit(&e))
}

/// The bytes of the picture, as one render writes it.
fn encode_picture(
    mut made: Made,
    (format, settings): (PictureFormat, &EncodeSettings),
    first: &PartFile,
    whole: &Cut,
    flags: &MergeFlags,
) -> Result<Vec<u8>, Failure> {
    let mut own = picture_texts(&first.texts);
    let has_layers = Format::Picture(format).has_layers();
    if !has_layers {
        own.retain(|(key, _)| ![SCENE_DIGEST, SCENE_FILES].contains(&key.as_str()));
    }
    let mut picture = made.samples.picture();
    if let Some(colors) = made.colors.take() {
        picture.pixels = colors;
    }
    let asked = layers_of_texts(&first.texts);
    picture.layers = asked.iter().filter_map(|aov| made.layer(*aov, &picture)).collect();
    if let Some(denoiser) = text_of(&own, "denoiser").and_then(|name| Denoiser::from_str(&name, false).ok())
        && made.share == 1.0
    {
        denoise(denoiser, &mut picture, &made, &asked, flags)?;
    }
    let told = ToldDeveloping::of_texts(&own);
    let developing = Developing {
        exposure: told.exposure.unwrap_or_default(),
        tone: told.tone.unwrap_or_default(),
        transfer: told.transfer.unwrap_or_default(),
    };
    if has_layers && made.share == 1.0 {
        own.extend(sample_texts(&made.samples));
        let has = |layer: &Layer| picture.layers.iter().any(|own| own.name == layer.name);
        let more: Vec<Layer> = made.samples.layers(&picture.pixels).into_iter().filter(|layer| !has(layer)).collect();
        picture.layers.extend(more);
    }
    let share = made.share;
    drop(made);
    own.push(("frame".to_owned(), first.text("frame").unwrap_or_else(|| "0".to_owned())));
    if share < 1.0 {
        let percent = 100.0 * share;
        own.push((UNFINISHED.to_owned(), format!("merged of {percent:.1}% of its samples")));
        if !flags.quiet {
            eprint_line(&format!("{percent:.1}% of the picture's samples are there"));
        }
    }
    let [x, y, ..] = whole.area;
    let window = Window { at: [x as i32, y as i32], whole: first.whole_size() };
    let settings = EncodeSettings { window: Some(window), ..*settings };
    let rendered = Rendered { picture: &picture, developing };
    format.encode(&rendered, &settings, &own, &|| true).map_err(|e| unfit(&e))
}

/// Denoises the picture as one render does.
fn denoise(
    denoiser: Denoiser,
    picture: &mut Picture,
    made: &Made,
    asked: &[Aov],
    flags: &MergeFlags,
) -> Result<(), Failure> {
    let start = Instant::now();
    for aov in FEATURES.into_iter().chain([Aov::HalfA, Aov::HalfB]).filter(|aov| !asked.contains(aov)) {
        let layer = made.layer(aov, picture);
        picture.layers.extend(layer);
    }
    let noisy = of_rendering(picture, asked);
    if let Some(lacks) = lacks(&noisy).filter(|_| !flags.quiet) {
        eprint_line(&format!("note: {lacks}"));
    }
    let Some(denoised) = denoiser.run(noisy)? else {
        return Err(Failure::new(Exit::Interrupted, "interrupted; nothing is written"));
    };
    if !flags.quiet {
        eprint_line(&told(&denoised, start.elapsed()));
    }
    picture.pixels = denoised.color;
    Ok(())
}
