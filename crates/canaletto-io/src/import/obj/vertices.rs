//! The first pass over an OBJ file: its vertices and the names of its material files.

use super::super::color::{ROUNDED, Scale};
use super::super::concat::concat;
use super::super::ignored::Ignored;
use super::super::lines::{ImportError, Lines, Token, Tokens, gap};
use super::super::number;
use super::super::positions::{Bounds, Positions};
use super::super::text::{Piece, Text};
use super::faces::NONE;
use super::keyword::Keyword;
use canaletto::math::Rgb;
use canaletto::texture::srgb_decode;
use canaletto_parallel::prelude::*;
use glam::{DVec3, Vec2, Vec3};

/// The vertex lists of a file.
#[derive(Default)]
pub(super) struct Vertices {
    /// The origin of the positions.
    pub(super) origin: DVec3,
    pub(super) positions: Vec<Vec3>,
    /// The sorted indices of positions that aren't finite. They are replaced by an arbitrary finite position, and no
    /// face uses them.
    pub(super) non_finite: Vec<u32>,
    /// The vertex colours: empty, or one for each position.
    pub(super) colors: Vec<Rgb>,
    /// Texture coordinates with v from the top row of an image, as elsewhere in Canaletto; the file has v from the
    /// bottom.
    pub(super) uvs: Vec<Vec2>,
    /// The normals; those that aren't finite are zero.
    pub(super) normals: Vec<Vec3>,
}

impl Vertices {
    /// The diagonal of the box around all positions.
    pub(super) fn size(&self) -> f32 {
        if self.positions.is_empty() { 0.0 } else { Bounds::of(&self.positions).diagonal() }
    }

    /// Whether this position isn't finite.
    pub(super) fn is_nowhere(&self, position: u32) -> bool {
        !self.non_finite.is_empty() && self.non_finite.binary_search(&position).is_ok()
    }
}

/// The results of the first pass.
pub(super) struct First {
    pub(super) vertices: Vertices,
    /// The offset and text of each `mtllib` line.
    pub(super) libraries: Vec<(usize, Vec<u8>)>,
    /// The numbers of positions, texture coordinates and normals before each piece.
    pub(super) before: Vec<[usize; 3]>,
    /// The pieces that contain more than vertices.
    pub(super) others: Vec<usize>,
    pub(super) ignored: Ignored,
    /// The assumption about colours with numbers above 1.
    pub(super) assumed: Option<String>,
}

/// The contents of a piece.
#[derive(Default)]
struct Found {
    positions: Positions,
    vertices: Vertices,
    libraries: Vec<(usize, Vec<u8>)>,
    others: bool,
    ignored: Ignored,
}

/// Reads all vertices.
pub(super) fn read(text: Text<'_>) -> Result<First, ImportError> {
    let all: Vec<usize> = (0..text.len()).collect();
    let mut first = First {
        vertices: Vertices::default(),
        libraries: Vec::new(),
        before: Vec::new(),
        others: Vec::new(),
        ignored: Ignored::default(),
        assumed: None,
    };
    let (mut positions, mut uvs, mut normals) = (Vec::new(), Vec::new(), Vec::new());
    let (mut colors, mut non_finite): (Vec<Rgb>, Vec<u32>) = Default::default();
    let mut count = [0; 3];
    text.each(
        &all,
        |_, piece| find(piece),
        |index, found| {
            let Found { positions: some, vertices, libraries, others, ignored } = found?;
            first.ignored.append(ignored);
            if !vertices.colors.is_empty() {
                colors.resize(count[0], NO_COLOR);
                colors.extend(vertices.colors);
            }
            first.before.push(count);
            non_finite.extend(vertices.non_finite.iter().map(|i| (count[0] as u32).wrapping_add(*i)));
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
        colors.resize(count[0], NO_COLOR);
        first.assumed = decode(&mut colors);
    }
    if count.iter().any(|n| *n >= NONE as usize) {
        return Err(ImportError::file("it has more vertices than 32 bits can count"));
    }
    let (origin, mut positions) = Positions::rebase_all(positions);
    if !non_finite.is_empty() {
        let anywhere = positions.iter().copied().find(|p| p.is_finite()).unwrap_or_default();
        non_finite.iter().for_each(|i| positions[*i as usize] = anywhere);
    }
    first.vertices = Vertices { origin, positions, non_finite, colors, uvs: concat(uvs), normals: concat(normals) };
    Ok(first)
}

/// A vertex without a colour among others with one.
const NO_COLOR: Rgb = Rgb::new(f32::NAN, f32::NAN, f32::NAN);

/// Decodes sRGB at the detected scale; vertices without a colour become white. Returns the assumption that was made.
fn decode(colors: &mut Vec<Rgb>) -> Option<String> {
    let largest = colors.par_iter().map(|c| c.max_component()).reduce(|| 0.0, f32::max);
    let fraction = colors.par_iter().any(|c| c.to_array().iter().any(|v| v.is_finite() && v.fract() != 0.0));
    let Some(scale) = Scale::of(largest, fraction) else {
        colors.clear();
        return Some(format!("vertex colours go up to {largest}, which is no colour, and are left out"));
    };
    colors.par_iter_mut().for_each(|c| {
        *c = if c.r.is_nan() { Rgb::WHITE } else { c.map(|value| srgb_decode(value / scale.most())) };
    });
    match scale {
        Scale::One if largest <= ROUNDED => None,
        Scale::One => Some(format!("vertex colours go up to {largest}: they are taken as they are, with 1 as white")),
        _ => Some(format!("vertex colours go up to {largest}: they are read as shares of {}", scale.most())),
    }
}

fn find(piece: Piece<'_>) -> Result<Found, ImportError> {
    let mut found = Found { ignored: Ignored::of_part(), ..Found::default() };
    // Face lines contain none of these letters.
    let without = |a, b| memchr::memchr2(a, b, piece.bytes).is_none();
    if without(b'v', b'm') && without(b'V', b'M') {
        return Ok(Found { others: true, ..found });
    }
    let Found { positions, vertices: out, libraries, others, ignored } = &mut found;
    let mut lines = Lines::of_piece(piece).joined();
    loop {
        while let Some((rounded, exact)) = lines.easy(plain_position) {
            positions.push(rounded, exact);
        }
        let Some(line) = lines.next() else { break };
        let Some((keyword, word, words)) = Keyword::of(line) else { continue };
        match keyword {
            Keyword::Position => {
                let mut words = words.before_comment();
                let (rounded, exact) = words.position("vertex")?;
                if rounded.is_finite() {
                    positions.push(rounded, exact);
                } else {
                    ignored.note(&word, "has no finite place, and faces that use it are left out");
                    out.non_finite.push(positions.len() as u32);
                    positions.push_non_finite();
                }
                if let Some(color) = vertex_color(&word, words, ignored)? {
                    out.colors.resize(positions.len() - 1, NO_COLOR);
                    out.colors.push(color);
                }
            }
            Keyword::TexCoord => {
                let mut words = words.before_comment();
                let [u] = words.any_numbers("texture coordinate")?;
                let v = words.next().map_or(Ok(0.0), |w| w.any_number())?;
                let uv = Vec2::new(u, 1.0 - v);
                if !uv.is_finite() {
                    ignored.note(&word, "isn't finite and counts as 0 0");
                }
                out.uvs.push(if uv.is_finite() { uv } else { Vec2::ZERO });
            }
            Keyword::Normal => {
                let normal = Vec3::from(words.before_comment().any_numbers::<3>("normal")?);
                if !normal.is_finite() {
                    ignored.note(&word, "isn't finite; normals there are computed");
                }
                out.normals.push(if normal.is_finite() { normal } else { Vec3::ZERO });
            }
            Keyword::Library => {
                let names = words.rest();
                libraries.push((names.span().start, names.text.to_owned()));
            }
            _ => *others = true,
        }
    }
    found.positions = found.positions.part();
    Ok(found)
}

/// The position of a line of `v` and three numbers of the fast path, as most lines are, with the line's length.
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

/// The colour after a position as written, if there is one. A single number is the weight of rational curves.
fn vertex_color(word: &Token<'_>, mut words: Tokens<'_>, ignored: &mut Ignored) -> Result<Option<Rgb>, ImportError> {
    if words.clone().count() < 3 {
        return Ok(None);
    }
    let color = Rgb::from(words.any_numbers::<3>("vertex colour")?);
    if !color.is_finite() {
        ignored.note(word, "has a colour that isn't finite and counts as white");
        return Ok(Some(NO_COLOR));
    }
    if color.to_array().iter().any(|value| *value < 0.0) {
        ignored.note(word, "has a colour with numbers below 0, which count as 0");
    }
    Ok(Some(color.map(|value| value.max(0.0))))
}
