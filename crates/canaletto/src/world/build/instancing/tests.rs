//! Tests that kept prototypes and dissolved ones give equal results, bit for bit.

use crate::camera::Camera;
use crate::explain::explain;
use crate::light::{Light, LightKind, Omni};
use crate::material::{Material, Phong};
use crate::math::{Rgb, Transform};
use crate::render::{Aov, Job, render};
use crate::scene::{Content, Extrinsics, FilmSettings, Intrinsics, Node, Scene, WhittedSettings};
use crate::shape::testing::Random;
use crate::shape::{Cuboid, Mesh, Plane, Shape, Sphere, SphereCloud, Torus};
use crate::world::build::instancing::InstancingPolicy;
use crate::world::build::reuse::Previous;
use crate::world::{BuildOptions, Hit, OccluderCache, RayBundle, World};
use canaletto_bvh::Ray;
use glam::{DAffine3, DMat3, DVec3, Vec3};

const WHOLE: InstancingPolicy = InstancingPolicy { members: 1, part: usize::MAX, alone: 64 };
const DISSOLVED: InstancingPolicy = InstancingPolicy { members: usize::MAX, part: 1, alone: 64 };

fn built(scene: &Scene, instancing: InstancingPolicy) -> World {
    World::lower(scene.clone(), &BuildOptions::default(), instancing, Previous::default()).unwrap()
}

/// A transform with translations up to `extent`: some transforms are the identity, others move, rotate,
/// mirror, shear and stretch.
fn place(random: &mut Random, extent: f64) -> Transform {
    let at = Transform::translate(random.vector().as_dvec3() * extent);
    let turn = Transform::rotate(random.vector().as_dvec3(), f64::from(random.signed()) * 180.0).unwrap_or_default();
    let scale = |f: DVec3| Transform::scale(f).unwrap();
    let shear = DMat3::IDENTITY + DMat3::from_cols(DVec3::ZERO, DVec3::X * 0.7, DVec3::Y * -0.4);
    let inner = match random.below(7) {
        0 => return if random.below(2) == 0 { Transform::IDENTITY } else { at },
        1 => scale(DVec3::new(1.0, -1.0, 1.0)),
        2 => scale(DVec3::new(1.5, 0.2, 0.7)),
        3 => scale(DVec3::splat(0.3)),
        4 => Transform::new(DAffine3::from_mat3(shear)).unwrap(),
        5 => Transform::translate(DVec3::new(-0.0, 300.0, -0.0)).after(&Transform::translate(-DVec3::Y * 299.5)),
        _ => Transform::IDENTITY,
    };
    at.after(&turn).after(&inner)
}

fn tetrahedron(offset: Vec3) -> Mesh {
    let corners = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
    let triangles = vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
    Mesh { positions: corners.map(|c| c * 0.5 + offset).to_vec(), triangles, ..Mesh::default() }
}

/// A scene with nested prototypes and every kind of content.
fn scene(random: &mut Random, moves: bool) -> Scene {
    let phong =
        |kd: f32, k: f32, opacity: f32| Phong { kd: Rgb::gray(kd), k: Rgb::gray(k), opacity, ..Phong::default() };
    let materials = vec![
        Material::new("clay", phong(0.7, 0.0, 1.0)),
        Material::new("silver", phong(0.2, 0.7, 1.0)),
        Material::new("glass", phong(0.1, 0.1, 0.4)),
    ];
    let mut prototypes = Vec::new();
    for level in 0..5u32 {
        let count = 2 + random.below(4);
        let members = (0..count + 3).map(|n| {
            let content = match random.below(if level == 0 { 6 } else { 12 }) {
                0 => Content::Shape(Sphere { center: random.vector(), radius: 0.3 }.into()),
                1 => {
                    let min = random.vector();
                    Content::Shape(Shape::Box(Cuboid { min, max: min + Vec3::splat(0.4) }))
                }
                2 => Content::Mesh(0),
                3 => Content::Mesh(1),
                4 => Content::Spheres(0),
                5 => Content::Shape(Shape::Torus(Torus { center: Vec3::ZERO, axis: Vec3::Y, radius: 0.4, tube: 0.1 })),
                _ => Content::Instance(random.below(level as usize) as u32),
            };
            let material = (random.below(4) == 0).then(|| random.below(3) as u32);
            let motion = if moves && level == 1 && n == 0 {
                vec![Transform::IDENTITY, Transform::translate(DVec3::X)]
            } else {
                Vec::new()
            };
            Node { material, motion: motion.into(), transform: place(random, 2.0).into(), ..Node::new(content) }
        });
        let mut members: Vec<Node> = members.collect();
        if level == 2 {
            let light = LightKind::Omni(Omni::at(random.vector() * 4.0));
            members.push(Node::new(Content::Light(Light::new(light, Rgb::gray(0.1)))));
            let plane = Shape::Plane(Plane { point: Vec3::new(0.0, -40.0, 0.0), normal: Vec3::Y });
            members.push(Node::from(plane).with_material(0));
        }
        let inside = Node { transform: place(random, 1.0).into(), ..Node::new(Content::Group(members)) };
        prototypes.push(Node { transform: place(random, 1.0).into(), ..Node::new(Content::Group(vec![inside])) });
    }
    let nodes = (0..6).map(|n| {
        let content = Content::Instance(if n == 0 { 4 } else { random.below(5) as u32 });
        let material = (n % 3 == 1).then_some(1);
        Node { material, transform: place(random, 3.0).into(), ..Node::new(content) }
    });
    let mut nodes: Vec<Node> = nodes.collect();
    nodes.insert(2, Node::new(Content::Mesh(0)).with_transform(&place(random, 3.0)));
    nodes.push(Node::from(Shape::Sphere(Sphere { center: random.vector(), radius: 0.5 })).with_material(2));
    nodes.push(Node::new(Content::Light(Light::new(LightKind::Omni(Omni::at(Vec3::splat(30.0))), Rgb::gray(0.5)))));
    let centers = (0..40).map(|_| random.vector() * 0.7).collect();
    Scene {
        materials,
        meshes: vec![tetrahedron(Vec3::ZERO), tetrahedron(Vec3::new(0.0, 300.0, 0.0))],
        spheres: vec![SphereCloud { centers, radii: vec![0.1], ..SphereCloud::default() }],
        prototypes,
        nodes,
        ..Scene::default()
    }
}

/// All data of a hit, as text that distinguishes every bit.
fn all_of(world: &World, ray: &Ray, hit: Option<Hit>) -> String {
    hit.map_or_else(String::new, |hit| {
        let surface = world.surface(ray, &hit);
        let names = (&world.object(&hit).name, world.object_id(&hit), world.material_index(&hit));
        format!("{hit:?} {surface:?} {names:?} {:?}", world.surface_differential(ray, &hit))
    })
}

/// A ray at edges and corners of the objects' local boxes, or at their inside. It starts near, far or very far, and may
/// be parallel to axes.
fn ray_at(flat: &World, random: &mut Random) -> Ray {
    let instance = &flat.geometry.root.instances[random.below(flat.geometry.root.instances.len())];
    let bounds = flat.geometry.geometries[instance.geometry as usize].bounds();
    let part = |random: &mut Random| [0.0, 1.0, 0.5 + 0.5 * random.signed()][random.below(3)];
    let at = Vec3::new(part(random), part(random), part(random));
    let target = (bounds.min + (bounds.max - bounds.min) * at).as_dvec3();
    let target = instance.to_world.map_or(target, |t| t.point(target)).as_vec3();
    let mut direction = random.vector() * [1.0, 3e-20, 1e15][random.below(6).saturating_sub(3)];
    if random.below(6) == 0 {
        direction[random.below(3)] = 0.0;
    }
    let size = direction.abs().max_element().max(1e-30);
    Ray::new(target - direction / size * [1.0, 30.0, 1e3, 1e5, 1e6][random.below(5)], direction)
}

#[test]
fn whole_prototypes_are_met_as_dissolved_ones() {
    let random = &mut Random(71);
    let (mut hits, mut nested, mut far) = (0, 0, 0);
    for round in 0..24 {
        let scene = scene(random, round % 4 == 3);
        let [whole, flat] = [WHOLE, DISSOLVED].map(|instancing| built(&scene, instancing));
        assert!(flat.geometry.groups.is_empty() && flat.geometry.root.is_flat());
        nested += usize::from(!whole.geometry.root.is_flat());
        let stats = whole.stats();
        assert_eq!((stats.instances, stats.primitives), (flat.stats().instances, flat.stats().primitives));
        let (mut last, mut bundle) = (OccluderCache::NONE, RayBundle::default());
        for n in 0..800 {
            let ray = &ray_at(&flat, random);
            let time = [0.0, 0.4][n % 2];
            let expected = flat.intersect_at(ray, f32::INFINITY, time);
            let found = whole.intersect_at(ray, f32::INFINITY, time);
            assert_eq!(all_of(&whole, ray, found), all_of(&flat, ray, expected), "{round} {n} {ray:?}");
            if n % 50 == 0 {
                assert_eq!(
                    whole.intersect_brute_force_at(ray, f32::INFINITY, time),
                    flat.intersect_brute_force_at(ray, f32::INFINITY, time)
                );
            }
            let t = expected.map_or(1.0, |hit| hit.t);
            for t_max in [t, t.next_down(), t * 4.0] {
                let expected = flat.intersect_at(ray, t_max, time);
                assert_eq!(whole.intersect_at(ray, t_max, time), expected, "{round} {n} {ray:?}");
                assert_eq!(
                    whole.occlusion(ray, t_max, time, &mut last),
                    flat.occlusion(ray, t_max, time, &mut OccluderCache::NONE.clone())
                );
                let [a, b] = [&whole, &flat]
                    .map(|w| w.transmittance(ray, t_max, time, None, &mut OccluderCache::NONE.clone(), &mut ()));
                assert_eq!(a.to_bits(), b.to_bits());
            }
            bundle.clear();
            bundle.push(*ray, f32::INFINITY);
            bundle.push(*ray, t.next_down());
            bundle.set_times([time, time]);
            whole.intersect_batch(&mut bundle);
            assert_eq!(bundle.hit(0), expected);
            hits += usize::from(expected.is_some());
            far += usize::from(expected.is_some_and(|hit| hit.t * ray.direction.abs().max_element() > 1e4));
        }
    }
    assert!(hits > 8000 && nested > 15 && far > 2000, "{hits} {nested} {far}");
}

#[test]
fn rays_together_meet_whole_prototypes_as_alone() {
    let random = &mut Random(73);
    let mut found = [0; 4];
    for round in 0..16 {
        let scene = scene(random, round % 4 == 3);
        let [whole, flat] = [WHOLE, DISSOLVED].map(|instancing| built(&scene, instancing));
        assert!(!whole.is_small());
        let (mut bundle, mut last) = (RayBundle::default(), OccluderCache::NONE);
        for n in 0..120 {
            // Rays side by side, rays with one origin, or any rays; some with an end.
            let first = ray_at(&flat, random);
            let spread = first.direction.abs().max_element() * [0.0, 1e-4, 0.1][n % 3];
            let rays: Vec<(Ray, f32, f32)> = (0..[3, 20, 150][n / 3 % 3])
                .map(|index| {
                    let ray = match n % 4 {
                        3 => ray_at(&flat, random),
                        2 => Ray::new(first.origin + random.vector() * 0.1, first.direction + random.vector() * spread),
                        _ => Ray::new(first.origin, first.direction + random.vector() * spread),
                    };
                    let t = flat.intersect_at(&ray, f32::INFINITY, 0.4).map_or(1.0, |hit| hit.t);
                    let t_max = [f32::INFINITY, t, t.next_down(), f32::INFINITY][(n + index) % 4];
                    (ray, t_max, [0.4, 0.0, 0.4, 0.9][index % 4])
                })
                .collect();
            bundle.clear();
            rays.iter().for_each(|(ray, t_max, _)| bundle.push(*ray, *t_max));
            bundle.set_times(rays.iter().map(|(.., time)| *time));
            whole.intersect_batch(&mut bundle);
            whole.occlusion_batch(&mut bundle, &mut last);
            for (index, (ray, t_max, time)) in rays.iter().enumerate() {
                let expected = flat.intersect_at(ray, *t_max, *time);
                assert_eq!(bundle.hit(index), expected, "{round} {n} {index} {ray:?}");
                let between = flat.occlusion(ray, *t_max, *time, &mut OccluderCache::NONE.clone());
                assert_eq!(bundle.occlusion(index), between, "{round} {n} {index} {ray:?} {t_max}");
                found[between as usize] += 1;
                found[3] += usize::from(expected.is_some());
            }
        }
    }
    assert!(found.iter().all(|&n| n > 500), "{found:?}");
}

#[test]
fn whole_prototypes_make_the_same_pictures() {
    let random = &mut Random(72);
    for _ in 0..3 {
        let scene = scene(random, false);
        let [whole, flat] = [WHOLE, DISSOLVED].map(|instancing| built(&scene, instancing));
        let intrinsics = Intrinsics { fovy: 50.0, width: 40, height: 30, ..Intrinsics::default() };
        let extrinsics = Extrinsics { eye: DVec3::new(0.0, 2.0, 14.0), ..Extrinsics::default() };
        let camera = Camera::new(&intrinsics, &extrinsics).unwrap();
        let job = Job::new(camera, FilmSettings::default(), WhittedSettings::default());
        let job = Job { aovs: vec![Aov::ObjectId, Aov::Normal, Aov::MaterialId, Aov::Depth], ..job };
        let [a, b] = [&whole, &flat].map(|world| render(world, &job, &()).unwrap());
        assert_eq!(format!("{:?}", a.picture), format!("{:?}", b.picture));
        assert_eq!(a.counts, b.counts);
        for (x, y) in [(20, 15), (10, 12), (25, 20), (30, 8)] {
            let [a, b] = [&whole, &flat].map(|world| format!("{:?}", explain(world, &job, x, y).unwrap()));
            assert_eq!(a, b);
        }
    }
}

#[test]
fn a_long_chain_of_prototypes_is_followed_to_its_end() {
    let step = Transform::translate(DVec3::new(0.01, 0.0, 0.0));
    let many =
        (0..9).map(|n| Node::new(Content::Mesh(0)).with_transform(&Transform::translate(DVec3::Y * f64::from(n))));
    let mut prototypes = vec![Node::new(Content::Group(many.collect()))];
    prototypes.extend((0..250).map(|n| Node::new(Content::Instance(n)).with_transform(&step)));
    let nodes = vec![Node::new(Content::Instance(250))];
    let scene = Scene { meshes: vec![tetrahedron(Vec3::ZERO)], prototypes, nodes, ..Scene::default() };
    let [whole, flat] = [WHOLE, DISSOLVED].map(|instancing| built(&scene, instancing));
    assert_eq!(whole.geometry.groups.len(), 251);
    for n in 0..9 {
        let ray = Ray::new(Vec3::new(2.6, n as f32 + 0.1, 4.0), Vec3::new(0.0, 0.0, -1.0));
        let hit = whole.intersect(&ray, f32::INFINITY);
        assert!(hit.is_some_and(|hit| hit.instance == n));
        assert_eq!(all_of(&whole, &ray, hit), all_of(&flat, &ray, flat.intersect(&ray, f32::INFINITY)));
    }
}
