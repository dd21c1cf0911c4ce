//! A million spheres from a data file: read, built and rendered, with the answers that brute force gives.

use canaletto::Ray;
use canaletto::camera::Camera;
use canaletto::render::{Job, render};
use canaletto::world::World;
use canaletto_io::assets::MemoryAssets;
use canaletto_io::text::read_scene;
use glam::Vec3;

const COUNT: u32 = 1_000_000;

/// Centres in a cube of side 20, radii of 0.01 to 0.05.
fn sphere(i: u32) -> [f32; 4] {
    let h = |k: u32| {
        let x = i.wrapping_mul(0x9e37_79b1) ^ k.wrapping_mul(0x85eb_ca6b);
        let x = (x ^ (x >> 16)).wrapping_mul(0x7feb_352d);
        (x ^ (x >> 15)) as f32 / u32::MAX as f32
    };
    [h(1) * 20.0 - 10.0, h(2) * 20.0 - 10.0, h(3) * 20.0 - 10.0, 0.01 + 0.04 * h(4)]
}

#[test]
fn a_million_spheres() {
    let data: Vec<u8> = (0..COUNT).flat_map(sphere).flat_map(f32::to_le_bytes).collect();
    let text = r#"
        camera { eye 0 0 32; center 0 0 0; fovy 45; size 160 120 }
        material "red" { kd 0.7 0.3 0.2 }
        spheres name="cloud" material="red" file="points.bin"
        light "omni" { position 20 30 40; intensity 0.8 }
    "#;
    let assets = MemoryAssets::new().with("cloud.kdl", text).with("points.bin", data);
    let (scene, _) = read_scene("cloud.kdl", &assets).unwrap_or_else(|errors| panic!("{errors}"));
    let camera = Camera::new(&scene.views[0].intrinsics, &scene.views[0].extrinsics).unwrap();
    let job = Job::new(camera, scene.film, scene.integrator);
    let world = World::build(scene).unwrap();
    assert_eq!(world.census().cloud_spheres, u64::from(COUNT));

    let rendering = render(&world, &job, &()).unwrap();
    assert!(rendering.counts.eye.hit > 8_000 && rendering.counts.shadow.hit > 1_000, "{:?}", rendering.counts);

    for i in 0..20 {
        let [x, y, z, _] = sphere(i * 7919);
        let ray = Ray::new(Vec3::new(0.0, 0.0, 32.0), Vec3::new(x, y, z - 32.0));
        let hit = world.intersect(&ray, f32::INFINITY);
        assert!(hit.is_some());
        assert_eq!(hit, world.intersect_brute_force(&ray, f32::INFINITY));
    }
}
