//! Layouts: where the values of a group of attributes lie on a surface.

use super::Decoded;
use super::corners::{CornerTable, NONE, next, previous};
use super::edgebreaker::Surface;
use super::points::Points;
use super::reader::Reader;
use super::traversal::{Sequence, by_known_neighbours, depth_first};

/// How the values of a group lie on a surface.
pub(super) struct Layout {
    /// The seams that they have. None: they lie on the vertices.
    seams: Option<usize>,
    is_by_known_neighbours: bool,
}

/// The values of a group on a surface.
pub(super) struct Laid<'a> {
    table: &'a CornerTable,
    /// The point of each corner.
    of_corners: &'a [u32],
    sequence: Sequence,
    /// The value of each point.
    pub(super) of_points: Vec<u32>,
}

impl Layout {
    pub(super) fn read(stream: &mut Reader, surface: &Surface) -> Decoded<Layout> {
        let (seams, lies_on, walk) = (stream.byte()? as i8, stream.byte()?, stream.byte()?);
        let seams = usize::try_from(seams).ok();
        if seams.is_some_and(|number| number >= surface.seams.len()) {
            return Err("an attribute has seams that aren't there".into());
        }
        match (lies_on, walk) {
            (0, 0 | 1) => Ok(Layout { seams: None, is_by_known_neighbours: walk == 1 }),
            (1, 0) if seams.is_some() => Ok(Layout { seams, is_by_known_neighbours: false }),
            _ => Err("the order of an attribute's values is unknown".into()),
        }
    }

    /// Lays values on a surface.
    pub(super) fn lay<'a>(&self, surface: &'a Surface, points: &'a Points) -> Decoded<Laid<'a>> {
        let own = self.seams.and_then(|number| surface.seams[number].table.as_ref());
        let table = own.unwrap_or(&surface.table);
        let sequence = if self.is_by_known_neighbours { by_known_neighbours(table) } else { depth_first(table) };
        let mut of_points = vec![NONE; points.count];
        for (point, vertex) in points.of_corners.iter().zip(&table.vertices) {
            of_points[*point as usize] = sequence.values[*vertex as usize];
        }
        match of_points.contains(&NONE) {
            false => Ok(Laid { table, of_corners: &points.of_corners, sequence, of_points }),
            true => Err("a point has no value".into()),
        }
    }
}

impl Laid<'_> {
    /// The number of values.
    pub(super) fn len(&self) -> usize {
        self.sequence.corners.len()
    }

    /// The values in their order, each with the corner at which its vertex is met first.
    pub(super) fn values(&self) -> impl Iterator<Item = (u32, u32)> {
        (0..).zip(self.sequence.corners.iter().copied())
    }

    /// The point at which each value is met first.
    pub(super) fn points(&self) -> impl Iterator<Item = u32> {
        self.sequence.corners.iter().map(|corner| self.of_corners[*corner as usize])
    }

    /// The corners around a corner's vertex, up to seams.
    pub(super) fn fan(&self, corner: u32) -> impl Iterator<Item = u32> {
        self.table.fan(corner)
    }

    /// The values at the corners of a triangle, from this corner on.
    pub(super) fn triangle(&self, corner: u32) -> [u32; 3] {
        [corner, next(corner), previous(corner)].map(|c| self.sequence.values[self.table.vertex(c) as usize])
    }

    /// The values of the triangle across the edge of a corner, from the opposite one on.
    pub(super) fn triangle_across(&self, corner: u32) -> Option<[u32; 3]> {
        Some(self.table.opposite(corner)).filter(|across| *across != NONE).map(|across| self.triangle(across))
    }
}
