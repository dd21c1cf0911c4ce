//! A scene made by a program: two strands of exact spheres joined by cylinders.
//!
//! `cargo run --release -p canaletto-io --example helix` writes `helix.png`.

use canaletto::camera::Camera;
use canaletto::film::develop;
use canaletto::light::{DiskLight, Light, LightKind};
use canaletto::material::{Material, Phong};
use canaletto::math::Rgb;
use canaletto::render::{Job, render};
use canaletto::scene::{
    Content, Extrinsics, FilmSettings, Intrinsics, Node, Sampling, Scene, Transfer, WhittedSettings,
};
use canaletto::shape::{CylinderCloud, Disk, Plane, Shape, SphereCloud};
use canaletto::world::World;
use canaletto_io::picture::{EncodeSettings, Image, PictureFormat, WriteOptions, write_atomically};
use glam::{DVec3, Vec3};
use std::error::Error;
use std::path::Path;

fn main() -> Result<(), Box<dyn Error>> {
    let steps = 60;
    let place = |i: u32, strand: f32| {
        let angle = i as f32 * 0.35 + strand * std::f32::consts::PI;
        Vec3::new(angle.cos(), i as f32 * 0.12 - 3.5, angle.sin())
    };
    let strand = |strand: f32| (0..steps).map(move |i| place(i, strand));
    let beads = SphereCloud {
        name: "beads".into(),
        centers: strand(0.0).chain(strand(1.0)).collect(),
        radii: vec![0.16],
        colors: (0..2 * steps)
            .map(|i| if i < steps { Rgb::new(0.8, 0.25, 0.1) } else { Rgb::new(0.1, 0.35, 0.8) })
            .collect(),
        ..SphereCloud::default()
    };
    let rungs = CylinderCloud {
        name: "rungs".into(),
        axes: (0..steps).step_by(2).map(|i| [place(i, 0.0), place(i, 1.0)]).collect(),
        radii: vec![0.05],
        ..CylinderCloud::default()
    };
    let glossy = Phong { kd: Rgb::gray(0.75), ks: Rgb::gray(0.4), n: 60.0, ..Phong::default() };
    let lamp =
        DiskLight { disk: Disk { center: Vec3::new(5.0, 8.0, 6.0), normal: Vec3::NEG_Y, radius: 1.5 }, points: 16 };
    let scene = Scene {
        background: Rgb::gray(0.9),
        ambient: Rgb::gray(0.25),
        materials: vec![Material::new("glossy", glossy)],
        nodes: vec![
            Node::new(Content::Spheres(0)).with_material(0),
            Node::new(Content::Cylinders(0)).with_material(0),
            Node::from(Shape::Plane(Plane { point: Vec3::new(0.0, -3.8, 0.0), normal: Vec3::Y })),
            Node::from(Light::new(LightKind::Disk(lamp), Rgb::gray(0.7))),
        ],
        spheres: vec![beads],
        cylinders: vec![rungs],
        ..Scene::default()
    };
    let intrinsics = Intrinsics { fovy: 40.0, width: 400, height: 600, ..Intrinsics::default() };
    let extrinsics = Extrinsics { eye: DVec3::new(0.0, 2.0, 12.0), ..Extrinsics::default() };
    let film = FilmSettings { sampling: Sampling::Adaptive { n: 3, threshold: 0.08 }, ..FilmSettings::default() };
    let job = Job::new(Camera::new(&intrinsics, &extrinsics)?, film, WhittedSettings::default());

    let picture = render(&World::build(scene)?, &job, &())?.picture;
    let shown = develop(&picture, &job.developing());
    let image = Image::from_rgb(picture.width, picture.height, shown.iter().map(|c| c.to_array()));
    let png = PictureFormat::Png.encode_image(&image, Transfer::Srgb, &EncodeSettings::default(), &[])?;
    write_atomically(Path::new("helix.png"), WriteOptions::default(), |file| file.write_all(&png))?;
    Ok(())
}
