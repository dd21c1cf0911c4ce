//! Textures of a line: colours at stops, and their interpolation (a "1-D texture" of 5.5). Ramps also turn the numbers
//! of functions of space into colours.
//!
//! Means over an interval are exact, from the ramp's antiderivative, so that a distant ramp doesn't alias.

use super::Wrap;
use crate::{OutOfRange, named};
use serde::{Deserialize, Serialize};

/// Colours at places of a line.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Ramp {
    /// The colours in the order of their places, at least one. Two at one place make a jump.
    pub stops: Vec<Stop>,
    /// The interpolation between them.
    pub interpolation: Interpolation,
}

/// A colour at a place.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Stop {
    /// The place of the stop.
    pub at: f32,
    /// Linear red, green, blue and alpha; not multiplied by alpha.
    pub color: [f32; 4],
}

/// The interpolation between two stops.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Interpolation {
    /// The colour of the earlier stop.
    Step,
    /// Linear interpolation.
    #[default]
    Linear,
    /// Interpolation by a cubic with a slope of zero at the stops.
    Smooth,
}

named!(Interpolation {
    Step => "step",
    Linear => "linear",
    Smooth => "smooth",
});

impl Default for Ramp {
    /// The ramp from black at 0 to white at 1.
    fn default() -> Ramp {
        let stop = |at: f32| Stop { at, color: [at, at, at, 1.0] };
        Ramp { stops: vec![stop(0.0), stop(1.0)], interpolation: Interpolation::Linear }
    }
}

impl Ramp {
    /// The largest number of stops.
    pub const MAX_STOPS: usize = 1 << 16;

    /// Checks the stops.
    ///
    /// # Errors
    /// A sentence that names the fault.
    pub fn check(&self) -> Result<(), OutOfRange> {
        if self.stops.is_empty() || self.stops.len() > Ramp::MAX_STOPS {
            return Err(OutOfRange::new(
                "stops",
                format!("are {} in number; 1 to {} are possible", self.stops.len(), Ramp::MAX_STOPS),
            ));
        }
        for stop in &self.stops {
            if !stop.at.is_finite() || stop.color.iter().any(|v| !v.is_finite() || v.abs() > 1e30) {
                return Err(OutOfRange::new(
                    "stops",
                    format!("hold a number that can't be computed with, at {}", stop.at),
                ));
            }
            if !(0.0..=1.0).contains(&stop.color[3]) {
                return Err(OutOfRange::new(
                    "stops",
                    format!("hold an alpha of {}; it must be between 0 and 1", stop.color[3]),
                ));
            }
        }
        match self.stops.windows(2).find(|pair| pair[0].at > pair[1].at) {
            Some(pair) => Err(OutOfRange::new(
                "stops",
                format!("must stand in order, but one at {} comes after {}", pair[1].at, pair[0].at),
            )),
            None => Ok(()),
        }
    }
}

/// The runtime form of a ramp.
#[derive(Debug)]
pub(super) struct RampTable {
    stops: Vec<Stop>,
    interpolation: Interpolation,
    /// The integral from the first stop to each stop.
    integrals: Vec<[f64; 4]>,
    wrap: Wrap,
    /// The integral over 0 to 1, for ramps that repeat.
    period: [f64; 4],
}

impl RampTable {
    /// The table of a ramp. `wrap` is the continuation outside of 0 to 1; [`Wrap::Clamp`] keeps stops outside of 0 to
    /// 1, and continues the outermost ones.
    pub(super) fn new(ramp: &Ramp, wrap: Wrap) -> RampTable {
        // Colours are multiplied by alpha, so that the colour of a transparent stop has no effect.
        let multiply = |s: &Stop| {
            let [r, g, b, a] = s.color;
            Stop { at: s.at, color: [r * a, g * a, b * a, a] }
        };
        let stops: Vec<Stop> = ramp.stops.iter().map(multiply).collect();
        let mut integrals = vec![[0.0; 4]];
        for (i, pair) in stops.windows(2).enumerate() {
            let length = f64::from(pair[1].at) - f64::from(pair[0].at);
            let share = if ramp.interpolation == Interpolation::Step { 0.0 } else { 0.5 };
            let last = integrals[i];
            integrals.push(std::array::from_fn(|c| {
                let (a, b) = (f64::from(pair[0].color[c]), f64::from(pair[1].color[c]));
                last[c] + length * (a + (b - a) * share)
            }));
        }
        let mut table = RampTable { stops, interpolation: ramp.interpolation, integrals, wrap, period: [0.0; 4] };
        let (start, end) = (table.integral_to(0.0), table.integral_to(1.0));
        table.period = std::array::from_fn(|c| end[c] - start[c]);
        table
    }

    /// Whether the mean over every interval around t equals the value at t, for t in 0 to 1.
    pub(super) fn is_linear(&self) -> bool {
        let [first, last] = self.stops.as_slice() else { return self.stops.len() == 1 };
        self.interpolation == Interpolation::Linear && first.at <= 0.0 && last.at >= 1.0
    }

    /// The mean colour over t − radius to t + radius, not multiplied by alpha.
    pub(super) fn mean(&self, t: f64, radius: f64) -> [f32; 4] {
        let t = if t.is_finite() { t.clamp(-1e12, 1e12) } else { 0.0 };
        let value = if radius > 1e-7 * t.abs().max(1.0) {
            let radius = radius.min(1e12);
            let (low, high) = (self.integral(t - radius), self.integral(t + radius));
            std::array::from_fn(|c| ((high[c] - low[c]) / (2.0 * radius)) as f32)
        } else {
            self.value(t)
        };
        let [r, g, b, a] = value;
        if a > 0.0 && a < 1.0 { [r / a, g / a, b / a, a] } else { value }
    }

    fn value(&self, t: f64) -> [f32; 4] {
        let t = match self.wrap {
            Wrap::Clamp => t,
            // The end point belongs to the ramp.
            _ if (0.0..=1.0).contains(&t) => t,
            Wrap::Repeat => t - t.floor(),
            Wrap::Mirror => {
                let t = t - 2.0 * (t * 0.5).floor();
                t.min(2.0 - t)
            }
            Wrap::Black => return [0.0, 0.0, 0.0, 1.0],
            Wrap::Transparent => return [0.0; 4],
        };
        let after = self.stops.partition_point(|stop| f64::from(stop.at) <= t);
        let (Some(before), Some(next)) = (after.checked_sub(1).map(|i| self.stops[i]), self.stops.get(after)) else {
            return if after == 0 { self.stops[0].color } else { self.stops[self.stops.len() - 1].color };
        };
        let share = self.share(t, before.at, next.at) as f32;
        std::array::from_fn(|c| before.color[c] + (next.color[c] - before.color[c]) * share)
    }

    /// The weight of the next stop's colour at t.
    fn share(&self, t: f64, from: f32, to: f32) -> f64 {
        let s = (t - f64::from(from)) / (f64::from(to) - f64::from(from));
        match self.interpolation {
            Interpolation::Step => 0.0,
            Interpolation::Linear => s,
            Interpolation::Smooth => s * s * (3.0 - 2.0 * s),
        }
    }

    /// An antiderivative of the wrapped ramp.
    fn integral(&self, t: f64) -> [f64; 4] {
        let start = self.integral_to(0.0);
        let inside = |t: f64| {
            let end = self.integral_to(t);
            std::array::from_fn(|c| end[c] - start[c])
        };
        match self.wrap {
            Wrap::Clamp => self.integral_to(t),
            Wrap::Repeat => {
                let whole = t.floor();
                let part: [f64; 4] = inside(t - whole);
                std::array::from_fn(|c| whole * self.period[c] + part[c])
            }
            Wrap::Mirror => {
                let whole = 2.0 * (t * 0.5).floor();
                let rest = t - whole;
                let part: [f64; 4] = inside(rest.min(2.0 - rest));
                let part = if rest <= 1.0 { part } else { std::array::from_fn(|c| 2.0 * self.period[c] - part[c]) };
                std::array::from_fn(|c| whole * self.period[c] + part[c])
            }
            Wrap::Black | Wrap::Transparent => {
                let mut all: [f64; 4] = inside(t.clamp(0.0, 1.0));
                if self.wrap == Wrap::Black {
                    all[3] += t - t.clamp(0.0, 1.0);
                }
                all
            }
        }
    }

    /// The integral of the ramp from its first stop to t, without wrapping.
    fn integral_to(&self, t: f64) -> [f64; 4] {
        let after = self.stops.partition_point(|stop| f64::from(stop.at) <= t);
        let index = after.saturating_sub(1);
        let before = self.stops[index];
        let along = t - f64::from(before.at);
        let base = self.integrals[index];
        let (Some(next), true) = (self.stops.get(after), after > 0) else {
            return std::array::from_fn(|c| base[c] + along * f64::from(before.color[c]));
        };
        let length = f64::from(next.at) - f64::from(before.at);
        let s = along / length;
        let share = match self.interpolation {
            Interpolation::Step => 0.0,
            Interpolation::Linear => 0.5 * s * s,
            Interpolation::Smooth => s * s * s * (1.0 - 0.5 * s),
        };
        std::array::from_fn(|c| {
            let (a, b) = (f64::from(before.color[c]), f64::from(next.color[c]));
            base[c] + along * a + length * share * (b - a)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp(interpolation: Interpolation) -> Ramp {
        let stop = |at: f32, r: f32, a: f32| Stop { at, color: [r, 0.5, 1.0 - r, a] };
        Ramp {
            stops: vec![stop(0.1, 0.0, 1.0), stop(0.4, 1.0, 0.5), stop(0.4, 0.2, 1.0), stop(0.9, 0.7, 0.0)],
            interpolation,
        }
    }

    #[test]
    fn stops_have_their_colours() {
        for interpolation in [Interpolation::Step, Interpolation::Linear, Interpolation::Smooth] {
            let table = RampTable::new(&ramp(interpolation), Wrap::Clamp);
            assert_eq!(table.mean(-3.0, 0.0), [0.0, 0.5, 1.0, 1.0]);
            assert_eq!(table.mean(f64::from(0.4f32), 0.0), [0.2, 0.5, 0.8, 1.0]);
            assert_eq!(table.mean(0.95, 0.0), [0.0; 4]);
        }
        let middle =
            |interpolation| RampTable::new(&Ramp { interpolation, ..Ramp::default() }, Wrap::Clamp).mean(0.25, 0.0)[0];
        assert_eq!(middle(Interpolation::Step), 0.0);
        assert_eq!(middle(Interpolation::Linear), 0.25);
        assert_eq!(middle(Interpolation::Smooth), 0.15625);
    }

    #[test]
    fn means_are_those_of_many_samples() {
        for interpolation in [Interpolation::Step, Interpolation::Linear, Interpolation::Smooth] {
            for wrap in [Wrap::Clamp, Wrap::Repeat, Wrap::Mirror, Wrap::Black, Wrap::Transparent] {
                let table = RampTable::new(&ramp(interpolation), wrap);
                for (t, radius) in [(0.3, 0.05), (0.4, 0.2), (0.0, 0.3), (1.0, 0.7), (-2.3, 1.9), (7.7, 5.0)] {
                    let mut sum = [0.0; 4];
                    let count = 20_000;
                    for i in 0..count {
                        let at = t + radius * (2.0 * (f64::from(i) + 0.5) / f64::from(count) - 1.0);
                        let [r, g, b, a] = table.mean(at, 0.0).map(f64::from);
                        for (s, v) in sum.iter_mut().zip([r * a, g * a, b * a, a]) {
                            *s += v / f64::from(count);
                        }
                    }
                    let [r, g, b, a] = table.mean(t, radius).map(f64::from);
                    for (got, exact) in [r * a, g * a, b * a, a].into_iter().zip(sum) {
                        assert!(
                            (got - exact).abs() < 1e-3,
                            "{interpolation:?} {wrap:?} {t} ± {radius}: {got} for {exact}"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn wrong_stops_are_told() {
        let mut wrong = ramp(Interpolation::Linear);
        wrong.stops.swap(0, 3);
        assert!(wrong.check().unwrap_err().to_string().contains("one at 0.4 comes after 0.9"));
        wrong.stops[0].color[3] = 2.0;
        assert!(wrong.check().unwrap_err().to_string().contains("alpha of 2"));
        wrong.stops.clear();
        let error = wrong.check().unwrap_err();
        assert_eq!(error.field, Some("stops"), "{error}");
    }
}
