//! Models among the files that are rendered.

use canaletto_io::import::{Holds, ModelFormat};
use std::path::Path;

/// Whether a file is a model, by its name.
pub(crate) fn is_model(path: &Path) -> bool {
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    ModelFormat::of_extension(&extension).is_some_and(|format| format.holds == Holds::Objects)
}
