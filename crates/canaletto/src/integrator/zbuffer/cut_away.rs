//! What the near and far planes of a scene cut away from a z-buffer's picture.

use crate::camera::Camera;
use crate::integrator::Omission;
use crate::job::PlacedJob;
use crate::raster::facets::corners;
use crate::world::{Hit, PlacedGeometry, Primitives, World};
use canaletto_bvh::{Aabb, Ray};
use glam::DVec3;
use std::collections::BTreeSet;

/// The most rays along a side of the picture.
const MOST_RAYS: u32 = 64;

/// What a plane cuts away.
#[derive(Default)]
struct Cut {
    objects: BTreeSet<String>,
    /// The number of rays that see something else, or nothing, because of the plane.
    rays: u32,
}

/// What the planes that a camera gives cut away. Objects are found by rays, and small ones by their bounds.
pub(super) fn cut_away(job: &PlacedJob) -> Vec<Omission> {
    let (world, camera) = (job.world(), job.camera.at(0.0));
    let planes = [camera.near_plane(), camera.far_plane()];
    if planes == [None; 2] {
        return Vec::new();
    }
    let mut cuts = [Cut::default(), Cut::default()];
    let size = camera.size();
    let count = size.map(|side| side.min(MOST_RAYS));
    for row in 0..count[1] {
        for column in 0..count[0] {
            let place =
                [0, 1].map(|i: usize| (f64::from([column, row][i]) + 0.5) * f64::from(size[i]) / f64::from(count[i]));
            cut_along(world, &camera, place, &mut cuts);
        }
    }
    for number in 0..world.placed_geometry_count() {
        let placed = world.placed_geometry(number, 0.0);
        // Parts of clouds and meshes are too many to be looked at one by one.
        let Primitives::Shapes(shapes) = placed.primitives else {
            cut_box(world, &camera, &world.placed_bounds(number), [number, 0], &mut cuts);
            continue;
        };
        for (primitive, shape) in (0..).zip(shapes) {
            if let Some(bounds) = shape.bounds() {
                cut_box(world, &camera, &placed_box(&placed, &bounds), [number, primitive], &mut cuts);
            }
        }
    }
    let rays = f64::from(count[0] * count[1]);
    let named = ["near", "far"].into_iter().zip(planes).zip(cuts);
    let told = named.filter_map(|((name, plane), cut)| {
        let (plane, percent) = (plane?, 100.0 * f64::from(cut.rays) / rays);
        let share = match percent {
            0.0 => String::new(),
            _ if percent < 0.1 => " (less than 0.1 % of the picture)".to_owned(),
            _ => format!(" ({percent:.1} % of the picture)"),
        };
        let side = if name == "near" { "nearer to the eye than near" } else { "farther from the eye than far" };
        let sentence = format!(
            "a z-buffer draws nothing that is {side} = {plane}, and this cuts objects in view{share}; \
             without {name} in the camera nothing is cut"
        );
        (!cut.objects.is_empty()).then(|| Omission::substitute(sentence, cut.objects.into_iter().collect()))
    });
    told.collect()
}

/// Adds what the planes cut from the line through a place of the picture.
fn cut_along(world: &World, camera: &Camera, [x, y]: [f64; 2], [near, far]: &mut [Cut; 2]) {
    let line = camera.line(x, y);
    let along = -line.direction.dot(camera.axes()[2]);
    let name = |hit: &Hit| world.object(hit).name.clone();
    let hit_from = |t: f64| {
        let ray = Ray::new((line.origin + line.direction * t).as_vec3(), line.direction.as_vec3());
        world.intersect(&ray, f32::MAX).map(|hit| (t + f64::from(hit.t), hit))
    };
    let mut first = hit_from(0.0);
    if let Some(plane) = camera.near_plane()
        && let Some((t, hit)) = first.filter(|(t, _)| t * along < plane)
    {
        near.rays += 1;
        near.objects.insert(name(&hit));
        first = hit_from((plane / along).max(t));
    }
    if let (Some(plane), Some((t, hit))) = (camera.far_plane(), first)
        && t * along > plane
    {
        far.rays += 1;
        far.objects.insert(name(&hit));
    }
}

/// Adds an object if its bounds lie on the other side of a plane, and their middle is in the view.
fn cut_box(world: &World, camera: &Camera, bounds: &Aabb, [instance, primitive]: [u32; 2], [near, far]: &mut [Cut; 2]) {
    let middle = (bounds.min.as_dvec3() + bounds.max.as_dvec3()) * 0.5;
    let [width, height] = camera.size().map(f64::from);
    let is_seen =
        camera.project(middle).is_some_and(|at| (0.0..=width).contains(&at.x) && (0.0..=height).contains(&at.y));
    if bounds.is_empty() || !is_seen {
        return;
    }
    let depth = |corner: DVec3| -(corner - camera.eye()).dot(camera.axes()[2]);
    let (least, most) = corners(bounds)
        .map(depth)
        .fold((f64::INFINITY, 0.0f64), |(least, most), depth| (least.min(depth), most.max(depth)));
    let hit = Hit { t: 0.0, instance, primitive, part: 0, uv: [0.0; 2], time: 0.0 };
    let name = || world.object(&hit).name.clone();
    if least > 0.0 && camera.near_plane().is_some_and(|plane| most < plane) {
        near.objects.insert(name());
    }
    if camera.far_plane().is_some_and(|plane| least > plane) {
        far.objects.insert(name());
    }
}

/// The box in the world around a box in a geometry's space.
fn placed_box(placed: &PlacedGeometry, bounds: &Aabb) -> Aabb {
    let mut all = Aabb::EMPTY;
    for corner in corners(bounds) {
        let corner = placed.to_world.as_ref().map_or(corner, |t| t.point(corner)).as_vec3();
        (all.min, all.max) = (all.min.min(corner), all.max.max(corner));
    }
    all
}
