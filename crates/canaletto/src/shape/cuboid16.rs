//! Sixteen rays against one box.
//!
//! The results are those of [`Cuboid::intersect`] and [`PreparedRay::clamp_to_box`], bit for bit.

use super::Cuboid;
use canaletto_bvh::{InstructionSet, Kernel, PreparedRay, Ray};
use glam::Vec3;

/// The most rays that are tested at once.
pub(crate) const CUBOID_RAYS: usize = 16;

type Row<T> = [T; CUBOID_RAYS];

/// The hits of rays on a box.
pub(crate) struct CuboidHits {
    /// For each ray the t of its hit up to its `t_max`; NaN for a miss.
    pub(crate) t: Row<f32>,
    /// The numbers of the faces that are hit.
    pub(crate) face: Row<u32>,
    /// A bit for each ray that is hit, and for each ray that isn't regular. The latter has to be tested by itself.
    pub(crate) hit: u32,
    pub(crate) irregular: u32,
}

/// Finds the hits by the box's slabs (Kay & Kajiya 1986).
struct IntersectMany<'a> {
    cuboid: &'a Cuboid,
    origin: [Row<f32>; 3],
    direction: [Row<f32>; 3],
    t_max: Row<f32>,
}

impl Kernel for IntersectMany<'_> {
    type Answer = CuboidHits;

    // Each loop writes to arrays of one type. The compiler vectorises no other loops.
    #[inline(always)]
    fn run(self) -> CuboidHits {
        let IntersectMany { cuboid, origin, direction, t_max } = self;
        let (mut enter, mut leave) = ([f64::NEG_INFINITY; CUBOID_RAYS], [f64::INFINITY; CUBOID_RAYS]);
        let (mut first, mut last) = ([0.0; CUBOID_RAYS], [0.0; CUBOID_RAYS]);
        for axis in 0..3 {
            let (min, max) = (f64::from(cuboid.min[axis]), f64::from(cuboid.max[axis]));
            let (lower, upper) = (2.0 * axis as f64, 2.0 * axis as f64 + 1.0);
            for i in 0..CUBOID_RAYS {
                let (o, d) = (f64::from(origin[axis][i]), f64::from(direction[axis][i]));
                let (low, high) = ((min - o) / d, (max - o) / d);
                let is_forwards = d > 0.0;
                let (near, far) = if is_forwards { (low, high) } else { (high, low) };
                let (near_face, far_face) = if is_forwards { (lower, upper) } else { (upper, lower) };
                first[i] = if near > enter[i] { near_face } else { first[i] };
                enter[i] = if near > enter[i] { near } else { enter[i] };
                last[i] = if far < leave[i] { far_face } else { last[i] };
                leave[i] = if far < leave[i] { far } else { leave[i] };
            }
        }
        let mut t = [0.0; CUBOID_RAYS];
        for i in 0..CUBOID_RAYS {
            let (near, far) = (enter[i] as f32, leave[i] as f32);
            let nearest = if near > 0.0 { near } else { far };
            t[i] = if enter[i] > leave[i] { f32::NAN } else { nearest };
        }
        let mut face = [0; CUBOID_RAYS];
        for i in 0..CUBOID_RAYS {
            let number = if enter[i] as f32 > 0.0 { first[i] } else { last[i] };
            face[i] = number as i32 as u32;
        }
        let mut clamped = [0.0; CUBOID_RAYS];
        let bounds = cuboid.bounds();
        for i in 0..CUBOID_RAYS {
            let (origin, neg_reciprocal) = ray(&origin, &direction, i);
            let moved = PreparedRay::clamp_regular(origin, neg_reciprocal, &bounds, t[i], t_max[i]);
            let is_hit = (t[i] > 0.0) & (t[i] <= t_max[i]) & (t[i] < f32::INFINITY);
            clamped[i] = if is_hit { moved } else { f32::NAN };
        }
        let (mut hit, mut irregular) = (0, 0);
        for (i, t) in clamped.iter().enumerate() {
            hit |= u32::from(!t.is_nan()) << i;
        }
        for i in 0..CUBOID_RAYS {
            let (origin, neg_reciprocal) = ray(&origin, &direction, i);
            irregular |= u32::from(!PreparedRay::is_regular(origin, neg_reciprocal)) << i;
        }
        CuboidHits { t: clamped, face, hit: hit & !irregular, irregular }
    }
}

/// The origin of a ray and −1 / direction.
#[inline(always)]
fn ray(origin: &[Row<f32>; 3], direction: &[Row<f32>; 3], i: usize) -> (Vec3, [f32; 3]) {
    let [x, y, z] = direction;
    (Vec3::new(origin[0][i], origin[1][i], origin[2][i]), [-1.0 / x[i], -1.0 / y[i], -1.0 / z[i]])
}

impl Cuboid {
    /// The hits of up to [`CUBOID_RAYS`] rays, each up to its `t_max`.
    pub(crate) fn intersect_many(&self, rays: &[Ray], t_max: impl Iterator<Item = f32>) -> CuboidHits {
        let mut all = IntersectMany {
            cuboid: self,
            origin: [[0.0; CUBOID_RAYS]; 3],
            direction: [[1.0; CUBOID_RAYS]; 3],
            t_max: [f32::NEG_INFINITY; CUBOID_RAYS],
        };
        for (i, (ray, t_max)) in rays.iter().zip(t_max).enumerate() {
            for axis in 0..3 {
                (all.origin[axis][i], all.direction[axis][i]) = (ray.origin[axis], ray.direction[axis]);
            }
            all.t_max[i] = t_max;
        }
        InstructionSet::run(all)
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::Random;
    use super::*;

    const INF: f32 = f32::INFINITY;
    const BOX: Cuboid = Cuboid { min: Vec3::new(-1.0, -2.0, -3.0), max: Vec3::new(1.0, 2.0, 3.0) };

    /// Rays along axes, in planes of faces, from inside, of tiny directions and with short ends are among them.
    #[test]
    fn hits_are_those_of_single_rays() {
        for set in InstructionSet::available() {
            set.limit();
            let random = &mut Random(5);
            let (mut hits, mut alone) = (0, 0);
            for _ in 0..2000 {
                let (mut rays, mut ends) = (Vec::new(), Vec::new());
                for _ in 0..1 + (random.unit() * 15.9) as usize {
                    let mut coordinate = |size: f32| match (random.unit() * 8.0) as u32 {
                        0 => 0.0,
                        1 => size * if random.one_in(2) { 1.0 } else { -1.0 },
                        2 if random.one_in(10) => 1e-39,
                        _ => random.within(-4.0, 4.0),
                    };
                    let origin = Vec3::new(coordinate(1.0), coordinate(2.0), coordinate(3.0));
                    rays.push(Ray::new(origin, Vec3::new(coordinate(1.0), coordinate(1.0), coordinate(1.0))));
                    ends.push(if random.one_in(2) { INF } else { random.within(0.0, 3.0) });
                }
                let all = BOX.intersect_many(&rays, ends.iter().copied());
                assert_eq!((all.hit >> rays.len(), all.hit & all.irregular), (0, 0));
                for (i, (ray, end)) in rays.iter().zip(&ends).enumerate() {
                    if all.irregular >> i & 1 == 1 {
                        alone += 1;
                        continue;
                    }
                    let hit = BOX.intersect(ray, *end).and_then(|hit| {
                        let t = ray.prepare().clamp_to_box(&BOX.bounds(), hit.t.into(), *end)?;
                        Some((t, hit.part))
                    });
                    let is_hit = all.hit >> i & 1 == 1;
                    assert_eq!(is_hit.then_some((all.t[i], all.face[i])), hit, "{ray:?} up to {end}");
                    hits += u32::from(is_hit);
                }
            }
            assert!(hits > 2000 && alone > 1000, "{hits} {alone}");
        }
    }
    /// The reciprocal of a denormal number is no `f32`, and the ray is still tested by itself.
    #[test]
    fn denormal_directions_miss_nothing() {
        let near = f32::from_bits(1.0f32.to_bits() + 1);
        let ray = Ray::new(Vec3::new(-near, 0.0, 0.0), Vec3::new(1e-39, 0.0, 0.0));
        assert!(BOX.intersect(&ray, INF).is_some());
        assert_eq!(BOX.intersect_many(&[ray], [INF].into_iter()).irregular, 1);
    }
}
