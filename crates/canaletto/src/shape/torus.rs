//! Tori.
//!
//! A torus is the boundary of all points within `tube` of the circle, so a spindle torus has no surface inside. Its u
//! follows (5.45a) for the angle around the axis. Its v is the like for the angle around the tube: ½ at the outer
//! equator and smaller on the side to which the axis points.

use super::solve::{self, Frame};
use super::surface_differential::{around, outer, turn_gradient};
use super::{ShapeHit, Surface, SurfaceDifferential};
use crate::OutOfRange;
use crate::math::{DRay, Roots, Transform, quartic};
use canaletto_bvh::{Aabb, Ray};
use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// A torus: a tube around a circle.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Torus {
    /// The centre.
    pub center: Vec3,
    /// The direction of the axis; any length but zero.
    pub axis: Vec3,
    /// The circle's radius, > 0.
    pub radius: f32,
    /// The tube's radius, > 0. More than `radius` gives a spindle torus.
    pub tube: f32,
}

/// A ray in units of the torus's size, relative to its centre.
struct Scaled {
    o: DVec3,
    /// The unit direction.
    d: DVec3,
    /// The distance from the ray's origin to `o`.
    gone: f64,
    /// The ray's parameter per unit of distance.
    per_unit: f64,
    /// The distances from `o` to the surface, ascending.
    roots: Roots,
}

impl Torus {
    /// The distance from the centre to the outer equator.
    fn size(&self) -> f64 {
        f64::from(self.radius) + f64::from(self.tube)
    }

    /// The circle's and the tube's radius in units of the size.
    fn radii(&self) -> (f64, f64) {
        (f64::from(self.radius) / self.size(), f64::from(self.tube) / self.size())
    }

    /// Whether a point is certainly [outside](solve::OUTSIDE); never where the tube intersects itself.
    fn is_outside(&self, p: DVec3) -> bool {
        let (p, axis) = ((p - self.center.as_dvec3()) / self.size(), self.axis.as_dvec3().normalize());
        let (big, small) = self.radii();
        let h = p.dot(axis);
        let across = (p - axis * h).length() - big;
        let from_ring = (across * across + h * h).sqrt();
        big > small && from_ring - small > solve::OUTSIDE
    }

    fn solve(&self, line: DRay) -> Option<Scaled> {
        let direction = line.direction;
        let length = direction.length();
        if length == 0.0 {
            return None;
        }
        let d = direction / length;
        let mut o = (line.origin - self.center.as_dvec3()) / self.size();
        // A distant origin is first moved next to the torus, since the quartic's terms would cancel.
        let far = o.length_squared() > 4.0;
        let gone = if far { -o.dot(d) } else { 0.0 };
        o += d * gone;
        // Roots lie only inside the sphere around the torus, slightly enlarged.
        let (beta, gamma) = (o.dot(d), o.length_squared());
        let discriminant = beta * beta - gamma + (1.0 + 1e-9);
        if discriminant.is_nan() || discriminant < 0.0 {
            return None;
        }
        let (low, high) = (-beta - discriminant.sqrt(), -beta + discriminant.sqrt());
        let low = if far { low } else { low.max(0.0) };
        if low > high {
            return None;
        }
        // (‖p‖² + R² − r²)² = 4 R² (‖p‖² − h²) for p = o + s d, h its height along the axis.
        let axis = self.axis.as_dvec3().normalize();
        let (oh, dh) = (o.dot(axis), d.dot(axis));
        let (big, small) = self.radii();
        let k = gamma + (big - small) * (big + small);
        let r4 = 4.0 * big * big;
        let across = (o - axis * oh).length_squared();
        let d_across = (d - axis * dh).length_squared();
        let coefficients = [
            k * k - r4 * across,
            4.0 * beta * k - r4 * 2.0 * (beta - oh * dh),
            4.0 * beta * beta + 2.0 * k - r4 * d_across,
            4.0 * beta,
            1.0,
        ];
        let roots = quartic(coefficients, low, high);
        Some(Scaled { o, d, gone, per_unit: self.size() / length, roots })
    }

    /// The nearest hit with t in (0, t_max], from outside or inside.
    pub fn intersect(&self, ray: &Ray, t_max: f32) -> Option<ShapeHit> {
        let s = self.solve(ray.into())?;
        let (big, small) = self.radii();
        // The squared equation also holds where the tube's far side intersects itself inside a spindle torus; there,
        // its left side is negative before squaring.
        let skin = |x: f64| (s.o + s.d * x).length_squared() + (big - small) * (big + small) >= 0.0;
        let mut t = s.roots.iter().filter(|x| skin(**x)).map(|x| (s.gone + x) * s.per_unit);
        t.find_map(|t| solve::hit(t, 0, t_max))
    }

    /// The surface at a hit. Its point is moved onto the tube.
    pub fn surface(&self, line: impl Into<DRay>, hit: &ShapeHit) -> Surface {
        let line = line.into();
        let (center, axis) = (self.center.as_dvec3(), self.axis.as_dvec3().normalize());
        let (big, small) = self.radii();
        let p = match self.solve(line) {
            Some(s) => {
                let roots = s.roots.map(|x| (s.gone + x) * s.per_unit);
                // From outside, every second root is an entrance.
                let entrances = match *roots {
                    [first, _] => Some([first; 2]),
                    [first, _, third, _] => Some([first, third]),
                    _ => None,
                };
                let t = match entrances.filter(|_| self.is_outside(line.origin)) {
                    Some(entrances) => solve::nearest(&entrances, hit.t),
                    None => solve::nearest(&roots, hit.t),
                };
                s.o + s.d * (t / s.per_unit - s.gone)
            }
            None => (line.origin - center + line.direction * f64::from(hit.t)) / self.size(),
        };
        let frame = Frame::around(self.axis.as_dvec3());
        let out = (p - axis * p.dot(axis)).normalize_or(frame.x);
        let ring = out * big;
        let normal = (p - ring).normalize_or(out);
        let point = center + (ring + normal * small) * self.size();
        let uv = [solve::turn(out.dot(frame.x), out.dot(frame.z)), solve::turn(-normal.dot(axis), normal.dot(out))];
        solve::surface(point, self.number_size(), normal, uv)
    }

    /// The surface differential at one of the torus's points.
    pub fn surface_differential(&self, surface: &Surface) -> SurfaceDifferential {
        let frame = Frame::around(self.axis.as_dvec3());
        let (n, tube) = (surface.normal, f64::from(self.tube));
        let from_center = surface.exact - self.center.as_dvec3();
        let out = (from_center - frame.y * from_center.dot(frame.y)).normalize_or(frame.x);
        let ring = from_center.dot(out).max(self.size() * 1e-9);
        let across = around(out, frame.x, frame.z);
        // The direction of growing v: n turned by a right angle from `out` against the axis.
        let down = -frame.y * n.dot(out) + out * n.dot(frame.y);
        SurfaceDifferential {
            gradients: [turn_gradient(out, frame.x, frame.z, ring, self.size()), down / (TAU * tube)],
            shape_operator: outer(across, across) * (n.dot(out) / ring) + outer(down, down) * (1.0 / tube),
            round: true,
        }
    }

    /// The magnitude of the numbers behind a point. The equation of a thin tube is worse conditioned by the ratio of
    /// the radii.
    fn number_size(&self) -> f64 {
        let ratio = f64::from(self.radius) / f64::from(self.tube);
        (self.center.as_dvec3().abs().max_element() + self.size()) * (1.0 + ratio)
    }

    /// The box around the torus.
    pub fn bounds(&self) -> Aabb {
        let axis = self.axis.as_dvec3().normalize();
        let extent = solve::disk_extent(axis, f64::from(self.radius)) + f64::from(self.tube);
        let center = self.center.as_dvec3();
        solve::bounds(center, extent, center.abs().max_element() + self.size())
    }

    /// The torus moved by a transform, if it stays round.
    pub(super) fn transformed(&self, t: &Transform) -> Option<Torus> {
        let scale = t.uniform_scale()?;
        let center = t.point(self.center.as_dvec3()).as_vec3();
        let [radius, tube] = [self.radius, self.tube].map(|r| (f64::from(r) * scale) as f32);
        Some(Torus { center, axis: solve::moved_axis(t, self.axis), radius, tube })
    }

    pub(super) fn check(&self) -> Result<(), OutOfRange> {
        solve::finite("center", self.center)?;
        solve::direction("axis", self.axis)?;
        solve::positive("radius", self.radius)?;
        solve::positive("tube", self.tube)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const INF: f32 = f32::INFINITY;
    const TORUS: Torus = Torus { center: Vec3::ZERO, axis: Vec3::Y, radius: 5.0, tube: 1.0 };

    /// All hits along the ray.
    fn all(torus: &Torus, o: Vec3, d: Vec3) -> Vec<f32> {
        let mut hits = Vec::new();
        let mut from = 0.0;
        while let Some(hit) = torus.intersect(&Ray::new(o + d * from, d), INF) {
            hits.push(from + hit.t);
            from += hit.t + 1e-3;
        }
        hits
    }

    fn close(found: &[f32], expected: &[f32]) {
        let same = |(a, b): (&f32, &f32)| (a - b).abs() < 1e-4;
        assert!(found.len() == expected.len() && found.iter().zip(expected).all(same), "{found:?} for {expected:?}");
    }

    #[test]
    fn a_ray_across_meets_it_four_times() {
        close(&all(&TORUS, Vec3::X * 10.0, Vec3::NEG_X), &[4.0, 6.0, 14.0, 16.0]);
    }

    #[test]
    fn a_ray_through_the_hole_passes() {
        close(&all(&TORUS, Vec3::new(1.0, 10.0, 0.0), Vec3::NEG_Y), &[]);
    }

    #[test]
    fn a_spindle_has_no_surface_inside() {
        let spindle = Torus { radius: 1.0, tube: 2.0, ..TORUS };
        close(&all(&spindle, Vec3::X * 10.0, Vec3::NEG_X), &[7.0, 13.0]);
        let tip = libm::sqrtf(4.0 - 0.999 * 0.999);
        close(&all(&spindle, Vec3::new(1e-3, 10.0, 0.0), Vec3::NEG_Y), &[10.0 - tip, 10.0 + tip]);
    }

    #[test]
    fn from_afar_the_point_is_as_good_as_from_near() {
        let (d, target) = (Vec3::new(-3.0, -1.0, 0.5), Vec3::new(5.5, 0.25, 0.125));
        // The multiples are small enough for the origins to be exact.
        let points = [1.0, 32768.0].map(|far| {
            let ray = Ray::new(target - d * (4.0 * far), d);
            let hit = TORUS.intersect(&ray, INF).unwrap();
            TORUS.surface(&ray, &hit).point
        });
        assert!(points[0].distance(points[1]) < 1e-5, "{points:?}");
    }

    #[test]
    fn grazing_rays_meet_the_crest_or_pass() {
        // Rays just below and just above the tube's highest circle.
        let ray = |y: f32| Ray::new(Vec3::new(5.0, y, -20.0), Vec3::Z);
        for y in [0.999_99, 0.999_999] {
            let hit = TORUS.intersect(&ray(y), INF).unwrap();
            let s = TORUS.surface(&ray(y), &hit);
            assert!((s.point.y - y).abs() < 1e-6 && s.normal.y > 0.98, "{s:?}");
        }
        let above = Ray::new(Vec3::new(5.0, 1.000_001, -20.0), Vec3::Z);
        assert_eq!(TORUS.intersect(&above, INF), None);
    }

    #[test]
    fn texture_coordinates_around_the_tube() {
        let uv = |o: Vec3, d: Vec3| {
            let ray = Ray::new(o, d);
            TORUS.surface(&ray, &TORUS.intersect(&ray, INF).unwrap()).uv.to_array()
        };
        assert_eq!(uv(Vec3::Z * 9.0, Vec3::NEG_Z), [0.5, 0.5]);
        assert_eq!(uv(Vec3::X * 9.0, Vec3::NEG_X), [0.75, 0.5]);
        assert_eq!(uv(Vec3::new(0.0, 9.0, 5.0), Vec3::NEG_Y), [0.5, 0.25]);
    }
}
