//! The schema of the scene text in one table, from which the decoder validates nodes and the reference is generated.

mod environments;
mod lens;
mod motion;
mod objects;
mod settings;
mod surface_textures;
mod textures;

pub(crate) use environments::{ENVIRONMENTS, environment};
pub(crate) use lens::{CAMERA_MOTION, DEFAULT_BLADES, DEFAULT_LENS_ROTATION, LENS, MOTION, MOTION_WORD};
pub(crate) use motion::{ANIMATION, CAMERA_FOLLOW, DEFAULT_FPS, EASE, FOLLOW, PATH, POINT_FOLLOW, TURN};
pub(crate) use objects::{
    DEFAULT_CAPS, DEFAULT_INNER, DEFAULT_INTENSITY, DEFAULT_POINTS, DEFAULT_TOP_RADIUS, LIGHTS, OBJECTS, TRANSFORMS,
    light,
};
pub(crate) use settings::{
    AMBIENT, BACKGROUND, CAMERA, DEFAULT_CAMERA, FILM, FILTER, INTEGRATOR, MATERIAL, SAMPLE, SETTINGS,
};
pub(crate) use surface_textures::{GreenAxis, SURFACE_TEXTURE};
pub(crate) use textures::{
    DEFAULT_JITTER, DEFAULT_KIND, DEFAULT_MARBLE, DEFAULT_RAMP_WRAP, DEFAULT_WOOD, TEXTURES, VoxelFormat, texture,
};

/// The type of a field's values.
#[derive(Clone, Copy)]
pub(crate) enum ValueType {
    /// Numbers; the slice lists the allowed counts.
    Numbers(&'static [usize]),
    /// A colour: 1 number (gray) or 3.
    Rgb,
    /// A non-negative integer.
    Count,
    /// Non-negative integers, this many.
    Counts(usize),
    /// `#true` or `#false`; no value means `#true`.
    Flag,
    /// Any text.
    Text,
    /// One of these keywords.
    Keyword(&'static [&'static str]),
    /// Any number of numbers, in multiples of this count.
    Many(usize),
    /// A block with a schema of its own.
    Node(&'static NodeSchema),
}

/// A single number.
pub(crate) const NUMBER: ValueType = ValueType::Numbers(&[1]);
/// A point or direction.
pub(crate) const POINT: ValueType = ValueType::Numbers(&[3]);

/// A field of a node: a property, a child, or the node's own values.
pub(crate) struct FieldSchema {
    pub(crate) name: &'static str,
    pub(crate) value_type: ValueType,
    /// Whether the field is required.
    pub(crate) needed: bool,
    /// Whether the field may occur more than once.
    pub(crate) many: bool,
    /// The default value as text, computed from the code that uses it.
    pub(crate) default: fn() -> String,
    pub(crate) doc: &'static str,
}

/// The schema of a node.
pub(crate) struct NodeSchema {
    /// The name of the node; lights add their kind.
    pub(crate) name: &'static str,
    pub(crate) doc: &'static str,
    /// The values right after the node's name.
    pub(crate) argument: Option<FieldSchema>,
    /// The fields, in groups that nodes share.
    pub(crate) words: &'static [&'static [FieldSchema]],
    /// Whether transforms are allowed in it.
    pub(crate) transforms: bool,
    /// Whether objects and lights are allowed in it.
    pub(crate) objects: bool,
    pub(crate) example: &'static str,
}

impl FieldSchema {
    pub(crate) const fn new(name: &'static str, value_type: ValueType, doc: &'static str) -> FieldSchema {
        FieldSchema { name, value_type, needed: false, many: false, default: String::new, doc }
    }

    pub(crate) const fn needed(mut self) -> FieldSchema {
        self.needed = true;
        self
    }

    pub(crate) const fn many(mut self) -> FieldSchema {
        self.many = true;
        self
    }

    pub(crate) const fn or(mut self, default: fn() -> String) -> FieldSchema {
        self.default = default;
        self
    }
}

impl NodeSchema {
    pub(crate) const fn new(
        name: &'static str,
        doc: &'static str,
        words: &'static [&'static [FieldSchema]],
    ) -> NodeSchema {
        NodeSchema { name, doc, argument: None, words, transforms: false, objects: false, example: "" }
    }

    pub(crate) const fn argument(mut self, word: FieldSchema) -> NodeSchema {
        self.argument = Some(word);
        self
    }

    pub(crate) const fn transforms(mut self) -> NodeSchema {
        self.transforms = true;
        self
    }

    pub(crate) const fn objects(mut self) -> NodeSchema {
        self.objects = true;
        self
    }

    pub(crate) const fn example(mut self, text: &'static str) -> NodeSchema {
        self.example = text;
        self
    }

    /// Whether `motion` is allowed in it: wherever transforms are, except in `motion` itself.
    pub(crate) fn may_move(&self) -> bool {
        self.transforms && self.name != MOTION.name
    }

    pub(crate) fn own(&self) -> impl Iterator<Item = &'static FieldSchema> {
        self.words.iter().flat_map(|group| group.iter())
    }

    pub(crate) fn word(&self, name: &str) -> Option<&'static FieldSchema> {
        self.own().find(|word| word.name == name)
    }

    /// Every word that is allowed in it.
    pub(crate) fn allowed(&self) -> Vec<&'static str> {
        let mut all: Vec<&str> = self.own().map(|word| word.name).collect();
        if self.transforms {
            all.extend(TRANSFORMS.iter().map(|word| word.name));
            all.extend(self.may_move().then_some(MOTION_WORD.name));
        }
        if self.objects {
            all.extend(objects());
        }
        all
    }
}

/// The words of the nodes that are allowed in a group.
pub(crate) fn objects() -> impl Iterator<Item = &'static str> {
    OBJECTS.iter().map(|words| words.name).chain(["light"])
}

/// The words of the nodes that are allowed at the top level of a file.
pub(crate) fn top() -> Vec<&'static str> {
    SETTINGS.iter().map(|words| words.name).chain(["environment", "texture"]).chain(objects()).collect()
}

/// The schema of the node of this name; lights are found by their kind.
pub(crate) fn node(name: &str) -> Option<&'static NodeSchema> {
    SETTINGS.iter().chain(OBJECTS).copied().find(|words| words.name == name)
}

/// Common words of other formats, and the words of the scene text for them.
pub(crate) const SYNONYMS: &[(&str, &str)] = &[
    ("albedo", "kd"),
    ("aperture", "lens"),
    ("aperture", "radius"),
    ("alpha", "coverage"),
    ("alpha", "opacity"),
    ("area", "disk"),
    ("cap", "caps"),
    ("color", "kd"),
    ("color", "intensity"),
    ("color", "material"),
    ("colour", "kd"),
    ("colour", "intensity"),
    ("colour", "material"),
    ("count", "points"),
    ("cube", "box"),
    ("cuboid", "box"),
    ("depth", "max-depth"),
    ("dielectric-priority", "priority"),
    ("diffuse", "kd"),
    ("dissolve", "coverage"),
    ("fov", "fovy"),
    ("f-stop", "f-number"),
    ("focal-distance", "focus"),
    ("focus-distance", "focus"),
    ("from", "eye"),
    ("frosted", "roughness"),
    ("glossiness", "roughness"),
    ("glossy", "roughness"),
    ("image", "film"),
    ("index", "eta"),
    ("ior", "eta"),
    ("look-at", "center"),
    ("lookat", "center"),
    ("mirror", "k"),
    ("obj", "mesh"),
    ("object", "group"),
    ("origin", "eye"),
    ("origin", "point"),
    ("parallel", "directional"),
    ("path", "file"),
    ("point", "omni"),
    ("point-light", "light"),
    ("pos", "position"),
    ("position", "center"),
    ("position", "eye"),
    ("position", "point"),
    ("reflection", "k"),
    ("refraction", "eta"),
    ("render", "film"),
    ("resolution", "size"),
    ("rotation", "rotate"),
    ("shininess", "n"),
    ("specular", "ks"),
    ("spp", "samples"),
    ("spotlight", "spot"),
    ("src", "file"),
    ("sun", "directional"),
    ("target", "center"),
    ("to", "target"),
    ("towards", "direction"),
    ("transparency", "opacity"),
    ("width", "size"),
];

/// The description of a value type in messages and in the reference.
impl std::fmt::Display for ValueType {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            ValueType::Numbers([1]) => f.write_str("a number"),
            ValueType::Numbers(counts) => {
                let counts: Vec<String> = counts.iter().map(usize::to_string).collect();
                write!(f, "{} numbers", counts.join(" or "))
            }
            ValueType::Rgb => f.write_str("1 or 3 numbers"),
            ValueType::Count => f.write_str("a whole number"),
            ValueType::Counts(n) => write!(f, "{n} whole numbers"),
            ValueType::Flag => f.write_str("#true or #false"),
            ValueType::Text => f.write_str("a text"),
            ValueType::Keyword(words) => {
                let quoted: Vec<String> = words.iter().map(|word| format!("\"{word}\"")).collect();
                match quoted.as_slice() {
                    [one] => f.write_str(one),
                    [most @ .., last] => write!(f, "{} or {last}", most.join(", ")),
                    [] => Ok(()),
                }
            }
            ValueType::Many(1) => f.write_str("numbers"),
            ValueType::Many(n) => write!(f, "numbers, {n} for each"),
            ValueType::Node(words) => match &words.argument {
                Some(word) => word.value_type.fmt(f),
                None => f.write_str("a block"),
            },
        }
    }
}

/// A phrase that names the nodes with this field; `None` if there are none or too many.
pub(crate) fn home(word: &str) -> Option<String> {
    let all = SETTINGS.iter().chain(OBJECTS).map(|words| (*words, words.name.to_owned()));
    let lights = LIGHTS.iter().map(|(kind, words)| (*words, format!("light \"{kind}\"")));
    let environments = ENVIRONMENTS.iter().map(|(kind, words)| (*words, format!("environment \"{kind}\"")));
    let textures = TEXTURES.iter().map(|(kind, words)| (*words, format!("texture kind=\"{kind}\"")));
    let mut homes = all
        .chain(lights)
        .chain(environments)
        .chain(textures)
        .filter(|(words, _)| words.word(word).is_some())
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
