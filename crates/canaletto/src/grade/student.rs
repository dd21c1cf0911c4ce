//! The picture that is graded, and its edges.

/// A picture in display values.
#[derive(Clone, Debug, PartialEq)]
pub struct StudentPicture {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// The width × height red, green and blue display values from 0 to 1, the top row first.
    pub pixels: Vec<[f32; 3]>,
    /// The difference of equal colours in steps of 8 bits: by rounding, or by a compression with losses.
    pub tolerance: f64,
}

/// The difference between neighbours in steps of 8 bits from which both are edge pixels.
const EDGE: f32 = 4.0 / 255.0;

/// As [`EDGE`], for edges that a compression with losses smears.
const SMEARED_EDGE: f32 = 16.0 / 255.0;
/// How many pixels such edges are smeared by: a JPEG halves the resolution of hues.
const SMEAR: usize = 4;
/// The largest share of smeared pixels that are left out.
const MOST_SMEARED: f64 = 0.8;

impl StudentPicture {
    /// The tolerance for pictures whose values are only rounded to 8 bits.
    pub const ROUNDED: f64 = 2.5;
    /// The tolerance for pictures that are compressed with losses, such as JPEG.
    pub const COMPRESSED: f64 = 8.0;

    /// Which pixels have a neighbour of another colour. Their colours depend on where exactly rays go.
    pub(super) fn edges(&self) -> Vec<bool> {
        self.near_edges(EDGE, 1)
    }

    /// The pixels whose colours are compared: all, or those that a compression hasn't smeared.
    pub(super) fn compared(&self) -> Vec<u32> {
        let all = 0..self.pixels.len() as u32;
        if !self.is_compressed() {
            return all.collect();
        }
        let smeared = self.near_edges(SMEARED_EDGE, SMEAR);
        let count = smeared.iter().filter(|smeared| **smeared).count();
        let keeps = count as f64 > MOST_SMEARED * smeared.len() as f64;
        all.filter(|pixel| keeps || !smeared[*pixel as usize]).collect()
    }

    /// Whether the picture was compressed with losses.
    pub(super) fn is_compressed(&self) -> bool {
        self.tolerance > StudentPicture::ROUNDED
    }

    /// Which pixels are at most `radius` columns and rows away from one that differs by more than `edge`.
    fn near_edges(&self, edge: f32, radius: usize) -> Vec<bool> {
        let (w, h) = (self.width as usize, self.height as usize);
        let differs = |a: [f32; 3], b: [f32; 3]| (0..3).any(|c| (a[c] - b[c]).abs() > edge);
        let around = |at: usize, most: usize, side: usize| at.saturating_sub(most)..(at + most + 1).min(side);
        let is_edge = |index: usize| {
            let columns = around(index % w, 1, w);
            let mut others = around(index / w, 1, h).flat_map(|y| columns.clone().map(move |x| y * w + x));
            others.any(|other| differs(self.pixels[index], self.pixels[other]))
        };
        let edges: Vec<bool> = (0..w * h).map(is_edge).collect();
        if radius == 1 {
            return edges;
        }
        let is_near = |index: usize| {
            let columns = around(index % w, radius - 1, w);
            around(index / w, radius - 1, h).any(|y| columns.clone().any(|x| edges[y * w + x]))
        };
        (0..w * h).map(is_near).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_beside_an_edge_are_found() {
        let pixel = |i: u32| if i % 8 < 4 { [0.2; 3] } else { [0.8; 3] };
        let picture = StudentPicture { width: 8, height: 3, pixels: (0..24).map(pixel).collect(), tolerance: 2.5 };
        assert_eq!(picture.edges(), [false, false, false, true, true, false, false, false].repeat(3));
    }
}
