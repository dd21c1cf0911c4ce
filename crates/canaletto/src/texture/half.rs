//! Half-precision numbers (IEEE 754 binary16).

/// The value of a half-precision number.
pub fn from_half(bits: u16) -> f32 {
    let sign = u32::from(bits & 0x8000) << 16;
    let rest = u32::from(bits & 0x7fff);
    let magnitude = match rest {
        // Subnormal: a multiple of 2⁻²⁴.
        0..0x0400 => (rest as f32 * (1.0 / 16_777_216.0)).to_bits(),
        0x7c00.. => 0x7f80_0000 | (rest & 0x03ff) << 13,
        _ => (rest << 13) + (112 << 23),
    };
    f32::from_bits(sign | magnitude)
}

/// The nearest half-precision number; of two equally near, the even one. Values beyond the largest number become it.
pub fn to_half(v: f32) -> u16 {
    let sign = ((v.to_bits() >> 16) & 0x8000) as u16;
    let v = v.abs();
    if v >= 65504.0 {
        return sign | 0x7bff;
    }
    if v < 6.103_515_6e-5 {
        // Subnormal: adding 1.5 × 2⁻¹ lets the hardware round to a multiple of 2⁻²⁴.
        return sign | ((v + 0.75).to_bits() - 0.75f32.to_bits()) as u16;
    }
    let bits = v.to_bits() - (112 << 23);
    sign | ((bits + 0x0fff + (bits >> 13 & 1)) >> 13) as u16
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_precision_follows_ieee_754() {
        for (bits, value) in [
            (0x0000, 0.0),
            (0x3c00, 1.0),
            (0xc000, -2.0),
            (0x7bff, 65504.0),
            (0x0400, 6.103_515_6e-5),
            (0x0001, 5.960_464_5e-8),
            (0x3555, 0.333_251_95),
            (0x7c00, f32::INFINITY),
        ] {
            assert_eq!(from_half(bits), value, "{bits:#x}");
        }
        assert!(from_half(0x7e00).is_nan() && from_half(0x8000).is_sign_negative());
    }

    #[test]
    fn every_number_comes_back_and_the_rest_goes_to_the_nearest() {
        for bits in (0..0x7c00).chain(0x8000..0xfc00) {
            assert_eq!(to_half(from_half(bits)), bits, "{bits:#x}");
            if bits & 0x7fff < 0x7bff {
                let (low, high) = (from_half(bits), from_half(bits + 1));
                let middle = (low + high) * 0.5;
                assert_eq!(to_half(middle), if bits & 1 == 0 { bits } else { bits + 1 }, "{bits:#x}");
                assert_eq!(to_half(low + (high - low) * 0.4375), bits);
                assert_eq!(to_half(low + (high - low) * 0.5625), bits + 1);
            }
        }
        assert_eq!(to_half(1e9), 0x7bff);
    }
}
