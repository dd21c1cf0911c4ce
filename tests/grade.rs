//! Grades of pictures that a student's ray tracer (`support/student.rs`) makes with planted mistakes, and without. The
//! table of the book's page is checked (`CANALETTO_BLESS=1` writes it again).

use canaletto::Named;
use canaletto::camera::Camera;
use canaletto::film::develop;
use canaletto::grade::{Grade, Mistake, Remark, StudentPicture, Task, Verdict, grade};
use canaletto::light::{Directional, Light, LightKind, Omni};
use canaletto::material::Phong;
use canaletto::math::Rgb;
use canaletto::render::{Job, render};
use canaletto::scene::Content;
use canaletto::scene::{Sampling, Scene, Stage};
use canaletto::shape::{Shape, Sphere};
use canaletto::world::World;
use canaletto_io::assets::FolderAssets;
use canaletto_io::text::read_scene;
use canaletto_tests::student::{Planted, SplatFilter, StudentTracer};
use canaletto_tests::{clamped, root};
use rayon::prelude::*;

/// The size of all pictures.
const SIZE: [u32; 2] = [80, 64];

const BOX: &str = "scenes/chapter/box-5.4.kdl";
const SHADOW: &str = "scenes/chapter/fig-5.23b-shadow.kdl";
const MIRROR: &str = "scenes/chapter/fig-5.26b-mirror.kdl";
const GLASS: &str = "scenes/chapter/fig-5.27b-glass.kdl";
const ROOM: &str = "tests/scenes/grade-room.kdl";
const LAMP: &str = "tests/scenes/grade-lamp.kdl";
const YARD: &str = "tests/scenes/grade-yard.kdl";
const DESK: &str = "tests/scenes/grade-desk.kdl";

fn scene(path: &str) -> Scene {
    sized(path, SIZE)
}

fn sized(path: &str, [width, height]: [u32; 2]) -> Scene {
    let path = root().join(path);
    let assets = FolderAssets::new(path.parent().unwrap()).unwrap();
    let (mut scene, _) = read_scene(path.file_name().unwrap().to_str().unwrap(), &assets).unwrap();
    [scene.views[0].intrinsics.width, scene.views[0].intrinsics.height] = [width, height];
    scene
}

fn job(scene: &Scene) -> Job {
    Job::new(Camera::of(&scene.views[0]).unwrap(), scene.film, scene.integrator)
}

fn graded(scene: &Scene, pixels: Vec<[f32; 3]>, tolerance: f64) -> Grade {
    let [width, height] = [scene.views[0].intrinsics.width, scene.views[0].intrinsics.height];
    let student = StudentPicture { width, height, pixels, tolerance };
    let (world, job) = (World::build(scene.clone()).unwrap(), job(scene));
    grade(Task { scene, view: &scene.views[0], world: &world, job: &job }, &student, &()).unwrap()
}

fn values(bytes: &[[u8; 3]]) -> Vec<[f32; 3]> {
    bytes.iter().map(|pixel| pixel.map(|v| f32::from(v) / 255.0)).collect()
}

fn student(path: &str, stage: Stage, planted: Option<Planted>, rays: u32) -> Grade {
    let scene = scene(path);
    let picture = StudentTracer::new(&scene, stage, planted).picture(SIZE, rays);
    graded(&scene, values(&picture), StudentPicture::ROUNDED)
}

/// What a picture should be graded as.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Expected {
    Mistake(Mistake),
    /// A picture of an earlier stage.
    Stage(Stage),
    /// A right picture with a remark.
    Remark(Remark),
}

use Expected::Mistake as Wrong;

/// Planted mistakes: the scene, the stage up to which the program is finished, the mistake, and its name.
const PLANTED: &[(&str, Stage, Planted, Expected)] = &[
    (BOX, Stage::Full, Planted::UpsideDown, Wrong(Mistake::UpsideDown)),
    (BOX, Stage::Full, Planted::ColumnsReversed, Wrong(Mistake::Mirrored)),
    (BOX, Stage::Full, Planted::OtherPlace, Expected::Remark(Remark::Centers)),
    (BOX, Stage::Full, Planted::TangentOfFovy, Wrong(Mistake::WholeAngle)),
    (BOX, Stage::Full, Planted::SquareWindow, Wrong(Mistake::SquareWindow)),
    (BOX, Stage::Full, Planted::LastObjectWins, Wrong(Mistake::NotNearest)),
    (BOX, Stage::Full, Planted::FarthestWins, Wrong(Mistake::NotNearest)),
    (BOX, Stage::Full, Planted::ExtraGamma, Wrong(Mistake::Gamma)),
    (GLASS, Stage::Full, Planted::BlueGreenRed, Wrong(Mistake::SwappedChannels)),
    (BOX, Stage::Full, Planted::ByteOverflow, Wrong(Mistake::Overflow)),
    (BOX, Stage::Full, Planted::NoBackground, Wrong(Mistake::BlackBackground)),
    (BOX, Stage::Full, Planted::NoAmbient, Wrong(Mistake::NoAmbient)),
    (GLASS, Stage::Full, Planted::AmbientWithoutKd, Wrong(Mistake::AmbientWithoutKd)),
    (ROOM, Stage::Full, Planted::AmbientForEachLight, Wrong(Mistake::AmbientPerLight)),
    (BOX, Stage::Full, Planted::NoDiffuse, Wrong(Mistake::NoDiffuse)),
    (BOX, Stage::Specular, Planted::NoMax, Wrong(Mistake::MissingMax)),
    (BOX, Stage::Full, Planted::NoMax, Wrong(Mistake::MissingMax)),
    (BOX, Stage::Full, Planted::AbsoluteValue, Wrong(Mistake::AbsoluteCosine)),
    (BOX, Stage::Full, Planted::LongLightVector, Wrong(Mistake::LightNotNormalised)),
    (BOX, Stage::Specular, Planted::LightVectorReversed, Wrong(Mistake::LightReversed)),
    (MIRROR, Stage::Full, Planted::NoIntensity, Wrong(Mistake::NoIntensity)),
    (ROOM, Stage::Full, Planted::OneLight, Wrong(Mistake::FirstLightOnly)),
    (BOX, Stage::Full, Planted::NoSpecular, Wrong(Mistake::NoSpecular)),
    (BOX, Stage::Full, Planted::ExponentDoubled, Wrong(Mistake::Exponent)),
    (BOX, Stage::Full, Planted::ExponentHalved, Wrong(Mistake::Exponent)),
    (BOX, Stage::Specular, Planted::NoExponent, Wrong(Mistake::Exponent)),
    (BOX, Stage::Full, Planted::Blinn, Wrong(Mistake::HalfVector)),
    (BOX, Stage::Full, Planted::MirrorSign, Wrong(Mistake::SpecularSign)),
    (BOX, Stage::Specular, Planted::EvenPower, Wrong(Mistake::SpecularMissingMax)),
    (BOX, Stage::Full, Planted::HighlightTimesKd, Wrong(Mistake::SpecularTimesKd)),
    (SHADOW, Stage::Full, Planted::NoShadows, Expected::Stage(Stage::Specular)),
    (ROOM, Stage::Full, Planted::NoShadows, Wrong(Mistake::NoShadows)),
    (SHADOW, Stage::Full, Planted::Acne, Wrong(Mistake::ShadowAcne)),
    (LAMP, Stage::Full, Planted::BeyondLight, Wrong(Mistake::ShadowBeyondLight)),
    (GLASS, Stage::Full, Planted::GlassBlocks, Wrong(Mistake::OpaqueShadows)),
    (SHADOW, Stage::Full, Planted::ShadowTakesAll, Wrong(Mistake::ShadowedAmbient)),
    (MIRROR, Stage::Full, Planted::NoReflection, Expected::Stage(Stage::Shadow)),
    (ROOM, Stage::Full, Planted::NoReflection, Wrong(Mistake::NoReflection)),
    (ROOM, Stage::Full, Planted::NoK, Wrong(Mistake::ReflectionWithoutK)),
    (MIRROR, Stage::Full, Planted::ReflectsOn, Wrong(Mistake::ReflectedVector)),
    (ROOM, Stage::Full, Planted::ReflectsInwards, Wrong(Mistake::ReflectedVector)),
    (ROOM, Stage::Full, Planted::ReflectsLight, Wrong(Mistake::ReflectedVector)),
    (ROOM, Stage::Full, Planted::OneMinusK, Wrong(Mistake::BlendedReflection)),
    (ROOM, Stage::Full, Planted::DepthTwo, Wrong(Mistake::ShallowRecursion)),
    (GLASS, Stage::Full, Planted::NoRefraction, Expected::Stage(Stage::Reflection)),
    (GLASS, Stage::Full, Planted::EtaUpsideDown, Wrong(Mistake::EtaInverted)),
    (GLASS, Stage::Full, Planted::EtaOneWay, Wrong(Mistake::EtaNotSwapped)),
    (GLASS, Stage::Full, Planted::StraightOn, Wrong(Mistake::Unbent)),
    (GLASS, Stage::Full, Planted::NormalOutwards, Wrong(Mistake::NormalNotFlipped)),
    (GLASS, Stage::Full, Planted::NoTransparency, Wrong(Mistake::RefractionWithoutFactor)),
    (GLASS, Stage::Full, Planted::OpacityAsTransparency, Wrong(Mistake::OpacityReversed)),
    (GLASS, Stage::Full, Planted::OpacityBlend, Wrong(Mistake::BlendedRefraction)),
    (BOX, Stage::Full, Planted::ColumnByColumn, Wrong(Mistake::Transposed)),
    (BOX, Stage::Full, Planted::QuarterAngle, Wrong(Mistake::WholeAngle)),
    (BOX, Stage::Full, Planted::InvertedAspect, Wrong(Mistake::SquareWindow)),
    (ROOM, Stage::Full, Planted::GreenRedBlue, Wrong(Mistake::SwappedChannels)),
    (BOX, Stage::Full, Planted::FarRootOfSpheres, Wrong(Mistake::NotNearest)),
    (BOX, Stage::Full, Planted::AngleAsCosine, Wrong(Mistake::AngleForCosine)),
    (BOX, Stage::Full, Planted::NormalTooLong, Wrong(Mistake::NormalNotNormalised)),
    (BOX, Stage::Full, Planted::ConstantView, Wrong(Mistake::ConstantView)),
    (ROOM, Stage::Full, Planted::HighlightTimesCosine, Wrong(Mistake::SpecularTimesCosine)),
    (ROOM, Stage::Full, Planted::LastLight, Wrong(Mistake::FirstLightOnly)),
    // Unfinished programs with mistakes.
    (ROOM, Stage::Shadow, Planted::NoAmbient, Wrong(Mistake::NoAmbient)),
    (ROOM, Stage::Shadow, Planted::Blinn, Wrong(Mistake::HalfVector)),
    (GLASS, Stage::Diffuse, Planted::UpsideDown, Wrong(Mistake::UpsideDown)),
];

/// Planted mistakes on scenes that the grader wasn't made with.
const SECOND_HAND: &[(&str, Stage, Planted, Expected)] = &[
    (YARD, Stage::Full, Planted::DegreesAsRadians, Wrong(Mistake::WholeAngle)),
    (YARD, Stage::Full, Planted::FarRootOfSpheres, Wrong(Mistake::NotNearest)),
    (DESK, Stage::Full, Planted::AngleAsCosine, Wrong(Mistake::AngleForCosine)),
    (YARD, Stage::Full, Planted::SineAsCosine, Wrong(Mistake::AngleForCosine)),
    (YARD, Stage::Full, Planted::NormalTooLong, Wrong(Mistake::NormalNotNormalised)),
    (DESK, Stage::Full, Planted::ConstantView, Wrong(Mistake::ConstantView)),
    (YARD, Stage::Full, Planted::ConstantView, Wrong(Mistake::ConstantView)),
    (DESK, Stage::Full, Planted::ViewTooLong, Wrong(Mistake::ViewNotNormalised)),
    (YARD, Stage::Full, Planted::HalfOfSum, Wrong(Mistake::HalfVector)),
    (DESK, Stage::Full, Planted::Blinn, Wrong(Mistake::HalfVector)),
    (DESK, Stage::Full, Planted::HighlightsWithoutIntensity, Wrong(Mistake::NoIntensity)),
    (YARD, Stage::Full, Planted::ConstantLightVector, Wrong(Mistake::ConstantLightVector)),
    (YARD, Stage::Full, Planted::NoFalloff, Wrong(Mistake::NoAttenuation)),
    (YARD, Stage::Full, Planted::FalloffOfSquare, Wrong(Mistake::Falloff)),
    (DESK, Stage::Full, Planted::LastLight, Wrong(Mistake::FirstLightOnly)),
    (DESK, Stage::Full, Planted::EtaUpsideDown, Wrong(Mistake::EtaInverted)),
    (YARD, Stage::Full, Planted::ExtraGamma, Wrong(Mistake::Gamma)),
    (YARD, Stage::Full, Planted::NoAmbient, Wrong(Mistake::NoAmbient)),
    (DESK, Stage::Full, Planted::NoShadows, Wrong(Mistake::NoShadows)),
    (YARD, Stage::Full, Planted::BlueGreenRed, Wrong(Mistake::SwappedChannels)),
    (YARD, Stage::Full, Planted::Acne, Wrong(Mistake::ShadowAcne)),
    (DESK, Stage::Full, Planted::ReflectsInwards, Wrong(Mistake::ReflectedVector)),
];

/// A program whose scene has another number: the scene, what is different, the change, and the mistake's name.
type Typed = (&'static str, &'static str, fn(&mut Scene), Mistake);

/// Numbers that are typed otherwise, on scenes of the chapter.
const TYPED: &[Typed] = &[
    (BOX, "eye moved", |s| s.views[0].extrinsics.eye = [95.0, 48.0, 36.0].into(), Mistake::Eye),
    (BOX, "eye's z negated", |s| s.views[0].extrinsics.eye.z *= -1.0, Mistake::Eye),
    (BOX, "up along z", |s| s.views[0].extrinsics.up = [0.0, 0.0, 1.0].into(), Mistake::Up),
    (BOX, "center moved", |s| s.views[0].extrinsics.center = [0.0, 15.0, -6.0].into(), Mistake::Center),
    (BOX, "fovy 75", |s| s.views[0].intrinsics.fovy = 75.0, Mistake::Fovy),
    (BOX, "light moved", |s| at(s, 0, [70.0, 100.0, 20.0]), Mistake::LightPosition),
    (BOX, "light's y and z exchanged", |s| at(s, 0, [40.0, 0.0, 120.0]), Mistake::LightPosition),
    (BOX, "ball moved", |s| sphere(s, "ball").center += glam::Vec3::new(6.0, -8.0, 4.0), Mistake::ObjectPosition),
    (BOX, "diameter for radius", |s| sphere(s, "ball").radius *= 2.0, Mistake::ObjectSize),
    (BOX, "radius 20", |s| sphere(s, "ball").radius = 20.0, Mistake::ObjectSize),
    (BOX, "highlight doubled", |s| phong(s, "blue").ks = phong(s, "blue").ks * 2.0, Mistake::SpecularFactor),
    (BOX, "ks halved", |s| phong(s, "blue").ks = phong(s, "blue").ks * 0.5, Mistake::SpecularFactor),
    (BOX, "materials exchanged", |s| s.materials.swap(0, 1), Mistake::MaterialsExchanged),
    (BOX, "light doubled", |s| light(s, 0).intensity = light(s, 0).intensity * 2.0, Mistake::LightIntensity),
    (ROOM, "kd of the floor", |s| phong(s, "yellow").kd = Rgb::new(0.2, 0.5, 0.3), Mistake::DiffuseFactor),
    (ROOM, "k doubled", |s| phong(s, "red").k = phong(s, "red").k * 2.0, Mistake::ReflectionFactor),
    (ROOM, "ambient tripled", |s| s.ambient *= 3.0, Mistake::AmbientFactor),
    (BOX, "another background", |s| s.background = Rgb::new(0.1, 0.2, 0.5), Mistake::Background),
    (ROOM, "ball missing", |s| s.nodes.retain(|n| n.name.as_deref() != Some("small ball")), Mistake::MissingObject),
    (GLASS, "eta 1.5", |s| phong(s, "glass").eta = 1.5, Mistake::Eta),
    (GLASS, "opacity 0.7", |s| phong(s, "glass").opacity = 0.7, Mistake::Opacity),
];

/// Numbers that are typed otherwise, on scenes that the grader wasn't made with.
const TYPED_SECOND_HAND: &[Typed] = &[
    (YARD, "eye moved", |s| s.views[0].extrinsics.eye = [3.1, 4.2, 9.5].into(), Mistake::Eye),
    (DESK, "eye's x negated", |s| s.views[0].extrinsics.eye.x *= -1.0, Mistake::Eye),
    (DESK, "up along x", |s| s.views[0].extrinsics.up = [1.0, 0.0, 0.0].into(), Mistake::Up),
    (YARD, "fovy 60", |s| s.views[0].intrinsics.fovy = 60.0, Mistake::Fovy),
    (YARD, "key moved", |s| at(s, 0, [3.0, 6.0, 8.0]), Mistake::LightPosition),
    (DESK, "sun from the other side", |s| sun(s, [0.5, -1.0, -0.6]), Mistake::LightPosition),
    (YARD, "large ball moved", |s| sphere(s, "large").center.z -= 1.3, Mistake::ObjectPosition),
    (
        YARD,
        "small ball moved",
        |s| sphere(s, "small").center += glam::Vec3::new(0.3, 0.4, 0.2),
        Mistake::ObjectPosition,
    ),
    (DESK, "lens grown", |s| sphere(s, "lens").radius = 13.0, Mistake::ObjectSize),
    (YARD, "radius of the mirror", |s| sphere(s, "mirror").radius = 0.9, Mistake::ObjectSize),
    (YARD, "jade's highlight doubled", |s| phong(s, "jade").ks = phong(s, "jade").ks * 2.0, Mistake::SpecularFactor),
    (DESK, "blue ball's ks halved", |s| phong(s, "ball").ks = phong(s, "ball").ks * 0.5, Mistake::SpecularFactor),
    (YARD, "clay and jade exchanged", |s| s.materials.swap(0, 1), Mistake::MaterialsExchanged),
    (DESK, "wood and sail exchanged", |s| s.materials.swap(0, 3), Mistake::MaterialsExchanged),
    (YARD, "kd of the ground", |s| phong(s, "stone").kd = Rgb::new(0.3, 0.5, 0.7), Mistake::DiffuseFactor),
    (DESK, "kd / pi", |s| divide_kd(s, std::f32::consts::PI), Mistake::DiffuseFactor),
    (YARD, "fill halved", |s| light(s, 1).intensity = light(s, 1).intensity * 0.5, Mistake::LightIntensity),
    (YARD, "no squared falloff", |s| (0..2).for_each(|i| light(s, i).attenuation[2] = 0.0), Mistake::Falloff),
    (YARD, "n of jade", |s| phong(s, "jade").n = 25.0, Mistake::Exponent),
    (YARD, "k of chrome", |s| phong(s, "chrome").k = Rgb::gray(0.9), Mistake::ReflectionFactor),
    (DESK, "eta 1.2", |s| phong(s, "lens").eta = 1.2, Mistake::Eta),
    (YARD, "block missing", |s| s.nodes.retain(|n| n.name.as_deref() != Some("block")), Mistake::MissingObject),
    (DESK, "ambient halved", |s| s.ambient *= 0.5, Mistake::AmbientFactor),
    (YARD, "lights' intensities exchanged", exchange_lights, Mistake::LightsExchanged),
];

fn sphere<'a>(scene: &'a mut Scene, name: &str) -> &'a mut Sphere {
    let node = scene.nodes.iter_mut().find(|node| node.name.as_deref() == Some(name)).unwrap();
    match &mut node.content {
        Content::Shape(Shape::Sphere(sphere)) => sphere,
        other => panic!("{name} is {other:?}"),
    }
}

fn phong<'a>(scene: &'a mut Scene, name: &str) -> &'a mut Phong {
    scene.materials.iter_mut().find(|material| material.name == name).unwrap().model.phong_mut().unwrap()
}

fn light(scene: &mut Scene, number: usize) -> &mut Light {
    let mut lights = scene.nodes.iter_mut().filter_map(|node| match &mut node.content {
        Content::Light(light) => Some(light),
        _ => None,
    });
    lights.nth(number).unwrap()
}

fn at(scene: &mut Scene, number: usize, position: [f32; 3]) {
    light(scene, number).kind = LightKind::Omni(Omni::at(position.into()));
}

fn sun(scene: &mut Scene, towards: [f32; 3]) {
    light(scene, 0).kind = LightKind::Directional(Directional { towards: towards.into(), beam: None });
}

fn divide_kd(scene: &mut Scene, by: f32) {
    // The ambient term stays.
    scene.ambient *= by;
    scene.materials.iter_mut().for_each(|material| {
        let phong = material.model.phong_mut().unwrap();
        phong.kd *= 1.0 / by;
    });
}

fn exchange_lights(scene: &mut Scene) {
    let [first, second] = [0, 1].map(|i| light(scene, i).intensity);
    (light(scene, 0).intensity, light(scene, 1).intensity) = (second, first);
}

fn words(grade: &Grade) -> String {
    match (grade.verdict, grade.mistake) {
        (Verdict::Mistaken, Some(mistake)) => {
            [mistake].iter().chain(&grade.also).map(Named::name).collect::<Vec<_>>().join(" or ")
        }
        (Verdict::Unfinished, _) => format!("stage {}", grade.stage.name()),
        (Verdict::Right, _) => "right".into(),
        _ => "unexplained".into(),
    }
}

fn spaced(planted: Planted) -> String {
    let mut out = String::new();
    for c in format!("{planted:?}").chars() {
        if c.is_uppercase() && !out.is_empty() {
            out.push(' ');
        }
        out.extend(c.to_lowercase());
    }
    out
}

/// Whether a grade is as expected, and a row of the table.
fn row(planted: &str, path: &str, stage: Stage, grade: &Grade, expected: Expected) -> (bool, String) {
    let is_right = match expected {
        Expected::Mistake(mistake) => grade.verdict == Verdict::Mistaken && grade.mistake == Some(mistake),
        Expected::Stage(stage) => grade.verdict == Verdict::Unfinished && grade.stage == stage,
        Expected::Remark(remark) => grade.verdict == Verdict::Right && grade.remarks == [remark],
    };
    let name = path.rsplit('/').next().unwrap().trim_end_matches(".kdl");
    let sign = if is_right { "✓" } else { "" };
    let row = format!("| {planted} | {name} | {} | {} | {sign} |\n", stage.name(), words(grade));
    if !is_right {
        let best: Vec<String> =
            grade.hypotheses.iter().take(4).map(|h| format!("{:.4} {:?}", h.error, h.mistake)).collect();
        println!("{planted} on {name}: {}; {best:?}; {:?}", words(grade), grade.finding.as_ref().map(|f| &f.words));
    }
    (is_right, row)
}

/// Grades every so many mistakes of a table. Returns how many are named, and the rows.
fn named(planted: &[(&str, Stage, Planted, Expected)], typed: &[Typed], step: usize) -> (Vec<bool>, String) {
    let planted = planted.par_iter().step_by(step).map(|(path, stage, planted, expected)| {
        row(&spaced(*planted), path, *stage, &student(path, *stage, Some(*planted), 1), *expected)
    });
    let typed = typed.par_iter().step_by(step).map(|(path, label, change, mistake)| {
        let own = scene(path);
        let mut other = own.clone();
        change(&mut other);
        let picture = StudentTracer::new(&other, Stage::Full, None).picture(SIZE, 1);
        row(label, path, Stage::Full, &graded(&own, values(&picture), StudentPicture::ROUNDED), Wrong(*mistake))
    });
    let rows: Vec<(bool, String)> = planted.chain(typed).collect();
    rows.into_iter().unzip()
}

/// How many of the graded mistakes must be named.
#[track_caller]
fn holds(named: &[bool], share: f64) {
    let count = named.iter().filter(|named| **named).count();
    assert!(count as f64 >= share * named.len() as f64, "{count} of {}", named.len());
}

/// Some mistakes of the tables. The test of all takes longer.
#[test]
fn planted_mistakes_are_named() {
    let (first, _) = named(PLANTED, TYPED, 5);
    let (second, _) = named(SECOND_HAND, TYPED_SECOND_HAND, 6);
    holds(&first, 0.9);
    holds(&second, 0.8);
}

/// A lobe that is off by a factor is never right: a highlight doubled or halved, and a constant view vector.
#[test]
fn wrong_lobes_are_never_right() {
    for path in [BOX, YARD, DESK] {
        let own = scene(path);
        for factor in [0.5, 2.0] {
            let mut other = own.clone();
            other.materials.iter_mut().for_each(|material| {
                let phong = material.model.phong_mut().unwrap();
                phong.ks *= factor;
            });
            let picture = StudentTracer::new(&other, Stage::Full, None).picture(SIZE, 1);
            let grade = graded(&own, values(&picture), StudentPicture::ROUNDED);
            assert_ne!(grade.verdict, Verdict::Right, "{path} {factor}: {:?}", grade.hypotheses);
        }
        let grade = student(path, Stage::Full, Some(Planted::ConstantView), 1);
        assert_ne!(grade.verdict, Verdict::Right, "{path}: {:?}", grade.hypotheses);
    }
}

/// Filters of renderers, splatted from few random rays, make no right picture wrong.
#[test]
fn filtered_pictures_are_right() {
    let cases: Vec<_> =
        [BOX, GLASS, YARD, DESK].iter().flat_map(|path| SplatFilter::ALL.iter().map(move |f| (path, f))).collect();
    let wrong = cases.par_iter().enumerate().filter_map(|(i, (path, filter))| {
        let (own, rays) = (scene(path), [4, 8, 16][i % 3]);
        let picture = StudentTracer::new(&own, Stage::Full, None).splatted(SIZE, filter, rays, i as u64);
        let grade = graded(&own, values(&picture), StudentPicture::ROUNDED);
        (grade.verdict != Verdict::Right)
            .then(|| format!("{path}, {} of {rays} rays: {:?}", filter.name, grade.regions))
    });
    assert_eq!(wrong.collect::<Vec<_>>(), Vec::<String>::new());
    // A wide filter is told, and that of the pixel's mean isn't.
    let own = scene(BOX);
    let told = |filter: &SplatFilter| {
        let picture = StudentTracer::new(&own, Stage::Full, None).splatted(SIZE, filter, 16, 5);
        let grade = graded(&own, values(&picture), StudentPicture::ROUNDED);
        (grade.remarks, grade.filter.map(|filter| filter.to_string()))
    };
    assert_eq!(told(&SplatFilter::ALL[0]), (vec![], None));
    let wide = (vec![Remark::OtherFilter], Some("a tent of radius 1.5 pixels".to_owned()));
    assert_eq!(told(&SplatFilter::ALL[2]), wide);
}

/// A wrong lobe: its name, the planted mistake, and the change of materials.
type Lobe = (&'static str, Option<Planted>, fn(&mut Phong));

/// A wrong lobe is wrong under a filter, too. Numbers are fitted to such pictures, which takes its time.
#[test]
fn filtered_wrong_lobes_are_never_right() {
    let changes: [Lobe; 5] = [
        ("ks halved", None, |phong| phong.ks *= 0.5),
        ("ks doubled", None, |phong| phong.ks *= 2.0),
        ("n halved", None, |phong| phong.n *= 0.5),
        ("n doubled", None, |phong| phong.n *= 2.0),
        ("constant view", Some(Planted::ConstantView), |_| {}),
    ];
    let cases: Vec<_> = [BOX, DESK].iter().flat_map(|path| changes.iter().map(move |change| (path, change))).collect();
    let right = cases.par_iter().enumerate().filter_map(|(i, (path, (name, planted, change)))| {
        let own = scene(path);
        let mut other = own.clone();
        other.materials.iter_mut().for_each(|material| change(material.model.phong_mut().unwrap()));
        // Tents of both radii, and the Gaussian.
        let filter = &SplatFilter::ALL[1 + i % 3];
        let picture = StudentTracer::new(&other, Stage::Full, *planted).splatted(SIZE, filter, 64, 1);
        let grade = graded(&own, values(&picture), StudentPicture::ROUNDED);
        (grade.verdict == Verdict::Right).then(|| format!("{path}, {name}, {}", filter.name))
    });
    assert_eq!(right.collect::<Vec<_>>(), Vec::<String>::new());
}

/// All of them, and the table of the book's page (`CANALETTO_BLESS=1` writes it again).
#[test]
#[ignore = "takes a minute"]
fn all_planted_mistakes_are_named() {
    let (first, rows) = named(PLANTED, TYPED, 1);
    let (second, more) = named(SECOND_HAND, TYPED_SECOND_HAND, 1);
    let count = |named: &[bool]| format!("{} of {}", named.iter().filter(|named| **named).count(), named.len());
    println!("{}, and {} on other scenes", count(&first), count(&second));
    holds(&first, 0.9);
    holds(&second, 0.85);
    let table = format!("| planted | scene | finished up to | named | |\n|---|---|---|---|---|\n{rows}{more}");
    let page = root().join("docs/grade.md");
    let text = std::fs::read_to_string(&page).unwrap();
    let start = text.find("| planted |").expect("the page has the table");
    let end = start + text[start..].find("\n\n").map_or(text.len() - start, |at| at + 1);
    if std::env::var_os("CANALETTO_BLESS").is_some() {
        std::fs::write(&page, format!("{}{table}{}", &text[..start], &text[end..])).unwrap();
    } else {
        assert_eq!(&text[start..end], table, "CANALETTO_BLESS=1 writes the table again");
    }
}

/// No right picture is accused: those of the student without mistakes, ours with any sampling, and noisy ones.
#[test]
fn right_pictures_are_right() {
    for path in [BOX, SHADOW, MIRROR, GLASS, ROOM, LAMP, YARD, DESK] {
        for rays in [1, 2, 4] {
            let grade = student(path, Stage::Full, None, rays);
            assert_eq!(grade.verdict, Verdict::Right, "{path} with {rays}: {:?}", grade.regions);
        }
    }
    let textured = ["scenes/chapter/ladder.kdl", "scenes/chapter/fig-5.33a-replace.kdl", "scenes/still-life.kdl"];
    for path in textured.into_iter().chain([GLASS, "scenes/chapter/fig-5.25c-spot.kdl"]) {
        let mut scene = scene(path);
        for sampling in [scene.film.sampling, Sampling::Sampled(16)] {
            scene.film.sampling = sampling;
            let picture = render(&World::build(scene.clone()).unwrap(), &job(&scene), &()).unwrap().picture;
            let shown = develop(&picture, &clamped(&scene.film));
            let noisy = |noise: u32| {
                let pixel = |(i, c): (usize, &canaletto::math::Rgb)| {
                    let random = (i as u32).wrapping_mul(2_654_435_761) >> 16;
                    let off = (random % (2 * noise + 1)) as f32 - noise as f32;
                    c.to_array().map(|v| (((v * 255.0).round() + off) / 255.0).clamp(0.0, 1.0))
                };
                shown.iter().enumerate().map(pixel).collect::<Vec<_>>()
            };
            let exact = graded(&scene, noisy(0), StudentPicture::ROUNDED);
            assert_eq!(exact.verdict, Verdict::Right, "{path} {sampling:?}: {:?}", exact.hypotheses);
            let noisy = graded(&scene, noisy(6), StudentPicture::COMPRESSED);
            assert_eq!(noisy.verdict, Verdict::Right, "{path} {sampling:?}, noisy: {:?}", noisy.hypotheses);
        }
    }
}

/// Scenes with what hypotheses leave out. The noise of other random numbers is no mistake.
#[test]
fn right_pictures_of_what_is_left_out_are_right() {
    for name in ["rough", "depth-of-field", "motion-blur", "area-lights", "chapter/horizon-filtered"] {
        let scene = scene(&format!("scenes/{name}.kdl"));
        let job = Job { seed: 7, ..job(&scene) };
        let picture = render(&World::build(scene.clone()).unwrap(), &job, &()).unwrap().picture;
        let shown = develop(&picture, &clamped(&scene.film));
        let grade = graded(&scene, shown.iter().map(|c| c.to_array()).collect(), StudentPicture::ROUNDED);
        assert!(!grade.left_out.is_empty(), "{name}");
        assert_eq!(grade.verdict, Verdict::Right, "{name}: {:?}", grade.hypotheses);
    }
}

#[test]
fn unfinished_pictures_show_their_stage() {
    for &stage in &Stage::ALL[..Stage::ALL.len() - 1] {
        let grade = student(ROOM, stage, None, 1);
        assert_eq!((grade.verdict, grade.stage), (Verdict::Unfinished, stage), "{:?}", grade.hypotheses);
        assert!(!grade.evidence.is_empty());
    }
}

/// A picture of another scene is neither right nor accused of a mistake.
#[test]
fn other_pictures_are_unexplained() {
    let other = scene(ROOM);
    let picture = StudentTracer::new(&other, Stage::Full, None).picture(SIZE, 1);
    let grade = graded(&scene("scenes/still-life.kdl"), values(&picture), StudentPicture::ROUNDED);
    assert_eq!(grade.verdict, Verdict::Unexplained, "{:?}", grade.hypotheses);
    let noise = (0..SIZE[0] * SIZE[1]).map(|i| [(i.wrapping_mul(2_654_435_761) >> 24) as f32 / 255.0; 3]).collect();
    assert_eq!(graded(&scene(BOX), noise, StudentPicture::ROUNDED).verdict, Verdict::Unexplained);
}

/// The pixels of the evidence are those where the picture is as the mistake makes it, and not right.
#[test]
fn evidence_is_as_the_mistake_makes_it() {
    let grade = student(BOX, Stage::Full, Some(Planted::NoAmbient), 1);
    assert!(!grade.evidence.is_empty());
    for pixel in &grade.evidence {
        let near = |a: [f32; 3], b: [f32; 3]| (0..3).all(|c| (a[c] - b[c]).abs() < 0.015);
        assert!(near(pixel.student, pixel.mistaken) && !near(pixel.student, pixel.right), "{pixel:?}");
        assert!(pixel.object.is_some());
    }
}
