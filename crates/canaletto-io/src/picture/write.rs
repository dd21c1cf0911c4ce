//! Atomic writing: a file appears complete or not at all.

use super::temporary::temporary;
#[cfg(target_os = "linux")]
use super::temporary::{link, replace, unnamed};
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::thread;
use std::time::Duration;
use tempfile::NamedTempFile;

/// Options of writing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct WriteOptions {
    /// Whether to fail if the file exists.
    pub no_clobber: bool,
    /// Whether to sync the file before it gets its name, and the name before writing returns. A power failure then
    /// leaves the old file or the new one. It costs the time of the disk.
    pub durable: bool,
}

/// The reasons why a file isn't written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WriteError {
    /// The file exists and must not be replaced.
    #[error("{} exists already, and isn't replaced", .0.display())]
    Exists(PathBuf),
    /// The folder of the file doesn't exist.
    #[error("there is no folder {}", .0.display())]
    NoFolder(PathBuf),
    /// The path is a folder.
    #[error("{} is a folder", .0.display())]
    IsFolder(PathBuf),
    /// The folder can't be written to.
    #[error("can't write into the folder {}: {reason}", folder.display())]
    Folder {
        /// The folder.
        folder: PathBuf,
        /// The system's error.
        reason: io::Error,
    },
    /// Writing failed after it began; the incomplete file is removed.
    #[error("can't write {}: {reason}", path.display())]
    Failed {
        /// The file.
        path: PathBuf,
        /// The system's error.
        reason: io::Error,
    },
}

/// Writes a file through a temporary one that replaces it at the end. The temporary file is removed if anything fails.
/// The path `-` is the standard output. Links are followed; a dangling link is replaced. Devices and pipes are written
/// directly.
///
/// # Errors
/// [`WriteError`] if the file can't be written.
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

/// A file that is being written and isn't visible before [`AtomicFile::commit`]. Dropping it removes it.
#[derive(Debug)]
pub struct AtomicFile {
    path: PathBuf,
    options: WriteOptions,
    place: Place,
}

#[derive(Debug)]
enum Place {
    Stdout,
    /// A device or pipe.
    Direct(File),
    /// An unnamed file, and its final path.
    #[cfg(target_os = "linux")]
    Unnamed(File, PathBuf),
    Temporary(NamedTempFile, PathBuf),
}

impl AtomicFile {
    /// Creates a file as [`write_atomically`] does.
    ///
    /// # Errors
    /// [`WriteError`] if it can't be created.
    pub fn begin(path: &Path, options: WriteOptions) -> Result<AtomicFile, WriteError> {
        AtomicFile::begin_with(path, options, false)
    }

    /// As [`AtomicFile::begin`], with a temporary name through which another program can write the file.
    ///
    /// # Errors
    /// As [`AtomicFile::begin`].
    pub fn begin_named(path: &Path, options: WriteOptions) -> Result<AtomicFile, WriteError> {
        AtomicFile::begin_with(path, options, true)
    }

    fn begin_with(path: &Path, options: WriteOptions, named: bool) -> Result<AtomicFile, WriteError> {
        let failed = |reason: io::Error| WriteError::Failed { path: path.to_owned(), reason };
        let file = |place| AtomicFile { path: path.to_owned(), options, place };
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
        let folder = folder_of(&target);
        // The mode is that of any new file; the system applies the user's umask.
        let mode = mode_of(existing.as_ref());
        #[cfg(target_os = "linux")]
        if !named && let Some(unnamed) = unnamed(folder, mode) {
            return Ok(file(Place::Unnamed(unnamed, target)));
        }
        let _ = named;
        let temporary = temporary(folder, mode).map_err(|reason| {
            if reason.kind() == io::ErrorKind::NotFound {
                WriteError::NoFolder(folder.to_owned())
            } else {
                WriteError::Folder { folder: folder.to_owned(), reason: root_cause(reason) }
            }
        })?;
        Ok(file(Place::Temporary(temporary, target)))
    }

    /// Changes the final path, if the target is a file; an existing file there is replaced.
    pub fn redirect(&mut self, path: &Path) {
        match &mut self.place {
            #[cfg(target_os = "linux")]
            Place::Unnamed(_, target) => *target = path.to_owned(),
            Place::Temporary(_, target) => *target = path.to_owned(),
            Place::Stdout | Place::Direct(_) => return,
        }
        self.path = path.to_owned();
        self.options = WriteOptions::default();
    }

    /// The underlying file, to read or change what was written; `None` for the standard output, devices and pipes.
    pub fn file(&self) -> Option<&File> {
        match &self.place {
            #[cfg(target_os = "linux")]
            Place::Unnamed(file, _) => Some(file),
            Place::Temporary(file, _) => Some(file.as_file()),
            Place::Stdout | Place::Direct(_) => None,
        }
    }

    /// A handle to write to, without a buffer.
    ///
    /// # Errors
    /// [`WriteError::Failed`] if the system has no handles left.
    pub fn handle(&self) -> Result<Box<dyn Write + Send>, WriteError> {
        let clone = |file: &File| file.try_clone().map_err(|reason| self.failed(reason));
        Ok(match &self.place {
            Place::Stdout => Box::new(PatientStdout),
            Place::Direct(file) => Box::new(clone(file)?),
            #[cfg(target_os = "linux")]
            Place::Unnamed(file, _) => Box::new(clone(file)?),
            Place::Temporary(file, _) => Box::new(clone(file.as_file())?),
        })
    }

    /// The temporary path, if the file has one.
    pub fn temporary(&self) -> Option<&Path> {
        if let Place::Temporary(file, _) = &self.place { Some(file.path()) } else { None }
    }

    /// A write error with the name of this file.
    pub fn failed(&self, reason: io::Error) -> WriteError {
        WriteError::Failed { path: self.path.clone(), reason }
    }

    /// Moves the file to its final path.
    ///
    /// # Errors
    /// [`WriteError`] if that fails; the file is then removed.
    pub fn commit(self) -> Result<(), WriteError> {
        let AtomicFile { path, options, place } = self;
        let failed = |reason: io::Error| WriteError::Failed { path: path.clone(), reason };
        let kept = |reason: io::Error| match reason.kind() {
            io::ErrorKind::AlreadyExists => WriteError::Exists(path.clone()),
            _ => failed(reason),
        };
        let target = match place {
            Place::Stdout => return PatientStdout.flush().map_err(failed),
            Place::Direct(_) => return Ok(()),
            #[cfg(target_os = "linux")]
            Place::Unnamed(file, target) => {
                if options.durable {
                    file.sync_all().map_err(failed)?;
                }
                match link(&file, &target) {
                    Err(e) if e.kind() == io::ErrorKind::AlreadyExists && !options.no_clobber => {
                        replace(&file, &target).map_err(failed)?;
                    }
                    linked => linked.map_err(kept)?,
                }
                target
            }
            Place::Temporary(temporary, target) => {
                if options.durable {
                    temporary.as_file().sync_all().map_err(failed)?;
                }
                if options.no_clobber {
                    temporary.persist_noclobber(&target).map_err(|e| kept(e.error))?;
                } else {
                    temporary.persist(&target).map_err(|e| failed(e.error))?;
                }
                target
            }
        };
        if options.durable {
            sync_folder(folder_of(&target)).map_err(failed)?;
        }
        Ok(())
    }
}

/// The standard output. Where its reader is slow and it doesn't block, as pipes of some callers, writing waits.
struct PatientStdout;

impl PatientStdout {
    fn wait_for<T>(mut action: impl FnMut(&mut io::StdoutLock<'static>) -> io::Result<T>) -> io::Result<T> {
        const PAUSE: Duration = Duration::from_millis(2);
        loop {
            match action(&mut io::stdout().lock()) {
                Err(full) if full.kind() == io::ErrorKind::WouldBlock => thread::sleep(PAUSE),
                done => return done,
            }
        }
    }
}

impl Write for PatientStdout {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        PatientStdout::wait_for(|out| out.write(bytes))
    }

    fn flush(&mut self) -> io::Result<()> {
        PatientStdout::wait_for(Write::flush)
    }
}

pub(super) fn folder_of(file: &Path) -> &Path {
    match file.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    }
}

/// The permissions of a new file, or those of the file that it replaces.
fn mode_of(existing: Option<&fs::Metadata>) -> u32 {
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        existing.map_or(0o666, |old| old.permissions().mode() & 0o777)
    }
    #[cfg(not(unix))]
    {
        let _ = existing;
        0
    }
}

/// Syncs the names in a folder to the disk.
fn sync_folder(folder: &Path) -> io::Result<()> {
    // Only some systems can open folders, and only some file systems can sync them.
    if cfg!(unix) {
        match File::open(folder)?.sync_all() {
            Err(e) if !matches!(e.kind(), io::ErrorKind::InvalidInput | io::ErrorKind::Unsupported) => return Err(e),
            _ => {}
        }
    }
    Ok(())
}

/// The system's error: `tempfile` adds the temporary path to it.
fn root_cause(error: io::Error) -> io::Error {
    error.raw_os_error().map_or_else(|| io::Error::from(error.kind()), io::Error::from_raw_os_error)
}

#[cfg(test)]
mod tests {
    use super::*;

    const KEEP: WriteOptions = WriteOptions { no_clobber: true, durable: false };
    const DURABLE: WriteOptions = WriteOptions { no_clobber: false, durable: true };

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

    /// With and without a temporary name, replacing or not, the file is equal and alone in its folder.
    #[test]
    fn however_it_grows_it_is_the_same() {
        for named in [false, true] {
            let folder = tempfile::tempdir().unwrap();
            let (path, other) = (folder.path().join("a.png"), folder.path().join("b.png"));
            for (options, bytes) in [(DURABLE, "1"), (WriteOptions::default(), "2"), (DURABLE, "3")] {
                let file = AtomicFile::begin_with(&path, options, named).unwrap();
                assert_eq!(file.temporary().is_some(), named || !cfg!(target_os = "linux"));
                file.handle().unwrap().write_all(bytes.as_bytes()).unwrap();
                super::super::sweep(folder.path()); // The lock protects it.
                file.commit().unwrap();
                assert_eq!((fs::read_to_string(&path).unwrap(), names(folder.path()).len()), (bytes.to_owned(), 1));
            }
            let mut file = AtomicFile::begin_with(&path, DURABLE, named).unwrap();
            file.handle().unwrap().write_all(b"part").unwrap();
            file.redirect(&other);
            file.commit().unwrap();
            assert_eq!((fs::read(&path).unwrap(), fs::read(&other).unwrap()), (b"3".to_vec(), b"part".to_vec()));
            drop(AtomicFile::begin_with(&path, DURABLE, named).unwrap());
            assert_eq!(names(folder.path()), ["a.png", "b.png"]);
        }
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
