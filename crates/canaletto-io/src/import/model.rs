//! A model as a source of scenes.

use super::load;
use crate::assets::{AssetPath, Assets};
use crate::diagnostic::Diagnostics;
use crate::source::{SceneSource, Timeline};
use crate::text::set_in_model;
use canaletto::scene::Scene;

/// A model file, which has one scene for all frames.
#[derive(Clone, Debug)]
pub struct Model {
    file: String,
    /// The overrides of its scene.
    set: Vec<String>,
    timeline: Timeline,
}

impl Model {
    /// The model of this file, which is read by [`SceneSource::scene`]. `set` holds overrides of its scene, as
    /// [`crate::text::read_scene_with`] takes them. They can change the camera, the film, the integrator, the
    /// background, the ambient light, materials and lights.
    pub fn new(file: &str, set: &[String]) -> Model {
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
        let (scene, mut warnings) = load(&self.file, assets)?;
        if self.set.is_empty() {
            return Ok((scene, warnings));
        }
        let (scene, more) = set_in_model(scene, &self.file, assets, &self.set)?;
        warnings.append(more);
        Ok((scene, warnings))
    }
}
