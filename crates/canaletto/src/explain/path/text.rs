//! Paths as text for a terminal.

use super::{Arrival, PathRay, PathSample, PathStep, PathTree};
use crate::explain::patch::RadiosityTerms;
use crate::explain::text::write_equal;
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
                let share = w.number((sample.weight / self.weights()) as f32);
                writeln!(w);
                writeln!(w, "path {} of {}, weight {share}{nearest}", sample.number, self.samples.len());
                write_sample(&mut w, sample);
            }
        }
        writeln!(w);
        self.write_brightest(&mut w);
        if self.samples.len() > 1 {
            writeln!(w, "pixel = weighted mean of {} paths", self.samples.len());
        }
        write_equal(&mut w, self.sum(), "rendered pixel    ", self.color);
        self.developed.write(&mut w, self.color);
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
            writeln!(w, "path {}: {percent:.1} % of the light, {bounces}: {}", sample.number, w.rgb(sample.color));
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

fn write_sample(w: &mut TextWriter, sample: &PathSample) {
    let [x, y] = sample.position.map(|v| w.number(v));
    writeln!(w, "camera ray through x = {x}, y = {y}");
    if let Some(time) = sample.time {
        writeln!(w, "at time {} of 0 (shutter opens) to 1 (shutter closes)", w.number(time));
    }
    if let Some([right, up]) = sample.lens {
        let [right, up] = [right, up].map(|v| w.number(v));
        writeln!(w, "from the point of the lens {right} to the right of the eye and {up} above it");
    }
    let levels = w.levels;
    for ray in sample.rays.iter().filter(|ray| ray.depth <= levels) {
        write_ray(w, ray);
    }
    let more = sample.rays.iter().filter(|ray| ray.depth > levels).count();
    if more > 0 {
        writeln!(w, "{} more", counted(more, "ray"));
    }
    writeln!(w, "light of the path  {}", w.rgb(sample.color));
}

fn write_ray(w: &mut TextWriter, ray: &PathRay) {
    let (origin, direction) = (w.vector(ray.origin), w.vector(ray.direction));
    writeln!(w, "{}. from {origin} along {direction}, throughput {}", ray.depth, w.rgb(ray.throughput));
    match &ray.arrival {
        Arrival::Miss => writeln!(w, "   leaves the scene"),
        Arrival::Medium { point } => writeln!(w, "   scattered in a medium at {}", w.vector(*point)),
        Arrival::Surface(surface) => {
            let side = match surface.side {
                Side::Outside => "",
                Side::Inside => ", from inside",
            };
            let (point, normal) = (w.vector(surface.point), w.vector(surface.normal));
            writeln!(
                w,
                "   hits {} of material {} at {point}{side}, normal {normal}",
                surface.object, surface.material
            );
        }
    }
    for step in &ray.steps {
        write_step(w, step);
    }
}

fn write_step(w: &mut TextWriter, step: &PathStep) {
    match step {
        PathStep::Medium { distance, factor } => {
            writeln!(w, "   medium: {} through it, throughput x {}", w.size(*distance), w.rgb(*factor));
        }
        PathStep::Dispersed { channel, factor } => {
            let name = match channel {
                PathChannel::Red => "red",
                PathChannel::Green => "green",
                PathChannel::Blue => "blue",
            };
            writeln!(w, "   dispersion: goes on for {name} only, throughput x {}", w.rgb(*factor));
        }
        PathStep::Found { emitter, radiance, densities, weight, contribution } => {
            let name = match emitter {
                PathEmitter::Surface => "emission",
                PathEmitter::Environment => "environment",
                PathEmitter::Background => "background",
            };
            let weighted = match densities {
                None => String::new(),
                Some(d) => format!(
                    ", weight {} of densities {} by scattering and {} by sampling lights",
                    w.number(*weight),
                    w.number(d.scattering),
                    w.number(d.source)
                ),
            };
            writeln!(w, "   {name} {}{weighted}", w.rgb(*radiance));
            write_contribution(w, *contribution);
        }
        PathStep::LeftOut(emitter) => {
            let seen = if *emitter == PathEmitter::Surface { "the light" } else { "the sun's disk" };
            writeln!(w, "   {seen} adds nothing: its light comes by shadow rays");
        }
        PathStep::Passed(Passage::Coverage) => writeln!(w, "   goes straight on: part of the surface is missing"),
        PathStep::Passed(Passage::IndexMatched) => writeln!(w, "   goes straight on: no refraction, no mirror"),
        PathStep::Overlay { color, share, contribution } => {
            writeln!(w, "   overlay {} with a share of {}", w.rgb(*color), w.number(*share));
            write_contribution(w, *contribution);
        }
        PathStep::Sampled(node) => {
            let place = match node.distance {
                Some(distance) => format!("at distance {}", w.size(distance)),
                None => "infinitely far".into(),
            };
            writeln!(w, "   light {} sampled, {place}, along {}", node.source, w.vector(node.direction));
            let weight = match node.scattering_pdf {
                None => String::new(),
                Some(pdf) => {
                    format!(", weight {} beside density {} by scattering", w.number(node.weight), w.number(pdf))
                }
            };
            let (f, radiance, pdf) = (w.rgb(node.f), w.rgb(node.radiance), w.number(node.pdf));
            writeln!(w, "     f cos {f} x radiance {radiance} / density {pdf}{weight}");
            if node.visible == Rgb::BLACK {
                writeln!(w, "     hidden");
            } else {
                if node.visible != Rgb::WHITE {
                    writeln!(w, "     passes {}", w.rgb(node.visible));
                }
                write_contribution(w, node.contribution);
            }
        }
        PathStep::Scattered { lobe, is_guided, direction, f, pdf, is_delta, throughput } => {
            let density = if *is_delta { "probability" } else { "density" };
            let (f, pdf, direction) = (w.rgb(*f), w.number(*pdf), w.vector(*direction));
            let way = if *is_guided { "guided" } else { name_of_lobe(*lobe) };
            writeln!(w, "   goes on: {way} along {direction}, f cos {f} / {density} {pdf}");
            writeln!(w, "     throughput {}", w.rgb(*throughput));
        }
        PathStep::Roulette { survival, survived } => {
            let outcome = if *survived { "survives" } else { "doesn't survive" };
            writeln!(w, "   roulette: {outcome} with probability {}", w.number(*survival));
        }
        PathStep::End(end) => writeln!(w, "   ends: {}", name_of_end(*end)),
    }
}

fn write_contribution(w: &mut TextWriter, contribution: Rgb) {
    writeln!(w, "     adds {}", w.rgb(contribution));
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
