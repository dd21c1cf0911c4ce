//! Pictures of radiosity's method "shooting" after some of its steps, as they are found.

use crate::exit::Exit;
use crate::failure::{Failure, eprint_line};
use crate::inputs::FileKey;
use crate::interrupt;
use crate::output::{Output, OutputFlags, numbered, unfit, window};
use crate::output_format::Format;
use crate::progress::{Style, emit};
use crate::solutions::check_radiosity;
use canaletto::Named;
use canaletto::integrator::describe;
use canaletto::integrator::radiosity::{ShootingStep, ShootingWatcher};
use canaletto::render::{Job, Observer, render_with_solution};
use canaletto::scene::{Integrator, RadiosityMethod, RadiositySettings};
use canaletto::world::World;
use canaletto_io::picture::{EncodeSettings, Rendered};
use clap::Args;
use serde_json::json;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Flags about the steps of shooting.
#[derive(Args, Clone, Debug, Default)]
pub(crate) struct ShootingFlags {
    /// Writes pictures after steps 1, 2, 4, 8, ... of the method "shooting", such as step.####.png
    ///
    /// Each # is a digit of the step's number. The light that isn't sent yet is shown as ambient light.
    #[arg(long, value_name = "PATTERN", conflicts_with = "solution", help_heading = "Radiosity")]
    pub shooting_steps: Option<PathBuf>,

    /// Writes the pictures of --shooting-steps after every Nth step
    #[arg(long, allow_hyphen_values = true, value_name = "N", value_parser = clap::value_parser!(u32).range(1..),
        requires = "shooting_steps", help_heading = "Radiosity")]
    pub shooting_every: Option<u32>,
}

impl ShootingFlags {
    /// Checks that the flags suit an integrator.
    pub(crate) fn check_integrator(&self, scene: &str, integrator: &Integrator) -> Result<(), Failure> {
        if self.shooting_steps.is_none() {
            return Ok(());
        }
        check_radiosity("--shooting-steps", scene, integrator)?;
        match describe(integrator).radiosity() {
            Some(RadiositySettings { method, .. }) if *method != RadiosityMethod::Shooting => {
                Err(Failure::usage(format!("--shooting-steps: the method {} has no steps", method.name()))
                    .help("add --set integrator.method=shooting"))
            }
            _ => Ok(()),
        }
    }
}

/// The files of the pictures after steps.
#[derive(Clone, Debug)]
pub(crate) struct StepPictures {
    output: Output,
    /// Every how many steps there is a picture. None stands for the steps 1, 2, 4, 8, …
    every: Option<u32>,
}

impl StepPictures {
    /// Checks the name of the files, in which `#` stands for the step. `flags` are those of the picture.
    pub(crate) fn new(pattern: &Path, every: Option<u32>, flags: &OutputFlags) -> Result<StepPictures, Failure> {
        if numbered(pattern).is_none() {
            return Err(Failure::usage(format!(
                "--shooting-steps: the picture of every step would be written to {}",
                pattern.display()
            ))
            .help("put #### where the step's number belongs, such as --shooting-steps step.####.png"));
        }
        // The format is that of the name.
        let flags = OutputFlags { output: Some(pattern.to_owned()), format: None, ..flags.clone() };
        let output = Output::new(&flags, "", true, true).map_err(of_steps)?;
        if output.format.film().is_some() {
            return Err(Failure::usage(format!("--shooting-steps {}: steps are pictures", pattern.display()))
                .help(format!("end the name in {}", Format::picture_extensions())));
        }
        let steps = StepPictures { output, every };
        steps.output.check(if flags.no_clobber { steps.existing() } else { Vec::new() }).map_err(of_steps)?;
        Ok(steps)
    }

    /// Whether there is a picture after a step.
    fn has(&self, step: usize) -> bool {
        match self.every {
            Some(every) => step.is_multiple_of(every as usize),
            None => step.is_power_of_two(),
        }
    }

    /// Whether a file has the name of a step's picture.
    pub(crate) fn is_name(&self, file: &Path) -> bool {
        let pattern = self.output.pattern();
        let Some((before, _, after)) = numbered(pattern) else { return false };
        let folder = |path: &Path| match path.parent() {
            Some(folder) if folder != Path::new("") => folder.to_owned(),
            _ => PathBuf::from("."),
        };
        let number = file.file_name().and_then(|name| name.to_str()?.strip_prefix(before)?.strip_suffix(after));
        FileKey::of(&folder(pattern)) == FileKey::of(&folder(file))
            && number.is_some_and(|number| !number.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit()))
    }

    /// The files that exist and have names of steps' pictures.
    pub(crate) fn existing(&self) -> Vec<PathBuf> {
        let folder = self.output.pattern().parent().unwrap_or(Path::new(""));
        let read = if folder == Path::new("") { Path::new(".") } else { folder };
        let entries = read.read_dir().into_iter().flatten().flatten();
        entries.map(|entry| folder.join(entry.file_name())).filter(|file| self.is_name(file)).collect()
    }
}

/// A failure of an output, which here is that of the steps.
fn of_steps(failure: Failure) -> Failure {
    match failure {
        Failure::Message { exit, message, help } => {
            Failure::Message { exit, message: message.replace("--output", "--shooting-steps"), help }
        }
        other => other,
    }
}

/// Makes and writes the pictures after steps while radiosity is solved.
pub(crate) struct StepWriter<'a> {
    pub(crate) pictures: &'a StepPictures,
    pub(crate) world: &'a World,
    pub(crate) job: Job,
    /// The text entries of the files.
    pub(crate) texts: &'a [(String, String)],
    pub(crate) style: Style,
    pub(crate) quiet: bool,
    /// The reason why no more pictures are written.
    pub(crate) failure: Option<Failure>,
}

/// Stops the picture of a step after a signal.
struct Signals;

impl Observer for Signals {
    fn cancelled(&self) -> bool {
        interrupt::requested()
    }
}

impl ShootingWatcher for StepWriter<'_> {
    fn watches(&self) -> bool {
        self.failure.is_none()
    }

    fn step(&mut self, step: &ShootingStep) {
        if self.pictures.has(step.step)
            && self.failure.is_none()
            && let Err(failure) = self.write(step)
        {
            self.failure = Some(failure);
        }
    }
}

impl StepWriter<'_> {
    fn write(&self, step: &ShootingStep) -> Result<(), Failure> {
        let Some(format) = self.pictures.output.format.picture() else { return Ok(()) };
        let rendered = render_with_solution(self.world, &self.job, &Arc::new(step.solution()), &Signals)
            .map_err(|e| Failure::new(Exit::Scene, e))?;
        if !rendered.complete {
            return Ok(());
        }
        let file = self.pictures.output.path(u32::try_from(step.step).unwrap_or(u32::MAX));
        let shown = Rendered { picture: &rendered.picture, developing: self.job.developing() };
        let settings = EncodeSettings { window: Some(window(&self.job)), ..self.pictures.output.settings };
        let mut texts = self.texts.to_vec();
        texts.push(("shooting step".into(), step.step.to_string()));
        texts.push(("unsent".into(), step.unsent.to_string()));
        let bytes = format.encode(&shown, &settings, &texts, &|| !interrupt::requested()).map_err(|e| unfit(&e))?;
        if interrupt::requested() {
            return Ok(());
        }
        self.pictures.output.write(&file, &bytes).map_err(of_steps)?;
        match self.style {
            Style::Json => {
                emit(&json!({ "event": "step", "step": step.step, "unsent": step.unsent, "file": file }));
            }
            _ if self.quiet => {}
            _ => eprint_line(&format!(
                "{}: step {}, {:.1}% of the light is unsent",
                file.display(),
                step.step,
                step.unsent * 100.0
            )),
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pictures(pattern: &str, every: Option<u32>) -> Result<StepPictures, Failure> {
        let flags = OutputFlags {
            output: None,
            format: None,
            bits: None,
            compression: None,
            uint_ids: false,
            no_clobber: false,
            folder: Default::default(),
        };
        StepPictures::new(Path::new(pattern), every, &flags)
    }

    #[test]
    fn steps_are_powers_of_two_or_multiples() {
        let of = |every| {
            let pictures = pictures("s.##.png", every).unwrap();
            (0..20).filter(|step| *step > 0 && pictures.has(*step)).collect::<Vec<usize>>()
        };
        assert_eq!(of(None), [1, 2, 4, 8, 16]);
        assert_eq!(of(Some(7)), [7, 14]);
    }

    #[test]
    fn names_of_steps() {
        let pictures = pictures("s#.##.png", None).unwrap();
        let is_name = |name: &str| pictures.is_name(Path::new(name));
        assert!(is_name("s#.01.png") && is_name("s#.12345.png"));
        assert!(!is_name("s#.png") && !is_name("s#..png") && !is_name("s#.1a.png") && !is_name("a/s#.01.png"));
    }

    #[test]
    fn wrong_names_are_refused() {
        let told = |pattern: &str| match pictures(pattern, None).unwrap_err() {
            Failure::Message { message, .. } => message,
            other => panic!("{other:?}"),
        };
        assert!(told("s.png").contains("every step would be written to s.png"));
        assert!(told("s.##.jpg").contains("--shooting-steps s.##.jpg"));
        assert!(told("s.##.gif").contains("steps are pictures"));
        assert!(told("none/s.##.png").contains("there is no folder none"));
    }
}
