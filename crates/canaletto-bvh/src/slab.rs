//! Rays against boxes, four at a time: the slab test of Kay and Kajiya, made conservative after Ize, "Robust BVH
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

use glam::Vec4;

use crate::{Aabb, Ray};

/// Four boxes: the lower then the upper planes of x, y and z.
pub(crate) type Boxes = [[Vec4; 3]; 2];

/// 1 + 2⁻²⁰ ≥ 1 + 2γ(3), with slack.
const INFLATE: f32 = 1.0 + 8.0 * f32::EPSILON;
/// The slack that `confine` leaves to t; `INFLATE * DEFLATE` > 1 also after rounding.
const DEFLATE: f32 = 1.0 - 4.0 * f32::EPSILON;

/// A ray, prepared for boxes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Slabs {
    /// The origin, each coordinate four times.
    origin: [Vec4; 3],
    /// 1 / direction, likewise, where that is a normal number.
    reciprocal: [Vec4; 3],
    /// Which of the planes is met first: 0, the lower, or 1, the upper.
    entry: [usize; 3],
    motion: [Motion; 3],
    /// All axes are `Crossing`, and the origin is finite.
    regular: bool,
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
    fn of(direction: [f32; 3], reciprocal: [f32; 3]) -> [Motion; 3] {
        [0, 1, 2].map(|axis| match direction[axis] {
            0.0 => Motion::Still,
            _ if reciprocal[axis].is_normal() => Motion::Crossing,
            _ => Motion::Extreme,
        })
    }
}

impl Slabs {
    #[inline]
    pub(crate) fn new(ray: &Ray) -> Self {
        let direction = ray.direction.to_array();
        let reciprocal = (Vec4::ONE / ray.direction.extend(1.0)).truncate().to_array();
        let regular = reciprocal.iter().all(|r| r.is_normal()) && ray.origin.is_finite();
        Self {
            origin: ray.origin.to_array().map(Vec4::splat),
            reciprocal: reciprocal.map(Vec4::splat),
            entry: direction.map(|d| usize::from(d < 0.0)),
            motion: if regular { [Motion::Crossing; 3] } else { Motion::of(direction, reciprocal) },
            regular,
        }
    }

    /// The origin's coordinate along an axis, four times.
    #[inline]
    pub(crate) fn origin(&self, axis: usize) -> Vec4 {
        self.origin[axis]
    }

    /// Where the ray enters and leaves four boxes, within (0, t_max]. It meets a box if entry ≤ exit.
    #[inline]
    pub(crate) fn clip(&self, boxes: &Boxes, t_max: f32) -> (Vec4, Vec4) {
        if !self.regular {
            return self.clip_carefully(boxes, t_max);
        }
        let (n0, f0) = self.cross(boxes, 0);
        let (n1, f1) = self.cross(boxes, 1);
        let (n2, f2) = self.cross(boxes, 2);
        let near = n0.max(n1).max(n2.max(Vec4::ZERO));
        let far = f0.min(f1).min(f2.min(Vec4::splat(t_max)));
        (near, far * INFLATE)
    }

    #[inline]
    fn cross(&self, boxes: &Boxes, axis: usize) -> (Vec4, Vec4) {
        let entry = self.entry[axis] & 1;
        let (origin, reciprocal) = (self.origin[axis], self.reciprocal[axis]);
        ((boxes[entry][axis] - origin) * reciprocal, (boxes[entry ^ 1][axis] - origin) * reciprocal)
    }

    #[cold]
    #[inline(never)]
    fn clip_carefully(&self, boxes: &Boxes, t_max: f32) -> (Vec4, Vec4) {
        let mut near = Vec4::ZERO;
        // No lane without a child may be met, even if no axis culls or the origin is infinite.
        let mut far = Vec4::select(boxes[0][0].cmple(boxes[1][0]), Vec4::splat(t_max), Vec4::NEG_INFINITY);
        for axis in 0..3 {
            match self.motion[axis] {
                Motion::Crossing => {
                    let (n, f) = self.cross(boxes, axis);
                    near = near.max(n);
                    far = far.min(f);
                }
                Motion::Still => {
                    let origin = self.origin[axis];
                    let inside = boxes[0][axis].cmple(origin) & origin.cmple(boxes[1][axis]);
                    far = Vec4::select(inside, far, Vec4::NEG_INFINITY);
                }
                Motion::Extreme => {}
            }
        }
        (near, far * INFLATE)
    }

    /// [`Slabs::clip`] for a single box and any t, the same numbers.
    #[inline]
    fn clip_one(&self, bounds: &Aabb) -> (f32, f32) {
        let [n, f] = [0, 1].map(|side| {
            let at = |axis: usize| {
                let plane = if self.entry[axis] == side { bounds.min[axis] } else { bounds.max[axis] };
                (plane - self.origin[axis].x) * self.reciprocal[axis].x
            };
            [at(0), at(1), at(2)]
        });
        // Unlike f32::max, one instruction: there is no NaN here.
        let max = |a: f32, b: f32| if a > b { a } else { b };
        let min = |a: f32, b: f32| if a < b { a } else { b };
        let near = max(max(n[0], n[1]), max(n[2], 0.0));
        let far = min(min(f[0], f[1]), min(f[2], f32::INFINITY));
        (near, far * INFLATE)
    }

    #[cold]
    #[inline(never)]
    fn clip_one_carefully(&self, bounds: &Aabb) -> (f32, f32) {
        let boxes = [bounds.min.to_array().map(Vec4::splat), bounds.max.to_array().map(Vec4::splat)];
        let (near, far) = self.clip_carefully(&boxes, f32::INFINITY);
        (near.x, far.x)
    }

    /// Whether something entered at `near` is still worth a visit.
    #[inline]
    pub(crate) fn within(near: f32, t_max: f32) -> bool {
        near <= t_max * INFLATE
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

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    fn meets(origin: Vec3, direction: Vec3, bounds: Aabb, t_max: f32) -> bool {
        let boxes = [bounds.min.to_array().map(Vec4::splat), bounds.max.to_array().map(Vec4::splat)];
        let (near, far) = Slabs::new(&Ray::new(origin, direction)).clip(&boxes, t_max);
        assert!(!near.is_nan() && !far.is_nan());
        near.x <= far.x
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
