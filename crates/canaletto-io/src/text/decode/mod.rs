//! The decoder from nodes to a [`Scene`]. It reports every mistake and continues with the next node.

mod cloud;
mod environment;
mod fields;
mod lens;
mod light;
mod mesh;
mod names;
mod object;
mod roll;
mod settings;
mod solid_texture;
mod surface_texture;
mod texture;
mod transform;
mod warnings;

use super::file_cache::FrameCache;
use super::files::Files;
use super::report::{Message, Report};
use super::syntax::{self, Node};
use crate::assets::Assets;
use canaletto::material::{Material, Target};
use canaletto::math::Rgb;
use canaletto::scene::{self, Content, Scene, Stage, View};
pub(crate) use fields::{Fields, Validator};
use names::Names;
pub(crate) use roll::Neighbours;
use std::collections::HashMap;

/// Decodes the scene of these nodes; `None` after a mistake, which is in the report.
pub(crate) fn decode(
    nodes: &[Node],
    files: &Files,
    assets: &dyn Assets,
    report: Report,
    keep: &mut FrameCache,
    neighbours: &Neighbours,
) -> (Option<Scene>, Report) {
    let mut validator = Validator::new(files, report);
    let names = Names::collect(nodes, &mut validator);
    let mut decoder = Decoder::new(validator, assets, names, keep, neighbours);
    decoder.scene.prototypes = vec![scene::Node::new(Content::Group(Vec::new())); decoder.names.slots()];
    decoder.textures(nodes);
    decoder.materials(nodes);
    decoder.settings(nodes);
    let objects = || nodes.iter().filter(|node| is_object(node));
    let count = |node: &Node| node.packed.map_or(1, |packed| usize::from(packed.get()));
    decoder.scene.nodes.reserve_exact(objects().map(count).sum());
    for node in objects() {
        let unpacked = node.packed.map(|_| syntax::unpack(node, files.slice(node.span)));
        for node in unpacked.as_deref().unwrap_or(std::slice::from_ref(node)) {
            let decoded = decoder.object(node);
            decoder.scene.nodes.extend(decoded);
        }
    }
    for node in nodes.iter().filter(|node| !is_object(node) && !settings::is_setting(node)) {
        decoder.validator.unknown_node(node);
    }
    if !decoder.validator.report.has_errors() {
        decoder.warn(nodes);
    }
    (decoder.valid.then_some(decoder.scene), decoder.validator.report)
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

struct Decoder<'a> {
    validator: Validator<'a>,
    assets: &'a dyn Assets,
    scene: Scene,
    /// The index of each texture of the scene text in the scene's list.
    textures: HashMap<&'a str, u32>,
    images: texture::Images,
    /// The index of each material of the scene text in the scene's list.
    materials: HashMap<&'a str, u32>,
    /// Whether each material is used.
    used: Vec<bool>,
    names: Names<'a>,
    meshes: mesh::Cache,
    /// The cache that frames share.
    keep: &'a mut FrameCache,
    neighbours: &'a Neighbours<'a>,
    /// Whether the scene is valid so far.
    valid: bool,
}

fn is_object(node: &Node) -> bool {
    super::schema::objects().any(|name| name == &*node.name)
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
            images: texture::Images::default(),
            materials: HashMap::new(),
            used: Vec::new(),
            names,
            meshes: HashMap::new(),
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
            let within: &[&str] = if light { &["group", "prototype"] } else { &["group"] };
            nodes.iter().any(|node| any(node, within, &|n| if light { &*n.name == "light" } else { is_thing(&n.name) }))
        };
        let lit = match &self.scene.environment {
            Some(environment) => environment.ambient || environment.has_sun(),
            None => false,
        };
        let dark = !lit
            && self.scene.ambient == Rgb::BLACK
            && self.scene.integrator.whitted().is_some_and(|settings| settings.stage > Stage::Unlit);
        if !has(false) {
            self.validator.report.push(Message::warning(None, "the scene has no objects"));
        } else if dark && !has(true) && !self.has_unlit_texture() {
            let message = Message::warning(None, "the scene has no lights, so everything in it is black");
            self.validator.report.push(message.help("for example: light \"omni\" { position 40 120 0 }"));
        }
        // An included file of materials has more of them than one scene needs.
        for node in nodes.iter().filter(|node| &*node.name == "material" && node.name_span.file == 0) {
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
    /// Whether any object may show the colours of an unlit texture, which needs no light.
    fn has_unlit_texture(&self) -> bool {
        let unlit = |material: &Material| {
            material.textures.iter().any(|texture| matches!(texture.target, Target::Replace | Target::Decal))
        };
        self.scene.materials.iter().zip(&self.used).any(|(material, used)| *used && unlit(material))
    }
}

fn is_thing(name: &str) -> bool {
    !matches!(name, "light" | "group" | "prototype") && super::schema::objects().any(|object| object == name)
}

/// Whether `test` holds for the node, or for any node inside nodes that are named in `within`.
fn any(node: &Node, within: &[&str], test: &dyn Fn(&Node) -> bool) -> bool {
    test(node) || (within.contains(&&*node.name) && node.children.iter().any(|child| any(child, within, test)))
}
