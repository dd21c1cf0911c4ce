//! Decoding of textures that aren't images: ramps, voxel grids and procedural functions.

use super::Decoder;
use super::fields::Fields;
use crate::assets::AssetPath;
use crate::image::read_image;
use crate::text::report::Message;
use crate::text::schema::{DEFAULT_JITTER, DEFAULT_MARBLE, DEFAULT_RAMP_WRAP, DEFAULT_WOOD, VoxelFormat};
use crate::text::syntax::Span;
use canaletto::OutOfRange;
use canaletto::math::Rgb;
use canaletto::texture::{
    ColorSpace, Function, GridTexture, Image, Prefilter, Procedural, Ramp, Samples, Spectrum, Stop,
};

/// The largest number of slices in a stack.
const MAX_SLICES: u32 = 1 << 14;

impl Decoder<'_> {
    /// Decodes a procedural function or a ramp.
    pub(super) fn procedural(&mut self, kind: &str, f: &Fields) -> Option<Procedural> {
        let wrap = f.named("wrap").unwrap_or(DEFAULT_RAMP_WRAP);
        let d = Spectrum::default();
        let spectrum = Spectrum {
            octaves: f.count("octaves").unwrap_or(d.octaves),
            lacunarity: f.real("lacunarity").unwrap_or(d.lacunarity),
            gain: f.real("gain").unwrap_or(d.gain),
        };
        let strength = |usual: f32| f.real("strength").unwrap_or(usual);
        let function = match kind {
            "checker" => Function::Checker,
            "noise" => Function::Noise,
            "fbm" => Function::Fbm(spectrum),
            "turbulence" => Function::Turbulence(spectrum),
            "marble" => Function::Marble { spectrum, strength: strength(DEFAULT_MARBLE) },
            "wood" => Function::Wood { spectrum, strength: strength(DEFAULT_WOOD) },
            "worley" => Function::Worley {
                feature: f.named("feature").unwrap_or_default(),
                jitter: f.real("jitter").unwrap_or(DEFAULT_JITTER),
            },
            // A ramp is a gradient along u.
            _ => Function::Gradient { shape: f.named("shape").unwrap_or_default(), wrap },
        };
        let texture = Procedural { function, ramp: self.ramp(f)?, seed: f.count("seed").unwrap_or(0) };
        if let Err(problem) = texture.check() {
            let with_alpha = problem.field == Some("stops") && f.has("stops-alpha");
            let field = if with_alpha { Some("stops-alpha") } else { problem.field };
            self.out_of_range(f, &OutOfRange { field, ..problem });
            return None;
        }
        Some(texture)
    }

    fn ramp(&mut self, f: &Fields) -> Option<Ramp> {
        let opaque = |c: Rgb| [c.r, c.g, c.b, 1.0];
        if f.has("even") || f.has("odd") {
            self.doubt_reflectance(f, &["even", "odd"]);
            let even = f.rgb("even").unwrap_or(Rgb::BLACK);
            let odd = f.rgb("odd").unwrap_or(Rgb::WHITE);
            let stops = vec![Stop { at: 0.0, color: opaque(even) }, Stop { at: 1.0, color: opaque(odd) }];
            return Some(Ramp { stops, ..Ramp::default() });
        }
        if f.has("stops") && f.has("stops-alpha") {
            let span = f.span("stops-alpha");
            self.validator.report.error(span, "colours stand in stops or in stops-alpha, not in both");
            return None;
        }
        let numbers = |word: &str| -> Vec<f32> {
            let values = f.raw(word).map_or(&[][..], |got| got.values);
            values.iter().filter_map(|v| v.as_number().map(|n| n as f32)).collect()
        };
        let stops: Vec<Stop> = if f.has("stops-alpha") {
            let stop = |v: &[f32]| Stop { at: v[0], color: [v[1], v[2], v[3], v[4]] };
            numbers("stops-alpha").chunks_exact(5).map(stop).collect()
        } else if f.has("stops") {
            let stop = |v: &[f32]| Stop { at: v[0], color: [v[1], v[2], v[3], 1.0] };
            numbers("stops").chunks_exact(4).map(stop).collect()
        } else {
            Ramp::default().stops
        };
        let interpolation = f.named("interpolation").unwrap_or_default();
        // The list is empty if its numbers were invalid, which was reported.
        (!stops.is_empty()).then_some(Ramp { stops, interpolation })
    }

    /// Decodes a voxel grid.
    pub(super) fn grid(&mut self, f: &Fields) -> Option<GridTexture> {
        let (image, slices) = match (f.has("file"), f.has("stack")) {
            (true, false) => self.raw_grid(f)?,
            (false, true) => self.stack(f)?,
            (both, _) => {
                let span = if both { f.span("stack") } else { f.node.name_span };
                let message = if both { "takes file or stack, not both" } else { "needs file or stack" };
                if f.valid {
                    self.validator.report.error(span, format!("a grid {message}"));
                }
                return None;
            }
        };
        let image = self.add_image(image, f.span(if f.has("file") { "file" } else { "stack" }))?;
        Some(GridTexture {
            image,
            slices,
            filter: f.named("filter").unwrap_or_default(),
            prefilter: f.named("prefilter").unwrap_or(Prefilter::Trilinear),
            wrap: f.named("wrap").unwrap_or_default(),
            placement: f.named("texels").unwrap_or_default(),
            space: f.named("space"),
        })
    }

    /// Reads a grid of raw numbers without a header.
    fn raw_grid(&mut self, f: &Fields) -> Option<(Image, u32)> {
        let (file, span) = (f.text("file")?, f.span("file"));
        if f.has("slices") {
            self.validator.report.error(f.span("slices"), "slices belongs to stack, not to file");
            return None;
        }
        let Some([width, height, depth]) = f.counts("size") else {
            if !f.has("size") {
                self.validator.report.error(span, "numbers without a header need size, the voxels along x, y and z");
            }
            return None;
        };
        let channels = f.count("channels").unwrap_or(1);
        if !(1..=4).contains(&channels) {
            let problem = format!("is {channels}; it must be between 1 and 4");
            self.out_of_range(f, &OutOfRange::new("channels", problem));
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
            self.validator.report.error(f.span("size"), message);
            return None;
        }
        let format = f.named("format").unwrap_or_default();
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
        let (pattern, span) = (f.text("stack")?, f.span("stack"));
        for word in ["size", "format", "channels"] {
            if f.has(word) {
                self.validator.report.error(f.span(word), format!("{word} belongs to file, not to stack"));
                return None;
            }
        }
        let Some([first, last]) = f.counts("slices") else {
            if !f.has("slices") {
                let message = "a stack needs slices, the numbers of its first and its last image";
                self.validator.report.error(span, message);
            }
            return None;
        };
        if last < first || last - first >= MAX_SLICES {
            let message = format!("slices must go upwards, with at most {MAX_SLICES} of them");
            self.validator.report.error(f.span("slices"), message);
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
            Ok((image, _)) => Some(image),
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
