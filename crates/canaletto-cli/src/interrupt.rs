//! Ctrl-C and requests to terminate: the first stops a render and saves what there is, the second exits at once.

use crate::exit::Exit;
use crate::failure::Failure;
use std::process;
use std::sync::atomic::{AtomicBool, AtomicU8, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

static STOP: AtomicBool = AtomicBool::new(false);
static SIGNALS: AtomicU8 = AtomicU8::new(0);
/// Whether there is something to save.
static RENDERING: AtomicBool = AtomicBool::new(false);
/// Held while files are written.
static WRITING: Mutex<()> = Mutex::new(());

/// How long a second Ctrl-C waits for a file that is being written, so that no half file is left.
const PATIENCE: Duration = Duration::from_secs(2);

/// From now on signals are handled here. `json`: a program reads stderr.
pub(crate) fn install(json: bool) {
    // Without a handler Ctrl-C still ends the program, as it always does.
    let _ = ctrlc::set_handler(move || {
        let first = SIGNALS.fetch_add(1, Ordering::SeqCst) == 0;
        STOP.store(true, Ordering::SeqCst);
        if first && RENDERING.load(Ordering::SeqCst) {
            return;
        }
        let start = Instant::now();
        while start.elapsed() < PATIENCE {
            if let Ok(_guard) = WRITING.try_lock() {
                leave(json);
            }
            thread::sleep(Duration::from_millis(5));
        }
        leave(json);
    });
}

fn leave(json: bool) -> ! {
    Failure::new(Exit::Interrupted, "interrupted; nothing more is written").print(json);
    process::exit(i32::from(Exit::Interrupted.code()))
}

/// Whether the user wants to stop.
pub(crate) fn requested() -> bool {
    STOP.load(Ordering::Relaxed)
}

/// While this lives a first Ctrl-C stops rendering only, so that the picture so far can be saved.
pub(crate) struct Rendering;

impl Rendering {
    pub(crate) fn begin() -> Rendering {
        RENDERING.store(true, Ordering::SeqCst);
        Rendering
    }
}

impl Drop for Rendering {
    fn drop(&mut self) {
        RENDERING.store(false, Ordering::SeqCst);
    }
}

/// While this lives no signal ends the program (for a while).
pub(crate) fn writing() -> MutexGuard<'static, ()> {
    WRITING.lock().unwrap_or_else(PoisonError::into_inner)
}
