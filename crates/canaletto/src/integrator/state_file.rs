//! Files of what integrators prepared: magic number, version, values and lists, checksum. All numbers keep their bits.

use crate::WordHash;
use glam::{DVec3, Vec3};
use std::io::{self, BufReader, BufWriter, ErrorKind, Read, Write};

/// The reason why a file of what an integrator prepared can't be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StateFileError {
    /// The system can't read the file, or has no memory for it.
    #[error("{0}")]
    Unreadable(io::Error),
    /// The file is something else.
    #[error("it isn't {content}")]
    Foreign {
        /// What it should be.
        content: &'static str,
    },
    /// The file has a version of the format that this program doesn't know.
    #[error("its format is version {found}, and this program reads version {known}")]
    Version {
        /// The version of the file's format.
        found: u32,
        /// The version that this program reads.
        known: u32,
    },
    /// The file ends before its content.
    #[error("it ends too early: it is cut off or damaged")]
    CutOff,
    /// Bytes of the file were changed.
    #[error("it is damaged: its content doesn't match its checksum")]
    Damaged,
}

/// A format of such files.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StateFormat {
    /// The first bytes of a file. As in PNG files, they betray a file that was changed as a text.
    pub(crate) magic: [u8; 8],
    /// The version of the format.
    pub(crate) version: u32,
    /// What a file is, for messages.
    pub(crate) content: &'static str,
}

/// A file that is being written.
pub(crate) struct Writer<'a> {
    out: BufWriter<&'a mut dyn Write>,
    checksum: WordHash,
}

impl<'a> Writer<'a> {
    /// Begins a file.
    pub(crate) fn begin(out: &'a mut dyn Write, format: StateFormat) -> io::Result<Writer<'a>> {
        let mut writer = Writer { out: BufWriter::new(out), checksum: WordHash::new() };
        writer.bytes(&format.magic)?;
        format.version.put(&mut writer)?;
        Ok(writer)
    }

    /// Ends the file with its checksum.
    pub(crate) fn finish(mut self) -> io::Result<()> {
        let checksum = self.checksum.finish();
        self.bytes(&checksum.to_le_bytes())?;
        self.out.flush()
    }

    pub(crate) fn bytes(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.checksum.add_bytes(bytes);
        self.out.write_all(bytes)
    }

    /// Writes the number of records, and the records.
    pub(crate) fn list<T: Record>(&mut self, records: &[T]) -> io::Result<()> {
        (records.len() as u64).put(self)?;
        records.iter().try_for_each(|record| record.put(self))
    }
}

/// A file that is being read.
pub(crate) struct Reader<'a> {
    input: BufReader<&'a mut dyn Read>,
    /// The bytes that are left.
    left: u64,
    checksum: WordHash,
}

impl<'a> Reader<'a> {
    /// Begins a file of `length` bytes.
    pub(crate) fn begin(
        input: &'a mut dyn Read,
        length: u64,
        format: StateFormat,
    ) -> Result<Reader<'a>, StateFileError> {
        let mut reader = Reader { input: BufReader::new(input), left: length, checksum: WordHash::new() };
        match reader.bytes() {
            Ok(magic) if magic == format.magic => {}
            Err(error @ StateFileError::Unreadable(_)) => return Err(error),
            _ => return Err(StateFileError::Foreign { content: format.content }),
        }
        let found = u32::take(&mut reader)?;
        if found == format.version { Ok(reader) } else { Err(StateFileError::Version { found, known: format.version }) }
    }

    /// Checks that the file ends here, with its checksum.
    pub(crate) fn finish(mut self) -> Result<(), StateFileError> {
        let checksum = self.checksum.finish();
        if self.left == 8 && self.bytes()? == checksum.to_le_bytes() { Ok(()) } else { Err(StateFileError::Damaged) }
    }

    pub(crate) fn bytes<const N: usize>(&mut self) -> Result<[u8; N], StateFileError> {
        self.left = self.left.checked_sub(N as u64).ok_or(StateFileError::CutOff)?;
        let mut bytes = [0; N];
        self.input.read_exact(&mut bytes).map_err(|error| match error.kind() {
            ErrorKind::UnexpectedEof => StateFileError::CutOff,
            _ => StateFileError::Unreadable(error),
        })?;
        self.checksum.add_bytes(&bytes);
        Ok(bytes)
    }

    /// Reads the number of records, and the records. A number that the file has no room for takes no memory.
    pub(crate) fn list<T: Record>(&mut self) -> Result<Vec<T>, StateFileError> {
        let count = u64::take(self)?;
        if count > self.left / T::BYTES {
            return Err(StateFileError::CutOff);
        }
        let mut records = Vec::new();
        let count = usize::try_from(count).map_err(|_| StateFileError::CutOff)?;
        records.try_reserve_exact(count).map_err(|_| StateFileError::Unreadable(ErrorKind::OutOfMemory.into()))?;
        for _ in 0..count {
            records.push(T::take(self)?);
        }
        Ok(records)
    }
}

/// A value in a file.
pub(crate) trait Record: Sized {
    /// The number of bytes; for values of different sizes the least.
    const BYTES: u64;

    fn put(&self, writer: &mut Writer) -> io::Result<()>;
    fn take(reader: &mut Reader) -> Result<Self, StateFileError>;
}

macro_rules! number_record {
    ($($number:ty),*) => {$(
        impl Record for $number {
            const BYTES: u64 = size_of::<$number>() as u64;

            fn put(&self, writer: &mut Writer) -> io::Result<()> {
                writer.bytes(&self.to_le_bytes())
            }

            fn take(reader: &mut Reader) -> Result<$number, StateFileError> {
                reader.bytes().map(<$number>::from_le_bytes)
            }
        }
    )*};
}

number_record!(u8, u32, u64, f32, f64);

/// A record of several values in order.
macro_rules! record {
    ($name:ty, $make:expr, [$($field:ident: $kind:ty),*]) => {
        impl Record for $name {
            const BYTES: u64 = 0 $(+ <$kind as Record>::BYTES)*;

            fn put(&self, writer: &mut Writer) -> io::Result<()> {
                $(self.$field.put(writer)?;)*
                Ok(())
            }

            fn take(reader: &mut Reader) -> Result<$name, StateFileError> {
                $(let $field = <$kind>::take(reader)?;)*
                Ok($make)
            }
        }
    };
}

impl Record for bool {
    const BYTES: u64 = 1;

    fn put(&self, writer: &mut Writer) -> io::Result<()> {
        u8::from(*self).put(writer)
    }

    fn take(reader: &mut Reader) -> Result<bool, StateFileError> {
        match u8::take(reader)? {
            0 => Ok(false),
            1 => Ok(true),
            _ => Err(StateFileError::Damaged),
        }
    }
}

impl Record for DVec3 {
    const BYTES: u64 = 3 * f64::BYTES;

    fn put(&self, writer: &mut Writer) -> io::Result<()> {
        self.to_array().iter().try_for_each(|v| v.put(writer))
    }

    fn take(reader: &mut Reader) -> Result<DVec3, StateFileError> {
        Ok(DVec3::new(f64::take(reader)?, f64::take(reader)?, f64::take(reader)?))
    }
}

impl Record for Vec3 {
    const BYTES: u64 = 3 * f32::BYTES;

    fn put(&self, writer: &mut Writer) -> io::Result<()> {
        self.to_array().iter().try_for_each(|v| v.put(writer))
    }

    fn take(reader: &mut Reader) -> Result<Vec3, StateFileError> {
        Ok(Vec3::new(f32::take(reader)?, f32::take(reader)?, f32::take(reader)?))
    }
}

impl<T: Record + Copy + Default, const N: usize> Record for [T; N] {
    const BYTES: u64 = N as u64 * T::BYTES;

    fn put(&self, writer: &mut Writer) -> io::Result<()> {
        self.iter().try_for_each(|value| value.put(writer))
    }

    fn take(reader: &mut Reader) -> Result<[T; N], StateFileError> {
        let mut values = [T::default(); N];
        for value in &mut values {
            *value = T::take(reader)?;
        }
        Ok(values)
    }
}

pub(crate) use record;
