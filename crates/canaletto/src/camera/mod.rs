//! The camera (5.2): rays from pixels, and pixels from points. It is a pinhole, unless it has a lens. It is at rest,
//! unless it moves while its shutter is open.
//!
//! The rays of an orthographic camera are parallel. They start on the plane through the eye, each at its own point.
//!
//! It computes in `f64`: it makes one ray per sample, and the first rounding to `f32` should be that of the ray's
//! direction.

mod lens;
mod roll;

pub use roll::{continue_roll, flips_roll, has_roll};

use crate::math::{AnimatedTransform, DRay, RayDifferential, Transform};
use crate::scene::{CameraProjection, Extrinsics, Intrinsics, View};
use canaletto_bvh::{InstructionSet, Kernel};
use glam::{DAffine3, DMat3, DVec2, DVec3};
use lens::PreparedLens;

/// A camera ready to make rays (box 5.2).
///
/// ```
/// use canaletto::camera::Camera;
/// use canaletto::glam::{DVec2, DVec3};
/// use canaletto::scene::{Extrinsics, Intrinsics};
///
/// let intrinsics = Intrinsics { fovy: 45.0, width: 320, height: 180, ..Intrinsics::default() };
/// let extrinsics = Extrinsics { eye: DVec3::Z * 5.0, center: DVec3::ZERO, ..Extrinsics::default() };
/// let camera = Camera::new(&intrinsics, &extrinsics)?;
/// // What it looks at lies in the middle of the picture.
/// assert_eq!(camera.project(DVec3::ZERO), Some(DVec2::new(160.0, 90.0)));
/// # Ok::<(), canaletto::camera::CameraError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    eye: DVec3,
    /// The origin of the coordinates of the eye.
    zero: DVec3,
    /// The unit axes x̂ₑ (right), ŷₑ (up), ẑₑ (backwards).
    axes: [DVec3; 3],
    /// The distance d_f of the projection plane.
    near: f64,
    /// The distances of the near and far planes, as far as they are given.
    near_plane: Option<f64>,
    far_plane: Option<f64>,
    /// The window's width ("base") and height on the projection plane.
    window: DVec2,
    /// Whether all rays are parallel to the optical axis.
    orthographic: bool,
    shift: DVec2,
    size: [u32; 2],
    /// The lens and the depth of its plane of focus.
    lens: Option<(PreparedLens, f64)>,
    /// The motion while the shutter is open.
    motion: Option<Motion>,
}

/// The motion of a camera.
#[derive(Clone, Debug, PartialEq)]
struct Motion {
    path: AnimatedTransform,
    /// The depth of focus at each pose.
    depths: Vec<f64>,
}

/// A ray from the eye with its sample on the lens and its differential.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EyeRay {
    /// The ray, with a unit direction.
    pub line: DRay,
    /// The ray's point on the lens, to the right and upwards from the start of the pinhole's ray; `None` without a
    /// lens.
    pub lens: Option<DVec2>,
    /// The ray's differences to the neighbouring samples, if they were requested.
    pub differential: Option<RayDifferential>,
}

/// The reason why parameters make no camera.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CameraError {
    /// The eye equals the centre, so that there is no optical axis.
    #[error("eye and center are the same point; the camera has no direction to look in")]
    NoDirection,
    /// `up` is parallel to the optical axis, so that the roll is undefined.
    #[error("up is parallel to the direction from eye to center (or zero); the picture has no upward side")]
    NoUp,
    /// The angle of view is out of range.
    #[error("fovy is {0}; the angle of view must be more than 0 and less than 180 degrees")]
    Fovy(f64),
    /// The window of an orthographic camera has no height.
    #[error("orthographic is {0}; the window's height must be more than 0")]
    Orthographic(f64),
    /// The picture has no pixels, or more than the largest number.
    #[error("size is {0} x {1}; each side must be between 1 and {max} pixels", max = Camera::MAX_SIDE)]
    Size(u32, u32),
    /// The planes do not bound a view.
    #[error("{}; they must satisfy 0 < near < far", planes_text(*.0, *.1))]
    Planes(Option<f64>, Option<f64>),
    /// A parameter is NaN or infinite.
    #[error("{0} holds a number that isn't finite")]
    NotFinite(&'static str),
    /// The shutter closes before it opens, or is open for too long.
    #[error("shutter is {0} {1}; it opens before it closes, at most {max} frames from the frame's time", max = Intrinsics::MAX_SHUTTER)]
    Shutter(f64, f64),
    /// The lens makes no picture; the text names the reason.
    #[error("lens: {0}")]
    Lens(String),
    /// The motion is impossible; the text names the reason.
    #[error("motion: {0}")]
    Motion(String),
}

impl CameraError {
    /// The field at fault by its name in scene text, as in [`crate::OutOfRange::field`].
    pub fn field(&self) -> &'static str {
        match self {
            CameraError::NoDirection => "eye",
            CameraError::NoUp => "up",
            CameraError::Fovy(_) => "fovy",
            CameraError::Orthographic(_) => "orthographic",
            CameraError::Size(..) => "size",
            CameraError::Planes(None, _) => "far",
            CameraError::Planes(..) => "near",
            CameraError::NotFinite(field) => field,
            CameraError::Shutter(..) => "shutter",
            CameraError::Lens(_) => "lens",
            CameraError::Motion(_) => "motion",
        }
    }
}

/// The given planes in words.
fn planes_text(near: Option<f64>, far: Option<f64>) -> String {
    let named = [("near", near), ("far", far)].map(|(name, plane)| plane.map(|plane| format!("{name} is {plane}")));
    named.into_iter().flatten().collect::<Vec<_>>().join(" and ")
}

impl Camera {
    /// The longest side of a picture.
    pub const MAX_SIDE: u32 = 65_536;

    /// The camera of these parameters.
    ///
    /// # Errors
    /// A [`CameraError`] that names the parameters that make no picture.
    pub fn new(intrinsics: &Intrinsics, extrinsics: &Extrinsics) -> Result<Camera, CameraError> {
        let Intrinsics { width, height, near: near_plane, far: far_plane, shift, lens, shutter, .. } = *intrinsics;
        let near = near_plane.unwrap_or(Intrinsics::DEFAULT_NEAR);
        let extrinsics = *extrinsics;
        let Extrinsics { eye, center, up } = extrinsics;
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
        let window = window_of(intrinsics, near)?;
        if !(1..=Camera::MAX_SIDE).contains(&width) || !(1..=Camera::MAX_SIDE).contains(&height) {
            return Err(CameraError::Size(width, height));
        }
        let least_far = near_plane.unwrap_or(0.0);
        if !(near > 0.0 && near.is_finite()) || far_plane.is_some_and(|far| !(far > least_far && far.is_finite())) {
            return Err(CameraError::Planes(near_plane, far_plane));
        }
        let most = Intrinsics::MAX_SHUTTER;
        if !(shutter[0] <= shutter[1] && shutter.iter().all(|t| t.abs() <= most)) {
            return Err(CameraError::Shutter(shutter[0], shutter[1]));
        }
        let axes = axes(extrinsics)?;
        let orthographic = intrinsics.projection != CameraProjection::Perspective;
        let lens = match &lens {
            Some(lens) => {
                let optics = PreparedLens::new(lens, (!orthographic).then_some(near))?;
                Some((optics, PreparedLens::depth(lens, &extrinsics, axes[2])?))
            }
            None => None,
        };
        Ok(Camera {
            eye,
            zero: DVec3::ZERO,
            axes,
            near,
            near_plane,
            far_plane,
            window,
            orthographic,
            shift: DVec2::from(shift),
            size: [width, height],
            lens,
            motion: None,
        })
    }

    /// The camera of a view, which may move while the shutter is open.
    ///
    /// # Errors
    /// A [`CameraError`] that names the parameters that make no picture.
    pub fn of(view: &View) -> Result<Camera, CameraError> {
        let View { intrinsics, extrinsics, motion, .. } = view;
        let Some(first) = motion.first() else { return Camera::new(intrinsics, extrinsics) };
        let (mut poses, mut depths) = (Vec::new(), Vec::new());
        for place in motion {
            let camera = Camera::new(intrinsics, place).map_err(|e| match e {
                CameraError::Lens(_) | CameraError::Motion(_) => e,
                other => CameraError::Motion(other.to_string()),
            })?;
            let forward = DAffine3 {
                matrix3: DMat3::from_cols_array_2d(&camera.axes.map(|a| a.to_array())),
                translation: camera.eye,
            };
            poses.push(Transform::new(forward).map_err(|e| CameraError::Motion(e.to_string()))?);
            depths.push(camera.lens.map_or(0.0, |(_, depth)| depth));
        }
        let path = AnimatedTransform::new(&poses).map_err(|e| CameraError::Motion(e.to_string()))?;
        Ok(Camera { motion: Some(Motion { path, depths }), ..Camera::new(intrinsics, first)? })
    }

    /// The camera in coordinates relative to a point; see [`crate::world::World::origin`].
    pub(crate) fn relative_to(&self, origin: DVec3) -> Camera {
        Camera { eye: self.eye - origin, zero: self.zero + origin, ..self.clone() }
    }

    /// The camera with another number of pixels in the same window.
    pub(crate) fn resized(&self, size: [u32; 2]) -> Camera {
        Camera { size, ..self.clone() }
    }

    /// Whether the camera is a pinhole at rest, so that all rays are [`Camera::line`]s.
    #[inline]
    pub fn is_plain(&self) -> bool {
        self.lens.is_none() && self.motion.is_none()
    }

    /// Whether all rays are parallel to the optical axis and start on the plane through the eye.
    #[inline]
    pub fn is_orthographic(&self) -> bool {
        self.orthographic
    }

    /// Whether the camera moves while the shutter is open.
    #[inline]
    pub fn moves(&self) -> bool {
        self.motion.is_some()
    }

    /// The camera at rest at a time in 0..=1, from the shutter's opening to its closing.
    pub fn at(&self, time: f64) -> Camera {
        let Some(Motion { path, depths }) = &self.motion else { return self.clone() };
        let pose = path.at(time);
        let (m, eye) = (pose.matrix().matrix3, pose.matrix().translation);
        let x = time.clamp(0.0, 1.0) * (depths.len() - 1) as f64;
        let index = (x as usize).min(depths.len() - 2);
        let f = x - index as f64;
        let depth = depths[index] * (1.0 - f) + depths[index + 1] * f;
        Camera {
            eye: eye - self.zero,
            axes: [m.x_axis, m.y_axis, m.z_axis],
            lens: self.lens.map(|(optics, _)| (optics, depth)),
            motion: None,
            ..*self
        }
    }

    /// The ray for (x, y) that leaves the lens at `lens` of the unit square, at a time in 0..=1. Every point of the
    /// lens sees one point of the plane of focus. With a `spacing` the ray has a differential to samples that many
    /// pixels away, through an unchanged point of the lens.
    pub fn ray(&self, x: f64, y: f64, lens: [f64; 2], time: f64, spacing: Option<f64>) -> EyeRay {
        if self.moves() {
            return self.at(time).ray(x, y, lens, 0.0, spacing);
        }
        let Some((optics, depth)) = &self.lens else {
            let differential = spacing.map(|spacing| self.differential(x, y, spacing));
            return EyeRay { line: self.line(x, y), lens: None, differential };
        };
        let point = optics.point(lens);
        let (start, d) = self.chapter_ray(x, y);
        let offset = self.axes[0] * point.x + self.axes[1] * point.y;
        // The vector d ends on the projection plane at depth d_f.
        let scale = depth / self.near;
        let d = d * scale - offset;
        let widening = if self.orthographic { 1.0 } else { scale };
        let differential = spacing.map(|spacing| self.differential_of(d, spacing * widening));
        EyeRay { line: DRay { origin: start + offset, direction: d.normalize() }, lens: Some(point), differential }
    }

    /// The chapter's ray for (x, y) in pixels, y upwards: eye and d of (5.10). The length of d reaches the projection
    /// plane. An orthographic camera's ray reaches this plane along the axis, from its own point of the plane through
    /// the eye. (0, 0) is the lower left corner of the picture, (w, h) the upper right one.
    #[inline]
    pub fn chapter_ray(&self, x: f64, y: f64) -> (DVec3, DVec3) {
        let [x_e, y_e, z_e] = self.axes;
        let u = self.window.x * (x / f64::from(self.size[0]) - 0.5 + self.shift.x);
        let v = self.window.y * (y / f64::from(self.size[1]) - 0.5 + self.shift.y);
        if self.orthographic {
            return (self.eye + y_e * v + x_e * u, -z_e * self.near);
        }
        (self.eye, -z_e * self.near + y_e * v + x_e * u) // (5.10)
    }

    /// The chapter's ray with a unit direction, as the integrators trace it.
    #[inline]
    pub fn line(&self, x: f64, y: f64) -> DRay {
        let (origin, d) = self.chapter_ray(x, y);
        DRay { origin, direction: d.normalize() }
    }

    /// Computes [`Camera::line`] for many places at once. There must be as many lines as places.
    pub(crate) fn lines(&self, places: &[[f64; 2]], lines: &mut [DRay]) {
        if self.orthographic {
            for ([x, y], line) in places.iter().zip(lines) {
                *line = self.line(*x, *y);
            }
            return;
        }
        InstructionSet::run(Lines { camera: self, places, lines });
    }

    /// The differential of [`Camera::line`] to samples `spacing` pixels to the right and above (Igehy 1999, (8)).
    pub fn differential(&self, x: f64, y: f64, spacing: f64) -> RayDifferential {
        let (_, d) = self.chapter_ray(x, y);
        self.differential_of(d, spacing)
    }

    /// The differential of a ray along `d`, which ends on the projection plane scaled by `scale`. Of an orthographic
    /// camera, only the starts of the rays differ, by `scale` pixels.
    fn differential_of(&self, d: DVec3, scale: f64) -> RayDifferential {
        let [x_e, y_e, _] = self.axes;
        let [right, up] = [
            x_e * (self.window.x * scale / f64::from(self.size[0])),
            y_e * (self.window.y * scale / f64::from(self.size[1])),
        ];
        if self.orthographic {
            return RayDifferential { origin: [right, up], direction: [DVec3::ZERO; 2] };
        }
        let length = d.length();
        let unit = d / length;
        let turn = |across: DVec3| (across - unit * unit.dot(across)) / length;
        RayDifferential { origin: [DVec3::ZERO; 2], direction: [turn(right), turn(up)] }
    }

    /// The position of a point in the picture, in pixels with y upwards; `None` for points that are not in front of the
    /// eye. It is the inverse of [`Camera::chapter_ray`].
    pub fn project(&self, p: DVec3) -> Option<DVec2> {
        let [x_e, y_e, z_e] = self.axes;
        let v = p - self.eye;
        let depth = -v.dot(z_e);
        if depth.is_nan() || depth <= 0.0 {
            return None;
        }
        let scale = if self.orthographic { 1.0 } else { self.near / depth };
        let on_window = DVec2::new(v.dot(x_e), v.dot(y_e)) * scale / self.window;
        let [w, h] = self.size.map(f64::from);
        Some((on_window + 0.5 - self.shift) * DVec2::new(w, h))
    }

    /// The line with a unit direction on which a point is seen, and the point's distance on it from the line's start.
    pub(crate) fn line_to(&self, point: DVec3) -> (DRay, f64) {
        if self.orthographic {
            let (forward, depth) = (-self.axes[2], self.distance(point));
            return (DRay { origin: point - forward * depth, direction: forward }, depth);
        }
        let distance = self.distance(point);
        (DRay { origin: self.eye, direction: (point - self.eye) / distance }, distance)
    }

    /// The distance of a point from the eye, or from the plane through it if the camera is orthographic.
    pub fn distance(&self, point: DVec3) -> f64 {
        let v = point - self.eye;
        if self.orthographic { -v.dot(self.axes[2]) } else { v.length() }
    }

    /// The centre of projection. For an orthographic camera it is the point of the optical axis where rays start.
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

    /// The distance d_f of the projection plane (5.2a).
    pub fn focal_distance(&self) -> f64 {
        self.near
    }

    /// The distance of the near plane, in front of which a z-buffer draws nothing; none if it isn't given.
    pub fn near_plane(&self) -> Option<f64> {
        self.near_plane
    }

    /// The distance of the far plane, beyond which a z-buffer draws nothing; none if it isn't given.
    pub fn far_plane(&self) -> Option<f64> {
        self.far_plane
    }

    /// Whether a z-buffer's planes leave a place at this distance along the optical axis.
    pub fn is_between_planes(&self, depth: f64) -> bool {
        self.near_plane.is_none_or(|near| depth >= near) && self.far_plane.is_none_or(|far| depth <= far)
    }

    /// The offset of the window's centre in parts of its width and height.
    pub fn shift(&self) -> DVec2 {
        self.shift
    }

    /// The window's width and height on the projection plane (5.2b, c). Those of an orthographic camera are the same on
    /// all planes.
    pub fn window(&self) -> DVec2 {
        self.window
    }
}

/// The window's width and height on the projection plane at d_f = `near`.
fn window_of(intrinsics: &Intrinsics, near: f64) -> Result<DVec2, CameraError> {
    let Intrinsics { fovy, projection, width, height, .. } = *intrinsics;
    let window_height = match projection {
        CameraProjection::Perspective if fovy > 0.0 && fovy < 180.0 => {
            2.0 * near * libm::tan(fovy.to_radians() / 2.0) // (5.2b)
        }
        CameraProjection::Perspective => return Err(CameraError::Fovy(fovy)),
        CameraProjection::Orthographic { height } if height > 0.0 && height.is_finite() => height,
        CameraProjection::Orthographic { height } => return Err(CameraError::Orthographic(height)),
    };
    let window_width = f64::from(width) / f64::from(height) * window_height; // (5.2c)
    Ok(DVec2::new(window_width, window_height))
}

/// [`Camera::line`] of a perspective camera for many places, eight side by side.
struct Lines<'a> {
    camera: &'a Camera,
    places: &'a [[f64; 2]],
    lines: &'a mut [DRay],
}

impl Kernel for Lines<'_> {
    type Answer = ();

    #[inline(always)]
    fn run(self) {
        const LANES: usize = 8;
        let camera = self.camera;
        let ([w, h], [x_e, y_e, z_e]) = (camera.size.map(f64::from), camera.axes);
        let forward = -z_e * camera.near;
        for (places, lines) in self.places.chunks(LANES).zip(self.lines.chunks_mut(LANES)) {
            let (mut x, mut y) = ([0.0; LANES], [0.0; LANES]);
            for (i, place) in places.iter().enumerate() {
                [x[i], y[i]] = *place;
            }
            let mut directions = [[0.0; LANES]; 3];
            for i in 0..LANES {
                let u = camera.window.x * (x[i] / w - 0.5 + camera.shift.x);
                let v = camera.window.y * (y[i] / h - 0.5 + camera.shift.y);
                let along = |f: f64, y: f64, x: f64| f + y * v + x * u;
                let d =
                    [along(forward.x, y_e.x, x_e.x), along(forward.y, y_e.y, x_e.y), along(forward.z, y_e.z, x_e.z)];
                let reciprocal = 1.0 / (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
                for axis in 0..3 {
                    directions[axis][i] = d[axis] * reciprocal;
                }
            }
            let [x, y, z] = directions;
            for (i, line) in lines.iter_mut().enumerate() {
                *line = DRay { origin: camera.eye, direction: DVec3::new(x[i], y[i], z[i]) };
            }
        }
    }
}

/// The unit axes x̂ₑ, ŷₑ, ẑₑ.
fn axes(Extrinsics { eye, center, up }: Extrinsics) -> Result<[DVec3; 3], CameraError> {
    let z = (eye - center).try_normalize().ok_or(CameraError::NoDirection)?; // (5.3a)
    let sideways = up.try_normalize().ok_or(CameraError::NoUp)?.cross(z);
    // The cross product of unit vectors is the sine of their angle: below this it holds no digits of `up`.
    if sideways.length() < 1e-9 {
        return Err(CameraError::NoUp);
    }
    let x = sideways.normalize(); // (5.3b)
    Ok([x, z.cross(x), z]) // (5.3c)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Aperture, Focus, Lens};

    fn exercise_1() -> (Intrinsics, Extrinsics) {
        (
            Intrinsics {
                fovy: 90.0,
                width: 400,
                height: 400,
                near: Some(30.0),
                far: Some(230.0),
                ..Intrinsics::default()
            },
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
    fn many_lines_have_the_bits_of_each() {
        let (mut intrinsics, extrinsics) = exercise_1();
        (intrinsics.width, intrinsics.shift) = (301, [0.3, -0.2]);
        let camera = Camera::new(&intrinsics, &extrinsics).unwrap();
        let places: Vec<[f64; 2]> = (0..1003).map(|i| [f64::from(i) * 0.31, f64::from(i * i % 401) + 0.125]).collect();
        for set in InstructionSet::available() {
            set.limit();
            let mut lines = vec![DRay { origin: DVec3::ZERO, direction: DVec3::ZERO }; places.len()];
            camera.lines(&places, &mut lines);
            for (line, [x, y]) in lines.iter().zip(&places) {
                let bits = |line: &DRay| line.direction.to_array().map(f64::to_bits);
                assert_eq!((line.origin, bits(line)), (camera.eye, bits(&camera.line(*x, *y))), "{set:?} {x} {y}");
            }
        }
    }

    #[test]
    fn the_spread_is_the_difference_of_neighbouring_rays() {
        let (mut intrinsics, extrinsics) = exercise_1();
        (intrinsics.width, intrinsics.shift) = (300, [0.3, -0.2]);
        let camera = Camera::new(&intrinsics, &extrinsics).unwrap();
        for (x, y) in [(0.0, 0.0), (210.0, 265.0), (299.5, 17.25)] {
            let at = |x, y| camera.line(x, y).direction;
            let differential = camera.differential(x, y, 0.25);
            let step = 1e-5;
            let differences = [at(x + step, y) - at(x - step, y), at(x, y + step) - at(x, y - step)];
            for (found, difference) in differential.direction.into_iter().zip(differences) {
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

    fn orthographic(height: f64) -> (Intrinsics, Extrinsics) {
        let (intrinsics, extrinsics) = exercise_1();
        let projection = CameraProjection::Orthographic { height };
        (Intrinsics { width: 300, shift: [0.3, -0.2], projection, ..intrinsics }, extrinsics)
    }

    /// Orthographic rays go through the points of a window of this height, one beside the other, and a step across the
    /// axis has one size at all distances.
    #[test]
    fn orthographic_rays_are_parallel_and_sizes_do_not_depend_on_distance() {
        let (intrinsics, extrinsics) = orthographic(80.0);
        let camera = Camera::new(&intrinsics, &extrinsics).unwrap();
        assert_eq!((camera.window(), camera.is_orthographic()), (DVec2::new(60.0, 80.0), true));
        let [right, up, back] = camera.axes();
        let places = [[0.0, 0.0], [300.0, 400.0], [210.0, 265.0], [299.5, 17.25]];
        let mut lines = [DRay { origin: DVec3::ZERO, direction: DVec3::ZERO }; 4];
        camera.lines(&places, &mut lines);
        for ([x, y], together) in places.into_iter().zip(lines) {
            let line = camera.line(x, y);
            assert_eq!(line, together);
            assert!((line.direction + back).length() < 1e-15, "{x} {y}");
            let [u, v] = [60.0 * (x / 300.0 - 0.5 + 0.3), 80.0 * (y / 400.0 - 0.5 - 0.2)];
            assert!((line.origin - (extrinsics.eye + right * u + up * v)).length() < 1e-12, "{x} {y}");
            let (_, d) = camera.chapter_ray(x, y);
            assert!((d.length() - 30.0).abs() < 1e-12);
            for depth in [0.01, 30.0, 5e4] {
                let point = line.origin + line.direction * depth;
                let pixel = camera.project(point).unwrap();
                assert!((pixel - DVec2::new(x, y)).length() < 1e-8, "{pixel}");
                let step = camera.project(point + right * 6.0 + up * 2.0).unwrap() - pixel;
                assert!((step - DVec2::new(30.0, 10.0)).length() < 1e-8, "{depth}: {step}");
                assert!((camera.distance(point) - depth).abs() < 1e-8);
                let (back_there, distance) = camera.line_to(point);
                assert!((back_there.origin - line.origin).length() < 1e-8 && (distance - depth).abs() < 1e-8);
            }
            assert_eq!(camera.project(line.origin - line.direction), None);
        }
    }

    #[test]
    fn the_spread_of_orthographic_rays_is_that_of_their_origins() {
        let (mut intrinsics, extrinsics) = orthographic(80.0);
        for lens in [None, Some(Aperture::Radius(5.0))] {
            intrinsics.lens = lens.map(|aperture| Lens { aperture, focus: Focus::Center, blades: 7, rotation: 3.0 });
            let camera = Camera::new(&intrinsics, &extrinsics).unwrap();
            let at = |x, y| camera.ray(x, y, [0.7, 0.4], 0.0, Some(0.25));
            let (differential, step) = (at(210.0, 30.0).differential.unwrap(), 1e-3);
            let lines = |x, y| [at(210.0 + x, 30.0 + y).line, at(210.0 - x, 30.0 - y).line];
            for (axis, [a, b]) in [lines(step, 0.0), lines(0.0, step)].into_iter().enumerate() {
                let scale = 0.25 / (2.0 * step);
                let expected = (a.origin - b.origin) * scale;
                assert!((differential.origin[axis] - expected).length() < 1e-9, "{lens:?} {axis}");
                assert!((expected.length() - 0.25 * 0.2).abs() < 1e-9, "a pixel is 0.2 wide");
                assert!((a.direction - b.direction).length() * scale < 1e-9);
                assert_eq!(differential.direction[axis], DVec3::ZERO);
            }
        }
    }

    /// Behind a lens an orthographic pixel's rays meet in the plane of focus, in the middle of its own line.
    #[test]
    fn an_orthographic_lens_is_sharp_at_its_focus() {
        let (mut intrinsics, extrinsics) = orthographic(80.0);
        let aperture = Aperture::Radius(4.0);
        intrinsics.lens = Some(Lens { aperture, focus: Focus::Distance(120.0), blades: 0, rotation: 0.0 });
        let camera = Camera::new(&intrinsics, &extrinsics).unwrap();
        let own = camera.line(40.0, 300.0);
        for lens in [[0.1, 0.2], [0.9, 0.5], [0.3, 0.99]] {
            let EyeRay { line, lens, .. } = camera.ray(40.0, 300.0, lens, 0.0, None);
            let off = line.origin - own.origin;
            assert!((off.length() - lens.unwrap().length()).abs() < 1e-9 && off.dot(own.direction).abs() < 1e-9);
            let met = line.origin + line.direction * (120.0 / line.direction.dot(own.direction));
            assert!((met - (own.origin + own.direction * 120.0)).length() < 1e-9);
        }
        intrinsics.lens = Some(Lens { aperture: Aperture::Number(2.0), ..intrinsics.lens.unwrap() });
        let refused = Camera::new(&intrinsics, &extrinsics).unwrap_err().to_string();
        assert!(refused.contains("an orthographic camera has no f-number"), "{refused}");
    }

    #[test]
    fn an_orthographic_camera_moves_as_a_perspective_one() {
        let (intrinsics, extrinsics) = orthographic(80.0);
        let moved = Extrinsics { eye: extrinsics.eye + DVec3::new(3.0, 5.0, -2.0), center: DVec3::Y, ..extrinsics };
        let view = View { name: "v".into(), intrinsics, extrinsics, motion: vec![extrinsics, moved] };
        let camera = Camera::of(&view).unwrap();
        for (time, place) in [(0.0, extrinsics), (1.0, moved)] {
            let there = Camera::new(&intrinsics, &place).unwrap();
            let (a, b) = (camera.ray(7.0, 9.0, [0.5; 2], time, None).line, there.line(7.0, 9.0));
            assert!((a.origin - b.origin).length() < 1e-11 && (a.direction - b.direction).length() < 1e-12, "{time}");
        }
        assert!(camera.at(0.5).is_orthographic());
    }

    #[test]
    fn degenerate_cameras_say_why() {
        let (intrinsics, extrinsics) = exercise_1();
        let error = |i: Intrinsics, e: Extrinsics| Camera::new(&i, &e).unwrap_err();
        assert_eq!(error(intrinsics, Extrinsics { center: extrinsics.eye, ..extrinsics }), CameraError::NoDirection);
        assert_eq!(error(intrinsics, Extrinsics { up: extrinsics.eye * 3.0, ..extrinsics }), CameraError::NoUp);
        assert_eq!(error(intrinsics, Extrinsics { up: DVec3::ZERO, ..extrinsics }), CameraError::NoUp);
        assert_eq!(error(Intrinsics { fovy: 180.0, ..intrinsics }, extrinsics), CameraError::Fovy(180.0));
        for height in [0.0, -1.0, f64::INFINITY] {
            let projection = CameraProjection::Orthographic { height };
            assert_eq!(
                error(Intrinsics { projection, fovy: 0.0, ..intrinsics }, extrinsics),
                CameraError::Orthographic(height)
            );
        }
        assert_eq!(error(Intrinsics { width: 0, ..intrinsics }, extrinsics), CameraError::Size(0, 400));
        assert_eq!(
            error(Intrinsics { near: Some(230.0), ..intrinsics }, extrinsics),
            CameraError::Planes(Some(230.0), Some(230.0))
        );
        let nan = Extrinsics { eye: DVec3::NAN, ..extrinsics };
        assert_eq!(error(intrinsics, nan), CameraError::NotFinite("eye"));
    }

    /// A point off the plane of focus is seen at different places through each point of the lens: the circle of
    /// confusion.
    #[test]
    fn points_are_blurred_by_the_circle_of_confusion() {
        let (mut intrinsics, extrinsics) = exercise_1();
        let (radius, focus) = (4.0, 120.0);
        let lens = Lens { aperture: Aperture::Radius(radius), focus: Focus::Distance(focus), blades: 0, rotation: 0.0 };
        intrinsics.lens = Some(lens);
        let camera = Camera::new(&intrinsics, &extrinsics).unwrap();
        let plain = Camera::new(&Intrinsics { lens: None, ..intrinsics }, &extrinsics).unwrap();
        assert!(plain.is_plain() && !camera.is_plain());
        let n = 64;
        let at = |i: u32| (f64::from(i) + 0.5) / f64::from(n);
        for depth in [40.0, 120.0, 700.0] {
            // The intersections of rays through pixel (150, 260) with the plane at this depth, in pixels relative to
            // the pinhole's.
            let z = camera.axes()[2];
            let (mut largest, mut squares) = (0f64, 0.0);
            for i in 0..n * n {
                let EyeRay { line, lens, .. } = camera.ray(150.0, 260.0, [at(i % n), at(i / n)], 0.0, None);
                assert!(lens.unwrap().length() <= radius && (line.direction.length() - 1.0).abs() < 1e-12);
                assert!(((line.origin - camera.eye()).dot(z)).abs() < 1e-9, "the lens is parallel to the film");
                let t = (depth + (line.origin - camera.eye()).dot(z)) / -line.direction.dot(z);
                let pixel = plain.project(line.origin + line.direction * t).unwrap();
                let off = (pixel - DVec2::new(150.0, 260.0)).length();
                largest = largest.max(off);
                squares += off * off / f64::from(n * n);
            }
            // r |f - z| / f at this depth; 200 pixels are as wide as the depth, since fovy is 90°.
            let circle = radius * (focus - depth).abs() / focus * 200.0 / depth;
            assert!((largest - circle).abs() <= 0.02 * circle + 1e-9, "depth {depth}: {largest}, not {circle}");
            assert!(
                (squares - circle * circle / 2.0).abs() <= 1e-3 * circle * circle + 1e-9,
                "depth {depth}: not even"
            );
        }
    }

    #[test]
    fn the_spread_through_a_lens_is_the_difference_of_neighbouring_rays() {
        let (mut intrinsics, extrinsics) = exercise_1();
        let lens = Lens { aperture: Aperture::Radius(5.0), focus: Focus::Center, blades: 7, rotation: 3.0 };
        intrinsics.lens = Some(lens);
        let camera = Camera::new(&intrinsics, &extrinsics).unwrap();
        let at = |x, y| camera.ray(x, y, [0.7, 0.4], 0.0, Some(0.25));
        let (differential, step) = (at(210.0, 30.0).differential.unwrap(), 1e-5);
        let change = |a: EyeRay, b: EyeRay| (a.line.direction - b.line.direction) * (0.25 / (2.0 * step));
        let differences = [
            change(at(210.0 + step, 30.0), at(210.0 - step, 30.0)),
            change(at(210.0, 30.0 + step), at(210.0, 30.0 - step)),
        ];
        for (found, expected) in differential.direction.into_iter().zip(differences) {
            assert!((found - expected).length() < 1e-6 * expected.length(), "{found} {expected}");
        }
    }

    #[test]
    fn apertures_and_focus_have_two_forms() {
        let (mut intrinsics, extrinsics) = exercise_1();
        let of = |lens| Camera::new(&Intrinsics { lens: Some(lens), ..intrinsics }, &extrinsics);
        // 30 / (2 · 2.5); the centre is at the distance |(100, 40, 40)| on the axis.
        let number = Lens { aperture: Aperture::Number(2.5), focus: Focus::Center, blades: 6, rotation: 15.0 };
        let distance = 13200f64.sqrt();
        let radius = Lens { aperture: Aperture::Radius(6.0), focus: Focus::Distance(distance), ..number };
        let point = Lens { focus: Focus::Point(DVec3::ZERO), ..number };
        let [a, b, c] =
            [of(number), of(radius), of(point)].map(|c| c.unwrap().ray(3.0, 4.0, [0.2, 0.9], 0.0, None).line);
        for b in [b, c] {
            assert!((a.origin - b.origin).length() < 1e-9 && (a.direction - b.direction).length() < 1e-12);
        }
        for (wrong, word) in [
            (Lens { aperture: Aperture::Radius(0.0), ..radius }, "lens: radius is 0"),
            (Lens { aperture: Aperture::Number(-1.0), ..radius }, "lens: f-number is -1"),
            (Lens { focus: Focus::Distance(0.0), ..radius }, "lens: focus is 0"),
            (Lens { focus: Focus::Point(DVec3::splat(200.0)), ..radius }, "in front of the eye"),
            (Lens { blades: 2, ..radius }, "lens: blades is 2"),
        ] {
            assert!(of(wrong).unwrap_err().to_string().contains(word), "{word}");
        }
        intrinsics.lens = Some(radius);
        assert!(Camera::new(&intrinsics, &extrinsics).is_ok());
    }

    #[test]
    fn a_moving_camera_goes_through_its_places_and_turns_between() {
        let (intrinsics, extrinsics) = exercise_1();
        let circle = |degrees: f64| {
            let (sin, cos) = libm::sincos(degrees.to_radians());
            Extrinsics { eye: DVec3::new(100.0 * sin, 0.0, 100.0 * cos), ..extrinsics }
        };
        let motion = vec![circle(0.0), circle(60.0), circle(90.0)];
        let view = View { name: "v".into(), intrinsics, extrinsics, motion };
        let camera = Camera::of(&view).unwrap();
        for (time, degrees) in [(0.0, 0.0), (0.5, 60.0), (1.0, 90.0)] {
            let (still, there) = (camera.at(time), Camera::new(&intrinsics, &circle(degrees)).unwrap());
            assert!((still.eye() - there.eye()).length() < 1e-12);
            assert!((0..3).all(|i| (still.axes()[i] - there.axes()[i]).length() < 1e-12), "{time}");
            let (a, b) = (camera.ray(7.0, 9.0, [0.5; 2], time, None).line, there.line(7.0, 9.0));
            assert!((a.direction - b.direction).length() < 1e-12);
        }
        // The eye is half the chord along, and the axes are turned half as far.
        let between = camera.at(0.25);
        assert!((between.eye() - (circle(0.0).eye + circle(60.0).eye) / 2.0).length() < 1e-12);
        assert!((between.axes()[2] - circle(30.0).eye / 100.0).length() < 1e-12);
        assert!(Camera::of(&View { motion: vec![circle(0.0)], ..view }).unwrap_err().to_string().contains("2 poses"));
    }
}
