//! Decoding of environments.

use super::Decoder;
use super::fields::Fields;
use crate::text::report::Message;
use crate::text::schema::{self, ENVIRONMENTS};
use crate::text::syntax::Node;
use canaletto::Named;
use canaletto::light::environment::{Environment, EnvironmentKind, Face, Gradient, Moment, Sky, bearing};
use canaletto::math::Rgb;
use glam::Vec3;

impl Decoder<'_> {
    /// Decodes an environment node, which replaces the one before.
    pub(super) fn environment(&mut self, node: &Node) -> Option<Environment> {
        let kinds: Vec<&'static str> = ENVIRONMENTS.iter().map(|(kind, _)| *kind).collect();
        let kind = self.kind_after(node, "environment", &kinds)?;
        let fields = self.validator.fields(node, schema::environment(kind)?, &format!("environment \"{kind}\""));
        let rotation = self.transform(&fields);
        self.valid &= fields.valid;
        // Missing words were reported; the files are checked nevertheless.
        let decoded = self.environment_kind(kind, &fields);
        let environment = Environment {
            rotation,
            intensity: fields.rgb("intensity").unwrap_or(Rgb::WHITE),
            ambient: fields.flag("ambient").unwrap_or(false),
            ..Environment::new(decoded?)
        };
        if !fields.valid {
            return None;
        }
        match environment.check(&self.scene.images) {
            Ok(()) => Some(environment),
            Err(problem) => {
                self.out_of_range(&fields, &problem);
                None
            }
        }
    }

    fn environment_kind(&mut self, kind: &str, f: &Fields) -> Option<EnvironmentKind> {
        let smoothing = f.named("filter").unwrap_or_default();
        match kind {
            "cube" => {
                let faces = Face::NAMES.iter().map(|word| self.image_of(f, word));
                let faces: Vec<Option<u32>> = faces.collect();
                let faces: Option<Vec<u32>> = faces.into_iter().collect();
                Some(EnvironmentKind::Cube { faces: faces?.try_into().ok()?, smoothing })
            }
            "cross" => Some(EnvironmentKind::Cross { image: self.image_of(f, "file")?, smoothing }),
            "lat-long" => {
                let image = self.image_of(f, "file")?;
                if let Some(image) = self.scene.images.get(image as usize)
                    && u64::from(image.width) != 2 * u64::from(image.height)
                {
                    let (w, h) = (image.width, image.height);
                    let message =
                        format!("the picture is {w} × {h} pixels; a latitude-longitude one is twice as wide as high");
                    let message = Message::warning(Some(f.span("file")), message);
                    self.validator.report.push(message.help("it is stretched over all directions"));
                }
                Some(EnvironmentKind::LatLong { image, smoothing })
            }
            "gradient" => {
                let numbers: Vec<f32> =
                    f.raw("stops")?.values.iter().filter_map(|v| v.as_number()).map(|v| v as f32).collect();
                let stops = numbers.chunks_exact(4).map(|s| (s[0], Rgb::new(s[1], s[2], s[3]))).collect();
                Some(EnvironmentKind::Gradient(Gradient { stops }))
            }
            _ => {
                let d = Sky::default();
                Some(EnvironmentKind::Sky(Sky {
                    sun: self.sun(f)?,
                    turbidity: f.real("turbidity").unwrap_or(d.turbidity),
                    ground: f.rgb("ground").unwrap_or(d.ground),
                    exposure: f.real("exposure").unwrap_or(d.exposure),
                    disk: f.flag("disk").unwrap_or(d.disk),
                    light: f.flag("light").unwrap_or(d.light),
                }))
            }
        }
    }

    fn image_of(&mut self, f: &Fields, word: &str) -> Option<u32> {
        let image = self.image(f.text(word)?, f.span(word));
        self.valid &= image.is_some();
        image
    }

    /// The direction to the sun, given in one of three forms.
    fn sun(&mut self, f: &Fields) -> Option<Vec3> {
        for (word, other) in [("height", "azimuth"), ("azimuth", "height"), ("place", "date"), ("date", "place")] {
            if f.has(word) && !f.has(other) {
                let message = format!("the sun needs both {word} and {other}, but {other} is missing");
                self.validator.report.error(f.span(word), message);
                self.valid = false;
                return None;
            }
        }
        let ways: Vec<&str> = ["sun", "height", "place"].into_iter().filter(|word| f.has(word)).collect();
        if let [first, second, ..] = ways[..] {
            let message = Message::error(f.span(second), format!("the sun's place is said by {first} already"));
            self.validator.report.push(message.help("it takes either sun, or height and azimuth, or place and date"));
            self.valid = false;
            return None;
        }
        match ways.first() {
            None => Some(Sky::default().sun),
            Some(&"sun") => f.vec("sun"),
            Some(&"height") => {
                let (height, azimuth) = (f.number("height")?, f.number("azimuth")?);
                if !(0.0..=90.0).contains(&height) {
                    let message = format!("height is {height}; it must be between 0 and 90 degrees");
                    self.validator.report.error(f.span("height"), message);
                    self.valid = false;
                    return None;
                }
                Some(bearing(height, azimuth).as_vec3())
            }
            Some(_) => {
                let [latitude, longitude] = f.numbers("place")?;
                if !(-90.0..=90.0).contains(&latitude) || !(-180.0..=180.0).contains(&longitude) {
                    let message = format!(
                        "place is {latitude} {longitude}; it must be -90 to 90 degrees north and -180 to 180 degrees east"
                    );
                    self.validator.report.error(f.span("place"), message);
                    self.valid = false;
                    return None;
                }
                match moment(f.text("date")?) {
                    Ok(moment) => Some(moment.sun(latitude, longitude).as_vec3()),
                    Err(problem) => {
                        let message = Message::error(f.span("date"), problem);
                        self.validator.report.push(
                            message.help("write date \"2026-06-21T11:30+02:00\", or a Z at the end for universal time"),
                        );
                        self.valid = false;
                        None
                    }
                }
            }
        }
    }
}

/// Parses a date and time in the form of RFC 3339, with or without seconds.
fn moment(text: &str) -> Result<Moment, String> {
    let form = || format!("\"{}\" is no date with a time", text.chars().take(40).collect::<String>());
    let number = |digits: &str, length: usize| -> Result<u32, String> {
        let digits = Some(digits).filter(|d| d.len() == length && d.bytes().all(|b| b.is_ascii_digit()));
        digits.and_then(|d| d.parse().ok()).ok_or_else(form)
    };
    let (date, time) = text.split_once(['T', 't', ' ']).ok_or_else(form)?;
    let [year, month, day] = date.splitn(3, '-').collect::<Vec<_>>()[..] else { return Err(form()) };
    let (year, month, day) = (number(year, 4)?, number(month, 2)?, number(day, 2)?);
    let clock = |text: &str| -> Result<f64, String> {
        let parts: Vec<&str> = text.split(':').collect();
        let ([hours, minutes] | [hours, minutes, _]) = parts[..] else { return Err(form()) };
        let (hours, minutes) = (number(hours, 2)?, number(minutes, 2)?);
        let seconds = parts.get(2).map_or(Ok(0), |seconds| number(seconds, 2))?;
        if hours > 24 || minutes > 59 || seconds > 60 {
            return Err(format!("{text} is no time of day"));
        }
        Ok(f64::from(hours) + f64::from(minutes) / 60.0 + f64::from(seconds) / 3600.0)
    };
    let hours = match time.strip_suffix(['Z', 'z']) {
        Some(time) => clock(time)?,
        None => {
            let at = time.rfind(['+', '-']).ok_or_else(|| format!("{}: its zone is missing", form()))?;
            let ahead = clock(&time[at + 1..])?;
            clock(&time[..at])? - if time[at..].starts_with('-') { -ahead } else { ahead }
        }
    };
    Moment::new(year as i32, month, day, hours)
}

#[cfg(test)]
mod tests {
    use super::moment;

    #[test]
    fn zones_are_taken_off() {
        let same = moment("2026-06-21T09:30Z").unwrap();
        for text in ["2026-06-21T11:30+02:00", "2026-06-21 04:00:00-05:30", "2026-06-22T00:30+15:00"] {
            assert_eq!(moment(text).unwrap().sun(45.0, 12.0), same.sun(45.0, 12.0), "{text}");
        }
    }

    #[test]
    fn texts_that_are_no_dates() {
        for text in [
            "",
            "T",
            "2026",
            "2026-06-21",
            "2026-06-21T",
            "2026-06-21T9:30Z",
            "2026-06-21T09:30",
            "2026-6-21T09:30Z",
            "2026-06-31T09:30Z",
            "2026-06-21T25:30Z",
            "2026-06-21T09:61Z",
            "2026-06-21T09:30+é",
            "1900-01-01T00:00Z",
            "+026-06-21T09:30Z",
            "2026-06-21T09:30:00:00Z",
        ] {
            assert!(moment(text).is_err(), "{text}");
        }
    }
}
