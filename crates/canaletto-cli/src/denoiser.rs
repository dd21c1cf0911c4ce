//! Denoising for commands: the choice of a denoiser, the layers that it reads by name, and what it tells.

use crate::exit::Exit;
use crate::failure::Failure;
use crate::format::{count, duration};
use crate::interrupt;
use canaletto::Named;
use canaletto::denoise::{DenoiseQuality, DenoisedPicture, FilledPixels, NoisyPicture, denoise};
use canaletto::film::Picture;
use canaletto::math::Rgb;
use canaletto::render::{Aov, Job};
use canaletto_io::diagnostic::word_list;
use canaletto_io::picture::Image;
use canaletto_oidn::{Oidn, OidnPicture};
use clap::ValueEnum;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use std::env;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::Duration;

/// The denoisers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum Denoiser {
    /// À-trous wavelets
    Fast,
    /// Wavelets and first-order regression, whichever has the least error at a pixel
    #[default]
    Good,
    /// Intel's Open Image Denoise, from the folder that the variable OIDN_DIR names
    Oidn,
}

/// The value of --denoise: a denoiser, or none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct DenoiseFlag(pub(crate) Option<Denoiser>);

/// The word for no denoiser.
const NONE: &str = "none";

/// The parser of --denoise.
pub(crate) fn denoise_flag() -> impl TypedValueParser<Value = DenoiseFlag> {
    let none = PossibleValue::new(NONE).help("The picture keeps its noise");
    let words = Denoiser::value_variants().iter().filter_map(Denoiser::to_possible_value).chain([none]);
    PossibleValuesParser::new(words).map(|word| DenoiseFlag(Denoiser::from_str(&word, false).ok()))
}

/// The variable that names the folder of Open Image Denoise.
const OIDN_DIR: &str = "OIDN_DIR";

impl Denoiser {
    /// Its name on the command line.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Denoiser::Fast => "fast",
            Denoiser::Good => "good",
            Denoiser::Oidn => "oidn",
        }
    }

    /// Finds out before a render whether the denoiser can be used.
    pub(crate) fn check(self) -> Result<(), Failure> {
        if self == Denoiser::Oidn { load_oidn().map(|_| ()) } else { Ok(()) }
    }

    /// Denoises a picture on threads of its own, as many as the current ones. None if the render must stop. The threads
    /// may then work on for a while, so that what is rendered can be saved at once.
    pub(crate) fn run(self, picture: NoisyPicture) -> Result<Option<DenoisedPicture>, Failure> {
        const PAUSE: Duration = Duration::from_millis(10);
        let failed = |why: &str| Failure::new(Exit::Failed, format!("--denoise {}: {why}", self.name()));
        let (answer, answered) = mpsc::channel();
        let threads = rayon::ThreadPoolBuilder::new().num_threads(rayon::current_num_threads());
        // A panic drops the sender.
        let threads = threads.panic_handler(|_| ()).build().map_err(|e| failed(&e.to_string()))?;
        threads.spawn(move || _ = answer.send(self.denoise(&picture)));
        loop {
            match answered.recv_timeout(PAUSE) {
                _ if interrupt::stops() => return Ok(None),
                Ok(denoised) => return denoised,
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return Err(failed("it ended without a picture")),
            }
        }
    }

    /// Denoises a picture. None if the render must stop, which is asked now and then.
    fn denoise(self, picture: &NoisyPicture) -> Result<Option<DenoisedPicture>, Failure> {
        let quality = match self {
            Denoiser::Fast => DenoiseQuality::Fast,
            Denoiser::Good => DenoiseQuality::Good,
            Denoiser::Oidn => return by_oidn(picture).map(Some),
        };
        Ok(match denoise(picture, quality, &|_| !interrupt::stops()) {
            ControlFlow::Continue(denoised) => Some(denoised),
            ControlFlow::Break(()) => None,
        })
    }
}

/// Loads Open Image Denoise from the folder that [`OIDN_DIR`] names.
fn load_oidn() -> Result<Oidn, Failure> {
    let failed = |message: String| {
        Failure::new(Exit::Failed, format!("--denoise oidn: {message}")).help(
            "OIDN_DIR names the folder of Open Image Denoise 2, such as that of a download from openimagedenoise.org, or \
             the folder pyoidn of the Python package; fast and good need no library",
        )
    };
    let folder = env::var_os(OIDN_DIR).filter(|folder| !folder.is_empty());
    let folder = folder.ok_or_else(|| failed(format!("the variable {OIDN_DIR} isn't set")))?;
    Oidn::load(Path::new(&folder)).map_err(|e| failed(e.to_string()))
}

/// Denoises a picture by Open Image Denoise.
fn by_oidn(picture: &NoisyPicture) -> Result<DenoisedPicture, Failure> {
    let oidn = load_oidn()?;
    let (picture, filled) = picture.repaired();
    let color: Vec<[f32; 3]> = picture.color.iter().map(|c| c.to_array()).collect();
    let albedo = picture.albedo.as_deref();
    let denoised = oidn.denoise(
        &OidnPicture {
            width: picture.width as usize,
            height: picture.height as usize,
            color: &color,
            albedo,
            normal: picture.normal.as_deref().filter(|_| albedo.is_some()),
        },
        u32::try_from(rayon::current_num_threads()).unwrap_or(0),
    );
    let color = denoised.map_err(|e| Failure::new(Exit::Failed, e))?.into_iter().map(Rgb::from).collect();
    let mut denoised = DenoisedPicture::by_another("oidn", color);
    denoised.filled = filled;
    Ok(denoised)
}

/// The names of the layers of the two halves of the samples.
pub(crate) const HALVES: [&str; 2] = ["half-a", "half-b"];

/// The layers that tell of surfaces.
pub(crate) const FEATURES: [Aov; 3] = [Aov::DenoisingAlbedo, Aov::DenoisingNormal, Aov::DenoisingDepth];

/// The layers that denoisers read besides the colours, as far as this integrator makes them.
fn layers(job: &Job) -> impl Iterator<Item = Aov> {
    let halves = HALVES.iter().filter_map(|name| Aov::from_name(name));
    halves.chain(FEATURES).filter(|aov| job.description().makes(*aov, job.progressive))
}

/// The job with the layers that denoisers read.
pub(crate) fn with_layers(job: &Job) -> Job {
    let more = layers(job).filter(|aov| !job.aovs.contains(aov));
    Job { aovs: job.aovs.iter().copied().chain(more).collect(), ..job.clone() }
}

/// Takes away the light that denoising spreads to where nothing is, by alpha. Without alpha nothing changes.
pub(crate) fn blacken_uncovered(colors: &mut [Rgb], alpha: &[f32]) {
    for (color, _) in colors.iter_mut().zip(alpha).filter(|(_, alpha)| **alpha == 0.0) {
        *color = Rgb::BLACK;
    }
}

/// A rendered picture with the layers that it has. Those that aren't among `kept` are moved, so that they take memory
/// once.
pub(crate) fn of_rendering(picture: &mut Picture, kept: &[Aov]) -> NoisyPicture {
    let mut layer = |name: &str| {
        let index = picture.layers.iter().position(|layer| layer.name == name)?;
        match kept.iter().any(|aov| aov.name() == name) {
            true => Some(picture.layers[index].data.clone()),
            false => Some(picture.layers.remove(index).data),
        }
    };
    let mut triples = |name: &str| layer(name).map(|data| data.as_chunks::<3>().0.to_vec());
    let colors = |values: Option<Vec<[f32; 3]>>| Some(values?.into_iter().map(Rgb::from).collect());
    let own_halves = halves(HALVES.map(|name| colors(triples(name))));
    let [albedo, normal] = [Aov::DenoisingAlbedo, Aov::DenoisingNormal].map(|aov| triples(aov.name()));
    let depth = layer(Aov::DenoisingDepth.name());
    let (width, height, color) = (picture.width, picture.height, picture.pixels.clone());
    NoisyPicture { width, height, color, halves: own_halves, albedo, normal, depth }
}

/// The halves of a picture's samples, if they tell its noise. A single sample is in both, so that they are equal.
fn halves([a, b]: [Option<Vec<Rgb>>; 2]) -> Option<[Vec<Rgb>; 2]> {
    Some([a?, b?]).filter(|[a, b]| a != b)
}

/// A picture of a file with the layers that it has, by their names.
pub(crate) fn of_image(image: &Image) -> Option<NoisyPicture> {
    let channel = |layer: &str, name: &str| image.channel(&format!("{}.{name}", layer.replace('-', "_")));
    let triples = |layer: &str, names: [&str; 3]| -> Option<Vec<[f32; 3]>> {
        let [a, b, c] = names.map(|name| channel(layer, name));
        Some(zipped([a?, b?, c?]).collect())
    };
    let colors = |layer| Some(triples(layer, ["R", "G", "B"])?.into_iter().map(Rgb::from).collect());
    Some(NoisyPicture {
        width: image.width,
        height: image.height,
        color: zipped(image.rgb()?).map(Rgb::from).collect(),
        halves: halves(HALVES.map(colors)),
        albedo: triples(Aov::DenoisingAlbedo.name(), ["R", "G", "B"]),
        normal: triples(Aov::DenoisingNormal.name(), ["X", "Y", "Z"]),
        depth: channel(Aov::DenoisingDepth.name(), "Z").map(<[f32]>::to_vec),
    })
}

fn zipped<'a>([a, b, c]: [&'a [f32]; 3]) -> impl Iterator<Item = [f32; 3]> + Clone + 'a {
    a.iter().zip(b).zip(c).map(|((a, b), c)| [*a, *b, *c])
}

/// What a picture lacks for denoising, with what is done without it; None if it lacks nothing.
pub(crate) fn lacks(picture: &NoisyPicture) -> Option<String> {
    let mut parts = Vec::new();
    if picture.halves.is_none() {
        parts.push("without two halves of its samples the noise is guessed from neighbouring pixels".to_owned());
    }
    let features = [
        (picture.albedo.is_none(), Aov::DenoisingAlbedo, "textures"),
        (picture.normal.is_none(), Aov::DenoisingNormal, "edges"),
        (picture.depth.is_none(), Aov::DenoisingDepth, "borders in depth"),
    ];
    let missing: Vec<_> = features.iter().filter(|(is_missing, ..)| *is_missing).collect();
    if !missing.is_empty() {
        let names: Vec<&str> = missing.iter().map(|(_, aov, _)| aov.name()).collect();
        let blurred: Vec<&str> = missing.iter().map(|(.., what)| *what).collect();
        parts.push(format!("without {} it may blur {}", word_list(&names, "and"), word_list(&blurred, "and")));
    }
    (!parts.is_empty()).then(|| parts.join("; "))
}

/// What denoising did, in a line.
pub(crate) fn told(denoised: &DenoisedPicture, time: Duration) -> String {
    let percent = |share: f64| format!("{:.0}%", share * 100.0);
    let filters: Vec<String> =
        denoised.filters.iter().map(|(name, share)| format!("{name} {}", percent(*share))).collect();
    format!("denoised in {}: {}{}", duration(time), filters.join(", "), outliers_told(denoised))
}

/// What became of the light of outliers, in words.
fn outliers_told(denoised: &DenoisedPicture) -> String {
    let [all, lost] = [denoised.outlier_light, denoised.lost_light];
    let percent = |share: f64| match share * 100.0 {
        small if small < 0.01 => "less than 0.01%".to_owned(),
        some if some < 1.0 => format!("{some:.2}%"),
        much => format!("{much:.1}%"),
    };
    if all <= 0.0 {
        return String::new();
    }
    let spread = format!("; single bright samples held {} of the light", percent(all));
    if lost <= 0.0 {
        return format!("{spread}, which is spread evenly around them");
    }
    let rest = match all - lost {
        rest if rest > 0.0 => format!("{} is spread around them, and ", percent(rest)),
        _ => String::new(),
    };
    format!("{spread}: {rest}{} is left out, since it would show as blotches; more samples keep it", percent(lost))
}

/// A warning of pixels that were filled; None if none were.
pub(crate) fn filled_told(filled: FilledPixels) -> Option<String> {
    let colors = match filled.colors {
        0 => None,
        1 => Some("1 pixel was no light (not a number, infinite or negative)".to_owned()),
        n => Some(format!("{} pixels were no light (not a number, infinite or negative)", count(n))),
    };
    let features = match filled.features {
        0 => None,
        1 => Some("1 pixel had an albedo, normal or depth that isn't a number".to_owned()),
        n => Some(format!("{} pixels had an albedo, normal or depth that isn't a number", count(n))),
    };
    let parts: Vec<String> = colors.into_iter().chain(features).collect();
    (!parts.is_empty()).then(|| format!("{}; what surrounds them was taken instead", parts.join(", and ")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_of_outliers_is_told_in_words() {
        let mut denoised = DenoisedPicture::by_another("wavelets", Vec::new());
        let told = |denoised: &DenoisedPicture| told(denoised, Duration::from_secs(2));
        assert_eq!(told(&denoised), "denoised in 2.0 s: wavelets 100%");
        denoised.outlier_light = 0.0652;
        let start = "denoised in 2.0 s: wavelets 100%; single bright samples held 6.5% of the light";
        assert_eq!(told(&denoised), format!("{start}, which is spread evenly around them"));
        (denoised.outlier_light, denoised.lost_light) = (0.2883, 0.2211);
        let rest = "22.1% is left out, since it would show as blotches; more samples keep it";
        assert_eq!(
            told(&denoised),
            format!("{}: 6.7% is spread around them, and {rest}", start.replace("6.5", "28.8"))
        );
    }

    #[test]
    fn filled_pixels_are_told() {
        assert_eq!(filled_told(FilledPixels::default()), None);
        let told = filled_told(FilledPixels { colors: 1, features: 2000 }).unwrap_or_default();
        assert!(told.starts_with("1 pixel was no light") && told.contains("and 2,000 pixels had an albedo"), "{told}");
    }
}
