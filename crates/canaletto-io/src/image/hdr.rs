//! Radiance pictures (`.hdr`, `.pic`): Ward, *Real Pixels*, Graphics Gems II, and Radiance's `color.c` format.
//!
//! This decoder exists because it handles a picture's eight orientations, and because most pictures fit in half
//! precision, half the memory that libraries use. Values are m 2^(e − 136). EXPOSURE, which only records a factor that
//! was applied, is ignored, as in other programs.

use super::{DENSEST, ImageError, ImageFormat, SMALL, is_within_budget, judge, room, with_memory};
use canaletto::texture::{ColorSpace, Image, Samples, to_half};

const FORMAT: &str = "Radiance HDR";

/// Radiance HDR in the table of images.
pub(super) const IMAGE: ImageFormat = ImageFormat {
    name: FORMAT,
    recognises: is_hdr,
    read: Ok(|bytes| {
        let (image, memory) = with_memory(read(bytes)?);
        let packed = 4 * u64::from(image.width) * u64::from(image.height);
        Ok((image, memory + packed))
    }),
};

/// Whether the file starts like a Radiance picture.
pub(crate) fn is_hdr(bytes: &[u8]) -> bool {
    bytes.starts_with(b"#?RADIANCE") || bytes.starts_with(b"#?RGBE")
}

/// Reads a Radiance picture.
fn read(bytes: &[u8]) -> Result<Image, ImageError> {
    let mut input = Input { bytes, at: 0 };
    let axes = header(&mut input)?;
    let (across, down) = (axes.inner, axes.outer);
    let (width, height) = if axes.transposed { (down, across) } else { (across, down) };
    // A run of the newer packing has at most 127 values in two bytes; a run of the older one can be as long as a
    // scanline. Texels take four bytes while they are read, and up to twelve as numbers.
    judge(FORMAT, width.into(), height.into(), (SMALL + DENSEST * bytes.len() as u64) / 16, bytes.len())?;
    if !is_within_budget(16 * u64::from(width) * u64::from(height), bytes.len()) {
        // The data is checked for completeness before memory is allocated for it.
        let (start, mut line) = (input.at, room(across as usize)?);
        for _ in 0..down {
            line.clear();
            scanline(&mut input, across as usize, &mut line)?;
        }
        input.at = start;
    }
    let mut texels: Vec<[u8; 4]> = room(across as usize * down as usize)?;
    let mut line: Vec<[u8; 4]> = room(across as usize)?;
    for _ in 0..down {
        line.clear();
        scanline(&mut input, across as usize, &mut line)?;
        texels.extend_from_slice(&line);
    }
    let highest = texels.iter().map(|t| t[3]).max().unwrap_or(0);
    let count = texels.len() * 3;
    // Half precision has eleven bits for a mantissa of eight, and a range from 2⁻²⁴ to 65504.
    let samples = if (128..=144).contains(&highest) {
        let mut data: Vec<u16> = room(count)?;
        axes.each(|at| data.extend(light(texels[at]).map(to_half)));
        Samples::F16(data)
    } else {
        let mut data: Vec<f32> = room(count)?;
        axes.each(|at| data.extend(light(texels[at])));
        Samples::F32(data)
    };
    let space = ColorSpace::Linear;
    Ok(Image { name: String::new(), width, height, channels: 3, samples, space, premultiplied: false })
}

/// The colour of a texel of four bytes.
fn light([r, g, b, e]: [u8; 4]) -> [f32; 3] {
    // The power of two is built from bits, so it is exact even if subnormal. It consists of two factors, because a
    // single one may not be representable.
    let scale = if e == 0 { 0.0 } else { libm::ldexpf(1.0, i32::from(e) - 136) };
    [r, g, b].map(|m| f32::from(m) * scale)
}

struct Input<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Input<'_> {
    fn take<const N: usize>(&mut self) -> Result<[u8; N], ImageError> {
        let end = self.at + N;
        let bytes = self.bytes.get(self.at..end).and_then(|b| <[u8; N]>::try_from(b).ok());
        self.at = end;
        bytes.ok_or_else(|| damaged("it ends too early"))
    }

    fn line(&mut self) -> Result<&str, ImageError> {
        let rest = self.bytes.get(self.at..).unwrap_or_default();
        let end = rest.iter().take(4096).position(|b| *b == b'\n').ok_or_else(|| damaged("its header doesn't end"))?;
        self.at += end + 1;
        std::str::from_utf8(&rest[..end]).map_err(|_| damaged("its header isn't text"))
    }
}

fn damaged(reason: impl Into<String>) -> ImageError {
    ImageError::Damaged { format: FORMAT, reason: reason.into() }
}

/// The orientation of scanlines in the picture.
struct Axes {
    /// The number of texels in a scanline, and the number of scanlines.
    inner: u32,
    outer: u32,
    /// Whether scanlines are columns.
    transposed: bool,
    /// Whether scanlines run to the left or upwards, and whether the first is at the right or at the bottom.
    inner_back: bool,
    outer_back: bool,
}

impl Axes {
    /// Calls `visit` with the index in the file of each texel, in the order of the picture's rows.
    fn each(&self, mut visit: impl FnMut(usize)) {
        let (inner, outer) = (self.inner as usize, self.outer as usize);
        let (width, height) = if self.transposed { (outer, inner) } else { (inner, outer) };
        for y in 0..height {
            for x in 0..width {
                let (i, o) = if self.transposed { (y, x) } else { (x, y) };
                let i = if self.inner_back { inner - 1 - i } else { i };
                let o = if self.outer_back { outer - 1 - o } else { o };
                visit(o * inner + i);
            }
        }
    }
}

fn header(input: &mut Input) -> Result<Axes, ImageError> {
    for _ in 0..1000 {
        let line = input.line()?.trim_end();
        if line.is_empty() {
            return axes(input.line()?);
        }
        if let Some(format) = line.strip_prefix("FORMAT=")
            && format.trim() != "32-bit_rle_rgbe"
        {
            let what = format!("the pixel format {}", format.trim().escape_default());
            return Err(ImageError::Unsupported { format: FORMAT, what });
        }
    }
    Err(damaged("its header doesn't end"))
}

/// Parses `-Y 480 +X 640` and the seven other orientations.
fn axes(line: &str) -> Result<Axes, ImageError> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let wrong = || damaged("its size isn't written as in -Y 480 +X 640");
    let [outer_axis, outer, inner_axis, inner] = words[..] else { return Err(wrong()) };
    let number = |text: &str| text.parse::<u32>().map_err(|_| wrong());
    let (transposed, outer_back, inner_back) = match (outer_axis, inner_axis) {
        // −Y first means that the first scanline is the top one.
        ("-Y" | "+Y", "-X" | "+X") => (false, outer_axis == "+Y", inner_axis == "-X"),
        ("-X" | "+X", "-Y" | "+Y") => (true, outer_axis == "-X", inner_axis == "+Y"),
        _ => return Err(wrong()),
    };
    let (inner, outer) = (number(inner)?, number(outer)?);
    if inner == 0 || outer == 0 {
        let (width, height) = if transposed { (outer, inner) } else { (inner, outer) };
        return Err(ImageError::Empty { format: FORMAT, width: width.into(), height: height.into() });
    }
    Ok(Axes { inner, outer, transposed, inner_back, outer_back })
}

/// Reads one scanline in the newer or the older packing, or unpacked.
fn scanline(input: &mut Input, width: usize, line: &mut Vec<[u8; 4]>) -> Result<(), ImageError> {
    let first: [u8; 4] = input.take()?;
    let packed = first[0] == 2 && first[1] == 2 && first[2] < 128;
    if !packed || !(8..0x8000).contains(&width) {
        input.at -= 4;
        return old_scanline(input, width, line);
    }
    if usize::from(first[2]) << 8 | usize::from(first[3]) != width {
        return Err(damaged("a scanline has another length than the picture"));
    }
    line.resize(width, [0; 4]);
    for component in 0..4 {
        let mut x = 0;
        while x < width {
            let [count] = input.take()?;
            let (count, run) = if count > 128 { (usize::from(count - 128), true) } else { (usize::from(count), false) };
            if count == 0 || x + count > width {
                return Err(damaged("a run goes beyond its scanline"));
            }
            let value = if run { Some(input.take::<1>()?[0]) } else { None };
            for texel in &mut line[x..x + count] {
                texel[component] = match value {
                    Some(value) => value,
                    None => input.take::<1>()?[0],
                };
            }
            x += count;
        }
    }
    Ok(())
}

/// Reads texels one by one. A texel 1 1 1 n repeats the one before n times, and n · 256 times after another such texel.
fn old_scanline(input: &mut Input, width: usize, line: &mut Vec<[u8; 4]>) -> Result<(), ImageError> {
    let mut shift = 0;
    while line.len() < width {
        let texel: [u8; 4] = input.take()?;
        if texel[..3] != [1, 1, 1] {
            line.push(texel);
            shift = 0;
            continue;
        }
        let count = usize::from(texel[3]) << shift;
        let last = line.last().copied().ok_or_else(|| damaged("a scanline starts with a repetition"))?;
        if shift > 16 || line.len() + count > width {
            return Err(damaged("a run goes beyond its scanline"));
        }
        line.resize(line.len() + count, last);
        shift += 8;
    }
    Ok(())
}
