//! Progressive refinement: the patch with the most light that it hasn't sent yet sends it, again and again (Cohen,
//! Chen, Wallace, Greenberg 1988).

use super::balance::Light;
use super::exchange::Effort;
use super::full::subdivide_evenly;
use super::hierarchical::{Given, given, means};
use super::mesh::PatchMesh;
use super::{Balanced, RadiosityError, RadiositySettings, RadiositySolution};
use crate::job::{Observer, SolvingPhase};
use canaletto_parallel::prelude::*;
use glam::DVec3;

/// The share of all light that may be missing because light stays unsent, relative to the wanted error.
const UNSENT: f64 = 0.1;

/// The state after a step.
#[derive(Clone, Copy)]
#[non_exhaustive]
pub struct ShootingStep<'a> {
    /// The number of patches that have sent light.
    pub step: usize,
    /// The share of all light that isn't sent yet.
    pub unsent: f64,
    /// The ambient light that stands for it: the radiance of a white surface in it.
    pub ambient: DVec3,
    /// The radiance of each patch with ambient light, in the order of the solution's patches.
    pub radiance: &'a [DVec3],
    mesh: &'a PatchMesh<'a>,
    given: &'a Given,
    /// The patches, and the light that they received: all, and straight from emitting surfaces.
    leaves: &'a [u32],
    received: &'a [DVec3],
    from_emitters: &'a [DVec3],
}

impl ShootingStep<'_> {
    /// The solution after this step, with the ambient light added to the light of each patch.
    pub fn solution(&self) -> RadiositySolution {
        let received: Vec<DVec3> = self.received.iter().map(|light| *light + self.ambient).collect();
        let light = light_of(self.mesh, self.leaves, self.radiance, &received, self.from_emitters);
        let (given, exchanges) = (self.given.clone(), self.step * self.leaves.len());
        let balanced = Balanced { given, light, residual: self.unsent, exchanges, gathering: None };
        RadiositySolution::new(self.mesh, &balanced).0
    }
}

/// The light of all nodes from that of the leaves.
fn light_of(
    mesh: &PatchMesh,
    leaves: &[u32],
    radiance: &[DVec3],
    received: &[DVec3],
    from_emitters: &[DVec3],
) -> Light {
    let at_nodes = |values: &[DVec3]| at_nodes(mesh, leaves, values);
    Light {
        radiance: means(mesh, at_nodes(radiance)),
        received: at_nodes(received),
        from_emitters: at_nodes(from_emitters),
        ..Light::default()
    }
}

/// The values of leaves in the order of all nodes.
fn at_nodes(mesh: &PatchMesh, leaves: &[u32], values: &[DVec3]) -> Vec<DVec3> {
    let mut all = vec![DVec3::ZERO; mesh.nodes()];
    for (value, &number) in values.iter().zip(leaves) {
        all[mesh.node(number) as usize] = *value;
    }
    all
}

/// A watcher of each step of shooting.
pub trait ShootingWatcher: Send {
    /// Called after each step.
    fn step(&mut self, _step: &ShootingStep) {}

    /// Whether steps are of interest. If not, none is reported.
    fn watches(&self) -> bool {
        false
    }
}

/// The empty watcher.
impl ShootingWatcher for () {}

/// Solves by shooting.
pub(super) fn shooting(
    mesh: &mut PatchMesh,
    settings: &RadiositySettings,
    observer: &dyn Observer,
    watcher: &mut dyn ShootingWatcher,
) -> Result<Balanced, RadiosityError> {
    subdivide_evenly(mesh, settings);
    let (given, _) = given(mesh, settings, false, observer)?;
    let mesh = &*mesh;
    let leaves = mesh.leaf_elements();
    let all = given.all();
    let mut arriving = all.clone();
    for node in mesh.clusters.len()..mesh.nodes() {
        if mesh.element_of(mesh.parent(node as u32)).is_some() {
            let above = arriving[mesh.parent(node as u32) as usize];
            arriving[node] += above;
        }
    }
    let element = |leaf: usize| &mesh.elements[leaves[leaf] as usize];
    let mut radiance: Vec<DVec3> = (0..leaves.len())
        .map(|leaf| element(leaf).emission + element(leaf).reflectance * arriving[mesh.node(leaves[leaf]) as usize])
        .collect();
    let mut unsent = radiance.clone();
    let mut received = vec![DVec3::ZERO; leaves.len()];
    let mut from_emitters = received.clone();
    let mut emitted: Vec<DVec3> = (0..leaves.len()).map(|leaf| element(leaf).emission).collect();
    let area: f64 = leaves.iter().map(|&leaf| mesh.elements[leaf as usize].area).sum();
    let mean =
        |of: &dyn Fn(usize) -> DVec3| (0..leaves.len()).map(|leaf| of(leaf) * element(leaf).area).sum::<DVec3>() / area;
    let reflectance = mean(&|leaf| element(leaf).reflectance);
    // The sum of the light of all bounces in a room of the mean reflectance.
    let bounces = DVec3::ONE / (DVec3::ONE - reflectance).max(DVec3::splat(1e-6));
    let (mut steps, mut last_round) = (0, f64::INFINITY);
    let rest = loop {
        let left = mean(&|leaf| unsent[leaf]);
        let share = left.max_element() / mean(&|leaf| radiance[leaf]).max_element().max(f64::MIN_POSITIVE);
        mesh.tell(observer, SolvingPhase::Shooting { step: steps as u64, unsent: share }, steps * leaves.len());
        if steps > 0 && watcher.watches() {
            let ambient = left * bounces;
            let shown: Vec<DVec3> =
                (0..leaves.len()).map(|leaf| radiance[leaf] + element(leaf).reflectance * ambient).collect();
            watcher.step(&ShootingStep {
                step: steps,
                unsent: share,
                ambient,
                radiance: &shown,
                mesh,
                given: &given,
                leaves: &leaves,
                received: &received,
                from_emitters: &from_emitters,
            });
        }
        if share * bounces.max_element() <= UNSENT * f64::from(settings.error) || left.max_element() == 0.0 {
            break share;
        }
        if observer.cancelled() {
            return Err(RadiosityError::Cancelled);
        }
        if steps % leaves.len() == 0 {
            if left.max_element() > last_round * LEAST_REDUCTION {
                return Err(mesh.endless());
            }
            last_round = left.max_element();
        }
        let power = |leaf: usize| unsent[leaf].element_sum() * element(leaf).area;
        let from = (0..leaves.len()).fold(0, |best, leaf| if power(leaf) > power(best) { leaf } else { best });
        let sent = std::mem::take(&mut unsent[from]);
        let straight = std::mem::take(&mut emitted[from]);
        let factors: Vec<f64> =
            leaves.par_iter().map(|&leaf| mesh.between(leaf, leaves[from], Effort::Few).factor).collect();
        for (leaf, factor) in factors.into_iter().enumerate() {
            if factor > 0.0 {
                let light = sent * factor;
                received[leaf] += light;
                from_emitters[leaf] += straight * factor;
                radiance[leaf] += element(leaf).reflectance * light;
                unsent[leaf] += element(leaf).reflectance * light;
            }
        }
        steps += 1;
    };
    let mut light = light_of(mesh, &leaves, &radiance, &received, &from_emitters);
    let sent: Vec<DVec3> = radiance.iter().zip(&unsent).map(|(all, unsent)| *all - *unsent).collect();
    light.sent = at_nodes(mesh, &leaves, &sent);
    let sent: Vec<DVec3> = (0..leaves.len()).map(|leaf| element(leaf).emission - emitted[leaf]).collect();
    light.sent_emission = at_nodes(mesh, &leaves, &sent);
    Ok(Balanced { given, light, residual: rest, exchanges: steps * leaves.len(), gathering: None })
}

/// The reduction of unsent light by as many steps as there are patches, with which light still ends.
const LEAST_REDUCTION: f64 = 0.999;

#[cfg(test)]
mod tests;
