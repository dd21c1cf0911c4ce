//! The probe that paths of a guiding field's training are recorded with.

use super::mixture::RadianceSample;
use crate::integrator::Probe;
use crate::integrator::path::{GuidedSample, PathEvent};
use crate::math::Rgb;
use crate::world::GeometryProbe;
use glam::DVec3;

/// The most vertices of a path that tell something, so that long paths don't fill the memory.
const MOST_VERTICES: usize = 32;

/// What one vertex of a path tells of the light that arrives there.
#[derive(Clone, Copy, Debug)]
pub(crate) struct GuidingRecord {
    /// The point in the world.
    pub(super) position: [f32; 3],
    /// The radiance from the direction in which the path went on. None after a mirror or a refraction.
    pub(super) radiance: Option<RadianceSample>,
    /// The light that the direction brought to the vertex: f |cos θ| times radiance, over its density.
    pub(super) light: f64,
    /// The light that leaves the vertex to where the path came from: `light` and what a chosen light sends there.
    pub(super) leaving: f64,
    /// The densities of the direction: by the surface's scattering alone, by the field, and by both as it was sampled.
    pub(super) pdf_scattering: f64,
    pub(super) pdf_guide: f64,
    pub(super) pdf: f64,
}

/// A vertex of the path on its way.
struct Open {
    position: DVec3,
    direction: DVec3,
    /// The inverse of the distance to the next surface; none before that is known.
    inverse_distance: Option<f64>,
    is_delta: bool,
    /// The densities as in a record.
    pdf_scattering: f64,
    pdf_guide: f64,
    pdf: f64,
    /// The throughput after it, and its factor there.
    throughput: Rgb,
    factor: Rgb,
    /// The light that the path has found since then.
    found: Rgb,
    /// The light that a chosen light sends to the vertex and from there to where the path came from.
    sampled: Rgb,
}

/// The light of a source, before its shadow is known.
#[derive(Clone, Copy, Default)]
struct Sampled {
    /// The light that leaves the vertex, and what of it arrives at the camera.
    leaving: Rgb,
    arriving: Rgb,
    /// The number of vertices before.
    place: usize,
}

/// The probe.
pub(crate) struct GuidingRecorder {
    throughput: Rgb,
    /// The last surface; none in a medium.
    position: Option<DVec3>,
    open: Vec<Open>,
    /// The light of the source that was sampled last.
    sampled: Sampled,
    records: Vec<GuidingRecord>,
}

impl GuidingRecorder {
    /// A recorder without records.
    pub(crate) fn new() -> GuidingRecorder {
        GuidingRecorder {
            throughput: Rgb::WHITE,
            position: None,
            open: Vec::new(),
            sampled: Sampled::default(),
            records: Vec::new(),
        }
    }

    /// What the paths told.
    pub(crate) fn into_records(self) -> Vec<GuidingRecord> {
        self.records
    }

    /// Arrives at a point of a surface or of a medium.
    fn arrive(&mut self, point: DVec3, is_surface: bool) {
        if let Some(last) = self.open.last_mut() {
            last.inverse_distance.get_or_insert(1.0 / last.position.distance(point));
        }
        self.position = is_surface.then_some(point);
    }

    /// Adds light to the first `count` vertices.
    fn add(&mut self, light: Rgb, count: usize) {
        let light = light.saturated();
        self.open.iter_mut().take(count).for_each(|open| open.found += light);
    }
}

impl Open {
    fn record(&self) -> Option<GuidingRecord> {
        let (found, throughput) = (self.found.to_array(), self.throughput.to_array());
        let arriving = [0, 1, 2].map(|c| match throughput[c] > 0.0 {
            true => f64::from(found[c]) / f64::from(throughput[c]),
            false => 0.0,
        });
        let radiance: f64 = arriving.iter().sum();
        let light: f64 = arriving.iter().zip(self.factor.to_array()).map(|(arriving, f)| arriving * f64::from(f)).sum();
        let sampled: f64 = self.sampled.saturated().to_array().into_iter().map(f64::from).sum();
        let record = GuidingRecord {
            position: self.position.as_vec3().to_array(),
            radiance: (!self.is_delta).then(|| RadianceSample {
                direction: self.direction.as_vec3().to_array(),
                energy: (radiance / self.pdf) as f32,
                inverse_distance: self.inverse_distance.filter(|i| i.is_finite()).unwrap_or(0.0) as f32,
            }),
            light,
            leaving: light + sampled,
            pdf_scattering: self.pdf_scattering,
            pdf_guide: self.pdf_guide,
            pdf: self.pdf,
        };
        let numbers = [radiance / self.pdf, record.light * record.light, record.leaving, record.pdf];
        numbers.iter().all(|n| n.is_finite() && *n < f64::from(f32::MAX)).then_some(record)
    }
}

impl GeometryProbe for GuidingRecorder {
    fn is_active(&self) -> bool {
        false
    }
}

impl Probe for GuidingRecorder {
    fn path(&mut self, event: PathEvent) {
        let throughput = self.throughput;
        match event {
            PathEvent::Surface { surface, .. } => self.arrive(surface.point.as_dvec3(), true),
            PathEvent::Medium { factor, scattered, .. } => {
                self.throughput = throughput * factor;
                if let Some(point) = scattered {
                    self.arrive(point, false);
                }
            }
            PathEvent::Dispersed { factor, .. } => self.throughput = throughput * factor,
            PathEvent::Found { radiance, densities, .. } => {
                let weight = densities.map_or(1.0, |d| d.weight_of_scattering());
                self.add(throughput * (radiance * weight), usize::MAX);
            }
            PathEvent::Overlay { color, share } => {
                self.add(throughput * color * share, usize::MAX);
                self.throughput *= 1.0 - share;
            }
            PathEvent::Sampled(sample) => {
                let leaving = sample.light();
                self.sampled = Sampled { leaving, arriving: throughput * leaving, place: self.open.len() };
            }
            PathEvent::Visible(visible) => {
                let Sampled { leaving, arriving, place } = self.sampled;
                self.add(arriving * visible, place);
                if let Some(open) = self.open.get_mut(place) {
                    open.sampled += leaving * visible;
                }
            }
            PathEvent::Scattered { sample, guiding } => {
                self.throughput = (throughput * sample.f * (1.0 / sample.pdf) as f32).saturated();
                if let Some(position) = self.position.filter(|_| self.open.len() < MOST_VERTICES) {
                    let unguided = GuidedSample { is_chosen: false, pdf: 0.0, pdf_scattering: sample.pdf };
                    let GuidedSample { pdf: pdf_guide, pdf_scattering, .. } = guiding.unwrap_or(unguided);
                    self.open.push(Open {
                        position,
                        direction: sample.wi,
                        inverse_distance: None,
                        is_delta: sample.is_delta,
                        pdf_scattering,
                        pdf_guide,
                        pdf: sample.pdf,
                        throughput: self.throughput,
                        factor: sample.f * (1.0 / sample.pdf) as f32,
                        found: Rgb::BLACK,
                        sampled: Rgb::BLACK,
                    });
                }
            }
            PathEvent::Roulette { survival, survived } => {
                if survived {
                    self.throughput *= 1.0 / survival;
                }
            }
            PathEvent::Ray { .. }
            | PathEvent::Miss
            | PathEvent::LeftOut(_)
            | PathEvent::Passed(_)
            | PathEvent::End(_) => {}
        }
    }

    fn end(&mut self, _color: Rgb) {
        self.records.extend(self.open.drain(..).filter_map(|open| open.record()));
        (self.throughput, self.position) = (Rgb::WHITE, None);
    }
}
