//! Files of one part in scan lines, whose rows are read when they are asked for.

use super::{block, headers_end, is_exr, parse_headers, pixel, unpack, unsupported, wrong};
use crate::image::ImageError;
use ::exr::meta::BlockDescription;
use ::exr::meta::MetaData;
use ::exr::meta::header::Header;
use std::fs;
use std::io::{self, Read, Seek, SeekFrom};
use std::ops::Range;
use std::path::{Path, PathBuf};

/// A file of one part in scan lines, of which only the headers are in memory.
#[derive(Debug)]
pub(crate) struct ScanLines {
    path: PathBuf,
    meta: MetaData,
    /// The byte range of each block. Its end is the start of the next one, or as far as a block can go.
    blocks: Vec<Range<u64>>,
}

impl ScanLines {
    /// The number of bytes that are read at first, and the most that headers may have.
    const HEAD: [usize; 2] = [1 << 16, 1 << 26];

    /// Opens a file, and parses its header.
    pub(crate) fn open(path: &Path) -> io::Result<Result<ScanLines, ImageError>> {
        let mut file = fs::File::open(path)?;
        let length = file.metadata()?.len();
        let mut head = Vec::new();
        let mut size = ScanLines::HEAD[0];
        loop {
            file.by_ref().take((size - head.len()) as u64).read_to_end(&mut head)?;
            if head.len() < size || size >= ScanLines::HEAD[1] || !is_exr(&head) || headers_end(&head).is_ok() {
                break;
            }
            size *= 2;
        }
        let (meta, tables) = match parse_headers(&head, usize::try_from(length).unwrap_or(usize::MAX)) {
            Ok(headers) => headers,
            Err(error) => return Ok(Err(error)),
        };
        let ([header], [table]) = (&*meta.headers, &*tables) else { return Ok(Err(unsupported("several parts"))) };
        if header.blocks != BlockDescription::ScanLines {
            return Ok(Err(unsupported("tiles instead of scan lines")));
        }
        file.seek(SeekFrom::Start(table.start as u64))?;
        let mut offsets = vec![0; table.len()];
        file.read_exact(&mut offsets)?;
        let offsets: Vec<u64> = offsets.as_chunks().0.iter().map(|offset| u64::from_le_bytes(*offset)).collect();
        let mut sorted = offsets.clone();
        sorted.sort_unstable();
        // A block that grows by its compression is stored as it is.
        let rows = header.compression.scan_lines_per_block();
        let most = 8 + (header.layer_size.x() * rows * pixel(header)) as u64;
        let end = |start: u64| {
            let next = sorted[sorted.partition_point(|other| *other <= start)..].first();
            next.copied().unwrap_or(length).min(start.saturating_add(most))
        };
        let blocks = offsets.iter().map(|start| *start..end(*start)).collect();
        Ok(Ok(ScanLines { path: path.to_owned(), meta, blocks }))
    }

    /// The header.
    pub(crate) fn header(&self) -> &Header {
        &self.meta.headers[0]
    }

    /// Reads rows from the file. Passes each channel of each row to `put`: the index of the channel, the row, and its
    /// bytes in native order.
    pub(crate) fn rows(
        &self,
        rows: Range<usize>,
        mut put: impl FnMut(usize, usize, &[u8]),
    ) -> io::Result<Result<(), ImageError>> {
        let header = self.header();
        let each = header.compression.scan_lines_per_block();
        let wanted = self.blocks.get(rows.start / each..rows.end.div_ceil(each)).unwrap_or_default();
        let mut file = fs::File::open(&self.path)?;
        let mut bytes = Vec::new();
        let mut at = None;
        for (place, range) in (rows.start / each..).zip(wanted) {
            if at != Some(range.start) {
                file.seek(SeekFrom::Start(range.start))?;
            }
            bytes.clear();
            file.by_ref().take(range.end.saturating_sub(range.start)).read_to_end(&mut bytes)?;
            at = Some(range.start + bytes.len() as u64);
            if let Err(error) = self.block_rows(place * each, &bytes, &rows, &mut put) {
                return Ok(Err(error));
            }
        }
        Ok(Ok(()))
    }

    /// Passes those rows of a block that are in a range to `put`. Its first row is `first`.
    fn block_rows(
        &self,
        first: usize,
        bytes: &[u8],
        rows: &Range<usize>,
        put: &mut impl FnMut(usize, usize, &[u8]),
    ) -> Result<(), ImageError> {
        let block = block(&self.meta, 0, bytes)?.filter(|block| block.y == first);
        let block = block.ok_or_else(|| wrong("it wasn't written to its end: a block is missing"))?;
        let data = unpack(&self.meta, 0, &block)?;
        let header = self.header();
        for (y, line) in (first..).zip(data.chunks_exact(block.width * pixel(header))) {
            let mut rest = line;
            for (channel, description) in header.channels.list.iter().enumerate() {
                let (samples, next) = rest.split_at(block.width * description.sample_type.bytes_per_sample());
                rest = next;
                if rows.contains(&y) {
                    put(channel, y, samples);
                }
            }
        }
        Ok(())
    }
}
