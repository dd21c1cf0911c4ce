//! Triangles for all objects of a scene, for forms that have nothing else.

use super::lost::Lost;
use canaletto::Aabb;
use canaletto::material::Material;
use canaletto::math::{Rgb, Transform};
use canaletto::scene::{Content, Node, Scene};
use canaletto::shape::{CylinderCloud, Mesh, Shape, SphereCloud};
use glam::{DVec3, Vec2, Vec3};
use std::collections::HashMap;
use std::ops::Deref;
use std::rc::Rc;

/// How far triangles may lie from a round shape, as a share of its size.
const TOLERANCE: f64 = 5e-4;
/// The same for the elements of clouds, which are many.
const CLOUD_TOLERANCE: f64 = 1e-2;
/// The most triangles of a shape or a cloud.
const MOST_TRIANGLES: usize = 1 << 22;
/// How far planes reach, as a multiple of the scene's size.
const REACH: f64 = 4.0;

/// The low and the high corner of a box.
pub(super) type Span = [DVec3; 2];

const EMPTY: Span = [DVec3::INFINITY, DVec3::NEG_INFINITY];

/// The box around all objects that have an end.
pub(super) fn span_of_scene(scene: &Scene) -> Span {
    let mut prototypes = vec![None; scene.prototypes.len()];
    let mut all = EMPTY;
    scene.nodes.iter().for_each(|node| all = join(all, span(scene, node, &mut prototypes, 0)));
    all
}

fn join([a, b]: Span, [c, d]: Span) -> Span {
    [a.min(c), b.max(d)]
}

fn around(points: impl Iterator<Item = DVec3>) -> Span {
    points.fold(EMPTY, |[low, high], p| [low.min(p), high.max(p)])
}

fn moved([low, high]: Span, transform: &Transform) -> Span {
    if low.x > high.x {
        return EMPTY;
    }
    let pick = |i: u32, bit: u32| if i & bit == 0 { low } else { high };
    around((0..8).map(|i| transform.point(DVec3::new(pick(i, 1).x, pick(i, 2).y, pick(i, 4).z))))
}

fn span(scene: &Scene, node: &Node, prototypes: &mut [Option<Span>], depth: usize) -> Span {
    if depth > Node::MAX_NESTING {
        return EMPTY;
    }
    let own = match &node.content {
        Content::Light(_) => EMPTY,
        Content::Shape(shape) => match shape.bounds() {
            Some(Aabb { min, max }) => [min.as_dvec3(), max.as_dvec3()],
            None => EMPTY,
        },
        Content::Mesh(index) => {
            let mesh = scene.meshes.get(*index as usize);
            mesh.map_or(EMPTY, |mesh| around(mesh.positions.iter().map(|p| mesh.origin + p.as_dvec3())))
        }
        Content::Spheres(index) => scene.spheres.get(*index as usize).map_or(EMPTY, |cloud| {
            (0..cloud.len()).map(|i| cloud.bounds(i)).fold(EMPTY, |all, Aabb { min, max }| {
                join(all, [cloud.origin + min.as_dvec3(), cloud.origin + max.as_dvec3()])
            })
        }),
        Content::Cylinders(index) => scene.cylinders.get(*index as usize).map_or(EMPTY, |cloud| {
            (0..cloud.len()).map(|i| cloud.bounds(i)).fold(EMPTY, |all, Aabb { min, max }| {
                join(all, [cloud.origin + min.as_dvec3(), cloud.origin + max.as_dvec3()])
            })
        }),
        Content::Group(children) => {
            children.iter().fold(EMPTY, |all, child| join(all, span(scene, child, prototypes, depth + 1)))
        }
        Content::Instance(index) => match (prototypes.get(*index as usize), scene.prototypes.get(*index as usize)) {
            (Some(Some(known)), _) => *known,
            (Some(None), Some(prototype)) => {
                let found = span(scene, prototype, prototypes, depth + 1);
                prototypes[*index as usize] = Some(found);
                found
            }
            _ => EMPTY,
        },
    };
    moved(own, &node.transform)
}

/// Makes triangles of shapes and clouds.
pub(super) struct Tessellator {
    scene_span: Span,
}

impl Tessellator {
    pub(super) fn new(scene: &Scene) -> Tessellator {
        Tessellator { scene_span: span_of_scene(scene) }
    }

    /// The mesh of a shape, in the space of its node. `to_world` leads from there to the scene.
    pub(super) fn shape(&self, node: &Node, shape: &Shape, to_world: &Transform, lost: &mut Lost) -> Option<Mesh> {
        let name = node.name.as_deref().unwrap_or(shape.kind());
        let size = shape.bounds().map_or(1.0, |Aabb { min, max }| (max - min).as_dvec3().length());
        let clip = match shape {
            Shape::Plane(_) => {
                lost.add("the rest of planes, which have ends there", name);
                self.around_scene(to_world)
            }
            _ => Aabb::EMPTY,
        };
        let Ok(made) = shape.tessellate(size * TOLERANCE, &clip, MOST_TRIANGLES) else {
            lost.add("shapes of too many triangles", name);
            return None;
        };
        if made.triangles.is_empty() {
            lost.add("planes that pass the scene", name);
            return None;
        }
        Some(Mesh {
            name: name.to_owned(),
            positions: made.vertices.iter().map(|v| v.point.as_vec3()).collect(),
            normals: made.vertices.iter().map(|v| v.normal.as_vec3()).collect(),
            uvs: made.vertices.iter().map(|v| v.uv.as_vec2()).collect(),
            triangles: made.triangles,
            one_sided: matches!(shape, Shape::Triangle(triangle) if triangle.one_sided),
            ..Mesh::default()
        })
    }

    /// A box around the scene in a space of it.
    fn around_scene(&self, to_world: &Transform) -> Aabb {
        let [low, high] = self.scene_span;
        let (low, high) = if low.x > high.x { (DVec3::NEG_ONE, DVec3::ONE) } else { (low, high) };
        let middle = (low + high) / 2.0;
        let half = DVec3::splat((high - low).length().max(1e-6) * REACH / 2.0);
        let [low, high] = moved([middle - half, middle + half], &to_world.inverse());
        Aabb { min: low.as_vec3(), max: high.as_vec3() }
    }

    /// The mesh of a cloud of spheres.
    pub(super) fn spheres(&self, cloud: &SphereCloud, lost: &mut Lost) -> Option<Mesh> {
        let elements = (0..cloud.len()).map(|i| (Shape::Sphere(cloud.sphere(i)), cloud.radius(i), cloud.color(i)));
        self.cloud(&cloud.name, cloud.origin, elements, lost)
    }

    /// The mesh of a cloud of cylinders.
    pub(super) fn cylinders(&self, cloud: &CylinderCloud, lost: &mut Lost) -> Option<Mesh> {
        let elements = (0..cloud.len()).map(|i| (Shape::Cylinder(cloud.cylinder(i)), cloud.radius(i), cloud.color(i)));
        self.cloud(&cloud.name, cloud.origin, elements, lost)
    }

    fn cloud(
        &self,
        name: &str,
        origin: DVec3,
        elements: impl Iterator<Item = (Shape, f32, Option<Rgb>)>,
        lost: &mut Lost,
    ) -> Option<Mesh> {
        let mut mesh = Mesh { name: name.to_owned(), origin, ..Mesh::default() };
        for (shape, radius, color) in elements {
            let made = shape.tessellate(f64::from(radius) * CLOUD_TOLERANCE, &Aabb::EMPTY, MOST_TRIANGLES).ok();
            let made = made.filter(|made| mesh.len() + made.triangles.len() <= MOST_TRIANGLES);
            let Some(made) = made else {
                lost.add("clouds of too many triangles", name);
                return None;
            };
            let first = mesh.positions.len() as u32;
            mesh.positions.extend(made.vertices.iter().map(|v| v.point.as_vec3()));
            mesh.normals.extend(made.vertices.iter().map(|v| v.normal.as_vec3()));
            mesh.triangles.extend(made.triangles.iter().map(|corners| corners.map(|v| v + first)));
            mesh.colors.extend(color.into_iter().flat_map(|color| vec![color; made.vertices.len()]));
        }
        Some(mesh)
    }
}

/// A mesh of the scene, or one of a shape or cloud, which instances share.
#[derive(Clone)]
pub(super) enum PlacedMesh<'a> {
    OfScene(&'a Mesh),
    Made(Rc<Mesh>),
}

impl Deref for PlacedMesh<'_> {
    type Target = Mesh;

    fn deref(&self) -> &Mesh {
        match self {
            PlacedMesh::OfScene(mesh) => mesh,
            PlacedMesh::Made(mesh) => mesh,
        }
    }
}

/// A mesh at its place in the scene.
pub(super) struct Placed<'a> {
    pub(super) name: String,
    pub(super) mesh: PlacedMesh<'a>,
    pub(super) transform: Transform,
    /// The material of each slot of the mesh.
    pub(super) materials: Vec<Option<u32>>,
}

impl Placed<'_> {
    /// The vertices in the scene's space.
    pub(super) fn positions(&self) -> impl Iterator<Item = DVec3> + '_ {
        self.mesh.positions.iter().map(|p| self.transform.point(self.mesh.origin + p.as_dvec3()))
    }

    /// The normals in the scene's space.
    pub(super) fn normals(&self) -> impl Iterator<Item = Vec3> + '_ {
        let turned = |n: &Vec3| self.transform.normal(n.as_dvec3()).normalize_or(DVec3::Y).as_vec3();
        let is_still = self.transform.matrix().matrix3 == glam::DMat3::IDENTITY;
        self.mesh.normals.iter().map(move |n| if is_still { *n } else { turned(n) })
    }

    /// The texture coordinates, with v from the lower edge of pictures.
    pub(super) fn uvs(&self) -> impl Iterator<Item = Vec2> + '_ {
        self.mesh.uvs.iter().map(|uv| Vec2::new(uv.x, 1.0 - uv.y))
    }

    /// The triangles of a slot, counter-clockwise from outside.
    pub(super) fn triangles(&self, slot: u32) -> impl Iterator<Item = [u32; 3]> + '_ {
        let mirrors = self.transform.matrix().matrix3.determinant() < 0.0;
        let turned = move |[a, b, c]: [u32; 3]| if mirrors { [a, c, b] } else { [a, b, c] };
        super::mesh_file::triangles_of(&self.mesh, slot).map(turned)
    }
}

/// The diffuse colour of a material.
pub(super) fn color_of(scene: &Scene, material: Option<u32>) -> Rgb {
    let default = Material::default();
    let material = material.and_then(|index| scene.materials.get(index as usize)).unwrap_or(&default);
    material.standard().map_or_else(|| material.classic().kd, |surface| surface.base.color * surface.base.weight)
}

/// The most meshes of a scene whose instances are written one by one, and the most triangles of all.
const MOST_PLACED: usize = 1 << 20;
const MOST_PLACED_TRIANGLES: usize = 1 << 24;

/// All objects of a scene as meshes at their places.
pub(super) fn placed<'a>(scene: &'a Scene, lost: &mut Lost) -> Vec<Placed<'a>> {
    let mut walk =
        Walk { scene, tessellator: Tessellator::new(scene), lost, all: Vec::new(), made: HashMap::new(), count: 0 };
    for node in &scene.nodes {
        walk.node(node, &Transform::IDENTITY, None, None, 0);
    }
    walk.all
}

struct Walk<'a, 'l> {
    scene: &'a Scene,
    tessellator: Tessellator,
    lost: &'l mut Lost,
    all: Vec<Placed<'a>>,
    /// The meshes of shapes and clouds by their nodes.
    made: HashMap<*const Node, Option<Rc<Mesh>>>,
    /// The number of triangles so far.
    count: usize,
}

impl<'a> Walk<'a, '_> {
    fn node(
        &mut self,
        node: &'a Node,
        around: &Transform,
        inherited: Option<u32>,
        outer: Option<&'a str>,
        depth: usize,
    ) {
        if depth > Node::MAX_NESTING || self.all.len() >= MOST_PLACED || self.count >= MOST_PLACED_TRIANGLES {
            self.lost.of_scene("objects beyond the first million or 16 million triangles, or too deep in groups");
            return;
        }
        let transform = around.after(&node.transform);
        let material = node.material.or(inherited);
        let name = node.name.as_deref().or(outer);
        if !node.motion.is_empty() {
            self.lost.add("motion while the shutter is open", name.unwrap_or("unnamed"));
        }
        let mesh = match &node.content {
            Content::Light(_) => {
                self.lost.add("lights", name.unwrap_or("unnamed"));
                None
            }
            Content::Group(children) => {
                children.iter().for_each(|child| self.node(child, &transform, material, name, depth + 1));
                None
            }
            Content::Instance(index) => {
                if let Some(prototype) = self.scene.prototypes.get(*index as usize) {
                    self.node(prototype, &transform, material, name, depth + 1);
                }
                None
            }
            Content::Mesh(index) => self.scene.meshes.get(*index as usize).map(PlacedMesh::OfScene),
            Content::Shape(_) | Content::Spheres(_) | Content::Cylinders(_) => {
                self.made(node, &transform).map(PlacedMesh::Made)
            }
        };
        let Some(mesh) = mesh.filter(|mesh| !mesh.is_empty()) else { return };
        if mesh.one_sided {
            self.lost.add("surfaces that rays from behind pass", name.unwrap_or(&mesh.name));
        }
        let slots = mesh.slots.iter().copied().max().unwrap_or(0);
        let of_slot = |slot: u32| node.material.or(mesh.materials.get(slot as usize).copied()).or(inherited);
        let materials = (0..=slots).map(of_slot).collect();
        let name = name.unwrap_or(&mesh.name).to_owned();
        self.count += mesh.len();
        self.all.push(Placed { name, mesh, transform, materials });
    }

    /// The mesh of a shape or cloud. That of a plane depends on its place.
    fn made(&mut self, node: &Node, transform: &Transform) -> Option<Rc<Mesh>> {
        let is_plane = matches!(node.content, Content::Shape(Shape::Plane(_)));
        if let Some(known) = self.made.get(&std::ptr::from_ref(node)).filter(|_| !is_plane) {
            return known.clone();
        }
        let scene = self.scene;
        let mesh = match &node.content {
            Content::Shape(shape) => self.tessellator.shape(node, shape, transform, self.lost),
            Content::Spheres(index) => {
                scene.spheres.get(*index as usize).and_then(|cloud| self.tessellator.spheres(cloud, self.lost))
            }
            Content::Cylinders(index) => {
                scene.cylinders.get(*index as usize).and_then(|cloud| self.tessellator.cylinders(cloud, self.lost))
            }
            _ => None,
        };
        let mesh = mesh.map(Rc::new);
        self.made.insert(std::ptr::from_ref(node), mesh.clone());
        mesh
    }
}
