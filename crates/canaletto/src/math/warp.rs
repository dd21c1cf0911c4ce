//! Maps from the unit square, in which samplers place their points, to the sampled shapes. They preserve areas, so that
//! uniform points stay uniform.

use super::Vector;
use super::functions::{sin_cos, sin_cos_near_zero};
use canaletto_bvh::lanes::Real64;
use glam::{DVec2, DVec3};
use std::f64::consts::{FRAC_PI_4, TAU};

/// A point of the unit disk: squares around the square's centre become circles (Shirley & Chiu, *A Low Distortion Map
/// Between Disk and Square*, 1997).
#[inline(always)]
pub fn disk(u: [f64; 2]) -> DVec2 {
    DVec2::from(disk_lanes(u))
}

/// [`disk`] for any number of lanes.
#[inline(always)]
pub(crate) fn disk_lanes<F: Real64>([u, v]: [F; 2]) -> [F; 2] {
    let (a, b) = (u * 2.0 - 1.0, v * 2.0 - 1.0);
    let is_wide = b.abs().less(a.abs());
    let (r, other) = (F::select(is_wide, a, b), F::select(is_wide, b, a));
    let zero = F::splat(0.0);
    // The angle to the nearest axis.
    let angle = F::select(r.equal(zero), zero, other / r) * FRAC_PI_4;
    let [sin, cos] = sin_cos_near_zero(angle);
    [F::select(is_wide, cos, sin) * r, F::select(is_wide, sin, cos) * r]
}

/// A direction of the hemisphere around z, with the density of its cosine: a point of the disk under it (Malley).
#[inline(always)]
pub fn cosine_hemisphere(u: [f64; 2]) -> DVec3 {
    cosine_hemisphere_lanes(u).into()
}

/// [`cosine_hemisphere`] for any number of lanes.
#[inline(always)]
pub(crate) fn cosine_hemisphere_lanes<F: Real64>(u: [F; 2]) -> Vector<F> {
    let [x, y] = disk_lanes(u);
    let z = (F::splat(1.0) - (x * x + y * y)).max(F::splat(0.0)).sqrt();
    Vector { x, y, z }
}

/// A direction of the whole sphere. Equal heights of a sphere have equal areas (Archimedes).
pub fn sphere(u: [f64; 2]) -> DVec3 {
    sphere_lanes(u).into()
}

/// [`sphere`] for any number of lanes.
#[inline(always)]
pub(crate) fn sphere_lanes<F: Real64>([u, v]: [F; 2]) -> Vector<F> {
    let [sin, cos] = sin_cos(v * TAU);
    let one = F::splat(1.0);
    let across = (u * 4.0 * (one - u)).sqrt();
    Vector { x: across * cos, y: across * sin, z: one - u * 2.0 }
}

/// A point of the regular polygon with `corners` corners, at least 3, on the unit circle. The first corner is at angle
/// 0.
pub fn polygon([u, v]: [f64; 2], corners: u32) -> DVec2 {
    // A triangle around the centre, and a point in it.
    let n = f64::from(corners);
    let slice = libm::floor(u * n).min(n - 1.0);
    let along = u * n - slice;
    let corner = |k: f64| {
        let (sin, cos) = libm::sincos(TAU * k / n);
        DVec2::new(cos, sin)
    };
    (corner(slice) * (1.0 - along) + corner(slice + 1.0) * along) * v.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The mean over a fine grid of the square, which an area-preserving map makes the shape's own.
    fn mean(map: impl Fn([f64; 2]) -> DVec2, f: impl Fn(DVec2) -> f64) -> f64 {
        let n = 400;
        let at = |i: u32| (f64::from(i) + 0.5) / f64::from(n);
        (0..n * n).map(|i| f(map([at(i % n), at(i / n)]))).sum::<f64>() / f64::from(n * n)
    }

    #[test]
    fn disks_are_even_and_whole() {
        assert!((mean(disk, |p| p.length_squared()) - 0.5).abs() < 1e-4);
        assert!(mean(disk, |p| p.x).abs() < 1e-9 && mean(disk, |p| p.x * p.y).abs() < 1e-9);
        let inside = |r: f64| mean(disk, |p| if p.length() < r { 1.0 } else { 0.0 });
        assert!((inside(0.3) - 0.09).abs() < 2e-3 && (inside(0.8) - 0.64).abs() < 2e-3 && inside(1.0) == 1.0);
        assert_eq!(disk([0.5, 0.5]), DVec2::ZERO);
    }

    #[test]
    fn polygons_are_even_and_whole() {
        // A square on the unit circle: ∫|p|² is a third of the squared circumradius.
        assert!((mean(|u| polygon(u, 4), |p| p.length_squared()) - 1.0 / 3.0).abs() < 1e-4);
        assert!(mean(|u| polygon(u, 5), |p| p.x).abs() < 1e-6);
        let beyond = mean(|u| polygon(u, 6), |p| if p.x > 0.5 { 1.0 } else { 0.0 });
        // The triangle between the corners at ±60° and 0°: half the rhombus of two slices, 1 of 6.
        assert!((beyond - 1.0 / 6.0).abs() < 2e-3, "{beyond}");
        assert!(mean(|u| polygon(u, 6), |p| if p.length() > 1.0 { 1.0 } else { 0.0 }) == 0.0);
    }
}
