//! Parsing of decimal numbers. Most take the fast path of Clinger (*How to read floating point numbers accurately*,
//! 1990): their digits and a power of ten are both exact in `f64`, so that one operation rounds once. Other texts are
//! passed to the standard library, which yields equal bits. In addition, this module reads the non-finite numbers of C
//! libraries on Windows (`-nan(ind)`, `1.#INF`) and Fortran exponents (`1.5d+03`).

/// The number of a text.
pub(super) fn parse(text: &[u8]) -> Option<f64> {
    match leading(text) {
        Some((number, rest)) if rest == text.len() => Some(number),
        _ => std::str::from_utf8(text).ok()?.parse().ok().or_else(|| foreign(text)),
    }
}

/// The number of a text, rounded once to `f32`.
pub(super) fn parse_f32(text: &[u8]) -> Option<f32> {
    match leading_f32(text) {
        Some((number, _, rest)) if rest == text.len() => Some(number),
        _ => std::str::from_utf8(text).ok()?.parse().ok().or_else(|| foreign(text).map(|number| number as f32)),
    }
}

/// A number in a form that the standard library doesn't parse.
fn foreign(text: &[u8]) -> Option<f64> {
    const LONGEST: usize = 64;
    let digits = text.strip_prefix(b"-").or_else(|| text.strip_prefix(b"+")).unwrap_or(text);
    if digits.len() > LONGEST {
        return None;
    }
    let lower = digits.to_ascii_lowercase();
    let starts = |with: &[&[u8]]| with.iter().any(|start| lower.starts_with(start));
    let value = if starts(&[b"nan(", b"1.#ind", b"1.#qnan", b"1.#snan"]) {
        f64::NAN
    } else if starts(&[b"1.#inf"]) {
        f64::INFINITY
    } else {
        let mut parts = lower.split(|byte| *byte == b'd');
        let (mantissa, exponent) = (parts.next()?, parts.next()?);
        let plain = !mantissa.contains(&b'e') && parts.next().is_none();
        let text = [mantissa, exponent].join(&b'e');
        plain.then(|| std::str::from_utf8(&text).ok()?.parse().ok())??
    };
    Some(if text.starts_with(b"-") { -value } else { value })
}

/// The number at the start of a text in `f32` and in `f64`, with the offset of its end, if the fast path applies.
#[inline]
pub(super) fn leading_f32(text: &[u8]) -> Option<(f32, f64, usize)> {
    let (number, end) = leading(text)?;
    // A number at the midpoint of two `f32` needs the exact digits to be rounded. Subnormal `f32` have other midpoints.
    let middle = number.to_bits() & 0x1fff_ffff == 0x1000_0000;
    let normal = number == 0.0 || (f64::from(f32::MIN_POSITIVE)..f64::from(f32::MAX)).contains(&number.abs());
    (!middle && normal).then_some((number as f32, number, end))
}

/// The decimal digit at an offset.
#[inline(always)]
pub(super) fn digit(text: &[u8], at: usize) -> Option<u8> {
    text.get(at).map(|byte| byte.wrapping_sub(b'0')).filter(|digit| *digit < 10)
}

#[inline]
fn leading(text: &[u8]) -> Option<(f64, usize)> {
    const POWERS: [f64; 23] = [
        1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19,
        1e20, 1e21, 1e22,
    ];
    let negative = text.first() == Some(&b'-');
    let mut at = usize::from(negative);
    let mut digits = 0u64;
    let mut take = |at: &mut usize| {
        let start = *at;
        while let Some(digit) = digit(text, *at) {
            digits = digits.wrapping_mul(10).wrapping_add(u64::from(digit));
            *at += 1;
        }
        *at - start
    };
    let whole = take(&mut at);
    let mut fraction = 0;
    if text.get(at) == Some(&b'.') {
        at += 1;
        fraction = take(&mut at);
    }
    // Up to 19 digits fit in `u64`.
    if whole + fraction == 0 || whole + fraction > 19 || digits > 1 << 53 {
        return None;
    }
    let mut power = -(fraction as i32);
    if let Some(b'e' | b'E') = text.get(at) {
        let down = text.get(at + 1) == Some(&b'-');
        at += 1 + usize::from(down || text.get(at + 1) == Some(&b'+'));
        let (start, mut exponent) = (at, 0);
        while let Some(digit) = digit(text, at) {
            exponent = (exponent * 10 + i32::from(digit)).min(1000);
            at += 1;
        }
        if at == start {
            return None;
        }
        power += if down { -exponent } else { exponent };
    }
    let scale = *POWERS.get(power.unsigned_abs() as usize)?;
    let number = if power < 0 { digits as f64 / scale } else { digits as f64 * scale };
    Some((if negative { -number } else { number }, at))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn same(text: &str) {
        let bits = |number: Option<f64>| number.map(f64::to_bits);
        assert_eq!(bits(parse(text.as_bytes())), bits(text.parse().ok()), "{text}");
        let bits = |number: Option<f32>| number.map(f32::to_bits);
        assert_eq!(bits(parse_f32(text.as_bytes())), bits(text.parse().ok()), "{text}");
    }

    #[test]
    fn odd_numbers_are_as_ever() {
        for text in [
            "",
            "-",
            "+",
            ".",
            "-.",
            "1.",
            ".5",
            "-.5e+01",
            "+1",
            "1e",
            "1e+",
            "1e-",
            "e5",
            "1e99999999999",
            "-0",
            "0e99",
            "1 ",
            "1x",
            "nan",
            "inf",
            "-inf",
            "0x1",
            "1e22",
            "1e23",
            "9007199254740992",
            "9007199254740993",
            "99999999999999999999",
            "18446744073709551616",
            "00000000000000000000001",
            "1e-45",
            "1e-38",
            "3.5e38",
            "3.4028235e38",
            "3.4028236e38",
            "1.1754943e-38",
            "1e1e1",
            "1..2",
            "--1",
            // The midpoint of two `f32`, and numbers near it.
            "16777217",
            "16777217.0000000001",
            "16777216.9999999999",
            "1.00000005960464477539",
            "1.000000059604644776",
        ] {
            same(text);
        }
    }

    #[test]
    fn numbers_of_other_languages_are_read() {
        for text in ["nan(ind)", "-nan(ind)", "-1.#IND", "1.#QNAN0", "NaN", "-1.#IND000000"] {
            assert!(parse(text.as_bytes()).unwrap().is_nan() && parse_f32(text.as_bytes()).unwrap().is_nan(), "{text}");
        }
        assert_eq!(parse(b"-1.#INF"), Some(f64::NEG_INFINITY));
        assert_eq!((parse(b"-1.5d+03"), parse_f32(b"2D0")), (Some(-1500.0), Some(2.0)));
        for text in ["d1", "1d", "1e2d3", "1d2d3", "d", "1.#", "nd"] {
            assert_eq!(parse(text.as_bytes()), None, "{text}");
        }
    }

    proptest! {

        #![proptest_config(crate::testing::seeded())]

        #[test]
        fn all_numbers_are_as_the_standard_library_reads_them(bits in any::<u32>(), digits in 1usize..18, text in "[-+]?[0-9]{0,12}[.]?[0-9]{0,9}([eE][-+]?[0-9]{1,2})?") {
            let number = f32::from_bits(bits);
            same(&number.to_string());
            same(&format!("{number:.digits$e}"));
            same(&format!("{:.digits$}", f64::from(number)));
            // The midpoint to the next `f32`.
            same(&format!("{}", (f64::from(number) + f64::from(f32::from_bits(bits ^ 1))) / 2.0));
            same(&text);
        }
    }
}
