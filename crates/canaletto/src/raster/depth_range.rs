//! The near and far planes between which a z-buffer draws.
//!
//! Depths are stored as 1/z. Their relative precision is therefore the same at all distances, and the planes may lie
//! as far apart as is needed. Planes that the camera doesn't give are derived from the world: the near one lies in
//! front of everything, and there is no far one. An orthographic camera, whose depths are −z, draws from the plane
//! through its eye on.

use super::facets::corners;
use crate::camera::Camera;
use crate::shape::Shape;
use crate::world::World;
use canaletto_bvh::Aabb;
use glam::DVec3;

/// The near plane's distance over that of the nearest box that doesn't hold the eye. Depths are less than distances
/// from the eye: in the corners of wide views, by up to this factor.
const OUTSIDE: f64 = 1.0 / (1u32 << 10) as f64;

/// The near plane's distance over that of the farthest corner of a box that holds the eye.
const INSIDE: f64 = 1.0 / (1u64 << 40) as f64;

/// Planes reach this far, over the distance of the farthest corner of the world's bounds. What is left out at the
/// horizon is less than a thousandth of a pixel.
const REACH: f64 = (1u32 << 24) as f64;

/// The distances along the optical axis between which a view is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct DepthRange {
    pub(crate) near: f64,
    /// Infinite if nothing is too far.
    pub(crate) far: f64,
    /// The distance from the eye to which shapes without bounds are drawn.
    pub(crate) reach: f64,
}

impl DepthRange {
    /// The range of a camera at rest.
    pub(crate) fn new(world: &World, camera: &Camera) -> DepthRange {
        let eye = camera.eye();
        let (mut nearest, mut farthest) = (f64::INFINITY, 0.0f64);
        for number in 0..world.placed_geometry_count() {
            let bounds = world.placed_bounds(number);
            if bounds.is_empty() {
                continue;
            }
            let [least, most] = distances(eye, &bounds);
            nearest = nearest.min((least * OUTSIDE).max(most * INSIDE));
            farthest = farthest.max(most);
        }
        for shape in world.unbounded_shapes() {
            let Shape::Plane(plane) = shape else { continue };
            let height = (eye - plane.point.as_dvec3()).dot(plane.normal.as_dvec3().normalize()).abs();
            if height > 0.0 {
                nearest = nearest.min(height * OUTSIDE);
                farthest = farthest.max(height);
            }
        }
        let derived = if nearest > 0.0 && nearest.is_finite() { nearest } else { camera.focal_distance() };
        let far = camera.far_plane().unwrap_or(f64::INFINITY);
        if camera.is_orthographic() {
            let (near, window) = (camera.near_plane().unwrap_or(0.0), camera.window() * (camera.shift().abs() + 0.5));
            return DepthRange { near, far, reach: farthest.max(near).max(window.max_element()) * REACH };
        }
        // The derived plane lies in front of a given far plane.
        let near = camera.near_plane().unwrap_or_else(|| derived.min(far * OUTSIDE));
        DepthRange { near, far, reach: farthest.max(near) * REACH }
    }
}

/// The least and the largest distance of a point of a box.
fn distances(eye: DVec3, bounds: &Aabb) -> [f64; 2] {
    let inner = eye.clamp(bounds.min.as_dvec3(), bounds.max.as_dvec3());
    let most = corners(bounds).map(|corner| (corner - eye).length()).fold(0.0, f64::max);
    [(eye - inner).length(), most]
}

/// The box around the camera's view, between its planes.
pub(crate) fn view_bounds(camera: &Camera, range: &DepthRange) -> Aabb {
    if range.far.is_infinite() {
        let (eye, reach) = (camera.eye().as_vec3(), DVec3::splat(range.reach).as_vec3());
        return Aabb { min: eye - reach, max: eye + reach };
    }
    let size = camera.size().map(f64::from);
    let mut bounds = Aabb::EMPTY;
    for [x, y] in [[0.0, 0.0], [size[0], 0.0], [0.0, size[1]], size] {
        let (eye, d) = camera.chapter_ray(x, y);
        for depth in [range.near, range.far] {
            let p = eye + d * (depth / camera.focal_distance());
            bounds.min = bounds.min.min(p.as_vec3());
            bounds.max = bounds.max.max(p.as_vec3());
        }
    }
    bounds
}
