//! The report about a finished picture.

use crate::format::{count, duration, plural, rate};
use crate::solutions::SolutionSource;
use canaletto::film::SampleStatistics;
use canaletto::integrator::RayCounts;
use canaletto::world::ReuseCounts;
use serde::Serialize;
use serde_json::Value;
use std::collections::BTreeMap;
use std::time::Duration;

/// The event "done" of one picture, finished or interrupted.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Report {
    /// The text "done".
    pub event: &'static str,
    /// The frame's number.
    pub frame: u32,
    /// Whether every pixel was rendered.
    pub complete: bool,
    /// The number of rendered pixels.
    pub pixels_done: u64,
    /// The number of all pixels.
    pub pixels: u64,
    /// The files written, the picture first; "-" is the standard output.
    pub files: Vec<String>,
    /// The last of the files, if it holds the samples of a partial picture whose own file can't.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub samples_file: Option<String>,
    /// The checkpoint of an unfinished picture.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub checkpoint: Option<String>,
    /// The width and height of the rendered part.
    pub size: [u32; 2],
    /// The number of primitives in the world.
    pub primitives: u64,
    /// The numbers of kept, refitted and built hierarchies over meshes and clouds.
    pub hierarchies: ReuseCounts,
    /// The numbers of rays by kind.
    pub rays: RayCounts,
    /// The stops that the exposure "auto" became.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub metered_exposure: Option<f32>,
    /// Where the solution of radiosity comes from.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub solution: Option<SolutionSource>,
    /// The samples of a picture that was made in passes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub samples: Option<SampleReport>,
    /// What is left of the noise of a picture that was stopped, or that missed what it was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise_left: Option<Value>,
    /// Other numbers of the integrator.
    #[serde(flatten)]
    pub counts: BTreeMap<&'static str, u64>,
    /// The number of all rays.
    pub rays_total: u64,
    /// The rays per second of rendering.
    pub rays_per_second: f64,
    /// The number of threads.
    pub threads: usize,
    /// The duration of each step.
    pub seconds: Times,
}

/// The samples of a picture that was made in passes.
#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct SampleReport {
    /// The smallest, largest and mean number of samples of a pixel.
    pub fewest: u32,
    pub most: u32,
    pub mean: f64,
    /// The largest relative error of a block of pixels, if it was limited and is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise: Option<f32>,
    /// The number of samples that weren't finite.
    pub non_finite: u64,
    /// The number of samples that --clamp made darker, and the share of the picture's light that it removed.
    pub clamped: u64,
    pub removed: f64,
}

impl SampleReport {
    pub(crate) fn new(statistics: &SampleStatistics, pixels: u64) -> SampleReport {
        SampleReport {
            fewest: statistics.fewest,
            most: statistics.most,
            mean: statistics.total as f64 / pixels.max(1) as f64,
            noise: statistics.noise.filter(|noise| noise.is_finite()),
            non_finite: statistics.non_finite,
            clamped: statistics.clamped,
            removed: statistics.removed_share(),
        }
    }

    /// The numbers for people.
    pub(crate) fn words(&self) -> String {
        let (fewest, most) = (self.fewest, self.most);
        let noise = self.noise.map_or_else(String::new, |noise| format!(", noise {noise:.3}"));
        if fewest == most {
            return format!("{}{noise}", plural(fewest.into(), "sample"));
        }
        format!("{} to {} samples, {:.0} on average{noise}", count(fewest.into()), count(most.into()), self.mean)
    }
}

/// The durations of the steps in seconds.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub(crate) struct Times {
    pub read: f64,
    pub build: f64,
    pub render: f64,
    pub write: f64,
}

impl Report {
    /// The start of a line about one of many frames, for people.
    pub(crate) fn line(&self) -> String {
        let Times { read, build, render, write } = self.seconds;
        let time = duration(Duration::from_secs_f64((read + build + render + write).max(0.0)));
        format!(
            "{}: frame {}, {time}, {}",
            self.files.first().map_or("-", String::as_str),
            self.frame,
            rate(self.rays_per_second)
        )
    }

    /// A report of several lines, for people.
    pub(crate) fn text(&self, sampling: &str) -> String {
        let mut out = String::new();
        let [width, height] = self.size;
        let files = files_in_words(&self.files, self.samples_file.as_deref());
        // What a render with an open end made isn't what it was allowed to.
        let made = self.samples.map_or_else(|| sampling.to_owned(), |samples| format!("{} per pixel", samples.words()));
        out += &format!("{files}: {width} x {height} pixels, {made}\n");
        if let Some(stops) = self.metered_exposure {
            out += &format!("  auto exposure: {}\n", exposure_words(stops));
        }
        if self.rays_total > 0 {
            out += &format!("  {:<10} {:>15} {:>15}\n", "rays", "traced", "hit");
        }
        for (name, rays) in [
            ("eye", self.rays.eye),
            ("reflected", self.rays.reflected),
            ("refracted", self.rays.refracted),
            ("scattered", self.rays.scattered),
            ("passed", self.rays.passed),
            ("shadow", self.rays.shadow),
        ] {
            if rays.traced > 0 {
                out += &format!("  {name:<10} {:>15} {:>15}\n", count(rays.traced), count(rays.hit));
            }
        }
        for (name, &number) in self.counts.iter().filter(|(_, number)| **number > 0) {
            out += &format!("  {} {name}\n", count(number));
        }
        let t = |seconds: f64| duration(Duration::from_secs_f64(seconds.max(0.0)));
        out += &format!("  {}, {}\n", plural(self.primitives, "primitive"), plural(self.threads as u64, "thread"));
        out += &format!(
            "  read {}, build {}, render {}{}, write {}",
            t(self.seconds.read),
            t(self.seconds.build),
            t(self.seconds.render),
            if self.rays_total > 0 { format!(" ({})", rate(self.rays_per_second)) } else { String::new() },
            t(self.seconds.write)
        );
        out
    }
}

/// Metered stops for people, with the flag that makes the same picture.
fn exposure_words(stops: f32) -> String {
    format!("{stops} stops (--exposure {stops})")
}

/// The files of a picture for people. The last of them is `samples`, if that is given.
fn files_in_words(files: &[String], samples: Option<&str>) -> String {
    let layers = |count: usize| plural(count as u64, "layer");
    match (files, samples) {
        ([], _) => "nothing written".into(),
        ([only], _) if only == "-" => "standard output".into(),
        ([only], _) => only.clone(),
        ([picture, more @ ..], None) => format!("{picture} and {}", layers(more.len())),
        ([picture, _], Some(samples)) => format!("{picture} and its samples in {samples}"),
        ([picture, more @ .., _], Some(samples)) => {
            format!("{picture}, {} and its samples in {samples}", layers(more.len()))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_told_by_what_they_hold() {
        let words = |files: &[&str], samples| {
            files_in_words(&files.iter().map(|file| (*file).to_owned()).collect::<Vec<_>>(), samples)
        };
        assert_eq!(words(&["-"], None), "standard output");
        assert_eq!(words(&["a.png", "a.depth.exr"], None), "a.png and 1 layer");
        assert_eq!(words(&["a.png", "s.exr"], Some("s.exr")), "a.png and its samples in s.exr");
        let parts = ["a.png", "a.depth.png", "a.normal.png", "s"];
        assert_eq!(words(&parts, Some("s")), "a.png, 2 layers and its samples in s");
    }
}
