//! What a denoiser knows of a surface besides its noisy light: albedo, normal and depth, as paths see them through
//! mirrors and clear bodies.

use super::{KnownChoice, MAX_PASSED, Vertex, uses};
use crate::integrator::path::PathTracer;
use crate::integrator::visible_hit::Frame;
use crate::math::{DRay, RayDifferential, Rgb};
use crate::sampler::Sample;
use glam::DVec3;

/// The most mirrors and clear boundaries between the eye and the surface whose features are taken.
const MOST_SPECULAR: u32 = 16;

/// The features of one camera ray.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Features {
    /// The share of light that the first rough surface scatters, times what the mirrors before it reflect. Of lamps and
    /// of the background it is their colour, at most 1.
    pub(crate) albedo: Rgb,
    /// The unit shading normal of that surface on the side that the ray meets; zero for background and media.
    pub(crate) normal: DVec3,
    /// The length of the ray's way to the surface; infinite for the background.
    pub(crate) depth: f64,
}

impl PathTracer<'_> {
    /// The features of the first surface that scatters to many directions, along a camera ray. At a mirror or a clear
    /// boundary the way goes on as a path's does.
    pub(crate) fn features(
        &mut self,
        line: DRay,
        differential: Option<RayDifferential>,
        time: f32,
        sample: Sample,
    ) -> Features {
        self.time = time;
        self.media.clear();
        let mut path = self.start(line, differential, sample);
        let (mut depth, mut specular) = (0.0, 0);
        let background = |albedo| Features { albedo, normal: DVec3::ZERO, depth: f64::INFINITY };
        loop {
            self.poll(1);
            if self.is_cancelled {
                return background(Rgb::BLACK);
            }
            let found = self.world.intersect_at(path.ray(), f32::INFINITY, self.time);
            let Some(met) = self.meet(&path.segment, found, &mut ()) else {
                if let Some(backdrop) = self.backdrop.filter(|_| path.depth == 1) {
                    return background(as_albedo(path.throughput * backdrop));
                }
                return background(as_albedo(path.throughput * self.environment(&path.segment, true, &mut ())));
            };
            let frame = Frame::new(met.line.direction, &met.surface);
            let distance = path.segment.line.origin.distance(frame.exact);
            let (place, sample) = (path.place.of(uses::NEXT), path.sample);
            path.place = place;
            if let Some((medium, inside)) = self.medium_before(&met, frame.outside)
                && self.pass_medium(&mut path, &medium, inside, distance, &mut ()).is_some()
            {
                // The middle of the way stands for the place in the medium.
                let depth = depth + 0.5 * distance;
                return Features { albedo: as_albedo(path.throughput), normal: DVec3::ZERO, depth };
            }
            depth += distance;
            let (coverage, normal) = (met.material.coverage, frame.normal);
            let is_passed = coverage < 1.0 && sample.one(place.of(uses::COVERAGE)) >= f64::from(coverage);
            if is_passed && path.passed < MAX_PASSED {
                path.passed += 1;
                let inside = self.media.crossing(met.crossing).map(|crossing| [crossing.beyond, crossing.next]);
                path.segment.go_through(&met, &frame, inside.unwrap_or([met.inside, super::NONE]));
                continue;
            }
            let shown = |color: Rgb| Features { albedo: as_albedo(color), normal, depth };
            let emission = met.material.emitted(frame.outside);
            let (overlay, share) = met.material.overlay;
            if !emission.is_black() || share >= 1.0 {
                return shown(path.throughput * (emission * (1.0 - share) + overlay * share));
            }
            // Without dispersion: a single channel would tint the albedo.
            let vertex = self.vertex(&met, frame, None);
            if let Some(crossing) = vertex.crossing.filter(|_| vertex.is_index_matched()) {
                path.segment.go_through(&met, &vertex.frame, [crossing.beyond, crossing.next]);
                continue;
            }
            let before = path.throughput;
            let vertex = Vertex::Surface(&vertex);
            let lit = Some((vertex.receiver(), KnownChoice::default()));
            let goes_on = self.go_on(&mut path, &vertex, lit, &mut ()).is_ok();
            // A random direction changes the throughput by f / pdf, whose mean is the albedo.
            if !goes_on || path.segment.scattered.is_some() || share > 0.0 || specular == MOST_SPECULAR {
                return shown(path.throughput * (1.0 - share) + before * overlay * share);
            }
            specular += 1;
        }
    }
}

/// A colour as an albedo: scaled so that no component is above 1. What is no number is black.
fn as_albedo(color: Rgb) -> Rgb {
    let color = color.saturated();
    if !color.is_finite() {
        return Rgb::BLACK;
    }
    let largest = color.max_component();
    if largest > 1.0 { color * (1.0 / largest) } else { color }
}
