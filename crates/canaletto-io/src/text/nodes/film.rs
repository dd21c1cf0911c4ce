//! The node of the film: where in a pixel rays go, how they become a pixel, and how the picture is developed.

use super::change;
use crate::import::DEFAULT_SAMPLING;
use crate::text::decode::Decoder;
use crate::text::reader::Fields;
use crate::text::report::Message;
use crate::text::schema::{Block, Field, NodeSchema, quoted};
use crate::text::syntax::Span;
use canaletto::Named;
use canaletto::scene::{Exposure, Filter, SamplePattern, SamplerKind, Sampling, Tone, Transfer};

const PLACE: Field<SamplePattern> = Field::word(
    "place",
    "one ray through the pixel's lower left corner (the textbook's way) or its centre; n × n rays on a grid, or each \
     at a random place of its cell; or only where corners and centre differ",
)
.needed()
.or(|| DEFAULT_SAMPLING.pattern().map_or_else(String::new, |pattern| quoted(pattern.name())));
const N: Field<u32> = Field::new(
    "n",
    "n × n rays in a pixel, for \"regular\" and \"jittered\" (1 to 16), and for the refined pixels of \"adaptive\" (2 \
     to 16); without a sample node 3",
)
.or(|| SamplePattern::DEFAULT_GRID.to_string());
const THRESHOLD: Field<f32> =
    Field::new("threshold", "for \"adaptive\": differences up to this, 0 to 1, are left as they are")
        .or(|| SamplePattern::DEFAULT_THRESHOLD.to_string());

/// `sample` in a film.
pub(crate) static SAMPLE: NodeSchema =
    NodeSchema::new("sample", "Where in a pixel rays go.", &[&[N.schema, THRESHOLD.schema]]).argument(PLACE.schema);

const KIND: Field<Filter> = Field::word("kind", "their mean over the pixel's area, or weighted over its neighbourhood")
    .needed()
    .or(|| quoted(Filter::default().name()));
const SIGMA: Field<f32> =
    Field::new("sigma", "for \"gaussian\": the standard deviation in pixels").or(|| Filter::DEFAULT_SIGMA.to_string());

/// `filter` in a film.
pub(crate) static FILTER: NodeSchema =
    NodeSchema::new("filter", "How rays become a pixel.", &[&[SIGMA.schema]]).argument(KIND.schema);

const SAMPLE_FIELD: Field<Block> =
    Field::block(&SAMPLE, "where in a pixel rays go; see below").or(|| (PLACE.schema.default)());
const SAMPLES: Field<u32> = Field::new(
    "samples",
    "this many rays in a pixel (1 to 65536), placed by the sampler; 1 goes through the centre; instead of sample",
);
/// Two ways to place rays in a pixel.
pub(super) const SAMPLE_OR_SAMPLES: [&str; 2] = [SAMPLE.name, SAMPLES.name()];
const SAMPLER: Field<SamplerKind> = Field::word(
    "sampler",
    "how random numbers are spread over a pixel's rays: by Sobol's sequence with Owen's scrambling (the least noise, \
     best with powers of two), on a jittered grid (best with squares), or not at all",
)
.or(|| quoted(SamplerKind::default().name()));
const FILTER_FIELD: Field<Block> =
    Field::block(&FILTER, "how rays become a pixel; see below").or(|| (KIND.schema.default)());
const EXPOSURE: Field<Exposure> = Field::new(
    "exposure",
    "stops of the exposure: 1 doubles the light, -1 halves it; \"auto\" meters the picture as a camera does, and is the \
     default of \"path\" with a tone curve",
)
.or(|| Exposure::default().to_string());
const TONE: Field<Tone> = Field::word(
    "tone",
    "values over 1 are cut, or the picture is divided by its largest one; or curves: AgX, which is like film and \
     the default of \"path\" with transfer \"srgb\", or Khronos' PBR Neutral, which keeps colours of materials",
)
.or(|| quoted(Tone::default().name()));
const TRANSFER: Field<Transfer> =
    Field::word("transfer", "from linear light to the numbers in the file: as they are, or the sRGB curve")
        .or(|| quoted(Transfer::default().name()));
const ALPHA: Field<bool> = Field::new(
    "alpha",
    "whether the background that the camera sees straight on is left out: the picture has an alpha then. Reflections \
     and light of the background stay",
)
.or(|| false.to_string());
/// The only part of the picture that is rendered.
pub(crate) const CROP: Field<[u32; 4]> =
    Field::new("crop", "only this part of the picture: x, y (from the top left), width, height in pixels")
        .or(|| "the whole picture".into());

pub(crate) static FILM: NodeSchema = NodeSchema::new(
    "film",
    "How the picture is sampled and developed.",
    &[&[
        SAMPLE_FIELD.schema,
        SAMPLES.schema,
        SAMPLER.schema,
        FILTER_FIELD.schema,
        EXPOSURE.schema,
        TONE.schema,
        TRANSFER.schema,
        ALPHA.schema,
        CROP.schema,
    ]],
)
.example("film { samples 64; sampler \"sobol\"; filter \"gaussian\"; exposure 0.5; tone \"agx\"; transfer \"srgb\" }");

impl Decoder<'_> {
    pub(super) fn film(&mut self, fields: &Fields) {
        let mut film = self.scene.film;
        if let Some(exposure) = fields.get(&EXPOSURE) {
            let most = Exposure::MOST_STOPS;
            if let Exposure::Stops(stops) = exposure
                && Exposure::stops(stops).is_none()
            {
                let message = format!("exposure is {stops} stops; it must be between -{most} and {most}");
                self.wrong(fields.span(&EXPOSURE), message);
            }
            film.exposure = Some(exposure);
        }
        change(&mut film.tone, fields.word(&TONE).map(Some));
        change(&mut film.transfer, fields.word(&TRANSFER));
        change(&mut film.alpha, fields.get(&ALPHA));
        change(&mut film.crop, fields.get(&CROP).map(Some));
        change(&mut film.sampling, self.sampling(fields));
        change(&mut film.sampler, fields.word(&SAMPLER));
        change(&mut film.filter, self.filter(fields));
        self.scene.film = film;
    }

    fn sampling(&mut self, film: &Fields) -> Option<Sampling> {
        if let Some(samples) = film.get(&SAMPLES) {
            if film.has(&SAMPLE_FIELD) {
                let message = Message::error(film.span(&SAMPLES), "film has either sample or samples");
                self.validator.report.push(
                    message
                        .help("sample says where on a grid rays go; samples how many go where the sampler puts them"),
                );
                self.valid = false;
            }
            if !(1..=Sampling::MAX_SAMPLES).contains(&samples) {
                let message = format!("samples is {samples}; it must be between 1 and {}", Sampling::MAX_SAMPLES);
                self.wrong(film.span(&SAMPLES), message);
            }
            return Some(Sampling::Sampled(samples));
        }
        let inner = self.block_or_word(film, &SAMPLE_FIELD)?;
        let pattern = match &inner {
            Ok(inner) => inner.word(&PLACE)?,
            Err(word) => SamplePattern::from_name(word)?,
        };
        let inner = inner.as_ref().ok();
        let n = inner.and_then(|f| f.get(&N)).unwrap_or(SamplePattern::DEFAULT_GRID);
        let threshold = inner.and_then(|f| f.get(&THRESHOLD)).unwrap_or(SamplePattern::DEFAULT_THRESHOLD);
        let single = matches!(pattern, SamplePattern::Corner | SamplePattern::Center);
        let adaptive = pattern == SamplePattern::Adaptive;
        if let Some(inner) = inner.filter(|inner| single && inner.has(&N)) {
            self.wrong(inner.span(&N), format!("\"{}\" has no n", pattern.name()));
        }
        if let Some(inner) = inner.filter(|inner| !adaptive && inner.has(&THRESHOLD)) {
            self.wrong(inner.span(&THRESHOLD), format!("\"{}\" has no threshold", pattern.name()));
        }
        let least = if adaptive { 2 } else { 1 };
        if !(least..=Sampling::MAX_GRID).contains(&n) {
            let span = inner.map_or(film.node.name_span, |f| f.span(&N));
            self.wrong(span, format!("n is {n}; it must be between {least} and {}", Sampling::MAX_GRID));
        }
        if !(0.0..=1.0).contains(&threshold) {
            let span = inner.map_or(film.node.name_span, |f| f.span(&THRESHOLD));
            self.wrong(span, format!("threshold is {threshold}; it must be between 0 and 1"));
        }
        Some(match pattern {
            SamplePattern::Corner => Sampling::Corner,
            SamplePattern::Center => Sampling::Center,
            SamplePattern::Regular => Sampling::Regular(n),
            SamplePattern::Jittered => Sampling::Jittered(n),
            SamplePattern::Adaptive => Sampling::Adaptive { n, threshold },
        })
    }

    fn filter(&mut self, film: &Fields) -> Option<Filter> {
        let inner = self.block_or_word(film, &FILTER_FIELD)?;
        let mut filter = match &inner {
            Ok(inner) => inner.word(&KIND)?,
            Err(word) => Filter::from_name(word)?,
        };
        let Some(inner) = inner.ok().filter(|inner| inner.has(&SIGMA)) else { return Some(filter) };
        let Filter::Gaussian { sigma } = &mut filter else {
            self.wrong(inner.span(&SIGMA), format!("\"{}\" has no sigma", filter.name()));
            return Some(filter);
        };
        *sigma = inner.get(&SIGMA).unwrap_or(*sigma);
        let sigma = *sigma;
        if !(sigma > 0.0 && sigma <= 4.0) {
            let message = format!("sigma is {sigma}; it must be more than 0 and at most 4 pixels");
            self.wrong(inner.span(&SIGMA), message);
        }
        Some(filter)
    }

    fn wrong(&mut self, span: Span, message: String) {
        self.validator.report.error(span, message);
        self.valid = false;
    }
}
