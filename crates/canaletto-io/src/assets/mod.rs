//! Access to the files that a scene names: the [`Assets`] trait.
//!
//! A scene file may be hostile, so the files that it names must lie below the scene's own folder unless the user allows
//! others. Paths are taken literally (nothing is percent-decoded) and checked by the location to which they resolve.

#[cfg(unix)]
mod beneath;
mod folder;

pub use folder::FolderAssets;

use crate::content::Content;
use crate::diagnostic::closest_word;
use std::collections::HashMap;
use std::fmt;
use std::path::{Component, Path, PathBuf};

/// A source of the files that scenes name.
pub trait Assets: Send + Sync {
    /// Reads the file that `from` names as `path`. A relative path starts at the folder of `from`. [`AssetPath::base`]
    /// stands for the user, whose relative paths start at the root.
    ///
    /// # Errors
    /// [`AssetError`] if the file can't be read.
    fn read(&self, path: &str, from: &AssetPath) -> Result<Asset, AssetError>;

    /// Opens the file that [`Assets::read`] would read, for readers that read it in pieces. The default implementation
    /// reads it into memory.
    ///
    /// # Errors
    /// As [`Assets::read`].
    fn open(&self, path: &str, from: &AssetPath) -> Result<OpenAsset, AssetError> {
        self.read(path, from).map(|Asset { path, bytes }| OpenAsset { path, content: Content::Memory(bytes) })
    }
}

/// An open file and its origin.
#[derive(Debug)]
pub struct OpenAsset {
    /// The origin of the file: the `from` of paths that this file names.
    pub path: AssetPath,
    /// The content.
    pub content: Content,
}

/// The bytes of a file and its origin.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Asset {
    /// The origin of the file: the `from` of paths that this file names.
    pub path: AssetPath,
    /// The bytes of the file.
    pub bytes: Vec<u8>,
}

/// The origin of an asset. Two paths of one [`Assets`] with equal identity are one file.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub struct AssetPath {
    location: PathBuf,
    identity: PathBuf,
    shown: String,
}

impl AssetPath {
    /// The origin of paths that the user gives: they start at the root.
    pub fn base() -> AssetPath {
        AssetPath::default()
    }

    /// A path for implementations of [`Assets`]. `location` is the file as reached, in whose folder relative paths
    /// start. `identity` is equal for every path to the file. `shown` is the display name.
    pub fn new(location: impl Into<PathBuf>, identity: impl Into<PathBuf>, shown: impl Into<String>) -> AssetPath {
        AssetPath { location: location.into(), identity: identity.into(), shown: shown.into() }
    }

    /// The display name.
    pub fn name(&self) -> &str {
        &self.shown
    }

    /// The file as reached, relative to the root or absolute.
    pub fn location(&self) -> &Path {
        &self.location
    }

    /// The identity, which is equal for every path to this file.
    pub fn identity(&self) -> &Path {
        &self.identity
    }

    /// The extension of the file name in lower case, or an empty text.
    pub fn extension(&self) -> String {
        self.location.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default()
    }
}

/// The reasons why a file can't be read. `path` is the path as written in the scene.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum AssetError {
    /// There is no such file.
    #[error("there is no file \"{path}\"")]
    Missing {
        /// The path as written.
        path: String,
        /// The most similar name beside it.
        nearest: Option<String>,
    },
    /// The path leads outside the folder that the scene may read.
    #[error("\"{path}\" lies outside the scene's folder")]
    Outside {
        /// The path as written.
        path: String,
    },
    /// The path leads to a folder, a device, a pipe or a socket.
    #[error("\"{path}\" is {kind}, not a file")]
    NotAFile {
        /// The path as written.
        path: String,
        /// The type of the entry, with its article.
        kind: &'static str,
    },
    /// The system can't read the file.
    #[error("\"{path}\" can't be read: {reason}")]
    Unreadable {
        /// The path as written.
        path: String,
        /// The system's message.
        reason: String,
    },
    /// The file is larger than the limit.
    #[error("\"{path}\" is too large: {size} bytes, and the limit is {limit}")]
    TooLarge {
        /// The path as written.
        path: String,
        /// The size in bytes, as far as it was determined.
        size: u64,
        /// The limit in bytes.
        limit: u64,
    },
    /// The path is no valid file name.
    #[error("{path:?} can't be a file's name: {reason}")]
    BadName {
        /// The path as written.
        path: String,
        /// The mistake in the path.
        reason: &'static str,
    },
}

impl AssetError {
    /// A hint for the user.
    pub fn help(&self) -> Option<String> {
        match self {
            AssetError::Missing { nearest: Some(name), .. } => Some(format!("did you mean \"{name}\"?")),
            AssetError::Missing { path, .. } if path.contains('\\') => {
                Some("write / between folders, on every system".into())
            }
            AssetError::Missing { .. } => Some("relative paths start at the folder of the file that names them".into()),
            AssetError::Outside { .. } => Some("allow it with --allow-outside, if you trust the scene".into()),
            _ => None,
        }
    }
}

/// Files in memory, for tests and for programs that generate their scenes.
#[derive(Clone, Debug, Default)]
pub struct MemoryAssets {
    files: HashMap<String, Vec<u8>>,
}

impl MemoryAssets {
    /// An empty set of files.
    pub fn new() -> MemoryAssets {
        MemoryAssets::default()
    }

    /// Adds a file; `path` has `/` between folders.
    pub fn with(mut self, path: &str, bytes: impl Into<Vec<u8>>) -> MemoryAssets {
        self.files.insert(path.to_owned(), bytes.into());
        self
    }
}

impl Assets for MemoryAssets {
    fn read(&self, path: &str, from: &AssetPath) -> Result<Asset, AssetError> {
        check_name(path)?;
        let outside = || AssetError::Outside { path: path.into() };
        if is_foreign_absolute(path) || path.starts_with('/') {
            return Err(outside());
        }
        let folder = from.location.parent().unwrap_or(Path::new(""));
        let location = lexical(&folder.join(path)).ok_or_else(outside)?;
        let name = location.components().map(|c| c.as_os_str().to_string_lossy()).collect::<Vec<_>>().join("/");
        let Some(bytes) = self.files.get(&name) else {
            let nearest = closest_word(path, self.files.keys().map(String::as_str)).map(str::to_owned);
            return Err(AssetError::Missing { path: path.into(), nearest });
        };
        let path = AssetPath { location: name.clone().into(), identity: name.clone().into(), shown: name };
        Ok(Asset { path, bytes: bytes.clone() })
    }
}

pub(crate) fn check_name(path: &str) -> Result<(), AssetError> {
    let reason = if path.is_empty() {
        "it is empty"
    } else if path.contains('\0') {
        "it holds a NUL character"
    } else if path.len() > 4096 {
        "it is longer than 4096 bytes"
    } else {
        return Ok(());
    };
    Err(AssetError::BadName { path: path.chars().take(80).collect(), reason })
}

/// Whether the path is absolute on any system, not only on this one: `C:\a`, `C:a`, `\\server\a`, `\a`.
fn is_foreign_absolute(path: &str) -> bool {
    let bytes = path.as_bytes();
    path.starts_with('\\') || (bytes.len() >= 2 && bytes[0].is_ascii_alphabetic() && bytes[1] == b':')
}

/// The path without `.` and `..`, resolved lexically; `None` if it climbs above its start.
fn lexical(path: &Path) -> Option<PathBuf> {
    let mut out = PathBuf::new();
    let mut depth = 0;
    for component in path.components() {
        match component {
            Component::CurDir => {}
            Component::ParentDir if depth == 0 => return None,
            Component::ParentDir => {
                out.pop();
                depth -= 1;
            }
            Component::Normal(_) => {
                out.push(component);
                depth += 1;
            }
            Component::Prefix(_) | Component::RootDir => out.push(component),
        }
    }
    Some(out)
}

/// The system's message, without the error number that Rust appends.
pub fn reason(error: &impl fmt::Display) -> String {
    let text = error.to_string();
    let mut characters = text.split(" (os error").next().unwrap_or_default().chars();
    characters.next().map_or_else(String::new, |first| first.to_lowercase().chain(characters).collect())
}

impl fmt::Display for AssetPath {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.shown)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_has_folders_too() {
        let assets = MemoryAssets::new().with("sub/b.kdl", "b").with("a.kdl", "a");
        let b = assets.read("sub/./b.kdl", &AssetPath::base()).unwrap();
        assert_eq!(assets.read("../a.kdl", &b.path).unwrap().path.name(), "a.kdl");
        assert!(matches!(assets.read("../../a.kdl", &b.path), Err(AssetError::Outside { .. })));
    }
}
