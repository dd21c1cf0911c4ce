//! Few single shapes and many rays: each shape is tested with the rays near it, without a tree.
//!
//! The traversal of a tree to a handful of leaves costs more than the shape tests. A box test in single precision finds
//! the rays that may hit a shape, and the exact kernel tests them.

use crate::shape::{Hits16, RAYS, Shape, ShapeHit, set_bits};
use crate::world::data::geometry::{confined, on_shape};
use crate::world::trace::box_filter::BoxFilter;
use crate::world::trace::rays::RayRange;
use canaletto_bvh::{Aabb, PrimitiveHit, Ray, sphere};
use glam::Vec3;

/// The number of rays that exact kernels take at once.
const GROUP: usize = RAYS;

/// Calls `f` with each shape, its box, the numbers of up to sixteen rays that may hit it, these rays, and the ends of
/// all rays.
fn for_candidates(
    shapes: &[Shape],
    (rays, filter): (&[Ray], &mut BoxFilter),
    mut f: impl FnMut(u32, &Shape, &Aabb, &[u32], &[Ray], &mut [f32]),
) {
    for (id, shape) in (0..).zip(shapes) {
        let Some(bounds) = shape.bounds() else { continue };
        let (candidates, ends) = filter.candidates(&bounds);
        let mut group = [Ray { origin: Vec3::ZERO, direction: Vec3::ONE }; GROUP];
        for numbers in candidates.chunks(GROUP) {
            group.iter_mut().zip(numbers).for_each(|(to, number)| *to = rays[*number as usize]);
            f(id, shape, &bounds, numbers, &group[..numbers.len()], ends);
        }
    }
}

/// Calls `f` with the place of each ray that hits a shape before its end, and with the hit.
#[inline(always)]
fn hits(shape: &Shape, bounds: &Aabb, rays: &[Ray], ends: &[f32; GROUP], mut f: impl FnMut(usize, PrimitiveHit)) {
    let mut each = |met: Hits16| {
        for i in set_bits(met.hit) {
            f(i, on_shape(ShapeHit { t: met.t[i], part: met.part[i], uv: [0.0; 2] }));
        }
        for i in set_bits(met.irregular) {
            if let Some(hit) = meet(shape, bounds, &rays[i], ends[i]) {
                f(i, hit);
            }
        }
    };
    match shape {
        Shape::Box(cuboid) => each(cuboid.intersect_many(rays, ends.iter().copied())),
        Shape::Disk(disk) => each(disk.intersect_many(rays, ends.iter().copied())),
        Shape::Sphere(s) => {
            let mut t = *ends;
            sphere::intersect_many(rays, s.center, s.radius, &mut t[..rays.len()]);
            for (i, t) in t[..rays.len()].iter().enumerate().filter(|(_, t)| !t.is_nan()) {
                f(i, on_shape(ShapeHit { t: *t, part: 0, uv: [0.0; 2] }));
            }
        }
        _ => {
            for (i, ray) in rays.iter().enumerate() {
                if let Some(hit) = meet(shape, bounds, ray, ends[i]) {
                    f(i, hit);
                }
            }
        }
    }
}

/// A hit on a shape as trees return it.
#[inline]
fn meet(shape: &Shape, bounds: &Aabb, ray: &Ray, t_max: f32) -> Option<PrimitiveHit> {
    let hit = shape.intersect(ray, t_max)?;
    match shape {
        // Spheres confine t themselves.
        Shape::Sphere(_) => Some(on_shape(hit)),
        _ => confined(hit, bounds, &ray.prepare(), t_max),
    }
}

/// The ends of rays with these numbers.
fn ends_of(numbers: &[u32], ends: &[f32]) -> [f32; GROUP] {
    let mut own = [f32::NEG_INFINITY; GROUP];
    own.iter_mut().zip(numbers).for_each(|(to, number)| *to = ends[*number as usize]);
    own
}

/// The nearest hits of the rays. `found` holds the `t_max` of each ray and takes the results.
pub(in crate::world) fn intersect(shapes: &[Shape], part: RayRange, found: &mut [PrimitiveHit]) {
    let part = part.filter(found.iter().map(|best| best.t));
    for_candidates(shapes, part, |id, shape, bounds, numbers, rays, ends| {
        hits(shape, bounds, rays, &ends_of(numbers, ends), |i, met| {
            let number = numbers[i] as usize;
            let best = &mut found[number];
            // Among hits at equal t the lower id, which came first, stays.
            if met.t < best.t || best.id == PrimitiveHit::NONE {
                *best = PrimitiveHit { id, ..met };
                ends[number] = met.t;
            }
        });
    });
}

/// Sets `t_max` to −∞ for each ray that hits a shape at or before it for which `blocks` returns true. `blocks` gets the
/// ray's index and the shape's id.
pub(in crate::world) fn occlusion(
    shapes: &[Shape],
    part: RayRange,
    t_max: &mut [f32],
    mut blocks: impl FnMut(usize, u32) -> bool,
) {
    let part = part.filter(t_max.iter().copied());
    for_candidates(shapes, part, |id, shape, bounds, numbers, rays, ends| {
        hits(shape, bounds, rays, &ends_of(numbers, ends), |i, _| {
            let number = numbers[i] as usize;
            if blocks(number, id) {
                (ends[number], t_max[number]) = (f32::NEG_INFINITY, f32::NEG_INFINITY);
            }
        });
    });
}
