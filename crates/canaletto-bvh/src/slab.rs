//! Rays against boxes: the slab test of Kay and Kajiya, made conservative after Ize, "Robust BVH
//! ray traversal" (2013).
//!
//! Where it goes further, so that the tree agrees with a loop over the primitives bit for bit:
//! - The interval's end is inflated by 16 units in the last place where Ize needs 6; the rest covers the rounding
//!   of a hit's t.
//! - A ray that moves along no axis of the three gives no 0 × ∞ there: on an axis with direction 0 the origin is
//!   compared with the slab, on an axis whose reciprocal would overflow or lose bits nothing is culled.
//! - A kernel that has found a hit passes it through [`PreparedRay::clamp_to_box`] with the primitive's own box. Each
//!   rounding is monotone, so a box that holds another gets an interval that holds the other's: what `clamp_to_box`
//!   lets pass no ancestor in the tree can cull.

use glam::Vec3;

use crate::{Aabb, PreparedRay};

/// How many boxes lie side by side.
pub(crate) const WIDTH: usize = 8;

/// Eight boxes: the lower then the upper planes of x, y and z.
pub(crate) type Boxes = [[[f32; WIDTH]; 3]; 2];

/// 1 + 2⁻²⁰ ≥ 1 + 2γ(3), with slack.
pub(crate) const INFLATE: f32 = 1.0 + 8.0 * f32::EPSILON;
/// The slack that `clamp_to_box` leaves to t; `INFLATE * DEFLATE` > 1 also after rounding.
pub(crate) const DEFLATE: f32 = 1.0 - 4.0 * f32::EPSILON;

/// Up to where something must be entered to be worth a visit: nowhere, where `t_max` is NaN.
#[inline]
pub(crate) fn limit(t_max: f32) -> f32 {
    max(t_max * INFLATE, f32::NEG_INFINITY)
}

impl PreparedRay {
    /// Where the ray enters and leaves a box, within (0, limit]. It meets the box if entry ≤ exit. For rays that are not
    /// `regular`.
    #[cold]
    #[inline(never)]
    pub(crate) fn clip_carefully(&self, bounds: &Aabb, limit: f32) -> (f32, f32) {
        let mut near = 0.0;
        // No lane without a child may be met, even if no axis culls or the origin is infinite. NaN meets nothing.
        let nothing = bounds.is_empty() || self.ray.origin.is_nan() || self.ray.direction.is_nan();
        let mut far = if nothing { f32::NEG_INFINITY } else { f32::INFINITY };
        for axis in 0..3 {
            let (low, high, origin) = (bounds.min[axis], bounds.max[axis], self.ray.origin[axis]);
            let backwards = self.backwards[axis];
            if self.ray.direction[axis] == 0.0 {
                if !(low <= origin && origin <= high) {
                    far = f32::NEG_INFINITY;
                }
            } else if backwards.is_normal() {
                let (first, second) = if self.axis_order.octant >> axis & 1 == 0 { (low, high) } else { (high, low) };
                near = ((origin - first) * backwards).max(near);
                far = ((origin - second) * backwards).min(far);
            }
        }
        (near, (far * INFLATE).min(limit))
    }

    /// [`PreparedRay::clip_carefully`] for a `regular` ray, without limit.
    #[inline]
    fn clip_one(&self, bounds: &Aabb) -> (f32, f32) {
        let cross = |axis: usize, plane: f32| (self.ray.origin[axis] - plane) * self.backwards[axis];
        // The nearer plane is the one with the lesser product.
        let planes = |axis: usize| {
            let (low, high) = (cross(axis, bounds.min[axis]), cross(axis, bounds.max[axis]));
            (min(low, high), max(low, high))
        };
        let ((n0, f0), (n1, f1), (n2, f2)) = (planes(0), planes(1), planes(2));
        let near = max(max(n0, n1), max(n2, 0.0));
        let far = min(min(f0, f1), min(f2, f32::INFINITY));
        (near, far * INFLATE)
    }

    /// Where the ray enters and leaves a box, if it meets it.
    #[inline]
    fn clip(&self, bounds: &Aabb) -> Option<(f32, f32)> {
        let (near, far) = if self.regular { self.clip_one(bounds) } else { self.clip_carefully(bounds, f32::INFINITY) };
        if near <= far { Some((near, far)) } else { None }
    }

    /// Whether the ray meets a box within (0, t_max], as trees ask it: true in doubt. An empty box is never met, nor is one with a coordinate that
    /// is NaN.
    #[inline]
    pub fn enters(&self, bounds: &Aabb, t_max: f32) -> bool {
        let limit = limit(t_max);
        let (near, far) = if self.regular { self.clip_one(bounds) } else { self.clip_carefully(bounds, limit) };
        near <= far && near <= limit && !bounds.is_empty()
    }

    /// The hit at `t` on something in this box, moved into it by no more than rounding explains, unless
    /// `t` is badly conditioned (a grazed triangle); then by as much as it takes; so that no tree over such boxes can lose it. `None` if the ray
    /// misses the box or the hit lies outside (0, t_max].
    #[inline]
    pub fn clamp_to_box(&self, bounds: &Aabb, t: f64, t_max: f32) -> Option<f32> {
        let (near, far) = self.clip(bounds).filter(|_| !bounds.is_empty())?;
        // In these orders, a `t` that is NaN stays, which is no hit.
        let t = max(near * DEFLATE, min(far, t as f32));
        (t > 0.0 && t <= t_max && t < f32::INFINITY).then_some(t)
    }
}

impl PreparedRay {
    /// [`PreparedRay::clamp_to_box`] for a triangle whose t leads to one of its points as closely as [`crate::triangle`] says: moved back only to
    /// the farthest corner along the longest axis, since a shorter one may move it by as much as it likes, off the triangle's other parts.
    #[inline]
    pub(crate) fn clamp_to_triangle(&self, bounds: &Aabb, t: f64, t_max: f32) -> Option<f32> {
        let (near, _) = self.clip(bounds)?;
        let longest = self.axis_order.rows[2];
        let cross = |corner: &Vec3| (self.origin(longest) - longest.of(corner)) * self.along;
        let last = max(cross(&bounds.min), cross(&bounds.max)) * INFLATE;
        let mut t = t as f32;
        // NaN, for a ray that is not regular, moves nothing.
        if t > last {
            t = last;
        }
        // A `t` that is NaN stays, which is no hit.
        t = max(near * DEFLATE, t);
        (t >= f32::MIN_POSITIVE && t <= t_max && t < f32::INFINITY).then_some(t)
    }
}

/// Unlike `f32::max`, one instruction. If one is NaN, the second stays.
#[inline(always)]
pub(crate) fn max(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// Unlike `f32::min`, one instruction. If one is NaN, the second stays.
#[inline(always)]
pub(crate) fn min(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Ray;

    fn meets(origin: Vec3, direction: Vec3, bounds: Aabb, t_max: f32) -> bool {
        let (near, far) = Ray::new(origin, direction).prepare().clip_carefully(&bounds, limit(t_max));
        assert!(!near.is_nan() && !far.is_nan());
        assert_eq!(Ray::new(origin, direction).prepare().enters(&bounds, t_max), near <= far);
        near <= far
    }

    #[test]
    fn planes_of_a_box_belong_to_it() {
        let b = Aabb { min: Vec3::ZERO, max: Vec3::ONE };
        // Along a face, an edge and through a corner, on either side; -0 is 0.
        for x in [0.0, 1.0] {
            assert!(meets(Vec3::new(x, 0.5, -1.0), Vec3::Z, b, 9.0));
            assert!(meets(Vec3::new(x, 1.0, -1.0), Vec3::new(-0.0, 0.0, 1.0), b, 9.0));
            assert!(meets(Vec3::new(x - 1.0, 1.0, -1.0), Vec3::new(1.0, 0.0, 1.0), b, 9.0));
        }
        assert!(!meets(Vec3::new(1.0_f32.next_up(), 0.5, -1.0), Vec3::Z, b, 9.0));
        assert!(!meets(Vec3::new(-f32::MIN_POSITIVE, 0.5, -1.0), Vec3::Z, b, 9.0));
    }

    #[test]
    fn the_end_is_inclusive_and_the_back_is_not_met() {
        let b = Aabb { min: Vec3::ONE, max: Vec3::splat(2.0) };
        assert!(meets(Vec3::ZERO, Vec3::ONE, b, 1.0));
        assert!(!meets(Vec3::ZERO, Vec3::ONE, b, 0.999));
        assert!(!meets(Vec3::ZERO, -Vec3::ONE, b, 9.0));
        assert!(meets(Vec3::splat(1.5), -Vec3::ONE, b, 1e-9));
    }

    #[test]
    fn extreme_directions_cull_nothing_wrongly() {
        let b = Aabb { min: Vec3::new(-1e-30, -1e-30, 1e30), max: Vec3::new(1e-30, 1e-30, 1e30) };
        for d in [Vec3::Z, Vec3::new(1e-45, 0.0, 1.0), Vec3::new(0.0, -1e-42, 3e38), Vec3::new(0.0, 0.0, 1e-45)] {
            assert!(meets(Vec3::ZERO, d, b, f32::INFINITY), "{d}");
        }
        // Where the plane is the origin's, for which an infinite reciprocal would give NaN.
        let b = Aabb { min: Vec3::ZERO, max: Vec3::ZERO };
        for d in
            [Vec3::Z, Vec3::new(0.0, 1.0, 1e-45), Vec3::new(1e-45, -1e-45, 1.0), Vec3::splat(1e-45), Vec3::splat(3e38)]
        {
            assert!(meets(Vec3::ZERO, d, b, f32::INFINITY), "{d}");
        }
    }

    #[test]
    fn a_hit_is_confined_to_its_box() {
        let b = Aabb { min: Vec3::ONE, max: Vec3::splat(2.0) };
        let clamp_to_box = |d, t, t_max| Ray::new(Vec3::ZERO, d).prepare().clamp_to_box(&b, t, t_max);
        assert_eq!(clamp_to_box(Vec3::ONE, 1.5, 2.0), Some(1.5));
        assert_eq!(clamp_to_box(Vec3::ONE, 1.5, 1.5), Some(1.5));
        assert_eq!(clamp_to_box(Vec3::ONE, 1.5, 1.4), None);
        // Outside of the box by rounding, or by nonsense.
        assert_eq!(clamp_to_box(Vec3::ONE, f64::from(1.0_f32.next_down()), 2.0), Some(1.0_f32.next_down()));
        for (nonsense, least) in [(-9.0, 1.0), (9.0, 2.0)] {
            assert!((clamp_to_box(Vec3::ONE, nonsense, 9.0).unwrap() / least - 1.0).abs() < 2e-6);
        }
        assert_eq!(clamp_to_box(-Vec3::ONE, 1.5, 9.0), None);
        assert_eq!(clamp_to_box(Vec3::new(1.0, 1.0, 3.0), 1.5, 9.0), None);
    }

    #[test]
    fn a_hit_on_a_triangle_is_moved_back_no_farther_than_to_its_last_corner() {
        // Left through the top at t = 1.2, while the last corner along the longest axis is at 2.
        let b = Aabb { min: Vec3::X, max: Vec3::new(2.0, 0.9, 2.0) };
        let ray = Ray::new(Vec3::ZERO, Vec3::new(1.0, 0.75, 0.5)).prepare();
        assert_eq!(ray.clamp_to_triangle(&b, 1.5, 9.0), Some(1.5));
        assert_eq!(ray.clamp_to_triangle(&b, 1.5, 1.4), None);
        let last = ray.clamp_to_triangle(&b, 9.0, 9.0).unwrap();
        assert!((2.0..2.0 * (1.0 + 2e-6)).contains(&last), "{last}");
        let first = ray.clamp_to_triangle(&b, -9.0, 9.0).unwrap();
        assert!((1.0 - 1e-6..=1.0).contains(&first), "{first}");
    }
}
