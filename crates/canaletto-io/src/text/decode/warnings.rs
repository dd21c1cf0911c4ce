//! Warnings about values that are valid, but suggest a wrong scale.

use super::Decoder;
use crate::text::reader::Fields;
use crate::text::report::Message;
use crate::text::schema::Field;
use canaletto::math::Rgb;

/// From this value on, light resembles a colour from 0 to 255. Less is plausible for light that is attenuated by
/// distance.
const BRIGHT: f32 = 16.0;

impl Decoder<'_> {
    /// Warns of a material's colour that seems to be from 0 to 255; 1 is full reflectance.
    pub(crate) fn doubt_reflectance(&mut self, fields: &Fields, field: &Field<Rgb>) {
        self.doubt_bytes(fields, field, 1.0);
    }

    /// Warns of a colour of a light or of the background that seems to be from 0 to 255. It may exceed 1.
    pub(crate) fn doubt_light(&mut self, fields: &Fields, field: &Field<Rgb>) {
        self.doubt_bytes(fields, field, BRIGHT);
    }

    fn doubt_bytes(&mut self, fields: &Fields, field: &Field<Rgb>, most: f32) {
        let Some(colour) = fields.get(field).filter(|colour| resembles_8_bit(*colour, most)) else { return };
        let [r, g, b] = colour.to_array().map(|v| (v / 255.0 * 1000.0).round() / 1000.0);
        let title = if fields.is_argument(field) { &*fields.node.name } else { field.name() };
        let message = format!("{title} looks like a colour of 0 to 255; here 1 is full strength");
        let help = format!("divided by 255 it is {r} {g} {b}");
        self.validator.report.push(Message::warning(Some(fields.span(field)), message).help(help));
    }

    /// Warns of a cone angle that is likely to be in radians: it is at most about a right angle in radians.
    pub(crate) fn doubt_degrees(&mut self, fields: &Fields, field: &Field<f32>) {
        let Some(angle) = fields.get(field).filter(|angle| (0.1..=1.6).contains(angle)) else { return };
        let degrees = (f64::from(angle).to_degrees() * 10.0).round() / 10.0;
        let message =
            format!("{} is {angle} degrees, which lights very little; it looks like an angle in radians", field.name());
        let help = format!("in degrees that is {degrees}");
        self.validator.report.push(Message::warning(Some(fields.span(field)), message).help(help));
    }

    /// Warns of `eta` on an opaque body.
    pub(crate) fn doubt_eta(&mut self, fields: &Fields, eta: &Field<f32>, clear: bool) {
        if fields.has(eta) && !clear {
            let message = "eta has no effect, since no light goes through: opacity is 1";
            let help = "opacity 0 is clear glass, opacity 0.4 lets 60 % through";
            self.validator.report.push(Message::warning(Some(fields.span(eta)), message).help(help));
        }
    }

    /// Warns of a field that changes nothing, and tells why.
    pub(crate) fn doubt_effect<T>(
        &mut self,
        fields: &Fields,
        field: &Field<T>,
        has_effect: bool,
        since: &str,
        help: &str,
    ) {
        if fields.has(field) && !has_effect {
            let message = format!("{} has no effect, since {since}", field.name());
            self.validator.report.push(Message::warning(Some(fields.span(field)), message).help(help));
        }
    }

    /// Warns of `two-sided` on a material that emits nothing.
    pub(crate) fn doubt_two_sided(&mut self, fields: &Fields, two_sided: &Field<bool>, emits: bool) {
        if fields.get(two_sided) == Some(true) && !emits {
            let message = "two-sided has no effect, since the material has no emission";
            let help = "surfaces reflect light on both sides in any case";
            self.validator.report.push(Message::warning(Some(fields.span(two_sided)), message).help(help));
        }
    }
}

fn resembles_8_bit(colour: Rgb, most: f32) -> bool {
    let values = colour.to_array();
    values.iter().all(|v| v.fract() == 0.0 && (0.0..=255.0).contains(v)) && values.iter().any(|v| *v > most)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_numbers_up_to_255_look_like_bytes() {
        let of = |r, g, b, most| resembles_8_bit(Rgb::new(r, g, b), most);
        assert!(of(255.0, 128.0, 0.0, 1.0) && of(2.0, 2.0, 2.0, 1.0) && of(255.0, 255.0, 255.0, BRIGHT));
        assert!(!of(1.0, 1.0, 1.0, 1.0) && !of(0.5, 200.0, 3.0, 1.0) && !of(256.0, 0.0, 0.0, 1.0));
        assert!(!of(10.0, 8.0, 6.0, BRIGHT), "a strong light");
    }
}
