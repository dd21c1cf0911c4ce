//! Measures a large image as a texture: memory and time of loading, and time of lookups with and without a mip pyramid.
//!
//! The image is generated (rings and noise, sRGB), encoded as a PNG in memory and read back as scene textures are.
//! Lookups have two orders. Random places have every texel far from the previous one; rows have neighbouring pixels.
//! Absolute times mean little on a shared machine. Ratios to bilinear lookups without a pyramid come from interleaved
//! measurements of one run.
//!
//! `cargo run --release -p canaletto-bench --bin texture [-- SIZE]`; the default SIZE is 16384. It takes about 3 bytes
//! for each texel, and half as many again while reading.

use canaletto::scene::Scene;
use canaletto::texture::{Filter, ImageTexture, Lookup, Prefilter, PreparedTexture, Texture, TextureKind};
use canaletto::world::World;
use canaletto_bench::{say, say_on};
use canaletto_io::assets::{AssetPath, Assets, MemoryAssets};
use canaletto_io::image::read_image;
use glam::DVec3;
use std::process::ExitCode;
use std::time::Instant;

/// The largest side of an image.
const MAX_SIZE: u32 = 1 << 16;

fn main() -> ExitCode {
    say::run(|| match std::env::args().nth(1).map(|text| text.parse()) {
        None => run(1 << 14),
        Some(Ok(size @ 1..=MAX_SIZE)) => run(size),
        Some(_) => Err(format!("SIZE is a number from 1 to {MAX_SIZE}")),
    })
}

fn run(size: u32) -> Result<(), String> {
    let whole = f64::from(size) * f64::from(size);
    say!("an image of {size} × {size} texels, RGB, 8 bits: {:.0} MB", 3.0 * whole / 1e6);

    let start = Instant::now();
    let bytes = pack(size).map_err(|e| e.to_string())?;
    say!("made and packed in {:.1} s: {:.0} MB", start.elapsed().as_secs_f64(), bytes.len() as f64 / 1e6);
    let assets = MemoryAssets::new().with("large.png", bytes);
    let asset = assets.read("large.png", &AssetPath::base()).map_err(|e| e.to_string())?;
    drop(assets);

    let before = memory();
    let start = Instant::now();
    let (image, _) = read_image(&asset).map_err(|e| e.to_string())?;
    let read = start.elapsed().as_secs_f64();
    drop(asset);
    let (after, peak) = (memory(), peak());
    say!("read in {read:.2} s; {}", told(before, after, peak));

    let texture = |filter, prefilter| {
        let kind = TextureKind::Image(ImageTexture { filter, prefilter, ..ImageTexture::new(0) });
        Texture { name: "large".into(), kind }
    };
    let kinds = [
        ("bilinear, no pyramid", Filter::Bilinear, Prefilter::None),
        ("bicubic, no pyramid", Filter::Bicubic, Prefilter::None),
        ("trilinear", Filter::Bilinear, Prefilter::Trilinear),
        ("EWA", Filter::Bilinear, Prefilter::Ewa),
    ];
    let textures = kinds.iter().map(|(_, filter, prefilter)| texture(*filter, *prefilter)).collect();
    let start = Instant::now();
    let scene = Scene { images: vec![image], textures, ..Scene::default() };
    let world = World::build(scene).map_err(|e| e.to_string())?;
    say!("tiles and pyramid in {:.2} s; {}", start.elapsed().as_secs_f64(), told(before, memory(), self::peak()));

    for (title, order) in [("places at random", random as fn(u32, f64) -> DVec3), ("neighbouring pixels", rows)] {
        say!("\n{title}: ns a lookup (ratio to bilinear without a pyramid)");
        for (footprint, spacing, slant) in
            [("a texel", 1.0, 1.0), ("4 texels", 4.0, 1.0), ("32 texels", 32.0, 1.0), ("4 × 32 texels", 4.0, 8.0)]
        {
            let times = measure(&world.textures, order, f64::from(size), spacing, slant);
            say_on!("  footprint {footprint:>14}:");
            for ((name, ..), time) in kinds.iter().zip(&times) {
                say_on!("  {name} {time:.0} ({:.2})", time / times[0]);
            }
            say!();
        }
    }
    Ok(())
}

/// The nanoseconds of a lookup in each texture: the minimum of several measurements.
fn measure(
    textures: &[PreparedTexture],
    order: fn(u32, f64) -> DVec3,
    size: f64,
    spacing: f64,
    slant: f64,
) -> Vec<f64> {
    const COUNT: u32 = 200_000;
    let mut best = vec![f64::INFINITY; textures.len()];
    // The differentials are rotated, so that ellipses lie across the tiles.
    let dx = DVec3::new(0.8, 0.6, 0.0) * spacing * slant / size;
    let dy = DVec3::new(-0.6, 0.8, 0.0) * spacing / size;
    let mut light = 0.0;
    for _ in 0..3 {
        for (pattern, best) in textures.iter().zip(&mut best) {
            let start = Instant::now();
            for i in 0..COUNT {
                let at = order(i, spacing * slant / size);
                light += pattern.eval(&Lookup { at, dx, dy })[0];
            }
            *best = best.min(start.elapsed().as_secs_f64() * 1e9 / f64::from(COUNT));
        }
    }
    std::hint::black_box(light);
    best
}

fn random(i: u32, _: f64) -> DVec3 {
    let hash = u64::from(i).wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let hash = (hash ^ hash >> 29).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let part = |shift: u32| (hash >> shift & 0xff_ffff) as f64 / 16_777_216.0;
    DVec3::new(part(0), part(32), 0.0)
}

fn rows(i: u32, step: f64) -> DVec3 {
    DVec3::new(0.1 + f64::from(i % 512) * step, 0.2 + f64::from(i / 512) * step, 0.0)
}

/// A PNG of this size, whose rows are generated during encoding.
fn pack(size: u32) -> Result<Vec<u8>, png::EncodingError> {
    let row = |y: u32, data: &mut [u8]| {
        for (x, texel) in (0..size).zip(data.chunks_exact_mut(3)) {
            let noise = (x ^ y.wrapping_mul(0x9e37)).wrapping_mul(0x85eb_ca6b) >> 29;
            let (u, v) = (i64::from(x) - i64::from(size / 2), i64::from(y) - i64::from(size / 3));
            let ring = ((u * u + v * v) / i64::from(size) / 4) as u8;
            texel.copy_from_slice(&[ring.wrapping_add(noise as u8), (x >> 6) as u8, (y >> 6) as u8]);
        }
    };
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, size, size);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::Fastest);
    let mut writer = encoder.write_header()?;
    let mut stream = writer.stream_writer()?;
    let mut data = vec![0; 3 * size as usize];
    for y in 0..size {
        row(y, &mut data);
        std::io::Write::write_all(&mut stream, &data)?;
    }
    stream.finish()?;
    writer.finish()?;
    Ok(bytes)
}

/// A value about this program's memory from the system, in bytes; `None` if `/proc` doesn't provide it.
fn status(key: &str) -> Option<f64> {
    let text = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = text.lines().find(|line| line.starts_with(key))?;
    Some(line.split_whitespace().nth(1)?.parse::<f64>().ok()? * 1024.0)
}

fn memory() -> Option<f64> {
    status("VmRSS:")
}

fn peak() -> Option<f64> {
    status("VmHWM:")
}

fn told(before: Option<f64>, after: Option<f64>, peak: Option<f64>) -> String {
    match (before, after, peak) {
        (Some(before), Some(after), Some(peak)) => {
            format!("memory from {:.0} to {:.0} MB, {:.0} MB at most", before / 1e6, after / 1e6, peak / 1e6)
        }
        _ => "memory isn't told by this system".into(),
    }
}
