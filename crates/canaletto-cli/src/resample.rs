//! Pictures in other sizes.

use canaletto::film::Picture;
use canaletto::math::Rgb;

/// A window of a picture that is scaled to cover another size. Each pixel is the mean of the area that it covers.
pub(crate) fn covering(picture: &Picture, size: [u32; 2], [left, top, width, height]: [u32; 4]) -> Vec<Rgb> {
    let own = [picture.width, picture.height].map(f64::from);
    let [w, h] = size.map(f64::from);
    let step = (own[0] / w).min(own[1] / h);
    let begin = [(own[0] - step * w) / 2.0, (own[1] - step * h) / 2.0];
    let shares = |from: u32, count: u32, begin: f64, most: u32| -> Vec<Vec<(usize, f32)>> {
        (from..from + count).map(|at| covered(begin + step * f64::from(at), step, most)).collect()
    };
    let columns = shares(left, width, begin[0], picture.width);
    let rows = shares(top, height, begin[1], picture.height);
    let pixel = |row: &[(usize, f32)], column: &[(usize, f32)]| {
        let mut sum = Rgb::BLACK;
        for &(y, share) in row {
            for &(x, other) in column {
                sum += picture.pixels[y * picture.width as usize + x] * (share * other);
            }
        }
        sum
    };
    rows.iter().flat_map(|row| columns.iter().map(move |column| pixel(row, column))).collect()
}

/// The texels from `begin` on that an interval of a length covers, with their shares. An interval shorter than a texel
/// mixes the two whose centres are nearest.
fn covered(begin: f64, length: f64, most: u32) -> Vec<(usize, f32)> {
    let (from, to) = match length < 1.0 {
        true => (begin + 0.5 * length - 0.5, begin + 0.5 * length + 0.5),
        false => (begin, begin + length),
    };
    let texels = from.floor() as i64..to.ceil() as i64;
    let share = |texel: i64| (to.min(texel as f64 + 1.0) - from.max(texel as f64)) / (to - from);
    texels.map(|texel| (texel.clamp(0, i64::from(most) - 1) as usize, share(texel) as f32)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A picture twice as wide as the other one loses both sides. Its mean stays at smaller sizes.
    #[test]
    fn a_backdrop_covers_the_picture() {
        let mut picture = Picture::new(8, 4);
        picture.pixels = (0..32).map(|i| Rgb::gray((i % 8) as f32)).collect();
        let same = covering(&picture, [4, 4], [0, 0, 4, 4]);
        assert_eq!(same[..4], [2.0, 3.0, 4.0, 5.0].map(Rgb::gray));
        let half = covering(&picture, [2, 2], [0, 0, 2, 2]);
        assert_eq!(half[..2], [2.5, 4.5].map(Rgb::gray));
        let large = covering(&picture, [8, 8], [0, 0, 8, 8]);
        assert!((large[3].r - 3.25).abs() < 1e-6, "{large:?}");
        assert_eq!(covering(&picture, [8, 8], [3, 2, 1, 1]), [large[3]]);
    }
}
