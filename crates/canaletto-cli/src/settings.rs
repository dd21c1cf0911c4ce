//! The meaning of the flags: they are combined with the scene's own settings in this module only.

use crate::backdrop::BackgroundFlag;
use crate::exit::Exit;
use crate::failure::Failure;
use crate::flags::{PictureFlags, SourceFlags};
use crate::format::count;
use crate::told_developing::{EXPOSURE, TONE, TRANSFER};
use canaletto::Named;
use canaletto::camera::Camera;
use canaletto::integrator::{ChangedSettings, describe};
use canaletto::render::{Job, JobError};
use canaletto::scene::{Exposure, FilmSettings, Filter, SamplePattern, SamplerKind, Sampling, Scene, View};
use canaletto_io::diagnostic::closest_word;
use canaletto_io::picture::MAX_PIXELS;

/// The text entry of a picture that grows because it was asked to.
pub(crate) const PROGRESSIVE: &str = "progressive";

/// The text entry of a model's staging.
pub(crate) const MODEL: &str = "model";

/// The text entry of a picture without a background.
pub(crate) const ALPHA: &str = "alpha";

/// The text entry of what a picture is laid over.
pub(crate) const BACKGROUND: &str = "background";

/// The job of a command, and the name of its camera.
#[derive(Clone, Debug)]
pub(crate) struct Settings {
    /// All that a picture depends on besides the world.
    pub job: Job,
    /// The camera's name.
    pub camera: String,
}

impl Settings {
    /// Combines the flags with a scene. `name` is the scene's file.
    pub(crate) fn new(name: &str, scene: &Scene, flags: &PictureFlags) -> Result<Settings, Failure> {
        let view = choose_view(name, &scene.views, flags.camera.as_deref())?;
        let mut view = view.clone();
        if let Some(size) = flags.size {
            let [width, height] = size.of([view.intrinsics.width, view.intrinsics.height]);
            if width > Camera::MAX_SIDE || height > Camera::MAX_SIDE {
                let most = Camera::MAX_SIDE;
                let message = format!("--size asks for {width} x {height} pixels; the most are {most} on each side");
                return Err(Failure::usage(message));
            }
            (view.intrinsics.width, view.intrinsics.height) = (width, height);
        }
        let own_crop = scene.film.crop.map(|crop| flags.size.map_or(crop, |size| size.window(crop)));
        let camera = Camera::of(&view)
            .map_err(|e| Failure::new(Exit::Scene, format!("{name}: camera \"{}\": {e}", view.name)))?;
        let film = FilmSettings {
            sampling: sampling(scene.film.sampling, flags)?,
            sampler: flags.sampler.unwrap_or(scene.film.sampler),
            exposure: flags.exposure.or(scene.film.exposure),
            tone: flags.tone.or(scene.film.tone),
            transfer: flags.transfer.unwrap_or(scene.film.transfer),
            alpha: flags.background.as_ref().map_or(scene.film.alpha, |which| *which == BackgroundFlag::None),
            crop: flags.crop.or(own_crop),
            ..scene.film
        };
        let integrator = match flags.integrator {
            Some(other) if other.name() != scene.integrator.name() => other,
            _ => scene.integrator,
        };
        let PictureFlags { max_depth, stage, no_shadows: without_shadows, progressive, .. } = *flags;
        let changed = ChangedSettings { max_depth, stage, without_shadows };
        let integrator = describe(&integrator).with_settings(&changed).map_err(|setting| {
            let message = format!("--{setting}: integrator \"{}\" has no such setting", integrator.name());
            Failure::usage(message).help("leave it out, or give --integrator whitted")
        })?;
        let job = Job { seed: flags.seed.unwrap_or(0), progressive, ..Job::new(camera, film, integrator) };
        job.check().map_err(|e| wrong_job(name, &e, flags))?;
        Ok(Settings { job, camera: view.name })
    }

    /// Checks that a file can hold the picture's number of pixels.
    pub(crate) fn check_pixels(&self) -> Result<(), Failure> {
        let [_, _, width, height] = self.job.window();
        let pixels = u64::from(width) * u64::from(height);
        if pixels <= MAX_PIXELS {
            return Ok(());
        }
        let (pixels, most) = (count(pixels), count(MAX_PIXELS));
        Err(Failure::usage(format!("a picture of {width} x {height} has {pixels} pixels; the most is {most}"))
            .help("render it in parts with --crop"))
    }
}

fn wrong_job(name: &str, error: &JobError, flags: &PictureFlags) -> Failure {
    match error {
        JobError::Crop { .. } if flags.crop.is_some() => Failure::usage(format!("--crop: {error}")),
        JobError::Crop { .. } if flags.size.is_some() => {
            Failure::usage(format!("--size: {error}")).help("the scene has a crop window; give --crop as well")
        }
        JobError::NotInPasses { why, .. } if flags.progressive => not_progressive("--progressive", why),
        _ => Failure::new(Exit::Scene, format!("{name}: {error}")),
    }
}

/// A flag that only a progressive picture has, where the picture can't be one.
pub(crate) fn not_progressive(flag: &str, why: &str) -> Failure {
    Failure::usage(format!("{flag}: it needs a picture that is made in passes, but {why}"))
        .help("give --samples N, and neither --pattern nor a --sampler but sobol")
}

fn choose_view<'a>(name: &str, views: &'a [View], wanted: Option<&str>) -> Result<&'a View, Failure> {
    let Some(first) = views.first() else {
        return Err(Failure::new(Exit::Scene, format!("{name} has no camera"))
            .help("add one, such as `camera { eye 0 2 5; center 0 0 0; fovy 60; size 640 480 }`"));
    };
    let Some(wanted) = wanted else { return Ok(first) };
    views.iter().find(|view| view.name == wanted).ok_or_else(|| {
        let names: Vec<&str> = views.iter().map(|view| view.name.as_str()).collect();
        let failure = Failure::usage(format!("{name} has no camera \"{wanted}\""));
        let all = match names[..] {
            [only] => format!("its only camera is \"{only}\""),
            _ => format!("its cameras are {}", list(&names)),
        };
        match closest_word(wanted, names.iter().copied()) {
            Some(near) if names.len() > 1 => failure.help(format!("did you mean \"{near}\"? {all}")),
            _ => failure.help(all),
        }
    })
}

/// The flags for a picture by the classic integrator, whose stages are wanted. It has the scene's settings if the scene
/// names it, else its defaults.
pub(crate) fn classic(flags: &PictureFlags, scene: &Scene) -> Result<PictureFlags, Failure> {
    match flags.integrator {
        Some(other) if describe(&other).whitted().is_none() => {
            let message = format!("--integrator {}: the stages are those of the classic integrator", other.name());
            Err(Failure::usage(message).help("leave it out, or see compare-methods"))
        }
        _ => {
            let integrator = Some(describe(&scene.integrator).nearest_whitted().into());
            Ok(PictureFlags { integrator, ..flags.clone() })
        }
    }
}

/// Combines the flags about samples. `--samples` alone leaves the positions to the sampler, or takes the centre for 1.
/// Its meaning doesn't depend on the scene. `--sampler` alone does so too, unless the scene chooses the positions of
/// its rays.
fn sampling(own: Sampling, flags: &PictureFlags) -> Result<Sampling, Failure> {
    let (own_n, own_threshold) = match own {
        Sampling::Corner | Sampling::Center | Sampling::Sampled(_) => (None, SamplePattern::DEFAULT_THRESHOLD),
        Sampling::Regular(n) | Sampling::Jittered(n) => (Some(n), SamplePattern::DEFAULT_THRESHOLD),
        Sampling::Adaptive { n, threshold } => (Some(n), threshold),
    };
    let given = flags.samples;
    let Some(pattern) = flags.pattern else {
        return Ok(match given {
            None => own,
            Some(1) => Sampling::Center,
            Some(n) => Sampling::Sampled(n),
        });
    };
    let single = |sampling| match given {
        Some(n) if n > 1 => Err(Failure::usage(format!(
            "--pattern {} means one ray for each pixel, but --samples asks for {n}",
            pattern.name()
        ))
        .help("leave one of them out, or take --pattern regular, jittered or adaptive")),
        _ => Ok(sampling),
    };
    match pattern {
        SamplePattern::Corner => single(Sampling::Corner),
        SamplePattern::Center => single(Sampling::Center),
        SamplePattern::Regular => Ok(Sampling::Regular(side(given, own_n)?)),
        SamplePattern::Jittered => Ok(Sampling::Jittered(side(given, own_n)?)),
        SamplePattern::Adaptive if given == Some(1) => {
            Err(Failure::usage("--pattern adaptive with --samples 1 has nothing to refine with")
                .help("give --samples 4 or more"))
        }
        SamplePattern::Adaptive => Ok(Sampling::Adaptive { n: side(given, own_n)?.max(2), threshold: own_threshold }),
    }
}

/// The side n of a grid of n × n rays.
fn side(samples: Option<u32>, own: Option<u32>) -> Result<u32, Failure> {
    let Some(samples) = samples else { return Ok(own.unwrap_or(SamplePattern::DEFAULT_GRID)) };
    let root = samples.isqrt();
    if root > Sampling::MAX_GRID {
        let most = Sampling::MAX_GRID * Sampling::MAX_GRID;
        return Err(Failure::usage(format!("--samples: a grid has at most {most} rays, not {samples}"))
            .help("without --pattern there may be more"));
    }
    if root * root != samples {
        let (below, above) = (root * root, (root + 1) * (root + 1));
        let message =
            format!("--samples: a grid has a square number of rays; the nearest to {samples} are {below} and {above}");
        return Err(Failure::usage(message).help("without --pattern any number will do"));
    }
    Ok(root)
}

/// The name of a sampling on the command line, with the number of rays per pixel.
pub(crate) fn sampling_words(film: &FilmSettings) -> String {
    match film.sampling {
        Sampling::Corner => "1 ray per pixel, through its corner".into(),
        Sampling::Center | Sampling::Sampled(1) => "1 ray per pixel, through its centre".into(),
        Sampling::Regular(n) => format!("{} rays per pixel, regular", n * n),
        Sampling::Jittered(n) => format!("{} rays per pixel, jittered", n * n),
        Sampling::Adaptive { n, threshold } => {
            format!("2 rays per pixel, {} jittered where they differ by more than {threshold}", n * n)
        }
        // The sampler has the name of a pattern.
        Sampling::Sampled(n) if film.sampler == SamplerKind::Jittered => {
            format!("{n} rays per pixel, by the {} sampler", film.sampler.name())
        }
        Sampling::Sampled(n) => format!("{n} rays per pixel, {}", film.sampler.name()),
    }
}

/// The settings that a picture's file carries for people and programs to read. All of them affect its bytes: there is
/// no time and no thread count.
pub(crate) fn metadata(source: &SourceFlags, settings: &Settings) -> Vec<(String, String)> {
    let Job { camera, film, integrator, seed, .. } = &settings.job;
    let [width, height] = camera.size();
    let file = source.scene.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let developing = settings.job.developing();
    let mut texts = vec![
        ("scene", file),
        ("camera", settings.camera.clone()),
        ("size", format!("{width} {height}")),
        ("sampling", sampling_words(film)),
        ("sampler", film.sampler.name().into()),
        ("filter", filter_words(film.filter)),
        (TONE, developing.tone.name().into()),
        (TRANSFER, film.transfer.name().into()),
        ("integrator", integrator.name().into()),
    ];
    // An exposure of 0 is told where it isn't what a film without an exposure has.
    let unset = FilmSettings { exposure: None, ..*film }.developing(describe(integrator).is_photographic()).exposure;
    if [developing.exposure, unset] != [Exposure::default(); 2] {
        texts.push((EXPOSURE, developing.exposure.to_string()));
    }
    if film.alpha {
        texts.push((ALPHA, true.to_string()));
    }
    texts.extend(describe(integrator).settings());
    if settings.job.progressive && !describe(integrator).is_progressive_by_default() {
        texts.push((PROGRESSIVE, true.to_string()));
    }
    texts.push(("seed", seed.to_string()));
    if let Some([x, y, width, height]) = film.crop {
        texts.push(("crop", format!("{x} {y} {width} {height}")));
    }
    let staging: Vec<String> = source.staging.given().iter().map(|(flag, value)| format!("{flag}={value}")).collect();
    if !staging.is_empty() {
        texts.push((MODEL, staging.join("; ")));
    }
    if !source.set.is_empty() {
        texts.push(("set", source.set.join("; ")));
    }
    texts.into_iter().map(|(key, text)| (key.to_owned(), text)).collect()
}

fn filter_words(filter: Filter) -> String {
    match filter {
        Filter::Gaussian { sigma } => format!("{}, sigma {sigma}", filter.name()),
        _ => filter.name().into(),
    }
}

/// Formats names as `"a", "b" and "c"`, cut after a dozen.
pub(crate) fn list(names: &[&str]) -> String {
    const MOST: usize = 12;
    let quoted: Vec<String> = names.iter().take(MOST).map(|name| format!("\"{name}\"")).collect();
    match &quoted[..] {
        _ if names.len() > MOST => format!("{} and {} more", quoted.join(", "), names.len() - MOST),
        [] => "none".into(),
        [only] => only.clone(),
        [all @ .., last] => format!("{} and {last}", all.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_alone_are_the_samplers() {
        let of =
            |own, pattern, samples| sampling(own, &PictureFlags { pattern, samples, ..PictureFlags::default() }).ok();
        let own = Sampling::Regular(3);
        assert_eq!(of(own, None, None), Some(own));
        assert_eq!(of(own, None, Some(1)), Some(Sampling::Center));
        assert_eq!(of(own, None, Some(10)), Some(Sampling::Sampled(10)));
        assert_eq!(of(own, Some(SamplePattern::Jittered), None), Some(Sampling::Jittered(3)));
        assert_eq!(of(own, Some(SamplePattern::Jittered), Some(16)), Some(Sampling::Jittered(4)));
        assert_eq!(of(own, Some(SamplePattern::Jittered), Some(10)), None);
        assert_eq!(of(own, Some(SamplePattern::Regular), Some(1024)), None);
        assert_eq!(of(own, Some(SamplePattern::Corner), Some(4)), None);
        assert_eq!(of(own, Some(SamplePattern::Corner), Some(1)), Some(Sampling::Corner));
        assert_eq!(of(own, Some(SamplePattern::Adaptive), Some(1)), None);
        let own = Sampling::Adaptive { n: 5, threshold: 0.3 };
        assert_eq!(of(own, Some(SamplePattern::Adaptive), Some(64)), Some(Sampling::Adaptive { n: 8, threshold: 0.3 }));
    }

    #[test]
    fn names_are_listed() {
        assert_eq!(list(&["a", "b", "c"]), "\"a\", \"b\" and \"c\"");
        assert_eq!(list(&["a"; 14]).matches("\"a\"").count(), 12);
    }
}
