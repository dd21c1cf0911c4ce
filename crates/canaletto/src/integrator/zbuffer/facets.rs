//! The triangles that stand for primitives: those of meshes themselves, and tessellations of shapes within a tolerance
//! on the screen.

use super::projection::Projection;
use crate::math::{Rgb, Transform};
use crate::shape::{Mesh, Shape};
use canaletto_bvh::Aabb;
use glam::{DVec3, Vec3};

/// The most triangles of one shape. A shape that needs more is drawn with a larger tolerance.
pub(super) const MOST_TRIANGLES: usize = 1 << 20;

/// The tessellation of one shape in its own space.
#[derive(Debug)]
pub(super) struct Facets {
    pub(super) mesh: Mesh,
    /// The part of the shape that each triangle stands for.
    pub(super) parts: Vec<u32>,
    /// The shape's own colour.
    pub(super) color: Option<Rgb>,
    /// Whether the triangles are the shape itself, so that its own surface is evaluated.
    pub(super) is_exact: bool,
    /// The tolerance in the shape's space.
    pub(super) tolerance: f64,
    /// Whether the tolerance would have needed too many triangles.
    pub(super) is_coarse: bool,
}

/// The tolerance of tessellations on the screen.
#[derive(Clone, Debug)]
pub(super) struct Tolerance {
    /// The largest distance in pixels.
    pixels: f64,
    projection: Projection,
    /// The number of pixels that a unit of length covers at a depth of 1, at most.
    scale: f64,
    near: f64,
    /// What planes are cut to, in the world's space.
    view: Aabb,
}

impl Tolerance {
    pub(super) fn new(pixels: f64, projection: &Projection, size: [f64; 2], near: f64, view: Aabb) -> Tolerance {
        let scale = projection.pixels_per_unit(size);
        Tolerance { pixels, projection: projection.clone(), scale, near, view }
    }

    /// The tolerance in a shape's space.
    fn of(&self, shape: &Shape, to_world: Option<&Transform>) -> f64 {
        let depth = shape.bounds().map_or(self.near, |bounds| {
            let projection = self.projection.of_space(to_world);
            corners(&bounds).map(|p| projection.point(p).z).fold(f64::INFINITY, f64::min).max(self.near)
        });
        self.pixels * depth / (self.scale * to_world.map_or(1.0, Transform::max_stretch))
    }
}

/// The corners of a box.
pub(super) fn corners(bounds: &Aabb) -> impl Iterator<Item = DVec3> {
    let (low, high) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
    (0..8).map(move |i: u32| DVec3::select(glam::BVec3::new(i & 1 == 0, i & 2 == 0, i & 4 == 0), low, high))
}

impl Facets {
    /// The triangles of a shape.
    pub(super) fn new(
        shape: &Shape,
        color: Option<Rgb>,
        to_world: Option<&Transform>,
        tolerance: &Tolerance,
    ) -> Facets {
        let wanted = tolerance.of(shape, to_world);
        let mut length = wanted;
        let tessellation = loop {
            match shape.tessellate(length, &tolerance.view, MOST_TRIANGLES) {
                Ok(tessellation) => break tessellation,
                Err(_) if length.is_finite() && length > 0.0 => length *= 2.0,
                Err(_) => break Default::default(),
            }
        };
        let is_exact = matches!(shape, Shape::Box(_) | Shape::Triangle(_) | Shape::Plane(_) | Shape::Disk(_));
        let one_sided = matches!(shape, Shape::Triangle(triangle) if triangle.one_sided);
        let mesh = Mesh {
            positions: tessellation.vertices.iter().map(|v| v.point.as_vec3()).collect(),
            normals: tessellation.vertices.iter().map(|v| v.normal.as_vec3()).collect(),
            uvs: tessellation.vertices.iter().map(|v| v.uv.as_vec2()).collect(),
            triangles: tessellation.triangles,
            one_sided,
            ..Mesh::default()
        };
        Facets { mesh, parts: tessellation.parts, color, is_exact, tolerance: length, is_coarse: length > wanted }
    }

    /// The corners of a triangle in the shape's space.
    pub(super) fn corners(&self, triangle: u32) -> [Vec3; 3] {
        self.mesh.corners(triangle as usize)
    }
}
