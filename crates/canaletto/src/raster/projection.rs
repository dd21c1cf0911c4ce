//! Projections of the world onto a screen: of the camera, and of the lights' shadow maps.
//!
//! A point has the homogeneous coordinates X, Y, W and D, which are affine functions of its place. X/W and Y/W are
//! pixels to the right and upwards from the lower left corner. D/W is a depth that is affine on the screen and grows
//! towards the viewer: 1/z of a perspective, −z of a parallel projection.

use super::depth_range::DepthRange;
use crate::camera::Camera;
use crate::math::{DRay, Transform};
use glam::{DMat3, DVec3, DVec4};

/// A projection of a space onto a screen.
#[derive(Clone, Debug)]
pub(crate) struct Projection {
    /// The gradients of X, Y, W and D.
    gradients: [DVec3; 4],
    /// Their values at the origin of the space.
    offsets: DVec4,
    /// The near plane: points with a negative product are not drawn.
    near: DVec4,
    /// The depth of the far plane; what has less is not drawn.
    pub(crate) far_depth: f64,
}

/// The homogeneous coordinates of a place that is `right`, `up` and `forward` from the eye along unit axes.
struct Frame {
    eye: DVec3,
    right: DVec3,
    up: DVec3,
    forward: DVec3,
}

impl Frame {
    /// The projection with the given coefficients of (right, up, forward, 1) for X, Y, W and D.
    fn projection(&self, rows: [[f64; 4]; 4], near: DVec4, far_depth: f64) -> Projection {
        let gradients = rows.map(|[r, u, f, _]| self.right * r + self.up * u + self.forward * f);
        let offsets = DVec4::from_array([0, 1, 2, 3].map(|i: usize| rows[i][3] - gradients[i].dot(self.eye)));
        Projection { gradients, offsets, near, far_depth }
    }
}

impl Projection {
    /// The projection of a camera without a lens (5.2).
    pub(crate) fn of_camera(camera: &Camera, range: DepthRange) -> Projection {
        let [right, up, back] = camera.axes();
        let ([w, h], window, shift) = (camera.size().map(f64::from), camera.window(), camera.shift());
        let frame = Frame { eye: camera.eye(), right, up, forward: -back };
        if camera.is_orthographic() {
            let rows = [
                [w / window.x, 0.0, 0.0, (0.5 - shift.x) * w],
                [0.0, h / window.y, 0.0, (0.5 - shift.y) * h],
                [0.0, 0.0, 0.0, 1.0],
                [0.0, 0.0, -1.0, 0.0],
            ];
            return frame.projection(rows, DVec4::new(0.0, 0.0, -range.near, -1.0), -range.far);
        }
        let focal = camera.focal_distance();
        let rows = [
            [focal / window.x * w, 0.0, (0.5 - shift.x) * w, 0.0],
            [0.0, focal / window.y * h, (0.5 - shift.y) * h, 0.0],
            [0.0, 0.0, 1.0, 0.0],
            [0.0, 0.0, 0.0, 1.0],
        ];
        frame.projection(rows, DVec4::new(0.0, 0.0, 1.0, -range.near), 1.0 / range.far)
    }

    /// The projection from `eye` along `forward` onto a square of `side` pixels, with the half angle of this tangent.
    pub(crate) fn square(eye: DVec3, forward: DVec3, tangent: f64, side: u32, near: f64) -> Projection {
        Self::square_along([across(forward).0, across(forward).1, forward], eye, tangent, side, near)
    }

    /// [`Projection::square`] with the directions that are to the right, upwards and forward.
    pub(crate) fn square_along(
        [right, up, forward]: [DVec3; 3],
        eye: DVec3,
        tangent: f64,
        side: u32,
        near: f64,
    ) -> Projection {
        let half = f64::from(side) * 0.5;
        let rows = [
            [half / tangent, 0.0, half, 0.0],
            [0.0, half / tangent, half, 0.0],
            [0.0, 0.0, 1.0, 0.0],
            [0.0, 0.0, 0.0, 1.0],
        ];
        Frame { eye, right, up, forward }.projection(rows, DVec4::new(0.0, 0.0, 1.0, -near), 0.0)
    }

    /// The parallel projection along `forward` of a ball onto a square of `side` pixels.
    pub(crate) fn parallel(center: DVec3, radius: f64, forward: DVec3, side: u32) -> Projection {
        let half = f64::from(side) * 0.5;
        let (right, up) = across(forward);
        // Depth is the distance in front of the ball's far end.
        let rows = [
            [half / radius, 0.0, 0.0, half],
            [0.0, half / radius, 0.0, half],
            [0.0, 0.0, 0.0, 1.0],
            [0.0, 0.0, -1.0, radius],
        ];
        Frame { eye: center, right, up, forward }.projection(rows, DVec4::new(0.0, 0.0, 1.0, 0.0), 0.0)
    }

    /// The projection of the space that this transform maps to this projection's space.
    pub(crate) fn of_space(&self, to_world: Option<&Transform>) -> Projection {
        let Some(t) = to_world else { return self.clone() };
        let m = t.matrix();
        let linear = m.matrix3.transpose();
        let offsets = [0, 1, 2, 3].map(|i: usize| self.offsets[i] + self.gradients[i].dot(m.translation));
        Projection {
            gradients: self.gradients.map(|g| linear * g),
            offsets: DVec4::from_array(offsets),
            near: self.near,
            far_depth: self.far_depth,
        }
    }

    /// The homogeneous coordinates of a point.
    #[inline(always)]
    pub(crate) fn point(&self, p: DVec3) -> DVec4 {
        let [x, y, w, d] = self.gradients;
        DVec4::new(
            x.dot(p) + self.offsets.x,
            y.dot(p) + self.offsets.y,
            w.dot(p) + self.offsets.z,
            d.dot(p) + self.offsets.w,
        )
    }

    /// The near plane: points with a negative product are not drawn.
    pub(crate) fn near(&self) -> DVec4 {
        self.near
    }

    /// A plane at half the distance of the near plane. A parallel projection needs none: W is 1 everywhere.
    pub(crate) fn nearer_plane(&self) -> DVec4 {
        if !self.is_perspective() {
            return DVec4::Z;
        }
        DVec4::new(self.near.x, self.near.y, self.near.z, 0.5 * self.near.w)
    }

    /// The depth of the near plane.
    pub(crate) fn near_depth(&self) -> f64 {
        if self.near.w == 0.0 { f64::INFINITY } else { -self.near.z / self.near.w }
    }

    /// The parameter t of a line from the viewer at a depth.
    pub(crate) fn parameter_at(&self, line: &DRay, depth: f64) -> f64 {
        let [_, _, w, d] = self.gradients;
        if self.is_perspective() {
            1.0 / (depth * w.dot(line.direction))
        } else {
            (depth - self.offsets.w - d.dot(line.origin)) / d.dot(line.direction)
        }
    }

    /// The depth at parameter t of a line from the viewer.
    pub(crate) fn depth_at(&self, line: &DRay, t: f64) -> f64 {
        let [_, _, w, d] = self.gradients;
        if self.is_perspective() {
            1.0 / (t * w.dot(line.direction))
        } else {
            self.offsets.w + d.dot(line.origin) + t * d.dot(line.direction)
        }
    }

    /// The distance along the optical axis of a camera's depth.
    pub(crate) fn distance_of(&self, depth: f64) -> f64 {
        if self.is_perspective() { 1.0 / depth } else { -depth }
    }

    /// The largest number of pixels that a unit of length covers where W is 1.
    pub(crate) fn pixels_per_unit(&self, [width, height]: [f64; 2]) -> f64 {
        let [x, y, w, _] = self.gradients;
        // A step that changes W moves the point by up to its distance from the axis.
        let along = |g: DVec3, size: f64| g.length() + w.length() * size;
        along(x, width).max(along(y, height))
    }
}

/// Unit vectors to the right and upwards of a direction.
fn across(forward: DVec3) -> (DVec3, DVec3) {
    // x × y is the direction; to the right × upwards points back to the viewer.
    let (x, y) = forward.any_orthonormal_pair();
    (y, x)
}

/// The coefficients (α, β, γ) for which the depth at a place is α x + β y + γ, on the plane through three points. They
/// aren't finite if the plane is seen edge on. Then the determinant, which is positive if the points run
/// counter-clockwise, seen from the eye.
#[inline(always)]
pub(crate) fn depth_plane([a, b, c]: &[DVec4; 3]) -> (DVec3, f64) {
    // Cramer's rule for α X + β Y + γ W = D at the three points.
    let [p, q, r] = [a.truncate(), b.truncate(), c.truncate()];
    let (qr, rp, pq) = (q.cross(r), r.cross(p), p.cross(q));
    let determinant = p.dot(qr);
    ((qr * a.w + rp * b.w + pq * c.w) / determinant, determinant)
}

impl Projection {
    /// The number of pixels that a unit of length across the view covers where W is 1.
    pub(crate) fn scale(&self) -> f64 {
        let [x, _, w, _] = self.gradients;
        // X holds a multiple of W, which moves the centre of the screen.
        let along = w.length_squared();
        let right = if along > 0.0 { x - w * (x.dot(w) / along) } else { x };
        right.length()
    }

    /// The farthest and the nearest depth that are near this one: of twice and half its distance from the eye, or of a
    /// length around it in a parallel projection.
    pub(crate) fn depths_around(&self, depth: f64, length: f64) -> [f64; 2] {
        if self.is_perspective() { [depth * 0.5, depth * 2.0] } else { [depth - length, depth + length] }
    }

    fn is_perspective(&self) -> bool {
        self.gradients[3] == DVec3::ZERO
    }

    /// The depth of a point that lies nearer to the viewer by this length than one of the given depth.
    pub(crate) fn nearer(&self, depth: f64, length: f64) -> f64 {
        if self.is_perspective() { depth / (1.0 - (length * depth).min(0.5)) } else { depth + length }
    }

    /// The line through a place on the screen, away from the viewer, with a unit direction.
    pub(crate) fn line(&self, [px, py]: [f64; 2]) -> DRay {
        // A point p has X = px W, Y = py W; the near plane gives the third equation.
        let [x, y, w, d] = self.gradients;
        let (nx, ny) = (x - w * px, y - w * py);
        let (ox, oy) = (self.offsets.x - self.offsets.z * px, self.offsets.y - self.offsets.z * py);
        let third = if d == DVec3::ZERO { w } else { -d };
        let offset = if d == DVec3::ZERO { self.offsets.z } else { -self.offsets.w };
        let direction = nx.cross(ny);
        let direction = if third.dot(direction) < 0.0 { -direction } else { direction };
        // The point where the third function is 0: the eye of a perspective.
        let matrix = DMat3::from_cols(nx, ny, third).transpose();
        let origin = matrix.inverse() * -DVec3::new(ox, oy, offset);
        DRay { origin, direction: direction.normalize() }
    }
}
