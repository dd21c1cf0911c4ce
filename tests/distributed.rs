//! Distributed rays (5.6) compared with independent values. Formulas give coverage and light, still worlds give moving
//! ones, theory gives the noise.

use canaletto::Named;
use canaletto::Ray;
use canaletto::camera::Camera;
use canaletto::light::{DiskLight, Light, LightKind, Omni};
use canaletto::material::{Material, MaterialPoint, Phong, ScatteringFrame};
use canaletto::math::{AnimatedTransform, Rgb, Transform};
use canaletto::render::{Job, render};
use canaletto::scene::{
    Aperture, Content, Extrinsics, FilmSettings, Focus, Intrinsics, Lens, Node, SamplerKind, Sampling, Scene, Stage,
    View, WhittedSettings,
};
use canaletto::shape::{Cuboid, Disk, Shape, Sphere};
use canaletto::world::World;
use canaletto_tests::gallery::distributed_still_life;
use glam::{DVec3, Vec3};

/// A view so narrow that all its rays coincide, from the eye to the center.
fn narrow(eye: DVec3, center: DVec3) -> View {
    let intrinsics = Intrinsics { fovy: 1e-4, width: 1, height: 1, ..Intrinsics::default() };
    let up = if (center - eye).normalize().y.abs() < 0.9 { DVec3::Y } else { DVec3::X };
    View { name: "narrow".into(), intrinsics, extrinsics: Extrinsics { eye, center, up }, motion: Vec::new() }
}

/// The one pixel of a view with this number of samples.
fn pixel(scene: Scene, view: &View, samples: u32, stage: Stage) -> f64 {
    let film = FilmSettings { sampling: Sampling::Sampled(samples), ..FilmSettings::default() };
    let job = Job::new(Camera::of(view).unwrap(), film, WhittedSettings { stage, ..WhittedSettings::default() });
    f64::from(render(&World::build(scene).unwrap(), &job, &()).unwrap().picture.pixel(0, 0).r)
}

fn white() -> Vec<Material> {
    let plain = Phong { kd: Rgb::WHITE, ..Phong::default() };
    vec![Material::new("white", plain), Material::new("mirror", Phong { kd: Rgb::BLACK, k: Rgb::WHITE, ..plain })]
}

fn ball(center: Vec3, radius: f32) -> Node {
    Node::from(Shape::Sphere(Sphere { center, radius })).with_material(0)
}

fn moves(offset: DVec3) -> Vec<Transform> {
    vec![Transform::IDENTITY, Transform::translate(offset)]
}

/// The share of the time in which a ray hits a ball in uniform motion. During that time the ball's centre is nearer to
/// the line than its radius, a quadratic inequality.
fn share(origin: DVec3, direction: DVec3, center: DVec3, offset: DVec3, radius: f64) -> f64 {
    let d = direction.normalize();
    let across = |v: DVec3| v - d * v.dot(d);
    let (m, v) = (across(center - origin), across(offset));
    let (a, b, c) = (v.length_squared(), m.dot(v), m.length_squared() - radius * radius);
    let root = (b * b - a * c).max(0.0).sqrt();
    (((-b + root) / a).clamp(0.0, 1.0) - ((-b - root) / a).clamp(0.0, 1.0)).max(0.0)
}

#[test]
fn a_moving_balls_coverage_is_the_analytic_one() {
    let (eye, center, offset) = (DVec3::new(0.0, 0.0, 10.0), Vec3::new(-1.0, 0.2, 0.0), DVec3::new(3.0, 0.5, 1.0));
    let mut seen = 0;
    for i in 0..30 {
        let target = DVec3::new(f64::from(i) * 0.15 - 2.0, 0.3, 0.0);
        let scene =
            Scene { materials: white(), nodes: vec![ball(center, 0.6).with_motion(moves(offset))], ..Scene::default() };
        let found = pixel(scene, &narrow(eye, target), 1024, Stage::Unlit);
        let expected = share(eye, target - eye, center.as_dvec3(), offset, 0.6);
        assert!((found - expected).abs() < 2.5 / 1024.0, "towards {target}: {found}, not {expected}");
        seen += u32::from(expected > 0.0 && expected < 1.0);
    }
    assert!(seen > 15, "{seen}");
}

#[test]
fn a_turning_bars_coverage_is_the_analytic_one() {
    // A bar along x, 0.4 wide, turns by 120° around z. A ray at radius r hits it while its angle is within asin(0.2 /
    // r).
    let bar = Shape::Box(Cuboid { min: Vec3::new(-4.0, -0.2, -0.1), max: Vec3::new(4.0, 0.2, 0.1) });
    let turn = |degrees| Transform::rotate(DVec3::Z, degrees).unwrap();
    for (radius, angle) in [(1.0, 60.0), (2.0, 30.0), (3.0, 100.0), (0.5, 45.0), (3.0, -60.0f64)] {
        let target = turn(angle).point(DVec3::X * radius);
        let nodes = vec![Node::from(bar).with_material(0).with_motion(vec![turn(0.0), turn(120.0)])];
        let scene = Scene { materials: white(), nodes, ..Scene::default() };
        // The view is straight from the front, so that the bar's depth doesn't matter.
        let found = pixel(scene, &narrow(target + DVec3::Z * 50.0, target), 1024, Stage::Unlit);
        // The bar's other half arrives 180° later. For -60° that is at 120°: exactly half of its passage.
        let passage = 2.0 * (0.2 / radius).asin().to_degrees() / 120.0;
        let expected = if angle < 0.0 { passage / 2.0 } else { passage };
        assert!((found - expected).abs() < 2.5 / 1024.0, "{radius}, {angle}: {found}, not {expected}");
    }
}

#[test]
fn shadows_and_mirror_images_move_along() {
    let (center, offset) = (Vec3::new(-1.0, 3.0, 0.2), DVec3::new(2.5, 0.5, 0.0));
    let floor = |material| {
        Node::from(Shape::Disk(Disk { center: Vec3::ZERO, normal: Vec3::Y, radius: 50.0 })).with_material(material)
    };
    let lamp = DVec3::new(0.5, 9.0, 1.0);
    let eye = DVec3::new(3.0, 5.0, 8.0);
    for i in 0..12 {
        let target = DVec3::new(f64::from(i) * 0.5 - 3.5, 0.0, -0.3);
        let moving = ball(center, 0.7).with_motion(moves(offset));
        // The shadow is black; outside of it the value is n·L. The ray from the eye passes above the ball.
        let light = Light::new(LightKind::Omni(Omni::at(lamp.as_vec3())), Rgb::WHITE);
        let nodes = vec![floor(0), moving.clone(), Node::from(light)];
        let found =
            pixel(Scene { materials: white(), nodes, ..Scene::default() }, &narrow(eye, target), 1024, Stage::Shadow);
        let hidden = share(target, lamp - target, center.as_dvec3(), offset, 0.7);
        let seen = share(eye, target - eye, center.as_dvec3(), offset, 0.7);
        assert_eq!(seen, 0.0, "the test's own view is clear");
        let expected = (1.0 - hidden) * (lamp - target).normalize().y;
        assert!((found - expected).abs() < 3e-3, "shadow at {target}: {found}, not {expected}");
        // In the mirror the ball, white by ambient light, covers its share of the black background.
        let nodes = vec![floor(1), moving];
        let scene = Scene { materials: white(), nodes, ambient: Rgb::WHITE, ..Scene::default() };
        let found = pixel(scene, &narrow(eye, target), 1024, Stage::Reflection);
        let mirrored = (target - eye) * DVec3::new(1.0, -1.0, 1.0);
        let expected = share(target, mirrored, center.as_dvec3(), offset, 0.7);
        assert!((found - expected).abs() < 3e-3, "image at {target}: {found}, not {expected}");
    }
}

#[test]
fn light_of_a_moving_lamp_is_its_mean_over_time() {
    let floor = Node::from(Shape::Disk(Disk { center: Vec3::ZERO, normal: Vec3::Y, radius: 50.0 })).with_material(0);
    let light = Light::new(LightKind::Omni(Omni::at(Vec3::new(-4.0, 2.0, 0.0))), Rgb::WHITE);
    let (start, offset) = (DVec3::new(-4.0, 2.0, 0.0), DVec3::new(9.0, 0.0, 0.0));
    // The light is in a moving group, inside a group that is shrunk and moved.
    let around = Transform::translate(DVec3::new(0.0, 1.0, 0.0)).after(&Transform::scale(DVec3::splat(0.5)).unwrap());
    let group = Node::new(Content::Group(vec![Node::from(light)])).with_motion(moves(offset));
    let outer = Node::new(Content::Group(vec![group])).with_transform(&around);
    let scene = Scene { materials: white(), nodes: vec![floor, outer], ..Scene::default() };
    let found = pixel(scene, &narrow(DVec3::new(1.0, 8.0, 0.5), DVec3::ZERO), 1024, Stage::Diffuse);
    let n = 100_000;
    let at = |i: u32| around.point(start + offset * ((f64::from(i) + 0.5) / f64::from(n))).normalize().y;
    let expected = (0..n).map(at).sum::<f64>() / f64::from(n);
    assert!((found - expected).abs() < 1e-4, "{found}, not {expected}");
}

/// Hash noise in [-1, 1).
fn noise(i: u32, k: u32) -> f32 {
    let x = i.wrapping_mul(2_654_435_761).wrapping_add(k.wrapping_mul(0x9e37_79b1));
    (x ^ (x >> 15)).wrapping_mul(0x85eb_ca6b) as f32 / u32::MAX as f32 * 2.0 - 1.0
}

fn random_ray(i: u32) -> Ray {
    let h = |k| noise(i, k);
    Ray::new(Vec3::new(h(1) * 4.0, h(2) * 2.0 + 1.5, h(3) * 4.0), Vec3::new(h(4), h(5), h(6)))
}

#[test]
fn moving_hierarchies_find_what_brute_force_finds() {
    let world = World::build(distributed_still_life(1.0)).unwrap();
    assert!(world.moves());
    let mut hits = 0;
    for i in 0..20_000 {
        let (ray, time) = (random_ray(i), noise(i, 7) * 0.5 + 0.5);
        let fast = world.intersect_at(&ray, f32::INFINITY, time);
        assert_eq!(fast, world.intersect_brute_force_at(&ray, f32::INFINITY, time), "{ray:?} at {time}");
        hits += u32::from(fast.is_some());
    }
    assert!(hits > 10_000, "{hits}");
}

/// The scene at a fixed time, without motion.
fn frozen(nodes: &[Node], time: f64) -> Vec<Node> {
    nodes
        .iter()
        .map(|node| {
            let mut node = node.clone();
            if !node.motion.is_empty() {
                let pose = AnimatedTransform::new(&node.motion).unwrap().at(time);
                node.transform = pose.after(&node.transform).into();
                node.motion.clear();
            }
            if let Content::Group(children) = &mut node.content {
                *children = frozen(children, time);
            }
            node
        })
        .collect()
}

/// A moving world at a time has the hits of the still world of that time.
#[test]
fn every_moment_is_a_still_world() {
    let scene = distributed_still_life(1.0);
    let moving = World::build(scene.clone()).unwrap();
    for time in [0.0, 0.125, 0.5, 0.7, 1.0f32] {
        let freeze = |nodes: &[Node]| frozen(nodes, f64::from(time));
        let (nodes, prototypes) = (freeze(&scene.nodes), freeze(&scene.prototypes));
        let still = World::build(Scene { nodes, prototypes, ..scene.clone() }).unwrap();
        assert!(!still.moves());
        let (mut hits, mut grazing) = (0, 0);
        for i in 0..4000 {
            let ray = random_ray(i);
            let [a, b] = [moving.intersect_at(&ray, f32::INFINITY, time), still.intersect(&ray, f32::INFINITY)];
            let (Some(a), Some(b)) = (a, b) else {
                grazing += u32::from(a.is_some() != b.is_some());
                continue;
            };
            hits += 1;
            let (p, q) = (moving.surface(&ray, &a), still.surface(&ray, &b));
            if (p.point - q.point).length() > 1e-4 * (1.0 + p.point.length()) {
                grazing += 1;
                continue;
            }
            assert!((p.normal - q.normal).length() < 1e-3, "{ray:?}: {} and {}", p.normal, q.normal);
            assert_eq!(moving.object(&a).kind, still.object(&b).kind);
        }
        assert!(hits > 2000 && grazing < 6, "{hits} hits, {grazing} that differ");
    }
}

/// In a room of one colour a rough mirror is as bright as a smooth one. Frosted glass without attenuation is invisible.
#[test]
fn rough_surfaces_lose_no_light() {
    let room = |material: Phong, depth: u32| {
        let materials = vec![Material::new("rough", material)];
        let nodes = vec![ball(Vec3::ZERO, 1.0)];
        let world = World::build(Scene { background: Rgb::gray(0.5), materials, nodes, ..Scene::default() }).unwrap();
        let intrinsics = Intrinsics { fovy: 40.0, width: 40, height: 30, ..Intrinsics::default() };
        let extrinsics = Extrinsics { eye: DVec3::new(0.0, 0.0, 3.0), ..Extrinsics::default() };
        let film = FilmSettings { sampling: Sampling::Sampled(16), ..FilmSettings::default() };
        let settings = WhittedSettings { max_depth: depth, ..WhittedSettings::default() };
        let job = Job::new(Camera::new(&intrinsics, &extrinsics).unwrap(), film, settings);
        let picture = render(&world, &job, &()).unwrap().picture;
        assert!(world.intersect(&job.camera.line(20.0, 15.0).rounded(), f32::INFINITY).is_some());
        let values: Vec<f32> = picture.pixels.iter().map(|p| p.r).collect();
        let (least, most) = values.iter().fold((1f32, 0f32), |(a, b), &v| (a.min(v), b.max(v)));
        (least, most, values.iter().sum::<f32>() / values.len() as f32)
    };
    let black = Phong { kd: Rgb::BLACK, ..Phong::default() };
    for roughness in [0.05, 0.4, 1.0] {
        // The minimum is that of the ball, the maximum that of the background beside it.
        let (least, most, _) = room(Phong { k: Rgb::gray(0.8), roughness, ..black }, 3);
        assert!((least - 0.4).abs() < 1e-6 && (most - 0.5).abs() < 1e-6, "{roughness}: {least} to {most}");
        // A few rays stay inside the ball beyond the maximum depth.
        let (_, most, mean) = room(Phong { opacity: 0.0, eta: 1.5, roughness, ..black }, 256);
        println!("{roughness}: {mean}");
        assert!((mean - 0.5).abs() < 1e-3 && (most - 0.5).abs() < 1e-6, "{roughness}: up to {most}, mean {mean}");
    }
}

/// A white ball in a rough mirror is compared with the integral over all microfacets by Walter's density of visible
/// normals.
#[test]
fn rough_mirrors_scatter_by_the_ggx_density() {
    let (center, radius) = (DVec3::new(-2.0, 1.5, 0.5), 1.2);
    let eye = DVec3::new(3.0, 3.0, 0.0);
    let wo = eye.normalize();
    for roughness in [0.2f32, 0.5, 0.8] {
        let mut materials = white();
        materials[1].model.phong_mut().unwrap().roughness = roughness;
        let floor = Shape::Disk(Disk { center: Vec3::ZERO, normal: Vec3::Y, radius: 0.01 });
        let nodes = vec![Node::from(floor).with_material(1), ball(center.as_vec3(), radius as f32)];
        let scene = Scene { materials, nodes, ambient: Rgb::WHITE, ..Scene::default() };
        let found = pixel(scene, &narrow(eye, DVec3::ZERO), 1 << 14, Stage::Reflection);
        let alpha = f64::from(roughness * roughness);
        let n = 1500;
        let mut expected = 0.0;
        for i in 0..n * n {
            let at = |k: u32| (f64::from(k) + 0.5) / f64::from(n);
            let (theta, phi) = (at(i % n) * std::f64::consts::FRAC_PI_2, at(i / n) * std::f64::consts::TAU);
            let m = DVec3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin());
            let t = (1.0 - m.y * m.y) / (alpha * alpha) + m.y * m.y;
            let d = 1.0 / (std::f64::consts::PI * alpha * alpha * t * t);
            let g1 = 2.0 / (1.0 + (1.0 + alpha * alpha * (1.0 - wo.y * wo.y) / (wo.y * wo.y)).sqrt());
            let density = d * g1 * wo.dot(m).max(0.0) / wo.y;
            // A direction into the floor is reflected out of it.
            let mirrored = m * (2.0 * wo.dot(m)) - wo;
            let ray = DVec3::new(mirrored.x, mirrored.y.abs(), mirrored.z);
            let along = center.dot(ray);
            let meets = along > 0.0 && center.length_squared() - along * along < radius * radius;
            if meets {
                expected += density * theta.sin();
            }
        }
        expected *= std::f64::consts::PI * std::f64::consts::PI / f64::from(n * n);
        assert!((found - expected).abs() < 3e-3, "{roughness}: {found}, not {expected}");
        assert!(expected > 0.1 && expected < 0.999, "{expected}");
    }
}

/// A BSDF is what the integrator does. A white ball seen in a rough mirror, or through frosted glass, is as bright as
/// the integral of the evaluated BSDF over the directions to the ball.
#[test]
fn rough_surfaces_scatter_as_their_bsdf_evaluates() {
    let eye = DVec3::new(3.0, 3.0, 0.0);
    let wo = eye.normalize();
    for roughness in [0.3f32, 0.5, 0.8] {
        for glass in [false, true] {
            let (center, radius) = (DVec3::new(-2.0, if glass { -1.5 } else { 1.5 }, 0.5), 1.2);
            let black = Phong { kd: Rgb::BLACK, roughness, eta: 1.3, ..Phong::default() };
            let phong = if glass { Phong { opacity: 0.25, ..black } } else { Phong { k: Rgb::gray(0.75), ..black } };
            let mut materials = white();
            materials[1] = Material::new("rough", phong);
            let floor = Shape::Disk(Disk { center: Vec3::ZERO, normal: Vec3::Y, radius: 0.01 });
            let nodes = vec![Node::from(floor).with_material(1), ball(center.as_vec3(), radius as f32)];
            let scene = Scene { materials, nodes, ambient: Rgb::WHITE, ..Scene::default() };
            let found = pixel(scene, &narrow(eye, DVec3::ZERO), 1 << 14, Stage::Full);
            let frame = ScatteringFrame::flat(DVec3::Y, 1.0 / 1.3);
            let bsdf =
                Material::new("test", phong).bsdf(&MaterialPoint { classic: phong, ..MaterialPoint::default() }, frame);
            // Directions of the cone in which the ball is seen, in cells of equal solid angle.
            let axis = center.normalize();
            let (x, y) = axis.any_orthonormal_pair();
            let versine = 1.0 - (1.0 - radius * radius / center.length_squared()).sqrt();
            let n = 700;
            let mut expected = 0.0;
            for i in 0..n * n {
                let at = |k: u32| (f64::from(k) + 0.5) / f64::from(n);
                let cos = 1.0 - versine * at(i / n);
                let (s, c) = (std::f64::consts::TAU * at(i % n)).sin_cos();
                let wi = axis * cos + (x * c + y * s) * (1.0 - cos * cos).sqrt();
                expected += f64::from(bsdf.eval(wo, wi).r) * std::f64::consts::TAU * versine / f64::from(n * n);
            }
            assert!((found - expected).abs() < 4e-3, "{roughness}, glass {glass}: {found}, not {expected}");
            assert!(expected > 0.05 && expected < 0.749, "{expected}");
        }
    }
}

/// The light that one light adds is that of (5.32) and (5.38).
#[test]
fn lit_surfaces_are_what_the_equation_says() {
    for i in 0..40u32 {
        let at = |k: u32| (i * 7 + k * 13) as f32 * 0.618_034 % 1.0;
        let (kd, ks) = (Rgb::new(at(0), at(1), at(2)), Rgb::new(at(3), at(4), at(5)));
        let phong = Phong { kd, ks, n: 30.0 * at(6), ..Phong::default() };
        let (eye, lamp) = (DVec3::new(2.0, 1.0 + f64::from(at(7)), 0.3), Vec3::new(-2.5 * at(8), 1.5, at(9) - 0.5));
        let floor = Node::from(Shape::Disk(Disk { center: Vec3::ZERO, normal: Vec3::Y, radius: 1.0 }));
        let light = Light::new(LightKind::Omni(Omni::at(lamp)), Rgb::gray(0.8));
        let scene = Scene {
            materials: vec![Material::new("m", phong)],
            nodes: vec![floor.with_material(0), Node::from(light)],
            ..Scene::default()
        };
        let found = pixel(scene, &narrow(eye, DVec3::ZERO), 1, Stage::Specular);
        let (v, l) = (eye.normalize(), lamp.as_dvec3().normalize());
        let r_dot_l = (DVec3::Y * (2.0 * v.y) - v).dot(l).max(0.0);
        let expected = 0.8 * (f64::from(kd.r) * l.y + f64::from(ks.r) * r_dot_l.powf(f64::from(phong.n)));
        assert!((found - expected).abs() < 1e-5, "{phong:?}: {found}, not {expected}");
    }
}

/// A small part of the penumbra of a ball under a disk light, and of the outline of a ball out of focus. The pixels are
/// integrals over a light's disk or over a lens, with one edge in them.
fn half_shadow_and_blur() -> [(&'static str, Scene, View, Stage); 2] {
    let floor = Node::from(Shape::Disk(Disk { center: Vec3::ZERO, normal: Vec3::Y, radius: 50.0 })).with_material(0);
    let disk =
        DiskLight { disk: Disk { center: Vec3::new(0.5, 6.0, 0.0), normal: Vec3::NEG_Y, radius: 1.5 }, points: 1 };
    let light = Light { samples: 1, ..Light::new(LightKind::Disk(disk), Rgb::WHITE) };
    let nodes = vec![floor, ball(Vec3::new(0.0, 1.5, 0.0), 0.8), Node::from(light)];
    let scene = |nodes| Scene { materials: white(), nodes, ..Scene::default() };
    let view = |fovy, center, lens| {
        let intrinsics = Intrinsics { fovy, width: 16, height: 12, lens, ..Intrinsics::default() };
        let extrinsics = Extrinsics { eye: DVec3::new(2.0, 4.0, 7.0), center, up: DVec3::Y };
        View { name: "view".into(), intrinsics, extrinsics, motion: Vec::new() }
    };
    let lens = Lens { aperture: Aperture::Radius(0.5), focus: Focus::Distance(3.0), blades: 0, rotation: 0.0 };
    let outline = DVec3::new(0.0, 2.27, 0.0);
    [
        ("half shadow", scene(nodes), view(0.5, DVec3::new(0.7, 0.0, 0.5), None), Stage::Full),
        ("blur", scene(vec![ball(Vec3::new(0.0, 1.5, 0.0), 0.8)]), view(0.5, outline, Some(lens)), Stage::Unlit),
    ]
}

/// Noise falls with the number of samples as theory predicts: N^-1/2 for independent numbers. For stratified numbers
/// and Sobol's sequence it is N^-3/4, since shadows and outlines are edges.
#[test]
fn noise_of_pictures_falls_as_theory_says() {
    for (name, scene, view, stage) in half_shadow_and_blur() {
        let world = World::build(scene).unwrap();
        let camera = Camera::of(&view).unwrap();
        let picture = |samples, sampler, seed| {
            let film = FilmSettings { sampling: Sampling::Sampled(samples), sampler, ..FilmSettings::default() };
            let settings = WhittedSettings { stage, ..WhittedSettings::default() };
            let job = Job { seed, ..Job::new(camera.clone(), film, settings) };
            render(&world, &job, &()).unwrap().picture.pixels
        };
        let reference = picture(1 << 14, SamplerKind::Sobol, 99);
        let error = |samples, sampler| {
            let seeds = 4;
            let squares = (0..seeds).map(|seed| {
                let pixels = picture(samples, sampler, seed);
                let pairs = pixels.iter().zip(&reference);
                pairs.map(|(a, b)| f64::from(a.r - b.r).powi(2)).sum::<f64>() / reference.len() as f64
            });
            (squares.sum::<f64>() / f64::from(seeds as u32)).sqrt()
        };
        let counts = [4, 16, 64, 256];
        let rates = [(SamplerKind::Sobol, -0.75), (SamplerKind::Jittered, -0.75), (SamplerKind::Independent, -0.5)];
        for (sampler, expected) in rates {
            let word = sampler.name();
            let errors = counts.map(|n| error(n, sampler));
            let rate = (errors[3] / errors[0]).ln() / (64f64).ln();
            println!("{name:12} {word:12} {errors:.5?}: N^{rate:.3}");
            assert!((rate - expected).abs() < 0.08, "{name}, {word}: N^{rate}");
        }
    }
}
