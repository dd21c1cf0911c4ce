//! Checks of picture files from an earlier run: whether they are complete, and whether they match the job.

use crate::output::Output;
use crate::partial::UNFINISHED;
use canaletto::Named;
use canaletto::render::{Aov, Job};
use canaletto_io::picture::{Decoded, SOFTWARE, announced_size, channel_names, decode};
use std::fs;
use std::path::Path;

/// The entry of a layer's file for the curve of the picture. `transfer` is the curve of the file's own numbers there.
pub(crate) const PICTURE_TRANSFER: &str = "picture-transfer";

/// The key of the text that stands for all that a frame's bytes depend on.
pub(crate) const FINGERPRINT: &str = "fingerprint";

/// The text entries of a frame's picture, or of a layer in a file of its own. The mapping of a layer to colours adds
/// its curve. The picture's curve decides where adaptive sampling refines, and so changes its layers, too.
pub(crate) fn texts(settings: &[(String, String)], job: &Job, layer: Option<Aov>) -> Vec<(String, String)> {
    let mut texts = settings.to_vec();
    texts.push(("frame".into(), job.frame.to_string()));
    if let Some(aov) = layer {
        for (key, _) in texts.iter_mut().filter(|(key, _)| key == "transfer") {
            PICTURE_TRANSFER.clone_into(key);
        }
        texts.push(("layer".into(), aov.name().into()));
    }
    texts
}

/// Whether a file holds a complete picture of this job with these texts, written by this program and not changed since.
pub(crate) fn is_complete(file: &Path, job: &Job, output: &Output, texts: &[(String, String)]) -> bool {
    complete_picture(file, job, output, texts).is_some()
}

/// The complete picture of a file, as [`is_complete`] tells it.
pub(crate) fn complete_picture(file: &Path, job: &Job, output: &Output, texts: &[(String, String)]) -> Option<Decoded> {
    let [_, _, width, height] = job.window();
    let format = output.format.picture()?;
    let mut names = channel_names(job.film.alpha, if output.format.has_layers() { &job.aovs } else { &[] });
    // A file much larger than these pixels is something else and isn't read.
    let most = u64::from(width) * u64::from(height) * names.len() as u64 * 8 + (1 << 20);
    let bytes = fs::metadata(file).ok().filter(|m| m.is_file() && m.len() <= most).and_then(|_| fs::read(file).ok());
    // A picture of another size isn't decoded.
    let fits = |bytes: &Vec<u8>| announced_size(bytes) == Some([width, height]);
    let picture = bytes.filter(fits).and_then(|bytes| decode(&bytes).ok())?;
    let mut channels: Vec<&str> = picture.image.channels.iter().map(|channel| channel.name.as_str()).collect();
    channels.sort_unstable();
    names.sort_unstable();
    let has = |key: &str, text: &str| picture.metadata.iter().any(|(k, t)| (k.as_str(), t.as_str()) == (key, text));
    let is_complete = (picture.image.width, picture.image.height) == (width, height)
        && format.stored_bits(&output.settings, &names) == Ok(picture.bits)
        && channels == names
        && !picture.is_changed
        && picture.metadata.iter().all(|(key, _)| key != UNFINISHED)
        && texts.iter().all(|(key, text)| has(key, text))
        && has("Software", SOFTWARE);
    is_complete.then_some(picture)
}
