//! Large binary files whose rows are all alike, read in parallel: vertices of plain numbers, and faces of which each is a
//! triangle. Whatever else is met, be it a mistake, is left to the reader of single rows, which knows all forms and says
//! what is wrong.

use std::sync::atomic::{AtomicBool, Ordering};

use super::header::{Element, Kind};
use super::payload::Payload;
use glam::{Vec2, Vec3};
use rayon::prelude::*;

/// Which properties of vertices are wanted.
pub(super) struct Columns<'a> {
    pub(super) position: [usize; 3],
    pub(super) normal: Option<[usize; 3]>,
    pub(super) uv: Option<&'a [usize; 2]>,
}

/// Positions, normals and texture coordinates.
type Lists = (Vec<Vec3>, Vec<Vec3>, Vec<Vec2>);

/// A number of each row.
#[derive(Clone, Copy)]
struct Column {
    offset: usize,
    kind: Kind,
    big: bool,
}

impl Column {
    /// The numbers that rows of `f32` hold are exact; others are rounded as the reader of single rows does.
    #[inline]
    fn read(self, row: &[u8]) -> f32 {
        fn at<const N: usize>(row: &[u8], offset: usize, big: bool) -> [u8; N] {
            let mut bytes = [0; N];
            bytes.copy_from_slice(&row[offset..offset + N]);
            if big {
                bytes.reverse();
            }
            bytes
        }
        let Self { offset, kind, big } = self;
        match kind {
            Kind::F32 => f32::from_le_bytes(at(row, offset, big)),
            Kind::F64 => f64::from_le_bytes(at(row, offset, big)) as f32,
            Kind::I8 => f32::from(i8::from_le_bytes(at(row, offset, big))),
            Kind::U8 => f32::from(u8::from_le_bytes(at(row, offset, big))),
            Kind::I16 => f32::from(i16::from_le_bytes(at(row, offset, big))),
            Kind::U16 => f32::from(u16::from_le_bytes(at(row, offset, big))),
            Kind::I32 => i32::from_le_bytes(at(row, offset, big)) as f32,
            Kind::U32 => u32::from_le_bytes(at(row, offset, big)) as f32,
        }
    }
}

/// The vertices, if the element is a table and every position is finite.
pub(super) fn vertices(element: &Element, payload: &mut Payload<'_>, columns: &Columns<'_>) -> Option<Lists> {
    if element.properties.iter().any(|p| p.length.is_some()) {
        return None;
    }
    let stride = element.properties.iter().map(|p| p.kind.size()).sum();
    let table = payload.table(element, stride)?;
    let big = payload.is_big();
    let column = |property: usize| Column {
        offset: element.properties[..property].iter().map(|p| p.kind.size()).sum(),
        kind: element.properties[property].kind,
        big,
    };
    let vectors = |properties: [usize; 3]| {
        let columns = properties.map(column);
        let mut list = Vec::new();
        table
            .par_chunks_exact(stride)
            .map(|row| Vec3::from(columns.map(|column| column.read(row))))
            .collect_into_vec(&mut list);
        list
    };
    let positions = vectors(columns.position);
    if !positions.par_iter().all(|p| p.is_finite()) {
        return None;
    }
    let normals = columns.normal.map_or(Vec::new(), vectors);
    let uvs = columns.uv.map_or(Vec::new(), |properties| {
        let columns = properties.map(column);
        let mut list = Vec::new();
        table
            .par_chunks_exact(stride)
            .map(|row| Vec2::from(columns.map(|column| column.read(row))))
            // What is not finite becomes 0.
            .map(|uv| if uv.is_finite() { uv } else { Vec2::ZERO })
            .collect_into_vec(&mut list);
        list
    });
    payload.pass(table);
    Some((positions, normals, uvs))
}

/// The faces, if they are all triangles of vertices that exist, in rows that hold nothing else.
pub(super) fn triangles(element: &Element, payload: &mut Payload<'_>, vertices: usize) -> Option<Vec<[u32; 3]>> {
    let [only] = element.properties.as_slice() else { return None };
    if !matches!(only.length, Some(Kind::U8 | Kind::I8)) || !matches!(only.kind, Kind::I32 | Kind::U32) {
        return None;
    }
    let table = payload.table(element, 13)?;
    let big = payload.is_big();
    // A negative index becomes one beyond all: no mesh has 2³¹ vertices and negative indices both.
    let vertices = u32::try_from(vertices).ok().filter(|&n| only.kind == Kind::U32 || n <= i32::MAX as u32)?;
    let odd = AtomicBool::new(false);
    let mut list = Vec::new();
    table
        .par_chunks_exact(13)
        .map(|row| {
            let corner = |i: usize| {
                let bytes = [row[i], row[i + 1], row[i + 2], row[i + 3]];
                if big { u32::from_be_bytes(bytes) } else { u32::from_le_bytes(bytes) }
            };
            let triangle = [corner(1), corner(5), corner(9)];
            if row[0] != 3 || triangle.iter().any(|&v| v >= vertices) {
                odd.store(true, Ordering::Relaxed);
            }
            triangle
        })
        .collect_into_vec(&mut list);
    if odd.into_inner() {
        return None;
    }
    payload.pass(table);
    Some(list)
}
