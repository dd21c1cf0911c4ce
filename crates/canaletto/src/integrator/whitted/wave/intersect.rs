//! The first surfaces that the rays of a wave see.

use super::Wave;
use super::interactions::Interaction;
use crate::integrator::Probe;
use crate::integrator::media;
use crate::integrator::visible_hit::VisibleHit;
use crate::integrator::visible_hit::{background, visible_hit};
use crate::integrator::whitted::Whitted;
use crate::integrator::whitted::ray_state::PathState;

impl Whitted<'_> {
    /// Finds the nearest surface of each ray, past holes. A ray without a hit gets the environment's or background's
    /// colour.
    pub(in crate::integrator::whitted) fn intersect<P: Probe + ?Sized>(&mut self, wave: &mut Wave, probe: &mut P) {
        let Wave { batch, colors, interactions, footprints, .. } = wave;
        let world = self.world;
        colors.clear();
        colors.resize(batch.len(), world.background);
        interactions.clear();
        footprints.clear();
        self.waves.bundle.set(&batch.rays, f32::INFINITY);
        self.waves.bundle.set_times(batch.times.iter().copied());
        world.intersect_batch(&mut self.waves.bundle);
        let surface_inputs = &mut self.waves.surface_inputs;
        let has_clear = world.has_clear();
        for (index, color) in colors.iter_mut().enumerate() {
            if probe.is_active() {
                let PathState { kind, depth, attenuation, .. } = batch.path_state(index);
                probe.ray(kind, &batch.rays[index], depth, attenuation);
            }
            let (found, differential) = (self.waves.bundle.hit(index), batch.differential(index));
            let start = if has_clear { batch.start_of(index) } else { [media::NONE; 2] };
            if !probe.is_active()
                && differential.is_none()
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
                interactions.push(index, &hit, surface_inputs, |point| *point = material.colored(color));
                if is_clear {
                    (interactions.last_mut().inside, interactions.last_mut().crossing) = (inside, media::SIMPLE);
                }
                continue;
            }
            let ray = (batch.lines[index], batch.rays[index], found, differential);
            let Some(visible_hit) = visible_hit(world, &mut self.media, ray, start, batch.time(index), probe) else {
                if let Some(backdrop) = self.backdrop.filter(|_| batch.path_state(index).is_straight) {
                    *color = backdrop;
                } else if world.environment.is_some() {
                    *color = background(world, batch.lines[index].direction, differential, probe);
                }
                probe.miss(*color);
                probe.end(*color);
                continue;
            };
            let VisibleHit { hit, surface, material: point, line, footprint, inside, crossing } = visible_hit;
            probe.hit(&hit, &surface, &point, line.direction.dot(surface.normal) < 0.0);
            footprints.extend(footprint);
            let (interactions8, lane) = interactions.next();
            interactions8.surfaces.set(lane, &surface);
            surface_inputs.set_line(lane, &line);
            interactions.push(index, &hit, surface_inputs, |material| *material = point);
            (interactions.last_mut().inside, interactions.last_mut().crossing) = (inside, crossing);
        }
        interactions.evaluate(surface_inputs);
        batch.count(interactions.each().iter().map(Interaction::ray_index), &mut self.counts);
    }
}
