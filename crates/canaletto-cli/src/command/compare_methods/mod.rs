//! `canaletto compare-methods`: pictures of a scene by several integrators, and a picture of why they differ.

mod cause_picture;
mod report;

use crate::command::render::stem;
use crate::command_files::CommandFiles;
use crate::complete::texts;
use crate::exit::Exit;
use crate::failure::Failure;
use crate::flags::{MessageFlags, PictureFlags, SourceFlags, named};
use crate::format::bytes;
use crate::metering::{is_metered, meter};
use crate::omissions::doubt_omissions;
use crate::output::{Output, OutputFlags, unfit, window};
use crate::progress::ProgressDisplay;
use crate::settings::{Settings, metadata};
use crate::source::{Reader, build, on_threads, seen_through};
use crate::stdout::{print, print_json};
use crate::watched::watched;
use canaletto::Named;
use canaletto::causes::{Cause, Causes, MethodPicture, find_causes};
use canaletto::film::Picture;
use canaletto::integrator::radiosity::{RadiosityError, RadiositySolution};
use canaletto::memory;
use canaletto::render::{Job, JobError, Rendering, render, render_with_solution};
use canaletto::scene::{Developing, Exposure, Integrator};
use canaletto::world::World;
use canaletto_io::diagnostic::closest_word;
use canaletto_io::picture::{EncodeSettings, PictureFormat, Rendered};
use cause_picture::cause_picture;
use clap::Args;
use report::MethodsReport;
use std::path::PathBuf;
use std::sync::Arc;

/// Renders a scene by several methods, and shows in a picture why they differ.
///
/// Each integrator makes its picture, such as out.zbuffer.png. One more picture has a colour for the cause of each
/// differing pixel over a dimmed reference, with a legend below. Causes are found in the trees of rays that `explain`
/// prints: the terms of both methods are compared one by one, and the one that closes most of the difference is the
/// cause.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXAMPLES, after_long_help = long_help())]
pub(crate) struct CompareMethodsFlags {
    #[command(flatten)]
    pub source: SourceFlags,

    /// Sets the integrators, two or more with commas between
    ///
    /// The reference is whitted if it is among them, else the last one that traces rays. All others are compared with
    /// it. The settings of an integrator are the scene's if the scene names it, else its defaults.
    #[arg(long, value_name = "NAMES", value_delimiter = ',', default_value = "zbuffer,whitted",
        value_parser = named::<Integrator>(), help_heading = "Comparison")]
    pub methods: Vec<Integrator>,

    /// Sets the difference up to which pixels are equal, in steps of 8 bits
    #[arg(long, allow_hyphen_values = true, value_name = "STEPS", default_value = "0.5", value_parser = tolerance,
        help_heading = "Comparison")]
    pub tolerance: f64,

    /// Exits with 4 if more than N pixels have this cause; may be repeated
    ///
    /// The causes are those of the legend, with - in place of / and of spaces, such as texture-filter. `differing`
    /// counts all pixels that differ.
    #[arg(long, value_name = "CAUSE=N", value_parser = limit, help_heading = "Comparison")]
    pub threshold: Vec<Limit>,

    /// Sets the frame, as in `render --frames` [default: the scene's first, or 0]
    #[arg(long, value_name = "N", help_heading = "Comparison")]
    pub frame: Option<u32>,

    #[command(flatten)]
    pub output: OutputFlags,
    #[command(flatten)]
    pub picture: PictureFlags,
    #[command(flatten)]
    pub messages: MessageFlags,
}

const EXAMPLES: &str = "\
Examples:
  canaletto compare-methods scenes/zbuffer.kdl -o still.png
  canaletto compare-methods scenes/zbuffer.kdl --size 400x250 -o still.png
  canaletto compare-methods scenes/zbuffer.kdl --methods zbuffer,radiosity,whitted -o still.png
  canaletto compare-methods scenes/zbuffer.kdl --threshold unexplained=0 -o still.png
  canaletto compare-methods scenes/zbuffer.kdl --json -o still.png | jq .comparisons[0].causes";

fn long_help() -> String {
    let causes = Cause::ALL.iter().map(|cause| format!("  {:<15} {}\n", cause.name(), cause.meaning()));
    format!("{EXAMPLES}\n\nCauses:\n{}", causes.collect::<String>().trim_end())
}

/// A limit for the number of pixels with a cause, or of all that differ.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Limit {
    pub cause: Option<Cause>,
    pub pixels: u64,
}

/// The word of all pixels that differ.
const DIFFERING: &str = "differing";

/// A cause's word on the command line.
pub(crate) fn word_of(cause: Option<Cause>) -> String {
    cause.map_or(DIFFERING.into(), |cause| cause.name().replace(['/', ' '], "-"))
}

fn limit(text: &str) -> Result<Limit, String> {
    let (word, pixels) = text.split_once('=').ok_or("write a cause and a number with = between, such as shadow=100")?;
    let all = || Cause::ALL.iter().copied().map(Some).chain([None]);
    let pixels = pixels.parse().map_err(|_| format!("\"{pixels}\" isn't a number of pixels"))?;
    if let Some(cause) = all().find(|cause| word_of(*cause) == word.replace(['/', ' '], "-")) {
        return Ok(Limit { cause, pixels });
    }
    let words: Vec<String> = all().map(word_of).collect();
    Err(match closest_word(word, words.iter().map(String::as_str)) {
        Some(near) => format!("did you mean {near}?"),
        None => format!("the causes are {}", words.join(", ")),
    })
}

fn tolerance(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(steps) if (0.0..=255.0).contains(&steps) => Ok(steps),
        _ => Err("write a number of steps between 0 and 255, such as 0.5".into()),
    }
}

/// The picture of one integrator.
struct Method {
    integrator: Integrator,
    job: Job,
    /// The texts in its file.
    texts: Vec<(String, String)>,
    file: PathBuf,
}

/// A comparison with the reference.
struct MethodComparison {
    /// The name of the integrator.
    method: &'static str,
    causes: Causes,
}

/// Runs the command.
pub(crate) fn run(flags: &CompareMethodsFlags) -> Result<Exit, Failure> {
    let report = on_threads(flags.source.threads, || compare_methods(flags))??;
    if flags.messages.json {
        print_json(&report.json())?;
    } else {
        print(&report.text())?;
    }
    Ok(if report.exceeded().is_empty() { Exit::Done } else { Exit::Threshold })
}

fn compare_methods(flags: &CompareMethodsFlags) -> Result<MethodsReport<'_>, Failure> {
    check_methods(flags)?;
    let stem = format!("{}.methods", stem(&flags.source.scene));
    let output = Output::new(&flags.output, &stem, false, false)?;
    if output.is_stdout() {
        return Err(Failure::usage("--output -: the pictures need files").help("such as --output /tmp/compared.png"));
    }
    let Some(format) = output.format.picture() else {
        return Err(Failure::usage(format!("--output: {} isn't a format of pictures", output.format)));
    };
    let mut reader = Reader::open_classic(&flags.source)?;
    let source = reader.at_chosen(flags.picture.camera.as_deref(), flags.frame)?;
    let frame = source.frame;
    flags.messages.warn(&source.warnings);
    let mut methods = Vec::new();
    let mut camera = String::new();
    for &integrator in &flags.methods {
        let picture = PictureFlags { integrator: Some(integrator), ..flags.picture.clone() };
        let settings = Settings::new(&source.name, &source.scene, &picture)?;
        settings.check_pixels()?;
        let mut job = Job { frame, ..settings.job.clone() };
        // Light is compared.
        job.film.alpha = false;
        let file = output.layer_path(frame, integrator.name());
        methods.push(Method { integrator, job, texts: Vec::new(), file });
        camera = settings.camera;
    }
    let file = output.path(frame);
    let files = || methods.iter().map(|method| method.file.clone()).chain([file.clone()]);
    let table = CommandFiles::default().writes("--output", files());
    table.check()?;
    flags.output.folder.make_folders(&table)?;
    output.check(files())?;
    table.check_scene(&reader)?;
    check_room(&methods)?;
    let options = seen_through(&camera, &source.scene, flags.source.build_options(0));
    let (world, _) = build(&source.name, source.scene, &options, None)?;
    for method in &methods {
        flags.messages.warn(&doubt_omissions(&source.name, &world, &method.job));
    }
    let reference = reference(&methods);
    let job = &methods[reference].job;
    let stops = if is_metered(job) { Some(meter(&source.name, &world, job, None)?) } else { None };
    let Developing { exposure, tone, transfer } = job.developing();
    let exposure = stops.map_or(exposure, Exposure::Stops);
    for method in &mut methods {
        let film = &mut method.job.film;
        (film.exposure, film.tone, film.transfer) = (Some(exposure), Some(tone), transfer);
        method.texts = method_texts(&flags.source, &camera, &method.job);
    }
    let work = MethodsWork { flags, name: &source.name, world: &world, output: &output, format };
    let (pictures, solution) = work.render(&methods)?;
    let comparisons = work.compare(&methods, &pictures, solution.as_ref(), reference)?;
    let shown = cause_picture(
        &source.name,
        methods[reference].integrator.name(),
        &comparisons,
        &pictures[reference],
        &methods[reference].job.developing(),
    );
    let texts = [("methods".to_owned(), methods.iter().map(|m| m.integrator.name()).collect::<Vec<_>>().join(" "))];
    output.write_drawing(&file, format, shown, &texts)?;
    let files = methods.iter().map(|method| (method.integrator.name(), method.file.clone())).collect();
    let size = [pictures[reference].width, pictures[reference].height];
    Ok(MethodsReport {
        flags,
        scene: source.name.clone(),
        camera,
        size,
        reference: methods[reference].integrator.name(),
        files,
        file,
        comparisons,
    })
}

/// The texts in the file of a method's picture.
fn method_texts(source: &SourceFlags, camera: &str, job: &Job) -> Vec<(String, String)> {
    let settings = Settings { job: job.clone(), camera: camera.to_owned() };
    texts(&metadata(source, &settings), job, None)
}

/// Checks that the methods can be compared.
fn check_methods(flags: &CompareMethodsFlags) -> Result<(), Failure> {
    let names: Vec<&str> = flags.methods.iter().map(Integrator::name).collect();
    if flags.picture.integrator.is_some() {
        return Err(Failure::usage("--integrator names one method, but several are compared")
            .help("name them with --methods, such as --methods zbuffer,whitted"));
    }
    if names.len() < 2 {
        return Err(Failure::usage("--methods: a comparison takes two methods or more")
            .help(format!("they are {}, with commas between", Integrator::NAMES.join(", "))));
    }
    match (1..names.len()).find(|i| names[..*i].contains(&names[*i])) {
        Some(again) => Err(Failure::usage(format!("--methods names {} twice", names[again]))),
        None => Ok(()),
    }
}

/// The index of the method that the others are compared with.
fn reference(methods: &[Method]) -> usize {
    let whitted = methods.iter().position(|method| method.job.description().whitted().is_some());
    let traces_rays = |method: &Method| method.job.description().traces_rays();
    whitted.or(methods.iter().rposition(traces_rays)).unwrap_or(methods.len() - 1)
}

/// Checks before rendering that memory suffices for all pictures, and for the copies of one that is written.
fn check_room(methods: &[Method]) -> Result<(), Failure> {
    let [_, _, width, height] = methods[0].job.window();
    let size = u64::from(width) * u64::from(height) * 12 * (methods.len() as u64 + 4);
    if memory::room(size).is_ok() {
        return Ok(());
    }
    let message = format!(
        "there is no memory for {} pictures of {width} x {height} pixels: they take {}",
        methods.len(),
        bytes(size)
    );
    Err(Failure::new(Exit::Failed, message).help("compare them in parts with --crop"))
}

/// What all steps of a comparison need.
struct MethodsWork<'a> {
    flags: &'a CompareMethodsFlags,
    /// The scene's name.
    name: &'a str,
    world: &'a World,
    output: &'a Output,
    format: PictureFormat,
}

impl MethodsWork<'_> {
    /// Renders and writes the picture of each method. Returns the pictures, and the solution of radiosity.
    fn render(&self, methods: &[Method]) -> Result<(Vec<Picture>, Option<Arc<RadiositySolution>>), Failure> {
        let (mut pictures, mut solution) = (Vec::new(), None);
        for method in methods {
            let Method { integrator, job, .. } = method;
            let rendering = self.watched(integrator.name(), job, |watch| {
                let Some(settings) = job.description().radiosity() else { return render(self.world, job, watch) };
                match RadiositySolution::solve(self.world, settings, watch) {
                    Ok(solved) => render_with_solution(self.world, job, solution.insert(Arc::new(solved)), watch),
                    Err(RadiosityError::Cancelled) => Ok(Rendering::unfinished(self.world, job)),
                    Err(problem) => Err(problem.into()),
                }
            })?;
            if !rendering.complete {
                return Err(interrupted());
            }
            let rendered = Rendered { picture: &rendering.picture, developing: method.job.developing() };
            let settings = EncodeSettings { window: Some(window(&method.job)), ..self.output.settings };
            let bytes = self.format.encode(&rendered, &settings, &method.texts, &|| true);
            self.output.write(&method.file, &bytes.map_err(|e| unfit(&e))?)?;
            pictures.push(rendering.picture);
        }
        Ok((pictures, solution))
    }

    /// Finds why each method's picture differs from the reference.
    fn compare(
        &self,
        methods: &[Method],
        pictures: &[Picture],
        solution: Option<&Arc<RadiositySolution>>,
        reference: usize,
    ) -> Result<Vec<MethodComparison>, Failure> {
        let of = |index: usize| {
            let job = &methods[index].job;
            let solution = solution.filter(|_| job.description().radiosity().is_some());
            MethodPicture { job, picture: &pictures[index], solution }
        };
        let mut comparisons = Vec::new();
        for index in (0..methods.len()).filter(|index| *index != reference) {
            let method = methods[index].integrator.name();
            let causes = self.watched(&format!("causes of {method}"), &methods[index].job, |watch| {
                find_causes(self.world, &of(reference), &of(index), self.flags.tolerance, watch)
            })?;
            if !causes.complete {
                return Err(interrupted());
            }
            comparisons.push(MethodComparison { method, causes });
        }
        Ok(comparisons)
    }

    /// Does work whose progress is shown, and which a first signal stops.
    fn watched<T>(
        &self,
        label: &str,
        job: &Job,
        work: impl FnOnce(&ProgressDisplay) -> Result<T, JobError>,
    ) -> Result<T, Failure> {
        watched(self.flags.messages.style(), self.name, label, job, work)
    }
}

fn interrupted() -> Failure {
    Failure::new(Exit::Interrupted, "interrupted; pictures of finished methods are written")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_and_tolerances() {
        assert_eq!(limit("shadow=10"), Ok(Limit { cause: Some(Cause::Shadow), pixels: 10 }));
        assert_eq!(limit("near/far=0"), Ok(Limit { cause: Some(Cause::NearFar), pixels: 0 }));
        assert_eq!(limit("texture-filter=1"), Ok(Limit { cause: Some(Cause::TextureFilter), pixels: 1 }));
        assert_eq!(limit("differing=3"), Ok(Limit { cause: None, pixels: 3 }));
        assert_eq!(limit("shadws=1").unwrap_err(), "did you mean shadow?");
        assert!(limit("shadow").is_err() && limit("shadow=-1").is_err() && limit("shadow=x").is_err());
        assert_eq!((tolerance("0"), tolerance("2.5")), (Ok(0.0), Ok(2.5)));
        assert!(tolerance("-1").is_err() && tolerance("nan").is_err() && tolerance("300").is_err());
    }
}
