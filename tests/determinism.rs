//! The bytes are equal for any number of threads, any tile size, any build quality, and any power of two as unit of
//! length.

use canaletto::Named;
use canaletto::integrator::layers_of;
use canaletto::render::render;
use canaletto::scene::{Content, Node, SamplerKind, Sampling, Scene};
use canaletto::shape::Mesh;
use canaletto::world::{BuildOptions, Quality, World};
use canaletto_bvh::TriangleBvh;
use canaletto_tests::assert_same_picture;
use canaletto_tests::gallery::{distributed_job, distributed_still_life, still_life, still_life_job};
use canaletto_tests::textured::textured_still_life;
use glam::{Vec2, Vec3};

#[test]
fn threads_and_tiles_change_no_bit() {
    threads_and_tiles(still_life);
}

#[test]
fn threads_and_tiles_change_no_bit_of_textures() {
    threads_and_tiles(textured_still_life);
}

fn threads_and_tiles(scene: fn(f32) -> Scene) {
    let samplings =
        [Sampling::Center, Sampling::Jittered(2), Sampling::Adaptive { n: 4, threshold: 0.05 }, Sampling::Sampled(3)];
    for sampling in samplings {
        let mut pictures = Vec::new();
        for (threads, tile) in [(1, 64), (1, 5), (2, 16), (3, 1), (7, 5)] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let world = World::build(scene(1.0)).unwrap();
                let mut job = still_life_job(1.0, 60, 45, sampling);
                job.tile = tile;
                job.aovs = layers_of(&job.integrator, false);
                let rendering = render(&world, &job, &()).unwrap();
                assert!(rendering.complete);
                pictures.push((format!("{sampling:?}, {threads} threads, tile {tile}"), rendering));
            });
        }
        let (_, first) = &pictures[0];
        for (name, rendering) in &pictures {
            assert_same_picture(&rendering.picture, &first.picture, name);
            assert_eq!(rendering.counts, first.counts, "{name}");
        }
    }
}

/// Crosswise beams of two triangles each. Every sixteenth one crosses the whole still life and is long enough to be
/// split.
fn beams() -> Mesh {
    let mut mesh = Mesh::default();
    for n in 0..400 {
        let way = Vec2::from_angle(n as f32 * 2.399).extend((n % 7) as f32 * 0.2 - 0.6).normalize();
        let side = way.cross(Vec3::new(0.3, 0.2, 1.0)).normalize() * 0.01;
        let at = Vec3::new((n % 20) as f32 * 0.4 - 4.0, (n / 20) as f32 * 0.3 - 3.0, (n % 9) as f32 * 0.5 - 4.0);
        let half = way * if n % 16 == 0 { 6.0 } else { 0.1 };
        let first = mesh.positions.len() as u32;
        mesh.positions.extend([at - half, at + half, at + half + side, at - half + side]);
        mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    }
    mesh
}

#[test]
fn work_on_hierarchies_changes_no_bit() {
    let mut scene = still_life(1.0);
    scene.nodes.push(Node::new(Content::Mesh(scene.meshes.len() as u32)));
    scene.meshes.push(beams());
    let worlds = [Quality::Medium, Quality::High]
        .map(|quality| World::build_with(scene.clone(), &BuildOptions { quality, ..BuildOptions::default() }).unwrap());
    let [medium, high] = worlds.each_ref().map(|world| world.stats().bytes);
    assert_ne!(high, medium, "the same trees");
    // A refit restores the full boxes of split primitives.
    let mesh = beams();
    let corners = |id: u32| mesh.corners(id as usize);
    for quality in [Quality::Medium, Quality::High] {
        let mut triangles = TriangleBvh::build_with(quality, mesh.triangles.len(), corners).unwrap();
        let built = triangles.statistics().sah_cost;
        triangles.refit(corners).unwrap();
        let whole = triangles.statistics().sah_cost;
        assert!(built < 0.9 * whole, "no triangle was split: {built} and {whole}");
    }
    for sampling in [Sampling::Center, Sampling::Jittered(2)] {
        let mut job = still_life_job(1.0, 120, 90, sampling);
        job.aovs = layers_of(&job.integrator, false);
        let [a, b] = worlds.each_ref().map(|world| render(world, &job, &()).unwrap());
        assert_same_picture(&a.picture, &b.picture, "two qualities of trees");
        assert_eq!(a.counts, b.counts);
        job.aovs.clear();
        let [a, b] = worlds.each_ref().map(|world| render(world, &job, &()).unwrap());
        assert_same_picture(&a.picture, &b.picture, "two qualities of trees");
        assert_eq!(a.counts, b.counts);
    }
}

#[test]
fn seeds_and_frames_change_jittered_pictures_only() {
    let world = World::build(still_life(1.0)).unwrap();
    let picture = |sampling, seed, frame| {
        let mut job = still_life_job(1.0, 30, 20, sampling);
        (job.seed, job.frame) = (seed, frame);
        render(&world, &job, &()).unwrap().picture
    };
    let jittered = Sampling::Jittered(2);
    let first = picture(jittered, 1, 0);
    assert_same_picture(&picture(jittered, 1, 0), &first, "seed 1 again");
    for other in [picture(jittered, 2, 0), picture(jittered, 1, 1)] {
        // All pixels at edges differ, and nothing else needs to.
        let differing = first.pixels.iter().zip(&other.pixels).filter(|(a, b)| a != b).count();
        assert!(differing > 200, "{differing} of 600 pixels");
    }
    assert_same_picture(&picture(Sampling::Center, 1, 0), &picture(Sampling::Center, 2, 5), "centres");
}

#[test]
fn a_power_of_two_as_unit_changes_no_bit() {
    power_of_two(still_life);
}

#[test]
fn a_power_of_two_as_unit_changes_no_bit_of_textures() {
    power_of_two(textured_still_life);
}

fn power_of_two(scene: fn(f32) -> Scene) {
    let picture = |k: i32| {
        let scale = 2f32.powi(k);
        let world = World::build(scene(scale)).unwrap();
        let job = still_life_job(scale, 80, 60, Sampling::Jittered(2));
        render(&world, &job, &()).unwrap().picture
    };
    let unscaled = picture(0);
    for k in [-20, -19, -7, -1, 1, 2, 10, 23, 30] {
        assert_same_picture(&picture(k), &unscaled, &format!("scaled by 2^{k}"));
    }
}

#[test]
fn distributed_rays_are_as_reproducible() {
    let picture = |threads: usize, tile: u32, k: i32, sampler| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let scale = 2f32.powi(k);
            let world = World::build(distributed_still_life(scale)).unwrap();
            let mut job = distributed_job(scale, 30, 24, 4, sampler);
            job.tile = tile;
            render(&world, &job, &()).unwrap()
        })
    };
    for &sampler in SamplerKind::ALL {
        let first = picture(1, 16, 0, sampler);
        for (threads, tile, k) in [(2, 7, 0), (3, 64, 0), (7, 5, 0), (2, 16, -20), (2, 16, 11)] {
            let (rendering, name) =
                (picture(threads, tile, k, sampler), format!("{sampler:?}, {threads} threads, 2^{k}"));
            assert_same_picture(&rendering.picture, &first.picture, &name);
            assert_eq!(rendering.counts, first.counts, "{name}");
        }
    }
}
