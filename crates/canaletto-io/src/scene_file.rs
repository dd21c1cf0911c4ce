//! Scene files: a scene text or a model, told apart by the extension of the file's name.

use crate::assets::{AssetPath, Assets};
use crate::diagnostic::Diagnostics;
use crate::import::{self, ModelFormat, Moment, Staging};
use crate::source::{SceneSource, Timeline};
use crate::text::{SceneDocument, set_in_model};
use canaletto::Named;
use canaletto::scene::{Integrator, PathSettings, Scene};

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

/// Opens a scene file. `set` holds overrides, as [`crate::text::read_scene_with`] takes them. `staging` is for models.
///
/// ```
/// use canaletto_io::assets::MemoryAssets;
/// use canaletto_io::import::Staging;
/// use canaletto_io::scene_file::open;
///
/// let assets = MemoryAssets::new().with("a.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n");
/// let mut source = open("a.obj", &assets, &["camera.fovy=20".to_owned()], &Staging::default())
///     .expect("OBJ is a known format");
/// let (scene, warnings) = source.scene(&assets, 0.0)?;
/// assert_eq!(scene.views[0].intrinsics.fovy, 20.0);
/// # Ok::<(), canaletto_io::diagnostic::Diagnostics>(())
/// ```
///
/// # Errors
/// [`OpenError`]. Mistakes that leave a part of the text are returned by [`SceneSource::scene`], as are those of
/// models.
pub fn open(
    file: &str,
    assets: &dyn Assets,
    set: &[String],
    staging: &Staging,
) -> Result<Box<dyn SceneSource>, OpenError> {
    let extension = AssetPath::new(file, file, file).extension();
    if extension == TEXT_EXTENSION {
        return match SceneDocument::read(file, assets, set) {
            Ok(document) => Ok(Box::new(document)),
            Err(mistakes) => Err(OpenError::Mistakes(mistakes)),
        };
    }
    match ModelFormat::of_extension(&extension) {
        None => Err(OpenError::UnknownFormat),
        Some(_) => Model::new(file, assets, set, staging)
            .map(|model| Box::new(model) as Box<dyn SceneSource>)
            .map_err(OpenError::Mistakes),
    }
}

/// A model file. Its scene changes with the frame if it plays a clip or turns, else it is one for all frames.
#[derive(Clone, Debug)]
struct Model {
    file: String,
    /// The overrides of its scene.
    set: Vec<String>,
    staging: Staging,
    /// The length of its clip in seconds from the moment of frame 0 on.
    length: Option<f64>,
    timeline: Timeline,
}

impl Model {
    /// The model of this file, which is read by [`SceneSource::scene`]. The overrides can change the camera, the film,
    /// the integrator, the background, the ambient light, materials and lights.
    fn new(file: &str, assets: &dyn Assets, set: &[String], staging: &Staging) -> Result<Model, Diagnostics> {
        // The last of several assignments counts.
        let named = set.iter().rev().find_map(|set| set.split_once('=').filter(|(key, _)| key.trim() == "integrator"));
        let is_classic = named
            .is_some_and(|(_, word)| word.trim().trim_matches('"') != Integrator::Path(PathSettings::DEFAULT).name());
        let mut staging = Staging { classic: staging.classic || is_classic, ..staging.clone() };
        let mut timeline = Timeline { seconds: true, ..Timeline::default() };
        let mut length = None;
        if let Some(moment) = staging.moment.clone().or_else(|| staging.plays.then(Moment::default)) {
            length = import::duration(file, assets, moment.clip.as_deref())?.map(|length| length - moment.seconds);
            timeline.moves = length.is_some_and(|length| length > 0.0);
            // Without clips a model that plays keeps its file's own pose.
            if length.is_some() {
                staging.moment = Some(moment);
            }
        }
        timeline.moves |= staging.turntable.is_some();
        let mut model = Model { file: file.to_owned(), set: set.to_vec(), staging, length, timeline };
        model.set_fps(Timeline::DEFAULT_FPS);
        Ok(model)
    }
}

impl SceneSource for Model {
    fn timeline(&self) -> &Timeline {
        &self.timeline
    }

    fn set_fps(&mut self, fps: f64) {
        self.timeline.fps = fps;
        let last = |length: f64| (length * fps).round().clamp(0.0, f64::from(u32::MAX)) as u32;
        self.timeline.frames = match self.staging.turntable {
            Some(frames) => Some([0, frames.max(1) - 1]),
            None => self.length.map(|length| [0, last(length)]),
        };
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

    fn scene(&mut self, assets: &dyn Assets, frame: f64) -> Result<(Scene, Diagnostics), Diagnostics> {
        let mut staging = self.staging.clone();
        if let Some(moment) = &mut staging.moment {
            moment.seconds += frame / self.timeline.fps;
        }
        if let Some(frames) = staging.turntable {
            staging.turn += 360.0 * frame / f64::from(frames.max(1));
        }
        let (scene, mut warnings) = import::load(&self.file, assets, &staging)?;
        if self.set.is_empty() {
            return Ok((scene, warnings));
        }
        let (scene, more) = set_in_model(scene, &self.file, assets, &self.set)?;
        warnings.append(more);
        Ok((scene, warnings))
    }
}
