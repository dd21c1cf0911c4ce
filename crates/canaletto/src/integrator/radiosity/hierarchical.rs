//! Hierarchical radiosity with clusters: links are refined in rounds, each with the light that the last one found
//! ("multigridding"; Hanrahan, Salzman, Aupperle 1991; Smits, Arvo, Greenberg 1994).

use super::balance::{Light, solve};
use super::link::{Link, Refinement};
use super::mesh::PatchMesh;
use super::sources::Arriving;
use super::{Balanced, RadiosityError, RadiositySettings};
use crate::job::{Observer, SolvingPhase};
use canaletto_parallel::prelude::*;
use glam::DVec3;

/// The largest error of a link, relative to the wanted error times all reflected light.
const LINK_SHARE: f64 = 3e-4;

/// The largest error of light without a patch on an element, relative to that of a link.
const GIVEN_SHARE: f64 = 60.0;

/// The factors of the limit in successive rounds.
const ROUNDS: [f64; 4] = [64.0, 8.0, 1.0, 1.0];

/// Light that arrives at nodes without a patch.
#[derive(Clone, Debug, Default)]
pub(super) struct Given {
    /// The light of the scene's lights, where it was found.
    pub(super) lit: Vec<DVec3>,
    /// The light of the environment, where it was found.
    pub(super) sky: Vec<DVec3>,
    /// For each element, whether no direction is open.
    pub(super) closed: Vec<bool>,
}

impl Given {
    /// The light at all nodes, where it was found.
    pub(super) fn all(&self) -> Vec<DVec3> {
        self.lit.iter().zip(&self.sky).map(|(&lit, &sky)| lit + sky).collect()
    }

    /// Finds the light of all leaves again that have that of a larger element.
    fn find_at_leaves(&mut self, mesh: &PatchMesh) {
        let clusters = mesh.clusters.len();
        // Elements within one that has light of its own.
        let mut has_light_above = vec![false; mesh.elements.len()];
        for element in 0..mesh.elements.len() {
            if let Some(parent) = mesh.element_of(mesh.elements[element].parent) {
                let above = clusters + parent as usize;
                has_light_above[element] = has_light_above[parent as usize]
                    || self.lit[above] != DVec3::ZERO
                    || self.sky[above] != DVec3::ZERO;
            }
        }
        let mut leaves = mesh.leaf_elements();
        leaves.retain(|&leaf| has_light_above[leaf as usize]);
        let found: Vec<[Arriving; 2]> = leaves.par_iter().map(|&leaf| mesh.without_patches(leaf)).collect();
        for (element, node) in mesh.elements.iter().zip(clusters..) {
            if !element.is_leaf() {
                (self.lit[node], self.sky[node]) = (DVec3::ZERO, DVec3::ZERO);
            }
        }
        for (leaf, [lit, sky]) in leaves.into_iter().zip(found) {
            let node = mesh.node(leaf) as usize;
            (self.lit[node], self.sky[node]) = (lit.mean, sky.mean);
        }
    }

    /// Room for new nodes, which have none but their parents' light.
    pub(super) fn extend(&mut self, mesh: &PatchMesh) {
        self.lit.resize(mesh.nodes(), DVec3::ZERO);
        self.sky.resize(mesh.nodes(), DVec3::ZERO);
        for element in self.closed.len()..mesh.elements.len() {
            let parent = mesh.element_of(mesh.elements[element].parent);
            self.closed.push(parent.is_some_and(|parent| self.closed[parent as usize]));
        }
    }
}

/// Finds the light that arrives without a patch. Elements are subdivided where it varies by more than the wanted error.
/// Returns the light with the power that it and emission give to reflections.
pub(super) fn given(
    mesh: &mut PatchMesh,
    settings: &RadiositySettings,
    subdivides: bool,
    observer: &dyn Observer,
) -> Result<(Given, f64), RadiosityError> {
    let mut given = Given::default();
    let mut waiting = mesh.leaf_elements();
    let emitted: f64 = waiting
        .iter()
        .map(|&element| &mesh.elements[element as usize])
        .map(|element| element.emission.max_element() * element.area)
        .sum();
    let mut power = emitted;
    let mut limit = f64::INFINITY;
    while !waiting.is_empty() {
        if observer.cancelled() {
            return Err(RadiosityError::Cancelled);
        }
        mesh.tell(observer, SolvingPhase::Lights, 0);
        let this = &*mesh;
        let found: Vec<[Arriving; 2]> = waiting.par_iter().map(|&element| this.without_patches(element)).collect();
        let reflected = |(&element, [lit, sky]): (&u32, &[Arriving; 2])| {
            let element = &this.elements[element as usize];
            (element.reflectance * (lit.mean + sky.mean)).max_element() * element.area
        };
        if limit == f64::INFINITY {
            power += waiting.iter().zip(&found).map(reflected).sum::<f64>();
            limit = f64::from(settings.error) * LINK_SHARE * GIVEN_SHARE * power;
        }
        given.extend(this);
        let mut refined = Vec::new();
        for (&number, [lit, sky]) in waiting.iter().zip(&found) {
            let element = &this.elements[number as usize];
            let error = (element.reflectance * (lit.spread + sky.spread * SKY_NOISE)).max_element() * element.area;
            if subdivides && error > limit && this.is_divisible(number) {
                refined.push(number);
            }
            let node = this.node(number) as usize;
            (given.lit[node], given.sky[node]) = (lit.mean, sky.mean);
        }
        mesh.subdivide(&refined);
        waiting.clear();
        for number in refined {
            let node = mesh.node(number);
            let parts = mesh.children(node);
            if !parts.is_empty() {
                (given.lit[node as usize], given.sky[node as usize]) = (DVec3::ZERO, DVec3::ZERO);
                waiting.extend(parts.into_iter().filter_map(|part| mesh.element_of(part)));
            }
        }
    }
    given.extend(mesh);
    Ok((given, power))
}

/// Each cell sees another part of the environment, so that cells differ by more than the light does.
const SKY_NOISE: f64 = 0.1;

/// Which of the roots see nothing but surfaces, for all their parts.
pub(super) fn closed(mesh: &PatchMesh, given: &mut Given) {
    let is_root = |element: u32| mesh.element_of(mesh.elements[element as usize].parent).is_none();
    given.closed = (0..mesh.elements.len() as u32)
        .into_par_iter()
        .map(|element| is_root(element) && mesh.sky(element).1 == 0.0)
        .collect();
    for element in 0..mesh.elements.len() {
        if let Some(parent) = mesh.element_of(mesh.elements[element].parent) {
            given.closed[element] = given.closed[parent as usize];
        }
    }
}

/// Solves by links that are refined in rounds.
pub(super) fn hierarchical(
    mesh: &mut PatchMesh,
    settings: &RadiositySettings,
    observer: &dyn Observer,
) -> Result<Balanced, RadiosityError> {
    let (mut given, power) = given(mesh, settings, true, observer)?;
    closed(mesh, &mut given);
    let mut radiance = vec![DVec3::ZERO; mesh.clusters.len()];
    for (element, node) in mesh.elements.iter().zip(mesh.clusters.len()..) {
        radiance.push(element.emission + element.reflectance * (given.lit[node] + given.sky[node]));
    }
    let mut light = Light { radiance: means(mesh, radiance), ..Light::default() };
    let mut deviation = deviations(mesh, &light.radiance);
    let mut links: Vec<Link> = Vec::new();
    let mut gathering = None;
    let mut reflected = power;
    let mut residual = 0.0;
    for (round, factor) in ROUNDS.into_iter().enumerate() {
        let limit = f64::from(settings.error) * LINK_SHARE * factor * reflected;
        let phase = SolvingPhase::Links { round: round as u32 + 1, rounds: ROUNDS.len() as u32 };
        let mut refinement =
            Refinement { mesh, radiance: &mut light.radiance, deviation: &mut deviation, limit, phase };
        if round == 0 {
            refinement.link_all(vec![(0, 0)], &mut links, observer)?;
        } else {
            links = refinement.refine(links, observer)?;
        }
        given.extend(mesh);
        if round + 1 == ROUNDS.len() {
            given.find_at_leaves(mesh);
        }
        // The last round's form factors go before those of this one come.
        drop(gathering.take());
        let solved = solve(mesh, &links, &given.all(), &given.closed, light, observer)?;
        (light, residual) = (solved.0, solved.2);
        gathering = Some(solved.1);
        deviation = deviations(mesh, &light.radiance);
        let of = |(element, node): (&super::mesh::Element, usize)| {
            let light = light.radiance[node] - element.emission;
            if element.is_leaf() { light.max_element() * element.area } else { 0.0 }
        };
        reflected = mesh.elements.iter().zip(mesh.clusters.len()..).map(of).sum::<f64>().max(power * LEAST_REFLECTED);
    }
    Ok(Balanced { given, light, residual, exchanges: links.len(), gathering })
}

/// The least reflected light that errors are relative to, relative to emitted light.
const LEAST_REFLECTED: f64 = 1e-3;

/// The radiance of nodes from that of leaves: means weighted by area.
pub(super) fn means(mesh: &PatchMesh, mut radiance: Vec<DVec3>) -> Vec<DVec3> {
    let clusters = mesh.clusters.len();
    let mut sums = vec![DVec3::ZERO; mesh.nodes()];
    for node in (0..mesh.nodes()).rev() {
        let area = mesh.area_of(node as u32);
        let is_leaf = node >= clusters && mesh.elements[node - clusters].is_leaf();
        if !is_leaf {
            radiance[node] = if area > 0.0 { sums[node] / area } else { DVec3::ZERO };
        }
        if let Some(sum) = sums.get_mut(mesh.parent(node as u32) as usize) {
            *sum += radiance[node] * area;
        }
    }
    radiance
}

/// The deviation within a leaf, relative to that within the element that it is a part of.
const DEVIATION_OF_PART: f64 = 0.5;

/// The deviation within an undivided root, relative to the light that it reflects.
const DEVIATION_OF_ROOT: f64 = 0.2;

/// The root of the mean square by which the radiance within each node deviates from its mean. That within leaves is
/// estimated.
fn deviations(mesh: &PatchMesh, radiance: &[DVec3]) -> Vec<f64> {
    let clusters = mesh.clusters.len();
    let squares: Vec<DVec3> = radiance.iter().map(|b| *b * *b).collect();
    let squares = means(mesh, squares);
    let mut deviation: Vec<f64> =
        radiance.iter().zip(squares).map(|(b, square)| (square - *b * *b).max_element().max(0.0).sqrt()).collect();
    for (number, element) in mesh.elements.iter().enumerate().filter(|(_, element)| element.is_leaf()) {
        let node = clusters + number;
        deviation[node] = match mesh.element_of(element.parent) {
            Some(_) => deviation[element.parent as usize] * DEVIATION_OF_PART,
            None => (radiance[node] - element.emission).max_element() * DEVIATION_OF_ROOT,
        };
    }
    deviation
}
