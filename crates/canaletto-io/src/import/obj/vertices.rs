//! The first pass over an OBJ file: its vertices, and the names of its material files.

use super::super::join::join;
use super::super::lines::{Complaint, Lines, Words, gap};
use super::super::number;
use super::super::positions::Positions;
use super::super::text::{Piece, Text};
use super::faces::NONE;
use crate::picture::decode_srgb;
use canaletto::math::Rgb;
use glam::{DVec3, Vec2, Vec3};

/// What the file's lists of vertices hold.
#[derive(Default)]
pub(super) struct Vertices {
    /// Where the positions are counted from.
    pub(super) origin: DVec3,
    pub(super) positions: Vec<Vec3>,
    /// Empty, or one for each position.
    pub(super) colors: Vec<Rgb>,
    pub(super) uvs: Vec<Vec2>,
    pub(super) normals: Vec<Vec3>,
}

/// What the first pass finds.
pub(super) struct First {
    pub(super) vertices: Vertices,
    /// What `mtllib` names, and where.
    pub(super) libraries: Vec<(usize, Vec<u8>)>,
    /// How many positions, texture coordinates and normals come before each piece.
    pub(super) before: Vec<[usize; 3]>,
    /// The pieces in which there is more than vertices.
    pub(super) others: Vec<usize>,
}

/// What a piece holds.
#[derive(Default)]
struct Found {
    positions: Positions,
    vertices: Vertices,
    libraries: Vec<(usize, Vec<u8>)>,
    others: bool,
}

/// Reads all vertices.
pub(super) fn read(text: Text<'_>) -> Result<First, Complaint> {
    let all: Vec<usize> = (0..text.len()).collect();
    let mut first =
        First { vertices: Vertices::default(), libraries: Vec::new(), before: Vec::new(), others: Vec::new() };
    let (mut positions, mut uvs, mut normals) = (Vec::new(), Vec::new(), Vec::new());
    let mut colors: Vec<Rgb> = Vec::new();
    let mut count = [0; 3];
    text.each(
        &all,
        |_, piece| find(piece),
        |index, found| {
            let Found { positions: some, vertices, libraries, others } = found?;
            if !vertices.colors.is_empty() {
                colors.resize(count[0], Rgb::WHITE);
                colors.extend(vertices.colors);
            }
            first.before.push(count);
            count[0] += some.len();
            count[1] += vertices.uvs.len();
            count[2] += vertices.normals.len();
            positions.push(some);
            uvs.push(vertices.uvs);
            normals.push(vertices.normals);
            first.libraries.extend(libraries);
            first.others.extend(others.then_some(index));
            Ok(())
        },
    )?;
    if !colors.is_empty() {
        colors.resize(count[0], Rgb::WHITE);
    }
    if count.iter().any(|n| *n >= NONE as usize) {
        return Err(Complaint::file("it has more vertices than 32 bits can count"));
    }
    let (origin, positions) = Positions::settle_all(positions);
    first.vertices = Vertices { origin, positions, colors, uvs: join(uvs), normals: join(normals) };
    Ok(first)
}

fn find(piece: Piece<'_>) -> Result<Found, Complaint> {
    let mut found = Found::default();
    // Faces have neither letter.
    if memchr::memchr2(b'v', b'm', piece.bytes).is_none() {
        return Ok(Found { others: true, ..found });
    }
    let Found { positions, vertices: out, libraries, others } = &mut found;
    let mut lines = Lines::of_piece(piece).joined();
    loop {
        while let Some((rounded, exact)) = lines.easy(plain_position) {
            positions.push(rounded, exact);
        }
        let Some(line) = lines.next() else { break };
        let mut words = line.words();
        let Some(word) = words.next() else { continue };
        match word.text {
            b"v" => {
                let (rounded, exact) = words.position("vertex")?;
                positions.push(rounded, exact);
                if let Some(color) = vertex_color(words)? {
                    out.colors.resize(positions.len() - 1, Rgb::WHITE);
                    out.colors.push(color);
                }
            }
            b"vt" => {
                let u = words.number("texture coordinate")?;
                let v = words.next().map_or(Ok(0.0), |w| w.number())?;
                out.uvs.push(Vec2::new(u, v));
            }
            b"vn" => out.normals.push(words.numbers::<3>("normal")?.into()),
            b"mtllib" => {
                let names = words.rest();
                libraries.push((names.span().start, names.text.to_owned()));
            }
            _ => *others = true,
        }
    }
    found.positions = found.positions.part();
    Ok(found)
}

/// The position of a line of `v` and three easy numbers, which most lines are, and the line's length.
#[inline]
fn plain_position(line: &[u8]) -> Option<((Vec3, DVec3), usize)> {
    let mut at = usize::from(*line.first()? == b'v');
    let (mut rounded, mut exact) = ([0.0; 3], [0.0; 3]);
    for axis in 0..3 {
        at = gap(line, at)?;
        let length;
        (rounded[axis], exact[axis], length) = number::leading_f32(&line[at..])?;
        at += length;
    }
    Some(((rounded.into(), exact.into()), at))
}

/// The colour after a position, if there is one. A single number is the weight of rational curves.
fn vertex_color(words: Words<'_>) -> Result<Option<Rgb>, Complaint> {
    let mut words = words;
    if words.clone().count() < 3 {
        return Ok(None);
    }
    let line = words.rest();
    let color = words.numbers::<3>("vertex colour")?;
    match color.iter().find(|v| **v < 0.0) {
        Some(v) => Err(line.wrong(format!("vertex colour {v} is less than 0"))),
        None => Ok(Some(Rgb::from(color).map(decode_srgb))),
    }
}
