//! Rays.

use glam::{Vec3, Vec4, Vec4Swizzles};

/// The points `origin + t * direction`, t > 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Where t = 0.
    pub origin: Vec3,
    /// The way of growing t; of any length.
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

    /// The ray, ready for trees and kernels.
    pub fn prepare(&self) -> PreparedRay {
        PreparedRay::new(self)
    }
}

/// A ray with all that trees and kernels want to know about it, computed once for any number of them: one cache line.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub struct PreparedRay {
    /// The ray itself.
    pub ray: Ray,
    /// 1 / direction.
    pub(crate) reciprocal: [f32; 3],
    /// What takes the ray to the longest axis of its direction: x and y are sheared by these, times z, where x, y and z are the axes
    /// of `axes`. NaN, which decides nothing, where rounding would take digits off.
    pub(crate) shear: [f32; 2],
    /// 1 / direction along the longest axis; NaN, which decides nothing, for rays that are not regular.
    pub(crate) along: f32,
    /// Where the planes of x, y and z that are met first lie in [`crate::slab::Boxes`], in bytes.
    pub(crate) entries: [u8; 3],
    /// The same of those that are met last.
    pub(crate) exits: [u8; 3],
    /// 16 times each axis, the longest component of the direction last, the other two ordered such that winding is kept.
    pub(crate) rows: [u8; 3],
    /// One bit for each axis along which the ray moves backwards.
    pub(crate) octant: u8,
    /// The origin is finite and the reciprocals are normal numbers.
    pub(crate) regular: bool,
}

const _: () = assert!(size_of::<PreparedRay>() == 64);

/// A vector's component along an axis of `rows`. Indexing would choose by a branch that nobody can foretell.
#[inline(always)]
#[allow(unsafe_code)]
pub(crate) fn component(vector: &Vec3, row: u8) -> f32 {
    debug_assert!(row <= 32);
    // SAFETY: rows are 0, 16 and 32, and so the offsets 0, 4 and 8 of three floats.
    unsafe { *(&raw const *vector).cast::<f32>().byte_add(usize::from(row >> 2)) }
}

/// `entries` by octant.
const ENTRIES: [[u8; 3]; 8] = {
    let mut entries = [[0; 3]; 8];
    let mut octant = 0;
    while octant < 8 {
        entries[octant] = [96 * (octant & 1) as u8, 96 * (octant >> 1 & 1) as u8 + 32, 96 * (octant >> 2) as u8 + 64];
        octant += 1;
    }
    entries
};

/// The longest axis, by whether x ≥ y, x ≥ z and y ≥ z.
const LONGEST: [usize; 8] = [2, 2, 2, 0, 1, 1, 1, 0];

/// `rows` by longest axis, and whether the ray moves backwards along it.
const ROWS: [[[u8; 3]; 2]; 3] = [[[16, 32, 0], [32, 16, 0]], [[32, 0, 16], [0, 32, 16]], [[0, 16, 32], [16, 0, 32]]];

/// `octant` and `rows` of a direction; its fourth component is positive.
#[inline(always)]
pub(crate) fn way(direction: Vec4) -> (u8, [u8; 3]) {
    let octant = direction.cmplt(Vec4::ZERO).bitmask();
    let length = direction.abs();
    let pairs = length.xxyw().cmpge(length.yzzw()).bitmask() & 7;
    let z = LONGEST[pairs as usize];
    (octant as u8, ROWS[z][(octant >> z & 1) as usize])
}

impl PreparedRay {
    /// Prepares `ray`.
    #[inline]
    pub fn new(ray: &Ray) -> Self {
        let direction = ray.direction.extend(1.0);
        let reciprocal = Vec4::ONE / direction;
        let size = reciprocal.abs();
        let finite = ray.origin.extend(0.0).abs().cmplt(Vec4::INFINITY);
        let normal = size.cmpge(Vec4::splat(f32::MIN_POSITIVE)) & size.cmplt(Vec4::INFINITY);
        let regular = (normal & finite).all();
        let reciprocal = reciprocal.truncate();
        let (octant, rows) = way(direction);
        let along = |row: u8| component(&ray.direction, row);
        // NaN for a zero direction, too.
        let shear = |row: u8| {
            let s = along(row) / along(rows[2]);
            if s == 0.0 || s.is_normal() { s } else { f32::NAN }
        };
        Self {
            ray: *ray,
            reciprocal: reciprocal.to_array(),
            shear: [shear(rows[0]), shear(rows[1])],
            along: if regular { component(&reciprocal, rows[2]) } else { f32::NAN },
            entries: ENTRIES[usize::from(octant & 7)],
            exits: ENTRIES[usize::from(!octant & 7)],
            rows,
            octant,
            regular,
        }
    }

    /// The origin along an axis of `rows`.
    #[inline(always)]
    pub(crate) fn origin(&self, row: u8) -> f32 {
        component(&self.ray.origin, row)
    }

    /// 1 / direction along an axis of `rows`.
    #[inline(always)]
    pub(crate) fn reciprocal(&self, row: u8) -> f32 {
        component(&Vec3::from_array(self.reciprocal), row)
    }

    /// The direction along an axis of `rows`.
    #[inline(always)]
    pub(crate) fn direction(&self, row: u8) -> f32 {
        component(&self.ray.direction, row)
    }

    /// The axes in the order of `rows`.
    #[inline(always)]
    pub(crate) fn axes(&self) -> [usize; 3] {
        let [x, y, z] = self.rows;
        [usize::from(x >> 4), usize::from(y >> 4), usize::from(z >> 4)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_lies_t_directions_from_the_origin() {
        let ray = Ray::new(Vec3::new(1.0, 2.0, 3.0), Vec3::new(0.0, -2.0, 4.0));
        assert_eq!(ray.at(0.5), Vec3::new(1.0, 1.0, 5.0));
    }
}
