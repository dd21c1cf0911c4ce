//! Seams: edges across which an attribute has other values. They cut the fans of vertices into those of values.

use super::Decoded;
use super::corners::{CornerTable, NONE, next, previous};
use super::entropy::BitDecoder;

/// The surface as an attribute sees it.
pub(super) struct Seams {
    /// The corner table with borders for seams; none if there are no seams, so that it would be that of the surface.
    pub(super) table: Option<CornerTable>,
    /// Whether each vertex of the surface is at the end of a seam.
    pub(super) is_cut: Vec<bool>,
}

/// Reads which edges of a surface are seams.
pub(super) fn read_seams(surface: &CornerTable, mut bits: BitDecoder) -> Decoded<Seams> {
    let mut opposites = surface.opposites.clone();
    let mut is_cut = Vec::new();
    for (corner, &across) in (0u32..).zip(&surface.opposites) {
        // The triangle with the lower number tells.
        if across == NONE || across < corner || !bits.next()? {
            continue;
        }
        is_cut.resize(surface.firsts.len(), false);
        for side in [corner, across] {
            opposites[side as usize] = NONE;
        }
        for end in [next(corner), previous(corner)] {
            is_cut[surface.vertex(end) as usize] = true;
        }
    }
    if is_cut.is_empty() {
        return Ok(Seams { table: None, is_cut });
    }
    let table = cut(surface, opposites, &is_cut)?;
    Ok(Seams { table: Some(table), is_cut })
}

/// The table of a surface with these opposite corners. Its vertices are numbered in the order of the surface's.
fn cut(surface: &CornerTable, opposites: Vec<u32>, is_cut: &[bool]) -> Decoded<CornerTable> {
    let mut table = CornerTable { opposites, vertices: vec![NONE; surface.vertices.len()], firsts: Vec::new() };
    for (&start, is_cut) in surface.firsts.iter().zip(is_cut).filter(|(first, _)| **first != NONE) {
        let first = if *is_cut { leftmost(&table, start)? } else { start };
        table.firsts.push(first);
        for corner in surface.clockwise(first) {
            if corner != first && table.opposite(next(corner)) == NONE {
                table.firsts.push(corner);
            }
            table.vertices[corner as usize] = table.firsts.len() as u32 - 1;
        }
    }
    match table.vertices.contains(&NONE) {
        false => Ok(table),
        true => Err("a corner belongs to no vertex".into()),
    }
}

/// The corner at the left border of a fan that is cut.
fn leftmost(table: &CornerTable, start: u32) -> Decoded<u32> {
    let mut corner = start;
    loop {
        match table.left(corner) {
            NONE => return Ok(corner),
            left if left == start => return Err("a seam ends nowhere".into()),
            left => corner = left,
        }
    }
}
