//! Closed parts of a mesh.
//!
//! Triangles of one material that are connected by vertices in one place form a part. A part is closed if each edge is
//! passed as often in one direction as in the other. Places at open edges that differ by the rounding of the mesh's
//! coordinates are one: programs that compute both sides of a seam get sin 2π instead of 0.

use crate::shape::Mesh;
use crate::world::data::folds::folds;
use canaletto_bvh::Aabb;
use glam::{DVec3, Vec3};
use std::collections::{BTreeMap, HashMap};

/// The closed parts of a mesh.
#[derive(Debug)]
pub(in crate::world) struct Shells {
    /// The material slot of each triangle; empty if all of them have the first slot.
    slots: Vec<u32>,
    /// Whether each triangle is in a closed part; empty if all are.
    closed: Vec<bool>,
    /// The volume of the closed parts of each slot, without hollows.
    volumes: Vec<f64>,
    /// The box around all places where the mesh lies on itself.
    folds: Aabb,
    /// For each slot with closed parts, the first triangle of them.
    examples: Vec<u32>,
    /// The open edges of each slot that has some.
    open: Vec<OpenEdges>,
}

/// The edges of a slot that aren't passed as often in one direction as in the other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::world) struct OpenEdges {
    /// A triangle at one of them.
    pub(in crate::world) triangle: u32,
    /// Their number.
    pub(in crate::world) count: u32,
}

/// The sides of all triangles, ordered by their smaller end.
struct Sides<S> {
    /// For each vertex, the end of its sides in `all`.
    ends: Vec<u32>,
    all: Vec<Side>,
    slot: S,
}

/// A triangle's side: its greater end, and the triangle. The last bit of the second number is the side's direction.
type Side = (u32, u32);

impl Shells {
    pub(in crate::world) fn of(mesh: &Mesh) -> Shells {
        let last = mesh.materials.len().saturating_sub(1) as u32;
        let slot = |triangle: usize| mesh.slots.get(triangle).map_or(0, |&slot| slot.min(last));
        let (closed, edges) = closed_triangles(mesh, slot);
        let mut volumes = vec![0.0; last as usize + 1];
        let origin = mesh.positions.first().map_or(DVec3::ZERO, |p| p.as_dvec3());
        for triangle in 0..mesh.triangles.len() {
            if closed.is_empty() || closed[triangle] {
                let [a, b, c] = mesh.corners(triangle).map(|p| p.as_dvec3() - origin);
                volumes[slot(triangle) as usize] += a.dot(b.cross(c)) / 6.0;
            }
        }
        let mut examples = vec![None; last as usize + 1];
        for triangle in (0..mesh.triangles.len()).filter(|&triangle| closed.is_empty() || closed[triangle]) {
            examples[slot(triangle) as usize].get_or_insert(triangle as u32);
        }
        let examples = examples.into_iter().flatten().collect();
        let folds = folds(mesh, |triangle| {
            let is_open = !closed.is_empty() && !closed[triangle];
            2 * slot(triangle) + u32::from(is_open)
        });
        let slots = (0..mesh.slots.len()).map(slot).collect();
        Shells { slots, closed, volumes: volumes.into_iter().map(f64::abs).collect(), folds, examples, open: edges }
    }

    /// The open edges of each slot that has some.
    pub(in crate::world) fn open_edges(&self) -> &[OpenEdges] {
        &self.open
    }

    /// The box around all places where the mesh lies on itself.
    pub(in crate::world) fn folds(&self) -> Aabb {
        self.folds
    }

    /// A triangle of each slot's closed parts, where there are any.
    pub(in crate::world) fn examples(&self) -> impl Iterator<Item = u32> {
        self.examples.iter().copied()
    }

    /// The slot of a triangle in a closed part, and the volume of the slot's closed parts.
    pub(in crate::world) fn around(&self, triangle: u32) -> Option<(u32, f64)> {
        let triangle = triangle as usize;
        let slot = self.slots.get(triangle).copied().unwrap_or(0);
        (self.closed.is_empty() || self.closed[triangle]).then(|| (slot, self.volumes[slot as usize]))
    }
}

/// Whether each triangle of a mesh is in a closed part, empty if all are, and the open edges of each slot.
fn closed_triangles(mesh: &Mesh, slot: impl Fn(usize) -> u32 + Copy) -> (Vec<bool>, Vec<OpenEdges>) {
    let mut sides = Sides::of(mesh, slot, |v| v);
    let (mut open, mut edges) = sides.open_triangles();
    if !open.is_empty() {
        // Vertices in one place may have different numbers, as on both sides of a seam.
        let mut welded = weld(&mesh.positions);
        sides = Sides::of(mesh, slot, |v| welded[v as usize]);
        (open, edges) = sides.open_triangles();
        if !open.is_empty() && weld_rounded(mesh, &open, &mut welded) {
            sides = Sides::of(mesh, slot, |v| welded[v as usize]);
            (open, edges) = sides.open_triangles();
        }
    }
    let closed = if open.is_empty() { Vec::new() } else { closed_parts(&sides, &open, mesh.triangles.len()) };
    (closed, edges)
}

/// The volume of the closed parts of a mesh, whatever its materials: less than 0 if its faces turn inwards.
pub(crate) fn signed_volume(mesh: &Mesh) -> f64 {
    let (closed, _) = closed_triangles(mesh, |_| 0);
    let origin = mesh.positions.first().map_or(DVec3::ZERO, |p| p.as_dvec3());
    let triangles = (0..mesh.len()).filter(|&triangle| closed.is_empty() || closed[triangle]);
    triangles
        .map(|triangle| {
            let [a, b, c] = mesh.corners(triangle).map(|p| p.as_dvec3() - origin);
            a.dot(b.cross(c)) / 6.0
        })
        .sum()
}

impl<S: Fn(usize) -> u32> Sides<S> {
    /// The sides of a mesh's triangles, with vertices renumbered by `vertex`.
    fn of(mesh: &Mesh, slot: S, vertex: impl Fn(u32) -> u32) -> Sides<S> {
        // A counting sort orders by the smaller end, a comparison sort by the rest.
        let mut ends = vec![0; mesh.positions.len() + 1];
        for &[a, b, c] in &mesh.triangles {
            let (a, b, c) = (vertex(a), vertex(b), vertex(c));
            for (a, b) in [(a, b), (b, c), (c, a)] {
                ends[a.min(b) as usize + 1] += u32::from(a != b);
            }
        }
        for vertex in 1..ends.len() {
            ends[vertex] += ends[vertex - 1];
        }
        let mut all = vec![(0, 0); ends[ends.len() - 1] as usize];
        for (triangle, &[a, b, c]) in (0..).zip(&mesh.triangles) {
            let (a, b, c) = (vertex(a), vertex(b), vertex(c));
            for (a, b) in [(a, b), (b, c), (c, a)] {
                if a != b {
                    let end = &mut ends[a.min(b) as usize];
                    all[*end as usize] = (a.max(b), triangle << 1 | u32::from(a < b));
                    *end += 1;
                }
            }
        }
        ends.pop();
        let mut start = 0;
        for &end in &ends {
            let sides = &mut all[start as usize..end as usize];
            if mesh.slots.is_empty() {
                sides.sort_unstable();
            } else {
                sides.sort_unstable_by_key(|&(other, way)| (slot(way as usize >> 1), other, way));
            }
            start = end;
        }
        Sides { ends, all, slot }
    }

    /// Calls `f` with all sides of one slot that share both ends.
    fn each_edge(&self, mut f: impl FnMut(&[Side])) {
        let mut start = 0;
        let slot = |way: u32| (self.slot)(way as usize >> 1);
        for &end in &self.ends {
            let sides = &self.all[start as usize..end as usize];
            sides.chunk_by(|a, b| a.0 == b.0 && slot(a.1) == slot(b.1)).for_each(&mut f);
            start = end;
        }
    }

    /// The triangles at edges that aren't passed as often in one direction as in the other, and these edges by slot.
    fn open_triangles(&self) -> (Vec<u32>, Vec<OpenEdges>) {
        let mut open = Vec::new();
        let mut edges: BTreeMap<u32, OpenEdges> = BTreeMap::new();
        self.each_edge(|edge| {
            let balance: i64 = edge.iter().map(|(_, way)| if way & 1 == 1 { 1 } else { -1 }).sum();
            if balance != 0 {
                open.extend(edge.iter().map(|(_, way)| way >> 1));
                let triangle = edge[0].1 >> 1;
                let of_slot = edges.entry((self.slot)(triangle as usize));
                of_slot.or_insert(OpenEdges { triangle, count: 0 }).count += 1;
            }
        });
        (open, edges.into_values().collect())
    }
}

/// For each position, the number of the first position in that place.
fn weld(positions: &[Vec3]) -> Vec<u32> {
    let mut first: HashMap<[u32; 3], u32> = HashMap::with_capacity(positions.len());
    // −0 and 0 are one place.
    let place = |p: &Vec3| (*p + Vec3::ZERO).to_array().map(f32::to_bits);
    (0..).zip(positions).map(|(number, p)| *first.entry(place(p)).or_insert(number)).collect()
}

/// How far apart rounding puts copies of a place: in steps of the largest coordinate.
const ROUNDINGS: f64 = 4.0;

/// Joins the vertices of open triangles whose places differ by rounding. `welded` holds the number of each vertex's
/// place. Returns whether any are joined.
fn weld_rounded(mesh: &Mesh, open: &[u32], welded: &mut [u32]) -> bool {
    let largest = mesh.positions.iter().fold(0.0f32, |largest, p| largest.max(p.abs().max_element()));
    let near = ROUNDINGS * f64::from(f32::EPSILON) * f64::from(largest);
    // Most places are far enough from the ends of their cell that no other cell is asked.
    let cell = |p: DVec3| (p / (8.0 * near)).floor().to_array().map(|v| v as i64);
    let corners = |&triangle: &u32| mesh.triangles[triangle as usize].map(|v| welded[v as usize]);
    let mut places: Vec<u32> = open.iter().flat_map(corners).collect();
    places.sort_unstable();
    places.dedup();
    let mut cells: HashMap<[i64; 3], Vec<u32>> = HashMap::new();
    let mut joined: HashMap<u32, u32> = HashMap::new();
    for place in places {
        let at = |place: u32| mesh.positions[place as usize].as_dvec3();
        let p = at(place);
        let ends = [cell(p - near), cell(p + near)];
        let around = (0..8).map(|bits| [0, 1, 2].map(|axis: usize| ends[bits >> axis & 1][axis]));
        let known = around.filter_map(|cell| cells.get(&cell)).flatten();
        match known.copied().filter(|&other| (at(other) - p).abs().max_element() <= near).min() {
            Some(other) => {
                joined.insert(place, other);
            }
            None => cells.entry(cell(p)).or_default().push(place),
        }
    }
    for place in welded {
        *place = joined.get(place).copied().unwrap_or(*place);
    }
    !joined.is_empty()
}

/// For each triangle, whether it isn't connected to an open triangle by sides of its slot.
fn closed_parts<S: Fn(usize) -> u32>(sides: &Sides<S>, open: &[u32], triangles: usize) -> Vec<bool> {
    let mut parents: Vec<u32> = (0..triangles as u32).collect();
    fn root(parents: &mut [u32], mut of: u32) -> u32 {
        while parents[of as usize] != of {
            let above = parents[parents[of as usize] as usize];
            parents[of as usize] = above;
            of = above;
        }
        of
    }
    sides.each_edge(|edge| {
        for pair in edge.windows(2) {
            let [a, b] = [pair[0].1, pair[1].1].map(|way| root(&mut parents, way >> 1));
            parents[a.max(b) as usize] = a.min(b);
        }
    });
    let mut closed = vec![true; triangles];
    for &triangle in open {
        let root = root(&mut parents, triangle);
        closed[root as usize] = false;
    }
    (0..triangles).map(|triangle| closed[root(&mut parents, triangle as u32) as usize]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A cube with separate corners for each face, turned inside out if `inward`.
    fn cube(center: f32, size: f32, inward: bool) -> Mesh {
        let corner = |i: usize| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32) * size + center;
        let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        let mut mesh = Mesh::default();
        for face in faces {
            let first = mesh.positions.len() as u32;
            mesh.positions.extend(face.map(corner));
            for [b, c] in [[1, 2], [2, 3]] {
                let [b, c] = if inward { [c, b] } else { [b, c] };
                mesh.triangles.push([first, first + b, first + c]);
            }
        }
        mesh
    }

    /// Whether the shell is the first, and its volume is this up to rounding.
    fn is_near(around: Option<(u32, f64)>, volume: f64) -> bool {
        around.is_some_and(|(shell, found)| shell == 0 && (found - volume).abs() < 1e-12 * volume)
    }

    fn both(mut a: Mesh, b: &Mesh) -> Mesh {
        let first = a.positions.len() as u32;
        a.positions.extend(&b.positions);
        a.triangles.extend(b.triangles.iter().map(|t| t.map(|v| v + first)));
        a
    }

    #[test]
    fn a_cube_of_loose_faces_is_closed() {
        let shells = Shells::of(&cube(-0.5, 2.0, false));
        assert!((0..12).all(|triangle| is_near(shells.around(triangle), 8.0)));
        assert_eq!(shells.open_edges(), []);
    }

    /// A face whose corners are off by a rounding closes a cube. One that is farther off leaves it open.
    #[test]
    fn copies_at_a_seam_may_differ_by_rounding() {
        for (off, is_closed) in [(2.4e-16, true), (-3e-7, true), (1e-5, false)] {
            for offset in [0.0, 1000.0] {
                let mut seam = cube(-1.0, 2.0, false);
                seam.positions[..4].iter_mut().for_each(|p| *p += off * Vec3::new(1.0, -1.0, 1.0));
                let far = if offset == 0.0 { 1.0 } else { 2e3 };
                seam.positions.iter_mut().for_each(|p| *p = *p * far + offset);
                let shells = Shells::of(&seam);
                assert_eq!(shells.around(7).is_some(), is_closed, "{off}, {offset}");
                assert_eq!(shells.open_edges().is_empty(), is_closed, "{off}, {offset}");
            }
        }
    }

    #[test]
    fn a_hollow_is_no_part_of_the_volume() {
        let hollow = both(cube(0.0, 3.0, false), &cube(1.0, 1.0, true));
        assert!(is_near(Shells::of(&hollow).around(23), 26.0));
    }

    #[test]
    fn what_is_open_does_not_open_what_hangs_elsewhere() {
        let mut lid_off = cube(5.0, 1.0, false);
        lid_off.triangles.pop();
        let shells = Shells::of(&both(cube(0.0, 2.0, false), &lid_off));
        assert!((0..12).all(|triangle| is_near(shells.around(triangle), 8.0)));
        assert!((12..23).all(|triangle| shells.around(triangle).is_none()));
        let [OpenEdges { triangle: 12..23, count: 3 }] = shells.open_edges() else {
            panic!("{:?}", shells.open_edges());
        };
    }

    #[test]
    fn a_side_turned_round_opens_a_cube() {
        let mut wrong = cube(0.0, 1.0, false);
        wrong.triangles[3].swap(0, 1);
        assert!((0..12).all(|triangle| Shells::of(&wrong).around(triangle).is_none()));
    }
}
