//! The reconstruction filter of a picture with several rays for each pixel, and a hypothesis under that filter. Filters
//! are found by the picture's edges (Mitchell & Netravali, *Reconstruction Filters in Computer Graphics*, 1988).

use super::display::{displayed, srgb_decode};
use super::finding::neat_numbers;
use super::{Grader, Guess, thinned};
use crate::film::{filter_value, srgb_encode};
use crate::scene::{Developing, Filter, Transfer};
use canaletto_parallel::prelude::*;
use glam::DVec3;
use std::fmt;

/// A reconstruction filter: the same function along both axes.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum PictureFilter {
    /// The mean over a square with sides of twice this many pixels.
    Box(f64),
    /// A linear fall-off with this radius in pixels.
    Tent(f64),
    /// A Gaussian of this standard deviation in pixels, cut off at three of them.
    Gaussian(f64),
    /// Mitchell and Netravali's cubic with B = C = 1/3, with this radius in pixels.
    Mitchell(f64),
    /// The spline of Catmull and Rom, B = 0 and C = 1/2, with this radius in pixels.
    CatmullRom(f64),
}

use PictureFilter::{Box, CatmullRom, Gaussian, Mitchell, Tent};

/// The filters that are tried first. Their sizes are refined then.
const TRIED: [PictureFilter; 20] = [
    Box(0.5),
    Box(0.75),
    Box(1.0),
    Box(1.5),
    Tent(0.75),
    Tent(1.0),
    Tent(1.5),
    Tent(2.0),
    Gaussian(0.3),
    Gaussian(0.4),
    Gaussian(0.5),
    Gaussian(0.65),
    Gaussian(0.8),
    Gaussian(1.0),
    Mitchell(1.0),
    Mitchell(1.5),
    Mitchell(2.0),
    Mitchell(2.5),
    CatmullRom(1.5),
    CatmullRom(2.0),
];

/// What the rays of a pixel are when their mean is taken.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Averaged {
    /// Light of any strength.
    Light,
    /// Light that is cut off at 1.
    Clamped,
    /// Display values.
    Values,
}

/// A hypothesis under the filter that fits the picture best.
pub(super) struct Filtered {
    pub(super) filter: PictureFilter,
    /// Whether it is another one than the scene's, and explains the edges clearly better than the mean over each pixel.
    pub(super) is_other: bool,
    /// The display values of all pixels.
    pub(super) shown: Vec<DVec3>,
    /// The standard deviation of display values by the random places of rays.
    pub(super) noise: Vec<DVec3>,
    /// The number of pixels that share the noise of a ray: 1 / ∫ f², at least 1.
    pub(super) reach: f64,
}

/// The most rays of a hypothesis.
const MOST_RAYS: usize = 2_000_000;
/// The most rays along a pixel's side.
const MOST_SIDE: usize = 4;
/// The most edge pixels by which filters are compared.
const MOST_PROBED: usize = 1_000;
/// The largest difference in steps of 8 bits that an edge pixel counts with.
const MOST: f64 = 30.0;
/// The offset of the pixels' grid in pixels that is tried first, and the largest one along an axis.
const OFFSET: f64 = 0.25;
const MOST_OFFSET: f64 = 0.5;
/// The cost of another filter in parts of that of the pixel's mean up to which it is told.
const OTHER: f64 = 0.7;
/// The factor of a filter's reach up to which it is the scene's own.
const NEAR: f64 = 1.3;
/// The upper quartile of χ² with one degree of freedom.
const UPPER_QUARTILE: f64 = 1.323;

impl PictureFilter {
    /// The radius along each axis in pixels.
    pub fn radius(&self) -> f64 {
        match *self {
            Box(radius) | Tent(radius) | Mitchell(radius) | CatmullRom(radius) => radius,
            Gaussian(sigma) => 3.0 * sigma,
        }
    }

    /// The value at an offset along an axis, not normalised.
    fn value(&self, x: f64) -> f64 {
        let t = x.abs() / self.radius();
        match *self {
            _ if t > 1.0 => 0.0,
            Box(_) => 1.0,
            Tent(_) => 1.0 - t,
            Gaussian(sigma) => libm::exp(-0.5 * (x / sigma) * (x / sigma)),
            Mitchell(_) => filter_value(Filter::Mitchell, 2.0 * t),
            CatmullRom(_) => {
                let x = 2.0 * t;
                if x < 1.0 { (1.5 * x - 2.5) * x * x + 1.0 } else { ((-0.5 * x + 2.5) * x - 4.0) * x + 2.0 }
            }
        }
    }

    /// The number of pixels that share the noise of a ray: 1 / ∫ f², at least 1.
    fn reach(&self) -> f64 {
        const STEPS: usize = 64;
        let value = |i: usize| self.value(self.radius() * (2.0 * i as f64 + 1.0 - STEPS as f64) / STEPS as f64);
        let sum: f64 = (0..STEPS).map(value).sum();
        let squares: f64 = (0..STEPS).map(|i| value(i) * value(i)).sum();
        let along = 2.0 * self.radius() / STEPS as f64 * sum * sum / squares;
        (along * along).max(1.0)
    }

    fn resized(&self, factor: f64) -> PictureFilter {
        match *self {
            Box(radius) => Box(radius * factor),
            Tent(radius) => Tent(radius * factor),
            Gaussian(sigma) => Gaussian(sigma * factor),
            Mitchell(radius) => Mitchell(radius * factor),
            CatmullRom(radius) => CatmullRom(radius * factor),
        }
    }
}

impl From<Filter> for PictureFilter {
    fn from(filter: Filter) -> PictureFilter {
        match filter {
            Filter::Box => Box(0.5),
            Filter::Tent => Tent(1.0),
            Filter::Gaussian { sigma } => Gaussian(f64::from(sigma)),
            Filter::Mitchell => Mitchell(2.0),
        }
    }
}

impl fmt::Display for PictureFilter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let neat = |v: f64| neat_numbers(&[(v * 20.0).round() / 20.0]);
        match *self {
            Box(radius) => write!(f, "a box of radius {} pixels", neat(radius)),
            Tent(radius) => write!(f, "a tent of radius {} pixels", neat(radius)),
            Gaussian(sigma) => write!(f, "a Gaussian of standard deviation {} pixels", neat(sigma)),
            Mitchell(radius) => write!(f, "Mitchell's filter of radius {} pixels", neat(radius)),
            CatmullRom(radius) => write!(f, "a Catmull-Rom spline of radius {} pixels", neat(radius)),
        }
    }
}

/// Rays on a grid, `side` × `side` in each pixel, in rows from the top.
struct Rays {
    side: usize,
    size: [usize; 2],
    colors: Vec<DVec3>,
}

/// A way to make pixels of rays.
#[derive(Clone, Copy)]
struct Way {
    filter: PictureFilter,
    averaged: Averaged,
    /// The offset of the filter's centre from the pixel's, to the right and downwards.
    offset: [f64; 2],
}

/// The mean of a pixel's rays, and their variance.
#[derive(Clone, Copy)]
struct Moments {
    mean: DVec3,
    variance: DVec3,
}

impl Rays {
    /// The weights of rays along an axis, by their offsets from a pixel's first ray.
    fn taps(&self, filter: PictureFilter, offset: f64) -> Vec<(isize, f64)> {
        /// The places in a ray's cell whose mean is taken.
        const PLACES: usize = 8;
        let (side, middle) = (self.side as f64, 0.5 + offset);
        let first = ((middle - filter.radius()) * side).floor() as isize;
        let last = ((middle + filter.radius()) * side).ceil() as isize;
        let weight = |i: isize| {
            let place = |k: usize| (i as f64 + (k as f64 + 0.5) / PLACES as f64) / side - middle;
            (0..PLACES).map(|k| filter.value(place(k))).sum::<f64>() / PLACES as f64
        };
        (first..=last).map(|i| (i, weight(i))).filter(|(_, weight)| *weight != 0.0).collect()
    }

    /// The moments of pixels.
    fn moments(&self, filter: PictureFilter, offset: [f64; 2], pixels: &[u32]) -> Vec<Moments> {
        let [columns, rows] = offset.map(|offset| self.taps(filter, offset));
        let [w, h] = self.size;
        let width = w / self.side;
        let at = |first: usize, off: isize, most: usize| first.checked_add_signed(off).filter(|at| *at < most);
        let moments = |index: &u32| {
            let (x, y) = (*index as usize % width * self.side, *index as usize / width * self.side);
            let (mut sum, mut squares, mut all) = (DVec3::ZERO, DVec3::ZERO, [0.0; 2]);
            // About the pixel's own ray, where nothing cancels.
            let own = self.colors[y * w + x];
            for (row, v) in &rows {
                let Some(y) = at(y, *row, h) else { continue };
                for (column, u) in &columns {
                    let Some(x) = at(x, *column, w) else { continue };
                    let (weight, d) = (u * v, self.colors[y * w + x] - own);
                    sum += d * weight;
                    squares += d * d * weight.abs();
                    all = [all[0] + weight, all[1] + weight.abs()];
                }
            }
            let mean = sum / all[0];
            // Σ |w| (d − m)² / Σ w, with m for the mean of all parts.
            let variance = (squares / all[0] - mean * mean).max(DVec3::ZERO);
            Moments { mean: own + mean, variance }
        };
        pixels.par_iter().with_min_len(64).map(moments).collect()
    }
}

impl Grader<'_> {
    /// A hypothesis under the filter that fits the picture best; none if each pixel has one ray, if the picture is
    /// compressed, or if it is too large.
    pub(super) fn filtered(&self, guess: &Guess<'_>) -> Option<Filtered> {
        let [_, _, width, height] = self.job.window();
        let count = width as usize * height as usize;
        let side = (2..=MOST_SIDE).rev().find(|side| count * side * side <= MOST_RAYS)?;
        let edges: Vec<u32> = (0u32..).zip(&self.edges).filter(|(_, edge)| **edge).map(|(index, _)| index).collect();
        if self.is_sharp || self.student.is_compressed() || edges.is_empty() {
            return None;
        }
        let probed = thinned(&edges, MOST_PROBED);
        let light = self.rays(guess, side);
        let developing = self.job.developing();
        let shown = displayed(&light.colors, &developing, &guess.settings);
        let is_curved = developing.transfer == Transfer::Srgb;
        let decoded = |v: &DVec3| DVec3::from(v.to_array().map(srgb_decode));
        let clamped = if is_curved { shown.iter().map(decoded).collect() } else { shown.clone() };
        let of = |colors: Vec<DVec3>| Rays { colors, ..light };
        let mut all = vec![(Averaged::Clamped, of(clamped))];
        if is_curved {
            all.push((Averaged::Values, of(shown)));
        }
        all.insert(0, (Averaged::Light, Rays { colors: light.colors, ..light }));
        let rays_of = |averaged: Averaged| all.iter().find(|(own, _)| *own == averaged).map_or(&all[0].1, |(_, r)| r);
        let value = |averaged: Averaged, mean: &[DVec3]| self.developed(averaged, mean, &developing, guess);
        let cost = |way: Way| {
            let moments = rays_of(way.averaged).moments(way.filter, way.offset, &probed);
            let means: Vec<DVec3> = moments.iter().map(|moments| moments.mean).collect();
            let shown = value(way.averaged, &means);
            let errors = shown.iter().zip(&probed).map(|(shown, pixel)| {
                let d = (*shown - self.student_value(*pixel)).abs().max_element() * 255.0;
                if d.is_nan() { MOST } else { d.min(MOST) }
            });
            errors.sum::<f64>() / probed.len() as f64
        };
        let ways = all
            .iter()
            .flat_map(|(averaged, _)| TRIED.map(|filter| Way { filter, averaged: *averaged, offset: [0.0; 2] }));
        let better = |best: (f64, Way), way: Way| {
            let cost = cost(way);
            // A tie is the first one's.
            if cost < 0.99 * best.0 { (cost, way) } else { best }
        };
        let plain = Way { filter: Box(0.5), averaged: Averaged::Light, offset: [0.0; 2] };
        let of_plain = cost(plain);
        let mut best = ways.fold((of_plain, plain), better);
        let moved = |way: Way, step: [f64; 2]| {
            let offset = [0, 1].map(|i| (way.offset[i] + step[i]).clamp(-MOST_OFFSET, MOST_OFFSET));
            Way { offset, ..way }
        };
        let mut step = OFFSET;
        let mut resized = 1.2;
        for _ in 0..4 {
            for direction in [[step, 0.0], [-step, 0.0], [0.0, step], [0.0, -step]] {
                best = better(best, moved(best.1, direction));
            }
            for factor in [resized, 1.0 / resized] {
                best = better(best, Way { filter: best.1.filter.resized(factor), ..best.1 });
            }
            step *= 0.5;
            resized = f64::sqrt(resized);
        }
        // Another kind may fit better at another place of the grid.
        let others = TRIED.map(|filter| Way { filter, ..best.1 });
        let (least, way) = others.into_iter().fold(best, better);
        let pixels: Vec<u32> = (0..width * height).collect();
        let moments = rays_of(way.averaged).moments(way.filter, way.offset, &pixels);
        let means: Vec<DVec3> = moments.iter().map(|moments| moments.mean).collect();
        let shown = value(way.averaged, &means);
        let ends = [1.0, -1.0].map(|sign| {
            let end = |m: &Moments| m.mean + sign * DVec3::from(m.variance.to_array().map(f64::sqrt));
            value(way.averaged, &moments.iter().map(end).collect::<Vec<_>>())
        });
        let mut noise: Vec<DVec3> = ends[0].iter().zip(&ends[1]).map(|(a, b)| (*a - *b).abs() * 0.5).collect();
        let share = f64::sqrt(self.share_of_variance(&shown, &noise, &edges));
        noise.iter_mut().for_each(|v| *v *= share);
        let reach = way.filter.reach();
        let wider = reach / PictureFilter::from(self.job.film.filter).reach();
        let is_other = least < OTHER * of_plain && !(1.0 / NEAR..NEAR).contains(&wider);
        Some(Filtered { filter: way.filter, is_other, shown, noise, reach })
    }

    fn student_value(&self, pixel: u32) -> DVec3 {
        DVec3::from(self.student.pixels[pixel as usize].map(f64::from))
    }

    /// The display values of means.
    fn developed(&self, averaged: Averaged, mean: &[DVec3], developing: &Developing, guess: &Guess<'_>) -> Vec<DVec3> {
        let encoded = |v: f64| f64::from(srgb_encode(v.clamp(0.0, 1.0) as f32));
        let of_clamped = |v: &DVec3| match developing.transfer {
            Transfer::Srgb => DVec3::from(v.to_array().map(encoded)),
            _ => v.clamp(DVec3::ZERO, DVec3::ONE),
        };
        match averaged {
            Averaged::Light => displayed(mean, developing, &guess.settings),
            Averaged::Clamped => mean.iter().map(of_clamped).collect(),
            Averaged::Values => mean.iter().map(|v| v.clamp(DVec3::ZERO, DVec3::ONE)).collect(),
        }
    }

    /// The share of the rays' variance that the picture has, by the upper quartile over its edges: 1 / n of n random
    /// rays.
    fn share_of_variance(&self, shown: &[DVec3], deviation: &[DVec3], edges: &[u32]) -> f64 {
        const LEAST: f64 = 4.0 / 255.0;
        let ratio = |pixel: &u32| {
            let i = *pixel as usize;
            let (d, deviation) = ((shown[i] - self.student_value(*pixel)).length(), deviation[i].length());
            (deviation >= LEAST).then(|| (d / deviation) * (d / deviation))
        };
        let mut ratios: Vec<f64> = edges.iter().filter_map(ratio).filter(|ratio| !ratio.is_nan()).collect();
        if ratios.is_empty() {
            return 0.0;
        }
        let at = ratios.len() * 3 / 4;
        let (_, quartile, _) = ratios.select_nth_unstable_by(at, f64::total_cmp);
        (*quartile / UPPER_QUARTILE).min(1.0)
    }

    /// Rays on a grid. Pixels among equal ones have one colour.
    fn rays(&self, guess: &Guess<'_>, side: usize) -> Rays {
        /// The difference of neighbours from which on their rays are traced.
        const VARIED: f64 = 0.5 / 255.0;
        let [_, _, width, height] = self.job.window();
        let (w, h) = (width as usize, height as usize);
        let (seen, settings) = (self.seen_of(guess), guess.settings);
        let centers: Vec<(u32, [f64; 2])> = (0..width * height).map(|index| (index, [0.5; 2])).collect();
        let colors = self.colors(seen, settings, &centers, false);
        let around = |at: usize, side: usize| at.saturating_sub(1)..(at + 2).min(side);
        let is_varied = |index: &u32| {
            let i = *index as usize;
            let differs = |j: usize| (colors[j] - colors[i]).abs().max_element() > VARIED;
            self.edges[i] || around(i / w, h).any(|y| around(i % w, w).any(|x| differs(y * w + x)))
        };
        let varied: Vec<u32> = (0..width * height).filter(is_varied).collect();
        // y grows upwards inside of pixels.
        let place = |k: usize| {
            let at = |k: usize| (k as f64 + 0.5) / side as f64;
            [at(k % side), 1.0 - at(k / side)]
        };
        let places: Vec<(u32, [f64; 2])> =
            varied.iter().flat_map(|index| (0..side * side).map(|k| (*index, place(k)))).collect();
        let finer = self.colors(seen, settings, &places, false);
        let mut all = vec![DVec3::ZERO; w * h * side * side];
        let at = |i: usize, k: usize| (i / w * side + k / side) * w * side + i % w * side + k % side;
        for (i, color) in colors.iter().enumerate() {
            (0..side * side).for_each(|k| all[at(i, k)] = *color);
        }
        for (n, index) in varied.iter().enumerate() {
            (0..side * side).for_each(|k| all[at(*index as usize, k)] = finer[n * side * side + k]);
        }
        Rays { side, size: [w * side, h * side], colors: all }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The weights along an axis sum to what ∫ f is in cells, and are symmetric.
    #[test]
    fn filters_are_symmetric() {
        let rays = Rays { side: 4, size: [4, 4], colors: vec![DVec3::ZERO; 16] };
        for filter in TRIED {
            let taps = rays.taps(filter, 0.0);
            let mean: f64 = taps.iter().map(|(i, weight)| (*i as f64 - 1.5) * weight).sum();
            assert!(mean.abs() < 1e-9, "{filter}: {taps:?}");
            assert!(taps.iter().map(|(_, weight)| weight).sum::<f64>() > 0.0, "{filter}");
        }
        assert_eq!(rays.taps(Box(0.5), 0.0), [(0, 1.0), (1, 1.0), (2, 1.0), (3, 1.0)]);
    }

    /// ∫ f² of a tent is 2/3 along each axis, and that of a Gaussian 1 / (2 √π σ).
    #[test]
    fn noise_is_shared() {
        assert!((Tent(1.0).reach() - 2.25).abs() < 0.01, "{}", Tent(1.0).reach());
        assert!((Gaussian(0.5).reach() - std::f64::consts::PI).abs() < 0.05, "{}", Gaussian(0.5).reach());
        assert_eq!([Box(0.5).reach(), Box(0.3).reach()], [1.0; 2]);
    }

    /// A ramp keeps its values under any filter of radius 1 and less, and its variance under the box is (b − a)² / 12.
    #[test]
    fn ramps_stay() {
        let (side, width) = (4, 5);
        let colors = (0..side * width * side * width).map(|i| DVec3::splat((i % (side * width)) as f64)).collect();
        let rays = Rays { side, size: [side * width; 2], colors };
        for filter in [Box(0.5), Tent(1.0), Mitchell(2.0)] {
            let moments = rays.moments(filter, [0.0; 2], &[12]);
            assert!((moments[0].mean.x - 9.5).abs() < 1e-9, "{filter} {}", moments[0].mean);
        }
        let variance = rays.moments(Box(0.5), [0.0; 2], &[12])[0].variance.x;
        assert!((variance - 1.25).abs() < 1e-9, "{variance}");
    }
}
