//! The properties of glTF 2.0: what must be there, of which type and in which range (5).

/// What a property holds.
pub(super) enum Kind {
    Text,
    /// A number of this range, whose low end may be excluded.
    Number {
        low: f64,
        high: f64,
        open: bool,
    },
    /// A whole number of this range.
    Whole {
        low: u64,
        high: u64,
    },
    /// A number of these.
    Code(&'static [u64]),
    /// A text of these.
    Word(&'static [&'static str]),
    /// A list of this many numbers of this range; 0 for any count.
    Numbers {
        count: usize,
        low: f64,
        high: f64,
    },
    /// An index into a list of the document.
    Index(&'static str),
    /// A list of indices.
    Indices(&'static str),
    Texts,
    One(&'static [Property]),
    Many(&'static [Property]),
    /// Accessors by their attributes.
    Attributes,
    /// A list of accessors by their attributes.
    Targets,
}

/// A property: its name, whether it must be there, and what it holds.
pub(super) struct Property(pub(super) &'static str, pub(super) bool, pub(super) Kind);

const NUMBER: Kind = Kind::Number { low: f64::MIN, high: f64::MAX, open: false };
const POSITIVE: Kind = Kind::Number { low: 0.0, high: f64::MAX, open: true };
const NOT_NEGATIVE: Kind = Kind::Number { low: 0.0, high: f64::MAX, open: false };
const UNIT: Kind = Kind::Number { low: 0.0, high: 1.0, open: false };
const COUNT: Kind = Kind::Whole { low: 1, high: u64::MAX };
const OFFSET: Kind = Kind::Whole { low: 0, high: u64::MAX };

const fn vector(count: usize) -> Kind {
    Kind::Numbers { count, low: f64::MIN, high: f64::MAX }
}

const fn color(count: usize) -> Kind {
    Kind::Numbers { count, low: 0.0, high: 1.0 }
}

/// The document.
pub(super) const ROOT: &[Property] = &[
    Property("extensionsUsed", false, Kind::Texts),
    Property("extensionsRequired", false, Kind::Texts),
    Property("asset", true, Kind::One(ASSET)),
    Property("scene", false, Kind::Index("scenes")),
    Property("scenes", false, Kind::Many(&[Property("nodes", false, Kind::Indices("nodes"))])),
    Property("nodes", false, Kind::Many(NODE)),
    Property("meshes", false, Kind::Many(MESH)),
    Property("skins", false, Kind::Many(SKIN)),
    Property("animations", false, Kind::Many(ANIMATION)),
    Property("cameras", false, Kind::Many(CAMERA)),
    Property("materials", false, Kind::Many(MATERIAL)),
    Property("textures", false, Kind::Many(TEXTURE)),
    Property("images", false, Kind::Many(IMAGE)),
    Property("samplers", false, Kind::Many(SAMPLER)),
    Property("accessors", false, Kind::Many(ACCESSOR)),
    Property("bufferViews", false, Kind::Many(BUFFER_VIEW)),
    Property("buffers", false, Kind::Many(BUFFER)),
];

const ASSET: &[Property] = &[Property("version", true, Kind::Text), Property("minVersion", false, Kind::Text)];

const NODE: &[Property] = &[
    Property("camera", false, Kind::Index("cameras")),
    Property("children", false, Kind::Indices("nodes")),
    Property("skin", false, Kind::Index("skins")),
    Property("matrix", false, vector(16)),
    Property("mesh", false, Kind::Index("meshes")),
    Property("rotation", false, Kind::Numbers { count: 4, low: -1.0, high: 1.0 }),
    Property("scale", false, vector(3)),
    Property("translation", false, vector(3)),
    Property("weights", false, vector(0)),
];

const MESH: &[Property] = &[Property("primitives", true, Kind::Many(PRIMITIVE)), Property("weights", false, vector(0))];

const PRIMITIVE: &[Property] = &[
    Property("attributes", true, Kind::Attributes),
    Property("indices", false, Kind::Index("accessors")),
    Property("material", false, Kind::Index("materials")),
    Property("mode", false, Kind::Code(&[0, 1, 2, 3, 4, 5, 6])),
    Property("targets", false, Kind::Targets),
];

const SKIN: &[Property] = &[
    Property("inverseBindMatrices", false, Kind::Index("accessors")),
    Property("skeleton", false, Kind::Index("nodes")),
    Property("joints", true, Kind::Indices("nodes")),
];

const ANIMATION: &[Property] = &[
    Property("channels", true, Kind::Many(CHANNEL)),
    Property(
        "samplers",
        true,
        Kind::Many(&[
            Property("input", true, Kind::Index("accessors")),
            Property("interpolation", false, Kind::Word(&["LINEAR", "STEP", "CUBICSPLINE"])),
            Property("output", true, Kind::Index("accessors")),
        ]),
    ),
];

const CHANNEL: &[Property] = &[
    Property("sampler", true, OFFSET),
    Property(
        "target",
        true,
        Kind::One(&[Property("node", false, Kind::Index("nodes")), Property("path", true, Kind::Text)]),
    ),
];

const CAMERA: &[Property] = &[
    Property("type", true, Kind::Text),
    Property(
        "perspective",
        false,
        Kind::One(&[
            Property("aspectRatio", false, POSITIVE),
            Property("yfov", true, POSITIVE),
            Property("zfar", false, POSITIVE),
            Property("znear", true, POSITIVE),
        ]),
    ),
    Property(
        "orthographic",
        false,
        Kind::One(&[
            Property("xmag", true, NUMBER),
            Property("ymag", true, NUMBER),
            Property("zfar", true, POSITIVE),
            Property("znear", true, NOT_NEGATIVE),
        ]),
    ),
];

const MATERIAL: &[Property] = &[
    Property(
        "pbrMetallicRoughness",
        false,
        Kind::One(&[
            Property("baseColorFactor", false, color(4)),
            Property("baseColorTexture", false, Kind::One(TEXTURE_INFO)),
            Property("metallicFactor", false, UNIT),
            Property("roughnessFactor", false, UNIT),
            Property("metallicRoughnessTexture", false, Kind::One(TEXTURE_INFO)),
        ]),
    ),
    Property("normalTexture", false, Kind::One(TEXTURE_INFO)),
    Property("occlusionTexture", false, Kind::One(TEXTURE_INFO)),
    Property("emissiveTexture", false, Kind::One(TEXTURE_INFO)),
    Property("emissiveFactor", false, color(3)),
    Property("alphaMode", false, Kind::Word(&["OPAQUE", "MASK", "BLEND"])),
    Property("alphaCutoff", false, NOT_NEGATIVE),
];

/// The use of a texture by a material.
pub(super) const TEXTURE_INFO: &[Property] =
    &[Property("index", true, Kind::Index("textures")), Property("texCoord", false, OFFSET)];

const TEXTURE: &[Property] =
    &[Property("sampler", false, Kind::Index("samplers")), Property("source", false, Kind::Index("images"))];

const IMAGE: &[Property] = &[
    Property("bufferView", false, Kind::Index("bufferViews")),
    Property("mimeType", false, Kind::Text),
    Property("uri", false, Kind::Text),
];

const WRAPS: Kind = Kind::Code(&[33071, 33648, 10497]);

const SAMPLER: &[Property] = &[
    Property("magFilter", false, Kind::Code(&[9728, 9729])),
    Property("minFilter", false, Kind::Code(&[9728, 9729, 9984, 9985, 9986, 9987])),
    Property("wrapS", false, WRAPS),
    Property("wrapT", false, WRAPS),
];

const COMPONENTS: Kind = Kind::Code(&[5120, 5121, 5122, 5123, 5125, 5126]);

const ACCESSOR: &[Property] = &[
    Property("bufferView", false, Kind::Index("bufferViews")),
    Property("byteOffset", false, OFFSET),
    Property("componentType", true, COMPONENTS),
    Property("count", true, COUNT),
    Property("type", true, Kind::Word(&["SCALAR", "VEC2", "VEC3", "VEC4", "MAT2", "MAT3", "MAT4"])),
    Property("max", false, vector(0)),
    Property("min", false, vector(0)),
    Property("sparse", false, Kind::One(SPARSE)),
];

const SPARSE: &[Property] = &[
    Property("count", true, COUNT),
    Property(
        "indices",
        true,
        Kind::One(&[
            Property("bufferView", true, Kind::Index("bufferViews")),
            Property("byteOffset", false, OFFSET),
            Property("componentType", true, Kind::Code(&[5121, 5123, 5125])),
        ]),
    ),
    Property(
        "values",
        true,
        Kind::One(&[Property("bufferView", true, Kind::Index("bufferViews")), Property("byteOffset", false, OFFSET)]),
    ),
];

const BUFFER_VIEW: &[Property] = &[
    Property("buffer", true, Kind::Index("buffers")),
    Property("byteOffset", false, OFFSET),
    Property("byteLength", true, COUNT),
    Property("byteStride", false, Kind::Whole { low: 4, high: 252 }),
    Property("target", false, Kind::Code(&[34962, 34963])),
];

const BUFFER: &[Property] = &[Property("uri", false, Kind::Text), Property("byteLength", true, COUNT)];
