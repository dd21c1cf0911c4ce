//! The node of the integrator.

use super::change;
use crate::text::decode::Decoder;
use crate::text::reader::Fields;
use crate::text::report::Message;
use crate::text::schema::{Field, FieldSchema, NodeSchema, flag, quoted};
use canaletto::scene::{
    Guiding, Integrator, PathSettings, RadiosityMethod, RadiositySettings, RadiosityShow, Shading, ShadowMethod, Stage,
    WhittedSettings, ZbufferSettings,
};
use canaletto::{Named, OutOfRange};

const KIND: Field<Integrator> =
    Field::word("kind", "how the picture is made").or(|| quoted(Integrator::default().name()));
const MAX_DEPTH: Field<u32> = Field::new(
    "max-depth",
    "\"whitted\": rays of this depth have no children; camera rays have depth 1; \"path\": the most surfaces of a path \
         that scatter light, 0 for any number, which is its default",
)
.or(|| WhittedSettings::DEFAULT.max_depth.to_string());
const MIN_WEIGHT: Field<f32> =
    Field::new("min-weight", "\"whitted\": rays that count less than this in the pixel are not followed")
        .or(|| WhittedSettings::DEFAULT.min_weight.to_string());
const STAGE: Field<Stage> = Field::word(
    "stage",
    "\"whitted\": how much of the shading equation is switched on; each stage contains the ones before it",
)
.or(|| quoted(WhittedSettings::DEFAULT.stage.name()));
const SHADOWS: Field<ShadowMethod> = Field::flag_or_word(
    "shadows",
    "whether lights cast shadows; for \"zbuffer\" how: \"map\" or #true by shadow maps, \"none\" or #false without",
)
.or(|| flag(WhittedSettings::DEFAULT.shadows));
const SHADING: Field<Shading> =
    Field::word("shading", "\"zbuffer\": where shading is computed: at triangles, at their corners or at pixels")
        .or(|| quoted(ZbufferSettings::DEFAULT.shading.name()));
const SHADOW_MAP_SIZE: Field<u32> =
    Field::new("shadow-map-size", "\"zbuffer\": the texels along each side of a shadow map, 16 to 8192")
        .or(|| ZbufferSettings::DEFAULT.shadow_map_size.to_string());
const MULTISAMPLING: Field<u32> =
    Field::new("multisampling", "\"zbuffer\": the places in a pixel where visibility is found: 1, 2, 4 or 8")
        .or(|| ZbufferSettings::DEFAULT.multisampling.to_string());
const TOLERANCE: Field<f32> =
    Field::new("tolerance", "\"zbuffer\": how far in pixels the triangles of curved shapes may lie from them")
        .or(|| ZbufferSettings::DEFAULT.tolerance.to_string());

const METHOD: Field<RadiosityMethod> = Field::word(
    "method",
    "\"radiosity\": how the balance of light is found: by links between nodes of a hierarchy, by patches that shoot \
         their light one after the other, or by the equations of all pairs of patches",
)
.or(|| quoted(RadiositySettings::DEFAULT.method.name()));
const ERROR: Field<f32> =
    Field::new("error", "\"radiosity\": the error that is aimed at, relative to the mean light of the scene")
        .or(|| RadiositySettings::DEFAULT.error.to_string());
const SHOW: Field<RadiosityShow> = Field::word(
    "show",
    "\"radiosity\": what the picture shows: patches, colours interpolated between them, or direct light and mirrors \
         over their indirect light",
)
.or(|| quoted(RadiositySettings::DEFAULT.show.name()));
const MAX_PATCHES: Field<u32> = Field::new("max-patches", "\"radiosity\": the most patches, counted for each side")
    .or(|| RadiositySettings::DEFAULT.max_patches.to_string());
const LIGHT_SAMPLES: Field<u32> =
    Field::new("light-samples", "\"radiosity\": shadow rays at each point towards emitting surfaces, 1 to 4096")
        .or(|| RadiositySettings::DEFAULT.light_samples.to_string());

const ROULETTE: Field<bool> =
    Field::new("roulette", "\"path\": whether paths that carry little light are ended at random, without bias")
        .or(|| flag(PathSettings::DEFAULT.roulette));

const GUIDING: Field<Guiding> = Field::word(
    "guiding",
    "\"path\": whether paths learn before the picture where light comes from, and go there: \"auto\" where that pays, \
         \"on\" always, \"off\" never",
)
.or(|| quoted(PathSettings::DEFAULT.guiding.name()));

const DEPTH: &[FieldSchema] = &[MAX_DEPTH.schema];
const WHITTED: &[FieldSchema] = &[MIN_WEIGHT.schema, STAGE.schema];
const ZBUFFER: &[FieldSchema] = &[SHADING.schema, SHADOW_MAP_SIZE.schema, MULTISAMPLING.schema, TOLERANCE.schema];

const RADIOSITY: &[FieldSchema] = &[METHOD.schema, ERROR.schema, SHOW.schema, MAX_PATCHES.schema, LIGHT_SAMPLES.schema];

const PATH: &[FieldSchema] = &[ROULETTE.schema, GUIDING.schema];

pub(crate) static INTEGRATOR: NodeSchema = NodeSchema::new(
    "integrator",
    "How the picture is made.",
    &[DEPTH, WHITTED, &[SHADOWS.schema], ZBUFFER, RADIOSITY, PATH],
)
.argument(KIND.schema)
.example("integrator \"whitted\" { max-depth 3; stage \"reflection\" }");

impl Decoder<'_> {
    pub(super) fn integrator(&mut self, fields: &Fields) {
        // Settings stay where a later file names the kind again.
        if let Some(kind) = fields.word(&KIND).filter(|kind| kind.name() != self.scene.integrator.name()) {
            self.scene.integrator = kind;
        }
        let mut integrator = self.scene.integrator;
        let (own, foreign): (&[&[FieldSchema]], &[&[FieldSchema]]) = match &mut integrator {
            Integrator::Whitted(settings) => {
                self.whitted(fields, settings);
                (&[DEPTH, WHITTED, &[SHADOWS.schema]], &[ZBUFFER, RADIOSITY, PATH])
            }
            Integrator::Zbuffer(settings) => {
                self.zbuffer(fields, settings);
                (&[ZBUFFER, &[SHADOWS.schema]], &[DEPTH, WHITTED, RADIOSITY, PATH])
            }
            Integrator::Radiosity(settings) => {
                self.radiosity(fields, settings);
                (&[RADIOSITY], &[DEPTH, WHITTED, ZBUFFER, &[SHADOWS.schema], PATH])
            }
            Integrator::Path(settings) => {
                self.path(fields, settings);
                (&[DEPTH, PATH], &[WHITTED, ZBUFFER, &[SHADOWS.schema], RADIOSITY])
            }
            _ => (&[], &[]),
        };
        self.scene.integrator = integrator;
        let possible: Vec<&str> = own.iter().flat_map(|words| words.iter()).map(|word| word.name).collect();
        for word in foreign.iter().flat_map(|words| words.iter()).filter(|word| fields.has_named(word.name)) {
            let message = format!("the integrator \"{}\" has no {}", integrator.name(), word.name);
            let message = Message::error(fields.span_of(word.name), message);
            self.validator.report.push(message.help(format!("possible here: {}", possible.join(", "))));
        }
    }

    fn whitted(&mut self, fields: &Fields, settings: &mut WhittedSettings) {
        change(&mut settings.max_depth, fields.get(&MAX_DEPTH));
        change(&mut settings.min_weight, fields.get(&MIN_WEIGHT));
        change(&mut settings.shadows, fields.flag(&SHADOWS));
        change(&mut settings.stage, fields.word(&STAGE));
        if fields.word(&SHADOWS).is_some() {
            let problem = "is for the z-buffer; the integrator \"whitted\" takes #true or #false";
            self.out_of_range(fields, &OutOfRange::new(SHADOWS.name(), problem));
        } else if settings.max_depth == 0 {
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

    fn path(&mut self, fields: &Fields, settings: &mut PathSettings) {
        change(&mut settings.max_depth, fields.get(&MAX_DEPTH));
        change(&mut settings.roulette, fields.flag(&ROULETTE));
        change(&mut settings.guiding, fields.word(&GUIDING));
        if let Err(wrong) = settings.check() {
            self.out_of_range(fields, &wrong);
        }
    }

    fn radiosity(&mut self, fields: &Fields, settings: &mut RadiositySettings) {
        change(&mut settings.method, fields.word(&METHOD));
        change(&mut settings.error, fields.get(&ERROR));
        change(&mut settings.show, fields.word(&SHOW));
        change(&mut settings.max_patches, fields.get(&MAX_PATCHES));
        change(&mut settings.light_samples, fields.get(&LIGHT_SAMPLES));
        if let Err(wrong) = settings.check() {
            self.out_of_range(fields, &wrong);
        }
    }

    fn zbuffer(&mut self, fields: &Fields, settings: &mut ZbufferSettings) {
        let by_flag = fields.flag(&SHADOWS).map(|on| if on { ShadowMethod::Map } else { ShadowMethod::None });
        change(&mut settings.shadows, fields.word(&SHADOWS).or(by_flag));
        change(&mut settings.shading, fields.word(&SHADING));
        change(&mut settings.shadow_map_size, fields.get(&SHADOW_MAP_SIZE));
        change(&mut settings.multisampling, fields.get(&MULTISAMPLING));
        change(&mut settings.tolerance, fields.get(&TOLERANCE));
        if let Err(wrong) = settings.check() {
            self.out_of_range(fields, &wrong);
        }
    }
}
