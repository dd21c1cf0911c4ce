//! Paths reach every word, and mistakes in them are told.

use crate::assets::MemoryAssets;
use crate::text::nodes::{self, ENVIRONMENTS, INCLUDE, LIGHTS, OBJECTS, SETTINGS, TEXTURES};
use crate::text::schema::{NodeSchema, ValueType};
use crate::text::syntax::Node;
use crate::text::{SceneDocument, read_scene_text};
use canaletto::material::TextureUse;
use canaletto::scene::{
    Aperture, CameraProjection, Integrator, Lens, Scene, ShadowMethod, WhittedSettings, ZbufferSettings,
};
use glam::DVec3;

const SCENE: &str = "camera { eye 0 0 9; size 8 8 }\nintegrator \"whitted\" { max-depth 3; shadows #false }\n\
    sphere { center 0 0 0; radius 1 }\nlight \"omni\" { position 1 2 3 }\n";

fn set(set: &[&str]) -> Result<Integrator, String> {
    let set: Vec<String> = set.iter().map(|set| (*set).to_owned()).collect();
    let read = read_scene_text(SCENE, "s", &MemoryAssets::new(), &set);
    read.map(|(scene, _)| scene.integrator).map_err(|mistakes| mistakes.to_string())
}

#[test]
fn another_integrator_starts_with_its_defaults() {
    let flat = ZbufferSettings { shadows: ShadowMethod::None, ..ZbufferSettings::DEFAULT };
    assert_eq!(set(&["integrator=zbuffer"]), Ok(ZbufferSettings::DEFAULT.into()));
    // The choice of the integrator acts first, wherever it stands.
    assert_eq!(set(&["integrator=zbuffer", "integrator.shadows=none"]), Ok(flat.into()));
    assert_eq!(set(&["integrator.shadows=none", "integrator=\"zbuffer\""]), Ok(flat.into()));
    // The last choice decides.
    assert_eq!(set(&["integrator=radiosity", "integrator=zbuffer"]), Ok(ZbufferSettings::DEFAULT.into()));
    // The scene's own settings stay where its integrator is named again.
    let own = WhittedSettings { max_depth: 3, shadows: false, ..WhittedSettings::DEFAULT };
    assert_eq!(set(&["integrator=whitted"]), Ok(own.into()));
    assert_eq!(set(&["integrator.max-depth=4"]), Ok(WhittedSettings { max_depth: 4, ..own }.into()));
}

/// The coverage of a material and the absorption of its medium.
fn surface(material: &str, set: &str) -> Result<(f32, f32), String> {
    let text = format!("{SCENE}material \"m\" {{ {material} }}\nbox material=\"m\" {{ min 0 0 0; max 1 1 1 }}\n");
    let read = read_scene_text(&text, "s", &MemoryAssets::new(), &[set.to_owned()]);
    let (scene, _) = read.map_err(|mistakes| mistakes.to_string())?;
    let material = scene.materials.iter().find(|material| material.name == "m").unwrap();
    Ok((material.coverage, material.medium.absorption.to_array()[0]))
}

#[test]
fn what_a_block_says_too_is_replaced_there() {
    for scene in ["standard { opacity 0.5 }", "standard opacity=0.5", "coverage 0.5; standard", "standard"] {
        assert_eq!(surface(scene, "material.m.coverage=0.25"), Ok((0.25, 0.0)), "{scene}");
    }
    for scene in ["coverage 0.5; standard", "standard { opacity 0.5 }", "coverage 0.5", ""] {
        assert_eq!(surface(scene, "material.m.standard=opacity=0.25"), Ok((0.25, 0.0)), "{scene}");
    }
    // What the new block doesn't say stays beside it.
    assert_eq!(surface("coverage 0.5", "material.m.standard=thin-walled=#true"), Ok((0.5, 0.0)));
    for scene in ["medium { absorption 0.5 }", "medium { absorption 0.5; scattering 1 }", "medium { scattering 1 }"] {
        assert_eq!(surface(scene, "material.m.absorption=0.25"), Ok((1.0, 0.25)), "{scene}");
    }
    assert_eq!(surface("dielectric 1.5; absorption 1", "material.m.medium=absorption=0.25"), Ok((1.0, 0.25)));
    let told = surface("standard { opacity 0.5 }", "material.m.coverage=3").unwrap_err();
    assert!(told.contains("--set:1") && told.contains("must be between 0"), "{told}");
    let told = surface("coverage 0.5; standard { opacity 0.5 }", "material.m.kd=1").unwrap_err();
    assert!(told.contains("given twice"), "{told}");
}

#[test]
fn wrong_integrators_are_told() {
    for (assignments, words) in [
        (&["integrator=zbufer"][..], "did you mean \"zbuffer\"?"),
        (&["integrator=zbuffer", "integrator.max-depth=3"], "the integrator \"zbuffer\" has no max-depth"),
        (&["integrator.shadows=map"], "the integrator \"whitted\" takes #true or #false"),
        (&["integrator=zbuffer extra"], "integrator"),
    ] {
        let told = set(assignments).unwrap_err();
        assert!(told.contains(words) && told.contains("--set"), "{assignments:?}: {told}");
    }
}

fn scene_with(text: &str, set: &[&str]) -> Result<Scene, String> {
    let set: Vec<String> = set.iter().map(|set| (*set).to_owned()).collect();
    let read = read_scene_text(text, "s", &MemoryAssets::new(), &set);
    read.map(|(scene, _)| scene).map_err(|mistakes| mistakes.to_string())
}

/// A value of a type, as text.
fn value_of(value_type: ValueType) -> String {
    match value_type {
        ValueType::Numbers(counts) => vec!["1"; counts[0]].join(" "),
        ValueType::Rgb | ValueType::Count => "1".into(),
        ValueType::Counts(n) | ValueType::Many(n) => vec!["1"; n].join(" "),
        ValueType::Flag => "#true".into(),
        ValueType::FlagOrKeyword(words) | ValueType::Keyword(words) | ValueType::NumberOrKeyword(words) => {
            words[0].into()
        }
        ValueType::Text => "other".into(),
        ValueType::Node(_) => unreachable!("blocks are walked"),
    }
}

/// The paths of all fields of a node of this schema, through its blocks, with a value for each.
fn paths(schema: &'static NodeSchema, before: &[&'static str], all: &mut Vec<(Vec<&'static str>, String)>) {
    for field in nodes::allowed(schema).into_iter().filter_map(|word| nodes::field(schema, word)) {
        let path = [before, &[field.name]].concat();
        match field.value_type {
            ValueType::Node(block) => {
                if let Some(argument) = block.argument {
                    all.push((path.clone(), value_of(argument.value_type)));
                }
                paths(block, &path, all);
            }
            value_type => all.push((path, value_of(value_type))),
        }
    }
}

/// Whether nodes that stand in each other have these names, and the last one was set.
fn is_set(nodes: &[Node], path: &[&str], set_file: u16) -> bool {
    let [first, rest @ ..] = path else { return false };
    let mut named = nodes.iter().filter(|node| &*node.name == *first);
    named.any(
        |node| if rest.is_empty() { node.name_span.file == set_file } else { is_set(&node.children, rest, set_file) },
    )
}

/// Each word of the reference, also in blocks in blocks, can be set where the block is there and where it isn't.
#[test]
fn every_word_of_the_reference_can_be_set() {
    let tops = SETTINGS.iter().map(|setting| setting.schema).filter(|schema| schema.name != INCLUDE.name);
    let tops = tops
        .chain(OBJECTS.iter().map(|object| &object.schema))
        .chain(LIGHTS.iter().map(|light| &light.schema))
        .chain(ENVIRONMENTS.iter().map(|environment| &environment.schema))
        .chain(TEXTURES.iter().map(|texture| &texture.schema));
    let (mut count, mut deepest, mut wrong) = (0, 0, Vec::new());
    for schema in tops {
        let mut all = Vec::new();
        paths(schema, &[], &mut all);
        for (path, value) in all {
            let assignment = format!("{}.{}={value}", schema.name, path.join("."));
            let read =
                SceneDocument::of_text(schema.example, "s", &MemoryAssets::new(), std::slice::from_ref(&assignment));
            let whole = [&[schema.name], &path[..]].concat();
            // The scene's text is file 0 and the assignments are file 1.
            if !read.is_ok_and(|document| is_set(&document.nodes, &whole, 1) && !document.report.has_errors()) {
                wrong.push(assignment);
            }
            (count, deepest) = (count + 1, deepest.max(path.len()));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(count > 900 && deepest == 4, "{count} words, {deepest} deep");
}

#[test]
fn blocks_are_made_and_changed() {
    let material = |text: &str, set: &[&str]| {
        let text = format!("{SCENE}material \"gold\" {{ {text} }}\nbox material=\"gold\" {{ min 0 0 0; max 1 1 1 }}");
        let scene = scene_with(&text, set)?;
        let gold = scene.materials.iter().find(|material| material.name == "gold").unwrap();
        Ok::<_, String>(gold.standard().copied().unwrap_or_default())
    };
    for text in ["", "standard", "standard { specular { weight 0.5 } }", "standard preset=\"gold\""] {
        for path in ["material.gold.standard.specular.roughness=0.4", "material.standard.specular.roughness=0.4"] {
            assert_eq!(material(text, &[path]).unwrap().specular.roughness, 0.4, "{text} {path}");
        }
    }
    let kept = material("standard { specular { weight 0.5 } }", &["material.gold.standard.specular.roughness=0.4"]);
    assert_eq!(kept.unwrap().specular.weight, 0.5);
    let gold = material("standard", &["material.gold.standard.preset=gold"]).unwrap();
    assert_eq!(gold.base.metalness, 1.0);

    let lens = |text: &str, set: &[&str]| Ok::<_, String>(scene_with(text, set)?.views[0].intrinsics.lens);
    let camera = "camera \"lens\" { eye 0 0 9 }\ncamera \"b\" { eye 0 0 9 }\nsphere { center 0 0 0; radius 1 }";
    // A camera may have the name of a block.
    let told = lens(camera, &["camera.lens.radius=0.5"]).unwrap_err();
    assert!(told.contains("radius"), "{told}");
    let radius = |lens: Result<Option<Lens>, String>| lens.unwrap().map(|lens| lens.aperture);
    assert_eq!(radius(lens(camera, &["camera.lens.lens.radius=0.5"])), Some(Aperture::Radius(0.5)));
    assert_eq!(radius(lens(SCENE, &["camera.lens.radius=0.5"])), Some(Aperture::Radius(0.5)));
}

#[test]
fn the_fitted_camera_of_a_scene_without_one_is_changed() {
    let text = "sphere { center 10 0 0; radius 1 }\nlight \"omni\" { position 1 2 3 }";
    let fitted = scene_with(text, &[]).unwrap().views;
    let set = scene_with(text, &["camera.fovy=50", "camera.size=40 30"]).unwrap().views;
    let mut expected = fitted.clone();
    (expected[0].intrinsics.fovy, expected[0].intrinsics.width, expected[0].intrinsics.height) = (50.0, 40, 30);
    assert_eq!(set, expected);
    assert_ne!(fitted, expected);
}

/// A camera says once how rays leave it, in its file or by a setting.
#[test]
fn a_camera_is_orthographic_or_has_an_angle() {
    let ball = "sphere { center 10 0 0; radius 1 }\nlight \"omni\" { position 1 2 3 }";
    let projection = |text: &str, set: &[&str]| {
        scene_with(&format!("{text}\n{ball}"), set).map(|scene| scene.views[0].intrinsics.projection)
    };
    let flat = |height: f64| Ok(CameraProjection::Orthographic { height });
    assert_eq!(projection("camera { orthographic 4 }", &[]), flat(4.0));
    assert_eq!(projection("", &["camera.orthographic=3"]), flat(3.0));
    assert_eq!(projection("camera { orthographic 4 }", &["camera.orthographic=2.5"]), flat(2.5));
    assert_eq!(projection("camera { fovy 40 }", &[]), Ok(CameraProjection::Perspective));
    for (text, set) in
        [("camera { orthographic 4 }", "camera.fovy=40"), ("camera { fovy 40 }", "camera.orthographic=4")]
    {
        let problem = projection(text, &[set]).unwrap_err();
        assert!(problem.contains("camera has either fovy or orthographic"), "{problem}");
    }
}

fn textures_of_m(scene: &Scene) -> Vec<TextureUse> {
    scene.materials.iter().find(|material| material.name == "m").unwrap().textures.clone()
}

#[test]
fn blocks_are_chosen_by_their_names() {
    let text = "texture \"a\" kind=\"checker\"\ntexture \"b\" kind=\"noise\"\nmaterial \"m\" { texture \"a\"; texture \"b\" use=\"bump\" \
        height=1 }\n\
        sphere material=\"m\" { center 0 0 0; radius 1 }";
    let uses = |set: &[&str]| scene_with(&format!("{SCENE}{text}"), set).map(|scene| textures_of_m(&scene));
    let (before, after) = (uses(&[]).unwrap(), uses(&["material.m.texture.b.height=2"]).unwrap());
    assert_eq!((before.len(), after.len()), (2, 2));
    assert_eq!(before[0], after[0]);
    assert_ne!(before[1], after[1]);
    let made = uses(&["material.m.texture.c.repeat=2"]).unwrap_err();
    assert!(made.contains("texture has no c"), "{made}");
}

#[test]
fn keys_are_set() {
    let text = format!("{SCENE}sphere \"ball\" {{ center {{ key 1  0 0 0; key 9  8 0 0 }}; radius 1 }}");
    let at = |set: &[&str]| {
        let set: Vec<String> = set.iter().map(|set| (*set).to_owned()).collect();
        let mut document = SceneDocument::of_text(&text, "s", &MemoryAssets::new(), &set).map_err(|e| e.to_string())?;
        let scene = crate::source::SceneSource::scene(&mut document, &MemoryAssets::new(), 5.0);
        let (scene, _) = scene.map_err(|mistakes| mistakes.to_string())?;
        let place = scene.nodes.iter().find(|node| node.name.as_deref() == Some("ball")).unwrap();
        let canaletto::scene::Content::Shape(canaletto::shape::Shape::Sphere(sphere)) = &place.content else {
            panic!()
        };
        Ok::<_, String>(place.transform.point(sphere.center.as_dvec3()))
    };
    assert_eq!(at(&[]), Ok(DVec3::new(4.0, 0.0, 0.0)));
    assert_eq!(at(&["sphere.ball.center.key.9=2 0 0"]), Ok(DVec3::new(1.0, 0.0, 0.0)));
    assert_eq!(at(&["sphere.ball.center.key.5=3 1 0"]), Ok(DVec3::new(3.0, 1.0, 0.0)));
    assert_eq!(at(&["sphere.ball.center=7 7 7"]), Ok(DVec3::splat(7.0)));
    let told = at(&["sphere.ball.center.key.x=1 1 1"]).unwrap_err();
    assert!(told.contains("key takes its time"), "{told}");
}

#[test]
fn numbers_in_repeats_are_set() {
    let text = format!("{SCENE}repeat 3 {{ let x=\"i*2\"; sphere {{ center \"x\" 0 0; radius 0.1 }} }}");
    let count = |set: &[&str]| scene_with(&text, set).map(|scene| scene.nodes.len());
    let three = count(&[]).unwrap();
    assert_eq!(count(&["repeat.i=5"]), Ok(three + 2));
    assert_eq!(count(&["let.x=4"]), Ok(three));
    let told = count(&["repeat.j=5"]).unwrap_err();
    assert!(told.contains("no index of a repeat is called \"j\""), "{told}");
}

#[test]
fn wrong_paths_are_told() {
    let text = format!("{SCENE}material \"m\" {{ standard }}\nsphere material=\"m\" {{ center 0 0 0; radius 1 }}");
    for (assignment, words) in [
        ("material.m.standrd.specular.roughness=1", "did you mean standard?"),
        ("material.m.standard.speculr.roughness=1", "did you mean specular?"),
        ("material.m.standard.specular.roughnes=1", "roughness"),
        ("material.n.standard.specular.roughness=1", "there are: m"),
        ("material.m.kd.specular=1", "kd has values, and no specular in it"),
        ("integrator.max-depth.x=1", "max-depth has values"),
        ("background.red=1", "leads to nothing"),
        ("film.filtr.sigma=1", "did you mean filter?"),
        ("environment.sun.x=1", "environment"),
    ] {
        let told = scene_with(&text, &[assignment]).unwrap_err();
        assert!(told.contains(words) && told.contains("--set:1"), "{assignment}: {told}");
    }
}
