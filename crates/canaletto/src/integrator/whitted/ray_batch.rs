//! Rays on their way.

use super::media;
use crate::integrator::{RayCounts, RayKind};
use crate::math::{DRay, RayDifferential, Rgb};
use crate::sampler::{Dimension, Sample};
use canaletto_bvh::Ray;

/// Uses of random numbers at a hit.
pub(super) mod uses {
    /// The facets of rough surfaces, and the rays from there.
    pub(in super::super) const MIRROR_FACET: u32 = 1;
    pub(in super::super) const CLEAR_FACET: u32 = 2;
    pub(in super::super) const REFLECTED: u32 = 3;
    pub(in super::super) const REFRACTED: u32 = 4;
    pub(in super::super) const PASSED: u32 = 5;
    pub(in super::super) const EYE: u32 = 6;
    /// The first light; each has a use of its own.
    pub(in super::super) const LIGHTS: u32 = 8;
}

/// A ray to be traced.
pub(super) struct RayState {
    pub(super) ray: Ray,
    /// The ray before it was rounded and moved off the surface that it left.
    pub(super) line: DRay,
    pub(super) path_state: PathState,
    /// Where random numbers come from.
    pub(super) sample: Sample,
    /// How it spreads, if anything wants to know.
    pub(super) differential: Option<RayDifferential>,
}

/// Rays to be traced together, side by side.
#[derive(Default)]
pub(super) struct RayBatch {
    pub(super) rays: Vec<Ray>,
    pub(super) lines: Vec<DRay>,
    /// None if all of them come from the eye.
    path_states: Vec<PathState>,
    samples: Vec<Sample>,
    /// None if nothing wants to know.
    differentials: Vec<RayDifferential>,
    /// The bodies that the eye is in; none if it is in none.
    around: Vec<u32>,
}

impl RayBatch {
    pub(super) fn clear(&mut self) {
        let RayBatch { rays, lines, path_states, samples, differentials, around } = self;
        rays.clear();
        lines.clear();
        path_states.clear();
        samples.clear();
        differentials.clear();
        around.clear();
    }

    pub(super) fn len(&self) -> usize {
        self.lines.len()
    }

    pub(super) fn is_empty(&self) -> bool {
        self.lines.is_empty()
    }

    /// Adds a child ray.
    #[inline]
    pub(super) fn push(&mut self, RayState { ray, line, path_state, sample, differential }: RayState) {
        self.rays.push(ray);
        self.lines.push(line);
        self.path_states.push(path_state);
        self.samples.push(sample);
        self.differentials.extend(differential);
    }

    /// Adds rays from the eye.
    #[inline]
    pub(super) fn push_camera_rays(
        &mut self,
        lines: &[DRay],
        samples: &[Sample],
        differentials: impl IntoIterator<Item = RayDifferential>,
    ) {
        self.rays.extend(lines.iter().map(DRay::rounded));
        self.lines.extend_from_slice(lines);
        self.samples.extend_from_slice(samples);
        self.differentials.extend(differentials);
    }

    /// Takes the bodies that each eye is in, as `set` says.
    pub(super) fn set_around(&mut self, mut set: impl FnMut(&DRay) -> u32) {
        let mut last = None;
        for (index, line) in self.lines.iter().enumerate() {
            let around = match last {
                Some((origin, around)) if origin == line.origin => around,
                _ => set(line),
            };
            last = Some((line.origin, around));
            if around != media::NONE {
                self.around.resize(index, media::NONE);
                self.around.push(around);
            }
        }
    }

    #[inline]
    pub(super) fn path_state(&self, way: usize) -> PathState {
        let around = || self.around.get(way).copied().unwrap_or(media::NONE);
        self.path_states.get(way).copied().unwrap_or_else(|| PathState { inside: around(), ..PathState::EYE })
    }

    /// The bodies that a ray is in, and the surface where it starts that it meets first.
    #[inline]
    pub(super) fn start_of(&self, way: usize) -> [u32; 2] {
        let PathState { inside, meets, .. } = self.path_state(way);
        [inside, meets]
    }

    #[inline]
    pub(super) fn sample(&self, way: usize) -> &Sample {
        &self.samples[way]
    }

    #[inline]
    pub(super) fn differential(&self, way: usize) -> Option<&RayDifferential> {
        self.differentials.get(way)
    }

    /// Counts the rays by kind, and those that stopped.
    pub(super) fn count(&self, stopped: impl ExactSizeIterator<Item = usize>, counts: &mut RayCounts) {
        if self.path_states.is_empty() {
            counts.eye.traced += self.len() as u64;
            counts.eye.hit += stopped.len() as u64;
            return;
        }
        for path_state in &self.path_states {
            counts.of_mut(path_state.kind).traced += 1;
        }
        for way in stopped {
            counts.of_mut(self.path_states[way].kind).hit += 1;
        }
    }
}

/// Where a ray stands in the ray tree.
#[derive(Clone, Copy)]
pub(super) struct PathState {
    pub(super) kind: RayKind,
    pub(super) depth: u32,
    /// What the ray's colour is multiplied with in its parent.
    pub(super) attenuation: Rgb,
    /// The product of all factors from the eye.
    pub(super) throughput: Rgb,
    /// How often it went on past a surface that is there in part.
    pub(super) passed: u32,
    /// What keeps random numbers here apart from those elsewhere in the tree.
    pub(super) place: Dimension,
    /// The bodies that it is in.
    pub(super) inside: u32,
    /// The surface where it starts that it meets before any other.
    pub(super) meets: u32,
}

impl PathState {
    /// A ray from the eye's.
    pub(super) const EYE: PathState = PathState {
        kind: RayKind::Eye,
        depth: 1,
        attenuation: Rgb::WHITE,
        throughput: Rgb::WHITE,
        passed: 0,
        place: Dimension::EYE.of(uses::EYE),
        inside: media::NONE,
        meets: media::NONE,
    };
}
