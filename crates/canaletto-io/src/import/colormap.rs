//! Colour maps: colours for the numbers of a table's column.

use canaletto::math::Rgb;
use canaletto::texture::srgb_decode;
use canaletto::{Named, named};
use std::sync::LazyLock;

/// A colour map of matplotlib.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Colormap {
    /// From dark blue over green to yellow, evenly for the eye.
    Viridis,
    /// From black over purple to a pale yellow.
    Magma,
    /// From black over red to a pale yellow.
    Inferno,
    /// From blue over red to yellow.
    Plasma,
    /// From blue over grey to yellow, alike for eyes that confuse red and green.
    Cividis,
    /// A rainbow.
    Turbo,
    /// From blue over light grey to red, for numbers on both sides of a middle.
    Coolwarm,
}

named!(Colormap {
    Viridis => "viridis",
    Magma => "magma",
    Inferno => "inferno",
    Plasma => "plasma",
    Cividis => "cividis",
    Turbo => "turbo",
    Coolwarm => "coolwarm",
});

/// The number of colours of a map.
const COLORS: usize = 256;

/// The sRGB colours of every map, in the order of [`Colormap`].
static MAPS: LazyLock<Vec<Vec<[u8; 3]>>> = LazyLock::new(|| {
    let mut maps: Vec<Vec<u8>> = Vec::new();
    for line in include_str!("colormaps.txt").lines().filter(|line| !line.starts_with('#')) {
        match Colormap::from_name(line) {
            Some(_) => maps.push(Vec::new()),
            None => {
                let byte = |pair: &[u8]| std::str::from_utf8(pair).map(|pair| u8::from_str_radix(pair, 16));
                let bytes = line.as_bytes().chunks(2).map(|pair| byte(pair).map_or(0, Result::unwrap_or_default));
                maps.last_mut().into_iter().for_each(|map| map.extend(bytes.clone()));
            }
        }
    }
    maps.into_iter().map(|map| map.as_chunks().0.to_vec()).collect()
});

impl Colormap {
    /// The linear colour at a share of the map, 0 to 1; shares beyond have the colours of the ends. Between two of the
    /// map's 256 colours their sRGB numbers are mixed.
    pub fn color(self, share: f64) -> Rgb {
        let map = &MAPS[self as usize];
        let place = share.clamp(0.0, 1.0) * (COLORS - 1) as f64;
        let low = (place as usize).min(COLORS - 2);
        let mix = place - low as f64;
        let channel = |i: usize| {
            let [a, b] = [map[low][i], map[low + 1][i]].map(f64::from);
            srgb_decode(((a + (b - a) * mix) / 255.0) as f32)
        };
        Rgb::from([0, 1, 2].map(channel))
    }
}

/// The colours of a table by the numbers of one of its columns.
#[derive(Clone, Debug, PartialEq)]
pub struct ColumnColors {
    /// The colour map.
    pub map: Colormap,
    /// The column's name; or its number, counted from 1.
    pub column: String,
    /// The numbers that have the first and the last colour; without them the column's smallest and largest.
    pub range: [Option<f64>; 2],
}

impl ColumnColors {
    /// The colours of finite numbers. If all numbers are equal, they have the first colour.
    pub(super) fn colors(&self, numbers: &[f64]) -> Vec<Rgb> {
        let least = || numbers.iter().copied().fold(f64::INFINITY, f64::min);
        let most = || numbers.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let [from, to] = [self.range[0].unwrap_or_else(least), self.range[1].unwrap_or_else(most)];
        // Halves, since the difference of large numbers may be infinite.
        let width = to * 0.5 - from * 0.5;
        let share = |v: &f64| if width == 0.0 { 0.0 } else { (v * 0.5 - from * 0.5) / width };
        numbers.iter().map(|v| self.map.color(share(v))).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// sRGB numbers that matplotlib 3.11 gives for the entries 0, 64, 128, 192 and 255.
    #[test]
    fn the_maps_are_those_of_matplotlib() {
        let known: [(&str, [[f64; 3]; 5]); 4] = [
            (
                "viridis",
                [
                    [0.267004, 0.004874, 0.329415],
                    [0.229739, 0.322361, 0.545706],
                    [0.127568, 0.566949, 0.550556],
                    [0.369214, 0.788888, 0.382914],
                    [0.993248, 0.906157, 0.143936],
                ],
            ),
            (
                "turbo",
                [
                    [0.18995, 0.07176, 0.23217],
                    [0.15844, 0.73551, 0.92305],
                    [0.64362, 0.98999, 0.23356],
                    [0.9836, 0.49291, 0.12849],
                    [0.4796, 0.01583, 0.01055],
                ],
            ),
            (
                "coolwarm",
                [
                    [0.229806, 0.298718, 0.753683],
                    [0.554312, 0.690097, 0.995516],
                    [0.867428, 0.864377, 0.862602],
                    [0.956653, 0.598034, 0.477302],
                    [0.705673, 0.015556, 0.150233],
                ],
            ),
            (
                "cividis",
                [
                    [0.0, 0.135112, 0.304751],
                    [0.263738, 0.307831, 0.422789],
                    [0.488697, 0.485318, 0.471008],
                    [0.736488, 0.680629, 0.424028],
                    [0.995737, 0.909344, 0.217772],
                ],
            ),
        ];
        // The curve of IEC 61966-2-1.
        let linear = |v: f64| if v <= 0.040_45 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) };
        for (name, colors) in known {
            let map = Colormap::from_name(name).unwrap();
            for (entry, color) in [0.0, 64.0, 128.0, 192.0, 255.0].into_iter().zip(colors) {
                let found = map.color(entry / 255.0).to_array();
                for (found, wanted) in found.into_iter().zip(color) {
                    // A byte of sRGB is rounded by 1/510, and the curve is at most 2.3 steep.
                    assert!((f64::from(found) - linear(wanted)).abs() < 2.3 / 510.0 + 1e-6, "{name} {entry}: {found}");
                }
            }
        }
        assert!(MAPS.len() == Colormap::ALL.len() && MAPS.iter().all(|map| map.len() == COLORS));
    }

    #[test]
    fn the_range_is_the_columns_unless_it_is_given() {
        let colors = |range: [Option<f64>; 2], numbers: &[f64]| {
            let column = "v".to_owned();
            ColumnColors { map: Colormap::Viridis, column, range }.colors(numbers)
        };
        let at = |share: f64| Colormap::Viridis.color(share);
        assert_eq!(colors([None; 2], &[-2.0, 0.0, 6.0]), [at(0.0), at(0.25), at(1.0)]);
        assert_eq!(colors([Some(0.0), Some(4.0)], &[-2.0, 1.0, 6.0]), [at(0.0), at(0.25), at(1.0)]);
        assert_eq!(colors([Some(4.0), Some(0.0)], &[0.0, 1.0]), [at(1.0), at(0.75)]);
        assert_eq!(colors([None, Some(10.0)], &[5.0, 5.0]), [at(0.0); 2]);
        assert_eq!(colors([None; 2], &[5.0, 5.0]), [at(0.0); 2]);
        assert_eq!(colors([None; 2], &[-1.7e308, 0.0, 1.7e308]), [at(0.0), at(0.5), at(1.0)]);
    }
}
