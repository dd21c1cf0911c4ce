//! The nodes of textures, and the images that they name. The word of `kind` selects the schema and its reader. Textures
//! that name one file share its image.

use super::grid::GRID;
use super::kind_of;
use super::procedural::{CHECKER, FBM, GRADIENT, MARBLE, NOISE, RAMP, TURBULENCE, WOOD, WORLEY};
use crate::assets::{Asset, AssetPath};
use crate::diagnostic::closest_word;
use crate::image::{MAX_IMAGE_BYTES, read_image};
use crate::text::decode::Decoder;
use crate::text::reader::Fields;
use crate::text::report::Message;
use crate::text::schema::{Field, FieldSchema, NodeSchema, Text, quoted};
use crate::text::syntax::{Node, Span};
use canaletto::Named;
use canaletto::math::Rgb;
use canaletto::texture::{ColorSpace, Filter, Image, ImageTexture, Placement, Prefilter, Texture, TextureKind, Wrap};
use std::collections::HashMap;
use std::path::PathBuf;

/// The word of textures.
pub(crate) const TEXTURE: &str = "texture";

/// The word that selects a kind of texture.
const KIND: &str = kind(&[]).name();

/// A kind of texture with its reader.
pub(crate) struct TextureNode {
    pub(crate) schema: NodeSchema,
    pub(super) read: fn(&mut Decoder, &Fields) -> Option<TextureKind>,
}

/// The kinds of textures, in the order of the reference. A texture without a kind is of the first.
pub(crate) static TEXTURES: &[&TextureNode] = &[
    &IMAGE,
    &CONSTANT,
    &RAMP,
    &GRID,
    &VERTEX_COLOR,
    &CHECKER,
    &GRADIENT,
    &NOISE,
    &FBM,
    &TURBULENCE,
    &MARBLE,
    &WOOD,
    &WORLEY,
];

/// The schema of a texture node.
pub(crate) fn texture(node: &Node) -> Option<&'static NodeSchema> {
    let mut schemas = TEXTURES.iter().map(|texture| &texture.schema);
    match node.text(KIND) {
        Some((kind, _)) => schemas.find(|schema| kind_of(schema) == kind),
        None => schemas.next(),
    }
}

const NAME: Field<Text> = Field::text("name", "the name that materials refer to").needed();
/// The field that selects a kind of texture.
pub(super) const fn kind(word: &'static [&'static str]) -> Field<Text> {
    Field::kind(word, "the kind of texture")
}

pub(super) const fn texture_node(
    doc: &'static str,
    words: &'static [&'static [FieldSchema]],
    example: &'static str,
    read: fn(&mut Decoder, &Fields) -> Option<TextureKind>,
) -> TextureNode {
    TextureNode { schema: NodeSchema::new(TEXTURE, doc, words).argument(NAME.schema).example(example), read }
}

pub(super) const SPACE: Field<ColorSpace> = Field::word(
    "space",
    "what the numbers mean: colours on the sRGB curve, linear colours, or no colours at all (heights, normals, masks)",
)
.or(|| "as the file says".into());
const IMAGE_KIND: Field<Text> = kind(&["image"]).or(|| quoted(kind_of(&IMAGE.schema)));
const FILE: Field<Text> = Field::text(
    "file",
    "the image: PNG, JPEG, OpenEXR, Radiance HDR, WebP or KTX2; relative paths start at this file's folder",
)
.needed();
const FILTER: Field<Filter> =
    Field::word("filter", "how texels become a function").or(|| quoted(Filter::default().name()));
const PREFILTER: Field<Prefilter> = Field::word(
    "prefilter",
    "what is done where texels are smaller than pixels: nothing, the mean over a square, or the mean over the pixel's \
     ellipse",
)
.or(|| quoted(Prefilter::default().name()));
const WRAP: Field<Wrap> = Field::word(
    "wrap",
    "what is outside the unit square: the image again, the image mirrored, its border, opaque black, or nothing",
)
.or(|| quoted(Wrap::default().name()));
const WRAP_U: Field<Wrap> =
    Field::word("wrap-u", "the same, to the left and to the right only").or(|| "as `wrap`".into());
const WRAP_V: Field<Wrap> = Field::word("wrap-v", "the same, above and below only").or(|| "as `wrap`".into());
const TEXELS: Field<Placement> = Field::word(
    "texels",
    "whether u = 0 and u = 1 are the centres of the first and the last texel, as in the textbook, or their outer \
     edges, as in OpenGL: for images made to be repeated and for spheres",
)
.or(|| quoted(Placement::default().name()));

static IMAGE: TextureNode = texture_node(
    "An image over the unit square: u runs from its left to its right, v from its top row to its bottom row.",
    &[&[
        IMAGE_KIND.schema,
        FILE.schema,
        FILTER.schema,
        PREFILTER.schema,
        WRAP.schema,
        WRAP_U.schema,
        WRAP_V.schema,
        TEXELS.schema,
        SPACE.schema,
    ]],
    "texture \"bricks\" file=\"bricks.png\" { filter \"bilinear\"; wrap \"repeat\"; texels \"edges\" }",
    |decoder, f| {
        let wrap = f.word(&WRAP).unwrap_or_default();
        let image = decoder.image(f.text(&FILE)?, f.span(&FILE))?;
        Some(TextureKind::Image(ImageTexture {
            filter: f.word(&FILTER).unwrap_or_default(),
            prefilter: f.word(&PREFILTER).unwrap_or_default(),
            wrap: [&WRAP_U, &WRAP_V].map(|axis| f.word(axis).unwrap_or(wrap)),
            placement: f.word(&TEXELS).unwrap_or_default(),
            space: f.word(&SPACE),
            ..ImageTexture::new(image)
        }))
    },
);

const COLOR: Field<Rgb> = Field::new("color", "the colour, linear").needed();
const ALPHA: Field<f32> = Field::new("alpha", "its alpha, 0 to 1").or(|| DEFAULT_ALPHA.to_string());
/// The default alpha of a constant texture.
const DEFAULT_ALPHA: f32 = 1.0;

static CONSTANT: TextureNode = texture_node(
    "One colour everywhere.",
    &[&[kind(&["constant"]).needed().schema, COLOR.schema, ALPHA.schema]],
    "texture \"white\" kind=\"constant\" { color 1; alpha 0.5 }",
    |_, f| {
        let Rgb { r, g, b } = f.get(&COLOR)?;
        Some(TextureKind::Constant([r, g, b, f.get(&ALPHA).unwrap_or(DEFAULT_ALPHA)]))
    },
);

static VERTEX_COLOR: TextureNode = texture_node(
    "The colours and alphas of a mesh's vertices; white on other objects. A mesh's colours replace the diffuse colour \
     of a material that has no such texture.",
    &[&[kind(&["vertex-color"]).needed().schema]],
    "texture \"paint\" kind=\"vertex-color\"",
    |_, _| Some(TextureKind::VertexColor),
);

/// The images that were read. `None` stands for a file that can't be read, which is reported once.
#[derive(Default)]
pub(crate) struct Images {
    by_place: HashMap<PathBuf, Option<u32>>,
    by_identity: HashMap<PathBuf, Option<u32>>,
}

impl<'a> Decoder<'a> {
    /// Decodes the textures first, so that all materials can refer to them.
    pub(crate) fn textures<'n: 'a>(&mut self, nodes: &'n [Node]) {
        let mut places: HashMap<&str, Span> = HashMap::new();
        for node in nodes.iter().filter(|node| &*node.name == TEXTURE) {
            let Some(TextureNode { schema, read }) = self.texture_node(node) else {
                self.valid = false;
                continue;
            };
            let name = node.values.first().and_then(|v| v.as_text());
            let title = name.map_or(TEXTURE.into(), |n| format!("texture \"{n}\""));
            let fields = self.validator.fields(node, schema, &title);
            self.valid &= fields.valid;
            let Some(name) = fields.text(&NAME) else { continue };
            let span = fields.span(&NAME);
            if let Some(first) = places.insert(name, span) {
                let place = self.validator.files.first(first, span);
                let message = Message::error(span, format!("two textures are called \"{name}\""));
                self.validator.report.push(message.label(place));
                self.valid = false;
                continue;
            }
            // A texture that can't be decoded keeps its name, so that it isn't reported as undefined.
            let kind = read(self, &fields).unwrap_or_else(|| {
                self.valid = false;
                TextureKind::Constant([0.0; 4])
            });
            self.textures.insert(name, self.scene.textures.len() as u32);
            self.scene.textures.push(Texture { name: name.to_owned(), kind });
        }
    }

    /// The kind of texture that the node names.
    fn texture_node(&mut self, node: &Node) -> Option<&'static TextureNode> {
        let Some((text, span)) = node.text(KIND) else { return TEXTURES.first().copied() };
        let kinds = TEXTURES.iter().map(|texture| kind_of(&texture.schema));
        if let Some(index) = kinds.clone().position(|kind| kind == text) {
            return Some(TEXTURES[index]);
        }
        let list: Vec<String> = kinds.clone().map(quoted).collect();
        let message = Message::error(span, format!("there is no kind of texture \"{text}\""));
        let help = match closest_word(text, kinds) {
            Some(right) => format!("did you mean \"{right}\"? Kinds of textures: {}", list.join(", ")),
            None => format!("kinds of textures: {}", list.join(", ")),
        };
        self.validator.report.push(message.help(help));
        None
    }

    /// The index of the image of this file. Mistakes are reported at its first use.
    pub(super) fn image(&mut self, file: &str, span: Span) -> Option<u32> {
        let from = self.validator.files.get(span.file)?.path.clone();
        let place = from.location().parent().map(|folder| folder.join(file)).unwrap_or_else(|| file.into());
        if let Some(known) = self.images.by_place.get(&place) {
            return *known;
        }
        let image = self.read_image(file, span, &from);
        self.images.by_place.insert(place, image);
        image
    }

    fn read_image(&mut self, file: &str, span: Span, from: &AssetPath) -> Option<u32> {
        let asset = self.opened(file, span, from)?;
        if let Some(known) = self.images.by_identity.get(asset.path.identity()) {
            return *known;
        }
        let key = format!("image {}", asset.path.identity().display());
        let image = match self.keep.get(key, || read_image(&asset)) {
            Ok((image, notes)) => {
                for note in notes {
                    let message = Message::warning(Some(span), format!("\"{file}\": {note}"));
                    self.validator.report.push(message);
                }
                self.add_image(image, span)
            }
            Err(error) => {
                let message = Message::error(span, format!("\"{file}\": {error}"));
                self.validator.report.push(match error.help() {
                    Some(help) => message.help(help),
                    None => message,
                });
                None
            }
        };
        self.images.by_identity.insert(asset.path.identity().to_owned(), image);
        image
    }

    /// The bytes of a file that a node names; errors are reported.
    pub(super) fn opened(&mut self, file: &str, span: Span, from: &AssetPath) -> Option<Asset> {
        match self.assets.read(file, from) {
            Ok(asset) => Some(asset),
            Err(error) => {
                let message = Message::error(span, error.to_string());
                self.validator.report.push(match error.help() {
                    Some(help) => message.help(help),
                    None => message,
                });
                None
            }
        }
    }

    /// Adds an image to the scene, if the limit allows; returns its index.
    pub(super) fn add_image(&mut self, image: Image, span: Span) -> Option<u32> {
        let bytes: u64 = self.scene.images.iter().chain([&image]).map(|i| i.samples.bytes() as u64).sum();
        if bytes > MAX_IMAGE_BYTES {
            let message = format!("the scene's images take more than {} GiB of memory", MAX_IMAGE_BYTES >> 30);
            self.validator.report.push(Message::error(span, message).help("scale some of them down"));
            return None;
        }
        self.scene.images.push(image);
        Some(self.scene.images.len() as u32 - 1)
    }
}
