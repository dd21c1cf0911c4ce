//! Materials on the standard surface.

use super::fault::{Fault, named};
use super::schema::{Document, Index, MaterialInfo, SpecularGlossiness, TextureRef};
use super::texture::Textures;
use crate::import::reflectance::{ALL_REFLECTING, index_of, reflection};
use canaletto::Named;
use canaletto::material::{Channel, Material, Parameter, StandardSurface, Target, TextureUse};
use canaletto::math::Rgb;
use std::collections::HashMap;

/// The materials so far.
pub(super) struct Materials<'a> {
    document: &'a Document,
    pub(super) textures: Textures<'a>,
    pub(super) list: Vec<Material>,
    /// The material of each material of the document, with vertex colours or without.
    known: HashMap<(Option<Index>, bool), u32>,
}

/// What a primitive needs to know of its material.
#[derive(Clone, Copy, Debug)]
pub(super) struct OfPrimitive {
    pub(super) one_sided: bool,
    /// The uv set of the normal map, or of the coat's.
    pub(super) tangent_set: Option<u32>,
    pub(super) color: Rgb,
}

const DIFFUSE: Target = Target::Parameter(Parameter::Diffuse);
const ROUGHNESS: Target = Target::Parameter(Parameter::Roughness);
const EMISSION: Target = Target::Parameter(Parameter::Emission);

impl<'a> Materials<'a> {
    pub(super) fn new(document: &'a Document, textures: Textures<'a>) -> Materials<'a> {
        Materials { document, textures, list: Vec::new(), known: HashMap::new() }
    }

    /// What a primitive with this material needs to know of it.
    pub(super) fn of_primitive(&self, index: Option<Index>) -> Result<OfPrimitive, Fault> {
        let default = MaterialInfo::default();
        let info = match index {
            Some(index) => named(&self.document.materials, index, "material")?,
            None => &default,
        };
        let is_body = info.extensions.volume.as_ref().is_some_and(|volume| volume.thickness_factor > 0.0);
        let coat = info.extensions.clearcoat.as_ref();
        let coat_normal = coat.and_then(|coat| coat.clearcoat_normal_texture.as_ref());
        let [r, g, b, _] = info.pbr_metallic_roughness.base_color_factor;
        Ok(OfPrimitive {
            // Light leaves a clear body from inside.
            one_sided: index.is_some() && !info.double_sided && !is_body,
            tangent_set: info.normal_texture.as_ref().or(coat_normal).map(TextureRef::uv_set),
            color: Rgb::new(r, g, b),
        })
    }

    /// The material of a primitive. None if the document has no materials at all.
    pub(super) fn material(
        &mut self,
        index: Option<Index>,
        has_colors: bool,
        warnings: &mut Vec<Fault>,
    ) -> Result<Option<u32>, Fault> {
        if let Some(known) = self.known.get(&(index, has_colors)) {
            return Ok(Some(*known));
        }
        let default = MaterialInfo::default();
        let (info, place) = match index {
            Some(index) => (named(&self.document.materials, index, "material")?, format!("/materials/{index}")),
            None if self.document.materials.is_empty() && !has_colors => return Ok(None),
            None => (&default, String::new()),
        };
        let name = match (&info.name, index) {
            (Some(name), _) if !name.is_empty() => name.clone(),
            (_, Some(index)) => format!("material {index}"),
            (_, None) => "default material".to_owned(),
        };
        let name =
            if self.list.iter().any(|m| m.name == name) { format!("{name} ({})", self.list.len()) } else { name };
        let mut said = Vec::new();
        let mut maker = Maker { textures: &mut self.textures, uses: Vec::new(), warnings: &mut said };
        let material = maker.material(info, name, has_colors);
        warnings.extend(said.into_iter().map(|fault| fault.at_if_relative(&place)));
        self.list.push(material);
        let made = self.list.len() as u32 - 1;
        self.known.insert((index, has_colors), made);
        Ok(Some(made))
    }
}

/// A target of the standard surface by its word.
fn standard(word: &str) -> Target {
    Target::from_name(word).unwrap_or(DIFFUSE)
}

/// The making of one material.
struct Maker<'m, 'a> {
    textures: &'m mut Textures<'a>,
    uses: Vec<TextureUse>,
    warnings: &'m mut Vec<Fault>,
}

impl Maker<'_, '_> {
    /// Multiplies a target by a texture, if there is one.
    fn map(&mut self, texture: Option<&TextureRef>, target: Target, channel: Channel) {
        let Some(texture) = texture else { return };
        let used = self.textures.used(texture, target, channel, self.warnings);
        self.uses.extend(used);
    }

    /// Replaces a target by a texture, if there is one, whose values 0 and 1 stand for the ends of a range.
    fn map_range(&mut self, texture: Option<&TextureRef>, target: Target, channel: Channel, range: [f32; 2]) {
        let Some(texture) = texture else { return };
        let used = self.textures.used(texture, target, channel, self.warnings);
        self.uses.extend(used.map(|used| TextureUse { range, multiply: false, ..used }));
    }

    /// Multiplies a target by the colours of vertices, if there are any.
    fn vertex_colors(&mut self, has_colors: bool, target: Target) {
        if has_colors {
            let colors = self.textures.vertex_color();
            self.uses.push(TextureUse { multiply: true, ..TextureUse::new(colors, target) });
        }
    }

    /// A number of the document, moved into its range with a warning.
    fn number(&mut self, value: f32, [low, high]: [f32; 2], place: &str) -> f32 {
        if (low..=high).contains(&value) {
            return value;
        }
        let nearest = if value.is_nan() { low } else { value.clamp(low, high) };
        let range = if high == f32::MAX { format!("{low} or more") } else { format!("between {low} and {high}") };
        self.warnings.push(Fault::new(format!("is {value}; it must be {range} and is taken as {nearest}")).at(place));
        nearest
    }

    fn unit(&mut self, value: f32, place: &str) -> f32 {
        self.number(value, [0.0, 1.0], place)
    }

    fn color(&mut self, [r, g, b]: [f32; 3], range: [f32; 2], place: &str) -> Rgb {
        Rgb::new(self.number(r, range, place), self.number(g, range, place), self.number(b, range, place))
    }

    fn material(&mut self, info: &MaterialInfo, name: String, has_colors: bool) -> Material {
        let mut surface = StandardSurface::default();
        let alpha = match &info.extensions.specular_glossiness {
            Some(model) => self.specular_glossiness(model, has_colors, &mut surface),
            None => self.base(info, has_colors, &mut surface),
        };
        self.specular(info, &mut surface);
        self.emission(info, &mut surface);
        self.layers(info, &mut surface);
        self.transmission(info, has_colors, &mut surface);
        self.diffuse_transmission(info, &mut surface);
        let mut material = Material::new_standard(name, surface);
        material.two_sided = info.double_sided;
        self.alpha(info, has_colors, alpha, &mut material);
        if let Some(texture) = &info.normal_texture {
            let target = Target::Normal { strength: texture.scale.max(0.0), down: false };
            self.map(Some(texture), target, Channel::Luminance);
        }
        if info.extensions.unlit.is_some() {
            self.unlit(info, has_colors);
        }
        material.textures = std::mem::take(&mut self.uses);
        material
    }

    /// The base colour itself, whatever the light.
    fn unlit(&mut self, info: &MaterialInfo, has_colors: bool) {
        let pbr = &info.pbr_metallic_roughness;
        let [r, g, b, _] = pbr.base_color_factor;
        let factor =
            self.textures.constant("base colour", [r, g, b, 1.0].map(|v| if v > 0.0 { v.min(1.0) } else { 0.0 }));
        self.uses.push(TextureUse::new(factor, Target::Replace));
        self.vertex_colors(has_colors, Target::Replace);
        self.map(pbr.base_color_texture.as_ref(), Target::Replace, Channel::Luminance);
    }

    /// The metallic-roughness model. Returns alpha.
    fn base(&mut self, info: &MaterialInfo, has_colors: bool, surface: &mut StandardSurface) -> f32 {
        let pbr = &info.pbr_metallic_roughness;
        let [r, g, b, alpha] = pbr.base_color_factor;
        let place = "/pbrMetallicRoughness/baseColorFactor";
        surface.base.color = self.color([r, g, b], [0.0, 1.0], place);
        surface.base.metalness = self.unit(pbr.metallic_factor, "/pbrMetallicRoughness/metallicFactor");
        surface.specular.roughness = self.unit(pbr.roughness_factor, "/pbrMetallicRoughness/roughnessFactor");
        self.vertex_colors(has_colors, DIFFUSE);
        self.map(pbr.base_color_texture.as_ref(), DIFFUSE, Channel::Luminance);
        self.map(pbr.metallic_roughness_texture.as_ref(), standard("metalness"), Channel::Blue);
        self.map(pbr.metallic_roughness_texture.as_ref(), ROUGHNESS, Channel::Green);
        self.unit(alpha, place)
    }

    fn specular(&mut self, info: &MaterialInfo, surface: &mut StandardSurface) {
        if let Some(ior) = &info.extensions.ior {
            // An index of 0 stands for a dielectric whose F0 is 1 (KHR_materials_ior).
            match ior.ior == 0.0 {
                true => (surface.specular.ior, surface.schlick) = (ALL_REFLECTING, true),
                false => {
                    let place = "/extensions/KHR_materials_ior/ior";
                    surface.specular.ior = self.number(ior.ior, [1.0, f32::MAX], place);
                }
            }
        }
        if let Some(specular) = &info.extensions.specular {
            let place = "/extensions/KHR_materials_specular";
            let weight = self.unit(specular.specular_factor, &format!("{place}/specularFactor"));
            let color = specular.specular_color_factor;
            let color = self.color(color, [0.0, f32::MAX], &format!("{place}/specularColorFactor"));
            // Without any change, Fresnel's reflectance stays.
            let changes = (weight, color) != (1.0, Rgb::WHITE)
                || specular.specular_texture.is_some()
                || specular.specular_color_texture.is_some();
            surface.specular.weight = weight;
            surface.schlick |= changes;
            self.map(specular.specular_texture.as_ref(), standard("specular-weight"), Channel::Alpha);
            // A colour beyond 1 raises F0 as a larger index does.
            let most = color.max_component().max(1.0);
            surface.specular.color = color * (1.0 / most);
            surface.specular.ior = index_of(reflection(surface.specular.ior) * most);
            self.map(specular.specular_color_texture.as_ref(), standard("specular-color"), Channel::Luminance);
        }
        if let Some(anisotropy) = &info.extensions.anisotropy {
            let place = "/extensions/KHR_materials_anisotropy";
            let strength = self.unit(anisotropy.anisotropy_strength, &format!("{place}/anisotropyStrength"));
            // αt = mix(r², 1, s²) along the tangent and αb = r² across it.
            let across = surface.specular.roughness * surface.specular.roughness;
            let along = across + (1.0 - across) * strength * strength;
            let squash = if along > 0.0 { across / along } else { 1.0 };
            surface.specular.anisotropy = 1.0 - squash;
            surface.specular.roughness = (along * ((1.0 + squash * squash) / 2.0).sqrt()).sqrt().min(1.0);
            surface.specular.anisotropy_rotation = match anisotropy.anisotropy_rotation.is_finite() {
                true => anisotropy.anisotropy_rotation.to_degrees(),
                false => {
                    self.number(anisotropy.anisotropy_rotation, [0.0, 0.0], &format!("{place}/anisotropyRotation"))
                }
            };
            let texture = anisotropy.anisotropy_texture.as_ref();
            self.map(texture, Target::AnisotropyDirection, Channel::Luminance);
            self.map(texture, standard("specular-anisotropy"), Channel::Blue);
        }
    }

    /// The archived specular-glossiness model. Returns alpha.
    fn specular_glossiness(
        &mut self,
        model: &SpecularGlossiness,
        has_colors: bool,
        surface: &mut StandardSurface,
    ) -> f32 {
        let place = "/extensions/KHR_materials_pbrSpecularGlossiness";
        let [r, g, b, alpha] = model.diffuse_factor;
        let f0 = self.color(model.specular_factor, [0.0, 1.0], &format!("{place}/specularFactor"));
        let diffuse = self.color([r, g, b], [0.0, 1.0], &format!("{place}/diffuseFactor"));
        let glossiness = self.unit(model.glossiness_factor, &format!("{place}/glossinessFactor"));
        (surface.specular.color, surface.specular.ior, surface.schlick) = (f0, ALL_REFLECTING, true);
        surface.specular.roughness = 1.0 - glossiness;
        surface.base.color = diffuse;
        // What is mirrored isn't scattered: the share 1 − max(F0) is left.
        let texture = model.specular_glossiness_texture.as_ref();
        surface.base.weight = if texture.is_none() { 1.0 - f0.max_component() } else { 1.0 };
        if let Some(texture) = texture {
            let used = self.textures.used(texture, standard("specular-color"), Channel::Max, self.warnings);
            let range = [1.0, 1.0 - f0.max_component()];
            self.uses.extend(used.map(|used| TextureUse { target: standard("base-weight"), range, ..used }));
        }
        self.vertex_colors(has_colors, DIFFUSE);
        self.map(model.diffuse_texture.as_ref(), DIFFUSE, Channel::Luminance);
        self.map(texture, standard("specular-color"), Channel::Luminance);
        self.map_range(texture, ROUGHNESS, Channel::Alpha, [1.0, 1.0 - glossiness]);
        self.unit(alpha, &format!("{place}/diffuseFactor"))
    }

    fn diffuse_transmission(&mut self, info: &MaterialInfo, surface: &mut StandardSurface) {
        let Some(through) = &info.extensions.diffuse_transmission else { return };
        let place = "/extensions/KHR_materials_diffuse_transmission";
        let share = through.diffuse_transmission_factor;
        surface.subsurface.weight = self.unit(share, &format!("{place}/diffuseTransmissionFactor"));
        let color = through.diffuse_transmission_color_factor;
        surface.subsurface.color = self.color(color, [0.0, 1.0], &format!("{place}/diffuseTransmissionColorFactor"));
        (surface.subsurface.scatter_anisotropy, surface.thin_walled) = (1.0, true);
        self.map(through.diffuse_transmission_texture.as_ref(), standard("subsurface-weight"), Channel::Alpha);
        let texture = through.diffuse_transmission_color_texture.as_ref();
        self.map(texture, standard("subsurface-color"), Channel::Luminance);
    }

    fn emission(&mut self, info: &MaterialInfo, surface: &mut StandardSurface) {
        surface.emission.color = self.color(info.emissive_factor, [0.0, f32::MAX], "/emissiveFactor");
        let strength = info.extensions.emissive_strength.as_ref().map_or(1.0, |strength| strength.emissive_strength);
        let place = "/extensions/KHR_materials_emissive_strength/emissiveStrength";
        surface.emission.radiance = self.number(strength, [0.0, f32::MAX], place);
        if surface.emission.color != Rgb::BLACK {
            self.map(info.emissive_texture.as_ref(), EMISSION, Channel::Luminance);
        }
    }

    /// Clearcoat, sheen and iridescence.
    fn layers(&mut self, info: &MaterialInfo, surface: &mut StandardSurface) {
        if let Some(coat) = &info.extensions.clearcoat {
            let place = "/extensions/KHR_materials_clearcoat";
            surface.coat.weight = self.unit(coat.clearcoat_factor, &format!("{place}/clearcoatFactor"));
            let roughness = coat.clearcoat_roughness_factor;
            surface.coat.roughness = self.unit(roughness, &format!("{place}/clearcoatRoughnessFactor"));
            (surface.coat.ior, surface.coat.darkening) = (1.5, 0.0);
            // The base reflects under the coat as without it. OpenPBR's base would reflect as in the coat's medium.
            surface.schlick |= surface.coat.weight > 0.0;
            self.map(coat.clearcoat_texture.as_ref(), standard("coat-weight"), Channel::Red);
            self.map(coat.clearcoat_roughness_texture.as_ref(), standard("coat-roughness"), Channel::Green);
            if let Some(texture) = &coat.clearcoat_normal_texture {
                let target = Target::CoatNormal { strength: texture.scale.max(0.0), down: false };
                self.map(Some(texture), target, Channel::Luminance);
            }
        }
        if let Some(sheen) = &info.extensions.sheen {
            let place = "/extensions/KHR_materials_sheen";
            let color = self.color(sheen.sheen_color_factor, [0.0, 1.0], &format!("{place}/sheenColorFactor"));
            surface.fuzz.weight = color.max_component();
            if surface.fuzz.weight > 0.0 {
                surface.fuzz.color = color * (1.0 / surface.fuzz.weight);
            }
            let roughness = sheen.sheen_roughness_factor;
            surface.fuzz.roughness = self.unit(roughness, &format!("{place}/sheenRoughnessFactor"));
            self.map(sheen.sheen_color_texture.as_ref(), standard("fuzz-color"), Channel::Luminance);
            self.map(sheen.sheen_roughness_texture.as_ref(), standard("fuzz-roughness"), Channel::Alpha);
        }
        if let Some(film) = &info.extensions.iridescence {
            let place = "/extensions/KHR_materials_iridescence";
            surface.thin_film.weight = self.unit(film.iridescence_factor, &format!("{place}/iridescenceFactor"));
            surface.thin_film.ior =
                self.number(film.iridescence_ior, [1.0, f32::MAX], &format!("{place}/iridescenceIor"));
            // Nanometres to micrometres.
            let [low, high] = [film.iridescence_thickness_minimum, film.iridescence_thickness_maximum]
                .map(|thickness| if thickness.is_finite() { thickness.max(0.0) / 1000.0 } else { 0.0 });
            surface.thin_film.thickness = high;
            self.map(film.iridescence_texture.as_ref(), standard("thin-film-weight"), Channel::Red);
            let texture = film.iridescence_thickness_texture.as_ref();
            self.map_range(texture, standard("thin-film-thickness"), Channel::Green, [low, high]);
        }
    }

    fn transmission(&mut self, info: &MaterialInfo, has_colors: bool, surface: &mut StandardSurface) {
        let Some(transmission) = &info.extensions.transmission else { return };
        let place = "/extensions/KHR_materials_transmission/transmissionFactor";
        surface.transmission.weight = self.unit(transmission.transmission_factor, place);
        self.map(transmission.transmission_texture.as_ref(), standard("transmission-weight"), Channel::Red);
        let body = info.extensions.volume.as_ref().filter(|volume| volume.thickness_factor > 0.0);
        surface.thin_walled = body.is_none();
        let place = "/extensions/KHR_materials_volume";
        if let Some((volume, distance)) = body.and_then(|volume| Some((volume, volume.attenuation_distance?)))
            && distance > 0.0
            && distance.is_finite()
        {
            surface.transmission.depth = distance;
            let color = volume.attenuation_color;
            surface.transmission.color = self.color(color, [0.0, 1.0], &format!("{place}/attenuationColor"));
        }
        // The base colour tints light at each crossing, beside the volume.
        surface.transmission.tint = surface.base.color;
        self.vertex_colors(has_colors, standard("transmission-tint"));
        let base = info.pbr_metallic_roughness.base_color_texture.as_ref();
        self.map(base, standard("transmission-tint"), Channel::Luminance);
        if let Some(dispersion) = info.extensions.dispersion.as_ref().filter(|d| d.dispersion > 0.0) {
            surface.transmission.dispersion_scale = 1.0;
            surface.transmission.dispersion_abbe_number = (20.0 / dispersion.dispersion).max(1e-3);
        }
    }

    /// The alpha mode (glTF 2.0, 3.9.4).
    fn alpha(&mut self, info: &MaterialInfo, has_colors: bool, alpha: f32, material: &mut Material) {
        match info.alpha_mode.as_deref() {
            None | Some("OPAQUE") => return,
            Some("MASK") => {
                let cutoff = info.alpha_cutoff.unwrap_or(0.5);
                match cutoff <= 1.0 {
                    true => material.alpha_cutoff = Some(cutoff.max(0.0)),
                    // No alpha reaches such a cutoff: nothing is drawn.
                    false => {
                        material.coverage = 0.0;
                        return;
                    }
                }
            }
            Some("BLEND") => {}
            Some(other) => {
                let message =
                    format!("is {other:?}; it must be \"OPAQUE\", \"MASK\" or \"BLEND\" and is taken as \"OPAQUE\"");
                self.warnings.push(Fault::new(message).at("/alphaMode"));
                return;
            }
        }
        material.coverage = alpha;
        self.vertex_colors(has_colors, Target::Cutout);
        let texture = match &info.extensions.specular_glossiness {
            Some(model) => model.diffuse_texture.as_ref(),
            None => info.pbr_metallic_roughness.base_color_texture.as_ref(),
        };
        self.map(texture, Target::Cutout, Channel::Alpha);
    }
}
