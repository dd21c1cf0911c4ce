//! Files with the samples of a growing picture: what they hold besides it, and whether they belong to a render.

use crate::digest::{Digest, FileChange, UsedFile, changed_file, text_of_files};
use crate::exit::Exit;
use crate::failure::{Failure, reason};
use crate::part::{PART, PICTURE_TEXTS, layers_of_texts};
use crate::partial::UNFINISHED;
use crate::settings::{ALPHA, BACKGROUND, MODEL, PROGRESSIVE};
use crate::told_developing::METERED_EXPOSURE;
use canaletto::Named;
use canaletto::film::SampleBlocks;
use canaletto::render::{Aov, Job, Rendering};
use canaletto_io::picture::{Decoded, SAMPLES_TEXT, SOFTWARE, decode, read_samples};
use std::fs;
use std::path::Path;

/// The keys of the texts by which a changed scene is noticed: the digest of all, and the hash of each file.
pub(crate) const SCENE_DIGEST: &str = "scene-digest";
pub(crate) const SCENE_FILES: &str = "scene-files";

/// The key of the text of the scene's name.
pub(crate) const SCENE: &str = "scene";

/// The texts that say whether samples belong together: another value of one means other samples.
const TELLING: [&str; 17] = [
    "Software",
    "size",
    "crop",
    "camera",
    "frame",
    "seed",
    "first-sample",
    PART,
    "integrator",
    PROGRESSIVE,
    ALPHA,
    BACKGROUND,
    MODEL,
    "sampler",
    "filter",
    "clamp",
    "set",
];

/// The digest of the contents of a scene's files and of the values set in it, and the hash of each file.
pub(crate) fn scene_digest(files: &[UsedFile], set: &[String]) -> [(String, String); 2] {
    let digest = Digest::EMPTY.with_files(files).with(&set).to_string();
    [(SCENE_DIGEST.into(), digest), (SCENE_FILES.into(), text_of_files(files))]
}

/// A picture's file with samples to go on with.
pub(crate) struct SampleFile<'f> {
    /// What the user calls it, such as a flag.
    role: &'static str,
    file: &'f Path,
    pub decoded: Decoded,
}

impl<'f> SampleFile<'f> {
    /// Reads a file.
    pub(crate) fn open(role: &'static str, file: &'f Path) -> Result<SampleFile<'f>, Failure> {
        let failed = |message: String| Failure::new(Exit::Scene, format!("{role} {}: {message}", file.display()));
        let bytes = fs::read(file).map_err(|error| failed(reason(&error)))?;
        let decoded = decode(&bytes).map_err(|error| failed(error.to_string()))?;
        let this = SampleFile { role, file, decoded };
        if this.text(SCENE_DIGEST).is_none() {
            return Err(this.failed("it isn't an EXR of a growing picture that this program wrote".into()));
        }
        if this.decoded.is_changed {
            return Err(this
                .failed(
                    "its pixels aren't those that were written: it is damaged, or another program changed it".into(),
                )
                .help("render the picture from its first sample on"));
        }
        Ok(this)
    }

    fn failed(&self, message: String) -> Failure {
        Failure::new(Exit::Scene, format!("{} {}: {message}", self.role, self.file.display()))
    }

    /// A text of the file.
    pub(crate) fn text(&self, key: &str) -> Option<String> {
        text_of(&self.decoded.metadata, key)
    }

    /// Checks that the samples are those of a render with these texts.
    pub(crate) fn belongs_to(&self, job: &Job, texts: &[(String, String)]) -> Result<(), Failure> {
        check_texts(&self.decoded.metadata, (job, texts), &TELLING, &|message| {
            let help = "its samples belong to another picture; render this one from its first sample on";
            self.failed(message).help(help)
        })?;
        if self.text("sampling").is_some_and(|sampling| sampling.contains("centre")) {
            return Err(self.failed("its single sample goes through the pixel's centre, where several don't".into()));
        }
        Ok(())
    }

    /// The samples, which are no more than the job asks for.
    pub(crate) fn samples(&self, job: &Job) -> Result<SampleBlocks, Failure> {
        let samples = read_samples(&self.decoded, job.first_sample).map_err(|error| self.failed(error.to_string()))?;
        let (least, wanted) = (fewest(&samples), job.film.sampling.count());
        if least > wanted {
            return Err(self.has_enough(least, wanted));
        }
        Ok(samples)
    }

    fn has_enough(&self, least: u32, wanted: u32) -> Failure {
        self.failed(format!("it has {least} samples in each pixel already, and --samples asks for {wanted}"))
            .help(format!("give more, such as --samples {}", 2 * u64::from(least)))
    }
}

/// The texts of a file of this program, with those that its writers add.
pub(crate) fn texts_of_file(job: &Job, texts: &[(String, String)]) -> Vec<(String, String)> {
    let mut all = texts.to_vec();
    all.extend([("Software".to_owned(), SOFTWARE.to_owned()), ("frame".to_owned(), job.frame.to_string())]);
    all
}

/// Checks that the texts of a file, `theirs`, are those of a render where it matters: in `keys`, in the integrator's
/// settings and in the scene. `failed` makes the error of a difference.
pub(crate) fn check_texts(
    theirs: &[(String, String)],
    (job, texts): (&Job, &[(String, String)]),
    keys: &[&'static str],
    failed: &dyn Fn(String) -> Failure,
) -> Result<(), Failure> {
    let own = texts_of_file(job, texts);
    let settings = job.description().settings().into_iter().map(|(key, _)| key);
    for key in keys.iter().copied().chain(settings).chain([SCENE_DIGEST]) {
        let (their, own) = (text_of(theirs, key), text_of(&own, key));
        if their == own {
            continue;
        }
        let [their, own] = [their, own].map(|text| text.unwrap_or_else(|| "none".to_owned()));
        return Err(failed(match key {
            SCENE_DIGEST => {
                let [now, then] = [texts, theirs].map(|texts| text_of(texts, SCENE_FILES).unwrap_or_default());
                match changed_file(&now, &then) {
                    Some(FileChange::Edited(name)) => format!("{name} has changed since it was rendered"),
                    Some(FileChange::Added(name)) => {
                        format!("the scene names {name}, which it didn't when it was rendered")
                    }
                    Some(FileChange::Removed(name)) => format!("the scene named {name} when it was rendered"),
                    None => "the scene has changed since it was rendered".into(),
                }
            }
            "Software" => format!("it was made by {their}, and this is {own}"),
            _ => format!("its {key} is {their}, not {own}"),
        }));
    }
    Ok(())
}

/// The texts of the whole picture, as the texts of a part tell them.
pub(crate) fn picture_texts(texts: &[(String, String)]) -> Vec<(String, String)> {
    text_of(texts, PICTURE_TEXTS).and_then(|text| serde_json::from_str(&text).ok()).unwrap_or_default()
}

/// The texts without the names of the scene and of its files.
pub(crate) fn nameless(mut texts: Vec<(String, String)>) -> Vec<(String, String)> {
    texts.retain(|(key, _)| ![SCENE, SCENE_FILES].contains(&key.as_str()));
    texts
}

/// A text of a file.
pub(crate) fn text_of(texts: &[(String, String)], key: &str) -> Option<String> {
    texts.iter().find(|(own, _)| own == key).map(|(_, text)| text.clone())
}

fn fewest(samples: &SampleBlocks) -> u32 {
    samples.counts().iter().copied().min().unwrap_or(0)
}

/// The samples of the file of --continue, whose texts must be those of this render. `denoises`: the picture is denoised
/// when it has its samples.
pub(crate) fn samples_of_file(
    file: &Path,
    job: &Job,
    texts: &[(String, String)],
    denoises: bool,
) -> Result<SampleBlocks, Failure> {
    let file = SampleFile::open("--continue", file)?;
    file.belongs_to(job, texts)?;
    let samples = file.samples(job)?;
    let (least, wanted) = (fewest(&samples), job.film.sampling.count());
    // The part of a picture that has all its samples isn't denoised, or wasn't written.
    let lacks_more = denoises || file.text(UNFINISHED).is_some();
    if least == wanted && !lacks_more {
        return Err(file.has_enough(least, wanted));
    }
    Ok(samples)
}

/// Whether a file is the finished part of a picture, with the samples of a job. The texts of one that is rendered now
/// are `texts`.
pub(crate) fn is_part_of(file: &Path, job: &Job, texts: &[(String, String)]) -> bool {
    let of_picture = |texts: &[(String, String)]| {
        let mut texts = nameless(picture_texts(texts));
        texts.retain(|(key, _)| key != METERED_EXPOSURE);
        texts
    };
    SampleFile::open("--part", file).is_ok_and(|file| {
        file.text(UNFINISHED).is_none()
            && file.belongs_to(job, texts).is_ok()
            && of_picture(&file.decoded.metadata) == of_picture(texts)
            && layers_of_texts(&file.decoded.metadata) == layers_of_texts(texts)
    })
}

/// The text of a file that tells how many samples its pixels have.
pub(crate) fn sample_texts(samples: &SampleBlocks) -> Option<(String, String)> {
    let (fewest, most) = (fewest(samples), samples.counts().iter().copied().max()?);
    let text = if fewest == most { fewest.to_string() } else { format!("{fewest} to {most}") };
    Some((SAMPLES_TEXT.into(), text))
}

/// Adds to a picture, and to the texts of its file, what another render needs to go on with it. `keeps_halves`: a part
/// of it has the halves of its samples, too, which denoising needs.
pub(crate) fn add_samples(rendering: &mut Rendering, texts: &mut Vec<(String, String)>, keeps_halves: bool) {
    let Some(samples) = &rendering.samples else { return };
    texts.extend(sample_texts(samples));
    let has = |name: &str| rendering.picture.layers.iter().any(|layer| layer.name == name);
    let mut all = samples.layers(&rendering.picture.pixels);
    if keeps_halves && !rendering.complete {
        all.extend(samples.half_layers());
    }
    let new: Vec<_> = all.into_iter().filter(|layer| !has(layer.name)).collect();
    rendering.picture.layers.extend(new);
}

/// Adds to a part of a picture, and to the texts of its file, what merging needs. These are the means of its blocks and
/// of their halves. They take the place of the halves of all samples.
pub(crate) fn add_part(rendering: &mut Rendering, texts: &mut Vec<(String, String)>) {
    rendering.picture.layers.retain(|layer| Aov::from_name(layer.name).is_none_or(|aov| !aov.is_half()));
    add_samples(rendering, texts, false);
    let halves = rendering.samples.as_ref().map_or_else(Vec::new, SampleBlocks::half_layers);
    rendering.picture.layers.extend(halves);
}
