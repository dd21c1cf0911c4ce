//! The scene from outside with a tree's rays as lines: the other half of fig. 5.29.
//!
//! The view is parallel. Its direction is chosen among many such that rays are seen at length, hits stand apart, and
//! few of them are hidden. If walls hide most hits, as in a closed room, what lies in front of all rays is cut away.

mod choice;
mod picture;
mod svg;

use super::drawing::DrawnRay;
use super::{PathTree, PixelTree, RayTree};
use crate::camera::Camera;
use crate::integrator::RayKind;
use crate::job::Job;
use crate::math::Rgb;
use crate::world::World;
use choice::ViewAxes;
use glam::{DVec2, DVec3};
pub use picture::OutsidePicture;
pub(super) use svg::OUTSIDE_STYLE;

/// The size of the view in pixels.
const SIZE: [f64; 2] = [480.0, 400.0];

/// The most lights of a hit whose shadow rays are drawn.
const MOST_LIGHTS: usize = 8;

/// The surroundings of the hits that the view contains: half the side of a cube, in extents of the hits and in
/// distances of the origin.
const AROUND: [f64; 2] = [1.2, 0.4];

/// Origins and lights farther from the hits than so many halves of the cube aren't in the view. Their rays end at its
/// edge.
const FAR: f64 = 2.6;

/// The rays of a tree in the scene, seen from outside.
#[derive(Clone, Debug)]
pub struct OutsideView {
    /// A faint picture of the scene.
    pub picture: OutsidePicture,
    strokes: Vec<Stroke>,
    marks: Vec<Mark>,
}

/// A ray in the view, in pixels from the upper left corner.
#[derive(Clone, Debug)]
struct Stroke {
    kind: StrokeKind,
    from: DVec2,
    to: DVec2,
    /// The number of the ray in the tree, if it hits nothing. Its hit has it otherwise.
    number: Option<usize>,
}

/// What a line stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum StrokeKind {
    /// A ray of the tree.
    Ray(RayKind),
    /// A shadow ray that reaches its light, or a part of it does.
    Light,
    /// A shadow ray that is blocked.
    Blocked,
}

/// A place with a sign.
#[derive(Clone, Debug)]
struct Mark {
    at: DVec2,
    sign: Sign,
}

#[derive(Clone, Debug)]
enum Sign {
    /// A hit with the number of its ray in the tree, and its colour.
    Hit(usize, Rgb),
    /// The eye, or the place where a ray without a camera begins.
    Origin,
    /// A light with its name.
    Light(String),
}

/// A ray in the world's coordinates.
struct Segment {
    kind: StrokeKind,
    from: DVec3,
    /// The end, or a direction if the ray has no end in the view.
    to: Result<DVec3, DVec3>,
    /// The number of the ray in the tree; none for a shadow ray.
    number: Option<usize>,
}

/// What a view shows, in the world's coordinates.
struct Contents {
    segments: Vec<Segment>,
    hits: Vec<(usize, DVec3, Rgb)>,
    lights: Vec<(String, DVec3)>,
    origin: DVec3,
    /// The points that the view contains.
    framed: Vec<DVec3>,
}

impl PixelTree {
    /// The scene from outside with the rays that [`PixelTree::svg`] draws for this number of levels. None for a tree
    /// without samples.
    pub fn outside(&self, world: &World, job: &Job, levels: Option<u32>) -> Option<OutsideView> {
        let sample = self.samples.get(self.nearest_to_mean())?;
        let time = sample.time.unwrap_or(0.0);
        Some(OutsideView::new(world, &job.camera.at(time), time as f32, &DrawnRay::of_tree(&sample.ray, levels)))
    }
}

impl PathTree {
    /// The scene from outside with the rays that [`PathTree::svg`] draws for this sample.
    pub fn outside(&self, world: &World, job: &Job, chosen: Option<usize>, levels: Option<u32>) -> Option<OutsideView> {
        let sample = self.samples.get(chosen.or_else(|| self.nearest_to_mean())?)?;
        let time = sample.time.unwrap_or(0.0);
        Some(OutsideView::new(world, &job.camera.at(time), time as f32, &DrawnRay::of_path(sample, levels)?))
    }
}

impl RayTree {
    /// The scene from outside with the rays that [`RayTree::svg`] draws.
    pub fn outside(&self, world: &World, job: &Job, levels: Option<u32>) -> OutsideView {
        OutsideView::new(world, &job.camera.at(0.0), 0.0, &DrawnRay::of_tree(&self.ray, levels))
    }
}

impl OutsideView {
    /// The view of a ray and those below it, at a time of the shutter. `camera` is that of the picture.
    pub(super) fn new(world: &World, camera: &Camera, time: f32, ray: &DrawnRay) -> OutsideView {
        let contents = Contents::new(world, &ray.all());
        let axes = ViewAxes::choose(world, camera, time, &contents);
        let strokes = contents.segments.iter().map(|segment| {
            // Nothing in the view is farther away than its diagonal, as seen from a place in it.
            let far = 4.0 * axes.radius + segment.from.distance(axes.center);
            let to = segment.to.unwrap_or_else(|direction| segment.from + direction * far);
            let number = segment.number.filter(|_| segment.to.is_err());
            Stroke { kind: segment.kind, from: axes.seen(segment.from), to: axes.seen(to), number }
        });
        let mark = |at: DVec3, sign: Sign| Mark { at: axes.seen(at), sign };
        let mut marks: Vec<Mark> =
            contents.lights.iter().map(|(name, at)| mark(*at, Sign::Light(name.clone()))).collect();
        marks.push(mark(contents.origin, Sign::Origin));
        marks.extend(contents.hits.iter().map(|(number, at, color)| mark(*at, Sign::Hit(*number, *color))));
        OutsideView { strokes: strokes.collect(), marks, picture: OutsidePicture::new(world, time, &axes) }
    }
}

impl Contents {
    fn new(world: &World, rays: &[&DrawnRay]) -> Contents {
        let local = |p: [f64; 3]| DVec3::from(p) - world.origin();
        let hit_of = |ray: &DrawnRay| ray.point.map(local);
        let hits: Vec<(usize, DVec3, Rgb)> =
            (1..).zip(rays).filter_map(|(number, ray)| hit_of(ray).map(|at| (number, at, ray.color))).collect();
        let origin = local(rays[0].origin);
        let bounds = world.bounds();
        let bounds = [bounds.min, bounds.max].map(|corner| corner.as_dvec3() - world.origin());
        let is_bounded = bounds.iter().all(|corner| corner.is_finite());
        // Without a hit, the view shows the scene that the ray misses.
        let places: Vec<DVec3> = match &hits[..] {
            [] if is_bounded => bounds.to_vec(),
            [] => vec![origin + DVec3::from(rays[0].direction.map(f64::from))],
            hits => hits.iter().map(|(_, at, _)| *at).collect(),
        };
        let middle = places.iter().sum::<DVec3>() / places.len() as f64;
        let extent = places.iter().map(|at| at.distance(middle)).fold(0.0, f64::max);
        let half = (AROUND[0] * extent).max(AROUND[1] * origin.distance(middle)).max(f64::from(f32::MIN_POSITIVE));
        let mut framed = places;
        if is_bounded {
            framed.extend(bounds.map(|corner| corner.clamp(middle - half, middle + half)));
        }
        let is_near = |p: DVec3| p.distance(middle) <= FAR * half;
        if is_near(origin) {
            framed.push(origin);
        }
        let (mut segments, mut lights) = (Vec::new(), Vec::<(String, DVec3)>::new());
        for (number, ray) in (1..).zip(rays) {
            let (from, direction) = (local(ray.origin), DVec3::from(ray.direction.map(f64::from)));
            let to = hit_of(ray).ok_or(direction);
            segments.push(Segment { kind: StrokeKind::Ray(ray.kind), from, to, number: Some(number) });
            let Some(from) = hit_of(ray) else { continue };
            for light in ray.lights.iter().take(MOST_LIGHTS) {
                let Some(shadow_ray) = light.shadow_ray else { continue };
                let direction = DVec3::from(shadow_ray.direction.map(f64::from));
                let to = from + direction * f64::from(shadow_ray.distance);
                let has_end = shadow_ray.distance.is_finite() && is_near(to);
                if has_end && !lights.iter().any(|(name, at)| *name == light.name && at.distance(to) < 1e-3 * half) {
                    lights.push((light.name.clone(), to));
                    framed.push(to);
                }
                let kind = if shadow_ray.is_lit { StrokeKind::Light } else { StrokeKind::Blocked };
                let to = if has_end { Ok(to) } else { Err(direction) };
                segments.push(Segment { kind, from, to, number: None });
            }
        }
        Contents { segments, hits, lights, origin, framed }
    }
}
