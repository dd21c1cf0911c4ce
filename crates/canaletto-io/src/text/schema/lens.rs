//! The schema of lens and shutter, over which camera rays are sampled.

use super::{FieldSchema, NUMBER, NodeSchema, POINT, ValueType};

/// `lens` in a camera.
pub(crate) static LENS: NodeSchema = NodeSchema::new(
    "lens",
    "A thin lens in place of the pinhole: only what lies at its focus is sharp. It takes several rays in a pixel, such as \
     `film { samples 64 }`.",
    &[&[
        FieldSchema::new("radius", NUMBER, "the radius of its opening, to the corners if it has any; or `f-number`"),
        FieldSchema::new(
            "f-number",
            NUMBER,
            "N of a photographer's f/N: the opening is as wide as the camera's `near`, the distance of the film, divided by N",
        ),
        FieldSchema::new("focus", NUMBER, "the distance of what is sharp, along the optical axis; or `focus-point`"),
        FieldSchema::new("focus-point", POINT, "a point that is sharp, and with it the plane through it parallel to the film")
            .or(|| "`center`".into()),
        FieldSchema::new("blades", ValueType::Count, "the corners of the opening, from 3 to 64, or 0 for a round one")
            .or(|| DEFAULT_BLADES.to_string()),
        FieldSchema::new("rotation", NUMBER, "turns the corners counter-clockwise by degrees; at 0 the first is on the right")
            .or(|| DEFAULT_LENS_ROTATION.to_string()),
    ]],
)
.example("camera { eye 0 2 9; center 0 1 0; lens { radius 0.1; focus-point 0 1 2; blades 6; rotation 15 } }");

/// `motion` in nodes that have transforms.
pub(crate) static MOTION: NodeSchema = NodeSchema::new(
    "motion",
    "What happens to an object, group or light while the shutter is open, after its own transforms: the transforms in here, \
     from not at all when the shutter opens to wholly when it closes. Turns are turns all the way, up to 8 times around.",
    &[],
)
.transforms()
.example("box { min -1 -1 -1; max 1 1 1; rotate-x 10; motion { rotate-y 90; translate 3 0 0 } }");

/// The field for [`MOTION`].
pub(crate) static MOTION_WORD: FieldSchema =
    FieldSchema::new("motion", ValueType::Node(&MOTION), "how it moves while the shutter is open; see Motion blur");

/// `motion` in a camera.
pub(crate) static CAMERA_MOTION: NodeSchema = NodeSchema::new(
    "motion",
    "Where the camera is when the shutter closes, in the words that change. The eye moves on a straight line, and the \
     picture's axes turn.",
    &[&[
        FieldSchema::new("eye", POINT, "where it stands then").or(|| "`eye`".into()),
        FieldSchema::new("center", POINT, "a point that it looks at then").or(|| "`center`".into()),
        FieldSchema::new("up", POINT, "what is upwards then").or(|| "`up`".into()),
    ]],
)
.example("camera { eye 0 2 9; center 0 1 0; motion { eye 1 2 9 } }");

/// The default number of corners of the lens.
pub(crate) const DEFAULT_BLADES: u32 = 0;
/// The default rotation of the lens corners.
pub(crate) const DEFAULT_LENS_ROTATION: f64 = 0.0;
