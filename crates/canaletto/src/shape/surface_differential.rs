//! Surface differentials: first derivatives of texture coordinates and normal at a hit.
//!
//! The change of the texture coordinates is kept as two gradients, not as ∂P/∂u and ∂P/∂v. Footprints and bump mapping
//! need gradients (Mikkelsen, *Surface Gradient-Based Bump Mapping Framework*, JCGT 2020). Where they degenerate, at
//! poles, they grow without bound, while tangents vanish and lead to a division by zero.

use super::Surface;
use crate::math::Transform;
use glam::{DMat3, DVec2, DVec3};

/// The neighbourhood of a surface point, to first order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceDifferential {
    /// ∇u and ∇v. Their products with a step along the surface are the changes of u and v. A component along the normal
    /// is possible and has no effect.
    pub gradients: [DVec3; 2],
    /// The map from a step along the surface to the change of the unit shading normal.
    pub shape_operator: DMat3,
    /// Whether u is periodic with period 1.
    pub round: bool,
}

/// The smallest distance from an axis that differs from zero, as a part of the shape's size.
const AT_AXIS: f64 = 1e-9;

impl SurfaceDifferential {
    /// The differential of a flat surface.
    pub(super) fn flat(u: DVec3, v: DVec3) -> SurfaceDifferential {
        SurfaceDifferential { gradients: [u, v], shape_operator: DMat3::ZERO, round: false }
    }

    /// The change of (u, v) after a step along the surface.
    pub fn uv(&self, step: DVec3) -> DVec2 {
        DVec2::new(self.gradients[0].dot(step), self.gradients[1].dot(step))
    }

    /// ∂P/∂u and ∂P/∂v on a surface with this normal; zero where u and v don't span it.
    pub fn tangents(&self, normal: DVec3) -> [DVec3; 2] {
        let [u, v] = self.gradients.map(|g| g.reject_from_normalized(normal));
        let area = u.cross(v).dot(normal);
        if area == 0.0 || !area.is_finite() {
            return [DVec3::ZERO; 2];
        }
        [v.cross(normal) / area, normal.cross(u) / area]
    }

    /// The surface differential in the space around an instance; `local` is the surface in the instance's own space.
    pub fn transformed(&self, to_world: &Transform, local: &Surface) -> SurfaceDifferential {
        let back = to_world.inverse().matrix().matrix3;
        let normal = to_world.normal(local.shading_normal);
        let length = normal.length();
        let normal = normal / length;
        // d(N/|N|) = (I − n nᵀ) dN / |N|, with dN = M⁻ᵀ W M⁻¹ dP.
        let turned = back.transpose() * self.shape_operator * back * (1.0 / length);
        SurfaceDifferential {
            gradients: self.gradients.map(|g| to_world.normal(g)),
            shape_operator: turned - outer(normal, turned.transpose() * normal),
            round: self.round,
        }
    }
}

/// The outer product a bᵀ.
pub(super) fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

/// ∇u of (5.45a), u = ½ (1 + φ/π), for a point at `radius` from the axis in the direction `out`. φ grows from `z`
/// towards `x`. `size` is the shape's.
pub(super) fn turn_gradient(out: DVec3, x: DVec3, z: DVec3, radius: f64, size: f64) -> DVec3 {
    around(out, x, z) / (std::f64::consts::TAU * radius.max(size * AT_AXIS))
}

/// The unit direction of growing φ.
pub(super) fn around(out: DVec3, x: DVec3, z: DVec3) -> DVec3 {
    x * out.dot(z) - z * out.dot(x)
}

#[cfg(test)]
mod tests;
