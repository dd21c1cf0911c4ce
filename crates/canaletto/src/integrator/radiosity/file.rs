//! Solutions as files: magic number, version, fingerprint, lists, checksum. `docs/radiosity-file.md` describes
//! the format. A change of the format, or of what its numbers mean, raises [`VERSION`].

use super::emitters::{Emitter, Emitters};
use super::fingerprint::SolutionFingerprint;
use super::interpolation::Interpolation;
use super::mesh::NONE;
use super::outline::Outline;
use super::root::Root;
use super::solution::{ArrivingLight, Patch, RadiositySolution, RootPlace, SolvedElement};
use crate::scene::{RadiosityMethod, RadiositySettings};
use crate::{Named, WordHash};
use glam::{DVec3, Vec3};
use std::io::{self, BufReader, BufWriter, ErrorKind, Read, Write};
use std::sync::Arc;

/// The first bytes of a solution's file. As in PNG files, they betray a file that was changed as a text.
const MAGIC: [u8; 8] = *b"\x89RAD\r\n\x1a\n";

/// The version of the format.
const VERSION: u32 = 1;

/// The reason why a solution's file can't be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SolutionFileError {
    /// The system can't read the file, or has no memory for it.
    #[error("{0}")]
    Unreadable(io::Error),
    /// The file is something else.
    #[error("it isn't a solution of radiosity")]
    Foreign,
    /// The file has a version of the format that this program doesn't know.
    #[error("its format is version {found}, and this program reads version {VERSION}")]
    Version {
        /// The version of the file's format.
        found: u32,
    },
    /// The file ends before its content.
    #[error("it ends too early: it is cut off or damaged")]
    CutOff,
    /// Bytes of the file were changed.
    #[error("it is damaged: its content doesn't match its checksum")]
    Damaged,
}

impl RadiositySolution {
    /// Writes the solution and the fingerprint of its scene. All numbers keep their bits.
    ///
    /// # Errors
    /// Those of the output.
    pub fn write(&self, fingerprint: &SolutionFingerprint, mut out: impl Write) -> io::Result<()> {
        let mut writer = Writer { out: BufWriter::new(&mut out), checksum: WordHash::new() };
        writer.bytes(&MAGIC)?;
        VERSION.put(&mut writer)?;
        fingerprint.put(&mut writer)?;
        let RadiositySolution {
            patches,
            outlines: _,
            elements,
            interpolation: Interpolation { points, light, centers, firsts, boundary },
            emitters: Emitters { polygons, excess },
            roots,
            origin,
            primitives,
            residual,
            links,
            limit_reached,
        } = self;
        origin.put(&mut writer)?;
        primitives.put(&mut writer)?;
        residual.put(&mut writer)?;
        (*links as u64).put(&mut writer)?;
        limit_reached.put(&mut writer)?;
        writer.list(patches)?;
        writer.list(elements)?;
        writer.list(roots)?;
        writer.list(points)?;
        writer.list(light)?;
        writer.list(centers)?;
        writer.list(firsts)?;
        writer.list(boundary)?;
        writer.list(polygons)?;
        (*excess as u64).put(&mut writer)?;
        let checksum = writer.checksum.finish();
        writer.bytes(&checksum.to_le_bytes())?;
        writer.out.flush()
    }

    /// Reads a file of `length` bytes. The memory is a small multiple of this length. Any bytes give a solution or an
    /// error.
    ///
    /// # Errors
    /// [`SolutionFileError`] names the reason.
    pub fn read(
        mut input: impl Read,
        length: u64,
    ) -> Result<(SolutionFingerprint, RadiositySolution), SolutionFileError> {
        let mut reader = Reader { input: BufReader::new(&mut input), left: length, checksum: WordHash::new() };
        match reader.bytes() {
            Ok(MAGIC) => {}
            Err(error @ SolutionFileError::Unreadable(_)) => return Err(error),
            _ => return Err(SolutionFileError::Foreign),
        }
        let found = u32::take(&mut reader)?;
        if found != VERSION {
            return Err(SolutionFileError::Version { found });
        }
        let fingerprint = SolutionFingerprint::take(&mut reader)?;
        let origin = DVec3::take(&mut reader)?;
        let primitives = u64::take(&mut reader)?;
        let residual = f64::take(&mut reader)?;
        let links = usize::try_from(u64::take(&mut reader)?).map_err(|_| SolutionFileError::Damaged)?;
        let limit_reached = bool::take(&mut reader)?;
        let patches: Vec<Patch> = reader.list()?;
        let elements: Vec<SolvedElement> = reader.list()?;
        let roots = reader.list()?;
        let (points, light, centers) = (reader.list()?, reader.list()?, reader.list()?);
        let (firsts, boundary) = (reader.list()?, reader.list()?);
        let polygons = reader.list()?;
        let excess = usize::try_from(u64::take(&mut reader)?).map_err(|_| SolutionFileError::Damaged)?;
        let checksum = reader.checksum.finish();
        if reader.left != 8 || reader.bytes()? != checksum.to_le_bytes() {
            return Err(SolutionFileError::Damaged);
        }
        let outlines = elements.iter().filter(|element| element.parts == 0).map(|element| element.outline).collect();
        let interpolation = Interpolation { points, light, centers, firsts, boundary };
        let solution = RadiositySolution {
            patches,
            outlines,
            elements,
            interpolation,
            emitters: Emitters { polygons, excess },
            roots,
            origin,
            primitives,
            residual,
            links,
            limit_reached,
        };
        if has_valid_numbers(&solution) { Ok((fingerprint, solution)) } else { Err(SolutionFileError::Damaged) }
    }
}

/// Whether all numbers of elements, patches and vertices are those of existing ones, so that no lookup fails or goes on
/// without end.
fn has_valid_numbers(solution: &RadiositySolution) -> bool {
    let RadiositySolution { patches, elements, roots, interpolation, .. } = solution;
    let Interpolation { points, light, centers, firsts, boundary } = interpolation;
    let mut leaves = 0;
    let elements_fit = elements.iter().enumerate().all(|(number, element)| {
        if element.parts == 0 {
            leaves += 1;
            return element.patch as usize == leaves - 1;
        }
        let last = u64::from(element.first) + u64::from(element.parts);
        element.patch == NONE
            && element.first as usize > number
            && last <= elements.len() as u64
            && element.outline.parts().len() == element.parts as usize
    });
    elements_fit
        && leaves == patches.len()
        && roots.is_sorted()
        && roots.iter().all(|root| (root.4 as usize) < elements.len())
        && light.len() == points.len()
        && centers.len() == patches.len()
        && firsts.len() == patches.len() + 1
        && firsts.is_sorted()
        && firsts.first() == Some(&0)
        && firsts.last().is_some_and(|&last| last as usize == boundary.len())
        && boundary.iter().all(|&vertex| (vertex as usize) < points.len())
}

/// A file that is being written.
struct Writer<'a> {
    out: BufWriter<&'a mut dyn Write>,
    checksum: WordHash,
}

impl Writer<'_> {
    fn bytes(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.checksum.add_bytes(bytes);
        self.out.write_all(bytes)
    }

    /// Writes the number of records, and the records.
    fn list<T: Record>(&mut self, records: &[T]) -> io::Result<()> {
        (records.len() as u64).put(self)?;
        records.iter().try_for_each(|record| record.put(self))
    }
}

/// A file that is being read.
struct Reader<'a> {
    input: BufReader<&'a mut dyn Read>,
    /// The bytes that are left.
    left: u64,
    checksum: WordHash,
}

impl Reader<'_> {
    fn bytes<const N: usize>(&mut self) -> Result<[u8; N], SolutionFileError> {
        self.left = self.left.checked_sub(N as u64).ok_or(SolutionFileError::CutOff)?;
        let mut bytes = [0; N];
        self.input.read_exact(&mut bytes).map_err(|error| match error.kind() {
            ErrorKind::UnexpectedEof => SolutionFileError::CutOff,
            _ => SolutionFileError::Unreadable(error),
        })?;
        self.checksum.add_bytes(&bytes);
        Ok(bytes)
    }

    /// Reads the number of records, and the records. A number that the file has no room for takes no memory.
    fn list<T: Record>(&mut self) -> Result<Vec<T>, SolutionFileError> {
        let count = u64::take(self)?;
        if count > self.left / T::BYTES {
            return Err(SolutionFileError::CutOff);
        }
        let mut records = Vec::new();
        let count = usize::try_from(count).map_err(|_| SolutionFileError::CutOff)?;
        records.try_reserve_exact(count).map_err(|_| SolutionFileError::Unreadable(ErrorKind::OutOfMemory.into()))?;
        for _ in 0..count {
            records.push(T::take(self)?);
        }
        Ok(records)
    }
}

/// A value in a file.
trait Record: Sized {
    /// The number of bytes; for values of different sizes the least.
    const BYTES: u64;

    fn put(&self, writer: &mut Writer) -> io::Result<()>;
    fn take(reader: &mut Reader) -> Result<Self, SolutionFileError>;
}

macro_rules! number_record {
    ($($number:ty),*) => {$(
        impl Record for $number {
            const BYTES: u64 = size_of::<$number>() as u64;

            fn put(&self, writer: &mut Writer) -> io::Result<()> {
                writer.bytes(&self.to_le_bytes())
            }

            fn take(reader: &mut Reader) -> Result<$number, SolutionFileError> {
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

            fn take(reader: &mut Reader) -> Result<$name, SolutionFileError> {
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

    fn take(reader: &mut Reader) -> Result<bool, SolutionFileError> {
        match u8::take(reader)? {
            0 => Ok(false),
            1 => Ok(true),
            _ => Err(SolutionFileError::Damaged),
        }
    }
}

impl Record for DVec3 {
    const BYTES: u64 = 3 * f64::BYTES;

    fn put(&self, writer: &mut Writer) -> io::Result<()> {
        self.to_array().iter().try_for_each(|v| v.put(writer))
    }

    fn take(reader: &mut Reader) -> Result<DVec3, SolutionFileError> {
        Ok(DVec3::new(f64::take(reader)?, f64::take(reader)?, f64::take(reader)?))
    }
}

impl Record for Vec3 {
    const BYTES: u64 = 3 * f32::BYTES;

    fn put(&self, writer: &mut Writer) -> io::Result<()> {
        self.to_array().iter().try_for_each(|v| v.put(writer))
    }

    fn take(reader: &mut Reader) -> Result<Vec3, SolutionFileError> {
        Ok(Vec3::new(f32::take(reader)?, f32::take(reader)?, f32::take(reader)?))
    }
}

impl<T: Record + Copy + Default, const N: usize> Record for [T; N] {
    const BYTES: u64 = N as u64 * T::BYTES;

    fn put(&self, writer: &mut Writer) -> io::Result<()> {
        self.iter().try_for_each(|value| value.put(writer))
    }

    fn take(reader: &mut Reader) -> Result<[T; N], SolutionFileError> {
        let mut values = [T::default(); N];
        for value in &mut values {
            *value = T::take(reader)?;
        }
        Ok(values)
    }
}

impl Record for Outline {
    const BYTES: u64 = bool::BYTES + 3 * DVec3::BYTES;

    fn put(&self, writer: &mut Writer) -> io::Result<()> {
        (self.corners().len() == 4).put(writer)?;
        self.corners().iter().try_for_each(|corner| corner.put(writer))
    }

    fn take(reader: &mut Reader) -> Result<Outline, SolutionFileError> {
        let is_quad = bool::take(reader)?;
        let corners = [DVec3::take(reader)?, DVec3::take(reader)?, DVec3::take(reader)?];
        let [a, b, c] = corners;
        Ok(if is_quad { Outline::quad([a, b, c, DVec3::take(reader)?]) } else { Outline::triangle(corners) })
    }
}

/// The name of a method: its length and its bytes.
impl Record for RadiosityMethod {
    const BYTES: u64 = u8::BYTES;

    fn put(&self, writer: &mut Writer) -> io::Result<()> {
        (self.name().len() as u8).put(writer)?;
        writer.bytes(self.name().as_bytes())
    }

    fn take(reader: &mut Reader) -> Result<RadiosityMethod, SolutionFileError> {
        let mut name = Vec::new();
        for _ in 0..u8::take(reader)? {
            name.push(u8::take(reader)?);
        }
        let name = std::str::from_utf8(&name).ok();
        name.and_then(RadiosityMethod::from_name).ok_or(SolutionFileError::Damaged)
    }
}

record!(
    RadiositySettings,
    RadiositySettings { method, error, max_patches, ..RadiositySettings::DEFAULT },
    [method: RadiosityMethod, error: f32, max_patches: u32]
);

record!(
    SolutionFingerprint,
    SolutionFingerprint { geometry, assignment, materials, lights, environment, settings },
    [geometry: u64, assignment: u64, materials: u64, lights: u64, environment: u64, settings: RadiositySettings]
);

record!(
    Patch,
    Patch {
        instance, primitive, part, is_outer, normal, center, area, reflectance, emission, direct, from_emitters,
        indirect,
    },
    [
        instance: u32, primitive: u32, part: u32, is_outer: bool, normal: DVec3, center: DVec3, area: f64,
        reflectance: DVec3, emission: DVec3, direct: DVec3, from_emitters: DVec3, indirect: DVec3
    ]
);

record!(
    ArrivingLight,
    ArrivingLight { direct, from_emitters, indirect },
    [direct: DVec3, from_emitters: DVec3, indirect: DVec3]
);

record!(
    SolvedElement,
    SolvedElement { outline, center, radius, first, parts, patch },
    [outline: Outline, center: DVec3, radius: f64, first: u32, parts: u32, patch: u32]
);

record!(Emitter, Emitter { root, radiance }, [root: Root, radiance: DVec3]);

// Emitters keep no cuts and no contacts.
record!(
    Root,
    Root {
        instance, primitives, part, material, is_outer, is_flat, normal, outline, joined, error, reach, tolerance,
        cuts: Arc::default(),
        contacts: Vec::new(),
    },
    [
        instance: u32, primitives: [u32; 2], part: u32, material: u32, is_outer: bool, is_flat: bool, normal: DVec3,
        outline: Outline, joined: [DVec3; 3], error: Vec3, reach: f64, tolerance: f64
    ]
);

/// Instance, primitive, side, part and element.
impl Record for RootPlace {
    const BYTES: u64 = 4 * u32::BYTES + bool::BYTES;

    fn put(&self, writer: &mut Writer) -> io::Result<()> {
        let (instance, primitive, is_outer, part, element) = self;
        [instance, primitive, part, element].into_iter().try_for_each(|number| number.put(writer))?;
        is_outer.put(writer)
    }

    fn take(reader: &mut Reader) -> Result<RootPlace, SolutionFileError> {
        let mut number = || u32::take(reader);
        let (instance, primitive, part, element) = (number()?, number()?, number()?, number()?);
        Ok((instance, primitive, bool::take(reader)?, part, element))
    }
}

#[cfg(test)]
mod tests;
