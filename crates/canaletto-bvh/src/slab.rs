//! Rays against boxes: the slab test of Kay and Kajiya, made conservative after Ize, "Robust BVH
//! ray traversal" (2013).
//!
//! Where it goes further, so that the tree agrees with a loop over the primitives bit for bit:
//! - The interval's end is inflated by 16 units in the last place where Ize needs 6; the rest covers the rounding
//!   of a hit's t.
//! - A ray that moves along no axis of the three gives no 0 × ∞ there: on an axis with direction 0 the origin is
//!   compared with the slab, on an axis whose reciprocal would overflow or lose bits nothing is culled.
//! - A kernel that has found a hit passes it through [`Slabs::confine`] with the primitive's own box. Each
//!   rounding is monotone, so a box that holds another gets an interval that holds the other's: what `confine`
//!   lets pass no ancestor in the tree can cull.

use glam::Vec3;

use crate::{Aabb, Ray};

/// How many boxes lie side by side.
pub(crate) const WIDTH: usize = 8;

/// Eight boxes: the lower then the upper planes of x, y and z.
pub(crate) type Boxes = [[[f32; WIDTH]; 3]; 2];

/// 1 + 2⁻²⁰ ≥ 1 + 2γ(3), with slack.
pub(crate) const INFLATE: f32 = 1.0 + 8.0 * f32::EPSILON;
/// What [`Slabs::leaving`] has of it already: so much that its one rounding ends above the two of `confine`.
pub(crate) const LEAVE: f32 = 1.0 + 16.0 * f32::EPSILON;
/// The slack that `confine` leaves to t; `INFLATE * DEFLATE` > 1 also after rounding.
pub(crate) const DEFLATE: f32 = 1.0 - 4.0 * f32::EPSILON;

/// A ray, prepared for boxes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Slabs {
    pub(crate) origin: [f32; 3],
    /// 1 / direction, where that is a normal number.
    pub(crate) reciprocal: [f32; 3],
    /// The reciprocal inflated, for the planes where the ray leaves.
    pub(crate) leaving: [f32; 3],
    /// Which of the planes is met first: 0, the lower, or 1, the upper.
    pub(crate) entry: [u8; 3],
    /// Where these planes lie in [`Boxes`], in bytes.
    pub(crate) entry_rows: [usize; 3],
    motion: [Motion; 3],
    /// All axes are `Crossing`, and the origin is finite.
    pub(crate) regular: bool,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Motion {
    /// The ray crosses the planes at (plane − origin) × reciprocal.
    Crossing,
    /// Direction 0.
    Still,
    /// The direction's reciprocal is no normal number.
    Extreme,
}

impl Motion {
    #[cold]
    fn of(direction: [f32; 3], crosses: [bool; 3]) -> [Motion; 3] {
        [0, 1, 2].map(|axis| match direction[axis] {
            0.0 => Motion::Still,
            _ if crosses[axis] => Motion::Crossing,
            _ => Motion::Extreme,
        })
    }
}

impl Slabs {
    #[inline]
    pub(crate) fn new(ray: &Ray) -> Self {
        let direction = ray.direction.to_array();
        let reciprocal = (Vec3::ONE / ray.direction).to_array();
        let leaving = [reciprocal[0] * LEAVE, reciprocal[1] * LEAVE, reciprocal[2] * LEAVE];
        let crosses = |axis: usize| reciprocal[axis].is_normal() && leaving[axis].is_normal();
        let crosses = [crosses(0), crosses(1), crosses(2)];
        let side = |axis: usize| usize::from(direction[axis] < 0.0);
        let regular = crosses == [true; 3] && ray.origin.is_finite();
        Self {
            origin: ray.origin.to_array(),
            reciprocal,
            leaving,
            entry: [side(0) as u8, side(1) as u8, side(2) as u8],
            entry_rows: [96 * side(0), 96 * side(1) + 32, 96 * side(2) + 64],
            motion: if regular { [Motion::Crossing; 3] } else { Motion::of(direction, crosses) },
            regular,
        }
    }

    /// One bit for each axis along which the ray moves backwards.
    #[inline]
    pub(crate) fn octant(&self) -> usize {
        usize::from(self.entry[0] | self.entry[1] << 1 | self.entry[2] << 2)
    }

    /// Up to where something must be entered to be worth a visit.
    #[inline]
    pub(crate) fn limit(t_max: f32) -> f32 {
        t_max * INFLATE
    }

    /// Where the ray enters and leaves a box, within (0, limit]. It meets the box if entry ≤ exit. For rays that are not
    /// `regular`.
    #[cold]
    #[inline(never)]
    pub(crate) fn clip_carefully(&self, bounds: &Aabb, limit: f32) -> (f32, f32) {
        let mut near = 0.0;
        // No lane without a child may be met, even if no axis culls or the origin is infinite.
        let mut far = if bounds.is_empty() { f32::NEG_INFINITY } else { limit };
        for axis in 0..3 {
            let planes = [bounds.min[axis], bounds.max[axis]];
            let origin = self.origin[axis];
            match self.motion[axis] {
                Motion::Crossing => {
                    let entry = usize::from(self.entry[axis]);
                    near = ((planes[entry] - origin) * self.reciprocal[axis]).max(near);
                    far = ((planes[entry ^ 1] - origin) * self.leaving[axis]).min(far);
                }
                Motion::Still if !(planes[0] <= origin && origin <= planes[1]) => far = f32::NEG_INFINITY,
                Motion::Still | Motion::Extreme => {}
            }
        }
        (near, far)
    }

    /// [`Slabs::clip_carefully`] for a `regular` ray.
    #[inline]
    fn clip_one(&self, bounds: &Aabb) -> (f32, f32) {
        let cross = |axis: usize, plane: f32| (plane - self.origin[axis]) * self.reciprocal[axis];
        let planes = |axis: usize| {
            let (low, high) = (bounds.min[axis], bounds.max[axis]);
            if self.entry[axis] == 0 {
                (cross(axis, low), cross(axis, high))
            } else {
                (cross(axis, high), cross(axis, low))
            }
        };
        let ((n0, f0), (n1, f1), (n2, f2)) = (planes(0), planes(1), planes(2));
        let near = max(max(n0, n1), max(n2, 0.0));
        let far = min(min(f0, f1), min(f2, f32::INFINITY));
        (near, far * INFLATE)
    }

    /// The same for any ray, with the smaller inflation of `clip_one`.
    #[cold]
    #[inline(never)]
    fn clip_one_carefully(&self, bounds: &Aabb) -> (f32, f32) {
        let narrow = Self { leaving: self.reciprocal, ..*self };
        let (near, far) = narrow.clip_carefully(bounds, f32::INFINITY);
        (near, far * INFLATE)
    }

    /// Whether the ray meets a box within (0, t_max], as nodes of trees ask it.
    #[inline]
    pub(crate) fn enters(&self, bounds: &Aabb, t_max: f32) -> bool {
        let limit = Self::limit(t_max);
        if !self.regular {
            let (near, far) = self.clip_carefully(bounds, limit);
            return near <= far;
        }
        let cross = |axis: usize| {
            let (low, high) = (bounds.min[axis] - self.origin[axis], bounds.max[axis] - self.origin[axis]);
            let (first, second) = if self.entry[axis] == 0 { (low, high) } else { (high, low) };
            (first * self.reciprocal[axis], second * self.leaving[axis])
        };
        let ((n0, f0), (n1, f1), (n2, f2)) = (cross(0), cross(1), cross(2));
        max(max(n0, n1), max(n2, 0.0)) <= min(min(f0, f1), min(f2, limit))
    }

    /// The hit at `t` on a primitive, moved into the primitive's own box by no more than rounding explains, unless
    /// `t` is badly conditioned (a grazed triangle); then by as much as it takes. None if the ray misses the box or
    /// the hit lies outside (0, t_max].
    #[inline]
    pub(crate) fn confine(&self, bounds: &Aabb, t: f64, t_max: f32) -> Option<f32> {
        let (near, far) = if self.regular { self.clip_one(bounds) } else { self.clip_one_carefully(bounds) };
        if near > far {
            return None;
        }
        let mut t = (t as f32).min(far);
        if near > 0.0 {
            t = t.max(near * DEFLATE);
        }
        (t > 0.0 && t <= t_max && t < f32::INFINITY).then_some(t)
    }
}

/// Unlike `f32::max`, one instruction: for what is no NaN.
#[inline(always)]
pub(crate) fn max(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// Unlike `f32::min`, one instruction: for what is no NaN.
#[inline(always)]
pub(crate) fn min(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    fn meets(origin: Vec3, direction: Vec3, bounds: Aabb, t_max: f32) -> bool {
        let (near, far) = Slabs::new(&Ray::new(origin, direction)).clip_carefully(&bounds, Slabs::limit(t_max));
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
        let confine = |d, t, t_max| Slabs::new(&Ray::new(Vec3::ZERO, d)).confine(&b, t, t_max);
        assert_eq!(confine(Vec3::ONE, 1.5, 2.0), Some(1.5));
        assert_eq!(confine(Vec3::ONE, 1.5, 1.5), Some(1.5));
        assert_eq!(confine(Vec3::ONE, 1.5, 1.4), None);
        // Outside of the box by rounding, or by nonsense.
        assert_eq!(confine(Vec3::ONE, f64::from(1.0_f32.next_down()), 2.0), Some(1.0_f32.next_down()));
        for (nonsense, least) in [(-9.0, 1.0), (9.0, 2.0)] {
            assert!((confine(Vec3::ONE, nonsense, 9.0).unwrap() / least - 1.0).abs() < 2e-6);
        }
        assert_eq!(confine(-Vec3::ONE, 1.5, 9.0), None);
        assert_eq!(confine(Vec3::new(1.0, 1.0, 3.0), 1.5, 9.0), None);
    }
}
