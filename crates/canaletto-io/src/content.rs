//! The content of a file, read in pieces at any offset and from many threads at once. Large files need not be in memory
//! as a whole.

use canaletto::memory;
use std::borrow::Cow;
use std::fs::File;
use std::io;
use std::ops::Range;

/// The content of a file: its bytes in memory, or the open file.
#[derive(Debug)]
pub enum Content {
    /// The bytes in memory.
    Memory(Vec<u8>),
    /// A file that is open for reading, and its size in bytes when it was opened. Bytes that are appended later are
    /// ignored. Reading fails if the file becomes shorter.
    File(File, usize),
}

impl Content {
    /// A view of the whole content.
    pub fn view(&self) -> View<'_> {
        match self {
            Content::Memory(bytes) => View::Memory(bytes),
            Content::File(file, size) => View::File(file, *size),
        }
    }
}

/// A view of the content of a file.
#[derive(Clone, Copy, Debug)]
pub enum View<'a> {
    /// The bytes in memory.
    Memory(&'a [u8]),
    /// An open file and its size in bytes.
    File(&'a File, usize),
}

impl<'a> From<&'a [u8]> for View<'a> {
    fn from(bytes: &'a [u8]) -> View<'a> {
        View::Memory(bytes)
    }
}

impl<'a> View<'a> {
    /// The number of bytes.
    pub fn size(self) -> usize {
        match self {
            View::Memory(bytes) => bytes.len(),
            View::File(_, size) => size,
        }
    }

    /// Fills `out` with the bytes from offset `at` on.
    ///
    /// # Errors
    /// The system's error, or `UnexpectedEof` if the file is shorter.
    pub fn fill(self, at: usize, out: &mut [u8]) -> io::Result<()> {
        match self {
            View::Memory(bytes) => {
                let bytes = bytes.get(at..).and_then(|rest| rest.get(..out.len()));
                out.copy_from_slice(bytes.ok_or(io::ErrorKind::UnexpectedEof)?);
                Ok(())
            }
            View::File(file, _) => fill(file, at as u64, out),
        }
    }

    /// The bytes of a range, cut at the end of the content. `buffer` holds them if they come from a file.
    ///
    /// # Errors
    /// As [`View::fill`].
    pub fn piece<'b>(self, range: Range<usize>, buffer: &'b mut Vec<u8>) -> io::Result<&'b [u8]>
    where
        'a: 'b,
    {
        let (start, end) = (range.start.min(self.size()), range.end.min(self.size()));
        match self {
            View::Memory(bytes) => Ok(&bytes[start..end.max(start)]),
            View::File(file, _) => {
                buffer.resize(end.saturating_sub(start), 0);
                fill(file, start as u64, buffer)?;
                Ok(buffer)
            }
        }
    }

    /// All bytes.
    ///
    /// # Errors
    /// As [`View::fill`], and `OutOfMemory` if memory for the bytes can't be allocated.
    pub fn whole(self) -> io::Result<Cow<'a, [u8]>> {
        match self {
            View::Memory(bytes) => Ok(bytes.into()),
            View::File(file, size) => {
                let mut bytes = Vec::new();
                memory::reserve(&mut bytes, size).map_err(|e| io::Error::new(io::ErrorKind::OutOfMemory, e))?;
                bytes.resize(size, 0);
                fill(file, 0, &mut bytes)?;
                Ok(bytes.into())
            }
        }
    }
}

#[cfg(unix)]
fn fill(file: &File, at: u64, out: &mut [u8]) -> io::Result<()> {
    std::os::unix::fs::FileExt::read_exact_at(file, out, at)
}

#[cfg(windows)]
fn fill(file: &File, mut at: u64, mut out: &mut [u8]) -> io::Result<()> {
    while !out.is_empty() {
        match std::os::windows::fs::FileExt::seek_read(file, out, at) {
            Ok(0) => return Err(io::ErrorKind::UnexpectedEof.into()),
            Ok(read) => (at, out) = (at + read as u64, &mut out[read..]),
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

#[cfg(not(any(unix, windows)))]
fn fill(mut file: &File, at: u64, out: &mut [u8]) -> io::Result<()> {
    use std::io::{Read, Seek};
    use std::sync::{Mutex, PoisonError};
    // A file has a single cursor here, so reads take turns.
    static READING: Mutex<()> = Mutex::new(());
    let _one = READING.lock().unwrap_or_else(PoisonError::into_inner);
    file.seek(io::SeekFrom::Start(at))?;
    file.read_exact(out)
}
