//! Numbers of what an integrator did.

use super::RayKind;
use serde::Serialize;
use std::ops::AddAssign;

/// The numbers of rays of one kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct RayCount {
    /// Rays traced.
    pub traced: u64,
    /// Rays with a hit; of shadow rays, those whose light was blocked entirely.
    pub hit: u64,
}

/// The numbers of rays by kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct RayCounts {
    /// Camera rays, from the eye through a pixel.
    pub eye: RayCount,
    /// Mirrored rays, total internal reflection included.
    pub reflected: RayCount,
    /// Rays refracted into or out of a clear body.
    pub refracted: RayCount,
    /// Rays of paths, in random directions from matte and glossy surfaces.
    pub scattered: RayCount,
    /// Rays that go straight on through a surface of partial coverage.
    pub passed: RayCount,
    /// Shadow rays, from a surface to a light.
    pub shadow: RayCount,
}

impl RayCounts {
    /// The number of all rays traced.
    pub fn total(&self) -> u64 {
        let RayCounts { eye, reflected, refracted, scattered, passed, shadow } = self;
        [eye, reflected, refracted, scattered, passed, shadow].iter().map(|count| count.traced).sum()
    }

    pub(crate) fn of_mut(&mut self, kind: RayKind) -> &mut RayCount {
        match kind {
            RayKind::Eye => &mut self.eye,
            RayKind::Reflected | RayKind::TotallyReflected => &mut self.reflected,
            RayKind::Refracted => &mut self.refracted,
            RayKind::Scattered => &mut self.scattered,
            RayKind::Passed => &mut self.passed,
        }
    }
}

impl AddAssign for RayCounts {
    fn add_assign(&mut self, o: RayCounts) {
        for (a, b) in [
            (&mut self.eye, o.eye),
            (&mut self.reflected, o.reflected),
            (&mut self.refracted, o.refracted),
            (&mut self.scattered, o.scattered),
            (&mut self.passed, o.passed),
            (&mut self.shadow, o.shadow),
        ] {
            a.traced += b.traced;
            a.hit += b.hit;
        }
    }
}

/// What an integrator counted.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Counts {
    /// The rays by kind.
    pub rays: RayCounts,
    /// Other numbers, each with its name.
    pub others: Vec<(&'static str, u64)>,
    /// What the picture falls short of, in words, with what helps.
    pub warnings: Vec<String>,
}

impl From<RayCounts> for Counts {
    fn from(rays: RayCounts) -> Counts {
        Counts { rays, ..Counts::default() }
    }
}

impl AddAssign for Counts {
    fn add_assign(&mut self, o: Counts) {
        self.rays += o.rays;
        self.warnings.extend(o.warnings);
        for (name, n) in o.others {
            match self.others.iter_mut().find(|(own, _)| *own == name) {
                Some((_, sum)) => *sum += n,
                None => self.others.push((name, n)),
            }
        }
    }
}
