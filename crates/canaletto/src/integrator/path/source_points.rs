//! Points of the sources that light eight vertices, sampled side by side.
//!
//! Each vertex chooses a source by itself. Points of flat emitters and spheres that are far enough, and of the
//! environment, are then sampled in lanes; the others one by one. Both are the same formulas.

use super::PathTracer;
use super::direct::SourcePoint;
use super::emitter::{Emitter, LaneEmitters};
use super::light_sampler::{KnownChoice, Source};
use super::light_tree::Receiver;
use crate::light::environment::{BlockWeights, EnvironmentDistribution, PreparedEnvironment};
use crate::math::Vector;
use crate::shape::{DVec3x8, Vec3x8, set_bits, set_dvec3, set_vec3};
use canaletto_bvh::lanes::{LANES, LaneKernel, Mask, Real64, run_lanes};

/// Eight points of sources, seen from the vertices.
pub(super) struct SourcePoints {
    pub(super) wi: DVec3x8,
    /// The points themselves, or the directions to sources that are infinitely far.
    pub(super) to: DVec3x8,
    pub(super) radiance: Vec3x8,
    pub(super) pdf: [f64; LANES],
    /// A bit for each vertex that is lit, whose source is infinitely far, and whose source rays find, too.
    pub(super) lit: u32,
    pub(super) far: u32,
    pub(super) found: u32,
    /// A bit for each vertex whose source is one of the chapter's points.
    pub(super) point_lights: u32,
    /// The sources, and the ends of the shadow rays.
    pub(super) sources: [Source; LANES],
    pub(super) t_max: [f32; LANES],
    /// What the vertices know of the choice of a source.
    pub(super) choices: [KnownChoice; LANES],
}

/// What sources are sampled for.
pub(super) struct SourceInputs<'a> {
    pub(super) receivers: &'a [Receiver; LANES],
    pub(super) u_source: &'a [f64; LANES],
    pub(super) u: &'a [[f64; LANES]; 2],
    /// The times of the vertices.
    pub(super) times: &'a [f32; LANES],
}

impl SourcePoints {
    const NONE: SourcePoints = SourcePoints {
        wi: [[0.0; LANES]; 3],
        to: [[0.0; LANES]; 3],
        radiance: [[0.0; LANES]; 3],
        pdf: [1.0; LANES],
        lit: 0,
        far: 0,
        found: 0,
        point_lights: 0,
        sources: [Source::Environment; LANES],
        t_max: [0.0; LANES],
        choices: [KnownChoice::NONE; LANES],
    };

    fn set(&mut self, lane: usize, source: Source, point: &SourcePoint) {
        set_dvec3(&mut self.wi, lane, point.wi);
        set_dvec3(&mut self.to, lane, point.position.unwrap_or(point.wi));
        set_vec3(&mut self.radiance, lane, point.radiance.to_array().into());
        self.pdf[lane] = point.pdf;
        self.lit |= 1 << lane;
        self.far |= u32::from(point.position.is_none()) << lane;
        self.found |= u32::from(source.is_found_by_rays()) << lane;
        self.point_lights |= u32::from(point.is_point_light) << lane;
        (self.sources[lane], self.t_max[lane]) = (source, point.t_max);
    }
}

impl PathTracer<'_> {
    /// Samples a source for each vertex whose bit is set.
    pub(super) fn sample_points(&mut self, vertices: u32, inputs: &SourceInputs) -> SourcePoints {
        let mut points = SourcePoints::NONE;
        let mut chosen = [1.0; LANES];
        // The emitters that are sampled in lanes, and a bit for each lane that samples the environment.
        let mut emitters: [Option<&Emitter>; LANES] = [None; LANES];
        let (mut any_emitter, mut to_environment) = (None, 0);
        let same = self.lights.same_everywhere();
        for lane in set_bits(vertices) {
            let receiver = &inputs.receivers[lane];
            self.set_time(inputs.times[lane]);
            let (source, probability) = match same {
                Some((source, known)) => {
                    points.choices[lane] = known;
                    (source, 1.0)
                }
                None => {
                    let choice = self.choice(lane, receiver);
                    points.choices[lane] = choice.known();
                    let sampled = self.lights.sample(self.world, receiver, &choice, inputs.u_source[lane]);
                    let Some(sampled) = sampled else { continue };
                    sampled
                }
            };
            (points.sources[lane], chosen[lane]) = (source, probability);
            match source {
                Source::Emitter(number) => {
                    let emitter = &self.lights.emitters.all[number as usize];
                    if emitter.has_lanes(receiver.point) {
                        (emitters[lane], any_emitter) = (Some(emitter), Some(emitter));
                        continue;
                    }
                }
                Source::Environment => {
                    to_environment |= 1 << lane;
                    continue;
                }
                Source::Light(_) => {}
            }
            let u = inputs.u.each_ref().map(|u| u[lane]);
            if let Some(point) = self.source_point(receiver, (source, probability), u) {
                points.set(lane, source, &point);
            }
        }
        if let Some(any) = any_emitter {
            run_lanes(SampleEmitters { emitters: &emitters, any, inputs, chosen: &chosen, points: &mut points });
        }
        if let Some(distribution) = self.lights.environment.as_ref().filter(|_| to_environment != 0)
            && let Some(environment) = &self.world.environment
        {
            let blocks = &self.blocks;
            run_lanes(SampleEnvironment {
                environment,
                distribution,
                blocks,
                inputs,
                chosen: &chosen,
                vertices: to_environment,
                points: &mut points,
            });
        }
        points
    }
}

/// Samples points of emitters.
struct SampleEmitters<'a> {
    emitters: &'a [Option<&'a Emitter>; LANES],
    /// The emitter of lanes without one.
    any: &'a Emitter,
    inputs: &'a SourceInputs<'a>,
    chosen: &'a [f64; LANES],
    points: &'a mut SourcePoints,
}

impl LaneKernel for SampleEmitters<'_> {
    type Answer = ();

    #[inline(always)]
    fn run<F: Real64>(self) {
        let SampleEmitters { emitters: chosen_emitters, any, inputs, chosen, points } = self;
        let p = Vector::<F>::gather(|lane| inputs.receivers[lane].point);
        let [u, v] = inputs.u;
        let active = (0..LANES).map(|lane| u32::from(chosen_emitters[lane].is_some()) << lane).sum::<u32>();
        let is_one = chosen_emitters.iter().flatten().all(|emitter| std::ptr::eq(*emitter, any));
        let emitters = match is_one {
            true => LaneEmitters::gather(|_| any),
            false => LaneEmitters::gather(|lane| chosen_emitters[lane].unwrap_or(any)),
        };
        let sample = emitters.sample(p, [F::load(u), F::load(v)]);
        let pdf = sample.pdf * F::load(chosen);
        let found = Found { wi: sample.wi, to: sample.point, radiance: sample.radiance, pdf };
        let lit = points.put(sample.lit & F::Mask::from_bits(active), found);
        for lane in set_bits(lit) {
            points.t_max[lane] = chosen_emitters[lane].map_or(0.0, Emitter::shadow_end);
        }
    }
}

/// Samples directions to the environment.
struct SampleEnvironment<'a> {
    environment: &'a PreparedEnvironment,
    distribution: &'a EnvironmentDistribution,
    /// The weights of the environment's blocks at the vertices.
    blocks: &'a [BlockWeights; LANES],
    inputs: &'a SourceInputs<'a>,
    chosen: &'a [f64; LANES],
    /// A bit for each vertex that chose the environment.
    vertices: u32,
    points: &'a mut SourcePoints,
}

impl LaneKernel for SampleEnvironment<'_> {
    type Answer = ();

    #[inline(always)]
    fn run<F: Real64>(self) {
        let SampleEnvironment { environment, distribution, blocks, inputs, chosen, vertices, points } = self;
        let [u, v] = inputs.u;
        let sample = distribution.samples(|lane| &blocks[lane], [F::load(u), F::load(v)]);
        let radiance = environment.radiances_of_samples(sample.wi, sample.place);
        let pdf = sample.pdf * F::load(chosen);
        let lit = F::Mask::from_bits(vertices) & !radiance.is_zero();
        let lit = points.put(lit, Found { wi: sample.wi, to: sample.wi, radiance, pdf });
        points.far |= lit;
        for lane in set_bits(lit) {
            points.t_max[lane] = f32::INFINITY;
        }
    }
}

/// Points of sources in lanes.
struct Found<F: Real64> {
    wi: Vector<F>,
    to: Vector<F>,
    radiance: Vector<F::Narrow>,
    pdf: F,
}

impl SourcePoints {
    /// Sets the points of the lanes of a mask, whose sources rays find, too. Returns the bits of the mask.
    #[inline(always)]
    fn put<F: Real64>(&mut self, lit: F::Mask, found: Found<F>) -> u32 {
        let Found { wi, to, radiance, pdf } = found;
        Vector::select(lit, wi, Vector::load(&self.wi)).store(&mut self.wi);
        Vector::select(lit, to, Vector::load(&self.to)).store(&mut self.to);
        Vector::select(lit, radiance, Vector::load(&self.radiance)).store(&mut self.radiance);
        F::select(lit, pdf, F::load(&self.pdf)).store(&mut self.pdf);
        let bits = lit.bits();
        self.lit |= bits;
        self.found |= bits;
        bits
    }
}
