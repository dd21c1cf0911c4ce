//! Batches of rays and the path state of each ray.

use crate::integrator::RayCounts;
use crate::integrator::media;
use crate::integrator::whitted::ray_state::{PathState, RayState};
use crate::math::{DRay, RayDifferential};
use crate::sampler::Sample;
use canaletto_bvh::Ray;

/// Rays that are traced together, as a structure of arrays.
#[derive(Default)]
pub(in crate::integrator::whitted) struct RayBatch {
    pub(super) rays: Vec<Ray>,
    pub(super) lines: Vec<DRay>,
    /// The time of each ray; empty if nothing moves.
    pub(in crate::integrator::whitted) times: Vec<f32>,
    /// Empty if all rays are camera rays.
    path_states: Vec<PathState>,
    samples: Vec<Sample>,
    /// Empty if nothing uses differentials.
    differentials: Vec<RayDifferential>,
    /// The bodies that each eye is in; empty if no eye is in a body.
    around: Vec<u32>,
}

impl RayBatch {
    pub(super) fn clear(&mut self) {
        let RayBatch { rays, lines, times, path_states, samples, differentials, around } = self;
        rays.clear();
        lines.clear();
        times.clear();
        path_states.clear();
        samples.clear();
        differentials.clear();
        around.clear();
    }

    pub(super) fn len(&self) -> usize {
        self.lines.len()
    }

    pub(in crate::integrator::whitted) fn is_empty(&self) -> bool {
        self.lines.is_empty()
    }

    /// Adds a child ray.
    #[inline]
    pub(in crate::integrator::whitted) fn push(
        &mut self,
        RayState { ray, line, path_state, sample, differential }: RayState,
    ) {
        self.rays.push(ray);
        self.lines.push(line);
        self.path_states.push(path_state);
        self.samples.push(sample);
        self.differentials.extend(differential);
    }

    /// Adds camera rays.
    #[inline]
    pub(super) fn push_camera_rays(
        &mut self,
        lines: &[DRay],
        samples: &[Sample],
        times: &[f32],
        differentials: impl IntoIterator<Item = RayDifferential>,
    ) {
        self.rays.extend(lines.iter().map(DRay::rounded));
        self.lines.extend_from_slice(lines);
        self.times.extend_from_slice(times);
        self.samples.extend_from_slice(samples);
        self.differentials.extend(differentials);
    }

    /// The time of a ray.
    #[inline]
    pub(super) fn time(&self, ray_index: usize) -> f32 {
        self.times.get(ray_index).copied().unwrap_or(0.0)
    }

    /// Sets the bodies that each eye is in to the results of `set`, which gets the ray's line and time.
    pub(super) fn set_around(&mut self, mut set: impl FnMut(&DRay, f32) -> u32) {
        let mut last = None;
        for (index, line) in self.lines.iter().enumerate() {
            let time = self.time(index);
            let around = match last {
                Some((eye, around)) if eye == (line.origin, time) => around,
                _ => set(line, time),
            };
            last = Some(((line.origin, time), around));
            if around != media::NONE {
                self.around.resize(index, media::NONE);
                self.around.push(around);
            }
        }
    }

    #[inline]
    pub(in crate::integrator::whitted) fn path_state(&self, ray_index: usize) -> PathState {
        let around = || self.around.get(ray_index).copied().unwrap_or(media::NONE);
        self.path_states.get(ray_index).copied().unwrap_or_else(|| PathState { inside: around(), ..PathState::EYE })
    }

    /// The bodies that a ray is in, and the first surface that it crosses at its origin.
    #[inline]
    pub(super) fn start_of(&self, ray_index: usize) -> [u32; 2] {
        let PathState { inside, first_crossing, .. } = self.path_state(ray_index);
        [inside, first_crossing]
    }

    #[inline]
    pub(super) fn sample(&self, ray_index: usize) -> &Sample {
        &self.samples[ray_index]
    }

    #[inline]
    pub(super) fn differential(&self, ray_index: usize) -> Option<&RayDifferential> {
        self.differentials.get(ray_index)
    }

    /// Counts the rays by kind, and as hits those that `stopped` lists.
    pub(super) fn count(&self, stopped: impl ExactSizeIterator<Item = usize>, counts: &mut RayCounts) {
        if self.path_states.is_empty() {
            counts.eye.traced += self.len() as u64;
            counts.eye.hit += stopped.len() as u64;
            return;
        }
        for path_state in &self.path_states {
            counts.of_mut(path_state.kind).traced += 1;
        }
        for ray_index in stopped {
            counts.of_mut(self.path_states[ray_index].kind).hit += 1;
        }
    }
}
