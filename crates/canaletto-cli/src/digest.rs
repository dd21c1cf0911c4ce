//! A digest of all that a picture depends on: the program, the scene's files, settings, layers and the file's format.
//! Frames of an animation carry it. A frame with another digest shows something else.

use canaletto::WordHash;
use serde::Serialize;
use std::fmt::{self, Debug, Write};
use std::path::PathBuf;

/// An input file of a scene.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct UsedFile {
    /// The name for messages.
    pub file: String,
    /// The path relative to the scene's folder.
    #[serde(skip)]
    pub place: PathBuf,
    /// The size in bytes.
    pub bytes: u64,
    /// A hash of the content.
    #[serde(skip)]
    pub hash: u64,
}

/// A hash of several parts in their order. It detects edited scenes; it gives no protection against forgery.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Digest(u64);

impl Digest {
    /// The digest of nothing.
    pub(crate) const EMPTY: Digest = Digest(0);

    /// The digest of the program: its version and the hash of its sources.
    pub(crate) fn of_program() -> Digest {
        Digest::EMPTY.with(&(env!("CARGO_PKG_VERSION"), env!("CANALETTO_SOURCES")))
    }

    /// Adds a value by its `Debug` text, which holds all fields and exact numbers.
    pub(crate) fn with(self, part: &dyn Debug) -> Digest {
        let mut hash = WordHash::seeded(self.0.rotate_left(17));
        // A hash takes any text.
        let _ = write!(hash, "{part:?}");
        Digest(hash.finish())
    }

    /// Adds files. The order in which they were read doesn't matter.
    pub(crate) fn with_files(self, files: &[UsedFile]) -> Digest {
        let mut files: Vec<_> = files.iter().map(|used| (&used.place, used.bytes, used.hash)).collect();
        files.sort();
        self.with(&files)
    }
}

impl fmt::Display for Digest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:016x}", self.0)
    }
}

/// The hash of bytes.
pub(crate) fn hash_of(bytes: &[u8]) -> u64 {
    let mut hash = WordHash::new();
    hash.add_bytes(bytes);
    hash.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_part_counts_and_the_order_of_reading_doesnt() {
        let used = |place: &str, hash| UsedFile { file: String::new(), place: place.into(), bytes: 3, hash };
        let (a, b) = (used("a", 1), used("b", 2));
        let of = |files: &[UsedFile]| Digest::of_program().with_files(files);
        assert_eq!(of(&[a.clone(), b.clone()]), of(&[b.clone(), a.clone()]));
        let others =
            [of(std::slice::from_ref(&a)), of(&[used("a", 2), used("b", 1)]), of(&[used("a", 1), used("c", 2)])];
        assert!(others.iter().all(|other| *other != of(&[a.clone(), b.clone()])));
        // The boundaries between parts count.
        let empty = Digest::of_program();
        assert_ne!(empty.with(&["a; b"]), empty.with(&["a", "b"]));
        assert_ne!(empty.with(&0.1_f64), empty.with(&(0.1_f64 + 1e-17 + f64::EPSILON)));
    }
}
