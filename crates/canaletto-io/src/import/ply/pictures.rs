//! The pictures that a PLY file's header names: `comment TextureFile skin.png`, as MeshLab writes them.

use crate::assets::{Assets, OpenAsset};
use crate::diagnostic::{Diagnostic, Diagnostics};
use crate::image::{MAX_IMAGE_BYTES, read_image};
use canaletto::material::{Material, Parameter, Phong, Target, TextureUse};
use canaletto::math::Rgb;
use canaletto::texture::{Image, ImageTexture, Texture, TextureKind};

/// The pictures of a file, with a material for each name.
#[derive(Default)]
pub(super) struct Pictures {
    pub(super) images: Vec<Image>,
    pub(super) textures: Vec<Texture>,
    pub(super) materials: Vec<Material>,
}

/// Reads the pictures. One that can't be read is a warning, and its material is white. If none can, there are no
/// materials.
pub(super) fn read(names: &[String], asset: &OpenAsset, assets: &dyn Assets, warnings: &mut Diagnostics) -> Pictures {
    let mut pictures = Pictures::default();
    let mut bytes = 0;
    for name in names {
        let path = name.trim().trim_matches('"').replace('\\', "/");
        let image = assets.read(&path, &asset.path).map_err(|error| (error.to_string(), error.help()));
        let image = image.and_then(|picture| {
            let (image, notes) =
                read_image(&picture).map_err(|error| (error.to_string(), error.help().map(str::to_owned)))?;
            let told = notes.iter().map(|note| Diagnostic::warning(asset.path.name(), format!("\"{path}\": {note}")));
            told.for_each(|warning| warnings.push(warning));
            Ok(image)
        });
        let image = image.and_then(|image| {
            bytes += image.samples.bytes() as u64;
            let fits = bytes <= MAX_IMAGE_BYTES;
            fits.then_some(image).ok_or_else(|| ("the pictures of the file take too much memory".to_owned(), None))
        });
        let mut material = Material::new(name.as_str(), Phong { kd: Rgb::WHITE, ..Phong::default() });
        match image {
            Ok(image) => {
                pictures.images.push(image);
                let kind = TextureKind::Image(ImageTexture::new(pictures.images.len() as u32 - 1));
                pictures.textures.push(Texture { name: name.clone(), kind });
                let texture = pictures.textures.len() as u32 - 1;
                material.textures.push(TextureUse::new(texture, Target::Parameter(Parameter::Diffuse)));
            }
            Err((problem, help)) => {
                let message = format!("a picture that its header names is left out: {problem}");
                let mut warning = Diagnostic::warning(asset.path.name(), message);
                warning.help = help;
                warnings.push(warning);
            }
        }
        pictures.materials.push(material);
    }
    if pictures.images.is_empty() { Pictures::default() } else { pictures }
}
