//! Wavefront OBJ with a material library and the pictures that it names.

use super::lost::Lost;
use super::names::Names;
use super::pictures;
use super::triangles::{Placed, color_of, placed};
use super::{Conversion, ConvertedFile, Source, lose_surroundings};
use crate::picture::SOFTWARE;
use canaletto::material::{
    Channel, Mapping, Material, MaterialModel, Parameter, Phong, Projection, StandardSurface, Target, TextureUse,
};
use canaletto::math::Rgb;
use canaletto::scene::Scene;
use canaletto::texture::{TextureKind, Wrap};
use glam::{DVec2, DVec3, Vec2};
use std::collections::{BTreeSet, HashMap};
use std::fmt::Write;

/// The files of a scene.
pub(super) fn convert(source: &Source) -> Conversion {
    let scene = source.scene;
    let mut lost = Lost::default();
    lose_surroundings(scene, &mut lost);
    scene.views.iter().for_each(|view| lost.add("cameras", &view.name));
    let meshes = placed(scene, &mut lost);
    let used: BTreeSet<Option<u32>> = meshes
        .iter()
        .flat_map(|mesh| mesh.materials.iter().copied())
        .filter(|material| material.is_some() || source.has_default_material)
        .collect();
    let mut names = Names::default();
    let name_of = |index: Option<u32>| index.and_then(|index| scene.materials.get(index as usize));
    let known: HashMap<Option<u32>, String> = used
        .iter()
        .map(|index| {
            let name = name_of(*index).map_or("default", |material| material.name.as_str());
            (*index, names.unique(&word(name), "material"))
        })
        .collect();
    let mut library = Library { source, lost, pictures: HashMap::new(), names: Names::default(), files: Vec::new() };
    let mut text = format!("# {SOFTWARE}\n");
    for index in &used {
        let default = Material::default();
        let material = name_of(*index).unwrap_or(&default);
        library.material(material, &known[index], &mut text);
    }
    let Library { lost, files: pictures, .. } = library;
    let model = model(source, &meshes, &known);
    let mut files = vec![
        ConvertedFile { name: format!("{}.obj", source.stem), bytes: model.into_bytes() },
        ConvertedFile { name: format!("{}.mtl", source.stem), bytes: text.into_bytes() },
    ];
    files.extend(pictures);
    Conversion { files, lost: lost.all }
}

/// A name without blanks, which end one.
fn word(name: &str) -> String {
    name.chars().map(|c| if c.is_whitespace() || c.is_control() || c == '#' { '_' } else { c }).collect()
}

fn line_of(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
}

fn model(source: &Source, meshes: &[Placed], names: &HashMap<Option<u32>, String>) -> String {
    let mut text = format!("# {SOFTWARE}\nmtllib {}.mtl\n", line_of(source.stem));
    let (mut vertex, mut uv, mut normal) = (1u64, 1u64, 1u64);
    let has_colors = meshes.iter().any(|placed| placed.mesh.colors.iter().any(|color| *color != Rgb::WHITE));
    for placed in meshes {
        let mesh = &placed.mesh;
        let _ = writeln!(text, "o {}", line_of(&placed.name));
        let is_far = mesh.origin != DVec3::ZERO;
        // Vertices without a colour would be white beside others.
        let own = color_of(source.scene, placed.materials.first().copied().flatten());
        for (i, p) in placed.positions().enumerate() {
            let _ = match is_far {
                true => write!(text, "v {} {} {}", p.x, p.y, p.z),
                false => {
                    let p = p.as_vec3();
                    write!(text, "v {} {} {}", p.x, p.y, p.z)
                }
            };
            if let Some(Rgb { r, g, b }) = has_colors.then(|| mesh.colors.get(i).copied().unwrap_or(own)) {
                let _ = write!(text, " {r} {g} {b}");
            }
            text.push('\n');
        }
        for at in &mesh.uvs {
            uv_line(*at, &mut text);
        }
        for n in placed.normals() {
            let _ = writeln!(text, "vn {} {} {}", n.x, n.y, n.z);
        }
        let corner = |v: u32, uv: u64| {
            let v = u64::from(v);
            match (mesh.uvs.is_empty(), mesh.normals.is_empty()) {
                (true, true) => format!("{}", v + vertex),
                (false, true) => format!("{}/{}", v + vertex, v + uv),
                (true, false) => format!("{}//{}", v + vertex, v + normal),
                (false, false) => format!("{}/{}/{}", v + vertex, v + uv, v + normal),
            }
        };
        let mut next_uv = uv + mesh.uvs.len() as u64;
        if mesh.normals.is_empty() {
            text += "s off\n";
        }
        for (slot, material) in placed.materials.iter().enumerate() {
            let mut triangles = placed.triangles(slot as u32).peekable();
            if let Some(name) = names.get(material).filter(|_| triangles.peek().is_some()) {
                let _ = writeln!(text, "usemtl {name}");
            }
            // The material's textures have a place of their own.
            let moved = material.and_then(|index| source.scene.materials.get(index as usize));
            let moved = moved.and_then(|material| common_mapping(source.scene, material)).filter(is_moved);
            let mut uv = uv;
            if let Some(mapping) = moved.filter(|_| triangles.peek().is_some()) {
                let set = (mapping.uv_set as usize).checked_sub(1).and_then(|set| mesh.more_uvs.get(set));
                let set = set.unwrap_or(&mesh.uvs);
                set.iter().for_each(|at| uv_line(mapped(&mapping, *at), &mut text));
                uv = next_uv;
                next_uv += set.len() as u64;
            }
            for [a, b, c] in triangles {
                let _ = writeln!(text, "f {} {} {}", corner(a, uv), corner(b, uv), corner(c, uv));
            }
        }
        vertex += mesh.positions.len() as u64;
        uv = next_uv;
        normal += mesh.normals.len() as u64;
    }
    text
}

/// Texture coordinates, whose v is counted from the lower edge there.
fn uv_line(at: Vec2, text: &mut String) {
    let _ = writeln!(text, "vt {} {}", at.x, 1.0 - at.y);
}

/// Whether a mapping changes coordinates.
fn is_moved(mapping: &Mapping) -> bool {
    !mapping.transform.is_identity() || mapping.repeat.0 != [1.0; 2] || mapping.uv_set != 0
}

/// Coordinates after a mapping.
fn mapped(mapping: &Mapping, at: Vec2) -> Vec2 {
    let (u, v) = (f64::from(at.x), f64::from(at.y));
    let at = mapping.transform.inverse().point(DVec3::new(u - 0.5, 0.5 - v, 0.0));
    let [along_u, along_v] = mapping.repeat.0;
    DVec2::new((at.x + 0.5) * along_u, (0.5 - at.y) * along_v).as_vec2()
}

/// The place that all pictures on a material have, if it is one.
fn common_mapping(scene: &Scene, material: &Material) -> Option<Mapping> {
    let is_picture = |used: &&TextureUse| {
        let kind = scene.textures.get(used.texture as usize).map(|texture| &texture.kind);
        matches!(kind, Some(TextureKind::Image(_))) && used.mapping.projection == Projection::Uv
    };
    let mut mappings = material.textures.iter().filter(is_picture).map(|used| used.mapping);
    let first = mappings.next()?;
    mappings.all(|mapping| mapping == first).then_some(first)
}

/// A material library that is being written.
struct Library<'a> {
    source: &'a Source<'a>,
    lost: Lost,
    pictures: HashMap<u32, Option<String>>,
    names: Names,
    files: Vec<ConvertedFile>,
}

fn rgb(Rgb { r, g, b }: Rgb) -> String {
    format!("{r} {g} {b}")
}

impl Library<'_> {
    fn material(&mut self, material: &Material, name: &str, text: &mut String) {
        let _ = writeln!(text, "\nnewmtl {name}");
        match &material.model {
            MaterialModel::Standard(surface) => self.standard(material, surface, text),
            _ => self.phong(material, &material.classic(), text),
        }
        if material.coverage < 1.0 {
            let _ = writeln!(text, "d {}", material.coverage);
        }
        for used in &material.textures {
            self.texture(material, used, text);
        }
        let lost = [
            (material.alpha_cutoff.is_some(), "cutoffs of alpha"),
            (!material.medium.is_vacuum(), "media of clear bodies"),
            (material.priority != 0.0, "priorities of bodies that overlap"),
            (matches!(material.model, MaterialModel::Conductor(_)), "measured metals"),
        ];
        lost.iter().filter(|(is_lost, _)| *is_lost).for_each(|(_, what)| self.lost.add(what, &material.name));
    }

    fn phong(&mut self, material: &Material, phong: &Phong, text: &mut String) {
        let Phong { kd, ks, n, k, eta, opacity, roughness, emission } = *phong;
        let _ = writeln!(text, "Kd {}\nKs {}\nNs {n}", rgb(kd), rgb(if k.is_black() { ks } else { k }));
        if !emission.is_black() {
            let _ = writeln!(text, "Ke {}", rgb(emission));
        }
        let illum = if opacity < 1.0 {
            let _ = writeln!(text, "Ni {eta}\nd {opacity}");
            7
        } else if !k.is_black() {
            3
        } else {
            2
        };
        let _ = writeln!(text, "illum {illum}");
        if roughness > 0.0 {
            self.lost.add("roughness of mirrors", &material.name);
        }
    }

    fn standard(&mut self, material: &Material, surface: &StandardSurface, text: &mut String) {
        let StandardSurface { base, specular, transmission, coat, fuzz, .. } = surface;
        let color = base.color * base.weight;
        let _ = writeln!(text, "Kd {}", rgb(color));
        // What programs without the numbers of physics draw.
        let width = specular.roughness.max(0.03) * specular.roughness.max(0.03);
        let exponent = (2.0 / (width * width) - 2.0).clamp(1.0, 1000.0);
        let _ = writeln!(text, "Ks 0.04 0.04 0.04\nNs {exponent}");
        let _ = writeln!(text, "Pr {}\nPm {}", specular.roughness, base.metalness);
        if coat.weight > 0.0 {
            let _ = writeln!(text, "Pc {}\nPcr {}", coat.weight, coat.roughness);
        }
        if fuzz.weight > 0.0 {
            let _ = writeln!(text, "Ps {}", fuzz.weight);
        }
        if specular.anisotropy > 0.0 {
            let _ = writeln!(text, "aniso {}\nanisor {}", specular.anisotropy, specular.anisotropy_rotation / 360.0);
        }
        let emission = surface.emission.color * surface.emission.radiance;
        if !emission.is_black() {
            let _ = writeln!(text, "Ke {}", rgb(emission));
        }
        match transmission.weight > 0.0 {
            true => {
                let _ = writeln!(text, "Ni {}\nd {}\nillum 7", specular.ior, 1.0 - transmission.weight);
            }
            false => text.push_str("illum 2\n"),
        }
        let lost = [
            (base.diffuse_roughness > 0.0, "the roughness of diffuse reflection"),
            (surface.subsurface.weight > 0.0, "translucence"),
            (surface.thin_film.weight > 0.0, "thin films"),
            (transmission.weight > 0.0 && transmission.color != Rgb::WHITE, "colours of clear bodies"),
            (coat.weight > 0.0 && coat.color != Rgb::WHITE, "colours of coats"),
            (fuzz.weight > 0.0 && fuzz.color != Rgb::WHITE, "colours of fuzz"),
        ];
        lost.iter().filter(|(is_lost, _)| *is_lost).for_each(|(_, what)| self.lost.add(what, &material.name));
    }

    fn texture(&mut self, material: &Material, used: &TextureUse, text: &mut String) {
        let scene = self.source.scene;
        let kind = scene.textures.get(used.texture as usize).map(|texture| &texture.kind);
        let TextureUse { target, channel, range, mapping, .. } = used;
        let word = match target {
            Target::Parameter(Parameter::Diffuse) => Some("map_Kd"),
            Target::Parameter(Parameter::Specular) => Some("map_Ks"),
            Target::Parameter(Parameter::Emission) => Some("map_Ke"),
            Target::Parameter(Parameter::Roughness) => Some("map_Pr"),
            Target::Standard(own) if own.word() == "metalness" => Some("map_Pm"),
            Target::Cutout => Some("map_d"),
            Target::Normal { down: false, .. } => Some("norm"),
            _ => None,
        };
        if matches!(kind, Some(TextureKind::VertexColor)) {
            return;
        }
        let (Some(word), Some(TextureKind::Image(image)), Projection::Uv) = (word, kind, mapping.projection) else {
            self.lost.add("textures that are computed, projected or for other numbers", &material.name);
            return;
        };
        // A place that all have stands in the coordinates.
        if is_moved(mapping) && common_mapping(scene, material).is_none() {
            self.lost.add("places of textures", &material.name);
        }
        let Some(file) = self.picture(image.image) else { return };
        let mut line = word.to_owned();
        match image.wrap {
            [Wrap::Repeat, Wrap::Repeat] => {}
            [Wrap::Clamp, Wrap::Clamp] => line.push_str(" -clamp on"),
            _ => self.lost.add("what is outside of pictures", &material.name),
        }
        if *range != [0.0, 1.0] && !matches!(target, Target::Normal { .. }) {
            let _ = write!(line, " -mm {} {}", range[0], range[1] - range[0]);
        }
        if let Target::Normal { strength, .. } = target
            && *strength != 1.0
        {
            let _ = write!(line, " -bm {strength}");
        }
        let letter = match channel {
            _ if target.takes_color() || matches!(target, Target::Normal { .. }) => None,
            Channel::Alpha => Some('m'),
            Channel::Max => {
                self.lost.add("the largest channels of pictures", &material.name);
                Some('l')
            }
            Channel::Luminance => Some('l'),
            Channel::Red => Some('r'),
            Channel::Green => Some('g'),
            Channel::Blue => Some('b'),
        };
        if let Some(letter) = letter {
            let _ = write!(line, " -imfchan {letter}");
        }
        let _ = writeln!(text, "{line} {file}");
    }

    /// The file of an image, as the library names it.
    fn picture(&mut self, index: u32) -> Option<String> {
        if let Some(known) = self.pictures.get(&index) {
            return known.clone();
        }
        let image = self.source.scene.images.get(index as usize)?;
        let made = pictures::encoded_for_screens(image, self.source.originals).map(|encoded| {
            if !encoded.is_exact {
                self.lost.add("exact numbers of pictures", &image.name);
            }
            let file = self.names.file(&word(&image.name), "picture", encoded.extension);
            let name = format!("{}.assets/{file}", self.source.stem);
            self.files.push(ConvertedFile { name: name.clone(), bytes: encoded.bytes });
            name
        });
        if made.is_none() {
            self.lost.add("pictures", &image.name);
        }
        self.pictures.insert(index, made.clone());
        made
    }
}
