//! Conversion of triangles with separate indices for positions, texture coordinates and normals to meshes.

use super::super::DefaultShading;
use super::super::concat::concat;
use super::super::repair::repair_normals;
use super::super::smooth::{Smoothing, smooth};
use super::faces::{Corner, NONE, Pattern, Triangles};
use super::vertices::Vertices;
use canaletto::shape::Mesh;
use canaletto_parallel::prelude::*;
use glam::{Vec2, Vec3};
use std::collections::HashMap;
use std::ops::Range;

/// The meshes of a file by name, and the triangles so far.
#[derive(Default)]
pub(super) struct Parts {
    list: Vec<Part>,
    names: HashMap<String, usize>,
    slots: HashMap<(usize, u32), u32>,
    pieces: Vec<Triangles>,
    runs: Vec<Run>,
}

struct Part {
    name: String,
    materials: Vec<u32>,
}

/// Consecutive triangles of a piece with one part, slot and smoothing group.
struct Run {
    piece: usize,
    triangles: Range<usize>,
    part: usize,
    slot: u32,
    /// The smoothing group, if a line before them sets one.
    smoothing: Option<u32>,
}

impl Parts {
    /// The index of the part of this name.
    pub(super) fn named(&mut self, name: &str) -> usize {
        if let Some(part) = self.names.get(name) {
            return *part;
        }
        self.names.insert(name.to_owned(), self.list.len());
        self.list.push(Part { name: name.to_owned(), materials: Vec::new() });
        self.list.len() - 1
    }

    /// The slot of a material in a part.
    pub(super) fn slot(&mut self, part: usize, material: u32) -> u32 {
        let materials = &mut self.list[part].materials;
        *self.slots.entry((part, material)).or_insert_with(|| {
            materials.push(material);
            materials.len() as u32 - 1
        })
    }

    /// Assigns some triangles of the piece that is added next.
    pub(super) fn run(&mut self, triangles: Range<usize>, part: usize, slot: u32, smoothing: Option<u32>) {
        self.runs.push(Run { piece: self.pieces.len(), triangles, part, slot, smoothing });
    }

    /// Adds the triangles of a piece.
    pub(super) fn add(&mut self, triangles: Triangles) {
        self.pieces.push(triangles);
    }

    /// Builds the meshes. Faces without a material get `default`, which is called only if other faces have one.
    ///
    /// A single mesh keeps the vertices of the file unchanged, if possible. Other meshes get vertices in the order of
    /// their first use by triangles, one for each combination of position, texture coordinates and normal.
    pub(super) fn finish(
        mut self,
        vertices: Vertices,
        unsaid: DefaultShading,
        mut default: impl FnMut() -> u32,
    ) -> Vec<Mesh> {
        for part in &mut self.list {
            if part.materials == [NONE] {
                part.materials.clear();
            }
            part.materials.iter_mut().filter(|m| **m == NONE).for_each(|m| *m = default());
        }
        let groups = self.groups();
        let mut meshes = match self.pattern(&vertices) {
            Some(pattern) => vec![self.whole(vertices, pattern)],
            None => self.apart(&vertices),
        };
        meshes.par_iter_mut().enumerate().for_each(|(index, mesh)| {
            let groups = groups.as_ref().map(|groups| groups[index].as_slice());
            repair_normals(mesh, groups.map_or(Smoothing::Creases, Smoothing::Groups));
            if !mesh.normals.is_empty() {
                return;
            }
            match groups {
                Some(groups) if groups.iter().any(|group| *group != 0) => smooth(mesh, Smoothing::Groups(groups)),
                None if unsaid == DefaultShading::Creases => smooth(mesh, Smoothing::Creases),
                _ => {}
            }
        });
        meshes
    }

    /// The smoothing group of each triangle, for each mesh, if the file has any groups. Faces before the first group
    /// have group 0.
    fn groups(&self) -> Option<Vec<Vec<u32>>> {
        self.runs.iter().any(|run| run.smoothing.is_some()).then(|| {
            let mut groups = vec![Vec::new(); self.list.len()];
            for run in &self.runs {
                groups[run.part].extend(std::iter::repeat_n(run.smoothing.unwrap_or(0), run.triangles.len()));
            }
            groups
        })
    }

    /// The pattern of all corners, if there is a single mesh whose texture coordinates and normals have the indices of
    /// positions.
    fn pattern(&self, vertices: &Vertices) -> Option<Pattern> {
        let mut patterns = self.pieces.iter().filter(|piece| piece.len() > 0).map(|piece| match piece {
            Triangles::Plain(pattern, _) => Some(*pattern),
            Triangles::Full(_) => None,
        });
        let pattern = patterns.next()??;
        let counts = [vertices.uvs.len(), vertices.normals.len()];
        let fits = pattern.iter().zip(counts).all(|(there, count)| !there || count == vertices.positions.len());
        (self.list.len() == 1 && fits && patterns.all(|other| other == Some(pattern))).then_some(pattern)
    }

    /// Builds the only mesh.
    fn whole(self, vertices: Vertices, [uv, normal]: Pattern) -> Mesh {
        let slots = self.runs.iter().map(|run| (run.slot, run.triangles.len()));
        let slots = slots.flat_map(|(slot, count)| std::iter::repeat_n(slot, count));
        let plain = |piece| match piece {
            Triangles::Plain(_, list) => list,
            Triangles::Full(_) => Vec::new(),
        };
        let Vertices { origin, positions, colors, uvs, normals, .. } = vertices;
        let materials = self.list.iter().flat_map(|part| part.materials.iter().copied()).collect::<Vec<_>>();
        Mesh {
            name: self.list.iter().map(|part| part.name.as_str()).collect(),
            origin,
            positions,
            normals: if normal { normals } else { Vec::new() },
            uvs: if uv { uvs } else { Vec::new() },
            colors,
            slots: if materials.len() < 2 { Vec::new() } else { slots.collect() },
            triangles: concat(self.pieces.into_iter().map(plain).collect()),
            materials,
            ..Mesh::default()
        }
    }

    /// Builds the meshes with vertices of their own.
    fn apart(self, vertices: &Vertices) -> Vec<Mesh> {
        let Parts { list, pieces, runs, .. } = self;
        let mut numbers = Numbers { latest: vec![None; vertices.positions.len()], others: HashMap::new() };
        let mut drafts: Vec<Draft> = list.iter().map(|_| Draft::default()).collect();
        let mut runs = runs.into_iter().peekable();
        for (index, piece) in pieces.into_iter().enumerate() {
            while let Some(run) = runs.next_if(|run| run.piece == index) {
                let Draft { corners, triangles, slots } = &mut drafts[run.part];
                for triangle in run.triangles {
                    let triangle = piece.corners(triangle);
                    triangles.push(triangle.map(|corner| numbers.of(run.part as u32, corner, corners)));
                    slots.push(run.slot);
                }
            }
        }
        drop(numbers);
        let parts = list.into_iter().zip(drafts);
        parts.map(|(part, draft)| draft.finish(part, vertices)).collect()
    }
}

/// The vertex indices of corners in their meshes.
struct Numbers {
    /// For each position the latest corner with its part and index: the common case needs no hash lookup.
    latest: Vec<Option<(u32, Corner, u32)>>,
    others: HashMap<(u32, Corner), u32>,
}

impl Numbers {
    /// The index of a corner in a part; `corners` are the part's corners so far.
    fn of(&mut self, part: u32, corner: Corner, corners: &mut Vec<Corner>) -> u32 {
        let latest = &mut self.latest[corner[0] as usize];
        if let Some((of, known, number)) = *latest {
            if of == part && known == corner {
                return number;
            }
            self.others.insert((of, known), number);
        }
        let number = self.others.get(&(part, corner)).copied().unwrap_or_else(|| {
            corners.push(corner);
            corners.len() as u32 - 1
        });
        *latest = Some((part, corner, number));
        number
    }
}

/// A mesh under construction.
#[derive(Default)]
struct Draft {
    corners: Vec<Corner>,
    triangles: Vec<[u32; 3]>,
    slots: Vec<u32>,
}

impl Draft {
    fn finish(self, part: Part, vertices: &Vertices) -> Mesh {
        let Draft { corners, triangles, mut slots } = self;
        if part.materials.len() < 2 {
            slots = Vec::new();
        }
        let some = |which: usize| corners.par_iter().any(|c| c[which] != NONE);
        let take = |c: &Corner, which: usize| (c[which] != NONE).then_some(c[which] as usize);
        let (mut uvs, mut normals, mut colors) = (Vec::new(), Vec::new(), Vec::new());
        if some(1) {
            uvs = corners.par_iter().map(|c| take(c, 1).map_or(Vec2::ZERO, |i| vertices.uvs[i])).collect();
        }
        if some(2) {
            normals = corners.par_iter().map(|c| take(c, 2).map_or(Vec3::ZERO, |i| vertices.normals[i])).collect();
        }
        if !vertices.colors.is_empty() {
            colors = corners.par_iter().map(|c| vertices.colors[c[0] as usize]).collect();
        }
        let positions = corners.par_iter().map(|c| vertices.positions[c[0] as usize]).collect();
        let Part { name, materials } = part;
        Mesh {
            name,
            origin: vertices.origin,
            positions,
            normals,
            uvs,
            colors,
            triangles,
            slots,
            materials,
            ..Mesh::default()
        }
    }
}
