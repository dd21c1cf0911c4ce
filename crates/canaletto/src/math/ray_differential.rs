//! Ray differentials: the differences of a ray to the neighbouring samples of the picture (Igehy, *Tracing Ray
//! Differentials*, 1999). They give the footprint of a sample on a surface, after any number of mirrors and clear
//! bodies.
//!
//! Deviations from the paper: a ray that grazes its surface counts as one at a millionth of a radian. A direction
//! changes by no more than a few radians, so that nothing is infinite. Equations are the paper's.

use super::DRay;
use glam::{DMat3, DVec3};

/// The differences of a ray with a unit direction to the next sample to the right (index 0) and above (index 1).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RayDifferential {
    /// The differences of the origin.
    pub origin: [DVec3; 2],
    /// The differences of the unit direction.
    pub direction: [DVec3; 2],
}

/// The smallest cosine between a ray and a normal; smaller ones count as grazing.
const GRAZING: f64 = 1e-6;
/// The largest meaningful change of a unit direction.
const MAX_CHANGE: f64 = 4.0;

impl RayDifferential {
    /// The differences of the point where the ray hits a surface with this unit normal, along the surface: (10) to
    /// (12). `t` is in lengths of the unit direction.
    pub fn at(&self, direction: DVec3, t: f64, normal: DVec3) -> [DVec3; 2] {
        let slant = direction.dot(normal);
        let slant = if slant.abs() < GRAZING { GRAZING.copysign(slant) } else { slant };
        [0, 1].map(|i| {
            let across = self.origin[i] + self.direction[i] * t;
            across - direction * (across.dot(normal) / slant)
        })
    }

    /// [`RayDifferential::at`] for a line whose direction has any length.
    pub fn along(&self, line: &DRay, point: DVec3, normal: DVec3) -> [DVec3; 2] {
        let length = line.direction.length();
        let unit = line.direction / length;
        self.at(unit, (point - line.origin).dot(unit), normal)
    }

    /// The differential of the mirrored ray: (16) to (18). `incoming` is the unit direction of the arriving ray, and
    /// `point` the result of [`RayDifferential::at`]. `shape_operator` maps a step along the surface to the change of
    /// the unit normal.
    pub fn reflected(
        &self,
        point: [DVec3; 2],
        incoming: DVec3,
        normal: DVec3,
        shape_operator: &DMat3,
    ) -> RayDifferential {
        let slant = incoming.dot(normal);
        let direction = [0, 1].map(|i| {
            let turn = *shape_operator * point[i];
            let slants = self.direction[i].dot(normal) + incoming.dot(turn);
            bounded(self.direction[i] - (turn * slant + normal * slants) * 2.0)
        });
        RayDifferential { origin: point, direction }
    }

    /// The differential of the refracted ray: (19) to (22), for the ratio ηᵢ/ηₜ and a normal on the side of the
    /// arriving ray. Where there is no refracted ray, it is the differential of a ray along the surface.
    pub fn refracted(
        &self,
        point: [DVec3; 2],
        incoming: DVec3,
        normal: DVec3,
        shape_operator: &DMat3,
        eta_ratio: f64,
    ) -> RayDifferential {
        let slant = incoming.dot(normal);
        let leaving = -(1.0 - eta_ratio * eta_ratio * (1.0 - slant * slant)).max(GRAZING * GRAZING).sqrt();
        let mu = eta_ratio * slant - leaving;
        let direction = [0, 1].map(|i| {
            let turn = *shape_operator * point[i];
            let slants = self.direction[i].dot(normal) + incoming.dot(turn);
            let mus = (eta_ratio - eta_ratio * eta_ratio * slant / leaving) * slants;
            bounded(self.direction[i] * eta_ratio - turn * mu - normal * mus)
        });
        RayDifferential { origin: point, direction }
    }

    /// The differential of the ray that continues straight from the point.
    pub fn passed(&self, point: [DVec3; 2]) -> RayDifferential {
        RayDifferential { origin: point, direction: self.direction }
    }

    /// The differential of the rays from the point to a light at this distance in this unit direction.
    pub fn to_light(point: [DVec3; 2], direction: DVec3, distance: f64) -> RayDifferential {
        let turn = |p: DVec3| bounded((direction * direction.dot(p) - p) / distance);
        RayDifferential { origin: point, direction: point.map(turn) }
    }
}

fn bounded(direction: DVec3) -> DVec3 {
    direction.clamp_length_max(MAX_CHANGE)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn on_a_plane_it_is_the_difference_of_neighbours() {
        let (eye, normal) = (DVec3::new(0.3, 2.0, 0.1), DVec3::new(0.2, 1.0, -0.1).normalize());
        let ray = |x: f64, y: f64| DVec3::new(x, -0.7 + y, 1.0).normalize();
        let meet = |d: DVec3| eye + d * (-eye.dot(normal) / d.dot(normal));
        let step = 1e-6;
        let unit = ray(0.0, 0.0);
        let change = |to: DVec3| (to - unit) / step;
        let differential =
            RayDifferential { origin: [DVec3::ZERO; 2], direction: [change(ray(step, 0.0)), change(ray(0.0, step))] };
        let point = meet(unit);
        let found = differential.along(&DRay { origin: eye, direction: unit * 3.0 }, point, normal);
        for (found, neighbour) in found.into_iter().zip([ray(step, 0.0), ray(0.0, step)]) {
            let expected = (meet(neighbour) - point) / step;
            assert!((found - expected).length() < 1e-4 * expected.length(), "{found} instead of {expected}");
        }
    }

    #[test]
    fn grazing_rays_and_the_critical_angle_stay_finite() {
        let differential = RayDifferential { origin: [DVec3::X; 2], direction: [DVec3::Y * 0.1, DVec3::Z] };
        let point = differential.at(DVec3::X, 1e30, DVec3::Y);
        assert!(point.iter().all(|p| p.is_finite()));
        let shape_operator = DMat3::IDENTITY * 1e9;
        for incoming in [DVec3::X, DVec3::NEG_Y, DVec3::new(0.6, -0.8, 0.0)] {
            let children = [
                differential.reflected(point, incoming, DVec3::Y, &shape_operator),
                differential.refracted(point, incoming, DVec3::Y, &shape_operator, 1.25),
            ];
            for child in children {
                assert!(child.direction.iter().all(|d| d.is_finite() && d.length() <= 4.1), "{child:?}");
            }
        }
    }
}
