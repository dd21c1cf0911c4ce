//! The faces of a PLY file: polygons and strips, with their own colours and texture coordinates.
//!
//! Meshes store colours and texture coordinates at vertices. Faces may have their own: `red green blue`, or a list
//! `texcoord` of two numbers for each corner, as MeshLab writes for "wedges". A vertex is then copied for each of its
//! values.

use super::super::cloud::CloudSettings;
use super::header::Element;
use super::payload::{Payload, Row};
use super::{Extra, from_top, index, table};
use crate::import::lines::ImportError;
use crate::import::polygon::Triangulator;
use canaletto::math::Rgb;
use canaletto::memory;
use canaletto::shape::Mesh;
use glam::{Vec2, Vec3};
use std::collections::HashMap;

/// The properties of faces that are used.
struct Wanted {
    corners: usize,
    /// The colour of a face.
    color: Extra,
    /// The texture coordinates, two numbers for each corner.
    uv: Option<usize>,
    /// The number of the picture.
    picture: Option<usize>,
}

/// All faces of a file, split into triangles.
#[derive(Default)]
pub(super) struct FaceList {
    /// The colour of each triangle of the mesh so far; empty if faces have none.
    colors: Vec<Rgb>,
    /// The texture coordinates of the corners of each triangle; empty if faces have none.
    uvs: Vec<[Vec2; 3]>,
    /// How many pictures the file names, and the number of each triangle's; empty unless there are several.
    pictures: usize,
    slots: Vec<u32>,
    /// The number of faces with fewer than three corners.
    thin: u64,
    /// The number of faces with a corner that isn't finite.
    lost: u64,
    /// The number of faces whose texture coordinates don't match their corners in number.
    without_uv: u64,
}

impl FaceList {
    /// A list for a file that names this many pictures.
    pub(super) fn with_pictures(pictures: usize) -> FaceList {
        FaceList { pictures, ..FaceList::default() }
    }

    /// Whether no faces were read or left out.
    pub(super) fn is_empty(&self) -> bool {
        self.thin + self.lost == 0
    }

    /// Reads an element of polygons.
    pub(super) fn read(
        &mut self,
        element: &Element,
        payload: &mut Payload<'_>,
        mesh: &mut Mesh,
        said: &mut Vec<ImportError>,
    ) -> Result<(), ImportError> {
        let Some(corners) = element.property(&["vertex_indices", "vertex_index"]) else { return Ok(()) };
        if element.properties[corners].length.is_none() {
            return Err(ImportError::file(format!(
                "`{}` of its faces must be a list",
                element.properties[corners].name
            )));
        }
        let names = ["texcoord", "texcoords", "texture_coordinates", "uv"];
        let lists = names.iter().filter_map(|name| element.property(&[name]));
        let mut wanted = Wanted {
            corners,
            color: Extra::of(element, false, &CloudSettings::default())?,
            uv: lists.into_iter().find(|at| element.properties[*at].length.is_some()),
            picture: element.numbers(["texnumber"]).map(|[at]| at).filter(|_| self.pictures > 1),
        };
        let numbers_one = if self.pictures == 1 { element.property(&["texnumber"]) } else { None };
        if !mesh.colors.is_empty() {
            // The colours of vertices are finer.
            wanted.color.color = None;
        }
        let color = wanted.color.color.iter().flat_map(|(properties, _)| properties);
        let used: Vec<usize> =
            color.chain(&wanted.uv).chain([&corners]).chain(&wanted.picture).chain(&numbers_one).copied().collect();
        said.extend(element.unused(&used));
        memory::room(element.count.saturating_mul(size_of::<[u32; 3]>() as u64))
            .map_err(|e| ImportError::file(format!("{e}, which its {} faces take at least", element.count)))?;
        let plain = wanted.color.color.is_none() && wanted.uv.is_none() && wanted.picture.is_none();
        if plain
            && mesh.triangles.is_empty()
            && let Some(triangles) = table::triangles(element, corners, payload, mesh.positions.len())
        {
            mesh.triangles = triangles;
            return Ok(());
        }
        // The triangles of earlier elements get default values.
        self.colors.resize(if wanted.color.color.is_some() { mesh.triangles.len() } else { 0 }, Rgb::WHITE);
        self.uvs.resize(if wanted.uv.is_some() { mesh.triangles.len() } else { 0 }, [Vec2::ZERO; 3]);
        self.slots.resize(if wanted.picture.is_some() { mesh.triangles.len() } else { 0 }, 0);
        let (positions, triangles) = (&mesh.positions, &mut mesh.triangles);
        payload.rows(
            element,
            Part::default,
            |some, _, row| some.read(row, &wanted, positions),
            |some| {
                triangles.extend(some.triangles);
                self.colors.extend(some.colors);
                self.uvs.extend(some.uvs);
                self.slots.extend(some.slots);
                self.thin += some.thin;
                self.lost += some.lost;
                self.without_uv += some.without_uv;
            },
        )?;
        said.extend(wanted.color.rebase(&mut self.colors, "faces"));
        Ok(())
    }

    /// Transfers the values of faces to vertices, drops triangles with a corner that isn't finite, and adds warnings.
    pub(super) fn finish(mut self, mesh: &mut Mesh, said: &mut Vec<ImportError>) -> Result<(), ImportError> {
        if let Some(good) = mesh.positions.iter().copied().find(|p| p.is_finite())
            && mesh.positions.iter().any(|p| !p.is_finite())
        {
            let positions = &mesh.positions;
            let whole = |t: &[u32; 3]| t.iter().all(|v| positions[*v as usize].is_finite());
            let kept: Vec<bool> = mesh.triangles.iter().map(whole).collect();
            self.lost += kept.iter().filter(|kept| !**kept).count() as u64;
            super::keep(&mut mesh.triangles, &kept);
            super::keep(&mut self.colors, &kept);
            super::keep(&mut self.uvs, &kept);
            super::keep(&mut self.slots, &kept);
            let non_finite = positions.iter().filter(|p| !p.is_finite()).count();
            said.push(ImportError::file(format!(
                "{non_finite} vertices have a coordinate that isn't a finite number; they are left out, and {} faces \
                 with them",
                self.lost
            )));
            // No triangle uses these vertices.
            mesh.positions.iter_mut().filter(|p| !p.is_finite()).for_each(|p| *p = good);
        } else if mesh.positions.iter().all(|p| !p.is_finite()) {
            mesh.triangles.clear();
            return Ok(());
        }
        if self.thin > 0 {
            said.push(ImportError::file(format!("{} faces of fewer than 3 corners are left out", self.thin)));
        }
        if self.without_uv > 0 {
            said.push(ImportError::file(format!(
                "{} faces have other than two texture coordinates for each corner; theirs are taken as 0",
                self.without_uv
            )));
        }
        if mesh.positions.len() + 3 * self.colors.len().max(self.uvs.len()) >= u32::MAX as usize {
            return Err(ImportError::file("its faces have more corners of their own than 32 bits can count"));
        }
        self.split(mesh);
        // Triangles of later elements without numbers have the first picture.
        self.slots.resize(if self.slots.is_empty() { 0 } else { mesh.triangles.len() }, 0);
        let last = self.pictures.saturating_sub(1) as u32;
        let unknown = self.slots.iter().filter(|slot| **slot > last).count();
        if unknown > 0 {
            said.push(ImportError::file(format!("{unknown} faces have the number of no picture; they have the first")));
            self.slots.iter_mut().filter(|slot| **slot > last).for_each(|slot| *slot = 0);
        }
        mesh.slots = self.slots;
        Ok(())
    }

    /// Writes the colours and texture coordinates of faces to their vertices, and copies vertices that have several
    /// values.
    fn split(&self, mesh: &mut Mesh) {
        if self.colors.is_empty() && self.uvs.is_empty() {
            return;
        }
        let vertices = mesh.positions.len();
        // Triangles of other elements, without colours or texture coordinates, have the default ones.
        if !self.colors.is_empty() {
            mesh.colors = vec![Rgb::WHITE; vertices];
        }
        if !self.uvs.is_empty() {
            mesh.uvs = vec![Vec2::ZERO; vertices];
        }
        let mut own: Vec<Option<[u32; 5]>> = vec![None; vertices];
        let mut copies: HashMap<(u32, [u32; 5]), u32> = HashMap::new();
        for t in 0..mesh.triangles.len() {
            for k in 0..3 {
                let vertex = mesh.triangles[t][k];
                let color = self.colors.get(t).copied().unwrap_or(Rgb::WHITE);
                let uv = self.uvs.get(t).map_or(Vec2::ZERO, |uvs| uvs[k]);
                let value = [color.r, color.g, color.b, uv.x, uv.y].map(f32::to_bits);
                let known = own[vertex as usize].get_or_insert_with(|| {
                    self.write(mesh, vertex, color, uv);
                    value
                });
                if *known == value {
                    continue;
                }
                mesh.triangles[t][k] = *copies.entry((vertex, value)).or_insert_with(|| {
                    let copy = mesh.positions.len() as u32;
                    again(&mut mesh.positions, vertex);
                    again(&mut mesh.normals, vertex);
                    again(&mut mesh.colors, vertex);
                    again(&mut mesh.uvs, vertex);
                    self.write(mesh, copy, color, uv);
                    copy
                });
            }
        }
    }

    /// Writes the values of a face to a vertex.
    fn write(&self, mesh: &mut Mesh, vertex: u32, color: Rgb, uv: Vec2) {
        if !self.colors.is_empty() {
            mesh.colors[vertex as usize] = color;
        }
        if !self.uvs.is_empty() {
            mesh.uvs[vertex as usize] = uv;
        }
    }
}

/// Appends a copy of an item, if the list isn't empty.
fn again<T: Copy>(list: &mut Vec<T>, at: u32) {
    list.extend(list.get(at as usize).copied());
}

/// Some faces, split into triangles.
#[derive(Default)]
struct Part {
    triangles: Vec<[u32; 3]>,
    colors: Vec<Rgb>,
    uvs: Vec<[Vec2; 3]>,
    slots: Vec<u32>,
    thin: u64,
    lost: u64,
    without_uv: u64,
    corners: Vec<u32>,
    points: Vec<Vec3>,
    triangulator: Triangulator,
}

impl Part {
    fn read(&mut self, row: &Row, wanted: &Wanted, positions: &[Vec3]) -> Result<(), String> {
        let Part { triangles, colors, uvs, corners, points, triangulator, .. } = self;
        corners.clear();
        for entry in row.list(wanted.corners) {
            corners.push(index(*entry, positions.len())?);
        }
        if corners.len() < 3 {
            self.thin += 1;
            return Ok(());
        }
        points.clear();
        points.extend(corners.iter().map(|i| positions[*i as usize]));
        if points.iter().any(|p| !p.is_finite()) {
            self.lost += 1;
            return Ok(());
        }
        let first = triangles.len();
        let uv = wanted.uv.map(|property| row.list(property));
        self.without_uv += u64::from(uv.is_some_and(|uv| uv.len() != 2 * corners.len()));
        let uv_of = |corner: usize| match uv {
            Some(uv) if uv.len() == 2 * corners.len() => {
                from_top(Vec2::new(uv[2 * corner] as f32, uv[2 * corner + 1] as f32))
            }
            _ => Vec2::ZERO,
        };
        let mut add = |t: [usize; 3]| {
            triangles.push(t.map(|i| corners[i]));
            if wanted.uv.is_some() {
                uvs.push(t.map(uv_of));
            }
        };
        match points.len() {
            3 => add([0, 1, 2]),
            _ => triangulator.cut(points, add)?,
        }
        if let Some(picture) = wanted.picture {
            // The cast makes numbers below 0 and NaN the first picture.
            self.slots.resize(self.slots.len() + triangles.len() - first, row.numbers[picture] as u32);
        }
        if wanted.color.color.is_some() {
            let mut one = Vec::new();
            wanted.color.read(row, &mut Vec::new(), &mut one)?;
            colors.resize(colors.len() + triangles.len() - first, one[0]);
        }
        Ok(())
    }
}

/// Reads an element of strips.
pub(super) fn strips(element: &Element, payload: &mut Payload<'_>, mesh: &mut Mesh) -> Result<(), ImportError> {
    let property = element.property(&["vertex_indices", "vertex_index"]);
    let property = property.filter(|at| element.properties[*at].length.is_some());
    let property = property.ok_or_else(|| ImportError::file("its strips need the list `vertex_indices`"))?;
    let Mesh { positions, triangles, .. } = mesh;
    let read = |some: &mut Vec<[u32; 3]>, _, row: &Row| {
        let mut strip = Vec::new();
        for entry in row.list(property) {
            if *entry == -1.0 {
                strip.clear();
                continue;
            }
            strip.push(index(*entry, positions.len())?);
            // Every second triangle has the opposite orientation.
            let n = strip.len();
            if n >= 3 {
                let [a, b, c] = [strip[n - 3], strip[n - 2], strip[n - 1]];
                let triangle = if n % 2 == 1 { [a, b, c] } else { [b, a, c] };
                // Strips are joined by repeated corners.
                if a != b && b != c && c != a {
                    some.push(triangle);
                }
            }
        }
        Ok(())
    };
    payload.rows(element, Vec::new, read, |some| triangles.extend(some))
}
