//! The thin lens (5.6). Rays leave from points of an aperture and converge in the plane of focus, so that only points
//! of this plane are sharp.
//!
//! A point at depth z appears as an image of the aperture, magnified. On the plane of focus at depth f it covers a
//! circle of radius r |f − z| / z, the circle of confusion for an aperture of radius r.

use super::CameraError;
use crate::math::warp;
use crate::scene::{Aperture, Extrinsics, Focus, Lens};
use glam::{DVec2, DVec3};

/// A lens ready to be sampled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PreparedLens {
    radius: f64,
    /// The number of corners of the aperture; 0 if it is round.
    blades: u32,
    /// The cosine and sine of the angle of the first corner.
    rotation: [f64; 2],
}

impl PreparedLens {
    /// The lens of a camera with this focal length; an orthographic camera has none.
    pub(super) fn new(lens: &Lens, focal_length: Option<f64>) -> Result<PreparedLens, CameraError> {
        let wrong = |what: String| Err(CameraError::Lens(what));
        let radius = match lens.aperture {
            Aperture::Radius(radius) if !(radius > 0.0 && radius.is_finite()) => {
                return wrong(format!("radius is {radius}; the aperture's must be more than 0"));
            }
            Aperture::Radius(radius) => radius,
            Aperture::Number(number) if !(number > 0.0 && number.is_finite()) => {
                return wrong(format!("f-number is {number}; it must be more than 0"));
            }
            Aperture::Number(number) => match focal_length {
                Some(focal_length) => focal_length / (2.0 * number),
                None => return wrong("an orthographic camera has no f-number; give the aperture's radius".into()),
            },
        };
        if !(lens.blades == 0 || (3..=Lens::MAX_BLADES).contains(&lens.blades)) {
            let most = Lens::MAX_BLADES;
            return wrong(format!(
                "blades is {}; it must be 0 (a round aperture) or between 3 and {most}",
                lens.blades
            ));
        }
        if !lens.rotation.is_finite() {
            return wrong("rotation isn't finite".into());
        }
        let (sin, cos) = libm::sincos(lens.rotation.to_radians());
        Ok(PreparedLens { radius, blades: lens.blades, rotation: [cos, sin] })
    }

    /// The depth of the plane of focus for a camera at this place.
    pub(super) fn depth(lens: &Lens, place: &Extrinsics, backwards: DVec3) -> Result<f64, CameraError> {
        match lens.focus {
            Focus::Distance(depth) if depth > 0.0 && depth.is_finite() => Ok(depth),
            Focus::Distance(depth) => {
                Err(CameraError::Lens(format!("focus is {depth}; the distance of what is sharp must be more than 0")))
            }
            Focus::Center => Ok((place.center - place.eye).length()),
            Focus::Point(p) => {
                let depth = -(p - place.eye).dot(backwards);
                if depth > 0.0 && depth.is_finite() {
                    return Ok(depth);
                }
                Err(CameraError::Lens(format!(
                    "focus is the point {} {} {}, which isn't in front of the eye",
                    p.x, p.y, p.z
                )))
            }
        }
    }

    /// The point of the lens at `u` of the unit square, relative to its centre: to the right and upwards.
    pub(super) fn point(&self, u: [f64; 2]) -> DVec2 {
        let p = if self.blades == 0 { warp::disk(u) } else { warp::polygon(u, self.blades) };
        let [cos, sin] = self.rotation;
        DVec2::new(p.x * cos - p.y * sin, p.x * sin + p.y * cos) * self.radius
    }
}
