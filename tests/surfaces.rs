//! Parts of round shapes: their light by closed forms, and two parts beside the whole. Rectangles as objects: their
//! light by closed forms, and the pictures of meshes with equal corners. Elements of objects: their numbers in every
//! integrator.

use canaletto::camera::Camera;
use canaletto::light::{Emission, Light, LightKind, RectangleLight};
use canaletto::material::{Material, Phong};
use canaletto::math::{Rgb, Transform};
use canaletto::render::{Aov, Job, render};
use canaletto::scene::{
    Content, Extrinsics, FilmSettings, Integrator, Intrinsics, Node, PathSettings, RadiositySettings, Sampling, Scene,
    WhittedSettings, ZbufferSettings,
};
use canaletto::shape::{Cone, Cylinder, Disk, Mesh, Parallelogram, Partial, Round, Shape};
use canaletto::world::World;
use canaletto_io::assets::MemoryAssets;
use canaletto_io::text::read_scene;
use glam::{DVec3, Vec2, Vec3};
use std::f64::consts::PI;

fn job(size: [u32; 2], fovy: f64, eye: DVec3, integrator: impl Into<Integrator>, samples: u32) -> Job {
    let intrinsics = Intrinsics { fovy, width: size[0], height: size[1], ..Intrinsics::default() };
    let extrinsics = Extrinsics { eye, center: DVec3::ZERO, up: DVec3::Y };
    let film = FilmSettings { sampling: Sampling::Sampled(samples), ..FilmSettings::default() };
    Job::new(Camera::new(&intrinsics, &extrinsics).unwrap(), film, integrator)
}

/// The radiance of a white matte floor at the origin, lit only by this node. Materials 1 and 2 emit 5, the latter on
/// both sides.
fn floor(node: Node, integrator: impl Into<Integrator>, samples: u32) -> f64 {
    let white = Material::new("white", Phong { kd: Rgb::WHITE, ..Phong::default() });
    let lamp = Phong { kd: Rgb::BLACK, emission: Rgb::gray(5.0), ..Phong::default() };
    let spot = Shape::Disk(Disk { center: Vec3::ZERO, normal: Vec3::Y, radius: 0.01 });
    let scene = Scene {
        materials: vec![white, Material::new("lamp", lamp), Material::new("lamp 2", lamp).with_two_sided(true)],
        nodes: vec![Node::from(spot).with_material(0), node],
        ..Scene::default()
    };
    let job = job([1, 1], 0.001, DVec3::new(-0.9, 0.3, 0.0), integrator, samples);
    f64::from(render(&World::build(scene).unwrap(), &job, &()).unwrap().picture.pixel(0, 0).g)
}

/// The corner is straight above the origin at height 2; u × v points down.
const ABOVE: Parallelogram =
    Parallelogram { corner: Vec3::new(0.0, 2.0, 0.0), u: Vec3::X, v: Vec3::new(0.0, 0.0, 3.0) };

/// The form factor from the origin to that rectangle (Howell, *A Catalog of Radiation Heat Transfer Configuration
/// Factors*, B-3).
fn factor() -> f64 {
    let (a, b) = (0.5f64, 1.5f64);
    let (ra, rb) = ((1.0 + a * a).sqrt(), (1.0 + b * b).sqrt());
    (a / ra * (b / ra).atan() + b / rb * (a / rb).atan()) / (2.0 * PI)
}

#[test]
fn light_of_an_emitting_rectangle_is_radiance_times_form_factor() {
    let lamp = |sheet: Parallelogram| Node::from(Shape::Rectangle(sheet)).with_material(1);
    let exact = 5.0 * factor();
    let check = |what: &str, value: f64, tolerance: f64| {
        println!("{what}: {value:.5}, exactly {exact:.5}");
        assert!((value / exact - 1.0).abs() < tolerance, "{what}: {value} instead of {exact}");
    };
    // A unit square is turned, stretched and lifted to the place.
    let square = Parallelogram { corner: Vec3::ZERO, u: Vec3::X, v: Vec3::Y };
    let moved = Transform::translate(DVec3::Y * 2.0)
        .after(&Transform::rotate(DVec3::X, 90.0).unwrap())
        .after(&Transform::scale(DVec3::new(1.0, 3.0, 7.0)).unwrap());
    // A mirrored square still emits outwards.
    let mirrored =
        moved.after(&Transform::translate(DVec3::X)).after(&Transform::scale(DVec3::new(-1.0, 1.0, 1.0)).unwrap());
    let path = PathSettings::DEFAULT;
    check("paths", floor(lamp(ABOVE), path, 256), 2e-3);
    check("moved", floor(lamp(square).with_transform(&moved), path, 256), 2e-3);
    // Its image must not turn, so it is an instance, whose directions are not sampled evenly.
    check("mirrored", floor(lamp(square).with_transform(&mirrored), path, 4096), 4e-3);
    let group = Node::new(Content::Group(vec![lamp(square)])).with_transform(&mirrored);
    check("in a group", floor(group, path, 4096), 4e-3);
    let light = Light {
        samples: 1,
        emission: Emission::Matte,
        visible: true,
        ..Light::new(LightKind::Rectangle(Box::new(RectangleLight { parallelogram: ABOVE, points: 1 })), Rgb::gray(5.0))
    };
    check("a rectangle light", floor(light.into(), path, 256), 2e-3);
    let radiosity = RadiositySettings { error: 0.005, ..RadiositySettings::DEFAULT };
    check("radiosity", floor(lamp(ABOVE), radiosity, 1), 5e-3);
    let away = Parallelogram { u: ABOVE.v, v: ABOVE.u, ..ABOVE };
    assert_eq!(floor(lamp(away), path, 16), 0.0, "its back is dark");
}

/// All layers of a rectangle are those of the two triangles with its corners.
#[test]
fn a_rectangle_is_seen_as_a_mesh_with_its_corners() {
    let sheet = Parallelogram {
        corner: Vec3::new(-1.0, -0.75, 0.5),
        u: Vec3::new(2.0, 0.25, -0.5),
        v: Vec3::new(0.25, 1.5, 0.125),
    };
    let [c, u, v] = [sheet.corner, sheet.u, sheet.v];
    let mesh = Mesh {
        positions: vec![c, c + u, c + u + v, c + v],
        uvs: vec![Vec2::Y, Vec2::ONE, Vec2::X, Vec2::ZERO],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    };
    let turned = Transform::rotate(DVec3::new(0.3, 1.0, 0.2), 25.0)
        .unwrap()
        .after(&Transform::scale(DVec3::new(-1.0, 1.2, 0.7)).unwrap());
    for transform in [Transform::IDENTITY, turned] {
        for integrator in [Integrator::from(WhittedSettings::default()), ZbufferSettings::default().into()] {
            let picture = |content: Content, meshes: Vec<Mesh>| {
                let material = Material::new("m", Phong::default());
                let node = Node::new(content).with_material(0).with_transform(&transform);
                let scene = Scene { materials: vec![material], meshes, nodes: vec![node], ..Scene::default() };
                let mut job = job([60, 45], 40.0, DVec3::new(0.5, 0.7, 4.0), integrator, 1);
                job.aovs = vec![Aov::Depth, Aov::Normal, Aov::Position, Aov::Uv, Aov::ObjectId];
                render(&World::build(scene).unwrap(), &job, &()).unwrap().picture
            };
            let found = picture(Content::Shape(Shape::Rectangle(sheet)), Vec::new());
            let expected = picture(Content::Mesh(0), vec![mesh.clone()]);
            let mut seen = 0;
            for (found, expected) in found.layers.iter().zip(&expected.layers) {
                for (found, expected) in found.data.iter().zip(&expected.data) {
                    seen += usize::from(*found != 0.0 && found.is_finite());
                    let same = found == expected || (found - expected).abs() < 1e-5;
                    assert!(same, "{found}, not {expected}");
                }
            }
            assert!(seen > 3000, "{seen}");
        }
    }
}

/// Rows of tables and triangles of meshes, as each integrator sees them. Rows that are left out count.
#[test]
fn elements_are_numbered_by_the_rows_of_their_tables() {
    let scene = "camera { eye 0 0 20; center 0 0 0; fovy 40; size 90 60 }\nambient 1\nmaterial \"m\" { kd 0.5 }\n\
        spheres material=\"m\" { file \"a.csv\"; colormap \"turbo\" column=\"v\"; radius 0.6 }\n\
        cylinders material=\"m\" { data \"-9 -4 0 -5 -4 0\\n-3 -4 0 3 -4 0\\n5 -4 0 9 -4 0\"; radius 0.5 }\n\
        mesh file=\"a.obj\" material=\"m\"\nsphere material=\"m\" { center 0 6 0; radius 0.5 }\n\
        light \"omni\" { position 3 5 30 }\ninstance \"i\" { translate 0 2 0 }\nprototype \"i\" { spheres material=\"m\" { points 5 0 0  7 0 0; radius 0.6 } }\n";
    let rows = "x,y,z,v\n-6,0,0,1\nnan,0,0,2\n-3,0,0,3\n\n0,0,0,4\n,0,0,5\n3,0,0,6\n";
    let quads = "v -8 3 0\nv -6 3 0\nv -6 5 0\nv -8 5 0\nv -4 5 0\nv -4 3 0\nf 1 2 3\nf 1 3 4\nf 2 6 5\nf 2 5 3\n";
    let assets = MemoryAssets::new().with("s.kdl", scene).with("a.csv", rows).with("a.obj", quads);
    let (scene, _) = read_scene("s.kdl", &assets).unwrap();
    let world = World::build(scene.clone()).unwrap();
    // Places in the plane z = 0, with the number of the element there.
    let places = [
        ([-6.0, 0.0], 1),
        ([-3.0, 0.0], 3),
        ([0.0, 0.0], 4),
        ([3.0, 0.0], 6),
        ([5.0, 2.0], 1),
        ([7.0, 2.0], 2),
        ([-7.0, -4.0], 1),
        ([0.0, -4.0], 2),
        ([7.0, -4.0], 3),
        ([-6.5, 3.4], 1),
        ([-7.5, 4.6], 2),
        ([-4.5, 3.4], 3),
        ([-5.5, 4.6], 4),
        ([0.0, 6.0], 1),
        ([0.0, 2.5], 0),
    ];
    let ambient = RadiositySettings { error: 0.5, ..RadiositySettings::DEFAULT };
    for integrator in [
        Integrator::from(WhittedSettings::default()),
        ZbufferSettings::default().into(),
        PathSettings::DEFAULT.into(),
        ambient.into(),
    ] {
        let name = format!("{integrator:?}");
        let mut job = Job::new(Camera::of(&scene.views[0]).unwrap(), FilmSettings::default(), integrator);
        job.film.sampling = Sampling::Center;
        job.aovs = vec![Aov::ElementId];
        let picture = render(&world, &job, &()).unwrap().picture;
        let layer = picture.layer("element-id").unwrap();
        // The height of the plane z = 0 in the picture.
        let height = 2.0 * 20.0 * (20.0f64).to_radians().tan();
        for ([x, y], number) in places {
            let (column, row) = (45.0 + x / height * 60.0, 30.0 - y / height * 60.0);
            let pixel = row as usize * 90 + column as usize;
            assert_eq!(layer.id(pixel), number, "{name}: at {x}, {y}");
        }
    }
}

/// From a point on the axis every part of a round surface is seen in proportion to its angle. The whole disk of radius
/// R at height h has the form factor R²/(R² + h²), and the wall of a tube that stands on the floor the rest, h²/(R² +
/// h²) (Howell, *A Catalog of Radiation Heat Transfer Configuration Factors*, B-12).
#[test]
fn light_of_parts_is_their_share_of_the_whole() {
    let path = PathSettings::DEFAULT;
    let check = |what: &str, value: f64, exact: f64, tolerance: f64| {
        println!("{what}: {value:.5}, exactly {exact:.5}");
        assert!((value / exact - 1.0).abs() < tolerance, "{what}: {value} instead of {exact}");
    };
    let lamp = |whole: Round, start: f32, angle: f32| {
        Node::from(Shape::Partial(Partial { whole, start, angle })).with_material(1)
    };
    let disk = Round::Disk(Disk { center: Vec3::Y * 2.0, normal: Vec3::NEG_Y, radius: 1.5 });
    let whole = 5.0 * 2.25 / (2.25 + 4.0);
    for (start, angle) in [(0.0, 90.0), (300.0, 120.0), (10.0, 360.0), (90.0, 7.5)] {
        let share = f64::from(angle) / 360.0;
        check("disk", floor(lamp(disk, start, angle), path, 256), whole * share, 4e-3);
    }
    // A part that is turned about another axis and mirrored is an instance.
    let half = Disk { center: Vec3::ZERO, normal: Vec3::Z, radius: 0.75 };
    let placed = Transform::translate(DVec3::Y * 2.0)
        .after(&Transform::rotate(DVec3::X, 90.0).unwrap())
        .after(&Transform::rotate(DVec3::Z, 33.0).unwrap())
        .after(&Transform::scale(DVec3::new(-2.0, 2.0, 1.0)).unwrap());
    let node = lamp(Round::Disk(half), 20.0, 200.0).with_transform(&placed);
    check("moved disk", floor(node, path, 256), whole * 200.0 / 360.0, 4e-3);
    // Walls shine inwards: the material is two-sided.
    let tube = Round::Cylinder(Cylinder { base: Vec3::ZERO, top: Vec3::Y * 2.0, radius: 1.5, caps: false });
    let wall = 5.0 * 4.0 / (2.25 + 4.0);
    let node = |start: f32, angle: f32| lamp(tube, start, angle).with_material(2);
    check("tube", floor(node(200.0, 100.0), path, 1024), wall * 100.0 / 360.0, 1e-2);
    check("whole tube", floor(node(0.0, 360.0), path, 1024), wall, 1e-2);
    // The cone's wall is seen as the annulus in its opening's plane: 1 less the form factor of the top.
    let cone = Round::Cone(Cone { base: Vec3::ZERO, top: Vec3::Y * 2.0, radius: 1.5, top_radius: 0.5, caps: false });
    let node = lamp(cone, 45.0, 180.0).with_material(2);
    check("cone", floor(node, path, 1024), 5.0 * (1.0 - 0.25 / (0.25 + 4.0)) * 0.5, 1e-2);
    let radiosity = RadiositySettings { error: 0.005, ..RadiositySettings::DEFAULT };
    check("disk by radiosity", floor(lamp(disk, 300.0, 120.0), radiosity, 1), whole / 3.0, 1e-2);
}

/// Two parts beside each other have all layers of the whole.
#[test]
fn parts_make_the_whole() {
    let (base, top) = (Vec3::new(-0.5, -0.8, 0.2), Vec3::new(0.6, 0.9, 0.4));
    let cylinder = Cylinder { base, top, radius: 0.7, caps: false };
    let cone = Cone { base, top, radius: 0.9, top_radius: 0.3, caps: false };
    let disk = Disk { center: Vec3::new(0.1, 0.1, 0.0), normal: Vec3::new(0.3, 0.4, 1.0), radius: 1.1 };
    let shapes = [
        (Shape::Cylinder(cylinder), Round::Cylinder(cylinder)),
        (Shape::Cone(cone), Round::Cone(cone)),
        (Shape::Disk(disk), Round::Disk(disk)),
    ];
    let stretched = Transform::rotate(DVec3::new(0.3, 1.0, 0.2), 25.0)
        .unwrap()
        .after(&Transform::scale(DVec3::new(-1.0, 1.2, 0.7)).unwrap());
    for (shape, whole) in shapes {
        for transform in [Transform::IDENTITY, stretched] {
            for integrator in [Integrator::from(WhittedSettings::default()), ZbufferSettings::default().into()] {
                let exact = matches!(integrator, Integrator::Whitted(_));
                let picture = |shapes: &[Shape]| {
                    let material = Material::new("m", Phong::default());
                    let node = |shape: &Shape| Node::from(*shape).with_material(0).with_transform(&transform);
                    let nodes = shapes.iter().map(node).collect();
                    let scene = Scene { materials: vec![material], nodes, ..Scene::default() };
                    let mut job = job([60, 45], 40.0, DVec3::new(0.5, 0.7, 4.0), integrator, 1);
                    job.aovs = vec![Aov::Depth, Aov::Normal, Aov::Position, Aov::Uv];
                    render(&World::build(scene).unwrap(), &job, &()).unwrap().picture
                };
                let part = |start: f32, angle: f32| Shape::Partial(Partial { whole, start, angle });
                let expected = picture(&[shape]);
                let found = picture(&[part(330.0, 130.0), part(100.0, 230.0)]);
                let [mut seen, mut off] = [0; 2];
                for (found, expected) in found.layers.iter().zip(&expected.layers) {
                    for (found, expected) in found.data.iter().zip(&expected.data) {
                        seen += usize::from(*found != 0.0 && found.is_finite());
                        let tolerance = if exact { 1e-5 } else { 2e-2 };
                        off += usize::from(found != expected && (found - expected).abs() > tolerance);
                    }
                }
                // At the seam u is 0 or 1; triangles of other columns have other silhouettes.
                let most = if exact { seen / 500 } else { seen / 25 };
                assert!(seen > 2000 && off <= most, "{} {off} of {seen}", shape.kind());
            }
        }
    }
}
