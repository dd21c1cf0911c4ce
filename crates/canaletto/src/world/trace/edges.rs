//! Edges of meshes. A ray that leaves a surface near an edge may start beyond the next triangle, since its origin is
//! offset.

use crate::math::DRay;
use crate::shape::Surface;
use crate::world::World;
use crate::world::data::geometry::Geometry;
use crate::world::trace::query::Hit;
use glam::DVec3;

/// The distance at which an edge is near, as a multiple of the offset of an origin. A face beyond an edge is then not
/// skipped unnoticed if the sine of the angle at the edge is at least 1 / `EDGE_FACTOR`.
const EDGE_FACTOR: f64 = 16.0;

/// A bound of the offset of an origin, relative to the terms of the largest coordinate.
const ORIGIN_OFFSET: f64 = 1.0 / (1 << 20) as f64;

/// The corners of a triangle in the world.
struct Corners {
    all: [DVec3; 3],
    /// The largest sum of the terms of a coordinate.
    terms: f64,
    /// Whether the transform mirrors the triangle.
    is_mirrored: bool,
}

impl Corners {
    /// Whether an edge is nearer than `reach` to the point with these barycentric coordinates.
    fn has_edge_within(&self, uv: [f32; 2], reach: f64) -> bool {
        let [a, b, c] = self.all;
        let [ab, bc, ca] = [b - a, c - b, a - c];
        let twice_area = ab.cross(ca).length_squared();
        let [u, v] = uv.map(f64::from);
        // The distance to an edge is the weight of the opposite corner times the height over the edge.
        let near = |weight: f64, edge: DVec3| weight * weight * twice_area < reach * reach * edge.length_squared();
        near(1.0 - u - v, bc) || near(u, ca) || near(v, ab)
    }
}

impl World {
    /// Whether a ray that leaves this surface may start beyond another triangle of its mesh.
    pub(crate) fn is_near_edge(&self, hit: &Hit, surface: &Surface) -> bool {
        let reach = EDGE_FACTOR * f64::from(surface.error.max_element());
        self.triangle_of(hit).is_some_and(|corners| corners.has_edge_within(hit.uv, reach))
    }

    /// Whether a line comes from the outer side of the triangle that it hits. `None` near an edge, or if the hit is on
    /// something else.
    pub(crate) fn hits_outer_side(&self, line: &DRay, hit: &Hit) -> Option<bool> {
        let corners = self.triangle_of(hit)?;
        if corners.has_edge_within(hit.uv, EDGE_FACTOR * ORIGIN_OFFSET * corners.terms) {
            return None;
        }
        let [a, b, c] = corners.all;
        let along = line.direction.dot((b - a).cross(c - a));
        Some(if corners.is_mirrored { along > 0.0 } else { along < 0.0 })
    }

    /// The triangle that was hit, in the world.
    fn triangle_of(&self, hit: &Hit) -> Option<Corners> {
        if hit.instance == Hit::UNBOUNDED {
            return None;
        }
        self.with_instance(hit.instance, |instance| {
            let Geometry::Mesh { mesh, .. } = &self.geometry.geometries[instance.geometry as usize] else {
                return None;
            };
            let local = mesh.corners_at(hit.primitive as usize, hit.time).map(|p| p.as_dvec3());
            let [a, b, c] = local;
            let largest = a.abs().max(b.abs()).max(c.abs());
            let Some(to_world) = instance.placed(&self.geometry.chains, hit.time) else {
                return Some(Corners { all: local, terms: largest.max_element(), is_mirrored: false });
            };
            let matrix = to_world.matrix();
            let [x, y, z] = [matrix.x_axis, matrix.y_axis, matrix.z_axis].map(DVec3::abs);
            let terms = x * largest.x + y * largest.y + z * largest.z + matrix.translation.abs();
            let is_mirrored = matrix.matrix3.determinant() < 0.0;
            Some(Corners { all: local.map(|p| to_world.point(p)), terms: terms.max_element(), is_mirrored })
        })
    }
}
