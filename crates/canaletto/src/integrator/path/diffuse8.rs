//! Diffuse vertices of eight paths side by side.
//!
//! Most vertices of most scenes are diffuse: opaque, with nothing but kd, outside of all bodies. They take the steps of
//! [`PathTracer::arrive`] and [`PathTracer::scatter`] by the same formulas, so that colours have equal bits. Surfaces,
//! random numbers, directions and colours are computed for all eight at once. Textures are looked up and sources are
//! sampled one by one.

use super::PathTracer;
use super::direct::{ShadowRay, SourcePoint};
use super::event::power_heuristic;
use super::guiding::pdf_of_both;
use super::light_sampler::Source;
use super::light_tree::Receiver;
use super::stream::PathShadow;
use super::trace::{Path, ROULETTE_AFTER, survival, uses};
use crate::integrator::media::NONE;
use crate::integrator::visible_hit::Frame;
use crate::material::{DiffuseBsdf, Material, MaterialModel, MaterialPoint, Parameter, Target};
use crate::math::{DRay, Rgb, offset_origin};
use crate::sampler::{Dimension, Samples8};
use crate::shape::{DVec3x8, SURFACES, SurfaceInputs8, Surfaces, Vec3x8, dvec3, set_dvec3, set_vec3, vec3};
use crate::world::{Hit, World};
use canaletto_bvh::{InstructionSet, Kernel, Ray};
use glam::{DVec3, Vec3};

/// The number of vertices side by side.
const LANES: usize = SURFACES;

/// The materials of a world, each with what is known of it if it is diffuse.
#[derive(Debug, Default)]
pub(super) struct DiffuseMaterials(Vec<Option<DiffuseMaterial>>);

/// A material whose surfaces all are diffuse, opaque, whole, and dark by themselves.
#[derive(Debug)]
enum DiffuseMaterial {
    /// The colour, unless a surface has one of its own.
    Plain(Rgb),
    /// Textures set the colour or bend the normal.
    Textured,
}

impl DiffuseMaterials {
    pub(super) fn new(world: &World) -> DiffuseMaterials {
        DiffuseMaterials(world.materials().iter().map(DiffuseMaterial::new).collect())
    }
}

impl DiffuseMaterial {
    fn new(material: &Material) -> Option<DiffuseMaterial> {
        let is_harmless = |target: Target| match target {
            Target::Parameter(parameter) => parameter == Parameter::Diffuse,
            Target::Bump | Target::Normal { .. } | Target::Displace { .. } => true,
            Target::Replace | Target::Decal | Target::Cutout | Target::Metalness => false,
        };
        if material.coverage <= 0.0
            || !material.is_opaque()
            || material.may_emit()
            || !material.textures.iter().all(|used| is_harmless(used.target))
        {
            return None;
        }
        let mut point = MaterialPoint::default();
        material.set(&mut point, None);
        let kd = diffuse_color(point)?;
        Some(if material.is_plain() { DiffuseMaterial::Plain(kd) } else { DiffuseMaterial::Textured })
    }
}

/// The diffuse colour at a point, if the material there has nothing else.
fn diffuse_color(point: MaterialPoint) -> Option<Rgb> {
    let MaterialModel::Phong(mut phong) = point.model else { return None };
    phong.bound_albedo();
    phong.is_diffuse().then_some(phong.kd)
}

/// Up to eight vertices whose surfaces are known and that wait for the rest.
pub(super) struct DiffuseVertices {
    len: usize,
    /// The numbers of their paths.
    paths: [u32; LANES],
    inputs: SurfaceInputs8,
    surfaces: Surfaces,
    kd: Vec3x8,
}

/// Eight points of sources, seen from the vertices.
struct SourcePoints {
    wi: DVec3x8,
    /// The points themselves, or the directions to sources that are infinitely far.
    to: DVec3x8,
    radiance: Vec3x8,
    pdf: [f64; LANES],
    /// Whether a vertex is lit, whether its source is infinitely far, and whether rays find the source, too.
    lit: [bool; LANES],
    far: [bool; LANES],
    found: [bool; LANES],
}

/// What a guiding field tells of eight vertices. The probabilities are 0 where it doesn't guide.
struct GuidedVertices {
    /// The probabilities with which paths follow the field.
    probability: [f64; LANES],
    /// The field's densities of the directions to the sources.
    pdf_of_source: [f64; LANES],
    /// The directions in which guided paths go on, and the field's densities of them.
    wi: DVec3x8,
    pdf: [f64; LANES],
    /// [`Path::guided`] of all paths.
    guided: [f32; LANES],
}

/// What follows from the surfaces of eight vertices and from their samples.
struct Arrived {
    normal: DVec3x8,
    facing: DVec3x8,
    /// The random numbers for sources, for the choice between field and surface, and for directions.
    u_source: ([f64; LANES], [[f64; LANES]; 2]),
    u_lobe: [f64; LANES],
    u_direction: [[f64; LANES]; 2],
    u_roulette: [f64; LANES],
}

/// The rays that leave eight vertices.
struct Scattered {
    /// The light of sources before shadows.
    light: Vec3x8,
    shadow_origin: Vec3x8,
    shadow_direction: Vec3x8,
    /// A bit for each vertex that a source lights.
    lit: u32,
    wi: DVec3x8,
    pdf: [f64; LANES],
    /// [`Path::guided`] from here on.
    guided: [f32; LANES],
    throughput: Vec3x8,
    origin: Vec3x8,
    direction: Vec3x8,
    /// A bit for each path that goes on.
    alive: u32,
}

impl Default for DiffuseVertices {
    fn default() -> DiffuseVertices {
        DiffuseVertices {
            len: 0,
            paths: [0; LANES],
            inputs: SurfaceInputs8::NONE,
            surfaces: Surfaces::NOTHING,
            kd: [[0.0; LANES]; 3],
        }
    }
}

impl PathTracer<'_> {
    /// Whether a path arrives at a diffuse vertex.
    #[inline]
    pub(super) fn is_diffuse(&self, path: &Path, hit: &Hit) -> bool {
        path.is_outside()
            && (self.settings.max_depth == 0 || path.depth <= self.settings.max_depth)
            && self.diffuse.0[self.world.material_index(hit) as usize].is_some()
    }

    /// Adds the diffuse vertex of a path. Returns whether there are eight now.
    #[inline]
    pub(super) fn push_diffuse(&mut self, vertices: &mut DiffuseVertices, number: u32, path: &Path, hit: &Hit) -> bool {
        let lane = vertices.len;
        vertices.paths[lane] = number;
        vertices.inputs.set_line(lane, path.line());
        let DiffuseVertices { inputs, surfaces, .. } = vertices;
        let index = self.world.material_index(hit) as usize;
        let material = &self.world.materials()[index];
        let kd = match self.diffuse.0[index] {
            Some(DiffuseMaterial::Plain(kd)) => {
                let color = self.world.push_surface(path.line(), hit, lane, inputs, surfaces);
                color.map_or(kd, |color| {
                    let mut point = MaterialPoint::default();
                    material.set(&mut point, Some(color));
                    diffuse_color(point).unwrap_or_default()
                })
            }
            _ => {
                let mut surface = self.world.surface_without_uv(*path.line(), hit);
                let step = path.step(&surface);
                let point = self.world.textured(*path.line(), hit, &mut surface, step, &mut ());
                surfaces.set(lane, &surface);
                diffuse_color(point).unwrap_or_default()
            }
        };
        set_vec3(&mut vertices.kd, lane, kd.to_array().into());
        self.count_hit(path);
        vertices.len += 1;
        vertices.len == LANES
    }

    /// Samples a source for each vertex, and sends the paths on. `end` gets the numbers of those that end.
    pub(super) fn scatter_diffuse(
        &mut self,
        vertices: &mut DiffuseVertices,
        paths: &mut [Path],
        shadows: &mut Vec<PathShadow>,
        mut end: impl FnMut(u32),
    ) {
        if vertices.len == 0 {
            return;
        }
        let mut samples = Samples8::splat(paths[vertices.paths[0] as usize].sample);
        let mut places = [Dimension::EYE; LANES];
        let (mut throughput, mut depth, mut guided) = ([[0.0; LANES]; 3], [0; LANES], [1.0; LANES]);
        for lane in 0..vertices.len {
            let path = &mut paths[vertices.paths[lane] as usize];
            path.place = path.place.of(uses::NEXT);
            samples.set(lane, path.sample);
            (places[lane], depth[lane], guided[lane]) = (path.place, path.depth, path.guided);
            set_vec3(&mut throughput, lane, path.throughput.to_array().into());
        }
        let has_roulette = self.settings.roulette && depth.iter().any(|depth| *depth > ROULETTE_AFTER);
        let arrived = InstructionSet::run(Arrive { vertices, samples: &samples, places: &places, has_roulette });
        let mut sources = [(Source::Environment, 0.0); LANES];
        let mut points = SourcePoints {
            wi: [[0.0; LANES]; 3],
            to: [[0.0; LANES]; 3],
            radiance: [[0.0; LANES]; 3],
            pdf: [1.0; LANES],
            lit: [false; LANES],
            far: [false; LANES],
            found: [false; LANES],
        };
        for (lane, chosen) in sources.iter_mut().enumerate().take(vertices.len) {
            if vec3(&vertices.kd, lane) == Vec3::ZERO {
                continue;
            }
            self.set_time(paths[vertices.paths[lane] as usize].time);
            let (u_source, [u, v]) = &arrived.u_source;
            let Some((source, point)) =
                self.sample_point(&arrived.receiver(vertices, lane), u_source[lane], [u[lane], v[lane]])
            else {
                continue;
            };
            *chosen = (source, point.t_max);
            points.set(lane, source, &point);
        }
        let scattered = InstructionSet::run(Scatter {
            vertices,
            arrived: &arrived,
            points: &points,
            guides: &self.guide_diffuse(vertices, &arrived, &points, guided),
            throughput: &throughput,
            depth: &depth,
            has_roulette,
        });
        for (lane, (source, t_max)) in sources.into_iter().enumerate().take(vertices.len) {
            let number = vertices.paths[lane];
            let path = &mut paths[number as usize];
            let exact = dvec3(&vertices.surfaces.exact, lane);
            if scattered.lit >> lane & 1 == 1 {
                let to = dvec3(&points.to, lane);
                let is_far = points.far[lane];
                let ray = ShadowRay {
                    source,
                    ray: Ray {
                        origin: vec3(&scattered.shadow_origin, lane),
                        direction: vec3(&scattered.shadow_direction, lane),
                    },
                    t_max,
                    light: rgb(&scattered.light, lane),
                    line: DRay { origin: exact, direction: if is_far { to } else { to - exact } },
                    inside: [NONE; 2],
                };
                shadows.push(PathShadow { path: number, ray, throughput: path.throughput });
            }
            if scattered.alive >> lane & 1 == 0 {
                end(number);
                continue;
            }
            let wi = dvec3(&scattered.wi, lane);
            path.throughput = rgb(&scattered.throughput, lane);
            path.guided = scattered.guided[lane];
            path.leave_diffuse(
                Ray { origin: vec3(&scattered.origin, lane), direction: vec3(&scattered.direction, lane) },
                DRay { origin: exact, direction: wi },
                (arrived.receiver(vertices, lane), scattered.pdf[lane]),
            );
        }
        vertices.len = 0;
        vertices.inputs.clear();
    }

    /// What the guiding field tells of the vertices. `guided` is [`Path::guided`] of their paths.
    fn guide_diffuse(
        &self,
        vertices: &DiffuseVertices,
        arrived: &Arrived,
        points: &SourcePoints,
        guided: [f32; LANES],
    ) -> GuidedVertices {
        let none = [0.0; LANES];
        let mut guides = GuidedVertices { probability: none, pdf_of_source: none, wi: [none; 3], pdf: none, guided };
        let Some(field) = self.guide else { return guides };
        for lane in 0..vertices.len {
            let Receiver { point, normal, .. } = arrived.receiver(vertices, lane);
            let bsdf = arrived.bsdf(vertices, lane);
            if bsdf.kd.is_black() {
                continue;
            }
            let Some(guide) = field.at(point, Some(normal)) else { continue };
            let [u, v] = &arrived.u_direction;
            let u = [u[lane], v[lane]];
            let is_chosen = arrived.u_lobe[lane] < guide.probability;
            let wi = if is_chosen { guide.sample(u) } else { bsdf.direction(u) };
            set_dvec3(&mut guides.wi, lane, wi);
            guides.pdf[lane] = guide.pdf(wi);
            guides.pdf_of_source[lane] = guide.pdf(dvec3(&points.wi, lane));
            guides.probability[lane] = guide.probability;
        }
        guides
    }
}

#[inline(always)]
fn rgb(all: &Vec3x8, lane: usize) -> Rgb {
    Rgb::from(vec3(all, lane).to_array())
}

impl Arrived {
    /// A vertex as lights see it.
    fn receiver(&self, vertices: &DiffuseVertices, lane: usize) -> Receiver {
        Receiver { point: dvec3(&vertices.surfaces.exact, lane), normal: dvec3(&self.normal, lane), two_sided: false }
    }

    #[inline(always)]
    fn bsdf(&self, vertices: &DiffuseVertices, lane: usize) -> DiffuseBsdf {
        let (normal, facing) = (dvec3(&self.normal, lane), dvec3(&self.facing, lane));
        DiffuseBsdf { kd: rgb(&vertices.kd, lane), normal, facing }
    }
}

impl SourcePoints {
    fn set(&mut self, lane: usize, source: Source, point: &SourcePoint) {
        set_dvec3(&mut self.wi, lane, point.wi);
        set_dvec3(&mut self.to, lane, point.position.unwrap_or(point.wi));
        set_vec3(&mut self.radiance, lane, point.radiance.to_array().into());
        self.pdf[lane] = point.pdf;
        self.lit[lane] = true;
        self.far[lane] = point.position.is_none();
        self.found[lane] = source.is_found_by_rays();
    }
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
struct Arrive<'a> {
    vertices: &'a mut DiffuseVertices,
    samples: &'a Samples8,
    places: &'a [Dimension; LANES],
    /// Whether any path may end by roulette.
    has_roulette: bool,
}

impl Kernel for Arrive<'_> {
    type Answer = Arrived;

    #[inline(always)]
    fn run(self) -> Arrived {
        let Arrive { vertices, samples, places, has_roulette } = self;
        let DiffuseVertices { inputs, surfaces, .. } = vertices;
        inputs.surfaces(surfaces);
        let u_source = samples.one_and_two(&of_use(places, uses::LIGHT));
        let (u_lobe, u_direction) = samples.one_and_two(&of_use(places, uses::LOBE));
        let u_roulette = if has_roulette { samples.one(&of_use(places, uses::ROULETTE)) } else { [0.0; LANES] };
        let (mut normal, mut facing) = ([[0.0; LANES]; 3], [[0.0; LANES]; 3]);
        for i in 0..LANES {
            let frame = Frame::new(dvec3(&inputs.direction, i), &surfaces.get(i));
            set_dvec3(&mut normal, i, frame.normal);
            set_dvec3(&mut facing, i, frame.facing);
        }
        Arrived { normal, facing, u_source, u_lobe, u_direction, u_roulette }
    }
}

/// Evaluates the light of sources and the directions in which paths go on.
struct Scatter<'a> {
    vertices: &'a DiffuseVertices,
    arrived: &'a Arrived,
    points: &'a SourcePoints,
    guides: &'a GuidedVertices,
    throughput: &'a Vec3x8,
    depth: &'a [u32; LANES],
    has_roulette: bool,
}

impl Scatter<'_> {
    #[inline(always)]
    fn bsdf(&self, lane: usize) -> DiffuseBsdf {
        self.arrived.bsdf(self.vertices, lane)
    }

    /// The density of a direction by the guiding field and the surface together.
    #[inline(always)]
    fn pdf_of_both(&self, lane: usize, pdf_guide: f64, pdf_scattering: f64) -> f64 {
        pdf_of_both(self.guides.probability[lane], pdf_guide, pdf_scattering)
    }

    /// The origin of a ray that leaves in a direction.
    #[inline(always)]
    fn origin(&self, lane: usize, direction: DVec3) -> Vec3 {
        let Surfaces { point, error, normal, .. } = &self.vertices.surfaces;
        offset_origin(vec3(point, lane), vec3(error, lane), dvec3(normal, lane), direction)
    }
}

impl Kernel for Scatter<'_> {
    type Answer = Scattered;

    #[inline(always)]
    fn run(self) -> Scattered {
        let (points, guides, arrived) = (self.points, self.guides, self.arrived);
        // Each loop writes to arrays of its own, of one type each. The compiler vectorises no other loops.
        let (mut f, mut light) = ([[0.0; LANES]; 3], [[0.0; LANES]; 3]);
        for i in 0..LANES {
            let (bsdf, wi) = (self.bsdf(i), dvec3(&points.wi, i));
            let reflected = bsdf.eval(wi);
            let scattering = self.pdf_of_both(i, guides.pdf_of_source[i], bsdf.pdf(wi));
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
        let [u, v] = &arrived.u_direction;
        let (mut wi, mut pdf, mut throughput) = ([[0.0; LANES]; 3], [0.0; LANES], [[0.0; LANES]; 3]);
        for i in 0..LANES {
            let bsdf = self.bsdf(i);
            let own = bsdf.direction([u[i], v[i]]);
            let direction = if guides.probability[i] > 0.0 { dvec3(&guides.wi, i) } else { own };
            pdf[i] = self.pdf_of_both(i, guides.pdf[i], bsdf.pdf(direction));
            let next = (rgb(self.throughput, i) * bsdf.eval(direction) * (1.0 / pdf[i]) as f32).saturated();
            set_dvec3(&mut wi, i, direction);
            set_vec3(&mut throughput, i, next.to_array().into());
        }
        let (mut origin, mut direction) = ([[0.0; LANES]; 3], [[0.0; LANES]; 3]);
        for i in 0..LANES {
            let wi = dvec3(&wi, i);
            set_vec3(&mut origin, i, self.origin(i, wi));
            set_vec3(&mut direction, i, wi.as_vec3());
        }
        let mut guided = guides.guided;
        for i in 0..LANES {
            let ratio = (pdf[i] / self.bsdf(i).pdf(dvec3(&wi, i))) as f32;
            guided[i] *= if guides.probability[i] > 0.0 { ratio } else { 1.0 };
        }
        let (mut lit, mut alive) = (0, 0);
        for i in 0..LANES {
            let (f, throughput) = (rgb(&f, i), rgb(&throughput, i));
            lit |= u32::from(points.lit[i] && !f.is_black() && f.is_finite()) << i;
            alive |= u32::from(!throughput.is_black() && throughput.is_finite()) << i;
        }
        if self.has_roulette {
            for (i, guided) in guided.into_iter().enumerate() {
                let before = rgb(&throughput, i);
                // Guiding makes throughputs small where much light is, and paths there shouldn't end.
                let survival = survival(before * guided);
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
