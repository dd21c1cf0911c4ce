//! The schema of shapes, meshes, clouds, groups and lights.

use super::motion::FOLLOW;
use super::settings::{flag, quoted};
use super::{FieldSchema, NUMBER, NodeSchema, POINT, ValueType};
use canaletto::Named;
use canaletto::light::{Emission, Light, LightKind, Omni};
use canaletto::math::Rgb;
use glam::Vec3;

/// The transforms of an object.
pub(crate) const TRANSFORMS: &[FieldSchema] = &[
    FieldSchema::new("translate", POINT, "moves by x y z"),
    FieldSchema::new(
        "rotate-x",
        NUMBER,
        "turns around the x axis by degrees, counter-clockwise with the axis towards the viewer",
    ),
    FieldSchema::new("rotate-y", NUMBER, "turns around the y axis by degrees"),
    FieldSchema::new("rotate-z", NUMBER, "turns around the z axis by degrees"),
    FieldSchema::new(
        "rotate",
        ValueType::Numbers(&[4]),
        "turns around the axis x y z by degrees: the axis, then the angle",
    ),
    FieldSchema::new(
        "scale",
        ValueType::Numbers(&[1, 3]),
        "scales by a factor, or by one for each axis; a negative one mirrors",
    ),
    FieldSchema::new(
        "matrix",
        ValueType::Numbers(&[12, 16]),
        "a matrix, row by row; of 16 numbers the last row is 0 0 0 1",
    ),
    FieldSchema::new("follow", ValueType::Node(&FOLLOW), "moves to a place on a path; see Motion"),
];

const NAME: FieldSchema =
    FieldSchema::new("name", ValueType::Text, "its name, for instances, `--set` and explanations");
const MATERIAL: FieldSchema =
    FieldSchema::new("material", ValueType::Text, "the material's name").or(|| "its group's".into());

const OBJECT: &[FieldSchema] = &[NAME, MATERIAL];

/// Whether cylinders and cones are capped by default.
pub(crate) const DEFAULT_CAPS: bool = true;
/// The default top radius of a cone.
pub(crate) const DEFAULT_TOP_RADIUS: f32 = 0.0;
/// The default number of points of a disk light, as in the chapter.
pub(crate) const DEFAULT_POINTS: u32 = 16;
/// The default intensity of a light.
pub(crate) const DEFAULT_INTENSITY: f32 = 1.0;
/// The default inner angle of a spotlight.
pub(crate) const DEFAULT_INNER: f32 = 0.0;

const CAPS: FieldSchema =
    FieldSchema::new("caps", ValueType::Flag, "whether the ends are closed").or(|| flag(DEFAULT_CAPS));
const ONE_SIDED: FieldSchema =
    FieldSchema::new("one-sided", ValueType::Flag, "whether rays from behind pass through").or(|| flag(false));

/// The nodes that are allowed in groups, except lights, in the order of the reference.
pub(crate) const OBJECTS: &[&NodeSchema] = &[
    &SPHERE, &BOX, &TRIANGLE, &PLANE, &DISK, &CYLINDER, &CONE, &TORUS, &MESH, &SPHERES, &CYLINDERS, &GROUP, &PROTOTYPE,
    &INSTANCE,
];

static SPHERE: NodeSchema = NodeSchema::new(
    "sphere",
    "A sphere.",
    &[
        &[
            FieldSchema::new("center", POINT, "its centre").needed(),
            FieldSchema::new("radius", NUMBER, "its radius, more than 0").needed(),
        ],
        OBJECT,
    ],
)
.transforms()
.example("sphere material=\"blue\" { center 0 20 0; radius 25 }");

static BOX: NodeSchema = NodeSchema::new(
    "box",
    "A box along the axes; turn it with a transform.",
    &[
        &[
            FieldSchema::new("min", POINT, "the corner of smallest coordinates").needed(),
            FieldSchema::new("max", POINT, "the corner of largest coordinates").needed(),
        ],
        OBJECT,
    ],
)
.transforms()
.example("box { min -80 -50 -50; max 50 -45 50; rotate-y 30 }");

static TRIANGLE: NodeSchema = NodeSchema::new(
    "triangle",
    "A triangle, its corners counter-clockwise seen from outside.",
    &[
        &[
            FieldSchema::new("a", POINT, "a corner").needed(),
            FieldSchema::new("b", POINT, "a corner").needed(),
            FieldSchema::new("c", POINT, "a corner").needed(),
            ONE_SIDED,
        ],
        OBJECT,
    ],
)
.transforms()
.example("triangle { a 3 2 1; b 8 2 1; c 4 8 -4 }");

static PLANE: NodeSchema = NodeSchema::new(
    "plane",
    "A plane without end.",
    &[
        &[
            FieldSchema::new("point", POINT, "a point of it").needed(),
            FieldSchema::new("normal", POINT, "the direction of its outer side").needed(),
        ],
        OBJECT,
    ],
)
.transforms()
.example("plane { point 0 -50 0; normal 0 1 0 }");

static DISK: NodeSchema = NodeSchema::new(
    "disk",
    "A flat disk.",
    &[
        &[
            FieldSchema::new("center", POINT, "its centre").needed(),
            FieldSchema::new("normal", POINT, "the direction of its outer side").needed(),
            FieldSchema::new("radius", NUMBER, "its radius, more than 0").needed(),
        ],
        OBJECT,
    ],
)
.transforms()
.example("disk { center 0 0 0; normal 0 1 0; radius 3 }");

static CYLINDER: NodeSchema = NodeSchema::new(
    "cylinder",
    "A cylinder between two points.",
    &[
        &[
            FieldSchema::new("base", POINT, "the centre of one end").needed(),
            FieldSchema::new("top", POINT, "the centre of the other end").needed(),
            FieldSchema::new("radius", NUMBER, "its radius, more than 0").needed(),
            CAPS,
        ],
        OBJECT,
    ],
)
.transforms()
.example("cylinder { base 0 0 0; top 0 10 0; radius 2; caps #false }");

static CONE: NodeSchema = NodeSchema::new(
    "cone",
    "A cone, or a truncated one.",
    &[
        &[
            FieldSchema::new("base", POINT, "the centre of its base").needed(),
            FieldSchema::new("top", POINT, "its apex, or the centre of its upper end").needed(),
            FieldSchema::new("radius", NUMBER, "its radius at the base").needed(),
            FieldSchema::new("top-radius", NUMBER, "its radius at the top").or(|| DEFAULT_TOP_RADIUS.to_string()),
            CAPS,
        ],
        OBJECT,
    ],
)
.transforms()
.example("cone { base 0 0 0; top 0 5 0; radius 2; top-radius 0.5 }");

static TORUS: NodeSchema = NodeSchema::new(
    "torus",
    "A tube around a circle.",
    &[
        &[
            FieldSchema::new("center", POINT, "its centre").needed(),
            FieldSchema::new("axis", POINT, "the direction that it is round about").needed(),
            FieldSchema::new("radius", NUMBER, "the circle's radius").needed(),
            FieldSchema::new("tube", NUMBER, "the tube's radius").needed(),
        ],
        OBJECT,
    ],
)
.transforms()
.example("torus { center 0 0 0; axis 0 1 0; radius 5; tube 1 }");

static MESH: NodeSchema = NodeSchema::new(
    "mesh",
    "Triangles from a file: OBJ (with its MTL materials) or PLY. A material given here replaces the file's own.",
    &[
        &[
            FieldSchema::new("file", ValueType::Text, "the file; relative paths start at this file's folder").needed(),
            FieldSchema::new(
                "smooth",
                ValueType::Flag,
                "#true makes normals at the vertices from the faces around them, #false leaves out those of the file",
            )
            .or(|| "as in the file".into()),
            ONE_SIDED,
        ],
        OBJECT,
    ],
)
.transforms()
.example("mesh file=\"bunny.obj\" material=\"blue\" { scale 10; rotate-y 30; translate 0 1 0 }");

const CLOUD_FILE: FieldSchema =
    FieldSchema::new("file", ValueType::Text, "a file with them: .csv, .tsv, .xyz, .txt, .ply or .bin; see below");

static SPHERES: NodeSchema = NodeSchema::new(
    "spheres",
    "A cloud: many spheres as one object, up to many millions. They stand in `points`, `data` or `file`.",
    &[
        &[
            FieldSchema::new("points", ValueType::Many(3), "the centres"),
            FieldSchema::new(
                "data",
                ValueType::Text,
                "lines of `x y z`, `x y z radius`, `x y z r g b` or `x y z radius r g b`; # starts a comment",
            ),
            CLOUD_FILE,
            FieldSchema::new("radius", NUMBER, "the radius of those that have none of their own"),
        ],
        OBJECT,
    ],
)
.transforms()
.example("spheres radius=1 material=\"blue\" { points 0 0 0  2 0 0  4 0 0 }");

static CYLINDERS: NodeSchema = NodeSchema::new(
    "cylinders",
    "A cloud of cylinders. They stand in `axes`, `data` or `file`.",
    &[
        &[
            FieldSchema::new("axes", ValueType::Many(6), "the two ends of each axis"),
            FieldSchema::new(
                "data",
                ValueType::Text,
                "lines of `x y z x y z`, each with a radius, a colour `r g b` or both behind it; # starts a comment",
            ),
            CLOUD_FILE,
            FieldSchema::new("radius", NUMBER, "the radius of those that have none of their own"),
            CAPS,
        ],
        OBJECT,
    ],
)
.transforms()
.example("cylinders radius=0.5 { axes 0 0 0 0 5 0  2 0 0 2 5 0 }");

static GROUP: NodeSchema = NodeSchema::new(
    "group",
    "Objects and lights that move together. Its material holds for what has none of its own.",
    &[OBJECT],
)
.transforms()
.objects()
.example("group name=\"lamp\" { translate 0 5 0; sphere { center 0 0 0; radius 1 } }");

static PROTOTYPE: NodeSchema = NodeSchema::new(
    "prototype",
    "A group that isn't drawn itself, only by its instances.",
    &[&[FieldSchema::new("name", ValueType::Text, "the name that instances refer to").needed(), MATERIAL]],
)
.transforms()
.objects()
.example("prototype name=\"ball\" { sphere { center 0 0 0; radius 1 } }");

static INSTANCE: NodeSchema = NodeSchema::new(
    "instance",
    "One more copy of a named object, group or prototype, with the transforms of the original and then its own. Copies \
     cost next to no memory.",
    &[
        &[FieldSchema::new("of", ValueType::Text, "the name of what is repeated").needed()],
        &[
            NAME,
            FieldSchema::new("material", ValueType::Text, "a material for the parts that have none of their own")
                .or(|| "its group's".into()),
        ],
    ],
)
.transforms()
.example("instance of=\"lamp\" { translate 10 0 0 }");

const LIGHT: &[FieldSchema] = &[
    FieldSchema::new("intensity", ValueType::Rgb, "l: a surface straight below is lit by l times its kd")
        .or(|| DEFAULT_INTENSITY.to_string()),
    FieldSchema::new("shadows", ValueType::Flag, "whether it casts shadows").or(|| flag(default_light().shadows)),
    FieldSchema::new("name", ValueType::Text, "its name, for `--set` and explanations"),
];

fn default_light() -> Light {
    Light::new(LightKind::Omni(Omni::at(Vec3::ZERO)), Rgb::gray(DEFAULT_INTENSITY))
}

const ATTENUATION: FieldSchema =
    FieldSchema::new("attenuation", POINT, "c l q: light from distance d is divided by c + l d + q d²").or(|| {
        let [c, l, q] = default_light().attenuation;
        format!("{c} {l} {q}")
    });

const SAMPLES: FieldSchema = FieldSchema::new(
    "samples",
    ValueType::Count,
    "how many random points of it shine on each hit, other ones for each ray of a pixel, instead of points (1 to 4096)",
);

const POINTS: FieldSchema = FieldSchema::new(
    "points",
    ValueType::Count,
    "how many points, always the same, 1 to 4096; each costs a shadow ray",
)
.or(|| DEFAULT_POINTS.to_string());

const EMISSION: FieldSchema = FieldSchema::new(
    "emission",
    ValueType::Keyword(Emission::NAMES),
    "each point shines evenly in all directions; or all shine as a matte surface of radiance l, from its outer side, weaker aslant and from afar",
)
.or(|| quoted(Emission::default().name()));

const fn kind(word: &'static [&'static str]) -> FieldSchema {
    FieldSchema::new("kind", ValueType::Keyword(word), "the kind of light").needed()
}

/// The schemas of lights by kind, in the order of the reference.
pub(crate) const LIGHTS: &[(&str, &NodeSchema)] = &[
    ("omni", &OMNI),
    ("directional", &DIRECTIONAL),
    ("spot", &SPOT),
    ("disk", &DISK_LIGHT),
    ("rectangle", &RECTANGLE_LIGHT),
    ("sphere", &SPHERE_LIGHT),
    ("mesh", &MESH_LIGHT),
];

/// The schema of a kind of light.
pub(crate) fn light(kind: &str) -> Option<&'static NodeSchema> {
    LIGHTS.iter().find(|(name, _)| *name == kind).map(|(_, words)| *words)
}

static OMNI: NodeSchema = NodeSchema::new(
    "light",
    "Light from a point in all directions.",
    &[
        &[
            FieldSchema::new(
                "position",
                ValueType::Numbers(&[3, 4]),
                "where it is; with a fourth number w at x/w y/w z/w, with w = 0 infinitely far in the direction x y z",
            )
            .needed(),
            ATTENUATION,
        ],
        LIGHT,
    ],
)
.argument(kind(&["omni"]))
.transforms()
.example("light \"omni\" { position 40 120 0; intensity 0.8 }");

static DIRECTIONAL: NodeSchema = NodeSchema::new(
    "light",
    "Parallel light, everywhere or in a round beam.",
    &[
        &[
            FieldSchema::new("direction", POINT, "where the light goes").needed(),
            FieldSchema::new("axis", POINT, "a point on the axis of the beam; goes with radius"),
            FieldSchema::new("radius", NUMBER, "the beam's radius; goes with axis"),
        ],
        LIGHT,
    ],
)
.argument(kind(&["directional"]))
.transforms()
.example("light \"directional\" { direction -0.2 -1 -0.1; axis 0 20 0; radius 45 }");

static SPOT: NodeSchema = NodeSchema::new(
    "light",
    "A cone of light. It ends smoothly between two angles, or falls off with a power of the cosine.",
    &[
        &[
            FieldSchema::new("position", POINT, "where it is").needed(),
            FieldSchema::new("target", POINT, "a point that it shines at").needed(),
            FieldSchema::new("outer", NUMBER, "no light from this angle to the axis on, in degrees, 0 to 90").needed(),
            FieldSchema::new("inner", NUMBER, "full light up to this angle").or(|| DEFAULT_INNER.to_string()),
            FieldSchema::new("exponent", NUMBER, "the power of the cosine, instead of inner"),
            ATTENUATION,
        ],
        LIGHT,
    ],
)
.argument(kind(&["spot"]))
.transforms()
.example("light \"spot\" { position 0 50 0; target 0 0 0; inner 20; outer 30 }");

static DISK_LIGHT: NodeSchema = NodeSchema::new(
    "light",
    "Light spread over a disk, for soft shadows.",
    &[
        &[
            FieldSchema::new("position", POINT, "the disk's centre").needed(),
            FieldSchema::new("normal", POINT, "the disk's axis").needed(),
            FieldSchema::new("radius", NUMBER, "the disk's radius, more than 0").needed(),
            POINTS,
            SAMPLES,
            EMISSION,
            ATTENUATION,
        ],
        LIGHT,
    ],
)
.argument(kind(&["disk"]))
.transforms()
.example("light \"disk\" { position 40 120 0; normal 0 -1 0; radius 10; intensity 0.8; points 16 }");

static RECTANGLE_LIGHT: NodeSchema = NodeSchema::new(
    "light",
    "Light spread over a rectangle, or any parallelogram, for soft shadows.",
    &[
        &[
            FieldSchema::new("corner", POINT, "a corner").needed(),
            FieldSchema::new("u", POINT, "an edge from there").needed(),
            FieldSchema::new("v", POINT, "the other edge from there; u × v looks out of its outer side").needed(),
            POINTS,
            SAMPLES,
            EMISSION,
            ATTENUATION,
        ],
        LIGHT,
    ],
)
.argument(kind(&["rectangle"]))
.transforms()
.example("light \"rectangle\" { corner -1 5 -1; u 2 0 0; v 0 0 2; samples 1; emission \"matte\"; intensity 8 }");

static SPHERE_LIGHT: NodeSchema = NodeSchema::new(
    "light",
    "Light spread over a sphere, for soft shadows.",
    &[
        &[
            FieldSchema::new("center", POINT, "its centre").needed(),
            FieldSchema::new("radius", NUMBER, "its radius, more than 0").needed(),
            POINTS,
            SAMPLES,
            EMISSION,
            ATTENUATION,
        ],
        LIGHT,
    ],
)
.argument(kind(&["sphere"]))
.transforms()
.example("light \"sphere\" { center 0 5 0; radius 0.5; points 32 }");

static MESH_LIGHT: NodeSchema = NodeSchema::new(
    "light",
    "Light spread over the triangles of a file, evenly by their area. The light itself is not seen, as no light is.",
    &[
        &[
            FieldSchema::new("file", ValueType::Text, "the file; relative paths start at this file's folder").needed(),
            POINTS,
            SAMPLES,
            EMISSION,
            ATTENUATION,
        ],
        LIGHT,
    ],
)
.argument(kind(&["mesh"]))
.transforms()
.example("light \"mesh\" file=\"bunny.obj\" { scale 0.1; translate 0 5 0; samples 4; intensity 0.8 }");
