//! The common part of cylinders and cones: a round body about a segment, whose radius is a linear function of the
//! height. As in exercise 14, the ray is decomposed along and across the axis.
//!
//! Parts: 0 the side, 1 the cap at the base, 2 the cap at the top. On the side, u follows (5.45a) for the angle around
//! the axis, and v grows from 0 at the top to 1 at the base. A cap has the coordinates of a disk that faces outwards.

use super::solve::{self, Frame, Local};
use super::surface_differential::{around, outer, turn_gradient};
use super::{ShapeHit, Surface, SurfaceDifferential};
use crate::math::{DRay, quadratic};
use canaletto_bvh::{Aabb, Ray};
use glam::{DVec3, Vec3};

const SIDE: u32 = 0;
const BASE: u32 = 1;
const TOP: u32 = 2;

/// The body, in `f64`.
pub(super) struct Frustum {
    base: DVec3,
    top: DVec3,
    /// The unit vector from base to top.
    axis: DVec3,
    height: f64,
    radius: f64,
    top_radius: f64,
    caps: bool,
}

/// A ray decomposed along and across the axis, and the quadratic of its intersections with the infinite side.
struct AxialRay {
    ray: Local,
    /// The heights of the origin and the direction.
    oh: f64,
    dh: f64,
    /// The quadratic a s² + b s + c, negative inside, with s relative to the local origin.
    a: f64,
    b: f64,
    c: f64,
}

impl Frustum {
    pub(super) fn new(base: Vec3, top: Vec3, radius: f32, top_radius: f32, caps: bool) -> Frustum {
        let (base, top) = (base.as_dvec3(), top.as_dvec3());
        let height = (top - base).length();
        let axis = (top - base) / height;
        Frustum { base, top, axis, height, radius: radius.into(), top_radius: top_radius.into(), caps }
    }

    /// The growth of the radius per unit of height.
    fn slope(&self) -> f64 {
        (self.top_radius - self.radius) / self.height
    }

    /// Whether a point is certainly [outside](solve::OUTSIDE) of the closed body.
    fn is_outside(&self, p: DVec3) -> bool {
        let p = p - self.base;
        let h = p.dot(self.axis);
        let slack = solve::OUTSIDE * (self.height + self.radius.max(self.top_radius));
        let across = (p - self.axis * h).length() - (self.radius + self.slope() * h);
        h < -slack || h > self.height + slack || across > slack
    }

    /// The largest magnitude of the numbers whose sum is a point.
    fn size(&self) -> f64 {
        self.base.abs().max(self.top.abs()).max_element() + self.height + self.radius.max(self.top_radius)
    }

    fn part(&self, line: DRay) -> AxialRay {
        let ray = Local::new(line, self.base, self.height + self.radius.max(self.top_radius));
        let (oh, dh) = (ray.o.dot(self.axis), ray.d.dot(self.axis));
        let (across, d_across) = (ray.o - self.axis * oh, ray.d - self.axis * dh);
        // ‖across + s d_across‖² = (r + s r')²
        let (r, dr) = (self.radius + self.slope() * oh, self.slope() * dh);
        let a = d_across.length_squared() - dr * dr;
        let b = 2.0 * (across.dot(d_across) - r * dr);
        let c = (across.length() - r) * (across.length() + r);
        AxialRay { ray, oh, dh, a, b, c }
    }

    pub(super) fn intersect(&self, ray: &Ray, t_max: f32) -> Option<ShapeHit> {
        let p = self.part(ray.into());
        if self.caps {
            let [enter, leave] = self.span(&p)?;
            let (s, part) = if (p.ray.t0 + enter.0) as f32 > 0.0 { enter } else { leave };
            return solve::hit(p.ray.t0 + s, part, t_max);
        }
        self.first_on_side(&p, t_max, |_| true)
    }

    /// The nearest hit on the parts of the side that are there, by the place of the point relative to the base.
    pub(super) fn intersect_side(&self, ray: &Ray, t_max: f32, is_there: impl Fn(DVec3) -> bool) -> Option<ShapeHit> {
        self.first_on_side(&self.part(ray.into()), t_max, is_there)
    }

    fn first_on_side(&self, p: &AxialRay, t_max: f32, is_there: impl Fn(DVec3) -> bool) -> Option<ShapeHit> {
        quadratic(p.a, p.b, p.c)?
            .into_iter()
            .filter(|s| (0.0..=self.height).contains(&(p.oh + s * p.dh)) && is_there(p.ray.o + p.ray.d * *s))
            .find_map(|s| solve::hit(p.ray.t0 + s, SIDE, t_max))
    }

    /// The entry and the exit of the whole line through the closed body, with the parts hit. The span is the
    /// intersection of the slab between the caps' planes with the inside of the infinite side. As with boxes, no ray
    /// can pass through a rim.
    fn span(&self, p: &AxialRay) -> Option<[(f64, u32); 2]> {
        const ALL: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];
        let (near, far) = if p.dh == 0.0 {
            if p.oh <= 0.0 || p.oh >= self.height {
                return None;
            }
            ((ALL[0], BASE), (ALL[1], TOP))
        } else {
            let (base, top) = ((-p.oh / p.dh, BASE), ((self.height - p.oh) / p.dh, TOP));
            if p.dh > 0.0 { (base, top) } else { (top, base) }
        };
        // The intervals where a s² + b s + c < 0. There is one between the roots or, for a ray steeper than a cone's
        // side, two outside them. One of the two is in the ghost cone beyond the apex, outside the slab.
        let inside = match quadratic(p.a, p.b, p.c) {
            Some([s1, s2]) if p.a > 0.0 => [Some([s1, s2]), None],
            Some([s1, s2]) if p.a < 0.0 => [Some([ALL[0], s1]), Some([s2, ALL[1]])],
            Some([s, _]) => [Some(if p.b > 0.0 { [ALL[0], s] } else { [s, ALL[1]] }), None],
            None if p.a < 0.0 || p.a == 0.0 && p.c < 0.0 => [Some(ALL), None],
            None => return None,
        };
        let clipped = inside.into_iter().flatten().map(|[s1, s2]| {
            let enter = if s1 > near.0 { (s1, SIDE) } else { near };
            let leave = if s2 < far.0 { (s2, SIDE) } else { far };
            [enter, leave]
        });
        clipped
            .filter(|[enter, leave]| enter.0 <= leave.0)
            .max_by(|x, y| (x[1].0 - x[0].0).total_cmp(&(y[1].0 - y[0].0)))
    }

    pub(super) fn surface(&self, line: DRay, hit: &ShapeHit) -> Surface {
        let p = self.part(line);
        let frame = Frame::around(self.axis);
        if hit.part == SIDE {
            let roots = quadratic(p.a, p.b, p.c).map(|s| s.map(|s| p.ray.t0 + s));
            let roots = roots.as_ref().map_or(&[][..], |roots| {
                if self.caps && p.a > 0.0 && self.is_outside(line.origin) { &roots[..1] } else { roots }
            });
            let point = p.ray.at(solve::nearest(roots, hit.t));
            let h = point.dot(self.axis).clamp(0.0, self.height);
            let out = (point - self.axis * point.dot(self.axis)).normalize_or(frame.x);
            let point = self.axis * h + out * (self.radius + self.slope() * h);
            let normal = (out - self.axis * self.slope()).normalize();
            let uv = [solve::turn(out.dot(frame.x), out.dot(frame.z)), 1.0 - h / self.height];
            return solve::surface(self.base + point, self.size(), normal, uv);
        }
        let (center, r, normal) = match hit.part {
            BASE => (self.base, self.radius, -self.axis),
            _ => (self.top, self.top_radius, self.axis),
        };
        let h = if hit.part == BASE { 0.0 } else { self.height };
        let point = p.ray.at(p.ray.t0 + (h - p.oh) / p.dh);
        let across = (point - self.axis * point.dot(self.axis)).clamp_length_max(r);
        let way = |axis: DVec3| if r > 0.0 { 0.5 * (1.0 + across.dot(axis) / r) } else { 0.5 };
        let uv = [way(frame.x), way(if hit.part == BASE { -frame.z } else { frame.z })];
        solve::surface(center + across, self.size(), normal, uv)
    }

    pub(super) fn surface_differential(&self, surface: &Surface, hit: &ShapeHit) -> SurfaceDifferential {
        let frame = Frame::around(self.axis);
        if hit.part != SIDE {
            let (r, z) = if hit.part == BASE { (self.radius, -frame.z) } else { (self.top_radius, frame.z) };
            let scale = if r > 0.0 { 0.5 / r } else { 0.0 };
            return SurfaceDifferential::flat(frame.x * scale, z * scale);
        }
        let n = surface.normal;
        let out = (n - self.axis * n.dot(self.axis)).normalize_or(frame.x);
        let height = (surface.exact - self.base).dot(self.axis).clamp(0.0, self.height);
        let (radius, size) = (self.radius + self.slope() * height, self.radius.max(self.top_radius));
        let across = around(out, frame.x, frame.z);
        let slope = self.slope();
        // The normal is (out − r' axis) / √(1 + r'²), and only `out` changes.
        let turn = 1.0 / (radius.max(size * 1e-9) * (1.0 + slope * slope).sqrt());
        SurfaceDifferential {
            gradients: [turn_gradient(out, frame.x, frame.z, radius, size), -self.axis / self.height],
            shape_operator: outer(across, across) * turn,
            round: true,
        }
    }

    pub(super) fn bounds(&self) -> Aabb {
        let end = |center: DVec3, r: f64| solve::bounds(center, solve::disk_extent(self.axis, r), self.size());
        solve::union(end(self.base, self.radius), end(self.top, self.top_radius))
    }
}
