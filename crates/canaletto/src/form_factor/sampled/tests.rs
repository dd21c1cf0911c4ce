use super::*;
use crate::form_factor::literature;
use crate::form_factor::testing::rectangle;
use crate::material::{Material, Phong};
use crate::math::Transform;
use crate::scene::{Content, Node, Scene};
use crate::shape::{Cone, Cuboid, Cylinder, Disk, Plane, Shape, Sphere, SphereCloud, Torus};
use glam::Vec3;
use std::f64::consts::PI;

fn disk(scene: &mut Scene, name: &str, height: f32, radius: f32, up: f32) {
    let disk = Disk { center: Vec3::Z * height, normal: Vec3::Z * up, radius };
    scene.nodes.push(Node::from(Shape::Disk(disk)).named(name));
}

fn sphere(scene: &mut Scene, name: &str, radius: f32) {
    scene.nodes.push(Node::from(Shape::Sphere(Sphere { center: Vec3::ZERO, radius })).named(name));
}

/// The factor from A to B at this standard error.
fn sample(scene: &Scene, sides: [Side; 2], standard_error: f64, seed: u64) -> SampledFormFactor {
    let ids = ["A", "B"].map(|name| scene.objects_named(name).unwrap());
    let world = World::build(scene.clone()).unwrap();
    let [a, b] = ids.map(|ids| world.object_surface(ids).unwrap());
    let settings = SampleSettings { standard_error, seed, ..SampleSettings::default() };
    sample_form_factor(&world, (&a, sides[0]), (&b, sides[1]), &settings, &|_| ControlFlow::Continue(())).unwrap()
}

const FRONTS: [Side; 2] = [Side::Front; 2];

fn check(what: &str, scene: &Scene, sides: [Side; 2], standard_error: f64, exact: f64) -> SampledFormFactor {
    let result = sample(scene, sides, standard_error, 1);
    let off = (result.value - exact) / result.standard_error;
    println!(
        "{what}: {:.6} ± {:.6}, exactly {exact:.6}, {off:+.2} standard errors off, {} rays",
        result.value, result.standard_error, result.rays
    );
    assert!(off.abs() < 3.5, "{what}: {} ± {} instead of {exact}", result.value, result.standard_error);
    assert!(result.standard_error <= standard_error);
    result
}

/// Two unit squares, parallel at the distance 1.
fn parallel() -> Scene {
    let mut scene = Scene::default();
    rectangle(&mut scene, "A", [0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
    rectangle(&mut scene, "B", [0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]);
    scene
}

#[test]
fn unit_squares() {
    let result = check("C-11", &parallel(), FRONTS, 1e-4, 0.199_824_895_698);
    assert!((result.area - 1.0).abs() < 1e-12 && result.area_error == 0.0 && result.blocked.is_empty());
    let mut scene = Scene::default();
    rectangle(&mut scene, "A", [0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
    rectangle(&mut scene, "B", [0.0; 3], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
    check("C-14", &scene, FRONTS, 1e-4, 0.200_043_776_075);
}

#[test]
fn rectangles() {
    let mut scene = Scene::default();
    rectangle(&mut scene, "A", [0.0; 3], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0]);
    rectangle(&mut scene, "B", [3.0, -1.0, 0.75], [0.0, 1.5, 0.0], [1.5, 0.0, 0.0]);
    let exact = literature::rectangles_in_parallel_planes([0.0, 1.0], [0.0, 2.0], [3.0, 4.5], [-1.0, 0.5], 0.75);
    check("C-13", &scene, FRONTS, 2e-4, exact);
    let mut scene = Scene::default();
    rectangle(&mut scene, "A", [0.0; 3], [3.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
    rectangle(&mut scene, "B", [0.0, 0.5, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 2.0]);
    let exact = literature::rectangles_in_perpendicular_planes([0.0, 3.0], [0.0, 1.0], [0.0, 2.0], [0.5, 2.5]);
    check("C-15", &scene, FRONTS, 2e-4, exact);
}

#[test]
fn disks_and_spheres() {
    for (r1, r2, a) in [(0.5, 0.75, 1.5), (1.0, 0.5, 1.0), (1.0, 1.0, 0.25f32)] {
        let mut scene = Scene::default();
        disk(&mut scene, "A", 0.0, r1, 1.0);
        disk(&mut scene, "B", a, r2, -1.0);
        check("C-41", &scene, FRONTS, 3e-4, literature::coaxial_disks(r1.into(), r2.into(), a.into()));
        // The back of either sees nothing of the other.
        for sides in [[Side::Back, Side::Front], [Side::Front, Side::Back]] {
            assert_eq!(sample(&scene, sides, 1e-2, 0).arrived, 0);
        }
    }
    // A disk that is turned away is in its own way.
    let mut scene = Scene::default();
    disk(&mut scene, "A", 0.0, 0.5, 1.0);
    disk(&mut scene, "B", 1.0, 0.5, 1.0);
    let averted = sample(&scene, FRONTS, 1e-3, 0);
    assert_eq!((averted.value, averted.arrived), (0.0, 0));
    check("C-41, back", &scene, [Side::Front, Side::Back], 1e-3, literature::coaxial_disks(0.5, 0.5, 1.0));
    for (r, a) in [(0.5, 1.0), (3.0, 0.5f32)] {
        let mut scene = Scene::default();
        sphere(&mut scene, "A", 0.3);
        disk(&mut scene, "B", a, r, -1.0);
        check("C-125", &scene, FRONTS, 3e-4, literature::sphere_to_disk(r.into(), a.into()));
    }
    let mut scene = Scene::default();
    sphere(&mut scene, "A", 0.5);
    rectangle(&mut scene, "B", [0.0, 0.0, 1.0], [0.0, 1.5, 0.0], [2.0, 0.0, 0.0]);
    check("sphere to rectangle", &scene, FRONTS, 2e-4, literature::sphere_to_rectangle(2.0, 1.5, 1.0));
    let mut scene = Scene::default();
    sphere(&mut scene, "A", 1.25);
    sphere(&mut scene, "B", 0.5);
    check("C-135", &scene, [Side::Back, Side::Front], 3e-4, literature::outer_to_inner_sphere(0.5, 1.25));
}

#[test]
fn cavities() {
    for (r, h) in [(0.5, 1.0), (0.5, 0.25f32)] {
        let mut scene = Scene::default();
        let side = Cylinder { base: Vec3::ZERO, top: Vec3::Z * h, radius: r, caps: false };
        scene.nodes.push(Node::from(Shape::Cylinder(side)).named("A"));
        let ids = scene.objects_named("A").unwrap();
        let world = World::build(scene.clone()).unwrap();
        let surface = world.object_surface(ids).unwrap();
        let inside = (&surface, Side::Back);
        let settings = SampleSettings { standard_error: 3e-4, ..SampleSettings::default() };
        let own = sample_form_factor(&world, inside, inside, &settings, &|_| ControlFlow::Continue(())).unwrap();
        let exact = literature::cylinder_to_itself(r.into(), h.into());
        assert!((own.value - exact).abs() < 3.5 * own.standard_error, "C-78: {} instead of {exact}", own.value);
        let side = scene.nodes.pop().unwrap().named("B");
        disk(&mut scene, "A", 0.0, r, 1.0);
        scene.nodes.push(side);
        let exact = literature::cylinder_base_to_side(r.into(), h.into());
        check("C-79", &scene, [Side::Front, Side::Back], 3e-4, exact);
    }
    let mut scene = Scene::default();
    let cone = Cone { base: Vec3::ZERO, top: Vec3::Z, radius: 0.75, top_radius: 0.0, caps: false };
    scene.nodes.push(Node::from(Shape::Cone(cone)).named("A"));
    disk(&mut scene, "B", 0.0, 0.75, 1.0);
    check("C-109", &scene, [Side::Back, Side::Front], 3e-4, literature::cone_to_base(0.75, 1.0));
}

/// A disk between two others that no line passes.
#[test]
fn a_large_disk_hides_everything() {
    let mut scene = Scene::default();
    disk(&mut scene, "A", 0.0, 0.5, 1.0);
    disk(&mut scene, "B", 1.0, 0.5, -1.0);
    disk(&mut scene, "wall", 0.5, 1.0, 1.0);
    let result = sample(&scene, FRONTS, 1e-3, 0);
    assert_eq!((result.value, result.arrived), (0.0, 0));
    assert!(result.standard_error > 0.0, "no ray isn't certainty");
    let blocked = result.blocked[&3] as f64 / result.rays as f64;
    assert!((blocked - literature::coaxial_disks(0.5, 0.5, 1.0)).abs() < 1e-2, "{blocked}");
    assert_eq!(result.blocked.len(), 1);
}

/// The unit squares with a square of ½ × ½ in the middle between them. From each point of A it hides a rectangle of
/// B's plane, whose factor B-3 gives. The mean over A is a sum over a grid.
fn half_hidden() -> f64 {
    let n = 400;
    let mut sum = 0.0;
    // The factor to a rectangle with corners relative to the patch's normal at the distance 1.
    let corner = |x: f64, y: f64| {
        let factor = literature::patch_to_parallel_rectangle(x.abs(), y.abs(), 1.0);
        factor * x.signum() * y.signum()
    };
    let to =
        |x: [f64; 2], y: [f64; 2]| corner(x[1], y[1]) - corner(x[0], y[1]) - corner(x[1], y[0]) + corner(x[0], y[0]);
    for i in 0..n * n {
        let p = [i % n, i / n].map(|k| (f64::from(k) + 0.5) / f64::from(n));
        let b = p.map(|p| [-p, 1.0 - p]);
        // The middle square from ¼ to ¾, twice as far.
        let hidden = [0, 1].map(|k| {
            let [from, to] = [0.25, 0.75].map(|edge| 2.0 * (edge - p[k]));
            [from.clamp(b[k][0], b[k][1]), to.clamp(b[k][0], b[k][1])]
        });
        sum += to(b[0], b[1]) - to(hidden[0], hidden[1]);
    }
    sum / f64::from(n * n)
}

fn with_middle_square(coverage: f32) -> Scene {
    let mut scene = parallel();
    rectangle(&mut scene, "middle", [0.25, 0.25, 0.5], [0.5, 0.0, 0.0], [0.0, 0.5, 0.0]);
    scene.materials.push(Material::new("gauze", Phong::default()).with_coverage(coverage));
    scene.nodes.last_mut().unwrap().material = Some(0);
    scene
}

#[test]
fn a_small_square_hides_a_part() {
    let open = literature::parallel_rectangles(1.0, 1.0, 1.0);
    let exact = half_hidden();
    let result = check("half hidden", &with_middle_square(1.0), FRONTS, 1e-4, exact);
    let blocked = result.blocked[&3] as f64 / result.rays as f64;
    assert!((blocked - (open - exact)).abs() < 5e-4, "{blocked}");
    // Through a material of partial coverage passes the rest.
    check("a quarter covered", &with_middle_square(0.25), FRONTS, 2e-4, open - 0.25 * (open - exact));
    // What casts no shadow stops nothing, as in the hemicubes' tests.
    let mut shadowless = with_middle_square(1.0);
    shadowless.nodes.last_mut().unwrap().casts_shadow = false;
    let result = check("without a shadow", &shadowless, FRONTS, 2e-4, open);
    assert!(result.blocked.is_empty(), "{:?}", result.blocked);
}

/// What is left of A with partial coverage has a smaller area, and sees what A sees.
#[test]
fn holes_have_no_area() {
    for (holes, factor) in [("A", 1.0), ("B", 0.25)] {
        let mut scene = parallel();
        scene.materials.push(Material::new("gauze", Phong::default()).with_coverage(0.25));
        scene.nodes.iter_mut().find(|node| node.name.as_deref() == Some(holes)).unwrap().material = Some(0);
        let result = check(holes, &scene, FRONTS, 3e-4, factor * 0.199_824_895_698);
        assert!((result.area - if holes == "A" { 0.25 } else { 1.0 }).abs() < 1e-6, "{}", result.area);
    }
}

/// Everything that leaves any shape inside a closed room arrives at the room.
#[test]
fn rooms_get_everything() {
    let room = Shape::Box(Cuboid { min: Vec3::splat(-3.0), max: Vec3::splat(3.0) });
    let turn = Transform::rotate(glam::DVec3::new(1.0, 2.0, 3.0), 40.0).unwrap();
    let shapes = [
        Shape::Sphere(Sphere { center: Vec3::X, radius: 1.0 }),
        Shape::Box(Cuboid { min: -Vec3::ONE, max: Vec3::new(1.0, 0.5, 0.25) }),
        Shape::Cylinder(Cylinder { base: Vec3::ZERO, top: Vec3::ONE, radius: 0.5, caps: true }),
        Shape::Cone(Cone { base: Vec3::ZERO, top: Vec3::ONE, radius: 0.5, top_radius: 0.1, caps: true }),
    ];
    for shape in shapes {
        let body = Node::from(shape).named("A").with_transform(&turn);
        let scene = Scene { nodes: vec![body, Node::from(room).named("B")], ..Scene::default() };
        let result = sample(&scene, [Side::Front, Side::Back], 1e-4, 0);
        assert_eq!(result.arrived, result.rays, "{shape:?}");
        assert!((result.area / shape.area().unwrap() - 1.0).abs() < 1e-6);
    }
    // A torus sees a part of itself.
    let torus = Shape::Torus(Torus { center: Vec3::ZERO, axis: Vec3::Y, radius: 1.0, tube: 0.25 });
    let body = Node::new(Content::Group(vec![Node::from(torus)])).named("A");
    let mut scene = Scene { nodes: vec![body, Node::from(room).named("B")], ..Scene::default() };
    let outwards = sample(&scene, [Side::Front, Side::Back], 1e-3, 0);
    scene.nodes[1].name = Some("the room".into());
    scene.nodes[0].name = Some("B".into());
    let Content::Group(children) = &mut scene.nodes[0].content else { unreachable!() };
    children[0].name = Some("A".into());
    let own = sample(&scene, FRONTS, 1e-3, 0);
    assert!(own.value > 0.03 && (own.value + outwards.value - 1.0).abs() < 4e-3, "{own:?} {outwards:?}");
}

/// Reciprocity between what can't be compared with formulas: an ellipsoid, which is a scaled sphere, a cloud, copies of
/// a prototype, with a body between them.
#[test]
fn both_ways_agree() {
    let ball = |x: f32, r: f32| Node::from(Shape::Sphere(Sphere { center: Vec3::new(x, 0.0, 0.0), radius: r }));
    let scaled = Transform::scale(glam::DVec3::new(0.5, 1.5, 1.5)).unwrap();
    let ellipsoid = ball(0.0, 1.0).with_transform(&scaled).named("ellipsoid");
    let cloud = SphereCloud {
        centers: (0..20).map(|i| Vec3::new(3.0, 0.3 * i as f32 - 3.0, (i % 3) as f32)).collect(),
        radii: vec![0.25],
        ..SphereCloud::default()
    };
    let copy = |place: glam::DVec3| Node::new(Content::Instance(0)).with_transform(&Transform::translate(place));
    let copies = Node::new(Content::Group(vec![
        copy(glam::DVec3::new(0.0, 4.0, 0.0)),
        copy(glam::DVec3::new(1.0, 4.0, 0.0))
            .with_transform(&Transform::scale(glam::DVec3::new(1.0, 1.0, 2.0)).unwrap()),
    ]));
    let pair = Node::new(Content::Group(vec![ball(0.0, 0.3), ball(0.5, 0.2)]));
    let mut scene = Scene { spheres: vec![cloud], prototypes: vec![pair], ..Scene::default() };
    let cloud = Node::new(Content::Spheres(0)).named("cloud");
    scene.nodes = vec![ellipsoid, cloud, copies.named("copies"), ball(1.5, 0.4).named("between")];
    let names = ["ellipsoid", "cloud", "copies"];
    let surfaces = names.map(|name| scene.objects_named(name).unwrap());
    let world = World::build(scene).unwrap();
    let surfaces = surfaces.map(|ids| world.object_surface(ids).unwrap());
    let settings = SampleSettings { standard_error: 5e-4, ..SampleSettings::default() };
    let factor = |a: usize, b: usize| {
        let [a, b] = [a, b].map(|k| (&surfaces[k], Side::Front));
        sample_form_factor(&world, a, b, &settings, &|_| ControlFlow::Continue(())).unwrap()
    };
    for (a, b) in [(0, 1), (0, 2), (1, 2)] {
        let (forth, back) = (factor(a, b), factor(b, a));
        let exchange = |f: &SampledFormFactor| (f.value * f.area, f.standard_error * f.area);
        let ((forth, e1), (back, e2)) = (exchange(&forth), exchange(&back));
        println!("{} and {}: {forth} ± {e1}, {back} ± {e2}", names[a], names[b]);
        assert!((forth - back).abs() < 3.5 * e1.hypot(e2) && forth > 0.0);
    }
    // The area of an oblate spheroid.
    let e = (1.0 - 0.5f64 * 0.5 / (1.5 * 1.5)).sqrt();
    let exact = 2.0 * PI * 1.5 * 1.5 * (1.0 + (1.0 - e * e) / e * e.atanh());
    let flat = factor(0, 1);
    assert!((flat.area - exact).abs() < 4.0 * flat.area_error && flat.area_error < 1e-2 * exact, "{flat:?} {exact}");
}

/// Estimates with other random numbers: about 95 % are nearer to the truth than twice their standard error, also
/// where few rays arrive.
#[test]
fn standard_errors_cover_the_truth() {
    let mut small = Scene::default();
    rectangle(&mut small, "A", [0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
    rectangle(&mut small, "B", [0.0, 0.0, 8.0], [0.0, 0.5, 0.0], [0.5, 0.0, 0.0]);
    let far = literature::rectangles_in_parallel_planes([0.0, 1.0], [0.0, 1.0], [0.0, 0.5], [0.0, 0.5], 8.0);
    let near = literature::parallel_rectangles(1.0, 1.0, 1.0);
    for (name, scene, exact, standard_error) in [
        ("near", parallel(), near, 2e-3),
        ("far", small, far, 2e-4),
        ("hidden", with_middle_square(1.0), half_hidden(), 2e-3),
    ] {
        let ids = ["A", "B"].map(|name| scene.objects_named(name).unwrap());
        let world = World::build(scene).unwrap();
        let [a, b] = ids.map(|ids| world.object_surface(ids).unwrap());
        let n = 200;
        let (mut covered, mut squares, mut claimed) = (0, 0.0, 0.0);
        for seed in 0..n {
            let settings = SampleSettings { standard_error, seed, ..SampleSettings::default() };
            let (a, b) = ((&a, Side::Front), (&b, Side::Front));
            let result = sample_form_factor(&world, a, b, &settings, &|_| ControlFlow::Continue(())).unwrap();
            covered += u32::from((result.value - exact).abs() <= 2.0 * result.standard_error);
            squares += (result.value - exact).powi(2);
            claimed += result.standard_error.powi(2);
        }
        let (error, claimed) = ((squares / n as f64).sqrt(), (claimed / n as f64).sqrt());
        println!("{name}: {covered} of {n} covered; error {error:.2e}, claimed {claimed:.2e}");
        // Three standard deviations of 95 % of 200 are 9.
        assert!(covered >= 181, "{name}: {covered} of {n}");
        assert!(claimed < 1.3 * error, "{name}: the error is {error}, {claimed} is claimed");
    }
}

#[test]
fn planes_can_receive() {
    let mut scene = Scene::default();
    sphere(&mut scene, "A", 0.5);
    let plane = Plane { point: Vec3::NEG_Z, normal: Vec3::Z };
    scene.nodes.push(Node::from(Shape::Plane(plane)).named("B"));
    // Half of the directions from a sphere go down.
    check("sphere to plane", &scene, FRONTS, 3e-4, 0.5);
}

/// Any number of threads, and a scene scaled by a power of two, give equal bits.
#[test]
fn equal_bits() {
    let mut scene = parallel();
    sphere(&mut scene, "ball", 0.25);
    let one = sample(&scene, FRONTS, 1e-3, 5);
    assert!(one.arrived > 0 && !one.blocked.is_empty());
    for threads in [1, 2, 3, 7] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        assert_eq!(pool.install(|| sample(&scene, FRONTS, 1e-3, 5)), one);
    }
    let scale = Transform::scale(glam::DVec3::splat(0.125)).unwrap();
    scene.nodes = scene.nodes.iter().map(|node| node.clone().with_transform(&scale)).collect();
    let small = sample(&scene, FRONTS, 1e-3, 5);
    assert_eq!(SampledFormFactor { area: one.area, ..small.clone() }, one);
    assert_eq!(small.area * 64.0, one.area);
}

#[test]
fn limits_and_interruptions_end_it() {
    let scene = parallel();
    let ids = ["A", "B"].map(|name| scene.objects_named(name).unwrap());
    let world = World::build(scene).unwrap();
    let [a, b] = ids.map(|ids| world.object_surface(ids).unwrap());
    let run = |settings: &SampleSettings, most: u64| {
        let progress = |state: &SamplingProgress| {
            if state.rays < most { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        };
        sample_form_factor(&world, (&a, Side::Front), (&b, Side::Both), settings, &progress).unwrap()
    };
    let limited = run(&SampleSettings { standard_error: 1e-9, max_rays: 100_000, seed: 0 }, u64::MAX);
    assert!((99_000..=100_000).contains(&limited.rays) && !limited.cancelled && limited.standard_error > 1e-9);
    let cancelled = run(&SampleSettings { standard_error: 1e-9, ..SampleSettings::default() }, 100_000);
    assert!(cancelled.cancelled && (100_000..5_000_000).contains(&cancelled.rays));
    assert!((cancelled.value - 0.1998).abs() < 0.01);
    let at_once = run(&SampleSettings::default(), 0);
    assert!(at_once.cancelled && at_once.rays == 0 && at_once.standard_error == f64::INFINITY);
}
