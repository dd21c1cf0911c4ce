//! The features of surfaces that guide the filters, as planes.

use super::plane::Plane;

/// The features of each pixel. A missing layer is a plane of zeros, which tells nothing.
#[derive(Debug)]
pub(super) struct FeaturePlanes {
    pub(super) normal: [Plane; 3],
    pub(super) albedo: [Plane; 3],
    /// The square root of the albedo, whose differences tell lamps from what is dark around them.
    pub(super) root: [Plane; 3],
    /// The inverse of the depth, which is linear across a plane's picture; 0 for the background. The mean is 1.
    pub(super) nearness: Plane,
    /// The derivative of `nearness` to the right and downwards, the smaller one of both sides.
    pub(super) slope: [Plane; 2],
    /// 1 inside the picture, 0 in the margin.
    pub(super) inside: Plane,
}

impl FeaturePlanes {
    pub(super) fn new(
        size: [usize; 2],
        normal: Option<&[[f32; 3]]>,
        albedo: Option<&[[f32; 3]]>,
        depth: Option<&[f32]>,
    ) -> FeaturePlanes {
        let triple = |values: Option<&[[f32; 3]]>| {
            [0, 1, 2].map(|c| match values {
                Some(values) => Plane::of(size, |i| finite(values[i][c])),
                None => Plane::new(size),
            })
        };
        let (normal, albedo) = (triple(normal), triple(albedo));
        let mut nearness = match depth {
            Some(depth) => Plane::of(size, |i| finite(1.0 / depth[i])),
            None => Plane::new(size),
        };
        let mut sum = 0.0;
        for y in 0..size[1] {
            let start = nearness.index(0, y);
            sum += nearness.values[start..start + size[0]].iter().map(|v| f64::from(*v)).sum::<f64>();
        }
        let mean = sum / (size[0] * size[1]) as f64;
        if mean > 0.0 && mean.is_finite() {
            nearness.values.iter_mut().for_each(|v| *v = (f64::from(*v) / mean) as f32);
        }
        let mut slope = [Plane::new(size), Plane::new(size)];
        for (axis, slope) in slope.iter_mut().enumerate() {
            slope.fill(|x, y| {
                let place = [x, y];
                let step = |from: usize| {
                    let mut at = [[x, y], [x, y]];
                    (at[0][axis], at[1][axis]) = (from, from + 1);
                    nearness.at(at[1][0], at[1][1]) - nearness.at(at[0][0], at[0][1])
                };
                let before = (place[axis] > 0).then(|| step(place[axis] - 1));
                let after = (place[axis] + 1 < size[axis]).then(|| step(place[axis]));
                match (before, after) {
                    (Some(a), Some(b)) => {
                        if a.abs() < b.abs() {
                            a
                        } else {
                            b
                        }
                    }
                    (one, other) => one.or(other).unwrap_or(0.0),
                }
            });
        }
        let root = albedo.clone().map(|mut plane| {
            plane.values.iter_mut().for_each(|v| *v = v.max(0.0).sqrt());
            plane
        });
        FeaturePlanes { normal, albedo, root, nearness, slope, inside: Plane::of(size, |_| 1.0) }
    }
}

fn finite(v: f32) -> f32 {
    if v.is_finite() { v } else { 0.0 }
}
