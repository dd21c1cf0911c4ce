//! The exchange of light between two nodes: form factor, visibility, and what they vary by.

use super::mesh::{Element, PatchMesh};
use super::outline::CELLS;
use crate::form_factor;
use crate::world::OccluderCache;
use canaletto_bvh::Ray;
use glam::{DVec3, Vec3};
use std::f64::consts::PI;

/// The `t_max` of a ray to a point at t = 1.
pub(super) const BEFORE_END: f32 = 1.0 - f32::EPSILON;

/// Corners nearer to a plane than this count as in the plane, relative to the sizes of both outlines.
const IN_PLANE: f64 = 1e-9;

/// The squared distance relative to the areas from which two points on each axis suffice for the quadrature.
const FAR: f64 = 6.0;

/// The squared distance relative to the areas below which the factor of two outlines is found by their contours.
const NEAR: f64 = 1.5;

/// The quadrature error of contours, relative to the product of the lengths of two edges.
const CONTOUR_TOLERANCE: f64 = 1e-8;

/// The first number of rays between two nodes. All cells have a ray if these don't agree.
const FEW_RAYS: usize = 4;

/// The uncertainty of a visibility after some rays, and after a ray for each cell, all of which agreed.
const UNSEEN: [f64; 2] = [0.1, 0.03];

/// What two nodes get from each other, relative to the other's radiance. Areas times factors are equal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Exchange {
    /// The form factor from the first node to the second with visibility: the mean over the first of what it sees of
    /// the second.
    pub(super) factor: f64,
    /// The share of rays between the two that pass.
    pub(super) visibility: f64,
    /// Estimates by how much the factor varies over the first node, and the factor back over the second, or may be
    /// wrong.
    pub(super) spreads: [f64; 2],
    /// The parts of both factors that a source of uneven radiance gets wrong, relative to the radiance's deviation.
    pub(super) source_spreads: [f64; 2],
}

impl Exchange {
    pub(super) const NOTHING: Exchange =
        Exchange { factor: 0.0, visibility: 0.0, spreads: [0.0; 2], source_spreads: [0.0; 2] };
}

/// The effort for visibility: whether a ray is traced for each cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Effort {
    Few,
    All,
}

/// The form factor from a point of a surface to the front of a polygon.
fn point_to_polygon(point: DVec3, normal: DVec3, polygon: &[DVec3]) -> f64 {
    form_factor::point_to_polygon(point, normal, polygon).max(0.0)
}

/// Whether two outlines face each other in part.
fn face_each_other(p: &Element, normal_p: DVec3, q: &Element, normal_q: DVec3) -> bool {
    let near = IN_PLANE * (p.radius + q.radius);
    let before = |of: &Element, center: DVec3, normal: DVec3| {
        of.outline.corners().iter().any(|corner| (*corner - center).dot(normal) > near)
    };
    before(q, p.center, normal_p) && before(p, q.center, normal_q)
}

impl PatchMesh<'_> {
    /// What elements `p` and `q` get from each other. `effort` chooses the number of rays.
    pub(super) fn between(&self, p: u32, q: u32, effort: Effort) -> Exchange {
        let [normal_p, normal_q] = [p, q].map(|element| self.normal_of(element));
        let [at_p, at_q] = [p, q].map(|element| &self.elements[element as usize]);
        if p == q || at_p.area == 0.0 || at_q.area == 0.0 || !face_each_other(at_p, normal_p, at_q, normal_q) {
            return Exchange::NOTHING;
        }
        let square = at_p.center.distance_squared(at_q.center) / (at_p.outline.area() + at_q.outline.area());
        let is_far = square > FAR;
        // The smaller one is sampled, and the larger one is exact. Both directions thus have one exchange.
        let sampled_p = (at_p.outline.area(), p) <= (at_q.outline.area(), q);
        let (small, normal, large) = if sampled_p { (at_p, normal_p, at_q) } else { (at_q, normal_q, at_p) };
        let polygon = large.outline.corners();
        let values: Vec<(f64, f64)> = if small.bare_share() == 1.0 {
            let points = small.outline.quadrature(!is_far);
            points.into_iter().map(|(x, weight)| (point_to_polygon(x, normal, polygon), weight)).collect()
        } else {
            let weight = 1.0 / f64::from(small.bare.count_ones());
            let cells = (0..CELLS).filter(|&cell| small.is_bare(cell));
            cells.map(|cell| (point_to_polygon(small.outline.cell(cell), normal, polygon), weight)).collect()
        };
        let mut mean: f64 = values.iter().map(|(value, weight)| value * weight).sum();
        if mean <= 0.0 {
            return Exchange::NOTHING;
        }
        if square < NEAR && small.bare_share() == 1.0 {
            // Sampled points miss much of what touching outlines exchange.
            let exact = form_factor::polygon_to_polygon_within(CONTOUR_TOLERANCE, small.outline.corners(), polygon);
            mean = exact.map_or(mean, |exact| exact.value);
        }
        let range = |values: &mut dyn Iterator<Item = f64>| {
            let (low, high) = values.fold((f64::INFINITY, 0.0f64), |(low, high), v| (low.min(v), high.max(v)));
            high - low
        };
        let power = mean * small.area * large.bare_share();
        let over_small = range(&mut values.iter().map(|&(value, _)| value)) * large.bare_share();
        // The cells in the quarters of the larger one.
        let normal_large = if sampled_p { normal_q } else { normal_p };
        let seen = |cell| point_to_polygon(large.outline.cell(cell), normal_large, small.outline.corners());
        let over_large = range(&mut (0..4).map(seen)) * small.bare_share();
        let pair = if p < q { [at_p, at_q] } else { [at_q, at_p] };
        let (visibility, uncertain) = self.visibility(
            |ray| {
                let from = bare_cell(pair[0], ray);
                (pair[0].origins[from], pair[1].origins[bare_cell(pair[1], opposite(ray))])
            },
            effort,
        );
        let geometric = if sampled_p { [over_small, over_large] } else { [over_large, over_small] };
        let distance = at_p.center.distance(at_q.center);
        let of = |receiver: &Element, source: &Element, geometric: f64| {
            let unoccluded = power / receiver.area;
            // How much nearer one end of the source may be than its middle.
            let uneven = (2.0 * source.radius / distance).min(1.0);
            [geometric * visibility + unoccluded * uncertain, unoccluded * uneven.max(uncertain)]
        };
        let [there, back] = [of(at_p, at_q, geometric[0]), of(at_q, at_p, geometric[1])];
        Exchange {
            factor: power / at_p.area * visibility,
            visibility,
            spreads: [there[0], back[0]],
            source_spreads: [there[1], back[1]],
        }
    }

    /// The share of rays between pairs of points that pass, and its uncertainty.
    fn visibility(&self, ends: impl Fn(usize) -> (Vec3, Vec3), effort: Effort) -> (f64, f64) {
        let mut last = OccluderCache::NONE;
        let mut passed = 0.0;
        for ray in 0..CELLS {
            let (from, to) = ends(ray);
            passed += self.transmittance(from, to, &mut last);
            let traced = (ray + 1) as f64;
            let agree = passed == 0.0 || passed == traced;
            if ray + 1 == FEW_RAYS && effort == Effort::Few && agree {
                return (passed / traced, UNSEEN[0]);
            }
        }
        let visibility = passed / CELLS as f64;
        (visibility, (4.0 * visibility * (1.0 - visibility)).sqrt().max(UNSEEN[1]))
    }

    /// The share of light that passes between two points.
    pub(super) fn transmittance(&self, from: Vec3, to: Vec3, last: &mut OccluderCache) -> f64 {
        f64::from(self.world.transmittance(&Ray::new(from, to - from), BEFORE_END, 0.0, None, last, &mut ()))
    }

    /// What two nodes get from each other, of which at least one is a cluster. The factor is left to their members.
    /// None if they are too near for a bound.
    pub(super) fn between_clusters(&self, p: u32, q: u32, effort: Effort) -> Option<Exchange> {
        let ((center_p, radius_p), (center_q, radius_q)) = (self.ball(p), self.ball(q));
        let distance = center_p.distance(center_q);
        let gap = distance - radius_p - radius_q;
        if gap <= 0.0 || self.area_of(p) == 0.0 || self.area_of(q) == 0.0 {
            return if gap <= 0.0 { None } else { Some(Exchange::NOTHING) };
        }
        let direction = (center_q - center_p) / distance;
        let (visibility, uncertain) =
            self.visibility(|ray| (self.sample(p, ray, direction), self.sample(q, opposite(ray), -direction)), effort);
        let of = |receiver: u32, source: u32, direction: DVec3| {
            // The bound of what a receiver at the nearest place sees.
            let most = (self.largest_projected(source) / (PI * gap * gap)).min(1.0);
            let middle = (self.projected(source, -direction) / (PI * distance * distance)).min(1.0);
            let receiving = match self.element_of(receiver) {
                Some(element) => self.normal_of(element).dot(direction).max(0.25),
                // Sides of all directions receive a quarter.
                None => 0.25,
            };
            let spread = (most - middle).max(0.0) * visibility + most * (uncertain + CLUSTER_ERROR);
            // The sides of a cluster that face the receiver may be the dark ones.
            [spread * receiving, middle * receiving]
        };
        let [there, back] = [of(p, q, direction), of(q, p, -direction)];
        Some(Exchange { factor: 0.0, visibility, spreads: [there[0], back[0]], source_spreads: [there[1], back[1]] })
    }

    /// The projected area of a node seen from a direction.
    fn projected(&self, node: u32, direction: DVec3) -> f64 {
        match self.element_of(node) {
            Some(element) => self.area_of(node) * self.normal_of(element).dot(direction).max(0.0),
            None => self.clusters[node as usize].sums.projected(direction),
        }
    }

    /// A bound of the projected area from any direction.
    fn largest_projected(&self, node: u32) -> f64 {
        let (_, radius) = self.ball(node);
        self.area_of(node).min(PI * radius * radius)
    }

    /// The origin of a ray that leaves a node in a direction, if the node has a side that faces it.
    fn sample(&self, node: u32, ray: usize, direction: DVec3) -> Vec3 {
        let element = match self.element_of(node) {
            Some(element) => element,
            None => {
                let range = &self.clusters[node as usize].elements;
                let count = range.len();
                let start = (2 * ray + 1) * count / (2 * CELLS);
                let faces = |element: &u32| self.normal_of(*element).dot(direction) > 0.0;
                let mut near = (0..count.min(16)).map(|i| range.start + ((start + i) % count) as u32);
                near.find(faces).unwrap_or(range.start + start as u32)
            }
        };
        let element = &self.elements[element as usize];
        element.origins[bare_cell(element, ray)]
    }

    /// The factor of a link from `source` to a cluster, for one of the root elements in the cluster.
    pub(super) fn factor_of_member(&self, member: u32, source: u32) -> f64 {
        self.factor_at(self.elements[member as usize].center, self.normal_of(member), source)
    }

    /// The form factor from a point of a surface with a unit normal to a node in full view. That to a cluster is
    /// estimated.
    pub(super) fn factor_at(&self, point: DVec3, normal: DVec3, source: u32) -> f64 {
        match self.element_of(source) {
            Some(source) => {
                let source = &self.elements[source as usize];
                point_to_polygon(point, normal, source.outline.corners()) * source.bare_share()
            }
            None => {
                let cluster = &self.clusters[source as usize];
                let way = cluster.center - point;
                let distance = way.length();
                let direction = way / distance;
                let seen = cluster.sums.projected(-direction) / (PI * distance * distance);
                seen.min(1.0) * normal.dot(direction).max(0.0)
            }
        }
    }
}

/// The relative error of the light from a cluster, whose directions are estimated.
const CLUSTER_ERROR: f64 = 0.15;

/// The bare cell for a ray.
fn bare_cell(element: &Element, ray: usize) -> usize {
    (0..CELLS).map(|i| (ray + i) % CELLS).find(|&cell| element.is_bare(cell)).unwrap_or(ray)
}

/// The number of the cell at the other end of a ray. Four successive rays end in different quarters.
fn opposite(ray: usize) -> usize {
    (7 * ray + 5) % CELLS
}
