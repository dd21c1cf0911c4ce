//! Invalid scenes with their expected messages, and hostile files, which cause a message and never a panic.
//!
//! The messages of each `crates/canaletto-io/tests/bad/*.kdl` are in a `.txt` beside it; `CANALETTO_BLESS=1` rewrites
//! them.

use canaletto::integrator::describe;
use canaletto::math::Rgb;
use canaletto::scene::{Content, Scene, Transfer};
use canaletto::texture::{ColorSpace, Filter, Function, Placement, TextureKind, Wrap};
use canaletto::world::World;
use canaletto_io::assets::{FolderAssets, MemoryAssets};
use canaletto_io::diagnostic::Diagnostics;
use canaletto_io::picture::{EncodeSettings, Image, PictureFormat};
use canaletto_io::text::{read_scene, read_scene_text, read_scene_with, reference_markdown};
use std::path::{Path, PathBuf};
use std::{fs, time::Instant};

fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn bless() -> bool {
    std::env::var_os("CANALETTO_BLESS").is_some()
}

fn text(text: &str) -> Result<(Scene, Diagnostics), Diagnostics> {
    read_scene_text(text, "scene.kdl", &MemoryAssets::new(), &[])
}

fn errors(scene: &str) -> String {
    text(scene).expect_err("mistakes").to_string()
}

/// The sorted scene files of a folder.
fn scenes(folder: &str) -> Vec<PathBuf> {
    let entries = fs::read_dir(repository().join(folder)).expect("the folder");
    let mut paths: Vec<PathBuf> = entries.map(|e| e.expect("an entry").path()).collect();
    paths.retain(|path| path.extension().is_some_and(|e| e == "kdl"));
    paths.sort();
    paths
}

#[test]
fn utf_16_is_named() {
    for order in [u16::to_le_bytes, u16::to_be_bytes] {
        for text in ["\u{feff}sphere { radius 1 }", "sphere { radius 1 }"] {
            let bytes: Vec<u8> = text.encode_utf16().flat_map(order).collect();
            let errors =
                read_scene("s.kdl", &MemoryAssets::new().with("s.kdl", bytes)).expect_err("a mistake").to_string();
            assert!(
                errors.starts_with("s.kdl:1:1: error: the file is UTF-16 text, but scene text is UTF-8"),
                "{errors}"
            );
        }
    }
}

#[test]
fn bad_scenes_get_their_messages() {
    let mut wrong = Vec::new();
    let assets =
        FolderAssets::new(repository().join("crates/canaletto-io/tests/bad")).expect("crates/canaletto-io/tests/bad");
    for path in scenes("crates/canaletto-io/tests/bad") {
        let file = path.file_name().and_then(|name| name.to_str()).expect("a name");
        let (good, shown) = match read_scene(file, &assets) {
            Ok((_, warnings)) => (true, warnings),
            Err(errors) => (false, errors),
        };
        assert_eq!(good, file.ends_with(".warning.kdl"), "{file}: {shown}");
        // Messages name files by the path through which they were opened.
        let folder = format!("{}/", repository().join("crates/canaletto-io/tests/bad").display());
        let normal = lexically_normal(&folder);
        let shown = shown.to_string().replace(&folder, "").replace(&normal, "");
        let expected = path.with_extension("txt");
        if bless() {
            fs::write(&expected, &shown).expect("written");
        } else if fs::read_to_string(&expected).unwrap_or_default() != shown {
            wrong.push(format!("--- {file}\n{shown}"));
        }
    }
    assert!(wrong.is_empty(), "other messages than expected (CANALETTO_BLESS=1 accepts them):\n{}", wrong.join("\n"));
}

fn lexically_normal(path: &str) -> String {
    let mut out = PathBuf::new();
    for part in Path::new(path).components() {
        if part.as_os_str() == ".." {
            out.pop();
        } else {
            out.push(part)
        }
    }
    format!("{}/", out.display())
}

#[test]
fn the_reference_is_the_schema() {
    let path = repository().join("docs/scene-text.md");
    if bless() {
        fs::write(&path, reference_markdown()).expect("written");
    }
    let committed = fs::read_to_string(&path).unwrap_or_default();
    assert!(committed == reference_markdown(), "docs/scene-text.md is old; CANALETTO_BLESS=1 writes it anew");
}

#[test]
fn examples_of_the_reference_are_right() {
    let reference = reference_markdown();
    let assets = MemoryAssets::new()
        .with("stage.kdl", "")
        .with("base.kdl", "")
        .with("bricks.png", png(2, 2))
        .with("slice-01.png", png(2, 2))
        .with("slice-02.png", png(2, 2))
        .with("cross.png", png(8, 6))
        .with("studio.png", png(4, 2))
        .with("bunny.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let faces = ["px", "nx", "py", "ny", "pz", "nz"];
    let assets = faces.iter().fold(assets, |assets, face| assets.with(&format!("{face}.png"), png(2, 2)));
    let base = "prototype \"lamp\" { sphere { center 0 0 0; radius 1 } }\nmaterial \"blue\"\n";
    let mut count = 0;
    for block in reference.split("```kdl\n").skip(1) {
        let example = block.split("```").next().expect("an end");
        let mut scene = base.to_owned();
        if example.contains("material \"blue\"") {
            scene = scene.replace("material \"blue\"\n", "");
        }
        if example.contains("group \"lamp\"") {
            scene.clear();
        }
        if example.contains("texture \"bricks\"") && !example.contains("texture \"bricks\" file") {
            scene += "texture \"bricks\" file=\"bricks.png\"\n";
        }
        scene += example;
        if let Err(errors) = read_scene_text(&scene, "example", &assets, &[]) {
            panic!("{errors}");
        }
        count += 1;
    }
    assert!(count > 20);
}

/// A small picture.
fn png(width: u32, height: u32) -> Vec<u8> {
    let pixels = (0..width * height).map(|i| [i as f32 / 8.0, 0.5, 1.0]);
    PictureFormat::Png
        .encode_image(&Image::from_rgb(width, height, pixels), Transfer::Srgb, &EncodeSettings::default(), &[])
        .expect("a picture")
}

#[test]
fn textures_of_one_file_share_its_image() {
    let assets = MemoryAssets::new().with("a/b.png", png(3, 2)).with("c.png", png(1, 1));
    let scene = "texture \"x\" file=\"a/b.png\" { wrap \"mirror\"; wrap-v \"black\"; texels \"edges\" }\n\
                 texture \"y\" file=\"a/../a/b.png\" { filter \"nearest\"; space \"raw\" }\n\
                 texture \"z\" file=\"c.png\"\nsphere { center 0 0 0; radius 1 }\nambient 1";
    let (scene, _) = read_scene_text(scene, "s", &assets, &["texture.z.wrap=\"clamp\"".into()]).expect("a scene");
    assert_eq!((scene.images.len(), scene.textures.len()), (2, 3));
    assert_eq!((scene.images[0].width, scene.images[0].height, scene.images[0].name.as_str()), (3, 2, "a/b.png"));
    let TextureKind::Image(x) = scene.textures[0].kind else { panic!() };
    let TextureKind::Image(y) = scene.textures[1].kind else { panic!() };
    let TextureKind::Image(z) = scene.textures[2].kind else { panic!() };
    assert_eq!((x.image, x.wrap, x.placement), (0, [Wrap::Mirror, Wrap::Black], Placement::Edges));
    assert_eq!((y.image, y.filter, y.space), (0, Filter::Nearest, Some(ColorSpace::Raw)));
    assert_eq!((z.image, z.wrap), (1, [Wrap::Clamp; 2]));
}

#[test]
fn grids_come_from_numbers_and_from_stacks() {
    let numbers: Vec<u8> = (0..24u16).flat_map(|i| (i * 1000).to_le_bytes()).collect();
    let assets = MemoryAssets::new().with("n.raw", numbers).with("s07.png", png(3, 2)).with("s08.png", png(3, 2));
    let scene = "texture \"x\" kind=\"grid\" file=\"n.raw\" { size 4 3 2; format \"u16\" }\n\
                 texture \"y\" kind=\"grid\" stack=\"s##.png\" { slices 7 8; space \"raw\" }\n\
                 texture \"z\" kind=\"wood\" { strength 0.1; octaves 3; seed 4; stops 0 1 0 0 1 0 0 1 }\n\
                 material \"m\" { texture \"y\" }\nsphere material=\"m\" { center 0 0 0; radius 1 }\nambient 1";
    let (scene, _) = read_scene_text(scene, "s", &assets, &[]).unwrap_or_else(|errors| panic!("{errors}"));
    let TextureKind::Grid(x) = scene.textures[0].kind else { panic!() };
    let TextureKind::Grid(y) = scene.textures[1].kind else { panic!() };
    assert_eq!((x.image, x.slices, y.image, y.slices), (0, 2, 1, 2));
    assert_eq!((scene.images[0].width, scene.images[0].height, scene.images[1].height), (4, 6, 4));
    assert!(scene.images.iter().all(|image| image.check().is_ok()));
    let TextureKind::Procedural(z) = &scene.textures[2].kind else { panic!() };
    assert!(z.seed == 4 && matches!(z.function, Function::Wood { strength: 0.1, .. }) && z.ramp.stops.len() == 2);
    canaletto::world::World::build(scene).expect("a world");
}

#[test]
fn the_chapters_scenes_are_right() {
    for path in scenes("scenes/chapter") {
        let (assets, file) = FolderAssets::beside(&path).expect("the folder");
        let (scene, warnings) = read_scene(&file, &assets).unwrap_or_else(|errors| panic!("{errors}"));
        let part = ["camera.kdl", "stage.kdl", "float.kdl", "textured.kdl"].contains(&file.as_str());
        assert!(part || warnings.is_empty(), "{warnings}");
        assert_eq!(scene.views.len(), 1, "{file}");
    }
}

#[test]
fn nesting_has_a_limit() {
    let start = Instant::now();
    let message = errors(&"group { ".repeat(200_000));
    assert!(message.starts_with("scene.kdl:1:1031: error: nested too deep"), "{message}");
    let message = errors(&"group { /- group { /-{ ".repeat(200_000));
    assert!(message.contains("nested too deep"), "{message}");
    assert!(start.elapsed().as_secs() < 10);
    let deep = format!("{}sphere {{ center 0 0 0; radius 1 }}{}", "group { ".repeat(127), " }".repeat(127));
    assert!(text(&deep).is_ok());
}

#[test]
fn a_file_that_is_not_text_says_where() {
    let assets = MemoryAssets::new().with("a.kdl", b"ambient 1\nsphere \xff\n".as_slice());
    let message = read_scene("a.kdl", &assets).unwrap_err().to_string();
    assert!(message.starts_with("a.kdl:2:8: error: the file isn't UTF-8 text: byte 17 is 0xff"), "{message}");
}

#[test]
fn missing_and_forbidden_files_say_so() {
    let message = read_scene("b.kdl", &MemoryAssets::new().with("a.kdl", "")).unwrap_err().to_string();
    assert_eq!(message, "b.kdl: error: there is no file \"b.kdl\"\n  help: did you mean \"a.kdl\"?\n");
    let message = read_scene("../b.kdl", &MemoryAssets::new()).unwrap_err().to_string();
    assert!(message.contains("lies outside the scene's folder") && message.contains("--allow-outside"), "{message}");
}

#[test]
fn a_hundred_thousand_spheres_are_read_in_linear_time() {
    let scene = |count: usize| {
        let mut text = String::from("material \"m\" { kd 1 0 0 }\nlight \"omni\" { position 0 9 0 }\n");
        for i in 0..count {
            text += &format!("sphere name=\"s{i}\" material=\"m\" {{ center {i} 0.5 -1e-3; radius 1 }}\n");
        }
        text
    };
    let time = |count| {
        let text = scene(count);
        let start = Instant::now();
        let (scene, _) = read_scene_text(&text, "s", &MemoryAssets::new(), &[]).expect("a scene");
        assert_eq!(scene.nodes.len(), count + 1);
        start.elapsed().as_secs_f64()
    };
    let (few, many) = (time(10_000).max(0.01), time(100_000));
    println!("10,000 spheres: {few:.3} s, 100,000: {many:.3} s");
    assert!(many < 40.0 * few, "{few} s for 10,000, {many} s for 100,000");
    // Many mistakes take time linear in their number, too.
    let bad = scene(20_000).replace("radius 1", "radius -1");
    let start = Instant::now();
    let messages = text(&bad).unwrap_err();
    assert_eq!((messages.len(), messages.errors()), (100, 20_000));
    assert!(messages.to_string().contains("there are 19900 more errors, which aren't listed"));
    assert!(start.elapsed().as_secs() < 20);
}

#[test]
fn values_may_stand_before_or_in_the_block() {
    let (a, _) = text("sphere radius=2 { center 1 2 3 }").unwrap();
    let (b, _) = text("sphere { radius 2\n center 1 2 3 }").unwrap();
    assert_eq!(a, b);
}

#[test]
fn transforms_happen_in_the_order_written() {
    let (scene, _) = text("sphere { center 1 0 0; radius 1; scale 2; rotate-z 90; translate 0 0 5 }").unwrap();
    let moved = scene.nodes[0].transform.point(glam::DVec3::X);
    assert!((moved - glam::DVec3::new(0.0, 2.0, 5.0)).length() < 1e-12, "{moved}");
    let (scene, _) = text("sphere rotate-y=90 { center 1 0 0; radius 1; matrix 1 0 0 7  0 1 0 8  0 0 1 9 }").unwrap();
    let moved = scene.nodes[0].transform.point(glam::DVec3::Z);
    assert!((moved - glam::DVec3::new(8.0, 8.0, 9.0)).length() < 1e-12, "{moved}");
}

#[test]
fn what_instances_repeat_moves_to_the_prototypes() {
    let (scene, _) = text(
        "instance of=\"lamp\" { translate 10 0 0 }\n\
         group { group name=\"lamp\" { translate 0 5 0; sphere { center 0 0 0; radius 1 } } }\n\
         prototype name=\"post\" { box { min 0 0 0; max 1 9 1 } }\n",
    )
    .unwrap();
    assert_eq!(scene.prototypes.len(), 2);
    assert_eq!(scene.prototypes[0].name.as_deref(), Some("lamp"));
    assert_eq!(scene.nodes.len(), 2);
    assert_eq!(scene.nodes[0].content, Content::Instance(0));
    let Content::Group(children) = &scene.nodes[1].content else { panic!("a group") };
    assert_eq!(children[0].content, Content::Instance(0));
    assert!(children[0].transform.is_identity());
}

#[test]
fn later_files_change_what_they_name() {
    let assets = MemoryAssets::new()
        .with("parts/base.kdl", "include \"cam.kdl\"\nambient 0.1\nfilm { tone \"scale\"; sample \"corner\" }\nsphere { center 0 0 0; radius 1 }")
        .with("parts/cam.kdl", "camera { eye 0 0 7; fovy 33 }")
        .with("a.kdl", "include \"parts/base.kdl\"\ninclude \"parts/cam.kdl\"\ncamera { fovy 44 }\nfilm { sample \"center\" }\nambient 0.2");
    let (scene, _) = read_scene("a.kdl", &assets).unwrap();
    assert_eq!((scene.views.len(), scene.views[0].intrinsics.fovy), (1, 44.0));
    assert_eq!(scene.views[0].extrinsics.eye.z, 7.0);
    assert_eq!(scene.film.tone, Some(canaletto::scene::Tone::Scale));
    assert_eq!(scene.film.sampling, canaletto::scene::Sampling::Center);
    assert_eq!(scene.ambient, canaletto::math::Rgb::gray(0.2));
}

#[test]
fn clouds_stand_in_nodes_texts_and_files() {
    let assets = MemoryAssets::new().with("p.csv", "0,0,0\n1,1,1\n");
    let scene = "spheres radius=1 { points 0 0 0  1 1 1 }\n\
        spheres { data \"\"\"\n  0 0 0 1 # first\n\n  1 1 1 2\n  \"\"\"\n}\n\
        spheres file=\"p.csv\" radius=3\n\
        cylinders caps=#false { data \"0 0 0 0 1 0 0.5 1 0 0\" }";
    let (scene, _) = read_scene_text(scene, "s", &assets, &[]).unwrap();
    let counts: Vec<(usize, Vec<f32>)> = scene.spheres.iter().map(|c| (c.centers.len(), c.radii.clone())).collect();
    assert_eq!(counts[0], (2, vec![1.0]));
    assert_eq!(counts[1], (2, vec![1.0, 2.0]));
    assert_eq!(counts[2].0, 2);
    assert_eq!((scene.cylinders[0].colors.len(), scene.cylinders[0].caps), (1, false));
}

#[test]
fn meshes_bring_their_materials() {
    let assets = MemoryAssets::new()
        .with("m/a.obj", "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl red\nf 1 2 3\n")
        .with("m/a.mtl", "newmtl red\nKd 1 0 0\n");
    let scene = "material \"own\"\nsphere material=\"own\" { center 0 0 0; radius 1 }\n\
        mesh file=\"m/a.obj\" one-sided=#true\nmesh file=\"m/a.obj\" one-sided=#true { translate 1 0 0 }\n\
        mesh file=\"m/a.obj\" { smooth }";
    let (scene, _) = read_scene_text(scene, "s", &assets, &[]).unwrap();
    assert_eq!(
        (scene.meshes.len(), scene.materials.len()),
        (2, 3),
        "the same file is read once for each way to read it"
    );
    assert_eq!(scene.materials[scene.meshes[0].materials[0] as usize].name, "red");
    assert!(scene.meshes[0].one_sided && scene.meshes[0].normals.is_empty());
    assert_eq!(scene.meshes[1].normals.len(), 3);
}

/// The names of a scene's objects by their numbers, from 1 on.
fn numbered(scene: Scene) -> Vec<String> {
    let world = World::build(scene).unwrap();
    (1..).map_while(|id| world.object_with_id(id)).map(|object| object.name.clone()).collect()
}

#[test]
fn objects_are_numbered_as_they_are_written() {
    let model = "v 0 0 0\nv 1 0 0\nv 0 1 0\no left\nf 1 2 3\no right\nusemtl b\nf 1 3 2\n";
    let assets = MemoryAssets::new()
        .with("m.obj", model)
        .with("more.kdl", "box name=\"included\" { min 0 0 0; max 1 1 1 }")
        .with("dust.csv", "0,0,0\n1,0,0\n");
    let scene = r#"
        camera { eye 0 0 5 }
        plane name="floor" { point 0 0 0; normal 0 1 0 }
        prototype name="pair" {
            light "omni" { position 0 9 0 }
            sphere name="low" { center 0 0 0; radius 1 }
            plane name="lid" { point 0 9 0; normal 0 1 0 }
        }
        instance of="pair" { translate 5 0 0 }
        spheres name="dust" file="dust.csv" radius=0.1
        group {
            mesh file="m.obj"
            light "omni" { position 0 9 0 }
            instance of="pair" { scale 1 2 1 }
            sphere name="inner" { center 0 0 0; radius 1 }
        }
        include "more.kdl"
        material "last"
        sphere { center 0 0 0; radius 1 }
    "#;
    let (scene, _) = read_scene_text(scene, "s.kdl", &assets, &[]).unwrap();
    let expected = ["floor", "low", "lid", "dust", "left", "right", "low", "lid", "inner", "included", "sphere #3"];
    assert_eq!(numbered(scene), expected);
}

#[test]
fn surfaces_that_emit_need_no_light() {
    let scene = |material: &str| {
        let object = "camera { eye 0 0 5 }\nsphere material=\"lamp\" { center 0 0 0; radius 1 }";
        text(&format!("texture \"t\" kind=\"checker\"\nmaterial \"lamp\" {{ {material} }}\n{object}")).unwrap()
    };
    let (read, warnings) = scene("kd 0; emission 17 12 4; two-sided #true");
    assert_eq!(warnings.to_string(), "");
    let lamp = &read.materials[0];
    assert_eq!((lamp.classic().kd, lamp.classic().emission), (Rgb::BLACK, Rgb::new(17.0, 12.0, 4.0)));
    assert!(lamp.two_sided && !scene("emission 3").0.materials[0].two_sided);
    assert_eq!(scene("emission 3").0.materials[0].classic().emission, Rgb::gray(3.0));
    assert_eq!(scene("texture \"t\" use=\"emission\" { range 0 5 }").1.to_string(), "");
    assert!(scene("kd 0.5").1.to_string().contains("the scene has no lights"));
}

/// The warning of a scene without lights is true: glass and mirrors show what is around them, and matte surfaces don't.
#[test]
fn what_is_black_without_lights_is_told() {
    const ALL: &str = "so everything in it is black";
    const SOME: &str = "so surfaces that only reflect light are black";
    let clear = "material \"m\" { kd 0; opacity 0; eta \"glass\" }";
    let (mirror, matte) = ("material \"m\" { k 0.5 }", "material \"m\" { kd 0.5 }");
    let holes = "material \"m\" { coverage 0.5 }";
    let print = "texture \"t\" kind=\"checker\"\nmaterial \"m\" { texture \"t\" use=\"decal\" }";
    let floor = "plane { point 0 -1 0; normal 0 1 0 }";
    let room = "group material=\"m\" { box { min -1 -1 -1; max 1 0 1 } }";
    let repeated = "prototype \"p\" { sphere { center 0 3 0; radius 1 } }\ninstance \"p\" material=\"m\"";
    for (text_of_scene, expected) in [
        (matte.to_owned(), Some(ALL)),
        (format!("{matte}\nbackground 1"), Some(ALL)),
        (clear.to_owned(), Some(ALL)),
        (format!("{clear}\nbackground 1"), None),
        (format!("{clear}\nbackground 1\nintegrator {{ stage \"reflection\" }}"), Some(ALL)),
        (format!("{mirror}\nbackground 1\nintegrator {{ stage \"reflection\" }}"), None),
        (format!("{mirror}\nenvironment \"gradient\" {{ stops 0 1 1 1 90 1 1 1 }}"), None),
        (format!("{holes}\nbackground 1\n{room}\n{repeated}"), None),
        (format!("{clear}\nbackground 1\n{floor}"), Some(SOME)),
        (print.to_owned(), None),
        (format!("{print}\n{floor}"), Some(SOME)),
        (format!("{print}\n{floor}\nambient 0.1"), None),
        (format!("material \"m\" {{ emission 1 }}\n{floor}"), None),
        (format!("integrator \"path\"\n{matte}"), Some(ALL)),
        (format!("integrator \"path\"\nambient 0.5\n{clear}\n{floor}"), Some(ALL)),
        (format!("integrator \"path\"\n{matte}\nbackground 1"), None),
        (format!("integrator \"path\"\n{matte}\nenvironment \"gradient\" {{ stops 0 1 1 1 90 1 1 1 }}"), None),
        (format!("integrator \"path\"\nmaterial \"m\" {{ emission 1 }}\n{floor}"), None),
    ] {
        let sphere = "camera { eye 0 0 5 }\nsphere material=\"m\" { center 0 0 0; radius 1 }";
        let warnings = text(&format!("{text_of_scene}\n{sphere}")).unwrap().1.to_string();
        match expected {
            Some(words) => assert!(warnings.contains(words), "{text_of_scene}: {warnings}"),
            None => assert_eq!(warnings, "", "{text_of_scene}"),
        }
    }
}

#[test]
fn values_can_be_set() {
    let scene = "material \"glass\" { kd 1 0 0; eta 1.2 }\nsphere material=\"glass\" name=\"ball\" radius=1 { center 0 0 0 }\n\
        camera { eye 0 0 5 }\ncamera \"b\" { eye 0 5 0; up 0 0 1 }\ngroup { light \"omni\" name=\"key\" { position 0 9 0 } }";
    let set = |assignments: &[&str]| {
        let set: Vec<String> = assignments.iter().map(|a| (*a).to_owned()).collect();
        read_scene_text(scene, "scene.kdl", &MemoryAssets::new(), &set)
    };
    let (changed, _) = set(&[
        "material.glass.eta=1.4",
        "integrator.max-depth = 3",
        "integrator.shadows=false",
        "camera.fovy=50",
        "film.sample=\"jittered\" n=2",
        "light.key.intensity=1 0.5 0",
        "sphere.ball.radius=7",
        "background=0.5",
        "film.tone=scale",
    ])
    .unwrap_or_else(|errors| panic!("{errors}"));
    assert_eq!(changed.materials[0].classic().eta, 1.4);
    assert_eq!((describe(&changed.integrator).max_depth(), describe(&changed.integrator).has_shadows()), (3, false));
    assert!(changed.views.iter().all(|view| view.intrinsics.fovy == 50.0));
    assert_eq!(changed.film.sampling, canaletto::scene::Sampling::Jittered(2));
    assert_eq!(changed.background, canaletto::math::Rgb::gray(0.5));
    let errors = set(&[
        "material.glas.eta=1",
        "camera.fovy=big",
        "nonsense=1",
        "integrator.depth=3",
        "film.tone",
        "film.tone=",
        "light.key.intensity=1 x.y/z",
    ])
    .unwrap_err()
    .to_string();
    for part in [
        "--set:1:10: error: there is no material called \"glas\"",
        "--set:2:13: error: fovy takes a number, got the text \"big\"",
        "--set:3:1: error: there is nothing called nonsense to set",
        "--set:4:12: error: integrator has no \"depth\"",
        "--set:5:1: error: this sets nothing: an = is missing",
        "--set:6:10: error: a value is missing after tone=",
        "--set:7:23: error: ",
    ] {
        assert!(errors.contains(part), "{part}\n{errors}");
    }
    assert_eq!(errors.matches("error:").count(), 7, "{errors}");
    let (scene, _) = read_scene_with("a", &MemoryAssets::new().with("a", scene), &[]).unwrap();
    assert_eq!(scene.views.len(), 2);
}

mod random {
    use super::*;
    use proptest::prelude::*;
    use proptest::test_runner::RngSeed;

    fn good() -> Vec<String> {
        let mut all: Vec<String> = reference_markdown()
            .split("```kdl\n")
            .skip(1)
            .map(|block| block.split("```").next().unwrap_or_default().to_owned())
            .collect();
        for folder in ["crates/canaletto-io/tests/bad", "scenes/chapter"] {
            all.extend(scenes(folder).iter().map(|path| fs::read_to_string(path).expect("a file")));
        }
        all.push(all.concat());
        all
    }

    proptest! {
        #![proptest_config(ProptestConfig {
            cases: 1000,
            failure_persistence: None,
            rng_seed: RngSeed::Fixed(1),
            ..ProptestConfig::default()
        })]

        /// Every text yields a scene or messages, and both can be displayed.
        #[test]
        fn changed_scenes_never_panic(
            which in any::<prop::sample::Index>(),
            edits in prop::collection::vec((any::<prop::sample::Index>(), 0usize..4, prop_oneof![
                any::<u8>().prop_map(|b| vec![b]),
                prop::sample::select(vec!["{", "}", "\"", "#", "/-", "\"\"\"", "\\", "=", "(", "\n", " ", "1e999", "-", "é", "#nan", ".", "0"])
                    .prop_map(|s| s.as_bytes().to_vec()),
            ]), 1..12),
            set in "(material|camera|light|film|integrator|sphere)(\\.[a-z]{1,8}){0,2}=?[ -~é]{0,8}",
        ) {
            let all = good();
            let mut bytes = which.get(&all).clone().into_bytes();
            for (at, removed, inserted) in edits {
                let at = at.index(bytes.len() + 1);
                bytes.splice(at..(at + removed).min(bytes.len()), inserted);
            }
            let assets = MemoryAssets::new().with("a.kdl", bytes).with("stage.kdl", "include \"a.kdl\"").with("m.csv", "1 2 3");
            let shown = match read_scene_with("a.kdl", &assets, &[set]) {
                Ok((_, warnings)) => warnings,
                Err(errors) => {
                    prop_assert!(errors.has_errors());
                    errors
                }
            };
            let _ = shown.to_string();
            let _ = serde_json::to_string(&shown).expect("JSON");
        }
    }
}

/// Setting a word replaces the words that it excludes.
#[test]
fn setting_a_word_takes_away_the_one_that_it_excludes() {
    let text = r#"
        camera { eye 0 0 9; size 8 8 }
        film { sample "regular" }
        light "disk" { position 0 9 0; normal 0 -1 0; radius 1; points 16 }
        light "spot" name="s" { position 0 9 0; target 0 0 0; inner 10; outer 20 }
        material "m" { dielectric 1.5; alpha 0.2 }
        sphere material="m" { center 0 0 0; radius 1 }
    "#;
    for set in [
        &["light.samples=4", "film.samples=9"][..],
        &["film.samples=9", "film.sample=\"jittered\""],
        &["light.s.exponent=3"],
        &["material.m.roughness=0.5", "material.m.alpha=0.1"],
    ] {
        let set: Vec<String> = set.iter().map(|set| (*set).into()).collect();
        // `light.samples` applies only to area lights.
        let text = if set[0] == "light.samples=4" { text.replace("light \"spot\"", "// ") } else { text.into() };
        if let Err(errors) = read_scene_text(&text, "s", &MemoryAssets::new(), &set) {
            panic!("{set:?}: {errors}");
        }
    }
}
