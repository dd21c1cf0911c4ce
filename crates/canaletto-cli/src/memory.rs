//! The memory that a render takes, estimated before it begins.

use crate::output_format::Format;
use canaletto::render::Aov;
use canaletto::world::World;
use serde::Serialize;

/// The memory of a render in bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct Memory {
    /// The memory of the process when the world is built.
    pub world: u64,
    /// The picture with its layers, as rendered and as encoded, and the working memory.
    pub picture: u64,
    /// The maximum at any time: while the world is read and built, or with the picture.
    pub peak: u64,
}

impl Memory {
    /// The memory of a render of this many pixels of a world that was just built. The system reports the current and
    /// the maximum memory of the process. Without such a report the size of the world's lists is used.
    pub(crate) fn of(world: &World, pixels: u64, aovs: &[Aov], format: Format) -> Memory {
        let (now, peak) = usage().unwrap_or_else(|| {
            let bytes = world.stats().bytes;
            (bytes, bytes)
        });
        /// The memory of tiles, threads and the rest of the program.
        const WORK: u64 = 5 << 20;
        let picture = picture(pixels, aovs, format) + WORK;
        Memory { world: now, picture, peak: peak.max(now + picture) }
    }
}

/// The memory of a picture: its channels, and their encoded form.
fn picture(pixels: u64, aovs: &[Aov], format: Format) -> u64 {
    const NUMBER: u64 = size_of::<f32>() as u64;
    let layers: Vec<u64> = aovs.iter().map(|aov| aov.channels().len() as u64).collect();
    let channels = 3 + layers.iter().sum::<u64>();
    let written = if format.has_layers() {
        // All channels in the file's order, and their compressed bytes.
        2 * channels * NUMBER
    } else {
        // Files are written one after the other: bytes in bands, and a copy of one layer.
        layers.iter().max().map_or(1, |largest| largest * NUMBER)
    };
    pixels.saturating_mul(channels * NUMBER + written)
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
