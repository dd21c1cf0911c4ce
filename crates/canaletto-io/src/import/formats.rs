//! The table of model formats. The extensions that are read, and the messages and help texts that name them, come from
//! it.

use super::{ReadOptions, UpAxis, gltf, nff, obj, ply, stl};
use crate::assets::{Assets, OpenAsset};
use crate::diagnostic::Diagnostics;
use canaletto::scene::Fragment;

/// A format of model files.
#[derive(Debug)]
#[non_exhaustive]
pub struct ModelFormat {
    /// The usual name.
    pub name: &'static str,
    /// The file name extensions, in lower case.
    pub extensions: &'static [&'static str],
    /// What a file holds.
    pub holds: Holds,
    /// The axis that points upwards in most files.
    pub up: UpAxis,
    /// Reads a file of this format; returns its content with warnings.
    pub(super) read: fn(&OpenAsset, &dyn Assets, &ReadOptions) -> ReadFragment,
    /// The length in seconds of a clip of this name, or of the first one; none if nothing is animated. `None` for
    /// formats without animations.
    pub(super) duration: Option<ReadDuration>,
}

/// Reads the length of a clip.
pub(super) type ReadDuration = fn(&OpenAsset, &dyn Assets, Option<&str>) -> Result<Option<f64>, Diagnostics>;

/// The content of a file with warnings, or its mistakes.
pub(super) type ReadFragment = Result<(Fragment, Diagnostics), Diagnostics>;

/// What a file of a format holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Holds {
    /// Objects with their materials. [`super::load`] adds what the file lacks of camera, lights and ground.
    Objects,
    /// A whole scene, to which nothing is added. `mesh file=…` doesn't read it.
    Scene,
}

/// All formats, in the order of the help texts.
pub const FORMATS: &[ModelFormat] = &[gltf::FORMAT, obj::FORMAT, ply::FORMAT, stl::FORMAT, nff::FORMAT];

impl ModelFormat {
    /// The format of files with this extension, which is in lower case.
    pub fn of_extension(extension: &str) -> Option<&'static ModelFormat> {
        FORMATS.iter().find(|format| format.extensions.contains(&extension))
    }
}

/// Formats that aren't read: their extensions, their usual names, and programs that write what is read.
const FOREIGN: [(&[&str], &str, &str); 11] = [
    (&["fbx"], "FBX", "Blender"),
    (&["dae"], "COLLADA", "Blender"),
    (&["3ds"], "3DS", "assimp"),
    (&["usd", "usda", "usdc", "usdz"], "USD", "Blender"),
    (&["blend"], "Blender's format", "Blender"),
    (&["off"], "OFF", "MeshLab"),
    (&["3mf"], "3MF", "PrusaSlicer"),
    (&["step", "stp"], "STEP", "FreeCAD"),
    (&["iges", "igs"], "IGES", "FreeCAD"),
    (&["ifc"], "IFC", "FreeCAD"),
    (&["vdb"], "OpenVDB", "Blender"),
];

/// The usual name of a format that isn't read, and a program that converts its files to OBJ or PLY. The extension is in
/// lower case.
pub fn foreign_format(extension: &str) -> Option<(&'static str, &'static str)> {
    let row = FOREIGN.iter().find(|(extensions, ..)| extensions.contains(&extension))?;
    Some((row.1, row.2))
}

/// The extensions of these formats in alphabetical order, as messages list them.
pub(super) fn sorted_extensions(formats: impl Iterator<Item = &'static ModelFormat>) -> Vec<&'static str> {
    let mut all: Vec<&str> = formats.flat_map(|format| format.extensions).copied().collect();
    all.sort_unstable();
    all
}
