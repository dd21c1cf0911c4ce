//! The equations of all pairs of patches, on patches of about equal area.

use super::balance::{Light, solve};
use super::exchange::Effort;
use super::hierarchical::{closed, given};
use super::link::Link;
use super::mesh::PatchMesh;
use super::{Balanced, RadiosityError, RadiositySettings};
use crate::job::{Observer, SolvingPhase};
use canaletto_parallel::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// The largest area of a patch, relative to all area times the squared wanted error.
const PATCH_AREA: f64 = 2.5;

/// Splits all elements down to the area that the wanted error allows.
pub(super) fn subdivide_evenly(mesh: &mut PatchMesh, settings: &RadiositySettings) {
    let error = f64::from(settings.error);
    let largest = mesh.area * (PATCH_AREA * error * error).min(1.0);
    let mut waiting: Vec<u32> = (0..mesh.elements.len() as u32).collect();
    while !waiting.is_empty() {
        waiting.retain(|&element| {
            let element = &mesh.elements[element as usize];
            element.is_leaf() && element.area > largest
        });
        let from = mesh.elements.len() as u32;
        mesh.subdivide(&waiting);
        waiting = (from..mesh.elements.len() as u32).collect();
    }
}

/// Solves with links between all pairs of patches.
pub(super) fn full(
    mesh: &mut PatchMesh,
    settings: &RadiositySettings,
    observer: &dyn Observer,
) -> Result<Balanced, RadiosityError> {
    subdivide_evenly(mesh, settings);
    let (mut given, _) = given(mesh, settings, false, observer)?;
    closed(mesh, &mut given);
    let leaves = mesh.leaf_elements();
    let this = &*mesh;
    let found = AtomicUsize::new(0);
    let row = |number: usize| -> Vec<Link> {
        if observer.cancelled() {
            return Vec::new();
        }
        let p = leaves[number];
        let to = |&q: &u32| {
            Some(this.between(p, q, Effort::Few))
                .filter(|exchange| exchange.factor > 0.0)
                .map(|exchange| Link::between([p, q].map(|element| this.node(element)), &exchange))
        };
        let links: Vec<Link> = leaves[number + 1..].iter().filter_map(to).collect();
        let found = found.fetch_add(links.len(), Ordering::Relaxed) + links.len();
        this.tell(observer, SolvingPhase::Links { round: 1, rounds: 1 }, found);
        links
    };
    let links: Vec<Link> = (0..leaves.len()).into_par_iter().map(row).collect().concat();
    let (light, gathering, residual) = solve(this, &links, &given.all(), &given.closed, Light::default(), observer)?;
    Ok(Balanced { given, light, residual, exchanges: links.len(), gathering: Some(gathering) })
}
