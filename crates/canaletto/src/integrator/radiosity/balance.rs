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
}

/// The factors of all links, by receiver. Links to clusters are those of their members.
struct Gathering {
    /// For each node, the first of its factors; the last number is the number of all factors.
    firsts: Vec<u32>,
    /// Source and form factor.
    factors: Vec<(u32, f32)>,
}

impl Gathering {
    fn new(mesh: &PatchMesh, links: &[Link]) -> Gathering {
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

    fn of(&self, node: usize) -> &[(u32, f32)] {
        &self.factors[self.firsts[node] as usize..self.firsts[node + 1] as usize]
    }
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
    let parents: Vec<u32> = (0..nodes as u32).map(|node| mesh.parent(node)).collect();
    let leaf = |node: usize| node >= clusters && mesh.elements[node - clusters].is_leaf();
    // The sum of the form factors of each node and of all nodes around it.
    let mut sums: Vec<f64> =
        (0..nodes).map(|node| gathering.of(node).iter().map(|&(_, factor)| f64::from(factor)).sum()).collect();
    push(&parents, &mut sums);
    let mut given = arriving.to_vec();
    push(&parents, &mut given);
    // The factor of what a leaf receives, and what its form factors lack, if it is closed.
    let closure: Vec<(f64, f64)> = (0..mesh.elements.len())
        .map(|element| {
            let sum = sums[clusters + element];
            if !closed.get(element).copied().unwrap_or(false) {
                return (1.0, 0.0);
            }
            let scale = if sum > MOST_IN_VIEW { MOST_IN_VIEW / sum } else { 1.0 };
            (scale, 1.0 - scale * sum)
        })
        .collect();
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
        light.radiance = next;
        if change <= RESIDUAL * all || all == 0.0 {
            light.from_emitters = from_emitters(mesh, &gathering, &parents, &closure);
            return Ok((light, if all > 0.0 { change / all } else { 0.0 }));
        }
        slow = if change > before * LEAST_REDUCTION { slow + 1 } else { 0 };
        if slow > 50 || !all.is_finite() {
            return Err(RadiosityError::Endless);
        }
        before = change;
    }
    Err(RadiosityError::Endless)
}

/// What leaves receive from emitters without a reflection.
fn from_emitters(mesh: &PatchMesh, gathering: &Gathering, parents: &[u32], closure: &[(f64, f64)]) -> Vec<DVec3> {
    let clusters = mesh.clusters.len();
    let mut emission = vec![DVec3::ZERO; clusters];
    emission.extend(mesh.elements.iter().map(|element| element.emission));
    let emission = means(mesh, emission);
    let mut received = gathering.received(&emission);
    push(parents, &mut received);
    for (node, &(scale, missing)) in (clusters..).zip(closure) {
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
