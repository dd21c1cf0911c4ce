//! Direct lighting: the light that reaches interactions (5.39a).

use super::interaction::{InteractionRef, Interactions};
use super::interactions8::{Interactions8, LANES, LightSamples8, lanes};
use super::media::NONE;
use super::ray_batch::uses;
use super::{Wave, Whitted};
use crate::integrator::{LightTerm, Probe};
use crate::light::{Illumination, PreparedLight};
use crate::material::highlights;
use crate::math::RayDifferential;
use crate::scene::Stage;
use crate::world::Occlusion;

/// Buffers for the lighting of one wave.
#[derive(Default)]
pub(super) struct Lighting {
    /// The samples of the current light point.
    light_samples: Vec<LightSamples8>,
    /// The arriving light, if the light point differs between interactions.
    arriving: Vec<Illumination>,
    /// The interactions of shadow rays that cross clear surfaces.
    crossing: Vec<u32>,
    /// Interactions with a highlight, with the bases and exponents of their powers.
    shining: Vec<u32>,
    cosines: Vec<f32>,
    exponents: Vec<f32>,
}

impl Lighting {
    /// Finds the directions to a light's point, and the light along them before shadows.
    fn sample(&mut self, source: &PreparedLight, (light, point): (u32, u32), wave: &Wave) {
        let Lighting { light_samples, arriving, .. } = self;
        let (interactions, interactions8) = (&wave.interactions, wave.interactions.interactions8());
        arriving.clear();
        if let Some(position) = source.point(point) {
            LightSamples8::point(light_samples, interactions8, position);
            match source.constant_intensity() {
                Some(intensity) => light_samples.iter_mut().for_each(|samples8| samples8.set_intensities(intensity)),
                None => {
                    for index in 0..interactions.len() {
                        let (samples8, lane) = (&mut light_samples[index / LANES], index % LANES);
                        samples8.set_intensity(lane, source.along(samples8.direction(lane), samples8.distance[lane]));
                    }
                }
            }
        } else {
            arriving.extend(interactions.each().iter().enumerate().map(|(index, interaction)| {
                let exact = interactions8[index / LANES].exact(index % LANES);
                if source.is_sampled() {
                    let (batch, ray_index) = (&wave.batch, interaction.ray_index());
                    let place = batch.path_state(ray_index).place.of(uses::LIGHTS + light);
                    let u = batch.sample(ray_index).two_of(place, point, source.points());
                    source.sample(u, exact)
                } else {
                    source.illuminate(point, exact)
                }
            }));
            LightSamples8::from_illumination(light_samples, interactions8, arriving);
        }
        for (number, (samples8, interactions8)) in light_samples.iter_mut().zip(interactions8).enumerate() {
            samples8.evaluate(interactions8);
            for lane in lanes(samples8.lit & interactions8.normal_bent) {
                if is_below_surface(&interactions.at(number * LANES + lane), samples8, lane) {
                    samples8.mask_out(lane);
                }
            }
        }
    }

    /// Finds cosⁿα (5.38) where light arrives. Shadowed interactions are included only if `anyway` is set.
    fn highlights(&mut self, interactions8: &[Interactions8], anyway: bool) {
        let Lighting { light_samples, shining, cosines, exponents, .. } = self;
        shining.clear();
        cosines.clear();
        exponents.clear();
        for (number, (samples8, interactions8)) in light_samples.iter().zip(interactions8).enumerate() {
            for lane in lanes(samples8.lit & interactions8.shiny) {
                let (n, r_dot_l) = (interactions8.n[lane], samples8.r_dot_l[lane]);
                // The highlight is zero elsewhere.
                if (anyway || samples8.f_s[lane] > 0.0) && (r_dot_l > 0.0 || n == 0.0) {
                    shining.push((number * LANES + lane) as u32);
                    cosines.push(r_dot_l);
                    exponents.push(n);
                }
            }
        }
        highlights(cosines, exponents);
        for (&interaction, &power) in shining.iter().zip(&*cosines) {
            light_samples[interaction as usize / LANES].highlight[interaction as usize % LANES] = power;
        }
    }
}

/// Whether light comes from behind the surface, though not from behind its bent normal.
fn is_below_surface(at: &InteractionRef, samples8: &LightSamples8, lane: usize) -> bool {
    at.interaction.material.normal_bent && at.facing().dot(samples8.direction(lane)) <= 0.0
}

/// The differential of the shadow ray from an interaction, if anything uses it.
fn shadow_differential(wave: &Wave, samples8: &LightSamples8, interaction: usize) -> Option<RayDifferential> {
    let (footprint, lane) = (wave.footprints.get(interaction)?, interaction % LANES);
    Some(RayDifferential::to_light(footprint.step, samples8.direction(lane), f64::from(samples8.distance[lane])))
}

impl Whitted<'_> {
    /// Adds the light of all lights, one light point after the other.
    pub(super) fn light<P: Probe>(&mut self, wave: &mut Wave, probe: &mut P) {
        if self.world.lights.is_empty() {
            return;
        }
        let mut lighting = std::mem::take(&mut self.lighting);
        let (interactions, interactions8) = wave.interactions.both();
        for (interactions8, interactions) in interactions8.iter_mut().zip(interactions.chunks(LANES)) {
            for (lane, interaction) in interactions.iter().enumerate() {
                interactions8.set_color(lane, interaction.color);
            }
        }
        let rays = wave.interactions.len() as u32;
        'lights: for light in 0..self.world.lights.len() as u32 {
            for point in 0..self.world.lights[light as usize].points() {
                self.poll(rays);
                if self.is_cancelled {
                    break 'lights;
                }
                lighting.sample(self.source(light), (light, point), wave);
                self.shadow(&mut lighting, light, wave, probe);
                let interactions8 = wave.interactions.both().1;
                if self.settings.stage >= Stage::Specular {
                    // In shadow a highlight is black, and only a probe reports it.
                    lighting.highlights(interactions8, P::ACTIVE);
                }
                LightSamples8::add(&lighting.light_samples, interactions8);
                if P::ACTIVE {
                    self.report(&lighting, (light, point), &wave.interactions.at(0), probe);
                }
            }
        }
        let (interactions, interactions8) = wave.interactions.both();
        for (interactions8, interactions) in interactions8.iter().zip(interactions.chunks_mut(LANES)) {
            for (lane, interaction) in
                interactions.iter_mut().enumerate().filter(|(_, interaction)| interaction.is_seen())
            {
                interaction.color = interactions8.color(lane);
            }
        }
        self.lighting = lighting;
    }

    /// The light at the time of the sample.
    fn source(&self, light: u32) -> &PreparedLight {
        self.lights.get(light as usize).unwrap_or(&self.world.lights[light as usize])
    }

    /// Finds f_s, the share of the light that passes the surfaces between a light's point and the interactions.
    fn shadow<P: Probe>(&mut self, lighting: &mut Lighting, light: u32, wave: &Wave, probe: &mut P) {
        let Lighting { light_samples, crossing, .. } = lighting;
        let source = self.source(light);
        if self.settings.stage < Stage::Shadow || !self.settings.shadows || !source.light.shadows {
            return;
        }
        self.batch.clear();
        for (samples8, interactions8) in light_samples.iter().zip(wave.interactions.interactions8()) {
            self.batch.push_some(samples8.lit, &interactions8.start, &samples8.to, &samples8.reach);
        }
        self.world.occlusion_batch(&mut self.batch, self.time, &mut self.occluders[light as usize]);
        self.counts.shadow.traced += self.batch.len() as u64;
        crossing.clear();
        self.shadow_rays.bundle.clear();
        let mut shadow = 0;
        for (number, samples8) in light_samples.iter_mut().enumerate() {
            for lane in lanes(samples8.lit) {
                let (occlusion, interaction) = (self.batch.occlusion(shadow), number * LANES + lane);
                if occlusion != Occlusion::Nothing && P::ACTIVE {
                    // Only a probe needs the order of the occluders.
                    let (ray, t_max) = self.batch.ray(shadow);
                    let differential = shadow_differential(wave, samples8, interaction);
                    samples8.f_s[lane] =
                        self.world.transmittance_past(&ray, t_max, self.time, differential.as_ref(), occlusion, probe);
                    self.counts.shadow.hit += u64::from(samples8.f_s[lane] == 0.0);
                } else if occlusion == Occlusion::Clear {
                    let (ray, t_max) = self.batch.ray(shadow);
                    crossing.push(interaction as u32);
                    self.shadow_rays.bundle.push(ray, t_max);
                } else {
                    let opaque = occlusion == Occlusion::Opaque;
                    samples8.f_s[lane] = if opaque { 0.0 } else { 1.0 };
                    self.counts.shadow.hit += u64::from(opaque);
                }
                shadow += 1;
            }
        }
        self.world.transmittance_batch(&mut self.shadow_rays, self.time, |number| {
            let interaction = crossing[number] as usize;
            shadow_differential(wave, &light_samples[interaction / LANES], interaction)
        });
        for (number, &interaction) in crossing.iter().enumerate() {
            let f_s = self.shadow_rays.passed(number);
            light_samples[interaction as usize / LANES].f_s[interaction as usize % LANES] = f_s;
            self.counts.shadow.hit += u64::from(f_s == 0.0);
        }
        if self.world.has_clear() {
            self.apply_crossed_surfaces(light_samples, &wave.interactions, probe);
        }
    }

    /// Where faces coincide, light crosses back through those that the camera ray has crossed before.
    fn apply_crossed_surfaces<P: Probe>(
        &self,
        light_samples: &mut [LightSamples8],
        interactions: &Interactions,
        probe: &mut P,
    ) {
        for (index, interaction) in
            interactions.each().iter().enumerate().filter(|(_, interaction)| interaction.crossing != NONE)
        {
            let (samples8, lane) = (&mut light_samples[index / LANES], index % LANES);
            if samples8.lit >> lane & 1 == 0 {
                continue;
            }
            let at = interactions.at(index);
            self.media.for_crossed_before(interaction.crossing, |hit| {
                let opacity = self.world.opacity_at(at.leave(-at.wo()), hit, None);
                probe.blocker(hit, opacity);
                samples8.f_s[lane] *= 1.0 - opacity;
            });
        }
    }

    /// Reports the light that arrives at the one interaction to a probe.
    fn report<P: Probe>(&self, lighting: &Lighting, (light, point): (u32, u32), at: &InteractionRef, probe: &mut P) {
        let (samples8, interactions8, source) = (&lighting.light_samples[0], at.interactions8, self.source(light));
        if !at.interaction.is_seen() {
            return;
        }
        let [diffuse, specular, contribution] = samples8.terms(interactions8, 0);
        let intensity = samples8.intensity(0);
        probe.light(&LightTerm {
            light,
            point,
            sampled: if source.is_sampled() { lighting.arriving[0].position } else { None },
            direction: samples8.direction(0).as_vec3(),
            distance: samples8.distance[0],
            intensity,
            n_dot_l: samples8.n_dot_l[0],
            behind: samples8.n_dot_l[0] > 0.0 && !intensity.is_black() && is_below_surface(at, samples8, 0),
            r_dot_l: samples8.r_dot_l[0],
            f_s: samples8.f_s[0],
            diffuse,
            specular,
            contribution,
        });
    }
}
