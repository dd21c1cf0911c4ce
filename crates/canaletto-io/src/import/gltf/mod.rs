//! glTF 2.0 (Khronos, 2021) and GLB, with extensions.
//!
//! A document is JSON: [`schema`] names what is read of it. Its bytes come from [`buffers`], which [`meshopt`] decodes
//! where they are compressed, and [`accessor`] checks them once. Compressed primitives have a stream in place of some
//! accessors ([`draco`]). [`animation`] changes the document to that of a moment. [`primitive`] makes meshes, and
//! clouds of points and lines, in the pose that [`deform`] gives. [`material`] maps materials to the standard surface,
//! [`scene`] places all. [`rules`] warns of what breaks the specification.
//!
//! Coordinates are glTF's: y is up, +z is the front, lengths are in metres, colours linear. Lights in candela and lux
//! keep their numbers: 1 lux on a white matte surface is the radiance 1/π.

mod accessor;
mod animation;
mod buffers;
mod container;
mod deform;
mod draco;
mod extensions;
mod fault;
mod material;
mod meshopt;
mod primitive;
mod rules;
mod scene;
mod schema;
mod tangents;
#[cfg(test)]
mod tests;
mod texture;

use super::{Holds, ModelFormat, Moment, ReadFragment, ReadOptions, UpAxis, precision_warning, unreadable};
use crate::assets::{AssetPath, Assets, OpenAsset};
use crate::diagnostic::{Diagnostic, Diagnostics};
use accessor::Accessors;
use buffers::{Buffers, Files};
use canaletto::scene::Fragment;
use container::Container;
use fault::Fault;
use material::Materials;
use rules::Rules;
use scene::SceneReader;
use schema::Document;
use texture::Textures;

/// glTF in the table of formats.
pub(super) const FORMAT: ModelFormat = ModelFormat {
    name: "glTF",
    extensions: &["glb", "gltf"],
    holds: Holds::Objects,
    up: UpAxis::Y,
    read: read_model,
    duration: Some(duration),
};

/// The most warnings about a file that are told one by one.
const MAX_TOLD: usize = 20;

fn read_model(asset: &OpenAsset, assets: &dyn Assets, options: &ReadOptions) -> ReadFragment {
    let file = asset.path.name();
    let bytes = asset.content.view().whole().map_err(|e| unreadable(&e).error(file))?;
    let mut warnings = Vec::new();
    let (fragment, unsaid) = read(&bytes, Files { assets, from: &asset.path }, options, &mut warnings);
    let mut told = Diagnostics::new();
    let more = warnings.len().saturating_sub(MAX_TOLD) + unsaid;
    warnings.into_iter().take(MAX_TOLD).for_each(|fault| told.push(fault.warning(file)));
    if more > 0 {
        told.push(Diagnostic::warning(file, format!("there are {more} more warnings about it")));
    }
    match fragment {
        Ok(fragment) => {
            let precision = precision_warning::Precision::Single;
            let rounded = fragment.meshes.iter().find_map(|mesh| precision_warning::mesh(mesh, precision));
            rounded.into_iter().for_each(|complaint| told.push(complaint.warning(file)));
            Ok((fragment, told))
        }
        Err(fault) => {
            told.push(fault.error(file));
            Err(told)
        }
    }
}

/// The length in seconds of the clip of this name, or of the first clip; none if nothing is animated.
fn duration(asset: &OpenAsset, assets: &dyn Assets, name: Option<&str>) -> Result<Option<f64>, Diagnostics> {
    let file = asset.path.name();
    let bytes = asset.content.view().whole().map_err(|e| unreadable(&e).error(file))?;
    let read = || {
        let Container { json, binary_chunk, .. } = container::open(&bytes, &mut Vec::new())?;
        let document = container::document(json)?;
        if document.animations.is_empty() && name.is_none() {
            return Ok(None);
        }
        let buffers = Buffers::new(&document, binary_chunk, Files { assets, from: &asset.path });
        let accessors = Accessors::new(&document, &buffers);
        animation::duration(&accessors, animation::clip(&document, name)?).map(Some)
    };
    read().map_err(|fault: Fault| fault.error(file).into())
}

/// Reads a file. Rules of the specification that it breaks are said last; the number of those that aren't said is
/// returned.
fn read(
    bytes: &[u8],
    files: Files,
    options: &ReadOptions,
    warnings: &mut Vec<Fault>,
) -> (Result<Fragment, Fault>, usize) {
    let container = match container::open(bytes, warnings) {
        Ok(container) => container,
        Err(fault) => return (Err(fault), 0),
    };
    // The frames of a film say nothing that the file itself doesn't say.
    let json: Option<rules::Value> = match options.moment {
        Some(_) => None,
        None => serde_json::from_str(container.json).ok(),
    };
    let mut rules = json.as_ref().map(Rules::of_json);
    let fragment = read_document(&container, files, options, rules.as_mut(), warnings);
    let unsaid = rules.map_or(0, |rules| rules.append_to(warnings, fragment.as_ref().err()));
    (fragment, unsaid)
}

fn read_document(
    container: &Container,
    files: Files,
    options: &ReadOptions,
    rules: Option<&mut Rules>,
    warnings: &mut Vec<Fault>,
) -> Result<Fragment, Fault> {
    let Container { json, binary_chunk, is_binary } = *container;
    let mut document = container::document(json)?;
    extensions::check(&document, warnings)?;
    if let Some(moment) = &options.moment {
        document = at_moment(&document, json, moment, (binary_chunk, files), warnings)?;
    }
    let buffers = Buffers::new(&document, binary_chunk, files);
    if let Some(rules) = rules {
        rules.check_data(&Accessors::new(&document, &buffers), is_binary);
    }
    let accessors = Accessors::new(&document, &buffers);
    let materials = Materials::new(&document, Textures::new(&document, &buffers));
    let variant = variant(&document, options.variant.as_deref())?;
    let mut reader = SceneReader::new(&document, &accessors, materials, variant, std::mem::take(warnings));
    let result = reader.read();
    let SceneReader { mut fragment, materials, warnings: said, .. } = reader;
    *warnings = said;
    result?;
    fragment.materials = materials.list;
    (fragment.textures, fragment.images) = (materials.textures.textures, materials.textures.images);
    if fragment.nodes.is_empty() {
        return Err(Fault::new("its scene has no meshes").help("a model needs at least one node with a mesh"));
    }
    Ok(fragment)
}

/// The pictures that a file holds itself, in buffers and data URIs: their names and bytes. What can't be read is left
/// out.
pub(crate) fn pictures_in_gltf(bytes: &[u8], assets: &dyn Assets, from: &AssetPath) -> Vec<(String, Vec<u8>)> {
    let Ok(Container { json, binary_chunk, .. }) = container::open(bytes, &mut Vec::new()) else {
        return Vec::new();
    };
    let Ok(document) = container::document(json) else { return Vec::new() };
    let buffers = Buffers::new(&document, binary_chunk, Files { assets, from });
    let textures = Textures::new(&document, &buffers);
    let held = |index: usize| document.images[index].uri.as_ref().is_none_or(|uri| uri.starts_with("data:"));
    let all = (0..document.images.len()).filter(|index| held(*index));
    let assets = all.filter_map(|index| textures.asset(index as schema::Index).ok());
    assets.map(|asset| (asset.path.name().to_owned(), asset.bytes)).collect()
}

/// The document at a moment of a clip: all that the clip's channels change has their values.
fn at_moment(
    document: &Document,
    json: &str,
    moment: &Moment,
    (binary_chunk, files): (Option<&[u8]>, Files),
    warnings: &mut Vec<Fault>,
) -> Result<Document, Fault> {
    let buffers = Buffers::new(document, binary_chunk, files);
    let accessors = Accessors::new(document, &buffers);
    let clip = animation::clip(document, moment.clip.as_deref())?;
    let mut value: serde_json::Value = serde_json::from_str(json).map_err(|e| Fault::new(e.to_string()))?;
    for animated in animation::sample(&accessors, clip, moment.seconds)? {
        if !animation::set(&mut value, &animated) {
            let message = format!("its clip changes {}, which doesn't exist", animated.pointer);
            warnings.push(Fault::new(message).at(format!("/animations/{}", clip.0)));
        }
    }
    serde_path_to_error::deserialize(value).map_err(|e| Fault::of_json(&e))
}

/// The number of the variant of KHR_materials_variants with this name.
fn variant(document: &Document, name: Option<&str>) -> Result<Option<u32>, Fault> {
    let Some(name) = name else { return Ok(None) };
    let all = &document.extensions.variants.variants;
    match all.iter().position(|variant| variant.name == name) {
        Some(found) => Ok(Some(found as u32)),
        None if all.is_empty() => Err(Fault::new(format!("it has no variant \"{name}\", as it has no variants"))),
        None => {
            let names: Vec<&str> = all.iter().map(|variant| variant.name.as_str()).collect();
            Err(Fault::new(format!("it has no variant \"{name}\""))
                .help(format!("its variants are {}", names.join(", "))))
        }
    }
}
