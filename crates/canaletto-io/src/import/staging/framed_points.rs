//! The points of a model that must be in the picture: its vertices where their nodes put them.

use canaletto::scene::{Content, Node, Scene};
use canaletto::shape::Mesh;
use glam::{DAffine3, DVec3};

/// The most corners of triangles that are looked at one by one. Of more, the boxes around the meshes are framed.
const MOST: usize = 1 << 24;

/// The meshes of a scene in their places.
pub(super) struct FramedMeshes<'a> {
    scene: &'a Scene,
    placed: Vec<(DAffine3, &'a Mesh)>,
}

impl<'a> FramedMeshes<'a> {
    pub(super) fn new(scene: &'a Scene) -> FramedMeshes<'a> {
        FramedMeshes { scene, placed: Vec::new() }
    }

    /// Adds the meshes of a node. Returns whether the node has nothing else, in groups and instances.
    pub(super) fn add(&mut self, node: &'a Node) -> bool {
        let before = self.placed.len();
        let is_all = self.add_within(node, &DAffine3::IDENTITY, 0);
        if !is_all {
            self.placed.truncate(before);
        }
        is_all
    }

    fn add_within(&mut self, node: &'a Node, around: &DAffine3, depth: usize) -> bool {
        if depth > Node::MAX_NESTING {
            return false;
        }
        let place = *around * *node.transform.matrix();
        let scene = self.scene;
        match &node.content {
            Content::Light(_) => true,
            Content::Group(children) => children.iter().all(|child| self.add_within(child, &place, depth + 1)),
            Content::Instance(index) => {
                let prototype = scene.prototypes.get(*index as usize);
                prototype.is_some_and(|prototype| self.add_within(prototype, &place, depth + 1))
            }
            Content::Mesh(index) => {
                let mesh = scene.meshes.get(*index as usize);
                self.placed.extend(mesh.map(|mesh| (place, mesh)));
                mesh.is_some()
            }
            Content::Spheres(_) | Content::Cylinders(_) | Content::Shape(_) => false,
        }
    }

    /// Whether the meshes have so few corners that each is framed.
    pub(super) fn are_few(&self) -> bool {
        self.placed.iter().map(|(_, mesh)| 3 * mesh.len()).sum::<usize>() <= MOST
    }

    /// The corners of all triangles in their places.
    pub(super) fn corners(&self) -> impl Iterator<Item = DVec3> + Clone {
        self.placed.iter().flat_map(|(place, mesh)| {
            let corner = |i: &u32| place.transform_point3(mesh.positions[*i as usize].as_dvec3() + mesh.origin);
            mesh.triangles.iter().flatten().map(corner)
        })
    }
}
