//! What an integrator tells whoever watches it. The picture and its explanation run the same code: the integrator is
//! generic over a probe, and the empty one compiles to nothing.

use crate::light::environment::EnvironmentLookup;
use crate::material::MaterialPoint;
use crate::math::Rgb;
use crate::shape::Surface;
use crate::world::{Hit, TextureRead};
use canaletto_bvh::Ray;
use glam::{DVec3, Vec3};
use serde::Serialize;

/// Why a ray is traced.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum RayKind {
    /// From the eye.
    Eye,
    /// In the mirror direction, by the factor k.
    Reflected,
    /// By Snell's law, by the factor 1 − o.
    Refracted,
    /// Mirrored inside a clear body beyond the critical angle, by the factor 1 − o.
    TotallyReflected,
    /// Straight on where a cut-out leaves a part of the surface away, by the factor 1 − that part.
    Passed,
}

/// The terms of one light point at a hit (5.39a).
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct LightTerm {
    /// Index into [`crate::world::World::lights`].
    pub light: u32,
    /// Which of the light's points.
    pub point: u32,
    /// Where the point is, if it was chosen at random.
    pub sampled: Option<Vec3>,
    /// L̂, the unit direction to it.
    pub direction: Vec3,
    /// Its distance; infinite for light from infinity.
    pub distance: f32,
    /// Its intensity here, after attenuation, cone and region.
    pub intensity: Rgb,
    /// n·L. Where it isn't positive, the light adds nothing and the factors below are zero.
    pub n_dot_l: f32,
    /// Whether the light stands behind the surface although a bent normal leans towards it; it adds nothing then.
    pub behind: bool,
    /// r·L of (5.38).
    pub r_dot_l: f32,
    /// f_s: the light that passes all that lies between, 0..=1.
    pub f_s: f32,
    /// l ⊗ kd (n·L), without f_s.
    pub diffuse: Rgb,
    /// l ⊗ ks (r·L)ⁿ, without f_s.
    pub specular: Rgb,
    /// What was added: (diffuse + specular) f_s.
    pub contribution: Rgb,
}

/// A watcher of an integrator. Calls come in the order of the ray tree: a ray, then its miss or its hit with ambient
/// term, lights (each after its blockers) and child rays, then its end.
pub trait Probe {
    /// Whether calls are worth making at all.
    const ACTIVE: bool = true;
    /// A sample of the pixel begins: its place in pixels (y upwards) and its weight.
    fn sample(&mut self, _position: [f64; 2], _weight: f64) {}
    /// What was chosen at random for the sample: its time in 0..=1, if anything moves, and the point of the lens that its ray
    /// leaves, to the right and upwards, if there is a lens.
    fn drawn(&mut self, _time: Option<f64>, _lens: Option<[f64; 2]>) {}
    /// The ray that starts next leaves a rough surface from a facet with this unit normal, chosen at random.
    fn lobe(&mut self, _roughness: f32, _facet: DVec3) {}
    /// A ray starts. `depth` is 1 for eye rays; `factor` is what its colour is multiplied with.
    fn ray(&mut self, _kind: RayKind, _ray: &Ray, _depth: u32, _factor: Rgb) {}
    /// It met nothing, and this is what it saw of the environment; [`Probe::miss`] follows. Not called without one.
    fn environment_lookup(&mut self, _sighting: &EnvironmentLookup) {}
    /// It met nothing.
    fn miss(&mut self, _background: Rgb) {}
    /// The refracted ray that starts next goes from a medium of this η into one of that.
    fn bent(&mut self, _from: f64, _into: f64) {}
    /// It passed the surface of a clear body where another one fills the place.
    fn hidden(&mut self, _hit: &Hit) {}
    /// It passed through a hole that a texture cuts out of this.
    fn hole(&mut self, _hit: &Hit) {}
    /// A texture was read at the hit that [`Probe::hit`] tells next.
    fn texture(&mut self, _read: &TextureRead) {}
    /// It met this surface. `outside` tells the side of it.
    fn hit(&mut self, _hit: &Hit, _surface: &Surface, _material: &MaterialPoint, _outside: bool) {}
    /// Without lighting, this is the colour.
    fn unlit(&mut self, _kd: Rgb) {}
    /// The ambient term.
    fn ambient(&mut self, _term: Rgb) {}
    /// Something between the hit and the light that [`Probe::light`] tells next; `opacity` is its o.
    fn blocker(&mut self, _hit: &Hit, _opacity: f32) {}
    /// A light's terms.
    fn light(&mut self, _term: &LightTerm) {}
    /// A colour t lies over the colour I so far, with this share a: a t + (1 − a) I. A share of 1 comes before all lights.
    fn overlay(&mut self, _color: Rgb, _share: f32) {}
    /// Only this share of the surface is there: what was added so far is multiplied by it.
    fn coverage(&mut self, _share: f32) {}
    /// A child ray was not followed, because of depth or weight.
    fn cut(&mut self, _kind: RayKind, _factor: Rgb) {}
    /// The current ray ends with this colour (its factor not applied).
    fn end(&mut self, _color: Rgb) {}
}

/// Watches nothing.
impl Probe for () {
    const ACTIVE: bool = false;
}
