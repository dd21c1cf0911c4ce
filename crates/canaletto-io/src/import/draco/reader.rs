//! The bytes and the bits of a stream.

use super::{CUT_OFF, Decoded};

/// The bytes that aren't read yet.
#[derive(Clone, Copy)]
pub(super) struct Reader<'a>(pub(super) &'a [u8]);

impl<'a> Reader<'a> {
    pub(super) fn take(&mut self, count: usize) -> Decoded<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(count).ok_or(CUT_OFF)?;
        self.0 = rest;
        Ok(taken)
    }

    pub(super) fn byte(&mut self) -> Decoded<u8> {
        let (&byte, rest) = self.0.split_first().ok_or(CUT_OFF)?;
        self.0 = rest;
        Ok(byte)
    }

    /// A number of 4 bytes, the lowest first.
    pub(super) fn word(&mut self) -> Decoded<u32> {
        let (word, rest) = self.0.split_first_chunk().ok_or(CUT_OFF)?;
        self.0 = rest;
        Ok(u32::from_le_bytes(*word))
    }

    pub(super) fn float(&mut self) -> Decoded<f32> {
        self.word().map(f32::from_bits)
    }

    /// A number in bytes of 7 bits, the lowest first. The highest bit of all bytes but the last is set.
    pub(super) fn number(&mut self) -> Decoded<u32> {
        let mut number = 0u64;
        for shift in [0, 7, 14, 21, 28] {
            let byte = self.byte()?;
            number |= u64::from(byte & 0x7F) << shift;
            if byte < 0x80 {
                return Ok(u32::try_from(number).map_err(|_| TOO_LARGE)?);
            }
        }
        Err(TOO_LARGE.into())
    }

    /// Bytes whose count is before them.
    pub(super) fn block(&mut self) -> Decoded<&'a [u8]> {
        let count = self.number()?;
        self.take(count as usize)
    }
}

const TOO_LARGE: &str = "a number has more than 32 bits";

/// Bits, the lowest of each byte first.
pub(super) struct Bits<'a> {
    bytes: Reader<'a>,
    /// The bits of bytes that were taken but not read, of which there are `left`.
    taken: u64,
    left: u32,
}

impl<'a> Bits<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Bits<'a> {
        Bits { bytes: Reader(bytes), taken: 0, left: 0 }
    }

    /// The next bits, at most 32, of which the first is the lowest of the number.
    pub(super) fn read(&mut self, count: u32) -> Decoded<u32> {
        while self.left < count {
            self.taken |= u64::from(self.bytes.byte()?) << self.left;
            self.left += 8;
        }
        let read = self.taken & ((1 << count) - 1);
        self.taken >>= count;
        self.left -= count;
        Ok(read as u32)
    }

    /// The bytes after the last one of which a bit was read.
    pub(super) fn rest(&self) -> Reader<'a> {
        self.bytes
    }
}
