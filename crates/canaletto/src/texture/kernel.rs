//! Kernels that make a function from texels, along one axis.
//!
//! The chapter names the interpolations (nearest, bilinear, biquadratic, bicubic) and leaves their formulas to its
//! third chapter on images. The kernels here pass through the texels and reproduce polynomials up to their own degree.
//! The B-splines don't pass through the texels, but are smooth and never overshoot.

use super::Filter;

/// The weights of up to four texels, of which `first` is the first. Positions are in texels, whose centres are at whole
/// numbers plus a half.
#[derive(Clone, Copy, Debug)]
pub(super) struct Weights {
    pub(super) first: i64,
    pub(super) count: usize,
    pub(super) weights: [f32; 4],
}

/// The weights of the texels around a position.
pub(super) fn weights(filter: Filter, position: f64) -> Weights {
    match filter {
        Filter::Nearest => Weights { first: position.floor() as i64, count: 1, weights: [1.0, 0.0, 0.0, 0.0] },
        Filter::QuadraticSpline => {
            // Relative to the nearest texel, t is from −½ to ½.
            let nearest = position.floor();
            let t = (position - nearest - 0.5) as f32;
            let (before, after) = (0.5 - t, 0.5 + t);
            let weights = [0.5 * before * before, 0.75 - t * t, 0.5 * after * after, 0.0];
            Weights { first: nearest as i64 - 1, count: 3, weights }
        }
        _ => {
            let left = (position - 0.5).floor();
            let t = (position - 0.5 - left) as f32;
            let s = 1.0 - t;
            let (offset, count, weights) = match filter {
                Filter::Bilinear => (0, 2, [s, t, 0.0, 0.0]),
                // The mean of the two parabolas through three texels that contain the interval.
                Filter::Biquadratic => {
                    let outer = -0.25 * t * s;
                    (1, 4, [outer, 0.25 * s * (4.0 + t), 0.25 * t * (4.0 + s), outer])
                }
                // Catmull and Rom's: the two parabolas, blended over the interval (Keys 1981 with a = −½).
                Filter::Bicubic => {
                    let weights = [
                        -0.5 * t * s * s,
                        1.0 + t * t * (1.5 * t - 2.5),
                        1.0 + s * s * (1.5 * s - 2.5),
                        -0.5 * s * t * t,
                    ];
                    (1, 4, weights)
                }
                _ => {
                    let sixth = 1.0 / 6.0;
                    let weights = [
                        sixth * s * s * s,
                        sixth * (4.0 + t * t * (3.0 * t - 6.0)),
                        sixth * (4.0 + s * s * (3.0 * s - 6.0)),
                        sixth * t * t * t,
                    ];
                    (1, 4, weights)
                }
            };
            Weights { first: left as i64 - offset, count, weights }
        }
    }
}

/// The kernel's variance in texels²: the width that it adds to a texel.
pub(super) fn variance(filter: Filter) -> f64 {
    match filter {
        Filter::Nearest => 1.0 / 12.0,
        Filter::Bilinear => 1.0 / 6.0,
        Filter::Biquadratic | Filter::Bicubic => 0.0,
        Filter::QuadraticSpline => 0.25,
        Filter::CubicSpline => 1.0 / 3.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Named;

    /// The value of a kernel over samples of f at the texels' centres.
    fn reconstruct(filter: Filter, f: impl Fn(f64) -> f64, x: f64) -> f64 {
        let Weights { first, count, weights } = weights(filter, x);
        (0..count).map(|i| f64::from(weights[i]) * f(first as f64 + i as f64 + 0.5)).sum()
    }

    fn places() -> impl Iterator<Item = f64> {
        (0..=1000).map(|i| 3.0 + f64::from(i) * 0.0073)
    }

    #[test]
    fn every_kernel_reproduces_constants() {
        for &filter in Filter::ALL {
            for x in places() {
                assert!((reconstruct(filter, |_| 1.0, x) - 1.0).abs() < 1e-6, "{filter:?} at {x}");
            }
        }
    }

    #[test]
    fn all_but_the_nearest_reproduce_lines() {
        for filter in &Filter::ALL[1..] {
            for x in places() {
                assert!((reconstruct(*filter, |x| 2.0 * x - 3.0, x) - (2.0 * x - 3.0)).abs() < 1e-5, "{filter:?} {x}");
            }
        }
    }

    #[test]
    fn biquadratic_and_bicubic_reproduce_parabolas_and_splines_lift_them_by_their_variance() {
        for &filter in Filter::ALL {
            let lift = match filter {
                Filter::Biquadratic | Filter::Bicubic => 0.0,
                Filter::QuadraticSpline => 0.25,
                Filter::CubicSpline => 1.0 / 3.0,
                _ => continue,
            };
            for x in places() {
                let value = reconstruct(filter, |x| x * x, x);
                assert!((value - x * x - lift).abs() < 1e-4, "{filter:?} at {x}: {value}");
            }
        }
    }

    #[test]
    fn interpolations_go_through_the_texels() {
        let f = |x: f64| (x * 7.3).sin();
        for filter in [Filter::Nearest, Filter::Bilinear, Filter::Biquadratic, Filter::Bicubic] {
            for i in 0..20 {
                let x = f64::from(i) + 0.5;
                assert!((reconstruct(filter, f, x) - f(x)).abs() < 1e-6, "{filter:?}");
            }
        }
    }

    #[test]
    fn kernels_are_as_smooth_as_they_should_be() {
        let f = |x: f64| (x * 7.3).sin();
        for filter in &Filter::ALL[1..] {
            let smooth = matches!(filter, Filter::Bicubic | Filter::QuadraticSpline | Filter::CubicSpline);
            for half in 0..20 {
                let x = 5.0 + 0.5 * f64::from(half);
                let d = 1e-3;
                let at = |x: f64| reconstruct(*filter, f, x);
                let (before, here, after) = (at(x - d), at(x), at(x + d));
                assert!((before - here).abs() < 0.02 && (after - here).abs() < 0.02, "{filter:?} jumps at {x}");
                let bend = (after - here - (here - before)).abs() / d;
                assert!(!smooth || bend < 0.1, "{filter:?} has a corner at {x}: {bend}");
            }
        }
    }
}
