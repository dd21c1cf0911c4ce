//! Real roots of the polynomials of curved surfaces, in `f64`.

/// Real roots of a t² + b t + c = 0 in ascending order, without cancellation (Press et al., *Numerical Recipes*, §5.6).
/// The root of larger magnitude comes from the sum of terms of equal sign, the other from the product of the roots. A
/// degenerate equation (a = 0) returns its single root twice. None if there is no root.
pub fn quadratic(a: f64, b: f64, c: f64) -> Option<[f64; 2]> {
    if a == 0.0 {
        let t = -c / b;
        return (b != 0.0).then_some([t, t]);
    }
    let discriminant = b * b - 4.0 * a * c; // (5.18)
    if discriminant.is_nan() || discriminant < 0.0 {
        return None;
    }
    let q = -0.5 * (b + discriminant.sqrt().copysign(b));
    let (t1, t2) = if q == 0.0 { (0.0, 0.0) } else { (q / a, c / q) };
    Some(if t1 <= t2 { [t1, t2] } else { [t2, t1] })
}

/// Up to four real roots in ascending order.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Roots {
    values: [f64; 4],
    len: usize,
}

impl Roots {
    fn push(&mut self, x: f64) {
        self.values[self.len] = x;
        self.len += 1;
    }

    /// The roots with each replaced by `f` of it.
    pub fn map(mut self, f: impl Fn(f64) -> f64) -> Roots {
        self.values[..self.len].iter_mut().for_each(|x| *x = f(*x));
        self
    }
}

impl std::ops::Deref for Roots {
    type Target = [f64];
    fn deref(&self) -> &[f64] {
        &self.values[..self.len]
    }
}

/// Real roots in [low, high] of c₀ + c₁ x + c₂ x² + c₃ x³ + c₄ x⁴.
///
/// Between two adjacent zeros of its derivative a polynomial is monotone, so a change of sign brackets exactly one
/// root. The cubic's brackets come from its own derivative likewise. Unlike Ferrari's formula this loses no digits to
/// cancellation and can't return a root outside the interval. A root of even order counts only if the polynomial is
/// exactly zero there.
pub fn quartic(c: [f64; 5], low: f64, high: f64) -> Roots {
    let cubic = [c[1], 2.0 * c[2], 3.0 * c[3], 4.0 * c[4]];
    let turns = quadratic(3.0 * cubic[3], 2.0 * cubic[2], cubic[1]);
    let cubic_roots = between(&cubic, turns.as_ref().map_or(&[], |t| t), low, high);
    between(&c, &cubic_roots, low, high)
}

/// The roots in [low, high] of a polynomial that is monotone between the ascending `turns`; at most four.
fn between(c: &[f64], turns: &[f64], low: f64, high: f64) -> Roots {
    let mut roots = Roots::default();
    let inner = turns.iter().copied().filter(|x| low < *x && *x < high);
    let (mut a, mut fa) = (low, evaluate(c, low).0);
    for b in inner.chain([high]) {
        let fb = evaluate(c, b).0;
        // A zero at b belongs to the next interval, except at the end.
        let at_end = fb == 0.0 && b == high && a != b;
        if roots.len < 4 && fa == 0.0 {
            roots.push(a);
        } else if roots.len < 4 && (fa < 0.0) != (fb < 0.0) && fb != 0.0 {
            roots.push(bracketed(c, a, b, fa < 0.0));
        }
        if roots.len < 4 && at_end {
            roots.push(b);
        }
        (a, fa) = (b, fb);
    }
    roots
}

/// The root in (a, b), where the sign changes. Newton's steps are replaced by halving where they leave the bracket or
/// shrink it too slowly (Press et al., §9.4).
fn bracketed(c: &[f64], a: f64, b: f64, rising: bool) -> f64 {
    // f(below) < 0 < f(above).
    let (mut below, mut above) = if rising { (a, b) } else { (b, a) };
    let mut x = 0.5 * (a + b);
    let (mut step, mut last) = ((b - a).abs(), (b - a).abs());
    for _ in 0..128 {
        let (f, slope) = evaluate(c, x);
        if f == 0.0 {
            return x;
        }
        if f < 0.0 {
            below = x;
        } else {
            above = x;
        }
        let newton = x - f / slope;
        let inside = newton > below.min(above) && newton < below.max(above);
        let next = if inside && (2.0 * f).abs() < (last * slope).abs() { newton } else { 0.5 * (below + above) };
        (last, step) = (step, (next - x).abs());
        if next == x || step == 0.0 {
            return next;
        }
        x = next;
    }
    x
}

/// The polynomial and its derivative at x, by Horner's rule.
fn evaluate(c: &[f64], x: f64) -> (f64, f64) {
    c.iter().rev().fold((0.0, 0.0), |(f, slope), &k| (f * x + k, slope * x + f))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// (x − a)(x − b)(x − c)(x − d), expanded.
    fn product(r: [f64; 4]) -> [f64; 5] {
        r.iter().fold([1.0, 0.0, 0.0, 0.0, 0.0], |c, x| {
            std::array::from_fn(|i| if i == 0 { 0.0 } else { c[i - 1] } - x * c[i])
        })
    }

    fn assert_roots(found: &[f64], expected: &[f64]) {
        assert_eq!(found.len(), expected.len(), "{found:?} for {expected:?}");
        for (f, e) in found.iter().zip(expected) {
            assert!((f - e).abs() < 1e-9, "{found:?} for {expected:?}");
        }
    }

    #[test]
    fn four_roots_are_found_in_order() {
        assert_roots(&quartic(product([0.5, -1.0, 1.5, 0.25]), -2.0, 2.0), &[-1.0, 0.25, 0.5, 1.5]);
    }

    #[test]
    fn roots_outside_the_interval_are_left_out() {
        assert_roots(&quartic(product([0.5, -1.0, 1.5, 0.25]), 0.0, 1.0), &[0.25, 0.5]);
    }

    #[test]
    fn close_pairs_are_told_apart() {
        assert_roots(
            &quartic(product([0.5, 0.5 + 1e-5, -0.5, -0.5 - 1e-5]), -1.0, 1.0),
            &[-0.50001, -0.5, 0.5, 0.50001],
        );
    }

    #[test]
    fn a_quartic_without_real_roots_has_none() {
        assert!(quartic([1.0, 0.0, 1.0, 0.0, 1.0], -10.0, 10.0).is_empty());
    }

    #[test]
    fn roots_at_the_ends_count_once() {
        assert_roots(&quartic(product([0.0, 1.0, 2.0, 3.0]), 0.0, 2.0), &[0.0, 1.0, 2.0]);
    }

    #[test]
    fn a_double_root_where_the_polynomial_is_exactly_zero_counts_once() {
        assert_roots(&quartic([0.0, 0.0, 1.0, 0.0, 1.0], -1.0, 1.0), &[0.0]);
    }

    #[test]
    fn the_smaller_root_of_a_quadratic_loses_no_digits() {
        let [small, _] = quadratic(1.0, -1e9, 1.0).unwrap();
        assert_eq!(small, 1e-9);
    }
}
