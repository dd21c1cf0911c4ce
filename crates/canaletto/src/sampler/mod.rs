//! Random numbers without a state: each is a hash of its use, so that tiles can be rendered in any order.
//!
//! Distribution ray tracing (5.6; Cook, Porter & Carpenter 1984) integrates over many dimensions: the pixel's area, the
//! lens, time, the points of each light at each hit, the lobe of each glossy ray. [`Sample`] is one ray from the eye.
//! It returns one or two numbers for any [`Dimension`]. The pixel's [`SamplerKind`] distributes these numbers over all
//! samples of the pixel.

mod blue_noise;
mod grid;
mod hash;
mod samples8;
mod sobol;
#[cfg(test)]
mod tests;

use crate::scene::SamplerKind;
use hash::{mix, unit};
pub(crate) use samples8::Samples8;

/// A source of numbers keyed by (seed, frame, pixel, sample, dimension).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sampler {
    key: u64,
    kind: SamplerKind,
}

/// The sources of numbers of a frame's pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameSampler {
    key: u64,
    kind: SamplerKind,
}

/// The use of a number. Different uses share no numbers, and each has its own distribution over the samples of the
/// pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Dimension(u64);

impl Dimension {
    /// The root dimension of the ray from the eye.
    pub const EYE: Dimension = Dimension(0);
    /// The place in the pixel of rays that sample a filter's negative part.
    pub const BELOW: Dimension = Dimension::EYE.of(3);

    /// The dimension of use number `n` under this one: a child ray, a light, a lobe.
    #[inline(always)]
    pub const fn of(self, n: u32) -> Dimension {
        Dimension(mix(self.0 ^ (n as u64) << 32))
    }
}

/// One of the samples of a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sample {
    sampler: Sampler,
    index: u32,
    count: u32,
}

/// The numbers of a ray from the eye, each in [0, 1).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraNumbers {
    /// The place in the pixel.
    pub film: [f64; 2],
    /// The place on the lens.
    pub lens: [f64; 2],
    /// The time.
    pub time: f64,
}

impl FrameSampler {
    /// The sources of this frame, with numbers distributed by this kind.
    pub fn new(seed: u64, frame: u32, kind: SamplerKind) -> FrameSampler {
        FrameSampler { key: mix(mix(seed) ^ u64::from(frame)), kind }
    }

    /// The source of numbers for a pixel.
    #[inline]
    pub fn pixel(&self, [x, y]: [u32; 2]) -> Sampler {
        let position = u64::from(x) << 32 | u64::from(y);
        let key = match self.kind {
            // Pixels differ by their place on a curve alone.
            SamplerKind::BlueNoise => self.key & !0xffff_ffff | u64::from(blue_noise::morton([x, y])),
            _ => mix(self.key ^ position),
        };
        Sampler { key, kind: self.kind }
    }
}

impl Sampler {
    /// The source of numbers of the default kind for one pixel of one frame.
    pub fn new(seed: u64, frame: u32, pixel: [u32; 2]) -> Sampler {
        FrameSampler::new(seed, frame, SamplerKind::default()).pixel(pixel)
    }

    /// Returns the source with numbers distributed by another kind.
    #[inline]
    pub fn of_kind(self, kind: SamplerKind) -> Sampler {
        Sampler { kind, ..self }
    }

    /// A number in [0, 1), uniform and independent of all others, for this use of the sample.
    pub fn uniform(&self, sample: u32, dimension: u32) -> f64 {
        unit(mix(self.key ^ (u64::from(sample) << 32 | u64::from(dimension))))
    }

    /// Point `index` of [0, 1)⁴ of Sobol's sequence, scrambled, in place of the source's own kind. All four numbers
    /// are distributed jointly.
    pub fn four(&self, dimension: Dimension, index: u32) -> [f64; 4] {
        sobol::joint(index, self.key_of(dimension))
    }

    /// Sample number `index` of `count`.
    #[inline]
    pub fn sample(self, index: u32, count: u32) -> Sample {
        Sample { sampler: self, index, count }
    }
}

impl Sample {
    /// A number in [0, 1).
    pub fn one(&self, dimension: Dimension) -> f64 {
        let Sample { sampler, index, count } = *self;
        let key = sampler.key_of(dimension);
        match sampler.kind {
            SamplerKind::Sobol => sobol::one(index, key),
            SamplerKind::BlueNoise => blue_noise::points::<1>(sampler.key as u32, index, count, key)[0],
            SamplerKind::Jittered => grid::one(index, count, key),
            SamplerKind::Independent => unit(mix(key ^ u64::from(index))),
        }
    }

    /// A point of [0, 1)².
    #[inline]
    pub fn two(&self, dimension: Dimension) -> [f64; 2] {
        self.sampler.two(dimension, self.index, self.count)
    }

    /// A number and a point of [0, 1)² for a choice and what depends on it, such as a light and a point of it. Sobol's
    /// sequence distributes the three jointly: those samples that choose one light have well distributed points.
    #[inline]
    pub fn one_and_two(&self, dimension: Dimension) -> (f64, [f64; 2]) {
        let Sample { sampler, index, .. } = *self;
        if sampler.kind == SamplerKind::Sobol {
            let [u, v, w] = sobol::three(index, sampler.key_of(dimension));
            return (w, [u, v]);
        }
        (self.one(dimension), self.two(dimension.of(0)))
    }

    /// [`Sample::two`] for use number `n` of `of` in the sample, such as one of a light's points. The uses of all
    /// samples together are distributed like `of` times as many samples.
    #[inline]
    pub fn two_of(&self, dimension: Dimension, n: u32, of: u32) -> [f64; 2] {
        let index = self.index.wrapping_mul(of).wrapping_add(n);
        self.sampler.two(dimension, index, self.count.saturating_mul(of))
    }

    /// Point `n` of `of` points that are distributed among themselves, independent of those of other samples. Their
    /// number may depend on other numbers of the sample.
    pub fn two_within(&self, dimension: Dimension, n: u32, of: u32) -> [f64; 2] {
        self.sampler.two(dimension.of(self.index), n, of)
    }

    /// The numbers of the ray from the eye.
    pub fn eye(&self) -> CameraNumbers {
        CameraNumbers { film: self.film(), lens: self.two(Dimension::EYE.of(1)), time: self.one(Dimension::EYE.of(2)) }
    }

    /// The place in the pixel of the ray from the eye: [`CameraNumbers::film`] alone.
    pub fn film(&self) -> [f64; 2] {
        self.two(Dimension::EYE)
    }

    /// A point of [0, 1)² for number `index` of `count` samples that are distributed by themselves, such as a part of
    /// the pixel's.
    #[inline]
    pub fn two_among(&self, dimension: Dimension, index: u32, count: u32) -> [f64; 2] {
        self.sampler.two(dimension, index, count)
    }
}

impl Sampler {
    #[inline(always)]
    fn key_of(&self, dimension: Dimension) -> u64 {
        // The constant differs from those of `uniform`, whose numbers may be used beside these.
        let own = if self.kind == SamplerKind::BlueNoise { self.key >> 32 } else { self.key };
        mix(own ^ dimension.0.rotate_left(17) ^ 0x5bf0_3635_dca5_4a8d)
    }

    #[inline]
    fn two(&self, dimension: Dimension, index: u32, count: u32) -> [f64; 2] {
        let key = self.key_of(dimension);
        match self.kind {
            SamplerKind::Sobol => sobol::points(index, key),
            SamplerKind::BlueNoise => blue_noise::points(self.key as u32, index, count, key),
            SamplerKind::Jittered => grid::two(index, count, key),
            SamplerKind::Independent => {
                let bits = mix(key ^ u64::from(index));
                [unit(bits), unit(mix(bits))]
            }
        }
    }
}
