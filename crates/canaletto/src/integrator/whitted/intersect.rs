//! Nearest surfaces of rays, past holes and past hidden surfaces of clear bodies.

use super::interaction::{Footprint, Interaction, VisibleHit};
use super::media::{self, Boundary, Media};
use super::ray_batch::PathState;
use super::{Wave, Whitted};
use crate::integrator::Probe;
use crate::math::{DRay, RayDifferential, Rgb, offset_origin};
use crate::world::{Hit, MAX_STALLED, World, touching};
use canaletto_bvh::Ray;
use glam::{DVec3, Vec3};

/// The most holes that a ray passes. After that many, the next hole counts as a surface.
const MAX_HOLES: usize = 1 << 16;

impl Whitted<'_> {
    /// Finds the nearest surface of each ray, past holes. A ray without a hit gets the environment's or background's
    /// colour.
    pub(super) fn intersect<P: Probe>(&mut self, wave: &mut Wave, probe: &mut P) {
        let Wave { batch, colors, interactions, footprints, .. } = wave;
        let (world, time) = (self.world, self.time);
        colors.clear();
        colors.resize(batch.len(), world.background);
        interactions.clear();
        footprints.clear();
        if P::ACTIVE {
            let PathState { kind, depth, attenuation, .. } = batch.path_state(0);
            probe.ray(kind, &batch.rays[0], depth, attenuation);
        }
        self.batch.set(&batch.rays, f32::INFINITY);
        world.intersect_batch(&mut self.batch, time);
        let miss = |index: usize, color: &mut Rgb, probe: &mut P| {
            if let Some(environment) = &world.environment {
                let differential =
                    batch.differential(index).map_or([DVec3::ZERO; 2], |differential| differential.direction);
                let environment_lookup = environment.lookup(batch.lines[index].direction, differential);
                probe.environment_lookup(&environment_lookup);
                *color = environment_lookup.radiance;
            }
            probe.miss(*color);
            probe.end(*color);
        };
        let surface_inputs = &mut self.surface_inputs;
        let mut seen = None;
        let has_clear = world.has_clear();
        for (index, color) in colors.iter_mut().enumerate() {
            let (found, differential) = (self.batch.hit(index), batch.differential(index));
            let start = if has_clear { batch.start_of(index) } else { [media::NONE; 2] };
            if differential.is_none()
                && !P::ACTIVE
                && let Some(hit) = found
                && let material = world.material(&hit)
                && material.is_plain()
                && let is_clear = (has_clear && !material.is_opaque())
                && let [inside, first_crossing] = start
                && (!is_clear && start == [media::NONE; 2]
                    || is_clear
                        && first_crossing == media::NONE
                        && material.coverage >= 1.0
                        && self.media.is_simple(world, &batch.lines[index], &hit, inside))
            {
                let (line, (interactions8, lane)) = (batch.lines[index], interactions.next());
                surface_inputs.set_line(lane, &line);
                let color = world.push_surface(&line, &hit, lane, surface_inputs, &mut interactions8.surfaces);
                interactions.push(index, &hit, surface_inputs, |point| material.set(point, color));
                if is_clear {
                    (interactions.last_mut().inside, interactions.last_mut().crossing) = (inside, media::SIMPLE);
                }
                continue;
            }
            let ray = (batch.lines[index], batch.rays[index], found, differential);
            let Some(met) = intersect_one(world, &mut self.media, ray, start, time, probe) else {
                miss(index, color, probe);
                continue;
            };
            let VisibleHit { hit, surface, material: point, line, footprint, inside, crossing } = met;
            if let Some(mut footprint) = footprint {
                if point.is_mirror() || point.is_clear() {
                    let side = if line.direction.dot(surface.normal) < 0.0 { 1.0 } else { -1.0 };
                    footprint.shape_operator = world.surface_differential(line, &hit).shape_operator * side;
                }
                footprints.push(footprint);
            }
            let (interactions8, lane) = interactions.next();
            interactions8.surfaces.set(lane, &surface);
            surface_inputs.set_line(lane, &line);
            interactions.push(index, &hit, surface_inputs, |material| *material = point);
            (interactions.last_mut().inside, interactions.last_mut().crossing) = (inside, crossing);
            seen = Some(surface);
        }
        interactions.evaluate(surface_inputs);
        batch.count(interactions.each().iter().map(Interaction::ray_index), &mut self.counts);
        if P::ACTIVE
            && let Some(surface) = seen
        {
            let at = interactions.at(0);
            probe.hit(&at.interaction.hit, &surface, &at.interaction.material, at.outside());
        }
    }
}

/// The first visible surface of a ray: past holes, and past surfaces of clear bodies that another body hides. `inside`
/// are the bodies that the ray starts in. `first_crossing` is the coinciding surface at the ray's origin that comes
/// before `found`.
#[inline(never)]
fn intersect_one<P: Probe>(
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
