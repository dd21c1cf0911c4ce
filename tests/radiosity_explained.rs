//! Explained light of radiosity: what is printed adds up, in its order, to the patch's light and to the pixel.

use canaletto::camera::Camera;
use canaletto::explain::{LightSum, Outcome, PatchNode, PixelTree, PlaceNode, SourceKind, TextStyle, explain};
use canaletto::form_factor::polygon_to_polygon;
use canaletto::render::{Job, render};
use canaletto::scene::{Integrator, RadiosityMethod, RadiositySettings, RadiosityShow};
use canaletto::world::World;
use canaletto_io::assets::MemoryAssets;
use canaletto_io::text::read_scene;
use glam::DVec3;
use std::path::{Path, PathBuf};

/// A room with an open front, a red wall on its left and a lamp at the ceiling.
fn room() -> String {
    std::fs::read_to_string(root().join("scenes/red-wall.kdl")).unwrap().replace("size 240 240", "size 24 24")
}

/// The room with a mirror, a spot light and the sky, so that all kinds of sources occur.
const MIXED: &str = r#"
    material "mirror" { kd 0.1 0.1 0.1; k 0.7 }
    sphere name="ball" material="mirror" { center -0.4 0.3 0.2; radius 0.3 }
    light "spot" name="spot" { position 0 1.8 0.8; target 0 0 0; intensity 2 2 2; inner 20; outer 40 }
    light "omni" { position 0.3 1 0.5; intensity 0.2 0.3 0.4 }
    environment "gradient" { stops -90 0.2 0.18 0.15  0 0.8 0.85 0.9  90 0.1 0.3 0.7 }
"#;

/// A closed room.
const CLOSED: &str = r#"
    camera { eye 0 0 0.9; center 0 0 0; fovy 60; size 24 24 }
    film { sample "center" }
    material "wall" { kd 0.6 0.5 0.4 }
    box name="room" material="wall" { min -1 -1 -1; max 1 1 1 }
    light "omni" name="bulb" { position 0.2 0.3 0.1; intensity 1 1 1; attenuation 0 0 1 }
"#;

/// Many small bodies far from each other, which exchange light as clusters.
fn crowd() -> String {
    let boxes: String = (0..40)
        .map(|i| {
            let (side, x, z) = (if i % 2 == 0 { -9.0 } else { 9.0 }, f64::from(i / 2 % 5), f64::from(i / 10));
            let [x0, z0] = [side + 0.5 * x, 0.5 * z];
            let [x1, z1] = [x0 + 0.2, z0 + 0.2];
            format!("box name=\"crate {i}\" material=\"white\" {{ min {x0} 0 {z0}; max {x1} 0.2 {z1} }}\n")
        })
        .collect();
    format!(
        "camera {{ eye -8.55 0.1 0.1; center -9 0.1 0.1; fovy 70; size 24 24 }}\nfilm {{ sample \"center\" }}\n\
         material \"white\" {{ kd 0.7 0.7 0.7 }}\n{boxes}\
         box name=\"floor\" material=\"white\" {{ min -14 -0.1 -14; max 14 0 14 }}\n\
         light \"directional\" name=\"sun\" {{ direction 0.3 -1 -0.4; intensity 1 1 1 }}"
    )
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn world_of(text: &str) -> (World, Job) {
    let (scene, _) = read_scene("s.kdl", &MemoryAssets::new().with("s.kdl", text)).unwrap_or_else(|e| panic!("{e}"));
    let camera = Camera::of(&scene.views[0]).unwrap();
    let job = Job::new(camera, scene.film, scene.integrator);
    (World::build(scene).unwrap(), job)
}

fn with(job: &Job, method: RadiosityMethod, error: f32, show: RadiosityShow) -> Job {
    let settings = RadiositySettings { method, error, show, ..RadiositySettings::DEFAULT };
    Job { integrator: Integrator::Radiosity(settings), ..job.clone() }
}

/// The numbers of the last parentheses of a line.
fn triple(line: &str) -> DVec3 {
    let (_, rest) = line.rsplit_once('(').unwrap_or_else(|| panic!("no numbers in {line:?}"));
    let numbers: Vec<f64> = rest.split(')').next().unwrap().split(", ").map(|n| n.parse().unwrap()).collect();
    DVec3::from_slice(&numbers)
}

fn indent(line: &str) -> usize {
    line.len() - line.trim_start_matches([' ', '|']).len()
}

/// Blends what the lines of an interpolated light print: the sums of its places with their weights. Returns the number
/// of these sums.
fn add_up_places(text: &str) -> usize {
    let lines: Vec<&str> = text.lines().collect();
    let mut sums = 0;
    for (start, line) in lines.iter().enumerate() {
        if !line.contains(", interpolated between ") {
            continue;
        }
        let own = indent(line);
        let mut parts: Vec<(&str, DVec3)> = Vec::new();
        let (mut weight, mut weights) = (0.0, 0.0);
        for line in lines[start + 1..].iter().take_while(|line| indent(line) > own) {
            let term = line.trim_start_matches([' ', '|']);
            match indent(line) - own {
                4 => {
                    weight = term.rsplit_once(", weight ").unwrap().1.parse().unwrap();
                    weights += weight;
                }
                // A place that was written before has its light in one line for each part.
                8 if term.ends_with(')') => parts.push((&term[..6], triple(term) * weight)),
                8 => parts.push((&term[..6], DVec3::NAN)),
                12 if term.starts_with("= ") => {
                    parts.last_mut().unwrap().1 = triple(term) * weight;
                    sums += 1;
                }
                _ => {}
            }
        }
        let mut blended = DVec3::ZERO;
        for names in [["direct", "direct"], ["light ", "emitte"], ["indire", "indire"]] {
            let part = parts.iter().filter(|(name, _)| names.contains(name));
            blended += part.fold(DVec3::ZERO, |sum, (_, light)| sum + *light) / weights;
        }
        assert_eq!(blended, triple(line.split_once(": ").unwrap().0), "{line}");
    }
    sums
}

/// Adds what a patch's lines print, in their order, as someone with a calculator does. Returns the number of sums.
fn add_up_patches(text: &str) -> usize {
    let lines: Vec<&str> = text.lines().collect();
    let mut sums = 0;
    for (start, line) in lines.iter().enumerate() {
        let name = line.trim_start_matches([' ', '|']);
        if !["direct light", "light from emitting surfaces", "indirect light"].contains(&name) {
            continue;
        }
        let own = indent(line);
        let (mut total, mut links, mut source) = (DVec3::ZERO, None, DVec3::ZERO);
        for line in &lines[start + 1..] {
            let (depth, term) = (indent(line) - own, line.trim_start_matches([' ', '|']));
            // The links of a source sum to it.
            if depth == 4 {
                assert_eq!(links.take().unwrap_or(source), source, "the links before {line}");
            }
            match depth {
                4 if term.starts_with("+ ") => {
                    source = triple(term);
                    total += source;
                }
                4 => {
                    assert_eq!(total, triple(term), "{term}");
                    sums += 1;
                    break;
                }
                8 if term.starts_with("+ ") => *links.get_or_insert(DVec3::ZERO) += triple(term),
                8 => {
                    let (factor, _) = term.split_once(" * (").unwrap();
                    let (product, light) = term.rsplit_once(" = ").unwrap();
                    assert_eq!(triple(product) * factor.parse::<f64>().unwrap(), triple(light), "{term}");
                    *links.get_or_insert(DVec3::ZERO) += triple(light);
                }
                12 => {}
                _ => panic!("an unknown line {line:?}"),
            }
        }
    }
    sums
}

fn sums_of(patch: &PatchNode) -> [&LightSum; 3] {
    [&patch.direct, &patch.from_emitters, &patch.indirect]
}

fn small_rounding(sums: [&LightSum; 3]) {
    // The solver finds indirect light as the difference of all light and that of emitters.
    let light: DVec3 = sums.iter().map(|sum| DVec3::from(sum.light)).sum();
    for sum in sums {
        assert_eq!(sum.sum().to_array(), sum.light);
        assert!(DVec3::from(sum.rounding).abs().max_element() <= 1e-13 * light.max_element(), "{sum:?}");
    }
}

/// The patches of a tree's diffuse hits are explained, and all sums are exact.
fn check(world: &World, job: &Job, [x, y]: [u32; 2]) -> PixelTree {
    let tree = explain(world, job, x, y).unwrap();
    assert_eq!(tree.sum(), tree.color, "{x}, {y}");
    for sample in &tree.samples {
        let mut waiting = vec![&sample.ray];
        while let Some(ray) = waiting.pop() {
            let Outcome::Hit(hit) = &ray.outcome else { continue };
            waiting.extend(&hit.children);
            let Some(light) = &hit.radiosity else { continue };
            let patch = tree
                .radiosity
                .patches
                .iter()
                .find(|patch| patch.number == light.patch)
                .expect("the patch is explained");
            assert_eq!((&patch.object, patch.object_id), (&hit.object, hit.object_id));
            for corner in &light.corners {
                let place = tree.radiosity.places.iter().find(|place| match corner.vertex {
                    Some(_) => place.vertex == corner.vertex,
                    None => place.patch == Some(light.patch),
                });
                let terms = match (place, light.is_interpolated) {
                    (Some(place), true) => [&place.direct, &place.from_emitters, &place.indirect],
                    (None, false) => sums_of(patch),
                    _ => panic!("{place:?}"),
                };
                // Each blended light is the sum of its terms.
                assert_eq!(
                    [corner.direct, corner.from_emitters, corner.indirect],
                    terms.map(|sum| sum.sum().to_array())
                );
            }
            let kd = hit.phong.kd;
            assert_eq!(Some(light.reflected(kd)), hit.ambient);
        }
    }
    for patch in &tree.radiosity.patches {
        assert_eq!(patch.sum().to_array(), patch.radiance);
        small_rounding(sums_of(patch));
    }
    for PlaceNode { direct, from_emitters, indirect, .. } in &tree.radiosity.places {
        small_rounding([direct, from_emitters, indirect]);
    }
    let text = tree.to_string();
    let places = add_up_places(&text);
    let shown = match job.integrator {
        Integrator::Radiosity(RadiositySettings { show: RadiosityShow::Full, .. }) => 1..=2,
        _ => 3..=3,
    };
    assert!(shown.contains(&(places / tree.radiosity.places.len().max(1))) || places == 0, "{places}: {text}");
    assert_eq!(places == 0, tree.radiosity.places.is_empty());
    assert_eq!(add_up_patches(&text), 3 * tree.radiosity.patches.len() + places);
    tree
}

const PIXELS: [[u32; 2]; 3] = [[4, 20], [9, 14], [12, 11]];

#[test]
fn printed_terms_add_up_to_patches_and_pixels() {
    let (room, crowd) = (room(), crowd());
    let mixed = format!("{room}{MIXED}");
    let methods =
        [(RadiosityMethod::Hierarchical, 0.05), (RadiosityMethod::Full, 0.2), (RadiosityMethod::Shooting, 0.3)];
    let mut shows =
        [RadiosityShow::Full, RadiosityShow::Solution, RadiosityShow::Patches, RadiosityShow::Full].iter().cycle();
    let mut kinds = Vec::new();
    for (name, text) in [("room", room.as_str()), ("mixed", &mixed), ("closed", CLOSED), ("crowd", &crowd)] {
        let (world, job) = world_of(text);
        for (method, error) in methods {
            let show = *shows.next().unwrap();
            let job = with(&job, method, error, show);
            let picture = render(&world, &job, &()).unwrap().picture;
            for [x, y] in PIXELS {
                let tree = check(&world, &job, [x, y]);
                assert_eq!(tree.color, picture.pixel(x, y), "{name} {method:?} {show:?} {x}, {y}");
                assert!(!tree.radiosity.patches.is_empty(), "{name} {method:?} {show:?} {x}, {y}");
                let sums = tree.radiosity.patches.iter().flat_map(sums_of);
                kinds.extend(sums.flat_map(|sum| &sum.sources).map(|source| source.kind));
            }
        }
    }
    use SourceKind::{Cluster, Environment, Itself, Light, Object};
    for kind in [Light, Environment, Object, Cluster, Itself] {
        assert!(kinds.contains(&kind), "{kind:?}");
    }
}

/// A floor patch beside the red wall gets most of its light from the lamp and from the red wall. The form factor to the
/// lamp is the formula's, and its light that of an emitter without reflectance.
#[test]
fn the_largest_source_is_the_one_that_is_near() {
    let (world, job) = world_of(&room());
    // A link to a part of the floor around the patch has the mean factor of that part.
    for (method, error, deviation) in [(RadiosityMethod::Hierarchical, 0.05, 0.05), (RadiosityMethod::Full, 0.05, 0.01)]
    {
        let tree = check(&world, &with(&job, method, error, RadiosityShow::Solution), [3, 21]);
        let patch = &tree.radiosity.patches[0];
        assert_eq!((patch.object.as_str(), patch.material.as_str()), ("floor", "white"));
        assert!(patch.center[0] < -0.6 && patch.center[1] == 0.0, "{:?}", patch.center);
        let all_sources = patch.from_emitters.sources.iter().chain(&patch.indirect.sources);
        let mut by_size: Vec<_> = all_sources.collect();
        by_size.sort_by(|a, b| DVec3::from(b.light).element_sum().total_cmp(&DVec3::from(a.light).element_sum()));
        let names: Vec<&str> = by_size.iter().map(|source| source.name.as_str()).collect();
        assert_eq!(&names[..2], ["lamp", "red wall"], "{method:?}");
        assert_eq!(patch.from_emitters.sources.len(), 1);
        let lamp = &patch.from_emitters.sources[0];
        let corners: Vec<DVec3> = patch.corners.iter().map(|&corner| corner.into()).collect();
        let below = [[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.2, 0.2]].map(|[x, z]| DVec3::new(x, 1.999, z));
        let exact = polygon_to_polygon(&corners, &below).unwrap().value;
        let found = lamp.light[0] / 12.0;
        assert!((found / exact - 1.0).abs() < deviation, "{method:?} {found} {exact}");
        assert!(lamp.links.iter().all(|link| link.radiance == [12.0, 12.0, 9.0]));
        // What the red wall reflects is red.
        let red = &patch.indirect.sources[0];
        assert!(red.name == "red wall" && red.light[0] > 4.0 * red.light[1]);
        // The sources are in order of size.
        let sizes: Vec<f64> = patch.indirect.sources.iter().map(|s| DVec3::from(s.light).element_sum()).collect();
        assert!(sizes.is_sorted_by(|a, b| a >= b), "{sizes:?}");
    }
}

/// The book's page shows the explanation of a point of the floor beside the red wall.
#[test]
fn the_book_shows_a_true_patch() {
    let (world, job) = world_of(&std::fs::read_to_string(root().join("scenes/red-wall.kdl")).unwrap());
    let tree = explain(&world, &job, 35, 215).unwrap().text(&TextStyle::SHORT);
    let path = root().join("docs/radiosity.md");
    let page = std::fs::read_to_string(&path).unwrap();
    let start = page.find("```text\npixel (").expect("the page has its block") + "```text\n".len();
    let end = start + page[start..].find("```").expect("the block ends");
    if std::env::var_os("CANALETTO_BLESS").is_some() {
        std::fs::write(&path, format!("{}{tree}{}", &page[..start], &page[end..])).unwrap();
    } else {
        assert_eq!(&page[start..end], tree);
    }
}
