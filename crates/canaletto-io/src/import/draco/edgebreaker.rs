//! Connectivity by Edgebreaker (Rossignac, 1999), in the order of Isenburg and Snoeyink (2001): from the last triangle
//! to the first.
//!
//! Triangles are added at active edges, which are named by the corners opposite to them. The edge on top of a stack is
//! the one at work. All symbols but E glue their triangle to it. Labels are the vertices so far: where symbols glue two
//! of them together, the later one refers to the other.

use super::corners::{CornerTable, NONE, next, previous};
use super::entropy::{BitDecoder, symbols};
use super::reader::{Bits, Reader};
use super::seams::{Seams, read_seams};
use super::{Budget, CUT_OFF, Decoded};
use std::collections::HashMap;

const WRONG: &str = "their triangles don't fit together";

/// A decoded surface, before its attributes.
pub(super) struct Surface {
    pub(super) table: CornerTable,
    /// The seams of the attributes that have some of their own.
    pub(super) seams: Vec<Seams>,
    /// The number of vertices, after which those without corners may be.
    pub(super) vertices: usize,
}

/// The counts at the start.
struct Counts {
    vertices: u32,
    triangles: u32,
    /// The attributes with seams.
    seams: u8,
    symbols: u32,
    splits: u32,
}

/// A hole or a handle: an S glues an edge of an earlier triangle, which isn't the active one, to its own.
struct Split {
    /// The symbols of both triangles, in the order of the encoder.
    source: u32,
    split: u32,
    is_right: bool,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Symbol {
    C,
    S,
    L,
    R,
    E,
}

/// Reads a surface.
pub(super) fn surface(stream: &mut Reader, budget: &mut Budget) -> Decoded<Surface> {
    let is_by_valence = match stream.byte()? {
        0 => false,
        1 => return Err("their connectivity is Edgebreaker with prediction, which is obsolete and isn't read".into()),
        2 => true,
        _ => return Err("their Edgebreaker has an unknown kind".into()),
    };
    let counts = Counts::read(stream)?;
    budget.triangles(counts.triangles, 3 + usize::from(counts.seams))?;
    let splits = splits(stream, &counts)?;
    let coded = if is_by_valence { None } else { Some(stream.block()?) };
    let mut starts = BitDecoder::new(stream)?;
    let seams = (0..counts.seams).map(|_| BitDecoder::new(stream)).collect::<Decoded<Vec<_>>>()?;
    let source = match coded {
        Some(coded) => Symbols::Plain(Bits::new(coded)),
        None => Symbols::by_valence(stream, &counts)?,
    };
    let mut builder = Builder::new(&counts, splits, source);
    for symbol in 0..counts.symbols {
        builder.add(symbol)?;
    }
    builder.close(&mut starts)?;
    let (table, vertices) = builder.finish(seams.is_empty());
    let seams = seams.into_iter().map(|bits| read_seams(&table, bits)).collect::<Decoded<_>>()?;
    Ok(Surface { table, seams, vertices })
}

impl Counts {
    fn read(stream: &mut Reader) -> Decoded<Counts> {
        let (vertices, triangles) = (stream.number()?, stream.number()?);
        let (seams, symbols, splits) = (stream.byte()?, stream.number()?, stream.number()?);
        // A component has one triangle without a symbol at most, and that has three neighbours.
        let is_right = u64::from(vertices) <= 3 * u64::from(triangles)
            && (symbols..=symbols.saturating_add(symbols / 3)).contains(&triangles)
            && splits <= symbols;
        match is_right {
            true => Ok(Counts { vertices, triangles, seams, symbols, splits }),
            false => Err(format!("{triangles} triangles can't have {vertices} vertices and {symbols} symbols").into()),
        }
    }

    /// The most labels. Those of splits are glued to others.
    fn labels(&self) -> usize {
        self.vertices as usize + self.splits as usize
    }
}

fn splits(stream: &mut Reader, counts: &Counts) -> Decoded<Vec<Split>> {
    let count = stream.number()?;
    if count > counts.triangles {
        return Err(format!("{} triangles can't have {count} splits", counts.triangles).into());
    }
    let (mut splits, mut source) = (Vec::new(), 0u32);
    for _ in 0..count {
        source = source.checked_add(stream.number()?).ok_or(WRONG)?;
        let split = source.checked_sub(stream.number()?).ok_or(WRONG)?;
        splits.push(Split { source, split, is_right: false });
    }
    let mut sides = Bits::new(stream.0);
    for split in &mut splits {
        split.is_right = sides.read(1)? == 1;
    }
    *stream = sides.rest();
    Ok(splits)
}

/// Where symbols come from.
enum Symbols<'a> {
    /// C has 1 bit, all others 3.
    Plain(Bits<'a>),
    /// By the valence of the next vertex of the active corner, from 2 to 7, symbols are in separate lists.
    ByValence { lists: [Vec<u32>; 6], valences: Vec<u32>, list: Option<usize> },
}

impl Symbols<'_> {
    fn by_valence(stream: &mut Reader, counts: &Counts) -> Decoded<Symbols<'static>> {
        let mut lists: [Vec<u32>; 6] = Default::default();
        let mut left = counts.symbols;
        for list in &mut lists {
            let count = stream.number()?;
            left = left.checked_sub(count).ok_or("there are more symbols than they tell")?;
            *list = symbols(stream, count as usize, 1)?;
        }
        Ok(Symbols::ByValence { lists, valences: vec![0; counts.labels()], list: None })
    }

    fn next(&mut self) -> Decoded<Symbol> {
        match self {
            Symbols::Plain(bits) => Ok(match bits.read(1)? {
                0 => Symbol::C,
                _ => [Symbol::S, Symbol::L, Symbol::R, Symbol::E][bits.read(2)? as usize],
            }),
            Symbols::ByValence { list: None, .. } => Ok(Symbol::E),
            Symbols::ByValence { lists, list: Some(list), .. } => {
                let symbol = lists[*list].pop().ok_or(CUT_OFF)?;
                let known = [Symbol::C, Symbol::S, Symbol::L, Symbol::R, Symbol::E];
                Ok(*known.get(symbol as usize).ok_or("a triangle has an unknown symbol")?)
            }
        }
    }

    /// Notes that a label is glued to another one.
    fn glue(&mut self, from: u32, to: u32) {
        if let Symbols::ByValence { valences, .. } = self {
            valences[to as usize] += valences[from as usize];
        }
    }

    /// Notes the labels of a new triangle, from its first corner on.
    fn added(&mut self, symbol: Symbol, labels: [u32; 3]) {
        let Symbols::ByValence { valences, list, .. } = self else { return };
        let edges = match symbol {
            Symbol::C | Symbol::S => [0, 1, 1],
            Symbol::R => [1, 1, 2],
            Symbol::L => [1, 2, 1],
            Symbol::E => [2, 2, 2],
        };
        for (label, edges) in labels.into_iter().zip(edges) {
            valences[label as usize] += edges;
        }
        *list = Some(valences[labels[1] as usize].clamp(2, 7) as usize - 2);
    }
}

/// A surface that grows.
struct Builder<'a> {
    source: Symbols<'a>,
    splits: Vec<Split>,
    symbols: u32,
    triangles: u32,
    /// The most labels.
    most: usize,
    /// The corner table, in which the vertices are labels.
    table: CornerTable,
    /// What each label is glued to; itself if nothing.
    glued: Vec<u32>,
    /// The labels that were glued to others, in their order.
    given_up: Vec<u32>,
    active: Vec<u32>,
    /// The edges that splits wait for, by their symbols.
    waiting: HashMap<u32, u32>,
}

impl<'a> Builder<'a> {
    fn new(counts: &Counts, splits: Vec<Split>, source: Symbols<'a>) -> Builder<'a> {
        let corners = 3 * counts.triangles as usize;
        let table = CornerTable {
            opposites: vec![NONE; corners],
            vertices: Vec::with_capacity(corners),
            firsts: Vec::with_capacity(counts.labels()),
        };
        Builder {
            source,
            splits,
            symbols: counts.symbols,
            triangles: counts.triangles,
            most: counts.labels(),
            table,
            glued: Vec::new(),
            given_up: Vec::new(),
            active: Vec::new(),
            waiting: HashMap::new(),
        }
    }

    /// The label of a corner.
    fn label(&mut self, corner: u32) -> u32 {
        let mut label = self.table.vertex(corner);
        while self.glued[label as usize] != label {
            let further = self.glued[self.glued[label as usize] as usize];
            self.glued[label as usize] = further;
            label = further;
        }
        self.table.vertices[corner as usize] = label;
        label
    }

    /// A new label, whose first corner is this.
    fn new_label(&mut self, first: u32) -> Decoded<u32> {
        let label = self.glued.len();
        if label >= self.most {
            return Err("there are more vertices than they tell".into());
        }
        self.glued.push(label as u32);
        self.table.firsts.push(first);
        Ok(label as u32)
    }

    /// Makes two corners opposite, whose edges must be free.
    fn join(&mut self, a: u32, b: u32) -> Decoded<()> {
        if self.table.opposite(a) != NONE || self.table.opposite(b) != NONE || a == b {
            return Err(WRONG.into());
        }
        self.table.opposites[a as usize] = b;
        self.table.opposites[b as usize] = a;
        Ok(())
    }

    /// The corner at the active edge.
    fn top(&self) -> Decoded<u32> {
        Ok(*self.active.last().ok_or(WRONG)?)
    }

    /// The corner of the next free edge around a label, from its first corner on.
    fn free_edge(&self, label: u32) -> u32 {
        next(self.table.first(label))
    }

    /// Adds the triangle of a symbol.
    fn add(&mut self, number: u32) -> Decoded<()> {
        let corner = self.table.vertices.len() as u32;
        let symbol = self.source.next()?;
        let labels = match symbol {
            Symbol::C => self.fill_gap(corner)?,
            Symbol::S => self.merge(corner, number)?,
            Symbol::L | Symbol::R => self.extend(corner, symbol == Symbol::R)?,
            Symbol::E => self.begin(corner)?,
        };
        self.table.vertices.extend(labels);
        self.source.added(symbol, labels);
        if !matches!(symbol, Symbol::C | Symbol::S) {
            self.look_for_splits(corner, self.symbols - number - 1)?;
        }
        Ok(())
    }

    /// C: between the active edge and the next free one around a vertex, whose fan closes.
    fn fill_gap(&mut self, corner: u32) -> Decoded<[u32; 3]> {
        let a = self.top()?;
        let middle = self.label(next(a));
        let b = self.free_edge(middle);
        let (before, after) = (self.label(previous(a)), self.label(next(b)));
        if a == b || middle == before || middle == after {
            return Err(WRONG.into());
        }
        self.join(a, corner + 1)?;
        self.join(b, corner + 2)?;
        self.table.firsts[before as usize] = corner + 2;
        self.replace_top(corner);
        Ok([middle, after, before])
    }

    /// S: between two active edges, whose common vertex becomes one.
    fn merge(&mut self, corner: u32, number: u32) -> Decoded<[u32; 3]> {
        let b = self.top()?;
        self.active.pop();
        self.active.extend(self.waiting.remove(&number));
        let a = self.top()?;
        if a == b {
            return Err(WRONG.into());
        }
        let (kept, given_up) = (self.label(previous(a)), self.label(next(b)));
        let (left, right) = (self.label(next(a)), self.label(previous(b)));
        if kept == given_up || [kept, given_up].contains(&left) || [kept, given_up].contains(&right) {
            return Err(WRONG.into());
        }
        self.join(a, corner + 2)?;
        self.join(b, corner + 1)?;
        self.source.glue(given_up, kept);
        self.glued[given_up as usize] = kept;
        self.table.firsts[right as usize] = corner + 2;
        self.table.firsts[kept as usize] = self.table.first(given_up);
        self.table.firsts[given_up as usize] = NONE;
        self.given_up.push(given_up);
        self.replace_top(corner);
        Ok([kept, left, right])
    }

    /// L and R: at the active edge, with a new vertex.
    fn extend(&mut self, corner: u32, is_right: bool) -> Decoded<[u32; 3]> {
        let a = self.top()?;
        let (left, right) = (self.label(next(a)), self.label(previous(a)));
        let tip = corner + if is_right { 2 } else { 1 };
        self.join(a, tip)?;
        let new = self.new_label(tip)?;
        self.table.firsts[right as usize] = if is_right { corner } else { corner + 2 };
        self.replace_top(corner);
        Ok(if is_right { [right, left, new] } else { [left, new, right] })
    }

    /// E: alone.
    fn begin(&mut self, corner: u32) -> Decoded<[u32; 3]> {
        self.active.push(corner);
        Ok([self.new_label(corner)?, self.new_label(corner + 1)?, self.new_label(corner + 2)?])
    }

    fn replace_top(&mut self, corner: u32) {
        if let Some(top) = self.active.last_mut() {
            *top = corner;
        }
    }

    /// Keeps the edges of a new triangle that splits wait for. `source` is its number for the encoder.
    fn look_for_splits(&mut self, corner: u32, source: u32) -> Decoded<()> {
        while let Some(split) = self.splits.pop_if(|split| split.source >= source) {
            if split.source > source {
                return Err(WRONG.into());
            }
            let edge = if split.is_right { next(corner) } else { previous(corner) };
            let number = self.symbols.checked_sub(split.split + 1).ok_or(WRONG)?;
            self.waiting.insert(number, edge);
        }
        Ok(())
    }

    /// Closes the holes that are triangles without a symbol.
    fn close(&mut self, starts: &mut BitDecoder) -> Decoded<()> {
        while let Some(a) = self.active.pop() {
            if !starts.next()? {
                continue;
            }
            let corner = self.table.vertices.len() as u32;
            if corner as usize >= self.table.opposites.len() {
                return Err(WRONG.into());
            }
            let n = self.label(next(a));
            let b = self.free_edge(n);
            let x = self.label(next(b));
            let c = self.free_edge(x);
            let p = self.label(next(c));
            if p != self.label(previous(a)) {
                return Err(WRONG.into());
            }
            for (k, edge) in [a, b, c].into_iter().enumerate() {
                self.join(edge, corner + k as u32)?;
            }
            self.table.vertices.extend([x, p, n]);
        }
        match self.table.vertices.len() == 3 * self.triangles as usize {
            true => Ok(()),
            false => Err("there are fewer triangles than they tell".into()),
        }
    }

    /// The table and the number of vertices. Where no attribute has seams, vertices are points, so that the last ones
    /// take the place of those that were given up.
    fn finish(mut self, is_dense: bool) -> (CornerTable, usize) {
        for corner in 0..self.table.vertices.len() as u32 {
            self.label(corner);
        }
        let count = if is_dense { self.fill_places() } else { self.glued.len() };
        (self.table, count)
    }

    /// Moves the last labels to the places of those that were given up. Returns the count of places.
    fn fill_places(&mut self) -> usize {
        let mut count = self.glued.len();
        let mut places: Vec<u32> = (0..count as u32).collect();
        // The labels at the places.
        let mut labels = places.clone();
        for &empty in &self.given_up {
            while count > 0 && self.table.first(count as u32 - 1) == NONE {
                count -= 1;
            }
            let Some(last) = count.checked_sub(1).filter(|last| *last >= empty as usize) else { continue };
            let moved = labels[last];
            places[moved as usize] = empty;
            labels[empty as usize] = moved;
            self.table.firsts[empty as usize] = self.table.firsts[last];
            self.table.firsts[last] = NONE;
            count = last;
        }
        self.table.vertices.iter_mut().for_each(|vertex| *vertex = places[*vertex as usize]);
        count
    }
}
