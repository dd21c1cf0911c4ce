//! The form factors of all links, by receiver.

use super::balance::push;
use super::link::Link;
use super::mesh::PatchMesh;
use canaletto_parallel::prelude::*;
use glam::DVec3;

/// What a node receives from another, relative to the other's radiance.
#[derive(Clone, Copy, Debug)]
pub(super) struct Factor {
    pub(super) source: u32,
    /// The form factor with visibility.
    pub(super) factor: f32,
    pub(super) visibility: f32,
}

/// The factors of all links, by receiver. Links to clusters are those of their members.
pub(super) struct Gathering {
    /// For each node, the first of its factors; the last number is the number of all factors.
    firsts: Vec<u32>,
    factors: Vec<Factor>,
}

impl Gathering {
    pub(super) fn new(mesh: &PatchMesh, links: &[Link]) -> Gathering {
        let of_link = |link: &Link| -> Vec<(u32, u32, f32)> {
            let ([p, q], visibility) = (link.nodes, f64::from(link.visibility));
            if visibility == 0.0 || mesh.area_of(p) == 0.0 || mesh.area_of(q) == 0.0 {
                return Vec::new();
            }
            let area = |node: u32| mesh.area_of(node);
            let members = |cluster: u32| mesh.clusters[cluster as usize].elements.clone();
            // The factors of all members of a cluster to another node.
            let factors = |cluster: u32, other: u32| {
                let factor = move |member| (mesh.node(member), mesh.factor_of_member(member, other) * visibility);
                members(cluster).map(factor).filter(|&(_, factor)| factor > 0.0)
            };
            // Light between a cluster and an element has the same power in both directions.
            let both = |cluster: u32, element: u32| {
                let back = move |member: u32, factor: f64| (factor * area(member) / area(element)) as f32;
                factors(cluster, element)
                    .flat_map(|(member, factor)| {
                        [(member, element, factor as f32), (element, member, back(member, factor))]
                    })
                    .collect()
            };
            match [p, q].map(|node| mesh.element_of(node).is_some()) {
                [true, true] => {
                    let back = (f64::from(link.factor) * area(p) / area(q)) as f32;
                    vec![(p, q, link.factor), (q, p, back)]
                }
                [false, true] => both(p, q),
                [true, false] => both(q, p),
                [false, false] => {
                    let there = factors(p, q).map(|(member, factor)| (member, q, factor as f32));
                    there.chain(factors(q, p).map(|(member, factor)| (member, p, factor as f32))).collect()
                }
            }
        };
        let with_visibility = |link: &Link| {
            let visibility = link.visibility;
            let factor = move |(receiver, source, factor)| (receiver, Factor { source, factor, visibility });
            of_link(link).into_iter().map(factor).collect::<Vec<_>>()
        };
        let mut all: Vec<(u32, Factor)> = links.par_iter().map(with_visibility).collect().concat();
        let place = |&(receiver, Factor { source, .. }): &(u32, Factor)| (receiver, source);
        rayon::slice::ParallelSliceMut::par_sort_unstable_by_key(&mut *all, place);
        let mut firsts = vec![0; mesh.nodes() + 1];
        all.iter().for_each(|&(receiver, ..)| firsts[receiver as usize + 1] += 1);
        (0..mesh.nodes()).for_each(|node| firsts[node + 1] += firsts[node]);
        Gathering { firsts, factors: all.into_iter().map(|(_, factor)| factor).collect() }
    }

    /// What all nodes receive over their own links from nodes of these radiances.
    pub(super) fn received(&self, radiance: &[DVec3]) -> Vec<DVec3> {
        let gather = |node: usize| {
            let factors = self.of(node).iter();
            factors.fold(DVec3::ZERO, |sum, factor| sum + radiance[factor.source as usize] * f64::from(factor.factor))
        };
        (0..radiance.len()).into_par_iter().with_min_len(64).map(gather).collect()
    }

    /// The sources of light of a node, with form factors.
    pub(super) fn of(&self, node: usize) -> &[Factor] {
        &self.factors[self.firsts[node] as usize..self.firsts[node + 1] as usize]
    }

    /// For each element the factor of what it receives, and the form factor to itself. `closed` says for each element
    /// whether no direction is open. The sum of its form factors is then 1.
    pub(super) fn closure(&self, mesh: &PatchMesh, closed: &[bool]) -> Vec<(f64, f64)> {
        let nodes = 0..mesh.nodes();
        // The sum of the form factors of each node and of all nodes around it.
        let mut sums: Vec<f64> =
            nodes.clone().map(|node| self.of(node).iter().map(|factor| f64::from(factor.factor)).sum()).collect();
        push(&parents(mesh), &mut sums);
        let of = |element: usize| {
            let sum = sums[mesh.clusters.len() + element];
            if !closed.get(element).copied().unwrap_or(false) {
                return (1.0, 0.0);
            }
            closure_of(sum)
        };
        (0..mesh.elements.len()).map(of).collect()
    }
}

/// The factor of what a closed place receives, and its form factor to itself, for a sum of form factors to others.
pub(super) fn closure_of(sum: f64) -> (f64, f64) {
    let scale = if sum > MOST_IN_VIEW { MOST_IN_VIEW / sum } else { 1.0 };
    (scale, 1.0 - scale * sum)
}

/// The largest sum of form factors of a patch. What it receives is scaled down to this sum.
const MOST_IN_VIEW: f64 = 1.25;

/// The parent of each node.
pub(super) fn parents(mesh: &PatchMesh) -> Vec<u32> {
    (0..mesh.nodes() as u32).map(|node| mesh.parent(node)).collect()
}
