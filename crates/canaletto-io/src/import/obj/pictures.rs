//! The pictures of materials: images and textures, of which each file is read once.

use super::super::mtl::MtlMaterial;
use super::super::texture_map::{MapKind, TextureMap};
use super::Reader;
use super::library::{last_part, path_of};
use crate::assets::{Asset, AssetError, OpenAsset};
use crate::diagnostic::{Diagnostic, Diagnostics};
use crate::image::{MAX_IMAGE_BYTES, read_image};
use canaletto::Named;
use canaletto::material::{Channel, Mapping, Material, Parameter, Target, TextureUse};
use canaletto::texture::{ColorSpace, Image, ImageTexture, Samples, Texture, TextureKind, Wrap};
use std::collections::HashMap;
use std::path::PathBuf;

/// The largest number of pictures that are reported one by one.
const MAX_TOLD: usize = 20;

/// The pictures so far.
#[derive(Debug, Default)]
pub(super) struct Pictures {
    pub(super) images: Vec<Image>,
    pub(super) textures: Vec<Texture>,
    /// The image of each file; `None` if it can't be read.
    by_identity: HashMap<PathBuf, Option<u32>>,
    failed: usize,
}

impl Pictures {
    /// The texture of an image, which is added if there is none like it.
    fn texture(&mut self, image: ImageTexture) -> u32 {
        let kind = TextureKind::Image(image);
        if let Some(known) = self.textures.iter().position(|texture| texture.kind == kind) {
            return known as u32;
        }
        let name = self.images[image.image as usize].name.clone();
        self.textures.push(Texture { name, kind });
        self.textures.len() as u32 - 1
    }
}

/// The height of white in a `map_Bump` as a share of the model's size, times `-bm`. MTL doesn't say what its heights
/// are measured in.
const BUMP: f32 = 0.01;

/// The same of a `disp` without `-mm`, which gives heights in the model's unit.
const DISPLACEMENT: f32 = 0.02;

/// A target of the standard surface by its word.
fn standard(word: &str) -> Target {
    Target::from_name(word).unwrap_or(Target::Decal)
}

/// Whether a picture has the colours of normals: blue nearly everywhere, red and green around a half. Blender writes
/// normal maps as `map_Bump`.
fn shows_normals(image: &Image) -> bool {
    let (Samples::U8(data), 3 | 4) = (&image.samples, image.channels) else { return false };
    let channels = usize::from(image.channels);
    let mut sums = [0u64; 3];
    data.chunks_exact(channels).for_each(|texel| (0..3).for_each(|c| sums[c] += u64::from(texel[c])));
    let count = (data.len() / channels).max(1) as f64 * 255.0;
    let [r, g, b] = sums.map(|sum| sum as f64 / count);
    b > 0.75 && (0.35..0.65).contains(&r) && (0.35..0.65).contains(&g)
}

impl Reader<'_> {
    /// The material with its pictures. A picture that can't be read is a warning, and the material is without it.
    pub(super) fn with_pictures(
        &mut self,
        described: MtlMaterial,
        library: &OpenAsset,
        warnings: &mut Diagnostics,
    ) -> Material {
        let MtlMaterial { mut material, maps } = described;
        for map in maps {
            let Some(image) = self.image(&map, &material.name, library, warnings) else { continue };
            let (is_color, own) = (map.kind.is_color(), &self.pictures.images[image as usize]);
            let is_dissolve = map.kind == MapKind::Dissolve;
            let has_alpha = matches!(own.channels, 2 | 4) && (is_color || is_dissolve);
            let has_normals = map.kind == MapKind::Bump && shows_normals(own);
            let texture = ImageTexture {
                wrap: [if map.clamp { Wrap::Clamp } else { Wrap::Repeat }; 2],
                // The alpha of a colour picture counts, so only pictures without it are plain numbers.
                space: (!is_color && !has_alpha).then_some(ColorSpace::Raw),
                ..ImageTexture::new(image)
            };
            let texture = self.pictures.texture(texture);
            let Some(transform) = map.placement() else { continue };
            let mapping = Mapping { transform, ..Mapping::default() };
            let channel = map.channel.unwrap_or(if has_alpha { Channel::Alpha } else { Channel::Luminance });
            let is_standard = material.standard().is_some();
            let targets: &[Target] = match map.kind {
                // A surface with physical numbers has no other highlights.
                MapKind::Specular | MapKind::Exponent if is_standard => &[],
                MapKind::Dissolve if is_standard => &[Target::Cutout],
                MapKind::Diffuse => &[Target::Parameter(Parameter::Diffuse)],
                MapKind::Specular if !material.classic().k.is_black() => {
                    &[Target::Parameter(Parameter::Specular), Target::Parameter(Parameter::Mirror)]
                }
                MapKind::Specular => &[Target::Parameter(Parameter::Specular)],
                MapKind::Emission => &[Target::Parameter(Parameter::Emission)],
                MapKind::Dissolve if !material.is_opaque() => &[Target::Parameter(Parameter::Opacity)],
                MapKind::Dissolve => &[Target::Cutout],
                MapKind::Bump if !has_normals => &[Target::Bump],
                MapKind::Normal | MapKind::Bump => &[Target::Normal { strength: map.strength.max(0.0), down: false }],
                MapKind::Displacement => &[Target::Displace { detail: Target::DEFAULT_DETAIL }],
                MapKind::Exponent => &[Target::Parameter(Parameter::Exponent)],
                MapKind::Roughness => &[Target::Parameter(Parameter::Roughness)],
                MapKind::Metalness => &[standard("metalness")],
                MapKind::Sheen => &[standard("fuzz-weight")],
                MapKind::Coat => &[standard("coat-weight")],
                MapKind::CoatRoughness => &[standard("coat-roughness")],
            };
            let range = match map.kind {
                MapKind::Bump if !has_normals => map.range.map(|height| height * map.strength * BUMP * self.size),
                MapKind::Displacement if !map.has_range => map.range.map(|height| height * DISPLACEMENT * self.size),
                _ => map.range,
            };
            let multiply = map.multiplies;
            for target in targets {
                let used = TextureUse::new(texture, *target);
                material.textures.push(TextureUse { channel, range, multiply, mapping, ..used });
            }
        }
        material
    }

    /// The index of the image of a picture.
    fn image(
        &mut self,
        map: &TextureMap,
        material: &str,
        library: &OpenAsset,
        warnings: &mut Diagnostics,
    ) -> Option<u32> {
        let name = library.path.name();
        let about = |what: String| format!("`{}` of material `{material}`: {what}", map.word);
        let asset = match self.picture_file(&map.file, library) {
            Ok((asset, None)) => asset,
            Ok((asset, Some(error))) => {
                let help = format!("\"{}\" is read instead", asset.path.name());
                let warning = Diagnostic::warning(name, about(error.to_string())).at(map.span.clone());
                warnings.push(warning.help(help));
                asset
            }
            Err(error) => {
                let mut warning = Diagnostic::warning(name, about(error.to_string())).at(map.span.clone());
                warning.help = error.help();
                self.failed(warning, warnings);
                return None;
            }
        };
        let identity = asset.path.identity().to_owned();
        if let Some(known) = self.pictures.by_identity.get(&identity) {
            return *known;
        }
        let read = read_image(&asset).map_err(|error| (error.to_string(), error.help()));
        let sum: u64 = self.pictures.images.iter().map(|image| image.samples.bytes() as u64).sum();
        let index = match read {
            Ok((image, _)) if sum + image.samples.bytes() as u64 > MAX_IMAGE_BYTES => {
                let most = MAX_IMAGE_BYTES >> 30;
                let message = about(format!("the model's pictures take more than {most} GiB of memory"));
                self.failed(Diagnostic::warning(name, message).at(map.span.clone()), warnings);
                None
            }
            Ok((image, notes)) => {
                for note in notes {
                    let message = about(format!("\"{}\": {note}", map.file));
                    warnings.push(Diagnostic::warning(name, message).at(map.span.clone()));
                }
                self.pictures.images.push(image);
                Some(self.pictures.images.len() as u32 - 1)
            }
            Err((problem, help)) => {
                let message = about(format!("\"{}\": {problem}", map.file));
                let mut warning = Diagnostic::warning(name, message).at(map.span.clone());
                warning.help = help.map(str::to_owned);
                self.failed(warning, warnings);
                None
            }
        };
        self.pictures.by_identity.insert(identity, index);
        index
    }

    /// Counts a picture that is left out, and tells of the first of them.
    fn failed(&mut self, mut warning: Diagnostic, warnings: &mut Diagnostics) {
        self.pictures.failed += 1;
        if self.pictures.failed <= MAX_TOLD {
            warning.label = "the picture is left out".into();
            warnings.push(warning);
        }
    }

    /// Adds a warning that counts the pictures beyond those that were told of.
    pub(super) fn count_pictures_left_out(&mut self) {
        if let Some(more @ 1..) = self.pictures.failed.checked_sub(MAX_TOLD) {
            let message = format!("{more} more pictures of its materials are left out");
            self.warnings.push(Diagnostic::warning(self.asset.path.name(), message));
        }
    }

    /// The file of a picture: where its name leads from the library, or else the last part of the name beside the
    /// library, with the error of the former.
    fn picture_file(&self, name: &str, library: &OpenAsset) -> Result<(Asset, Option<AssetError>), AssetError> {
        let path = path_of(name);
        let error = match self.assets.read(&path, &library.path) {
            Ok(asset) => return Ok((asset, None)),
            Err(error) => error,
        };
        let last = last_part(&path);
        match self.assets.read(last, &library.path) {
            Ok(asset) if last != path => Ok((asset, Some(error))),
            _ => Err(error),
        }
    }
}
