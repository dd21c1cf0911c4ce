//! Rays against triangles: Woop, Benthin and Wald, "Watertight ray/triangle intersection" (2013).
//!
//! A shear takes the ray to the z axis; the hit is decided in the plane by the signs of three edge functions. The
//! two triangles of a shared edge compute the same sheared vertices and exactly opposite edge functions, and zero
//! counts as inside on both sides, so no ray passes between them.
//!
//! Where it deviates:
//! - The shear is in f64 and an edge function never has the wrong sign (`exact`), which also settles vertices:
//!   the projected triangles are those of exact points in the plane, with closed borders.
//! - t comes from the triangle's plane, because a weighted sum of depths may turn an origin on the plane into a
//!   tiny positive t; where the triangle is seen edge-on, t is confined to its box (`slab`).
//! - Nothing overflows or vanishes: products of three differences of f32 stay far within the range of f64.

use glam::{DVec3, Vec3};

use crate::exact::difference_of_products;
use crate::slab::Slabs;
use crate::{Aabb, Ray};

/// A ray, prepared for triangles.
#[derive(Clone, Copy, Debug)]
pub struct TriangleRay {
    origin: DVec3,
    direction: DVec3,
    /// The axis of the longest component of the direction, and the other two, ordered such that winding is kept.
    axes: [usize; 3],
    /// Shears of x and y.
    shear: [f64; 2],
    slabs: Slabs,
}

/// Where a ray meets a triangle abc.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TriangleHit {
    /// The ray's parameter.
    pub t: f32,
    /// Weight of b; the point is (1 − u − v) a + u b + v c, with no weight below 0.
    pub u: f32,
    /// Weight of c.
    pub v: f32,
    /// Whether the ray meets the side from which a, b, c run counter-clockwise.
    pub front: bool,
}

impl TriangleRay {
    /// Prepares `ray`.
    pub fn new(ray: &Ray) -> Self {
        let direction = ray.direction.as_dvec3();
        let length = ray.direction.abs();
        let z = if length.x >= length.y && length.x >= length.z {
            0
        } else if length.y >= length.z {
            1
        } else {
            2
        };
        let (mut x, mut y) = ((z + 1) % 3, (z + 2) % 3);
        if direction[z] < 0.0 {
            (x, y) = (y, x);
        }
        Self {
            origin: ray.origin.as_dvec3(),
            direction,
            axes: [x, y, z],
            // NaN for a zero direction, which fails every comparison below.
            shear: [direction[x] / direction[z], direction[y] / direction[z]],
            slabs: Slabs::new(ray),
        }
    }

    /// The hit on the triangle abc with 0 < t ≤ t_max. Both sides are hit; a triangle of no area never is.
    #[inline]
    pub fn intersect(&self, a: Vec3, b: Vec3, c: Vec3, t_max: f32) -> Option<TriangleHit> {
        let [ax, ay] = self.project(a);
        let [bx, by] = self.project(b);
        let [cx, cy] = self.project(c);
        // Twice the signed areas that the ray spans with each edge, i.e. unnormalised weights of a, b and c.
        let wa = difference_of_products(bx, cy, by, cx);
        let wb = difference_of_products(cx, ay, cy, ax);
        let wc = difference_of_products(ax, by, ay, bx);
        let inside = (wa >= 0.0 && wb >= 0.0 && wc >= 0.0) || (wa <= 0.0 && wb <= 0.0 && wc <= 0.0);
        let area = wa + wb + wc;
        if !inside || area == 0.0 {
            return None;
        }
        self.hit([a, b, c], [wa, wb, wc], area, t_max)
    }

    /// The vertex relative to the ray, sheared.
    #[inline]
    fn project(&self, p: Vec3) -> [f64; 2] {
        let p = p.as_dvec3() - self.origin;
        let [x, y, z] = self.axes;
        [p[x] - self.shear[0] * p[z], p[y] - self.shear[1] * p[z]]
    }

    fn hit(&self, [a, b, c]: [Vec3; 3], weights: [f64; 3], area: f64, t_max: f32) -> Option<TriangleHit> {
        let bounds = Aabb::from_points([a, b, c]);
        let [a, b, c] = [a, b, c].map(|p| p.as_dvec3());
        let normal = cross(b - a, c - a);
        if normal == DVec3::ZERO {
            return None;
        }
        let away = self.direction.dot(normal);
        let t = if away != 0.0 {
            (a - self.origin).dot(normal) / away
        } else {
            // Edge-on: the depth by weights, as in the paper.
            let z = self.axes[2];
            let depth = weights[0] * (a[z] - self.origin[z])
                + weights[1] * (b[z] - self.origin[z])
                + weights[2] * (c[z] - self.origin[z]);
            depth / area / self.direction[z]
        };
        let t = self.slabs.confine(&bounds, t, t_max)?;
        let u = ((weights[1] / area) as f32).clamp(0.0, 1.0);
        let v = ((weights[2] / area) as f32).clamp(0.0, 1.0 - u);
        Some(TriangleHit { t, u, v, front: area < 0.0 })
    }
}

/// The cross product, exactly 0 for parallel vectors.
fn cross(a: DVec3, b: DVec3) -> DVec3 {
    DVec3::new(
        difference_of_products(a.y, b.z, a.z, b.y),
        difference_of_products(a.z, b.x, a.x, b.z),
        difference_of_products(a.x, b.y, a.y, b.x),
    )
}
