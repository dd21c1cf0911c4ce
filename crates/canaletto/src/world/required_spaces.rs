//! What textures want to know of the objects that they are on: which shapes may be moved into place at build time, and
//! which must stay where their coordinates are.

use crate::material::{Material, Projection, Space, Target};
use crate::math::Transform;
use crate::shape::Shape;

/// What a material's textures hold on to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct RequiredSpaces {
    /// The surface's own coordinates.
    uv: bool,
    /// The object's space, with its lengths.
    object: bool,
    /// The object's bounding box.
    bounds: bool,
}

impl RequiredSpaces {
    pub(super) fn of(material: &Material) -> RequiredSpaces {
        material.textures.iter().fold(RequiredSpaces::default(), |mut required_spaces, texture| {
            // What is raised was so in the object's own space, before it is moved.
            if matches!(texture.target, Target::Displace { .. }) {
                return required_spaces;
            }
            match (texture.mapping.projection, texture.mapping.space) {
                (Projection::Uv, _) => required_spaces.uv = true,
                (_, Space::Object) => required_spaces.object = true,
                (_, Space::Bounds) => required_spaces.bounds = true,
                (_, Space::World) => {}
            }
            // Heights are lengths of the object's space.
            required_spaces.object |= texture.target == Target::Bump;
            required_spaces
        })
    }

    pub(super) fn and(self, o: RequiredSpaces) -> RequiredSpaces {
        RequiredSpaces { uv: self.uv | o.uv, object: self.object | o.object, bounds: self.bounds | o.bounds }
    }

    /// Whether a shape that is moved into place keeps it.
    pub(super) fn allow(self, shape: &Shape, transform: &Transform) -> bool {
        if transform.is_identity() {
            return true;
        }
        let m = transform.matrix().matrix3;
        let upright = transform.is_axis_aligned() && m.x_axis.x > 0.0 && m.y_axis.y > 0.0 && m.z_axis.z > 0.0;
        !self.object && (!self.uv || shape.keeps_uv(transform)) && (!self.bounds || upright)
    }

    /// Whether a mesh that is moved into place keeps it; its coordinates stand at its vertices.
    pub(super) fn allow_mesh(self) -> bool {
        !self.object && !self.bounds
    }
}
