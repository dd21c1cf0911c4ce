//! The surface at a hit: the part of a shape that shading sees.

use crate::math::{Rgb, Transform, rounding};
use glam::{DVec2, DVec3, Vec2, Vec3};

/// A point of a surface with the values that shading needs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// The point.
    pub point: Vec3,
    /// The point before it was rounded to `f32`. The lines of further rays start here.
    pub exact: DVec3,
    /// A bound of the point's rounding error in each coordinate.
    pub error: Vec3,
    /// The unit geometric normal, on the outer (visible) side. Normals are `f64`, since a highlight's exponent
    /// multiplies the rounding of its vectors.
    pub normal: DVec3,
    /// The unit shading normal. It differs from `normal` on smooth meshes only, and is never on the other side.
    pub shading_normal: DVec3,
    /// The texture coordinates.
    pub uv: Vec2,
    /// The part of the texture coordinates that `f32` doesn't hold, on shapes that are large relative to the distance
    /// of the hit.
    pub uv_rest: Vec2,
    /// The colour of the shape at this point (vertex or cloud colours). It replaces kd.
    pub color: Option<Rgb>,
    /// The origin of shadow rays on the outer side. Smooth meshes lift it off their facets (Hanika, *Hacking the Shadow
    /// Terminator*, Ray Tracing Gems II, ch. 4). Equal to `point` on other shapes.
    pub shadow_origin: Vec3,
}

impl Surface {
    /// A surface point whose error is the rounding to `f32` alone. Its shading normal is the geometric normal.
    #[inline(always)]
    pub fn at(exact: DVec3, normal: DVec3, uv: Vec2) -> Surface {
        let point = exact.as_vec3();
        let (error, shading_normal, shadow_origin) = (rounding(point), normal, point);
        Surface { point, exact, error, normal, shading_normal, uv, uv_rest: Vec2::ZERO, color: None, shadow_origin }
    }

    /// The surface with these texture coordinates, which `f32` holds only in part.
    #[inline(always)]
    pub(super) fn with_fine_uv(self, fine: DVec2) -> Surface {
        let uv = fine.as_vec2();
        Surface { uv, uv_rest: (fine - uv.as_dvec2()).as_vec2(), ..self }
    }

    /// The surface in the space around an instance. The bound grows by the rounding in object space, mapped outwards,
    /// since a ray from here is mapped back into that space.
    #[inline(always)]
    pub fn transformed(&self, to_world: &Transform) -> Surface {
        let m = to_world.matrix().matrix3;
        let exact = to_world.point(self.exact);
        let point = exact.as_vec3();
        let local = (self.error + rounding(self.point)).as_dvec3();
        let mapped = m.x_axis.abs() * local.x + m.y_axis.abs() * local.y + m.z_axis.abs() * local.z;
        let unit = |n: DVec3| to_world.normal(n).normalize();
        Surface {
            point,
            exact,
            error: mapped.as_vec3() + rounding(point),
            normal: unit(self.normal),
            shading_normal: unit(self.shading_normal),
            uv: self.uv,
            uv_rest: self.uv_rest,
            color: self.color,
            shadow_origin: to_world.point(self.shadow_origin.as_dvec3()).as_vec3(),
        }
    }
}
