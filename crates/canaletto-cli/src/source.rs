//! From the name of a scene or model to its description and its world.

use crate::exit::Exit;
use crate::failure::{Failure, plural, reason};
use crate::flags::SourceFlags;
use canaletto::scene::Scene;
use canaletto::world::{BuildError, World};
use canaletto_io::assets::{Asset, AssetError, AssetPath, Assets, FolderAssets};
use canaletto_io::diagnostic::{Diagnostic, Diagnostics};
use canaletto_io::text::nearest;
use canaletto_io::{import, text};
use serde::Serialize;
use std::io;
use std::path::Path;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// A scene as read, before anything is built.
pub(crate) struct Source {
    /// The file's name as the user wrote it.
    pub name: String,
    /// What it describes.
    pub scene: Scene,
    /// Doubts about it.
    pub warnings: Diagnostics,
    /// Every file that was read for it, in the order of reading.
    pub files: Vec<UsedFile>,
    /// How long reading took.
    pub time: Duration,
}

/// A file that a scene is made of.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct UsedFile {
    /// Its name as shown in messages.
    pub file: String,
    /// Its size.
    pub bytes: u64,
}

impl Source {
    /// Reads a scene or model.
    pub(crate) fn read(flags: &SourceFlags) -> Result<Source, Failure> {
        Source::read_file(&flags.scene, &flags.set, flags.allow_outside)
    }

    /// Reads a file with changes to its values.
    pub(crate) fn read_file(path: &Path, set: &[String], allow_outside: bool) -> Result<Source, Failure> {
        let start = Instant::now();
        let name = path.to_string_lossy().into_owned();
        if let Err(e) = path.metadata() {
            return Err(missing(path, &e));
        }
        let (assets, file) = FolderAssets::beside(path)
            .map_err(|e| Failure::new(Exit::Scene, format!("can't open {name}: {}", reason(&e))))?;
        let assets = Recording { inner: assets.allow_outside(allow_outside), files: Mutex::default() };
        let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
        let (scene, warnings) = if extension == "kdl" {
            text::read_scene_with(&file, &assets, set)?
        } else if import::SCENE_EXTENSIONS.contains(&extension.as_str()) {
            if let [first, ..] = set {
                return Err(Failure::usage(format!(
                    "--set {first}: only scenes in Canaletto's own text have values to set"
                ))
                .help(format!("write a scene with `mesh file=\"{file}\"` in it")));
            }
            import::load(&file, &assets)?
        } else {
            return Err(Failure::new(Exit::Scene, format!("\"{name}\" isn't a scene or model that can be read"))
                .help(format!("scenes end in .kdl, models in .{}", import::SCENE_EXTENSIONS.join(", ."))));
        };
        let files = assets.files.into_inner().unwrap_or_else(PoisonError::into_inner);
        Ok(Source { name, scene, warnings, files, time: start.elapsed() })
    }
}

/// A file that the user named and that isn't there, with the one that is probably meant.
fn missing(path: &Path, error: &io::Error) -> Failure {
    let failure = Failure::new(Exit::Scene, format!("can't open {}: {}", path.display(), reason(error)));
    if path == Path::new("-") {
        return failure
            .help("scenes are read from files, not from the standard input: files beside them are looked up there");
    }
    if let Ok(target) = path.read_link() {
        return failure.help(format!("it is a link to {}, which isn't there", target.display()));
    }
    let folder = match path.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    };
    if error.kind() != io::ErrorKind::NotFound {
        return failure;
    }
    let Ok(entries) = folder.read_dir() else {
        return failure.help(format!("there is no folder {}", folder.display()));
    };
    let names: Vec<String> = entries.filter_map(|entry| entry.ok()?.file_name().into_string().ok()).collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    match path.file_name().and_then(|name| nearest(name.to_str()?, names)) {
        Some(near) => failure.help(format!("did you mean {}?", path.with_file_name(near).display())),
        None => failure,
    }
}

/// Builds a scene's world; `name` is its file's.
pub(crate) fn build(name: &str, scene: Scene) -> Result<(World, Duration), Failure> {
    let start = Instant::now();
    let world = World::build(scene).map_err(|e| {
        let diagnostic = Diagnostic::error(name, e.to_string());
        Diagnostics::from(match advice(&e) {
            Some(advice) => diagnostic.help(advice),
            None => diagnostic,
        })
    })?;
    Ok((world, start.elapsed()))
}

/// What to do about a scene that can't be built.
fn advice(error: &BuildError) -> Option<&'static str> {
    Some(match error {
        BuildError::TooManyInstances => {
            "instances of instances multiply; a cloud (spheres, cylinders) or a mesh holds many more things in less memory"
        }
        BuildError::TooManyLights => "each point of light costs a shadow ray wherever something is seen: take fewer",
        BuildError::TooManyPlanes => "every ray meets every plane; boxes and triangles have an end and cost far less",
        BuildError::TooDeep => "groups and instances count, through all prototypes; put some side by side",
        BuildError::Invalid { problem, .. } if problem.contains("transforms") => {
            "transforms of an object, of its groups and of instances multiply: look at the scale and translate around it"
        }
        BuildError::Invalid { object, .. } if object.contains(" #") => {
            "objects without a name are called by kind and number, in the order of the file; give it a name=\"…\" to find it"
        }
        _ => return None,
    })
}

/// Runs `work` on as many threads as the user wants.
pub(crate) fn on_threads<T: Send>(threads: Option<u16>, work: impl FnOnce() -> T + Send) -> Result<T, Failure> {
    let threads = threads.map_or(0, usize::from);
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .thread_name(|index| format!("canaletto-{index}"))
        .stack_size(STACK)
        .build()
        .map_err(|e| {
            Failure::new(Exit::Failed, format!("can't start {}: {}", plural(threads, "thread"), reason(&e)))
        })?;
    Ok(pool.install(work))
}

/// Room for rays of depth 256 and groups as deep as a world allows.
const STACK: usize = 16 << 20;

/// Remembers what is read.
struct Recording {
    inner: FolderAssets,
    files: Mutex<Vec<UsedFile>>,
}

impl Assets for Recording {
    fn read(&self, path: &str, from: &AssetPath) -> Result<Asset, AssetError> {
        let asset = self.inner.read(path, from)?;
        let mut files = self.files.lock().unwrap_or_else(PoisonError::into_inner);
        if !files.iter().any(|used| used.file == asset.path.name()) {
            files.push(UsedFile { file: asset.path.name().to_owned(), bytes: asset.bytes.len() as u64 });
        }
        Ok(asset)
    }
}
