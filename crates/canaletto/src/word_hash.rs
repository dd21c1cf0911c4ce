//! Hashes and checksums of 64 bits, equal on every machine.

use std::fmt;

/// FNV-1a over little-endian words of eight bytes, with the bits mixed after each word. Each step is a bijection, so
/// inputs that differ in one word only have different hashes. It gives no protection against forgery.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WordHash {
    hash: u64,
    /// The bytes that don't fill a word yet, and the number of all bytes.
    pending: u64,
    length: u64,
}

impl WordHash {
    /// The hash of no bytes.
    pub const fn new() -> WordHash {
        WordHash::seeded(0)
    }

    /// The hash of no bytes that continues another hash.
    pub const fn seeded(seed: u64) -> WordHash {
        WordHash { hash: seed ^ 0xcbf2_9ce4_8422_2325, pending: 0, length: 0 }
    }

    fn stir(&mut self, word: u64) {
        self.hash = (self.hash ^ word).wrapping_mul(0x0000_0100_0000_01b3);
        self.hash ^= self.hash >> 29;
    }

    /// Adds bytes. It doesn't matter how they are divided among calls.
    pub fn add_bytes(&mut self, bytes: &[u8]) {
        let shift = 8 * (self.length % 8);
        let chunks = bytes.chunks_exact(8);
        let rest = chunks.remainder();
        for chunk in chunks {
            let word = u64::from_le_bytes(chunk.try_into().unwrap_or_default());
            self.stir(self.pending | word << shift);
            self.pending = if shift == 0 { 0 } else { word >> (64 - shift) };
        }
        self.length += (bytes.len() - rest.len()) as u64;
        for &byte in rest {
            self.pending |= u64::from(byte) << (8 * (self.length % 8));
            self.length += 1;
            if self.length.is_multiple_of(8) {
                let word = std::mem::take(&mut self.pending);
                self.stir(word);
            }
        }
    }

    /// Adds a whole number.
    pub fn add(&mut self, word: u64) {
        self.add_bytes(&word.to_le_bytes());
    }

    /// The hash of all bytes and of their number.
    pub fn finish(mut self) -> u64 {
        self.stir(self.pending);
        self.stir(self.length);
        self.hash
    }
}

impl Default for WordHash {
    fn default() -> WordHash {
        WordHash::new()
    }
}

/// Adds text, such as the `Debug` text of a value, which holds all fields and exact numbers.
impl fmt::Write for WordHash {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.add_bytes(text.as_bytes());
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(bytes: &[u8]) -> u64 {
        let mut hash = WordHash::new();
        hash.add_bytes(bytes);
        hash.finish()
    }

    #[test]
    fn any_division_among_calls_gives_the_same_hash() {
        let bytes: Vec<u8> = (0..100u8).map(|i| i.wrapping_mul(37)).collect();
        for cut in 0..=bytes.len() {
            for next in [cut, (cut + 3).min(bytes.len()), (cut + 21).min(bytes.len())] {
                let mut hash = WordHash::new();
                for part in [&bytes[..cut], &bytes[cut..next], &bytes[next..]] {
                    hash.add_bytes(part);
                }
                assert_eq!(hash.finish(), of(&bytes), "{cut} {next}");
            }
        }
    }

    /// The values come from another program, after the description in docs/radiosity-file.md.
    #[test]
    fn hashes_are_as_described() {
        assert_eq!(of(b""), 0x22d8_5fb8_01f1_b909);
        assert_eq!(of(b"canaletto"), 0x8369_b686_a229_710a);
    }

    #[test]
    fn every_byte_and_the_length_count() {
        let bytes = [7u8; 29];
        let mut all: Vec<u64> = (0..=29).map(|length| of(&bytes[..length])).collect();
        all.extend((0..29 * 8).map(|bit| {
            let mut other = bytes;
            other[bit / 8] ^= 1 << (bit % 8);
            of(&other)
        }));
        all.extend([of(&[0]), of(&[0, 0])]);
        all.sort_unstable();
        let count = all.len();
        all.dedup();
        assert_eq!(all.len(), count);
    }
}
