//! A job in its world.

use super::Job;
use crate::world::World;
use glam::DVec3;
use std::ops::Deref;
use std::sync::Arc;

/// A job in a world, whose camera is relative to the world's origin, as rays and hits are. Copies share it.
#[derive(Clone, Debug)]
pub struct PlacedJob<'w> {
    world: &'w World,
    job: Arc<Job>,
}

impl<'w> PlacedJob<'w> {
    /// Places a job, whose camera has the coordinates of the scene.
    pub fn new(world: &'w World, job: &Job) -> PlacedJob<'w> {
        let (origin, mut job) = (world.origin(), job.clone());
        if origin != DVec3::ZERO {
            job.camera = job.camera.relative_to(origin);
        }
        PlacedJob { world, job: Arc::new(job) }
    }

    /// The world.
    pub fn world(&self) -> &'w World {
        self.world
    }

    /// Whether a pixel's colour is divided by its alpha when it is shown. Shadows on catchers are separated from whole
    /// pictures only, so that single pixels keep their background.
    pub(crate) fn divides_by_alpha(&self) -> bool {
        self.film.alpha && self.world.shadow_background().is_none()
    }

    /// This job with another setting. Its camera stays relative to the world's origin.
    pub(crate) fn with(&self, change: impl FnOnce(&mut Job)) -> PlacedJob<'w> {
        let mut job = Job::clone(&self.job);
        change(&mut job);
        PlacedJob { job: Arc::new(job), ..self.clone() }
    }
}

/// The job, with its camera relative to the world's origin.
impl Deref for PlacedJob<'_> {
    type Target = Job;

    fn deref(&self) -> &Job {
        &self.job
    }
}
