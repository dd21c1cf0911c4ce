//! Reading of scenes and models, and building of their worlds.

use crate::digest::{Hash, UsedFile, hash_of};
use crate::exit::Exit;
use crate::failure::{Failure, plural, reason};
use crate::flags::SourceFlags;
use crate::inputs::InputGuard;
use crate::model::is_model;
use crate::watch::ReadLog;
use canaletto::scene::{Integrator, Scene};
use canaletto::world::{BuildError, BuildOptions, World};
use canaletto::{Named, memory};
use canaletto_io::assets::{Asset, AssetError, AssetPath, Assets, FolderAssets, OpenAsset};
use canaletto_io::diagnostic::{Diagnostic, Diagnostics, closest_word};
use canaletto_io::export::convert::Originals;
use canaletto_io::import::{self, Staging};
use canaletto_io::scene_file::{self, OpenError};
use canaletto_io::source::{SceneSource, Timeline};
use canaletto_io::text::{MAX_TEXT, SceneDocument};
use std::io::{self, IsTerminal, Read};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// A scene as read, before anything is built.
pub(crate) struct Source {
    /// The file's name as the user wrote it.
    pub name: String,
    /// The scene's description.
    pub scene: Scene,
    /// Warnings about the scene.
    pub warnings: Diagnostics,
    /// The frame.
    pub frame: u32,
    /// Every file that was read, in the order of reading.
    pub files: Vec<UsedFile>,
    /// The duration of reading.
    pub time: Duration,
}

impl Source {
    /// Reads a scene or model at a frame. The default is its first frame.
    pub(crate) fn read(flags: &SourceFlags, frame: Option<u32>) -> Result<Source, Failure> {
        Reader::open(flags, None, None)?.at_chosen(None, frame)
    }
}

/// A scene or model that gives its description at every frame.
pub(crate) struct Reader {
    /// The file's name as the user wrote it.
    pub name: String,
    source: Box<dyn SceneSource>,
    assets: RecordingAssets,
    /// The duration of opening.
    time: Duration,
}

/// The name of a scene that is read from the standard input.
pub(crate) const STDIN: &str = "-";
/// The name of the standard input in messages.
pub(crate) const STDIN_NAME: &str = "<stdin>";

impl Reader {
    /// Opens the scene or model that the flags name. `integrator` replaces its integrator before --set acts. A setting
    /// that needs a limit of depth, such as paths without roulette, may have it from `max_depth`.
    pub(crate) fn open(
        flags: &SourceFlags,
        integrator: Option<Integrator>,
        max_depth: Option<u32>,
    ) -> Result<Reader, Failure> {
        let mut set = flags.set.clone();
        set.extend(integrator.map(|integrator| format!("integrator={}", integrator.name())));
        let needs_depth = |set: &String| set.trim_start().starts_with("integrator.roulette");
        if let Some(depth) = max_depth
            && set.iter().any(needs_depth)
        {
            set.push(format!("integrator.max-depth={depth}"));
        }
        let reader = Reader::open_file(&flags.scene, &set, &flags.staging.staging(), flags.allow_outside, &flags.log)?;
        if let Some(flag) = flags.staging.given().first().filter(|_| !is_model(&flags.scene)) {
            let message = format!("--{}: {} is a scene, which says how it is shown", flag.0, reader.name);
            return Err(Failure::usage(message).help("the flag is for models; change a scene by --set"));
        }
        Ok(reader)
    }

    /// Opens a scene, or a model with lights for the classic integrators.
    pub(crate) fn open_classic(flags: &SourceFlags) -> Result<Reader, Failure> {
        let classic = is_model(&flags.scene).then(Integrator::default);
        Reader::open(flags, classic, None)
    }

    /// Opens a file; `set` changes its values, and `log` notes every file that is read.
    pub(crate) fn open_file(
        path: &Path,
        set: &[String],
        staging: &Staging,
        allow_outside: bool,
        log: &ReadLog,
    ) -> Result<Reader, Failure> {
        let start = Instant::now();
        memory::working_at("reading the scene");
        if path == Path::new(STDIN) {
            return Reader::open_stdin(set, allow_outside, start);
        }
        let name = path.to_string_lossy().into_owned();
        if let Err(e) = path.metadata() {
            log.note(path.to_owned());
            return Err(missing(path, &e));
        }
        if path.is_dir() {
            let message = format!("{name} is a folder; a scene or model is a file");
            let all = path.join("*.kdl");
            return Err(Failure::new(Exit::Scene, message).help(format!("for all scenes in it: {}", all.display())));
        }
        let (assets, file) = FolderAssets::beside(path)
            .map_err(|e| Failure::new(Exit::Scene, format!("can't open {name}: {}", reason(&e))))?;
        let assets = RecordingAssets::new(assets.allow_outside(allow_outside), log);
        let source = scene_file::open(&file, &assets, set, staging).map_err(|error| match error {
            OpenError::Mistakes(mistakes) => mistakes.into(),
            OpenError::UnknownFormat => {
                let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
                let convert = import::foreign_format(&extension)
                    .map_or(String::new(), |(format, program)| format!("; {program} converts {format} to OBJ or PLY"));
                Failure::new(Exit::Scene, format!("\"{name}\" isn't a scene or model that can be read"))
                    .help(format!("scenes end in .kdl, models in .{}{convert}", import::extensions().join(", .")))
            }
        })?;
        Ok(Reader { name, source, assets, time: start.elapsed() })
    }

    /// Reads a scene text from the standard input. Files that it names lie in the current folder.
    fn open_stdin(set: &[String], allow_outside: bool, start: Instant) -> Result<Reader, Failure> {
        let cant = |e: &io::Error| Failure::new(Exit::Scene, format!("can't read the standard input: {}", reason(e)));
        if io::stdin().is_terminal() {
            return Err(Failure::usage("the scene is read from the standard input, which is the terminal")
                .help("send a scene text to it: canaletto render - < scene.kdl"));
        }
        let folder = FolderAssets::new(".").map_err(|e| cant(&e))?;
        let assets = RecordingAssets::new(folder.allow_outside(allow_outside), &ReadLog::default());
        let mut bytes = Vec::new();
        io::stdin().lock().take(MAX_TEXT as u64 + 1).read_to_end(&mut bytes).map_err(|e| cant(&e))?;
        let text = match String::from_utf8(bytes) {
            Ok(text) => text,
            Err(e) => {
                let message = format!("byte {} isn't UTF-8", e.utf8_error().valid_up_to());
                return Err(Diagnostics::from(
                    Diagnostic::error(STDIN_NAME, message).help("a scene text is expected; models are read from files"),
                )
                .into());
            }
        };
        let path = AssetPath::new("", STDIN_NAME, STDIN_NAME);
        assets.note(&path, text.len(), || Ok(hash_of(text.as_bytes()))).map_err(|e| cant(&e))?;
        let document = SceneDocument::of_text(&text, STDIN_NAME, &assets, set)?;
        Ok(Reader { name: STDIN_NAME.into(), source: Box::new(document), assets, time: start.elapsed() })
    }

    /// Chooses the camera whose shutter applies.
    pub(crate) fn choose_camera(&mut self, camera: Option<&str>) {
        if let Some(camera) = camera {
            self.source.use_shutter_of(camera);
        }
    }

    /// Says that no camera is used, so that none is missed.
    pub(crate) fn use_no_camera(&mut self) {
        self.source.use_no_camera();
    }

    /// The timeline of the animation.
    pub(crate) fn timeline(&self) -> Timeline {
        *self.source.timeline()
    }

    /// Sets the frames per second.
    pub(crate) fn set_fps(&mut self, fps: f64) {
        self.source.set_fps(fps);
    }

    /// The default frame.
    pub(crate) fn first_frame(&self) -> u32 {
        self.source.first_frame()
    }

    /// The times of keys, in frames.
    pub(crate) fn key_frames(&self) -> Vec<f64> {
        self.source.key_frames()
    }

    /// The first of these outputs that would replace an input file of the scene at any frame.
    pub(crate) fn replaced_by(&self, outputs: impl IntoIterator<Item = PathBuf>) -> Option<PathBuf> {
        let guard = InputGuard::new(outputs);
        if guard.is_idle() {
            return None;
        }
        let folder = &self.assets.inner;
        let files = self.assets.files.lock().unwrap_or_else(PoisonError::into_inner);
        let read = files.iter().find_map(|used| guard.find(&folder.root().join(&used.place)));
        let texts = self.source.texts();
        let named = || texts.iter().find_map(|(text, from)| guard.find_named(&folder.system_path(text, from)));
        read.or_else(named).map(Path::to_owned)
    }

    /// The files that were read and hold pictures or lamps, for writing them again.
    pub(crate) fn originals(&self, files: &[UsedFile]) -> Originals {
        let mut originals = Originals::new();
        for used in files {
            let place = self.assets.inner.root().join(&used.place);
            let is_kept = |extension: &str| Originals::EXTENSIONS.contains(&extension);
            let path = AssetPath::new(&used.place, &used.place, &used.file);
            if is_kept(&path.extension())
                && let Ok(bytes) = std::fs::read(place)
            {
                originals.add(&path, bytes, &self.assets.inner);
            }
        }
        originals
    }

    /// The scene at a frame, or at its first one, with the shutter of a camera.
    pub(crate) fn at_chosen(&mut self, camera: Option<&str>, frame: Option<u32>) -> Result<Source, Failure> {
        self.choose_camera(camera);
        self.at(frame.unwrap_or(self.first_frame()))
    }

    /// The scene at a frame.
    pub(crate) fn at(&mut self, frame: u32) -> Result<Source, Failure> {
        let start = Instant::now();
        memory::working_at("reading the scene");
        let (scene, warnings) = self.source.scene(&self.assets, f64::from(frame))?;
        let files = self.assets.files.lock().unwrap_or_else(PoisonError::into_inner).clone();
        // The time of opening is added to that of the first frame.
        let time = std::mem::take(&mut self.time) + start.elapsed();
        Ok(Source { name: self.name.clone(), scene, warnings, frame, files, time })
    }
}

/// The error about a missing file that the user named. A hint names a similar file.
pub(crate) fn missing(path: &Path, error: &io::Error) -> Failure {
    let failure = Failure::new(Exit::Scene, format!("can't open {}: {}", path.display(), reason(error)));
    if let Ok(target) = path.read_link() {
        return failure.help(format!("it is a link to {}, which isn't there", target.display()));
    }
    let folder = match path.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    };
    if error.kind() != io::ErrorKind::NotFound {
        return failure;
    }
    let Ok(entries) = folder.read_dir() else {
        return failure.help(format!("there is no folder {}", folder.display()));
    };
    let names: Vec<String> = entries.filter_map(|entry| entry.ok()?.file_name().into_string().ok()).collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    match path.file_name().and_then(|name| closest_word(name.to_str()?, names)) {
        Some(near) => failure.help(format!("did you mean {}?", path.with_file_name(near).display())),
        None => failure,
    }
}

/// The options for a world that is seen through the camera of this name.
pub(crate) fn seen_through(camera: &str, scene: &Scene, options: BuildOptions) -> BuildOptions {
    BuildOptions { view: scene.views.iter().position(|view| view.name == camera).unwrap_or(0), ..options }
}

/// Builds a scene's world; `name` is the scene's file. Unchanged parts of the previous frame's world are reused.
pub(crate) fn build(
    name: &str,
    scene: Scene,
    options: &BuildOptions,
    before: Option<World>,
) -> Result<(World, Duration), Failure> {
    let start = Instant::now();
    memory::working_at("building the world");
    let built = match before {
        Some(before) => World::build_after(before, scene, options),
        None => World::build_with(scene, options),
    };
    let world = built.map_err(|e| {
        let diagnostic = Diagnostic::error(name, e.to_string());
        Diagnostics::from(match advice(&e) {
            Some(advice) => diagnostic.help(advice),
            None => diagnostic,
        })
    })?;
    Ok((world, start.elapsed()))
}

/// A hint for a scene that can't be built.
fn advice(error: &BuildError) -> Option<&'static str> {
    Some(match error {
        BuildError::TooManyInstances | BuildError::TooManyCopies(_) => {
            "instances of instances multiply; a cloud (spheres, cylinders) or a mesh holds many more things in less \
             memory"
        }
        BuildError::TooManyLights => "each hit traces a shadow ray to each point of each light: use fewer points",
        BuildError::TooManyPlanes => {
            "every ray is tested against every plane; boxes and triangles are bounded and cost far less"
        }
        BuildError::TooDeep => "groups and instances count, through all prototypes; put some side by side",
        BuildError::Invalid { problem, .. } if problem.contains("transforms") => {
            "transforms of an object, of its groups and of instances multiply: look at the scale and translate around \
             it"
        }
        BuildError::Invalid { object, .. } if object.contains(" #") => {
            "objects without a name are called by kind and number, in the order of the file; give it a name=\"…\" to \
             find it"
        }
        _ => return None,
    })
}

/// Runs `work` on the number of threads that the user chose.
pub(crate) fn on_threads<T: Send>(threads: Option<u16>, work: impl FnOnce() -> T + Send) -> Result<T, Failure> {
    let threads = threads.map_or(0, usize::from);
    let mut pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .thread_name(|index| format!("canaletto-{index}"))
        .stack_size(STACK);
    if has_room() {
        // This thread takes part in the pool. To start another thread and to wait for its start and end takes a
        // twentieth of a small picture's time.
        pool = pool.use_current_thread();
    }
    let pool = pool.build().map_err(|e| {
        let many = if threads == 0 { "a thread for each processor".into() } else { plural(threads, "thread") };
        Failure::new(Exit::Failed, format!("can't start {many}: {}", reason(&e))).help("give fewer: --threads 1")
    })?;
    Ok(pool.install(work))
}

/// The stack size in bytes for rays of depth 256 and groups as deep as a world allows.
const STACK: usize = 16 << 20;

/// Whether this thread's stack can have [`STACK`] bytes. Linux lets the first thread's stack grow up to a limit, which
/// the process may raise. It keeps 128 MiB free for that stack.
#[cfg(target_os = "linux")]
fn has_room() -> bool {
    use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
    let Rlimit { current, maximum } = getrlimit(Resource::Stack);
    let enough = |limit: Option<u64>| limit.is_none_or(|limit| limit >= STACK as u64);
    enough(current) || setrlimit(Resource::Stack, Rlimit { current: Some(STACK as u64), maximum }).is_ok()
}

#[cfg(not(target_os = "linux"))]
fn has_room() -> bool {
    false
}

/// Assets that record each file that is read.
struct RecordingAssets {
    inner: FolderAssets,
    files: Mutex<Vec<UsedFile>>,
    log: ReadLog,
}

impl RecordingAssets {
    fn new(inner: FolderAssets, log: &ReadLog) -> RecordingAssets {
        RecordingAssets { inner, files: Mutex::default(), log: log.clone() }
    }

    /// Opens a file, and logs it before it is read. Nothing is asked about a file outside the scene's folder, not even
    /// its time.
    fn opened(&self, path: &str, from: &AssetPath) -> Result<OpenAsset, AssetError> {
        let found = self.inner.open(path, from);
        if matches!(found, Ok(_) | Err(AssetError::Missing { .. })) {
            self.log.note(self.inner.system_path(path, from));
        }
        found
    }

    /// Records a file. `hash` is called only for a file that isn't recorded yet.
    fn note(&self, path: &AssetPath, bytes: usize, hash: impl FnOnce() -> io::Result<u128>) -> io::Result<()> {
        let mut files = self.files.lock().unwrap_or_else(PoisonError::into_inner);
        if !files.iter().any(|used| used.file == path.name()) {
            let (file, place) = (path.name().to_owned(), path.location().to_owned());
            files.push(UsedFile { file, place, bytes: bytes as u64, hash: hash()? });
        }
        Ok(())
    }
}

impl Assets for RecordingAssets {
    fn read(&self, path: &str, from: &AssetPath) -> Result<Asset, AssetError> {
        self.opened(path, from)?;
        let asset = self.inner.read(path, from)?;
        self.note(&asset.path, asset.bytes.len(), || Ok(hash_of(&asset.bytes)))
            .map_err(|e| AssetError::Unreadable { path: path.into(), reason: reason(&e) })?;
        Ok(asset)
    }

    fn open(&self, path: &str, from: &AssetPath) -> Result<OpenAsset, AssetError> {
        let asset = self.opened(path, from)?;
        let view = asset.content.view();
        let hash = || {
            const PIECE: usize = 1 << 18;
            let mut buffer = Vec::new();
            let mut hash = Hash::new();
            for at in (0..view.size()).step_by(PIECE) {
                hash.add(view.piece(at..at + PIECE, &mut buffer)?);
            }
            Ok(hash.finish())
        };
        self.note(&asset.path, view.size(), hash)
            .map_err(|e| AssetError::Unreadable { path: path.into(), reason: reason(&e) })?;
        Ok(asset)
    }
}
