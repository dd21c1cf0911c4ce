//! Which of many rays may hit a box: the slabs of Kay and Kajiya (1986) in single precision, for sixteen rays at once.
//!
//! The test passes every ray that a tree would let into the box. Exact kernels have the last word.

use canaletto_bvh::lanes::SET_LANES;
use canaletto_bvh::{Aabb, InstructionSet, Kernel, Ray};
use std::ops::Range;

/// The number of rays that are tested at once.
const LANES: usize = 16;

/// The range of components whose reciprocals are normal numbers. Other components cull nothing.
const REGULAR: std::ops::RangeInclusive<f32> = 1e-37..=1e37;

/// The slack in t. Rounding takes less than 2⁻²¹ of it, and trees have a slack of 2⁻²⁰.
const SLACK: f32 = 1.0 / (1 << 17) as f32;
/// The slack where numbers lose digits.
const TINY: f32 = 1e-30;

type Row = [f32; LANES];

/// Sixteen rays, component by component.
#[derive(Clone, Copy, Debug)]
struct Lanes {
    origin: [Row; 3],
    /// The reciprocals of the directions; NaN where they aren't regular.
    reciprocal: [Row; 3],
}

/// Rays and their ends, and the rays that may hit a box.
#[derive(Debug, Default)]
pub(in crate::world) struct BoxFilter {
    lanes: Vec<Lanes>,
    /// The end of each ray, and −∞ beyond the last one.
    ends: Vec<Row>,
    candidates: Vec<u32>,
    /// The range of the rays in `lanes`, in a list that is known to its owner.
    ready: Range<usize>,
}

impl BoxFilter {
    /// Forgets the rays.
    pub(in crate::world) fn clear(&mut self) {
        self.ready = 0..0;
    }

    /// Takes the rays of a range, unless they are there, and their ends.
    pub(in crate::world) fn set(&mut self, rays: &[Ray], range: &Range<usize>, ends: impl Iterator<Item = f32>) {
        if self.ready != *range {
            self.lanes.clear();
            InstructionSet::run(Fill { rays: &rays[range.clone()], lanes: &mut self.lanes });
            self.ready = range.clone();
        }
        self.ends.clear();
        self.ends.resize(self.lanes.len(), [f32::NEG_INFINITY; LANES]);
        self.ends.as_flattened_mut().iter_mut().zip(ends).for_each(|(to, end)| *to = end);
    }

    /// The numbers of the rays that may hit a box before their ends, and the ends of all rays.
    pub(in crate::world) fn candidates(&mut self, bounds: &Aabb) -> (&[u32], &mut [f32]) {
        // Numbers are written by eights.
        self.candidates.resize((self.lanes.len() + 1) * LANES, 0);
        let Self { lanes, ends, candidates: found, .. } = self;
        let count = InstructionSet::run(Candidates { lanes, ends, bounds, found });
        (&self.candidates[..count], self.ends.as_flattened_mut())
    }
}

struct Fill<'a> {
    rays: &'a [Ray],
    lanes: &'a mut Vec<Lanes>,
}

impl Kernel for Fill<'_> {
    type Answer = ();

    #[inline(always)]
    fn run(self) {
        for rays in self.rays.chunks(LANES) {
            let mut lanes = Lanes { origin: [[0.0; LANES]; 3], reciprocal: [[f32::NAN; LANES]; 3] };
            for (i, ray) in rays.iter().enumerate() {
                for axis in 0..3 {
                    let d = ray.direction[axis];
                    lanes.origin[axis][i] = ray.origin[axis];
                    lanes.reciprocal[axis][i] = if REGULAR.contains(&d.abs()) { 1.0 / d } else { f32::NAN };
                }
            }
            self.lanes.push(lanes);
        }
    }
}

struct Candidates<'a> {
    lanes: &'a [Lanes],
    ends: &'a [Row],
    bounds: &'a Aabb,
    found: &'a mut [u32],
}

impl Kernel for Candidates<'_> {
    /// The number of candidates.
    type Answer = usize;

    #[inline(always)]
    fn run(self) -> usize {
        let Candidates { lanes, ends, bounds, found } = self;
        let mut count = 0;
        let (min, max) = (bounds.min.to_array(), bounds.max.to_array());
        for (number, (lanes, ends)) in lanes.iter().zip(ends).enumerate() {
            let (mut near, mut far) = ([0.0; LANES], *ends);
            for axis in 0..3 {
                for i in 0..LANES {
                    let (o, r) = (lanes.origin[axis][i], lanes.reciprocal[axis][i]);
                    let (a, b) = ((min[axis] - o) * r, (max[axis] - o) * r);
                    let (low, high) = if a < b { (a, b) } else { (b, a) };
                    // NaN changes neither.
                    near[i] = if low > near[i] { low } else { near[i] };
                    far[i] = if high < far[i] { high } else { far[i] };
                }
            }
            let mut bits = 0;
            for i in 0..LANES {
                let is_missed = near[i] * (1.0 - SLACK) > far[i] * (1.0 + SLACK) + TINY;
                bits |= u32::from(!is_missed) << i;
            }
            // Eight numbers are written, and the next ones overwrite those beyond the bits: no branch is mispredicted.
            for (half, byte) in [bits & 0xff, bits >> 8].into_iter().enumerate() {
                let first = (number * LANES + 8 * half) as u32;
                let (places, eight) = (&SET_LANES[byte as usize], &mut found[count..count + 8]);
                for (to, place) in eight.iter_mut().zip(places) {
                    *to = first + u32::from(*place);
                }
                count += byte.count_ones() as usize;
            }
        }
        count
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    /// No ray is left out that meets the box in `f64`, also where it only touches an edge.
    #[test]
    fn every_ray_that_meets_a_box_is_a_candidate() {
        let mut state = 7u32;
        let mut random = || {
            state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
            (state >> 8) as f32 / (1 << 23) as f32 - 1.0
        };
        let (mut met, mut left_out) = (0, 0);
        for round in 0..400 {
            let mut vector = || Vec3::new(random(), random(), random());
            let scale = [1.0, 1e-20, 1e12, 3.0][round % 4];
            let min = vector() * scale;
            let bounds = Aabb { min, max: min + vector().abs() * scale * [1.0, 1e-3, 0.0][round % 3] };
            let rays: Vec<Ray> = (0..37)
                .map(|i| {
                    let corner =
                        Vec3::select(glam::BVec3::new(i & 1 == 0, i & 2 == 0, i & 4 == 0), bounds.min, bounds.max);
                    let origin = vector() * 2.0 * scale;
                    let direction = match i % 5 {
                        0 => corner - origin,
                        1 => Vec3::X,
                        _ => vector(),
                    };
                    Ray { origin, direction }
                })
                .collect();
            let end = [f32::INFINITY, 1.0, 0.5 * scale][round % 3];
            let mut filter = BoxFilter::default();
            filter.set(&rays, &(0..rays.len()), rays.iter().map(|_| end));
            let found = filter.candidates(&bounds).0.to_vec();
            for (i, ray) in rays.iter().enumerate() {
                let (o, d) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
                let (mut near, mut far) = (0.0f64, f64::from(end));
                for axis in 0..3 {
                    let ends = [bounds.min[axis], bounds.max[axis]].map(|plane| (f64::from(plane) - o[axis]) / d[axis]);
                    if d[axis] != 0.0 {
                        (near, far) = (near.max(ends[0].min(ends[1])), far.min(ends[0].max(ends[1])));
                    } else if o[axis] < bounds.min[axis].into() || o[axis] > bounds.max[axis].into() {
                        far = f64::NEG_INFINITY;
                    }
                }
                let is_met = near <= far * (1.0 + 1e-6);
                let is_found = found.contains(&(i as u32));
                assert!(is_found || !is_met, "{ray:?} {bounds:?} {end}");
                met += u32::from(is_met);
                left_out += u32::from(!is_found);
            }
        }
        assert!(met > 1000 && left_out > 1000, "{met} {left_out}");
    }

    /// A ray that has ended is no candidate, and lanes beyond the last ray aren't either.
    #[test]
    fn ended_rays_are_left_out() {
        let rays = [Ray { origin: Vec3::ZERO, direction: Vec3::new(1.0, 0.1, 0.1) }; 20];
        let bounds = Aabb { min: Vec3::splat(-1.0), max: Vec3::splat(1.0) };
        let mut filter = BoxFilter::default();
        filter.set(&rays, &(0..20), (0..20).map(|i| if i % 2 == 0 { 1.0 } else { f32::NEG_INFINITY }));
        assert!(filter.candidates(&bounds).0.iter().copied().eq((0..20).step_by(2)));
    }
}
