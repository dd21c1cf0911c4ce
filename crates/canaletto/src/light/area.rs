//! Surfaces of lights, of which random points are taken (5.6): soft shadows without the steps that fixed points make.

use super::LightKind;
use crate::math::warp;
use glam::{DVec3, Vec3};

/// A light's surface.
#[derive(Clone, Debug)]
pub(super) enum Area {
    /// A disk: its centre and two perpendicular radii.
    Disk(DVec3, [DVec3; 2]),
}

impl Area {
    /// The surface of a light, if it has one.
    pub(super) fn of(kind: &LightKind) -> Option<Area> {
        match kind {
            LightKind::Disk(disk) => {
                let (x, y) = disk.normal.normalize().any_orthonormal_pair();
                let radius = f64::from(disk.radius);
                Some(Area::Disk(disk.position.as_dvec3(), [x.as_dvec3() * radius, y.as_dvec3() * radius]))
            }
            _ => None,
        }
    }

    /// The point at `u` of the unit square; equal parts of the square are equal areas.
    pub(super) fn point(&self, u: [f64; 2]) -> Vec3 {
        match self {
            Area::Disk(center, [x, y]) => {
                let p = warp::disk(u);
                (*center + *x * p.x + *y * p.y).as_vec3()
            }
        }
    }
}
