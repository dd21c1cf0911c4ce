//! The choice among filters: by their errors, which each half estimates of what the other half became.

use super::plane::Plane;
use crate::math::Rgb;
use canaletto_parallel::prelude::*;

/// The radius of the squares over which estimates are averaged.
const RADIUS: usize = 3;

/// A filter has to be better than the first candidate, the noisy picture, by this share of its error.
const DOUBT: f32 = 0.1;

/// The noisy picture needs half of a square of this radius around a pixel. Smaller islands of it are errors of the
/// estimate: they would stay as grains in what is smooth.
const ISLAND: usize = 6;

/// The square error of the mean of the filtered halves `filtered`, as far as a pixel of both halves tells it.
///
/// A half B is the true light plus noise that a filtered half F of A has no part in. (F − B)² is therefore the error of
/// F and the variance of B. With the variance (A − B)²/2 of each half and (F − F')²/2 of each filtered half, the error
/// of the mean of F and F' is ½((F − B)² + (F' − A)²) − ½(A − B)² − ¼(F − F')².
#[inline(always)]
pub(super) fn square_error(halves: [[f32; 3]; 2], filtered: [[f32; 3]; 2]) -> f32 {
    let ([a, b], [fa, fb]) = (halves, filtered);
    (0..3)
        .map(|c| {
            let square = |v: f32| v * v;
            0.5 * (square(fa[c] - b[c]) + square(fb[c] - a[c]))
                - 0.5 * square(a[c] - b[c])
                - 0.25 * square(fa[c] - fb[c])
        })
        .sum()
}

/// The candidate with the least error at each pixel. `errors` are those of each pixel and candidate, the noisy picture
/// first. `color` returns what a candidate makes of a pixel. `direct` marks pixels that stay as they are, and have no
/// part in the estimates. Returns the colours, and the share of pixels of each candidate.
pub(super) fn choose(
    errors: Vec<Plane>,
    color: impl Fn(usize, usize) -> [f32; 3] + Sync,
    direct: &[bool],
) -> (Vec<Rgb>, Vec<f64>) {
    let (size, count) = (errors[0].size, errors.len());
    let errors: Vec<Plane> = errors
        .into_iter()
        .map(|mut plane| {
            plane.values.iter_mut().zip(direct).filter(|(_, direct)| **direct).for_each(|(v, _)| *v = 0.0);
            plane.box_mean(RADIUS).box_mean(RADIUS)
        })
        .collect();
    let mut best = vec![0u8; direct.len()];
    for (i, best) in best.iter_mut().enumerate() {
        let doubt = DOUBT * errors[0].values[i].abs();
        let errors = errors.iter().enumerate().map(|(n, plane)| plane.values[i] + if n == 0 { 0.0 } else { doubt });
        *best =
            errors.enumerate().fold((0, f32::INFINITY), |best, (n, e)| if e < best.1 { (n as u8, e) } else { best }).0;
    }
    if count > 1 {
        let noisy = Plane::of(size, |i| if best[i] == 0 && !direct[i] { 1.0 } else { 0.0 }).box_mean(ISLAND);
        let is_island = |i: usize| best[i] == 0 && noisy.values[i] < 0.5;
        let islands: Vec<usize> = (0..best.len()).filter(|i| is_island(*i)).collect();
        for i in islands {
            let filters = errors.iter().enumerate().skip(1).map(|(n, plane)| (n as u8, plane.values[i]));
            best[i] = filters.fold((1, f32::INFINITY), |best, other| if other.1 < best.1 { other } else { best }).0;
        }
    }
    drop(errors);
    let shares: Vec<Plane> = (0..count as u8)
        .map(|n| {
            let share = Plane::of(size, |i| if best[i] == n { 1.0 } else { 0.0 });
            let mut smooth = share.box_mean(2);
            if count > 1 {
                let kept = if n == 0 { 1.0 } else { 0.0 };
                smooth.values.iter_mut().zip(direct).filter(|(_, direct)| **direct).for_each(|(v, _)| *v = kept);
            }
            smooth
        })
        .collect();
    let chosen = |i: usize| {
        let mut sum = [0.0; 3];
        for (n, share) in shares.iter().enumerate().map(|(n, plane)| (n, plane.values[i])) {
            if share > 0.0 {
                sum.iter_mut().zip(color(n, i)).for_each(|(sum, v)| *sum += share * v);
            }
        }
        Rgb::from(sum)
    };
    let mut colors = vec![Rgb::BLACK; direct.len()];
    colors.par_iter_mut().enumerate().for_each(|(i, color)| *color = chosen(i));
    let parts = shares.iter().map(|share| share.total() / direct.len() as f64).collect();
    (colors, parts)
}
