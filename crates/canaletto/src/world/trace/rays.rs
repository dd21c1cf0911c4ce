//! Rays in one space, and ranges of them with bounds of their groups.

use crate::world::data::packet_bounds::{GROUP, PacketBounds};
use crate::world::trace::box_filter::BoxFilter;
use canaletto_bvh::{Aabb, PreparedRay, Ray};
use std::ops::Range;

/// Rays in one space.
#[derive(Debug, Default)]
pub(in crate::world) struct Rays {
    pub(in crate::world) rays: Vec<Ray>,
    /// Prepared rays of the range `ready`.
    prepared: Vec<PreparedRay>,
    /// The range of the rays in `prepared`.
    ready: Range<usize>,
    filter: BoxFilter,
}

impl Rays {
    pub(in crate::world) fn clear(&mut self) {
        self.rays.clear();
        self.change();
    }

    /// Forgets what was derived from the rays, which change.
    pub(in crate::world) fn change(&mut self) {
        self.ready = 0..0;
        self.filter.clear();
    }

    /// All these rays.
    pub(in crate::world) fn all(&mut self) -> RayRange<'_> {
        let range = 0..self.rays.len();
        RayRange { all: self, range }
    }
}

/// A range of rays of a list.
pub(in crate::world) struct RayRange<'a> {
    pub(in crate::world) all: &'a mut Rays,
    pub(in crate::world) range: Range<usize>,
}

impl<'a> RayRange<'a> {
    #[inline]
    pub(in crate::world) fn rays(&self) -> &[Ray] {
        &self.all.rays[self.range.clone()]
    }

    pub(in crate::world) fn prepare(&mut self) -> &[PreparedRay] {
        let (Rays { rays, prepared, ready, .. }, range) = (&mut *self.all, &self.range);
        if range.start < ready.start || ready.end < range.end {
            prepared.clear();
            prepared.extend(rays[range.clone()].iter().map(Ray::prepare));
            *ready = range.clone();
        }
        &prepared[range.start - ready.start..range.end - ready.start]
    }

    /// The rays, and a filter of those that may hit a box before these ends.
    pub(in crate::world) fn filter(self, ends: impl Iterator<Item = f32>) -> (&'a [Ray], &'a mut BoxFilter) {
        let (Rays { rays, filter, .. }, range) = (self.all, self.range);
        filter.set(rays, &range, ends);
        (&rays[range], filter)
    }
}

/// Calls `f` with each run of groups that may hit a box, as the range of their rays.
pub(in crate::world) fn for_candidate_runs(
    packet_bounds: &[PacketBounds],
    rays: usize,
    bounds: &Aabb,
    mut f: impl FnMut(Range<usize>),
) {
    let mut start = None;
    for (index, packet_bounds) in packet_bounds.iter().enumerate() {
        match (packet_bounds.misses(bounds), start) {
            (false, None) => start = Some(index * GROUP),
            (true, Some(first)) => {
                f(first..index * GROUP);
                start = None;
            }
            _ => {}
        }
    }
    if let Some(first) = start {
        f(first..rays);
    }
}

/// Sets `t_max` to −∞ for each ray that `blocked` reports blocked at or before it. `blocked` gets the ray's index.
#[inline]
pub(in crate::world) fn end<R>(rays: &[R], t_max: &mut [f32], mut blocked: impl FnMut(usize, &R, f32) -> bool) {
    for (index, (ray, t_max)) in rays.iter().zip(t_max).enumerate() {
        if *t_max > 0.0 && blocked(index, ray, *t_max) {
            *t_max = f32::NEG_INFINITY;
        }
    }
}
