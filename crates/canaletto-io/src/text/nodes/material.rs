//! The node of a material.

use super::surface_texture::TEXTURE;
use crate::text::decode::Decoder;
use crate::text::report::Message;
use crate::text::schema::{Field, NodeSchema, Text, rgb};
use crate::text::syntax::{self, Node, Span};
use canaletto::material::{Material, Phong};
use canaletto::math::Rgb;
use std::collections::HashMap;

const NAME: Field<Text> = Field::text("name", "the name that objects refer to").needed();
const KD: Field<Rgb> = Field::new("kd", "the colour in diffuse light").or(|| rgb(Phong::default().kd));
const KS: Field<Rgb> = Field::new("ks", "the colour of highlights").or(|| rgb(Phong::default().ks));
const N: Field<f32> = Field::new("n", "the exponent of highlights: the larger, the smaller they are")
    .or(|| Phong::default().n.to_string());
const K: Field<Rgb> =
    Field::new("k", "the factor of the reflected ray: 0 no mirror, 1 a perfect one").or(|| rgb(Phong::default().k));
const ETA: Field<f32> =
    Field::new("eta", "the coefficient of refraction, more than 0").or(|| Phong::default().eta.to_string());
const OPACITY: Field<f32> = Field::new("opacity", "0 clear to 1 opaque, as glass is: its surface shades as a whole")
    .or(|| Phong::default().opacity.to_string());
const COVERAGE: Field<f32> = Field::new(
    "coverage",
    "the share of the surface that is there, 0 to 1, as alpha has it: the rest shades nothing and bends nothing",
)
.or(|| Material::default().coverage.to_string());
const PRIORITY: Field<f32> = Field::new(
    "priority",
    "which of several clear bodies fills the place where they overlap: the largest number, then the smallest volume",
)
.or(|| Material::default().priority.to_string());
const ROUGHNESS: Field<f32> = Field::new(
    "roughness",
    "0 polished to 1 rough: scatters mirrored and refracted rays; it takes several rays in a pixel, such as \
     `film { samples 64 }`",
)
.or(|| Phong::default().roughness.to_string());

pub(crate) static MATERIAL: NodeSchema = NodeSchema::new(
    "material",
    "What a surface does with light: Phong's model, a mirror, a clear body.",
    &[&[
        KD.schema,
        KS.schema,
        N.schema,
        K.schema,
        ETA.schema,
        OPACITY.schema,
        COVERAGE.schema,
        PRIORITY.schema,
        ROUGHNESS.schema,
        TEXTURE.schema,
    ]],
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
            let d = Phong::default();
            let phong = Phong {
                kd: fields.get(&KD).unwrap_or(d.kd),
                ks: fields.get(&KS).unwrap_or(d.ks),
                n: fields.get(&N).unwrap_or(d.n),
                k: fields.get(&K).unwrap_or(d.k),
                eta: fields.get(&ETA).unwrap_or(d.eta),
                opacity: fields.get(&OPACITY).unwrap_or(d.opacity),
                roughness: fields.get(&ROUGHNESS).unwrap_or(d.roughness),
            };
            let mut material = Material::new(name, phong);
            material.coverage = fields.get(&COVERAGE).unwrap_or(material.coverage);
            material.priority = fields.get(&PRIORITY).unwrap_or(material.priority);
            let checked = material.check();
            material.textures = self.surface_textures(&fields);
            if let Err(problem) = checked {
                self.out_of_range(&fields, &problem);
            }
            for color in [&KD, &KS, &K] {
                self.doubt_reflectance(&fields, color);
            }
            self.doubt_eta(&fields, &ETA, !material.is_opaque());
            self.materials.insert(name, self.scene.materials.len() as u32);
            self.scene.materials.push(material);
            self.used.push(false);
        }
    }
}
