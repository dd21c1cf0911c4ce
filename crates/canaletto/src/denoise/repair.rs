//! Pixels that are no light, such as NaN, and features that are none: they get the median of what surrounds them.

use crate::math::Rgb;
use canaletto_parallel::prelude::*;
use std::borrow::Cow;

/// The numbers of pixels that were filled from those around them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FilledPixels {
    /// Those whose colour is NaN, infinite, or further below black than any filter of pixels leads.
    pub colors: u64,
    /// Those with a NaN or infinite albedo or normal, or a depth that is NaN or negative.
    pub features: u64,
}

/// A filter with negative lobes leads at most this part of the brightest pixel nearby below black.
const LOBES: f32 = 0.25;
/// The radius of such filters in pixels.
const LOBE_REACH: usize = 3;

/// Whether no light has this colour.
pub(super) fn is_no_light([width, height]: [usize; 2], colors: &[Rgb], i: usize) -> bool {
    let color = colors[i];
    if !color.is_finite() {
        return true;
    }
    let least = color.r.min(color.g).min(color.b);
    if least >= 0.0 {
        return false;
    }
    let (x, y) = (i % width, i / width);
    let rows = y.saturating_sub(LOBE_REACH)..(y + LOBE_REACH + 1).min(height);
    let columns = x.saturating_sub(LOBE_REACH)..(x + LOBE_REACH + 1).min(width);
    let nearby = rows.flat_map(|y| columns.clone().map(move |x| colors[y * width + x]));
    let brightest = nearby.filter(|color| color.is_finite()).fold(0.0, |most, color| color.max_component().max(most));
    least < -LOBES * brightest
}

/// A value of a layer.
pub(super) trait LayerValue: Copy + Sync + Send {
    /// The median of some values, by components.
    fn median(values: &[Self]) -> Self;
}

impl LayerValue for f32 {
    fn median(values: &[f32]) -> f32 {
        let mut values = values.to_vec();
        let middle = values.len() / 2;
        *values.select_nth_unstable_by(middle, f32::total_cmp).1
    }
}

impl LayerValue for [f32; 3] {
    fn median(values: &[[f32; 3]]) -> [f32; 3] {
        [0, 1, 2].map(|c: usize| f32::median(&values.iter().map(|v| v[c]).collect::<Vec<f32>>()))
    }
}

impl LayerValue for Rgb {
    fn median(values: &[Rgb]) -> Rgb {
        Rgb::from(LayerValue::median(&values.iter().map(|v| v.to_array()).collect::<Vec<[f32; 3]>>()))
    }
}

/// A layer whose broken values are the medians of their neighbours, from the rim of a hole inwards. Without any other
/// they stay as they are. `all` marks the pixels that are broken in any layer; it is empty if there are none.
pub(super) fn repaired<'a, T: LayerValue + Default>(
    size: [usize; 2],
    values: &'a [T],
    is_broken: impl Fn(usize, &[T]) -> bool + Sync,
    all: &mut Vec<bool>,
) -> Cow<'a, [T]> {
    let width = size[0];
    let rows = (0..size[1]).into_par_iter();
    let broken_in = |y| (y * width..(y + 1) * width).filter(|i| is_broken(*i, values)).collect::<Vec<usize>>();
    let found = rows.map(broken_in).collect().concat();
    if found.is_empty() {
        return Cow::Borrowed(values);
    }
    all.resize(values.len(), false);
    let mut broken = vec![false; values.len()];
    for &i in &found {
        (all[i], broken[i]) = (true, true);
    }
    let mut values = values.to_vec();
    if found.len() == values.len() {
        values.fill(T::default());
        return Cow::Owned(values);
    }
    let neighbors = |i: usize| {
        let (x, y) = (i % width, i / width);
        let rows = y.saturating_sub(1)..(y + 2).min(size[1]);
        rows.flat_map(move |y| (x.saturating_sub(1)..(x + 2).min(width)).map(move |x| y * width + x))
    };
    let mut rim: Vec<usize> = found.into_iter().filter(|i| neighbors(*i).any(|n| !broken[n])).collect();
    while !rim.is_empty() {
        let fill = |i: &usize| {
            let around: Vec<T> = neighbors(*i).filter(|n| !broken[*n]).map(|n| values[n]).collect();
            T::median(&around)
        };
        let medians: Vec<T> = rim.iter().map(fill).collect();
        for (&i, median) in rim.iter().zip(medians) {
            (values[i], broken[i]) = (median, false);
        }
        rim = rim.into_iter().flat_map(neighbors).filter(|n| broken[*n]).collect();
        rim.sort_unstable();
        rim.dedup();
    }
    Cow::Owned(values)
}
