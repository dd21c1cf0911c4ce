//! Objects without shadows, and lights that are seen: pictures equal those of scenes without them, bit for bit,
//! wherever they are not seen.

use canaletto::Named;
use canaletto::camera::Camera;
use canaletto::explain::explain;
use canaletto::math::Rgb;
use canaletto::render::{Aov, Job, Rendering, render};
use canaletto::scene::{ObjectIds, Scene};
use canaletto::world::World;
use canaletto_io::assets::MemoryAssets;
use canaletto_io::text::read_scene_text;

/// A floor under two lights, seen from above, that mirrors the space over it.
const ROOM: &str = "
    background 0.1 0.2 0.3
    ambient 0.05
    camera { eye 0 9 7; center 0 0 0; fovy 50; size 48 36 }
    film { sample \"center\" }
    material \"white\" { kd 0.8; k 0.2 }
    material \"glass\" { kd 0.1; opacity 0.3 }
    plane name=\"floor\" material=\"white\" { point 0 0 0; normal 0 1 0 }
    sphere name=\"clear\" material=\"glass\" { center 2.5 1 1; radius 0.9 }
    light \"omni\" { position 3 12 2; intensity 0.6 }
    light \"disk\" { position -4 10 0; normal 0 -1 0; radius 1; samples 3; intensity 0.5 }
";

const OBJ: &[u8] = b"v -1 1.5 -1\nv 1 1.5 -1\nv 1 1.7 1\nv -1 1.5 1\nf 4 3 2 1\n";

fn scene(text: &str) -> Scene {
    let assets = MemoryAssets::new().with("leaf.obj", OBJ);
    read_scene_text(text, "s", &assets, &[]).unwrap_or_else(|e| panic!("{text}\n{e}")).0
}

struct Drawn {
    world: World,
    job: Job,
    rendering: Rendering,
    /// The objects named "it".
    ids: ObjectIds,
}

fn drawn(text: &str) -> Drawn {
    let scene = scene(text);
    let ids = scene.objects_named("it").unwrap();
    let camera = Camera::new(&scene.views[0].intrinsics, &scene.views[0].extrinsics).expect("a camera");
    let mut job = Job::new(camera, scene.film, scene.integrator);
    let world = World::build(scene).expect("a world");
    job.aovs = vec![Aov::ObjectId];
    let rendering = render(&world, &job, &()).unwrap();
    Drawn { world, job, rendering, ids }
}

impl Drawn {
    /// The pixels that see none of the objects named "it", not even in a mirror or through glass.
    fn pixel(&self, x: u32, y: u32) -> Option<Rgb> {
        let seen = explain(&self.world, &self.job, x, y).unwrap();
        let shown = serde_json::to_string(&seen).unwrap();
        let ids = self.rendering.picture.layer(Aov::ObjectId.name()).unwrap();
        let hit = self.ids.contains(ids.id((y * self.rendering.picture.width + x) as usize));
        (!hit && !shown.contains("\"object\":\"it\"")).then(|| self.rendering.picture.pixel(x, y))
    }

    fn size(&self) -> (u32, u32) {
        (self.rendering.picture.width, self.rendering.picture.height)
    }
}

/// The numbers of pixels of `one` that show no "it", and of those the ones that differ in `other`.
fn differing(one: &Drawn, other: &Drawn) -> (usize, usize) {
    let (width, height) = one.size();
    let places = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let compared: Vec<bool> = places
        .filter_map(|(x, y)| Some(one.pixel(x, y)?.to_array() != other.rendering.picture.pixel(x, y).to_array()))
        .collect();
    (compared.len(), compared.iter().filter(|differs| **differs).count())
}

/// The number of pixels that differ beside the objects named "it".
fn shadow(one: &Drawn, other: &Drawn) -> usize {
    let ids = one.rendering.picture.layer(Aov::ObjectId.name()).unwrap();
    let pixels = one.rendering.picture.pixels.iter().zip(&other.rendering.picture.pixels).enumerate();
    pixels.filter(|(i, (a, b))| !one.ids.contains(ids.id(*i)) && (a.g - b.g).abs() > 0.05).count()
}

/// Objects of all kinds over the floor. `@` stands for the words of the object.
const OBJECTS: [&str; 9] = [
    "sphere name=\"it\" @ { center 0 2 0; radius 1 }",
    "sphere name=\"it\" material=\"glass\" @ { center 0 2 0; radius 1 }",
    "box name=\"it\" @ { min -1 1 -1; max 1 1.5 1; rotate-y 20 }",
    "plane name=\"it\" @ { point -6 0 0; normal 1 0 0.2 }",
    "mesh name=\"it\" file=\"leaf.obj\" @",
    "spheres name=\"it\" radius=0.5 @ { points -1 2 0  0 2 0  1 2 1 }",
    "cylinders name=\"it\" radius=0.3 @ { axes -1 2 0 1 2.5 0 }",
    "group @ { group { sphere name=\"it\" { center 0 2 0; radius 1; scale 1 0.5 1 } } }",
    "prototype name=\"p\" { group { sphere name=\"it\" { center 0 0 0; radius 0.5 } } }\n\
     instance of=\"p\" @ { translate -2 2 0 }\ninstance of=\"p\" @ { translate 1 2 0; scale 1 0.9 1 }",
];

#[test]
fn objects_without_shadows_change_only_pixels_that_show_them() {
    let empty = drawn(ROOM);
    for object in OBJECTS {
        let without = drawn(&format!("{ROOM}{}", object.replace('@', "casts-shadow=#false")));
        let (compared, differ) = differing(&without, &empty);
        assert!(compared > 400 && differ == 0, "{object}: {differ} of {compared} pixels differ");
        let with = drawn(&format!("{ROOM}{}", object.replace('@', "")));
        assert!(shadow(&with, &empty) > 8, "{object}: {} pixels are in its shadow", shadow(&with, &empty));
    }
}

#[test]
fn groups_that_are_kept_as_such_have_no_shadows_either() {
    // A prototype of so many members is kept as a group.
    let members: String =
        (0..12).map(|i| format!("mesh name=\"it{i}\" file=\"leaf.obj\" {{ translate {i} 0 0 }}\n")).collect();
    let text = |words: &str| {
        format!(
            "{ROOM}prototype name=\"p\" {{ {members} }}\ninstance name=\"it\" of=\"p\" {words} {{ translate -5 1 0 }}"
        )
    };
    let lit = |words: &str| {
        let scene = scene(&text(words));
        let world = World::build(scene).unwrap();
        let ray = |x: f32| {
            let (from, to) = (glam::Vec3::new(x, 0.5, 0.0), glam::Vec3::Y);
            let mut last = canaletto::world::OccluderCache::NONE;
            let ray = canaletto_bvh::Ray::new(from, to);
            world.transmittance(&ray, f32::INFINITY, 0.0, None, &mut last, &mut ())
        };
        (0..40).map(|i| ray(i as f32 * 0.25 - 5.0)).sum::<f32>()
    };
    assert_eq!((lit(""), lit("casts-shadow=#false")), (0.0, 40.0));
}

#[test]
fn shadow_maps_leave_out_objects_without_shadows() {
    let room = format!("{ROOM}integrator \"zbuffer\"\n");
    let ball = |words: &str| drawn(&format!("{room}sphere name=\"it\" {words} {{ center 0 2 0; radius 1 }}"));
    let (empty, with, without) = (drawn(&room), ball(""), ball("casts-shadow=#false"));
    let [without, with] = [without, with].map(|one| shadow(&one, &empty));
    assert!(without <= 2 && with > 20, "{without} and {with}");
}

/// Lights of all kinds that can be seen, over the floor and in front of the camera.
const LIGHTS: [&str; 5] = [
    "light \"disk\" name=\"it\" @ { position 0 4 0; normal 0.1 -1 0.2; radius 1; intensity 0.5 0.25 0.125; samples 2 }",
    "light \"disk\" name=\"it\" @ { position 0 4 0; normal 0.1 -1 0.2; radius 1; intensity 0.5 0.25 0.125; emission \"matte\" }",
    "light \"sphere\" name=\"it\" @ { center 0 4 0; radius 0.7; intensity 0.5 0.25 0.125; points 7; attenuation 1 0.1 0 }",
    "light \"rectangle\" name=\"it\" @ { corner -1 4 -1; u 2 0 0; v 0 0 2; intensity 0.5 0.25 0.125; rotate-z 20 }",
    "light \"mesh\" name=\"it\" file=\"leaf.obj\" @ { translate 0 2 0; intensity 0.5 0.25 0.125 }",
];

#[test]
fn lights_that_are_seen_light_as_before_and_show_their_intensity() {
    for light in LIGHTS {
        let hidden = drawn(&format!("{ROOM}{}", light.replace('@', "")));
        let seen = drawn(&format!("{ROOM}{}", light.replace('@', "visible=#true")));
        let (compared, differ) = differing(&seen, &hidden);
        assert!(compared > 400 && differ == 0, "{light}: {differ} of {compared} pixels differ");
        let ids = seen.rendering.picture.layer(Aov::ObjectId.name()).unwrap();
        let shown: Vec<Rgb> = (seen.rendering.picture.pixels.iter().enumerate())
            .filter(|(i, _)| seen.ids.contains(ids.id(*i)))
            .map(|(_, color)| *color)
            .collect();
        // The camera is above the disk, behind its outer side.
        let expected = if light.contains("matte") { Rgb::BLACK } else { Rgb::new(0.5, 0.25, 0.125) };
        assert!(shown.len() > 10 && shown.iter().all(|color| *color == expected), "{light}: {shown:?}");
        // The floor mirrors it.
        let pixels = seen.rendering.picture.pixels.iter().zip(&hidden.rendering.picture.pixels).enumerate();
        let mirrored = pixels.filter(|(i, (a, b))| a != b && !seen.ids.contains(ids.id(*i))).count();
        assert!(mirrored > 0, "{light}: nothing is mirrored");
    }
}

#[test]
fn radiosity_counts_the_light_of_a_visible_light_once() {
    let room = "camera { eye 0 0 4.5; center 0 0 0; fovy 70; size 12 12 }
        material \"white\" { kd 0.5 }
        integrator \"radiosity\" { error 0.4 }
        film { sample \"center\" }
        box material=\"white\" { min -5 -5 -5; max 5 -4.5 5 }
        box material=\"white\" { min -5 -5 -5.5; max 5 5 -5 }\n";
    let lamp = "light \"sphere\" name=\"it\" @ { center 3 3 -3; radius 0.5; points 4 }";
    let hidden = drawn(&format!("{room}{}", lamp.replace('@', "")));
    let seen = drawn(&format!("{room}{}", lamp.replace('@', "visible=#true")));
    let (compared, differ) = differing(&seen, &hidden);
    assert!(compared > 100 && differ == 0, "{differ} of {compared} pixels differ");
}

#[test]
fn only_lights_with_a_surface_can_be_seen() {
    let wrong = read_scene_text("light \"omni\" { position 0 1 0; visible #true }", "s", &MemoryAssets::new(), &[]);
    assert!(wrong.unwrap_err().to_string().contains("visible"));
}
