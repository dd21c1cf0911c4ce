//! A scene as a hypothesis has it, seen through a camera.

use crate::camera::Camera;
use crate::scene::{Content, Node, Scene, View};
use crate::shape::Shape;
use crate::world::World;

/// A world, the camera that sees it, and what else is needed to render it.
pub(super) struct Seen<'w> {
    world: Kept<'w>,
    pub(super) camera: Camera,
    /// The radii of spheres by the numbers of their objects; 1 for all else.
    pub(super) radii: Vec<f64>,
    /// What all colours are multiplied by.
    pub(super) gain: f64,
}

enum Kept<'w> {
    Own(Box<World>),
    Lent(&'w World),
}

impl<'w> Seen<'w> {
    /// The world as the scene describes it.
    pub(super) fn of(world: &'w World, scene: &Scene, camera: Camera) -> Seen<'w> {
        Seen { world: Kept::Lent(world), camera, radii: radii(scene), gain: 1.0 }
    }

    /// The world through another camera, in the same coordinates.
    pub(super) fn through(&self, view: &View) -> Option<Seen<'_>> {
        let camera = Camera::of(view).ok()?.relative_to(self.world().origin());
        Some(Seen { world: Kept::Lent(self.world()), camera, radii: self.radii.clone(), gain: self.gain })
    }

    /// The world with all colours multiplied.
    pub(super) fn brightened(&self, gain: f64) -> Seen<'_> {
        Seen { world: Kept::Lent(self.world()), camera: self.camera.clone(), radii: self.radii.clone(), gain }
    }

    /// A changed scene.
    pub(super) fn built(scene: Scene, view: &View) -> Option<Seen<'w>> {
        let radii = radii(&scene);
        let world = Box::new(World::build(scene).ok()?);
        let camera = Camera::of(view).ok()?.relative_to(world.origin());
        Some(Seen { world: Kept::Own(world), camera, radii, gain: 1.0 })
    }

    pub(super) fn world(&self) -> &World {
        match &self.world {
            Kept::Own(world) => world,
            Kept::Lent(world) => world,
        }
    }
}

/// How many objects a node holds.
pub(super) fn objects_of(scene: &Scene, node: &Node) -> usize {
    match &node.content {
        Content::Light(_) => 0,
        Content::Group(nodes) => nodes.iter().map(|node| objects_of(scene, node)).sum(),
        Content::Instance(index) => objects_of(scene, &scene.prototypes[*index as usize]),
        _ => 1,
    }
}

fn radii(scene: &Scene) -> Vec<f64> {
    let mut all = vec![1.0];
    for node in &scene.nodes {
        let radius = match &node.content {
            Content::Shape(Shape::Sphere(sphere)) => f64::from(sphere.radius),
            _ => 1.0,
        };
        all.extend(vec![radius; objects_of(scene, node).min(1 << 16)]);
    }
    all
}
