//! The node of a camera, with its lens and its motion while the shutter is open.

use super::change;
use super::film::CROP;
use super::motion::CAMERA_FOLLOW;
use crate::text::animate::POSES;
use crate::text::decode::Decoder;
use crate::text::reader::{Entry, Fields};
use crate::text::report::Message;
use crate::text::schema::{Block, Field, NodeSchema, Text, numbers, quoted};
use canaletto::camera::Camera;
use canaletto::render::Job;
use canaletto::scene::{Aperture, CameraProjection, Extrinsics, FilmSettings, Focus, Intrinsics, Lens, View};
use glam::DVec3;

/// The default name of a camera.
pub(crate) const DEFAULT_CAMERA: &str = "camera";

const NAME: Field<Text> = Field::text("name", "the name to choose it by").or(|| quoted(DEFAULT_CAMERA));
/// The eye.
pub(crate) const EYE: Field<DVec3> =
    Field::new("eye", "where it stands").or(|| numbers(Extrinsics::default().eye.to_array()));
/// The point at which the camera is aimed.
pub(crate) const CENTER: Field<DVec3> =
    Field::new("center", "a point that it looks at").or(|| numbers(Extrinsics::default().center.to_array()));
const UP: Field<DVec3> =
    Field::new("up", "a direction that is upwards in the picture").or(|| numbers(Extrinsics::default().up.to_array()));
const FOVY: Field<f64> = Field::new("fovy", "the whole vertical angle of view in degrees, between 0 and 180")
    .or(|| Intrinsics::default().fovy.to_string());
const ORTHOGRAPHIC: Field<f64> = Field::new(
    "orthographic",
    "instead of `fovy`: all rays are parallel, and the picture shows this height, in the scene's unit, at every \
     distance; rays start on the plane through the eye",
);
const NEAR: Field<f64> = Field::new(
    "near",
    "the distance of the projection plane; rays start at the eye all the same, but a z-buffer draws nothing in front of \
     a given one",
)
    .or(|| Intrinsics::DEFAULT_NEAR.to_string());
const FAR: Field<f64> =
    Field::new("far", "the distance beyond which a z-buffer draws nothing").or(|| "none".to_owned());
/// Width and height of the picture.
pub(crate) const SIZE: Field<[u32; 2]> = Field::new("size", "width and height of the picture in pixels").or(|| {
    let Intrinsics { width, height, .. } = Intrinsics::default();
    numbers([width, height])
});
const SHIFT: Field<[f64; 2]> =
    Field::new("shift", "moves the picture's window off the optical axis, in fractions of its width and height")
        .or(|| numbers(Intrinsics::default().shift));
const LENS_FIELD: Field<Block> = Field::block(&LENS, "a lens, for depth of field; see below").or(|| "a pinhole".into());
/// The opening and closing times of the shutter.
pub(crate) const SHUTTER: Field<[f64; 2]> = Field::new(
    "shutter",
    "when the shutter opens and closes, in frames from the frame's own time: what keys move is blurred by as much",
)
.or(|| numbers(Intrinsics::default().shutter));
const MOTION_FIELD: Field<Block> =
    Field::block(&CAMERA_MOTION, "how it moves while the shutter is open; see below").or(|| "it stays".into());
const FOLLOW: Field<Block> =
    Field::block(&CAMERA_FOLLOW, "a path that the camera moves on, instead of `eye`; see Motion");

/// Two ways to place the eye.
pub(super) const EYE_OR_FOLLOW: [&str; 2] = [EYE.name(), FOLLOW.name()];

pub(crate) static CAMERA: NodeSchema = NodeSchema::new(
    "camera",
    "A view of the scene. There may be several; the first one is taken where none is named. A scene without a camera is \
     seen as a model is, from the front, a little from the right and above, with all of it in the picture: also visible \
     lights, unless they are far away. The angle, the planes and the size are those of `gluPerspective`, the rest those \
     of `gluLookAt`.",
    &[&[
        EYE.schema,
        CENTER.schema,
        UP.schema,
        FOVY.schema,
        ORTHOGRAPHIC.schema,
        NEAR.schema,
        FAR.schema,
        SIZE.schema,
        SHIFT.schema,
        LENS_FIELD.schema,
        SHUTTER.schema,
        MOTION_FIELD.schema,
        FOLLOW.schema,
    ]],
)
.argument(NAME.schema)
.example("camera \"side\" { eye 100 40 40; center 0 0 0; up 0 1 0; fovy 90; size 640 480 }");

/// The default number of corners of the lens.
const DEFAULT_BLADES: u32 = 0;
/// The default rotation of the lens corners.
const DEFAULT_ROTATION: f64 = 0.0;

const LENS_RADIUS: Field<f64> =
    Field::new("radius", "the radius of its opening, to the corners if it has any; or `f-number`");
const F_NUMBER: Field<f64> = Field::new(
    "f-number",
    "N of a photographer's f/N: the opening is as wide as the camera's `near`, the distance of the film, divided by N; \
     not of an orthographic camera",
);
const FOCUS: Field<f64> =
    Field::new("focus", "the distance of what is sharp, along the optical axis; or `focus-point`");
const FOCUS_POINT: Field<DVec3> =
    Field::new("focus-point", "a point that is sharp, and with it the plane through it parallel to the film")
        .or(|| "`center`".into());
const BLADES: Field<u32> = Field::new("blades", "the corners of the opening, from 3 to 64, or 0 for a round one")
    .or(|| DEFAULT_BLADES.to_string());
const ROTATION: Field<f64> =
    Field::new("rotation", "turns the corners counter-clockwise by degrees; at 0 the first is on the right")
        .or(|| DEFAULT_ROTATION.to_string());

/// `lens` in a camera.
pub(crate) static LENS: NodeSchema = NodeSchema::new(
    "lens",
    "A thin lens in place of the pinhole: only what lies at its focus is sharp. It takes several rays in a pixel, such \
     as `film { samples 64 }`.",
    &[&[LENS_RADIUS.schema, F_NUMBER.schema, FOCUS.schema, FOCUS_POINT.schema, BLADES.schema, ROTATION.schema]],
)
.example("camera { eye 0 2 9; center 0 1 0; lens { radius 0.1; focus-point 0 1 2; blades 6; rotation 15 } }");

const EYE_THEN: Field<DVec3> = Field::new("eye", "where it stands then").or(|| "`eye`".into());
const CENTER_THEN: Field<DVec3> = Field::new("center", "a point that it looks at then").or(|| "`center`".into());
const UP_THEN: Field<DVec3> = Field::new("up", "what is upwards then").or(|| "`up`".into());

/// `motion` in a camera.
pub(crate) static CAMERA_MOTION: NodeSchema = NodeSchema::new(
    "motion",
    "Where the camera is when the shutter closes, in the words that change. The eye moves on a straight line, and the \
     picture's axes turn.",
    &[&[EYE_THEN.schema, CENTER_THEN.schema, UP_THEN.schema]],
)
.example("camera { eye 0 2 9; center 0 1 0; motion { eye 1 2 9 } }");

impl Decoder<'_> {
    /// Decodes a camera, or changes the one of this name. Returns its index.
    pub(crate) fn camera(&mut self, fields: &Fields, name: &str) -> usize {
        let index = self.scene.views.iter().position(|view| view.name == name).unwrap_or_else(|| {
            let view = View {
                name: name.to_owned(),
                intrinsics: Intrinsics::default(),
                extrinsics: Extrinsics::default(),
                motion: Vec::new(),
            };
            self.scene.views.push(view);
            self.scene.views.len() - 1
        });
        self.either(fields, &FOVY, &ORTHOGRAPHIC);
        let lens = if fields.has(&LENS_FIELD) { self.lens(fields) } else { None };
        change_view(&mut self.scene.views[index], fields);
        let from = self.scene.views[index].extrinsics;
        let motion = if fields.has(&MOTION_FIELD) { self.camera_motion(fields, from) } else { None };
        let motion = motion.or_else(|| keyed_motion(&self.scene.views[index], fields));
        let view = &mut self.scene.views[index];
        change(&mut view.intrinsics.lens, lens.map(Some));
        change(&mut view.motion, motion);
        index
    }

    /// The places of the camera while the shutter is open, starting at `from`.
    fn camera_motion(&mut self, camera: &Fields, from: Extrinsics) -> Option<Vec<Extrinsics>> {
        let fields = self.block(camera, &MOTION_FIELD)?;
        if [&EYE, &CENTER, &UP].into_iter().any(|field| camera.raw(field).is_some_and(Entry::moves)) {
            let message = "both keys and motion say how the camera moves while the shutter is open";
            self.validator.report.error(camera.span(&MOTION_FIELD), message);
            self.valid = false;
            return None;
        }
        let to = Extrinsics {
            eye: fields.get(&EYE_THEN).unwrap_or(from.eye),
            center: fields.get(&CENTER_THEN).unwrap_or(from.center),
            up: fields.get(&UP_THEN).unwrap_or(from.up),
        };
        Some(vec![from, to])
    }

    /// The lens of a camera. Its ranges are validated with the whole camera.
    fn lens(&mut self, camera: &Fields) -> Option<Lens> {
        let fields = self.block(camera, &LENS_FIELD)?;
        self.either(&fields, &LENS_RADIUS, &F_NUMBER);
        self.either(&fields, &FOCUS, &FOCUS_POINT);
        let aperture = match (fields.get(&LENS_RADIUS), fields.get(&F_NUMBER)) {
            (Some(radius), _) => Aperture::Radius(radius),
            (None, Some(number)) => Aperture::Number(number),
            (None, None) => {
                let message = Message::error(fields.node.name_span, "lens needs its radius or its f-number");
                self.validator.report.push(message.help(format!("for example: {}", LENS.example)));
                self.valid = false;
                return None;
            }
        };
        let focus = match (fields.get(&FOCUS), fields.get(&FOCUS_POINT)) {
            (Some(distance), _) => Focus::Distance(distance),
            (None, Some(point)) => Focus::Point(point),
            (None, None) => Focus::Center,
        };
        Some(Lens {
            aperture,
            focus,
            blades: fields.get(&BLADES).unwrap_or(DEFAULT_BLADES),
            rotation: fields.get(&ROTATION).unwrap_or(DEFAULT_ROTATION),
        })
    }

    /// Validates the cameras as merged from all files, and the crop window in them.
    pub(crate) fn check_views(&mut self, last: &[Fields], film: Option<&Fields>) {
        let mut outside = None;
        let mut inside = false;
        for (index, fields) in last.iter().enumerate() {
            match Camera::of(&self.scene.views[index]) {
                Err(problem) if fields.valid => {
                    self.validator.report.error(fields.span_of(problem.field()), problem.to_string());
                    self.valid = false;
                }
                Err(_) => {}
                Ok(camera) => {
                    let film = FilmSettings { crop: self.scene.film.crop, ..FilmSettings::default() };
                    match Job::new(camera, film, self.scene.integrator).check() {
                        Ok(()) => inside = true,
                        Err(problem) => outside = Some(problem.to_string()),
                    }
                }
            }
        }
        // With several cameras, the window must fit only one.
        if let (Some(problem), Some(film), false) = (outside, film, inside) {
            self.validator.report.error(film.span(&CROP), problem);
            self.valid = false;
        }
    }
}

/// The places of the camera while the shutter is open, if keys in this node or an earlier one move it.
fn keyed_motion(view: &View, fields: &Fields) -> Option<Vec<Extrinsics>> {
    let moves = |field| fields.raw(field).is_some_and(Entry::moves);
    let mut motion = match view.motion.len() {
        POSES => view.motion.clone(),
        _ if [&EYE, &CENTER, &UP].into_iter().any(moves) => vec![view.extrinsics; POSES],
        _ => return None,
    };
    for (moment, place) in motion.iter_mut().enumerate() {
        let at = |field| fields.raw(field).and_then(|got| got.at(moment).numbers()).map(DVec3::from_array);
        change(&mut place.eye, at(&EYE));
        change(&mut place.center, at(&CENTER));
        change(&mut place.up, at(&UP));
    }
    Some(motion)
}

fn change_view(view: &mut View, fields: &Fields) {
    let (i, e) = (&mut view.intrinsics, &mut view.extrinsics);
    change(&mut e.eye, fields.get(&EYE));
    change(&mut e.center, fields.get(&CENTER));
    change(&mut e.up, fields.get(&UP));
    let fovy = fields.get(&FOVY);
    change(&mut i.fovy, fovy);
    change(&mut i.projection, fovy.map(|_| CameraProjection::Perspective));
    change(&mut i.projection, fields.get(&ORTHOGRAPHIC).map(|height| CameraProjection::Orthographic { height }));
    i.near = fields.get(&NEAR).or(i.near);
    i.far = fields.get(&FAR).or(i.far);
    change(&mut i.shift, fields.get(&SHIFT));
    change(&mut i.shutter, fields.get(&SHUTTER));
    if let Some([width, height]) = fields.get(&SIZE) {
        (i.width, i.height) = (width, height);
    }
}
