//! Measurements of light at points of space, as a light meter takes them.

use super::RadiositySolution;
use super::sources::{LitPlace, environment};
use crate::integrator::Measurement;
use crate::math::{DRay, offset_origin, rounding, warp};
use crate::sampler::{Dimension, FrameSampler};
use crate::scene::SamplerKind;
use crate::world::{OccluderCache, World};
use canaletto_bvh::Ray;
use glam::{DVec3, Vec3};
use std::f64::consts::PI;

/// The number of independent sets of rays, whose spread tells the error.
const SETS: u32 = 16;

/// The most surfaces that let light through along one ray.
const MAX_CLEAR: usize = 64;

impl RadiositySolution {
    /// Measures the irradiance at a point of the world, facing along a unit normal. Lights without a surface are found
    /// exactly. About `rays` rays find the light of surfaces and of the environment. Each measurement of a seed should
    /// have a number of its own.
    pub fn measure(
        &self,
        world: &World,
        (point, normal): (DVec3, DVec3),
        rays: u32,
        (seed, number): (u64, u32),
    ) -> Measurement {
        let near = point.as_vec3();
        // A point on a surface sees what lies before it.
        let origin = offset_origin(near, rounding(near) * 4.0, normal, normal);
        let lights = LitPlace { point, origin, normal }.lit(world, &mut vec![OccluderCache::NONE; world.lights.len()]);
        let (x, y) = normal.any_orthonormal_pair();
        let each = rays.div_ceil(SETS).max(1);
        let sampler = FrameSampler::new(seed, 0, SamplerKind::Sobol);
        let found = Measurement::of_sets((0..SETS).map(|set| {
            let numbers = sampler.pixel([number, set]);
            let mut mean = DVec3::ZERO;
            for index in 0..each {
                let p = warp::cosine_hemisphere(numbers.sample(index, each).two(Dimension::EYE));
                let direction = x * p.x + y * p.y + normal * p.z;
                mean += self.radiance_along(world, origin, direction, [x, y]);
            }
            mean / f64::from(each)
        }));
        Measurement { irradiance: found.irradiance + lights * PI, ..found }
    }

    /// The radiance that arrives along a ray: of the patches that it meets, or of the environment.
    fn radiance_along(&self, world: &World, origin: Vec3, direction: DVec3, across: [DVec3; 2]) -> DVec3 {
        let (mut line, mut ray) =
            (DRay { origin: origin.as_dvec3(), direction }, Ray::new(origin, direction.as_vec3()));
        let (mut sum, mut share) = (DVec3::ZERO, 1.0);
        for _ in 0..MAX_CLEAR {
            let Some(hit) = world.intersect(&ray, f32::INFINITY) else {
                return sum + environment(world, direction, across[0], across[1]) * share;
            };
            let surface = world.surface(line, &hit);
            let outside = direction.dot(surface.normal) < 0.0;
            let opacity = f64::from(world.opacity_at(line, &hit, None));
            let patch = self.patch_at(hit.instance, hit.primitive, hit.part, outside, surface.exact);
            let light = self.light_at(hit.instance, hit.primitive, hit.part, outside, surface.exact);
            if let (Some(patch), Some(light)) = (patch, light) {
                let patch = &self.patches()[patch];
                let radiance = patch.emission + patch.reflectance * light.sum();
                sum += radiance * (share * opacity);
            }
            share *= 1.0 - opacity;
            if share <= 0.0 {
                break;
            }
            line.origin = surface.exact;
            ray = line.from_origin(offset_origin(surface.point, surface.error, surface.normal, direction));
        }
        sum
    }
}
