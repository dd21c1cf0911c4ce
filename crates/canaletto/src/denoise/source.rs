//! What denoising reads of a picture: its light and its features, without numbers that are none.

use super::plane::Plane;
use super::repair::{FilledPixels, is_no_light, repaired};
use super::{LEAST_ALBEDO, NoisyPicture};
use crate::math::Rgb;
use canaletto_parallel::prelude::*;
use std::borrow::Cow;

/// A noisy picture as the filters see it: by the index of a pixel, in units of its typical light.
#[derive(Debug)]
pub(super) struct Source<'a> {
    pub(super) size: [usize; 2],
    color: Cow<'a, [Rgb]>,
    /// The halves of the samples; twice the same without halves.
    halves: [Cow<'a, [Rgb]>; 2],
    pub(super) has_halves: bool,
    albedo: Option<Cow<'a, [[f32; 3]]>>,
    normal: Option<Cow<'a, [[f32; 3]]>>,
    depth: Option<Cow<'a, [f32]>>,
    /// A power of two.
    pub(super) exposure: f32,
    /// The inverse of the mean nearness.
    nearness_scale: f64,
    pub(super) filled: FilledPixels,
}

/// The radius of the squares whose means are the albedo without its fine structure, and of those over which the light
/// is compared with it.
const SMOOTH: usize = 2;
const COMPARED: usize = 3;
/// The light shows none of the albedo's structure below the first share of it, and all of it from the second one on.
const SHOWN: [f32; 2] = [0.2, 0.7];
/// A pixel counts as at most this many times the mean of its neighbours, so that fireflies show no structure.
const MOST_DETAIL: f32 = 3.0;

/// Light above this many times the typical one counts as this much, so that squares don't overflow.
const MOST_LIGHT: f32 = 1e15;
/// The mean light counts up to this many medians as the typical one.
const MEAN_IN_MEDIANS: f64 = 1e6;

impl<'a> Source<'a> {
    pub(super) fn new(picture: &'a NoisyPicture) -> Source<'a> {
        let size = [picture.width as usize, picture.height as usize];
        let pixels = size[0] * size[1];
        let is_dark = |i: usize, values: &[Rgb]| is_no_light(size, values, i);
        let mut broken = Vec::new();
        let mut colors = |values: &'a [Rgb]| repaired(size, values, is_dark, &mut broken);
        let color = colors(&picture.color);
        let halves = match &picture.halves {
            Some([a, b]) => [colors(a), colors(b)],
            None => [color.clone(), color.clone()],
        };
        let mut filled =
            FilledPixels { colors: broken.iter().filter(|is_broken| **is_broken).count() as u64, features: 0 };
        let mut broken = Vec::new();
        let is_odd = |i: usize, values: &[[f32; 3]]| values[i].iter().any(|v| !v.is_finite());
        let albedo = picture.albedo.as_deref().map(|values| repaired(size, values, is_odd, &mut broken));
        let normal = picture.normal.as_deref().map(|values| repaired(size, values, is_odd, &mut broken));
        // The background's depth is infinite.
        let is_odd = |i: usize, values: &[f32]| values[i].is_nan() || values[i] < 0.0;
        let depth = picture.depth.as_deref().map(|values| repaired(size, values, is_odd, &mut broken));
        filled.features = broken.iter().filter(|is_broken| **is_broken).count() as u64;
        let mut source = Source {
            size,
            color,
            halves,
            has_halves: picture.halves.is_some(),
            albedo,
            normal,
            depth,
            exposure: 1.0,
            nearness_scale: 1.0,
            filled,
        };
        let mut light: Vec<f32> = (0..pixels).into_par_iter().map(|i| source.brightness(i)).collect();
        let mean = light.iter().map(|v| f64::from(*v)).sum::<f64>() / pixels as f64;
        light.retain(|light| *light > 0.0);
        let middle = light.len() / 2;
        if !light.is_empty() {
            let median = f64::from(*light.select_nth_unstable_by(middle, f32::total_cmp).1);
            source.exposure = exposure(mean.min(MEAN_IN_MEDIANS * median));
        }
        let nearness = (0..size[1])
            .into_par_iter()
            .map(|y| (y * size[0]..(y + 1) * size[0]).map(|i| f64::from(source.nearness(i))).sum::<f64>());
        // The rows are added in their order.
        let mean = nearness.collect().iter().sum::<f64>() / pixels as f64;
        if mean > 0.0 && mean.is_finite() {
            source.nearness_scale = 1.0 / mean;
        }
        source
    }

    /// Replaces the fine structure of the albedo by as much of it as the light shows, too: the regression of the
    /// light's structure on that of the albedo. Texture is in both. The rays of the features are others than those of
    /// the picture, so that the noise of lenses, coats and glass is in one of them only.
    ///
    /// What is seen `direct`ly keeps its albedo, by which lamps and their edges are known.
    pub(super) fn shrink_albedo(&mut self, direct: &[bool]) {
        let Some(albedo) = &self.albedo else { return };
        let color = |i: usize| {
            let [a, b] = [0, 1].map(|half: usize| self.halves[half][i].to_array());
            [0, 1, 2].map(|c: usize| (0.5 * (a[c] + b[c]) * self.exposure).min(MOST_LIGHT))
        };
        let smooth = |value: &(dyn Fn(usize) -> [f32; 3] + Sync)| {
            [0, 1, 2].map(|c: usize| Plane::of(self.size, |i| value(i)[c]).box_mean(SMOOTH))
        };
        let (colors, albedos) = (smooth(&color), smooth(&|i| albedo[i]));
        let detail = |v: f32, mean: f32| if mean > 0.0 { (v / mean).min(MOST_DETAIL) - 1.0 } else { 0.0 };
        let details = |i: usize| {
            let (color, albedo) = (color(i), albedo[i]);
            let of = |c: usize| [detail(color[c], colors[c].values[i]), detail(albedo[c], albedos[c].values[i])];
            [of(0), of(1), of(2)]
        };
        let compared = |value: &(dyn Fn(&[f32; 2]) -> f32 + Sync)| {
            Plane::of(self.size, |i| details(i).iter().map(value).sum()).box_mean(COMPARED).box_mean(1)
        };
        let (both, own) = (compared(&|[color, albedo]| color * albedo), compared(&|[_, albedo]| albedo * albedo));
        let shrunk = (0..albedo.len()).into_par_iter().map(|i| {
            let share = if own.values[i] > 1e-6 { both.values[i] / own.values[i] } else { 1.0 };
            let share = ((share - SHOWN[0]) / (SHOWN[1] - SHOWN[0])).clamp(0.0, 1.0);
            let kept = if direct[i] { 1.0 } else { share };
            [0, 1, 2].map(|c: usize| {
                let mean = albedos[c].values[i];
                mean + kept * (albedo[i][c] - mean)
            })
        });
        self.albedo = Some(Cow::Owned(shrunk.collect()));
    }

    /// A repaired copy of the picture that was read.
    pub(super) fn repaired(&self) -> NoisyPicture {
        let [width, height] = self.size.map(|length| length as u32);
        let halves = self.has_halves.then(|| self.halves.clone().map(Cow::into_owned));
        NoisyPicture {
            width,
            height,
            color: self.color.to_vec(),
            halves,
            albedo: self.albedo.as_ref().map(|values| values.to_vec()),
            normal: self.normal.as_ref().map(|values| values.to_vec()),
            depth: self.depth.as_ref().map(|values| values.to_vec()),
        }
    }

    /// The mean of the components of both halves, before exposure.
    fn brightness(&self, i: usize) -> f32 {
        let [a, b] = [0, 1].map(|half: usize| self.halves[half][i]);
        [a.r, a.g, a.b, b.r, b.g, b.b].iter().map(|v| v * (1.0 / 6.0)).sum()
    }

    /// The sum of the components of all pixels of both halves, halved.
    pub(super) fn total(&self) -> f64 {
        let sum = |half: usize| {
            let rows = self.halves[half].par_chunks(self.size[0]);
            let rows = rows.map(|row| row.iter().flat_map(|c| c.to_array()).map(f64::from).sum::<f64>());
            rows.collect().iter().sum::<f64>()
        };
        0.5 * (sum(0) + sum(1))
    }

    /// The colour of one half.
    #[inline(always)]
    pub(super) fn color(&self, half: usize, i: usize) -> [f32; 3] {
        self.halves[half][i].to_array().map(|v| (v * self.exposure).min(MOST_LIGHT))
    }

    /// What light is multiplied by to be a colour: the albedo.
    #[inline(always)]
    pub(super) fn scale(&self, i: usize) -> [f32; 3] {
        self.albedo.as_ref().map_or([1.0; 3], |albedo| albedo[i].map(|v| v.max(LEAST_ALBEDO)))
    }

    /// The colour of one half without the albedo.
    #[inline(always)]
    pub(super) fn light(&self, half: usize, i: usize) -> [f32; 3] {
        let (color, scale) = (self.color(half, i), self.scale(i));
        [0, 1, 2].map(|c: usize| color[c] / scale[c])
    }

    pub(super) fn has_normals(&self) -> bool {
        self.normal.is_some()
    }

    /// The albedo. A missing layer is one of zeros, which tells nothing.
    #[inline(always)]
    pub(super) fn albedo(&self, i: usize) -> [f32; 3] {
        self.albedo.as_ref().map_or([0.0; 3], |albedo| albedo[i].map(|v| v.clamp(0.0, 1.0)))
    }

    /// The square root of the albedo, whose differences tell lamps from what is dark around them.
    #[inline(always)]
    pub(super) fn root(&self, i: usize) -> [f32; 3] {
        self.albedo(i).map(f32::sqrt)
    }

    #[inline(always)]
    pub(super) fn normal(&self, i: usize) -> [f32; 3] {
        self.normal.as_ref().map_or([0.0; 3], |normal| normal[i].map(|v| v.clamp(-1.0, 1.0)))
    }

    /// The inverse of the depth, which is linear across a plane's picture; 0 for the background. The mean is 1.
    #[inline(always)]
    pub(super) fn nearness(&self, i: usize) -> f32 {
        let nearness = self.depth.as_ref().map_or(0.0, |depth| f64::from(finite(1.0 / depth[i])));
        (nearness * self.nearness_scale) as f32
    }
}

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
