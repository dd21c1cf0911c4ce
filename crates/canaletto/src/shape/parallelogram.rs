//! Parallelograms, the surfaces of rectangular lights.

use crate::math::Transform;
use glam::Vec3;
use serde::{Deserialize, Serialize};

/// A flat surface between two edges.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Parallelogram {
    /// A corner of the parallelogram.
    pub corner: Vec3,
    /// An edge from the corner.
    pub u: Vec3,
    /// The other edge from the corner, not along `u`. u × v is on the outer (visible) side.
    pub v: Vec3,
}

impl Parallelogram {
    /// The parallelogram moved by a transform.
    pub fn transformed(&self, t: &Transform) -> Parallelogram {
        let edge = |v: Vec3| t.vector(v.as_dvec3()).as_vec3();
        let corner = t.point(self.corner.as_dvec3()).as_vec3();
        let (u, v) = (edge(self.u), edge(self.v));
        // A mirroring transform turns u × v to the other side of the surface; swapped edges turn it back.
        let (u, v) = if t.matrix().matrix3.determinant() < 0.0 { (v, u) } else { (u, v) };
        Parallelogram { corner, u, v }
    }
}
