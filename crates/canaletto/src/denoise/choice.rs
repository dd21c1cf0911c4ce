//! The choice among filters: by their errors, which each half estimates of what the other half became.

use super::plane::{ColorPlanes, Plane};

/// A filtered picture in halves: `halves[i]` was made of the light of half i.
#[derive(Debug)]
pub(super) struct Candidate {
    pub(super) halves: [ColorPlanes; 2],
}

/// The radius of the squares over which estimates are averaged.
const RADIUS: usize = 3;

/// A filter has to be better than the first candidate, the noisy picture, by this share of its error.
const DOUBT: f32 = 0.1;

/// The mean of the halves with the least error at each pixel. `light` are the halves before filtering. `weight` is
/// what a square error counts. `direct` marks pixels that stay as they are, and have no part in the estimates.
///
/// A half B is the true light plus noise that a filtered half F of A has no part in. (F − B)² is therefore the error of
/// F and the variance of B. With the variance (A − B)²/2 of each half and (F − F')²/2 of each filtered half, the error
/// of the mean of F and F' is ½((F − B)² + (F' − A)²) − ½(A − B)² − ¼(F − F')².
pub(super) fn choose(
    light: &[ColorPlanes; 2],
    candidates: &[Candidate],
    scale: &ColorPlanes,
    weight: &Plane,
    direct: &Plane,
) -> (ColorPlanes, Vec<f64>) {
    let size = light[0][0].size;
    let excess: Vec<Plane> = candidates
        .iter()
        .map(|candidate| {
            let mut plane = Plane::new(size);
            plane.fill(|x, y| {
                let mut sum = 0.0;
                for c in 0..3 {
                    let at = |planes: &ColorPlanes| planes[c].at(x, y) * scale[c].at(x, y);
                    let (a, b) = (at(&light[0]), at(&light[1]));
                    let (fa, fb) = (at(&candidate.halves[0]), at(&candidate.halves[1]));
                    let error = 0.5 * ((fa - b) * (fa - b) + (fb - a) * (fb - a))
                        - 0.5 * (a - b) * (a - b)
                        - 0.25 * (fa - fb) * (fa - fb);
                    sum += error;
                }
                sum * weight.at(x, y) * (1.0 - direct.at(x, y))
            });
            plane.box_mean(RADIUS).box_mean(RADIUS)
        })
        .collect();
    let mut best = Plane::new(size);
    best.fill(|x, y| {
        let doubt = DOUBT * excess[0].at(x, y).abs();
        let errors = excess.iter().enumerate().map(|(i, plane)| plane.at(x, y) + if i == 0 { 0.0 } else { doubt });
        errors.enumerate().fold((0, f32::INFINITY), |best, (i, e)| if e < best.1 { (i, e) } else { best }).0 as f32
    });
    let shares: Vec<Plane> = (0..candidates.len())
        .map(|i| {
            let mut share = Plane::new(size);
            share.fill(|x, y| if best.at(x, y) == i as f32 { 1.0 } else { 0.0 });
            let mut smooth = share.box_mean(2);
            if candidates.len() > 1 {
                let (own, kept) = (smooth.clone(), if i == 0 { 1.0 } else { 0.0 });
                smooth.fill(|x, y| if direct.at(x, y) > 0.0 { kept } else { own.at(x, y) });
            }
            smooth
        })
        .collect();
    let chosen = [0, 1, 2].map(|c| {
        let mut plane = Plane::new(size);
        plane.fill(|x, y| {
            let parts = shares.iter().zip(candidates);
            parts
                .map(|(share, candidate)| {
                    let [a, b] = &candidate.halves;
                    share.at(x, y) * 0.5 * (a[c].at(x, y) + b[c].at(x, y))
                })
                .sum()
        });
        plane
    });
    let parts =
        shares.iter().map(|share| share.values.iter().map(|v| f64::from(*v)).sum::<f64>() / (size[0] * size[1]) as f64);
    (chosen, parts.collect())
}
