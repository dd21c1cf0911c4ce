//! The schema of textures on materials.

use super::settings::quoted;
use super::{FieldSchema, NUMBER, NodeSchema, ValueType};
use canaletto::material::{Channel, Projection, Space, Target};
use canaletto::{Named, named};

/// The direction that green stands for in an image of normals.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum GreenAxis {
    /// Upwards in the image, as in OpenGL.
    #[default]
    Up,
    /// Downwards in the image, as in Direct3D.
    Down,
}

named!(GreenAxis {
    Up => "up",
    Down => "down",
});

pub(crate) static SURFACE_TEXTURE: NodeSchema = NodeSchema::new(
    "texture",
    "A texture on a material. There may be several; each replaces what those before it gave. Transforms place the texture \
     as they place objects: around the middle of the picture with `uv` (x to the right, y upwards), in the mapping's space \
     else.",
    &[&[
        FieldSchema::new(
            "use",
            ValueType::Keyword(Target::NAMES),
            "what it is for: the colour instead of the shaded one, or over it by its alpha; kd; another number of the \
             material; what is there of the surface at all; heights, or normals, that bend the normal; heights that move the surface",
        )
        .or(|| quoted(Target::Diffuse.name())),
        FieldSchema::new(
            "mapping",
            ValueType::Keyword(Projection::NAMES),
            "how the surface gets texture coordinates: its own (faces of a box, angles of a sphere, uv of a mesh), one of \
             the projections, or the point itself for textures of space",
        )
        .or(|| format!("{}, for textures of space {}", quoted(Projection::Uv.name()), quoted(Projection::Solid.name()))),
        FieldSchema::new(
            "space",
            ValueType::Keyword(Space::NAMES),
            "where the mapping happens: the object's own space, the scene's, or the object's bounding box as a cube of \
             side 1 around the origin; not for \"uv\"",
        )
        .or(|| format!("{}; for \"triplanar\" and \"solid\" {}", quoted(Space::Bounds.name()), quoted(Space::Object.name()))),
        FieldSchema::new("repeat", ValueType::Numbers(&[1, 2]), "how often the picture is repeated along u and v").or(|| "1".into()),
        FieldSchema::new(
            "channel",
            ValueType::Keyword(Channel::NAMES),
            "which number of the texture, where one is wanted",
        )
        .or(|| format!("{}; for \"cutout\" {}", quoted(Channel::Luminance.name()), quoted(Channel::Alpha.name()))),
        FieldSchema::new("range", ValueType::Numbers(&[2]), "what the values 0 and 1 of the texture stand for").or(|| "0 1".into()),
        FieldSchema::new(
            "height",
            NUMBER,
            "for \"bump\" and \"displace\": the height of the value 1 over that of 0, in the object's units before its transforms",
        ),
        FieldSchema::new(
            "detail",
            NUMBER,
            "for \"displace\": the object's size divided by this is the shortest edge of the triangles that it becomes; 16 and more",
        )
        .or(|| Target::DEFAULT_DETAIL.to_string()),
        FieldSchema::new("strength", NUMBER, "for \"normal\": how strongly the normals lean").or(|| "1".into()),
        FieldSchema::new(
            "y",
            ValueType::Keyword(GreenAxis::NAMES),
            "for \"normal\": whether green leans upwards in the image, as in OpenGL, or downwards, as in Direct3D",
        )
        .or(|| quoted(GreenAxis::default().name())),
    ]],
)
.argument(FieldSchema::new("texture", ValueType::Text, "the texture's name").needed())
.transforms()
.example(
    "material \"wall\" { texture \"bricks\"; texture \"bricks\" use=\"decal\" mapping=\"box\" { scale 0.4 }; texture \"bricks\" use=\"bump\" height=0.02 }",
);
