//! Lights on a disk, for soft shadows (fig. 5.24c): fixed points of the disk, or random ones.

use super::surface_light::check_points;
use crate::OutOfRange;
use crate::math::Transform;
use crate::shape::Disk;
use glam::Vec3;
use serde::{Deserialize, Serialize};

/// Points of light distributed evenly over a disk.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct DiskLight {
    /// The disk. An even emission leaves it in all directions, a matte one on the side of its normal.
    #[serde(flatten, with = "SerialDisk")]
    pub disk: Disk,
    /// The number of fixed points, at least 1. Each has 1/points of the intensity. Where
    /// [`Light::samples`](super::Light::samples) isn't 0, random points replace them.
    pub points: u32,
}

/// A light's disk in a serialised scene, where its centre is the light's position.
#[derive(Serialize, Deserialize)]
#[serde(remote = "Disk")]
struct SerialDisk {
    #[serde(rename = "position")]
    center: Vec3,
    normal: Vec3,
    radius: f32,
}

impl DiskLight {
    /// Point i of n by the sunflower spiral (Vogel 1979): its radius is R √((i + ½)/n), and each point is turned by the
    /// golden angle. Every point thus stands for an equal area.
    pub fn point(&self, index: u32) -> Vec3 {
        let golden_angle = std::f64::consts::PI * (3.0 - 5f64.sqrt());
        let Disk { center, normal, radius } = self.disk;
        let r = f64::from(radius) * ((f64::from(index) + 0.5) / f64::from(self.points)).sqrt();
        let (sin, cos) = libm::sincos(f64::from(index) * golden_angle);
        let (x, y) = normal.normalize().any_orthonormal_pair();
        (center.as_dvec3() + x.as_dvec3() * (r * cos) + y.as_dvec3() * (r * sin)).as_vec3()
    }

    pub(super) fn transformed(&self, t: &Transform) -> DiskLight {
        let scale = libm::cbrt(t.matrix().matrix3.determinant().abs());
        let disk = Disk {
            center: t.point(self.disk.center.as_dvec3()).as_vec3(),
            normal: t.normal(self.disk.normal.as_dvec3()).as_vec3(),
            radius: (f64::from(self.disk.radius) * scale) as f32,
        };
        DiskLight { disk, points: self.points }
    }

    pub(super) fn check(&self) -> Result<(), OutOfRange> {
        let Disk { center, normal, radius } = self.disk;
        if !center.is_finite() {
            return Err(OutOfRange::new("position", "holds a number that isn't finite"));
        }
        if normal.try_normalize().is_none() {
            return Err(OutOfRange::new("normal", "has no direction"));
        }
        if !radius.is_finite() || radius <= 0.0 {
            return Err(OutOfRange::new("radius", format!("is {radius}; it must be more than 0")));
        }
        check_points(self.points)
    }
}
