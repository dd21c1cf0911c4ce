//! The schema of camera, film, integrator, materials and scene-wide colours.

use super::lens::{CAMERA_MOTION, LENS};
use super::motion::{ANIMATION, CAMERA_FOLLOW, PATH};
use super::{FieldSchema, NUMBER, NodeSchema, POINT, SURFACE_TEXTURE, ValueType};
use canaletto::Named;
use canaletto::material::{Material, Phong};
use canaletto::math::Rgb;
use canaletto::scene::{
    Extrinsics, Filter, Integrator, Intrinsics, SamplePattern, SamplerKind, Sampling, Scene, Stage, Tone, Transfer,
    WhittedSettings,
};
use glam::DVec3;

/// The nodes of settings, as opposed to objects, in the order of the reference.
pub(crate) const SETTINGS: &[&NodeSchema] =
    &[&INCLUDE, &BACKGROUND, &AMBIENT, &CAMERA, &FILM, &INTEGRATOR, &MATERIAL, &ANIMATION, &PATH];

static INCLUDE: NodeSchema =
    NodeSchema::new("include", "Puts the nodes of another file here. Only at the top of a file.", &[])
        .argument(
            FieldSchema::new("file", ValueType::Text, "the file; relative paths start at this file's folder").needed(),
        )
        .example("include \"stage.kdl\"");

pub(crate) static BACKGROUND: NodeSchema = NodeSchema::new("background", "The colour of rays that meet nothing.", &[])
    .argument(FieldSchema::new("colour", ValueType::Rgb, "the colour").needed().or(|| rgb(Scene::default().background)))
    .example("background 0.4 0.4 0.4");

pub(crate) static AMBIENT: NodeSchema =
    NodeSchema::new("ambient", "Iₐ, the light that reaches every point from everywhere.", &[])
        .argument(
            FieldSchema::new("colour", ValueType::Rgb, "its intensity").needed().or(|| rgb(Scene::default().ambient)),
        )
        .example("ambient 0.2");

pub(crate) static CAMERA: NodeSchema = NodeSchema::new(
    "camera",
    "A view of the scene. There may be several; the first one is taken where none is named. The angle, the planes and the \
     size are those of `gluPerspective`, the rest those of `gluLookAt`.",
    &[&[
        FieldSchema::new("eye", POINT, "where it stands").or(|| point(Extrinsics::default().eye)),
        FieldSchema::new("center", POINT, "a point that it looks at").or(|| point(Extrinsics::default().center)),
        FieldSchema::new("up", POINT, "a direction that is upwards in the picture").or(|| point(Extrinsics::default().up)),
        FieldSchema::new("fovy", NUMBER, "the whole vertical angle of view in degrees, between 0 and 180")
            .or(|| Intrinsics::default().fovy.to_string()),
        FieldSchema::new("near", NUMBER, "the distance of the projection plane; rays start at the eye all the same")
            .or(|| Intrinsics::default().near.to_string()),
        FieldSchema::new("far", NUMBER, "the far plane, which only a z-buffer needs")
            .or(|| Intrinsics::default().far.to_string()),
        FieldSchema::new("size", ValueType::Counts(2), "width and height of the picture in pixels").or(|| {
            let Intrinsics { width, height, .. } = Intrinsics::default();
            format!("{width} {height}")
        }),
        FieldSchema::new(
            "shift",
            ValueType::Numbers(&[2]),
            "moves the picture's window off the optical axis, in fractions of its width and height",
        )
        .or(|| {
            let [x, y] = Intrinsics::default().shift;
            format!("{x} {y}")
        }),
        FieldSchema::new("lens", ValueType::Node(&LENS), "a lens, for depth of field; see below").or(|| "a pinhole".into()),
        FieldSchema::new(
            "shutter",
            ValueType::Numbers(&[2]),
            "when the shutter opens and closes, in frames from the frame's own time: what keys move is blurred by as much",
        )
        .or(|| {
            let [open, close] = Intrinsics::default().shutter;
            format!("{open} {close}")
        }),
        FieldSchema::new("motion", ValueType::Node(&CAMERA_MOTION), "how it moves while the shutter is open; see below")
            .or(|| "it stays".into()),
        FieldSchema::new("follow", ValueType::Node(&CAMERA_FOLLOW), "a path that the camera moves on, instead of `eye`; see Motion"),
    ]],
)
.argument(FieldSchema::new("name", ValueType::Text, "the name to choose it by").or(|| quoted(DEFAULT_CAMERA)))
.example("camera \"side\" { eye 100 40 40; center 0 0 0; up 0 1 0; fovy 90; size 640 480 }");

/// The default name of a camera.
pub(crate) const DEFAULT_CAMERA: &str = "camera";

pub(crate) static SAMPLE: NodeSchema = NodeSchema::new(
    "sample",
    "Where in a pixel rays go.",
    &[&[
        FieldSchema::new("n", ValueType::Count, "n × n rays in a pixel, for \"regular\" and \"jittered\" (1 to 16), and for the refined pixels of \"adaptive\" (2 to 16)")
            .or(|| SamplePattern::DEFAULT_GRID.to_string()),
        FieldSchema::new("threshold", NUMBER, "for \"adaptive\": differences up to this, 0 to 1, are left as they are")
            .or(|| SamplePattern::DEFAULT_THRESHOLD.to_string()),
    ]],
)
.argument(
    FieldSchema::new(
        "place",
        ValueType::Keyword(SamplePattern::NAMES),
        "one ray through the pixel's lower left corner (the textbook's way) or its centre; n × n rays on a grid, or each \
         at a random place of its cell; or only where corners and centre differ",
    )
    .needed()
    .or(|| Sampling::default().pattern().map_or_else(String::new, |pattern| quoted(pattern.name()))),
);

pub(crate) static FILTER: NodeSchema = NodeSchema::new(
    "filter",
    "How rays become a pixel.",
    &[&[FieldSchema::new("sigma", NUMBER, "for \"gaussian\": the standard deviation in pixels")
        .or(|| Filter::DEFAULT_SIGMA.to_string())]],
)
.argument(
    FieldSchema::new(
        "kind",
        ValueType::Keyword(Filter::NAMES),
        "their mean over the pixel's area, or weighted over its neighbourhood",
    )
    .needed()
    .or(|| quoted(Filter::default().name())),
);

pub(crate) static FILM: NodeSchema = NodeSchema::new(
    "film",
    "How the picture is sampled and developed.",
    &[&[
        FieldSchema::new("sample", ValueType::Node(&SAMPLE), "where in a pixel rays go; see below")
            .or(|| SAMPLE.argument.as_ref().map_or_else(String::new, |word| (word.default)())),
        FieldSchema::new(
            "samples",
            ValueType::Count,
            "this many rays in a pixel (1 to 65536), placed by the sampler; 1 goes through the centre; instead of sample",
        ),
        FieldSchema::new(
            "sampler",
            ValueType::Keyword(SamplerKind::NAMES),
            "how random numbers are spread over a pixel's rays: by Sobol's sequence with Owen's scrambling (the least noise, \
             best with powers of two), on a jittered grid (best with squares), or not at all",
        )
        .or(|| quoted(SamplerKind::default().name())),
        FieldSchema::new("filter", ValueType::Node(&FILTER), "how rays become a pixel; see below")
            .or(|| FILTER.argument.as_ref().map_or_else(String::new, |word| (word.default)())),
        FieldSchema::new(
            "tone",
            ValueType::Keyword(Tone::NAMES),
            "values over 1 are cut, or the picture is divided by its largest one",
        )
        .or(|| quoted(Tone::default().name())),
        FieldSchema::new(
            "transfer",
            ValueType::Keyword(Transfer::NAMES),
            "from linear light to the numbers in the file: as they are, or the sRGB curve",
        )
        .or(|| quoted(Transfer::default().name())),
        FieldSchema::new(
            "crop",
            ValueType::Counts(4),
            "only this part of the picture: x, y (from the top left), width, height in pixels",
        )
        .or(|| "the whole picture".into()),
    ]],
)
.example("film { samples 64; sampler \"sobol\"; filter \"gaussian\" sigma=0.5; tone \"scale\"; transfer \"srgb\" }");

pub(crate) static INTEGRATOR: NodeSchema = NodeSchema::new(
    "integrator",
    "How rays are followed.",
    &[&[
        FieldSchema::new(
            "max-depth",
            ValueType::Count,
            "rays of this depth have no children; the eye's rays have depth 1",
        )
        .or(|| WhittedSettings::default().max_depth.to_string()),
        FieldSchema::new("min-weight", NUMBER, "rays that count less than this in the pixel are not followed")
            .or(|| WhittedSettings::default().min_weight.to_string()),
        FieldSchema::new(
            "stage",
            ValueType::Keyword(Stage::NAMES),
            "how much of the shading equation is switched on; each stage contains the ones before it",
        )
        .or(|| quoted(WhittedSettings::DEFAULT.stage.name())),
        FieldSchema::new("shadows", ValueType::Flag, "whether lights cast shadows")
            .or(|| flag(WhittedSettings::default().shadows)),
    ]],
)
.argument(
    FieldSchema::new("kind", ValueType::Keyword(Integrator::NAMES), "the classic recursive ray tracer")
        .or(|| quoted(Integrator::default().name())),
)
.example("integrator \"whitted\" { max-depth 3; stage \"reflection\" }");

pub(crate) static MATERIAL: NodeSchema = NodeSchema::new(
    "material",
    "What a surface does with light: Phong's model, a mirror, a clear body.",
    &[&[
        FieldSchema::new("kd", ValueType::Rgb, "the colour in diffuse light").or(|| rgb(Phong::default().kd)),
        FieldSchema::new("ks", ValueType::Rgb, "the colour of highlights").or(|| rgb(Phong::default().ks)),
        FieldSchema::new("n", NUMBER, "the exponent of highlights: the larger, the smaller they are")
            .or(|| Phong::default().n.to_string()),
        FieldSchema::new("k", ValueType::Rgb, "the factor of the reflected ray: 0 no mirror, 1 a perfect one")
            .or(|| rgb(Phong::default().k)),
        FieldSchema::new("eta", NUMBER, "the coefficient of refraction, more than 0").or(|| Phong::default().eta.to_string()),
        FieldSchema::new("opacity", NUMBER, "0 clear to 1 opaque, as glass is: its surface shades as a whole")
            .or(|| Phong::default().opacity.to_string()),
        FieldSchema::new(
            "coverage",
            NUMBER,
            "the share of the surface that is there, 0 to 1, as alpha has it: the rest shades nothing and bends nothing",
        )
        .or(|| Material::default().coverage.to_string()),
        FieldSchema::new(
            "priority",
            NUMBER,
            "which of several clear bodies fills the place where they overlap: the largest number, then the smallest volume",
        )
        .or(|| Material::default().priority.to_string()),
        FieldSchema::new(
            "roughness",
            NUMBER,
            "0 polished to 1 rough: scatters mirrored and refracted rays; it takes several rays in a pixel, such as \
             `film { samples 64 }`",
        )
        .or(|| Phong::default().roughness.to_string()),
        FieldSchema::new("texture", ValueType::Node(&SURFACE_TEXTURE), "a texture for any of these, or over all; see below")
            .many(),
    ]],
)
.argument(FieldSchema::new("name", ValueType::Text, "the name that objects refer to").needed())
.example("material \"glass\" { kd 0 0 1; ks 1; n 50; eta 1.2; opacity 0.4 }");

/// A colour as scene text.
pub(crate) fn rgb(c: Rgb) -> String {
    if c == Rgb::gray(c.r) { c.r.to_string() } else { format!("{} {} {}", c.r, c.g, c.b) }
}

fn point(p: DVec3) -> String {
    format!("{} {} {}", p.x, p.y, p.z)
}

pub(crate) fn quoted(word: &str) -> String {
    format!("\"{word}\"")
}

pub(crate) fn flag(value: bool) -> String {
    format!("#{value}")
}
