//! Stored textures of space: grids of voxels (a "3-D texture" of 5.5).
//!
//! A grid is an image whose slices are stacked from top to bottom. Its filters are those of images in three dimensions.
//! Its pyramid halves all three dimensions, and lookups blend two levels as Williams' trilinear filter does. EWA is not
//! used, since an ellipse's slices through coarser voxels would gain little.

use super::codec::{Codec, Tap};
use super::kernel::weights;
use super::level::Level;
use super::pyramid::{COMPACT, Header, fill, linearized, shares};
use super::wrap::{Axis, Wrap};
use super::{ColorSpace, Filter, Lookup, Placement, Prefilter, Samples};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// A grid over the unit cube. x runs from the left of the slices to the right, y from their top row to their bottom
/// row, z from the first slice to the last.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct GridTexture {
    /// The index into [`crate::scene::Scene::images`] of the image with the stacked slices.
    pub image: u32,
    /// The number of slices. It divides the image's height.
    pub slices: u32,
    /// The reconstruction filter between voxels.
    pub filter: Filter,
    /// Whether coarser levels are used where voxels are smaller than pixels. [`Prefilter::Ewa`] acts as
    /// [`Prefilter::Trilinear`].
    pub prefilter: Prefilter,
    /// The continuation outside the unit cube.
    pub wrap: Wrap,
    /// The places of the coordinates 0 and 1.
    pub placement: Placement,
    /// The meaning of the image's numbers. It overrides the image's own.
    pub space: Option<ColorSpace>,
}

/// The runtime form of a grid.
#[derive(Debug)]
pub(super) struct GridMap {
    /// The levels with their sizes in voxels, the finest first.
    levels: Vec<(Arc<Level>, [u32; 3])>,
    codec: Codec,
    filter: Filter,
    prefilter: Prefilter,
    axes: [Axis; 3],
}

impl GridMap {
    pub(super) fn new(base: &Arc<Level>, header: &Header, texture: &GridTexture) -> GridMap {
        let size = [base.width, base.height / texture.slices, texture.slices];
        let axes = size.map(|size| Axis { wrap: texture.wrap, placement: texture.placement, size });
        let space = texture.space.unwrap_or(header.space);
        let base = if space == ColorSpace::Srgb { linearized(Arc::clone(base)) } else { Arc::clone(base) };
        let codec = Codec::new(header.channels, &base.samples, space, header.premultiplied);
        let mut levels = vec![(base, size)];
        while texture.prefilter != Prefilter::None
            && let Some((last, size)) = levels.last()
            && size.iter().any(|n| *n > 1)
        {
            let half = size.map(|n| (n / 2).max(1));
            // As in pyramids of images, levels up to the first one in `f32` are made from the voxels themselves.
            let (base, base_size) = &levels[0];
            let coarse = match levels.len() {
                ..COMPACT => coarsen((base, *base_size), half, &codec, &base.samples),
                COMPACT => coarsen((base, *base_size), half, &codec, &Samples::F32(Vec::new())),
                _ => coarsen((last, *size), half, &codec, &last.samples),
            };
            levels.push((Arc::new(coarse), half));
        }
        GridMap { levels, codec, filter: texture.filter, prefilter: texture.prefilter, axes }
    }

    pub(super) fn eval(&self, lookup: &Lookup) -> [f32; 4] {
        let at = [0, 1, 2].map(|i: usize| self.axes[i].position(lookup.at[i]).0);
        let scale = DVec3::from_array([0, 1, 2].map(|i: usize| self.axes[i].scale()));
        let width = (lookup.dx * scale).length_squared().max((lookup.dy * scale).length_squared());
        let sum = if self.prefilter == Prefilter::None || width <= 1.0 {
            self.reconstruct(0, self.filter, at)
        } else {
            let top = self.levels.len() - 1;
            let level = if width.is_finite() { 0.5 * libm::log2(width) } else { top as f64 };
            let below = (level as usize).min(top);
            let on =
                |level: usize| self.reconstruct(level, if level == 0 { self.filter } else { Filter::Bilinear }, at);
            let fine = on(below);
            if below == top {
                fine
            } else {
                let (coarse, t) = (on(below + 1), (level - below as f64) as f32);
                std::array::from_fn(|i| fine[i] + (coarse[i] - fine[i]) * t)
            }
        };
        self.codec.finish(sum, &self.levels[0].0.samples, self.ends())
    }

    pub(super) fn color(&self, lookup: &Lookup) -> [f32; 4] {
        let value = self.eval(lookup);
        if self.ends() { self.codec.uncovered(value) } else { value }
    }

    /// Whether the outside is transparent.
    fn ends(&self) -> bool {
        self.axes[0].wrap == Wrap::Transparent
    }

    /// The distance between voxels along x and y.
    pub(super) fn spacing(&self) -> [f64; 2] {
        [0, 1].map(|i| 1.0 / self.axes[i].scale().max(1.0))
    }

    fn reconstruct(&self, level: usize, filter: Filter, at: [f64; 3]) -> [f32; 4] {
        let (voxels, size) = &self.levels[level];
        let along =
            [0, 1, 2].map(|i: usize| weights(filter, at[i] * f64::from(size[i]) / f64::from(self.axes[i].size)));
        let texel = |axis: usize, i: usize| self.axes[axis].texel(along[axis].first + i as i64, size[axis]);
        let mut taps: [Tap; 64] = [(0, 0.0); 64];
        let (mut count, mut outside) = (0, 0.0);
        for k in 0..along[2].count {
            let z = texel(2, k);
            for j in 0..along[1].count {
                let y = texel(1, j);
                let row_weight = along[2].weights[k] * along[1].weights[j];
                for i in 0..along[0].count {
                    let weight = row_weight * along[0].weights[i];
                    match (texel(0, i), y, z) {
                        (Some(x), Some(y), Some(z)) => {
                            taps[count] = (voxels.index(x, z * size[1] + y), weight);
                            count += 1;
                        }
                        _ => outside += weight,
                    }
                }
            }
        }
        let mut sum = self.codec.sum(&voxels.samples, &taps[..count]);
        if self.axes[0].wrap == Wrap::Black {
            sum[3] += outside;
        }
        sum
    }
}

/// A coarser level of this size, in the format of `like`.
fn coarsen((fine, size): (&Level, [u32; 3]), coarse: [u32; 3], codec: &Codec, like: &Samples) -> Level {
    let along = [0, 1, 2].map(|i: usize| shares(size[i], coarse[i]));
    let [width, height, depth] = coarse.map(|n| n as usize);
    let samples = fill(like, width * height * depth, width, codec, |row, put| {
        let (y, z) = (row % height, row / height);
        let mut taps: Vec<Tap> = Vec::new();
        for x in 0..width {
            taps.clear();
            for (k, deep) in along[2][z].iter() {
                for (j, down) in along[1][y].iter() {
                    let across = along[0][x].iter();
                    taps.extend(across.map(|(i, share)| (fine.index(i, k * size[1] + j), share * down * deep)));
                }
            }
            put(x, codec.sum(&fine.samples, &taps));
        }
    });
    Level::from_rows(coarse[0], coarse[1] * coarse[2], codec.channels, samples)
}

#[cfg(test)]
mod tests {
    use crate::texture::*;
    use glam::DVec3;

    fn grid(size: [u32; 3], filter: Filter, f: impl Fn(DVec3) -> f64) -> PreparedTexture {
        let [w, h, d] = size;
        let samples = (0..w * h * d)
            .map(|i| f(DVec3::new(f64::from(i % w), f64::from(i / w % h), f64::from(i / w / h)) + 0.5) as f32)
            .collect();
        let image = Image {
            name: "grid".into(),
            width: w,
            height: h * d,
            channels: 1,
            samples: Samples::F32(samples),
            space: ColorSpace::Raw,
            premultiplied: false,
        };
        let texture = GridTexture {
            image: 0,
            slices: d,
            filter,
            prefilter: Prefilter::Trilinear,
            wrap: Wrap::Clamp,
            placement: Placement::Edges,
            space: None,
        };
        let texture = Texture { name: "g".into(), kind: TextureKind::Grid(texture) };
        PreparedTexture::resolve(vec![image], &[texture]).unwrap().remove(0)
    }

    #[test]
    fn lines_and_parabolas_in_three_directions_are_reproduced() {
        let size = [11, 9, 13];
        let scale = DVec3::new(11.0, 9.0, 13.0);
        let line = |p: DVec3| 0.3 * p.x - 0.2 * p.y + 0.1 * p.z;
        let bowl = |p: DVec3| 0.01 * p.x * p.x - 0.02 * p.y * p.z + 0.03 * p.z * p.z;
        for (filter, exact) in [(Filter::Bilinear, false), (Filter::Biquadratic, true), (Filter::Bicubic, true)] {
            let (lines, bowls) = (grid(size, filter, line), grid(size, filter, bowl));
            for i in 0..200 {
                let r = |k: u32| (f64::from(i * 3 + k) * 0.618_034).fract();
                let p = DVec3::new(2.0 + 7.0 * r(0), 2.0 + 5.0 * r(1), 2.0 + 9.0 * r(2));
                let at = Lookup::point(p / scale);
                assert!((f64::from(lines.eval(&at)[0]) - line(p)).abs() < 1e-5, "{filter:?}");
                assert!(!exact || (f64::from(bowls.eval(&at)[0]) - bowl(p)).abs() < 1e-4, "{filter:?}");
            }
        }
    }

    #[test]
    fn coarser_levels_stay_in_place_and_end_at_the_mean() {
        let size = [33, 20, 27];
        let pattern = grid(size, Filter::Bilinear, |p| p.z);
        for spacing in [1.5, 3.0, 6.0] {
            let step = DVec3::splat(0.577 * spacing) / DVec3::new(33.0, 20.0, 27.0);
            let lookup = Lookup { at: DVec3::splat(0.45), dx: step, dy: step };
            let got = f64::from(pattern.eval(&lookup)[0]);
            assert!((got - 0.45 * 27.0).abs() < 0.05 * spacing, "{spacing}: {got}");
        }
        let far = Lookup { at: DVec3::splat(0.2), dx: DVec3::splat(1e9), dy: DVec3::ZERO };
        assert!((pattern.eval(&far)[0] - 13.5).abs() < 1e-3);
    }
}
