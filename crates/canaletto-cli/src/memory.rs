//! The memory that a render takes, estimated before it begins.

use crate::denoiser::with_layers;
use crate::format::bytes;
use crate::output_format::Format;
use canaletto::film::block_count;
use canaletto::render::{Aov, Job, PreparationMemory, while_prepared};
use canaletto::world::World;
use serde::Serialize;

/// The memory of a render in bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct Memory {
    /// The memory of the process when the world is built.
    pub world: u64,
    /// What the integrator prepares: a z-buffer's triangles and shadow maps, what path guiding learns from, the patches
    /// and links of radiosity.
    pub preparation: u64,
    /// Whether the preparation may take less, since its size isn't known beforehand.
    pub preparation_at_most: bool,
    /// The picture with its layers, as rendered and as encoded, and the working memory.
    pub picture: u64,
    /// The maximum at any time: while the world is read and built, while the integrator is prepared, or with the
    /// picture. A preparation whose size isn't known doesn't count.
    pub peak: u64,
}

impl Memory {
    /// The memory of a render of a world that was just built. The system reports the current and the maximum memory of
    /// the process. Without such a report the size of the world's lists is used.
    pub(crate) fn of(world: &World, job: Option<&Job>, format: Format, denoises: bool) -> Memory {
        let usage = || {
            usage().unwrap_or_else(|| {
                let bytes = world.stats().bytes;
                (bytes, bytes)
            })
        };
        /// The memory of tiles, threads and the rest of the program.
        const WORK: u64 = 5 << 20;
        let picture = job.map_or(0, |job| picture(job, format, denoises)) + WORK;
        let (now, _) = usage();
        let prepared = |passing: PreparationMemory| {
            let (held, peak) = usage();
            let known = if passing.at_most { 0 } else { passing.bytes };
            Memory {
                world: now,
                preparation: held.saturating_sub(now) + passing.bytes,
                preparation_at_most: passing.at_most,
                picture,
                // The allocator keeps most of what a preparation gives back.
                peak: peak.max(held + picture + known),
            }
        };
        let of_job = job.and_then(|job| while_prepared(world, job, prepared).ok());
        of_job.unwrap_or_else(|| prepared(PreparationMemory::default()))
    }

    /// The memory in words.
    pub(crate) fn words(&self) -> String {
        let [peak, world, preparation, picture] = [self.peak, self.world, self.preparation, self.picture].map(bytes);
        match self.preparation {
            // A few pages that the measurement itself takes.
            0..1_000_000 => format!("about {peak}: {world} with the world, {picture} for the picture"),
            _ if self.preparation_at_most => format!(
                "about {peak}: {world} with the world, {picture} for the picture; at most {preparation} more to prepare it"
            ),
            _ => format!("about {peak}: {world} with the world, {preparation} to prepare, {picture} for the picture"),
        }
    }
}

/// The memory of a picture in bytes: its channels, its samples, what denoising takes, and the encoded form.
pub(crate) fn picture(job: &Job, format: Format, denoises: bool) -> u64 {
    /// What denoising takes for each pixel besides the picture with its layers, as measured.
    const DENOISING: u64 = 80;
    let [_, _, width, height] = job.window();
    let pixels = u64::from(width) * u64::from(height);
    let kept = if denoises { with_layers(job) } else { job.clone() };
    let samples = samples(&kept);
    // The samples are freed or written before a picture is encoded; both together are the most.
    let blocks = if format.has_layers() && samples.blocks > 1 { 3 * samples.blocks } else { 0 };
    let alpha = if job.film.alpha { alpha(&kept) } else { 0 };
    let made = channels(&kept.aovs, Format::default()) + samples.bytes + if denoises { DENOISING } else { 0 };
    let written = channels(&job.aovs, format) + samples.bytes + blocks * 3 * NUMBER;
    pixels.saturating_mul(made.max(written) + alpha)
}

/// What alpha takes for each pixel: the channel, its encoded form, and the sums of its samples. Without passes these
/// are a layer.
fn alpha(job: &Job) -> u64 {
    let sums = if job.passes().is_ok() { size_of::<(f64, u32)>() as u64 } else { NUMBER };
    2 * NUMBER + sums
}

/// The bytes of a number in a channel.
const NUMBER: u64 = size_of::<f32>() as u64;

/// What the samples of a picture in passes take.
struct SampleMemory {
    /// The most blocks of a pixel at the end.
    blocks: u64,
    /// The bytes for each pixel: the samples of the tiles, those of the whole picture that are gathered from them, and
    /// the memory from which the former grew.
    bytes: u64,
}

fn samples(job: &Job) -> SampleMemory {
    if job.passes().is_err() {
        return SampleMemory { blocks: 0, bytes: 0 };
    }
    let (first, count) = (job.first_sample, job.film.sampling.count());
    let keeps_halves = job.noise.is_some() || job.aovs.iter().any(|aov| aov.is_half());
    let block = if keeps_halves { 9 * NUMBER } else { 3 * NUMBER };
    let blocks = block_count(first, first.saturating_add(count)) as u64;
    // Passes from 16 samples on add a quarter of the highest digit, which makes up to three blocks.
    let most = blocks.max(match count {
        0..=2 => 1,
        3..=23 => 2,
        _ => 3,
    });
    let grown = if most > 1 { block } else { 0 };
    SampleMemory { blocks, bytes: 2 * NUMBER + block * (most + blocks) + grown }
}

/// The channels of a pixel, and their encoded form.
fn channels(aovs: &[Aov], format: Format) -> u64 {
    let layers: Vec<u64> = aovs.iter().map(|aov| aov.channels().len() as u64).collect();
    let channels = 3 + layers.iter().sum::<u64>();
    let written = if format.has_layers() {
        // All channels in the file's order, and their compressed bytes.
        2 * channels * NUMBER
    } else {
        // Files are written one after the other: bytes in bands, and a copy of one layer.
        layers.iter().max().map_or(1, |largest| largest * NUMBER)
    };
    channels * NUMBER + written
}

/// The current and the maximum memory of the process in bytes; `None` if the system doesn't report it.
#[cfg(target_os = "linux")]
fn usage() -> Option<(u64, u64)> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let bytes = |name: &str| {
        let line = status.lines().find_map(|line| line.strip_prefix(name))?;
        line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok().map(|kilobytes| kilobytes * 1024)
    };
    Some((bytes("VmRSS:")?, bytes("VmHWM:")?))
}

#[cfg(not(target_os = "linux"))]
fn usage() -> Option<(u64, u64)> {
    None
}
