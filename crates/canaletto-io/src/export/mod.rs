//! Export of scenes: in any form that others read ([`convert`]), or with their light in textures (glTF and OBJ).

pub mod convert;
mod glb;
mod gltf;
mod obj;
#[cfg(test)]
mod tests;

use crate::picture::{Channel, EncodeSettings, Image, PictureError, PictureFormat};
use canaletto::bake::{Atlas, BakedScene};
use canaletto::film::{Picture, develop};
use canaletto::material::PreparedMaterial;
use canaletto::math::Rgb;
use canaletto::scene::{Developing, Transfer, View};
use canaletto::{Named, named};
use glam::{DVec3, Vec3};
use std::f32::consts::PI;

/// The formats of exported scenes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum ExportFormat {
    /// glTF 2.0 in one binary file.
    #[default]
    Glb,
    /// Wavefront OBJ with a material library.
    Obj,
}

named!(ExportFormat {
    Glb => "glb": "glTF 2.0 in one binary file",
    Obj => "obj": "Wavefront OBJ with a material library",
});

/// What the textures hold.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum LightMaps {
    /// Finished colours: materials in their light. Programs show them as they are.
    #[default]
    Combined,
    /// Materials as they are, and the light alone in an EXR file.
    Light,
}

named!(LightMaps {
    Combined => "combined": "Finished colours, materials in their light, which programs show as they are",
    Light => "light": "Materials without light, and the irradiance in an EXR file beside",
});

/// The axis of the scene that points up. Exported scenes have y upwards.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum UpAxis {
    /// x.
    X,
    /// y.
    #[default]
    Y,
    /// z.
    Z,
}

named!(UpAxis {
    X => "x",
    Y => "y",
    Z => "z",
});

impl UpAxis {
    /// The axis that is nearest to a camera's direction upwards.
    pub fn of_view(view: &View) -> UpAxis {
        let up = view.extrinsics.up.abs();
        if up.z > up.x && up.z > up.y {
            UpAxis::Z
        } else if up.x > up.y {
            UpAxis::X
        } else {
            UpAxis::Y
        }
    }

    /// A vector with y upwards. The axes are only exchanged, so nothing is rounded.
    fn turn<V: From<[T; 3]> + Into<[T; 3]>, T: std::ops::Neg<Output = T>>(self, v: V) -> V {
        let [x, y, z] = v.into();
        match self {
            UpAxis::X => [-y, x, z].into(),
            UpAxis::Y => [x, y, z].into(),
            UpAxis::Z => [x, z, -y].into(),
        }
    }
}

/// A scene to export.
#[derive(Clone, Copy, Debug)]
pub struct Export<'a> {
    /// The triangles and the light map.
    pub baked: &'a BakedScene,
    /// The materials that the triangles refer to.
    pub materials: &'a [PreparedMaterial],
    /// The place of the scene's zero: positions are relative to it.
    pub origin: DVec3,
    /// The cameras.
    pub views: &'a [View],
    /// How colours are developed.
    pub developing: Developing,
    /// The axis that points up.
    pub up: UpAxis,
    /// What the textures hold.
    pub maps: LightMaps,
    /// The name of the files without an extension. Files name each other by it.
    pub stem: &'a str,
}

/// A file of an export.
#[derive(Clone, Debug, PartialEq)]
pub struct ExportedFile {
    /// What follows the stem in the file's name, such as ".glb".
    pub ending: &'static str,
    /// The content.
    pub bytes: Vec<u8>,
}

/// The end of the name of the file that holds the irradiance.
const LIGHT: &str = ".light.exr";

impl ExportFormat {
    /// The format of a file name's extension, in lower case.
    pub fn of_extension(extension: &str) -> Option<ExportFormat> {
        ExportFormat::from_name(extension)
    }

    /// What follows the stem in the names of all files of an export, the main file first.
    pub fn endings(self, maps: LightMaps) -> &'static [&'static str] {
        match (self, maps) {
            (ExportFormat::Glb, LightMaps::Combined) => &[".glb"],
            (ExportFormat::Glb, LightMaps::Light) => &[".glb", LIGHT],
            (ExportFormat::Obj, _) => &[".obj", ".mtl", ".png", LIGHT],
        }
    }

    /// The files of a scene, in the order of [`ExportFormat::endings`].
    ///
    /// # Errors
    /// [`PictureError`] if a texture can't be encoded.
    pub fn files(self, export: &Export) -> Result<Vec<ExportedFile>, PictureError> {
        let contents = match self {
            ExportFormat::Glb => gltf::files(export)?,
            ExportFormat::Obj => obj::files(export)?,
        };
        let endings = self.endings(export.maps);
        Ok(endings.iter().zip(contents).map(|(ending, bytes)| ExportedFile { ending, bytes }).collect())
    }
}

impl Export<'_> {
    /// A texture for display: the finished colours, or those of the materials.
    fn color_png(&self) -> Result<Vec<u8>, PictureError> {
        let Atlas { width, height, radiance, reflectance, .. } = &self.baked.atlas;
        let picture = |pixels| Picture { pixels, ..Picture::new(*width, *height) };
        let shown: Vec<Rgb> = match self.maps {
            LightMaps::Combined => {
                let picture = picture(radiance.iter().map(|&color| Rgb::from(color)).collect());
                develop(&picture, &self.developing)
            }
            LightMaps::Light => {
                let picture = picture(reflectance.iter().map(|&[r, g, b, _]| Rgb::new(r, g, b)).collect());
                develop(&picture, &Developing::default())
            }
        };
        let mut image = Image::from_rgb(*width, *height, shown.iter().map(|color| color.to_array()));
        let has_alpha =
            self.baked.meshes.iter().flat_map(|mesh| &mesh.parts).any(|part| !self.is_opaque(part.material));
        if has_alpha {
            image.channels.push(Channel::new("A", reflectance.iter().map(|texel| texel[3]).collect()));
        }
        PictureFormat::Png.encode_image(&image, Transfer::Srgb, &EncodeSettings::default(), &self.texts("colour"))
    }

    /// The irradiance in linear numbers.
    fn light_exr(&self) -> Result<Vec<u8>, PictureError> {
        let Atlas { width, height, light, .. } = &self.baked.atlas;
        let image = Image::from_rgb(*width, *height, light.iter().map(|light| light.map(|v| v * PI)));
        PictureFormat::Exr.encode_image(&image, Transfer::None, &EncodeSettings::default(), &self.texts("irradiance"))
    }

    fn texts(&self, quantity: &str) -> [(String, String); 1] {
        [("light map".to_owned(), quantity.to_owned())]
    }

    fn is_opaque(&self, material: u32) -> bool {
        self.materials[material as usize].is_opaque()
    }

    fn position(&self, position: Vec3) -> Vec3 {
        self.up.turn(position)
    }

    fn point(&self, point: DVec3) -> DVec3 {
        self.up.turn(point)
    }
}
