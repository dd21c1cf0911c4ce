use super::*;
use crate::form_factor::literature;
use crate::form_factor::testing::rectangle;
use crate::scene::{Node, Scene};
use crate::shape::{Cuboid, Disk, Shape, Sphere};
use glam::Vec3;

fn squares() -> Scene {
    let mut scene = Scene::default();
    rectangle(&mut scene, "floor", [0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
    rectangle(&mut scene, "ceiling", [0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]);
    rectangle(&mut scene, "wall", [0.0; 3], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
    scene
}

fn average(scene: &Scene, names: [&str; 2], sides: [Side; 2], points: u32) -> AverageHemicube {
    let ids = names.map(|name| scene.objects_named(name).unwrap());
    let world = World::build(scene.clone()).unwrap();
    let [a, b] = ids.map(|ids| world.object_surface(ids).unwrap());
    let settings = AverageHemicubeSettings { points, ..AverageHemicubeSettings::default() };
    average_hemicube(&world, (&a, sides[0]), (&b, sides[1]), &settings, &|_| ControlFlow::Continue(())).unwrap()
}

const FRONTS: [Side; 2] = [Side::Front; 2];

#[track_caller]
fn close(found: AverageHemicube, exact: f64, within: f64) {
    let difference = (found.value - exact).abs();
    assert!(difference <= 3.0 * found.error() && found.error() < within, "{found:?} instead of {exact}");
}

/// Howell's catalogue, C-11 and C-14, for unit squares.
#[test]
fn squares_have_the_published_factors() {
    for (points, within) in [(64, 5e-3), (1024, 1e-3)] {
        for (receiver, exact) in [("ceiling", 0.199_824_895_698), ("wall", 0.200_043_776_075)] {
            let found = average(&squares(), ["floor", receiver], FRONTS, points);
            close(found, exact, within);
            assert_eq!(found.points, points);
            assert!((found.value - exact).abs() < within, "{found:?}");
        }
    }
    let none = average(&squares(), ["floor", "ceiling"], [Side::Front, Side::Back], 8);
    assert!(none.value == 0.0 && none.error() > 0.0 && none.error() < 1e-5, "{none:?}");
    let both = average(&squares(), ["floor", "ceiling"], [Side::Both; 2], 64);
    close(both, 0.199_824_895_698 / 2.0, 1e-3);
}

/// A screen of a half by a half takes a half of the light; the value is that of the tests of sampling.
#[test]
fn a_screen_takes_its_light() {
    let mut scene = squares();
    rectangle(&mut scene, "middle", [0.25, 0.25, 0.5], [0.5, 0.0, 0.0], [0.0, 0.5, 0.0]);
    close(average(&scene, ["floor", "ceiling"], FRONTS, 128), 0.099_506, 2e-3);
    // Without a shadow the screen takes none, but still receives its own light: C-11 for half a square, from afar.
    let received = average(&scene, ["floor", "middle"], [Side::Front, Side::Back], 128).value;
    scene.nodes.last_mut().unwrap().casts_shadow = false;
    close(average(&scene, ["floor", "ceiling"], FRONTS, 64), 0.199_824_895_698, 5e-3);
    let unchanged = average(&scene, ["floor", "middle"], [Side::Front, Side::Back], 128).value;
    assert!(received > 0.1 && received.to_bits() == unchanged.to_bits(), "{received} {unchanged}");
}

/// Curved senders and receivers: disks (Howell's catalogue, C-41), and the inner side of a box around a ball.
#[test]
fn curved_surfaces_have_the_published_factors() {
    let mut scene = Scene::default();
    let mut add = |name: &str, shape: Shape| scene.nodes.push(Node::from(shape).named(name));
    add("low", Shape::Disk(Disk { center: Vec3::ZERO, normal: Vec3::Z, radius: 0.5 }));
    add("high", Shape::Disk(Disk { center: Vec3::Z * 1.5, normal: Vec3::NEG_Z, radius: 0.75 }));
    close(average(&scene, ["low", "high"], FRONTS, 64), literature::coaxial_disks(0.5, 0.75, 1.5), 1e-3);
    let mut scene = Scene::default();
    let mut add = |name: &str, shape: Shape| scene.nodes.push(Node::from(shape).named(name));
    add("ball", Shape::Sphere(Sphere { center: Vec3::new(0.2, 0.1, -0.3), radius: 0.5 }));
    add("room", Shape::Box(Cuboid { min: Vec3::splat(-1.0), max: Vec3::ONE }));
    let out = average(&scene, ["ball", "room"], [Side::Front, Side::Back], 32);
    assert!((out.value - 1.0).abs() < 1e-12 && out.resolution_error < 1e-12, "{out:?}");
    // The ball's area over the room's.
    let exact = std::f64::consts::PI / 24.0;
    close(average(&scene, ["room", "ball"], [Side::Back, Side::Front], 256), exact, 1e-2);
    let ball = average(&scene, ["ball", "ball"], [Side::Back, Side::Back], 16);
    // Along the surface, a few rays miss it, up to the roundings of `f32`.
    assert!((ball.value - 1.0).abs() < 1e-3, "{ball:?}");
}

#[test]
fn threads_and_interruptions() {
    let scene = squares();
    let ids = ["floor", "wall"].map(|name| scene.objects_named(name).unwrap());
    let world = World::build(scene).unwrap();
    let [a, b] = ids.map(|ids| world.object_surface(ids).unwrap());
    let settings = AverageHemicubeSettings { points: 20, resolution: 64, seed: 3 };
    let run = |progress: &(dyn Fn(u32) -> ControlFlow<()> + Sync)| {
        average_hemicube(&world, (&a, Side::Front), (&b, Side::Front), &settings, progress).unwrap()
    };
    let found = run(&|_| ControlFlow::Continue(()));
    assert_eq!((found.points, found.cancelled), (24, false));
    for threads in [1, 2, 3, 7] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        assert_eq!(pool.install(|| run(&|_| ControlFlow::Continue(()))), found, "{threads} threads");
    }
    let cut = run(&|points| if points >= 16 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) });
    assert!(cut.cancelled && cut.points == 16 && (cut.value - found.value).abs() < 0.1, "{cut:?}");
    let none = run(&|_| ControlFlow::Break(()));
    assert!(none.cancelled && none.points == 0 && none.value == 0.0 && none.error().is_infinite(), "{none:?}");
}
