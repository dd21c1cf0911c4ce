//! The nodes of textures that are computed, each a function with a ramp of colours.

use super::texture::{TextureNode, kind, texture_node};
use crate::text::decode::Decoder;
use crate::text::reader::Fields;
use crate::text::schema::{Field, FieldSchema, Numbers, quoted};
use canaletto::math::Rgb;
use canaletto::texture::{
    Feature, Function, Gradient, Interpolation, Procedural, Ramp, Spectrum, Stop, TextureKind, Wrap,
};
use canaletto::{Named, OutOfRange};
use glam::Vec3;

const STOPS: Field<Numbers> = Field::groups("stops", 4, "colours at places: the place, then red, green and blue")
    .colors()
    .or(|| "0 0 0 0  1 1 1 1".into());
const STOPS_ALPHA: Field<Numbers> =
    Field::groups("stops-alpha", 5, "the same with an alpha behind each, instead of `stops`").colors();
const INTERPOLATION: Field<Interpolation> =
    Field::word("interpolation", "what is between the stops").or(|| quoted(Interpolation::default().name()));
/// The fields of textures that map to colours through a ramp.
const COLORS: &[FieldSchema] = &[STOPS.schema, STOPS_ALPHA.schema, INTERPOLATION.schema];

const SEED: Field<u32> = Field::new("seed", "another number gives another pattern of the same kind").or(|| "0".into());

const OCTAVES: Field<u32> =
    Field::new("octaves", "how many noises are added up, 1 to 32").or(|| Spectrum::default().octaves.to_string());
const LACUNARITY: Field<f32> = Field::new("lacunarity", "how many times finer each is than the one before, 1 to 16")
    .or(|| Spectrum::default().lacunarity.to_string());
const GAIN: Field<f32> = Field::new("gain", "how strong each is, compared with the one before, 0 to 1")
    .or(|| Spectrum::default().gain.to_string());
const SPECTRUM: &[FieldSchema] = &[OCTAVES.schema, LACUNARITY.schema, GAIN.schema, SEED.schema];

fn spectrum(f: &Fields) -> Spectrum {
    let d = Spectrum::default();
    Spectrum {
        octaves: f.get(&OCTAVES).unwrap_or(d.octaves),
        lacunarity: f.get(&LACUNARITY).unwrap_or(d.lacunarity),
        gain: f.get(&GAIN).unwrap_or(d.gain),
    }
}

/// The default wrap mode of ramps and gradients.
const DEFAULT_RAMP_WRAP: Wrap = Wrap::Clamp;
const RAMP_WRAP: Field<Wrap> = Field::word("wrap", "what is outside of 0 to 1; \"clamp\" goes on to stops beyond")
    .or(|| quoted(DEFAULT_RAMP_WRAP.name()));

fn ramp_wrap(f: &Fields) -> Wrap {
    f.word(&RAMP_WRAP).unwrap_or(DEFAULT_RAMP_WRAP)
}

pub(super) static RAMP: TextureNode = texture_node(
    "A texture of a line: colours along u.",
    &[&[kind(&["ramp"]).needed().schema, RAMP_WRAP.schema], COLORS],
    "texture \"rainbow\" kind=\"ramp\" \
     { stops 0 1 0 0  0.5 0 1 0  1 0 0 1; interpolation \"smooth\"; wrap \"mirror\" }",
    |decoder, f| {
        let ramp = decoder.ramp(f)?;
        decoder.procedural(f, Function::Gradient { shape: Gradient::Linear, wrap: ramp_wrap(f), axis: None }, ramp, 0)
    },
);

const EVEN: Field<Rgb> = Field::new("even", "the colour of the cube from 0 to 1").or(|| "0".into());
const ODD: Field<Rgb> = Field::new("odd", "the colour of its neighbours").or(|| "1".into());

pub(super) static CHECKER: TextureNode = texture_node(
    "Cubes of side 1 in two colours. Their mean over a pixel is exact, if it is a box along the axes.",
    &[&[kind(&["checker"]).needed().schema, EVEN.schema, ODD.schema]],
    "texture \"tiles\" kind=\"checker\" { even 0.1; odd 0.9 0.9 0.8 }",
    |decoder, f| {
        let ramp = decoder.two_colors(f);
        decoder.procedural(f, Function::Checker, ramp, 0)
    },
);

const SHAPE: Field<Gradient> = Field::word(
    "shape",
    "the coordinate along the axis, the distance from the axis or from the origin, or the angle around the axis as a \
     share of the whole turn",
)
.or(|| quoted(Gradient::default().name()));

const GRADIENT_AXIS: Field<Vec3> = Field::new("axis", "the direction of a linear gradient, or the axis of the others")
    .or(|| "1 0 0 for \"linear\", 0 1 0 for the others".into());

pub(super) static GRADIENT: TextureNode = texture_node(
    "Colours by a distance or an angle.",
    &[&[kind(&["gradient"]).needed().schema, SHAPE.schema, GRADIENT_AXIS.schema, RAMP_WRAP.schema], COLORS],
    "texture \"rings\" kind=\"gradient\" { shape \"spherical\"; wrap \"repeat\" }",
    |decoder, f| {
        let shape = f.word(&SHAPE).unwrap_or_default();
        let axis = f.get(&GRADIENT_AXIS);
        if shape == Gradient::Spherical && f.has(&GRADIENT_AXIS) {
            decoder
                .out_of_range(f, &OutOfRange::new(GRADIENT_AXIS.name(), "has no meaning for the shape \"spherical\""));
        }
        let ramp = decoder.ramp(f)?;
        decoder.procedural(f, Function::Gradient { shape, wrap: ramp_wrap(f), axis }, ramp, 0)
    },
);

pub(super) static NOISE: TextureNode = texture_node(
    "Perlin's noise (2002).",
    &[&[kind(&["noise"]).needed().schema, SEED.schema], COLORS],
    "texture \"clouds\" kind=\"noise\" { stops 0.3 0 0 1  0.7 1 1 1 }",
    |decoder, f| decoder.noise(f, Function::Noise),
);

pub(super) static FBM: TextureNode = texture_node(
    "Noises of several frequencies (fractional Brownian motion), 0 to 1 and mostly around 0.5.",
    &[&[kind(&["fbm"]).needed().schema], SPECTRUM, COLORS],
    "texture \"ground\" kind=\"fbm\" { octaves 8; stops 0.3 0.1 0.3 0.1  0.7 0.5 0.4 0.3 }",
    |decoder, f| decoder.noise(f, Function::Fbm(spectrum(f))),
);

pub(super) static TURBULENCE: TextureNode = texture_node(
    "Absolute values of noises of several frequencies, 0 to 1 and mostly around 0.2.",
    &[&[kind(&["turbulence"]).needed().schema], SPECTRUM, COLORS],
    "texture \"smoke\" kind=\"turbulence\" { gain 0.6 }",
    |decoder, f| decoder.noise(f, Function::Turbulence(spectrum(f))),
);

/// The default shift of marble's waves.
const DEFAULT_MARBLE: f32 = 2.0;
const MARBLE_STRENGTH: Field<f32> =
    Field::new("strength", "how many units the waves are shifted by at most").or(|| DEFAULT_MARBLE.to_string());

pub(super) static MARBLE: TextureNode = texture_node(
    "Waves along x, one in each unit, shifted by turbulence.",
    &[&[kind(&["marble"]).needed().schema, MARBLE_STRENGTH.schema], SPECTRUM, COLORS],
    "texture \"veins\" kind=\"marble\" { stops 0 0.05 0.1 0.05  0.7 0.1 0.35 0.2  1 0.8 0.9 0.8 }",
    |decoder, f| {
        let strength = f.get(&MARBLE_STRENGTH).unwrap_or(DEFAULT_MARBLE);
        decoder.noise(f, Function::Marble { spectrum: spectrum(f), strength })
    },
);

/// The default shift of wood's rings.
const DEFAULT_WOOD: f32 = 0.3;
const WOOD_STRENGTH: Field<f32> =
    Field::new("strength", "how many units the rings are shifted by at most").or(|| DEFAULT_WOOD.to_string());

pub(super) static WOOD: TextureNode = texture_node(
    "Rings around the y axis, one in each unit, shifted by noise; each ring runs through the ramp.",
    &[&[kind(&["wood"]).needed().schema, WOOD_STRENGTH.schema], SPECTRUM, COLORS],
    "texture \"oak\" kind=\"wood\" { stops 0 0.5 0.3 0.15  0.8 0.35 0.2 0.1  1 0.2 0.1 0.05 }",
    |decoder, f| {
        let strength = f.get(&WOOD_STRENGTH).unwrap_or(DEFAULT_WOOD);
        decoder.noise(f, Function::Wood { spectrum: spectrum(f), strength })
    },
);

/// The default scatter of Worley's points.
const DEFAULT_JITTER: f32 = 1.0;
const FEATURE: Field<Feature> = Field::word(
    "feature",
    "the distance to the nearest point, to the second nearest, or the difference of the two, which is 0 where cells \
     meet",
)
.or(|| quoted(Feature::default().name()));
const JITTER: Field<f32> =
    Field::new("jitter", "how far points are scattered: 0 a regular grid, 1 anywhere in their cubes")
        .or(|| DEFAULT_JITTER.to_string());

pub(super) static WORLEY: TextureNode = texture_node(
    "Worley's cells around scattered points, one in each unit cube.",
    &[&[kind(&["worley"]).needed().schema, FEATURE.schema, JITTER.schema, SEED.schema], COLORS],
    "texture \"cells\" kind=\"worley\" { feature \"edge\"; stops 0 0 0 0  0.1 1 1 1 }",
    |decoder, f| {
        let feature = f.word(&FEATURE).unwrap_or_default();
        let jitter = f.get(&JITTER).unwrap_or(DEFAULT_JITTER);
        decoder.noise(f, Function::Worley { feature, jitter })
    },
);

impl Decoder<'_> {
    /// A texture with a seed and a ramp.
    fn noise(&mut self, f: &Fields, function: Function) -> Option<TextureKind> {
        let ramp = self.ramp(f)?;
        self.procedural(f, function, ramp, f.get(&SEED).unwrap_or(0))
    }

    /// The texture of these parts, if their numbers are in range.
    fn procedural(&mut self, f: &Fields, function: Function, ramp: Ramp, seed: u32) -> Option<TextureKind> {
        let texture = Procedural { function, ramp, seed };
        if let Err(problem) = texture.check() {
            let with_alpha = problem.field == Some(STOPS.name()) && f.has(&STOPS_ALPHA);
            let field = if with_alpha { Some(STOPS_ALPHA.name()) } else { problem.field };
            self.out_of_range(f, &OutOfRange { field, ..problem });
            return None;
        }
        Some(TextureKind::Procedural(texture))
    }

    /// The ramp from one colour to another.
    fn two_colors(&mut self, f: &Fields) -> Ramp {
        for color in [&EVEN, &ODD] {
            self.doubt_reflectance(f, color);
        }
        let (even, odd) = (f.get(&EVEN).unwrap_or(Rgb::BLACK), f.get(&ODD).unwrap_or(Rgb::WHITE));
        let stop = |at: f32, c: Rgb| Stop { at, color: [c.r, c.g, c.b, 1.0] };
        Ramp { stops: vec![stop(0.0, even), stop(1.0, odd)], ..Ramp::default() }
    }

    /// The ramp of colours at stops.
    fn ramp(&mut self, f: &Fields) -> Option<Ramp> {
        if f.has(&STOPS) && f.has(&STOPS_ALPHA) {
            let span = f.span(&STOPS_ALPHA);
            self.validator.report.error(span, "colours stand in stops or in stops-alpha, not in both");
            return None;
        }
        let numbers = |field: &Field<Numbers>| -> Vec<f32> {
            let values = f.raw(field).map_or(&[][..], |got| got.values);
            values.iter().filter_map(|v| v.as_number().map(|n| n as f32)).collect()
        };
        let stops: Vec<Stop> = if f.has(&STOPS_ALPHA) {
            let stop = |v: &[f32]| Stop { at: v[0], color: [v[1], v[2], v[3], v[4]] };
            numbers(&STOPS_ALPHA).chunks_exact(5).map(stop).collect()
        } else if f.has(&STOPS) {
            let stop = |v: &[f32]| Stop { at: v[0], color: [v[1], v[2], v[3], 1.0] };
            numbers(&STOPS).chunks_exact(4).map(stop).collect()
        } else {
            Ramp::default().stops
        };
        let interpolation = f.word(&INTERPOLATION).unwrap_or_default();
        // The list is empty if its numbers were invalid, which was reported.
        (!stops.is_empty()).then_some(Ramp { stops, interpolation })
    }
}
