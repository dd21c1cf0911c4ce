//! Reconstruction by filter importance sampling: a pixel's samples are distributed like the filter, all with equal
//! weight (Ernst, Stamminger & Greiner, *Filter Importance Sampling*, 2006).
//!
//! Every sample then belongs to one pixel. A tile thus needs no samples of its neighbours, and a pixel's explanation is
//! complete. A filter with negative lobes is the difference of two densities, f = P f₊ − N f₋ with P − N = 1. The
//! number of samples of each part doesn't depend on chance. The pixel is P times the mean of the positive part less N
//! times the mean of the negative part. No sum of weights can cancel.

use crate::scene::Filter;

/// The number of bins of the tabulated distribution of one axis.
const BINS: usize = 1024;

/// A separable filter, ready to be sampled.
#[derive(Clone, Debug)]
pub struct FilterTable {
    filter: Filter,
    /// The positive and the negative part of f along one axis; none for the box.
    lobes: Option<[Lobe; 2]>,
    /// ∫ f₊ and ∫ f₋ along one axis; their difference is 1.
    masses: [f64; 2],
}

/// A part of the filter with one sign.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// The part where the filter is positive.
    Above,
    /// The part where the filter is negative.
    Below,
}

/// The division of a pixel's samples between the parts of its filter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Division {
    /// The number of samples of the positive part, which come first.
    pub above: u32,
    /// The number of samples of the negative part.
    pub below: u32,
    /// The weight of each sample of the positive and of the negative part. The sum of all weights is the number of
    /// samples.
    pub weights: [f64; 2],
}

/// A density along one axis: linear within each of equal bins.
#[derive(Clone, Debug)]
struct Lobe {
    radius: f64,
    /// The density at the bins' ends.
    density: Vec<f64>,
    /// The cumulative distribution at the bins' ends.
    cumulative: Vec<f64>,
}

impl Lobe {
    /// The lobe with a density proportional to `f` on [−radius, radius], and ∫ f. The density is 0 where f is 0
    /// everywhere.
    fn new(radius: f64, f: impl Fn(f64) -> f64) -> (Lobe, f64) {
        let width = 2.0 * radius / BINS as f64;
        let mut density: Vec<f64> =
            (0..=BINS).map(|i| f(radius * (2.0 * i as f64 / BINS as f64 - 1.0)).max(0.0)).collect();
        let mut sum = 0.0;
        let mut cumulative: Vec<f64> = std::iter::once(0.0)
            .chain(density.windows(2).map(|ends| {
                sum += 0.5 * width * (ends[0] + ends[1]);
                sum
            }))
            .collect();
        if sum > 0.0 {
            density.iter_mut().chain(&mut cumulative).for_each(|v| *v /= sum);
            cumulative[BINS] = 1.0;
        }
        (Lobe { radius, density, cumulative }, sum)
    }

    /// The place below which the share `u` of the density lies.
    fn quantile(&self, u: f64) -> f64 {
        let bin = self.cumulative.partition_point(|&c| c <= u).clamp(1, BINS) - 1;
        let width = 2.0 * self.radius / BINS as f64;
        let (a, b) = (self.density[bin], self.density[bin + 1]);
        // a t + (b − a) t²/2 = r, without cancellation.
        let rest = (u - self.cumulative[bin]) / width;
        let root = (a * a + 2.0 * (b - a) * rest).max(0.0).sqrt();
        let inside = if a + root > 0.0 { (2.0 * rest / (a + root)).clamp(0.0, 1.0) } else { 0.5 };
        -self.radius + (bin as f64 + inside) * width
    }
}

impl FilterTable {
    /// The table of a filter.
    pub fn new(filter: Filter) -> FilterTable {
        if filter == Filter::Box {
            return FilterTable { filter, lobes: None, masses: [1.0, 0.0] };
        }
        let radius = radius(filter);
        let (above, p) = Lobe::new(radius, |x| value(filter, x));
        let (below, n) = Lobe::new(radius, |x| -value(filter, x));
        FilterTable { filter, lobes: Some([above, below]), masses: [p / (p - n), n / (p - n)] }
    }

    /// The filter's radius along each axis, in pixels.
    pub fn radius(&self) -> f64 {
        radius(self.filter)
    }

    /// The value of f at an offset from the pixel's centre.
    pub fn value(&self, [x, y]: [f64; 2]) -> f64 {
        let reach = self.radius();
        let along = |x: f64| if x.abs() > reach { 0.0 } else { value(self.filter, x) };
        along(x) * along(y)
    }

    /// The integrals P and N over the parts where the filter is positive and negative.
    fn integrals(&self) -> [f64; 2] {
        let [p, n] = self.masses;
        [p * p + n * n, 2.0 * p * n]
    }

    /// Divides `count` samples. The number in the negative part is a multiple of `step`. Fewer than `step`² samples, or
    /// a single one, are all in the positive part.
    pub fn divide(&self, count: u32, step: u32) -> Division {
        let [p, n] = self.integrals();
        if n == 0.0 || count < 2 || count < step * step {
            return Division { above: count, below: 0, weights: [1.0, 0.0] };
        }
        // In proportion to the integrals, as importance sampling requires, but at least one step.
        let steps = (f64::from(count / step) * n / (p + n)).round().max(1.0) as u32;
        let below = steps * step;
        let above = count - below;
        let weight = |integral: f64, samples: u32| integral * f64::from(count) / f64::from(samples);
        Division { above, below, weights: [weight(p, above), -weight(n, below)] }
    }

    /// Maps a point of [0, 1)² to an offset from the pixel's centre in pixels. Equal areas map to equal parts of ∫ |f|.
    #[inline]
    pub fn place(&self, part: Part, [u, v]: [f64; 2]) -> [f64; 2] {
        let Some([above, below]) = &self.lobes else { return [u - 0.5, v - 0.5] };
        let [p, n] = self.masses;
        match part {
            // The positive part: the middle, where both factors are positive, and the corners, where both are negative.
            Part::Above => {
                let share = p * p / (p * p + n * n);
                if u < share {
                    [above.quantile(u / share), above.quantile(v)]
                } else {
                    [below.quantile((u - share) / (1.0 - share)), below.quantile(v)]
                }
            }
            // The negative part: first below and above the middle, then beside it.
            Part::Below if u < 0.5 => [above.quantile(2.0 * u), below.quantile(v)],
            Part::Below => [below.quantile(2.0 * u - 1.0), above.quantile(v)],
        }
    }
}

fn radius(filter: Filter) -> f64 {
    match filter {
        Filter::Box => 0.5,
        Filter::Tent => 1.0,
        Filter::Gaussian { sigma } => 3.0 * f64::from(sigma),
        Filter::Mitchell => 2.0,
    }
}

/// The value f(x) along one axis, with integral 1.
pub(crate) fn value(filter: Filter, x: f64) -> f64 {
    let x = x.abs();
    match filter {
        Filter::Box => 1.0,
        Filter::Tent => (1.0 - x).max(0.0),
        Filter::Gaussian { sigma } => {
            let s = f64::from(sigma);
            let gauss = |x: f64| libm::exp(-0.5 * (x / s) * (x / s)) / (s * (2.0 * std::f64::consts::PI).sqrt());
            // Cut off at 3 σ, lowered so that it ends in 0, and divided by its remaining integral: erf(3/√2) − 6 φ(3).
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

    const FILTERS: [Filter; 5] =
        [Filter::Box, Filter::Tent, Filter::Gaussian { sigma: 0.5 }, Filter::Gaussian { sigma: 4.0 }, Filter::Mitchell];

    /// ∫ g f over the plane from the places of samples, where g depends on the coordinate along one axis. Cells of the
    /// sum end where another lobe begins.
    fn mean(filter: Filter, axis: usize, g: impl Fn(f64) -> f64) -> f64 {
        let table = FilterTable::new(filter);
        let [p, n] = table.masses;
        let cells = 100_000;
        let of = |part: Part, border: f64| {
            let mut sum = 0.0;
            for [from, to] in [[0.0, border], [border, 1.0]] {
                if to > from {
                    for cell in (0..cells).map(|i| (f64::from(i) + 0.5) / f64::from(cells)) {
                        let u = if axis == 0 { cell } else { 0.5 };
                        sum += (to - from) * g(table.place(part, [from + u * (to - from), cell])[axis]);
                    }
                }
            }
            sum / f64::from(cells)
        };
        let above = of(Part::Above, p * p / (p * p + n * n));
        let below = if n > 0.0 { of(Part::Below, 0.5) } else { 0.0 };
        let [p, n] = table.integrals();
        p * above - n * below
    }

    /// ∫ g f along one axis by a sum over f.
    fn direct(filter: Filter, g: impl Fn(f64) -> f64) -> f64 {
        let (n, radius) = (100_000, radius(filter));
        let step = 2.0 * radius / f64::from(n);
        (0..n).map(|i| (f64::from(i) + 0.5) * step - radius).map(|x| g(x) * value(filter, x) * step).sum()
    }

    #[test]
    fn places_are_spread_like_the_filter() {
        for filter in FILTERS {
            let r = radius(filter);
            assert!((direct(filter, |_| 1.0) - 1.0).abs() < 1e-5, "{filter:?}");
            for axis in [0, 1] {
                assert!((mean(filter, axis, |_| 1.0) - 1.0).abs() < 1e-12, "{filter:?}");
                let first = mean(filter, axis, |x| x);
                assert!(first.abs() < 1e-4 * r, "{filter:?}: {first}");
                for power in [2, 4] {
                    let moment = |x: f64| (x / r).powi(power);
                    let (got, exact) = (mean(filter, axis, moment), direct(filter, moment));
                    assert!((got - exact).abs() < 5e-5, "{filter:?}: moment {power} is {got} instead of {exact}");
                }
            }
        }
        assert!((mean(Filter::Tent, 0, |x| x * x) - 1.0 / 6.0).abs() < 1e-5);
        assert!(mean(Filter::Mitchell, 0, |x| if x.abs() > 1.2 { 1.0 } else { 0.0 }) < -0.01);
    }

    #[test]
    fn places_have_the_sign_of_their_part() {
        let table = FilterTable::new(Filter::Mitchell);
        for i in 0..10_000 {
            let uv = [f64::from(i % 100) / 99.99, f64::from(i / 100) / 99.99];
            for (part, sign) in [(Part::Above, 1.0), (Part::Below, -1.0)] {
                let at = table.place(part, uv);
                assert!(table.value(at) * sign > -1e-4, "{part:?} {uv:?} {at:?}");
            }
        }
    }

    #[test]
    fn samples_are_divided_without_chance() {
        for filter in FILTERS {
            let table = FilterTable::new(filter);
            let [p, n] = table.integrals();
            for count in 1..=300 {
                for step in [1, 4] {
                    let Division { above, below, weights } = table.divide(count, step);
                    assert!(above >= 1 && above + below == count && below % step == 0);
                    let (high, low) = (f64::from(above) * weights[0], f64::from(below) * weights[1]);
                    assert!((high + low - f64::from(count)).abs() < 1e-9 * f64::from(count));
                    // No picture of values from 0 to 1 has values below −N or above P.
                    assert!(high <= p * f64::from(count) * (1.0 + 1e-12));
                    assert!(low >= -n * f64::from(count) * (1.0 + 1e-12));
                    assert!(n == 0.0 || count < 2 || count < step * step || below > 0, "{count}");
                    assert!(n > 0.0 || weights[0] == 1.0);
                }
            }
        }
    }
}
