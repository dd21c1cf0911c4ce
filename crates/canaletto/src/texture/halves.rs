//! The first three coarser levels of an image whose sides are multiples of eight, in one pass. Each tile of the image
//! is decoded once, and halved three times without rounding.

use super::codec::{Codec, Slot};
use super::level::{Level, TILE, index};
use super::{Samples, pyramid::COMPACT};
use canaletto_parallel::prelude::*;

/// The number of levels made here: those that keep the image's format, and the first one in `f32`.
const LEVELS: usize = COMPACT;
/// The number of texels of a tile.
const TEXELS: usize = (TILE * TILE) as usize;

/// The first coarser levels of an image with [whole tiles](has_whole_tiles). `rows` holds, for each level, the shares
/// of the two rows that make one.
pub(super) fn first_levels(base: &Level, codec: &Codec, rows: &[Vec<[f32; 2]>; LEVELS]) -> [Level; LEVELS] {
    let halves = Halves { base, codec, rows };
    match &base.samples {
        Samples::U8(_) => halves.run(|d| Slot::U8(d), Samples::U8),
        Samples::U16(_) => halves.run(|d| Slot::U16(d), Samples::U16),
        Samples::F16(_) => halves.run(|d| Slot::F16(d), Samples::F16),
        Samples::F32(_) => halves.run(|d| Slot::F32(d), Samples::F32),
    }
}

/// Whether the image has whole tiles, and levels after the first three.
pub(super) fn has_whole_tiles(level: &Level) -> bool {
    level.width.is_multiple_of(TILE) && level.height.is_multiple_of(TILE)
}

struct Halves<'a> {
    base: &'a Level,
    codec: &'a Codec,
    rows: &'a [Vec<[f32; 2]>; LEVELS],
}

/// A part of each of the three levels.
struct Part<'a, T> {
    compact: [&'a mut [T]; 2],
    wide: &'a mut [f32],
}

impl Halves<'_> {
    fn run<T: Copy + Default + Send>(
        &self,
        slot: impl for<'s> Fn(&'s mut [T]) -> Slot<'s> + Sync,
        samples: impl Fn(Vec<T>) -> Samples,
    ) -> [Level; LEVELS] {
        let channels = self.codec.channels;
        let size = |level: u32| [self.base.width >> level, self.base.height >> level];
        let count = |level: u32| size(level).map(|n| n as usize).iter().product::<usize>() * channels;
        let (mut first, mut second) = (vec![T::default(); count(1)], vec![T::default(); count(2)]);
        let mut third = vec![0.0; count(3)];
        // A row of tiles of the coarsest level, and the finer texels under it, are contiguous in each level.
        let band = |level: u32| ((TILE << (3 - level)) * size(level)[0]) as usize * channels;
        let parts =
            first.par_chunks_mut(band(1)).zip(second.par_chunks_mut(band(2))).zip(third.par_chunks_mut(band(3)));
        parts.enumerate().for_each(|(number, ((first, second), third))| {
            self.band(number as u32, Part { compact: [first, second], wide: third }, &slot);
        });
        let level = |number: u32, samples: Samples| Level { width: size(number)[0], height: size(number)[1], samples };
        [level(1, samples(first)), level(2, samples(second)), level(3, Samples::F32(third))]
    }

    fn band<T>(&self, number: u32, part: Part<T>, slot: &impl for<'s> Fn(&'s mut [T]) -> Slot<'s>) {
        let Halves { base, codec, rows } = self;
        let channels = codec.channels;
        let Part { compact: [first, second], wide } = part;
        let top = number * TILE * TILE;
        let height = (TILE * TILE).min(base.height - top);
        let mut texels = [[0.0; 4]; TEXELS];
        for y in (0..height).step_by(TILE as usize) {
            for x in (0..base.width).step_by(TILE as usize) {
                codec.texels(&base.samples, base.index(x, top + y), &mut texels);
                let mut side = TILE;
                for (level, rows) in (1..).zip(rows.iter()) {
                    side /= 2;
                    let [left, above] = [x >> level, y >> level];
                    let [across, down] = [base.width >> level, height >> level];
                    for j in 0..side {
                        let shares = rows[((top >> level) + above + j) as usize];
                        for i in 0..side {
                            let at = |i: u32, j: u32| texels[(j * 2 * side + i) as usize];
                            let [a, b] = [at(2 * i, 2 * j), at(2 * i + 1, 2 * j)];
                            let [c, d] = [at(2 * i, 2 * j + 1), at(2 * i + 1, 2 * j + 1)];
                            let mean: [f32; 4] =
                                std::array::from_fn(|n| 0.5 * ((a[n] + b[n]) * shares[0] + (c[n] + d[n]) * shares[1]));
                            texels[(j * side + i) as usize] = mean;
                            let start = index(across, down, left + i, above + j) as usize * channels;
                            let range = start..start + channels;
                            match level {
                                1 => codec.store(mean, &mut slot(&mut first[range])),
                                2 => codec.store(mean, &mut slot(&mut second[range])),
                                _ => codec.store(mean, &mut Slot::F32(&mut wide[range])),
                            }
                        }
                    }
                }
            }
        }
    }
}
