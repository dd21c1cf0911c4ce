//! The bytes of a scene's pictures: those of the files that they come from, or new ones.

use crate::assets::{Asset, AssetPath, Assets, MemoryAssets};
use crate::codec;
use crate::image::{hdr, read_image};
use crate::import;
use crate::picture::{EncodeSettings, PictureFormat, image_of_texture};
use canaletto::light::IesProfile;
use canaletto::scene::Transfer;
use canaletto::texture::{ColorSpace, Image, Samples};
use std::cell::OnceCell;

/// The files that a scene was read from, as far as they hold pictures or profiles of lamps. Their bytes are written
/// again.
#[derive(Default)]
pub struct Originals {
    pictures: Vec<Original>,
    profiles: Vec<(IesProfile, String, Vec<u8>)>,
}

struct Original {
    name: String,
    bytes: Vec<u8>,
    decoded: OnceCell<Option<Image>>,
}

impl Originals {
    /// The extensions of files that may be kept.
    pub const EXTENSIONS: [&str; 10] = ["png", "jpg", "jpeg", "exr", "hdr", "webp", "ktx2", "glb", "gltf", "ies"];

    /// No files.
    pub fn new() -> Originals {
        Originals::default()
    }

    /// Adds a file, if it is a picture or a model with pictures in it. `path` is its origin.
    pub fn add(&mut self, path: &AssetPath, bytes: Vec<u8>, assets: &dyn Assets) {
        if extension_of(&bytes).is_some() {
            let name = path.name().to_owned();
            self.pictures.push(Original { name, bytes, decoded: OnceCell::new() });
        } else if ["glb", "gltf"].contains(&&*path.extension()) {
            let held = import::pictures_in_gltf(&bytes, assets, path);
            let original = |(name, bytes)| Original { name, bytes, decoded: OnceCell::new() };
            self.pictures.extend(held.into_iter().map(original));
        } else if path.extension() == "ies" {
            let alone = MemoryAssets::new().with("lamp.ies", bytes.clone());
            if let Ok((profile, _)) = import::read_ies("lamp.ies", &alone, &AssetPath::base()) {
                self.profiles.push((profile, path.name().to_owned(), bytes));
            }
        }
    }

    /// The name and the bytes of the file that this profile was read from.
    pub(super) fn profile(&self, profile: &IesProfile) -> Option<(String, Vec<u8>)> {
        let (_, name, bytes) = self.profiles.iter().find(|(known, ..)| known == profile)?;
        Some((name.clone(), bytes.clone()))
    }

    /// The bytes of the file that this image was read from.
    pub(super) fn bytes_of(&self, image: &Image) -> Option<&[u8]> {
        // Names are compared first, since decoding takes time.
        let (same, others): (Vec<&Original>, Vec<&Original>) =
            self.pictures.iter().partition(|original| original.name == image.name);
        let found = same.into_iter().chain(others).find(|original| original.is(image));
        found.map(|original| original.bytes.as_slice())
    }
}

impl Original {
    fn is(&self, image: &Image) -> bool {
        let decoded = self.decoded.get_or_init(|| decoded(&self.bytes));
        decoded.as_ref().is_some_and(|decoded| is_same(decoded, image))
    }
}

fn decoded(bytes: &[u8]) -> Option<Image> {
    let asset = Asset { path: AssetPath::base(), bytes: bytes.to_vec() };
    read_image(&asset).ok().map(|(image, _)| image)
}

/// Whether two images differ in their names only.
fn is_same(a: &Image, b: &Image) -> bool {
    let Image { name: _, width, height, channels, samples, space, premultiplied } = a;
    (width, height, channels, space, premultiplied) == (&b.width, &b.height, &b.channels, &b.space, &b.premultiplied)
        && *samples == b.samples
}

/// The extension of a picture's format, by its first bytes.
pub(super) fn extension_of(bytes: &[u8]) -> Option<&'static str> {
    let formats = [
        (codec::is_png(bytes), "png"),
        (codec::is_jpeg(bytes), "jpg"),
        (codec::is_exr(bytes), "exr"),
        (hdr::is_hdr(bytes), "hdr"),
        (codec::is_webp(bytes), "webp"),
        (bytes.starts_with(b"\xABKTX 20\xBB"), "ktx2"),
    ];
    formats.into_iter().find(|(is_own, _)| *is_own).map(|(_, extension)| extension)
}

/// A picture in a file.
pub(super) struct Encoded {
    pub(super) bytes: Vec<u8>,
    pub(super) extension: &'static str,
    /// Whether reading it gives the image again. Its colour space apart, which textures can say.
    pub(super) is_exact: bool,
}

/// An image as a file: as it came, or as PNG or EXR. None if it can't be encoded.
pub(super) fn encoded(image: &Image, originals: &Originals) -> Option<Encoded> {
    if let Some(bytes) = originals.bytes_of(image)
        && let Some(extension) = extension_of(bytes)
    {
        return Some(Encoded { bytes: bytes.to_vec(), extension, is_exact: true });
    }
    let (format, bits) = match image.samples {
        Samples::U8(_) => (PictureFormat::Png, 8),
        Samples::U16(_) => (PictureFormat::Png, 16),
        Samples::F16(_) => (PictureFormat::Exr, 16),
        Samples::F32(_) => (PictureFormat::Exr, 32),
    };
    let extension = format.extension();
    let bytes = encode(image, format, bits)?;
    let is_exact = decoded(&bytes).is_some_and(|read| {
        let space = if format == PictureFormat::Png { image.space } else { read.space };
        is_same(&Image { space, ..read }, image)
    });
    Some(Encoded { bytes, extension, is_exact })
}

/// An image as PNG or JPEG, which all programs read: as it came, or as a PNG of its numbers cut at 1.
pub(super) fn encoded_for_screens(image: &Image, originals: &Originals) -> Option<Encoded> {
    if let Some(bytes) = originals.bytes_of(image)
        && let Some(extension @ ("png" | "jpg")) = extension_of(bytes)
    {
        return Some(Encoded { bytes: bytes.to_vec(), extension, is_exact: true });
    }
    let (bits, is_exact) = match image.samples {
        Samples::U8(_) => (8, image.space != ColorSpace::Linear),
        Samples::U16(_) => (16, image.space != ColorSpace::Linear),
        Samples::F16(_) | Samples::F32(_) => (8, false),
    };
    encode(image, PictureFormat::Png, bits).map(|bytes| Encoded { bytes, extension: "png", is_exact })
}

fn encode(image: &Image, format: PictureFormat, bits: u8) -> Option<Vec<u8>> {
    let settings = EncodeSettings { bits: Some(bits), ..EncodeSettings::default() };
    let transfer = if format == PictureFormat::Png { Transfer::Srgb } else { Transfer::None };
    format.encode_image(&image_of_texture(image), transfer, &settings, &[]).ok()
}
