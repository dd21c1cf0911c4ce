//! Primitive references, which the builder sorts: a primitive's box and id in 32 bytes, one vector of eight floats
//! (Embree's `PrimRef`).

use std::sync::atomic::{AtomicUsize, Ordering};

use super::BuildError;
use crate::Aabb;
use crate::memory::collected;
use crate::min_max::max;
use crate::node::MAX_PRIMITIVES;
use glam::Vec3;

/// A box as one vector. The lower corner is negated, so that both corners are joined by maxima. The fourth lane of
/// either corner is not part of the box: [`PrimRef`] keeps its id in one of them.
#[derive(Clone, Copy)]
#[repr(align(32))]
pub(super) struct Box8(pub(super) [f32; 8]);

impl Box8 {
    pub(super) const EMPTY: Self = Self([f32::NEG_INFINITY; 8]);

    /// The union of two boxes without NaN.
    #[inline(always)]
    pub(super) fn join(&self, other: &Self) -> Self {
        let (Self(a), Self(b)) = (self, other);
        Self([
            max(a[0], b[0]),
            max(a[1], b[1]),
            max(a[2], b[2]),
            max(a[3], b[3]),
            max(a[4], b[4]),
            max(a[5], b[5]),
            max(a[6], b[6]),
            max(a[7], b[7]),
        ])
    }

    /// The vector for a box, with two numbers for the fourth lanes. Adding 0 turns −0 into 0, as a maximum of the two
    /// could be either.
    #[inline(always)]
    pub(super) fn new(bounds: &Aabb, [low, high]: [f32; 2]) -> Self {
        let Aabb { min, max } = bounds;
        Self([0.0 - min.x, 0.0 - min.y, 0.0 - min.z, low, max.x + 0.0, max.y + 0.0, max.z + 0.0, high])
    }

    #[inline(always)]
    pub(super) fn min(&self, axis: usize) -> f32 {
        0.0 - self.0[axis]
    }

    #[inline(always)]
    pub(super) fn max(&self, axis: usize) -> f32 {
        self.0[4 + axis]
    }

    pub(super) fn aabb(&self) -> Aabb {
        let corner = |at: fn(&Self, usize) -> f32| [0, 1, 2].map(|axis| at(self, axis)).into();
        Aabb { min: corner(Self::min), max: corner(Self::max) }
    }

    /// Half of the surface area, with lengths multiplied by `scale`, so that no product overflows.
    #[inline(always)]
    pub(super) fn half_area(&self, scale: f32) -> f32 {
        let d = |axis: usize| self.0[4 + axis] * scale + self.0[axis] * scale;
        let (x, y, z) = (d(0), d(1), d(2));
        x * y + y * z + z * x
    }

    /// A power of two that scales this box to a size of about 1. Scaling a scene by a power of two therefore changes no
    /// decision.
    pub(super) fn scale(&self) -> f32 {
        // Halved, since a difference may be twice as large as the largest float.
        let half = (0..3).map(|axis| self.max(axis) * 0.5 - self.min(axis) * 0.5).fold(0.0, max);
        // At most 254, since half of a finite number is finite.
        let exponent = half.to_bits() >> 23;
        f32::from_bits(253u32.saturating_sub(exponent).max(1) << 23)
    }
}

/// A primitive reference. The id lies in the fourth lane of the lower corner, as a normal, finite float, since
/// arithmetic on whole vectors is slower with other values.
#[derive(Clone, Copy)]
pub(super) struct PrimRef(Box8);

/// Added to an id of 29 bits, it gives the bits of a normal float between 2⁻⁶³ and 2.
const NORMAL: u32 = 1 << 29;
const _: () = assert!(MAX_PRIMITIVES <= 1 << 29);

impl PrimRef {
    #[inline(always)]
    pub(super) fn new(bounds: &Aabb, id: u32) -> Self {
        Self(Box8::new(bounds, [f32::from_bits(id + NORMAL), 1.0]))
    }

    pub(super) fn id(&self) -> u32 {
        self.0.0[3].to_bits() - NORMAL
    }

    #[inline(always)]
    pub(super) fn bounds(&self) -> &Box8 {
        &self.0
    }

    /// Half of the center, so that differences of two centers don't overflow either.
    #[inline(always)]
    pub(super) fn center(&self) -> [f32; 4] {
        let Box8([ax, ay, az, aw, bx, by, bz, bw]) = self.0;
        [bx * 0.25 - ax * 0.25, by * 0.25 - ay * 0.25, bz * 0.25 - az * 0.25, bw * 0.25 - aw * 0.25]
    }
}

/// The box around the (halved) centers of references.
#[derive(Clone, Copy)]
pub(super) struct Centers(pub(super) Box8);

impl Centers {
    pub(super) const NONE: Self = Self(Box8::EMPTY);

    /// Adds a center if `counts`, without a branch.
    #[inline(always)]
    pub(super) fn add(&mut self, [x, y, z, w]: [f32; 4], counts: bool) {
        let Self(Box8(own)) = self;
        let new = [-x, -y, -z, -w, x, y, z, w];
        for (own, new) in own.iter_mut().zip(new) {
            *own = if counts & (new > *own) { new } else { *own };
        }
    }

    pub(super) fn join(self, other: Self) -> Self {
        Self(self.0.join(&other.0))
    }
}

/// The box around references, and the box around their centers.
#[derive(Clone, Copy)]
pub(super) struct Extent {
    pub(super) bounds: Box8,
    pub(super) centers: Centers,
    /// The centers coincide, and duplicates have been left out.
    pub(super) duplicates_removed: bool,
}

impl Extent {
    pub(super) const EMPTY: Self = Self { bounds: Box8::EMPTY, centers: Centers::NONE, duplicates_removed: false };

    pub(super) fn of(refs: &[PrimRef]) -> Self {
        use canaletto_parallel::prelude::*;
        if refs.len() > super::CHUNK {
            return refs.par_chunks(super::CHUNK).map(Self::of).reduce(|| Self::EMPTY, Self::join);
        }
        of_few(refs)
    }

    fn join(self, other: Self) -> Self {
        Self {
            bounds: self.bounds.join(&other.bounds),
            centers: self.centers.join(other.centers),
            duplicates_removed: false,
        }
    }
}

crate::instruction_set::compiled_wide! {
    fn of_few(refs: &[PrimRef]) -> Extent {
        let mut extent = Extent::EMPTY;
        for prim in refs {
            extent.bounds = extent.bounds.join(prim.bounds());
            extent.centers.add(prim.center(), true);
        }
        extent
    }
}

/// The input of a builder: the references of all primitives.
pub(crate) struct PrimRefs<'a> {
    pub(super) list: Vec<PrimRef>,
    /// The box around all primitives, if the boxes of the references are wider.
    pub(super) whole: Option<Aabb>,
    /// The corners of the triangles, if the primitives are triangles.
    pub(super) corners: Option<&'a Corners<'a>>,
}

/// A function that returns the corners of a triangle.
pub(crate) type Corners<'a> = dyn Fn(u32) -> [Vec3; 3] + Sync + 'a;

impl<'a> PrimRefs<'a> {
    /// The references of `count` primitives with these boxes.
    pub(crate) fn new(count: usize, bounds: &(dyn Fn(usize) -> Aabb + Sync)) -> Result<Self, BuildError> {
        Self::with_room(count, 0, bounds)
    }

    /// [`PrimRefs::new`] with room for `room` further references.
    fn with_room(count: usize, room: usize, bounds: &(dyn Fn(usize) -> Aabb + Sync)) -> Result<Self, BuildError> {
        if count > MAX_PRIMITIVES {
            return Err(BuildError::TooManyPrimitives { count });
        }
        let bad = AtomicUsize::new(usize::MAX);
        let prim = |index: usize| {
            let bounds = bounds(index);
            if !bounds.is_finite() || bounds.is_empty() {
                bad.fetch_min(index, Ordering::Relaxed);
            }
            PrimRef::new(&bounds, index as u32)
        };
        let refs = collected(count, room, prim);
        match bad.into_inner() {
            usize::MAX => Ok(Self { list: refs, whole: None, corners: None }),
            index => Err(BuildError::InvalidBox { index, bounds: bounds(index) }),
        }
    }

    /// The references of `count` triangles, one for each.
    pub(crate) fn of_whole_triangles(count: usize, corners: &'a Corners<'a>) -> Result<Self, BuildError> {
        Self::of_triangles_with_room(count, 0, corners)
    }

    pub(super) fn of_triangles_with_room(
        count: usize,
        room: usize,
        corners: &'a Corners<'a>,
    ) -> Result<Self, BuildError> {
        let refs = Self::with_room(count, room, &|id| Aabb::of_triangle(corners(id as u32)))?;
        Ok(Self { corners: Some(corners), ..refs })
    }
}
