//! The point light that emits in all directions (fig. 5.25a).

use crate::OutOfRange;
use crate::math::Transform;
use glam::{DVec3, Vec3, Vec4};
use serde::{Deserialize, Serialize};

/// A point light, or light from infinity.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Omni {
    /// The homogeneous position (x, y, z, w). With w = 0 the light comes from infinity, from direction (x, y, z)
    /// (exercise 4); else from the point (x, y, z) / w.
    pub position: [f32; 4],
    /// The distance at which the light has ended: it is multiplied by 1 − (d / range)⁴ (KHR_lights_punctual). 0 for
    /// light without an end, as that from infinity is.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub range: f32,
}

/// Whether a light has no end.
pub(super) fn is_zero(range: &f32) -> bool {
    *range == 0.0
}

impl Omni {
    /// The light at this point.
    pub fn at(point: Vec3) -> Omni {
        Omni { position: point.extend(1.0).to_array(), range: 0.0 }
    }

    fn homogeneous(&self) -> Vec4 {
        Vec4::from_array(self.position)
    }

    pub(super) fn point(&self) -> Vec3 {
        let p = self.homogeneous();
        p.truncate() / p.w
    }

    pub(super) fn towards_infinity(&self) -> Option<DVec3> {
        let p = self.homogeneous();
        (p.w == 0.0).then(|| p.truncate().as_dvec3().normalize())
    }

    pub(super) fn transformed(&self, t: &Transform) -> Omni {
        let p = self.homogeneous();
        let v = p.truncate().as_dvec3();
        if p.w == 0.0 {
            Omni { position: t.vector(v).as_vec3().extend(0.0).to_array(), ..*self }
        } else {
            Omni { range: self.range, ..Omni::at(t.point(v / f64::from(p.w)).as_vec3()) }
        }
    }

    pub(super) fn check(&self) -> Result<(), OutOfRange> {
        let p = self.homogeneous();
        if !p.is_finite() || (p.w == 0.0 && p.truncate() == Vec3::ZERO) || (p.w != 0.0 && !self.point().is_finite()) {
            return Err(OutOfRange::new(
                "position",
                format!(
                    "is {} {} {} {}; it must be a point, or a direction with a 0 as fourth number",
                    p.x, p.y, p.z, p.w
                ),
            ));
        }
        Ok(())
    }
}
