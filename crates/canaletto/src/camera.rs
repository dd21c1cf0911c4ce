//! The pinhole camera (5.2): rays from pixels, and pixels from points.
//!
//! In `f64`: a camera makes one ray per sample, and the first rounding to `f32` should be the ray's direction itself.

use crate::math::{Line, Spread};
use crate::scene::{Extrinsics, Intrinsics};
use glam::{DVec2, DVec3};

/// A camera ready to make rays (box 5.2).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    eye: DVec3,
    /// The unit axes x̂ₑ (right), ŷₑ (up), ẑₑ (backwards).
    axes: [DVec3; 3],
    /// d_f, the distance of the projection plane.
    near: f64,
    /// The window's width ("base") and height on the projection plane.
    window: DVec2,
    shift: DVec2,
    size: [u32; 2],
}

/// Why parameters make no camera.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CameraError {
    /// There is no optical axis.
    #[error("eye and center are the same point; the camera has no direction to look in")]
    NoDirection,
    /// The picture could be turned any way.
    #[error("up is parallel to the direction from eye to center (or zero); the picture has no upward side")]
    NoUp,
    /// The angle of view is out of range.
    #[error("fovy is {0}; the angle of view must be more than 0 and less than 180 degrees")]
    Fovy(f64),
    /// The picture has no pixels, or more than can be counted.
    #[error("size is {0} x {1}; each side must be between 1 and {max} pixels", max = Camera::MAX_SIDE)]
    Size(u32, u32),
    /// The planes do not bound a view.
    #[error("near is {0} and far is {1}; they must satisfy 0 < near < far")]
    Planes(f64, f64),
    /// A parameter is NaN or infinite.
    #[error("{0} holds a number that isn't finite")]
    NotFinite(&'static str),
}

impl Camera {
    /// The longest side of a picture.
    pub const MAX_SIDE: u32 = 65_536;

    /// The camera of these parameters.
    ///
    /// # Errors
    /// [`CameraError`] says which parameters make no picture.
    pub fn new(intrinsics: &Intrinsics, extrinsics: &Extrinsics) -> Result<Camera, CameraError> {
        let Intrinsics { fovy, width, height, near, far, shift } = *intrinsics;
        let Extrinsics { eye, center, up } = *extrinsics;
        for (name, finite) in [
            ("eye", eye.is_finite()),
            ("center", center.is_finite()),
            ("up", up.is_finite()),
            ("shift", shift.iter().all(|s| s.is_finite())),
        ] {
            if !finite {
                return Err(CameraError::NotFinite(name));
            }
        }
        if !(fovy > 0.0 && fovy < 180.0) {
            return Err(CameraError::Fovy(fovy));
        }
        if !(1..=Camera::MAX_SIDE).contains(&width) || !(1..=Camera::MAX_SIDE).contains(&height) {
            return Err(CameraError::Size(width, height));
        }
        if !(near > 0.0 && near < far && far.is_finite()) {
            return Err(CameraError::Planes(near, far));
        }
        let z = (eye - center).try_normalize().ok_or(CameraError::NoDirection)?; // (5.3a)
        let sideways = up.try_normalize().ok_or(CameraError::NoUp)?.cross(z);
        // The cross product of unit vectors is the sine between them: below this it holds no digits of `up`.
        if sideways.length() < 1e-9 {
            return Err(CameraError::NoUp);
        }
        let x = sideways.normalize(); // (5.3b)
        let y = z.cross(x); // (5.3c)
        let window_height = 2.0 * near * libm::tan(fovy.to_radians() / 2.0); // (5.2b)
        let window_width = f64::from(width) / f64::from(height) * window_height; // (5.2c)
        Ok(Camera {
            eye,
            axes: [x, y, z],
            near,
            window: DVec2::new(window_width, window_height),
            shift: DVec2::from(shift),
            size: [width, height],
        })
    }

    /// The chapter's ray for (x, y) in pixels, y upwards: eye and d of (5.10), of the length that reaches the
    /// projection plane. (0, 0) is the lower left corner of the picture, (w, h) the upper right one.
    pub fn chapter_ray(&self, x: f64, y: f64) -> (DVec3, DVec3) {
        let [x_e, y_e, z_e] = self.axes;
        let u = self.window.x * (x / f64::from(self.size[0]) - 0.5 + self.shift.x);
        let v = self.window.y * (y / f64::from(self.size[1]) - 0.5 + self.shift.y);
        (self.eye, -z_e * self.near + y_e * v + x_e * u) // (5.10)
    }

    /// The same ray with a unit direction, as the integrators trace it.
    pub fn line(&self, x: f64, y: f64) -> Line {
        let (origin, d) = self.chapter_ray(x, y);
        Line { origin, direction: d.normalize() }
    }

    /// How that ray changes to samples `spacing` pixels to the right and above (Igehy 1999, (8)).
    pub fn spread(&self, x: f64, y: f64, spacing: f64) -> Spread {
        let (_, d) = self.chapter_ray(x, y);
        let [x_e, y_e, _] = self.axes;
        let [right, up] = [
            x_e * (self.window.x * spacing / f64::from(self.size[0])),
            y_e * (self.window.y * spacing / f64::from(self.size[1])),
        ];
        let length = d.length();
        let unit = d / length;
        let turn = |across: DVec3| (across - unit * unit.dot(across)) / length;
        Spread { origin: [DVec3::ZERO; 2], direction: [turn(right), turn(up)] }
    }

    /// Where a point appears, in pixels with y upwards; `None` for points that are not in front of the eye. The
    /// inverse of [`Camera::chapter_ray`].
    pub fn project(&self, p: DVec3) -> Option<DVec2> {
        let [x_e, y_e, z_e] = self.axes;
        let v = p - self.eye;
        let depth = -v.dot(z_e);
        if depth.is_nan() || depth <= 0.0 {
            return None;
        }
        let on_window = DVec2::new(v.dot(x_e), v.dot(y_e)) * (self.near / depth) / self.window;
        let [w, h] = self.size.map(f64::from);
        Some((on_window + 0.5 - self.shift) * DVec2::new(w, h))
    }

    /// The centre of projection.
    pub fn eye(&self) -> DVec3 {
        self.eye
    }

    /// The unit axes x̂ₑ, ŷₑ, ẑₑ of (5.3).
    pub fn axes(&self) -> [DVec3; 3] {
        self.axes
    }

    /// The picture's width and height in pixels.
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// d_f, the distance of the projection plane (5.2a).
    pub fn focal_distance(&self) -> f64 {
        self.near
    }

    /// The window's width and height on the projection plane (5.2b, c).
    pub fn window(&self) -> DVec2 {
        self.window
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn exercise_1() -> (Intrinsics, Extrinsics) {
        (
            Intrinsics { fovy: 90.0, width: 400, height: 400, near: 30.0, far: 230.0, shift: [0.0, 0.0] },
            Extrinsics { eye: DVec3::new(100.0, 40.0, 40.0), center: DVec3::ZERO, up: DVec3::Y },
        )
    }

    #[test]
    fn projecting_a_ray_gives_its_pixel_back() {
        let (mut intrinsics, extrinsics) = exercise_1();
        intrinsics.shift = [0.3, -0.2];
        let camera = Camera::new(&intrinsics, &extrinsics).unwrap();
        for (x, y) in [(0.0, 0.0), (210.0, 265.0), (399.5, 17.25)] {
            let (eye, d) = camera.chapter_ray(x, y);
            let back = camera.project(eye + d * 3.7).unwrap();
            assert!((back - DVec2::new(x, y)).length() < 1e-9, "{back}");
            assert_eq!(camera.project(eye - d), None);
        }
    }

    #[test]
    fn the_spread_is_the_difference_of_neighbouring_rays() {
        let (mut intrinsics, extrinsics) = exercise_1();
        (intrinsics.width, intrinsics.shift) = (300, [0.3, -0.2]);
        let camera = Camera::new(&intrinsics, &extrinsics).unwrap();
        for (x, y) in [(0.0, 0.0), (210.0, 265.0), (299.5, 17.25)] {
            let at = |x, y| camera.line(x, y).direction;
            let spread = camera.spread(x, y, 0.25);
            let step = 1e-5;
            let differences = [at(x + step, y) - at(x - step, y), at(x, y + step) - at(x, y - step)];
            for (found, difference) in spread.direction.into_iter().zip(differences) {
                let expected = difference * (0.25 / (2.0 * step));
                assert!((found - expected).length() < 1e-6 * expected.length(), "{found} {expected}");
            }
        }
    }

    #[test]
    fn half_a_window_of_shift_puts_the_axis_on_the_edge() {
        let (mut intrinsics, extrinsics) = exercise_1();
        intrinsics.shift = [0.5, 0.0];
        let camera = Camera::new(&intrinsics, &extrinsics).unwrap();
        let (_, d) = camera.chapter_ray(0.0, 200.0);
        assert!((d.normalize() + camera.axes()[2]).length() < 1e-12);
    }

    #[test]
    fn degenerate_cameras_say_why() {
        let (intrinsics, extrinsics) = exercise_1();
        let error = |i: Intrinsics, e: Extrinsics| Camera::new(&i, &e).unwrap_err();
        assert_eq!(error(intrinsics, Extrinsics { center: extrinsics.eye, ..extrinsics }), CameraError::NoDirection);
        assert_eq!(error(intrinsics, Extrinsics { up: extrinsics.eye * 3.0, ..extrinsics }), CameraError::NoUp);
        assert_eq!(error(intrinsics, Extrinsics { up: DVec3::ZERO, ..extrinsics }), CameraError::NoUp);
        assert_eq!(error(Intrinsics { fovy: 180.0, ..intrinsics }, extrinsics), CameraError::Fovy(180.0));
        assert_eq!(error(Intrinsics { width: 0, ..intrinsics }, extrinsics), CameraError::Size(0, 400));
        assert_eq!(error(Intrinsics { near: 230.0, ..intrinsics }, extrinsics), CameraError::Planes(230.0, 230.0));
        let nan = Extrinsics { eye: DVec3::NAN, ..extrinsics };
        assert_eq!(error(intrinsics, nan), CameraError::NotFinite("eye"));
    }
}
