//! Spheres (5.11–5.22).
//!
//! Texture coordinates follow (5.45), relative to the centre: θ is the angle from the +y pole, φ the one around y from
//! +z towards +x. Seen from outside with +y upwards, u grows to the right and v downwards; +z is the middle, u = v = ½.

use super::solve::{self, Local};
use super::surface_differential::{outer, turn_gradient};
use super::{ShapeHit, Surface, SurfaceDifferential};
use crate::OutOfRange;
use crate::math::{DRay, Transform};
use canaletto_bvh::{Aabb, Ray};
use glam::{DMat3, DVec3, Vec2, Vec3};
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// A sphere.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sphere {
    /// The centre c.
    pub center: Vec3,
    /// The radius r > 0.
    pub radius: f32,
}

impl Sphere {
    /// The nearest hit with t in (0, t_max], from outside or inside: (5.19) with its min restricted to the ray.
    #[inline]
    pub fn intersect(&self, ray: &Ray, t_max: f32) -> Option<ShapeHit> {
        let t = canaletto_bvh::sphere::intersect_once(ray, self.center, self.radius, t_max)?;
        Some(ShapeHit { t, part: 0, uv: [0.0; 2] })
    }

    /// The surface at a hit: the point of (5.21) moved onto the sphere, the normal of (5.22).
    pub fn surface(&self, line: impl Into<DRay>, hit: &ShapeHit) -> Surface {
        let surface = self.surface_without_uv(line.into(), hit.t);
        let n = surface.normal;
        let theta = libm::atan2((n.x * n.x + n.z * n.z).sqrt(), n.y);
        Surface { uv: Vec2::new(solve::turn(n.x, n.z) as f32, (theta / PI) as f32), ..surface } // (5.45)
    }

    /// [`Sphere::surface`] without texture coordinates, at the ray's parameter `t`. It has no branch, so that the
    /// compiler vectorises.
    #[inline(always)]
    pub(super) fn surface_without_uv(&self, line: DRay, t: f32) -> Surface {
        let (center, r) = (self.center.as_dvec3(), f64::from(self.radius));
        let l = Local::new(line, center, r);
        let a = l.d.dot(l.d); // (5.16a)
        let b = 2.0 * l.d.dot(l.o); // (5.16b)
        let c = l.o.dot(l.o) - r * r; // (5.16c)
        let outside = (line.origin - center).length_squared() > r * r * (1.0 + solve::OUTSIDE);
        let n = l.at(nearest_root([a, b, c], l.t0, t, outside)).normalize_or(DVec3::Y);
        solve::surface(center + n * r, center.abs().max_element() + r, n, [0.0; 2])
    }

    /// The surface differential at one of the sphere's points.
    pub fn surface_differential(&self, surface: &Surface) -> SurfaceDifferential {
        let (n, r) = (surface.normal, f64::from(self.radius));
        let sin = (n.x * n.x + n.z * n.z).sqrt();
        // At a pole any meridian is valid.
        let out = if sin > 0.0 { DVec3::new(n.x, 0.0, n.z) / sin } else { DVec3::Z };
        let down = out * n.y - DVec3::Y * sin;
        SurfaceDifferential {
            gradients: [turn_gradient(out, DVec3::X, DVec3::Z, r * sin, r), down / (PI * r)],
            shape_operator: (DMat3::IDENTITY - outer(n, n)) * (1.0 / r),
            round: true,
        }
    }

    /// The box around the sphere.
    pub fn bounds(&self) -> Aabb {
        let (c, r) = (self.center.as_dvec3(), f64::from(self.radius));
        solve::bounds(c, DVec3::splat(r), c.abs().max_element() + r)
    }

    /// The sphere moved by a transform, if it stays a sphere.
    pub(super) fn transformed(&self, t: &Transform) -> Option<Sphere> {
        let scale = t.uniform_scale()?;
        let center = t.point(self.center.as_dvec3()).as_vec3();
        Some(Sphere { center, radius: (f64::from(self.radius) * scale) as f32 })
    }

    pub(super) fn check(&self) -> Result<(), OutOfRange> {
        solve::finite("center", self.center)?;
        solve::positive("radius", self.radius)
    }
}

/// The value t₀ + s nearest to the reported `t`, over the roots s of a s² + b s + c = 0 (5.20). The roots are those of
/// [`quadratic`](crate::math::quadratic). The value is `t` itself if there is no root. A line from `outside` enters at
/// the first root.
#[inline(always)]
fn nearest_root([a, b, c]: [f64; 3], t0: f64, t: f32, outside: bool) -> f64 {
    let t = f64::from(t);
    let discriminant = b * b - 4.0 * a * c; // (5.18)
    let q = -0.5 * (b + discriminant.sqrt().copysign(b));
    // Without a quadratic term there is one root.
    let straight = a == 0.0;
    let first = if straight { -c / b } else { q / a };
    let second = if straight { first } else { c / q };
    let [first, second] = if q == 0.0 && !straight { [0.0; 2] } else { [first, second] };
    let [near, far] = if first <= second { [first, second] } else { [second, first] }.map(|s| t0 + s);
    // Bits of non-negative numbers are in the order of the numbers, and NaN comes last.
    let off = |root: f64| (root - t).abs().to_bits();
    let root = if (off(far) < off(near)) & !outside { far } else { near };
    let real = if straight { b != 0.0 } else { discriminant >= 0.0 };
    if real { root } else { t }
}

#[cfg(test)]
mod tests {
    use super::*;

    const INF: f32 = f32::INFINITY;

    #[test]
    fn the_nearest_root_is_one_of_both() {
        let numbers = [0.0, -0.0, 1.0, -1.0, 2.0, -3.5, 1e-200, 1e200, -1e200, f64::MAX, f64::NAN, f64::INFINITY];
        for a in numbers {
            for b in numbers {
                for c in numbers {
                    for t in [0.0, 1.0, -2.5, 1e30] {
                        let roots = crate::math::quadratic(a, b, c).map(|roots| roots.map(|s| 0.25 + s));
                        let expected = solve::nearest(roots.as_ref().map_or(&[], |roots| roots), t);
                        let root = nearest_root([a, b, c], 0.25, t, false);
                        let same = root == expected || root.is_nan() && expected.is_nan();
                        assert!(same, "{a} {b} {c}, {t}: {root} instead of {expected}");
                    }
                }
            }
        }
    }

    fn first(sphere: &Sphere, ray: &Ray) -> (ShapeHit, Surface) {
        let hit = sphere.intersect(ray, INF).unwrap();
        (hit, sphere.surface(ray, &hit))
    }

    #[test]
    fn exercise_2() {
        let sphere = Sphere { center: Vec3::new(0.0, 20.0, 0.0), radius: 25.0 };
        let ray = Ray::new(Vec3::new(100.0, 40.0, 40.0), Vec3::new(-28.7, -1.30, -13.1));
        let (hit, s) = first(&sphere, &ray);
        assert!((hit.t - 2.83).abs() < 0.005, "{hit:?}");
        // The chapter continues with the rounded t.
        assert!((s.point - Vec3::new(18.7, 36.3, 2.90)).abs().max_element() < 0.05, "{s:?}");
        assert!((s.normal.as_vec3() - Vec3::new(0.749, 0.653, 0.116)).abs().max_element() < 0.002, "{s:?}");
        let past = Ray::new(ray.origin + ray.direction * (hit.t + 0.1), ray.direction);
        let far = hit.t + 0.1 + sphere.intersect(&past, INF).unwrap().t;
        assert!((far - 4.03).abs() < 0.005, "{far}");
    }

    #[test]
    fn exercise_7() {
        let sphere = Sphere { center: Vec3::new(3.0, 2.0, 0.0), radius: 1.0 };
        let (hit, s) = first(&sphere, &Ray::new(Vec3::new(10.0, 6.0, 0.0), Vec3::new(-2.0, -1.0, 0.0)));
        assert_eq!(hit.t, 3.2);
        assert_eq!(s.point, Vec3::new(3.6, 2.8, 0.0));
        assert_eq!(s.normal.as_vec3(), Vec3::new(0.6, 0.8, 0.0));
    }

    #[test]
    fn texture_coordinates_of_six_directions() {
        let sphere = Sphere { center: Vec3::new(1.0, 2.0, 3.0), radius: 2.0 };
        let uv = |d: Vec3| first(&sphere, &Ray::new(sphere.center + d * 5.0, -d)).1.uv.to_array();
        assert_eq!(uv(Vec3::Z), [0.5, 0.5]);
        assert_eq!(uv(Vec3::X), [0.75, 0.5]);
        assert_eq!(uv(Vec3::NEG_X), [0.25, 0.5]);
        assert_eq!(uv(Vec3::Y)[1], 0.0);
        assert_eq!(uv(Vec3::NEG_Y)[1], 1.0);
    }

    #[test]
    fn a_sphere_met_from_very_far_keeps_its_point_on_it() {
        let sphere = Sphere { center: Vec3::ZERO, radius: 1.0 };
        let (_, s) = first(&sphere, &Ray::new(Vec3::new(3e8, 0.5, 0.25), Vec3::NEG_X));
        assert!((s.point.as_dvec3().length() - 1.0).abs() < 1e-7, "{s:?}");
        assert!((s.point.y - 0.5).abs() < 1e-6, "{s:?}");
    }

    #[test]
    fn bounds_are_rounded_outwards() {
        let sphere = Sphere { center: Vec3::new(0.1, -0.2, 1e9), radius: 0.7 };
        let (b, c, r) = (sphere.bounds(), sphere.center.as_dvec3(), f64::from(sphere.radius));
        assert!(b.min.as_dvec3().cmple(c - r).all() && b.max.as_dvec3().cmpge(c + r).all(), "{b:?}");
    }

    #[test]
    fn a_squeezed_sphere_is_none() {
        let shape = super::super::Shape::Sphere(Sphere { center: Vec3::ZERO, radius: 1.0 });
        assert_eq!(shape.transformed(&Transform::scale(DVec3::new(1.0, 2.0, 1.0)).unwrap()), None);
    }

    #[test]
    fn the_message_names_number_and_value() {
        let sphere = Sphere { center: Vec3::ZERO, radius: -2.0 };
        assert_eq!(sphere.check().unwrap_err().to_string(), "radius is -2; it must be more than 0 and finite");
    }
}
