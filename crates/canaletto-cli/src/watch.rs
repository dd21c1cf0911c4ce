//! `--watch`: renders again when a file changes that the render read, or tried to read.

use crate::exit::Exit;
use crate::failure::{Failure, eprint_line, plural};
use crate::interrupt;
use crate::progress::{Style, emit};
use serde_json::json;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, SystemTime};

/// The time between two looks at the files.
const PAUSE: Duration = Duration::from_millis(200);

/// What shows that a file changed: its time and its size in bytes. `None` for a file that isn't there.
type Stamp = Option<(SystemTime, u64)>;

/// The files that a command read or tried to read, each as it was before it was read for the first time.
#[derive(Clone, Debug, Default)]
pub(crate) struct ReadLog(Arc<Mutex<BTreeMap<PathBuf, Stamp>>>);

impl ReadLog {
    /// Notes a file before it is read.
    pub(crate) fn note(&self, file: PathBuf) {
        let mut files = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        files.entry(file).or_insert_with_key(|file| stamp(file));
    }

    fn has_changed(&self) -> bool {
        self.files().iter().any(|(file, before)| stamp(file) != *before)
    }

    fn files(&self) -> BTreeMap<PathBuf, Stamp> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn clear(&self) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clear();
    }
}

fn stamp(file: &Path) -> Stamp {
    let found = file.metadata().ok()?;
    Some((found.modified().ok()?, found.len()))
}

/// Renders again and again, each time after a change of a file in `log`. A change stops a render that runs. A mistake
/// in a scene is printed, and the next change may correct it. Ends after a signal, or if the command line is wrong from
/// the start.
pub(crate) fn watch(
    log: &ReadLog,
    style: Style,
    quiet: bool,
    mut render: impl FnMut() -> Result<Exit, Failure>,
) -> Result<Exit, Failure> {
    let watched = log.clone();
    thread::Builder::new()
        .name("canaletto-watch".into())
        .spawn(move || {
            loop {
                thread::sleep(PAUSE);
                if watched.has_changed() {
                    interrupt::outdate();
                }
            }
        })
        .map_err(|e| Failure::new(Exit::Failed, format!("can't start a thread: {e}")))?;
    let mut is_first = true;
    loop {
        interrupt::renew();
        match render() {
            Ok(Exit::Interrupted) if !interrupt::is_outdated() => return Ok(Exit::Interrupted),
            Ok(_) => {}
            Err(failure) if is_first && failure.exit() == Exit::Usage => return Err(failure),
            Err(failure) => failure.print(style == Style::Json),
        }
        is_first = false;
        let files = log.files().len();
        if style == Style::Json {
            emit(&json!({ "event": "watching", "files": files }));
        } else if !quiet && !interrupt::is_outdated() {
            eprint_line(&format!("watching {}; Ctrl-C ends", plural(files, "file")));
        }
        while !log.has_changed() {
            thread::sleep(PAUSE);
        }
        // A program may write a file in several steps.
        let mut before = log.files();
        loop {
            before.iter_mut().for_each(|(file, known)| *known = stamp(file));
            thread::sleep(PAUSE / 2);
            if before.iter().all(|(file, known)| stamp(file) == *known) {
                break;
            }
        }
        log.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn changes_are_seen() {
        let folder = tempfile::tempdir().unwrap();
        let [a, b] = ["a", "b"].map(|name| folder.path().join(name));
        fs::write(&a, "1").unwrap();
        let log = ReadLog::default();
        log.note(a.clone());
        log.note(b.clone());
        assert!(!log.has_changed());
        fs::write(&b, "new").unwrap();
        assert!(log.has_changed(), "a missing file came");
        fs::remove_file(&b).unwrap();
        assert!(!log.has_changed());
        fs::write(&a, "22").unwrap();
        assert!(log.has_changed(), "its size changed");
        // What was noted is as it was before the first read.
        log.note(a.clone());
        assert!(log.has_changed());
        log.clear();
        log.note(a.clone());
        assert!(!log.has_changed());
        fs::File::options().write(true).open(&a).unwrap().set_modified(SystemTime::UNIX_EPOCH).unwrap();
        assert!(log.has_changed(), "its time changed");
    }
}
