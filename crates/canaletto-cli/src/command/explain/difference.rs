//! `canaletto explain --diff`: the first term that differs between two explanations.

use super::ExplainFlags;
use super::subject::{Explained, Subject};
use crate::exit::Exit;
use crate::failure::Failure;
use crate::format::JSON_VERSION;
use crate::stdout::{print, print_json};
use canaletto::explain::TreeDifference;
use serde::Serialize;
use std::path::PathBuf;

/// One of the two that are compared.
#[derive(Serialize)]
struct Compared {
    scene: PathBuf,
    /// The changes of the scene, as by --set.
    set: Vec<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pixel: Option<[u32; 2]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    ray: Option<[f64; 6]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    seed: Option<u64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    frame: Option<u32>,
}

impl Compared {
    fn new(flags: &ExplainFlags) -> Compared {
        Compared {
            scene: flags.source.scene.clone(),
            set: flags.source.changes(),
            pixel: flags.pixel,
            ray: flags.ray,
            seed: flags.picture.seed,
            frame: flags.frame,
        }
    }

    fn text(&self) -> String {
        let mut words = vec![self.scene.display().to_string()];
        words.extend(self.pixel.map(|[x, y]| format!("pixel {x},{y}")));
        words.extend(self.ray.map(|ray| format!("ray {}", ray.map(|v| v.to_string()).join(","))));
        words.extend(self.frame.map(|frame| format!("frame {frame}")));
        words.extend(self.seed.map(|seed| format!("seed {seed}")));
        words.extend(self.set.iter().cloned());
        words.join(", ")
    }
}

/// A difference as JSON.
#[derive(Serialize)]
struct DifferenceReport<'a> {
    version: u32,
    compared: &'a [Compared; 2],
    #[serde(flatten)]
    difference: &'a TreeDifference,
}

/// Runs the command with two explanations.
pub(super) fn explain_difference(flags: &ExplainFlags) -> Result<Exit, Failure> {
    let mut other = flags.clone();
    other.source.set.extend(flags.diff_set.iter().cloned());
    if let Some(scene) = &flags.diff {
        other.source.scene.clone_from(scene);
    }
    other.pixel = flags.diff_pixel.or(flags.pixel);
    other.frame = flags.diff_frame.or(flags.frame);
    other.picture.seed = flags.diff_seed.or(flags.picture.seed);
    let subject = Subject::open(flags)?;
    let a = subject.explained(flags.pixel, "--pixel", true)?;
    let flag = if flags.diff_pixel.is_some() { "--diff-pixel" } else { "--pixel" };
    let b = if flags.has_other_job() {
        // There is memory for one world at a time.
        drop(subject);
        let subject = Subject::open(&other)?;
        subject.explained(other.pixel, &format!("{}: {flag}", subject.name), true)?
    } else {
        subject.explained(other.pixel, flag, true)?
    };
    let difference = match (&a, &b) {
        (Explained::Pixel(a), Explained::Pixel(b)) => a.difference(b, flags.digits),
        (Explained::Ray(a), Explained::Ray(b)) => a.difference(b, flags.digits),
        (Explained::Paths(a), Explained::Paths(b)) => a.tree.difference(&b.tree, flags.digits),
        _ => return Err(Failure::new(Exit::Failed, "rays can't be compared with paths")),
    };
    let compared = [flags, &other].map(Compared::new);
    if flags.json {
        print_json(&DifferenceReport { version: JSON_VERSION, compared: &compared, difference: &difference })?;
    } else {
        let [a, b] = compared.each_ref().map(Compared::text);
        print(&format!("A  {a}\nB  {b}\n\n{}", difference.text(flags.digits)))?;
    }
    Ok(Exit::Done)
}
