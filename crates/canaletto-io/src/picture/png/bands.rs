//! Filtering and compression of the rows of a PNG in parallel bands.
//!
//! Bands depend on the picture's size alone, so the bytes don't depend on the number of threads. Each band ends on a
//! byte boundary (a sync flush of RFC 1951), so their concatenation is one stream. A band may refer to the window of
//! deflate above it. Its encoder first compresses these rows, and that output is discarded. This costs a sixteenth of
//! the work; the flush and the band's own codes cost some 20 bytes.

use super::Compression;
use canaletto_parallel::prelude::*;
use flate2::{Compress, FlushCompress};
use simd_adler32::Adler32;
use std::io;
use std::ops::Range;

/// The approximate size of a band in bytes. Larger bands compress noticeably better only in pictures of a few colours;
/// smaller ones occupy more threads.
const BAND: usize = 3 << 18;

/// The approximate size of a band in bytes with [`Compression::Fast`].
const FAST_BAND: usize = 1 << 17;

/// The largest number of bands, so that their overhead is negligible even in a large picture of one colour, which
/// compresses to a thousandth of its pixels.
const BANDS: usize = 32;

/// The size of the deflate window in bytes (RFC 1951, 2).
const WINDOW: usize = 1 << 15;

/// The smallest number of rows in a band. The row above a band is generated twice.
const ROWS: usize = 8;

/// The size of a picture in pixels, and of a pixel in bytes.
#[derive(Clone, Copy)]
pub(super) struct Shape {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) pixel: usize,
}

impl Shape {
    /// The range of rows of each band.
    fn bands(self, compression: Compression) -> Vec<Range<usize>> {
        let (band, bands) = if compression == Compression::Fast { (FAST_BAND, usize::MAX) } else { (BAND, BANDS) };
        let most = self.height.div_ceil(ROWS).min(bands);
        let count = (self.width * self.pixel * self.height).div_ceil(band).clamp(1, most);
        let rows = self.height.div_ceil(count);
        (0..self.height).step_by(rows).map(|first| first..(first + rows).min(self.height)).collect()
    }
}

/// The zlib stream (RFC 1950) of a picture's filtered rows, in parts. `fill` writes the bytes of a range of pixels.
pub(super) fn compressed(
    shape: Shape,
    compression: Compression,
    fill: impl Fn(Range<usize>, &mut [u8]) + Sync,
) -> io::Result<Vec<Vec<u8>>> {
    let bands = shape.bands(compression).into_par_iter().map_init(
        || BandEncoder::new(shape, compression, &fill),
        |workshop, rows| {
            let part = workshop.band(rows.clone())?;
            let filtered = &workshop.filtered[workshop.shown..];
            Ok((part, checksum(filtered), filtered.len()))
        },
    );
    let bands: Vec<(Vec<u8>, u32, usize)> = bands.collect().into_iter().collect::<io::Result<_>>()?;
    let checksum = bands.iter().fold(1, |sum, (_, next, length)| joined(sum, *next, *length));
    let mut parts: Vec<Vec<u8>> = bands.into_iter().map(|(part, ..)| part).collect();
    // The header declares a window of 32 KiB and the compression level (RFC 1950, 2.2). The stream ends with an empty
    // final block.
    let header = match compression {
        Compression::Fast => [0x78, 0x01],
        Compression::Default => [0x78, 0x9c],
        Compression::Best => [0x78, 0xda],
    };
    parts.insert(0, header.to_vec());
    parts.push([&[0x03, 0x00], &checksum.to_be_bytes()[..]].concat());
    Ok(parts)
}

/// The Adler-32 checksum of a concatenation, from the checksums of its two parts and the length of the second.
fn joined(first: u32, second: u32, length: usize) -> u32 {
    const BASE: u64 = 65_521;
    let [a0, b0, a1, b1] = [first, first >> 16, second, second >> 16].map(|v| u64::from(v & 0xffff));
    // The first sum starts at 1. The second sum contains the first sum of the first part once for each byte of the
    // second part.
    let a = (a0 + a1 + BASE - 1) % BASE;
    let b = (b0 + b1 + (length as u64 % BASE) * (a0 + BASE - 1)) % BASE;
    (b << 16 | a) as u32
}

/// The working memory of one thread.
struct BandEncoder<'a, F> {
    shape: Shape,
    /// The number of rows above a band that fill the deflate window.
    before: usize,
    fill: &'a F,
    /// The unfiltered bytes: one row above the window rows, the window rows, and the rows of the band.
    bytes: Vec<u8>,
    /// The filtered rows, each after the number of its filter.
    filtered: Vec<u8>,
    /// The number of filtered bytes above the band.
    shown: usize,
    tries: [Vec<u8>; 5],
    deflate: Compress,
}

impl<'a, F: Fn(Range<usize>, &mut [u8])> BandEncoder<'a, F> {
    fn new(shape: Shape, compression: Compression, fill: &'a F) -> Self {
        let tries = std::array::from_fn(|_| vec![0; shape.width * shape.pixel]);
        let deflate = Compress::new(flate2::Compression::new(compression.level()), false);
        let fast = compression == Compression::Fast;
        let before = if fast { 0 } else { WINDOW.div_ceil(shape.width * shape.pixel + 1) };
        BandEncoder { shape, before, fill, bytes: Vec::new(), filtered: Vec::new(), shown: 0, tries, deflate }
    }

    /// Compresses a range of rows.
    fn band(&mut self, rows: Range<usize>) -> io::Result<Vec<u8>> {
        let Shape { width, pixel, .. } = self.shape;
        let row = width * pixel;
        let before = self.before.min(rows.start);
        let first = rows.start - before;
        self.bytes.clear();
        self.bytes.resize((before + rows.len() + 1) * row, 0);
        // The row above the first one counts as zeros.
        let above = usize::from(first > 0);
        (self.fill)((first - above) * width..rows.end * width, &mut self.bytes[(1 - above) * row..]);
        self.filtered.clear();
        for two in self.bytes.windows(2 * row).step_by(row) {
            let (above, line) = two.split_at(row);
            if two.iter().all(|byte| *byte == 0) {
                // Every filter yields zeros for such a row.
                self.filtered.resize(self.filtered.len() + 1 + row, 0);
                continue;
            }
            filter(above, line, pixel, &mut self.tries);
            let (number, best) =
                (0..).zip(&self.tries).min_by_key(|(_, tried)| size(tried)).unwrap_or((0, &self.tries[0]));
            self.filtered.push(number);
            self.filtered.extend_from_slice(best);
        }
        self.shown = before * (row + 1);
        let (above, own) = self.filtered.split_at(self.shown);
        let window = &above[self.shown.saturating_sub(WINDOW)..];
        self.deflate.reset();
        if !window.is_empty() {
            flushed(&mut self.deflate, window)?;
        }
        flushed(&mut self.deflate, own)
    }
}

/// What deflate makes of more bytes, up to and including a sync flush.
///
/// The output gets all the space that deflate can need. Where space runs out, `miniz_oxide` returns from a flush before
/// the last bytes are compressed, and doesn't tell that it isn't done.
fn flushed(deflate: &mut Compress, bytes: &[u8]) -> io::Result<Vec<u8>> {
    // Deflate stores what it can't compress, with five bytes for each block of at most 65,535. The rest is the flush.
    let mut part = Vec::with_capacity(bytes.len() + bytes.len() / 8 + 256);
    let before = deflate.total_in();
    deflate.compress_vec(bytes, &mut part, FlushCompress::Sync)?;
    if deflate.total_in() - before != bytes.len() as u64 || !part.ends_with(&[0, 0, 0xff, 0xff]) {
        return Err(io::Error::other("a part of the picture wasn't compressed as a whole"));
    }
    part.shrink_to_fit();
    Ok(part)
}

fn checksum(bytes: &[u8]) -> u32 {
    let mut checksum = Adler32::new();
    checksum.write(bytes);
    checksum.finish()
}

/// The sum of absolute differences. The filter with the smallest sum most likely compresses best (the standard's 12.8).
fn size(differences: &[u8]) -> u64 {
    // Short sums fit in fewer bits, which widens the vector lanes.
    let part = |part: &[u8]| part.iter().map(|d| u32::from(d.cast_signed().unsigned_abs())).sum::<u32>();
    differences.chunks(1 << 12).map(|chunk| u64::from(part(chunk))).sum()
}

/// Applies the five filters (the standard's 9.2) to a row: none, and the differences to the left byte, to the byte
/// above, to their average, and to the Paeth predictor.
fn filter(above: &[u8], line: &[u8], pixel: usize, [none, sub, up, average, paeth]: &mut [Vec<u8>; 5]) {
    none.copy_from_slice(line);
    for (out, (x, b)) in up.iter_mut().zip(line.iter().zip(above)) {
        *out = x.wrapping_sub(*b);
    }
    // The bytes left of the first pixel are zeros.
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

/// The Paeth predictor: the first of a, b and c that is nearest to a + b − c.
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
    use std::io::Read;

    #[test]
    fn checksums_join() {
        let bytes: Vec<u8> = (0..200_000u32).map(|i| (i.wrapping_mul(i) >> 7) as u8).collect();
        for at in [0, 1, 65_520, 65_521, 65_522, 131_042, 199_999, 200_000] {
            let (first, second) = bytes.split_at(at);
            assert_eq!(joined(checksum(first), checksum(second), second.len()), checksum(&bytes), "{at}");
        }
    }

    #[test]
    fn bands_are_all_rows_in_order() {
        for (width, height, pixel) in [(1, 1, 1), (230, 230, 3), (1920, 1080, 3), (65_536, 9, 8), (3, 65_536, 6)] {
            for (compression, band) in [(Compression::Fast, FAST_BAND), (Compression::Default, BAND)] {
                let bands = Shape { width, height, pixel }.bands(compression);
                let rows: Vec<usize> = bands.iter().cloned().flatten().collect();
                assert!(rows.into_iter().eq(0..height) && bands.iter().all(|band| !band.is_empty()));
                assert!(bands.len() <= 1 + width * pixel * height / band);
            }
        }
    }

    /// Every band is compressed to its end, however its size and the space of the output meet.
    #[test]
    fn noise_of_any_size_is_compressed_to_its_end() {
        let sizes =
            [(277, 73), (222, 238), (314, 62), (89, 237), (103, 195), (200, 204), (1, 1), (240, 135), (512, 512)];
        for (width, height) in sizes {
            for bits in [8, 6, 3] {
                let byte = |i: usize| {
                    let hash = (i as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
                    ((hash ^ hash >> 29).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> (64 - bits)) as u8
                };
                let fill = |range: Range<usize>, bytes: &mut [u8]| {
                    bytes.iter_mut().zip(range.start * 3..).for_each(|(out, i)| *out = byte(i));
                };
                for compression in [Compression::Fast, Compression::Default] {
                    let stream = compressed(Shape { width, height, pixel: 3 }, compression, fill).unwrap().concat();
                    let mut rows = Vec::new();
                    let ended = flate2::read::ZlibDecoder::new(&stream[..]).read_to_end(&mut rows);
                    let expected = (width * 3 + 1) * height;
                    assert!(ended.is_ok() && rows.len() == expected, "{width} x {height}, {bits} bits: {ended:?}");
                }
            }
        }
    }
}
