//! Materials: metallic-roughness with extensions where a number has one.

use super::Writer;
use super::textures::Wanted;
use canaletto::Named;
use canaletto::material::{
    Channel, Material, MaterialModel, Parameter, Phong, StandardSurface, Target, TextureUse, fresnel_conductor,
};
use canaletto::math::Rgb;
use canaletto::shape::Mesh;
use canaletto::texture::TextureKind;
use serde_json::{Map, Value, json};

/// A material of the document: that of the scene, on a mesh with or without colours, seen from both sides or one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct MaterialKey {
    material: Option<u32>,
    has_colors: bool,
    is_double_sided: bool,
}

const DIFFUSE: Target = Target::Parameter(Parameter::Diffuse);
const ROUGHNESS: Target = Target::Parameter(Parameter::Roughness);
const EMISSION: Target = Target::Parameter(Parameter::Emission);

/// The index of refraction of glTF's dielectrics.
const USUAL_IOR: f32 = 1.5;
/// An index beyond which a dielectric is taken to reflect all light: glTF says that by 0.
const ALL_REFLECTING: f32 = 1e5;

/// The target of this word.
fn target(word: &str) -> Target {
    Target::from_name(word).unwrap_or(DIFFUSE)
}

/// A material as numbers of the standard surface, and the light that it emits.
struct Numbers {
    surface: StandardSurface,
    emission: Rgb,
}

impl Writer<'_> {
    /// The number of the document's material; none for what has none.
    pub(super) fn material(&mut self, index: Option<u32>, mesh: &Mesh) -> Option<usize> {
        if index.is_none() && !self.has_default_material && mesh.colors.is_empty() {
            return None;
        }
        let key =
            MaterialKey { material: index, has_colors: !mesh.colors.is_empty(), is_double_sided: !mesh.one_sided };
        if let Some(known) = self.known_materials.get(&key) {
            return Some(*known);
        }
        let default = match self.has_default_material {
            true => Material { name: "default".into(), ..Material::default() },
            // Models have one like clay, whose colour the mesh's own replace.
            false => {
                let mut surface = StandardSurface::default();
                surface.specular.roughness = 0.5;
                Material::new_standard("default", surface)
            }
        };
        let scene = self.scene;
        let material = index.and_then(|index| scene.materials.get(index as usize)).unwrap_or(&default);
        let made = self.made(material, key);
        self.materials.push(made);
        self.known_materials.insert(key, self.materials.len() - 1);
        Some(self.materials.len() - 1)
    }

    fn made(&mut self, material: &Material, key: MaterialKey) -> Value {
        let name = &material.name;
        let Numbers { surface, emission } = self.numbers(material);
        let uses = self.uses(material);
        // A range from 0 on is a factor.
        let plain: Vec<(TextureUse, f32)> = uses.iter().map(|used| without_range(used)).collect();
        let uses: Vec<&TextureUse> = plain.iter().map(|(used, _)| used).collect();
        let find = |target: Target| plain.iter().rev().find(|(used, _)| used.target == target);
        let used = |target: Target| find(target).map(|(used, _)| used);
        let times = |target: Target| find(target).map_or(1.0, |(_, factor)| *factor);
        let mut extensions = Map::new();
        let mut made = json!({ "name": name });
        // Light leaves a clear body from inside, whatever is said.
        let is_body = surface.transmission.weight > 0.0 && !surface.thin_walled;
        if key.is_double_sided && !is_body {
            made["doubleSided"] = json!(true);
        }

        // The base.
        let cutout = used(Target::Cutout);
        // The colour of what isn't lit is the base's in glTF.
        let replacing = || plain.iter().map(|(used, _)| used).filter(|used| used.target == Target::Replace);
        let image = replacing().rev().find(|used| self.constant(used).is_none());
        let diffuse = image.or(used(DIFFUSE));
        let mut base = surface.base.color * surface.base.weight;
        if let Some(constant) = replacing().find_map(|used| self.constant(used)) {
            base = constant;
        }
        let reads_colors = material.textures.iter().any(|used| used.target == DIFFUSE && self.is_vertex_color(used));
        if key.has_colors && !reads_colors {
            base = Rgb::WHITE;
        }
        if diffuse.is_some_and(|used| !used.multiply) {
            base = Rgb::WHITE;
        }
        let alpha = if cutout.is_some_and(|used| !used.multiply) { 1.0 } else { material.coverage };
        base = (base * times(DIFFUSE)).map(|v| v.min(1.0));
        let alpha = (alpha * times(Target::Cutout)).min(1.0);
        let metalness = self.factor(surface.base.metalness, used(target("metalness"))) * times(target("metalness"));
        let mut pbr = json!({
            "baseColorFactor": [base.r, base.g, base.b, alpha],
            "metallicFactor": metalness.min(1.0),
        });
        let (roughness, stretch) = isotropic(&surface);
        pbr["roughnessFactor"] = json!((self.factor(roughness, used(ROUGHNESS)) * times(ROUGHNESS)).min(1.0));
        let color = Wanted { channels: [diffuse, diffuse, diffuse, cutout], is_color: true };
        insert(&mut pbr, "baseColorTexture", self.texture(&color, name));
        let both = [None, used(ROUGHNESS), used(target("metalness")), None];
        insert(&mut pbr, "metallicRoughnessTexture", self.texture(&Wanted { channels: both, is_color: false }, name));
        made["pbrMetallicRoughness"] = pbr;
        self.alpha(material, cutout, &mut made);

        // Emission.
        let glow = used(EMISSION);
        let glow_color = if glow.is_some_and(|used| !used.multiply) { Rgb::WHITE } else { emission };
        let glow_color = glow_color * times(EMISSION);
        let most = glow_color.max_component();
        if most > 0.0 {
            let strength = most.max(1.0);
            made["emissiveFactor"] = json!((glow_color * (1.0 / strength)).to_array());
            if strength > 1.0 {
                let strength = json!({ "emissiveStrength": strength });
                self.extend(&mut extensions, "KHR_materials_emissive_strength", strength);
            }
            let wanted = Wanted { channels: [glow, glow, glow, None], is_color: true };
            insert(&mut made, "emissiveTexture", self.texture(&wanted, name));
        }
        self.normals(&uses, name, &mut made);
        self.specular(material, &surface, &uses, &mut extensions);
        self.stretch(&surface, stretch, &uses, name, &mut extensions);
        self.layers(&surface, &uses, name, &mut extensions);
        self.clear(&surface, &uses, name, &mut made, &mut extensions);
        if uses.iter().any(|used| used.target == Target::Replace) {
            self.extend(&mut extensions, "KHR_materials_unlit", json!({}));
        }
        self.lose(material, &surface, &uses);
        if !extensions.is_empty() {
            made["extensions"] = json!(extensions);
        }
        made
    }

    /// The uses of textures without those of vertices' colours and of single colours.
    fn uses<'m>(&self, material: &'m Material) -> Vec<&'m TextureUse> {
        material.textures.iter().filter(|used| !self.is_vertex_color(used)).collect()
    }

    fn is_vertex_color(&self, used: &TextureUse) -> bool {
        let kind = self.scene.textures.get(used.texture as usize).map(|texture| &texture.kind);
        matches!(kind, Some(TextureKind::VertexColor))
    }

    /// The colour of a texture that is one.
    fn constant(&self, used: &TextureUse) -> Option<Rgb> {
        match self.scene.textures.get(used.texture as usize).map(|texture| &texture.kind) {
            Some(TextureKind::Constant([r, g, b, _])) => Some(Rgb::new(*r, *g, *b)),
            _ => None,
        }
    }

    fn extend(&mut self, extensions: &mut Map<String, Value>, name: &'static str, value: Value) {
        self.extensions.insert(name);
        extensions.insert(name.to_owned(), value);
    }

    /// A factor beside a texture, which may take its place.
    fn factor(&self, factor: f32, used: Option<&TextureUse>) -> f32 {
        if used.is_some_and(|used| !used.multiply) { 1.0 } else { factor }
    }

    fn alpha(&mut self, material: &Material, cutout: Option<&TextureUse>, made: &mut Value) {
        if let Some(cutoff) = material.alpha_cutoff {
            made["alphaMode"] = json!("MASK");
            made["alphaCutoff"] = json!(cutoff);
        } else if material.coverage < 1.0 || cutout.is_some() || material.has_holes() {
            made["alphaMode"] = json!("BLEND");
        }
    }

    fn normals(&mut self, uses: &[&TextureUse], name: &str, made: &mut Value) {
        let of_base = |target: Target| match target {
            Target::Normal { strength, down } => Some((strength, down)),
            _ => None,
        };
        insert(made, "normalTexture", self.normal_texture(uses, name, of_base));
    }

    /// The last normal map whose strength and direction `of` tells.
    fn normal_texture(
        &mut self,
        uses: &[&TextureUse],
        name: &str,
        of: impl Fn(Target) -> Option<(f32, bool)>,
    ) -> Option<Value> {
        let mut normals = uses.iter().rev().filter_map(|used| of(used.target).map(|own| (*used, own)));
        let (used, (strength, down)) = normals.next()?;
        if down {
            self.lost.add("normal maps whose green leans downwards", name);
            return None;
        }
        let [red, green, blue] =
            [Channel::Red, Channel::Green, Channel::Blue].map(|channel| TextureUse { channel, ..*used });
        let channels = [Some(&red), Some(&green), Some(&blue), None];
        let mut texture = self.texture(&Wanted { channels, is_color: false }, name)?;
        if strength != 1.0 {
            texture["scale"] = json!(strength);
        }
        Some(texture)
    }

    /// The reflection of a dielectric.
    fn specular(
        &mut self,
        material: &Material,
        surface: &StandardSurface,
        uses: &[&TextureUse],
        extensions: &mut Map<String, Value>,
    ) {
        let used = |word: &str| uses.iter().rev().find(|used| used.target == target(word)).copied();
        let specular = &surface.specular;
        if specular.ior != USUAL_IOR {
            let ior = if specular.ior >= ALL_REFLECTING { 0.0 } else { specular.ior.max(1.0) };
            self.extend(extensions, "KHR_materials_ior", json!({ "ior": ior }));
        }
        let (weight, color) = match surface.schlick {
            true => (specular.weight.min(1.0), specular.color),
            // The weight scales the reflection at right angles; that along the surface stays.
            false => (1.0, specular.color * specular.weight),
        };
        let maps = [used("specular-weight"), used("specular-color")];
        if weight == 1.0 && color == Rgb::WHITE && maps.iter().all(Option::is_none) {
            return;
        }
        let name = &material.name;
        let mut made = json!({ "specularFactor": self.factor(weight, maps[0]) });
        made["specularColorFactor"] =
            json!(if maps[1].is_some_and(|used| !used.multiply) { Rgb::WHITE } else { color }.to_array());
        let alpha = Wanted { channels: [None, None, None, maps[0]], is_color: false };
        insert(&mut made, "specularTexture", self.texture(&alpha, name));
        let rgb = Wanted { channels: [maps[1], maps[1], maps[1], None], is_color: true };
        insert(&mut made, "specularColorTexture", self.texture(&rgb, name));
        self.extend(extensions, "KHR_materials_specular", made);
    }

    fn stretch(
        &mut self,
        surface: &StandardSurface,
        strength: f32,
        uses: &[&TextureUse],
        name: &str,
        extensions: &mut Map<String, Value>,
    ) {
        let used = |wanted: Target| uses.iter().rev().find(|used| used.target == wanted).copied();
        let maps = [used(Target::AnisotropyDirection), used(target("specular-anisotropy"))];
        if strength == 0.0 && maps.iter().all(Option::is_none) {
            return;
        }
        let mut made = json!({
            "anisotropyStrength": strength,
            "anisotropyRotation": f64::from(surface.specular.anisotropy_rotation).to_radians(),
        });
        let direction =
            maps[0].map(|used| [Channel::Red, Channel::Green].map(|channel| TextureUse { channel, ..*used }));
        let channels = match &direction {
            Some([red, green]) => [Some(red), Some(green), maps[1], None],
            None => [None, None, maps[1], None],
        };
        insert(&mut made, "anisotropyTexture", self.texture(&Wanted { channels, is_color: false }, name));
        self.extend(extensions, "KHR_materials_anisotropy", made);
    }

    /// Coat, fuzz and film.
    fn layers(
        &mut self,
        surface: &StandardSurface,
        uses: &[&TextureUse],
        name: &str,
        extensions: &mut Map<String, Value>,
    ) {
        let used = |word: &str| uses.iter().rev().find(|used| used.target == target(word)).copied();
        let [red, green, alpha] = [0usize, 1, 3];
        let one = |used: Option<&TextureUse>, place: usize| used.map(|used| (*used, place));
        let map = |writer: &mut Self, made: &mut Value, key: &str, used: Option<(TextureUse, usize)>| {
            let Some((used, place)) = used else { return };
            let mut channels = [None; 4];
            channels[place] = Some(&used);
            insert(made, key, writer.texture(&Wanted { channels, is_color: false }, name));
        };
        if surface.coat.weight > 0.0 {
            let mut made = json!({
                "clearcoatFactor": self.factor(surface.coat.weight, used("coat-weight")),
                "clearcoatRoughnessFactor": self.factor(surface.coat.roughness, used("coat-roughness")),
            });
            map(self, &mut made, "clearcoatTexture", one(used("coat-weight"), red));
            map(self, &mut made, "clearcoatRoughnessTexture", one(used("coat-roughness"), green));
            let of_coat = |target: Target| match target {
                Target::CoatNormal { strength, down } => Some((strength, down)),
                _ => None,
            };
            insert(&mut made, "clearcoatNormalTexture", self.normal_texture(uses, name, of_coat));
            self.extend(extensions, "KHR_materials_clearcoat", made);
            if surface.coat.color != Rgb::WHITE || surface.coat.anisotropy > 0.0 || surface.coat.ior != USUAL_IOR {
                self.lost.add("colours, indices and stretches of coats", name);
            }
        }
        if surface.fuzz.weight > 0.0 {
            let color = surface.fuzz.color * surface.fuzz.weight;
            let mut made = json!({
                "sheenColorFactor": color.to_array(),
                "sheenRoughnessFactor": self.factor(surface.fuzz.roughness, used("fuzz-roughness")),
            });
            let tint = used("fuzz-color");
            let wanted = Wanted { channels: [tint, tint, tint, None], is_color: true };
            insert(&mut made, "sheenColorTexture", self.texture(&wanted, name));
            map(self, &mut made, "sheenRoughnessTexture", one(used("fuzz-roughness"), alpha));
            self.extend(extensions, "KHR_materials_sheen", made);
        }
        if surface.thin_film.weight > 0.0 {
            let thickness = used("thin-film-thickness");
            let most = surface.thin_film.thickness;
            let range = thickness
                .map_or([0.0, most], |used| if used.multiply { used.range.map(|v| v * most) } else { used.range });
            let mut made = json!({
                "iridescenceFactor": self.factor(surface.thin_film.weight, used("thin-film-weight")),
                "iridescenceIor": surface.thin_film.ior.max(1.0),
                "iridescenceThicknessMinimum": range[0] * 1000.0,
                "iridescenceThicknessMaximum": range[1] * 1000.0,
            });
            map(self, &mut made, "iridescenceTexture", one(used("thin-film-weight"), red));
            let whole = thickness.map(|used| TextureUse { range: [0.0, 1.0], ..*used });
            map(self, &mut made, "iridescenceThicknessTexture", one(whole.as_ref(), green));
            self.extend(extensions, "KHR_materials_iridescence", made);
        }
    }

    /// Transmission, volume, dispersion and diffuse transmission.
    fn clear(
        &mut self,
        surface: &StandardSurface,
        uses: &[&TextureUse],
        name: &str,
        made: &mut Value,
        extensions: &mut Map<String, Value>,
    ) {
        let used = |word: &str| uses.iter().rev().find(|used| used.target == target(word)).copied();
        let clear = &surface.transmission;
        if clear.weight > 0.0 {
            let map = used("transmission-weight");
            let mut own = json!({ "transmissionFactor": self.factor(clear.weight, map) });
            let wanted = Wanted { channels: [map, None, None, None], is_color: false };
            insert(&mut own, "transmissionTexture", self.texture(&wanted, name));
            self.extend(extensions, "KHR_materials_transmission", own);
            if !surface.thin_walled {
                let mut body = json!({ "thicknessFactor": 1.0 });
                if clear.depth > 0.0 {
                    body["attenuationDistance"] = json!(clear.depth);
                    body["attenuationColor"] = json!(clear.color.to_array());
                }
                self.extend(extensions, "KHR_materials_volume", body);
            }
            let tint = if clear.depth == 0.0 || surface.thin_walled { clear.color * clear.tint } else { clear.tint };
            if tint != surface.base.color {
                // Light is tinted by the base's colour there.
                if clear.weight < 1.0 {
                    self.lost.add("colours of bodies that are clear in part", name);
                } else {
                    let [r, g, b] = tint.to_array();
                    for (i, v) in [r, g, b].into_iter().enumerate() {
                        made["pbrMetallicRoughness"]["baseColorFactor"][i] = json!(v);
                    }
                }
            }
            if clear.dispersion_scale > 0.0 {
                let dispersion = 20.0 * clear.dispersion_scale / clear.dispersion_abbe_number;
                self.extend(extensions, "KHR_materials_dispersion", json!({ "dispersion": dispersion }));
            }
        }
        let through = &surface.subsurface;
        if through.weight > 0.0 {
            if !surface.thin_walled || through.scatter_anisotropy != 1.0 {
                self.lost.add("translucence that isn't straight through", name);
                return;
            }
            let map = used("subsurface-weight");
            let mut own = json!({
                "diffuseTransmissionFactor": self.factor(through.weight, map),
                "diffuseTransmissionColorFactor": through.color.to_array(),
            });
            let wanted = Wanted { channels: [None, None, None, map], is_color: false };
            insert(&mut own, "diffuseTransmissionTexture", self.texture(&wanted, name));
            let tint = used("subsurface-color");
            let wanted = Wanted { channels: [tint, tint, tint, None], is_color: true };
            insert(&mut own, "diffuseTransmissionColorTexture", self.texture(&wanted, name));
            self.extend(extensions, "KHR_materials_diffuse_transmission", own);
        }
    }

    /// Tells what has no place in glTF.
    fn lose(&mut self, material: &Material, surface: &StandardSurface, uses: &[&TextureUse]) {
        let name = &material.name;
        let lost = [
            (surface.base.diffuse_roughness > 0.0, "the roughness of diffuse reflection"),
            (!material.medium.scattering.is_black(), "media that scatter light"),
            (material.priority != 0.0, "priorities of bodies that overlap"),
            (uses.iter().any(|used| used.target == Target::Decal), "textures over the shaded colour"),
            (uses.iter().any(|used| used.target == Target::Bump), "bump maps"),
            (uses.iter().any(|used| matches!(used.target, Target::Displace { .. })), "displacements"),
        ];
        lost.iter().filter(|(is_lost, _)| *is_lost).for_each(|(_, what)| self.lost.add(what, name));
        let known = [
            "metalness",
            "specular-weight",
            "specular-color",
            "specular-anisotropy",
            "transmission-weight",
            "transmission-color",
            "transmission-tint",
            "subsurface-weight",
            "subsurface-color",
            "coat-weight",
            "coat-roughness",
            "fuzz-color",
            "fuzz-roughness",
            "thin-film-weight",
            "thin-film-thickness",
        ];
        for used in uses {
            let is_lost = match used.target {
                Target::Standard(own) => !known.contains(&own.word()),
                Target::Parameter(own) => {
                    !matches!(own, Parameter::Diffuse | Parameter::Roughness | Parameter::Emission)
                }
                _ => false,
            };
            if is_lost {
                self.lost.add(&format!("textures for {}", used.target.name()), name);
            }
        }
    }

    /// A material of any model as numbers of the standard surface.
    fn numbers(&mut self, material: &Material) -> Numbers {
        let emission = material.classic().emission;
        let surface = match &material.model {
            MaterialModel::Standard(surface) => **surface,
            MaterialModel::Conductor(metal) => {
                let mut surface = StandardSurface::default();
                let color = fresnel_conductor(1.0, metal.eta, metal.k).map(|v| v.min(1.0));
                (surface.base.color, surface.base.metalness) = (color, 1.0);
                surface.specular.roughness = metal.roughness;
                surface
            }
            MaterialModel::Dielectric(body) => {
                let mut surface = StandardSurface::default();
                surface.base.color = Rgb::WHITE;
                (surface.transmission.weight, surface.specular.ior) = (1.0, body.eta);
                surface.specular.roughness = body.roughness;
                absorbing(&mut surface, material);
                surface
            }
            _ => self.of_phong(material),
        };
        Numbers { surface, emission }
    }

    /// Phong's model: highlights and mirrors become the reflection of a dielectric or of a metal.
    fn of_phong(&mut self, material: &Material) -> StandardSurface {
        let phong: Phong = material.classic();
        let mut surface = StandardSurface::default();
        surface.base.color = phong.kd.map(|v| v.min(1.0));
        surface.schlick = true;
        let (mirror, highlight) = (phong.k.max_component(), phong.ks.max_component());
        if mirror > 0.0 || highlight > 0.0 {
            self.lost
                .add("mirrors and highlights of the chapter, which become nearest surfaces of glTF", &material.name);
        }
        // cosⁿ is about as wide as GGX of α² = 2 / (n + 2).
        let width = (2.0 / (phong.n + 2.0)).sqrt().sqrt();
        if mirror > 0.5 && phong.kd.max_component() < mirror {
            (surface.base.color, surface.base.metalness) = (phong.k.map(|v| v.min(1.0)), 1.0);
            surface.specular.roughness = phong.roughness;
        } else if mirror > 0.0 {
            (surface.specular.color, surface.specular.ior) = (phong.k.map(|v| v.min(1.0)), ALL_REFLECTING);
            surface.specular.roughness = phong.roughness;
        } else if highlight > 0.0 {
            surface.specular.color = phong.ks.map(|v| v.min(1.0));
            surface.specular.roughness = width.min(1.0);
        } else {
            (surface.specular.weight, surface.specular.roughness) = (0.0, 1.0);
        }
        if phong.opacity < 1.0 {
            surface.transmission.weight = 1.0 - phong.opacity;
            surface.specular.ior = phong.eta;
            (surface.specular.weight, surface.schlick, surface.specular.color) = (1.0, false, Rgb::WHITE);
            surface.specular.roughness = phong.roughness;
            surface.transmission.color = surface.base.color;
            if phong.opacity < 0.5 {
                (surface.base.color, surface.transmission.color) = (Rgb::WHITE, Rgb::WHITE);
            }
            absorbing(&mut surface, material);
        }
        surface
    }
}

/// A use of a texture with the range from 0 to 1, and the factor that its own range is. Other ranges stay.
fn without_range(used: &TextureUse) -> (TextureUse, f32) {
    let has_factor = [DIFFUSE, ROUGHNESS, EMISSION, Target::Cutout, target("metalness")].contains(&used.target);
    match has_factor && used.range[0] == 0.0 && used.range[1] > 0.0 {
        true => (TextureUse { range: [0.0, 1.0], ..*used }, used.range[1]),
        false => (*used, 1.0),
    }
}

/// Gives a clear body the absorption of a material's medium.
fn absorbing(surface: &mut StandardSurface, material: &Material) {
    let absorption = material.medium.absorption;
    if absorption.is_black() {
        return;
    }
    let most = absorption.max_component();
    surface.transmission.depth = 1.0 / most;
    surface.transmission.color = absorption.map(|v| libm::exp(f64::from(-v / most)) as f32);
}

/// The roughness and the strength of a stretch, whose axes are those of a stretched surface.
fn isotropic(surface: &StandardSurface) -> (f32, f32) {
    let (roughness, anisotropy) = (surface.specular.roughness, surface.specular.anisotropy);
    if anisotropy == 0.0 {
        return (roughness, 0.0);
    }
    // The widths of facets along and across; glTF has across = r² and along = mix(r², 1, s²).
    let squash = 1.0 - anisotropy;
    let along = roughness * roughness / ((1.0 + squash * squash) / 2.0).sqrt();
    let across = squash * along;
    let strength = if across < 1.0 { ((along - across) / (1.0 - across)).clamp(0.0, 1.0).sqrt() } else { 0.0 };
    (across.sqrt().min(1.0), strength)
}

fn insert(made: &mut Value, key: &str, value: Option<Value>) {
    if let Some(value) = value {
        made[key] = value;
    }
}
