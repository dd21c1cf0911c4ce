//! `canaletto bake`: a scene with its diffuse light in textures, for viewers and game engines.

use crate::command::render::stem;
use crate::command_files::{CommandFiles, FolderFlag};
use crate::exit::Exit;
use crate::failure::{Failure, eprint_line, print_diagnostics};
use crate::flags::{SourceFlags, named};
use crate::format::{bytes, count, duration, plural};
use crate::interrupt;
use crate::omissions::shortfalls;
use crate::output::{check_files, unfit, write_files};
use crate::progress::{ProgressDisplay, ProgressFlag, RunProgress, Style, emit};
use crate::solutions::{GivenSolutionFlags, SolutionFlags, Solutions};
use crate::source::{Reader, build, on_threads};
use canaletto::Named;
use canaletto::bake::{Atlas, BakeError, BakeSettings, BakedScene, LeftOut, LeftOutReason, TexelDensity};
use canaletto::integrator::describe;
use canaletto::integrator::radiosity::{RadiositySolution, SolutionFingerprint};
use canaletto::memory;
use canaletto::scene::{Developing, Exposure, FilmSettings, Scene, Tone};
use canaletto_io::export::{Export, ExportFormat, LightMaps, UpAxis};
use clap::Args;
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Writes a scene with its light in textures, for programs that draw triangles.
///
/// The light of the scene is solved by radiosity, with the settings of the scene if its integrator is "radiosity". All
/// lit surfaces become triangles, and their light becomes one texture on a second set of texture coordinates: a light
/// map. Programs such as three.js, Babylon.js and Blender show the file at once.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct BakeFlags {
    #[command(flatten)]
    pub source: SourceFlags,

    /// Sets the output file, .glb or .obj [default: the scene's name with .glb, in the current folder]
    ///
    /// An .obj comes with a material library, a PNG of the colours and an EXR of the light.
    #[arg(short, long, value_name = "FILE", help_heading = "Output")]
    pub output: Option<PathBuf>,

    /// Fails if a file exists already, instead of replacing it
    #[arg(long, help_heading = "Output")]
    pub no_clobber: bool,
    #[command(flatten)]
    pub folder: FolderFlag,

    #[command(flatten)]
    pub solution: GivenSolutionFlags,

    /// Sets what the textures hold
    #[arg(long, value_name = "WHAT", default_value = "combined", value_parser = named::<LightMaps>(),
        help_heading = "Light map")]
    pub maps: LightMaps,

    /// Sets the width and height of the light map in texels
    #[arg(long, value_name = "N", conflicts_with = "texels_per_unit",
        value_parser = clap::value_parser!(u32).range(i64::from(Atlas::MIN_SIDE)..=i64::from(Atlas::MAX_SIDE)),
        help_heading = "Light map")]
    pub size: Option<u32>,

    /// Sets the number of texels for each unit of length [default: two for a patch of median size]
    #[arg(long, value_name = "N", allow_hyphen_values = true, value_parser = density, help_heading = "Light map")]
    pub texels_per_unit: Option<f64>,

    /// Writes sides of surfaces that no light reaches, too
    ///
    /// Without them a closed room can be looked into from outside.
    #[arg(long, help_heading = "Light map")]
    pub dark_sides: bool,

    /// Sets the exposure of colours in stops, or auto [default: the scene's]
    #[arg(long, value_name = "STOPS", allow_hyphen_values = true, help_heading = "Light map")]
    pub exposure: Option<Exposure>,

    /// Sets the tone mapping of colours [default: the scene's]
    #[arg(long, value_name = "HOW", value_parser = named::<Tone>(), help_heading = "Light map")]
    pub tone: Option<Tone>,

    /// Sets the axis of the scene that points up [default: the nearest one to the first camera's up]
    ///
    /// In the output y points up, as glTF has it.
    #[arg(long, value_name = "AXIS", value_parser = named::<UpAxis>(), help_heading = "Scene")]
    pub up: Option<UpAxis>,

    /// Sets the frame [default: the scene's first, or 0]
    #[arg(long, value_name = "N", help_heading = "Scene")]
    pub frame: Option<u32>,

    /// Sets how progress is shown on stderr
    #[arg(long, value_name = "HOW", default_value = "auto", help_heading = "Messages")]
    pub progress: ProgressFlag,

    /// Prints nothing but errors
    #[arg(short, long, help_heading = "Messages")]
    pub quiet: bool,
}

const EXAMPLES: &str = "\
Examples:
  canaletto bake scenes/cornell-box.kdl -o room.glb
  canaletto bake scenes/gallery-room.kdl --size 2048 -o gallery.glb
  canaletto bake scenes/cornell-box.kdl --maps light -o room.glb   # and room.light.exr
  canaletto bake scenes/cornell-box.kdl -o room.obj   # and .mtl, .png, .light.exr
  canaletto bake scenes/cornell-box.kdl --set integrator.error=0.003 -o fine.glb
  canaletto render scenes/cornell-box.kdl --save-solution cornell.rad
  canaletto bake scenes/cornell-box.kdl --solution cornell.rad -o room.glb";

/// The number of texels for each unit of length.
fn density(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(density) if density > 0.0 && density.is_finite() => Ok(density),
        _ => Err("write a number of texels that is more than 0, such as 64".into()),
    }
}

/// Runs the command.
pub(crate) fn run(flags: &BakeFlags) -> Result<Exit, Failure> {
    on_threads(flags.source.threads, || bake(flags))?
}

fn bake(flags: &BakeFlags) -> Result<Exit, Failure> {
    let begun = Instant::now();
    let output = flags.output.clone().unwrap_or_else(|| format!("{}.glb", stem(&flags.source.scene)).into());
    let format = format_of(&output)?;
    let files: Vec<PathBuf> = format.endings(flags.maps).iter().map(|ending| beside(&output, ending)).collect();
    let table = CommandFiles::default().reads("--solution", &flags.solution.solution);
    let table = table.writes("--output", files.clone());
    table.check()?;
    flags.folder.make_folders(&table)?;
    check_files(files.clone(), &output, flags.no_clobber)?;
    let mut reader = Reader::open_classic(&flags.source)?;
    let frame = flags.frame.unwrap_or(reader.first_frame());
    let source = reader.at(frame)?;
    if !flags.quiet {
        print_diagnostics(&source.warnings, flags.progress == ProgressFlag::Json);
    }
    table.check_scene(&reader)?;
    check_room(flags)?;
    let name = source.name;
    let shown = Shown::of(&source.scene, flags);
    let settings = describe(&source.scene.integrator).radiosity().copied().unwrap_or_default();
    let mut solutions = Solutions::new(&SolutionFlags::from(&flags.solution), false)?;
    let fingerprint = SolutionFingerprint::new(&source.scene, &settings);
    solutions.check(&fingerprint)?;
    let (world, _) = build(&name, source.scene, &flags.source.build_options(0), None)?;
    let style = Style::new(flags.progress, flags.quiet);
    let watch = ProgressDisplay::begin(style, frame, String::new(), 1, RunProgress::SINGLE);
    let _baking = interrupt::Rendering;
    interrupt::Rendering::begins();
    memory::working_at("solving the light");
    let solved = solutions.solution(&name, &world, &fingerprint, &settings, &watch)?;
    let Some((solution, _)) = solved else { return Ok(Exit::Interrupted) };
    memory::working_at("baking the light map");
    let density = match (flags.size, flags.texels_per_unit) {
        (Some(side), _) => TexelDensity::ForSide(side),
        (None, Some(density)) => TexelDensity::PerUnit(density),
        (None, None) => TexelDensity::ByPatches,
    };
    let bake = BakeSettings { density, dark_sides: flags.dark_sides };
    let baked = match BakedScene::bake(&world, (&solution, &settings), &bake, &watch) {
        Ok(baked) => baked,
        Err(BakeError::Cancelled) => return Ok(Exit::Interrupted),
        Err(problem) => return Err(unbaked(&name, &problem)),
    };
    if !flags.quiet {
        let mut warnings = solution.warnings(&world, &settings);
        // The report has a note about the limit of patches.
        warnings.drain(..usize::from(solution.limit_reached));
        warnings.extend(baked.left_out.iter().filter_map(left_out));
        print_diagnostics(&shortfalls(&name, &warnings), flags.progress == ProgressFlag::Json);
    }
    let export = Export {
        baked: &baked,
        materials: world.materials(),
        origin: world.origin(),
        views: &shown.views,
        developing: shown.developing,
        up: shown.up,
        maps: flags.maps,
        stem: &stem(&output),
    };
    let contents = format.files(&export).map_err(|e| unfit(&e))?;
    let contents: Vec<Vec<u8>> = contents.into_iter().map(|file| file.bytes).collect();
    if interrupt::requested() {
        return Ok(Exit::Interrupted);
    }
    watch.finish();
    write_files(&files, &contents, flags.no_clobber)?;
    let event = BakedEvent::new(&files, &baked, &solution, begun);
    match style {
        Style::Json => emit(&event),
        _ if flags.quiet => {}
        _ => event.print(&contents),
    }
    Ok(Exit::Done)
}

/// The most names of objects in a message.
const MOST_NAMES: usize = 8;

/// What to say about objects that aren't in the output. Far planes have a warning of the solution.
fn left_out(LeftOut { reason, names, .. }: &LeftOut) -> Option<String> {
    let why = match reason {
        LeftOutReason::FarPlane => return None,
        LeftOutReason::Dark => "no light arrives at any side; --dark-sides writes dark sides, too",
        _ => "other bodies cover it, or it has no area",
    };
    let mut shown: Vec<String> = names.iter().take(MOST_NAMES).map(|name| format!("\"{name}\"")).collect();
    if names.len() > MOST_NAMES {
        shown.push(format!("{} more", names.len() - MOST_NAMES));
    }
    let (objects, is) = if names.len() == 1 { ("object", "isn't") } else { ("objects", "aren't") };
    Some(format!("{objects} {} {is} in the light map: {why}", shown.join(", ")))
}

/// What the output takes from the scene besides its world.
struct Shown {
    views: Vec<canaletto::scene::View>,
    developing: Developing,
    up: UpAxis,
}

impl Shown {
    fn of(scene: &Scene, flags: &BakeFlags) -> Shown {
        let up = flags.up.or(scene.views.first().map(UpAxis::of_view)).unwrap_or_default();
        let tone = flags.tone.or(scene.film.tone);
        let film = FilmSettings { exposure: flags.exposure.or(scene.film.exposure), tone, ..scene.film };
        let developing = film.developing(false);
        Shown { views: scene.views.clone(), developing, up }
    }
}

/// The format of the output's extension.
fn format_of(output: &Path) -> Result<ExportFormat, Failure> {
    if output == Path::new("-") {
        return Err(Failure::usage("--output -: baked scenes need files").help("such as --output room.glb"));
    }
    let extension = output.extension().map(|e| e.to_string_lossy().to_lowercase());
    let known = extension.as_deref().and_then(ExportFormat::of_extension);
    let shown = output.display();
    known.ok_or_else(|| {
        Failure::usage(match extension {
            Some(other) => format!("--output {shown}: baked scenes can't be written as .{other}"),
            None => format!("--output {shown} has no extension to choose the format by"),
        })
        .help(format!("end the name in .{}", ExportFormat::NAMES.join(" or .")))
    })
}

/// The file with this ending in place of the output's extension. The extension of the output keeps its own letters.
fn beside(output: &Path, ending: &str) -> PathBuf {
    let own = output.extension().map(|e| format!(".{}", e.to_string_lossy().to_lowercase()));
    if own.as_deref() == Some(ending) {
        return output.to_owned();
    }
    output.with_file_name(format!("{}{ending}", stem(output)))
}

/// Checks before solving that memory suffices for a light map of the wanted size.
fn check_room(flags: &BakeFlags) -> Result<(), Failure> {
    let Some(side) = flags.size.map(u64::from) else { return Ok(()) };
    let size = side * side * Atlas::TEXEL_BYTES;
    if memory::room(size).is_ok() {
        return Ok(());
    }
    let message = format!("there is no memory for a light map of {side} x {side}: it takes {}", bytes(size));
    Err(Failure::new(Exit::Failed, message).help("give a smaller --size"))
}

fn unbaked(name: &str, problem: &BakeError) -> Failure {
    let failure = Failure::new(Exit::Scene, format!("{name}: {problem}"));
    match problem {
        BakeError::TooManyTexels { .. } => failure.help("give a smaller --texels-per-unit, or bake the scene in parts"),
        BakeError::TooManyCharts { side, .. } if *side < Atlas::MAX_SIDE => {
            failure.help(format!("give a larger --size, up to {}", Atlas::MAX_SIDE))
        }
        BakeError::TooManyCharts { .. } => {
            failure.help("a larger integrator.error makes fewer facets; or bake the scene in parts")
        }
        _ => failure,
    }
}

/// The event "baked".
#[derive(Serialize)]
struct BakedEvent {
    event: &'static str,
    files: Vec<PathBuf>,
    patches: usize,
    triangles: usize,
    charts: usize,
    size: [u32; 2],
    texels_per_unit: f64,
    /// Whether fewer texels fit than the patches need.
    coarse: bool,
    patch_limit_reached: bool,
    clipped_planes: bool,
    seconds: f64,
}

impl BakedEvent {
    fn new(files: &[PathBuf], baked: &BakedScene, solution: &RadiositySolution, begun: Instant) -> BakedEvent {
        let parts = baked.meshes.iter().flat_map(|mesh| &mesh.parts);
        BakedEvent {
            event: "baked",
            files: files.to_vec(),
            patches: solution.patches().len(),
            triangles: parts.map(|part| part.triangles.len()).sum(),
            charts: baked.charts,
            size: [baked.atlas.width, baked.atlas.height],
            texels_per_unit: baked.texels_per_unit,
            coarse: baked.is_coarse,
            patch_limit_reached: solution.limit_reached,
            clipped_planes: baked.has_clipped_planes,
            seconds: begun.elapsed().as_secs_f64(),
        }
    }

    fn print(&self, contents: &[Vec<u8>]) {
        for (file, content) in self.files.iter().zip(contents) {
            eprint_line(&format!("{}: {}", file.display(), bytes(content.len() as u64)));
        }
        let [width, height] = self.size;
        eprint_line(&format!(
            "{} patches, {}, light map {width} x {height} with {} and {:.4} texels per unit, {}",
            count(self.patches as u64),
            plural(self.triangles as u64, "triangle"),
            plural(self.charts as u64, "chart"),
            self.texels_per_unit,
            duration(Duration::from_secs_f64(self.seconds))
        ));
        let notes = [
            (self.coarse, "texels are larger than half a patch; a larger --size keeps finer shadows"),
            (
                self.patch_limit_reached,
                "the limit of patches was reached; a larger integrator.max-patches keeps finer light",
            ),
            (self.clipped_planes, "planes have no end; only their part near other surfaces is written"),
        ];
        notes.iter().filter(|(holds, _)| *holds).for_each(|(_, note)| eprint_line(&format!("note: {note}")));
    }
}
