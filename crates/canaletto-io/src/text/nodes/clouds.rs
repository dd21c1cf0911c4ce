//! The nodes of clouds: numbers in the node, lines of a text, or a file.

use super::shapes::{CAPS, DEFAULT_CAPS};
use super::{CASTS_SHADOW, MATERIAL, NAME, ObjectNode, ObjectReader};
use crate::assets::{Asset, AssetPath, Assets};
use crate::diagnostic::Diagnostics;
use crate::import::{self, CloudFormat, CloudSettings, Colormap, ColumnColors};
use crate::text::decode::Decoder;
use crate::text::files::Files;
use crate::text::reader::Fields;
use crate::text::report::Message;
use crate::text::schema::{Block, Field, FieldSchema, NodeSchema, Numbers, Text};
use crate::text::syntax::{Span, Value};
use canaletto::OutOfRange;
use canaletto::math::Rgb;
use canaletto::scene::Content;
use canaletto::shape::{CylinderCloud, SphereCloud};
use canaletto::texture::ColorSpace;
use glam::DVec3;

const POINTS: Field<Numbers> = Field::groups("points", 3, "the centres");
const AXES: Field<Numbers> = Field::groups("axes", 6, "the two ends of each axis");
const DATA: Field<Text> =
    Field::text("data", "lines of `x y z`, `x y z radius`, `x y z r g b` or `x y z radius r g b`; # starts a comment");
const CYLINDER_DATA: Field<Text> = Field::text(
    DATA.name(),
    "lines of `x y z x y z`, each with a radius, a colour `r g b` or both behind it; # starts a comment",
);
const CLOUD_FILE: Field<Text> =
    Field::text("file", "a file with them: .csv, .tsv, .xyz, .txt, .ply, .npy, .npz or .bin; see below");
const RADIUS: Field<f32> = Field::new("radius", "the radius of those that have none of their own");
const COLORS: Field<ColorSpace> = Field::one_of(
    "colors",
    &["srgb", "linear"],
    "what the numbers of the table's colours are; numbers beyond 1 are shares of 255 or 65535 with \"srgb\", and light \
     brighter than white with \"linear\"",
)
.or(|| "by their type and size".into());
const COLUMNS: Field<Text> = Field::text(
    "columns",
    "the names of all columns of the file in their order, such as \"x y z heat\", in place of those in it",
);
const ARRAY: Field<Text> = Field::text("array", "the array of an .npz file that has several");
const COLORMAP_FIELD: Field<Block> =
    Field::block(&COLORMAP, "colours by the numbers of a column, in place of the table's own; see below");

const MAP: Field<Colormap> = Field::word("map", "the colour map of matplotlib").needed();
const COLUMN: Field<Text> = Field::text("column", "the column's name, or its number from 1 on").needed();
const LEAST: Field<f64> =
    Field::new("min", "the number that has the first colour, as have those beyond").or(|| "the column's least".into());
const MOST: Field<f64> = Field::new("max", "the number that has the last colour; less than min turns the map round")
    .or(|| "the column's largest".into());

/// `colormap` in a cloud.
pub(crate) static COLORMAP: NodeSchema = NodeSchema::new(
    "colormap",
    "Colours of a table by the numbers of a column.",
    &[&[COLUMN.schema, LEAST.schema, MOST.schema]],
)
.argument(MAP.schema);

/// The fields that say how a table is read.
const TABLE: &[FieldSchema] = &[COLORS.schema, COLORMAP_FIELD.schema, COLUMNS.schema, ARRAY.schema];

pub(super) static SPHERES: ObjectNode = ObjectNode {
    schema: NodeSchema::new(
        "spheres",
        "A cloud: many spheres as one object, up to many millions. They stand in `points`, `data` or `file`.",
        &[
            &[POINTS.schema, DATA.schema, CLOUD_FILE.schema, RADIUS.schema],
            TABLE,
            &[NAME.schema, MATERIAL.schema, CASTS_SHADOW.schema],
        ],
    )
    .argument(NAME.schema)
    .transforms()
    .example("spheres radius=1 material=\"blue\" { points 0 0 0  2 0 0  4 0 0 }"),
    read: ObjectReader::Content(|decoder, f, _| decoder.spheres(f)),
};

pub(crate) static CYLINDERS: ObjectNode = ObjectNode {
    schema: NodeSchema::new(
        "cylinders",
        "A cloud of cylinders. They stand in `axes`, `data` or `file`.",
        &[
            &[AXES.schema, CYLINDER_DATA.schema, CLOUD_FILE.schema, RADIUS.schema, CAPS.schema],
            TABLE,
            &[NAME.schema, MATERIAL.schema, CASTS_SHADOW.schema],
        ],
    )
    .argument(NAME.schema)
    .transforms()
    .example("cylinders radius=0.5 { axes 0 0 0 0 5 0  2 0 0 2 5 0 }"),
    read: ObjectReader::Content(|decoder, f, _| decoder.cylinders(f)),
};

/// The largest number of mistakes that are reported for one cloud.
const MAX_MISTAKES: usize = 20;

/// The places of a cloud's numbers.
#[derive(Clone, Copy)]
enum Source {
    /// A field of numbers in the node.
    Inline,
    /// Lines of a text in the node.
    Data,
    /// A file.
    File,
}

/// Rows of numbers.
struct Rows {
    columns: usize,
    numbers: Vec<f64>,
}

impl Decoder<'_> {
    /// Decodes a cloud of spheres.
    fn spheres(&mut self, f: &Fields) -> Option<Content> {
        let cloud = match self.source(f, &POINTS)? {
            Source::File => self.of_file("spheres", f, import::read_spheres)?,
            source => {
                let rows = self.rows(f, source, &POINTS, 3)?;
                let centers = rows.numbers.chunks_exact(rows.columns).map(DVec3::from_slice);
                let (origin, centers) = import::counted(centers);
                let (radii, colors) = self.rest(f, &rows, 3)?;
                self.rounded(f, import::inline_cloud(&centers, 1, &radii, origin));
                SphereCloud { name: name(f), origin, centers, radii, colors, rows: Vec::new() }
            }
        };
        if let Err(problem) = cloud.check() {
            self.out_of_range(f, &problem);
        }
        self.scene.spheres.push(cloud);
        Some(Content::Spheres(self.scene.spheres.len() as u32 - 1))
    }

    /// Decodes a cloud of cylinders.
    fn cylinders(&mut self, f: &Fields) -> Option<Content> {
        let mut cloud = match self.source(f, &AXES)? {
            Source::File => self.of_file("cylinders", f, import::read_cylinders)?,
            source => {
                let rows = self.rows(f, source, &AXES, 6)?;
                let ends = |row: &[f64]| [DVec3::from_slice(row), DVec3::from_slice(&row[3..])];
                let (origin, ends) = import::counted(rows.numbers.chunks_exact(rows.columns).flat_map(ends));
                let axes = ends.as_chunks().0.to_vec();
                let (radii, colors) = self.rest(f, &rows, 6)?;
                self.rounded(f, import::inline_cloud(&ends, 2, &radii, origin));
                CylinderCloud { name: name(f), origin, axes, radii, colors, rows: Vec::new(), caps: DEFAULT_CAPS }
            }
        };
        cloud.caps = f.get(&CAPS).unwrap_or(DEFAULT_CAPS);
        if let Err(problem) = cloud.check() {
            self.out_of_range(f, &problem);
        }
        self.scene.cylinders.push(cloud);
        Some(Content::Cylinders(self.scene.cylinders.len() as u32 - 1))
    }

    /// The place of the numbers, of which exactly one is required. `inline` is the field of numbers in the node.
    fn source(&mut self, f: &Fields, inline: &Field<Numbers>) -> Option<Source> {
        if let Some(radius) = f.get(&RADIUS).filter(|radius| *radius <= 0.0) {
            self.out_of_range(f, &OutOfRange::new(RADIUS.name(), format!("is {radius}; it must be more than 0")));
            return None;
        }
        let all = [
            (Source::Inline, inline.name(), f.has(inline)),
            (Source::Data, DATA.name(), f.has(&DATA)),
            (Source::File, CLOUD_FILE.name(), f.has(&CLOUD_FILE)),
        ];
        let given: Vec<(Source, &str)> =
            all.into_iter().filter(|(.., has)| *has).map(|(source, word, _)| (source, word)).collect();
        match given.as_slice() {
            [(source, _)] => Some(*source),
            [] => {
                if f.valid {
                    let message =
                        format!("{} needs {}, {} or {}", f.node.name, inline.name(), DATA.name(), CLOUD_FILE.name());
                    self.validator.report.error(f.node.name_span, message);
                }
                None
            }
            [(_, first), (_, second), ..] => {
                let message =
                    format!("{} takes its numbers from one place, not from {first} and {second}", f.node.name);
                self.validator.report.error(f.span_of(second), message);
                None
            }
        }
    }

    /// The rows in the node itself or in a text.
    fn rows(&mut self, f: &Fields, source: Source, inline: &Field<Numbers>, columns: usize) -> Option<Rows> {
        self.without_file(f);
        match source {
            Source::Inline => Some(Rows { columns, numbers: f.all(inline)? }),
            Source::Data => self.data(f, columns),
            Source::File => None,
        }
    }

    /// The cache key of a cloud file with its radius.
    fn key(&self, kind: &str, f: &Fields, settings: &CloudSettings) -> Option<String> {
        let from = self.validator.files.get(f.span(&CLOUD_FILE).file)?.path.location().display().to_string();
        Some(format!("{kind} {} {from} {settings:?}", f.text(&CLOUD_FILE)?))
    }

    /// What the node says of its table besides its file.
    fn table_settings(&mut self, f: &Fields) -> Option<CloudSettings> {
        let colormap = match self.block_or_word(f, &COLORMAP_FIELD) {
            None if f.has(&COLORMAP_FIELD) => return None,
            None => None,
            Some(Ok(inner)) => Some(ColumnColors {
                map: inner.word(&MAP)?,
                column: inner.text(&COLUMN)?.to_owned(),
                range: [inner.get(&LEAST), inner.get(&MOST)],
            }),
            Some(Err(word)) => {
                let message = Message::error(f.span(&COLORMAP_FIELD), "a colormap needs a column");
                let help = format!("colormap \"{word}\" column=\"…\" as a node, with the name of the column");
                self.validator.report.push(message.help(help));
                self.valid = false;
                return None;
            }
        };
        if let Some(ColumnColors { range: [Some(min), Some(max)], .. }) = &colormap
            && min == max
        {
            let message = format!("min and max of the colormap are both {min}; they must differ");
            self.validator.report.error(f.span(&COLORMAP_FIELD), message);
            self.valid = false;
        }
        let names = f.text(&COLUMNS).unwrap_or_default().split([' ', ',', '\t', '\n', '\r']);
        Some(CloudSettings {
            radius: f.get(&RADIUS),
            colors: f.word(&COLORS),
            colormap,
            columns: names.filter(|name| !name.is_empty()).map(str::to_lowercase).collect(),
            array: f.text(&ARRAY).map(str::to_owned),
        })
    }

    /// Reports fields that only a file's table has.
    fn without_file(&mut self, f: &Fields) {
        for (name, given) in [
            (COLORMAP_FIELD.name(), f.has(&COLORMAP_FIELD)),
            (COLUMNS.name(), f.has(&COLUMNS)),
            (ARRAY.name(), f.has(&ARRAY)),
        ] {
            if given {
                self.out_of_range(f, &OutOfRange::new(name, "is of the table in a file, and file is missing"));
            }
        }
    }

    /// The cloud of a file. `kind` names it in the cache.
    fn of_file<T: Clone + Send + Sync + 'static>(
        &mut self,
        kind: &str,
        f: &Fields,
        read: impl FnOnce(&Asset, CloudFormat, CloudSettings) -> Result<(T, Diagnostics), Diagnostics>,
    ) -> Option<T> {
        let settings = self.table_settings(f)?;
        let key = self.key(kind, f, &settings)?;
        let read = || {
            let (asset, format) = open(self.assets, self.validator.files, f)?;
            if f.has(&COLUMNS) && !matches!(format, CloudFormat::Text | CloudFormat::Numpy) {
                let message = "columns names those of a text, .npy or .npz; this file has its own names";
                return Err(Unread::Said(Message::error(f.span(&COLUMNS), message)));
            }
            if f.has(&ARRAY) && format != CloudFormat::Numpy {
                let message = "array names one of an .npz file, and this file is none";
                return Err(Unread::Said(Message::error(f.span(&ARRAY), message)));
            }
            read(&asset, format, settings).map_err(Unread::Wrong)
        };
        let read = self.keep.get(key, read);
        let (cloud, warnings) = self.unread(f, read)?;
        self.validator.report.append(warnings);
        Some(cloud)
    }

    /// Reports why a file yields no cloud.
    fn unread<T>(&mut self, f: &Fields, read: Result<T, Unread>) -> Option<T> {
        match read {
            Ok(cloud) => return Some(cloud),
            Err(Unread::Said(message)) => self.validator.report.push(message),
            Err(Unread::Wrong(errors)) => {
                self.file_failed(f.text(&CLOUD_FILE).unwrap_or_default(), f.span(&CLOUD_FILE), errors);
            }
        }
        None
    }

    /// Warns of coordinates whose rounding is visible.
    fn rounded(&mut self, f: &Fields, said: Option<[String; 2]>) {
        if let Some([message, help]) = said {
            self.validator.report.push(Message::warning(Some(f.node.name_span), message).help(help));
        }
    }

    /// The rows of a text; each starts with `lead` coordinates.
    fn data(&mut self, f: &Fields, lead: usize) -> Option<Rows> {
        let value = f.raw(&DATA)?.values.first()?;
        let text = value.as_text()?;
        let raw = self.validator.files.slice(value.span);
        let mut rows = Rows { columns: 0, numbers: Vec::new() };
        let mut mistakes: Vec<Message> = Vec::new();
        let mut first = None;
        for (line, span) in lines(raw, text, value) {
            if mistakes.len() == MAX_MISTAKES {
                break;
            }
            let before = rows.numbers.len();
            let line = line.split('#').next().unwrap_or_default();
            let good = read_line(line, span, &mut rows.numbers, &mut mistakes);
            let count = rows.numbers.len() - before;
            if !good || count == 0 {
                rows.numbers.truncate(before);
                continue;
            }
            let blank = (line.len() - line.trim_start().len()) as u32;
            let length = line.trim().len() as u32;
            let exact = (span.end - span.start) as usize >= line.len();
            let here =
                if exact { Span { start: span.start + blank, end: span.start + blank + length, ..span } } else { span };
            if ![lead, lead + 1, lead + 3, lead + 4].contains(&count) {
                let kind = if lead == 3 { "x y z" } else { "x y z x y z" };
                let help = format!("a line is {kind}, with a radius, a colour of 3 numbers or both behind it");
                mistakes.push(Message::error(here, format!("this line has {count} numbers")).help(help));
                rows.numbers.truncate(before);
            } else if rows.columns == 0 {
                (rows.columns, first) = (count, Some(here));
            } else if rows.columns != count {
                let place = first.map_or_else(String::new, |first| self.validator.files.first(first, here));
                let message = format!("this line has {count} numbers, the first one {}", rows.columns);
                mistakes.push(Message::error(here, message).label(place));
                rows.numbers.truncate(before);
            }
        }
        if rows.columns == 0 && mistakes.is_empty() {
            mistakes.push(Message::error(value.span, "data holds no numbers"));
        }
        let good = mistakes.is_empty();
        mistakes.into_iter().for_each(|message| self.validator.report.push(message));
        good.then_some(rows)
    }

    /// The radii and colours after the coordinates.
    fn rest(&mut self, f: &Fields, rows: &Rows, lead: usize) -> Option<(Vec<f32>, Vec<Rgb>)> {
        let behind = rows.columns - lead;
        let each = rows.numbers.chunks_exact(rows.columns);
        let radii = if behind == 1 || behind == 4 {
            each.clone().map(|row| row[lead] as f32).collect()
        } else if let Some(radius) = f.get(&RADIUS) {
            vec![radius]
        } else {
            if !f.has(&RADIUS) {
                let message = Message::error(f.node.name_span, format!("{} needs radius", f.node.name));
                self.validator
                    .report
                    .push(message.help("one for all: radius=1; or one behind the coordinates in each line of data"));
            }
            return None;
        };
        let colors = if behind < 3 {
            Vec::new()
        } else {
            let color = |row: &[f64]| Rgb::from([3, 2, 1].map(|back| row[rows.columns - back] as f32));
            let mut colors: Vec<Rgb> = each.map(color).collect();
            if let Some(space) = f.word(&COLORS) {
                for said in import::colors_of_rows(&mut colors, space) {
                    self.validator.report.push(Message::warning(Some(f.node.name_span), said));
                }
            }
            colors
        };
        Some((radii, colors))
    }
}

/// The reasons why a file yields no cloud.
enum Unread {
    /// The file can't be read.
    Said(Message),
    /// The content of the file is invalid.
    Wrong(Diagnostics),
}

fn open(assets: &dyn Assets, files: &Files, f: &Fields) -> Result<(Asset, CloudFormat), Unread> {
    let (file, span) = (f.text(&CLOUD_FILE).unwrap_or_default(), f.span(&CLOUD_FILE));
    let from = files.get(span.file).map(|file| file.path.clone()).unwrap_or_default();
    let extension = AssetPath::new(file, file, file).extension();
    let Some(format) = CloudFormat::of_extension(&extension) else {
        let known = CloudFormat::EXTENSIONS.join(", .");
        let message = Message::error(span, format!("clouds can't be read from \"{file}\""));
        return Err(Unread::Said(message.help(format!("the file's name must end in one of .{known}"))));
    };
    match assets.read(file, &from) {
        Ok(asset) => Ok((asset, format)),
        Err(error) => {
            let message = Message::error(span, error.to_string());
            Err(Unread::Said(match error.help() {
                Some(help) => message.help(help),
                None => message,
            }))
        }
    }
}

fn name(f: &Fields) -> String {
    f.text(&NAME).unwrap_or_default().to_owned()
}

/// The lines of a text with their spans in the file. The lines of a text with escapes share one span.
fn lines<'t>(raw: &'t str, text: &'t str, value: &'t Value) -> impl Iterator<Item = (&'t str, Span)> {
    let exact = raw.contains("\"\"\"") && (raw.starts_with('#') || !raw.contains('\\'));
    let body = if exact { raw } else { text };
    let count = body.split('\n').count();
    let mut at = value.span.start;
    let all = body.split('\n').enumerate().map(move |(index, line)| {
        let start = at;
        at += line.len() as u32 + 1;
        let place = if exact { Span { start, end: start + line.len() as u32, ..value.span } } else { value.span };
        (index, line, place)
    });
    // In the source, the first and last lines contain the quotes.
    all.filter(move |(index, ..)| !exact || (*index > 0 && index + 1 < count)).map(|(_, line, place)| (line, place))
}

/// Adds the numbers of a line; returns whether all its words were numbers.
fn read_line(line: &str, span: Span, numbers: &mut Vec<f64>, mistakes: &mut Vec<Message>) -> bool {
    let exact = span.end - span.start >= line.len() as u32;
    let separator = |c: char| c.is_whitespace() || c == ',' || c == ';';
    for word in line.split(separator).filter(|word| !word.is_empty()) {
        match word.parse::<f64>().ok().filter(|number| (*number as f32).is_finite()) {
            Some(number) => numbers.push(number),
            None => {
                let at = span.start + (word.as_ptr() as usize - line.as_ptr() as usize) as u32;
                let place = if exact { Span { start: at, end: at + word.len() as u32, ..span } } else { span };
                let short: String = word.chars().take(40).collect();
                mistakes.push(Message::error(place, format!("\"{short}\" isn't a finite number")));
                return false;
            }
        }
    }
    true
}
