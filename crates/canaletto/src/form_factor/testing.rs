//! Scenes for tests.

use crate::scene::{Content, Node, Scene};
use crate::shape::Mesh;
use glam::Vec3;

/// A flat rectangle from a corner along two edges, whose front is on the side of u × v.
pub(super) fn rectangle(scene: &mut Scene, name: &str, corner: [f32; 3], u: [f32; 3], v: [f32; 3]) {
    let [corner, u, v] = [corner, u, v].map(Vec3::from);
    scene.meshes.push(Mesh {
        positions: vec![corner, corner + u, corner + u + v, corner + v],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    });
    scene.nodes.push(Node::new(Content::Mesh(scene.meshes.len() as u32 - 1)).named(name));
}
