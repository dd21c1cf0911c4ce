//! Ctrl-C and requests to terminate. The first one stops a render, which saves what there is, and ends everything else; if that
//! takes too long, the program leaves all the same. The second one ends it at once. Files are never left half written: they
//! have no name until they are whole.

use crate::exit::Exit;
use crate::failure::{Failure, eprint_line};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU8, Ordering};
use std::sync::{Mutex, OnceLock, PoisonError, mpsc};
use std::time::{Duration, Instant};
use std::{fs, process, thread};

static SIGNALS: AtomicU8 = AtomicU8::new(0);
/// When the first one came.
static FIRST: OnceLock<Instant> = OnceLock::new();
/// What a first signal meets.
static DOING: AtomicU8 = AtomicU8::new(LEAVES);
/// A temporary file that another program writes, which stays if this one ends.
static LEFTOVER: Mutex<Option<PathBuf>> = Mutex::new(None);

/// Nothing that is worth saving.
const LEAVES: u8 = 0;
/// A render: what there is of the picture can be saved as soon as its threads have stopped.
const RENDERS: u8 = 1;
/// That part is being saved into a file.
const SAVES: u8 = 2;

/// How long a render may go on after a signal.
const PATIENCE: Duration = Duration::from_millis(1700);
/// How long after a signal what there is of a picture may be put into its file.
const SAVING: Duration = Duration::from_millis(1000);

/// From now on signals are handled here. `json`: a program reads stderr.
pub(crate) fn install(json: bool) {
    // Without a handler Ctrl-C still ends the program, as it always does.
    let _ = ctrlc::set_handler(move || {
        FIRST.get_or_init(Instant::now);
        let first = SIGNALS.fetch_add(1, Ordering::SeqCst) == 0;
        if !first || DOING.load(Ordering::SeqCst) == LEAVES {
            leave(json);
        }
        // Not here: a second signal would wait for it.
        let watched = thread::Builder::new().spawn(move || {
            thread::sleep(PATIENCE);
            if DOING.load(Ordering::SeqCst) != SAVES {
                leave(json);
            }
            if !json {
                eprint_line("the picture so far is being saved; another Ctrl-C ends that");
            }
        });
        if watched.is_err() {
            leave(json);
        }
    });
}

fn leave(json: bool) -> ! {
    // If nobody reads stderr, or what fails is its lock, the end doesn't wait for it.
    const SAYING: Duration = Duration::from_millis(200);
    let (said, heard) = mpsc::channel();
    let saying = thread::Builder::new().spawn(move || {
        Failure::new(Exit::Interrupted, "interrupted; nothing more is written").print(json);
        let _ = said.send(());
    });
    if saying.is_ok() {
        let _ = heard.recv_timeout(SAYING);
    }
    if let Some(leftover) = LEFTOVER.lock().unwrap_or_else(PoisonError::into_inner).take() {
        let _ = fs::remove_file(leftover);
    }
    process::exit(i32::from(Exit::Interrupted.code()))
}

/// Whether the user wants to stop.
pub(crate) fn requested() -> bool {
    SIGNALS.load(Ordering::Relaxed) > 0
}

/// Whether there is time to save more of a picture.
pub(crate) fn leaves_time() -> bool {
    FIRST.get().is_none_or(|first| first.elapsed() < SAVING)
}

/// While this lives a first Ctrl-C may meet something that is worth saving.
pub(crate) struct Rendering;

impl Rendering {
    /// From now on it stops rendering only, so that the picture so far can be saved.
    pub(crate) fn begins() {
        DOING.store(RENDERS, Ordering::SeqCst);
    }

    /// From now on the part of a picture is saved into a file: that is waited for.
    pub(crate) fn saves() {
        DOING.store(SAVES, Ordering::SeqCst);
    }
}

impl Drop for Rendering {
    fn drop(&mut self) {
        DOING.store(LEAVES, Ordering::SeqCst);
    }
}

/// Removes this file if a signal ends the program.
pub(crate) fn remove_on_leaving(file: Option<&Path>) {
    *LEFTOVER.lock().unwrap_or_else(PoisonError::into_inner) = file.map(Path::to_owned);
}
