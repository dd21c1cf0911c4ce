//! The nodes of the scene text, one file for each kind: a table of its fields above, its reader below. Messages, the
//! reference and the readers take their words from these tables.

mod camera;
mod clouds;
mod colors;
mod environment;
mod film;
mod grid;
mod groups;
mod integrator;
mod lights;
mod material;
mod mesh;
mod motion;
mod procedural;
mod shapes;
mod standard;
mod surface_texture;
#[cfg(test)]
pub(crate) mod tests;
mod texture;

pub(crate) use camera::{CAMERA, CAMERA_MOTION, CENTER, DEFAULT_CAMERA, EYE, LENS, SHUTTER, SIZE};
pub(crate) use clouds::{COLORMAP, CYLINDERS};
pub(crate) use environment::{ENVIRONMENT, ENVIRONMENTS, environment};
pub(crate) use film::{CROP, FILM, FILTER, SAMPLE};
pub(crate) use groups::{GROUP, INSTANCE, OF, PROTOTYPE};
pub(crate) use integrator::INTEGRATOR;
pub(crate) use lights::{LIGHT, LIGHTS, light};
pub(crate) use material::{CONDUCTOR, MATERIAL as MATERIAL_NODE, MEDIUM};
pub(crate) use mesh::MeshCache;
#[cfg(test)]
pub(crate) use mesh::PART;
pub(crate) use motion::{
    ALONG, ANIMATION, AT, CAMERA_FOLLOW, CLOSED, CURVE, EASE, FACE, FOLLOW, FOLLOWED, FPS, FRAMES, KEY, KEYS, MATRIX,
    MOTION, MOTION_FIELD, PATH, PATH_NAME, PATH_POINTS, POINT_FOLLOW, TRANSFORMS, TRANSLATE, TURN, UP,
};
pub(crate) use standard::{STANDARD, STANDARD_BLOCKS};
pub(crate) use surface_texture::SURFACE_TEXTURE;
pub(crate) use texture::{Images, TEXTURE, TEXTURES, texture};

use super::arithmetic::{LET, REPEAT};
use super::decode::{Decoder, TransformReader};
use super::reader::Fields;
use super::report::Message;
use super::schema::{Field, FieldSchema, NodeSchema, Text, ValueType, flag, quoted};
use super::suggest::SYNONYMS;
use super::syntax::{Node, Span};
use crate::diagnostic::closest_word;
use canaletto::scene::Content;
use canaletto::shape::Shape;

/// A node of an object with its reader.
pub(crate) struct ObjectNode {
    pub(crate) schema: NodeSchema,
    pub(super) read: ObjectReader,
}

/// The reader of an object's content.
pub(super) enum ObjectReader {
    /// A shape, whose ranges are checked after it was read.
    Shape(fn(&Fields) -> Option<Shape>),
    /// Any other content; the number is that of the object's material.
    Content(fn(&mut Decoder, &Fields, Option<u32>) -> Option<Content>),
}

/// A transform with its reader.
pub(crate) struct TransformField {
    pub(crate) schema: FieldSchema,
    pub(super) read: TransformReader,
}

/// A node of a setting with its reader.
pub(crate) struct SettingNode {
    pub(crate) schema: &'static NodeSchema,
    pub(super) read: SettingReader,
}

/// The reader of a setting.
pub(super) enum SettingReader {
    /// A node that a file holds once. Later files change the fields that they set and keep the others.
    Once(fn(&mut Decoder, &Fields)),
    /// A camera, of which a file holds one of each name.
    Camera,
    /// A node that is replaced by the nodes of a file before the scene is read.
    Include,
    /// A node that is read before the others: a material, the times or a path.
    Before,
}

/// The nodes of settings, as opposed to objects, in the order of the reference.
pub(crate) static SETTINGS: &[SettingNode] = &[
    SettingNode { schema: &INCLUDE, read: SettingReader::Include },
    SettingNode { schema: &colors::BACKGROUND, read: SettingReader::Once(|decoder, f| decoder.background(f)) },
    SettingNode { schema: &colors::AMBIENT, read: SettingReader::Once(|decoder, f| decoder.ambient(f)) },
    SettingNode { schema: &CAMERA, read: SettingReader::Camera },
    SettingNode { schema: &FILM, read: SettingReader::Once(|decoder, f| decoder.film(f)) },
    SettingNode { schema: &INTEGRATOR, read: SettingReader::Once(|decoder, f| decoder.integrator(f)) },
    SettingNode { schema: &MATERIAL_NODE, read: SettingReader::Before },
    SettingNode { schema: &ANIMATION, read: SettingReader::Before },
    SettingNode { schema: &PATH, read: SettingReader::Before },
];

/// The nodes that are allowed in groups, except lights, in the order of the reference.
pub(crate) static OBJECTS: &[&ObjectNode] = &[
    &shapes::SPHERE,
    &shapes::BOX,
    &shapes::TRIANGLE,
    &shapes::PLANE,
    &shapes::DISK,
    &shapes::RECTANGLE,
    &shapes::CYLINDER,
    &shapes::CONE,
    &shapes::TORUS,
    &mesh::MESH,
    &clouds::SPHERES,
    &clouds::CYLINDERS,
    &groups::GROUP,
    &groups::PROTOTYPE,
    &groups::INSTANCE,
];

/// The name of an object.
pub(crate) const NAME: Field<Text> = Field::text("name", "its name, for instances, `--set` and explanations");
/// The material of an object.
pub(crate) const MATERIAL: Field<Text> = Field::text("material", "the material's name").or(|| "its group's".into());

/// Whether shadow rays meet an object.
pub(crate) const CASTS_SHADOW: Field<bool> = Field::new(
    "casts-shadow",
    "#false lets light pass: the object is seen, also in mirrors and through glass, but casts no shadow",
)
.or(|| flag(true));

const INCLUDE_FILE: Field<Text> = Field::text("file", "the file; relative paths start at this file's folder").needed();

/// The nodes of another file.
pub(crate) static INCLUDE: NodeSchema =
    NodeSchema::new("include", "Puts the nodes of another file here. Only at the top of a file.", &[])
        .argument(INCLUDE_FILE.schema)
        .example("include \"stage.kdl\"");

/// Fields that exclude each other in a node: setting one removes the other.
pub(crate) const ALTERNATIVES: [[&str; 2]; 5] = [
    lights::POINTS_OR_SAMPLES,
    film::SAMPLE_OR_SAMPLES,
    lights::INNER_OR_EXPONENT,
    camera::EYE_OR_FOLLOW,
    material::ROUGHNESS_OR_ALPHA,
];

/// Fields of a node that a field in a block of it says, too: the field, the block and its field.
pub(crate) const ALIASES: [[&str; 3]; 2] = [standard::COVERAGE_OR_OPACITY, material::ABSORPTION_OR_IN_MEDIUM];

/// The name of an object or light, and its place. The name of a light is a property, since its kind stands after the
/// word; so is that of an instance, since its target does.
pub(crate) fn name_of(node: &Node) -> Option<(&str, Span)> {
    if *node.name == *REPEAT.name {
        return None;
    }
    let named = node.values.first().filter(|_| object(&node.name).is_some_and(|object| has_name_first(&object.schema)));
    named.and_then(|value| Some((value.as_text()?, value.span))).or_else(|| node.text(NAME.name()))
}

/// The name of what an instance repeats, and its place.
pub(crate) fn target_of(node: &Node) -> Option<(&str, Span)> {
    let first = node.values.first().and_then(|value| Some((value.as_text()?, value.span)));
    first.or_else(|| node.text(OF.name()))
}

/// Whether the value after the word is the node's own name.
pub(crate) fn has_name_first(schema: &NodeSchema) -> bool {
    schema.argument.is_some_and(|argument| argument.name == NAME.name())
}

/// Whether a node of this name moves what it stands in.
pub(crate) fn is_of_time(name: &str) -> bool {
    [KEY, FOLLOW.name, EASE.name(), TURN.name()].contains(&name)
}

/// Whether any text stands in place of a number: an expression, or the name of a colour.
pub(crate) fn has_text_for_number(node: &Node) -> bool {
    let takes_numbers = |word: &str| {
        let field = schema(node).and_then(|schema| field(schema, word));
        field.is_some_and(|field| field.value_type.is_of_numbers())
    };
    let texts = |child: &Node| child.values.iter().any(|value| value.as_text().is_some());
    node.properties.iter().any(|p| *p.key != *MATERIAL.name() && p.value.as_text().is_some() && takes_numbers(&p.key))
        || node.children.iter().any(|child| texts(child) && takes_numbers(&child.name))
}

/// The names of the nodes that are allowed in a group.
pub(crate) fn objects() -> impl Iterator<Item = &'static str> {
    OBJECTS.iter().map(|object| object.schema.name).chain([LIGHT, REPEAT.name])
}

/// Whether a node of this name is an object, a light or a repeat of them.
pub(crate) fn is_object(name: &str) -> bool {
    objects().any(|object| object == name)
}

/// Whether a node of this name is a light, a shape or an instance, of which a scene may have very many.
pub(crate) fn is_small(name: &str) -> bool {
    let shape = |object: &ObjectNode| matches!(object.read, ObjectReader::Shape(_));
    [LIGHT, INSTANCE.schema.name].contains(&name) || object(name).is_some_and(shape)
}

/// Whether a node of this name is a setting.
pub(crate) fn is_setting(name: &str) -> bool {
    [ENVIRONMENT, TEXTURE].contains(&name) || setting(name).is_some()
}

/// Whether a scene has one node of this name, which needs no name of its own.
pub(crate) fn is_single(name: &str) -> bool {
    let once = |setting: &SettingNode| matches!(setting.read, SettingReader::Once(_));
    [ENVIRONMENT, ANIMATION.name].contains(&name) || setting(name).is_some_and(once)
}

/// Whether a setting of this name is a single value.
pub(crate) fn is_plain(name: &str) -> bool {
    is_single(name) && setting(name).is_some_and(|setting| setting.schema.own().next().is_none())
}

/// The setting of this name.
pub(super) fn setting(name: &str) -> Option<&'static SettingNode> {
    SETTINGS.iter().find(|setting| setting.schema.name == name)
}

/// The object of this name, except lights.
pub(crate) fn object(name: &str) -> Option<&'static ObjectNode> {
    OBJECTS.iter().find(|object| object.schema.name == name).copied()
}

/// The names of the nodes that are allowed at the top level of a file.
pub(crate) fn top() -> Vec<&'static str> {
    SETTINGS
        .iter()
        .map(|setting| setting.schema.name)
        .chain([ENVIRONMENT, TEXTURE, LET.name])
        .chain(objects())
        .collect()
}

/// The schema of a node, lights, environments and textures among them.
pub(crate) fn schema(node: &Node) -> Option<&'static NodeSchema> {
    let kind = node.values.first().and_then(|v| v.as_text());
    match &*node.name {
        LIGHT => light(kind?),
        ENVIRONMENT => environment(kind?),
        TEXTURE => texture(node),
        name => setting(name).map(|setting| setting.schema).or_else(|| Some(&object(name)?.schema)),
    }
}

/// The word that selects this schema among those of its node; empty for a node with one schema.
pub(crate) fn kind_of(schema: &'static NodeSchema) -> &'static str {
    let kinds = schema.argument.iter().chain(schema.own()).map(|word| word.value_type);
    let mut kinds =
        kinds.filter_map(|value_type| if let ValueType::Keyword([kind]) = value_type { Some(*kind) } else { None });
    kinds.next().unwrap_or_default()
}

/// The field of this name in a node of this schema.
pub(crate) fn field(schema: &'static NodeSchema, name: &str) -> Option<&'static FieldSchema> {
    let transforms = || TRANSFORMS.iter().map(|transform| &transform.schema).filter(|_| schema.transforms);
    let motion = || (may_move(schema) && name == MOTION.name).then_some(&motion::MOTION_SCHEMA);
    schema.word(name).or_else(|| transforms().find(|word| word.name == name)).or_else(motion)
}

/// Every word that is allowed in a node of this schema.
pub(crate) fn allowed(schema: &'static NodeSchema) -> Vec<&'static str> {
    let mut all: Vec<&str> = schema.beside_argument().map(|word| word.name).collect();
    if schema.transforms {
        all.extend(TRANSFORMS.iter().map(|transform| transform.schema.name));
        all.extend(may_move(schema).then_some(MOTION.name));
    }
    if schema.objects {
        all.extend(objects());
    }
    all
}

/// Whether `motion` is allowed in a node: wherever transforms are, except in `motion` itself.
fn may_move(schema: &NodeSchema) -> bool {
    schema.transforms && schema.name != MOTION.name
}

/// A phrase that names the nodes with this field; `None` if there are none or too many.
pub(crate) fn home(word: &str) -> Option<String> {
    let settings = SETTINGS.iter().map(|setting| setting.schema);
    let plain =
        settings.chain(OBJECTS.iter().map(|object| &object.schema)).map(|schema| (schema, schema.name.to_owned()));
    let kinds = |schema: &'static NodeSchema, before: &str| (schema, format!("{before}\"{}\"", kind_of(schema)));
    let lights = LIGHTS.iter().map(|light| kinds(&light.schema, "light "));
    let environments = ENVIRONMENTS.iter().map(|environment| kinds(&environment.schema, "environment "));
    let textures = TEXTURES.iter().map(|texture| kinds(&texture.schema, "texture kind="));
    let mut homes = plain
        .chain(lights)
        .chain(environments)
        .chain(textures)
        .filter(|(schema, _)| schema.word(word).is_some())
        .map(|(_, name)| name);
    let first = homes.next()?;
    let rest: Vec<String> = homes.collect();
    match rest.as_slice() {
        [] => Some(first),
        [most @ .., last] if rest.len() < 8 => {
            let list: Vec<&str> = std::iter::once(first.as_str()).chain(most.iter().map(String::as_str)).collect();
            Some(format!("{} or {last}", list.join(", ")))
        }
        _ => Some("an object".into()),
    }
}

/// Changes a value, if there is a new one.
fn change<T>(place: &mut T, value: Option<T>) {
    if let Some(value) = value {
        *place = value;
    }
}

impl Decoder<'_> {
    /// The index of the kind that stands after `light` or `environment`.
    fn kind_after(&mut self, node: &Node, what: &str, kinds: &[&'static str]) -> Option<usize> {
        let list: Vec<String> = kinds.iter().copied().map(quoted).collect();
        let list = format!("inds of {what}: {}", list.join(", "));
        let Some(value) = node.values.first() else {
            if !node.broken {
                let message = Message::error(node.name_span, format!("{what} needs its kind right after the word"));
                self.validator.report.push(message.help(format!("k{list}")));
            }
            return None;
        };
        let text = value.as_text();
        if let Some(index) = kinds.iter().position(|kind| Some(*kind) == text) {
            return Some(index);
        }
        let message = match text {
            Some(text) => format!("there is no kind of {what} \"{text}\""),
            None => format!("{what} takes its kind as a text"),
        };
        let same = |text: &str| kinds.iter().copied().find(|kind| SYNONYMS.contains(&(text, *kind)));
        let help = match text.and_then(|text| same(text).or_else(|| closest_word(text, kinds.iter().copied()))) {
            Some(right) => format!("did you mean \"{right}\"? K{list}"),
            None => format!("k{list}"),
        };
        self.validator.report.push(Message::error(value.span, message).help(help));
        None
    }
}
