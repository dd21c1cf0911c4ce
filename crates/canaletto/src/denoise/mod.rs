//! Denoising: from a noisy picture and what is known of its surfaces to one without noise.
//!
//! 1. Outliers, which one half of the samples met alone, are lowered. Their light is spread over their surroundings
//!    after the filters, so that none is lost. How much there was is reported.
//! 2. Light is divided by the albedo, so that textures are no edges.
//! 3. Two filters average what belongs together: à-trous wavelets, which are fast, and first-order regression.
//! 4. Each pixel takes the filter of the least error, or none. Each half of the samples estimates the errors of what
//!    the other half became.
//!
//! Everything is deterministic and the same for any number of threads.

mod atrous;
mod choice;
mod features;
mod outliers;
mod plane;
mod regression;
#[cfg(test)]
mod tests;

use crate::math::Rgb;
use crate::named;
use atrous::{Half, atrous};
use choice::{Candidate, choose};
use features::FeaturePlanes;
use outliers::{lower_outliers, spread_outliers};
use plane::{ColorPlanes, Plane};
use regression::{PatchGuide, regress};
use std::ops::ControlFlow;

/// A picture to be denoised. All layers have width × height values, the top row first.
#[derive(Clone, Debug, Default)]
pub struct NoisyPicture {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// The colours in linear light. They are the mean of the halves, if there are any.
    pub color: Vec<Rgb>,
    /// The means of two independent halves of the samples.
    pub halves: Option<[Vec<Rgb>; 2]>,
    /// The share of light that surfaces scatter, 0 to 1.
    pub albedo: Option<Vec<[f32; 3]>>,
    /// Normals.
    pub normal: Option<Vec<[f32; 3]>>,
    /// Distances from the eye; infinite for the background.
    pub depth: Option<Vec<f32>>,
}

/// How hard a picture is denoised.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DenoiseQuality {
    /// À-trous wavelets alone.
    Fast,
    /// Wavelets and regression, whichever has the least error at a pixel.
    #[default]
    Good,
}

named!(DenoiseQuality {
    Fast => "fast",
    Good => "good",
});

/// A denoised picture.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct DenoisedPicture {
    /// The colours in linear light, the top row first.
    pub color: Vec<Rgb>,
    /// The share of the picture's light that belonged to outliers and was spread over their surroundings, 0 to 1.
    pub outlier_light: f64,
    /// The share of pixels that each filter made, by name: "noisy", "wavelets", "regression".
    pub filters: Vec<(&'static str, f64)>,
}

impl DenoisedPicture {
    /// A picture that another denoiser made.
    pub fn by_another(name: &'static str, color: Vec<Rgb>) -> DenoisedPicture {
        DenoisedPicture { color, outlier_light: 0.0, filters: vec![(name, 1.0)] }
    }
}

/// Albedos below this one don't divide light.
const LEAST_ALBEDO: f32 = 0.02;

/// Denoises a picture on the threads of the current rayon pool. `go_on` is asked between steps.
pub fn denoise(
    picture: &NoisyPicture,
    quality: DenoiseQuality,
    go_on: &(dyn Fn(f64) -> bool + Sync),
) -> ControlFlow<(), DenoisedPicture> {
    let size = [picture.width as usize, picture.height as usize];
    let features =
        FeaturePlanes::new(size, picture.normal.as_deref(), picture.albedo.as_deref(), picture.depth.as_deref());
    let total: f64 = picture.color.iter().flat_map(|c| c.to_array()).map(|v| f64::from(finite(v))).sum();
    let exposure = exposure(total / (3 * size[0] * size[1]) as f64);
    let [a, b] = match &picture.halves {
        Some(halves) => [0, 1].map(|i: usize| color_planes(size, &halves[i], exposure)),
        None => [0, 1].map(|_| color_planes(size, &picture.color, exposure)),
    };
    let ((lowered_a, removed_a), (lowered_b, removed_b)) = (lower_outliers(&a, &b), lower_outliers(&b, &a));
    let scale = [0, 1, 2].map(|c| match &picture.albedo {
        Some(albedo) => Plane::of(size, |i| albedo[i][c].max(LEAST_ALBEDO)),
        None => Plane::of(size, |_| 1.0),
    });
    let light = [lowered_a, lowered_b].map(|half| divided(half, &scale));
    let unlowered = [a, b].map(|half| divided(half, &scale));
    step(go_on, 0.1)?;
    let has_halves = picture.halves.is_some();
    let variance_of = |a: &Plane, b: &Plane| {
        if has_halves { half_variance(a, b).box_mean(2).box_mean(2) } else { variance_of_neighbours(a).box_mean(1) }
    };
    let variance = [0, 1, 2].map(|c| variance_of(&light[0][c], &light[1][c]));
    let luminance_variance = variance_of(&atrous::luminance(&light[0]), &atrous::luminance(&light[1]));
    let with_variance = light.clone().map(|color| Half { color, variance: luminance_variance.clone() });
    let wavelets = atrous(with_variance, &features, picture.normal.is_some());
    let spread = [0, 1].map(|i: usize| spread_outliers(&unlowered[i], &light[i]));
    let mut candidates = vec![("noisy", Candidate { halves: unlowered.clone() })];
    if quality == DenoiseQuality::Good {
        let regression = |i: usize| {
            let guide = PatchGuide {
                color: light[i].clone().map(|plane| plane.with_mirrored_margin(10)),
                variance: variance.clone().map(|plane| plane.with_mirrored_margin(10)),
            };
            let fitted = within(regress(&light[i], &guide, &features), &wavelets[i]);
            added(fitted, &spread[i])
        };
        step(go_on, 0.3)?;
        let first = regression(0);
        step(go_on, 0.6)?;
        candidates.push(("regression", Candidate { halves: [first, regression(1)] }));
    }
    let [a, b] = wavelets;
    candidates.push(("wavelets", Candidate { halves: [added(a, &spread[0]), added(b, &spread[1])] }));
    step(go_on, 0.9)?;
    if !has_halves {
        // Nothing can estimate errors. Wavelets, which come last, blur the least.
        candidates = candidates.split_off(candidates.len() - 1);
    }
    let (names, candidates): (Vec<_>, Vec<_>) = candidates.into_iter().unzip();
    let (chosen, shares) = choose(&unlowered, &candidates, &scale);
    let [width, height] = size;
    let mut color = vec![Rgb::BLACK; width * height];
    for (i, color) in color.iter_mut().enumerate() {
        let (x, y) = (i % width, i / width);
        *color = Rgb::from([0, 1, 2].map(|c: usize| (chosen[c].at(x, y) * scale[c].at(x, y) / exposure).max(0.0)));
    }
    let removed = (removed_a + removed_b) * 0.5 / f64::from(exposure);
    let outlier_light = if total > 0.0 { removed / total } else { 0.0 };
    ControlFlow::Continue(DenoisedPicture { color, outlier_light, filters: names.into_iter().zip(shares).collect() })
}

fn step(go_on: &(dyn Fn(f64) -> bool + Sync), share: f64) -> ControlFlow<()> {
    if go_on(share) { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
}

fn color_planes(size: [usize; 2], colors: &[Rgb], exposure: f32) -> ColorPlanes {
    [0, 1, 2].map(|c| Plane::of(size, |i| finite(colors[i].to_array()[c]) * exposure))
}

/// Numbers that are none count as black.
fn finite(v: f32) -> f32 {
    if v.is_finite() { v } else { 0.0 }
}

/// The power of two that brings a mean between 1 and 2. Multiplying by it changes no bits but the exponent's.
fn exposure(mean: f64) -> f32 {
    if !(mean > 0.0 && mean.is_finite()) {
        return 1.0;
    }
    let (_, exponent) = libm::frexp(mean);
    libm::ldexpf(1.0, (1 - exponent).clamp(-100, 100))
}

/// A colour divided by another.
fn divided(color: ColorPlanes, by: &ColorPlanes) -> ColorPlanes {
    let mut color = color;
    for (plane, by) in color.iter_mut().zip(by) {
        plane.values.iter_mut().zip(&by.values).for_each(|(v, by)| *v = if *by > 0.0 { *v / by } else { 0.0 });
    }
    color
}

/// The sum of two colours.
fn added(color: ColorPlanes, other: &ColorPlanes) -> ColorPlanes {
    let mut sum = color;
    for (plane, other) in sum.iter_mut().zip(other) {
        plane.values.iter_mut().zip(&other.values).for_each(|(v, add)| *v += add);
    }
    sum
}

/// A fitted colour, kept to the range of the 5 × 5 pixels of another that surround it. A linear fit may lead beyond it.
fn within(fitted: ColorPlanes, other: &ColorPlanes) -> ColorPlanes {
    let mut kept = fitted;
    for (plane, other) in kept.iter_mut().zip(other) {
        let (own, [width, height]) = (plane.clone(), other.size);
        plane.fill(|x, y| {
            let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
            for y in y.saturating_sub(2)..(y + 3).min(height) {
                let start = other.index(x.saturating_sub(2), y);
                let end = other.index((x + 2).min(width - 1), y);
                for v in &other.values[start..=end] {
                    (low, high) = (low.min(*v), high.max(*v));
                }
            }
            own.at(x, y).clamp(low, high)
        });
    }
    kept
}

/// A guess of the variance from how much a pixel differs from the mean of its neighbours. Noise is taken to be in
/// proportion to light, by the median ratio of the picture, since edges differ more than noise does.
fn variance_of_neighbours(plane: &Plane) -> Plane {
    let mean = plane.box_mean(1);
    let square = |v: f32| v * v;
    let guess = |x: usize, y: usize| 9.0 / 8.0 * square(plane.at(x, y) - mean.at(x, y));
    let [width, height] = plane.size;
    let mut ratios: Vec<f32> = (0..width * height)
        .map(|i| (i % width, i / width))
        .filter(|&(x, y)| mean.at(x, y) > 0.0)
        .map(|(x, y)| guess(x, y) / square(mean.at(x, y)))
        .collect();
    ratios.sort_unstable_by(f32::total_cmp);
    // The median of the square of a normal number is 0.455 times its mean.
    let ratio = ratios.get(ratios.len() / 2).map_or(0.0, |median| median / 0.455);
    let mut variance = Plane::new(plane.size);
    variance.fill(|x, y| guess(x, y).min(ratio * square(mean.at(x, y))));
    variance
}

/// (a − b)²/2, whose mean is the variance of each half.
fn half_variance(a: &Plane, b: &Plane) -> Plane {
    let mut plane = Plane::new(a.size);
    plane.fill(|x, y| {
        let difference = a.at(x, y) - b.at(x, y);
        0.5 * difference * difference
    });
    plane
}
