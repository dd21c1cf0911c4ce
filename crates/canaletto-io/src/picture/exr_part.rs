//! Fast writing of OpenEXR for a partial picture that is saved when a program must end. It writes row after row without
//! a copy of the picture. Only black rows are compressed.
//!
//! The file declares RLE, in which a row that doesn't become smaller is stored as it is. A row of zeros takes a few
//! bytes. The rest of a picture therefore costs almost nothing after the deadline.

use super::exr::{ExrOptions, Kind, attributes, encode_exr, kind};
use super::pixel_hash::{PIXEL_HASH, PixelHash};
use super::{Channel, Image, PartError, PictureError, Window};
use ::exr::prelude::f16;
use canaletto::texture::from_half;
use std::io::{Seek, SeekFrom, Write};
use std::ops::Range;

/// A callback that fills the values of a channel, given by index, for a range of pixels.
pub(super) type Fill<'a> = &'a dyn Fn(usize, Range<usize>, &mut [f32]);

/// Writes an EXR of these channels, row by row while `goes_on` returns true; later rows are black. Returns the number
/// of rows that were filled.
///
/// # Errors
/// As [`encode_exr`], and the errors of `out`.
pub(super) fn write_exr_part(
    [width, height]: [u32; 2],
    channels: &[String],
    fill: Fill<'_>,
    options: ExrOptions,
    metadata: &[(String, String)],
    out: &mut (impl Write + Seek + ?Sized),
    goes_on: impl Fn() -> bool,
) -> Result<u32, PartError> {
    let window = options.window.unwrap_or(Window::whole(width, height));
    let (mut file, hash_place) =
        head([width, height], channels, ExrOptions { window: Some(window), ..options }, metadata)?;
    let mut hash = PixelHash::default();
    let mut order: Vec<usize> = (0..channels.len()).collect();
    order.sort_by_key(|channel| channels[*channel].as_bytes());
    let kinds: Vec<Kind> = channels.iter().map(|name| kind(name, options)).collect();
    let size = width as usize * kinds.iter().map(|kind| kind.bytes()).sum::<usize>();
    let (table, blank) = (file.len(), black(size));
    file.resize(table + 8 * height as usize, 0);
    let mut offsets = Vec::with_capacity(height as usize);
    let (mut flushed, mut rows) = (0, 0);
    let mut values = vec![0.0; width as usize];
    for y in 0..height as usize {
        if file.len() >= BUFFER {
            out.write_all(&file)?;
            flushed += file.len() as u64;
            file.clear();
        }
        offsets.push(flushed + file.len() as u64);
        file.extend((window.at[1] + y as i32).to_le_bytes());
        let start = file.len();
        file.extend((size as i32).to_le_bytes());
        let has_time = goes_on();
        let is_blank = if has_time {
            rows += 1;
            for &channel in &order {
                fill(channel, y * width as usize..(y + 1) * width as usize, &mut values);
                kinds[channel].put(&values, &mut file);
                hash.add_row(&channels[channel], y, values.iter().map(|v| kinds[channel].stored(*v)));
            }
            file[start + 4..].iter().all(|byte| *byte == 0)
        } else {
            true
        };
        if is_blank && blank.len() < size {
            file.truncate(start);
            file.extend((blank.len() as i32).to_le_bytes());
            file.extend(&blank);
        } else if !has_time {
            file.resize(file.len() + size, 0);
        }
    }
    out.write_all(&file)?;
    out.seek(SeekFrom::Start(table as u64))?;
    out.write_all(&offsets.iter().flat_map(|offset| offset.to_le_bytes()).collect::<Vec<u8>>())?;
    out.seek(SeekFrom::Start(hash_place as u64))?;
    out.write_all(hash.text().as_bytes())?;
    out.seek(SeekFrom::End(0))?;
    Ok(rows)
}

/// The buffer size in bytes.
const BUFFER: usize = 1 << 20;

/// The bytes before the table of rows, and the place of the pixels' hash in them: the header of a one-row picture, with
/// another height and compression.
fn head(
    [width, height]: [u32; 2],
    channels: &[String],
    options: ExrOptions,
    metadata: &[(String, String)],
) -> Result<(Vec<u8>, usize), PictureError> {
    const RLE: u8 = 1;
    let row = |name: &String| Channel::new(name.clone(), vec![0.0; width as usize]);
    let image = Image { width, height: 1, channels: channels.iter().map(row).collect() };
    let mut bytes = encode_exr(&image, ExrOptions { uncompressed: true, ..options }, metadata)?;
    let (mut end, mut hash_place) = (8, 0);
    for attribute in attributes(&bytes) {
        end = attribute.end;
        let text = &bytes[attribute.clone()];
        if text.starts_with(b"compression\0") {
            bytes[attribute.end - 1] = RLE;
        } else if text.starts_with(format!("{PIXEL_HASH}\0").as_bytes()) {
            hash_place = attribute.end - PixelHash::default().text().len();
        } else if text.starts_with(b"dataWindow\0") {
            let at = attribute.end - 4;
            let last = i32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]);
            bytes[at..at + 4].copy_from_slice(&(last + height as i32 - 1).to_le_bytes());
        }
    }
    bytes.truncate(end + 1);
    Ok((bytes, hash_place))
}

/// The run-length code of a row of `size` zero bytes: differences of neighbours with offset 128, in runs of up to 128.
fn black(size: usize) -> Vec<u8> {
    const RUN: usize = 128;
    let mut code = vec![(-1i8).cast_unsigned(), 0];
    let mut left = size.saturating_sub(1);
    while left > 0 {
        let run = left.min(RUN);
        code.extend([(run - 1) as u8, 128]);
        left -= run;
    }
    code
}

impl Kind {
    fn bytes(self) -> usize {
        match self {
            Kind::Half => 2,
            Kind::Uint | Kind::Float => 4,
        }
    }

    fn put(self, values: &[f32], out: &mut Vec<u8>) {
        match self {
            Kind::Half => out.extend(values.iter().flat_map(|v| Kind::half(*v).to_le_bytes())),
            Kind::Uint => out.extend(values.iter().flat_map(|v| (*v as u32).to_le_bytes())),
            Kind::Float => out.extend(values.iter().flat_map(|v| v.to_le_bytes())),
        }
    }

    /// A value as it is read from the file.
    pub(super) fn stored(self, v: f32) -> f32 {
        match self {
            Kind::Half => from_half(Kind::half(v).to_bits()),
            Kind::Uint => v as u32 as f32,
            Kind::Float => v,
        }
    }

    /// The nearest half float. Colours above 65504, the largest finite half, become 65504 instead of infinity.
    pub(super) fn half(v: f32) -> f16 {
        const MOST: f32 = 65_504.0;
        f16::from_f32(if v.is_finite() { v.clamp(-MOST, MOST) } else { v })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::exr::decode_exr;
    use std::cell::Cell;
    use std::io::Cursor;

    #[test]
    fn a_part_is_the_picture_as_far_as_time_goes() {
        let names = ["R", "G", "B", "depth.Z", "object_id.X"].map(String::from);
        let [width, height] = [37u32, 23u32];
        let value = |channel: usize, i: usize| if i % 200 < 90 { 0.0 } else { (i * 5 + channel) as f32 };
        let fill = |channel: usize, range: Range<usize>, out: &mut [f32]| {
            out.iter_mut().zip(range).for_each(|(v, i)| *v = value(channel, i));
        };
        let window = Window { at: [3, -2], whole: [90, 80] };
        for (half, uint_ids) in [(false, false), (true, false), (false, true)] {
            let options = ExrOptions { half, uint_ids, window: Some(window), uncompressed: false };
            for most in [0, 1, 11, 23] {
                let asked = Cell::new(0);
                let goes_on = || asked.replace(asked.get() + 1) < most;
                let mut out = Cursor::new(Vec::new());
                let texts = [("unfinished".to_owned(), "interrupted".to_owned())];
                let rows = write_exr_part([width, height], &names, &fill, options, &texts, &mut out, goes_on).unwrap();
                assert_eq!(rows, most);
                let read = decode_exr(&out.into_inner()).unwrap();
                // The result of the full encoder for the filled rows.
                let end = (most * width) as usize;
                let data =
                    |c: usize| (0..(width * height) as usize).map(move |i| if i < end { value(c, i) } else { 0.0 });
                let channels = names.iter().enumerate().map(|(c, name)| Channel::new(name.clone(), data(c).collect()));
                let image = Image { width, height, channels: channels.collect() };
                let whole = decode_exr(&encode_exr(&image, options, &texts).unwrap()).unwrap();
                assert_eq!(read, whole);
            }
        }
        // Rows that are shorter than their code are stored as they are.
        let mut out = Cursor::new(Vec::new());
        let half = ExrOptions { half: true, ..ExrOptions::default() };
        write_exr_part([1, 2], &["Y".into()], &|_, _, _| {}, half, &[], &mut out, || false).unwrap();
        let bytes = out.into_inner();
        assert_eq!(decode_exr(&bytes).unwrap().image.channels[0].data, [0.0; 2]);
        assert!(bytes.ends_with(&[2, 0, 0, 0, 0, 0]), "the size of the last row, and its only half");
    }
}
