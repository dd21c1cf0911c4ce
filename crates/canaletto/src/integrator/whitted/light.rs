//! The light that reaches stops: (5.39a).

use super::octet::{Octet, STOPS, Towards, lanes};
use super::way::{Stop, uses};
use super::{Generation, Whitted};
use crate::integrator::{LightTerm, Probe};
use crate::light::{Illumination, Source};
use crate::material::highlights;
use crate::math::Spread;
use crate::scene::Stage;
use crate::world::Between;
use canaletto_bvh::Ray;

/// What is kept for lights while a generation is lit.
#[derive(Default)]
pub(super) struct Lighting {
    octets: Vec<Octet>,
    /// To the point whose turn it is.
    ways: Vec<Towards>,
    /// What arrives from there, if it isn't the same point for all.
    arriving: Vec<Illumination>,
    /// The stops of the shadow rays.
    shadowed: Vec<u32>,
    /// Of those, the stops of rays through what is clear.
    crossing: Vec<u32>,
    /// Stops with a highlight, with the bases and exponents of their powers.
    shining: Vec<u32>,
    cosines: Vec<f32>,
    exponents: Vec<f32>,
}

impl Lighting {
    /// Finds the ways to a light's point, and what comes along them before shadows.
    fn look(&mut self, source: &Source, (light, point): (u32, u32), generation: &Generation) {
        let Lighting { octets, ways, arriving, .. } = self;
        let stops = &generation.stops;
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
            arriving.extend(stops.iter().map(|stop| {
                if source.is_sampled() {
                    let (ways, way) = (&generation.ways, stop.way());
                    let place = ways.branch(way).place.of(uses::LIGHTS + light);
                    let u = ways.sample(way).two_of(place, point, source.points());
                    source.sample(u, stop.surface.exact)
                } else {
                    source.illuminate(point, stop.surface.exact)
                }
            }));
            Towards::known(ways, octets, arriving.iter().map(|a| (a.direction, a.distance)));
            for (index, arriving) in arriving.iter().enumerate() {
                ways[index / STOPS].set_intensity(index % STOPS, arriving.intensity);
            }
        }
        for (number, (way, octet)) in ways.iter_mut().zip(octets).enumerate() {
            way.come(octet);
            for lane in lanes(way.comes & octet.bent) {
                if is_behind(&stops[number * STOPS + lane], way, lane) {
                    way.keep_off(lane);
                }
            }
        }
    }

    /// Finds cosⁿα (5.38) where light comes; in shadow only if `anyway`.
    fn highlights(&mut self, anyway: bool) {
        let Lighting { octets, ways, shining, cosines, exponents, .. } = self;
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
fn is_behind(stop: &Stop, way: &Towards, lane: usize) -> bool {
    stop.material.bent && stop.facing().dot(way.direction(lane)) <= 0.0
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
        Octet::fill(&mut lighting.octets, &generation.stops);
        for light in 0..self.world.lights.len() as u32 {
            for point in 0..self.world.lights[light as usize].points() {
                lighting.look(self.source(light), (light, point), generation);
                self.shadow(&mut lighting, (light, point), generation, probe);
                if self.settings.stage >= Stage::Specular {
                    // In shadow a highlight is black, and only a probe wants to know more.
                    lighting.highlights(P::ACTIVE);
                }
                Towards::add(&lighting.ways, &mut lighting.octets);
                if P::ACTIVE {
                    self.tell(&lighting, (light, point), &generation.stops[0], probe);
                }
            }
        }
        for (octet, stops) in lighting.octets.iter().zip(generation.stops.chunks_mut(STOPS)) {
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
    fn shadow<P: Probe>(
        &mut self,
        lighting: &mut Lighting,
        (light, point): (u32, u32),
        generation: &Generation,
        probe: &mut P,
    ) {
        let Lighting { octets, ways, arriving, shadowed, crossing, .. } = lighting;
        let source = self.source(light);
        if self.settings.stage < Stage::Shadow || !self.settings.shadows || !source.light.shadows {
            return;
        }
        let position = source.point(point);
        self.bundle.clear();
        shadowed.clear();
        for (number, (way, octet)) in ways.iter().zip(&*octets).enumerate() {
            for lane in lanes(way.comes) {
                let (stop, origin) = (number * STOPS + lane, octet.start(lane));
                // Towards a point the ray ends there, at t = 1; towards infinity it has no end.
                let (direction, t_max) = match arriving.get(stop).map_or(position, |arriving| arriving.position) {
                    Some(position) => (position - origin, 1.0 - f32::EPSILON),
                    None => (way.direction(lane).as_vec3(), f32::INFINITY),
                };
                shadowed.push(stop as u32);
                self.bundle.push(Ray { origin, direction }, t_max);
            }
        }
        self.world.between_bundle(&mut self.bundle, self.time, &mut self.blockers[light as usize]);
        self.counts.shadow.traced += shadowed.len() as u64;
        crossing.clear();
        self.crossings.bundle.clear();
        for (shadow, &stop) in shadowed.iter().enumerate() {
            let (way, lane) = (&mut ways[stop as usize / STOPS], stop as usize % STOPS);
            let f_s = match self.bundle.between(shadow) {
                Between::Nothing => continue,
                // Only a recording probe wants to know what stands in which order.
                between if P::ACTIVE => {
                    let (ray, t_max) = self.bundle.ray(shadow);
                    let spread = spread_of(generation, way, stop as usize);
                    self.world.through(&ray, t_max, self.time, spread.as_ref(), between, probe)
                }
                Between::Opaque => 0.0,
                Between::Clear => {
                    let (ray, t_max) = self.bundle.ray(shadow);
                    crossing.push(stop);
                    self.crossings.bundle.push(ray, t_max);
                    continue;
                }
            };
            way.f_s[lane] = f_s;
            self.counts.shadow.hit += u64::from(f_s == 0.0);
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
    }

    /// Tells a probe, for which there is one stop, what arrives there.
    fn tell<P: Probe>(&self, lighting: &Lighting, (light, point): (u32, u32), at: &Stop, probe: &mut P) {
        let (way, octet, source) = (&lighting.ways[0], &lighting.octets[0], self.source(light));
        if !at.is_seen() {
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
