//! A digest of all that a picture depends on: the program, the scene's files, settings, layers and the file's format.
//! Frames of an animation carry it, and one with another digest shows something else.

use crate::source::UsedFile;
use std::fmt::{self, Debug};

/// A number for the parts that went into it, in their order. It tells an edited scene from an old one; it isn't meant against
/// forgery.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Digest(u64);

impl Digest {
    /// That of the program: its version, and what it was compiled from.
    pub(crate) fn of_program() -> Digest {
        Digest(0).with(&(env!("CARGO_PKG_VERSION"), env!("CANALETTO_SOURCES")))
    }

    /// With a value as it is written for programmers, which holds all of its fields, and numbers to their last bit.
    pub(crate) fn with(self, part: &dyn Debug) -> Digest {
        let text = format!("{part:?}");
        Digest(hash_on(hash_start(self.0.rotate_left(17), text.len()), text.as_bytes()))
    }

    /// With files, whatever the order in which they were read.
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

/// FNV-1a, eight bytes at a time with the bits stirred after each: fast, and the same everywhere.
pub(crate) fn hash_of(bytes: &[u8]) -> u64 {
    hash_on(hash_start(0, bytes.len()), bytes)
}

/// The hash of no bytes, before `length` bytes.
pub(crate) fn hash_start(start: u64, length: usize) -> u64 {
    start ^ 0xcbf2_9ce4_8422_2325 ^ length as u64
}

/// Goes on with these bytes, a multiple of eight unless they are the last.
pub(crate) fn hash_on(mut hash: u64, bytes: &[u8]) -> u64 {
    let mut chunks = bytes.chunks_exact(8);
    let mut stir = |word: u64| {
        hash = (hash ^ word).wrapping_mul(0x0000_0100_0000_01b3);
        hash ^= hash >> 29;
    };
    for chunk in &mut chunks {
        stir(u64::from_le_bytes(chunk.try_into().unwrap_or_default()));
    }
    chunks.remainder().iter().for_each(|byte| stir(u64::from(*byte)));
    hash
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
        // Parts don't run together.
        let empty = Digest::of_program();
        assert_ne!(empty.with(&["a; b"]), empty.with(&["a", "b"]));
        assert_ne!(empty.with(&0.1_f64), empty.with(&(0.1_f64 + 1e-17 + f64::EPSILON)));
    }
}
