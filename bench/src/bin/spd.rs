//! Compares ray counts on Eric Haines' Standard Procedural Databases with the published ones, at 513 × 513.
//!
//! At total reflection this program traces the reflected ray (factor k) and the ray inside (1 − o) separately. This is
//! probably why gears has more reflected rays than published.
//!
//! The rules are those of the databases' Readme. There is one ray for each corner of 512 × 512 pixels, and trees are 5
//! deep. Transmitters spawn reflected rays as well, with any specular coefficient.
//!
//! `cargo run --release -p canaletto-bench --bin spd [DIR…]` reads the seven files from `scenes/spd` and from the
//! folders named.

use canaletto::camera::{Camera, CameraError};
use canaletto::integrator::RayCounts;
use canaletto::integrator::describe;
use canaletto::math::Rgb;
use canaletto::render::{Job, render};
use canaletto::scene::{FilmSettings, Intrinsics, Sampling, View, WhittedSettings};
use canaletto::world::World;
use canaletto_bench::say;
use canaletto_io::assets::FolderAssets;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// The statistics that come with the databases: eye rays that hit, reflected, refracted and shadow rays.
const PUBLISHED: [(&str, [u64; 4]); 7] = [
    ("balls", [263_169, 175_095, 0, 954_368]),
    ("gears", [245_086, 304_643, 207_564, 2_246_955]),
    ("mount", [173_125, 354_769, 354_769, 412_922]),
    ("rings", [263_169, 315_236, 0, 1_085_002]),
    ("teapot", [161_120, 225_248, 0, 407_656]),
    ("tetra", [49_788, 0, 0, 46_112]),
    ("tree", [169_836, 0, 0, 1_097_419]),
];

fn main() -> ExitCode {
    say::run(run)
}

fn run() -> Result<(), String> {
    let own = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/spd");
    let folders: Vec<PathBuf> = std::iter::once(own).chain(std::env::args_os().skip(1).map(PathBuf::from)).collect();
    say!("ours / published (difference)");
    say!("{:7} {:>26} {:>26} {:>26} {:>28}", "", "eye rays that hit", "reflected", "refracted", "shadow");
    let mut failed = Vec::new();
    for (name, published) in PUBLISHED {
        let file = format!("{name}.nff");
        let Some(path) = folders.iter().map(|folder| folder.join(&file)).find(|path| path.is_file()) else {
            say!("{name:8} {file} is in none of the folders; see scenes/spd/README.md");
            continue;
        };
        match count(&path) {
            Ok(counts) => {
                let ours = [counts.eye.hit, counts.reflected.traced, counts.refracted.traced, counts.shadow.traced];
                let [eye, reflected, refracted, shadow] = [0, 1, 2, 3].map(|i| beside(ours[i], published[i]));
                say!("{name:7} {eye:>26} {reflected:>26} {refracted:>26} {shadow:>28}");
            }
            Err(message) => {
                say!("{name:8} {message}");
                failed.push(name);
            }
        }
    }
    if failed.is_empty() { Ok(()) } else { Err(format!("not rendered: {}", failed.join(", "))) }
}

/// Formats both numbers, and their difference in per cent unless the published one is 0.
fn beside(ours: u64, published: u64) -> String {
    match published {
        0 => format!("{ours} / 0"),
        _ => format!("{ours} / {published} ({:+.1} %)", 100.0 * (ours as f64 / published as f64 - 1.0)),
    }
}

fn count(path: &Path) -> Result<RayCounts, String> {
    let (assets, name) = FolderAssets::beside(path).map_err(|e| e.to_string())?;
    let (mut scene, _) = canaletto_io::import::load(&name, &assets, &canaletto_io::import::Staging::classic())
        .map_err(|diagnostics| diagnostics.to_string())?;
    for material in &mut scene.materials {
        if let Some(phong) = material.model.phong_mut().filter(|phong| phong.opacity < 1.0 && phong.k.is_black()) {
            phong.k = Rgb::gray(f32::MIN_POSITIVE);
        }
    }
    let camera = corners_of_512(&scene.views[0]).map_err(|e| e.to_string())?;
    let film = FilmSettings { sampling: Sampling::Corner, ..scene.film };
    let job = Job::new(
        camera,
        film,
        WhittedSettings {
            max_depth: 5,
            ..*describe(&scene.integrator).whitted().unwrap_or(&WhittedSettings::default())
        },
    );
    let world = World::build(scene).map_err(|e| e.to_string())?;
    Ok(render(&world, &job, &()).map_err(|e| e.to_string())?.counts.rays)
}

/// The camera at 513 × 513 whose pixel corners are those of the 512 × 512 pixels of the view. The window grows by one
/// pixel and moves by half a pixel.
fn corners_of_512(view: &View) -> Result<Camera, CameraError> {
    let grown = 513.0 / 512.0;
    let half = view.intrinsics.fovy.to_radians() / 2.0;
    let fovy = (half.tan() * grown).atan().to_degrees() * 2.0;
    let shift = [0.5 / 513.0; 2];
    Camera::new(&Intrinsics { width: 513, height: 513, fovy, shift, ..view.intrinsics }, &view.extrinsics)
}
