//! `canaletto convert`: a scene or model in another form.

use crate::command::render::stem;
use crate::command_files::{CommandFiles, FolderFlag, folder_of};
use crate::exit::Exit;
use crate::failure::{Failure, eprint_line, print_diagnostics, reason};
use crate::flags::{SourceFlags, named};
use crate::format::JSON_VERSION;
use crate::model::is_model;
use crate::output::{check_files, write_files};
use crate::source::{Reader, Source, on_threads};
use crate::stdout::print_json;
use crate::terminal::Paint;
use canaletto::Named;
use canaletto::memory;
use canaletto::scene::Integrator;
use canaletto_io::export::convert::{self, Conversion, ConvertFormat, Loss};
use canaletto_io::import::PictureQuality;
use clap::Args;
use serde_json::json;
use std::path::{Path, PathBuf};

/// Writes a scene or model in another form: scene text, glTF, OBJ or PLY.
///
/// Scene text shows the same picture, to the last bit, as the file that it comes from. A model becomes a scene with its
/// camera, lights and ground, to be changed by hand. The other forms hold objects, materials, cameras and lights, as
/// far as they have words for them. What is lost is listed.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct ConvertFlags {
    #[command(flatten)]
    pub source: SourceFlags,

    #[arg(value_name = "OUTPUT", help = output_help())]
    pub output: PathBuf,

    /// Fails if a file exists already, instead of replacing it
    #[arg(long, help_heading = "Output")]
    pub no_clobber: bool,
    #[command(flatten)]
    pub folder: FolderFlag,

    /// Selects the integrator that a model is lit for [default: path]
    #[arg(long, value_name = "NAME", value_parser = named::<Integrator>(), help_heading = "Models")]
    pub integrator: Option<Integrator>,

    /// Sets the frame [default: the scene's first, or 0]
    #[arg(long, value_name = "N", help_heading = "Scene")]
    pub frame: Option<u32>,

    /// Prints the files and what is lost as JSON
    #[arg(long, help_heading = "Messages")]
    pub json: bool,

    /// Prints nothing but errors
    #[arg(short, long, help_heading = "Messages")]
    pub quiet: bool,
}

fn output_help() -> String {
    format!("The file to write, whose ending selects the form: .{}", ConvertFormat::NAMES.join(", ."))
}

const EXAMPLES: &str = "\
Examples:
  canaletto convert scenes/models/spot.obj spot.kdl   # a scene to be changed by hand, and spot.assets/
  canaletto convert scenes/models/spot.obj spot.kdl --view front --light sky
  canaletto convert scenes/models/spot.obj spot.glb   # the model alone, for other programs
  canaletto convert scenes/still-life.kdl still-life-2.kdl --json | jq -r '.files[]'";

/// Runs the command.
pub(crate) fn run(flags: &ConvertFlags) -> Result<Exit, Failure> {
    on_threads(flags.source.threads, || convert(flags))?
}

fn convert(flags: &ConvertFlags) -> Result<Exit, Failure> {
    let format = format_of(&flags.output)?;
    let table = CommandFiles::default().reads("SCENE", [&flags.source.scene]).writes("OUTPUT", [flags.output.clone()]);
    table.check()?;
    flags.folder.make_folders(&table)?;
    check_files([flags.output.clone()], &flags.output, flags.no_clobber)?;
    let mut given = flags.source.clone();
    // Other forms than scenes hold the model alone.
    given.staging.bare = !format.holds_scenes();
    let mut reader = Reader::open(&given, flags.integrator, None)?;
    let timeline = reader.timeline();
    let source = reader.at_chosen(None, flags.frame)?;
    if !flags.quiet {
        print_diagnostics(&source.warnings, false);
    }
    memory::working_at("converting the scene");
    let originals = reader.originals(&source.files);
    let stem = stem(&flags.output);
    let input = convert::Source {
        scene: &source.scene,
        originals: &originals,
        stem: &stem,
        has_default_material: !is_model(&flags.source.scene),
        remarks: remarks(flags),
    };
    let Conversion { files, mut lost } = convert::convert(&input, format);
    if timeline.moves && !is_model(&flags.source.scene) {
        lost.insert(
            0,
            Loss { what: format!("the animation, of which frame {} is written", source.frame), names: vec![] },
        );
    }
    let folder = folder_of(&flags.output);
    let mut paths: Vec<PathBuf> = files.iter().map(|file| folder.join(&file.name)).collect();
    // The user's own letters stay.
    paths[0].clone_from(&flags.output);
    let table = CommandFiles::default().reads("SCENE", [&flags.source.scene]).writes("OUTPUT", paths.clone());
    table.check()?;
    table.check_scene(&reader)?;
    for path in &paths[1..] {
        let folder = folder_of(path);
        let failed =
            |e| Failure::new(Exit::Failed, format!("can't make the folder {}: {}", folder.display(), reason(&e)));
        std::fs::create_dir_all(folder).map_err(failed)?;
    }
    let contents: Vec<Vec<u8>> = files.into_iter().map(|file| file.bytes).collect();
    write_files(&paths, &contents, flags.no_clobber)?;
    tell(flags, &source, &paths, &lost)?;
    Ok(Exit::Done)
}

/// Says what is lost.
fn tell(flags: &ConvertFlags, source: &Source, paths: &[PathBuf], lost: &[Loss]) -> Result<(), Failure> {
    if flags.json {
        let files: Vec<String> = paths.iter().map(|path| path.display().to_string()).collect();
        return print_json(&json!({
            "version": JSON_VERSION, "scene": source.name, "frame": source.frame, "files": files, "lost": lost,
        }));
    }
    if !flags.quiet {
        let paint = Paint::stderr();
        for loss in lost {
            eprint_line(&format!("{} {loss}", paint.cyan("lost:")));
        }
    }
    Ok(())
}

/// Remarks for people: where the scene comes from, and how its picture is that of its source.
fn remarks(flags: &ConvertFlags) -> Vec<String> {
    let name = |path: &Path| path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let mut remarks = vec![format!("Made from {} by canaletto convert.", name(&flags.source.scene))];
    let is_by_paths = flags.integrator.is_none_or(|integrator| matches!(integrator, Integrator::Path(_)));
    if is_model(&flags.source.scene) && is_by_paths {
        let quality = match flags.source.staging.quality.unwrap_or_default() {
            PictureQuality::Draft => "fast",
            _ => "good",
        };
        let output = name(&flags.output);
        remarks.push(format!("The model's picture: canaletto render {output} --denoise={quality}"));
    }
    remarks
}

/// The form of the output's extension.
fn format_of(output: &Path) -> Result<ConvertFormat, Failure> {
    let shown = output.display();
    let endings = format!("end the name in .{}", ConvertFormat::NAMES.join(", ."));
    if output == Path::new("-") {
        return Err(Failure::usage("OUTPUT -: a converted scene needs a file").help(endings));
    }
    let extension = output.extension().map(|e| e.to_string_lossy().to_lowercase());
    let known = extension.as_deref().and_then(ConvertFormat::of_extension);
    known.ok_or_else(|| {
        Failure::usage(match extension {
            Some(other) => format!("OUTPUT {shown}: scenes can't be written as .{other}"),
            None => format!("OUTPUT {shown} has no extension to choose the form by"),
        })
        .help(endings)
    })
}
