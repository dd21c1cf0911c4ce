//! Common parts of the shapes: rays in `f64` near the shape, rounding back to `f32`, frames, range checks.
//!
//! No constant here is a length. Each multiplies numbers of the shape or the ray, so that a scaled scene gives scaled
//! results.

use super::{ShapeHit, Surface};
use crate::OutOfRange;
use crate::math::{DRay, Transform, rounding};
use canaletto_bvh::Aabb;
use glam::{DVec3, Vec2, Vec3};
use std::f64::consts::PI;

/// The relative slack of an error bound: far above the error of the few dozen `f64` roundings behind a point, far below
/// that of one `f32` rounding.
const SLACK: f64 = 1.0 / (1u64 << 48) as f64;

/// A ray in `f64` relative to a shape's anchor. The origin of a distant ray is moved to the point nearest the anchor,
/// since the squared distance would swamp the shape's own size. The origin of a near ray stays, so that the sign of a
/// small root is the side of the surface on which the ray starts.
pub(super) struct Local {
    /// The origin, relative to the anchor.
    pub(super) o: DVec3,
    /// The ray's direction.
    pub(super) d: DVec3,
    /// The ray's parameter at `o`.
    pub(super) t0: f64,
}

impl Local {
    /// The ray relative to `anchor`; `reach` is the extent of the shape from there.
    #[inline(always)]
    pub(super) fn new(line: DRay, anchor: DVec3, reach: f64) -> Local {
        let (o, d) = (line.origin - anchor, line.direction);
        let dd = d.length_squared();
        if o.length_squared() <= 4.0 * reach * reach || dd == 0.0 {
            return Local { o, d, t0: 0.0 };
        }
        let t0 = -o.dot(d) / dd;
        Local { o: o + d * t0, d, t0 }
    }

    /// The point at the ray's parameter `t`, relative to the anchor.
    #[inline(always)]
    pub(super) fn at(&self, t: f64) -> DVec3 {
        self.o + self.d * (t - self.t0)
    }
}

/// The hit at `t`, if its `f32` value lies in (0, t_max].
pub(super) fn hit(t: f64, part: u32, t_max: f32) -> Option<ShapeHit> {
    let t = t as f32;
    (t > 0.0 && t <= t_max && t.is_finite()).then_some(ShapeHit { t, part, uv: [0.0; 2] })
}

/// The root nearest to the reported `t`; `t` itself if there is no root.
pub(super) fn nearest(roots: &[f64], t: f32) -> f64 {
    let t = f64::from(t);
    roots.iter().copied().min_by(|a, b| (a - t).abs().total_cmp(&(b - t).abs())).unwrap_or(t)
}

/// The distance from a body of size 1 at which a point is certainly outside: more than the rounding of points of the
/// surface.
///
/// The line's roots aren't those of the rounded ray, and two roots at a graze may be closer to each other than to the
/// ray's. From outside, a ray always enters a closed body, so that only the roots of entrances count.
pub(super) const OUTSIDE: f64 = 1.0 / (1u64 << 20) as f64;

/// The surface at a point that was computed in `f64` from numbers no larger than `size`. Where the sum nearly cancels,
/// its own error exceeds the rounding to `f32`; the bound covers both.
#[inline(always)]
pub(super) fn surface(point: DVec3, size: f64, normal: DVec3, uv: [f64; 2]) -> Surface {
    let uv = Vec2::new(uv[0] as f32, uv[1] as f32);
    let error = rounding(point.as_vec3()) + Vec3::splat((size * SLACK) as f32);
    Surface { error, ..Surface::at(point, normal, uv) }
}

/// The ratio of a shape's size to the distance of a hit above which `f32` is too coarse for coordinates on the shape.
/// Such coordinates are fractions of the size, and 2⁻²⁴ of the size is then 2⁻¹⁶ of the distance.
const LARGE: f64 = 256.0;

/// Whether a shape of this size is large relative to the distance of a hit: t times the largest component of the ray's
/// direction, `longest`.
#[inline(always)]
pub(super) fn is_large(size: f64, longest: f64, t: f32) -> bool {
    size > LARGE * (f64::from(t) * longest)
}

/// The box of `center` ± `extent`, rounded outwards; `size` as in [`surface`].
pub(super) fn bounds(center: DVec3, extent: DVec3, size: f64) -> Aabb {
    let extent = extent + size * SLACK;
    let (min, max) = ((center - extent).as_vec3(), (center + extent).as_vec3());
    Aabb { min: min.map(f32::next_down), max: max.map(f32::next_up) }
}

/// The half size of the box around a disk: r √(1 − nᵢ²) along each axis.
pub(super) fn disk_extent(unit_normal: DVec3, radius: f64) -> DVec3 {
    let squared = unit_normal * unit_normal;
    let other = DVec3::new(squared.y + squared.z, squared.z + squared.x, squared.x + squared.y);
    other.map(f64::sqrt) * radius
}

/// The smallest box around two boxes.
pub(super) fn union(a: Aabb, b: Aabb) -> Aabb {
    Aabb { min: a.min.min(b.min), max: a.max.max(b.max) }
}

/// The coordinate u of (5.45a) for the angle φ from `z` towards `x`.
pub(super) fn turn(x: f64, z: f64) -> f64 {
    0.5 * (1.0 + libm::atan2(x, z) / PI)
}

/// A right-handed frame around an axis `y`. For a viewer who faces the axis, with the scene's +y upwards, `x` points
/// right and `z` down. Such a viewer sees the outside of a surface with this normal. For the axis +y, `x` and `z` are
/// the scene's own.
pub(super) struct Frame {
    pub(super) x: DVec3,
    pub(super) y: DVec3,
    pub(super) z: DVec3,
}

impl Frame {
    /// The frame around an axis of any length but zero.
    pub(super) fn around(axis: DVec3) -> Frame {
        let y = axis.normalize();
        // For nearly upright axes the direction to the right is ill-defined; there, `x` follows the scene's.
        let x = if y.x * y.x + y.z * y.z < 1e-12 { DVec3::X - y * y.x } else { DVec3::new(y.z, 0.0, -y.x) };
        let x = x.normalize();
        Frame { x, y, z: x.cross(y) }
    }

    /// Whether `t` maps this frame to `to`, so that coordinates in the frame are kept.
    pub(super) fn goes_to(&self, t: &Transform, to: &Frame) -> bool {
        let same = |a: DVec3, b: DVec3| (t.vector(a).normalize() - b).length_squared() < 1e-12;
        same(self.x, to.x) && same(self.y, to.y) && same(self.z, to.z)
    }
}

/// The image of a normal, with its length kept.
pub(super) fn moved_normal(t: &Transform, n: Vec3) -> Vec3 {
    let n = n.as_dvec3();
    let moved = t.normal(n);
    (moved * (n.length() / moved.length())).as_vec3()
}

/// The image of an axis, with its length kept.
pub(super) fn moved_axis(t: &Transform, axis: Vec3) -> Vec3 {
    let axis = axis.as_dvec3();
    let moved = t.vector(axis);
    (moved * (axis.length() / moved.length())).as_vec3()
}

/// Whether `t` mirrors, so that a right-handed frame becomes left-handed.
pub(super) fn mirrors(t: &Transform) -> bool {
    t.matrix().matrix3.determinant() < 0.0
}

/// Checks that a point's or vector's components are finite.
pub(super) fn finite(field: &'static str, v: Vec3) -> Result<(), OutOfRange> {
    if v.is_finite() {
        return Ok(());
    }
    Err(OutOfRange::new(field, format!("is {} {} {}; each component must be finite", v.x, v.y, v.z)))
}

/// Checks that a length is more than zero.
pub(super) fn positive(field: &'static str, v: f32) -> Result<(), OutOfRange> {
    if v.is_finite() && v > 0.0 {
        return Ok(());
    }
    Err(OutOfRange::new(field, format!("is {v}; it must be more than 0 and finite")))
}

/// Checks that a direction has a length.
pub(super) fn direction(field: &'static str, v: Vec3) -> Result<(), OutOfRange> {
    finite(field, v)?;
    if v == Vec3::ZERO {
        return Err(OutOfRange::new(field, "is 0 0 0; it must have a length"));
    }
    Ok(())
}

/// Checks the two ends of an axis.
pub(super) fn ends(base: Vec3, top: Vec3) -> Result<(), OutOfRange> {
    finite("base", base)?;
    finite("top", top)?;
    if base == top {
        return Err(OutOfRange::new(
            "base",
            format!("and top are both {} {} {}; they must be different points", base.x, base.y, base.z),
        ));
    }
    Ok(())
}
