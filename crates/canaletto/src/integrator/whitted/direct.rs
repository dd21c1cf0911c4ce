//! Direct lighting: the light that reaches one interaction (5.39a).

use super::Whitted;
use super::interaction::SurfaceInteraction;
use super::ray_state::uses;
use crate::integrator::media::NONE;
use crate::integrator::shading::BEFORE_LIGHT;
use crate::integrator::{LightTerm, Probe};
use crate::light::{Illumination, PreparedLight};
use crate::material::highlights;
use crate::math::{RayDifferential, Rgb, saturate};
use crate::scene::Stage;
use canaletto_bvh::Ray;
use glam::DVec3;

/// The diffuse and the specular light of one component: (5.32b) and (5.38).
#[inline(always)]
pub(super) fn lit(intensity: f32, [kd, n_dot_l]: [f32; 2], [ks, highlight]: [f32; 2]) -> [f32; 2] {
    [saturate(intensity * kd) * n_dot_l, saturate(intensity * ks) * highlight]
}

/// The sum of both terms after shadows (5.39a).
#[inline(always)]
pub(super) fn contribution([diffuse, specular]: [f32; 2], f_s: f32) -> f32 {
    if f_s > 0.0 { saturate(diffuse + specular) * f_s } else { 0.0 }
}

impl<'w> Whitted<'w> {
    /// The light of one light point at an interaction, after shadows.
    pub(super) fn light<P: Probe + ?Sized>(
        &mut self,
        at: &SurfaceInteraction,
        light: u32,
        point: u32,
        probe: &mut P,
    ) -> Rgb {
        self.poll(1);
        if self.is_cancelled {
            return Rgb::BLACK;
        }
        let (frame, phong) = (&at.frame, &at.material.classic);
        let source = self.source(light);
        let is_sampled = source.is_sampled();
        let arriving = if is_sampled {
            let place = at.path_state.place.of(uses::LIGHTS + light);
            source.illuminate_from(at.sample.two_of(place, point, source.points()), frame.exact)
        } else {
            source.illuminate(point, frame.exact)
        };
        let Illumination { direction, distance, position, intensity } = arriving;
        let n_dot_l = frame.normal.dot(direction) as f32;
        let r_dot_l = frame.mirrored.dot(direction) as f32;
        // A light exactly at the point gives NaN. The comparison is then false, and the light adds nothing.
        let is_before = n_dot_l > 0.0 && !intensity.is_black();
        let behind = is_before && at.is_below_surface(direction);
        let mut term = LightTerm {
            light,
            point,
            sampled: if is_sampled { position } else { None },
            direction: direction.as_vec3(),
            distance,
            intensity,
            n_dot_l,
            behind,
            r_dot_l,
            f_s: 0.0,
            diffuse: Rgb::BLACK,
            specular: Rgb::BLACK,
            contribution: Rgb::BLACK,
        };
        if is_before && !behind {
            term.f_s = self.shadow(at, light, &arriving, probe);
            let has_highlight =
                self.settings.stage >= Stage::Specular && !phong.ks.is_black() && (r_dot_l > 0.0 || phong.n == 0.0);
            let mut highlight = [if has_highlight { r_dot_l } else { 0.0 }];
            if has_highlight {
                highlights(&mut highlight, &[phong.n]); // cosⁿα of (5.38)
            }
            let [l, kd, ks] = [intensity, phong.kd, phong.ks].map(Rgb::to_array);
            let both = [0, 1, 2].map(|c: usize| lit(l[c], [kd[c], n_dot_l], [ks[c], highlight[0]]));
            term.diffuse = both.map(|[diffuse, _]| diffuse).into();
            term.specular = both.map(|[_, specular]| specular).into();
            term.contribution = both.map(|both| contribution(both, term.f_s)).into();
        }
        probe.light(&term);
        term.contribution
    }

    /// f_s, the share of the light that passes the surfaces between a light's point and the interaction.
    fn shadow<P: Probe + ?Sized>(
        &mut self,
        at: &SurfaceInteraction,
        light: u32,
        arriving: &Illumination,
        probe: &mut P,
    ) -> f32 {
        if !self.casts_shadows(light) {
            return 1.0;
        }
        let (to, t_max) = match arriving.position {
            Some(position) => (position - at.frame.start, BEFORE_LIGHT),
            None => (arriving.direction.as_vec3(), f32::INFINITY),
        };
        if let Some(lookup) = self.shadow_lookup {
            return lookup.passed(light, [at.frame.start, to], t_max, at.frame.exact, at.frame.facing);
        }
        let differential = at.footprint.map(|footprint| {
            RayDifferential::to_light(footprint.step, arriving.direction, f64::from(arriving.distance))
        });
        let ray = Ray::new(at.frame.start, to);
        let occluder = &mut self.occluders[light as usize];
        let mut f_s = self.world.transmittance(&ray, t_max, self.time, differential.as_ref(), occluder, probe);
        self.counts.shadow.traced += 1;
        self.counts.shadow.hit += u64::from(f_s == 0.0);
        // Where faces coincide, light crosses back through those that the camera ray has crossed before.
        if at.crossing != NONE {
            self.media.for_crossed_before(at.crossing, |hit| {
                let opacity = self.world.opacity_at(at.frame.leave(-at.frame.wo), hit, None);
                probe.blocker(hit, opacity);
                f_s *= 1.0 - opacity;
            });
        }
        f_s
    }

    /// Whether shadow rays are traced to a light.
    pub(super) fn casts_shadows(&self, light: u32) -> bool {
        self.settings.stage >= Stage::Shadow && self.settings.shadows && self.source(light).light.shadows
    }

    /// The light at the time of the sample.
    pub(super) fn source(&self, light: u32) -> &PreparedLight {
        self.lights.get(light as usize).unwrap_or(&self.world.lights[light as usize])
    }
}

impl SurfaceInteraction<'_> {
    /// Whether light comes from behind the surface, though not from behind its bent normal.
    fn is_below_surface(&self, direction: DVec3) -> bool {
        self.material.normal_bent && self.frame.facing.dot(direction) <= 0.0
    }
}
