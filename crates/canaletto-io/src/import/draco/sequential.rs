//! Connectivity as a list of the corners' points.

use super::entropy::symbols;
use super::reader::Reader;
use super::{Budget, Decoded};

/// Triangles and the number of points.
pub(super) struct List {
    pub(super) triangles: Vec<[u32; 3]>,
    pub(super) points: usize,
}

pub(super) fn list(stream: &mut Reader, budget: &mut Budget) -> Decoded<List> {
    let (triangles, points) = (stream.number()?, stream.number()?);
    budget.triangles(triangles, 1)?;
    let count = 3 * triangles as usize;
    let corners = match stream.byte()? {
        0 => from_differences(symbols(stream, count, 1)?),
        1 => plain(stream, count, points)?,
        _ => return Err("their triangles have an unknown coding".into()),
    };
    if let Some(point) = corners.iter().find(|point| **point >= points) {
        return Err(format!("a triangle is at point {point}, but there are {points}").into());
    }
    let triangles = corners.as_chunks().0.to_vec();
    Ok(List { triangles, points: points as usize })
}

/// Each corner as the difference from the one before it, whose sign is the lowest bit.
fn from_differences(mut symbols: Vec<u32>) -> Vec<u32> {
    let mut last = 0u32;
    for symbol in &mut symbols {
        let size = *symbol >> 1;
        last = if *symbol & 1 == 1 { last.wrapping_sub(size) } else { last.wrapping_add(size) };
        *symbol = last;
    }
    symbols
}

/// Numbers as wide as the count of points asks for.
fn plain(stream: &mut Reader, count: usize, points: u32) -> Decoded<Vec<u32>> {
    Ok(match points {
        0..0x100 => stream.take(count)?.iter().map(|byte| (*byte).into()).collect(),
        0x100..0x1_0000 => {
            stream.take(2 * count)?.as_chunks().0.iter().map(|b| u16::from_le_bytes(*b).into()).collect()
        }
        0x1_0000..0x20_0000 => (0..count).map(|_| stream.number()).collect::<Decoded<_>>()?,
        0x20_0000.. => stream.take(4 * count)?.as_chunks().0.iter().map(|b| u32::from_le_bytes(*b)).collect(),
    })
}
