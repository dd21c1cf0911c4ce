//! A model as a source of scenes.

use super::load;
use crate::assets::{AssetPath, Assets};
use crate::diagnostic::Diagnostics;
use crate::source::{SceneSource, Timeline};
use canaletto::scene::Scene;

/// A model file, which has one scene for all frames.
#[derive(Clone, Debug)]
pub struct Model {
    file: String,
    timeline: Timeline,
}

impl Model {
    /// The model of this file. It is read by [`SceneSource::scene`].
    pub fn new(file: &str) -> Model {
        Model { file: file.to_owned(), timeline: Timeline::default() }
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

    fn key_frames(&self) -> Vec<f64> {
        Vec::new()
    }

    /// The files that a model names are all read with it.
    fn texts(&self) -> Vec<(&str, &AssetPath)> {
        Vec::new()
    }

    fn scene(&mut self, assets: &dyn Assets, _: f64) -> Result<(Scene, Diagnostics), Diagnostics> {
        load(&self.file, assets)
    }
}
