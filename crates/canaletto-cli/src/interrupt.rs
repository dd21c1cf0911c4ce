//! Ctrl-C and termination signals. The first signal stops a render, which then saves the picture so far. Without a
//! render, or if that takes too long, the first signal ends the program. The second signal ends it at once. No file is
//! left half written: a file gets its name when it is complete.

use crate::exit::Exit;
#[cfg(unix)]
use crate::exit::TERMINATED;
use crate::failure::{Failure, eprint_line};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU8, Ordering};
use std::sync::{Mutex, OnceLock, PoisonError, mpsc};
use std::time::{Duration, Instant};
use std::{fs, process, thread};

#[cfg(unix)]
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGUSR1};
#[cfg(unix)]
use signal_hook::iterator::Signals;

static SIGNALS: AtomicU8 = AtomicU8::new(0);
/// The time of the first signal.
static FIRST: OnceLock<Instant> = OnceLock::new();
/// The work that a first signal interrupts: `IDLE`, `RENDERING` or `SAVING`.
static PHASE: AtomicU8 = AtomicU8::new(IDLE);
/// A temporary file of another program, which would remain after this program ends.
static LEFTOVER: Mutex<Option<PathBuf>> = Mutex::new(None);

/// Whether a file that the render reads has changed, so that its picture isn't wanted any more.
static OUTDATED: AtomicBool = AtomicBool::new(false);

/// Whether a checkpoint was asked for by SIGUSR1, as schedulers send it before they end a job.
static CHECKPOINT: AtomicBool = AtomicBool::new(false);

/// There is nothing to save.
const IDLE: u8 = 0;
/// A render is running. The picture so far can be saved when its threads have stopped.
const RENDERING: u8 = 1;
/// The partial picture is being saved into a file.
const SAVING: u8 = 2;

/// The time that a render may continue after a signal.
const RENDER_LIMIT: Duration = Duration::from_millis(1700);
/// The time after a signal in which the samples of a partial picture may be encoded, or else the picture.
const SAVE_LIMIT: Duration = Duration::from_millis(1000);

/// The further time for the picture after its samples.
const PICTURE_TIME: Duration = Duration::from_millis(500);
/// Whether the samples of the partial picture have had their time.
static SAMPLES_SAVED: AtomicBool = AtomicBool::new(false);

/// Installs the signal handler. `json`: stderr is for a program.
pub(crate) fn install(json: bool) {
    listen(move || {
        FIRST.get_or_init(Instant::now);
        let first = SIGNALS.fetch_add(1, Ordering::SeqCst) == 0;
        if !first || PHASE.load(Ordering::SeqCst) == IDLE {
            exit_now(json);
        }
        // The wait has a thread of its own, so that the listener stays free for a second signal.
        let watched = thread::Builder::new().spawn(move || {
            thread::sleep(RENDER_LIMIT);
            if PHASE.load(Ordering::SeqCst) != SAVING {
                exit_now(json);
            }
            if !json {
                eprint_line("the picture so far is being saved; another Ctrl-C ends that");
            }
        });
        if watched.is_err() {
            exit_now(json);
        }
    });
}

/// Calls `stop` for each signal that asks the program to end. Without a listener these end it by default.
#[cfg(unix)]
fn listen(stop: impl Fn() + Send + 'static) {
    let Ok(mut signals) = Signals::new([SIGINT, SIGTERM, SIGHUP, SIGUSR1]) else { return };
    let each = move || {
        for signal in signals.forever() {
            if signal == SIGUSR1 {
                CHECKPOINT.store(true, Ordering::Relaxed);
                continue;
            }
            // The exit code is known before anything may end the program.
            TERMINATED.fetch_or(signal == SIGTERM, Ordering::Relaxed);
            stop();
        }
    };
    let _ = thread::Builder::new().name("canaletto-signals".into()).spawn(each);
}

/// Calls `stop` for each request to end the program.
#[cfg(not(unix))]
fn listen(stop: impl Fn() + Send + 'static) {
    let _ = ctrlc::set_handler(stop);
}

/// Whether a checkpoint was asked for since the last call.
pub(crate) fn takes_checkpoint_request() -> bool {
    CHECKPOINT.swap(false, Ordering::Relaxed)
}

fn exit_now(json: bool) -> ! {
    // The end waits only this long for the message, since stderr may be blocked or locked.
    const MESSAGE_LIMIT: Duration = Duration::from_millis(200);
    let (said, heard) = mpsc::channel();
    let saying = thread::Builder::new().spawn(move || {
        Failure::new(Exit::Interrupted, "interrupted; nothing more is written").print(json);
        let _ = said.send(());
    });
    if saying.is_ok() {
        let _ = heard.recv_timeout(MESSAGE_LIMIT);
    }
    if let Some(leftover) = LEFTOVER.lock().unwrap_or_else(PoisonError::into_inner).take() {
        let _ = fs::remove_file(leftover);
    }
    process::exit(i32::from(Exit::Interrupted.code()))
}

/// Whether a signal has arrived.
pub(crate) fn requested() -> bool {
    SIGNALS.load(Ordering::Relaxed) > 0
}

/// Stops a render whose files have changed. Nothing of it is saved.
pub(crate) fn outdate() {
    OUTDATED.store(true, Ordering::Relaxed);
}

/// Whether [`outdate`] was called since [`renew`].
pub(crate) fn is_outdated() -> bool {
    OUTDATED.load(Ordering::Relaxed)
}

/// Lets the next render run.
pub(crate) fn renew() {
    OUTDATED.store(false, Ordering::Relaxed);
}

/// Whether a render must stop: after a signal, or since its files have changed.
pub(crate) fn stops() -> bool {
    requested() || is_outdated()
}

/// Whether there is time to save more of a picture.
pub(crate) fn has_time_to_save() -> bool {
    let more = if SAMPLES_SAVED.load(Ordering::Relaxed) { PICTURE_TIME } else { Duration::ZERO };
    FIRST.get().is_none_or(|first| first.elapsed() < SAVE_LIMIT + more)
}

/// Gives the picture a time of its own, after that of its samples.
pub(crate) fn samples_are_saved() {
    SAMPLES_SAVED.store(true, Ordering::Relaxed);
}

/// A scope in which a first signal may interrupt work that is worth saving.
pub(crate) struct Rendering;

impl Rendering {
    /// Starts the phase in which a signal only stops rendering, so that the picture so far can be saved.
    pub(crate) fn begins() {
        PHASE.store(RENDERING, Ordering::SeqCst);
    }

    /// Starts the phase in which a partial picture is saved into a file. The program waits for its end.
    pub(crate) fn saves() {
        PHASE.store(SAVING, Ordering::SeqCst);
    }
}

impl Drop for Rendering {
    fn drop(&mut self) {
        PHASE.store(IDLE, Ordering::SeqCst);
    }
}

/// Sets the file that is removed if a signal ends the program.
pub(crate) fn remove_on_leaving(file: Option<&Path>) {
    *LEFTOVER.lock().unwrap_or_else(PoisonError::into_inner) = file.map(Path::to_owned);
}
