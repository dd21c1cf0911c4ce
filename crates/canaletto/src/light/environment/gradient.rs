//! Colours by height above the horizon.

use crate::OutOfRange;
use crate::math::Rgb;
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// Colours by height above the horizon; y is upwards.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Gradient {
    /// Pairs of degrees above the horizon and the colour there. The degrees increase from −90 (straight down) to 90
    /// (straight up). Colours between are linear; the first and last continue below and above.
    pub stops: Vec<(f32, Rgb)>,
}

impl Gradient {
    /// The largest number of stops.
    pub const MAX_STOPS: usize = 4096;

    pub(super) fn check(&self) -> Result<(), OutOfRange> {
        if self.stops.is_empty() || self.stops.len() > Gradient::MAX_STOPS {
            return Err(OutOfRange::new(
                "stops",
                format!("are {}; there must be 1 to {}", self.stops.len(), Gradient::MAX_STOPS),
            ));
        }
        for (height, color) in &self.stops {
            if !(-90.0..=90.0).contains(height) {
                return Err(OutOfRange::new(
                    "stops",
                    format!("has the height {height}; it must be between -90 and 90 degrees"),
                ));
            }
            if !color.is_finite() || color.to_array().iter().any(|v| *v < 0.0) {
                let Rgb { r, g, b } = color;
                return Err(OutOfRange::new(
                    "stops",
                    format!("has the colour {r} {g} {b}; each component must be 0 or more"),
                ));
            }
        }
        match self.stops.windows(2).find(|pair| pair[0].0 >= pair[1].0) {
            Some(pair) => Err(OutOfRange::new(
                "stops",
                format!("are out of order: {} degrees come after {}; heights must grow", pair[1].0, pair[0].0),
            )),
            None => Ok(()),
        }
    }

    /// The height of a unit direction above the horizon in degrees.
    pub(super) fn height(direction: DVec3) -> f64 {
        let across = libm::sqrt(direction.x * direction.x + direction.z * direction.z);
        libm::atan2(direction.y, across).to_degrees()
    }

    /// The colour at this height.
    pub(super) fn at(&self, height: f64) -> Rgb {
        let next = self.stops.partition_point(|(stop, _)| f64::from(*stop) <= height);
        match (next.checked_sub(1).map(|i| self.stops[i]), self.stops.get(next)) {
            (Some((low, below)), Some((high, above))) => {
                let t = ((height - f64::from(low)) / (f64::from(*high) - f64::from(low))) as f32;
                below * (1.0 - t) + *above * t
            }
            (Some((_, color)), None) => color,
            (None, Some((_, color))) => *color,
            (None, None) => Rgb::BLACK,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_are_linear_in_the_height() {
        let stops = vec![(-10.0, Rgb::gray(1.0)), (0.0, Rgb::gray(2.0)), (90.0, Rgb::gray(5.0))];
        let gradient = Gradient { stops };
        gradient.check().unwrap();
        for (height, value) in [(-90.0, 1.0), (-10.0, 1.0), (-5.0, 1.5), (0.0, 2.0), (30.0, 3.0), (90.0, 5.0)] {
            assert!((gradient.at(height).g - value).abs() < 1e-6, "{height}");
        }
        for (d, height) in
            [(DVec3::Y, 90.0), (DVec3::NEG_Y, -90.0), (DVec3::X, 0.0), (DVec3::new(0.6, 0.8, 0.0), 53.13010)]
        {
            assert!((Gradient::height(d) - height).abs() < 1e-5);
        }
    }

    #[test]
    fn stops_must_grow() {
        let stop = |height| (height, Rgb::WHITE);
        for stops in [vec![], vec![stop(0.0), stop(0.0)], vec![stop(-91.0)], vec![(0.0, Rgb::gray(-1.0))]] {
            assert_eq!(Gradient { stops: stops.clone() }.check().unwrap_err().field, Some("stops"), "{stops:?}");
        }
    }
}
