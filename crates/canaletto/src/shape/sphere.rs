//! Spheres (5.11–5.22).
//!
//! Texture coordinates follow (5.45): θ is the angle from the +y pole, φ the one around y from +z towards +x, relative
//! to the centre. Seen from outside with +y upwards, u grows to the right and v downwards; +z is the middle, u = v = ½.

use super::solve::{self, Local};
use super::{ShapeHit, Surface};
use crate::math::{Transform, quadratic};
use canaletto_bvh::{Aabb, Ray};
use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// A sphere.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sphere {
    /// c, its centre.
    pub center: Vec3,
    /// r > 0.
    pub radius: f32,
}

impl Sphere {
    /// Both parameters in ascending order, as (5.20), negative ones included.
    fn roots(&self, ray: &Ray) -> (Local, Option<[f64; 2]>) {
        let r = f64::from(self.radius);
        let l = Local::new(ray, self.center.as_dvec3(), r);
        let a = l.d.dot(l.d); // (5.16a)
        let b = 2.0 * l.d.dot(l.o); // (5.16b)
        let c = l.o.dot(l.o) - r * r; // (5.16c)
        let roots = quadratic(a, b, c).map(|s| s.map(|s| l.t0 + s));
        (l, roots)
    }

    /// The nearest t in (0, t_max], from outside or inside; (5.19) with its min restricted to the ray.
    pub fn intersect(&self, ray: &Ray, t_max: f32) -> Option<ShapeHit> {
        let t = canaletto_bvh::sphere::intersect(ray, self.center, self.radius, t_max)?;
        Some(ShapeHit { t, part: 0, uv: [0.0; 2] })
    }

    /// The surface at a hit: the point of (5.21) put back on the sphere, the normal of (5.22).
    pub fn surface(&self, ray: &Ray, hit: &ShapeHit) -> Surface {
        let (l, roots) = self.roots(ray);
        let t = solve::nearest(roots.as_ref().map_or(&[], |r| r), hit.t);
        let n = l.at(t).normalize_or(DVec3::Y);
        let (c, r) = (self.center.as_dvec3(), f64::from(self.radius));
        let theta = libm::atan2((n.x * n.x + n.z * n.z).sqrt(), n.y);
        let uv = [solve::turn(n.x, n.z), theta / PI]; // (5.45)
        solve::surface(c + n * r, c.abs().max_element() + r, n, uv)
    }

    /// The box around it.
    pub fn bounds(&self) -> Aabb {
        let (c, r) = (self.center.as_dvec3(), f64::from(self.radius));
        solve::bounds(c, DVec3::splat(r), c.abs().max_element() + r)
    }

    /// The sphere moved, if it stays one.
    pub(super) fn transformed(&self, t: &Transform) -> Option<Sphere> {
        let scale = t.uniform_scale()?;
        let center = t.point(self.center.as_dvec3()).as_vec3();
        Some(Sphere { center, radius: (f64::from(self.radius) * scale) as f32 })
    }

    pub(super) fn check(&self) -> Result<(), String> {
        solve::finite(&"center", self.center)?;
        solve::positive("radius", self.radius)
    }
}
