//! Flat surfaces of which the area is sampled: disks, parallelograms and triangles, for any number of lanes.

use crate::math::{Vector, warp};
use canaletto_bvh::lanes::{Mask, Real64};
use glam::DVec3;

/// A flat surface: the points `origin` + a · `edges[0]` + b · `edges[1]`, where (a, b) is in the domain.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Flat {
    pub(super) origin: DVec3,
    pub(super) edges: [DVec3; 2],
    /// The unit normal.
    pub(super) normal: DVec3,
    pub(super) area: f64,
    pub(super) domain: Domain,
    /// The middle of a sphere around it, and the squared radius.
    middle: DVec3,
    radius2: f64,
}

/// The places (a, b) of a flat surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Domain {
    /// a² + b² ≤ 1. The origin is the disk's centre.
    Disk,
    /// 0 ≤ a, b ≤ 1.
    Parallelogram,
    /// 0 ≤ a, b and a + b ≤ 1.
    Triangle,
}

/// How many radii away the middle of a flat surface has to be, so that its area is sampled. The farthest point is then
/// at most three times as far as the nearest one. In a Cornell box, most of whose points are farther away, the solid
/// angle saved 6 % of the variance and took longer.
const FAR: f64 = 2.0;

impl Flat {
    /// The surface at an origin with two edges, of this unit normal and area.
    pub(super) fn new(origin: DVec3, edges: [DVec3; 2], normal: DVec3, area: f64, domain: Domain) -> Flat {
        let [a, b] = edges;
        let (middle, radius2) = match domain {
            Domain::Disk => (origin, a.length_squared()),
            Domain::Parallelogram => {
                (origin + (a + b) * 0.5, 0.25 * (a + b).length_squared().max((a - b).length_squared()))
            }
            Domain::Triangle => {
                let middle = (a + b) / 3.0;
                let corners = [DVec3::ZERO, a, b].map(|corner| corner.distance_squared(middle));
                (origin + middle, corners.into_iter().fold(0.0, f64::max))
            }
        };
        Flat { origin, edges, normal, area, domain, middle, radius2 }
    }

    /// Whether the area is sampled as seen from `p`, instead of the solid angle.
    #[inline(always)]
    pub(crate) fn is_far(&self, p: DVec3) -> bool {
        // Rounding is left some room, so that the bound of the distances holds.
        self.middle.distance_squared(p) > FAR * FAR * 1.001 * self.radius2
    }
}

/// A flat surface in each lane.
pub(crate) struct Flats<F: Real64> {
    origin: Vector<F>,
    edges: [Vector<F>; 2],
    pub(crate) normal: Vector<F>,
    area: F,
    disks: F::Mask,
    triangles: F::Mask,
}

impl<F: Real64> Flats<F> {
    /// One surface for each lane.
    #[inline(always)]
    pub(crate) fn gather<'a>(of_lane: impl Fn(usize) -> &'a Flat) -> Flats<F> {
        Flats {
            origin: Vector::gather(|lane| of_lane(lane).origin),
            edges: [Vector::gather(|lane| of_lane(lane).edges[0]), Vector::gather(|lane| of_lane(lane).edges[1])],
            normal: Vector::gather(|lane| of_lane(lane).normal),
            area: F::gather(|lane| of_lane(lane).area),
            disks: F::Mask::gather(|lane| of_lane(lane).domain == Domain::Disk),
            triangles: F::Mask::gather(|lane| of_lane(lane).domain == Domain::Triangle),
        }
    }

    /// The points at `u` of the unit square, uniform over the areas.
    #[inline(always)]
    pub(crate) fn points(&self, [u, v]: [F; 2]) -> Vector<F> {
        let [mut a, mut b] = [u, v];
        if self.disks.any() {
            let [x, y] = warp::disk_lanes([u, v]);
            [a, b] = [F::select(self.disks, x, a), F::select(self.disks, y, b)];
        }
        if self.triangles.any() {
            let root = u.sqrt();
            let [x, y] = [root * (F::splat(1.0) - v), root * v];
            [a, b] = [F::select(self.triangles, x, a), F::select(self.triangles, y, b)];
        }
        self.origin + self.edges[0] * a + self.edges[1] * b
    }

    /// The densities per unit of solid angle at `p` of points that are uniform over the areas.
    #[inline(always)]
    pub(crate) fn pdf(&self, p: Vector<F>, point: Vector<F>) -> F {
        density_of_area(p, point, self.normal, self.area)
    }
}

/// The density per unit of solid angle at `p` of a point that is uniform over an area: dω = dA |cos θ| / d².
#[inline(always)]
pub(super) fn density_of_area<F: Real64>(p: Vector<F>, point: Vector<F>, normal: Vector<F>, area: F) -> F {
    let to_p = p - point;
    let distance2 = to_p.length_squared();
    let cos = normal.dot(to_p).abs() / distance2.sqrt();
    distance2 / (cos * area)
}
