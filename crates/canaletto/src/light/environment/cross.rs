//! Crosses: the six faces of a cube unfolded in one image.

use crate::texture::{Image, Samples};

/// The side of a face in a cross of this size, if it has 4 × 3 or 3 × 4 squares.
pub(super) fn side([w, h]: [u32; 2]) -> Option<u32> {
    let fits = |across: u32, down: u32| w.is_multiple_of(across) && h.is_multiple_of(down) && w / across == h / down;
    if w == 0 || !(fits(4, 3) || fits(3, 4)) { None } else { Some(w.min(h) / 3) }
}

/// The faces cut out of a cross of the right size, in the order of [`super::Face::ALL`].
pub(super) fn faces(cross: &Image) -> Vec<Image> {
    let n = cross.width.min(cross.height) / 3;
    let upright = cross.height > cross.width;
    // Unfolded downwards, the back hangs below the bottom, upside down.
    let back = if upright { ([1, 3], true) } else { ([3, 1], false) };
    let rest = [[2, 1], [0, 1], [1, 0], [1, 2], [1, 1]].map(|square| (square, false));
    rest.into_iter().chain([back]).map(|(square, turned)| face(cross, square, n, turned)).collect()
}

fn face(cross: &Image, [column, row]: [u32; 2], n: u32, turned: bool) -> Image {
    let place = |i: u32| if turned { n - 1 - i } else { i };
    let texel =
        |i: u32| ((row * n + place(i / n)) as usize * cross.width as usize) + (column * n + place(i % n)) as usize;
    let channels = usize::from(cross.channels);
    let samples = match &cross.samples {
        Samples::U8(data) => Samples::U8(cut(data, n, channels, texel)),
        Samples::U16(data) => Samples::U16(cut(data, n, channels, texel)),
        Samples::F16(data) => Samples::F16(cut(data, n, channels, texel)),
        Samples::F32(data) => Samples::F32(cut(data, n, channels, texel)),
    };
    let Image { name, channels, space, premultiplied, .. } = cross;
    let (name, channels, space, premultiplied) = (name.clone(), *channels, *space, *premultiplied);
    Image { name, width: n, height: n, channels, samples, space, premultiplied }
}

fn cut<T: Copy>(data: &[T], n: u32, channels: usize, texel: impl Fn(u32) -> usize) -> Vec<T> {
    (0..n * n).flat_map(|i| data[texel(i) * channels..][..channels].iter().copied()).collect()
}
