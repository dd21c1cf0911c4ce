//! Interactions of rays with surfaces.

use super::Whitted;
use super::ray_state::{PathState, RayState};
use crate::integrator::visible_hit::{Footprint, Frame, VisibleHit, visible_hit};
use crate::material::MaterialPoint;
use crate::sampler::Sample;
use crate::world::Hit;

/// An interaction of one ray: the first surface that it sees, with everything that shading asks of it.
pub(super) struct SurfaceInteraction<'a> {
    pub(super) hit: &'a Hit,
    pub(super) material: &'a MaterialPoint,
    pub(super) frame: Frame,
    pub(super) footprint: Option<&'a Footprint>,
    /// The bodies that the ray is in.
    pub(super) inside: u32,
    /// The crossing for rays into a clear body, with the coinciding surfaces, or
    /// [`NONE`](crate::integrator::media::NONE).
    pub(super) crossing: u32,
    /// The state of the ray.
    pub(super) path_state: PathState,
    /// The source of random numbers of the ray.
    pub(super) sample: &'a Sample,
}

impl<'a> SurfaceInteraction<'a> {
    /// The interaction of a ray with the surface that it sees.
    pub(super) fn new(visible_hit: &'a VisibleHit, ray: &'a RayState) -> SurfaceInteraction<'a> {
        let VisibleHit { hit, surface, material, line, footprint, inside, crossing } = visible_hit;
        SurfaceInteraction {
            hit,
            material,
            frame: Frame::new(line.direction, surface),
            footprint: footprint.as_ref(),
            inside: *inside,
            crossing: *crossing,
            path_state: ray.path_state,
            sample: &ray.sample,
        }
    }
}

impl Whitted<'_> {
    /// The first surface that a ray sees, which isn't counted.
    pub(super) fn seen_by(&mut self, ray: &RayState) -> Option<VisibleHit> {
        let found = self.world.intersect_at(&ray.ray, f32::INFINITY, self.time);
        let PathState { inside, first_crossing, .. } = ray.path_state;
        let arriving = (ray.line, ray.ray, found, ray.differential.as_ref());
        visible_hit(self.world, &mut self.media, arriving, [inside, first_crossing], self.time, &mut ())
    }
}
