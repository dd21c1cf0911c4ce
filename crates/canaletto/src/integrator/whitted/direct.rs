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
    ways: Vec<LightSamples8>,
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
        let Lighting { ways, arriving, .. } = self;
        let (interactions, interactions8) = (&wave.interactions, wave.interactions.interactions8());
        arriving.clear();
        if let Some(position) = source.point(point) {
            LightSamples8::point(ways, interactions8, position);
            match source.even() {
                Some(intensity) => ways.iter_mut().for_each(|way| way.set_intensities(intensity)),
                None => {
                    for index in 0..interactions.len() {
                        let (way, lane) = (&mut ways[index / LANES], index % LANES);
                        way.set_intensity(lane, source.along(way.direction(lane), way.distance[lane]));
                    }
                }
            }
        } else {
            arriving.extend(interactions.each().iter().enumerate().map(|(index, interaction)| {
                let exact = interactions8[index / LANES].exact(index % LANES);
                if source.is_sampled() {
                    let (ways, way) = (&wave.ways, interaction.way());
                    let place = ways.path_state(way).place.of(uses::LIGHTS + light);
                    let u = ways.sample(way).two_of(place, point, source.points());
                    source.sample(u, exact)
                } else {
                    source.illuminate(point, exact)
                }
            }));
            LightSamples8::known(ways, interactions8, arriving);
        }
        for (number, (way, interactions8)) in ways.iter_mut().zip(interactions8).enumerate() {
            way.evaluate(interactions8);
            for lane in lanes(way.lit & interactions8.bent) {
                if is_behind(&interactions.at(number * LANES + lane), way, lane) {
                    way.mask_out(lane);
                }
            }
        }
    }

    /// Finds cosⁿα (5.38) where light arrives. Shadowed interactions are included only if `anyway` is set.
    fn highlights(&mut self, interactions8: &[Interactions8], anyway: bool) {
        let Lighting { ways, shining, cosines, exponents, .. } = self;
        shining.clear();
        cosines.clear();
        exponents.clear();
        for (number, (way, interactions8)) in ways.iter().zip(interactions8).enumerate() {
            for lane in lanes(way.lit & interactions8.shiny) {
                let (n, r_dot_l) = (interactions8.n[lane], way.r_dot_l[lane]);
                // The highlight is zero elsewhere.
                if (anyway || way.f_s[lane] > 0.0) && (r_dot_l > 0.0 || n == 0.0) {
                    shining.push((number * LANES + lane) as u32);
                    cosines.push(r_dot_l);
                    exponents.push(n);
                }
            }
        }
        highlights(cosines, exponents);
        for (&interaction, &power) in shining.iter().zip(&*cosines) {
            ways[interaction as usize / LANES].highlight[interaction as usize % LANES] = power;
        }
    }
}

/// Whether light comes from behind the surface, though not from behind its bent normal.
fn is_behind(at: &InteractionRef, way: &LightSamples8, lane: usize) -> bool {
    at.interaction.material.bent && at.facing().dot(way.direction(lane)) <= 0.0
}

/// The differential of the shadow ray from an interaction, if anything uses it.
fn spread_of(wave: &Wave, way: &LightSamples8, interaction: usize) -> Option<RayDifferential> {
    let (footprint, lane) = (wave.footprints.get(interaction)?, interaction % LANES);
    Some(RayDifferential::to_light(footprint.step, way.direction(lane), f64::from(way.distance[lane])))
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
                if self.cancelled_early {
                    break 'lights;
                }
                lighting.sample(self.source(light), (light, point), wave);
                self.shadow(&mut lighting, light, wave, probe);
                let interactions8 = wave.interactions.both().1;
                if self.settings.stage >= Stage::Specular {
                    // In shadow a highlight is black, and only a probe reports it.
                    lighting.highlights(interactions8, P::ACTIVE);
                }
                LightSamples8::add(&lighting.ways, interactions8);
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
        let Lighting { ways, crossing, .. } = lighting;
        let source = self.source(light);
        if self.settings.stage < Stage::Shadow || !self.settings.shadows || !source.light.shadows {
            return;
        }
        self.bundle.clear();
        for (way, interactions8) in ways.iter().zip(wave.interactions.interactions8()) {
            self.bundle.push_some(way.lit, &interactions8.start, &way.to, &way.reach);
        }
        self.world.occlusion_batch(&mut self.bundle, self.time, &mut self.occluders[light as usize]);
        self.counts.shadow.traced += self.bundle.len() as u64;
        crossing.clear();
        self.shadow_rays.bundle.clear();
        let mut shadow = 0;
        for (number, way) in ways.iter_mut().enumerate() {
            for lane in lanes(way.lit) {
                let (occlusion, interaction) = (self.bundle.occlusion(shadow), number * LANES + lane);
                if occlusion != Occlusion::Nothing && P::ACTIVE {
                    // Only a probe needs the order of the occluders.
                    let (ray, t_max) = self.bundle.ray(shadow);
                    let differential = spread_of(wave, way, interaction);
                    way.f_s[lane] =
                        self.world.transmittance_past(&ray, t_max, self.time, differential.as_ref(), occlusion, probe);
                    self.counts.shadow.hit += u64::from(way.f_s[lane] == 0.0);
                } else if occlusion == Occlusion::Clear {
                    let (ray, t_max) = self.bundle.ray(shadow);
                    crossing.push(interaction as u32);
                    self.shadow_rays.bundle.push(ray, t_max);
                } else {
                    let opaque = occlusion == Occlusion::Opaque;
                    way.f_s[lane] = if opaque { 0.0 } else { 1.0 };
                    self.counts.shadow.hit += u64::from(opaque);
                }
                shadow += 1;
            }
        }
        self.world.transmittance_batch(&mut self.shadow_rays, self.time, |number| {
            let interaction = crossing[number] as usize;
            spread_of(wave, &ways[interaction / LANES], interaction)
        });
        for (number, &interaction) in crossing.iter().enumerate() {
            let f_s = self.shadow_rays.passed(number);
            ways[interaction as usize / LANES].f_s[interaction as usize % LANES] = f_s;
            self.counts.shadow.hit += u64::from(f_s == 0.0);
        }
        if self.world.has_clear() {
            self.cross_back(ways, &wave.interactions, probe);
        }
    }

    /// Where faces coincide, light crosses back through those that the camera ray has crossed before.
    fn cross_back<P: Probe>(&self, ways: &mut [LightSamples8], interactions: &Interactions, probe: &mut P) {
        for (index, interaction) in
            interactions.each().iter().enumerate().filter(|(_, interaction)| interaction.crossing != NONE)
        {
            let (way, lane) = (&mut ways[index / LANES], index % LANES);
            if way.lit >> lane & 1 == 0 {
                continue;
            }
            let at = interactions.at(index);
            self.media.for_before(interaction.crossing, |hit| {
                let opacity = self.world.kept_light(at.leave(-at.wo()), hit, None);
                probe.blocker(hit, opacity);
                way.f_s[lane] *= 1.0 - opacity;
            });
        }
    }

    /// Reports the light that arrives at the one interaction to a probe.
    fn report<P: Probe>(&self, lighting: &Lighting, (light, point): (u32, u32), at: &InteractionRef, probe: &mut P) {
        let (way, interactions8, source) = (&lighting.ways[0], at.interactions8, self.source(light));
        if !at.interaction.is_seen() {
            return;
        }
        let [diffuse, specular, contribution] = way.terms(interactions8, 0);
        let intensity = way.intensity(0);
        probe.light(&LightTerm {
            light,
            point,
            sampled: if source.is_sampled() { lighting.arriving[0].position } else { None },
            direction: way.direction(0).as_vec3(),
            distance: way.distance[0],
            intensity,
            n_dot_l: way.n_dot_l[0],
            behind: way.n_dot_l[0] > 0.0 && !intensity.is_black() && is_behind(at, way, 0),
            r_dot_l: way.r_dot_l[0],
            f_s: way.f_s[0],
            diffuse,
            specular,
            contribution,
        });
    }
}
