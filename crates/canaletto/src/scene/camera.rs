//! Camera parameters (5.2). Intrinsics and extrinsics are separate, so that one camera serves several scenes.

use glam::DVec3;
use serde::{Deserialize, Serialize};

/// A named camera.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct View {
    /// The name by which a view is chosen.
    pub name: String,
    /// The parameters that stay constant when the camera moves.
    pub intrinsics: Intrinsics,
    /// The position and orientation of the camera.
    pub extrinsics: Extrinsics,
    /// The positions while the shutter is open: none for a camera at rest, else at least two, which replace
    /// `extrinsics`. They are evenly spaced in time from the opening to the closing. The eye moves on straight lines
    /// between them, and the axes turn.
    #[serde(default)]
    pub motion: Vec<Extrinsics>,
}

/// The parameters of `gluPerspective` and the picture's size. They stay constant when the camera moves.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Intrinsics {
    /// The whole vertical angle of view in degrees, in (0, 180). An orthographic camera has no angle and ignores it.
    pub fovy: f64,
    /// How rays leave the camera.
    #[serde(default)]
    pub projection: CameraProjection,
    /// The picture's width in pixels, at least 1.
    pub width: u32,
    /// The picture's height in pixels, at least 1.
    pub height: u32,
    /// d_f > 0, the distance of the projection plane (5.2a); none for [`Intrinsics::DEFAULT_NEAR`]. Rays start at the
    /// eye, or on the plane through it, not at this plane. A z-buffer draws nothing in front of a given one. Without
    /// it, it draws all that is in front of the eye.
    #[serde(default)]
    pub near: Option<f64>,
    /// The distance of the far plane, beyond which a z-buffer draws nothing; none for no such plane.
    #[serde(default)]
    pub far: Option<f64>,
    /// The shift of the window off the optical axis, as fractions of its width and height. (0.5, 0) puts the optical
    /// axis on the window's left edge (exercise 3).
    pub shift: [f64; 2],
    /// The lens for depth of field; none for a pinhole.
    #[serde(default)]
    pub lens: Option<Lens>,
    /// The times at which the shutter opens and closes, in frames relative to the frame's own time. Both are at most
    /// [`Intrinsics::MAX_SHUTTER`] away, and the second isn't less than the first. The poses of [`View::motion`] and
    /// [`super::Node::motion`] are those of this interval. A ray's time is the fraction of it that has passed, 0 to 1.
    #[serde(default)]
    pub shutter: [f64; 2],
}

impl Intrinsics {
    /// The largest number of frames between a frame's time and the opening or closing of its shutter.
    pub const MAX_SHUTTER: f64 = 1000.0;

    /// The distance of the projection plane if none is given.
    pub const DEFAULT_NEAR: f64 = 1.0;
}

/// How the rays of a camera leave it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum CameraProjection {
    /// All rays start at the eye. [`Intrinsics::fovy`] gives the window.
    #[default]
    Perspective,
    /// All rays are parallel to the optical axis and start on the plane through the eye. Sizes in the picture don't
    /// depend on the distance.
    Orthographic {
        /// The whole height of the window in the scene's unit, > 0: twice glTF's `ymag`.
        height: f64,
    },
}

/// A thin lens.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Lens {
    /// The size of the opening.
    pub aperture: Aperture,
    /// The plane that is sharp.
    pub focus: Focus,
    /// The number of corners of the opening: 0 for a round one, else 3..=[`Lens::MAX_BLADES`].
    pub blades: u32,
    /// The angle of the first corner in degrees, counter-clockwise from the right.
    pub rotation: f64,
}

impl Lens {
    /// The largest number of corners.
    pub const MAX_BLADES: u32 = 64;
}

/// The size of a lens's opening.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Aperture {
    /// The radius in the scene's unit, > 0. With corners it is their distance from the centre.
    Radius(f64),
    /// The f-number N > 0: the opening is d_f / N wide. The projection plane at d_f = `near` is thus taken for the
    /// film, and its distance for the focal length. An orthographic camera has no focal length, and takes a radius.
    Number(f64),
}

/// The plane that a lens shows sharp. It is parallel to the film.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Focus {
    /// The distance of the plane from the eye along the optical axis, > 0.
    Distance(f64),
    /// A point of the plane, in front of the eye.
    Point(DVec3),
    /// The plane through [`Extrinsics::center`].
    Center,
}

impl Default for Intrinsics {
    fn default() -> Intrinsics {
        Intrinsics {
            fovy: 60.0,
            projection: CameraProjection::Perspective,
            width: 640,
            height: 480,
            near: None,
            far: None,
            shift: [0.0, 0.0],
            lens: None,
            shutter: [0.0, 0.0],
        }
    }
}

/// The parameters of `gluLookAt`: the position and orientation of the camera.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Extrinsics {
    /// The centre of projection. For an orthographic camera it is the point of the optical axis where rays start.
    pub eye: DVec3,
    /// A point on the optical axis.
    pub center: DVec3,
    /// Any vector in the plane of the optical axis and the picture's vertical.
    pub up: DVec3,
}

impl Default for Extrinsics {
    fn default() -> Extrinsics {
        Extrinsics { eye: DVec3::new(0.0, 0.0, 1.0), center: DVec3::ZERO, up: DVec3::Y }
    }
}
