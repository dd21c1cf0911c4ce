//! Vertices of eight paths side by side, sorted by their kind of material.
//!
//! All surfaces where paths are scattered wait in a queue until there are eight. They take the steps of
//! [`PathTracer::scatter`] by the same formulas, so that colours have equal bits. Random numbers, points of sources,
//! weights and rays are computed for all eight at once.
//!
//! Many vertices are opaque, outside of all bodies, and dark by themselves. Four kinds of them have queues of their
//! own: diffuse ones, highlights of Phong's model, rough metals, and standard surfaces without layers over their base.
//! They don't go through [`PathTracer::arrive`]. Their surfaces and their scattering are computed for all eight at
//! once, too. So is the scattering of rough boundaries of clear bodies. That of others is evaluated one by one.

mod any_surface;
mod boundaries;
mod kernels;
mod scattering;

use super::PathTracer;
use super::direct::ShadowRay;
use super::source_points::SourceInputs;
use super::stream::{PathShadow, Wave};
use super::trace::{Path, ROULETTE_AFTER, uses};
use super::vertex::SurfaceVertex;
use crate::integrator::media::NONE;
use crate::material::{
    BsdfSample, ConductorPoint, GlossyPoint, MaterialModel, MaterialPoint, OpaqueBase, Parameter, PreparedMaterial,
    Target,
};
use crate::math::{DRay, Rgb};
use crate::sampler::{Dimension, Samples8};
use crate::shape::{SURFACES, SurfaceInputs8, Surfaces, Vec3x8, dvec3, set_vec3, vec3};
use crate::world::{Hit, World};
use any_surface::AnySurfaces;
use boundaries::Boundaries;
use canaletto_bvh::lanes::run_lanes;
use canaletto_bvh::{InstructionSet, Ray};
use kernels::{Arrive, Scatter};
use scattering::{Diffuse, Glossy, Materials8, Metals, OpaqueBases, Scattering8};

/// The number of vertices side by side.
const LANES: usize = SURFACES;

#[inline(always)]
fn rgb(all: &Vec3x8, lane: usize) -> Rgb {
    Rgb::from(vec3(all, lane).to_array())
}

/// The materials of a world, each with what is known of it if its vertices are shaded together.
#[derive(Debug, Default)]
pub(super) struct OpaqueMaterials(Vec<Option<OpaqueMaterial>>);

/// A material whose surfaces all are of one kind, opaque, whole, and dark by themselves.
#[derive(Debug)]
struct OpaqueMaterial {
    kind: OpaqueKind,
    /// Whether textures set the colour or bend the normal.
    is_textured: bool,
}

#[derive(Debug)]
enum OpaqueKind {
    /// The colour, unless a texture or a surface sets it.
    Diffuse(Rgb),
    /// Phong's model with a highlight and without a mirror, unless a texture or a surface sets the colour.
    Glossy(GlossyPoint),
    /// A rough metal.
    Metal(ConductorPoint),
    /// A standard surface that is an opaque base alone, with its numbers, unless a texture or a surface sets any.
    Base(OpaqueBase),
}

impl OpaqueMaterials {
    pub(super) fn new(world: &World) -> OpaqueMaterials {
        OpaqueMaterials(world.materials().iter().map(OpaqueMaterial::new).collect())
    }
}

impl OpaqueMaterial {
    fn new(material: &PreparedMaterial) -> Option<OpaqueMaterial> {
        let is_harmless = |target: Target| match (&material.model, target) {
            (MaterialModel::Standard(_), _) => OpaqueBase::keeps(target),
            (_, Target::Parameter(parameter)) => parameter == Parameter::Diffuse,
            (_, Target::Bump | Target::Normal { .. } | Target::Displace { .. }) => true,
            _ => false,
        };
        if material.coverage <= 0.0
            || !material.is_opaque()
            || material.may_emit()
            || !material.textures.iter().all(|used| is_harmless(used.target))
        {
            return None;
        }
        let kind = match &material.model {
            MaterialModel::Phong(_) => match diffuse_color(material.plain()) {
                Some(kd) => OpaqueKind::Diffuse(kd),
                None => OpaqueKind::Glossy(GlossyPoint::new(&material.plain().classic)?),
            },
            MaterialModel::Conductor(conductor) => {
                let point = ConductorPoint::new(conductor, material.plain());
                if point.alpha == 0.0 {
                    return None;
                }
                OpaqueKind::Metal(point)
            }
            MaterialModel::Standard(surface) if OpaqueBase::is_all_of(surface) => {
                let base = OpaqueBase::new(surface, material.plain().classic.roughness);
                if base.alpha == 0.0 && material.is_plain() {
                    return None;
                }
                OpaqueKind::Base(base)
            }
            _ => return None,
        };
        Some(OpaqueMaterial { kind, is_textured: !material.is_plain() })
    }
}

/// The diffuse colour at a point of Phong's model, if there is nothing else.
fn diffuse_color(point: &MaterialPoint) -> Option<Rgb> {
    let phong = point.classic.bounded();
    phong.is_diffuse().then_some(phong.kd)
}

/// Vertices that wait until eight of one kind are shaded together.
#[derive(Default)]
pub(super) struct VertexQueues {
    diffuse: Queue<Diffuse>,
    glossy: Queue<Glossy>,
    metals: Queue<Metals>,
    bases: Queue<OpaqueBases>,
    boundaries: Queue<Boundaries>,
    /// All others.
    others: Queue<AnySurfaces>,
    /// The material at the hit that was added last, if it isn't the same everywhere.
    point: MaterialPoint,
}

/// Vertices that [`PathTracer::arrive`] comes to.
trait SurfaceVertices: Materials8 {
    fn push(&mut self, vertex: SurfaceVertex);
}

/// Up to eight vertices whose surfaces are known and that wait for the rest.
struct Queue<M> {
    len: usize,
    /// The numbers of their paths.
    paths: [u32; LANES],
    inputs: SurfaceInputs8,
    surfaces: Surfaces,
    materials: M,
}

impl<M: Default> Default for Queue<M> {
    fn default() -> Queue<M> {
        Queue {
            len: 0,
            paths: [0; LANES],
            inputs: SurfaceInputs8::NONE,
            surfaces: Surfaces::NOTHING,
            materials: M::default(),
        }
    }
}

impl<M> Queue<M> {
    /// Adds the surface of a path's hit. Returns its material's values there, which `point` holds then, if they aren't
    /// the same everywhere.
    #[inline]
    fn push<'a>(
        &mut self,
        world: &World,
        (number, path): (u32, &mut Path),
        hit: &Hit,
        is_textured: bool,
        point: &'a mut MaterialPoint,
    ) -> Option<&'a MaterialPoint> {
        let lane = self.len;
        self.len += 1;
        self.paths[lane] = number;
        path.place = path.place.of(uses::NEXT);
        self.inputs.set_line(lane, path.line());
        if is_textured {
            let surface = world.textured_physics(*path.line(), hit, |surface| path.step(surface), point);
            self.surfaces.set(lane, &surface);
            return Some(point);
        }
        let color = world.push_surface(path.line(), hit, lane, &mut self.inputs, &mut self.surfaces)?;
        *point = world.material(hit).colored(Some(color));
        Some(point)
    }
}

impl PathTracer<'_> {
    /// Adds a path's hit to those that are shaded eight at a time without [`PathTracer::arrive`], if it is one of them.
    /// Shades its kind if there are eight now; `next` then gets the paths that go on.
    #[inline]
    pub(super) fn push_opaque(
        &mut self,
        queues: &mut VertexQueues,
        (number, hit): (u32, &Hit),
        paths: &mut [Path],
        shadows: &mut Vec<PathShadow>,
        next: &mut Wave,
    ) -> bool {
        let path = &mut paths[number as usize];
        if !path.is_outside() || self.settings.max_depth != 0 && path.depth > self.settings.max_depth {
            return false;
        }
        let Some(material) = &self.opaque.0[self.world.material_index(hit) as usize] else { return false };
        match &material.kind {
            OpaqueKind::Diffuse(kd) => {
                let lane = queues.diffuse.len;
                let point =
                    queues.diffuse.push(self.world, (number, path), hit, material.is_textured, &mut queues.point);
                let kd = point.map_or(*kd, |point| diffuse_color(point).unwrap_or_default());
                set_vec3(&mut queues.diffuse.materials.kd, lane, kd.to_array().into());
                self.count_hit(path);
                if lane + 1 == LANES {
                    self.scatter_eight(&mut queues.diffuse, paths, shadows, next);
                }
            }
            OpaqueKind::Glossy(glossy) => {
                let lane = queues.glossy.len;
                let point =
                    queues.glossy.push(self.world, (number, path), hit, material.is_textured, &mut queues.point);
                let textured = point.and_then(|point| GlossyPoint::new(&point.classic));
                queues.glossy.materials.points[lane] = textured.unwrap_or(*glossy);
                self.count_hit(path);
                if lane + 1 == LANES {
                    self.scatter_eight(&mut queues.glossy, paths, shadows, next);
                }
            }
            OpaqueKind::Metal(metal) => {
                let lane = queues.metals.len;
                queues.metals.push(self.world, (number, path), hit, material.is_textured, &mut queues.point);
                queues.metals.materials.points[lane] = *metal;
                self.count_hit(path);
                if lane + 1 == LANES {
                    self.scatter_eight(&mut queues.metals, paths, shadows, next);
                }
            }
            OpaqueKind::Base(base) => {
                let (lane, place) = (queues.bases.len, path.place);
                let point = queues.bases.push(self.world, (number, path), hit, material.is_textured, &mut queues.point);
                let textured = point.and_then(|point| Some((point.standard.as_ref()?, point)));
                let base = textured.map_or(*base, |(surface, point)| OpaqueBase::new(surface, point.classic.roughness));
                if base.alpha == 0.0 {
                    // A polished point of a textured surface isn't evaluated in lanes.
                    (queues.bases.len, path.place) = (lane, place);
                    return false;
                }
                queues.bases.materials.points[lane] = base;
                self.count_hit(path);
                if lane + 1 == LANES {
                    self.scatter_eight(&mut queues.bases, paths, shadows, next);
                }
            }
        }
        true
    }

    /// Adds a vertex that [`PathTracer::arrive`] came to. Shades its kind if there are eight now; `next` then gets the
    /// paths that go on.
    pub(super) fn push_vertex(
        &mut self,
        queues: &mut VertexQueues,
        (number, vertex): (u32, SurfaceVertex),
        paths: &mut [Path],
        shadows: &mut Vec<PathShadow>,
        next: &mut Wave,
    ) {
        match vertex.bsdf.rough_boundary() {
            Some(_) => self.push_into(&mut queues.boundaries, (number, vertex), paths, shadows, next),
            None => self.push_into(&mut queues.others, (number, vertex), paths, shadows, next),
        }
    }

    fn push_into<M: SurfaceVertices>(
        &mut self,
        queue: &mut Queue<M>,
        (number, vertex): (u32, SurfaceVertex),
        paths: &mut [Path],
        shadows: &mut Vec<PathShadow>,
        next: &mut Wave,
    ) {
        let lane = queue.len;
        queue.len += 1;
        queue.paths[lane] = number;
        queue.surfaces.set_frame(
            lane,
            &vertex.frame.exact,
            &vertex.frame.outer,
            vertex.frame.point,
            vertex.frame.error,
        );
        queue.materials.push(vertex);
        if lane + 1 == LANES {
            self.scatter_eight(queue, paths, shadows, next);
        }
    }

    /// Shades the vertices that wait.
    pub(super) fn scatter_waiting(
        &mut self,
        queues: &mut VertexQueues,
        paths: &mut [Path],
        shadows: &mut Vec<PathShadow>,
        next: &mut Wave,
    ) {
        self.scatter_eight(&mut queues.diffuse, paths, shadows, next);
        self.scatter_eight(&mut queues.glossy, paths, shadows, next);
        self.scatter_eight(&mut queues.metals, paths, shadows, next);
        self.scatter_eight(&mut queues.bases, paths, shadows, next);
        self.scatter_eight(&mut queues.boundaries, paths, shadows, next);
        self.scatter_eight(&mut queues.others, paths, shadows, next);
    }

    /// Samples a source for each vertex, and sends the paths on. `next` gets those that go on.
    fn scatter_eight<M: Materials8>(
        &mut self,
        queue: &mut Queue<M>,
        paths: &mut [Path],
        shadows: &mut Vec<PathShadow>,
        next: &mut Wave,
    ) {
        let Queue { len, paths: numbers, inputs, surfaces, materials } = queue;
        if *len == 0 {
            return;
        }
        let numbers = &numbers[..std::mem::take(len)];
        let mut samples = Samples8::splat(paths[numbers[0] as usize].sample);
        let mut places = [Dimension::EYE; LANES];
        let (mut throughput, mut depth, mut guided) = ([[0.0; LANES]; 3], [0; LANES], [1.0; LANES]);
        let mut times = [0.0; LANES];
        for (lane, number) in numbers.iter().enumerate() {
            let path = &paths[*number as usize];
            samples.set(lane, path.sample);
            (places[lane], depth[lane], guided[lane]) = (path.place, path.depth, path.guided);
            times[lane] = path.time;
            set_vec3(&mut throughput, lane, path.throughput.to_array().into());
        }
        let has_roulette = self.settings.roulette && depth.iter().any(|depth| *depth > ROULETTE_AFTER);
        let arrived = InstructionSet::run(Arrive {
            inputs,
            surfaces,
            samples: &samples,
            places: &places,
            has_roulette,
            chooses_source: self.lights.same_everywhere().is_none(),
            chooses_lobe: M::HAS_LOBES || self.guide.is_some(),
        });
        let vertices = materials.vertices(&arrived, self.guide, numbers.len());
        let receivers = std::array::from_fn(|lane| vertices.receiver(lane));
        let (u_source, u) = &arrived.u_source;
        let lit = vertices.lit();
        let points = self.sample_points(lit, &SourceInputs { receivers: &receivers, u_source, u, times: &times });
        let (towards_sources, sampled) = vertices.scatter(&points);
        let scattered = run_lanes(Scatter {
            surfaces,
            points: &points,
            towards_sources: &towards_sources,
            sampled: &sampled,
            throughput: &throughput,
            depth: &depth,
            guided: &guided,
            u_roulette: has_roulette.then_some(&arrived.u_roulette),
        });
        let asks_inside = self.sees_through || self.world.has_clear();
        for (lane, number) in numbers.iter().enumerate() {
            let path = &mut paths[*number as usize];
            self.set_time(times[lane]);
            let exact = dvec3(&surfaces.exact, lane);
            if scattered.lit >> lane & 1 == 1 {
                let to = dvec3(&points.to, lane);
                let to = if points.far >> lane & 1 == 1 { to } else { to - exact };
                let inside = if asks_inside { vertices.inside_after(self, lane, to) } else { Some([NONE; 2]) };
                if let Some(inside) = inside {
                    let ray = ShadowRay {
                        source: points.sources[lane],
                        ray: Ray {
                            origin: vec3(&scattered.shadow_origin, lane),
                            direction: vec3(&scattered.shadow_direction, lane),
                        },
                        t_max: points.t_max[lane],
                        light: rgb(&scattered.light, lane),
                        line: DRay { origin: exact, direction: to },
                        inside,
                    };
                    shadows.push(PathShadow { path: *number, ray, throughput: path.throughput });
                }
            }
            let wi = dvec3(&sampled.wi, lane);
            let is_alive = scattered.alive >> lane & 1 == 1;
            let inside = if is_alive { vertices.inside_after(self, lane, wi) } else { None };
            let Some(inside) = inside else { continue };
            path.throughput = rgb(&scattered.throughput, lane);
            path.guided = scattered.guided[lane];
            let sample = BsdfSample {
                wi,
                f: rgb(&sampled.f, lane),
                pdf: sampled.pdf[lane],
                lobe: sampled.lobes[lane],
                is_delta: sampled.delta >> lane & 1 == 1,
            };
            let ray = Ray { origin: vec3(&scattered.origin, lane), direction: vec3(&scattered.direction, lane) };
            next.push(*number, ray);
            path.leave(
                ray,
                DRay { origin: exact, direction: wi },
                inside,
                (&sample, vertices.goes_through(lane, &sample)),
                (lit >> lane & 1 == 1).then_some((receivers[lane], points.choices[lane])),
            );
        }
        drop(vertices);
        inputs.clear();
        materials.clear();
    }
}
