//! Few single shapes and many rays: each shape is tested with the rays near it, without a tree.
//!
//! The traversal of a tree to a handful of leaves costs more than the shape tests. One box test culls a group of rays,
//! and the exact kernel tests the remaining rays.

use crate::shape::{CUBOID_RAYS, Shape, ShapeHit, Sphere, set_bits};
use crate::world::data::geometry::{confined, on_shape};
use crate::world::data::packet_bounds::GROUP;
use crate::world::trace::rays::{RayRange, end};
use canaletto_bvh::{PrimitiveHit, Ray, sphere};
use std::ops::Range;

/// Calls `f` with each shape and the range of the rays that may hit it.
fn for_candidate_rays(shapes: &[Shape], part: &RayRange, mut f: impl FnMut(u32, &Shape, Range<usize>)) {
    for (id, shape) in (0..).zip(shapes) {
        if let Some(bounds) = shape.bounds() {
            part.for_candidate_runs(&bounds, |near| f(id, shape, near));
        }
    }
}

/// The nearest hits of the rays. `found` holds the `t_max` of each ray and takes the results.
pub(in crate::world) fn intersect(shapes: &[Shape], part: &RayRange, found: &mut [PrimitiveHit]) {
    for_candidate_rays(shapes, part, |id, shape, near| {
        let (rays, found) = (&part.rays()[near.clone()], &mut found[near]);
        match shape {
            // The most frequent shapes are compiled into the loop.
            Shape::Box(cuboid) => {
                for (rays, found) in rays.chunks(CUBOID_RAYS).zip(found.chunks_mut(CUBOID_RAYS)) {
                    let met = cuboid.intersect_many(rays, found.iter().map(|best| best.t));
                    for i in set_bits(met.hit) {
                        let hit = ShapeHit { t: met.t[i], part: met.face[i], uv: [0.0; 2] };
                        take(&mut found[i], PrimitiveHit { id, ..on_shape(hit) });
                    }
                    for i in set_bits(met.irregular) {
                        offer(id, &rays[i..=i], &mut found[i..=i], |ray, t_max| meet(shape, ray, t_max));
                    }
                }
            }
            Shape::Sphere(s) => {
                for (rays, found) in rays.chunks(GROUP).zip(found.chunks_mut(GROUP)) {
                    let t = meet_sphere(s, rays, found.iter().map(|best| best.t));
                    for (best, t) in found.iter_mut().zip(t).filter(|(_, t)| !t.is_nan()) {
                        take(best, PrimitiveHit { id, ..on_shape(ShapeHit { t, part: 0, uv: [0.0; 2] }) });
                    }
                }
            }
            _ => offer(id, rays, found, |ray, t_max| meet(shape, ray, t_max)),
        }
    });
}

#[inline(always)]
fn offer(id: u32, rays: &[Ray], found: &mut [PrimitiveHit], meet: impl Fn(&Ray, f32) -> Option<PrimitiveHit>) {
    for (ray, best) in rays.iter().zip(found) {
        if let Some(hit) = meet(ray, best.t) {
            take(best, PrimitiveHit { id, ..hit });
        }
    }
}

/// Among hits at equal t the lower id, which came first, stays.
#[inline(always)]
fn take(best: &mut PrimitiveHit, met: PrimitiveHit) {
    if met.t < best.t || best.id == PrimitiveHit::NONE {
        *best = met;
    }
}

/// The t at which each ray of a group hits a sphere up to `t_max`; NaN for a miss.
#[inline(always)]
fn meet_sphere(s: &Sphere, rays: &[Ray], t_max: impl Iterator<Item = f32>) -> [f32; GROUP] {
    let mut t = [f32::NAN; GROUP];
    for (t, t_max) in t.iter_mut().zip(t_max) {
        *t = t_max;
    }
    sphere::intersect_many(rays, s.center, s.radius, &mut t[..rays.len()]);
    t
}

/// A hit on a shape as trees return it.
#[inline]
fn meet(shape: &Shape, ray: &Ray, t_max: f32) -> Option<PrimitiveHit> {
    let hit = shape.intersect(ray, t_max)?;
    match shape {
        // Spheres confine t themselves.
        Shape::Sphere(_) => Some(on_shape(hit)),
        _ => confined(hit, &shape.bounds()?, &ray.prepare(), t_max),
    }
}

/// Sets `t_max` to −∞ for each ray that hits a shape at or before it for which `blocks` returns true. `blocks` gets the
/// ray's index and the shape's id.
pub(in crate::world) fn occlusion(
    shapes: &[Shape],
    part: &RayRange,
    t_max: &mut [f32],
    mut blocks: impl FnMut(usize, u32) -> bool,
) {
    for_candidate_rays(shapes, part, |id, shape, near| {
        let (rays, t_max) = (&part.rays()[near.clone()], &mut t_max[near.clone()]);
        match shape {
            Shape::Sphere(s) => {
                for (group, (rays, t_max)) in rays.chunks(GROUP).zip(t_max.chunks_mut(GROUP)).enumerate() {
                    let t = meet_sphere(s, rays, t_max.iter().copied());
                    end(rays, t_max, |index, _, _| {
                        !t[index].is_nan() && blocks(near.start + group * GROUP + index, id)
                    });
                }
            }
            Shape::Box(cuboid) => {
                for (group, (rays, t_max)) in rays.chunks(CUBOID_RAYS).zip(t_max.chunks_mut(CUBOID_RAYS)).enumerate() {
                    let met = cuboid.intersect_many(rays, t_max.iter().copied());
                    end(rays, t_max, |index, ray, t_max| {
                        let is_hit = met.hit >> index & 1 == 1
                            || met.irregular >> index & 1 == 1 && meet(shape, ray, t_max).is_some();
                        is_hit && blocks(near.start + group * CUBOID_RAYS + index, id)
                    });
                }
            }
            _ => end(rays, t_max, |index, ray, t_max| {
                meet(shape, ray, t_max).is_some() && blocks(near.start + index, id)
            }),
        }
    });
}
