//! The light that reaches stops: (5.39a).

use super::way::{Stop, Way, uses};
use super::{Generation, Whitted};
use crate::integrator::{LightTerm, Probe};
use crate::light::Illumination;
use crate::math::{Rgb, Spread, offset_origin};
use crate::scene::Stage;
use crate::world::Between;
use canaletto_bvh::Ray;

/// What a point of a light brings to a stop, if nothing stands between.
pub(super) struct Arrival {
    /// The stop.
    stop: u32,
    /// Whether it comes at all, before shadows.
    comes: bool,
    behind: bool,
    arriving: Illumination,
    n_dot_l: f32,
    r_dot_l: f32,
    /// The shadow ray and its end, if there is one.
    shadow: Option<(Ray, f32)>,
}

impl Whitted<'_> {
    /// Adds the light of all lights, one point after the other.
    pub(super) fn light<P: Probe>(&mut self, generation: &mut Generation, probe: &mut P) {
        for light in 0..self.world.lights.len() as u32 {
            for point in 0..self.world.lights[light as usize].points() {
                generation.arrivals.clear();
                self.bundle.clear();
                for (index, stop) in generation.stops.iter().enumerate().filter(|(_, stop)| stop.is_seen()) {
                    let arrival = self.arrival(index, stop, &generation.ways[stop.way as usize], light, point);
                    if let Some((ray, t_max)) = arrival.shadow {
                        self.bundle.push(ray, t_max);
                    }
                    if P::ACTIVE || arrival.comes {
                        generation.arrivals.push(arrival);
                    }
                }
                self.world.between_bundle(&mut self.bundle, self.time, &mut self.blockers[light as usize]);
                let mut shadows = 0;
                for arrival in &generation.arrivals {
                    let mut f_s = f32::from(u8::from(arrival.comes));
                    if let Some(shadow) = &arrival.shadow {
                        f_s = self.f_s(arrival, shadow, self.bundle.between(shadows), generation, probe);
                        self.counts.shadow.traced += 1;
                        self.counts.shadow.hit += u64::from(f_s == 0.0);
                        shadows += 1;
                    }
                    let stop = &mut generation.stops[arrival.stop as usize];
                    let [diffuse, specular] = self.lit::<P>(stop, arrival, f_s);
                    let contribution = (diffuse + specular).saturated() * f_s; // (5.39a)
                    stop.color = (stop.color + contribution).saturated();
                    if P::ACTIVE {
                        let Arrival { arriving, n_dot_l, r_dot_l, behind, .. } = *arrival;
                        let sampled = self.source(light).is_sampled();
                        probe.light(&LightTerm {
                            light,
                            point,
                            sampled: if sampled { arriving.position } else { None },
                            direction: arriving.direction.as_vec3(),
                            distance: arriving.distance,
                            intensity: arriving.intensity,
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
    }

    /// The light where it is now.
    fn source(&self, light: u32) -> &crate::light::Source {
        self.lights.get(light as usize).unwrap_or(&self.world.lights[light as usize])
    }

    /// One point of one light at a stop, before shadows.
    #[inline]
    fn arrival(&self, stop: usize, at: &Stop, way: &Way, light: u32, point: u32) -> Arrival {
        let source = self.source(light);
        let arriving = if source.is_sampled() {
            let u = way.sample.two_of(way.branch.place.of(uses::LIGHTS + light), point, source.points());
            source.sample(u, at.surface.exact)
        } else {
            source.illuminate(point, at.surface.exact)
        };
        let n_dot_l = at.normal.dot(arriving.direction) as f32;
        let r_dot_l = at.mirrored.dot(arriving.direction) as f32;
        // NaN, which isn't: a light exactly at the point, which adds nothing.
        let lit = n_dot_l > 0.0 && !arriving.intensity.is_black();
        let behind = lit && at.material.bent && at.facing.dot(arriving.direction) <= 0.0;
        let comes = lit && !behind;
        let mut shadow = None;
        if comes && self.settings.stage >= Stage::Shadow && self.settings.shadows && source.light.shadows {
            let start = if at.outside { at.surface.lifted } else { at.surface.point };
            let origin = offset_origin(start, at.surface.error, at.facing, at.facing);
            // Towards a point the ray ends there, at t = 1; towards infinity it has no end.
            let (direction, t_max) = match arriving.position {
                Some(position) => (position - origin, 1.0 - f32::EPSILON),
                None => (arriving.direction.as_vec3(), f32::INFINITY),
            };
            shadow = Some((Ray { origin, direction }, t_max));
        }
        Arrival { stop: stop as u32, comes, behind, arriving, n_dot_l, r_dot_l, shadow }
    }

    /// f_s, the share of the light that passes.
    #[inline]
    fn f_s<P: Probe>(
        &self,
        arrival: &Arrival,
        (ray, t_max): &(Ray, f32),
        between: Between,
        generation: &Generation,
        probe: &mut P,
    ) -> f32 {
        match between {
            Between::Nothing => 1.0,
            // Only a recording probe wants to know what stands in which order.
            Between::Opaque if !P::ACTIVE => 0.0,
            _ => {
                let Illumination { direction, distance, .. } = arrival.arriving;
                let footprint = generation.footprints.get(arrival.stop as usize);
                let spread = footprint.map(|f| Spread::to_light(f.step, direction, f64::from(distance)));
                self.world.through(ray, *t_max, self.time, spread.as_ref(), between, probe)
            }
        }
    }

    /// The diffuse and the specular light, if f_s lets it arrive.
    #[inline]
    fn lit<P: Probe>(&self, at: &Stop, arrival: &Arrival, f_s: f32) -> [Rgb; 2] {
        let (phong, intensity) = (&at.material.phong, arrival.arriving.intensity);
        if !arrival.comes {
            return [Rgb::BLACK; 2];
        }
        let diffuse = at.material.diffuse(intensity, arrival.n_dot_l); // (5.32b)
        // In shadow a highlight is black, and only a probe wants to know more.
        let highlight = (P::ACTIVE || f_s > 0.0) && self.settings.stage >= Stage::Specular && !phong.ks.is_black();
        let specular = if highlight {
            (intensity * phong.ks).saturated() * phong.highlight(arrival.r_dot_l) // (5.38)
        } else {
            Rgb::BLACK
        };
        [diffuse, specular]
    }
}
