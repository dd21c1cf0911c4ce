//! The first surface that a ray sees: past holes, and past hidden surfaces of clear bodies.

use super::Whitted;
use super::interaction::{Footprint, Frame, SurfaceInteraction, VisibleHit};
use super::media::{self, Boundary, Media};
use super::ray_state::{PathState, RayState};
use crate::integrator::Probe;
use crate::math::{DRay, RayDifferential, Rgb, offset_origin};
use crate::world::{Hit, MAX_STALLED, World, touching};
use canaletto_bvh::Ray;
use glam::{DVec3, Vec3};

/// The most holes that a ray passes. After that many, the next hole counts as a surface.
const MAX_HOLES: usize = 1 << 16;

impl Whitted<'_> {
    /// The first surface that a ray sees.
    pub(super) fn intersect<P: Probe>(&mut self, ray: &RayState, probe: &mut P) -> Option<VisibleHit> {
        let found = self.world.intersect_at(&ray.ray, f32::INFINITY, self.time);
        let PathState { kind, inside, first_crossing, .. } = ray.path_state;
        let arriving = (ray.line, ray.ray, found, ray.differential.as_ref());
        let visible_hit =
            visible_hit(self.world, &mut self.media, arriving, [inside, first_crossing], self.time, probe);
        let count = self.counts.of_mut(kind);
        count.traced += 1;
        count.hit += u64::from(visible_hit.is_some());
        visible_hit
    }

    /// The colour of a ray that hits nothing.
    pub(super) fn background<P: Probe>(&self, ray: &RayState, probe: &mut P) -> Rgb {
        background(self.world, ray.line.direction, ray.differential.as_ref(), probe)
    }
}

/// The colour of the environment, or of the background without one.
#[inline]
pub(in crate::integrator) fn background<P: Probe>(
    world: &World,
    direction: DVec3,
    differential: Option<&RayDifferential>,
    probe: &mut P,
) -> Rgb {
    let Some(environment) = &world.environment else { return world.background };
    let lookup = environment.lookup(direction, differential.map_or([DVec3::ZERO; 2], |d| d.direction));
    probe.environment_lookup(&lookup);
    lookup.radiance
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

/// The first visible surface of a ray: past holes, and past surfaces of clear bodies that another body hides. `inside`
/// are the bodies that the ray starts in. `first_crossing` is the coinciding surface at the ray's origin that comes
/// before `found`.
#[inline(never)]
pub(super) fn visible_hit<P: Probe>(
    world: &World,
    media: &mut Media,
    (mut line, mut ray, mut found, differential): (DRay, Ray, Option<Hit>, Option<&RayDifferential>),
    [mut inside, mut first_crossing]: [u32; 2],
    time: f32,
    probe: &mut P,
) -> Option<VisibleHit> {
    let mut differential = differential.copied();
    let mut stalled = 0;
    for passed in 0.. {
        let mut crossing = first_crossing;
        // A coinciding surface at the origin has t = 0.
        let mut hit = media.crossing(first_crossing).map(|crossing| Hit { t: 0.0, ..crossing.hit }).or(found)?;
        let material = world.material(&hit);
        let mut known = None;
        if first_crossing == media::NONE && world.has_clear() && (inside != media::NONE || !material.is_opaque()) {
            let surface = world.surface_without_uv(line, &hit);
            match media.boundary(world, (&line, &ray), (&hit, &surface), &mut inside, probe) {
                Boundary::Plain => known = Some(surface),
                Boundary::At(first) => {
                    crossing = first;
                    let first = media.crossing(first).map_or(hit, |crossing| crossing.hit);
                    known = (first == hit).then_some(surface);
                    hit = first;
                }
                Boundary::Hidden(beyond) if passed < MAX_HOLES && stalled <= MAX_STALLED => {
                    inside = beyond;
                    let step =
                        differential.map(|differential| differential.along(&line, surface.exact, surface.normal));
                    differential = differential.zip(step).map(|(differential, step)| differential.passed(step));
                    line.origin = surface.exact;
                    let origin = offset_origin(surface.point, touching(&surface), surface.normal, line.direction);
                    stalled = if advances(&ray, origin) { 0 } else { stalled + 1 };
                    ray = line.from_origin(origin);
                    found = world.intersect_at(&ray, f32::INFINITY, time);
                    continue;
                }
                Boundary::Hidden(_) => {}
            }
        }
        let material = world.material(&hit);
        // Only textures and probes use texture coordinates.
        let is_bare = material.is_plain() && !P::ACTIVE;
        let mut surface = match known {
            Some(surface) if is_bare => surface,
            _ if is_bare => world.surface_without_uv(line, &hit),
            _ => world.surface(line, &hit),
        };
        let (next, touches) = media.crossing(crossing).map_or((media::NONE, false), |c| (c.next, c.touches));
        if touches {
            surface.error = touching(&surface);
        }
        let footprint = Footprint::new(differential.as_ref(), &line, &surface);
        let step = footprint.map(|f| f.step);
        let material = if material.is_plain() {
            material.at(&surface)
        } else {
            world.textured(line, &hit, &mut surface, step, probe)
        };
        if material.coverage > 0.0 || passed >= MAX_HOLES || stalled > MAX_STALLED {
            let footprint = footprint.map(|footprint| {
                if !material.is_mirror() && !material.is_clear() {
                    return footprint;
                }
                let side = if line.direction.dot(surface.normal) < 0.0 { 1.0 } else { -1.0 };
                let shape_operator = world.surface_differential(line, &hit).shape_operator * side;
                Footprint { shape_operator, ..footprint }
            });
            return Some(VisibleHit { hit, surface, material, line, footprint, inside, crossing });
        }
        probe.hole(&hit);
        inside = media.crossing(crossing).map_or(inside, |crossing| crossing.beyond);
        first_crossing = next;
        line.origin = surface.exact;
        differential = footprint.map(|f| f.differential.passed(f.step));
        if first_crossing == media::NONE {
            let origin = offset_origin(surface.point, surface.error, surface.normal, line.direction);
            stalled = if advances(&ray, origin) { 0 } else { stalled + 1 };
            ray = line.from_origin(origin);
            found = world.intersect_at(&ray, f32::INFINITY, time);
        }
    }
    None
}

/// Whether an origin lies farther along a ray than the ray's own. A surface that is flatter than roundings sends rays
/// back to where they came from, and would be hit again and again.
fn advances(ray: &Ray, origin: Vec3) -> bool {
    (origin - ray.origin).dot(ray.direction) > 0.0
}
