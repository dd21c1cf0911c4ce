//! The choice of a light for a point: one of the scene's lights, an emitting surface or the environment, about by the
//! light that arrives from it if nothing lies between.
//!
//! Sources come in groups: emitting surfaces, whose light falls off with the squared distance; lights of each
//! attenuation; lights that are infinitely far; the environment. All but the last two have a [tree](super::light_tree).
//! A point chooses a group first. Each group that can shine there keeps a share of the choices, since a bright one may
//! be hidden.

use super::emitter::Emitters;
use super::light_tree::{ClusterBounds, Falloff, LightTree, NormalCone, Receiver};
use crate::light::environment::{BlockWeights, EnvironmentDistribution};
use crate::light::{Emission, LightBounds, PreparedLight, attenuation_divisor};
use crate::math::Rgb;
use crate::world::{Hit, World};
use glam::DVec3;
use std::f64::consts::{FRAC_PI_2, PI};

/// A source of light that can be sampled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Source {
    /// A light of the world.
    Light(u32),
    /// An emitting surface.
    Emitter(u32),
    /// The environment.
    Environment,
}

impl Source {
    /// Whether rays that are scattered find its light, too.
    pub(super) fn is_found_by_rays(self) -> bool {
        !matches!(self, Source::Light(_))
    }
}

/// The most trees. Lights of further attenuations share the last one.
const TREES: usize = 8;

/// The most groups of sources: trees, infinitely far lights, and the environment.
const GROUPS: usize = TREES + 2;

/// The place of the infinitely far lights and of the environment among the groups.
const FAR: usize = TREES;
const ENVIRONMENT: usize = TREES + 1;

/// The share of choices that are even among the groups that can shine on a point.
const EVEN: f64 = 0.1;

/// A tree with the sources at its leaves.
#[derive(Debug)]
struct SourceTree {
    tree: LightTree,
    sources: Vec<Source>,
}

/// Sources that will share a tree.
struct TreeGroup {
    /// The attenuation of lights; none for surfaces, whose light falls off with the squared distance.
    attenuation: Option<[f32; 3]>,
    sources: Vec<Source>,
    bounds: Vec<ClusterBounds>,
}

impl TreeGroup {
    fn new(attenuation: Option<[f32; 3]>) -> TreeGroup {
        TreeGroup { attenuation, sources: Vec::new(), bounds: Vec::new() }
    }

    fn push(&mut self, source: Source, bounds: ClusterBounds) {
        self.sources.push(source);
        self.bounds.push(bounds);
    }
}

/// All sources of light.
#[derive(Debug, Default)]
pub(super) struct LightSampler {
    /// The emitting surfaces come first, in the order of the emitters.
    trees: Vec<SourceTree>,
    /// Infinitely far lights, with the irradiance of a surface that faces them.
    far: Vec<(u32, f64)>,
    pub(super) emitters: Emitters,
    pub(super) environment: Option<EnvironmentDistribution>,
    /// The number of the light that is the environment's sun.
    pub(super) sun: Option<u32>,
    /// Whether any hit on the way hides the environment.
    pub(super) environment_is_hidden_by_any: bool,
    /// The only group, which is chosen without a look at it.
    only_group: Option<usize>,
    /// The only source, too.
    only: Option<Source>,
}

/// The choice among groups of sources at a point.
pub(super) struct GroupChoice {
    /// The probability of each group.
    probabilities: [f64; GROUPS],
    /// The total of the weights of the environment's blocks.
    total: f64,
}

/// What rays that leave a point need of the choice there: it tells how likely the point would have chosen what they
/// find.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct KnownChoice {
    /// The probabilities of the emitting surfaces and of the environment.
    surfaces: f64,
    environment: f64,
    /// The total of the environment's weights.
    total: f64,
}

impl KnownChoice {
    /// The choice of a point that asks for no source.
    pub(super) const NONE: KnownChoice = KnownChoice { surfaces: 0.0, environment: 0.0, total: 0.0 };

    /// The probability of the environment, and the total of its weights.
    pub(super) fn environment(&self) -> (f64, f64) {
        (self.environment, self.total)
    }
}

impl GroupChoice {
    pub(super) fn known(&self) -> KnownChoice {
        let GroupChoice { probabilities, total } = self;
        KnownChoice { surfaces: probabilities[0], environment: probabilities[ENVIRONMENT], total: *total }
    }
}

/// What stands for a colour in the choice of a light.
pub(super) fn strength(color: Rgb) -> f64 {
    color.to_array().map(f64::from).iter().sum()
}

/// Whether the material shows a light that is a source by itself: one of even emission, or without shadows.
fn is_only_seen(world: &World, material: u32) -> bool {
    world.visible_light(material).is_some_and(|light| !light.is_emitter)
}

/// The bounds of a light's emission; none if it is infinitely far.
fn bounds(world: &World, index: u32, light: &PreparedLight, radius: f64) -> Option<ClusterBounds> {
    let LightBounds { bounds: [mut min, mut max], axis, cos_theta_o, cos_theta_e, .. } = light.bounds()?;
    let mut normals = NormalCone { axis, angle: libm::acos(cos_theta_o.clamp(-1.0, 1.0)) };
    if let Some(swept) = world.moving_light_bounds(index) {
        (min, max, normals) = (swept.min.as_dvec3(), swept.max.as_dvec3(), NormalCone::ALL);
    }
    let whole = strength(light.point_intensity() * light.points() as f32);
    let intensity = match light.matte_area() {
        Some(area) => whole * area / f64::from(light.attenuation_divisor(radius as f32)),
        None => PI * whole,
    };
    let emission_angle = match light.matte_area() {
        Some(_) => FRAC_PI_2,
        None => libm::acos(cos_theta_e.clamp(-1.0, 1.0)),
    };
    Some(ClusterBounds { min, max, normals, emission_angle, two_sided: false, intensity })
}

impl LightSampler {
    pub(super) fn new(world: &World) -> LightSampler {
        let scene = world.local_bounds();
        let radius = if scene.is_empty() { 1.0 } else { 0.5 * f64::from((scene.max - scene.min).length()) };
        let emitters = Emitters::new(world, radius, |material| !is_only_seen(world, material));
        let environment = world.environment.as_ref().and_then(EnvironmentDistribution::new);
        let mut surfaces = TreeGroup::new(None);
        (0..).zip(&emitters.all).for_each(|(i, emitter)| surfaces.push(Source::Emitter(i), emitter.bounds()));
        let mut groups = vec![surfaces];
        let mut far = Vec::new();
        for (i, light) in (0..).zip(&world.lights) {
            let by_surface = light.light.emission == Emission::Matte && light.light.has_area();
            let whole = strength(light.point_intensity() * light.points() as f32);
            let is_source = whole > 0.0 && !(by_surface && light.light.visible && light.light.shadows);
            if !is_source {
                continue;
            }
            let Some(bounds) = bounds(world, i, light, radius) else {
                far.push((i, PI * whole));
                continue;
            };
            let key = (!by_surface).then_some(light.light.attenuation);
            let place = groups.iter().position(|group| group.attenuation == key).unwrap_or_else(|| {
                if groups.len() < TREES {
                    groups.push(TreeGroup::new(key));
                }
                groups.len() - 1
            });
            if bounds.intensity > 0.0 {
                groups[place].push(Source::Light(i), bounds);
            }
        }
        let trees: Vec<SourceTree> = groups
            .into_iter()
            .map(|TreeGroup { attenuation, sources, bounds }| {
                let falloff = Falloff(attenuation.unwrap_or([0.0, 0.0, 1.0]));
                SourceTree { tree: LightTree::new(&bounds, falloff, attenuation.is_none(), radius), sources }
            })
            .collect();
        let mut counts = [0; GROUPS];
        counts.iter_mut().zip(&trees).for_each(|(count, tree)| *count = tree.sources.len());
        counts[FAR] = far.len();
        counts[ENVIRONMENT] = usize::from(environment.is_some());
        let mut present = (0..GROUPS).filter(|group| counts[*group] > 0);
        let only_group = present.next().filter(|_| present.next().is_none());
        let only = only_group.filter(|group| counts[*group] == 1).map(|group| match group {
            FAR => Source::Light(far[0].0),
            ENVIRONMENT => Source::Environment,
            _ => trees[group].sources[0],
        });
        // The environment's sun is the last light.
        let has_sun = world.environment.as_ref().is_some_and(|environment| environment.sun_is_light());
        let sun = has_sun.then(|| world.lights.len() as u32 - 1);
        let environment_is_hidden_by_any = environment.is_some() && world.all_cast_shadows();
        LightSampler { trees, far, emitters, environment, sun, environment_is_hidden_by_any, only_group, only }
    }

    /// Whether any hit before the end of a shadow ray hides its source. Otherwise the nearest hit tells.
    #[inline]
    pub(super) fn is_hidden_by_any(&self, source: Source) -> bool {
        match source {
            Source::Light(_) => true,
            Source::Emitter(number) => self.emitters.all[number as usize].is_isolated,
            Source::Environment => self.environment_is_hidden_by_any,
        }
    }

    /// The cosine of a light that is infinitely far. `direction` leads to it.
    fn cosine(to: &Receiver, direction: DVec3) -> f64 {
        let cos = to.normal.dot(direction);
        let cos = if to.two_sided { cos.abs() } else { cos };
        cos.max(to.least_cosine())
    }

    /// The choice among groups for a point. `blocks` gets the weights of the environment's blocks, if there is one.
    #[inline]
    pub(super) fn choice(&self, world: &World, to: &Receiver, blocks: &mut BlockWeights) -> GroupChoice {
        let mut total = 0.0;
        if let Some(environment) = &self.environment {
            *blocks = environment.weights(to.normal, to.two_sided);
            total = blocks.total();
        }
        if let Some(only) = self.only_group {
            let mut probabilities = [0.0; GROUPS];
            probabilities[only] = 1.0;
            return GroupChoice { probabilities, total };
        }
        let arriving = self.environment.as_ref().map_or(0.0, |environment| environment.arriving(blocks));
        GroupChoice { probabilities: self.probabilities(world, to, arriving), total }
    }

    /// The probability of each group for a point at which this light of the environment arrives.
    fn probabilities(&self, world: &World, to: &Receiver, arriving: f64) -> [f64; GROUPS] {
        let mut weights = [0.0; GROUPS];
        for (weight, tree) in weights.iter_mut().zip(&self.trees) {
            *weight = tree.tree.importance(to);
        }
        let far = |(light, strength): &(u32, f64)| strength * Self::cosine(to, world.lights[*light as usize].towards());
        weights[FAR] = self.far.iter().map(far).sum();
        weights[ENVIRONMENT] = arriving;
        let total: f64 = weights.iter().sum();
        let count = weights.iter().filter(|weight| **weight > 0.0).count() as f64;
        if total.is_nan() || total <= 0.0 || total.is_infinite() {
            return [0.0; GROUPS];
        }
        weights.map(|weight| if weight > 0.0 { (1.0 - EVEN) * weight / total + EVEN / count } else { 0.0 })
    }

    /// The only source, and what is known of its choice, if all points choose it alike. The environment's directions
    /// depend on the point.
    #[inline]
    pub(super) fn same_everywhere(&self) -> Option<(Source, KnownChoice)> {
        let only = self.only.filter(|only| *only != Source::Environment)?;
        let surfaces = if self.only_group == Some(0) { 1.0 } else { 0.0 };
        Some((only, KnownChoice { surfaces, environment: 0.0, total: 0.0 }))
    }

    /// A source that `u` of [0, 1) chooses for a point, with its probability.
    pub(super) fn sample(&self, world: &World, to: &Receiver, choice: &GroupChoice, u: f64) -> Option<(Source, f64)> {
        if let Some(only) = self.only {
            return Some((only, 1.0));
        }
        if let Some(group) = self.only_group {
            return self.sample_group(world, to, group, u.min(1.0 - f64::EPSILON));
        }
        let groups = &choice.probabilities;
        let mut rest = u;
        let last = groups.iter().rposition(|probability| *probability > 0.0)?;
        let group = (0..last).find(|group| {
            let is_here = rest < groups[*group];
            rest -= if is_here { 0.0 } else { groups[*group] };
            is_here
        });
        let group = group.unwrap_or(last);
        let u = (rest / groups[group]).clamp(0.0, 1.0 - f64::EPSILON);
        let (source, probability) = self.sample_group(world, to, group, u)?;
        Some((source, probability * groups[group]))
    }

    /// A source of a group.
    fn sample_group(&self, world: &World, to: &Receiver, group: usize, u: f64) -> Option<(Source, f64)> {
        match group {
            FAR => self.sample_far(world, to, u),
            ENVIRONMENT => Some((Source::Environment, 1.0)),
            _ => {
                let (light, probability) = self.trees[group].tree.sample(to, u)?;
                Some((self.trees[group].sources[light as usize], probability))
            }
        }
    }

    fn sample_far(&self, world: &World, to: &Receiver, u: f64) -> Option<(Source, f64)> {
        let weight =
            |(light, strength): &(u32, f64)| strength * Self::cosine(to, world.lights[*light as usize].towards());
        let total: f64 = self.far.iter().map(weight).sum();
        let mut rest = u * total;
        let last = self.far.len().checked_sub(1)?;
        let chosen = (0..last).find(|i| {
            let weight = weight(&self.far[*i]);
            let is_here = rest < weight;
            rest -= weight;
            is_here
        });
        let far = &self.far[chosen.unwrap_or(last)];
        Some((Source::Light(far.0), weight(far) / total))
    }

    /// The density with which directions of sampled lights lead from a point to a hit with this point and unit normal.
    pub(super) fn pdf_of_hit(
        &self,
        world: &World,
        (to, choice): (&Receiver, &KnownChoice),
        hit: &Hit,
        point: DVec3,
        normal: DVec3,
    ) -> f64 {
        let Some(emitter) = self.emitters.of_hit(hit) else { return 0.0 };
        let pdf = self.emitters.all[emitter as usize].pdf_from(world, hit.time, to.point, point, normal);
        if pdf > 0.0 { pdf * self.probability_of_emitter(to, choice, emitter) } else { 0.0 }
    }

    /// The probability with which a point chooses an emitter.
    pub(super) fn probability_of_emitter(&self, to: &Receiver, choice: &KnownChoice, emitter: u32) -> f64 {
        if self.only.is_some() {
            return 1.0;
        }
        // Emitters are the first leaves of the first tree.
        choice.surfaces * self.trees[0].tree.probability(to, emitter)
    }

    /// The density with which a unit direction is sampled for the light of the environment. `place` is the direction's
    /// (u, v) in a latitude-longitude image.
    pub(super) fn pdf_of_environment(
        &self,
        (to, choice): (&Receiver, &KnownChoice),
        direction: DVec3,
        place: [f64; 2],
    ) -> f64 {
        let Some(environment) = &self.environment else { return 0.0 };
        environment.pdf((to.normal, to.two_sided), choice.total, direction, place) * choice.environment
    }

    /// The emission of a hit as it lights a point at a distance: attenuated if it is that of a light.
    pub(super) fn lit(&self, world: &World, hit: &Hit, emission: Rgb, distance: f64) -> Rgb {
        match world.visible_light(world.material_index(hit)) {
            None => emission,
            Some(light) => emission / attenuation_divisor(light.attenuation, distance as f32),
        }
    }

    /// Whether a hit shows a light that shadow rays ask for, so that it adds nothing to what they have lit.
    pub(super) fn is_light_of_shadow_rays(&self, world: &World, hit: &Hit) -> bool {
        is_only_seen(world, world.material_index(hit))
    }
}
