//! The chapter's recursive ray tracing (box 5.8; Whitted 1980): `trace` finds the nearest surface, `shade` sums
//! (5.39b) there and calls `trace` for mirrors and clear bodies.
//!
//! Deviations, from `chapter-decisions`: the normal faces the viewer; a shadow ray passes clear surfaces by their
//! 1 − o; beyond the critical angle the reflected ray inside carries 1 − o. Products and sums that overflow stay at the
//! largest number ([`Rgb::saturated`]), so that no colour is ever infinite or NaN.

use super::{LightTerm, Probe, RayCounts, RayKind};
use crate::light::Source;
use crate::material::{MaterialPoint, on_the_side, reflect, refract, visible_facet};
use crate::math::{Line, Rgb, Spread, offset_origin};
use crate::sampler::{Dimension, Sample, Sampler};
use crate::scene::{IntegratorSettings, Stage};
use crate::shape::Surface;
use crate::world::{Blocker, Hit, World};
use canaletto_bvh::Ray;
use glam::{DMat3, DVec3};

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
    /// Rays until it is asked again.
    patience: u32,
    /// What stood in each light's way last.
    blockers: Vec<Blocker>,
    /// Where random numbers come from.
    sample: Sample,
    /// When it is, from the shutter's opening at 0 to its closing at 1.
    time: f32,
    /// The world's lights at that time; empty if none of them moves.
    lights: Vec<Source>,
}

/// How many rays from the eye and child rays are followed before somebody is asked whether they are still wanted.
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
    /// How often it went on past a surface that is there in part.
    passed: u32,
    /// What keeps random numbers here apart from those elsewhere in the tree.
    place: Dimension,
}

/// Uses of random numbers at a hit.
mod uses {
    /// The facets of rough surfaces, and the rays from there.
    pub(super) const MIRROR_FACET: u32 = 1;
    pub(super) const CLEAR_FACET: u32 = 2;
    pub(super) const REFLECTED: u32 = 3;
    pub(super) const REFRACTED: u32 = 4;
    pub(super) const PASSED: u32 = 5;
    pub(super) const EYE: u32 = 6;
    /// The first light; each has a use of its own.
    pub(super) const LIGHTS: u32 = 8;
}

/// How often a ray and its children go on past surfaces that are there in part.
const MAX_PASSED: u32 = 64;

/// The most holes that a ray goes through; beyond them it meets what is around the next one.
const MAX_HOLES: usize = 1 << 16;

/// The nearest thing that a ray met.
struct Met {
    hit: Hit,
    surface: Surface,
    material: MaterialPoint,
    /// The ray's line, which starts anew behind holes.
    line: Line,
    footprint: Option<Footprint>,
}

/// How far from here neighbouring samples are.
#[derive(Clone, Copy)]
struct Footprint {
    /// The spread of the ray that arrived.
    spread: Spread,
    /// The ways along the surface to where the neighbours meet it.
    step: [DVec3; 2],
}

impl Footprint {
    fn new(spread: Option<&Spread>, line: &Line, surface: &Surface) -> Option<Footprint> {
        spread.map(|spread| Footprint { spread: *spread, step: spread.along(line, surface.exact, surface.normal) })
    }
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
    footprint: Option<&'a Footprint>,
    /// How the shading normal changes along the surface; zero where nothing asks.
    bend: DMat3,
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
            sample: Sampler::new(0, 0, [0; 2]).sample(0, 1),
            time: 0.0,
            lights: if world.lights_move() { world.lights.clone() } else { Vec::new() },
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

    /// Begins a sample of a pixel: where random numbers come from until the next one, and when it is, from the shutter's
    /// opening at 0 to its closing at 1.
    pub fn begin(&mut self, sample: Sample, time: f32) {
        self.sample = sample;
        if time != self.time {
            self.time = time;
            self.world.move_lights(&mut self.lights, time);
        }
    }

    /// The colour that an eye ray brings. `spread` is how it changes to the neighbouring samples, if the world
    /// [wants](World::wants_spread) to know.
    pub fn eye<P: Probe>(&mut self, line: impl Into<Line>, spread: Option<&Spread>, probe: &mut P) -> Rgb {
        let line = line.into();
        self.ask();
        let place = Dimension::EYE.of(uses::EYE);
        let branch = Branch { kind: RayKind::Eye, depth: 1, factor: Rgb::WHITE, weight: Rgb::WHITE, passed: 0, place };
        self.trace(&line.rounded(), line, spread, branch, probe)
    }

    /// Box 5.8, `trace`: the colour of the nearest surface, or the background.
    fn trace<P: Probe>(
        &mut self,
        ray: &Ray,
        line: Line,
        spread: Option<&Spread>,
        branch: Branch,
        probe: &mut P,
    ) -> Rgb {
        probe.ray(branch.kind, ray, branch.depth, branch.factor);
        self.counts.of_mut(branch.kind).traced += 1;
        let Some(met) = self.meet(ray, line, spread, probe) else {
            let color = self.background(line.direction, spread, probe);
            probe.miss(color);
            probe.end(color);
            return color;
        };
        let Met { hit, surface, material, line, footprint } = &met;
        self.counts.of_mut(branch.kind).hit += 1;
        let outside = line.direction.dot(surface.normal) < 0.0;
        let side = if outside { 1.0 } else { -1.0 };
        probe.hit(hit, surface, material, outside);
        let bends = footprint.is_some() && (material.is_mirror() || material.is_clear());
        let shading = Shading {
            surface,
            material,
            wo: -line.direction.normalize(),
            facing: surface.normal * side,
            normal: surface.shading_normal * side,
            outside,
            footprint: footprint.as_ref(),
            bend: if bends { self.world.patch(*line, hit).bend * side } else { DMat3::ZERO },
        };
        let (print, share) = material.print;
        // Under an opaque print nothing is seen of the rest.
        let mut color = if share < 1.0 { self.shade(&shading, branch, probe) } else { Rgb::BLACK };
        if share > 0.0 {
            probe.print(print, share);
            color = (print * share + color * (1.0 - share)).saturated();
        }
        if material.coverage < 1.0 {
            color = self.past(color, &shading, branch, probe);
        }
        probe.end(color);
        color
    }

    /// The nearest surface on the way, past holes.
    fn meet<P: Probe>(&self, ray: &Ray, line: Line, spread: Option<&Spread>, probe: &mut P) -> Option<Met> {
        let hit = self.world.intersect_at(ray, f32::INFINITY, self.time)?;
        let surface = self.world.surface(line, &hit);
        let material = self.world.material(&hit);
        if !material.textures.is_empty() {
            return self.meet_textured(line, hit, surface, spread, probe);
        }
        let footprint = Footprint::new(spread, &line, &surface);
        Some(Met { hit, surface, material: material.at(&surface), line, footprint })
    }

    #[inline(never)]
    fn meet_textured<P: Probe>(
        &self,
        mut line: Line,
        mut hit: Hit,
        mut surface: Surface,
        spread: Option<&Spread>,
        probe: &mut P,
    ) -> Option<Met> {
        let mut spread = spread.copied();
        for holes in 0.. {
            let footprint = Footprint::new(spread.as_ref(), &line, &surface);
            let step = footprint.map(|f| f.step);
            let material = self.world.textured(line, &hit, &mut surface, step, probe);
            if material.coverage > 0.0 || holes == MAX_HOLES {
                return Some(Met { hit, surface, material, line, footprint });
            }
            probe.hole(&hit);
            line.origin = surface.exact;
            spread = footprint.map(|f| f.spread.passed(f.step));
            let origin = offset_origin(surface.point, surface.error, surface.normal, line.direction);
            hit = self.world.intersect_at(&line.from_origin(origin), f32::INFINITY, self.time)?;
            surface = self.world.surface(line, &hit);
        }
        None
    }

    /// The colour of a surface that is there in part only, and of what is behind it.
    fn past<P: Probe>(&mut self, color: Rgb, at: &Shading, branch: Branch, probe: &mut P) -> Rgb {
        let coverage = at.material.coverage;
        probe.coverage(coverage);
        let color = color * coverage;
        let factor = Rgb::gray(1.0 - coverage);
        // The way goes on as if nothing were there: it is no deeper than before.
        let above = Branch { depth: branch.depth - 1, ..branch };
        if branch.passed == MAX_PASSED {
            probe.cut(RayKind::Passed, factor);
            return color;
        }
        let Some(child) = self.child(above, RayKind::Passed, factor, probe) else { return color };
        let child = Branch { passed: branch.passed + 1, ..child };
        let line = leave(at, -at.wo);
        let spread = at.footprint.map(|f| f.spread.passed(f.step));
        let behind = self.trace(&start(at, line), line, spread.as_ref(), child, probe) * factor;
        (color + behind.saturated()).saturated()
    }

    /// What a ray in this direction sees where it meets nothing.
    fn background<P: Probe>(&self, direction: DVec3, spread: Option<&Spread>, probe: &mut P) -> Rgb {
        let Some(environment) = &self.world.environment else { return self.world.background };
        let sighting = environment.look(direction, spread.map_or([DVec3::ZERO; 2], |spread| spread.direction));
        probe.sighting(&sighting);
        sighting.radiance
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
                let term = self.light(at, mirrored, branch.place, index as u32, point, probe);
                color = (color + term.contribution).saturated();
                probe.light(&term);
            }
        }
        if stage >= Stage::Reflection && at.material.is_mirror() {
            let kind = RayKind::Reflected;
            if let Some(child) = self.child(branch, kind, phong.k, probe) {
                let direction = match self.facet(at, branch.place, uses::MIRROR_FACET) {
                    None => above(mirrored, at),
                    Some(facet) => {
                        probe.lobe(phong.roughness, facet);
                        on_the_side(reflect(at.wo, facet), at.facing)
                    }
                };
                let line = leave(at, direction);
                let spread = spread_above(mirrored, at);
                color += (self.trace(&start(at, line), line, spread.as_ref(), child, probe) * phong.k).saturated();
            }
        }
        if stage >= Stage::Full && at.material.is_clear() {
            let factor = Rgb::gray(1.0 - phong.opacity);
            let eta = f64::from(phong.eta);
            let eta_ratio = if at.outside { 1.0 / eta } else { eta };
            let facet = self.facet(at, branch.place, uses::CLEAR_FACET);
            let (kind, direction) = match (refract(at.wo, facet.unwrap_or(at.normal), eta_ratio), facet) {
                (Some(direction), None) => (RayKind::Refracted, below(direction, at, eta_ratio)),
                (Some(direction), Some(_)) => (RayKind::Refracted, on_the_side(direction, -at.facing)),
                (None, None) => (RayKind::TotallyReflected, above(mirrored, at)),
                (None, Some(facet)) => (RayKind::TotallyReflected, on_the_side(reflect(at.wo, facet), at.facing)),
            };
            if let Some(child) = self.child(branch, kind, factor, probe) {
                if let Some(facet) = facet {
                    probe.lobe(phong.roughness, facet);
                }
                let spread = match kind {
                    RayKind::Refracted => spread_below(at, eta_ratio),
                    _ => spread_above(mirrored, at),
                };
                let line = leave(at, direction);
                color += (self.trace(&start(at, line), line, spread.as_ref(), child, probe) * factor).saturated();
            }
        }
        color.saturated()
    }

    /// The normal of the facet that a ray leaves, chosen at random, if the surface is rough.
    fn facet(&self, at: &Shading, place: Dimension, use_of: u32) -> Option<DVec3> {
        let roughness = at.material.phong.roughness;
        if roughness == 0.0 {
            return None;
        }
        let normal = if at.wo.dot(at.normal) > 0.0 { at.normal } else { at.facing };
        Some(visible_facet(at.wo, normal, f64::from(roughness), self.sample.two(place.of(use_of))))
    }

    /// One point of one light: (5.39a)'s summand.
    fn light<P: Probe>(
        &mut self,
        at: &Shading,
        mirrored: DVec3,
        place: Dimension,
        light: u32,
        point: u32,
        probe: &mut P,
    ) -> LightTerm {
        let phong = &at.material.phong;
        let source = self.lights.get(light as usize).unwrap_or(&self.world.lights[light as usize]);
        let arriving = if source.is_sampled() {
            let u = self.sample.two_of(place.of(uses::LIGHTS + light), point, source.points());
            source.sample(u, at.surface.exact)
        } else {
            source.illuminate(point, at.surface.exact)
        };
        let n_dot_l = at.normal.dot(arriving.direction) as f32;
        let mut term = LightTerm {
            light,
            point,
            sampled: if source.is_sampled() { arriving.position } else { None },
            direction: arriving.direction.as_vec3(),
            distance: arriving.distance,
            intensity: arriving.intensity,
            n_dot_l,
            behind: false,
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
        if at.material.bent && at.facing.dot(arriving.direction) <= 0.0 {
            term.behind = true;
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
            let spread =
                at.footprint.map(|f| Spread::to_light(f.step, arriving.direction, f64::from(arriving.distance)));
            let last = &mut self.blockers[light as usize];
            let ray = Ray { origin, direction };
            term.f_s = self.world.transmittance(&ray, t_max, self.time, spread.as_ref(), last, probe);
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
        self.ask();
        let weight = (parent.weight * factor).saturated();
        if self.gave_up || parent.depth >= self.settings.max_depth || weight.max_component() < self.settings.min_weight
        {
            probe.cut(kind, factor);
            return None;
        }
        let place = parent.place.of(match kind {
            RayKind::Eye => uses::EYE,
            RayKind::Reflected => uses::REFLECTED,
            RayKind::Refracted | RayKind::TotallyReflected => uses::REFRACTED,
            RayKind::Passed => uses::PASSED,
        });
        Some(Branch { kind, depth: parent.depth + 1, factor, weight, place, ..parent })
    }

    /// Asks now and then whether to give up.
    #[inline]
    fn ask(&mut self) {
        self.patience -= 1;
        if self.patience == 0 {
            self.patience = PATIENCE;
            self.gave_up |= self.cancelled.is_some_and(|cancelled| cancelled(self.counts.total()));
        }
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

/// How the ray that [`above`] gives spreads.
fn spread_above(mirrored: DVec3, at: &Shading) -> Option<Spread> {
    let stays = mirrored.dot(at.facing) > 0.0;
    let (normal, bend) = if stays { (at.normal, at.bend) } else { (at.facing, DMat3::ZERO) };
    at.footprint.map(|f| f.spread.reflected(f.step, -at.wo, normal, &bend))
}

/// How the ray that [`below`] gives spreads.
fn spread_below(at: &Shading, eta_ratio: f64) -> Option<Spread> {
    let footprint = at.footprint?;
    let stays = refract(at.wo, at.normal, eta_ratio).is_some_and(|direction| direction.dot(at.facing) < 0.0);
    let (normal, bend) = if stays { (at.normal, at.bend) } else { (at.facing, DMat3::ZERO) };
    Some(footprint.spread.refracted(footprint.step, -at.wo, normal, &bend, eta_ratio))
}
