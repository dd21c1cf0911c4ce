//! Lights that can be seen. Before a scene is lowered, a surface that emits and casts no shadow is put beside each
//! visible light.
//!
//! The surface has a material of its own. The light itself lights other surfaces, so integrators that take emission as
//! light leave these materials out ([`World::is_of_light`]).

use crate::light::{Emission, Light, LightKind};
use crate::material::{Material, Phong};
use crate::math::Rgb;
use crate::scene::{Content, Node, Scene};
use crate::shape::{Mesh, Shape};
use crate::world::World;
use crate::world::trace::emitting::VisibleLight;
use glam::Vec3;

/// Adds the surfaces of visible lights to a scene. Their materials are the last ones. Returns the lights in the order
/// of the materials.
pub(in crate::world) fn add_visible_lights(scene: &mut Scene) -> Vec<VisibleLight> {
    let Scene { nodes, prototypes, materials, meshes, .. } = scene;
    let mut added = Added { materials, meshes, lights: Vec::new() };
    for node in nodes.iter_mut().chain(prototypes) {
        added.add_to(node, 0);
    }
    added.lights
}

/// What visible lights add to a scene.
struct Added<'s> {
    materials: &'s mut Vec<Material>,
    meshes: &'s mut Vec<Mesh>,
    lights: Vec<VisibleLight>,
}

impl Added<'_> {
    fn add_to(&mut self, node: &mut Node, depth: usize) {
        match &mut node.content {
            Content::Group(children) if depth < World::MAX_NESTING => {
                children.iter_mut().for_each(|child| self.add_to(child, depth + 1));
            }
            Content::Light(light) if light.visible => {
                let surfaces = surfaces(light, &node.rest, self.meshes);
                let name = node.name.clone().or_else(|| light.name.clone());
                let material = self.materials.len() as u32;
                self.materials.push(material_of(light, name.as_deref()));
                let name = name.unwrap_or_else(|| light.visible_name().into());
                self.lights.push(VisibleLight {
                    attenuation: light.attenuation,
                    is_emitter: light.emission == Emission::Matte && light.shadows,
                });
                let surface = |node: Node| Node {
                    name: Some(name.clone()),
                    material: Some(material),
                    casts_shadow: false,
                    ..node
                };
                let light =
                    Node { name: node.name.clone(), rest: std::mem::take(&mut node.rest), ..light.clone().into() };
                node.content =
                    Content::Group(std::iter::once(light).chain(surfaces.into_iter().map(surface)).collect());
            }
            _ => {}
        }
    }
}

/// The material of a light's surface.
fn material_of(light: &Light, name: Option<&str>) -> Material {
    let phong = Phong { kd: Rgb::BLACK, ks: Rgb::BLACK, emission: light.intensity, ..Phong::default() };
    let name = name.map_or_else(|| light.visible_name(), |name| format!("light {name}"));
    Material::new(name, phong).with_two_sided(light.emission == Emission::Even)
}

/// The nodes of a light's surface. `rest` is the part of its point that `f32` can't hold.
fn surfaces(light: &Light, rest: &[Vec3; 3], meshes: &mut Vec<Mesh>) -> Vec<Node> {
    match &light.kind {
        LightKind::Disk(light) => vec![Node { rest: (*rest).into(), ..Shape::Disk(light.disk).into() }],
        LightKind::Sphere(light) => vec![Node { rest: (*rest).into(), ..Shape::Sphere(light.sphere).into() }],
        LightKind::Rectangle(light) => {
            let surface = &light.parallelogram;
            meshes.push(Mesh {
                origin: surface.corner.as_dvec3() + rest[0].as_dvec3(),
                positions: vec![Vec3::ZERO, surface.u, surface.u + surface.v, surface.v],
                triangles: vec![[0, 1, 2], [0, 2, 3]],
                ..Mesh::default()
            });
            vec![Node::new(Content::Mesh(meshes.len() as u32 - 1))]
        }
        LightKind::Mesh(light) => {
            let part = |mesh: &u32| Node::new(Content::Mesh(*mesh)).with_transform(&light.transform);
            light.meshes.iter().map(part).collect()
        }
        LightKind::Omni(_) | LightKind::Directional(_) | LightKind::Spot(_) => Vec::new(),
    }
}

impl Light {
    /// The kind of the objects that show the light, and their number.
    pub(crate) fn visible_objects(&self) -> Option<(&'static str, usize)> {
        if !self.visible {
            return None;
        }
        match &self.kind {
            LightKind::Disk(light) => Some((Shape::Disk(light.disk).kind(), 1)),
            LightKind::Sphere(light) => Some((Shape::Sphere(light.sphere).kind(), 1)),
            LightKind::Rectangle(_) => Some(("mesh", 1)),
            LightKind::Mesh(light) => Some(("mesh", light.meshes.len())),
            LightKind::Omni(_) | LightKind::Directional(_) | LightKind::Spot(_) => None,
        }
    }

    /// The name of the surface of an unnamed light.
    pub(crate) fn visible_name(&self) -> String {
        format!("{} light", self.kind_name())
    }
}

impl World {
    /// Whether a material shows a light, which lights other surfaces by itself.
    pub fn is_of_light(&self, material: u32) -> bool {
        self.sources.light_materials.contains(&material)
    }
}
