//! Denoising: from a noisy picture and what is known of its surfaces to one without noise.
//!
//! 1. Outliers are lowered, which one half of the samples met alone, or both by chance. Their light is spread over
//!    their surroundings after the filters, in proportion to the light there, and so far that it isn't seen. How much
//!    there was is reported.
//! 2. Light is divided by the albedo, so that textures are no edges.
//! 3. Two filters average what belongs together: à-trous wavelets, which are fast, and first-order regression. Islands
//!    that the wavelets leave in one half alone are spread like outliers.
//! 4. Each pixel takes the filter of the least relative error, or none. Each half of the samples estimates the errors
//!    of what the other half became. Lamps and the background, where they fill a pixel, stay as they are.
//!
//! Pixels that are no light, such as NaN, are filled from those around them first. Everything is deterministic and the
//! same for any number of threads.
//!
//! A step hands planes of numbers to the next one, at most about 105 bytes for a pixel, and reads the picture itself
//! where it stands.

mod atrous;
mod choice;
mod outliers;
mod plane;
mod regression;
mod repair;
mod source;
#[cfg(test)]
mod tests;
mod variance;

use crate::math::Rgb;
use crate::named;
use atrous::atrous;
use canaletto_parallel::prelude::*;
use choice::{choose, square_error};
use outliers::{SpreadLight, lowered_windows, lowering, median, removed_light, spread_outliers};
use plane::{ColorPlanes, Plane, strips};
use regression::RegressedHalf;
pub use repair::FilledPixels;
use source::Source;
use std::ops::ControlFlow;
use variance::variance;

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

impl NoisyPicture {
    /// The picture with what surrounds them in the place of pixels that are no light, and of features that are no
    /// numbers; and how many these are.
    pub fn repaired(&self) -> (NoisyPicture, FilledPixels) {
        let source = Source::new(self);
        (source.repaired(), source.filled)
    }
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
    /// The pixels that were filled from those around them.
    pub filled: FilledPixels,
}

impl DenoisedPicture {
    /// A picture that another denoiser made.
    pub fn by_another(name: &'static str, color: Vec<Rgb>) -> DenoisedPicture {
        DenoisedPicture {
            color,
            outlier_light: 0.0,
            lost_light: 0.0,
            filters: vec![(name, 1.0)],
            filled: FilledPixels::default(),
        }
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
    let mut source = Source::new(picture);
    let direct = seen_directly(&source);
    source.shrink_albedo(&direct);
    let source = &source;
    let size = source.size;
    let factors = lowering(source);
    step(go_on, 0.1)?;
    let [red, green, blue, brightness] = variance(source, &factors);
    let variance = (quality == DenoiseQuality::Good && source.has_halves).then_some([red, green, blue]);
    step(go_on, 0.2)?;
    let wavelets = atrous(source, &factors, &brightness);
    drop(brightness);
    let (wavelets, excess) = confirmed(wavelets);
    step(go_on, 0.3)?;
    let spread = [0, 1].map(|half| Spread::new(source, half, &factors, &wavelets[half], &excess[half], &direct));
    let by_wavelets = |half: usize, i: usize| {
        let own = colored(source, &wavelets[half], i);
        added(own, spread[half].at(source, &wavelets[half], &direct, i))
    };
    let halves = |i: usize| [source.color(0, i), source.color(1, i)];
    // Without halves nothing can estimate errors. Wavelets blur the least.
    let (mut names, mut errors, mut fitted) = (vec!["wavelets"], Vec::new(), None);
    let weight = error_weight(source, &factors, &wavelets);
    if source.has_halves {
        let error = |i: usize, filtered| square_error(halves(i), filtered) * weight.values[i];
        // Before the halves confirm each other, they are independent, which the estimate of errors needs.
        let before = |half: usize, i: usize| added(by_wavelets(half, i), colored(source, &excess[half], i));
        let of_wavelets = Plane::of(size, |i| error(i, [before(0, i), before(1, i)]));
        drop(excess);
        names.insert(0, "noisy");
        errors.push(Plane::of(size, |i| error(i, halves(i))));
        if let Some(variance) = variance {
            names.insert(1, "regression");
            let [half_a, half_b] = [0, 1].map(|half| {
                let variance = variance.each_ref();
                RegressedHalf { source, half, factors: &factors, variance }
            });
            let made = |half: usize, i: usize, fitted: [f32; 3]| {
                let own = within(fitted, &wavelets[half], i);
                let (scale, own) = (source.scale(i), own);
                added([0, 1, 2].map(|c: usize| own[c] * scale[c]), spread[half].at(source, &wavelets[half], &direct, i))
            };
            let mut colors = vec![[0.0; 3]; size[0] * size[1]];
            half_a.regress(&|| go_on(0.4), |y, rows| {
                let first = y * size[0];
                let out = colors[first..first + rows.len()].par_iter_mut().zip(rows).enumerate();
                out.for_each(|(i, (color, fitted))| *color = made(0, first + i, *fitted));
            })?;
            let mut own_errors = Plane::new(size);
            half_b.regress(&|| go_on(0.7), |y, rows| {
                let first = y * size[0];
                let errors = &mut own_errors.values[first..first + rows.len()];
                let out = colors[first..first + rows.len()].par_iter_mut().zip(errors).zip(rows).enumerate();
                out.for_each(|(i, ((color, own_error), fitted))| {
                    let filtered = [*color, made(1, first + i, *fitted)];
                    *own_error = error(first + i, filtered);
                    *color = mean(filtered);
                });
            })?;
            errors.push(own_errors);
            fitted = Some(colors);
        }
        errors.push(of_wavelets);
    } else {
        errors.push(Plane::new(size));
    }
    drop(weight);
    step(go_on, 0.9)?;
    let of_candidate = |candidate: usize, i: usize| match (names[candidate], &fitted) {
        ("noisy", _) => mean(halves(i)),
        ("regression", Some(colors)) => colors[i],
        _ => mean([by_wavelets(0, i), by_wavelets(1, i)]),
    };
    let shown = |candidate: usize, i: usize| of_candidate(candidate, i).map(|v| (v / source.exposure).max(0.0));
    let (color, shares) = choose(errors, shown, &direct);
    let removed = 0.5 * (removed_light(source, 0, &factors[0]) + removed_light(source, 1, &factors[1]));
    let lost = 0.5 * (spread[0].lost + spread[1].lost);
    let total = source.total() * f64::from(source.exposure);
    let share = |light: f64| if light > 0.0 && total > 0.0 { light / total } else { 0.0 };
    ControlFlow::Continue(DenoisedPicture {
        color,
        outlier_light: share(removed),
        lost_light: share(lost),
        filters: names.into_iter().zip(shares).collect(),
        filled: source.filled,
    })
}

/// Each filtered half within the range of the other one's 5 × 5 pixels, and what that took. Where one half met a few
/// bright samples too many, wavelets leave an island of 3 × 3 pixels, which the other half doesn't show.
fn confirmed(filtered: [ColorPlanes; 2]) -> ([ColorPlanes; 2], [ColorPlanes; 2]) {
    let kept = [0, 1].map(|half: usize| {
        [0, 1, 2].map(|c: usize| {
            let (own, other) = (&filtered[half][c], &filtered[1 - half][c]);
            Plane::of(own.size, |i| within_plane(own.values[i], other, i))
        })
    });
    let mut excess = filtered;
    for (excess, kept) in excess.iter_mut().flatten().zip(kept.iter().flatten()) {
        excess.values.iter_mut().zip(&kept.values).for_each(|(v, kept)| *v -= kept);
    }
    (kept, excess)
}

/// The least and the most light, in units of the typical light, that takes light of outliers in proportion.
const TAKEN: [f32; 2] = [1e-3, 4.0];
/// See [`typical`].
const BRIGHTEST: f32 = 30.0;

/// The light of the outliers of one half, spread.
struct Spread {
    light: SpreadLight,
    /// The typical light, by which pixels take.
    typical: f32,
    lost: f64,
}

impl Spread {
    fn new(
        source: &Source<'_>,
        half: usize,
        factors: &[Plane; 2],
        wavelets: &ColorPlanes,
        excess: &ColorPlanes,
        direct: &[bool],
    ) -> Spread {
        let brightness = |i: usize| {
            let [r, g, b] = colored(source, wavelets, i);
            (r + g + b) * (1.0 / 3.0)
        };
        let typical = typical(&Plane::of(source.size, brightness));
        let removed = |i: usize| {
            let (color, excess) = (source.color(half, i), colored(source, excess, i));
            [0, 1, 2].map(|c: usize| color[c] * (1.0 - factors[half].values[i]) + excess[c])
        };
        let takers = |i: usize| taken(source, wavelets, typical, direct, i);
        let (light, lost) = spread_outliers(source.size, removed, takers);
        Spread { light, typical, lost }
    }

    /// The light that a pixel takes.
    #[inline(always)]
    fn at(&self, source: &Source<'_>, wavelets: &ColorPlanes, direct: &[bool], i: usize) -> [f32; 3] {
        let (taken, shares) = (taken(source, wavelets, self.typical, direct, i), self.light.at(i));
        [0, 1, 2].map(|c: usize| taken[c] * shares[c])
    }
}

/// What a pixel may take of the light of outliers, in proportion. What is seen directly takes none.
#[inline(always)]
fn taken(source: &Source<'_>, wavelets: &ColorPlanes, typical: f32, direct: &[bool], i: usize) -> [f32; 3] {
    if direct[i] {
        return [0.0; 3];
    }
    colored(source, wavelets, i).map(|light| light.clamp(TAKEN[0] * typical, TAKEN[1] * typical))
}

/// Filtered light with the albedo.
#[inline(always)]
fn colored(source: &Source<'_>, light: &ColorPlanes, i: usize) -> [f32; 3] {
    let scale = source.scale(i);
    [0, 1, 2].map(|c: usize| light[c].values[i] * scale[c])
}

#[inline(always)]
fn added(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// The mean of both halves.
#[inline(always)]
fn mean([a, b]: [[f32; 3]; 2]) -> [f32; 3] {
    [0, 1, 2].map(|c: usize| 0.5 * (a[c] + b[c]))
}

/// The mean of the light, where what is far brighter than the median counts no more than [`BRIGHTEST`] medians.
fn typical(light: &Plane) -> f32 {
    let mut lit: Vec<f32> = light.values.iter().copied().filter(|light| *light > 0.0).collect();
    if lit.is_empty() {
        return 1.0;
    }
    let middle = lit.len() / 2;
    let most = BRIGHTEST * *lit.select_nth_unstable_by(middle, f32::total_cmp).1;
    (light.values.iter().map(|light| f64::from(light.min(most))).sum::<f64>() / light.values.len() as f64) as f32
}

/// What the square of an error counts: 1 / light², so that errors in the dark count. The light is that of the wavelets,
/// or less where the median of the noisy neighbours is: else light that leaks into the dark would excuse itself.
fn error_weight(source: &Source<'_>, factors: &[Plane; 2], wavelets: &[ColorPlanes; 2]) -> Plane {
    let mut weight = Plane::new(source.size);
    strips([&mut weight]).into_par_iter().for_each(|strip| {
        for part in strip.parts(source.size) {
            let mut light = lowered_windows(source, factors, &part, 1);
            let (halves, others) = light.split_at_mut(3);
            for (a, b) in halves.iter_mut().zip(others) {
                a.values.iter_mut().zip(&b.values).for_each(|(a, b)| *a = 0.5 * (*a + b));
            }
            let inside = part.inside(1);
            for y in 0..part.size[1] {
                for (x, v) in strip.rows[0][part.row(y)].iter_mut().enumerate() {
                    let i = part.index(x, y);
                    let scale = source.scale(i);
                    let guide = [0, 1, 2].map(|c: usize| {
                        let own = 0.5 * (wavelets[0][c].values[i] + wavelets[1][c].values[i]);
                        own.min(median(&halves[c], &inside, x, y).max(0.1 * own)) * scale[c]
                    });
                    *v = (guide[0] + guide[1] + guide[2]) * (1.0 / 3.0);
                }
            }
        }
    });
    let typical = typical(&weight);
    weight.values.iter_mut().for_each(|v| *v = 1.0 / (*v * *v + 0.01 * typical * typical + 1e-20));
    weight
}

/// Albedos above this one are those of lamps and of the background.
const LAMP: f32 = 0.999;
/// The ratio of a lamp's edge's albedo to the least one beside it.
const EDGE: f32 = 1.03;

/// Where lamps or the background fill a pixel, and a lamp's edge. The largest component of their albedo is 1, as that
/// of nothing else. On an edge the albedo is above that of the wall beside it.
fn seen_directly(source: &Source<'_>) -> Vec<bool> {
    let size = source.size;
    let largest = |i: usize| source.albedo(i).into_iter().fold(0.0, f32::max);
    let has_normal = |i: usize| source.normal(i).iter().any(|n| *n != 0.0);
    let is_direct = |i: usize| {
        let (x, y, own) = (i % size[0], i / size[0], largest(i));
        // A white medium has a depth, but no normal.
        let is_medium = source.nearness(i) > 0.0 && !has_normal(i);
        if own > LAMP && !is_medium {
            return true;
        }
        let (mut least, mut is_beside_lamp) = (f32::INFINITY, false);
        for y in y.saturating_sub(1)..(y + 2).min(size[1]) {
            for x in x.saturating_sub(1)..(x + 2).min(size[0]) {
                let other = y * size[0] + x;
                least = least.min(largest(other));
                is_beside_lamp |= largest(other) > LAMP && has_normal(other);
            }
        }
        is_beside_lamp && own > EDGE * least
    };
    (0..size[0] * size[1]).into_par_iter().map(is_direct).collect()
}

fn step(go_on: &(dyn Fn(f64) -> bool + Sync), share: f64) -> ControlFlow<()> {
    if go_on(share) { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
}

/// A fitted pixel, kept to the range of the 5 × 5 pixels of another picture that surround it. A linear fit may lead
/// beyond it.
fn within(fitted: [f32; 3], other: &ColorPlanes, i: usize) -> [f32; 3] {
    [0, 1, 2].map(|c: usize| within_plane(fitted[c], &other[c], i))
}

/// A value, kept to the range of the 5 × 5 pixels of a plane.
fn within_plane(v: f32, other: &Plane, i: usize) -> f32 {
    let [width, height] = other.size;
    let (x, y) = (i % width, i / width);
    let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
    for y in y.saturating_sub(2)..(y + 3).min(height) {
        for v in &other.values[y * width + x.saturating_sub(2)..=y * width + (x + 2).min(width - 1)] {
            (low, high) = (low.min(*v), high.max(*v));
        }
    }
    v.clamp(low, high)
}
