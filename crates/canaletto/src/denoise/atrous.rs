//! The fast filter: an edge-avoiding wavelet transform "with holes" (Dammertz, Sewtz, Hanika & Lensch 2010), whose
//! tolerance for differences of light follows the variance (Schied et al. 2017, *Spatiotemporal Variance-Guided
//! Filtering*, its spatial part).
//!
//! Deviation: the first pass compares means of 3 × 3 pixels, since single pixels of few samples tell little. Each half
//! is filtered by weights of its own, so that the other half can judge the result: weights from the other half would
//! follow its noise.
#![allow(clippy::needless_range_loop)] // Lanes of several arrays go in step.

use super::features::FeaturePlanes;
use super::plane::{ColorPlanes, MARGIN, Plane, falloff};
use canaletto_bvh::{InstructionSet, Kernel};
use rayon::prelude::*;

/// The number of passes. The distance between taps doubles with each.
const LEVELS: u32 = 5;
/// The cubic B-spline's weights at distances 0, 1 and 2.
const SPLINE: [f32; 3] = [0.375, 0.25, 0.0625];
/// Tolerances: of light in standard deviations, of normals, of nearness in units of its value, of the albedo's root.
const LIGHT: f32 = 2.0;
const NORMAL: f32 = 0.25;
const NEARNESS: f32 = 0.02;
const ALBEDO: f32 = 0.15;
/// The ratio of the variance of pixels to the one that the first pass takes for the means of 3 × 3. It is less than 9,
/// since fireflies leave a mean with more.
const FIRST_VARIANCE_RATIO: f32 = 2.0;

/// A half of the samples, with the variance of its brightness.
#[derive(Clone, Debug)]
pub(super) struct Half {
    pub(super) color: ColorPlanes,
    pub(super) variance: Plane,
}

/// Filters both halves. `prefilters` tells whether the first pass compares means; without features it would blur edges.
pub(super) fn atrous(halves: [Half; 2], features: &FeaturePlanes, prefilters: bool) -> [ColorPlanes; 2] {
    let mut halves = halves;
    for level in 0..LEVELS {
        let step = 1 << level;
        halves = halves.map(|half| {
            let (light, mut variance) = (luminance(&half.color), half.variance.box_mean(1));
            let light = if level == 0 && prefilters {
                variance.values.iter_mut().for_each(|v| *v *= 1.0 / FIRST_VARIANCE_RATIO);
                light.box_mean(1)
            } else {
                light
            };
            pass(&half, &[light, variance], features, step)
        });
    }
    halves.map(|half| half.color)
}

/// The mean of the components.
pub(super) fn luminance(color: &ColorPlanes) -> Plane {
    let mut plane = Plane::new(color[0].size);
    plane.values.par_iter_mut().enumerate().for_each(|(i, v)| {
        *v = (color[0].values[i] + color[1].values[i] + color[2].values[i]) * (1.0 / 3.0);
    });
    plane
}

/// One pass with this distance between taps.
fn pass(half: &Half, guide: &[Plane; 2], features: &FeaturePlanes, step: usize) -> Half {
    let size = half.variance.size;
    let mut rows: Vec<Vec<[f32; 4]>> = Vec::new();
    (0..size[1])
        .into_par_iter()
        .map(|y| {
            let mut row = vec![[0.0; 4]; size[0].next_multiple_of(16)];
            InstructionSet::run(RowPass { half, guide, features, step, y, row: &mut row });
            row
        })
        .collect_into_vec(&mut rows);
    let plane = |c: usize| {
        let mut plane = Plane::new(size);
        plane.fill(|x, y| rows[y][x][c]);
        plane
    };
    Half { color: [0, 1, 2].map(plane), variance: plane(3) }
}

/// The pixels of a row.
struct RowPass<'a> {
    half: &'a Half,
    guide: &'a [Plane; 2],
    features: &'a FeaturePlanes,
    step: usize,
    y: usize,
    row: &'a mut [[f32; 4]],
}

/// The number of pixels side by side.
const LANES: usize = 16;

type Lanes = [f32; LANES];

#[inline(always)]
fn load(plane: &Plane, index: usize) -> Lanes {
    let mut lanes = [0.0; LANES];
    lanes.copy_from_slice(&plane.values[index..index + LANES]);
    lanes
}

impl Kernel for RowPass<'_> {
    type Answer = ();

    #[inline(always)]
    fn run(self) {
        let RowPass { half, guide, features, step, y, row } = self;
        let [light, spread] = guide;
        for x in (0..row.len()).step_by(LANES) {
            let center = light.index(x, y);
            let at = |plane: &Plane| load(plane, center);
            let (light_p, spread_p, near_p) = (at(light), at(spread), at(&features.nearness));
            let (normal_p, slope_p) =
                ([0, 1, 2].map(|c| at(&features.normal[c])), [0, 1].map(|c| at(&features.slope[c])));
            let root_p = [0, 1, 2].map(|c| at(&features.root[c]));
            let mut sums = [[0.0; LANES]; 5];
            for dy in -2i32..=2 {
                for dx in -2i32..=2 {
                    let reach = [dx * step as i32, dy * step as i32];
                    if (y as i32 + reach[1]) < 0 || y as i32 + reach[1] >= light.size[1] as i32 {
                        continue;
                    }
                    let q = (center as isize + reach[1] as isize * light.stride as isize + reach[0] as isize) as usize;
                    let spline = SPLINE[dx.unsigned_abs() as usize] * SPLINE[dy.unsigned_abs() as usize];
                    let (light_q, near_q, inside_q) =
                        (load(light, q), load(&features.nearness, q), load(&features.inside, q));
                    let root_q = [0, 1, 2].map(|c| load(&features.root[c], q));
                    let normal_q = [0, 1, 2].map(|c| load(&features.normal[c], q));
                    let values =
                        [&half.color[0], &half.color[1], &half.color[2], &half.variance].map(|plane| load(plane, q));
                    for i in 0..LANES {
                        let light = light_p[i] - light_q[i];
                        let mut e =
                            light * light / (LIGHT * LIGHT * spread_p[i] + 1e-12 * light_p[i] * light_p[i] + 1e-30);
                        let n = [0, 1, 2].map(|c: usize| normal_p[c][i] - normal_q[c][i]);
                        e += (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]) * (1.0 / (NORMAL * NORMAL));
                        let a = [0, 1, 2].map(|c: usize| root_p[c][i] - root_q[c][i]);
                        e += (a[0] * a[0] + a[1] * a[1] + a[2] * a[2]) * (1.0 / (ALBEDO * ALBEDO));
                        let slope = slope_p[0][i] * reach[0] as f32 + slope_p[1][i] * reach[1] as f32;
                        let depth = near_p[i] + slope - near_q[i];
                        let near = NEARNESS * near_p[i] + 0.5 * slope.abs() + 1e-9;
                        e += depth * depth / (near * near);
                        let w = spline * falloff(e) * inside_q[i];
                        sums[0][i] += w * values[0][i];
                        sums[1][i] += w * values[1][i];
                        sums[2][i] += w * values[2][i];
                        sums[3][i] += w * w * values[3][i];
                        sums[4][i] += w;
                    }
                }
            }
            for i in 0..LANES {
                // Lanes beyond the picture have no weights.
                let scale = if sums[4][i] > 0.0 { 1.0 / sums[4][i] } else { 0.0 };
                row[x + i] = [sums[0][i] * scale, sums[1][i] * scale, sums[2][i] * scale, sums[3][i] * scale * scale];
            }
        }
    }
}

const _: () = assert!(2 << (LEVELS - 1) <= MARGIN);
