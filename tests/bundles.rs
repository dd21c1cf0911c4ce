//! Rays in a batch have the results that each ray has alone.

use canaletto::camera::Camera;
use canaletto::explain::{Explainer, explain};
use canaletto::film::Picture;
use canaletto::light::{Light, LightKind, Omni};
use canaletto::material::{Material, Phong};
use canaletto::math::{Rgb, Transform};
use canaletto::render::{Aov, Job, Preparation, Session, render};
use canaletto::scene::{Content, Guiding, Node, PathSettings, SamplerKind, Sampling, Scene};
use canaletto::shape::{
    Cone, Cuboid, Cylinder, CylinderCloud, Disk, Mesh, MeshPose, Parallelogram, Plane, Shape, Sphere, SphereCloud,
    Torus, Triangle,
};
use canaletto::world::{OccluderCache, Occlusion, RayBundle, World};
use canaletto::{InstructionSet, Ray};
use canaletto_io::assets::{FolderAssets, MemoryAssets};
use canaletto_io::text::read_scene;
use canaletto_tests::gallery::{icosphere, still_life, still_life_job};
use canaletto_tests::{Random, root};
use glam::{DVec3, Vec3};

/// Moves a mesh's vertices while the shutter is open, the upper ones most.
fn swell(mesh: &mut Mesh) {
    let positions = mesh.positions.iter().map(|p| *p * (1.0 + 0.3 * p.y) + Vec3::X * 0.5 * p.y * p.y).collect();
    let normals = mesh.normals.iter().map(|n| *n + Vec3::Y * 0.3 * n.x).collect();
    mesh.end_pose = Some(Box::new(MeshPose { positions, normals, tangents: Vec::new() }));
}

/// A mesh whose vertices move has, at each time, the hits, surfaces and shadows of a mesh at rest in between.
#[test]
fn vertices_move_on_lines() {
    let mesh = |at: Option<f32>| {
        let mut mesh = icosphere(3, 0.8, true);
        swell(&mut mesh);
        if let Some((at, pose)) = at.zip(mesh.end_pose.as_ref()) {
            let mean = |open: &[Vec3], close: &[Vec3]| {
                open.iter().zip(close).map(|(a, b)| a.as_dvec3().lerp(b.as_dvec3(), at.into()).as_vec3()).collect()
            };
            (mesh.positions, mesh.normals) =
                (mean(&mesh.positions, &pose.positions), mean(&mesh.normals, &pose.normals));
            mesh.end_pose = None;
        }
        mesh
    };
    let turned = Transform::rotate(DVec3::new(1.0, 2.0, 0.5), 40.0).unwrap();
    let world = |at: Option<f32>, place: &Transform| {
        let nodes = vec![Node::new(Content::Mesh(0)).with_transform(place)];
        World::build(Scene { meshes: vec![mesh(at)], nodes, ..Scene::default() }).unwrap()
    };
    let (mut random, mut hits, mut differ) = (Random(4), 0, 0);
    for place in [Transform::IDENTITY, turned] {
        let moving = world(None, &place);
        assert!(moving.moves());
        for time in [0.0, 0.25, 0.5, 1.0] {
            let still = world(Some(time), &place);
            for _ in 0..2000 {
                let origin = random.cube().normalize() * 4.0;
                let ray = Ray::new(origin, random.cube() * 1.2 - origin);
                let [found, expected] =
                    [moving.intersect_at(&ray, f32::INFINITY, time), still.intersect(&ray, f32::INFINITY)];
                assert_eq!(found, moving.intersect_brute_force_at(&ray, f32::INFINITY, time));
                let (Some(found), Some(expected)) = (found, expected) else {
                    differ += u32::from(found.is_some() != expected.is_some());
                    continue;
                };
                let [surface, other] = [moving.surface(&ray, &found), still.surface(&ray, &expected)];
                assert!((surface.exact - other.exact).length() < 1e-5, "{surface:?} {other:?}");
                assert!((surface.shading_normal - other.shading_normal).length() < 1e-3, "{surface:?} {other:?}");
                hits += 1;
            }
        }
    }
    assert!(hits > 6000 && differ < 4, "{hits} hits, {differ} of only one");
}

/// A scene of few primitives, each of which is tested with whole ray batches. There are plain, rotated, mirroring and
/// glass meshes, loose spheres and a plane. If `moves`, one mesh moves, and the vertices of two others do.
fn few_things(moves: bool) -> Scene {
    let phong = |kd: Rgb, k: f32, opacity: f32| Phong {
        kd,
        ks: Rgb::gray(0.5),
        n: 30.0,
        k: Rgb::gray(k),
        eta: 1.4,
        opacity,
        ..Phong::default()
    };
    let materials = vec![
        Material::new("clay", phong(Rgb::new(0.6, 0.5, 0.4), 0.0, 1.0)),
        Material::new("silver", phong(Rgb::gray(0.1), 0.8, 1.0)),
        Material::new("glass", phong(Rgb::gray(0.05), 0.1, 0.3)),
    ];
    let at = |x: f64, y: f64, z: f64| Transform::translate(DVec3::new(x, y, z));
    let turned = at(-1.5, 0.6, -0.5).after(&Transform::rotate(DVec3::new(1.0, 2.0, 0.5), 40.0).unwrap());
    let squeezed = at(1.6, 0.5, 0.2).after(&Transform::scale(DVec3::new(0.5, 0.8, 0.7)).unwrap());
    let ball = |x: f32, y: f32, z: f32, r: f32, m: u32| {
        Node::from(Shape::Sphere(Sphere { center: Vec3::new(x, y, z), radius: r })).with_material(m)
    };
    let mut moving = Node::new(Content::Mesh(1)).with_material(0).with_transform(&at(0.4, 1.6, -1.0));
    if moves {
        moving.motion = vec![Transform::IDENTITY, at(0.6, 0.2, 0.0)].into();
    }
    let light = |x: f32, y: f32, z: f32, w: f32| {
        let position = [x, y, z, w];
        Node::new(Content::Light(Light::new(LightKind::Omni(Omni { position, range: 0.0 }), Rgb::gray(0.5))))
    };
    let mut meshes = vec![icosphere(4, 0.8, true), icosphere(2, 0.6, false), icosphere(0, 0.4, false)];
    if moves {
        meshes[..2].iter_mut().for_each(swell);
    }
    Scene {
        materials,
        meshes,
        nodes: vec![
            Node::from(Shape::Plane(Plane { point: Vec3::NEG_Y * 0.5, normal: Vec3::Y })).with_material(0),
            Node::new(Content::Mesh(0)).with_material(0),
            Node::new(Content::Mesh(0)).with_material(1).with_transform(&turned),
            Node::new(Content::Mesh(1)).with_material(2).with_transform(&squeezed),
            Node::new(Content::Mesh(2)).with_material(0).with_transform(&at(0.0, 0.0, 2.0)),
            moving,
            ball(1.0, 0.0, 1.5, 0.5, 1),
            ball(-0.8, 0.1, 1.4, 0.45, 2),
            ball(0.2, -0.3, 1.3, 0.2, 0),
            light(3.0, 6.0, 5.0, 1.0),
            light(-1.0, 2.0, 1.0, 0.0),
        ],
        ..Scene::default()
    }
}

/// Loose shapes of all kinds, every third of glass. Two boxes have coplanar upper sides. Eight shapes are tested
/// without a tree, more with one.
fn loose_things(count: usize) -> Scene {
    let v = Vec3::new;
    let (base, top, radius, caps) = (v(-1.2, -0.5, -0.4), v(-1.0, 0.8, -0.2), 0.4, true);
    let shapes = [
        Shape::Box(Cuboid { min: v(-2.0, -0.7, -2.0), max: v(0.5, -0.5, 2.0) }),
        Shape::Box(Cuboid { min: v(-0.5, -0.9, -2.0), max: v(2.0, -0.5, 2.0) }),
        Shape::Sphere(Sphere { center: v(1.0, 0.0, 0.5), radius: 0.5 }),
        Shape::Triangle(Triangle {
            a: v(-1.0, -0.4, 1.0),
            b: v(0.6, -0.5, 0.9),
            c: v(0.0, 0.9, 0.8),
            one_sided: false,
        }),
        Shape::Disk(Disk { center: v(0.2, 1.0, 0.0), normal: v(0.1, 1.0, 0.3), radius: 0.7 }),
        Shape::Cylinder(Cylinder { base, top, radius, caps }),
        Shape::Cone(Cone { base: top, top: base, radius, top_radius: 0.1, caps: false }),
        Shape::Torus(Torus { center: v(0.3, 0.1, -0.9), axis: v(0.2, 1.0, 0.5), radius: 0.6, tube: 0.2 }),
        Shape::Rectangle(Parallelogram { corner: v(-1.5, -0.4, 0.7), u: v(0.9, 0.1, 0.1), v: v(0.1, 0.8, -0.2) }),
    ];
    let place = |i: usize| Transform::translate(DVec3::new(0.1, 0.2, -0.3) * (i / shapes.len()) as f64);
    let nodes = (0..count).map(|i| {
        Node::from(shapes[i % shapes.len()]).with_material(if i % 3 == 2 { 2 } else { 0 }).with_transform(&place(i))
    });
    Scene { materials: few_things(false).materials, nodes: nodes.collect(), ..Scene::default() }
}

/// Many instances of the meshes of [`few_things`], close together, of clay, silver and glass. If `moves`, every fifth
/// moves.
fn many_things(moves: bool) -> Scene {
    let (mut random, mut scene) = (Random(9), few_things(moves));
    for n in 0..60 {
        let place = Transform::translate(random.cube().as_dvec3() * 1.5)
            .after(&Transform::rotate(random.cube().as_dvec3(), 90.0).unwrap())
            .after(&Transform::scale(DVec3::new(0.4, 0.3, 0.5)).unwrap());
        let mut node =
            Node::new(Content::Mesh(1 + n % 2)).with_material([0, 0, 1, 2][n as usize % 4]).with_transform(&place);
        if moves && n % 5 == 0 {
            let turn = Transform::rotate(DVec3::Y, 30.0).unwrap();
            node.motion = vec![Transform::IDENTITY, Transform::translate(DVec3::Y * 0.3).after(&turn)].into();
        }
        scene.nodes.push(node);
    }
    if moves {
        let omni = Omni::at(Vec3::new(2.0, 3.0, 1.0));
        let mut light = Node::new(Content::Light(Light::new(LightKind::Omni(omni), Rgb::gray(0.4))));
        light.motion = vec![Transform::IDENTITY, Transform::translate(DVec3::X * 2.0)].into();
        scene.nodes.push(light);
    }
    scene
}

/// Clouds of `count` spheres and `count` cylinders, of clay and of glass; the glass ones are rotated. A small cloud is
/// tested with whole batches, a larger one ray by ray, and a large one in packets.
fn clouds(count: usize) -> Scene {
    let mut random = Random(count as u64);
    let mut spheres = || SphereCloud {
        centers: (0..count).map(|_| random.cube()).collect(),
        radii: vec![0.8 / (count as f32).cbrt()],
        ..SphereCloud::default()
    };
    let spheres = vec![spheres(), spheres()];
    let mut cylinders = || CylinderCloud {
        axes: (0..count).map(|_| [random.cube(), random.cube()]).collect(),
        radii: vec![0.2 / (count as f32).cbrt()],
        ..CylinderCloud::default()
    };
    let cylinders = vec![cylinders(), cylinders()];
    let turned = Transform::rotate(DVec3::new(1.0, 2.0, 0.5), 40.0).unwrap();
    let node = |(content, glass): (Content, bool)| {
        let place = if glass { turned } else { Transform::IDENTITY };
        Node::new(content).with_material(if glass { 2 } else { 0 }).with_transform(&place)
    };
    let nodes = (0..2).flat_map(|i| [Content::Spheres(i), Content::Cylinders(i)].map(|content| (content, i == 1)));
    let nodes = nodes.map(node).collect();
    Scene { materials: few_things(false).materials, spheres, cylinders, nodes, ..Scene::default() }
}

/// Ray batches of any size. Their directions are nearly parallel or arbitrary, some along an axis. Rays end at the end
/// of their direction or are unbounded.
fn bundles(count: usize) -> impl Iterator<Item = Vec<(Ray, f32)>> {
    let mut random = Random(5);
    (0..count).map(move |n| {
        let spread = [0.0, 0.003, 0.1, 1.0][n % 4];
        let (origin, to) = (random.cube() * 3.0 + Vec3::Y, random.cube());
        let axis = n % 7 == 0;
        (0..1 + n % 50)
            .map(|i| {
                let origin = origin + random.cube() * spread;
                let mut direction = to + random.cube() * spread - origin;
                if axis && i % 5 == 0 {
                    direction.x = 0.0;
                }
                (Ray::new(origin, direction), [f32::INFINITY, 1.0 - f32::EPSILON][(n + i) / 3 % 2])
            })
            .collect()
    })
}

#[test]
fn bundles_find_what_brute_force_finds() {
    for (name, scene, times) in [
        ("few", few_things(false), &[0.0][..]),
        ("moving", few_things(true), &[0.0, 0.3, 1.0]),
        ("loose", loose_things(8), &[0.0]),
        ("more loose", loose_things(13), &[0.0]),
        ("few in clouds", clouds(4), &[0.0]),
        ("more in clouds", clouds(20), &[0.0]),
        ("many in clouds", clouds(40), &[0.0]),
        ("many", still_life(1.0), &[0.0]),
        ("many meshes", many_things(false), &[0.0]),
        ("many moving", many_things(true), &[0.0, 0.3, 1.0, 0.3, 0.7]),
    ] {
        let world = World::build(scene).unwrap();
        assert_eq!(world.stats().instances > 8, name.starts_with("many ") && !name.contains("cloud") || name == "many");
        let (mut bundle, mut last) = (RayBundle::default(), OccluderCache::NONE);
        let mut found = [0; 4];
        for (n, rays) in bundles(450).enumerate() {
            // Each ray has a time of its own, or all have one.
            let time = |index: usize| times[if n % 3 == 0 { n } else { n + index } % times.len()];
            bundle.clear();
            rays.iter().for_each(|(ray, t_max)| bundle.push(*ray, *t_max));
            if times.len() > 1 {
                bundle.set_times((0..rays.len()).map(time));
            }
            world.intersect_batch(&mut bundle);
            world.occlusion_batch(&mut bundle, &mut last);
            for (index, (ray, t_max)) in rays.iter().enumerate() {
                let time = time(index);
                let expected = world.intersect_brute_force_at(ray, *t_max, time);
                assert_eq!(bundle.hit(index), expected, "{name} {ray:?}");
                // Unattenuated rays have full transmittance, and opaque surfaces have none.
                let passes = world.transmittance(ray, *t_max, time, None, &mut OccluderCache::NONE.clone(), &mut ());
                let between = match (expected, passes) {
                    (None, _) => Occlusion::Nothing,
                    (_, 0.0) => Occlusion::Opaque,
                    _ => Occlusion::Clear,
                };
                assert_eq!(bundle.occlusion(index), between, "{name} {ray:?} {t_max}");
                found[between as usize] += 1;
                found[3] += usize::from(expected.is_some());
            }
        }
        assert!(found.iter().all(|&n| n > 100), "{name}: {found:?}");
    }
}

fn job(width: u32, height: u32, sampling: Sampling) -> Job {
    still_life_job(1.0, width, height, sampling)
}

#[test]
fn what_bundles_paint_is_explained() {
    let worlds = [few_things(false), few_things(true), many_things(true)].map(|scene| World::build(scene).unwrap());
    let samplings = [Sampling::Center, Sampling::Jittered(2), Sampling::Adaptive { n: 2, threshold: 0.05 }];
    for (world, sampling) in worlds.iter().flat_map(|world| samplings.map(|sampling| (world, sampling))) {
        let job = job(48, 36, sampling);
        let picture = render(world, &job, &()).unwrap().picture;
        for (x, y) in (0..36).flat_map(|y| (0..48).map(move |x| (x, y))) {
            let (sum, pixel) = (explain(world, &job, x, y).unwrap().sum(), picture.pixel(x, y));
            assert_eq!(sum.to_array().map(f32::to_bits), pixel.to_array().map(f32::to_bits), "{sampling:?} {x} {y}");
        }
    }
}

#[test]
fn rays_are_counted_alike_alone_and_together() {
    for scene in [few_things(false), few_things(true), many_things(false), many_things(true)] {
        let world = World::build(scene).unwrap();
        for sampling in [Sampling::Corner, Sampling::Sampled(3), Sampling::Adaptive { n: 3, threshold: 0.1 }] {
            let together = job(50, 37, sampling);
            // A probe writes layers and traces rays one by one.
            let alone = Job { aovs: vec![Aov::Cost], tile: 7, ..together.clone() };
            let [together, alone] = [together, alone].map(|job| render(&world, &job, &()).unwrap());
            assert_eq!(together.picture.pixels, alone.picture.pixels);
            assert_eq!(together.counts, alone.counts);
            let cost: f32 = alone.picture.layers[0].data.iter().sum();
            assert_eq!(cost as u64, together.counts.rays.total());
        }
    }
}

/// Diffuse vertices and those of rough metals are shaded eight side by side in a picture, and one by one in an
/// explanation.
#[test]
fn opaque_paths_are_alike_alone_and_together() {
    let assets = FolderAssets::new(root().join("tests/scenes")).unwrap();
    let scene = read_scene("opaque-paths.kdl", &assets).unwrap().0;
    let all = (0, true, Guiding::Off);
    let settings = [
        (SamplerKind::Sobol, all),
        (SamplerKind::BlueNoise, all),
        (SamplerKind::Jittered, all),
        (SamplerKind::Independent, all),
        (SamplerKind::Sobol, (5, false, Guiding::Off)),
        (SamplerKind::Sobol, (2, true, Guiding::Off)),
        (SamplerKind::Sobol, (0, true, Guiding::On)),
    ];
    paths_are_alike_alone_and_together(&scene, &settings);
}

/// So they are under clear bodies, which lights and the sun shine through, with and without bodies that light passes
/// straight on.
#[test]
fn paths_under_clear_bodies_are_alike_alone_and_together() {
    let assets = FolderAssets::new(root().join("tests/scenes")).unwrap();
    let mut scene = read_scene("clear-paths.kdl", &assets).unwrap().0;
    for is_straight in [false, true] {
        if is_straight {
            let sheet = Phong { kd: Rgb::gray(0.1), opacity: 0.3, ..Phong::default() };
            scene.materials.push(Material::new("sheet", sheet));
            let disk = Shape::Disk(Disk { center: Vec3::Y * 2.6, normal: Vec3::Y, radius: 3.0 });
            scene.nodes.push(Node::from(disk).with_material(scene.materials.len() as u32 - 1));
        }
        paths_are_alike_alone_and_together(&scene, &[(SamplerKind::Sobol, (0, true, Guiding::Off))]);
    }
}

fn paths_are_alike_alone_and_together(scene: &Scene, settings: &[(SamplerKind, (u32, bool, Guiding))]) {
    let world = World::build(scene.clone()).unwrap();
    for &(sampler, (max_depth, roulette, guiding)) in settings {
        let mut job = Job::new(Camera::of(&scene.views[0]).unwrap(), scene.film, scene.integrator);
        (job.film.sampling, job.film.sampler) = (Sampling::Sampled(2), sampler);
        job.integrator = PathSettings { max_depth, roulette, guiding }.into();
        let pictures = InstructionSet::available().iter().map(|set| {
            set.limit();
            render(&world, &job, &()).unwrap().picture
        });
        let pictures: Vec<Picture> = pictures.collect();
        let session = Session::open(&world, &job, Preparation::default()).unwrap();
        let explainer = Explainer::new(&session);
        let (width, height) = (pictures[0].width, pictures[0].height);
        for (x, y) in (0..width * height).step_by(23).map(|pixel| (pixel % width, pixel / width)) {
            let alone = explainer.paths(x, y).unwrap().color.to_array().map(f32::to_bits);
            for picture in &pictures {
                let together = picture.pixel(x, y).to_array().map(f32::to_bits);
                assert_eq!(alone, together, "{sampler:?}, depth {max_depth}, {guiding:?}, pixel {x} {y}");
            }
        }
    }
}

/// So are paths that only the end of all long paths ends.
#[test]
fn long_paths_are_alike_alone_and_together() {
    let text = "camera { eye 0 0 0.9; center 0 0 0; fovy 60; size 6 6 }
        film { samples 2 }
        integrator \"path\" { guiding \"off\" }
        material \"white\" { kd 1 }
        material \"lamp\" { kd 0; emission 9 }
        box material=\"white\" { min -1 -1 -1; max 1 1 1 }
        disk material=\"lamp\" { center 0 0.99 0; normal 0 -1 0; radius 0.05 }";
    let scene = read_scene("room.kdl", &MemoryAssets::new().with("room.kdl", text)).unwrap().0;
    let world = World::build(scene.clone()).unwrap();
    let job = Job::new(Camera::of(&scene.views[0]).unwrap(), scene.film, scene.integrator);
    let rendered = render(&world, &job, &()).unwrap();
    // Two rays for each of several hundred scatterings.
    assert!(rendered.counts.rays.total() > 72 * 2 * 512, "{}", rendered.counts.rays.total());
    let session = Session::open(&world, &job, Preparation::default()).unwrap();
    let explainer = Explainer::new(&session);
    for (x, y) in (0..6).flat_map(|y| (0..6).map(move |x| (x, y))) {
        let alone = explainer.paths(x, y).unwrap().color.to_array().map(f32::to_bits);
        assert_eq!(alone, rendered.picture.pixel(x, y).to_array().map(f32::to_bits), "{x} {y}");
    }
}
