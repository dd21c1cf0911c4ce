//! Diffuse light without rays, as from a solution of radiosity.

use crate::integrator::EmittersTerm;
use crate::math::Rgb;
use crate::sampler::{Dimension, Sample};
use crate::world::{Hit, World};
use glam::{DVec3, Vec3};

/// Diffuse light that is known at every surface, as from radiosity.
pub(crate) trait DiffuseLight: Sync {
    /// Whether the light of the scene's lights is added to it.
    fn takes_lights(&self) -> bool;

    /// The light that arrives at a hit, as the radiance of a white surface. Unknown surfaces get none.
    fn light_at(&self, hit: &Hit, point: DVec3, outside: bool) -> Rgb;

    /// The light of emitting surfaces that is not in it. Its contribution is left black. None if there is none.
    fn emitters_at(&self, receiver: &EmitterReceiver) -> Option<EmittersTerm>;
}

/// A place that asks for the light of emitting surfaces.
pub(crate) struct EmitterReceiver<'a> {
    pub(crate) world: &'a World,
    pub(crate) time: f32,
    pub(crate) point: DVec3,
    /// The unit shading normal on the viewer's side.
    pub(crate) normal: DVec3,
    /// The unit geometric normal on the viewer's side.
    pub(crate) facing: DVec3,
    /// The origin of shadow rays.
    pub(crate) start: Vec3,
    /// The source of random numbers, and the dimension for this use.
    pub(crate) sample: &'a Sample,
    pub(crate) dimension: Dimension,
}
