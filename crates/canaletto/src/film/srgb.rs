//! The sRGB curve (IEC 61966-2-1) for many values at once: a third of the time of `libm`'s general power.

/// [`srgb_encode`](super::srgb_encode) for many values in [0, 1], in place, with the same bits.
pub(super) fn encode_all(values: &mut [f32]) {
    for v in values {
        // 1 would need another exponent; its power is known.
        let inside = *v > LINEAR && *v < 1.0;
        let curve = 1.055 * power(if inside { *v } else { LINEAR }) - 0.055;
        let curve = if *v < 1.0 { curve } else { 1.055 - 0.055 };
        *v = if *v > LINEAR { curve } else { 12.92 * *v };
    }
}

/// Where the curve leaves its straight start.
const LINEAR: f32 = 0.003_130_8;

/// x to the power of 1 / 2.4 for [`LINEAR`] ≤ x < 1: [`libm::powf`], the same bits, without a branch for other numbers, so
/// that the compiler does several at once. Names are those of its source (FreeBSD's e_powf.c).
#[inline]
#[allow(clippy::excessive_precision)] // as in the source
fn power(x: f32) -> f32 {
    const Y: f32 = 1.0 / 2.4;
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
    let y1 = cut(Y, HIGH);
    let p_l = (Y - y1) * t1 + Y * t2;
    let p_h = y1 * t1;
    let z = p_l + p_h;
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
    f32::from_bits(((1.0 - (r - z)).to_bits() as i32 - (n << 23)) as u32)
}

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

    /// All 70 million values above the straight start; seconds in a release build.
    #[test]
    #[cfg_attr(debug_assertions, ignore)]
    fn every_value_has_the_bits_of_libm() {
        compare(0.003_130_f32.to_bits(), 1);
    }
}
