//! Observers of a render.

/// An observer of a render, which may cancel it. Its methods are called from many threads.
pub trait Observer: Sync {
    /// Whether to cancel. Called before every few pixels, and at intervals within them. Once it returns true,
    /// unfinished tiles are dropped and the picture so far is returned.
    fn cancelled(&self) -> bool {
        false
    }
    /// Reports the progress after each tile.
    fn progress(&self, _progress: &Progress) {}
}

/// The empty observer, which never cancels.
impl Observer for () {}

/// The progress of a render.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Progress {
    /// The number of finished pixels, summed over passes.
    pub pixels_done: u64,
    /// The number of all pixels, times the number of passes.
    pub pixels: u64,
    /// The number of rays traced so far.
    pub rays: u64,
}
