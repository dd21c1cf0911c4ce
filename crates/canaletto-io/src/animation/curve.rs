//! Interpolation of numbers between keys.
//!
//! Each number is interpolated by itself, by one of these eases:
//!
//! - `smooth`: a cubic through all keys with a continuous slope that never exceeds the keys. The slopes are those of F.
//!   N. Fritsch and J. Butland, "A method for constructing local monotone piecewise cubic interpolants" (SIAM J. Sci.
//!   Stat. Comput. 5, 1984), as in PCHIP, with its rule for the ends. It is the default because a number stays between
//!   its two keys: an opacity doesn't exceed 1, a radius doesn't pass 0, a ball doesn't sink into the floor.
//! - `spline`: a cubic with the slope of the parabola through a key and its neighbours (Catmull-Rom for keys at any
//!   times). It may exceed the keys.
//! - `linear`, `step`, and three eases from or to rest: `in` (u²), `out` (its mirror image) and `in-out` (3u² − 2u³).
//!   `in` and `out` describe motion under gravity exactly.

use canaletto::named;

/// The interpolation from a key to the next one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Ease {
    /// The value holds until the next key.
    Step,
    /// Linear interpolation.
    Linear,
    /// A cubic that stays between the keys.
    #[default]
    Smooth,
    /// A cubic that may exceed the keys.
    Spline,
    /// The value starts at rest and accelerates.
    In,
    /// The value decelerates to rest.
    Out,
    /// The value starts and ends at rest.
    InOut,
}

named!(Ease {
    Smooth => "smooth": "a cubic without corners at the keys that never goes beyond them (the default)",
    Spline => "spline": "a cubic that swings through the keys (Catmull-Rom), perhaps a little beyond them",
    Linear => "linear": "straight on",
    Step => "step": "the value holds, and jumps at the next key",
    In => "in": "from rest, ever faster: u², a body that falls",
    Out => "out": "ever slower, to rest: a body that rises",
    InOut => "in-out": "from rest to rest",
});

impl Ease {
    /// The interpolation weight at the fraction `u` of the time; `None` for eases that depend on neighbouring keys.
    pub(crate) fn share(self, u: f64) -> Option<f64> {
        match self {
            Ease::Step => Some(0.0),
            Ease::Linear => Some(u),
            Ease::In => Some(u * u),
            Ease::Out => Some(u * (2.0 - u)),
            Ease::InOut => Some(u * u * (3.0 - 2.0 * u)),
            Ease::Smooth | Ease::Spline => None,
        }
    }
}

/// The values at a time.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Key {
    pub(crate) time: f64,
    /// The numbers; every key of a curve has equally many.
    pub(crate) values: Vec<f64>,
    /// The interpolation to the next key.
    pub(crate) ease: Ease,
}

/// Numbers as a function of time, constant before the first and after the last key.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Curve {
    /// At least one key, at increasing times.
    keys: Vec<Key>,
}

impl Curve {
    /// A curve through at least one key. Their times must increase, and their numbers must be equally many.
    pub(crate) fn new(keys: Vec<Key>) -> Curve {
        debug_assert!(keys.windows(2).all(|k| k[0].time < k[1].time && k[0].values.len() == k[1].values.len()));
        Curve { keys }
    }

    pub(crate) fn keys(&self) -> &[Key] {
        &self.keys
    }

    /// The key at or before a time, and the fraction of the time to the next key; it is 0 at keys and beyond the ends.
    pub(crate) fn place(&self, time: f64) -> (usize, f64) {
        let after = self.keys.partition_point(|key| key.time <= time);
        if after == 0 || after == self.keys.len() {
            return (after.saturating_sub(1), 0.0);
        }
        let (a, b) = (self.keys[after - 1].time, self.keys[after].time);
        (after - 1, (time - a) / (b - a))
    }

    /// The numbers at a time.
    pub(crate) fn at(&self, time: f64) -> Vec<f64> {
        let (index, u) = self.place(time);
        let Some(key) = self.keys.get(index) else { return Vec::new() };
        if u == 0.0 {
            return key.values.clone();
        }
        (0..key.values.len()).map(|number| self.between(index, number, u)).collect()
    }

    /// A number at the fraction `u` between the key `index` and the next one.
    fn between(&self, index: usize, number: usize, u: f64) -> f64 {
        let (a, b) = (self.value(index, number), self.value(index + 1, number));
        let ease = self.keys[index].ease;
        if let Some(share) = ease.share(u) {
            return a + (b - a) * share;
        }
        // Slopes depend on a neighbouring segment only if it has an equal ease: a jump has no slope.
        let (before, after) = self.same_way(index);
        let slope = |i: usize| self.slope(i, number);
        let here = slope(index);
        let d_before = before.then(|| (slope(index - 1), self.span(index - 1)));
        let d_after = after.then(|| (slope(index + 1), self.span(index + 1)));
        let h = self.span(index);
        let tangent = if ease == Ease::Smooth { monotone } else { parabola };
        let m0 = tangent(here, h, d_before, d_after, true);
        let m1 = tangent(here, h, d_before, d_after, false);
        // The cubic Hermite interpolant.
        let v = 1.0 - u;
        let value = a * (v * v * (1.0 + 2.0 * u)) + b * (u * u * (1.0 + 2.0 * v)) + h * u * v * (m0 * v - m1 * u);
        if ease == Ease::Smooth { value.clamp(a.min(b), a.max(b)) } else { value }
    }

    /// Whether the segments before and after the one at `index` exist and have an equal ease.
    pub(crate) fn same_way(&self, index: usize) -> (bool, bool) {
        let same = |i: usize| self.keys[i].ease == self.keys[index].ease;
        (index > 0 && same(index - 1), index + 2 < self.keys.len() && same(index + 1))
    }

    fn value(&self, key: usize, number: usize) -> f64 {
        self.keys[key].values[number]
    }

    fn span(&self, index: usize) -> f64 {
        self.keys[index + 1].time - self.keys[index].time
    }

    fn slope(&self, index: usize, number: usize) -> f64 {
        (self.value(index + 1, number) - self.value(index, number)) / self.span(index)
    }
}

/// The slope and length of a neighbouring segment.
type Stretch = Option<(f64, f64)>;

/// The slope at one end of a segment of slope `d` and length `h`, after Fritsch and Butland.
fn monotone(d: f64, h: f64, before: Stretch, after: Stretch, start: bool) -> f64 {
    let (near, far) = if start { (before, after) } else { (after, before) };
    match (near, far) {
        (Some((e, g)), _) if d * e > 0.0 => {
            // The weighted harmonic mean; the shorter segment has the larger weight.
            let (w_d, w_e) = (2.0 * g + h, 2.0 * h + g);
            (w_d + w_e) / (w_d / d + w_e / e)
        }
        (Some(_), _) => 0.0,
        (None, Some((e, g))) => {
            let m = ((2.0 * h + g) * d - h * e) / (h + g);
            if m * d <= 0.0 {
                0.0
            } else if d * e <= 0.0 && m.abs() > 3.0 * d.abs() {
                3.0 * d
            } else {
                m
            }
        }
        (None, None) => d,
    }
}

/// The slope at one end of a segment, of the parabola through three keys.
fn parabola(d: f64, h: f64, before: Stretch, after: Stretch, start: bool) -> f64 {
    let (near, far) = if start { (before, after) } else { (after, before) };
    match (near, far) {
        (Some((e, g)), _) => (d * g + e * h) / (h + g),
        (None, Some((e, g))) => d + (d - e) * h / (h + g),
        (None, None) => d,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use canaletto::Named;

    fn curve(ease: Ease, keys: &[(f64, f64)]) -> Curve {
        Curve::new(keys.iter().map(|&(time, v)| Key { time, values: vec![v], ease }).collect())
    }

    fn at(curve: &Curve, time: f64) -> f64 {
        curve.at(time)[0]
    }

    #[test]
    fn keys_are_met_exactly_and_hold_outside() {
        let keys = [(1.0, 0.1), (4.0, 0.7), (5.5, -3.3), (9.0, 0.2)];
        for (&ease, name) in Ease::ALL.iter().zip(Ease::NAMES) {
            let curve = curve(ease, &keys);
            for (time, value) in keys {
                assert_eq!(at(&curve, time), value, "{name}");
            }
            assert_eq!((at(&curve, -1e9), at(&curve, 1e9)), (0.1, 0.2));
        }
    }

    /// Values computed by hand from the definitions.
    #[test]
    fn ways_between_two_keys() {
        let of = |ease, u: f64| at(&curve(ease, &[(0.0, 0.0), (8.0, 16.0)]), 8.0 * u);
        assert_eq!([0.25, 0.5, 0.75].map(|u| of(Ease::Step, u)), [0.0; 3]);
        for ease in [Ease::Linear, Ease::Smooth, Ease::Spline] {
            assert_eq!([0.25, 0.5, 0.75].map(|u| of(ease, u)), [4.0, 8.0, 12.0]);
        }
        assert_eq!([0.25, 0.5, 0.75].map(|u| of(Ease::In, u)), [1.0, 4.0, 9.0]);
        assert_eq!([0.25, 0.5, 0.75].map(|u| of(Ease::Out, u)), [7.0, 12.0, 15.0]);
        assert_eq!([0.25, 0.5, 0.75].map(|u| of(Ease::InOut, u)), [2.5, 8.0, 13.5]);
    }

    /// The spline of a parabola is the parabola, whatever the times of its keys.
    #[test]
    fn splines_reproduce_parabolas() {
        let p = |t: f64| 3.0 - 2.0 * t + 0.25 * t * t;
        let keys: Vec<(f64, f64)> = [0.0, 1.0, 3.0, 3.5, 7.0].map(|t| (t, p(t))).to_vec();
        let curve = curve(Ease::Spline, &keys);
        for i in 0..=70 {
            let t = f64::from(i) / 10.0;
            assert!((at(&curve, t) - p(t)).abs() < 1e-12, "{t}");
        }
    }

    /// Akima's data from the paper of Fritsch and Carlson, a standard test of monotone interpolants: flat segments stay
    /// flat, and nothing overshoots.
    #[test]
    fn smooth_stays_between_keys() {
        let data = [
            (0.0, 10.0),
            (2.0, 10.0),
            (3.0, 10.0),
            (5.0, 10.0),
            (6.0, 10.0),
            (8.0, 10.0),
            (9.0, 10.5),
            (11.0, 15.0),
            (12.0, 50.0),
            (14.0, 60.0),
            (15.0, 85.0),
        ];
        let curve = curve(Ease::Smooth, &data);
        let mut last = 10.0;
        for i in 0..=1500 {
            let value = at(&curve, f64::from(i) / 100.0);
            assert!(value >= last, "falls at {i}");
            assert!(i > 800 || value == 10.0);
            last = value;
        }
        // PCHIP's slopes: at 9 the harmonic mean of 0.5 (over 1) and 2.25 (over 2), at 11 that of 2.25 and 35.
        let (h8, h9) = (1.0, 2.0);
        let m9 = 3.0 * (h8 + h9) / ((2.0 * h9 + h8) / 0.5 + (h9 + 2.0 * h8) / 2.25);
        let m11 = 3.0 * (2.0 + 1.0) / ((2.0 * 1.0 + 2.0) / 2.25 + (1.0 + 2.0 * 2.0) / 35.0);
        let middle = (10.5 + 15.0) / 2.0 + 2.0 * (m9 - m11) / 8.0;
        assert!((at(&curve, 10.0) - middle).abs() < 1e-12);
    }

    #[test]
    fn slopes_are_continuous() {
        for ease in [Ease::Smooth, Ease::Spline] {
            let curve = curve(ease, &[(0.0, 1.0), (1.0, 3.0), (4.0, 4.0), (5.0, 9.0)]);
            for t in [1.0, 4.0] {
                let e = 1e-5;
                let (left, right) = ((at(&curve, t) - at(&curve, t - e)) / e, (at(&curve, t + e) - at(&curve, t)) / e);
                assert!((left - right).abs() < 1e-3, "{ease:?} at {t}: {left} and {right}");
            }
        }
    }

    #[test]
    fn a_jump_has_no_slope() {
        let mut curve = curve(Ease::Smooth, &[(0.0, 0.0), (1.0, 100.0), (2.0, 101.0)]);
        curve.keys[0].ease = Ease::Step;
        assert_eq!((at(&curve, 0.999), at(&curve, 1.5)), (0.0, 100.5));
    }
}
