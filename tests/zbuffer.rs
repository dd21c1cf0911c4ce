//! The z-buffer against ray casting: equal objects away from edges, equal colours, equal bytes for any thread count.

use canaletto::camera::Camera;
use canaletto::diagnose::{Omission, omissions};
use canaletto::explain::explain;
use canaletto::light::{Directional, Falloff, Light, LightKind, Omni, Spot};
use canaletto::material::{Material, Phong};
use canaletto::math::{Rgb, Transform};
use canaletto::render::{Aov, Job, Rendering, render};
use canaletto::scene::{
    CameraProjection, Content, Extrinsics, FilmSettings, Intrinsics, Node, Sampling, Scene, Shading, ShadowMethod,
    Stage, WhittedSettings, ZbufferSettings,
};
use canaletto::shape::{
    Cone, Cuboid, Cylinder, CylinderCloud, Disk, Mesh, Plane, Shape, Sphere, SphereCloud, Torus, Triangle,
};
use canaletto::world::{Hit, World};
use canaletto_bvh::Ray;
use canaletto_io::assets::MemoryAssets;
use canaletto_io::text::read_scene_text;
use canaletto_tests::gallery::{still_life, still_life_job};
use canaletto_tests::textured::textured_still_life;
use canaletto_tests::{Random, assert_same_picture};
use glam::{DVec3, Vec2, Vec3};

/// A shape of any kind around a point.
fn shape(random: &mut Random, kind: u32) -> Shape {
    let at = random.cube() * 4.0;
    let (axis, radius) = (random.cube().normalize(), random.within(0.3, 1.5));
    match kind {
        0 => Shape::Sphere(Sphere { center: at, radius }),
        1 => Shape::Box(Cuboid { min: at - Vec3::splat(radius) * 0.7, max: at + random.cube().abs() + 0.2 }),
        2 => Shape::Cylinder(Cylinder { base: at, top: at + axis * 2.0, radius: radius * 0.5, caps: true }),
        3 => Shape::Cone(Cone { base: at, top: at + axis * 2.0, radius, top_radius: 0.2, caps: true }),
        4 => Shape::Torus(Torus { center: at, axis, radius, tube: radius * 0.3 }),
        5 => Shape::Disk(Disk { center: at, normal: axis, radius }),
        6 => Shape::Cylinder(Cylinder { base: at, top: at + axis * 2.0, radius: radius * 0.5, caps: false }),
        7 => Shape::Triangle(Triangle {
            a: at,
            b: at + random.cube() * 2.0,
            c: at + random.cube() * 2.0,
            one_sided: random.unit() < 0.5,
        }),
        _ => {
            Shape::Plane(Plane { point: Vec3::new(0.0, -4.5, 0.0) + random.cube() * 0.1, normal: axis * 0.1 + Vec3::Y })
        }
    }
}

/// A bumpy sheet.
fn sheet(random: &mut Random) -> Mesh {
    let side = 12;
    let mut mesh = Mesh { one_sided: random.unit() < 0.3, ..Mesh::default() };
    for i in 0..side * side {
        let at = Vec2::new((i % side) as f32, (i / side) as f32) / side as f32 * 3.0 - 1.5;
        mesh.positions.push(at.extend(random.within(-0.15, 0.15)));
    }
    for i in 0..side - 1 {
        for j in 0..side - 1 {
            let a = i * side + j;
            mesh.triangles.extend([[a, a + 1, a + side + 1], [a, a + side + 1, a + side]]);
        }
    }
    mesh
}

/// A scene of all kinds of objects, copies of groups among them.
fn random_scene(random: &mut Random) -> Scene {
    let transform = |random: &mut Random| {
        let mirror = if random.unit() < 0.3 { -1.0 } else { 1.0 };
        let scale = DVec3::new(mirror, random.within(0.5, 1.5).into(), 1.0);
        Transform::translate(random.cube().as_dvec3() * 4.0)
            .after(&Transform::rotate(random.cube().as_dvec3(), random.within(0.0, 360.0).into()).unwrap())
            .after(&Transform::scale(scale).unwrap())
    };
    let cloud = (0..30).map(|_| random.cube() * 4.0).collect();
    let mut nodes: Vec<Node> = (0..10).map(|i| Node::from(shape(random, i % 9))).collect();
    let group =
        Content::Group(vec![Node::from(shape(random, 0)), Node::from(shape(random, 1)), Node::new(Content::Mesh(0))]);
    nodes.extend((0..3).map(|_| Node::new(Content::Instance(0)).with_transform(&transform(random))));
    nodes.push(Node::new(Content::Mesh(0)).with_transform(&transform(random)));
    nodes.push(Node::new(Content::Spheres(0)));
    nodes.push(Node::new(Content::Cylinders(0)));
    nodes.push(Node::from(shape(random, 0)).with_transform(&transform(random)));
    Scene {
        meshes: vec![sheet(random)],
        spheres: vec![SphereCloud { centers: cloud, radii: vec![0.2], ..SphereCloud::default() }],
        cylinders: vec![CylinderCloud {
            axes: (0..20).map(|_| [random.cube() * 4.0, random.cube() * 4.0]).collect(),
            radii: vec![0.08],
            ..CylinderCloud::default()
        }],
        prototypes: vec![Node::new(group)],
        nodes,
        ..Scene::default()
    }
}

/// A camera around or within the scene, whose planes cut through objects.
fn random_camera(random: &mut Random, size: [u32; 2], projection: CameraProjection) -> Camera {
    let near: f64 = [0.01, 0.5, 2.0, 5.0][(random.unit() * 4.0) as usize];
    let intrinsics = Intrinsics {
        fovy: random.within(20.0, 110.0).into(),
        projection,
        width: size[0],
        height: size[1],
        near: Some(near),
        far: Some(near + f64::from(random.within(4.0, 14.0))),
        shift: [random.within(-0.2, 0.2).into(), 0.0],
        ..Intrinsics::default()
    };
    let extrinsics = Extrinsics {
        eye: random.cube().as_dvec3() * 8.0,
        center: random.cube().as_dvec3() * 2.0,
        up: DVec3::new(0.1, 1.0, 0.2),
    };
    Camera::new(&intrinsics, &extrinsics).unwrap()
}

/// What a ray through a place sees between the planes: the number of the object, 0 for none, and the primitive in
/// a cloud, whose elements may hide gaps behind each other.
fn cast(world: &World, camera: &Camera, [x, y]: [f64; 2]) -> [u32; 2] {
    let (eye, d) = camera.chapter_ray(x, y);
    let ray = Ray::new((eye + d - world.origin()).as_vec3(), d.as_vec3());
    let t_max = (camera.far_plane().unwrap() / camera.focal_distance() - 1.0) as f32;
    let element = |hit: &Hit| if world.object(hit).kind == "mesh" { 0 } else { hit.primitive };
    world.intersect(&ray, t_max).map_or([0; 2], |hit| [world.object_id(&hit), element(&hit)])
}

fn ids(rendering: &Rendering) -> Vec<u32> {
    let layer = rendering.picture.layer("object-id").unwrap();
    (0..layer.data.len()).map(|i| layer.id(i)).collect()
}

#[test]
fn objects_are_those_of_ray_casting_away_from_edges() {
    let [compared, seen] = compare_objects(120, CameraProjection::Perspective);
    assert!(compared > 200_000 && seen > 80_000, "{compared} {seen}");
}

#[test]
fn objects_of_an_orthographic_camera_are_those_of_ray_casting_away_from_edges() {
    let [compared, seen] = compare_objects(60, CameraProjection::Orthographic { height: 11.0 });
    assert!(compared > 100_000 && seen > 40_000, "{compared} {seen}");
}

/// Compares the objects of random scenes with those that rays hit. Returns the number of pixels that are compared, and
/// of those that see an object.
fn compare_objects(rounds: u32, projection: CameraProjection) -> [u32; 2] {
    const SIZE: [u32; 2] = [80, 60];
    let random = &mut Random(730);
    let (mut compared, mut seen) = (0, 0);
    for round in 0..rounds {
        let world = World::build(random_scene(random)).unwrap();
        let camera = random_camera(random, SIZE, projection);
        let settings = ZbufferSettings { shadows: ShadowMethod::None, ..ZbufferSettings::default() };
        let mut job = Job::new(camera.clone(), FilmSettings::default(), settings);
        job.aovs = vec![Aov::ObjectId];
        let found = ids(&render(&world, &job, &()).unwrap());
        // Rays at half pixels; the pixels' centres are at odd places.
        let [width, height] = SIZE.map(|n| n as usize);
        let across = 2 * width + 3;
        let fine: Vec<[u32; 2]> = (0..across * (2 * height + 3))
            .map(|i| cast(&world, &camera, [(i % across) as f64 * 0.5 - 0.5, (i / across) as f64 * 0.5 - 0.5]))
            .collect();
        for (i, &id) in found.iter().enumerate() {
            let (x, y) = (i % width, height - 1 - i / width);
            let center = (2 * y + 2) * across + 2 * x + 2;
            let around = (-2..=2i64).flat_map(|dy| (-2..=2i64).map(move |dx| dy * across as i64 + dx));
            if around.into_iter().all(|step| fine[(center as i64 + step) as usize] == fine[center]) {
                assert_eq!(id, fine[center][0], "round {round}, pixel {x}, {y} from below");
                compared += 1;
                seen += u32::from(id != 0);
            }
        }
    }
    [compared, seen]
}

#[test]
fn meshes_have_the_colours_of_the_ray_tracer() {
    for projection in [CameraProjection::Perspective, CameraProjection::Orthographic { height: 4.0 }] {
        meshes_have_the_colours_through(projection);
    }
}

fn meshes_have_the_colours_through(projection: CameraProjection) {
    let random = &mut Random(731);
    let mut mesh = sheet(random);
    mesh.smooth_normals();
    let material = Phong { kd: Rgb::new(0.7, 0.5, 0.3), ks: Rgb::gray(0.4), n: 20.0, ..Phong::default() };
    let lamp = Light::new(LightKind::Omni(Omni::at(Vec3::new(2.0, 3.0, 4.0))), Rgb::gray(0.8));
    let world = World::build(Scene {
        ambient: Rgb::gray(0.1),
        materials: vec![Material::new("paper", material)],
        meshes: vec![mesh],
        nodes: vec![
            Node::new(Content::Mesh(0)).with_material(0),
            Node::from(Shape::Box(Cuboid { min: Vec3::new(-1.0, -1.0, -0.3), max: Vec3::new(0.0, 0.0, 0.9) }))
                .with_material(0),
            Node::from(Shape::Plane(Plane { point: Vec3::new(0.0, 0.0, -1.0), normal: Vec3::Z })).with_material(0),
            Node::from(Shape::Disk(Disk { center: Vec3::new(1.0, 1.0, 0.8), normal: Vec3::Z, radius: 0.4 }))
                .with_material(0),
            Node::new(Content::Light(lamp)),
        ],
        ..Scene::default()
    })
    .unwrap();
    let camera = Camera::new(
        &Intrinsics {
            fovy: 40.0,
            projection,
            width: 120,
            height: 90,
            near: Some(0.1),
            far: Some(100.0),
            ..Intrinsics::default()
        },
        &Extrinsics { eye: DVec3::new(1.0, -3.0, 4.0), center: DVec3::ZERO, up: DVec3::Z },
    )
    .unwrap();
    let settings = ZbufferSettings { shadows: ShadowMethod::None, ..ZbufferSettings::default() };
    let found = render(&world, &Job::new(camera.clone(), FilmSettings::default(), settings), &()).unwrap().picture;
    let classic = WhittedSettings { stage: Stage::Specular, ..WhittedSettings::default() };
    let expected = render(&world, &Job::new(camera, FilmSettings::default(), classic), &()).unwrap().picture;
    let (mut equal, mut near) = (0, 0);
    for (found, expected) in found.pixels.iter().zip(&expected.pixels) {
        let difference = (*found - *expected).to_array().map(f32::abs).into_iter().fold(0.0, f32::max);
        equal += usize::from(found == expected);
        near += usize::from(difference < 1e-4);
    }
    // Only samples between a corner and its snapped place see another triangle.
    let pixels = found.pixels.len();
    assert!(equal * 1000 > pixels * 995 && near * 1000 > pixels * 998, "{equal} and {near} of {pixels}");
}

#[test]
fn threads_tiles_and_powers_of_two_change_no_bit() {
    let zbuffers = [
        ZbufferSettings { shadow_map_size: 64, ..ZbufferSettings::default() },
        ZbufferSettings {
            shadow_map_size: 64,
            multisampling: 4,
            shading: Shading::Gouraud,
            ..ZbufferSettings::default()
        },
        ZbufferSettings { shadows: ShadowMethod::None, shading: Shading::Flat, ..ZbufferSettings::default() },
    ];
    for scene in [still_life, textured_still_life] {
        for (settings, sampling) in zbuffers.into_iter().zip([Sampling::Center, Sampling::Corner, Sampling::Regular(2)])
        {
            let mut pictures = Vec::new();
            for (threads, tile, scale) in [(1, 32, 1.0), (2, 5, 1.0), (3, 16, 4.0), (7, 64, 0.125)] {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                pool.install(|| {
                    let world = World::build(scene(scale)).unwrap();
                    let mut job = still_life_job(scale, 60, 45, sampling);
                    (job.tile, job.integrator) = (tile, settings.into());
                    job.aovs = vec![Aov::ObjectId, Aov::Normal, Aov::Alpha];
                    pictures.push((
                        format!("{settings:?}, {threads} threads, tile {tile}"),
                        render(&world, &job, &()).unwrap(),
                    ));
                });
            }
            let (_, first) = &pictures[0];
            for (name, rendering) in &pictures {
                assert!(rendering.complete);
                assert_same_picture(&rendering.picture, &first.picture, name);
            }
        }
    }
}

#[test]
fn a_ray_that_sees_nothing_has_the_background() {
    let world = World::build(Scene { background: Rgb::new(0.1, 0.2, 0.3), ..Scene::default() }).unwrap();
    let job = still_life_job(1.0, 8, 6, Sampling::Center);
    let job = Job { integrator: ZbufferSettings::default().into(), ..job };
    let picture = render(&world, &job, &()).unwrap().picture;
    assert!(picture.pixels.iter().all(|pixel| *pixel == Rgb::new(0.1, 0.2, 0.3)));
}

#[test]
fn the_explanations_sum_is_the_pixel() {
    let zbuffers = [
        ZbufferSettings { shadow_map_size: 64, multisampling: 4, ..ZbufferSettings::default() },
        ZbufferSettings { shadow_map_size: 64, shading: Shading::Gouraud, ..ZbufferSettings::default() },
        ZbufferSettings { shadows: ShadowMethod::None, shading: Shading::Flat, ..ZbufferSettings::default() },
    ];
    for scene in [still_life, textured_still_life] {
        let world = World::build(scene(1.0)).unwrap();
        for settings in zbuffers {
            let job = Job { integrator: settings.into(), ..still_life_job(1.0, 40, 30, Sampling::Center) };
            let picture = render(&world, &job, &()).unwrap().picture;
            let mut hidden = 0;
            for i in 0..30 {
                let [x, y] = [i * 11 % 40, i];
                let tree = explain(&world, &job, x, y).unwrap();
                assert_eq!(
                    (tree.sum(), tree.color),
                    (picture.pixel(x, y), picture.pixel(x, y)),
                    "{settings:?} {x}, {y}"
                );
                hidden += tree.samples.iter().flat_map(|sample| &sample.raster).map(|r| r.rivals.len()).sum::<usize>();
            }
            assert!(hidden > 0);
        }
    }
}

/// A ball over a floor, under a lamp of any kind: away from the edges of the shadow, maps agree with shadow rays.
#[test]
fn shadow_maps_agree_with_shadow_rays_away_from_edges() {
    let lamps = [
        LightKind::Omni(Omni::at(Vec3::new(1.0, 6.0, 2.0))),
        LightKind::Directional(Directional { towards: Vec3::new(-0.2, -1.0, -0.3), beam: None }),
        Spot {
            position: Vec3::new(1.0, 6.0, 2.0),
            target: Vec3::ZERO,
            falloff: Falloff::Smooth { inner: 20.0, outer: 30.0 },
            range: 0.0,
        }
        .into(),
    ];
    for lamp in lamps {
        let floor = Shape::Box(Cuboid { min: Vec3::new(-4.0, -1.0, -4.0), max: Vec3::new(4.0, 0.0, 4.0) });
        let ball = Shape::Sphere(Sphere { center: Vec3::new(0.0, 1.5, 0.0), radius: 1.0 });
        let nodes =
            vec![Node::from(floor), Node::from(ball), Node::new(Content::Light(Light::new(lamp.clone(), Rgb::WHITE)))];
        let world = World::build(Scene { nodes, ..Scene::default() }).unwrap();
        let camera = Camera::new(
            &Intrinsics {
                fovy: 50.0,
                width: 120,
                height: 90,
                near: Some(0.1),
                far: Some(100.0),
                ..Intrinsics::default()
            },
            &Extrinsics { eye: DVec3::new(0.0, 5.0, 8.0), center: DVec3::ZERO, up: DVec3::Y },
        )
        .unwrap();
        let of = |integrator: canaletto::scene::Integrator| {
            render(&world, &Job::new(camera.clone(), FilmSettings::default(), integrator), &()).unwrap().picture
        };
        let found = of(ZbufferSettings { tolerance: 0.1, ..ZbufferSettings::default() }.into());
        let expected = of(WhittedSettings { stage: Stage::Shadow, ..WhittedSettings::default() }.into());
        let differs = |a: Rgb, b: Rgb| (a - b).max_component().max((b - a).max_component()) > 0.02;
        let is_even = |x: u32, y: u32| {
            let own = expected.pixel(x, y);
            (x - 1..=x + 1).all(|i| (y - 1..=y + 1).all(|j| !differs(expected.pixel(i, j), own)))
        };
        let (mut compared, mut dark) = (0, 0);
        for (x, y) in (1..119).flat_map(|x| (1..89).map(move |y| (x, y))).filter(|(x, y)| is_even(*x, *y)) {
            let (a, b) = (found.pixel(x, y), expected.pixel(x, y));
            assert!(!differs(a, b), "{lamp:?}: pixel {x}, {y} is {a:?} instead of {b:?}");
            compared += 1;
            dark += u32::from(b == Rgb::BLACK);
        }
        assert!(compared > 6000 && dark > 300, "{compared} {dark}");
    }
}

#[test]
fn what_a_zbuffer_cannot_do_is_told_by_name() {
    let world = World::build(still_life(1.0)).unwrap();
    let job =
        Job { integrator: ZbufferSettings::default().into(), ..still_life_job(1.0, 40, 30, Sampling::Jittered(2)) };
    let told: Vec<String> = omissions(&world, &job).iter().map(Omission::to_string).collect();
    for (about, name) in
        [("reflections", "sphere"), ("refracts", "glass ball"), ("penumbrae", "disk light"), ("2 x 2", "")]
    {
        assert!(told.iter().any(|t| t.contains(about) && t.contains(name)), "{about}: {told:#?}");
    }
    let classic = Job { integrator: WhittedSettings::default().into(), ..job };
    assert!(omissions(&world, &classic).is_empty());
}

/// A medium without a surface is left out, as light passes where it begins.
#[test]
fn media_without_a_surface_are_left_out() {
    let scene = |ball: &str| {
        let text = format!(
            "camera {{ eye 0 0 4; center 0 0 0; fovy 40; size 32 24 }}\nbackground 0.7\nintegrator \"zbuffer\"\n\
             material \"fog\" {{ medium {{ absorption 0.1; scattering 0.5 }} }}\nmaterial \"wall\" {{ kd 0.5 }}\n\
             light \"omni\" {{ position 0 5 5; intensity 1 }}\n\
             box material=\"wall\" {{ min -3 -2 -3; max 3 -1 2 }}\n{ball}"
        );
        read_scene_text(&text, "s", &MemoryAssets::new(), &[]).unwrap().0
    };
    let picture = |ball: &str| {
        let scene = scene(ball);
        let world = World::build(scene.clone()).unwrap();
        let job = Job::new(Camera::of(&scene.views[0]).unwrap(), scene.film, scene.integrator);
        render(&world, &job, &()).unwrap().picture
    };
    let ball = |material: &str| format!("sphere material=\"{material}\" {{ center 0 0 0; radius 1 }}");
    assert_eq!(picture(&ball("fog")).pixels, picture("").pixels);
    assert_ne!(picture(&ball("wall")).pixels, picture("").pixels);
    // Nor do they throw shadows, out of the view and without bounds.
    let above = |material: &str| format!("sphere material=\"{material}\" {{ center 0 3 2; radius 0.8 }}");
    let ceiling = |material: &str| format!("plane material=\"{material}\" {{ point 0 4 0; normal 0 1 0 }}");
    for shade in [&above as &dyn Fn(&str) -> String, &ceiling] {
        assert_eq!(picture(&shade("fog")).pixels, picture("").pixels);
        assert_ne!(picture(&shade("wall")).pixels, picture("").pixels);
    }
}

/// The scene of a text.
fn scene_of(text: &str) -> (World, Scene) {
    let scene = read_scene_text(text, "scene", &MemoryAssets::new(), &[]).unwrap().0;
    (World::build(scene.clone()).unwrap(), scene)
}

fn job_of(scene: &Scene, integrator: canaletto::scene::Integrator) -> Job {
    let film = FilmSettings { sampling: Sampling::Center, ..scene.film };
    Job::new(Camera::of(&scene.views[0]).unwrap(), film, integrator)
}

/// A still life of curved shapes on a plane, of a size; `more` stands in its camera.
fn sized(s: f64, more: &str) -> String {
    let n = |v: f64| format!("{:e}", v * s);
    format!(
        "camera {{ eye 0 {} {}; center 0 {} 0; size 64 48; {more} }}\nlight \"omni\" {{ position {} {} {} }}\n\
         sphere \"ball\" {{ center 0 {} 0; radius {} }}\ntorus {{ center {} {} 0; axis 0 1 0; radius {}; tube {} }}\n\
         plane \"floor\" {{ point 0 0 0; normal 0 1 0 }}\ncylinder {{ base {} 0 0; top {} {} 0; radius {} }}\n",
        n(1.0),
        n(3.0),
        n(0.5),
        n(3.0),
        n(5.0),
        n(5.0),
        n(0.5),
        n(0.5),
        n(-1.0),
        n(0.5),
        n(0.5),
        n(0.1),
        n(1.0),
        n(1.0),
        n(1.0),
        n(0.25)
    )
}

/// Without planes in its camera a scene of any size is drawn whole, and its bits scale with it.
#[test]
fn scenes_of_any_size_are_drawn_whole() {
    for size in [1e-6, 1e-3, 1.0, 1e3, 1e7] {
        let (world, scene) = scene_of(&sized(size, ""));
        let rendered = |integrator| {
            let mut job = job_of(&scene, integrator);
            job.aovs = vec![Aov::ObjectId];
            assert_eq!(omissions(&world, &job), []);
            render(&world, &job, &()).unwrap()
        };
        let [drawn, traced] = [ZbufferSettings::DEFAULT.into(), WhittedSettings::DEFAULT.into()].map(rendered);
        let pairs = ids(&drawn).into_iter().zip(ids(&traced));
        let other = pairs.filter(|(a, b)| a != b).count();
        assert!(other <= 16, "size {size}: {other} pixels show another object");
        assert!(ids(&drawn).iter().all(|id| *id != 0) || size != 1.0 || ids(&traced).contains(&0));
    }
    let picture = |size: f64| {
        let (world, scene) = scene_of(&sized(size, ""));
        render(&world, &job_of(&scene, ZbufferSettings::DEFAULT.into()), &()).unwrap().picture.pixels
    };
    assert_eq!(picture(1.0), picture(2f64.powi(-20)));
    assert_eq!(picture(1.0), picture(2f64.powi(23)));
}

/// The eye is inside of a ball, near its wall, and far beside one point.
#[test]
fn eyes_inside_and_far_away_see_what_rays_see() {
    for (eye, scene) in [
        ("0 0 0.5", "sphere { center 0 0 0; radius 1 }\nsphere { center 0 0 -0.3; radius 0.1 }"),
        ("0 0 0.99999", "sphere { center 0 0 0; radius 1 }\nsphere { center 0 0 -0.3; radius 0.1 }"),
        ("0 0 100000", "sphere { center 0 0 0; radius 1e-3 }"),
        ("0 1 5", "sphere { center 0 -100000 0; radius 100000 }\nsphere { center 0 1 0; radius 1 }"),
        ("0 1 5", "spheres radius=1e12 { points 0 0 0  1 0 0 }"),
        ("0 1 5", "torus { center 0 0 0; axis 0 1 0; radius 1; tube 1000000 }"),
        ("0 1 5", "cylinder { base 0 -1e6 0; top 0 -1 0; radius 1e6 }\ncone { base 0 -1 -9; top 0 9 -9; radius 3 }"),
        ("0 1 5", "disk { center 0 0 0; normal 0 1 0; radius 1e7 }"),
    ] {
        let text = format!(
            "camera {{ eye {eye}; center 0 0 -1; size 48 36 }}\nlight \"omni\" {{ position 0 0.5 0.2 }}\n{scene}"
        );
        let (world, scene) = scene_of(&text);
        let rendered = |integrator| {
            let mut job = job_of(&scene, integrator);
            job.aovs = vec![Aov::ObjectId];
            render(&world, &job, &()).unwrap()
        };
        let traced = rendered(WhittedSettings::DEFAULT.into());
        let drawn = rendered(ZbufferSettings::DEFAULT.into());
        let other = ids(&drawn).into_iter().zip(ids(&traced)).filter(|(a, b)| a != b).count();
        assert!(other <= 12, "{text}: {other} pixels show another object");
        // Large shapes are cut finely only where they are near.
        let triangles = drawn.counts.others.iter().find(|(name, _)| *name == "triangles on the screen").unwrap().1;
        assert!(triangles < 20_000, "{text}: {triangles} triangles");
        let coarse = drawn.counts.others.iter().find(|(name, _)| *name == "shapes coarser than the tolerance");
        assert_eq!(coarse.unwrap().1, 0, "{text}");
    }
}

/// What the planes of a camera cut is told, with the objects.
#[test]
fn planes_that_cut_objects_are_told_of() {
    let told = |size: f64, camera: &str| {
        let (world, scene) = scene_of(&sized(size, camera));
        let all = omissions(&world, &job_of(&scene, ZbufferSettings::DEFAULT.into()));
        all.iter().map(Omission::to_string).collect::<Vec<_>>()
    };
    assert!(told(1.0, "").is_empty() && told(1.0, "near 0.1; far 1e6").is_empty());
    let all = told(0.1, "near 1");
    assert!(all.len() == 1 && all[0].contains("near = 1") && all[0].contains("\"ball\""), "{all:?}");
    let all = told(1.0, "far 3.1");
    assert!(all.len() == 1 && all[0].contains("far = 3.1") && all[0].contains("\"floor\""), "{all:?}");
    assert!(!all[0].contains("\"ball\""), "{all:?}");
    assert_eq!(told(1.0, "near 3; far 3.1").len(), 2);
    // Other integrators have no planes.
    let (world, scene) = scene_of(&sized(0.1, "near 1"));
    assert!(omissions(&world, &job_of(&scene, WhittedSettings::DEFAULT.into())).is_empty());
}

/// Normals are those of the surface itself, under any transform: stretched, sheared and mirrored.
#[test]
fn normals_are_those_that_rays_meet() {
    const SHAPES: [&str; 6] = [
        "sphere { center 0 0 0; radius 0.7;",
        "cylinder { base 0 -0.7 0; top 0 0.6 0; radius 0.4;",
        "cone { base 0 -0.7 0; top 0 0.6 0; radius 0.6; top-radius 0.0;",
        "cone { base 0 -0.7 0; top 0 0.6 0; radius 0.6; top-radius 0.2;",
        "torus { center 0 0 0; axis 0 1 0; radius 0.7; tube 0.25;",
        "box { min -0.6 -0.4 -0.5; max 0.5 0.7 0.6;",
    ];
    const PLACES: [&str; 5] = [
        "",
        "rotate-x 25; rotate-y 63; scale 1.07 1.53 0.66;",
        "rotate-x 25; scale 0.3 1.9 1; rotate-z 30; scale 1.5 0.6 1;",
        "rotate-x 80; scale -0.8 0.7 0.6;",
        "rotate-y 15; scale 1.2 -0.4 -0.9; rotate-x 40; scale 1 -1.3 0.8;",
    ];
    for (shape, place) in SHAPES.iter().flat_map(|shape| PLACES.map(|place| (shape, place))) {
        let text = format!(
            "camera {{ eye 0.4 1.1 4; center 0 0 0; fovy 40; size 60 45 }}\nlight \"omni\" {{ position 5 8 3 }}\n\
             {shape} {place} }}"
        );
        let (world, scene) = scene_of(&text);
        let layers = |integrator| {
            let mut job = job_of(&scene, integrator);
            job.aovs = vec![Aov::ObjectId, Aov::Normal];
            render(&world, &job, &()).unwrap()
        };
        let [drawn, traced] = [ZbufferSettings::DEFAULT.into(), WhittedSettings::DEFAULT.into()].map(layers);
        let normals = |r: &Rendering| r.picture.layers[1].data.chunks(3).map(Vec3::from_slice).collect::<Vec<_>>();
        let both = ids(&drawn).into_iter().zip(ids(&traced)).zip(normals(&drawn).into_iter().zip(normals(&traced)));
        let mut off: Vec<f32> = both.filter(|(ids, _)| ids.0 == ids.1).map(|(_, (a, b))| (a - b).length()).collect();
        off.sort_by(f32::total_cmp);
        // At its outline a triangle may lie beside the surface, or show the other side of an edge.
        let most = off[off.len() - 1 - off.len() / 400];
        assert!(most < 1e-5, "{text}: normals differ by {most}");
    }
}
