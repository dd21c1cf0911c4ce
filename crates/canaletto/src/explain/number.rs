//! Numbers formatted for people.

use std::fmt::{self, Display, Formatter, LowerExp};

/// A number with the fewest digits that parse back to it. Very small and very large numbers have an exponent instead of
/// a row of zeros. Zero has no sign.
pub(super) struct Number<T>(pub(super) T);

/// The magnitudes that are written without an exponent.
const PLAIN: std::ops::Range<f64> = 1e-4..1e9;

impl<T: Copy + Display + LowerExp + Into<f64>> Display for Number<T> {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        let v: f64 = self.0.into();
        if v == 0.0 {
            f.write_str("0")
        } else if v.is_finite() && !PLAIN.contains(&v.abs()) {
            write!(f, "{:e}", self.0)
        } else {
            write!(f, "{}", self.0)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zeros_have_no_sign_and_small_numbers_an_exponent() {
        let of = |v: f32| Number(v).to_string();
        assert_eq!([of(-0.0), of(0.0), of(0.1), of(-1.5), of(0.0002)], ["0", "0", "0.1", "-1.5", "0.0002"]);
        assert_eq!([of(1e-30), of(-3.25e-7), of(f32::MAX)], ["1e-30", "-3.25e-7", "3.4028235e38"]);
        assert_eq!([of(f32::INFINITY), of(f32::NAN), of(123_456.7)], ["inf", "NaN", "123456.7"]);
        assert_eq!(Number(6.123_233_995_736_766e-17).to_string(), "6.123233995736766e-17");
        for v in [1e-30f32, 0.1, 3.402_823_5e38, 1.0 / 3.0, 9.99e8] {
            assert_eq!(of(v).parse::<f32>(), Ok(v));
        }
    }
}
