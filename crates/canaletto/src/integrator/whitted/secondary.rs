//! Secondary rays: mirrored rays, refracted rays, and rays past surfaces of partial coverage.

use super::interaction::{Footprint, InteractionRef};
use super::media::{Crossing, NONE, Refraction, SIMPLE};
use super::ray_batch::{PathState, RayBatch, RayState, uses};
use super::{Wave, Whitted};
use crate::integrator::{Probe, RayKind};
use crate::material::{reflect, reflect_into_hemisphere, refract, sample_ggx_vndf};
use crate::math::{RayDifferential, Rgb};
use glam::{DMat3, DVec3};

/// The most surfaces of partial coverage that a path passes.
const MAX_PASSED: u32 = 64;

impl Whitted<'_> {
    /// Adds the light along the mirrored directions.
    pub(super) fn reflect<P: Probe>(&mut self, wave: &mut Wave, probe: &mut P) {
        self.follow(wave, probe, |whitted, batch, at, footprint, probe| {
            if !at.interaction.is_seen() || !at.interaction.material.is_mirror() {
                return None;
            }
            let phong = &at.interaction.material.phong;
            let path_state = whitted.child(whitted.parent(at, batch), RayKind::Reflected, phong.k, probe)?;
            let first_crossing = whitted.media.crossing(at.interaction.crossing).map_or(NONE, |c| c.back);
            let path_state = PathState { inside: whitted.inside(at), first_crossing, ..path_state };
            let direction = match microfacet(at, batch, uses::REFLECTION_MICROFACET) {
                None => keep_above(at.mirrored(), at),
                Some(microfacet) => {
                    probe.lobe(phong.roughness, microfacet);
                    reflect_into_hemisphere(reflect(at.wo(), microfacet), at.facing())
                }
            };
            Some(child_ray(at, batch, path_state, direction, differential_above(at, footprint)))
        });
    }

    /// Adds the light through clear bodies.
    pub(super) fn refract<P: Probe>(&mut self, wave: &mut Wave, probe: &mut P) {
        self.follow(wave, probe, |whitted, batch, at, footprint, probe| {
            if !at.interaction.is_seen() || !at.interaction.material.is_clear() {
                return None;
            }
            let phong = &at.interaction.material.phong;
            let Crossing { refraction, beyond, next, back, .. } = match at.interaction.crossing {
                SIMPLE => whitted.media.simple(whitted.world, &at.interaction.hit, at.outside(), at.interaction.inside),
                crossing => *whitted.media.crossing(crossing)?,
            };
            let transmitted = Rgb::gray(1.0 - phong.opacity);
            let Refraction::Outer(outer) = refraction else {
                let path_state = whitted.child(whitted.parent(at, batch), RayKind::Refracted, transmitted, probe)?;
                let path_state = PathState { inside: beyond, first_crossing: next, ..path_state };
                let differential = footprint.map(|f| f.differential.passed(f.step));
                return Some(child_ray(at, batch, path_state, -at.wo(), differential));
            };
            let eta = f64::from(phong.eta);
            let [from, into] = if at.outside() { [outer, eta] } else { [eta, outer] };
            let eta_ratio = from / into;
            let microfacet = microfacet(at, batch, uses::REFRACTION_MICROFACET);
            let (kind, direction) = match (refract(at.wo(), microfacet.unwrap_or(at.normal()), eta_ratio), microfacet) {
                (Some(direction), None) => (RayKind::Refracted, keep_below(direction, at, eta_ratio)),
                (Some(direction), Some(_)) => (RayKind::Refracted, reflect_into_hemisphere(direction, -at.facing())),
                (None, None) => (RayKind::TotallyReflected, keep_above(at.mirrored(), at)),
                (None, Some(microfacet)) => {
                    (RayKind::TotallyReflected, reflect_into_hemisphere(reflect(at.wo(), microfacet), at.facing()))
                }
            };
            let path_state = whitted.child(whitted.parent(at, batch), kind, transmitted, probe)?;
            let path_state = if kind == RayKind::Refracted {
                probe.bent(from, into);
                PathState { inside: beyond, first_crossing: next, ..path_state }
            } else {
                PathState { inside: whitted.inside(at), first_crossing: back, ..path_state }
            };
            if let Some(microfacet) = microfacet {
                probe.lobe(phong.roughness, microfacet);
            }
            let differential = match kind {
                RayKind::Refracted => differential_below(at, footprint, eta_ratio),
                _ => differential_above(at, footprint),
            };
            Some(child_ray(at, batch, path_state, direction, differential))
        });
    }

    /// Scales the colours of surfaces with partial coverage, and adds the light from behind them.
    pub(super) fn pass<P: Probe>(&mut self, wave: &mut Wave, probe: &mut P) {
        let mut any = false;
        for interaction in
            wave.interactions.all_mut().iter_mut().filter(|interaction| interaction.material.coverage < 1.0)
        {
            probe.coverage(interaction.material.coverage);
            interaction.color *= interaction.material.coverage;
            any = true;
        }
        if !any {
            return;
        }
        self.follow(wave, probe, |whitted, batch, at, footprint, probe| {
            if at.interaction.material.coverage >= 1.0 {
                return None;
            }
            let attenuation = Rgb::gray(1.0 - at.interaction.material.coverage);
            let parent = whitted.parent(at, batch);
            if parent.passed_surfaces == MAX_PASSED {
                probe.cut(RayKind::Passed, attenuation);
                return None;
            }
            // The ray continues unchanged, so its depth is that of its parent.
            let parent = PathState { depth: parent.depth - 1, ..parent };
            let path_state = whitted.child(parent, RayKind::Passed, attenuation, probe)?;
            let path_state = match whitted.media.crossing(at.interaction.crossing) {
                Some(crossing) => PathState { inside: crossing.beyond, first_crossing: crossing.next, ..path_state },
                None => path_state,
            };
            let path_state = PathState { passed_surfaces: path_state.passed_surfaces + 1, ..path_state };
            let differential = footprint.map(|f| f.differential.passed(f.step));
            Some(child_ray(at, batch, path_state, -at.wo(), differential))
        });
        for interaction in
            wave.interactions.all_mut().iter_mut().filter(|interaction| interaction.material.coverage < 1.0)
        {
            interaction.color = interaction.color.saturated();
        }
    }

    /// Traces the rays that `child` returns for some of the interactions, and adds their light to the interactions'
    /// colours.
    fn follow<P: Probe>(
        &mut self,
        wave: &mut Wave,
        probe: &mut P,
        child: impl Fn(&mut Self, &RayBatch, &InteractionRef, Option<&Footprint>, &mut P) -> Option<RayState>,
    ) {
        let mut children = self.wave();
        let mark = self.media.mark();
        for index in 0..wave.interactions.len() {
            let at = wave.interactions.at(index);
            if let Some(ray) = child(self, &wave.batch, &at, wave.footprints.get(index), probe) {
                children.batch.push(ray);
                children.parents.push(index as u32);
            }
        }
        if !children.batch.is_empty() {
            self.trace(&mut children, probe);
            for (ray_index, (color, &parent)) in children.colors.iter().zip(&children.parents).enumerate() {
                wave.interactions.all_mut()[parent as usize].color +=
                    (*color * children.batch.path_state(ray_index).attenuation).saturated();
            }
        }
        self.spare.push(children);
        self.media.release(mark);
    }

    /// The path state of the ray that hit the interaction, with the bodies there. No coinciding surface follows at
    /// once.
    fn parent(&self, at: &InteractionRef, batch: &RayBatch) -> PathState {
        PathState {
            inside: at.interaction.inside,
            first_crossing: NONE,
            ..batch.path_state(at.interaction.ray_index())
        }
    }

    /// The bodies of a ray that stays on its side of the surface.
    fn inside(&mut self, at: &InteractionRef) -> u32 {
        match at.interaction.crossing {
            SIMPLE => self.media.simple_inside(self.world, &at.interaction.hit, at.outside(), at.interaction.inside),
            _ => at.interaction.inside,
        }
    }

    /// The path state of a child ray, unless depth or weight ends the tree here.
    fn child<P: Probe>(
        &mut self,
        parent: PathState,
        kind: RayKind,
        attenuation: Rgb,
        probe: &mut P,
    ) -> Option<PathState> {
        self.poll(1);
        let throughput = (parent.throughput * attenuation).saturated();
        if self.is_cancelled
            || parent.depth >= self.settings.max_depth
            || throughput.max_component() < self.settings.min_weight
        {
            probe.cut(kind, attenuation);
            return None;
        }
        let place = parent.place.of(match kind {
            RayKind::Eye => uses::EYE,
            RayKind::Reflected => uses::REFLECTED,
            RayKind::Refracted | RayKind::TotallyReflected => uses::REFRACTED,
            RayKind::Passed => uses::PASSED,
        });
        Some(PathState { kind, depth: parent.depth + 1, attenuation, throughput, place, ..parent })
    }
}

/// A child ray that leaves the interaction.
fn child_ray(
    at: &InteractionRef,
    batch: &RayBatch,
    path_state: PathState,
    direction: DVec3,
    differential: Option<RayDifferential>,
) -> RayState {
    let line = at.leave(direction);
    RayState { ray: at.start(&line), line, path_state, sample: *batch.sample(at.interaction.ray_index()), differential }
}

/// The normal of a random microfacet, if the surface is rough.
fn microfacet(at: &InteractionRef, batch: &RayBatch, use_of: u32) -> Option<DVec3> {
    let roughness = at.interaction.material.phong.roughness;
    if roughness == 0.0 {
        return None;
    }
    let normal = if at.wo().dot(at.normal()) > 0.0 { at.normal() } else { at.facing() };
    let place = batch.path_state(at.interaction.ray_index()).place.of(use_of);
    Some(sample_ggx_vndf(at.wo(), normal, f64::from(roughness), batch.sample(at.interaction.ray_index()).two(place)))
}

/// A mirrored direction that stays above the surface. Where an interpolated normal would send it below, the geometric
/// normal mirrors instead.
fn keep_above(direction: DVec3, at: &InteractionRef) -> DVec3 {
    if direction.dot(at.facing()) > 0.0 { direction } else { reflect(at.wo(), at.facing()) }
}

/// A refracted direction that stays below the surface. Where an interpolated normal would send it above, the geometric
/// normal refracts instead.
fn keep_below(direction: DVec3, at: &InteractionRef, eta_ratio: f64) -> DVec3 {
    if direction.dot(at.facing()) < 0.0 {
        direction
    } else {
        refract(at.wo(), at.facing(), eta_ratio).unwrap_or(-at.facing())
    }
}

/// The differential of the ray in the direction of [`keep_above`].
fn differential_above(at: &InteractionRef, footprint: Option<&Footprint>) -> Option<RayDifferential> {
    let footprint = footprint?;
    let keeps_shading_normal = at.mirrored().dot(at.facing()) > 0.0;
    let (normal, shape_operator) =
        if keeps_shading_normal { (at.normal(), footprint.shape_operator) } else { (at.facing(), DMat3::ZERO) };
    Some(footprint.differential.reflected(footprint.step, -at.wo(), normal, &shape_operator))
}

/// The differential of the ray in the direction of [`keep_below`].
fn differential_below(at: &InteractionRef, footprint: Option<&Footprint>, eta_ratio: f64) -> Option<RayDifferential> {
    let footprint = footprint?;
    let keeps_shading_normal =
        refract(at.wo(), at.normal(), eta_ratio).is_some_and(|direction| direction.dot(at.facing()) < 0.0);
    let (normal, shape_operator) =
        if keeps_shading_normal { (at.normal(), footprint.shape_operator) } else { (at.facing(), DMat3::ZERO) };
    Some(footprint.differential.refracted(footprint.step, -at.wo(), normal, &shape_operator, eta_ratio))
}
