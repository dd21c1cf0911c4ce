//! The nodes of environments. The word right after `environment` selects the schema and its reader.

use super::kind_of;
use crate::text::decode::Decoder;
use crate::text::reader::Fields;
use crate::text::report::Message;
use crate::text::schema::{Field, FieldSchema, NodeSchema, Numbers, Text, flag, numbers, quoted, rgb};
use crate::text::syntax::Node;
use canaletto::Named;
use canaletto::light::environment::{Environment, EnvironmentKind, Face, Gradient, Moment, Sky, Smoothing, bearing};
use canaletto::math::Rgb;
use glam::Vec3;

/// The word of environments.
pub(crate) const ENVIRONMENT: &str = "environment";

/// A kind of environment with its reader.
pub(crate) struct EnvironmentNode {
    pub(crate) schema: NodeSchema,
    read: fn(&mut Decoder, &Fields) -> Option<EnvironmentKind>,
}

/// The kinds of environments, in the order of the reference.
pub(crate) static ENVIRONMENTS: &[&EnvironmentNode] = &[&CUBE, &CROSS, &LAT_LONG, &GRADIENT, &SKY];

/// The schema of a kind of environment.
pub(crate) fn environment(kind: &str) -> Option<&'static NodeSchema> {
    ENVIRONMENTS.iter().map(|node| &node.schema).find(|schema| kind_of(schema) == kind)
}

const fn environment_node(
    kind: &'static [&'static str],
    doc: &'static str,
    words: &'static [&'static [FieldSchema]],
    example: &'static str,
    read: fn(&mut Decoder, &Fields) -> Option<EnvironmentKind>,
) -> EnvironmentNode {
    let kind = Field::kind(kind, "the kind of environment").needed();
    let schema = NodeSchema::new(ENVIRONMENT, doc, words).argument(kind.schema).transforms().example(example);
    EnvironmentNode { schema, read }
}

const INTENSITY: Field<Rgb> = Field::new("intensity", "multiplies all that is seen of it").or(|| rgb(Rgb::WHITE));
const AMBIENT: Field<bool> =
    Field::new("ambient", "whether its mean over all directions is added to the scene's ambient light")
        .or(|| flag(false));
const VISIBLE: Field<bool> = Field::new(
    "visible",
    "#false shows the background's colour where the camera would see the environment straight on; it lights and is \
     mirrored all the same",
)
.or(|| flag(true));
/// The fields of all environments.
const ALL: &[FieldSchema] = &[INTENSITY.schema, AMBIENT.schema, VISIBLE.schema];

const FILTER: Field<Smoothing> = Field::word(
    "filter",
    "how texels become a function; bilinear reaches over all edges and averages what is small in the picture",
)
.or(|| quoted(Smoothing::default().name()));

fn smoothing(f: &Fields) -> Smoothing {
    f.word(&FILTER).unwrap_or_default()
}

const fn face(face: usize, doc: &'static str) -> Field<Text> {
    Field::text(Face::NAMES[face], doc).needed()
}

/// The pictures of a cube's faces, in the order of [`Face::ALL`].
const FACES: [Field<Text>; 6] = [
    face(0, "the picture towards +x, y upwards"),
    face(1, "towards −x, y upwards"),
    face(2, "towards +y, after turning up from the front"),
    face(3, "towards −y, after turning down from the front"),
    face(4, "towards −z, y upwards"),
    face(5, "towards +z, y upwards"),
];

static CUBE: EnvironmentNode = environment_node(
    &["cube"],
    "Six square pictures of one size: what a camera with a right angle of view sees from the middle of the cube. px, \
     nx, \
     py, ny, pz, nz of sets made for graphics cards are right, left, top, bottom, front, back.",
    &[
        &[FACES[0].schema, FACES[1].schema, FACES[2].schema, FACES[3].schema, FACES[4].schema, FACES[5].schema],
        &[FILTER.schema],
        ALL,
    ],
    "environment \"cube\" \
     { right \"px.png\"; left \"nx.png\"; top \"py.png\"; bottom \"ny.png\"; front \"pz.png\"; back \"nz.png\" }",
    |decoder, f| {
        let faces = FACES.map(|face| decoder.image_of(f, &face));
        let faces: Option<Vec<u32>> = faces.into_iter().collect();
        Some(EnvironmentKind::Cube { faces: faces?.try_into().ok()?, smoothing: smoothing(f) })
    },
);

const FILE: Field<Text> = Field::text("file", "the picture").needed();

static CROSS: EnvironmentNode = environment_node(
    &["cross"],
    "The same six pictures in one, which is 4 × 3 squares (left, front, right and back in the middle row, top and \
     bottom above \
     and below the front) or 3 × 4 (left, front and right; below the front the bottom, and the back on its head).",
    &[&[FILE.schema], &[FILTER.schema], ALL],
    "environment \"cross\" file=\"cross.png\" { rotate-y 45 }",
    |decoder, f| Some(EnvironmentKind::Cross { image: decoder.image_of(f, &FILE)?, smoothing: smoothing(f) }),
);

static LAT_LONG: EnvironmentNode = environment_node(
    &["lat-long"],
    "One picture of all directions, twice as wide as high: −z in its middle, +x at three quarters, +y along its upper \
     edge.",
    &[&[FILE.schema], &[FILTER.schema], ALL],
    "environment \"lat-long\" file=\"studio.png\" { rotate-y 90; intensity 2 }",
    |decoder, f| {
        let image = decoder.image_of(f, &FILE)?;
        if let Some(image) = decoder.scene.images.get(image as usize)
            && u64::from(image.width) != 2 * u64::from(image.height)
        {
            let (w, h) = (image.width, image.height);
            let message = format!("the picture is {w} × {h} pixels; a latitude-longitude one is twice as wide as high");
            let message = Message::warning(Some(f.span(&FILE)), message);
            decoder.validator.report.push(message.help("it is stretched over all directions"));
        }
        Some(EnvironmentKind::LatLong { image, smoothing: smoothing(f) })
    },
);

const STOPS: Field<Numbers> = Field::groups(
    "stops",
    4,
    "degrees above the horizon, from -90 to 90 and growing, each with the colour `r g b` there; linear in between",
)
.colors()
.needed();

static GRADIENT: EnvironmentNode = environment_node(
    &["gradient"],
    "Colours by height above the horizon.",
    &[&[STOPS.schema], ALL],
    "environment \"gradient\" { stops -90 0.2 0.18 0.15  0 0.8 0.85 0.9  90 0.1 0.3 0.7 }",
    |_, f| {
        let numbers: Vec<f32> = f.all(&STOPS)?.into_iter().map(|v| v as f32).collect();
        let stops = numbers.chunks_exact(4).map(|s| (s[0], Rgb::new(s[1], s[2], s[3]))).collect();
        Some(EnvironmentKind::Gradient(Gradient { stops }))
    },
);

const SUN: Field<Vec3> = Field::new("sun", "the direction to the sun").or(|| numbers(Sky::default().sun.to_array()));
const HEIGHT: Field<f64> = Field::new(
    "height",
    "its height above the horizon, -90 to 90 degrees; below it is twilight, then night; goes with azimuth",
);
const AZIMUTH: Field<f64> = Field::new("azimuth", "its compass bearing in degrees: 0 north, 90 east; goes with height");
const PLACE: Field<[f64; 2]> = Field::new("place", "degrees north and east of a place on earth; goes with date");
const DATE: Field<Text> =
    Field::text("date", "when: \"2026-06-21T09:30Z\" or, hours ahead of UTC, \"2026-06-21T11:30+02:00\"");
const TURBIDITY: Field<f32> =
    Field::new("turbidity", "2 very clear, 3 clear, 6 hazy, 10 thick").or(|| Sky::default().turbidity.to_string());
const GROUND: Field<Rgb> = Field::new("ground", "what the ground below the horizon returns of the light, 0 to 1")
    .or(|| rgb(Sky::default().ground));
const EXPOSURE: Field<f32> =
    Field::new("exposure", "stops: each doubles the light").or(|| Sky::default().exposure.to_string());
const DISK: Field<bool> = Field::new("disk", "whether the sun's disk is seen").or(|| flag(Sky::default().disk));
const LIGHT: Field<bool> = Field::new("light", "whether the sun lights the scene: a directional light called \"sun\"")
    .or(|| flag(Sky::default().light));

static SKY: EnvironmentNode = environment_node(
    &["sky"],
    "A physical sky with its sun. y is up; +x is east and −z north. The sun stands in a direction, at a height \
     and \
     azimuth, or where it is at a place and time.",
    &[
        &[
            SUN.schema,
            HEIGHT.schema,
            AZIMUTH.schema,
            PLACE.schema,
            DATE.schema,
            TURBIDITY.schema,
            GROUND.schema,
            EXPOSURE.schema,
            DISK.schema,
            LIGHT.schema,
        ],
        ALL,
    ],
    "environment \"sky\" { place 45.44 12.33; date \"2026-05-01T10:00+02:00\"; turbidity 3; ambient }",
    |decoder, f| {
        let d = Sky::default();
        Some(EnvironmentKind::Sky(Sky {
            sun: decoder.sun(f)?,
            turbidity: f.get(&TURBIDITY).unwrap_or(d.turbidity),
            ground: f.get(&GROUND).unwrap_or(d.ground),
            exposure: f.get(&EXPOSURE).unwrap_or(d.exposure),
            disk: f.get(&DISK).unwrap_or(d.disk),
            light: f.get(&LIGHT).unwrap_or(d.light),
        }))
    },
);

/// The forms in which the sun's direction is given.
#[derive(Clone, Copy)]
enum SunForm {
    /// A direction.
    Direction,
    /// A height and an azimuth.
    Angles,
    /// A place and a date.
    PlaceAndTime,
}

impl Decoder<'_> {
    /// Decodes an environment node, which replaces the one before.
    pub(crate) fn environment(&mut self, node: &Node) -> Option<Environment> {
        let kinds: Vec<&'static str> = ENVIRONMENTS.iter().map(|node| kind_of(&node.schema)).collect();
        let index = self.kind_after(node, ENVIRONMENT, &kinds)?;
        let EnvironmentNode { schema, read } = ENVIRONMENTS[index];
        let fields = self.validator.fields(node, schema, &format!("environment \"{}\"", kinds[index]));
        let rotation = self.transform(&fields);
        self.valid &= fields.valid;
        // Missing words were reported; the files are checked nevertheless.
        let decoded = read(self, &fields);
        let environment = Environment {
            rotation,
            intensity: fields.get(&INTENSITY).unwrap_or(Rgb::WHITE),
            ambient: fields.get(&AMBIENT).unwrap_or(false),
            visible: fields.get(&VISIBLE).unwrap_or(true),
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

    fn image_of(&mut self, f: &Fields, field: &Field<Text>) -> Option<u32> {
        let image = self.image(f.text(field)?, f.span(field));
        self.valid &= image.is_some();
        if let Some(image) = image.and_then(|image| self.scene.images.get(image as usize)) {
            let are = match image.samples.count_negative(image.channels) {
                0 => None,
                1 => Some("one of its texels is negative and taken".to_owned()),
                n => Some(format!("{n} of its texels are negative and taken")),
            };
            let warn = |are| format!("\"{}\": {are} as 0, since no environment takes light away", image.name);
            if let Some(are) = are {
                self.validator.report.push(Message::warning(Some(f.span(field)), warn(are)));
            }
        }
        image
    }

    /// The direction to the sun, given in one of three forms.
    fn sun(&mut self, f: &Fields) -> Option<Vec3> {
        let [height, azimuth] = [(HEIGHT.name(), f.has(&HEIGHT)), (AZIMUTH.name(), f.has(&AZIMUTH))];
        let [place, date] = [(PLACE.name(), f.has(&PLACE)), (DATE.name(), f.has(&DATE))];
        for ((word, given), (other, other_given)) in
            [(height, azimuth), (azimuth, height), (place, date), (date, place)]
        {
            if given && !other_given {
                let message = format!("the sun needs both {word} and {other}, but {other} is missing");
                return self.no_sun(Message::error(f.span_of(word), message));
            }
        }
        let forms = [
            (SunForm::Direction, SUN.name(), f.has(&SUN)),
            (SunForm::Angles, HEIGHT.name(), f.has(&HEIGHT)),
            (SunForm::PlaceAndTime, PLACE.name(), f.has(&PLACE)),
        ];
        let given: Vec<(SunForm, &str)> =
            forms.into_iter().filter(|(.., given)| *given).map(|(form, word, _)| (form, word)).collect();
        if let [(_, first), (_, second), ..] = given[..] {
            let message = Message::error(f.span_of(second), format!("the sun's place is said by {first} already"));
            return self.no_sun(message.help("it takes either sun, or height and azimuth, or place and date"));
        }
        match given.first() {
            None => Some(Sky::default().sun),
            Some((SunForm::Direction, _)) => f.get(&SUN),
            Some((SunForm::Angles, _)) => {
                let (height, azimuth) = (f.get(&HEIGHT)?, f.get(&AZIMUTH)?);
                if !(-90.0..=90.0).contains(&height) {
                    let message = format!("height is {height}; it must be between -90 and 90 degrees");
                    return self.no_sun(Message::error(f.span(&HEIGHT), message));
                }
                Some(bearing(height, azimuth).as_vec3())
            }
            Some((SunForm::PlaceAndTime, _)) => {
                let [latitude, longitude] = f.get(&PLACE)?;
                if !(-90.0..=90.0).contains(&latitude) || !(-180.0..=180.0).contains(&longitude) {
                    let message = format!(
                        "place is {latitude} {longitude}; it must be -90 to 90 degrees north and -180 to 180 degrees \
                         east"
                    );
                    return self.no_sun(Message::error(f.span(&PLACE), message));
                }
                match moment(f.text(&DATE)?) {
                    Ok(moment) => Some(moment.sun(latitude, longitude).as_vec3()),
                    Err(problem) => {
                        let message = Message::error(f.span(&DATE), problem);
                        self.no_sun(
                            message.help("write date \"2026-06-21T11:30+02:00\", or a Z at the end for universal time"),
                        )
                    }
                }
            }
        }
    }

    /// Reports why the sun has no direction.
    fn no_sun(&mut self, message: Message) -> Option<Vec3> {
        self.validator.report.push(message);
        self.valid = false;
        None
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
