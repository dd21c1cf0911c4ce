//! Objects far from zero give the picture of equal objects near zero.

use super::*;

/// A place in survey coordinates, in metres, with the digits of `f64`.
pub(super) const SURVEY: [f64; 3] = [408_201.58, 102.4, -4_080_928.02];

/// The text with each `@x y z` moved by an offset.
pub(super) fn moved(text: &str, offset: [f64; 3]) -> String {
    let mut out = String::new();
    for (i, part) in text.split('@').enumerate() {
        if i == 0 {
            out += part;
            continue;
        }
        let end = part.find([';', '\n', '}', '"', '|']).unwrap_or(part.len());
        let numbers: Vec<f64> = part[..end].split_whitespace().map(|n| n.parse().expect("a number")).collect();
        let there = numbers.iter().enumerate().map(|(axis, n)| format!("{}", n + offset[axis % 3]));
        out += &there.collect::<Vec<_>>().join(" ");
        out += &part[end..];
    }
    out.replace('|', "")
}

pub(super) const CAMERA: &str = "background 0.6 0.7 0.9
ambient 0.2
camera { eye @2 3.5 6; center @0 0.5 0; fovy 40; size 120 90 }
film { samples 4 }
material \"red\" { kd 0.8 0.3 0.2 }
material \"mirror\" { kd 0.2; k 0.7 }
plane { point @0 0 0; normal 0 1 0 }
";

pub(super) const SUN: &str = "light \"directional\" { direction -0.5 -1 -0.3 }\n";

const SHAPES: &str = "sphere material=\"red\" { center @0 0.5 0; radius 0.5 }
sphere material=\"mirror\" { center @1.1 0.5 -0.25; radius 0.5 }
cylinder material=\"red\" { base @-1.2 0 -0.1; top @-1.2 1.2 -0.1; radius 0.4 }
cone { base @-0.9 0 1.3; top @-0.9 0.7 1.3; radius 0.3 }
box material=\"red\" { min @-0.5 0 1.4; max @-0.2 0.3 1.7 }
torus { center @0.6 0.15 1.5; axis 0 1 0; radius 0.3; tube 0.12 }
disk { center @0.5 0.9 0.9; normal 0 1 0.5; radius 0.2 }
triangle { a @-0.3 0.9 0.6; b @0.1 0.9 0.7; c @-0.1 1.3 0.6 }
";

#[track_caller]
fn stays_the_same(what: &str, text: &str) {
    let near = picture(&moved(text, [0.0; 3]));
    for scale in [1.0, 100.0] {
        let offset = SURVEY.map(|c| c * scale);
        same(&format!("{what} at {offset:?}"), &picture(&moved(text, offset)), &near);
    }
}

#[test]
fn shapes_and_all_lights() {
    stays_the_same("shapes", &format!("{CAMERA}{SHAPES}{SUN}"));
    for light in [
        "light \"omni\" { position @1 4 2 }",
        "light \"spot\" { position @1 4 2; target @0 0.5 0; inner 10; outer 25 }",
        "light \"disk\" { position @1 4 2; normal 0 -1 0; radius 0.5; points 16 }",
        "light \"sphere\" { center @1 4 2; radius 0.5; points 16 }",
        "light \"rectangle\" { corner @1 4 2; u 1 0 0; v 0 0 1; points 16 }",
        "light \"directional\" { direction -0.5 -1 -0.3; axis @0 0.5 0; radius 1.5 }",
    ] {
        stays_the_same(light, &format!("{CAMERA}{SHAPES}{light}"));
    }
}

#[test]
fn groups_instances_and_motion() {
    let placed = |placed: &str| format!("{CAMERA}{placed}{SUN}");
    let near = SHAPES.replace('@', "");
    // Coordinates become large by a transform, or a transform brings far coordinates back. Prototypes do both, too.
    stays_the_same("a group", &placed(&format!("group {{ translate @0 0 0|\n{near} }}\n")));
    stays_the_same(
        "an instance",
        &placed(&format!("prototype name=\"p\" {{ {near} }}\ninstance of=\"p\" {{ translate @0 0 0|\n }}\n")),
    );
    let back = format!("translate {} {} {}", -SURVEY[0], -SURVEY[1], -SURVEY[2]);
    let far = moved(SHAPES, SURVEY);
    let expected = picture(&moved(&placed(SHAPES), [0.0; 3]));
    let back_again = |text: String| picture(&moved(&placed(&text), [0.0; 3]));
    same("a group that comes back", &back_again(format!("group {{ {back}\n{far} }}\n")), &expected);
    let prototype = format!("prototype name=\"p\" {{ {far} }}\ninstance of=\"p\" {{ {back} }}\n");
    same("a prototype that comes back", &back_again(prototype), &expected);
    stays_the_same(
        "motion",
        &placed(&SHAPES.replacen("radius 0.5 }", "radius 0.5; motion { translate 0 0 0; translate 0 0.2 0 } }", 1)),
    );
}

/// Stairs, as OBJ.
fn steps(offset: [f64; 3]) -> String {
    let mut text = String::new();
    for i in 0..6 {
        let (y, z) = (0.17 * f64::from(i), -0.3 * f64::from(i));
        for [x, y, z] in [
            [-1.0, y, z],
            [1.0, y, z],
            [1.0, y + 0.17, z],
            [-1.0, y + 0.17, z],
            [1.0, y + 0.17, z - 0.3],
            [-1.0, y + 0.17, z - 0.3],
        ] {
            text += &format!("v {} {} {}\n", x + offset[0], y + offset[1], z + offset[2]);
        }
        let v = 6 * i;
        text += &format!("f {} {} {} {}\nf {} {} {} {}\n", v + 1, v + 2, v + 3, v + 4, v + 4, v + 3, v + 5, v + 6);
    }
    text
}

/// The stairs as PLY with doubles.
fn steps_ply(offset: [f64; 3]) -> Vec<u8> {
    steps_ply_of(offset, false)
}

fn steps_ply_of(offset: [f64; 3], single: bool) -> Vec<u8> {
    let kind = if single { "float" } else { "double" };
    let obj = steps(offset);
    let of = |kind: &str| -> Vec<Vec<f64>> {
        let lines = obj.lines().filter(|line| line.starts_with(kind));
        lines.map(|line| line[2..].split(' ').map(|n| n.parse().expect("a number")).collect()).collect()
    };
    let (vertices, faces) = (of("v "), of("f "));
    let mut out = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty {kind} x\nproperty {kind} y\nproperty {kind} z\n\
         element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        vertices.len(),
        faces.len()
    )
    .into_bytes();
    for n in vertices.iter().flatten() {
        if single {
            out.extend((*n as f32).to_le_bytes());
        } else {
            out.extend(n.to_le_bytes());
        }
    }
    for face in faces {
        out.push(face.len() as u8);
        face.iter().for_each(|n| out.extend((*n as i32 - 1).to_le_bytes()));
    }
    out
}

#[test]
fn meshes_from_files() {
    let with = |place: &str, offset: [f64; 3], scene_offset: [f64; 3]| {
        let text = moved(&format!("{CAMERA}{place}{SUN}"), scene_offset);
        picture_of(scene(&text, &[("s.obj", steps(offset).into_bytes()), ("s.ply", steps_ply(offset))]))
    };
    for file in ["s.obj", "s.ply"] {
        let mesh = format!("mesh file=\"{file}\" material=\"red\"\n");
        let expected = with(&mesh, [0.0; 3], [0.0; 3]);
        same(file, &with(&mesh, SURVEY, SURVEY), &expected);
        let placed = format!("mesh file=\"{file}\" material=\"red\" {{ translate @0 0 0|\n }}\n");
        same("placed far away", &with(&placed, [0.0; 3], SURVEY), &expected);
        let back = SURVEY.map(|c| (-c).to_string()).join(" ");
        let brought = format!("mesh file=\"{file}\" material=\"red\" {{ translate {back} }}\n");
        same("brought back", &with(&brought, SURVEY, [0.0; 3]), &expected);
        // The mesh is used twice, so that it stays an instance.
        let twice = format!("{mesh}mesh file=\"{file}\" {{ translate -1 0 1 }}\n");
        same("twice", &with(&twice, SURVEY, SURVEY), &with(&twice, [0.0; 3], [0.0; 3]));
    }
}

#[test]
fn single_precision_is_told_with_its_steps() {
    let ply = |offset: [f64; 3]| steps_ply_of(offset, true);
    let warnings = |offset| {
        import::load("s.ply", &MemoryAssets::new().with("s.ply", ply(offset)), &import::Staging::classic())
            .expect("a model")
            .1
    };
    assert!(warnings([0.0; 3]).to_string().is_empty());
    let told = warnings(SURVEY).to_string();
    assert!(told.contains("coordinates are single precision, which") && told.contains("steps of 0.25"), "{told}");
}

/// The warnings about precision.
fn of_precision(warnings: &canaletto_io::diagnostic::Diagnostics) -> String {
    let all = warnings.to_string();
    all.split("\n\n").filter(|warning| warning.contains("precision")).collect()
}

/// Warnings about single precision depend on its effect on clouds and meshes. Spheres smaller than its steps give one,
/// at any distance between them.
#[test]
fn clouds_of_single_precision_are_told_with_their_steps() {
    let rows = |offset: [f64; 3], apart: f64| {
        (0..200).map(move |i| [0, 1, 2].map(|axis| offset[axis] + apart * f64::from(i * [1, 0, 3][axis])))
    };
    let bin = |offset, apart, radius: f32| -> Vec<u8> {
        let numbers = rows(offset, apart).flat_map(|[x, y, z]| [x as f32, y as f32, z as f32, radius]);
        numbers.flat_map(f32::to_le_bytes).collect()
    };
    let cylinders = |offset, apart, radius: f32| -> Vec<u8> {
        let numbers = rows(offset, apart)
            .flat_map(|[x, y, z]| [x as f32, y as f32, z as f32, x as f32 + 8.0, y as f32, z as f32, radius]);
        numbers.flat_map(f32::to_le_bytes).collect()
    };
    let ply = |offset, apart, single: bool| -> Vec<u8> {
        let kind = if single { "float" } else { "double" };
        let mut out = format!(
            "ply\nformat binary_little_endian 1.0\nelement vertex 200\nproperty {kind} x\nproperty {kind} y\nproperty {kind} z\nend_header\n"
        )
        .into_bytes();
        for n in rows(offset, apart).flatten() {
            if single {
                out.extend((n as f32).to_le_bytes());
            } else {
                out.extend(n.to_le_bytes());
            }
        }
        out
    };
    let told = |node: &str, file: &str, bytes: Vec<u8>| {
        let assets = MemoryAssets::new().with(file, bytes);
        let text = format!("{CAMERA}{node} file=\"{file}\" {}", if file.ends_with(".ply") { "radius=0.5" } else { "" });
        of_precision(&read_scene_text(&text.replace('@', ""), "scene.kdl", &assets, &[]).expect("a scene").1)
    };
    for apart in [1.0, 300.0] {
        for (node, file, bytes) in [
            ("spheres", "c.bin", bin(SURVEY, apart, 0.5)),
            ("cylinders", "c.bin", cylinders(SURVEY, apart, 0.5)),
            ("spheres", "c.ply", ply(SURVEY, apart, true)),
        ] {
            let told = told(node, file, bytes);
            assert!(
                told.contains("coordinates are single precision, which") && told.contains("steps of 0.25"),
                "{told}"
            );
        }
        assert_eq!(told("spheres", "c.ply", ply(SURVEY, apart, false)), "");
        for (node, file, bytes) in [
            ("spheres", "c.bin", bin([0.0; 3], apart, 0.5)),
            ("cylinders", "c.bin", cylinders([0.0; 3], apart, 0.5)),
            ("spheres", "c.ply", ply([0.0; 3], apart, true)),
        ] {
            assert_eq!(told(node, file, bytes), "", "{node} {file} near zero");
        }
    }
    // Balls of this size lose nothing.
    assert_eq!(told("spheres", "c.bin", bin(SURVEY, 300.0, 50.0)), "");
}

/// Objects too far apart for an origin near all of them give a warning, whatever digits the file has.
#[test]
fn what_no_origin_is_near_to_is_told() {
    let apart = format!("v 0 0 0\n{}", steps(SURVEY));
    let warnings = |bytes: String| {
        import::load("s.obj", &MemoryAssets::new().with("s.obj", bytes), &import::Staging::classic())
            .expect("a model")
            .1
            .to_string()
    };
    assert!(warnings(apart.clone()).contains("rounded to single precision"), "{}", warnings(apart));
    assert_eq!(warnings(steps(SURVEY)), "");
    let points = |spread: f64| {
        let places: String = (0..50).map(|i| format!("{} 0 {} ", SURVEY[0] + 0.1, f64::from(i) * spread)).collect();
        let text = format!("spheres radius=0.1 {{ points {places} }}");
        of_precision(&read_scene_text(&text, "scene.kdl", &MemoryAssets::new(), &[]).expect("a scene").1)
    };
    assert_eq!(points(200.0), "");
    assert!(points(1e5).contains("rounded to single precision"), "{}", points(1e5));
}

#[test]
fn models_alone() {
    let alone = |name: &str, bytes: Vec<u8>| {
        let (mut scene, _) =
            import::load(name, &MemoryAssets::new().with(name, bytes), &import::Staging::classic()).expect("a model");
        (scene.views[0].intrinsics.width, scene.views[0].intrinsics.height) = (120, 90);
        picture_of(scene)
    };
    let expected = alone("s.obj", steps([0.0; 3]).into_bytes());
    same("obj", &alone("s.obj", steps(SURVEY).into_bytes()), &expected);
    same("ply", &alone("s.ply", steps_ply(SURVEY)), &alone("s.ply", steps_ply([0.0; 3])));
    let nff = |offset| {
        let text = "v\nfrom @3 2 6\nat @0 0.5 0\nup 0 1 0\nangle 40\nhither 1\nresolution 120 90\nl @4 6 5\nf 0.8 0.3 0.2 1 0 1 0 0\n\
                    s @0 0.5 0| 0.5\nc @1 0 0| 0.3 @1 1 0| 0.1\np 4\n@-3 0 -3\n@-3 0 3\n@3 0 3\n@3 0 -3\n";
        alone("s.nff", moved(text, offset).into_bytes())
    };
    same("nff", &nff(SURVEY), &nff([0.0; 3]));
}

#[test]
fn clouds_of_all_kinds() {
    let rows = ["@0 0.5 0", "@0.8 0.3 0.4", "@-0.9 0.2 1", "@0.2 1.2 -0.3"];
    let csv = |offset| rows.map(|row| moved(row, offset).replace(' ', ",")).join("\n").into_bytes();
    let with = |text: &str, offset| {
        picture_of(scene(&moved(&format!("{CAMERA}{text}{SUN}"), offset), &[("c.csv", csv(offset))]))
    };
    for text in [
        "spheres file=\"c.csv\" radius=0.3 material=\"red\"\n".to_owned(),
        format!("spheres radius=0.3 {{ points {} }}\n", rows.map(|row| format!("{row}|")).join(" ")),
        format!("spheres radius=0.3 {{ data \"\"\"\n{}\n\"\"\" }}\n", rows.join("\n")),
        format!("cylinders radius=0.2 {{ axes {} }}\n", rows.map(|row| format!("{row}|")).join(" ")),
    ] {
        same(&text, &with(&text, SURVEY), &with(&text, [0.0; 3]));
    }
}

#[test]
fn textures_of_space_stay_with_true_coordinates() {
    // The pattern moves along with its object.
    for space in ["object", "world"] {
        let text = format!(
            "{CAMERA}texture \"t\" kind=\"checker\" {{ even 0.1; odd 0.9 }}
material \"m\" {{ kd 1; texture \"t\" mapping=\"solid\" {{ space \"{space}\"; scale 0.25; translate @0.03 0.05 0.07| }} }}
sphere material=\"m\" {{ center @0 0.5 0; radius 0.5 }}
box material=\"m\" {{ min @0.6 0.01 1; max @1.2 0.6 1.4 }}
mesh file=\"s.obj\" material=\"m\"
{SUN}"
        );
        let at = |offset| picture_of(scene(&moved(&text, offset), &[("s.obj", steps(offset).into_bytes())]));
        same(space, &at(SURVEY), &at([0.0; 3]));
    }
}

#[test]
fn positions_and_explanations_are_those_of_the_scene() {
    let scene = scene(&moved(&format!("{CAMERA}{SHAPES}{SUN}"), SURVEY), &[]);
    let mut job = job(&scene, &scene.views[0]);
    job.aovs = vec![Aov::Position];
    let world = World::build(scene).expect("a world");
    let layer = &render(&world, &job, &()).expect("a picture").picture.layers[0];
    let at = |x: usize, y: usize, axis: usize| f64::from(layer.data[3 * (120 * y + x) + axis]);
    let tree = canaletto::explain::explain(&world, &job, 60, 45).expect("a tree");
    let canaletto::explain::Outcome::Hit(hit) = &tree.samples[0].ray.outcome else { panic!("nothing is met") };
    for (axis, place) in SURVEY.iter().enumerate() {
        let near = hit.point[axis] - place;
        assert!(near.abs() < 2.0, "{:?}", hit.point);
        // The layer is `f32`.
        assert!((at(60, 45, axis) - hit.point[axis]).abs() <= 0.25, "{:?}", hit.point);
    }
    let bounds = world.bounds();
    assert!((f64::from(bounds.min.z) - SURVEY[2]).abs() < 3.0, "{bounds:?}");
}

#[test]
fn near_zero_nothing_is_counted_from_elsewhere() {
    let near = |text: &str| World::build(scene(&moved(text, [0.0; 3]), &[])).expect("a world").origin();
    assert_eq!(near(&format!("{CAMERA}{SHAPES}")), glam::DVec3::ZERO);
    // The objects are small compared with their distance from zero, but not so small that rounding is visible.
    assert_eq!(
        near("camera { eye 0 0 900; center 0 0 899; fovy 60; size 8 8 }\nsphere { center 0 0 890; radius 2 }"),
        glam::DVec3::ZERO
    );
}
