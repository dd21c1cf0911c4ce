//! The scene text: KDL 2 to [`Scene`].
//!
//! The way of a text: `files` reads it and what it includes, `syntax` makes nodes of it, `set` changes their
//! values, `decode` judges them by `schema` and builds the scene. Each of them reports every mistake and goes on.

mod decode;
mod files;
mod nearest;
mod reference;
mod report;
mod schema;
mod set;
mod syntax;

pub use nearest::nearest;
pub use reference::reference_markdown;

use crate::assets::{AssetPath, Assets};
use crate::diagnostic::{Diagnostic, Diagnostics};
use canaletto::scene::Scene;
use files::Loader;

/// Reads the scene of a file.
///
/// # Errors
/// Every mistake in it and the files that it names.
pub fn read_scene(name: &str, assets: &dyn Assets) -> Result<(Scene, Diagnostics), Diagnostics> {
    read_scene_with(name, assets, &[])
}

/// Reads the scene of a file after changing values in it: `set` holds assignments such as `integrator.max-depth=3`,
/// `material.glass.eta=1.4` or `film.sample="jittered" n=4`. Messages about them name the file `--set`, and the n-th
/// line for the n-th assignment. With the scene come warnings.
///
/// # Errors
/// Every mistake in it and the files that it names.
pub fn read_scene_with(name: &str, assets: &dyn Assets, set: &[String]) -> Result<(Scene, Diagnostics), Diagnostics> {
    let asset = assets.read(name, &AssetPath::base()).map_err(|error| {
        let mut diagnostic = Diagnostic::error(name, error.to_string());
        diagnostic.help = error.help();
        diagnostic
    })?;
    let mut loader = Loader::new(assets);
    let nodes = loader.load(asset, None);
    finish(loader, nodes, set)
}

/// Reads the scene of a text; `name` is what to call it. Files that it names are read from the root of `assets`.
///
/// # Errors
/// Every mistake in it and the files that it names.
pub fn read_scene_text(
    text: &str,
    name: &str,
    assets: &dyn Assets,
    set: &[String],
) -> Result<(Scene, Diagnostics), Diagnostics> {
    let mut loader = Loader::new(assets);
    if text.len() > files::MAX_TEXT {
        return Err(Diagnostic::error(name, format!("the text is more than {} MiB", files::MAX_TEXT >> 20)).into());
    }
    let file = loader.files.add(name.to_owned(), AssetPath::new("", name, name), text.into());
    let nodes = loader.load_text(text, file);
    finish(loader, nodes, set)
}

fn finish(loader: Loader, mut nodes: Vec<syntax::Node>, set: &[String]) -> Result<(Scene, Diagnostics), Diagnostics> {
    let Loader { assets, mut files, mut report, .. } = loader;
    // After a mistake in the syntax only what could be read is judged, so a block that is still open says nothing.
    if nodes.is_empty() && report.has_errors() {
        return Err(report.finish(&files));
    }
    set::apply_set(&mut nodes, set, &mut files, &mut report);
    let (scene, report) = decode::decode(&nodes, &files, assets, report);
    let failed = report.has_errors();
    let diagnostics = report.finish(&files);
    match scene {
        Some(scene) if !failed => Ok((scene, diagnostics)),
        _ => Err(diagnostics),
    }
}
