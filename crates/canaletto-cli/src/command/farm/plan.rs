//! What a job does, whatever its engine: the commands of its parts, of what comes before them and after.

use super::words::{Group, group, typed};
use super::{Engine, FarmFlags};
use crate::command::prepare::PrepareFlags;
use crate::command::render::{RenderFlags, frames_of, stem};
use crate::command_files::CommandFiles;
use crate::failure::Failure;
use crate::format::plural;
use crate::guiding_file::is_guided;
use crate::output::{Output, OutputFlags};
use crate::part::{PartFlags, Split, check};
use crate::passes::growing;
use crate::progress::ProgressFlag;
use crate::settings::Settings;
use crate::solutions::fingerprint;
use crate::source::STDIN;
use crate::watch::ReadLog;
use clap::{Args, Command, FromArgMatches, ValueEnum};
use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// The parts of a job without --parts, and the most frames that are parts of their own. Slurm's arrays have 1,001
/// tasks unless its administrator allows more.
const PARTS: u32 = 8;
const MOST_FRAMES: u64 = 1000;

/// A word of a command: as it is, or one that the engine replaces.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Word {
    Text(OsString),
    /// The scene.
    Scene(PathBuf),
    /// A file that is read.
    Input(&'static str, PathBuf),
    /// K/N of the part.
    Part,
    /// A file in the folder of parts. A `*` stands for the part's number.
    Work(&'static str),
    /// The folder of parts.
    WorkFolder,
    /// The file of the result.
    Output(PathBuf),
}

/// A job.
pub(super) struct FarmPlan {
    /// The scene's file as it was given.
    pub scene: PathBuf,
    /// The result: the picture, the film, or the pattern of the frames.
    pub output: PathBuf,
    pub split: Split,
    pub parts: u32,
    /// The number of threads of a part, if it was given.
    pub threads: Option<u16>,
    /// The command that prepares the picture, if it pays.
    pub prepare: Option<Vec<Word>>,
    pub part: Vec<Word>,
    /// The command that makes the result of the parts, unless the parts are the result.
    pub merge: Option<Vec<Word>>,
    frames: Option<String>,
    files: CommandFiles,
}

/// The flags of `render` that a job of parts can't have, with the reason.
const REFUSED: [(&str, &str); 9] = [
    ("more", "a job has one scene"),
    ("part", "the job says itself which part it makes; --parts says how many"),
    ("continue_from", "parts keep checkpoints, and are taken up by themselves"),
    ("time", "the number of samples would depend on the machine"),
    ("watch", "nobody changes the scene meanwhile"),
    ("preview", "parts aren't seen while they are made"),
    ("dry_run", "a job is for rendering"),
    ("contact_sheet", "the pictures are made by many runs"),
    ("save_solution", "the job prepares it by itself"),
];
/// The arguments of `farm` that the commands of a job don't repeat.
const OWN: [&str; 9] = ["engine", "parts", "job", "scene", "split", "output", "mkdir", "checkpoint", "progress"];
/// The flags about the file of the result.
const OF_FILE: [&str; 6] = ["format", "bits", "compression", "jpeg_quality", "uint_ids", "no_clobber"];

impl FarmPlan {
    /// The job of a command line, whose scene is read to check that it has parts.
    pub(super) fn new(flags: &FarmFlags) -> Result<FarmPlan, Failure> {
        let command = FarmFlags::augment_args(Command::new("farm"));
        let words: Vec<OsString> = std::env::args_os().skip(2).collect();
        let groups = group(&words, &command);
        let has = |id: &str| groups.iter().any(|group| group.id.as_deref() == Some(id));
        if let Some((id, why)) = REFUSED.iter().find(|(id, _)| has(id)) {
            let name = command.get_arguments().find(|arg| arg.get_id() == id).and_then(clap::Arg::get_long);
            let name = name.map_or_else(|| "more scenes".to_owned(), |long| format!("--{long}"));
            return Err(Failure::usage(format!("farm: {name} can't be had in a job: {why}")).help("leave it out"));
        }
        let render = &flags.render;
        if render.source.scene == Path::new(STDIN) {
            return Err(Failure::usage("farm: each part reads the scene, so the standard input won't do")
                .help("name the scene's file"));
        }
        let keeps_checkpoints = match render.checkpoints.checkpoint.as_deref() {
            None => true,
            Some(file) if file == Path::new("off") => false,
            Some(_) => {
                return Err(Failure::usage("farm: --checkpoint names one file, and each part has its own")
                    .help("leave it out, or give --checkpoint off"));
            }
        };
        let asks_for_frames = render.frames.is_some() || render.output.is_film();
        let split = match (render.parts.split, asks_for_frames) {
            (None, true) | (Some(Split::Frames), true) => Split::Frames,
            (None, false) => Split::Samples,
            (Some(Split::Frames), false) => {
                return Err(Failure::usage("farm: --split frames: there is one picture")
                    .help("add --frames, such as --frames all, or leave --split out"));
            }
            (Some(split), false) => split,
            (Some(_), true) => {
                return Err(Failure::usage("farm: of frames each part has some, as --split frames says")
                    .help("leave --split out"));
            }
        };
        let checked = Checked::new(render, split, flags.parts)?;
        let Checked { output, is_film, parts, needs_preparing, grows, frames, fps } = checked;
        let is_of_frames = split == Split::Frames;
        let repeats = |is_repeated: &dyn Fn(&str) -> bool| -> Vec<Word> {
            let is_there = |group: &&Group| group.id.as_deref().is_some_and(is_repeated);
            groups.iter().filter(is_there).flat_map(|group| group.words.iter().cloned().map(Word::Text)).collect()
        };
        let is_of = |id: &str, command: &Command| {
            !OWN.contains(&id) && command.get_arguments().any(|arg| arg.get_id().as_str() == id)
        };
        let is_merged = !is_of_frames || is_film;
        let render_command = RenderFlags::augment_args(Command::new("render"));
        let mut part = vec![text("render"), Word::Scene(render.source.scene.clone())];
        part.extend(repeats(&|id| is_of(id, &render_command) && !(is_merged && OF_FILE.contains(&id))));
        check_words(&part, flags, &render_command)?;
        let files = input_files(render);
        name_inputs(&mut part, &files);
        if is_of_frames && render.frames.is_none() {
            part.extend([text("--frames"), text("all")]);
        }
        let mut prepare = None;
        if needs_preparing && !is_of_frames && render.solution.solution.is_none() && render.prepared.prepared.is_none()
        {
            let prepare_command = PrepareFlags::augment_args(Command::new("prepare"));
            let mut words = vec![text("prepare"), Word::Scene(render.source.scene.clone())];
            words.extend(repeats(&|id| is_of(id, &prepare_command) && !OF_FILE.contains(&id)));
            name_inputs(&mut words, &files);
            words.extend([text("-o"), Word::Work("prepared.state")]);
            prepare = Some(words);
            part.extend([text("--prepared"), Word::Work("prepared.state")]);
        }
        part.extend([text("--part"), Word::Part, text("--split")]);
        part.push(text(split.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned())));
        if keeps_checkpoints && grows {
            part.extend([text("--checkpoint"), Word::Work("part-*.checkpoint.exr")]);
        }
        part.push(text("-o"));
        part.push(match (is_of_frames, is_film) {
            (true, true) => Word::Work("frame.#######.png"),
            (true, false) => Word::Output(output.clone()),
            _ => Word::Work("part-*.exr"),
        });
        let merge = is_merged.then(|| {
            let mut words = vec![text("merge"), Word::WorkFolder, text("-o"), Word::Output(output.clone())];
            if is_film {
                words.extend([text("--fps"), text(fps.to_string())]);
            }
            words.extend(repeats(&|id| OF_FILE.contains(&id)));
            words
        });
        let threads = render.source.threads;
        Ok(FarmPlan {
            scene: render.source.scene.clone(),
            output,
            split,
            parts,
            threads,
            prepare,
            part,
            merge,
            frames,
            files,
        })
    }

    /// The name of the picture without its extension and the number of frames.
    pub(super) fn name(&self) -> String {
        let name = stem(&self.output);
        let name = name.split('#').next().unwrap_or(&name).trim_end_matches(['.', '-', '_']);
        if name.is_empty() { "frames".to_owned() } else { name.to_owned() }
    }

    /// The folder of parts, beside the result.
    pub(super) fn work(&self) -> PathBuf {
        self.output.with_file_name(format!("{}.parts", self.name()))
    }

    /// The job's file without --job.
    pub(super) fn default_job(&self, engine: Engine) -> PathBuf {
        let name = self.name();
        PathBuf::from(match engine {
            Engine::Slurm => format!("{name}.slurm.sh"),
            Engine::Parallel => format!("{name}.parallel.sh"),
            Engine::Make => format!("{name}.mk"),
            Engine::Openjd => format!("{name}.openjd"),
        })
    }

    /// Checks that no file of the job is one that it reads or makes.
    pub(super) fn check_job_files(&self, paths: &[PathBuf]) -> Result<(), Failure> {
        let made = CommandFiles::default().writes("--output", [self.output.clone()]);
        self.files.clone().and(made).writes("--job", paths.to_vec()).check()
    }

    /// What the job does, in words.
    pub(super) fn summary(&self) -> String {
        let parts = plural(self.parts.into(), "part");
        let of = match (&self.frames, self.split) {
            (Some(frames), _) => format!("frames {frames}"),
            (None, Split::Tiles) => "rows of the picture".to_owned(),
            _ => "samples of the picture".to_owned(),
        };
        let then = if self.merge.is_some() { format!(", then {}", self.output.display()) } else { String::new() };
        format!("{parts} with {of}{then}")
    }

    /// The command line that runs the job.
    pub(super) fn how_to_run(&self, engine: Engine, job: &Path) -> String {
        let job = typed(job);
        match engine {
            Engine::Slurm => format!("bash {job}"),
            Engine::Parallel => format!("bash {job}   (HOSTS=a,b,c runs it on these machines by ssh)"),
            Engine::Make => format!("make -f {job}   (HOSTS='a b c' -j 3 runs it on these machines by ssh)"),
            Engine::Openjd => {
                let step = if self.merge.is_some() { "Merge --run-dependencies" } else { "Render" };
                format!("openjd run {job}/template.yaml -p file://{job}/values.json --step {step}")
            }
        }
    }
}

/// What is known of a job when its scene was read.
struct Checked {
    output: PathBuf,
    is_film: bool,
    parts: u32,
    needs_preparing: bool,
    /// Whether the pictures grow, so that they have checkpoints.
    grows: bool,
    frames: Option<String>,
    fps: f64,
}

impl Checked {
    fn new(flags: &RenderFlags, split: Split, parts: Option<u32>) -> Result<Checked, Failure> {
        let mut flags = flags.clone();
        let mut reader = flags.open()?;
        let is_of_frames = split == Split::Frames;
        let name = stem(&flags.source.scene);
        let output = Output::new(&flags.output, &name, flags.frames.is_some(), is_of_frames)?;
        if output.is_stdout() {
            return Err(Failure::usage("farm: --output - won't do for a job").help("name a file, such as -o room.png"));
        }
        let is_film = output.format.film().is_some();
        let frames = frames_of(&flags, &output, &reader)?;
        let fps = flags.fps.unwrap_or(reader.timeline().fps);
        let source = reader.at(frames.first)?;
        let settings = Settings::new(&source.name, &source.scene, &flags.picture)?;
        settings.check_pixels()?;
        let mut job = flags.passes.apply(settings.job, flags.picture.samples)?;
        let needs_preparing = fingerprint(&source.scene, &job).is_some() || is_guided(&job);
        let default = if is_of_frames { frames.count().min(MOST_FRAMES) as u32 } else { PARTS };
        let parts = parts.unwrap_or(default);
        if is_of_frames {
            PartFlags::one(1, parts, split).frames(frames)?;
        } else {
            job = growing(job, "--part")?;
            check(&job)?;
            flags.check_part()?;
            if !flags.aov.is_empty() && !output.format.has_layers() {
                let name = output.format.short_name();
                return Err(Failure::usage(format!("--aov: {name} has no layers, which parts are merged to"))
                    .help("end the name of --output in .exr"));
            }
            for number in 1..=parts {
                PartFlags::one(number, parts, split).cut(&job)?;
            }
        }
        Ok(Checked {
            output: output.pattern().to_owned(),
            is_film,
            parts,
            needs_preparing,
            grows: job.is_progressive(),
            frames: is_of_frames.then(|| frames.to_string()),
            fps,
        })
    }
}

fn text(word: impl Into<OsString>) -> Word {
    Word::Text(word.into())
}

/// Checks that the words of a part are those of the command line, without what a job says itself.
fn check_words(part: &[Word], flags: &FarmFlags, command: &Command) -> Result<(), Failure> {
    let words = part.iter().filter_map(|word| match word {
        Word::Text(word) => Some(word.clone()),
        Word::Scene(scene) => Some(scene.clone().into_os_string()),
        _ => None,
    });
    let parsed = command.clone().try_get_matches_from(words);
    let parsed = parsed.ok().and_then(|matches| RenderFlags::from_arg_matches(&matches).ok());
    let told = |flags: &RenderFlags| {
        let mut flags = flags.clone();
        (flags.output, flags.source.log) = (OutputFlags::default(), ReadLog::default());
        (flags.parts, flags.checkpoints.checkpoint, flags.progress) = (PartFlags::default(), None, ProgressFlag::Auto);
        format!("{flags:?}")
    };
    match parsed.is_some_and(|parsed| told(&parsed) == told(&flags.render)) {
        true => Ok(()),
        false => Err(Failure::usage("farm: the flags can't be told apart").help("write each as --flag=value")),
    }
}

/// The files that the flags name to be read.
fn input_files(flags: &RenderFlags) -> CommandFiles {
    let background = flags.picture.background.as_ref().and_then(crate::backdrop::BackgroundFlag::file);
    CommandFiles::default()
        .reads("SCENE", [&flags.source.scene])
        .reads("--background", background)
        .reads("--solution", &flags.solution.solution)
        .reads("--prepared", &flags.prepared.prepared)
}

/// Marks the words that are files to be read, which may lie elsewhere on another machine. `--flag=FILE` becomes two
/// words.
fn name_inputs(words: &mut Vec<Word>, files: &CommandFiles) {
    for (flag, path) in files.inputs().filter(|(flag, _)| *flag != "SCENE") {
        let input = || Word::Input(flag, path.to_owned());
        let mut joined = OsString::from(format!("{flag}="));
        joined.push(path);
        if let Some(at) = words.iter().position(|word| *word == text(joined.clone())) {
            words.splice(at..=at, [text(flag), input()]);
        } else if let Some(at) = words.windows(2).position(|pair| pair[0] == text(flag) && pair[1] == text(path)) {
            words[at + 1] = input();
        }
    }
}
