//! STL (3D Systems, *Stereolithography Interface Specification*, 1988): text and binary.
//!
//! A file whose size is that of its count of triangles is binary, whatever its header starts with: some programs write
//! `solid` there. The order of a facet's corners says where its outer side is; the normals of the file aren't used,
//! since many programs write zeros.
//!
//! Binary facets may have colours in two conventions of 5 bits a channel, which are taken as sRGB. VisCAM and SolidView
//! set bit 15 and begin with blue. Magics writes `COLOR=` and four bytes to the header. It clears bit 15 for a facet
//! with a colour of its own, and begins with red.

use super::lines::{ImportError, Token};
use super::positions::Positions;
use super::precision_warning::{self, Precision};
use super::smooth::{Smoothing, smooth};
use super::{
    DefaultShading, Holds, ModelFormat, ReadFragment, ReadOptions, UpAxis, attach_source, encoding, fragment_of,
    number, unreadable,
};
use crate::assets::{Assets, OpenAsset};
use crate::diagnostic::Diagnostics;
use canaletto::material::Phong;
use canaletto::math::Rgb;
use canaletto::shape::Mesh;
use canaletto::texture::srgb_decode;
use glam::{DVec3, Vec3};
use std::collections::HashMap;

/// STL in the table of formats.
pub(super) const FORMAT: ModelFormat = ModelFormat {
    name: "STL",
    extensions: &["stl"],
    holds: Holds::Objects,
    up: UpAxis::Z,
    read: read_model,
    duration: None,
};

const HEADER: usize = 80;
const FIRST_FACET: usize = HEADER + 4;
/// A normal, three corners and two bytes.
const FACET: usize = 50;

fn read_model(asset: &OpenAsset, _: &dyn Assets, options: &ReadOptions) -> ReadFragment {
    let unsaid = options.unsaid;
    let file = asset.path.name();
    let bytes = asset.content.view().whole().map_err(|e| unreadable(&e).error(file))?;
    let mut said = Vec::new();
    let is_text = is_text(&bytes);
    let text = if is_text { encoding::text(&bytes) } else { bytes[..].into() };
    let solids = if is_text { Reader::new(&text).solids(&mut said) } else { binary(&text, &mut said).map(|s| vec![s]) };
    let precision = if is_text { Precision::Double } else { Precision::Single };
    let result = solids.and_then(|solids| meshes(file, solids, unsaid, &mut said));
    let mut told = Diagnostics::new();
    match &result {
        Ok(meshes) => {
            said.extend(meshes.iter().find_map(|mesh| precision_warning::mesh(mesh, precision)));
            said.into_iter().for_each(|complaint| told.push(complaint.warning(file)));
        }
        Err(complaint) => told.push(complaint.clone().error(file)),
    }
    if is_text {
        attach_source(&mut told, file, text[..].into());
    }
    match result {
        Ok(meshes) => Ok((fragment_of(meshes, Vec::new()), told)),
        Err(_) => Err(told),
    }
}

/// Whether a file is text: it starts with `solid`, and its size isn't that of a binary file.
fn is_text(bytes: &[u8]) -> bool {
    let start = encoding::text(&bytes[..bytes.len().min(1024)]);
    let word = start.trim_ascii_start();
    let is_binary = count(bytes).is_some_and(|count| size(count) == bytes.len() as u64);
    !is_binary && word.get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid"))
}

/// The number of triangles that a binary file announces.
fn count(bytes: &[u8]) -> Option<u32> {
    bytes.get(HEADER..)?.first_chunk().map(|count| u32::from_le_bytes(*count))
}

/// The bytes of a binary file of so many triangles.
fn size(count: u32) -> u64 {
    FIRST_FACET as u64 + FACET as u64 * u64::from(count)
}

/// The triangles of a solid: three corners each, and a colour each unless there are none.
#[derive(Default)]
struct Solid {
    name: String,
    corners: Positions,
    colors: Vec<Rgb>,
}

fn binary(bytes: &[u8], said: &mut Vec<ImportError>) -> Result<Solid, ImportError> {
    let Some(count) = count(bytes) else {
        let message = format!("it has {} bytes, fewer than the {FIRST_FACET} of a header", bytes.len());
        return Err(ImportError::file(message).help("the file may have been cut off; or is it another format?"));
    };
    let (needed, there) = (size(count), bytes.len() as u64);
    if needed > there {
        let message = format!("its header counts {count} triangles, which take {needed} bytes, but it has {there}");
        return Err(ImportError::file(message).help("the file may have been cut off; or is it another format?"));
    }
    if needed < there {
        let message = format!("{} bytes after its {count} triangles are left out", there - needed);
        said.push(ImportError::file(message));
    }
    let facets = &bytes[FIRST_FACET..needed as usize];
    let mut solid = Solid { colors: colors(&bytes[..HEADER], facets), ..Solid::default() };
    for facet in facets.chunks_exact(FACET) {
        for corner in facet[12..48].chunks_exact(12) {
            let number = |at: usize| f32::from_le_bytes([corner[at], corner[at + 1], corner[at + 2], corner[at + 3]]);
            let place = Vec3::new(number(0), number(4), number(8));
            push(&mut solid.corners, place, place.as_dvec3());
        }
    }
    Ok(solid)
}

fn push(corners: &mut Positions, place: Vec3, exact: DVec3) {
    if place.is_finite() { corners.push(place, exact) } else { corners.push_non_finite() }
}

/// The colour of each facet; none if the file has no colours.
fn colors(header: &[u8], facets: &[u8]) -> Vec<Rgb> {
    let attribute = |facet: &[u8]| u16::from_le_bytes([facet[48], facet[49]]);
    let attributes = || facets.chunks_exact(FACET).map(attribute);
    let channels = |bits: u16| [0, 5, 10].map(|shift| srgb_decode(f32::from(bits >> shift & 31) / 31.0));
    let has_bit = |bits: u16| bits >> 15 == 1;
    if let Some(at) = header.windows(6).position(|word| word == b"COLOR=")
        && let Some(color) = header.get(at + 6..at + 9)
    {
        let whole = Rgb::from([0, 1, 2].map(|channel| srgb_decode(f32::from(color[channel]) / 255.0)));
        return attributes().map(|bits| if has_bit(bits) { whole } else { channels(bits).into() }).collect();
    }
    if !attributes().any(has_bit) {
        return Vec::new();
    }
    let own = |bits: u16| {
        let [blue, green, red] = channels(bits);
        if has_bit(bits) { Rgb::new(red, green, blue) } else { Phong::default().kd }
    };
    attributes().map(own).collect()
}

/// The words of a text, and the solids made of them.
struct Reader<'a> {
    text: &'a [u8],
    at: usize,
}

impl<'a> Reader<'a> {
    fn new(text: &'a [u8]) -> Reader<'a> {
        Reader { text, at: 0 }
    }

    fn solids(&mut self, said: &mut Vec<ImportError>) -> Result<Vec<Solid>, ImportError> {
        let mut solids: Vec<Solid> = Vec::new();
        let mut is_open = false;
        while let Some(word) = self.word() {
            match &word.text.to_ascii_lowercase()[..] {
                b"solid" => {
                    solids.push(Solid { name: self.rest_of_line(), ..Solid::default() });
                    is_open = true;
                }
                b"endsolid" if is_open => {
                    self.rest_of_line();
                    is_open = false;
                }
                b"facet" if is_open => {
                    if let Some(solid) = solids.last_mut() {
                        self.facet(&word, &mut solid.corners)?;
                    }
                }
                _ if is_open => {
                    let message = format!("\"{}\" stands where a facet or the end of the solid should", word.shown());
                    return Err(word.wrong(message).help("solids are made of: facet normal … endfacet"));
                }
                _ => {
                    let message = format!("\"{}\" stands where a solid should begin", word.shown());
                    return Err(word.wrong(message).help("a solid begins with `solid` and ends with `endsolid`"));
                }
            }
        }
        if is_open {
            let message = "it ends within a solid, without `endsolid`";
            said.push(ImportError::file(message).help("the file may have been cut off"));
        }
        Ok(solids)
    }

    fn facet(&mut self, start: &Token, corners: &mut Positions) -> Result<(), ImportError> {
        self.keyword(start, "normal")?;
        for name in ["x", "y", "z"] {
            self.number(start, &format!("{name} of a normal"))?;
        }
        self.keyword(start, "outer")?;
        self.keyword(start, "loop")?;
        for _ in 0..3 {
            let word = self.keyword(start, "vertex")?;
            let place = [
                self.number(&word, "x of a vertex")?,
                self.number(&word, "y of a vertex")?,
                self.number(&word, "z of a vertex")?,
            ];
            push(corners, place.map(|(rounded, _)| rounded).into(), place.map(|(_, exact)| exact).into());
        }
        self.keyword(start, "endloop")?;
        self.keyword(start, "endfacet")?;
        Ok(())
    }

    /// The next word of the facet that began with `facet`, which must be `expected`.
    fn keyword(&mut self, facet: &Token, expected: &str) -> Result<Token<'a>, ImportError> {
        match self.word() {
            Some(word) if word.text.eq_ignore_ascii_case(expected.as_bytes()) => Ok(word),
            Some(word) if expected == "endloop" && word.text.eq_ignore_ascii_case(b"vertex") => {
                Err(word.wrong("a facet has more than three corners"))
            }
            Some(word) => Err(word.wrong(format!("\"{}\" stands where \"{expected}\" should", word.shown()))),
            None => Err(facet.wrong("the file ends within this facet").help("the file may have been cut off")),
        }
    }

    /// A number in `f32` and in `f64`, which may be infinite or NaN.
    fn number(&mut self, before: &Token, what: &str) -> Result<(f32, f64), ImportError> {
        let Some(word) = self.word() else {
            return Err(before.wrong("the file ends within this facet").help("the file may have been cut off"));
        };
        let rounded = word.any_number().map_err(|complaint| complaint.within(what))?;
        Ok((rounded, number::parse(word.text).unwrap_or(rounded.into())))
    }

    fn word(&mut self) -> Option<Token<'a>> {
        let start = self.at + self.text[self.at..].iter().position(|byte| !is_space(*byte))?;
        let length = self.text[start..].iter().position(|byte| is_space(*byte)).unwrap_or(self.text.len() - start);
        self.at = start + length;
        Some(Token { start, text: &self.text[start..self.at] })
    }

    /// The rest of the line without the spaces around it.
    fn rest_of_line(&mut self) -> String {
        let rest = &self.text[self.at..];
        let length = rest.iter().position(|byte| matches!(byte, b'\n' | b'\r')).unwrap_or(rest.len());
        self.at += length;
        Token { start: 0, text: rest[..length].trim_ascii() }.string()
    }
}

/// Whether a byte is no part of a word. Some programs end texts with zeros.
fn is_space(byte: u8) -> bool {
    byte.is_ascii_whitespace() || matches!(byte, 0 | 0x0b)
}

/// The meshes of all solids that have triangles.
fn meshes(
    file: &str,
    solids: Vec<Solid>,
    unsaid: DefaultShading,
    said: &mut Vec<ImportError>,
) -> Result<Vec<Mesh>, ImportError> {
    let (corners, others): (Vec<Positions>, Vec<(String, Vec<Rgb>)>) =
        solids.into_iter().map(|solid| (solid.corners, (solid.name, solid.colors))).unzip();
    let (origin, corners) = Positions::rebase_each(corners);
    let mut lost = 0;
    let mut meshes = Vec::new();
    for (corners, (name, colors)) in corners.iter().zip(others) {
        let name = if name.is_empty() { file.rsplit('/').next().unwrap_or_default().to_owned() } else { name };
        let mut mesh = Mesh { name, origin, ..Mesh::default() };
        lost += join(corners, &colors, &mut mesh);
        if unsaid == DefaultShading::Creases {
            smooth(&mut mesh, Smoothing::Creases);
        }
        if !mesh.triangles.is_empty() {
            meshes.push(mesh);
        }
    }
    if lost > 0 {
        said.push(ImportError::file(format!("{lost} triangles are left out, as a coordinate isn't a finite number")));
    }
    if meshes.is_empty() {
        return Err(ImportError::file("there are no triangles in it"));
    }
    Ok(meshes)
}

/// Adds triangles to a mesh. Corners of equal place and colour become one vertex. Returns how many triangles have
/// corners that aren't finite.
fn join(corners: &[Vec3], colors: &[Rgb], mesh: &mut Mesh) -> usize {
    let mut known: HashMap<[u32; 6], u32> = HashMap::new();
    let mut lost = 0;
    for (index, corners) in corners.chunks_exact(3).enumerate() {
        if corners.iter().any(|corner| !corner.is_finite()) {
            lost += 1;
            continue;
        }
        let color = colors.get(index);
        let triangle = [0, 1, 2].map(|i: usize| {
            // Adding 0 turns −0 into 0.
            let [x, y, z] = (corners[i] + Vec3::ZERO).to_array().map(f32::to_bits);
            let [r, g, b] = color.map_or([0; 3], |color| color.to_array().map(f32::to_bits));
            *known.entry([x, y, z, r, g, b]).or_insert_with(|| {
                mesh.positions.push(corners[i]);
                mesh.colors.extend(color);
                mesh.positions.len() as u32 - 1
            })
        });
        mesh.triangles.push(triangle);
    }
    lost
}

#[cfg(test)]
mod tests;
