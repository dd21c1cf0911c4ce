//! The schema of textures.

use super::settings::quoted;
use super::{FieldSchema, NUMBER, NodeSchema, ValueType};
use canaletto::texture::{ColorSpace, Feature, Filter, Gradient, Interpolation, Placement, Prefilter, Spectrum, Wrap};
use canaletto::{Named, named};

const NAME: FieldSchema = FieldSchema::new("name", ValueType::Text, "the name that materials refer to").needed();

/// The default kind of a texture.
pub(crate) const DEFAULT_KIND: &str = "image";

/// The schemas of textures by kind, in the order of the reference.
pub(crate) const TEXTURES: &[(&str, &NodeSchema)] = &[
    ("image", &IMAGE),
    ("ramp", &RAMP),
    ("grid", &GRID),
    ("checker", &CHECKER),
    ("gradient", &GRADIENT),
    ("noise", &NOISE),
    ("fbm", &FBM),
    ("turbulence", &TURBULENCE),
    ("marble", &MARBLE),
    ("wood", &WOOD),
    ("worley", &WORLEY),
];

/// The schema of a kind of texture.
pub(crate) fn texture(kind: &str) -> Option<&'static NodeSchema> {
    TEXTURES.iter().find(|(name, _)| *name == kind).map(|(_, words)| *words)
}

const fn kind(word: &'static [&'static str]) -> FieldSchema {
    FieldSchema::new("kind", ValueType::Keyword(word), "the kind of texture")
}

const FILTER_WORDS: ValueType = ValueType::Keyword(Filter::NAMES);
const WRAP_WORDS: ValueType = ValueType::Keyword(Wrap::NAMES);
/// Grids have no EWA, the last of the prefilters.
const GRID_PREFILTERS: &[&str] = Prefilter::NAMES.split_at(2).0;

const SPACE: FieldSchema = FieldSchema::new(
    "space",
    ValueType::Keyword(ColorSpace::NAMES),
    "what the numbers mean: colours on the sRGB curve, linear colours, or no colours at all (heights, normals, masks)",
)
.or(|| "as the file says".into());

static IMAGE: NodeSchema = NodeSchema::new(
    "texture",
    "An image over the unit square: u runs from its left to its right, v from its top row to its bottom row.",
    &[&[
        kind(&["image"]).or(|| quoted(DEFAULT_KIND)),
        FieldSchema::new("file", ValueType::Text, "the image: PNG, JPEG, OpenEXR, Radiance HDR or WebP; relative paths start at this file's folder").needed(),
        FieldSchema::new("filter", FILTER_WORDS, "how texels become a function").or(|| quoted(Filter::default().name())),
        FieldSchema::new(
            "prefilter",
            ValueType::Keyword(Prefilter::NAMES),
            "what is done where texels are smaller than pixels: nothing, the mean over a square, or the mean over the pixel's ellipse",
        )
        .or(|| quoted(Prefilter::default().name())),
        FieldSchema::new("wrap", WRAP_WORDS, "what is outside the unit square: the image again, the image mirrored, its border, opaque black, or nothing")
            .or(|| quoted(Wrap::default().name())),
        FieldSchema::new("wrap-u", WRAP_WORDS, "the same, to the left and to the right only").or(|| "as `wrap`".into()),
        FieldSchema::new("wrap-v", WRAP_WORDS, "the same, above and below only").or(|| "as `wrap`".into()),
        FieldSchema::new(
            "texels",
            ValueType::Keyword(Placement::NAMES),
            "whether u = 0 and u = 1 are the centres of the first and the last texel, as in the textbook, or their outer edges, as in OpenGL: for images made to be repeated and for spheres",
        )
        .or(|| quoted(Placement::default().name())),
        SPACE,
    ]],
)
.argument(NAME)
.example("texture \"bricks\" file=\"bricks.png\" { filter \"bilinear\"; wrap \"repeat\"; texels \"edges\" }");

/// The numbers of a grid without a header.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum VoxelFormat {
    /// Bytes.
    #[default]
    U8,
    /// 16 bits without a sign.
    U16,
    /// Floating-point numbers.
    F32,
}

named!(VoxelFormat {
    U8 => "u8",
    U16 => "u16",
    F32 => "f32",
});

/// The default shift of marble's waves and of wood's rings.
pub(crate) const DEFAULT_MARBLE: f32 = 2.0;
pub(crate) const DEFAULT_WOOD: f32 = 0.3;
/// The default scatter of Worley's points.
pub(crate) const DEFAULT_JITTER: f32 = 1.0;
/// The default wrap mode of ramps and gradients.
pub(crate) const DEFAULT_RAMP_WRAP: Wrap = Wrap::Clamp;

/// The fields of textures that map to colours through a ramp.
const COLORS: &[FieldSchema] = &[
    FieldSchema::new("stops", ValueType::Many(4), "colours at places: the place, then red, green and blue")
        .or(|| "0 0 0 0  1 1 1 1".into()),
    FieldSchema::new("stops-alpha", ValueType::Many(5), "the same with an alpha behind each, instead of `stops`"),
    FieldSchema::new("interpolation", ValueType::Keyword(Interpolation::NAMES), "what is between the stops")
        .or(|| quoted(Interpolation::default().name())),
];

const SEED: FieldSchema =
    FieldSchema::new("seed", ValueType::Count, "another number gives another pattern of the same kind")
        .or(|| "0".into());

const SPECTRUM: &[FieldSchema] = &[
    FieldSchema::new("octaves", ValueType::Count, "how many noises are added up, 1 to 32")
        .or(|| Spectrum::default().octaves.to_string()),
    FieldSchema::new("lacunarity", NUMBER, "how many times finer each is than the one before, 1 to 16")
        .or(|| Spectrum::default().lacunarity.to_string()),
    FieldSchema::new("gain", NUMBER, "how strong each is, compared with the one before, 0 to 1")
        .or(|| Spectrum::default().gain.to_string()),
    SEED,
];

const RAMP_WRAP: FieldSchema =
    FieldSchema::new("wrap", WRAP_WORDS, "what is outside of 0 to 1; \"clamp\" goes on to stops beyond")
        .or(|| quoted(DEFAULT_RAMP_WRAP.name()));

static RAMP: NodeSchema = NodeSchema::new(
    "texture",
    "A texture of a line: colours along u.",
    &[&[kind(&["ramp"]).needed(), RAMP_WRAP], COLORS],
)
.argument(NAME)
.example("texture \"rainbow\" kind=\"ramp\" { stops 0 1 0 0  0.5 0 1 0  1 0 0 1; interpolation \"smooth\"; wrap \"mirror\" }");

static GRID: NodeSchema = NodeSchema::new(
    "texture",
    "A texture of space, stored: voxels in the unit cube, which covers the object's bounding box. They stand in a `file` of numbers without a header, or in a `stack` of images.",
    &[&[
        kind(&["grid"]).needed(),
        FieldSchema::new("file", ValueType::Text, "numbers without a header, the lowest byte first: x runs fastest, z slowest"),
        FieldSchema::new("size", ValueType::Counts(3), "for `file`: voxels along x, y and z"),
        FieldSchema::new("format", ValueType::Keyword(VoxelFormat::NAMES), "for `file`: what its numbers are; whole ones stand for 0 to 1")
            .or(|| quoted(VoxelFormat::default().name())),
        FieldSchema::new("channels", ValueType::Count, "for `file`: numbers of each voxel, 1 grey, 2 grey and alpha, 3 RGB, 4 RGB and alpha")
            .or(|| "1".into()),
        FieldSchema::new("stack", ValueType::Text, "images of slices, `####` standing for their numbers: \"slice-###.png\""),
        FieldSchema::new("slices", ValueType::Counts(2), "for `stack`: the numbers of the first and the last slice"),
        FieldSchema::new("filter", FILTER_WORDS, "how voxels become a function").or(|| quoted(Filter::default().name())),
        FieldSchema::new(
            "prefilter",
            ValueType::Keyword(GRID_PREFILTERS),
            "what is done where voxels are smaller than pixels: nothing, or the mean over a cube",
        )
        .or(|| quoted(Prefilter::Trilinear.name())),
        FieldSchema::new("wrap", WRAP_WORDS, "what is outside of the unit cube").or(|| quoted(Wrap::default().name())),
        FieldSchema::new(
            "texels",
            ValueType::Keyword(Placement::NAMES),
            "whether 0 and 1 are the centres of the outermost voxels or their outer edges",
        )
        .or(|| quoted(Placement::default().name())),
        SPACE,
    ]],
)
.argument(NAME)
.example("texture \"scan\" kind=\"grid\" stack=\"slice-##.png\" { slices 1 2; filter \"bicubic\"; wrap \"clamp\" }");

static CHECKER: NodeSchema = NodeSchema::new(
    "texture",
    "Cubes of side 1 in two colours. Their mean over a pixel is exact, if it is a box along the axes.",
    &[&[
        kind(&["checker"]).needed(),
        FieldSchema::new("even", ValueType::Rgb, "the colour of the cube from 0 to 1").or(|| "0".into()),
        FieldSchema::new("odd", ValueType::Rgb, "the colour of its neighbours").or(|| "1".into()),
    ]],
)
.argument(NAME)
.example("texture \"tiles\" kind=\"checker\" { even 0.1; odd 0.9 0.9 0.8 }");

static GRADIENT: NodeSchema = NodeSchema::new(
    "texture",
    "Colours by a distance or an angle.",
    &[
        &[
            kind(&["gradient"]).needed(),
            FieldSchema::new(
                "shape",
                ValueType::Keyword(Gradient::NAMES),
                "x, the distance from the y axis, the distance from the origin, or the angle around the y axis as a share of the whole turn",
            )
            .or(|| quoted(Gradient::default().name())),
            RAMP_WRAP,
        ],
        COLORS,
    ],
)
.argument(NAME)
.example("texture \"rings\" kind=\"gradient\" { shape \"spherical\"; wrap \"repeat\" }");

static NOISE: NodeSchema =
    NodeSchema::new("texture", "Perlin's noise (2002).", &[&[kind(&["noise"]).needed(), SEED], COLORS])
        .argument(NAME)
        .example("texture \"clouds\" kind=\"noise\" { stops 0.3 0 0 1  0.7 1 1 1 }");

static FBM: NodeSchema = NodeSchema::new(
    "texture",
    "Noises of several frequencies (fractional Brownian motion), 0 to 1 and mostly around 0.5.",
    &[&[kind(&["fbm"]).needed()], SPECTRUM, COLORS],
)
.argument(NAME)
.example("texture \"ground\" kind=\"fbm\" { octaves 8; stops 0.3 0.1 0.3 0.1  0.7 0.5 0.4 0.3 }");

static TURBULENCE: NodeSchema = NodeSchema::new(
    "texture",
    "Absolute values of noises of several frequencies, 0 to 1 and mostly around 0.2.",
    &[&[kind(&["turbulence"]).needed()], SPECTRUM, COLORS],
)
.argument(NAME)
.example("texture \"smoke\" kind=\"turbulence\" { gain 0.6 }");

static MARBLE: NodeSchema = NodeSchema::new(
    "texture",
    "Waves along x, one in each unit, shifted by turbulence.",
    &[
        &[
            kind(&["marble"]).needed(),
            FieldSchema::new("strength", NUMBER, "how many units the waves are shifted by at most")
                .or(|| DEFAULT_MARBLE.to_string()),
        ],
        SPECTRUM,
        COLORS,
    ],
)
.argument(NAME)
.example("texture \"veins\" kind=\"marble\" { stops 0 0.05 0.1 0.05  0.7 0.1 0.35 0.2  1 0.8 0.9 0.8 }");

static WOOD: NodeSchema = NodeSchema::new(
    "texture",
    "Rings around the y axis, one in each unit, shifted by noise; each ring runs through the ramp.",
    &[
        &[
            kind(&["wood"]).needed(),
            FieldSchema::new("strength", NUMBER, "how many units the rings are shifted by at most")
                .or(|| DEFAULT_WOOD.to_string()),
        ],
        SPECTRUM,
        COLORS,
    ],
)
.argument(NAME)
.example("texture \"oak\" kind=\"wood\" { stops 0 0.5 0.3 0.15  0.8 0.35 0.2 0.1  1 0.2 0.1 0.05 }");

static WORLEY: NodeSchema = NodeSchema::new(
    "texture",
    "Worley's cells around scattered points, one in each unit cube.",
    &[
        &[
            kind(&["worley"]).needed(),
            FieldSchema::new(
                "feature",
                ValueType::Keyword(Feature::NAMES),
                "the distance to the nearest point, to the second nearest, or the difference of the two, which is 0 where cells meet",
            )
            .or(|| quoted(Feature::default().name())),
            FieldSchema::new("jitter", NUMBER, "how far points are scattered: 0 a regular grid, 1 anywhere in their cubes")
                .or(|| DEFAULT_JITTER.to_string()),
            SEED,
        ],
        COLORS,
    ],
)
.argument(NAME)
.example("texture \"cells\" kind=\"worley\" { feature \"edge\"; stops 0 0 0 0  0.1 1 1 1 }");
