//! Radiosity against what is known: closed rooms by their formulas, energy, and a dense solution.

mod curved;

use super::*;
use crate::light::{Light as SceneLight, LightKind, Omni};
use crate::material::{Material, Phong};
use crate::math::Rgb;
use crate::scene::{Node, RadiosityShow, Scene};
use crate::shape::{Cuboid, Mesh, Shape};
use glam::{DVec3, Vec3};
use std::f64::consts::PI;

fn kd(name: &str, kd: f32) -> Material {
    Material::new(name, Phong { kd: Rgb::gray(kd), ..Phong::default() })
}

/// The light that arrives from other surfaces.
fn received(patch: &Patch) -> DVec3 {
    patch.from_emitters + patch.indirect
}

fn cube(min: f32, max: f32) -> Shape {
    Shape::Box(Cuboid { min: Vec3::splat(min), max: Vec3::splat(max) })
}

fn settings(method: RadiosityMethod, error: f32) -> RadiositySettings {
    RadiositySettings { method, error, ..RadiositySettings::DEFAULT }
}

/// CIE 171:2006, case 5.8: a closed cube of 4 m with a source of flux φ in its middle. The mean indirect irradiance is
/// φ ρ / (S (1 − ρ)), where S = 96 m².
#[test]
fn a_cube_with_a_point_source_has_the_mean_of_cie_171() {
    for reflectance in [0.5f32, 0.9] {
        for method in [RadiosityMethod::Hierarchical, RadiosityMethod::Full, RadiosityMethod::Shooting] {
            let flux = 10_000.0;
            let mut lamp =
                SceneLight::new(LightKind::Omni(Omni::at(Vec3::ZERO)), Rgb::gray((flux / (4.0 * PI * PI)) as f32));
            lamp.attenuation = [0.0, 0.0, 1.0];
            let mut room = Node::from(cube(-2.0, 2.0));
            room.material = Some(0);
            let scene = Scene {
                materials: vec![kd("wall", reflectance)],
                nodes: vec![room, Node::from(lamp)],
                ..Scene::default()
            };
            let world = World::build(scene).unwrap();
            let started = std::time::Instant::now();
            let error = if method == RadiosityMethod::Hierarchical { 0.01 } else { 0.05 };
            let solution = RadiositySolution::solve(&world, &settings(method, error), &()).unwrap();
            let inner = || solution.patches().iter().filter(|patch| !patch.is_outer);
            let area: f64 = inner().map(|patch| patch.area).sum();
            let mean = |of: &dyn Fn(&Patch) -> DVec3| inner().map(|patch| of(patch).x * patch.area).sum::<f64>() / area;
            let (direct, indirect) = (mean(&|p| p.direct) * PI, mean(&|p| p.indirect) * PI);
            let rho = f64::from(reflectance);
            println!(
                "{method:?} ρ {rho:.2}: {} patches, {} links, residual {:.1e}, {:?}: direct {direct:.3}, indirect {indirect:.3}",
                solution.patches().len(),
                solution.links,
                solution.residual,
                started.elapsed()
            );
            assert!((area / 96.0 - 1.0).abs() < 1e-9);
            assert!((direct / (flux / 96.0) - 1.0).abs() < 5e-3, "{direct}");
            assert!((indirect / (flux * rho / (96.0 * (1.0 - rho))) - 1.0).abs() < 1e-2, "{indirect}");
        }
    }
}

fn emitting(name: &str, kd: f32, emission: [f32; 3]) -> Material {
    let phong = Phong { kd: Rgb::gray(kd), emission: Rgb::from(emission), ..Phong::default() };
    Material::new(name, phong)
}

/// The quads of the Cornell box as published (Cornell University Program of Computer Graphics, 1998), in millimetres,
/// without the blocks: floor, ceiling, back, right and left wall.
const CORNELL_WALLS: [[[f32; 3]; 4]; 5] = [
    [[552.8, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 559.2], [549.6, 0.0, 559.2]],
    [[556.0, 548.8, 0.0], [556.0, 548.8, 559.2], [0.0, 548.8, 559.2], [0.0, 548.8, 0.0]],
    [[549.6, 0.0, 559.2], [0.0, 0.0, 559.2], [0.0, 548.8, 559.2], [556.0, 548.8, 559.2]],
    [[0.0, 0.0, 559.2], [0.0, 0.0, 0.0], [0.0, 548.8, 0.0], [0.0, 548.8, 559.2]],
    [[552.8, 0.0, 0.0], [549.6, 0.0, 559.2], [556.0, 548.8, 559.2], [556.0, 548.8, 0.0]],
];

const CORNELL_LAMP: [[f32; 3]; 4] =
    [[343.0, 548.8, 227.0], [343.0, 548.8, 332.0], [213.0, 548.8, 332.0], [213.0, 548.8, 227.0]];

/// The blocks: short and tall, each with its top first. They have no base.
const CORNELL_BLOCKS: [[[[f32; 3]; 4]; 5]; 2] = [
    [
        [[130.0, 165.0, 65.0], [82.0, 165.0, 225.0], [240.0, 165.0, 272.0], [290.0, 165.0, 114.0]],
        [[290.0, 0.0, 114.0], [290.0, 165.0, 114.0], [240.0, 165.0, 272.0], [240.0, 0.0, 272.0]],
        [[130.0, 0.0, 65.0], [130.0, 165.0, 65.0], [290.0, 165.0, 114.0], [290.0, 0.0, 114.0]],
        [[82.0, 0.0, 225.0], [82.0, 165.0, 225.0], [130.0, 165.0, 65.0], [130.0, 0.0, 65.0]],
        [[240.0, 0.0, 272.0], [240.0, 165.0, 272.0], [82.0, 165.0, 225.0], [82.0, 0.0, 225.0]],
    ],
    [
        [[423.0, 330.0, 247.0], [265.0, 330.0, 296.0], [314.0, 330.0, 456.0], [472.0, 330.0, 406.0]],
        [[423.0, 0.0, 247.0], [423.0, 330.0, 247.0], [472.0, 330.0, 406.0], [472.0, 0.0, 406.0]],
        [[472.0, 0.0, 406.0], [472.0, 330.0, 406.0], [314.0, 330.0, 456.0], [314.0, 0.0, 456.0]],
        [[314.0, 0.0, 456.0], [314.0, 330.0, 456.0], [265.0, 330.0, 296.0], [265.0, 0.0, 296.0]],
        [[265.0, 0.0, 296.0], [265.0, 330.0, 296.0], [423.0, 330.0, 247.0], [423.0, 0.0, 247.0]],
    ],
];

fn quads(name: &str, quads: &[[[f32; 3]; 4]]) -> Mesh {
    let positions = quads.iter().flatten().map(|&p| Vec3::from_array(p)).collect();
    let triangles =
        (0..quads.len() as u32).flat_map(|i| [[0, 1, 2], [0, 2, 3]].map(|t| t.map(|v| v + 4 * i))).collect();
    Mesh { name: name.into(), positions, triangles, ..Mesh::default() }
}

/// The Cornell box. The lamp comes first, so that it and not the ceiling is seen.
fn cornell() -> Scene {
    let color = |name: &str, c: [f32; 3]| Material::new(name, Phong { kd: Rgb::from(c), ..Phong::default() });
    let materials = vec![
        emitting("lamp", 0.0, [17.0, 12.0, 4.0]),
        color("white", [0.725, 0.71, 0.68]),
        color("green", [0.14, 0.45, 0.091]),
        color("red", [0.63, 0.065, 0.05]),
    ];
    let [floor, ceiling, back, right, left] = CORNELL_WALLS;
    let meshes = vec![
        quads("lamp", &[CORNELL_LAMP]),
        quads("white", &[floor, ceiling, back]),
        quads("right", &[right]),
        quads("left", &[left]),
        quads("short", &CORNELL_BLOCKS[0]),
        quads("tall", &CORNELL_BLOCKS[1]),
    ];
    let node = |mesh: u32, material: u32| Node::new(crate::scene::Content::Mesh(mesh)).with_material(material);
    let nodes = [0, 1, 2, 3, 1, 1].into_iter().zip(0..).map(|(material, mesh)| node(mesh, material)).collect();
    Scene { materials, meshes, nodes, ..Scene::default() }
}

/// The mean light that arrives at faces of the Cornell box: mesh, face, light in red, green and blue, tolerance. The
/// numbers are those of a separate program: 13,290 equal patches, four contour integrals and rays for each pair, floor
/// and ceiling patches that a block or the lamp covers in part stand for their bare part. With 6,159 patches they
/// differ by up to 0.1 % on walls and 0.5 % on the blocks' sides.
const CORNELL_FACES: [(u32, u32, [f64; 3], f64); 15] = [
    (1, 0, [0.185413, 0.126071, 0.035705], 0.01),
    (1, 1, [0.138976, 0.084632, 0.020778], 0.01),
    (1, 2, [0.231275, 0.154995, 0.043703], 0.01),
    (2, 0, [0.249175, 0.168316, 0.050171], 0.01),
    (3, 0, [0.221522, 0.143206, 0.042865], 0.01),
    (4, 0, [0.433679, 0.310235, 0.095219], 0.01),
    (4, 1, [0.145120, 0.074449, 0.022211], 0.02),
    (4, 2, [0.018665, 0.008352, 0.002353], 0.02),
    (4, 3, [0.024469, 0.044226, 0.003738], 0.02),
    (4, 4, [0.133390, 0.115529, 0.025485], 0.02),
    (5, 0, [0.994503, 0.671692, 0.218539], 0.01),
    (5, 1, [0.114995, 0.011398, 0.002937], 0.02),
    (5, 2, [0.135059, 0.066601, 0.018216], 0.02),
    (5, 3, [0.125841, 0.114741, 0.023860], 0.02),
    (5, 4, [0.107712, 0.068410, 0.019217], 0.02),
];

#[test]
fn the_cornell_box_agrees_with_a_dense_solution() {
    let world = World::build(cornell()).unwrap();
    let started = std::time::Instant::now();
    let solution = RadiositySolution::solve(&world, &settings(RadiosityMethod::Hierarchical, 0.01), &()).unwrap();
    println!("patches {}, {} links, {:?}", solution.patches().len(), solution.links, started.elapsed());
    let mut worst = 0.0;
    for (mesh, face, expected, tolerance) in CORNELL_FACES {
        // Pieces of the floor under the blocks are dark.
        let of = |patch: &&Patch| {
            patch.is_outer && patch.instance == mesh && patch.primitive / 2 == face && received(patch).x > 1e-9
        };
        let area: f64 = solution.patches().iter().filter(of).map(|patch| patch.area).sum();
        let light =
            solution.patches().iter().filter(of).map(|patch| received(patch) * patch.area).sum::<DVec3>() / area;
        let error = light / DVec3::from_array(expected) - 1.0;
        println!(
            "face {mesh} {face}: {:.6} {:.6} {:.6}, error {:+.2} {:+.2} {:+.2} %",
            light.x,
            light.y,
            light.z,
            error.x * 100.0,
            error.y * 100.0,
            error.z * 100.0
        );
        worst = f64::max(worst, error.abs().max_element() / tolerance);
    }
    assert!(worst < 1.0, "{worst}");
}

/// A closed room of emission E and reflectance ρ has the radiance E / (1 − ρ) everywhere, whatever stands in it.
#[test]
fn a_furnace_glows_evenly() {
    for reflectance in [0.5f32, 0.95] {
        let material = emitting("wall", reflectance, [1.0, 0.5, 0.25]).with_two_sided(true);
        let block = Shape::Box(Cuboid { min: Vec3::new(-0.5, -2.0, -0.3), max: Vec3::new(0.7, 0.4, 0.9) });
        let nodes = [cube(-2.0, 2.0), block].map(|shape| Node::from(shape).with_material(0)).to_vec();
        let world = World::build(Scene { materials: vec![material], nodes, ..Scene::default() }).unwrap();
        for method in [RadiosityMethod::Hierarchical, RadiosityMethod::Full] {
            let error = if method == RadiosityMethod::Hierarchical { 0.01 } else { 0.05 };
            let solution = RadiositySolution::solve(&world, &settings(method, error), &()).unwrap();
            // The block's inner side, another furnace, counts too.
            let seen = |patch: &&Patch| patch.area > 0.0 && !(patch.primitive == 0 && patch.is_outer);
            let expected = DVec3::new(1.0, 0.5, 0.25) / (1.0 - f64::from(reflectance));
            let worst = solution
                .patches()
                .iter()
                .filter(seen)
                .map(|patch| (patch.radiance() / expected - 1.0).abs().max_element())
                .fold(0.0, f64::max);
            println!("cost {method:?} ρ {reflectance}: worst {worst:.1e}, {} patches", solution.patches().len());
            assert!(worst < 1e-4, "{method:?} {reflectance}: {worst}");
        }
    }
}

/// In a closed room all that is emitted is absorbed.
#[test]
fn no_light_is_lost_in_a_closed_room() {
    let materials = vec![kd("wall", 0.6), emitting("lamp", 0.3, [5.0, 3.0, 1.0])];
    let lamp = Shape::Box(Cuboid { min: Vec3::new(-0.5, 1.5, -0.3), max: Vec3::new(0.7, 2.0, 0.9) });
    let nodes = vec![Node::from(cube(-2.0, 2.0)).with_material(0), Node::from(lamp).with_material(1)];
    let world = World::build(Scene { materials, nodes, ..Scene::default() }).unwrap();
    for (method, tolerance) in [(RadiosityMethod::Full, 1e-6), (RadiosityMethod::Hierarchical, 2e-3)] {
        let error = if method == RadiosityMethod::Hierarchical { 0.01 } else { 0.06 };
        let solution = RadiositySolution::solve(&world, &settings(method, error), &()).unwrap();
        let sum = |of: &dyn Fn(&Patch) -> DVec3| solution.patches().iter().map(|p| of(p) * p.area).sum::<DVec3>();
        let emitted = sum(&|p| p.emission);
        let absorbed = sum(&|p| (DVec3::ONE - p.reflectance) * received(p));
        let lost = (absorbed / emitted - 1.0).abs().max_element();
        println!("cost {method:?}: emitted {emitted}, absorbed {absorbed}, lost {lost:.1e}");
        assert!(lost < tolerance && emitted.x > 1.0, "{method:?}: {lost}");
    }
}

/// The form factors of each patch in a closed room sum to 1, and the exchange of two patches has one value.
#[test]
fn form_factors_are_complete_and_reciprocal() {
    let mut scene = Scene { materials: vec![kd("wall", 0.5).with_two_sided(true)], ..Scene::default() };
    scene.materials[0].model.phong_mut().unwrap().emission = Rgb::WHITE;
    scene.nodes.push(Node::from(cube(-1.0, 1.0)).with_material(0));
    let world = World::build(scene).unwrap();
    let settings = settings(RadiosityMethod::Full, 0.05);
    let mut mesh = PatchMesh::new(&world, &settings).unwrap();
    full::subdivide_evenly(&mut mesh, &settings);
    let leaves = mesh.leaf_elements();
    let inner = |leaf: &&u32| !mesh.roots[mesh.elements[**leaf as usize].root as usize].is_outer;
    let mut rows = 0;
    for &p in leaves.iter().filter(inner) {
        let factor = |q: u32| mesh.between(p, q, exchange::Effort::Few).factor;
        let sum: f64 = leaves.iter().map(|&q| factor(q)).sum();
        assert!((sum - 1.0).abs() < 3e-5, "{sum}");
        for &q in &leaves {
            let [one, other] = [
                factor(q) * mesh.area_of(mesh.node(p)),
                mesh.between(q, p, exchange::Effort::Few).factor * mesh.area_of(mesh.node(q)),
            ];
            assert!((one - other).abs() <= 1e-12 * one);
        }
        rows += 1;
    }
    assert!(rows >= 96, "{rows}");
}

fn omni(position: Vec3) -> Node {
    let mut lamp = SceneLight::new(LightKind::Omni(Omni::at(position)), Rgb::new(1.0, 0.8, 0.6));
    lamp.attenuation = [0.0, 0.0, 1.0];
    Node::from(lamp)
}

/// A wall without thickness that stands on the floor of a closed room and divides it: no light passes.
#[test]
fn no_light_leaks_under_a_wall() {
    let wall = quads("wall", &[[[0.3, -2.0, -2.0], [0.3, 2.0, -2.0], [0.3, 2.0, 2.0], [0.3, -2.0, 2.0]]]);
    let nodes = vec![
        Node::from(cube(-2.0, 2.0)).with_material(0),
        Node::new(crate::scene::Content::Mesh(0)).with_material(0),
        omni(Vec3::new(1.2, 0.1, 0.2)),
    ];
    let world = World::build(Scene { materials: vec![kd("wall", 0.7)], nodes, meshes: vec![wall], ..Scene::default() })
        .unwrap();
    for method in [RadiosityMethod::Hierarchical, RadiosityMethod::Full] {
        let solution = RadiositySolution::solve(&world, &settings(method, 0.05), &()).unwrap();
        let [mut dark, mut lit] = [0.0, f64::INFINITY];
        for patch in solution.patches() {
            let before = patch.center + patch.normal * 1e-3;
            let inside = before.abs().max_element() < 2.0;
            if inside && before.x < 0.3 {
                dark = f64::max(dark, patch.radiance().x);
            } else if inside {
                lit = f64::min(lit, patch.radiance().x);
            }
        }
        println!("cost {method:?}: dark {dark:.1e}, lit {lit}");
        assert!(dark == 0.0 && lit > 1e-3, "{method:?}: {dark} {lit}");
    }
}

/// The floor under a box is no patch, and its patches end at the box.
#[test]
fn a_box_covers_the_floor_that_it_stands_on() {
    let floor = quads("floor", &[[[-4.0, 0.0, -4.0], [-4.0, 0.0, 4.0], [4.0, 0.0, 4.0], [4.0, 0.0, -4.0]]]);
    let on_floor = Shape::Box(Cuboid { min: Vec3::new(0.1, 0.0, 0.3), max: Vec3::new(1.2, 1.0, 1.7) });
    let nodes = vec![
        Node::new(crate::scene::Content::Mesh(0)).with_material(0),
        Node::from(on_floor).with_material(0),
        omni(Vec3::new(-1.0, 3.0, 0.0)),
    ];
    let world =
        World::build(Scene { materials: vec![kd("wall", 0.7)], nodes, meshes: vec![floor], ..Scene::default() })
            .unwrap();
    let solution = RadiositySolution::solve(&world, &settings(RadiosityMethod::Hierarchical, 0.05), &()).unwrap();
    let of_floor = |patch: &&Patch| patch.is_outer && patch.normal.y > 0.5 && patch.center.y == 0.0;
    let area: f64 = solution.patches().iter().filter(of_floor).map(|patch| patch.area).sum();
    assert!((area - (64.0 - 1.1 * 1.4)).abs() < 1e-5, "{area}");
    // Every patch that is left is lit, or shadowed from outside the box.
    let under =
        |patch: &Patch| patch.center.x > 0.1 && patch.center.x < 1.2 && patch.center.z > 0.3 && patch.center.z < 1.7;
    assert!(!solution.patches().iter().filter(of_floor).any(under));
}

fn still_life(scale: f32) -> Scene {
    use crate::shape::{Cylinder, Plane, Sphere};
    let s = scale;
    let v = |x: f32, y: f32, z: f32| Vec3::new(x, y, z) * s;
    let shapes: [(Shape, u32); 5] = [
        (Shape::Sphere(Sphere { center: v(0.0, 1.0, 0.0), radius: s }), 0),
        (Shape::Cylinder(Cylinder { base: v(2.0, 0.0, 0.5), top: v(2.0, 1.5, 0.5), radius: 0.5 * s, caps: true }), 0),
        (Shape::Box(Cuboid { min: v(-2.5, 0.0, -1.0), max: v(-1.5, 2.0, 0.0) }), 0),
        (Shape::Box(Cuboid { min: v(-0.5, 3.0, -0.5), max: v(0.5, 3.2, 0.5) }), 1),
        (Shape::Plane(Plane { point: Vec3::ZERO, normal: Vec3::Y }), 0),
    ];
    let nodes = shapes.into_iter().map(|(shape, material)| Node::from(shape).with_material(material)).collect();
    Scene { materials: vec![kd("clay", 0.6), emitting("lamp", 0.5, [9.0, 8.0, 7.0])], nodes, ..Scene::default() }
}

#[test]
fn any_number_of_threads_gives_equal_bits() {
    let world = World::build(still_life(1.0)).unwrap();
    let with = |threads: usize, method: RadiosityMethod| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let error = if method == RadiosityMethod::Hierarchical { 0.05 } else { 0.15 };
        pool.install(|| RadiositySolution::solve(&world, &settings(method, error), &()).unwrap())
    };
    for method in [RadiosityMethod::Hierarchical, RadiosityMethod::Shooting, RadiosityMethod::Full] {
        let one = with(1, method);
        println!("cost {method:?}: {} patches, {} links", one.patches().len(), one.links);
        assert!(one.patches().iter().any(|patch| patch.radiance().x > 0.1));
        for threads in [2, 3] {
            assert!(with(threads, method).patches() == one.patches(), "{method:?}, {threads} threads");
        }
    }
}

#[test]
fn a_scaled_scene_gives_equal_bits() {
    let solve = |scale: f32| {
        let world = World::build(still_life(scale)).unwrap();
        RadiositySolution::solve(&world, &settings(RadiosityMethod::Hierarchical, 0.05), &()).unwrap()
    };
    let one = solve(1.0);
    for scale in [1.0 / 1024.0, 65536.0] {
        let other = solve(scale);
        assert_eq!(one.patches().len(), other.patches().len());
        for (a, b) in one.patches().iter().zip(other.patches()) {
            assert_eq!(a.radiance(), b.radiance());
            assert_eq!(a.area * f64::from(scale) * f64::from(scale), b.area);
        }
    }
}

#[test]
fn what_has_no_solution_says_why() {
    let solve = |materials: Vec<Material>, nodes: Vec<Node>, settings: RadiositySettings| {
        let world = World::build(Scene { materials, nodes, ..Scene::default() }).unwrap();
        RadiositySolution::solve(&world, &settings, &()).unwrap_err().to_string()
    };
    let room = || Node::from(cube(-1.0, 1.0)).with_material(0);
    let lit = || vec![room(), omni(Vec3::ZERO)];
    let full = settings(RadiosityMethod::Full, 0.1);
    assert!(solve(vec![kd("wall", 0.5)], vec![room()], full).contains("nothing gives light"));
    assert!(solve(vec![kd("wall", 1.5)], lit(), full).contains("\"wall\" reflects 1.5"));
    for method in [RadiosityMethod::Full, RadiosityMethod::Hierarchical, RadiosityMethod::Shooting] {
        let message = solve(vec![kd("wall", 1.0)], lit(), settings(method, 0.1));
        assert!(message.contains("the light has no end"), "{method:?}: {message}");
    }
    assert!(solve(vec![], vec![omni(Vec3::ZERO)], full).contains("no surface"));
    let few = RadiositySettings { max_patches: 7, ..full };
    assert!(solve(vec![kd("wall", 0.5)], lit(), few).contains("more than 7 patches"));
    assert!(solve(vec![kd("wall", 0.5)], lit(), RadiositySettings { error: 0.0, ..full }).contains("error is 0"));
}

#[test]
fn the_limit_of_patches_is_kept_and_told() {
    let world = World::build(cornell()).unwrap();
    let few = RadiositySettings { max_patches: 300, ..settings(RadiosityMethod::Hierarchical, 0.01) };
    let solution = RadiositySolution::solve(&world, &few, &()).unwrap();
    assert!(solution.limit_reached && solution.patches().len() <= 300, "{}", solution.patches().len());
    // The light of the room is about right all the same.
    let back = |patch: &&Patch| patch.is_outer && patch.instance == 1 && patch.primitive / 2 == 2;
    let light: f64 = solution.patches().iter().filter(back).map(|patch| received(patch).x * patch.area).sum();
    assert!((light / 303376.6 / 0.2313 - 1.0).abs() < 0.2, "{}", light / 303376.6);
}

/// Rays that are traced together see what each sees alone, and an explanation adds up to its pixel.
#[test]
fn pictures_are_equal_ray_by_ray() {
    use crate::camera::Camera;
    use crate::job::{Aov, Job};
    use crate::scene::{Extrinsics, FilmSettings, Intrinsics};
    let mut scene = still_life(1.0);
    scene.nodes.push(omni(Vec3::new(3.0, 4.0, 3.0)));
    scene.materials[0].model.phong_mut().unwrap().k = Rgb::gray(0.2);
    let world = World::build(scene).unwrap();
    let intrinsics = Intrinsics { width: 40, height: 30, ..Intrinsics::default() };
    let extrinsics =
        Extrinsics { eye: DVec3::new(1.0, 3.0, 8.0), center: DVec3::new(0.0, 1.0, 0.0), ..Extrinsics::default() };
    let camera = Camera::new(&intrinsics, &extrinsics).unwrap();
    for show in [RadiosityShow::Patches, RadiosityShow::Solution, RadiosityShow::Full] {
        let settings = RadiositySettings { show, ..settings(RadiosityMethod::Hierarchical, 0.1) };
        let mut job = Job::new(camera.clone(), FilmSettings::default(), settings);
        let together = crate::render::render(&world, &job, &()).unwrap();
        assert!(together.counts.others.iter().any(|(name, count)| *name == "patches" && *count > 100));
        let tree = crate::explain::explain(&world, &job, 20, 18).unwrap();
        assert_eq!(tree.sum(), together.picture.pixel(20, 18), "{show:?}");
        job.aovs = vec![Aov::Ambient, Aov::ObjectId];
        let alone = crate::render::render(&world, &job, &()).unwrap();
        let lit = (0..30).flat_map(|y| (0..40).map(move |x| (x, y)));
        let mut bright = 0;
        for (x, y) in lit {
            let [a, b] = [&together, &alone].map(|rendering| rendering.picture.pixel(x, y));
            assert_eq!(a, b, "{show:?} {x} {y}");
            bright += usize::from(a.max_component() > 0.05);
        }
        assert!(bright > 200, "{show:?}: {bright}");
    }
}

/// A light meter anywhere in a furnace reads π E / (1 − ρ) in every direction.
#[test]
fn meters_in_a_furnace_read_its_light() {
    let room = Node::from(cube(-1.0, 1.0)).with_material(0);
    let mut wall = emitting("wall", 0.5, [1.0, 2.0, 4.0]);
    wall.two_sided = true;
    let world = World::build(Scene { materials: vec![wall], nodes: vec![room], ..Scene::default() }).unwrap();
    let solution = RadiositySolution::solve(&world, &settings(RadiosityMethod::Full, 0.1), &()).unwrap();
    let expected = DVec3::new(1.0, 2.0, 4.0) * (2.0 * PI);
    for (number, (point, normal)) in
        [(DVec3::ZERO, DVec3::Y), (DVec3::new(0.5, -0.2, 0.9), DVec3::new(0.6, 0.0, -0.8))].into_iter().enumerate()
    {
        let measured = RadiosityMeter::new(&world, &solution).measure((point, normal), 256, (1, number as u32));
        assert!((measured.irradiance / expected - 1.0).abs().max_element() < 1e-3, "{measured:?}");
        assert!((measured.illuminance() / (DVec3::new(0.2126, 0.7152, 0.0722).dot(expected)) - 1.0).abs() < 1e-3);
    }
}

/// Meters on the walls of a lit room with a block read the light that the solution has there.
#[test]
fn meters_on_walls_read_the_light_of_patches() {
    let mut lamp = SceneLight::new(LightKind::Omni(Omni::at(Vec3::new(0.2, 1.0, -0.3))), Rgb::gray(4.0));
    lamp.attenuation = [0.0, 0.0, 1.0];
    let block = Shape::Box(Cuboid { min: Vec3::new(-1.0, -2.0, -1.0), max: Vec3::new(0.0, -0.5, 0.0) });
    let nodes =
        vec![Node::from(cube(-2.0, 2.0)).with_material(0), Node::from(block).with_material(0), Node::from(lamp)];
    let world = World::build(Scene { materials: vec![kd("wall", 0.6)], nodes, ..Scene::default() }).unwrap();
    let solution = RadiositySolution::solve(&world, &settings(RadiosityMethod::Hierarchical, 0.01), &()).unwrap();
    let meter = RadiosityMeter::new(&world, &solution);
    let (mut compared, mut read, mut known) = (0, 0.0, 0.0);
    // The block's shadow ends on patches below its top, where the light of the centre isn't the mean.
    let is_above = |patch: &Patch| !patch.is_outer && patch.center.y > 0.0;
    for (number, patch) in solution.patches().iter().enumerate().filter(|(_, patch)| is_above(patch)).step_by(41) {
        let measured = meter.measure((patch.center, patch.normal), 4096, (7, number as u32));
        let light = solution.light_at(patch.instance, patch.primitive, patch.part, false, patch.center).unwrap();
        let expected = light.sum().x * PI;
        let room = 4.0 * measured.standard_error.x + 0.015 * expected;
        assert!((measured.irradiance.x - expected).abs() < room, "{measured:?} instead of {expected} at {patch:?}");
        (read, known) = (read + measured.irradiance.x * patch.area, known + expected * patch.area);
        compared += 1;
    }
    assert!((read / known - 1.0).abs() < 0.015, "{read} instead of {known}");
    assert!(compared > 20, "{compared}");
}
