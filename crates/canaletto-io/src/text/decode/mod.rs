//! The decoder from nodes to a [`Scene`]. It reports every mistake and continues with the next node.

mod names;
mod object;
mod roll;
mod settings;
mod surfaces;
mod transform;
mod warnings;
mod without_lights;

use super::arithmetic::REPEAT;
use super::file_cache::FrameCache;
use super::files::Files;
use super::model_settings::is_described;
use super::nodes::{self, GROUP, INTEGRATOR, Images, LIGHT, MATERIAL_NODE, MeshCache, PROTOTYPE};
use super::report::{Message, Report};
use super::syntax::{self, Node};
use super::validate::Validator;
use crate::assets::Assets;
use crate::import::DEFAULT_SAMPLING;
use canaletto::Named;
use canaletto::integrator::describe;
use canaletto::material::Material;
use canaletto::math::Rgb;
use canaletto::scene::{self, Content, Integrator, Sampling, Scene, Stage, View};
use canaletto::shape::Shape;
use names::Names;
pub(crate) use roll::Neighbours;
use std::collections::HashMap;
use surfaces::each_surface;
pub(crate) use transform::TransformReader;
use without_lights::Black;

/// Decodes the scene of these nodes; `None` after a mistake, which is in the report. `numbers` are the named numbers of
/// the scene, for repeats.
pub(crate) fn decode(
    nodes: &[Node],
    numbers: &[f64],
    files: &Files,
    assets: &dyn Assets,
    report: Report,
    keep: &mut FrameCache,
    neighbours: &Neighbours,
) -> (Option<Scene>, Report) {
    let mut validator = Validator::new(files, report);
    let names = Names::collect(nodes, &mut validator);
    let mut decoder = Decoder::new(validator, assets, names, keep, neighbours);
    decoder.numbers = numbers.to_vec();
    decoder.scene.prototypes = vec![scene::Node::new(Content::Group(Vec::new())); decoder.names.slots()];
    decoder.textures(nodes);
    decoder.materials(nodes);
    decoder.scene.film.sampling = default_sampling(nodes);
    decoder.settings(nodes);
    let objects = || nodes.iter().filter(|node| nodes::is_object(&node.name));
    let count = |node: &Node| node.packed.map_or(1, |packed| usize::from(packed.get()));
    decoder.scene.nodes.reserve_exact(objects().map(count).sum());
    for node in objects() {
        let unpacked = node.packed.map(|_| syntax::unpack(node, files.slice(node.span)));
        for node in unpacked.as_deref().unwrap_or(std::slice::from_ref(node)) {
            let mut decoded = std::mem::take(&mut decoder.scene.nodes);
            decoder.objects(node, &mut decoded);
            decoder.scene.nodes = decoded;
        }
    }
    for node in nodes.iter().filter(|node| !nodes::is_object(&node.name) && !nodes::is_setting(&node.name)) {
        decoder.validator.unknown_node(node);
    }
    if !decoder.validator.report.has_errors() {
        decoder.warn(nodes);
    }
    (decoder.valid.then_some(decoder.scene), decoder.validator.report)
}

/// The sampling of a scene that says nothing of it.
fn default_sampling(nodes: &[Node]) -> Sampling {
    let integrator = nodes.iter().rev().find(|node| *node.name == *INTEGRATOR.name);
    let kind = integrator.and_then(|node| node.values.first()?.as_text());
    describe(&kind.and_then(Integrator::from_name).unwrap_or_default()).default_sampling(DEFAULT_SAMPLING)
}

/// The cameras of these nodes, as far as they are valid; mistakes in them are not reported.
pub(crate) fn views(nodes: &[Node], files: &Files, assets: &dyn Assets) -> Vec<View> {
    let mut validator = Validator::new(files, Report::default());
    let names = Names::collect(nodes, &mut validator);
    let mut keep = FrameCache::new(false);
    let mut decoder = Decoder::new(validator, assets, names, &mut keep, &|_| Vec::new());
    decoder.settings(nodes);
    decoder.scene.views
}

/// Decodes nodes over a scene: each of them changes the fields that it has. Materials and lights without a field from
/// another file than `own` are left as they are. The nodes of materials are in the order of the scene's materials, and
/// those of lights in the order of its described lights.
pub(crate) fn override_scene(
    scene: Scene,
    nodes: &[Node],
    own: Option<u16>,
    files: &Files,
    assets: &dyn Assets,
    report: Report,
) -> (Option<Scene>, Report) {
    let mut keep = FrameCache::new(false);
    let mut decoder = Decoder::new(Validator::new(files, report), assets, Names::default(), &mut keep, &|_| Vec::new());
    decoder.scene = scene;
    decoder.settings(nodes);
    let is_changed = |node: &Node| node.children.iter().any(|child| Some(child.name_span.file) != own);
    let materials = nodes.iter().filter(|node| *node.name == *MATERIAL_NODE.name);
    for (index, node) in materials.enumerate().filter(|(_, node)| is_changed(node)) {
        decoder.override_material(node, index);
    }
    let described = decoder.scene.nodes.iter().enumerate().filter(|(_, node)| is_described(node));
    let described: Vec<usize> = described.map(|(index, _)| index).collect();
    let lights = nodes.iter().filter(|node| *node.name == *LIGHT);
    for (node, index) in lights.zip(described).filter(|(node, _)| is_changed(node)) {
        match decoder.light(node) {
            Some(light) => decoder.scene.nodes[index] = light,
            None => decoder.valid = false,
        }
    }
    (decoder.valid.then_some(decoder.scene), decoder.validator.report)
}

pub(crate) struct Decoder<'a> {
    pub(super) validator: Validator<'a>,
    pub(super) assets: &'a dyn Assets,
    pub(super) scene: Scene,
    /// The index of each texture of the scene text in the scene's list.
    pub(super) textures: HashMap<&'a str, u32>,
    pub(super) images: Images,
    /// The index of each material of the scene text in the scene's list.
    pub(super) materials: HashMap<&'a str, u32>,
    /// Whether each material is used.
    pub(super) used: Vec<bool>,
    pub(super) names: Names<'a>,
    pub(super) meshes: MeshCache,
    /// The named numbers of the scene and of the repeats around the present node.
    pub(super) numbers: Vec<f64>,
    /// The number of copies that repeats have made so far.
    pub(super) copies: u64,
    /// The cache that frames share.
    pub(super) keep: &'a mut FrameCache,
    pub(super) neighbours: &'a Neighbours<'a>,
    /// Whether the scene is valid so far.
    pub(super) valid: bool,
}

impl<'a> Decoder<'a> {
    fn new(
        validator: Validator<'a>,
        assets: &'a dyn Assets,
        names: Names<'a>,
        keep: &'a mut FrameCache,
        neighbours: &'a Neighbours<'a>,
    ) -> Decoder<'a> {
        Decoder {
            validator,
            assets,
            scene: Scene::default(),
            textures: HashMap::new(),
            images: Images::default(),
            materials: HashMap::new(),
            used: Vec::new(),
            names,
            meshes: HashMap::new(),
            numbers: Vec::new(),
            copies: 0,
            keep,
            neighbours,
            valid: true,
        }
    }
}

impl Decoder<'_> {
    /// Warns of scenes that are valid, but hardly intended.
    fn warn(&mut self, nodes: &[Node]) {
        let has = |light: bool| {
            // Lights in prototypes shine where they are instanced.
            let all = [REPEAT.name, GROUP.schema.name, PROTOTYPE.schema.name];
            let within = if light { &all[..] } else { &all[..2] };
            nodes.iter().any(|node| any(node, within, &|n| if light { &*n.name == LIGHT } else { is_thing(&n.name) }))
        };
        if !has(false) {
            let message = Message::warning(None, "the scene has no objects");
            self.validator.report.push(message.help("add one, for example: sphere { center 0 0 0; radius 1 }"));
        } else if !has(true) {
            self.warn_of_black_surfaces();
        }
        self.warn_of_open_bodies(nodes);
        // An included file of materials has more of them than one scene needs.
        for node in nodes.iter().filter(|node| *node.name == *MATERIAL_NODE.name && node.name_span.file == 0) {
            let Some(value) = node.values.first() else { continue };
            let index = value.as_text().and_then(|name| self.materials.get(name));
            if index.is_some_and(|i| !self.used[*i as usize]) {
                let name = value.as_text().unwrap_or_default();
                self.validator
                    .report
                    .push(Message::warning(Some(value.span), format!("nothing uses the material \"{name}\"")));
            }
        }
    }
}

impl Decoder<'_> {
    /// Warns of what should fill a shape that isn't closed.
    fn warn_of_open_bodies(&mut self, nodes: &[Node]) {
        let fills = |material: &Material| {
            material.standard().is_none() && !material.medium.is_vacuum() && !material.is_opaque()
        };
        if !self.scene.materials.iter().any(fills) {
            return;
        }
        let mut open: Vec<Option<&Shape>> = vec![None; self.scene.materials.len()];
        each_surface(&self.scene, &mut |content, material| {
            if let (Content::Shape(shape), Some(index)) = (content, material)
                && !shape.is_closed()
                && let Some(place) = open.get_mut(index as usize)
            {
                place.get_or_insert(shape);
            }
        });
        for node in nodes.iter().filter(|node| *node.name == *MATERIAL_NODE.name) {
            let Some(value) = node.values.first() else { continue };
            let index = value.as_text().and_then(|name| self.materials.get(name)).map(|index| *index as usize);
            let Some((index, shape)) = index.and_then(|index| Some((index, open[index]?))) else { continue };
            if fills(&self.scene.materials[index]) {
                let message =
                    format!("absorption and media fill closed bodies only, and a {} here isn't closed", shape.kind());
                let help = "closed are spheres, boxes, tori, cylinders and cones with caps, and meshes without holes";
                self.validator.report.push(Message::warning(Some(value.span), message).help(help));
            }
        }
    }

    /// Warns of surfaces that are black, in a scene without lights.
    fn warn_of_black_surfaces(&mut self) {
        if describe(&self.scene.integrator).traces_paths() {
            return self.warn_of_darkness();
        }
        let is_lit = self.scene.environment.as_ref().is_some_and(|around| around.ambient || around.has_sun());
        let stage = describe(&self.scene.integrator).whitted().map_or(Stage::Unlit, |settings| settings.stage);
        if is_lit || self.scene.ambient != Rgb::BLACK || stage == Stage::Unlit {
            return;
        }
        match Black::of(&self.scene, stage) {
            Black { not_all: false, .. } => self.tell_black("everything in it is"),
            // What takes emission for a light is told once the world is built.
            Black { some: true, emits: false, .. } => self.tell_black("surfaces that only reflect light are"),
            _ => {}
        }
    }

    /// Warns of a scene in which paths find no light: nothing emits, and nothing shines around it.
    fn warn_of_darkness(&mut self) {
        let is_dark = self.scene.environment.is_none() && self.scene.background == Rgb::BLACK;
        if is_dark && !Black::of(&self.scene, Stage::Full).not_all {
            self.tell_black("everything in it is");
        }
    }

    fn tell_black(&mut self, black: &str) {
        let message = Message::warning(None, format!("the scene has no lights, so {black} black"));
        self.validator.report.push(message.help("for example: light \"omni\" { position 40 120 0 }"));
    }
}

fn is_thing(name: &str) -> bool {
    ![LIGHT, REPEAT.name, GROUP.schema.name, PROTOTYPE.schema.name].contains(&name) && nodes::is_object(name)
}

/// Whether `test` holds for the node, or for any node inside nodes that are named in `within`.
fn any(node: &Node, within: &[&str], test: &dyn Fn(&Node) -> bool) -> bool {
    test(node) || (within.contains(&&*node.name) && node.children.iter().any(|child| any(child, within, test)))
}
