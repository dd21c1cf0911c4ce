//! A ray on its way, and where it stops.

use crate::integrator::{RayCounts, RayKind};
use crate::material::{MaterialPoint, reflect};
use crate::math::{Line, Rgb, Spread, offset_origin};
use crate::sampler::{Dimension, Sample};
use crate::shape::Surface;
use crate::world::Hit;
use canaletto_bvh::Ray;
use glam::{DMat3, DVec3};

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
}

impl Ways {
    pub(super) fn clear(&mut self) {
        let Ways { rays, lines, branches, samples, spreads } = self;
        rays.clear();
        lines.clear();
        branches.clear();
        samples.clear();
        spreads.clear();
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

    #[inline]
    pub(super) fn branch(&self, way: usize) -> Branch {
        self.branches.get(way).copied().unwrap_or(Branch::EYE)
    }

    #[inline]
    pub(super) fn sample(&self, way: usize) -> &Sample {
        &self.samples[way]
    }

    #[inline]
    pub(super) fn spread(&self, way: usize) -> Option<&Spread> {
        self.spreads.get(way)
    }

    /// Counts the rays by kind.
    pub(super) fn count(&self, counts: &mut RayCounts) {
        if self.branches.is_empty() {
            counts.eye.traced += self.len() as u64;
        }
        for branch in &self.branches {
            counts.of_mut(branch.kind).traced += 1;
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
    };
}

/// Where a way meets the nearest surface: the hit as seen by the ray that made it, and the light that leaves towards it.
pub(super) struct Stop {
    way: u32,
    pub(super) hit: Hit,
    pub(super) surface: Surface,
    pub(super) material: MaterialPoint,
    /// v̂, towards where the ray came from.
    pub(super) wo: DVec3,
    /// r, the mirrored direction (5.37).
    pub(super) mirrored: DVec3,
    /// Whether the ray came from the outer side.
    pub(super) outside: bool,
    /// The sum so far.
    pub(super) color: Rgb,
}

/// The nearest thing on a way that has textures.
pub(super) struct Met {
    pub(super) hit: Hit,
    pub(super) surface: Surface,
    pub(super) material: MaterialPoint,
    /// The way's line, which starts anew behind holes.
    pub(super) line: Line,
    pub(super) footprint: Option<Footprint>,
}

/// How far from here neighbouring samples are.
#[derive(Clone, Copy)]
pub(super) struct Footprint {
    /// The spread of the ray that arrived.
    pub(super) spread: Spread,
    /// The ways along the surface to where the neighbours meet it.
    pub(super) step: [DVec3; 2],
    /// How the shading normal changes along the surface; zero where nothing asks.
    pub(super) bend: DMat3,
}

impl Footprint {
    pub(super) fn new(spread: Option<&Spread>, line: &Line, surface: &Surface) -> Option<Footprint> {
        spread.map(|spread| Footprint {
            spread: *spread,
            step: spread.along(line, surface.exact, surface.normal),
            bend: DMat3::ZERO,
        })
    }
}

/// A normal on the outer side or the inner one.
#[inline]
fn on_side(normal: DVec3, outside: bool) -> DVec3 {
    normal * if outside { 1.0 } else { -1.0 }
}

impl Stop {
    #[inline(always)]
    pub(super) fn new(way: usize, hit: Hit, surface: Surface, material: MaterialPoint, line: &Line) -> Stop {
        let outside = line.direction.dot(surface.normal) < 0.0;
        let wo = -line.direction.normalize();
        let mirrored = reflect(wo, on_side(surface.shading_normal, outside));
        Stop { way: way as u32, hit, surface, material, wo, mirrored, outside, color: Rgb::BLACK }
    }

    /// Which way of the generation stops here.
    #[inline]
    pub(super) fn way(&self) -> usize {
        self.way as usize
    }

    /// The unit geometric normal on the viewer's side.
    #[inline]
    pub(super) fn facing(&self) -> DVec3 {
        on_side(self.surface.normal, self.outside)
    }

    /// The unit shading normal on the viewer's side.
    #[inline]
    pub(super) fn normal(&self) -> DVec3 {
        on_side(self.surface.shading_normal, self.outside)
    }

    /// Whether anything but a print is seen of it.
    #[inline]
    pub(super) fn is_seen(&self) -> bool {
        self.material.print.1 < 1.0
    }

    /// The line of a ray that leaves the surface.
    pub(super) fn leave(&self, direction: DVec3) -> Line {
        Line { origin: self.surface.exact, direction }
    }

    /// Its ray, the origin moved off the surface by the error bound.
    pub(super) fn start(&self, line: &Line) -> Ray {
        let Surface { point, error, normal, .. } = self.surface;
        line.from_origin(offset_origin(point, error, normal, line.direction))
    }
}
