//! The shapes that rays meet (5.3), and the surface at a hit.
//!
//! Hits come in two stages: [`Shape::intersect`] finds the nearest t and which part was met; [`Shape::surface`]
//! evaluates point, normal and uv once, for the nearest hit only.

mod cloud;
mod cone;
mod cuboid;
mod cylinder;
mod disk;
mod mesh;
mod plane;
mod sphere;
mod surface;
mod torus;
mod triangle;

pub use cloud::{CylinderCloud, SphereCloud};
pub use cone::Cone;
pub use cuboid::Cuboid;
pub use cylinder::Cylinder;
pub use disk::Disk;
pub use mesh::Mesh;
pub use plane::Plane;
pub use sphere::Sphere;
pub use surface::Surface;
pub use torus::Torus;
pub use triangle::Triangle;

use crate::math::Transform;
use canaletto_bvh::{Aabb, Ray};
use serde::{Deserialize, Serialize};

/// What the first stage of a hit finds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShapeHit {
    /// The ray's parameter, 0 < t ≤ t_max.
    pub t: f32,
    /// Which part of the shape was met: a box's face, a cylinder's side or cap.
    pub part: u32,
    /// Barycentric coordinates where the shape has them, else zero.
    pub uv: [f32; 2],
}

/// A single exact shape.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
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
}
