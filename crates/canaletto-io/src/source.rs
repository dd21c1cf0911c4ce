//! What a scene comes from, at any frame.

use crate::assets::{AssetPath, Assets};
use crate::diagnostic::Diagnostics;
use canaletto::scene::Scene;

/// A source of scenes, one for every frame. What doesn't move has the same scene at each of them.
pub trait SceneSource: Send {
    /// The frame rate, the range of frames, and whether anything moves.
    fn timeline(&self) -> &Timeline;

    /// Sets the frame rate in frames per second, which must lie in [`Timeline::FPS`].
    fn set_fps(&mut self, fps: f64);

    /// Selects the camera whose shutter interval determines motion blur. The default is the first camera.
    fn use_shutter_of(&mut self, camera: &str);

    /// Says that no camera is used. A scene without one is then no reason for a warning.
    fn use_no_camera(&mut self);

    /// The times of all keys in frames, sorted. Between two of them every value is between those of its keys, or a
    /// little beyond.
    fn key_frames(&self) -> Vec<f64>;

    /// Texts that may name a file, each with the file that contains it. All files that are read at any frame are among
    /// them, except the first.
    fn texts(&self) -> Vec<(&str, &AssetPath)>;

    /// Reads the scene at a frame, which may be fractional, and returns it with its warnings.
    ///
    /// # Errors
    /// Every mistake in the source and in the files that it names.
    fn scene(&mut self, assets: &dyn Assets, frame: f64) -> Result<(Scene, Diagnostics), Diagnostics>;

    /// The default frame: the first of the animation, else 0.
    fn first_frame(&self) -> u32 {
        self.timeline().frames.map_or(0, |[first, _]| first)
    }
}

/// The time settings of a source.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Timeline {
    /// The frame rate in frames per second.
    pub fps: f64,
    /// The first and the last frame, if the source defines them.
    pub frames: Option<[u32; 2]>,
    /// Whether key times are in seconds, with frame 0 at second 0; otherwise they are in frames.
    pub seconds: bool,
    /// Whether any value changes with time.
    pub moves: bool,
}

impl Timeline {
    /// The range of [`Timeline::fps`].
    pub const FPS: std::ops::RangeInclusive<f64> = 0.01..=1000.0;

    /// The default frame rate in frames per second.
    pub const DEFAULT_FPS: f64 = 25.0;

    /// The time of a frame in the units of keys.
    pub(crate) fn time(&self, frame: f64) -> f64 {
        if self.seconds { frame / self.fps } else { frame }
    }

    /// The frame of a time in the units of keys.
    pub(crate) fn frame(&self, time: f64) -> f64 {
        if self.seconds { time * self.fps } else { time }
    }
}

impl Default for Timeline {
    fn default() -> Timeline {
        Timeline { fps: Timeline::DEFAULT_FPS, frames: None, seconds: false, moves: false }
    }
}
