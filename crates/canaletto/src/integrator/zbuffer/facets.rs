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
    distance: ViewDistance,
    /// The number of pixels that a unit of length covers at a depth of 1, at most.
    scale: f64,
    /// What planes are cut to, in the world's space.
    view: Aabb,
}

/// The distance from which a shape is seen.
#[derive(Clone, Debug)]
enum ViewDistance {
    /// Its least depth in a projection, but no less than that of the near plane.
    Depth { projection: Projection, near: f64 },
    /// That of its bounds from a point, but no less than their diagonal times [`LEAST_DISTANCE`].
    FromPoint(DVec3),
}

/// Shapes around a point are as fine as if they were seen from this share of their size. Their depths are exact, so
/// that only outlines depend on it.
const LEAST_DISTANCE: f64 = 1.0 / 8.0;

impl Tolerance {
    pub(super) fn new(pixels: f64, projection: &Projection, size: [f64; 2], near: f64, view: Aabb) -> Tolerance {
        let scale = projection.pixels_per_unit(size);
        Tolerance { pixels, distance: ViewDistance::Depth { projection: projection.clone(), near }, scale, view }
    }

    /// The tolerance of views in all directions from a point. Each has a square of `side` pixels with a half angle of
    /// 45°.
    pub(super) fn around(point: DVec3, pixels: f64, side: u32, view: Aabb) -> Tolerance {
        // The centre of a square has half as many pixels for each unit of length; its corners have at most 2√3 as many.
        let scale = 3.0f64.sqrt() * f64::from(side);
        Tolerance { pixels, distance: ViewDistance::FromPoint(point), scale, view }
    }

    /// The tolerance in a shape's space.
    fn of(&self, shape: &Shape, to_world: Option<&Transform>) -> f64 {
        let depth = match &self.distance {
            ViewDistance::Depth { projection, near } => shape.bounds().map_or(*near, |bounds| {
                let projection = projection.of_space(to_world);
                corners(&bounds).map(|p| projection.point(p).z).fold(f64::INFINITY, f64::min).max(*near)
            }),
            // What has no bounds is flat.
            ViewDistance::FromPoint(point) => shape.bounds().map_or(f64::MAX, |bounds| {
                let placed = || corners(&bounds).map(|p| to_world.map_or(p, |t| t.point(p)));
                let low = placed().fold(DVec3::INFINITY, DVec3::min);
                let high = placed().fold(DVec3::NEG_INFINITY, DVec3::max);
                (*point - point.clamp(low, high)).length().max((high - low).length() * LEAST_DISTANCE)
            }),
        };
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
