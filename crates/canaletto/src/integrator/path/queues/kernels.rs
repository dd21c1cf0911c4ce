//! The kernels of eight vertices: the steps of [`PathTracer::scatter`](super::PathTracer::scatter) by the same
//! formulas, so that colours have equal bits.

use super::super::event::power_heuristic;
use super::super::light_tree::Receiver;
use super::super::source_points::SourcePoints;
use super::super::trace::{ROULETTE_AFTER, survival, uses};
use super::LANES;
use super::scattering::{Evaluated8, Sampled8};
use crate::integrator::visible_hit::Frame;
use crate::material::FacetAxes;
use crate::math::{Vector, offset_origins, saturated};
use crate::sampler::{Dimension, Samples8};
use crate::shape::{DVec3x8, SurfaceInputs8, Surfaces, Vec3x8, dvec3, set_dvec3};
use canaletto_bvh::Kernel;
use canaletto_bvh::lanes::{LaneKernel, Mask, Real, Real32, Real64};

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
    pub(super) u_roulette: [f64; LANES],
}

/// The axes of the facets of eight vertices, and what is seen of them.
pub(super) struct FacetFrames<F> {
    pub(super) axes: FacetAxes<F>,
    pub(super) facing: Vector<F>,
    pub(super) wo: Vector<F>,
}

impl Arrived {
    /// The vertices' facets, which are alike in all directions.
    #[inline(always)]
    pub(super) fn facet_frames<F: Real64>(&self) -> FacetFrames<F> {
        let (wo, facing) = (Vector::load(&self.wo), Vector::load(&self.facing));
        FacetFrames { axes: FacetAxes::isotropic(Vector::load(&self.normal), facing, wo), facing, wo }
    }

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
    /// [`Path::guided`](super::Path::guided) from here on.
    pub(super) guided: [f32; LANES],
    pub(super) throughput: Vec3x8,
    pub(super) origin: Vec3x8,
    pub(super) direction: Vec3x8,
    /// A bit for each path that goes on.
    pub(super) alive: u32,
}

impl Scattered {
    const NONE: Scattered = Scattered {
        light: [[0.0; LANES]; 3],
        shadow_origin: [[0.0; LANES]; 3],
        shadow_direction: [[0.0; LANES]; 3],
        lit: 0,
        guided: [1.0; LANES],
        throughput: [[0.0; LANES]; 3],
        origin: [[0.0; LANES]; 3],
        direction: [[0.0; LANES]; 3],
        alive: 0,
    };
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
    /// Whether sources and lobes are chosen by a number of their own.
    pub(super) chooses_source: bool,
    pub(super) chooses_lobe: bool,
}

impl Kernel for Arrive<'_> {
    type Answer = Arrived;

    #[inline(always)]
    fn run(self) -> Arrived {
        let Arrive { inputs, surfaces, samples, places, has_roulette, chooses_source, chooses_lobe } = self;
        inputs.surfaces(surfaces);
        let u_source = samples.one_and_two(&of_use(places, uses::LIGHT), chooses_source);
        let (u_lobe, u_direction) = samples.one_and_two(&of_use(places, uses::LOBE), chooses_lobe);
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

/// Finds the light of sources and the rays along which paths go on.
pub(super) struct Scatter<'a> {
    pub(super) surfaces: &'a Surfaces,
    pub(super) points: &'a SourcePoints,
    pub(super) towards_sources: &'a Evaluated8,
    pub(super) sampled: &'a Sampled8,
    pub(super) throughput: &'a Vec3x8,
    pub(super) depth: &'a [u32; LANES],
    /// [`Path::guided`](super::Path::guided) before.
    pub(super) guided: &'a [f32; LANES],
    /// The random numbers of roulette, if any path may end by it.
    pub(super) u_roulette: Option<&'a [f64; LANES]>,
}

/// Whether a colour is finite and not black in each lane.
#[inline(always)]
fn is_lit<F: Real32>(color: Vector<F>) -> F::Mask {
    let infinite = F::splat(f32::INFINITY);
    !color.is_zero() & color.x.abs().less(infinite) & color.y.abs().less(infinite) & color.z.abs().less(infinite)
}

impl LaneKernel for Scatter<'_> {
    type Answer = Scattered;

    #[inline(always)]
    fn run<F: Real64>(self) -> Scattered {
        let Scatter { surfaces, points, towards_sources, sampled, .. } = self;
        let mut scattered = Scattered::NONE;
        let one = F::splat(1.0);
        let surface =
            (Vector::load(&surfaces.point), Vector::load(&surfaces.error), Vector::<F>::load(&surfaces.normal));

        let (f, radiance) = (Vector::load(&towards_sources.f), Vector::load(&points.radiance));
        let source_pdf = F::load(&points.pdf);
        let weight = power_heuristic(source_pdf, F::load(&towards_sources.pdf));
        let weight = F::Narrow::select(F::Mask::from_bits(points.found), weight, F::Narrow::splat(1.0));
        (f.times(radiance) * (one / source_pdf).narrow() * weight).store(&mut scattered.light);
        let (wi, to) = (Vector::load(&points.wi), Vector::load(&points.to));
        let origin = offset_origins(surface, wi);
        origin.store(&mut scattered.shadow_origin);
        let direction = Vector::select(F::Mask::from_bits(points.far), to, to - origin.widen());
        direction.narrow().store(&mut scattered.shadow_direction);
        scattered.lit = points.lit & is_lit(f).bits();

        let (wi, pdf) = (Vector::<F>::load(&sampled.wi), F::load(&sampled.pdf));
        let f = Vector::<F::Narrow>::load(&sampled.f);
        let mut throughput =
            (Vector::load(self.throughput).times(f) * (one / pdf).narrow()).map(saturated::<F::Narrow>);
        offset_origins(surface, wi).store(&mut scattered.origin);
        wi.narrow().store(&mut scattered.direction);
        let guided = F::Narrow::load(self.guided) * F::Narrow::load(&sampled.guided);
        guided.store(&mut scattered.guided);
        let mut alive = is_lit(throughput);
        if let Some(u_roulette) = self.u_roulette {
            let depth = F::Narrow::gather(|lane| self.depth[lane] as f32);
            // Guiding makes throughputs small where much light is, and paths there shouldn't end.
            let survival = survival(throughput * guided, depth);
            let is_asked = F::Narrow::splat(ROULETTE_AFTER as f32).less(depth);
            let survives = F::load(u_roulette).less(survival.widen());
            alive = alive & (survives | !is_asked);
            let gain = F::Narrow::select(is_asked, F::Narrow::splat(1.0) / survival, F::Narrow::splat(1.0));
            throughput = throughput * gain;
        }
        throughput.store(&mut scattered.throughput);
        scattered.alive = sampled.valid & alive.bits();
        scattered
    }
}
