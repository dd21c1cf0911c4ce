//! The filter of quality: first-order regression on features (Bitterli et al. 2016, *Nonlinearly Weighted First-Order
//! Regression for Denoising Monte Carlo Renderings*), with weights of non-local means (Rousselle, Knaus & Zwicker
//! 2012).
//!
//! Around each anchor pixel, light is fitted as a linear function of place, normal, albedo and nearness. Each fit
//! predicts all pixels of its window, and a pixel is the weighted mean of its predictions. Deviations: there is one
//! pass of weights instead of two, anchors stand on every other row only, and small features are damped (ridge) instead
//! of filtered.
#![allow(clippy::needless_range_loop)] // Lanes of several arrays go in step.

use super::features::FeaturePlanes;
use super::plane::{ColorPlanes, MARGIN, Plane, falloff};
use canaletto_bvh::{InstructionSet, Kernel};
use rayon::prelude::*;

/// The window is (2 RADIUS + 1)² pixels.
const RADIUS: usize = 7;
const SIDE: usize = 2 * RADIUS + 1;
const WINDOW: usize = SIDE * SIDE;
/// Patches of (2 PATCH + 1)² pixels are compared.
const PATCH: usize = 3;
/// The tolerance for differences between patches in standard deviations, squared.
const TOLERANCE: f32 = 0.12;
/// The number of anchors side by side.
const LANES: usize = 16;
/// The distance between rows of anchors.
const ROWS: usize = 2;
/// The number of rows of pixels that one task takes anchors from.
const BAND: usize = 16;
/// 1, two of place, three of the normal, three of the albedo, one of nearness.
const TERMS: usize = 10;
/// The number of products of two terms.
const PRODUCTS: usize = TERMS * (TERMS + 1) / 2;
/// Features that vary by less than this count little: place in windows, normal, albedo, nearness.
const RIDGE: [f32; TERMS] = [0.0, 0.1, 0.1, 0.05, 0.05, 0.05, 0.05, 0.05, 0.05, 0.02];

type Lanes = [f32; LANES];

/// What non-local means compare: light and its variance, both mirrored into the margin.
pub(super) struct PatchGuide {
    pub(super) color: ColorPlanes,
    pub(super) variance: ColorPlanes,
}

/// Filters `data` with weights from `guide`.
pub(super) fn regress(data: &ColorPlanes, guide: &PatchGuide, features: &FeaturePlanes) -> ColorPlanes {
    let size = data[0].size;
    let bands: Vec<usize> = (0..size[1]).step_by(BAND).collect();
    // Each band predicts its own rows and RADIUS more on both sides.
    let predicted: Vec<Vec<[Lanes; 4]>> = bands
        .par_iter()
        .map(|first| {
            let groups = size[0].div_ceil(LANES) + 2;
            let mut sums = vec![[[0.0; LANES]; 4]; groups * (BAND + 2 * RADIUS)];
            let mut band = Band { data, guide, features, first: *first, sums: &mut sums };
            band.predict();
            sums
        })
        .collect();
    let mut planes = [0, 1, 2].map(|_| Plane::new(size));
    let groups = size[0].div_ceil(LANES) + 2;
    let value = |x: usize, y: usize, c: usize| {
        let at = (x + LANES) / LANES;
        let lane = x % LANES;
        let mut sums = [0.0; 2];
        for (band, first) in predicted.iter().zip(&bands) {
            let row = (y + RADIUS).wrapping_sub(*first);
            if row < BAND + 2 * RADIUS {
                let cell = &band[row * groups + at];
                sums[0] += cell[c][lane];
                sums[1] += cell[3][lane];
            }
        }
        if sums[1] > 0.0 { sums[0] / sums[1] } else { data[c].at(x, y) }
    };
    for (c, plane) in planes.iter_mut().enumerate() {
        plane.fill(|x, y| value(x, y, c));
    }
    planes
}

/// Anchors of some rows.
struct Band<'a> {
    data: &'a ColorPlanes,
    guide: &'a PatchGuide,
    features: &'a FeaturePlanes,
    first: usize,
    /// Weighted predictions of red, green and blue, and the weights: rows from RADIUS above the first one, columns from
    /// LANES to the left.
    sums: &'a mut [[Lanes; 4]],
}

/// Weights of a group of anchors for each offset of the window.
type Weights = Vec<Lanes>;

impl Band<'_> {
    fn predict(&mut self) {
        let [width, height] = self.data[0].size;
        let rows: Vec<usize> = (self.first..(self.first + BAND).min(height)).filter(|y| y % ROWS == 0).collect();
        let groups = width.div_ceil(LANES);
        let mut weights: Weights = vec![[0.0; LANES]; groups * rows.len() * WINDOW];
        let mut scratch = Vec::new();
        for offset in 0..WINDOW {
            let kernel = Distances {
                guide: self.guide,
                features: self.features,
                rows: &rows,
                offset,
                weights: &mut weights,
                scratch: &mut scratch,
            };
            InstructionSet::run(kernel);
        }
        for (number, y) in rows.iter().enumerate() {
            for group in 0..groups {
                let weights = &weights[(number * groups + group) * WINDOW..][..WINDOW];
                InstructionSet::run(Fit { band: self, x: group * LANES, y: *y, weights });
            }
        }
    }
}

/// The place of an offset of the window.
#[inline(always)]
fn reach(offset: usize) -> [isize; 2] {
    [(offset % SIDE) as isize - RADIUS as isize, (offset / SIDE) as isize - RADIUS as isize]
}

/// The weights of all anchors of a band for one offset.
struct Distances<'a> {
    guide: &'a PatchGuide,
    features: &'a FeaturePlanes,
    rows: &'a [usize],
    offset: usize,
    weights: &'a mut Weights,
    scratch: &'a mut Vec<f32>,
}

#[inline(always)]
fn load(plane: &Plane, index: usize) -> Lanes {
    let mut lanes = [0.0; LANES];
    lanes.copy_from_slice(&plane.values[index..index + LANES]);
    lanes
}

impl Kernel for Distances<'_> {
    type Answer = ();

    #[inline(always)]
    fn run(self) {
        let Distances { guide, features, rows, offset, weights, scratch } = self;
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
                let inside = load(&features.inside, q);
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
struct Fit<'a, 'b> {
    band: &'a mut Band<'b>,
    x: usize,
    y: usize,
    weights: &'a [Lanes],
}

impl Kernel for Fit<'_, '_> {
    type Answer = ();

    #[inline(always)]
    fn run(self) {
        let Fit { band, x, y, weights } = self;
        let features = band.features;
        let center = features.nearness.index(x, y);
        let planes = [
            &features.normal[0],
            &features.normal[1],
            &features.normal[2],
            &features.albedo[0],
            &features.albedo[1],
            &features.albedo[2],
            &features.nearness,
        ];
        let at_center = planes.map(|plane| load(plane, center));
        let scale_of_nearness = at_center[6].map(|v| if v > 0.0 { 1.0 / v } else { 1.0 });
        let stride = features.nearness.stride as isize;
        let terms = |offset: usize| -> ([Lanes; TERMS], usize) {
            let [dx, dy] = reach(offset);
            let q = (center as isize + dy * stride + dx) as usize;
            let mut terms = [[1.0; LANES]; TERMS];
            terms[1] = [dx as f32 / RADIUS as f32; LANES];
            terms[2] = [dy as f32 / RADIUS as f32; LANES];
            for k in 0..7 {
                let values = load(planes[k], q);
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
            let data = [0, 1, 2].map(|c| load(&band.data[c], q));
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
        let groups = band.data[0].size[0].div_ceil(LANES) + 2;
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
            let row = (y - band.first) as isize + dy + RADIUS as isize;
            let column = (x + LANES) as isize + dx;
            // The lanes fall into two groups of the sums.
            let (group, lane) = (column as usize / LANES, column as usize % LANES);
            let cell = row as usize * groups + group;
            for i in 0..LANES {
                let (cell, lane) = if lane + i < LANES { (cell, lane + i) } else { (cell + 1, lane + i - LANES) };
                let sums = &mut band.sums[cell];
                sums[0][lane] += w[i] * predicted[0][i];
                sums[1][lane] += w[i] * predicted[1][i];
                sums[2][lane] += w[i] * predicted[2][i];
                sums[3][lane] += w[i];
            }
        }
    }
}

const _: () = assert!(RADIUS + PATCH <= MARGIN && RADIUS <= LANES);
