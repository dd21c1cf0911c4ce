//! The equations of cylinders, cones and tori, which the chapter leaves as exercises, in `f64`.

use super::intersection::Intersection;
use crate::math::{DRay, quadratic, quartic};
use crate::shape::Torus;
use glam::{DVec3, Vec3};

/// The equation of a cylinder or cone between two points with a radius at each. `caps` is whether disks close it.
pub(super) fn of_frustum([base, top]: [Vec3; 2], radii: [f32; 2], caps: bool, ray: &DRay) -> Intersection {
    let (base, top, radii) = (base.as_dvec3(), top.as_dvec3(), radii.map(f64::from));
    let length = base.distance(top);
    let axis = (top - base) / length;
    let slope = (radii[1] - radii[0]) / length;
    // Height along the axis and the part across it, each linear in t.
    let from_base = ray.origin - base;
    let (y, y_change) = (from_base.dot(axis), ray.direction.dot(axis));
    let (across, across_change) = (from_base - axis * y, ray.direction - axis * y_change);
    let (radius, radius_change) = (radii[0] + slope * y, slope * y_change);
    // |across + t across_change|² = (radius + t radius_change)²
    let a = across_change.dot(across_change) - radius_change * radius_change;
    let b = 2.0 * (across.dot(across_change) - radius * radius_change);
    let c = across.dot(across) - radius * radius;
    let roots = quadratic(a, b, c);
    let cap = |y_of_cap: f64, radius: f64| {
        let t = (y_of_cap - y) / y_change;
        let is_met = caps && y_change != 0.0 && (across + across_change * t).length() <= radius;
        is_met.then_some(t)
    };
    Intersection::Frustum {
        base: base.to_array(),
        axis: axis.to_array(),
        length,
        radii,
        a,
        b,
        c,
        discriminant: b * b - 4.0 * a * c, // (5.18)
        roots,
        heights: roots.map(|roots| roots.map(|t| y + t * y_change)),
        caps: [cap(0.0, radii[0]), cap(length, radii[1])],
    }
}

/// The equation of a torus: (|p|² + R² − r²)² = 4 R² (|p|² − (p·axis)²), with p relative to the centre.
pub(super) fn of_torus(torus: &Torus, ray: &DRay) -> Intersection {
    let Torus { center, axis, radius, tube } = *torus;
    let (center, axis) = (center.as_dvec3(), axis.as_dvec3().normalize());
    let (radius, tube) = (f64::from(radius), f64::from(tube));
    let (o, d): (DVec3, DVec3) = (ray.origin - center, ray.direction);
    let (dd, od, oo) = (d.dot(d), o.dot(d), o.dot(o));
    let (da, oa) = (d.dot(axis), o.dot(axis));
    let (k, four) = (oo + radius * radius - tube * tube, 4.0 * radius * radius);
    let coefficients = [
        k * k - four * (oo - oa * oa),
        4.0 * od * k - 2.0 * four * (od - oa * da),
        4.0 * od * od + 2.0 * dd * k - four * (dd - da * da),
        4.0 * dd * od,
        dd * dd,
    ];
    // The surface lies within a ball.
    let most = radius + tube;
    let roots = quadratic(dd, 2.0 * od, oo - most * most).map(|[low, high]| quartic(coefficients, low, high));
    let roots = roots.unwrap_or_default();
    let root = |index: usize| roots.get(index).copied();
    Intersection::Torus {
        center: center.to_array(),
        axis: axis.to_array(),
        radius,
        tube,
        coefficients,
        roots: [root(0), root(1), root(2), root(3)],
    }
}
