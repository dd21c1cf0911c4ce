//! What a render would take: `--dry-run`, and the check of memory before it.

use super::{Plan, RenderFlags};
use crate::exit::Exit;
use crate::failure::Failure;
use crate::format::{JSON_VERSION, bytes, count, plural};
use crate::memory::{Memory, picture};
use crate::output_format::Format;
use crate::progress::{Style, emit};
use crate::settings::{Settings, list, sampling_words};
use crate::stdout::print;
use canaletto::Named;
use canaletto::memory;
use canaletto::render::Job;
use canaletto::scene::Transfer;
use canaletto::world::WorldStats;
use serde_json::json;

/// Checks before rendering that memory suffices for a picture with its layers and samples, and for denoising it.
pub(super) fn room(job: &Job, format: Format, denoises: bool) -> Result<(), Failure> {
    let [_, _, width, height] = job.window();
    let size = picture(job, format, denoises);
    if memory::room(size).is_ok() {
        return Ok(());
    }
    let (layers, size) = (plural(job.aovs.len() as u64, "layer"), bytes(size));
    let message = format!("there is no memory for {width} x {height} pixels with {layers}: it takes {size}");
    Err(Failure::new(Exit::Failed, message).help("render it in parts with --crop, or with fewer layers"))
}

/// Prints what would be rendered.
pub(super) fn dry_run(
    flags: &RenderFlags,
    plan: &Plan,
    settings: &Settings,
    stats: &WorldStats,
    memory: Memory,
    files: usize,
) -> Result<Exit, Failure> {
    let job = &settings.job;
    let [_, _, width, height] = job.window();
    let first = plan.files(plan.frames.first);
    if plan.style == Style::Json {
        emit(&json!({
            "event": "plan", "version": JSON_VERSION, "scene": flags.source.scene, "camera": settings.camera, "size": [width, height],
            "frames": [plan.frames.first, plan.frames.last], "files": first, "census": stats,
            "memory": memory,
        }));
        return Ok(Exit::Done);
    }
    let light = match job.description().whitted() {
        Some(settings) => {
            let shadows = if settings.shadows { "shadows" } else { "no shadows" };
            format!("stage {}, depth {}, {shadows}", settings.stage.name(), settings.max_depth)
        }
        None => {
            let settings = job.description().settings().into_iter().map(|(word, value)| format!("{word} {value}"));
            format!("{}, {}", job.integrator.name(), settings.collect::<Vec<_>>().join(", "))
        }
    };
    let format = plan.output.format;
    let kind = match format.capabilities() {
        None => format!("{format}, {} frames a second", plan.rate.fps()),
        Some(can) if can.linear => format!("{format}, linear"),
        Some(can) => {
            let bits = plan.output.settings.bits.or(can.bits.first().copied()).unwrap_or_default();
            let curve = if job.film.transfer == Transfer::Srgb { "sRGB" } else { "no transfer curve" };
            format!("{format}, {bits} bits, {curve}")
        }
    };
    let names: Vec<String> = first.iter().map(|file| file.display().to_string()).collect();
    let names = list(&names.iter().map(String::as_str).collect::<Vec<_>>()).replace('"', "");
    let frames = match plan.frames.count() {
        1 if !plan.numbered => String::new(),
        n => format!("; {}: {}", plural(n, "frame"), plan.frames),
    };
    print(&format!(
        "scene     {}, {}\ncamera    {}, {width} x {height} pixels\nsampling  {}\nlight     {light}\n\
         world     {}, {}, {}\nmemory    {}\noutput    {names} \
         ({kind}){frames}\nnothing is rendered or written (--dry-run)\n",
        flags.source.scene.display(),
        plural(files as u64, "file"),
        settings.camera,
        sampling_words(&job.film),
        plural(stats.primitives, "primitive"),
        match stats.light_points {
            1 => "1 point of light".to_owned(),
            n => format!("{} points of light", count(n)),
        },
        bytes(stats.bytes),
        memory.words(),
    ))?;
    Ok(Exit::Done)
}
