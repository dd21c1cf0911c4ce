//! OpenEXR: the first part with colour or grey, stored in single or half precision as in the file.
//!
//! This module opens a file and finds its blocks; the crate `exr` reads headers and unpacks blocks. Blocks are unpacked
//! in parallel, each inside a [`guarded`] call, because a panic on the crate's own threads ends the program. DWA
//! compression is refused: the crate's decoder allocates as much memory as a block declares. It also has different
//! kernels for different processors, which round differently (its `compression/dwa/discrete_cosine_transform`).

mod scan_lines;

pub(crate) use scan_lines::ScanLines;

use super::{DENSEST, DWA, ImageError, ImageFormat, SMALL, decoder, is_within_budget, judge, room, with_memory};
use crate::codec::is_exr;
use crate::guard::guarded;
use ::exr::block::UncompressedBlock;
use ::exr::block::chunk::{Chunk, CompressedBlock, CompressedScanLineBlock, CompressedTileBlock, TileCoordinates};
use ::exr::compression::Compression;
use ::exr::error::Error;
use ::exr::math::Vec2;
use ::exr::meta::BlockDescription;
use ::exr::meta::MetaData;
use ::exr::meta::attribute::SampleType;
use ::exr::meta::header::Header;
use canaletto::texture::{ColorSpace, Image, Samples};
use canaletto_parallel::prelude::*;
use std::collections::HashSet;
use std::io::Cursor;
use std::ops::Range;

const FORMAT: &str = "OpenEXR";
const CHROMA: &str = "colour as luminance and chroma (Y RY BY)";

/// The largest memory of unpacked blocks that wait to be copied, in bytes. A single block may exceed it.
const BATCH: usize = 16 << 20;

/// A file whose headers are parsed and validated.
pub(crate) struct File<'a> {
    bytes: &'a [u8],
    meta: MetaData,
    /// The byte range of each part's block offset table.
    tables: Vec<Range<usize>>,
}

/// A block of a part's finest level.
struct Block<'a> {
    x: usize,
    y: usize,
    width: usize,
    height: usize,
    packed: &'a [u8],
    chunk: Place,
}

enum Place {
    Line(i32),
    Tile(Vec2<usize>),
}

impl<'a> File<'a> {
    /// Parses the headers and validates the sizes that they declare.
    pub(crate) fn open(bytes: &'a [u8]) -> Result<File<'a>, ImageError> {
        let (meta, tables) = parse_headers(bytes, bytes.len())?;
        Ok(File { bytes, meta, tables })
    }

    /// The headers of the parts.
    pub(crate) fn parts(&self) -> &[Header] {
        &self.meta.headers
    }

    /// Passes the rows of some channels of a part to `put`: the index of the channel in `channels`, the row and its
    /// first column, and the bytes of the row in native order.
    pub(crate) fn rows(
        &self,
        part: usize,
        channels: &[usize],
        mut put: impl FnMut(usize, usize, usize, &[u8]),
    ) -> Result<(), ImageError> {
        let header = &self.meta.headers[part];
        let blocks = self.blocks(part)?;
        let sizes: Vec<usize> = header.channels.list.iter().map(|c| c.sample_type.bytes_per_sample()).collect();
        let pixel = pixel(header);
        let mut rest = blocks.as_slice();
        while !rest.is_empty() {
            let mut sum = 0;
            let few = rest.iter().take_while(|block| {
                sum += block.width * block.height * pixel;
                sum <= BATCH
            });
            let (batch, later) = rest.split_at(few.count().max(1));
            rest = later;
            let unpacked = batch.par_iter().map(|block| unpack(&self.meta, part, block)).collect();
            let unpacked = unpacked.into_iter().collect::<Result<Vec<Vec<u8>>, ImageError>>()?;
            for (block, data) in batch.iter().zip(&unpacked) {
                for (row, line) in data.chunks_exact(block.width * pixel).enumerate() {
                    for (place, &channel) in channels.iter().enumerate() {
                        let start = block.width * sizes[..channel].iter().sum::<usize>();
                        let samples = &line[start..start + block.width * sizes[channel]];
                        put(place, block.y + row, block.x, samples);
                    }
                }
            }
        }
        Ok(())
    }

    /// Checks that a part can be unpacked, before `memory` bytes are allocated for it.
    pub(crate) fn check(&self, part: usize, memory: u64) -> Result<(), ImageError> {
        let blocks = self.blocks(part)?;
        if is_within_budget(memory, self.bytes.len()) {
            return Ok(());
        }
        blocks.par_iter().find_map_first(|block| unpack(&self.meta, part, block).err()).map_or(Ok(()), Err)
    }

    /// The blocks of a part's finest level, each once.
    fn blocks(&self, part: usize) -> Result<Vec<Block<'a>>, ImageError> {
        let size = self.meta.headers[part].layer_size;
        let mut blocks = Vec::new();
        let mut seen = HashSet::new();
        let mut pixels = 0;
        for offset in self.bytes[self.tables[part].clone()].as_chunks().0 {
            let offset = u64::from_le_bytes(*offset);
            let Some(at) = usize::try_from(offset).ok().filter(|at| (8..self.bytes.len()).contains(at)) else {
                return Err(wrong("it wasn't written to its end: a block is missing"));
            };
            let Some(block) = block(&self.meta, part, &self.bytes[at..])? else { continue };
            if seen.insert((block.x, block.y)) {
                pixels += block.width * block.height;
                blocks.push(block);
            }
        }
        if pixels != size.x() * size.y() {
            return Err(wrong("blocks are missing"));
        }
        Ok(blocks)
    }
}

/// Parses the headers at the head of a file of `length` bytes, and validates the sizes that they declare. Returns them
/// with the byte range of each part's block offset table.
fn parse_headers(head: &[u8], length: usize) -> Result<(MetaData, Vec<Range<usize>>), ImageError> {
    let end = headers_end(head)?;
    let meta = decoder(FORMAT, || MetaData::read_from_buffered(Cursor::new(&head[..end]), false).map_err(damaged))?;
    let mut at = end;
    let mut tables = Vec::new();
    for header in &meta.headers {
        if header.deep {
            return Err(unsupported("deep data"));
        }
        match header.compression {
            Compression::DWAA(_) | Compression::DWAB(_) => {
                return Err(unsupported(DWA));
            }
            Compression::HTJ2K32 | Compression::HTJ2K256 => return Err(unsupported("JPEG 2000 compression")),
            _ => {}
        }
        if header.channels.list.is_empty() {
            return Err(wrong("it has no channels"));
        }
        // The crate intends to refuse these, but its B44 decoder runs for seconds with a large sampling distance.
        if header.channels.list.iter().any(|c| c.sampling != Vec2(1, 1)) {
            let chroma = header.channels.list.iter().any(|c| c.name == *"RY" || c.name == *"BY");
            return Err(unsupported(if chroma { CHROMA } else { "channels of fewer pixels than others" }));
        }
        let (width, height) = (header.layer_size.x() as u64, header.layer_size.y() as u64);
        let pixel = pixel(header) as u64;
        judge(FORMAT, width, height, (DENSEST * length as u64).max(SMALL) / pixel.max(1), length)?;
        let table = at..header.chunk_count.saturating_mul(8).saturating_add(at);
        if table.end > length {
            return Err(wrong("it ends too early"));
        }
        at = table.end;
        tables.push(table);
    }
    Ok((meta, tables))
}

/// The block of a part at the start of these bytes; None if it isn't of the finest level.
fn block<'a>(meta: &MetaData, part: usize, bytes: &'a [u8]) -> Result<Option<Block<'a>>, ImageError> {
    let header = &meta.headers[part];
    let [width, height] = [header.layer_size.x(), header.layer_size.y()];
    let number = |at: usize| -> Result<i32, ImageError> {
        let bytes = bytes.get(at..at + 4).and_then(|b| <[u8; 4]>::try_from(b).ok());
        bytes.map(i32::from_le_bytes).ok_or_else(|| wrong("it ends too early"))
    };
    let mut at = 0;
    if meta.requirements.has_multiple_layers {
        if number(at)? != part as i32 {
            return Err(wrong("a block belongs to another part"));
        }
        at += 4;
    }
    let (chunk, x, y, most) = match header.blocks {
        BlockDescription::ScanLines => {
            let line = number(at)?;
            let rows = header.compression.scan_lines_per_block();
            let y = i64::from(line) - i64::from(header.own_attributes.layer_position.y());
            let y = usize::try_from(y).ok().filter(|y| *y < height && y.is_multiple_of(rows));
            at += 4;
            (Place::Line(line), 0, y, [width, rows])
        }
        BlockDescription::Tiles(tiles) => {
            let [i, j, level_x, level_y] = [number(at)?, number(at + 4)?, number(at + 8)?, number(at + 12)?];
            at += 16;
            if level_x != 0 || level_y != 0 {
                return Ok(None);
            }
            let [i, j] = [i, j].map(|v| usize::try_from(v).unwrap_or(usize::MAX));
            let y = Some(j.saturating_mul(tiles.tile_size.y())).filter(|y| *y < height);
            let x = i.saturating_mul(tiles.tile_size.x());
            (Place::Tile(Vec2(i, j)), x, y, [tiles.tile_size.x(), tiles.tile_size.y()])
        }
    };
    let Some(y) = y.filter(|_| x < width) else { return Err(wrong("a block lies outside of its picture")) };
    let size = usize::try_from(number(at)?).map_err(|_| wrong("a block has a negative size"))?;
    let packed = bytes.get(at + 4..(at + 4).saturating_add(size)).ok_or_else(|| wrong("it ends too early"))?;
    let block = Block { x, y, width: most[0].min(width - x), height: most[1].min(height - y), packed, chunk };
    // PXR24 stores 24 of 32 bits, so unpacking adds a byte to every three.
    let announced = (block.width * block.height) as u64 * pixel(header) as u64;
    if announced > (size as u64 + 64) * (DENSEST + DENSEST / 3) {
        return Err(wrong("a block announces more than its bytes can hold"));
    }
    Ok(Some(block))
}

fn unpack(meta: &MetaData, part: usize, block: &Block) -> Result<Vec<u8>, ImageError> {
    let compressed_pixels_le = block.packed.to_vec();
    let compressed_block = match block.chunk {
        Place::Line(y_coordinate) => {
            CompressedBlock::ScanLine(CompressedScanLineBlock { y_coordinate, compressed_pixels_le })
        }
        Place::Tile(tile_index) => CompressedBlock::Tile(CompressedTileBlock {
            coordinates: TileCoordinates { tile_index, level_index: Vec2(0, 0) },
            compressed_pixels_le,
        }),
    };
    let chunk = Chunk { layer_index: part, compressed_block };
    let unpacked = guarded(|| UncompressedBlock::decompress_chunk(chunk, meta, false));
    let data = unpacked.ok_or_else(|| wrong("a block can't be unpacked"))?.map_err(damaged)?.data;
    if data.len() != block.width * block.height * pixel(&meta.headers[part]) {
        return Err(wrong("a block has another size than it should"));
    }
    Ok(data)
}

/// The size of a pixel in bytes, all channels together.
fn pixel(header: &Header) -> usize {
    header.channels.list.iter().map(|c| c.sample_type.bytes_per_sample()).sum()
}

/// The size that the first part of an EXR declares.
pub(crate) fn size(bytes: &[u8]) -> Option<[u32; 2]> {
    let file = File::open(bytes).ok()?;
    let size = file.parts().first()?.layer_size;
    Some([size.x() as u32, size.y() as u32])
}

/// The offset at which the headers end. An attribute is a name, a type, a size and as many bytes. An empty name ends a
/// header. In a file with several parts, an empty header ends the headers.
fn headers_end(bytes: &[u8]) -> Result<usize, ImageError> {
    let short = || wrong("it ends in its header");
    let flags = *bytes.get(5).ok_or_else(short)?;
    let several = flags & 0x10 != 0;
    if flags & 0x08 != 0 {
        return Err(unsupported("deep data"));
    }
    let mut at = 8;
    loop {
        let start = at;
        while *bytes.get(at).ok_or_else(short)? != 0 {
            for _ in 0..2 {
                let length = bytes[at..].iter().take(257).position(|b| *b == 0);
                at += 1 + length.ok_or_else(|| wrong("its header isn't made of names and values"))?;
            }
            let size = bytes.get(at..at + 4).and_then(|b| <[u8; 4]>::try_from(b).ok()).ok_or_else(short)?;
            let end = u64::from(u32::from_le_bytes(size)) + at as u64 + 4;
            at = usize::try_from(end).ok().filter(|end| *end < bytes.len()).ok_or_else(short)?;
        }
        at += 1;
        if !several || at == start + 1 {
            return Ok(at);
        }
    }
}

/// OpenEXR in the table of images.
pub(super) const IMAGE: ImageFormat =
    ImageFormat { name: FORMAT, recognises: is_exr, read: Ok(|bytes| Ok(with_memory(read(bytes)?))) };

/// Reads an EXR: the channels R, G, B or Y, and A. The image is the part's data window.
fn read(bytes: &[u8]) -> Result<Image, ImageError> {
    let file = File::open(bytes)?;
    let find = |header: &Header, name: &str| header.channels.list.iter().position(|c| c.name == *name);
    let has = |header: &Header, name: &str| find(header, name).is_some();
    let color = |header: &Header| ["R", "G", "B"].iter().all(|name| has(header, name));
    let Some(part) = file.parts().iter().position(|header| color(header) || has(header, "Y")) else {
        let names = file.parts().iter().flat_map(|header| header.channels.list.iter().map(|c| c.name.to_string()));
        let names: Vec<String> = names.take(20).collect();
        return Err(unsupported(format!("the channels {} instead of R G B or Y", names.join(", "))));
    };
    let header = &file.parts()[part];
    let gray = !color(header);
    if gray && (has(header, "RY") || has(header, "BY")) {
        return Err(unsupported(CHROMA));
    }
    let strip_chunks: &[&str] = if gray { &["Y", "A"] } else { &["R", "G", "B", "A"] };
    let strip_chunks: Vec<usize> = strip_chunks.iter().filter_map(|name| find(header, name)).collect();
    let types: Vec<SampleType> = strip_chunks.iter().map(|c| header.channels.list[*c].sample_type).collect();
    let half = types.iter().all(|t| *t == SampleType::F16);
    let (width, height, channels) = (header.layer_size.x(), header.layer_size.y(), strip_chunks.len());
    let count = width * height * channels;
    file.check(part, count as u64 * if half { 2 } else { 4 })?;
    // The channels of a pixel are adjacent in the image.
    let place = |channel: usize, y: usize, x: usize| (y * width + x) * channels + channel;
    let samples = if half {
        let mut data: Vec<u16> = room(count)?;
        data.resize(count, 0);
        file.rows(part, &strip_chunks, |channel, y, x, row| {
            let to = data[place(channel, y, x)..].iter_mut().step_by(channels);
            to.zip(row.as_chunks().0).for_each(|(v, two)| *v = u16::from_ne_bytes(*two));
        })?;
        Samples::F16(data)
    } else {
        let mut data: Vec<f32> = room(count)?;
        data.resize(count, 0.0);
        file.rows(part, &strip_chunks, |channel, y, x, row| {
            let to = data[place(channel, y, x)..].iter_mut().step_by(channels);
            to.zip(floats(types[channel], row)).for_each(|(v, number)| *v = number);
        })?;
        Samples::F32(data)
    };
    let (width, height, premultiplied) = (width as u32, height as u32, has(header, "A"));
    let (name, space) = (String::new(), ColorSpace::Linear);
    Ok(Image { name, width, height, channels: channels as u8, samples, space, premultiplied })
}

/// The samples of a row as `f32`.
pub(crate) fn floats(kind: SampleType, row: &[u8]) -> impl Iterator<Item = f32> + '_ {
    row.chunks_exact(kind.bytes_per_sample()).map(move |bytes| match (kind, bytes) {
        (SampleType::F16, &[a, b]) => canaletto::texture::from_half(u16::from_ne_bytes([a, b])),
        (SampleType::U32, &[a, b, c, d]) => u32::from_ne_bytes([a, b, c, d]) as f32,
        (_, &[a, b, c, d]) => f32::from_ne_bytes([a, b, c, d]),
        _ => 0.0,
    })
}

fn damaged(error: Error) -> ImageError {
    match error {
        Error::NotSupported(what) => {
            // The crate's message already contains that it isn't supported.
            let what = what.trim_end_matches(" not supported yet").trim_start_matches("yet unimplemented ");
            unsupported(what)
        }
        Error::Invalid(what) => wrong(what),
        other => wrong(other.to_string()),
    }
}

fn unsupported(what: impl Into<String>) -> ImageError {
    ImageError::Unsupported { format: FORMAT, what: what.into() }
}

fn wrong(reason: impl Into<String>) -> ImageError {
    ImageError::Damaged { format: FORMAT, reason: reason.into() }
}
