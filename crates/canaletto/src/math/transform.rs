//! Affine transforms in `f64`, stored with their inverse.

use glam::{DAffine3, DMat3, DVec3};
use serde::{Deserialize, Serialize};

/// An invertible affine map from an object's space to the space around it, and its inverse.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "DAffine3", into = "DAffine3")]
pub struct Transform {
    forward: DAffine3,
    inverse: DAffine3,
}

/// A matrix that flattens space, or holds a number that is not finite.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("the transform can't be inverted: it flattens the object or holds a number that isn't finite")]
pub struct NotInvertible;

impl Transform {
    /// The identity.
    pub const IDENTITY: Transform = Transform { forward: DAffine3::IDENTITY, inverse: DAffine3::IDENTITY };

    /// The transform of a matrix.
    ///
    /// # Errors
    /// [`NotInvertible`] if the matrix has no finite inverse.
    pub fn new(forward: DAffine3) -> Result<Transform, NotInvertible> {
        let inverse = forward.inverse();
        if forward.is_finite() && inverse.is_finite() { Ok(Transform { forward, inverse }) } else { Err(NotInvertible) }
    }

    /// The transform of a matrix and its inverse, both given to the last bit.
    ///
    /// # Errors
    /// [`NotInvertible`] if the matrices aren't inverse to each other, up to rounding.
    pub fn with_inverse(forward: DAffine3, inverse: DAffine3) -> Result<Transform, NotInvertible> {
        /// The most that an entry of a product may differ from that of the identity, relative to its terms.
        const ROUNDING: f64 = 1e-9;
        let product = forward * inverse;
        let terms = |rows: DMat3| DMat3::from_cols(rows.x_axis.abs(), rows.y_axis.abs(), rows.z_axis.abs());
        let sizes = terms(forward.matrix3) * terms(inverse.matrix3);
        let moves = terms(forward.matrix3) * inverse.translation.abs() + forward.translation.abs();
        let is_near = |found: DVec3, right: DVec3, size: DVec3| (found - right).abs().cmple(size * ROUNDING).all();
        let is_inverse = is_near(product.matrix3.x_axis, DVec3::X, sizes.x_axis)
            && is_near(product.matrix3.y_axis, DVec3::Y, sizes.y_axis)
            && is_near(product.matrix3.z_axis, DVec3::Z, sizes.z_axis)
            && is_near(product.translation, DVec3::ZERO, moves);
        if forward.is_finite() && inverse.is_finite() && is_inverse {
            Ok(Transform { forward, inverse })
        } else {
            Err(NotInvertible)
        }
    }

    /// The transform of a map and its inverse, both given.
    pub(crate) fn from_parts(forward: DAffine3, inverse: DAffine3) -> Transform {
        Transform { forward, inverse }
    }

    /// The translation by `offset`.
    pub fn translate(offset: DVec3) -> Transform {
        Transform { forward: DAffine3::from_translation(offset), inverse: DAffine3::from_translation(-offset) }
    }

    /// The scale along the axes.
    ///
    /// # Errors
    /// [`NotInvertible`] if a factor is zero or not finite.
    pub fn scale(factors: DVec3) -> Result<Transform, NotInvertible> {
        Transform::new(DAffine3::from_scale(factors))
    }

    /// The rotation by `degrees` around `axis`, counter-clockwise when the axis points at the viewer.
    ///
    /// # Errors
    /// [`NotInvertible`] if the axis has no direction.
    pub fn rotate(axis: DVec3, degrees: f64) -> Result<Transform, NotInvertible> {
        let axis = axis.try_normalize().ok_or(NotInvertible)?;
        let (sin, cos) = sin_cos_degrees(degrees);
        // Rodrigues' formula: R = cos I + sin [axis]× + (1 − cos) axis axisᵀ.
        let cross = DMat3::from_cols(
            DVec3::new(0.0, axis.z, -axis.y),
            DVec3::new(-axis.z, 0.0, axis.x),
            DVec3::new(axis.y, -axis.x, 0.0),
        );
        let outer = DMat3::from_cols(axis * axis.x, axis * axis.y, axis * axis.z);
        let rotation = DMat3::IDENTITY * cos + cross * sin + outer * (1.0 - cos);
        Ok(Transform { forward: DAffine3::from_mat3(rotation), inverse: DAffine3::from_mat3(rotation.transpose()) })
    }

    /// The composition: first `inner`, then `self`.
    #[inline]
    pub fn after(&self, inner: &Transform) -> Transform {
        Transform { forward: self.forward * inner.forward, inverse: inner.inverse * self.inverse }
    }

    /// The inverse map.
    pub fn inverse(&self) -> Transform {
        Transform { forward: self.inverse, inverse: self.forward }
    }

    /// The matrix from the object's space to the space around it.
    #[inline(always)]
    pub fn matrix(&self) -> &DAffine3 {
        &self.forward
    }

    /// The matrix of the inverse.
    pub fn back(&self) -> &DAffine3 {
        &self.inverse
    }

    /// The image of a point.
    #[inline(always)]
    pub fn point(&self, p: DVec3) -> DVec3 {
        self.forward.transform_point3(p)
    }

    /// The image of a direction or an edge.
    #[inline(always)]
    pub fn vector(&self, v: DVec3) -> DVec3 {
        self.forward.transform_vector3(v)
    }

    /// The direction of a normal after the map (inverse transpose; not normalised). Mirroring transforms keep the
    /// normal on the outside.
    #[inline(always)]
    pub fn normal(&self, n: DVec3) -> DVec3 {
        self.inverse.matrix3.transpose() * n
    }

    /// Whether the map is the identity.
    pub fn is_identity(&self) -> bool {
        self.forward == DAffine3::IDENTITY
    }

    /// The factor by which every length grows, if it is equal in all directions: a rotation, reflection, translation
    /// and uniform scale, up to rounding.
    pub fn uniform_scale(&self) -> Option<f64> {
        let m = self.forward.matrix3;
        let (x, y, z) = (m.x_axis, m.y_axis, m.z_axis);
        let s2 = x.length_squared();
        let tolerance = s2 * 1e-12;
        let same = |a: f64, b: f64| (a - b).abs() <= tolerance;
        let similar = same(y.length_squared(), s2)
            && same(z.length_squared(), s2)
            && same(x.dot(y), 0.0)
            && same(y.dot(z), 0.0)
            && same(z.dot(x), 0.0);
        similar.then(|| s2.sqrt())
    }

    /// The largest factor by which the map stretches a length: the root of the largest eigenvalue of MᵀM (Smith,
    /// *Eigenvalues of a Symmetric 3 × 3 Matrix*, 1961).
    pub fn max_stretch(&self) -> f64 {
        let m = self.forward.matrix3;
        // Scaled by the largest number, so that squares neither overflow nor vanish.
        let size = m.to_cols_array().into_iter().fold(0.0, |size: f64, v| size.max(v.abs()));
        let m = m * (1.0 / size);
        let a = m.transpose() * m;
        let mean = (a.x_axis.x + a.y_axis.y + a.z_axis.z) / 3.0;
        let b = a - DMat3::from_diagonal(DVec3::splat(mean));
        let p = (b.to_cols_array().into_iter().map(|v| v * v).sum::<f64>() / 6.0).sqrt();
        if p <= mean * 1e-15 {
            return size * mean.sqrt();
        }
        let angle = libm::acos((0.5 * (b * (1.0 / p)).determinant()).clamp(-1.0, 1.0)) / 3.0;
        size * (mean + 2.0 * p * libm::cos(angle)).sqrt()
    }

    /// Whether the map keeps the axes: only a scale along each axis (of any sign) and a translation, no rotation or
    /// shear.
    pub fn is_axis_aligned(&self) -> bool {
        let m = self.forward.matrix3;
        [m.x_axis.y, m.x_axis.z, m.y_axis.x, m.y_axis.z, m.z_axis.x, m.z_axis.y].iter().all(|&e| e == 0.0)
    }
}

impl Default for Transform {
    fn default() -> Transform {
        Transform::IDENTITY
    }
}

impl TryFrom<DAffine3> for Transform {
    type Error = NotInvertible;
    fn try_from(m: DAffine3) -> Result<Transform, NotInvertible> {
        Transform::new(m)
    }
}

impl From<Transform> for DAffine3 {
    fn from(t: Transform) -> DAffine3 {
        t.forward
    }
}

/// The sine and cosine, exact at multiples of 90°, so that a quarter turn has no rounding error.
fn sin_cos_degrees(degrees: f64) -> (f64, f64) {
    let turn = degrees % 360.0;
    let quarter = turn / 90.0;
    if quarter == libm::trunc(quarter) {
        let q = (quarter as i32).rem_euclid(4) as usize;
        return ([0.0, 1.0, 0.0, -1.0][q], [1.0, 0.0, -1.0, 0.0][q]);
    }
    libm::sincos(turn.to_radians())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_stretch_is_that_of_the_most_stretched_direction() {
        let scale = |x: f64, y: f64, z: f64| Transform::scale(DVec3::new(x, y, z)).unwrap();
        let turn = |x: f64, y: f64, z: f64, degrees| Transform::rotate(DVec3::new(x, y, z), degrees).unwrap();
        for (t, expected) in [
            (Transform::IDENTITY, 1.0),
            (scale(-3.0, 0.5, 2.0), 3.0),
            (turn(1.0, 2.0, 3.0, 40.0).after(&scale(0.1, 0.1, 0.1)), 0.1),
            (turn(1.0, 2.0, 3.0, 40.0).after(&scale(1e-9, 2e-9, 7e-9)).after(&turn(0.0, 1.0, 1.0, 70.0)), 7e-9),
        ] {
            assert!((t.max_stretch() / expected - 1.0).abs() < 1e-12, "{} instead of {expected}", t.max_stretch());
        }
    }

    #[test]
    fn a_quarter_turn_around_z_takes_x_to_y_exactly() {
        let t = Transform::rotate(DVec3::Z, 90.0).unwrap();
        assert_eq!(t.vector(DVec3::X), DVec3::Y);
        assert_eq!(t.inverse().vector(DVec3::Y), DVec3::X);
        let third = Transform::rotate(DVec3::ONE, 120.0).unwrap();
        assert!((third.vector(DVec3::X) - DVec3::Y).length() < 1e-15);
    }

    #[test]
    fn normals_stay_perpendicular_to_surfaces() {
        let t =
            Transform::new(DAffine3::from_mat3(DMat3::from_cols_array(&[2.0, 1.0, 0.0, 0.0, 1.0, 3.0, 0.5, 0.0, 1.0])))
                .unwrap();
        let (u, v) = (DVec3::new(1.0, 2.0, 3.0), DVec3::new(-1.0, 0.5, 2.0));
        let n = t.normal(u.cross(v));
        assert!(n.dot(t.vector(u)).abs() < 1e-12 && n.dot(t.vector(v)).abs() < 1e-12);
    }

    #[test]
    fn flattening_is_refused() {
        assert_eq!(Transform::scale(DVec3::new(1.0, 0.0, 1.0)), Err(NotInvertible));
        assert_eq!(Transform::rotate(DVec3::ZERO, 10.0), Err(NotInvertible));
    }

    #[test]
    fn uniform_scale_sees_through_rotation() {
        let t = Transform::rotate(DVec3::new(1.0, 2.0, 3.0), 33.0)
            .unwrap()
            .after(&Transform::scale(DVec3::splat(-2.5)).unwrap());
        assert!((t.uniform_scale().unwrap() - 2.5).abs() < 1e-12);
        assert_eq!(Transform::scale(DVec3::new(1.0, 2.0, 1.0)).unwrap().uniform_scale(), None);
    }
}
