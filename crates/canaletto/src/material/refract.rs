//! Mirror directions and Snell's law (5.37, 5.40–5.44).

use glam::DVec3;

/// The mirrored direction of (5.37), r = 2 (v·n) n − v: `v`, which points away from the surface, mirrored in the unit
/// normal.
#[inline(always)]
pub fn reflect(v: DVec3, n: DVec3) -> DVec3 {
    n * (2.0 * v.dot(n)) - v
}

/// The refracted direction of unit `v` with the unit normal on the side of `v` and the ratio ηᵢ/ηₜ. `v` points away
/// from the surface, towards the ray's origin. `None` is total internal reflection.
#[inline]
pub fn refract(v: DVec3, n: DVec3, eta_ratio: f64) -> Option<DVec3> {
    // (5.41) vₜ = (v·n) n − v has the length sin θᵢ (5.42), so that sin θₜ t̂ = (ηᵢ/ηₜ) vₜ without a division.
    let tangential = (n * v.dot(n) - v) * eta_ratio; // (5.43)
    let sin2 = tangential.length_squared();
    if sin2 >= 1.0 {
        return None;
    }
    Some(tangential - n * (1.0 - sin2).sqrt()) // (5.44)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exercise_5_mirrors_the_light() {
        let n = DVec3::new(-1.0, 2.0, 0.0).normalize();
        let l = DVec3::new(-3.0, 3.0, 0.0).normalize();
        assert!((reflect(l, n) - DVec3::new(-0.141, 0.990, 0.0)).length() < 1e-3);
    }

    #[test]
    fn refraction_obeys_snell_both_ways() {
        let n = DVec3::Y;
        for degrees in [0.0f64, 10.0, 41.0, 60.0, 89.0] {
            let v = DVec3::new(-degrees.to_radians().sin(), degrees.to_radians().cos(), 0.0);
            let inside = refract(v, n, 1.0 / 1.5).expect("entering always refracts");
            assert!((inside.x - v.x.abs() / 1.5).abs() < 1e-6 && inside.y < 0.0);
            let back = refract(inside, -n, 1.5).expect("the way back exists");
            assert!((back - v).length() < 1e-4 || degrees > 88.0);
        }
    }

    #[test]
    fn beyond_the_critical_angle_nothing_leaves() {
        let critical = (1.0f64 / 1.5).asin();
        let at = |angle: f64| refract(DVec3::new(angle.sin(), angle.cos(), 0.0), DVec3::Y, 1.5);
        assert!(at(critical - 1e-3).is_some() && at(critical + 1e-3).is_none());
    }
}
