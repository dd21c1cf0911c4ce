//! The triangles of mesh lights. They are copied for the lights before the meshes become geometries.

use crate::light::{Light, LightKind, PreparedLight};
use crate::scene::{Content, Node};
use crate::shape::Mesh;
use crate::world::{BuildError, World};
use glam::DVec3;
use std::collections::HashMap;

/// The triangles of mesh lights, each in its mesh's own space.
#[derive(Debug, Default)]
pub(in crate::world) struct LightMeshes {
    by_mesh: HashMap<u32, Vec<[DVec3; 3]>>,
}

impl LightMeshes {
    /// The triangles of all lights in these nodes.
    pub(in crate::world) fn collect<'n>(
        nodes: impl Iterator<Item = &'n Node>,
        meshes: &[Mesh],
    ) -> Result<LightMeshes, BuildError> {
        let mut found = LightMeshes::default();
        for node in nodes {
            found.add(node, meshes, 0)?;
        }
        Ok(found)
    }

    fn add(&mut self, node: &Node, meshes: &[Mesh], depth: usize) -> Result<(), BuildError> {
        match &node.content {
            Content::Group(children) if depth < World::MAX_NESTING => {
                children.iter().try_for_each(|child| self.add(child, meshes, depth + 1))
            }
            Content::Light(Light { kind: LightKind::Mesh(light), name, .. }) => {
                let name = node.name.as_ref().or(name.as_ref());
                let object = || name.map_or_else(|| "mesh light".into(), |name| format!("light \"{name}\""));
                let mut area = 0.0;
                for &index in &light.meshes {
                    let mesh = meshes.get(index as usize).ok_or_else(|| BuildError::Missing {
                        object: object(),
                        what: "mesh",
                        index,
                        count: meshes.len(),
                    })?;
                    mesh.check()
                        .map_err(|problem| BuildError::Invalid { object: object(), problem: problem.to_string() })?;
                    let corners = |i| mesh.corners(i).map(|p| mesh.origin + p.as_dvec3());
                    let triangles = self.by_mesh.entry(index).or_insert_with(|| (0..mesh.len()).map(corners).collect());
                    let edges = |[a, b, c]: [DVec3; 3]| (b - a).cross(c - a);
                    area += triangles.iter().map(|corners| edges(*corners).length()).sum::<f64>();
                }
                if area > 0.0 || light.meshes.is_empty() {
                    return Ok(());
                }
                Err(BuildError::Invalid {
                    object: object(),
                    problem: "its meshes have no area that could shine".into(),
                })
            }
            _ => Ok(()),
        }
    }

    /// The number of a light's triangles.
    pub(in crate::world) fn count(&self, light: &Light) -> usize {
        let LightKind::Mesh(mesh) = &light.kind else { return 0 };
        mesh.meshes.iter().filter_map(|index| self.by_mesh.get(index)).map(Vec::len).sum()
    }

    /// The prepared form of a light in its place.
    pub(in crate::world) fn source(&self, light: Light) -> PreparedLight {
        let LightKind::Mesh(mesh) = &light.kind else { return PreparedLight::new(light) };
        let triangles: Vec<[DVec3; 3]> =
            mesh.meshes.iter().filter_map(|index| self.by_mesh.get(index)).flatten().copied().collect();
        PreparedLight::of_triangles(light, &triangles)
    }
}
