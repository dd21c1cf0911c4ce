//! The tiles of a picture, and the order of pixels in them.

use super::Job;

/// The tiles of a job's window, in rows from the upper left.
#[derive(Clone, Copy, Debug)]
pub struct Tiles {
    window: [u32; 4],
    side: u32,
}

impl Job {
    /// The tiles of the window, whose side is [`Job::tile`].
    pub fn tiles(&self) -> Tiles {
        Tiles { window: self.window(), side: self.tile.max(1) }
    }
}

impl Tiles {
    /// The number of tiles.
    pub fn count(&self) -> usize {
        let [_, _, width, height] = self.window;
        width.div_ceil(self.side) as usize * height.div_ceil(self.side) as usize
    }

    /// The area of a tile: x and y from the picture's upper left corner, width and height, in pixels.
    pub fn area(&self, tile: usize) -> [u32; 4] {
        let ([left, top, width, height], side) = (self.window, self.side);
        let across = width.div_ceil(side) as usize;
        let [x, y] = [tile % across, tile / across].map(|i| i as u32 * side);
        [left + x, top + y, side.min(width - x), side.min(height - y)]
    }
}

/// The places of an area along a Z-shaped curve (Morton order). Neighbours in the list are close to each other in both
/// directions. Each run of 4ⁿ places that begins at a multiple of 4ⁿ fills a square, unless the area ends within it.
pub(crate) fn in_squares([width, height]: [u32; 2]) -> Vec<[u32; 2]> {
    fn square(places: &mut Vec<[u32; 2]>, [x, y]: [u32; 2], side: u32, area: [u32; 2]) {
        if x >= area[0] || y >= area[1] {
            return;
        }
        let Some(half) = (side > 1).then_some(side / 2) else { return places.push([x, y]) };
        for corner in [[x, y], [x + half, y], [x, y + half], [x + half, y + half]] {
            square(places, corner, half, area);
        }
    }
    let mut places = Vec::with_capacity((width * height) as usize);
    square(&mut places, [0, 0], width.max(height).next_power_of_two(), [width, height]);
    places
}
