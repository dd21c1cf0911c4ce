//! Latitude-longitude images: the whole sphere of directions in a rectangle twice as wide as high.
//!
//! The middle of the image is −z, the default direction of a camera. Its right quarter is +x, its upper edge +y.

use crate::math::Vector;
use crate::math::functions::{atan2, sin_cos};
use canaletto_bvh::lanes::Real64;
use glam::DVec3;
use std::f64::consts::{PI, TAU};

/// (u, v) of a unit direction, from the image's upper left corner (0, 0) to its lower right one (1, 1). At the poles,
/// where u is arbitrary, it is that of the middle.
pub(super) fn uv(direction: DVec3) -> [f64; 2] {
    uvs(direction.into())
}

/// The unit direction to (u, v).
pub(super) fn direction(uv: [f64; 2]) -> DVec3 {
    directions(uv).into()
}

/// [`uv`] in each lane.
#[inline(always)]
pub(super) fn uvs<F: Real64>(direction: Vector<F>) -> [F; 2] {
    let Vector { x, y, z } = direction;
    let across = (x * x + z * z).sqrt();
    [atan2(x, -z) / TAU + 0.5, atan2(across, y) / PI]
}

/// [`direction`] in each lane.
#[inline(always)]
pub(super) fn directions<F: Real64>([u, v]: [F; 2]) -> Vector<F> {
    let ([sin_u, cos_u], [sin_v, cos_v]) = (sin_cos((u - 0.5) * TAU), sin_cos(v * PI));
    Vector { x: sin_v * sin_u, y: cos_v, z: -sin_v * cos_u }
}

/// The change of (u, v) when the unit direction changes by `change`. Towards the poles the change of u is unbounded.
pub(super) fn uv_change(direction: DVec3, change: DVec3) -> [f64; 2] {
    let across2 = (direction.x * direction.x + direction.z * direction.z).max(f64::MIN_POSITIVE);
    // Derivatives of atan2(x, −z) and of atan2(√(x² + z²), y).
    let du = (direction.x * change.z - direction.z * change.x) / across2 / TAU;
    let dv = -change.y / libm::sqrt(across2) / PI;
    [du, dv]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_axes_are_where_the_header_says() {
        for (d, uv_there) in [
            (DVec3::NEG_Z, [0.5, 0.5]),
            (DVec3::X, [0.75, 0.5]),
            (DVec3::NEG_X, [0.25, 0.5]),
            (DVec3::new(1e-9, 0.0, 1.0), [1.0, 0.5]),
            (DVec3::new(-1e-9, 0.0, 1.0), [0.0, 0.5]),
            (DVec3::new(0.0, 0.5f64.sqrt(), -(0.5f64.sqrt())), [0.5, 0.25]),
        ] {
            let got = uv(d);
            assert!((got[0] - uv_there[0]).abs() < 1e-9 && (got[1] - uv_there[1]).abs() < 1e-9, "{d}: {got:?}");
        }
        assert_eq!((uv(DVec3::Y)[1], uv(DVec3::NEG_Y)[1]), (0.0, 1.0));
    }

    #[test]
    fn there_and_back() {
        for i in 0..100 {
            for j in 1..50 {
                let place = [f64::from(i) / 100.0, f64::from(j) / 50.0];
                let back = uv(direction(place));
                assert!((back[0] - place[0]).abs() < 1e-14 && (back[1] - place[1]).abs() < 1e-14, "{place:?} {back:?}");
            }
        }
    }

    #[test]
    fn coordinates_move_as_differences_say() {
        let d = DVec3::new(0.3, -0.2, 0.7).normalize();
        // The change is perpendicular to the direction, as differences of unit directions are.
        let change = d.cross(DVec3::new(0.1, 0.9, -0.4));
        let h = 1e-6;
        let [a, b] = [uv((d - change * h).normalize()), uv((d + change * h).normalize())];
        let slope = uv_change(d, change);
        for i in 0..2 {
            assert!(((b[i] - a[i]) / (2.0 * h) - slope[i]).abs() < 1e-8, "{slope:?}");
        }
    }
}
