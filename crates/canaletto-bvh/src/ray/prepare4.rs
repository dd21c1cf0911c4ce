//! Preparation of many rays, four side by side. It takes half the instructions of one ray after the other.
#![allow(unsafe_code)] // Registers are written to the fields of a ray.

use std::mem::{MaybeUninit, offset_of};

use glam::{Mat4, Vec3, Vec4};

use super::{AXIS_ORDERS, PreparedRay, Ray};
use crate::{InstructionSet, Kernel};

impl PreparedRay {
    /// [`PreparedRay::new`] for many rays. Returns the corners of the box around their origins.
    pub(crate) fn prepare_all(rays: &[Ray], prepared: &mut Vec<Self>) -> [Vec3; 2] {
        prepared.clear();
        prepared.reserve(rays.len());
        let corners = InstructionSet::run(Preparation { rays, prepared: prepared.spare_capacity_mut() });
        // SAFETY: there is room for all rays, so that each of them was written.
        unsafe { prepared.set_len(rays.len()) };
        corners
    }
}

struct Preparation<'a> {
    rays: &'a [Ray],
    /// The memory for the prepared rays, no fewer than `rays`.
    prepared: &'a mut [MaybeUninit<PreparedRay>],
}

impl Kernel for Preparation<'_> {
    type Answer = [Vec3; 2];

    #[inline(always)]
    fn run(self) -> [Vec3; 2] {
        let (mut low, mut high) = (Vec4::INFINITY, Vec4::NEG_INFINITY);
        let (load_fours, rest) = self.rays.as_chunks();
        let (prepared, prepared_rest) = self.prepared.split_at_mut(4 * load_fours.len());
        for (rays, prepared) in load_fours.iter().zip(prepared.as_chunks_mut().0) {
            if !prepare_four(rays, prepared) {
                for (ray, prepared) in rays.iter().zip(prepared) {
                    prepared.write(PreparedRay::of(ray));
                }
            }
            for ray in rays {
                (low, high) = widen((low, high), first_four(ray));
            }
        }
        for (ray, prepared) in rest.iter().zip(prepared_rest) {
            prepared.write(PreparedRay::of(ray));
            (low, high) = widen((low, high), first_four(ray));
        }
        [low.truncate(), high.truncate()]
    }
}

/// Joins an origin to the two corners. With these argument orders a NaN coordinate is either left out or makes the
/// corner NaN.
#[inline(always)]
fn widen((low, high): (Vec4, Vec4), origin: Vec4) -> (Vec4, Vec4) {
    (origin.min(low), origin.max(high))
}

/// The origin, and x of the direction.
#[inline(always)]
fn first_four(ray: &Ray) -> Vec4 {
    // SAFETY: these are the first four of a ray's six numbers.
    unsafe { (&raw const *ray).cast::<Vec4>().read_unaligned() }
}

/// z of the origin, and the direction.
#[inline(always)]
fn last_four(ray: &Ray) -> Vec4 {
    // SAFETY: these are the last four of a ray's six numbers.
    unsafe { (&raw const *ray).cast::<f32>().add(2).cast::<Vec4>().read_unaligned() }
}

/// The transposed matrix.
#[inline(always)]
fn transposed(rows: [Vec4; 4]) -> [Vec4; 4] {
    let turned = Mat4::from_cols(rows[0], rows[1], rows[2], rows[3]).transpose();
    [turned.x_axis, turned.y_axis, turned.z_axis, turned.w_axis]
}

const FLOATS: usize = size_of::<f32>();
const _: () = assert!(
    offset_of!(PreparedRay, ray) == 0
        && offset_of!(PreparedRay, neg_reciprocal) == 6 * FLOATS
        && offset_of!(PreparedRay, shear) == 9 * FLOATS
        && offset_of!(PreparedRay, along) == 11 * FLOATS
        && offset_of!(PreparedRay, axis_order) >= 12 * FLOATS
);

/// Prepares four rays as [`PreparedRay::of`] prepares one. If one of them is irregular or its shear is not a normal
/// number, it returns false and prepares none.
#[inline(always)]
fn prepare_four(rays: &[Ray; 4], prepared: &mut [MaybeUninit<PreparedRay>; 4]) -> bool {
    let heads = [first_four(&rays[0]), first_four(&rays[1]), first_four(&rays[2]), first_four(&rays[3])];
    let [_, x, y, z] = transposed([last_four(&rays[0]), last_four(&rays[1]), last_four(&rays[2]), last_four(&rays[3])]);
    let one = Vec4::NEG_ONE;
    let neg_reciprocal = [one / x, one / y, one / z];
    let (far, wide, high) = (x.abs(), y.abs(), z.abs());
    let (x_y, x_z, y_z) = (far.cmpge(wide), far.cmpge(high), wide.cmpge(high));
    // The longest axis, and the two axes that follow it cyclically.
    let along_x = x_y & x_z;
    let pick = |x: Vec4, y: Vec4, z: Vec4| Vec4::select(along_x, x, Vec4::select(y_z, y, z));
    let (longest, second, third) = (pick(x, y, z), pick(y, z, x), pick(z, x, y));
    let zero = Vec4::ZERO;
    let turned = longest.cmplt(zero);
    let shear_x = Vec4::select(turned, third, second) / longest;
    let shear_y = Vec4::select(turned, second, third) / longest;
    let [bx, by, bz] = neg_reciprocal;
    let along = pick(bx, by, bz);

    // A sum is finite only if all its terms are. No shear is larger than 1.
    let [a, b, c] = [bx.abs(), by.abs(), bz.abs()];
    let least = a.min(b).min(c).min(shear_x.abs().min(shear_y.abs()));
    let origins = heads[0].abs() + heads[1].abs() + (heads[2].abs() + heads[3].abs());
    let finite = (a + b + c).cmplt(Vec4::INFINITY) & origins.cmplt(Vec4::INFINITY);
    if !(finite & least.cmpge(Vec4::splat(f32::MIN_POSITIVE))).all() {
        return false;
    }

    // The index into the table of axis orders, in the lowest bits of a float: eight times the octant, plus one bit for
    // each pair.
    let bit = |set, bit: u32| Vec4::select(set, Vec4::splat((1u32 << bit) as f32), zero);
    let octant = bit(x.cmplt(zero), 3) + bit(y.cmplt(zero), 4) + bit(z.cmplt(zero), 5);
    let pairs = bit(x_y, 0) + bit(x_z, 1) + bit(y_z, 2);
    let index = (octant + pairs + Vec4::splat((1u32 << 23) as f32)).to_array();
    let second = transposed([y, z, bx, by]);
    let third = transposed([bz, shear_x, shear_y, along]);
    for (i, prepared) in prepared.iter_mut().enumerate() {
        let prepared = prepared.as_mut_ptr();
        let index = index[i].to_bits() as usize & 63;
        // SAFETY: the fields have the offsets asserted above, and their alignment is at least that of these registers.
        unsafe {
            let registers = prepared.cast::<Vec4>();
            registers.write(heads[i]);
            registers.add(1).write(second[i]);
            registers.add(2).write(third[i]);
            (&raw mut (*prepared).axis_order).write(AXIS_ORDERS.as_flattened()[index]);
            (&raw mut (*prepared).regular).write(true);
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Random;

    #[test]
    fn many_rays_are_prepared_as_one_is() {
        let random = &mut Random(49);
        let strange = [0.0, -0.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, f32::MIN_POSITIVE, 1e-40];
        for n in 0..300 {
            let mut rays: Vec<Ray> = (0..n % 20).map(|_| Ray::new(random.vector() * 10.0, random.vector())).collect();
            for ray in &mut rays {
                let vector = if random.below(2) == 0 { &mut ray.origin } else { &mut ray.direction };
                vector[random.below(3)] *= [1.0, -1.0, strange[random.below(8)]][random.below(3)];
                if n % 3 == 0 {
                    ray.direction = ray.direction.signum();
                }
            }
            for set in InstructionSet::available() {
                set.limit();
                let mut prepared = Vec::new();
                let [low, high] = PreparedRay::prepare_all(&rays, &mut prepared);
                let expected: Vec<PreparedRay> = rays.iter().map(Ray::prepare).collect();
                assert_eq!(format!("{prepared:?}"), format!("{expected:?}"));
                for origin in rays.iter().map(|ray| ray.origin) {
                    assert!(!(low.cmpgt(origin) | high.cmplt(origin)).any(), "{low} {origin} {high}");
                }
            }
        }
    }
}
