//! The place of the unit square on an image, and the continuation outside of it.

use crate::named;
use serde::{Deserialize, Serialize};

/// The continuation outside the unit square.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Wrap {
    /// The image is repeated.
    #[default]
    Repeat,
    /// The image is repeated, and every other copy is mirrored.
    Mirror,
    /// The texels at the border continue outwards.
    Clamp,
    /// The outside is opaque black.
    Black,
    /// The outside is transparent: black with an alpha of 0.
    Transparent,
}

named!(Wrap {
    Repeat => "repeat",
    Mirror => "mirror",
    Clamp => "clamp",
    Black => "black",
    Transparent => "transparent",
});

/// The places of coordinates 0 and 1 on an image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Placement {
    /// The centres of the first and the last texel, as in the chapter (5.5). Repeated tiles are adjacent and don't
    /// blend into each other.
    #[default]
    Centers,
    /// The outer edges of the first and the last texel, as in OpenGL and glTF. This is for images made to be repeated,
    /// and for those that cover a sphere.
    Edges,
}

named!(Placement {
    Centers => "centers",
    Edges => "edges",
});

/// One axis of an image: the map from coordinates to texels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Axis {
    pub(super) wrap: Wrap,
    pub(super) placement: Placement,
    /// The number of texels of the whole image along this axis.
    pub(super) size: u32,
}

impl Axis {
    /// The number of texels per unit of the coordinate.
    pub(super) fn scale(&self) -> f64 {
        match self.placement {
            Placement::Centers => f64::from(self.size - 1),
            Placement::Edges => f64::from(self.size),
        }
    }

    /// The place along the whole image in texels, with its outer edges at 0 and `size`; a repeated place is moved to
    /// the first tile. The second number is −1 where the image is mirrored, else 1.
    pub(super) fn position(&self, u: f64) -> (f64, f64) {
        let u = if u.is_finite() { u } else { 0.0 };
        let mut direction = 1.0;
        let u = match self.wrap {
            // A tile includes its end: 1 is the last texel's centre and not the next tile's first.
            Wrap::Repeat if self.placement == Placement::Centers && (0.0..=1.0).contains(&u) => u,
            Wrap::Repeat => u - u.floor(),
            Wrap::Mirror => {
                let u = u - 2.0 * (u * 0.5).floor();
                if u > 1.0 {
                    direction = -1.0;
                    2.0 - u
                } else {
                    u
                }
            }
            // Far outside the image is constant; the bound keeps texel numbers small.
            Wrap::Clamp | Wrap::Black | Wrap::Transparent => u.clamp(-1.0e9, 1.0e9),
        };
        let position = match self.placement {
            Placement::Centers => u * self.scale() + 0.5,
            Placement::Edges => u * self.scale(),
        };
        (position, direction)
    }

    /// The texel at number `index` of a level with `count` texels; none on a black or transparent outside.
    #[inline]
    pub(super) fn texel(&self, index: i64, count: u32) -> Option<u32> {
        let n = i64::from(count);
        if (0..n).contains(&index) {
            return Some(index as u32);
        }
        Some(match self.wrap {
            Wrap::Repeat => index.rem_euclid(n) as u32,
            // Mirrored at the outer texels' centres. On coarser levels these lie between texels, nearer to the edges.
            Wrap::Mirror if self.placement == Placement::Centers && count == self.size => {
                let period = (2 * (n - 1)).max(1);
                let i = index.rem_euclid(period);
                i.min(period - i).min(n - 1) as u32
            }
            Wrap::Mirror => {
                let i = index.rem_euclid(2 * n);
                i.min(2 * n - 1 - i) as u32
            }
            Wrap::Clamp => index.clamp(0, n - 1) as u32,
            Wrap::Black | Wrap::Transparent => return None,
        })
    }

    /// The share of the interval around a place that lies on the image, if the outside is black or transparent.
    pub(super) fn coverage(&self, position: f64, radius: f64) -> f64 {
        match self.wrap {
            Wrap::Black | Wrap::Transparent if !radius.is_finite() => 0.0,
            Wrap::Black | Wrap::Transparent => {
                let inside = (position + radius).min(f64::from(self.size)) - (position - radius).max(0.0);
                (inside / (2.0 * radius)).clamp(0.0, 1.0)
            }
            _ => 1.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axis(wrap: Wrap, placement: Placement, size: u32) -> Axis {
        Axis { wrap, placement, size }
    }

    #[test]
    fn corners_are_centres_or_edges() {
        let centers = axis(Wrap::Repeat, Placement::Centers, 4);
        assert_eq!((centers.position(0.0).0, centers.position(1.0).0), (0.5, 3.5));
        assert_eq!(centers.position(1.25).0, 1.25);
        let edges = axis(Wrap::Clamp, Placement::Edges, 4);
        assert_eq!((edges.position(0.0).0, edges.position(1.0).0), (0.0, 4.0));
        let mirror = axis(Wrap::Mirror, Placement::Edges, 4);
        assert_eq!((mirror.position(1.25), mirror.position(-0.25)), ((3.0, -1.0), (1.0, -1.0)));
        assert_eq!(mirror.position(2.25), (1.0, 1.0));
    }

    #[test]
    fn texels_outside_follow_the_mode() {
        let at = |wrap, placement| {
            let axis = axis(wrap, placement, 3);
            (-4..7).map(|i| axis.texel(i, 3).map_or(9, |t| t)).collect::<Vec<_>>()
        };
        assert_eq!(at(Wrap::Repeat, Placement::Edges), [2, 0, 1, 2, 0, 1, 2, 0, 1, 2, 0]);
        assert_eq!(at(Wrap::Mirror, Placement::Edges), [2, 2, 1, 0, 0, 1, 2, 2, 1, 0, 0]);
        assert_eq!(at(Wrap::Mirror, Placement::Centers), [0, 1, 2, 1, 0, 1, 2, 1, 0, 1, 2]);
        assert_eq!(at(Wrap::Clamp, Placement::Edges), [0, 0, 0, 0, 0, 1, 2, 2, 2, 2, 2]);
        assert_eq!(at(Wrap::Black, Placement::Edges), [9, 9, 9, 9, 0, 1, 2, 9, 9, 9, 9]);
        assert_eq!(axis(Wrap::Mirror, Placement::Centers, 1).texel(-7, 1), Some(0));
    }

    #[test]
    fn coordinates_far_out_and_not_finite_stay_in_bounds() {
        for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp, Wrap::Black, Wrap::Transparent] {
            for u in [f64::NAN, f64::INFINITY, -f64::MAX, 1e300, -1e-300, 1e17] {
                let axis = axis(wrap, Placement::Edges, 5);
                let x = axis.position(u).0.floor() as i64;
                assert!(axis.texel(x, 5).is_none_or(|t| t < 5), "{wrap:?} {u}");
            }
        }
    }
}
