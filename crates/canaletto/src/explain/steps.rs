//! The numbers on the chapter's way to a pixel: camera (5.2–5.10), intersections (5.11–5.31), box 5.1's loop over all
//! objects, and the vectors of reflection and refraction (5.37–5.44).

use super::intersection::{Intersection, TriedObject};
use crate::camera::Camera;
use crate::math::Rgb;
use crate::world::World;
use glam::DVec3;
use serde::Serialize;

/// What the chapter makes of a camera's parameters before the first ray.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct CameraSteps {
    /// The eye.
    pub eye: [f64; 3],
    /// x̂ₑ, ŷₑ and ẑₑ of (5.3): to the right, upwards and backwards.
    pub axes: [[f64; 3]; 3],
    /// Whether all rays are parallel. The window is then given, and not computed from an angle.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub orthographic: bool,
    /// d_f, the distance of the projection plane (5.2a).
    pub d_f: f64,
    /// The window's height on that plane (5.2b).
    pub height: f64,
    /// The window's width on that plane (5.2c).
    pub base: f64,
}

impl CameraSteps {
    /// The steps of a camera that is relative to the world's origin.
    pub(super) fn new(world: &World, camera: &Camera) -> CameraSteps {
        let window = camera.window();
        CameraSteps {
            eye: (world.origin() + camera.eye()).to_array(),
            axes: camera.axes().map(|axis| axis.to_array()),
            orthographic: camera.is_orthographic(),
            d_f: camera.focal_distance(),
            height: window.y,
            base: window.x,
        }
    }
}

/// A ray as the chapter finds its hit.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct RaySteps {
    /// d of the chapter: (5.10) for a camera ray, which reaches the projection plane; the direction as given for a ray
    /// without a camera; else the unit direction.
    pub direction: [f64; 3],
    /// What becomes of each object in the order of the file (box 5.1). Empty if there are too many primitives.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub tried: Vec<TriedObject>,
    /// The number of objects that aren't listed. None of them is met.
    #[serde(skip_serializing_if = "super::tree::is_zero")]
    pub more_tried: usize,
    /// The equation of the shape that is met, if the chapter has one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub intersection: Option<Intersection>,
    /// The way from the direction of view to the refracted direction.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub refraction: Option<RefractionSteps>,
}

/// The vectors at a hit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct HitSteps {
    /// v̂, the unit direction to the viewer.
    pub v: [f64; 3],
    /// v·n.
    pub v_dot_n: f64,
    /// r̂ = 2 (v·n) n − v, the mirrored direction (5.37).
    pub r: [f64; 3],
}

impl HitSteps {
    /// The vectors at a hit of a ray of this direction, with the normal on the viewer's side.
    pub(super) fn new(direction: DVec3, normal: DVec3) -> HitSteps {
        let v = -direction;
        let v_dot_n = v.dot(normal);
        HitSteps { v: v.to_array(), v_dot_n, r: (normal * (2.0 * v_dot_n) - v).to_array() } // (5.37)
    }
}

/// Snell's law as the chapter applies it (5.41–5.44).
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct RefractionSteps {
    /// v_t = (v·n) n − v, the tangential part of the direction of view (5.41).
    pub v_t: [f64; 3],
    /// sin θᵢ = |v_t| (5.42).
    pub sin_i: f64,
    /// sin θₜ = ηᵢ/ηₜ sin θᵢ (5.43).
    pub sin_t: f64,
    /// cos θₜ (5.43).
    pub cos_t: f64,
    /// t̂, the unit vector along v_t; zero if the ray meets the surface at a right angle.
    pub t: [f64; 3],
    /// r_t = sin θₜ t̂ − cos θₜ n, the refracted direction (5.44).
    pub r_t: [f64; 3],
}

impl RefractionSteps {
    /// The refraction of a ray of this direction from a medium into another.
    pub(super) fn new(direction: DVec3, normal: DVec3, [from, into]: [f64; 2]) -> RefractionSteps {
        let v = -direction;
        let v_t = normal * v.dot(normal) - v; // (5.41)
        let sin_i = v_t.length(); // (5.42)
        let sin_t = from / into * sin_i; // (5.43)
        let cos_t = (1.0 - sin_t * sin_t).max(0.0).sqrt();
        let t = v_t.normalize_or_zero();
        let r_t = t * sin_t - normal * cos_t; // (5.44)
        RefractionSteps { v_t: v_t.to_array(), sin_i, sin_t, cos_t, t: t.to_array(), r_t: r_t.to_array() }
    }
}

/// What is left of a light point's intensity at a hit, before shadows.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct LightSteps {
    /// The intensity of the point.
    pub intensity: Rgb,
    /// 1 / (c + l·d + q·d²), the attenuation by distance.
    pub attenuation: f32,
    /// The coefficients c, l and q.
    pub coefficients: [f32; 3],
    /// 1 − (d / range)⁴, the share that the light's range leaves, if it has one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range: Option<f32>,
    /// The share that a spot's cone, a beam or the side of a surface leaves.
    pub cone: f32,
}
