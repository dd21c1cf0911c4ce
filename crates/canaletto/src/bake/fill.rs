//! Texels without a surface get colours of texels around them, so that filtering and mip levels find no strange colour.

/// The number of rings of texels that are filled from their neighbours. Others get the mean of a larger square.
const RINGS: usize = 2;

/// Fills the texels that aren't known.
pub(super) fn fill<const N: usize>(texels: &mut [[f32; N]], known: &[bool], [width, height]: [usize; 2]) {
    let mut known = known.to_vec();
    for _ in 0..RINGS {
        let mut ring = Vec::new();
        for (index, _) in known.iter().enumerate().filter(|(_, known)| !**known) {
            let (x, y) = (index % width, index / width);
            let rows = y.saturating_sub(1)..(y + 2).min(height);
            let around = rows.flat_map(|y| (x.saturating_sub(1)..(x + 2).min(width)).map(move |x| y * width + x));
            if let Some(mean) = mean(around.filter(|&i| known[i]).map(|i| &texels[i])) {
                ring.push((index, mean));
            }
        }
        for (index, mean) in ring {
            (texels[index], known[index]) = (mean, true);
        }
    }
    fill_from_coarse(texels, &known, [width, height]);
}

/// Fills texels with the mean of the known texels in the smallest square around them that has any.
fn fill_from_coarse<const N: usize>(texels: &mut [[f32; N]], known: &[bool], [width, height]: [usize; 2]) {
    if known.iter().all(|&known| known) || width * height <= 1 {
        return;
    }
    let coarse = [width.div_ceil(2), height.div_ceil(2)];
    let squares = |index: usize| {
        let (x, y) = (2 * (index % coarse[0]), 2 * (index / coarse[0]));
        let rows = y..(y + 2).min(height);
        rows.flat_map(move |y| (x..(x + 2).min(width)).map(move |x| y * width + x))
    };
    let means: Vec<Option<[f32; N]>> = (0..coarse[0] * coarse[1])
        .map(|index| mean(squares(index).filter(|&i| known[i]).map(|i| &texels[i])))
        .collect();
    let coarse_known: Vec<bool> = means.iter().map(Option::is_some).collect();
    let mut coarse_texels: Vec<[f32; N]> = means.into_iter().map(|mean| mean.unwrap_or([0.0; N])).collect();
    fill_from_coarse(&mut coarse_texels, &coarse_known, coarse);
    for (index, texel) in texels.iter_mut().enumerate().filter(|(index, _)| !known[*index]) {
        *texel = coarse_texels[index / width / 2 * coarse[0] + index % width / 2];
    }
}

fn mean<'a, const N: usize>(texels: impl Iterator<Item = &'a [f32; N]>) -> Option<[f32; N]> {
    let (mut sum, mut count) = ([0.0; N], 0.0);
    for texel in texels {
        sum.iter_mut().zip(texel).for_each(|(sum, value)| *sum += value);
        count += 1.0;
    }
    (count > 0.0).then(|| sum.map(|sum| sum / count))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_texels_get_a_colour_of_their_neighbours() {
        let (width, height) = (37, 20);
        let mut known = vec![false; width * height];
        let mut texels = vec![[-1.0; 1]; width * height];
        for (index, value) in [(3 * width + 4, 2.0), (15 * width + 30, 8.0)] {
            (texels[index], known[index]) = ([value], true);
        }
        fill(&mut texels, &known, [width, height]);
        assert!(texels.iter().all(|[value]| (2.0..=8.0).contains(value)));
        // Two rings around a known texel have its colour.
        assert_eq!((texels[width + 2], texels[13 * width + 32]), ([2.0], [8.0]));
    }
}
