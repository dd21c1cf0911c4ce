//! The spotlight: an omni light whose influence is limited to a cone (fig. 5.25c).

use super::LightKind;
use super::omni::is_zero;
use crate::OutOfRange;
use crate::math::Transform;
use glam::Vec3;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// A point that emits a cone of light.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Spot {
    /// The position of the light.
    pub position: Vec3,
    /// A point on the cone's axis, different from `position`.
    pub target: Vec3,
    /// The falloff towards the cone's edge.
    pub falloff: Falloff,
    /// The distance at which the light has ended, as [`super::Omni::range`].
    #[serde(default, skip_serializing_if = "is_zero")]
    pub range: f32,
}

impl From<Spot> for LightKind {
    fn from(spot: Spot) -> LightKind {
        LightKind::Spot(Box::new(spot))
    }
}

/// The falloff of a spotlight. Angles are in degrees between the axis and a ray of light, in [0, 90].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Falloff {
    /// Full light inside `inner`, none outside `outer`, and between them s² (3 − 2s) with s linear in the cosine.
    Smooth {
        /// The angle up to which the light is full.
        inner: f32,
        /// The angle from which there is no light; ≥ `inner`.
        outer: f32,
    },
    /// Full light inside `inner`, none outside `outer`, and between them s² with s linear in the cosine: the falloff of
    /// glTF's KHR_lights_punctual.
    Squared {
        /// The angle up to which the light is full.
        inner: f32,
        /// The angle from which there is no light; ≥ `inner`.
        outer: f32,
    },
    /// cosᵉ of the angle inside `outer`, and no light outside.
    Exponent {
        /// The exponent e ≥ 0.
        exponent: f32,
        /// The angle from which there is no light.
        outer: f32,
    },
}

/// A spotlight's cone with the cosines of its angles.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cone {
    axis: Vec3,
    fall: Fall,
}

#[derive(Clone, Copy, Debug)]
enum Fall {
    Smooth { full: f32, none: f32 },
    Squared { full: f32, none: f32 },
    Exponent { exponent: f32, none: f32 },
}

impl Cone {
    /// The share of light that leaves in this unit direction.
    pub(super) fn factor(&self, direction: Vec3) -> f32 {
        let cos = self.axis.dot(direction);
        match self.fall {
            Fall::Smooth { full, .. } | Fall::Squared { full, .. } if cos >= full => 1.0,
            Fall::Smooth { full, none } if cos > none => {
                let s = (cos - none) / (full - none);
                s * s * (3.0 - 2.0 * s)
            }
            Fall::Squared { full, none } if cos > none => {
                let s = (cos - none) / (full - none);
                s * s
            }
            Fall::Exponent { exponent, none } if cos >= none && cos > 0.0 => libm::powf(cos, exponent),
            _ => 0.0,
        }
    }
}

impl Spot {
    /// The angle in degrees between the axis and a ray of light from which there is no light.
    pub fn outer(&self) -> f32 {
        match self.falloff {
            Falloff::Smooth { outer, .. } | Falloff::Squared { outer, .. } | Falloff::Exponent { outer, .. } => outer,
        }
    }
}

impl Cone {
    /// The unit axis.
    pub(super) fn axis(&self) -> Vec3 {
        self.axis
    }

    /// The cosine of the angle from which there is no light.
    pub(super) fn cos_outer(&self) -> f64 {
        match self.fall {
            Fall::Smooth { none, .. } | Fall::Squared { none, .. } | Fall::Exponent { none, .. } => none.into(),
        }
    }

    /// The integral of [`Cone::factor`] over all directions.
    pub(super) fn solid_angle(&self) -> f64 {
        TAU * match self.fall {
            // The mean of s² (3 − 2s) over s from 0 to 1 is ½.
            Fall::Smooth { full, none } => 1.0 - 0.5 * (f64::from(full) + f64::from(none)),
            // The mean of s² is ⅓.
            Fall::Squared { full, none } => 1.0 - f64::from(full) + (f64::from(full) - f64::from(none)) / 3.0,
            Fall::Exponent { exponent, none } => {
                let e = f64::from(exponent) + 1.0;
                (1.0 - libm::pow(f64::from(none).max(0.0), e)) / e
            }
        }
    }
}

impl Spot {
    /// The cone with the cosines of its angles.
    pub(super) fn cone(&self) -> Cone {
        let cos = |degrees: f32| libm::cos(f64::from(degrees).to_radians()) as f32;
        let fall = match self.falloff {
            Falloff::Smooth { inner, outer } => Fall::Smooth { full: cos(inner), none: cos(outer) },
            Falloff::Squared { inner, outer } => Fall::Squared { full: cos(inner), none: cos(outer) },
            Falloff::Exponent { exponent, outer } => Fall::Exponent { exponent, none: cos(outer) },
        };
        Cone { axis: (self.target - self.position).normalize(), fall }
    }

    pub(super) fn transformed(&self, t: &Transform) -> Spot {
        let go = |p: Vec3| t.point(p.as_dvec3()).as_vec3();
        Spot { position: go(self.position), target: go(self.target), ..*self }
    }

    pub(super) fn check(&self) -> Result<(), OutOfRange> {
        if (self.target - self.position).try_normalize().is_none() || !self.position.is_finite() {
            return Err(OutOfRange::new("target", "is the light's own position; the cone needs an axis"));
        }
        let angle = |field: &'static str, v: f32| {
            if (0.0..=90.0).contains(&v) {
                Ok(())
            } else {
                Err(OutOfRange::new(field, format!("is {v}; the angle must be between 0 and 90 degrees")))
            }
        };
        match self.falloff {
            Falloff::Smooth { inner, outer } | Falloff::Squared { inner, outer } => {
                angle("inner", inner)?;
                angle("outer", outer)?;
                if inner > outer {
                    Err(OutOfRange::new("inner", format!("is {inner}, more than outer, {outer}")))
                } else {
                    Ok(())
                }
            }
            Falloff::Exponent { exponent, outer } => {
                angle("outer", outer)?;
                if exponent.is_finite() && exponent >= 0.0 {
                    Ok(())
                } else {
                    Err(OutOfRange::new("exponent", format!("is {exponent}; it must be 0 or more")))
                }
            }
        }
    }
}
