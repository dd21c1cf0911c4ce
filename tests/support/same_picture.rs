//! The comparison of two pictures bit for bit.

use canaletto::film::Picture;

/// Asserts that two pictures and their layers have equal bits. The message names the first pixel that differs.
///
/// # Panics
/// If sizes, layers or any bit differ.
pub fn assert_same_picture(found: &Picture, expected: &Picture, name: &str) {
    assert_eq!([found.width, found.height], [expected.width, expected.height], "{name}: the sizes");
    let layers = |picture: &Picture| picture.layers.iter().map(|layer| layer.name).collect::<Vec<_>>();
    assert_eq!(layers(found), layers(expected), "{name}: the layers");
    let place = |i: usize| format!("pixel {}, {}", i % found.width as usize, i / found.width as usize);
    for (i, (a, b)) in found.pixels.iter().zip(&expected.pixels).enumerate() {
        let same = a.to_array().map(f32::to_bits) == b.to_array().map(f32::to_bits);
        assert!(same, "{name}: {} is {a:?} instead of {b:?}", place(i));
    }
    for (a, b) in found.layers.iter().zip(&expected.layers) {
        for (i, (x, y)) in a.data.iter().zip(&b.data).enumerate() {
            let pixel = i / a.channels.len();
            assert!(x.to_bits() == y.to_bits(), "{name}: {} of {} is {x} instead of {y}", place(pixel), a.name);
        }
        assert_eq!(a.ids, b.ids, "{name}: {}", a.name);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use canaletto::math::Rgb;

    #[test]
    #[should_panic(expected = "twins: pixel 1, 1 is Rgb { r: -0.0")]
    fn the_first_pixel_that_differs_is_named() {
        let (mut found, expected) = (Picture::new(3, 2), Picture::new(3, 2));
        found.pixels[4] = Rgb::new(-0.0, 0.0, 0.0);
        assert_same_picture(&found, &expected, "twins");
    }
}
