//! The chapter's exercises with their printed numbers, through the public API (5.8 and, where they have numbers, 5.9).

use canaletto::Ray;
use canaletto::camera::Camera;
use canaletto::film::Picture;
use canaletto::integrator::Whitted;
use canaletto::integrator::describe;
use canaletto::light::{Light, LightKind, Omni};
use canaletto::material::{Material, Phong, reflect, refract};
use canaletto::math::Rgb;
use canaletto::render::{Job, render};
use canaletto::scene::{Extrinsics, FilmSettings, Intrinsics, Node, Sampling, Scene, Stage, WhittedSettings};
use canaletto::shape::{Cylinder, Shape, Sphere, Triangle};
use canaletto::world::World;
use glam::{DVec3, Vec3};

/// Asserts that `value` is within half of `digit` of the chapter's number. `digit` is the unit of its last digit, or
/// more where the chapter rounds intermediate results.
#[track_caller]
fn printed<T: Copy + Into<f64>, const N: usize>(value: [T; N], chapter: [f64; N], digit: f64) {
    let value = value.map(Into::into);
    for (v, c) in value.iter().zip(chapter) {
        assert!((v - c).abs() <= 0.5 * digit * 1.001, "{value:?} instead of the printed {chapter:?}");
    }
}

fn exercise_1_camera() -> Camera {
    let intrinsics =
        Intrinsics { fovy: 90.0, width: 400, height: 400, near: Some(30.0), far: Some(230.0), ..Intrinsics::default() };
    let extrinsics = Extrinsics { eye: DVec3::new(100.0, 40.0, 40.0), center: DVec3::ZERO, up: DVec3::Y };
    Camera::new(&intrinsics, &extrinsics).unwrap()
}

#[test]
fn exercise_1_the_cameras_axes() {
    let [x, y, z] = exercise_1_camera().axes();
    printed(z.as_vec3().to_array(), [0.870, 0.348, 0.348], 1e-3);
    printed(x.as_vec3().to_array(), [0.371, 0.0, -0.928], 1e-3);
    // The chapter computes y from the rounded x and z: its last digit is one off in two places.
    printed(y.as_vec3().to_array(), [-0.323, 0.937, -0.129], 2e-3);
}

#[test]
fn exercise_1s_camera_gives_exercise_2s_ray() {
    let (eye, d) = exercise_1_camera().chapter_ray(210.0, 265.0);
    assert_eq!(eye, DVec3::new(100.0, 40.0, 40.0));
    printed(d.as_vec3().to_array().map(|c| c * 10.0), [-287.0, -13.0, -131.0], 1.0);
}

#[test]
fn exercise_2_a_ray_and_a_sphere() {
    let sphere = Shape::Sphere(Sphere { center: Vec3::new(0.0, 20.0, 0.0), radius: 25.0 });
    let ray = Ray::new(Vec3::new(100.0, 40.0, 40.0), Vec3::new(-28.7, -1.30, -13.1));
    let hit = sphere.intersect(&ray, f32::INFINITY).unwrap();
    // The chapter's discriminant is rounded to 1193: t = 2.83 and 4.03 come from it.
    printed([hit.t], [2.83], 1e-2);
    let surface = sphere.surface(&ray, &hit);
    printed(surface.point.to_array(), [18.7, 36.3, 2.90], 2e-1);
    printed(surface.normal.to_array(), [0.749, 0.653, 0.116], 2e-3);
    let inside = Ray::new(surface.point, ray.direction);
    let out = sphere.intersect(&Ray::new(inside.at(1e-3), ray.direction), f32::INFINITY).unwrap();
    printed([hit.t + 1e-3 + out.t], [4.03], 1e-2);
}

#[test]
fn exercise_3_an_optical_centre_off_the_pictures_centre() {
    // A crop keeps the rays of the whole picture; the optical axis may lie outside of it.
    let whole = exercise_1_camera();
    let world = chapter_sphere_world();
    let mut job = Job::new(
        whole,
        FilmSettings { sampling: Sampling::Corner, ..FilmSettings::default() },
        WhittedSettings::default(),
    );
    let all = render(&world, &job, &()).unwrap().picture;
    job.film.crop = Some([190, 60, 40, 90]);
    let part = render(&world, &job, &()).unwrap().picture;
    assert_eq!((part.width, part.height), (40, 90));
    for y in 0..90 {
        for x in 0..40 {
            assert_eq!(part.pixel(x, y), all.pixel(190 + x, 60 + y));
        }
    }
    assert!(part.pixels.iter().any(|&p| p != part.pixels[0]), "the crop shows something");
}

#[test]
fn exercise_4_and_19_light_from_infinity_on_a_triangle() {
    for (l, expected, digits) in [
        ([200.0, 100.0, 50.0], [76.8, 32.0, 9.6], [0.1, 1.0, 0.1]),
        ([0.8, 0.4, 0.2], [0.307, 0.128, 0.0384], [1e-3, 1e-3, 1e-4]),
    ] {
        let triangle = Triangle {
            a: Vec3::new(3.0, 2.0, 1.0),
            b: Vec3::new(8.0, 2.0, 1.0),
            c: Vec3::new(4.0, 8.0, -4.0),
            one_sided: false,
        };
        let light = Light::new(LightKind::Omni(Omni { position: [0.0, 1.0, 0.0, 0.0], range: 0.0 }), Rgb::from(l));
        let kd = Rgb::new(0.6, 0.5, 0.3);
        let color = shade_at(
            Shape::Triangle(triangle),
            Phong { kd, ..Phong::default() },
            light,
            Vec3::new(4.0, 3.0, 0.0),
            Stage::Diffuse,
        );
        for i in 0..3 {
            printed([color.to_array()[i]], [expected[i]], digits[i] * 2.0);
        }
    }
}

#[test]
fn exercise_5_v_and_r() {
    let (a, eye, light) = (DVec3::new(6.0, 2.0, 1.0), DVec3::new(8.0, 10.0, 1.0), DVec3::new(3.0, 5.0, 1.0));
    let n = DVec3::new(-1.0, 2.0, 0.0).normalize();
    printed((eye - a).normalize().to_array(), [0.243, 0.970, 0.0], 1e-3);
    printed(reflect((light - a).normalize(), n).to_array(), [-0.141, 0.990, 0.0], 1e-3);
}

#[test]
fn exercise_6_through_a_glass_sphere() {
    // Snell's law at entry and exit gives a deviation of 21.06° for η = 1.5 at 30°. The printed exit tangent has the
    // wrong sign and gives 38.94°.
    let sphere = Shape::Sphere(Sphere { center: Vec3::ZERO, radius: 1.0 });
    let d = DVec3::X;
    for degrees in [0.0f64, 10.0, 30.0, 60.0, 85.0] {
        let ray = Ray::new(Vec3::new(-5.0, degrees.to_radians().sin() as f32, 0.0), Vec3::X);
        let hit = sphere.intersect(&ray, f32::INFINITY).unwrap();
        let entry = sphere.surface(&ray, &hit);
        let inside = refract(-d, entry.normal, 1.0 / 1.5).unwrap();
        let inner =
            Ray::new(canaletto::math::offset_origin(entry.point, entry.error, entry.normal, inside), inside.as_vec3());
        let exit = sphere.surface(&inner, &sphere.intersect(&inner, f32::INFINITY).unwrap());
        let out = refract(-inside, -exit.normal, 1.5).unwrap();
        let refracted = (degrees.to_radians().sin() / 1.5).asin().to_degrees();
        let expected = 2.0 * (degrees - refracted);
        let deviation = out.dot(d).clamp(-1.0, 1.0).acos().to_degrees();
        assert!((deviation - expected).abs() < 0.05, "{degrees}°: {deviation} instead of {expected}");
    }
}

#[test]
fn exercise_6_beyond_the_critical_angle_the_ray_is_mirrored_inside() {
    // From inside the glass the angle is 45°, beyond the critical 41.8°, which gives reflection by (5.37).
    let n = DVec3::NEG_Y;
    let v = DVec3::new(-1.0, -1.0, 0.0).normalize();
    assert_eq!(refract(v, n, 1.5), None);
    printed(reflect(v, n).to_array(), [0.707, -0.707, 0.0], 1e-3);
}

#[test]
fn exercise_7_eye_pixel_sphere() {
    let sphere = Shape::Sphere(Sphere { center: Vec3::new(3.0, 2.0, 0.0), radius: 1.0 });
    let ray = Ray::new(Vec3::new(10.0, 6.0, 0.0), Vec3::new(-2.0, -1.0, 0.0));
    let hit = sphere.intersect(&ray, f32::INFINITY).unwrap();
    printed([hit.t], [3.2], 1e-5);
    let surface = sphere.surface(&ray, &hit);
    printed(surface.point.to_array(), [3.6, 2.8, 0.0], 1e-5);
    printed(surface.normal.to_array(), [0.6, 0.8, 0.0], 1e-5);
}

#[test]
fn exercise_10_focal_distance() {
    // The inverse of (5.2b): a window of height 35 mm at 90° is at 17.5 mm.
    let intrinsics = Intrinsics { fovy: 90.0, near: Some(17.5), ..Intrinsics::default() };
    let camera = Camera::new(&intrinsics, &Extrinsics::default()).unwrap();
    assert!((camera.window().y - 35.0).abs() < 1e-12);
    assert_eq!(camera.focal_distance(), 17.5);
}

#[test]
fn exercise_14_a_ray_and_a_cylinder_by_its_canonical_position() {
    // The exercise's hint serves as an oracle: b1 to the origin, the axis to +z, height and radius to 1. There the
    // cylinder is x² + y² = 1 between z = 0 and z = 1.
    let (b1, b2, diameter) = (Vec3::new(1.0, -2.0, 0.5), Vec3::new(4.0, 3.0, 2.5), 3.0f32);
    let cylinder = Shape::Cylinder(Cylinder { base: b1, top: b2, radius: diameter / 2.0, caps: true });
    let axis = (b2 - b1).as_dvec3();
    let z = axis.normalize();
    let (x, y) = z.any_orthonormal_pair();
    let canonical = |v: DVec3| DVec3::new(v.dot(x) / 1.5, v.dot(y) / 1.5, v.dot(z) / axis.length());
    let mut hits = 0;
    for i in 0..4000u32 {
        let h = |k: u32| {
            f64::from(i.wrapping_mul(2654435761).wrapping_add(k.wrapping_mul(0x9e3779b1)).rotate_left(13) % 10_000)
                / 5000.0
                - 1.0
        };
        let origin = Vec3::new(h(1) as f32, h(2) as f32, h(3) as f32) * 9.0;
        let target = (b1 + b2) / 2.0 + Vec3::new(h(4) as f32, h(5) as f32, h(6) as f32) * 2.5;
        let ray = Ray::new(origin, target - origin);
        let (o, d) = (canonical((ray.origin - b1).as_dvec3()), canonical(ray.direction.as_dvec3()));
        let (a, b, c) = (d.x * d.x + d.y * d.y, 2.0 * (o.x * d.x + o.y * d.y), o.x * o.x + o.y * o.y - 1.0);
        let root = (b * b - 4.0 * a * c).sqrt();
        let side = [(-b - root) / (2.0 * a), (-b + root) / (2.0 * a)]
            .into_iter()
            .filter(|t| (0.0..=1.0).contains(&(o.z + t * d.z)));
        let caps =
            [-o.z / d.z, (1.0 - o.z) / d.z].into_iter().filter(|t| (o + d * *t).truncate().length_squared() <= 1.0);
        let nearest = side.chain(caps).filter(|t| *t > 0.0).fold(f64::INFINITY, f64::min);
        match cylinder.intersect(&ray, f32::INFINITY) {
            Some(hit) => {
                hits += 1;
                assert!((f64::from(hit.t) - nearest).abs() < 1e-4 * nearest.max(1.0), "{} instead of {nearest}", hit.t);
            }
            None => assert!(nearest.is_infinite(), "missed a hit at {nearest}"),
        }
    }
    assert!(hits > 300, "only {hits} rays met the cylinder");
}

#[test]
fn exercise_15_and_16_refraction_into_and_out_of_glass() {
    let (n, v) = (DVec3::Y, DVec3::new(-0.6, 0.8, 0.0));
    let eta = 1.5;
    let inside = refract(v, n, 1.0 / eta).unwrap();
    // Snell's law, written out: sin θt = sin θi / η, in the plane of v and n.
    printed(inside.to_array(), [0.4, -(1.0f64 - 0.16).sqrt(), 0.0], 1e-6);
    printed(refract(inside, -n, eta).unwrap_or_default().to_array(), [-0.6, 0.8, 0.0], 2e-6);
    let grazing = DVec3::new(-0.7, -(1.0f64 - 0.49).sqrt(), 0.0);
    assert_eq!(refract(grazing, -n, eta), None, "sin θ = 0.7 > 1/1.5: no refracted ray");
}

#[test]
fn exercise_17_the_plane_of_a_triangle() {
    let (a, b, c) = (Vec3::new(3.0, 4.0, 2.0), Vec3::new(4.0, 1.0, 5.0), Vec3::new(2.0, 1.0, 6.0));
    let ray = Ray::new(Vec3::new(12.0, 18.0, 12.0), Vec3::new(-1.0, -2.0, -1.0));
    let normal = (b - a).cross(c - a);
    let plane = Shape::Plane(canaletto::shape::Plane { point: a, normal });
    let hit = plane.intersect(&ray, f32::INFINITY).unwrap();
    printed([hit.t], [185.0 / 23.0], 1e-5);
    let surface = plane.surface(&ray, &hit);
    printed(surface.point.to_array(), [3.957, 1.913, 3.957], 1e-3);
    assert!(ray.direction.as_dvec3().dot(surface.normal) > 0.0, "met from the back");
    let one_sided = |one_sided| Shape::Triangle(Triangle { a, b, c, one_sided });
    assert_eq!(one_sided(true).intersect(&ray, f32::INFINITY), None, "a one-sided triangle isn't met from the back");
    // The inside test by (5.29): the library agrees with the signs at the edges.
    let p = ray.origin.as_dvec3() + ray.direction.as_dvec3() * (185.0 / 23.0);
    let left = |from: Vec3, to: Vec3| normal.as_dvec3().dot((to - from).as_dvec3().cross(p - from.as_dvec3())) > 0.0;
    let inside = left(a, b) && left(b, c) && left(c, a);
    assert_eq!(one_sided(false).intersect(&ray, f32::INFINITY).is_some(), inside);
}

#[test]
fn exercise_18_diffuse_specular_and_ambient() {
    // A plane through p with the printed normal represents the face. la*Kd is given, so la = 0.2 / Kd.
    let plane =
        Shape::Plane(canaletto::shape::Plane { point: Vec3::new(6.0, 2.0, 1.0), normal: Vec3::new(1.0, 2.0, 1.0) });
    let phong = Phong { kd: Rgb::new(0.2, 0.3, 1.0), ks: Rgb::new(0.9, 0.8, 1.0), n: 30.0, ..Phong::default() };
    let light = || Light::new(LightKind::Omni(Omni::at(Vec3::new(3.0, 5.0, 1.0))), Rgb::WHITE);
    let (eye, p) = (Vec3::new(9.0, 1.0, 1.0), Vec3::new(6.0, 2.0, 1.0));
    let color = |stage, ambient| {
        let mut scene = one_object(plane, phong, light());
        scene.ambient = ambient;
        trace(scene, stage, Ray::new(eye, (p - eye).normalize()))
    };
    let diffuse = color(Stage::Diffuse, Rgb::BLACK);
    printed(diffuse.to_array(), [0.0577, 0.0866, 0.289], 1e-3);
    let specular = color(Stage::Specular, Rgb::BLACK) - diffuse;
    printed(specular.to_array(), [0.350, 0.311, 0.389], 2e-3);
    let all = color(Stage::Full, Rgb::new(0.2 / 0.2, 0.2 / 0.3, 0.2));
    printed(all.to_array(), [0.607, 0.597, 0.877], 2e-3);
}

#[test]
fn exercise_21_the_colour_of_one_pixel() {
    let sphere = Shape::Sphere(Sphere { center: Vec3::new(1.0, 2.0, 2.0), radius: 2.0 });
    let phong = Phong { kd: Rgb::new(0.8, 1.0, 0.3), ..Phong::default() };
    let light = Light::new(LightKind::Omni(Omni::at(Vec3::splat(10.0))), Rgb::new(0.3, 0.8, 0.6));
    let (eye, through) = (Vec3::new(10.0, 2.0, 1.0), Vec3::new(5.0, 2.0, 2.0));
    let color = trace(one_object(sphere, phong, light), Stage::Diffuse, Ray::new(eye, (through - eye).normalize()));
    // By hand: |o + t d − c|² = r² with d = (−5, 0, 1): 26 t² − 92 t + 78 = 0, t = (92 − √352)/52.
    let t = (92.0 - 352f64.sqrt()) / 52.0;
    let p = DVec3::new(10.0 - 5.0 * t, 2.0, 1.0 + t);
    let n = (p - DVec3::new(1.0, 2.0, 2.0)) / 2.0;
    let n_dot_l = n.dot((DVec3::splat(10.0) - p).normalize());
    printed(color.to_array(), [0.24 * n_dot_l, 0.8 * n_dot_l, 0.18 * n_dot_l], 1e-6);
}

fn one_object(shape: Shape, phong: Phong, light: Light) -> Scene {
    Scene {
        materials: vec![Material::new("material", phong)],
        nodes: vec![Node::from(shape).with_material(0), Node::from(light)],
        ..Scene::default()
    }
}

fn trace(scene: Scene, stage: Stage, ray: Ray) -> Rgb {
    let settings = WhittedSettings { stage, ..*describe(&scene.integrator).whitted().unwrap() };
    let world = World::build(scene).unwrap();
    Whitted::new(&world, settings).eye(&ray, None, &mut ())
}

/// The colour at a point of the object, seen along its normal.
fn shade_at(shape: Shape, phong: Phong, light: Light, near: Vec3, stage: Stage) -> Rgb {
    let Shape::Triangle(t) = shape else { panic!("a triangle") };
    let n = (t.b - t.a).cross(t.c - t.a).normalize();
    let on = near - n * n.dot(near - t.a);
    trace(one_object(shape, phong, light), stage, Ray::new(on + n * 5.0, -n))
}

fn chapter_sphere_world() -> World {
    let sphere = Shape::Sphere(Sphere { center: Vec3::new(0.0, 20.0, 0.0), radius: 25.0 });
    let light = Light::new(LightKind::Omni(Omni::at(Vec3::new(40.0, 120.0, 0.0))), Rgb::gray(0.8));
    World::build(one_object(sphere, Phong { kd: Rgb::new(0.0, 0.0, 1.0), ..Phong::default() }, light)).unwrap()
}

#[test]
fn the_box_of_example_5_4_is_where_its_numbers_put_it() {
    // A test of the whole program: the chapter's sphere appears in the picture at the place that `project` gives.
    let camera = exercise_1_camera();
    let job = Job::new(camera.clone(), FilmSettings::default(), WhittedSettings::default());
    let picture: Picture = render(&chapter_sphere_world(), &job, &()).unwrap().picture;
    let center = camera.project(DVec3::new(0.0, 20.0, 0.0)).unwrap();
    let blue = picture.pixel(center.x as u32, 399 - center.y as u32);
    assert!(blue.b > 0.2 && blue.r == 0.0, "{blue:?}");
}
