//! Solutions of radiosity in a run: read from a file, solved, kept for later frames, saved.

use crate::exit::Exit;
use crate::failure::{Failure, reason};
use crate::output::{check_files, write_with};
use canaletto::Named;
use canaletto::integrator::radiosity::{RadiosityError, RadiositySolution, SolutionFingerprint};
use canaletto::integrator::{StateFileError, describe};
use canaletto::render::{Job, JobError, Observer};
use canaletto::scene::{Integrator, RadiositySettings, Scene};
use canaletto::world::World;
use canaletto_io::picture::WriteOptions;
use clap::Args;
use serde::Serialize;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Flags about solutions of radiosity.
#[derive(Args, Clone, Debug, Default)]
pub(crate) struct SolutionFlags {
    /// Saves the solution of radiosity in a file, for more pictures of the same scene
    ///
    /// The file is written when the solution is found, before the picture is. The solution belongs to the scene without
    /// its cameras: other pictures may have other cameras, sizes and samples, and show something else of the solution.
    #[arg(long, value_name = "FILE", help_heading = "Radiosity")]
    pub save_solution: Option<PathBuf>,

    /// Reads the solution of radiosity from a file of --save-solution instead of solving
    ///
    /// If the scene or the settings of radiosity changed since, a message says what did, and the exit code is 3.
    #[arg(long, value_name = "FILE", conflicts_with = "save_solution", help_heading = "Radiosity")]
    pub solution: Option<PathBuf>,
}

/// A flag of commands that use a solution but save none.
#[derive(Args, Clone, Debug, Default)]
pub(crate) struct GivenSolutionFlags {
    /// Reads the solution of radiosity from a file of `render --save-solution` instead of solving
    ///
    /// If the scene or the settings of radiosity changed since, a message says what did, and the exit code is 3.
    #[arg(long, value_name = "FILE", help_heading = "Radiosity")]
    pub solution: Option<PathBuf>,
}

impl From<&GivenSolutionFlags> for SolutionFlags {
    fn from(flags: &GivenSolutionFlags) -> SolutionFlags {
        SolutionFlags { save_solution: None, solution: flags.solution.clone() }
    }
}

impl SolutionFlags {
    /// The flag that is given, if one is.
    pub(crate) fn given(&self) -> Option<&'static str> {
        match self {
            SolutionFlags { save_solution: Some(_), .. } => Some("--save-solution"),
            SolutionFlags { solution: Some(_), .. } => Some("--solution"),
            SolutionFlags { save_solution: None, solution: None } => None,
        }
    }

    /// Checks that the flags suit an integrator.
    pub(crate) fn check_integrator(&self, scene: &str, integrator: &Integrator) -> Result<(), Failure> {
        self.given().map_or(Ok(()), |flag| check_radiosity(flag, scene, integrator))
    }

    /// Checks before rendering that the solution can be saved.
    pub(crate) fn check_file(&self, no_clobber: bool) -> Result<(), Failure> {
        let Some(file) = &self.save_solution else { return Ok(()) };
        if file == Path::new("-") {
            return Err(Failure::usage("--save-solution - : a solution needs a file").help("such as room.rad"));
        }
        check_files([file.clone()], file, no_clobber)
    }
}

/// Checks that a flag of radiosity suits an integrator.
pub(crate) fn check_radiosity(flag: &str, scene: &str, integrator: &Integrator) -> Result<(), Failure> {
    if describe(integrator).radiosity().is_some() {
        return Ok(());
    }
    let name = integrator.name();
    Err(Failure::usage(format!("{flag} is for the integrator radiosity, and {scene} is rendered by {name}"))
        .help("add --integrator radiosity"))
}

/// Where the solution of a frame comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum SolutionSource {
    /// It was solved for this frame.
    Solved,
    /// It was solved for a frame before, or for another scene of the run that is the same without its cameras.
    Kept,
    /// It was read from a file.
    Read,
}

/// The fingerprint of a scene, if a job needs its solution.
pub(crate) fn fingerprint(scene: &Scene, job: &Job) -> Option<SolutionFingerprint> {
    job.description().radiosity().map(|settings| SolutionFingerprint::new(scene, settings))
}

/// The solutions of a run. At most one is kept.
#[derive(Default)]
pub(crate) struct Solutions {
    flags: SolutionFlags,
    options: WriteOptions,
    kept: Option<(SolutionFingerprint, Arc<RadiositySolution>)>,
    /// The number of times that a solution was solved.
    pub(crate) solves: u64,
    /// The duration of the last of them.
    pub(crate) solve_time: Duration,
    is_saved: bool,
}

impl Solutions {
    /// Reads the solution that the flags name.
    pub(crate) fn new(flags: &SolutionFlags, no_clobber: bool) -> Result<Solutions, Failure> {
        let kept = flags.solution.as_deref().map(read).transpose()?;
        let options = WriteOptions { no_clobber, durable: true };
        Ok(Solutions { flags: flags.clone(), options, kept, ..Solutions::default() })
    }

    /// Whether the solution is still to be saved.
    pub(crate) fn is_unsaved(&self) -> bool {
        self.flags.save_solution.is_some() && !self.is_saved
    }

    /// Takes the solution of a file, if it is that of a scene, and none is there.
    pub(crate) fn take_from(&mut self, file: &Path, scene: &SolutionFingerprint) {
        if self.kept.is_none()
            && let Ok((fingerprint, solution)) = read(file)
            && fingerprint.check(scene).is_ok()
        {
            self.kept = Some((fingerprint, solution));
        }
    }

    /// Checks that the solution that was read or saved is that of a scene.
    pub(crate) fn check(&self, scene: &SolutionFingerprint) -> Result<(), Failure> {
        let Some(Err(changed)) = self.kept.as_ref().map(|(solved, _)| solved.check(scene)) else { return Ok(()) };
        match &self.flags {
            SolutionFlags { solution: Some(file), .. } => {
                let message = format!("--solution {}: {changed}", file.display());
                Err(Failure::new(Exit::Scene, message).help("solve again with --save-solution"))
            }
            SolutionFlags { save_solution: Some(file), .. } => Err(changes_between_frames(file, &changed.to_string())),
            _ => Ok(()),
        }
    }

    /// Checks that frames can share the solution that will be saved.
    pub(crate) fn check_frames(&self, first: &SolutionFingerprint, other: &SolutionFingerprint) -> Result<(), Failure> {
        match (&self.flags.save_solution, first.check(other)) {
            (Some(file), Err(changed)) => Err(changes_between_frames(file, &changed.to_string())),
            _ => Ok(()),
        }
    }

    /// The solution of a world, whose scene has this fingerprint; none if the observer cancels.
    pub(crate) fn solution(
        &mut self,
        name: &str,
        world: &World,
        fingerprint: &SolutionFingerprint,
        settings: &RadiositySettings,
        observer: &dyn Observer,
    ) -> Result<Option<(Arc<RadiositySolution>, SolutionSource)>, Failure> {
        self.check(fingerprint)?;
        if let Some((_, solution)) = self.kept.as_ref().filter(|(solved, _)| solved.check(fingerprint).is_ok()) {
            if solution.fits(world) {
                let source = if self.solves == 0 { SolutionSource::Read } else { SolutionSource::Kept };
                return Ok(Some((Arc::clone(solution), source)));
            }
            const ELSEWHERE: &str = "the scene is far from zero, and the camera is elsewhere than for the solution";
            match &self.flags {
                SolutionFlags { solution: Some(file), .. } => {
                    let message = format!("--solution {}: {ELSEWHERE}", file.display());
                    return Err(Failure::new(Exit::Scene, message).help("solve again with --save-solution"));
                }
                SolutionFlags { save_solution: Some(file), .. } => return Err(changes_between_frames(file, ELSEWHERE)),
                _ => {}
            }
        }
        // The old solution and the new one need not be in memory together.
        self.kept = None;
        let start = Instant::now();
        let solution = match RadiositySolution::solve(world, settings, observer) {
            Ok(solution) => Arc::new(solution),
            Err(RadiosityError::Cancelled) => return Ok(None),
            Err(problem) => return Err(Failure::new(Exit::Scene, format!("{name}: {}", JobError::from(problem)))),
        };
        self.solves += 1;
        self.solve_time = start.elapsed();
        self.kept = Some((*fingerprint, Arc::clone(&solution)));
        if let Some(file) = &self.flags.save_solution {
            write_with(file, self.options, |out| solution.write(fingerprint, out))?;
            self.is_saved = true;
        }
        Ok(Some((solution, SolutionSource::Solved)))
    }
}

fn changes_between_frames(file: &Path, why: &str) -> Failure {
    let message = format!("--save-solution {}: one solution doesn't serve all frames; {why}", file.display());
    Failure::usage(message).help("give --frames between which only the camera moves")
}

/// Reads a solution from a file.
fn read(path: &Path) -> Result<(SolutionFingerprint, Arc<RadiositySolution>), Failure> {
    let failed = |why: &str| Failure::new(Exit::Scene, format!("can't read the solution {}: {why}", path.display()));
    let file = File::open(path).map_err(|e| failed(&reason(&e)))?;
    let metadata = file.metadata().map_err(|e| failed(&reason(&e)))?;
    if !metadata.is_file() {
        return Err(failed("it is no file"));
    }
    match RadiositySolution::read(file, metadata.len()) {
        Ok((fingerprint, solution)) => Ok((fingerprint, Arc::new(solution))),
        Err(StateFileError::Unreadable(e)) => Err(failed(&reason(&e))),
        Err(error) => Err(failed(&error.to_string()).help("make a new one with --save-solution")),
    }
}
