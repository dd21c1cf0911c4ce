//! The mode INDICES: each index is a difference from one of two indices before.

use super::{CUT_OFF, Decoded, Reader, difference, push_index};

/// Decodes `count` indices of `stride` bytes.
pub(super) fn decode(bytes: &[u8], count: usize, stride: usize) -> Decoded<Vec<u8>> {
    let mut stream = Reader(bytes);
    if !matches!(stream.byte()?, 0xD0 | 0xD1) {
        return Err("indices begin with the byte 0xd0 or 0xd1");
    }
    stream.take_back(4)?;
    // Each index has at least a byte. The bytes are reserved only if the stream has it.
    if count > stream.0.len() {
        return Err(CUT_OFF);
    }
    let mut decoded = Vec::with_capacity(count * stride);
    let mut last = [0u32; 2];
    for _ in 0..count {
        let number = stream.number()?;
        let index = &mut last[number as usize & 1];
        *index = index.wrapping_add(difference(number >> 1));
        push_index(&mut decoded, *index, stride);
    }
    stream.end()?;
    Ok(decoded)
}
