//! The rows of a PNG, filtered and compressed in bands, side by side.
//!
//! Bands follow from the picture's size alone, so that its bytes are the same for any number of threads. Each refers to
//! nothing before it and ends with a byte (a sync flush of RFC 1951), so that one after the other they are one stream.

use flate2::{Compression, write::DeflateEncoder};
use rayon::prelude::*;
use simd_adler32::Adler32;
use std::io::{self, Write};
use std::ops::Range;

/// The bytes of a band, about. Larger ones compress better by hardly anything, smaller ones keep more threads busy.
const BAND: usize = 1 << 17;

/// The fewest rows of a band: the one above it is made twice.
const ROWS: usize = 8;

/// A picture's size in pixels, and that of a pixel in bytes.
#[derive(Clone, Copy)]
pub(super) struct Shape {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) pixel: usize,
}

impl Shape {
    /// The rows of each band.
    fn bands(self) -> Vec<Range<usize>> {
        let most = self.height.div_ceil(ROWS);
        let count = (self.width * self.pixel * self.height).div_ceil(BAND).clamp(1, most);
        let rows = self.height.div_ceil(count);
        (0..self.height).step_by(rows).map(|first| first..(first + rows).min(self.height)).collect()
    }
}

/// The zlib stream (RFC 1950) of a picture's filtered rows, in parts. `fill` gives the bytes of a range of pixels.
pub(super) fn compressed(shape: Shape, fill: impl Fn(Range<usize>, &mut [u8]) + Sync) -> io::Result<Vec<Vec<u8>>> {
    let bands = shape.bands().into_par_iter().map_init(
        || Workshop::new(shape, &fill),
        |workshop, rows| Ok((workshop.band(rows.clone())?, workshop.checksum(), workshop.filtered.len())),
    );
    let bands: Vec<(Vec<u8>, u32, usize)> = bands.collect::<io::Result<_>>()?;
    let checksum = bands.iter().fold(1, |sum, (_, next, length)| joined(sum, *next, *length));
    let mut parts: Vec<Vec<u8>> = bands.into_iter().map(|(part, ..)| part).collect();
    // A window of 32 KiB, compressed fast; at the end an empty block, the last one.
    parts.insert(0, vec![0x78, 0x01]);
    parts.push([&[0x03, 0x00], &checksum.to_be_bytes()[..]].concat());
    Ok(parts)
}

/// The checksum (Adler-32) of bytes from those of two parts, the second one's length given.
fn joined(first: u32, second: u32, length: usize) -> u32 {
    const BASE: u64 = 65_521;
    let [a0, b0, a1, b1] = [first, first >> 16, second, second >> 16].map(|v| u64::from(v & 0xffff));
    // Sums begin at 1, and sums of sums have those of the first part once for each byte of the second.
    let a = (a0 + a1 + BASE - 1) % BASE;
    let b = (b0 + b1 + (length as u64 % BASE) * (a0 + BASE - 1)) % BASE;
    (b << 16 | a) as u32
}

/// What one thread needs for its bands.
struct Workshop<'a, F> {
    shape: Shape,
    fill: &'a F,
    /// The row above the band, and its rows.
    bytes: Vec<u8>,
    /// Each row after the number of its filter.
    filtered: Vec<u8>,
    tries: [Vec<u8>; 5],
    encoder: DeflateEncoder<Vec<u8>>,
}

impl<'a, F: Fn(Range<usize>, &mut [u8])> Workshop<'a, F> {
    fn new(shape: Shape, fill: &'a F) -> Self {
        let tries = std::array::from_fn(|_| vec![0; shape.width * shape.pixel]);
        let encoder = DeflateEncoder::new(Vec::new(), Compression::fast());
        Workshop { shape, fill, bytes: Vec::new(), filtered: Vec::new(), tries, encoder }
    }

    /// Some rows, compressed.
    fn band(&mut self, rows: Range<usize>) -> io::Result<Vec<u8>> {
        let Shape { width, pixel, .. } = self.shape;
        let row = width * pixel;
        self.bytes.clear();
        self.bytes.resize((rows.len() + 1) * row, 0);
        // Above the first row there is nothing, which counts as zeros.
        let above = usize::from(rows.start > 0);
        (self.fill)((rows.start - above) * width..rows.end * width, &mut self.bytes[(1 - above) * row..]);
        self.filtered.clear();
        for two in self.bytes.windows(2 * row).step_by(row) {
            let (above, line) = two.split_at(row);
            filter(above, line, pixel, &mut self.tries);
            let (number, best) =
                (0..).zip(&self.tries).min_by_key(|(_, tried)| size(tried)).unwrap_or((0, &self.tries[0]));
            self.filtered.push(number);
            self.filtered.extend_from_slice(best);
        }
        self.encoder.write_all(&self.filtered)?;
        self.encoder.flush()?;
        let part = std::mem::take(self.encoder.get_mut());
        // This ends the stream, but in the empty list.
        self.encoder.reset(Vec::new())?;
        Ok(part)
    }

    fn checksum(&self) -> u32 {
        let mut checksum = Adler32::new();
        checksum.write(&self.filtered);
        checksum.finish()
    }
}

/// How large differences are, the least of which most likely compress best (the standard's 12.8).
fn size(differences: &[u8]) -> u64 {
    // Sums of few fit in fewer bits, so that more of them go side by side.
    let part = |part: &[u8]| part.iter().map(|d| u32::from(d.cast_signed().unsigned_abs())).sum::<u32>();
    differences.chunks(1 << 12).map(|chunk| u64::from(part(chunk))).sum()
}

/// What the five filters (the standard's 9.2) make of a row: nothing, and differences to what is on the left, above, between them, and
/// to whichever of these and the one at the upper left is nearest to a plane through them.
fn filter(above: &[u8], line: &[u8], pixel: usize, [none, sub, up, average, paeth]: &mut [Vec<u8>; 5]) {
    none.copy_from_slice(line);
    for (out, (x, b)) in up.iter_mut().zip(line.iter().zip(above)) {
        *out = x.wrapping_sub(*b);
    }
    // On the left of the first pixel are zeros.
    for i in 0..pixel.min(line.len()) {
        sub[i] = line[i];
        average[i] = line[i].wrapping_sub(above[i] / 2);
        paeth[i] = up[i];
    }
    let Some(length) = line.len().checked_sub(pixel) else { return };
    let (x, a, b, c) = (&line[pixel..], &line[..length], &above[pixel..], &above[..length]);
    for (out, (x, a)) in sub[pixel..].iter_mut().zip(x.iter().zip(a)) {
        *out = x.wrapping_sub(*a);
    }
    for (out, ((x, a), b)) in average[pixel..].iter_mut().zip(x.iter().zip(a).zip(b)) {
        *out = x.wrapping_sub((a & b) + ((a ^ b) >> 1));
    }
    for (out, (((x, a), b), c)) in paeth[pixel..].iter_mut().zip(x.iter().zip(a).zip(b).zip(c)) {
        *out = x.wrapping_sub(nearest(*a, *b, *c));
    }
}

/// Whichever of a, b and c is nearest to a + b − c, in this order.
#[inline]
fn nearest(a: u8, b: u8, c: u8) -> u8 {
    let (x, y, z) = (i16::from(a), i16::from(b), i16::from(c));
    let (da, db, dc) = ((y - z).abs(), (x - z).abs(), (x + y - 2 * z).abs());
    if da <= db && da <= dc {
        a
    } else if db <= dc {
        b
    } else {
        c
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn checksums_join() {
        let bytes: Vec<u8> = (0..200_000u32).map(|i| (i.wrapping_mul(i) >> 7) as u8).collect();
        let of = |bytes: &[u8]| {
            let mut sum = Adler32::new();
            sum.write(bytes);
            sum.finish()
        };
        for at in [0, 1, 65_520, 65_521, 65_522, 131_042, 199_999, 200_000] {
            let (first, second) = bytes.split_at(at);
            assert_eq!(joined(of(first), of(second), second.len()), of(&bytes), "{at}");
        }
    }

    #[test]
    fn bands_are_all_rows_in_order() {
        for (width, height, pixel) in [(1, 1, 1), (230, 230, 3), (1920, 1080, 3), (65_536, 9, 8), (3, 65_536, 6)] {
            let bands = Shape { width, height, pixel }.bands();
            let rows: Vec<usize> = bands.iter().cloned().flatten().collect();
            assert!(rows.into_iter().eq(0..height) && bands.iter().all(|band| !band.is_empty()));
            assert!(bands.len() <= 1 + width * pixel * height / BAND);
        }
    }
}
