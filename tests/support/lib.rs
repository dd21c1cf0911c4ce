//! Helpers shared by the tests: the scenes folder and an independent reference renderer.

pub mod gallery;
mod random;
pub mod reference;
mod same_picture;
pub mod student;
pub mod textured;

pub use random::Random;
pub use same_picture::assert_same_picture;

use canaletto::scene::{Developing, FilmSettings};
use std::path::{Path, PathBuf};

/// The repository's root.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("tests/ lies in the repository").to_path_buf()
}

/// A film's developing, for pictures of any integrator: without a tone, values over 1 are cut.
pub fn clamped(film: &FilmSettings) -> Developing {
    Developing {
        exposure: film.exposure.unwrap_or_default(),
        tone: film.tone.unwrap_or_default(),
        transfer: film.transfer,
    }
}
