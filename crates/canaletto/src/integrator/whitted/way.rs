//! Rays on their way.

use super::media;
use crate::integrator::{RayCounts, RayKind};
use crate::math::{Line, Rgb, Spread};
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
pub(super) struct Way {
    pub(super) ray: Ray,
    /// The ray before it was rounded and moved off the surface that it left.
    pub(super) line: Line,
    pub(super) branch: Branch,
    /// Where random numbers come from.
    pub(super) sample: Sample,
    /// How it spreads, if anything wants to know.
    pub(super) spread: Option<Spread>,
}

/// Rays to be traced together, side by side.
#[derive(Default)]
pub(super) struct Ways {
    pub(super) rays: Vec<Ray>,
    pub(super) lines: Vec<Line>,
    /// None if all of them come from the eye.
    branches: Vec<Branch>,
    samples: Vec<Sample>,
    /// None if nothing wants to know.
    spreads: Vec<Spread>,
    /// The bodies that the eye is in; none if it is in none.
    around: Vec<u32>,
}

impl Ways {
    pub(super) fn clear(&mut self) {
        let Ways { rays, lines, branches, samples, spreads, around } = self;
        rays.clear();
        lines.clear();
        branches.clear();
        samples.clear();
        spreads.clear();
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
    pub(super) fn push(&mut self, Way { ray, line, branch, sample, spread }: Way) {
        self.rays.push(ray);
        self.lines.push(line);
        self.branches.push(branch);
        self.samples.push(sample);
        self.spreads.extend(spread);
    }

    /// Adds rays from the eye.
    #[inline]
    pub(super) fn push_eyes(&mut self, lines: &[Line], samples: &[Sample], spreads: impl IntoIterator<Item = Spread>) {
        self.rays.extend(lines.iter().map(Line::rounded));
        self.lines.extend_from_slice(lines);
        self.samples.extend_from_slice(samples);
        self.spreads.extend(spreads);
    }

    /// Takes the bodies that each eye is in, as `set` says.
    pub(super) fn set_around(&mut self, mut set: impl FnMut(&Line) -> u32) {
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
    pub(super) fn branch(&self, way: usize) -> Branch {
        let around = || self.around.get(way).copied().unwrap_or(media::NONE);
        self.branches.get(way).copied().unwrap_or_else(|| Branch { inside: around(), ..Branch::EYE })
    }

    /// The bodies that a ray is in, and the surface where it starts that it meets first.
    #[inline]
    pub(super) fn start_of(&self, way: usize) -> [u32; 2] {
        let Branch { inside, meets, .. } = self.branch(way);
        [inside, meets]
    }

    #[inline]
    pub(super) fn sample(&self, way: usize) -> &Sample {
        &self.samples[way]
    }

    #[inline]
    pub(super) fn spread(&self, way: usize) -> Option<&Spread> {
        self.spreads.get(way)
    }

    /// Counts the rays by kind, and those that stopped.
    pub(super) fn count(&self, stopped: impl ExactSizeIterator<Item = usize>, counts: &mut RayCounts) {
        if self.branches.is_empty() {
            counts.eye.traced += self.len() as u64;
            counts.eye.hit += stopped.len() as u64;
            return;
        }
        for branch in &self.branches {
            counts.of_mut(branch.kind).traced += 1;
        }
        for way in stopped {
            counts.of_mut(self.branches[way].kind).hit += 1;
        }
    }
}

/// Where a ray stands in the ray tree.
#[derive(Clone, Copy)]
pub(super) struct Branch {
    pub(super) kind: RayKind,
    pub(super) depth: u32,
    /// What the ray's colour is multiplied with in its parent.
    pub(super) factor: Rgb,
    /// The product of all factors from the eye.
    pub(super) weight: Rgb,
    /// How often it went on past a surface that is there in part.
    pub(super) passed: u32,
    /// What keeps random numbers here apart from those elsewhere in the tree.
    pub(super) place: Dimension,
    /// The bodies that it is in.
    pub(super) inside: u32,
    /// The surface where it starts that it meets before any other.
    pub(super) meets: u32,
}

impl Branch {
    /// A ray from the eye's.
    pub(super) const EYE: Branch = Branch {
        kind: RayKind::Eye,
        depth: 1,
        factor: Rgb::WHITE,
        weight: Rgb::WHITE,
        passed: 0,
        place: Dimension::EYE.of(uses::EYE),
        inside: media::NONE,
        meets: media::NONE,
    };
}
