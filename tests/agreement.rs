//! Agreement between hierarchy and brute force, explanation and pixel, layers and picture.

use canaletto::Named;
use canaletto::Ray;
use canaletto::explain::explain;
use canaletto::integrator::layers_of;
use canaletto::math::Rgb;
use canaletto::render::render;
use canaletto::scene::{Filter, SamplerKind, Sampling, Stage, WhittedSettings};
use canaletto::world::World;
use canaletto_tests::gallery::{distributed_job, distributed_still_life, still_life, still_life_job};
use canaletto_tests::textured::textured_still_life;
use glam::Vec3;

#[test]
fn the_hierarchies_find_what_brute_force_finds() {
    let world = World::build(still_life(1.0)).unwrap();
    let mut hits = 0;
    for i in 0..20_000u32 {
        let h = |k: u32| {
            let x = i.wrapping_mul(2654435761).wrapping_add(k.wrapping_mul(0x9e37_79b1));
            (x ^ (x >> 15)).wrapping_mul(0x85eb_ca6b) as f32 / u32::MAX as f32 * 2.0 - 1.0
        };
        let ray = Ray::new(Vec3::new(h(1) * 4.0, h(2) * 2.0 + 1.5, h(3) * 4.0), Vec3::new(h(4), h(5), h(6)));
        let (fast, slow) = (world.intersect(&ray, f32::INFINITY), world.intersect_brute_force(&ray, f32::INFINITY));
        assert_eq!(fast, slow, "{ray:?}");
        hits += u32::from(fast.is_some());
    }
    assert!(hits > 10_000, "{hits}");
}

/// For every sampling, every filter and every stage, the recorded terms sum to each pixel of the picture.
#[test]
fn the_explanations_sum_is_the_pixel_bit_for_bit() {
    sums_are_pixels(&World::build(still_life(1.0)).unwrap());
}

/// The recorded terms sum to each pixel with textures for everything, too: overlays, cutouts, bumps.
#[test]
fn the_explanations_sum_is_the_pixel_with_textures_too() {
    sums_are_pixels(&World::build(textured_still_life(1.0)).unwrap());
}

fn sums_are_pixels(world: &World) {
    let samplings = [
        (Sampling::Corner, Filter::Box),
        (Sampling::Center, Filter::Mitchell),
        (Sampling::Regular(2), Filter::Tent),
        (Sampling::Jittered(3), Filter::Gaussian { sigma: 0.5 }),
        (Sampling::Jittered(2), Filter::Mitchell),
        (Sampling::Adaptive { n: 3, threshold: 0.1 }, Filter::Box),
        (Sampling::Sampled(5), Filter::Mitchell),
    ];
    let mut different = std::collections::HashSet::new();
    for (sampling, filter) in samplings {
        for &stage in Stage::ALL {
            let mut job = still_life_job(1.0, 24, 18, sampling);
            job.film.filter = filter;
            job.integrator = WhittedSettings { stage, ..*job.description().whitted().unwrap() }.into();
            let picture = render(world, &job, &()).unwrap().picture;
            for y in 0..18 {
                for x in 0..24 {
                    let tree = explain(world, &job, x, y).unwrap();
                    let pixel = picture.pixel(x, y);
                    assert_eq!(
                        bits(tree.sum()),
                        bits(pixel),
                        "{sampling:?} {filter:?} {stage:?}: pixel {x}, {y}\n{tree}"
                    );
                    assert_eq!(bits(tree.color), bits(pixel));
                    different.insert(bits(pixel));
                }
            }
        }
    }
    assert!(different.len() > 5000, "the pictures show something: {} colours", different.len());
}

#[test]
fn the_explanation_of_distributed_rays_is_as_exact() {
    let world = World::build(distributed_still_life(1.0)).unwrap();
    let told = ["from the point of the lens", "at time ", "(random point 1 at (", "from a random microfacet with n = "];
    for &sampler in SamplerKind::ALL {
        let job = distributed_job(1.0, 24, 18, 3, sampler);
        let picture = render(&world, &job, &()).unwrap().picture;
        for y in 0..18 {
            for x in 0..24 {
                let tree = explain(&world, &job, x, y).unwrap();
                let pixel = picture.pixel(x, y);
                assert_eq!(bits(tree.sum()), bits(pixel), "{sampler:?}: pixel {x}, {y}\n{tree}");
                for sample in &tree.samples {
                    let [right, up] = sample.lens.expect("the lens's point is told");
                    let offset = glam::DVec3::from(sample.ray.origin.map(f64::from)) - job.camera.eye();
                    let expected = job.camera.axes()[0] * right + job.camera.axes()[1] * up;
                    assert!((offset - expected).length() < 1e-6);
                }
            }
        }
        for words in told {
            let texts = (0..18).flat_map(|y| (0..24).map(move |x| (x, y)));
            let found = texts.map(|(x, y)| explain(&world, &job, x, y).unwrap().to_string());
            assert!(found.into_iter().any(|text| text.contains(words)), "no pixel tells: {words}");
        }
    }
}

#[test]
fn the_light_layers_sum_to_the_picture() {
    layers_sum(&World::build(still_life(1.0)).unwrap());
    layers_sum(&World::build(textured_still_life(1.0)).unwrap());
}

fn layers_sum(world: &World) {
    let mut job = still_life_job(1.0, 32, 24, Sampling::Jittered(2));
    job.aovs = layers_of(&job.integrator, false);
    let with = render(world, &job, &()).unwrap().picture;
    job.aovs.clear();
    let without = render(world, &job, &()).unwrap().picture;
    assert_eq!(with.pixels, without.pixels, "asking for layers changes no pixel");
    let mut seen = [false; 4];
    for (i, pixel) in with.pixels.iter().enumerate() {
        let layer = |name: &str| {
            let data = &with.layer(name).unwrap().data;
            Rgb::new(data[3 * i], data[3 * i + 1], data[3 * i + 2])
        };
        let parts = ["diffuse", "specular", "ambient", "emission", "reflection", "refraction"].map(layer);
        let sum: Rgb = parts.into_iter().sum();
        for (a, b) in sum.to_array().into_iter().zip(pixel.to_array()) {
            assert!((a - b).abs() <= 2e-6 * b.max(1.0), "pixel {i}: {sum:?} instead of {pixel:?}");
        }
        for (seen, part) in
            seen.iter_mut().zip([layer("shadow"), layer("reflection"), layer("refraction"), layer("emission")])
        {
            *seen |= !part.is_black();
        }
    }
    assert_eq!(seen, [true, true, true, world.may_emit()], "all layers appear somewhere");
}

fn bits(c: Rgb) -> [u32; 3] {
    c.to_array().map(f32::to_bits)
}
