//! Triangles of all surfaces, with normals and two sets of texture coordinates.

use super::boundary::Boundaries;
use super::chart::Chart;
use super::layout::Layout;
use crate::integrator::radiosity::SolvedRoot;
use crate::material::MaterialPoint;
use crate::world::{Hit, World};
use canaletto_parallel::prelude::*;
use glam::{DVec2, DVec3, Vec2, Vec3};
use std::collections::{BTreeMap, HashMap};

/// How far from a triangle's corner its surface is looked up, relative to the way to the centre.
const LOOKUP: f64 = 1.0 / 64.0;

/// Steps to which texture coordinates are rounded, so that corners of neighbouring triangles are one vertex.
const UV_STEPS: f64 = (1 << 20) as f64;

/// Steps to which the components of normals are rounded.
const NORMAL_STEPS: f64 = (1 << 14) as f64;

/// A corner of triangles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BakedVertex {
    /// The place, relative to [`World::origin`].
    pub position: Vec3,
    /// The unit shading normal of the side.
    pub normal: Vec3,
    /// The surface's own texture coordinates; v grows upwards, as in the scene.
    pub uv: Vec2,
    /// The place in the atlas, from 0 to 1; v grows downwards.
    pub light_uv: Vec2,
}

/// The triangles of an object with one material, on one side of its surfaces.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BakedPart {
    /// The index of the material in [`World::materials`].
    pub material: u32,
    /// Whether the triangles show the outer side of the surface.
    pub is_outer: bool,
    /// The material's values, if they are the same on all triangles.
    pub constant: Option<MaterialPoint>,
    /// The vertices.
    pub vertices: Vec<BakedVertex>,
    /// The triangles, counter-clockwise when seen from the side that they show.
    pub triangles: Vec<[u32; 3]>,
}

/// The triangles of an object.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BakedMesh {
    /// The object's name. Triangles of one material that are objects each are one mesh with the material's name.
    pub name: String,
    /// The parts, by material and side.
    pub parts: Vec<BakedPart>,
}

/// A triangle of a root with its three corners.
struct Corners {
    /// The vertex of the boundary; `None` is the root's centre.
    vertices: [Option<u32>; 3],
    baked: [BakedVertex; 3],
}

/// The meshes of all charts.
pub(super) fn meshes(
    world: &World,
    roots: &[SolvedRoot],
    boundaries: &Boundaries,
    charts: &[Chart],
    layout: &Layout,
    constant: &[Option<MaterialPoint>],
) -> Vec<BakedMesh> {
    let triangles: Vec<Vec<Corners>> = charts
        .par_iter()
        .enumerate()
        .map(|(index, chart)| {
            let of = |&root: &u32| triangles_of(world, roots, boundaries, (chart, index), layout, root);
            chart.roots.iter().flat_map(of).collect()
        })
        .collect();
    let mut meshes: BTreeMap<[u32; 2], (String, Parts)> = BTreeMap::new();
    for (index, (chart, triangles)) in charts.iter().zip(triangles).enumerate() {
        let mut triangles = triangles.into_iter();
        for &number in &chart.roots {
            let root = &roots[number as usize];
            let (key, name) = object_of(world, root);
            let (_, parts) = meshes.entry(key).or_insert_with(|| (name, BTreeMap::new()));
            let part = parts.entry((root.material(), !root.is_outer())).or_insert_with(|| PartBuilder {
                part: BakedPart {
                    material: root.material(),
                    is_outer: root.is_outer(),
                    constant: constant[number as usize],
                    ..BakedPart::default()
                },
                ..PartBuilder::default()
            });
            part.part.constant = part.part.constant.filter(|own| constant[number as usize].as_ref() == Some(own));
            for corners in triangles.by_ref().take(triangle_count(boundaries, number)) {
                part.push((index as u32, number), &corners);
            }
        }
    }
    let mesh =
        |(name, parts): (String, Parts)| BakedMesh { name, parts: parts.into_values().map(|part| part.part).collect() };
    meshes.into_values().map(mesh).collect()
}

/// The key by which roots of an object are gathered, and the name.
fn object_of(world: &World, root: &SolvedRoot) -> ([u32; 2], String) {
    let hit = Hit { instance: root.instance(), primitive: root.primitive_at(root.center()), ..Hit::none(0.0, 0.0) };
    let object = world.object(&hit);
    if object.kind == "triangle" {
        let material = &world.materials()[root.material() as usize].name;
        let name = if material.is_empty() { "triangles".into() } else { format!("{material} triangles") };
        return ([0, root.material()], name);
    }
    ([world.object_id(&hit), 0], object.name.clone())
}

fn triangle_count(boundaries: &Boundaries, root: u32) -> usize {
    let count = boundaries.loops[root as usize].len();
    if boundaries.is_plain[root as usize] { count.saturating_sub(2) } else { count }
}

/// The triangles of a root. Where vertices lie on its edges, they fan out from the centre.
fn triangles_of(
    world: &World,
    roots: &[SolvedRoot],
    boundaries: &Boundaries,
    (chart, index): (&Chart, usize),
    layout: &Layout,
    number: u32,
) -> Vec<Corners> {
    let root = &roots[number as usize];
    let around = &boundaries.loops[number as usize];
    let triangles = triangle_count(boundaries, number);
    let corners = |i: usize| {
        let next = Some(around[(i + 1) % around.len()]);
        if boundaries.is_plain[number as usize] {
            [Some(around[0]), next, Some(around[(i + 2) % around.len()])]
        } else {
            [Some(around[i]), next, None]
        }
    };
    let place = |vertex: Option<u32>| vertex.map_or(root.center(), |vertex| boundaries.points[vertex as usize]);
    let baked = |i: usize| {
        let vertices = corners(i);
        let points = vertices.map(place);
        let middle = (points[0] + points[1] + points[2]) / 3.0;
        let baked = points.map(|point| {
            let (normal, uv) = surface_at(world, root, point, middle);
            let texel = layout.charts[index].texel(chart, point);
            let first = layout.charts[index].first.map(|first| f64::from(first) + 0.5);
            let size = layout.size.map(f64::from);
            let light_uv = (texel + DVec2::from_array(first)) / DVec2::from_array(size);
            BakedVertex { position: point.as_vec3(), normal, uv, light_uv: light_uv.as_vec2() }
        });
        Corners { vertices, baked }
    };
    (0..triangles).map(baked).collect()
}

/// The shading normal of a root's side, and its texture coordinates, at the corner of a triangle. The coordinates may
/// differ between triangles that meet there. They are those of points inside the triangle, continued to the corner.
fn surface_at(world: &World, root: &SolvedRoot, corner: DVec3, middle: DVec3) -> (Vec3, Vec2) {
    let at = |share: f64| {
        let point = corner + (middle - corner) * share;
        let line = root.line_through(point);
        world.surface_of(root.instance(), root.primitive_at(point), line).map(|(_, surface)| surface)
    };
    let near = at(LOOKUP);
    let side = if root.is_outer() { 1.0 } else { -1.0 };
    let normal = near.map_or(root.normal(), |surface| surface.shading_normal * side);
    let uv = match (near, at(2.0 * LOOKUP)) {
        (Some(near), Some(far)) => {
            let [near, far] = [near, far].map(|surface| surface.uv.as_dvec2() + surface.uv_rest.as_dvec2());
            near * 2.0 - far
        }
        _ => DVec2::ZERO,
    };
    // −0 becomes 0, so that equal values have equal bits.
    let normal = (normal * NORMAL_STEPS).round() / NORMAL_STEPS + DVec3::ZERO;
    let uv = (uv * UV_STEPS).round() / UV_STEPS + DVec2::ZERO;
    (normal.as_vec3(), uv.as_vec2())
}

/// The parts of a mesh, by material and whether they show inner sides.
type Parts = BTreeMap<(u32, bool), PartBuilder>;

/// A part with the numbers of its vertices.
#[derive(Default)]
struct PartBuilder {
    part: BakedPart,
    numbers: HashMap<VertexKey, u32>,
}

/// A chart, the vertex or the root of the centre, and the bits of what may differ there.
type VertexKey = (u32, Result<u32, u32>, [u32; 5]);

impl PartBuilder {
    fn push(&mut self, (chart, root): (u32, u32), corners: &Corners) {
        let numbers = [0, 1, 2].map(|i| {
            let vertex = &corners.baked[i];
            let [x, y, z] = vertex.normal.to_array();
            let [u, v] = vertex.uv.to_array();
            let key = (chart, corners.vertices[i].ok_or(root), [x, y, z, u, v].map(f32::to_bits));
            *self.numbers.entry(key).or_insert_with(|| {
                self.part.vertices.push(*vertex);
                self.part.vertices.len() as u32 - 1
            })
        });
        self.part.triangles.push(numbers);
    }
}
