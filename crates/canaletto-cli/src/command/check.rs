//! `canaletto check`: reports mistakes and renders nothing.

use crate::doubts::{doubt_meshes, doubt_picture};
use crate::exit::Exit;
use crate::failure::{Failure, plural, print_diagnostics};
use crate::flags::PictureFlags;
use crate::format::JSON_VERSION;
use crate::frames::Frames;
use crate::omissions::{doubt_omissions, doubt_ray_trees};
use crate::settings::Settings;
use crate::source::{Reader, build};
use crate::stdout::{print, print_json};
use crate::watch::ReadLog;
use canaletto::render::Job;
use canaletto::scene::{CameraProjection, Scene, View};
use canaletto::world::{BuildOptions, World};
use canaletto_io::diagnostic::{Diagnostic, Diagnostics};
use canaletto_io::import::Staging;
use clap::Args;
use serde_json::json;
use std::collections::HashSet;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Checks scenes and models: reads and builds them, and prints all their mistakes.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct CheckFlags {
    /// The files to check
    #[arg(value_name = "SCENE", required = true)]
    pub scenes: Vec<PathBuf>,

    /// Lets scenes read files outside their own folder
    #[arg(long, help_heading = "Scene")]
    pub allow_outside: bool,

    /// Checks this frame only [default: all frames of a scene that moves]
    #[arg(long, value_name = "N", help_heading = "Scene")]
    pub frame: Option<u32>,

    /// Treats warnings as errors
    #[arg(long, help_heading = "Messages")]
    pub strict: bool,

    /// Prints JSON with the mistakes of each file
    #[arg(long, help_heading = "Messages")]
    pub json: bool,

    /// Prints mistakes only; files without mistakes print nothing
    #[arg(short, long, help_heading = "Messages")]
    pub quiet: bool,
}

const EXAMPLES: &str = "\
Examples:
  canaletto check scenes/*.kdl
  canaletto check scenes/path.kdl --json | jq '.files[].diagnostics[].message'";

/// Runs the command.
pub(crate) fn run(flags: &CheckFlags) -> Result<Exit, Failure> {
    let mut all_well = true;
    let mut results = Vec::new();
    for path in &flags.scenes {
        let (found, failure) = match check(path, flags.allow_outside, flags.frame) {
            Ok(warnings) => (warnings, None),
            Err(Failure::Diagnostics(errors)) => (errors, None),
            Err(other) => (Diagnostics::new(), Some(other)),
        };
        let wrong = failure.is_some() || found.has_errors() || (flags.strict && !found.is_empty());
        all_well &= !wrong;
        let message = match &failure {
            Some(Failure::Message { message, .. }) => Some(message.clone()),
            _ => None,
        };
        if flags.json {
            results.push(json!({ "file": path, "ok": !wrong, "message": message, "diagnostics": found }));
            continue;
        }
        print_diagnostics(&found, false);
        if let Some(failure) = &failure {
            failure.print(false);
        }
        if !flags.quiet {
            print(&format!("{}: {}\n", path.display(), summary(&found, failure.is_some())))?;
        }
    }
    if flags.json {
        print_json(&json!({ "version": JSON_VERSION, "files": results }))?;
    }
    Ok(if all_well { Exit::Done } else { Exit::Scene })
}

fn summary(found: &Diagnostics, failed: bool) -> String {
    match (found.errors() + usize::from(failed), found.warnings()) {
        (0, 0) => "ok".into(),
        (0, warnings) => format!("ok, {}", plural(warnings, "warning")),
        (errors, 0) => plural(errors, "error"),
        (errors, warnings) => format!("{}, {}", plural(errors, "error"), plural(warnings, "warning")),
    }
}

/// Finds everything that `render` would find, for every camera, at one frame or at all frames. Worlds are built at the
/// frames next to keys; these represent the frames between.
fn check(path: &Path, allow_outside: bool, frame: Option<u32>) -> Result<Diagnostics, Failure> {
    let mut reader = Reader::open_file(path, &[], &Staging::default(), allow_outside, &ReadLog::default())?;
    let (name, moves) = (reader.name.clone(), reader.timeline().moves);
    let frames = frame.map_or_else(|| all_frames(&reader), |frame| Ok(Frames::one(frame)))?;
    let built = frames.next_to(&reader.key_frames());
    let mut found = Found::default();
    let mut stillness = FrozenRuns::default();
    let shown = if moves { frames } else { Frames::one(frames.first) };
    for frame in shown.iter() {
        let at = |failure: Failure| if moves { failure.at_frame(frame) } else { failure };
        let source = reader.at(frame).map_err(at)?;
        found.add(source.warnings);
        let jobs = jobs(&name, &source.scene).map_err(at)?;
        source.scene.views.iter().for_each(|view| found.add(doubt_degrees(&name, view)));
        if shown.count() > 1 {
            stillness.look(frame, &source.scene);
        }
        if built.contains(&frame) {
            found.add(doubt_meshes(&name, &source.scene));
            let (world, _) = build(&name, source.scene, &BuildOptions::default(), None).map_err(at)?;
            for (camera, job) in &jobs {
                let refused = refusal(&name, &world, job);
                if refused.is_empty() {
                    found.add(doubt_picture(&name, Some(camera).filter(|_| jobs.len() > 1), &world, job));
                }
                found.add(refused);
                found.add(doubt_omissions(&name, &world, job));
                found.add(doubt_ray_trees(&name, &world, job));
            }
        }
    }
    if frame.is_none() && reader.timeline().frames.is_some() && frames.count() > 1 {
        found.add(stillness.doubts(&name, frames, reader.timeline().fps, moves));
    }
    Ok(found.diagnostics)
}

/// The reason why `render` would refuse a job.
fn refusal(name: &str, world: &World, job: &Job) -> Diagnostics {
    match canaletto::render::check(world, job) {
        Ok(()) => Diagnostics::new(),
        Err(problem) => Diagnostic::error(name, problem.to_string()).into(),
    }
}

/// The frames of the scene's animation, or else all frames from its first to its last key.
fn all_frames(reader: &Reader) -> Result<Frames, Failure> {
    let wrong = |e: String| Failure::new(Exit::Scene, format!("{}: animation: {e}", reader.name));
    if let Some([first, last]) = reader.timeline().frames {
        return Frames::new(first, last, 1).map_err(wrong);
    }
    let (keys, own) = (reader.key_frames(), reader.first_frame());
    let first = keys.iter().map(|key| key.max(0.0).floor() as u32).fold(own, u32::min);
    let last = keys.iter().map(|key| key.max(0.0).ceil() as u32).fold(own, u32::max);
    Frames::new(first, last, 1).or_else(|_| Frames::new(first, last, (last - first) / 1000)).map_err(wrong)
}

/// The job of `render` without flags, for each camera, with the camera's name.
fn jobs(name: &str, scene: &Scene) -> Result<Vec<(String, Job)>, Failure> {
    let job = |camera: Option<&View>| {
        let flags = PictureFlags { camera: camera.map(|view| view.name.clone()), ..PictureFlags::default() };
        let settings = Settings::new(name, scene, &flags)?;
        settings.check_pixels()?;
        Ok((settings.camera, settings.job))
    };
    if scene.views.is_empty() { Ok(vec![job(None)?]) } else { scene.views.iter().map(|view| job(Some(view))).collect() }
}

/// Values of `fovy` that were probably meant in radians: there they are 29 to 138 degrees. A smaller value may be the
/// angle of a telescope.
const RADIANS: Range<f64> = 0.5..2.4;

/// A warning about a camera whose angle of view was probably meant in radians.
fn doubt_degrees(name: &str, view: &View) -> Diagnostics {
    let fovy = view.intrinsics.fovy;
    if view.intrinsics.projection != CameraProjection::Perspective || !RADIANS.contains(&fovy) {
        return Diagnostics::new();
    }
    let camera = &view.name;
    let message = format!(
        "camera \"{camera}\": fovy is {fovy} degrees, which shows very little; it looks like an angle in radians"
    );
    let help = format!("in degrees that is {}", (fovy.to_degrees() * 10.0).round() / 10.0);
    Diagnostic::warning(name, message).help(help).into()
}

/// Messages, each once, however many frames have it.
#[derive(Default)]
struct Found {
    diagnostics: Diagnostics,
    known: HashSet<(String, Option<Range<usize>>, String)>,
}

impl Found {
    fn add(&mut self, mut more: Diagnostics) {
        more.retain(|d| self.known.insert((d.file.clone(), d.span.clone(), d.message.clone())));
        self.diagnostics.append(more);
    }
}

/// Finds runs of frames that show what their previous frame shows.
#[derive(Default)]
struct FrozenRuns {
    last: Option<Scene>,
    /// The first and the last frame of each run of equal frames.
    runs: Vec<[u32; 2]>,
}

impl FrozenRuns {
    fn look(&mut self, frame: u32, scene: &Scene) {
        match self.runs.last_mut() {
            Some([_, last]) if self.last.as_ref() == Some(scene) => *last = frame,
            _ => {
                self.runs.push([frame, frame]);
                self.last = Some(scene.clone());
            }
        }
    }

    /// Warnings about runs that last a second or more, or half of all frames.
    fn doubts(self, name: &str, frames: Frames, fps: f64, moves: bool) -> Diagnostics {
        let mut all = Diagnostics::new();
        if !moves || self.runs.len() == 1 {
            return frames.all_the_same(name, moves).into();
        }
        let long = |run: &&[u32; 2]| {
            let count = f64::from(run[1] - run[0]) + 1.0;
            count > 1.0 && (count >= fps || count * 2.0 >= frames.count() as f64)
        };
        for [first, last] in self.runs.iter().filter(long) {
            all.push(Diagnostic::warning(name, format!("nothing moves from frame {first} to frame {last}")));
        }
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The output for a scene: one message per line, or the failure.
    fn told(scene: &str) -> String {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("s.kdl");
        std::fs::write(&path, scene).unwrap();
        let lines = |all: &Diagnostics| all.iter().map(|d| format!("{}\n", d.message)).collect();
        match check(&path, false, None) {
            Ok(warnings) => lines(&warnings),
            Err(Failure::Diagnostics(errors)) => lines(&errors),
            Err(Failure::Message { message, .. }) => message,
            Err(Failure::Reported(_)) => String::new(),
        }
    }

    const BALL: &str = "sphere { center 0 0 0; radius 1 }\n";
    const LAMP: &str = "light \"omni\" { position 5 5 5 }\n";

    #[test]
    fn pictures_without_anything_in_them() {
        let camera = |words: &str| told(&format!("camera {{ {words}; size 64 48 }}\n{LAMP}{BALL}"));
        assert_eq!(camera("eye 0 0 9"), "");
        let behind = "the picture will be empty: everything lies behind the eye, which looks along 0 0 1\n";
        assert_eq!(camera("eye 0 0 9; center 0 0 20"), behind);
        assert!(
            camera("eye 0 0 9; center 9 0 0")
                .contains("no camera ray meets anything; the eye looks along 0.707107 0 -0.707107")
        );
        assert!(camera("eye 0 0 0; center 0 0 20").contains("the eye is inside sphere #1"));
        assert!(camera("eye 0 0 9; fovy 1.05").contains("looks like an angle in radians"));
        assert_eq!(camera("eye 0 0 9; orthographic 1.05"), "");
        // All of a window of 1 starts in the ball, and a part of a window of 30 doesn't.
        let inside = "the eye is inside sphere #1";
        assert!(camera("eye 0 0 0; center 0 0 20; orthographic 1").contains(inside));
        assert!(!camera("eye 0 0 0; center 0 0 20; orthographic 30").contains(inside));
    }

    #[test]
    fn rays_that_branch_a_thousand_times_are_told() {
        let balls = "repeat x=3 y=3 z=3 { sphere material=\"m\" { center x y z; radius 0.9 } }\n";
        let told = |coverage: &str| {
            let material = format!("material \"m\" {{ k 0.9; {coverage} }}\n");
            told(&format!("camera {{ eye 1 1 9; fovy 20; size 64 48 }}\n{LAMP}{material}{balls}"))
        };
        let many = told("coverage 0.5");
        assert!(many.starts_with("this picture takes long: a camera ray branches into "), "{many}");
        assert_eq!(told(""), "");
    }

    #[test]
    fn a_scene_without_a_camera_is_seen_as_a_model() {
        let told = told(&format!("{LAMP}{BALL}"));
        assert!(told.starts_with("the scene has no camera") && told.lines().count() == 1, "{told}");
        let empty = super::tests::told(LAMP);
        assert!(empty.contains("has no camera"), "as render: {empty}");
    }

    #[test]
    fn all_frames_are_looked_at() {
        let moving = |light: &str| {
            told(&format!("animation {{ frames 1 9 }}\ncamera {{ eye 0 0 9; size 64 48 }}\n{light}\n{BALL}"))
        };
        // At frame 5, between two keys, the light is at its own target.
        let spot = "light \"spot\" { position { key 1 0 5 0; key 9 4 5 0; ease \"linear\" }; target 2 5 0; outer 30 }";
        let told = moving(spot);
        assert!(told.contains("the cone needs an axis (at frame 5)"), "{told}");
        let omni = |keys: &str| moving(&format!("light \"omni\" {{ position {keys} }}"));
        assert_eq!(omni("{ key 1 0 5 9; key 9 4 5 9 }"), "");
        assert!(omni("0 5 9").contains("frames 1-9 all show the same: nothing in the scene has keys"));
        assert!(omni("{ key 1 0 5 9; key 9 0 5 9 }").contains("no key changes anything"));
        assert_eq!(omni("{ key 1 0 5 9; key 3 4 5 9 }"), "nothing moves from frame 3 to frame 9\n");
    }
}
