//! Maps from the unit square, in which samplers place their points, to the sampled shapes. They preserve areas, so that
//! uniform points stay uniform.

use glam::{DVec2, DVec3};
use std::f64::consts::{FRAC_PI_4, TAU};

/// A point of the unit disk: squares around the square's centre become circles (Shirley & Chiu, *A Low Distortion Map
/// Between Disk and Square*, 1997).
pub fn disk([u, v]: [f64; 2]) -> DVec2 {
    let (a, b) = (2.0 * u - 1.0, 2.0 * v - 1.0);
    if a == 0.0 && b == 0.0 {
        return DVec2::ZERO;
    }
    let (r, angle) =
        if a.abs() > b.abs() { (a, FRAC_PI_4 * (b / a)) } else { (b, 2.0 * FRAC_PI_4 - FRAC_PI_4 * (a / b)) };
    let (sin, cos) = libm::sincos(angle);
    DVec2::new(cos, sin) * r
}

/// A direction of the hemisphere around z, with the density of its cosine: a point of the disk under it (Malley).
pub fn cosine_hemisphere(u: [f64; 2]) -> DVec3 {
    let p = disk(u);
    p.extend((1.0 - p.length_squared()).max(0.0).sqrt())
}

/// A direction of the whole sphere. Equal heights of a sphere have equal areas (Archimedes).
pub fn sphere([u, v]: [f64; 2]) -> DVec3 {
    let (sin, cos) = libm::sincos(TAU * v);
    let across = (4.0 * u * (1.0 - u)).sqrt();
    DVec3::new(across * cos, across * sin, 1.0 - 2.0 * u)
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
