//! The command that makes a picture again, from the settings in its file.

use crate::complete::PICTURE_TRANSFER;
use crate::model::is_model;
use crate::part::PART;
use crate::settings::{ALPHA, BACKGROUND, MODEL, PROGRESSIVE};
use crate::told_developing::exposure_text;
use canaletto::Named;
use canaletto::integrator::describe;
use canaletto::render::Aov;
use canaletto::scene::{Integrator, PathSettings, SamplePattern};
use canaletto_io::picture::{Decoded, PictureFormat, layer_channel_names};
use std::path::{Path, PathBuf};

/// A command line, and what it leaves open.
#[derive(Debug, PartialEq)]
pub(super) struct Recipe {
    /// The program and its arguments, unquoted.
    pub arguments: Vec<String>,
    /// The scene's file, if it was found in the current folder or beside the picture.
    pub scene: Option<PathBuf>,
}

impl Recipe {
    /// The recipe of a picture by this program. `None` if its file doesn't hold the settings.
    pub(super) fn of(path: &Path, format: PictureFormat, decoded: &Decoded) -> Option<Recipe> {
        let text = |key: &str| decoded.metadata.iter().find(|(k, _)| k == key).map(|(_, text)| text.as_str());
        let name = text("scene")?;
        let scene = found(name, path);
        let shown = scene.as_ref().map_or_else(|| name.to_owned(), |scene| scene.display().to_string());
        let mut flags = Flags(vec!["canaletto".into(), "render".into(), shown]);
        flags.with("--camera", text("camera"));
        flags.with("--size", text("size").map(|size| size.replace(' ', "x")));
        flags.with("--crop", text("crop").map(|crop| crop.replace(' ', ",")));
        let (samples, pattern) = sampling(text("sampling")?)?;
        flags.with("--pattern", pattern.map(|pattern| pattern.name()));
        flags.with("--samples", samples);
        flags.with("--sampler", text("sampler"));
        if text(PROGRESSIVE).is_some() {
            flags.0.push("--progressive".into());
        }
        flags.with("--seed", text("seed").filter(|seed| *seed != "0"));
        flags.with("--background", text(BACKGROUND).or(text(ALPHA).map(|_| "none")));
        flags.with("--exposure", exposure_text(&decoded.metadata));
        flags.with("--tone", text("tone"));
        flags.with("--transfer", text(PICTURE_TRANSFER).or(text("transfer")));
        flags.with("--integrator", text("integrator"));
        if text("integrator").and_then(Integrator::from_name).is_some_and(|own| describe(&own).whitted().is_some()) {
            flags.with("--stage", text("stage"));
            flags.with("--max-depth", text("max-depth"));
        }
        if matches!(text("shadows"), Some("false" | "none")) {
            flags.0.push("--no-shadows".into());
        }
        for (flag, value) in text(MODEL).map(model_flags).unwrap_or_default() {
            flags.with(&format!("--{flag}"), Some(value));
        }
        let by_paths = text("integrator") == Some(Integrator::Path(PathSettings::DEFAULT).name());
        match text("denoiser") {
            Some(denoiser) => flags.0.push(format!("--denoise={denoiser}")),
            None if by_paths && is_model(Path::new(name)) => flags.0.push("--denoise=none".into()),
            None => {}
        }
        for assignment in text("set").map(assignments).unwrap_or_default() {
            flags.with("--set", Some(assignment));
        }
        // A picture without a fingerprint was rendered without --frames.
        let frames = text("frames").or_else(|| text("frame").filter(|_| text("fingerprint").is_some()));
        flags.with("--frames", frames);
        flags.with("--fps", text("fps"));
        let layers = match text("layer") {
            Some(layer) => layer.to_owned(),
            None => layers(decoded).join(","),
        };
        flags.with("--aov", Some(layers).filter(|layers| !layers.is_empty()));
        let default = format.capabilities().and_then(|can| can.bits.first().copied());
        flags.with("--bits", Some(decoded.bits.to_string()).filter(|_| Some(decoded.bits) != default));
        let is_film = format == PictureFormat::Png && text("frames").is_some();
        flags.with("--format", is_film.then_some("apng"));
        // The whole picture takes no part's place.
        let file = || without_layer(path, text("layer")).display().to_string();
        flags.with("--output", text(PART).is_none().then(file));
        Some(Recipe { arguments: flags.0, scene })
    }

    /// The command as a shell takes it.
    pub(super) fn command(&self) -> String {
        self.arguments.iter().map(|argument| quoted(argument)).collect::<Vec<_>>().join(" ")
    }
}

/// The arguments so far.
struct Flags(Vec<String>);

impl Flags {
    fn with(&mut self, flag: &str, value: Option<impl Into<String>>) {
        if let Some(value) = value {
            self.0.extend([flag.to_owned(), value.into()]);
        }
    }
}

/// The scene's file in the current folder, or beside the picture. The picture holds its name without a folder.
fn found(scene: &str, picture: &Path) -> Option<PathBuf> {
    [PathBuf::from(scene), picture.with_file_name(scene)].into_iter().find(|place| place.is_file())
}

/// The values of --samples and --pattern by [`crate::settings::sampling_words`].
fn sampling(words: &str) -> Option<(Option<String>, Option<SamplePattern>)> {
    let (rays, places) = words.split_once(", ")?;
    let rays = rays.split(' ').next()?.to_owned();
    Some(match places {
        "through its corner" => (None, Some(SamplePattern::Corner)),
        "regular" => (Some(rays), Some(SamplePattern::Regular)),
        "jittered" => (Some(rays), Some(SamplePattern::Jittered)),
        _ if places.contains("where they differ") => {
            (Some(places.split(' ').next()?.to_owned()), Some(SamplePattern::Adaptive))
        }
        _ => (Some(rays), None),
    })
}

/// The values of --set, which the file holds with `; ` between them. Texts in quotes may contain that.
fn assignments(text: &str) -> Vec<String> {
    let mut all = vec![String::new()];
    let (mut quoted, mut escaped) = (false, false);
    for c in text.chars() {
        match c {
            ';' if !quoted => {
                all.push(String::new());
                continue;
            }
            '"' if !escaped => quoted = !quoted,
            _ => {}
        }
        escaped = c == '\\' && !escaped;
        if let Some(last) = all.last_mut() {
            last.push(c);
        }
    }
    all.iter().map(|assignment| assignment.trim().to_owned()).filter(|assignment| !assignment.is_empty()).collect()
}

/// The flags of a model's staging, which the file holds with `; ` between them.
fn model_flags(text: &str) -> Vec<(String, String)> {
    let pair = |word: &str| word.split_once('=').map(|(flag, value)| (flag.to_owned(), value.to_owned()));
    text.split("; ").filter_map(pair).collect()
}

/// The layers whose channels a picture has.
fn layers(decoded: &Decoded) -> Vec<&'static str> {
    let has = |aov: &Aov| layer_channel_names(*aov).all(|name| decoded.image.channel(&name).is_some());
    Aov::ALL.iter().filter(|aov| has(aov)).map(|aov| aov.name()).collect()
}

/// The file of the picture that a layer belongs to.
fn without_layer(path: &Path, layer: Option<&str>) -> PathBuf {
    let Some(name) = path.file_name().and_then(|name| name.to_str()) else { return path.to_owned() };
    match layer.and_then(|layer| name.split_once(&format!(".{layer}."))) {
        Some((before, after)) => path.with_file_name(format!("{before}.{after}")),
        None => path.to_owned(),
    }
}

/// An argument as a POSIX shell takes it.
pub(in crate::command) fn quoted(argument: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_./,:=+@%".contains(c);
    if !argument.is_empty() && argument.chars().all(is_plain) {
        return argument.to_owned();
    }
    format!("'{}'", argument.replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::sampling_words;
    use canaletto::scene::{FilmSettings, SamplerKind, Sampling};

    #[test]
    fn arguments_are_quoted_for_shells() {
        for (argument, shell) in [
            ("camera.fovy=20", "camera.fovy=20"),
            ("light.position=1 2", "'light.position=1 2'"),
            ("it's", r"'it'\''s'"),
            ("$HOME", "'$HOME'"),
            ("", "''"),
            ("#true", "'#true'"),
        ] {
            assert_eq!(quoted(argument), shell);
        }
    }

    #[test]
    fn assignments_are_told_apart() {
        assert_eq!(assignments("a.b=1 2; c=\"x; y\"; d=3"), ["a.b=1 2", "c=\"x; y\"", "d=3"]);
        assert_eq!(assignments(r#"a="x\"; y"; b=1"#), [r#"a="x\"; y""#, "b=1"]);
    }

    /// Each sampling is told in words of its own, from which the flags come back.
    #[test]
    fn samplings_are_read_back() {
        use SamplePattern as P;
        for (sampling, expected) in [
            (Sampling::Corner, (None, Some(P::Corner))),
            (Sampling::Center, (Some("1"), None)),
            (Sampling::Regular(3), (Some("9"), Some(P::Regular))),
            (Sampling::Jittered(4), (Some("16"), Some(P::Jittered))),
            (Sampling::Adaptive { n: 3, threshold: 0.1 }, (Some("9"), Some(P::Adaptive))),
            (Sampling::Sampled(10), (Some("10"), None)),
        ] {
            for sampler in SamplerKind::ALL {
                let words = sampling_words(&FilmSettings { sampling, sampler: *sampler, ..FilmSettings::default() });
                let (samples, pattern) = super::sampling(&words).unwrap();
                assert_eq!((samples.as_deref(), pattern), expected, "{words}");
            }
        }
    }

    #[test]
    fn a_layer_belongs_to_a_picture() {
        assert_eq!(without_layer(Path::new("a/s.0001.depth.png"), Some("depth")), Path::new("a/s.0001.png"));
        assert_eq!(without_layer(Path::new("a/depth.png"), None), Path::new("a/depth.png"));
    }
}
