//! The balance of light over a hierarchy: gathering over links, pushing down and pulling up (Hanrahan, Salzman,
//! Aupperle 1991), until the residual is small.

use super::RadiosityError;
use super::hierarchical::means;
use super::link::Link;
use super::mesh::{NONE, PatchMesh};
use crate::job::{Observer, SolvingPhase};
use glam::DVec3;
use rayon::prelude::*;

/// The largest residual of a solution: the light that one more bounce would change, relative to all light.
pub(super) const RESIDUAL: f64 = 1e-7;

/// The most bounces. Each reduces the residual by the largest mean reflectance at least.
const MAX_BOUNCES: usize = 20_000;

/// The least reduction of the residual from bounce to bounce with which light still ends.
const LEAST_REDUCTION: f64 = 1.0 - 1e-5;

/// Light of all nodes of a hierarchy, in red, green and blue.
#[derive(Clone, Debug, Default)]
pub(super) struct Light {
    /// The radiance that leaves a node.
    pub(super) radiance: Vec<DVec3>,
    /// The light that arrives from other patches.
    pub(super) received: Vec<DVec3>,
    /// The part of it that emitters send without a reflection.
    pub(super) from_emitters: Vec<DVec3>,
    /// The radiance that `received` was gathered from: that of the bounce before, or what shooting has sent.
    pub(super) sent: Vec<DVec3>,
    /// The part of `sent` that nodes emit themselves.
    pub(super) sent_emission: Vec<DVec3>,
}

/// The factors of all links, by receiver. Links to clusters are those of their members.
pub(super) struct Gathering {
    /// For each node, the first of its factors; the last number is the number of all factors.
    firsts: Vec<u32>,
    /// Source and form factor.
    factors: Vec<(u32, f32)>,
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
        let mut all: Vec<(u32, u32, f32)> = links.par_iter().flat_map_iter(of_link).collect();
        all.par_sort_unstable_by_key(|&(receiver, source, _)| (receiver, source));
        let mut firsts = vec![0; mesh.nodes() + 1];
        all.iter().for_each(|&(receiver, ..)| firsts[receiver as usize + 1] += 1);
        (0..mesh.nodes()).for_each(|node| firsts[node + 1] += firsts[node]);
        Gathering { firsts, factors: all.into_iter().map(|(_, source, factor)| (source, factor)).collect() }
    }

    /// What all nodes receive over their own links from nodes of these radiances.
    fn received(&self, radiance: &[DVec3]) -> Vec<DVec3> {
        let gather = |node: usize| {
            let factors = self.of(node).iter();
            factors.fold(DVec3::ZERO, |sum, &(source, factor)| sum + radiance[source as usize] * f64::from(factor))
        };
        (0..radiance.len()).into_par_iter().with_min_len(64).map(gather).collect()
    }

    /// The sources of light of a node, with form factors.
    pub(super) fn of(&self, node: usize) -> &[(u32, f32)] {
        &self.factors[self.firsts[node] as usize..self.firsts[node + 1] as usize]
    }

    /// For each element the factor of what it receives, and the form factor to itself. `closed` says for each element
    /// whether no direction is open. The sum of its form factors is then 1.
    pub(super) fn closure(&self, mesh: &PatchMesh, closed: &[bool]) -> Vec<(f64, f64)> {
        let nodes = 0..mesh.nodes();
        // The sum of the form factors of each node and of all nodes around it.
        let mut sums: Vec<f64> =
            nodes.clone().map(|node| self.of(node).iter().map(|&(_, factor)| f64::from(factor)).sum()).collect();
        push(&parents(mesh), &mut sums);
        let of = |element: usize| {
            let sum = sums[mesh.clusters.len() + element];
            if !closed.get(element).copied().unwrap_or(false) {
                return (1.0, 0.0);
            }
            let scale = if sum > MOST_IN_VIEW { MOST_IN_VIEW / sum } else { 1.0 };
            (scale, 1.0 - scale * sum)
        };
        (0..mesh.elements.len()).map(of).collect()
    }
}

/// The parent of each node.
fn parents(mesh: &PatchMesh) -> Vec<u32> {
    (0..mesh.nodes() as u32).map(|node| mesh.parent(node)).collect()
}

/// Solves B = E + ρ (D + F B) for the radiance B of all nodes. `arriving` is D, the light without a patch, of each node
/// where it was found; it holds for all parts of the node. `closed` says for each element whether no direction is open.
/// The sum of its form factors is then 1. What its links lack comes from the patch itself, so that links stay
/// reciprocal and no light is lost or made.
pub(super) fn solve(
    mesh: &PatchMesh,
    links: &[Link],
    arriving: &[DVec3],
    closed: &[bool],
    mut light: Light,
    observer: &dyn Observer,
) -> Result<(Light, f64), RadiosityError> {
    let gathering = Gathering::new(mesh, links);
    let (nodes, clusters) = (mesh.nodes(), mesh.clusters.len());
    let parents = parents(mesh);
    let leaf = |node: usize| node >= clusters && mesh.elements[node - clusters].is_leaf();
    let mut given = arriving.to_vec();
    push(&parents, &mut given);
    let closure = gathering.closure(mesh, closed);
    light.radiance.resize(nodes, DVec3::ZERO);
    let (mut before, mut slow) = (f64::INFINITY, 0);
    for bounce in 0..MAX_BOUNCES {
        if observer.cancelled() {
            return Err(RadiosityError::Cancelled);
        }
        mesh.tell(observer, SolvingPhase::Balance { bounce: bounce as u32 }, links.len());
        let radiance = &light.radiance;
        light.received = gathering.received(radiance);
        push(&parents, &mut light.received);
        let (mut change, mut all) = (0.0, 0.0);
        let mut next = vec![DVec3::ZERO; nodes];
        for node in (0..nodes).rev() {
            let area = mesh.area_of(node as u32);
            if leaf(node) {
                let element = &mesh.elements[node - clusters];
                let (scale, missing) = closure[node - clusters];
                light.received[node] = light.received[node] * scale + light.radiance[node] * missing;
                next[node] = element.emission + element.reflectance * (given[node] + light.received[node]);
                change += (next[node] - light.radiance[node]).abs().max_element() * area;
                all += next[node].max_element() * area;
            } else if area > 0.0 {
                next[node] /= area;
            }
            if parents[node] != NONE {
                let mean = next[node];
                next[parents[node] as usize] += mean * area;
            }
        }
        light.sent = std::mem::replace(&mut light.radiance, next);
        if change <= RESIDUAL * all || all == 0.0 {
            light.sent_emission = emission(mesh);
            light.from_emitters = from_emitters(mesh, &gathering, &light.sent_emission, &parents, &closure);
            return Ok((light, if all > 0.0 { change / all } else { 0.0 }));
        }
        slow = if change > before * LEAST_REDUCTION { slow + 1 } else { 0 };
        if slow > 50 || !all.is_finite() {
            return Err(mesh.endless());
        }
        before = change;
    }
    Err(mesh.endless())
}

/// The radiance that nodes emit themselves.
fn emission(mesh: &PatchMesh) -> Vec<DVec3> {
    let mut emission = vec![DVec3::ZERO; mesh.clusters.len()];
    emission.extend(mesh.elements.iter().map(|element| element.emission));
    means(mesh, emission)
}

/// What leaves receive from emitters without a reflection.
fn from_emitters(
    mesh: &PatchMesh,
    gathering: &Gathering,
    emission: &[DVec3],
    parents: &[u32],
    closure: &[(f64, f64)],
) -> Vec<DVec3> {
    let mut received = gathering.received(emission);
    push(parents, &mut received);
    for (node, &(scale, missing)) in (mesh.clusters.len()..).zip(closure) {
        received[node] = received[node] * scale + emission[node] * missing;
    }
    received
}

/// The largest sum of form factors of a patch. What it receives is scaled down to this sum.
const MOST_IN_VIEW: f64 = 1.25;

/// Adds to each node what its parent has.
fn push<T: Copy + std::ops::AddAssign>(parents: &[u32], values: &mut [T]) {
    for node in 0..values.len() {
        if let Some(&parent) = values.get(parents[node] as usize) {
            values[node] += parent;
        }
    }
}
