//! Import of models and of point clouds. [`FORMATS`] lists the formats of models.
//!
//! [`load`] makes a whole scene of one file. [`load_objects`] reads the models of `mesh file=…` in the scene text.
//! [`read_spheres`] and [`read_cylinders`] read the files of cloud nodes. Messages name the line or the element. Memory
//! is bounded by the file's size, whatever counts its header declares.

mod cloud;
mod color;
mod colormap;
mod concat;
mod draco;
mod encoding;
mod formats;
mod gltf;
mod ies;
mod ignored;
mod lines;
mod monotone;
mod mtl;
mod mtl_standard;
mod nff;
mod number;
mod obj;
mod ply;
mod polygon;
mod positions;
mod precision_warning;
mod reflectance;
mod repair;
mod smooth;
mod staging;
mod stl;
mod table_color;
mod text;
mod texture_map;

pub use cloud::{CloudFormat, CloudSettings, read_cylinders, read_spheres};
pub use colormap::{Colormap, ColumnColors};
pub use formats::{FORMATS, Holds, ModelFormat, foreign_format};
pub(crate) use gltf::pictures_in_gltf;
pub(crate) use ies::read_ies;
pub(crate) use positions::counted;
pub(crate) use precision_warning::inline_cloud;
pub(crate) use staging::{DEFAULT_SAMPLING, default_camera};
pub use staging::{Ground, Moment, PictureQuality, StageLight, Staging, StandardView, UpAxis};
pub(crate) use table_color::colors_of_rows;

use crate::assets::{AssetError, AssetPath, Assets, OpenAsset, check_name, reason};
use crate::content::View;
use crate::diagnostic::{Diagnostic, Diagnostics};
use canaletto::material::Material;
use canaletto::scene::{Content, Fragment, Node, Scene};
use canaletto::shape::Mesh;
use formats::{ReadFragment, sorted_extensions};
use glam::{DVec3, Vec3};
use lines::ImportError;
use std::io;

/// The file name extensions of the models that [`load`] reads, in alphabetical order.
pub fn extensions() -> Vec<&'static str> {
    sorted_extensions(FORMATS.iter())
}

/// Reads a model or a foreign scene, named by the user, as a whole scene. Models get what they lack of camera, light
/// and ground, as the staging says. The scene is returned with warnings.
///
/// # Errors
/// The mistakes in the file, or that its format isn't supported.
pub fn load(path: &str, assets: &dyn Assets, staging: &Staging) -> Result<(Scene, Diagnostics), Diagnostics> {
    let StagedFile { format, asset, fragment, warnings } = read_staged(path, assets, staging)?;
    let scene = match format.holds {
        Holds::Objects => staging::stage(fragment, format.up, staging).ok_or_else(|| {
            let wrong = "the model is too large to put a camera and lights around it";
            let help = "its coordinates may go up to about 1e37: scale it down in the program that made it";
            Diagnostic::error(asset.path.name(), wrong).help(help)
        })?,
        Holds::Scene => {
            let mut scene = Scene::default();
            scene.append(fragment);
            scene
        }
    };
    Ok((scene, warnings))
}

/// The box that a model fills at the moment of the staging, before its turn. `None` for foreign scenes, and if nothing
/// has bounds.
///
/// # Errors
/// As [`load`].
pub(crate) fn extent(path: &str, assets: &dyn Assets, staging: &Staging) -> Result<Option<[DVec3; 2]>, Diagnostics> {
    let StagedFile { format, fragment, .. } = read_staged(path, assets, staging)?;
    Ok(match format.holds {
        Holds::Objects => staging::extent(fragment, format.up, staging),
        Holds::Scene => None,
    })
}

/// A file that was read for staging.
struct StagedFile {
    format: &'static ModelFormat,
    asset: OpenAsset,
    fragment: Fragment,
    warnings: Diagnostics,
}

fn read_staged(path: &str, assets: &dyn Assets, staging: &Staging) -> Result<StagedFile, Diagnostics> {
    let (format, asset) = open(path, assets, &AssetPath::base(), |_| true)?;
    let (moment, variant) = (staging.moment.clone(), staging.variant.clone());
    let options = ReadOptions { unsaid: DefaultShading::Creases, moment, variant };
    let (fragment, warnings) = read(format, &asset, assets, &options)?;
    Ok(StagedFile { format, asset, fragment, warnings })
}

/// Reads the objects of a model that the file `from` names. They are returned with warnings about parts of the model
/// that were left out.
///
/// # Errors
/// The mistakes in the file, or that its format isn't supported. If it can't be opened, the message is about the whole
/// file.
pub fn load_objects(path: &str, assets: &dyn Assets, from: &AssetPath) -> Result<(Fragment, Diagnostics), Diagnostics> {
    let (format, asset) = open(path, assets, from, |format| format.holds == Holds::Objects)?;
    read(format, &asset, assets, &ReadOptions { unsaid: DefaultShading::Flat, moment: None, variant: None })
}

/// The length in seconds of a model's clip of this name, or of its first one; none if nothing of it is animated.
///
/// # Errors
/// The mistakes in the file, or that there is no such clip.
pub fn duration(path: &str, assets: &dyn Assets, clip: Option<&str>) -> Result<Option<f64>, Diagnostics> {
    let (format, asset) = open(path, assets, &AssetPath::base(), |_| true)?;
    format.duration.map_or(Ok(None), |duration| duration(&asset, assets, clip))
}

/// How a model is read.
#[derive(Clone, Debug)]
struct ReadOptions {
    unsaid: DefaultShading,
    /// The moment of an animation; none for the file's own pose.
    moment: Option<Moment>,
    /// The name of the variant of the materials.
    variant: Option<String>,
}

/// The shading of surfaces for which a file declares neither flat nor smooth normals.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum DefaultShading {
    Flat,
    /// Smooth except at creases.
    Creases,
}

fn read(format: &ModelFormat, asset: &OpenAsset, assets: &dyn Assets, options: &ReadOptions) -> ReadFragment {
    let lacks = [("animation", options.moment.is_some()), ("variants", options.variant.is_some())];
    if let Some((what, _)) = lacks.iter().find(|(_, is_asked)| *is_asked && format.duration.is_none()) {
        return Err(Diagnostic::error(asset.path.name(), format!("{} has no {what}", format.name)).into());
    }
    let (fragment, mut told) = (format.read)(asset, assets, options)?;
    let has_size = |node: &Node| !matches!(node.content, Content::Mesh(_) | Content::Light(_));
    let is_seen = || fragment.meshes.iter().any(has_area) || fragment.nodes.iter().any(has_size);
    if format.holds == Holds::Scene || is_seen() {
        return Ok((fragment, told));
    }
    let count: usize = fragment.meshes.iter().map(Mesh::len).sum();
    let wrong = format!("nothing in it has an area: {count} triangles, whose corners lie on a line or at one place");
    told.push(ImportError::file(wrong).error(asset.path.name()));
    Err(told)
}

/// The fragment of these meshes: a node for each, with its name.
fn fragment_of(meshes: Vec<Mesh>, materials: Vec<Material>) -> Fragment {
    let node = |(index, mesh): (usize, &Mesh)| {
        let name = Some(mesh.name.as_str()).filter(|name| !name.is_empty());
        Node { name: name.map(Into::into), ..Node::new(Content::Mesh(index as u32)) }
    };
    let nodes = meshes.iter().enumerate().map(node).collect();
    Fragment { materials, meshes, nodes, ..Fragment::default() }
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

fn open(
    path: &str,
    assets: &dyn Assets,
    from: &AssetPath,
    is_wanted: fn(&ModelFormat) -> bool,
) -> Result<(&'static ModelFormat, OpenAsset), Diagnostics> {
    let refused = |error: AssetError, name: &str| {
        let mut diagnostic = Diagnostic::error(name, error.to_string());
        diagnostic.help = error.help();
        diagnostic
    };
    // The name is shown as it is from here on.
    if let Err(error) = check_name(path) {
        return Err(refused(error, "").into());
    }
    let extension = AssetPath::new(path, path, path).extension();
    let format = ModelFormat::of_extension(&extension);
    let Some(wanted) = format.filter(|format| is_wanted(format)) else {
        let known = sorted_extensions(FORMATS.iter().filter(|format| is_wanted(format)));
        return Err(unsupported(path, format, &extension, &known).into());
    };
    let asset = assets.open(path, from).map_err(|error| refused(error, path))?;
    Ok((wanted, asset))
}

fn unsupported(file: &str, format: Option<&ModelFormat>, extension: &str, known: &[&str]) -> Diagnostic {
    let foreign = foreign_format(extension);
    let upper = extension.to_uppercase();
    let name = match (format, foreign) {
        (Some(format), _) => format.name,
        (None, Some((name, _))) => name,
        (None, None) if extension.is_empty() => {
            let message = "it has no extension, which tells the format";
            return Diagnostic::error(file, message).help(format!("supported are {}", known.join(", ")));
        }
        (None, None) => &upper,
    };
    let convert = foreign.map_or(String::new(), |(_, program)| format!("; {program} converts it to OBJ or PLY"));
    let help = format!("supported are {}{convert}", known.join(", "));
    Diagnostic::error(file, format!("{name} isn't supported yet")).help(help)
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
