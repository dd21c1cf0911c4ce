//! What drawings show of rays: a tree of classic rays or a path, down to some level.

use super::light_text::{by_light, is_behind, sum_of};
use super::path::{Arrival, PathRay, PathSample, PathStep};
use super::ray_text::levels_of;
use super::tree::{LightNode, Outcome, RayNode};
use crate::integrator::RayKind;
use crate::math::Rgb;

/// The most rays of a drawing that has no number of levels.
const MOST_RAYS: usize = 40;

/// A ray of a drawing.
#[derive(Clone, Debug)]
pub(super) struct DrawnRay {
    pub(super) kind: RayKind,
    /// What multiplies its colour in the ray above.
    pub(super) factor: Rgb,
    pub(super) origin: [f64; 3],
    pub(super) direction: [f32; 3],
    /// What it hits: an object, a medium, or what is around.
    pub(super) end: String,
    /// The place of the hit; none for a ray without one.
    pub(super) point: Option<[f64; 3]>,
    pub(super) color: Rgb,
    pub(super) lights: Vec<DrawnLight>,
    pub(super) below: Vec<DrawnRay>,
    /// The number of rays below it that aren't drawn.
    pub(super) hidden: usize,
}

/// A light at a hit.
#[derive(Clone, Debug)]
pub(super) struct DrawnLight {
    pub(super) name: String,
    /// What it adds to the colour of the hit.
    pub(super) color: Rgb,
    /// The shadow ray that is drawn; none if the light is behind the surface.
    pub(super) shadow_ray: Option<DrawnShadowRay>,
}

/// A shadow ray.
#[derive(Clone, Copy, Debug)]
pub(super) struct DrawnShadowRay {
    pub(super) direction: [f32; 3],
    /// The distance to the light; infinite for light from infinity.
    pub(super) distance: f32,
    /// Whether any light passes.
    pub(super) is_lit: bool,
}

impl DrawnRay {
    /// The rays of a tree, down to a level, or to as many as are easy to look at.
    pub(super) fn of_tree(ray: &RayNode, levels: Option<u32>) -> DrawnRay {
        DrawnRay::of_node(ray, drawn_levels(ray, levels))
    }

    fn of_node(ray: &RayNode, levels: u32) -> DrawnRay {
        let (end, point, lights) = match &ray.outcome {
            Outcome::Hit(hit) => {
                let lights = by_light(&hit.lights).map(DrawnLight::of_points).collect();
                (hit.object.as_str(), Some(hit.point), lights)
            }
            Outcome::Miss { environment: Some(_), .. } => ("environment", None, Vec::new()),
            Outcome::Miss { environment: None, .. } => ("background", None, Vec::new()),
        };
        let is_drawn = levels > 1;
        let below = ray.below().filter(|_| is_drawn).map(|child| DrawnRay::of_node(child, levels - 1)).collect();
        DrawnRay {
            kind: ray.kind,
            factor: ray.factor,
            origin: ray.origin,
            direction: ray.direction,
            end: end.to_owned(),
            point,
            color: ray.color,
            lights,
            below,
            hidden: ray.below().filter(|_| !is_drawn).map(|child| rays_of(child, u32::MAX)).sum(),
        }
    }

    /// The rays of a path, in which every ray has one below it. A ray's colour is the light that the path finds from
    /// its end on, divided by its throughput. None for a path without rays.
    pub(super) fn of_path(sample: &PathSample, levels: Option<u32>) -> Option<DrawnRay> {
        let levels = levels.map_or(MOST_RAYS, |levels| levels as usize).min(sample.rays.len());
        let (mut below, mut found, mut throughput) = (None, Rgb::BLACK, Rgb::WHITE);
        for (index, ray) in sample.rays.iter().enumerate().rev() {
            found += ray.contributions();
            if index >= levels {
                continue;
            }
            let factored = below.take().map(|drawn| DrawnRay { factor: divided(throughput, ray.throughput), ..drawn });
            let hidden = if index + 1 == levels { sample.rays.len() - levels } else { 0 };
            let color = divided(found, ray.throughput);
            below = Some(DrawnRay { color, below: factored.into_iter().collect(), hidden, ..DrawnRay::of_ray(ray) });
            throughput = ray.throughput;
        }
        below
    }

    /// A ray of a path by itself.
    fn of_ray(ray: &PathRay) -> DrawnRay {
        let (end, point) = match &ray.arrival {
            Arrival::Miss => ("background", None),
            Arrival::Medium { point } => ("medium", Some(*point)),
            Arrival::Surface(surface) => (surface.object.as_str(), Some(surface.point)),
        };
        DrawnRay {
            kind: ray.kind,
            factor: Rgb::WHITE,
            origin: ray.origin,
            direction: ray.direction,
            end: end.to_owned(),
            point,
            color: Rgb::BLACK,
            lights: ray.steps.iter().filter_map(DrawnLight::of_step).collect(),
            below: Vec::new(),
            hidden: 0,
        }
    }

    /// This ray and those below it, in the order of their numbers.
    pub(super) fn all(&self) -> Vec<&DrawnRay> {
        let mut all = vec![self];
        self.below.iter().for_each(|ray| all.extend(ray.all()));
        all
    }
}

impl DrawnLight {
    /// The points of one light. The first one that isn't behind the surface has the shadow ray.
    fn of_points(points: &[LightNode]) -> DrawnLight {
        let shadow_ray = points.iter().find(|point| !is_behind(point)).map(|point| DrawnShadowRay {
            direction: point.direction,
            distance: point.distance,
            is_lit: point.f_s > 0.0,
        });
        DrawnLight { name: points[0].light.clone(), color: sum_of(points), shadow_ray }
    }

    /// A source that a path sampled.
    fn of_step(step: &PathStep) -> Option<DrawnLight> {
        let PathStep::Sampled(node) = step else { return None };
        let shadow_ray = DrawnShadowRay {
            direction: node.direction.map(|v| v as f32),
            distance: node.distance.map_or(f32::INFINITY, |distance| distance as f32),
            is_lit: node.visible.max_component() > 0.0,
        };
        Some(DrawnLight { name: node.source.clone(), color: node.contribution, shadow_ray: Some(shadow_ray) })
    }
}

/// A quotient, and 0 where nothing is divided.
fn divided(a: Rgb, b: Rgb) -> Rgb {
    let [a, b] = [a, b].map(Rgb::to_array);
    let quotient: [f32; 3] = std::array::from_fn(|c| if b[c] > 0.0 { a[c] / b[c] } else { 0.0 });
    quotient.into()
}

/// The number of levels of a drawing: as many as are wanted, or as are easy to look at.
pub(super) fn drawn_levels(ray: &RayNode, levels: Option<u32>) -> u32 {
    levels.unwrap_or_else(|| {
        let deepest = levels_of(ray);
        (1..=deepest).take_while(|&levels| rays_of(ray, levels) <= MOST_RAYS).last().unwrap_or(1)
    })
}

/// The number of rays down to a level.
fn rays_of(ray: &RayNode, levels: u32) -> usize {
    if levels == 0 {
        return 0;
    }
    1 + ray.below().map(|child| rays_of(child, levels - 1)).sum::<usize>()
}
