//! Parts of a scene that an integrator leaves out of the picture.

use crate::Named;
use crate::scene::{Integrator, Stage};
use crate::world::World;
use std::fmt;

/// A part of a scene that an integrator leaves out.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Omission {
    /// The light that materials emit is seen, but reaches no other surface.
    EmissionAsLight {
        /// The name of the integrator.
        integrator: &'static str,
        /// The names of the materials, in the scene's order.
        materials: Vec<String>,
    },
}

impl fmt::Display for Omission {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Omission::EmissionAsLight { integrator, materials } => {
                let emit = if materials.len() == 1 { "emits" } else { "emit" };
                write_names(f, "material", materials)?;
                write!(f, " {emit}, but the {integrator} integrator takes light from lights only")
            }
        }
    }
}

/// The most names in a message.
const MAX_NAMED: usize = 4;

fn write_names(f: &mut fmt::Formatter<'_>, kind: &str, names: &[String]) -> fmt::Result {
    write!(f, "{kind}{}", if names.len() == 1 { "" } else { "s" })?;
    for (i, name) in names.iter().take(MAX_NAMED).enumerate() {
        let before = match i {
            0 => "",
            _ if i + 1 == names.len() => " and",
            _ => ",",
        };
        write!(f, "{before} \"{name}\"")?;
    }
    match names.len().saturating_sub(MAX_NAMED) {
        0 => Ok(()),
        more => write!(f, " and {more} more"),
    }
}

/// The parts of a world that this integrator leaves out. Traces no ray.
pub fn omissions(world: &World, integrator: &Integrator) -> Vec<Omission> {
    let Integrator::Whitted(settings) = integrator;
    if settings.stage == Stage::Unlit || !world.may_emit() {
        return Vec::new();
    }
    let used = world.materials_in_use();
    let emitters = world.materials().iter().zip(used).filter(|(material, used)| *used && material.may_emit());
    let materials: Vec<String> = emitters.map(|(material, _)| material.name.clone()).collect();
    let integrator = integrator.name();
    if materials.is_empty() { Vec::new() } else { vec![Omission::EmissionAsLight { integrator, materials }] }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::{Material, Phong};
    use crate::math::Rgb;
    use crate::scene::{Content, Node, Scene, WhittedSettings};
    use crate::shape::{Plane, Shape, Sphere};
    use glam::Vec3;

    fn told(nodes: Vec<Node>, stage: Stage) -> Vec<String> {
        let lamp = Phong { emission: Rgb::WHITE, ..Phong::default() };
        let materials = ["a", "b", "c", "d", "e", "f"].map(|name| Material::new(name, lamp));
        let mut materials = materials.to_vec();
        materials.push(Material::new("dull", Phong::default()));
        let ball = Node::from(Shape::Sphere(Sphere { center: Vec3::ZERO, radius: 1.0 }));
        let pair = vec![ball.clone(), ball.with_material(1)];
        let prototypes = vec![Node::new(Content::Group(pair))];
        let world = World::build(Scene { materials, prototypes, nodes, ..Scene::default() }).unwrap();
        let settings = WhittedSettings { stage, ..WhittedSettings::default() };
        omissions(&world, &settings.into()).iter().map(Omission::to_string).collect()
    }

    #[test]
    fn materials_that_emit_are_named_if_they_are_used() {
        let end = "but the whitted integrator takes light from lights only";
        let plane = |material: u32| {
            let plane = Shape::Plane(Plane { point: Vec3::ZERO, normal: Vec3::Y });
            Node::from(plane).with_material(material)
        };
        let both = |stage| told(vec![plane(0), Node::new(Content::Instance(0)).with_material(6)], stage);
        assert_eq!(both(Stage::Full), [format!("material \"a\" emits, {end}")]);
        assert!(both(Stage::Unlit).is_empty() && told(vec![plane(6)], Stage::Full).is_empty());
        // The copy's own material replaces none; one of its members has a material.
        let copy = told(vec![Node::new(Content::Group(vec![Node::new(Content::Instance(0))]))], Stage::Full);
        assert_eq!(copy, [format!("material \"b\" emits, {end}")]);
        let all = told((0..6).map(plane).collect(), Stage::Diffuse);
        assert_eq!(all, [format!("materials \"a\", \"b\", \"c\", \"d\" and 2 more emit, {end}")]);
        assert_eq!(told(vec![plane(4), plane(2)], Stage::Full), [format!("materials \"c\" and \"e\" emit, {end}")]);
    }
}
