//! Filters: what makes attributes of other numbers, which take fewer bytes. They change each element in its place.

use super::CompressionFilter;
use std::f32::consts::FRAC_1_SQRT_2;

/// Applies a filter to elements of `stride` bytes, which the filter fits.
pub(super) fn apply(filter: CompressionFilter, stride: usize, elements: &mut [u8]) {
    match filter {
        CompressionFilter::None => {}
        CompressionFilter::Octahedral => change(stride, elements, octahedral),
        CompressionFilter::Quaternion => change(stride, elements, quaternion),
        CompressionFilter::Exponential => elements.chunks_exact_mut(4).for_each(exponential),
        CompressionFilter::Color => change(stride, elements, color),
    }
}

/// Changes elements of 4 whole numbers of 8 or 16 bits. The function is given them with their signs, and their bits.
fn change(stride: usize, elements: &mut [u8], filter: impl Fn([i32; 4], u32) -> [i32; 4]) {
    for element in elements.chunks_exact_mut(stride) {
        if stride == 4 {
            let numbers = filter(std::array::from_fn(|k| i32::from(element[k] as i8)), 8);
            element.copy_from_slice(&numbers.map(|number| number as u8));
        } else {
            let number = |k: usize| i32::from(i16::from_le_bytes([element[2 * k], element[2 * k + 1]]));
            let numbers = filter(std::array::from_fn(number), 16);
            for (place, number) in element.chunks_exact_mut(2).zip(numbers) {
                place.copy_from_slice(&(number as i16).to_le_bytes());
            }
        }
    }
}

/// The whole number that stands for `part` of 1. It is 0 for NaN, which bad elements give.
fn normalized(part: f32, bits: u32) -> i32 {
    (part * ((1 << (bits - 1)) - 1) as f32).round() as i32
}

/// A direction of an octahedron that is folded to a square. The third number is what 1 is, the fourth stays.
fn octahedral([x, y, one, rest]: [i32; 4], bits: u32) -> [i32; 4] {
    let (x, y) = (x as f32 / one as f32, y as f32 / one as f32);
    let z = 1.0 - x.abs() - y.abs();
    let below = z.min(0.0);
    let (x, y) = (x - below.copysign(x), y - below.copysign(y));
    let length = (x * x + y * y + z * z).sqrt();
    [normalized(x / length, bits), normalized(y / length, bits), normalized(z / length, bits), rest]
}

/// A rotation without its largest component, whose place the lowest 2 bits of the last number tell.
fn quaternion([x, y, z, last]: [i32; 4], bits: u32) -> [i32; 4] {
    let one = (last | 3) as f32;
    let [x, y, z] = [x, y, z].map(|part| part as f32 / one * FRAC_1_SQRT_2);
    let largest = (1.0 - x * x - y * y - z * z).max(0.0).sqrt();
    let mut rotation = [0; 4];
    for (k, part) in [largest, x, y, z].into_iter().enumerate() {
        rotation[(last as usize + k) & 3] = normalized(part, bits);
    }
    rotation
}

/// A number of 24 bits times a power of two, whose exponent has 8 bits.
fn exponential(element: &mut [u8]) {
    let number = i32::from_le_bytes([element[0], element[1], element[2], element[3]]);
    // Powers of 2 are made of their bits. The product is exact.
    let power = f64::from_bits(((1023 + (number >> 24)) as u64) << 52);
    element.copy_from_slice(&((power * f64::from(number << 8 >> 8)) as f32).to_le_bytes());
}

/// A colour as brightness, orange and green (YCoCg). The highest bit of the last number, its opacity, tells what 1 is.
fn color([y, orange, green, opacity]: [i32; 4], bits: u32) -> [i32; 4] {
    let most = (1 << bits) - 1;
    let (y, opacity) = (y & most, opacity & most);
    let one = (1 << (32 - opacity.leading_zeros())) - 1;
    // The opacity has a bit less than the colour, so that its lowest is doubled.
    let opacity = opacity & one >> 1;
    let opacity = opacity << 1 | opacity & 1;
    let scale = most as f32 / one as f32;
    [y + orange - green, y + green, y - orange - green, opacity]
        .map(|number| ((number as f32 * scale).round() as i32).clamp(0, most))
}
