//! Tests of `canaletto explain`: its short text, its steps against formulas, and its JSON against the schema in docs.

mod support;

use serde_json::Value;
use std::collections::BTreeSet;
use std::path::Path;
use std::process::Output;
use support::{canaletto, printed, root};

fn run(folder: &Path, arguments: &str) -> Output {
    canaletto(folder).args(arguments.split(' ')).output().unwrap()
}

/// What `explain` prints.
#[track_caller]
fn explained(folder: &Path, arguments: &str) -> String {
    printed(canaletto(folder).arg("explain").args(arguments.split(' ')))
}

#[track_caller]
fn tree(arguments: &str) -> Value {
    serde_json::from_str(&explained(&root(), &format!("{arguments} --json"))).unwrap()
}

fn vector(value: &Value) -> [f64; 3] {
    [0, 1, 2].map(|i| value[i].as_f64().unwrap_or_else(|| panic!("no vector: {value}")))
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("no number: {value}"))
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|i| a[i] * b[i]).sum()
}

fn along(origin: [f64; 3], t: f64, direction: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|i| origin[i] + t * direction[i])
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    let d = along(a, -1.0, b);
    dot(d, d).sqrt()
}

/// Floor, background, cow, glass, metal, a ring, shadows, edges, beads.
const PIXELS: [&str; 12] = [
    "400,480", "20,5", "250,200", "470,330", "560,250", "130,330", "110,250", "390,395", "240,430", "600,60",
    "520,330", "330,310",
];

#[test]
fn twelve_kinds_of_pixels_fit_on_a_few_screens() {
    let mut objects = BTreeSet::new();
    for pixel in PIXELS {
        let pixel = format!("scenes/still-life.kdl -p {pixel}");
        let text = explained(&root(), &pixel);
        let lines: Vec<&str> = text.lines().collect();
        assert!(lines.len() <= 100, "{pixel}: {} lines", lines.len());
        assert_eq!(lines.iter().filter(|line| line.ends_with("(equal, bit for bit)")).count(), 1, "{text}");
        // All terms are in the tree, also those that are folded.
        let tree = tree(&pixel);
        assert_eq!(tree["sum"], tree["color"]);
        for word in text.split([' ', '(', ')', ',']) {
            assert!(!["-0", "-0.0"].contains(&word), "{word} in {text}");
            let is_number = word.parse::<f64>().is_ok();
            assert!(!is_number || word.trim_matches(['-', '.']).len() <= 12, "{word} in {text}");
        }
        let seen = text.lines().find(|line| line.starts_with("  meets ")).unwrap();
        objects.insert(seen.split(" (").next().unwrap().to_owned());
    }
    assert!(objects.len() >= 5, "{objects:?}");
    let glass = "scenes/still-life.kdl -p 520,330";
    let [one, three, full] =
        ["--levels 1", "--levels 3 --digits 3", "--full"].map(|flag| explained(&root(), &format!("{glass} {flag}")));
    assert!(!one.contains("depth 2") && one.contains("on level 2 and below it"), "{one}");
    assert!(three.contains("depth 3") && !three.contains("depth 4"), "{three}");
    assert!(full.contains("depth 8") && full.lines().count() > 2000 && full.contains("key (point 15)"));
    // The folded points of a light are those of the full text, and so is their sum.
    assert!(three.contains("key, 16 points"), "{three}");
    assert!(three.lines().all(|line| !line.contains("0.75123")), "{three}");
}

/// The bytes at the end of the text are those of a PNG.
#[test]
fn bytes_are_those_of_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a.png");
    let glass = "scenes/chapter/fig-5.27b-glass.kdl";
    let toned = |flags: &str| format!("{glass} --transfer srgb {flags}");
    for (scene, pixels) in [
        (glass.to_owned(), [[110, 75], [5, 5]]),
        ("scenes/rough.kdl".to_owned(), [[60, 60], [150, 120]]),
        (toned("--exposure 1.5 --tone agx"), [[110, 75], [5, 5]]),
        (toned("--exposure -2 --tone clamp"), [[110, 75], [5, 5]]),
        (toned("--exposure 2 --tone pbr-neutral"), [[110, 75], [5, 5]]),
        (toned("--exposure auto --tone agx"), [[110, 75], [5, 5]]),
    ] {
        let rendered = run(&root(), &format!("render {scene} -q -o {} --samples 4", file.display()));
        assert!(rendered.status.success(), "{}", String::from_utf8_lossy(&rendered.stderr));
        let mut reader =
            png::Decoder::new(std::io::BufReader::new(std::fs::File::open(&file).unwrap())).read_info().unwrap();
        let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut bytes).unwrap();
        for [x, y] in pixels {
            let at = y * info.line_size + 3 * x;
            let told = tree(&format!("{scene} -p {x},{y} --samples 4"));
            let expected: Vec<u64> = bytes[at..at + 3].iter().map(|&byte| byte.into()).collect();
            assert_eq!(told["developed"]["values"]["bytes"], serde_json::json!(expected), "{scene} {x},{y}");
            let [r, g, b] = [0, 1, 2].map(|i| expected[i]);
            let text = explained(&root(), &format!("{scene} -p {x},{y} --samples 4"));
            assert!(text.contains(&format!("bytes in the file {r} {g} {b}  (#{r:02x}{g:02x}{b:02x})")), "{text}");
        }
    }
    let scaled = explained(&root(), "scenes/chapter/fig-5.27b-glass.kdl -p 110,75 --tone scale");
    assert!(scaled.contains("divides by the picture's largest component"), "{scaled}");
}

/// The exposure that `auto` becomes, given as a number, makes the same picture; a part of the picture has the same one.
#[test]
fn auto_exposure_is_told_and_can_be_given() {
    let folder = tempfile::tempdir().unwrap();
    let rendered = |flags: &str| {
        let file = folder.path().join("a.png");
        let command = format!("render scenes/chapter/fig-5.27b-glass.kdl --tone agx {flags} -o {}", file.display());
        let output = run(&root(), &command);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let file = std::io::BufReader::new(std::fs::File::open(&file).unwrap());
        let mut reader = png::Decoder::new(file).read_info().unwrap();
        let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut bytes).unwrap();
        let report = String::from_utf8_lossy(&output.stderr).into_owned();
        let stops = report.split_once("(--exposure ").map(|(_, rest)| rest.split(')').next().unwrap().to_owned());
        (bytes, stops)
    };
    let (auto, stops) = rendered("--exposure auto --threads 1");
    let stops = stops.expect("the report tells the stops");
    assert_ne!(stops.parse::<f32>(), Ok(0.0));
    assert!(rendered(&format!("--exposure {stops} --threads 3")).0 == auto);
    assert!(rendered("--exposure 0").0 != auto);
    assert_eq!(rendered("--exposure auto --crop 0,0,20,10 --seed 3").1, Some(stops));
}

/// The chapter's camera and sphere, recomputed here from the scene's numbers (box 5.4).
#[test]
fn steps_follow_the_chapter() {
    let tree = tree("scenes/chapter/fig-5.27b-glass.kdl -p 110,75 --steps");
    let camera = &tree["camera"];
    let (eye, half) = ([100.0, 40.0, 40.0], 0.5f64);
    // z_e = (eye - center) / |eye - center|, x_e = up × z_e normalised, y_e = z_e × x_e (5.3).
    let length = dot(eye, eye).sqrt();
    let z = eye.map(|v| v / length);
    let side = z[0].hypot(z[2]);
    let x = [z[2] / side, 0.0, -z[0] / side];
    let y = [z[1] * x[2] - z[2] * x[1], z[2] * x[0] - z[0] * x[2], z[0] * x[1] - z[1] * x[0]];
    for (axis, expected) in [x, y, z].into_iter().enumerate() {
        assert!(distance(vector(&camera["axes"][axis]), expected) < 1e-12, "{camera}");
    }
    // d_f = near, height = 2 d_f tan(90°/2), base = height · 230/230 (5.2).
    let [d_f, height, base] = ["d_f", "height", "base"].map(|name| number(&camera[name]));
    assert!((d_f - 30.0).abs() + (height - 60.0).abs() + (base - 60.0).abs() < 1e-12, "{camera}");
    let ray = &tree["samples"][0]["ray"];
    let steps = &ray["steps"];
    let (u, v) = (base * (110.0 / 230.0 - half), height * (154.0 / 230.0 - half));
    let d = along(along(along([0.0; 3], -d_f, z), v, y), u, x); // (5.10)
    assert!(distance(vector(&steps["direction"]), d) < 1e-12, "{steps}");
    // Both roots lie on the sphere, and the first one is the hit.
    let sphere = &steps["intersection"];
    assert_eq!((&sphere["shape"], vector(&sphere["center"])), (&"sphere".into(), [0.0, 20.0, 0.0]));
    let [t1, t2] = [0, 1].map(|i| number(&sphere["roots"][i]));
    for t in [t1, t2] {
        assert!((distance(along(eye, t, d), [0.0, 20.0, 0.0]) - 25.0).abs() < 1e-9, "{sphere}");
    }
    let [a, b, c] = ["a", "b", "c"].map(|name| number(&sphere[name]));
    assert!((b * b - 4.0 * a * c - number(&sphere["discriminant"])).abs() < 1e-6 && (a - dot(d, d)).abs() < 1e-9);
    let hit = &ray["outcome"]["hit"];
    assert!((t1 * dot(d, d).sqrt() - number(&hit["t"])).abs() < 1e-4 && t1 < t2, "{sphere} {}", hit["t"]);
    // Box 5.1: the ball is met, and the boxes aren't.
    let tried = steps["tried"].as_array().unwrap();
    assert_eq!(tried.len(), 3);
    assert!(tried[0]["is_nearest"] == true && number(&tried[0]["t"]) == t1, "{steps}");
    assert!(tried[1..].iter().all(|object| object["missed"].is_string() && object["t"].is_null()), "{steps}");
    // v, r and the refracted direction: Snell's law, in the plane of incidence.
    let (v, r, n) = (vector(&hit["steps"]["v"]), vector(&hit["steps"]["r"]), vector(&hit["shading_normal"]));
    assert!((dot(v, n) - dot(r, n)).abs() < 1e-6 && (dot(v, n) - number(&hit["steps"]["v_dot_n"])).abs() < 1e-6);
    let refracted = &hit["children"][0];
    let law = &refracted["steps"]["refraction"];
    let [sin_i, sin_t, cos_t] = ["sin_i", "sin_t", "cos_t"].map(|name| number(&law[name]));
    assert!((sin_i - (1.0 - dot(v, n) * dot(v, n)).sqrt()).abs() < 1e-6, "{law}");
    assert!((sin_i - f64::from(1.2f32) * sin_t).abs() < 1e-12 && (sin_t.hypot(cos_t) - 1.0).abs() < 1e-12, "{law}");
    assert!(distance(vector(&law["r_t"]), vector(&refracted["direction"])) < 1e-6, "{law} {}", refracted["direction"]);
}

/// Exercise 17: the ray meets the triangle's plane at t = 185/23 in (3.957, 1.913, 3.957), from behind.
#[test]
fn exercise_17_with_its_own_direction() {
    let folder = tempfile::tempdir().unwrap();
    let scene = r#"
        material "m" { kd 0.5 0.5 0.5 }
        plane name="of abc" material="m" { point 3 4 2; normal -3 -7 -6 }
        triangle name="abc" material="m" { a 3 4 2; b 4 1 5; c 2 1 6 }
    "#;
    std::fs::write(folder.path().join("s.kdl"), scene).unwrap();
    let told = explained(folder.path(), "s.kdl --ray 12,18,12,-1,-2,-1 --steps --json");
    let tree: Value = serde_json::from_str(&told).unwrap();
    let (steps, hit) = (&tree["ray"]["steps"], &tree["ray"]["outcome"]["hit"]);
    assert_eq!(vector(&steps["direction"]), [-1.0, -2.0, -1.0]);
    let plane = steps["tried"].as_array().unwrap().iter().find(|object| object["object"] == "of abc").unwrap();
    assert!((number(&plane["t"]) - 185.0 / 23.0).abs() < 1e-12, "{steps}");
    assert!(distance(vector(&hit["point"]), [3.957, 1.913, 3.957]) < 1e-3, "{hit}");
    assert_eq!(number(&hit["primitive"]), 0.0);
}

#[test]
fn triangles_have_areas_and_lights_have_factors() {
    let folder = tempfile::tempdir().unwrap();
    let scene = r#"
        material "m" { kd 0.5 0.5 0.5 }
        triangle name="t" material="m" { a 3 2 1; b 8 2 1; c 4 8 -4 }
        triangle name="other" material="m" { a 0 10 0; b 1 10 0; c 0 11 0 }
        plane name="far" material="m" { point 0 0 -20; normal 0 0 1 }
        box name="beside" material="m" { min 10 0 -10; max 12 2 -9 }
        sphere name="behind" material="m" { center 5 4 20; radius 1 }
        sphere name="aside" material="m" { center 5 40 0; radius 1 }
        light "spot" { position 5 4 10; target 5 4 0; inner 5; outer 40; attenuation 0 0.25 0.5; intensity 8 8 8 }
    "#;
    std::fs::write(folder.path().join("s.kdl"), scene).unwrap();
    let told = explained(folder.path(), "s.kdl --ray 5,4,10,0,0,-2 --steps --json");
    let tree: Value = serde_json::from_str(&told).unwrap();
    assert_eq!(tree["sum"], tree["color"]);
    let (steps, hit) = (&tree["ray"]["steps"], &tree["ray"]["outcome"]["hit"]);
    let triangle = &steps["intersection"];
    let [a, b, c] = [[3.0, 2.0, 1.0], [8.0, 2.0, 1.0], [4.0, 8.0, -4.0]];
    let l = vector(&triangle["barycentric"]);
    let p = [0, 1, 2].map(|i| l[0] * a[i] + l[1] * b[i] + l[2] * c[i]);
    assert!(distance(p, along([5.0, 4.0, 10.0], number(&triangle["t"]), [0.0, 0.0, -2.0])) < 1e-12, "{triangle}");
    // Half the length of (b - a) × (c - a) = (0, 25, 30).
    let areas = vector(&triangle["areas"]);
    assert!((areas.iter().sum::<f64>() - 25.0f64.hypot(30.0) / 2.0).abs() < 1e-12, "{triangle}");
    assert!((l[1] - number(&hit["uv"][0])).abs() < 1e-6 && (l[2] - number(&hit["uv"][1])).abs() < 1e-6, "{hit}");
    // Box 5.1: the reason why each object is missed, or its t in lengths of d.
    let object = |name: &str| steps["tried"].as_array().unwrap().iter().find(|o| o["object"] == name).unwrap();
    let reason = |name: &str| object(name)["missed"].as_str().unwrap_or("met").to_owned();
    assert_eq!((reason("t").as_str(), number(&object("far")["t"])), ("met", 15.0));
    for (name, why) in [("other", "outside of it"), ("beside", "faces"), ("behind", "behind"), ("aside", "delta = ")] {
        assert!(reason(name).contains(why), "{steps}");
    }
    let light = &hit["lights"][0];
    let factors = &light["steps"];
    let d = number(&light["distance"]);
    let attenuation = 1.0 / (0.25 * d + 0.5 * d * d);
    assert!((number(&factors["attenuation"]) / attenuation - 1.0).abs() < 1e-6, "{light}");
    // The point lies on the cone's axis.
    assert!((number(&factors["cone"]) - 1.0).abs() < 1e-6 && vector(&factors["intensity"]) == [8.0; 3], "{light}");
    assert!((vector(&light["intensity"])[0] / (8.0 * attenuation) - 1.0).abs() < 1e-6, "{light}");
}

/// The camera's own ray is explained to the same colour without the camera.
#[test]
fn a_ray_needs_no_camera() {
    let pixel = tree("scenes/chapter/fig-5.27b-glass.kdl -p 110,75");
    let d = vector(&pixel["samples"][0]["chapter_direction"]);
    let ray = format!("--ray 100,40,40,{},{},{}", d[0], d[1], d[2]);
    let told = tree(&format!("scenes/chapter/fig-5.27b-glass.kdl {ray}"));
    assert_eq!((&told["color"], &told["sum"]), (&pixel["color"], &pixel["color"]));
    assert_eq!(told["ray"]["outcome"], pixel["samples"][0]["ray"]["outcome"]);
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("s.kdl"), "sphere { center 0 0 0; radius 1 }\nambient 1\n").unwrap();
    let output = run(folder.path(), "explain s.kdl --ray 0,0,9,0,0,-1");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && !said.contains("camera"), "{said}");
    for (arguments, words) in [
        ("scenes/still-life.kdl", "--pixel"),
        ("scenes/still-life.kdl --ray 0,0,0,1,2", "six numbers"),
        ("scenes/still-life.kdl --ray 0,0,0,0,0,0", "a direction that has a length"),
        ("scenes/still-life.kdl --ray 0,0,0,1,NaN,0", "a direction that has a length"),
        ("scenes/zbuffer.kdl --ray 0,0,0,1,0,0", "traces no rays"),
        ("scenes/still-life.kdl -p 1,1 --ray 0,0,0,1,0,0", "cannot be used with"),
        ("scenes/still-life.kdl -p 1,1 --levels 0", "--levels"),
        ("scenes/still-life.kdl -p 1,1 --digits 99", "--digits"),
    ] {
        let output = run(&root(), &format!("explain {arguments}"));
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.code() == Some(2) && said.contains(words), "{arguments}: {said}");
    }
}

/// Each ray has a node, with the colour of its sum, and below each hit are its lights.
#[test]
fn drawings_have_a_node_for_each_ray() {
    let folder = tempfile::tempdir().unwrap();
    let scene = "scenes/chapter/fig-5.27b-glass.kdl -p 110,75 --transfer srgb";
    let file = folder.path().join("t.svg");
    let text = explained(&root(), &format!("{scene} --svg {}", file.display()));
    assert!(text.contains("equal, bit for bit"), "{text}");
    let svg = std::fs::read_to_string(&file).unwrap();
    assert_eq!(svg, explained(&root(), &format!("{scene} --svg -")));
    // The ball from outside and from inside, then the background. Each hit has one light.
    let count = |part: &str| svg.matches(part).count();
    assert_eq!([count("class=\"node\" x="), count(" r=\"5\" fill"), count("T, 1 − o = 0.60")], [3, 2, 2], "{svg}");
    assert!(
        svg.contains("<title>background</title>") && svg.contains("<title>omni light #1: 0.001 0.001 0.632</title>")
    );
    // The first swatch is the pixel, as its developed bytes show it.
    let bytes = tree(scene)["developed"]["values"]["bytes"].clone();
    let [r, g, b] = [0, 1, 2].map(|i| bytes[i].as_u64().unwrap());
    assert!(svg.contains(&format!("fill=\"#{r:02x}{g:02x}{b:02x}\"")), "{svg}");
    // All elements are closed, in their order.
    for (file, most) in [(svg.clone(), 3), (explained(&root(), "scenes/still-life.kdl -p 520,330 --svg -"), 40)] {
        let mut open = Vec::new();
        for tag in file.split('<').skip(1) {
            let tag = tag.split('>').next().unwrap();
            let name = tag.split([' ', '/']).find(|name| !name.is_empty()).unwrap();
            match () {
                () if tag.starts_with('/') => assert_eq!(open.pop(), Some(name), "{tag}"),
                () if tag.ends_with('/') => {}
                () => open.push(name),
            }
        }
        assert!(open.is_empty() && file.matches("class=\"node\" x=").count() <= most, "{open:?}");
    }
    assert_eq!(explained(&root(), &format!("{scene} --levels 1 --svg -")).matches("2 more rays").count(), 1);
    // Names are text, whatever they hold.
    let hostile = r#"material "m" { kd 0.5 }
        sphere name="<b>\"&" material="m" { center 0 0 0; radius 1 }"#;
    std::fs::write(folder.path().join("s.kdl"), hostile).unwrap();
    let svg = explained(folder.path(), "s.kdl --ray 0,0,5,0,0,-1 --svg -");
    assert!(svg.contains("&lt;b&gt;&quot;&amp;") && !svg.contains("<b>"), "{svg}");
}

/// t of a hit solves the equation that the steps give, and lies on the shape.
#[test]
fn round_shapes_have_equations() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("round.kdl"), ROUND).unwrap();
    for (ray, shape) in [
        ("-1.5,0.8,5,0.02,0.05,-1", "frustum"),
        ("-1.5,5,0.1,0.03,-2,0.02", "frustum"),
        ("1.4,0.6,5,0.02,0.05,-1", "frustum"),
        ("0.1,4.1,5,0.05,-0.6,-1", "torus"),
    ] {
        let tree: Value =
            serde_json::from_str(&explained(folder.path(), &format!("round.kdl --ray {ray} --steps --json"))).unwrap();
        let (steps, t) = (&tree["ray"]["steps"], number(&tree["ray"]["outcome"]["hit"]["t"]));
        let found = &steps["intersection"];
        assert_eq!(found["shape"], shape, "{ray}: {steps}");
        let tried = steps["tried"].as_array().unwrap().iter().find(|object| object["is_nearest"] == true).unwrap();
        let t_of_d = number(&tried["t"]);
        let d = vector(&steps["direction"]);
        assert!((t_of_d * dot(d, d).sqrt() - t).abs() < 1e-5, "{ray}: {t_of_d} and {t}");
        let coefficients = match shape {
            "torus" => (0..5).map(|i| number(&found["coefficients"][i])).collect::<Vec<_>>(),
            _ => ["c", "b", "a"].map(|name| number(&found[name])).to_vec(),
        };
        let value = coefficients.iter().rev().fold(0.0, |sum, c| sum * t_of_d + c);
        let size: f64 = coefficients.iter().enumerate().map(|(i, c)| (c * t_of_d.powi(i as i32)).abs()).sum();
        let on_cap = found["caps"].as_array().is_some_and(|caps| caps.iter().any(|cap| cap.as_f64() == Some(t_of_d)));
        assert!(
            on_cap == ray.starts_with("-1.5,5") && (on_cap || value.abs() < 1e-9 * size),
            "{ray}: {value}, {found}"
        );
        let text = explained(folder.path(), &format!("round.kdl --ray {ray} --steps"));
        assert!(text.contains(if shape == "torus" { "torus with c = " } else { "(exercise 14)" }), "{text}");
    }
}

const ROUND: &str = r#"
    camera { eye 0 1 6; center 0 0.6 0; fovy 40; size 40 30 }
    material "a" { kd 0.5 0.5 0.5 }
    cylinder name="tube" material="a" { base -1.5 0 0; top -1.4 2 0.1; radius 0.5; caps #true }
    cone name="cone" material="a" { base 1.5 0 0; top 1.5 2 0.2; radius 0.8; top-radius 0.2 }
    torus name="ring" material="a" { center 0 1 0; axis 0.1 1 0.2; radius 0.6; tube 0.2 }
    rectangle name="sheet" material="a" { corner 3 0 0; u 1 0 0; v 0 1 0 }
    light "omni" { position 3 5 3; intensity 1 1 1 }
"#;

/// A seen lamp above a pane of glass, which scattered rays find often.
const PANE: &str = r#"
    camera { eye 0 1 3; center 0 0 0; fovy 20; size 8 8 }
    film { samples 32 }
    integrator "path" { max-depth 3 }
    material "pane" { dielectric 1.5 }
    disk { center 0 0 0; normal 0 1 0; radius 5 }
    box material="pane" { min -3 1.8 -3; max 3 2 3 }
    light "sphere" { center 0 6 0; radius 3; visible #true }
"#;

/// A ball seen along parallel rays.
const PARALLEL: &str = r#"
    camera { eye 0 1 6; center 0 0 0; orthographic 3; size 16 16 }
    sphere { center 0 0 0; radius 1 }
    light "omni" { position 0 6 3 }
"#;

const PATHS: &str = r#"
    camera { eye 0 1 6; center 0 0.6 0; fovy 40; size 40 30 }
    film { samples 32 }
    integrator "path" { max-depth 6 }
    background 0.2
    material "floor" { kd 0.7 0.6 0.5 }
    material "lamp" { kd 0.2; emission 9 8 6 }
    material "fog" { medium { absorption 0.1; scattering 0.9; anisotropy 0.3 } }
    material "glass" { dielectric 1.5; absorption 0.2 0.1 0.4 }
    material "gold" { conductor "gold"; roughness 0.3 }
    material "veil" { kd 0.5; coverage 0.5 }
    material "prism" { standard { transmission { weight 1; dispersion-scale 1 } } }
    disk name="floor" material="floor" { center 0 0 0; normal 0 1 0; radius 8 }
    disk name="lamp" material="lamp" { center 0 3 0; normal 0 -1 0; radius 0.8 }
    sphere name="fog" material="fog" { center 0 0.6 0; radius 0.6 }
    sphere name="glass" material="glass" { center -1.2 0.5 0; radius 0.5 }
    sphere name="gold" material="gold" { center 1.2 0.5 0; radius 0.5 }
    sphere name="prism" material="prism" { center 0 1.6 0; radius 0.4 }
    disk name="veil" material="veil" { center 0 0.6 2; normal 0 0 1; radius 0.4 }
    light "omni" name="bulb" { position 2 2 2; intensity 0.5 0.5 0.5 }
    light "directional" name="sun" { direction 0.2 -1 -0.4; intensity 0.5 0.5 0.5 }
"#;

const MIXED: &str = r#"
    camera { eye 0 1 6; center 0 0.6 0; fovy 40; size 40 30 }
    film { sample "center" }
    integrator "whitted" { max-depth 3 }
    environment "lat-long" file="globe.png"
    ambient 0.1 0.1 0.1
    texture "leaf" file="leaf.png"
    texture "wrinkles" file="wrinkles.png"
    material "leaf" { kd 0.5 0.5 0.5; texture "leaf" use="cutout" }
    material "rough" { kd 0.5 0.5 0.5; ks 0.5 0.5 0.5; n 20; texture "wrinkles" use="bump" height=2 }
    material "glass" { kd 0.1 0.1 0.1; eta 1.5; opacity 0.1; k 0.1 }
    material "water" { kd 0.1 0.1 0.1; eta 1.33; opacity 0.1; priority 2 }
    material "lamp" { kd 0.5 0.5 0.5; emission 3 2 1 }
    box name="leaf" material="leaf" { min -3 0 1; max -1 2 1.1 }
    sphere name="bumps" material="rough" { center 1.6 0.6 0; radius 0.6 }
    sphere name="glass" material="glass" { center 0.1 0.6 0; radius 0.7 }
    sphere name="water" material="water" { center 0.6 0.6 0.2; radius 0.6 }
    sphere name="lamp" material="lamp" { center -0.5 2 0; radius 0.3 }
    disk material="rough" { center 0 0 0; normal 0 1 0; radius 8 }
    light "directional" { direction 0.2 -0.1 -1; intensity 1 1 1 }
    light "spot" { position 3 3 3; target 0 0 0; inner 5; outer 10; intensity 1 1 1 }
"#;

const ROOM: &str = r#"
    camera { eye 0 0 0.9; center 0 0 0; fovy 60; size 24 24; near 0.4; far 1.7 }
    film { sample "center" }
    integrator "radiosity" { error 0.3; show "full" }
    material "wall" { kd 0.6 0.5 0.4 }
    material "lamp" { kd 0.2; emission 5 5 5 }
    box name="room" material="wall" { min -1 -1 -1; max 1 1 1 }
    box name="lamp" material="lamp" { min -0.3 0.9 -0.3; max 0.3 0.95 0.3 }
    box name="block" material="wall" { min -0.3 -0.3 -0.3; max 0.3 0.3 0.3 }
    light "omni" name="bulb" { position 0.2 0.5 0.5; intensity 0.5 0.5 0.5 }
"#;

const FIELD: &str = r#"
    camera { eye 0 3 6; center 0 0 0; fovy 60; size 24 24 }
    film { sample "center" }
    integrator "radiosity" { error 0.3; show "solution" }
    environment "gradient" { stops -90 0.2 0.18 0.15  0 0.8 0.85 0.9  90 0.1 0.3 0.7 }
    material "wall" { kd 0.6 0.5 0.4 }
    box name="floor" material="wall" { min -4 -0.1 -4; max 4 0 4 }
    box name="block" material="wall" { min -0.5 0 -0.5; max 0.5 1 0.5 }
    light "directional" name="sun" { direction 0.2 -1 -0.4; intensity 0.5 0.5 0.5 }
"#;

/// Explanations with all kinds of nodes, of scenes of the project and of those above.
const EXPLAINED: [&str; 49] = [
    "ROOT/scenes/chapter/fig-5.27b-glass.kdl -p 110,75 --steps",
    "ROOT/scenes/chapter/fig-5.27b-glass.kdl -p 110,75 --tone scale",
    "ROOT/scenes/chapter/fig-5.27b-glass.kdl --ray 0,43,0,1,0.02,0 --steps",
    "ROOT/scenes/still-life.kdl -p 520,330 --max-depth 3",
    "ROOT/scenes/still-life.kdl -p 240,430 --steps --samples 1",
    "ROOT/scenes/chapter/fig-5.25c-spot.kdl -p 110,150 --steps",
    "ROOT/scenes/chapter/fig-5.33a-replace.kdl -p 110,100",
    "ROOT/scenes/chapter/fig-5.34a-bump.kdl -p 110,100 --steps",
    "ROOT/scenes/chapter/fig-5.35-environment.kdl -p 10,10",
    "ROOT/scenes/chapter/fig-5.18-unlit.kdl -p 110,100",
    "ROOT/scenes/sky.kdl -p 10,10",
    "ROOT/scenes/rough.kdl -p 150,120 --samples 4 --max-depth 3",
    "ROOT/scenes/motion-blur.kdl -p 150,100 --samples 4",
    "ROOT/scenes/depth-of-field.kdl -p 150,100 --samples 4",
    "ROOT/scenes/area-lights.kdl -p 100,100 --samples 1",
    "ROOT/scenes/mesh-pictures.kdl -p 100,100 --steps --samples 1",
    "ROOT/scenes/red-wall.kdl -p 8,53 --size 60x60 --set integrator.error=0.3",
    "ROOT/scenes/red-wall.kdl -p 8,53 --size 60x60 --set integrator.error=0.3 --set integrator.show=patches",
    "ROOT/scenes/red-wall.kdl -p 30,50 --size 60x60 --set integrator.error=0.3 --set integrator.show=full",
    "ROOT/scenes/zbuffer.kdl -p 610,240",
    "mixed.kdl -p 8,10 --steps",
    "mixed.kdl -p 8,17",
    "mixed.kdl -p 16,3 --steps",
    "mixed.kdl -p 16,22",
    "mixed.kdl -p 24,16",
    "mixed.kdl -p 30,15",
    "mixed.kdl --ray 0,1,6,0,0,-1 --steps",
    "room.kdl -p 4,20",
    "room.kdl -p 12,12 --integrator zbuffer",
    "field.kdl -p 12,16",
    "field.kdl -p 2,0",
    "field.kdl --ray 0,3,6,0,-3,-3 --steps",
    "round.kdl --ray -1.5,5,0.1,0.03,-2,0.02 --steps",
    "round.kdl --ray 0.1,4.1,5,0.05,-0.6,-1 --steps",
    "round.kdl --ray 3.25,0.5,5,0,0,-1 --steps",
    "field.kdl --ray 0,3,6,0,-3,-3 --diff-seed 3 --diff-frame 2",
    "ROOT/scenes/chapter/fig-5.27b-glass.kdl -p 110,75 --diff-set material.glass.eta=1.5",
    "ROOT/scenes/chapter/fig-5.27b-glass.kdl -p 110,75 --diff-set ambient=0.3",
    "paths.kdl -p 20,15",
    "paths.kdl -p 20,15 --tone pbr-neutral --background none",
    "pane.kdl -p 4,4",
    "parallel.kdl -p 8,8 --steps",
    "mixed.kdl -p 24,16 --tone agx",
    "paths.kdl -p 20,8",
    "mixed.kdl -p 24,16 --integrator path --samples 16",
    "ROOT/scenes/motion-blur.kdl -p 150,100 --integrator path --samples 4",
    "ROOT/scenes/glass-and-metal.kdl -p 24,18 --size 48x36 --integrator zbuffer",
    "ROOT/scenes/depth-of-field.kdl -p 150,100 --integrator path --samples 4",
    "ROOT/scenes/chapter/fig-5.33a-replace.kdl -p 110,100 --integrator path --samples 2",
];

/// Fields that only trees of very many patches, places, sources or objects have, or lights behind a bent normal.
const RARE: [&str; 7] = [
    "pixelTree/more_patches",
    "pixelTree/more_places",
    "rayTree/more_patches",
    "rayTree/more_places",
    "raySteps/more_tried",
    "lightSum/others",
    "light/behind",
];

#[test]
fn json_has_the_schema_of_the_docs() {
    let schema: Value =
        serde_json::from_slice(&std::fs::read(root().join("docs/explain.schema.json")).unwrap()).unwrap();
    let schema = Schema { definitions: &schema["$defs"] };
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in [
        ("mixed.kdl", MIXED),
        ("room.kdl", ROOM),
        ("field.kdl", FIELD),
        ("round.kdl", ROUND),
        ("paths.kdl", PATHS),
        ("pane.kdl", PANE),
        ("parallel.kdl", PARALLEL),
    ] {
        std::fs::write(folder.path().join(name), text).unwrap();
    }
    for name in ["leaf.png", "globe.png", "wrinkles.png"] {
        std::fs::copy(root().join("scenes/chapter/textures").join(name), folder.path().join(name)).unwrap();
    }
    let mut seen = BTreeSet::new();
    for arguments in EXPLAINED {
        let arguments = arguments.replace("ROOT", root().to_str().unwrap());
        let value: Value = serde_json::from_str(&explained(folder.path(), &format!("{arguments} --json"))).unwrap();
        let kind = match &value {
            _ if value.get("compared").is_some() => "difference",
            _ if value.get("ray").is_some() => "rayTree",
            _ if value["samples"][0].get("rays").is_some() => "pathTree",
            _ => "pixelTree",
        };
        schema
            .check(&schema.definitions[kind], &value, kind, &mut seen)
            .unwrap_or_else(|problem| panic!("{arguments}: {problem}"));
    }
    // Every documented field occurs.
    let mut documented = BTreeSet::new();
    for (name, definition) in schema.definitions.as_object().unwrap() {
        fields(definition, name, &mut documented);
    }
    RARE.iter().for_each(|field| {
        documented.remove(*field);
    });
    let missing: Vec<_> = documented.difference(&seen).collect();
    assert!(missing.is_empty(), "no output has {missing:?}");
    // A wrong output is refused.
    let value = tree("scenes/chapter/fig-5.27b-glass.kdl -p 110,75");
    let changed = |change: &dyn Fn(&mut Value)| {
        let mut value = value.clone();
        change(&mut value);
        schema.check(&schema.definitions["pixelTree"], &value, "pixelTree", &mut BTreeSet::new())
    };
    assert!(changed(&|_| {}).is_ok());
    assert!(changed(&|value| value["version"] = 2.into()).is_err());
    assert!(changed(&|value| value["samples"][0]["ray"]["kind"] = "other".into()).is_err());
    assert!(changed(&|value| value["samples"][0]["ray"]["direction"] = serde_json::json!([1.0, 2.0])).is_err());
    assert!(changed(&|value| value["samples"][0]["ray"]["more"] = 1.into()).is_err());
    assert!(changed(&|value| drop(value.as_object_mut().unwrap().remove("sum"))).is_err());
    assert!(changed(&|value| value["samples"][0]["ray"]["outcome"]["hit"]["t"] = Value::Null).is_err());
}

/// The names of all fields below a schema, with the definition that they belong to.
fn fields(schema: &Value, place: &str, found: &mut BTreeSet<String>) {
    for part in schema["oneOf"].as_array().into_iter().flatten().chain(schema.get("items")) {
        fields(part, place, found);
    }
    for (name, field) in schema["properties"].as_object().into_iter().flatten() {
        let place = format!("{place}/{name}");
        fields(field, &place, found);
        found.insert(place);
    }
}

/// A validator of the part of JSON Schema (draft 2020-12) that the docs use.
struct Schema<'a> {
    definitions: &'a Value,
}

impl Schema<'_> {
    /// Checks a value. The fields that occur are added to `seen`.
    fn check(&self, schema: &Value, value: &Value, place: &str, seen: &mut BTreeSet<String>) -> Result<(), String> {
        let wrong = |what: &str| Err(format!("{place}: {what}: {value:.200}"));
        for (keyword, rule) in schema.as_object().expect("a schema is an object") {
            match keyword.as_str() {
                "description" | "required" | "additionalProperties" => {}
                "$ref" => {
                    let name = rule.as_str().unwrap().strip_prefix("#/$defs/").unwrap();
                    self.check(&self.definitions[name], value, name, seen)?;
                }
                "oneOf" => {
                    let mut fits = Vec::new();
                    for part in rule.as_array().unwrap() {
                        let mut own = BTreeSet::new();
                        if self.check(part, value, place, &mut own).is_ok() {
                            fits.push(own);
                        }
                    }
                    match fits.pop() {
                        Some(own) if fits.is_empty() => seen.extend(own),
                        _ => return wrong("not exactly one of the forms"),
                    }
                }
                "const" if rule != value => return wrong("another constant"),
                "enum" if !rule.as_array().unwrap().contains(value) => return wrong("not one of the words"),
                "const" | "enum" => {}
                "type" => {
                    let is = |name: &Value| match name.as_str().unwrap() {
                        "null" => value.is_null(),
                        "boolean" => value.is_boolean(),
                        "integer" => value.is_u64() || value.is_i64(),
                        "number" => value.is_number(),
                        "string" => value.is_string(),
                        "array" => value.is_array(),
                        "object" => value.is_object(),
                        other => panic!("{other}"),
                    };
                    if !rule.as_array().map_or_else(|| is(rule), |names| names.iter().any(is)) {
                        return wrong(&format!("no {rule}"));
                    }
                }
                "minimum" if number(value) < number(rule) => return wrong("too small"),
                "maximum" if number(value) > number(rule) => return wrong("too large"),
                "minItems" if (value.as_array().map_or(0, Vec::len) as f64) < number(rule) => {
                    return wrong("too short");
                }
                "maxItems" if (value.as_array().map_or(0, Vec::len) as f64) > number(rule) => return wrong("too long"),
                "minimum" | "maximum" | "minItems" | "maxItems" => {}
                "items" => {
                    for item in value.as_array().into_iter().flatten() {
                        self.check(rule, item, place, seen)?;
                    }
                }
                "prefixItems" => {
                    for (rule, item) in rule.as_array().unwrap().iter().zip(value.as_array().into_iter().flatten()) {
                        self.check(rule, item, place, seen)?;
                    }
                }
                "properties" => {
                    for (name, field) in value.as_object().into_iter().flatten() {
                        let Some(rule) = rule.get(name) else { return wrong(&format!("an unknown field {name}")) };
                        self.check(rule, field, &format!("{place}/{name}"), seen)?;
                        seen.insert(format!("{place}/{name}"));
                    }
                }
                other => panic!("the validator doesn't know {other}"),
            }
        }
        for name in schema["required"].as_array().into_iter().flatten() {
            if value.get(name.as_str().unwrap()).is_none() {
                return wrong(&format!("no field {name}"));
            }
        }
        Ok(())
    }
}

/// A path's contributions make its light, `--brightest` chooses the path that adds most, and `--sample` any other.
#[test]
fn paths_are_chosen_and_add_up() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("paths.kdl"), PATHS).unwrap();
    let value: Value = serde_json::from_str(&explained(folder.path(), "paths.kdl -p 12,20 --json")).unwrap();
    assert_eq!(value["sum"], value["color"]);
    let samples = value["samples"].as_array().unwrap();
    assert_eq!(samples.len(), 32);
    let mut brightest = (0.0, 0);
    for sample in samples {
        let steps = sample["rays"].as_array().unwrap().iter().flat_map(|ray| ray["steps"].as_array().unwrap());
        let kinds = ["found", "overlay", "sampled"];
        let contributions = steps.filter_map(|step| kinds.iter().find_map(|kind| step.get(kind)));
        let sum = contributions.map(|step| number(&step["contribution"][1])).sum::<f64>();
        let light = number(&sample["color"][1]);
        assert!((sum - light).abs() <= 1e-5 * light.max(1.0), "{sum}, {light}");
        let luminance = dot(vector(&sample["color"]), [0.2126, 0.7152, 0.0722]) * number(&sample["weight"]);
        if luminance > brightest.0 {
            brightest = (luminance, sample["number"].as_u64().unwrap());
        }
    }
    let heading = |number: u64| format!("\npath {number} of 32, weight ");
    let text = explained(folder.path(), "paths.kdl -p 12,20 --brightest");
    assert!(text.contains(&heading(brightest.1)), "{text}");
    assert!(explained(folder.path(), "paths.kdl -p 12,20 --sample 7").contains(&heading(7)));
    for (arguments, problem) in [
        ("paths.kdl -p 12,20 --sample 33", "32 samples"),
        ("paths.kdl -p 12,20 --steps", "--integrator whitted"),
        ("paths.kdl --ray 0,1,6,0,0,-1", "--integrator whitted"),
        ("paths.kdl -p 12,20 --integrator whitted --brightest", "--integrator path"),
    ] {
        let output = run(folder.path(), &format!("explain {arguments}"));
        let message = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.code() == Some(2) && message.contains(problem), "{arguments}: {message}");
    }
}
