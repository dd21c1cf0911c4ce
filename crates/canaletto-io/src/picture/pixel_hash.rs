//! The hash of the pixels of a file, by which damage is noticed that the format itself doesn't notice.

use canaletto::WordHash;

/// The key of the text that holds the hash.
pub(super) const PIXEL_HASH: &str = "pixel-hash";

/// The hash of rows of channels, in any order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PixelHash(u64);

impl PixelHash {
    /// Adds the values of a row, as they are read from the file. A row of zeros adds nothing.
    pub(super) fn add_row(&mut self, channel: &str, row: usize, values: impl Iterator<Item = f32>) {
        let mut hash = WordHash::seeded(row as u64);
        hash.add_bytes(channel.as_bytes());
        let mut any = 0;
        for value in values {
            let bits = if value.is_nan() { f32::NAN.to_bits() } else { value.to_bits() };
            any |= bits;
            hash.add(u64::from(bits));
        }
        if any != 0 {
            self.0 = self.0.wrapping_add(hash.finish());
        }
    }

    /// The hash of the rows of both.
    pub fn with(self, other: PixelHash) -> PixelHash {
        PixelHash(self.0.wrapping_add(other.0))
    }

    /// The hash as 16 hexadecimal digits.
    pub(super) fn text(self) -> String {
        format!("{:016x}", self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_counts_at_its_place() {
        let of = |rows: &[(&str, usize, [f32; 3])]| {
            let mut hash = PixelHash::default();
            rows.iter().for_each(|(channel, row, values)| hash.add_row(channel, *row, values.iter().copied()));
            hash
        };
        let rows = [("R", 0, [1.0, 2.0, 3.0]), ("R", 1, [4.0, 5.0, 6.0]), ("G", 0, [7.0, 8.0, f32::NAN])];
        let mut turned = rows;
        turned.reverse();
        assert_eq!(of(&rows), of(&turned));
        for (i, change) in [("R", 0, [1.0, 3.0, 2.0]), ("R", 0, [4.0, 5.0, 6.0]), ("B", 0, [7.0, 8.0, f32::NAN])]
            .into_iter()
            .enumerate()
        {
            let mut other = rows;
            other[i] = change;
            assert_ne!(of(&rows), of(&other), "{i}");
        }
        assert_eq!(of(&[("R", 5, [0.0; 3])]).text(), "0000000000000000");
    }
}
