//! Eight samples side by side, whose numbers of one use are found at once.

use super::{Dimension, Sample, Sampler, sobol};
use crate::scene::SamplerKind;

/// The number of lanes.
const LANES: usize = 8;

/// Eight samples of one kind of sampler.
#[derive(Clone, Copy)]
pub(crate) struct Samples8 {
    kind: SamplerKind,
    key: [u64; LANES],
    index: [u32; LANES],
    count: [u32; LANES],
}

impl Samples8 {
    /// Eight times the same sample.
    pub(crate) fn splat(sample: Sample) -> Samples8 {
        let Sample { sampler: Sampler { key, kind }, index, count } = sample;
        Samples8 { kind, key: [key; LANES], index: [index; LANES], count: [count; LANES] }
    }

    /// Sets the sample in a lane. All have one kind.
    #[inline(always)]
    pub(crate) fn set(&mut self, lane: usize, sample: Sample) {
        debug_assert!(sample.sampler.kind == self.kind);
        (self.key[lane], self.index[lane], self.count[lane]) = (sample.sampler.key, sample.index, sample.count);
    }

    #[inline(always)]
    fn sampler(&self, lane: usize) -> Sampler {
        Sampler { key: self.key[lane], kind: self.kind }
    }

    fn sample(&self, lane: usize) -> Sample {
        self.sampler(lane).sample(self.index[lane], self.count[lane])
    }

    /// [`Sample::one`] of each sample. It must be called from a kernel.
    #[inline(always)]
    pub(crate) fn one(&self, dimensions: &[Dimension; LANES]) -> [f64; LANES] {
        let mut numbers = [0.0; LANES];
        if self.kind == SamplerKind::Sobol {
            for i in 0..LANES {
                numbers[i] = sobol::one(self.index[i], self.sampler(i).key_of(dimensions[i]));
            }
        } else {
            for (i, number) in numbers.iter_mut().enumerate() {
                *number = self.sample(i).one(dimensions[i]);
            }
        }
        numbers
    }

    /// [`Sample::one_and_two`] of each sample: the single numbers, and the coordinates of the points. The single
    /// numbers may be 0 unless `has_one`. It must be called from a kernel.
    #[inline(always)]
    pub(crate) fn one_and_two(
        &self,
        dimensions: &[Dimension; LANES],
        has_one: bool,
    ) -> ([f64; LANES], [[f64; LANES]; 2]) {
        let (mut ones, mut u, mut v) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
        if self.kind == SamplerKind::Sobol && !has_one {
            for i in 0..LANES {
                [u[i], v[i]] = sobol::points(self.index[i], self.sampler(i).key_of(dimensions[i]));
            }
        } else if self.kind == SamplerKind::Sobol {
            for i in 0..LANES {
                [u[i], v[i], ones[i]] = sobol::three(self.index[i], self.sampler(i).key_of(dimensions[i]));
            }
        } else {
            for i in 0..LANES {
                (ones[i], [u[i], v[i]]) = self.sample(i).one_and_two(dimensions[i]);
            }
        }
        (ones, [u, v])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampler::FrameSampler;
    use canaletto_bvh::{InstructionSet, Kernel};

    struct Numbers(Samples8, [Dimension; LANES]);

    impl Kernel for Numbers {
        type Answer = ([f64; LANES], ([f64; LANES], [[f64; LANES]; 2]), [[f64; LANES]; 2]);

        #[inline(always)]
        fn run(self) -> Self::Answer {
            (self.0.one(&self.1), self.0.one_and_two(&self.1, true), self.0.one_and_two(&self.1, false).1)
        }
    }

    /// Each lane has the numbers of its own sample, to the bit.
    #[test]
    fn numbers_side_by_side_are_those_one_by_one() {
        for kind in [SamplerKind::Sobol, SamplerKind::BlueNoise, SamplerKind::Jittered, SamplerKind::Independent] {
            let all = FrameSampler::new(9, 0, kind);
            let samples: [Sample; LANES] = std::array::from_fn(|i| {
                let i = i as u32;
                all.pixel([3 * i, 7 + i]).sample(5 * i, 64)
            });
            let dimensions = std::array::from_fn(|i| Dimension::EYE.of(i as u32 / 2));
            let mut eight = Samples8::splat(samples[0]);
            samples.iter().enumerate().for_each(|(i, sample)| eight.set(i, *sample));
            for set in InstructionSet::available() {
                set.limit();
                let (ones, (thirds, [u, v]), points) = InstructionSet::run(Numbers(eight, dimensions));
                for (i, sample) in samples.iter().enumerate() {
                    assert_eq!(points.map(|row| row[i]), [u[i], v[i]]);
                    assert_eq!(ones[i], sample.one(dimensions[i]), "{kind:?}, lane {i}");
                    assert_eq!((thirds[i], [u[i], v[i]]), sample.one_and_two(dimensions[i]), "{kind:?}, lane {i}");
                }
            }
        }
    }
}
