//! The shapes (5.3), and the surface at a hit.
//!
//! Intersection has two stages. [`Shape::intersect`] finds the nearest t and the part of the shape that was hit.
//! [`Shape::surface`] evaluates point, normal and uv once, for the closest hit only.

mod cloud;
mod cone;
mod cuboid;
mod cuts;
mod cylinder;
mod disk;
pub(crate) mod displace;
mod flat;
mod frustum;
mod mesh;
mod parallelogram;
mod partial;
mod plane;
#[cfg(test)]
mod properties;
mod rays16;
mod sample;
mod sample_from;
mod solid;
mod solve;
mod sphere;
mod spherical_ellipse;
mod spherical_rectangle;
mod spherical_triangle;
mod surface;
mod surface_differential;
mod surfaces;
mod tessellate;
#[cfg(test)]
pub(crate) mod testing;
mod torus;
mod triangle;

pub use cloud::{CylinderCloud, SphereCloud};
pub use cone::Cone;
pub use cuboid::Cuboid;
pub use cylinder::Cylinder;
pub use disk::Disk;
pub(crate) use flat::Flats;
pub use mesh::{Mesh, MeshPose};
pub use parallelogram::Parallelogram;
pub use partial::{Partial, Round};
pub use plane::Plane;
pub(crate) use rays16::{Hits16, RAYS};
pub use sample::{SurfaceSample, SurfaceSampler};
pub(crate) use sample::{pick_by_area, sample_triangle};
pub(crate) use sample_from::cone_points;
pub use sphere::Sphere;
pub use surface::Surface;
pub use surface_differential::SurfaceDifferential;
pub(crate) use surfaces::{
    DVec3x8, SURFACES, SurfaceInputs8, Surfaces, Vec3x8, dvec3, set_bits, set_dvec3, set_vec3, vec3,
};
pub use tessellate::{Tessellation, TessellationVertex, TooManyTriangles};
pub use torus::Torus;
pub use triangle::Triangle;

use crate::OutOfRange;
use crate::math::{DRay, Transform};
use canaletto_bvh::{Aabb, Ray};
use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};
use solve::Frame;

/// The result of the first stage of intersection.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShapeHit {
    /// The ray's parameter, 0 < t ≤ t_max.
    pub t: f32,
    /// The part of the shape that was hit: a box's face (−x, +x, −y, +y, −z, +z), a cylinder's or cone's side (0), base
    /// (1) or top (2), a rectangle's half on either side of its diagonal. It is 0 for other shapes.
    pub part: u32,
    /// The barycentric coordinates where the shape has them, else zero.
    pub uv: [f32; 2],
}

/// An analytic shape.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Shape {
    /// A sphere.
    Sphere(Sphere),
    /// An axis-aligned box.
    Box(Cuboid),
    /// A triangle.
    Triangle(Triangle),
    /// An infinite plane.
    Plane(Plane),
    /// A flat disk.
    Disk(Disk),
    /// A cylinder.
    Cylinder(Cylinder),
    /// A cone or truncated cone.
    Cone(Cone),
    /// A torus.
    Torus(Torus),
    /// A rectangle, or any parallelogram.
    Rectangle(Parallelogram),
    /// A part of a cylinder, cone or disk.
    Partial(Partial),
}

/// Makes one call on the value of any variant.
macro_rules! each {
    ($self:expr, $s:ident => $call:expr) => {
        match $self {
            Shape::Sphere($s) => $call,
            Shape::Box($s) => $call,
            Shape::Triangle($s) => $call,
            Shape::Plane($s) => $call,
            Shape::Disk($s) => $call,
            Shape::Cylinder($s) => $call,
            Shape::Cone($s) => $call,
            Shape::Torus($s) => $call,
            Shape::Rectangle($s) => $call,
            Shape::Partial($s) => $call,
        }
    };
}

impl From<Sphere> for Shape {
    fn from(sphere: Sphere) -> Shape {
        Shape::Sphere(sphere)
    }
}

impl From<Cylinder> for Shape {
    fn from(cylinder: Cylinder) -> Shape {
        Shape::Cylinder(cylinder)
    }
}

impl Shape {
    /// The nearest hit with 0 < t ≤ t_max, from outside or inside. The ray's direction may have any length.
    pub fn intersect(&self, ray: &Ray, t_max: f32) -> Option<ShapeHit> {
        each!(self, s => s.intersect(ray, t_max))
    }

    /// The surface at a hit. [`Shape::intersect`] found the hit for this ray, or for the rounded ray of this line.
    pub fn surface(&self, line: impl Into<DRay>, hit: &ShapeHit) -> Surface {
        let line = line.into();
        each!(self, s => s.surface(line, hit))
    }

    /// [`Shape::surface`] whose texture coordinates are not read and may be left out.
    #[inline]
    pub(crate) fn surface_without_uv(&self, line: DRay, hit: &ShapeHit) -> Surface {
        match self {
            Shape::Sphere(s) => s.surface_without_uv(line, hit.t),
            Shape::Box(s) => s.surface_without_uv(line, hit.part),
            Shape::Disk(s) => s.surface_without_uv(line),
            other => other.surface(line, hit),
        }
    }

    /// The surface differential at a hit with this surface.
    pub fn surface_differential(&self, surface: &Surface, hit: &ShapeHit) -> SurfaceDifferential {
        match self {
            Shape::Sphere(s) => s.surface_differential(surface),
            Shape::Box(s) => s.surface_differential(hit),
            Shape::Triangle(s) => s.surface_differential(),
            Shape::Plane(s) => s.surface_differential(),
            Shape::Disk(s) => s.surface_differential(),
            Shape::Cylinder(s) => s.surface_differential(surface, hit),
            Shape::Cone(s) => s.surface_differential(surface, hit),
            Shape::Torus(s) => s.surface_differential(surface),
            Shape::Rectangle(s) => s.surface_differential(),
            Shape::Partial(s) => s.surface_differential(surface, hit),
        }
    }

    /// A tight box around every point that [`Shape::surface`] can return; none for a plane.
    pub fn bounds(&self) -> Option<Aabb> {
        match self {
            Shape::Sphere(s) => Some(s.bounds()),
            Shape::Box(s) => Some(s.bounds()),
            Shape::Triangle(s) => Some(s.bounds()),
            Shape::Plane(_) => None,
            Shape::Disk(s) => Some(s.bounds()),
            Shape::Cylinder(s) => Some(s.bounds()),
            Shape::Cone(s) => Some(s.bounds()),
            Shape::Torus(s) => Some(s.bounds()),
            Shape::Rectangle(s) => Some(s.bounds()),
            Shape::Partial(s) => Some(s.bounds()),
        }
    }

    /// The shape moved by a transform, if the result is a shape of this kind that `f32` can hold. The texture
    /// coordinates are those of the moved shape in its new place; see [`Shape::preserves_uv`].
    pub fn transformed(&self, t: &Transform) -> Option<Shape> {
        if t.is_identity() {
            return Some(*self);
        }
        let moved = match self {
            Shape::Sphere(s) => Shape::Sphere(s.transformed(t)?),
            Shape::Box(s) => Shape::Box(s.transformed(t)?),
            Shape::Triangle(s) => Shape::Triangle(s.transformed(t)?),
            Shape::Plane(s) => Shape::Plane(s.transformed(t)?),
            Shape::Disk(s) => Shape::Disk(s.transformed(t)?),
            Shape::Cylinder(s) => Shape::Cylinder(s.transformed(t)?),
            Shape::Cone(s) => Shape::Cone(s.transformed(t)?),
            Shape::Torus(s) => Shape::Torus(s.transformed(t)?),
            // Swapped edges would turn its image.
            Shape::Rectangle(_) if solve::mirrors(t) => return None,
            Shape::Rectangle(s) => Shape::Rectangle(s.transformed(t)),
            Shape::Partial(s) => Shape::Partial(s.transformed(t)?),
        };
        moved.check().is_ok().then_some(moved)
    }

    /// Returns the shape with each point replaced by `f` of its index and itself.
    pub(crate) fn map_points(&self, mut f: impl FnMut(usize, Vec3) -> Vec3) -> Shape {
        let mut shape = *self;
        let points: [Option<&mut Vec3>; 3] = match &mut shape {
            Shape::Sphere(Sphere { center, .. }) | Shape::Disk(Disk { center, .. }) => [Some(center), None, None],
            Shape::Torus(Torus { center, .. }) => [Some(center), None, None],
            Shape::Plane(Plane { point, .. }) => [Some(point), None, None],
            Shape::Box(Cuboid { min, max }) => [Some(min), Some(max), None],
            Shape::Triangle(Triangle { a, b, c, .. }) => [Some(a), Some(b), Some(c)],
            Shape::Cylinder(Cylinder { base, top, .. }) | Shape::Cone(Cone { base, top, .. }) => {
                [Some(base), Some(top), None]
            }
            Shape::Rectangle(Parallelogram { corner, .. }) => [Some(corner), None, None],
            Shape::Partial(Partial { whole, .. }) => match whole {
                Round::Cylinder(Cylinder { base, top, .. }) | Round::Cone(Cone { base, top, .. }) => {
                    [Some(base), Some(top), None]
                }
                Round::Disk(Disk { center, .. }) => [Some(center), None, None],
            },
        };
        for (i, point) in points.into_iter().flatten().enumerate() {
            *point = f(i, *point);
        }
        shape
    }

    /// The shape in coordinates relative to its first point, and that point; `rest` is the part of its points that
    /// `f32` doesn't hold.
    pub(crate) fn relative_to_first_point(&self, rest: &[Vec3; 3]) -> (Shape, DVec3) {
        let mut first = None;
        let near = self.map_points(|i, p| {
            let zero = *first.get_or_insert(p.as_dvec3());
            (p.as_dvec3() - zero + rest[i].as_dvec3()).as_vec3()
        });
        (near, first.unwrap_or_default())
    }

    /// Whether the result of [`Shape::transformed`] keeps the texture coordinates of every point. A turned sphere
    /// doesn't, as its poles stay upright; with a texture it must become an instance.
    pub fn preserves_uv(&self, t: &Transform) -> bool {
        let m = t.matrix().matrix3;
        let upright = t.is_axis_aligned() && m.x_axis.x > 0.0 && m.y_axis.y > 0.0 && m.z_axis.z > 0.0;
        let framed = |from: DVec3, to: DVec3| Frame::around(from).goes_to(t, &Frame::around(to));
        match self {
            Shape::Sphere(_) => upright && t.uniform_scale().is_some(),
            Shape::Box(_) => upright,
            Shape::Triangle(_) | Shape::Rectangle(_) => !solve::mirrors(t),
            Shape::Plane(s) => {
                let n = s.normal.as_dvec3();
                t.uniform_scale().is_some_and(|s| (s - 1.0).abs() < 1e-6) && framed(n, t.normal(n))
            }
            Shape::Disk(s) => framed(s.normal.as_dvec3(), t.normal(s.normal.as_dvec3())),
            Shape::Cylinder(Cylinder { base, top, .. }) | Shape::Cone(Cone { base, top, .. }) => {
                let axis = top.as_dvec3() - base.as_dvec3();
                framed(axis, t.vector(axis))
            }
            Shape::Partial(s) => framed(s.whole.axis(), t.vector(s.whole.axis())),
            Shape::Torus(s) => framed(s.axis.as_dvec3(), t.vector(s.axis.as_dvec3())),
        }
    }

    /// Checks every number's range.
    ///
    /// # Errors
    /// An [`OutOfRange`] that names the number, its value and the range.
    pub fn check(&self) -> Result<(), OutOfRange> {
        each!(self, s => s.check())?;
        match self.bounds() {
            Some(b) if !(b.min.is_finite() && b.max.is_finite()) => Err(OutOfRange::whole(format!(
                "the {} reaches beyond ±{:e}, the largest coordinate possible",
                self.kind(),
                f32::MAX
            ))),
            _ => Ok(()),
        }
    }

    /// The name of this kind of shape in scene text.
    pub fn kind(&self) -> &'static str {
        match self {
            Shape::Sphere(_) => "sphere",
            Shape::Box(_) => "box",
            Shape::Triangle(_) => "triangle",
            Shape::Plane(_) => "plane",
            Shape::Disk(_) => "disk",
            Shape::Cylinder(_) => "cylinder",
            Shape::Cone(_) => "cone",
            Shape::Torus(_) => "torus",
            Shape::Rectangle(_) => "rectangle",
            Shape::Partial(s) => s.kind(),
        }
    }

    /// Whether the surface consists of polygons.
    pub(crate) fn is_polygonal(&self) -> bool {
        matches!(self, Shape::Box(_) | Shape::Triangle(_) | Shape::Rectangle(_) | Shape::Plane(_))
    }

    /// Whether the shape bounds a volume, so that a ray can be inside.
    pub fn is_closed(&self) -> bool {
        match self {
            Shape::Sphere(_) | Shape::Box(_) | Shape::Torus(_) => true,
            Shape::Cylinder(Cylinder { caps, .. }) | Shape::Cone(Cone { caps, .. }) => *caps,
            Shape::Triangle(_) | Shape::Plane(_) | Shape::Disk(_) | Shape::Rectangle(_) | Shape::Partial(_) => false,
        }
    }
}
