//! The probe that records paths.

use super::{Arrival, ArrivalSurface, PathRay, PathSample, PathStep, SampledNode};
use crate::explain::record::{in_the_scene, name_of_light};
use crate::explain::tree::Side;
use crate::integrator::{PathEvent, Probe, RayKind, SampledSource, SourceSample};
use crate::material::Lobe;
use crate::math::Rgb;
use crate::world::{GeometryProbe, Hit, World};

/// The probe that records the paths of a pixel.
pub(in crate::explain) struct PathRecorder<'w> {
    world: &'w World,
    samples: Vec<PathSample>,
    throughput: Rgb,
    /// The kind of the next ray.
    kind: RayKind,
}

impl<'w> PathRecorder<'w> {
    pub(in crate::explain) fn new(world: &'w World) -> PathRecorder<'w> {
        PathRecorder { world, samples: Vec::new(), throughput: Rgb::WHITE, kind: RayKind::Eye }
    }

    pub(in crate::explain) fn into_samples(self) -> Vec<PathSample> {
        self.samples
    }

    fn ray(&mut self) -> Option<&mut PathRay> {
        self.samples.last_mut()?.rays.last_mut()
    }

    fn push(&mut self, step: PathStep) {
        if let Some(ray) = self.ray() {
            ray.steps.push(step);
        }
    }

    fn sampled(&self, sample: &SourceSample) -> SampledNode {
        let length = sample.to.length();
        SampledNode {
            source: match sample.source {
                SampledSource::Light(number) => name_of_light(self.world, number),
                SampledSource::Surface { instance, primitive } => {
                    let hit = Hit { t: 0.0, instance, primitive, part: 0, uv: [0.0; 2], time: 0.0 };
                    self.world.object(&hit).name.clone()
                }
                SampledSource::Environment => "environment".into(),
            },
            direction: (sample.to / length).to_array(),
            distance: (!sample.is_infinite).then_some(length),
            f: sample.f,
            radiance: sample.radiance,
            pdf: sample.pdf,
            scattering_pdf: sample.scattering_pdf,
            weight: sample.weight(),
            visible: Rgb::BLACK,
            contribution: Rgb::BLACK,
            sample: *sample,
        }
    }

    /// Sets how much of the last sampled source is seen.
    fn set_visible(&mut self, visible: Rgb) {
        let Some(ray) = self.ray() else { return };
        let mut throughput = ray.throughput;
        for step in &mut ray.steps {
            match step {
                PathStep::Medium { factor, .. } | PathStep::Dispersed { factor, .. } => {
                    throughput = throughput * *factor;
                }
                PathStep::Overlay { share, .. } => throughput *= 1.0 - *share,
                PathStep::Sampled(node) => {
                    node.visible = visible;
                    node.contribution = (throughput * (node.sample.light() * visible).saturated()).saturated();
                }
                _ => {}
            }
        }
    }
}

impl GeometryProbe for PathRecorder<'_> {}

impl Probe for PathRecorder<'_> {
    fn sample(&mut self, position: [f64; 2], weight: f64) {
        let number = self.samples.len() as u32 + 1;
        self.samples.push(PathSample {
            number,
            position,
            weight,
            alpha: None,
            time: None,
            lens: None,
            rays: Vec::new(),
            color: Rgb::BLACK,
        });
        self.throughput = Rgb::WHITE;
    }

    fn alpha(&mut self, share: f32) {
        if let Some(sample) = self.samples.last_mut() {
            sample.alpha = Some(share);
        }
    }

    fn drawn(&mut self, time: Option<f64>, lens: Option<[f64; 2]>) {
        if let Some(sample) = self.samples.last_mut() {
            (sample.time, sample.lens) = (time, lens);
        }
    }

    fn end(&mut self, color: Rgb) {
        if let Some(sample) = self.samples.last_mut() {
            sample.color = color.saturated();
        }
    }

    fn path(&mut self, event: PathEvent) {
        let throughput = self.throughput;
        match event {
            PathEvent::Ray { ray, depth } => {
                let kind = match self.ray().and_then(|ray| ray.steps.last()) {
                    None => RayKind::Eye,
                    Some(PathStep::Passed(_)) => RayKind::Passed,
                    Some(_) => self.kind,
                };
                let ray = PathRay {
                    depth,
                    kind,
                    origin: in_the_scene(self.world, ray.origin),
                    direction: ray.direction.to_array(),
                    throughput,
                    arrival: Arrival::Miss,
                    steps: Vec::new(),
                };
                if let Some(sample) = self.samples.last_mut() {
                    sample.rays.push(ray);
                }
            }
            PathEvent::Surface { hit, surface, outside, .. } => {
                let object = self.world.object(hit);
                let arrival = ArrivalSurface {
                    object: object.name.clone(),
                    object_id: self.world.object_id(hit),
                    material: self.world.material(hit).name.clone(),
                    point: in_the_scene(self.world, surface.point),
                    normal: surface.normal.as_vec3().to_array(),
                    side: if outside { Side::Outside } else { Side::Inside },
                };
                if let Some(ray) = self.ray() {
                    ray.arrival = Arrival::Surface(Box::new(arrival));
                }
            }
            PathEvent::Miss => {}
            PathEvent::Medium { distance, factor, scattered, .. } => {
                self.throughput = throughput * factor;
                let arrival =
                    scattered.map(|point| Arrival::Medium { point: (self.world.origin() + point).to_array() });
                if let Some((ray, arrival)) = self.ray().zip(arrival) {
                    ray.arrival = arrival;
                }
                self.push(PathStep::Medium { distance, factor });
            }
            PathEvent::Found { emitter, radiance, densities } => {
                let weight = densities.map_or(1.0, |d| d.weight_of_scattering());
                let contribution = (throughput * (radiance * weight)).saturated();
                self.push(PathStep::Found { emitter, radiance, densities, weight, contribution });
            }
            PathEvent::Dispersed { channel, factor } => {
                self.throughput = throughput * factor;
                self.push(PathStep::Dispersed { channel, factor });
            }
            PathEvent::LeftOut(emitter) => self.push(PathStep::LeftOut(emitter)),
            PathEvent::Passed(passage) => self.push(PathStep::Passed(passage)),
            PathEvent::Overlay { color, share } => {
                let contribution = (throughput * color * share).saturated();
                self.throughput *= 1.0 - share;
                self.push(PathStep::Overlay { color, share, contribution });
            }
            PathEvent::Sampled(sample) => {
                let node = self.sampled(sample);
                self.push(PathStep::Sampled(Box::new(node)));
            }
            PathEvent::Visible(visible) => self.set_visible(visible),
            PathEvent::Scattered { sample, guiding } => {
                self.kind = match sample.lobe {
                    Lobe::Mirror => RayKind::Reflected,
                    Lobe::Refraction => RayKind::Refracted,
                    Lobe::Diffuse | Lobe::Highlight => RayKind::Scattered,
                };
                self.throughput = (throughput * sample.f * (1.0 / sample.pdf) as f32).saturated();
                self.push(PathStep::Scattered {
                    lobe: sample.lobe,
                    is_guided: guiding.is_some_and(|guiding| guiding.is_chosen),
                    direction: sample.wi.to_array(),
                    f: sample.f,
                    pdf: sample.pdf,
                    is_delta: sample.is_delta,
                    throughput: self.throughput,
                });
            }
            PathEvent::Roulette { survival, survived } => {
                if survived {
                    self.throughput *= 1.0 / survival;
                }
                self.push(PathStep::Roulette { survival, survived });
            }
            PathEvent::End(end) => self.push(PathStep::End(end)),
        }
    }
}
