//! The samples of pixels as means over aligned blocks of a power of two of them, so that pictures can be added.
//!
//! Block [s, s + 2ᵏ) of samples is aligned if 2ᵏ divides s. Its mean is half the sum of its halves' means, down to
//! single samples, each rounded to `f32`. It is therefore the same number whether the block was made at once, in
//! passes, or by two programs. A pixel keeps its largest blocks: of 96 samples those of 64 and of 32. With a power of
//! two of samples the picture itself is its only block, and nothing else is needed to go on with it.
//!
//! In Sobol's sequence with Owen's scrambling each aligned block is a net. So the halves of blocks are the best halves
//! of a pixel: each of them covers all that is sampled.

use super::{Layer, Picture};
use crate::math::Rgb;

/// The halves of a block of which only the mean is known.
const UNKNOWN: [Rgb; 2] = [Rgb::gray(f32::NAN); 2];

/// The names of the layers of blocks. Numbers of samples have at most 17 digits.
pub const BLOCK_LAYERS: [&str; 17] = [
    "block-1", "block-2", "block-3", "block-4", "block-5", "block-6", "block-7", "block-8", "block-9", "block-10",
    "block-11", "block-12", "block-13", "block-14", "block-15", "block-16", "block-17",
];

/// The names of the layers of the halves of [`BLOCK_LAYERS`].
pub const BLOCK_HALF_LAYERS: [[&str; 2]; 17] = [
    ["block-1-half-a", "block-1-half-b"],
    ["block-2-half-a", "block-2-half-b"],
    ["block-3-half-a", "block-3-half-b"],
    ["block-4-half-a", "block-4-half-b"],
    ["block-5-half-a", "block-5-half-b"],
    ["block-6-half-a", "block-6-half-b"],
    ["block-7-half-a", "block-7-half-b"],
    ["block-8-half-a", "block-8-half-b"],
    ["block-9-half-a", "block-9-half-b"],
    ["block-10-half-a", "block-10-half-b"],
    ["block-11-half-a", "block-11-half-b"],
    ["block-12-half-a", "block-12-half-b"],
    ["block-13-half-a", "block-13-half-b"],
    ["block-14-half-a", "block-14-half-b"],
    ["block-15-half-a", "block-15-half-b"],
    ["block-16-half-a", "block-16-half-b"],
    ["block-17-half-a", "block-17-half-b"],
];

/// The samples of a rectangle of pixels, in rows from the upper left. Each pixel has those from number `first` on.
#[derive(Clone, Debug)]
pub struct SampleBlocks {
    width: u32,
    height: u32,
    first: u32,
    /// The number of samples of each pixel.
    counts: Vec<u32>,
    /// The number of blocks that each pixel has room for.
    room: usize,
    /// The means of each pixel's blocks in the order of their samples.
    means: Vec<Rgb>,
    /// The means of the halves of these blocks; empty if they aren't kept. They are NaN where they are unknown.
    halves: Vec<[Rgb; 2]>,
}

/// The mean of one aligned block of samples, with those of its halves. A single sample is both its halves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BlockMean {
    /// The mean of all samples.
    pub mean: Rgb,
    /// The means of the first and of the second half.
    pub halves: [Rgb; 2],
}

impl BlockMean {
    /// The mean of two blocks of equal size, which are its halves.
    #[inline]
    pub fn of(halves: [Rgb; 2]) -> BlockMean {
        // Halves are exact, and no sum of them overflows.
        BlockMean { mean: halves[0] * 0.5 + halves[1] * 0.5, halves }
    }

    /// The mean of a power of two of samples. Their memory is overwritten.
    ///
    /// # Panics
    /// If their number is no power of two.
    pub fn of_samples(samples: &mut [Rgb]) -> BlockMean {
        assert!(samples.len().is_power_of_two(), "{} samples are no block", samples.len());
        let mut left = samples.len();
        while left > 2 {
            left /= 2;
            for i in 0..left {
                samples[i] = BlockMean::of([samples[2 * i], samples[2 * i + 1]]).mean;
            }
        }
        BlockMean::of([samples[0], samples[left - 1]])
    }
}

/// The sizes of the largest aligned blocks that make up samples `first` to `end`, which isn't included, in their order.
pub fn block_sizes(first: u32, end: u32) -> impl Iterator<Item = u32> + Clone {
    std::iter::successors(Some((first, 0)), move |(at, _)| {
        let left = end.checked_sub(*at).filter(|left| *left > 0)?;
        let aligned = if *at == 0 { u32::MAX } else { 1 << at.trailing_zeros() };
        let size = aligned.min(1 << left.ilog2());
        Some((at + size, size))
    })
    .skip(1)
    .map(|(_, size)| size)
}

/// The number of [`block_sizes`].
pub fn block_count(first: u32, end: u32) -> usize {
    if first >= end {
        return 0;
    }
    // Blocks grow up to the largest power of two that divides a number of the range, and shrink from there.
    let top = end >> (first ^ end).ilog2() << (first ^ end).ilog2();
    ((top - first).count_ones() + (end - top).count_ones()) as usize
}

/// Equal samples: what a pixel has room for doesn't count.
impl PartialEq for SampleBlocks {
    fn eq(&self, other: &SampleBlocks) -> bool {
        let key = |blocks: &SampleBlocks| (blocks.size(), blocks.first, blocks.keeps_halves());
        let means = |blocks: &SampleBlocks, pixel: usize| {
            let place = pixel * blocks.room;
            let used = place..place + blocks.block_count(blocks.counts[pixel]);
            (blocks.means[used.clone()].to_vec(), blocks.halves.get(used).map(<[_]>::to_vec))
        };
        key(self) == key(other)
            && self.counts == other.counts
            && (0..self.counts.len()).all(|pixel| means(self, pixel) == means(other, pixel))
    }
}

impl SampleBlocks {
    /// Pixels without samples.
    pub fn new([width, height]: [u32; 2], first: u32, keeps_halves: bool) -> SampleBlocks {
        let pixels = width as usize * height as usize;
        let halves = if keeps_halves { vec![[Rgb::BLACK; 2]; pixels] } else { Vec::new() };
        let (counts, means) = (vec![0; pixels], vec![Rgb::BLACK; pixels]);
        SampleBlocks { width, height, first, counts, room: 1, means, halves }
    }

    /// Pixels with these numbers of samples from number `first` on. `mean` returns the mean of a block of a pixel, and
    /// `halves` those of its halves; without it they aren't kept.
    ///
    /// # Panics
    /// If there are too few counts for the size.
    pub fn of(
        size: [u32; 2],
        first: u32,
        counts: &[u32],
        mean: impl Fn(usize, usize) -> Rgb,
        halves: Option<&dyn Fn(usize, usize) -> [Rgb; 2]>,
    ) -> SampleBlocks {
        let mut blocks = SampleBlocks::new(size, first, halves.is_some());
        for (pixel, &count) in counts[..blocks.counts.len()].iter().enumerate() {
            let number = blocks.block_count(count);
            blocks.grow(number);
            blocks.counts[pixel] = count;
            for block in 0..number {
                let place = pixel * blocks.room + block;
                blocks.means[place] = mean(pixel, block);
                if let Some(halves) = halves {
                    blocks.halves[place] = halves(pixel, block);
                }
            }
        }
        blocks
    }

    /// The layers that a file needs besides a picture, so that its samples can be gone on with: `samples`, if their
    /// number isn't the same everywhere, and a layer for the mean of each block, `block-1` to `block-17`, unless every
    /// pixel has one block and `picture` is what it is. A denoised picture isn't.
    pub fn layers(&self, picture: &[Rgb]) -> Vec<Layer> {
        let mut layers = Vec::new();
        if self.counts.iter().any(|count| *count != self.counts[0]) {
            let data = self.counts.iter().map(|count| *count as f32).collect();
            layers.push(Layer { name: "samples", channels: &["X"], data, ids: Vec::new() });
        }
        let most = self.most_blocks();
        let is_picture = most <= 1 && (0..self.counts.len()).all(|pixel| picture[pixel] == self.mean(pixel));
        for (block, name) in BLOCK_LAYERS.iter().enumerate().take(if is_picture { 0 } else { most }) {
            layers.push(self.layer(name, block, |place| self.means[place]));
        }
        layers
    }

    /// The layers of the halves of each block, if they are kept. With them another render denoises equally.
    pub fn half_layers(&self) -> Vec<Layer> {
        let blocks = if self.keeps_halves() { self.most_blocks() } else { 0 };
        let names = BLOCK_HALF_LAYERS.iter().enumerate().take(blocks);
        let halves = names.flat_map(|(block, names)| [0, 1].map(|half| (block, half, names[half])));
        halves.map(|(block, half, name)| self.layer(name, block, |place| self.halves[place][half])).collect()
    }

    /// A layer of values of one block of each pixel, by their places; black where a pixel has fewer blocks.
    fn layer(&self, name: &'static str, block: usize, value: impl Fn(usize) -> Rgb) -> Layer {
        let mut data = Vec::with_capacity(self.counts.len() * 3);
        for (pixel, &count) in self.counts.iter().enumerate() {
            let is_there = block < self.block_count(count);
            let color = if is_there { value(pixel * self.room + block) } else { Rgb::BLACK };
            data.extend(color.to_array());
        }
        Layer { name, channels: &["R", "G", "B"], data, ids: Vec::new() }
    }

    /// Makes room for this many blocks of each pixel.
    fn grow(&mut self, room: usize) {
        fn spread<T: Copy + Default>(old: &[T], from: usize, to: usize) -> Vec<T> {
            let mut new = vec![T::default(); old.len() / from * to];
            new.chunks_exact_mut(to)
                .zip(old.chunks_exact(from))
                .for_each(|(new, old)| new[..from].copy_from_slice(old));
            new
        }
        if room > self.room {
            self.means = spread(&self.means, self.room, room);
            self.halves = spread(&self.halves, self.room, room);
            self.room = room;
        }
    }

    /// The width and height in pixels.
    pub fn size(&self) -> [u32; 2] {
        [self.width, self.height]
    }

    /// The number of the first sample of each pixel.
    pub fn first(&self) -> u32 {
        self.first
    }

    /// The number of samples of each pixel.
    pub fn counts(&self) -> &[u32] {
        &self.counts
    }

    /// Whether the halves of blocks are kept.
    pub fn keeps_halves(&self) -> bool {
        !self.halves.is_empty()
    }

    /// The largest number of blocks of a pixel.
    pub fn most_blocks(&self) -> usize {
        self.counts.iter().map(|count| self.block_count(*count)).max().unwrap_or(0)
    }

    fn block_count(&self, count: u32) -> usize {
        block_count(self.first, self.first + count)
    }

    fn block_sizes(&self, count: u32) -> impl Iterator<Item = u32> + Clone + use<> {
        block_sizes(self.first, self.first + count)
    }

    /// The blocks of a pixel: the number of samples and the mean of each.
    pub fn blocks(&self, pixel: usize) -> impl Iterator<Item = (u32, Rgb)> {
        self.block_sizes(self.counts[pixel]).zip(self.means[pixel * self.room..].iter().copied())
    }

    /// Adds the next block of `size` samples to a pixel. The size is a power of two that divides the number of samples
    /// before it.
    pub(crate) fn push(&mut self, pixel: usize, size: u32, block: BlockMean) {
        let count = self.counts[pixel];
        let mut blocks = self.block_count(count);
        let (mut start, mut joined, mut block) = (self.first + count, size, block);
        debug_assert!(start.is_multiple_of(size));
        // As in binary addition: the block and the one before it, of equal size, are halves of a larger one.
        while start & joined != 0 && start - joined >= self.first {
            blocks -= 1;
            block = BlockMean::of([self.means[pixel * self.room + blocks], block.mean]);
            start -= joined;
            joined *= 2;
        }
        self.grow(blocks + 1);
        let place = pixel * self.room + blocks;
        self.means[place] = block.mean;
        if let Some(halves) = self.halves.get_mut(place) {
            *halves = block.halves;
        }
        self.counts[pixel] = count + size;
    }

    /// Adds the samples of a rectangle of these pixels that come next, with its upper left corner at x and y. Returns
    /// whether they do: everywhere the first of them has the number after the last of these, and none is added
    /// otherwise.
    pub fn merge(&mut self, part: &SampleBlocks, [x, y]: [u32; 2]) -> bool {
        let [width, height] = part.size();
        let fits = |at: u32, size: u32, whole: u32| at.checked_add(size).is_some_and(|end| end <= whole);
        if !fits(x, width, self.width) || !fits(y, height, self.height) {
            return false;
        }
        let own_width = self.width as usize;
        let row = |row: u32| {
            let start = (y + row) as usize * own_width + x as usize;
            let pixels = (row * width) as usize..((row + 1) * width) as usize;
            (start..).zip(pixels)
        };
        let comes_next =
            |(own, pixel): (usize, usize)| part.counts[pixel] == 0 || self.first + self.counts[own] == part.first;
        if !(0..height).flat_map(row).all(comes_next) {
            return false;
        }
        for (own, pixel) in (0..height).flat_map(row) {
            let place = pixel * part.room;
            for (block, (size, mean)) in part.blocks(pixel).enumerate() {
                let halves = part.halves.get(place + block).copied().unwrap_or(UNKNOWN);
                self.push(own, size, BlockMean { mean, halves });
            }
        }
        true
    }

    /// The picture of these samples, without layers.
    pub fn picture(&self) -> Picture {
        let pixels = (0..self.counts.len()).map(|pixel| self.mean(pixel)).collect();
        Picture { pixels, ..Picture::new(self.width, self.height) }
    }

    /// The mean of a pixel's samples; black without samples.
    pub fn mean(&self, pixel: usize) -> Rgb {
        self.weighted(pixel, |place| self.means[place])
    }

    /// The means of the first and of the second halves of a pixel's blocks: two estimates of the same light. None if
    /// they aren't kept. They are NaN if the halves of a block are unknown.
    pub fn half_means(&self, pixel: usize) -> Option<[Rgb; 2]> {
        self.keeps_halves().then(|| [0, 1].map(|half| self.weighted(pixel, |place| self.halves[place][half])))
    }

    /// The mean over blocks, weighted by the numbers of their samples.
    fn weighted(&self, pixel: usize, value: impl Fn(usize) -> Rgb) -> Rgb {
        let count = self.counts[pixel];
        let place = pixel * self.room;
        if count.is_power_of_two() && self.first.is_multiple_of(count) {
            return value(place);
        }
        if count == 0 {
            return Rgb::BLACK;
        }
        let mut sum = [0.0f64; 3];
        for (place, size) in (place..).zip(self.block_sizes(count)) {
            for (sum, v) in sum.iter_mut().zip(value(place).to_array()) {
                *sum += f64::from(size) * f64::from(v);
            }
        }
        Rgb::from(sum.map(|v| (v / f64::from(count)) as f32)).saturated()
    }

    /// A rectangle of these pixels: x, y, width and height. Halves that aren't kept are unknown in it if it keeps them.
    pub(crate) fn part(&self, [x, y, width, height]: [u32; 4], keeps_halves: bool) -> SampleBlocks {
        let mut part = SampleBlocks::new([width, height], self.first, keeps_halves);
        part.grow(self.room);
        for row in 0..height {
            let from = (y + row) as usize * self.width as usize + x as usize;
            part.copy(self, from, (row * width) as usize, width as usize);
        }
        part
    }

    /// Copies another rectangle of pixels into these, with its upper left corner at x and y.
    pub(crate) fn insert(&mut self, part: &SampleBlocks, [x, y]: [u32; 2]) {
        self.grow(part.most_blocks());
        for row in 0..part.height {
            let to = (y + row) as usize * self.width as usize + x as usize;
            self.copy(part, (row * part.width) as usize, to, part.width as usize);
        }
    }

    fn copy(&mut self, other: &SampleBlocks, from: usize, to: usize, pixels: usize) {
        self.counts[to..to + pixels].copy_from_slice(&other.counts[from..from + pixels]);
        let both = self.room.min(other.room);
        for i in 0..pixels {
            let (from, to) = ((from + i) * other.room, (to + i) * self.room);
            self.means[to..to + both].copy_from_slice(&other.means[from..from + both]);
            if self.keeps_halves() {
                match other.halves.get(from..from + both) {
                    Some(halves) => self.halves[to..to + both].copy_from_slice(halves),
                    None => self.halves[to..to + both].fill(UNKNOWN),
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(i: u32) -> Rgb {
        Rgb::new(i as f32 * 0.37 + 0.1, 1.0 / (i as f32 + 3.0), (i * i % 17) as f32)
    }

    /// Samples `first` to `end` in blocks of these sizes.
    fn blocks(first: u32, sizes: &[u32]) -> SampleBlocks {
        let mut film = SampleBlocks::new([1, 1], first, true);
        let mut at = first;
        for &size in sizes {
            let mut samples: Vec<Rgb> = (at..at + size).map(sample).collect();
            film.push(0, size, BlockMean::of_samples(&mut samples));
            at += size;
        }
        film
    }

    #[test]
    fn samples_make_the_largest_aligned_blocks() {
        let of = |first, end| block_sizes(first, end).collect::<Vec<_>>();
        assert_eq!(of(0, 96), [64, 32]);
        assert_eq!(of(0, 1), [1]);
        assert_eq!(of(3, 13), [1, 4, 4, 1]);
        assert_eq!(of(32, 64), [32]);
        assert_eq!(of(48, 80), [16, 16]);
        assert_eq!(of(5, 5), [0u32; 0]);
        assert_eq!(of(0, 65_536), [65_536]);
        for first in 0..70 {
            (0..140).for_each(|end| assert_eq!(block_count(first, end), of(first, end).len(), "{first} to {end}"));
        }
    }

    #[test]
    fn blocks_are_equal_however_they_were_made() {
        let at_once = blocks(0, &[64]);
        assert_eq!(at_once.means[0], BlockMean::of_samples(&mut (0..64).map(sample).collect::<Vec<_>>()).mean);
        for sizes in [vec![1; 64], vec![1, 1, 2, 4, 8, 16, 32], vec![32, 32], vec![16, 8, 8, 32]] {
            let passes = blocks(0, &sizes);
            assert_eq!(passes.mean(0), at_once.mean(0), "{sizes:?}");
            assert_eq!(passes.half_means(0), at_once.half_means(0), "{sizes:?}");
        }
        // Two runs added.
        let (a, b) = (blocks(0, &[32]), blocks(32, &[16, 16]));
        assert_eq!(BlockMean::of([a.mean(0), b.mean(0)]).mean, at_once.mean(0));
        let mut on = SampleBlocks::new([1, 1], 0, true);
        on.insert(&a, [0, 0]);
        on.push(0, 32, BlockMean { mean: b.mean(0), halves: b.half_means(0).unwrap() });
        assert_eq!((on.mean(0), on.half_means(0)), (at_once.mean(0), at_once.half_means(0)));
    }

    #[test]
    fn means_and_halves_are_those_of_the_samples() {
        let film = blocks(0, &[16, 16, 16, 8, 4]);
        assert_eq!(film.blocks(0).map(|(size, _)| size).collect::<Vec<_>>(), [32, 16, 8, 4]);
        let mean_of = |which: &dyn Fn(u32) -> bool| {
            let (mut sum, mut count) = (0.0, 0.0);
            for i in (0..60).filter(|i| which(*i)) {
                sum += f64::from(sample(i).r);
                count += 1.0;
            }
            sum / count
        };
        let is_first = |i: u32| match i {
            0..32 => i < 16,
            32..48 => i < 40,
            48..56 => i < 52,
            _ => i < 58,
        };
        let [a, b] = film.half_means(0).unwrap();
        for (got, exact) in
            [(film.mean(0), mean_of(&|_| true)), (a, mean_of(&is_first)), (b, mean_of(&|i| !is_first(i)))]
        {
            assert!((f64::from(got.r) - exact).abs() < 1e-5 * exact, "{got:?} {exact}");
        }
    }

    #[test]
    fn halves_that_arent_kept_are_unknown_until_a_block_is_whole() {
        let mut film = blocks(0, &[16]);
        film.halves.clear();
        let mut on = film.part([0, 0, 1, 1], true);
        assert!(on.half_means(0).unwrap()[0].r.is_nan());
        on.push(0, 16, BlockMean::of([Rgb::gray(2.0); 2]));
        assert_eq!(on.half_means(0), Some([film.mean(0), Rgb::gray(2.0)]));
    }
}
