//! Lights on a disk, for soft shadows (fig. 5.24c): fixed points of the disk, or random ones.

use super::Light;
use crate::OutOfRange;
use crate::math::Transform;
use glam::Vec3;
use serde::{Deserialize, Serialize};

/// Points of light distributed evenly over a disk.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct DiskLight {
    /// The disk's centre.
    pub position: Vec3,
    /// The disk's axis; any length but zero. Light leaves in all directions.
    pub normal: Vec3,
    /// The disk's radius, > 0.
    pub radius: f32,
    /// The number of fixed points, at least 1. Each has 1/points of the intensity. Where [`Light::samples`] isn't 0,
    /// random points replace them.
    pub points: u32,
}

impl DiskLight {
    /// Point i of n by the sunflower spiral (Vogel 1979): its radius is R √((i + ½)/n), and each point is turned by the
    /// golden angle. Every point thus stands for an equal area.
    pub fn point(&self, index: u32) -> Vec3 {
        let golden_angle = std::f64::consts::PI * (3.0 - 5f64.sqrt());
        let r = f64::from(self.radius) * ((f64::from(index) + 0.5) / f64::from(self.points)).sqrt();
        let (sin, cos) = libm::sincos(f64::from(index) * golden_angle);
        let (x, y) = self.normal.normalize().any_orthonormal_pair();
        (self.position.as_dvec3() + x.as_dvec3() * (r * cos) + y.as_dvec3() * (r * sin)).as_vec3()
    }

    pub(super) fn transformed(&self, t: &Transform) -> DiskLight {
        let scale = libm::cbrt(t.matrix().matrix3.determinant().abs());
        DiskLight {
            position: t.point(self.position.as_dvec3()).as_vec3(),
            normal: t.normal(self.normal.as_dvec3()).as_vec3(),
            radius: (f64::from(self.radius) * scale) as f32,
            points: self.points,
        }
    }

    pub(super) fn check(&self) -> Result<(), OutOfRange> {
        if !self.position.is_finite() {
            return Err(OutOfRange::new("position", "holds a number that isn't finite"));
        }
        if self.normal.try_normalize().is_none() {
            return Err(OutOfRange::new("normal", "has no direction"));
        }
        if !self.radius.is_finite() || self.radius <= 0.0 {
            return Err(OutOfRange::new("radius", format!("is {}; it must be more than 0", self.radius)));
        }
        if !(1..=Light::MAX_POINTS).contains(&self.points) {
            return Err(OutOfRange::new(
                "points",
                format!("is {}; it must be between 1 and {}", self.points, Light::MAX_POINTS),
            ));
        }
        Ok(())
    }
}
