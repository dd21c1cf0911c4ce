//! Decoding of textures and of the images that they name. Textures that name one file share its image.

use super::Decoder;
use super::fields::Fields;
use crate::assets::{Asset, AssetPath};
use crate::image::read_image;
use crate::text::closest_word::closest_word;
use crate::text::report::Message;
use crate::text::schema::{self, DEFAULT_KIND, TEXTURES};
use crate::text::syntax::{Node, Span};
use canaletto::texture::{Image, ImageTexture, Texture, TextureKind};
use std::collections::HashMap;
use std::path::PathBuf;

/// The largest total memory of a scene's images in bytes.
pub(crate) const MAX_IMAGE_BYTES: u64 = 8 << 30;

/// The images that were read. `None` stands for a file that can't be read, which is reported once.
#[derive(Default)]
pub(super) struct Images {
    by_place: HashMap<PathBuf, Option<u32>>,
    by_identity: HashMap<PathBuf, Option<u32>>,
}

impl<'a> Decoder<'a> {
    /// Decodes the textures first, so that all materials can refer to them.
    pub(super) fn textures<'n: 'a>(&mut self, nodes: &'n [Node]) {
        let mut places: HashMap<&str, Span> = HashMap::new();
        for node in nodes.iter().filter(|node| &*node.name == "texture") {
            let Some(kind) = self.texture_kind(node) else {
                self.valid = false;
                continue;
            };
            let Some(words) = schema::texture(kind) else { continue };
            let name = node.values.first().and_then(|v| v.as_text());
            let title = name.map_or("texture".into(), |n| format!("texture \"{n}\""));
            let fields = self.validator.fields(node, words, &title);
            self.valid &= fields.valid;
            let Some(name) = fields.text("name") else { continue };
            let span = fields.span("name");
            if let Some(first) = places.insert(name, span) {
                let place = self.validator.files.first(first, span);
                let message = Message::error(span, format!("two textures are called \"{name}\""));
                self.validator.report.push(message.label(place));
                self.valid = false;
                continue;
            }
            // A texture that can't be decoded keeps its name, so that it isn't reported as undefined.
            let kind = self.kind_of_texture(kind, &fields).unwrap_or_else(|| {
                self.valid = false;
                TextureKind::Constant([0.0; 4])
            });
            self.textures.insert(name, self.scene.textures.len() as u32);
            self.scene.textures.push(Texture { name: name.to_owned(), kind });
        }
    }

    /// The word that selects the schema of the node.
    fn texture_kind(&mut self, node: &Node) -> Option<&'static str> {
        let Some((text, span)) = node.text("kind") else { return Some(DEFAULT_KIND) };
        let kinds = TEXTURES.iter().map(|(kind, _)| *kind);
        if let Some(kind) = kinds.clone().find(|kind| *kind == text) {
            return Some(kind);
        }
        let list: Vec<String> = kinds.clone().map(|kind| format!("\"{kind}\"")).collect();
        let message = Message::error(span, format!("there is no kind of texture \"{text}\""));
        let help = match closest_word(text, kinds) {
            Some(right) => format!("did you mean \"{right}\"? Kinds of textures: {}", list.join(", ")),
            None => format!("kinds of textures: {}", list.join(", ")),
        };
        self.validator.report.push(message.help(help));
        None
    }

    fn kind_of_texture(&mut self, kind: &str, f: &Fields) -> Option<TextureKind> {
        Some(match kind {
            "image" => TextureKind::Image(self.image_texture(f)?),
            "grid" => TextureKind::Grid(self.grid(f)?),
            _ => TextureKind::Procedural(self.procedural(kind, f)?),
        })
    }

    fn image_texture(&mut self, f: &Fields) -> Option<ImageTexture> {
        let wrap = f.named("wrap").unwrap_or_default();
        let axis = |word| f.named(word).unwrap_or(wrap);
        let image = self.image(f.text("file")?, f.span("file"))?;
        Some(ImageTexture {
            filter: f.named("filter").unwrap_or_default(),
            prefilter: f.named("prefilter").unwrap_or_default(),
            wrap: [axis("wrap-u"), axis("wrap-v")],
            placement: f.named("texels").unwrap_or_default(),
            space: f.named("space"),
            ..ImageTexture::new(image)
        })
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
