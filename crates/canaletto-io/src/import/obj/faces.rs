//! The second pass over an OBJ file: the faces of a piece, and the lines that group them.

use super::super::ignored::Ignored;
use super::super::lines::{ImportError, Lines, Token, gap};
use super::super::number;
use super::super::polygon::Triangulator;
use super::super::text::Piece;
use super::keyword::Keyword;
use super::vertices::Vertices;
use glam::Vec3;

/// The index of absent texture coordinates, normals or materials.
pub(super) const NONE: u32 = u32::MAX;

/// Indices into the lists of [`Vertices`]: position, texture coordinates, normal. The last two may be [`NONE`].
pub(super) type Corner = [u32; 3];

/// The contents of a piece.
pub(super) struct Faces {
    pub(super) triangles: Triangles,
    /// The lines that assign the following faces, each with the number of triangles before it.
    pub(super) marks: Vec<(usize, Mark)>,
    pub(super) ignored: Ignored,
}

/// An object, group, material or smoothing group of faces.
pub(super) enum Mark {
    Object(String),
    Group(String),
    /// The offset of the name in the file, and the name.
    Material(usize, Vec<u8>),
    /// The smoothing group; 0 is none.
    Smoothing(u32),
}

/// Triangles in the most compact form for their corners.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Triangles {
    /// Texture coordinates and normals of a corner have the index of its position, or are absent.
    Plain(Pattern, Vec<[u32; 3]>),
    Full(Vec<[Corner; 3]>),
}

/// Whether there are texture coordinates, and whether there are normals.
pub(super) type Pattern = [bool; 2];

fn pattern(corner: Corner) -> Option<Pattern> {
    let [position, others @ ..] = corner;
    let fits = others.iter().all(|number| *number == NONE || *number == position);
    fits.then(|| others.map(|number| number != NONE))
}

/// The corner of a position index.
pub(super) fn full(pattern: Pattern, position: u32) -> Corner {
    let [uv, normal] = pattern.map(|there| if there { position } else { NONE });
    [position, uv, normal]
}

impl Triangles {
    pub(super) fn len(&self) -> usize {
        match self {
            Triangles::Plain(_, list) => list.len(),
            Triangles::Full(list) => list.len(),
        }
    }

    /// The corners of a triangle.
    pub(super) fn corners(&self, triangle: usize) -> [Corner; 3] {
        match self {
            Triangles::Plain(pattern, list) => list[triangle].map(|position| full(*pattern, position)),
            Triangles::Full(list) => list[triangle],
        }
    }

    fn push(&mut self, triangle: [Corner; 3]) {
        let patterns = triangle.map(pattern);
        if let Triangles::Plain(known, list) = self {
            if list.is_empty()
                && let Some(first) = patterns[0]
            {
                *known = first;
            }
            if patterns.iter().all(|pattern| *pattern == Some(*known)) {
                return list.push(triangle.map(|corner| corner[0]));
            }
            *self = Triangles::Full((0..list.len()).map(|i| self.corners(i)).collect());
        }
        if let Triangles::Full(list) = self {
            list.push(triangle);
        }
    }

    fn shrink(&mut self) {
        match self {
            Triangles::Plain(_, list) => list.shrink_to_fit(),
            Triangles::Full(list) => list.shrink_to_fit(),
        }
    }
}

/// Reads a piece; `before` has the numbers of positions, texture coordinates and normals before it.
pub(super) fn read(piece: Piece<'_>, before: [usize; 3], vertices: &Vertices) -> Result<Faces, ImportError> {
    let triangles = Triangles::Plain([false; 2], Vec::new());
    let mut out = Faces { triangles, marks: Vec::new(), ignored: Ignored::of_part() };
    let mut seen = before;
    let mut smoothing = None;
    let mut polygon = Polygon::default();
    let positions = vertices.positions.len();
    let mut lines = Lines::of_piece(piece).joined();
    loop {
        if vertices.non_finite.is_empty()
            && let Triangles::Plain([false, false], list) = &mut out.triangles
        {
            while let Some(triangle) = lines.easy(|line| plain_triangle(line, positions)) {
                list.push(triangle);
            }
        }
        let Some(line) = lines.next() else { break };
        let Some((keyword, word, mut words)) = Keyword::of(line) else { continue };
        match keyword {
            Keyword::Position => seen[0] += 1,
            Keyword::TexCoord => seen[1] += 1,
            Keyword::Normal => seen[2] += 1,
            Keyword::Face => {
                polygon.read(line, words.before_comment(), seen, vertices, &mut out.ignored)?;
                if polygon.corners.len() < 3 {
                    out.ignored.note(&word, "with fewer than 3 corners is left out");
                } else if polygon.corners.iter().any(|corner| vertices.is_nowhere(corner[0])) {
                    out.ignored.note(&word, "uses a vertex without a finite place and is left out");
                } else {
                    polygon.cut(&mut out.triangles).map_err(|message| line.wrong(message))?;
                }
            }
            Keyword::Object => out.mark(Mark::Object(words.rest().string())),
            Keyword::Group => out.mark(Mark::Group(words.rest().string())),
            Keyword::Material => {
                let name = words.rest();
                out.mark(Mark::Material(name.span().start, name.text.to_owned()));
            }
            Keyword::Smoothing => {
                let group = words.next().map_or(Some(0), |w| smoothing_group(w.text));
                if group.is_none() {
                    out.ignored.note(&word, "names no group of smooth faces: a whole number, or off; it counts as off");
                }
                if smoothing != group {
                    smoothing = group;
                    out.mark(Mark::Smoothing(group.unwrap_or(0)));
                }
            }
            Keyword::Thin => out.ignored.note(&word, "is left out: lines and points have no area"),
            Keyword::Library | Keyword::Comment => {}
            Keyword::Other => out.ignored.note(&word, "is left out"),
        }
    }
    out.triangles.shrink();
    Ok(out)
}

impl Faces {
    fn mark(&mut self, mark: Mark) {
        self.marks.push((self.triangles.len(), mark));
    }
}

fn smoothing_group(text: &[u8]) -> Option<u32> {
    match text.to_ascii_lowercase().as_slice() {
        b"off" | b"null" => Some(0),
        b"on" => Some(u32::MAX),
        text => std::str::from_utf8(text).ok()?.parse().ok(),
    }
}

/// The triangle of a line of `f` and three positive indices of existing positions, as most lines are, with the line's
/// length.
#[inline]
fn plain_triangle(line: &[u8], positions: usize) -> Option<([u32; 3], usize)> {
    let mut at = usize::from(*line.first()? == b'f');
    let mut numbers = [0; 3];
    for number in &mut numbers {
        at = gap(line, at)?;
        let (start, mut value) = (at, 0u64);
        while let Some(digit) = number::digit(line, at) {
            value = value.wrapping_mul(10).wrapping_add(u64::from(digit));
            at += 1;
        }
        // No index of a position has more digits, and 18 digits don't overflow.
        if at - start > 18 || value == 0 || value > positions as u64 {
            return None;
        }
        *number = value as u32 - 1;
    }
    Some((numbers, at))
}

/// The corners of a face; its memory is reused.
#[derive(Default)]
struct Polygon {
    corners: Vec<Corner>,
    points: Vec<Vec3>,
    triangulator: Triangulator,
}

impl Polygon {
    /// Reads the corners. `seen` has the numbers of vertices so far, for negative indices.
    fn read<'a>(
        &mut self,
        line: Token<'a>,
        words: impl Iterator<Item = Token<'a>>,
        seen: [usize; 3],
        vertices: &Vertices,
        ignored: &mut Ignored,
    ) -> Result<(), ImportError> {
        self.corners.clear();
        self.points.clear();
        let exist = [vertices.positions.len(), vertices.uvs.len(), vertices.normals.len()];
        for word in words {
            let corner = corner(&word, seen, exist, ignored)?;
            self.points.push(vertices.positions[corner[0] as usize]);
            self.corners.push(corner);
        }
        if self.corners.len() >= NONE as usize {
            return Err(line.wrong("this face has too many corners"));
        }
        Ok(())
    }

    fn cut(&mut self, into: &mut Triangles) -> Result<(), String> {
        let corners = &self.corners;
        self.triangulator.cut(&self.points, |t| into.push(t.map(|i| corners[i])))
    }
}

/// Parses `v`, `v/vt`, `v//vn` or `v/vt/vn`, counted from 1, or backwards from the latest if negative. Texture
/// coordinates and normals that don't exist, as in some subdivision models, are ignored; a position must exist.
fn corner(word: &Token<'_>, seen: [usize; 3], exist: [usize; 3], ignored: &mut Ignored) -> Result<Corner, ImportError> {
    let mut out = [NONE; 3];
    for (which, piece) in word.text.split(|b| *b == b'/').enumerate() {
        if which > 0 && piece.is_empty() {
            continue;
        }
        let form = || {
            let message =
                format!("\"{}\" is not a corner: v, v/vt, v//vn or v/vt/vn, each a whole number", word.shown());
            word.wrong(message)
        };
        if which >= 3 {
            return Err(form());
        }
        let index = integer(piece).ok_or_else(form)?;
        let resolved = if index > 0 { index - 1 } else { seen[which] as i64 + index };
        if index != 0 && (0..exist[which] as i64).contains(&resolved) {
            out[which] = resolved as u32;
            continue;
        }
        let face = Token { start: word.start, text: b"f" };
        match (which, index) {
            (1, _) => ignored.note(&face, "refers to texture coordinates that don't exist"),
            (2, _) => ignored.note(&face, "refers to normals that don't exist; they are computed"),
            (_, 0) => return Err(word.wrong("face refers to vertex 0, but they are counted from 1")),
            (_, 1..) => {
                return Err(word.wrong(format!("face refers to vertex {index}, but only {} exist", exist[0])));
            }
            _ => {
                return Err(word.wrong(format!("face refers to vertex {index}, but only {} come before it", seen[0])));
            }
        }
    }
    Ok(out)
}

fn integer(text: &[u8]) -> Option<i64> {
    let (negative, digits) = match text {
        [b'-', rest @ ..] => (true, rest),
        [b'+', rest @ ..] => (false, rest),
        _ => (false, text),
    };
    if digits.is_empty() || digits.len() > 18 {
        return None;
    }
    let value = digits.iter().try_fold(0i64, |sum, d| d.is_ascii_digit().then(|| sum * 10 + i64::from(d - b'0')))?;
    Some(if negative { -value } else { value })
}
