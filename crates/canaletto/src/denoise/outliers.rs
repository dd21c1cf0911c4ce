//! Fireflies: samples that one half of a pixel's paths met and that nothing around confirms.

use super::plane::{ColorPlanes, Plane};
use rayon::prelude::*;

/// A pixel of one half is at most this many times what its surroundings and the other half show.
const TOLERANCE: f32 = 1.5;
/// The radius of each of the two means that spread outliers.
const REACH: usize = 12;

/// Lowers the outliers of one half, and returns the colours without them with the light that was removed. A pixel is
/// at most [`TOLERANCE`] times the third brightest of its 3 × 3 neighbours in the same half, or times the same pixel of
/// the other half, whatever is more.
pub(super) fn lower_outliers(own: &ColorPlanes, other: &ColorPlanes) -> (ColorPlanes, f64) {
    let size = own[0].size;
    let (own_light, other_light) = (brightness(own), brightness(other));
    let mut scale = Plane::new(size);
    scale.fill(|x, y| {
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

/// The light that lowering took from a half, spread over squares of side 4 [`REACH`] + 1.
pub(super) fn spread_outliers(own: &ColorPlanes, lowered: &ColorPlanes) -> ColorPlanes {
    [0, 1, 2].map(|c| {
        let mut taken = Plane::new(own[c].size);
        taken.fill(|x, y| own[c].at(x, y) - lowered[c].at(x, y));
        taken.box_mean(REACH).box_mean(REACH)
    })
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
