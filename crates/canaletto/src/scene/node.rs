//! The tree of objects and lights.

use super::{Sparse, depth};
use crate::light::Light;
use crate::math::Transform;
use crate::shape::Shape;
use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

/// One object, light or group, placed in the space of its parent. Groups may be nested deeper than stacks have room for, but are written, read
/// and rendered only down to [`Node::MAX_NESTING`].
#[derive(Serialize, Deserialize)]
pub struct Node {
    /// The name given in the file. [`crate::world::World`] names the rest by kind and number.
    pub name: Option<Box<str>>,
    /// Index into [`super::Scene::materials`]. `None` inherits the enclosing group's; at the root, the default
    /// material. On a mesh it replaces the mesh's own materials; an inherited one does not.
    pub material: Option<u32>,
    /// From this node's space to its parent's.
    pub transform: Sparse<Transform>,
    /// How it moves while the shutter is open: nothing if it stays, else at least two poses, evenly spaced in time from the
    /// opening to the closing. They come after `transform`; between them things move evenly and turn
    /// ([`crate::math::AnimatedTransform`]).
    #[serde(default, skip_serializing_if = "Sparse::is_usual")]
    pub motion: Sparse<Vec<Transform>>,
    /// What it is.
    pub content: Content,
    /// What `f32` can't hold of the points of a shape or light, which are those of its fields in their order that transforms
    /// move. It counts where they lie far from zero.
    #[serde(default, skip_serializing_if = "Sparse::is_usual")]
    pub rest: Sparse<[Vec3; 3]>,
}

/// What a [`Node`] holds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Content {
    /// A single exact shape.
    Shape(Shape),
    /// Index into [`super::Scene::meshes`].
    Mesh(u32),
    /// Index into [`super::Scene::spheres`].
    Spheres(u32),
    /// Index into [`super::Scene::cylinders`].
    Cylinders(u32),
    /// A light; the node's transform moves it.
    Light(Light),
    /// Several nodes that move together.
    Group(#[serde(serialize_with = "depth::write", deserialize_with = "depth::read")] Vec<Node>),
    /// One more copy of the node at this index of [`super::Scene::prototypes`], that node's own transform included.
    Instance(u32),
}

impl Node {
    /// The deepest nesting of groups, and of instances in a world, that anything is made of.
    pub const MAX_NESTING: usize = 256;

    /// An unnamed node without material or transform.
    pub fn new(content: Content) -> Node {
        Node {
            name: None,
            material: None,
            transform: Sparse::default(),
            motion: Sparse::default(),
            content,
            rest: Sparse::default(),
        }
    }

    /// The same node with the points of its shape or light as exact as these are: those of the fields that transforms move,
    /// in their order.
    pub fn with_points(mut self, exact: &[DVec3]) -> Node {
        let mut rest = [Vec3::ZERO; 3];
        let left = |i: usize, rounded: Vec3| exact.get(i).map_or(Vec3::ZERO, |p| (*p - rounded.as_dvec3()).as_vec3());
        match &self.content {
            Content::Shape(shape) => {
                shape.with_points(|i, p| {
                    rest[i] = left(i, p);
                    p
                });
            }
            Content::Light(light) => {
                light.with_points(|i, p| {
                    rest[i] = left(i, p);
                    p
                });
            }
            _ => {}
        }
        self.rest = rest.into();
        self
    }

    /// Its shape, if it is one, counted from the first of its points, so that little of its form is lost to rounding.
    pub fn shape_at_its_first_point(&self) -> Option<Shape> {
        match &self.content {
            Content::Shape(shape) => Some(shape.at_its_first_point(&self.rest).0),
            _ => None,
        }
    }

    /// The same node with a name.
    pub fn named(mut self, name: impl Into<Box<str>>) -> Node {
        self.name = Some(name.into());
        self
    }

    /// The same node with the material of this index.
    pub fn with_material(mut self, material: u32) -> Node {
        self.material = Some(material);
        self
    }

    /// The same node, moved by `transform` after its own.
    pub fn with_transform(mut self, transform: &Transform) -> Node {
        self.transform = transform.after(&self.transform).into();
        self
    }

    /// The same node, moving through these poses while the shutter is open.
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

    /// What a scene text of a million lights takes follows from these.
    #[test]
    fn a_million_nodes_are_small() {
        let sizes = [size_of::<Node>(), size_of::<Light>(), size_of::<PreparedLight>()];
        assert!(sizes[0] <= 136 && sizes[1] <= 88 && sizes[2] <= 192, "{sizes:?}");
    }
}
