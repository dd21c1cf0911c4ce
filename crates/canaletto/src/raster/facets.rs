//! The triangles that stand for primitives: those of meshes themselves, and tessellations of shapes within a tolerance
//! on the screen.

use super::projection::Projection;
use crate::camera::Camera;
use crate::math::{Rgb, Transform};
use crate::shape::{Mesh, Shape, Tessellation};
use canaletto_bvh::Aabb;
use glam::{DVec3, Vec2, Vec3};

/// The most triangles of one shape. A shape that needs more is drawn with a larger tolerance.
pub(crate) const MOST_TRIANGLES: usize = 1 << 20;

/// The most triangles of equal parts of a shape. A shape that needs more, such as a large one around the viewer, is cut
/// more finely where it is nearer.
const MOST_EVEN_TRIANGLES: usize = 1 << 15;

/// The tessellation of one shape in its own space.
#[derive(Debug)]
pub(crate) struct Facets {
    pub(crate) mesh: Mesh,
    /// The part of the shape that each triangle stands for.
    pub(crate) parts: Vec<u32>,
    /// The shape's own colour.
    pub(crate) color: Option<Rgb>,
    /// Whether the triangles are the shape itself, so that its own surface is evaluated.
    pub(crate) is_exact: bool,
    /// The corners of triangles that `f32` doesn't place well enough: those of large shapes, seen from near.
    exact_positions: Option<Vec<DVec3>>,
    tolerance: FacetTolerance,
    /// Whether the tolerance would have needed too many triangles.
    pub(crate) is_coarse: bool,
}

/// The largest distance between a shape and its triangles, in the shape's space.
#[derive(Clone, Copy, Debug)]
enum FacetTolerance {
    /// Equal everywhere.
    Even(f64),
    /// This many times the distance from the viewer, which is no less than `floor`.
    Distance { factor: f64, floor: f64 },
}

/// The tolerance of tessellations on the screen.
#[derive(Clone, Debug)]
pub(crate) struct Tolerance {
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
    /// Its least depth in a projection, but no less than that of the near plane. Depths are at least the cosine times
    /// the distance from the eye.
    Depth { projection: Projection, near: f64, eye: DVec3, cosine: f64 },
    /// That of its bounds from a point, but no less than their diagonal times [`LEAST_DISTANCE`].
    FromPoint(DVec3),
    /// Equal for all shapes.
    Parallel,
}

/// Shapes around a point are as fine as if they were seen from this share of their size. Their depths are exact, so
/// that only outlines depend on it.
const LEAST_DISTANCE: f64 = 1.0 / 8.0;

impl Tolerance {
    pub(crate) fn new(
        pixels: f64,
        projection: &Projection,
        size: [f64; 2],
        camera: &Camera,
        near: f64,
        view: Aabb,
    ) -> Tolerance {
        let scale = projection.pixels_per_unit(size);
        if camera.is_orthographic() {
            return Tolerance { pixels, distance: ViewDistance::Parallel, scale, view };
        }
        let corners = [[0.0, 0.0], [size[0], 0.0], [0.0, size[1]], size];
        let cosine = |[x, y]: [f64; 2]| -camera.line(x, y).direction.dot(camera.axes()[2]);
        let cosine = corners.map(cosine).into_iter().fold(1.0, f64::min);
        let distance = ViewDistance::Depth { projection: projection.clone(), near, eye: camera.eye(), cosine };
        Tolerance { pixels, distance, scale, view }
    }

    /// The tolerance of views in all directions from a point. Each has a square of `side` pixels with a half angle of
    /// 45°.
    pub(crate) fn around(point: DVec3, pixels: f64, side: u32, view: Aabb) -> Tolerance {
        // The centre of a square has half as many pixels for each unit of length; its corners have at most 2√3 as many.
        let scale = 3.0f64.sqrt() * f64::from(side);
        Tolerance { pixels, distance: ViewDistance::FromPoint(point), scale, view }
    }

    /// The tolerance of a parallel view, as a length.
    pub(crate) fn parallel(length: f64) -> Tolerance {
        Tolerance { pixels: length, distance: ViewDistance::Parallel, scale: 1.0, view: Aabb::EMPTY }
    }

    /// The tolerance in a shape's space.
    fn of(&self, shape: &Shape, to_world: Option<&Transform>) -> f64 {
        let depth = match &self.distance {
            ViewDistance::Depth { projection, near, .. } => shape.bounds().map_or(*near, |bounds| {
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
            ViewDistance::Parallel => 1.0,
        };
        depth * self.factor(to_world)
    }

    /// The tolerance in a shape's space over the depth in the world.
    fn factor(&self, to_world: Option<&Transform>) -> f64 {
        self.pixels / (self.scale * to_world.map_or(1.0, Transform::max_stretch))
    }

    /// The viewer, the factor of distances from there, and the least depth.
    fn viewer(&self, shape: &Shape, to_world: Option<&Transform>) -> (DVec3, f64, f64) {
        match &self.distance {
            ViewDistance::Depth { near, eye, cosine, .. } => (*eye, *cosine, *near),
            ViewDistance::FromPoint(point) => {
                let size = shape.bounds().map_or(0.0, |bounds| (bounds.max - bounds.min).as_dvec3().length());
                (*point, 1.0, size * to_world.map_or(1.0, Transform::max_stretch) * LEAST_DISTANCE)
            }
            ViewDistance::Parallel => (DVec3::ZERO, 0.0, 1.0),
        }
    }
}

/// The corners of a box.
pub(crate) fn corners(bounds: &Aabb) -> impl Iterator<Item = DVec3> {
    let (low, high) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
    (0..8).map(move |i: u32| DVec3::select(glam::BVec3::new(i & 1 == 0, i & 2 == 0, i & 4 == 0), low, high))
}

impl Facets {
    /// The triangles of a shape.
    pub(crate) fn new(
        shape: &Shape,
        color: Option<Rgb>,
        to_world: Option<&Transform>,
        tolerance: &Tolerance,
    ) -> Facets {
        let even = tolerance.of(shape, to_world);
        let evenly = shape.tessellate(even, &tolerance.view, MOST_EVEN_TRIANGLES);
        let is_even = evenly.is_ok();
        let (tessellation, facet_tolerance, is_coarse) = match evenly {
            Ok(tessellation) => (tessellation, FacetTolerance::Even(even), false),
            Err(_) => Facets::for_view(shape, to_world, tolerance),
        };
        let is_far = !is_even || matches!(shape, Shape::Plane(_));
        let exact_positions = is_far.then(|| tessellation.vertices.iter().map(|v| v.point).collect());
        let is_exact = shape.is_polygonal() || matches!(shape, Shape::Disk(_));
        let one_sided = matches!(shape, Shape::Triangle(triangle) if triangle.one_sided);
        let mesh = Mesh {
            positions: tessellation.vertices.iter().map(|v| v.point.as_vec3()).collect(),
            normals: tessellation.vertices.iter().map(|v| v.normal.as_vec3()).collect(),
            uvs: tessellation.vertices.iter().map(|v| v.uv.as_vec2()).collect(),
            triangles: tessellation.triangles,
            one_sided,
            ..Mesh::default()
        };
        let (parts, tolerance) = (tessellation.parts, facet_tolerance);
        Facets { mesh, parts, color, is_exact, exact_positions, tolerance, is_coarse }
    }

    /// The triangles of a shape, finer where they are nearer. Then their tolerance, and whether it is larger than what
    /// was asked for.
    fn for_view(
        shape: &Shape,
        to_world: Option<&Transform>,
        tolerance: &Tolerance,
    ) -> (Tessellation, FacetTolerance, bool) {
        let (viewer, cosine, floor) = tolerance.viewer(shape, to_world);
        let stretch = to_world.map_or(1.0, Transform::max_stretch);
        let wanted = tolerance.factor(to_world);
        let mut factor = wanted;
        loop {
            let allowed = |point: DVec3, radius: f64| {
                let point = to_world.map_or(point, |t| t.point(point));
                factor * (((point - viewer).length() - radius * stretch) * cosine).max(floor)
            };
            let facet_tolerance = match tolerance.distance {
                ViewDistance::Parallel => FacetTolerance::Even(factor),
                _ => FacetTolerance::Distance { factor, floor },
            };
            match shape.tessellate_for_view(&allowed, MOST_TRIANGLES) {
                Ok(Some(tessellation)) => return (tessellation, facet_tolerance, factor > wanted),
                Err(_) if factor.is_finite() && factor > 0.0 => factor *= 2.0,
                Ok(None) | Err(_) => return (Tessellation::default(), facet_tolerance, true),
            }
        }
    }

    /// The corners of a triangle in the shape's space.
    pub(crate) fn corners(&self, triangle: u32) -> [DVec3; 3] {
        match &self.exact_positions {
            Some(positions) => self.mesh.triangles[triangle as usize].map(|corner| positions[corner as usize]),
            None => self.mesh.corners(triangle as usize).map(Vec3::as_dvec3),
        }
    }

    /// The tolerance of triangles at a distance from the viewer.
    pub(crate) fn tolerance_at(&self, distance: f64) -> f64 {
        match self.tolerance {
            FacetTolerance::Even(tolerance) => tolerance,
            FacetTolerance::Distance { factor, floor } => factor * distance.max(floor),
        }
    }

    /// The memory that it takes.
    pub(crate) fn bytes(&self) -> usize {
        let corner = size_of::<[Vec3; 2]>() + size_of::<Vec2>();
        let exact = self.exact_positions.as_ref().map_or(0, |positions| positions.len() * size_of::<DVec3>());
        self.mesh.positions.len() * corner + exact + self.mesh.len() * size_of::<[u32; 4]>()
    }
}
