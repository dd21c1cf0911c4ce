//! The chapter's recursive ray tracing (box 5.8; Whitted 1980): `trace` finds the nearest surface, `shade` sums
//! (5.39b) there and calls `trace` for mirrors and clear bodies.
//!
//! Deviations, from `chapter-decisions`: the normal faces the viewer; a shadow ray passes clear surfaces by their
//! 1 − o; beyond the critical angle the reflected ray inside carries 1 − o. Products and sums that overflow stay at the
//! largest number ([`Rgb::saturated`]), so that no colour is ever infinite or NaN.

use super::{LightTerm, Probe, RayCounts, RayKind};
use crate::material::{MaterialPoint, reflect, refract};
use crate::math::{Line, Rgb, offset_origin};
use crate::scene::{IntegratorSettings, Stage};
use crate::shape::Surface;
use crate::world::{Blocker, World};
use canaletto_bvh::Ray;
use glam::DVec3;

/// The classic integrator on one world.
pub struct Whitted<'w> {
    world: &'w World,
    settings: IntegratorSettings,
    /// The rays traced so far.
    pub counts: RayCounts,
    /// Asked now and then whether to give up.
    cancelled: Option<&'w (dyn Fn(u64) -> bool + Sync)>,
    /// Whether it said so: from then on no child ray is followed, and colours are worth nothing.
    gave_up: bool,
    /// Child rays until it is asked again.
    patience: u32,
    /// What stood in each light's way last.
    blockers: Vec<Blocker>,
}

/// How many child rays are followed before somebody is asked whether they are still wanted.
const PATIENCE: u32 = 4096;

/// Where a ray stands in the ray tree.
#[derive(Clone, Copy)]
struct Branch {
    kind: RayKind,
    depth: u32,
    /// What the ray's colour is multiplied with in its parent.
    factor: Rgb,
    /// The product of all factors from the eye.
    weight: Rgb,
}

/// A hit as seen by the ray that made it.
struct Shading<'a> {
    surface: &'a Surface,
    material: &'a MaterialPoint,
    /// v̂, towards where the ray came from.
    wo: DVec3,
    /// The unit geometric normal on the viewer's side.
    facing: DVec3,
    /// The unit shading normal on the viewer's side.
    normal: DVec3,
    /// Whether the ray came from the outer side.
    outside: bool,
}

impl<'w> Whitted<'w> {
    /// An integrator that has traced nothing yet.
    pub fn new(world: &'w World, settings: IntegratorSettings) -> Whitted<'w> {
        Whitted {
            world,
            settings,
            counts: RayCounts::default(),
            cancelled: None,
            gave_up: false,
            patience: PATIENCE,
            blockers: vec![Blocker::NONE; world.lights.len()],
        }
    }

    /// The same integrator, which asks now and then, with the rays traced so far, whether to give up: a single pixel between mirrors and clear bodies
    /// can take longer than anybody waits, since every level of its tree may double the rays.
    pub fn until(self, cancelled: &'w (dyn Fn(u64) -> bool + Sync)) -> Whitted<'w> {
        Whitted { cancelled: Some(cancelled), ..self }
    }

    /// Whether it gave up. The colours that it returned since are worth nothing.
    pub fn gave_up(&self) -> bool {
        self.gave_up
    }

    /// The world it traces.
    pub fn world(&self) -> &'w World {
        self.world
    }

    /// The colour that an eye ray brings.
    pub fn eye<P: Probe>(&mut self, line: impl Into<Line>, probe: &mut P) -> Rgb {
        let line = line.into();
        self.trace(
            &line.rounded(),
            line,
            Branch { kind: RayKind::Eye, depth: 1, factor: Rgb::WHITE, weight: Rgb::WHITE },
            probe,
        )
    }

    /// Box 5.8, `trace`: the colour of the nearest surface, or the background.
    fn trace<P: Probe>(&mut self, ray: &Ray, line: Line, branch: Branch, probe: &mut P) -> Rgb {
        probe.ray(branch.kind, ray, branch.depth, branch.factor);
        let count = self.counts.of_mut(branch.kind);
        count.traced += 1;
        let Some(hit) = self.world.intersect(ray, f32::INFINITY) else {
            probe.miss(self.world.background);
            probe.end(self.world.background);
            return self.world.background;
        };
        count.hit += 1;
        let surface = self.world.surface(line, &hit);
        let material = self.world.material(&hit).at(&surface);
        let outside = line.direction.dot(surface.normal) < 0.0;
        let side = if outside { 1.0 } else { -1.0 };
        probe.hit(&hit, &surface, &material, outside);
        let shading = Shading {
            surface: &surface,
            material: &material,
            wo: -line.direction.normalize(),
            facing: surface.normal * side,
            normal: surface.shading_normal * side,
            outside,
        };
        let color = self.shade(&shading, branch, probe);
        probe.end(color);
        color
    }

    /// Box 5.8, `shade`: (5.39b), as far as the stage goes.
    fn shade<P: Probe>(&mut self, at: &Shading, branch: Branch, probe: &mut P) -> Rgb {
        let stage = self.settings.stage;
        let phong = &at.material.phong;
        if stage == Stage::Unlit {
            probe.unlit(phong.kd);
            return phong.kd;
        }
        let mut color = Rgb::BLACK;
        if stage >= Stage::Ambient {
            let ambient = (self.world.ambient * phong.kd).saturated(); // (5.33)
            probe.ambient(ambient);
            color += ambient;
        }
        let mirrored = reflect(at.wo, at.normal); // (5.37)
        for (index, light) in self.world.lights.iter().enumerate() {
            for point in 0..light.points() {
                let term = self.light(at, mirrored, index as u32, point, probe);
                color = (color + term.contribution).saturated();
                probe.light(&term);
            }
        }
        if stage >= Stage::Reflection && at.material.is_mirror() {
            let kind = RayKind::Reflected;
            if let Some(child) = self.child(branch, kind, phong.k, probe) {
                let line = leave(at, above(mirrored, at));
                color += (self.trace(&start(at, line), line, child, probe) * phong.k).saturated();
            }
        }
        if stage >= Stage::Full && at.material.is_clear() {
            let factor = Rgb::gray(1.0 - phong.opacity);
            let eta = f64::from(phong.eta);
            let eta_ratio = if at.outside { 1.0 / eta } else { eta };
            let (kind, direction) = match refract(at.wo, at.normal, eta_ratio) {
                Some(direction) => (RayKind::Refracted, below(direction, at, eta_ratio)),
                None => (RayKind::TotallyReflected, above(mirrored, at)),
            };
            if let Some(child) = self.child(branch, kind, factor, probe) {
                let line = leave(at, direction);
                color += (self.trace(&start(at, line), line, child, probe) * factor).saturated();
            }
        }
        color.saturated()
    }

    /// One point of one light: (5.39a)'s summand.
    fn light<P: Probe>(&mut self, at: &Shading, mirrored: DVec3, light: u32, point: u32, probe: &mut P) -> LightTerm {
        let phong = &at.material.phong;
        let source = &self.world.lights[light as usize];
        let arriving = source.illuminate(point, at.surface.exact);
        let n_dot_l = at.normal.dot(arriving.direction) as f32;
        let mut term = LightTerm {
            light,
            point,
            direction: arriving.direction.as_vec3(),
            distance: arriving.distance,
            intensity: arriving.intensity,
            n_dot_l,
            r_dot_l: mirrored.dot(arriving.direction) as f32,
            f_s: 0.0,
            diffuse: Rgb::BLACK,
            specular: Rgb::BLACK,
            contribution: Rgb::BLACK,
        };
        // NaN: a light exactly at the point, which adds nothing.
        if n_dot_l.is_nan() || n_dot_l <= 0.0 || arriving.intensity.is_black() {
            return term;
        }
        let stage = self.settings.stage;
        term.diffuse = at.material.diffuse(arriving.intensity, n_dot_l); // (5.32b)
        term.f_s = 1.0;
        if stage >= Stage::Shadow && self.settings.shadows && source.light.shadows {
            let start = if at.outside { at.surface.lifted } else { at.surface.point };
            let origin = offset_origin(start, at.surface.error, at.facing, at.facing);
            // Towards a point the ray ends there, at t = 1; towards infinity it has no end.
            let (direction, t_max) = match arriving.position {
                Some(position) => (position - origin, 1.0 - f32::EPSILON),
                None => (arriving.direction.as_vec3(), f32::INFINITY),
            };
            term.f_s =
                self.world.transmittance(&Ray { origin, direction }, t_max, &mut self.blockers[light as usize], probe);
            self.counts.shadow.traced += 1;
            self.counts.shadow.hit += u64::from(term.f_s == 0.0);
        }
        // In shadow a highlight is black, and only a probe wants to know more.
        if (P::ACTIVE || term.f_s > 0.0) && stage >= Stage::Specular && !phong.ks.is_black() {
            let lit = (arriving.intensity * phong.ks).saturated();
            term.specular = lit * phong.highlight(term.r_dot_l); // (5.38)
        }
        term.contribution = (term.diffuse + term.specular).saturated() * term.f_s; // (5.39a)
        term
    }

    /// The branch of a child ray, unless depth or weight ends the tree here.
    fn child<P: Probe>(&mut self, parent: Branch, kind: RayKind, factor: Rgb, probe: &mut P) -> Option<Branch> {
        self.patience -= 1;
        if self.patience == 0 {
            self.patience = PATIENCE;
            self.gave_up |= self.cancelled.is_some_and(|cancelled| cancelled(self.counts.total()));
        }
        let weight = (parent.weight * factor).saturated();
        if self.gave_up || parent.depth >= self.settings.max_depth || weight.max_component() < self.settings.min_weight
        {
            probe.cut(kind, factor);
            return None;
        }
        Some(Branch { kind, depth: parent.depth + 1, factor, weight })
    }
}

/// The line of a ray that leaves the surface.
fn leave(at: &Shading, direction: DVec3) -> Line {
    Line { origin: at.surface.exact, direction }
}

/// Its ray, the origin moved off the surface by the error bound.
fn start(at: &Shading, line: Line) -> Ray {
    line.from_origin(offset_origin(at.surface.point, at.surface.error, at.surface.normal, line.direction))
}

/// A mirrored direction that stays above the surface: where an interpolated normal would send it below, the geometric
/// normal mirrors instead.
fn above(direction: DVec3, at: &Shading) -> DVec3 {
    if direction.dot(at.facing) > 0.0 { direction } else { reflect(at.wo, at.facing) }
}

/// A refracted direction that goes below the surface, likewise.
fn below(direction: DVec3, at: &Shading, eta_ratio: f64) -> DVec3 {
    if direction.dot(at.facing) < 0.0 { direction } else { refract(at.wo, at.facing, eta_ratio).unwrap_or(-at.facing) }
}
