//! The choice of a light: one of the scene's lights, an emitting surface or the environment, by power.

use super::emitter::Emitters;
use crate::light::environment::EnvironmentDistribution;
use crate::light::{Emission, PreparedLight};
use crate::math::Rgb;
use crate::shape::{cumulative, pick_by_area};
use crate::world::{Hit, World};
use glam::DVec3;
use std::f64::consts::PI;

/// A source of light that can be sampled.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Source {
    /// A light of the world.
    Light(u32),
    /// An emitting surface.
    Emitter(u32),
    /// The environment.
    Environment,
}

/// All sources of light, each chosen with a probability in proportion to its power.
#[derive(Debug)]
pub(super) struct LightSampler {
    sources: Vec<Source>,
    /// The cumulative sums of the sources' powers.
    sums: Vec<f64>,
    pub(super) emitters: Emitters,
    /// The first source that is an emitter.
    first_emitter: usize,
    pub(super) environment: Option<EnvironmentDistribution>,
    /// The source that is the environment.
    environment_source: Option<usize>,
    /// Whether visible matte lights are sources by their emitting surfaces instead of by themselves.
    visible_lights_are_emitters: bool,
}

/// The power by which a light is chosen, in a scene of this radius. A light without a matte surface is as bright from
/// near as from afar, but for its attenuation. It counts as one from infinity does, so that the unit of length changes
/// no choice.
fn importance(light: &PreparedLight, radius: f64) -> Rgb {
    if light.light.emission == Emission::Matte {
        return light.power(radius);
    }
    let intensity = light.point_intensity() * light.points() as f32;
    intensity * (PI * PI * radius * radius) as f32 / light.attenuation_divisor(radius as f32)
}

/// [`LightSampler::is_only_seen`], for lights that are sources by their surfaces or not. A surface of even emission
/// emits from both sides and is never a source.
fn is_only_seen(world: &World, material: u32, visible_lights_are_emitters: bool) -> bool {
    let is_even = || world.materials()[material as usize].two_sided;
    world.is_of_light(material) && (!visible_lights_are_emitters || is_even())
}

impl LightSampler {
    pub(super) fn new(world: &World) -> LightSampler {
        // An attenuated light isn't as bright from afar as its surface looks.
        let is_plain = |light: &PreparedLight| light.light.attenuation == [1.0, 0.0, 0.0];
        let visible = || world.lights.iter().filter(|light| light.light.visible);
        let visible_lights_are_emitters = !world.lights_move() && visible().all(is_plain);
        let is_emitter = |light: &PreparedLight| {
            visible_lights_are_emitters && light.light.visible && light.light.emission == Emission::Matte
        };
        let emitters = Emitters::new(world, |material| !is_only_seen(world, material, visible_lights_are_emitters));
        let environment = world.environment.as_ref().and_then(EnvironmentDistribution::new);
        let bounds = world.local_bounds();
        let radius = if bounds.is_empty() { 1.0 } else { 0.5 * f64::from((bounds.max - bounds.min).length()) };
        let (mut sources, mut powers) = (Vec::new(), Vec::new());
        let mut push = |source: Source, power: Rgb| {
            let power: f64 = power.to_array().map(f64::from).iter().sum();
            if power > 0.0 {
                sources.push(source);
                powers.push(power);
            }
        };
        for (i, light) in (0..).zip(&world.lights).filter(|(_, light)| !is_emitter(light)) {
            push(Source::Light(i), importance(light, radius));
        }
        if let Some(environment) = &environment {
            push(Source::Environment, environment.mean() * (4.0 * PI * PI * radius * radius) as f32);
        }
        for (i, emitter) in (0..).zip(&emitters.all) {
            push(Source::Emitter(i), emitter.power());
        }
        let first_emitter = sources.iter().take_while(|source| !matches!(source, Source::Emitter(_))).count();
        LightSampler {
            sums: cumulative(powers.into_iter()).collect(),
            environment_source: sources.iter().position(|source| *source == Source::Environment),
            sources,
            emitters,
            first_emitter,
            environment,
            visible_lights_are_emitters,
        }
    }

    /// A source that `u` of [0, 1) chooses, with its probability.
    pub(super) fn sample(&self, u: f64) -> Option<(Source, f64)> {
        if self.sources.is_empty() {
            return None;
        }
        let (index, _) = pick_by_area(u, &self.sums);
        Some((self.sources[index], self.probability(index)))
    }

    fn probability(&self, index: usize) -> f64 {
        let before = if index == 0 { 0.0 } else { self.sums[index - 1] };
        (self.sums[index] - before) / self.sums[self.sums.len() - 1]
    }

    /// The density with which directions of sampled lights lead from `p` to a hit with this point and unit normal.
    pub(super) fn pdf_of_hit(&self, world: &World, p: DVec3, hit: &Hit, point: DVec3, normal: DVec3) -> f64 {
        let Some(emitter) = self.emitters.of_hit(world, hit) else { return 0.0 };
        let source = self.sources[self.first_emitter..].binary_search_by_key(&emitter, |source| match source {
            Source::Emitter(number) => *number,
            Source::Light(_) | Source::Environment => 0,
        });
        source.map_or(0.0, |index| {
            let pdf = self.emitters.all[emitter as usize].pdf_from(p, point, normal);
            pdf * self.probability(self.first_emitter + index)
        })
    }

    /// The density with which a direction is sampled for the light of the environment.
    pub(super) fn pdf_of_environment(&self, direction: DVec3) -> f64 {
        let both = self.environment.as_ref().zip(self.environment_source);
        both.map_or(0.0, |(environment, source)| environment.pdf(direction) * self.probability(source))
    }

    /// Whether the material shows a light that is a source by itself, so that its surface adds nothing to what is lit.
    pub(super) fn is_only_seen(&self, world: &World, material: u32) -> bool {
        is_only_seen(world, material, self.visible_lights_are_emitters)
    }
}
