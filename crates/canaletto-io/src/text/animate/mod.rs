//! Keys and paths: evaluation of animated nodes at a time.
//!
//! Any word may hold keys in place of its values, `translate { key 1  0 0 0; key 50  10 0 0 }`, since every parameter
//! is a node. Before a scene is decoded, keys and `follow` nodes are replaced by the values of its frame. The decoder
//! and the [`canaletto::scene::Scene`] therefore have no notion of time. Each key is validated by the schema like a
//! value of its own.

mod follow;
mod keys;

pub(crate) use keys::{Keys, Turn};

use super::files::Files;
use super::nodes::{
    self, ANIMATION, CAMERA, CAMERA_FOLLOW, CLOSED, CROP, CURVE, DEFAULT_CAMERA, EASE, FOLLOW, FPS, FRAMES, INCLUDE,
    KEY, KEYS, NAME, PATH, PATH_NAME, PATH_POINTS, POINT_FOLLOW, SHUTTER, SIZE, TURN,
};
use super::reader::Fields;
use super::report::{Message, Report};
use super::schema::{FieldSchema, NodeSchema, ValueType};
use super::syntax::{Node, Span};
use super::validate::Validator;
use crate::animation::Path;
use crate::source::Timeline;
use canaletto::named;
use std::collections::HashMap;

/// The unit of key times.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum KeyUnit {
    /// Frames.
    #[default]
    Frames,
    /// Seconds, with frame 0 at second 0.
    Seconds,
}

named!(KeyUnit {
    Frames => "frames",
    Seconds => "seconds",
});

/// The time settings of the text; mistakes in them are reported.
pub(crate) fn timeline(nodes: &[Node], files: &Files, report: Report) -> (Timeline, Report) {
    let mut timeline = Timeline::default();
    let mut validator = Validator::new(files, report);
    let mut first: Option<Span> = None;
    for node in nodes.iter().filter(|node| *node.name == *ANIMATION.name) {
        if let Some(first) = first.filter(|first| first.file == node.name_span.file) {
            let place = files.first(first, node.name_span);
            validator.report.push(Message::error(node.name_span, "the file has two animation nodes").label(place));
        }
        first = Some(node.name_span);
        let fields = validator.fields(node, &ANIMATION, ANIMATION.name);
        if let Some(fps) = fields.get(&FPS) {
            timeline.fps = fps;
            if !Timeline::FPS.contains(&fps) {
                let message =
                    format!("fps is {fps}; it must be between {} and {}", Timeline::FPS.start(), Timeline::FPS.end());
                validator.report.error(fields.span(&FPS), message);
                timeline.fps = Timeline::DEFAULT_FPS;
            }
        }
        if let Some([from, to]) = fields.get(&FRAMES) {
            timeline.frames = Some([from, to]);
            if from > to {
                let message = format!("the first frame, {from}, comes after the last, {to}");
                validator.report.error(fields.span(&FRAMES), message);
            }
        }
        if let Some(unit) = fields.word(&KEYS) {
            timeline.seconds = unit == KeyUnit::Seconds;
        }
    }
    timeline.moves = nodes.iter().any(|node| contains(node, &[KEY]));
    (timeline, validator.report)
}

/// Whether any of these nodes must be replaced before decoding, since its value depends on time or on a path.
pub(crate) fn has_time(nodes: &[Node]) -> bool {
    nodes.iter().any(|node| contains(node, &[KEY, FOLLOW.name, PATH.name, EASE.name(), TURN.name()]))
}

/// Whether the node, or any node inside of it, has one of these names.
fn contains(node: &Node, names: &[&str]) -> bool {
    names.contains(&&*node.name) || node.children.iter().any(|child| contains(child, names))
}

/// The times of all keys, in their units.
pub(crate) fn times(nodes: &[Node]) -> Vec<f64> {
    fn collect(node: &Node, times: &mut Vec<f64>) {
        if &*node.name == KEY {
            times.extend(node.values.first().and_then(|v| v.as_number()).filter(|t| t.is_finite()));
        }
        node.children.iter().for_each(|child| collect(child, times));
    }
    let mut times = Vec::new();
    nodes.iter().for_each(|node| collect(node, &mut times));
    times.sort_by(f64::total_cmp);
    times.dedup();
    times
}

/// The number of poses while the shutter is open, evenly spaced from its opening to its closing. Between poses,
/// translations are linear and rotations uniform, so this many follow a curve closely.
pub(crate) const POSES: usize = 17;

/// The largest rotation between two poses, in degrees. From a half turn on its direction would be ambiguous.
const MOST_TURN: f64 = 150.0;

/// Replaces keys and paths by the values of a frame. Values that change while the shutter of `camera` (default: the
/// first camera) is open are also evaluated at [`POSES`] moments.
pub(crate) fn animate(
    nodes: &mut Vec<Node>,
    timeline: &Timeline,
    frame: f64,
    camera: Option<&str>,
    files: &Files,
    report: Report,
) -> Report {
    let mut animator = Animator {
        validator: Validator::new(files, report),
        gathers: false,
        time: timeline.time(frame),
        shutter: Vec::new(),
        paths: HashMap::new(),
    };
    if let Some([open, close]) = animator.shutter(nodes, camera).filter(|[open, close]| open < close) {
        let moment = |k: usize| timeline.time(frame + open + (close - open) * k as f64 / (POSES - 1) as f64);
        animator.shutter = (0..POSES).map(moment).collect();
    }
    animator.paths(nodes);
    for node in nodes.iter_mut() {
        animator.top(node);
    }
    nodes.retain(|node| *node.name != *PATH.name);
    animator.validator.report
}

/// Moves the keys of nodes to `Node::keys`, so that frames share them; see [`keys`].
pub(crate) fn gather(nodes: &mut [Node], files: &Files) {
    let mut gatherer = Animator {
        validator: Validator::new(files, Report::default()),
        gathers: true,
        time: 0.0,
        shutter: Vec::new(),
        paths: HashMap::new(),
    };
    for node in nodes {
        if *node.name == *PATH.name { gatherer.node(node, &PATH) } else { gatherer.top(node) }
    }
}

struct Animator<'a> {
    validator: Validator<'a>,
    /// Whether keys are only moved to `Node::keys`, and nothing is replaced.
    gathers: bool,
    /// The time of the frame, in the units of keys.
    time: f64,
    /// The sample times while the shutter is open.
    shutter: Vec<f64>,
    /// The paths by name; `None` for an invalid path.
    paths: HashMap<String, (Option<Path>, Span)>,
}

/// Words that can't be animated, because they identify files and pictures.
const NOT_ANIMATED: [&str; 3] = [NAME.name(), SIZE.name(), CROP.name()];

impl Animator<'_> {
    /// Animates a setting, an object or a light.
    fn top(&mut self, node: &mut Node) {
        let read_apart = [&INCLUDE, &ANIMATION, &PATH];
        let words =
            nodes::schema(node).filter(|words| !read_apart.into_iter().any(|apart| std::ptr::eq(*words, apart)));
        if let Some(words) = words {
            self.node(node, words);
        }
    }

    /// Animates the words in the block of a node.
    fn node(&mut self, node: &mut Node, words: &'static NodeSchema) {
        // A name has no keys.
        let may_move = |word: &&FieldSchema| !(words.transforms && matches!(word.value_type, ValueType::Text));
        if let Some(word) = words.argument.as_ref().filter(may_move) {
            self.value(node, word);
        }
        let mut at = 0;
        while at < node.children.len() {
            let name = node.children[at].name.clone();
            let follows = *name == *FOLLOW.name;
            if follows && std::ptr::eq(words, &CAMERA) {
                if self.gathers {
                    self.node(&mut node.children[at], &CAMERA_FOLLOW);
                } else {
                    self.follow_with_camera(node, at);
                }
            } else if follows && words.transforms {
                if self.gathers {
                    self.node(&mut node.children[at], &FOLLOW);
                } else {
                    self.follow_with_object(&mut node.children[at]);
                }
            } else if let Some(word) = nodes::field(words, &name) {
                match word.value_type {
                    ValueType::Node(inner) => self.node(&mut node.children[at], inner),
                    _ => self.value(&mut node.children[at], word),
                }
            } else if words.objects && nodes::is_object(&name) {
                self.top(&mut node.children[at]);
            }
            at += 1;
        }
    }

    /// Animates a word whose values may come from keys or from a path.
    fn value(&mut self, node: &mut Node, word: &'static FieldSchema) {
        Animator::gather(node);
        let follow = |child: &&mut Node| *child.name == *FOLLOW.name;
        if node.keys.is_some() {
            if !self.gathers {
                self.keys(node, word);
            }
        } else if matches!(word.value_type, ValueType::Numbers(counts) if counts.contains(&3))
            && let Some(inner) = node.children.iter_mut().find(follow)
        {
            if self.gathers {
                self.node(inner, &POINT_FOLLOW);
            } else {
                self.follow_with_point(node, word);
            }
        }
    }

    /// The opening and closing times of the shutter, in frames relative to the frame. The last node of the camera that
    /// sets them decides.
    fn shutter(&mut self, nodes: &mut [Node], camera: Option<&str>) -> Option<[f64; 2]> {
        let word = CAMERA.word(SHUTTER.name())?;
        let name = |node: &Node| node.values.first().and_then(|v| v.as_text()).unwrap_or(DEFAULT_CAMERA).to_owned();
        let cameras = || nodes.iter().filter(|node| *node.name == *CAMERA.name);
        let wanted = camera.map(str::to_owned).or_else(|| cameras().next().map(name))?;
        let mut shutter = None;
        for node in nodes.iter_mut().filter(|node| *node.name == *CAMERA.name && name(node) == wanted) {
            for child in node.children.iter_mut().filter(|child| *child.name == *word.name) {
                self.value(child, word);
                let numbers: Vec<f64> = child.values.iter().filter_map(|v| v.as_number()).collect();
                // Other values are mistakes, which the decoder reports.
                shutter = <[f64; 2]>::try_from(numbers).ok().filter(|s| s.iter().all(|s| s.is_finite())).or(shutter);
            }
        }
        shutter
    }

    /// Reads the paths of the scene at its time.
    fn paths(&mut self, nodes: &mut [Node]) {
        for node in nodes.iter_mut().filter(|node| *node.name == *PATH.name) {
            self.node(node, &PATH);
            let fields = self.validator.fields(node, &PATH, PATH.name);
            let Some(name) = fields.text(&PATH_NAME) else { continue };
            let span = fields.span(&PATH_NAME);
            if let Some((_, first)) = self.paths.get(name) {
                let place = self.validator.files.first(*first, span);
                let message = Message::error(span, format!("two paths are called \"{name}\""));
                self.validator.report.push(message.label(place));
                continue;
            }
            let path = self.path(&fields);
            self.paths.insert(name.to_owned(), (path, span));
        }
    }

    fn path(&mut self, fields: &Fields) -> Option<Path> {
        let numbers = fields.all(&PATH_POINTS)?;
        let points: Vec<glam::DVec3> = numbers.chunks_exact(3).map(glam::DVec3::from_slice).collect();
        let curve = fields.word(&CURVE).unwrap_or_default();
        match Path::new(&points, curve, fields.get(&CLOSED).unwrap_or(false)) {
            Ok(path) => Some(path),
            Err(problem) => {
                self.validator.report.error(fields.span(&PATH_POINTS), problem);
                None
            }
        }
    }
}
