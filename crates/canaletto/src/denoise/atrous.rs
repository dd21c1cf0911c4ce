//! The fast filter: an edge-avoiding wavelet transform "with holes" (Dammertz, Sewtz, Hanika & Lensch 2010), whose
//! tolerance for differences of light follows the variance (Schied et al. 2017, *Spatiotemporal Variance-Guided
//! Filtering*, its spatial part).
//!
//! Deviation: the first pass compares means of 3 × 3 pixels, since single pixels of few samples tell little. Each half
//! is filtered by weights of its own, so that the other half can judge the result: weights from the other half would
//! follow its noise.
#![allow(clippy::needless_range_loop)] // Lanes of several arrays go in step.

use super::outliers::lowered;
use super::plane::{ColorPlanes, LANES, Lanes, Part, Plane, Window, falloff, strips};
use super::source::Source;
use canaletto_bvh::{InstructionSet, Kernel};
use canaletto_parallel::prelude::*;

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

/// The light of both halves, each as red, green, blue and the variance of its brightness.
type HalvesPlanes = [Plane; 8];

/// Filters both halves without outliers, which `factors` lower.
pub(super) fn atrous(source: &Source<'_>, factors: &[Plane; 2], variance: &Plane) -> [ColorPlanes; 2] {
    // Without features means would blur edges.
    let first = if source.has_normals() { 3.0 } else { 1.0 };
    let read = |i: usize| {
        let ([a, b, c], [d, e, f]) = (lowered(source, 0, factors, i), lowered(source, 1, factors, i));
        [a, b, c, variance.values[i], d, e, f, variance.values[i]]
    };
    let mut halves = new_planes(source.size);
    pass(source, read, first > 1.0, 1, &mut halves);
    let mut next = new_planes(source.size);
    for level in 1..LEVELS {
        pass(source, |i| halves.each_ref().map(|plane| plane.values[i]), false, 1 << level, &mut next);
        std::mem::swap(&mut halves, &mut next);
    }
    let [a, b, c, _, d, e, f, _] = halves;
    [[a, b, c], [d, e, f]]
}

fn new_planes(size: [usize; 2]) -> HalvesPlanes {
    [(); 8].map(|()| Plane::new(size))
}

/// One pass with this distance between taps. `prefilters` tells whether means are compared.
fn pass(
    source: &Source<'_>,
    read: impl Fn(usize) -> [f32; 8] + Sync,
    prefilters: bool,
    step: usize,
    filtered: &mut HalvesPlanes,
) {
    let [a, b, c, d, e, f, g, h] = filtered;
    strips([a, b, c, d, e, f, g, h]).into_par_iter().for_each(|mut strip| {
        for part in strip.parts(source.size) {
            let taps = Taps::new(source, &part, &read, prefilters, step);
            let mut row = vec![[0.0; 8]; part.size[0].next_multiple_of(LANES)];
            for y in 0..part.size[1] {
                InstructionSet::run(RowPass { taps: &taps, step, y, row: &mut row });
                for (number, rows) in strip.rows.iter_mut().enumerate() {
                    rows[part.row(y)].iter_mut().zip(&row).for_each(|(v, values)| *v = values[number]);
                }
            }
        }
    });
}

/// What a pass reads for a part of the picture.
struct Taps {
    halves: [Window; 8],
    /// The light of each half that is compared, and the variance of differences.
    light: [Window; 2],
    spread: [Window; 2],
    normal: [Window; 3],
    root: [Window; 3],
    nearness: Window,
    inside: Window,
}

impl Taps {
    fn new(
        source: &Source<'_>,
        part: &Part,
        read: &(impl Fn(usize) -> [f32; 8] + Sync),
        prefilters: bool,
        step: usize,
    ) -> Taps {
        // Means of 3 × 3 pixels need one more.
        let reach = 2 * step + 1;
        let halves = part.windows(reach, read);
        let [a, b, c, d, e, f, nearness, inside] = part.windows(reach, |i| {
            let ([a, b, c], [d, e, f]) = (source.normal(i), source.root(i));
            [a, b, c, d, e, f, source.nearness(i), 1.0]
        });
        let light = [0, 4].map(|first: usize| {
            let mut light = Window::new(part.size, reach);
            for i in 0..light.values.len() {
                let sum = halves[first].values[i] + halves[first + 1].values[i] + halves[first + 2].values[i];
                light.values[i] = sum * (1.0 / 3.0);
            }
            if prefilters { light.means(&inside, 2 * step) } else { light }
        });
        let spread = [3, 7].map(|number: usize| {
            let mut spread = halves[number].means(&inside, 0);
            if prefilters {
                spread.values.iter_mut().for_each(|v| *v *= 1.0 / FIRST_VARIANCE_RATIO);
            }
            spread
        });
        Taps { halves, light, spread, normal: [a, b, c], root: [d, e, f], nearness, inside }
    }

    /// The derivative of nearness to the right or downwards, the smaller one of both sides.
    #[inline(always)]
    fn slope(&self, center: usize, step: usize) -> Lanes {
        let at = |window: &Window, index| window.load(index);
        let [before, own, after] = [center - step, center, center + step].map(|i| at(&self.nearness, i));
        let [has_before, has_after] = [center - step, center + step].map(|i| at(&self.inside, i));
        let mut slope = [0.0; LANES];
        for i in 0..LANES {
            let (a, b) = (own[i] - before[i], after[i] - own[i]);
            let smaller = if a.abs() < b.abs() { a } else { b };
            let one = if has_after[i] > 0.0 { b } else { 0.0 };
            slope[i] = match has_before[i] > 0.0 {
                true => {
                    if has_after[i] > 0.0 {
                        smaller
                    } else {
                        a
                    }
                }
                false => one,
            };
        }
        slope
    }
}

/// The pixels of a row.
struct RowPass<'a> {
    taps: &'a Taps,
    step: usize,
    y: usize,
    row: &'a mut [[f32; 8]],
}

impl Kernel for RowPass<'_> {
    type Answer = ();

    #[inline(always)]
    fn run(self) {
        let RowPass { taps, step, y, row } = self;
        let Taps { halves, light, spread, normal, root, nearness, inside } = taps;
        for x in (0..row.len()).step_by(LANES) {
            let center = inside.index(x, y);
            let light_p = [0, 1].map(|half: usize| light[half].load(center));
            let tolerance = [0, 1].map(|half: usize| {
                let (light_p, mut tolerance) = (light_p[half], spread[half].load(center));
                for i in 0..LANES {
                    tolerance[i] = 1.0 / (LIGHT * LIGHT * tolerance[i] + 1e-12 * light_p[i] * light_p[i] + 1e-30);
                }
                tolerance
            });
            let near_p = nearness.load(center);
            let slopes = [taps.slope(center, 1), taps.slope(center, nearness.stride)];
            let normal_p = [0, 1, 2].map(|c: usize| normal[c].load(center));
            let root_p = [0, 1, 2].map(|c: usize| root[c].load(center));
            let mut sums = [[[0.0; LANES]; 5]; 2];
            for dy in 0..5usize {
                for dx in 0..5usize {
                    let q = center + dy * step * inside.stride + dx * step - 2 * step * (inside.stride + 1);
                    let reach = [(dx as f32 - 2.0) * step as f32, (dy as f32 - 2.0) * step as f32];
                    let spline = SPLINE[dx.abs_diff(2)] * SPLINE[dy.abs_diff(2)];
                    let (near_q, inside_q) = (nearness.load(q), inside.load(q));
                    let root_q = [0, 1, 2].map(|c: usize| root[c].load(q));
                    let normal_q = [0, 1, 2].map(|c: usize| normal[c].load(q));
                    let mut surfaces = [0.0; LANES];
                    for i in 0..LANES {
                        let n = [0, 1, 2].map(|c: usize| normal_p[c][i] - normal_q[c][i]);
                        let a = [0, 1, 2].map(|c: usize| root_p[c][i] - root_q[c][i]);
                        let slope = slopes[0][i] * reach[0] + slopes[1][i] * reach[1];
                        let depth = near_p[i] + slope - near_q[i];
                        let near = NEARNESS * near_p[i] + 0.5 * slope.abs() + 1e-9;
                        surfaces[i] = (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]) * (1.0 / (NORMAL * NORMAL))
                            + (a[0] * a[0] + a[1] * a[1] + a[2] * a[2]) * (1.0 / (ALBEDO * ALBEDO))
                            + depth * depth / (near * near);
                    }
                    for half in 0..2 {
                        let light_q = light[half].load(q);
                        let values = [0, 1, 2, 3].map(|c: usize| halves[4 * half + c].load(q));
                        let sums = &mut sums[half];
                        for i in 0..LANES {
                            let light = light_p[half][i] - light_q[i];
                            let e = surfaces[i] + light * light * tolerance[half][i];
                            let w = spline * falloff(e) * inside_q[i];
                            sums[0][i] += w * values[0][i];
                            sums[1][i] += w * values[1][i];
                            sums[2][i] += w * values[2][i];
                            sums[3][i] += w * w * values[3][i];
                            sums[4][i] += w;
                        }
                    }
                }
            }
            for i in 0..LANES {
                for (half, sums) in sums.iter().enumerate() {
                    // Lanes beyond the picture have no weights.
                    let scale = if sums[4][i] > 0.0 { 1.0 / sums[4][i] } else { 0.0 };
                    for c in 0..3 {
                        row[x + i][4 * half + c] = sums[c][i] * scale;
                    }
                    row[x + i][4 * half + 3] = sums[3][i] * scale * scale;
                }
            }
        }
    }
}
