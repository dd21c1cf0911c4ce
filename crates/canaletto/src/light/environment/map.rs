//! Images all around: six faces of a cube or one latitude-longitude image, with lookups by direction and without seams.
//!
//! Texels are areas that tile the sphere of directions, and filters cross edges. On the cube they use the adjacent
//! texels of the neighbouring face; on a panorama they cross the seam and the poles. At a corner of the cube, three
//! faces join; there the fourth texel of a bilinear filter is the mean of the three.
//!
//! Footprints are prefiltered by a mip pyramid. Several trilinear lookups lie along the longer axis of the footprint's
//! ellipse, each as wide as the shorter axis (after McCormack et al., *Feline*, SIGGRAPH 1999, with equal weights).

use super::face::Face;
use super::panorama;
use super::{Footprint, Place, Smoothing};
use crate::Named;
use crate::math::{Rgb, Vector};
use crate::texture::{Image, Pyramid, Weighing, zone};
use canaletto_bvh::lanes::{LANES, Real, Real64};
use canaletto_parallel::prelude::*;
use glam::DVec3;

/// The layout of pages over the directions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Layout {
    /// Six square pages in the order of [`Face::ALL`].
    Cube,
    /// One page.
    Panorama,
}

/// Images all around.
#[derive(Debug)]
pub(super) struct EnvironmentMap {
    layout: Layout,
    smoothing: Smoothing,
    /// The pyramids, all of one size.
    pages: Vec<Pyramid>,
}

/// The largest number of lookups along the longer axis of a footprint.
const MAX_LOOKUPS: f64 = 32.0;

impl EnvironmentMap {
    /// A map of pages that fit the layout; all are of one size.
    pub(super) fn new(layout: Layout, smoothing: Smoothing, pages: Vec<Image>) -> EnvironmentMap {
        let weighing = match layout {
            Layout::Cube => Weighing::Even,
            Layout::Panorama => Weighing::Sphere,
        };
        let weighing = (smoothing == Smoothing::Bilinear).then_some(weighing);
        EnvironmentMap {
            layout,
            smoothing,
            pages: pages.into_iter().map(|image| Pyramid::of(image, weighing)).collect(),
        }
    }

    /// Whether lookups use a footprint.
    pub(super) fn is_smooth(&self) -> bool {
        self.smoothing == Smoothing::Bilinear
    }

    /// The place, footprint and radiance of a lookup in a unit direction. `footprint` holds the differences of the
    /// direction to the next pixels to the right and above; with zeros the lookup isn't prefiltered.
    pub(super) fn lookup(&self, direction: DVec3, footprint: [DVec3; 2]) -> (Place, Footprint, Rgb) {
        let (page, uv) = self.place(direction);
        let place = match self.layout {
            Layout::Cube => Place::Face { face: Face::ALL[page], uv },
            Layout::Panorama => Place::Panorama { uv },
        };
        let point = Footprint { level: 0.0, looks: 1 };
        if self.smoothing == Smoothing::Nearest {
            let size = self.size_of(0);
            let [x, y] = [0, 1].map(|i| ((uv[i] * f64::from(size[i])) as u32).min(size[i] - 1));
            return (place, point, Rgb::from(self.texel(0, page, [x, y])));
        }
        let [a, b] = footprint.map(|change| self.texels(direction, change));
        if !(a + b).is_finite() || (a == DVec3::ZERO && b == DVec3::ZERO) {
            return (place, point, Rgb::from(self.bilinear(0, page, uv)));
        }
        // The axes of the ellipse that is the image of the pixel's circle.
        let turn = 0.5 * libm::atan2(2.0 * a.dot(b), a.length_squared() - b.length_squared());
        let (sin, cos) = libm::sincos(turn);
        let long = (a * cos + b * sin).length();
        let short = (b * cos - a * sin).length();
        let looks = (long / short.max(1.0)).round().clamp(1.0, MAX_LOOKUPS);
        let level = libm::log2((long / looks).max(short).max(1.0));
        let axis = footprint[0] * cos + footprint[1] * sin;
        let mut sum = [0.0; 3];
        for i in 0..looks as u32 {
            let along = (f64::from(i) + 0.5) / looks - 0.5;
            let seen = self.trilinear((direction + axis * along).normalize_or(direction), level);
            sum.iter_mut().zip(seen).for_each(|(sum, v)| *sum += v);
        }
        let mean = Rgb::from(sum) / looks as f32;
        (place, Footprint { level: level as f32, looks: looks as u32 }, mean)
    }

    /// Whether it is a latitude-longitude image with interpolation, which [`EnvironmentMap::panorama_radiance`] takes.
    pub(super) fn is_smooth_panorama(&self) -> bool {
        self.layout == Layout::Panorama && self.is_smooth()
    }

    /// The radiance at a place (u, v) of a smooth latitude-longitude image in each lane, without a prefilter.
    #[inline(always)]
    pub(super) fn panorama_radiance<F: Real64>(&self, uv: [F; 2]) -> Vector<F::Narrow> {
        self.bilinears(0, 0, uv)
    }

    /// A change of a unit direction, in texels.
    fn texels(&self, direction: DVec3, change: DVec3) -> DVec3 {
        // A change of more than one turn adds nothing.
        const ALL: f64 = std::f64::consts::TAU;
        match self.layout {
            Layout::Cube => {
                // At the largest coordinate c, the texels per angle along one axis are 1/c² times those in the middle
                // of the face, and 1/c times along the other. The mean of both is used, so that adjacent faces agree at
                // their edge.
                let stretch = 1.0 / direction.abs().max_element();
                let density = 0.5 * f64::from(self.size_of(0)[0]) * stretch * stretch.sqrt();
                change.clamp(DVec3::splat(-ALL), DVec3::splat(ALL)) * density
            }
            Layout::Panorama => {
                let [u, v] = panorama::uv_change(direction, change);
                let [w, h] = self.size_of(0).map(f64::from);
                DVec3::new(u.clamp(-1.0, 1.0) * w, v.clamp(-1.0, 1.0) * h, 0.0)
            }
        }
    }

    /// The page of a unit direction and the place on it.
    fn place(&self, direction: DVec3) -> (usize, [f64; 2]) {
        match self.layout {
            Layout::Cube => {
                let face = Face::of(direction);
                (face as usize, face.uv(direction))
            }
            Layout::Panorama => (0, panorama::uv(direction)),
        }
    }

    fn trilinear(&self, direction: DVec3, level: f64) -> [f32; 3] {
        let (page, uv) = self.place(direction);
        let last = self.last();
        let lower = (level.floor() as usize).min(last);
        let fine = self.bilinear(lower, page, uv);
        let t = (level - lower as f64) as f32;
        if lower == last || t <= 0.0 {
            return fine;
        }
        mix(fine, self.bilinear(lower + 1, page, uv), t)
    }

    fn bilinear(&self, level: usize, page: usize, uv: [f64; 2]) -> [f32; 3] {
        let Vector { x, y, z } = self.bilinears::<f64>(level, page, uv);
        [x, y, z]
    }

    /// The bilinear interpolation at a place of each lane.
    #[inline(always)]
    fn bilinears<F: Real64>(&self, level: usize, page: usize, [u, v]: [F; 2]) -> Vector<F::Narrow> {
        let [w, h] = self.size_of(level).map(f64::from);
        let (x, y) = (u * w - 0.5, v * h - 0.5);
        let (columns, rows) = (x.to_array(), y.to_array());
        let (mut x0, mut y0) = ([0.0; LANES], [0.0; LANES]);
        // The rows hold a component of one of the four texels each.
        let mut texels = [[[0.0; LANES]; 3]; 4];
        for lane in 0..F::COUNT {
            let [i, j] = [columns[lane], rows[lane]].map(lower);
            (x0[lane], y0[lane]) = (i as f64, j as f64);
            for (texel, rows) in self.around(level, page, [i, j]).iter().zip(&mut texels) {
                for (component, row) in texel.iter().zip(rows) {
                    row[lane] = *component;
                }
            }
        }
        let (fx, fy) = ((x - F::load(&x0)).narrow(), (y - F::load(&y0)).narrow());
        let (gx, gy) = (F::Narrow::splat(1.0) - fx, F::Narrow::splat(1.0) - fy);
        let [a, b, c, d] = &texels;
        let [a, b, c, d] = [Vector::load(a), Vector::load(b), Vector::load(c), Vector::load(d)];
        (a * gx + b * fx) * gy + (c * gx + d * fx) * fy
    }

    /// The four texels that are interpolated between a texel and the next ones to the right and below.
    #[inline]
    fn around(&self, level: usize, page: usize, [i, j]: [i64; 2]) -> [[f32; 3]; 4] {
        let [w, h] = self.size_of(level).map(i64::from);
        if i >= 0 && j >= 0 && i + 1 < w && j + 1 < h {
            let (i, j) = (i as u32, j as u32);
            let around = [[i, j], [i + 1, j], [i, j + 1], [i + 1, j + 1]];
            return self.pages[page].four_texels(level, around).map(|[r, g, b, _]| [r, g, b]);
        }
        let around = [[i, j], [i + 1, j], [i, j + 1], [i + 1, j + 1]].map(|place| self.near(level, page, place));
        match around {
            [Some(a), Some(b), Some(c), Some(d)] => [a, b, c, d],
            _ => {
                let mut mean = [0.0; 3];
                for texel in around.iter().flatten() {
                    mean.iter_mut().zip(texel).for_each(|(sum, v)| *sum += v / 3.0);
                }
                around.map(|texel| texel.unwrap_or(mean))
            }
        }
    }

    /// A texel on a page or one texel beyond its edge; none beyond a corner of the cube.
    fn near(&self, level: usize, page: usize, [x, y]: [i64; 2]) -> Option<[f32; 3]> {
        let [w, h] = self.size_of(level).map(i64::from);
        if (0..w).contains(&x) && (0..h).contains(&y) {
            return Some(self.texel(level, page, [x as u32, y as u32]));
        }
        match self.layout {
            Layout::Cube => {
                let (face, place) = Face::ALL[page].fold([x, y], w)?;
                Some(self.texel(level, face as usize, place))
            }
            Layout::Panorama => {
                // Beyond a pole the page continues half a turn away.
                let (x, y) = match y {
                    ..0 => (x + w / 2, -1 - y),
                    _ if y >= h => (x + w / 2, 2 * h - 1 - y),
                    _ => (x, y),
                };
                Some(self.texel(level, page, [x.rem_euclid(w) as u32, y.clamp(0, h - 1) as u32]))
            }
        }
    }

    #[inline]
    fn texel(&self, level: usize, page: usize, [x, y]: [u32; 2]) -> [f32; 3] {
        let [r, g, b, _] = self.pages[page].texel(level, x, y);
        [r, g, b]
    }

    fn size_of(&self, level: usize) -> [u32; 2] {
        self.pages[0].size(level)
    }

    /// The columns and rows of a latitude-longitude image.
    pub(super) fn panorama_size(&self) -> Option<[usize; 2]> {
        matches!(self.layout, Layout::Panorama).then(|| self.size_of(0).map(|n| n as usize))
    }

    /// The number of texels in a row of a face.
    pub(super) fn side(&self) -> usize {
        self.size_of(0)[0] as usize
    }

    /// The number of the coarsest level.
    fn last(&self) -> usize {
        self.pages[0].len() - 1
    }

    /// The mean over all directions: each texel is weighted by the solid angle that it covers.
    pub(super) fn mean(&self) -> Rgb {
        let [w, h] = self.size_of(0);
        let row = |y: u32| {
            let angles = self.row_angles([w, h], y);
            let mut sum = [0.0; 3];
            for page in 0..self.pages.len() {
                for (x, angle) in (0..w).zip(&angles) {
                    let texel = self.texel(0, page, [x, y]);
                    sum.iter_mut().zip(texel).for_each(|(sum, v)| *sum += angle * f64::from(v));
                }
            }
            sum
        };
        let rows: Vec<[f64; 3]> = (0..h).into_par_iter().map(row).collect();
        let mean = rows.iter().fold([0.0; 3], |all, row| std::array::from_fn(|c| all[c] + row[c]));
        Rgb::from(mean.map(|v| v as f32)).saturated()
    }

    /// The shares of all directions that the texels of a row on one page cover.
    fn row_angles(&self, [w, h]: [u32; 2], y: u32) -> Vec<f64> {
        match self.layout {
            Layout::Panorama => {
                let [from, to] = [y, y + 1].map(|y| f64::from(y) / f64::from(h));
                vec![zone(from, to) / f64::from(w); w as usize]
            }
            Layout::Cube => {
                let along = |i: u32, n: u32| 2.0 * f64::from(i) / f64::from(n) - 1.0;
                let [top, bottom] = [along(y, h), along(y + 1, h)];
                // The solid angle of the rectangle from the middle of a face to (x, y) is atan(x y / √(x² + y² + 1)).
                let to = |x: f64, y: f64| libm::atan2(x * y, (x * x + y * y + 1.0).sqrt());
                let until: Vec<f64> = (0..=w).map(|x| to(along(x, w), bottom) - to(along(x, w), top)).collect();
                until.windows(2).map(|ends| (ends[1] - ends[0]) / (4.0 * std::f64::consts::PI)).collect()
            }
        }
    }
}

/// The largest integer that isn't above a number.
#[inline(always)]
fn lower(x: f64) -> i64 {
    let truncated = x as i64;
    truncated - i64::from(x < truncated as f64)
}

fn mix(a: [f32; 3], b: [f32; 3], t: f32) -> [f32; 3] {
    std::array::from_fn(|c| a[c] * (1.0 - t) + b[c] * t)
}
