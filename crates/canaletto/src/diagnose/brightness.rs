//! Detection of pictures that are all black or brighter than white, with the reasons for black.

use super::{first_hit, pixel_grid};
use crate::explain::{HitNode, LightNode, Outcome, Side, explain};
use crate::film::WeightedSum;
use crate::integrator::camera_rays::PixelRenderer;
use crate::integrator::{PreparedPath, PreparedRayIntegrator, RayIntegrator, Whitted};
use crate::job::{Job, PlacedJob};
use crate::math::Rgb;
use crate::render::stack_of;
use crate::scene::{FilmSettings, Sampling, Transfer, WhittedSettings};
use crate::world::World;
use canaletto_bvh::with_stack;
use std::collections::BTreeMap;
use std::fmt;

/// The brightness that all visible surfaces share.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Brightness {
    /// All visible surfaces are black.
    Black(Vec<Reason>),
    /// All visible surfaces are brighter than white, at least by this factor.
    White(f32),
}

/// A reason why surfaces are black.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Reason {
    /// All visible materials reflect nothing: kd, ks and k are 0. Holds the name of one of them.
    BlackMaterial(String),
    /// All visible materials reflect nothing, and the one of this name emits on the side that isn't visible.
    EmitsOutwards(String),
    /// All visible materials only mirror or transmit light, and such rays aren't traced.
    NotFollowed,
    /// A light has an intensity of 0.
    LightOff(String),
    /// A light's cone, region or attenuation leaves no light on the visible surfaces.
    LightDoesNotReach(String),
    /// A light is behind all visible surfaces.
    LightBehind(String),
    /// A light is hidden from all visible surfaces.
    LightBlocked {
        /// The light's name, or its kind and number.
        light: String,
        /// The object that hides it from most of them.
        object: String,
    },
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Reason::BlackMaterial(name) => write!(f, "kd, ks and k of material \"{name}\" are 0"),
            Reason::EmitsOutwards(name) => {
                write!(f, "material \"{name}\" emits from its outer side only, and the inner side is in view")
            }
            Reason::NotFollowed => {
                write!(
                    f,
                    "it is seen in mirrors and clear bodies only, which the integrator or max-depth doesn't follow"
                )
            }
            Reason::LightOff(light) => write!(f, "the intensity of {light} is 0"),
            Reason::LightDoesNotReach(light) => write!(f, "{light} doesn't reach it, or is too weak there"),
            Reason::LightBehind(light) => write!(f, "{light} is behind all surfaces"),
            Reason::LightBlocked { light, object } => write!(f, "{light} is hidden by {object}"),
        }
    }
}

/// The largest grids of test pixels, columns and rows. If the first is black, the second decides, since a small object
/// may be lit.
const GRIDS: [[u32; 2]; 2] = [[32, 24], [128, 96]];
/// The most rays that are traced for one grid.
const MAX_RAYS: u64 = 1 << 18;
/// The paths for each pixel of a grid, and the most rays of all.
const PATHS: [u32; 2] = [16, 4];
const MAX_PATH_RAYS: u64 = 1 << 20;
/// The most shadow rays for one grid.
const MAX_SHADOW_RAYS: u64 = 1 << 22;
/// The most hits that are explained, and the most light points of a scene with explanations.
const MAX_ASKED: usize = 24;
const MAX_POINTS: u64 = 4096;
/// The most lights that are reported.
const MAX_TOLD: usize = 4;
/// The least brightness that counts as brighter than white.
const TOO_BRIGHT: f32 = 1.05;

/// The test pixels with a hit, and their colours.
type Seen = Vec<([u32; 2], Rgb)>;

/// Judges the picture of a job. `placed` is the job in its world. `None` if the picture is neither
/// all black nor all too bright, or if the test would take too long.
pub(super) fn judge(placed: &PlacedJob, job: &Job) -> Option<Brightness> {
    let world = placed.world();
    let dark = dark_below(job.film.transfer);
    let is_dark = |seen: &Seen| seen.iter().all(|(_, color)| color.max_component() < dark);
    let finds_all = job.description().finds_indirect_light();
    let look =
        |grid: usize| if finds_all { look_by_paths(world, placed, grid) } else { look(world, placed, GRIDS[grid]) };
    let seen = look(0)?;
    let least = seen.iter().map(|(_, c)| c.r.min(c.g).min(c.b)).fold(f32::INFINITY, f32::min);
    if seen.is_empty() {
        None
    } else if least > TOO_BRIGHT {
        Some(Brightness::White(least))
    } else if is_dark(&seen) && is_dark(&look(1)?) {
        let mut reasons = reasons(world, job, &seen);
        // Paths follow mirrors and clear bodies.
        reasons.retain(|reason| !finds_all || *reason != Reason::NotFollowed);
        Some(Brightness::Black(reasons))
    } else {
        None
    }
}

/// The least light that an 8-bit file distinguishes from black.
fn dark_below(transfer: Transfer) -> f32 {
    const HALF_A_STEP: f32 = 0.5 / 255.0;
    match transfer {
        Transfer::None => HALF_A_STEP,
        // The straight part of the curve.
        Transfer::Srgb => HALF_A_STEP / 12.92,
    }
}

/// This job with one ray for each pixel.
fn coarse(job: &Job) -> Job {
    let film = FilmSettings { sampling: Sampling::Center, transfer: job.film.transfer, ..FilmSettings::default() };
    let settings = job.description().nearest_whitted();
    let integrator = WhittedSettings { max_depth: settings.max_depth.min(6), ..settings }.into();
    Job { film, integrator, ..job.clone() }
}

fn look(world: &World, job: &Job, most: [u32; 2]) -> Option<Seen> {
    let points: u64 = world.lights.iter().map(|light| u64::from(light.points())).sum();
    if points * u64::from(most[0] * most[1]) > MAX_SHADOW_RAYS {
        return None;
    }
    let coarse = coarse(job);
    let hits = hits(world, job, most);
    with_stack(stack_of(world, &coarse), || {
        let too_many = |rays| rays > MAX_RAYS;
        let mut whitted = Whitted::new(world, coarse.description().nearest_whitted()).with_cancel(&too_many);
        let seen = colors(&mut whitted, &coarse, hits);
        (!whitted.is_cancelled()).then_some(seen)
    })
    // Without threads there is no result; the render will report the error.
    .ok()
    .flatten()
}

/// [`look`] for integrators that find all light: by a few paths for each pixel.
fn look_by_paths(world: &World, job: &Job, grid: usize) -> Option<Seen> {
    let settings = job.description().nearest_path();
    let film = FilmSettings { sampling: Sampling::Sampled(PATHS[grid]), ..FilmSettings::default() };
    let coarse = Job { film, integrator: settings.into(), ..job.clone() };
    let hits = hits(world, job, GRIDS[grid]);
    with_stack(stack_of(world, &coarse), || {
        let too_many = |rays| rays > MAX_PATH_RAYS;
        let prepared = PreparedPath::new(world, settings);
        let mut tracer = prepared.worker(world, &too_many);
        let seen = colors(&mut tracer, &coarse, hits);
        (!tracer.is_cancelled()).then_some(seen)
    })
    .ok()
    .flatten()
}

/// The colours of pixels.
fn colors<'w>(integrator: &mut impl RayIntegrator<'w>, job: &Job, pixels: Vec<[u32; 2]>) -> Seen {
    let mut renderer = PixelRenderer::new(job);
    let mut color = |pixel: &[u32; 2]| {
        let mut sum = WeightedSum::default();
        renderer.pixel(integrator, *pixel, &mut (), &mut |color, weight| sum.add(color, weight));
        sum.mean()
    };
    pixels.into_iter().map(|pixel| (pixel, color(&pixel))).collect()
}

/// The pixels of a grid that see something.
fn hits(world: &World, job: &Job, most: [u32; 2]) -> Vec<[u32; 2]> {
    let camera = job.camera.at(0.0);
    let full_height = f64::from(camera.size()[1]);
    let mut pixels = pixel_grid(job, most);
    pixels.retain(|[x, y]| {
        let line = camera.line(f64::from(*x) + 0.5, full_height - f64::from(*y) - 0.5);
        first_hit(world, &line).is_some()
    });
    pixels
}

/// The reasons why the visible surfaces are black.
fn reasons(world: &World, job: &Job, seen: &Seen) -> Vec<Reason> {
    let points: u64 = world.lights.iter().map(|light| u64::from(light.points())).sum();
    if points > MAX_POINTS {
        return Vec::new();
    }
    let coarse = coarse(job);
    let step = seen.len().div_ceil(MAX_ASKED).max(1);
    let asked = seen.iter().step_by(step).filter_map(|([x, y], _)| explain(world, &coarse, *x, *y).ok());
    let hits: Vec<HitNode> = asked
        .flat_map(|tree| tree.samples)
        .filter_map(|sample| if let Outcome::Hit(hit) = sample.ray.outcome { Some(*hit) } else { None })
        .collect();
    let is_black = |hit: &HitNode| hit.phong.kd == Rgb::BLACK && hit.phong.ks == Rgb::BLACK && hit.overlay.is_none();
    if !hits.is_empty() && hits.iter().all(is_black) {
        let goes_on = |hit: &HitNode| !hit.children.is_empty() || !hit.cut.is_empty();
        let turned_away =
            |hit: &&HitNode| hit.side == Side::Inside && !hit.phong.emission.is_black() && hit.emission.is_none();
        if let Some(hit) = hits.iter().find(turned_away) {
            return vec![Reason::EmitsOutwards(hit.material.clone())];
        }
        // The explanation of a z-buffer has neither mirrored nor refracted rays.
        let would_go_on = |hit: &HitNode| {
            let phong = &hit.phong;
            goes_on(hit) || !phong.k.is_black() || phong.opacity < 1.0
        };
        return match hits.iter().find(|hit| !would_go_on(hit)) {
            Some(black) => vec![Reason::BlackMaterial(black.material.clone())],
            None if hits.iter().all(|hit| hit.children.is_empty()) => vec![Reason::NotFollowed],
            None => Vec::new(),
        };
    }
    let off = world.lights.iter().enumerate().filter(|(_, source)| source.light.intensity == Rgb::BLACK);
    let off: Vec<usize> = off.map(|(index, _)| index).collect();
    let mut lights: BTreeMap<usize, Vec<&LightNode>> = BTreeMap::new();
    for hit in &hits {
        for (light, node) in numbered(world, hit) {
            lights.entry(light).or_default().push(node);
        }
    }
    let of = |(light, nodes): (usize, Vec<&LightNode>)| {
        let name = nodes[0].light.clone();
        if off.contains(&light) {
            Reason::LightOff(name)
        } else {
            obstacle(name, &nodes, dark_below(job.film.transfer))
        }
    };
    lights.into_iter().take(MAX_TOLD).map(of).collect()
}

/// A hit's light nodes with the indices of their lights. Nodes are in the order of lights, each with all its points.
fn numbered<'a>(world: &World, hit: &'a HitNode) -> Vec<(usize, &'a LightNode)> {
    let owners = world.lights.iter().enumerate().flat_map(|(i, source)| (0..source.points()).map(move |_| i));
    owners.zip(&hit.lights).collect()
}

/// The reason why a light doesn't reach most of the visible surfaces.
fn obstacle(light: String, nodes: &[&LightNode], dark: f32) -> Reason {
    let (mut behind, mut far) = (0, 0);
    let mut blocked: BTreeMap<&str, usize> = BTreeMap::new();
    for node in nodes {
        let blocker = node.blockers.iter().find(|blocker| blocker.opacity >= 1.0).or(node.blockers.first());
        match blocker {
            _ if node.n_dot_l <= 0.0 || node.behind => behind += 1,
            _ if node.intensity.max_component() < dark => far += 1,
            Some(blocker) => *blocked.entry(&blocker.object).or_default() += 1,
            None => far += 1,
        }
    }
    match blocked.into_iter().max_by_key(|(_, count)| *count) {
        Some((object, count)) if count >= behind.max(far) => Reason::LightBlocked { light, object: object.into() },
        _ if behind > far => Reason::LightBehind(light),
        _ => Reason::LightDoesNotReach(light),
    }
}
