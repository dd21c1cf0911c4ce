//! The balance of light over a hierarchy: gathering over links, pushing down and pulling up (Hanrahan, Salzman,
//! Aupperle 1991), until the residual is small.

use super::RadiosityError;
use super::gathering::{Gathering, parents};
use super::hierarchical::means;
use super::link::Link;
use super::mesh::{NONE, PatchMesh};
use crate::job::{Observer, SolvingPhase};
use glam::DVec3;

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
) -> Result<(Light, Gathering, f64), RadiosityError> {
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
            return Ok((light, gathering, if all > 0.0 { change / all } else { 0.0 }));
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

/// Adds to each node what its parent has.
pub(super) fn push<T: Copy + std::ops::AddAssign>(parents: &[u32], values: &mut [T]) {
    for node in 0..values.len() {
        if let Some(&parent) = values.get(parents[node] as usize) {
            values[node] += parent;
        }
    }
}
