//! Range coding by asymmetric numeral systems (Duda, 2009): single bits, and symbols of any alphabet.
//!
//! A decoder's state begins with the last bytes. More bytes, from the back, enter whenever the state is below its base.

use super::reader::{Bits, Reader};
use super::{CUT_OFF, Decoded};

/// The base of the state of single bits.
const BIT_BASE: u32 = 4096;

/// Bits that are mostly equal.
pub(super) struct BitDecoder<'a> {
    bytes: &'a [u8],
    state: u32,
    /// How many of 256 bits are 1.
    ones: u32,
}

impl<'a> BitDecoder<'a> {
    pub(super) fn new(stream: &mut Reader<'a>) -> Decoded<BitDecoder<'a>> {
        let zeros = stream.byte()?;
        let (state, bytes) = start(stream.block()?, BIT_BASE)?;
        Ok(BitDecoder { bytes, state, ones: 256 - u32::from(zeros) })
    }

    pub(super) fn next(&mut self) -> Decoded<bool> {
        fill(&mut self.state, BIT_BASE, &mut self.bytes)?;
        let (quotient, rest) = (self.state >> 8, self.state & 255);
        let is_one = rest < self.ones;
        self.state = match is_one {
            true => quotient * self.ones + rest,
            false => self.state - quotient * self.ones - self.ones,
        };
        Ok(is_one)
    }
}

/// The first state of a decoder, and the bytes before it. The highest 2 bits of the last byte tell its length.
fn start(bytes: &[u8], base: u32) -> Decoded<(u32, &[u8])> {
    let last = *bytes.last().ok_or(CUT_OFF)?;
    let (rest, own) = bytes.split_at(bytes.len().checked_sub(usize::from(last >> 6) + 1).ok_or(CUT_OFF)?);
    let highest = u32::from(last & 0x3F);
    let stored = own[..own.len() - 1].iter().rev().fold(highest, |state, &byte| state << 8 | u32::from(byte));
    if stored >= base * 255 {
        return Err("the state of an entropy coder is too large".into());
    }
    Ok((base + stored, rest))
}

/// Adds bytes to a state until it is no more below its base.
fn fill(state: &mut u32, base: u32, bytes: &mut &[u8]) -> Decoded<()> {
    while *state < base {
        let (&last, rest) = bytes.split_last().ok_or(CUT_OFF)?;
        *bytes = rest;
        *state = *state << 8 | u32::from(last);
    }
    Ok(())
}

/// A symbol, and the part of all states that stand for it.
struct Share {
    symbol: u32,
    first: u32,
    size: u32,
}

/// Symbols of an alphabet, in which some are more common than others.
struct SymbolDecoder<'a> {
    bytes: &'a [u8],
    state: u32,
    /// The binary logarithm of the sum of all shares.
    precision: u32,
    /// The shares of the symbols that exist.
    shares: Vec<Share>,
    /// The share of each remainder; empty if it takes less time to search.
    places: Vec<u32>,
}

impl<'a> SymbolDecoder<'a> {
    /// A decoder of about `count` symbols.
    fn new(stream: &mut Reader<'a>, precision: u32, count: usize) -> Decoded<SymbolDecoder<'a>> {
        let shares = shares(stream, 1 << precision)?;
        let mut places = Vec::new();
        if count >= 1 << (precision - 3) {
            places.reserve_exact(1 << precision);
            for (place, share) in shares.iter().enumerate() {
                places.resize((share.first + share.size) as usize, place as u32);
            }
        }
        let (state, bytes) = start(stream.block()?, 4 << precision)?;
        Ok(SymbolDecoder { bytes, state, precision, shares, places })
    }

    fn next(&mut self) -> Decoded<u32> {
        fill(&mut self.state, 4 << self.precision, &mut self.bytes)?;
        let (quotient, rest) = (self.state >> self.precision, self.state & ((1 << self.precision) - 1));
        let place = match self.places.get(rest as usize) {
            Some(&place) => place as usize,
            None => self.shares.partition_point(|share| share.first <= rest) - 1,
        };
        let share = &self.shares[place];
        self.state = quotient * share.size + rest - share.first;
        Ok(share.symbol)
    }
}

/// Reads the shares of symbols, whose sum must be `sum`.
fn shares(stream: &mut Reader, sum: u32) -> Decoded<Vec<Share>> {
    const WRONG: &str = "the shares of symbols are wrong";
    let count = stream.number()?;
    let mut shares = Vec::new();
    let (mut symbol, mut first) = (0u32, 0u32);
    while symbol < count {
        let byte = stream.byte()?;
        let mut size = u32::from(byte >> 2);
        if byte & 3 == 3 {
            // So many symbols don't exist, and one more.
            symbol = symbol.checked_add(size + 1).filter(|end| *end <= count).ok_or(WRONG)?;
            continue;
        }
        for k in 0..byte & 3 {
            size |= u32::from(stream.byte()?) << (6 + 8 * k);
        }
        if size > 0 {
            shares.push(Share { symbol, first, size });
            first = first.checked_add(size).filter(|end| *end <= sum).ok_or(WRONG)?;
        }
        symbol += 1;
    }
    if first == sum { Ok(shares) } else { Err(WRONG.into()) }
}

/// Decodes `count` numbers of elements that have `width` each. The caller has room for them.
pub(super) fn symbols(stream: &mut Reader, count: usize, width: usize) -> Decoded<Vec<u32>> {
    if count == 0 {
        return Ok(Vec::new());
    }
    match stream.byte()? {
        0 => tagged(stream, count, width),
        1 => raw(stream, count),
        _ => Err("symbols have an unknown coding".into()),
    }
}

/// Numbers of which a symbol for each element tells the count of bits.
fn tagged(stream: &mut Reader, count: usize, width: usize) -> Decoded<Vec<u32>> {
    let mut tags = SymbolDecoder::new(stream, 12, count / width)?;
    let mut bits = Bits::new(stream.0);
    let mut numbers = Vec::with_capacity(count);
    for _ in 0..count / width {
        let size = tags.next()?;
        if size > 32 {
            return Err("a number has more than 32 bits".into());
        }
        for _ in 0..width {
            numbers.push(bits.read(size)?);
        }
    }
    *stream = bits.rest();
    Ok(numbers)
}

/// Numbers that are symbols.
fn raw(stream: &mut Reader, count: usize) -> Decoded<Vec<u32>> {
    let size = stream.byte()?;
    if !(1..=18).contains(&size) {
        return Err(format!("symbols have {size} bits, not 1 to 18").into());
    }
    let mut decoder = SymbolDecoder::new(stream, (u32::from(size) * 3 / 2).clamp(12, 20), count)?;
    (0..count).map(|_| decoder.next()).collect()
}
