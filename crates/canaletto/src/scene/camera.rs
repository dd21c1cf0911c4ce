//! Camera parameters, intrinsic and extrinsic apart (5.2), so that one camera serves several scenes.

use glam::DVec3;
use serde::{Deserialize, Serialize};

/// A named camera.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct View {
    /// The name to choose it by.
    pub name: String,
    /// What stays when the camera moves.
    pub intrinsics: Intrinsics,
    /// Where it stands.
    pub extrinsics: Extrinsics,
    /// Where it stands while the shutter is open: nothing if it stays, else at least two places, evenly spaced in time from
    /// the opening to the closing, which replace `extrinsics`. The eye moves on straight lines from one to the next, and the
    /// axes turn.
    #[serde(default)]
    pub motion: Vec<Extrinsics>,
}

/// The parameters of `gluPerspective` and the picture's size: what stays when the camera moves.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Intrinsics {
    /// The whole vertical angle of view in degrees, in (0, 180).
    pub fovy: f64,
    /// The picture's width in pixels, at least 1.
    pub width: u32,
    /// The picture's height in pixels, at least 1.
    pub height: u32,
    /// d_f, the distance of the projection plane (5.2a). Rays start at the eye all the same.
    pub near: f64,
    /// The far plane, which only a z-buffer needs.
    pub far: f64,
    /// How far the window is moved off the optical axis, as fractions of its width and height. (0.5, 0) puts the
    /// optical axis on the window's left edge (exercise 3).
    pub shift: [f64; 2],
    /// The lens that takes the place of the pinhole, for depth of field.
    #[serde(default)]
    pub lens: Option<Lens>,
    /// When the shutter opens and closes, in frames from the frame's own time, at most [`Intrinsics::MAX_SHUTTER`] of them
    /// away; the second number isn't less than the first. Whoever fills [`View::motion`] and [`super::Node::motion`] from
    /// an animation takes the poses of that time. Rays only know the share of it that has passed, 0 to 1.
    #[serde(default)]
    pub shutter: [f64; 2],
}

impl Intrinsics {
    /// The most frames that a shutter opens before or closes after the frame's time.
    pub const MAX_SHUTTER: f64 = 1000.0;
}

/// A thin lens.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Lens {
    /// How large its opening is.
    pub aperture: Aperture,
    /// What is sharp.
    pub focus: Focus,
    /// The corners of the opening: 0 for a round one, else 3..=[`Lens::MAX_BLADES`].
    pub blades: u32,
    /// The angle of the first corner in degrees, counter-clockwise from the right.
    pub rotation: f64,
}

impl Lens {
    /// The most corners.
    pub const MAX_BLADES: u32 = 64;
}

/// How large a lens's opening is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Aperture {
    /// Its radius (that of its corners if it has any), in the scene's unit, > 0.
    Radius(f64),
    /// The f-number N > 0: the opening is d_f / N wide. That takes the projection plane at d_f = `near` for the film, and
    /// so that distance for the focal length.
    Number(f64),
}

/// What a lens shows sharp: a plane parallel to the film.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Focus {
    /// Its distance from the eye along the optical axis, > 0.
    Distance(f64),
    /// A point of it, in front of the eye.
    Point(DVec3),
    /// It goes through [`Extrinsics::center`].
    Center,
}

impl Default for Intrinsics {
    fn default() -> Intrinsics {
        Intrinsics {
            fovy: 60.0,
            width: 640,
            height: 480,
            near: 1.0,
            far: 1000.0,
            shift: [0.0, 0.0],
            lens: None,
            shutter: [0.0, 0.0],
        }
    }
}

/// The parameters of `gluLookAt`: where the camera stands.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Extrinsics {
    /// The centre of projection.
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
