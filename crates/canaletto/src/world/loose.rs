//! Few loose shapes and many rays: each shape is asked about the rays that come near it, without a tree.
//!
//! A tree's way to a handful of leaves costs more than the shapes themselves. Groups of rays that pass a shape's box are spared by one
//! look, and what is left goes to the exact kernel.

use super::bundle::{Part, for_runs};
use super::geometry::{NO_PRIMITIVE, Nearest};
use crate::shape::{Shape, ShapeHit};
use canaletto_bvh::{Aabb, Ray};
use std::ops::Range;

/// The most shapes that are looked at one by one: as many as a node of a tree has children.
pub(super) const FEW: usize = 8;

/// Calls `f` with each shape and the places of the rays that may meet it.
fn for_near(shapes: &[Shape], part: &Part, mut f: impl FnMut(u32, &Shape, Range<usize>)) {
    let count = part.range.len();
    for (id, shape) in (0..).zip(shapes) {
        match shape.bounds() {
            Some(bounds) if !part.corridors.is_empty() => {
                for_runs(part.corridors, count, &bounds, |rays| f(id, shape, rays));
            }
            _ => f(id, shape, 0..count),
        }
    }
}

/// The nearest hits of some rays up to where each counts, which `found` says.
pub(super) fn intersect(shapes: &[Shape], part: &Part, found: &mut [Nearest]) {
    let rays = &part.rays.rays[part.range.clone()];
    for_near(shapes, part, |id, shape, near| {
        let (rays, found) = (&rays[near.clone()], &mut found[near]);
        match shape {
            // What there is most of is compiled into the loop.
            Shape::Box(cuboid) => {
                let bounds = cuboid.bounds();
                offer(id, rays, found, |ray, t_max| confined(cuboid.intersect(ray, t_max)?, &bounds, ray, t_max));
            }
            _ => offer(id, rays, found, |ray, t_max| meet(shape, ray, t_max)),
        }
    });
}

#[inline(always)]
fn offer(id: u32, rays: &[Ray], found: &mut [Nearest], meet: impl Fn(&Ray, f32) -> Option<Nearest>) {
    for (ray, best) in rays.iter().zip(found) {
        // At the same t the lower id stays.
        if let Some(hit) = meet(ray, best.t)
            && (hit.t < best.t || best.primitive == NO_PRIMITIVE)
        {
            *best = Nearest { primitive: id, ..hit };
        }
    }
}

/// A shape's hit as trees find it.
#[inline]
fn meet(shape: &Shape, ray: &Ray, t_max: f32) -> Option<Nearest> {
    let hit = shape.intersect(ray, t_max)?;
    match shape {
        // Spheres do that themselves.
        Shape::Sphere(_) => Some(nearest(hit)),
        _ => confined(hit, &shape.bounds()?, ray, t_max),
    }
}

/// A hit kept in the box by which a tree would find the shape.
#[inline(always)]
fn confined(hit: ShapeHit, bounds: &Aabb, ray: &Ray, t_max: f32) -> Option<Nearest> {
    let t = ray.prepare().confine(bounds, hit.t.into(), t_max)?;
    Some(nearest(ShapeHit { t, ..hit }))
}

#[inline(always)]
fn nearest(ShapeHit { t, part, uv }: ShapeHit) -> Nearest {
    Nearest { t, primitive: NO_PRIMITIVE, part, uv }
}

/// Sets those of `t_max` to −∞ whose rays meet a shape at or before that `blocks` the ray of this number.
pub(super) fn between(shapes: &[Shape], part: &Part, t_max: &mut [f32], mut blocks: impl FnMut(usize, u32) -> bool) {
    let rays: &[Ray] = &part.rays.rays[part.range.clone()];
    for_near(shapes, part, |id, shape, near| {
        for index in near {
            let end = &mut t_max[index];
            if *end > 0.0 && meet(shape, &rays[index], *end).is_some() && blocks(index, id) {
                *end = f32::NEG_INFINITY;
            }
        }
    });
}
