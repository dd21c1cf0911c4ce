//! The node of a texture on a material.

use crate::text::decode::Decoder;
use crate::text::reader::{Entry, Fields};
use crate::text::report::Message;
use crate::text::schema::{Block, Field, NodeSchema, Numbers, Text, quoted};
use crate::text::syntax::Span;
use canaletto::material::{Channel, Mapping, Parameter, Projection, Repeat, Space, Target, TextureUse};
use canaletto::math::Transform;
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

/// The target of a texture that names none.
const DEFAULT_TARGET: Target = Target::Parameter(Parameter::Diffuse);

const TEXTURE_NAME: Field<Text> = Field::text("texture", "the texture's name").needed();
const USE: Field<Target> = Field::word(
    "use",
    "what it is for: the colour instead of the shaded one, or over it by its alpha; kd; another number of the \
     material or of the standard surface; what is there of the surface at all; heights, or normals, that bend the normal; heights that move the \
     surface",
)
.or(|| quoted(DEFAULT_TARGET.name()));
const MAPPING: Field<Projection> = Field::word(
    "mapping",
    "how the surface gets texture coordinates: its own (faces of a box, angles of a sphere, uv of a mesh), one of \
     the projections, or the point itself for textures of space",
)
.or(|| format!("{}, for textures of space {}", quoted(Projection::Uv.name()), quoted(Projection::Solid.name())));
const SPACE: Field<Space> = Field::word(
    "space",
    "where the mapping happens: the object's own space, the scene's, or the object's bounding box as a cube of \
     side 1 around the origin; not for \"uv\"",
)
.or(|| {
    let (bounds, object) = (quoted(Space::Bounds.name()), quoted(Space::Object.name()));
    let [triplanar, solid] = [Projection::Triplanar, Projection::Solid].map(|p| quoted(p.name()));
    format!("{bounds}; for {triplanar} and {solid} {object}")
});
const REPEAT: Field<Numbers> =
    Field::numbers("repeat", &[1, 2], "how often the picture is repeated along u and v").or(|| "1".into());
const CHANNEL: Field<Channel> = Field::word("channel", "which number of the texture, where one is wanted").or(|| {
    let [usual, cutout, alpha] = [Channel::Luminance.name(), Target::Cutout.name(), Channel::Alpha.name()].map(quoted);
    format!("{usual}; for {cutout} {alpha}")
});
const RANGE: Field<[f64; 2]> =
    Field::new("range", "what the values 0 and 1 of the texture stand for").or(|| "0 1".into());
const MULTIPLY: Field<bool> = Field::new(
    "multiply",
    "#true multiplies what the material and the textures before have by the texture, instead of replacing it",
)
.or(|| "#false".into());
const UV_SET: Field<u32> = Field::new(
    "uv-set",
    "which of a mesh's sets of texture coordinates `mapping=\"uv\"` takes, from 0 on; a mesh without it gives set 0",
)
.or(|| "0".into());
const HEIGHT: Field<f32> = Field::new(
    "height",
    "for \"bump\" and \"displace\": the height of the value 1 over that of 0, in the object's units before its \
     transforms",
);
const DETAIL: Field<f32> = Field::new(
    "detail",
    "for \"displace\": the object's size divided by this is the shortest edge of the triangles that it becomes; 16 \
     and more",
)
.or(|| Target::DEFAULT_DETAIL.to_string());
const STRENGTH: Field<f32> = Field::new("strength", "for \"normal\": how strongly the normals lean").or(|| "1".into());
const GREEN: Field<GreenAxis> = Field::word(
    "y",
    "for \"normal\": whether green leans upwards in the image, as in OpenGL, or downwards, as in Direct3D",
)
.or(|| quoted(GreenAxis::default().name()));

/// `texture` in a material.
pub(crate) static SURFACE_TEXTURE: NodeSchema = NodeSchema::new(
    "texture",
    "A texture on a material. There may be several; each replaces what those before it gave, or multiplies it. Transforms place the \
     texture \
     as they place objects: around the middle of the picture with `uv` (x to the right, y upwards), in the mapping's \
     space \
     else.",
    &[&[
        USE.schema,
        MAPPING.schema,
        SPACE.schema,
        REPEAT.schema,
        CHANNEL.schema,
        RANGE.schema,
        MULTIPLY.schema,
        UV_SET.schema,
        HEIGHT.schema,
        DETAIL.schema,
        STRENGTH.schema,
        GREEN.schema,
    ]],
)
.argument(TEXTURE_NAME.schema)
.transforms()
.example(
    "material \"wall\" { texture \"bricks\"; texture \"bricks\" use=\"decal\" mapping=\"box\" { scale 0.4 }; texture \"bricks\" use=\"bump\" height=0.02 }",
);

/// The field for [`SURFACE_TEXTURE`].
pub(super) const TEXTURE: Field<Block> =
    Field::block(&SURFACE_TEXTURE, "a texture for any of these, or over all; see below").many();

impl Decoder<'_> {
    /// The textures of a material, in their order.
    pub(super) fn surface_textures(&mut self, material: &Fields) -> Vec<TextureUse> {
        material.every(&TEXTURE).filter_map(|got| self.surface_texture(got)).collect()
    }

    fn surface_texture(&mut self, got: &Entry) -> Option<TextureUse> {
        let Some(node) = got.node else {
            // As a property, it is only the texture's name.
            let name = got.values.first()?.as_text()?;
            let texture = self.named_texture(name, got.span)?;
            return Some(TextureUse { mapping: self.mapping_of(texture), ..TextureUse::new(texture, DEFAULT_TARGET) });
        };
        let name = node.values.first().and_then(|v| v.as_text());
        let title = name.map_or("texture".into(), |n| format!("texture \"{n}\""));
        let f = self.validator.fields(node, &SURFACE_TEXTURE, &title);
        self.valid &= f.valid;
        let target = f.word(&USE).unwrap_or(DEFAULT_TARGET);
        let texture = self.named_texture(f.text(&TEXTURE_NAME)?, f.span(&TEXTURE_NAME))?;
        let mut used = TextureUse { mapping: self.mapping(&f, texture), ..TextureUse::new(texture, target) };
        self.only_for(&f, target);
        used.channel = f.word(&CHANNEL).unwrap_or(used.channel);
        used.multiply = f.get(&MULTIPLY).unwrap_or(used.multiply);
        used.range = f.get(&RANGE).map_or(used.range, |[low, high]| [low as f32, high as f32]);
        match &mut used.target {
            Target::Bump | Target::Displace { .. } => {
                if let Target::Displace { detail } = &mut used.target {
                    *detail = f.get(&DETAIL).unwrap_or(*detail);
                }
                if let Some(height) = f.get(&HEIGHT) {
                    used.range = [0.0, height];
                } else if f.valid && !f.has(&RANGE) {
                    let message =
                        Message::error(f.node.name_span, format!("{title} needs height for {:?}", target.name()));
                    let help = "for example: height=0.1, in the units of the object's own space";
                    self.validator.report.push(message.help(help));
                    self.valid = false;
                }
            }
            Target::Normal { strength, down } | Target::CoatNormal { strength, down } => {
                *strength = f.get(&STRENGTH).unwrap_or(*strength);
                *down = f.word(&GREEN) == Some(GreenAxis::Down);
            }
            _ => {}
        }
        if f.valid
            && let Err(problem) = used.check()
        {
            self.out_of_range(&f, &problem);
        }
        Some(used)
    }

    /// The texture of this name.
    fn named_texture(&mut self, name: &str, span: Span) -> Option<u32> {
        let found = self.textures.get(name).copied();
        if found.is_none() {
            self.validator.unknown_name("texture", name, span, self.textures.keys().copied());
            self.valid = false;
        }
        found
    }

    /// The default mapping of a texture.
    fn mapping_of(&self, texture: u32) -> Mapping {
        let kind = self.scene.textures.get(texture as usize).map(|texture| &texture.kind);
        kind.map_or_else(Mapping::default, Mapping::usual)
    }

    fn mapping(&mut self, f: &Fields, texture: u32) -> Mapping {
        let usual = self.mapping_of(texture);
        let projection = f.word(&MAPPING).unwrap_or(usual.projection);
        let space = match projection {
            Projection::Solid if usual.projection == Projection::Solid => usual.space,
            Projection::Triplanar | Projection::Solid => Space::Object,
            _ => Space::Bounds,
        };
        let repeat = match f.numbers(&REPEAT) {
            Some([both]) => [both; 2],
            None => f.numbers(&REPEAT).unwrap_or([1.0; 2]),
        };
        for (word, given, meant, why) in [
            (
                SPACE.name(),
                f.has(&SPACE),
                projection != Projection::Uv,
                "the surface's own coordinates are the same in every space",
            ),
            (
                REPEAT.name(),
                f.has(&REPEAT),
                projection != Projection::Solid,
                "scale makes the pattern smaller or larger",
            ),
            (
                UV_SET.name(),
                f.has(&UV_SET),
                projection == Projection::Uv,
                "sets of texture coordinates belong to \"uv\"",
            ),
        ] {
            if given && !meant && f.valid {
                let mapping = projection.name();
                let message =
                    Message::error(f.span_of(word), format!("{word} has no meaning for mapping \"{mapping}\""));
                self.validator.report.push(message.help(why));
                self.valid = false;
            }
        }
        let space = f.word(&SPACE).unwrap_or(space);
        let uv_set = f.get(&UV_SET).unwrap_or(0);
        let usual = if projection == usual.projection { usual.transform } else { Transform::IDENTITY };
        Mapping { projection, space, transform: self.transform(f).after(&usual), repeat: Repeat(repeat), uv_set }
    }

    /// Reports fields that don't apply to this use.
    fn only_for(&mut self, f: &Fields, target: Target) {
        let normal = target.takes_normals();
        let heights = matches!(target, Target::Bump | Target::Displace { .. });
        let one = !target.takes_color() && !normal && target != Target::AnisotropyDirection;
        for (word, given, meant) in [
            (HEIGHT.name(), f.has(&HEIGHT), heights),
            (DETAIL.name(), f.has(&DETAIL), matches!(target, Target::Displace { .. })),
            (STRENGTH.name(), f.has(&STRENGTH), normal),
            (GREEN.name(), f.has(&GREEN), normal),
            (CHANNEL.name(), f.has(&CHANNEL), one),
            (MULTIPLY.name(), f.has(&MULTIPLY), target.takes_products()),
        ] {
            if given && !meant && f.valid {
                let message = format!("{word} has no meaning for the use \"{}\"", target.name());
                self.validator.report.error(f.span_of(word), message);
                self.valid = false;
            }
        }
        if f.has(&RANGE) && f.valid && (normal || target == Target::AnisotropyDirection || heights && f.has(&HEIGHT)) {
            let message = match !heights {
                true => format!("range has no meaning for the use \"{}\"", target.name()),
                false => format!("{:?} has either height or range", target.name()),
            };
            self.validator.report.error(f.span(&RANGE), message);
            self.valid = false;
        }
    }
}
