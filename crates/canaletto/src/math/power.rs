//! Powers of many numbers at once, with the bits of [`libm::powf`] and in a third of its time or less.

use canaletto_bvh::{InstructionSet, Kernel};

/// Raises each of `values` to the power of its exponent, with the bits of [`libm::powf`].
///
/// # Panics
/// If the numbers of exponents and values differ.
pub(crate) fn power_all(values: &mut [f32], exponents: &[f32]) {
    assert_eq!(values.len(), exponents.len());
    InstructionSet::run(Powers { values, exponents });
}

struct Powers<'a> {
    values: &'a mut [f32],
    exponents: &'a [f32],
}

/// The number of powers that are computed side by side.
const WIDTH: usize = 16;

impl Kernel for Powers<'_> {
    type Answer = ();

    #[inline(always)]
    fn run(self) {
        for (values, exponents) in self.values.chunks_mut(WIDTH).zip(self.exponents.chunks(WIDTH)) {
            let (mut x, mut y) = ([0.5; WIDTH], [3.0; WIDTH]);
            x[..values.len()].copy_from_slice(values);
            y[..values.len()].copy_from_slice(exponents);
            let (mut powers, mut sure) = ([0.0; WIDTH], [0u32; WIDTH]);
            for i in 0..WIDTH {
                let regular = is_regular(x[i], y[i]);
                let (power, normal) = power(if regular { x[i] } else { 0.5 }, if regular { y[i] } else { 3.0 });
                (powers[i], sure[i]) = (power, u32::from(regular & normal));
            }
            for (i, value) in values.iter_mut().enumerate() {
                *value = if sure[i] == 1 { powers[i] } else { libm::powf(x[i], y[i]) };
            }
        }
    }
}

/// Whether [`power`] handles these arguments.
#[inline(always)]
fn is_regular(x: f32, y: f32) -> bool {
    // [`libm::powf`] uses other operations for the exponents 1/2, 1 and 2.
    (f32::MIN_POSITIVE..1.0).contains(&x) & (y > 0.0) & (y <= 134_217_728.0) & (y != 1.0) & (y != 2.0) & (y != 0.5)
}

/// x to the power of y for normal x below 1 and 0 < y ≤ 2²⁷ except 1/2, 1 and 2, and whether the result is valid. It is
/// valid unless the power is subnormal or nearly so. Valid results have the bits of [`libm::powf`]. There is no branch
/// for other numbers, so that the compiler vectorises. Names are those of libm's source (FreeBSD's e_powf.c).
#[inline(always)]
#[allow(clippy::excessive_precision)] // as in the source
pub(crate) fn power(x: f32, y: f32) -> (f32, bool) {
    const CP: f32 = 9.6179670095e-01; // 2 / (3 ln 2)
    const CP_H: f32 = 9.6191406250e-01;
    const CP_L: f32 = -1.1736857402e-04;
    let cut = |x: f32, mask: u32| f32::from_bits(x.to_bits() & mask);
    const HIGH: u32 = 0xffff_f000;

    // log₂ x = n + log₂ of a number near bp, which is 1 or 1.5.
    let bits = x.to_bits() as i32;
    let j = bits & 0x007f_ffff;
    let upper = j >= 0x005d_b3d7; // √3
    let middle = j > 0x001c_c471 && !upper; // √1.5
    let n = ((bits >> 23) - 127 + i32::from(upper)) as f32;
    let ix = (j | 0x3f80_0000) - if upper { 0x0080_0000 } else { 0 };
    let ax = f32::from_bits(ix as u32);
    let (bp, dp_h, dp_l) = (
        if middle { 1.5 } else { 1.0 },
        if middle { 5.84960938e-01 } else { 0.0 },
        if middle { 1.56322085e-06 } else { 0.0 },
    );
    let u = ax - bp;
    let v = 1.0 / (ax + bp);
    let s = u * v;
    let s_h = cut(s, HIGH);
    let t_h = (((ix >> 1) as u32 & HIGH) | 0x2000_0000) + 0x0040_0000 + if middle { 1 << 21 } else { 0 };
    let t_h = f32::from_bits(t_h);
    let t_l = ax - (t_h - bp);
    let s_l = v * ((u - s_h * t_h) - s_h * t_l);
    let s2 = s * s;
    let r = 2.3066075146e-01 + s2 * 2.0697501302e-01;
    let r = s2
        * s2
        * (6.0000002384e-01 + s2 * (4.2857143283e-01 + s2 * (3.3333334327e-01 + s2 * (2.7272811532e-01 + s2 * r))));
    let r = r + s_l * (s_h + s);
    let s2 = s_h * s_h;
    let t_h = cut(3.0 + s2 + r, HIGH);
    let t_l = r - ((t_h - 3.0) - s2);
    let u = s_h * t_h;
    let v = s_l * t_h + t_l * s;
    let p_h = cut(u + v, HIGH);
    let p_l = v - (p_h - u);
    let z_h = CP_H * p_h;
    let z_l = CP_L * p_h + p_l * CP + dp_l;
    let t1 = cut(((z_h + z_l) + dp_h) + n, HIGH);
    let t2 = z_l - (((t1 - n) - dp_h) - z_h);

    // 2 to the power of y log₂ x.
    let y1 = cut(y, HIGH);
    let p_l = (y - y1) * t1 + y * t2;
    let p_h = y1 * t1;
    let z = p_l + p_h;
    let (normal, vanishes) = (z > -125.0, z < -150.0);
    let z = if normal { z } else { 0.0 };
    let n = if z < -0.5 { (0.5 - z) as i32 } else { 0 };
    let p_h = p_h + n as f32;
    let t = cut(p_l + p_h, 0xffff_8000);
    let u = t * 6.93145752e-01;
    let v = (p_l - (t - p_h)) * 6.9314718246e-01 + t * 1.42860654e-06;
    let z = u + v;
    let w = v - (z - u);
    let t = z * z;
    let t1 = -1.6533901999e-06 + t * 4.1381369442e-08;
    let t1 = z - t * (1.6666667163e-01 + t * (-2.7777778450e-03 + t * (6.6137559770e-05 + t * t1)));
    let r = (z * t1) / (t1 - 2.0) - (w + z * w);
    let power = f32::from_bits(((1.0 - (r - z)).to_bits() as i32 - (n << 23)) as u32);
    (if vanishes { 0.0 } else { power }, normal | vanishes)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn compare(pairs: impl Iterator<Item = (f32, f32)>) -> usize {
        let (mut values, exponents): (Vec<f32>, Vec<f32>) = pairs.unzip();
        let expected: Vec<f32> = values.iter().zip(&exponents).map(|(&x, &y)| libm::powf(x, y)).collect();
        let bases = values.clone();
        power_all(&mut values, &exponents);
        for i in 0..values.len() {
            assert_eq!(values[i].to_bits(), expected[i].to_bits(), "{} to the power of {}", bases[i], exponents[i]);
        }
        expected.iter().filter(|v| **v > 0.0 && **v < 1.0).count()
    }

    #[test]
    fn the_bits_are_those_of_libm() {
        let bits = |i: u32| i.wrapping_mul(2_654_435_761).wrapping_add(i >> 7);
        // Cosines and exponents of highlights first, then arbitrary numbers.
        let cosine = |i: u32| (bits(i) >> 8) as f32 / (1 << 24) as f32;
        let exponents = [0.1, 0.5, 1.0, 1.0 / 2.4, 2.0, 2.2, 5.0, 17.3, 40.0, 200.0, 1e4, 1e9, 0.0];
        for set in InstructionSet::available() {
            set.limit();
            let inside = compare((0..400_000).map(|i| (cosine(i), exponents[i as usize % exponents.len()])));
            assert!(inside > 200_000, "{inside}");
            compare((0..400_000).map(|i| (f32::from_bits(bits(i)), f32::from_bits(bits(!i)))));
            // Powers that become subnormal and vanish.
            compare((0..100_000).map(|i| (0.5 + cosine(i) * 1e-3, 120.0 + (i % 400) as f32 * 0.1)));
            // Numbers next to 1, and next to the borders of the intervals.
            for border in [1.0f32, 1.5, 3.0f32.sqrt(), 1.5f32.sqrt(), 0.5].map(|v| (v * 0.5).to_bits()) {
                compare((0..2000).map(|i| (f32::from_bits(border + i - 1000), exponents[i as usize % 13])));
                compare((0..2000).map(|i| (f32::from_bits((1 << 23) + border + i - 1000), exponents[i as usize % 13])));
            }
        }
        InstructionSet::Avx512.limit();
    }
}
