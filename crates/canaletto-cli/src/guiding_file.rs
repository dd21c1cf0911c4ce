//! What path guiding learnt, in a file: for parts of a picture, and for renders that are gone on with.

use crate::exit::Exit;
use crate::failure::{Failure, reason};
use crate::sample_file::{check_texts, texts_of_file};
use crate::settings::MODEL;
use crate::solutions::SolutionFlags;
use canaletto::integrator::{GuidingField, StateFileError};
use canaletto::render::Job;
use canaletto::scene::{Guiding, Integrator};
use clap::Args;
use std::fs::File;
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

/// The flag about what was prepared.
#[derive(Args, Clone, Debug, Default)]
pub(crate) struct PreparedFlags {
    /// Reads what path guiding learnt, or the solution of radiosity, from a file of canaletto prepare
    ///
    /// The bytes of the picture are those without it. If the scene or a setting changed since, a message says what did,
    /// and the exit code is 3.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["solution", "save_solution"], help_heading = "Sampling")]
    pub prepared: Option<PathBuf>,
}

impl PreparedFlags {
    /// Takes a file with a solution of radiosity as one of `--solution`.
    pub(crate) fn resolve(&mut self, solution: &mut SolutionFlags) -> Result<(), Failure> {
        let Some(file) = &self.prepared else { return Ok(()) };
        let mut start = [0; 4];
        let read = File::open(file).and_then(|mut file| file.read_exact(&mut start));
        match read {
            Err(error) if error.kind() != io::ErrorKind::UnexpectedEof => {
                let message = format!("--prepared {}: {}", file.display(), reason(&error));
                Err(Failure::new(Exit::Scene, message))
            }
            _ if start == *b"\x89RAD" => {
                solution.solution = self.prepared.take();
                Ok(())
            }
            _ => Ok(()),
        }
    }
}

/// The texts by which a field is known to belong to a picture, besides the integrator's settings.
const TELLING: [&str; 9] = ["Software", "size", "camera", "frame", "seed", "integrator", "filter", MODEL, "set"];

/// Whether the paths of a job are guided.
pub(crate) fn is_guided(job: &Job) -> bool {
    matches!(job.integrator, Integrator::Path(settings) if settings.guiding != Guiding::Off)
}

/// Writes a field. `texts` are those of the picture's samples.
pub(crate) fn write_guiding(
    field: &GuidingField,
    (job, texts): (&Job, &[(String, String)]),
    out: &mut dyn Write,
) -> io::Result<()> {
    field.write(&texts_of_file(job, texts), out)
}

/// Reads the field of a picture. `role` is what the user calls the file.
pub(crate) fn read_guiding(
    role: &str,
    file: &Path,
    picture: (&Job, &[(String, String)]),
) -> Result<GuidingField, Failure> {
    let failed = |message: &str| {
        Failure::new(Exit::Scene, format!("{role} {}: {message}", file.display()))
            .help("make it anew by canaletto prepare")
    };
    let open = File::open(file).map_err(|error| failed(&reason(&error)))?;
    let length = open.metadata().map_err(|error| failed(&reason(&error)))?.len();
    let (texts, field) = GuidingField::read(open, length).map_err(|error| match error {
        StateFileError::Unreadable(error) => failed(&reason(&error)),
        other => failed(&other.to_string()),
    })?;
    check_texts(&texts, picture, &TELLING, &|message| failed(&message))?;
    Ok(field)
}
