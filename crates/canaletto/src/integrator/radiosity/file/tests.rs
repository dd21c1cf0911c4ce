//! Solutions as files, and the fingerprints of their scenes.

use super::super::fingerprint::SolutionInput;
use super::super::*;
use crate::WordHash;
use crate::camera::Camera;
use crate::integrator::StateFileError;
use crate::light::environment::{Environment, EnvironmentKind, Smoothing};
use crate::light::{Light as SceneLight, LightKind, Omni};
use crate::material::{Material, Parameter, Phong, Target, TextureUse};
use crate::math::{Rgb, Transform};
use crate::render::{Job, JobError, render, render_with_solution};
use crate::scene::{Content, Extrinsics, FilmSettings, Intrinsics, Node, RadiosityShow, Scene, View, WhittedSettings};
use crate::shape::{Cuboid, Mesh, Shape, Sphere, SphereCloud};
use crate::texture::{ColorSpace, Image, ImageTexture, Samples, Texture, TextureKind};
use glam::{DVec3, Vec3};
use std::sync::Arc;

const SETTINGS: RadiositySettings = RadiositySettings { error: 0.2, ..RadiositySettings::DEFAULT };

fn image(value: u8) -> Image {
    Image {
        name: "a picture".into(),
        width: 2,
        height: 2,
        channels: 3,
        samples: Samples::U8(vec![value; 12]),
        space: ColorSpace::Linear,
        premultiplied: false,
    }
}

/// A room with a ball, a mesh, a repeated group that holds an object and a light, textures and an environment.
fn scene() -> Scene {
    let kd = |name: &str, kd: [f32; 3]| Material::new(name, Phong { kd: Rgb::from(kd), ..Phong::default() });
    let mut textured = kd("paper", [0.8, 0.8, 0.8]);
    textured.textures.push(TextureUse::new(0, Target::Parameter(Parameter::Diffuse)));
    let lamp = Phong { kd: Rgb::BLACK, emission: Rgb::gray(4.0), ..Phong::default() };
    let materials = vec![kd("wall", [0.7, 0.6, 0.5]), textured, Material::new("lamp", lamp)];
    let block =
        |low: [f32; 3], high: [f32; 3]| Node::from(Shape::Box(Cuboid { min: Vec3::from(low), max: Vec3::from(high) }));
    let mesh = Mesh {
        name: "sail".into(),
        positions: [[-0.5, -0.9, -0.5], [0.5, -0.9, -0.5], [0.0, 0.5, -0.6]].map(Vec3::from).to_vec(),
        colors: vec![Rgb::gray(0.5); 3],
        triangles: vec![[0, 1, 2]],
        ..Mesh::default()
    };
    let cloud = SphereCloud {
        name: "drops".into(),
        centers: vec![Vec3::new(0.4, 0.4, 0.4)],
        radii: vec![0.1],
        ..SphereCloud::default()
    };
    let omni = SceneLight::new(LightKind::Omni(Omni::at(Vec3::new(0.0, 0.8, 0.3))), Rgb::gray(0.4));
    let pair = vec![block([-0.1, -1.0, -0.1], [0.1, -0.7, 0.1]), Node::from(omni.clone())];
    let environment = Environment {
        kind: EnvironmentKind::LatLong { image: 1, smoothing: Smoothing::default() },
        rotation: Transform::IDENTITY,
        intensity: Rgb::gray(0.3),
        ambient: false,
        visible: true,
    };
    Scene {
        ambient: Rgb::gray(0.1),
        environment: Some(environment),
        materials,
        textures: vec![Texture { name: "grain".into(), kind: TextureKind::Image(ImageTexture::new(0)) }],
        images: vec![image(200), image(90)],
        meshes: vec![mesh],
        spheres: vec![cloud],
        prototypes: vec![Node::new(Content::Group(pair))],
        nodes: vec![
            block([-1.0, -1.1, -1.0], [1.0, -1.0, 1.0]).with_material(0).named("floor"),
            block([-1.0, -1.0, -1.1], [1.0, 1.0, -1.0]).with_material(1).named("back"),
            Node::from(Shape::Sphere(Sphere { center: Vec3::new(0.5, -0.7, 0.2), radius: 0.3 })).with_material(0),
            block([-0.3, 0.95, -0.3], [0.3, 1.0, 0.3]).with_material(2),
            Node::new(Content::Mesh(0)).with_material(0),
            Node::new(Content::Spheres(0)).with_material(0),
            Node::new(Content::Instance(0)).with_transform(&Transform::translate(DVec3::new(-0.6, 0.0, 0.5))),
        ],
        ..Scene::default()
    }
}

fn solved(scene: Scene, settings: &RadiositySettings) -> (World, SolutionFingerprint, RadiositySolution) {
    let fingerprint = SolutionFingerprint::new(&scene, settings);
    let world = World::build(scene).unwrap();
    let solution = RadiositySolution::solve(&world, settings, &()).unwrap();
    (world, fingerprint, solution)
}

fn file_of(fingerprint: &SolutionFingerprint, solution: &RadiositySolution) -> Vec<u8> {
    let mut file = Vec::new();
    solution.write(fingerprint, &mut file).unwrap();
    file
}

fn read(file: &[u8]) -> Result<(SolutionFingerprint, RadiositySolution), StateFileError> {
    RadiositySolution::read(file, file.len() as u64)
}

/// A floor that glows under a lamp, whose file is short.
fn small_file() -> Vec<u8> {
    let triangle = |y: f32| [[-1.0, y, -1.0], [1.0, y, 1.0], [1.0, y, -1.0]].map(Vec3::from);
    let mesh =
        Mesh { positions: triangle(0.0).to_vec(), triangles: vec![[0, 1, 2]], one_sided: true, ..Mesh::default() };
    let lamp = SceneLight::new(LightKind::Omni(Omni::at(Vec3::new(0.2, 0.5, 0.1))), Rgb::WHITE);
    let glow = Phong { emission: Rgb::gray(0.1), ..Phong::default() };
    let scene = Scene {
        materials: vec![Material::new("glow", glow)],
        meshes: vec![mesh],
        nodes: vec![Node::new(Content::Mesh(0)).with_material(0), Node::from(lamp)],
        ..Scene::default()
    };
    let (_, fingerprint, solution) = solved(scene, &RadiositySettings { error: 0.5, max_patches: 12, ..SETTINGS });
    assert!((2..=12).contains(&solution.patches().len()), "{}", solution.patches().len());
    file_of(&fingerprint, &solution)
}

fn job(eye: [f64; 3], [width, height]: [u32; 2], show: RadiosityShow) -> Job {
    let intrinsics = Intrinsics { width, height, ..Intrinsics::default() };
    let place = Extrinsics { eye: eye.into(), center: DVec3::ZERO, up: DVec3::Y };
    let camera = Camera::new(&intrinsics, &place).unwrap();
    let settings = RadiositySettings { show, ..SETTINGS };
    Job::new(camera, FilmSettings::default(), crate::scene::Integrator::Radiosity(settings))
}

#[test]
fn a_solution_that_was_written_and_read_has_equal_bits_and_makes_equal_pictures() {
    for method in [RadiosityMethod::Hierarchical, RadiosityMethod::Shooting] {
        let settings = RadiositySettings { method, ..SETTINGS };
        let (world, fingerprint, solution) = solved(scene(), &settings);
        let file = file_of(&fingerprint, &solution);
        let (read_fingerprint, read_solution) = read(&file).unwrap();
        assert_eq!(read_fingerprint, fingerprint);
        assert_eq!(format!("{read_solution:?}"), format!("{solution:?}"));
        assert_eq!(file_of(&read_fingerprint, &read_solution), file);
        let solution = Arc::new(read_solution);
        for (eye, size) in [([0.3, 0.5, 3.0], [24, 16]), ([2.0, 1.0, 2.0], [15, 20])] {
            for show in [RadiosityShow::Patches, RadiosityShow::Solution, RadiosityShow::Full] {
                let mut job = job(eye, size, show);
                job.integrator = crate::scene::Integrator::Radiosity(RadiositySettings { show, ..settings });
                let solving = render(&world, &job, &()).unwrap();
                assert_eq!(render_with_solution(&world, &job, &solution, &()).unwrap(), solving, "{show:?}");
                assert!(solving.picture.pixels.iter().any(|color| *color != Rgb::BLACK));
            }
        }
    }
}

#[test]
fn a_solution_is_for_its_world_and_for_radiosity_only() {
    let (world, _, solution) = solved(scene(), &SETTINGS);
    let solution = Arc::new(solution);
    let mut more = scene();
    more.nodes.push(more.nodes[2].clone());
    let other = World::build(more).unwrap();
    let job = job([0.0, 0.0, 3.0], [4, 4], RadiosityShow::Full);
    assert!(matches!(render_with_solution(&other, &job, &solution, &()), Err(JobError::Radiosity(_))));
    // A file that was made up may name surfaces that don't exist.
    for (instance, primitive) in [(900, 0), (0, 900), (crate::world::Hit::UNBOUNDED, 0)] {
        let mut forged = RadiositySolution::clone(&solution);
        let root = &mut forged.emitters.polygons[0].root;
        (root.instance, root.primitives[1]) = (instance, primitive);
        assert!(matches!(render_with_solution(&world, &job, &Arc::new(forged), &()), Err(JobError::Radiosity(_))));
    }
    let whitted = Job { integrator: WhittedSettings::DEFAULT.into(), ..job };
    assert!(matches!(render_with_solution(&world, &whitted, &solution, &()), Err(JobError::Radiosity(_))));
}

/// What changed according to the fingerprints after an edit of the scene.
fn changed(edit: impl FnOnce(&mut Scene)) -> Vec<SolutionInput> {
    let before = SolutionFingerprint::new(&scene(), &SETTINGS);
    let mut edited = scene();
    edit(&mut edited);
    let after = SolutionFingerprint::new(&edited, &SETTINGS);
    before.check(&after).err().map_or(Vec::new(), |changed| changed.inputs)
}

#[test]
fn each_kind_of_change_is_named() {
    use SolutionInput::*;
    let of_shape = |node: &mut Node| match &mut node.content {
        Content::Shape(Shape::Sphere(sphere)) => sphere.radius *= 1.0 + f32::EPSILON,
        _ => panic!("a sphere is expected"),
    };
    let nested = |scene: &mut Scene, number: usize, edit: &dyn Fn(&mut Node)| match &mut scene.prototypes[0].content {
        Content::Group(nodes) => edit(&mut nodes[number]),
        _ => panic!("a group is expected"),
    };
    let brighter = |node: &mut Node| match &mut node.content {
        Content::Light(light) => light.intensity = Rgb::gray(0.41),
        _ => panic!("a light is expected"),
    };
    let moved = Transform::translate(DVec3::X * 1e-3);
    assert_eq!(changed(|_| {}), []);
    assert_eq!(changed(|scene| of_shape(&mut scene.nodes[2])), [Geometry]);
    assert_eq!(changed(|scene| scene.meshes[0].positions[1].x += 1e-3), [Geometry]);
    assert_eq!(changed(|scene| scene.meshes[0].one_sided = true), [Geometry]);
    assert_eq!(changed(|scene| scene.spheres[0].radii[0] = 0.11), [Geometry]);
    assert_eq!(changed(|scene| scene.nodes.swap(0, 1)), [Geometry]);
    assert_eq!(changed(|scene| nested(scene, 0, &|node| node.transform = moved.into())), [Geometry]);
    assert_eq!(changed(|scene| scene.nodes[2].motion = vec![Transform::IDENTITY, moved].into()), [Geometry]);
    assert_eq!(changed(|scene| drop(scene.nodes.remove(2))), [Geometry], "its material left with it");
    assert_eq!(changed(|scene| scene.nodes[2].material = Some(1)), [Assignment]);
    assert_eq!(changed(|scene| nested(scene, 0, &|node| node.material = Some(1))), [Assignment]);
    assert_eq!(changed(|scene| scene.materials[0].coverage = 0.5), [Materials]);
    assert_eq!(changed(|scene| scene.meshes[0].colors[2] = Rgb::WHITE), [Materials]);
    assert_eq!(changed(|scene| scene.images[0] = image(201)), [Materials]);
    assert_eq!(changed(|scene| scene.images[0].space = ColorSpace::Srgb), [Materials]);
    assert_eq!(changed(|scene| scene.textures[0].kind = TextureKind::Constant([0.5; 4])), [Materials]);
    assert_eq!(changed(|scene| nested(scene, 1, &brighter)), [Lights]);
    assert_eq!(changed(|scene| nested(scene, 1, &|node| node.transform = moved.into())), [Lights]);
    assert_eq!(changed(|scene| scene.images[1] = image(91)), [Environment]);
    assert_eq!(changed(|scene| scene.environment = None), [Materials, Environment], "its image is loose");
    // A group of an object and a light moves both.
    assert_eq!(changed(|scene| scene.nodes[6].transform = moved.into()), [Geometry, Lights]);
    for settings in [
        RadiositySettings { method: RadiosityMethod::Full, ..SETTINGS },
        RadiositySettings { error: 0.1, ..SETTINGS },
        RadiositySettings { max_patches: 10, ..SETTINGS },
    ] {
        let [before, after] = [SETTINGS, settings].map(|settings| SolutionFingerprint::new(&scene(), &settings));
        let told = before.check(&after).unwrap_err();
        assert_eq!(told.inputs, [Settings]);
        let with = "with method hierarchical, error 0.2, max-patches 200000";
        assert!(told.to_string() == format!("the settings changed since the solution was made ({with})"), "{told}");
    }
}

#[test]
fn cameras_names_and_what_is_shown_change_no_solution() {
    let same = changed(|scene| {
        let (name, extrinsics, motion) = ("other".into(), Extrinsics::default(), Vec::new());
        scene.views.push(View { name, intrinsics: Intrinsics::default(), extrinsics, motion });
        scene.ambient = Rgb::WHITE;
        scene.background = Rgb::WHITE;
        scene.film.crop = Some([0, 0, 1, 1]);
        scene.nodes[0].name = Some("ground".into());
        scene.materials[0].name = "plaster".into();
        scene.textures[0].name = "fibre".into();
        scene.images[0].name = "other.png".into();
        scene.meshes[0].name.clear();
        scene.spheres[0].name.clear();
    });
    assert_eq!(same, []);
    let [full, patches] = [RadiosityShow::Full, RadiosityShow::Patches]
        .map(|show| SolutionFingerprint::new(&scene(), &RadiositySettings { show, ..SETTINGS }));
    assert_eq!(full, patches);
    let more = RadiositySettings { light_samples: 99, ..SETTINGS };
    assert_eq!(full, SolutionFingerprint::new(&scene(), &more));
}

#[test]
fn all_changes_are_listed() {
    let before = SolutionFingerprint::new(&scene(), &SETTINGS);
    let after = SolutionFingerprint { geometry: 1, materials: 2, lights: 3, ..before };
    let told = before.check(&after).unwrap_err().to_string();
    assert_eq!(told, "the geometry, the materials and the lights changed since the solution was made");
}

/// A group that holds itself, and groups deeper than any world has, are no endless work.
#[test]
fn scenes_that_no_world_is_built_of_have_fingerprints() {
    let mut own = scene();
    own.prototypes[0] = Node::new(Content::Group(vec![Node::new(Content::Instance(0)), own.nodes[2].clone()]));
    let mut deep = scene();
    for _ in 0..100_000 {
        deep.nodes = vec![Node::new(Content::Group(std::mem::take(&mut deep.nodes)))];
    }
    for scene in [own, deep] {
        let of = || SolutionFingerprint::new(&scene, &SETTINGS);
        assert_eq!(of(), of());
        assert!(World::build(scene.clone()).is_err());
    }
}

#[test]
fn other_files_are_refused_with_their_reason() {
    let file = small_file();
    assert!(read(&file).is_ok());
    let told = |file: &[u8]| read(file).unwrap_err().to_string();
    for other in [&b""[..], b"\x89RAD", b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR and more", b"camera { eye 0 1 2 }"] {
        assert_eq!(told(other), "it isn't a solution of radiosity");
    }
    // A transfer as text makes a single line feed of both characters.
    let as_text: Vec<u8> = file.iter().enumerate().filter(|(i, _)| *i != 4).map(|(_, byte)| *byte).collect();
    assert!(matches!(read(&as_text), Err(StateFileError::Foreign { .. })));
    let mut newer = file.clone();
    let version = u32::from(newer[8]);
    newer[8] += 1;
    assert_eq!(
        told(&newer),
        format!("its format is version {}, and this program reads version {version}", version + 1)
    );
    for length in 8..file.len() {
        let error = read(&file[..length]).unwrap_err();
        assert!(matches!(error, StateFileError::CutOff | StateFileError::Damaged), "{length}: {error}");
        // The file became shorter while it was read.
        let error = RadiositySolution::read(&file[..length], file.len() as u64).unwrap_err();
        assert!(matches!(error, StateFileError::CutOff), "{length}: {error}");
    }
    let longer = [&file[..], b"more"].concat();
    assert!(matches!(read(&longer), Err(StateFileError::Damaged)));
}

/// A file of this version is read, and written again as it is. Other bytes are another version of the format: raise it,
/// and write the file anew with CANALETTO_BLESS=1.
#[test]
fn the_format_is_that_of_its_version() {
    if std::env::var_os("CANALETTO_BLESS").is_some() {
        let place = concat!(env!("CARGO_MANIFEST_DIR"), "/src/integrator/radiosity/file/floor.rad");
        std::fs::write(place, small_file()).unwrap();
    }
    let file = include_bytes!("floor.rad");
    let (fingerprint, solution) = read(file).unwrap();
    assert_eq!((fingerprint.settings.error, fingerprint.settings.max_patches), (0.5, 12));
    assert_eq!((solution.patches().len(), solution.emitters.polygons.len()), (10, 1));
    assert!(solution.patches().iter().all(|patch| patch.direct.x > 0.0 && patch.normal == DVec3::Y));
    assert!(file_of(&fingerprint, &solution) == file, "the format changed");
}

#[test]
fn every_changed_byte_is_noticed() {
    let file = small_file();
    for place in 0..file.len() {
        for change in [1u8 << (place % 8), 0xff] {
            let mut damaged = file.clone();
            damaged[place] ^= change;
            assert!(read(&damaged).is_err(), "byte {place}");
        }
    }
}

/// A reader that counts what is asked of it and has no end.
struct Endless<'a>(&'a [u8], usize);

impl std::io::Read for Endless<'_> {
    fn read(&mut self, into: &mut [u8]) -> std::io::Result<usize> {
        let given = into.len().min(self.0.len());
        into[..given].copy_from_slice(&self.0[..given]);
        self.0 = &self.0[given..];
        into[given..].fill(0xff);
        self.1 += into.len();
        Ok(into.len())
    }
}

/// The number of patches comes first of all lists. A larger one than the file has room for takes no memory.
#[test]
fn counts_are_checked_before_memory_is_taken() {
    let file = small_file();
    let (_, solution) = read(&file).unwrap();
    let count = (solution.patches().len() as u64).to_le_bytes();
    let at = (80..file.len()).find(|&at| file[at..at + 8] == count).unwrap();
    for wrong in [u64::MAX, u64::MAX / 8, 1 << 40, file.len() as u64] {
        let mut file = file.clone();
        file[at..at + 8].copy_from_slice(&wrong.to_le_bytes());
        let mut endless = Endless(&file, 0);
        let length = file.len() as u64;
        assert!(matches!(RadiositySolution::read(&mut endless, length), Err(StateFileError::CutOff)));
        assert!(endless.1 < 1 << 16);
    }
}

/// Files whose checksum was made to match give an error or a solution in which every lookup ends.
#[test]
fn forged_files_do_no_harm() {
    let file = small_file();
    let (mut refused, mut read_well) = (0, 0);
    for place in 8..file.len() - 8 {
        let mut forged = file.clone();
        forged[place] ^= 0x81;
        let body = forged.len() - 8;
        let mut checksum = WordHash::new();
        checksum.add_bytes(&forged[..body]);
        forged[body..].copy_from_slice(&checksum.finish().to_le_bytes());
        let Ok((_, solution)) = read(&forged) else {
            refused += 1;
            continue;
        };
        read_well += 1;
        for i in 0..20 {
            let point = DVec3::new(0.1 * f64::from(i) - 1.0, 0.0, -0.5);
            solution.patch_at(0, 0, 0, true, point);
            solution.light_at(0, 0, 0, true, point);
        }
    }
    assert!(refused > 100 && read_well > 100, "{refused} {read_well}");
}
