//! The schema of environments.

use super::settings::{flag, quoted, rgb};
use super::{FieldSchema, NUMBER, NodeSchema, POINT, ValueType};
use canaletto::Named;
use canaletto::light::environment::{Sky, Smoothing};
use canaletto::math::Rgb;

/// The schemas of environments by kind, in the order of the reference.
pub(crate) const ENVIRONMENTS: &[(&str, &NodeSchema)] =
    &[("cube", &CUBE), ("cross", &CROSS), ("lat-long", &LAT_LONG), ("gradient", &GRADIENT), ("sky", &SKY)];

/// The schema of a kind of environment.
pub(crate) fn environment(kind: &str) -> Option<&'static NodeSchema> {
    ENVIRONMENTS.iter().find(|(name, _)| *name == kind).map(|(_, words)| *words)
}

const fn kind(word: &'static [&'static str]) -> FieldSchema {
    FieldSchema::new("kind", ValueType::Keyword(word), "the kind of environment").needed()
}

const fn face(name: &'static str, doc: &'static str) -> FieldSchema {
    FieldSchema::new(name, ValueType::Text, doc).needed()
}

const ALL: &[FieldSchema] = &[
    FieldSchema::new("intensity", ValueType::Rgb, "multiplies all that is seen of it").or(|| rgb(Rgb::WHITE)),
    FieldSchema::new(
        "ambient",
        ValueType::Flag,
        "whether its mean over all directions is added to the scene's ambient light",
    )
    .or(|| flag(false)),
];

const FILTER: &[FieldSchema] = &[FieldSchema::new(
    "filter",
    ValueType::Keyword(Smoothing::NAMES),
    "how texels become a function; bilinear reaches over all edges and averages what is small in the picture",
)
.or(|| quoted(Smoothing::default().name()))];

static CUBE: NodeSchema = NodeSchema::new(
    "environment",
    "Six square pictures of one size: what a camera with a right angle of view sees from the middle of the cube. px, nx, \
     py, ny, pz, nz of sets made for graphics cards are right, left, top, bottom, front, back.",
    &[
        &[
            face("right", "the picture towards +x, y upwards"),
            face("left", "towards −x, y upwards"),
            face("top", "towards +y, after turning up from the front"),
            face("bottom", "towards −y, after turning down from the front"),
            face("front", "towards −z, y upwards"),
            face("back", "towards +z, y upwards"),
        ],
        FILTER,
        ALL,
    ],
)
.argument(kind(&["cube"]))
.transforms()
.example(
    "environment \"cube\" { right \"px.png\"; left \"nx.png\"; top \"py.png\"; bottom \"ny.png\"; front \"pz.png\"; back \"nz.png\" }",
);

static CROSS: NodeSchema = NodeSchema::new(
    "environment",
    "The same six pictures in one, which is 4 × 3 squares (left, front, right and back in the middle row, top and bottom above \
     and below the front) or 3 × 4 (left, front and right; below the front the bottom, and the back on its head).",
    &[&[FieldSchema::new("file", ValueType::Text, "the picture").needed()], FILTER, ALL],
)
.argument(kind(&["cross"]))
.transforms()
.example("environment \"cross\" file=\"cross.png\" { rotate-y 45 }");

static LAT_LONG: NodeSchema = NodeSchema::new(
    "environment",
    "One picture of all directions, twice as wide as high: −z in its middle, +x at three quarters, +y along its upper edge.",
    &[&[FieldSchema::new("file", ValueType::Text, "the picture").needed()], FILTER, ALL],
)
.argument(kind(&["lat-long"]))
.transforms()
.example("environment \"lat-long\" file=\"studio.png\" { rotate-y 90; intensity 2 }");

static GRADIENT: NodeSchema = NodeSchema::new(
    "environment",
    "Colours by height above the horizon.",
    &[
        &[FieldSchema::new(
            "stops",
            ValueType::Many(4),
            "degrees above the horizon, from -90 to 90 and growing, each with the colour `r g b` there; linear in between",
        )
        .needed()],
        ALL,
    ],
)
.argument(kind(&["gradient"]))
.transforms()
.example("environment \"gradient\" { stops -90 0.2 0.18 0.15  0 0.8 0.85 0.9  90 0.1 0.3 0.7 }");

static SKY: NodeSchema = NodeSchema::new(
    "environment",
    "A physical sky by day with its sun. y is up; +x is east and −z north. The sun stands in a direction, at a height and \
     azimuth, or where it is at a place and time.",
    &[
        &[
            FieldSchema::new("sun", POINT, "the direction to the sun").or(|| {
                let s = Sky::default().sun;
                format!("{} {} {}", s.x, s.y, s.z)
            }),
            FieldSchema::new("height", NUMBER, "its height above the horizon, 0 to 90 degrees; goes with azimuth"),
            FieldSchema::new("azimuth", NUMBER, "its compass bearing in degrees: 0 north, 90 east; goes with height"),
            FieldSchema::new("place", ValueType::Numbers(&[2]), "degrees north and east of a place on earth; goes with date"),
            FieldSchema::new("date", ValueType::Text, "when: \"2026-06-21T09:30Z\" or, hours ahead of UTC, \"2026-06-21T11:30+02:00\""),
            FieldSchema::new("turbidity", NUMBER, "2 very clear, 3 clear, 6 hazy, 10 thick").or(|| Sky::default().turbidity.to_string()),
            FieldSchema::new("ground", ValueType::Rgb, "what the ground below the horizon returns of the light, 0 to 1")
                .or(|| rgb(Sky::default().ground)),
            FieldSchema::new("exposure", NUMBER, "stops: each doubles the light").or(|| Sky::default().exposure.to_string()),
            FieldSchema::new("disk", ValueType::Flag, "whether the sun's disk is seen").or(|| flag(Sky::default().disk)),
            FieldSchema::new("light", ValueType::Flag, "whether the sun lights the scene: a directional light called \"sun\"")
                .or(|| flag(Sky::default().light)),
        ],
        ALL,
    ],
)
.argument(kind(&["sky"]))
.transforms()
.example("environment \"sky\" { place 45.44 12.33; date \"2026-05-01T10:00+02:00\"; turbidity 3; ambient }");
