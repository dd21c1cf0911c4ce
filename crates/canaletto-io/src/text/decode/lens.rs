//! A camera's lens.

use super::Decoder;
use super::fields::Fields;
use crate::text::report::Message;
use crate::text::schema::{self, DEFAULT_BLADES, DEFAULT_LENS_ROTATION};
use canaletto::scene::{Aperture, Focus, Lens};

impl Decoder<'_> {
    /// The lens in a camera's braces. Its ranges are checked with the whole camera.
    pub(super) fn lens(&mut self, camera: &Fields) -> Option<Lens> {
        let node = camera.raw("lens")?.node;
        let Some(node) = node else {
            let message = Message::error(camera.span("lens"), "lens takes a block");
            self.judge.report.push(message.help(format!("for example: {}", schema::LENS.example)));
            self.sound = false;
            return None;
        };
        let fields = self.judge.fields(node, &schema::LENS, "lens");
        self.sound &= fields.sound;
        if !fields.sound {
            return None;
        }
        self.either(&fields, "radius", "f-number");
        self.either(&fields, "focus", "focus-point");
        let aperture = match (fields.number("radius"), fields.number("f-number")) {
            (Some(radius), _) => Aperture::Radius(radius),
            (None, Some(number)) => Aperture::Number(number),
            (None, None) => {
                let message = Message::error(node.name_span, "lens needs its radius or its f-number");
                self.judge.report.push(message.help(format!("for example: {}", schema::LENS.example)));
                self.sound = false;
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

    /// Reports two words that mean the same thing in two ways.
    pub(super) fn either(&mut self, fields: &Fields, one: &str, other: &str) {
        if fields.has(one) && fields.has(other) {
            let name = &fields.node.name;
            self.judge.report.error(fields.span(other), format!("{name} has either {one} or {other}"));
            self.sound = false;
        }
    }
}
