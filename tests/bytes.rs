//! Equal bytes of paths through all that they can meet: for any number of threads, any set of instructions, parts that
//! are added, and any power of two as unit of length.

use canaletto::InstructionSet;
use canaletto::camera::Camera;
use canaletto::explain::Explainer;
use canaletto::film::BlockMean;
use canaletto::render::{Job, Preparation, Rendering, Session, render};
use canaletto::scene::{Sampling, Scene};
use canaletto::world::World;
use canaletto_io::assets::MemoryAssets;
use canaletto_io::text::read_scene;
use canaletto_tests::{assert_same_picture, root};

/// Media, dispersion, rough glass, a metal, the standard surface with all its layers, a picture around, a lens and
/// motion. `@` stands before lengths, `/` before numbers for each length and `//` before those for each squared length.
const BODIES: &str = r#"
camera {
    eye @0 @2 @7; center @0 @0.7 @0; fovy 40; size 24 18; near @1; far @1000
    lens { radius @0.1; focus-point @0 @1 @1; blades 5 }
}
film { samples 32 }
integrator "path"
environment "lat-long" file="around.hdr" { rotate-y 30 }
material "floor" { kd 0.5 0.4 0.3; ks 0.1; n 30 }
material "lamp" { kd 0; emission 9 7 5 }
material "fog" { medium { absorption /0.1 /0.2 /0.3; scattering /0.8; anisotropy 0.5 } }
material "milk" { dielectric 1.33; medium { absorption /0.1; scattering /4 /3 /2; anisotropy -0.2 } }
material "frost" { dielectric 1.5; roughness 0.5; absorption /0.5 /0.1 /0.2 }
material "gold" { conductor "gold"; roughness 0.4 }
material "diamond" { standard preset="diamond" {
    transmission { dispersion-abbe-number 15; color 0.6 0.8 0.9; depth @0.7 }
} }
material "all" { standard {
    base { color 0.8 0.3 0.1; metalness 0.3; diffuse-roughness 0.7 }
    specular { roughness 0.3; anisotropy 0.5 }
    transmission { weight 0.3; color 0.7 0.9 0.8; depth @1 }
    subsurface { weight 0.4; color 0.9 0.6 0.5 }
    coat { weight 0.5; roughness 0.1; color 0.9 0.9 0.7 }
    fuzz { weight 0.4; color 0.6 0.5 0.9 }
    thin-film { weight 0.6; thickness 0.4 }
    emission { radiance 0.2 }
} }
material "leaf" { standard {
    specular { roughness 0.5 }; subsurface { weight 1; color 0.9 0.8 0.5 }; opacity 0.7; thin-walled #true
} }
plane material="floor" { point @0 @0 @0; normal 0 1 0 }
sphere material="lamp" { center @-2 @3 @1; radius @0.3 }
box material="fog" { min @-3 @0.01 @-2; max @3 @2.5 @-0.9 }
sphere material="milk" { center @-1.6 @0.6 @0.5; radius @0.5 }
sphere material="frost" { center @-0.5 @0.6 @1; radius @0.5 }
sphere material="gold" { center @0.6 @0.6 @0.6; radius @0.5; motion { translate @0.1 @0.2 @0 } }
sphere material="diamond" { center @1.6 @0.5 @1.2; radius @0.4 }
torus material="all" { center @1.6 @0.4 @-0.2; axis 0 1 0; radius @0.5; tube @0.2 }
sphere material="all" { center @0 @1.7 @-0.3; radius @0.4; scale 1 0.5 1; rotate-z 20 }
disk material="leaf" { center @-1.4 @1.8 @0; normal 1 1 1; radius @0.5 }
"#;

/// A tree of many lamps, a measured lamp, lights of each falloff, moving and textured lamps, and guided paths.
const LAMPS: &str = r#"
camera { eye @0 @1.6 @5; center @0 @1 @0; fovy 45; size 24 18; near @1; far @1000; motion { eye @0.1 @1.6 @5 } }
film { samples 32 }
integrator "path" { guiding "on" }
background 0.01
material "wall" { kd 0.7 0.6 0.5 }
material "glass" { dielectric 1.5 }
material "fairy" { kd 0; emission 30; temperature 2300 }
texture "checks" kind="checker" { even 1 0.8 0.5; odd 0.2 0.1 0.1 }
material "shade" { kd 0; emission 6; texture "checks" use="emission" mapping="planar" space="object" { scale @0.2 } }
material "iron" { conductor "iron"; roughness 0.2 }
box material="wall" { min @-2 @-0.1 @-2; max @2 @0 @6 }
box material="wall" { min @-2 @0 @-2.1; max @2 @3 @-2 }
box material="wall" { min @-2.1 @0 @-2; max @-2 @3 @6 }
repeat 200 { sphere material="fairy" {
    center "@(1.2 * cos(7560 * i / 200))" "@(0.4 + 2.4 * i / 200)" "@(1.2 * sin(7560 * i / 200))"; radius @0.014
} }
cylinder material="wall" { base @0 @0 @0; top @0 @2.6 @0; radius @0.6 }
sphere material="fairy" { center @1.5 @1 @1; radius @0.1; motion { translate @0 @0.5 @0; rotate-x 20 } }
sphere material="glass" { center @1.5 @0.4 @1.5; radius @0.35 }
sphere material="fairy" { center @1.5 @0.4 @1.5; radius @0.1 }
disk material="shade" { center @-1 @2.5 @0.5; normal 0.3 -1 0; radius @0.4 }
box material="iron" { min @-1.6 @0 @0.6; max @-1 @0.6 @1.2; rotate-y 20 }
light "omni" { position @-1.4 @2.3 @-1.4; intensity 3; attenuation 0 0 //1; ies "lamps.ies" }
light "omni" { position @1 @2 @2; intensity 0.2; attenuation 0.3 /0.2 //0.1 }
light "spot" { position @0 @3 @4; target @0 @0 @1; intensity 0.3; inner 10; outer 20 }
light "directional" { direction 0.3 -1 -0.5; intensity 0.1 }
light "sphere" { center @-1 @1 @2; radius @0.1; intensity 0.4; emission "matte"; attenuation 0 0 //1 }
"#;

/// Boxes under a disk that is also near, with a colour on a wall.
const ROOM: &str = r#"
camera { eye 0 1 3.4; center 0 1 0; fovy 38; size 24 18 }
film { samples 32 }
integrator "path"
background 0
material "white" { kd 0.7 }
material "red" { kd 0.6 0.1 0.1 }
material "lamp" { kd 0; emission 12 10 8 }
box material="white" { min -1 -0.1 -1; max 1 0 1 }
box material="white" { min -1 2 -1; max 1 2.1 1 }
box material="white" { min -1 0 -1.1; max 1 2 -1 }
box material="red" { min -1.1 0 -1; max -1 2 1 }
box material="white" { min 1 0 -1; max 1.1 2 1 }
box material="white" { min -0.6 0 -0.6; max 0 1.2 0; rotate-y 20 }
disk material="lamp" { center 0 1.98 0; normal 0 -1 0; radius 0.4 }
disk material="lamp" { center 0.5 0.3 0.4; normal 0.2 -1 0.1; radius 0.25 }
"#;

/// Spheres and a disk under a picture around.
const SKY: &str = r#"
camera { eye 0 1.5 5; center 0 0.5 0; fovy 40; size 24 18 }
film { samples 32 }
integrator "path"
environment "lat-long" file="around.hdr" { rotate-y 70; rotate-x 20 }
material "grey" { kd 0.5 }
material "gold" { conductor "gold"; roughness 0.3 }
disk material="grey" { center 0 0 0; normal 0 1 0; radius 8 }
sphere material="grey" { center -1.2 0.5 0; radius 0.5 }
sphere material="gold" { center 0 0.5 0.3; radius 0.5 }
sphere material="grey" { center 1.2 0.5 0; radius 0.5 }
"#;

/// Rectangles, triangles and spheres as lamps, near and far, turned and stretched, from one side and from two.
const SHEETS: &str = r#"
camera { eye 0 2 6; center 0 0.8 0; fovy 40; size 24 18 }
film { samples 32 }
integrator "path"
background 0.02
material "floor" { kd 0.6 0.5 0.4 }
material "lamp" { kd 0.2; emission 5 4 3 }
material "both" { kd 0.2; emission 2 3 5; two-sided }
plane material="floor" { point 0 0 0; normal 0 1 0 }
rectangle material="lamp" { corner -2 1 -1; u 1.5 0 0; v 0 0.2 1 }
rectangle material="both" { corner 0.5 0.02 0; u 0.5 0 0; v 0 0.4 0.3 }
triangle material="lamp" { a -0.5 0.1 1; b 0.3 0.1 1.2; c 0 0.8 0.8 }
triangle material="both" { a 2 2 -1; b 2.4 2 -1; c 2.2 2.5 -1.2 }
sphere material="lamp" { center 1.6 0.5 1; radius 0.3; scale 1 0.4 1; rotate-z 30 }
disk material="lamp" { center -1.5 0.8 1.5; normal 1 -1 0; radius 0.2; scale 1 1 2 }
"#;

/// The chapter's highlights, mirrors and clear bodies, by the chapter's lights and an area light.
const PHONG: &str = r#"
camera { eye 0 1.2 4; center 0 0.5 0; fovy 42; size 24 18 }
film { samples 32 }
integrator "path"
background 0.3 0.4 0.5
material "shiny" { kd 0.3 0.2 0.5; ks 0.4; n 20 }
material "mirror" { kd 0.1; k 0.8 }
material "clear" { kd 0.05; ks 0.2; n 60; k 0.1; opacity 0.2; eta 1.4 }
material "floor" { kd 0.5; ks 0.2; n 200 }
plane material="floor" { point 0 0 0; normal 0 1 0 }
sphere material="shiny" { center -0.9 0.5 0; radius 0.5 }
sphere material="mirror" { center 0.1 0.5 -0.4; radius 0.5 }
sphere material="clear" { center 0.9 0.5 0.4; radius 0.5 }
light "omni" { position -2 3 2; intensity 0.6 }
light "sphere" { center 2 2 1; radius 0.4; intensity 0.5; emission "matte" }
"#;

/// Standard surfaces with textures, bent normals and a coat.
const TEXTURED: &str = r#"
camera { eye 0 1.2 4; center 0 0.5 0; fovy 42; size 24 18 }
film { samples 32 }
integrator "path"
environment "gradient" { stops -90 0.1 0.1 0.1  0 0.9 0.8 0.7  90 0.2 0.4 0.9 }
texture "checks" kind="checker" { even 0.8 0.7 0.2; odd 0.2 0.1 0.1 }
texture "waves" kind="fbm" { octaves 3; stops 0 0 0 0  1 1 1 1 }
material "plastic" {
    standard { base { color 0.8 0.2 0.1 }; specular { roughness 0.2 }; coat { weight 0.5; roughness 0.1 } }
    texture "checks" mapping="spherical" repeat=6
}
material "bumpy" { standard { base { color 0.4 0.5 0.6; metalness 1 }; specular { roughness 0.4 } }
    texture "waves" use="bump" height=0.05 mapping="solid" { scale 0.4 }
}
material "paint" { standard { base { color 0.8 0.2 0.1 }; specular { ior 1.7 } }
    texture "checks" use="roughness" mapping="spherical" repeat=4
}
material "floor" { kd 0.5; texture "checks" mapping="planar" space="world" { scale 0.5; rotate-x 90 } }
plane material="floor" { point 0 0 0; normal 0 1 0 }
sphere material="plastic" { center -0.7 0.5 0; radius 0.5 }
sphere material="bumpy" { center 0.6 0.5 0; radius 0.5 }
sphere material="paint" { center 0 0.3 0.8; radius 0.3 }
rectangle material="plastic" { corner -2 0 -1; u 4 0 0; v 0 1.5 0 }
light "directional" { direction 0.4 -1 -0.3; intensity 0.5 }
"#;

/// Smoke, glass, highlights, frosted glass, a standard surface and guiding under one lamp.
const SMOKE: &str = r#"
camera { eye 0 1 4; center 0 0.8 0; fovy 42; size 24 18 }
film { samples 32 }
integrator "path" { guiding "on" }
background 0
material "wall" { kd 0.6 0.5 0.5; ks 0.2; n 12 }
material "lamp" { kd 0; emission 20 }
material "smoke" { medium { scattering 0.6 0.7 0.8; anisotropy 0.3 } }
material "glass" { dielectric 1.5 }
box material="wall" { min -1.5 -0.1 -1.5; max 1.5 0 1.5 }
box material="wall" { min -1.5 0 -1.6; max 1.5 2.5 -1.5 }
box material="smoke" { min -1.4 0.01 -1.4; max 1.4 0.6 1.4 }
material "frost" { dielectric 1.4; roughness 0.4 }
material "paint" { standard { base { color 0.3 0.5 0.8 } } }
sphere material="glass" { center 0 0.9 0; radius 0.4 }
sphere material="frost" { center -0.8 0.9 0.2; radius 0.3 }
sphere material="paint" { center -0.5 1.8 0; radius 0.3 }
sphere material="lamp" { center 0.8 2 0; radius 0.15 }
"#;

const SCENES: [(&str, &str); 8] = [
    ("bodies", BODIES),
    ("lamps", LAMPS),
    ("room", ROOM),
    ("sky", SKY),
    ("sheets", SHEETS),
    ("phong", PHONG),
    ("textured", TEXTURED),
    ("smoke", SMOKE),
];

/// The text with its lengths multiplied by 2ᵏ.
fn scaled(text: &str, k: i32) -> String {
    let mut scaled = String::new();
    let mut rest = text;
    while let Some(at) = rest.find(['@', '/']) {
        let is_start = rest[..at].ends_with([' ', '"']);
        let mark = rest[at..].chars().take_while(|c| ['@', '/'].contains(c)).count();
        scaled.push_str(&rest[..at]);
        let after = &rest[at + mark..];
        if !is_start || after.starts_with(' ') {
            scaled.push_str(&rest[at..at + mark]);
            rest = after;
            continue;
        }
        let power = if rest[at..].starts_with('@') { 1 } else { -(mark as i32) };
        let factor = 2f64.powi(k * power);
        let end = after.find([' ', ';', '\n', '"']).unwrap();
        match after.starts_with('(') {
            true => {
                scaled.push_str(&format!("{factor:?} * "));
                rest = after;
            }
            false => {
                scaled.push_str(&format!("{:?}", after[..end].parse::<f64>().unwrap() * factor));
                rest = &after[end..];
            }
        }
    }
    scaled + rest
}

/// A picture around of 16 × 8 texels, with a small bright place.
fn around() -> Vec<u8> {
    let mut file = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 8 +X 16\n".to_vec();
    for i in 0..16 * 8u8 {
        file.extend(if i == 37 { [250, 220, 180, 134] } else { [60 + i, 90, 200 - i, 126] });
    }
    file
}

fn scene(text: &str, k: i32) -> Scene {
    let ies = std::fs::read(root().join("scenes/lamps.ies")).unwrap();
    let text = scaled(text, k);
    let assets = MemoryAssets::new().with("s.kdl", text.clone()).with("around.hdr", around()).with("lamps.ies", ies);
    read_scene("s.kdl", &assets).unwrap_or_else(|errors| panic!("{errors}\n{text}")).0
}

fn job(scene: &Scene, [first_sample, samples]: [u32; 2]) -> Job {
    let mut film = scene.film;
    film.sampling = Sampling::Sampled(samples);
    Job { first_sample, tile: 7, ..Job::new(Camera::of(&scene.views[0]).unwrap(), film, scene.integrator) }
}

/// The rendering of a scene, whose samples are all finite.
fn rendering(text: &str, k: i32, samples: [u32; 2]) -> Rendering {
    let scene = scene(text, k);
    let world = World::build(scene.clone()).unwrap();
    let rendering = render(&world, &job(&scene, samples), &()).unwrap();
    assert_eq!(rendering.statistics.as_ref().unwrap().non_finite, 0);
    rendering
}

#[test]
fn paths_have_equal_bytes_by_any_threads_and_instructions() {
    for (name, text) in SCENES {
        let first = rendering(text, 0, [0, 16]);
        for threads in [1, 2, 3, 7] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            for set in InstructionSet::available() {
                let again = pool.install(|| {
                    set.limit();
                    rendering(text, 0, [0, 16])
                });
                let name = format!("{name}, {threads} threads, {}", set.name());
                assert_same_picture(&again.picture, &first.picture, &name);
                assert_eq!(again.counts, first.counts, "{name}");
            }
        }
        InstructionSet::Avx512.limit();
    }
}

/// A path alone takes the steps of paths side by side: one lane and eight are one program.
#[test]
fn explained_paths_have_the_colours_of_pictures() {
    for (name, text) in SCENES {
        let scene = scene(text, 0);
        let world = World::build(scene.clone()).unwrap();
        let job = job(&scene, [0, 8]);
        let picture = render(&world, &job, &()).unwrap().picture;
        let session = Session::open(&world, &job, Preparation::default()).unwrap();
        let explainer = Explainer::new(&session);
        for (x, y) in (0..24 * 18).step_by(5).map(|pixel| (pixel % 24, pixel / 24)) {
            let paths = explainer.paths(x, y).unwrap();
            assert_eq!(paths.color, picture.pixel(x, y), "{name}, pixel {x} {y}");
        }
    }
}

#[test]
fn two_runs_of_32_are_one_of_64_with_all_that_paths_meet() {
    for text in [BODIES, LAMPS] {
        let whole = rendering(text, 0, [0, 64]);
        let parts = [0, 32].map(|first| rendering(text, 0, [first, 32]).picture.pixels);
        for (pixel, color) in whole.picture.pixels.iter().enumerate() {
            assert_eq!(BlockMean::of([parts[0][pixel], parts[1][pixel]]).mean, *color, "pixel {pixel}");
        }
    }
}

/// Lengths are multiplied by 2ᵏ, numbers for each length divided by it.
#[test]
fn a_power_of_two_as_unit_changes_no_bit_of_all_that_paths_meet() {
    assert_eq!(scaled("a @1.5 /3 1 / 2 //8; \"@(1 + i)\"", 2), "a 6.0 0.75 1 / 2 0.5; \"4.0 * (1 + i)\"");
    for (name, text) in [("bodies", BODIES), ("lamps", LAMPS)] {
        let first = rendering(text, 0, [0, 8]);
        for k in [-11, 1, 6, 20] {
            let again = rendering(text, k, [0, 8]);
            assert_same_picture(&again.picture, &first.picture, &format!("{name} times 2^{k}"));
            assert_eq!(again.counts, first.counts, "{name} times 2^{k}");
        }
    }
}

/// Light beyond all numbers is counted and named. Its sample can be made again, alone.
#[test]
fn samples_without_a_number_can_be_made_again() {
    let text = "camera { eye 0 0 3; center 0 0 0; fovy 60; size 12 12 }\nintegrator \"path\"\nbackground 0.5\n\
        material \"white\" { kd 0.7 }\nmaterial \"sun\" { kd 0.5; emission 3e38 }\n\
        sphere material=\"white\" { center 0 0 0; radius 1 }\nsphere material=\"sun\" { center 1.5 0 0; radius 0.4 }\n\
        sphere material=\"sun\" { center 1.5 1 0; radius 0.5 }\n";
    let scene = scene(text, 0);
    let world = World::build(scene.clone()).unwrap();
    let whole = render(&world, &job(&scene, [0, 8]), &()).unwrap();
    let statistics = whole.statistics.unwrap();
    assert!(statistics.non_finite > 0 && statistics.non_finite < 8 * 144, "{statistics:?}");
    assert!(whole.picture.pixels.iter().all(|color| color.is_finite()));
    let session = Session::open(&world, &job(&scene, [0, 8]), Preparation::default()).unwrap();
    for place in &statistics.non_finite_samples {
        let mut alone = job(&scene, [place.sample, 1]);
        alone.film.crop = Some([place.x, place.y, 1, 1]);
        // One sample alone would go through the centre.
        alone.film.sampling = Sampling::Sampled(2);
        let again = render(&world, &alone, &()).unwrap().statistics.unwrap();
        assert!(again.non_finite_samples.contains(place), "{place:?}: {again:?}");
        let paths = Explainer::new(&session).paths(place.x, place.y).unwrap();
        assert_eq!(paths.color, whole.picture.pixel(place.x, place.y));
    }
}
