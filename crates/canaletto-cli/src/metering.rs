//! The exposure `auto`: it is metered once in a small picture of the whole, before the first picture.

use crate::failure::Failure;
use crate::flags::{PictureFlags, SourceFlags};
use crate::progress::Style;
use crate::settings::Settings;
use crate::source::{Reader, build, seen_through};
use crate::watched::watched;
use canaletto::film::metered_exposure;
use canaletto::integrator::radiosity::RadiositySolution;
use canaletto::render::{Job, render, render_with_solution};
use canaletto::scene::Exposure;
use canaletto::world::World;
use std::sync::Arc;

/// Whether a job's exposure has to be metered.
pub(crate) fn is_metered(job: &Job) -> bool {
    job.developing().exposure == Exposure::Auto
}

/// The job with its exposure in stops.
pub(crate) fn exposed(job: &Job, stops: f32) -> Job {
    let mut exposed = job.clone();
    exposed.film.exposure = Some(Exposure::Stops(stops));
    exposed
}

/// The stops that the world needs in a job's picture.
pub(crate) fn meter(
    name: &str,
    world: &World,
    job: &Job,
    solution: Option<&Arc<RadiositySolution>>,
) -> Result<f32, Failure> {
    let small = job.metering();
    let rendering = watched(Style::Silent, name, "exposure", &small, |watch| match solution {
        Some(solution) => render_with_solution(world, &small, solution, watch),
        None => render(world, &small, watch),
    })?;
    Ok(metered_exposure(&rendering.picture))
}

/// A job whose exposure `auto` is metered: in `world`, or in the scene's first frame if the scene moves and `world` is
/// that of another one. All frames have one exposure, so that a film doesn't flicker.
pub(crate) fn metered(
    reader: &mut Reader,
    flags: (&SourceFlags, &PictureFlags),
    (world, job): (&World, &Job),
    solution: Option<&Arc<RadiositySolution>>,
) -> Result<Job, Failure> {
    if !is_metered(job) {
        return Ok(job.clone());
    }
    let stops = if is_metered_elsewhere(reader, job.frame) {
        let (first, first_job) = first_frame(reader, flags)?;
        meter(&reader.name, &first, &first_job, None)?
    } else {
        // The first frame's random numbers: a film that is gone on with has the exposure that it began with.
        let first = Job { frame: reader.first_frame(), ..job.clone() };
        meter(&reader.name, world, &first, solution)?
    };
    Ok(exposed(job, stops))
}

/// Whether the exposure of a frame is metered in another one.
pub(crate) fn is_metered_elsewhere(reader: &Reader, frame: u32) -> bool {
    reader.timeline().moves && frame != reader.first_frame()
}

/// The world of the scene's first frame, and the job of its picture.
pub(crate) fn first_frame(
    reader: &mut Reader,
    (source, picture): (&SourceFlags, &PictureFlags),
) -> Result<(World, Job), Failure> {
    let first = reader.at(reader.first_frame())?;
    let settings = Settings::new(&first.name, &first.scene, picture)?;
    let options = seen_through(&settings.camera, &first.scene, source.build_options(0));
    let (world, _) = build(&first.name, first.scene, &options, None)?;
    Ok((world, Job { frame: first.frame, ..settings.job }))
}
