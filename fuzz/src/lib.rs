//! What the fuzz targets do with their bytes. A reader may refuse them, but it may not panic, hang or fill the memory.
//! What it returns has to be usable.

use canaletto::integrator::radiosity::RadiositySolution;
use canaletto_io::assets::{Asset, AssetPath, MemoryAssets};
use canaletto_io::image::read_image;
use canaletto_io::import::{CloudFormat, Staging, load, read_cylinders, read_spheres};
use canaletto_io::picture::{PictureFormat, decode};
use canaletto_io::source::SceneSource;
use canaletto_io::text::{SceneDocument, read_scene_text};

/// Reads a scene text, at a whole and at a fractional frame.
pub fn scene_text(data: &[u8]) {
    let (Ok(text), assets) = (std::str::from_utf8(data), MemoryAssets::new()) else { return };
    let Ok(mut document) = SceneDocument::of_text(text, "a.kdl", &assets, &[]) else { return };
    for frame in [0.0, 5.5] {
        // Messages point into the text.
        let _ = document.scene(&assets, frame).map_err(|errors| errors.to_string());
    }
}

/// Reads a model of this name as a scene.
pub fn model(name: &str, data: &[u8]) {
    whole(name, &MemoryAssets::new().with(name, data));
}

/// Reads a file of materials, which an OBJ names.
pub fn materials(data: &[u8]) {
    const OBJ: &str = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nusemtl m\nf 1 2 3\n";
    whole("a.obj", &MemoryAssets::new().with("a.obj", OBJ).with("a.mtl", data));
}

fn whole(name: &str, assets: &MemoryAssets) {
    match load(name, assets, &Staging::default()) {
        Ok((scene, _)) => scene.meshes.iter().for_each(|mesh| mesh.check().expect("a mesh that can be used")),
        Err(errors) => drop(errors.to_string()),
    }
}

/// Reads a light's profile, which a scene text names.
pub fn profile(data: &[u8]) {
    let text = "light \"omni\" { position 0 1 0; ies \"a.ies\" }";
    let _ = read_scene_text(text, "a.kdl", &MemoryAssets::new().with("a.ies", data), &[]);
}

/// Reads a table as spheres and as cylinders, with and without a radius.
pub fn cloud(format: CloudFormat, data: &[u8]) {
    let asset = asset(data);
    for radius in [None, Some(0.5)] {
        if let Ok((cloud, _)) = read_spheres(&asset, format, radius) {
            cloud.check().expect("spheres that can be used");
        }
        if let Ok((cloud, _)) = read_cylinders(&asset, format, radius) {
            cloud.check().expect("cylinders that can be used");
        }
    }
}

/// Reads a file of this format as a texture and as a picture. Other bytes are left to the targets of other formats.
pub fn picture(format: PictureFormat, data: &[u8]) {
    if PictureFormat::of_bytes(data) == Some(format) {
        let _ = decode(data);
        if let Ok((image, _)) = read_image(&asset(data)) {
            image.check().expect("an image that can be used");
        }
    }
}

/// Reads a solution of radiosity.
pub fn solution(data: &[u8]) {
    let _ = RadiositySolution::read(data, data.len() as u64);
}

fn asset(data: &[u8]) -> Asset {
    Asset { path: AssetPath::new("a", "a", "a"), bytes: data.to_vec() }
}
