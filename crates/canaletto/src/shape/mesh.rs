//! Triangle meshes with shared vertices.

use crate::math::Rgb;
use glam::{Vec2, Vec3};
use serde::{Deserialize, Serialize};

/// A triangle mesh as an importer delivers it. Counter-clockwise corners face outwards (5.23).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Mesh {
    /// The file or object it came from, for messages.
    pub name: String,
    /// Vertex positions.
    pub positions: Vec<Vec3>,
    /// A normal for each position, or nothing (flat shading). Any length but zero.
    pub normals: Vec<Vec3>,
    /// Texture coordinates for each position, or nothing.
    pub uvs: Vec<Vec2>,
    /// A colour for each position that replaces kd, or nothing.
    pub colors: Vec<Rgb>,
    /// Three positions for each triangle.
    pub triangles: Vec<[u32; 3]>,
    /// For each triangle its slot in `materials`, or nothing: all use slot 0.
    pub slots: Vec<u32>,
    /// Indices into [`crate::scene::Scene::materials`]; empty: the node's or inherited material.
    pub materials: Vec<u32>,
    /// Whether rays from behind pass through.
    pub one_sided: bool,
}
