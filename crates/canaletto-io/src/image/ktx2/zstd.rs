//! One frame of Zstandard (RFC 8878), whose size is known. Memory is that of the result. Checksums are skipped.

/// The largest size of a block's compressed bytes, and of its literals.
const MAX_BLOCK: usize = 128 << 10;

/// The codes of literal lengths, match lengths and offsets, in the order in which blocks have their tables.
const CODES: [Code; 3] = [
    Code {
        first: 0,
        extra_bits: &[
            0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 3, 3, 4, 6, 7, 8, 9, 10, 11, 12, 13, 14,
            15, 16,
        ],
        max_accuracy: 9,
        accuracy: 6,
        shares: &[
            4, 3, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 1, 1, 1, 2, 2, 2, 2, 2, 2, 2, 2, 2, 3, 2, 1, 1, 1, 1, 1, -1, -1, -1,
            -1,
        ],
    },
    Code {
        first: 1,
        extra_bits: &[
            0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28,
            29, 30, 31,
        ],
        max_accuracy: 8,
        accuracy: 5,
        shares: &[1, 1, 1, 1, 1, 1, 2, 2, 2, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, -1, -1, -1, -1, -1],
    },
    Code {
        first: 3,
        extra_bits: &[
            0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1,
            2, 2, 3, 3, 4, 4, 5, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16,
        ],
        max_accuracy: 9,
        accuracy: 6,
        shares: &[
            1, 4, 3, 2, 2, 2, 2, 2, 2, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1,
            1, 1, 1, 1, 1, 1, 1, 1, 1, 1, -1, -1, -1, -1, -1, -1, -1,
        ],
    },
];

/// A code of numbers: a symbol stands for a range, and extra bits choose one of its numbers.
struct Code {
    /// The number of symbol 0 without extra bits. Each range begins where the one before it ends.
    first: u64,
    extra_bits: &'static [u8],
    /// The largest binary logarithm of a table's size.
    max_accuracy: u32,
    /// The logarithm of the size of the predefined table, and its symbols' shares.
    accuracy: u32,
    shares: &'static [i16],
}

impl Code {
    /// The number of a symbol, with its extra bits from the stream.
    fn number(&self, symbol: u8, bits: &mut BackwardBits) -> Option<usize> {
        let extra = *self.extra_bits.get(usize::from(symbol))?;
        let first = self.first + self.extra_bits[..usize::from(symbol)].iter().map(|bits| 1 << bits).sum::<u64>();
        Some((first + bits.read(extra.into())?) as usize)
    }
}

/// Appends the `size` bytes of a frame to `out`, or returns `None` if it doesn't have just as many.
pub(super) fn inflate(frame: &[u8], size: usize, out: &mut Vec<u8>) -> Option<()> {
    let mut bytes = frame;
    let has_checksum = header(&mut bytes)?;
    let mut decoder = Decoder {
        start: out.len(),
        end: out.len() + size,
        out,
        huffman: None,
        tables: [const { None }; 3],
        offsets: [1, 4, 8],
    };
    loop {
        let head = little(take(&mut bytes, 3)?) as usize;
        let size = head >> 3;
        match head >> 1 & 3 {
            0 => decoder.push(take(&mut bytes, size)?)?,
            1 => decoder.fill(take(&mut bytes, 1)?[0], size)?,
            2 if size <= MAX_BLOCK => decoder.block(take(&mut bytes, size)?)?,
            _ => return None,
        }
        if head & 1 == 1 {
            break;
        }
    }
    (decoder.out.len() == decoder.end && bytes.len() == if has_checksum { 4 } else { 0 }).then_some(())
}

/// Reads the header of a frame; returns whether a checksum follows its blocks.
fn header(bytes: &mut &[u8]) -> Option<bool> {
    if take(bytes, 4)? != [0x28, 0xb5, 0x2f, 0xfd] {
        return None;
    }
    let flags = take(bytes, 1)?[0];
    let is_single = flags >> 5 & 1;
    // The size of the window. All of the result is kept.
    take(bytes, usize::from(1 - is_single))?;
    let dictionary = little(take(bytes, [0, 1, 2, 4][usize::from(flags & 3)])?);
    take(bytes, [usize::from(is_single), 2, 4, 8][usize::from(flags >> 6)])?;
    (dictionary == 0 && flags & 0b1000 == 0).then_some(flags >> 2 & 1 == 1)
}

/// What has been decoded, and what blocks take from those before them.
struct Decoder<'a> {
    out: &'a mut Vec<u8>,
    /// Where the frame's bytes begin and end in `out`.
    start: usize,
    end: usize,
    huffman: Option<Huffman>,
    /// The tables of [`CODES`].
    tables: [Option<Table>; 3],
    /// The last offsets.
    offsets: [usize; 3],
}

impl Decoder<'_> {
    /// `None` if there is no place for so many bytes.
    fn place(&self, count: usize) -> Option<()> {
        (count <= self.end - self.out.len()).then_some(())
    }

    fn push(&mut self, bytes: &[u8]) -> Option<()> {
        self.place(bytes.len())?;
        self.out.extend(bytes);
        Some(())
    }

    fn fill(&mut self, byte: u8, count: usize) -> Option<()> {
        self.place(count)?;
        self.out.resize(self.out.len() + count, byte);
        Some(())
    }

    /// Repeats bytes from `offset` bytes before the end. They may overlap those that they make.
    fn copy(&mut self, offset: usize, count: usize) -> Option<()> {
        self.place(count)?;
        let from = self.out.len().checked_sub(offset).filter(|from| *from >= self.start && offset > 0)?;
        let mut left = count;
        while left > 0 {
            let piece = left.min(self.out.len() - from);
            self.out.extend_from_within(from..from + piece);
            left -= piece;
        }
        Some(())
    }

    /// Decodes a compressed block.
    fn block(&mut self, mut bytes: &[u8]) -> Option<()> {
        let literals = self.literals(&mut bytes)?;
        let mut literals = literals.as_slice();
        let count = match take(&mut bytes, 1)?[0] {
            0 => return bytes.is_empty().then(|| self.push(literals))?,
            few @ ..128 => usize::from(few),
            255 => little(take(&mut bytes, 2)?) as usize + 0x7f00,
            many => (usize::from(many) - 128) << 8 | usize::from(take(&mut bytes, 1)?[0]),
        };
        let modes = take(&mut bytes, 1)?[0];
        for (i, code) in CODES.iter().enumerate() {
            if let Some(table) = Table::of_mode(modes >> (6 - 2 * i) & 3, code, &mut bytes)? {
                self.tables[i] = Some(table);
            }
        }
        let mut bits = BackwardBits::new(bytes)?;
        self.sequences(count, &mut bits, &mut literals)?;
        (bits.left == 0 && modes & 3 == 0).then(|| self.push(literals))?
    }

    /// Appends literals and matches in turn.
    fn sequences(&mut self, count: usize, bits: &mut BackwardBits, literals: &mut &[u8]) -> Option<()> {
        let [Some(lengths), Some(offsets), Some(matches)] = self.tables.clone() else { return None };
        let tables = [lengths, offsets, matches];
        let mut states = [0; 3];
        for (state, table) in states.iter_mut().zip(&tables) {
            *state = bits.read(table.accuracy)? as usize;
        }
        for i in 0..count {
            let symbol = |which: usize| tables[which].states[states[which]].symbol;
            let offset = CODES[1].number(symbol(1), bits)?;
            let matched = CODES[2].number(symbol(2), bits)?;
            let length = CODES[0].number(symbol(0), bits)?;
            self.push(take(literals, length)?)?;
            let offset = self.offset(offset, length == 0)?;
            self.copy(offset, matched)?;
            if i + 1 < count {
                for which in [0, 2, 1] {
                    states[which] = tables[which].next(states[which], bits)?;
                }
            }
        }
        Some(())
    }

    /// The offset of a number. The first three stand for the last offsets.
    fn offset(&mut self, number: usize, is_without_literals: bool) -> Option<usize> {
        let [a, b, c] = self.offsets;
        let (offset, after) = match number + usize::from(is_without_literals && number <= 3) {
            1 if number <= 3 => (a, [b, c]),
            2 if number <= 3 => (b, [a, c]),
            3 if number <= 3 => (c, [a, b]),
            4 if number <= 3 => (a.checked_sub(1)?, [a, b]),
            _ => (number - 3, [a, b]),
        };
        self.offsets = [offset, after[0], after[1]];
        Some(offset)
    }

    /// Reads the literals of a block.
    fn literals(&mut self, bytes: &mut &[u8]) -> Option<Vec<u8>> {
        let head = *bytes.first()?;
        let (kind, form) = (head & 3, head >> 2 & 3);
        if kind < 2 {
            let (length, shift) = [(1, 3), (2, 4), (1, 3), (3, 4)][usize::from(form)];
            let size = (little(take(bytes, length)?) >> shift) as usize;
            return match kind {
                _ if size > MAX_BLOCK => None,
                0 => Some(take(bytes, size)?.to_vec()),
                _ => Some(vec![take(bytes, 1)?[0]; size]),
            };
        }
        let (length, width) = [(3, 10), (3, 10), (4, 14), (5, 18)][usize::from(form)];
        let sizes = little(take(bytes, length)?) >> 4;
        let [size, packed] = [sizes, sizes >> width].map(|size| (size & ((1 << width) - 1)) as usize);
        let mut packed = take(bytes, packed)?;
        if size > MAX_BLOCK {
            return None;
        }
        if kind == 2 {
            self.huffman = Some(Huffman::read(&mut packed)?);
        }
        let (huffman, mut literals) = (self.huffman.as_ref()?, Vec::with_capacity(size));
        if form == 0 {
            huffman.decode(packed, size, &mut literals)?;
            return Some(literals);
        }
        let ends = take(&mut packed, 6)?;
        let part = size.div_ceil(4);
        for end in ends.chunks(2) {
            huffman.decode(take(&mut packed, little(end) as usize)?, part, &mut literals)?;
        }
        huffman.decode(packed, size.checked_sub(3 * part)?, &mut literals)?;
        Some(literals)
    }
}

/// A table of finite state entropy, by state.
#[derive(Clone)]
struct Table {
    /// The binary logarithm of the number of states.
    accuracy: u32,
    states: Vec<State>,
}

#[derive(Clone, Copy, Default)]
struct State {
    symbol: u8,
    /// The number of bits that choose the next state, counted from `base`.
    bits: u32,
    base: usize,
}

impl Table {
    /// The table of a mode of [`Decoder::block`], or `None` inside where the last one is repeated.
    fn of_mode(mode: u8, code: &Code, bytes: &mut &[u8]) -> Option<Option<Table>> {
        match mode {
            0 => Table::new(code.accuracy, code.shares).map(Some),
            1 => {
                let state = State { symbol: take(bytes, 1)?[0], ..State::default() };
                Some(Some(Table { accuracy: 0, states: vec![state] }))
            }
            2 => Table::read(code.max_accuracy, code.extra_bits.len(), bytes).map(Some),
            _ => Some(None),
        }
    }

    /// Reads the shares of at most `most` symbols.
    fn read(max_accuracy: u32, most: usize, bytes: &mut &[u8]) -> Option<Table> {
        let mut at = 0;
        // Bits beyond the end are zero, and are found when the bytes are taken.
        let peek = |at: usize, count: u32| {
            let number = (0..4).map(|i| u64::from(bytes.get(at / 8 + i).copied().unwrap_or(0)) << (8 * i)).sum::<u64>();
            (number >> (at % 8)) as i32 & ((1 << count) - 1)
        };
        let accuracy = peek(0, 4) as u32 + 5;
        if accuracy > max_accuracy {
            return None;
        }
        at += 4;
        let (mut shares, mut left) = (Vec::new(), 1i32 << accuracy);
        while left > 0 {
            // A number up to left + 1 takes one bit less where that is possible.
            let width = 32 - (left + 1).leading_zeros();
            let (number, low) = (peek(at, width), peek(at, width - 1));
            let spare = (1 << width) - 2 - left;
            at += width as usize - usize::from(low < spare);
            let number = match number {
                _ if low < spare => low,
                number if number >> (width - 1) == 1 => number - spare,
                number => number,
            };
            let share = number - 1;
            left -= share.abs();
            shares.push(share as i16);
            let mut is_repeated = share == 0;
            while is_repeated {
                let zeros = peek(at, 2);
                at += 2;
                shares.extend((0..zeros).map(|_| 0));
                is_repeated = zeros == 3 && shares.len() <= most;
            }
            if shares.len() > most {
                return None;
            }
        }
        take(bytes, at.div_ceil(8))?;
        Table::new(accuracy, &shares)
    }

    /// The table of so many states, of which each symbol has a share. A share of -1 is less than one state.
    fn new(accuracy: u32, shares: &[i16]) -> Option<Table> {
        let size = 1usize << accuracy;
        if shares.iter().map(|share| usize::from(share.unsigned_abs())).sum::<usize>() != size {
            return None;
        }
        let mut states = vec![State::default(); size];
        let mut high = size;
        for (symbol, _) in shares.iter().enumerate().filter(|(_, share)| **share < 0) {
            high -= 1;
            states[high].symbol = symbol as u8;
        }
        let (step, mut at) = ((size >> 1) + (size >> 3) + 3, 0);
        for (symbol, share) in shares.iter().enumerate() {
            for _ in 0..*share {
                states[at].symbol = symbol as u8;
                at = (at + step) % size;
                while at >= high {
                    at = (at + step) % size;
                }
            }
        }
        let mut next: Vec<usize> = shares.iter().map(|share| usize::from(share.unsigned_abs())).collect();
        for state in &mut states {
            let count = &mut next[usize::from(state.symbol)];
            state.bits = accuracy - count.ilog2();
            state.base = (*count << state.bits) - size;
            *count += 1;
        }
        Some(Table { accuracy, states })
    }

    fn next(&self, state: usize, bits: &mut BackwardBits) -> Option<usize> {
        let State { bits: count, base, .. } = self.states[state];
        Some(base + bits.read(count)? as usize)
    }
}

/// A Huffman code: by the next bits, a symbol and the number of its bits.
struct Huffman {
    width: u32,
    symbols: Vec<(u8, u8)>,
}

impl Huffman {
    fn read(bytes: &mut &[u8]) -> Option<Huffman> {
        let weights = match take(bytes, 1)?[0] {
            length @ ..128 => Self::weights(take(bytes, length.into())?)?,
            more => {
                let count = usize::from(more) - 127;
                let nibbles = take(bytes, count.div_ceil(2))?.iter().flat_map(|byte| [byte >> 4, byte & 15]);
                nibbles.take(count).collect()
            }
        };
        Self::new(weights)
    }

    /// Reads weights that two states of a table give in turn.
    fn weights(mut bytes: &[u8]) -> Option<Vec<u8>> {
        let table = Table::read(6, 16, &mut bytes)?;
        let mut bits = BackwardBits::new(bytes)?;
        let mut states = [0; 2];
        for state in &mut states {
            *state = bits.read(table.accuracy)? as usize;
        }
        let mut weights = Vec::new();
        while weights.len() < 254 {
            let [state, other] = states;
            weights.push(table.states[state].symbol);
            let Some(next) = table.next(state, &mut bits) else {
                weights.push(table.states[other].symbol);
                return Some(weights);
            };
            states = [other, next];
        }
        None
    }

    /// The code of all weights but the last, which fills it up.
    fn new(mut weights: Vec<u8>) -> Option<Huffman> {
        if weights.iter().any(|weight| *weight > 11) {
            return None;
        }
        let sum: usize = weights.iter().map(|weight| (1 << weight) >> 1).sum();
        let width = sum.checked_ilog2()? + 1;
        let rest = (1 << width) - sum;
        if width > 11 || !rest.is_power_of_two() {
            return None;
        }
        weights.push(rest.ilog2() as u8 + 1);
        let mut symbols = Vec::with_capacity(1 << width);
        for weight in 1..=width as u8 {
            for (symbol, _) in weights.iter().enumerate().filter(|(_, other)| **other == weight) {
                let entry = (u8::try_from(symbol).ok()?, width as u8 + 1 - weight);
                symbols.extend(std::iter::repeat_n(entry, 1 << (weight - 1)));
            }
        }
        (symbols.len() == 1 << width).then_some(Huffman { width, symbols })
    }

    /// Appends the `count` symbols of a stream.
    fn decode(&self, bytes: &[u8], count: usize, out: &mut Vec<u8>) -> Option<()> {
        let mut bits = BackwardBits::new(bytes)?;
        for _ in 0..count {
            let (symbol, length) = self.symbols[bits.peek(self.width) as usize];
            bits.left = bits.left.checked_sub(length.into())?;
            out.push(symbol);
        }
        (bits.left == 0).then_some(())
    }
}

/// Bits from the end of a stream to its beginning. The highest one only marks the end.
struct BackwardBits<'a> {
    bytes: &'a [u8],
    left: usize,
}

impl BackwardBits<'_> {
    fn new(bytes: &[u8]) -> Option<BackwardBits<'_>> {
        let left = 8 * bytes.len().checked_sub(1)? + bytes.last()?.checked_ilog2()? as usize;
        Some(BackwardBits { bytes, left })
    }

    /// The next bits, at most 31. Those before the beginning are zero.
    fn peek(&self, count: u32) -> u64 {
        let start = self.left.saturating_sub(count as usize);
        let missing = count as usize - (self.left - start);
        let eight = |at: usize| match self.bytes.get(at..).and_then(|rest| rest.first_chunk()) {
            Some(eight) => u64::from_le_bytes(*eight),
            None => little(&self.bytes[at.min(self.bytes.len())..]),
        };
        let bits = eight(start / 8) >> (start % 8) & ((1 << (self.left - start)) - 1);
        bits << missing
    }

    fn read(&mut self, count: u32) -> Option<u64> {
        let bits = self.peek(count);
        self.left = self.left.checked_sub(count as usize)?;
        Some(bits)
    }
}

/// Takes so many bytes from the front.
fn take<'a>(bytes: &mut &'a [u8], count: usize) -> Option<&'a [u8]> {
    let (taken, rest) = bytes.split_at_checked(count)?;
    *bytes = rest;
    Some(taken)
}

/// The number of at most eight bytes.
fn little(bytes: &[u8]) -> u64 {
    bytes.iter().rev().fold(0, |number, byte| number << 8 | u64::from(*byte))
}
