//! The light that reaches stops: (5.39a).

use super::octet::{Octet, ToLight, Towards};
use super::way::{Stop, uses};
use super::{Generation, Whitted};
use crate::integrator::{LightTerm, Probe};
use crate::light::{Illumination, Source};
use crate::material::highlights;
use crate::math::{Rgb, Spread, offset_origin};
use crate::scene::Stage;
use crate::world::Between;
use canaletto_bvh::Ray;
use glam::Vec3;

/// What a point of a light brings to a stop.
pub(super) struct Arrival {
    /// The stop.
    stop: u32,
    /// The number of its shadow ray, or [`NO_SHADOW`].
    shadow: u32,
    /// Whether it comes at all, before shadows.
    comes: bool,
    behind: bool,
    n_dot_l: f32,
    /// Before shadows.
    intensity: Rgb,
    /// f_s, the share that passes.
    f_s: f32,
    /// cosⁿα.
    highlight: f32,
}

const NO_SHADOW: u32 = u32::MAX;

/// What is kept for lights while a generation is lit.
#[derive(Default)]
pub(super) struct Lighting {
    octets: Vec<Octet>,
    /// To the point whose turn it is.
    ways: Vec<Towards>,
    /// What arrives from there, if it isn't the same point for all.
    arriving: Vec<Illumination>,
    arrivals: Vec<Arrival>,
    /// Where shadow rays start, for each stop.
    starts: Vec<Vec3>,
    /// Arrivals with a highlight, with the bases and exponents of their powers.
    shining: Vec<u32>,
    cosines: Vec<f32>,
    exponents: Vec<f32>,
}

impl Lighting {
    /// Makes what doesn't depend on the light.
    fn begin(&mut self, stops: &[Stop]) {
        Octet::fill(&mut self.octets, stops);
        self.starts.clear();
        self.starts.extend(stops.iter().map(|at| {
            let start = if at.outside { at.surface.lifted } else { at.surface.point };
            offset_origin(start, at.surface.error, at.facing(), at.facing())
        }));
    }

    /// Finds the ways to a light's point.
    fn look(&mut self, source: &Source, (light, point): (u32, u32), generation: &Generation) {
        let Lighting { octets, ways, arriving, .. } = self;
        arriving.clear();
        if let Some(position) = source.point(point) {
            return Towards::point(ways, octets, position);
        }
        arriving.extend(generation.stops.iter().map(|stop| {
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
    }

    /// Finds cosⁿα (5.38) of those arrivals that `wants` holds for.
    fn highlights(&mut self, stops: &[Stop], wants: impl Fn(&Arrival, &Stop) -> bool) {
        let Lighting { ways, arrivals, shining, cosines, exponents, .. } = self;
        shining.clear();
        cosines.clear();
        exponents.clear();
        for (index, arrival) in arrivals.iter().enumerate() {
            let stop = &stops[arrival.stop as usize];
            let (n, r_dot_l) = (stop.material.phong.n, Towards::r_dot_l(ways, arrival.stop as usize));
            // From others there is none.
            if wants(arrival, stop) && (r_dot_l > 0.0 || n == 0.0) {
                shining.push(index as u32);
                cosines.push(r_dot_l);
                exponents.push(n);
            }
        }
        highlights(cosines, exponents);
        for (&index, &power) in shining.iter().zip(&*cosines) {
            arrivals[index as usize].highlight = power;
        }
    }
}

impl Whitted<'_> {
    /// Adds the light of all lights, one point after the other.
    pub(super) fn light<P: Probe>(&mut self, generation: &mut Generation, probe: &mut P) {
        if self.world.lights.is_empty() {
            return;
        }
        let mut lighting = std::mem::take(&mut self.lighting);
        lighting.begin(&generation.stops);
        for light in 0..self.world.lights.len() as u32 {
            for point in 0..self.world.lights[light as usize].points() {
                lighting.look(self.source(light), (light, point), generation);
                lighting.arrivals.clear();
                self.bundle.clear();
                for (index, stop) in generation.stops.iter().enumerate().filter(|(_, stop)| stop.is_seen()) {
                    let arrival = self.arrival(index, stop, &lighting, light, point);
                    if P::ACTIVE || arrival.comes {
                        lighting.arrivals.push(arrival);
                    }
                }
                self.world.between_bundle(&mut self.bundle, self.time, &mut self.blockers[light as usize]);
                self.counts.shadow.traced += self.bundle.len() as u64;
                for arrival in lighting.arrivals.iter_mut().filter(|arrival| arrival.shadow != NO_SHADOW) {
                    arrival.f_s = self.f_s(arrival, &lighting.ways, generation, probe);
                    self.counts.shadow.hit += u64::from(arrival.f_s == 0.0);
                }
                if self.settings.stage >= Stage::Specular {
                    // In shadow a highlight is black, and only a probe wants to know more.
                    lighting.highlights(&generation.stops, |arrival, stop| {
                        arrival.comes && (P::ACTIVE || arrival.f_s > 0.0) && !stop.material.phong.ks.is_black()
                    });
                }
                for arrival in &lighting.arrivals {
                    let stop = &mut generation.stops[arrival.stop as usize];
                    let [diffuse, specular] = arrival.lit(stop);
                    let contribution = (diffuse + specular).saturated() * arrival.f_s; // (5.39a)
                    stop.color = (stop.color + contribution).saturated();
                    if P::ACTIVE {
                        let Arrival { stop, intensity, behind, f_s, .. } = *arrival;
                        let ToLight { direction, distance, n_dot_l, r_dot_l } =
                            Towards::of(&lighting.ways, stop as usize);
                        let sampled = self.source(light).is_sampled();
                        probe.light(&LightTerm {
                            light,
                            point,
                            sampled: if sampled { lighting.arriving[stop as usize].position } else { None },
                            direction: direction.as_vec3(),
                            distance,
                            intensity,
                            n_dot_l,
                            behind,
                            r_dot_l,
                            f_s,
                            diffuse,
                            specular,
                            contribution,
                        });
                    }
                }
            }
        }
        self.lighting = lighting;
    }

    /// The light where it is now.
    fn source(&self, light: u32) -> &Source {
        self.lights.get(light as usize).unwrap_or(&self.world.lights[light as usize])
    }

    /// One point of one light at a stop, before shadows; puts its shadow ray into the bundle.
    #[inline]
    fn arrival(&mut self, stop: usize, at: &Stop, lighting: &Lighting, light: u32, point: u32) -> Arrival {
        let source = self.source(light);
        let ToLight { direction, distance, n_dot_l, .. } = Towards::of(&lighting.ways, stop);
        let (position, intensity) = match lighting.arriving.get(stop) {
            Some(arriving) => (arriving.position, arriving.intensity),
            None => (source.point(point), source.along(direction, distance)),
        };
        // NaN, which isn't: a light exactly at the point, which adds nothing.
        let lit = n_dot_l > 0.0 && !intensity.is_black();
        let behind = lit && at.material.bent && at.facing().dot(direction) <= 0.0;
        let comes = lit && !behind;
        let mut shadow = NO_SHADOW;
        if comes && self.settings.stage >= Stage::Shadow && self.settings.shadows && source.light.shadows {
            let origin = lighting.starts[stop];
            // Towards a point the ray ends there, at t = 1; towards infinity it has no end.
            let (direction, t_max) = match position {
                Some(position) => (position - origin, 1.0 - f32::EPSILON),
                None => (direction.as_vec3(), f32::INFINITY),
            };
            shadow = self.bundle.len() as u32;
            self.bundle.push(Ray { origin, direction }, t_max);
        }
        let f_s = f32::from(u8::from(comes));
        Arrival { stop: stop as u32, shadow, comes, behind, n_dot_l, intensity, f_s, highlight: 0.0 }
    }

    /// f_s, the share of the light that passes what is between.
    #[inline]
    fn f_s<P: Probe>(&self, arrival: &Arrival, ways: &[Towards], generation: &Generation, probe: &mut P) -> f32 {
        match self.bundle.between(arrival.shadow as usize) {
            Between::Nothing => 1.0,
            // Only a recording probe wants to know what stands in which order.
            Between::Opaque if !P::ACTIVE => 0.0,
            between => {
                let (ray, t_max) = self.bundle.ray(arrival.shadow as usize);
                let ToLight { direction, distance, .. } = Towards::of(ways, arrival.stop as usize);
                let footprint = generation.footprints.get(arrival.stop as usize);
                let spread = footprint.map(|f| Spread::to_light(f.step, direction, f64::from(distance)));
                self.world.through(&ray, t_max, self.time, spread.as_ref(), between, probe)
            }
        }
    }
}

impl Arrival {
    /// The diffuse and the specular light, if f_s lets it arrive.
    #[inline]
    fn lit(&self, at: &Stop) -> [Rgb; 2] {
        if !self.comes {
            return [Rgb::BLACK; 2];
        }
        let diffuse = at.material.diffuse(self.intensity, self.n_dot_l); // (5.32b)
        let specular = (self.intensity * at.material.phong.ks).saturated() * self.highlight; // (5.38)
        [diffuse, specular]
    }
}
