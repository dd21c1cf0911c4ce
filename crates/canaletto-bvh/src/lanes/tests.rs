//! Each lane of each instruction set has the bits of the single number.

use super::*;
use crate::InstructionSet;
use crate::testing::Random;

/// Numbers whose operations are the hard ones: zeros, subnormals, infinities, NaN, and any bits.
fn numbers(random: &mut Random) -> [f64; LANES] {
    std::array::from_fn(|_| match random.below(8) {
        0 => [0.0, -0.0, f64::INFINITY, f64::NEG_INFINITY, f64::NAN, 5e-324, f64::MAX, 1.0][random.below(8)],
        1 => f64::from_bits(random.bits()),
        _ => f64::from(f32::from_bits(random.bits() as u32)),
    })
}

/// The results of all operations for two numbers in each lane.
struct All([[f64; LANES]; 2]);

/// Bits of results. All NaN are one.
fn bits<F: Real<Scalar = f64>>(all: &mut Vec<[u64; LANES]>, value: F) {
    all.push(value.to_array().map(|x| if x.is_nan() { 1 } else { x.to_bits() }));
}

fn bits32<F: Real<Scalar = f32>>(all: &mut Vec<[u64; LANES]>, value: F) {
    all.push(value.to_array().map(|x| if x.is_nan() { 1 } else { u64::from(x.to_bits()) }));
}

fn mask<M: Mask>(all: &mut Vec<[u64; LANES]>, mask: M) {
    assert_eq!(M::from_bits(mask.bits()).bits(), mask.bits());
    assert_eq!(mask.any(), mask.bits() != 0);
    assert_eq!(M::gather(|lane| mask.bits() >> lane & 1 == 1).bits(), mask.bits());
    all.push(std::array::from_fn(|lane| u64::from(mask.bits() >> lane & 1)));
}

impl LaneKernel for All {
    type Answer = Vec<[u64; LANES]>;

    #[inline(always)]
    fn run<F: Real64>(self) -> Self::Answer {
        let [a, b] = self.0.each_ref().map(|numbers| F::load(numbers));
        let mut all = Vec::new();
        for value in [a + b, a - b, a * b, a / b, -a, a.sqrt(), a.abs(), a.min(b), a.max(b)] {
            bits(&mut all, value);
        }
        for value in [a + 3.5, a - 3.5, a * 3.5, a / 3.5, F::splat(-2.0)] {
            bits(&mut all, value);
        }
        let up = a.to_bits().up::<12>() | b.to_bits().down::<60>();
        let other = (a.to_bits() ^ b.to_bits()) & F::Bits::splat(0x7fff_0000_ffff_fff0);
        bits(&mut all, F::from_bits(up));
        bits(&mut all, F::from_bits(other));
        let (less, most) = (a.less(b), a.at_most(b));
        for value in [less, most, a.equal(b), less | a.equal(b), most & !less, F::Mask::splat(true) & less] {
            mask(&mut all, value);
            bits(&mut all, F::select(value, a, b));
            bits32(&mut all, F::Narrow::select(value, a.narrow(), b.narrow()));
        }
        let (c, d) = (a.narrow(), b.narrow());
        for value in [c, c + d, c - d, c * d, c / d, -c, c.sqrt(), c.abs(), c.min(d), c.max(d), c * 0.3] {
            bits32(&mut all, value);
        }
        for value in [c.less(d), c.at_most(d), c.equal(d), F::Mask::splat(false) | c.less(d)] {
            mask(&mut all, value);
        }
        bits(&mut all, c.widen());
        bits(&mut all, F::gather(|lane| lane as f64));
        all
    }
}

#[test]
fn lanes_have_the_bits_of_single_numbers() {
    let mut random = Random(7);
    for _ in 0..2000 {
        let [a, b] = [numbers(&mut random), numbers(&mut random)];
        // The numbers of each lane alone, but for the last result, which is the lane itself.
        let alone: Vec<Vec<u64>> = (0..LANES)
            .map(|lane| {
                let one = |numbers: [f64; LANES]| [numbers[lane]; LANES];
                All([one(a), one(b)]).run::<f64>().iter().map(|value| value[0]).collect()
            })
            .collect();
        for set in InstructionSet::available() {
            set.limit();
            let together = run_lanes(All([a, b]));
            for (result, value) in together.iter().enumerate() {
                for lane in 0..LANES {
                    let expected =
                        if result + 1 == together.len() { (lane as f64).to_bits() } else { alone[lane][result] };
                    let of = (a[lane], b[lane]);
                    assert_eq!(value[lane], expected, "result {result} of lane {lane} for {of:?}, {}", set.name());
                }
            }
        }
        InstructionSet::Avx512.limit();
    }
}
