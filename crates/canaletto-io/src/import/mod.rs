//! Import of OBJ, PLY and NFF models, and of point clouds.
//!
//! [`load`] makes a whole scene of one file. [`load_mesh`] reads the models of `mesh file=…` in the scene text.
//! [`read_spheres`] and [`read_cylinders`] read the files of cloud nodes. Messages name the line or the element. Memory
//! is bounded by the file's size, whatever counts its header declares.

mod cloud;
mod color;
mod concat;
mod default_camera;
mod default_scene;
mod encoding;
mod fit_camera;
mod ignored;
mod lines;
mod monotone;
mod mtl;
mod nff;
mod number;
mod obj;
mod ply;
mod polygon;
mod positions;
mod precision_warning;
mod repair;
mod smooth;
mod table_color;
mod text;

pub use cloud::{CloudFormat, read_cylinders, read_spheres};
pub(crate) use default_camera::default_camera;
pub(crate) use positions::counted;
pub(crate) use precision_warning::inline_cloud;

use crate::assets::{Asset, AssetPath, Assets, OpenAsset, reason};
use crate::content::View;
use crate::diagnostic::{Diagnostic, Diagnostics};
use canaletto::material::Material;
use canaletto::scene::Scene;
use canaletto::shape::Mesh;
use glam::Vec3;
use lines::ImportError;
use precision_warning::Precision;
use smooth::{Smoothing, smooth};
use std::io;

/// An imported model: its meshes and materials.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct Imported {
    /// The meshes. Their `materials` are indices into [`Imported::materials`], to which a scene with materials of its
    /// own adds an offset.
    pub meshes: Vec<Mesh>,
    /// The materials in the order and with the names of the file.
    pub materials: Vec<Material>,
    /// Warnings about parts of the model that were left out, with the texts to which they refer.
    pub warnings: Diagnostics,
}

/// The file name extensions of models that [`load_mesh`] reads.
pub const MESH_EXTENSIONS: [&str; 2] = ["obj", "ply"];
/// The file name extensions of models that [`load`] reads as scenes.
pub const SCENE_EXTENSIONS: [&str; 3] = ["nff", "obj", "ply"];

/// Reads a model or a foreign scene, named by the user, as a whole scene. Models get a camera, lights and a ground. The
/// scene is returned with warnings.
///
/// # Errors
/// The mistakes in the file, or that its format isn't supported.
pub fn load(path: &str, assets: &dyn Assets) -> Result<(Scene, Diagnostics), Diagnostics> {
    let asset = open(path, assets, &AssetPath::base(), &SCENE_EXTENSIONS)?;
    if asset.path.extension() == "nff" {
        let OpenAsset { path: name, content } = asset;
        let bytes = content.view().whole().map_err(|e| Diagnostics::from(unreadable(&e).error(name.name())))?;
        return nff::read(&Asset { path: name, bytes: encoding::text(&bytes).into_owned() });
    }
    let mut model = read_model(&asset, assets, DefaultShading::Creases)?;
    let warnings = std::mem::take(&mut model.warnings);
    match default_scene::default_scene(model) {
        Some(scene) => Ok((scene, warnings)),
        None => {
            let wrong = "the model is too large to put a camera and lights around it";
            let help = "its coordinates may go up to about 1e37: scale it down in the program that made it";
            Err(Diagnostic::error(asset.path.name(), wrong).help(help).into())
        }
    }
}

/// Reads the meshes of a model that the file `from` names.
///
/// # Errors
/// The mistakes in the file, or that its format isn't supported. If it can't be opened, the message is about the whole
/// file.
pub fn load_mesh(path: &str, assets: &dyn Assets, from: &AssetPath) -> Result<Imported, Diagnostics> {
    read_mesh(&open(path, assets, from, &MESH_EXTENSIONS)?, assets)
}

/// Reads the meshes of an open model file.
///
/// # Errors
/// As [`load_mesh`].
pub fn read_mesh(asset: &OpenAsset, assets: &dyn Assets) -> Result<Imported, Diagnostics> {
    read_model(asset, assets, DefaultShading::Flat)
}

/// The shading of surfaces for which a file declares neither flat nor smooth normals.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum DefaultShading {
    Flat,
    /// Smooth except at creases.
    Creases,
}

fn read_model(asset: &OpenAsset, assets: &dyn Assets, unsaid: DefaultShading) -> Result<Imported, Diagnostics> {
    let model = read_format(asset, assets, unsaid)?;
    if model.meshes.iter().any(has_area) {
        return Ok(model);
    }
    let count: usize = model.meshes.iter().map(Mesh::len).sum();
    let wrong = format!("nothing in it has an area: {count} triangles, whose corners lie on a line or at one place");
    Err(ImportError::file(wrong).error(asset.path.name()).into())
}

/// Whether any triangle has an area beyond the rounding of its corners to `f32`, each coordinate relative to its own
/// size.
fn has_area(mesh: &Mesh) -> bool {
    (0..mesh.len()).any(|i| !is_flat(mesh.corners(i)))
}

/// Whether three corners are collinear or coincident within their rounding to `f32`.
pub(crate) fn is_flat(corners: [Vec3; 3]) -> bool {
    let [a, b, c] = corners.map(Vec3::as_dvec3);
    let longest = [b - a, c - b, a - c].into_iter().max_by(|x, y| x.length_squared().total_cmp(&y.length_squared()));
    let (normal, longest) = ((b - a).cross(c - a), longest.unwrap_or_default());
    let size = corners.iter().fold(Vec3::ZERO, |size, p| size.max(p.abs())).as_dvec3();
    let across = normal.cross(longest).normalize_or_zero().abs();
    normal.length() <= f64::from(f32::EPSILON) * across.dot(size) * longest.length()
}

fn read_format(asset: &OpenAsset, assets: &dyn Assets, unsaid: DefaultShading) -> Result<Imported, Diagnostics> {
    match asset.path.extension().as_str() {
        "obj" => {
            let mut model = obj::read(asset, assets, unsaid)?;
            let rounded = model.meshes.iter().find_map(|mesh| precision_warning::mesh(mesh, Precision::Double));
            rounded.into_iter().for_each(|complaint| model.warnings.push(complaint.warning(asset.path.name())));
            Ok(model)
        }
        "ply" => {
            let mut model = read_ply(asset)?;
            if unsaid == DefaultShading::Creases {
                let without = model.meshes.iter_mut().filter(|mesh| mesh.normals.is_empty());
                without.for_each(|mesh| smooth(mesh, Smoothing::Creases));
            }
            Ok(model)
        }
        other => Err(unsupported(asset.path.name(), other, &MESH_EXTENSIONS).into()),
    }
}

fn read_ply(asset: &OpenAsset) -> Result<Imported, Diagnostics> {
    let view = asset.content.view();
    let failed = |e: &io::Error| Diagnostics::from(unreadable(e).error(asset.path.name()));
    if !view.piece(0..encoding::START, &mut Vec::new()).map(encoding::is_utf16).map_err(|e| failed(&e))? {
        return read_ply_bytes(asset.path.name(), view);
    }
    let bytes = view.whole().map_err(|e| failed(&e))?;
    read_ply_bytes(asset.path.name(), encoding::text(&bytes)[..].into())
}

fn read_ply_bytes(file: &str, view: View<'_>) -> Result<Imported, Diagnostics> {
    match ply::read_mesh(file.rsplit('/').next().unwrap_or_default(), view) {
        Ok((mesh, said)) => {
            let mut warnings = Diagnostics::new();
            said.into_iter().for_each(|complaint| warnings.push(complaint.warning(file)));
            let rounded = precision_warning::mesh(&mesh, ply::precision(view));
            rounded.into_iter().for_each(|complaint| warnings.push(complaint.warning(file)));
            Ok(Imported { meshes: vec![mesh], materials: Vec::new(), warnings })
        }
        Err(complaint) => {
            let mut errors = Diagnostics::from(complaint.error(file));
            attach_source(&mut errors, file, view);
            Err(errors)
        }
    }
}

fn open(path: &str, assets: &dyn Assets, from: &AssetPath, known: &[&str]) -> Result<OpenAsset, Diagnostics> {
    let extension = AssetPath::new(path, path, path).extension();
    if !known.contains(&extension.as_str()) {
        return Err(unsupported(path, &extension, known).into());
    }
    assets.open(path, from).map_err(|error| {
        let mut diagnostic = Diagnostic::error(path, error.to_string());
        diagnostic.help = error.help();
        diagnostic.into()
    })
}

fn unsupported(file: &str, extension: &str, known: &[&str]) -> Diagnostic {
    let name = match extension {
        "stl" => "STL",
        "gltf" | "glb" => "glTF",
        "fbx" => "FBX",
        "dae" => "COLLADA",
        "3ds" => "3DS",
        "usd" | "usda" | "usdc" | "usdz" => "USD",
        "blend" => "Blender's format",
        "off" => "OFF",
        "step" | "stp" => "STEP",
        "pbrt" => "pbrt's format",
        "" => "a file without an extension",
        other => &other.to_uppercase(),
    };
    Diagnostic::error(file, format!("{name} isn't supported yet")).help(format!("supported are {}", known.join(", ")))
}

/// The error of an open file that can't be read.
fn unreadable(error: &io::Error) -> ImportError {
    ImportError::file(format!("it can't be read: {}", reason(error)))
}

/// Adds the file's text if a message refers to it, so that messages show lines. Bytes that aren't UTF-8 become question
/// marks, which keeps the byte offsets.
fn attach_source(diagnostics: &mut Diagnostics, file: &str, view: View<'_>) {
    if !diagnostics.iter().any(|d| d.file == file && d.span.is_some()) {
        return;
    }
    // Without the text, messages have no line numbers.
    let Ok(bytes) = view.whole() else { return };
    let mut text = String::with_capacity(bytes.len());
    for chunk in bytes.utf8_chunks() {
        text.push_str(chunk.valid());
        text.extend(chunk.invalid().iter().map(|_| '?'));
    }
    diagnostics.add_source(file, text);
}

#[cfg(test)]
mod tests;
