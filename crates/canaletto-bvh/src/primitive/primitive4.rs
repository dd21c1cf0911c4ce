//! Blocks of four spheres, cylinders and user primitives.

use super::cull::{Candidates, LANES, Rows, UnitRay};
use super::{cylinder4, sphere};
use crate::slab::{DEFLATE, INFLATE};
use crate::{Aabb, PreparedRay, PrimitiveHit};
use glam::{Vec3, Vec4};

/// A primitive of a [`crate::PrimitiveBvh`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Primitive {
    /// A sphere, in [`sphere::bounds`]. Its exact test is [`sphere::intersect`].
    Sphere {
        /// The center.
        center: Vec3,
        /// The radius.
        radius: f32,
    },
    /// A cylinder with or without caps.
    Cylinder {
        /// The ends of the axis.
        ends: [Vec3; 2],
        /// The radius, more than 0.
        radius: f32,
    },
    /// A user primitive. Its [`UserIntersect`] is called whenever a ray enters its box.
    User,
}

/// The callback with the exact test of every primitive that is not a sphere. It returns the nearest hit with 0 < t ≤
/// t_max on a primitive; the `id` in the returned hit is ignored. The hit must lie in the primitive's box in the sense
/// of [`PreparedRay::clamp_to_box`].
pub type UserIntersect<'a> = dyn Fn(UserPrimitive, &PreparedRay, f32) -> Option<PrimitiveHit> + 'a;

/// The callback that tells whether a hit on the primitive with an id counts. Queries call it through a pointer, so that
/// they are compiled once.
pub type FilterFunction<'a> = dyn FnMut(u32) -> bool + 'a;

/// The primitive that a [`UserIntersect`] is called for.
#[derive(Clone, Copy, Debug)]
pub struct UserPrimitive {
    /// The primitive's id.
    pub id: u32,
    /// The ends of a cylinder's axis.
    pub ends: [Vec3; 2],
    /// A cylinder's radius.
    pub radius: f32,
}

/// A primitive of a block, unpacked for the packet tests.
pub(crate) enum UnpackedPrimitive {
    Sphere([f32; 3], f32),
    Cylinder([[f32; 3]; 2], f32),
    /// A user primitive, by its box.
    User(Aabb),
}

/// Up to four primitives side by side. A ray that misses a block of spheres reads its first half only.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub(crate) struct Primitive4 {
    /// The centers of spheres, the first ends of cylinders, or the lower corners of user primitives' boxes.
    base: Rows,
    /// The radius of a sphere, the negated radius of a cylinder, or NaN for a user primitive.
    radius: Vec4,
    /// The other ends of cylinders, or the upper corners of user primitives' boxes.
    top: Rows,
    pub(crate) ids: [u32; LANES],
}

impl Primitive4 {
    pub(crate) fn new(primitives: impl Iterator<Item = (u32, Aabb, Primitive)>) -> Self {
        let (zero, ids) = ([Vec4::ZERO; 3], [u32::MAX; LANES]);
        let mut block = Self { base: zero, radius: Vec4::ZERO, top: zero, ids };
        for (lane, (id, bounds, primitive)) in primitives.enumerate() {
            block.ids[lane] = id;
            let ([base, top], radius) = match primitive {
                // A sphere without a radius is never hit.
                Primitive::Sphere { center, radius } => ([center; 2], if radius > 0.0 { radius } else { 0.0 }),
                Primitive::Cylinder { ends, radius } if radius > 0.0 => (ends, -radius),
                Primitive::Cylinder { .. } | Primitive::User => ([bounds.min, bounds.max], f32::NAN),
            };
            for axis in 0..3 {
                (block.base[axis][lane], block.top[axis][lane]) = (base[axis], top[axis]);
            }
            block.radius[lane] = radius;
        }
        block
    }

    /// The lanes that hold a primitive.
    #[inline(always)]
    pub(crate) fn filled(&self) -> u32 {
        let bit = |lane: usize| u32::from(self.ids[lane] != u32::MAX) << lane;
        bit(0) | bit(1) | bit(2) | bit(3)
    }

    /// Whether the block holds only spheres and cylinders.
    pub(crate) fn has_shapes_only(&self) -> bool {
        !self.radius.is_nan()
    }

    /// The lanes with cylinders.
    #[inline(always)]
    fn cylinders(&self) -> u32 {
        self.radius.cmplt(Vec4::ZERO).bitmask()
    }

    #[inline(always)]
    fn cull_cylinders(&self, ray: &UnitRay, t_max: f32) -> Candidates {
        cylinder4::cull(&self.base, &self.top, -self.radius, ray, t_max)
    }

    /// The lanes with user primitives.
    #[inline(always)]
    fn user_lanes(&self) -> u32 {
        self.radius.is_nan_mask().bitmask()
    }

    /// Culls user primitives by their boxes. The test agrees with [`PreparedRay::clamp_to_box`], which keeps their hits
    /// in the boxes.
    #[inline(always)]
    fn cull_boxes(&self, ray: &PreparedRay, t_max: f32) -> Candidates {
        if !ray.regular {
            return Candidates { lanes: u32::MAX, near: [0.0; LANES] };
        }
        let (mut near, mut far) = (Vec4::ZERO, Vec4::INFINITY);
        for axis in 0..3 {
            let (origin, neg_reciprocal) = (Vec4::splat(ray.ray.origin[axis]), ray.neg_reciprocal[axis]);
            let (low, high) = ((origin - self.base[axis]) * neg_reciprocal, (origin - self.top[axis]) * neg_reciprocal);
            (near, far) = (near.max(low.min(high)), far.min(low.max(high)));
        }
        let before = near * DEFLATE;
        let lanes = near.cmple(far * INFLATE) & before.cmple(Vec4::splat(t_max));
        Candidates { lanes: lanes.bitmask(), near: before.to_array() }
    }

    /// The primitives of the filled lanes that may be hit before `t_max`.
    #[inline(always)]
    pub(crate) fn cull(&self, filled: u32, ray: &PreparedRay, unit_ray: &UnitRay, t_max: f32) -> Candidates {
        let user_lanes = filled & self.user_lanes();
        let candidates = self.cull_shapes(filled & !user_lanes, unit_ray, t_max);
        if user_lanes == 0 { candidates } else { candidates.union(self.cull_boxes(ray, t_max).masked(user_lanes)) }
    }

    /// [`Primitive4::cull`] for spheres and cylinders only.
    #[inline(always)]
    pub(crate) fn cull_shapes(&self, filled: u32, unit_ray: &UnitRay, t_max: f32) -> Candidates {
        let cylinders = filled & self.cylinders();
        let spheres = filled & !cylinders;
        let mut candidates = Candidates::NONE;
        if spheres != 0 {
            candidates = sphere::cull(&self.base, self.radius, unit_ray, t_max).masked(spheres);
        }
        if cylinders != 0 {
            candidates = candidates.union(self.cull_cylinders(unit_ray, t_max).masked(cylinders));
        }
        candidates
    }

    /// [`Primitive4::cull`] for any-hit rays: the lanes that may be hit, and those that certainly are.
    #[inline(always)]
    pub(crate) fn cull_any(&self, filled: u32, ray: &PreparedRay, unit_ray: &UnitRay, t_max: f32) -> (u32, u32) {
        let user_lanes = filled & self.user_lanes();
        let (mut lanes, surely) = self.cull_any_shapes(filled & !user_lanes, unit_ray, t_max);
        if user_lanes != 0 {
            lanes |= self.cull_boxes(ray, t_max).lanes & user_lanes;
        }
        (lanes, surely)
    }

    /// [`Primitive4::cull_any`] for spheres and cylinders only.
    #[inline(always)]
    pub(crate) fn cull_any_shapes(&self, filled: u32, unit_ray: &UnitRay, t_max: f32) -> (u32, u32) {
        let cylinders = filled & self.cylinders();
        let spheres = filled & !cylinders;
        let (mut lanes, mut surely) = (0, 0);
        if spheres != 0 {
            (lanes, surely) = sphere::cull_any(&self.base, self.radius, unit_ray, t_max);
            (lanes, surely) = (lanes & spheres, surely & spheres);
        }
        if cylinders != 0 {
            lanes |= self.cull_cylinders(unit_ray, t_max).lanes & cylinders;
        }
        (lanes, surely)
    }

    /// The primitive in a lane, for the packet tests.
    #[inline(always)]
    pub(crate) fn unpack(&self, lane: usize) -> UnpackedPrimitive {
        // As arrays: indexing vectors would select by an unpredictable branch.
        let at = |row: &Vec4| row.as_ref()[lane & (LANES - 1)];
        let point = |[x, y, z]: &Rows| [at(x), at(y), at(z)];
        let (base, radius) = (point(&self.base), at(&self.radius));
        if radius >= 0.0 {
            return UnpackedPrimitive::Sphere(base, radius);
        }
        let top = point(&self.top);
        if radius < 0.0 {
            return UnpackedPrimitive::Cylinder([base, top], -radius);
        }
        UnpackedPrimitive::User(Aabb { min: base.into(), max: top.into() })
    }

    /// The hit by the exact test.
    #[inline(always)]
    pub(crate) fn intersect(
        &self,
        lane: usize,
        ray: &PreparedRay,
        t_max: f32,
        user: &UserIntersect,
    ) -> Option<PrimitiveHit> {
        // As arrays: indexing vectors would select by an unpredictable branch.
        let at = |row: &Vec4| row.as_ref()[lane & (LANES - 1)];
        let point = |[x, y, z]: &Rows| Vec3::new(at(x), at(y), at(z));
        let (base, radius) = (point(&self.base), at(&self.radius));
        if radius >= 0.0 {
            return sphere::intersect_inline(ray, base, radius, t_max).map(PrimitiveHit::none);
        }
        let top = point(&self.top);
        user(UserPrimitive { id: self.ids[lane], ends: [base, top], radius: -radius }, ray, t_max)
    }

    /// Tests the primitive in this lane exactly and stores it in `nearest` if it is nearer. Returns whether it is.
    #[inline(always)]
    pub(crate) fn accept_if_nearer(
        &self,
        lane: usize,
        ray: &PreparedRay,
        nearest: &mut PrimitiveHit,
        user: &UserIntersect,
    ) -> bool {
        let id = self.ids[lane];
        // The callback may have ignored `nearest.t`.
        if let Some(hit) = self.intersect(lane, ray, nearest.t, user)
            && (hit.t < nearest.t || hit.t == nearest.t && id < nearest.id)
        {
            *nearest = PrimitiveHit { id, ..hit };
            return true;
        }
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Ray;
    use crate::testing::Random;

    #[test]
    fn what_is_surely_met_hides_nothing_that_may_count_in_its_place() {
        let at = |z: f32| Aabb { min: Vec3::new(-1.0, -1.0, z - 1.0), max: Vec3::new(1.0, 1.0, z + 1.0) };
        let sphere = Primitive::Sphere { center: -Vec3::Z * 5.0, radius: 1.0 };
        let cylinder =
            Primitive::Cylinder { ends: [Vec3::new(-1.0, 0.0, -9.0), Vec3::new(1.0, 0.0, -9.0)], radius: 1.0 };
        let all = [(0, at(-5.0), sphere), (1, at(-9.0), cylinder), (2, at(-20.0), Primitive::User)];
        let ray = Ray::new(Vec3::ZERO, -Vec3::Z).prepare();
        let candidates = Primitive4::new(all.into_iter()).cull_any(0b111, &ray, &UnitRay::new(&ray.ray), f32::INFINITY);
        assert_eq!(candidates, (0b111, 0b001));
    }

    #[test]
    fn hits_lie_in_boxes_that_are_not_sorted_out() {
        let random = &mut Random(53);
        let (mut culled, mut missed, mut met) = (0, 0, 0);
        for i in 0..200_000 {
            let scale = [1.0, 1e-30, 1e30][i % 3];
            let boxes: [Aabb; LANES] = std::array::from_fn(|_| {
                let (a, b) = (random.vector(), random.vector() * [1.0, 0.01, 0.0][random.below(3)]);
                Aabb { min: a.min(a + b) * scale, max: a.max(a + b) * scale }
            });
            // Some rays run along axes, and some start on a box or in it.
            let target = boxes[random.below(LANES)];
            let origin = [random.vector() * 2.0 * scale, target.min, target.center()][random.below(3)];
            let mut direction = [random.vector() * scale, target.max - origin][random.below(2)];
            direction[random.below(3)] *= [1.0, 0.0][random.below(2)];
            let ray = Ray::new(origin, direction).prepare();
            let block = Primitive4::new((0..).zip(boxes).map(|(id, bounds)| (id, bounds, Primitive::User)));
            let t = random.signed().abs() * 2.0;
            let t_max = [f32::INFINITY, t, t * 0.5][random.below(3)];
            let Candidates { lanes, near } = block.cull(0b1111, &ray, &UnitRay::new(&ray.ray), t_max);
            assert_eq!(block.cull_any(0b1111, &ray, &UnitRay::new(&ray.ray), t_max), (lanes, 0));
            for (lane, bounds) in boxes.iter().enumerate() {
                let (passed, hit) = (lanes >> lane & 1 == 0, ray.clamp_to_box(bounds, t.into(), t_max));
                let what = format!("{ray:?} {bounds:?} {t} {t_max}");
                assert!(hit.is_none_or(|t| !passed && near[lane] <= t), "{hit:?} {what}");
                culled += usize::from(passed);
                missed += usize::from(ray.regular && !ray.enters(bounds, t_max));
                met += usize::from(hit.is_some());
            }
        }
        assert!(met > 20_000 && culled == missed, "{met}, {culled} of {missed}");
    }

    #[test]
    fn what_is_sorted_out_is_missed_and_what_is_surely_met_is_met() {
        let random = &mut Random(43);
        let (mut culled, mut missed, mut surely_met, mut met) = (0, 0, 0, 0);
        for i in 0..400_000 {
            // Spheres from large ones nearby to dots far away, of all magnitudes. Rays are aimed beside, on and next to
            // their rims, and some start on them or inside.
            let far = random.vector() * 10f32.powi(random.below(6) as i32 - 1);
            let radius = random.signed().abs() * [1.0, 1e-2, 1e-4][i % 3];
            let aside = random.vector().normalize();
            let off = [1.0, 1.0 + random.signed() * 10f32.powi(-(random.below(8) as i32)), random.signed()];
            let target = far + aside * radius * off[random.below(3)];
            let origin = [random.vector(), Vec3::ZERO, random.vector() * 1e-3, far + random.vector() * radius];
            let origin = origin[random.below(4)];
            let mut direction = target - origin;
            if random.below(2) == 0 {
                // Perpendicular to the direction to the rim: tangents.
                direction = direction.cross(aside).cross(aside);
            }
            direction[random.below(3)] *= [1.0, 1.0, 0.0, 1e-20, 1e-39][random.below(5)];
            let scale = 10f32.powi(random.below(60) as i32 - 30);
            let ray = Ray::new(origin * scale, direction * [1.0, scale][i % 2]).prepare();
            let (center, radius) = (far * scale, radius * scale);
            let all = sphere::intersect(&ray, center, radius, f32::INFINITY);
            let t = all.unwrap_or(1.0);
            let t_max = [f32::INFINITY, t, t.next_down(), t * 2.0, t * 0.5][random.below(5)];
            let block = Primitive4::new(std::iter::once((0, Aabb::EMPTY, Primitive::Sphere { center, radius })));
            let (unit_ray, exactly) = (UnitRay::new(&ray.ray), all.is_some_and(|t| t <= t_max));
            let Candidates { lanes, near } = block.cull(1, &ray, &unit_ray, t_max);
            let (any, surely) = block.cull_any(1, &ray, &unit_ray, t_max);
            assert!(!exactly || lanes & any & 1 == 1, "{ray:?} {center} {radius} {t_max}");
            assert!(!exactly || near[0].is_nan() || near[0] <= t, "{ray:?} {center} {radius} {near:?}");
            assert!(exactly || surely & 1 == 0, "{ray:?} {center} {radius} {t_max}");
            culled += usize::from(lanes & 1 == 0);
            missed += usize::from(!exactly);
            surely_met += surely as usize & 1;
            met += usize::from(exactly);
        }
        assert!(missed / 4 < culled && culled < missed, "{culled} of {missed}");
        assert!(met / 10 < surely_met && surely_met < met, "{surely_met} of {met}");
    }
}
