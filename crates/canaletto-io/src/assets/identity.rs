//! When two names are one file.

use std::fs::Metadata;
use std::io;
use std::path::{Path, PathBuf};

/// What is the same for every name of a file: links of both kinds, other ways to its folder, other letter cases where the file
/// system takes them for the same. Files that exist at the same time have different ones.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct FileId(PathBuf);

impl FileId {
    /// That of the file to which a path leads.
    ///
    /// # Errors
    /// If it leads to none.
    pub fn of(path: &Path) -> io::Result<FileId> {
        FileId::with(path, &path.metadata()?)
    }

    #[cfg(unix)]
    pub(crate) fn with(_: &Path, metadata: &Metadata) -> io::Result<FileId> {
        use std::os::unix::fs::MetadataExt;
        Ok(FileId(format!("{:x}:{:x}", metadata.dev(), metadata.ino()).into()))
    }

    #[cfg(not(unix))]
    pub(crate) fn with(path: &Path, _: &Metadata) -> io::Result<FileId> {
        Ok(FileId(path.canonicalize()?))
    }

    /// As a path that no file has.
    pub(super) fn into_path(self) -> PathBuf {
        self.0
    }
}
