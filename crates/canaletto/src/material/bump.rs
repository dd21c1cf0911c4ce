//! Bent normals: bump maps (Blinn, *Simulation of Wrinkled Surfaces*, 1978) and normal maps.
//!
//! Blinn's N' = N + F_u (N × P_v) / |N| − F_v (N × P_u) / |N| is, for a unit normal n, n − ∇F with the gradient of the
//! height F along the surface (Mikkelsen, *Surface Gradient-Based Bump Mapping Framework*, JCGT 2020). This form holds
//! for heights on any coordinates, also those of space, and needs no tangents.

use glam::DVec3;

/// The unit normal of a surface that is raised by a height with this gradient. The gradient's component along the
/// normal is ignored.
pub fn apply_bump(normal: DVec3, gradient: DVec3) -> DVec3 {
    (normal - gradient.reject_from_normalized(normal)).try_normalize().unwrap_or(normal)
}

/// The unit normal of a normal map's value (x, y, z) in the frame of `normal`, a tangent and a bitangent. The frame is
/// MikkTSpace's: x is along the tangent, made perpendicular to the normal. y is perpendicular to both, on the side of
/// the bitangent. Without a tangent, the normal is returned.
pub fn apply_normal_map(normal: DVec3, tangents: [DVec3; 2], [x, y, z]: [f64; 3]) -> DVec3 {
    let Some(along) = tangents[0].reject_from_normalized(normal).try_normalize() else { return normal };
    let across = normal.cross(along);
    let across = if across.dot(tangents[1]) < 0.0 { -across } else { across };
    (along * x + across * y + normal * z).try_normalize().unwrap_or(normal)
}

/// A bent normal, mirrored at the surface where it points behind it, as interpolated normals of meshes are.
pub fn clamp_to_hemisphere(normal: DVec3, geometric: DVec3) -> DVec3 {
    let front = normal - geometric * (2.0 * normal.dot(geometric).min(0.0));
    let unit = front.normalize_or(geometric);
    if unit.dot(geometric) > 0.0 { unit } else { geometric }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slope_of_one_leans_by_half_a_right_angle() {
        let n = apply_bump(DVec3::Z, DVec3::X + DVec3::Z * 7.0);
        assert!((n - DVec3::new(-1.0, 0.0, 1.0).normalize()).length() < 1e-15, "{n}");
    }

    #[test]
    fn it_is_blinns_formula() {
        let (pu, pv) = (DVec3::new(2.0, 0.3, -0.1), DVec3::new(0.4, 1.5, 0.2));
        let (fu, fv) = (0.7, -0.4);
        let cross = pu.cross(pv);
        let n = cross.normalize();
        let blinn = cross + n.cross(pv) * fu - n.cross(pu) * fv;
        // ∇u and ∇v, the dual basis of the tangents.
        let (du, dv) = (pv.cross(n) / cross.length(), n.cross(pu) / cross.length());
        assert!((apply_bump(n, du * fu + dv * fv) - blinn.normalize()).length() < 1e-14);
    }

    #[test]
    fn a_map_that_says_straight_up_changes_nothing() {
        let tangents = [DVec3::new(2.0, 0.0, 0.3), DVec3::new(0.1, 1.0, 0.0)];
        assert_eq!(apply_normal_map(DVec3::Z, tangents, [0.0, 0.0, 1.0]), DVec3::Z);
        assert_eq!(apply_normal_map(DVec3::Z, tangents, [1.0, 0.0, 0.0]), DVec3::X);
        assert_eq!(apply_normal_map(DVec3::Z, tangents, [0.0, 1.0, 0.0]), DVec3::Y);
        assert_eq!(apply_normal_map(DVec3::Z, [DVec3::ZERO; 2], [1.0, 0.0, 0.0]), DVec3::Z);
    }

    #[test]
    fn no_normal_stays_behind_the_surface() {
        for normal_bent in [DVec3::NEG_Z, DVec3::new(1.0, 0.0, -0.5).normalize(), DVec3::X, DVec3::Z] {
            let n = clamp_to_hemisphere(normal_bent, DVec3::Z);
            assert!(n.z > 0.0 && (n.length() - 1.0).abs() < 1e-15, "{normal_bent}: {n}");
        }
    }
}
