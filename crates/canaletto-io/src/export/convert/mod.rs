//! Scenes and models in the forms that others read: scene text, glTF, OBJ and PLY. What a form can't say is told.

mod array;
mod gltf;
mod lost;
mod mesh_file;
mod names;
mod obj;
mod pictures;
mod ply;
mod text;
mod triangles;

pub use lost::Loss;
pub use pictures::Originals;

use canaletto::math::Rgb;
use canaletto::scene::Scene;
use canaletto::{Named, named};
use lost::Lost;

/// The forms that a scene can be converted to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ConvertFormat {
    /// Scene text.
    Text,
    /// glTF 2.0 in one binary file.
    Glb,
    /// glTF 2.0 as JSON, with its bytes in a file beside it.
    Gltf,
    /// Wavefront OBJ with a material library.
    Obj,
    /// PLY, binary.
    Ply,
}

named!(ConvertFormat {
    Text => "kdl": "Scene text, with meshes and pictures in a folder beside it",
    Glb => "glb": "glTF 2.0 in one binary file",
    Gltf => "gltf": "glTF 2.0 as JSON, with its bytes in a file beside it",
    Obj => "obj": "Wavefront OBJ with a material library and pictures",
    Ply => "ply": "PLY, binary: triangles with colours",
});

impl ConvertFormat {
    /// The form of a file name's extension, in lower case.
    pub fn of_extension(extension: &str) -> Option<ConvertFormat> {
        ConvertFormat::from_name(extension)
    }

    /// Whether the form holds all of a scene: its camera, its lights, and how the picture is made.
    pub fn holds_scenes(self) -> bool {
        matches!(self, ConvertFormat::Text)
    }
}

/// A scene to convert.
#[derive(Clone)]
pub struct Source<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// The files that it comes from.
    pub originals: &'a Originals,
    /// The name of the output without its extension. Files name each other by it.
    pub stem: &'a str,
    /// Whether surfaces without a material have the default one of scenes. Those of models have none.
    pub has_default_material: bool,
    /// Remarks for people at the start of the output, as far as the form has some.
    pub remarks: Vec<String>,
}

/// A converted scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Conversion {
    /// The files, the main one first.
    pub files: Vec<ConvertedFile>,
    /// What is left out.
    pub lost: Vec<Loss>,
}

/// A file of a converted scene.
#[derive(Clone, Debug, PartialEq)]
pub struct ConvertedFile {
    /// The name beside the main file, with `/` behind a folder.
    pub name: String,
    /// The content.
    pub bytes: Vec<u8>,
}

/// Converts a scene.
pub fn convert(source: &Source, format: ConvertFormat) -> Conversion {
    match format {
        ConvertFormat::Text => text::convert(source),
        ConvertFormat::Glb => gltf::convert(source, true),
        ConvertFormat::Gltf => gltf::convert(source, false),
        ConvertFormat::Obj => obj::convert(source),
        ConvertFormat::Ply => ply::convert(source),
    }
}

/// Tells what is around a scene, and how its picture is made, for forms that hold objects only.
fn lose_surroundings(scene: &Scene, lost: &mut Lost) {
    if let Some(environment) = &scene.environment {
        lost.add("environments", environment.kind_name());
    }
    if scene.background != Rgb::BLACK {
        lost.of_scene("the background's colour");
    }
    if scene.ambient != Rgb::BLACK {
        lost.of_scene("the ambient light");
    }
}

#[cfg(test)]
mod tests;
