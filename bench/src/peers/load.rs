//! Measures the loading of a mesh of ten million triangles. Times are the seconds from the file to the model in memory,
//! compared with copying the file's bytes, and then to the world. The peak memory is measured, too.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use canaletto::scene::Scene;
use canaletto::world::World;
use canaletto_io::assets::{AssetPath, FolderAssets};
use canaletto_io::import::load_objects;
use serde_json::{Value, json};

use super::build::{resident, resident_peak};
use super::mesh::Mesh;
use super::stages::{Folder, write_ply};
use super::statistics::{Clock, Times};
use super::statue;
use crate::say;

/// Writes a mesh as OBJ text.
fn write_obj(mesh: &Mesh, path: &Path) -> std::io::Result<()> {
    let mut file = BufWriter::with_capacity(1 << 20, File::create(path)?);
    mesh.positions.iter().try_for_each(|p| writeln!(file, "v {} {} {}", p.x, p.y, p.z))?;
    mesh.triangles.iter().try_for_each(|[a, b, c]| writeln!(file, "f {} {} {}", a + 1, b + 1, c + 1))?;
    file.flush()
}

/// Measures, prints, and returns everything as JSON. The mesh has 400,000 × `fineness`² triangles.
pub fn run(fineness: u32, formats: &[String], threads: &[usize], rounds: usize, clock: Clock) -> Result<Value, String> {
    let folder = Folder::new()?;
    let mut files = Vec::new();
    let mesh = statue::serpent(fineness);
    let count = mesh.triangles.len();
    for format in formats {
        let path = folder.0.join(format!("mesh.{format}"));
        let written =
            if format == "ply" { write_ply(&mesh.positions, &mesh.triangles, &path) } else { write_obj(&mesh, &path) };
        written.map_err(|e| format!("{}: {e}", path.display()))?;
        files.push(path);
    }
    drop(mesh);
    say!("{count} triangles; {rounds} interleaved rounds, medians; peaks are the growth of the process, MiB");
    say!("copy: the file's bytes from memory to memory that is there already, on one thread\n");
    say!(
        "{:4} {:>2} {:>7} | {:>7} {:>7} {:>9} | {:>7} {:>7} {:>7} {:>7}",
        "file",
        "th",
        "MiB",
        "copy s",
        "load s",
        "copy/load",
        "peak",
        "world s",
        "kept",
        "peak"
    );
    let mebi = |bytes: usize| bytes as f64 / f64::from(1 << 20);
    let mut rows = Vec::new();
    for path in &files {
        for &threads in threads {
            let pool = super::trace::pool(threads)?;
            let (mut copies, mut loads, mut builds) = (Times::default(), Times::default(), Times::default());
            let (mut size, mut load_peak, mut kept, mut peak) = (0, 0, 0, 0);
            for round in 0..rounds {
                let bytes = std::fs::read(path).map_err(|e| e.to_string())?;
                let mut copy = bytes.clone();
                copies.0.push(clock.time(|| copy.copy_from_slice(&bytes)));
                size = bytes.len();
                drop((bytes, copy));
                let (assets, name) = FolderAssets::beside(path).map_err(|e| e.to_string())?;
                let before = resident();
                resident_peak(true);
                let mut model = None;
                loads.0.push(
                    clock.time(|| model = Some(pool.install(|| load_objects(&name, &assets, &AssetPath::base())))),
                );
                let (model, _) = model.ok_or("nothing loaded")?.map_err(|diagnostics| diagnostics.to_string())?;
                // Later rounds may reuse pages that the allocator kept.
                if round == 0 {
                    load_peak = resident_peak(false).saturating_sub(before);
                }
                let mut scene = Scene::default();
                scene.append(model);
                let mut world = None;
                builds.0.push(clock.time(|| world = Some(pool.install(|| World::build(scene)))));
                let world = world.ok_or("nothing built")?.map_err(|e| e.to_string())?;
                if round == 0 {
                    peak = resident_peak(false).saturating_sub(before);
                    kept = resident().saturating_sub(before);
                }
                drop(world);
            }
            let [copy, load, build] = [&copies, &loads, &builds].map(Times::median);
            let format = path.extension().unwrap_or_default().to_string_lossy();
            say!(
                "{format:4} {threads:2} {:7.1} | {copy:7.4} {load:7.4} {:9.3} | {:7.1} {build:7.3} {:7.1} {:7.1}",
                mebi(size),
                copy / load,
                mebi(load_peak),
                mebi(kept),
                mebi(peak)
            );
            rows.push(json!({ "format": format, "threads": threads, "bytes": size, "copy": copies.0, "load": loads.0,
                "world": builds.0, "load_peak": load_peak, "kept": kept, "peak": peak }));
        }
    }
    Ok(json!({ "what": "load", "triangles": count, "clock": format!("{clock:?}"), "rows": rows }))
}
