//! Textures: pictures with their samplers and places.

use super::Writer;
use crate::export::convert::pictures;
use crate::export::glb::{CLAMP_TO_EDGE, LINEAR, LINEAR_MIPMAP_LINEAR};
use crate::picture::{Channel as PictureChannel, EncodeSettings, Image as Picture, PictureFormat};
use canaletto::material::{Channel, Mapping, Projection, TextureUse};
use canaletto::scene::Transfer;
use canaletto::texture::{ColorSpace, Filter, Image, ImageTexture, Samples, TextureKind, Wrap, from_half, srgb_decode};
use glam::{DVec2, DVec3};
use serde_json::{Value, json};

/// Numbers of the specification.
const NEAREST: u32 = 9728;
const NEAREST_MIPMAP_LINEAR: u32 = 9986;
const MIRRORED_REPEAT: u32 = 33648;
const REPEAT: u32 = 10497;

const TRANSFORM: &str = "KHR_texture_transform";

/// What a texture of the document is made of: an image and a sampler, or channels of several images.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) enum TextureKey {
    Image(u32, [Wrap; 2], bool),
    /// The use of each channel: the texture, its channel and its range as bits.
    Packed(Vec<Option<(u32, Channel, [u32; 2])>>),
}

/// What a slot of a material takes from a picture.
pub(super) struct Wanted<'u> {
    /// The use that each of red, green, blue and alpha comes from. A colour has one use for the first three.
    pub(super) channels: [Option<&'u TextureUse>; 4],
    /// Whether red, green and blue are a colour, which is stored on the sRGB curve.
    pub(super) is_color: bool,
}

const CHANNELS: [Channel; 4] = [Channel::Red, Channel::Green, Channel::Blue, Channel::Alpha];

impl Writer<'_> {
    /// The reference to a texture that gives these numbers. None if there is none, which is told for the material.
    pub(super) fn texture(&mut self, wanted: &Wanted, material: &str) -> Option<Value> {
        let uses: Vec<&TextureUse> = wanted.channels.iter().copied().flatten().collect();
        let first = *uses.first()?;
        let is_picture = |used: &&TextureUse| {
            let kind = self.scene.textures.get(used.texture as usize).map(|texture| &texture.kind);
            matches!(kind, Some(TextureKind::Image(_))) && used.mapping.projection == Projection::Uv
        };
        if !uses.iter().all(is_picture) {
            self.lost.add("textures that are computed or projected", material);
            return None;
        }
        if uses.iter().any(|used| used.mapping != first.mapping) {
            self.lost.add("textures at different places for what glTF has in one", material);
            return None;
        }
        let index = match self.as_it_is(wanted, &uses) {
            Some(index) => self.picture_texture(index)?,
            None => self.packed(wanted, material)?,
        };
        let mut made = json!({ "index": index });
        if first.mapping.uv_set != 0 {
            made["texCoord"] = json!(first.mapping.uv_set);
        }
        match placement(&first.mapping) {
            Some(None) => {}
            Some(Some(transform)) => {
                self.extensions.insert(TRANSFORM);
                made["extensions"] = json!({ TRANSFORM: transform });
            }
            None => self.lost.add("places of textures that are sheared", material),
        }
        Some(made)
    }

    /// The texture whose picture has all channels at their places.
    fn as_it_is(&self, wanted: &Wanted, uses: &[&TextureUse]) -> Option<u32> {
        let texture = uses.first()?.texture;
        let TextureKind::Image(image) = self.scene.textures.get(texture as usize)?.kind else { return None };
        let source = self.scene.images.get(image.image as usize)?;
        let space = image.space.unwrap_or(source.space);
        let is_fit = |(place, used): (usize, &Option<&TextureUse>)| {
            let Some(used) = used else { return true };
            let is_gray = source.channels < 3 && place < 3;
            let has_channel = match used.channel {
                _ if wanted.is_color && place < 3 => true,
                Channel::Luminance | Channel::Max => is_gray,
                channel => channel == CHANNELS[place] || (is_gray && channel != Channel::Alpha),
            };
            used.texture == texture && used.range == [0.0, 1.0] && has_channel
        };
        // Alpha is linear in any space.
        let only_alpha = wanted.channels[..3].iter().all(Option::is_none);
        let right_space = only_alpha || (space == ColorSpace::Srgb) == wanted.is_color;
        let is_float = matches!(source.samples, Samples::F16(_) | Samples::F32(_));
        (right_space && !is_float && wanted.channels.iter().enumerate().all(is_fit)).then_some(texture)
    }

    fn picture_texture(&mut self, texture: u32) -> Option<usize> {
        let info = self.scene.textures.get(texture as usize)?;
        let TextureKind::Image(ImageTexture { image, filter, wrap, .. }) = info.kind else { return None };
        let key = TextureKey::Image(image, wrap, filter == Filter::Nearest);
        if let Some(known) = self.known_textures.get(&key) {
            return *known;
        }
        let made = self.image(image).map(|source| self.add_texture(source, wrap, filter));
        self.known_textures.insert(key, made);
        made
    }

    fn add_texture(&mut self, source: usize, wrap: [Wrap; 2], filter: Filter) -> usize {
        let code = |wrap: Wrap| match wrap {
            Wrap::Mirror => MIRRORED_REPEAT,
            Wrap::Repeat => REPEAT,
            _ => CLAMP_TO_EDGE,
        };
        let is_nearest = filter == Filter::Nearest;
        let sampler = json!({
            "magFilter": if is_nearest { NEAREST } else { LINEAR },
            "minFilter": if is_nearest { NEAREST_MIPMAP_LINEAR } else { LINEAR_MIPMAP_LINEAR },
            "wrapS": code(wrap[0]),
            "wrapT": code(wrap[1]),
        });
        let known = self.samplers.iter().position(|known| *known == sampler);
        let sampler = known.unwrap_or_else(|| {
            self.samplers.push(sampler);
            self.samplers.len() - 1
        });
        self.textures.push(json!({ "source": source, "sampler": sampler }));
        self.textures.len() - 1
    }

    /// The number of the document's image for one of the scene.
    fn image(&mut self, index: u32) -> Option<usize> {
        if let Some(known) = self.known_images.get(&index) {
            return *known;
        }
        let image = self.scene.images.get(index as usize)?;
        let made = pictures::encoded_for_screens(image, self.originals).map(|encoded| {
            if !encoded.is_exact {
                self.lost.add("exact numbers of pictures", &image.name);
            }
            self.add_image(&image.name, &encoded.bytes, encoded.extension)
        });
        if made.is_none() {
            self.lost.add("pictures", &image.name);
        }
        self.known_images.insert(index, made);
        made
    }

    fn add_image(&mut self, name: &str, bytes: &[u8], extension: &str) -> usize {
        let view = self.arrays.binary.push(bytes, json!({}));
        let kind = if extension == "jpg" { "image/jpeg" } else { "image/png" };
        let name = name.rsplit('/').next().unwrap_or_default();
        self.images.push(json!({ "name": name, "bufferView": view, "mimeType": kind }));
        self.images.len() - 1
    }

    /// A picture whose channels come from several ones, or from other channels.
    fn packed(&mut self, wanted: &Wanted, material: &str) -> Option<usize> {
        let of = |used: &TextureUse| (used.texture, used.channel, used.range.map(f32::to_bits));
        let parts: Vec<_> = wanted.channels.iter().map(|used| used.map(of)).collect();
        let mut key = parts.clone();
        key.push(wanted.is_color.then_some((0, Channel::Red, [0; 2])));
        let key = TextureKey::Packed(key);
        if let Some(known) = self.known_textures.get(&key) {
            return *known;
        }
        let first = wanted.channels.iter().flatten().next()?;
        let TextureKind::Image(ImageTexture { wrap, filter, .. }) = self.scene.textures[first.texture as usize].kind
        else {
            return None;
        };
        let picture = self.packed_picture(wanted)?;
        let settings = EncodeSettings { bits: Some(8), ..EncodeSettings::default() };
        let bytes = PictureFormat::Png.encode_image(&picture, Transfer::Srgb, &settings, &[]).ok()?;
        self.lost.add("exact numbers of textures, of which glTF has several in one", material);
        let source = self.add_image(material, &bytes, "png");
        let made = Some(self.add_texture(source, wrap, filter));
        self.known_textures.insert(key, made);
        made
    }

    fn packed_picture(&self, wanted: &Wanted) -> Option<Picture> {
        let sources: Vec<Option<(&TextureUse, &Image, ColorSpace)>> = wanted
            .channels
            .iter()
            .map(|used| Some(((*used)?, self.source_of((*used)?)?.0, self.source_of((*used)?)?.1)))
            .collect();
        let size = |side: fn(&Image) -> u32| sources.iter().flatten().map(|(_, image, _)| side(image)).max();
        let (width, height) = (size(|image| image.width)?, size(|image| image.height)?);
        let has_alpha = sources[3].is_some();
        let mut channels: Vec<PictureChannel> = Vec::new();
        for place in 0..if has_alpha { 4 } else { 3 } {
            let mut data = vec![1.0; width as usize * height as usize];
            if let Some((used, image, space)) = sources[place] {
                for (i, v) in data.iter_mut().enumerate() {
                    let [x, y] = [i as u32 % width, i as u32 / width];
                    let texel = texel(image, space, x * image.width / width, y * image.height / height);
                    let number = match wanted.is_color && place < 3 {
                        true => used.range[0] + texel[place] * (used.range[1] - used.range[0]),
                        false => used.number(texel),
                    };
                    let number = number.clamp(0.0, 1.0);
                    *v = if wanted.is_color && place < 3 { srgb_encode(number) } else { number };
                }
            }
            channels.push(PictureChannel::new(["R", "G", "B", "A"][place], data));
        }
        Some(Picture { width, height, channels })
    }

    fn source_of(&self, used: &TextureUse) -> Option<(&Image, ColorSpace)> {
        let TextureKind::Image(texture) = self.scene.textures.get(used.texture as usize)?.kind else { return None };
        let image = self.scene.images.get(texture.image as usize)?;
        Some((image, texture.space.unwrap_or(image.space)))
    }
}

/// A texel as linear red, green, blue and alpha.
fn texel(image: &Image, space: ColorSpace, x: u32, y: u32) -> [f32; 4] {
    let channels = usize::from(image.channels);
    let first = (y as usize * image.width as usize + x as usize) * channels;
    let number = |channel: usize| match &image.samples {
        Samples::U8(data) => f32::from(data[first + channel]) / 255.0,
        Samples::U16(data) => f32::from(data[first + channel]) / 65535.0,
        Samples::F16(data) => from_half(data[first + channel]),
        Samples::F32(data) => data[first + channel],
    };
    let color = |channel: usize| if space == ColorSpace::Srgb { srgb_decode(number(channel)) } else { number(channel) };
    match channels {
        1 => [color(0), color(0), color(0), 1.0],
        2 => [color(0), color(0), color(0), number(1)],
        3 => [color(0), color(1), color(2), 1.0],
        _ => [color(0), color(1), color(2), number(3)],
    }
}

fn srgb_encode(v: f32) -> f32 {
    if v <= 0.003_130_8 { 12.92 * v } else { (1.055 * libm::pow(f64::from(v), 1.0 / 2.4) - 0.055) as f32 }
}

/// A mapping as KHR_texture_transform; none inside for no change. None if it shears.
fn placement(mapping: &Mapping) -> Option<Option<Value>> {
    if mapping.transform.is_identity() && mapping.repeat.0 == [1.0; 2] {
        return Some(None);
    }
    // The coordinates after the mapping, as the material has them: an affine map of u and v.
    let back = mapping.transform.inverse();
    let at = |u: f64, v: f64| {
        let at = back.point(DVec3::new(u - 0.5, 0.5 - v, 0.0));
        DVec2::new((at.x + 0.5) * mapping.repeat.0[0], (0.5 - at.y) * mapping.repeat.0[1])
    };
    let offset = at(0.0, 0.0);
    let (along_u, along_v) = (at(1.0, 0.0) - offset, at(0.0, 1.0) - offset);
    let angle = libm::atan2(-along_u.y, along_u.x);
    let (sin, cos) = libm::sincos(angle);
    let scale = [along_u.length(), along_v.dot(DVec2::new(sin, cos))];
    let rest = along_v - DVec2::new(sin, cos) * scale[1];
    if rest.length() > 1e-7 * along_v.length() {
        return None;
    }
    let mut made = json!({});
    if offset != DVec2::ZERO {
        made["offset"] = json!(offset.to_array());
    }
    if angle != 0.0 {
        made["rotation"] = json!(angle);
    }
    if scale != [1.0; 2] {
        made["scale"] = json!(scale);
    }
    Some(Some(made))
}
