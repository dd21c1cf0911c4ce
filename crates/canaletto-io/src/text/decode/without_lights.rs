//! What the classic integrator shows of a scene without lights and without ambient light.

use canaletto::material::{Material, Parameter, Target};
use canaletto::math::Rgb;
use canaletto::scene::{Content, Node, Scene, Stage};
use std::collections::HashSet;

/// The surfaces that are black without lights.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Black {
    /// Whether any surface is black.
    pub(super) some: bool,
    /// Whether any surface is not, as it emits, is unlit, or shows a bright background.
    pub(super) not_all: bool,
    /// Whether any surface emits.
    pub(super) emits: bool,
}

impl Black {
    /// The surfaces of a scene that are black at this stage.
    pub(super) fn of(scene: &Scene, stage: Stage) -> Black {
        let is_bright_around = scene.environment.is_some() || scene.background != Rgb::BLACK;
        let shows = |material: &Material| {
            let targets = |wanted: &[Target]| material.textures.iter().any(|texture| wanted.contains(&texture.target));
            let is_mirror = material.phong().k != Rgb::BLACK || targets(&[Target::Parameter(Parameter::Mirror)]);
            let is_seen = targets(&[Target::Replace, Target::Decal])
                || material.may_emit()
                || is_bright_around
                    && (stage >= Stage::Reflection && is_mirror
                        || stage >= Stage::Full && !material.is_opaque()
                        || material.has_holes());
            [is_seen, material.may_emit()]
        };
        let shows = scene.materials.iter().map(shows).collect();
        let mut walk = Walk { scene, shows, visited: HashSet::new(), black: Black::default() };
        walk.nodes(&scene.nodes, None, 0);
        walk.black
    }
}

/// A walk over all surfaces.
struct Walk<'a> {
    scene: &'a Scene,
    /// Whether surfaces of each material aren't black, and whether they emit.
    shows: Vec<[bool; 2]>,
    /// The prototypes that were visited, with the material around them.
    visited: HashSet<(u32, Option<u32>)>,
    black: Black,
}

impl<'a> Walk<'a> {
    fn nodes(&mut self, nodes: &'a [Node], inherited: Option<u32>, depth: usize) {
        // Deeper scenes are rejected when the world is built.
        if depth > Node::MAX_NESTING {
            return;
        }
        for node in nodes {
            let material = node.material.or(inherited);
            match &node.content {
                Content::Light(_) => {}
                Content::Group(children) => self.nodes(children, material, depth + 1),
                Content::Instance(index) => {
                    if self.visited.insert((*index, material))
                        && let Some(prototype) = self.scene.prototypes.get(*index as usize)
                    {
                        self.nodes(std::slice::from_ref(prototype), material, depth + 1);
                    }
                }
                Content::Mesh(index) if node.material.is_none() => {
                    let own = self.scene.meshes.get(*index as usize).map_or(&[][..], |mesh| &mesh.materials);
                    own.iter().for_each(|material| self.surface(Some(*material)));
                    if own.is_empty() {
                        self.surface(material);
                    }
                }
                Content::Shape(_) | Content::Mesh(_) | Content::Spheres(_) | Content::Cylinders(_) => {
                    self.surface(material);
                }
            }
        }
    }

    fn surface(&mut self, material: Option<u32>) {
        let [is_seen, emits] = material.and_then(|index| self.shows.get(index as usize)).copied().unwrap_or_default();
        self.black.not_all |= is_seen;
        self.black.some |= !is_seen;
        self.black.emits |= emits;
    }
}
