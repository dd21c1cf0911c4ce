use super::*;
use crate::form_factor::point_to_polygon;
use crate::material::Material;
use crate::sampler::Sampler;
use crate::scene::{Content, Node, Scene};
use crate::shape::{Cuboid, Cylinder, Disk, Mesh, Plane, Shape, Sphere};
use glam::Vec3;

fn node(scene: &mut Scene, shape: impl Into<Shape>) {
    scene.nodes.push(Node::from(shape.into()));
}

/// Adds a rectangle, whose front is on the side of u × v, and returns its corners.
fn rectangle(scene: &mut Scene, corner: [f32; 3], u: [f32; 3], v: [f32; 3]) -> [DVec3; 4] {
    let [corner, u, v] = [corner, u, v].map(Vec3::from);
    let corners = [corner, corner + u, corner + u + v, corner + v];
    scene.meshes.push(Mesh { positions: corners.to_vec(), triangles: vec![[0, 1, 2], [0, 2, 3]], ..Mesh::default() });
    scene.nodes.push(Node::new(Content::Mesh(scene.meshes.len() as u32 - 1)));
    corners.map(|corner| corner.as_dvec3())
}

fn at(resolution: u32, turn: f64) -> HemicubeSettings {
    HemicubeSettings { resolution, turn, ..HemicubeSettings::default() }
}

fn sum(seen: &HemicubeFormFactors) -> f64 {
    seen.primitives.iter().map(|p| p.factor).sum::<f64>() + seen.sky
}

/// The faces of a closed room take all light, each its share.
#[test]
fn a_closed_room_takes_all_light() {
    let mut scene = Scene::default();
    let walls = [
        ([0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [0.0, 2.0, 0.0]),
        ([0.0, 0.0, 1.0], [0.0, 2.0, 0.0], [3.0, 0.0, 0.0]),
        ([0.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 1.0]),
        ([3.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 2.0, 0.0]),
        ([0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [3.0, 0.0, 0.0]),
        ([0.0, 2.0, 0.0], [3.0, 0.0, 0.0], [0.0, 0.0, 1.0]),
    ];
    let walls: Vec<[DVec3; 4]> = walls.iter().map(|(corner, u, v)| rectangle(&mut scene, *corner, *u, *v)).collect();
    let world = World::build(scene).unwrap();
    let places = [
        (DVec3::new(1.1, 0.7, 0.0), DVec3::Z),
        (DVec3::new(1.1, 0.7, 1e-9), DVec3::Z),
        (DVec3::new(2.9, 1.3, 0.4), DVec3::new(0.3, -0.4, -0.5).normalize()),
        (DVec3::new(0.0, 0.5, 0.999), DVec3::X),
    ];
    for (index, (point, normal)) in places.into_iter().enumerate() {
        for turn in [0.0, 0.3, 1.0] {
            let seen = hemicube(&world, point, normal, &at(256, turn)).unwrap();
            assert!((sum(&seen) - 1.0).abs() < 1e-12 && seen.sky == 0.0, "{index} {turn}: {seen:?}");
            assert!(seen.primitives.iter().all(|p| p.is_front), "{index} {turn}: {seen:?}");
            let objects = seen.objects();
            for (object, wall) in (1..).zip(&walls) {
                let exact = point_to_polygon(point, normal, wall);
                let ours = objects.get(&object).copied().unwrap_or(0.0);
                assert!((ours - exact).abs() < 2e-3, "{index} {turn} wall {object}: {ours} instead of {exact}");
            }
        }
    }
}

/// The mean error over many polygons falls like the width of a pixel to a power between 1 and 2.
#[test]
fn errors_fall_with_resolution() {
    let random = |i: u32, k: u32| Sampler::new(5, 0, [i, 0]).uniform(0, k) * 2.0 - 1.0;
    let mut errors = [0.0; 3];
    let n = 24;
    for i in 0..n {
        let v = |k: u32| DVec3::new(random(i, 3 * k), random(i, 3 * k + 1), random(i, 3 * k + 2));
        let corners = [v(0), v(1), v(2)].map(|p| (p + DVec3::Z * 0.9).as_vec3());
        let mut scene = Scene::default();
        scene.meshes.push(Mesh { positions: corners.to_vec(), triangles: vec![[0, 1, 2]], ..Mesh::default() });
        scene.nodes.push(Node::new(Content::Mesh(0)));
        let world = World::build(scene).unwrap();
        let normal = (v(4) * 0.3 + DVec3::Z).normalize();
        let exact = point_to_polygon(DVec3::ZERO, normal, &corners.map(Vec3::as_dvec3));
        for (error, resolution) in errors.iter_mut().zip([32, 128, 512]) {
            let seen = hemicube(&world, DVec3::ZERO, normal, &at(resolution, random(i, 20))).unwrap();
            assert!((sum(&seen) - 1.0).abs() < 1e-12);
            let ours: f64 = seen.primitives.iter().map(|p| if p.is_front { p.factor } else { -p.factor }).sum();
            *error += (ours - exact).abs() / f64::from(n);
        }
    }
    assert!(errors[0] < 4e-3 && errors[1] < errors[0] / 4.0 && errors[2] < errors[1] / 4.0, "{errors:?}");
}

/// The known factors of curved surfaces, and the sides that are seen of all shapes.
#[test]
fn curved_surfaces_and_sides() {
    let patch = |shape: Shape, point: DVec3, normal: DVec3| {
        let mut scene = Scene::default();
        node(&mut scene, shape);
        let world = World::build(scene).unwrap();
        let seen = hemicube(&world, point, normal, &at(256, 0.4)).unwrap();
        assert!((sum(&seen) - 1.0).abs() < 1e-12, "{seen:?}");
        let side =
            |front: bool| -> f64 { seen.primitives.iter().filter(|p| p.is_front == front).map(|p| p.factor).sum() };
        [side(true), side(false)]
    };
    let close = |what: &str, ours: [f64; 2], exact: [f64; 2]| {
        let error = (ours[0] - exact[0]).abs().max((ours[1] - exact[1]).abs());
        assert!(error < 1e-3, "{what}: {ours:?} instead of {exact:?}");
    };
    let ball = Shape::Sphere(Sphere { center: Vec3::ZERO, radius: 1.0 });
    // A ball above a patch that faces it has the factor (r / d)².
    close("ball", patch(ball, DVec3::Z * -2.0, DVec3::Z), [0.25, 0.0]);
    close("near ball", patch(ball, DVec3::Z * -1.01, DVec3::Z), [1.0 / 1.0201, 0.0]);
    // From its own inner side, a ball is all around; from its outer side it isn't seen.
    let place = DVec3::new(0.36, 0.48, 0.8);
    close("inside the ball", patch(ball, place, -place), [0.0, 1.0]);
    close("on the ball", patch(ball, place, place), [0.0, 0.0]);
    close("in the ball", patch(ball, DVec3::new(0.2, 0.3, 0.1), place), [0.0, 1.0]);
    // Howell's catalogue, B-12: a disk on the axis has r² / (h² + r²).
    let disk = |normal: Vec3| Shape::Disk(Disk { center: Vec3::Z * 1.5, normal, radius: 0.75 });
    close("disk", patch(disk(Vec3::NEG_Z), DVec3::ZERO, DVec3::Z), [0.2, 0.0]);
    close("back of a disk", patch(disk(Vec3::Z), DVec3::ZERO, DVec3::Z), [0.0, 0.2]);
    let cuboid = Shape::Box(Cuboid { min: Vec3::splat(-1.0), max: Vec3::ONE });
    close("in a box", patch(cuboid, DVec3::new(0.3, 0.1, -1.0), DVec3::Z), [0.0, 1.0]);
    close("on a box", patch(cuboid, DVec3::new(0.3, 0.1, 1.0), DVec3::Z), [0.0, 0.0]);
    close("a wall's foot", patch(cuboid, DVec3::new(0.0, 1.000_001, -0.999), DVec3::Z), [0.5, 0.0]);
    let [front, back] = patch(cuboid, DVec3::Z * -3.0, DVec3::Z);
    assert!(front > 0.1 && back == 0.0, "{front} {back}");
    let tube = Shape::Cylinder(Cylinder { base: Vec3::ZERO, top: Vec3::Z * 2.0, radius: 0.5, caps: true });
    let [front, back] = patch(tube, DVec3::new(2.0, 0.0, 1.0), DVec3::NEG_X);
    assert!(front > 0.05 && back == 0.0, "{front} {back}");
    // Planes fill the hemisphere above a patch, or a half of it.
    let plane = |point: Vec3, normal: Vec3| Shape::Plane(Plane { point, normal });
    close("ceiling", patch(plane(Vec3::Z, Vec3::NEG_Z), DVec3::ZERO, DVec3::Z), [1.0, 0.0]);
    close("wall", patch(plane(Vec3::X, Vec3::NEG_X), DVec3::ZERO, DVec3::Z), [0.5, 0.0]);
    close("back of a wall", patch(plane(Vec3::Y, Vec3::Y), DVec3::ZERO, DVec3::Z), [0.0, 0.5]);
    // A plane at the angle of 60° to the patch's normal: a share (1 + cos 30°) / 2 of the hemisphere's projection.
    let slope = Vec3::new(0.5, 0.0, -0.75f32.sqrt());
    close("slope", patch(plane(-slope, slope), DVec3::ZERO, DVec3::Z), [0.5 + 0.75f64.sqrt() / 2.0, 0.0]);
}

/// What lies in the patch's own plane takes nothing, whatever the plane's place, and what hides it doesn't matter.
#[test]
fn the_own_plane_is_not_seen() {
    for i in 0..20 {
        let random = |k: u32| (Sampler::new(9, 0, [i, 0]).uniform(0, k) * 2.0 - 1.0) as f32;
        let v = |k: u32| Vec3::new(random(3 * k), random(3 * k + 1), random(3 * k + 2));
        let (corner, u) = (v(0) * 10.0, v(1));
        let normal = u.cross(v(2)).normalize();
        let across = normal.cross(u);
        let mut scene = Scene::default();
        rectangle(&mut scene, corner.into(), u.into(), across.into());
        node(&mut scene, Shape::Disk(Disk { center: corner + u * 0.5 + across * 0.5, normal, radius: 0.3 }));
        node(&mut scene, Shape::Sphere(Sphere { center: corner + normal * 3.0, radius: 1.0 }));
        let ids = [1, 2].map(|id| id as f32);
        let world = World::build(scene.clone()).unwrap();
        // A point that is exactly on a triangle, as sampling gives it.
        let corners = scene.meshes[0].corners(0).map(Vec3::as_dvec3);
        let point = corners[0] * 0.3 + corners[1] * 0.3 + corners[2] * 0.4;
        let exact = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize();
        let seen = hemicube(&world, point, exact, &at(128, 0.2)).unwrap();
        assert!((sum(&seen) - 1.0).abs() < 1e-12);
        let own: f64 = ids.iter().filter_map(|id| seen.objects().get(&(*id as u32)).copied()).sum();
        assert!(own == 0.0, "{i}: {seen:?}");
        assert!(seen.objects()[&3] > 0.05, "{i}: {seen:?}");
    }
}

/// A screen takes the light of what is behind it, a half if its coverage is a half.
#[test]
fn screens_hide() {
    let scene = |coverage: f32| {
        let mut scene = Scene::default();
        let ceiling = rectangle(&mut scene, [-1.0, -1.0, 2.0], [0.0, 2.0, 0.0], [2.0, 0.0, 0.0]);
        let screen = rectangle(&mut scene, [-0.25, -0.25, 1.0], [0.0, 0.5, 0.0], [0.5, 0.0, 0.0]);
        scene.materials.push(Material { coverage, ..Material::default() });
        scene.nodes[1].material = Some(0);
        (World::build(scene).unwrap(), [ceiling, screen].map(|p| point_to_polygon(DVec3::ZERO, DVec3::Z, &p)))
    };
    for coverage in [1.0, 0.5, 0.2, 0.0] {
        let (world, [ceiling, screen]) = scene(coverage);
        let seen = hemicube(&world, DVec3::ZERO, DVec3::Z, &at(256, 0.7)).unwrap().objects();
        let taken = screen * f64::from(coverage);
        let ours = [1, 2].map(|id| seen.get(&id).copied().unwrap_or(0.0));
        assert!((ours[0] - (ceiling - taken)).abs() < 2e-3 && (ours[1] - taken).abs() < 2e-3, "{coverage}: {ours:?}");
    }
}

fn still_life(scale: f32) -> World {
    let mut scene = Scene::default();
    node(&mut scene, Shape::Sphere(Sphere { center: Vec3::new(0.3, 0.2, 1.1) * scale, radius: 0.4 * scale }));
    node(
        &mut scene,
        Shape::Box(Cuboid { min: Vec3::new(-1.0, -0.7, 0.0) * scale, max: Vec3::new(-0.3, -0.3, 0.6) * scale }),
    );
    let end = Vec3::new(0.9, -0.5, 0.9) * scale;
    let tube = Cylinder { base: Vec3::new(0.9, -0.5, 0.1) * scale, top: end, radius: 0.2 * scale, caps: true };
    node(&mut scene, Shape::Cylinder(tube));
    node(&mut scene, Shape::Plane(Plane { point: Vec3::Y * 2.5 * scale, normal: Vec3::NEG_Y }));
    World::build(scene).unwrap()
}

#[test]
fn threads_and_scale_change_no_bit() {
    let point = DVec3::new(0.1, 0.0, -0.2);
    let normal = DVec3::new(0.1, 0.2, 1.0).normalize();
    let seen = hemicube(&still_life(1.0), point, normal, &at(200, 0.3)).unwrap();
    assert!(seen.objects().len() == 4 && seen.sky > 0.1, "{seen:?}");
    for threads in [1, 2, 3, 7] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let again = pool.install(|| hemicube(&still_life(1.0), point, normal, &at(200, 0.3))).unwrap();
        assert_eq!(again, seen, "{threads} threads");
    }
    for power in [-20, 7, 30] {
        let world = still_life(2f32.powi(power));
        let again = hemicube(&world, point * 2f64.powi(power), normal, &at(200, 0.3)).unwrap();
        assert_eq!(again, seen, "2^{power}");
    }
}

#[test]
fn an_empty_world_is_all_sky() {
    let world = World::build(Scene::default()).unwrap();
    let seen = hemicube(&world, DVec3::ZERO, DVec3::Z, &at(3, 0.0)).unwrap();
    assert!(seen.primitives.is_empty() && (seen.sky - 1.0).abs() < 1e-12, "{seen:?}");
}
