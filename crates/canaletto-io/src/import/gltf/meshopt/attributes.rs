//! The mode ATTRIBUTES: elements as differences from the element before, each byte position of a block by itself.

use super::{CUT_OFF, Decoded, Reader};

/// The most elements of a block.
const BLOCK: usize = 256;
/// The elements of a group, whose differences have one width.
const GROUP: usize = 16;

/// The differences of 4 byte positions of a block.
type Planes = [[u8; BLOCK]; 4];

/// How the differences of 4 bytes make elements.
#[derive(Clone, Copy)]
enum Channel {
    /// Each byte has a difference.
    Bytes,
    /// Both halves of 2 bytes have one.
    Halves,
    /// All 4 bytes are combined by exclusive or, after a turn to the right.
    Bits { turn: u32 },
}

/// Decodes `count` elements of `stride` bytes.
pub(super) fn decode(bytes: &[u8], count: usize, stride: usize) -> Decoded<Vec<u8>> {
    let mut stream = Reader(bytes);
    let version = match stream.byte()? {
        0xA0 => 0,
        0xA1 => 1,
        _ => return Err("attributes begin with the byte 0xa0 or 0xa1"),
    };
    let channels = stride / 4;
    let (modes, least_tail) = if version == 0 { (0, 32) } else { (channels, 24) };
    let tail = stream.take_back((stride + modes).max(least_tail))?;
    let (first, modes) = tail[tail.len() - stride - modes..].split_at(stride);
    let mut element: Vec<u32> = first.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
    let kinds: Vec<Channel> = match version {
        0 => vec![Channel::Bytes; channels],
        _ => modes.iter().map(|&mode| Channel::of(mode)).collect::<Decoded<_>>()?,
    };
    let block = (8192 / stride / GROUP * GROUP).min(BLOCK);
    // Full blocks take at least this much. The bytes are reserved only if the stream has it.
    let least = if version == 0 { stride * block.div_ceil(4 * GROUP) } else { channels };
    if (count / block).saturating_mul(least) > stream.0.len() {
        return Err(CUT_OFF);
    }
    let mut decoded = vec![0; count * stride];
    let mut planes = [[0; BLOCK]; 4];
    for elements in decoded.chunks_mut(block * stride) {
        let controls = if version == 0 { &[] } else { stream.take(channels)? };
        for (channel, (kind, value)) in kinds.iter().zip(&mut element).enumerate() {
            let control = controls.get(channel).copied();
            read_planes(&mut stream, control, elements.len() / stride, &mut planes)?;
            kind.add(&planes, value, channel, stride, elements);
        }
    }
    stream.end()?;
    Ok(decoded)
}

/// Reads the differences of 4 byte positions. Each has 2 bits of the control byte, which version 0 doesn't have.
fn read_planes(stream: &mut Reader, control: Option<u8>, count: usize, planes: &mut Planes) -> Decoded<()> {
    for (k, plane) in planes.iter_mut().enumerate() {
        match control.map(|control| control >> (2 * k) & 3) {
            None => read_groups(stream, [0, 2, 4, 8], count, plane)?,
            Some(0) => read_groups(stream, [0, 1, 2, 4], count, plane)?,
            Some(1) => read_groups(stream, [1, 2, 4, 8], count, plane)?,
            Some(2) => plane.fill(0),
            Some(_) => plane[..count].copy_from_slice(stream.take(count)?),
        }
    }
    Ok(())
}

/// Reads the differences of one byte position. A header has 2 bits for each group, which choose among `widths`.
fn read_groups(stream: &mut Reader, widths: [u8; 4], count: usize, plane: &mut [u8; BLOCK]) -> Decoded<()> {
    let groups = count.div_ceil(GROUP);
    let header = stream.take(groups.div_ceil(4))?;
    for (i, group) in plane.chunks_exact_mut(GROUP).take(groups).enumerate() {
        match widths[usize::from(header[i / 4] >> (i % 4 * 2) & 3)] {
            0 => group.fill(0),
            1 => read_narrow::<1>(stream, group)?,
            2 => read_narrow::<2>(stream, group)?,
            4 => read_narrow::<4>(stream, group)?,
            _ => group.copy_from_slice(stream.take(GROUP)?),
        }
    }
    Ok(())
}

/// Reads differences of `WIDTH` bits. One whose bits are all set stands for a byte after them.
fn read_narrow<const WIDTH: usize>(stream: &mut Reader, group: &mut [u8]) -> Decoded<()> {
    let packed = stream.take(2 * WIDTH)?;
    let in_byte = 8 / WIDTH;
    let all = (1 << WIDTH) - 1;
    for (i, slot) in group.iter_mut().enumerate() {
        let place = i % in_byte;
        // Single bits begin with the lowest, wider ones with the highest.
        let place = if WIDTH == 1 { place } else { in_byte - 1 - place };
        let bits = packed[i / in_byte] >> (place * WIDTH) & all;
        *slot = if bits == all { stream.byte()? } else { bits };
    }
    Ok(())
}

impl Channel {
    fn of(mode: u8) -> Decoded<Channel> {
        match (mode & 15, mode >> 4) {
            (0, 0) => Ok(Channel::Bytes),
            (1, 0) => Ok(Channel::Halves),
            (2, turn) => Ok(Channel::Bits { turn: turn.into() }),
            _ => Err("a channel has an unknown mode"),
        }
    }

    /// Writes a channel of elements. `value` is that of the element before, and becomes that of the last.
    fn add(self, planes: &Planes, value: &mut u32, channel: usize, stride: usize, elements: &mut [u8]) {
        let [a, b, c, d] = planes;
        let places = elements.chunks_exact_mut(stride).map(|element| &mut element[4 * channel..4 * channel + 4]);
        for ((((place, &a), &b), &c), &d) in places.zip(a).zip(b).zip(c).zip(d) {
            *value = self.next(*value, [a, b, c, d]);
            place.copy_from_slice(&value.to_le_bytes());
        }
    }

    fn next(self, before: u32, [a, b, c, d]: [u8; 4]) -> u32 {
        match self {
            Channel::Bytes => {
                let [w, x, y, z] = before.to_le_bytes();
                u32::from_le_bytes([add_byte(w, a), add_byte(x, b), add_byte(y, c), add_byte(z, d)])
            }
            Channel::Halves => {
                let low = add_half(before as u16, u16::from_le_bytes([a, b]));
                let high = add_half((before >> 16) as u16, u16::from_le_bytes([c, d]));
                u32::from(high) << 16 | u32::from(low)
            }
            Channel::Bits { turn } => before ^ u32::from_le_bytes([a, b, c, d]).rotate_right(turn),
        }
    }
}

fn add_byte(before: u8, zigzag: u8) -> u8 {
    before.wrapping_add(super::difference(zigzag.into()) as u8)
}

fn add_half(before: u16, zigzag: u16) -> u16 {
    before.wrapping_add(super::difference(zigzag.into()) as u16)
}
