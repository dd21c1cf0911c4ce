//! Reconstruction by filter importance sampling: a pixel's samples are spread like the filter and weighted with what
//! is left, its sign above all (Ernst, Stamminger & Greiner, *Filter Importance Sampling*, 2006).
//!
//! Every sample then belongs to one pixel, so that a tile needs nothing of its neighbours and a pixel's explanation is
//! whole.

use crate::scene::Filter;

/// Bins of the tabulated distribution of one axis.
const BINS: usize = 128;

/// One axis of a separable filter, ready to be sampled.
#[derive(Clone, Debug)]
pub struct FilterTable {
    radius: f64,
    /// Cumulative distribution of |f| over the bins; empty for the box.
    cumulative: Vec<f64>,
    filter: Filter,
}

impl FilterTable {
    /// The table of a filter.
    pub fn new(filter: Filter) -> FilterTable {
        let radius = radius(filter);
        let mut cumulative = Vec::new();
        if filter != Filter::Box {
            let size: Vec<f64> = (0..BINS).map(|i| value(filter, radius * bin_center(i)).abs()).collect();
            let total: f64 = size.iter().sum();
            let mut sum = 0.0;
            cumulative.push(0.0);
            cumulative.extend(size.iter().map(|s| {
                sum += s / total;
                sum
            }));
            cumulative[BINS] = 1.0;
        }
        FilterTable { radius, cumulative, filter }
    }

    /// Maps u in [0, 1] to an offset from the pixel's centre in pixels, and the sample's weight.
    pub fn sample(&self, u: f64) -> (f64, f64) {
        if self.cumulative.is_empty() {
            return (u - 0.5, 1.0);
        }
        let bin = self.cumulative.partition_point(|&c| c <= u).clamp(1, BINS) - 1;
        let (low, high) = (self.cumulative[bin], self.cumulative[bin + 1]);
        let width = 2.0 * self.radius / BINS as f64;
        let inside = if high > low { ((u - low) / (high - low)).clamp(0.0, 1.0) } else { 0.5 };
        let offset = -self.radius + (bin as f64 + inside) * width;
        let density = (high - low) / width;
        (offset, value(self.filter, offset) / density)
    }
}

/// The centre of a bin on [−1, 1].
fn bin_center(i: usize) -> f64 {
    (i as f64 + 0.5) * 2.0 / BINS as f64 - 1.0
}

fn radius(filter: Filter) -> f64 {
    match filter {
        Filter::Box => 0.5,
        Filter::Tent => 1.0,
        Filter::Gaussian { sigma } => 3.0 * f64::from(sigma),
        Filter::Mitchell => 2.0,
    }
}

/// f(x) along one axis, with integral 1.
fn value(filter: Filter, x: f64) -> f64 {
    let x = x.abs();
    match filter {
        Filter::Box => 1.0,
        Filter::Tent => (1.0 - x).max(0.0),
        Filter::Gaussian { sigma } => {
            let s = f64::from(sigma);
            let gauss = |x: f64| libm::exp(-0.5 * (x / s) * (x / s)) / (s * (2.0 * std::f64::consts::PI).sqrt());
            // Cut off at 3 σ and lowered so that it ends in 0; divided by what is left of its integral:
            // erf(3/√2) − 6 φ(3).
            (gauss(x) - gauss(3.0 * s)).max(0.0) / 0.970_709_113_419_510_4
        }
        // Mitchell & Netravali 1988, B = C = 1/3.
        Filter::Mitchell if x < 1.0 => ((7.0 * x - 12.0) * x * x + 16.0 / 3.0) / 6.0,
        Filter::Mitchell if x < 2.0 => (((-7.0 / 3.0 * x + 12.0) * x - 20.0) * x + 32.0 / 3.0) / 6.0,
        Filter::Mitchell => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILTERS: [Filter; 4] = [Filter::Box, Filter::Tent, Filter::Gaussian { sigma: 0.5 }, Filter::Mitchell];

    /// ∫ g(x) f(x) dx by the samples themselves.
    fn mean(filter: Filter, g: impl Fn(f64) -> f64) -> f64 {
        let table = FilterTable::new(filter);
        let n = 100_000;
        (0..n).map(|i| table.sample((f64::from(i) + 0.5) / f64::from(n))).map(|(x, w)| w * g(x)).sum::<f64>()
            / f64::from(n)
    }

    #[test]
    fn weights_sum_to_one_and_are_even() {
        for filter in FILTERS {
            assert!((mean(filter, |_| 1.0) - 1.0).abs() < 1e-3, "{filter:?}");
            assert!(mean(filter, |x| x).abs() < 1e-3, "{filter:?}");
        }
    }

    #[test]
    fn second_moments_are_the_textbooks() {
        // ∫x² f: box 1/12, tent 1/6; Mitchell's cubic with B = 1/3: B/3 − ... = 1/9 by direct integration.
        assert!((mean(Filter::Box, |x| x * x) - 1.0 / 12.0).abs() < 1e-6);
        assert!((mean(Filter::Tent, |x| x * x) - 1.0 / 6.0).abs() < 1e-3);
        let direct: f64 = (-20_000..20_000)
            .map(|i| (f64::from(i) + 0.5) * 1e-4)
            .map(|x| x * x * value(Filter::Mitchell, x) * 1e-4)
            .sum();
        assert!((mean(Filter::Mitchell, |x| x * x) - direct).abs() < 1e-3, "{direct}");
    }

    #[test]
    fn mitchell_has_its_negative_lobes() {
        assert!(mean(Filter::Mitchell, |x| if x.abs() > 1.2 { 1.0 } else { 0.0 }) < -0.01);
    }
}
