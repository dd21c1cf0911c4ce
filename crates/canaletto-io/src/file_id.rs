//! The identity of files under different names.

use std::fs::Metadata;
use std::io;
use std::path::{Path, PathBuf};

/// An identity that is equal for every name of a file: links of both kinds, other paths to its folder, and other letter
/// cases where the file system ignores case. Files that exist at the same time have different identities.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct FileId(PathBuf);

impl FileId {
    /// The identity of the file at `path`.
    ///
    /// # Errors
    /// The system's error if there is no such file.
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

    /// The identity as a path that no file has.
    pub(crate) fn into_path(self) -> PathBuf {
        self.0
    }
}
