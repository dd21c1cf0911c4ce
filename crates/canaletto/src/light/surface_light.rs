//! Lights with surfaces besides the disk: parallelograms, spheres and meshes, for soft shadows.

use super::{Light, LightKind};
use crate::math::Transform;
use crate::shape::{Parallelogram, Shape, Sphere, SurfaceSampler};
use crate::{OutOfRange, named};
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// A light on a rectangle, or on any parallelogram.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RectangleLight {
    /// The parallelogram. A matte emission leaves it on the side of u × v.
    #[serde(flatten)]
    pub parallelogram: Parallelogram,
    /// The number of fixed points, at least 1.
    pub points: u32,
}

/// A light on a sphere.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SphereLight {
    /// The sphere. A transform that stretches it makes it a sphere of the stretched volume.
    #[serde(flatten)]
    pub sphere: Sphere,
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
        RectangleLight { parallelogram: self.parallelogram.transformed(t), ..*self }
    }

    pub(super) fn check(&self) -> Result<(), OutOfRange> {
        self.parallelogram.check()?;
        check_points(self.points)
    }
}

impl SphereLight {
    pub(super) fn transformed(&self, t: &Transform) -> SphereLight {
        let scale = libm::cbrt(t.matrix().matrix3.determinant().abs());
        let sphere = Sphere {
            center: t.point(self.sphere.center.as_dvec3()).as_vec3(),
            radius: (f64::from(self.sphere.radius) * scale) as f32,
        };
        SphereLight { sphere, ..*self }
    }

    pub(super) fn check(&self) -> Result<(), OutOfRange> {
        let Sphere { center, radius } = self.sphere;
        if !center.is_finite() {
            return Err(OutOfRange::new("center", "holds a number that isn't finite"));
        }
        if !radius.is_finite() || radius <= 0.0 {
            return Err(OutOfRange::new("radius", format!("is {radius}; it must be more than 0")));
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

/// Checks the number of fixed points.
pub(super) fn check_points(points: u32) -> Result<(), OutOfRange> {
    if (1..=Light::MAX_POINTS).contains(&points) {
        Ok(())
    } else {
        Err(OutOfRange::new("points", format!("is {points}; it must be between 1 and {}", Light::MAX_POINTS)))
    }
}

/// The surface of a light whose numbers are in range. The `triangles` of a mesh light are in their own space. None for
/// a light without a surface or of triangles without area.
pub(super) fn surface(kind: &LightKind, triangles: &[[DVec3; 3]]) -> Option<SurfaceSampler> {
    match kind {
        LightKind::Disk(light) => Shape::Disk(light.disk).sampler(),
        LightKind::Rectangle(light) => Some(light.parallelogram.sampler()),
        LightKind::Sphere(light) => Shape::Sphere(light.sphere).sampler(),
        LightKind::Mesh(mesh) => {
            let mirrored = mesh.transform.matrix().matrix3.determinant() < 0.0;
            let moved = triangles.iter().map(|corners| {
                let [a, b, c] = corners.map(|p| mesh.transform.point(p).as_vec3());
                if mirrored { [a, c, b] } else { [a, b, c] }
            });
            let sampler = SurfaceSampler::triangles(moved.collect());
            (sampler.area() > 0.0 && sampler.area().is_finite()).then_some(sampler)
        }
        LightKind::Omni(_) | LightKind::Directional(_) | LightKind::Spot(_) => None,
    }
}
