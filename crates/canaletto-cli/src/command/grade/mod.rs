//! `canaletto grade`: which stage of the chapter a picture shows, and which mistake explains it.

mod report;

use crate::command::compare::{Input, read};
use crate::exit::Exit;
use crate::failure::Failure;
use crate::flags::{MessageFlags, PictureFlags, PictureSize, SourceFlags};
use crate::metering::{exposed, is_metered, meter};
use crate::picture_file::picture_format;
use crate::settings::{Settings, classic};
use crate::source::{Reader, build, on_threads, seen_through};
use crate::stdout::{print, print_json};
use crate::watched::watched;
use canaletto::Named;
use canaletto::film::srgb_encode;
use canaletto::grade::{Grade, Mistake, Remark, StudentPicture, Task, Verdict, grade};
use canaletto::render::Job;
use canaletto::scene::Transfer;
use canaletto::texture::srgb_decode;
use canaletto_io::picture::PictureFormat;
use clap::Args;
use report::GradeReport;
use std::path::{Path, PathBuf};

/// Grades a picture of a scene that another ray tracer made: says what is missing or wrong, and which pixels tell.
///
/// The picture is compared with each stage of the chapter, and with each stage rendered with one of the usual mistakes.
/// If none explains it, the scene's own numbers are fitted to it. The simplest hypothesis that explains it is printed.
/// A mistake is named only if it explains the picture clearly better than no mistake. A picture is right if no
/// connected region of an object differs. Edges may differ, so that anti-aliasing and rounding don't count.
///
/// The scene is rendered in the size of the picture. Formats are PNG, PPM, JPEG, WebP, Radiance HDR and OpenEXR.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXAMPLES, after_long_help = long_help())]
pub(crate) struct GradeFlags {
    #[command(flatten)]
    pub source: SourceFlags,

    /// The picture to grade
    #[arg(value_name = "PICTURE")]
    pub student: PathBuf,

    /// Sets the frame, as in `render --frames` [default: the scene's first, or 0]
    #[arg(long, value_name = "N", help_heading = "Picture")]
    pub frame: Option<u32>,

    #[command(flatten)]
    pub picture: PictureFlags,
    #[command(flatten)]
    pub messages: MessageFlags,
}

const EXAMPLES: &str = "\
Examples:
  canaletto render scenes/chapter/box-5.4.kdl --no-shadows -o student.png
  canaletto grade scenes/chapter/box-5.4.kdl student.png
  canaletto grade scenes/chapter/box-5.4.kdl student.png --stage specular
  canaletto grade scenes/chapter/box-5.4.kdl student.png --json | jq .verdict";

fn long_help() -> String {
    let mistakes = Mistake::ALL.iter().map(|mistake| format!("  {:<26} {}\n", mistake.name(), mistake.meaning()));
    let remarks = Remark::ALL.iter().map(|remark| format!("  {:<26} {}\n", remark.name(), remark.meaning()));
    format!(
        "{EXAMPLES}\n\nThe exit code is 4 unless the picture is right.\n\nMistakes:\n{}\n\n\
         Remarks, which are no mistakes:\n{}",
        mistakes.collect::<String>().trim_end(),
        remarks.collect::<String>().trim_end()
    )
}

/// Runs the command.
pub(crate) fn run(flags: &GradeFlags) -> Result<Exit, Failure> {
    let report = on_threads(flags.source.threads, || graded(flags))??;
    if flags.messages.json {
        print_json(&report.json())?;
    } else {
        print(&report.text())?;
    }
    Ok(if report.grade.verdict == Verdict::Right { Exit::Done } else { Exit::Threshold })
}

fn graded(flags: &GradeFlags) -> Result<GradeReport<'_>, Failure> {
    let input = read(&flags.student, None)?;
    let size = [input.decoded.image.width, input.decoded.image.height];
    let source = Reader::open_classic(&flags.source)?.at_chosen(flags.picture.camera.as_deref(), flags.frame)?;
    flags.messages.warn(&source.warnings);
    let (name, scene, frame) = (source.name, source.scene, source.frame);
    let picture = classic(&flags.picture, &scene)?;
    let mut settings = Settings::new(&name, &scene, &picture)?;
    let own_size = settings.job.window().last_chunk().copied().unwrap_or(size);
    if own_size != size {
        if settings.job.film.crop.is_some() {
            let [[w, h], [own_w, own_h]] = [size, own_size];
            let message = format!("the picture has {w} x {h} pixels, but the scene's crop window {own_w} x {own_h}");
            return Err(Failure::usage(message).help("give --size and --crop of the picture"));
        }
        settings = Settings::new(&name, &scene, &PictureFlags { size: Some(PictureSize::Pixels(size)), ..picture })?;
    }
    settings.check_pixels()?;
    let mut job = Job { frame, ..settings.job };
    // Light is graded.
    job.film.alpha = false;
    let options = seen_through(&settings.camera, &scene, flags.source.build_options(0));
    let (world, _) = build(&name, scene.clone(), &options, None)?;
    let job = if is_metered(&job) { exposed(&job, meter(&name, &world, &job, None)?) } else { job };
    let Some(own_view) = scene.views.iter().find(|view| view.name == settings.camera) else {
        return Err(Failure::new(Exit::Scene, format!("{name} has no camera")));
    };
    let mut view = own_view.clone();
    [view.intrinsics.width, view.intrinsics.height] = job.camera.size();
    let task = Task { scene: &scene, view: &view, world: &world, job: &job };
    let style = flags.messages.style();
    let graded = |student: &StudentPicture| -> Result<Grade, Failure> {
        watched(style, &name, "grading", &job, |watch| grade(task, student, watch))
    };
    let student = student_picture(&flags.student, &input, &job)?;
    let mut grade = graded(&student)?;
    // A picture that is right by the curve that its file declares is right.
    if grade.complete
        && grade.verdict == Verdict::Mistaken
        && let Some(other) = as_declared(&student, input.curve(), job.film.transfer)
    {
        let declared = graded(&other)?;
        if declared.verdict != Verdict::Mistaken || declared.error < 0.5 * grade.error {
            grade = declared;
            grade.remarks.push(Remark::DeclaredCurve);
        }
    }
    if !grade.complete {
        return Err(Failure::new(Exit::Interrupted, "interrupted"));
    }
    Ok(GradeReport { flags, scene: name, camera: settings.camera, size, own_size, grade })
}

/// The picture's display values. Linear values are developed as the scene says.
fn student_picture(path: &Path, input: &Input, job: &Job) -> Result<StudentPicture, Failure> {
    let image = input.seen(&job.developing(), None);
    let Some([r, g, b]) = image.rgb() else {
        return Err(Failure::new(Exit::Scene, format!("{} has no colours", path.display())));
    };
    let pixels = (0..r.len()).map(|i| [r[i], g[i], b[i]]).collect();
    let tolerance = match picture_format(path) {
        Some(PictureFormat::Jpeg | PictureFormat::WebP) => StudentPicture::COMPRESSED,
        _ => StudentPicture::ROUNDED,
    };
    Ok(StudentPicture { width: image.width, height: image.height, pixels, tolerance })
}

/// The student's picture with the curve of the scene, if its file declares another one.
fn as_declared(student: &StudentPicture, declared: Option<Transfer>, own: Transfer) -> Option<StudentPicture> {
    let curve = match (declared?, own) {
        (Transfer::Srgb, Transfer::None) => srgb_decode,
        (Transfer::None, Transfer::Srgb) => srgb_encode,
        _ => return None,
    };
    Some(StudentPicture { pixels: student.pixels.iter().map(|c| c.map(curve)).collect(), ..student.clone() })
}
