//! Helpers shared by the tests: the scenes folder and an independent reference renderer.

pub mod gallery;
pub mod reference;
pub mod textured;

use std::path::{Path, PathBuf};

/// The repository's root.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("tests/ lies in the repository").to_path_buf()
}
