//! `canaletto render`: renders scenes to pictures.

mod contact_sheet;
mod dry_run;
mod film_frames;
mod frame_writer;
mod plan;
mod series;

use crate::backdrop::BackgroundFlag;
use crate::checkpoint::CheckpointFlags;
use crate::command_files::CommandFiles;
use crate::denoiser::{DenoiseFlag, Denoiser, denoise_flag};
use crate::exit::Exit;
use crate::failure::{Failure, print_diagnostics};
use crate::flags::{PictureFlags, SourceFlags};
use crate::frames::{FramesFlag, fps};
use crate::guiding_file::PreparedFlags;
use crate::layers::MAPPINGS;
use crate::memory::Memory;
use crate::model::is_model;
use crate::output::OutputFlags;
use crate::output_format::Format;
use crate::part::{PartFlags, is_in_parts, not_in_parts};
use crate::partial::{partial, with_samples};
use crate::passes::PassFlags;
use crate::progress::{ProgressFlag, Style};
use crate::settings::Settings;
use crate::solutions::{SolutionFlags, Solutions, fingerprint};
use crate::source::{Reader, STDIN, build, on_threads};
use crate::watch::watch;
use canaletto::Named;
use canaletto::render::{Aov, Job};
use canaletto::scene::Integrator;
use canaletto_io::diagnostic::closest_word;
use canaletto_io::import::PictureQuality;
use clap::Args;
use contact_sheet::ContactSheet;
use dry_run::{dry_run, room};
use plan::Plan;
pub(crate) use plan::frames_of;
use series::Series;
use std::path::{Path, PathBuf};

/// Renders a scene or a model to a picture.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXAMPLES, after_long_help = long_help())]
pub(crate) struct RenderFlags {
    #[command(flatten)]
    pub source: SourceFlags,

    /// More scenes, each rendered to a separate file; --output then names a folder, or has {name} in it
    #[arg(value_name = "MORE")]
    pub more: Vec<PathBuf>,

    #[command(flatten)]
    pub output: OutputFlags,
    #[command(flatten)]
    pub picture: PictureFlags,
    #[command(flatten)]
    pub passes: PassFlags,
    #[command(flatten)]
    pub checkpoints: CheckpointFlags,
    #[command(flatten)]
    pub parts: PartFlags,
    #[command(flatten)]
    pub prepared: PreparedFlags,
    #[command(flatten)]
    pub solution: SolutionFlags,
    /// Renders frames A to B, every Nth of them, or all frames of the scene's animation
    ///
    /// Each frame has different random numbers. A complete frame of the same scene, settings and program is kept: the
    /// same command continues a stopped series. Films are always rendered from their first frame on.
    #[arg(long, allow_hyphen_values = true, value_name = "A-B[xN]|all", value_parser = FramesFlag::parse,
        help_heading = "Frames")]
    pub frames: Option<FramesFlag>,

    /// Sets the frames per second [default: the scene's, or 25]
    ///
    /// The rate is the speed of films, and converts keys in seconds to frames.
    #[arg(long, allow_hyphen_values = true, value_name = "N", value_parser = fps, help_heading = "Frames")]
    pub fps: Option<f64>,

    /// Renders complete frames again
    #[arg(long, help_heading = "Frames")]
    pub force: bool,

    /// Writes a sheet of all finished pictures with their names, small and in rows
    ///
    /// Scenes that fail have an empty place on it. With --frames it shows every frame.
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    pub contact_sheet: Option<PathBuf>,

    /// Adds layers (AOVs) to the picture, such as normal,depth, or all
    #[arg(long, value_name = "LAYERS", value_delimiter = ',', value_parser = aov, help_heading = "Output")]
    pub aov: Vec<Layers>,

    /// Removes the noise of the finished picture [default without a name: good; of models by paths that of --quality]
    ///
    /// --denoise=fast takes a tenth of the time. --denoise=oidn uses Intel's Open Image Denoise from the folder that
    /// the variable OIDN_DIR names. Previews and parts of pictures stay noisy. --aov noisy keeps the noisy picture as a
    /// layer.
    #[arg(long, value_name = "DENOISER", num_args = 0..=1, default_missing_value = "good", require_equals = true,
        value_parser = denoise_flag(), help_heading = "Output")]
    pub denoise: Option<DenoiseFlag>,

    /// Sets the side of the tiles that threads render, in pixels; changes no picture
    #[arg(long, value_name = "N", default_value_t = 32, value_parser = clap::value_parser!(u32).range(1..=4096),
        hide_short_help = true, help_heading = "Output")]
    pub tile: u32,

    /// Sets how progress is shown on stderr
    #[arg(long, value_name = "HOW", default_value = "auto", help_heading = "Messages")]
    pub progress: ProgressFlag,

    /// Prints errors only
    #[arg(short, long, help_heading = "Messages")]
    pub quiet: bool,

    /// Writes coarse pictures first: the file is there soon and becomes finer
    ///
    /// The first picture has a ray for each block of 16 x 16 pixels, the next ones for 4 x 4 and for each pixel. With
    /// radiosity they come after the solution. A picture by paths is then written after each pass of samples, too.
    /// Layers come with the whole picture. --preview=FILE writes these pictures into another file, such as live.png.
    /// The file is always a whole picture: an image viewer that reloads changed files shows the render live.
    #[arg(long, conflicts_with = "no_clobber", num_args = 0..=1, require_equals = true, value_name = "FILE",
        help_heading = "Output")]
    pub preview: Option<Option<PathBuf>>,

    /// Renders again when the scene or a file that it names changes, until Ctrl-C
    ///
    /// A change stops a render that runs. A mistake in the scene is printed, and the next change may correct it.
    #[arg(long, help_heading = "Output")]
    pub watch: bool,

    /// Reads and builds everything and prints what would be rendered, but writes nothing
    #[arg(long, help_heading = "Messages")]
    pub dry_run: bool,
}

/// The layers of one item of --aov.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Layers {
    All,
    One(Aov),
}

const EXAMPLES: &str = "\
Examples:
  canaletto render scenes/chapter/fig-5.23b-shadow.kdl       # writes fig-5.23b-shadow.png here
  canaletto render scenes/models/spot.obj -o spot.png --size 1600x1200 --samples 16
  canaletto render scenes/still-life.kdl -o still.exr --aov normal,depth   # layers in the same file
  canaletto render scenes/path.kdl --samples 64 --denoise
  canaletto render scenes/chapter/bouncing-ball.kdl -o out/ball.####.png --frames 1-10 --mkdir
  canaletto render scenes/chapter/bouncing-ball.kdl -o ball.gif --frames all --fps 12
  canaletto render scenes/models/globe.obj --samples 256 --build high   # many rays
  canaletto render scenes/still-life.kdl --set camera.fovy=25 -o - > near.png
  canaletto render scenes/tutorial/*.kdl -o pictures/ --mkdir   # a picture of each scene in a folder
  canaletto render scenes/tutorial/*.kdl -o 'small/{name}.half.png' --size 50% --mkdir
  canaletto render scenes/gallery-room.kdl --save-solution room.rad   # radiosity solved once, for ...
  canaletto render scenes/gallery-room.kdl --solution room.rad --set camera.fovy=35 -o near.png
  canaletto render scenes/path.kdl --time 5s -o path.exr
  canaletto render scenes/path.kdl --samples 1024 --continue path.exr -o path.exr
  canaletto render scenes/path.kdl --noise 0.1 --preview=live.png
  canaletto render scenes/path.kdl --watch --preview         # while the scene is being written
  cat scenes/stairs.kdl | canaletto render - -o made.png     # a scene text on the standard input";

fn long_help() -> String {
    format!(
        "{EXAMPLES}\n\n{MAPPINGS}\n\nCtrl-C stops rendering and saves the finished part beside the picture, as \
         name.partial.png. An existing name.png stays. The next complete picture removes the part. Layers, frames and \
         films have such parts, too; the part of a film has the frames so far. Finished frames stay, and the same \
         command continues with the next frame. A picture by paths keeps the samples that its pixels have: its part \
         is whole after the first pass, and --continue name.partial.exr goes on with it. The samples of a single \
         name.png are kept beside its part, as name.png.partial.exr. The program ends within two seconds. A part that \
         takes longer to save has black lower rows, or lacks layers, and a message says so. A second Ctrl-C ends \
         the program at once."
    )
}

fn aov(text: &str) -> Result<Layers, String> {
    if text == "all" {
        return Ok(Layers::All);
    }
    Aov::from_name(text).map(Layers::One).ok_or_else(|| {
        let names = Aov::NAMES;
        match closest_word(text, names.iter().copied()) {
            Some(near) => format!("did you mean {near}?"),
            None => format!("the layers are {}, and all", names.join(", ")),
        }
    })
}

impl RenderFlags {
    /// The denoiser of the picture: that asked for, or of a model by paths that of its quality. Parts of pictures stay
    /// noisy.
    pub(crate) fn denoiser(&self) -> Option<Denoiser> {
        let integrator = self.picture.integrator_of(&self.source);
        let is_by_paths = integrator.is_none_or(|integrator| matches!(integrator, Integrator::Path(_)));
        let is_whole = self.passes.continue_from.is_none() && self.passes.first_sample == 0;
        let of_quality = || {
            let is_denoised = is_model(&self.source.scene) && is_by_paths && is_whole && !self.sets_integrator();
            is_denoised.then(|| match self.source.staging.quality.unwrap_or_default() {
                PictureQuality::Draft => Denoiser::Fast,
                _ => Denoiser::Good,
            })
        };
        self.denoise.map_or_else(of_quality, |DenoiseFlag(denoiser)| denoiser)
    }

    /// Opens the scene, and completes the flags by what follows from others.
    pub(crate) fn open(&mut self) -> Result<Reader, Failure> {
        if self.source.staging.turntable.is_some() {
            self.frames.get_or_insert(FramesFlag::All);
        }
        self.prepared.resolve(&mut self.solution)?;
        self.source.staging.plays = self.frames.is_some() || self.output.is_film();
        let integrator = self.picture.integrator_of(&self.source);
        let mut reader = Reader::open(&self.source, integrator, self.picture.max_depth)?;
        reader.choose_camera(self.picture.camera.as_deref());
        if let Some(fps) = self.fps {
            reader.set_fps(fps);
        }
        Ok(reader)
    }

    /// Checks that no flag asks for what parts of a picture can't have.
    pub(crate) fn check_part(&self) -> Result<(), Failure> {
        let backdrop = self.picture.background.as_ref().and_then(BackgroundFlag::backdrop);
        let why = [
            (
                self.aov.iter().any(|layers| !matches!(layers, Layers::One(aov) if is_in_parts(*aov))),
                "--aov",
                "parts hold layers of the first hit, of samples and for denoising only; name those",
            ),
            (backdrop.is_some(), "--background", "a picture over another one needs its alpha, which parts don't hold"),
            (self.passes.time.is_some(), "--time", "the number of samples would depend on the machine"),
            (self.passes.continue_from.is_some(), "--continue", "a part begins with its own first sample"),
        ];
        why.into_iter().find(|(is_given, ..)| *is_given).map_or(Ok(()), |(_, flag, why)| Err(not_in_parts(flag, why)))
    }

    /// Whether --set chooses the integrator.
    fn sets_integrator(&self) -> bool {
        self.source.set.iter().any(|set| set.split_once('=').is_some_and(|(key, _)| key.trim() == "integrator"))
    }
}

/// An opened scene with its plan.
struct Task {
    flags: RenderFlags,
    plan: Plan,
    reader: Reader,
}

impl Task {
    fn new(flags: RenderFlags) -> Result<Task, Failure> {
        let mut flags = flags;
        let mut reader = flags.open()?;
        let style = Style::new(flags.progress, flags.quiet);
        let plan = Plan::new(&flags, style, &mut reader)?;
        let task = Task { flags, plan, reader };
        let Task { flags, plan, .. } = &task;
        task.files().check()?;
        // A plan alone makes no folders, and tells nothing of those that would be made.
        if !flags.dry_run || !flags.output.folder.mkdir {
            flags.output.folder.make_folders(&task.files())?;
            plan.output.check(plan.all_files())?;
            if let (Some(preview), Some(Some(file))) = (&plan.preview, &flags.preview) {
                preview.check([file.clone()])?;
            }
        }
        flags.solution.check_file(flags.output.no_clobber)?;
        // Samples may be gone on with into their own file, but nothing else may replace them before they are read.
        task.others().reads("--continue", &task.flags.passes.continue_from).check()?;
        Ok(task)
    }

    /// All files that this task may write, and those that flags name to be read.
    fn files(&self) -> CommandFiles {
        let (pictures, preview) = (self.plan.all_files(), self.flags.preview.clone().flatten());
        let parts = self.plan.all_files().filter(|_| !self.plan.output.is_stdout());
        self.solution_files()
            .reads("--solution", &self.flags.solution.solution)
            .reads("--background", self.flags.picture.background.as_ref().and_then(BackgroundFlag::file))
            .writes("--output", pictures)
            .writes("--output", parts.flat_map(|file| [partial(&file), partial(&with_samples(&file))]))
            .writes("--preview", preview)
            .writes("--checkpoint", self.flags.checkpoints.files())
            .reads("--prepared", &self.flags.prepared.prepared)
    }

    /// The files besides the pictures themselves: layers, and pictures in the making.
    fn others(&self) -> CommandFiles {
        let preview = self.plan.preview.iter().map(|preview| preview.path(self.plan.frames.first));
        let layers = self.plan.frames.iter().flat_map(|frame| self.plan.files(frame).into_iter().skip(1));
        self.solution_files().writes("--preview", preview).writes("--aov", layers)
    }

    fn solution_files(&self) -> CommandFiles {
        CommandFiles::default().writes("--save-solution", self.flags.solution.save_solution.clone())
    }
}

/// Runs the command.
pub(crate) fn run(flags: &RenderFlags) -> Result<Exit, Failure> {
    let render = || if flags.more.is_empty() { one(flags) } else { several(flags) };
    if !flags.watch {
        return on_threads(flags.source.threads, render)?;
    }
    if [&flags.source.scene].into_iter().chain(&flags.more).any(|scene| scene == Path::new(STDIN)) {
        return Err(Failure::usage("--watch: the standard input is read once").help("name the scene's file"));
    }
    let style = Style::new(flags.progress, flags.quiet);
    on_threads(flags.source.threads, || watch(&flags.source.log, style, flags.quiet, render))?
}

/// Renders one scene.
fn one(flags: &RenderFlags) -> Result<Exit, Failure> {
    let mut flags = flags.clone();
    flags.output.output = flags.output.output.as_deref().map(|output| own_output(&flags, output, &flags.source.scene));
    let mut sheet = ContactSheet::new(&flags)?;
    let task = Task::new(flags)?;
    let files = task.files().and(ContactSheet::files(&task.flags));
    files.check()?;
    let mut solutions = Solutions::new(&task.flags.solution, task.flags.output.no_clobber)?;
    if let Some(sheet) = &mut sheet {
        sheet.add(&task.plan);
    }
    let exit = on_pool(task, &files, &mut solutions)?;
    if let Some(sheet) = sheet.filter(|_| exit == Exit::Done) {
        sheet.write()?;
    }
    Ok(exit)
}

/// Stands for the scene's name in --output.
const NAME: &str = "{name}";

/// The output as a pattern with [`NAME`] in it, if it is one.
fn pattern(output: &Path) -> Option<&str> {
    output.to_str().filter(|text| text.contains(NAME))
}

/// The output of a scene: `output` with the scene's name for `{name}`, or its picture in the folder `output`.
fn own_output(flags: &RenderFlags, output: &Path, scene: &Path) -> PathBuf {
    match pattern(output) {
        Some(text) => text.replace(NAME, &stem(scene)).into(),
        None if is_folder(output, flags) => {
            output.join(flags.output.default_name(&stem(scene), flags.frames.is_some()))
        }
        None => output.to_owned(),
    }
}

/// Whether a path is a folder for pictures, or will be one with --mkdir. One that is named like a picture is rather a
/// mistake.
fn is_folder(path: &Path, flags: &RenderFlags) -> bool {
    let is_new = || flags.output.folder.mkdir && !path.exists() && path.extension().is_none();
    (path.is_dir() || is_new())
        && path.extension().and_then(|extension| Format::of_extension(extension.to_str()?)).is_none()
}

/// Renders several scenes, each into a file of its own. A scene with mistakes doesn't stop the others. The exit code is
/// that of the first failed scene.
fn several(flags: &RenderFlags) -> Result<Exit, Failure> {
    let json = flags.progress == ProgressFlag::Json;
    let output = flags.output.output.as_deref();
    if let Some(flag) = flags.solution.given() {
        return Err(Failure::usage(format!("{flag}: it is for one scene, but there are several")));
    }
    let is_for_all = |output: &Path| is_folder(output, flags) || pattern(output).is_some();
    if let Some(one) = output.filter(|output| !is_for_all(output)) {
        let message = format!("--output {} is no folder, but there are several scenes", one.display());
        let help = "give a folder that exists, or --mkdir, or a pattern such as 'pictures/{name}.png'; without \
                    --output each picture is called like its scene";
        return Err(Failure::usage(message).help(help));
    }
    let mut sheet = ContactSheet::new(flags)?;
    let mut exit = Exit::Done;
    let mut fail = |failure: &Failure| {
        failure.print(json);
        exit = if exit == Exit::Done { failure.exit() } else { exit };
    };
    let mut tasks: Vec<Task> = Vec::new();
    let mut files = ContactSheet::files(flags);
    for scene in [&flags.source.scene].into_iter().chain(&flags.more) {
        let mut own = RenderFlags { more: Vec::new(), ..flags.clone() };
        own.source.scene = scene.clone();
        own.output.output = output.map(|output| own_output(flags, output, scene));
        match Task::new(own) {
            Ok(task) => {
                if let Some(sheet) = &mut sheet {
                    sheet.add(&task.plan);
                }
                files = files.and(task.files());
                tasks.push(task);
            }
            Err(failure) if failure.exit() == Exit::Usage => return Err(failure),
            Err(failure) => {
                fail(&failure);
                if let Some(sheet) = &mut sheet {
                    sheet.add_missing(&stem(scene));
                }
            }
        }
    }
    if let Some(file) = files.written_twice() {
        return Err(Failure::usage(format!("two scenes would be rendered to {}", file.display()))
            .help("render them one by one, each with an --output of its own"));
    }
    for task in &mut tasks {
        if files.exist() {
            // Errors of a scene are reported when it is rendered.
            let _ = task.reader.at(task.plan.frames.first);
            files.check_scene(&task.reader)?;
        }
    }
    let mut solutions = Solutions::default();
    for task in tasks {
        match on_pool(task, &files, &mut solutions) {
            Ok(Exit::Interrupted) => return Ok(Exit::Interrupted),
            Ok(_) => {}
            Err(failure) => fail(&failure),
        }
    }
    if let Some(sheet) = sheet {
        sheet.write()?;
    }
    Ok(exit)
}

/// A scene's name without its extension.
pub(crate) fn stem(scene: &Path) -> String {
    let own = scene.file_stem().filter(|_| scene != Path::new(STDIN));
    own.map_or_else(|| "picture".into(), |stem| stem.to_string_lossy().into_owned())
}

/// Renders a scene. `files` are those of all scenes; none may replace a file that this scene reads.
fn on_pool(task: Task, files: &CommandFiles, solutions: &mut Solutions) -> Result<Exit, Failure> {
    let Task { flags, plan, mut reader } = task;
    let (flags, plan) = (&flags, &plan);
    let source = reader.at(plan.frames.first)?;
    if !flags.quiet {
        print_diagnostics(&source.warnings, plan.style == Style::Json);
    }
    let mut settings = Settings::new(&source.name, &source.scene, &flags.picture)?;
    settings.job = flags.passes.apply(settings.job, flags.picture.samples)?;
    settings.check_pixels()?;
    flags.solution.check_integrator(&source.name, &settings.job.integrator)?;
    let solved = fingerprint(&source.scene, &settings.job).filter(|_| flags.solution.given().is_some());
    solved.as_ref().map_or(Ok(()), |scene| solutions.check(scene))?;
    let job = Job { aovs: plan.aovs.clone(), ..settings.job.clone() };
    room(&job, plan.output.format, flags.denoiser().is_some())?;
    files.check_scene(&reader)?;
    if plan.frames.count() > 1 && !reader.timeline().moves && !flags.quiet {
        print_diagnostics(&plan.frames.all_the_same(&source.name, false).into(), plan.style == Style::Json);
    }
    if flags.dry_run {
        let files = source.files.len();
        let options = flags.source.build_options(0);
        let (mut world, _) = build(&source.name, source.scene, &options, None)?;
        let stats = world.stats();
        if let Some(second) = plan.frames.iter().nth(1).filter(|_| reader.timeline().moves) {
            // A render holds the previous frame's world while it reads and builds the next one.
            let source = reader.at(second)?;
            (world, _) = build(&source.name, source.scene, &options, Some(world))?;
        }
        let memory = Memory::of(&world, Some(&job), plan.output.format, flags.denoiser().is_some());
        return dry_run(flags, plan, &settings, &stats, memory, files);
    }
    // Errors at later keys are reported before the first frame is rendered.
    if reader.timeline().moves && plan.frames.count() > 1 {
        for frame in plan.frames.next_to(&reader.key_frames()).into_iter().filter(|frame| *frame != plan.frames.first) {
            let source = reader.at(frame)?;
            let settings = Settings::new(&source.name, &source.scene, &flags.picture)?;
            if let Some(first) = &solved
                && let Some(scene) = fingerprint(&source.scene, &settings.job)
            {
                let fits = solutions.check(&scene).and_then(|()| solutions.check_frames(first, &scene));
                fits.map_err(|failure| failure.at_frame(frame))?;
            }
        }
    }
    Series::new(flags, plan, reader, solutions)?.run(source)
}
