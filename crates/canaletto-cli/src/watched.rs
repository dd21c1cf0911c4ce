//! Work on pixels whose progress is shown, and which a first signal stops.

use crate::exit::Exit;
use crate::failure::Failure;
use crate::interrupt;
use crate::progress::{ProgressDisplay, RunProgress, Style};
use canaletto::render::{Job, JobError};

/// Does work on the pixels of a job. `name` is the scene's file, and `label` says what is done.
pub(crate) fn watched<T>(
    style: Style,
    name: &str,
    label: &str,
    job: &Job,
    work: impl FnOnce(&ProgressDisplay) -> Result<T, JobError>,
) -> Result<T, Failure> {
    let [_, _, width, height] = job.window();
    let pixels = u64::from(width) * u64::from(height);
    let watch = ProgressDisplay::begin(style, job.frame, format!("{label}  "), pixels, RunProgress::SINGLE);
    let _rendering = interrupt::Rendering;
    interrupt::Rendering::begins();
    let done = work(&watch);
    watch.finish();
    done.map_err(|e| Failure::new(Exit::Scene, format!("{name}: {e}")))
}
