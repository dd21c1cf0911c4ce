//! Sixteen rays against one box or one disk.
//!
//! The results are those of single rays and [`PreparedRay::clamp_to_box`], bit for bit.

use super::{Cuboid, Disk};
use crate::math::DRay;
use canaletto_bvh::{Aabb, InstructionSet, Kernel, PreparedRay, Ray};
use glam::Vec3;

/// The most rays that are tested at once.
pub(crate) const RAYS: usize = 16;

type Row<T> = [T; RAYS];

/// The hits of rays on a shape.
pub(crate) struct Hits16 {
    /// For each ray the t of its hit up to its `t_max`; NaN for a miss.
    pub(crate) t: Row<f32>,
    /// The numbers of the parts that are hit.
    pub(crate) part: Row<u32>,
    /// A bit for each ray that is hit, and for each ray that isn't regular. The latter has to be tested by itself.
    pub(crate) hit: u32,
    pub(crate) irregular: u32,
}

/// Finds the hits by the box's slabs (Kay & Kajiya 1986).
struct MeetCuboid<'a> {
    cuboid: &'a Cuboid,
    rays: Rays16,
}

impl Kernel for MeetCuboid<'_> {
    type Answer = Hits16;

    // Each loop writes to arrays of one type. The compiler vectorises no other loops.
    #[inline(always)]
    fn run(self) -> Hits16 {
        let MeetCuboid { cuboid, rays } = self;
        let Rays16 { origin, direction, .. } = &rays;
        let (mut enter, mut leave) = ([f64::NEG_INFINITY; RAYS], [f64::INFINITY; RAYS]);
        let (mut first, mut last) = ([0.0; RAYS], [0.0; RAYS]);
        for axis in 0..3 {
            let (min, max) = (f64::from(cuboid.min[axis]), f64::from(cuboid.max[axis]));
            let (lower, upper) = (2.0 * axis as f64, 2.0 * axis as f64 + 1.0);
            for i in 0..RAYS {
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
        let mut t = [0.0; RAYS];
        for i in 0..RAYS {
            let (near, far) = (enter[i] as f32, leave[i] as f32);
            let nearest = if near > 0.0 { near } else { far };
            t[i] = if enter[i] > leave[i] { f32::NAN } else { nearest };
        }
        let mut face = [0; RAYS];
        for i in 0..RAYS {
            let number = if enter[i] as f32 > 0.0 { first[i] } else { last[i] };
            face[i] = number as i32 as u32;
        }
        clamped(&rays, &cuboid.bounds(), &t, face)
    }
}

/// Finds the hits by the disk's plane (5.27, 5.28).
struct MeetDisk<'a> {
    disk: &'a Disk,
    rays: Rays16,
}

impl Kernel for MeetDisk<'_> {
    type Answer = Hits16;

    #[inline(always)]
    fn run(self) -> Hits16 {
        let MeetDisk { disk, rays } = self;
        let (plane, r) = (disk.plane(), f64::from(disk.radius));
        let (mut along, mut distance2) = ([0.0; RAYS], [0.0; RAYS]);
        for (i, along) in along.iter_mut().enumerate() {
            *along = plane.parameter(rays.line(i));
        }
        for i in 0..RAYS {
            distance2[i] = plane.offset(rays.line(i), along[i]).length_squared();
        }
        let mut t = [0.0; RAYS];
        for i in 0..RAYS {
            t[i] = if distance2[i] <= r * r { along[i] as f32 } else { f32::NAN };
        }
        clamped(&rays, &disk.bounds(), &t, [0; RAYS])
    }
}

/// Rays side by side, with their ends. Those beyond the last one have the end −∞.
struct Rays16 {
    origin: [Row<f32>; 3],
    direction: [Row<f32>; 3],
    t_max: Row<f32>,
}

impl Rays16 {
    fn new(rays: &[Ray], t_max: impl Iterator<Item = f32>) -> Rays16 {
        let (origin, direction) = ([[0.0; RAYS]; 3], [[1.0; RAYS]; 3]);
        let mut all = Rays16 { origin, direction, t_max: [f32::NEG_INFINITY; RAYS] };
        for (i, (ray, t_max)) in rays.iter().zip(t_max).enumerate() {
            for axis in 0..3 {
                (all.origin[axis][i], all.direction[axis][i]) = (ray.origin[axis], ray.direction[axis]);
            }
            all.t_max[i] = t_max;
        }
        all
    }

    #[inline(always)]
    fn line(&self, i: usize) -> DRay {
        let [origin, direction] = [&self.origin, &self.direction].map(|[x, y, z]| Vec3::new(x[i], y[i], z[i]));
        DRay { origin: origin.as_dvec3(), direction: direction.as_dvec3() }
    }

    /// The origin of a ray and −1 / direction.
    #[inline(always)]
    fn ray(&self, i: usize) -> (Vec3, [f32; 3]) {
        let ([x, y, z], [dx, dy, dz]) = (&self.origin, &self.direction);
        (Vec3::new(x[i], y[i], z[i]), [-1.0 / dx[i], -1.0 / dy[i], -1.0 / dz[i]])
    }
}

/// The hits at these t, moved into the shape's box.
#[inline(always)]
fn clamped(rays: &Rays16, bounds: &Aabb, t: &Row<f32>, part: Row<u32>) -> Hits16 {
    let mut clamped = [0.0; RAYS];
    for i in 0..RAYS {
        let (origin, neg_reciprocal) = rays.ray(i);
        let moved = PreparedRay::clamp_regular(origin, neg_reciprocal, bounds, t[i], rays.t_max[i]);
        let is_hit = (t[i] > 0.0) & (t[i] <= rays.t_max[i]) & (t[i] < f32::INFINITY);
        clamped[i] = if is_hit { moved } else { f32::NAN };
    }
    let (mut hit, mut irregular) = (0, 0);
    for (i, t) in clamped.iter().enumerate() {
        hit |= u32::from(!t.is_nan()) << i;
    }
    for i in 0..RAYS {
        let (origin, neg_reciprocal) = rays.ray(i);
        irregular |= u32::from(!PreparedRay::is_regular(origin, neg_reciprocal)) << i;
    }
    Hits16 { t: clamped, part, hit: hit & !irregular, irregular }
}

impl Cuboid {
    /// The hits of up to [`RAYS`] rays, each up to its `t_max`.
    pub(crate) fn intersect_many(&self, rays: &[Ray], t_max: impl Iterator<Item = f32>) -> Hits16 {
        InstructionSet::run(MeetCuboid { cuboid: self, rays: Rays16::new(rays, t_max) })
    }
}

impl Disk {
    /// The hits of up to [`RAYS`] rays, each up to its `t_max`.
    pub(crate) fn intersect_many(&self, rays: &[Ray], t_max: impl Iterator<Item = f32>) -> Hits16 {
        InstructionSet::run(MeetDisk { disk: self, rays: Rays16::new(rays, t_max) })
    }
}

#[cfg(test)]
mod tests {
    use super::super::ShapeHit;
    use super::super::testing::Random;
    use super::*;

    const INF: f32 = f32::INFINITY;
    const BOX: Cuboid = Cuboid { min: Vec3::new(-1.0, -2.0, -3.0), max: Vec3::new(1.0, 2.0, 3.0) };

    /// Rays along axes, in planes of faces, from inside, of tiny directions and with short ends are among them.
    fn compare(
        intersect_many: impl Fn(&[Ray], &[f32]) -> Hits16,
        intersect: impl Fn(&Ray, f32) -> Option<ShapeHit>,
        bounds: &Aabb,
    ) {
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
                let all = intersect_many(&rays, &ends);
                assert_eq!((all.hit >> rays.len(), all.hit & all.irregular), (0, 0));
                for (i, (ray, end)) in rays.iter().zip(&ends).enumerate() {
                    if all.irregular >> i & 1 == 1 {
                        alone += 1;
                        continue;
                    }
                    let hit = intersect(ray, *end).and_then(|hit| {
                        let t = ray.prepare().clamp_to_box(bounds, hit.t.into(), *end)?;
                        Some((t, hit.part))
                    });
                    let is_hit = all.hit >> i & 1 == 1;
                    assert_eq!(is_hit.then_some((all.t[i], all.part[i])), hit, "{ray:?} up to {end}");
                    hits += u32::from(is_hit);
                }
            }
            assert!(hits > 500 && alone > 1000, "{hits} {alone}");
        }
    }

    #[test]
    fn hits_on_boxes_are_those_of_single_rays() {
        let many = |rays: &[Ray], ends: &[f32]| BOX.intersect_many(rays, ends.iter().copied());
        compare(many, |ray, end| BOX.intersect(ray, end), &BOX.bounds());
    }

    #[test]
    fn hits_on_disks_are_those_of_single_rays() {
        for normal in [Vec3::Z, Vec3::new(0.3, -2.0, 1.0)] {
            let disk = Disk { center: Vec3::new(0.0, 1.0, 0.0), normal, radius: 2.5 };
            let many = |rays: &[Ray], ends: &[f32]| disk.intersect_many(rays, ends.iter().copied());
            compare(many, |ray, end| disk.intersect(ray, end), &disk.bounds());
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
