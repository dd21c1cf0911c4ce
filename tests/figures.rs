//! The chapter's figures. Each scene in `scenes/chapter` is compared with an independent reference. It is also compared
//! with the book's pictures, which people have checked (`CANALETTO_BLESS=1` replaces them).

use canaletto::camera::Camera;
use canaletto::explain::{TextStyle, explain};
use canaletto::film::develop;
use canaletto::integrator::describe;
use canaletto::render::{Job, Rendering, render};
use canaletto::scene::{Sampling, Scene};
use canaletto::world::World;
use canaletto_io::assets::FolderAssets;
use canaletto_io::picture::{EncodeSettings, Image, PictureFormat, decode};
use canaletto_io::text::read_scene;
use canaletto_tests::reference::Reference;
use canaletto_tests::{clamped, root};
use rayon::prelude::*;

/// The scenes of figures, and whether the reference supports their content: spheres, boxes and omni lights, one ray in
/// each pixel's corner.
const FIGURES: [(&str, bool); 26] = [
    ("fig-5.18-unlit", true),
    ("fig-5.21b-diffuse", true),
    ("fig-5.21c-ambient", true),
    ("fig-5.22c-specular", true),
    ("fig-5.23b-shadow", true),
    ("fig-5.24a-no-shadow", true),
    ("fig-5.24b-shadow", true),
    ("fig-5.24c-soft-shadow", false),
    ("fig-5.25a-omni", true),
    ("fig-5.25b-directional", false),
    ("fig-5.25c-spot", false),
    ("fig-5.26b-mirror", true),
    ("fig-5.26c-mirror-floor", true),
    ("fig-5.27b-glass", true),
    ("fig-5.30-textures", false),
    ("fig-5.31-box-faces", false),
    ("fig-5.33a-replace", false),
    ("fig-5.33b-decal", false),
    ("fig-5.33c-diffuse", false),
    ("fig-5.34a-bump", false),
    ("fig-5.34b-displacement", false),
    ("fig-5.35-environment", false),
    ("fig-5.36-subpixels", false),
    ("fig-5.37a-aliased", true),
    ("fig-5.37b-jittered", false),
    ("fig-5.37c-regular", false),
];

/// Other scenes whose pictures the book shows, by folder and name.
const PICTURES: [(&str, &str); 9] = [
    ("scenes", "zbuffer"),
    ("scenes", "mesh-pictures"),
    ("scenes", "sky"),
    ("scenes", "area-lights"),
    ("scenes/chapter", "horizon-filtered"),
    ("scenes/chapter", "horizon-points"),
    ("scenes", "depth-of-field"),
    ("scenes", "motion-blur"),
    ("scenes/chapter", "soft-shadow-sampled"),
];

/// Pictures of many pixels or samples, of which one part is rendered again: scene, the size and the samples that its
/// command gives instead of the scene's, and the part's left, top, width and height.
type PictureOfPart = (&'static str, Option<([u32; 2], u32)>, [u32; 4]);
const PARTS: [PictureOfPart; 5] = [
    ("grand-canal", None, [440, 320, 128, 72]),
    ("gyroid", None, [300, 200, 96, 64]),
    ("still-life", None, [300, 250, 240, 160]),
    ("path", Some(([600, 450], 1024)), [180, 315, 40, 30]),
    ("rough", Some(([540, 340], 512)), [240, 210, 48, 16]),
];

fn scene(folder: &str, name: &str) -> Scene {
    let assets = FolderAssets::new(root().join(folder)).expect("the scenes are there");
    match read_scene(&format!("{name}.kdl"), &assets) {
        Ok((scene, warnings)) => {
            assert!(warnings.is_empty(), "{name}: {warnings}");
            scene
        }
        Err(errors) => panic!("{name}: {errors}"),
    }
}

fn picture(scene: Scene) -> Rendering {
    let camera = Camera::of(&scene.views[0]).unwrap();
    let job = Job::new(camera, scene.film, scene.integrator);
    render(&World::build(scene).unwrap(), &job, &()).unwrap()
}

#[test]
fn every_scene_file_is_a_figure_or_a_part_of_one() {
    let files: Vec<String> = std::fs::read_dir(root().join("scenes/chapter"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter(|name| name.starts_with("fig-"))
        .collect();
    for file in &files {
        let name = file.trim_end_matches(".kdl");
        assert!(FIGURES.iter().any(|(figure, _)| *figure == name), "{file} isn't tested");
    }
    assert_eq!(files.len(), FIGURES.len());
}

/// The tolerance is 10⁻⁵ in linear colour. It applies to every pixel whose decisions (hit, lit, blocked) equal those of
/// its four neighbours.
fn compare_with_reference(name: &str, scene: Scene) {
    assert_eq!(scene.film.sampling, Sampling::Corner);
    let ours = picture(scene.clone()).picture;
    let reference = Reference::new(&scene);
    let (w, h) = (ours.width, ours.height);
    let compared: Vec<(f64, u32, u32)> = (0..w * h)
        .into_par_iter()
        .filter_map(|i| {
            let (x, y) = (i % w, i / w);
            let (cx, cy) = (f64::from(x), f64::from(h - 1 - y));
            let sample = reference.pixel(cx, cy);
            let around = [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)];
            let smooth = around.iter().all(|(dx, dy)| reference.pixel(cx + dx, cy + dy).decisions == sample.decisions);
            let ours = ours.pixel(x, y).to_array();
            let error = (0..3).map(|c| (f64::from(ours[c]) - sample.color[c]).abs()).fold(0.0, f64::max);
            smooth.then_some((error, x, y))
        })
        .collect();
    let (worst, x, y) = compared.iter().copied().fold((0.0, 0, 0), |a, b| if b.0 > a.0 { b } else { a });
    println!(
        "{name:24} {:6} of {} pixels away from edges, largest difference {worst:.2e} at {x}, {y}",
        compared.len(),
        w * h
    );
    assert!(compared.len() as f64 > 0.7 * f64::from(w * h), "{name}: {} pixels away from edges", compared.len());
    assert!(worst <= 1e-5, "{name}: {worst} at {x}, {y}");
}

#[test]
fn figures_agree_with_the_reference_away_from_edges() {
    for (name, _) in FIGURES.iter().filter(|(_, referenced)| *referenced) {
        compare_with_reference(name, scene("scenes/chapter", name));
    }
}

#[test]
fn glass_and_mirrors_over_a_lit_floor_agree_with_the_reference() {
    compare_with_reference("glass-over-floor", scene("tests/scenes", "glass-over-floor"));
}

#[test]
fn figures_look_as_they_did_when_people_looked_at_them() {
    let (folder, failed) = (root().join("docs/pictures"), root().join("target/changed-figures"));
    let bless = std::env::var_os("CANALETTO_BLESS").is_some();
    let mut changed = Vec::new();
    let figures = FIGURES.map(|(name, _)| ("scenes/chapter", name));
    for (place, name) in figures.into_iter().chain(PICTURES) {
        let scene = scene(place, name);
        let film = scene.film;
        let rendering = picture(scene);
        let shown = develop(&rendering.picture, &clamped(&film));
        let image =
            Image::from_rgb(rendering.picture.width, rendering.picture.height, shown.iter().map(|c| c.to_array()));
        let png = PictureFormat::Png.encode_image(&image, film.transfer, &EncodeSettings::default(), &[]).unwrap();
        let path = folder.join(format!("{name}.png"));
        if bless {
            std::fs::write(&path, &png).unwrap();
            continue;
        }
        let golden = std::fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}; bless it", path.display()));
        // The comparison is of pixels, not bytes, which depend on the compressor's version.
        if decode(&golden).unwrap().image != decode(&png).unwrap().image {
            std::fs::create_dir_all(&failed).unwrap();
            std::fs::write(failed.join(format!("{name}.png")), &png).unwrap();
            changed.push(name);
        }
    }
    assert!(changed.is_empty(), "changed: {changed:?}; see {} and `canaletto compare`", failed.display());
}

#[test]
fn parts_of_large_pictures_look_as_they_did() {
    for (name, given, part) in PARTS {
        let mut scene = scene("scenes", name);
        if let Some((size, samples)) = given {
            let intrinsics = &mut scene.views[0].intrinsics;
            [intrinsics.width, intrinsics.height] = size;
            scene.film.sampling = Sampling::Sampled(samples);
        }
        scene.film.crop = Some(part);
        let (film, mut developing) = (scene.film, scene.film.developing(describe(&scene.integrator).is_photographic()));
        let whole = std::fs::read(root().join("docs/pictures").join(format!("{name}.png"))).unwrap();
        let whole = decode(&whole).unwrap();
        // The whole picture's exposure was metered in the whole picture.
        if let Some((_, stops)) = whole.metadata.iter().find(|(key, _)| key == "auto-exposure") {
            developing.exposure = stops.parse().unwrap();
        }
        let picture = picture(scene).picture;
        let shown = develop(&picture, &developing);
        let image = Image::from_rgb(picture.width, picture.height, shown.iter().map(|c| c.to_array()));
        let png = PictureFormat::Png.encode_image(&image, film.transfer, &EncodeSettings::default(), &[]).unwrap();
        let ours = decode(&png).unwrap().image;
        let whole = whole.image;
        let [left, top, width, height] = part.map(|n| n as usize);
        assert_eq!((ours.width as usize, ours.height as usize), (width, height));
        for (ours, whole_channel) in ours.channels.iter().zip(&whole.channels) {
            for y in 0..height {
                let start = (top + y) * whole.width as usize + left;
                let (row, golden) = (&ours.data[y * width..][..width], &whole_channel.data[start..][..width]);
                assert!(row == golden, "{name}: row {y} of its part changed; render the scene again and look at it");
            }
        }
    }
}

#[test]
fn the_book_shows_a_true_explanation() {
    let scene = scene("scenes/chapter", "fig-5.27b-glass");
    let camera = Camera::new(&scene.views[0].intrinsics, &scene.views[0].extrinsics).unwrap();
    let job = Job::new(camera, scene.film, scene.integrator);
    let tree = explain(&World::build(scene).unwrap(), &job, 110, 75).unwrap().text(&TextStyle::SHORT);
    let path = root().join("docs/explain.md");
    let page = std::fs::read_to_string(&path).unwrap();
    let start = page.find("```text\n").expect("the page has its block") + "```text\n".len();
    let end = start + page[start..].find("```").expect("the block ends");
    if std::env::var_os("CANALETTO_BLESS").is_some() {
        std::fs::write(&path, format!("{}{tree}{}", &page[..start], &page[end..])).unwrap();
    } else {
        assert_eq!(&page[start..end], tree);
    }
}
