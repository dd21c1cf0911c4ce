//! Fingerprints: whether a solution still belongs to a scene, and if not, what changed.
//!
//! A solution depends on the scene without its cameras, its film and its names. Each kind of thing has a hash of its
//! own, so that a message can name the kind. Values count by their bits: of a scene that is the same in other words, as
//! with nodes in another order, the fingerprint may differ.

use super::RadiositySettings;
use crate::light::Light;
use crate::light::environment::{Environment, EnvironmentKind};
use crate::material::Material;
use crate::scene::{Content, Node, Scene};
use crate::shape::{CylinderCloud, Mesh, SphereCloud};
use crate::texture::{Image, Samples, Texture};
use crate::{Named, WordHash};
use glam::Vec3;
use std::fmt::{self, Debug, Write};

/// What a solution depends on, as a hash for each kind of thing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolutionFingerprint {
    /// Shapes, meshes and clouds at their places.
    pub(super) geometry: u64,
    /// The number of the material of each object.
    pub(super) assignment: u64,
    /// Materials, textures, the pixels of their images, and the colours of vertices.
    pub(super) materials: u64,
    /// Lights at their places.
    pub(super) lights: u64,
    /// The environment and the pixels of its images.
    pub(super) environment: u64,
    /// The settings that a solution depends on. Those of pictures are the default ones.
    pub(super) settings: RadiositySettings,
}

/// A kind of thing that a solution depends on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum SolutionInput {
    /// Shapes, meshes and clouds at their places.
    Geometry,
    /// Which object has which material.
    Assignment,
    /// Materials, their textures and the colours of vertices.
    Materials,
    /// Lights at their places.
    Lights,
    /// The environment.
    Environment,
    /// The settings of radiosity.
    Settings,
}

/// The things that changed since a solution was made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub struct ChangedInputs {
    /// What changed, at least one kind of thing.
    pub inputs: Vec<SolutionInput>,
    /// The settings that the solution was made with.
    pub settings: RadiositySettings,
}

impl fmt::Display for ChangedInputs {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, input) in self.inputs.iter().enumerate() {
            f.write_str(match i {
                0 => "",
                _ if i + 1 == self.inputs.len() => " and ",
                _ => ", ",
            })?;
            f.write_str(match input {
                SolutionInput::Geometry => "the geometry",
                SolutionInput::Assignment => "the choice of objects' materials",
                SolutionInput::Materials => "the materials",
                SolutionInput::Lights => "the lights",
                SolutionInput::Environment => "the environment",
                SolutionInput::Settings => "the settings",
            })?;
        }
        f.write_str(" changed since the solution was made")?;
        if self.inputs.contains(&SolutionInput::Settings) {
            let RadiositySettings { method, error, max_patches, .. } = self.settings;
            let method = method.name();
            write!(f, " (with method {method}, error {error}, max-patches {max_patches})")?;
        }
        Ok(())
    }
}

impl SolutionFingerprint {
    /// The fingerprint of a scene at one time. Visits all of the scene, meshes and images included.
    pub fn new(scene: &Scene, settings: &RadiositySettings) -> SolutionFingerprint {
        let Scene { environment, materials, textures, images, meshes, spheres, cylinders, prototypes, nodes, .. } =
            scene;
        let mut of_materials = WordHash::new();
        let mut bodies =
            Bodies { meshes: Vec::new(), spheres: Vec::new(), cylinders: Vec::new(), prototypes: Vec::new() };
        for mesh in meshes {
            bodies.meshes.push(of_mesh(mesh));
            add_colors(&mut of_materials, &mesh.colors);
            if !mesh.alphas.is_empty() {
                add_numbers(&mut of_materials, &mesh.alphas);
            }
        }
        for SphereCloud { name: _, origin, centers, radii, colors, rows: _ } in spheres {
            let mut hash = of_debug(origin);
            add_points(&mut hash, centers);
            add_numbers(&mut hash, radii);
            bodies.spheres.push(hash.finish());
            add_colors(&mut of_materials, colors);
        }
        for CylinderCloud { name: _, origin, axes, radii, colors, rows: _, caps } in cylinders {
            let mut hash = of_debug(&(origin, caps));
            add_points(&mut hash, axes.as_flattened());
            add_numbers(&mut hash, radii);
            bodies.cylinders.push(hash.finish());
            add_colors(&mut of_materials, colors);
        }
        for material in materials {
            let Material {
                name: _,
                model,
                coverage,
                alpha_cutoff,
                priority,
                two_sided,
                shadow_catcher: _,
                medium: _,
                textures,
            } = material;
            add_debug(&mut of_materials, &(model, coverage, priority, two_sided, textures));
            if let Some(cutoff) = alpha_cutoff {
                add_debug(&mut of_materials, cutoff);
            }
        }
        for Texture { name: _, kind } in textures {
            add_debug(&mut of_materials, kind);
        }
        let around = environment.as_ref().map(images_of).unwrap_or_default();
        // What the camera sees of it changes no light.
        let lighting = environment.as_ref().map(|environment| Environment { visible: true, ..environment.clone() });
        let mut of_environment = of_debug(&lighting);
        for (number, image) in images.iter().enumerate() {
            let hash = if around.contains(&(number as u32)) { &mut of_environment } else { &mut of_materials };
            add_image(hash, image);
        }
        bodies.prototypes = vec![None; prototypes.len()];
        for number in 0..prototypes.len() {
            bodies.prototype(prototypes, number, 0);
        }
        let NodeHashes { geometry, assignment, lights } = bodies.nodes(prototypes, nodes, 0);
        SolutionFingerprint {
            geometry: geometry.unwrap_or(0),
            assignment: assignment.unwrap_or(0),
            materials: of_materials.finish(),
            lights: lights.unwrap_or(0),
            environment: of_environment.finish(),
            settings: of_solution(settings),
        }
    }

    /// Checks that a solution with this fingerprint is one of the scene with another fingerprint.
    ///
    /// # Errors
    /// [`ChangedInputs`] lists what differs.
    pub fn check(&self, scene: &SolutionFingerprint) -> Result<(), ChangedInputs> {
        let geometry = self.geometry == scene.geometry;
        let kinds = [
            (SolutionInput::Geometry, geometry),
            // Other objects have other materials.
            (SolutionInput::Assignment, self.assignment == scene.assignment || !geometry),
            (SolutionInput::Materials, self.materials == scene.materials),
            (SolutionInput::Lights, self.lights == scene.lights),
            (SolutionInput::Environment, self.environment == scene.environment),
            (SolutionInput::Settings, self.settings == scene.settings),
        ];
        let inputs: Vec<SolutionInput> = kinds.into_iter().filter(|(_, same)| !same).map(|(input, _)| input).collect();
        if inputs.is_empty() { Ok(()) } else { Err(ChangedInputs { inputs, settings: self.settings }) }
    }
}

/// The settings with the default ones of pictures, on which no solution depends.
fn of_solution(settings: &RadiositySettings) -> RadiositySettings {
    let RadiositySettings { show, light_samples, .. } = RadiositySettings::DEFAULT;
    RadiositySettings { show, light_samples, ..*settings }
}

/// The hashes of the bodies that nodes refer to. A prototype has none while it is being visited.
struct Bodies {
    meshes: Vec<u64>,
    spheres: Vec<u64>,
    cylinders: Vec<u64>,
    prototypes: Vec<Option<NodeHashes>>,
}

/// The hashes of a node or of several: none for nodes that hold no object, or no light.
#[derive(Clone, Copy, Debug, Default)]
struct NodeHashes {
    geometry: Option<u64>,
    assignment: Option<u64>,
    lights: Option<u64>,
}

impl Bodies {
    /// Visits a prototype and those that it repeats.
    fn prototype(&mut self, prototypes: &[Node], number: usize, depth: usize) -> NodeHashes {
        let Some(node) = prototypes.get(number) else { return NodeHashes::default() };
        if let Some(known) = self.prototypes[number] {
            return known;
        }
        // No world is built of a prototype that repeats itself.
        self.prototypes[number] = Some(NodeHashes::default());
        let hashes = self.node(prototypes, node, depth);
        self.prototypes[number] = Some(hashes);
        hashes
    }

    fn nodes(&mut self, prototypes: &[Node], nodes: &[Node], depth: usize) -> NodeHashes {
        // No world is built of deeper groups.
        if depth > Node::MAX_NESTING {
            return NodeHashes::default();
        }
        let mut all = NodeHashes::default();
        let join = |all: &mut Option<u64>, more: Option<u64>| {
            if let Some(more) = more {
                let mut hash = WordHash::seeded(all.unwrap_or(0));
                hash.add(more);
                *all = Some(hash.finish());
            }
        };
        for node in nodes {
            let hashes = self.node(prototypes, node, depth);
            join(&mut all.geometry, hashes.geometry);
            join(&mut all.assignment, hashes.assignment);
            join(&mut all.lights, hashes.lights);
        }
        all
    }

    fn node(&mut self, prototypes: &[Node], node: &Node, depth: usize) -> NodeHashes {
        let Node { name: _, material, casts_shadow, transform, motion, content, rest } = node;
        let body = |kind: &str, number: u32, hashes: &[u64]| {
            let geometry = of_debug(&(kind, number, hashes.get(number as usize))).finish();
            NodeHashes { geometry: Some(geometry), assignment: Some(0), lights: None }
        };
        let inner = match content {
            Content::Shape(shape) => {
                let geometry = of_debug(shape).finish();
                NodeHashes { geometry: Some(geometry), assignment: Some(0), lights: None }
            }
            Content::Mesh(number) => body("mesh", *number, &self.meshes),
            Content::Spheres(number) => body("spheres", *number, &self.spheres),
            Content::Cylinders(number) => body("cylinders", *number, &self.cylinders),
            Content::Light(light) => {
                let Light { name: _, intensity, shadows, attenuation, samples, emission, visible: _, profile, kind } =
                    light;
                let all = (intensity, shadows, attenuation, samples, emission, kind);
                let light = match profile {
                    None => of_debug(&all).finish(),
                    Some(profile) => of_debug(&(all, profile)).finish(),
                };
                NodeHashes { geometry: None, assignment: None, lights: Some(light) }
            }
            Content::Group(children) => self.nodes(prototypes, children, depth + 1),
            Content::Instance(number) => self.prototype(prototypes, *number as usize, depth + 1),
        };
        let place = match casts_shadow {
            true => of_debug(&(transform, motion, rest)).finish(),
            false => of_debug(&(transform, motion, rest, "no shadow")).finish(),
        };
        let around = |outer: u64| {
            move |inner: u64| {
                let mut hash = WordHash::seeded(inner);
                hash.add(outer);
                hash.finish()
            }
        };
        NodeHashes {
            geometry: inner.geometry.map(around(place)),
            assignment: inner.assignment.map(around(material.map_or(0, |material| u64::from(material) + 1))),
            lights: inner.lights.map(around(place)),
        }
    }
}

fn of_mesh(mesh: &Mesh) -> u64 {
    let Mesh { name: _, origin, positions, normals, uvs, more_uvs, tangents, .. } = mesh;
    let Mesh { colors: _, alphas: _, triangles, slots, materials, one_sided, .. } = mesh;
    let mut hash = of_debug(&(origin, one_sided, materials));
    add_points(&mut hash, positions);
    add_points(&mut hash, normals);
    hash.add(uvs.len() as u64);
    for uvs in std::iter::once(uvs).chain(more_uvs) {
        uvs.iter().for_each(|uv| add_pair(&mut hash, uv.to_array().map(f32::to_bits)));
    }
    tangents.iter().flat_map(|tangent| tangent.to_array()).for_each(|v| hash.add(u64::from(v.to_bits())));
    hash.add(triangles.len() as u64);
    triangles.iter().flatten().for_each(|&corner| hash.add(u64::from(corner)));
    hash.add(slots.len() as u64);
    slots.iter().for_each(|&slot| hash.add(u64::from(slot)));
    hash.finish()
}

fn add_image(hash: &mut WordHash, image: &Image) {
    let Image { name: _, width, height, channels, samples, space, premultiplied } = image;
    add_debug(hash, &(width, height, channels, space, premultiplied));
    match samples {
        Samples::U8(samples) => {
            hash.add(1);
            hash.add_bytes(samples);
        }
        Samples::U16(samples) => {
            hash.add(2);
            samples.iter().for_each(|sample| hash.add_bytes(&sample.to_le_bytes()));
        }
        Samples::F16(samples) => {
            hash.add(3);
            samples.iter().for_each(|sample| hash.add_bytes(&sample.to_le_bytes()));
        }
        Samples::F32(samples) => {
            hash.add(4);
            add_numbers(hash, samples);
        }
    }
}

/// The numbers of the images that an environment shows.
fn images_of(environment: &Environment) -> Vec<u32> {
    match &environment.kind {
        EnvironmentKind::Cube { faces, .. } => faces.to_vec(),
        EnvironmentKind::Cross { image, .. } | EnvironmentKind::LatLong { image, .. } => vec![*image],
        EnvironmentKind::Gradient(_) | EnvironmentKind::Sky(_) => Vec::new(),
    }
}

fn of_debug(value: &dyn Debug) -> WordHash {
    let mut hash = WordHash::new();
    add_debug(&mut hash, value);
    hash
}

/// Adds a value by its `Debug` text, which holds all fields and exact numbers.
fn add_debug(hash: &mut WordHash, value: &dyn Debug) {
    // A hash takes any text.
    let _ = write!(hash, "{value:?};");
}

fn add_pair(hash: &mut WordHash, [a, b]: [u32; 2]) {
    hash.add(u64::from(a) | u64::from(b) << 32);
}

fn add_points(hash: &mut WordHash, points: &[Vec3]) {
    hash.add(points.len() as u64);
    for point in points {
        let [x, y, z] = point.to_array().map(f32::to_bits);
        add_pair(hash, [x, y]);
        add_pair(hash, [z, 0]);
    }
}

fn add_numbers(hash: &mut WordHash, numbers: &[f32]) {
    hash.add(numbers.len() as u64);
    numbers.iter().for_each(|number| hash.add_bytes(&number.to_bits().to_le_bytes()));
}

fn add_colors(hash: &mut WordHash, colors: &[crate::math::Rgb]) {
    hash.add(colors.len() as u64);
    for color in colors {
        let [r, g, b] = color.to_array().map(f32::to_bits);
        add_pair(hash, [r, g]);
        add_pair(hash, [b, 0]);
    }
}
