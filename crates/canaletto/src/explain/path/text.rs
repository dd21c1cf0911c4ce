//! Paths as text for a terminal.

use super::{Arrival, PathRay, PathSample, PathStep, PathTree};
use crate::explain::patch::RadiosityTerms;
use crate::explain::term::{Line, Term, line, of_ray, summand};
use crate::explain::text::{drawn_lines, write_equal};
use crate::explain::text_writer::{TextStyle, TextWriter, counted};
use crate::explain::tree::Side;
use crate::integrator::{Passage, PathChannel, PathEmitter, PathEnd};
use crate::material::Lobe;
use crate::math::Rgb;
use std::fmt::{self, Display, Formatter};

/// The most samples that have a line each, brightest first.
const MOST_LISTED: usize = 8;

/// All paths. The numbers parse back to the tree's.
impl Display for PathTree {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        f.write_str(&self.text(&TextStyle::FULL, None))
    }
}

impl PathTree {
    /// The paths as text. A short text has one path: that of the sample with the index `chosen`, or else the one
    /// nearest to the pixel's colour. The style's levels limit the vertices of each path.
    pub fn text(&self, style: &TextStyle, chosen: Option<usize>) -> String {
        let terms = RadiosityTerms::default();
        let mut w = TextWriter::new(style, style.levels.unwrap_or(u32::MAX), &terms);
        let ([x, y], [cx, cy], [width, height]) = (self.pixel, self.chapter_pixel, self.size);
        writeln!(
            w,
            "pixel ({x}, {y}) of {width} x {height}, counted from the top left; ({cx}, {cy}) counted from the lower \
             left"
        );
        let shown = chosen.or_else(|| self.nearest_to_mean());
        for (index, sample) in self.samples.iter().enumerate() {
            if style.is_full && chosen.is_none() || Some(index) == shown {
                let nearest =
                    if chosen.is_none() && !style.is_full { ", the nearest to the pixel's colour" } else { "" };
                let (count, share) = (self.samples.len(), (sample.weight / self.weights()) as f32);
                writeln!(w);
                w.line("", &line!("path {} of {}, weight {}{}", sample.number, count, share, nearest));
                let lines = sample.lines(w.levels);
                w.lines("", lines);
            }
        }
        writeln!(w);
        self.write_brightest(&mut w);
        if self.samples.len() > 1 {
            writeln!(w, "pixel = weighted mean of {} paths", self.samples.len());
        }
        write_equal(&mut w, self.sum(), "rendered pixel    ", self.color);
        w.lines("", self.developed.lines(self.color));
        w.text
    }

    fn weights(&self) -> f64 {
        self.samples.iter().map(|sample| sample.weight).sum()
    }

    /// Writes a line for each of the samples that add most.
    fn write_brightest(&self, w: &mut TextWriter) {
        let mut ranked: Vec<&PathSample> = self.samples.iter().collect();
        ranked.sort_by(|a, b| b.value().total_cmp(&a.value()).then(a.number.cmp(&b.number)));
        let total: f64 = ranked.iter().map(|sample| sample.value()).sum();
        let black = ranked.iter().filter(|sample| sample.color.is_black()).count();
        if black > 0 && ranked.len() > 1 {
            writeln!(w, "{} found no light", counted(black, "path"));
        }
        for sample in ranked.iter().filter(|sample| !sample.color.is_black()).take(MOST_LISTED) {
            let percent = if total > 0.0 { 100.0 * sample.value() / total } else { 0.0 };
            let bounces = counted(sample.rays.last().map_or(0, |ray| ray.depth as usize), "vertex")
                .replace("vertexs", "vertices");
            let share = format!("{percent:.1} % of the light");
            w.line("", &line!("path {}: {}, {}: {}", sample.number, share, bounces, sample.color));
        }
        if ranked.len() - black > MOST_LISTED {
            writeln!(w, "{} more", counted(ranked.len() - black - MOST_LISTED, "path"));
        }
    }
}

impl PathSample {
    /// What the sample adds to the pixel, as luminance times weight (Rec. 709).
    pub(super) fn value(&self) -> f64 {
        let [r, g, b] = self.color.to_array().map(f64::from);
        (0.2126 * r + 0.7152 * g + 0.0722 * b) * self.weight
    }
}

impl PathSample {
    /// The lines of the path, down to a vertex.
    fn lines(&self, levels: u32) -> Vec<Line<'_>> {
        let mut lines = self.start_lines();
        lines.extend(self.rays.iter().filter(|ray| ray.depth <= levels).flat_map(PathRay::lines));
        let more = self.rays.iter().filter(|ray| ray.depth > levels).count();
        lines.push(line!("{} more", counted(more, "ray")).written_if(more > 0));
        lines.push(line!("light of the path  {}", self.color));
        lines
    }

    /// The terms of the camera ray's start.
    pub(in crate::explain) fn start_lines<'t>(&self) -> Vec<Line<'t>> {
        let [x, y] = self.position;
        let mut lines = vec![
            line!("{place in the picture:5.10}{weight}", self.position, self.weight).written_if(false),
            line!("camera ray through x = {}, y = {}", x, y),
        ];
        lines.extend(drawn_lines(self.time, self.lens));
        lines.into_iter().map(Line::of_ray).collect()
    }
}

impl PathRay {
    pub(in crate::explain) fn lines(&self) -> Vec<Line<'_>> {
        let PathRay { depth, origin, direction, throughput, .. } = *self;
        let arrival = match &self.arrival {
            Arrival::Miss => line!("   {object}", "leaves the scene"),
            Arrival::Medium { point } => line!("   {object} at {p}", "scattered in a medium", of_ray(*point)),
            Arrival::Surface(surface) => {
                let side = if surface.side == Side::Inside { ", from inside" } else { "" };
                let start = line!("   hits {object} of material {material}", &surface.object, &surface.material);
                start.and(line!(" at {p}{}, normal {n}", surface.point, side, surface.normal).of_ray())
            }
        };
        let start =
            line!("{}. from {o} along {d}, throughput {throughput}", depth, origin, direction, throughput).of_ray();
        [start, arrival].into_iter().chain(self.steps.iter().flat_map(PathStep::lines)).collect()
    }
}

impl PathStep {
    fn lines(&self) -> Vec<Line<'_>> {
        let adds = |name: String, light| line!("     adds {}", summand(light).named(name));
        let lines = match *self {
            PathStep::Medium { distance, factor } => {
                vec![line!("   medium: {distance in the medium} through it, throughput x {}", distance as f32, factor)]
            }
            PathStep::Dispersed { channel, factor } => {
                let name = match channel {
                    PathChannel::Red => "red",
                    PathChannel::Green => "green",
                    PathChannel::Blue => "blue",
                };
                vec![line!("   dispersion: goes on for {dispersion} only, throughput x {}", name, factor)]
            }
            PathStep::Found { emitter, radiance, densities, weight, contribution } => {
                let name = match emitter {
                    PathEmitter::Surface => "emission",
                    PathEmitter::Environment => "environment",
                    PathEmitter::Background => "background",
                };
                let weighted = densities.map_or(line!(""), |d| {
                    let start = line!(", weight {weight} of densities {density by scattering}", weight, d.scattering);
                    start.and(line!(" by scattering and {density by sampling} by sampling lights", d.source))
                });
                let radiance = Term::from(radiance).named(name);
                vec![
                    line!("   {} {}", name, radiance).and(weighted),
                    adds(format!("light of the {name}"), contribution),
                ]
            }
            PathStep::LeftOut(emitter) => {
                let seen = if emitter == PathEmitter::Surface { "the light" } else { "the sun's disk" };
                vec![line!("   {} adds nothing: its light comes by shadow rays", seen)]
            }
            PathStep::Passed(Passage::Coverage) => {
                vec![line!("   goes straight on: part of the surface is missing")]
            }
            PathStep::Passed(Passage::IndexMatched) => vec![line!("   goes straight on: no refraction, no mirror")],
            PathStep::Overlay { color, share, contribution } => {
                let overlay = line!("   overlay {overlay} with a share of {share of the overlay}", color, share);
                vec![overlay, adds("light of the overlay".into(), contribution)]
            }
            PathStep::Sampled(ref node) => {
                let place = match node.distance {
                    Some(distance) => line!("at distance {distance}", distance as f32),
                    None => line!("infinitely far"),
                };
                let weight = node.scattering_pdf.map_or(line!(""), |pdf| {
                    line!(", weight {weight} beside density {density by scattering} by scattering", node.weight, pdf)
                });
                let (is_hidden, is_whole) = (node.visible == Rgb::BLACK, node.visible == Rgb::WHITE);
                let start = line!("   light {sampled light} sampled, ", &node.source).and(place);
                let product = line!("     f cos {f cos} x radiance {radiance}", node.f, node.radiance);
                vec![
                    start.and(line!(", along {L}", node.direction)),
                    product.and(line!(" / density {density}", node.pdf)).and(weight),
                    line!("     hidden").written_if(is_hidden),
                    line!("     passes {share that passes}", node.visible).written_if(!is_hidden && !is_whole),
                    adds(format!("light of {}", node.source), node.contribution).written_if(!is_hidden),
                ]
            }
            PathStep::Scattered { lobe, is_guided, direction, f, pdf, is_delta, throughput } => {
                let density = if is_delta { "probability" } else { "density" };
                let way = if is_guided { "guided" } else { name_of_lobe(lobe) };
                let start = line!("   goes on: {scattering} along {direction}", way, direction);
                vec![
                    start.and(line!(", f cos {f cos} / {} {density of the direction}", f, density, pdf)),
                    line!("     throughput {}", throughput),
                ]
            }
            PathStep::Roulette { survival, survived } => {
                let outcome = if survived { "survives" } else { "doesn't survive" };
                vec![line!("   roulette: {roulette} with probability {probability}", outcome, survival)]
            }
            PathStep::End(end) => vec![line!("   ends: {end}", name_of_end(end))],
        };
        lines.into_iter().map(Line::of_ray).collect()
    }
}

pub(super) fn name_of_lobe(lobe: Lobe) -> &'static str {
    match lobe {
        Lobe::Diffuse => "diffuse",
        Lobe::Highlight => "highlight",
        Lobe::Mirror => "mirrored",
        Lobe::Refraction => "refracted",
    }
}

fn name_of_end(end: PathEnd) -> &'static str {
    match end {
        PathEnd::Miss => "nothing is hit",
        PathEnd::MaxDepth => "max-depth is reached",
        PathEnd::Absorbed => "nothing is scattered in the random direction",
        PathEnd::Roulette => "roulette",
    }
}
