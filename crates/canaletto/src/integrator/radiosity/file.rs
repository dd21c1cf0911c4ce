//! Solutions as files: magic number, version, fingerprint, lists, checksum. `docs/radiosity-file.md` describes
//! the format. A change of the format, or of what its numbers mean, raises [`FORMAT`]'s version.

use super::emitters::{Emitter, Emitters};
use super::fingerprint::SolutionFingerprint;
use super::interpolation::Interpolation;
use super::mesh::NONE;
use super::outline::Outline;
use super::root::Root;
use super::solution::{ArrivingLight, Patch, RadiositySolution, RootPlace, SolvedElement};
use crate::Named;
use crate::integrator::state_file::{Reader, Record, StateFileError, StateFormat, Writer, record};
use crate::scene::{RadiosityMethod, RadiositySettings};
use glam::{DVec3, Vec3};
use std::io::{self, Read, Write};
use std::sync::Arc;

/// The format of solutions.
const FORMAT: StateFormat =
    StateFormat { magic: *b"\x89RAD\r\n\x1a\n", version: 1, content: "a solution of radiosity" };

impl RadiositySolution {
    /// Writes the solution and the fingerprint of its scene. All numbers keep their bits.
    ///
    /// # Errors
    /// Those of the output.
    pub fn write(&self, fingerprint: &SolutionFingerprint, mut out: impl Write) -> io::Result<()> {
        let mut writer = Writer::begin(&mut out, FORMAT)?;
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
        writer.finish()
    }

    /// Reads a file of `length` bytes. The memory is a small multiple of this length. Any bytes give a solution or an
    /// error.
    ///
    /// # Errors
    /// [`StateFileError`] names the reason.
    pub fn read(mut input: impl Read, length: u64) -> Result<(SolutionFingerprint, RadiositySolution), StateFileError> {
        let mut reader = Reader::begin(&mut input, length, FORMAT)?;
        let fingerprint = SolutionFingerprint::take(&mut reader)?;
        let origin = DVec3::take(&mut reader)?;
        let primitives = u64::take(&mut reader)?;
        let residual = f64::take(&mut reader)?;
        let links = usize::try_from(u64::take(&mut reader)?).map_err(|_| StateFileError::Damaged)?;
        let limit_reached = bool::take(&mut reader)?;
        let patches: Vec<Patch> = reader.list()?;
        let elements: Vec<SolvedElement> = reader.list()?;
        let roots = reader.list()?;
        let (points, light, centers) = (reader.list()?, reader.list()?, reader.list()?);
        let (firsts, boundary) = (reader.list()?, reader.list()?);
        let polygons = reader.list()?;
        let excess = usize::try_from(u64::take(&mut reader)?).map_err(|_| StateFileError::Damaged)?;
        reader.finish()?;
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
        if has_valid_numbers(&solution) { Ok((fingerprint, solution)) } else { Err(StateFileError::Damaged) }
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

impl Record for Outline {
    const BYTES: u64 = bool::BYTES + 3 * DVec3::BYTES;

    fn put(&self, writer: &mut Writer) -> io::Result<()> {
        (self.corners().len() == 4).put(writer)?;
        self.corners().iter().try_for_each(|corner| corner.put(writer))
    }

    fn take(reader: &mut Reader) -> Result<Outline, StateFileError> {
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

    fn take(reader: &mut Reader) -> Result<RadiosityMethod, StateFileError> {
        let mut name = Vec::new();
        for _ in 0..u8::take(reader)? {
            name.push(u8::take(reader)?);
        }
        let name = std::str::from_utf8(&name).ok();
        name.and_then(RadiosityMethod::from_name).ok_or(StateFileError::Damaged)
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

    fn take(reader: &mut Reader) -> Result<RootPlace, StateFileError> {
        let mut number = || u32::take(reader);
        let (instance, primitive, part, element) = (number()?, number()?, number()?, number()?);
        Ok((instance, primitive, bool::take(reader)?, part, element))
    }
}

#[cfg(test)]
mod tests;
