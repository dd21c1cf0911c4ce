//! The filter of quality: first-order regression on features (Bitterli et al. 2016, *Nonlinearly Weighted First-Order
//! Regression for Denoising Monte Carlo Renderings*), with weights of non-local means (Rousselle, Knaus & Zwicker
//! 2012).
//!
//! Around each anchor pixel, light is fitted as a linear function of place, normal, albedo and nearness. Each fit
//! predicts all pixels of its window, and a pixel is the weighted mean of its predictions. Deviations: there is one
//! pass of weights instead of two, anchors stand on every other row only, and small features are damped (ridge) instead
//! of filtered.
#![allow(clippy::needless_range_loop)] // Lanes of several arrays go in step.

use super::outliers::lowered;
use super::plane::{LANES, Lanes, Part, Plane, Window, falloff};
use super::source::Source;
use canaletto_bvh::{InstructionSet, Kernel};
use canaletto_parallel::prelude::*;
use std::ops::ControlFlow;

/// The window is (2 RADIUS + 1)² pixels.
const RADIUS: usize = 7;
const SIDE: usize = 2 * RADIUS + 1;
const WINDOW: usize = SIDE * SIDE;
/// Patches of (2 PATCH + 1)² pixels are compared.
const PATCH: usize = 3;
/// The tolerance for differences between patches in standard deviations, squared.
const TOLERANCE: f32 = 0.12;
/// The distance between rows of anchors.
const ROWS: usize = 2;
/// The width and the height of the parts of the picture that one task takes anchors from.
const PART: [usize; 2] = [256, 16];
/// The number of parts for each thread whose predictions are kept at a time.
const PARTS_OF_THREAD: usize = 16;
/// 1, two of place, three of the normal, three of the albedo, one of nearness.
const TERMS: usize = 10;
/// The number of products of two terms.
const PRODUCTS: usize = TERMS * (TERMS + 1) / 2;
/// Features that vary by less than this count little: place in windows, normal, albedo, nearness.
const RIDGE: [f32; TERMS] = [0.0, 0.1, 0.1, 0.05, 0.05, 0.05, 0.05, 0.05, 0.05, 0.02];

/// The light of one half, and what its filter needs to know.
#[derive(Clone, Copy)]
pub(super) struct RegressedHalf<'a> {
    pub(super) source: &'a Source<'a>,
    pub(super) half: usize,
    /// What lowers outliers.
    pub(super) factors: &'a [Plane; 2],
    /// The variance of red, green and blue.
    pub(super) variance: [&'a Plane; 3],
}

impl RegressedHalf<'_> {
    /// Calls `fitted` with rows of the filtered light, from `y` on, as many rows at a time as memory allows. It stops
    /// when `go_on` says so.
    pub(super) fn regress(
        &self,
        go_on: &(dyn Fn() -> bool + Sync),
        mut fitted: impl FnMut(usize, &[[f32; 3]]),
    ) -> ControlFlow<()> {
        let size @ [width, height] = self.source.size;
        let columns = width.div_ceil(PART[0]);
        let bands = (PARTS_OF_THREAD * rayon::current_num_threads()).div_ceil(columns);
        // Predictions reach RADIUS beyond a band, so the last band of one turn has a part in the next one.
        let mut last: Option<Vec<Predictions>> = None;
        for first in (0..height).step_by(bands * PART[1]) {
            let tops: Vec<usize> = (first..height.min(first + bands * PART[1])).step_by(PART[1]).collect();
            let parts: Vec<Part> = tops
                .iter()
                .flat_map(|top| (0..width).step_by(PART[0]).map(|left| [left, *top]))
                .map(|at| Part { picture: size, at, size: [0, 1].map(|axis| PART[axis].min(size[axis] - at[axis])) })
                .collect();
            let predicted = parts.par_iter().map(|part| go_on().then(|| self.predict(*part)));
            let Some(predicted) = predicted.collect().into_iter().collect::<Option<Vec<Predictions>>>() else {
                return ControlFlow::Break(());
            };
            let mut all = last.take().unwrap_or_default();
            all.extend(predicted);
            let end = if first + bands * PART[1] < height { first + bands * PART[1] - RADIUS } else { height };
            let start = first.saturating_sub(RADIUS);
            let mut rows = vec![[0.0; 3]; (end - start) * width];
            rows.par_chunks_mut(width).enumerate().for_each(|(row, pixels)| {
                let y = start + row;
                let near: Vec<&Predictions> = all.iter().filter(|predictions| predictions.reaches(y)).collect();
                for (x, pixel) in pixels.iter_mut().enumerate() {
                    let mut sums = [0.0; 4];
                    near.iter().for_each(|predictions| predictions.add(x, y, &mut sums));
                    let scale = if sums[3] > 0.0 { 1.0 / sums[3] } else { 0.0 };
                    *pixel = match sums[3] > 0.0 {
                        true => [sums[0] * scale, sums[1] * scale, sums[2] * scale],
                        false => lowered(self.source, self.half, self.factors, y * width + x),
                    };
                }
            });
            fitted(start, &rows);
            last = Some(all.split_off(all.len() - columns));
        }
        ControlFlow::Continue(())
    }

    /// What the anchors of a part predict.
    fn predict(&self, part: Part) -> Predictions {
        let RegressedHalf { source, half, factors, variance } = *self;
        let [a, b, c, d, e, f] = part.mirrored(RADIUS + PATCH, |i| {
            let [a, b, c] = lowered(source, half, factors, i);
            let [d, e, f] = variance.map(|plane| plane.values[i]);
            [a, b, c, d, e, f]
        });
        let guide = PatchGuide { color: [a, b, c], variance: [d, e, f] };
        let features = part.windows(RADIUS + PATCH, |i| {
            let ([a, b, c], [d, e, f]) = (source.normal(i), source.albedo(i));
            [a, b, c, d, e, f, source.nearness(i)]
        });
        let inside = part.inside(RADIUS + PATCH);
        let groups = part.size[0].div_ceil(LANES);
        let rows: Vec<usize> = (0..part.size[1]).filter(|y| (part.at[1] + y).is_multiple_of(ROWS)).collect();
        let mut weights: Weights = vec![[0.0; LANES]; groups * rows.len() * WINDOW];
        let mut scratch = Vec::new();
        for offset in 0..WINDOW {
            InstructionSet::run(Distances {
                guide: &guide,
                inside: &inside,
                rows: &rows,
                offset,
                weights: &mut weights,
                scratch: &mut scratch,
            });
        }
        let groups_of_sums = groups + 2;
        let sums = vec![[[0.0; LANES]; 4]; groups_of_sums * (part.size[1] + 2 * RADIUS)];
        let mut predictions = Predictions { part, groups: groups_of_sums, sums };
        for (number, y) in rows.iter().enumerate() {
            for group in 0..groups {
                let weights = &weights[(number * groups + group) * WINDOW..][..WINDOW];
                InstructionSet::run(Fit {
                    data: &guide.color,
                    features: &features,
                    x: group * LANES,
                    y: *y,
                    weights,
                    predictions: &mut predictions,
                });
            }
        }
        predictions
    }
}

/// What non-local means compare: light and its variance, both mirrored at the picture's edges.
struct PatchGuide {
    color: [Window; 3],
    variance: [Window; 3],
}

/// Predictions of the anchors of a part.
struct Predictions {
    part: Part,
    /// The number of groups of columns.
    groups: usize,
    /// Weighted predictions of red, green and blue, and the weights: rows from RADIUS above the part, columns from
    /// LANES to the left.
    sums: Vec<[Lanes; 4]>,
}

impl Predictions {
    /// Whether some of a row's pixels are predicted.
    fn reaches(&self, y: usize) -> bool {
        y + RADIUS >= self.part.at[1] && y < self.part.at[1] + self.part.size[1] + RADIUS
    }

    /// Adds what is predicted for a pixel of a row that is reached.
    fn add(&self, x: usize, y: usize, sums: &mut [f32; 4]) {
        let [left, top] = self.part.at;
        if x + RADIUS < left || x >= left + self.part.size[0] + RADIUS {
            return;
        }
        let (row, column) = (y + RADIUS - top, x + LANES - left);
        let cell = &self.sums[row * self.groups + column / LANES];
        for (sum, values) in sums.iter_mut().zip(cell) {
            *sum += values[column % LANES];
        }
    }
}

/// Weights of a group of anchors for each offset of the window.
type Weights = Vec<Lanes>;

/// The place of an offset of the window.
#[inline(always)]
fn reach(offset: usize) -> [isize; 2] {
    [(offset % SIDE) as isize - RADIUS as isize, (offset / SIDE) as isize - RADIUS as isize]
}

/// The weights of all anchors of a band for one offset.
struct Distances<'a> {
    guide: &'a PatchGuide,
    inside: &'a Window,
    rows: &'a [usize],
    offset: usize,
    weights: &'a mut Weights,
    scratch: &'a mut Vec<f32>,
}

impl Kernel for Distances<'_> {
    type Answer = ();

    #[inline(always)]
    fn run(self) {
        let Distances { guide, inside, rows, offset, weights, scratch } = self;
        let PatchGuide { color, variance } = guide;
        let plane = &color[0];
        let width = plane.size[0].next_multiple_of(LANES);
        let (Some(first), Some(last)) = (rows.first(), rows.last()) else { return };
        let [dx, dy] = reach(offset);
        let shift = dy * plane.stride as isize + dx;
        // Differences of single pixels, of PATCH more rows and columns on all sides.
        let (across, down) = (width + 2 * PATCH, last - first + 1 + 2 * PATCH);
        scratch.clear();
        scratch.resize(across * down + width * down + LANES, 0.0);
        let (single, sums) = scratch.split_at_mut(across * down);
        for row in 0..down {
            let start = plane.index(0, 0) + (first + row) * plane.stride - PATCH * plane.stride - PATCH;
            let other = (start as isize + shift) as usize;
            let out = &mut single[row * across..(row + 1) * across];
            for c in 0..3 {
                let (p, q) = (&color[c].values[start..start + across], &color[c].values[other..other + across]);
                let (vp, vq) = (&variance[c].values[start..start + across], &variance[c].values[other..other + across]);
                for i in 0..across {
                    let difference = p[i] - q[i];
                    let both = vp[i] + if vq[i] < vp[i] { vq[i] } else { vp[i] };
                    let spread = TOLERANCE * both + 1e-10 + 1e-6 * p[i] * p[i];
                    out[i] += (difference * difference - both) / spread;
                }
            }
        }
        for row in 0..down {
            let from = &single[row * across..(row + 1) * across];
            let out = &mut sums[row * width..(row + 1) * width];
            for i in 0..width {
                let mut sum = 0.0;
                for k in 0..2 * PATCH + 1 {
                    sum += from[i + k];
                }
                out[i] = sum;
            }
        }
        let groups = plane.size[0].div_ceil(LANES);
        let scale = 1.0 / (3 * (2 * PATCH + 1) * (2 * PATCH + 1)) as f32;
        for (number, y) in rows.iter().enumerate() {
            for group in 0..groups {
                let x = group * LANES;
                let mut e = [0.0; LANES];
                for k in 0..2 * PATCH + 1 {
                    let from = &sums[(y - first + k) * width + x..][..LANES];
                    for i in 0..LANES {
                        e[i] += from[i];
                    }
                }
                let p = plane.index(x, *y);
                let q = (p as isize + shift) as usize;
                let inside = inside.load(q);
                let weight = &mut weights[(number * groups + group) * WINDOW + offset];
                for i in 0..LANES {
                    let e = e[i] * scale;
                    weight[i] = falloff(if e > 0.0 { e } else { 0.0 }) * inside[i];
                }
            }
        }
    }
}

/// The fits of a group of anchors, and what they predict.
struct Fit<'a> {
    data: &'a [Window; 3],
    features: &'a [Window; 7],
    x: usize,
    y: usize,
    weights: &'a [Lanes],
    predictions: &'a mut Predictions,
}

impl Kernel for Fit<'_> {
    type Answer = ();

    #[inline(always)]
    fn run(self) {
        let Fit { data, features, x, y, weights, predictions } = self;
        let center = features[6].index(x, y);
        let at_center = [0, 1, 2, 3, 4, 5, 6].map(|k: usize| features[k].load(center));
        let scale_of_nearness = at_center[6].map(|v| if v > 0.0 { 1.0 / v } else { 1.0 });
        let stride = features[6].stride as isize;
        let terms = |offset: usize| -> ([Lanes; TERMS], usize) {
            let [dx, dy] = reach(offset);
            let q = (center as isize + dy * stride + dx) as usize;
            let mut terms = [[1.0; LANES]; TERMS];
            terms[1] = [dx as f32 / RADIUS as f32; LANES];
            terms[2] = [dy as f32 / RADIUS as f32; LANES];
            for k in 0..7 {
                let values = features[k].load(q);
                for i in 0..LANES {
                    terms[3 + k][i] = values[i] - at_center[k][i];
                }
            }
            for i in 0..LANES {
                terms[9][i] *= scale_of_nearness[i];
            }
            (terms, q)
        };
        let mut products = [[0.0; LANES]; PRODUCTS];
        let mut right = [[[0.0; LANES]; TERMS]; 3];
        for (offset, w) in weights.iter().enumerate() {
            let (terms, q) = terms(offset);
            let data = [0, 1, 2].map(|c: usize| data[c].load(q));
            let mut number = 0;
            for a in 0..TERMS {
                let mut weighted = [0.0; LANES];
                for i in 0..LANES {
                    weighted[i] = w[i] * terms[a][i];
                }
                for b in 0..=a {
                    for i in 0..LANES {
                        products[number][i] += weighted[i] * terms[b][i];
                    }
                    number += 1;
                }
                for c in 0..3 {
                    for i in 0..LANES {
                        right[c][a][i] += weighted[i] * data[c][i];
                    }
                }
            }
        }
        // Cholesky's decomposition, of all anchors at once.
        let at = |a: usize, b: usize| a * (a + 1) / 2 + b;
        for a in 1..TERMS {
            for i in 0..LANES {
                products[at(a, a)][i] += RIDGE[a] * RIDGE[a] * products[0][i] + 1e-4 * products[at(a, a)][i];
            }
        }
        for a in 0..TERMS {
            for b in 0..=a {
                let mut sum = products[at(a, b)];
                for k in 0..b {
                    for i in 0..LANES {
                        sum[i] -= products[at(a, k)][i] * products[at(b, k)][i];
                    }
                }
                for i in 0..LANES {
                    products[at(a, b)][i] = if a == b {
                        (if sum[i] > 1e-20 { sum[i] } else { 1e-20 }).sqrt()
                    } else {
                        sum[i] / products[at(b, b)][i]
                    };
                }
            }
        }
        for beta in &mut right {
            for a in 0..TERMS {
                for b in 0..a {
                    for i in 0..LANES {
                        beta[a][i] -= products[at(a, b)][i] * beta[b][i];
                    }
                }
                for i in 0..LANES {
                    beta[a][i] /= products[at(a, a)][i];
                }
            }
            for a in (0..TERMS).rev() {
                for b in a + 1..TERMS {
                    for i in 0..LANES {
                        beta[a][i] -= products[at(b, a)][i] * beta[b][i];
                    }
                }
                for i in 0..LANES {
                    beta[a][i] /= products[at(a, a)][i];
                }
            }
        }
        for (offset, w) in weights.iter().enumerate() {
            let (terms, _) = terms(offset);
            let mut predicted = [[0.0; LANES]; 3];
            for (value, beta) in predicted.iter_mut().zip(&right) {
                for a in 0..TERMS {
                    for i in 0..LANES {
                        value[i] += beta[a][i] * terms[a][i];
                    }
                }
            }
            let [dx, dy] = reach(offset);
            let row = y as isize + dy + RADIUS as isize;
            let column = (x + LANES) as isize + dx;
            // The lanes fall into two groups of the sums.
            let (group, lane) = (column as usize / LANES, column as usize % LANES);
            let cell = row as usize * predictions.groups + group;
            for i in 0..LANES {
                let (cell, lane) = if lane + i < LANES { (cell, lane + i) } else { (cell + 1, lane + i - LANES) };
                let sums = &mut predictions.sums[cell];
                sums[0][lane] += w[i] * predicted[0][i];
                sums[1][lane] += w[i] * predicted[1][i];
                sums[2][lane] += w[i] * predicted[2][i];
                sums[3][lane] += w[i];
            }
        }
    }
}

const _: () = assert!(RADIUS <= LANES && RADIUS < PART[1] && PART[1].is_multiple_of(ROWS));
