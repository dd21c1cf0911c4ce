//! Fireflies: samples that one half of a pixel's paths met and that nothing around confirms.

use super::LAMP;
use super::features::FeaturePlanes;
use super::plane::{ColorPlanes, Plane};
use rayon::prelude::*;

/// A pixel of one half is at most this many times what its surroundings and the other half show.
const TOLERANCE: f32 = 1.5;
/// The radii of the two boxes whose convolution spreads an outlier.
const REACHES: [usize; 4] = [6, 12, 24, 48];
/// An outlier that adds a larger share to a pixel is spread farther.
const VISIBLE: f32 = 0.02;
/// The least ratio of two albedos of alike surfaces.
const ALIKE: f32 = 0.7;

/// Lowers the outliers of one half, and returns the colours without them with the light that was removed. A pixel is
/// at most [`TOLERANCE`] times the third brightest of its 3 × 3 neighbours in the same half, or times the same pixel of
/// the other half, whatever is more. Lamps are never outliers.
pub(super) fn lower_outliers(own: &ColorPlanes, other: &ColorPlanes, features: &FeaturePlanes) -> (ColorPlanes, f64) {
    let size = own[0].size;
    let (own_light, other_light) = (brightness(own), brightness(other));
    let albedo = brightness(&features.albedo);
    let mut scale = Plane::new(size);
    scale.fill(|x, y| {
        if !is_judged(&albedo, x, y) {
            return 1.0;
        }
        let value = own_light.at(x, y);
        let limit = TOLERANCE * third_largest(&own_light, x, y).max(other_light.at(x, y));
        if value > limit { limit / value } else { 1.0 }
    });
    let lowered = [0, 1, 2].map(|c| {
        let mut plane = own[c].clone();
        plane.values.par_iter_mut().zip(&scale.values).for_each(|(v, s)| *v *= s);
        plane
    });
    let removed = (0..3).map(|c| total(&own[c]) - total(&lowered[c])).sum();
    (lowered, removed)
}

/// Spreads removed light in proportion to `takers`, which are light: what is dark stays dark. Each outlier takes the
/// smallest of a few reaches at which it adds less than [`VISIBLE`] to any pixel, or the whole picture. So one strong
/// outlier makes no bright patch. Returns the light for each pixel, and the lost light, which even the whole picture
/// would show.
///
/// With a symmetric kernel K, the light T of outliers becomes W (K ∗ (T / (K ∗ W))), whose sum is that of T.
pub(super) fn spread_outliers(removed: &ColorPlanes, takers: &ColorPlanes) -> (ColorPlanes, f64) {
    let size = takers[0].size;
    // The share of a pixel's light that outliers add to it.
    let mut shares = [0, 1, 2].map(|_| Plane::new(size));
    let mut left = removed.clone();
    for radius in REACHES {
        let sums = [0, 1, 2].map(|c| takers[c].box_sum(radius).box_sum(radius));
        let peak = ((2 * radius + 1) * (2 * radius + 1)) as f32;
        let mut taken = Plane::new(size);
        taken.fill(|x, y| {
            let is_fit = (0..3).all(|c| left[c].at(x, y) * peak <= VISIBLE * sums[c].at(x, y));
            if is_fit { 1.0 } else { 0.0 }
        });
        for c in 0..3 {
            let mut part = Plane::new(size);
            part.fill(|x, y| {
                let sum = sums[c].at(x, y);
                if sum > 0.0 { taken.at(x, y) * left[c].at(x, y) / sum } else { 0.0 }
            });
            let add = part.box_sum(radius).box_sum(radius);
            shares[c].values.iter_mut().zip(&add.values).for_each(|(v, add)| *v += add);
            left[c].values.iter_mut().zip(&taken.values).for_each(|(v, taken)| *v *= 1.0 - taken);
        }
    }
    let mut lost = 0.0;
    let spread = [0, 1, 2].map(|c| {
        let sum = total(&takers[c]);
        let most = f64::from(VISIBLE) * sum;
        let rest: f64 = left[c].values.iter().map(|v| f64::from(*v).min(most)).sum();
        lost += total(&left[c]) - rest;
        let whole = if sum > 0.0 { (rest / sum) as f32 } else { 0.0 };
        let mut plane = Plane::new(size);
        plane.fill(|x, y| takers[c].at(x, y) * (shares[c].at(x, y) + whole));
        plane
    });
    (spread, lost)
}

/// The sum of all values, in a fixed order.
fn total(plane: &Plane) -> f64 {
    plane.values.iter().map(|v| f64::from(*v)).sum()
}

/// The largest component of each pixel.
fn brightness(color: &ColorPlanes) -> Plane {
    let mut plane = Plane::new(color[0].size);
    plane.fill(|x, y| color[0].at(x, y).max(color[1].at(x, y)).max(color[2].at(x, y)));
    plane
}

/// Whether neighbours can judge a pixel: not that of a lamp, whose albedo is 1 or far above that of its surroundings.
fn is_judged(albedo: &Plane, x: usize, y: usize) -> bool {
    let own = albedo.at(x, y);
    own < LAMP && third_largest(albedo, x, y) >= ALIKE * own
}

fn third_largest(plane: &Plane, x: usize, y: usize) -> f32 {
    let [width, height] = plane.size;
    let mut top = [f32::NEG_INFINITY; 3];
    for y in y.saturating_sub(1)..(y + 2).min(height) {
        for x in x.saturating_sub(1)..(x + 2).min(width) {
            let v = plane.at(x, y);
            if v > top[0] {
                top = [v, top[0], top[1]];
            } else if v > top[1] {
                top = [top[0], v, top[1]];
            } else if v > top[2] {
                top[2] = v;
            }
        }
    }
    top[2]
}

/// The medians of 3 × 3 pixels.
pub(super) fn median(plane: &Plane) -> Plane {
    let [width, height] = plane.size;
    let mut medians = Plane::new(plane.size);
    medians.fill(|x, y| {
        let (mut values, mut count) = ([0.0; 9], 0);
        for y in y.saturating_sub(1)..(y + 2).min(height) {
            for x in x.saturating_sub(1)..(x + 2).min(width) {
                values[count] = plane.at(x, y);
                count += 1;
            }
        }
        let values = &mut values[..count];
        values.sort_unstable_by(f32::total_cmp);
        values[count / 2]
    });
    medians
}
