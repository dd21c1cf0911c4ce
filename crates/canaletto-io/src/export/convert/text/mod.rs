//! Scene text with its meshes and pictures in a folder beside it. Reading it gives the scene again: the numbers are
//! written with as many digits as they need, meshes are GLB files, which hold `f32`, and pictures keep their bytes.

mod lights;
mod line;
mod materials;
mod number;
mod objects;
mod settings;
mod textures;
mod transform;

use super::lost::Lost;
use super::mesh_file;
use super::names::Names;
use super::pictures::{self, Originals};
use super::{Conversion, ConvertedFile, Source};
use canaletto::light::IesProfile;
use canaletto::material::{Material, Phong};
use canaletto::scene::{Content, Node, Scene};
use canaletto::shape::Mesh;
use canaletto::texture::ColorSpace;
use line::Line;
use std::collections::{BTreeSet, HashMap};

/// The files beside the text.
struct AssetFiles {
    /// The folder, as the text names it.
    folder: String,
    names: Names,
    files: Vec<ConvertedFile>,
}

impl AssetFiles {
    /// Adds a file; returns its path as the text names it.
    fn add(&mut self, name: &str, or: &str, extension: &str, bytes: Vec<u8>) -> String {
        let path = format!("{}/{}", self.folder, self.names.file(name, or, extension));
        self.files.push(ConvertedFile { name: path.clone(), bytes });
        path
    }
}

/// A scene that is being written.
struct Writer<'a> {
    scene: &'a Scene,
    originals: &'a Originals,
    assets: AssetFiles,
    lost: Lost,
    /// The names of objects.
    names: Names,
    material_names: Vec<String>,
    texture_names: Vec<Option<String>>,
    prototype_names: Vec<String>,
    /// Whether each prototype stands where an object of its name does.
    in_place: Vec<bool>,
    /// Which of those were written.
    written: BTreeSet<u32>,
    pictures: HashMap<u32, Option<(String, Option<ColorSpace>)>>,
    meshes: HashMap<Vec<u32>, Option<String>>,
    profiles: Vec<(IesProfile, String)>,
    /// The name of the material of what has none, where it had to be written.
    default_material: Option<String>,
}

/// The files of a scene as scene text.
pub(super) fn convert(source: &Source) -> Conversion {
    let scene = source.scene;
    let mut writer = Writer {
        scene,
        originals: source.originals,
        assets: AssetFiles { folder: format!("{}.assets", source.stem), names: Names::default(), files: Vec::new() },
        lost: Lost::default(),
        names: Names::default(),
        material_names: unique(scene.materials.iter().map(|material| material.name.as_str()), "material"),
        texture_names: unique(scene.textures.iter().map(|texture| short(&texture.name)), "texture")
            .into_iter()
            .map(Some)
            .collect(),
        prototype_names: Vec::new(),
        in_place: vec![false; scene.prototypes.len()],
        written: BTreeSet::new(),
        pictures: HashMap::new(),
        meshes: HashMap::new(),
        profiles: Vec::new(),
        default_material: None,
    };
    writer.name_prototypes();
    let text = writer.text(&source.remarks);
    let mut files = vec![ConvertedFile { name: format!("{}.kdl", source.stem), bytes: text.into_bytes() }];
    files.append(&mut writer.assets.files);
    Conversion { files, lost: writer.lost.all }
}

fn unique<'n>(list: impl Iterator<Item = &'n str>, or: &str) -> Vec<String> {
    let mut names = Names::default();
    list.map(|name| names.unique(name, or)).collect()
}

/// The name of a texture without the folders and the ending of the file that it may come from.
fn short(name: &str) -> &str {
    let file = name.rsplit('/').next().unwrap_or_default();
    match file.rsplit_once('.') {
        Some((stem, ending)) if Originals::EXTENSIONS.contains(&ending) && !stem.is_empty() => stem,
        _ => name,
    }
}

impl Writer<'_> {
    fn text(&mut self, remarks: &[String]) -> String {
        let mut text = String::new();
        for remark in remarks {
            let remark: String = remark.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
            text += &format!("// {remark}\n");
        }
        let settings = self.settings();
        let materials = used_materials(self.scene);
        let textures: BTreeSet<u32> = materials
            .iter()
            .filter_map(|index| self.scene.materials.get(*index as usize))
            .flat_map(|material| material.textures.iter().map(|used| used.texture))
            .collect();
        let mut texture_lines = Vec::new();
        for index in textures {
            match self.texture(index) {
                Some(line) => texture_lines.push(line),
                None => {
                    if let Some(name) = self.texture_names.get_mut(index as usize).and_then(Option::take) {
                        self.lost.add("textures", &name);
                    }
                }
            }
        }
        let mut material_lines: Vec<Line> = materials.into_iter().filter_map(|index| self.material(index)).collect();
        let prototypes = self.prototypes();
        let scene = self.scene;
        let nodes = self.nodes(&scene.nodes, None, true);
        material_lines.extend(self.default_material.as_ref().map(|name| Line::named("material", name)));
        for block in [settings, texture_lines, material_lines, prototypes, nodes] {
            if !block.is_empty() && !text.is_empty() {
                text.push('\n');
            }
            block.iter().for_each(|line| line.write(0, &mut text));
        }
        text
    }

    /// Finds which prototypes stand in place, and names all.
    fn name_prototypes(&mut self) {
        let scene = self.scene;
        let mut left: Vec<&Node> = scene.nodes.iter().chain(&scene.prototypes).collect();
        let mut repeated: Vec<Option<&str>> = vec![None; scene.prototypes.len()];
        while let Some(node) = left.pop() {
            match &node.content {
                Content::Group(children) => left.extend(children),
                Content::Instance(index) if (*index as usize) < scene.prototypes.len() => {
                    repeated[*index as usize] = repeated[*index as usize].or(node.name.as_deref());
                    if objects::is_original(node, &scene.prototypes, *index) {
                        self.in_place[*index as usize] = true;
                    }
                }
                _ => {}
            }
        }
        for (prototype, repeated) in scene.prototypes.iter().zip(repeated) {
            let name = prototype.name.as_deref().or(repeated).unwrap_or_default();
            let name = self.names.unique(name, "prototype");
            self.prototype_names.push(name);
        }
    }

    /// Whether a prototype that stands in place is met for the first time.
    fn first_place(&mut self, index: u32) -> bool {
        self.written.insert(index)
    }

    fn material_name(&self, index: u32) -> String {
        self.material_names.get(index as usize).cloned().unwrap_or_default()
    }

    /// The name of a texture that is written.
    fn texture_name(&self, index: u32) -> Option<String> {
        self.texture_names.get(index as usize).cloned().flatten()
    }

    /// The number of a material for what has none, which stands behind all others.
    fn default_material(&mut self) -> u32 {
        if self.default_material.is_none() {
            let mut taken = Names::default();
            self.material_names.iter().for_each(|name| _ = taken.take(name));
            let name = taken.unique("default", "default");
            self.material_names.push(name.clone());
            self.default_material = Some(name);
            debug_assert_eq!(Material::default().model, Phong::default().into());
        }
        self.material_names.len() as u32 - 1
    }

    /// The file of an image, as the text names it.
    fn picture(&mut self, index: u32) -> Option<String> {
        if let Some(known) = self.pictures.get(&index) {
            return known.clone().map(|(file, _)| file);
        }
        let image = self.scene.images.get(index as usize)?;
        let made = pictures::encoded(image, self.originals).map(|encoded| {
            if !encoded.is_exact {
                self.lost.add("exact numbers of pictures", &image.name);
            }
            // Files of numbers are on the sRGB curve or linear, whatever the image is.
            let usual = if encoded.extension == "png" { ColorSpace::Srgb } else { ColorSpace::Linear };
            let is_own = self.originals.bytes_of(image).is_some();
            let space = (!is_own && image.space != usual).then_some(image.space);
            (self.assets.add(&image.name, "picture", encoded.extension, encoded.bytes), space)
        });
        if made.is_none() {
            self.lost.add("pictures", &image.name);
        }
        self.pictures.insert(index, made.clone());
        made.map(|(file, _)| file)
    }

    /// The colour space of an image that its new file doesn't tell.
    fn lost_space(&self, index: u32) -> Option<ColorSpace> {
        self.pictures.get(&index).cloned().flatten().and_then(|(_, space)| space)
    }

    /// The file of a mesh, and the slots of its parts.
    fn mesh_file(&mut self, index: u32) -> Option<(String, Vec<u32>)> {
        let mesh = self.scene.meshes.get(index as usize)?;
        Some((self.mesh_files(&[index])?, mesh_file::used_slots(mesh)))
    }

    /// The file of some meshes.
    fn mesh_files(&mut self, indices: &[u32]) -> Option<String> {
        if let Some(known) = self.meshes.get(indices) {
            return known.clone();
        }
        let meshes: Vec<&Mesh> = indices.iter().filter_map(|index| self.scene.meshes.get(*index as usize)).collect();
        let name = &meshes.first()?.name;
        let file = mesh_file::glb(&meshes).map(|bytes| self.assets.add(name, "mesh", "glb", bytes));
        if file.is_none() {
            self.lost.add("meshes", name);
        }
        self.meshes.insert(indices.to_vec(), file.clone());
        file
    }

    /// The file of a lamp's profile.
    fn profile_file(&mut self, profile: &IesProfile) -> Option<String> {
        if let Some((_, file)) = self.profiles.iter().find(|(known, _)| known == profile) {
            return Some(file.clone());
        }
        let (name, bytes) = self.originals.profile(profile)?;
        let file = self.assets.add(&name, "lamp", "ies", bytes);
        self.profiles.push((profile.clone(), file.clone()));
        Some(file)
    }
}

/// The materials that surfaces have, in their order.
fn used_materials(scene: &Scene) -> BTreeSet<u32> {
    let mut used = BTreeSet::new();
    let mut left: Vec<&Node> = scene.nodes.iter().chain(&scene.prototypes).collect();
    while let Some(node) = left.pop() {
        used.extend(node.material);
        match &node.content {
            Content::Group(children) => left.extend(children),
            Content::Mesh(index) if node.material.is_none() => {
                let mesh = scene.meshes.get(*index as usize);
                used.extend(mesh.into_iter().flat_map(|mesh| {
                    let slots = mesh_file::used_slots(mesh);
                    slots.into_iter().filter_map(|slot| mesh.materials.get(slot as usize).copied())
                }));
            }
            _ => {}
        }
    }
    used
}
