//! A digest of all that a picture depends on: the program, the scene's files, settings, layers and the file's format.
//! Frames of an animation carry it. A frame with another digest shows something else.

use serde::Serialize;
use siphasher::sip128::{Hasher128, SipHasher13};
use std::fmt::{self, Debug, Write};
use std::hash::Hasher;
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
    pub hash: u128,
}

/// A hash of several parts in their order. It detects edited scenes; it gives no protection against forgery.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Digest(u128);

impl Digest {
    /// The digest of nothing.
    pub(crate) const EMPTY: Digest = Digest(0);

    /// The digest of the program: its version and the hash of its sources.
    pub(crate) fn of_program() -> Digest {
        Digest::EMPTY.with(&(env!("CARGO_PKG_VERSION"), env!("CANALETTO_SOURCES")))
    }

    /// Adds a value by its `Debug` text, which holds all fields and exact numbers.
    pub(crate) fn with(self, part: &dyn Debug) -> Digest {
        let mut hash = Hash::new();
        hash.add(&self.0.to_le_bytes());
        // A hash takes any text.
        let _ = write!(hash, "{part:?}");
        Digest(hash.finish())
    }

    /// Adds the contents of files, the first of which is the scene. The order in which the others were read doesn't
    /// matter, nor does the scene's own name.
    pub(crate) fn with_files(self, files: &[UsedFile]) -> Digest {
        let no_place = PathBuf::new();
        let place = |index: usize| if index == 0 { &no_place } else { &files[index].place };
        let mut files: Vec<_> =
            files.iter().enumerate().map(|(index, used)| (place(index), used.bytes, used.hash)).collect();
        files.sort();
        self.with(&files)
    }
}

impl fmt::Display for Digest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:032x}", self.0)
    }
}

/// SipHash-1-3 of 128 bits, equal on every machine (Aumasson & Bernstein, *SipHash: a fast short-input PRF*, 2012).
pub(crate) struct Hash(SipHasher13);

impl Hash {
    pub(crate) fn new() -> Hash {
        Hash(SipHasher13::new())
    }

    /// Adds bytes. It doesn't matter how they are divided among calls.
    pub(crate) fn add(&mut self, bytes: &[u8]) {
        self.0.write(bytes);
    }

    pub(crate) fn finish(&self) -> u128 {
        self.0.finish128().as_u128()
    }
}

impl Write for Hash {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.add(text.as_bytes());
        Ok(())
    }
}

/// The hash of bytes.
pub(crate) fn hash_of(bytes: &[u8]) -> u128 {
    let mut hash = Hash::new();
    hash.add(bytes);
    hash.finish()
}

/// The contents and names of a scene's files as a text of a picture's file: a line for each, the scene first.
pub(crate) fn text_of_files(files: &[UsedFile]) -> String {
    let line = |(index, used): (usize, &UsedFile)| {
        // The folder of the scene is nobody's concern, and the same picture elsewhere has the same bytes.
        let own_name = || used.file.rsplit(['/', '\\']).next().unwrap_or_default().to_owned();
        let name = if index == 0 { own_name() } else { used.place.to_string_lossy().into_owned() };
        format!("{:032x} {}", used.hash, name.replace(char::is_control, "\u{fffd}"))
    };
    let mut lines: Vec<String> = files.iter().enumerate().map(line).collect();
    if let Some((_, others)) = lines.split_first_mut() {
        others.sort_unstable_by(|a, b| a[33..].cmp(&b[33..]));
    }
    lines.join("\n")
}

/// How the files of a scene differ from those that it had.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum FileChange {
    /// The file of this name has other contents.
    Edited(String),
    /// The scene names a file that it didn't.
    Added(String),
    /// The scene no longer names a file.
    Removed(String),
}

/// The first change of the files of one text of [`text_of_files`] to those of a later one; none if they are equal.
pub(crate) fn changed_file(now: &str, then: &str) -> Option<FileChange> {
    let lines = |text: &str| -> Vec<(String, String)> {
        let line = |line: &str| line.split_once(' ').map(|(hash, name)| (hash.to_owned(), name.to_owned()));
        text.lines().filter_map(line).collect()
    };
    let (now, then) = (lines(now), lines(then));
    if let (Some((hash, name)), Some((before, _))) = (now.first(), then.first())
        && hash != before
    {
        return Some(FileChange::Edited(name.clone()));
    }
    let of = |files: &[(String, String)], name: &str| {
        files.iter().skip(1).find(|(_, other)| other == name).map(|(hash, _)| hash.clone())
    };
    let changed = now.iter().skip(1).find_map(|(hash, name)| match of(&then, name) {
        Some(before) if before == *hash => None,
        Some(_) => Some(FileChange::Edited(name.clone())),
        None => Some(FileChange::Added(name.clone())),
    });
    let removed = || then.iter().skip(1).find(|(_, name)| of(&now, name).is_none());
    changed.or_else(|| removed().map(|(_, name)| FileChange::Removed(name.clone())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_part_counts_and_the_order_of_reading_doesnt() {
        let used = |place: &str, hash| UsedFile { file: String::new(), place: place.into(), bytes: 3, hash };
        let (a, b) = (used("a", 1), used("b", 2));
        let of = |files: &[UsedFile]| Digest::of_program().with_files(files);
        let c = used("c", 3);
        assert_eq!(of(&[a.clone(), b.clone(), c.clone()]), of(&[a.clone(), c.clone(), b.clone()]));
        let others =
            [of(std::slice::from_ref(&a)), of(&[used("a", 2), used("b", 1)]), of(&[used("a", 1), used("c", 2)])];
        assert!(others.iter().all(|other| *other != of(&[a.clone(), b.clone()])));
        // The scene's own name is none of its contents.
        assert_eq!(of(&[used("z", 1), b.clone()]), of(&[a.clone(), b.clone()]));
        // The boundaries between parts count.
        let empty = Digest::of_program();
        assert_ne!(empty.with(&["a; b"]), empty.with(&["a", "b"]));
        assert_ne!(empty.with(&0.1_f64), empty.with(&(0.1_f64 + 1e-17 + f64::EPSILON)));
    }

    #[test]
    fn the_file_that_changed_is_named() {
        let used = |place: &str, hash| UsedFile { file: place.to_owned(), place: place.into(), bytes: 3, hash };
        let text = |files: &[(&str, u128)]| {
            text_of_files(&files.iter().map(|(place, hash)| used(place, *hash)).collect::<Vec<_>>())
        };
        let then = text(&[("s.kdl", 1), ("b c.png", 2), ("a.obj", 3)]);
        let changed = |now: &[(&str, u128)]| changed_file(&text(now), &then);
        assert_eq!(changed(&[("other.kdl", 1), ("a.obj", 3), ("b c.png", 2)]), None);
        let edited = |name: &str| Some(FileChange::Edited(name.to_owned()));
        assert_eq!(changed(&[("s.kdl", 9), ("b c.png", 2), ("a.obj", 3)]), edited("s.kdl"));
        assert_eq!(changed(&[("s.kdl", 1), ("b c.png", 9), ("a.obj", 3)]), edited("b c.png"));
        let more = [("s.kdl", 1), ("b c.png", 2), ("a.obj", 3), ("d", 4)];
        assert_eq!(changed(&more), Some(FileChange::Added("d".to_owned())));
        assert_eq!(changed(&more[..2]), Some(FileChange::Removed("a.obj".to_owned())));
    }

    #[test]
    fn bytes_may_come_in_any_pieces() {
        let bytes: Vec<u8> = (0..100u32).map(|i| (i * i % 251) as u8).collect();
        let mut pieces = Hash::new();
        bytes.chunks(7).for_each(|piece| pieces.add(piece));
        assert_eq!(pieces.finish(), hash_of(&bytes));
    }
}
