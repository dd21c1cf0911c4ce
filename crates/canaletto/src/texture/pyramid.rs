//! Mip pyramids (Williams, *Pyramidal Parametrics*, SIGGRAPH 1983): an image at decreasing resolutions.
//!
//! Each level has half the texels per side of the one before, rounded down. A texel is the mean over exactly the area
//! that it covers, with shares of texels where a side is odd. No part of an image of any size thus weighs more than
//! another. Means are of linear light, and of colours multiplied by alpha.
//!
//! The first two coarser levels keep the format of the image: bytes stay bytes. Each is made from the image itself, so
//! that means are rounded once; repeated rounding to bytes would shift noisy values. Further levels are linear `f32`,
//! since bytes would lose sparse values. For images of bytes all levels together take 0.4 of the image's memory.

use super::codec::{Codec, Slot, Tap};
use super::halves::{first_levels, has_whole_tiles};
use super::level::{Level, TILE, index};
use super::{ColorSpace, Image, Samples, srgb_decode};
use crate::texture::half::{from_half, to_half};
use canaletto_parallel::prelude::*;
use std::sync::Arc;

/// The runtime form of an image, with coarser levels if they are needed.
#[derive(Debug)]
pub(crate) struct Pyramid {
    /// The finest level. Pyramids of this image in another colour space share it.
    base: Arc<Level>,
    coarser: Vec<Level>,
    pub(super) codec: Codec,
}

impl Pyramid {
    /// A pyramid of one level.
    pub(super) fn new(base: Arc<Level>, image: &Header, space: ColorSpace) -> Pyramid {
        let base = if space == ColorSpace::Srgb { linearized(base) } else { base };
        let codec = Codec::new(image.channels, &base.samples, space, image.premultiplied);
        Pyramid { base, coarser: Vec::new(), codec }
    }

    /// Makes the coarser levels, down to a single texel.
    pub(super) fn with_levels(mut self, weighing: Weighing) -> Pyramid {
        if has_whole_tiles(&self.base) {
            let rows = std::array::from_fn(|level| {
                let (fine, coarse) = (self.base.height >> level, self.base.height >> (level + 1));
                let pair = |share: &Share| match share.weights[..] {
                    [above, below] => [above, below],
                    _ => [0.5; 2],
                };
                weighing.rows(fine, coarse).iter().map(pair).collect()
            });
            self.coarser.extend(first_levels(&self.base, &self.codec, &rows));
        }
        loop {
            let last = self.level(self.len() - 1);
            if last.width == 1 && last.height == 1 {
                return self;
            }
            let size = [(last.width / 2).max(1), (last.height / 2).max(1)];
            let next = match self.len() {
                ..COMPACT => coarsen(&self.base, size, &self.codec, weighing, &self.base.samples),
                COMPACT => coarsen(&self.base, size, &self.codec, weighing, &Samples::F32(Vec::new())),
                _ => coarsen(last, size, &self.codec, weighing, &last.samples),
            };
            self.coarser.push(next);
        }
    }

    /// The pyramid of an image for lookups of single texels. It has one level or, with a `weighing`, all.
    pub(crate) fn of(image: Image, weighing: Option<Weighing>) -> Pyramid {
        let space = image.space;
        let (header, level) = Header::split(image);
        let pyramid = Pyramid::new(Arc::new(level), &header, space);
        match weighing {
            Some(weighing) => pyramid.with_levels(weighing),
            None => pyramid,
        }
    }

    /// A texel of a level in linear light, its colours multiplied by its alpha.
    #[inline]
    pub(crate) fn texel(&self, level: usize, x: u32, y: u32) -> [f32; 4] {
        let level = self.level(level);
        self.codec.sum(&level.samples, &[(level.index(x, y), 1.0)])
    }

    /// Four texels, each as by [`Pyramid::texel`].
    pub(crate) fn four_texels(&self, level: usize, at: [[u32; 2]; 4]) -> [[f32; 4]; 4] {
        let level = self.level(level);
        self.codec.four(&level.samples, at.map(|[x, y]| level.index(x, y)))
    }

    /// The width and height of a level.
    pub(crate) fn size(&self, level: usize) -> [u32; 2] {
        let level = self.level(level);
        [level.width, level.height]
    }

    /// The number of levels.
    pub(crate) fn len(&self) -> usize {
        1 + self.coarser.len()
    }

    pub(super) fn level(&self, number: usize) -> &Level {
        if number == 0 { &self.base } else { &self.coarser[number - 1] }
    }
}

/// The number of levels that keep the format of the image, including the image itself.
pub(super) const COMPACT: usize = 3;

/// The weight of an image's rows in the means of coarser texels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Weighing {
    /// All rows have equal weight.
    Even,
    /// Rows are weighted by the solid angle that they cover, from pole to pole.
    Sphere,
}

impl Weighing {
    /// For each of `coarse` rows, the part of `fine` rows that it covers.
    fn rows(self, fine: u32, coarse: u32) -> Vec<Share> {
        match self {
            Weighing::Even => shares(fine, coarse),
            Weighing::Sphere => shares_of_zones(fine, coarse),
        }
    }
}

/// The description of an image without its numbers.
#[derive(Debug)]
pub(super) struct Header {
    pub(super) channels: u8,
    pub(super) space: ColorSpace,
    pub(super) premultiplied: bool,
}

impl Header {
    /// Separates an image into its description and its finest level.
    pub(super) fn split(image: Image) -> (Header, Level) {
        let Image { width, height, channels, samples, space, premultiplied, .. } = image;
        (Header { channels, space, premultiplied }, Level::from_rows(width, height, usize::from(channels), samples))
    }
}

/// Converts floating-point numbers on the sRGB curve to linear light. A power for every lookup would be expensive.
pub(super) fn linearized(base: Arc<Level>) -> Arc<Level> {
    let samples = match &base.samples {
        Samples::U8(_) | Samples::U16(_) => return base,
        Samples::F16(data) => Samples::F16(data.par_iter().map(|v| to_half(srgb_decode(from_half(*v)))).collect()),
        Samples::F32(data) => Samples::F32(data.par_iter().map(|v| srgb_decode(*v)).collect()),
    };
    Arc::new(Level { width: base.width, height: base.height, samples })
}

/// A coarser level of this size, in the format of `like`.
fn coarsen(fine: &Level, [width, height]: [u32; 2], codec: &Codec, weighing: Weighing, like: &Samples) -> Level {
    let columns = shares(fine.width, width);
    let rows = weighing.rows(fine.height, height);
    // A whole band of tiles is contiguous in memory.
    let band = (width * TILE) as usize;
    let samples = fill(like, width as usize * height as usize, band, codec, |number, put| {
        let top = number as u32 * TILE;
        let down = TILE.min(height - top);
        let mut taps: Vec<Tap> = Vec::new();
        for y in 0..down {
            let row = &rows[(top + y) as usize];
            for x in 0..width {
                taps.clear();
                for (j, weight) in row.iter() {
                    taps.extend(columns[x as usize].iter().map(|(i, share)| (fine.index(i, j), share * weight)));
                }
                let mean = codec.sum(&fine.samples, &taps);
                put(index(width, down, x, y) as usize, mean);
            }
        }
    });
    Level { width, height, samples }
}

/// Numbers in the format of `like` for `count` texels, filled in parallel in pieces of `piece` texels. `make` is called
/// with a piece's number and a function that stores a texel at its position in the piece.
pub(super) fn fill(
    like: &Samples,
    count: usize,
    piece: usize,
    codec: &Codec,
    make: impl Fn(usize, &mut dyn FnMut(usize, [f32; 4])) + Sync,
) -> Samples {
    let work = Work { count, piece, codec };
    match like {
        Samples::U8(_) => Samples::U8(work.run(|d| Slot::U8(d), &make)),
        Samples::U16(_) => Samples::U16(work.run(|d| Slot::U16(d), &make)),
        Samples::F16(_) => Samples::F16(work.run(|d| Slot::F16(d), &make)),
        Samples::F32(_) => Samples::F32(work.run(|d| Slot::F32(d), &make)),
    }
}

struct Work<'a> {
    count: usize,
    piece: usize,
    codec: &'a Codec,
}

impl Work<'_> {
    fn run<T: Copy + Default + Send>(
        &self,
        slot: impl for<'s> Fn(&'s mut [T]) -> Slot<'s> + Sync,
        make: &(impl Fn(usize, &mut dyn FnMut(usize, [f32; 4])) + Sync),
    ) -> Vec<T> {
        let channels = self.codec.channels;
        let mut data = vec![T::default(); self.count * channels];
        data.par_chunks_mut(self.piece * channels).enumerate().for_each(|(number, part)| {
            make(number, &mut |at, mean| {
                let at = at * channels;
                self.codec.store(mean, &mut slot(&mut part[at..at + channels]));
            });
        });
        data
    }
}

/// The texels that one coarser texel covers, and the share of each.
pub(super) struct Share {
    first: u32,
    weights: Vec<f32>,
}

impl Share {
    pub(super) fn iter(&self) -> impl Iterator<Item = Tap> + '_ {
        (self.first..).zip(self.weights.iter().copied())
    }
}

/// For each of `coarse` texels, the part of `fine` texels that it covers.
pub(super) fn shares(fine: u32, coarse: u32) -> Vec<Share> {
    shares_by(fine, coarse, |low, high, _| (high - low) as f64)
}

/// [`shares`] from pole to pole, by the solid angle between two circles of latitude.
fn shares_of_zones(fine: u32, coarse: u32) -> Vec<Share> {
    shares_by(fine, coarse, |low, high, whole| zone(low as f64 / whole as f64, high as f64 / whole as f64))
}

/// The share of the sphere between two distances from a pole, as fractions of the distance to the other pole.
pub(crate) fn zone(from: f64, to: f64) -> f64 {
    // (cos a − cos b)/2 = sin((a + b)/2) sin((b − a)/2), without cancellation.
    let half = std::f64::consts::FRAC_PI_2;
    libm::sin((from + to) * half) * libm::sin((to - from) * half)
}

/// Shares by a measure of the part from `low` to `high` of `whole`.
fn shares_by(fine: u32, coarse: u32, measure: impl Fn(u64, u64, u64) -> f64) -> Vec<Share> {
    let (fine, coarse) = (u64::from(fine), u64::from(coarse));
    let share = |i: u64| {
        // Exact in integers: texel i covers [i fine / coarse, (i + 1) fine / coarse].
        let (start, end) = (i * fine, (i + 1) * fine);
        let (first, last) = (start / coarse, end.div_ceil(coarse));
        let parts = (first..last).map(|j| measure((j * coarse).max(start), ((j + 1) * coarse).min(end), fine * coarse));
        let all = measure(start, end, fine * coarse);
        Share { first: first as u32, weights: parts.map(|part| (part / all) as f32).collect() }
    };
    (0..coarse).map(share).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pyramid(width: u32, height: u32, channels: u8, samples: Samples, space: ColorSpace) -> Pyramid {
        let image = Image { name: "i".into(), width, height, channels, samples, space, premultiplied: false };
        image.check().unwrap();
        let (header, level) = Header::split(image);
        Pyramid::new(Arc::new(level), &header, space).with_levels(Weighing::Even)
    }

    fn texel(pyramid: &Pyramid, level: usize, x: u32, y: u32) -> [f32; 4] {
        let level = pyramid.level(level);
        pyramid.codec.sum(&level.samples, &[(level.index(x, y), 1.0)])
    }

    #[test]
    fn the_last_level_is_the_mean_for_any_size() {
        for (width, height) in [(1, 1), (2, 2), (3, 1), (5, 7), (17, 6), (33, 31), (100, 3)] {
            let count = (width * height) as usize;
            let data: Vec<f32> = (0..count).map(|i| ((i * 37 + 11) % 101) as f32).collect();
            let mean = data.iter().map(|v| f64::from(*v)).sum::<f64>() / count as f64;
            let p = pyramid(width, height, 1, Samples::F32(data), ColorSpace::Linear);
            let last = p.len() - 1;
            assert_eq!((p.level(last).width, p.level(last).height), (1, 1));
            let value = f64::from(texel(&p, last, 0, 0)[0]);
            assert!((value - mean).abs() < 1e-4, "{width} × {height}: {value} for {mean}");
        }
    }

    #[test]
    fn every_texel_of_an_odd_side_counts_by_its_area() {
        // 3 → 1, and 5 → 2: texels of 2.5.
        let p = pyramid(5, 1, 1, Samples::F32(vec![1.0, 2.0, 4.0, 8.0, 16.0]), ColorSpace::Linear);
        assert!((texel(&p, 1, 0, 0)[0] - (1.0 + 2.0 + 2.0) / 2.5).abs() < 1e-6);
        assert!((texel(&p, 1, 1, 0)[0] - (2.0 + 8.0 + 16.0) / 2.5).abs() < 1e-6);
    }

    #[test]
    fn means_are_of_linear_light() {
        // Black and white: half the light is byte 188 on the sRGB curve, not 128.
        let bytes = [0, 255, 255, 0].iter().flat_map(|v| [*v; 3]).collect();
        let p = pyramid(2, 2, 3, Samples::U8(bytes), ColorSpace::Srgb);
        let Samples::U8(data) = &p.level(1).samples else { panic!() };
        assert_eq!(data, &[188; 3]);
        let p = pyramid(2, 2, 1, Samples::U8(vec![0, 255, 255, 0]), ColorSpace::Raw);
        let Samples::U8(data) = &p.level(1).samples else { panic!() };
        assert_eq!(data, &[128]);
    }

    #[test]
    fn clear_texels_have_no_colour_to_give() {
        // Opaque red beside clear green: half-clear red, without a green fringe.
        let p = pyramid(2, 1, 4, Samples::U8(vec![255, 0, 0, 255, 0, 255, 0, 0]), ColorSpace::Srgb);
        let Samples::U8(data) = &p.level(1).samples else { panic!() };
        assert_eq!(data, &[255, 0, 0, 128]);
        // Channels that are not colours are averaged independently.
        let p = pyramid(2, 1, 4, Samples::U8(vec![255, 0, 0, 255, 0, 255, 0, 0]), ColorSpace::Raw);
        let Samples::U8(data) = &p.level(1).samples else { panic!() };
        assert_eq!(data, &[128, 128, 0, 128]);
    }

    #[test]
    fn a_constant_stays_the_same_in_every_format() {
        let count = 13 * 9 * 3;
        let all = [
            Samples::U8(vec![77; count]),
            Samples::U16(vec![7777; count]),
            Samples::F16(vec![0x3555; count]),
            Samples::F32(vec![0.3; count]),
        ];
        for samples in all {
            let p = pyramid(13, 9, 3, samples, ColorSpace::Linear);
            let first = texel(&p, 0, 0, 0);
            let last = texel(&p, p.len() - 1, 0, 0);
            assert!((first[1] - last[1]).abs() <= 1e-6, "{first:?} {last:?}");
        }
    }
}
