//! Direct lighting: the light that reaches the interactions of a wave (5.39a).

use super::Wave;
use super::interactions::Interactions;
use super::interactions8::{Interactions8, LANES, LightSamples8, contribution, lit};
use crate::integrator::media::NONE;
use crate::integrator::whitted::Whitted;
use crate::integrator::whitted::ray_state::uses;
use crate::integrator::{LightTerm, Probe};
use crate::light::{Illumination, PreparedLight};
use crate::material::highlights;
use crate::math::{RayDifferential, Rgb};
use crate::scene::Stage;
use crate::shape::{set_bits, vec3};
use crate::world::{Occlusion, World};
use canaletto_bvh::Ray;

/// Buffers for the lighting of one wave.
#[derive(Default)]
pub(super) struct Lighting {
    /// The samples of the current light point.
    light_samples: Vec<LightSamples8>,
    /// The arriving light, if the light point differs between interactions.
    arriving: Vec<Illumination>,
    /// The current light at the time of each interaction, if it moves.
    moved: Vec<PreparedLight>,
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
        let Lighting { light_samples, arriving, moved, .. } = self;
        let (interactions, interactions8) = (&wave.interactions, wave.interactions.interactions8());
        arriving.clear();
        if let Some(position) = source.point(point).filter(|_| moved.is_empty()) {
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
                let source = moved.get(index).unwrap_or(source);
                if source.is_sampled() {
                    let (batch, ray_index) = (&wave.batch, interaction.ray_index());
                    let place = batch.path_state(ray_index).place.of(uses::LIGHTS + light);
                    let u = batch.sample(ray_index).two_of(place, point, source.points());
                    source.illuminate_from(u, exact)
                } else {
                    source.illuminate(point, exact)
                }
            }));
            LightSamples8::from_illumination(light_samples, interactions8, arriving);
        }
        for (samples8, interactions8) in light_samples.iter_mut().zip(interactions8) {
            samples8.evaluate(interactions8);
            for lane in set_bits(samples8.lit & interactions8.normal_bent) {
                if interactions8.is_below(lane, samples8.direction(lane)) {
                    samples8.mask_out(lane);
                }
            }
        }
    }

    /// Finds a light at the time of each interaction, if it moves.
    fn move_light(&mut self, world: &World, light: u32, wave: &Wave) {
        self.moved.clear();
        let Some(moving) = world.moving_light(light) else { return };
        let mut last = None;
        for interaction in wave.interactions.each() {
            let time = interaction.hit.time;
            let moved = match self.moved.last() {
                Some(moved) if last == Some(time) => moved.clone(),
                _ => moving(time),
            };
            self.moved.push(moved);
            last = Some(time);
        }
    }

    /// Finds cosⁿα (5.38) where light arrives.
    fn highlights(&mut self, interactions8: &[Interactions8]) {
        let Lighting { light_samples, shining, cosines, exponents, .. } = self;
        shining.clear();
        cosines.clear();
        exponents.clear();
        for (number, (samples8, interactions8)) in light_samples.iter().zip(interactions8).enumerate() {
            for lane in set_bits(samples8.lit & interactions8.shiny) {
                let (n, r_dot_l) = (interactions8.n[lane], samples8.r_dot_l[lane]);
                // The highlight is zero elsewhere.
                if samples8.f_s[lane] > 0.0 && (r_dot_l > 0.0 || n == 0.0) {
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

impl Lighting {
    /// Tells a probe the terms of a light's point.
    fn report<P: Probe + ?Sized>(
        &self,
        (light, point): (u32, u32),
        (source, stage): (&PreparedLight, Stage),
        wave: &Wave,
        probe: &mut P,
    ) {
        for (index, interaction) in wave.interactions.each().iter().enumerate().filter(|(_, i)| i.is_seen()) {
            let (number, lane) = (index / LANES, index % LANES);
            let (samples8, interactions8) = (&self.light_samples[number], &wave.interactions.interactions8()[number]);
            let (phong, intensity, direction) =
                (&interaction.material.classic, samples8.intensity(lane), samples8.direction(lane));
            let (n_dot_l, r_dot_l, f_s) = (samples8.n_dot_l[lane], samples8.r_dot_l[lane], samples8.f_s[lane]);
            let is_before = n_dot_l > 0.0 && !intensity.is_black();
            let arrives = samples8.lit >> lane & 1 == 1;
            let mut term = LightTerm {
                light,
                point,
                sampled: self.arriving.get(index).filter(|_| source.is_sampled()).and_then(|light| light.position),
                direction: direction.as_vec3(),
                distance: samples8.distance[lane],
                intensity,
                n_dot_l,
                behind: is_before && interactions8.is_below(lane, direction),
                r_dot_l,
                f_s,
                diffuse: Rgb::BLACK,
                specular: Rgb::BLACK,
                contribution: Rgb::BLACK,
            };
            if arrives {
                let is_shiny = stage >= Stage::Specular && !phong.ks.is_black() && (r_dot_l > 0.0 || phong.n == 0.0);
                let mut highlight = [if is_shiny { r_dot_l } else { 0.0 }];
                if is_shiny {
                    highlights(&mut highlight, &[phong.n]); // cosⁿα of (5.38)
                }
                let [l, kd, ks] = [intensity, phong.kd, phong.ks].map(Rgb::to_array);
                let both = [0, 1, 2].map(|c: usize| lit(l[c], [kd[c], n_dot_l], [ks[c], highlight[0]]));
                term.diffuse = both.map(|[diffuse, _]| diffuse).into();
                term.specular = both.map(|[_, specular]| specular).into();
                term.contribution = both.map(|both| contribution(both, f_s)).into();
            }
            probe.light(&term);
        }
    }
}

/// The differential of the shadow ray from an interaction, if anything uses it.
fn shadow_differential(wave: &Wave, samples8: &LightSamples8, interaction: usize) -> Option<RayDifferential> {
    let (footprint, lane) = (wave.footprints.get(interaction)?, interaction % LANES);
    Some(RayDifferential::to_light(footprint.step, samples8.direction(lane), f64::from(samples8.distance[lane])))
}

impl Whitted<'_> {
    /// Adds the light of all lights, one light point after the other.
    pub(in crate::integrator::whitted) fn add_lights<P: Probe + ?Sized>(&mut self, wave: &mut Wave, probe: &mut P) {
        if self.light_count() == 0 {
            return;
        }
        let mut lighting = std::mem::take(&mut self.waves.lighting);
        let (interactions, interactions8) = wave.interactions.both();
        for (interactions8, interactions) in interactions8.iter_mut().zip(interactions.chunks(LANES)) {
            for (lane, interaction) in interactions.iter().enumerate() {
                interactions8.set_color(lane, interaction.color);
            }
        }
        let rays = wave.interactions.len() as u32;
        'lights: for light in 0..self.light_count() {
            lighting.move_light(self.world, light, wave);
            for point in 0..self.world.lights[light as usize].points() {
                self.poll(rays);
                if self.is_cancelled {
                    break 'lights;
                }
                lighting.sample(&self.world.lights[light as usize], (light, point), wave);
                self.shadow(&mut lighting, light, wave, probe);
                let interactions8 = wave.interactions.both().1;
                if self.settings.stage >= Stage::Specular {
                    lighting.highlights(interactions8);
                }
                if probe.is_active() {
                    let source = &self.world.lights[light as usize];
                    lighting.report((light, point), (source, self.settings.stage), wave, probe);
                }
                LightSamples8::add(&lighting.light_samples, wave.interactions.both().1);
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
        self.waves.lighting = lighting;
    }

    /// Whether shadow rays are traced to a light.
    fn casts_shadows(&self, light: u32) -> bool {
        self.settings.stage >= Stage::Shadow && self.settings.shadows && self.world.lights[light as usize].light.shadows
    }

    /// Finds f_s, the share of the light that passes the surfaces between a light's point and the interactions.
    fn shadow<P: Probe + ?Sized>(&mut self, lighting: &mut Lighting, light: u32, wave: &Wave, probe: &mut P) {
        if !self.casts_shadows(light) {
            return;
        }
        let Lighting { light_samples, crossing, .. } = lighting;
        if let Some(lookup) = self.shadow_lookup {
            for (samples8, interactions8) in light_samples.iter_mut().zip(wave.interactions.interactions8()) {
                for lane in set_bits(samples8.lit) {
                    let ray = [interactions8.start(lane), vec3(&samples8.to, lane)];
                    let (point, normal) = (interactions8.exact(lane), interactions8.facing(lane));
                    samples8.f_s[lane] = lookup.passed(light, ray, samples8.reach[lane], point, normal);
                }
            }
            return;
        }
        if probe.is_active() {
            self.shadow_one_by_one(light_samples, light, wave, probe);
            return;
        }
        self.waves.bundle.clear();
        for (samples8, interactions8) in light_samples.iter().zip(wave.interactions.interactions8()) {
            self.waves.bundle.push_some(samples8.lit, &interactions8.start, &samples8.to, &samples8.reach);
        }
        if self.world.moves() {
            let each = wave.interactions.each();
            let lit = light_samples.iter().enumerate().flat_map(|(number, samples8)| {
                set_bits(samples8.lit).map(move |lane| each[number * LANES + lane].hit.time)
            });
            self.waves.bundle.set_times(lit);
        }
        self.world.occlusion_batch(&mut self.waves.bundle, &mut self.occluders[light as usize]);
        self.counts.shadow.traced += self.waves.bundle.len() as u64;
        crossing.clear();
        self.waves.shadow_rays.bundle.clear();
        let mut shadow = 0;
        for (number, samples8) in light_samples.iter_mut().enumerate() {
            for lane in set_bits(samples8.lit) {
                let (occlusion, interaction) = (self.waves.bundle.occlusion(shadow), number * LANES + lane);
                if occlusion == Occlusion::Clear {
                    let (ray, t_max) = self.waves.bundle.ray(shadow);
                    crossing.push(interaction as u32);
                    self.waves.shadow_rays.bundle.push(ray, t_max);
                } else {
                    let opaque = occlusion == Occlusion::Opaque;
                    samples8.f_s[lane] = if opaque { 0.0 } else { 1.0 };
                    self.counts.shadow.hit += u64::from(opaque);
                }
                shadow += 1;
            }
        }
        if self.world.moves() {
            let time = |&interaction: &u32| wave.interactions.each()[interaction as usize].hit.time;
            self.waves.shadow_rays.bundle.set_times(crossing.iter().map(time));
        }
        self.world.transmittance_batch(&mut self.waves.shadow_rays, |number| {
            let interaction = crossing[number] as usize;
            shadow_differential(wave, &light_samples[interaction / LANES], interaction)
        });
        for (number, &interaction) in crossing.iter().enumerate() {
            let f_s = self.waves.shadow_rays.passed(number);
            light_samples[interaction as usize / LANES].f_s[interaction as usize % LANES] = f_s;
            self.counts.shadow.hit += u64::from(f_s == 0.0);
        }
        if self.world.has_clear() {
            self.apply_crossed_surfaces(light_samples, &wave.interactions, probe);
        }
    }

    /// The same for a probe, which hears of what blocks the light.
    fn shadow_one_by_one<P: Probe + ?Sized>(
        &mut self,
        light_samples: &mut [LightSamples8],
        light: u32,
        wave: &Wave,
        probe: &mut P,
    ) {
        for (number, (samples8, interactions8)) in
            light_samples.iter_mut().zip(wave.interactions.interactions8()).enumerate()
        {
            for lane in set_bits(samples8.lit) {
                let index = number * LANES + lane;
                let (ray, t_max) =
                    (Ray::new(interactions8.start(lane), vec3(&samples8.to, lane)), samples8.reach[lane]);
                let time = wave.interactions.each()[index].hit.time;
                let differential = shadow_differential(wave, samples8, index);
                let occluder = &mut self.occluders[light as usize];
                let f_s = self.world.transmittance(&ray, t_max, time, differential.as_ref(), occluder, probe);
                samples8.f_s[lane] = f_s;
                self.counts.shadow.traced += 1;
                self.counts.shadow.hit += u64::from(f_s == 0.0);
            }
        }
        self.apply_crossed_surfaces(light_samples, &wave.interactions, probe);
    }

    /// Where faces coincide, light crosses back through those that the camera ray has crossed before.
    fn apply_crossed_surfaces<P: Probe + ?Sized>(
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
            let frame = interactions.frame(index);
            self.media.for_crossed_before(interaction.crossing, |hit| {
                let opacity = self.world.opacity_at(frame.leave(-frame.wo), hit, None);
                probe.blocker(hit, opacity);
                samples8.f_s[lane] *= 1.0 - opacity;
            });
        }
    }
}
