//! Faces that coincide: the surfaces that lie in the place of a hit.
//!
//! A ray that leaves a surface starts beyond the rounding errors of its point, and so beyond every other surface there.
//! A short ray across the surface finds them.

use crate::math::{DRay, offset_origin};
use crate::shape::Surface;
use crate::world::World;
use crate::world::trace::query::Hit;
use canaletto_bvh::Ray;
use glam::Vec3;

/// The largest distance between coinciding faces, relative to their largest coordinate. Eight units in the last place
/// allow for the roundings of a transform.
const TOUCHING: f32 = 8.0 * f32::EPSILON;

/// The least cosine between the normals of coinciding faces.
const PARALLEL: f64 = 0.999;

/// The error bound of a point, widened to include faces that coincide with its surface.
pub(crate) fn touching(surface: &Surface) -> Vec3 {
    surface.error.max(Vec3::splat(surface.point.abs().max_element() * TOUCHING))
}

/// A surface that coincides with another.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Contact {
    pub(crate) hit: Hit,
    /// Whether the line comes from the surface's outer side.
    pub(crate) outside: bool,
}

impl World {
    /// Finds the surfaces that coincide with the one that `line` hits at `hit` and are parallel to it, in the order of
    /// the scene. Each body has at most one surface by which the line enters, and one by which it leaves. Calls
    /// `across` with coinciding surfaces that aren't parallel.
    pub(crate) fn contacts(
        &self,
        line: &DRay,
        hit: &Hit,
        surface: &Surface,
        contacts: &mut Vec<Contact>,
        mut across: impl FnMut(&Hit),
    ) {
        contacts.clear();
        if !self.may_touch(line, hit) {
            return;
        }
        let error = touching(surface);
        let [near, far] =
            [-surface.normal, surface.normal].map(|side| offset_origin(surface.point, error, surface.normal, side));
        let ray = Ray { origin: near, direction: far - near };
        self.each_between(&ray, 1.0, hit.time, &mut |other| {
            if (other.instance, other.primitive) != (hit.instance, hit.primitive) {
                contacts.push(Contact { hit: Hit { t: hit.t, ..other }, outside: true });
            }
        });
        if contacts.is_empty() {
            return;
        }
        contacts.sort_unstable_by_key(|contact| (contact.hit.instance, contact.hit.primitive));
        contacts.dedup_by_key(|contact| (contact.hit.instance, contact.hit.primitive));
        contacts.retain_mut(|contact| {
            let normal = self.surface_without_uv(*line, &contact.hit).normal;
            contact.outside = line.direction.dot(normal) < 0.0;
            let parallel = normal.dot(surface.normal).abs() > PARALLEL;
            if !parallel {
                across(&contact.hit);
            }
            parallel
        });
        // Beside an edge of a mesh, two triangles belong to one surface.
        let outside = line.direction.dot(surface.normal) < 0.0;
        let body = |hit: &Hit| self.body(hit).map(|body| body.id);
        let own = body(hit).map(|id| (id, outside));
        let mut seen: Vec<_> = own.into_iter().collect();
        contacts.retain(|contact| match body(&contact.hit).map(|id| (id, contact.outside)) {
            Some(side) if seen.contains(&side) => false,
            Some(side) => {
                seen.push(side);
                true
            }
            // This applies to meshes that aren't closed, too.
            None => {
                let same = contact.hit.instance == hit.instance && contact.outside == outside && self.is_of_mesh(hit);
                !(same && self.material_index(&contact.hit) == self.material_index(hit))
            }
        });
    }
}
