//! What all rays of a group lie between, so that one look at a box may spare them all.
//!
//! Interval arithmetic after Boulos, Wald and Shirley, "Geometric and arithmetic culling methods for entire ray packets"
//! (2006), but with half-spaces that move along the rays instead of reciprocals of intervals, so that it does not matter
//! whether directions of a group change their signs.

use canaletto_bvh::{Aabb, Ray};
use glam::Vec3;

/// How many rays a group has.
pub(super) const GROUP: usize = 16;

/// The slack of what is met along a ray: more than the trees leave to it, so that none of them would go where this says no.
const SLACK: f64 = 1.0 + 1.0 / (1 << 18) as f64;

/// Sizes of components whose reciprocals are normal numbers; trees tell nothing about others.
const REGULAR: std::ops::RangeInclusive<f32> = 1e-37..=1e37;

/// A group of rays.
#[derive(Clone, Copy, Debug)]
pub(super) struct Corridor {
    origin: [Vec3; 2],
    direction: [Vec3; 2],
    /// Up to where any of them counts.
    t_max: f32,
    /// Whether boxes can be told to be missed.
    regular: bool,
}

impl Corridor {
    /// The corridor of at least one ray.
    pub(super) fn of(rays: &[Ray], t_max: &[f32]) -> Corridor {
        let mut corridor = Corridor {
            origin: [Vec3::INFINITY, Vec3::NEG_INFINITY],
            direction: [Vec3::INFINITY, Vec3::NEG_INFINITY],
            t_max: f32::NEG_INFINITY,
            regular: true,
        };
        let [mut least, mut most] = [Vec3::INFINITY, Vec3::ZERO];
        for (Ray { origin, direction }, t_max) in rays.iter().zip(t_max) {
            let Corridor { origin: [o0, o1], direction: [d0, d1], t_max: end, .. } = &mut corridor;
            (*o0, *o1) = (o0.min(*origin), o1.max(*origin));
            (*d0, *d1) = (d0.min(*direction), d1.max(*direction));
            *end = end.max(*t_max);
            let size = direction.abs();
            (least, most) = (least.min(size), most.max(size));
        }
        corridor.regular = REGULAR.contains(&least.min_element()) && REGULAR.contains(&most.max_element());
        corridor
    }

    /// Whether all trees would say that no ray of the group meets the box.
    pub(super) fn misses(&self, bounds: &Aabb) -> bool {
        if !self.regular {
            return false;
        }
        let (mut near, mut far) = (0.0f64, f64::from(self.t_max) * SLACK);
        // t such that the rays that go along `way` from `from` are not yet past `plane`, or past it already.
        let mut clip = |plane: f32, from: f32, way: f32| {
            let t = (f64::from(plane) - f64::from(from)) / f64::from(way);
            if way > 0.0 { far = far.min(t * SLACK) } else { near = near.max(t) }
        };
        for axis in 0..3 {
            let [o0, o1] = self.origin.map(|o| o[axis]);
            let [d0, d1] = self.direction.map(|d| d[axis]);
            clip(bounds.max[axis], o0, d0);
            clip(-bounds.min[axis], -o1, -d1);
        }
        near > far
    }
}
