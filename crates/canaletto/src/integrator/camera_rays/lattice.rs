//! The first samples of adaptive sampling (after Whitted 1980, §4, with a grid in place of his recursion). They lie at
//! the corners and centres of pixels, as far as a pixel's filter reaches. Where their colours differ, the pixel is
//! sampled finely. Otherwise they make the pixel.
//!
//! Four pixels share a corner, and more share it with a wide filter. All samples of an area are traced at once: about
//! two rays for each pixel.

use crate::film::{FilterTable, display_all};
use crate::job::in_squares;
use crate::math::Rgb;
use crate::scene::Transfer;

/// The kind of a site: its position in its pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Kind {
    /// The lower left corner.
    #[default]
    Corner,
    /// The centre.
    Center,
}

/// A site of the lattice.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Site {
    pub(super) kind: Kind,
    /// The pixel's column and its row from the bottom, or the offset from another pixel.
    pub(super) pixel: [i64; 2],
}

impl Site {
    /// The sites of one pixel.
    pub(super) fn of(pixel: [i64; 2]) -> [Site; 2] {
        [Kind::Corner, Kind::Center].map(|kind| Site { kind, pixel })
    }

    /// This site, offset by a pixel.
    pub(super) fn at(&self, [x, y]: [i64; 2]) -> Site {
        Site { kind: self.kind, pixel: [self.pixel[0] + x, self.pixel[1] + y] }
    }

    /// The position of the site's ray, in pixels.
    pub(super) fn position(&self) -> [f64; 2] {
        let inside = if self.kind == Kind::Corner { 0.0 } else { 0.5 };
        self.pixel.map(|i| i as f64 + inside)
    }
}

/// The sites that a pixel's filter reaches.
#[derive(Clone, Debug, Default)]
pub(super) struct FilterSites {
    /// Corners in rows from the lower left, then centres, each with the filter's value.
    sites: Vec<(Site, f64)>,
    /// The number of corners and of centres in a row.
    across: [i64; 2],
}

impl FilterSites {
    pub(super) fn new(filter: &FilterTable) -> FilterSites {
        // In units of half a pixel, corners are odd and centres even. The sites extend to the next one beyond the
        // filter's end. A detail that crosses the filter's edge is then not missed.
        let reach = (2.0 * filter.radius() - 1e-6).ceil().max(1.0) as i64;
        let along = |odd: i64| (-reach..=reach).filter(move |d| d & 1 == odd);
        let mut sites = Vec::new();
        for (kind, odd) in [(Kind::Corner, 1), (Kind::Center, 0)] {
            for y in along(odd) {
                for x in along(odd) {
                    let pixel = [x, y].map(|d| (d + odd) / 2);
                    sites.push((Site { kind, pixel }, filter.value([x, y].map(|d| 0.5 * d as f64))));
                }
            }
        }
        FilterSites { sites, across: [1, 0].map(|odd| along(odd).count() as i64) }
    }

    /// The sites with a weight other than zero, with their weights.
    pub(super) fn weighted(&self) -> impl Iterator<Item = (Site, f64)> + '_ {
        self.sites.iter().copied().filter(|(_, weight)| *weight != 0.0)
    }
}

/// The colours at the sites that the pixels of an area need.
#[derive(Clone, Debug, Default)]
pub(super) struct Lattice {
    /// The lower left pixel of the area, and the area's size.
    pixel: [i64; 2],
    size: [i64; 2],
    /// The grid of corners and the grid of centres.
    grids: [Grid; 2],
}

/// Sites of one kind in rows.
#[derive(Clone, Debug, Default)]
struct Grid {
    /// The pixel of the lower left site.
    first: [i64; 2],
    size: [u32; 2],
    colors: Vec<Rgb>,
    /// The share of the background that each site hides, if the background is left out; else 1.
    alphas: Vec<f32>,
    /// The colours as displayed.
    shown: Vec<[f32; 3]>,
}

impl Grid {
    fn index(&self, pixel: [i64; 2]) -> usize {
        let [x, y] = [0, 1].map(|i: usize| (pixel[i] - self.first[i]) as usize);
        y * self.size[0] as usize + x
    }
}

impl Lattice {
    /// The lattice of an area, without colours.
    pub(super) fn around(pixel: [i64; 2], size: [u32; 2], probes: &FilterSites) -> Lattice {
        let grid = |kind: Kind| {
            let across = probes.across[kind as usize];
            let first = probes.sites.iter().find(|(site, _)| site.kind == kind).map_or([0; 2], |(site, _)| site.pixel);
            let size = size.map(|n| n + (across - 1).max(0) as u32);
            Grid {
                first: [0, 1].map(|i: usize| pixel[i] + first[i]),
                size,
                colors: vec![Rgb::BLACK; size[0] as usize * size[1] as usize],
                alphas: vec![1.0; size[0] as usize * size[1] as usize],
                shown: Vec::new(),
            }
        };
        Lattice { pixel, size: size.map(i64::from), grids: [grid(Kind::Corner), grid(Kind::Center)] }
    }

    /// Whether the pixel is in the area, so that all its sites have colours.
    pub(super) fn covers(&self, pixel: [i64; 2]) -> bool {
        (0..2).all(|i| (0..self.size[i]).contains(&(pixel[i] - self.pixel[i])))
    }

    /// The sites of the area's own pixels, or all others, along a Z-shaped curve.
    pub(super) fn sites(&self, own: bool) -> impl Iterator<Item = Site> + '_ {
        let all = [Kind::Corner, Kind::Center].into_iter().flat_map(|kind| {
            let first = self.grids[kind as usize].first;
            let places = in_squares(self.grids[kind as usize].size).into_iter();
            places.map(move |place| Site { kind, pixel: place.map(i64::from) }.at(first))
        });
        all.filter(move |site| self.covers(site.pixel) == own)
    }

    /// Stores the colours of some sites, and their alphas, if there are any.
    pub(super) fn fill(&mut self, sites: &[Site], seen: &[Rgb], alphas: &[f32]) {
        for (number, (site, color)) in sites.iter().zip(seen).enumerate() {
            let grid = &mut self.grids[site.kind as usize];
            let index = grid.index(site.pixel);
            grid.colors[index] = *color;
            if let Some(alpha) = alphas.get(number) {
                grid.alphas[index] = *alpha;
            }
        }
    }

    /// Computes the displayed colours.
    pub(super) fn develop(&mut self, transfer: Transfer) {
        for grid in &mut self.grids {
            grid.shown = grid.colors.iter().map(|color| color.to_array()).collect();
            display_all(grid.shown.as_flattened_mut(), transfer);
        }
    }

    /// Whether the displayed colours at a pixel's sites differ by at most `threshold` in each component, and alphas,
    /// too.
    pub(super) fn is_even(&self, probes: &FilterSites, pixel: [i64; 2], threshold: f32) -> bool {
        let (mut least, mut most) = ([1.0f32; 4], [0.0f32; 4]);
        for (site, _) in &probes.sites {
            let grid = &self.grids[site.kind as usize];
            let index = grid.index(site.at(pixel).pixel);
            let [r, g, b] = grid.shown[index];
            let shown = [r, g, b, grid.alphas[index]];
            for c in 0..4 {
                (least[c], most[c]) = (least[c].min(shown[c]), most[c].max(shown[c]));
            }
        }
        (0..4).map(|c| most[c] - least[c]).fold(0.0, f32::max) <= threshold
    }

    /// The colours of an even pixel's sites, with their weights.
    pub(super) fn colors<'a>(
        &'a self,
        probes: &'a FilterSites,
        pixel: [i64; 2],
    ) -> impl Iterator<Item = (Rgb, f64)> + 'a {
        probes.weighted().map(move |(site, weight)| {
            let grid = &self.grids[site.kind as usize];
            (grid.colors[grid.index(site.at(pixel).pixel)], weight)
        })
    }
}
