//! Parallel light, everywhere or inside a round beam (fig. 5.25b).

use crate::OutOfRange;
use crate::math::Transform;
use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

/// Light from infinity.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Directional {
    /// The direction in which the light travels; any length but zero.
    pub towards: Vec3,
    /// The beam that limits the light: a point on its axis and its radius. None for light everywhere.
    pub beam: Option<(Vec3, f32)>,
}

impl Directional {
    /// The unit direction L̂ to the light.
    pub(super) fn direction(&self) -> DVec3 {
        -self.towards.as_dvec3().normalize()
    }

    /// The factor of the beam: 1 inside, 0 outside. `direction` is [`Directional::direction`].
    pub(super) fn region(&self, p: Vec3, direction: Vec3) -> f32 {
        let Some((axis, radius)) = self.beam else { return 1.0 };
        let axis_distance2 = (p - axis).reject_from_normalized(direction).length_squared();
        if axis_distance2 <= radius * radius { 1.0 } else { 0.0 }
    }

    pub(super) fn transformed(&self, t: &Transform) -> Directional {
        let scale = libm::cbrt(t.matrix().matrix3.determinant().abs());
        Directional {
            towards: t.vector(self.towards.as_dvec3()).as_vec3(),
            beam: self.beam.map(|(p, r)| (t.point(p.as_dvec3()).as_vec3(), (f64::from(r) * scale) as f32)),
        }
    }

    pub(super) fn check(&self) -> Result<(), OutOfRange> {
        if self.towards.try_normalize().is_none() {
            let d = self.towards;
            return Err(OutOfRange::new("direction", format!("is {} {} {}; it needs a length", d.x, d.y, d.z)));
        }
        match self.beam {
            Some((p, r)) if !p.is_finite() || !r.is_finite() || r <= 0.0 => Err(OutOfRange::new(
                "radius",
                format!("is {r}; the beam's radius must be more than 0 and its axis finite"),
            )),
            _ => Ok(()),
        }
    }
}
