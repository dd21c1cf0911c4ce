//! Scenes made in code that use all features at once.

use canaletto::camera::Camera;
use canaletto::light::{Directional, DiskLight, Falloff, Light, LightKind, Omni, Spot};
use canaletto::material::{Material, Phong};
use canaletto::math::{Rgb, Transform};
use canaletto::render::Job;
use canaletto::scene::{
    Aperture, CameraProjection, Content, Extrinsics, FilmSettings, Focus, Intrinsics, Lens, Node, SamplerKind,
    Sampling, Scene, View, WhittedSettings,
};
use canaletto::shape::{
    Cone, Cuboid, Cylinder, CylinderCloud, Disk, Mesh, Plane, Shape, Sphere, SphereCloud, Torus, Triangle,
};
use glam::{DVec3, Vec3};

/// A still life with every shape, light and kind of node. Every length is multiplied by `scale`, which changes no
/// picture.
pub fn still_life(scale: f32) -> Scene {
    let v = |x: f32, y: f32, z: f32| Vec3::new(x, y, z) * scale;
    let material = |name: &str, phong: Phong| Material::new(name, phong);
    let shiny = |kd: Rgb| Phong { kd, ks: Rgb::gray(0.6), n: 40.0, ..Phong::default() };
    let materials = vec![
        material("clay", Phong { kd: Rgb::new(0.7, 0.6, 0.5), ..Phong::default() }),
        material("blue", shiny(Rgb::new(0.1, 0.2, 0.8))),
        material(
            "mirror",
            Phong { kd: Rgb::gray(0.05), ks: Rgb::gray(0.5), n: 100.0, k: Rgb::gray(0.8), ..Phong::default() },
        ),
        material(
            "glass",
            Phong {
                kd: Rgb::new(0.0, 0.1, 0.0),
                ks: Rgb::WHITE,
                n: 80.0,
                k: Rgb::gray(0.1),
                eta: 1.5,
                opacity: 0.2,
                ..Phong::default()
            },
        ),
        material("red", shiny(Rgb::new(0.8, 0.1, 0.1))),
    ];
    let shape = |s: Shape, m: u32| Node::from(s).with_material(m);
    let turned = |s: Shape, m: u32, t: Transform| shape(s, m).with_transform(&t);
    let squash = |p: Vec3| {
        let to = Transform::translate(p.as_dvec3());
        let scale = Transform::scale(DVec3::new(1.5, 0.6, 1.0)).unwrap();
        to.after(&Transform::rotate(DVec3::new(1.0, 1.0, 0.5), 35.0).unwrap()).after(&scale)
    };
    let ball = |r: f32| Shape::Sphere(Sphere { center: Vec3::ZERO, radius: r * scale });
    let lamp = Node::new(Content::Group(vec![
        shape(ball(0.3), 4),
        Node::from(Shape::Cylinder(Cylinder {
            base: v(0.0, -0.8, 0.0),
            top: v(0.0, -0.3, 0.0),
            radius: 0.1 * scale,
            caps: false,
        })),
    ]))
    .named("lamp");
    let instance = |x: f32, z: f32, degrees: f64| {
        let t = Transform::translate(v(x, 0.8, z).as_dvec3()).after(&Transform::rotate(DVec3::Z, degrees).unwrap());
        Node::new(Content::Instance(0)).with_material(1).with_transform(&t)
    };
    let intensity = Rgb::gray(0.4);
    let lights = [
        LightKind::Omni(Omni::at(v(4.0, 6.0, 5.0))),
        LightKind::Directional(Directional {
            towards: Vec3::new(0.3, -1.0, -0.2),
            beam: Some((v(0.0, 0.0, 0.0), 3.0 * scale)),
        }),
        Spot {
            position: v(-4.0, 5.0, 3.0),
            target: v(0.0, 0.0, 0.0),
            falloff: Falloff::Smooth { inner: 20.0, outer: 35.0 },
            range: 0.0,
        }
        .into(),
        LightKind::Disk(DiskLight {
            disk: Disk { center: v(0.0, 7.0, 0.0), normal: Vec3::NEG_Y, radius: scale },
            points: 5,
        }),
    ];
    let mut nodes = vec![
        shape(Shape::Plane(Plane { point: Vec3::ZERO, normal: Vec3::Y }), 0).named("ground"),
        shape(Shape::Sphere(Sphere { center: v(-1.5, 0.7, 0.0), radius: 0.7 * scale }), 3).named("glass ball"),
        shape(Shape::Sphere(Sphere { center: v(0.3, 0.5, -1.4), radius: 0.5 * scale }), 2),
        shape(Shape::Box(Cuboid { min: v(0.6, 0.0, 0.2), max: v(1.4, 0.8, 1.0) }), 1),
        shape(
            Shape::Torus(Torus {
                center: v(-0.3, 0.2, 1.4),
                axis: Vec3::new(0.1, 1.0, 0.0),
                radius: 0.5 * scale,
                tube: 0.2 * scale,
            }),
            4,
        ),
        shape(
            Shape::Cone(Cone {
                base: v(1.9, 0.0, -1.0),
                top: v(1.9, 1.3, -1.0),
                radius: 0.5 * scale,
                top_radius: 0.1 * scale,
                caps: true,
            }),
            1,
        ),
        shape(
            Shape::Disk(Disk { center: v(-2.6, 0.9, -1.5), normal: Vec3::new(1.0, 0.2, 1.0), radius: 0.9 * scale }),
            2,
        ),
        shape(
            Shape::Triangle(Triangle {
                a: v(2.2, 0.0, 1.4),
                b: v(3.0, 0.0, 0.8),
                c: v(2.6, 1.1, 1.0),
                one_sided: true,
            }),
            4,
        ),
        turned(ball(0.5), 4, squash(v(-0.6, 1.9, -0.6))),
        Node::new(Content::Mesh(0)).with_material(4).with_transform(&Transform::translate(v(0.9, 1.3, 0.6).as_dvec3())),
        Node::new(Content::Mesh(1)).with_material(3).with_transform(&squash(v(2.5, 0.6, 2.0))),
        Node::new(Content::Mesh(1)).with_transform(&squash(v(-2.7, 0.5, 1.5))),
        Node::new(Content::Spheres(0)).with_material(1),
        Node::new(Content::Cylinders(0)).with_transform(&squash(v(0.5, 0.3, 2.4))),
        instance(-0.9, 2.4, 0.0),
        instance(1.8, 2.7, 20.0),
    ];
    nodes.extend(lights.map(|kind| Node::from(Light::new(kind, intensity))));
    Scene {
        background: Rgb::new(0.3, 0.4, 0.6),
        ambient: Rgb::gray(0.15),
        materials,
        meshes: vec![icosphere(1, 0.5 * scale, true), icosphere(2, 0.5 * scale, false)],
        spheres: vec![SphereCloud {
            name: "grapes".into(),
            centers: (0..40)
                .map(|i| v((i % 8) as f32 * 0.2 - 0.6, 0.1 + (i / 8) as f32 * 0.17, 2.0 - (i / 8) as f32 * 0.05))
                .collect(),
            radii: vec![0.1 * scale],
            colors: (0..40).map(|i| Rgb::new(i as f32 / 40.0, 0.3, 0.5)).collect(),
            ..SphereCloud::default()
        }],
        cylinders: vec![CylinderCloud {
            name: "sticks".into(),
            axes: (0..12)
                .map(|i| [v(i as f32 * 0.12, 0.0, 0.0), v(i as f32 * 0.12 + 0.1, 0.6, (i % 3) as f32 * 0.2)])
                .collect(),
            radii: vec![0.04 * scale],
            caps: true,
            ..CylinderCloud::default()
        }],
        prototypes: vec![lamp],
        nodes,
        ..Scene::default()
    }
}

/// A job on the still life, small enough for tests.
pub fn still_life_job(scale: f32, width: u32, height: u32, sampling: Sampling) -> Job {
    let camera = Camera::of(&still_life_view(scale, width, height)).unwrap();
    Job::new(camera, FilmSettings { sampling, ..FilmSettings::default() }, WhittedSettings::default())
}

/// [`still_life_job`] with an orthographic camera. The plane through its eye cuts the glass ball.
pub fn orthographic_job(scale: f32, width: u32, height: u32, sampling: Sampling) -> Job {
    let s = f64::from(scale);
    let still = still_life_view(scale, width, height);
    let projection = CameraProjection::Orthographic { height: 5.0 * s };
    let intrinsics = Intrinsics { projection, near: None, ..still.intrinsics };
    let center = DVec3::new(-1.4, 0.7, 0.0) * s;
    let extrinsics = Extrinsics { eye: center + DVec3::new(0.2, 0.3, 0.4) * s, center, up: DVec3::Y };
    let camera = Camera::of(&View { intrinsics, extrinsics, ..still }).unwrap();
    Job::new(camera, FilmSettings { sampling, ..FilmSettings::default() }, WhittedSettings::default())
}

/// The still life with all kinds of sampling: random points of its light, and rough mirrors and glass. Many objects
/// move while the shutter is open, lights and copies among them.
pub fn distributed_still_life(scale: f32) -> Scene {
    let mut scene = still_life(scale);
    let step = |x: f64, y: f64, z: f64| Transform::translate(DVec3::new(x, y, z) * f64::from(scale));
    let turn = |degrees: f64| Transform::rotate(DVec3::new(0.2, 1.0, -0.3), degrees).unwrap();
    for (index, node) in scene.nodes.iter_mut().enumerate() {
        if let Content::Light(light) = &mut node.content {
            if light.has_area() {
                light.samples = 2;
            } else if matches!(light.kind, LightKind::Omni(_)) {
                node.motion = vec![Transform::IDENTITY, step(0.5, 0.0, 0.0)].into();
            }
            continue;
        }
        // The ground and some other objects don't move.
        let motion = match index % 4 {
            _ if index == 0 => Vec::new(),
            0 => vec![Transform::IDENTITY, step(0.2, 0.1, 0.0), step(0.1, 0.3, 0.1).after(&turn(20.0))],
            1 => vec![turn(-10.0), turn(25.0)],
            2 => vec![Transform::IDENTITY, turn(15.0).after(&Transform::scale(DVec3::new(1.2, 1.0, 0.9)).unwrap())],
            _ => Vec::new(),
        };
        node.motion = motion.into();
    }
    // Mirrors and glass are rough.
    for (material, roughness) in scene.materials[2..].iter_mut().zip([0.3, 0.4]) {
        material.model.phong_mut().unwrap().roughness = roughness;
    }
    // The lamp's parts move in the lamp, which moves in its copies.
    if let Content::Group(parts) = &mut scene.prototypes[0].content {
        parts[0].motion = vec![Transform::IDENTITY, step(0.0, 0.2, 0.0)].into();
    }
    scene
}

/// A job on the distributed still life, with a thin lens.
pub fn distributed_job(scale: f32, width: u32, height: u32, samples: u32, sampler: SamplerKind) -> Job {
    let s = f64::from(scale);
    let still = still_life_view(scale, width, height);
    let lens = Lens { aperture: Aperture::Radius(0.1 * s), focus: Focus::Center, blades: 5, rotation: 10.0 };
    let view = View { intrinsics: Intrinsics { lens: Some(lens), ..still.intrinsics }, ..still };
    let film = FilmSettings { sampling: Sampling::Sampled(samples), sampler, ..FilmSettings::default() };
    Job::new(Camera::of(&view).unwrap(), film, WhittedSettings::default())
}

fn still_life_view(scale: f32, width: u32, height: u32) -> View {
    let s = f64::from(scale);
    let intrinsics =
        Intrinsics { fovy: 45.0, width, height, near: Some(s), far: Some(100.0 * s), ..Intrinsics::default() };
    let extrinsics =
        Extrinsics { eye: DVec3::new(2.0, 3.0, 7.0) * s, center: DVec3::new(0.0, 0.5, 0.0) * s, up: DVec3::Y };
    View { name: "still life".into(), intrinsics, extrinsics, motion: Vec::new() }
}

/// A sphere of 20 · 4ⁿ triangles, closed, counter-clockwise from outside.
pub fn icosphere(subdivisions: u32, radius: f32, smooth: bool) -> Mesh {
    let phi = (1.0 + 5f32.sqrt()) / 2.0;
    let mut points: Vec<Vec3> = [(-1.0, phi, 0.0), (1.0, phi, 0.0), (-1.0, -phi, 0.0), (1.0, -phi, 0.0)]
        .into_iter()
        .flat_map(|(x, y, z)| [Vec3::new(x, y, z), Vec3::new(z, x, y), Vec3::new(y, z, x)])
        .map(Vec3::normalize)
        .collect();
    let mut triangles = Vec::new();
    // The convex hull of twelve points by brute force: faces are the triples with all other points on one side.
    for a in 0..12u32 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                let [p, q, r] = [a, b, c].map(|i| points[i as usize]);
                let n = (q - p).cross(r - p);
                let sides: Vec<f32> = points.iter().map(|o| n.dot(*o - p)).collect();
                if sides.iter().all(|&s| s < 1e-4) {
                    triangles.push([a, b, c]);
                } else if sides.iter().all(|&s| s > -1e-4) {
                    triangles.push([a, c, b]);
                }
            }
        }
    }
    for _ in 0..subdivisions {
        let mut middles = std::collections::HashMap::new();
        let mut middle = |a: u32, b: u32, points: &mut Vec<Vec3>| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                points.push((points[a as usize] + points[b as usize]).normalize());
                points.len() as u32 - 1
            })
        };
        triangles = triangles
            .into_iter()
            .flat_map(|[a, b, c]: [u32; 3]| {
                let (ab, bc, ca) = (middle(a, b, &mut points), middle(b, c, &mut points), middle(c, a, &mut points));
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            })
            .collect();
    }
    Mesh {
        name: "icosphere".into(),
        normals: if smooth { points.clone() } else { Vec::new() },
        positions: points.into_iter().map(|p| p * radius).collect(),
        triangles,
        ..Mesh::default()
    }
}
