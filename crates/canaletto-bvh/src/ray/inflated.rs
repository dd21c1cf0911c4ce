//! Rays with a margin, for trees in spaces into which rays are transformed with rounding. A box near the ray counts as
//! entered.

use crate::{Aabb, PreparedRay, Ray};
use glam::Vec3;

/// A ray that enters a box if it comes within a margin of the box along each axis.
#[derive(Clone, Copy, Debug)]
pub struct InflatedRay {
    pub(crate) ray: PreparedRay,
    /// The origins for the entry planes and for the exit planes. Moving a plane by the margin is equivalent to moving
    /// the origin by the margin in the opposite direction.
    pub(crate) origins: [[f32; 3]; 2],
    margin: f32,
}

impl InflatedRay {
    /// The ray with a margin, which is not negative. The margin should be larger than a few roundings of the origin and
    /// of the boxes. With an infinite margin every box is entered; with a NaN margin, none.
    #[inline]
    pub fn new(ray: &Ray, margin: f32) -> InflatedRay {
        let ahead = Vec3::select(ray.direction.cmplt(Vec3::ZERO), Vec3::splat(-margin), Vec3::splat(margin));
        let origins = [ray.origin + ahead, ray.origin - ahead].map(|origin| origin.to_array());
        InflatedRay { ray: ray.prepare(), origins, margin }
    }

    /// Whether the ray enters a box within (0, t_max], by the conservative test of the trees: true in doubt.
    #[inline]
    pub fn enters(&self, bounds: &Aabb, t_max: f32) -> bool {
        self.ray.enters(&self.inflate(bounds), t_max)
    }

    pub(crate) fn inflate(&self, bounds: &Aabb) -> Aabb {
        let margin = Vec3::splat(self.margin);
        Aabb { min: bounds.min - margin, max: bounds.max + margin }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Random;
    use crate::{Bvh, InstructionSet, Leaf};

    /// A ray with a margin enters the boxes that a ray without margin, moved by at most the margin, enters, and few
    /// more.
    #[test]
    fn what_lies_within_the_margin_is_met() {
        let random = &mut Random(61);
        let mut counts = [0; 3];
        for round in 0..60 {
            let bounds: Vec<Aabb> = (0..200)
                .map(|_| {
                    let min = random.vector() * 4.0;
                    Aabb { min, max: min + random.vector().abs() * 0.2 }
                })
                .collect();
            let bvh = Bvh::build(&bounds).unwrap();
            for n in 0..50 {
                let mut direction = random.vector();
                if n % 5 == 0 {
                    direction[n % 3] = [0.0, 1e-42][n % 2];
                }
                let ray = Ray::new(random.vector() * 5.0, direction);
                let margin = [0.0, 0.01, 0.3][round % 3];
                let (wide, t_max) = (InflatedRay::new(&ray, margin), [f32::INFINITY, 2.0][n % 2]);
                let mut met: Option<Vec<u32>> = None;
                for set in InstructionSet::available() {
                    set.limit();
                    let [mut closest, mut any] = [const { Vec::new() }; 2];
                    let ids = |leaf: Leaf| leaf.slots().map(|slot| bvh.order()[slot as usize]);
                    bvh.intersect_inflated(&wide, t_max, |leaf, _| closest.extend(ids(leaf)));
                    assert!(!bvh.occluded_inflated(&wide, t_max, |leaf| {
                        any.extend(ids(leaf));
                        false
                    }));
                    closest.sort_unstable();
                    any.sort_unstable();
                    assert_eq!(closest, any);
                    assert_eq!(met.get_or_insert_with(|| closest.clone()), &closest, "{set:?}");
                }
                let met = met.unwrap();
                let moved = random.vector().clamp(Vec3::NEG_ONE, Vec3::ONE) * margin * 0.999;
                let beside = Ray::new(ray.origin + moved, direction).prepare();
                for (id, b) in bounds.iter().enumerate() {
                    let found = met.binary_search(&(id as u32)).is_ok();
                    assert!(found || !beside.enters(b, t_max), "{ray:?} {b:?} {margin}");
                    assert_eq!(found, wide.enters(b, t_max));
                    counts[0] += usize::from(found);
                    counts[1] += usize::from(wide.enters(b, t_max));
                    counts[2] += usize::from(ray.prepare().enters(b, t_max));
                }
            }
        }
        assert!(counts[0] == counts[1] && counts[1] > 4 * counts[2] && counts[2] > 100, "{counts:?}");
    }
}
