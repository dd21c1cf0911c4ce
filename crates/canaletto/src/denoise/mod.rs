//! Denoising: from a noisy picture and what is known of its surfaces to one without noise.
//!
//! 1. Outliers, which one half of the samples met alone, are lowered. Their light is spread over their surroundings
//!    after the filters, in proportion to the light there, and so far that it isn't seen. How much there was is
//!    reported.
//! 2. Light is divided by the albedo, so that textures are no edges.
//! 3. Two filters average what belongs together: à-trous wavelets, which are fast, and first-order regression.
//! 4. Each pixel takes the filter of the least relative error, or none. Each half of the samples estimates the errors
//!    of what the other half became. Lamps and the background, where they fill a pixel, stay as they are.
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
mod variance;

use crate::math::Rgb;
use crate::named;
use atrous::{Half, atrous, luminance};
use choice::{Candidate, choose};
use features::FeaturePlanes;
use outliers::{lower_outliers, median, spread_outliers};
use plane::{ColorPlanes, Plane};
use regression::{PatchGuide, regress};
use std::ops::ControlFlow;
use variance::averaged;

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
    /// The part of `outlier_light` that isn't spread, since a few outliers would brighten the whole picture.
    pub lost_light: f64,
    /// The share of pixels that each filter made, by name: "noisy", "wavelets", "regression".
    pub filters: Vec<(&'static str, f64)>,
}

impl DenoisedPicture {
    /// A picture that another denoiser made.
    pub fn by_another(name: &'static str, color: Vec<Rgb>) -> DenoisedPicture {
        DenoisedPicture { color, outlier_light: 0.0, lost_light: 0.0, filters: vec![(name, 1.0)] }
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
    let direct = seen_directly(size, &features);
    let lower = |own, other| lower_outliers(own, other, &features);
    let ((lowered_a, removed_a), (lowered_b, removed_b)) = (lower(&a, &b), lower(&b, &a));
    let scale = [0, 1, 2].map(|c| match &picture.albedo {
        Some(albedo) => Plane::of(size, |i| albedo[i][c].max(LEAST_ALBEDO)),
        None => Plane::of(size, |_| 1.0),
    });
    let light = [lowered_a, lowered_b].map(|half| divided(half, &scale));
    let unlowered = [a, b].map(|half| divided(half, &scale));
    step(go_on, 0.1)?;
    let has_halves = picture.halves.is_some();
    let brightness = [0, 1].map(|i: usize| luminance(&light[i]));
    let pairs = [0, 1, 2].map(|c| [&light[0][c], &light[1][c]]);
    let pairs = [pairs[0], pairs[1], pairs[2], [&brightness[0], &brightness[1]]];
    let [red, green, blue, luminance_variance] = if has_halves {
        averaged(&pairs.map(|[a, b]| half_variance(a, b)), &features)
    } else {
        pairs.map(|[a, _]| variance_of_neighbours(a).box_mean(1))
    };
    let variance = [red, green, blue];
    let with_variance = light.clone().map(|color| Half { color, variance: luminance_variance.clone() });
    let wavelets = atrous(with_variance, &features, picture.normal.is_some());
    let spread = [0, 1].map(|i: usize| {
        let removed = multiplied(subtracted(&unlowered[i], &light[i]), &scale);
        spread_outliers(&removed, &takers(&multiplied(wavelets[i].clone(), &scale), &direct))
    });
    let lost = 0.5 * (spread[0].1 + spread[1].1) / f64::from(exposure);
    let spread = spread.map(|(light, _)| divided(light, &scale));
    let mut candidates = vec![("noisy", Candidate { halves: unlowered.clone() })];
    if quality == DenoiseQuality::Good {
        step(go_on, 0.3)?;
        let mirrored = |planes: ColorPlanes| planes.map(|plane| plane.with_mirrored_margin(10));
        let variance = mirrored(variance.clone());
        let regression = |i: usize| {
            let guide = PatchGuide { color: mirrored(light[i].clone()), variance: variance.clone() };
            added(within(regress(&light[i], &guide, &features), &wavelets[i]), &spread[i])
        };
        let first = regression(0);
        step(go_on, 0.6)?;
        candidates.push(("regression", Candidate { halves: [first, regression(1)] }));
    }
    let [a, b] = wavelets.clone();
    candidates.push(("wavelets", Candidate { halves: [added(a, &spread[0]), added(b, &spread[1])] }));
    step(go_on, 0.9)?;
    if !has_halves {
        // Nothing can estimate errors. Wavelets, which come last, blur the least.
        candidates = candidates.split_off(candidates.len() - 1);
    }
    let (names, candidates): (Vec<_>, Vec<_>) = candidates.into_iter().unzip();
    let weight = error_weight(&light, &wavelets, &scale);
    let (chosen, shares) = choose(&unlowered, &candidates, &scale, &weight, &direct);
    let [width, height] = size;
    let mut color = vec![Rgb::BLACK; width * height];
    for (i, color) in color.iter_mut().enumerate() {
        let (x, y) = (i % width, i / width);
        *color = Rgb::from([0, 1, 2].map(|c: usize| (chosen[c].at(x, y) * scale[c].at(x, y) / exposure).max(0.0)));
    }
    let removed = (removed_a + removed_b) * 0.5 / f64::from(exposure);
    let share = |light: f64| if total > 0.0 { light / total } else { 0.0 };
    ControlFlow::Continue(DenoisedPicture {
        color,
        outlier_light: share(removed),
        lost_light: share(lost),
        filters: names.into_iter().zip(shares).collect(),
    })
}

/// The least and the most light, in units of the typical light, that takes light of outliers in proportion.
const TAKEN: [f32; 2] = [1e-3, 4.0];
/// See [`typical`].
const BRIGHTEST: f32 = 30.0;

/// What each pixel may take of the light of outliers, in proportion. What is seen directly takes none.
fn takers(light: &ColorPlanes, direct: &Plane) -> ColorPlanes {
    let typical = typical(light);
    light.each_ref().map(|plane| {
        let mut taker = Plane::new(plane.size);
        taker.fill(|x, y| plane.at(x, y).clamp(TAKEN[0] * typical, TAKEN[1] * typical) * (1.0 - direct.at(x, y)));
        taker
    })
}

/// The mean of the light, where what is far brighter than the median counts no more than [`BRIGHTEST`] medians.
fn typical(light: &ColorPlanes) -> f32 {
    let (light, [width, height]) = (luminance(light), light[0].size);
    let all = || (0..width * height).map(|i| light.at(i % width, i / width));
    let mut lit: Vec<f32> = all().filter(|light| *light > 0.0).collect();
    if lit.is_empty() {
        return 1.0;
    }
    let middle = lit.len() / 2;
    let most = BRIGHTEST * *lit.select_nth_unstable_by(middle, f32::total_cmp).1;
    (all().map(|light| f64::from(light.min(most))).sum::<f64>() / (width * height) as f64) as f32
}

/// What the square of an error counts: 1 / light², so that errors in the dark count. The light is that of the wavelets,
/// or less where the median of the noisy neighbours is: else light that leaks into the dark would excuse itself.
fn error_weight(light: &[ColorPlanes; 2], wavelets: &[ColorPlanes; 2], scale: &ColorPlanes) -> Plane {
    let guide = [0, 1, 2].map(|c| {
        let (own, noisy) = (mean(&wavelets[0][c], &wavelets[1][c]), median(&mean(&light[0][c], &light[1][c])));
        let mut plane = Plane::new(own.size);
        plane.fill(|x, y| own.at(x, y).min(noisy.at(x, y).max(0.1 * own.at(x, y))) * scale[c].at(x, y));
        plane
    });
    let (typical, light) = (typical(&guide), luminance(&guide));
    let mut weight = Plane::new(light.size);
    weight.fill(|x, y| 1.0 / (light.at(x, y) * light.at(x, y) + 0.01 * typical * typical + 1e-20));
    weight
}

/// Albedos above this one are those of lamps and of the background.
const LAMP: f32 = 0.999;
/// The ratio of a lamp's edge's albedo to the least one beside it.
const EDGE: f32 = 1.03;

/// 1 where lamps or the background fill a pixel, and on a lamp's edge. The largest component of their albedo is 1, as
/// that of nothing else. On an edge the albedo is above that of the wall beside it.
fn seen_directly(size: [usize; 2], features: &FeaturePlanes) -> Plane {
    let [red, green, blue] = &features.albedo;
    let largest = |x: usize, y: usize| red.at(x, y).max(green.at(x, y)).max(blue.at(x, y));
    let has_normal = |x: usize, y: usize| features.normal.iter().any(|n| n.at(x, y) != 0.0);
    let mut plane = Plane::new(size);
    plane.fill(|x, y| {
        let (mut least, mut is_beside_lamp) = (f32::INFINITY, false);
        for y in y.saturating_sub(1)..(y + 2).min(size[1]) {
            for x in x.saturating_sub(1)..(x + 2).min(size[0]) {
                least = least.min(largest(x, y));
                is_beside_lamp |= largest(x, y) > LAMP && has_normal(x, y);
            }
        }
        // A white medium has a depth, but no normal.
        let is_medium = features.nearness.at(x, y) > 0.0 && !has_normal(x, y);
        let is_filled = largest(x, y) > LAMP && !is_medium;
        if is_filled || is_beside_lamp && largest(x, y) > EDGE * least { 1.0 } else { 0.0 }
    });
    plane
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

/// A colour multiplied by another.
fn multiplied(color: ColorPlanes, by: &ColorPlanes) -> ColorPlanes {
    let mut color = color;
    for (plane, by) in color.iter_mut().zip(by) {
        plane.values.iter_mut().zip(&by.values).for_each(|(v, by)| *v *= by);
    }
    color
}

/// What a colour has more than another.
fn subtracted(color: &ColorPlanes, other: &ColorPlanes) -> ColorPlanes {
    let mut difference = color.clone();
    for (plane, other) in difference.iter_mut().zip(other) {
        plane.values.iter_mut().zip(&other.values).for_each(|(v, other)| *v -= other);
    }
    difference
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

/// (a + b)/2.
fn mean(a: &Plane, b: &Plane) -> Plane {
    let mut plane = Plane::new(a.size);
    plane.fill(|x, y| 0.5 * (a.at(x, y) + b.at(x, y)));
    plane
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
