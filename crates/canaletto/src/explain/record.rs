//! The probe that records the tree.

use super::patch::RadiosityNode;
use super::steps::{HitSteps, LightSteps, RaySteps, RefractionSteps};
use super::tree::{
    BlockerNode, CutNode, EmittersNode, HitNode, ImageNode, LightNode, LobeNode, Outcome, RayNode, ReadingNode,
    SampleNode, Side, TextureNode, has_primitives,
};
use super::tried_objects::{intersection_at, tried_objects};
use crate::Named;
use crate::camera::Camera;
use crate::integrator::{EmittersTerm, LightTerm, PreparedRadiosity, Probe, RasterNode, RayKind};
use crate::light::environment::EnvironmentLookup;
use crate::material::{MaterialPoint, Target};
use crate::math::{DRay, Rgb};
use crate::shape::Surface;
use crate::world::{GeometryProbe, Hit, TextureRead, World};
use canaletto_bvh::Ray;
use glam::{DVec3, Vec3};

/// The probe that builds the tree.
pub(super) struct Recorder<'w> {
    world: &'w World,
    camera: &'w Camera,
    samples: Vec<SampleNode>,
    sample: Option<([f64; 2], f64)>,
    /// The weighted sum of the samples' alphas.
    alpha: f64,
    /// The sample's time and its point of the lens.
    drawn: (Option<f64>, Option<[f64; 2]>),
    /// The microfacet that the next ray leaves.
    lobe: Option<LobeNode>,
    /// η on both sides of the boundary that the next ray crosses.
    media: Option<[f32; 2]>,
    /// The rays from the camera ray to the current ray.
    open: Vec<RayNode>,
    blockers: Vec<BlockerNode>,
    textures: Vec<TextureNode>,
    /// The solution that stands for ambient light.
    radiosity: Option<&'w PreparedRadiosity>,
    /// The steps that are recorded, if any.
    steps: Option<RecordedSteps>,
    /// What a rasteriser shows at the current sample.
    raster: Option<RasterNode>,
    lists_rivals: bool,
    /// The current hit, with its place in the world and whether it is on the outer side.
    place: Option<(Hit, DVec3, bool)>,
}

impl<'w> Recorder<'w> {
    pub(super) fn new(world: &'w World, camera: &'w Camera) -> Recorder<'w> {
        Recorder {
            world,
            camera,
            samples: Vec::new(),
            sample: None,
            alpha: 0.0,
            drawn: (None, None),
            lobe: None,
            media: None,
            open: Vec::new(),
            blockers: Vec::new(),
            textures: Vec::new(),
            radiosity: None,
            steps: None,
            raster: None,
            lists_rivals: false,
            place: None,
        }
    }

    /// Returns this recorder such that it records the light of a solution.
    pub(super) fn with_radiosity(self, radiosity: Option<&'w PreparedRadiosity>) -> Recorder<'w> {
        Recorder { radiosity, ..self }
    }

    /// Returns this recorder such that it records the chapter's steps.
    pub(super) fn with_steps(self, steps: Option<RecordedSteps>) -> Recorder<'w> {
        Recorder { steps, ..self }
    }

    /// Returns this recorder such that it has a rasteriser list what covers a place and isn't seen.
    pub(super) fn listing_rivals(self, lists_rivals: bool) -> Recorder<'w> {
        Recorder { lists_rivals, ..self }
    }

    /// How the current ray's hit is found.
    fn ray_steps(&mut self, hit: Option<&Hit>) -> Option<Box<RaySteps>> {
        let steps = self.steps.as_mut()?;
        let ray = self.open.last()?;
        let (time, lens) = self.drawn;
        let line = match (ray.kind, steps.eye, self.sample) {
            (RayKind::Eye, EyeLine::Camera, Some(([x, y], _))) if lens.is_none() => {
                let (origin, direction) = self.camera.at(time.unwrap_or(0.0)).chapter_ray(x, y);
                DRay { origin, direction }
            }
            (RayKind::Eye, EyeLine::Given(line), _) => line,
            _ => DRay {
                origin: DVec3::from(ray.origin) - self.world.origin(),
                direction: Vec3::from(ray.direction).as_dvec3(),
            },
        };
        let primitives = self.world.primitives();
        let (mut tried, mut more_tried) = (Vec::new(), 0);
        if primitives <= steps.primitives_left {
            steps.primitives_left -= primitives;
            (tried, more_tried) = tried_objects(self.world, &line, time.unwrap_or(0.0) as f32, hit);
        }
        Some(Box::new(RaySteps {
            direction: line.direction.to_array(),
            tried,
            more_tried,
            intersection: hit.and_then(|hit| intersection_at(self.world, &line, hit)),
            refraction: None,
        }))
    }

    /// The weighted sum of the samples' alphas.
    pub(super) fn alpha(&self) -> f64 {
        self.alpha
    }

    pub(super) fn into_samples(self) -> Vec<SampleNode> {
        self.samples
    }

    fn current(&mut self) -> Option<&mut HitNode> {
        match &mut self.open.last_mut()?.outcome {
            Outcome::Hit(hit) => Some(hit),
            Outcome::Miss { .. } => None,
        }
    }
}

/// What is recorded of the chapter's steps.
pub(super) struct RecordedSteps {
    /// Where the first ray comes from.
    pub(super) eye: EyeLine,
    /// The number of primitives that may still be tried.
    pub(super) primitives_left: u64,
}

/// Where the first ray of a tree comes from.
#[derive(Clone, Copy)]
pub(super) enum EyeLine {
    /// From the camera.
    Camera,
    /// From a place of its own, along a direction of any length.
    Given(DRay),
}

impl GeometryProbe for Recorder<'_> {
    fn texture(&mut self, read: &TextureRead) {
        let reading = |r: &crate::world::Reading| ReadingNode {
            weight: r.weight,
            at: r.lookup.at.to_array(),
            footprint: [r.lookup.dx.to_array(), r.lookup.dy.to_array()],
            image: r.footprint.map(|f| ImageNode { texel: f.texel, size: f.size, radii: f.radii, level: f.level }),
        };
        self.textures.push(TextureNode {
            texture: read.name.to_owned(),
            used: read.used.target.name(),
            readings: read.readings.iter().map(reading).collect(),
            value: read.value,
            replaced: replaced(read),
        });
    }

    fn blocker(&mut self, hit: &Hit, opacity: f32) {
        self.blockers.push(BlockerNode { object: self.world.object(hit).name.clone(), opacity });
    }
}

impl Probe for Recorder<'_> {
    fn sample(&mut self, position: [f64; 2], weight: f64) {
        self.sample = Some((position, weight));
    }

    fn alpha(&mut self, share: f32) {
        self.alpha += self.sample.map_or(0.0, |(_, weight)| weight) * f64::from(share);
    }

    fn raster(&mut self, node: &RasterNode) {
        self.raster = Some(node.clone());
    }

    fn lists_rivals(&self) -> bool {
        self.lists_rivals
    }

    fn drawn(&mut self, time: Option<f64>, lens: Option<[f64; 2]>) {
        self.drawn = (time, lens);
    }

    fn ray(&mut self, kind: RayKind, ray: &Ray, depth: u32, factor: Rgb) {
        self.open.push(RayNode {
            kind,
            depth,
            factor,
            origin: in_the_scene(self.world, ray.origin),
            direction: ray.direction.to_array(),
            holes: Vec::new(),
            outcome: Outcome::Miss { background: Rgb::BLACK, environment: None },
            lobe: self.lobe.take(),
            media: self.media.take(),
            hidden: Vec::new(),
            steps: None,
            color: Rgb::BLACK,
        });
    }

    fn lobe(&mut self, roughness: f32, facet: glam::DVec3) {
        self.lobe = Some(LobeNode { roughness, facet: facet.as_vec3().to_array() });
    }

    fn environment_lookup(&mut self, environment_lookup: &EnvironmentLookup) {
        if let Some(RayNode { outcome: Outcome::Miss { environment, .. }, .. }) = self.open.last_mut() {
            *environment = Some(Box::new(*environment_lookup));
        }
    }

    fn miss(&mut self, color: Rgb) {
        let steps = self.ray_steps(None);
        if let Some(RayNode { outcome: Outcome::Miss { background, .. }, steps: own, .. }) = self.open.last_mut() {
            (*background, *own) = (color, steps);
        }
    }

    fn hit(&mut self, hit: &Hit, surface: &Surface, material: &MaterialPoint, outside: bool) {
        let object = self.world.object(hit);
        let shading_normal = if outside { surface.shading_normal } else { -surface.shading_normal };
        let ray_steps = self.ray_steps(Some(hit));
        let direction =
            self.open.last().map(|ray| Vec3::from(ray.direction).as_dvec3()).filter(|_| self.steps.is_some());
        let node = HitNode {
            object: object.name.clone(),
            object_id: self.world.object_id(hit),
            kind: object.kind,
            primitive: if has_primitives(object.kind) { hit.primitive } else { 0 },
            t: hit.t,
            point: in_the_scene(self.world, surface.point),
            normal: surface.normal.as_vec3().to_array(),
            shading_normal: shading_normal.as_vec3().to_array(),
            uv: surface.uv.to_array(),
            side: if outside { Side::Outside } else { Side::Inside },
            steps: direction.map(|direction| HitSteps::new(direction, shading_normal)),
            material: self.world.material(hit).name.clone(),
            phong: material.classic,
            textures: std::mem::take(&mut self.textures),
            unlit: None,
            ambient: None,
            radiosity: None,
            emitters: None,
            emission: None,
            lights: Vec::new(),
            children: Vec::new(),
            overlay: None,
            coverage: None,
            behind: None,
            cut: Vec::new(),
        };
        if let Some(ray) = self.open.last_mut() {
            ray.outcome = Outcome::Hit(Box::new(node));
            ray.steps = ray_steps;
        }
        self.place = Some((*hit, surface.exact, outside));
    }

    fn bent(&mut self, from: f64, into: f64) {
        self.media = Some([from as f32, into as f32]);
    }

    fn hidden(&mut self, hit: &Hit) {
        let name = self.world.object(hit).name.clone();
        if let Some(ray) = self.open.last_mut() {
            ray.hidden.push(name);
        }
    }

    fn hole(&mut self, hit: &Hit) {
        self.textures.clear();
        let name = self.world.object(hit).name.clone();
        if let Some(ray) = self.open.last_mut() {
            ray.holes.push(name);
        }
    }

    fn overlay(&mut self, color: Rgb, share: f32) {
        if let Some(hit) = self.current() {
            hit.overlay = Some((color, share));
        }
    }

    fn coverage(&mut self, share: f32) {
        if let Some(hit) = self.current() {
            hit.coverage = Some(share);
        }
    }

    fn unlit(&mut self, kd: Rgb) {
        if let Some(hit) = self.current() {
            hit.unlit = Some(kd);
        }
    }

    fn ambient(&mut self, term: Rgb) {
        let radiosity = self.radiosity.zip(self.place).and_then(|(prepared, (hit, point, outside))| {
            RadiosityNode::new(self.world, prepared.shown(), (&hit, point, outside))
        });
        if let Some(hit) = self.current() {
            hit.ambient = Some(term);
            hit.radiosity = radiosity;
        }
    }

    fn emitters(&mut self, term: &EmittersTerm) {
        if let Some(hit) = self.current() {
            let EmittersTerm { unoccluded, arriving, rays, passed, contribution } = *term;
            hit.emitters = Some(EmittersNode { unoccluded, arriving, rays, passed, contribution });
        }
    }

    fn emission(&mut self, radiance: Rgb) {
        if let Some(hit) = self.current() {
            hit.emission = Some(radiance);
        }
    }

    fn light(&mut self, term: &LightTerm) {
        let node = LightNode {
            light: name_of_light(self.world, term.light),
            point: term.point,
            position: term.sampled.map(|p| in_the_scene(self.world, p)),
            direction: term.direction.to_array(),
            distance: term.distance,
            intensity: term.intensity,
            steps: self.steps.as_ref().map(|_| light_steps(self.world, term)),
            n_dot_l: term.n_dot_l,
            behind: term.behind,
            r_dot_l: term.r_dot_l,
            blockers: std::mem::take(&mut self.blockers),
            f_s: term.f_s,
            diffuse: term.diffuse,
            specular: term.specular,
            contribution: term.contribution,
        };
        if let Some(hit) = self.current() {
            hit.lights.push(node);
        }
    }

    fn cut(&mut self, kind: RayKind, factor: Rgb) {
        if let Some(hit) = self.current() {
            hit.cut.push(CutNode { kind, factor });
        }
    }

    fn end(&mut self, color: Rgb) {
        let Some(mut ray) = self.open.pop() else { return };
        ray.color = color;
        if let (Some(media), Some(steps), Some(parent)) = (ray.media, &mut ray.steps, self.open.last())
            && let Outcome::Hit(hit) = &parent.outcome
        {
            let normal = ray.lobe.map_or(hit.shading_normal, |lobe| lobe.facet);
            let [direction, normal] = [parent.direction, normal].map(|v| Vec3::from(v).as_dvec3());
            steps.refraction = Some(RefractionSteps::new(direction, normal, media.map(f64::from)));
        }
        if let Some(parent) = self.current() {
            if ray.kind == RayKind::Passed {
                parent.behind = Some(ray);
            } else {
                parent.children.push(ray);
            }
        } else if let Some((position, weight)) = self.sample {
            let (time, lens) = self.drawn;
            let camera = self.camera.at(time.unwrap_or(0.0));
            let (start, d) = camera.chapter_ray(position[0], position[1]);
            self.samples.push(SampleNode {
                position,
                weight,
                time,
                lens,
                start: camera.is_orthographic().then(|| (self.world.origin() + start).to_array()),
                chapter_direction: d.to_array(),
                raster: self.raster.take(),
                ray,
            });
        }
    }
}

/// The factors of a light's intensity at a hit.
fn light_steps(world: &World, term: &LightTerm) -> LightSteps {
    let light = &world.lights[term.light as usize];
    let d = term.distance;
    let attenuation = if d.is_finite() { 1.0 / light.attenuation_divisor(d) } else { 1.0 };
    let intensity = light.point_intensity();
    let range = if d.is_finite() { light.within_range(d) } else { 1.0 };
    let without_cone = intensity.max_component() * attenuation * range;
    let cone = if without_cone > 0.0 { term.intensity.max_component() / without_cone } else { 1.0 };
    let range = (light.light.range() > 0.0).then_some(range);
    LightSteps { intensity, attenuation, coefficients: light.light.attenuation, range, cone }
}

/// The scene's coordinates of a point of the world. If the world's origin is zero, the coordinates have the digits that
/// identify the `f32`.
pub(super) fn in_the_scene(world: &World, p: Vec3) -> [f64; 3] {
    if world.origin() == DVec3::ZERO {
        return p.to_array().map(|v| v.to_string().parse().unwrap_or(v.into()));
    }
    (world.origin() + p.as_dvec3()).to_array()
}

/// A light's name, or its kind and number.
pub(super) fn name_of_light(world: &World, number: u32) -> String {
    let light = &world.lights[number as usize].light;
    let own = light.name.as_ref().map(ToString::to_string);
    own.unwrap_or_else(|| format!("{} light #{}", light.kind_name(), number + 1))
}

/// The value before and after a texture.
fn replaced(read: &TextureRead) -> [Vec<f32>; 2] {
    let number = |point: &MaterialPoint, normal: glam::DVec3| match read.used.target {
        Target::Replace | Target::Decal => [&point.overlay.0.to_array()[..], &[point.overlay.1]].concat(),
        Target::Parameter(parameter) => parameter.info().get(&point.classic).to_vec(),
        Target::Standard(target) => {
            point.standard.iter().flat_map(|standard| target.parameter().get(standard)).collect()
        }
        Target::Cutout => vec![point.coverage],
        Target::AnisotropyDirection => {
            point.standard.iter().map(|standard| standard.specular.anisotropy_rotation).collect()
        }
        Target::Displace { .. } => Vec::new(),
        Target::CoatNormal { .. } => Vec::new(),
        Target::Bump | Target::Normal { .. } => normal.as_vec3().to_array().to_vec(),
    };
    let [before, after] = read.normals;
    [number(read.before, before), number(read.after, after)]
}
