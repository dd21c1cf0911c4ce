//! What a file holds, read in pieces from any place and by many threads at once, so that no large file need be in memory
//! as a whole.

use canaletto::memory;
use std::borrow::Cow;
use std::fs::File;
use std::io;
use std::ops::Range;

/// What a file holds: its bytes, or the file itself.
#[derive(Debug)]
pub enum Content {
    /// The bytes.
    Memory(Vec<u8>),
    /// A file that is open for reading, and its size when it was opened. What is added to it later is not seen; if it becomes
    /// shorter, reading fails.
    File(File, usize),
}

impl Content {
    /// A view of all of it.
    pub fn view(&self) -> View<'_> {
        match self {
            Content::Memory(bytes) => View::Memory(bytes),
            Content::File(file, size) => View::File(file, *size),
        }
    }
}

/// A view of what a file holds.
#[derive(Clone, Copy, Debug)]
pub enum View<'a> {
    /// The bytes.
    Memory(&'a [u8]),
    /// An open file, and its size.
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

    /// Fills `out` with the bytes from `at` on.
    ///
    /// # Errors
    /// Those of the system, or that the file is shorter.
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

    /// The bytes of a range, which may reach beyond the end: what is there of it. They lie in `buffer` if they come from a file.
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
    /// As [`View::fill`], or that there is no memory for them.
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
    // A file has one place at which it is read.
    static READING: Mutex<()> = Mutex::new(());
    let _one = READING.lock().unwrap_or_else(PoisonError::into_inner);
    file.seek(io::SeekFrom::Start(at))?;
    file.read_exact(out)
}
