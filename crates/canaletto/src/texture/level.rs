//! One resolution of an image, with its texels in tiles of 8 × 8. Neighbours in both directions are near each other in
//! memory.
//!
//! Tiles are in the order of rows. At the right and lower border they are narrower and lower, so that the tiled form
//! has as many numbers as the rows. Every eight rows can thus be tiled in place.

use super::Samples;
use canaletto_parallel::prelude::*;

/// The number of texels in a side of a tile.
pub(super) const TILE: u32 = 8;

/// One resolution of an image.
#[derive(Debug)]
pub(super) struct Level {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) samples: Samples,
}

impl Level {
    /// A level from rows of texels.
    pub(super) fn from_rows(width: u32, height: u32, channels: usize, mut samples: Samples) -> Level {
        match &mut samples {
            Samples::U8(data) => tile(data, width, channels),
            Samples::U16(data) | Samples::F16(data) => tile(data, width, channels),
            Samples::F32(data) => tile(data, width, channels),
        }
        Level { width, height, samples }
    }

    /// The position of a texel; its numbers start at `channels` times that.
    #[inline]
    pub(super) fn index(&self, x: u32, y: u32) -> u32 {
        index(self.width, self.height, x, y)
    }
}

/// The position of a texel in a level of this size.
#[inline]
pub(super) fn index(width: u32, height: u32, x: u32, y: u32) -> u32 {
    let (left, top) = (x & !(TILE - 1), y & !(TILE - 1));
    let across = TILE.min(width - left);
    let down = TILE.min(height - top);
    top * width + left * down + (y - top) * across + (x - left)
}

/// Converts rows to tiles in place, eight rows at a time, with a buffer of eight rows.
fn tile<T: Copy + Send + Sync>(data: &mut [T], width: u32, channels: usize) {
    let row = width as usize * channels;
    data.par_chunks_mut(row * TILE as usize).for_each_init(Vec::new, |rows, band| {
        rows.clear();
        rows.extend_from_slice(band);
        let height = (band.len() / row) as u32;
        for y in 0..height {
            for left in (0..width).step_by(TILE as usize) {
                let count = TILE.min(width - left) as usize * channels;
                let from = y as usize * row + left as usize * channels;
                let to = index(width, height, left, y) as usize * channels;
                band[to..to + count].copy_from_slice(&rows[from..from + count]);
            }
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_texel_has_a_place_of_its_own() {
        for (width, height) in [(1, 1), (8, 8), (9, 7), (23, 17), (7, 64), (64, 9)] {
            let rows: Vec<u16> = (0..width * height * 3).map(|i| i as u16).collect();
            let level = Level::from_rows(width, height, 3, Samples::U16(rows.clone()));
            let Samples::U16(tiled) = &level.samples else { panic!() };
            let mut seen = vec![false; (width * height) as usize];
            for y in 0..height {
                for x in 0..width {
                    let at = level.index(x, y) as usize;
                    assert!(!std::mem::replace(&mut seen[at], true));
                    let from = ((y * width + x) * 3) as usize;
                    assert_eq!(tiled[at * 3..at * 3 + 3], rows[from..from + 3], "{width} × {height}: {x}, {y}");
                }
            }
        }
    }
}
