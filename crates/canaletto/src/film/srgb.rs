//! The sRGB curve (IEC 61966-2-1) for many values at once.

use crate::math::power;
use canaletto_bvh::{InstructionSet, Kernel};

/// Applies [`srgb_encode`](super::srgb_encode) to many values in [0, 1], in place, with equal bits.
pub(super) fn encode_all(values: &mut [f32]) {
    InstructionSet::run(Curve(values));
}

struct Curve<'a>(&'a mut [f32]);

impl Kernel for Curve<'_> {
    type Answer = ();

    #[inline(always)]
    fn run(self) {
        for v in self.0 {
            // 1 would need another exponent; its power is 1.
            let inside = (*v > LINEAR) & (*v < 1.0);
            let (power, _) = power(if inside { *v } else { LINEAR }, 1.0 / 2.4);
            let curve = if *v < 1.0 { 1.055 * power - 0.055 } else { 1.055 - 0.055 };
            *v = if *v > LINEAR { curve } else { 12.92 * *v };
        }
    }
}

/// The upper end of the curve's linear part.
const LINEAR: f32 = 0.003_130_8;

#[cfg(test)]
mod tests {
    use super::super::srgb_encode;

    fn compare(first: u32, step: usize) {
        for start in (first..=1.0f32.to_bits()).step_by(64 * step) {
            let mut values = [1.0; 64];
            for (value, bits) in values.iter_mut().zip((start..=1.0f32.to_bits()).step_by(step)) {
                *value = f32::from_bits(bits);
            }
            let expected = values.map(srgb_encode);
            super::encode_all(&mut values);
            assert_eq!(values.map(f32::to_bits), expected.map(f32::to_bits), "from {start:#x}");
        }
    }

    #[test]
    fn the_bits_are_those_of_libm() {
        compare(0, 1009);
        compare(0.999_f32.to_bits(), 1);
    }

    /// Tests all 70 million values above the linear part; it takes seconds in a release build.
    #[test]
    #[cfg_attr(debug_assertions, ignore)]
    fn every_value_has_the_bits_of_libm() {
        compare(0.003_130_f32.to_bits(), 1);
    }
}
