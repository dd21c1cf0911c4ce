//! The light at a point of space, as a light meter reads it.

use glam::DVec3;
use std::f64::consts::PI;

/// The light that arrives at a point with a direction.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Measurement {
    /// The irradiance in red, green and blue: the power per unit of area. It is π times the radiance of a white surface
    /// there.
    pub irradiance: DVec3,
    /// The standard error of each.
    pub standard_error: DVec3,
}

impl Measurement {
    /// The mean of independent estimates of the radiance of a white surface, with the error that their spread tells.
    pub(crate) fn of_sets(means: impl ExactSizeIterator<Item = DVec3>) -> Measurement {
        let sets = means.len() as f64;
        let (mut sum, mut squares) = (DVec3::ZERO, DVec3::ZERO);
        for mean in means {
            sum += mean;
            squares += mean * mean;
        }
        let mean = sum / sets;
        let variance = ((squares / sets - mean * mean) * (sets / (sets - 1.0))).max(DVec3::ZERO) / sets;
        let root = DVec3::new(variance.x.sqrt(), variance.y.sqrt(), variance.z.sqrt());
        Measurement { irradiance: mean * PI, standard_error: root * PI }
    }

    /// The luminance of the irradiance, by the weights of Rec. 709: the illuminance, if the lights are in photometric
    /// units.
    pub fn illuminance(&self) -> f64 {
        LUMINANCE.dot(self.irradiance)
    }

    /// A bound of the standard error of the illuminance: the sum of the colours' errors, which go together.
    pub fn illuminance_error(&self) -> f64 {
        LUMINANCE.dot(self.standard_error)
    }
}

const LUMINANCE: DVec3 = DVec3::new(0.2126, 0.7152, 0.0722);
