//! Lights with surfaces besides the disk: parallelograms, spheres and meshes, for soft shadows.

use super::area::{Area, Triangles};
use super::{Light, LightKind};
use crate::math::Transform;
use crate::{OutOfRange, named};
use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

/// A light on a rectangle, or on any parallelogram.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RectangleLight {
    /// A corner of the parallelogram.
    pub corner: Vec3,
    /// An edge from the corner.
    pub u: Vec3,
    /// The other edge from the corner, not along `u`. With one-sided emission, u × v is on the emitting side.
    pub v: Vec3,
    /// The number of fixed points, at least 1.
    pub points: u32,
}

/// A light on a sphere.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SphereLight {
    /// The sphere's centre.
    pub center: Vec3,
    /// The sphere's radius, > 0. A transform that stretches the sphere makes it a sphere of the stretched volume.
    pub radius: f32,
    /// The number of fixed points, at least 1.
    pub points: u32,
}

/// A light on the triangles of meshes. The light itself is invisible; a mesh node at its place shows it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MeshLight {
    /// The indices into [`crate::scene::Scene::meshes`]. All these meshes together are the surface.
    pub meshes: Vec<u32>,
    /// The transform from the meshes' space to the light's.
    pub transform: Transform,
    /// The number of fixed points, at least 1.
    pub points: u32,
}

/// The emission of a surface's points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Emission {
    /// Each point is a point light with its share of the intensity. It emits evenly in all directions, without loss
    /// over distance.
    #[default]
    Even,
    /// The points emit as a matte surface: by the cosine, by the inverse square of the distance, and on one side. The
    /// intensity is the radiance, equal to that of a white surface lit by a light of this intensity.
    Matte,
}

named!(Emission {
    Even => "even",
    Matte => "matte",
});

impl RectangleLight {
    pub(super) fn transformed(&self, t: &Transform) -> RectangleLight {
        let edge = |v: Vec3| t.vector(v.as_dvec3()).as_vec3();
        let corner = t.point(self.corner.as_dvec3()).as_vec3();
        let (u, v) = (edge(self.u), edge(self.v));
        // A mirroring transform turns u × v to the other side of the surface; swapped edges turn it back.
        let (u, v) = if t.matrix().matrix3.determinant() < 0.0 { (v, u) } else { (u, v) };
        RectangleLight { corner, u, v, points: self.points }
    }

    pub(super) fn check(&self) -> Result<(), OutOfRange> {
        let RectangleLight { corner, u, v, points } = self;
        if let Some((field, _)) = [("corner", corner), ("u", u), ("v", v)].into_iter().find(|(_, v)| !v.is_finite()) {
            return Err(OutOfRange::new(field, "holds a number that isn't finite"));
        }
        if u.as_dvec3().cross(v.as_dvec3()).try_normalize().is_none() {
            return Err(OutOfRange::new("u", "and v must be two edges of a rectangle, of different directions"));
        }
        check_points(*points)
    }
}

impl SphereLight {
    pub(super) fn transformed(&self, t: &Transform) -> SphereLight {
        let scale = libm::cbrt(t.matrix().matrix3.determinant().abs());
        SphereLight {
            center: t.point(self.center.as_dvec3()).as_vec3(),
            radius: (f64::from(self.radius) * scale) as f32,
            points: self.points,
        }
    }

    pub(super) fn check(&self) -> Result<(), OutOfRange> {
        if !self.center.is_finite() {
            return Err(OutOfRange::new("center", "holds a number that isn't finite"));
        }
        if !self.radius.is_finite() || self.radius <= 0.0 {
            return Err(OutOfRange::new("radius", format!("is {}; it must be more than 0", self.radius)));
        }
        check_points(self.points)
    }
}

impl MeshLight {
    pub(super) fn transformed(&self, t: &Transform) -> MeshLight {
        MeshLight { transform: t.after(&self.transform), ..self.clone() }
    }

    pub(super) fn check(&self) -> Result<(), OutOfRange> {
        if self.meshes.is_empty() {
            return Err(OutOfRange::new("file", "holds no mesh to shine"));
        }
        check_points(self.points)
    }
}

fn check_points(points: u32) -> Result<(), OutOfRange> {
    if (1..=Light::MAX_POINTS).contains(&points) {
        Ok(())
    } else {
        Err(OutOfRange::new("points", format!("is {points}; it must be between 1 and {}", Light::MAX_POINTS)))
    }
}

/// The surface of a light whose numbers are in range. The `triangles` of a mesh light are in their own space. None for
/// a light without a surface or of triangles without area.
pub(super) fn area(kind: &LightKind, triangles: &[[DVec3; 3]]) -> Option<Area> {
    match kind {
        LightKind::Disk(disk) => {
            let normal = disk.normal.normalize();
            let (x, y) = normal.any_orthonormal_pair();
            let radius = f64::from(disk.radius);
            let radii = [x.as_dvec3() * radius, y.as_dvec3() * radius];
            Some(Area::Disk(disk.position.as_dvec3(), radii, normal.as_dvec3()))
        }
        LightKind::Rectangle(rectangle) => {
            let [corner, u, v] = [rectangle.corner, rectangle.u, rectangle.v].map(|v| v.as_dvec3());
            Some(Area::Rectangle(corner, [u, v], u.cross(v).normalize()))
        }
        LightKind::Sphere(sphere) => Some(Area::Sphere(sphere.center.as_dvec3(), f64::from(sphere.radius))),
        LightKind::Mesh(mesh) => {
            let mirrored = mesh.transform.matrix().matrix3.determinant() < 0.0;
            let moved = triangles.iter().map(|corners| {
                let [a, b, c] = corners.map(|p| mesh.transform.point(p).as_vec3());
                if mirrored { [a, c, b] } else { [a, b, c] }
            });
            Triangles::new(moved.collect()).map(Area::Triangles)
        }
        LightKind::Omni(_) | LightKind::Directional(_) | LightKind::Spot(_) => None,
    }
}
