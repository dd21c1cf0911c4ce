//! Fragments of a rasteriser, shaded as the interactions of camera rays are.

use super::Wave;
use crate::integrator::Probe;
use crate::integrator::media;
use crate::integrator::shading::Fragment;
use crate::integrator::visible_hit::{Footprint, VisibleHit};
use crate::integrator::whitted::Whitted;
use crate::integrator::whitted::interaction::SurfaceInteraction;
use crate::integrator::whitted::ray_state::{PathState, RayState};
use crate::material::MaterialPoint;
use crate::math::Rgb;
use crate::shape::{Surface, SurfaceInputs8};

/// Fragments that are shaded together.
pub(crate) struct FragmentWave<'a, 'w> {
    whitted: &'a mut Whitted<'w>,
    wave: Wave,
    surface_inputs: SurfaceInputs8,
}

impl<'w> Whitted<'w> {
    /// A wave of fragments, still empty.
    pub(crate) fn fragments(&mut self) -> FragmentWave<'_, 'w> {
        let mut wave = std::mem::take(&mut self.waves.pending);
        wave.batch.clear();
        wave.interactions.clear();
        wave.footprints.clear();
        let surface_inputs = std::mem::replace(&mut self.waves.surface_inputs, SurfaceInputs8::NONE);
        FragmentWave { whitted: self, wave, surface_inputs }
    }

    /// The colour of one fragment, for a probe that observes it as the hit of a camera ray.
    pub(crate) fn shade_fragment<P: Probe + ?Sized>(&mut self, fragment: &Fragment, probe: &mut P) -> Rgb {
        let Fragment { line, hit, differential, sample, .. } = fragment;
        let ray = RayState {
            ray: line.rounded(),
            line: *line,
            path_state: PathState::EYE,
            sample: *sample,
            differential: *differential,
        };
        probe.ray(ray.path_state.kind, &ray.ray, ray.path_state.depth, ray.path_state.attenuation);
        let (surface, material, footprint) = self.evaluate(fragment, probe);
        let (inside, crossing) = (media::NONE, media::NONE);
        let visible_hit = VisibleHit { hit: *hit, surface, material, line: *line, footprint, inside, crossing };
        let at = SurfaceInteraction::new(&visible_hit, &ray);
        probe.hit(at.hit, &visible_hit.surface, at.material, at.frame.outside);
        let color = self.shade_under_overlay(&at, probe);
        probe.end(color);
        color
    }

    /// The surface of a fragment, with the texture coordinates and the normal of its textures.
    pub(crate) fn fragment_surface(&self, fragment: &Fragment) -> Surface {
        self.evaluate(fragment, &mut ()).0
    }

    /// The surface and the material of a fragment.
    fn evaluate<P: Probe + ?Sized>(
        &self,
        fragment: &Fragment,
        probe: &mut P,
    ) -> (Surface, MaterialPoint, Option<Footprint>) {
        let Fragment { line, hit, facet, is_flat, differential, .. } = fragment;
        let (world, material) = (self.world, self.world.material(hit));
        let mut surface = match facet {
            Some(facet) => world.facet_surface(*line, hit, facet),
            None => world.surface(*line, hit),
        };
        if *is_flat {
            surface.shading_normal = surface.normal;
        }
        let footprint = Footprint::new(differential.as_ref(), line, &surface);
        let step = footprint.map(|f| f.step);
        let mut point = match facet {
            _ if material.textures.is_empty() => material.at(&surface),
            Some(facet) => world.textured_facet(*line, (hit, facet), &mut surface, step, probe),
            None => world.textured(*line, hit, &mut surface, step, probe),
        };
        // A rasteriser draws what is there in part as a whole.
        point.coverage = 1.0;
        (surface, point, footprint)
    }
}

impl FragmentWave<'_, '_> {
    /// Adds a fragment.
    #[inline]
    pub(crate) fn push(&mut self, fragment: &Fragment) {
        let Fragment { line, hit, facet, is_flat, differential, sample } = fragment;
        let FragmentWave { whitted, wave, surface_inputs } = self;
        let index = wave.batch.len();
        wave.batch.push_camera_rays(&[*line], &[*sample], &[], *differential);
        let material = whitted.world.material(hit);
        let (interactions8, lane) = wave.interactions.next();
        surface_inputs.set_line(lane, line);
        if facet.is_none() && !is_flat && differential.is_none() && material.is_plain() {
            let color = whitted.world.push_surface(line, hit, lane, surface_inputs, &mut interactions8.surfaces);
            wave.interactions.push(index, hit, surface_inputs, |point| *point = material.colored(color));
        } else {
            let (surface, point, footprint) = whitted.evaluate(fragment, &mut ());
            wave.footprints.extend(footprint);
            interactions8.surfaces.set(lane, &surface);
            wave.interactions.push(index, hit, surface_inputs, |material| *material = point);
        }
    }

    /// Gives `add` the colour of each fragment in turn: (5.39b) up to the stage of the settings, without reflected
    /// and refracted rays, and with opaque coverage.
    pub(crate) fn shade(self, mut add: impl FnMut(Rgb)) {
        let FragmentWave { whitted, mut wave, mut surface_inputs } = self;
        wave.interactions.evaluate(&mut surface_inputs);
        whitted.waves.surface_inputs = surface_inputs;
        whitted.shade_wave(&mut wave);
        for interaction in wave.interactions.each() {
            add(interaction.material.under_overlay(interaction.color));
        }
        wave.batch.clear();
        whitted.waves.pending = wave;
    }
}
