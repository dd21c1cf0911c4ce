//! Fragments of a rasteriser, shaded as the interactions of camera rays are.

use super::Wave;
use crate::integrator::Probe;
use crate::integrator::shading::Fragment;
use crate::integrator::visible_hit::Footprint;
use crate::integrator::whitted::Whitted;
use crate::integrator::whitted::ray_state::PathState;
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
        let mut color = Rgb::BLACK;
        let mut wave = self.fragments();
        wave.push_observed(fragment, probe);
        wave.shade_observed(probe, |found| color = found);
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
        self.push_observed(fragment, &mut ());
    }

    #[inline]
    fn push_observed<P: Probe + ?Sized>(&mut self, fragment: &Fragment, probe: &mut P) {
        let Fragment { line, hit, facet, is_flat, differential, sample } = fragment;
        let FragmentWave { whitted, wave, surface_inputs } = self;
        let index = wave.batch.len();
        wave.batch.push_camera_rays(&[*line], &[*sample], &[], *differential);
        let material = whitted.world.material(hit);
        let (interactions8, lane) = wave.interactions.next();
        surface_inputs.set_line(lane, line);
        if !probe.is_active() && facet.is_none() && !is_flat && differential.is_none() && material.is_plain() {
            let color = whitted.world.push_surface(line, hit, lane, surface_inputs, &mut interactions8.surfaces);
            wave.interactions.push(index, hit, surface_inputs, |point| *point = material.colored(color));
        } else {
            let PathState { kind, depth, attenuation, .. } = PathState::EYE;
            probe.ray(kind, &line.rounded(), depth, attenuation);
            let (surface, point, footprint) = whitted.evaluate(fragment, probe);
            probe.hit(hit, &surface, &point, line.direction.dot(surface.normal) < 0.0);
            wave.footprints.extend(footprint);
            interactions8.surfaces.set(lane, &surface);
            wave.interactions.push(index, hit, surface_inputs, |material| *material = point);
        }
    }

    /// Gives `add` the colour of each fragment in turn: (5.39b) up to the stage of the settings, without reflected
    /// and refracted rays, and with opaque coverage.
    pub(crate) fn shade(self, add: impl FnMut(Rgb)) {
        self.shade_observed(&mut (), add);
    }

    fn shade_observed<P: Probe + ?Sized>(self, probe: &mut P, mut add: impl FnMut(Rgb)) {
        let FragmentWave { whitted, mut wave, mut surface_inputs } = self;
        wave.interactions.evaluate(&mut surface_inputs);
        whitted.waves.surface_inputs = surface_inputs;
        whitted.shade(&mut wave, probe);
        for interaction in wave.interactions.each() {
            let color = interaction.under_overlay(probe);
            probe.end(color);
            add(color);
        }
        wave.batch.clear();
        whitted.waves.pending = wave;
    }
}
