//! What a render takes in memory: told before it begins.

use crate::output::Format;
use canaletto::render::Aov;
use canaletto::world::World;
use serde::Serialize;

/// Bytes that a render takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct Memory {
    /// What the process holds once the world is built.
    pub world: u64,
    /// The picture with its layers, rendered and put into its file, and the work on it.
    pub picture: u64,
    /// The most at any time: while the world is read and built, or with the picture.
    pub peak: u64,
}

impl Memory {
    /// What it takes to render a picture of so many pixels of a world that was just built. Of the world it is what the system says that the
    /// process holds, and the most that it held while reading and building; where it doesn't say, what the world's lists take.
    pub(crate) fn of(world: &World, pixels: u64, aovs: &[Aov], format: Format) -> Memory {
        let (now, peak) = usage().unwrap_or_else(|| {
            let bytes = world.stats().bytes;
            (bytes, bytes)
        });
        /// What tiles, threads and the rest of the program take.
        const WORK: u64 = 5 << 20;
        let picture = picture(pixels, aovs, format) + WORK;
        Memory { world: now, picture, peak: peak.max(now + picture) }
    }
}

/// What a picture takes: its channels, and what they are put into on their way to the file.
fn picture(pixels: u64, aovs: &[Aov], format: Format) -> u64 {
    const NUMBER: u64 = size_of::<f32>() as u64;
    let layers: Vec<u64> = aovs.iter().map(|aov| aov.channels().len() as u64).collect();
    let channels = 3 + layers.iter().sum::<u64>();
    let written = match format {
        // All channels in the order of the file, and compressed.
        Format::Exr => 2 * channels * NUMBER,
        // One file after the other: bytes in bands, and a copy of a layer.
        _ => layers.iter().max().map_or(1, |largest| largest * NUMBER),
    };
    pixels.saturating_mul(channels * NUMBER + written)
}

/// What the process has in memory, and the most that it had. Nothing where the system doesn't tell.
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
