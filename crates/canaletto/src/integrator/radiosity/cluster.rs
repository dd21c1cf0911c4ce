//! Clusters: groups of roots that exchange light as one (Smits, Arvo, Greenberg 1994; Sillion 1994).

use super::mesh::{Element, NONE};
use super::root::Root;
use glam::{DMat3, DVec3};

/// The most roots of a cluster without clusters in it.
const FEW: usize = 4;

/// A group of roots that are near each other.
#[derive(Clone, Debug)]
pub(super) struct Cluster {
    pub(super) parent: u32,
    /// The numbers of the nodes in it.
    pub(super) children: Vec<u32>,
    /// The range of root elements in it.
    pub(super) elements: std::ops::Range<u32>,
    pub(super) center: DVec3,
    pub(super) radius: f64,
    pub(super) sums: Sums,
}

/// Sums over the sides in a cluster.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sums {
    pub(super) area: f64,
    /// Σ A ρ.
    reflecting: DVec3,
    /// Σ A n.
    normal: DVec3,
    /// Σ A n nᵀ.
    spread: DMat3,
}

impl Sums {
    pub(super) const ZERO: Sums = Sums { area: 0.0, reflecting: DVec3::ZERO, normal: DVec3::ZERO, spread: DMat3::ZERO };

    pub(super) fn add(&mut self, area: f64, reflectance: DVec3, n: DVec3) {
        self.area += area;
        self.reflecting += reflectance * area;
        self.normal += n * area;
        self.spread += DMat3::from_cols(n * n.x, n * n.y, n * n.z) * area;
    }

    pub(super) fn add_all(&mut self, other: &Sums) {
        self.area += other.area;
        self.reflecting += other.reflecting;
        self.normal += other.normal;
        self.spread += other.spread;
    }

    pub(super) fn mean_reflectance(&self) -> DVec3 {
        if self.area > 0.0 { self.reflecting / self.area } else { DVec3::ZERO }
    }

    /// The projected area Σ A max(0, n·d) of the sides that face a unit direction d.
    ///
    /// It is ½ Σ A |n·d| + ½ Σ A n·d. The first sum is estimated by the root of the mean square. That is exact for
    /// parallel sides, and 15 % too large for sides of all directions.
    pub(super) fn projected(&self, d: DVec3) -> f64 {
        let square = (self.spread * d).dot(d).max(0.0);
        (0.5 * ((self.area * square).sqrt() + self.normal.dot(d))).max(0.0)
    }
}

/// The clusters of root elements, and the elements' new order: their old numbers with their parents. Outer and inner
/// sides have clusters of their own. Both sides of a wall are at one place, and each has the light of its own room.
pub(super) fn clusters(elements: &[Element], roots: &[Root]) -> (Vec<Cluster>, Vec<(u32, u32)>) {
    let is_outer = |element: &u32| roots[elements[*element as usize].root as usize].is_outer;
    let (mut order, inner): (Vec<u32>, Vec<u32>) = (0..elements.len() as u32).partition(is_outer);
    let outer = order.len();
    order.extend(inner);
    let mut parents = vec![NONE; elements.len()];
    let mut clusters: Vec<Cluster> = Vec::new();
    // Ranges of `order` with the cluster that they belong to.
    let mut waiting = vec![(0..elements.len(), NONE)];
    while let Some((range, parent)) = waiting.pop() {
        let number = clusters.len() as u32;
        let points = || range.clone().flat_map(|i| elements[order[i] as usize].outline.corners().iter().copied());
        let min = points().fold(DVec3::INFINITY, DVec3::min);
        let max = points().fold(DVec3::NEG_INFINITY, DVec3::max);
        let center = if range.is_empty() { DVec3::ZERO } else { (min + max) * 0.5 };
        let radius = points().map(|p| p.distance(center)).fold(0.0, f64::max);
        clusters.push(Cluster {
            parent,
            children: Vec::new(),
            elements: range.start as u32..range.end as u32,
            center,
            radius,
            sums: Sums::ZERO,
        });
        if let Some(above) = clusters.get_mut(parent as usize) {
            above.children.push(number);
        }
        if range.len() <= FEW {
            range.clone().for_each(|i| parents[i] = number);
            continue;
        }
        if parent == NONE && outer > 0 && outer < range.len() {
            waiting.push((outer..range.end, number));
            waiting.push((range.start..outer, number));
            continue;
        }
        let middle = range.start + range.len() / 2;
        let centers = || range.clone().map(|i| elements[order[i] as usize].center);
        let (low, high) =
            (centers().fold(DVec3::INFINITY, DVec3::min), centers().fold(DVec3::NEG_INFINITY, DVec3::max));
        let size = high - low;
        let axis = if size.x >= size.y && size.x >= size.z {
            0
        } else if size.y >= size.z {
            1
        } else {
            2
        };
        let part = &mut order[range.clone()];
        part.select_nth_unstable_by(middle - range.start, |&a, &b| {
            let at = |i: u32| elements[i as usize].center[axis];
            at(a).total_cmp(&at(b)).then(a.cmp(&b))
        });
        part[..middle - range.start].sort_unstable();
        part[middle - range.start..].sort_unstable();
        waiting.push((middle..range.end, number));
        waiting.push((range.start..middle, number));
    }
    let first = clusters.len() as u32;
    for (i, &parent) in parents.iter().enumerate() {
        clusters[parent as usize].children.push(first + i as u32);
    }
    let order = order.into_iter().zip(parents).collect();
    (clusters, order)
}
