//! Secondary rays: mirrored rays, refracted rays, and rays past surfaces of partial coverage.

use super::Whitted;
use super::interaction::SurfaceInteraction;
use super::ray_state::{PathState, RayState, uses};
use crate::integrator::media::{Crossing, NONE, Refraction, SIMPLE};
use crate::integrator::visible_hit::{Footprint, Frame};
use crate::integrator::{Probe, RayKind};
use crate::material::{reflect, reflect_into_hemisphere, refract, sample_ggx_vndf};
use crate::math::{RayDifferential, Rgb};
use glam::{DMat3, DVec3};

/// The most surfaces of partial coverage that a path passes.
const MAX_PASSED: u32 = 64;

impl Whitted<'_> {
    /// The ray from a mirror in the mirrored direction, unless the tree ends here.
    pub(super) fn reflected_ray<P: Probe + ?Sized>(
        &mut self,
        at: &SurfaceInteraction,
        probe: &mut P,
    ) -> Option<RayState> {
        let phong = &at.material.classic;
        let path_state = self.child(at.parent(), RayKind::Reflected, phong.k, probe)?;
        let first_crossing = self.media.crossing(at.crossing).map_or(NONE, |c| c.back);
        let path_state = PathState { inside: self.inside(at), first_crossing, ..path_state };
        let direction = match at.microfacet(uses::REFLECTION_MICROFACET) {
            None => at.keep_above(at.frame.mirrored),
            Some(microfacet) => {
                probe.lobe(phong.roughness, microfacet);
                reflect_into_hemisphere(reflect(at.frame.wo, microfacet), at.frame.facing)
            }
        };
        Some(at.child_ray(path_state, direction, at.differential_above()))
    }

    /// The ray into or out of a clear body, or the ray mirrored inside it, unless the tree ends here.
    pub(super) fn refracted_ray<P: Probe + ?Sized>(
        &mut self,
        at: &SurfaceInteraction,
        probe: &mut P,
    ) -> Option<RayState> {
        let (phong, frame) = (&at.material.classic, &at.frame);
        let Crossing { refraction, beyond, next, back, .. } = match at.crossing {
            SIMPLE => self.media.simple(self.world, at.hit, frame.outside, at.inside),
            crossing => *self.media.crossing(crossing)?,
        };
        let transmitted = Rgb::gray(1.0 - phong.opacity);
        let Refraction::Outer(outer) = refraction else {
            let path_state = self.child(at.parent(), RayKind::Refracted, transmitted, probe)?;
            let is_straight = at.path_state.is_straight;
            let path_state = PathState { inside: beyond, first_crossing: next, is_straight, ..path_state };
            return Some(at.child_ray(path_state, -frame.wo, at.differential_straight()));
        };
        let eta = f64::from(phong.eta);
        let [from, into] = if frame.outside { [outer, eta] } else { [eta, outer] };
        let eta_ratio = from / into;
        let microfacet = at.microfacet(uses::REFRACTION_MICROFACET);
        let (kind, direction) = match (refract(frame.wo, microfacet.unwrap_or(frame.normal), eta_ratio), microfacet) {
            (Some(direction), None) => (RayKind::Refracted, at.keep_below(direction, eta_ratio)),
            (Some(direction), Some(_)) => (RayKind::Refracted, reflect_into_hemisphere(direction, -frame.facing)),
            (None, None) => (RayKind::TotallyReflected, at.keep_above(frame.mirrored)),
            (None, Some(microfacet)) => {
                (RayKind::TotallyReflected, reflect_into_hemisphere(reflect(frame.wo, microfacet), frame.facing))
            }
        };
        let path_state = self.child(at.parent(), kind, transmitted, probe)?;
        let path_state = if kind == RayKind::Refracted {
            probe.bent(from, into);
            let is_straight = at.path_state.is_straight && eta_ratio == 1.0;
            PathState { inside: beyond, first_crossing: next, is_straight, ..path_state }
        } else {
            PathState { inside: self.inside(at), first_crossing: back, ..path_state }
        };
        if let Some(microfacet) = microfacet {
            probe.lobe(phong.roughness, microfacet);
        }
        let differential = match kind {
            RayKind::Refracted => at.differential_below(eta_ratio),
            _ => at.differential_above(),
        };
        Some(at.child_ray(path_state, direction, differential))
    }

    /// The ray straight on through a surface of partial coverage, unless the tree ends here.
    pub(super) fn passed_ray<P: Probe + ?Sized>(&mut self, at: &SurfaceInteraction, probe: &mut P) -> Option<RayState> {
        let attenuation = Rgb::gray(1.0 - at.material.coverage);
        let parent = at.parent();
        if parent.passed_surfaces == MAX_PASSED {
            probe.cut(RayKind::Passed, attenuation);
            return None;
        }
        // The ray continues unchanged, so its depth is that of its parent.
        let parent = PathState { depth: parent.depth - 1, ..parent };
        let path_state = self.child(parent, RayKind::Passed, attenuation, probe)?;
        let path_state = match self.media.crossing(at.crossing) {
            Some(crossing) => PathState { inside: crossing.beyond, first_crossing: crossing.next, ..path_state },
            None => path_state,
        };
        let (passed_surfaces, is_straight) = (path_state.passed_surfaces + 1, at.path_state.is_straight);
        let path_state = PathState { passed_surfaces, is_straight, ..path_state };
        Some(at.child_ray(path_state, -at.frame.wo, at.differential_straight()))
    }

    /// The bodies of a ray that stays on its side of the surface.
    fn inside(&mut self, at: &SurfaceInteraction) -> u32 {
        match at.crossing {
            SIMPLE => self.media.simple_inside(self.world, at.hit, at.frame.outside, at.inside),
            _ => at.inside,
        }
    }

    /// The path state of a child ray, unless depth or weight ends the tree here.
    fn child<P: Probe + ?Sized>(
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
            RayKind::Eye | RayKind::Scattered => uses::EYE,
            RayKind::Reflected => uses::REFLECTED,
            RayKind::Refracted | RayKind::TotallyReflected => uses::REFRACTED,
            RayKind::Passed => uses::PASSED,
        });
        let (depth, is_straight) = (parent.depth + 1, false);
        Some(PathState { kind, depth, attenuation, throughput, is_straight, place, ..parent })
    }
}

impl SurfaceInteraction<'_> {
    /// The path state of the arriving ray, with the bodies at the surface. No coinciding surface follows at once.
    fn parent(&self) -> PathState {
        PathState { inside: self.inside, first_crossing: NONE, ..self.path_state }
    }

    /// A child ray that leaves the surface.
    fn child_ray(&self, path_state: PathState, direction: DVec3, differential: Option<RayDifferential>) -> RayState {
        let line = self.frame.leave(direction);
        RayState { ray: self.frame.rounded(&line), line, path_state, sample: *self.sample, differential }
    }

    /// The normal of a random microfacet, if the surface is rough.
    fn microfacet(&self, use_of: u32) -> Option<DVec3> {
        let (frame, roughness) = (&self.frame, self.material.classic.roughness);
        if roughness == 0.0 {
            return None;
        }
        let normal = if frame.wo.dot(frame.normal) > 0.0 { frame.normal } else { frame.facing };
        let u = self.sample.two(self.path_state.place.of(use_of));
        Some(sample_ggx_vndf(frame.wo, normal, f64::from(roughness), u))
    }

    /// A mirrored direction that stays above the surface. Where an interpolated normal would send it below, the
    /// geometric normal mirrors instead.
    fn keep_above(&self, direction: DVec3) -> DVec3 {
        let Frame { wo, facing, .. } = self.frame;
        if direction.dot(facing) > 0.0 { direction } else { reflect(wo, facing) }
    }

    /// A refracted direction that stays below the surface. Where an interpolated normal would send it above, the
    /// geometric normal refracts instead.
    fn keep_below(&self, direction: DVec3, eta_ratio: f64) -> DVec3 {
        let Frame { wo, facing, .. } = self.frame;
        if direction.dot(facing) < 0.0 { direction } else { refract(wo, facing, eta_ratio).unwrap_or(-facing) }
    }

    /// The differential of the ray that goes straight on.
    fn differential_straight(&self) -> Option<RayDifferential> {
        self.footprint.map(|f| f.differential.passed(f.step))
    }

    /// The differential of the ray in the direction of [`SurfaceInteraction::keep_above`].
    fn differential_above(&self) -> Option<RayDifferential> {
        let (footprint, frame) = (self.footprint?, &self.frame);
        let (normal, shape_operator) = self.normal_if(footprint, frame.mirrored.dot(frame.facing) > 0.0);
        Some(footprint.differential.reflected(footprint.step, -frame.wo, normal, &shape_operator))
    }

    /// The differential of the ray in the direction of [`SurfaceInteraction::keep_below`].
    fn differential_below(&self, eta_ratio: f64) -> Option<RayDifferential> {
        let (footprint, frame) = (self.footprint?, &self.frame);
        let keeps_shading_normal =
            refract(frame.wo, frame.normal, eta_ratio).is_some_and(|direction| direction.dot(frame.facing) < 0.0);
        let (normal, shape_operator) = self.normal_if(footprint, keeps_shading_normal);
        Some(footprint.differential.refracted(footprint.step, -frame.wo, normal, &shape_operator, eta_ratio))
    }

    /// The shading normal and its derivative, or else the geometric normal, taken as constant.
    fn normal_if(&self, footprint: &Footprint, keeps_shading_normal: bool) -> (DVec3, DMat3) {
        if keeps_shading_normal {
            (self.frame.normal, footprint.shape_operator)
        } else {
            (self.frame.facing, DMat3::ZERO)
        }
    }
}
