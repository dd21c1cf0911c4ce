//! Doubts about the meshes of a scene: faces that turn inwards, and faces that lie on each other.

use crate::material::{Material, Target};
use crate::scene::{Content, Node, Scene};
use crate::shape::Mesh;
use crate::world::signed_volume;
use std::collections::{BTreeSet, HashMap};

/// A doubt about a mesh.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum MeshFinding {
    /// The mesh is closed, its faces turn inwards, and its material looks different from both sides.
    InsideOut {
        /// The mesh's name.
        mesh: String,
    },
    /// Faces have the same corners as others, so that one of them is never seen.
    Doubled {
        /// The mesh's name.
        mesh: String,
        /// The number of faces that lie on earlier ones.
        faces: usize,
    },
}

/// The doubts about all meshes of a scene.
pub fn doubt_meshes(scene: &Scene) -> Vec<MeshFinding> {
    let mut findings = Vec::new();
    let materials = materials_of_meshes(scene);
    for (index, mesh) in scene.meshes.iter().enumerate() {
        let name = || mesh.name.clone();
        let sided = mesh.one_sided || materials[index].iter().any(|m| has_sides(&scene.materials[*m as usize]));
        if sided && signed_volume(mesh) < 0.0 {
            findings.push(MeshFinding::InsideOut { mesh: name() });
        }
        let faces = doubled(mesh);
        if faces > 0 {
            findings.push(MeshFinding::Doubled { mesh: name(), faces });
        }
    }
    findings
}

/// The materials that the faces of each mesh may have.
fn materials_of_meshes(scene: &Scene) -> Vec<BTreeSet<u32>> {
    let mut of: Vec<BTreeSet<u32>> = vec![BTreeSet::new(); scene.meshes.len()];
    let all = scene.nodes.iter().chain(&scene.prototypes);
    let mut left: Vec<(&Node, Option<u32>)> = all.map(|node| (node, None)).collect();
    while let Some((node, around)) = left.pop() {
        let own = node.material.or(around);
        match &node.content {
            Content::Group(children) => left.extend(children.iter().map(|child| (child, own))),
            Content::Mesh(index) => {
                let Some(mesh) = scene.meshes.get(*index as usize) else { continue };
                let slots = if node.material.is_none() { &mesh.materials[..] } else { &[] };
                let known = slots.iter().copied().chain(if slots.is_empty() { own } else { None });
                of[*index as usize].extend(known.filter(|m| (*m as usize) < scene.materials.len()));
            }
            _ => {}
        }
    }
    of
}

/// Whether a surface looks different from its inner side.
fn has_sides(material: &Material) -> bool {
    let bends = |target: &Target| target.bends_normal() || matches!(target, Target::Displace { .. });
    let shines = material.may_emit() && !material.two_sided;
    !material.is_opaque() && material.coverage >= 1.0 && !material.has_cutouts()
        || shines
        || material.textures.iter().any(|used| bends(&used.target))
}

/// The number of triangles with the same corners as an earlier one. Faces of one-sided meshes that look in opposite
/// directions are two sides of a sheet.
fn doubled(mesh: &Mesh) -> usize {
    let mut known: HashMap<[[u32; 3]; 3], u8> = HashMap::new();
    let mut count = 0;
    for triangle in 0..mesh.len() {
        // −0 and 0 are one place.
        let corners = mesh.corners(triangle).map(|p| (p + glam::Vec3::ZERO).to_array().map(f32::to_bits));
        let mut sorted = corners;
        sorted.sort_unstable();
        if sorted[0] == sorted[1] || sorted[1] == sorted[2] {
            continue;
        }
        // Whether the corners go round in sorted order.
        let first = corners.iter().position(|corner| *corner == sorted[0]).unwrap_or(0);
        let way = if !mesh.one_sided || corners[(first + 1) % 3] == sorted[1] { 1 } else { 2 };
        let ways = known.entry(sorted).or_insert(0);
        count += usize::from(*ways & way != 0);
        *ways |= way;
    }
    count
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::Phong;
    use crate::math::Rgb;
    use glam::Vec3;

    /// A tetrahedron, turned inside out if `inward`.
    fn tetrahedron(inward: bool) -> Mesh {
        let triangles = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
        let triangles = triangles.map(|[a, b, c]| if inward { [a, c, b] } else { [a, b, c] });
        Mesh {
            name: "m".into(),
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z],
            triangles: triangles.to_vec(),
            ..Mesh::default()
        }
    }

    fn findings(mesh: Mesh, material: Material) -> Vec<MeshFinding> {
        let node = Node::new(Content::Mesh(0)).with_material(0);
        doubt_meshes(&Scene { meshes: vec![mesh], nodes: vec![node], materials: vec![material], ..Scene::default() })
    }

    #[test]
    fn faces_that_turn_inwards_matter_where_sides_differ() {
        let (matte, glass) = (Phong::default(), Phong { opacity: 0.1, eta: 1.5, ..Phong::default() });
        let lamp = Phong { emission: Rgb::WHITE, ..Phong::default() };
        let inside_out = vec![MeshFinding::InsideOut { mesh: "m".into() }];
        for (phong, expected) in [(matte, vec![]), (glass, inside_out.clone()), (lamp, inside_out.clone())] {
            assert_eq!(findings(tetrahedron(false), Material::new("m", phong)), []);
            assert_eq!(findings(tetrahedron(true), Material::new("m", phong)), expected);
        }
        let one_sided = |inward| Mesh { one_sided: true, ..tetrahedron(inward) };
        assert_eq!(findings(one_sided(true), Material::new("m", matte)), inside_out);
        assert_eq!(findings(one_sided(false), Material::new("m", matte)), []);
        let mut open = one_sided(true);
        open.triangles.pop();
        assert_eq!(findings(open, Material::new("m", matte)), []);
    }

    #[test]
    fn faces_on_others_are_counted() {
        let doubled = |one_sided: bool, more: &[[u32; 3]]| {
            let mut mesh = Mesh { one_sided, ..tetrahedron(false) };
            // Equal places with numbers of their own.
            mesh.positions.extend(mesh.positions.clone());
            mesh.triangles.extend(more);
            super::doubled(&mesh)
        };
        assert_eq!(doubled(false, &[]), 0);
        assert_eq!(doubled(false, &[[6, 5, 4]]), 1);
        assert_eq!(doubled(false, &[[4, 5, 6]]), 1);
        // Two sides of a sheet, and a third face on one of them.
        assert_eq!(doubled(true, &[[4, 5, 6]]), 0);
        assert_eq!(doubled(true, &[[4, 5, 6], [0, 1, 2]]), 1);
        assert_eq!(doubled(false, &[[0, 0, 1], [0, 0, 1]]), 0, "without an area");
    }
}
