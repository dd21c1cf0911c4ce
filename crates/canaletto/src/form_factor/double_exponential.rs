//! Quadrature of functions that are analytic inside an interval, with any integrable singularity at its ends (Takahasi
//! and Mori, *Double Exponential Formulas for Numerical Integration*, 1974).

use std::f64::consts::PI;

/// The nodes at |t| ≤ 3.25 are those whose weight is not lost in rounding.
const REACH: f64 = 3.25;
/// The coarsest step between nodes.
const FIRST_STEP: f64 = 0.5;
/// The largest number of times that the step is halved.
const MOST_HALVINGS: usize = 7;

/// A node: the share of the interval between it and the nearer end, and the weight of a step of 1.
#[derive(Clone, Copy, Debug)]
struct Node {
    share: f64,
    weight: f64,
}

/// The nodes of the double exponential rule, those of each halving of the step apart.
#[derive(Clone, Debug)]
pub(super) struct DoubleExponential {
    levels: Vec<Vec<Node>>,
}

/// An integral, with a bound of its quadrature error.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Integral {
    pub value: f64,
    /// The change at the last halving of the step.
    pub error: f64,
}

impl DoubleExponential {
    pub(super) fn new() -> DoubleExponential {
        let level = |level: usize| {
            let step = FIRST_STEP / f64::from(1u32 << level);
            // The first level has all nodes, and each further level those between.
            let stride = if level == 0 { 1 } else { 2 };
            let count = (REACH / step) as u32 + 1;
            (u32::from(level > 0)..count).step_by(stride).map(|k| Node::at(f64::from(k) * step)).collect()
        };
        DoubleExponential { levels: (0..=MOST_HALVINGS).map(level).collect() }
    }

    /// The integral of `f` from `from` to `to`. The step is halved until the change is at most `tolerance`.
    pub(super) fn integrate(&self, from: f64, to: f64, tolerance: f64, mut f: impl FnMut(f64) -> f64) -> Integral {
        let length = to - from;
        let mut integral = Integral::default();
        let (mut sum, mut step) = (0.0, FIRST_STEP);
        for (level, nodes) in self.levels.iter().enumerate() {
            for node in nodes {
                let offset = length * node.share;
                // The middle of the interval is a single node.
                let both = if node.share < 0.5 { f(from + offset) + f(to - offset) } else { f(from + offset) };
                sum += node.weight * both;
            }
            let value = sum * step * length;
            integral = Integral { value, error: (value - integral.value).abs() };
            if level > 1 && integral.error <= tolerance {
                break;
            }
            step *= 0.5;
        }
        integral
    }
}

impl Node {
    /// x = tanh(π/2 sinh t), mapped from −1..1 to shares of the interval.
    fn at(t: f64) -> Node {
        let share = 1.0 / (1.0 + libm::exp(PI * libm::sinh(t)));
        Node { share, weight: PI * libm::cosh(t) * share * (1.0 - share) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn singular_ends_are_harmless() {
        let rule = DoubleExponential::new();
        let check = |name: &str, f: fn(f64) -> f64, from: f64, to: f64, exact: f64| {
            let Integral { value, error } = rule.integrate(from, to, 1e-13, f);
            assert!(
                (value - exact).abs() <= error + 1e-14 && error < 1e-10,
                "{name}: {value} ± {error}, exactly {exact}"
            );
        };
        check("polynomial", |x| x * x, -1.0, 2.0, 3.0);
        check("x ln x", |x| if x > 0.0 { x * x.ln() } else { 0.0 }, 0.0, 1.0, -0.25);
        check("semicircle", |x| (1.0 - x * x).max(0.0).sqrt(), -1.0, 1.0, PI / 2.0);
        check("near pole", |x| 1e-4 / (x * x + 1e-8), 0.0, 1.0, (1e4f64).atan());
    }
}
