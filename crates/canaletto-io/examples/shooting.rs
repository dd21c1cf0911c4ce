//! Radiosity by shooting, watched: `cargo run --release -p canaletto-io --example shooting SCENE`. Pictures after steps
//! 1, 2, 4, 8 and so on are written to `step.N.png`. The light that isn't sent yet is spread as ambient light.

use canaletto::camera::Camera;
use canaletto::film::develop;
use canaletto::integrator::radiosity::{RadiositySolution, ShootingStep, ShootingWatcher};
use canaletto::render::{Job, render_with_solution};
use canaletto::scene::{RadiosityMethod, RadiositySettings, RadiosityShow};
use canaletto::world::World;
use canaletto_io::assets::FolderAssets;
use canaletto_io::picture::{EncodeSettings, Image, PictureFormat, WriteOptions, write_atomically};
use canaletto_io::text::read_scene;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Renders the light of some steps.
struct Pictures<'a> {
    world: &'a World,
    job: Job,
    failure: Option<Box<dyn Error + Send + Sync>>,
}

impl Pictures<'_> {
    fn write(&self, step: &ShootingStep) -> Result<(), Box<dyn Error + Send + Sync>> {
        let rendered = render_with_solution(self.world, &self.job, &Arc::new(step.solution()), &())?.picture;
        let pixels = develop(&rendered, &self.job.developing());
        let image = Image::from_rgb(rendered.width, rendered.height, pixels.iter().map(|c| c.to_array()));
        let png = PictureFormat::Png.encode_image(&image, self.job.film.transfer, &EncodeSettings::default(), &[])?;
        let file = PathBuf::from(format!("step.{}.png", step.step));
        write_atomically(&file, WriteOptions::default(), |file| file.write_all(&png))?;
        eprintln!("{}: {:.1}% of the light is unsent", file.display(), step.unsent * 100.0);
        Ok(())
    }
}

impl ShootingWatcher for Pictures<'_> {
    fn watches(&self) -> bool {
        self.failure.is_none()
    }

    fn step(&mut self, step: &ShootingStep) {
        if step.step.is_power_of_two() {
            self.failure = self.write(step).err();
        }
    }
}

fn main() -> Result<(), Box<dyn Error + Send + Sync>> {
    let scene = std::env::args().nth(1).ok_or("SCENE")?;
    let (assets, name) = FolderAssets::beside(Path::new(&scene))?;
    let (scene, warnings) = read_scene(&name, &assets)?;
    eprint!("{warnings}");
    let view = scene.views.first().ok_or("the scene has no camera")?;
    let settings = RadiositySettings {
        method: RadiosityMethod::Shooting,
        error: 0.05,
        show: RadiosityShow::Solution,
        ..RadiositySettings::DEFAULT
    };
    let job = Job::new(Camera::of(view)?, scene.film, settings);
    let world = World::build(scene)?;
    let mut pictures = Pictures { world: &world, job, failure: None };
    RadiositySolution::solve_watched(&world, &settings, &(), &mut pictures)?;
    pictures.failure.map_or(Ok(()), Err)
}
