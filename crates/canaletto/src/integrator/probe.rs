//! Probes: observers of an integrator. The picture and its explanation run one code. The integrator is generic over a
//! probe, and the empty probe compiles to nothing.

use super::{PathEvent, RasterNode};
use crate::light::environment::EnvironmentLookup;
use crate::material::MaterialPoint;
use crate::math::Rgb;
use crate::shape::Surface;
use crate::world::{GeometryProbe, Hit};
use canaletto_bvh::Ray;
use glam::{DVec3, Vec3};
use serde::Serialize;

/// The kind of a ray: why it is traced.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum RayKind {
    /// A camera ray.
    Eye,
    /// A ray in the mirror direction, with the factor k.
    Reflected,
    /// A ray refracted by Snell's law, with the factor 1 − o.
    Refracted,
    /// A ray mirrored inside a clear body beyond the critical angle, with the factor 1 − o.
    TotallyReflected,
    /// A ray in a random direction of a surface's scattering, of a path.
    Scattered,
    /// A ray that goes straight on through a surface of partial coverage, with the factor 1 − coverage.
    Passed,
}

/// The terms of one light point at a hit (5.39a).
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct LightTerm {
    /// Index into [`crate::world::World::lights`].
    pub light: u32,
    /// Index of the light's point.
    pub point: u32,
    /// The position of the point in world space, if it was chosen at random.
    pub sampled: Option<Vec3>,
    /// L̂, the unit direction to the point.
    pub direction: Vec3,
    /// The distance to the point; infinite for light from infinity.
    pub distance: f32,
    /// The intensity at the hit, after attenuation, cone and region.
    pub intensity: Rgb,
    /// n·L. Where it isn't positive, the light adds nothing and the factors below are zero.
    pub n_dot_l: f32,
    /// Whether the light is behind the surface but in front of its bent normal. It adds nothing then.
    pub behind: bool,
    /// r·L of (5.38).
    pub r_dot_l: f32,
    /// f_s, the share of the light that passes the surfaces in between, 0..=1.
    pub f_s: f32,
    /// l ⊗ kd (n·L), without f_s.
    pub diffuse: Rgb,
    /// l ⊗ ks (r·L)ⁿ, without f_s.
    pub specular: Rgb,
    /// The contribution of the light: (diffuse + specular) f_s.
    pub contribution: Rgb,
}

/// The light that comes straight from emitting surfaces to a hit. Polygons of constant radiance are lights.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct EmittersTerm {
    /// The light with nothing between, as the radiance of a white surface: Σ form factor × radiance.
    pub unoccluded: Rgb,
    /// The light that arrives, likewise.
    pub arriving: Rgb,
    /// The number of shadow rays.
    pub rays: u32,
    /// The number of shadow rays that pass. Clear surfaces let a share of one pass.
    pub passed: f32,
    /// The term of the colour: arriving ⊗ kd.
    pub contribution: Rgb,
}

/// An observer of an integrator. Calls come in the order of the ray tree: a ray, then its miss or hit, then its end.
/// After a hit come its ambient term, the term of emitters, its emission, its lights (each after its blockers) and its
/// child rays.
///
/// Calls of [`GeometryProbe`] come before the hit or the light that they belong to.
pub trait Probe: GeometryProbe {
    /// A sample of the pixel begins. `position` is in pixels (y upwards); `weight` is its filter weight.
    fn sample(&mut self, _position: [f64; 2], _weight: f64) {}
    /// The share of the background that the sample hides, if that is asked for.
    fn alpha(&mut self, _share: f32) {}
    /// The random choices for the sample. `time` is in 0..=1 and given if anything moves. `lens` is the point of the
    /// lens that the ray leaves, to the right and upwards, given if there is a lens.
    fn drawn(&mut self, _time: Option<f64>, _lens: Option<[f64; 2]>) {}
    /// The next ray leaves a rough surface from a random microfacet with this unit normal.
    fn lobe(&mut self, _roughness: f32, _facet: DVec3) {}
    /// A ray starts. `depth` is 1 for camera rays; `factor` multiplies its colour.
    fn ray(&mut self, _kind: RayKind, _ray: &Ray, _depth: u32, _factor: Rgb) {}
    /// The ray hit nothing, and this is its lookup in the environment. [`Probe::miss`] follows. There is no call
    /// without an environment.
    fn environment_lookup(&mut self, _lookup: &EnvironmentLookup) {}
    /// The ray hit nothing.
    fn miss(&mut self, _background: Rgb) {}
    /// The next refracted ray goes from a medium with η `from` into one with η `into`.
    fn bent(&mut self, _from: f64, _into: f64) {}
    /// The ray passed a surface of a clear body that another body hides.
    fn hidden(&mut self, _hit: &Hit) {}
    /// The ray passed through a hole that a texture cuts out of the surface.
    fn hole(&mut self, _hit: &Hit) {}
    /// The ray hit this surface. `outside` is true if it hit the outer side.
    fn hit(&mut self, _hit: &Hit, _surface: &Surface, _material: &MaterialPoint, _outside: bool) {}
    /// The colour of the surface without lighting.
    fn unlit(&mut self, _kd: Rgb) {}
    /// The ambient term.
    fn ambient(&mut self, _term: Rgb) {}
    /// The term of emitting surfaces as lights. There is no call where none faces the hit.
    fn emitters(&mut self, _term: &EmittersTerm) {}
    /// The surface emits this radiance towards the viewer. There is no call if it is black.
    fn emission(&mut self, _radiance: Rgb) {}
    /// The terms of a light.
    fn light(&mut self, _term: &LightTerm) {}
    /// An overlay of colour t covers the colour I so far, with a share a: a t + (1 − a) I. A share of 1 is reported
    /// before all lights.
    fn overlay(&mut self, _color: Rgb, _share: f32) {}
    /// The surface has partial coverage: the colour so far is multiplied by it.
    fn coverage(&mut self, _share: f32) {}
    /// A child ray was not followed, because of its depth or weight.
    fn cut(&mut self, _kind: RayKind, _factor: Rgb) {}
    /// Something happens along a path. Only path tracing calls it, beside [`Probe::sample`], [`Probe::drawn`] and
    /// [`Probe::end`], and the calls for the first ray.
    fn path(&mut self, _event: PathEvent) {}
    /// What a rasteriser shows at the sample that began.
    fn raster(&mut self, _node: &RasterNode) {}
    /// Whether a rasteriser lists what covers a sample's place and isn't seen, which takes time.
    fn lists_rivals(&self) -> bool {
        false
    }
    /// The current ray ends with this colour, before its factor is applied.
    fn end(&mut self, _color: Rgb) {}
}

/// The empty probe.
impl Probe for () {}
