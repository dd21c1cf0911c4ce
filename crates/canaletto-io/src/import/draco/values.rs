//! The values of attributes: how they are stored, and what they become.

use super::entropy::{BitDecoder, symbols};
use super::layout::Laid;
use super::prediction::{self, Creases, Positions};
use super::reader::Reader;
use super::transform::{Octahedron, Wrap};
use super::{Component, Decoded};

const UNFIT: &str = "a prediction doesn't fit its attribute";

/// How values are stored.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Coding {
    Plain,
    Integers,
    /// Integers for numbers between two others.
    Quantized,
    Normals,
}

/// An attribute before its values.
pub(super) struct Info {
    pub(super) is_position: bool,
    pub(super) component: Component,
    pub(super) is_normalized: bool,
    pub(super) width: usize,
    pub(super) id: u32,
    pub(super) coding: Coding,
}

impl Coding {
    /// Reads the coding of an attribute.
    pub(super) fn read(stream: &mut Reader, info: &Info) -> Decoded<Coding> {
        match stream.byte()? {
            0 => Ok(Coding::Plain),
            1 if info.component.is_small_integer() => Ok(Coding::Integers),
            2 if info.component == Component::F32 => Ok(Coding::Quantized),
            3 if info.component == Component::F32 && info.width == 3 => Ok(Coding::Normals),
            _ => Err("the coding of an attribute is unknown or doesn't fit its numbers".into()),
        }
    }
}

impl Info {
    /// The integers of an element that isn't stored plainly. A normal has two.
    pub(super) fn integers_of_element(&self) -> usize {
        if self.coding == Coding::Normals { 2 } else { self.width }
    }
}

/// How values are predicted.
#[derive(Clone, Copy)]
enum Method {
    FromLast,
    Parallelogram,
    Parallelograms,
    TextureCoordinates,
    Normals,
}

/// How values are predicted and corrected.
enum Scheme {
    /// Not at all.
    Plain,
    Wrapped(Method),
    /// Values are coordinates on an octahedron.
    Octahedral(Method),
}

impl Scheme {
    /// Reads a scheme. Without a surface, values are predicted from the one before them.
    fn read(stream: &mut Reader, has_surface: bool) -> Decoded<Scheme> {
        let method = match stream.byte()? as i8 {
            -2 => return Ok(Scheme::Plain),
            0 => Method::FromLast,
            1 => Method::Parallelogram,
            2 => return Err("their prediction \"multi parallelogram\" is obsolete and isn't read".into()),
            3 => return Err("their first prediction of texture coordinates is obsolete and isn't read".into()),
            4 => Method::Parallelograms,
            5 => Method::TextureCoordinates,
            6 => Method::Normals,
            _ => return Err("an attribute has an unknown prediction".into()),
        };
        let method = if has_surface { method } else { Method::FromLast };
        match stream.byte()? {
            1 => Ok(Scheme::Wrapped(method)),
            2 => Err("their first prediction of normals is obsolete and isn't read".into()),
            3 => Ok(Scheme::Octahedral(method)),
            _ => Err("an attribute has an unknown kind of corrections".into()),
        }
    }
}

/// Decodes the integers of `count` elements.
pub(super) fn integers<'a>(
    stream: &mut Reader,
    info: &Info,
    count: usize,
    laid: Option<&Laid>,
    positions: impl Fn() -> Option<Positions<'a>>,
) -> Decoded<Vec<i32>> {
    let scheme = Scheme::read(stream, laid.is_some())?;
    let width = info.integers_of_element();
    let coded = coded(stream, count * width, width)?;
    let surface = || {
        let positions = positions().ok_or("a prediction needs positions, which aren't there")?;
        Ok((laid.ok_or(UNFIT)?, positions))
    };
    match scheme {
        Scheme::Octahedral(method) if info.coding == Coding::Normals => {
            let mut values: Vec<i32> = coded.into_iter().map(|v| v as i32).collect();
            directions(stream, method, values.as_chunks_mut().0, surface)?;
            Ok(values)
        }
        Scheme::Octahedral(_) => Err(UNFIT.into()),
        Scheme::Plain => Ok(coded.into_iter().map(signed).collect()),
        Scheme::Wrapped(method) => {
            let mut values: Vec<i32> = coded.into_iter().map(signed).collect();
            match (method, laid) {
                (Method::TextureCoordinates, _) => texture_coordinates(stream, &mut values, width, surface)?,
                (_, laid) => numbers(stream, method, &mut values, width, laid)?,
            }
            Ok(values)
        }
    }
}

/// A number whose sign is its lowest bit.
fn signed(v: u32) -> i32 {
    (v >> 1) as i32 ^ ((v & 1) as i32).wrapping_neg()
}

/// Makes values of corrections.
fn numbers(stream: &mut Reader, method: Method, values: &mut [i32], width: usize, laid: Option<&Laid>) -> Decoded<()> {
    match (method, laid) {
        (Method::FromLast, _) => prediction::from_last(values, width, &Wrap::read(stream)?),
        (Method::Parallelogram, Some(laid)) => {
            prediction::parallelogram(values, width, &Wrap::read(stream)?, laid);
        }
        (Method::Parallelograms, Some(laid)) => {
            let creases = Creases::read(stream)?;
            prediction::parallelograms(values, width, &Wrap::read(stream)?, laid, creases)?;
        }
        _ => return Err(UNFIT.into()),
    }
    Ok(())
}

/// Makes texture coordinates of corrections.
fn texture_coordinates<'a, 'b>(
    stream: &mut Reader,
    values: &mut [i32],
    width: usize,
    surface: impl Fn() -> Decoded<(&'a Laid<'a>, Positions<'b>)>,
) -> Decoded<()> {
    if width != 2 {
        return Err(UNFIT.into());
    }
    let values = values.as_chunks_mut().0;
    let sides = prediction::read_sides(stream, values.len())?;
    let wrap = Wrap::read(stream)?;
    let (laid, positions) = surface()?;
    prediction::texture_coordinates(values, &wrap, laid, &positions, sides)
}

/// Makes coordinates on an octahedron of corrections.
fn directions<'a, 'b>(
    stream: &mut Reader,
    method: Method,
    values: &mut [[i32; 2]],
    surface: impl Fn() -> Decoded<(&'a Laid<'a>, Positions<'b>)>,
) -> Decoded<()> {
    let octahedron = Octahedron::read(stream)?;
    match method {
        Method::FromLast => prediction::directions_from_last(values, octahedron),
        Method::Normals => {
            let flips = BitDecoder::new(stream)?;
            let (laid, positions) = surface()?;
            prediction::normals(values, octahedron, laid, &positions, flips)?;
        }
        _ => return Err(UNFIT.into()),
    }
    Ok(())
}

/// Reads `count` numbers of elements that have `width` each: coded or plain.
fn coded(stream: &mut Reader, count: usize, width: usize) -> Decoded<Vec<u32>> {
    if stream.byte()? > 0 {
        return symbols(stream, count, width);
    }
    let size = usize::from(stream.byte()?);
    if !(1..=4).contains(&size) {
        return Err(format!("integers have {size} bytes, not 1 to 4").into());
    }
    let number = |bytes: &[u8]| bytes.iter().rev().fold(0, |number, byte| number << 8 | u32::from(*byte));
    Ok(stream.take(count.saturating_mul(size))?.chunks_exact(size).map(number).collect())
}

/// The values of an attribute in its own type, the lowest byte first.
pub(super) fn finish(stream: &mut Reader, info: &Info, values: &[i32]) -> Decoded<Vec<u8>> {
    match info.coding {
        Coding::Normals => {
            let octahedron = Octahedron::new(stream.byte()?.into())?;
            let vectors = values.as_chunks().0.iter().map(|at| octahedron.unit_vector(*at));
            Ok(vectors.flatten().flat_map(f32::to_le_bytes).collect())
        }
        Coding::Quantized => {
            let least = (0..info.width).map(|_| stream.float()).collect::<Decoded<Vec<_>>>()?;
            let (range, bits) = (stream.float()?, stream.byte()?);
            if !(1..=30).contains(&bits) {
                return Err(format!("numbers are quantized to {bits} bits, not 1 to 30").into());
            }
            let step = range / ((1u32 << bits) - 1) as f32;
            let numbers = values.iter().zip(least.iter().cycle()).map(|(v, least)| *v as f32 * step + least);
            Ok(numbers.flat_map(f32::to_le_bytes).collect())
        }
        Coding::Plain | Coding::Integers => {
            let size = info.component.size();
            let mut bytes = Vec::with_capacity(values.len() * size);
            values.iter().for_each(|v| bytes.extend_from_slice(&v.to_le_bytes()[..size]));
            Ok(bytes)
        }
    }
}
