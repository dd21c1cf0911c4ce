//! Decoding of a camera's lens and of its motion while the shutter is open.

use super::Decoder;
use super::fields::{Entry, Fields};
use crate::text::report::Message;
use crate::text::schema::{self, DEFAULT_BLADES, DEFAULT_LENS_ROTATION, NodeSchema};
use canaletto::scene::{Aperture, Extrinsics, Focus, Lens};

impl Decoder<'_> {
    /// The fields in the block of a field; `None` after a mistake in them.
    pub(super) fn block<'n>(&mut self, fields: &Fields<'n>, words: &'static NodeSchema) -> Option<Fields<'n>> {
        let Some(node) = fields.raw(words.name)?.node else {
            let message = Message::error(fields.span(words.name), format!("{} takes a block", words.name));
            self.validator.report.push(message.help(format!("for example: {}", words.example)));
            self.valid = false;
            return None;
        };
        let inner = self.validator.fields(node, words, words.name);
        self.valid &= inner.valid;
        inner.valid.then_some(inner)
    }

    /// The places of the camera while the shutter is open, starting at `from`.
    pub(super) fn camera_motion(&mut self, camera: &Fields, from: Extrinsics) -> Option<Vec<Extrinsics>> {
        let fields = self.block(camera, &schema::CAMERA_MOTION)?;
        if ["eye", "center", "up"].into_iter().any(|word| camera.raw(word).is_some_and(Entry::moves)) {
            let message = "both keys and motion say how the camera moves while the shutter is open";
            self.validator.report.error(camera.span("motion"), message);
            self.valid = false;
            return None;
        }
        let to = Extrinsics {
            eye: fields.dvec("eye").unwrap_or(from.eye),
            center: fields.dvec("center").unwrap_or(from.center),
            up: fields.dvec("up").unwrap_or(from.up),
        };
        Some(vec![from, to])
    }

    /// The lens of a camera. Its ranges are validated with the whole camera.
    pub(super) fn lens(&mut self, camera: &Fields) -> Option<Lens> {
        let fields = self.block(camera, &schema::LENS)?;
        self.either(&fields, "radius", "f-number");
        self.either(&fields, "focus", "focus-point");
        let aperture = match (fields.number("radius"), fields.number("f-number")) {
            (Some(radius), _) => Aperture::Radius(radius),
            (None, Some(number)) => Aperture::Number(number),
            (None, None) => {
                let message = Message::error(fields.node.name_span, "lens needs its radius or its f-number");
                self.validator.report.push(message.help(format!("for example: {}", schema::LENS.example)));
                self.valid = false;
                return None;
            }
        };
        let focus = match (fields.number("focus"), fields.dvec("focus-point")) {
            (Some(distance), _) => Focus::Distance(distance),
            (None, Some(point)) => Focus::Point(point),
            (None, None) => Focus::Center,
        };
        Some(Lens {
            aperture,
            focus,
            blades: fields.count("blades").unwrap_or(DEFAULT_BLADES),
            rotation: fields.number("rotation").unwrap_or(DEFAULT_LENS_ROTATION),
        })
    }

    /// Reports two fields that set one property in two forms.
    pub(super) fn either(&mut self, fields: &Fields, one: &str, other: &str) {
        if fields.has(one) && fields.has(other) {
            let name = &fields.node.name;
            self.validator.report.error(fields.span(other), format!("{name} has either {one} or {other}"));
            self.valid = false;
        }
    }
}
