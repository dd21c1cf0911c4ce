//! Vectors of lanes: one vector for each lane, with the operations of [`DVec3`] in the same order.

use canaletto_bvh::lanes::{Real, Real32, Real64};
use glam::{DAffine3, DVec3, Vec3};
use std::ops::{Add, Mul, Neg, Sub};

/// A vector in each lane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Vector<F> {
    pub(crate) x: F,
    pub(crate) y: F,
    pub(crate) z: F,
}

impl From<DVec3> for Vector<f64> {
    #[inline(always)]
    fn from(v: DVec3) -> Vector<f64> {
        Vector { x: v.x, y: v.y, z: v.z }
    }
}

impl From<Vec3> for Vector<f32> {
    #[inline(always)]
    fn from(v: Vec3) -> Vector<f32> {
        Vector { x: v.x, y: v.y, z: v.z }
    }
}

impl From<Vector<f64>> for DVec3 {
    #[inline(always)]
    fn from(v: Vector<f64>) -> DVec3 {
        DVec3::new(v.x, v.y, v.z)
    }
}

impl From<Vector<f32>> for Vec3 {
    #[inline(always)]
    fn from(v: Vector<f32>) -> Vec3 {
        Vec3::new(v.x, v.y, v.z)
    }
}

impl<F: Real> Add for Vector<F> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Vector { x: self.x + other.x, y: self.y + other.y, z: self.z + other.z }
    }
}

impl<F: Real> Sub for Vector<F> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Vector { x: self.x - other.x, y: self.y - other.y, z: self.z - other.z }
    }
}

impl<F: Real> Neg for Vector<F> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Vector { x: -self.x, y: -self.y, z: -self.z }
    }
}

impl<F: Real> Mul<F> for Vector<F> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, factor: F) -> Self {
        Vector { x: self.x * factor, y: self.y * factor, z: self.z * factor }
    }
}

impl<F: Real> Vector<F> {
    /// The components that a function gives for each component.
    #[inline(always)]
    pub(crate) fn map<T>(self, mut f: impl FnMut(F) -> T) -> Vector<T> {
        Vector { x: f(self.x), y: f(self.y), z: f(self.z) }
    }

    #[inline(always)]
    pub(crate) fn dot(self, other: Self) -> F {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    #[inline(always)]
    pub(crate) fn cross(self, other: Self) -> Self {
        Vector {
            x: self.y * other.z - other.y * self.z,
            y: self.z * other.x - other.z * self.x,
            z: self.x * other.y - other.x * self.y,
        }
    }

    /// The products of the components: ⊗ of colours.
    #[inline(always)]
    pub(crate) fn times(self, other: Self) -> Self {
        Vector { x: self.x * other.x, y: self.y * other.y, z: self.z * other.z }
    }

    /// Where all components are equal.
    #[inline(always)]
    pub(crate) fn equal(self, other: Self) -> F::Mask {
        self.x.equal(other.x) & self.y.equal(other.y) & self.z.equal(other.z)
    }

    /// Where all components are zero.
    #[inline(always)]
    pub(crate) fn is_zero(self) -> F::Mask {
        let zero = F::splat(F::Scalar::default());
        self.x.equal(zero) & self.y.equal(zero) & self.z.equal(zero)
    }

    #[inline(always)]
    pub(crate) fn length_squared(self) -> F {
        self.dot(self)
    }

    #[inline(always)]
    pub(crate) fn length(self) -> F {
        self.dot(self).sqrt()
    }

    #[inline(always)]
    pub(crate) fn select(mask: F::Mask, yes: Self, no: Self) -> Self {
        Vector { x: F::select(mask, yes.x, no.x), y: F::select(mask, yes.y, no.y), z: F::select(mask, yes.z, no.z) }
    }

    /// The numbers of each component.
    #[inline(always)]
    pub(crate) fn load<const N: usize>(from: &[[F::Scalar; N]; 3]) -> Self {
        Vector { x: F::load(&from[0]), y: F::load(&from[1]), z: F::load(&from[2]) }
    }

    /// Writes the numbers of each component.
    #[inline(always)]
    pub(crate) fn store<const N: usize>(self, to: &mut [[F::Scalar; N]; 3]) {
        self.x.store(&mut to[0]);
        self.y.store(&mut to[1]);
        self.z.store(&mut to[2]);
    }
}

impl<F: Real64> Vector<F> {
    /// One vector in all lanes.
    #[inline(always)]
    pub(crate) fn splat(v: DVec3) -> Self {
        Vector { x: F::splat(v.x), y: F::splat(v.y), z: F::splat(v.z) }
    }

    /// The vector that a function gives for each lane.
    #[inline(always)]
    pub(crate) fn gather(of_lane: impl Fn(usize) -> DVec3) -> Self {
        Vector {
            x: F::gather(|lane| of_lane(lane).x),
            y: F::gather(|lane| of_lane(lane).y),
            z: F::gather(|lane| of_lane(lane).z),
        }
    }

    /// The vector of length 1 in the same direction.
    #[inline(always)]
    pub(crate) fn normalized(self) -> Self {
        self * (F::splat(1.0) / self.length())
    }

    /// Two vectors that make an orthonormal basis with this unit vector (Duff et al., *Building an Orthonormal Basis,
    /// Revisited*, JCGT 6(1), 2017).
    #[inline(always)]
    pub(crate) fn orthonormal_pair(self) -> [Self; 2] {
        let Vector { x, y, z } = self;
        let one = F::splat(1.0);
        let sign = F::from_bits((z.to_bits() & F::splat(-0.0).to_bits()) | one.to_bits());
        let a = -one / (sign + z);
        let b = x * y * a;
        [Vector { x: one + sign * x * x * a, y: sign * b, z: -sign * x }, Vector { x: b, y: sign + y * y * a, z: -y }]
    }

    #[inline(always)]
    pub(crate) fn narrow(self) -> Vector<F::Narrow> {
        Vector { x: self.x.narrow(), y: self.y.narrow(), z: self.z.narrow() }
    }
}

impl<F: Real32> Vector<F> {
    #[inline(always)]
    pub(crate) fn widen(self) -> Vector<F::Wide> {
        Vector { x: self.x.widen(), y: self.y.widen(), z: self.z.widen() }
    }
}

/// An affine map in each lane.
#[derive(Clone, Copy)]
pub(crate) struct Affine<F> {
    axes: [Vector<F>; 3],
    translation: Vector<F>,
}

impl<F: Real64> Affine<F> {
    /// The map that a function gives for each lane.
    #[inline(always)]
    pub(crate) fn gather<'a>(of_lane: impl Fn(usize) -> &'a DAffine3) -> Self {
        Affine {
            axes: [
                Vector::gather(|lane| of_lane(lane).matrix3.x_axis),
                Vector::gather(|lane| of_lane(lane).matrix3.y_axis),
                Vector::gather(|lane| of_lane(lane).matrix3.z_axis),
            ],
            translation: Vector::gather(|lane| of_lane(lane).translation),
        }
    }

    /// One map in all lanes.
    #[inline(always)]
    pub(crate) fn splat(map: &DAffine3) -> Self {
        Affine {
            axes: [map.matrix3.x_axis, map.matrix3.y_axis, map.matrix3.z_axis].map(Vector::splat),
            translation: Vector::splat(map.translation),
        }
    }

    #[inline(always)]
    pub(crate) fn vector(&self, v: Vector<F>) -> Vector<F> {
        let [x, y, z] = self.axes;
        x * v.x + y * v.y + z * v.z
    }

    #[inline(always)]
    pub(crate) fn point(&self, p: Vector<F>) -> Vector<F> {
        self.vector(p) + self.translation
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DMat3;

    /// The operations of one lane have the bits of those of `glam`, which the rest of the library uses.
    #[test]
    fn one_lane_has_the_bits_of_glam() {
        let mut state = 1u64;
        let mut number = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
        };
        for _ in 0..10_000 {
            let mut vector = || DVec3::new(number(), number(), number());
            let (a, b) = (vector(), vector());
            let (p, q) = (Vector::from(a), Vector::from(b));
            assert_eq!(DVec3::from(p + q), a + b);
            assert_eq!(DVec3::from(p - q), a - b);
            assert_eq!(DVec3::from(-p * 0.3), -a * 0.3);
            assert_eq!(p.dot(q), a.dot(b));
            assert_eq!(DVec3::from(p.cross(q)), a.cross(b));
            assert_eq!((p.length(), p.length_squared()), (a.length(), a.length_squared()));
            let unit = a.normalize();
            assert_eq!(DVec3::from(p.normalized()), unit);
            let [x, y] = Vector::from(unit).orthonormal_pair();
            assert_eq!((DVec3::from(x), DVec3::from(y)), unit.any_orthonormal_pair());
            assert_eq!(DVec3::from(y), unit.any_orthonormal_vector());
            assert_eq!(Vec3::from(p.narrow()), a.as_vec3());
            assert_eq!(DVec3::from(p.narrow().widen()), a.as_vec3().as_dvec3());
            let map = DAffine3::from_mat3_translation(DMat3::from_cols(b, a.cross(b), a), unit);
            for lanes in [Affine::splat(&map), Affine::gather(|_| &map)] {
                assert_eq!(DVec3::from(lanes.point(p)), map.transform_point3(a));
                assert_eq!(DVec3::from(lanes.vector(p)), map.transform_vector3(a));
            }
        }
    }
}
