//! Points: the corners of a vertex between two seams of any attribute are one.

use super::Decoded;
use super::corners::{CornerTable, NONE};
use super::edgebreaker::Surface;

/// The points of corners.
pub(super) struct Points {
    /// The point of each corner.
    pub(super) of_corners: Vec<u32>,
    pub(super) count: usize,
}

/// Numbers the points in the order of the vertices, around each of them clockwise.
pub(super) fn number(surface: &Surface) -> Decoded<Points> {
    let table = &surface.table;
    if surface.seams.is_empty() {
        return Ok(Points { of_corners: table.vertices.clone(), count: surface.vertices });
    }
    let mut of_corners = vec![NONE; table.vertices.len()];
    let mut count = 0;
    for vertex in 0..table.firsts.len() as u32 {
        if table.first(vertex) == NONE {
            continue;
        }
        let first = first_corner(surface, vertex);
        for corner in table.clockwise(first) {
            count += u32::from(corner == first || is_seam_before(surface, corner));
            of_corners[corner as usize] = count - 1;
        }
    }
    match of_corners.contains(&NONE) {
        false => Ok(Points { of_corners, count: count as usize }),
        true => Err("a corner belongs to no vertex".into()),
    }
}

/// The corner after the border of a vertex, or after the first seam around it of the first attribute that has some.
fn first_corner(surface: &Surface, vertex: u32) -> u32 {
    let first = surface.table.first(vertex);
    if surface.table.left(first) == NONE {
        return first;
    }
    let seams = surface.seams.iter().filter(|seams| seams.is_cut.get(vertex as usize) == Some(&true));
    let after = |table: &CornerTable| {
        surface.table.clockwise(first).find(|corner| table.vertex(*corner) != table.vertex(first))
    };
    seams.filter_map(|seams| after(seams.table.as_ref()?)).next().unwrap_or(first)
}

/// Whether an attribute has other values at a corner than at the one before it, counterclockwise.
fn is_seam_before(surface: &Surface, corner: u32) -> bool {
    let before = surface.table.left(corner);
    let mut tables = surface.seams.iter().filter_map(|seams| seams.table.as_ref());
    before == NONE || tables.any(|table| table.vertex(corner) != table.vertex(before))
}
