//! Whole scenes, written as files that Canaletto reads. The measurement thus covers the work of a user's command.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use canaletto::scene::Scene;
use canaletto_io::assets::FolderAssets;
use canaletto_io::{import, text};
use glam::Vec3;

use super::noise::uniform;
use super::statue;

/// A folder that is removed on drop.
pub(super) struct Folder(pub(super) PathBuf);

impl Folder {
    pub(super) fn new() -> Result<Self, String> {
        let folder = std::env::temp_dir().join(format!("canaletto-peers-{}", std::process::id()));
        std::fs::create_dir_all(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
        Ok(Self(folder))
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // `CANALETTO_KEEP` keeps the pictures for inspection.
        if std::env::var_os("CANALETTO_KEEP").is_none() {
            let _ = std::fs::remove_dir_all(&self.0);
        }
    }
}

/// A scene for pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Stage {
    /// SPD's balls, 7,381 spheres and a floor.
    Balls,
    /// The serpent of 400,000 triangles with a mirror and a glass ball.
    Serpent,
    /// A million spheres and a million cylinders.
    Shapes,
}

impl Stage {
    /// The name of the scene.
    pub fn name(self) -> &'static str {
        match self {
            Self::Balls => "balls",
            Self::Serpent => "serpent",
            Self::Shapes => "shapes",
        }
    }

    /// Writes the scene's files into a folder and returns the path of the one to render.
    pub fn file(self, folder: &Path) -> Result<PathBuf, String> {
        let path = folder.join(format!("{}.kdl", self.name()));
        let made = match self {
            Self::Balls => return Ok(Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/spd/balls.nff")),
            Self::Serpent => {
                let mesh = statue::serpent(1);
                write_ply(&mesh.positions, &mesh.triangles, &folder.join("serpent.ply"))
                    .and_then(|()| std::fs::write(&path, SERPENT))
            }
            Self::Shapes => write_shapes(folder).and_then(|()| std::fs::write(&path, SHAPES)),
        };
        made.map_err(|e| format!("{}: {e}", folder.display()))?;
        Ok(path)
    }
}

/// Reads the scene in a file.
pub fn load(path: &Path) -> Result<Scene, String> {
    let (assets, name) = FolderAssets::beside(path).map_err(|e| format!("{}: {e}", path.display()))?;
    let scene = if name.ends_with(".kdl") {
        text::read_scene(&name, &assets)
    } else {
        import::load(&name, &assets, &import::Staging::classic())
    };
    scene.map(|(scene, _)| scene).map_err(|diagnostics| diagnostics.to_string())
}

const SERPENT: &str = r#"
camera { eye 4.5 -5 5; center 0.4 -0.5 -0.7; up 0 0 1; fovy 46; near 1; far 100; size 1920 1080 }
background 0.3 0.4 0.6
ambient 0.15 0.15 0.15
integrator "whitted" { max-depth 5 }
material "jade" { kd 0.2 0.55 0.35; ks 0.4 0.4 0.4; n 40 }
material "silver" { kd 0.05 0.05 0.05; ks 0.8 0.8 0.8; n 200; k 0.85 }
material "glass" { kd 0.02 0.02 0.02; ks 0.8 0.8 0.8; n 200; k 0.1; eta 1.5; opacity 0.1 }
mesh file="serpent.ply" material="jade"
sphere material="silver" { center 3.1 -1.2 -0.9; radius 0.9 }
sphere material="glass" { center 1.6 -3.1 -0.6; radius 0.8 }
light "omni" { position -4 3 9; intensity 0.6 0.6 0.6 }
light "omni" { position 6 -6 7; intensity 0.4 0.4 0.4 }
"#;

const SHAPES: &str = r#"
camera { eye 70 -80 60; center 0 0 -4; up 0 0 1; fovy 40; near 1; far 1000; size 1920 1080 }
background 0.3 0.4 0.6
ambient 0.15 0.15 0.15
integrator "whitted" { max-depth 5 }
material "balls" { kd 0.7 0.3 0.2; ks 0.4 0.4 0.4; n 40 }
material "sticks" { kd 0.3 0.5 0.6 }
spheres file="spheres.bin" material="balls"
cylinders file="cylinders.bin" material="sticks"
light "omni" { position -40 30 90; intensity 0.8 0.8 0.8 }
"#;

/// The number of spheres, and that of cylinders.
pub(super) const COUNT: u64 = 1_000_000;

/// One of a million atoms: centre and radius.
pub(super) fn sphere(i: u64) -> (Vec3, f32) {
    let random = |k| uniform(21, 4 * i + k);
    let at = Vec3::new(random(0), random(1), random(2)) * 2.0 - Vec3::ONE;
    (at * Vec3::new(45.0, 45.0, 12.0), 0.12 + 0.2 * random(3) * random(3))
}

/// One of a million bonds: ends and radius.
pub(super) fn cylinder(i: u64) -> ([Vec3; 2], f32) {
    let random = |k| uniform(22, 8 * i + k);
    let (from, _) = sphere(i);
    let to = from + (Vec3::new(random(0), random(1), random(2)) * 2.0 - Vec3::ONE) * 1.2;
    ([from, to], 0.03 + 0.03 * random(3))
}

fn write_shapes(folder: &Path) -> std::io::Result<()> {
    let mut file = BufWriter::new(File::create(folder.join("spheres.bin"))?);
    for (center, radius) in (0..COUNT).map(sphere) {
        center.extend(radius).to_array().iter().try_for_each(|v| file.write_all(&v.to_le_bytes()))?;
    }
    file.flush()?;
    let mut file = BufWriter::new(File::create(folder.join("cylinders.bin"))?);
    for ([a, b], radius) in (0..COUNT).map(cylinder) {
        [a.x, a.y, a.z, b.x, b.y, b.z, radius].iter().try_for_each(|v| file.write_all(&v.to_le_bytes()))?;
    }
    file.flush()
}

/// Writes a mesh as a binary PLY.
pub(super) fn write_ply(positions: &[Vec3], triangles: &[[u32; 3]], path: &Path) -> std::io::Result<()> {
    let mut file = BufWriter::with_capacity(1 << 20, File::create(path)?);
    write!(
        file,
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
         element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        positions.len(),
        triangles.len()
    )?;
    for p in positions {
        p.to_array().iter().try_for_each(|v| file.write_all(&v.to_le_bytes()))?;
    }
    for triangle in triangles {
        file.write_all(&[3])?;
        triangle.iter().try_for_each(|v| file.write_all(&v.to_le_bytes()))?;
    }
    file.flush()
}
