//! The schema of time: frames, paths and the nodes that follow them. Keys are allowed in every field.

use super::settings::quoted;
use super::{FieldSchema, NUMBER, NodeSchema, POINT, ValueType};
use crate::animation::{Ease, PathCurve};
use crate::text::animate::{KeyUnit, Turn};
use canaletto::Named;

/// The default frame rate in frames per second.
pub(crate) const DEFAULT_FPS: f64 = 25.0;

pub(crate) static ANIMATION: NodeSchema = NodeSchema::new(
    "animation",
    "How time is counted. Keys may stand in any word, see Motion.",
    &[&[
        FieldSchema::new(
            "fps",
            NUMBER,
            "frames of a second, from 0.01 to 1000: the speed of films, and what keys in seconds mean",
        )
        .or(|| DEFAULT_FPS.to_string()),
        FieldSchema::new("frames", ValueType::Counts(2), "the first and the last frame, for films and `--frames all`"),
        FieldSchema::new("keys", ValueType::Keyword(KeyUnit::NAMES), "what keys count in; second 0 is frame 0")
            .or(|| quoted(KeyUnit::default().name())),
    ]],
)
.example("animation { fps 24; frames 1 48 }");

pub(crate) static PATH: NodeSchema = NodeSchema::new(
    "path",
    "A way that cameras, objects and points can follow. A spline is the centripetal Catmull-Rom curve through the points.",
    &[&[
        FieldSchema::new("points", ValueType::Many(3), "the points, one after the other").needed(),
        FieldSchema::new("curve", ValueType::Keyword(PathCurve::NAMES), "a smooth curve, or straight lines").or(|| quoted(PathCurve::default().name())),
        FieldSchema::new("closed", ValueType::Flag, "whether it leads back to the first point").or(|| "#false".into()),
    ]],
)
.argument(FieldSchema::new("name", ValueType::Text, "the name to follow it by").needed())
.example("path \"rail\" { points 0 0 0  10 0 0  10 0 10; curve \"spline\"; closed #true }");

const PATH_NAME: FieldSchema = FieldSchema::new("path", ValueType::Text, "the path's name").needed();
const AT: FieldSchema =
    FieldSchema::new("at", NUMBER, "the place as a share of the path's length: 0 its start, 1 its end")
        .or(|| "0".into());

/// `follow` among an object's transforms.
pub(crate) static FOLLOW: NodeSchema = NodeSchema::new(
    "follow",
    "Moves the object so that its origin lies on a path.",
    &[&[
        AT,
        FieldSchema::new("face", POINT, "the object's own direction that is turned to where the path leads")
            .or(|| "no turn".into()),
        FieldSchema::new("up", POINT, "what stays up when it turns").or(|| "0 1 0".into()),
    ]],
)
.argument(PATH_NAME);

/// `follow` in a camera.
pub(crate) static CAMERA_FOLLOW: NodeSchema = NodeSchema::new(
    "follow",
    "Puts the camera's eye on a path.",
    &[&[
        AT,
        FieldSchema::new(
            "along",
            ValueType::Flag,
            "whether the camera looks where the path leads, instead of at its center",
        )
        .or(|| "#false".into()),
    ]],
)
.argument(PATH_NAME);

/// `follow` in place of a point's numbers.
pub(crate) static POINT_FOLLOW: NodeSchema =
    NodeSchema::new("follow", "A point on a path.", &[&[AT]]).argument(PATH_NAME);

/// `ease` beside keys.
pub(crate) static EASE: FieldSchema =
    FieldSchema::new("ease", ValueType::Keyword(Ease::NAMES), "how the value goes from key to key");

/// `turn` beside the keys of a rotation.
pub(crate) static TURN: FieldSchema =
    FieldSchema::new("turn", ValueType::Keyword(Turn::NAMES), "whether degrees count, or the short way round is taken");
