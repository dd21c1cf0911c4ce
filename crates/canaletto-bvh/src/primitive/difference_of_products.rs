//! Differences of products with the right sign, after Dekker, "A floating-point technique for extending the available
//! precision" (1971). Fused multiply-add would be shorter, but std falls back to a slow software version where the CPU
//! has none.

/// `a * b` as rounded product and exact remainder.
pub(crate) fn two_product(a: f64, b: f64) -> (f64, f64) {
    let (ah, al) = halves(a);
    let (bh, bl) = halves(b);
    let p = a * b;
    (p, ((ah * bh - p) + ah * bl + al * bh) + al * bl)
}

/// Two numbers of 26 bits that add up to `a` (Veltkamp).
fn halves(a: f64) -> (f64, f64) {
    let c = 134_217_729.0 * a; // 2²⁷ + 1
    let high = c - (c - a);
    (high, a - high)
}

/// 2⁻²⁹: a difference that is a smaller fraction of its products has lost too many digits.
pub(crate) const CANCELLED: f64 = 1.0 / (1u64 << 29) as f64;

/// `a * b - c * d`, off by no more than 2⁻²³ of itself, and so never of the wrong sign. Swapping the products negates
/// the result exactly.
#[inline]
pub(crate) fn difference_of_products(a: f64, b: f64, c: f64, d: f64) -> f64 {
    let p = a * b;
    let q = c * d;
    let e = p - q;
    if e.abs() > (p.abs() + q.abs()) * CANCELLED {
        return e;
    }
    careful(a, b, c, d)
}

/// The difference when p and q nearly cancel. Then p − q is exact (Sterbenz). The exact result is the sum of p − q, of
/// the remainders' difference, and of what rounding took from the latter. Each term is smaller than the last place of
/// the one before, so that only the last rounding counts.
#[cold]
fn careful(a: f64, b: f64, c: f64, d: f64) -> f64 {
    let (p, p_rest) = two_product(a, b);
    let (q, q_rest) = two_product(c, d);
    let (rest, lost) = two_sum(p_rest, -q_rest);
    let (high, low) = two_sum(p - q, rest);
    high + (low + lost)
}

/// `a + b` as rounded sum and exact remainder (Knuth).
fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let s = a + b;
    let b_part = s - a;
    (s, (a - (s - b_part)) + (b - b_part))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_remainder_is_exact() {
        // 53-bit integers, whose products fit in i128.
        let mut x = 0x9e37_79b9_7f4a_7c15_u64;
        for _ in 0..10_000 {
            let mut next = || {
                x ^= x << 13;
                x ^= x >> 7;
                x ^= x << 17;
                (x >> 11) as i64
            };
            let (a, b) = (next(), next());
            let (p, rest) = two_product(a as f64, b as f64);
            assert_eq!(p as i128 + rest as i128, a as i128 * b as i128);
        }
    }

    #[test]
    fn a_difference_is_right_to_many_digits_however_much_cancels() {
        let mut x = 0x9e37_79b9_7f4a_7c15_u64;
        for i in 0..100_000 {
            let mut next = || {
                x ^= x << 13;
                x ^= x >> 7;
                x ^= x << 17;
                (x >> 12) as i64
            };
            // a b and c d agree in all but a few or in most of the leading bits.
            let (a, b) = (next(), next());
            let shift = i % 52;
            let (c, d) = (a + (next() >> shift), b - (next() >> (51 - shift)));
            let exact = a as i128 * b as i128 - c as i128 * d as i128;
            let e = difference_of_products(a as f64, b as f64, c as f64, d as f64);
            assert!((e as i128 - exact).abs() <= exact.abs() >> 23, "{a} {b} {c} {d}");
        }
    }

    #[test]
    fn a_sign_is_never_wrong() {
        // (n + i)(n + j) and (n + k)(n + l) with n ~ 2^52 agree in all of the leading bits.
        let n = (1i64 << 52) + 12345;
        for i in 0..8 {
            for j in 0..8 {
                for k in 0..8 {
                    let l = i + j - k;
                    let [a, b, c, d] = [n + i, n + j, n + k, n + l];
                    let exact = a as i128 * b as i128 - c as i128 * d as i128;
                    let e = difference_of_products(a as f64, b as f64, c as f64, d as f64);
                    assert_eq!(e as i128, exact);
                    assert_eq!(-e, difference_of_products(c as f64, d as f64, a as f64, b as f64));
                }
            }
        }
    }
}
