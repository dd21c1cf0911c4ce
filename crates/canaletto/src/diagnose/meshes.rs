//! Doubts about the meshes of a scene: faces that turn inwards, and faces and objects that lie on each other.

use crate::material::{Material, Target};
use crate::math::Transform;
use crate::scene::{Content, Node, Scene};
use crate::shape::Mesh;
use crate::world::signed_volume;
use canaletto_bvh::Aabb;
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
    /// Two objects are equal and at one place, so that chance decides which is seen.
    SamePlace {
        /// The names of the first and of a later object.
        objects: [String; 2],
        /// The number of objects that lie on earlier ones.
        count: usize,
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
    findings.extend(same_place(scene));
    findings
}

/// The first pair of objects at rest that are equal and at one place, with the number of such pairs.
fn same_place(scene: &Scene) -> Option<MeshFinding> {
    let meshes = first_equals(&scene.meshes);
    let (mut objects, mut count) = (None, 0);
    let prototypes = scene.prototypes.iter().map(std::slice::from_ref);
    for nodes in std::iter::once(&scene.nodes[..]).chain(prototypes) {
        let mut known: HashMap<[u64; 18], Vec<&Node>> = HashMap::new();
        let mut left: Vec<(&Node, Transform)> = nodes.iter().rev().map(|node| (node, Transform::IDENTITY)).collect();
        while let Some((node, around)) = left.pop() {
            if !node.motion.is_usual() {
                continue;
            }
            let place = around.after(&node.transform);
            let (bounds, [kind, index]) = match &node.content {
                Content::Group(children) => {
                    left.extend(children.iter().rev().map(|child| (child, place)));
                    continue;
                }
                Content::Light(_) => continue,
                Content::Shape(shape) => (shape.bounds(), [0, 0]),
                Content::Mesh(index) => (None, [1, meshes.get(*index as usize).copied().unwrap_or(*index)]),
                Content::Spheres(index) => (None, [2, *index]),
                Content::Cylinders(index) => (None, [3, *index]),
                Content::Instance(index) => (None, [4, *index]),
            };
            let mut key = [0; 18];
            key[..12].copy_from_slice(&place.matrix().to_cols_array().map(f64::to_bits));
            if let Some(Aabb { min, max }) = bounds {
                key[12..15].copy_from_slice(&min.to_array().map(|v| v.to_bits().into()));
                key[15..].copy_from_slice(&max.to_array().map(|v| v.to_bits().into()));
            } else {
                key[12..14].copy_from_slice(&[u64::from(kind), u64::from(index)]);
            }
            let here = known.entry(key).or_default();
            let equal = here.iter().find(|other| match (&other.content, &node.content) {
                (Content::Shape(a), Content::Shape(b)) => a == b && node.rest == other.rest,
                (Content::Shape(_), _) | (_, Content::Shape(_)) => false,
                _ => true,
            });
            match equal {
                Some(other) => {
                    count += 1;
                    objects.get_or_insert_with(|| [called(other, scene), called(node, scene)]);
                }
                None => here.push(node),
            }
        }
    }
    objects.map(|objects| MeshFinding::SamePlace { objects, count })
}

/// The name of an object, or that of its mesh or kind.
fn called(node: &Node, scene: &Scene) -> String {
    let of_content = || match &node.content {
        Content::Mesh(index) => scene.meshes.get(*index as usize).map_or("mesh", |mesh| &mesh.name).to_owned(),
        Content::Shape(shape) => shape.kind().to_owned(),
        Content::Spheres(_) => "spheres".to_owned(),
        Content::Cylinders(_) => "cylinders".to_owned(),
        _ => "instance".to_owned(),
    };
    node.name.as_ref().map_or_else(of_content, |name| name.to_string())
}

/// For each mesh, the index of the first with the same triangles.
fn first_equals(meshes: &[Mesh]) -> Vec<u32> {
    let mut known: HashMap<(usize, usize, Vec<u32>), Vec<u32>> = HashMap::new();
    let first_of = |(index, mesh): (u32, &Mesh)| {
        let some = mesh.positions.first().into_iter().chain(mesh.positions.last());
        let key = (mesh.positions.len(), mesh.len(), some.flat_map(|p| p.to_array().map(f32::to_bits)).collect());
        let alike = known.entry(key).or_default();
        let equal = alike.iter().copied().find(|other| {
            let other = &meshes[*other as usize];
            other.origin == mesh.origin && other.positions == mesh.positions && other.triangles == mesh.triangles
        });
        equal.unwrap_or_else(|| {
            alike.push(index);
            index
        })
    };
    (0..).zip(meshes).map(first_of).collect()
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
    use crate::shape::{Shape, Sphere};
    use glam::{DVec3, Vec3};

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
    fn objects_at_one_place_are_found() {
        let at = |x: f64| Transform::translate(DVec3::X * x);
        let ball = |radius: f32| Node::from(Shape::Sphere(Sphere { center: Vec3::ZERO, radius }));
        let mesh = |index: u32, x: f64| Node::new(Content::Mesh(index)).with_transform(&at(x));
        let of = |nodes: Vec<Node>| {
            let meshes = vec![tetrahedron(false), Mesh { name: "n".into(), ..tetrahedron(false) }, tetrahedron(true)];
            doubt_meshes(&Scene { meshes, nodes, ..Scene::default() })
        };
        let found =
            |a: &str, b: &str, count| vec![MeshFinding::SamePlace { objects: [a, b].map(str::to_owned), count }];
        assert_eq!(of(vec![mesh(0, 0.0), mesh(0, 1.0), mesh(2, 0.0), ball(1.0), ball(2.0)]), []);
        assert_eq!(of(vec![mesh(0, 1.0), mesh(1, 1.0)]), found("m", "n", 1));
        assert_eq!(of(vec![ball(1.0), ball(1.0), ball(1.0)]), found("sphere", "sphere", 2));
        let mut moving = ball(1.0);
        moving.motion = vec![at(0.0), at(1.0)].into();
        assert_eq!(of(vec![ball(1.0), moving]), []);
        // Transforms of groups count.
        let group = |x: f64, node| Node::new(Content::Group(vec![node])).with_transform(&at(x));
        assert_eq!(of(vec![group(1.0, mesh(0, 1.0)), group(2.0, mesh(0, 0.0))]), found("m", "m", 1));
        assert_eq!(of(vec![group(1.0, mesh(0, 1.0)), group(1.0, mesh(0, 0.0))]), []);
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
