//! Measurements of light at points of space, as a light meter takes them.
//!
//! Rays of three kinds find the light. Some are distributed by the cosine and find all of it. Others lead to emitting
//! surfaces, and others to bright parts of the environment. What two kinds can find is weighted by their densities (the
//! balance heuristic; Veach and Guibas 1995), so that no light counts twice.
//!
//! The standard error has two parts: the spread of independent sets of rays, and a bound for light that so few rays
//! find that their spread tells nothing. No success in n trials leaves room for a probability of 3 / n (Hanley and
//! Lippman-Hand 1983).

use super::RadiositySolution;
use super::exchange::BEFORE_END;
use super::outline::Outline;
use super::sources::{LitPlace, environment_and_place};
use crate::form_factor::point_to_polygon;
use crate::integrator::Measurement;
use crate::light::environment::{BlockWeights, EnvironmentDistribution};
use crate::math::{DRay, offset_origin, rounding, warp};
use crate::sampler::{Dimension, FrameSampler, Sample};
use crate::scene::SamplerKind;
use crate::world::{OccluderCache, World};
use canaletto_bvh::Ray;
use glam::{DVec3, Vec3};
use std::f64::consts::PI;

/// The number of independent sets of rays, whose spread tells the error.
const SETS: u32 = 16;

/// Two standard errors of so few sets cover as much as 2.18 times their spread (Student 1908, 15 degrees of freedom).
const FEW_SETS: f64 = 1.09;

/// The standard error of what no ray of n finds, relative to what each would find, times n.
const UNFOUND: f64 = 1.75;

/// The same as a share of all light that these rays may miss.
const UNFOUND_SHARE: f64 = 0.75;

/// The most lamps that rays from one point lead to. Others are found by chance.
const MOST_LAMPS: usize = 256;

/// Lamps have rays of their own if the light of one random ray varies by more than this times its square.
const RARE: f64 = 1.0;

/// The most surfaces that let light through along one ray.
const MAX_CLEAR: usize = 64;

/// A light meter in a world whose light is solved.
pub struct RadiosityMeter<'a> {
    world: &'a World,
    solution: &'a RadiositySolution,
    lamps: Vec<Lamp>,
    /// The numbers of patches by the radiance that random rays alone find, the brightest first.
    brightest: Vec<(u32, DVec3)>,
    environment: Option<EnvironmentDistribution>,
}

/// An emitting polygon that rays lead to.
struct Lamp {
    outline: Outline,
    normal: DVec3,
    /// The vectors whose products with a way from the first corner are coordinates in the outline.
    dual: [DVec3; 2],
    area: f64,
    radiance: DVec3,
}

impl Lamp {
    fn new(outline: Outline, normal: DVec3, radiance: DVec3) -> Lamp {
        let [u, v] = [outline.point(1.0, 0.0), outline.point(0.0, 1.0)].map(|end| end - outline.point(0.0, 0.0));
        let cross = u.cross(v);
        let dual = [v.cross(cross), cross.cross(u)].map(|dual| dual / cross.length_squared());
        Lamp { outline, normal, dual, area: outline.area(), radiance }
    }

    /// The density of a direction from a point that area makes of uniform points: 0 if it misses.
    fn density(&self, from: DVec3, direction: DVec3) -> f64 {
        let corner = self.outline.point(0.0, 0.0);
        let cosine = -self.normal.dot(direction);
        let distance = self.normal.dot(from - corner) / cosine;
        let is_before = cosine > 0.0 && distance > 0.0;
        if !is_before {
            return 0.0;
        }
        let way = from + direction * distance - corner;
        let [u, v] = self.dual.map(|dual| dual.dot(way));
        let is_quad = self.outline.corners().len() == 4;
        let is_within = u >= 0.0 && v >= 0.0 && if is_quad { u <= 1.0 && v <= 1.0 } else { u + v <= 1.0 };
        if is_within { distance * distance / (cosine * self.area) } else { 0.0 }
    }

    fn point(&self, [u, v]: [f64; 2]) -> DVec3 {
        if self.outline.corners().len() == 4 {
            return self.outline.point(u, v);
        }
        let root = u.sqrt();
        self.outline.point(1.0 - root, v * root)
    }
}

/// The light that arrives along a ray.
#[derive(Clone, Copy, Default)]
struct Along {
    emitted: DVec3,
    reflected: DVec3,
    /// What passes to the environment.
    open: f64,
}

/// A place of a meter with the rays that it needs.
struct Place<'m> {
    point: DVec3,
    normal: DVec3,
    origin: Vec3,
    across: [DVec3; 2],
    /// Lamps with the sums of the probabilities of those up to each.
    lamps: Vec<(&'m Lamp, f64)>,
    /// The light of these lamps if nothing hides them.
    of_lamps: DVec3,
    weights: Option<BlockWeights>,
    /// The numbers of rays in a set: by the cosine, to lamps, to the environment.
    rays: [u32; 3],
}

impl<'a> RadiosityMeter<'a> {
    /// A meter in the world of a solution.
    pub fn new(world: &'a World, solution: &'a RadiositySolution) -> RadiosityMeter<'a> {
        let of_polygons = solution.emitters.excess == 0;
        let lamps: Vec<Lamp> = if of_polygons {
            let lamp = |of: &super::emitters::Emitter| Lamp::new(of.root.outline, of.root.normal, of.radiance);
            solution.emitters.polygons.iter().map(lamp).collect()
        } else {
            let patches = solution.patches.iter().zip(&solution.outlines);
            let emits = patches.filter(|(patch, _)| patch.emission != DVec3::ZERO && patch.area > 0.0);
            emits.map(|(patch, outline)| Lamp::new(*outline, patch.normal, patch.emission)).collect()
        };
        let of_patch = |(number, patch): (u32, &super::Patch)| {
            let found_by_chance = if of_polygons { DVec3::ZERO } else { patch.emission };
            (number, patch.reflectance * patch.arriving().sum() + found_by_chance)
        };
        let mut brightest: Vec<(u32, DVec3)> = (0..).zip(&solution.patches).map(of_patch).collect();
        brightest.retain(|(_, radiance)| *radiance != DVec3::ZERO);
        brightest.sort_by(|a, b| b.1.element_sum().total_cmp(&a.1.element_sum()).then(a.0.cmp(&b.0)));
        let environment = world.environment.as_ref().and_then(EnvironmentDistribution::new);
        RadiosityMeter { world, solution, lamps, brightest, environment }
    }

    /// The number of patches of the solution.
    pub fn patches(&self) -> usize {
        self.solution.patches.len()
    }

    /// Measures the irradiance at a point of the world, facing along a unit normal. Lights without a surface are found
    /// exactly. About `rays` rays find the light of surfaces and of the environment. Each measurement of a seed should
    /// have a number of its own.
    pub fn measure(&self, (point, normal): (DVec3, DVec3), rays: u32, (seed, number): (u64, u32)) -> Measurement {
        let place = self.place(point, normal, rays.div_ceil(SETS).max(1));
        let Place { origin, rays, .. } = place;
        let mut last = vec![OccluderCache::NONE; self.world.lights.len()];
        let lights = LitPlace { point, origin, normal }.lit(self.world, &mut last);
        let sampler = FrameSampler::new(seed, 0, SamplerKind::Sobol);
        let found = Measurement::of_sets((0..SETS).map(|set| {
            let numbers = sampler.pixel([number, set]);
            let of = |kind: usize, found: &dyn Fn(Sample) -> DVec3| {
                (0..rays[kind]).map(|index| found(numbers.sample(index, rays[kind]))).sum::<DVec3>()
            };
            of(0, &|sample| self.by_chance(&place, sample))
                + of(1, &|sample| self.to_lamps(&place, sample))
                + of(2, &|sample| self.to_environment(&place, sample))
        }));
        let spread = found.standard_error * FEW_SETS;
        let unfound = self.unfound(&place) * PI;
        let standard_error = (spread * spread + unfound * unfound).map(f64::sqrt);
        Measurement { irradiance: found.irradiance + lights * PI, standard_error }
    }

    fn place(&self, point: DVec3, normal: DVec3, rays: u32) -> Place<'_> {
        let near = point.as_vec3();
        // A point on a surface sees what lies before it.
        let origin = offset_origin(near, rounding(near) * 4.0, normal, normal);
        let mut lamps: Vec<(&Lamp, f64)> = Vec::new();
        let (mut mean, mut square) = (DVec3::ZERO, DVec3::ZERO);
        for lamp in &self.lamps {
            if (point - lamp.outline.center()).dot(lamp.normal) <= 0.0 {
                continue;
            }
            let factor = point_to_polygon(point, normal, lamp.outline.corners());
            if factor > 0.0 {
                lamps.push((lamp, factor));
                mean += lamp.radiance * factor;
                square += lamp.radiance * lamp.radiance * factor;
            }
        }
        let is_rare = (square - mean * mean).cmpgt(mean * mean * RARE).any();
        if !is_rare {
            lamps.clear();
        }
        let light = |&(lamp, factor): &(&Lamp, f64)| lamp.radiance * factor;
        lamps.sort_by(|a, b| light(b).element_sum().total_cmp(&light(a).element_sum()));
        lamps.truncate(MOST_LAMPS);
        let of_lamps: DVec3 = lamps.iter().map(light).sum();
        let all = of_lamps.element_sum();
        let mut sum = 0.0;
        for of in &mut lamps {
            sum += light(of).element_sum() / all;
            of.1 = sum;
        }
        let weights = self.environment.as_ref().map(|environment| environment.weights(normal, false));
        let weights = weights.filter(|weights| weights.total() > 0.0);
        let kinds = [true, !lamps.is_empty(), weights.is_some()];
        let each = rays.div_ceil(kinds.iter().filter(|&&kind| kind).count() as u32);
        let (x, y) = normal.any_orthonormal_pair();
        let rays = kinds.map(|kind| if kind { each } else { 0 });
        Place { point, normal, origin, across: [x, y], lamps, of_lamps, weights, rays }
    }

    /// What a ray finds that is distributed by the cosine, as a part of its set's mean.
    fn by_chance(&self, place: &Place, sample: Sample) -> DVec3 {
        let p = warp::cosine_hemisphere(sample.two(Dimension::EYE));
        let [x, y] = place.across;
        let direction = x * p.x + y * p.y + place.normal * p.z;
        let along = self.along(place, direction);
        let by_chance = p.z / PI * f64::from(place.rays[0]);
        let mut sum = along.reflected / f64::from(place.rays[0]);
        if along.emitted != DVec3::ZERO {
            sum += along.emitted * (p.z / PI / (by_chance + place.lamp_rays(direction)));
        }
        if along.open > 0.0 {
            let (radiance, to_environment) = self.sky(place, direction);
            sum += radiance * (along.open * p.z / PI / (by_chance + to_environment));
        }
        sum
    }

    /// What a ray to a lamp finds of emitted light.
    fn to_lamps(&self, place: &Place, sample: Sample) -> DVec3 {
        let (which, within) = sample.one_and_two(Dimension::EYE.of(1));
        let number = place.lamps.partition_point(|(_, up_to)| *up_to <= which).min(place.lamps.len() - 1);
        let Some(direction) = (place.lamps[number].0.point(within) - place.point).try_normalize() else {
            return DVec3::ZERO;
        };
        let cosine = direction.dot(place.normal);
        if cosine <= 0.0 {
            return DVec3::ZERO;
        }
        let by_chance = cosine / PI * f64::from(place.rays[0]);
        self.along(place, direction).emitted * (cosine / PI / (by_chance + place.lamp_rays(direction)))
    }

    /// What a ray to the environment finds of its light.
    fn to_environment(&self, place: &Place, sample: Sample) -> DVec3 {
        let Some((environment, weights)) = self.environment.as_ref().zip(place.weights.as_ref()) else {
            return DVec3::ZERO;
        };
        let direction = environment.sample(weights, sample.two(Dimension::EYE.of(2))).wi;
        let cosine = direction.dot(place.normal);
        if cosine <= 0.0 {
            return DVec3::ZERO;
        }
        let open = self.along(place, direction).open;
        if open <= 0.0 {
            return DVec3::ZERO;
        }
        let by_chance = cosine / PI * f64::from(place.rays[0]);
        let (radiance, to_environment) = self.sky(place, direction);
        radiance * (open * cosine / PI / (by_chance + to_environment))
    }

    /// The radiance of the environment, and the density of the rays to it times their number.
    fn sky(&self, place: &Place, direction: DVec3) -> (DVec3, f64) {
        let (radiance, uv) = environment_and_place(self.world, direction, place.across);
        let density = self.environment.as_ref().zip(place.weights.as_ref()).map_or(0.0, |(environment, weights)| {
            environment.pdf((place.normal, false), weights.total(), direction, uv)
        });
        (radiance, density * f64::from(place.rays[2]))
    }

    /// The standard error of light that few rays find, as the radiance of a white surface.
    fn unfound(&self, place: &Place) -> DVec3 {
        let all = place.rays.map(|rays| f64::from(rays * SETS));
        let mut sum = DVec3::ZERO;
        if all[1] > 0.0 {
            sum += place.of_lamps * (UNFOUND / all[1]);
        }
        if let Some((environment, weights)) = self.environment.as_ref().zip(place.weights.as_ref()) {
            sum += DVec3::splat(environment.arriving(weights) / (3.0 * PI) * (UNFOUND / all[2]));
        }
        // The brightest patches that only about 2 UNFOUND of all rays would meet.
        let mut left = 2.0 * UNFOUND / all[0];
        let mut last = OccluderCache::NONE;
        let mut traced = 0.0;
        for &(number, radiance) in &self.brightest {
            let patch = &self.solution.patches[number as usize];
            let way = patch.center - place.point;
            let cosines = [place.normal.dot(way), -patch.normal.dot(way)];
            let is_before = cosines[0] > 0.0 && cosines[1] > 0.0;
            if !is_before {
                continue;
            }
            let square = way.length_squared();
            let factor = cosines[0] * cosines[1] / square * patch.area / (PI * square + patch.area);
            if factor < left * 1e-6 {
                continue;
            }
            // Four cells of an outline lie in its quarters. Of a small patch one is asked.
            let cells = if factor > left / 16.0 { 0..4 } else { number % 4..number % 4 + 1 };
            let asked = f64::from(cells.end - cells.start);
            let passed = cells.map(|cell| {
                let outline = &self.solution.outlines[number as usize];
                let end = outline.cell(cell as usize) + patch.normal * (way.length() * 1e-3);
                let ray = Ray::new(place.origin, end.as_vec3() - place.origin);
                f64::from(self.world.transmittance(&ray, BEFORE_END, 0.0, None, &mut last, &mut ()))
            });
            let factor = factor * passed.sum::<f64>() / asked;
            traced += asked;
            // Patches beyond the last one asked are no brighter than it.
            let part = if traced > all[0] { left } else { factor.min(left) };
            sum += radiance * (UNFOUND_SHARE * part);
            left -= part;
            if left <= 0.0 {
                break;
            }
        }
        sum
    }

    /// The light that arrives along a direction.
    fn along(&self, place: &Place, direction: DVec3) -> Along {
        let (mut line, mut ray) =
            (DRay { origin: place.origin.as_dvec3(), direction }, Ray::new(place.origin, direction.as_vec3()));
        let mut along = Along { open: 1.0, ..Along::default() };
        for _ in 0..MAX_CLEAR {
            let Some(hit) = self.world.intersect(&ray, f32::INFINITY) else { return along };
            let surface = self.world.surface(line, &hit);
            let outside = direction.dot(surface.normal) < 0.0;
            let opacity = f64::from(self.world.opacity_at(line, &hit, None));
            let solution = self.solution;
            let at = (hit.instance, hit.primitive, hit.part, outside);
            let patch = solution.patch_at(at.0, at.1, at.2, at.3, surface.exact);
            let light = solution.light_at(at.0, at.1, at.2, at.3, surface.exact);
            if let (Some(patch), Some(light)) = (patch, light) {
                let patch = &solution.patches()[patch];
                along.emitted += patch.emission * (along.open * opacity);
                along.reflected += patch.reflectance * light.sum() * (along.open * opacity);
            }
            along.open *= 1.0 - opacity;
            if along.open <= 0.0 {
                return along;
            }
            line.origin = surface.exact;
            ray = line.from_origin(offset_origin(surface.point, surface.error, surface.normal, direction));
        }
        Along { open: 0.0, ..along }
    }
}

impl Place<'_> {
    /// The density of the rays to lamps in a direction, times their number.
    fn lamp_rays(&self, direction: DVec3) -> f64 {
        let (mut before, mut density) = (0.0, 0.0);
        for (lamp, up_to) in &self.lamps {
            density += lamp.density(self.point, direction) * (up_to - before);
            before = *up_to;
        }
        density * f64::from(self.rays[1])
    }
}

#[cfg(test)]
mod tests;
