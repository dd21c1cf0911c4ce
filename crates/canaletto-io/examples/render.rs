//! From a scene file to a picture: `cargo run --release -p canaletto-io --example render -- scene.kdl picture.png`.

use canaletto::camera::Camera;
use canaletto::film::develop;
use canaletto::render::{Job, render};
use canaletto::world::World;
use canaletto_io::assets::FolderAssets;
use canaletto_io::picture::{EncodeSettings, Image, PictureFormat, WriteOptions, write_atomically};
use canaletto_io::text::read_scene;
use std::path::Path;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let [scene, picture] = std::env::args().skip(1).collect::<Vec<_>>().try_into().map_err(|_| "SCENE PICTURE")?;
    let (assets, name) = FolderAssets::beside(Path::new(&scene))?;
    let (scene, warnings) = read_scene(&name, &assets)?;
    eprint!("{warnings}");
    let view = scene.views.first().ok_or("the scene has no camera")?;
    let job = Job::new(Camera::of(view)?, scene.film, scene.integrator);
    let rendered = render(&World::build(scene)?, &job, &())?.picture;
    let pixels = develop(&rendered, &job.developing());
    let image = Image::from_rgb(rendered.width, rendered.height, pixels.iter().map(|c| c.to_array()));
    let png = PictureFormat::Png.encode_image(&image, job.film.transfer, &EncodeSettings::default(), &[])?;
    write_atomically(Path::new(&picture), WriteOptions::default(), |file| file.write_all(&png))?;
    Ok(())
}
