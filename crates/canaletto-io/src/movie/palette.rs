//! Palettes of 256 colours for frames.
//!
//! A frame of up to 256 colours keeps them. For more, the crate `color_quant` proposes a palette (A. Dekker's NeuQuant,
//! a self-organising map over the frame's pixels). The map favours frequent colours and loses small features of a
//! different colour, such as a white highlight. Therefore the colours with the largest errors replace the entries that
//! serve the fewest pixels. Then two Lloyd iterations move every entry to the mean of its colours. These steps count in
//! integers and in the order of colours, so that a frame always gets an identical palette.

use color_quant::NeuQuant;
use std::collections::HashMap;

/// The largest number of colours in a frame of a GIF.
const MOST: usize = 256;

/// The largest number of entries that are replaced by colours with large errors.
const GIVEN: usize = 24;

/// The squared distance up to which an error is acceptable: 12 levels in one of red, green and blue.
const GOOD: u32 = 144;

/// The approximate number of pixels that train the map: of a large frame, each n-th pixel.
const SEEN: usize = 1 << 18;

type Color = [u8; 3];

/// The palette, and for each pixel the index of the nearest entry.
pub(super) fn palette(rgb: &[u8]) -> (Vec<u8>, Vec<u8>) {
    let mut counts: HashMap<Color, u64> = HashMap::new();
    for pixel in rgb.chunks_exact(3) {
        *counts.entry([pixel[0], pixel[1], pixel[2]]).or_default() += 1;
    }
    let mut colors: Vec<(Color, u64)> = counts.into_iter().collect();
    colors.sort_unstable();
    let palette: Vec<Color> =
        if colors.len() <= MOST { colors.iter().map(|(color, _)| *color).collect() } else { chosen(rgb, &colors) };
    let index: HashMap<Color, u8> =
        colors.iter().map(|(color, _)| (*color, nearest(&palette, *color).0 as u8)).collect();
    let indices = rgb.chunks_exact(3).map(|p| index.get(&[p[0], p[1], p[2]]).copied().unwrap_or(0)).collect();
    (palette.concat(), indices)
}

fn chosen(rgb: &[u8], colors: &[(Color, u64)]) -> Vec<Color> {
    let rgba: Vec<u8> = rgb.chunks_exact(3).flat_map(|p| [p[0], p[1], p[2], 255]).collect();
    let speed = (rgb.len() / 3 / SEEN + 1).min(30) as i32;
    let map = NeuQuant::new(speed, MOST, &rgba).color_map_rgb();
    let mut palette: Vec<Color> = map.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect();
    for _ in 0..2 {
        give(&mut palette, colors);
        settle(&mut palette, colors);
    }
    palette
}

/// Replaces entries that serve few pixels by colours with large errors.
fn give(palette: &mut [Color], colors: &[(Color, u64)]) {
    let mut distances: Vec<u32> = Vec::with_capacity(colors.len());
    let mut served = vec![0; palette.len()];
    for (color, count) in colors {
        let (index, distance) = nearest(palette, *color);
        served[index] += count;
        distances.push(distance);
    }
    let mut poor: Vec<usize> = (0..palette.len()).collect();
    poor.sort_by_key(|index| (served[*index], *index));
    for index in poor.into_iter().take(GIVEN) {
        let Some((worst, distance)) = distances.iter().enumerate().max_by_key(|(i, d)| (**d, usize::MAX - i)) else {
            return;
        };
        if *distance <= GOOD {
            return;
        }
        palette[index] = colors[worst].0;
        for (distance, (color, _)) in distances.iter_mut().zip(colors) {
            *distance = (*distance).min(apart(*color, palette[index]));
        }
    }
}

/// Moves every entry to the mean of the colours that it serves.
fn settle(palette: &mut [Color], colors: &[(Color, u64)]) {
    let mut sums = vec![[0u64; 4]; palette.len()];
    for (color, count) in colors {
        let sum = &mut sums[nearest(palette, *color).0];
        (0..3).for_each(|c| sum[c] += u64::from(color[c]) * count);
        sum[3] += count;
    }
    for (place, sum) in palette.iter_mut().zip(sums).filter(|(_, sum)| sum[3] > 0) {
        *place = [0, 1, 2].map(|c| ((sum[c] + sum[3] / 2) / sum[3]) as u8);
    }
}

/// The index of the entry nearest to a colour, the first if there are several, and its squared distance.
fn nearest(palette: &[Color], color: Color) -> (usize, u32) {
    let all = palette.iter().enumerate().map(|(index, place)| (index, apart(*place, color)));
    all.min_by_key(|(_, distance)| *distance).unwrap_or((0, 0))
}

fn apart(a: Color, b: Color) -> u32 {
    (0..3).map(|c| u32::from(a[c].abs_diff(b[c])).pow(2)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_colours_are_kept() {
        let rgb: Vec<u8> = (0..=255).flat_map(|i| [i, 255 - i, 7]).collect();
        let (palette, indices) = palette(&rgb);
        let back: Vec<u8> = indices.iter().flat_map(|i| palette[usize::from(*i) * 3..][..3].to_vec()).collect();
        assert_eq!(back, rgb);
    }

    /// A few white pixels among thousands of blue ones stay white.
    #[test]
    fn a_highlight_stays() {
        let mut rgb: Vec<u8> =
            (0..20_000u32).flat_map(|i| [(i % 40) as u8, (i / 300) as u8, 100 + (i % 150) as u8]).collect();
        rgb.extend([255; 9]);
        let (palette, indices) = palette(&rgb);
        let last = usize::from(indices[indices.len() - 1]) * 3;
        assert!(apart([palette[last], palette[last + 1], palette[last + 2]], [255; 3]) <= GOOD);
        // The other colours keep a small error.
        let errors = rgb.chunks_exact(3).zip(&indices).map(|(p, i)| {
            let place = &palette[usize::from(*i) * 3..][..3];
            f64::from(apart([p[0], p[1], p[2]], [place[0], place[1], place[2]]))
        });
        let rms = (errors.sum::<f64>() / rgb.len() as f64).sqrt();
        assert!(rms < 4.0, "{rms}");
    }
}
