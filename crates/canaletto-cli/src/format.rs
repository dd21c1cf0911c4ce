//! Numbers formatted for people.

use std::time::Duration;

/// The version of the output of `--json`. It rises when a field changes its meaning or is removed. docs/json.md lists
/// all fields.
pub(crate) const JSON_VERSION: u32 = 1;

/// Formats 1234567 as "1,234,567".
pub(crate) fn count(n: u64) -> String {
    let digits = n.to_string();
    let mut out = String::new();
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            out.push(',');
        }
        out.push(digit);
    }
    out
}

/// A number with its noun, such as "1 ray" or "2,000 rays".
pub(crate) fn plural(n: u64, noun: &str) -> String {
    format!("{} {noun}{}", count(n), if n == 1 { "" } else { "s" })
}

/// A duration, such as "31 ms", "4.2 s", "2 min 5 s" or "3 h 20 min".
pub(crate) fn duration(time: Duration) -> String {
    let seconds = time.as_secs_f64();
    let whole = seconds.round() as u64;
    match seconds {
        s if s < 0.0995 => format!("{:.0} ms", s * 1e3),
        s if s < 9.95 => format!("{s:.1} s"),
        s if s < 59.5 => format!("{whole} s"),
        s if s < 3570.0 => format!("{} min {} s", whole / 60, whole % 60),
        _ => format!("{} h {} min", (whole + 30) / 3600, (whole + 30) / 60 % 60),
    }
}

const THOUSANDS: &[&str] = &["", " k", " M", " G"];

/// A number of rays per second.
pub(crate) fn rate(rays: f64) -> String {
    format!("{} rays/s", scaled(rays, 1000.0, THOUSANDS))
}

/// A large number, rounded: "950", "12.3 k", "1.2 M".
pub(crate) fn amount(n: u64) -> String {
    scaled(n as f64, 1000.0, THOUSANDS)
}

/// A number of bytes.
pub(crate) fn bytes(n: u64) -> String {
    scaled(n as f64, 1024.0, &[" B", " KiB", " MiB", " GiB", " TiB"])
}

fn scaled(mut value: f64, step: f64, units: &[&str]) -> String {
    let mut unit = 0;
    while value >= step * 0.9995 && unit + 1 < units.len() {
        value /= step;
        unit += 1;
    }
    let digits = usize::from(unit > 0 && value < 99.95);
    format!("{value:.digits$}{}", units[unit])
}

/// Rounds to six significant digits.
pub(crate) fn short(v: f64) -> f64 {
    let short: f64 = format!("{v:.5e}").parse().unwrap_or(v);
    // The addition removes the sign of a zero.
    short + 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_well() {
        assert_eq!([0, 999, 1000, 1_234_567].map(count), ["0", "999", "1,000", "1,234,567"]);
        let of = |ms: u64| duration(Duration::from_millis(ms));
        assert_eq!([of(3), of(99), of(100), of(9960), of(125_000)], ["3 ms", "99 ms", "0.1 s", "10 s", "2 min 5 s"]);
        assert_eq!([of(59_600), of(3_599_900), of(12_000_000)], ["1 min 0 s", "1 h 0 min", "3 h 20 min"]);
        assert_eq!([rate(950.0), rate(1.26e6)], ["950 rays/s", "1.3 M rays/s"]);
        assert_eq!([bytes(10), bytes(1536), bytes(300 << 20)], ["10 B", "1.5 KiB", "300 MiB"]);
        assert_eq!([plural(1, "ray"), plural(2000, "ray")], ["1 ray", "2,000 rays"]);
    }
}
