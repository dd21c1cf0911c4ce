//! `canaletto compare`: how much two pictures differ.

mod input;
mod report;

use crate::command_files::{CommandFiles, FolderFlag};
use crate::exit::Exit;
use crate::failure::Failure;
use crate::flags;
use crate::output::{unfit, write_file};
use crate::output_format::Format;
use crate::stdout::{print, print_json};
use canaletto::scene::{Developing, Transfer};
use canaletto::{Named, named};
use canaletto_io::diagnostic::closest_word;
use canaletto_io::picture::{
    Comparison, EncodeSettings, Image, PIXELS_PER_DEGREE, RestDifference, Unequal, compare, difference, differing,
};
use clap::Args;
pub(super) use input::{Input, read};
use report::ComparisonReport;
use std::path::{Path, PathBuf};

/// Compares two pictures by RMSE, PSNR, largest difference, SSIM and FLIP, and by their alpha and layers.
///
/// The formats are PNG, OpenEXR, JPEG, WebP, Radiance HDR and PPM. Display values from 0 to 1 are compared. A PNG
/// stores them. An EXR is developed as the other picture was and rounded to its bits: exposure and tone are those that
/// the other file names, or 0 and clamp; the transfer curve is sRGB if it declares none or is an EXR. Equal pictures
/// also have equal alpha, layers, declared curves and places in a larger picture. What only one picture has is listed.
/// Two EXRs with equal display values differ if their linear light differs.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct CompareFlags {
    /// The reference picture
    #[arg(value_name = "A")]
    pub a: PathBuf,

    /// The other picture
    #[arg(value_name = "B")]
    pub b: PathBuf,

    /// Exits with code 4 if a metric passes this limit; may be repeated
    ///
    /// VALUE is the largest rmse, mse, max, flip or differing, or the smallest psnr or ssim. The metric differing
    /// counts pixels whose colours, alpha or common layers differ. For two EXRs it also counts pixels whose linear
    /// light differs. The other metrics compare colours.
    #[arg(short, long, value_name = "METRIC=VALUE", value_parser = threshold)]
    pub threshold: Vec<Threshold>,

    /// Writes a picture of the differences, PNG or EXR
    #[arg(long, value_name = "PATH")]
    pub diff: Option<PathBuf>,

    #[command(flatten)]
    pub folder: FolderFlag,

    /// Multiplies the differences in a PNG [default: the factor that makes the largest white]
    #[arg(long, value_name = "FACTOR", requires = "diff", value_parser = factor)]
    pub diff_scale: Option<f32>,

    /// Compares this layer of both pictures instead of their colours, such as normal, ViewLayer.Combined or Z
    ///
    /// Layers of red, green and blue are compared as colours. Other layers are compared as numbers, without SSIM and
    /// FLIP.
    #[arg(long, value_name = "NAME")]
    pub layer: Option<String>,

    /// Compares linear light: an EXR as stored, a PNG without its curve; SSIM and FLIP still use display values
    #[arg(long)]
    pub linear: bool,

    /// Sets the transfer curve of pictures that declare none
    #[arg(long, value_name = "CURVE", value_parser = flags::named::<Transfer>(), default_value = "srgb")]
    pub transfer: Transfer,

    /// Prints JSON
    #[arg(long)]
    pub json: bool,
}

const EXAMPLES: &str = "\
Examples:
  canaletto render scenes/path.kdl --samples 4 -o a.exr --aov depth
  canaletto render scenes/path.kdl --samples 4 --seed 2 -o b.exr --aov depth
  canaletto compare a.exr b.exr --diff diff.png
  canaletto compare a.exr b.exr --linear --threshold rmse=1 --threshold max=100
  canaletto compare a.exr b.exr --layer depth
  canaletto compare a.exr b.exr --json | jq .flip";

/// A limit for a metric.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Threshold {
    metric: Metric,
    limit: f64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Metric {
    Rmse,
    Mse,
    Psnr,
    Max,
    Differing,
    Ssim,
    Flip,
}

named!(Metric {
    Rmse => "rmse",
    Mse => "mse",
    Psnr => "psnr",
    Max => "max",
    Differing => "differing",
    Ssim => "ssim",
    Flip => "flip",
});

impl Metric {
    /// Whether larger values mean more similar pictures.
    fn rises(self) -> bool {
        matches!(self, Metric::Psnr | Metric::Ssim)
    }

    fn of(self, result: &Comparison) -> Option<f64> {
        Some(match self {
            Metric::Rmse => result.rmse,
            Metric::Mse => result.mse,
            Metric::Psnr => result.psnr,
            Metric::Max => result.max.value,
            Metric::Differing => result.differing as f64,
            Metric::Ssim => return result.ssim,
            Metric::Flip => result.flip,
        })
    }
}

fn threshold(text: &str) -> Result<Threshold, String> {
    let (name, value) = text.split_once('=').ok_or("write a metric and a number with = between, such as rmse=0.01")?;
    let names = Metric::NAMES;
    let metric = Metric::from_name(name).ok_or_else(|| {
        closest_word(name, names.iter().copied())
            .map_or_else(|| format!("the metrics are {}", names.join(", ")), |near| format!("did you mean {near}?"))
    })?;
    let limit: f64 = value.parse().map_err(|_| format!("\"{value}\" isn't a number"))?;
    if limit.is_nan() { Err("the limit isn't a number".into()) } else { Ok(Threshold { metric, limit }) }
}

fn factor(text: &str) -> Result<f32, String> {
    let factor = text.parse().ok().filter(|factor: &f32| factor.is_finite() && *factor > 0.0);
    factor.ok_or_else(|| "write a number that is more than 0".into())
}

/// Runs the command.
pub(crate) fn run(flags: &CompareFlags) -> Result<Exit, Failure> {
    let files = CommandFiles::default().reads("A", [&flags.a]).reads("B", [&flags.b]);
    let files = files.writes("--diff", flags.diff.clone());
    files.check()?;
    flags.folder.make_folders(&files)?;
    let (a, b) = (read(&flags.a, flags.layer.as_deref())?, read(&flags.b, flags.layer.as_deref())?);
    let wrong = |e: Unequal| Failure::new(Exit::Scene, format!("{} and {}: {e}", flags.a.display(), flags.b.display()));
    let same_size = (a.decoded.image.width, a.decoded.image.height) == (b.decoded.image.width, b.decoded.image.height);
    let mut rest = if same_size && flags.layer.is_none() {
        RestDifference::of(&a.decoded, &b.decoded)
    } else {
        RestDifference::default()
    };
    let (curve_a, curve_b) = (a.curve(), b.curve());
    let default = flags.transfer;
    let raw = a.is_raw || b.is_raw;
    if same_size && !raw && !flags.linear {
        rest.add_unseen(&a.decoded, &b.decoded);
    }
    let (seen_a, seen_b) = if raw {
        (a.decoded.image.clone(), b.decoded.image.clone())
    } else {
        let developing = |of: &Input, curve: Option<Transfer>| {
            let (exposure, tone) = of.exposure_and_tone().unwrap_or_default();
            Developing { exposure, tone, transfer: curve.unwrap_or(default) }
        };
        let seen_a = a.seen(&developing(&b, curve_a.or(curve_b)), b.steps());
        (seen_a, b.seen(&developing(&a, curve_b.or(curve_a)), a.steps()))
    };
    let mut result = compare(&seen_a, &seen_b, PIXELS_PER_DEGREE).map_err(wrong)?;
    let left_out = [a.decoded.left_out.clone(), b.decoded.left_out.clone()];
    let (compared_a, compared_b) = if flags.linear && !raw {
        let pair = (a.linear(curve_a.unwrap_or(default)), b.linear(curve_b.unwrap_or(default)));
        let mut light = compare(&pair.0, &pair.1, PIXELS_PER_DEGREE).map_err(wrong)?;
        (light.ssim, light.flip) = (result.ssim, result.flip);
        result = light;
        pair
    } else {
        (seen_a, seen_b)
    };
    let scale = match &flags.diff {
        Some(path) => Some(write_difference(flags, path, &compared_a, &compared_b, result.max.value)?),
        None => None,
    };
    let colors_differ = result.differing > 0;
    result.differing = differing(&compared_a, &compared_b, &rest.pixels).map_err(wrong)?;
    let told = ComparisonReport { flags, result, rest, left_out, colors_differ, raw, image: &compared_a };
    let exceeded = exceeded(&flags.threshold, &told)?;
    if flags.json {
        print_json(&told.json(&exceeded))?;
    } else {
        print(&told.text())?;
        if let (Some(path), Some(scale)) = (&flags.diff, scale) {
            print(&format!("diff       {}, differences x {scale}\n", path.display()))?;
        }
        for Threshold { metric, limit } in &exceeded {
            let side = if metric.rises() { "under" } else { "over" };
            print(&format!("{} is {side} the threshold {limit}\n", metric.name()))?;
        }
    }
    Ok(if exceeded.is_empty() { Exit::Done } else { Exit::Threshold })
}

fn exceeded<'a>(thresholds: &'a [Threshold], told: &ComparisonReport) -> Result<Vec<&'a Threshold>, Failure> {
    let mut list = Vec::new();
    for threshold in thresholds {
        if told.raw && matches!(threshold.metric, Metric::Ssim | Metric::Flip | Metric::Psnr) {
            let name = threshold.metric.name();
            return Err(Failure::usage(format!("--threshold {name}: the layer has numbers, not colours"))
                .help("take rmse, mse, max or differing"));
        }
        let value = threshold.metric.of(&told.result).ok_or_else(|| {
            Failure::usage("--threshold ssim: the pictures are smaller than its window of 11 x 11 pixels")
        })?;
        let holds = if threshold.metric.rises() { value >= threshold.limit } else { value <= threshold.limit };
        if !holds {
            list.push(threshold);
        }
    }
    Ok(list)
}

/// Writes the difference picture; returns the factor that scales the differences.
fn write_difference(flags: &CompareFlags, path: &Path, a: &Image, b: &Image, max: f64) -> Result<f32, Failure> {
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase());
    let format = extension.as_deref().and_then(Format::of_extension).and_then(Format::picture);
    let Some(format) = format else {
        let extensions = Format::picture_extensions();
        return Err(Failure::usage(format!("--diff {}: end the name in {extensions}", path.display())));
    };
    let is_linear = format.capabilities().is_some_and(|can| can.linear);
    let largest = if max > 0.0 && max.is_finite() { (1.0 / max) as f32 } else { 1.0 };
    let scale = flags.diff_scale.unwrap_or(if is_linear { 1.0 } else { largest });
    let image = difference(a, b, scale).map_err(|e| Failure::new(Exit::Scene, e))?;
    let texts = [("scale".to_owned(), scale.to_string())];
    let bytes = format.encode_image(&image, Transfer::None, &EncodeSettings::default(), &texts);
    write_file(path, &bytes.map_err(|e| unfit(&e))?)?;
    Ok(scale)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thresholds_are_told_apart() {
        assert_eq!(threshold("rmse=0.01"), Ok(Threshold { metric: Metric::Rmse, limit: 0.01 }));
        assert_eq!(threshold("pnsr=30").unwrap_err(), "did you mean psnr?");
        assert!(threshold("rmse").is_err() && threshold("rmse=x").is_err() && threshold("max=nan").is_err());
    }
}
