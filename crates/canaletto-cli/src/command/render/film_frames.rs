//! The finished frames of a film in one file, as pictures in a folder beside it. A film that ended early is made of
//! them without rendering them again.

use crate::complete::complete_picture;
use crate::failure::Failure;
use crate::output::{Output, OutputFlags};
use canaletto::render::Job;
use canaletto_io::picture::Image;
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};

/// The folder of a film's frames.
pub(super) struct FilmFrames {
    folder: PathBuf,
    output: Output,
}

impl FilmFrames {
    /// The frames of a film, in `NAME.frames` beside it. Nothing is made yet.
    pub(super) fn beside(film: &Path, flags: &OutputFlags) -> Result<FilmFrames, Failure> {
        let mut name = OsString::from(film.file_stem().unwrap_or_default());
        name.push(".frames");
        let folder = film.with_file_name(name);
        let output = Output::new(&flags.for_file(&folder.join("frame.#######.png")), "", true, true)?;
        Ok(FilmFrames { folder, output })
    }

    /// The folder's path.
    pub(super) fn folder(&self) -> &Path {
        &self.folder
    }

    /// A frame that is there already, with the texts of its file. `texts` are those that it must have.
    pub(super) fn find(&self, job: &Job, texts: &[(String, String)]) -> Option<(Image, Vec<(String, String)>)> {
        let decoded = complete_picture(&self.output.path(job.frame), job, &self.output, texts)?;
        Some((decoded.image, decoded.metadata))
    }

    /// Keeps a frame, whose picture `encode` writes as this output holds it.
    pub(super) fn keep(
        &self,
        frame: u32,
        encode: impl FnOnce(&Output) -> Result<Vec<u8>, Failure>,
    ) -> Result<(), Failure> {
        // Where the folder can't be made, writing says so.
        let _ = fs::create_dir(&self.folder);
        self.output.write(&self.output.path(frame), &encode(&self.output)?)
    }

    /// Removes the frames of a finished film. Other files in the folder stay, and so does the folder with them.
    pub(super) fn remove(&self, frames: impl Iterator<Item = u32>) {
        if self.folder.is_dir() {
            for frame in frames {
                let _ = fs::remove_file(self.output.path(frame));
            }
            let _ = fs::remove_dir(&self.folder);
        }
    }
}
