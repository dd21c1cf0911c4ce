//! Scene files: a scene text or a model, told apart by the extension of the file's name.

use crate::assets::{AssetPath, Assets};
use crate::diagnostic::Diagnostics;
use crate::import::{self, ModelFormat};
use crate::source::{SceneSource, Timeline};
use crate::text::{SceneDocument, set_in_model};
use canaletto::scene::Scene;

/// The reasons why a source can't be opened.
#[derive(Debug)]
pub enum OpenError {
    /// The extension is that of neither a scene text nor a model.
    UnknownFormat,
    /// The text can't be parsed.
    Mistakes(Diagnostics),
}

/// The extension of scene texts.
const TEXT_EXTENSION: &str = "kdl";

/// Opens a scene file. `set` holds overrides, as [`crate::text::read_scene_with`] takes them.
///
/// ```
/// use canaletto_io::assets::MemoryAssets;
/// use canaletto_io::scene_file::open;
///
/// let assets = MemoryAssets::new().with("a.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n");
/// let mut source = open("a.obj", &assets, &["camera.fovy=20".to_owned()]).expect("OBJ is a known format");
/// let (scene, warnings) = source.scene(&assets, 0.0)?;
/// assert_eq!(scene.views[0].intrinsics.fovy, 20.0);
/// # Ok::<(), canaletto_io::diagnostic::Diagnostics>(())
/// ```
///
/// # Errors
/// [`OpenError`]. Mistakes that leave a part of the text are returned by [`SceneSource::scene`], as are those of
/// models.
pub fn open(file: &str, assets: &dyn Assets, set: &[String]) -> Result<Box<dyn SceneSource>, OpenError> {
    let extension = AssetPath::new(file, file, file).extension();
    if extension == TEXT_EXTENSION {
        return match SceneDocument::read(file, assets, set) {
            Ok(document) => Ok(Box::new(document)),
            Err(mistakes) => Err(OpenError::Mistakes(mistakes)),
        };
    }
    match ModelFormat::of_extension(&extension) {
        None => Err(OpenError::UnknownFormat),
        Some(_) => Ok(Box::new(Model::new(file, set))),
    }
}

/// A model file, which has one scene for all frames.
#[derive(Clone, Debug)]
struct Model {
    file: String,
    /// The overrides of its scene.
    set: Vec<String>,
    timeline: Timeline,
}

impl Model {
    /// The model of this file, which is read by [`SceneSource::scene`]. The overrides can change the camera, the film,
    /// the integrator, the background, the ambient light, materials and lights.
    fn new(file: &str, set: &[String]) -> Model {
        Model { file: file.to_owned(), set: set.to_vec(), timeline: Timeline::default() }
    }
}

impl SceneSource for Model {
    fn timeline(&self) -> &Timeline {
        &self.timeline
    }

    fn set_fps(&mut self, fps: f64) {
        self.timeline.fps = fps;
    }

    /// No format of models has a camera with a shutter.
    fn use_shutter_of(&mut self, _: &str) {}

    /// A model without a camera is never a reason for a warning.
    fn use_no_camera(&mut self) {}

    fn key_frames(&self) -> Vec<f64> {
        Vec::new()
    }

    /// The files that a model names are all read with it.
    fn texts(&self) -> Vec<(&str, &AssetPath)> {
        Vec::new()
    }

    fn scene(&mut self, assets: &dyn Assets, _: f64) -> Result<(Scene, Diagnostics), Diagnostics> {
        let (scene, mut warnings) = import::load(&self.file, assets)?;
        if self.set.is_empty() {
            return Ok((scene, warnings));
        }
        let (scene, more) = set_in_model(scene, &self.file, assets, &self.set)?;
        warnings.append(more);
        Ok((scene, warnings))
    }
}
