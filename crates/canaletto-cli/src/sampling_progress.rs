//! Progress of form factors on stderr: a line that changes in place, on a terminal only.

use crate::format::{count, plural, rate};
use crate::interrupt;
use crate::progress::{ProgressFlag, Style};
use canaletto::form_factor::{FormFactorProgress, SamplingProgress};
use indicatif::ProgressBar;
use std::ops::ControlFlow;
use std::time::Instant;

/// Shows how far sampling has come.
pub(crate) struct SamplingDisplay {
    start: Instant,
    line: Option<ProgressBar>,
}

impl SamplingDisplay {
    /// Starts the display.
    pub(crate) fn begin(quiet: bool) -> SamplingDisplay {
        let shown = Style::new(ProgressFlag::Auto, quiet) == Style::Bar;
        SamplingDisplay { start: Instant::now(), line: shown.then(ProgressBar::new_spinner) }
    }

    /// Shows a state. Breaks after a signal.
    pub(crate) fn show(&self, progress: &FormFactorProgress) -> ControlFlow<()> {
        if let Some(line) = &self.line {
            line.set_message(match *progress {
                FormFactorProgress::Rays(SamplingProgress { rays, standard_error }) => {
                    let seconds = self.start.elapsed().as_secs_f64().max(1e-9);
                    let error =
                        if standard_error.is_finite() { format!(", ± {standard_error:.1e}") } else { String::new() };
                    format!("{} rays, {}{error}", count(rays), rate(rays as f64 / seconds))
                }
                FormFactorProgress::Hemicubes(points) => plural(points.into(), "hemicube"),
                _ => String::new(),
            });
            line.tick();
        }
        if interrupt::requested() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }

    /// Removes the line.
    pub(crate) fn finish(self) {
        if let Some(line) = &self.line {
            line.finish_and_clear();
        }
    }
}
