//! Interpolation of a solution between patches, without cracks where patches of different sizes meet.
//!
//! Each vertex has the mean light of the patches around it, which the local pass finds at the vertex itself. A patch
//! counts vertices on its edges that finer neighbours have, too. It is a fan of triangles from its centre, with linear
//! light in each. Patches on both sides of an edge thus have equal light along it. No light is shared across contacts,
//! where a wall may stand between two patches.

use super::local_pass::LocalPass;
use super::mesh::{Element, PatchMesh};
use super::solution::ArrivingLight;
use canaletto_parallel::prelude::*;
use glam::DVec3;
use std::collections::HashMap;

/// The steps per unit in which normals of flat surfaces that share vertices are equal.
const NORMAL_STEPS: f64 = 256.0;

/// The place of a vertex and the surface that it belongs to.
#[derive(Clone, PartialEq, Eq, Hash)]
struct Key {
    place: [u64; 3],
    instance: u32,
    /// The primitive and part of a curved surface, or the rounded normal of a flat one.
    surface: [i32; 3],
    is_flat: bool,
    is_outer: bool,
    material: u32,
    /// On which side of each contact through the vertex the patch lies.
    sides: u64,
}

/// The vertices of all patches with their light.
#[derive(Clone, Debug, Default)]
pub(super) struct Interpolation {
    pub(super) points: Vec<DVec3>,
    pub(super) light: Vec<ArrivingLight>,
    /// The light at the centre of each patch.
    pub(super) centers: Vec<ArrivingLight>,
    /// For each patch, the first of its vertices in `boundary`; the last number is the number of all.
    pub(super) firsts: Vec<u32>,
    pub(super) boundary: Vec<u32>,
}

impl Interpolation {
    /// The vertices of all leaves of a mesh, whose mean light is `light`, in the order of the leaves, each with the
    /// part that the environment sends. `local` finds the
    /// light at points.
    pub(super) fn new(mesh: &PatchMesh, light: &[(ArrivingLight, DVec3)], local: Option<&LocalPass>) -> Interpolation {
        let elements = mesh.leaf_elements();
        let leaves: Vec<&Element> = elements.iter().map(|&element| &mesh.elements[element as usize]).collect();
        let mut numbers: HashMap<Key, u32> = HashMap::new();
        let mut points = Vec::new();
        for element in &leaves {
            for &corner in element.outline.corners() {
                numbers.entry(key(mesh, element, corner)).or_insert_with(|| {
                    points.push(corner);
                    points.len() as u32 - 1
                });
            }
        }
        let (mut firsts, mut boundary) = (vec![0], Vec::new());
        for element in &leaves {
            let corners = element.outline.corners();
            for (i, &from) in corners.iter().enumerate() {
                boundary.extend(numbers.get(&key(mesh, element, from)));
                hanging(mesh, element, [from, corners[(i + 1) % corners.len()]], &numbers, &mut boundary);
            }
            firsts.push(boundary.len() as u32);
        }
        let mut around: Vec<Vec<u32>> = vec![Vec::new(); points.len()];
        for (patch, _) in leaves.iter().enumerate().filter(|(_, element)| element.area > 0.0) {
            for &vertex in &boundary[firsts[patch] as usize..firsts[patch + 1] as usize] {
                around[vertex as usize].push(patch as u32);
            }
        }
        // What the local pass finds takes the place of what the patch receives.
        let with = |(mean, sky): (ArrivingLight, DVec3), [from_emitters, reflected]: [DVec3; 2]| ArrivingLight {
            from_emitters,
            indirect: reflected + sky,
            ..mean
        };
        let at_vertex = |vertex: usize| {
            let point = points[vertex];
            let VertexPatches { shares, planes } =
                VertexPatches::new(mesh, |patch| leaves[patch as usize], &around[vertex], point);
            let (mut mean, mut sky) = (ArrivingLight::default(), DVec3::ZERO);
            for (patch, share) in shares {
                let (light, of_sky) = &light[patch as usize];
                mean = mean.plus(&light.map(|light| light * share));
                sky += *of_sky * share;
            }
            let Some(local) = local else { return mean };
            let share = 1.0 / planes.len() as f64;
            planes.iter().fold(ArrivingLight::default(), |sum, &patch| {
                let received = local.received(elements[patch as usize], point);
                sum.plus(&with((mean, sky), received).map(|light| light * share))
            })
        };
        let light_at_vertices = (0..points.len()).into_par_iter().with_min_len(16).map(at_vertex).collect();
        let centers = match local {
            None => light.iter().map(|&(mean, _)| mean).collect(),
            Some(local) => light.iter().zip(&local.centers).map(|(&mean, &received)| with(mean, received)).collect(),
        };
        Interpolation { points, light: light_at_vertices, centers, firsts, boundary }
    }

    /// The patches that have a vertex, in order.
    pub(super) fn around(&self, vertex: u32) -> Vec<u32> {
        let has_it = |patch: &u32| self.vertices_of(*patch as usize).contains(&vertex);
        (0..self.firsts.len() as u32 - 1).filter(has_it).collect()
    }

    fn vertices_of(&self, patch: usize) -> &[u32] {
        &self.boundary[self.firsts[patch] as usize..self.firsts[patch + 1] as usize]
    }

    /// The light at a point of a patch, whose centre is given.
    pub(super) fn at(&self, patch: usize, center: DVec3, point: DVec3) -> ArrivingLight {
        self.corners_at(patch, center, point).map_or(self.centers[patch], |corners| blended(&corners))
    }

    /// The corners of the triangle that a point of a patch lies in, the patch's centre first. None if the patch has no
    /// such triangle.
    pub(super) fn corners_at(&self, patch: usize, center: DVec3, point: DVec3) -> Option<[BlendedLight; 3]> {
        let vertices = self.vertices_of(patch);
        let mut best: Option<(f64, [f64; 3], [u32; 2])> = None;
        for (i, &a) in vertices.iter().enumerate() {
            let b = vertices[(i + 1) % vertices.len()];
            let [to_a, to_b] = [a, b].map(|vertex| self.points[vertex as usize] - center);
            let normal = to_a.cross(to_b);
            let square = normal.length_squared();
            if square == 0.0 {
                continue;
            }
            let p = point - center;
            let (v, w) = (p.cross(to_b).dot(normal) / square, to_a.cross(p).dot(normal) / square);
            let weights = [1.0 - v - w, v, w];
            // The triangle that the point is in is the one in whose angle at the centre it lies.
            let inside = v.min(w);
            if best.is_none_or(|(before, ..)| inside > before) {
                best = Some((inside, weights, [a, b]));
            }
        }
        let (_, weights, vertices) = best?;
        let [own_weight, ..] = weights.map(|weight| weight.max(0.0));
        let at_vertex = |i: usize| BlendedLight {
            vertex: Some(vertices[i]),
            place: self.points[vertices[i] as usize],
            weight: weights[i + 1].max(0.0),
            light: self.light[vertices[i] as usize],
        };
        Some([
            BlendedLight { vertex: None, place: center, weight: own_weight, light: self.centers[patch] },
            at_vertex(0),
            at_vertex(1),
        ])
    }
}

/// The patches that the light at a vertex is made of.
pub(super) struct VertexPatches {
    /// The patches around the vertex with their shares in its mean light.
    pub(super) shares: Vec<(u32, f64)>,
    /// In each plane the smallest patch. Its links are the finest; the local pass takes them for all patches.
    pub(super) planes: Vec<u32>,
}

impl VertexPatches {
    /// `around` are the numbers of the patches that have the vertex and an area, `leaf` finds their elements.
    pub(super) fn new<'m>(
        mesh: &PatchMesh,
        leaf: impl Fn(u32) -> &'m Element,
        around: &[u32],
        point: DVec3,
    ) -> VertexPatches {
        let weight = |&patch: &u32| 1.0 / point.distance(leaf(patch).center);
        let all: f64 = around.iter().map(weight).sum();
        let mut planes: Vec<(DVec3, u32)> = Vec::new();
        for &patch in around {
            let element = leaf(patch);
            let normal = mesh.roots[element.root as usize].normal;
            match planes.iter_mut().find(|(other, _)| *other == normal) {
                None => planes.push((normal, patch)),
                Some((_, other)) if leaf(*other).area > element.area => *other = patch,
                Some(_) => {}
            }
        }
        VertexPatches {
            shares: around.iter().map(|patch| (*patch, weight(patch) / all)).collect(),
            planes: planes.into_iter().map(|(_, patch)| patch).collect(),
        }
    }
}

/// Light at a place, with its weight in light that is interpolated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct BlendedLight {
    /// The number of the vertex; none for the centre of a patch.
    pub(crate) vertex: Option<u32>,
    pub(crate) place: DVec3,
    pub(crate) weight: f64,
    pub(crate) light: ArrivingLight,
}

/// The weighted mean of light.
pub(crate) fn blended(corners: &[BlendedLight]) -> ArrivingLight {
    let weights = corners.iter().fold(0.0, |sum, corner| sum + corner.weight);
    let weighted = |corner: &BlendedLight| corner.light.map(|light| light * corner.weight);
    let sum = corners.iter().fold(ArrivingLight::default(), |sum, corner| sum.plus(&weighted(corner)));
    sum.map(|sum| sum / weights)
}

/// The vertices of finer neighbours between the ends of an edge.
fn hanging(
    mesh: &PatchMesh,
    element: &Element,
    [from, to]: [DVec3; 2],
    numbers: &HashMap<Key, u32>,
    found: &mut Vec<u32>,
) {
    let middle = (from + to) * 0.5;
    if middle == from || middle == to {
        return;
    }
    if let Some(&vertex) = numbers.get(&key(mesh, element, middle)) {
        hanging(mesh, element, [from, middle], numbers, found);
        found.push(vertex);
        hanging(mesh, element, [middle, to], numbers, found);
    }
}

fn key(mesh: &PatchMesh, element: &Element, point: DVec3) -> Key {
    let root = &mesh.roots[element.root as usize];
    let surface = if root.is_flat {
        (root.normal * NORMAL_STEPS).round().to_array().map(|v| v as i32)
    } else {
        [root.primitives[0] as i32, root.part as i32, 0]
    };
    let mut sides = 0;
    for (i, [from, to]) in root.cuts.iter().enumerate() {
        let way = *to - *from;
        let along = (point - *from).dot(way) / way.length_squared();
        let off = (point - *from - way * along).length();
        let slack = root.tolerance / way.length();
        if off <= 4.0 * root.tolerance && (-slack..=1.0 + slack).contains(&along) {
            // The normal of the outer side, which both sides of a surface have in common.
            let side = root.normal.cross(way).dot(element.center - *from);
            sides |= if side > 0.0 { 1 << (i % 32) } else { 1 << (32 + i % 32) };
        }
    }
    Key {
        // −0 becomes 0.
        place: (point + 0.0).to_array().map(f64::to_bits),
        instance: root.instance,
        surface,
        is_flat: root.is_flat,
        is_outer: root.is_outer,
        material: root.material,
        sides,
    }
}
