//! A walk over all surfaces of a scene, each with its material.

use canaletto::scene::{Content, Node, Scene};
use std::collections::HashSet;

/// Calls `f` with the content of each node that has a surface, and with each of its materials. An instance counts once
/// for each material around it.
pub(super) fn each_surface<'a>(scene: &'a Scene, f: &mut dyn FnMut(&'a Content, Option<u32>)) {
    Walk { scene, visited: HashSet::new(), f }.nodes(&scene.nodes, None, 0);
}

/// A walk over all surfaces.
struct Walk<'a, 'f> {
    scene: &'a Scene,
    /// The prototypes that were visited, with the material around them.
    visited: HashSet<(u32, Option<u32>)>,
    f: &'f mut dyn FnMut(&'a Content, Option<u32>),
}

impl<'a> Walk<'a, '_> {
    fn nodes(&mut self, nodes: &'a [Node], inherited: Option<u32>, depth: usize) {
        // Deeper scenes are rejected when the world is built.
        if depth > Node::MAX_NESTING {
            return;
        }
        for node in nodes {
            let material = node.material.or(inherited);
            match &node.content {
                Content::Light(_) => {}
                Content::Group(children) => self.nodes(children, material, depth + 1),
                Content::Instance(index) => {
                    if self.visited.insert((*index, material))
                        && let Some(prototype) = self.scene.prototypes.get(*index as usize)
                    {
                        self.nodes(std::slice::from_ref(prototype), material, depth + 1);
                    }
                }
                Content::Mesh(index) if node.material.is_none() => {
                    let own = self.scene.meshes.get(*index as usize).map_or(&[][..], |mesh| &mesh.materials);
                    own.iter().for_each(|material| (self.f)(&node.content, Some(*material)));
                    if own.is_empty() {
                        (self.f)(&node.content, material);
                    }
                }
                Content::Shape(_) | Content::Mesh(_) | Content::Spheres(_) | Content::Cylinders(_) => {
                    (self.f)(&node.content, material);
                }
            }
        }
    }
}
