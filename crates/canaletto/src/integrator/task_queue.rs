//! The queue of tasks that all threads of a pool work off: tiles of pictures, and what is done before and after them.

use crate::job::Observer;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

/// Numbered tasks with one flag that stops all threads: by an observer, by a task that breaks, or by a panic.
pub(crate) struct TaskQueue<'a> {
    observer: &'a dyn Observer,
    stopped: AtomicBool,
}

impl<'a> TaskQueue<'a> {
    /// A queue that an observer may stop.
    pub(crate) fn new(observer: &'a dyn Observer) -> TaskQueue<'a> {
        TaskQueue { observer, stopped: AtomicBool::new(false) }
    }

    /// Whether the work is to end. Tasks ask at intervals.
    pub(crate) fn is_stopped(&self) -> bool {
        self.stopped.load(Ordering::Relaxed) || self.observer.cancelled()
    }

    /// Works off the tasks with these numbers, on all threads of the current rayon pool. Each thread has a worker of
    /// its own. Breaks if the queue was stopped before all were done.
    pub(crate) fn run<W>(
        &self,
        tasks: std::ops::Range<usize>,
        new_worker: impl Fn() -> W + Sync,
        task: impl Fn(&mut W, usize) -> ControlFlow<()> + Sync,
    ) -> ControlFlow<()> {
        let next = AtomicUsize::new(tasks.start);
        rayon::broadcast(|_| {
            let ended = StopOnDrop(&self.stopped);
            let mut worker = new_worker();
            while !self.stopped.load(Ordering::Relaxed) {
                let number = next.fetch_add(1, Ordering::Relaxed);
                if number >= tasks.end {
                    break;
                }
                if task(&mut worker, number).is_break() {
                    self.stopped.store(true, Ordering::Relaxed);
                }
            }
            std::mem::forget(ended);
        });
        if self.stopped.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }

    /// The results of all tasks, in the order of their numbers. Breaks if the queue was stopped.
    pub(crate) fn collect<W, T: Send>(
        &self,
        count: usize,
        new_worker: impl Fn() -> W + Sync,
        task: impl Fn(&mut W, usize) -> ControlFlow<(), T> + Sync,
    ) -> ControlFlow<(), Vec<T>> {
        let results: Vec<Mutex<Option<T>>> = (0..count).map(|_| Mutex::new(None)).collect();
        self.run(0..count, new_worker, |worker, number| {
            let result = task(worker, number)?;
            *results[number].lock().unwrap_or_else(PoisonError::into_inner) = Some(result);
            ControlFlow::Continue(())
        })?;
        let results =
            results.into_iter().filter_map(|result| result.into_inner().unwrap_or_else(PoisonError::into_inner));
        ControlFlow::Continue(results.collect())
    }
}

/// Ends the work of all threads when it is dropped, as by a panic in one of them.
struct StopOnDrop<'a>(&'a AtomicBool);

impl Drop for StopOnDrop<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}
