//! Rays, and their preparation for traversal.
//!
//! - [`Ray`] is the plain ray, [`PreparedRay`] the ray with its precomputed numbers (Embree's `TravRay` and
//!   `Precalculations`).
//! - [`AxisOrder`] is the part of these that depends only on the signs and the longest component of the direction.
//! - `prepare4` prepares four rays side by side. [`InflatedRay`] is a ray with a margin.

mod inflated;
mod prepare4;

use glam::{Vec3, Vec4, Vec4Swizzles};

pub use inflated::InflatedRay;

/// The points `origin + t * direction`, t > 0.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)] // Packets read neighbouring numbers in one load.
pub struct Ray {
    /// The point at t = 0.
    pub origin: Vec3,
    /// The direction of growing t, of any length.
    pub direction: Vec3,
}

impl Ray {
    /// The ray from `origin` along `direction`.
    pub fn new(origin: Vec3, direction: Vec3) -> Self {
        Self { origin, direction }
    }

    /// The point at `t`.
    pub fn at(&self, t: f32) -> Vec3 {
        self.origin + t * self.direction
    }

    /// The ray with its numbers precomputed for trees and kernels.
    pub fn prepare(&self) -> PreparedRay {
        PreparedRay::new(self)
    }
}

/// A ray with the numbers that trees and kernels need, computed once for any number of trees. One cache line.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub struct PreparedRay {
    /// The ray itself. It must not be changed, since all other fields are derived from it.
    pub(crate) ray: Ray,
    /// −1 / direction. Planes are subtracted from the origin, so that the subtraction can read them from memory.
    pub(crate) neg_reciprocal: [f32; 3],
    /// The shear of Woop's test. It maps the ray to the longest axis of its direction: `shear` times z is subtracted
    /// from x and from y. Here x, y and z are the axes in the order of `axis_order.rows`. The shear is NaN, which
    /// decides nothing, where rounding would lose digits.
    pub(crate) shear: [f32; 2],
    /// −1 / direction along the longest axis. NaN, which decides nothing, for rays that are not regular.
    pub(crate) along: f32,
    pub(crate) axis_order: AxisOrder,
    /// Whether the origin is finite and all reciprocals are normal numbers.
    pub(crate) regular: bool,
}

const _: () = assert!(size_of::<PreparedRay>() == 64);

/// An axis, represented by the byte offset of its row among three rows of four floats. Reading by this offset needs no
/// branch.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(u8)]
pub(crate) enum Axis {
    X = 0,
    Y = 16,
    Z = 32,
}

impl Axis {
    /// The byte offset of the row.
    #[inline(always)]
    pub(crate) fn offset(self) -> usize {
        usize::from(self as u8)
    }

    /// The index of the axis: 0, 1 or 2.
    #[inline(always)]
    pub(crate) fn index(self) -> usize {
        self.offset() / 16
    }

    /// A vector's component. Indexing would select it by an unpredictable branch.
    #[inline(always)]
    #[allow(unsafe_code)]
    pub(crate) fn of(self, vector: &Vec3) -> f32 {
        // SAFETY: a fourth of 0, 16 or 32 is the byte offset of one of three floats.
        unsafe { *(&raw const *vector).cast::<f32>().byte_add(self.offset() / 4) }
    }
}

/// The planes of eight boxes along an axis, represented by their byte offset in [`crate::slab::Boxes`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(u8)]
pub(crate) enum Planes {
    LowX = 0,
    LowY = 32,
    LowZ = 64,
    HighX = 96,
    HighY = 128,
    HighZ = 160,
}

impl Planes {
    /// The byte offset of the planes.
    #[inline(always)]
    pub(crate) fn offset(self) -> usize {
        usize::from(self as u8)
    }
}

/// The octant of a ray's direction and the order of its axes: what follows from the signs and the longest component.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct AxisOrder {
    /// The entry planes along x, y and z.
    pub(crate) entries: [Planes; 3],
    /// The exit planes along x, y and z.
    pub(crate) exits: [Planes; 3],
    /// The axes. The axis of the direction's longest component comes last. The other two are ordered such that winding
    /// is kept.
    pub(crate) rows: [Axis; 3],
    /// The octant: one bit for each axis along which the ray moves backwards.
    pub(crate) octant: u8,
}

/// All axis orders, indexed by the octant and by the bits of x ≥ y, x ≥ z and y ≥ z.
static AXIS_ORDERS: [[AxisOrder; 8]; 8] = {
    use Axis::{X, Y, Z};
    use Planes::{HighX, HighY, HighZ, LowX, LowY, LowZ};
    const LONGEST: [usize; 8] = [2, 2, 2, 0, 1, 1, 1, 0];
    const ROWS: [[[Axis; 3]; 2]; 3] = [[[Y, Z, X], [Z, Y, X]], [[Z, X, Y], [X, Z, Y]], [[X, Y, Z], [Y, X, Z]]];
    const fn planes(octant: usize) -> [Planes; 3] {
        [
            if octant & 1 == 0 { LowX } else { HighX },
            if octant & 2 == 0 { LowY } else { HighY },
            if octant & 4 == 0 { LowZ } else { HighZ },
        ]
    }
    let mut axis_orders = [[AxisOrder::FORWARDS; 8]; 8];
    let mut i = 0;
    while i < 64 {
        let (octant, longest) = (i / 8, LONGEST[i % 8]);
        let rows = ROWS[longest][octant >> longest & 1];
        axis_orders[octant][i % 8] =
            AxisOrder { entries: planes(octant), exits: planes(!octant), rows, octant: octant as u8 };
        i += 1;
    }
    axis_orders
};

impl AxisOrder {
    /// The axis order of a ray along z that moves backwards along no axis.
    pub(crate) const FORWARDS: Self = Self {
        entries: [Planes::LowX, Planes::LowY, Planes::LowZ],
        exits: [Planes::HighX, Planes::HighY, Planes::HighZ],
        rows: [Axis::X, Axis::Y, Axis::Z],
        octant: 0,
    };

    /// The axis order of a direction whose fourth component is positive.
    #[inline(always)]
    fn of_four(direction: Vec4) -> Self {
        let octant = direction.cmplt(Vec4::ZERO).bitmask();
        let length = direction.abs();
        let pairs = length.xxyw().cmpge(length.yzzw()).bitmask();
        AXIS_ORDERS[octant as usize & 7][pairs as usize & 7]
    }

    /// The axis order of a ray.
    #[inline(always)]
    pub(crate) fn of(ray: &Ray) -> Self {
        Self::of_four(ray.direction.extend(1.0))
    }

    /// The indices of the axes in the order of `rows`.
    #[inline(always)]
    pub(crate) fn axes(&self) -> [usize; 3] {
        let [x, y, z] = self.rows;
        [x.index(), y.index(), z.index()]
    }
}

impl PreparedRay {
    /// Prepares `ray`.
    #[inline]
    pub fn new(ray: &Ray) -> Self {
        Self::of(ray)
    }

    #[inline(always)]
    fn of(ray: &Ray) -> Self {
        let direction = ray.direction.extend(1.0);
        let axis_order = AxisOrder::of_four(direction);
        let neg_reciprocal = Vec4::NEG_ONE / direction;
        let size = neg_reciprocal.abs();
        let finite = ray.origin.extend(0.0).abs().cmplt(Vec4::INFINITY);
        let normal = size.cmpge(Vec4::splat(f32::MIN_POSITIVE)) & size.cmplt(Vec4::INFINITY);
        let regular = (normal & finite).all();
        let [x, y, z] = axis_order.rows;
        let x_y_one = Vec4::new(x.of(&ray.direction), y.of(&ray.direction), 1.0, 1.0);
        let shear = x_y_one / Vec4::splat(z.of(&ray.direction));
        let size = shear.abs();
        // For a zero direction the shear is NaN, too.
        let told = size.cmpeq(Vec4::ZERO) | size.cmpge(Vec4::splat(f32::MIN_POSITIVE)) & size.cmplt(Vec4::INFINITY);
        let shear = Vec4::select(told, shear, Vec4::NAN);
        Self {
            ray: *ray,
            neg_reciprocal: neg_reciprocal.truncate().to_array(),
            shear: [shear.x, shear.y],
            along: if regular { -shear.z } else { f32::NAN },
            axis_order,
            regular,
        }
    }

    /// The ray itself.
    #[inline]
    pub fn ray(&self) -> &Ray {
        &self.ray
    }

    /// The origin's coordinate along an axis.
    #[inline(always)]
    pub(crate) fn origin(&self, axis: Axis) -> f32 {
        axis.of(&self.ray.origin)
    }

    /// −1 / direction along an axis.
    #[inline(always)]
    pub(crate) fn neg_reciprocal(&self, axis: Axis) -> f32 {
        axis.of(&Vec3::from_array(self.neg_reciprocal))
    }

    /// The direction's component along an axis.
    #[inline(always)]
    pub(crate) fn direction(&self, axis: Axis) -> f32 {
        axis.of(&self.ray.direction)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Random;
    use glam::Mat3;

    #[test]
    fn a_point_lies_t_directions_from_the_origin() {
        let ray = Ray::new(Vec3::new(1.0, 2.0, 3.0), Vec3::new(0.0, -2.0, 4.0));
        assert_eq!(ray.at(0.5), Vec3::new(1.0, 1.0, 5.0));
    }

    #[test]
    fn the_way_of_a_ray_is_what_its_signs_and_its_longest_component_say() {
        let random = &mut Random(50);
        for _ in 0..1000 {
            let direction = random.vector();
            let axis_order = AxisOrder::of(&Ray::new(Vec3::ZERO, direction));
            let [x, y, z] = axis_order.axes();
            assert_eq!(direction.abs().max_position(), z);
            // Seen along the ray, the corners keep their winding.
            let sheared = Mat3::from_cols(Vec3::AXES[x], Vec3::AXES[y], Vec3::AXES[z]);
            assert_eq!(sheared.determinant(), direction[z].signum());
            for axis in 0..3 {
                let neg_reciprocal = direction[axis] < 0.0;
                assert_eq!(axis_order.octant >> axis & 1 == 1, neg_reciprocal);
                let offset = |neg_reciprocal| 32 * axis + if neg_reciprocal { 96 } else { 0 };
                let (entry, exit) = (axis_order.entries[axis], axis_order.exits[axis]);
                assert_eq!((entry.offset(), exit.offset()), (offset(neg_reciprocal), offset(!neg_reciprocal)));
            }
        }
    }
}
