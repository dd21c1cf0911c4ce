//! The node of a material.

use super::standard::STANDARD_FIELD;
use super::surface_texture::TEXTURE;
use super::{change, lights};
use crate::text::arithmetic::DIELECTRIC;
use crate::text::decode::Decoder;
use crate::text::reader::Fields;
use crate::text::report::Message;
use crate::text::schema::{Block, Field, FieldSchema, NodeSchema, Text, rgb};
use crate::text::syntax::{self, Node, Span};
use canaletto::material::{
    Conductor, Dielectric, METALS, Material, MaterialModel, Medium, Parameter, ParameterInfo, ParameterValue, Phong,
    Target,
};
use canaletto::math::Rgb;
use canaletto::{Named, OutOfRange};
use std::collections::HashMap;

const NAME: Field<Text> = Field::text("name", "the name that objects refer to").needed();

/// The defaults of the parameters, in the order of their table.
const DEFAULTS: [fn() -> String; Parameter::COUNT] = [
    || default_of(Parameter::Diffuse),
    || default_of(Parameter::Specular),
    || default_of(Parameter::Exponent),
    || default_of(Parameter::Mirror),
    || default_of(Parameter::Eta),
    || default_of(Parameter::Opacity),
    || default_of(Parameter::Roughness),
    || default_of(Parameter::Emission),
];

/// The fields of the parameters of material models.
const PARAMETERS: [FieldSchema; Parameter::COUNT] = {
    let mut fields = [NAME.schema; Parameter::COUNT];
    let mut i = 0;
    while i < Parameter::COUNT {
        let row = &Parameter::ALL[i];
        fields[i] = if row.is_color() { color(row).or(DEFAULTS[i]).schema } else { number(row).or(DEFAULTS[i]).schema };
        i += 1;
    }
    fields
};

const fn color(row: &ParameterInfo) -> Field<Rgb> {
    Field::new(row.name, row.doc)
}

const fn number(row: &ParameterInfo) -> Field<f32> {
    Field::new(row.name, row.doc)
}

fn default_of(parameter: Parameter) -> String {
    match parameter.info().default_value() {
        ParameterValue::Color(color) => rgb(color),
        ParameterValue::Number(number) => number.to_string(),
    }
}

pub(super) const COVERAGE: Field<f32> = Field::new(
    "coverage",
    "the share of the surface that is there, 0 to 1, as alpha has it: the rest shades nothing and bends nothing",
)
.or(|| Material::default().coverage.to_string());
const ALPHA_CUTOFF: Field<f32> = Field::new(
    "alpha-cutoff",
    "the least coverage that counts as all of the surface, 0 to 1; less is a hole, as glTF's mode MASK has it",
);
const PRIORITY: Field<f32> = Field::new(
    "priority",
    "which of several clear bodies fills the place where they overlap: the largest number, then the smallest volume",
)
.or(|| Material::default().priority.to_string());
const TEMPERATURE: Field<f32> = Field::new(
    lights::TEMPERATURE.name(),
    "the colour of the emission by the temperature of a glowing body, 1000 to 40000 kelvin, times the emission",
);
const TWO_SIDED: Field<bool> =
    Field::new("two-sided", "#true lets the inner side emit the emission, too").or(|| "#false".into());
const SHADOW_CATCHER: Field<bool> = Field::new(
    "shadow-catcher",
    "#true: surfaces stand for the scene's background, as a lit floor that looks like it does. A picture with an alpha \
     leaves them out, but for the shadows on them",
)
.or(|| "#false".into());

/// The names of metals.
const METAL_NAMES: [&str; METALS.len()] = {
    let mut names = [""; METALS.len()];
    let mut i = 0;
    while i < METALS.len() {
        names[i] = METALS[i].0;
        i += 1;
    }
    names
};
const METAL: Field<Text> = Field::kind(&METAL_NAMES, "a metal by its name, instead of the numbers");
const METAL_ETA: Field<Rgb> = Field::new("eta", "the index of refraction in red, green and blue, more than 0");
const METAL_K: Field<Rgb> = Field::new("k", "the absorption in red, green and blue, the imaginary part of the index");

/// `conductor` in a material.
pub(crate) static CONDUCTOR: NodeSchema = NodeSchema::new(
    "conductor",
    "A metal by name, or by its measured index of refraction. Its surface is smooth, or rough by the material's \
     `roughness`.",
    &[&[METAL_ETA.schema, METAL_K.schema]],
)
.argument(METAL.schema)
.example("material \"gold\" { conductor \"gold\"; roughness 0.3 }");

const CONDUCTOR_FIELD: Field<Block> =
    Field::block(&CONDUCTOR, "a metal, instead of kd, ks, n, k, eta and opacity; see below");
const DIELECTRIC_FIELD: Field<f32> = Field::new(
    DIELECTRIC,
    "a clear body of this η, or of a medium's name, instead of kd, ks, n, k, eta and opacity: its surface mirrors and \
     refracts by Fresnel's equations",
);
const ABSORPTION: Field<Rgb> = Field::new(
    "absorption",
    "the share of the light that a closed clear body absorbs per unit of length, for path tracing",
)
.or(|| rgb(Medium::VACUUM.absorption));
const SCATTERING: Field<Rgb> =
    Field::new("scattering", "the share of the light that is scattered per unit of length").or(|| rgb(Rgb::BLACK));
const ANISOTROPY: Field<f32> = Field::new(
    "anisotropy",
    "the mean cosine of the scattering, from -1 (back) to 1 (forward), both excluded; 0 scatters to all sides alike",
)
.or(|| Medium::VACUUM.anisotropy.to_string());

/// `medium` in a material.
pub(crate) static MEDIUM: NodeSchema = NodeSchema::new(
    "medium",
    "What fills a closed body, for path tracing: smoke, fog, milk. Without another model the body has no surface; \
     with `dielectric` it has one. Other integrators show the surface only.",
    &[&[ABSORPTION.schema, SCATTERING.schema, ANISOTROPY.schema]],
)
.example("material \"fog\" { medium { absorption 0.1; scattering 0.5; anisotropy 0.3 } }");
const MEDIUM_FIELD: Field<Block> = Field::block(&MEDIUM, "smoke, fog or another medium in a closed body; see below");

/// Two ways to say how much light a medium absorbs.
pub(super) const ABSORPTION_OR_IN_MEDIUM: [&str; 3] = [ABSORPTION.name(), MEDIUM_FIELD.name(), ABSORPTION.name()];

const ALPHA: Field<f32> =
    Field::new("alpha", "instead of roughness: its square, the width of the distribution of microfacets");

/// Two ways to say how rough a surface is.
pub(super) const ROUGHNESS_OR_ALPHA: [&str; 2] = [Parameter::ALL[Parameter::Roughness as usize].name, ALPHA.name()];

/// What the two models leave out.
const OF_PHONG: [Parameter; 6] = [
    Parameter::Diffuse,
    Parameter::Specular,
    Parameter::Exponent,
    Parameter::Mirror,
    Parameter::Eta,
    Parameter::Opacity,
];

pub(crate) static MATERIAL: NodeSchema = NodeSchema::new(
    "material",
    "What a surface does with light: Phong's model, a mirror, a clear body, light of its own. `conductor` and \
     `dielectric` are metals and clear bodies as path tracing has them; other integrators take what comes nearest.",
    &[
        &PARAMETERS,
        &[
            CONDUCTOR_FIELD.schema,
            DIELECTRIC_FIELD.schema,
            STANDARD_FIELD.schema,
            ALPHA.schema,
            ABSORPTION.schema,
            MEDIUM_FIELD.schema,
            TEMPERATURE.schema,
            TWO_SIDED.schema,
            COVERAGE.schema,
            ALPHA_CUTOFF.schema,
            SHADOW_CATCHER.schema,
            PRIORITY.schema,
            TEXTURE.schema,
        ],
    ],
)
.argument(NAME.schema)
.example("material \"glass\" { kd 0 0 1; ks 1; n 50; eta 1.2; opacity 0.4 }");

impl<'a> Decoder<'a> {
    /// Decodes the materials first, so that all objects can refer to them.
    pub(crate) fn materials<'n: 'a>(&mut self, nodes: &'n [Node]) {
        let mut places: HashMap<&str, Span> = HashMap::new();
        for node in nodes.iter().filter(|node| *node.name == *MATERIAL.name) {
            let title = node
                .values
                .first()
                .and_then(|v| v.as_text())
                .map_or("material".into(), |n| format!("material \"{n}\""));
            let unpacked = node.packed.and_then(|_| syntax::unpack(node, self.validator.files.slice(node.span)).pop());
            let fields = self.validator.fields(unpacked.as_ref().unwrap_or(node), &MATERIAL, &title);
            self.valid &= fields.valid;
            // A packed node keeps its name, which outlives the node that was parsed again.
            let kept = node.values.first().and_then(|v| v.as_text()).or_else(|| Some(node.text(NAME.name())?.0));
            let Some(name) = kept.filter(|_| fields.text(&NAME).is_some()) else { continue };
            let span = fields.span(&NAME);
            if let Some(first) = places.insert(name, span) {
                let place = self.validator.files.first(first, span);
                let message = Message::error(span, format!("two materials are called \"{name}\""));
                self.validator.report.push(message.label(place));
                self.valid = false;
                continue;
            }
            let mut material = Material::new(name, Phong::default());
            self.change_material(&fields, &mut material);
            self.materials.insert(name, self.scene.materials.len() as u32);
            self.scene.materials.push(material);
            self.used.push(false);
        }
    }
    /// Changes a material of the scene by the fields of its node.
    pub(crate) fn override_material(&mut self, node: &Node, index: usize) {
        let mut material = std::mem::take(&mut self.scene.materials[index]);
        let fields = self.validator.fields(node, &MATERIAL, &format!("material \"{}\"", material.name));
        self.valid &= fields.valid;
        self.change_material(&fields, &mut material);
        self.scene.materials[index] = material;
    }

    /// The metal or the clear body of a material, if its node has one.
    fn physical_model(&mut self, fields: &Fields) -> Option<MaterialModel> {
        let metal = self.block_or_word(fields, &CONDUCTOR_FIELD);
        let body = fields.get(&DIELECTRIC_FIELD);
        if metal.is_some() && body.is_some() {
            let problem = "and conductor are two models; a material has one";
            self.out_of_range(fields, &OutOfRange::new(DIELECTRIC, problem));
            return None;
        }
        match (metal, body) {
            (Some(Err(name)), _) => Some(Conductor::named(name)?.into()),
            (Some(Ok(inner)), _) => Some(self.metal(fields, &inner)?.into()),
            (None, Some(eta)) if eta > 0.0 && eta.is_finite() => Some(Dielectric::new(eta).into()),
            (None, Some(eta)) => {
                let problem = format!("is {eta}; the coefficient of refraction must be more than 0");
                self.out_of_range(fields, &OutOfRange::new(DIELECTRIC, problem));
                None
            }
            (None, None) => None,
        }
    }

    /// The metal of a block; `None` after a mistake that leaves no metal.
    fn metal(&mut self, fields: &Fields, inner: &Fields) -> Option<Conductor> {
        let named = inner.text(&METAL).and_then(Conductor::named);
        let number = [&METAL_ETA, &METAL_K].into_iter().find(|number| inner.has(number));
        if let Some(number) = number.filter(|_| named.is_some()) {
            let problem = "is given twice, by the metal's name and by a number; leave one out";
            self.out_of_range(inner, &OutOfRange::new(number.name(), problem));
        }
        if named.is_some() {
            return named;
        }
        let (Some(eta), Some(k)) = (inner.get(&METAL_ETA), inner.get(&METAL_K)) else {
            if inner.valid {
                let problem = "needs the name of a metal, or eta and k";
                self.out_of_range(fields, &OutOfRange::new(CONDUCTOR.name, problem));
            }
            return None;
        };
        let metal = Conductor::new(eta, k);
        if let Err(problem) = metal.check() {
            self.out_of_range(inner, &problem);
            return Conductor::named(METAL_NAMES[0]);
        }
        Some(metal)
    }

    /// The medium of a material, if its node has one.
    fn medium(&mut self, fields: &Fields) -> Option<Medium> {
        let inner = self.block(fields, &MEDIUM_FIELD)?;
        let mut medium = Medium::VACUUM;
        change(&mut medium.absorption, inner.get(&ABSORPTION));
        change(&mut medium.scattering, inner.get(&SCATTERING));
        change(&mut medium.anisotropy, inner.get(&ANISOTROPY));
        if inner.has(&ABSORPTION) && fields.has_named(ABSORPTION.name()) {
            let problem = "is given twice, in the medium and beside it; leave one out";
            self.out_of_range(fields, &OutOfRange::new(ABSORPTION.name(), problem));
        }
        if !inner.has(&ABSORPTION) && !inner.has(&SCATTERING) {
            let message = Message::error(fields.span(&MEDIUM_FIELD), "medium needs absorption or scattering");
            self.validator.report.push(message.help(format!("for example: {}", MEDIUM.example)));
            self.valid = false;
        }
        if let Err(problem) = medium.check() {
            self.out_of_range(&inner, &problem);
            return Some(Medium::VACUUM);
        }
        Some(medium)
    }

    /// Reports a medium that no light reaches, as the surface of its body is opaque.
    fn reject_hidden_medium(&mut self, fields: &Fields, material: &Material) {
        if !fields.has(&MEDIUM_FIELD) || !material.is_opaque() {
            return;
        }
        let models = [CONDUCTOR.name, STANDARD_FIELD.name()];
        let mut words = models.into_iter().chain(OF_PHONG.map(|row| row.info().name));
        let word = words.find(|name| fields.has_named(name)).unwrap_or("the material");
        let message =
            format!("medium has no effect behind the opaque surface that {word} gives the body; leave one out");
        let help = "a medium alone has no surface; dielectric beside it is a clear one";
        self.validator.report.push(Message::error(fields.span(&MEDIUM_FIELD), message).help(help));
        self.valid = false;
    }

    /// Warns of words that change nothing about the material.
    fn doubt_effects(&mut self, fields: &Fields, material: &Material) {
        let (clear, emits) = (!material.is_opaque(), material.may_emit());
        let opaque = "no light goes through";
        let clear_body = "a body is clear by dielectric, by opacity less than 1 or by transmission of standard";
        self.doubt_effect(fields, &ABSORPTION, clear, opaque, clear_body);
        self.doubt_effect(fields, &PRIORITY, clear, opaque, clear_body);
        let dark = "the material has no emission";
        self.doubt_effect(fields, &TEMPERATURE, emits, dark, "it is the colour of the emission, as in: emission 5");
    }

    /// Changes what a material of the standard surface has beside its block.
    fn change_beside_standard(&mut self, fields: &Fields, material: &mut Material) {
        let before = self.validator.report.count();
        let in_block =
            Parameter::ALL.iter().map(|row| row.name).chain([ALPHA.name(), ABSORPTION.name(), TEMPERATURE.name()]);
        for name in in_block.filter(|name| fields.has_named(name)) {
            let problem = "isn't of the standard surface, whose numbers stand in its block; leave it out";
            self.out_of_range(fields, &OutOfRange::new(name, problem));
        }
        change(&mut material.coverage, fields.get(&COVERAGE));
        material.alpha_cutoff = fields.get(&ALPHA_CUTOFF).or(material.alpha_cutoff);
        change(&mut material.priority, fields.get(&PRIORITY));
        change(&mut material.two_sided, fields.get(&TWO_SIDED));
        change(&mut material.shadow_catcher, fields.get(&SHADOW_CATCHER));
        let checked = material.check();
        let textures = self.surface_textures(fields);
        if !textures.is_empty() {
            material.textures = textures;
        }
        self.fit_textures_to_standard(fields, material);
        if let Err(problem) = checked {
            self.out_of_range(fields, &problem);
        } else if fields.valid && self.validator.report.count() == before {
            self.reject_hidden_medium(fields, material);
            self.doubt_effects(fields, material);
        }
        self.doubt_two_sided(fields, &TWO_SIDED, material.may_emit());
    }

    /// Gives textures their meaning on a standard surface: its opacity is the share that is there.
    fn fit_textures_to_standard(&mut self, fields: &Fields, material: &mut Material) {
        for texture in &mut material.textures {
            match texture.target {
                Target::Parameter(Parameter::Opacity) => texture.target = Target::Cutout,
                Target::Parameter(Parameter::Diffuse | Parameter::Roughness | Parameter::Emission) => {}
                Target::Parameter(parameter) => {
                    let problem = format!("for {:?} has no meaning on the standard surface", parameter.info().target);
                    self.out_of_range(fields, &OutOfRange::new(TEXTURE.name(), problem));
                }
                _ => {}
            }
        }
    }

    fn change_material(&mut self, fields: &Fields, material: &mut Material) {
        let before = self.validator.report.count();
        let medium = self.medium(fields);
        if self.change_standard(fields, material) {
            change(&mut material.medium, medium);
            self.change_beside_standard(fields, material);
            return;
        }
        // A medium alone has no surface.
        let fills_all = medium.is_some() && OF_PHONG.iter().all(|row| !fields.has_named(row.info().name));
        let bare =
            || (fills_all && matches!(material.model, MaterialModel::Phong(_))).then(|| Dielectric::new(1.0).into());
        let model = self.physical_model(fields).or_else(bare);
        let is_replaced = model.is_some();
        if let Some(model) = model {
            let Phong { roughness, emission, .. } = material.classic();
            material.model = model;
            material.model.set(Parameter::Roughness, ParameterValue::Number(roughness));
            material.model.set(Parameter::Emission, ParameterValue::Color(emission));
        }
        self.either(fields, &number(Parameter::Roughness.info()), &ALPHA);
        let alpha = fields.get(&ALPHA);
        if let Some(alpha) = alpha.filter(|alpha| !(0.0..=1.0).contains(alpha)) {
            let problem = format!("is {alpha}; it must be between 0 (polished) and 1");
            self.out_of_range(fields, &OutOfRange::new(ALPHA.name(), problem));
        }
        if let Some(alpha) = alpha {
            material.model.set(Parameter::Roughness, ParameterValue::Number(alpha.clamp(0.0, 1.0).sqrt()));
        }
        for row in Parameter::ALL {
            let value = if row.is_color() {
                fields.get(&color(row)).map(ParameterValue::Color)
            } else {
                fields.get(&number(row)).map(ParameterValue::Number)
            };
            let Some(value) = value else { continue };
            let is_left_out = is_replaced && OF_PHONG.contains(&row.parameter);
            if is_left_out || !material.model.set(row.parameter, value) {
                let problem = "is of Phong's model, which conductor and dielectric replace; leave it out";
                self.out_of_range(fields, &OutOfRange::new(row.name, problem));
            }
        }
        change(&mut material.medium, medium);
        change(&mut material.medium.absorption, fields.get(&ABSORPTION));
        let glow = self.glow(fields, &TEMPERATURE);
        let emission = material.classic().emission * glow;
        material.model.set(Parameter::Emission, ParameterValue::Color(emission));
        change(&mut material.coverage, fields.get(&COVERAGE));
        material.alpha_cutoff = fields.get(&ALPHA_CUTOFF).or(material.alpha_cutoff);
        change(&mut material.priority, fields.get(&PRIORITY));
        change(&mut material.two_sided, fields.get(&TWO_SIDED));
        change(&mut material.shadow_catcher, fields.get(&SHADOW_CATCHER));
        let checked = material.check();
        let textures = self.surface_textures(fields);
        if let Some(used) = textures.iter().find(|texture| {
            matches!(texture.target, Target::Standard(_) | Target::CoatNormal { .. } | Target::AnisotropyDirection)
        }) {
            let problem = format!("for {:?} has a meaning on the standard surface only", used.target.name());
            self.out_of_range(fields, &OutOfRange::new(TEXTURE.name(), problem));
        }
        if !textures.is_empty() {
            material.textures = textures;
        }
        if let Err(problem) = checked {
            self.out_of_range(fields, &problem);
        } else if fields.valid && self.validator.report.count() == before {
            self.reject_hidden_medium(fields, material);
            self.doubt_effects(fields, material);
        }
        // Radiance may have any size.
        for row in Parameter::ALL.iter().filter(|row| row.is_color() && row.parameter != Parameter::Emission) {
            self.doubt_reflectance(fields, &color(row));
        }
        // Eta beside a metal or a clear body is an error.
        let is_phong = matches!(material.model, MaterialModel::Phong(_));
        self.doubt_eta(fields, &number(Parameter::Eta.info()), !material.is_opaque() || !is_phong);
        self.doubt_two_sided(fields, &TWO_SIDED, material.may_emit());
    }
}
