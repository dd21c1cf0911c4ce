//! Bounds of the light that leaves a light or a cluster of lights: where it starts, and which way it goes.

use glam::DVec3;
use std::f64::consts::{FRAC_PI_2, PI};

/// Bounds of a light, or of several.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in super::super) struct ClusterBounds {
    pub(in super::super) min: DVec3,
    pub(in super::super) max: DVec3,
    pub(in super::super) normals: NormalCone,
    /// The largest angle between a normal and a direction of emission, in radians.
    pub(in super::super) emission_angle: f64,
    /// Whether as much light leaves against the normals.
    pub(in super::super) two_sided: bool,
    /// The irradiance of a surface that faces the light, times the divisor of the tree's
    /// [falloff](super::Falloff).
    pub(in super::super) intensity: f64,
}

/// A cone around normals.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in super::super) struct NormalCone {
    /// The unit axis.
    pub(in super::super) axis: DVec3,
    /// The half angle in radians; π for all directions.
    pub(in super::super) angle: f64,
}

impl NormalCone {
    /// All directions.
    pub(in super::super) const ALL: NormalCone = NormalCone { axis: DVec3::Z, angle: PI };

    /// The smallest cone around both (pbrt-v4, 3.8.4).
    fn union(self, other: NormalCone) -> NormalCone {
        let (wide, narrow) = if self.angle >= other.angle { (self, other) } else { (other, self) };
        let cross = wide.axis.cross(narrow.axis);
        let between = libm::atan2(cross.length(), wide.axis.dot(narrow.axis));
        if between + narrow.angle <= wide.angle {
            return wide;
        }
        let angle = 0.5 * (wide.angle + between + narrow.angle);
        match cross.try_normalize() {
            Some(across) if angle < PI => {
                let (sin, cos) = libm::sincos(angle - wide.angle);
                NormalCone { axis: (wide.axis * cos + across.cross(wide.axis) * sin).normalize(), angle }
            }
            _ => NormalCone::ALL,
        }
    }
}

impl ClusterBounds {
    /// The bounds of no light.
    pub(super) const NONE: ClusterBounds = ClusterBounds {
        min: DVec3::INFINITY,
        max: DVec3::NEG_INFINITY,
        normals: NormalCone { axis: DVec3::Z, angle: 0.0 },
        emission_angle: 0.0,
        two_sided: false,
        intensity: 0.0,
    };

    /// The bounds of both.
    pub(super) fn union(self, other: ClusterBounds) -> ClusterBounds {
        if self.intensity == 0.0 {
            return other;
        }
        if other.intensity == 0.0 {
            return self;
        }
        ClusterBounds {
            min: self.min.min(other.min),
            max: self.max.max(other.max),
            normals: self.normals.union(other.normals),
            emission_angle: self.emission_angle.max(other.emission_angle),
            two_sided: self.two_sided || other.two_sided,
            intensity: self.intensity + other.intensity,
        }
    }

    pub(super) fn center(&self) -> DVec3 {
        0.5 * (self.min + self.max)
    }

    /// The orientation measure M_Ω of Conty & Kulla: the solid angle of the directions of emission, weighted by the
    /// cosine to the cone of normals.
    fn orientation(&self) -> f64 {
        let o = self.normals.angle;
        let w = (o + self.emission_angle).min(PI);
        let (sin, cos) = libm::sincos(o);
        let one_side =
            2.0 * PI * (1.0 - cos) + FRAC_PI_2 * (2.0 * w * sin - libm::cos(o - 2.0 * w) - 2.0 * o * sin + cos);
        if self.two_sided { (2.0 * one_side).min(4.0 * PI) } else { one_side }
    }

    /// What a cluster costs: intensity, extent and orientation. The extent is the squared diagonal of its box. Its
    /// surface would be 0 for lights in a row.
    pub(super) fn cost(&self) -> f64 {
        if self.intensity == 0.0 {
            0.0
        } else {
            self.intensity * (self.max - self.min).length_squared() * self.orientation()
        }
    }
}
