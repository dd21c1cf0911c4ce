//! Axis-aligned boxes.

use crate::min_max::{max, min};
use bytemuck::Zeroable;
use glam::Vec3;

/// The points between two corners, both corners included.
#[derive(Clone, Copy, Debug, PartialEq, Zeroable)]
pub struct Aabb {
    /// The corner with the smallest coordinates.
    pub min: Vec3,
    /// The corner with the largest coordinates.
    pub max: Vec3,
}

impl Aabb {
    /// The empty box, which contains no point. It is neutral in [`Aabb::union`].
    pub const EMPTY: Self = Self { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    /// The smallest box around `points`. A NaN coordinate is kept, so that [`Aabb::is_finite`] can report it.
    pub fn from_points(points: impl IntoIterator<Item = Vec3>) -> Self {
        points.into_iter().fold(Self::EMPTY, Self::include)
    }

    /// [`Aabb::from_points`] for the three corners of a triangle.
    #[inline]
    pub(crate) fn of_triangle(corners: [Vec3; 3]) -> Self {
        let [a, b, c] = corners;
        let of = |pick: fn(f32, f32) -> f32| {
            Vec3::new(pick(pick(a.x, b.x), c.x), pick(pick(a.y, b.y), c.y), pick(pick(a.z, b.z), c.z))
        };
        if !(a.is_finite() && b.is_finite() && c.is_finite()) {
            return Self::from_points(corners);
        }
        Self { min: of(min), max: of(max) }
    }

    /// The smallest box around this box and `other`.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self { min: lower(self.min, other.min), max: upper(self.max, other.max) }
    }

    /// The smallest box around this box and `point`.
    #[must_use]
    pub fn include(self, point: Vec3) -> Self {
        self.union(Self { min: point, max: point })
    }

    /// Half the surface area, 0 for the empty box. The result is f64, since in f32 a side of 1e20 overflows.
    pub fn half_area(&self) -> f64 {
        if self.is_empty() {
            return 0.0;
        }
        let d = self.max.as_dvec3() - self.min.as_dvec3();
        d.x * d.y + d.y * d.z + d.z * d.x
    }

    /// The center, rounded. It never overflows.
    pub fn center(&self) -> Vec3 {
        0.5 * self.min + 0.5 * self.max
    }

    /// Whether the box contains no point. A single point and a flat box are not empty. A box with a NaN coordinate is
    /// empty.
    pub fn is_empty(&self) -> bool {
        !self.min.cmple(self.max).all()
    }

    /// Whether the two boxes have a point in common.
    pub fn overlaps(&self, other: &Self) -> bool {
        self.min.cmple(other.max).all() && other.min.cmple(self.max).all()
    }

    /// The box of the common points; empty if there are none.
    #[must_use]
    pub fn intersection(&self, other: &Self) -> Self {
        Self { min: self.min.max(other.min), max: self.max.min(other.max) }
    }

    /// Whether all coordinates are finite. The empty box is not finite.
    pub fn is_finite(&self) -> bool {
        self.min.is_finite() && self.max.is_finite()
    }
}

/// The smaller coordinates. NaN wins, unlike in `f32::min`.
fn lower(a: Vec3, b: Vec3) -> Vec3 {
    Vec3::select(a.cmplt(b) | a.is_nan_mask(), a, b)
}

/// The larger coordinates. NaN wins, unlike in `f32::max`.
fn upper(a: Vec3, b: Vec3) -> Vec3 {
    Vec3::select(a.cmpgt(b) | a.is_nan_mask(), a, b)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_empty_box_is_neutral_and_has_no_area() {
        let b = Aabb::from_points([Vec3::ZERO, Vec3::new(1.0, 2.0, 3.0)]);
        assert_eq!(Aabb::EMPTY.union(b), b);
        assert_eq!(b.union(Aabb::EMPTY), b);
        assert!(Aabb::EMPTY.is_empty() && !Aabb::EMPTY.is_finite());
        assert_eq!(Aabb::EMPTY.half_area(), 0.0);
    }

    #[test]
    fn measures() {
        let b = Aabb::from_points([Vec3::new(1.0, 0.0, 3.0), Vec3::new(0.0, 2.0, 0.0)]);
        assert_eq!(b.half_area(), 2.0 + 6.0 + 3.0);
        assert_eq!(b.center(), Vec3::new(0.5, 1.0, 1.5));
        assert_eq!(Aabb { min: Vec3::MIN, max: Vec3::MAX }.center(), Vec3::ZERO);
        assert!(!Aabb::from_points([Vec3::ONE]).is_empty());
    }

    #[test]
    fn boxes_that_touch_overlap() {
        let of = |min: f32, max: f32| Aabb { min: Vec3::new(min, 0.0, 0.0), max: Vec3::new(max, 1.0, 1.0) };
        assert!(of(0.0, 1.0).overlaps(&of(1.0, 2.0)) && !of(0.0, 1.0).overlaps(&of(1.5, 2.0)));
        assert_eq!(of(0.0, 2.0).intersection(&of(1.0, 3.0)), of(1.0, 2.0));
        assert!(of(0.0, 1.0).intersection(&of(1.5, 2.0)).is_empty() && !of(0.0, 1.0).overlaps(&Aabb::EMPTY));
    }

    #[test]
    fn not_a_number_is_not_swallowed_in_any_order() {
        let nan = Vec3::new(0.0, f32::NAN, 0.0);
        for points in [[nan, Vec3::ZERO, Vec3::ONE], [Vec3::ZERO, nan, Vec3::ONE], [Vec3::ZERO, Vec3::ONE, nan]] {
            assert!(!Aabb::from_points(points).is_finite());
        }
    }
}
