//! Grades of pictures that a student's ray tracer (`support/student.rs`) makes with planted mistakes, and without. The
//! table of the book's page is checked (`CANALETTO_BLESS=1` writes it again).

use canaletto::Named;
use canaletto::camera::Camera;
use canaletto::film::develop;
use canaletto::grade::{Grade, Mistake, StudentPicture, Verdict, grade};
use canaletto::render::{Job, render};
use canaletto::scene::{Sampling, Scene, Stage};
use canaletto::world::World;
use canaletto_io::assets::FolderAssets;
use canaletto_io::text::read_scene;
use canaletto_tests::student::{Planted, StudentTracer};
use canaletto_tests::{clamped, root};

/// The size of all pictures.
const SIZE: [u32; 2] = [80, 64];

const BOX: &str = "scenes/chapter/box-5.4.kdl";
const SHADOW: &str = "scenes/chapter/fig-5.23b-shadow.kdl";
const MIRROR: &str = "scenes/chapter/fig-5.26b-mirror.kdl";
const GLASS: &str = "scenes/chapter/fig-5.27b-glass.kdl";
const ROOM: &str = "tests/scenes/grade-room.kdl";
const LAMP: &str = "tests/scenes/grade-lamp.kdl";

fn scene(path: &str) -> Scene {
    let path = root().join(path);
    let assets = FolderAssets::new(path.parent().unwrap()).unwrap();
    let (mut scene, _) = read_scene(path.file_name().unwrap().to_str().unwrap(), &assets).unwrap();
    [scene.views[0].intrinsics.width, scene.views[0].intrinsics.height] = SIZE;
    scene
}

fn job(scene: &Scene) -> Job {
    Job::new(Camera::of(&scene.views[0]).unwrap(), scene.film, scene.integrator)
}

fn graded(scene: &Scene, pixels: Vec<[f32; 3]>, tolerance: f64) -> Grade {
    let [width, height] = SIZE;
    let student = StudentPicture { width, height, pixels, tolerance };
    grade(&World::build(scene.clone()).unwrap(), &job(scene), &student, &()).unwrap()
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
}

use Expected::Mistake as Wrong;

/// Planted mistakes: the scene, the stage up to which the program is finished, the mistake, and its name.
const PLANTED: &[(&str, Stage, Planted, Expected)] = &[
    (BOX, Stage::Full, Planted::UpsideDown, Wrong(Mistake::UpsideDown)),
    (BOX, Stage::Full, Planted::ColumnsReversed, Wrong(Mistake::Mirrored)),
    (BOX, Stage::Full, Planted::OtherPlace, Wrong(Mistake::RayPlace)),
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
    // Unfinished programs with mistakes.
    (ROOM, Stage::Shadow, Planted::NoAmbient, Wrong(Mistake::NoAmbient)),
    (ROOM, Stage::Shadow, Planted::Blinn, Wrong(Mistake::HalfVector)),
    (GLASS, Stage::Diffuse, Planted::UpsideDown, Wrong(Mistake::UpsideDown)),
];

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

#[test]
fn planted_mistakes_are_named() {
    let mut table = String::from("| planted | scene | finished up to | named | |\n|---|---|---|---|---|\n");
    let (mut named, mut wrong) = (0, Vec::new());
    for (path, stage, planted, expected) in PLANTED {
        let grade = student(path, *stage, Some(*planted), 1);
        let right = match *expected {
            Expected::Mistake(mistake) => grade.verdict == Verdict::Mistaken && grade.mistake == Some(mistake),
            Expected::Stage(stage) => grade.verdict == Verdict::Unfinished && grade.stage == stage,
        };
        let name = path.rsplit('/').next().unwrap().trim_end_matches(".kdl");
        let sign = if right { "✓" } else { "" };
        table += &format!("| {} | {name} | {} | {} | {sign} |\n", spaced(*planted), stage.name(), words(&grade));
        named += u32::from(right);
        if !right {
            let best: Vec<String> = grade
                .hypotheses
                .iter()
                .take(4)
                .map(|h| format!("{:.4} {} {:?}", h.error, h.stage.name(), h.mistake))
                .collect();
            wrong.push(format!("{planted:?} on {name}: {}; {best:?}", words(&grade)));
        }
    }
    println!("{table}{named} of {} named right\n{}", PLANTED.len(), wrong.join("\n"));
    assert!(named as usize * 10 >= PLANTED.len() * 9, "{named} of {}", PLANTED.len());
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
    for path in [BOX, SHADOW, MIRROR, GLASS, ROOM, LAMP] {
        for rays in [1, 3] {
            let grade = student(path, Stage::Full, None, rays);
            assert_eq!(grade.verdict, Verdict::Right, "{path} with {rays}: {:?}", grade.hypotheses);
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
