//! The tree of objects and lights.

use super::{Sparse, depth};
use crate::light::Light;
use crate::math::Transform;
use crate::shape::Shape;
use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

/// One object, light or group, placed in the space of its parent. Groups may be nested deeper than a stack has room
/// for. They are written, read and rendered only down to [`Node::MAX_NESTING`].
#[derive(Serialize, Deserialize)]
pub struct Node {
    /// The name given in the file. [`crate::world::World`] names unnamed nodes by kind and number.
    pub name: Option<Box<str>>,
    /// The index into [`super::Scene::materials`]. `None` inherits the material of the enclosing group; at the root, it
    /// is the default material. An index on a mesh replaces the mesh's own materials; an inherited material does not.
    pub material: Option<u32>,
    /// Whether shadow rays meet the node. Without shadows it still shows to the camera, in mirrors and through glass.
    /// Nothing inside a group or a prototype without shadows casts any.
    #[serde(default = "casts", skip_serializing_if = "is_true")]
    pub casts_shadow: bool,
    /// The transform from this node's space to its parent's.
    pub transform: Sparse<Transform>,
    /// The poses while the shutter is open: none for a node at rest, else at least two. They are evenly spaced in time
    /// from the opening to the closing, and are applied after `transform`. Between two poses the node translates and
    /// turns evenly ([`crate::math::AnimatedTransform`]).
    #[serde(default, skip_serializing_if = "Sparse::is_usual")]
    pub motion: Sparse<Vec<Transform>>,
    /// The object, light or group itself.
    pub content: Content,
    /// The part of the points of a shape or light that `f32` can't hold. The points are the fields that transforms
    /// move, in the order of their declaration. The remainder matters for points far from zero.
    #[serde(default, skip_serializing_if = "Sparse::is_usual")]
    pub rest: Sparse<[Vec3; 3]>,
}

fn casts() -> bool {
    true
}

fn is_true(casts_shadow: &bool) -> bool {
    *casts_shadow
}

/// The content of a [`Node`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Content {
    /// One analytic shape.
    Shape(Shape),
    /// An index into [`super::Scene::meshes`].
    Mesh(u32),
    /// An index into [`super::Scene::spheres`].
    Spheres(u32),
    /// An index into [`super::Scene::cylinders`].
    Cylinders(u32),
    /// A light. The node's transform moves it.
    Light(Light),
    /// Several nodes that move together.
    Group(#[serde(serialize_with = "depth::write", deserialize_with = "depth::read")] Vec<Node>),
    /// A copy of the node at this index of [`super::Scene::prototypes`], with that node's own transform.
    Instance(u32),
}

impl Node {
    /// The deepest nesting of groups, and of instances in a world, that is written, read or built.
    pub const MAX_NESTING: usize = 256;

    /// An unnamed node without material or transform.
    pub fn new(content: Content) -> Node {
        Node {
            name: None,
            material: None,
            casts_shadow: true,
            transform: Sparse::default(),
            motion: Sparse::default(),
            content,
            rest: Sparse::default(),
        }
    }

    /// Returns the node with the points of its shape or light at this precision. The points are the fields that
    /// transforms move, in the order of their declaration.
    pub fn with_points(mut self, exact: &[DVec3]) -> Node {
        let mut rest = [Vec3::ZERO; 3];
        let left = |i: usize, rounded: Vec3| exact.get(i).map_or(Vec3::ZERO, |p| (*p - rounded.as_dvec3()).as_vec3());
        match &self.content {
            Content::Shape(shape) => {
                shape.map_points(|i, p| {
                    rest[i] = left(i, p);
                    p
                });
            }
            Content::Light(light) => {
                light.map_points(|i, p| {
                    rest[i] = left(i, p);
                    p
                });
            }
            _ => {}
        }
        self.rest = rest.into();
        self
    }

    /// The node's shape, if it has one, in coordinates relative to the first of its points. These coordinates lose
    /// little to rounding.
    pub fn shape_relative_to_first_point(&self) -> Option<Shape> {
        match &self.content {
            Content::Shape(shape) => Some(shape.relative_to_first_point(&self.rest).0),
            _ => None,
        }
    }

    /// Returns the node with this name.
    pub fn named(mut self, name: impl Into<Box<str>>) -> Node {
        self.name = Some(name.into());
        self
    }

    /// Returns the node with the material of this index.
    pub fn with_material(mut self, material: u32) -> Node {
        self.material = Some(material);
        self
    }

    /// Returns the node with shadows, or without.
    pub fn with_shadow(mut self, casts_shadow: bool) -> Node {
        self.casts_shadow = casts_shadow;
        self
    }

    /// Returns the node moved by `transform`, which is applied after the node's own transform.
    pub fn with_transform(mut self, transform: &Transform) -> Node {
        self.transform = transform.after(&self.transform).into();
        self
    }

    /// Returns the node with these poses while the shutter is open.
    pub fn with_motion(mut self, poses: Vec<Transform>) -> Node {
        self.motion = poses.into();
        self
    }
}

impl From<Shape> for Node {
    fn from(shape: Shape) -> Node {
        Node::new(Content::Shape(shape))
    }
}

impl From<Light> for Node {
    fn from(light: Light) -> Node {
        Node::new(Content::Light(light))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::PreparedLight;

    /// The memory of a scene text with a million lights follows from these sizes.
    #[test]
    fn a_million_nodes_are_small() {
        let sizes = [size_of::<Node>(), size_of::<Light>(), size_of::<PreparedLight>()];
        assert!(sizes[0] <= 152 && sizes[1] <= 96 && sizes[2] <= 208, "{sizes:?}");
    }
}
