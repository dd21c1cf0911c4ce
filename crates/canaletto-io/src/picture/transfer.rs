//! The sRGB curve (IEC 61966-2-1) in both directions, extended beyond [0, 1]. Results are identical on every machine.

/// Converts an sRGB value to linear light.
pub fn decode_srgb(v: f32) -> f32 {
    if v <= 0.040_45 { v / 12.92 } else { libm::pow((f64::from(v) + 0.055) / 1.055, 2.4) as f32 }
}

/// Converts linear light to an sRGB value, by the curve of the film, so that comparisons use identical bits.
pub use canaletto::film::srgb_encode as encode_srgb;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn published_values_and_round_trip() {
        for (linear, encoded) in [(0.0, 0.0), (0.18, 0.461_356), (0.5, 0.735_357), (1.0, 1.0)] {
            assert!((encode_srgb(linear) - encoded).abs() < 1e-5 && (decode_srgb(encoded) - linear).abs() < 1e-5);
        }
        for byte in 0..=255u8 {
            let v = f32::from(byte) / 255.0;
            assert!((encode_srgb(decode_srgb(v)) - v).abs() < 1e-6);
        }
    }
}
