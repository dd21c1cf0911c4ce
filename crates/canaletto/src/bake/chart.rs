//! Charts: connected roots that are drawn side by side in a plane, without overlaps.
//!
//! Coplanar roots of one surface share a chart. Facets of a curved surface share one while their normals stay within a
//! cone, as long as their projections don't overlap. Roots on both sides of a contact never share one, so that no light
//! is interpolated through a wall.

use super::boundary::Boundaries;
use crate::integrator::radiosity::SolvedRoot;
use glam::{DVec2, DVec3};
use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};

/// The least cosine between the normals of neighbours in a chart: 30 degrees.
const SMOOTH: f64 = 0.866;

/// The least cosine between a root's normal and that of its chart: 45 degrees.
const FACING: f64 = 0.707;

/// The most directions that are tried for a chart's axes.
const MOST_DIRECTIONS: usize = 64;

/// The depth of overlap that counts as touching, relative to the smaller root's size.
const TOUCHING: f64 = 1e-6;

/// The most cells of the grid that a root is entered in. Larger roots are tested with all others.
const MOST_CELLS: i64 = 64;

/// Roots that are projected onto one plane.
pub(super) struct Chart {
    /// The numbers of the roots.
    pub(super) roots: Vec<u32>,
    /// The corner of the rectangle around the projections, in space.
    origin: DVec3,
    /// The unit axes of the rectangle.
    axes: [DVec3; 2],
    /// The lengths of its sides, the longer one first.
    pub(super) extent: [f64; 2],
    /// Whether all points are black, so that few texels show it.
    pub(super) is_dark: bool,
}

impl Chart {
    /// The place of a point of the surface in the rectangle.
    pub(super) fn project(&self, point: DVec3) -> DVec2 {
        let p = point - self.origin;
        DVec2::new(p.dot(self.axes[0]), p.dot(self.axes[1]))
    }

    fn new(all: &[SolvedRoot], roots: Vec<u32>, normal: DVec3) -> Chart {
        let (x, y) = normal.any_orthonormal_pair();
        let start = all[roots[0] as usize].corners()[0];
        let flat = |p: DVec3| DVec2::new((p - start).dot(x), (p - start).dot(y));
        let corners = || roots.iter().flat_map(|&root| all[root as usize].corners());
        let edges = roots.iter().flat_map(|&root| {
            let corners = all[root as usize].corners();
            (0..corners.len()).map(move |i| flat(corners[(i + 1) % corners.len()]) - flat(corners[i]))
        });
        let mut best: Option<(f64, DVec2, [DVec2; 2])> = None;
        for direction in edges.filter_map(DVec2::try_normalize).take(MOST_DIRECTIONS) {
            let across = direction.perp();
            let (mut min, mut max) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
            for &corner in corners() {
                let p = flat(corner);
                let p = DVec2::new(p.dot(direction), p.dot(across));
                (min, max) = (min.min(p), max.max(p));
            }
            let size = max - min;
            if best.is_none_or(|(area, ..)| size.x * size.y < area * (1.0 - TOUCHING)) {
                best = Some((size.x * size.y, direction, [min, max]));
            }
        }
        let (_, direction, [min, max]) = best.unwrap_or((0.0, DVec2::X, [DVec2::ZERO; 2]));
        let [along, across] = [direction, direction.perp()].map(|d| x * d.x + y * d.y);
        let size = max - min;
        if size.x >= size.y {
            let origin = start + along * min.x + across * min.y;
            Chart { roots, origin, axes: [along, across], extent: [size.x, size.y], is_dark: false }
        } else {
            let origin = start + along * max.x + across * min.y;
            Chart { roots, origin, axes: [across, -along], extent: [size.y, size.x], is_dark: false }
        }
    }
}

/// A neighbour of a root across an edge.
struct Neighbor {
    root: u32,
    /// Whether another surface touches both along the edge.
    is_contact: bool,
}

/// The neighbours of all roots: roots of the same surface whose normals are similar.
fn neighbors(roots: &[SolvedRoot], boundaries: &Boundaries) -> Vec<Vec<Neighbor>> {
    let mut edges: Vec<([u32; 2], u32, bool)> = Vec::new();
    for (root, around) in (0..).zip(&boundaries.loops) {
        for (i, &a) in around.iter().enumerate() {
            let b = around[(i + 1) % around.len()];
            edges.push(([a.min(b), a.max(b)], root, a < b));
        }
    }
    edges.sort_unstable();
    let mut neighbors: Vec<Vec<Neighbor>> = roots.iter().map(|_| Vec::new()).collect();
    for shared in edges.chunk_by(|a, b| a.0 == b.0) {
        for (i, &([from, to], first, is_forward)) in shared.iter().enumerate() {
            for &(_, second, _) in shared[i + 1..].iter().filter(|other| other.2 != is_forward) {
                let [a, b] = [first, second].map(|root| &roots[root as usize]);
                let of = |root: &SolvedRoot| (root.instance(), root.material(), root.is_outer());
                if of(a) != of(b) || a.normal().dot(b.normal()) < SMOOTH {
                    continue;
                }
                let middle = (boundaries.points[from as usize] + boundaries.points[to as usize]) * 0.5;
                let is_contact = a.is_contact(middle) || b.is_contact(middle);
                neighbors[first as usize].push(Neighbor { root: second, is_contact });
                neighbors[second as usize].push(Neighbor { root: first, is_contact });
            }
        }
    }
    neighbors
}

/// Projections of roots, in a grid that finds those that overlap another one.
struct Projections {
    axes: (DVec3, DVec3),
    origin: DVec3,
    cell: f64,
    polygons: Vec<Vec<DVec2>>,
    cells: HashMap<[i64; 2], Vec<u32>>,
    large: Vec<u32>,
}

impl Projections {
    /// A grid for the plane of a root. `usual` is the size of most roots.
    fn new(seed: &SolvedRoot, usual: f64) -> Projections {
        Projections {
            axes: seed.normal().any_orthonormal_pair(),
            origin: seed.center(),
            cell: 2.0 * usual.max(size_of(seed)),
            polygons: Vec::new(),
            cells: HashMap::new(),
            large: Vec::new(),
        }
    }

    /// Adds a root, unless its projection overlaps another one.
    fn add(&mut self, root: &SolvedRoot) -> bool {
        let (x, y) = self.axes;
        let flat = |&p: &DVec3| DVec2::new((p - self.origin).dot(x), (p - self.origin).dot(y));
        let polygon: Vec<DVec2> = root.corners().iter().map(flat).collect();
        let [min, max] =
            polygon.iter().fold([DVec2::INFINITY, DVec2::NEG_INFINITY], |[min, max], &p| [min.min(p), max.max(p)]);
        let [from, to] = [min, max].map(|p| [(p.x / self.cell).floor() as i64, (p.y / self.cell).floor() as i64]);
        let count = (to[0] - from[0] + 1).saturating_mul(to[1] - from[1] + 1);
        let is_free = |&other: &u32| !overlap(&self.polygons[other as usize], &polygon);
        let number = self.polygons.len() as u32;
        if count > MOST_CELLS {
            if !(0..number).all(|other| is_free(&other)) {
                return false;
            }
            self.large.push(number);
        } else {
            let cells = || (from[1]..=to[1]).flat_map(|y| (from[0]..=to[0]).map(move |x| [x, y]));
            let inhabitants = cells().filter_map(|cell| self.cells.get(&cell)).flatten();
            if !inhabitants.chain(&self.large).all(is_free) {
                return false;
            }
            for cell in cells() {
                self.cells.entry(cell).or_default().push(number);
            }
        }
        self.polygons.push(polygon);
        true
    }
}

/// The largest distance of a root's corner from its centre.
fn size_of(root: &SolvedRoot) -> f64 {
    root.corners().iter().map(|p| p.distance(root.center())).fold(0.0, f64::max)
}

/// Whether two convex polygons overlap by more than they touch (the separating axis theorem).
fn overlap(a: &[DVec2], b: &[DVec2]) -> bool {
    let size = |polygon: &[DVec2]| polygon.iter().map(|p| p.distance(polygon[0])).fold(0.0, f64::max);
    let slack = size(a).min(size(b)) * TOUCHING;
    let is_separated_by = |[a, b]: [&[DVec2]; 2]| {
        (0..a.len()).any(|i| {
            let edge = a[(i + 1) % a.len()] - a[i];
            // The polygons run counter-clockwise.
            let outwards = -edge.perp().normalize_or_zero();
            b.iter().all(|&p| outwards.dot(p - a[i]) >= -slack)
        })
    };
    !is_separated_by([a, b]) && !is_separated_by([b, a])
}

/// The charts of all roots. Each root is in one chart.
pub(super) fn charts(roots: &[SolvedRoot], boundaries: &Boundaries) -> Vec<Chart> {
    let neighbors = neighbors(roots, boundaries);
    let mut sizes: Vec<f64> = roots.iter().map(size_of).collect();
    sizes.sort_by(f64::total_cmp);
    let median = sizes[sizes.len() / 2];
    // The chart of each root; 0 is none yet.
    let mut chart_of = vec![0; roots.len()];
    let mut charts = Vec::new();
    for seed in 0..roots.len() as u32 {
        if chart_of[seed as usize] != 0 {
            continue;
        }
        let number = charts.len() + 1;
        let normal = roots[seed as usize].normal();
        let mut members = Vec::new();
        let mut projections = Projections::new(&roots[seed as usize], median);
        // Roots that face the chart's plane most come first, and of those the lowest numbers.
        let mut waiting = BinaryHeap::from([(i64::MAX, Reverse(seed))]);
        while let Some((_, Reverse(root))) = waiting.pop() {
            let is_beyond_contact = || {
                neighbors[root as usize].iter().any(|next| next.is_contact && chart_of[next.root as usize] == number)
            };
            if chart_of[root as usize] != 0 || is_beyond_contact() || !projections.add(&roots[root as usize]) {
                continue;
            }
            chart_of[root as usize] = number;
            members.push(root);
            for next in neighbors[root as usize].iter().filter(|next| !next.is_contact) {
                let facing = roots[next.root as usize].normal().dot(normal);
                if chart_of[next.root as usize] == 0 && facing >= FACING {
                    waiting.push(((facing * f64::from(1 << 20)) as i64, Reverse(next.root)));
                }
            }
        }
        charts.push(Chart::new(roots, members, normal));
    }
    charts
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(x: f64, y: f64, side: f64) -> Vec<DVec2> {
        [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|[u, v]| DVec2::new(x + u * side, y + v * side)).to_vec()
    }

    #[test]
    fn polygons_that_share_an_edge_do_not_overlap() {
        let whole = square(0.0, 0.0, 1.0);
        assert!(!overlap(&whole, &square(1.0, 0.2, 1.0)));
        assert!(!overlap(&whole, &square(1.0 - 1e-9, 0.2, 1.0)));
        assert!(overlap(&whole, &square(0.99, 0.2, 1.0)));
        assert!(overlap(&whole, &square(0.3, 0.3, 0.1)));
        // Only an axis of the triangle separates these.
        let triangle = [[1.0, 1.9], [1.9, 1.0], [2.0, 2.0]].map(DVec2::from_array);
        assert!(!overlap(&whole, &triangle) && !overlap(&triangle, &whole));
    }
}
