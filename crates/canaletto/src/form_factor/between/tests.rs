use super::*;
use crate::form_factor::literature;
use crate::form_factor::testing::rectangle;
use crate::scene::{Content, Node, Scene};
use crate::shape::{Cuboid, Disk, Mesh, Plane, Shape, Sphere, Triangle};
use glam::Vec3;

fn node(scene: &mut Scene, name: &str, shape: impl Into<Shape>) {
    scene.nodes.push(Node::from(shape.into()).named(name));
}

fn between(scene: &Scene, names: [&str; 2], sides: [Side; 2], error: f64) -> Result<FormFactors, FormFactorError> {
    by(FormFactorMethod::Auto, scene, names, sides, error)
}

fn by(
    method: FormFactorMethod,
    scene: &Scene,
    names: [&str; 2],
    sides: [Side; 2],
    error: f64,
) -> Result<FormFactors, FormFactorError> {
    let ids = names.map(|name| scene.objects_named(name).unwrap());
    let world = World::build(scene.clone()).unwrap();
    let [a, b] = ids.map(|ids| world.object_surface(ids).unwrap());
    let sampling = SampleSettings { standard_error: error, ..SampleSettings::default() };
    let settings = FormFactorSettings { sampling, method, ..FormFactorSettings::default() };
    form_factors(&world, (&a, sides[0]), (&b, sides[1]), &settings, &|_| ControlFlow::Continue(()))
}

const FRONTS: [Side; 2] = [Side::Front; 2];

/// A floor and a ceiling of 1 × 1 at the distance 1, and a ball beside them.
fn squares() -> Scene {
    let mut scene = Scene::default();
    rectangle(&mut scene, "floor", [0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
    rectangle(&mut scene, "ceiling", [0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]);
    node(&mut scene, "ball", Shape::Sphere(Sphere { center: Vec3::new(2.0, 0.5, 0.5), radius: 0.75 }));
    node(&mut scene, "ground", Shape::Plane(Plane { point: Vec3::NEG_Z, normal: Vec3::Z }));
    scene
}

#[test]
fn polygons_in_full_view_are_exact() {
    let found = between(&squares(), ["floor", "ceiling"], FRONTS, 1e-4).unwrap();
    assert!(found.sampled.is_none() && found.errors[0] < 1e-12);
    assert!((found.values[0] - 0.199_824_895_698).abs() < 1e-12 && (found.values[1] - found.values[0]).abs() < 1e-12);
    // Both sides of both have twice the area, of which only the inner halves see each other.
    let both = between(&squares(), ["floor", "ceiling"], [Side::Both; 2], 1e-4).unwrap();
    assert!(both.sampled.is_none() && (both.values[0] - 0.5 * found.values[0]).abs() < 1e-12);
    assert_eq!(both.areas, [2.0; 2]);
    let none = between(&squares(), ["floor", "ceiling"], [Side::Front, Side::Back], 1e-4).unwrap();
    assert_eq!((none.values, none.sampled), ([0.0; 2], None));
    // Faces of two boxes: those that look at each other.
    let mut scene = Scene::default();
    node(&mut scene, "low", Shape::Box(Cuboid { min: Vec3::ZERO, max: Vec3::ONE }));
    node(&mut scene, "high", Shape::Box(Cuboid { min: Vec3::Z * 2.0, max: Vec3::new(1.0, 1.0, 4.0) }));
    let boxes = between(&scene, ["low", "high"], FRONTS, 1e-4).unwrap();
    assert!(boxes.sampled.is_none() && (boxes.values[0] - 0.199_824_895_698 / 6.0).abs() < 1e-12);
    assert!(
        (boxes.areas[0] - 6.0).abs() < 1e-12 && (boxes.values[1] * boxes.areas[1] - 0.199_824_895_698).abs() < 1e-11
    );
    // The inner side of a box sees nothing but itself.
    let inside = between(&scene, ["low", "low"], [Side::Back; 2], 1e-4).unwrap();
    assert!(inside.sampled.is_none() && (inside.values[0] - 1.0).abs() < 1e-11, "{inside:?}");
}

/// A body that reaches between the polygons is noticed, and the light that it takes is sampled.
#[test]
fn bodies_between_are_sampled() {
    let mut scene = squares();
    rectangle(&mut scene, "middle", [0.25, 0.25, 0.5], [0.5, 0.0, 0.0], [0.0, 0.5, 0.0]);
    let found = between(&scene, ["floor", "ceiling"], FRONTS, 1e-4).unwrap();
    let sampled = found.sampled.as_ref().unwrap();
    // The value of `half_hidden` in the tests of sampling.
    let exact = 0.099_506;
    assert!((found.values[0] - exact).abs() < 3.5 * found.errors[0] + 1e-6, "{found:?}");
    assert!(sampled.rays < 2_000_000 && sampled.blocked.len() == 1, "{sampled:?}");
    // A speck hides little, and few rays suffice.
    let mut scene = squares();
    node(&mut scene, "speck", Shape::Sphere(Sphere { center: Vec3::splat(0.5), radius: 0.01 }));
    let found = between(&scene, ["floor", "ceiling"], FRONTS, 1e-4).unwrap();
    assert!(found.sampled.as_ref().unwrap().rays <= 65536, "{found:?}");
    assert!((found.values[0] - 0.1998).abs() < 3.0 * found.errors[0] && found.errors[0] > 1e-5, "{found:?}");
    // Where everything is hidden, so that the unoccluded factor is no help.
    let mut scene = squares();
    rectangle(&mut scene, "screen", [-1.0, -1.0, 0.5], [3.0, 0.0, 0.0], [0.0, 3.0, 0.0]);
    let found = between(&scene, ["floor", "ceiling"], FRONTS, 1e-4).unwrap();
    assert!(found.values[0].abs() < 1e-12 && found.errors[0] <= 1e-4 && found.errors[0] > 0.0, "{found:?}");
}

/// A receiver that is there twice gets all light once.
#[test]
fn double_triangles_count_once() {
    let mut scene = squares();
    for mesh in &mut scene.meshes {
        let twice = mesh.triangles.clone();
        mesh.triangles.extend(twice);
    }
    let found = between(&scene, ["floor", "ceiling"], FRONTS, 1e-4).unwrap();
    assert_eq!(found.areas, [2.0; 2]);
    // Rays meet one of two surfaces in one place.
    assert!((found.values[0] - 0.199_824_9).abs() < 3.0 * found.errors[0] + 1e-6, "{found:?}");
}

/// Seeds other than one: the truth is covered with control variates, too.
#[test]
fn standard_errors_cover_the_truth() {
    let mut scene = squares();
    rectangle(&mut scene, "middle", [0.25, 0.25, 0.5], [0.5, 0.0, 0.0], [0.0, 0.5, 0.0]);
    let ids = ["floor", "ceiling"].map(|name| scene.objects_named(name).unwrap());
    let world = World::build(scene).unwrap();
    let [a, b] = ids.map(|ids| world.object_surface(ids).unwrap());
    let (exact, n) = (0.099_506, 200);
    let covered = (0..n).filter(|&seed| {
        let sampling = SampleSettings { standard_error: 2e-3, seed, ..SampleSettings::default() };
        let settings = FormFactorSettings { sampling, ..FormFactorSettings::default() };
        let (a, b) = ((&a, Side::Front), (&b, Side::Front));
        let found = form_factors(&world, a, b, &settings, &|_| ControlFlow::Continue(())).unwrap();
        (found.values[0] - exact).abs() <= 2.0 * found.errors[0]
    });
    let covered = covered.count();
    assert!(covered >= 181, "{covered} of {n}");
}

/// Rays leave the smaller surface, and the error is that of the factor from A.
#[test]
fn the_smaller_surface_sends_rays() {
    let mut scene = Scene::default();
    node(&mut scene, "large", Shape::Disk(Disk { center: Vec3::ZERO, normal: Vec3::Z, radius: 2.0 }));
    node(&mut scene, "small", Shape::Disk(Disk { center: Vec3::Z, normal: Vec3::NEG_Z, radius: 0.25 }));
    let exact = literature::coaxial_disks(2.0, 0.25, 1.0);
    let found = between(&scene, ["large", "small"], FRONTS, 1e-4).unwrap();
    assert!(found.is_from_b && found.errors[0] <= 1e-4);
    assert!((found.values[0] - exact).abs() < 3.5 * found.errors[0], "{found:?}");
    assert!((found.values[1] / found.values[0] - 64.0).abs() < 1e-6);
    assert!(found.sampled.unwrap().rays < 20_000);
    let turned = between(&scene, ["small", "large"], FRONTS, 1e-3).unwrap();
    assert!(!turned.is_from_b && (turned.values[0] - 64.0 * exact).abs() < 3.5 * turned.errors[0], "{turned:?}");
}

#[test]
fn what_has_no_form_factor_says_so() {
    let mut scene = squares();
    let line = Triangle { a: Vec3::ZERO, b: Vec3::ONE, c: Vec3::splat(2.0), one_sided: false };
    scene.meshes.push(Mesh { positions: vec![line.a, line.b, line.c], triangles: vec![[0, 1, 2]], ..Mesh::default() });
    scene.nodes.push(Node::new(Content::Mesh(2)).named("line"));
    assert_eq!(between(&scene, ["line", "ball"], FRONTS, 1e-2), Err(FormFactorError::NoArea(0)));
    assert_eq!(between(&scene, ["ball", "line"], FRONTS, 1e-2), Err(FormFactorError::NoArea(1)));
    assert_eq!(between(&scene, ["ground", "ball"], FRONTS, 1e-2), Err(FormFactorError::Infinite));
    let down = between(&scene, ["ball", "ground"], FRONTS, 1e-3).unwrap();
    assert_eq!((down.values[1], down.areas[1]), (0.0, f64::INFINITY));
    assert!(down.values[0] > 0.4 && down.values[0] < 0.5, "{down:?}");
}

/// All methods agree where several have an answer.
#[test]
fn methods_agree() {
    let mut scene = squares();
    let exact = 0.199_824_895_698;
    let found = |method, scene: &Scene| by(method, scene, ["floor", "ceiling"], FRONTS, 1e-3);
    let analytic = found(FormFactorMethod::Analytic, &scene).unwrap();
    assert!((analytic.values[0] - exact).abs() < 1e-12 && analytic.hemicubes.is_none() && analytic.sampled.is_none());
    let sampled = found(FormFactorMethod::Sampled, &scene).unwrap();
    assert!(sampled.sampled.is_some() && sampled.errors[0] > 1e-4, "{sampled:?}");
    let hemicube = found(FormFactorMethod::Hemicube, &scene).unwrap();
    assert!(hemicube.hemicubes.is_some_and(|h| h.points == 64 && h.resolution == 256), "{hemicube:?}");
    for answer in [&sampled, &hemicube] {
        assert!((answer.values[0] - exact).abs() < 3.0 * answer.errors[0] && answer.errors[0] < 2e-3, "{answer:?}");
        assert_eq!(answer.values[0], answer.values[1]);
    }
    node(&mut scene, "speck", Shape::Sphere(Sphere { center: Vec3::splat(0.5), radius: 0.2 }));
    assert_eq!(found(FormFactorMethod::Analytic, &scene), Err(FormFactorError::NotAnalytic));
    let [a, b] = [FormFactorMethod::Auto, FormFactorMethod::Hemicube].map(|method| found(method, &scene).unwrap());
    assert!((a.values[0] - b.values[0]).abs() < 3.0 * (a.errors[0] + b.errors[0]), "{a:?} {b:?}");
    // Hemicubes stand on A, however large it is; planes can be B.
    let down = by(FormFactorMethod::Hemicube, &scene, ["ball", "ground"], FRONTS, 1e-3).unwrap();
    assert!(!down.is_from_b && (down.values[0] - 0.46).abs() < 0.04 && down.values[1] == 0.0, "{down:?}");
}
