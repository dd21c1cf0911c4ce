//! Real roots of the polynomials that curved surfaces lead to, in `f64`.

/// Real roots of a t² + b t + c = 0 in ascending order, without cancellation (Press et al., *Numerical Recipes*, §5.6):
/// the root of larger size by the sum of equal signs, the other from the product of the roots.
/// A degenerate equation (a = 0) gives its single root twice; none if there is none.
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
