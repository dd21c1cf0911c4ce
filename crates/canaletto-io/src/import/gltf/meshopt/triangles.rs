//! The mode TRIANGLES: each triangle is a byte, which names an edge and a vertex that were seen shortly before.

use super::{Decoded, Reader, difference, push_index};

/// The last 16 entries that were pushed.
#[derive(Default)]
struct Recent<T> {
    entries: [T; 16],
    pushed: usize,
}

impl<T: Copy> Recent<T> {
    fn push(&mut self, entry: T) {
        self.entries[self.pushed % 16] = entry;
        self.pushed += 1;
    }

    /// The entry that was pushed `back` entries before the latest.
    fn get(&self, back: u8) -> Decoded<T> {
        let at = self.pushed.checked_sub(usize::from(back) + 1).ok_or("a triangle refers to one before the first")?;
        Ok(self.entries[at % 16])
    }
}

/// What a decoder knows between triangles.
struct Decoder<'a> {
    /// The bytes that codes refer to.
    data: Reader<'a>,
    /// The pairs of vertices of the commonest triangles without a known edge.
    pairs: &'a [u8],
    /// The codes of vertices below this one name recent vertices.
    codes_of_recent: u8,
    /// The vertex that follows all before.
    next: u32,
    /// The vertex that was written out last.
    last: u32,
    edges: Recent<[u32; 2]>,
    vertices: Recent<u32>,
}

/// Decodes `count` indices of `stride` bytes.
pub(super) fn decode(bytes: &[u8], count: usize, stride: usize) -> Decoded<Vec<u8>> {
    let mut stream = Reader(bytes);
    let codes_of_recent = match stream.byte()? {
        0xE0 => 15,
        0xE1 => 13,
        _ => return Err("triangles begin with the byte 0xe0 or 0xe1"),
    };
    let pairs = stream.take_back(16)?;
    if pairs.iter().any(|pair| pair >> 4 == 15 || pair & 15 == 15) {
        return Err("their table of pairs is invalid");
    }
    let codes = stream.take(count / 3)?;
    let mut decoder = Decoder {
        data: stream,
        pairs,
        codes_of_recent,
        next: 0,
        last: 0,
        edges: Recent::default(),
        vertices: Recent::default(),
    };
    let mut decoded = Vec::with_capacity(count * stride);
    for &code in codes {
        decoder.triangle(code)?.into_iter().for_each(|index| push_index(&mut decoded, index, stride));
    }
    decoder.data.end()?;
    Ok(decoded)
}

impl Decoder<'_> {
    fn triangle(&mut self, code: u8) -> Decoded<[u32; 3]> {
        match (code >> 4, code & 15) {
            (15, kind) => self.apart(kind),
            (edge, vertex) => self.beside(edge, vertex),
        }
    }

    /// A triangle beside a recent edge.
    fn beside(&mut self, edge: u8, vertex: u8) -> Decoded<[u32; 3]> {
        let [a, b] = self.edges.get(edge)?;
        let (c, seen) = match vertex {
            0 => (self.next_vertex(), false),
            back if back < self.codes_of_recent => (self.vertices.get(back)?, true),
            13 => (self.written(1u32.wrapping_neg()), false),
            14 => (self.written(1), false),
            _ => (self.read_vertex()?, false),
        };
        self.edges.push([c, b]);
        self.edges.push([a, c]);
        if !seen {
            self.vertices.push(c);
        }
        Ok([a, b, c])
    }

    /// A triangle without a recent edge.
    fn apart(&mut self, kind: u8) -> Decoded<[u32; 3]> {
        let pair = match kind {
            0..14 => self.pairs[usize::from(kind)],
            _ => self.data.byte()?,
        };
        if kind >= 14 && pair == 0 {
            self.next = 0;
        }
        let a = if kind == 15 { self.read_vertex()? } else { self.next_vertex() };
        let (b, is_b_seen) = self.vertex(pair >> 4)?;
        let (c, is_c_seen) = self.vertex(pair & 15)?;
        for edge in [[b, a], [c, b], [a, c]] {
            self.edges.push(edge);
        }
        for (vertex, seen) in [(a, false), (b, is_b_seen), (c, is_c_seen)] {
            if !seen {
                self.vertices.push(vertex);
            }
        }
        Ok([a, b, c])
    }

    /// A vertex of a pair, and whether it is among the recent ones.
    fn vertex(&mut self, code: u8) -> Decoded<(u32, bool)> {
        Ok(match code {
            0 => (self.next_vertex(), false),
            15 => (self.read_vertex()?, false),
            back => (self.vertices.get(back - 1)?, true),
        })
    }

    fn next_vertex(&mut self) -> u32 {
        let vertex = self.next;
        self.next = vertex.wrapping_add(1);
        vertex
    }

    fn read_vertex(&mut self) -> Decoded<u32> {
        let step = difference(self.data.number()?);
        Ok(self.written(step))
    }

    /// The vertex at a distance from the one that was written out last.
    fn written(&mut self, step: u32) -> u32 {
        self.last = self.last.wrapping_add(step);
        self.last
    }
}
