//! Lights as a path tracer needs them: random light with its density, emitted radiance, power and bounds.
//!
//! Colours are radiances. A light of intensity l gives a white matte surface that faces it the radiance l, so that it
//! arrives as an irradiance of π l. Points and lights at infinity are delta lights: only [`PreparedLight::sample`]
//! finds them, and no ray meets them. A surface of [even](Emission::Even) emission is a set of such points. Only a
//! surface of [matte](Emission::Matte) emission has a radiance.

use super::prepared::Points;
use super::{Emission, Illumination, LightKind, PreparedLight};
use crate::math::Rgb;
use crate::shape::SurfaceSampler;
use glam::DVec3;
use std::f64::consts::PI;

/// Light that arrives at a point from a random point of a light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightSample {
    /// The unit direction to the light.
    pub wi: DVec3,
    /// The distance to the light's point; infinite for light from infinity.
    pub distance: f32,
    /// The light's point; none for light from infinity.
    pub position: Option<DVec3>,
    /// The radiance that arrives, without shadows; of a delta light, the irradiance of a surface that faces it.
    pub li: Rgb,
    /// The density per unit of solid angle; of a delta light, 1. The light that leaves along `wo` is the mean of
    /// f |cos θ| li / pdf.
    pub pdf: f64,
    /// Whether the light is a delta light.
    pub is_delta: bool,
}

/// Bounds of the light that leaves a light, for a hierarchy of lights (pbrt-v4, 12.6.3).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightBounds {
    /// The smallest and the largest coordinates of the light's points.
    pub bounds: [DVec3; 2],
    /// The unit axis of the cone of normals.
    pub axis: DVec3,
    /// The cosine of the largest angle between the axis and a normal.
    pub cos_theta_o: f64,
    /// The cosine of the largest angle between a normal and a direction of emission.
    pub cos_theta_e: f64,
    /// The power.
    pub power: Rgb,
}

impl PreparedLight {
    /// The surface of a light of matte emission.
    fn matte(&self) -> Option<&SurfaceSampler> {
        self.surface.as_deref().filter(|_| self.light.emission == Emission::Matte)
    }

    /// The area of a light of matte emission.
    pub(crate) fn matte_area(&self) -> Option<f64> {
        self.matte().map(SurfaceSampler::area)
    }

    /// The unit direction to a light that is infinitely far.
    pub(crate) fn towards(&self) -> DVec3 {
        self.towards
    }

    /// The intensity of the whole light.
    fn whole(&self) -> Rgb {
        self.intensity * self.count as f32
    }

    /// The light that arrives at `p` from the point at `u` of the unit square; none from a surface that faces away.
    pub fn sample(&self, p: DVec3, u: [f64; 2]) -> Option<LightSample> {
        let Some(surface) = self.matte() else {
            let index = (u[0] * f64::from(self.count)) as u32;
            let arriving = if self.is_sampled() { self.illuminate_from(u, p) } else { self.illuminate(index, p) };
            let Illumination { direction: wi, distance, position, intensity } = arriving;
            let li = intensity * (PI * f64::from(self.count)) as f32;
            let position = position.map(|p| p.as_dvec3());
            return Some(LightSample { wi, distance, position, li, pdf: 1.0, is_delta: true });
        };
        let sample = surface.sample_from(p, u)?;
        if sample.normal.dot(p - sample.point) <= 0.0 {
            return None;
        }
        let Illumination { direction: wi, distance, intensity, .. } = self.arriving(sample.point.as_vec3(), p);
        let li = intensity * self.count as f32;
        Some(LightSample { wi, distance, position: Some(sample.point), li, pdf: sample.pdf, is_delta: false })
    }

    /// The density with which [`PreparedLight::sample`] returns this point of the light's surface, per unit of solid
    /// angle at `p`. `normal` is the unit normal there. It is 0 for a delta light, and where the surface faces away.
    pub fn pdf(&self, p: DVec3, point: DVec3, normal: DVec3) -> f64 {
        match self.matte() {
            Some(surface) if normal.dot(p - point) > 0.0 => surface.pdf_from(p, point, normal),
            _ => 0.0,
        }
    }

    /// The radiance that leaves a point of the light's surface with this normal in the direction `w`, before the
    /// attenuation; black for a delta light, and on the other side.
    pub fn le(&self, normal: DVec3, w: DVec3) -> Rgb {
        if self.matte().is_some() && normal.dot(w) > 0.0 { self.whole() } else { Rgb::BLACK }
    }

    /// The power of the light. Points emit as if attenuated by the squared distance alone. Light from infinity counts
    /// as far as it meets a scene of this radius. A spotlight with a profile counts as the narrower of both.
    pub fn power(&self, scene_radius: f64) -> Rgb {
        // π l is the irradiance, and at a distance of 1 the radiant intensity.
        let factor = match (&self.light.kind, self.matte()) {
            (_, Some(surface)) => PI * surface.area(),
            (_, None) if let Some(profile) = &self.profile => {
                let cone = self.cone.map_or(4.0 * PI, |cone| cone.solid_angle());
                PI * profile.solid_angle().min(cone)
            }
            (LightKind::Spot(_), _) => PI * self.cone.map_or(0.0, |cone| cone.solid_angle()),
            (LightKind::Directional(directional), _) => {
                let radius = directional.beam.map_or(scene_radius, |(_, radius)| scene_radius.min(radius.into()));
                PI * PI * radius * radius
            }
            (LightKind::Omni(omni), _) if omni.towards_infinity().is_some() => PI * PI * scene_radius * scene_radius,
            _ => 4.0 * PI * PI,
        };
        self.whole() * factor as f32
    }

    /// The bounds of the light; none for light from infinity.
    pub fn bounds(&self) -> Option<LightBounds> {
        let power = match self.light.kind {
            LightKind::Directional(_) => return None,
            _ => self.power(0.0),
        };
        let bounds = match (&self.surface, &self.points) {
            (Some(surface), _) => surface.bounds(),
            (None, Points::One(point)) => [point.as_dvec3(); 2],
            (None, Points::Some(points)) if points.is_empty() => return None,
            (None, Points::Some(points)) => points
                .iter()
                .map(|p| p.as_dvec3())
                .fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[min, max], p| [min.min(p), max.max(p)]),
        };
        let (axis, cos_theta_o, cos_theta_e) = match (self.matte(), &self.cone) {
            (Some(surface), _) => {
                let (axis, cos) = surface.normal_cone();
                (axis, cos, 0.0)
            }
            (None, Some(cone)) => (cone.axis().as_dvec3(), 1.0, cone.cos_outer()),
            (None, None) if let Some(profile) = &self.profile => {
                (profile.axis(), 1.0, libm::cos(profile.emission_angle()))
            }
            (None, None) => (DVec3::Z, -1.0, 0.0),
        };
        Some(LightBounds { bounds, axis, cos_theta_o, cos_theta_e, power })
    }
}

#[cfg(test)]
mod tests;
