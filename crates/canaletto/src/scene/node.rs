//! The tree of objects and lights.

use crate::light::Light;
use crate::math::Transform;
use crate::shape::Shape;
use serde::{Deserialize, Serialize};

/// One object, light or group, placed in the space of its parent.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Node {
    /// The name given in the file. [`crate::world::World`] names the rest by kind and number.
    pub name: Option<String>,
    /// Index into [`super::Scene::materials`]. `None` inherits the enclosing group's; at the root, the default
    /// material. On a mesh it replaces the mesh's own materials; an inherited one does not.
    pub material: Option<u32>,
    /// From this node's space to its parent's.
    pub transform: Transform,
    /// How it moves while the shutter is open: nothing if it stays, else at least two poses, evenly spaced in time from the
    /// opening to the closing. They come after `transform`; between them things move evenly and turn
    /// ([`crate::math::Path`]).
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub motion: Vec<Transform>,
    /// What it is.
    pub content: Content,
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
    Group(Vec<Node>),
    /// One more copy of the node at this index of [`super::Scene::prototypes`], that node's own transform included.
    Instance(u32),
}

impl Node {
    /// An unnamed node without material or transform.
    pub fn new(content: Content) -> Node {
        Node { name: None, material: None, transform: Transform::IDENTITY, motion: Vec::new(), content }
    }

    /// The same node with a name.
    pub fn named(mut self, name: impl Into<String>) -> Node {
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
        self.transform = transform.after(&self.transform);
        self
    }

    /// The same node, moving through these poses while the shutter is open.
    pub fn with_motion(mut self, poses: Vec<Transform>) -> Node {
        self.motion = poses;
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
