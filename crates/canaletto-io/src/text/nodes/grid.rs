//! The node of voxel grids: numbers in a file without a header, or a stack of images.

use super::texture::{SPACE, TextureNode, kind, texture_node};
use crate::assets::AssetPath;
use crate::image::read_image;
use crate::text::decode::Decoder;
use crate::text::reader::Fields;
use crate::text::report::Message;
use crate::text::schema::{Field, Text, quoted};
use crate::text::syntax::Span;
use canaletto::texture::{ColorSpace, Filter, GridTexture, Image, Placement, Prefilter, Samples, TextureKind, Wrap};
use canaletto::{Named, OutOfRange, named};

/// The largest number of slices in a stack.
const MAX_SLICES: u32 = 1 << 14;

/// Grids have no EWA, the last of the prefilters.
const PREFILTERS: &[&str] = Prefilter::NAMES.split_at(2).0;

/// The numbers of a grid without a header.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum VoxelFormat {
    /// Bytes.
    #[default]
    U8,
    /// 16 bits without a sign.
    U16,
    /// Floating-point numbers.
    F32,
}

named!(VoxelFormat {
    U8 => "u8",
    U16 => "u16",
    F32 => "f32",
});

const KIND: Field<Text> = kind(&["grid"]).needed();
const FILE: Field<Text> =
    Field::text("file", "numbers without a header, the lowest byte first: x runs fastest, z slowest");
const SIZE: Field<[u32; 3]> = Field::new("size", "for `file`: voxels along x, y and z");
const FORMAT: Field<VoxelFormat> =
    Field::word("format", "for `file`: what its numbers are; whole ones stand for 0 to 1")
        .or(|| quoted(VoxelFormat::default().name()));
const CHANNELS: Field<u32> =
    Field::new("channels", "for `file`: numbers of each voxel, 1 grey, 2 grey and alpha, 3 RGB, 4 RGB and alpha")
        .or(|| "1".into());
const STACK: Field<Text> =
    Field::text("stack", "images of slices, `####` standing for their numbers: \"slice-###.png\"");
const SLICES: Field<[u32; 2]> = Field::new("slices", "for `stack`: the numbers of the first and the last slice");
const FILTER: Field<Filter> =
    Field::word("filter", "how voxels become a function").or(|| quoted(Filter::default().name()));
const PREFILTER: Field<Prefilter> = Field::one_of(
    "prefilter",
    PREFILTERS,
    "what is done where voxels are smaller than pixels: nothing, or the mean over a cube",
)
.or(|| quoted(Prefilter::Trilinear.name()));
const WRAP: Field<Wrap> = Field::word("wrap", "what is outside of the unit cube").or(|| quoted(Wrap::default().name()));
const TEXELS: Field<Placement> =
    Field::word("texels", "whether 0 and 1 are the centres of the outermost voxels or their outer edges")
        .or(|| quoted(Placement::default().name()));

pub(super) static GRID: TextureNode = texture_node(
    "A texture of space, stored: voxels in the unit cube, which covers the object's bounding box. They stand in a \
     `file` of numbers without a header, or in a `stack` of images.",
    &[&[
        KIND.schema,
        FILE.schema,
        SIZE.schema,
        FORMAT.schema,
        CHANNELS.schema,
        STACK.schema,
        SLICES.schema,
        FILTER.schema,
        PREFILTER.schema,
        WRAP.schema,
        TEXELS.schema,
        SPACE.schema,
    ]],
    "texture \"scan\" kind=\"grid\" stack=\"slice-##.png\" { slices 1 2; filter \"bicubic\"; wrap \"clamp\" }",
    |decoder, f| Some(TextureKind::Grid(decoder.grid(f)?)),
);

impl Decoder<'_> {
    /// Decodes a voxel grid.
    fn grid(&mut self, f: &Fields) -> Option<GridTexture> {
        let (image, slices) = match (f.has(&FILE), f.has(&STACK)) {
            (true, false) => self.raw_grid(f)?,
            (false, true) => self.stack(f)?,
            (both, _) => {
                let span = if both { f.span(&STACK) } else { f.node.name_span };
                let message = if both { "takes file or stack, not both" } else { "needs file or stack" };
                if f.valid {
                    self.validator.report.error(span, format!("a grid {message}"));
                }
                return None;
            }
        };
        let image = self.add_image(image, f.span(if f.has(&FILE) { &FILE } else { &STACK }))?;
        Some(GridTexture {
            image,
            slices,
            filter: f.word(&FILTER).unwrap_or_default(),
            prefilter: f.word(&PREFILTER).unwrap_or(Prefilter::Trilinear),
            wrap: f.word(&WRAP).unwrap_or_default(),
            placement: f.word(&TEXELS).unwrap_or_default(),
            space: f.word(&SPACE),
        })
    }

    /// Reads a grid of raw numbers without a header.
    fn raw_grid(&mut self, f: &Fields) -> Option<(Image, u32)> {
        let (file, span) = (f.text(&FILE)?, f.span(&FILE));
        if f.has(&SLICES) {
            self.validator.report.error(f.span(&SLICES), "slices belongs to stack, not to file");
            return None;
        }
        let Some([width, height, depth]) = f.get(&SIZE) else {
            if !f.has(&SIZE) {
                self.validator.report.error(span, "numbers without a header need size, the voxels along x, y and z");
            }
            return None;
        };
        let channels = f.get(&CHANNELS).unwrap_or(1);
        if !(1..=4).contains(&channels) {
            let problem = format!("is {channels}; it must be between 1 and 4");
            self.out_of_range(f, &OutOfRange::new(CHANNELS.name(), problem));
            return None;
        }
        let rows = u64::from(height) * u64::from(depth);
        let voxels = u128::from(width) * u128::from(rows);
        let side = u64::from(Image::MAX_SIDE);
        if voxels == 0 || voxels > Image::MAX_TEXELS.into() || rows > side || u64::from(width) > side {
            let message = format!(
                "size must give 1 to {} voxels, with {side} at most along x and in y times z",
                Image::MAX_TEXELS
            );
            self.validator.report.error(f.span(&SIZE), message);
            return None;
        }
        let format = f.word(&FORMAT).unwrap_or_default();
        let size = match format {
            VoxelFormat::U8 => 1,
            VoxelFormat::U16 => 2,
            VoxelFormat::F32 => 4,
        };
        let from = self.validator.files.get(span.file)?.path.clone();
        let asset = self.opened(file, span, &from)?;
        let expected = voxels * u128::from(channels) * size;
        if asset.bytes.len() as u128 != expected {
            let message = format!("\"{file}\" has {} bytes; this size and format need {expected}", asset.bytes.len());
            self.validator.report.error(span, message);
            return None;
        }
        let samples = match format {
            VoxelFormat::U8 => Samples::U8(asset.bytes),
            VoxelFormat::U16 => {
                Samples::U16(asset.bytes.chunks_exact(2).map(|b| u16::from_le_bytes([b[0], b[1]])).collect())
            }
            VoxelFormat::F32 => {
                let number = |b: &[u8]| f32::from_le_bytes([b[0], b[1], b[2], b[3]]);
                Samples::F32(asset.bytes.chunks_exact(4).map(number).collect())
            }
        };
        let image = Image {
            name: asset.path.name().to_owned(),
            width,
            height: rows as u32,
            channels: channels as u8,
            samples,
            space: ColorSpace::Linear,
            premultiplied: false,
        };
        if let Err(problem) = image.check() {
            self.validator.report.error(span, format!("\"{file}\": {problem}"));
            return None;
        }
        Some((image, depth))
    }

    /// Reads a stack of slice images.
    fn stack(&mut self, f: &Fields) -> Option<(Image, u32)> {
        let (pattern, span) = (f.text(&STACK)?, f.span(&STACK));
        let all = [(SIZE.name(), f.has(&SIZE)), (FORMAT.name(), f.has(&FORMAT)), (CHANNELS.name(), f.has(&CHANNELS))];
        if let Some((word, _)) = all.into_iter().find(|(_, given)| *given) {
            self.validator.report.error(f.span_of(word), format!("{word} belongs to file, not to stack"));
            return None;
        }
        let Some([first, last]) = f.get(&SLICES) else {
            if !f.has(&SLICES) {
                let message = "a stack needs slices, the numbers of its first and its last image";
                self.validator.report.error(span, message);
            }
            return None;
        };
        if last < first || last - first >= MAX_SLICES {
            let message = format!("slices must go upwards, with at most {MAX_SLICES} of them");
            self.validator.report.error(f.span(&SLICES), message);
            return None;
        }
        let digits = pattern.matches('#').count();
        if digits == 0 || !pattern.contains(&"#".repeat(digits)) {
            let message = Message::error(span, "a stack's name needs one place for the number");
            self.validator.report.push(message.help("for example: stack=\"slice-###.png\""));
            return None;
        }
        let from = self.validator.files.get(span.file)?.path.clone();
        let mut whole: Option<Image> = None;
        for number in first..=last {
            let name = pattern.replace(&"#".repeat(digits), &format!("{number:0digits$}"));
            let slice = self.slice(&name, span, &from)?;
            match &mut whole {
                None => whole = Some(slice),
                Some(all) => {
                    if let Err(problem) = append(all, slice, number - first) {
                        self.validator.report.error(span, format!("\"{name}\": {problem}"));
                        return None;
                    }
                }
            }
        }
        Some((whole?, last - first + 1))
    }

    fn slice(&mut self, name: &str, span: Span, from: &AssetPath) -> Option<Image> {
        let asset = self.opened(name, span, from)?;
        match read_image(&asset) {
            Ok((image, notes)) => {
                for note in notes {
                    self.validator.report.push(Message::warning(Some(span), format!("\"{name}\": {note}")));
                }
                Some(image)
            }
            Err(error) => {
                let message = Message::error(span, format!("\"{name}\": {error}"));
                self.validator.report.push(match error.help() {
                    Some(help) => message.help(help),
                    None => message,
                });
                None
            }
        }
    }
}

/// Appends a slice below the `count` slices of the image.
fn append(all: &mut Image, slice: Image, count: u32) -> Result<(), String> {
    let rows = all.height / count;
    if (slice.width, slice.height, slice.channels, slice.space) != (all.width, rows, all.channels, all.space) {
        return Err(format!(
            "it has {} × {} pixels of {} channels, the first slice {} × {rows} of {}",
            slice.width, slice.height, slice.channels, all.width, all.channels
        ));
    }
    let height = u64::from(all.height) + u64::from(rows);
    if height > u64::from(Image::MAX_SIDE) || height * u64::from(all.width) > Image::MAX_TEXELS {
        return Err(format!("with it the stack has more than {} voxels", Image::MAX_TEXELS));
    }
    match (&mut all.samples, slice.samples) {
        (Samples::U8(data), Samples::U8(more)) => data.extend(more),
        (Samples::U16(data), Samples::U16(more)) | (Samples::F16(data), Samples::F16(more)) => data.extend(more),
        (Samples::F32(data), Samples::F32(more)) => data.extend(more),
        _ => return Err("its numbers have another precision than the first slice's".into()),
    }
    all.height = height as u32;
    Ok(())
}
