//! Denoising for commands: the choice of a denoiser, the layers that it reads by name, and what it tells.

use crate::exit::Exit;
use crate::failure::Failure;
use crate::format::duration;
use crate::interrupt;
use canaletto::Named;
use canaletto::denoise::{DenoiseQuality, DenoisedPicture, NoisyPicture, denoise};
use canaletto::film::Picture;
use canaletto::math::Rgb;
use canaletto::render::{Aov, Job};
use canaletto::scene::Integrator;
use canaletto_io::diagnostic::word_list;
use canaletto_io::picture::Image;
use canaletto_oidn::{Oidn, OidnPicture};
use clap::ValueEnum;
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
    Ok(DenoisedPicture::by_another("oidn", color))
}

/// The names of the layers of the two halves of the samples.
const HALVES: [&str; 2] = ["half-a", "half-b"];

/// The layers that denoisers read besides the colours, as far as this integrator makes them.
fn layers(integrator: &Integrator) -> impl Iterator<Item = Aov> {
    let halves = HALVES.iter().filter_map(|name| Aov::from_name(name));
    let features = [Aov::DenoisingAlbedo, Aov::DenoisingNormal, Aov::DenoisingDepth];
    halves.chain(features).filter(|aov| aov.is_made_by(integrator))
}

/// The job with the layers that denoisers read.
pub(crate) fn with_layers(job: &Job) -> Job {
    let mut job = job.clone();
    for aov in layers(&job.integrator) {
        if !job.aovs.contains(&aov) {
            job.aovs.push(aov);
        }
    }
    job
}

/// Takes away the light that denoising spreads to where nothing is, by alpha. Without alpha nothing changes.
pub(crate) fn blacken_uncovered(colors: &mut [Rgb], alpha: &[f32]) {
    for (color, _) in colors.iter_mut().zip(alpha).filter(|(_, alpha)| **alpha == 0.0) {
        *color = Rgb::BLACK;
    }
}

/// A rendered picture with the layers that it has.
pub(crate) fn of_rendering(picture: &Picture) -> NoisyPicture {
    let layer = |name: &str| picture.layer(name).map(|layer| layer.data.as_slice());
    let triples = |name: &str| layer(name).map(|data| data.as_chunks::<3>().0.to_vec());
    let colors = |name: &str| Some(triples(name)?.into_iter().map(Rgb::from).collect());
    NoisyPicture {
        width: picture.width,
        height: picture.height,
        color: picture.pixels.clone(),
        halves: halves(HALVES.map(colors)),
        albedo: triples(Aov::DenoisingAlbedo.name()),
        normal: triples(Aov::DenoisingNormal.name()),
        depth: layer(Aov::DenoisingDepth.name()).map(<[f32]>::to_vec),
    }
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
    let lost = match denoised.lost_light {
        0.0 => String::new(),
        share => format!(", but for {:.2}% that would show", share * 100.0),
    };
    let outliers = match denoised.outlier_light {
        0.0 => String::new(),
        share => format!("; {:.2}% of the light was in outliers and is spread around them{lost}", share * 100.0),
    };
    format!("denoised in {}: {}{outliers}", duration(time), filters.join(", "))
}
