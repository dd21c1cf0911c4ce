//! The scene text: KDL 2 to [`Scene`].
//!
//! The stages: `files` reads a text and its includes, and `syntax` parses it into nodes. `overrides` applies
//! assignments to their values, `arithmetic` replaces expressions by numbers, and `animate` evaluates keys and paths
//! for a frame. `decode` validates the nodes against `schema` and builds the scene. Each stage reports every mistake
//! and continues.
//!
//! The files use each other in a circle. A table of `nodes` holds the readers of its node, which `decode` calls. A
//! reader calls `decode` for the nodes within its node. Words of these tables guide all stages before.

mod animate;
mod arithmetic;
mod decode;
mod file_cache;
mod files;
mod model_settings;
mod nodes;
mod overrides;
mod reader;
mod reference;
mod report;
mod schema;
mod suggest;
mod syntax;
mod validate;

pub use arithmetic::color;
pub use files::MAX_TEXT;
pub(crate) use model_settings::set_in_model;
pub use reference::reference_markdown;

use crate::assets::{AssetPath, Assets};
use crate::diagnostic::{Diagnostic, Diagnostics};
use crate::import;
use crate::source::{SceneSource, Timeline};
use canaletto::scene::{Scene, View};
use file_cache::FrameCache;
use files::{Files, Loader};
use nodes::{CAMERA, MATERIAL, NAME, OF, PATH};
use overrides::Settable;
use report::{Message, Report};

/// Reads the scene of a file.
///
/// # Errors
/// Every mistake in the text and in the files that it names.
pub fn read_scene(name: &str, assets: &dyn Assets) -> Result<(Scene, Diagnostics), Diagnostics> {
    read_scene_with(name, assets, &[])
}

/// Reads the scene of a file after applying overrides, and returns it with its warnings. `set` holds assignments such
/// as `integrator.max-depth=3`, `material.glass.eta=1.4`, `integrator=zbuffer` or `film.sample="jittered" n=4`.
/// Messages about the n-th assignment name line n of the file `--set`. Animated values are those of the first frame.
///
/// # Errors
/// Every mistake in the text and in the files that it names.
pub fn read_scene_with(name: &str, assets: &dyn Assets, set: &[String]) -> Result<(Scene, Diagnostics), Diagnostics> {
    SceneDocument::read(name, assets, set)?.once(assets)
}

/// Reads the scene of a text; `name` is its display name. Files that it names are read relative to the root of
/// `assets`.
///
/// ```
/// use canaletto_io::assets::MemoryAssets;
/// use canaletto_io::text::read_scene_text;
///
/// let text = "sphere { center 0 0 0; radius 1 }\nlight \"omni\" { position 5 5 5 }";
/// let (scene, warnings) = read_scene_text(text, "ball.kdl", &MemoryAssets::new(), &[])?;
/// assert_eq!(scene.nodes.len(), 2);
/// let mistakes = read_scene_text("spere { radius 1 }", "ball.kdl", &MemoryAssets::new(), &[]).unwrap_err();
/// assert!(mistakes.to_string().contains("did you mean sphere?"));
/// # Ok::<(), canaletto_io::diagnostic::Diagnostics>(())
/// ```
///
/// # Errors
/// Every mistake in the text and in the files that it names.
pub fn read_scene_text(
    text: &str,
    name: &str,
    assets: &dyn Assets,
    set: &[String],
) -> Result<(Scene, Diagnostics), Diagnostics> {
    SceneDocument::of_text(text, name, assets, set)?.once(assets)
}

/// A parsed scene text, from which the scene of every frame can be decoded.
pub struct SceneDocument {
    nodes: Vec<syntax::Node>,
    files: Files,
    /// The named numbers of the scene.
    numbers: Vec<f64>,
    /// The messages about the text that don't depend on the frame.
    report: Report,
    timeline: Timeline,
    /// Whether any node must be replaced before decoding.
    has_time: bool,
    /// The times of all keys, in the units of the text.
    times: Vec<f64>,
    /// The name of the camera whose shutter is used; `None` for the first camera.
    camera: Option<String>,
    /// Whether a camera is used, so that a scene without one is a reason for a warning.
    uses_camera: bool,
    /// The camera of a scene that has none, computed at the first frame that is read.
    default_camera: Option<Option<View>>,
    /// The node of what `--set` changes in that camera.
    set_in_default_camera: Vec<syntax::Node>,
    keep: FrameCache,
}

impl SceneDocument {
    /// Reads a file and its includes, and applies the overrides `set` as [`read_scene_with`] does.
    ///
    /// # Errors
    /// The messages if none of the text can be parsed. Other mistakes are returned by [`SceneDocument::scene`].
    pub fn read(name: &str, assets: &dyn Assets, set: &[String]) -> Result<SceneDocument, Diagnostics> {
        let asset = assets.read(name, &AssetPath::base()).map_err(|error| {
            let mut diagnostic = Diagnostic::error(name, error.to_string());
            diagnostic.help = error.help();
            diagnostic
        })?;
        let mut loader = Loader::new(assets, overrides::changes_settings_only(set));
        let nodes = loader.load(asset, None);
        SceneDocument::new(loader, nodes, set)
    }

    /// Parses a text; `name` is its display name.
    ///
    /// # Errors
    /// The messages if none of the text can be parsed. Other mistakes are returned by [`SceneDocument::scene`].
    pub fn of_text(text: &str, name: &str, assets: &dyn Assets, set: &[String]) -> Result<SceneDocument, Diagnostics> {
        let mut loader = Loader::new(assets, overrides::changes_settings_only(set));
        if text.len() > files::MAX_TEXT {
            return Err(Diagnostic::error(name, format!("the text is more than {} MiB", files::MAX_TEXT >> 20)).into());
        }
        let file = loader.files.add(name.to_owned(), AssetPath::new("", name, name), text.into());
        let nodes = loader.load_text(text, file);
        SceneDocument::new(loader, nodes, set)
    }

    fn new(loader: Loader, mut nodes: Vec<syntax::Node>, set: &[String]) -> Result<SceneDocument, Diagnostics> {
        let Loader { mut files, mut report, .. } = loader;
        // After a syntax error the parsed part is still validated, unless it is empty.
        if nodes.is_empty() && report.has_errors() {
            return Err(report.finish(&files));
        }
        let file_of_set = overrides::apply_set(&mut nodes, set, Settable::Scene, &mut files, &mut report);
        let numbers = arithmetic::evaluate(&mut nodes, &files, &mut report);
        let is_made = |node: &syntax::Node| *node.name == *CAMERA.name && Some(node.name_span.file) == file_of_set;
        let set_in_default_camera = nodes.extract_if(.., |node| is_made(node)).collect();
        let (timeline, report) = animate::timeline(&nodes, &files, report);
        let keep = FrameCache::new(timeline.moves);
        let times = animate::times(&nodes);
        let has_time = animate::has_time(&nodes);
        if has_time {
            animate::gather(&mut nodes, &files);
        }
        Ok(SceneDocument {
            nodes,
            numbers,
            files,
            report,
            timeline,
            has_time,
            times,
            camera: None,
            set_in_default_camera,
            uses_camera: true,
            default_camera: None,
            keep,
        })
    }

    /// The camera of a scene that has none. It is fitted to the first frame, so that it stays when objects move.
    fn default_camera(&mut self, scene: &Scene, assets: &dyn Assets, frame: f64) -> Option<View> {
        if let Some(known) = &self.default_camera {
            return known.clone();
        }
        let first = f64::from(self.first_frame());
        let view = if !self.timeline.moves || frame == first {
            import::default_camera(scene)
        } else {
            let (scene, _) = self.scene(assets, first).ok()?;
            scene.views.into_iter().next()
        };
        self.default_camera = Some(view.clone());
        view
    }

    /// The scene with its default camera, as `--set` changes it.
    fn with_default_camera(
        &mut self,
        mut scene: Scene,
        mut report: Report,
        assets: &dyn Assets,
        frame: f64,
    ) -> (Option<Scene>, Report) {
        let Some(view) = self.default_camera(&scene, assets, frame) else { return (Some(scene), report) };
        if self.uses_camera {
            report.push(no_camera(&view));
        }
        let mut set = self.set_in_default_camera.clone();
        for node in &mut set {
            node.values =
                vec![syntax::Value { kind: syntax::ValueKind::Text(view.name.as_str().into()), span: node.span }];
        }
        scene.views.push(view);
        match set.as_slice() {
            [] => (Some(scene), report),
            nodes => decode::override_scene(scene, nodes, None, &self.files, assets, report),
        }
    }

    fn once(mut self, assets: &dyn Assets) -> Result<(Scene, Diagnostics), Diagnostics> {
        self.keep.on = false;
        self.scene(assets, f64::from(self.first_frame()))
    }
}

impl SceneSource for SceneDocument {
    fn timeline(&self) -> &Timeline {
        &self.timeline
    }

    fn set_fps(&mut self, fps: f64) {
        self.timeline.fps = fps;
    }

    fn use_shutter_of(&mut self, camera: &str) {
        self.camera = Some(camera.to_owned());
    }

    fn use_no_camera(&mut self) {
        self.uses_camera = false;
    }

    /// Every text value except the names of objects.
    fn texts(&self) -> Vec<(&str, &AssetPath)> {
        fn collect<'a>(node: &'a syntax::Node, texts: &mut Vec<(&'a str, syntax::Span)>) {
            let named = node
                .properties
                .iter()
                .filter(|property| ![NAME.name(), MATERIAL.name(), OF.name()].contains(&&*property.key));
            // The value after an object's word is its name.
            let values = node.values.iter().filter(|_| !nodes::is_object(&node.name));
            let values = values.chain(named.map(|property| &property.value));
            texts.extend(values.filter_map(|value| Some((value.as_text()?, value.span))));
            let keys = node.keys.iter().flat_map(|keys| keys.nodes());
            node.children.iter().chain(keys).for_each(|child| collect(child, texts));
        }
        let mut texts = Vec::new();
        self.nodes.iter().for_each(|node| collect(node, &mut texts));
        let with_file = |(text, span): (_, syntax::Span)| Some((text, &self.files.get(span.file)?.path));
        texts.into_iter().filter_map(with_file).collect()
    }

    fn key_frames(&self) -> Vec<f64> {
        self.times.iter().map(|time| self.timeline.frame(*time)).collect()
    }

    /// Decodes the scene at a frame. A file is read once for all consecutive frames that name it.
    fn scene(&mut self, assets: &dyn Assets, frame: f64) -> Result<(Scene, Diagnostics), Diagnostics> {
        let mut report = self.report.clone();
        let mut moved;
        let nodes = if self.has_time {
            moved = self.nodes.clone();
            report = animate::animate(&mut moved, &self.timeline, frame, self.camera.as_deref(), &self.files, report);
            &moved
        } else {
            &self.nodes
        };
        let (nodes_in_time, timeline, files, camera) =
            (&self.nodes, &self.timeline, &self.files, self.camera.as_deref());
        let neighbours = |offset: f64| {
            if timeline.moves {
                views(nodes_in_time, timeline, frame + offset, camera, files, assets)
            } else {
                Vec::new()
            }
        };
        let (mut scene, mut report) =
            decode::decode(nodes, &self.numbers, &self.files, assets, report, &mut self.keep, &neighbours);
        self.keep.turn();
        if let Some(without) = scene.take_if(|scene| scene.views.is_empty() && !report.has_errors()) {
            (scene, report) = self.with_default_camera(without, report, assets, frame);
        }
        let failed = report.has_errors();
        let diagnostics = report.finish(&self.files);
        match scene {
            Some(scene) if !failed => Ok((scene, diagnostics)),
            _ => Err(diagnostics),
        }
    }
}

/// The cameras at a frame.
fn views(
    nodes: &[syntax::Node],
    timeline: &Timeline,
    frame: f64,
    camera: Option<&str>,
    files: &Files,
    assets: &dyn Assets,
) -> Vec<View> {
    let is_needed = |node: &&syntax::Node| [CAMERA.name, PATH.name].contains(&&*node.name);
    let mut nodes: Vec<syntax::Node> = nodes.iter().filter(is_needed).cloned().collect();
    animate::animate(&mut nodes, timeline, frame, camera, files, Report::default());
    decode::views(&nodes, files, assets)
}

fn no_camera(view: &View) -> Message {
    let short = |v: f64| format!("{v:.3e}").parse().unwrap_or(v);
    let point = |p: glam::DVec3| p.to_array().map(|v| short(v).to_string()).join(" ");
    let (place, lens) = (&view.extrinsics, &view.intrinsics);
    let (eye, center) = (point(place.eye), point(place.center));
    let message = "the scene has no camera; it is looked at as a model is, from the front, the right and above";
    Message::warning(None, message).help(format!(
        "camera {{ eye {eye}; center {center}; fovy {}; size {} {} }}",
        lens.fovy, lens.width, lens.height
    ))
}
