//! The size of ray trees: into how many rays a camera ray of classic ray tracing branches.

use super::pixel_grid;
use crate::integrator::camera_rays::PixelRenderer;
use crate::integrator::{RayCounts, RayIntegrator, Whitted};
use crate::job::{Job, PlacedJob};
use crate::render::stack_of;
use crate::scene::{FilmSettings, Sampling};
use crate::world::World;
use canaletto_bvh::with_stack;

/// The mean size of the ray trees of a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct RayTrees {
    /// The rays of a camera ray's tree, shadow rays included.
    pub rays: f64,
    /// The shadow rays among them.
    pub shadow_rays: f64,
    /// Whether trees were cut short, so that there are more rays than counted.
    pub is_more: bool,
}

/// The pixels of each side whose trees are counted, and the step from one to the next: a prime that divides none of
/// their numbers.
const GRID: [u32; 2] = [8, 8];
const STEP: usize = 37;
/// The rays at which the counting of a tree ends, and that of all trees.
const MAX_RAYS: u64 = 1 << 14;
const MAX_RAYS_OF_ALL: u64 = 1 << 17;
/// The least mean size that is reported. A tree of depth 6 between mirrors that are clear has 63 rays, and as many
/// shadow rays for each point of a light.
const LARGE: f64 = 1000.0;

/// The mean size of the ray trees of this job, if it is so large that a picture takes a thousand times as long as one
/// that shows what camera rays meet. `None` for other integrators than the classic one.
pub fn large_ray_trees(world: &World, job: &Job) -> Option<RayTrees> {
    let settings = *job.description().whitted()?;
    let film = FilmSettings { sampling: Sampling::Center, ..FilmSettings::default() };
    let job = PlacedJob::new(world, &Job { film, ..job.clone() });
    let pixels = pixel_grid(&job, GRID);
    let is_too_many = |rays| rays > MAX_RAYS;
    let count = || {
        let mut renderer = PixelRenderer::new(&job);
        let (mut all, mut trees, mut is_more) = (RayCounts::default(), 0, false);
        for i in 0..pixels.len() {
            let mut whitted = Whitted::new(world, settings).with_cancel(&is_too_many);
            renderer.pixel(&mut whitted, pixels[i * STEP % pixels.len()], &mut (), &mut |_, _| ());
            is_more |= whitted.is_cancelled();
            all += whitted.counts;
            trees += 1;
            if all.total() > MAX_RAYS_OF_ALL {
                break;
            }
        }
        let [rays, shadow_rays] = [all.total(), all.shadow.traced].map(|rays| rays as f64 / f64::from(trees.max(1)));
        RayTrees { rays, shadow_rays, is_more }
    };
    // Without a stack there is no result; the render will report the error.
    with_stack(stack_of(world, &job), count).ok().filter(|trees| trees.rays >= LARGE)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Camera;
    use crate::material::{Material, Phong};
    use crate::math::Rgb;
    use crate::render::render;
    use crate::scene::{Extrinsics, Intrinsics, Node, PathSettings, Scene, WhittedSettings};
    use crate::shape::{Shape, Sphere};
    use glam::{DVec3, Vec3};

    #[test]
    fn the_rays_are_those_of_the_picture() {
        let half_there = Material::new("m", Phong { k: Rgb::WHITE, ..Phong::default() }).with_coverage(0.5);
        let ball = |i: u32| {
            let center = Vec3::new((i % 3) as f32, (i / 3 % 3) as f32, (i / 9) as f32);
            Node::from(Shape::Sphere(Sphere { center, radius: 0.9 })).with_material(0)
        };
        let scene = Scene { nodes: (0..27).map(ball).collect(), materials: vec![half_there], ..Scene::default() };
        let world = World::build(scene).unwrap();
        let place = Extrinsics { eye: DVec3::new(1.0, 1.0, 9.0), center: DVec3::ONE, up: DVec3::Y };
        let camera = Camera::new(&Intrinsics { width: 8, height: 8, ..Intrinsics::default() }, &place).unwrap();
        let film = FilmSettings { sampling: Sampling::Center, ..FilmSettings::default() };
        let job = |max_depth: u32| {
            let settings = WhittedSettings { max_depth, min_weight: 0.0, ..WhittedSettings::default() };
            Job::new(camera.clone(), film, settings)
        };
        let trees = large_ray_trees(&world, &job(4)).unwrap();
        let rays = render(&world, &job(4), &()).unwrap().counts.rays;
        let [rays, shadow_rays] = [rays.total(), rays.shadow.traced].map(|rays| rays as f64 / 64.0);
        assert_eq!(trees, RayTrees { rays, shadow_rays, is_more: false });
        assert!(large_ray_trees(&world, &job(12)).unwrap().is_more);
        assert_eq!(large_ray_trees(&world, &job(1)), None);
        assert_eq!(large_ray_trees(&world, &Job { integrator: PathSettings::DEFAULT.into(), ..job(4) }), None);
    }
}
