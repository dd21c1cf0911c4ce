//! The runtime form of a light: values that do not depend on the lit point are computed once.

use super::area;
use super::ies_profile::PreparedProfile;
use super::{Emission, Light, LightKind, surface_light};
use crate::math::Rgb;
use crate::shape::SurfaceSampler;
use canaletto_bvh::lanes::Real32;
use glam::{DVec3, Vec3};

/// The runtime form of a light, with the points that emit.
#[derive(Clone, Debug)]
pub struct PreparedLight {
    /// The light as described, in world space.
    pub light: Light,
    /// The positions of the fixed points; none for light from infinity.
    pub(super) points: Points,
    /// The unit direction to a light at infinity.
    pub(super) towards: DVec3,
    /// The intensity of each point.
    pub(super) intensity: Rgb,
    pub(super) cone: Option<super::spot::Cone>,
    pub(super) profile: Option<Box<PreparedProfile>>,
    /// The surface, if its points are chosen for each hit: random ones, or those of matte emission.
    pub(super) surface: Option<Box<SurfaceSampler>>,
    /// The number of points that emit.
    pub(super) count: u32,
    /// Whether distance attenuates the light.
    attenuated: bool,
}

/// The positions of a light's points. A single point, the usual case, needs no allocation.
#[derive(Clone, Debug)]
pub(super) enum Points {
    One(Vec3),
    Some(Box<[Vec3]>),
}

impl Points {
    #[inline]
    fn get(&self, index: u32) -> Option<Vec3> {
        match self {
            Points::One(point) => (index == 0).then_some(*point),
            Points::Some(points) => points.get(index as usize).copied(),
        }
    }
}

/// Light arriving at a point from one of a light's points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Illumination {
    /// The unit direction L̂ to the light.
    pub direction: DVec3,
    /// The distance to the light; infinite for light from infinity.
    pub distance: f32,
    /// The position of the light's point; `None` for light from infinity.
    pub position: Option<Vec3>,
    /// The intensity after attenuation, cone, profile and region, without shadows.
    pub intensity: Rgb,
}

/// What the light of a light with these coefficients of attenuation is divided by at a distance.
#[inline(always)]
pub(crate) fn attenuation_divisor<F: Real32>([c, l, q]: [F; 3], distance: F) -> F {
    // The divisor may be 0 at the light's own position; black stays black.
    (c + l * distance + q * distance * distance).max(F::splat(f32::MIN_POSITIVE))
}

impl PreparedLight {
    /// The runtime form of a light whose numbers are in range ([`Light::check`]). A mesh light is dark without its
    /// triangles.
    pub fn new(light: Light) -> PreparedLight {
        PreparedLight::of_triangles(light, &[])
    }

    /// The runtime form of a light, with the triangles of a mesh light in the space of its meshes.
    pub fn of_triangles(light: Light, triangles: &[[DVec3; 3]]) -> PreparedLight {
        let (mut points, mut towards, mut cone) = (Vec::new(), DVec3::ZERO, None);
        let mut surface = surface_light::surface(&light.kind, triangles);
        let count = light.points();
        let mut intensity = light.intensity;
        if light.has_area() {
            intensity *= 1.0 / count as f32;
        }
        match &light.kind {
            LightKind::Omni(omni) => match omni.towards_infinity() {
                Some(direction) => towards = direction,
                None => points.push(omni.point()),
            },
            LightKind::Directional(directional) => towards = directional.direction(),
            LightKind::Spot(spot) => {
                points.push(spot.position);
                cone = Some(spot.cone());
            }
            _ if light.samples > 0 || light.emission == Emission::Matte => {}
            LightKind::Disk(disk) => points.extend((0..count).map(|index| disk.point(index))),
            _ => {
                let point = |s: &SurfaceSampler, i| s.point(area::fixed(i, count)).0.as_vec3();
                points.extend(surface.iter().flat_map(|s| (0..count).map(move |i| point(s, i))));
            }
        }
        if light.has_area() && surface.is_none() {
            // The triangles of a mesh light have no area, so it emits nothing.
            intensity = Rgb::BLACK;
            points = vec![Vec3::ZERO; count as usize];
        }
        if !points.is_empty() {
            surface = None;
        }
        let attenuated = light.attenuation != [1.0, 0.0, 0.0] || light.range() > 0.0;
        let points = if let [point] = *points { Points::One(point) } else { Points::Some(points.into()) };
        let surface = surface.map(Box::new);
        let profile = light.profile.as_ref().map(|profile| Box::new(profile.prepared()));
        PreparedLight { light, points, towards, intensity, cone, profile, surface, count, attenuated }
    }

    /// The intensity of each point, before attenuation, cone, profile and region.
    pub(crate) fn point_intensity(&self) -> Rgb {
        self.intensity
    }

    /// The number of points that illuminate a hit, each with a shadow ray of its own.
    pub fn points(&self) -> u32 {
        self.count
    }

    /// Whether points are chosen at random, by [`PreparedLight::illuminate_from`].
    #[inline]
    pub fn is_sampled(&self) -> bool {
        self.surface.is_some() && self.light.samples > 0
    }

    /// The light that arrives at `p` from the random point at `u` of the unit square. The intensities of
    /// [`PreparedLight::points`] such points sum to the light's. Lights without a surface return their only point.
    #[inline(never)]
    pub fn illuminate_from(&self, u: [f64; 2], p: DVec3) -> Illumination {
        match &self.surface {
            Some(surface) if self.light.emission == Emission::Matte => match area::seen(surface, u, p) {
                Some((position, share)) => {
                    let arriving = self.arriving(position.as_vec3(), p);
                    Illumination { intensity: (arriving.intensity * share as f32).saturated(), ..arriving }
                }
                None => Illumination { intensity: Rgb::BLACK, ..self.arriving(surface.point(u).0.as_vec3(), p) },
            },
            Some(surface) => self.arriving(surface.point(u).0.as_vec3(), p),
            None => self.illuminate(0, p),
        }
    }

    /// The light that arrives at `p` from point number `index`. The intensities of all points sum to the light's.
    #[inline]
    pub fn illuminate(&self, index: u32, p: DVec3) -> Illumination {
        let Some(position) = self.points.get(index) else {
            return match self.surface {
                Some(_) => self.illuminate_from(area::fixed(index, self.count), p),
                None => self.arriving_from_infinity(p.as_vec3()),
            };
        };
        self.arriving(position, p)
    }

    /// [`PreparedLight::illuminate`] without random points: those are replaced by as many points that are spread
    /// evenly.
    pub(crate) fn illuminate_evenly(&self, index: u32, p: DVec3) -> Illumination {
        if self.is_sampled() {
            self.illuminate_from(area::fixed(index, self.count), p)
        } else {
            self.illuminate(index, p)
        }
    }

    /// The position of point number `index`, if it doesn't depend on the lit point. [`PreparedLight::along`] then
    /// returns the arriving intensity.
    #[inline]
    pub(crate) fn point(&self, index: u32) -> Option<Vec3> {
        if self.is_sampled() { None } else { self.points.get(index) }
    }

    #[inline]
    pub(super) fn arriving(&self, position: Vec3, p: DVec3) -> Illumination {
        let to_light = position.as_dvec3() - p;
        let length = to_light.length();
        let (direction, distance) = (to_light / length, length as f32);
        Illumination { direction, distance, position: Some(position), intensity: self.along(direction, distance) }
    }

    /// The intensity that arrives from each of the light's points, if it is constant in space.
    pub(crate) fn constant_intensity(&self) -> Option<Rgb> {
        (!self.attenuated && self.cone.is_none() && self.profile.is_none()).then_some(self.intensity)
    }

    /// What the intensity is divided by at a distance.
    #[inline]
    pub(crate) fn attenuation_divisor(&self, distance: f32) -> f32 {
        attenuation_divisor(self.light.attenuation, distance)
    }

    /// The share of the light that its range leaves at a distance.
    #[inline]
    pub(crate) fn within_range(&self, distance: f32) -> f32 {
        let range = self.light.range();
        if range == 0.0 {
            return 1.0;
        }
        let far = distance / range;
        (1.0 - far * far * far * far).max(0.0)
    }

    /// The intensity that arrives from one of the light's points in this direction and at this distance.
    #[inline]
    pub(crate) fn along(&self, direction: DVec3, distance: f32) -> Rgb {
        let mut intensity = self.intensity;
        if self.attenuated {
            intensity = (intensity / self.attenuation_divisor(distance) * self.within_range(distance)).saturated();
        }
        if let Some(cone) = &self.cone {
            intensity *= cone.factor(-direction.as_vec3());
        }
        if let Some(profile) = &self.profile {
            intensity *= profile.factor(-direction);
        }
        intensity
    }

    fn arriving_from_infinity(&self, p: Vec3) -> Illumination {
        let mut intensity = self.intensity;
        if let LightKind::Directional(directional) = &self.light.kind {
            intensity *= directional.region(p, self.towards.as_vec3());
        }
        Illumination { direction: self.towards, distance: f32::INFINITY, position: None, intensity }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Directional, DiskLight, Falloff, Omni, Spot};
    use super::*;
    use crate::shape::Disk;

    const DISK: Disk = Disk { center: Vec3::Y, normal: Vec3::new(0.0, -1.0, 1.0), radius: 2.0 };

    fn source(kind: LightKind) -> PreparedLight {
        PreparedLight::new(Light::new(kind, Rgb::WHITE))
    }

    #[test]
    fn a_fourth_number_of_zero_is_infinity() {
        let sun = source(LightKind::Omni(Omni { position: [0.0, 2.0, 0.0, 0.0], range: 0.0 }));
        for p in [DVec3::ZERO, DVec3::splat(100.0)] {
            let light = sun.illuminate(0, p);
            assert_eq!((light.direction, light.position), (DVec3::Y, None));
        }
        let lamp = source(LightKind::Omni(Omni { position: [0.0, 6.0, 0.0, 2.0], range: 0.0 }));
        assert_eq!(lamp.illuminate(0, DVec3::ZERO).position, Some(Vec3::new(0.0, 3.0, 0.0)));
    }

    #[test]
    fn attenuation_divides_by_a_polynomial_of_the_distance() {
        let mut light = Light::new(LightKind::Omni(Omni::at(Vec3::Y * 3.0)), Rgb::gray(12.0));
        light.attenuation = [1.0, 2.0, 0.5];
        // 1 + 2 · 3 + 0.5 · 9 = 11.5
        assert!((PreparedLight::new(light).illuminate(0, DVec3::ZERO).intensity.r - 12.0 / 11.5).abs() < 1e-6);
    }

    #[test]
    fn a_spot_is_full_inside_dark_outside_and_smooth_between() {
        let falloff = Falloff::Smooth { inner: 20.0, outer: 40.0 };
        let spot = source(Spot { position: Vec3::Y, target: Vec3::ZERO, falloff, range: 0.0 }.into());
        let at = |degrees: f64| spot.illuminate(0, DVec3::new(degrees.to_radians().tan(), 0.0, 0.0)).intensity.r;
        assert_eq!([at(0.0), at(19.9), at(40.1)], [1.0, 1.0, 0.0]);
        let values = [21.0, 25.0, 30.0, 35.0, 39.0].map(at);
        assert!(values.windows(2).all(|w| w[0] > w[1]) && values[0] > 0.95 && values[4] < 0.05, "{values:?}");
        let falloff = Falloff::Exponent { exponent: 3.0, outer: 60.0 };
        let spot = source(Spot { position: Vec3::Y, target: Vec3::ZERO, falloff, range: 0.0 }.into());
        let at = |degrees: f64| spot.illuminate(0, DVec3::new(degrees.to_radians().tan(), 0.0, 0.0)).intensity.r;
        assert!((at(45.0) - 0.5f32.powf(1.5)).abs() < 1e-6 && at(61.0) == 0.0);
    }

    #[test]
    fn a_beam_ends_at_its_radius() {
        let beam = Directional { towards: Vec3::NEG_Y, beam: Some((Vec3::X, 2.0)) };
        let sun = source(LightKind::Directional(beam));
        let at = |x: f64| sun.illuminate(0, DVec3::new(x, -7.0, 0.0)).intensity.r;
        assert_eq!([at(-0.9), at(2.9), at(3.1), at(-1.1)], [1.0, 1.0, 0.0, 0.0]);
    }

    #[test]
    fn points_of_a_disk_share_its_light_and_its_area() {
        let disk = DiskLight { disk: DISK, points: 64 };
        let light = source(LightKind::Disk(disk));
        let points: Vec<Vec3> = (0..64).map(|i| light.illuminate(i, DVec3::ZERO).position.unwrap() - Vec3::Y).collect();
        assert!(points.iter().all(|p| p.dot(DISK.normal).abs() < 1e-5 && p.length() <= 2.0));
        // Half of the points lie inside the circle of half the area.
        assert_eq!(points.iter().filter(|p| p.length() < 2.0 / 2f32.sqrt()).count(), 32);
        assert!((points.iter().sum::<Vec3>() / 64.0).length() < 0.1);
        let sum: Rgb = (0..64).map(|i| light.illuminate(i, DVec3::ZERO).intensity).sum();
        assert!((sum.r - 1.0).abs() < 1e-5);
    }

    #[test]
    fn random_points_of_a_disk_lie_on_it_evenly() {
        let disk = DiskLight { disk: DISK, points: 16 };
        let light = PreparedLight::new(Light { samples: 4, ..Light::new(LightKind::Disk(disk), Rgb::WHITE) });
        assert!(light.is_sampled() && light.points() == 4);
        let n = 64;
        let at = |i: u32| (f64::from(i) + 0.5) / f64::from(n);
        let all: Vec<Illumination> =
            (0..n * n).map(|i| light.illuminate_from([at(i % n), at(i / n)], DVec3::ZERO)).collect();
        let points: Vec<Vec3> = all.iter().map(|l| l.position.unwrap() - Vec3::Y).collect();
        assert!(points.iter().all(|p| p.dot(DISK.normal).abs() < 1e-5 && p.length() <= 2.0));
        let mean = |f: &dyn Fn(&Vec3) -> f32| points.iter().map(f).sum::<f32>() / points.len() as f32;
        // On a uniform disk, the mean squared radius is R²/2 and that of each axis R²/4.
        assert!((mean(&|p| p.length_squared()) - 2.0).abs() < 1e-2 && (mean(&|p| p.x * p.x) - 1.0).abs() < 1e-2);
        assert!(mean(&|p| p.x).abs() < 1e-4 && mean(&|p| p.y).abs() < 1e-4);
        assert!(all.iter().all(|l| l.intensity.r == 0.25));
    }
}
