//! What is sorted: a primitive's box and number in 32 bytes, for vectors of four.

use glam::Vec4;

use crate::Aabb;

/// A box whose fourth lanes hold nothing that matters.
#[derive(Clone, Copy)]
pub(super) struct Box4 {
    pub(super) min: Vec4,
    pub(super) max: Vec4,
}

impl Box4 {
    pub(super) const EMPTY: Self = Self { min: Vec4::INFINITY, max: Vec4::NEG_INFINITY };

    /// Of boxes known to hold no NaN.
    #[inline]
    pub(super) fn join(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    pub(super) fn aabb(&self) -> Aabb {
        Aabb { min: self.min.truncate(), max: self.max.truncate() }
    }

    /// Half of the surface area in units that `scale` makes of lengths, so that no product overflows.
    #[inline]
    pub(super) fn half_area(&self, scale: f32) -> f32 {
        let d = self.max * scale - self.min * scale;
        d.x * d.y + d.y * d.z + d.z * d.x
    }

    /// A power of two that makes this box about as large as 1, so that scaling a scene by such changes nothing.
    pub(super) fn scale(&self) -> f32 {
        // Halved, since a difference may be twice as large as the largest float.
        let half = (self.max * 0.5 - self.min * 0.5).truncate().max_element();
        let exponent = half.to_bits() >> 23;
        f32::from_bits((253 - exponent).clamp(1, 253) << 23)
    }
}

/// A primitive. Its number lies in the fourth lane of the lower corner, as a float that is normal and finite, since
/// arithmetic on whole vectors slows down on others.
#[derive(Clone, Copy)]
pub(super) struct Item(Box4);

/// Added to a number of 29 bits: the bits of a normal float between 2⁻⁶³ and 2.
const NORMAL: u32 = 1 << 29;
const _: () = assert!(super::MAX_PRIMITIVES <= 1 << 29);

impl Item {
    /// Adding 0 turns −0 into 0, of which minima would keep either, as it happens.
    pub(super) fn new(bounds: &Aabb, id: u32) -> Self {
        let min = (bounds.min + 0.0).extend(f32::from_bits(id + NORMAL));
        Self(Box4 { min, max: (bounds.max + 0.0).extend(1.0) })
    }

    pub(super) fn id(&self) -> u32 {
        self.0.min.w.to_bits() - NORMAL
    }

    #[inline]
    pub(super) fn bounds(&self) -> Box4 {
        self.0
    }

    /// Half of the center, so that differences of two don't overflow either.
    #[inline]
    pub(super) fn center(&self) -> Vec4 {
        self.0.min * 0.25 + self.0.max * 0.25
    }
}

/// The box around some centers.
#[derive(Clone, Copy)]
pub(super) struct Centers(pub(super) Box4);

impl Centers {
    pub(super) const NONE: Self = Self(Box4::EMPTY);

    #[inline]
    pub(super) fn add(&mut self, center: Vec4) {
        self.0 = self.0.join(Box4 { min: center, max: center });
    }

    pub(super) fn join(self, other: Self) -> Self {
        Self(self.0.join(other.0))
    }
}

/// The box around some items, and that around their centers.
#[derive(Clone, Copy)]
pub(super) struct Extent {
    pub(super) bounds: Box4,
    pub(super) centers: Centers,
}

impl Extent {
    pub(super) const EMPTY: Self = Self { bounds: Box4::EMPTY, centers: Centers::NONE };

    pub(super) fn of(items: &[Item]) -> Self {
        use rayon::prelude::*;
        if items.len() > super::CHUNK {
            return items.par_chunks(super::CHUNK).map(Self::of).reduce(|| Self::EMPTY, Self::join);
        }
        items.iter().fold(Self::EMPTY, |mut extent, item| {
            extent.bounds = extent.bounds.join(item.bounds());
            extent.centers.add(item.center());
            extent
        })
    }

    fn join(self, other: Self) -> Self {
        Self { bounds: self.bounds.join(other.bounds), centers: self.centers.join(other.centers) }
    }
}
