//! The fast path for large binary files with uniform rows: vertices of plain numbers, and faces that are all triangles.
//! Every other case, including mistakes, is left to the reader of single rows, which handles all forms and reports
//! errors.
//!
//! Rows are read in pieces that fit in the cache of a core, and are converted there. Memory traffic is therefore little
//! more than the data of the mesh.

use std::sync::atomic::{AtomicBool, Ordering};

use super::header::{Element, Encoding, Kind};
use super::payload::Payload;
use super::{Extra, Positions, Vertices, Wanted, from_top};
use crate::content::View;
use canaletto::math::Rgb;
use canaletto::memory;
use canaletto_parallel::prelude::*;
use glam::{Vec2, Vec3};

/// The number of bytes that are read at a time. Larger pieces exceed the cache; smaller ones need too many system
/// calls.
const PIECE: usize = 1 << 18;

/// The position of a number in each row.
#[derive(Clone, Copy)]
struct Column {
    offset: usize,
    kind: Kind,
    big: bool,
}

impl Column {
    fn of(element: &Element, property: usize, big: bool) -> Column {
        let offset = element.properties[..property].iter().map(|p| p.kind.size()).sum();
        Column { offset, kind: element.properties[property].kind, big }
    }

    /// Calls `put` with the index and the number of each row. The number may be more precise than the `f32` that is
    /// stored.
    #[inline]
    fn each(self, rows: &[u8], stride: usize, mut put: impl FnMut(usize, f64)) {
        macro_rules! each {
            ($type:ty) => {{
                for (i, row) in rows.chunks_exact(stride).enumerate() {
                    if let Some(bytes) = row[self.offset..].first_chunk() {
                        let bytes = *bytes;
                        put(
                            i,
                            if self.big { <$type>::from_be_bytes(bytes) } else { <$type>::from_le_bytes(bytes) }.into(),
                        );
                    }
                }
            }};
        }
        match self.kind {
            Kind::I8 => each!(i8),
            Kind::U8 => each!(u8),
            Kind::I16 => each!(i16),
            Kind::U16 => each!(u16),
            Kind::I32 => each!(i32),
            Kind::U32 => each!(u32),
            Kind::F32 => each!(f32),
            Kind::F64 => each!(f64),
        }
    }

    /// Whether `f32` rounds some of its numbers.
    fn rounds(self) -> bool {
        matches!(self.kind, Kind::F64 | Kind::I32 | Kind::U32)
    }

    fn is_plain(self) -> bool {
        self.kind == Kind::F32 && !self.big
    }
}

/// Reads vectors, with the results of the reader of single rows.
fn vectors<const N: usize, V: From<[f32; N]> + Into<[f32; N]> + Copy>(
    columns: [Column; N],
    rows: &[u8],
    stride: usize,
    out: &mut [V],
) {
    let first = columns[0];
    if columns.iter().enumerate().all(|(k, c)| c.is_plain() && c.offset == first.offset + 4 * k) {
        for (out, row) in out.iter_mut().zip(rows.chunks_exact(stride)) {
            let numbers = &row[first.offset..first.offset + 4 * N];
            *out = std::array::from_fn(|k| {
                f32::from_le_bytes([numbers[4 * k], numbers[4 * k + 1], numbers[4 * k + 2], numbers[4 * k + 3]])
            })
            .into();
        }
        return;
    }
    for (k, column) in columns.into_iter().enumerate() {
        column.each(rows, stride, |i, number| {
            let mut vector: [f32; N] = out[i].into();
            vector[k] = number as f32;
            out[i] = vector.into();
        });
    }
}

/// A part of the vertex lists; lists that the file doesn't have are empty.
struct Part<'a> {
    positions: &'a mut [Vec3],
    /// The rounding errors of the positions.
    rest: &'a mut [Vec3],
    normals: &'a mut [Vec3],
    uvs: &'a mut [Vec2],
    radii: &'a mut [f32],
    colors: &'a mut [[f32; 3]],
}

impl<'a> Part<'a> {
    /// Splits off the first `count` items of each list.
    fn take(&mut self, count: usize) -> Part<'a> {
        fn first<'a, T>(list: &mut &'a mut [T], count: usize) -> &'a mut [T] {
            list.split_off_mut(..count.min(list.len())).unwrap_or_default()
        }
        Part {
            positions: first(&mut self.positions, count),
            rest: first(&mut self.rest, count),
            normals: first(&mut self.normals, count),
            uvs: first(&mut self.uvs, count),
            radii: first(&mut self.radii, count),
            colors: first(&mut self.colors, count),
        }
    }
}

/// The layout of vertex rows.
struct VertexRows<'a> {
    view: View<'a>,
    stride: usize,
    position: [Column; 3],
    normal: Option<[Column; 3]>,
    uv: Option<[Column; 2]>,
    radius: Option<Column>,
    color: Option<[Column; 3]>,
    extra: &'a Extra,
}

impl VertexRows<'_> {
    /// Reads the rows at `at`; returns false if the fast path doesn't apply.
    fn read(&self, at: usize, part: Part<'_>, buffer: &mut Vec<u8>) -> bool {
        let stride = self.stride;
        if stride == size_of::<Vec3>() && self.position[0].offset == 0 && self.positions_are_plain() {
            // The bytes of the file are those of the list.
            return self.view.fill(at, bytemuck::cast_slice_mut(part.positions)).is_ok();
        }
        let Ok(rows) = self.view.piece(at..at + part.positions.len() * stride, buffer) else { return false };
        vectors(self.position, rows, stride, part.positions);
        if !part.rest.is_empty() {
            for (k, column) in self.position.into_iter().enumerate() {
                column.each(rows, stride, |i, number| part.rest[i][k] = (number - f64::from(number as f32)) as f32);
            }
        }
        if let Some(columns) = self.normal {
            vectors(columns, rows, stride, part.normals);
        }
        if let Some(columns) = self.uv {
            vectors(columns, rows, stride, part.uvs);
            part.uvs.iter_mut().for_each(|uv| *uv = from_top(*uv));
        }
        let mut good = true;
        if let Some(column) = self.radius {
            column.each(rows, stride, |i, radius| match self.extra.radius(radius) {
                Ok(radius) => part.radii[i] = radius,
                Err(_) => good = false,
            });
        }
        for (k, column) in self.color.into_iter().flatten().enumerate() {
            if let (Kind::U8, Some((_, Kind::U8))) = (column.kind, self.extra.color) {
                for (color, row) in part.colors.iter_mut().zip(rows.chunks_exact(stride)) {
                    color[k] = self.extra.bytes[usize::from(row[column.offset])];
                }
                continue;
            }
            column.each(rows, stride, |i, channel| part.colors[i][k] = self.extra.channel(channel));
        }
        good
    }

    fn positions_are_plain(&self) -> bool {
        let [x, y, z] = self.position;
        let in_order = (y.offset, z.offset) == (x.offset + 4, x.offset + 8);
        cfg!(target_endian = "little") && in_order && self.position.iter().all(|column| column.is_plain())
    }
}

/// Reads the vertices, if the fast path applies.
pub(super) fn vertices(element: &Element, wanted: &Wanted, payload: &mut Payload<'_>) -> Option<Vertices> {
    if element.properties.iter().any(|p| p.length.is_some()) {
        return None;
    }
    let stride: usize = element.properties.iter().map(|p| p.kind.size()).sum();
    let start = payload.table(element, stride)?;
    let big = payload.encoding() == Encoding::Big;
    let column = |property: usize| Column::of(element, property, big);
    let rows = VertexRows {
        view: payload.view(),
        stride,
        position: wanted.position.map(column),
        normal: wanted.normal.map(|properties| properties.map(column)),
        uv: wanted.uv.map(|properties| properties.map(column)),
        radius: wanted.extra.radius.map(column),
        color: wanted.extra.color.map(|(properties, _)| properties.map(column)),
        extra: &wanted.extra,
    };
    let count = element.count as usize;
    let if_there = |there: bool| if there { count } else { 0 };
    let mut positions = memory::zeros(count);
    let mut rest = memory::zeros(if_there(rows.position.iter().any(|column| column.rounds())));
    let mut normals = memory::zeros(if_there(rows.normal.is_some()));
    let mut uvs = memory::zeros(if_there(rows.uv.is_some()));
    let mut radii = memory::zeros(if_there(rows.radius.is_some()));
    let mut colors = memory::zeros(if_there(rows.color.is_some()));
    let mut part = Part {
        positions: &mut positions,
        rest: &mut rest,
        normals: &mut normals,
        uvs: &mut uvs,
        radii: &mut radii,
        colors: &mut colors,
    };
    let step = (PIECE / stride).max(1);
    let parts: Vec<(usize, Part<'_>)> =
        (0..count).step_by(step).map(|first| (start + first * stride, part.take(step))).collect();
    let good = in_parallel(parts, |buffer, (at, part)| rows.read(at, part, buffer));
    good.then(|| payload.pass(count * stride))?;
    let colors = colors.into_iter().map(Rgb::from).collect();
    let positions = Positions::from_parts(positions, rest);
    Some(Vertices { positions, normals, uvs, radii, colors, values: Vec::new() })
}

/// Whether `work` succeeds for all parts; after a failure, parts that have not started are skipped. Each thread has a
/// buffer.
fn in_parallel<T: Send>(parts: Vec<T>, work: impl Fn(&mut Vec<u8>, T) -> bool + Sync) -> bool {
    let odd = AtomicBool::new(false);
    parts.into_par_iter().for_each_init(Vec::new, |buffer, part| {
        if !odd.load(Ordering::Relaxed) && !work(buffer, part) {
            odd.store(true, Ordering::Relaxed);
        }
    });
    !odd.into_inner()
}

/// Reads the faces, if all of them are triangles of existing vertices, with one list and otherwise plain numbers in
/// each row.
pub(super) fn triangles(
    element: &Element,
    property: usize,
    payload: &mut Payload<'_>,
    vertices: usize,
) -> Option<Vec<[u32; 3]>> {
    let lists = element.properties.iter().filter(|p| p.length.is_some());
    let (list, 1) = (&element.properties[property], lists.count()) else { return None };
    let length = list.length?;
    let size = |p: &super::header::Property| p.length.map_or(p.kind.size(), |length| length.size() + 3 * p.kind.size());
    let stride = element.properties.iter().map(size).sum();
    let start = payload.table(element, stride)?;
    let big = payload.encoding() == Encoding::Big;
    let offset: usize = element.properties[..property].iter().map(size).sum();
    let entry = |k: usize| Column { offset: offset + length.size() + k * list.kind.size(), kind: list.kind, big };
    let vertices = u32::try_from(vertices).ok()?;
    // A negative index becomes a too large unsigned one: no mesh has both 2³¹ vertices and negative indices.
    let plain = !big
        && (stride, length.size(), list.kind.size()) == (13, 1, 4)
        && (list.kind == Kind::U32 || list.kind == Kind::I32 && vertices <= i32::MAX as u32);
    let view = payload.view();
    let read = |at: usize, out: &mut [[u32; 3]], buffer: &mut Vec<u8>| {
        let Ok(rows) = view.piece(at..at + out.len() * stride, buffer) else { return false };
        if plain {
            return plain_triangles(rows, out, vertices);
        }
        let mut good = true;
        let length = Column { offset, kind: length, big };
        length.each(rows, stride, |_, length| good &= length == 3.0);
        for (k, column) in [0, 1, 2].map(entry).into_iter().enumerate() {
            column.each(rows, stride, |i, index| {
                // The index must be a non-negative integer below `vertices`.
                out[i][k] = index as u32;
                good &= f64::from(index as u32) == index && (index as u32) < vertices;
            });
        }
        good
    };
    let count = element.count as usize;
    let mut list = memory::zeros(count);
    let step = (PIECE / stride).max(1);
    let parts = list.chunks_mut(step).enumerate();
    let parts: Vec<(usize, &mut [[u32; 3]])> = parts.map(|(i, part)| (start + i * step * stride, part)).collect();
    let good = in_parallel(parts, |buffer, (at, part)| read(at, part, buffer));
    good.then(|| payload.pass(count * stride))?;
    Some(list)
}

/// Reads rows of a byte, which must be 3, and three indices, which must be below `vertices`.
fn plain_triangles(rows: &[u8], out: &mut [[u32; 3]], vertices: u32) -> bool {
    let (mut lengths, mut largest) = (0, 0);
    for (triangle, row) in out.iter_mut().zip(rows.as_chunks::<13>().0) {
        let [length, entries @ ..] = row;
        let corner =
            |k: usize| u32::from_le_bytes([entries[4 * k], entries[4 * k + 1], entries[4 * k + 2], entries[4 * k + 3]]);
        *triangle = [corner(0), corner(1), corner(2)];
        lengths |= length ^ 3;
        largest = triangle[0].max(triangle[1]).max(triangle[2]).max(largest);
    }
    lengths == 0 && largest < vertices
}
