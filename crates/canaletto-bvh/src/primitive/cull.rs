//! What the f32 tests of four primitives side by side share: the ray, and the lanes that they can't rule out.

use crate::Ray;
use glam::Vec4;

/// The largest number of primitives in a block.
pub(crate) const LANES: usize = 4;

/// The relative error bound of a few sums and products in f32; see [`sphere`].
pub(crate) const RELATIVE: f32 = 8.0 * f32::EPSILON;

/// A ray with a unit direction, rounded to f32.
#[derive(Clone, Copy, Debug)]
pub(crate) struct UnitRay {
    pub(crate) origin: [f32; 3],
    /// The direction, of length 1. NaN for a zero direction.
    pub(crate) unit: [f32; 3],
    /// The growth of t per unit of length. NaN, which decides nothing, where it would lose digits.
    pub(crate) per_length: f32,
}

impl UnitRay {
    #[inline]
    pub(crate) fn new(ray: &Ray) -> Self {
        let direction = ray.direction.as_dvec3();
        let per_length = 1.0 / direction.dot(direction).sqrt();
        let unit = direction * per_length;
        let per_length = if (per_length as f32).is_normal() { per_length as f32 } else { f32::NAN };
        Self { origin: ray.origin.to_array(), unit: [unit.x as f32, unit.y as f32, unit.z as f32], per_length }
    }
}

/// The lanes of a block that may be hit, one bit for each, and a lower bound of t for each.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Candidates {
    pub(crate) lanes: u32,
    pub(crate) near: [f32; LANES],
}

impl Candidates {
    pub(crate) const NONE: Self = Self { lanes: 0, near: [f32::INFINITY; LANES] };

    #[inline(always)]
    pub(super) fn masked(self, lanes: u32) -> Self {
        Self { lanes: self.lanes & lanes, ..self }
    }

    /// The union of two sets of candidates without common lanes.
    #[inline(always)]
    pub(super) fn union(mut self, other: Self) -> Self {
        for lane in 0..LANES {
            self.near[lane] = if other.lanes >> lane & 1 == 1 { other.near[lane] } else { self.near[lane] };
        }
        self.lanes |= other.lanes;
        self
    }
}

/// Four points: rows of x, y and z.
pub(crate) type Rows = [Vec4; 3];
