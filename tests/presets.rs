//! The book's table of presets: a picture and the numbers of each. `CANALETTO_BLESS=1` writes it again.

use canaletto::Named;
use canaletto::camera::Camera;
use canaletto::film::develop;
use canaletto::integrator::describe;
use canaletto::material::{PRESETS, Preset, StandardBlock, StandardParameter, StandardSurface};
use canaletto::render::{Job, render};
use canaletto::scene::Sampling;
use canaletto::world::World;
use canaletto_io::assets::FolderAssets;
use canaletto_io::picture::{EncodeSettings, Image, PictureFormat, decode};
use canaletto_io::text::read_scene;
use canaletto_tests::root;
use std::fmt::Write;

/// The comment before the table in the page.
const BEGIN: &str =
    "<!-- The table of presets, written by CANALETTO_BLESS=1 cargo test -p canaletto-tests presets:: -->\n";

fn bless() -> bool {
    std::env::var_os("CANALETTO_BLESS").is_some()
}

/// The parameters of a preset that differ from their defaults.
fn numbers(preset: &Preset) -> String {
    let (surface, usual) = (preset.surface(), StandardSurface::default());
    let mut blocks = Vec::new();
    for block in StandardBlock::ALL {
        let rows = StandardParameter::ALL.iter().filter(|row| row.block == *block);
        let set: Vec<String> = rows
            .filter(|row| row.get(&surface) != row.get(&usual))
            .map(|row| {
                let values: Vec<String> =
                    row.get(&surface).iter().map(|v| (v * 1000.0).round() / 1000.0).map(|v| v.to_string()).collect();
                format!("{} {}", row.name, values.join(" "))
            })
            .collect();
        if !set.is_empty() {
            blocks.push(format!("{} {{ {} }}", block.name(), set.join("; ")));
        }
    }
    if surface.thin_walled {
        blocks.push("thin-walled".into());
    }
    if blocks.is_empty() { "none".into() } else { format!("`{}`", blocks.join("; ")) }
}

fn table() -> String {
    let mut table = String::from(BEGIN);
    table.push_str("\n| | preset | numbers that differ from the defaults |\n|---|---|---|\n");
    for preset in &PRESETS {
        let name = preset.name;
        writeln!(
            table,
            "| <img src=\"pictures/presets/{name}.png\" alt=\"{name}\" width=\"160\"> | `{name}` | {} |",
            numbers(preset)
        )
        .unwrap();
    }
    table
}

#[test]
fn the_books_table_is_that_of_the_presets() {
    let path = root().join("docs/materials.md");
    let page = std::fs::read_to_string(&path).unwrap();
    let start = page.find(BEGIN).expect("the table has its comment");
    let written = format!("{}{}", &page[..start], table());
    if bless() {
        std::fs::write(&path, &written).unwrap();
    }
    assert!(bless() || page == written, "docs/materials.md is old; CANALETTO_BLESS=1 writes it anew");
}

/// The means of blocks of 8 × 8 pixels and their channels, which differ little by other random numbers.
fn means(image: &Image) -> Vec<f32> {
    let (rgb, blocks) = (image.rgb().expect("the picture has colours"), image.width / 8);
    let mut means = Vec::new();
    for block in 0..blocks * (image.height / 8) {
        let (left, top) = (block % blocks * 8, block / blocks * 8);
        for channel in &rgb {
            let pixel = |i: u32| channel[((top + i / 8) * image.width + left + i % 8) as usize];
            means.push((0..64).map(pixel).sum::<f32>() / 64.0);
        }
    }
    means
}

/// The preset as its picture shows it. Colours of clear bodies are given for a depth. The ball is that wide,
/// so that all of them are as clear as they are meant.
fn shown(preset: &Preset) -> StandardSurface {
    let mut surface = preset.surface();
    if surface.transmission.depth > 0.0 {
        surface.transmission.depth = 2.0;
    }
    surface
}

/// A few of the pictures are rendered again, with fewer samples.
#[test]
fn the_pictures_of_presets_are_what_paths_see() {
    let assets = FolderAssets::new(root().join("scenes")).unwrap();
    let (mut scene, _) = read_scene("preset.kdl", &assets).unwrap();
    let ball = scene.materials.iter().position(|material| material.name == "ball").unwrap();
    let some = ["carpaint", "gold", "soapbubble"];
    for preset in PRESETS.iter().filter(|preset| bless() || some.contains(&preset.name)) {
        let surface = shown(preset);
        scene.film.sampling = Sampling::Sampled(match (bless(), surface.transmission.weight > 0.0) {
            (false, _) => 16,
            // Light that lamps send through clear bodies is the noisiest.
            (true, true) => 512,
            (true, false) => 256,
        });
        scene.materials[ball].set_standard(surface);
        let camera = Camera::of(&scene.views[0]).unwrap();
        let job = Job::new(camera, scene.film, scene.integrator);
        let picture = render(&World::build(scene.clone()).unwrap(), &job, &()).unwrap().picture;
        let developed = develop(&picture, &scene.film.developing(describe(&scene.integrator).is_photographic()));
        let image = Image::from_rgb(picture.width, picture.height, developed.iter().map(|c| c.to_array()));
        let bytes =
            PictureFormat::Png.encode_image(&image, scene.film.transfer, &EncodeSettings::default(), &[]).unwrap();
        let path = root().join(format!("docs/pictures/presets/{}.png", preset.name));
        if bless() {
            std::fs::write(&path, &bytes).unwrap();
            continue;
        }
        let [kept, ours] = [std::fs::read(&path).unwrap(), bytes].map(|bytes| means(&decode(&bytes).unwrap().image));
        for (block, (kept, ours)) in kept.iter().zip(&ours).enumerate() {
            assert!((kept - ours).abs() < 0.06, "{}, block {block}: {ours}, not {kept}", preset.name);
        }
    }
}
