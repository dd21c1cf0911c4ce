//! The bounds of nodes, with everything inside of them.

use canaletto::Aabb;
use canaletto::light::{Light, LightKind};
use canaletto::math::Transform;
use canaletto::scene::{Content, Node, Scene};
use canaletto::shape::Shape;
use glam::DVec3;

/// The deepest nesting that is followed. Deeper scenes are rejected when the world is built.
const MAX_DEPTH: u32 = 256;

/// The corners of the bounding boxes of these nodes of a scene. Nodes without bounds have none.
pub(super) fn corners<'a>(scene: &Scene, nodes: impl Iterator<Item = &'a Node>) -> Vec<DVec3> {
    let mut bounds = NodeBounds::new(scene, Framed::Objects);
    nodes.filter_map(|node| bounds.of_node(node, 0)).flat_map(|bounds| bounds.corners()).collect()
}

/// The largest diagonal of the box around a visible light and the objects, as a multiple of the objects' own.
const NEAR: f64 = 2.0;

/// The corners of the bounding boxes of the scene's visible lights that are near these corners of objects. Without
/// objects all of them are. A lamp over a table belongs to the view; a sun far away would make the table small.
pub(super) fn corners_of_lights(scene: &Scene, objects: &[DVec3]) -> Vec<DVec3> {
    let mut bounds = NodeBounds::new(scene, Framed::VisibleLights);
    let around = Box3::around(objects.iter().copied());
    let is_near =
        |light: &Box3| around.is_none_or(|objects| objects.union(*light).diagonal() <= NEAR * objects.diagonal());
    let lights = scene.nodes.iter().filter_map(|node| bounds.of_node(node, 0));
    lights.filter(is_near).flat_map(|bounds| bounds.corners()).collect()
}

/// An axis-aligned box by its lowest and highest corner.
#[derive(Clone, Copy)]
struct Box3 {
    low: DVec3,
    high: DVec3,
}

impl Box3 {
    fn around(points: impl Iterator<Item = DVec3>) -> Option<Box3> {
        points.filter(|p| p.is_finite()).fold(None, |all, p| {
            let Box3 { low, high } = all.unwrap_or(Box3 { low: p, high: p });
            Some(Box3 { low: low.min(p), high: high.max(p) })
        })
    }

    fn corners(&self) -> impl Iterator<Item = DVec3> + use<> {
        let Box3 { low, high } = *self;
        (0..8).map(move |i| DVec3::select(glam::BVec3::new(i & 1 == 0, i & 2 == 0, i & 4 == 0), low, high))
    }

    fn moved(self, by: DVec3) -> Box3 {
        Box3 { low: self.low + by, high: self.high + by }
    }

    fn union(self, other: Box3) -> Box3 {
        Box3 { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    fn diagonal(self) -> f64 {
        (self.high - self.low).length()
    }

    fn transformed(&self, t: &Transform) -> Option<Box3> {
        Box3::around(self.corners().map(|p| t.point(p)))
    }
}

impl From<Aabb> for Box3 {
    fn from(bounds: Aabb) -> Box3 {
        Box3 { low: bounds.min.as_dvec3(), high: bounds.max.as_dvec3() }
    }
}

/// What bounds are of.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Framed {
    Objects,
    VisibleLights,
}

struct NodeBounds<'a> {
    scene: &'a Scene,
    framed: Framed,
    /// The bounds of each prototype, computed on first use.
    prototypes: Vec<Option<Option<Box3>>>,
}

impl<'a> NodeBounds<'a> {
    fn new(scene: &'a Scene, framed: Framed) -> NodeBounds<'a> {
        NodeBounds { scene, framed, prototypes: vec![None; scene.prototypes.len()] }
    }

    /// The bounds of a node in the space of its parent.
    fn of_node(&mut self, node: &Node, depth: u32) -> Option<Box3> {
        if depth > MAX_DEPTH {
            return None;
        }
        let scene = self.scene;
        let own: Option<Box3> = match &node.content {
            Content::Light(light) if self.framed == Framed::VisibleLights && light.visible => self.of_light(light),
            Content::Light(_) => None,
            Content::Group(nodes) => union(nodes.iter().map(|node| self.of_node(node, depth + 1))),
            Content::Instance(index) => self.of_prototype(*index as usize, depth + 1),
            _ if self.framed == Framed::VisibleLights => None,
            Content::Shape(shape) => shape.bounds().map(Box3::from),
            Content::Mesh(index) => self.of_mesh(*index),
            Content::Spheres(index) => {
                let cloud = scene.spheres.get(*index as usize)?;
                union((0..cloud.len()).map(|i| Some(cloud.bounds(i).into()))).map(|own| own.moved(cloud.origin))
            }
            Content::Cylinders(index) => {
                let cloud = scene.cylinders.get(*index as usize)?;
                union((0..cloud.len()).map(|i| Some(cloud.bounds(i).into()))).map(|own| own.moved(cloud.origin))
            }
        };
        own?.transformed(&node.transform)
    }

    fn of_mesh(&self, index: u32) -> Option<Box3> {
        let mesh = self.scene.meshes.get(index as usize)?;
        let corners = mesh.triangles.iter().flatten().filter_map(|i| mesh.positions.get(*i as usize));
        Box3::around(corners.map(|p| p.as_dvec3())).map(|own| own.moved(mesh.origin))
    }

    /// The bounds of a light's surface.
    fn of_light(&self, light: &Light) -> Option<Box3> {
        match &light.kind {
            LightKind::Disk(light) => Shape::Disk(light.disk).bounds().map(Box3::from),
            LightKind::Sphere(light) => Shape::Sphere(light.sphere).bounds().map(Box3::from),
            LightKind::Rectangle(light) => {
                let surface = &light.parallelogram;
                let (corner, u, v) = (surface.corner.as_dvec3(), surface.u.as_dvec3(), surface.v.as_dvec3());
                Box3::around([corner, corner + u, corner + v, corner + u + v].into_iter())
            }
            LightKind::Mesh(light) => {
                union(light.meshes.iter().map(|mesh| self.of_mesh(*mesh)))?.transformed(&light.transform)
            }
            _ => None,
        }
    }

    fn of_prototype(&mut self, index: usize, depth: u32) -> Option<Box3> {
        if let Some(known) = self.prototypes.get(index)? {
            return *known;
        }
        let scene = self.scene;
        let bounds = self.of_node(&scene.prototypes[index], depth);
        self.prototypes[index] = Some(bounds);
        bounds
    }
}

fn union(boxes: impl Iterator<Item = Option<Box3>>) -> Option<Box3> {
    boxes.flatten().reduce(Box3::union)
}
