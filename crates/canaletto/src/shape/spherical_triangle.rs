//! A triangle as seen from a point, and directions that are uniform over its solid angle, in the order of Arvo,
//! *Stratified Sampling of Spherical Triangles*, 1995.
//!
//! The first number cuts off a part of the triangle at the first corner, by an arc from the second corner to the
//! opposite edge. Arvo finds its end by the laws of spherical trigonometry, which lose digits on thin triangles. Here
//! it follows from the formula of the solid angle Ω itself (Van Oosterom & Strackee, *The Solid Angle of a Plane
//! Triangle*, 1983): tan Ω/2 = det(a, b, c) / (1 + a·b + b·c + c·a). It is linear in the end's sine and cosine.

use glam::DVec3;
use std::f64::consts::TAU;

/// The smallest solid angle for which the formulas hold to about six digits, and how far from a half space they do.
/// Smaller triangles are sampled by area, as in pbrt-v4 (6.5.4).
const SMALLEST: f64 = 1e-8;

/// The directions from a point to a triangle.
#[derive(Clone, Copy, Debug)]
pub(super) struct SphericalTriangle {
    /// The unit directions to the corners.
    corners: [DVec3; 3],
    /// The volume that they span.
    volume: f64,
    solid_angle: f64,
}

impl SphericalTriangle {
    /// The triangle with these corners, relative to the point that sees it. None if its solid angle is so small, or so
    /// near that of a half space, that rounding would show.
    pub(super) fn new(corners: [DVec3; 3]) -> Option<SphericalTriangle> {
        let corners = corners.map(DVec3::normalize_or_zero);
        let [a, b, c] = corners;
        let volume = a.dot((b - a).cross(c - a)).abs();
        let solid_angle = 2.0 * libm::atan2(volume, 1.0 + a.dot(b) + b.dot(c) + c.dot(a));
        let usual = (SMALLEST..TAU - SMALLEST).contains(&solid_angle);
        usual.then_some(SphericalTriangle { corners, volume, solid_angle })
    }

    /// The solid angle.
    pub(super) fn solid_angle(&self) -> f64 {
        self.solid_angle
    }

    /// The unit direction at `u` of the unit square. Equal parts of the square map to equal solid angles.
    pub(super) fn sample(&self, [u, v]: [f64; 2]) -> DVec3 {
        let [a, b, c] = self.corners;
        // The end is a cos β + t sin β, where t is the direction from a towards c. Then
        // tan β/2 = sin(uΩ/2) (1 + a·b) / (cos(uΩ/2) det(a, b, t) − sin(uΩ/2) b·t).
        let towards = across(a, c);
        let length = towards.length();
        let t = towards / length;
        let (sin, cos) = libm::sincos(0.5 * u * self.solid_angle);
        let rise = sin * (1.0 + a.dot(b));
        let run = cos * self.volume / length - sin * (b - a).dot(t);
        let scale = 1.0 / (run * run + rise * rise);
        let end = a * ((run * run - rise * rise) * scale) + t * (2.0 * run * rise * scale);
        // Equal parts of the versine of the angle from the second corner on are equal solid angles.
        let versine = v * 0.5 * (end - b).length_squared();
        b * (1.0 - versine) + across(b, end).normalize_or_zero() * (versine * (2.0 - versine)).max(0.0).sqrt()
    }
}

/// The part of a unit direction across another. Near directions lose no digits.
fn across(from: DVec3, to: DVec3) -> DVec3 {
    let edge = to - from;
    edge - from * edge.dot(from)
}
