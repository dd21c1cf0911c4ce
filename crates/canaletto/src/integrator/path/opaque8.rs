//! Opaque vertices of eight paths side by side, sorted by their kind of material.
//!
//! Most vertices of most scenes are opaque, outside of all bodies, and dark by themselves. Those that are diffuse, and
//! those of rough metals, take the steps of [`PathTracer::arrive`] and [`PathTracer::scatter`] by the same formulas, so
//! that colours have equal bits. Surfaces, random numbers, directions and colours are computed for all eight at once.
//! Textures are looked up and sources are sampled one by one.

mod kernels;
mod scattering;

use super::PathTracer;
use super::direct::ShadowRay;
use super::light_sampler::{KnownChoice, Source};
use super::stream::PathShadow;
use super::trace::{Path, ROULETTE_AFTER, ScatteredFrom, uses};
use crate::integrator::media::NONE;
use crate::material::{ConductorPoint, Lobe, MaterialModel, MaterialPoint, Parameter, PreparedMaterial, Target};
use crate::math::{DRay, Rgb};
use crate::sampler::{Dimension, Samples8};
use crate::shape::{DVec3x8, SURFACES, SurfaceInputs8, Surfaces, Vec3x8, dvec3, set_dvec3, set_vec3, vec3};
use crate::world::{Hit, World};
use canaletto_bvh::{InstructionSet, Ray};
use kernels::{Arrive, Arrived, GuidedVertices, Scatter, SourcePoints};
use scattering::{Diffuse, Materials8, Metals, Scattering8};

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
    /// A rough metal.
    Metal(ConductorPoint),
}

impl OpaqueMaterials {
    pub(super) fn new(world: &World) -> OpaqueMaterials {
        OpaqueMaterials(world.materials().iter().map(OpaqueMaterial::new).collect())
    }
}

impl OpaqueMaterial {
    fn new(material: &PreparedMaterial) -> Option<OpaqueMaterial> {
        let is_harmless = |target: Target| match target {
            Target::Parameter(parameter) => parameter == Parameter::Diffuse,
            Target::Bump | Target::Normal { .. } | Target::Displace { .. } => true,
            Target::Replace
            | Target::Decal
            | Target::Cutout
            | Target::Standard(_)
            | Target::CoatNormal { .. }
            | Target::AnisotropyDirection => false,
        };
        if material.coverage <= 0.0
            || !material.is_opaque()
            || material.may_emit()
            || !material.textures.iter().all(|used| is_harmless(used.target))
        {
            return None;
        }
        let kind = match &material.model {
            MaterialModel::Phong(_) => OpaqueKind::Diffuse(diffuse_color(material.plain())?),
            MaterialModel::Conductor(conductor) => {
                let point = ConductorPoint::new(conductor, material.plain());
                if point.alpha == 0.0 {
                    return None;
                }
                OpaqueKind::Metal(point)
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

/// Opaque vertices that wait until eight of one kind are shaded together.
#[derive(Default)]
pub(super) struct OpaqueVertices {
    diffuse: Vertices<Diffuse>,
    metals: Vertices<Metals>,
}

/// Up to eight vertices whose surfaces are known and that wait for the rest.
struct Vertices<M> {
    len: usize,
    /// The numbers of their paths.
    paths: [u32; LANES],
    inputs: SurfaceInputs8,
    surfaces: Surfaces,
    materials: M,
}

impl<M: Default> Default for Vertices<M> {
    fn default() -> Vertices<M> {
        Vertices {
            len: 0,
            paths: [0; LANES],
            inputs: SurfaceInputs8::NONE,
            surfaces: Surfaces::NOTHING,
            materials: M::default(),
        }
    }
}

impl<M> Vertices<M> {
    /// Adds the surface of a path's hit. Returns its material's values there, if they aren't the same everywhere.
    #[inline]
    fn push(
        &mut self,
        world: &World,
        (number, path): (u32, &Path),
        hit: &Hit,
        is_textured: bool,
    ) -> Option<MaterialPoint> {
        let lane = self.len;
        self.len += 1;
        self.paths[lane] = number;
        self.inputs.set_line(lane, path.line());
        if is_textured {
            let mut surface = world.surface_without_uv(*path.line(), hit);
            let step = path.step(&surface);
            let point = world.textured(*path.line(), hit, &mut surface, step, &mut ());
            self.surfaces.set(lane, &surface);
            return Some(point);
        }
        let color = world.push_surface(path.line(), hit, lane, &mut self.inputs, &mut self.surfaces)?;
        Some(world.material(hit).colored(Some(color)))
    }
}

impl PathTracer<'_> {
    /// Adds a path's vertex to those that are shaded eight at a time, if it is one of them. Shades its kind if there
    /// are eight now; `end` then gets the numbers of the paths that end.
    #[inline]
    pub(super) fn push_opaque(
        &mut self,
        vertices: &mut OpaqueVertices,
        (number, hit): (u32, &Hit),
        paths: &mut [Path],
        shadows: &mut Vec<PathShadow>,
        end: impl FnMut(u32),
    ) -> bool {
        let path = &paths[number as usize];
        if !path.is_outside() || self.settings.max_depth != 0 && path.depth > self.settings.max_depth {
            return false;
        }
        let Some(material) = &self.opaque.0[self.world.material_index(hit) as usize] else { return false };
        self.count_hit(path);
        match &material.kind {
            OpaqueKind::Diffuse(kd) => {
                let lane = vertices.diffuse.len;
                let point = vertices.diffuse.push(self.world, (number, path), hit, material.is_textured);
                let kd = point.map_or(*kd, |point| diffuse_color(&point).unwrap_or_default());
                set_vec3(&mut vertices.diffuse.materials.kd, lane, kd.to_array().into());
                if lane + 1 == LANES {
                    self.scatter_eight(&mut vertices.diffuse, paths, shadows, end);
                }
            }
            OpaqueKind::Metal(metal) => {
                let lane = vertices.metals.len;
                vertices.metals.push(self.world, (number, path), hit, material.is_textured);
                vertices.metals.materials.points[lane] = *metal;
                if lane + 1 == LANES {
                    self.scatter_eight(&mut vertices.metals, paths, shadows, end);
                }
            }
        }
        true
    }

    /// Shades the vertices that wait.
    pub(super) fn scatter_opaque(
        &mut self,
        vertices: &mut OpaqueVertices,
        paths: &mut [Path],
        shadows: &mut Vec<PathShadow>,
        mut end: impl FnMut(u32),
    ) {
        self.scatter_eight(&mut vertices.diffuse, paths, shadows, &mut end);
        self.scatter_eight(&mut vertices.metals, paths, shadows, &mut end);
    }

    /// Samples a source for each vertex, and sends the paths on. `end` gets the numbers of those that end.
    fn scatter_eight<M: Materials8>(
        &mut self,
        vertices: &mut Vertices<M>,
        paths: &mut [Path],
        shadows: &mut Vec<PathShadow>,
        mut end: impl FnMut(u32),
    ) {
        let Vertices { len, paths: numbers, inputs, surfaces, materials } = vertices;
        if *len == 0 {
            return;
        }
        let numbers = &numbers[..std::mem::take(len)];
        let mut samples = Samples8::splat(paths[numbers[0] as usize].sample);
        let mut places = [Dimension::EYE; LANES];
        let (mut throughput, mut depth, mut guided) = ([[0.0; LANES]; 3], [0; LANES], [1.0; LANES]);
        for (lane, number) in numbers.iter().enumerate() {
            let path = &mut paths[*number as usize];
            path.place = path.place.of(uses::NEXT);
            samples.set(lane, path.sample);
            (places[lane], depth[lane], guided[lane]) = (path.place, path.depth, path.guided);
            set_vec3(&mut throughput, lane, path.throughput.to_array().into());
        }
        let has_roulette = self.settings.roulette && depth.iter().any(|depth| *depth > ROULETTE_AFTER);
        let arrived =
            InstructionSet::run(Arrive { inputs, surfaces, samples: &samples, places: &places, has_roulette });
        let bsdfs = materials.bsdfs(&arrived);
        let mut sources = [(Source::Environment, 0.0); LANES];
        let mut choices = [KnownChoice::default(); LANES];
        let mut points = SourcePoints::NONE;
        for (lane, number) in numbers.iter().enumerate() {
            if bsdfs.is_black(lane) {
                continue;
            }
            self.set_time(paths[*number as usize].time);
            let (u_source, [u, v]) = &arrived.u_source;
            let receiver = arrived.receiver(lane);
            let choice = self.choice(&receiver);
            choices[lane] = choice.known();
            let sampled = self.sample_point((&receiver, &choice), u_source[lane], [u[lane], v[lane]]);
            let Some((source, point)) = sampled else { continue };
            sources[lane] = (source, point.t_max);
            points.set(lane, source, &point);
        }
        let guides = self.guide_eight(&arrived, &bsdfs, &points, &guided, numbers.len());
        let scattered = InstructionSet::run(Scatter {
            surfaces,
            arrived: &arrived,
            bsdfs: &bsdfs,
            points: &points,
            guides: &guides,
            throughput: &throughput,
            depth: &depth,
            has_roulette,
        });
        for (lane, (number, (source, t_max))) in numbers.iter().zip(sources).enumerate() {
            let path = &mut paths[*number as usize];
            let exact = dvec3(&surfaces.exact, lane);
            if scattered.lit >> lane & 1 == 1 {
                let to = dvec3(&points.to, lane);
                let ray = ShadowRay {
                    source,
                    ray: Ray {
                        origin: vec3(&scattered.shadow_origin, lane),
                        direction: vec3(&scattered.shadow_direction, lane),
                    },
                    t_max,
                    light: rgb(&scattered.light, lane),
                    line: DRay { origin: exact, direction: if points.far[lane] { to } else { to - exact } },
                    inside: [NONE; 2],
                };
                shadows.push(PathShadow { path: *number, ray, throughput: path.throughput });
            }
            if scattered.alive >> lane & 1 == 0 {
                end(*number);
                continue;
            }
            path.throughput = rgb(&scattered.throughput, lane);
            path.guided = scattered.guided[lane];
            path.leave_opaque(
                Ray { origin: vec3(&scattered.origin, lane), direction: vec3(&scattered.direction, lane) },
                DRay { origin: exact, direction: dvec3(&scattered.wi, lane) },
                ScatteredFrom { receiver: arrived.receiver(lane), choice: choices[lane], pdf: scattered.pdf[lane] },
                if guides.chosen[lane] { Lobe::Diffuse } else { M::Bsdfs::LOBE },
            );
        }
        inputs.clear();
    }

    /// What the guiding field tells of the vertices. `guided` is [`Path::guided`] of their paths.
    fn guide_eight(
        &self,
        arrived: &Arrived,
        bsdfs: &impl Scattering8,
        points: &SourcePoints,
        guided: &[f32; LANES],
        len: usize,
    ) -> GuidedVertices {
        let none = [0.0; LANES];
        let wi: DVec3x8 = [none; 3];
        let (chosen, guided) = ([false; LANES], *guided);
        let mut guides = GuidedVertices { probability: none, chosen, pdf_of_source: none, wi, pdf: none, guided };
        let Some(field) = self.guide else { return guides };
        for lane in (0..len).filter(|lane| !bsdfs.is_black(*lane)) {
            let receiver = arrived.receiver(lane);
            let Some(guide) = field.at(receiver.point, Some(receiver.normal)) else { continue };
            let [u, v] = &arrived.u_direction;
            let is_chosen = arrived.u_lobe[lane] < guide.probability;
            let wi = if is_chosen { guide.sample([u[lane], v[lane]]) } else { bsdfs.direction(lane) };
            set_dvec3(&mut guides.wi, lane, wi);
            guides.pdf[lane] = guide.pdf(wi);
            guides.pdf_of_source[lane] = guide.pdf(dvec3(&points.wi, lane));
            guides.probability[lane] = guide.probability;
            guides.chosen[lane] = is_chosen;
        }
        guides
    }
}
