//! `canaletto denoise`: a noisy picture without its noise.

mod independence;

use crate::command_files::{CommandFiles, FolderFlag};
use crate::denoiser::{Denoiser, blacken_uncovered, filled_told, lacks, of_image, told};
use crate::exit::Exit;
use crate::failure::{Failure, eprint_line};
use crate::flags::named;
use crate::layers::developed;
use crate::output::{check_files, picture_format, unfit, write_file};
use crate::picture_file::read_picture;
use crate::settings::list;
use crate::source::on_threads;
use crate::told_developing::{EXPOSURE, METERED_EXPOSURE, TONE, TRANSFER, ToldDeveloping};
use canaletto::Named;
use canaletto::denoise::NoisyPicture;
use canaletto::film::{Picture, metered_exposure};
use canaletto::math::Rgb;
use canaletto::render::Aov;
use canaletto::scene::{Developing, Exposure, Tone, Transfer};
use canaletto_io::diagnostic::visible;
use canaletto_io::picture::{Decoded, EncodeSettings, Image};
use clap::Args;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Removes the noise of a rendered picture.
///
/// The picture is an OpenEXR in linear light. Without colours of its own, its only layer of colours is taken, such as
/// ViewLayer.Combined. Its layers half-a and half-b tell how noisy each pixel is. Its layers
/// denoising-albedo, denoising-normal and denoising-depth tell where surfaces end. `canaletto render --aov` makes them.
/// A missing layer is named, and what is done without it.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct DenoiseFlags {
    /// The noisy picture
    #[arg(value_name = "PICTURE")]
    pub picture: PathBuf,

    /// The same scene with other samples, by --seed or --first-sample: both pictures are taken as two halves of one
    #[arg(value_name = "OTHER")]
    pub other: Option<PathBuf>,

    /// Sets the output file, .exr or .png
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,

    /// Chooses the denoiser
    #[arg(long, value_name = "NAME", default_value = "good")]
    pub denoiser: Denoiser,

    /// Sets the exposure of a PNG in stops, or auto [default: the one that the picture's file names, or 0]
    #[arg(long, value_name = "STOPS", allow_hyphen_values = true)]
    pub exposure: Option<Exposure>,

    /// Sets the tone mapping of a PNG [default: the one that the picture's file names, or clamp]
    #[arg(long, value_name = "HOW", value_parser = named::<Tone>())]
    pub tone: Option<Tone>,

    /// Sets the transfer curve of a PNG [default: the one that the picture's file names, or srgb]
    #[arg(long, value_name = "CURVE", value_parser = named::<Transfer>())]
    pub transfer: Option<Transfer>,

    /// Sets the number of threads [default: all processors]
    #[arg(long, value_name = "N")]
    pub threads: Option<u16>,

    /// Fails if the file exists already, instead of replacing it
    #[arg(long)]
    pub no_clobber: bool,

    #[command(flatten)]
    pub folder: FolderFlag,

    /// Prints errors only
    #[arg(short, long)]
    pub quiet: bool,
}

const EXAMPLES: &str = "\
Examples:
  canaletto render scenes/path.kdl --samples 32 --denoise
  canaletto render scenes/path.kdl --samples 32 -o noisy.exr \\
    --aov half-a,half-b,denoising-albedo,denoising-normal,denoising-depth
  canaletto denoise noisy.exr -o clean.exr
  canaletto denoise noisy.exr -o clean.png --denoiser fast";

/// Runs the command.
pub(crate) fn run(flags: &DenoiseFlags) -> Result<Exit, Failure> {
    on_threads(flags.threads, || denoise(flags))?
}

fn denoise(flags: &DenoiseFlags) -> Result<Exit, Failure> {
    let format = picture_format("--output", &flags.output)?;
    flags.denoiser.check()?;
    let files = CommandFiles::default().reads("PICTURE", [&flags.picture]).reads("OTHER", &flags.other);
    let files = files.writes("--output", [flags.output.clone()]);
    files.check()?;
    flags.folder.make_folders(&files)?;
    check_files([flags.output.clone()], &flags.output, flags.no_clobber)?;
    if let Some(other) = &flags.other {
        independence::check_files([&flags.picture, other])?;
    }
    let (decoded, mut noisy) = read(&flags.picture, flags.quiet)?;
    let name = flags.picture.display().to_string();
    if let Some(other) = &flags.other {
        let (second, half) = read(other, flags.quiet)?;
        let (a, b) = (&decoded.image, &second.image);
        if [a.width, a.height] != [b.width, b.height] {
            let message = format!(
                "{name} has {} x {} pixels, but {} has {} x {}",
                a.width,
                a.height,
                other.display(),
                b.width,
                b.height
            );
            return Err(Failure::new(Exit::Scene, message).help("both pictures show the same scene in the same size"));
        }
        independence::check([&flags.picture, other], [&decoded, &second], || noisy.color == half.color)?;
        let mean = noisy.color.iter().zip(&half.color).map(|(a, b)| (*a + *b) * 0.5).collect();
        noisy.halves = Some([std::mem::replace(&mut noisy.color, mean), half.color]);
    }
    if !flags.quiet
        && let Some(lacks) = lacks(&noisy)
    {
        eprint_line(&format!("note: {name}: {lacks}"));
    }
    let start = Instant::now();
    let Some(mut denoised) = flags.denoiser.run(noisy)? else { return Ok(Exit::Interrupted) };
    let alpha = decoded.image.channel("A").map(<[f32]>::to_vec).unwrap_or_default();
    blacken_uncovered(&mut denoised.color, &alpha);
    let time = start.elapsed();
    if denoised.filled.colors == denoised.color.len() as u64 {
        let message = format!("{name}: none of its pixels is light: all are NaN, infinite or negative");
        return Err(Failure::new(Exit::Scene, message).help("give the picture as it was rendered"));
    }
    let settings = EncodeSettings { window: Some(decoded.window), ..EncodeSettings::default() };
    let is_linear = format.capabilities().is_some_and(|can| can.linear);
    let colors = |pixels: &[Rgb]| pixels.iter().map(|c| c.to_array()).collect::<Vec<_>>();
    let [width, height] = [decoded.image.width, decoded.image.height];
    let bytes = if is_linear {
        let colors = colors(&denoised.color);
        let mut image = Image::from_rgb(width, height, colors.into_iter());
        // Other layers stay as they are; the noisy colours become one.
        for mut channel in decoded.image.channels {
            if ["R", "G", "B", "Y"].contains(&channel.name.as_str()) {
                channel.name = format!("{}.{}", Aov::Noisy.name(), channel.name);
            }
            image.channels.push(channel);
        }
        format.encode_image(&image, Transfer::None, &settings, &decoded.metadata)
    } else {
        let picture = Picture { pixels: denoised.color.clone(), alpha, ..Picture::new(width, height) };
        let mut texts = decoded.metadata;
        let developing = flags.developing(&mut texts, &picture);
        let settings = EncodeSettings { window: None, ..settings };
        format.encode_image(&developed(&picture, &developing), developing.transfer, &settings, &texts)
    };
    write_file(&flags.output, &bytes.map_err(|e| unfit(&e))?)?;
    if !flags.quiet {
        if let Some(filled) = filled_told(denoised.filled) {
            eprint_line(&format!("warning: {name}: {filled}"));
        }
        eprint_line(&told(&denoised, time));
    }
    Ok(Exit::Done)
}

impl DenoiseFlags {
    /// How the picture is developed: as the flags say, or as the texts of its file do, which get what is chosen.
    fn developing(&self, texts: &mut Vec<(String, String)>, picture: &Picture) -> Developing {
        let told = ToldDeveloping::of_texts(texts);
        let exposure = self.exposure.or(told.exposure).unwrap_or_default();
        let tone = self.tone.or(told.tone).unwrap_or_default();
        let transfer = self.transfer.or(told.transfer).unwrap_or_default();
        texts.retain(|(key, _)| ![EXPOSURE, METERED_EXPOSURE, TONE, TRANSFER].contains(&key.as_str()));
        texts.push((TONE.into(), tone.name().into()));
        texts.push((TRANSFER.into(), transfer.name().into()));
        let stops = match exposure {
            Exposure::Stops(stops) => stops,
            _ => metered_exposure(picture),
        };
        let exposure = Exposure::Stops(stops);
        if exposure != Exposure::default() {
            texts.push((EXPOSURE.into(), exposure.to_string()));
        }
        Developing { exposure, tone, transfer }
    }
}

/// Reads a noisy picture. If it has no colours of its own, those of a layer are taken, and a note says so.
fn read(path: &Path, is_quiet: bool) -> Result<(Decoded, NoisyPicture), Failure> {
    let mut decoded = read_picture(path)?;
    let name = path.display();
    if decoded.is_changed {
        let message =
            format!("{name}: its pixels aren't those that were written: it is damaged, or another program changed it");
        return Err(Failure::new(Exit::Scene, message).help("give the picture as it was rendered"));
    }
    if decoded.display_referred {
        return Err(Failure::new(Exit::Scene, format!("{name} has display values, but denoising needs linear light"))
            .help("render the picture into an OpenEXR file, such as --output noisy.exr"));
    }
    let noisy = Aov::Noisy.name();
    if decoded.image.channel(&format!("{noisy}.R")).is_some() {
        let message = format!("{name} is denoised already: its layer {noisy} is what it was");
        return Err(Failure::new(Exit::Scene, message).help("give the picture as it was rendered"));
    }
    if decoded.image.rgb().is_none() {
        let failure = no_colors(path, &decoded);
        let layer = decoded.main_layer().filter(|layer| decoded.image.channel(&format!("{layer}.R")).is_some());
        let Some(layer) = layer else { return Err(failure) };
        if !is_quiet {
            eprint_line(&format!("note: {name}: its colours are those of the layer {}", visible(&layer)));
        }
        decoded = decoded.with_layer(&layer).ok_or(failure)?;
    }
    let noisy = of_image(&decoded.image).ok_or_else(|| no_colors(path, &decoded))?;
    Ok((decoded, noisy))
}

/// The failure of a picture without colours. It lists the channels.
fn no_colors(path: &Path, decoded: &Decoded) -> Failure {
    let names: Vec<&str> = decoded.image.channels.iter().map(|channel| channel.name.as_str()).collect();
    let what = "has no channels R G B or Y, and no single layer of colours";
    Failure::new(Exit::Scene, format!("{} {what}; it has {}", path.display(), list(&names)))
        .help("the noisy colours are channels R G B of the picture, or of its only layer with them, such as Combined.R")
}
