//! Parts of cylinders, cones and disks: those between two half-planes through the axis.
//!
//! Angles are counted as u of (5.45a) counts them, so that a texture stays where it is on the whole shape. Parts bound
//! no volume. They are surfaces with two sides, as open cylinders are.

use super::frustum::Frustum;
use super::solve::{self, Frame};
use super::{Cone, Cylinder, Disk, ShapeHit, Surface, SurfaceDifferential};
use crate::OutOfRange;
use crate::math::{DRay, Transform};
use canaletto_bvh::{Aabb, Ray};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// A shape that is round about an axis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Round {
    /// The side of a cylinder.
    Cylinder(Cylinder),
    /// The side of a cone.
    Cone(Cone),
    /// A disk.
    Disk(Disk),
}

/// The part of a round shape between two angles.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Partial {
    /// The whole shape; without caps.
    pub whole: Round,
    /// The angle at which the part begins, in degrees from where u = 0, towards larger u; 0 to 360.
    pub start: f32,
    /// The angle of the part in degrees, more than 0 and less than 360.
    pub angle: f32,
}

impl Round {
    /// The body of a cylinder or cone.
    fn frustum(&self) -> Option<Frustum> {
        match self {
            Round::Cylinder(c) => Some(Frustum::new(c.base, c.top, c.radius, c.radius, false)),
            Round::Cone(c) => Some(Frustum::new(c.base, c.top, c.radius, c.top_radius, false)),
            Round::Disk(_) => None,
        }
    }

    /// The frame in which u of (5.45a) is counted.
    pub(super) fn frame(&self) -> Frame {
        Frame::around(self.axis())
    }

    /// The axis, of any length.
    pub(super) fn axis(&self) -> DVec3 {
        match self {
            Round::Cylinder(Cylinder { base, top, .. }) | Round::Cone(Cone { base, top, .. }) => {
                top.as_dvec3() - base.as_dvec3()
            }
            Round::Disk(disk) => disk.normal.as_dvec3(),
        }
    }

    /// The circles at both ends, each by its centre and its radius: those of a disk are its centre and its rim.
    pub(super) fn ends(&self) -> [(DVec3, f64); 2] {
        match self {
            Round::Cylinder(c) => [c.base, c.top].map(|p| (p.as_dvec3(), f64::from(c.radius))),
            Round::Cone(c) => [(c.base.as_dvec3(), f64::from(c.radius)), (c.top.as_dvec3(), f64::from(c.top_radius))],
            Round::Disk(d) => [(d.center.as_dvec3(), 0.0), (d.center.as_dvec3(), f64::from(d.radius))],
        }
    }
}

impl Partial {
    /// Whether the part holds a direction from the axis, whose components are along the frame's `x` and `z`.
    fn holds(&self, x: f64, z: f64) -> bool {
        let from_start = solve::turn(x, z) - f64::from(self.start) / 360.0;
        let turns = from_start - from_start.floor();
        // A direction at the start may round to a whole turn.
        turns <= f64::from(self.angle) / 360.0
    }

    fn holds_point(&self, frame: &Frame, from_center: DVec3) -> bool {
        self.holds(from_center.dot(frame.x), from_center.dot(frame.z))
    }

    /// The direction from the axis at a fraction of the part's angle.
    pub(super) fn out(&self, frame: &Frame, fraction: f64) -> DVec3 {
        let (sin, cos) = libm::sincos(TAU * (self.u(fraction) - 0.5));
        frame.x * sin + frame.z * cos
    }

    /// u at a fraction of the part's angle; it may be over 1.
    pub(super) fn u(&self, fraction: f64) -> f64 {
        (f64::from(self.start) + f64::from(self.angle) * fraction) / 360.0
    }

    /// The part of a whole turn.
    pub(super) fn share(&self) -> f64 {
        f64::from(self.angle) / 360.0
    }

    /// The nearest hit with t in (0, t_max].
    pub fn intersect(&self, ray: &Ray, t_max: f32) -> Option<ShapeHit> {
        let frame = self.whole.frame();
        match (&self.whole, self.whole.frustum()) {
            (_, Some(frustum)) => frustum.intersect_side(ray, t_max, |from_base| self.holds_point(&frame, from_base)),
            (Round::Disk(disk), _) => {
                let hit = disk.intersect(ray, t_max)?;
                self.holds_point(&frame, disk.offset(ray)).then_some(hit)
            }
            _ => None,
        }
    }

    /// The surface at a hit.
    pub fn surface(&self, line: impl Into<DRay>, hit: &ShapeHit) -> Surface {
        let line = line.into();
        match (&self.whole, self.whole.frustum()) {
            (Round::Disk(disk), _) => disk.surface(line, hit),
            (_, Some(frustum)) => frustum.surface(line, hit),
            _ => Surface::at(DVec3::ZERO, DVec3::Z, glam::Vec2::ZERO),
        }
    }

    /// The surface differential at a hit with this surface.
    pub fn surface_differential(&self, surface: &Surface, hit: &ShapeHit) -> SurfaceDifferential {
        match &self.whole {
            Round::Cylinder(c) => c.surface_differential(surface, hit),
            Round::Cone(c) => c.surface_differential(surface, hit),
            Round::Disk(d) => d.surface_differential(),
        }
    }

    /// The box around the part.
    pub fn bounds(&self) -> Aabb {
        let frame = self.whole.frame();
        let mut outs = vec![self.out(&frame, 0.0), self.out(&frame, 1.0)];
        // Where the circle is farthest along an axis of space.
        for axis in DVec3::AXES {
            let (x, z) = (axis.dot(frame.x), axis.dot(frame.z));
            let length = libm::hypot(x, z);
            for (x, z) in [(x, z), (-x, -z)] {
                if length > 0.0 && self.holds(x, z) {
                    outs.push((frame.x * x + frame.z * z) / length);
                }
            }
        }
        let ends = self.whole.ends();
        let points = ends.into_iter().flat_map(|(center, radius)| outs.iter().map(move |out| center + *out * radius));
        let size = ends.iter().map(|(center, radius)| center.abs().max_element() + radius).sum();
        let (min, max) = points.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(min, max), p| (min.min(p), max.max(p)));
        // The hit at the end of an arc may lie beyond it by its rounding.
        solve::bounds((min + max) * 0.5, (max - min) * 0.5, size)
    }
}

impl Partial {
    /// The part moved by a transform, if it stays round and its angles are counted from the same place.
    pub(super) fn transformed(&self, t: &Transform) -> Option<Partial> {
        let whole = match &self.whole {
            Round::Cylinder(c) => Round::Cylinder(c.transformed(t)?),
            Round::Cone(c) => Round::Cone(c.transformed(t)?),
            Round::Disk(d) => Round::Disk(d.transformed(t)?),
        };
        self.whole.frame().goes_to(t, &whole.frame()).then_some(Partial { whole, ..*self })
    }

    pub(super) fn check(&self) -> Result<(), OutOfRange> {
        match &self.whole {
            Round::Cylinder(c) => c.check()?,
            Round::Cone(c) => c.check()?,
            Round::Disk(d) => d.check()?,
        }
        let caps = match &self.whole {
            Round::Cylinder(Cylinder { caps, .. }) | Round::Cone(Cone { caps, .. }) => *caps,
            Round::Disk(_) => false,
        };
        if caps {
            let help = "is #true, but a part with angle has no caps; disks with the same angle close its ends";
            return Err(OutOfRange::new("caps", help));
        }
        if !(self.start >= 0.0 && self.start <= 360.0) {
            return Err(OutOfRange::new("start-angle", format!("is {}; it must be 0 to 360 degrees", self.start)));
        }
        if !(self.angle > 0.0 && self.angle <= 360.0) {
            let problem = format!("is {}; it must be more than 0 and at most 360 degrees", self.angle);
            return Err(OutOfRange::new("angle", problem));
        }
        Ok(())
    }

    /// The name of the whole shape's kind.
    pub(super) fn kind(&self) -> &'static str {
        match &self.whole {
            Round::Cylinder(_) => "cylinder",
            Round::Cone(_) => "cone",
            Round::Disk(_) => "disk",
        }
    }

    /// Whether the part is flat.
    pub(crate) fn is_flat(&self) -> bool {
        matches!(self.whole, Round::Disk(_))
    }

    /// The part with other radii.
    pub(super) fn with_radii(&self, larger: impl Fn(f32) -> f32) -> Partial {
        let whole = match self.whole {
            Round::Cylinder(c) => Round::Cylinder(Cylinder { radius: larger(c.radius), ..c }),
            Round::Cone(c) => Round::Cone(Cone { radius: larger(c.radius), top_radius: larger(c.top_radius), ..c }),
            Round::Disk(d) => Round::Disk(Disk { radius: larger(d.radius), ..d }),
        };
        Partial { whole, ..*self }
    }
}
