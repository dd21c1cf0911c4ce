//! The light that reaches stops: (5.39a).

use super::media::NONE;
use super::octet::{Octet, STOPS, Towards, lanes};
use super::stop::{At, Stops};
use super::way::uses;
use super::{Generation, Whitted};
use crate::integrator::{LightTerm, Probe};
use crate::light::{Illumination, Source};
use crate::material::highlights;
use crate::math::Spread;
use crate::scene::Stage;
use crate::world::Between;

/// What is kept for lights while a generation is lit.
#[derive(Default)]
pub(super) struct Lighting {
    /// To the point whose turn it is.
    ways: Vec<Towards>,
    /// What arrives from there, if it isn't the same point for all.
    arriving: Vec<Illumination>,
    /// The stops of shadow rays through what is clear.
    crossing: Vec<u32>,
    /// Stops with a highlight, with the bases and exponents of their powers.
    shining: Vec<u32>,
    cosines: Vec<f32>,
    exponents: Vec<f32>,
}

impl Lighting {
    /// Finds the ways to a light's point, and what comes along them before shadows.
    fn look(&mut self, source: &Source, (light, point): (u32, u32), generation: &Generation) {
        let Lighting { ways, arriving, .. } = self;
        let (stops, octets) = (&generation.stops, generation.stops.octets());
        arriving.clear();
        if let Some(position) = source.point(point) {
            Towards::point(ways, octets, position);
            match source.even() {
                Some(intensity) => ways.iter_mut().for_each(|way| way.set_intensities(intensity)),
                None => {
                    for index in 0..stops.len() {
                        let (way, lane) = (&mut ways[index / STOPS], index % STOPS);
                        way.set_intensity(lane, source.along(way.direction(lane), way.distance[lane]));
                    }
                }
            }
        } else {
            arriving.extend(stops.each().iter().enumerate().map(|(index, stop)| {
                let exact = octets[index / STOPS].exact(index % STOPS);
                if source.is_sampled() {
                    let (ways, way) = (&generation.ways, stop.way());
                    let place = ways.branch(way).place.of(uses::LIGHTS + light);
                    let u = ways.sample(way).two_of(place, point, source.points());
                    source.sample(u, exact)
                } else {
                    source.illuminate(point, exact)
                }
            }));
            Towards::known(ways, octets, arriving);
        }
        for (number, (way, octet)) in ways.iter_mut().zip(octets).enumerate() {
            way.come(octet);
            for lane in lanes(way.comes & octet.bent) {
                if is_behind(&stops.at(number * STOPS + lane), way, lane) {
                    way.keep_off(lane);
                }
            }
        }
    }

    /// Finds cosⁿα (5.38) where light comes; in shadow only if `anyway`.
    fn highlights(&mut self, octets: &[Octet], anyway: bool) {
        let Lighting { ways, shining, cosines, exponents, .. } = self;
        shining.clear();
        cosines.clear();
        exponents.clear();
        for (number, (way, octet)) in ways.iter().zip(octets).enumerate() {
            for lane in lanes(way.comes & octet.shiny) {
                let (n, r_dot_l) = (octet.n[lane], way.r_dot_l[lane]);
                // From others there is none.
                if (anyway || way.f_s[lane] > 0.0) && (r_dot_l > 0.0 || n == 0.0) {
                    shining.push((number * STOPS + lane) as u32);
                    cosines.push(r_dot_l);
                    exponents.push(n);
                }
            }
        }
        highlights(cosines, exponents);
        for (&stop, &power) in shining.iter().zip(&*cosines) {
            ways[stop as usize / STOPS].highlight[stop as usize % STOPS] = power;
        }
    }
}

/// Whether light comes from behind the surface, though not behind its bent normal.
fn is_behind(at: &At, way: &Towards, lane: usize) -> bool {
    at.stop.material.bent && at.facing().dot(way.direction(lane)) <= 0.0
}

/// How far neighbours of the ray from a stop to the light are, if anything wants to know.
fn spread_of(generation: &Generation, way: &Towards, stop: usize) -> Option<Spread> {
    let (footprint, lane) = (generation.footprints.get(stop)?, stop % STOPS);
    Some(Spread::to_light(footprint.step, way.direction(lane), f64::from(way.distance[lane])))
}

impl Whitted<'_> {
    /// Adds the light of all lights, one point after the other.
    pub(super) fn light<P: Probe>(&mut self, generation: &mut Generation, probe: &mut P) {
        if self.world.lights.is_empty() {
            return;
        }
        let mut lighting = std::mem::take(&mut self.lighting);
        let (stops, octets) = generation.stops.both();
        for (octet, stops) in octets.iter_mut().zip(stops.chunks(STOPS)) {
            for (lane, stop) in stops.iter().enumerate() {
                octet.set_color(lane, stop.color);
            }
        }
        let rays = generation.stops.len() as u32;
        'lights: for light in 0..self.world.lights.len() as u32 {
            for point in 0..self.world.lights[light as usize].points() {
                self.ask(rays);
                if self.gave_up {
                    break 'lights;
                }
                lighting.look(self.source(light), (light, point), generation);
                self.shadow(&mut lighting, light, generation, probe);
                let octets = generation.stops.both().1;
                if self.settings.stage >= Stage::Specular {
                    // In shadow a highlight is black, and only a probe wants to know more.
                    lighting.highlights(octets, P::ACTIVE);
                }
                Towards::add(&lighting.ways, octets);
                if P::ACTIVE {
                    self.tell(&lighting, (light, point), &generation.stops.at(0), probe);
                }
            }
        }
        let (stops, octets) = generation.stops.both();
        for (octet, stops) in octets.iter().zip(stops.chunks_mut(STOPS)) {
            for (lane, stop) in stops.iter_mut().enumerate().filter(|(_, stop)| stop.is_seen()) {
                stop.color = octet.color(lane);
            }
        }
        self.lighting = lighting;
    }

    /// The light where it is now.
    fn source(&self, light: u32) -> &Source {
        self.lights.get(light as usize).unwrap_or(&self.world.lights[light as usize])
    }

    /// Finds f_s, the share of the light that passes what is between a light's point and the stops.
    fn shadow<P: Probe>(&mut self, lighting: &mut Lighting, light: u32, generation: &Generation, probe: &mut P) {
        let Lighting { ways, crossing, .. } = lighting;
        let source = self.source(light);
        if self.settings.stage < Stage::Shadow || !self.settings.shadows || !source.light.shadows {
            return;
        }
        self.bundle.clear();
        for (way, octet) in ways.iter().zip(generation.stops.octets()) {
            self.bundle.push_some(way.comes, &octet.start, &way.to, &way.reach);
        }
        self.world.between_bundle(&mut self.bundle, self.time, &mut self.blockers[light as usize]);
        self.counts.shadow.traced += self.bundle.len() as u64;
        crossing.clear();
        self.crossings.bundle.clear();
        let mut shadow = 0;
        for (number, way) in ways.iter_mut().enumerate() {
            for lane in lanes(way.comes) {
                let (between, stop) = (self.bundle.between(shadow), number * STOPS + lane);
                if between != Between::Nothing && P::ACTIVE {
                    // Only a recording probe wants to know what stands in which order.
                    let (ray, t_max) = self.bundle.ray(shadow);
                    let spread = spread_of(generation, way, stop);
                    way.f_s[lane] = self.world.through(&ray, t_max, self.time, spread.as_ref(), between, probe);
                    self.counts.shadow.hit += u64::from(way.f_s[lane] == 0.0);
                } else if between == Between::Clear {
                    let (ray, t_max) = self.bundle.ray(shadow);
                    crossing.push(stop as u32);
                    self.crossings.bundle.push(ray, t_max);
                } else {
                    let opaque = between == Between::Opaque;
                    way.f_s[lane] = if opaque { 0.0 } else { 1.0 };
                    self.counts.shadow.hit += u64::from(opaque);
                }
                shadow += 1;
            }
        }
        self.world.through_together(&mut self.crossings, self.time, |number| {
            let stop = crossing[number] as usize;
            spread_of(generation, &ways[stop / STOPS], stop)
        });
        for (number, &stop) in crossing.iter().enumerate() {
            let f_s = self.crossings.passed(number);
            ways[stop as usize / STOPS].f_s[stop as usize % STOPS] = f_s;
            self.counts.shadow.hit += u64::from(f_s == 0.0);
        }
        if self.world.has_clear() {
            self.cross_back(ways, &generation.stops, probe);
        }
    }

    /// Where faces coincide, light comes back through those that the ray from the eye has crossed before.
    fn cross_back<P: Probe>(&self, ways: &mut [Towards], stops: &Stops, probe: &mut P) {
        for (index, stop) in stops.each().iter().enumerate().filter(|(_, stop)| stop.crossing != NONE) {
            let (way, lane) = (&mut ways[index / STOPS], index % STOPS);
            if way.comes >> lane & 1 == 0 {
                continue;
            }
            let at = stops.at(index);
            self.media.for_before(stop.crossing, |hit| {
                let opacity = self.world.kept_light(at.leave(-at.wo()), hit, None);
                probe.blocker(hit, opacity);
                way.f_s[lane] *= 1.0 - opacity;
            });
        }
    }

    /// Tells a probe, for which there is one stop, what arrives there.
    fn tell<P: Probe>(&self, lighting: &Lighting, (light, point): (u32, u32), at: &At, probe: &mut P) {
        let (way, octet, source) = (&lighting.ways[0], at.octet, self.source(light));
        if !at.stop.is_seen() {
            return;
        }
        let [diffuse, specular, contribution] = way.terms(octet, 0);
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
