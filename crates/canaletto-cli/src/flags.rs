//! The flags that several commands share, as typed. [`crate::settings`] defines their meaning.

use crate::backdrop::{BackgroundFlag, background};
use crate::failure::print_diagnostics;
use crate::model::is_model;
use crate::progress::{ProgressFlag, Style};
use crate::watch::ReadLog;
use canaletto::Named;
use canaletto::camera::Camera;
use canaletto::material::{PRESETS, Preset, StandardSurface};
use canaletto::scene::{Exposure, Integrator, SamplePattern, SamplerKind, Sampling, Stage, Tone, Transfer};
use canaletto::world::{BuildOptions, Quality};
use canaletto_io::diagnostic::Diagnostics;
use canaletto_io::import::{FORMATS, Ground, Moment, PictureQuality, StageLight, Staging, StandardView, UpAxis};
use canaletto_io::text::color;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Args, ValueEnum};
use std::path::PathBuf;

/// The help of the scene's argument.
fn scene_help() -> String {
    format!("The scene (.kdl), a model ({}), or - for a scene text on the standard input", model_extensions())
}

/// The extensions of models as help texts list them: `.obj, .ply`.
pub(crate) fn model_extensions() -> String {
    let all: Vec<String> = FORMATS.iter().flat_map(|f| f.extensions).map(|extension| format!(".{extension}")).collect();
    all.join(", ")
}

/// What a command that reports says, and how.
#[derive(Args, Clone, Debug)]
pub(crate) struct MessageFlags {
    /// Prints JSON
    #[arg(long, help_heading = "Messages")]
    pub json: bool,

    /// Sets how progress is shown on stderr
    #[arg(long, value_name = "HOW", default_value = "auto", help_heading = "Messages")]
    pub progress: ProgressFlag,

    /// Prints no warnings and no progress
    #[arg(short, long, help_heading = "Messages")]
    pub quiet: bool,
}

impl MessageFlags {
    /// How progress is shown.
    pub(crate) fn style(&self) -> Style {
        Style::new(self.progress, self.quiet)
    }

    /// Prints warnings, unless there shall be none.
    pub(crate) fn warn(&self, warnings: &Diagnostics) {
        if !self.quiet {
            print_diagnostics(warnings, self.progress == ProgressFlag::Json);
        }
    }
}

/// Which scene.
#[derive(Args, Clone, Debug)]
pub(crate) struct SourceFlags {
    #[arg(value_name = "SCENE", help = scene_help())]
    pub scene: PathBuf,

    /// Changes one value of the scene or model; may be repeated
    ///
    /// KEY is a path of words with dots between them: a node, the node's name if there are several, the words of the
    /// blocks in its braces, and a word in the last one. VALUE is written as in a scene text. Examples: --set
    /// integrator.max-depth=3, --set material.gold.standard.specular.roughness=0.4, --set 'light.key.position=0 5 0'.
    /// --set integrator=zbuffer selects an integrator before all else is set. Models have camera, film, integrator,
    /// background, ambient, material and light.
    #[arg(long = "set", value_name = "KEY=VALUE", help_heading = "Scene")]
    pub set: Vec<String>,

    #[command(flatten)]
    pub staging: StagingFlags,

    /// Lets the scene read files outside its own folder
    ///
    /// Use this only for scenes that you trust. Such a scene can name any file that you can read.
    #[arg(long, help_heading = "Scene")]
    pub allow_outside: bool,

    /// Sets the number of threads [default: one per processor]; changes no picture
    #[arg(long, allow_hyphen_values = true, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024),
        help_heading = "Scene")]
    pub threads: Option<u16>,

    /// Sets the quality of the acceleration structures (BVHs); changes no picture
    ///
    /// The high quality takes up to twice as long to build, and tracing a ray takes a few percent less time. It pays
    /// for very many rays and the same meshes.
    #[arg(long, value_name = "QUALITY", default_value = "medium", help_heading = "Scene")]
    pub build: BuildFlag,

    /// The files that are read.
    #[arg(skip)]
    pub log: ReadLog,
}

impl SourceFlags {
    /// All that changes the scene of the file, as words.
    pub(crate) fn changes(&self) -> Vec<String> {
        let staging = self.staging.given().into_iter().map(|(flag, value)| format!("--{flag} {value}"));
        self.set.iter().cloned().chain(staging).collect()
    }

    /// The options for a world that about this many rays traverse.
    pub(crate) fn build_options(&self, rays: u64) -> BuildOptions {
        let quality = match self.build {
            BuildFlag::Medium => Quality::Medium,
            BuildFlag::High => Quality::High,
        };
        BuildOptions { quality, rays, view: 0 }
    }
}

/// How a model is shown. Scene texts say it themselves.
#[derive(Args, Clone, Debug, Default, PartialEq)]
pub(crate) struct StagingFlags {
    /// Shows a model from one of these sides, instead of by the file's camera [default of files without one:
    /// three-quarter]
    #[arg(long, value_name = "SIDE", value_parser = named::<StandardView>(), help_heading = "Models")]
    pub view: Option<StandardView>,

    /// Lights a model, instead of the file's lights [default of files without any: studio]
    #[arg(long, value_name = "LIGHT", value_parser = named::<StageLight>(), help_heading = "Models")]
    pub light: Option<StageLight>,

    /// Says which axis of a model's file points upwards [default: z in STL files, else y]
    #[arg(long, value_name = "AXIS", value_parser = named::<UpAxis>(), help_heading = "Models")]
    pub up: Option<UpAxis>,

    /// Turns a model about the vertical, counter-clockwise seen from above
    #[arg(long, value_name = "DEGREES", allow_negative_numbers = true, value_parser = degrees, help_heading = "Models")]
    pub turn: Option<f64>,

    /// Turns a model once in N frames, which are all rendered unless --frames says which
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000_000),
        help_heading = "Models")]
    pub turntable: Option<u32>,

    /// Gives the objects of a model that have no material a preset of the standard surface, such as gold
    #[arg(long, value_name = "PRESET", value_parser = PossibleValuesParser::new(PRESETS.iter().map(|row| row.name)),
        help_heading = "Models")]
    pub material: Option<String>,

    /// Shows a model at this time of its animation, in seconds; frame 0 of --frames is there
    #[arg(long, value_name = "SECONDS", value_parser = seconds, help_heading = "Models")]
    pub at: Option<f64>,

    /// Plays this clip of a model's animations [default with --at, --frames or a film: the first]
    #[arg(long, value_name = "NAME", help_heading = "Models")]
    pub clip: Option<String>,

    /// Shows a model with this variant of its materials
    #[arg(long, value_name = "NAME", help_heading = "Models")]
    pub variant: Option<String>,

    /// Sets what a model stands on: nothing (none), a floor that shows shadows only (shadow), or a floor of a colour,
    /// such as #808080 or white [default: shadow]
    #[arg(long, value_name = "GROUND", value_parser = ground, help_heading = "Models")]
    pub ground: Option<GroundFlag>,

    /// Whether frames play the model's first clip.
    #[arg(skip)]
    pub plays: bool,

    /// Whether a model gets nothing that it lacks.
    #[arg(skip)]
    pub bare: bool,

    /// Sets the samples of a model's picture by paths, and its denoiser [default: good]
    #[arg(long, value_name = "QUALITY", value_parser = named::<PictureQuality>(), help_heading = "Models")]
    pub quality: Option<PictureQuality>,
}

impl StagingFlags {
    /// The staging that the flags ask for.
    pub(crate) fn staging(&self) -> Staging {
        Staging {
            light: self.light,
            view: self.view,
            up: self.up,
            turn: self.turn.unwrap_or(0.0),
            turntable: self.turntable,
            material: self.material.as_deref().and_then(preset),
            ground: self.ground.as_ref().map(|flag| flag.ground).unwrap_or_default(),
            moment: (self.at.is_some() || self.clip.is_some())
                .then(|| Moment { clip: self.clip.clone(), seconds: self.at.unwrap_or(0.0) }),
            plays: self.plays,
            bare: self.bare,
            variant: self.variant.clone(),
            quality: self.quality.unwrap_or_default(),
            ..Staging::default()
        }
    }

    /// The flags that are given, each with its value.
    pub(crate) fn given(&self) -> Vec<(&'static str, String)> {
        let StagingFlags { view, light, up, turn, turntable, material, at, clip, variant, ground, quality, .. } = self;
        let all = [
            ("view", view.map(|view| view.name().to_owned())),
            ("light", light.map(|light| light.name().to_owned())),
            ("up", up.map(|up| up.name().to_owned())),
            ("turn", turn.map(|turn| turn.to_string())),
            ("turntable", turntable.map(|frames| frames.to_string())),
            ("material", material.clone()),
            ("at", at.map(|at| at.to_string())),
            ("clip", clip.clone()),
            ("variant", variant.clone()),
            ("ground", ground.as_ref().map(|ground| ground.word.clone())),
            ("quality", quality.map(|quality| quality.name().to_owned())),
        ];
        all.into_iter().filter_map(|(flag, value)| Some((flag, value?))).collect()
    }
}

/// The value of --ground.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct GroundFlag {
    /// The word as given.
    word: String,
    ground: Ground,
}

fn seconds(text: &str) -> Result<f64, String> {
    let number = text.strip_suffix('s').unwrap_or(text);
    let seconds = number.parse().ok().filter(|v: &f64| v.is_finite() && *v >= 0.0);
    seconds.ok_or_else(|| "write a time in seconds, 0 or more, such as 1.5s".into())
}

fn degrees(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|v: &f64| v.is_finite()).ok_or_else(|| "write a number of degrees, such as 30".into())
}

/// The surface of a preset.
fn preset(name: &str) -> Option<StandardSurface> {
    PRESETS.iter().find(|preset| preset.name == name).map(Preset::surface)
}

fn ground(text: &str) -> Result<GroundFlag, String> {
    let ground = match text {
        "none" => Some(Ground::None),
        "shadow" => Some(Ground::Shadow),
        word => color(word).map(Ground::Color),
    };
    let ground = ground.ok_or("write none, shadow, or a colour such as #808080")?;
    Ok(GroundFlag { word: text.to_owned(), ground })
}

/// The quality of BVHs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum BuildFlag {
    /// A fast build: binned SAH with presplit triangles
    Medium,
    /// Moves subtrees to where the SAH cost is lowest (reinsertion)
    High,
}

/// Which picture of the scene. What isn't given is as the scene says.
#[derive(Args, Clone, Debug, Default)]
pub(crate) struct PictureFlags {
    /// Selects a camera of the scene by its name [default: the first]
    #[arg(long, value_name = "NAME", help_heading = "Picture")]
    pub camera: Option<String>,

    /// Sets the picture's width and height in pixels, such as 640x480, or in percent of the camera's, such as 50%
    ///
    /// The vertical angle of view stays. A percentage scales the scene's crop window, too; --crop is in pixels of the
    /// new size.
    #[arg(long, allow_hyphen_values = true, value_name = "WxH|N%", value_parser = size, help_heading = "Picture")]
    pub size: Option<PictureSize>,

    /// Renders only this window of the picture, in pixels from the top left
    #[arg(long, allow_hyphen_values = true, value_name = "X,Y,W,H", value_parser = crop, help_heading = "Picture")]
    pub crop: Option<[u32; 4]>,

    /// Sets how many camera rays each pixel gets, up to 65536
    ///
    /// The sampler places them in the pixel; a single ray goes through the centre. --pattern regular, jittered and
    /// adaptive need a square number up to 256, for n x n rays on a grid. With adaptive, only pixels where colours
    /// change get the grid.
    #[arg(long, allow_hyphen_values = true, value_name = "N", value_parser = samples, help_heading = "Sampling")]
    pub samples: Option<u32>,

    /// Sets where in the pixel the camera rays go, instead of where the sampler places them
    #[arg(long, alias = "sample", value_name = "PATTERN", value_parser = named::<SamplePattern>(),
        help_heading = "Sampling")]
    pub pattern: Option<SamplePattern>,

    /// Sets by which numbers all sampling goes [default: the scene's, or sobol]
    ///
    /// The sampler spreads the rays of a pixel over the pixel (without --pattern), the lens, the shutter time, the
    /// lights and the directions of rough surfaces.
    #[arg(long, value_name = "KIND", value_parser = named::<SamplerKind>(), help_heading = "Sampling")]
    pub sampler: Option<SamplerKind>,

    /// Sets the seed of the random numbers; the same seed gives the same picture
    #[arg(long, allow_negative_numbers = true, value_name = "N", help_heading = "Sampling")]
    pub seed: Option<u64>,

    /// Makes the picture grow by passes of samples, which --samples counts: it can be stopped, gone on with and added
    /// up
    ///
    /// --time, --noise, --clamp, --continue and --first-sample imply it, and pictures by paths always grow. The rays of
    /// a growing picture don't depend on how many there will be. Its noise is that of others, and its last bits differ.
    #[arg(long, help_heading = "Sampling")]
    pub progressive: bool,

    /// Selects the integrator: how the picture is made [default: the scene's, or whitted]
    ///
    /// The settings are the scene's if it names the same integrator, else the integrator's defaults. --set changes
    /// them, such as --integrator zbuffer --set integrator.shadows=none.
    #[arg(long, value_name = "NAME", value_parser = named::<Integrator>(), help_heading = "Light")]
    pub integrator: Option<Integrator>,

    /// Sets how much of the shading equation is computed: a stage of the chapter, which contains those before it
    #[arg(long, value_name = "STAGE", value_parser = named::<Stage>(), help_heading = "Light")]
    pub stage: Option<Stage>,

    /// Sets the largest depth of reflected and refracted rays; camera rays have depth 1. Of paths, the most surfaces
    /// that scatter light
    #[arg(long, allow_hyphen_values = true, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=256),
        help_heading = "Light")]
    pub max_depth: Option<u32>,

    /// Renders without shadows
    #[arg(long, help_heading = "Light")]
    pub no_shadows: bool,

    /// Shows the background of the scene, none, a colour, a gradient or a picture [default: the scene's film]
    ///
    /// none is a transparent one: a PNG, WebP, APNG or EXR has an alpha. What the camera sees straight on is left out,
    /// also through holes, media and panes that don't bend it. Reflections and light of the background stay. The shadow
    /// on a model's floor is in the alpha.
    ///
    /// Anything else is laid under such a picture, and looks as it is given. It is a colour such as '#ffffff', or
    /// colours from the top to the bottom such as '#fff,#9ab'. A picture's file covers all of it.
    #[arg(long, value_name = "none|scene|COLOR[,COLOR]|FILE", value_parser = background, help_heading = "Colour")]
    pub background: Option<BackgroundFlag>,

    /// Sets the exposure in stops: 1 doubles the light, -1 halves it; auto meters the picture, as paths do by default.
    /// EXR files keep their light
    #[arg(long, value_name = "STOPS", allow_hyphen_values = true, help_heading = "Colour")]
    pub exposure: Option<Exposure>,

    /// Sets the mapping of exposed light to the range of a display [default: clamp; of paths agx]
    #[arg(long, value_name = "HOW", value_parser = named::<Tone>(), help_heading = "Colour")]
    pub tone: Option<Tone>,

    /// Sets the transfer curve from linear light to stored numbers; EXR files are always linear
    #[arg(long, value_name = "CURVE", value_parser = named::<Transfer>(), help_heading = "Colour")]
    pub transfer: Option<Transfer>,
}

impl PictureFlags {
    /// The integrator that the flags ask for. Stages and shadows that are left out are those of the classic one, which
    /// isn't that of models.
    pub(crate) fn integrator_of(&self, source: &SourceFlags) -> Option<Integrator> {
        let is_classic = (self.stage.is_some() || self.no_shadows) && is_model(&source.scene);
        self.integrator.or_else(|| is_classic.then(Integrator::default))
    }
}

/// The value of --size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum PictureSize {
    /// Width and height in pixels.
    Pixels([u32; 2]),
    /// A share of the camera's width and height; 1 leaves them as they are.
    Share(f64),
}

impl PictureSize {
    /// The size for a camera of this size, which may be larger than a camera can be.
    pub(crate) fn of(self, camera: [u32; 2]) -> [u32; 2] {
        match self {
            PictureSize::Pixels(size) => size,
            PictureSize::Share(_) => camera.map(|side| self.scaled(side).max(1)),
        }
    }

    /// A window in a picture of the camera's size, for the picture of this size.
    pub(crate) fn window(self, window: [u32; 4]) -> [u32; 4] {
        if let PictureSize::Pixels(_) = self {
            return window;
        }
        let [x, y, width, height] = window;
        // The edges are scaled, so that windows side by side stay side by side.
        let [left, top] = [x, y].map(|edge| self.scaled(edge));
        let [right, bottom] = [x.saturating_add(width), y.saturating_add(height)].map(|edge| self.scaled(edge));
        [left, top, (right - left).max(1), (bottom - top).max(1)]
    }

    fn scaled(self, length: u32) -> u32 {
        let share = if let PictureSize::Share(share) = self { share } else { 1.0 };
        // The cast saturates.
        (f64::from(length) * share).round() as u32
    }
}

/// The parser of a closed set's words, with a line of help for each.
pub(crate) fn named<T: Named + Clone + Send + Sync>() -> impl TypedValueParser<Value = T> {
    let words = T::ALL.iter().map(|value| PossibleValue::new(value.name()).help(value.meaning()));
    PossibleValuesParser::new(words).try_map(|word| T::from_name(&word).ok_or("the word has no meaning"))
}

fn size(text: &str) -> Result<PictureSize, String> {
    let expected = || "write width x height, such as 640x480, or a percentage, such as 50%".to_owned();
    if let Some(percent) = text.trim().strip_suffix('%') {
        return match percent.trim().parse::<f64>() {
            Ok(percent) if percent > 0.0 && percent.is_finite() => Ok(PictureSize::Share(percent / 100.0)),
            Ok(_) => Err("the percentage must be more than 0".into()),
            Err(_) => Err(expected()),
        };
    }
    let (width, height) = text.split_once(['x', 'X']).ok_or_else(expected)?;
    let side = |text: &str| match text.trim().parse::<u32>() {
        Ok(n) if (1..=Camera::MAX_SIDE).contains(&n) => Ok(n),
        Ok(_) => Err(format!("each side must be between 1 and {} pixels", Camera::MAX_SIDE)),
        Err(_) => Err(expected()),
    };
    Ok(PictureSize::Pixels([side(width)?, side(height)?]))
}

fn crop(text: &str) -> Result<[u32; 4], String> {
    let [x, y, width, height] = numbers(text).ok_or("write four whole numbers: left,top,width,height")?;
    if width == 0 || height == 0 {
        Err("the part must be at least 1 x 1 pixel".into())
    } else {
        Ok([x, y, width, height])
    }
}

/// The coordinates "x,y" of a pixel.
pub(crate) fn pixel(text: &str) -> Result<[u32; 2], String> {
    numbers(text).ok_or_else(|| "write two whole numbers from 0 on: column,row".into())
}

fn numbers<const N: usize>(text: &str) -> Option<[u32; N]> {
    let all: Option<Vec<u32>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
    all?.try_into().ok()
}

fn samples(text: &str) -> Result<u32, String> {
    let wanted: u32 =
        text.parse().map_err(|_| match (SamplePattern::from_name(text), SamplerKind::from_name(text)) {
            (_, Some(kind)) => format!("write a whole number; the sampler is chosen by --sampler {}", kind.name()),
            (Some(pattern), None) => {
                format!("write a whole number; the places are chosen by --pattern {}", pattern.name())
            }
            (None, None) => "write a whole number".to_owned(),
        })?;
    match wanted {
        0 => Err("a pixel needs at least 1 ray".into()),
        _ if wanted > Sampling::MAX_SAMPLES => Err(format!("the most is {}", Sampling::MAX_SAMPLES)),
        _ => Ok(wanted),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_counted() {
        assert_eq!((samples("1"), samples("10"), samples("65536")), (Ok(1), Ok(10), Ok(65_536)));
        assert!(samples("65537").unwrap_err().contains("65536"));
        assert!(samples("0").unwrap_err().contains("at least 1"));
        for text in ["-4", "four"] {
            assert_eq!(samples(text).unwrap_err(), "write a whole number");
        }
        assert!(samples("sobol").unwrap_err().ends_with("--sampler sobol"));
        assert!(samples("corner").unwrap_err().ends_with("--pattern corner"));
    }

    #[test]
    fn sizes_and_windows() {
        assert_eq!(size("640x480"), Ok(PictureSize::Pixels([640, 480])));
        assert_eq!(size("12.5%"), Ok(PictureSize::Share(0.125)));
        for wrong in ["640", "%", "x%"] {
            assert!(size(wrong).unwrap_err().contains("640x480"), "{wrong}");
        }
        for wrong in ["0%", "-5%", "inf%", "nan%"] {
            assert!(size(wrong).unwrap_err().contains("more than 0"), "{wrong}");
        }
        let half = PictureSize::Share(0.5);
        assert_eq!((half.of([640, 1]), half.window([10, 5, 21, 1])), ([320, 1], [5, 3, 11, 1]));
        assert_eq!(PictureSize::Pixels([9, 8]).window([1, 2, 3, 4]), [1, 2, 3, 4]);
        assert!(size("0x4").unwrap_err().contains("between 1 and"));
        assert!(size("99999999999x4").unwrap_err().contains("640x480"));
        assert_eq!(crop("1, 2,3,4"), Ok([1, 2, 3, 4]));
        for text in ["1,2,3", "1,2,3,4,5", "-1,2,3,4"] {
            assert!(crop(text).unwrap_err().contains("four whole numbers"), "{text}");
        }
        assert!(crop("1,2,3,0").unwrap_err().contains("at least 1 x 1"));
        assert_eq!(pixel("115,80"), Ok([115, 80]));
    }

    #[test]
    fn words_of_closed_sets_are_parsed_with_their_help() {
        let command = clap::Command::new("test").arg(clap::Arg::new("stage").value_parser(named::<Stage>()));
        for &stage in Stage::ALL {
            let matches = command.clone().try_get_matches_from(["test", stage.name()]).unwrap();
            assert_eq!(matches.get_one::<Stage>("stage"), Some(&stage));
        }
        assert!(command.clone().try_get_matches_from(["test", "shadows"]).is_err());
        let words = command.get_arguments().next().unwrap().get_possible_values();
        assert_eq!(words[4].get_help().unwrap().to_string(), Stage::Shadow.meaning());
    }
}
