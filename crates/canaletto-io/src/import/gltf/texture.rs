//! Textures with their images and samplers, and the uses of textures by materials.

use super::buffers::Buffers;
use super::fault::{Fault, named};
use super::schema::{Document, Index, TextureExtensions, TextureRef, TextureTransform};
use crate::assets::{Asset, AssetPath};
use crate::image::{MAX_IMAGE_BYTES, read_image};
use canaletto::material::{Channel, Mapping, Target, TextureUse};
use canaletto::math::Transform;
use canaletto::texture::{ColorSpace, Filter, Image, ImageTexture, Placement, Texture, TextureKind, Wrap};
use glam::{DAffine3, DMat3, DVec3};
use std::collections::HashMap;

/// The textures and images so far.
pub(super) struct Textures<'a> {
    document: &'a Document,
    buffers: &'a Buffers<'a>,
    pub(super) images: Vec<Image>,
    pub(super) textures: Vec<Texture>,
    /// The image of each image of the document that was asked for; none if it can't be read.
    known: HashMap<Index, Option<u32>>,
}

impl<'a> Textures<'a> {
    pub(super) fn new(document: &'a Document, buffers: &'a Buffers<'a>) -> Textures<'a> {
        Textures { document, buffers, images: Vec::new(), textures: Vec::new(), known: HashMap::new() }
    }

    /// The use of a texture for a target, or none if its image can't be read, which is warned of. The value of a number
    /// is that of `channel`.
    pub(super) fn used(
        &mut self,
        texture: &TextureRef,
        target: Target,
        channel: Channel,
        warnings: &mut Vec<Fault>,
    ) -> Option<TextureUse> {
        let space = if target.takes_color() || channel == Channel::Alpha { ColorSpace::Srgb } else { ColorSpace::Raw };
        match self.texture(texture.index, space, warnings) {
            Ok(index) => {
                let transform = texture.extensions.transform.as_ref();
                let mapping = Mapping {
                    transform: transform.map_or(Transform::IDENTITY, placement),
                    uv_set: texture.uv_set(),
                    ..Mapping::default()
                };
                let multiply = target.takes_products();
                Some(TextureUse { channel, mapping, multiply, ..TextureUse::new(index?, target) })
            }
            Err(fault) => {
                warnings.push(fault.help("the material is without this texture"));
                None
            }
        }
    }

    /// The texture of all vertices' colours.
    pub(super) fn vertex_color(&mut self) -> u32 {
        self.add("vertex colours", TextureKind::VertexColor)
    }

    /// A texture of one colour.
    pub(super) fn constant(&mut self, name: &str, value: [f32; 4]) -> u32 {
        self.add(name, TextureKind::Constant(value))
    }

    fn add(&mut self, name: &str, kind: TextureKind) -> u32 {
        if let Some(known) = self.textures.iter().position(|texture| texture.kind == kind) {
            return known as u32;
        }
        self.textures.push(Texture { name: name.to_owned(), kind });
        self.textures.len() as u32 - 1
    }

    fn texture(&mut self, index: Index, space: ColorSpace, warnings: &mut Vec<Fault>) -> Result<Option<u32>, Fault> {
        let info = named(&self.document.textures, index, "texture")?;
        let place = format!("/textures/{index}");
        let TextureExtensions { basisu, webp } = &info.extensions;
        let source = basisu.as_ref().or(webp.as_ref()).map(|other| other.source).or(info.source);
        let Some(source) = source else {
            return Err(Fault::new("it has no image of a format that is read").at(place));
        };
        let Some(image) = self.image(source, warnings) else { return Ok(None) };
        let sampler = match info.sampler {
            Some(sampler) => Some(named(&self.document.samplers, sampler, "sampler").map_err(|fault| fault.at(place))?),
            None => None,
        };
        let wrap = |code: Option<u32>| match code {
            Some(33071) => Wrap::Clamp,
            Some(33648) => Wrap::Mirror,
            _ => Wrap::Repeat,
        };
        let nearest = sampler.and_then(|sampler| sampler.mag_filter) == Some(9728);
        let kind = TextureKind::Image(ImageTexture {
            filter: if nearest { Filter::Nearest } else { Filter::Bilinear },
            wrap: [sampler.and_then(|s| s.wrap_s), sampler.and_then(|s| s.wrap_t)].map(wrap),
            placement: Placement::Edges,
            space: Some(space),
            ..ImageTexture::new(image)
        });
        let name = match &info.name {
            Some(name) if !name.is_empty() => name.clone(),
            _ => self.images[image as usize].name.clone(),
        };
        Ok(Some(self.add(&name, kind)))
    }

    /// The image of the document's image; none if it can't be read, which is warned of once.
    fn image(&mut self, index: Index, warnings: &mut Vec<Fault>) -> Option<u32> {
        if let Some(known) = self.known.get(&index) {
            return *known;
        }
        let image = match self.read_image(index, warnings) {
            Ok(image) => {
                self.images.push(image);
                Some(self.images.len() as u32 - 1)
            }
            Err(fault) => {
                warnings.push(
                    fault.at_if_relative(&format!("/images/{index}")).help_or("materials are without this picture"),
                );
                None
            }
        };
        self.known.insert(index, image);
        image
    }

    /// The file of the document's image, or the bytes that stand for it.
    pub(super) fn asset(&self, index: Index) -> Result<Asset, Fault> {
        let info = named(&self.document.images, index, "image")?;
        let own_name = info.name.clone().filter(|name| !name.is_empty());
        let held = |bytes: Vec<u8>| {
            let name = own_name.clone().unwrap_or_else(|| format!("image {index}"));
            Asset { path: AssetPath::new("", "", name), bytes }
        };
        match (&info.uri, info.buffer_view) {
            (Some(_), Some(_)) => Err(Fault::new("it has both uri and bufferView; one of them is expected")),
            (None, None) => Err(Fault::new("it has neither uri nor bufferView")),
            (None, Some(view)) => Ok(held(self.buffers.view(view)?.bytes.to_vec())),
            (Some(uri), None) if uri.get(..5).is_some_and(|start| start.eq_ignore_ascii_case("data:")) => {
                Ok(held(self.buffers.files().bytes(uri).map_err(|fault| fault.at("/uri"))?.into_owned()))
            }
            (Some(uri), None) => self.buffers.files().file(uri).map_err(|fault| fault.at("/uri")),
        }
    }

    fn read_image(&self, index: Index, warnings: &mut Vec<Fault>) -> Result<Image, Fault> {
        let asset = self.asset(index)?;
        let (image, notes) = read_image(&asset).map_err(|error| Fault::of(&error, error.help()))?;
        let sum: u64 = self.images.iter().chain([&image]).map(|image| image.samples.bytes() as u64).sum();
        if sum > MAX_IMAGE_BYTES {
            let message = format!("the model's pictures take more than {} GiB of memory", MAX_IMAGE_BYTES >> 30);
            return Err(Fault::new(message));
        }
        warnings.extend(notes.into_iter().map(|note| Fault::new(note).at(format!("/images/{index}"))));
        Ok(image)
    }
}

/// The transform that places a picture, whose middle is the origin, x to the right and y upwards. It is the inverse of
/// KHR_texture_transform: u' = o₁ + k₁ u cos θ + k₂ v sin θ and v' = o₂ − k₁ u sin θ + k₂ v cos θ.
pub(super) fn placement(t: &TextureTransform) -> Transform {
    let (sin, cos) = libm::sincos(t.rotation);
    // A scale of 0 shows one texel everywhere; one that is very small does the same, and has an inverse.
    let [k1, k2] = t.scale.map(|k: f64| if k.abs() < SMALLEST_SCALE { SMALLEST_SCALE } else { k });
    let [o1, o2] = t.offset;
    let matrix3 = DMat3::from_cols(DVec3::new(k1 * cos, k1 * sin, 0.0), DVec3::new(-k2 * sin, k2 * cos, 0.0), DVec3::Z);
    let middle = [o1 + 0.5 * (k1 * cos + k2 * sin), o2 + 0.5 * (k2 * cos - k1 * sin)];
    let translation = DVec3::new(middle[0] - 0.5, 0.5 - middle[1], 0.0);
    Transform::new(DAffine3 { matrix3, translation }).map_or(Transform::IDENTITY, |transform| transform.inverse())
}

const SMALLEST_SCALE: f64 = 1e-9;
