//! The fields and nodes of placing and time: transforms, motion while the shutter is open, frames, paths, and what
//! stands beside keys. Transforms are read by [`crate::text::decode`], times and paths by [`crate::text::animate`].

use super::TransformField;
use crate::animation::{Ease, PathCurve};
use crate::source::Timeline;
use crate::text::animate::{KeyUnit, Turn};
use crate::text::decode::TransformReader;
use crate::text::schema::{Block, Field, FieldSchema, NodeSchema, Numbers, Text, quoted};
use canaletto::Named;
use glam::DVec3;

pub(crate) const TRANSLATE: Field<DVec3> = Field::new("translate", "moves by x y z");
const ROTATE_X: Field<f64> =
    Field::new("rotate-x", "turns around the x axis by degrees, counter-clockwise with the axis towards the viewer");
const ROTATE_Y: Field<f64> = Field::new("rotate-y", "turns around the y axis by degrees");
const ROTATE_Z: Field<f64> = Field::new("rotate-z", "turns around the z axis by degrees");
const ROTATE: Field<Numbers> =
    Field::numbers("rotate", &[4], "turns around the axis x y z by degrees: the axis, then the angle");
const SCALE: Field<Numbers> =
    Field::numbers("scale", &[1, 3], "scales by a factor, or by one for each axis; a negative one mirrors");
/// A matrix, which keys don't interpolate.
pub(crate) const MATRIX: Field<Numbers> = Field::numbers(
    "matrix",
    &[12, 16, 24],
    "a matrix, row by row; of 16 numbers the last row is 0 0 0 1; of 24 the last 12 \
     are those of its inverse, which keep its last bits",
);
const FOLLOW_FIELD: Field<Block> = Field::block(&FOLLOW, "moves to a place on a path; see Motion");

/// The transforms of an object.
pub(crate) static TRANSFORMS: &[TransformField] = &[
    TransformField { schema: TRANSLATE.schema, read: TransformReader::Translation },
    TransformField { schema: ROTATE_X.schema, read: TransformReader::Rotation(DVec3::X) },
    TransformField { schema: ROTATE_Y.schema, read: TransformReader::Rotation(DVec3::Y) },
    TransformField { schema: ROTATE_Z.schema, read: TransformReader::Rotation(DVec3::Z) },
    TransformField { schema: ROTATE.schema, read: TransformReader::AxisAngle },
    TransformField { schema: SCALE.schema, read: TransformReader::Scale },
    TransformField { schema: MATRIX.schema, read: TransformReader::Matrix },
    // A matrix takes its place before objects are read.
    TransformField { schema: FOLLOW_FIELD.schema, read: TransformReader::Matrix },
];

/// `motion` in nodes that have transforms.
pub(crate) static MOTION: NodeSchema = NodeSchema::new(
    "motion",
    "What happens to an object, group or light while the shutter is open, after its own transforms: the transforms in \
     here, \
     from not at all when the shutter opens to wholly when it closes. Turns are turns all the way, up to 8 times \
     around.",
    &[],
)
.transforms()
.example("box { min -1 -1 -1; max 1 1 1; rotate-x 10; motion { rotate-y 90; translate 3 0 0 } }");

/// The field for [`MOTION`].
pub(crate) const MOTION_FIELD: Field<Block> =
    Field::block(&MOTION, "how it moves while the shutter is open; see Motion blur");
/// Its schema, for nodes that have it without a line in their table.
pub(super) static MOTION_SCHEMA: FieldSchema = MOTION_FIELD.schema;

pub(crate) const FPS: Field<f64> =
    Field::new("fps", "frames of a second, from 0.01 to 1000: the speed of films, and what keys in seconds mean")
        .or(|| Timeline::DEFAULT_FPS.to_string());
pub(crate) const FRAMES: Field<[u32; 2]> =
    Field::new("frames", "the first and the last frame, for films and `--frames all`");
pub(crate) const KEYS: Field<KeyUnit> =
    Field::word("keys", "what keys count in; second 0 is frame 0").or(|| quoted(KeyUnit::default().name()));

pub(crate) static ANIMATION: NodeSchema = NodeSchema::new(
    "animation",
    "How time is counted. Keys may stand in any word, see Motion.",
    &[&[FPS.schema, FRAMES.schema, KEYS.schema]],
)
.example("animation { fps 24; frames 1 48 }");

pub(crate) const PATH_NAME: Field<Text> = Field::text("name", "the name to follow it by").needed();
pub(crate) const PATH_POINTS: Field<Numbers> = Field::groups("points", 3, "the points, one after the other").needed();
pub(crate) const CURVE: Field<PathCurve> =
    Field::word("curve", "a smooth curve, or straight lines").or(|| quoted(PathCurve::default().name()));
pub(crate) const CLOSED: Field<bool> =
    Field::new("closed", "whether it leads back to the first point").or(|| "#false".into());

pub(crate) static PATH: NodeSchema = NodeSchema::new(
    "path",
    "A way that cameras, objects and points can follow. A spline is the centripetal Catmull-Rom curve through the \
     points.",
    &[&[PATH_POINTS.schema, CURVE.schema, CLOSED.schema]],
)
.argument(PATH_NAME.schema)
.example("path \"rail\" { points 0 0 0  10 0 0  10 0 10; curve \"spline\"; closed #true }");

pub(crate) const FOLLOWED: Field<Text> = Field::text("path", "the path's name").needed();
pub(crate) const AT: Field<f64> =
    Field::new("at", "the place as a share of the path's length: 0 its start, 1 its end").or(|| "0".into());
pub(crate) const FACE: Field<DVec3> =
    Field::new("face", "the object's own direction that is turned to where the path leads").or(|| "no turn".into());
pub(crate) const UP: Field<DVec3> = Field::new("up", "what stays up when it turns").or(|| "0 1 0".into());

/// `follow` among an object's transforms.
pub(crate) static FOLLOW: NodeSchema = NodeSchema::new(
    "follow",
    "Moves the object so that its origin lies on a path.",
    &[&[AT.schema, FACE.schema, UP.schema]],
)
.argument(FOLLOWED.schema);

pub(crate) const ALONG: Field<bool> =
    Field::new("along", "whether the camera looks where the path leads, instead of at its center")
        .or(|| "#false".into());

/// `follow` in a camera.
pub(crate) static CAMERA_FOLLOW: NodeSchema =
    NodeSchema::new("follow", "Puts the camera's eye on a path.", &[&[AT.schema, ALONG.schema]])
        .argument(FOLLOWED.schema);

/// `follow` in place of a point's numbers.
pub(crate) static POINT_FOLLOW: NodeSchema =
    NodeSchema::new("follow", "A point on a path.", &[&[AT.schema]]).argument(FOLLOWED.schema);

/// A key, in place of a field's values.
pub(crate) const KEY: &str = "key";

/// `ease` beside keys.
pub(crate) static EASE: Field<Ease> = Field::word("ease", "how the value goes from key to key");

/// `turn` beside the keys of a rotation.
pub(crate) static TURN: Field<Turn> = Field::word("turn", "whether degrees count, or the short way round is taken");
