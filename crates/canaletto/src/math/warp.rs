//! Maps from the unit square, in which samplers place their points, to the sampled shapes. They preserve areas, so that
//! uniform points stay uniform.

use glam::{DVec2, DVec3};
use std::f64::consts::{FRAC_PI_4, TAU};

/// A point of the unit disk: squares around the square's centre become circles (Shirley & Chiu, *A Low Distortion Map
/// Between Disk and Square*, 1997).
#[inline(always)]
pub fn disk([u, v]: [f64; 2]) -> DVec2 {
    let (a, b) = (2.0 * u - 1.0, 2.0 * v - 1.0);
    let is_wide = a.abs() > b.abs();
    let (r, other) = if is_wide { (a, b) } else { (b, a) };
    // The angle to the nearest axis.
    let ratio = other / r;
    let angle = FRAC_PI_4 * if r == 0.0 { 0.0 } else { ratio };
    let (sin, cos) = sin_cos_near_zero(angle);
    let (x, y) = if is_wide { (cos, sin) } else { (sin, cos) };
    DVec2::new(x * r, y * r)
}

/// The sine and the cosine of an angle within π / 4 of zero, by their series. What is left out is below half a unit in
/// the last place. The compiler vectorises loops over it.
#[inline(always)]
fn sin_cos_near_zero(x: f64) -> (f64, f64) {
    /// The inverse factorials of 2 to 17 with the signs of the series, the last ones first.
    const SIN: [f64; 8] = inverse_factorials(17);
    const COS: [f64; 8] = inverse_factorials(16);
    let square = x * x;
    let (mut sin, mut cos) = (SIN[0], COS[0]);
    for i in 1..8 {
        sin = sin * square + SIN[i];
        cos = cos * square + COS[i];
    }
    (x + x * square * sin, 1.0 + square * cos)
}

/// ±1 / n! for n from `last` down in steps of two. Those of 16 and 17 are positive, and the signs take turns.
const fn inverse_factorials(last: u32) -> [f64; 8] {
    let mut all = [0.0; 8];
    let mut i = 0;
    while i < 8 {
        let (mut factorial, mut n) = (if i % 2 == 0 { 1.0 } else { -1.0 }, last - 2 * i as u32);
        while n > 1 {
            factorial *= n as f64;
            n -= 1;
        }
        all[i] = 1.0 / factorial;
        i += 1;
    }
    all
}

/// A direction of the hemisphere around z, with the density of its cosine: a point of the disk under it (Malley).
#[inline(always)]
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
    fn sines_and_cosines_are_exact_near_zero() {
        for i in -1000..=1000 {
            let x = FRAC_PI_4 * f64::from(i) / 1000.0;
            let (sin, cos) = sin_cos_near_zero(x);
            assert!((sin - libm::sin(x)).abs() <= 2e-16 * x.abs(), "{x}: {sin}");
            assert!((cos - libm::cos(x)).abs() <= 2.3e-16, "{x}: {cos}");
        }
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
