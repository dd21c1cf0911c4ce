//! Temporary files for pictures that are being written.
//!
//! On Linux and most of its file systems they have no name, so that none remains, even if the program is killed.
//! Elsewhere they have temporary names and are locked. [`sweep`] removes the files that killed programs left: temporary
//! files without a lock.

#[cfg(target_os = "linux")]
use super::write::folder_of;
use crate::file_id::FileId;
use std::fs::{self, File, TryLockError};
use std::io;
use std::path::Path;
#[cfg(target_os = "linux")]
use std::path::PathBuf;
use tempfile::{Builder, NamedTempFile};

/// The prefix and suffix of temporary names; letters and digits are between them.
const PREFIX: &str = ".canaletto-";
const SUFFIX: &str = ".tmp";

/// An unnamed file; `None` where the file system has none, or where it couldn't be linked later.
#[cfg(target_os = "linux")]
pub(super) fn unnamed(folder: &Path, mode: u32) -> Option<File> {
    use rustix::fs::{CWD, Mode, OFlags, openat};
    let flags = OFlags::TMPFILE | OFlags::RDWR | OFlags::CLOEXEC;
    let file: File = openat(CWD, folder, flags, Mode::from_raw_mode(mode)).ok()?.into();
    // Linking needs /proc.
    name_of(&file).symlink_metadata().ok()?;
    // The lock protects the moment in which the file has a temporary name.
    let _ = file.try_lock();
    Some(file)
}

#[cfg(target_os = "linux")]
fn name_of(file: &File) -> PathBuf {
    use std::os::fd::AsRawFd;
    PathBuf::from(format!("/proc/self/fd/{}", file.as_raw_fd()))
}

/// Links an unnamed file at `target`, which must not exist.
#[cfg(target_os = "linux")]
pub(super) fn link(file: &File, target: &Path) -> io::Result<()> {
    use rustix::fs::{AtFlags, CWD, linkat};
    Ok(linkat(CWD, name_of(file), CWD, target, AtFlags::SYMLINK_FOLLOW)?)
}

/// Links an unnamed file in place of the file at `target`. No system does this in one step, so it briefly has a
/// temporary name.
#[cfg(target_os = "linux")]
pub(super) fn replace(file: &File, target: &Path) -> io::Result<()> {
    let folder = folder_of(target);
    let temporary = temporary_names(|name| {
        let name = folder.join(name);
        link(file, &name).map(|()| name)
    })?;
    fs::rename(&temporary, target).inspect_err(|_| _ = fs::remove_file(&temporary))
}

/// Calls `with` with temporary names until one is free.
#[cfg(target_os = "linux")]
fn temporary_names<T>(mut with: impl FnMut(String) -> io::Result<T>) -> io::Result<T> {
    use std::hash::{BuildHasher, Hasher, RandomState};
    const TRIES: usize = 1000;
    for _ in 0..TRIES {
        let random = RandomState::new().build_hasher().finish();
        match with(format!("{PREFIX}{random:016x}{SUFFIX}")) {
            Err(e) if e.kind() == io::ErrorKind::AlreadyExists => {}
            other => return other,
        }
    }
    Err(io::ErrorKind::AlreadyExists.into())
}

/// A locked file with a temporary name.
pub(super) fn temporary(folder: &Path, mode: u32) -> io::Result<NamedTempFile> {
    let mut builder = Builder::new();
    builder.prefix(PREFIX).suffix(SUFFIX);
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(fs::Permissions::from_mode(mode));
    }
    #[cfg(not(unix))]
    let _ = mode;
    loop {
        let file = builder.tempfile_in(folder)?;
        // Some file systems have no locks.
        let _ = file.as_file().try_lock();
        // Between creation and lock, another program may have removed it as a leftover.
        match (FileId::of(file.path()), file.as_file().metadata().and_then(|m| FileId::with(file.path(), &m))) {
            (Ok(named), Ok(open)) if named == open => return Ok(file),
            (Err(e), _) if e.kind() != io::ErrorKind::NotFound => return Err(e),
            _ => {}
        }
    }
}

/// Removes Canaletto's temporary files that killed programs left in a folder. These are files of the current user
/// without a lock. Files that can't be read or removed stay.
pub fn sweep(folder: &Path) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    let is_ours = |name: &str| {
        let middle = name.strip_prefix(PREFIX).and_then(|rest| rest.strip_suffix(SUFFIX));
        middle.is_some_and(|middle| !middle.is_empty() && middle.bytes().all(|b| b.is_ascii_alphanumeric()))
    };
    let names = entries.filter_map(|entry| Some(entry.ok()?.path()));
    for path in names.filter(|path| path.file_name().and_then(|name| name.to_str()).is_some_and(is_ours)) {
        if path.symlink_metadata().is_ok_and(|file| file.is_file() && is_of_this_user(&file)) {
            let _ = remove_unlocked(&path);
        }
    }
}

fn remove_unlocked(path: &Path) -> io::Result<()> {
    let file = File::open(path)?;
    match file.try_lock() {
        Ok(()) => {}
        Err(TryLockError::WouldBlock) => return Ok(()),
        Err(TryLockError::Error(error)) => return Err(error),
    }
    // Its program may have renamed it meanwhile, and another file may have this name.
    let same = FileId::of(path)? == FileId::with(path, &file.metadata()?)?;
    if same { fs::remove_file(path) } else { Ok(()) }
}

fn is_of_this_user(file: &fs::Metadata) -> bool {
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt;
        file.uid() == rustix::process::geteuid().as_raw()
    }
    #[cfg(not(unix))]
    {
        let _ = file;
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::{AtomicFile, WriteOptions};

    #[test]
    fn only_what_is_left_behind_is_swept() {
        let folder = tempfile::tempdir().unwrap();
        let keep = [".canaletto-.tmp", ".canaletto-a-b.tmp", ".canaletto-abc.png", "canaletto-abc.tmp", "b.tmp"];
        for name in keep.iter().chain(&[".canaletto-abc123.tmp", ".canaletto-0123456789abcdef.tmp"]) {
            fs::write(folder.path().join(name), "x").unwrap();
        }
        fs::create_dir(folder.path().join(".canaletto-folder.tmp")).unwrap();
        #[cfg(unix)]
        std::os::unix::fs::symlink("b.tmp", folder.path().join(".canaletto-link.tmp")).unwrap();
        let writing = AtomicFile::begin_named(&folder.path().join("a.png"), WriteOptions::default()).unwrap();
        let growing = writing.temporary().unwrap().file_name().unwrap().to_str().unwrap().to_owned();
        sweep(folder.path());
        let mut expected: Vec<String> = keep.map(str::to_owned).into();
        expected.extend([".canaletto-folder.tmp".into(), growing]);
        if cfg!(unix) {
            expected.push(".canaletto-link.tmp".into());
        }
        expected.sort();
        let entries = fs::read_dir(folder.path()).unwrap();
        let mut left: Vec<String> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        left.sort();
        assert_eq!(left, expected);
        writing.commit().unwrap();
    }
}
