//! What rays meet: the nearest surfaces, past holes, and past the surfaces of clear bodies that aren't there.

use super::media::{self, Boundary, Media};
use super::stop::{Footprint, Met, Stop};
use super::way::Branch;
use super::{Generation, Whitted};
use crate::integrator::Probe;
use crate::math::{Line, Rgb, Spread, offset_origin};
use crate::world::{Hit, MAX_STALLED, World, touching};
use canaletto_bvh::Ray;
use glam::DVec3;

/// The most holes that a ray goes through; beyond them it meets what is around the next one.
const MAX_HOLES: usize = 1 << 16;

impl Whitted<'_> {
    /// The nearest surfaces on the ways, past holes. Colours become what is seen where there is none.
    pub(super) fn meet<P: Probe>(&mut self, generation: &mut Generation, probe: &mut P) {
        let Generation { ways, colors, stops, footprints, .. } = generation;
        let (world, time) = (self.world, self.time);
        colors.clear();
        colors.resize(ways.len(), world.background);
        stops.clear();
        footprints.clear();
        if P::ACTIVE {
            let Branch { kind, depth, factor, .. } = ways.branch(0);
            probe.ray(kind, &ways.rays[0], depth, factor);
        }
        self.bundle.set(&ways.rays, f32::INFINITY);
        world.intersect_bundle(&mut self.bundle, time);
        let miss = |index: usize, color: &mut Rgb, probe: &mut P| {
            if let Some(environment) = &world.environment {
                let spread = ways.spread(index).map_or([DVec3::ZERO; 2], |spread| spread.direction);
                let sighting = environment.look(ways.lines[index].direction, spread);
                probe.sighting(&sighting);
                *color = sighting.radiance;
            }
            probe.miss(*color);
            probe.end(*color);
        };
        let encounters = &mut self.encounters;
        let mut seen = None;
        let has_clear = world.has_clear();
        for (index, color) in colors.iter_mut().enumerate() {
            let (found, spread) = (self.bundle.hit(index), ways.spread(index));
            let start = if has_clear { ways.start_of(index) } else { [media::NONE; 2] };
            if spread.is_none()
                && !P::ACTIVE
                && let Some(hit) = found
                && let material = world.material(&hit)
                && material.is_plain()
                && let is_clear = has_clear
                && !material.is_opaque()
                && let [inside, meets] = start
                && (!is_clear && start == [media::NONE; 2]
                    || is_clear
                        && meets == media::NONE
                        && material.coverage >= 1.0
                        && self.media.is_simple(world, &ways.lines[index], &hit, inside))
            {
                let (line, (octet, lane)) = (ways.lines[index], stops.next());
                encounters.set_line(lane, &line);
                let color = world.meet(&line, &hit, lane, encounters, &mut octet.surfaces);
                stops.push(index, &hit, encounters, |point| material.set(point, color));
                if is_clear {
                    (stops.last_mut().inside, stops.last_mut().crossing) = (inside, media::SIMPLE);
                }
                continue;
            }
            let way = (ways.lines[index], ways.rays[index], found, spread);
            let Some(met) = meet_one(world, &mut self.media, way, start, time, probe) else {
                miss(index, color, probe);
                continue;
            };
            let Met { hit, surface, material: point, line, footprint, inside, crossing } = met;
            if let Some(mut footprint) = footprint {
                if point.is_mirror() || point.is_clear() {
                    let side = if line.direction.dot(surface.normal) < 0.0 { 1.0 } else { -1.0 };
                    footprint.bend = world.patch(line, &hit).bend * side;
                }
                footprints.push(footprint);
            }
            let (octet, lane) = stops.next();
            octet.surfaces.set(lane, &surface);
            encounters.set_line(lane, &line);
            stops.push(index, &hit, encounters, |material| *material = point);
            (stops.last_mut().inside, stops.last_mut().crossing) = (inside, crossing);
            seen = Some(surface);
        }
        stops.settle(encounters);
        ways.count(stops.each().iter().map(Stop::way), &mut self.counts);
        if P::ACTIVE
            && let Some(surface) = seen
        {
            let at = stops.at(0);
            probe.hit(&at.stop.hit, &surface, &at.stop.material, at.outside());
        }
    }
}

/// What a way meets first that is there: past holes, and past surfaces of clear bodies where another one fills the place. `inside` are the bodies
/// that it starts in, and `meets` the surface where it starts that it meets before `found`.
#[inline(never)]
fn meet_one<P: Probe>(
    world: &World,
    media: &mut Media,
    (mut line, mut ray, mut found, spread): (Line, Ray, Option<Hit>, Option<&Spread>),
    [mut inside, mut meets]: [u32; 2],
    time: f32,
    probe: &mut P,
) -> Option<Met> {
    let mut spread = spread.copied();
    let mut stalled = 0;
    for passed in 0.. {
        let mut crossing = meets;
        // A way that meets something where it starts meets it at t = 0.
        let mut hit = media.crossing(meets).map(|crossing| Hit { t: 0.0, ..crossing.hit }).or(found)?;
        let material = world.material(&hit);
        let mut known = None;
        if meets == media::NONE && world.has_clear() && (inside != media::NONE || !material.is_opaque()) {
            let surface = world.bare_surface(line, &hit);
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
                    let step = spread.map(|spread| spread.along(&line, surface.exact, surface.normal));
                    spread = spread.zip(step).map(|(spread, step)| spread.passed(step));
                    stalled = if (surface.exact - line.origin).dot(line.direction) > 0.0 { 0 } else { stalled + 1 };
                    line.origin = surface.exact;
                    let origin = offset_origin(surface.point, touching(&surface), surface.normal, line.direction);
                    ray = line.from_origin(origin);
                    found = world.intersect_at(&ray, f32::INFINITY, time);
                    continue;
                }
                Boundary::Hidden(_) => {}
            }
        }
        let material = world.material(&hit);
        // Only textures and a probe ask for texture coordinates.
        let is_bare = material.is_plain() && !P::ACTIVE;
        let mut surface = match known {
            Some(surface) if is_bare => surface,
            _ if is_bare => world.bare_surface(line, &hit),
            _ => world.surface(line, &hit),
        };
        let (next, touches) = media.crossing(crossing).map_or((media::NONE, false), |c| (c.next, c.touches));
        if touches {
            surface.error = touching(&surface);
        }
        let footprint = Footprint::new(spread.as_ref(), &line, &surface);
        let step = footprint.map(|f| f.step);
        let material = if material.is_plain() {
            material.at(&surface)
        } else {
            world.textured(line, &hit, &mut surface, step, probe)
        };
        if material.coverage > 0.0 || passed >= MAX_HOLES || stalled > MAX_STALLED {
            return Some(Met { hit, surface, material, line, footprint, inside, crossing });
        }
        probe.hole(&hit);
        inside = media.crossing(crossing).map_or(inside, |crossing| crossing.beyond);
        meets = next;
        stalled = if (surface.exact - line.origin).dot(line.direction) > 0.0 { 0 } else { stalled + 1 };
        line.origin = surface.exact;
        spread = footprint.map(|f| f.spread.passed(f.step));
        if meets == media::NONE {
            let origin = offset_origin(surface.point, surface.error, surface.normal, line.direction);
            ray = line.from_origin(origin);
            found = world.intersect_at(&ray, f32::INFINITY, time);
        }
    }
    None
}
