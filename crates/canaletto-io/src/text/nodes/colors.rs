//! The nodes of the scene's own colours: background and ambient light.

use crate::text::decode::Decoder;
use crate::text::reader::Fields;
use crate::text::schema::{Field, NodeSchema, rgb};
use canaletto::math::Rgb;
use canaletto::scene::Scene;

const BACKGROUND_COLOR: Field<Rgb> =
    Field::new("colour", "the colour").needed().or(|| rgb(Scene::default().background));
const AMBIENT_COLOR: Field<Rgb> = Field::new("colour", "its intensity").needed().or(|| rgb(Scene::default().ambient));

pub(crate) static BACKGROUND: NodeSchema = NodeSchema::new("background", "The colour of rays that meet nothing.", &[])
    .argument(BACKGROUND_COLOR.schema)
    .example("background 0.4 0.4 0.4");

pub(crate) static AMBIENT: NodeSchema =
    NodeSchema::new("ambient", "Iₐ, the light that reaches every point from everywhere.", &[])
        .argument(AMBIENT_COLOR.schema)
        .example("ambient 0.2");

impl Decoder<'_> {
    pub(super) fn background(&mut self, fields: &Fields) {
        self.scene.background = fields.get(&BACKGROUND_COLOR).unwrap_or_default();
        self.doubt_light(fields, &BACKGROUND_COLOR);
    }

    pub(super) fn ambient(&mut self, fields: &Fields) {
        let ambient = fields.get(&AMBIENT_COLOR).unwrap_or_default();
        if ambient.to_array().iter().any(|v| *v < 0.0) {
            let message = format!("{} must not be negative", AMBIENT.name);
            self.validator.report.error(fields.span(&AMBIENT_COLOR), message);
            self.valid = false;
        }
        self.scene.ambient = ambient;
        self.doubt_light(fields, &AMBIENT_COLOR);
    }
}
