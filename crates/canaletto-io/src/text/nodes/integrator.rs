//! The node of the integrator.

use super::change;
use crate::text::decode::Decoder;
use crate::text::reader::Fields;
use crate::text::schema::{Field, NodeSchema, flag, quoted};
use canaletto::scene::{Integrator, Stage, WhittedSettings};
use canaletto::{Named, OutOfRange};

const KIND: Field<Integrator> =
    Field::word("kind", "the classic recursive ray tracer").or(|| quoted(Integrator::default().name()));
const MAX_DEPTH: Field<u32> = Field::new("max-depth", "rays of this depth have no children; camera rays have depth 1")
    .or(|| WhittedSettings::DEFAULT.max_depth.to_string());
const MIN_WEIGHT: Field<f32> = Field::new("min-weight", "rays that count less than this in the pixel are not followed")
    .or(|| WhittedSettings::DEFAULT.min_weight.to_string());
const STAGE: Field<Stage> =
    Field::word("stage", "how much of the shading equation is switched on; each stage contains the ones before it")
        .or(|| quoted(WhittedSettings::DEFAULT.stage.name()));
const SHADOWS: Field<bool> =
    Field::new("shadows", "whether lights cast shadows").or(|| flag(WhittedSettings::DEFAULT.shadows));

pub(crate) static INTEGRATOR: NodeSchema = NodeSchema::new(
    "integrator",
    "How rays are followed.",
    &[&[MAX_DEPTH.schema, MIN_WEIGHT.schema, STAGE.schema, SHADOWS.schema]],
)
.argument(KIND.schema)
.example("integrator \"whitted\" { max-depth 3; stage \"reflection\" }");

impl Decoder<'_> {
    pub(super) fn integrator(&mut self, fields: &Fields) {
        // Settings stay where a later file names the kind again.
        if let Some(kind) = fields.word(&KIND).filter(|kind| kind.name() != self.scene.integrator.name()) {
            self.scene.integrator = kind;
        }
        let Some(settings) = self.scene.integrator.whitted_mut() else { return };
        change(&mut settings.max_depth, fields.get(&MAX_DEPTH));
        change(&mut settings.min_weight, fields.get(&MIN_WEIGHT));
        change(&mut settings.shadows, fields.get(&SHADOWS));
        change(&mut settings.stage, fields.word(&STAGE));
        if settings.max_depth == 0 {
            let problem = "is 0; camera rays have depth 1, so it must be at least that";
            self.out_of_range(fields, &OutOfRange::new(MAX_DEPTH.name(), problem));
        } else if settings.max_depth > WhittedSettings::MAX_DEPTH {
            let (depth, most) = (settings.max_depth, WhittedSettings::MAX_DEPTH);
            let problem = format!("is {depth}; it must be at most {most}");
            self.out_of_range(fields, &OutOfRange::new(MAX_DEPTH.name(), problem));
        } else if settings.min_weight < 0.0 {
            self.out_of_range(fields, &OutOfRange::new(MIN_WEIGHT.name(), "must be 0 or more"));
        }
    }
}
