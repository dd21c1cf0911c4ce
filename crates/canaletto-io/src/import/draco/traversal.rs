//! The order of an attribute's values: that in which a walk over the surface first meets their vertices.

use super::corners::{CornerTable, NONE, next, previous};

/// The values of an attribute on a surface.
pub(super) struct Sequence {
    /// The corner at which each value's vertex is met first.
    pub(super) corners: Vec<u32>,
    /// The value of each vertex, or [`NONE`] for a vertex without corners.
    pub(super) values: Vec<u32>,
}

/// A walk.
struct Walk<'a> {
    table: &'a CornerTable,
    met: Sequence,
    /// The triangles that were passed.
    passed: Vec<bool>,
}

/// The walk that goes as deep as it can, to the right first.
pub(super) fn depth_first(table: &CornerTable) -> Sequence {
    let mut walk = Walk::new(table);
    let mut stack = Vec::new();
    for start in (0..table.vertices.len() as u32).step_by(3) {
        if !walk.is_passed(start) {
            walk.meet(next(start));
            walk.meet(previous(start));
            stack.push(start);
        }
        while let Some(corner) = stack.pop() {
            if !walk.is_passed(corner) {
                let [right, left] = walk.pass(corner);
                stack.extend([left, right].into_iter().filter(|corner| !walk.is_passed(*corner)));
            }
        }
    }
    walk.met
}

/// The walk that prefers triangles of which most is known (Cohen-Or, Cohen and Irony, 2002).
pub(super) fn by_known_neighbours(table: &CornerTable) -> Sequence {
    let mut walk = Walk::new(table);
    // The corners to go to: of those whose vertex is met, is beside two passed triangles, and beside one.
    let mut stacks: [Vec<u32>; 3] = Default::default();
    // How often a triangle beside each vertex was seen.
    let mut seen = vec![0u32; table.firsts.len()];
    for start in (0..table.vertices.len() as u32).step_by(3) {
        if !walk.is_passed(start) {
            [next(start), previous(start), start].into_iter().for_each(|corner| walk.meet(corner));
            stacks[0].push(start);
        }
        while let Some(corner) = stacks.iter_mut().find_map(Vec::pop) {
            if walk.is_passed(corner) {
                continue;
            }
            let [right, left] = walk.pass(corner);
            for corner in [left, right].into_iter().filter(|corner| !walk.is_passed(*corner)) {
                let seen = &mut seen[table.vertex(corner) as usize];
                let stack = match walk.is_met(corner) {
                    true => 0,
                    false if *seen > 0 => 1,
                    false => 2,
                };
                *seen += 1;
                stacks[stack].push(corner);
            }
        }
    }
    walk.met
}

impl<'a> Walk<'a> {
    fn new(table: &'a CornerTable) -> Walk<'a> {
        let values = vec![NONE; table.firsts.len()];
        let met = Sequence { corners: Vec::with_capacity(values.len()), values };
        Walk { table, met, passed: vec![false; table.vertices.len() / 3] }
    }

    /// Whether a triangle was passed, or is beyond a border.
    fn is_passed(&self, corner: u32) -> bool {
        corner == NONE || self.passed[corner as usize / 3]
    }

    fn is_met(&self, corner: u32) -> bool {
        self.met.values[self.table.vertex(corner) as usize] != NONE
    }

    /// Gives the vertex of a corner the next value, unless it has one.
    fn meet(&mut self, corner: u32) {
        let value = &mut self.met.values[self.table.vertex(corner) as usize];
        if *value == NONE {
            *value = self.met.corners.len() as u32;
            self.met.corners.push(corner);
        }
    }

    /// Passes a triangle, of which a corner's vertex may be new. Returns the corners across the edges beside it.
    fn pass(&mut self, corner: u32) -> [u32; 2] {
        self.passed[corner as usize / 3] = true;
        self.meet(corner);
        [next(corner), previous(corner)].map(|beside| self.table.opposite(beside))
    }
}
