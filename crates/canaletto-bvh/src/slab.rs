//! The slab test of rays against boxes, after Kay and Kajiya, made conservative after Ize, "Robust BVH ray traversal"
//! (2013).
//!
//! It goes further than Ize, so that the tree agrees with a loop over the primitives bit for bit:
//! - The end of the interval is inflated by 16 units in the last place where Ize needs 6. The rest covers the rounding
//!   of a hit's t.
//! - An axis with a zero direction gives no 0 × ∞: there the origin is compared with the slab. An axis whose reciprocal
//!   would overflow or lose bits culls nothing.
//! - A kernel that has found a hit passes it through [`PreparedRay::clamp_to_box`] with the primitive's own box. Each
//!   rounding is monotone, so the interval of an enclosing box contains that of the enclosed box. No ancestor in the
//!   tree can therefore cull a hit that `clamp_to_box` accepts.

use glam::Vec3;

use crate::min_max::{max, min};
use crate::{Aabb, PreparedRay};

/// The number of boxes side by side.
pub(crate) const WIDTH: usize = 8;

/// Eight boxes: the lower planes of x, y and z, then the upper planes.
pub(crate) type Boxes = [[[f32; WIDTH]; 3]; 2];

/// The factor of a box interval's end: 1 + 2⁻²⁰ ≥ 1 + 2γ(3), with slack.
pub(crate) const INFLATE: f32 = 1.0 + 8.0 * f32::EPSILON;
/// The factor for a box interval's start: the slack that `clamp_to_box` leaves to t. `INFLATE * DEFLATE` > 1 also after
/// rounding.
pub(crate) const DEFLATE: f32 = 1.0 - 4.0 * f32::EPSILON;

/// The largest entry distance at which a box is still visited. It is −∞ for a NaN `t_max`, so that no box is visited.
#[inline]
pub(crate) fn cull_limit(t_max: f32) -> f32 {
    max(t_max * INFLATE, f32::NEG_INFINITY)
}

impl PreparedRay {
    /// The interval in which the ray is inside a box, within (0, limit]. The ray enters the box if entry ≤ exit. This
    /// version is for rays that are not `regular`.
    #[cold]
    #[inline(never)]
    pub(crate) fn clip_irregular(&self, bounds: &Aabb, limit: f32) -> (f32, f32) {
        let mut near = 0.0;
        // A lane without a child must never be entered, even if no axis culls or the origin is infinite. A ray with NaN
        // enters no box.
        let nothing = bounds.is_empty() || self.ray.origin.is_nan() || self.ray.direction.is_nan();
        let mut far = if nothing { f32::NEG_INFINITY } else { f32::INFINITY };
        for axis in 0..3 {
            let (low, high, origin) = (bounds.min[axis], bounds.max[axis], self.ray.origin[axis]);
            let neg_reciprocal = self.neg_reciprocal[axis];
            if self.ray.direction[axis] == 0.0 {
                if !(low <= origin && origin <= high) {
                    far = f32::NEG_INFINITY;
                }
            } else if neg_reciprocal.is_normal() {
                let (first, second) = if self.axis_order.octant >> axis & 1 == 0 { (low, high) } else { (high, low) };
                near = ((origin - first) * neg_reciprocal).max(near);
                far = ((origin - second) * neg_reciprocal).min(far);
            }
        }
        (near, (far * INFLATE).min(limit))
    }

    /// [`PreparedRay::clip_irregular`] for a `regular` ray, without a limit.
    #[inline]
    fn clip_regular(&self, bounds: &Aabb) -> (f32, f32) {
        clip_regular(self.ray.origin, self.neg_reciprocal, bounds)
    }

    /// The interval in which the ray is inside a box, if it enters the box.
    #[inline]
    fn clip(&self, bounds: &Aabb) -> Option<(f32, f32)> {
        let (near, far) =
            if self.regular { self.clip_regular(bounds) } else { self.clip_irregular(bounds, f32::INFINITY) };
        if near <= far { Some((near, far)) } else { None }
    }

    /// Whether the ray enters a box within (0, t_max], by the conservative test of the trees: true in doubt. An empty
    /// box and a box with a NaN coordinate are never entered.
    #[inline]
    pub fn enters(&self, bounds: &Aabb, t_max: f32) -> bool {
        let limit = cull_limit(t_max);
        let (near, far) = if self.regular { self.clip_regular(bounds) } else { self.clip_irregular(bounds, limit) };
        near <= far && near <= limit && !bounds.is_empty()
    }

    /// The hit at `t` on a primitive in this box, moved into the box so that no tree over such boxes can lose it. The
    /// move is no larger than rounding explains, unless `t` is badly conditioned (a grazed triangle); then it is as
    /// large as necessary. `None` if the ray misses the box or the hit lies outside (0, t_max].
    #[inline]
    pub fn clamp_to_box(&self, bounds: &Aabb, t: f64, t_max: f32) -> Option<f32> {
        let (near, far) = self.clip(bounds).filter(|_| !bounds.is_empty())?;
        let t = clamp((near, far), t as f32);
        (t > 0.0 && t <= t_max && t < f32::INFINITY).then_some(t)
    }

    /// [`PreparedRay::clamp_to_box`] for loops over many rays: NaN for a miss. The ray is regular
    /// ([`PreparedRay::is_regular`]), and the box isn't empty. `neg_reciprocal` is −1 / direction.
    #[inline(always)]
    pub fn clamp_regular(origin: Vec3, neg_reciprocal: [f32; 3], bounds: &Aabb, t: f32, t_max: f32) -> f32 {
        let (near, far) = clip_regular(origin, neg_reciprocal, bounds);
        let t = clamp((near, far), t);
        let is_hit = (near <= far) & (t > 0.0) & (t <= t_max) & (t < f32::INFINITY);
        if is_hit { t } else { f32::NAN }
    }

    /// Whether a ray is regular: its origin is finite, and −1 / direction consists of normal numbers.
    #[inline(always)]
    pub fn is_regular(origin: Vec3, neg_reciprocal: [f32; 3]) -> bool {
        let is_normal = |v: f32| (v.abs() >= f32::MIN_POSITIVE) & (v.abs() < f32::INFINITY);
        let [x, y, z] = neg_reciprocal;
        let is_finite =
            (origin.x.abs() < f32::INFINITY) & (origin.y.abs() < f32::INFINITY) & (origin.z.abs() < f32::INFINITY);
        is_finite & is_normal(x) & is_normal(y) & is_normal(z)
    }
}

/// The interval in which a regular ray is inside a box.
#[inline(always)]
fn clip_regular(origin: Vec3, neg_reciprocal: [f32; 3], bounds: &Aabb) -> (f32, f32) {
    let cross = |axis: usize, plane: f32| (origin[axis] - plane) * neg_reciprocal[axis];
    // The nearer plane is the one with the smaller product.
    let planes = |axis: usize| {
        let (low, high) = (cross(axis, bounds.min[axis]), cross(axis, bounds.max[axis]));
        (min(low, high), max(low, high))
    };
    let ((n0, f0), (n1, f1), (n2, f2)) = (planes(0), planes(1), planes(2));
    let near = max(max(n0, n1), max(n2, 0.0));
    let far = min(min(f0, f1), min(f2, f32::INFINITY));
    (near, far * INFLATE)
}

/// `t` moved into an interval of a box. With these argument orders a NaN `t` stays NaN, which is no hit.
#[inline(always)]
fn clamp((near, far): (f32, f32), t: f32) -> f32 {
    max(near * DEFLATE, min(far, t))
}

impl PreparedRay {
    /// [`PreparedRay::clamp_to_box`] for a triangle, whose t leads to one of its points as closely as
    /// [`crate::triangle`] proves. Here t is moved back only to the farthest corner along the longest axis. A shorter
    /// axis could move it arbitrarily far, off the triangle's other parts.
    #[inline]
    pub(crate) fn clamp_to_triangle(&self, bounds: &Aabb, t: f64, t_max: f32) -> Option<f32> {
        let (near, _) = self.clip(bounds)?;
        let longest = self.axis_order.rows[2];
        let cross = |corner: &Vec3| (self.origin(longest) - longest.of(corner)) * self.along;
        let last = max(cross(&bounds.min), cross(&bounds.max)) * INFLATE;
        let mut t = t as f32;
        // For a ray that is not regular, `last` is NaN and moves nothing.
        if t > last {
            t = last;
        }
        // A NaN `t` stays NaN, which is no hit.
        t = max(near * DEFLATE, t);
        (t >= f32::MIN_POSITIVE && t <= t_max && t < f32::INFINITY).then_some(t)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Ray;

    fn meets(origin: Vec3, direction: Vec3, bounds: Aabb, t_max: f32) -> bool {
        let (near, far) = Ray::new(origin, direction).prepare().clip_irregular(&bounds, cull_limit(t_max));
        assert!(!near.is_nan() && !far.is_nan());
        assert_eq!(Ray::new(origin, direction).prepare().enters(&bounds, t_max), near <= far);
        near <= far
    }

    #[test]
    fn planes_of_a_box_belong_to_it() {
        let b = Aabb { min: Vec3::ZERO, max: Vec3::ONE };
        // Rays along a face, an edge and through a corner, on either side. −0 counts as 0.
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
        // The plane contains the origin, where an infinite reciprocal would give NaN.
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
        // A t outside of the box by rounding, or by nonsense.
        assert_eq!(clamp_to_box(Vec3::ONE, f64::from(1.0_f32.next_down()), 2.0), Some(1.0_f32.next_down()));
        for (nonsense, least) in [(-9.0, 1.0), (9.0, 2.0)] {
            assert!((clamp_to_box(Vec3::ONE, nonsense, 9.0).unwrap() / least - 1.0).abs() < 2e-6);
        }
        assert_eq!(clamp_to_box(-Vec3::ONE, 1.5, 9.0), None);
        assert_eq!(clamp_to_box(Vec3::new(1.0, 1.0, 3.0), 1.5, 9.0), None);
    }

    #[test]
    fn a_hit_on_a_triangle_is_moved_back_no_farther_than_to_its_last_corner() {
        // The ray leaves through the top at t = 1.2, while the last corner along the longest axis is at 2.
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
