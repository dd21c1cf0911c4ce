//! The spaces that textures need of their objects. They decide which shapes may be transformed at build time, and which
//! must stay in their own space.

use crate::material::{Material, Projection, Space, Target};
use crate::math::Transform;
use crate::shape::Shape;

/// The spaces that a material's textures need.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(in crate::world) struct RequiredSpaces {
    /// The surface's own coordinates.
    uv: bool,
    /// The object's space, with its lengths.
    object: bool,
    /// The object's bounding box.
    bounds: bool,
}

impl RequiredSpaces {
    pub(in crate::world) fn of(material: &Material) -> RequiredSpaces {
        material.textures.iter().fold(RequiredSpaces::default(), |mut required_spaces, texture| {
            // Displacement happens in the object's own space, before the object is transformed.
            if matches!(texture.target, Target::Displace { .. }) {
                return required_spaces;
            }
            match (texture.mapping.projection, texture.mapping.space) {
                (Projection::Uv, _) => required_spaces.uv = true,
                (_, Space::Object) => required_spaces.object = true,
                (_, Space::Bounds) => required_spaces.bounds = true,
                (_, Space::World) => {}
            }
            // Heights of bumps are lengths in the object's space.
            required_spaces.object |= texture.target == Target::Bump;
            required_spaces
        })
    }

    pub(in crate::world) fn and(self, o: RequiredSpaces) -> RequiredSpaces {
        RequiredSpaces { uv: self.uv | o.uv, object: self.object | o.object, bounds: self.bounds | o.bounds }
    }

    /// Whether a shape may be transformed at build time.
    pub(in crate::world) fn allow(self, shape: &Shape, transform: &Transform) -> bool {
        if transform.is_identity() {
            return true;
        }
        let m = transform.matrix().matrix3;
        let upright = transform.is_axis_aligned() && m.x_axis.x > 0.0 && m.y_axis.y > 0.0 && m.z_axis.z > 0.0;
        !self.object && (!self.uv || shape.preserves_uv(transform)) && (!self.bounds || upright)
    }

    /// Whether a mesh may be transformed at build time. Its texture coordinates are stored at its vertices.
    pub(in crate::world) fn allow_mesh(self) -> bool {
        !self.object && !self.bounds
    }
}
