//! Writing a file so that it is there whole or not at all.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use tempfile::{Builder, NamedTempFile};

/// How to write.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct WriteOptions {
    /// Fail if the file exists.
    pub no_clobber: bool,
}

/// Why a file isn't written.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// It exists, and may not be replaced.
    #[error("{} exists already, and isn't replaced", .0.display())]
    Exists(PathBuf),
    /// Its folder doesn't exist.
    #[error("there is no folder {}", .0.display())]
    NoFolder(PathBuf),
    /// The path is a folder.
    #[error("{} is a folder", .0.display())]
    IsFolder(PathBuf),
    /// Nothing can be written into the folder.
    #[error("can't write into the folder {}: {reason}", folder.display())]
    Folder {
        /// The folder.
        folder: PathBuf,
        /// What the system says.
        reason: io::Error,
    },
    /// Writing began and failed; nothing is left of it.
    #[error("can't write {}: {reason}", path.display())]
    Failed {
        /// The file.
        path: PathBuf,
        /// What the system says.
        reason: io::Error,
    },
}

/// Writes a file through a temporary one in the same folder, which takes its place at the end and is removed if
/// anything fails. The path `-` is the standard output. Links are followed (one to nowhere
/// is replaced); devices and pipes are written directly.
///
/// # Errors
/// [`WriteError`] says why not.
pub fn write_atomically(
    path: &Path,
    options: WriteOptions,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), WriteError> {
    let file = AtomicFile::begin(path, options)?;
    {
        let mut out = BufWriter::new(file.handle()?);
        write(&mut out).and_then(|()| out.flush()).map_err(|reason| file.failed(reason))?;
    }
    file.commit()
}

/// A file that is being written, and that nobody sees before [`AtomicFile::commit`]. Dropping it leaves nothing.
#[derive(Debug)]
pub struct AtomicFile {
    path: PathBuf,
    no_clobber: bool,
    place: Place,
}

#[derive(Debug)]
enum Place {
    Stdout,
    /// A device or pipe.
    Direct(File),
    Temporary(NamedTempFile, PathBuf),
}

impl AtomicFile {
    /// Begins a file as [`write_atomically`] does.
    ///
    /// # Errors
    /// [`WriteError`] says why it can't be written.
    pub fn begin(path: &Path, options: WriteOptions) -> Result<AtomicFile, WriteError> {
        let failed = |reason: io::Error| WriteError::Failed { path: path.to_owned(), reason };
        let file = |place| AtomicFile { path: path.to_owned(), no_clobber: options.no_clobber, place };
        if path == Path::new("-") {
            return Ok(file(Place::Stdout));
        }
        let existing = fs::metadata(path).ok();
        match &existing {
            Some(old) if old.is_dir() => return Err(WriteError::IsFolder(path.to_owned())),
            Some(_) if options.no_clobber => return Err(WriteError::Exists(path.to_owned())),
            Some(old) if !old.is_file() => {
                return Ok(file(Place::Direct(fs::OpenOptions::new().write(true).open(path).map_err(failed)?)));
            }
            _ => {}
        }
        let target = if existing.is_some() { fs::canonicalize(path).map_err(failed)? } else { path.to_owned() };
        let folder = match target.parent() {
            Some(folder) if folder != Path::new("") => folder,
            _ => Path::new("."),
        };
        let mut builder = Builder::new();
        builder.prefix(".canaletto-").suffix(".tmp");
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            // As any new file; the system takes the user's mask off.
            let mode = existing.as_ref().map_or(0o666, |old| old.permissions().mode() & 0o777);
            builder.permissions(fs::Permissions::from_mode(mode));
        }
        let temporary = builder.tempfile_in(folder).map_err(|reason| {
            if reason.kind() == io::ErrorKind::NotFound {
                WriteError::NoFolder(folder.to_owned())
            } else {
                WriteError::Folder { folder: folder.to_owned(), reason: root_cause(reason) }
            }
        })?;
        Ok(file(Place::Temporary(temporary, target)))
    }

    /// What to write to. Nothing is buffered.
    ///
    /// # Errors
    /// [`WriteError::Failed`] if the system has no handles left.
    pub fn handle(&self) -> Result<Box<dyn Write + Send>, WriteError> {
        let clone = |file: &File| file.try_clone().map_err(|reason| self.failed(reason));
        Ok(match &self.place {
            Place::Stdout => Box::new(io::stdout()),
            Place::Direct(file) => Box::new(clone(file)?),
            Place::Temporary(file, _) => Box::new(clone(file.as_file())?),
        })
    }

    /// The file in which it grows, if it is one.
    pub fn temporary(&self) -> Option<&Path> {
        if let Place::Temporary(file, _) = &self.place { Some(file.path()) } else { None }
    }

    /// What happened while writing, with the file's name.
    pub fn failed(&self, reason: io::Error) -> WriteError {
        WriteError::Failed { path: self.path.clone(), reason }
    }

    /// Puts the file in its place.
    ///
    /// # Errors
    /// [`WriteError`] if that fails; then nothing is left of it.
    pub fn commit(self) -> Result<(), WriteError> {
        let AtomicFile { path, no_clobber, place } = self;
        let failed = |reason: io::Error| WriteError::Failed { path: path.clone(), reason };
        let (temporary, target) = match place {
            Place::Stdout => return io::stdout().flush().map_err(failed),
            Place::Direct(_) => return Ok(()),
            Place::Temporary(temporary, target) => (temporary, target),
        };
        if no_clobber {
            temporary.persist_noclobber(&target).map_err(|e| match e.error.kind() {
                io::ErrorKind::AlreadyExists => WriteError::Exists(path.clone()),
                _ => failed(e.error),
            })?;
        } else {
            temporary.persist(&target).map_err(|e| failed(e.error))?;
        }
        Ok(())
    }
}

/// The system's own words: `tempfile` adds the temporary path to them.
fn root_cause(error: io::Error) -> io::Error {
    error.raw_os_error().map_or_else(|| io::Error::from(error.kind()), io::Error::from_raw_os_error)
}

#[cfg(test)]
mod tests {
    use super::*;

    const KEEP: WriteOptions = WriteOptions { no_clobber: true };

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> =
            fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn whole_or_not_at_all() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        write_atomically(&path, KEEP, |w| w.write_all(b"first")).unwrap();
        let error = write_atomically(&path, WriteOptions::default(), |w| {
            w.write_all(&[0; 100_000])?;
            Err(io::Error::other("the disk is full"))
        });
        assert!(error.unwrap_err().to_string().ends_with("a.png: the disk is full"));
        assert_eq!((fs::read(&path).unwrap(), names(folder.path())), (b"first".to_vec(), vec!["a.png".to_owned()]));
        write_atomically(&path, WriteOptions::default(), |w| w.write_all(b"second")).unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"second");
        assert!(matches!(write_atomically(&path, KEEP, |_| Ok(())), Err(WriteError::Exists(_))));
    }

    #[test]
    fn a_file_that_appears_meanwhile_is_kept() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let result = write_atomically(&path, KEEP, |_| fs::write(&path, b"other"));
        assert!(matches!(result, Err(WriteError::Exists(_))));
        assert_eq!((fs::read(&path).unwrap(), names(folder.path()).len()), (b"other".to_vec(), 1));
    }

    #[test]
    fn errors_name_the_folder() {
        let folder = tempfile::tempdir().unwrap();
        let missing = folder.path().join("no/a.png");
        let error = write_atomically(&missing, WriteOptions::default(), |_| Ok(())).unwrap_err();
        assert!(error.to_string().starts_with("there is no folder ") && error.to_string().ends_with("no"), "{error}");
        let error = write_atomically(folder.path(), WriteOptions::default(), |_| Ok(())).unwrap_err();
        assert!(error.to_string().ends_with("is a folder"));
    }

    #[cfg(unix)]
    #[test]
    fn links_devices_and_permissions() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let (path, link) = (folder.path().join("a"), folder.path().join("b"));
        fs::write(&path, b"x").unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(0o640)).unwrap();
        std::os::unix::fs::symlink(&path, &link).unwrap();
        write_atomically(&link, WriteOptions::default(), |w| w.write_all(b"y")).unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(
            (fs::read(&path).unwrap(), fs::metadata(&path).unwrap().permissions().mode() & 0o777),
            (b"y".to_vec(), 0o640)
        );
        write_atomically(Path::new("/dev/null"), WriteOptions::default(), |w| w.write_all(b"z")).unwrap();
        assert!(!fs::metadata("/dev/null").unwrap().is_file());
    }
}
