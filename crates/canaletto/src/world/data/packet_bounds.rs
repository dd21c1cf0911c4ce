//! Bounds of groups of rays, so that one box test may cull a whole group.
//!
//! Interval arithmetic after Boulos, Wald and Shirley, "Geometric and arithmetic culling methods for entire ray
//! packets" (2006). Half-spaces that move along the rays replace the paper's reciprocals of intervals. Directions of a
//! group may therefore change their signs.

use canaletto_bvh::{Aabb, InstructionSet, Kernel, Ray};
use glam::{Vec3, Vec4};

/// The number of rays in a group.
pub(in crate::world) const GROUP: usize = 16;

/// The slack in t of this test. It is larger than the slack of the trees, so that this test culls no box that a tree
/// would enter.
const SLACK: f64 = 1.0 + 1.0 / (1 << 18) as f64;

/// The range of components whose reciprocals are normal numbers. Trees cull nothing for other components.
const REGULAR: std::ops::RangeInclusive<f32> = 1e-37..=1e37;

/// The bounds of a group of rays.
#[derive(Clone, Copy, Debug)]
pub(in crate::world) struct PacketBounds {
    /// The least coordinates of the origins, then the negatives of the largest ones.
    from: [f32; 6],
    /// The least components of the directions, then the negatives of the largest ones.
    way: [f32; 6],
    /// The largest `t_max` of the rays.
    t_max: f32,
    /// Whether boxes can be culled.
    regular: bool,
}

/// The components of `a`, then the negatives of the components of `b`.
#[inline(always)]
fn six(a: Vec3, b: Vec3) -> [f32; 6] {
    [a.x, a.y, a.z, -b.x, -b.y, -b.z]
}

impl PacketBounds {
    /// The bounds of at least one ray.
    #[inline(always)]
    fn of(rays: &[Ray], t_max: &[f32]) -> PacketBounds {
        let (mut o0, mut d0, mut least) = (Vec4::INFINITY, Vec4::INFINITY, Vec4::INFINITY);
        let (mut o1, mut d1, mut end) = (Vec4::NEG_INFINITY, Vec4::NEG_INFINITY, f32::NEG_INFINITY);
        for (ray, t_max) in rays.iter().zip(t_max) {
            let (origin, direction) = (ray.origin.extend(0.0), ray.direction.extend(1.0));
            (o0, o1) = (o0.min(origin), o1.max(origin));
            (d0, d1) = (d0.min(direction), d1.max(direction));
            least = least.min(direction.abs());
            end = if *t_max > end { *t_max } else { end };
        }
        let most = d1.max(-d0);
        let regular = REGULAR.contains(&least.min_element()) && REGULAR.contains(&most.max_element());
        let [o0, o1, d0, d1] = [o0.truncate(), o1.truncate(), d0.truncate(), d1.truncate()];
        PacketBounds { from: six(o0, o1), way: six(d0, d1), t_max: end, regular }
    }

    /// Sets `packet_bounds` to the bounds of the groups of these rays.
    pub(in crate::world) fn of_groups(packet_bounds: &mut Vec<PacketBounds>, rays: &[Ray], t_max: &[f32]) {
        packet_bounds.clear();
        InstructionSet::run(Groups { rays, t_max, packet_bounds });
    }

    /// Whether all trees would report that no ray of the group enters the box.
    pub(in crate::world) fn misses(&self, bounds: &Aabb) -> bool {
        if !self.regular {
            return false;
        }
        let planes = six(bounds.max, bounds.min);
        let (mut near, mut far) = (0.0f64, f64::from(self.t_max) * SLACK);
        for ((plane, from), way) in planes.into_iter().zip(self.from).zip(self.way) {
            // The bound of t at which rays from `from` along `way` pass a plane.
            let t = (f64::from(plane) - f64::from(from)) / f64::from(way);
            if way > 0.0 { far = far.min(t * SLACK) } else { near = near.max(t) }
        }
        near > far
    }
}

struct Groups<'a> {
    rays: &'a [Ray],
    t_max: &'a [f32],
    packet_bounds: &'a mut Vec<PacketBounds>,
}

impl Kernel for Groups<'_> {
    type Answer = ();

    #[inline(always)]
    fn run(self) {
        for (rays, t_max) in self.rays.chunks(GROUP).zip(self.t_max.chunks(GROUP)) {
            self.packet_bounds.push(PacketBounds::of(rays, t_max));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whether one of many points along a ray, in `f64`, lies in a box.
    fn meets(ray: &Ray, t_max: f32, bounds: &Aabb) -> bool {
        let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
        let end = f64::from(t_max.min(16.0));
        (1..=4000).any(|i| {
            let p = ray.origin.as_dvec3() + ray.direction.as_dvec3() * (end * f64::from(i) / 4000.0);
            p.cmpge(min).all() && p.cmple(max).all()
        })
    }

    #[test]
    fn no_box_is_missed_that_a_ray_meets() {
        let mut state = 1u32;
        let mut random = || {
            state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
            (state >> 8) as f32 / (1 << 23) as f32 - 1.0
        };
        let (mut missed, mut met) = (0, 0);
        for n in 0..600 {
            let mut vector = || Vec3::new(random(), random(), random());
            let (origin, corner) = (vector() * 4.0, vector() * 2.0);
            let direction = if n % 4 < 3 { (corner - origin) * 0.6 + vector() } else { vector() };
            let differential = [0.0, 0.01, 0.3][n % 3];
            let rays: Vec<Ray> = (0..8)
                .map(|_| Ray::new(origin + vector() * differential, direction + vector() * differential))
                .collect();
            let t_max = [[f32::INFINITY; 8], [1.0; 8]][n % 2];
            let bounds = Aabb { min: corner, max: corner + vector().abs() };
            let any = rays.iter().zip(&t_max).any(|(ray, &t_max)| meets(ray, t_max, &bounds));
            let misses = PacketBounds::of(&rays, &t_max).misses(&bounds);
            assert!(!(misses && any), "{rays:?} {bounds:?}");
            missed += u32::from(misses);
            met += u32::from(any);
        }
        assert!(missed > 100 && met > 30, "{missed} {met}");
    }

    #[test]
    fn boxes_on_the_way_and_rays_along_axes() {
        let unit = Aabb { min: Vec3::ZERO, max: Vec3::ONE };
        let group = |direction: Vec3, t_max: f32| {
            let rays: Vec<Ray> = (0..4).map(|i| Ray::new(Vec3::new(-2.0, 0.1 * i as f32, 0.5), direction)).collect();
            PacketBounds::of(&rays, &[t_max; 4])
        };
        let ahead = Vec3::new(1.0, 1e-3, 1e-3);
        assert!(!group(ahead, f32::INFINITY).misses(&unit) && !group(ahead, 2.0).misses(&unit));
        assert!(group(ahead, 1.9).misses(&unit) && group(-ahead, f32::INFINITY).misses(&unit));
        assert!(group(ahead, f32::NEG_INFINITY).misses(&unit));
        // Rays along an axis are never culled.
        assert!(!group(Vec3::NEG_X, f32::INFINITY).misses(&unit));
    }
}
