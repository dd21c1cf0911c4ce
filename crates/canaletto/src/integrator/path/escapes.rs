//! Scattered paths that leave the scene, eight at a time: the environment that they find, with its weight.

use super::PathTracer;
use super::event::power_heuristic;
use super::light_sampler::LightSampler;
use super::trace::{Path, ScatteredFrom};
use crate::light::environment::{EnvironmentDistribution, PreparedEnvironment};
use crate::math::{Rgb, Vector, saturated};
use crate::shape::{DVec3x8, Vec3x8, set_dvec3, set_vec3};
use canaletto_bvh::lanes::{LANES, LaneKernel, Mask, Real64, run_lanes};

/// Paths that leave the scene and wait until there are eight.
pub(super) struct Escapes {
    len: usize,
    /// The numbers of the paths.
    paths: [u32; LANES],
    /// The directions of the last rays, and their densities by scattering.
    direction: DVec3x8,
    pdf: [f64; LANES],
    /// The normals where they were scattered, and a bit for each place that light reaches from behind, too.
    normal: DVec3x8,
    two_sided: u32,
    /// The probabilities that the environment was chosen there, and the totals of its weights.
    probability: [f64; LANES],
    total: [f64; LANES],
    throughput: Vec3x8,
    light: Vec3x8,
}

impl Default for Escapes {
    fn default() -> Escapes {
        let none = [[0.0; LANES]; 3];
        Escapes {
            len: 0,
            paths: [0; LANES],
            direction: none,
            pdf: [1.0; LANES],
            normal: none,
            two_sided: 0,
            probability: [0.0; LANES],
            total: [1.0; LANES],
            throughput: [[0.0; LANES]; 3],
            light: [[0.0; LANES]; 3],
        }
    }
}

impl PathTracer<'_> {
    /// Ends a path whose ray hits nothing, if it is one of those that are ended eight at a time. Its light is known
    /// after [`PathTracer::end_escapes`].
    #[inline]
    pub(super) fn push_escape(&mut self, escapes: &mut Escapes, number: u32, paths: &mut [Path]) -> bool {
        let path = &paths[number as usize];
        let Some(ScatteredFrom { receiver, choice, pdf }) = path.scattered_straight() else { return false };
        if self.world.environment.is_none() || self.lights.environment.is_none() {
            return false;
        }
        let lane = escapes.len;
        escapes.len += 1;
        escapes.paths[lane] = number;
        set_dvec3(&mut escapes.direction, lane, path.line().direction);
        set_dvec3(&mut escapes.normal, lane, receiver.normal);
        escapes.two_sided |= u32::from(receiver.two_sided) << lane;
        (escapes.probability[lane], escapes.total[lane]) = choice.environment();
        escapes.pdf[lane] = *pdf;
        set_vec3(&mut escapes.throughput, lane, path.throughput.to_array().into());
        set_vec3(&mut escapes.light, lane, path.light.to_array().into());
        self.count_miss(path);
        if escapes.len == LANES {
            self.end_escapes(escapes, paths);
        }
        true
    }

    /// Adds the environment's light to the paths that wait.
    pub(super) fn end_escapes(&self, escapes: &mut Escapes, paths: &mut [Path]) {
        let LightSampler { environment: Some(distribution), .. } = self.lights else { return };
        let Some(environment) = &self.world.environment else { return };
        if escapes.len == 0 {
            return;
        }
        run_lanes(FindEnvironment { environment, distribution, escapes });
        for (lane, number) in escapes.paths[..escapes.len].iter().enumerate() {
            paths[*number as usize].light = Rgb::from(escapes.light.each_ref().map(|row| row[lane]));
        }
        (escapes.len, escapes.two_sided) = (0, 0);
    }
}

/// Adds the environment's light to eight paths.
struct FindEnvironment<'a> {
    environment: &'a PreparedEnvironment,
    distribution: &'a EnvironmentDistribution,
    escapes: &'a mut Escapes,
}

impl LaneKernel for FindEnvironment<'_> {
    type Answer = ();

    #[inline(always)]
    fn run<F: Real64>(self) {
        let FindEnvironment { environment, distribution, escapes } = self;
        let direction = Vector::<F>::load(&escapes.direction).normalized();
        let (radiance, place) = environment.radiances_and_places(direction);
        let surface = (Vector::load(&escapes.normal), F::Mask::from_bits(escapes.two_sided));
        let pdf = distribution.pdfs(surface, F::load(&escapes.total), direction, place);
        let weight = power_heuristic(F::load(&escapes.pdf), pdf * F::load(&escapes.probability));
        let throughput = Vector::<F::Narrow>::load(&escapes.throughput);
        let found = radiance * weight;
        let arriving = Vector { x: throughput.x * found.x, y: throughput.y * found.y, z: throughput.z * found.z };
        let light = Vector::load(&escapes.light) + arriving.map(saturated);
        light.store(&mut escapes.light);
    }
}
