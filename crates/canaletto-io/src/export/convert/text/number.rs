//! Numbers that come back as they are. The scene text reads all numbers as `f64`.

use canaletto::math::Rgb;
use glam::{DVec3, Vec3};

/// The shortest text of an `f64`.
pub(super) fn double(v: f64) -> String {
    let text = format!("{v:?}");
    text.strip_suffix(".0").map_or(text.clone(), str::to_owned)
}

/// The shortest text that an `f32` comes back from.
pub(super) fn single(v: f32) -> String {
    let text = format!("{v:?}");
    let text = text.strip_suffix(".0").unwrap_or(&text);
    // Two roundings of a text could differ from one.
    match text.parse::<f64>().is_ok_and(|read| read as f32 == v) {
        true => text.to_owned(),
        false => double(v.into()),
    }
}

/// Several numbers.
pub(super) fn doubles(list: &[f64]) -> String {
    list.iter().map(|v| double(*v)).collect::<Vec<_>>().join(" ")
}

/// Several numbers.
pub(super) fn singles(list: &[f32]) -> String {
    list.iter().map(|v| single(*v)).collect::<Vec<_>>().join(" ")
}

/// A point or direction.
pub(super) fn vector(v: Vec3) -> String {
    singles(&v.to_array())
}

/// A point or direction in double precision.
pub(super) fn fine_vector(v: DVec3) -> String {
    doubles(&v.to_array())
}

/// A colour: one number if it is a grey.
pub(super) fn color(c: Rgb) -> String {
    if c == Rgb::gray(c.r) { single(c.r) } else { singles(&c.to_array()) }
}

/// A point whose rounding error is kept beside it: the shortest text from which both come back.
pub(super) fn place(rounded: Vec3, rest: Vec3) -> String {
    let text: [String; 3] = std::array::from_fn(|i| coordinate(rounded[i], rest[i]));
    text.join(" ")
}

fn coordinate(rounded: f32, rest: f32) -> String {
    let exact = f64::from(rounded) + f64::from(rest);
    let comes_back = |v: f64| v as f32 == rounded && (v - f64::from(rounded)) as f32 == rest;
    let shorter = (0..17).filter_map(|digits| format!("{exact:.digits$e}").parse::<f64>().ok());
    double(shorter.into_iter().find(|v| comes_back(*v)).unwrap_or(exact))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_come_back() {
        let singles = [0.0, 1.0, -2.5, 0.1, 1e-7, 3.4e38, 1.0 / 3.0, 16_777_217.0, 123_456.79];
        for v in singles {
            assert_eq!(single(v).parse::<f64>().unwrap() as f32, v);
        }
        assert_eq!([single(0.1), single(3.0), double(0.1)], ["0.1", "3", "0.1"]);
        for v in [0.1, -1.0 / 3.0, 408_201.58, 1e300] {
            assert_eq!(double(v).parse::<f64>().unwrap(), v);
        }
    }

    #[test]
    fn places_come_back_with_their_rest() {
        for exact in [0.1, 408_201.58, -4_080_928.02, 7.0, 1.0 / 3.0] {
            let rounded = exact as f32;
            let rest = (exact - f64::from(rounded)) as f32;
            for rest in [rest, 0.0] {
                let text = coordinate(rounded, rest);
                let read: f64 = text.parse().unwrap();
                assert_eq!((read as f32, (read - f64::from(rounded)) as f32), (rounded, rest), "{text}");
            }
        }
        assert_eq!(coordinate(0.1, (0.1 - f64::from(0.1f32)) as f32), "0.1");
    }
}
