//! The local pass: light at vertices by a sum over the links of the patch around them (Lischinski, Tampieri, Greenberg
//! 1993). The form factors are those of the vertex, so that light is smooth where links make it even over patches. The
//! light at the centres of patches is found first. Centres and vertices then get the light that these reflect.

use super::balance::Light;
use super::gathering::{Gathering, closure_of};
use super::hierarchical::means;
use super::mesh::PatchMesh;
use super::outline::CELLS;
use crate::world::OccluderCache;
use canaletto_parallel::prelude::*;
use glam::{DVec3, Vec3};
use std::borrow::Cow;

/// How far vertices are moved towards the centre of their patch, relative to the distance. A vertex in the plane of a
/// source would see nothing of it.
const INSET: f64 = 1.0 / 64.0;

/// The distance from the centre of a source, relative to its radius, within which its parts count one by one.
const NEAR: f64 = 2.0;

/// The number of rays after which no more are traced to a source if these agree. They end in different quarters.
const FEW_RAYS: f64 = 4.0;

/// The radiance of all nodes by emission, and by the reflection of light that was found at centres of patches.
#[derive(Clone, Debug)]
pub(super) struct LocalRadiance {
    pub(super) emission: Vec<DVec3>,
    pub(super) reflection: Vec<DVec3>,
}

/// A node as a point of a patch sees it.
pub(super) struct SeenNode {
    pub(super) node: u32,
    /// The share of the point's view that the node fills.
    pub(super) form_factor: f64,
    /// The element around the point that the node has a link to.
    pub(super) receiver: u32,
}

/// A solution whose light is found at points of patches.
pub(super) struct LocalPass<'a> {
    mesh: &'a PatchMesh<'a>,
    gathering: &'a Gathering,
    closed: &'a [bool],
    radiance: Cow<'a, LocalRadiance>,
    /// What patches receive at their centres, in the order of the leaves: from emitters, and by reflections.
    pub(super) centers: Vec<[DVec3; 2]>,
}

impl<'a> LocalPass<'a> {
    /// `given` is the light without a patch of each leaf.
    pub(super) fn new(
        mesh: &'a PatchMesh<'a>,
        gathering: &'a Gathering,
        closed: &'a [bool],
        light: &Light,
        given: &[DVec3],
    ) -> LocalPass<'a> {
        let emission = light.sent_emission.clone();
        let reflection =
            light.radiance.iter().zip(&emission).map(|(&all, &own)| (all - own).max(DVec3::ZERO)).collect();
        let radiance = Cow::Owned(LocalRadiance { emission, reflection });
        let mut pass = LocalPass { mesh, gathering, closed, radiance, centers: Vec::new() };
        let leaves = mesh.leaf_elements();
        let centers = pass.at_centers(&leaves);
        for ((&leaf, &[from_emitters, reflected]), &given) in leaves.iter().zip(&centers).zip(given) {
            pass.radiance.to_mut().reflection[mesh.node(leaf) as usize] =
                mesh.elements[leaf as usize].reflectance * (given + from_emitters + reflected);
        }
        let radiance = pass.radiance.to_mut();
        radiance.reflection = means(mesh, std::mem::take(&mut radiance.reflection));
        pass.centers = pass.at_centers(&leaves);
        pass
    }

    /// A pass whose radiance was found. It has no centres.
    pub(super) fn again(
        mesh: &'a PatchMesh<'a>,
        gathering: &'a Gathering,
        closed: &'a [bool],
        radiance: &'a LocalRadiance,
    ) -> LocalPass<'a> {
        LocalPass { mesh, gathering, closed, radiance: Cow::Borrowed(radiance), centers: Vec::new() }
    }

    pub(super) fn into_radiance(self) -> LocalRadiance {
        self.radiance.into_owned()
    }

    fn at_centers(&self, leaves: &[u32]) -> Vec<[DVec3; 2]> {
        let at_center = |&leaf: &u32| self.received(leaf, self.mesh.elements[leaf as usize].center);
        leaves.par_iter().with_min_len(16).map(at_center).collect()
    }

    /// What a patch receives at one of its points: from emitters, and by reflections.
    pub(super) fn received(&self, patch: u32, point: DVec3) -> [DVec3; 2] {
        let LocalRadiance { emission, reflection } = &*self.radiance;
        let mut received = [DVec3::ZERO; 2];
        let (scale, missing) = self.visit_seen(patch, point, |seen| {
            received[0] += emission[seen.node as usize] * seen.form_factor;
            received[1] += reflection[seen.node as usize] * seen.form_factor;
        });
        if !self.closed[patch as usize] {
            return received;
        }
        let node = self.mesh.node(patch) as usize;
        let own = [emission[node], reflection[node]];
        [0, 1].map(|i| (received[i] * scale + own[i] * missing).max(DVec3::ZERO))
    }

    /// Visits what a point of a patch sees. Returns the factor of all form factors and the patch's form factor to
    /// itself, as in the balance: the factors of a closed patch sum to 1.
    pub(super) fn visit_seen(&self, patch: u32, point: DVec3, mut visit: impl FnMut(SeenNode)) -> (f64, f64) {
        let mesh = self.mesh;
        let element = &mesh.elements[patch as usize];
        let root = &mesh.roots[element.root as usize];
        let point = point + (element.center - point) * INSET;
        let mut start = Start { origin: None, last: OccluderCache::NONE };
        let mut sum = 0.0;
        let mut receiver = Some(patch);
        let mut sources = Vec::new();
        while let Some(of) = receiver {
            for link in self.gathering.of(mesh.node(of) as usize) {
                sources.push(link.source);
                while let Some(source) = sources.pop() {
                    let (center, radius) = mesh.ball(source);
                    let is_near = point.distance_squared(center) < NEAR * NEAR * radius * radius;
                    let parts = mesh.element_of(source).filter(|_| is_near).map(|_| mesh.children(source));
                    if let Some(parts) = parts.filter(|parts| !parts.is_empty()) {
                        sources.extend(parts);
                        continue;
                    }
                    let in_view = mesh.factor_at(point, root.normal, source);
                    if in_view <= 0.0 {
                        continue;
                    }
                    let origin = || root.ray_origin(mesh.world, point);
                    let factor = in_view * self.visibility(source, link.visibility, &mut start, origin);
                    sum += factor;
                    visit(SeenNode { node: source, form_factor: factor, receiver: of });
                }
            }
            receiver = mesh.element_of(mesh.elements[of as usize].parent);
        }
        if self.closed[patch as usize] { closure_of(sum) } else { (1.0, 0.0) }
    }

    /// The share of a source that the point sees. Only partly hidden elements need rays.
    fn visibility(&self, source: u32, of_link: f32, start: &mut Start, origin: impl FnOnce() -> Vec3) -> f64 {
        let source = self.mesh.element_of(source).filter(|_| of_link < 1.0);
        let Some(source) = source.map(|source| &self.mesh.elements[source as usize]) else {
            return f64::from(of_link);
        };
        let from = *start.origin.get_or_insert_with(origin);
        let (mut passed, mut count) = (0.0, 0.0);
        for cell in (0..CELLS).filter(|&cell| source.is_bare(cell)) {
            passed += self.mesh.transmittance(from, source.origins[cell], &mut start.last);
            count += 1.0;
            if count == FEW_RAYS && (passed == 0.0 || passed == count) {
                break;
            }
        }
        if count > 0.0 { passed / count } else { 0.0 }
    }
}

/// The start of rays from a point.
struct Start {
    origin: Option<Vec3>,
    last: OccluderCache,
}
