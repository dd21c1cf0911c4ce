//! Corner tables (Rossignac, Safonova and Szymczak, 2001): the triangles of a surface by their corners.
//!
//! Corner 3 t + k is that of triangle t. The edges of a triangle are named by the corners opposite to them.

/// No corner, vertex or value.
pub(super) const NONE: u32 = u32::MAX;

/// The next corner of a triangle, counterclockwise.
pub(super) fn next(corner: u32) -> u32 {
    if corner % 3 == 2 { corner - 2 } else { corner + 1 }
}

/// The corner of a triangle before another one.
pub(super) fn previous(corner: u32) -> u32 {
    if corner.is_multiple_of(3) { corner + 2 } else { corner - 1 }
}

/// A surface. The corners of a vertex are one fan, which is open or closed.
#[derive(Default)]
pub(super) struct CornerTable {
    /// For each corner the corner on the other side of its edge, or [`NONE`] on a border.
    pub(super) opposites: Vec<u32>,
    /// The vertex of each corner.
    pub(super) vertices: Vec<u32>,
    /// The first corner of each vertex, clockwise: of an open fan that at the border. [`NONE`] if it has no corners.
    pub(super) firsts: Vec<u32>,
}

impl CornerTable {
    pub(super) fn opposite(&self, corner: u32) -> u32 {
        self.opposites[corner as usize]
    }

    pub(super) fn vertex(&self, corner: u32) -> u32 {
        self.vertices[corner as usize]
    }

    pub(super) fn first(&self, vertex: u32) -> u32 {
        self.firsts[vertex as usize]
    }

    /// The next corner of the same vertex, counterclockwise, or [`NONE`].
    pub(super) fn left(&self, corner: u32) -> u32 {
        match self.opposite(next(corner)) {
            NONE => NONE,
            across => next(across),
        }
    }

    /// The next corner of the same vertex, clockwise, or [`NONE`].
    pub(super) fn right(&self, corner: u32) -> u32 {
        match self.opposite(previous(corner)) {
            NONE => NONE,
            across => previous(across),
        }
    }

    /// The corners of a corner's vertex, once each: to the left up to the border, then to the right.
    pub(super) fn fan(&self, start: u32) -> Fan<'_> {
        Fan { table: self, start, at: start, is_leftward: true }
    }

    /// The corners of a vertex from its first one on, clockwise.
    pub(super) fn clockwise(&self, first: u32) -> impl Iterator<Item = u32> {
        let after = move |corner: &u32| Some(self.right(*corner)).filter(|right| *right != NONE && *right != first);
        std::iter::successors(Some(first), after)
    }
}

/// See [`CornerTable::fan`].
pub(super) struct Fan<'a> {
    table: &'a CornerTable,
    start: u32,
    at: u32,
    is_leftward: bool,
}

impl Iterator for Fan<'_> {
    type Item = u32;

    fn next(&mut self) -> Option<u32> {
        let corner = self.at;
        if corner == NONE {
            return None;
        }
        self.at = if self.is_leftward { self.table.left(corner) } else { self.table.right(corner) };
        if self.at == self.start {
            self.at = NONE;
        } else if self.at == NONE && self.is_leftward {
            self.is_leftward = false;
            self.at = self.table.right(self.start);
        }
        Some(corner)
    }
}
