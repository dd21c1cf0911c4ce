//! The kernels of eight opaque vertices: the steps of [`PathTracer::arrive`](super::PathTracer::arrive) and
//! [`PathTracer::scatter`](super::PathTracer::scatter) by the same formulas, so that colours have equal bits.

use super::super::direct::SourcePoint;
use super::super::event::power_heuristic;
use super::super::guiding::pdf_of_both;
use super::super::light_sampler::Source;
use super::super::light_tree::Receiver;
use super::super::trace::{ROULETTE_AFTER, survival, uses};
use super::scattering::Scattering8;
use super::{LANES, rgb};
use crate::integrator::visible_hit::Frame;
use crate::math::offset_origin;
use crate::sampler::{Dimension, Samples8};
use crate::shape::{DVec3x8, SurfaceInputs8, Surfaces, Vec3x8, dvec3, set_dvec3, set_vec3, vec3};
use canaletto_bvh::Kernel;
use glam::{DVec3, Vec3};

/// Eight points of sources, seen from the vertices.
pub(super) struct SourcePoints {
    pub(super) wi: DVec3x8,
    /// The points themselves, or the directions to sources that are infinitely far.
    pub(super) to: DVec3x8,
    radiance: Vec3x8,
    pdf: [f64; LANES],
    /// Whether a vertex is lit, whether its source is infinitely far, and whether rays find the source, too.
    lit: [bool; LANES],
    pub(super) far: [bool; LANES],
    found: [bool; LANES],
}

impl SourcePoints {
    pub(super) const NONE: SourcePoints = SourcePoints {
        wi: [[0.0; LANES]; 3],
        to: [[0.0; LANES]; 3],
        radiance: [[0.0; LANES]; 3],
        pdf: [1.0; LANES],
        lit: [false; LANES],
        far: [false; LANES],
        found: [false; LANES],
    };

    pub(super) fn set(&mut self, lane: usize, source: Source, point: &SourcePoint) {
        set_dvec3(&mut self.wi, lane, point.wi);
        set_dvec3(&mut self.to, lane, point.position.unwrap_or(point.wi));
        set_vec3(&mut self.radiance, lane, point.radiance.to_array().into());
        self.pdf[lane] = point.pdf;
        self.lit[lane] = true;
        self.far[lane] = point.position.is_none();
        self.found[lane] = source.is_found_by_rays();
    }
}

/// What a guiding field tells of eight vertices. The probabilities are 0 where it doesn't guide.
pub(super) struct GuidedVertices {
    /// The probabilities with which paths follow the field.
    pub(super) probability: [f64; LANES],
    /// Whether paths follow it.
    pub(super) chosen: [bool; LANES],
    /// The field's densities of the directions to the sources.
    pub(super) pdf_of_source: [f64; LANES],
    /// The directions in which guided paths go on, and the field's densities of them.
    pub(super) wi: DVec3x8,
    pub(super) pdf: [f64; LANES],
    /// [`Path::guided`](super::Path::guided) of all paths.
    pub(super) guided: [f32; LANES],
}

/// What follows from the surfaces of eight vertices and from their samples.
pub(super) struct Arrived {
    /// The unit directions to the viewers.
    pub(super) wo: DVec3x8,
    pub(super) normal: DVec3x8,
    pub(super) facing: DVec3x8,
    exact: DVec3x8,
    /// The random numbers for sources, for the choice between field and surface, and for directions.
    pub(super) u_source: ([f64; LANES], [[f64; LANES]; 2]),
    pub(super) u_lobe: [f64; LANES],
    pub(super) u_direction: [[f64; LANES]; 2],
    u_roulette: [f64; LANES],
}

impl Arrived {
    /// A vertex as lights see it.
    pub(super) fn receiver(&self, lane: usize) -> Receiver {
        Receiver { point: dvec3(&self.exact, lane), normal: dvec3(&self.normal, lane), two_sided: false }
    }
}

/// The rays that leave eight vertices.
pub(super) struct Scattered {
    /// The light of sources before shadows.
    pub(super) light: Vec3x8,
    pub(super) shadow_origin: Vec3x8,
    pub(super) shadow_direction: Vec3x8,
    /// A bit for each vertex that a source lights.
    pub(super) lit: u32,
    pub(super) wi: DVec3x8,
    pub(super) pdf: [f64; LANES],
    /// [`Path::guided`](super::Path::guided) from here on.
    pub(super) guided: [f32; LANES],
    pub(super) throughput: Vec3x8,
    pub(super) origin: Vec3x8,
    pub(super) direction: Vec3x8,
    /// A bit for each path that goes on.
    pub(super) alive: u32,
}

/// The dimensions of a use at each vertex.
#[inline(always)]
fn of_use(places: &[Dimension; LANES], number: u32) -> [Dimension; LANES] {
    let mut all = *places;
    for i in 0..LANES {
        all[i] = places[i].of(number);
    }
    all
}

/// Evaluates surfaces, normals and random numbers.
pub(super) struct Arrive<'a> {
    pub(super) inputs: &'a SurfaceInputs8,
    pub(super) surfaces: &'a mut Surfaces,
    pub(super) samples: &'a Samples8,
    pub(super) places: &'a [Dimension; LANES],
    /// Whether any path may end by roulette.
    pub(super) has_roulette: bool,
}

impl Kernel for Arrive<'_> {
    type Answer = Arrived;

    #[inline(always)]
    fn run(self) -> Arrived {
        let Arrive { inputs, surfaces, samples, places, has_roulette } = self;
        inputs.surfaces(surfaces);
        let u_source = samples.one_and_two(&of_use(places, uses::LIGHT));
        let (u_lobe, u_direction) = samples.one_and_two(&of_use(places, uses::LOBE));
        let u_roulette = if has_roulette { samples.one(&of_use(places, uses::ROULETTE)) } else { [0.0; LANES] };
        let [mut wo, mut normal, mut facing] = [[[0.0; LANES]; 3]; 3];
        for i in 0..LANES {
            let frame = Frame::new(dvec3(&inputs.direction, i), &surfaces.get(i));
            set_dvec3(&mut wo, i, frame.wo);
            set_dvec3(&mut normal, i, frame.normal);
            set_dvec3(&mut facing, i, frame.facing);
        }
        Arrived { wo, normal, facing, exact: surfaces.exact, u_source, u_lobe, u_direction, u_roulette }
    }
}

/// Evaluates the light of sources and the directions in which paths go on.
pub(super) struct Scatter<'a, S> {
    pub(super) surfaces: &'a Surfaces,
    pub(super) arrived: &'a Arrived,
    pub(super) bsdfs: &'a S,
    pub(super) points: &'a SourcePoints,
    pub(super) guides: &'a GuidedVertices,
    pub(super) throughput: &'a Vec3x8,
    pub(super) depth: &'a [u32; LANES],
    pub(super) has_roulette: bool,
}

impl<S> Scatter<'_, S> {
    /// The density of a direction by the guiding field and the surface together.
    #[inline(always)]
    fn pdf_of_both(&self, lane: usize, pdf_guide: f64, pdf_scattering: f64) -> f64 {
        pdf_of_both(self.guides.probability[lane], pdf_guide, pdf_scattering)
    }

    /// The origin of a ray that leaves in a direction.
    #[inline(always)]
    fn origin(&self, lane: usize, direction: DVec3) -> Vec3 {
        let Surfaces { point, error, normal, .. } = self.surfaces;
        offset_origin(vec3(point, lane), vec3(error, lane), dvec3(normal, lane), direction)
    }
}

impl<S: Scattering8> Kernel for Scatter<'_, S> {
    type Answer = Scattered;

    #[inline(always)]
    fn run(self) -> Scattered {
        let (points, guides, arrived, bsdfs) = (self.points, self.guides, self.arrived, self.bsdfs);
        // Each loop writes to arrays of its own, of one type each. The compiler vectorises no other loops.
        let (mut f, mut light) = ([[0.0; LANES]; 3], [[0.0; LANES]; 3]);
        for i in 0..LANES {
            let wi = dvec3(&points.wi, i);
            let reflected = bsdfs.eval(i, wi);
            let scattering = self.pdf_of_both(i, guides.pdf_of_source[i], bsdfs.pdf(i, wi));
            let weight = power_heuristic(points.pdf[i], scattering);
            let weight = if points.found[i] { weight } else { 1.0 };
            let seen = reflected * rgb(&points.radiance, i) * (1.0 / points.pdf[i]) as f32 * weight;
            set_vec3(&mut f, i, reflected.to_array().into());
            set_vec3(&mut light, i, seen.to_array().into());
        }
        let (mut shadow_origin, mut shadow_direction) = ([[0.0; LANES]; 3], [[0.0; LANES]; 3]);
        for i in 0..LANES {
            let origin = self.origin(i, dvec3(&points.wi, i));
            let to = dvec3(&points.to, i);
            let near = to - origin.as_dvec3();
            let direction = if points.far[i] { to } else { near };
            set_vec3(&mut shadow_origin, i, origin);
            set_vec3(&mut shadow_direction, i, direction.as_vec3());
        }
        let (mut wi, mut own, mut pdf) = ([[0.0; LANES]; 3], [0.0; LANES], [0.0; LANES]);
        for i in 0..LANES {
            let of_surface = bsdfs.direction(i);
            let direction = if guides.probability[i] > 0.0 { dvec3(&guides.wi, i) } else { of_surface };
            own[i] = bsdfs.pdf(i, direction);
            pdf[i] = self.pdf_of_both(i, guides.pdf[i], own[i]);
            set_dvec3(&mut wi, i, direction);
        }
        let mut throughput = [[0.0; LANES]; 3];
        for (i, pdf) in pdf.iter().enumerate() {
            let f = bsdfs.eval(i, dvec3(&wi, i));
            let next = (rgb(self.throughput, i) * f * (1.0 / pdf) as f32).saturated();
            set_vec3(&mut throughput, i, next.to_array().into());
        }
        let (mut origin, mut direction) = ([[0.0; LANES]; 3], [[0.0; LANES]; 3]);
        for i in 0..LANES {
            let wi = dvec3(&wi, i);
            set_vec3(&mut origin, i, self.origin(i, wi));
            set_vec3(&mut direction, i, wi.as_vec3());
        }
        let mut guided = guides.guided;
        for (i, own) in own.iter().enumerate() {
            let ratio = (pdf[i] / own) as f32;
            guided[i] *= if guides.probability[i] > 0.0 { ratio } else { 1.0 };
        }
        let (mut lit, mut alive) = (0, 0);
        for (i, own) in own.into_iter().enumerate() {
            let (f, throughput) = (rgb(&f, i), rgb(&throughput, i));
            lit |= u32::from(points.lit[i] && !f.is_black() && f.is_finite()) << i;
            // A surface's own direction that it doesn't scatter to has no density.
            let is_sampled = own > 0.0 || guides.chosen[i];
            alive |= u32::from(is_sampled && !throughput.is_black() && throughput.is_finite()) << i;
        }
        if self.has_roulette {
            for (i, guided) in guided.into_iter().enumerate() {
                let before = rgb(&throughput, i);
                // Guiding makes throughputs small where much light is, and paths there shouldn't end.
                let survival = survival(before * guided, self.depth[i]);
                let is_asked = self.depth[i] > ROULETTE_AFTER;
                let survives = arrived.u_roulette[i] < f64::from(survival);
                alive &= !(u32::from(is_asked && !survives) << i);
                let after = before * if is_asked { 1.0 / survival } else { 1.0 };
                set_vec3(&mut throughput, i, after.to_array().into());
            }
        }
        Scattered { light, shadow_origin, shadow_direction, lit, wi, pdf, guided, throughput, origin, direction, alive }
    }
}
