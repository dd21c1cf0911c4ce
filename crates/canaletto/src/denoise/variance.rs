//! The variance of halves, averaged over pixels that show alike surfaces: the noise of a lamp's edge says nothing of
//! the dark wall beside it.
#![allow(clippy::needless_range_loop)] // Lanes of several arrays go in step.

use super::outliers::lowered_windows;
use super::plane::{LANES, Part, Plane, Window, falloff, strips};
use super::source::Source;
use canaletto_bvh::{InstructionSet, Kernel};
use canaletto_parallel::prelude::*;

/// The window is (2 RADIUS + 1)² pixels.
const RADIUS: usize = 4;
/// Tolerances of normals and albedos.
const NORMAL: f32 = 0.4;
const ALBEDO: f32 = 0.2;

/// The variance of half the samples: of red, green, blue and brightness. `factors` lower outliers.
pub(super) fn variance(source: &Source<'_>, factors: &[Plane; 2]) -> [Plane; 4] {
    if !source.has_halves {
        return variance_of_neighbours(source, factors);
    }
    let mut planes = [0, 1, 2, 3].map(|_| Plane::new(source.size));
    let [red, green, blue, brightness] = &mut planes;
    strips([red, green, blue, brightness]).into_par_iter().for_each(|mut strip| {
        for part in strip.parts(source.size) {
            let [a, b, c, d, e, f] = lowered_windows(source, factors, &part, RADIUS);
            let half_variance = |i: usize| {
                let difference = [a.values[i] - d.values[i], b.values[i] - e.values[i], c.values[i] - f.values[i]];
                let brightness = (difference[0] + difference[1] + difference[2]) * (1.0 / 3.0);
                [difference[0], difference[1], difference[2], brightness].map(|v| 0.5 * v * v)
            };
            let mut values = [0, 1, 2, 3].map(|_| Window::new(part.size, RADIUS));
            for i in 0..a.values.len() {
                for (window, variance) in values.iter_mut().zip(half_variance(i)) {
                    window.values[i] = variance;
                }
            }
            let mut averaged = average(source, &part, &values);
            for (rows, values) in strip.rows.iter_mut().zip(averaged.iter_mut()) {
                for y in 0..part.size[1] {
                    let start = values.index(0, y);
                    rows[part.row(y)].copy_from_slice(&values.values[start..start + part.size[0]]);
                }
            }
        }
    });
    planes
}

/// The means of windows over pixels of similar normals and albedos.
pub(super) fn average<const N: usize>(source: &Source<'_>, part: &Part, values: &[Window; N]) -> [Window; N] {
    let features = part.windows(RADIUS, |i| {
        let ([a, b, c], [d, e, f]) = (source.normal(i), source.root(i));
        [a, b, c, d, e, f]
    });
    let inside = part.inside(RADIUS);
    let mut means = [(); N].map(|()| Window::new(part.size, 0));
    InstructionSet::run(Average { values, features: &features, inside: &inside, means: &mut means });
    means
}

struct Average<'a, const N: usize> {
    values: &'a [Window; N],
    features: &'a [Window; 6],
    inside: &'a Window,
    means: &'a mut [Window; N],
}

impl<const N: usize> Kernel for Average<'_, N> {
    type Answer = ();

    #[inline(always)]
    fn run(self) {
        let Average { values, features, inside, means } = self;
        const TOLERANCES: [f32; 2] = [1.0 / (NORMAL * NORMAL), 1.0 / (ALBEDO * ALBEDO)];
        for y in 0..inside.size[1] {
            for x in (0..inside.size[0]).step_by(LANES) {
                let center = inside.index(x, y);
                let features_p = [0, 1, 2, 3, 4, 5].map(|c: usize| features[c].load(center));
                let (mut sums, mut total) = ([[0.0; LANES]; N], [0.0; LANES]);
                for dy in 0..=2 * RADIUS {
                    for dx in 0..=2 * RADIUS {
                        let q = center + dy * inside.stride + dx - RADIUS * inside.stride - RADIUS;
                        let mut weight = [0.0; LANES];
                        for c in 0..6 {
                            let feature_q = features[c].load(q);
                            for i in 0..LANES {
                                let difference = features_p[c][i] - feature_q[i];
                                weight[i] += difference * difference * TOLERANCES[c / 3];
                            }
                        }
                        let inside_q = inside.load(q);
                        let place = ((RADIUS + 1 - dx.abs_diff(RADIUS)) * (RADIUS + 1 - dy.abs_diff(RADIUS))) as f32;
                        for i in 0..LANES {
                            weight[i] = place * falloff(weight[i]) * inside_q[i];
                            total[i] += weight[i];
                        }
                        for n in 0..N {
                            let values = values[n].load(q);
                            for i in 0..LANES {
                                sums[n][i] += weight[i] * values[i];
                            }
                        }
                    }
                }
                for n in 0..N {
                    let start = means[n].index(x, y);
                    let out = &mut means[n].values[start..start + LANES];
                    for i in 0..LANES {
                        let scale = if total[i] > 0.0 { 1.0 / total[i] } else { 0.0 };
                        out[i] = sums[n][i] * scale;
                    }
                }
            }
        }
    }
}

/// A guess of the variance from how much a pixel differs from the mean of its neighbours. Noise is taken to be in
/// proportion to light, by the median ratio of the picture, since edges differ more than noise does.
fn variance_of_neighbours(source: &Source<'_>, factors: &[Plane; 2]) -> [Plane; 4] {
    [0, 1, 2, 3].map(|c: usize| {
        let plane = Plane::of(source.size, |i| {
            let light = super::outliers::lowered(source, 0, factors, i);
            if c < 3 { light[c] } else { (light[0] + light[1] + light[2]) * (1.0 / 3.0) }
        });
        let mean = plane.box_mean(1);
        let square = |v: f32| v * v;
        let guess = |i: usize| 9.0 / 8.0 * square(plane.values[i] - mean.values[i]);
        let lit = (0..plane.values.len()).filter(|i| mean.values[*i] > 0.0);
        let mut ratios: Vec<f32> = lit.map(|i| guess(i) / square(mean.values[i])).collect();
        let middle = ratios.len() / 2;
        // The median of the square of a normal number is 0.455 times its mean.
        let ratio = match ratios.is_empty() {
            true => 0.0,
            false => *ratios.select_nth_unstable_by(middle, f32::total_cmp).1 / 0.455,
        };
        Plane::of(source.size, |i| guess(i).min(ratio * square(mean.values[i]))).box_mean(1)
    })
}
