//! Numbers formatted for people.

use std::fmt::{self, Display, Formatter, LowerExp};

/// The digits that a number is written with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Digits {
    /// The fewest that parse back to the number.
    Exact,
    /// So many significant digits. All digits before the decimal point are written.
    Significant(u8),
}

/// A number. Very small and very large ones have an exponent instead of a row of zeros. Zero has no sign.
pub(super) struct Number<T>(pub(super) T, pub(super) Digits);

/// The magnitudes that are written without an exponent.
const PLAIN: std::ops::Range<f64> = 1e-4..1e9;

impl<T: Copy + Display + LowerExp + Into<f64>> Display for Number<T> {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        let v: f64 = self.0.into();
        match self.1 {
            _ if v == 0.0 => f.write_str("0"),
            _ if !v.is_finite() => write!(f, "{}", self.0),
            Digits::Significant(digits) => f.write_str(&rounded(v, digits)),
            _ if PLAIN.contains(&v.abs()) => write!(f, "{}", self.0),
            _ => write!(f, "{:e}", self.0),
        }
    }
}

/// A finite number that isn't zero, with this number of significant digits and without zeros at its end.
fn rounded(v: f64, digits: u8) -> String {
    let most = usize::from(digits.max(1)) - 1;
    let scientific = format!("{v:.most$e}");
    let (mantissa, exponent) = scientific.split_once('e').unwrap_or((&scientific, "0"));
    let exponent: i32 = exponent.parse().unwrap_or(0);
    if PLAIN.contains(&v.abs()) {
        let decimals = (most as i32 - exponent).max(0) as usize;
        return trimmed(&format!("{v:.decimals$}")).to_owned();
    }
    format!("{}e{exponent}", trimmed(mantissa))
}

/// A decimal without zeros at the end of its fraction.
fn trimmed(decimal: &str) -> &str {
    if decimal.contains('.') { decimal.trim_end_matches('0').trim_end_matches('.') } else { decimal }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zeros_have_no_sign_and_small_numbers_an_exponent() {
        let of = |v: f32| Number(v, Digits::Exact).to_string();
        assert_eq!([of(-0.0), of(0.0), of(0.1), of(-1.5), of(0.0002)], ["0", "0", "0.1", "-1.5", "0.0002"]);
        assert_eq!([of(1e-30), of(-3.25e-7), of(f32::MAX)], ["1e-30", "-3.25e-7", "3.4028235e38"]);
        assert_eq!([of(f32::INFINITY), of(f32::NAN), of(123_456.7)], ["inf", "NaN", "123456.7"]);
        assert_eq!(Number(6.123_233_995_736_766e-17, Digits::Exact).to_string(), "6.123233995736766e-17");
        for v in [1e-30f32, 0.1, 3.402_823_5e38, 1.0 / 3.0, 9.99e8] {
            assert_eq!(of(v).parse::<f32>(), Ok(v));
        }
    }

    #[test]
    fn digits_are_rounded_and_those_before_the_point_kept() {
        let of = |v: f64| Number(v, Digits::Significant(3)).to_string();
        assert_eq!([of(90.270_74), of(0.000_611_716_5), of(-0.0), of(0.8)], ["90.3", "0.000612", "0", "0.8"]);
        assert_eq!([of(123_456.7), of(-1.999_6), of(0.999_96), of(12.0)], ["123457", "-2", "1", "12"]);
        assert_eq!(
            [of(6.123e-17), of(-1e-5), of(3.402_823_5e38), of(9.999e-5)],
            ["6.12e-17", "-1e-5", "3.4e38", "1e-4"]
        );
        assert_eq!([of(f64::INFINITY), of(f64::NAN)], ["inf", "NaN"]);
    }
}
