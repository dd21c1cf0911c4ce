//! Faces that coincide: where a ray meets one surface, what else lies in the same place.
//!
//! A ray that leaves a surface starts beyond the rounding errors of its point, and so beyond every other surface there. They are asked for
//! by a short ray across.

use super::World;
use super::query::Hit;
use crate::math::{DRay, offset_origin};
use crate::shape::Surface;
use canaletto_bvh::Ray;
use glam::Vec3;

/// How far apart faces that coincide may be, relative to their largest coordinate: eight units in the last place, for what a transform
/// has put there.
const TOUCHING: f32 = 8.0 * f32::EPSILON;

/// How nearly parallel they are: the cosine.
const PARALLEL: f64 = 0.999;

/// The bound of a point's error that takes in faces that coincide with its surface.
pub(crate) fn touching(surface: &Surface) -> Vec3 {
    surface.error.max(Vec3::splat(surface.point.abs().max_element() * TOUCHING))
}

/// A surface in the same place as another.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Contact {
    pub(crate) hit: Hit,
    /// Whether the line comes from its outer side.
    pub(crate) outside: bool,
}

impl World {
    /// The surfaces besides the one that `line` meets at `hit` that lie in the same place and are parallel to it, in the order of the scene. Of each
    /// body there is one at most that the line enters by, and one that it leaves by. Calls `across` with those that aren't parallel.
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
            let normal = self.bare_surface(*line, &contact.hit).normal;
            contact.outside = line.direction.dot(normal) < 0.0;
            let parallel = normal.dot(surface.normal).abs() > PARALLEL;
            if !parallel {
                across(&contact.hit);
            }
            parallel
        });
        // Beside an edge of a mesh there are two triangles of one surface.
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
            // The same goes for meshes that aren't closed.
            None => {
                let same = contact.hit.instance == hit.instance && contact.outside == outside && self.is_of_mesh(hit);
                !(same && self.material_index(&contact.hit) == self.material_index(hit))
            }
        });
    }
}
