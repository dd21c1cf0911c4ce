//! Textures.

use super::settings::quoted;
use super::{Takes, Word, Words};
use canaletto::texture::{Filter, Placement, Prefilter, Wrap};

const NAME: Word = Word::new("name", Takes::Text, "the name that materials refer to").needed();

/// The kind of a texture where nothing says so.
pub(crate) const DEFAULT_KIND: &str = "image";

/// The textures, by kind, in the order of the reference.
pub(crate) const TEXTURES: &[(&str, &Words)] = &[("image", &IMAGE)];

/// The words of a kind of texture.
pub(crate) fn texture(kind: &str) -> Option<&'static Words> {
    TEXTURES.iter().find(|(name, _)| *name == kind).map(|(_, words)| *words)
}

const fn kind(word: &'static [&'static str]) -> Word {
    Word::new("kind", Takes::Word(word), "the kind of texture")
}

/// The filters with their words.
pub(crate) const FILTERS: &[(&str, Filter)] = &[
    ("nearest", Filter::Nearest),
    ("bilinear", Filter::Bilinear),
    ("biquadratic", Filter::Biquadratic),
    ("bicubic", Filter::Bicubic),
    ("quadratic-spline", Filter::QuadraticSpline),
    ("cubic-spline", Filter::CubicSpline),
];

/// The prefilters with their words.
pub(crate) const PREFILTERS: &[(&str, Prefilter)] =
    &[("none", Prefilter::None), ("trilinear", Prefilter::Trilinear), ("ewa", Prefilter::Ewa)];

/// The wrap modes with their words.
pub(crate) const WRAPS: &[(&str, Wrap)] = &[
    ("repeat", Wrap::Repeat),
    ("mirror", Wrap::Mirror),
    ("clamp", Wrap::Clamp),
    ("black", Wrap::Black),
    ("transparent", Wrap::Transparent),
];

/// The placements with their words.
pub(crate) const PLACEMENTS: &[(&str, Placement)] = &[("centers", Placement::Centers), ("edges", Placement::Edges)];

const FILTER_WORDS: Takes =
    Takes::Word(&["nearest", "bilinear", "biquadratic", "bicubic", "quadratic-spline", "cubic-spline"]);
const WRAP_WORDS: Takes = Takes::Word(&["repeat", "mirror", "clamp", "black", "transparent"]);

/// The word for a value.
pub(crate) fn word_of<T: PartialEq>(words: &[(&'static str, T)], value: &T) -> String {
    words.iter().find(|(_, v)| v == value).map_or_else(String::new, |(word, _)| quoted(word))
}

static IMAGE: Words = Words::new(
    "texture",
    "An image over the unit square: u runs from its left to its right, v from its top row to its bottom row.",
    &[&[
        kind(&["image"]).or(|| quoted(DEFAULT_KIND)),
        Word::new("file", Takes::Text, "the image: PNG, JPEG, OpenEXR, Radiance HDR or WebP; relative paths start at this file's folder").needed(),
        Word::new("filter", FILTER_WORDS, "how texels become a function").or(|| word_of(FILTERS, &Filter::default())),
        Word::new(
            "prefilter",
            Takes::Word(&["none", "trilinear", "ewa"]),
            "what is done where texels are smaller than pixels: nothing, the mean over a square, or the mean over the pixel's ellipse",
        )
        .or(|| word_of(PREFILTERS, &Prefilter::default())),
        Word::new("wrap", WRAP_WORDS, "what is outside the unit square: the image again, the image mirrored, its border, opaque black, or nothing")
            .or(|| word_of(WRAPS, &Wrap::default())),
        Word::new("wrap-u", WRAP_WORDS, "the same, to the left and to the right only").or(|| "as `wrap`".into()),
        Word::new("wrap-v", WRAP_WORDS, "the same, above and below only").or(|| "as `wrap`".into()),
        Word::new(
            "texels",
            Takes::Word(&["centers", "edges"]),
            "whether u = 0 and u = 1 are the centres of the first and the last texel, as in the textbook, or their outer edges, as in OpenGL: for images made to be repeated and for spheres",
        )
        .or(|| word_of(PLACEMENTS, &Placement::default())),
        Word::new(
            "space",
            Takes::Word(&["srgb", "linear", "raw"]),
            "what the numbers mean: colours on the sRGB curve, linear colours, or no colours at all (heights, normals, masks)",
        )
        .or(|| "as the file says".into()),
    ]],
)
.argument(NAME)
.example("texture \"bricks\" file=\"bricks.png\" { filter \"bilinear\"; wrap \"repeat\"; texels \"edges\" }");
