//! Box 5.1's loop: each object of a world, tried against one ray.

use super::intersection::{Intersection, TriedObject};
use crate::math::DRay;
use crate::shape::Shape;
use crate::world::{Hit, PlacedGeometry, Primitives, World};
use std::collections::BTreeMap;

/// The most primitives that are tried for one pixel.
pub(super) const MOST_PRIMITIVES: u64 = 1 << 22;

/// The most objects that are listed for a ray.
const MOST_OBJECTS: usize = 24;

/// The objects of a world in the order of the file, each with what becomes of it. `nearest` is the ray's hit. Returns
/// also the number of objects that aren't listed; none of them is met.
pub(super) fn tried_objects(world: &World, ray: &DRay, time: f32, nearest: Option<&Hit>) -> (Vec<TriedObject>, usize) {
    let nearest_id = nearest.map(|hit| world.object_id(hit));
    let mut tried: BTreeMap<u32, TriedObject> = BTreeMap::new();
    let mut add = |hit: Hit, t: Option<f64>, missed: &dyn Fn() -> String| {
        let (object, object_id) = (world.object(&hit), world.object_id(&hit));
        let entry = tried.entry(object_id).or_insert_with(|| TriedObject {
            object: object.name.clone(),
            object_id,
            kind: object.kind,
            t: None,
            missed: Some(missed()),
            is_nearest: Some(object_id) == nearest_id,
        });
        if let Some(t) = t.filter(|&t| entry.t.is_none_or(|before| t < before)) {
            (entry.t, entry.missed) = (Some(t), None);
        }
    };
    let hit = |instance, primitive| Hit { t: 0.0, instance, primitive, part: 0, uv: [0.0; 2], time };
    for (primitive, shape) in (0..).zip(world.unbounded_shapes()) {
        let (t, missed) = try_shape(shape, ray);
        add(hit(Hit::UNBOUNDED, primitive), t, &|| missed.clone());
    }
    for number in 0..world.placed_geometry_count() {
        let PlacedGeometry { to_world, primitives } = world.placed_geometry(number, time);
        let local = to_world.map_or(*ray, |to_world| ray.to_local(&to_world));
        if let Primitives::Shapes(shapes) = primitives {
            for (primitive, shape) in (0..).zip(shapes) {
                let (t, missed) = try_shape(shape, &local);
                add(hit(number, primitive), t, &|| missed.clone());
            }
            continue;
        }
        let t = nearest_primitive(&primitives, &local, time);
        add(hit(number, 0), t, &|| format!("none of its {} primitives is met", primitives.len()));
    }
    // Objects that are met come first if not all fit.
    let all = tried.len();
    let mut tried: Vec<TriedObject> = tried.into_values().collect();
    if all > MOST_OBJECTS {
        tried.sort_by_key(|object| (object.t.is_none(), object.object_id));
        tried.truncate(MOST_OBJECTS);
        tried.sort_by_key(|object| object.object_id);
    }
    let listed = tried.len();
    (tried, all - listed)
}

/// The nearest t of a shape, and the reason why there is none.
fn try_shape(shape: &Shape, ray: &DRay) -> (Option<f64>, String) {
    let intersection = Intersection::of(shape, ray);
    let (nearest, missed) = match &intersection {
        Some(intersection) => (intersection.nearest(), intersection.missed()),
        None => (shape.intersect(&ray.rounded(), f32::INFINITY).map(|hit| f64::from(hit.t)), None),
    };
    (nearest, missed.unwrap_or_else(|| "its surface isn't met".to_owned()))
}

fn nearest_primitive(primitives: &Primitives, ray: &DRay, time: f32) -> Option<f64> {
    let rounded = ray.rounded();
    let prepared = rounded.prepare();
    let t_of = |id: u32| match primitives {
        Primitives::Mesh(mesh) => mesh.intersect_triangle(id as usize, &prepared, f32::INFINITY, time).map(|(t, ..)| t),
        _ => primitives.shape(id).and_then(|(shape, _)| shape.intersect(&rounded, f32::INFINITY)).map(|hit| hit.t),
    };
    let nearest = (0..primitives.len() as u32).filter_map(t_of).fold(f32::INFINITY, f32::min);
    nearest.is_finite().then_some(nearest.into())
}

/// The chapter's equation at a hit of this ray.
pub(super) fn intersection_at(world: &World, ray: &DRay, hit: &Hit) -> Option<Intersection> {
    if hit.instance == Hit::UNBOUNDED {
        return Intersection::of(world.unbounded_shape(hit.primitive), ray);
    }
    let PlacedGeometry { to_world, primitives } = world.placed_geometry(hit.instance, hit.time);
    let local = to_world.map_or(*ray, |to_world| ray.to_local(&to_world));
    match primitives {
        Primitives::Mesh(mesh) => {
            let corners = mesh.corners_at(hit.primitive as usize, hit.time).map(|p| p.as_dvec3());
            Some(Intersection::of_triangle(corners, &local))
        }
        _ => Intersection::of(&primitives.shape(hit.primitive)?.0, &local),
    }
}
