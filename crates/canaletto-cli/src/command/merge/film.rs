//! Numbered pictures as a film in one file, with the bytes of a render of the film.

use super::{MergeFlags, failed};
use crate::complete::FINGERPRINT;
use crate::exit::Exit;
use crate::failure::{Failure, eprint_line, reason};
use crate::format::plural;
use crate::frames::Frames;
use crate::interrupt;
use crate::output::{Output, film_failed};
use crate::partial::UNFINISHED;
use crate::sample_file::{SCENE, SCENE_DIGEST, text_of};
use canaletto::scene::Transfer;
use canaletto_io::movie::{Movie, MovieFormat, MovieSettings, Rate};
use canaletto_io::picture::{Decoded, decode};
use canaletto_io::source::Timeline;
use rayon::prelude::*;
use std::fs;
use std::path::{Path, PathBuf};

/// A frame's file without its pixels.
struct FrameFile<'f> {
    path: &'f Path,
    number: u32,
    size: [u32; 2],
    has_alpha: bool,
    transfer: Transfer,
    texts: Vec<(String, String)>,
}

/// The texts of a film that aren't those of its frames.
const OF_FRAMES: [&str; 4] = ["frame", FINGERPRINT, SCENE_DIGEST, "Software"];

/// Makes the film of numbered pictures.
pub(super) fn film(
    flags: &MergeFlags,
    paths: &[PathBuf],
    output: &Output,
    format: MovieFormat,
) -> Result<Exit, Failure> {
    let mut files = paths.par_iter().map(|path| read(path)).collect::<Result<Vec<_>, Failure>>()?;
    files.sort_by_key(|file| file.number);
    let Some(first) = files.first() else { return Err(Failure::new(Exit::PartMissing, "there is no frame")) };
    files.iter().skip(1).try_for_each(|file| compare(first, file))?;
    let frames = check_numbers(&files, flags.partial)?;
    let mut metadata: Vec<(String, String)> = first.texts.clone();
    let fps = flags.fps.or_else(|| text_of(&metadata, "fps")?.parse().ok());
    metadata.retain(|(key, _)| !OF_FRAMES.contains(&key.as_str()));
    metadata.push(("frames".into(), frames.to_string()));
    let rate = Rate::new(fps.unwrap_or(Timeline::DEFAULT_FPS));
    let settings = MovieSettings {
        width: first.size[0],
        height: first.size[1],
        rate,
        frames: files.len() as u32, // A run has at most a million frames.
        transfer: first.transfer,
        alpha: first.has_alpha,
        compression: output.settings.compression,
        metadata,
    };
    let path = output.path(0);
    let wrong = |error| film_failed(output.format, error);
    let mut film = Movie::begin(format, &path, output.options(), settings).map_err(wrong)?;
    interrupt::remove_on_leaving(film.temporary());
    for file in &files {
        if interrupt::stops() {
            return Err(Failure::new(Exit::Interrupted, "interrupted; nothing is written"));
        }
        film.add(&decoded(file.path)?.image).map_err(wrong)?;
    }
    film.finish().map_err(wrong)?;
    interrupt::remove_on_leaving(None);
    if !flags.quiet {
        let count = plural(files.len() as u64, "frame");
        eprint_line(&format!("{}: {count}, {} a second", path.display(), rate.fps()));
    }
    Ok(Exit::Done)
}

fn decoded(path: &Path) -> Result<Decoded, Failure> {
    let unreadable = |message: &str| failed(path, Exit::PartUnreadable, message);
    let bytes = fs::read(path).map_err(|error| unreadable(&reason(&error)))?;
    decode(&bytes).map_err(|error| unreadable(&error.to_string()))
}

/// Reads a frame's file.
fn read(path: &Path) -> Result<FrameFile<'_>, Failure> {
    let unreadable = |message: &str| failed(path, Exit::PartUnreadable, message);
    let picture = decoded(path)?;
    let texts = picture.metadata;
    let number = text_of(&texts, "frame").and_then(|frame| frame.parse().ok());
    let Some(number) = number.filter(|_| text_of(&texts, "layer").is_none()) else {
        return Err(unreadable("it is no frame that canaletto render --frames made"));
    };
    if text_of(&texts, UNFINISHED).is_some() {
        return Err(unreadable("it was interrupted, and isn't whole").help("the command that made it goes on with it"));
    }
    if picture.is_changed {
        return Err(failed(path, Exit::PartChanged, "its pixels aren't those that were written")
            .help("copy it again, or render this frame again"));
    }
    if !picture.display_referred {
        return Err(unreadable("it holds linear light, and a film has the colours of a display")
            .help("render the frames as PNG, such as -o shot.####.png"));
    }
    let size = [picture.image.width, picture.image.height];
    let has_alpha = picture.image.channel("A").is_some();
    Ok(FrameFile { path, number, size, has_alpha, transfer: picture.transfer.unwrap_or(Transfer::Srgb), texts })
}

/// Checks that two frames are of one film.
fn compare(first: &FrameFile, file: &FrameFile) -> Result<(), Failure> {
    let [a, b] = [file, first].map(|file| file.path.display());
    let refuse = |exit: Exit, what: &str| Err(Failure::new(exit, format!("{a} is of another film than {b}: {what}")));
    if file.size != first.size {
        let [width, height] = file.size;
        let [first_width, first_height] = first.size;
        let what = format!("its size is {width} x {height}, not {first_width} x {first_height}");
        return refuse(Exit::PartSetting, &what);
    }
    let of = |file: &FrameFile, key: &str| text_of(&file.texts, key).unwrap_or_else(|| "none".to_owned());
    let keys = || first.texts.iter().chain(&file.texts).map(|(key, _)| key.as_str());
    // The fingerprint is that of one frame, as it counts where the camera is.
    let is_compared = |key: &&str| !["frame", SCENE, FINGERPRINT, SCENE_DIGEST].contains(key);
    for key in ["Software", SCENE_DIGEST].into_iter().chain(keys().filter(is_compared)) {
        let (own, others) = (of(file, key), of(first, key));
        match key {
            _ if own == others => {}
            "Software" => {
                return refuse(Exit::PartVersion, &format!("it was made by {own}, and the other one by {others}"));
            }
            SCENE_DIGEST => {
                return refuse(
                    Exit::PartScene,
                    "a file of the scene has changed between them, or a value that is set in it",
                );
            }
            _ => return refuse(Exit::PartSetting, &format!("its {key} is {own}, not {others}")),
        }
    }
    match file.has_alpha == first.has_alpha {
        true => Ok(()),
        false => refuse(Exit::PartSetting, "only one of them has alpha"),
    }
}

/// Checks that each frame is there once, and returns the range. The frames are in their order.
fn check_numbers(files: &[FrameFile], is_partial: bool) -> Result<Frames, Failure> {
    let gaps = || files.windows(2).map(|pair| (&pair[0], &pair[1]));
    if let Some((a, b)) = gaps().find(|(a, b)| a.number == b.number) {
        let (a, b, number) = (a.path.display(), b.path.display(), a.number);
        return Err(Failure::new(Exit::PartDouble, format!("{a} and {b} are both frame {number}")));
    }
    let step = gaps().map(|(a, b)| b.number - a.number).min().unwrap_or(1);
    let [first, last] = [&files[0], &files[files.len() - 1]].map(|file| file.number);
    let missing: Vec<String> = gaps()
        .filter(|(a, b)| b.number - a.number > step)
        .map(|(a, b)| format!("{} to {}", a.number + 1, b.number - 1))
        .collect();
    if missing.is_empty() || is_partial {
        return Frames::new(first, last, step).map_err(|why| Failure::new(Exit::PartUnreadable, why));
    }
    let some = missing.iter().take(5).cloned().collect::<Vec<_>>().join(", ");
    let more = if missing.len() > 5 { format!(", and {} more ranges", missing.len() - 5) } else { String::new() };
    Err(Failure::new(Exit::PartMissing, format!("frames are missing: {some}{more}"))
        .help("render them, or give --partial for the film of the frames that are there"))
}
