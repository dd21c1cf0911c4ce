//! Numbers: `1`, `-0.5`, `1e-3`, `1_000`, `0xff`.

/// Whether an unquoted word that starts like `text` is meant as a number.
pub(super) fn starts_number(text: &str) -> bool {
    let unsigned = text.strip_prefix(['+', '-']).unwrap_or(text);
    let unsigned = unsigned.strip_prefix('.').unwrap_or(unsigned);
    unsigned.starts_with(|c: char| c.is_ascii_digit())
}

/// The number, or the message and hint that explain why it is invalid.
pub(super) fn number(text: &str) -> Result<f64, (String, String)> {
    let (negative, unsigned) = match text.strip_prefix(['+', '-']) {
        Some(rest) => (text.starts_with('-'), rest),
        None => (false, text),
    };
    let value = match unsigned.get(..2) {
        Some("0x") => in_base(&unsigned[2..], 16),
        Some("0o") => in_base(&unsigned[2..], 8),
        Some("0b") => in_base(&unsigned[2..], 2),
        _ => decimal(unsigned),
    };
    value.map(|v| if negative { -v } else { v }).ok_or_else(|| complaint(text, unsigned))
}

fn in_base(digits: &str, base: u32) -> Option<f64> {
    let first = digits.chars().next()?;
    first.to_digit(base)?;
    digits
        .chars()
        .filter(|c| *c != '_')
        .try_fold(0.0, |value, c| Some(value * f64::from(base) + f64::from(c.to_digit(base)?)))
}

fn decimal(text: &str) -> Option<f64> {
    let (mantissa, exponent) = match text.find(['e', 'E']) {
        Some(at) => (&text[..at], Some(&text[at + 1..])),
        None => (text, None),
    };
    let (whole, fraction) = match mantissa.split_once('.') {
        Some((whole, fraction)) => (whole, Some(fraction)),
        None => (mantissa, None),
    };
    let exponent = exponent.map(|e| e.strip_prefix(['+', '-']).unwrap_or(e));
    if !is_digits(whole) || !fraction.is_none_or(is_digits) || !exponent.is_none_or(is_digits) {
        return None;
    }
    if text.contains('_') { text.replace('_', "").parse().ok() } else { text.parse().ok() }
}

fn is_digits(text: &str) -> bool {
    text.starts_with(|c: char| c.is_ascii_digit()) && text.bytes().all(|b| b.is_ascii_digit() || b == b'_')
}

fn complaint(text: &str, unsigned: &str) -> (String, String) {
    let short: String = text.chars().take(40).collect();
    let help = if let Some(before) = text.strip_suffix(',').filter(|t| number(t).is_ok()) {
        format!("numbers stand with blanks between them, without commas: {before}")
    } else if text.contains(',') {
        "numbers stand with blanks between them, and have a point before their fraction: 0.5 1 2".into()
    } else if unsigned.starts_with('.') && number(&format!("0{unsigned}")).is_ok() {
        format!("write a 0 before the point: {}0{unsigned}", &text[..text.len() - unsigned.len()])
    } else if let Some(before) = text.strip_suffix('.').filter(|t| number(t).is_ok()) {
        format!("write a digit after the point: {before}.0")
    } else {
        "texts that start like a number stand in quotes".into()
    };
    (format!("\"{short}\" isn't a number"), help)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_every_form() {
        for (text, value) in [("1", 1.0), ("-0.5", -0.5), ("+1e-3", 1e-3), ("1_000.5_0", 1000.5), ("0xfF", 255.0)] {
            assert_eq!(number(text), Ok(value), "{text}");
        }
        assert_eq!((number("0b1_01"), number("-0o17"), number("1E+2")), (Ok(5.0), Ok(-15.0), Ok(100.0)));
        assert_eq!(number("1e999"), Ok(f64::INFINITY));
        for text in ["1.", ".5", "1,", "0x", "0x_1", "1__e", "1e", "1._5", "3z", "1.2.3", "0b2", "1é"] {
            assert!(number(text).is_err(), "{text}");
        }
    }
}
