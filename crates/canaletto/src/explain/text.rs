//! Trees as text for a terminal: all of one, or a few screens in which what is alike is folded.

use super::patch::RadiosityTerms;
use super::ray_text::{levels_of, write_ray};
use super::ray_tree::RayTree;
use super::term::{Line, line};
use super::text_writer::{TextStyle, TextWriter, counted};
use super::tree::{Outcome, PixelTree, SampleNode};
use crate::film::WeightedSum;
use crate::math::Rgb;
use std::fmt::{self, Display, Formatter};

/// The most lines of a folded text that has no number of levels.
const MOST_LINES: usize = 96;

/// The most samples that have a line each.
const MOST_SAMPLES: usize = 16;

/// The most objects that have a line each, if there are more samples.
const MOST_OBJECTS: usize = 8;

/// The full text. Its numbers parse back to the tree's.
impl Display for PixelTree {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        f.write_str(&self.text(&TextStyle::FULL))
    }
}

/// The full text. Its numbers parse back to the tree's.
impl Display for RayTree {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        f.write_str(&self.text(&TextStyle::FULL))
    }
}

impl PixelTree {
    /// The tree as text. A short text has one sample, the one nearest to the pixel's colour, and the rays that fit into
    /// about a hundred lines.
    pub fn text(&self, style: &TextStyle) -> String {
        let chosen = self.nearest_to_mean();
        let deepest = self.samples.get(chosen).map_or(1, |sample| levels_of(&sample.ray));
        fitting(style, deepest, |levels| self.written(style, levels, chosen))
    }

    fn written(&self, style: &TextStyle, levels: u32, chosen: usize) -> String {
        let mut w = TextWriter::new(style, levels, &self.radiosity);
        let ([x, y], [cx, cy], [width, height]) = (self.pixel, self.chapter_pixel, self.size);
        writeln!(
            w,
            "pixel ({x}, {y}) of {width} x {height}, counted from the top left; ({cx}, {cy}) counted from the lower \
             left"
        );
        if let Some(camera) = &self.camera {
            writeln!(w);
            w.lines("", camera.lines());
        }
        for (index, sample) in self.samples.iter().enumerate().filter(|(index, _)| style.is_full || *index == chosen) {
            writeln!(w);
            if self.samples.len() > 1 {
                let nearest = if w.is_full { "" } else { ", the nearest to the pixel's colour" };
                let (number, share) = (index + 1, (sample.weight / self.weights()) as f32);
                w.line("", &line!("sample {} of {}, weight {}{}", number, self.samples.len(), share, nearest));
            }
            write_sample(&mut w, sample);
        }
        writeln!(w);
        if w.is_full {
            write_unexplained(&mut w, &self.radiosity);
        }
        if self.samples.len() > 1 {
            if !w.is_full {
                self.write_samples(&mut w);
            }
            writeln!(w, "pixel = weighted mean of {} samples", self.samples.len());
        }
        write_equal(&mut w, self.sum(), "rendered pixel    ", self.color);
        w.lines("", self.developed.lines(self.color));
        w.text
    }

    fn weights(&self) -> f64 {
        self.samples.iter().map(|sample| sample.weight).sum()
    }

    /// The sample whose colour is nearest to the pixel's.
    pub(super) fn nearest_to_mean(&self) -> usize {
        let distance = |sample: &SampleNode| {
            let [r, g, b] = (sample.ray.color - self.color).to_array().map(f64::from);
            r * r + g * g + b * b
        };
        let by_distance = |a: &usize, b: &usize| distance(&self.samples[*a]).total_cmp(&distance(&self.samples[*b]));
        (0..self.samples.len()).filter(|&i| self.samples[i].weight > 0.0).min_by(by_distance).unwrap_or(0)
    }

    /// Writes a line for each sample, or for each object that samples see.
    fn write_samples(&self, w: &mut TextWriter) {
        if self.samples.len() <= MOST_SAMPLES {
            for (index, sample) in self.samples.iter().enumerate() {
                let (number, share) = (index + 1, (sample.weight / self.weights()) as f32);
                let (place, color) = (sample.position.map(|v| v as f32), sample.ray.color);
                let words = line!("sample {}: weight {}, at {}, {}: {}", number, share, place, seen_by(sample), color);
                w.line("", &words);
            }
            return;
        }
        let mut objects: Vec<(&str, usize, f64, WeightedSum)> = Vec::new();
        for sample in &self.samples {
            let name = seen_by(sample);
            let index = objects.iter().position(|(other, ..)| *other == name).unwrap_or_else(|| {
                objects.push((name, 0, 0.0, WeightedSum::default()));
                objects.len() - 1
            });
            let (_, count, weight, sum) = &mut objects[index];
            *count += 1;
            *weight += sample.weight;
            sum.add(sample.ray.color, sample.weight);
        }
        objects.sort_by(|a, b| b.2.total_cmp(&a.2));
        for (name, count, weight, sum) in objects.iter().take(MOST_OBJECTS) {
            let (samples, share) = (counted(*count, "sample"), (weight / self.weights()) as f32);
            w.line("", &line!("{} of {}: weight {}, mean {}", samples, *name, share, sum.mean()));
        }
        if objects.len() > MOST_OBJECTS {
            let more: usize = objects[MOST_OBJECTS..].iter().map(|(_, count, ..)| count).sum();
            writeln!(w, "{} of {} others", counted(more, "sample"), objects.len() - MOST_OBJECTS);
        }
    }
}

impl RayTree {
    /// The tree as text, as [`PixelTree::text`].
    pub fn text(&self, style: &TextStyle) -> String {
        fitting(style, levels_of(&self.ray), |levels| {
            let mut w = TextWriter::new(style, levels, &self.radiosity);
            write_ray(&mut w, &self.ray, 1, "");
            writeln!(w);
            if w.is_full {
                write_unexplained(&mut w, &self.radiosity);
            }
            write_equal(&mut w, self.ray.sum(), "colour of the ray ", self.color);
            w.text
        })
    }
}

/// The text with as many levels as the style wants, or as fit.
fn fitting(style: &TextStyle, deepest: u32, written: impl Fn(u32) -> String) -> String {
    if let Some(levels) = style.levels {
        return written(levels.max(1));
    }
    if style.is_full {
        return written(u32::MAX);
    }
    let mut text = written(1);
    for levels in 2..=deepest {
        let deeper = written(levels);
        if deeper.lines().count() > MOST_LINES {
            break;
        }
        text = deeper;
    }
    text
}

/// Writes how many patches and places aren't explained.
fn write_unexplained(w: &mut TextWriter, radiosity: &RadiosityTerms) {
    for (more, noun) in [(radiosity.more_patches, "patches"), (radiosity.more_places, "blended places")] {
        if more > 0 {
            writeln!(w, "{more} more {noun} under the pixel: not explained");
        }
    }
}

/// The object that a sample's ray meets.
fn seen_by(sample: &SampleNode) -> &str {
    match &sample.ray.outcome {
        Outcome::Miss { .. } => "background",
        Outcome::Hit(hit) => &hit.object,
    }
}

impl SampleNode {
    /// The terms of a camera ray's start.
    pub(super) fn lines<'t>(&self) -> Vec<Line<'t>> {
        let [x, y] = self.position;
        let ray = match self.start {
            None => line!("camera ray through x = {}, y = {}: d = {d:5.10}  (5.10)", x, y, self.chapter_direction),
            Some(start) => {
                let start = line!("camera ray through x = {}, y = {}: o = {start}", x, y, start);
                start.and(line!(", d = -d_f*z_e = {d}", self.chapter_direction))
            }
        };
        let mut lines =
            vec![line!("{place in the picture:5.10}{weight}", self.position, self.weight).written_if(false), ray];
        lines.extend(drawn_lines(self.time, self.lens));
        lines.into_iter().map(Line::of_ray).collect()
    }
}

/// The random numbers of a sample's time and lens.
pub(super) fn drawn_lines<'t>(time: Option<f64>, lens: Option<[f64; 2]>) -> Vec<Line<'t>> {
    let time = time.map(|time| line!("at time {time} of 0 (shutter opens) to 1 (shutter closes)", time));
    let lens = lens.map(|[right, up]| {
        let start = line!("from the point of the lens {lens, to the right} to the right of its centre", right);
        start.and(line!(" and {lens, upwards} above it", up))
    });
    time.into_iter().chain(lens).collect()
}

fn write_sample(w: &mut TextWriter, sample: &SampleNode) {
    w.lines("", sample.lines());
    if let Some(raster) = &sample.raster {
        w.lines("", raster.lines(w.is_full));
    }
    write_ray(w, &sample.ray, 1, "");
}

pub(super) fn write_equal(w: &mut TextWriter, sum: Rgb, name: &str, rendered: Rgb) {
    let equal = if sum == rendered { "equal, bit for bit" } else { "NOT equal: this is a bug" };
    w.lines("", [line!("sum of the terms  {}", sum), line!("{}{}  ({})", name, rendered, equal)]);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patches_and_places_that_are_not_explained_are_counted() {
        let terms = RadiosityTerms { more_patches: 3, more_places: 1200, ..RadiosityTerms::default() };
        let mut w = TextWriter::new(&TextStyle::FULL, 1, &terms);
        write_unexplained(&mut w, &terms);
        let lines: Vec<&str> = w.text.lines().collect();
        assert_eq!(
            lines,
            [
                "3 more patches under the pixel: not explained",
                "1200 more blended places under the pixel: not explained"
            ]
        );
    }
}
