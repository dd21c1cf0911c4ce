//! The rays that go on from where others stop: mirrored, refracted, past what is there in part.

use super::media::{Bend, Crossing, NONE, SIMPLE};
use super::stop::{At, Footprint};
use super::way::{Branch, Way, Ways, uses};
use super::{Generation, Whitted};
use crate::integrator::{Probe, RayKind};
use crate::material::{on_the_side, reflect, refract, visible_facet};
use crate::math::{Rgb, Spread};
use glam::{DMat3, DVec3};

/// How often a ray and its children go on past surfaces that are there in part.
const MAX_PASSED: u32 = 64;

impl Whitted<'_> {
    /// Adds what comes along the mirrored directions.
    pub(super) fn reflect<P: Probe>(&mut self, generation: &mut Generation, probe: &mut P) {
        self.follow(generation, probe, |whitted, ways, at, footprint, probe| {
            if !at.stop.is_seen() || !at.stop.material.is_mirror() {
                return None;
            }
            let phong = &at.stop.material.phong;
            let branch = whitted.child(whitted.parent(at, ways), RayKind::Reflected, phong.k, probe)?;
            let meets = whitted.media.crossing(at.stop.crossing).map_or(NONE, |c| c.back);
            let branch = Branch { inside: whitted.inside(at), meets, ..branch };
            let direction = match facet(at, ways, uses::MIRROR_FACET) {
                None => above(at.mirrored(), at),
                Some(facet) => {
                    probe.lobe(phong.roughness, facet);
                    on_the_side(reflect(at.wo(), facet), at.facing())
                }
            };
            Some(onwards(at, ways, branch, direction, spread_above(at, footprint)))
        });
    }

    /// Adds what comes through clear bodies.
    pub(super) fn refract<P: Probe>(&mut self, generation: &mut Generation, probe: &mut P) {
        self.follow(generation, probe, |whitted, ways, at, footprint, probe| {
            if !at.stop.is_seen() || !at.stop.material.is_clear() {
                return None;
            }
            let phong = &at.stop.material.phong;
            let Crossing { bend, beyond, next, back, .. } = match at.stop.crossing {
                SIMPLE => whitted.media.simple(whitted.world, &at.stop.hit, at.outside(), at.stop.inside),
                crossing => *whitted.media.crossing(crossing)?,
            };
            let transmitted = Rgb::gray(1.0 - phong.opacity);
            let Bend::Outer(outer) = bend else {
                let branch = whitted.child(whitted.parent(at, ways), RayKind::Refracted, transmitted, probe)?;
                let branch = Branch { inside: beyond, meets: next, ..branch };
                let spread = footprint.map(|f| f.spread.passed(f.step));
                return Some(onwards(at, ways, branch, -at.wo(), spread));
            };
            let eta = f64::from(phong.eta);
            let [from, into] = if at.outside() { [outer, eta] } else { [eta, outer] };
            let eta_ratio = from / into;
            let facet = facet(at, ways, uses::CLEAR_FACET);
            let (kind, direction) = match (refract(at.wo(), facet.unwrap_or(at.normal()), eta_ratio), facet) {
                (Some(direction), None) => (RayKind::Refracted, below(direction, at, eta_ratio)),
                (Some(direction), Some(_)) => (RayKind::Refracted, on_the_side(direction, -at.facing())),
                (None, None) => (RayKind::TotallyReflected, above(at.mirrored(), at)),
                (None, Some(facet)) => (RayKind::TotallyReflected, on_the_side(reflect(at.wo(), facet), at.facing())),
            };
            let branch = whitted.child(whitted.parent(at, ways), kind, transmitted, probe)?;
            let branch = if kind == RayKind::Refracted {
                probe.bent(from, into);
                Branch { inside: beyond, meets: next, ..branch }
            } else {
                Branch { inside: whitted.inside(at), meets: back, ..branch }
            };
            if let Some(facet) = facet {
                probe.lobe(phong.roughness, facet);
            }
            let spread = match kind {
                RayKind::Refracted => spread_below(at, footprint, eta_ratio),
                _ => spread_above(at, footprint),
            };
            Some(onwards(at, ways, branch, direction, spread))
        });
    }

    /// The colours of surfaces that are there in part only, and of what is behind them.
    pub(super) fn pass<P: Probe>(&mut self, generation: &mut Generation, probe: &mut P) {
        let mut any = false;
        for stop in generation.stops.each_mut().iter_mut().filter(|stop| stop.material.coverage < 1.0) {
            probe.coverage(stop.material.coverage);
            stop.color *= stop.material.coverage;
            any = true;
        }
        if !any {
            return;
        }
        self.follow(generation, probe, |whitted, ways, at, footprint, probe| {
            if at.stop.material.coverage >= 1.0 {
                return None;
            }
            let factor = Rgb::gray(1.0 - at.stop.material.coverage);
            let parent = whitted.parent(at, ways);
            if parent.passed == MAX_PASSED {
                probe.cut(RayKind::Passed, factor);
                return None;
            }
            // The way goes on as if nothing were there: it is no deeper than before.
            let parent = Branch { depth: parent.depth - 1, ..parent };
            let branch = whitted.child(parent, RayKind::Passed, factor, probe)?;
            let branch = match whitted.media.crossing(at.stop.crossing) {
                Some(crossing) => Branch { inside: crossing.beyond, meets: crossing.next, ..branch },
                None => branch,
            };
            let branch = Branch { passed: branch.passed + 1, ..branch };
            let spread = footprint.map(|f| f.spread.passed(f.step));
            Some(onwards(at, ways, branch, -at.wo(), spread))
        });
        for stop in generation.stops.each_mut().iter_mut().filter(|stop| stop.material.coverage < 1.0) {
            stop.color = stop.color.saturated();
        }
    }

    /// Traces the ways that `child` finds at some of the stops, and adds what they bring to the stops' colours.
    fn follow<P: Probe>(
        &mut self,
        generation: &mut Generation,
        probe: &mut P,
        child: impl Fn(&mut Self, &Ways, &At, Option<&Footprint>, &mut P) -> Option<Way>,
    ) {
        let mut children = self.generation();
        let mark = self.media.mark();
        for index in 0..generation.stops.len() {
            let at = generation.stops.at(index);
            if let Some(way) = child(self, &generation.ways, &at, generation.footprints.get(index), probe) {
                children.ways.push(way);
                children.parents.push(index as u32);
            }
        }
        if !children.ways.is_empty() {
            self.trace(&mut children, probe);
            for (way, (color, &parent)) in children.colors.iter().zip(&children.parents).enumerate() {
                generation.stops.each_mut()[parent as usize].color +=
                    (*color * children.ways.branch(way).factor).saturated();
            }
        }
        self.spare.push(children);
        self.media.release(mark);
    }

    /// The branch of the way that stops here, in the bodies that it is in now; a child of it meets nothing at once.
    fn parent(&self, at: &At, ways: &Ways) -> Branch {
        Branch { inside: at.stop.inside, meets: NONE, ..ways.branch(at.stop.way()) }
    }

    /// The bodies that a ray is in that stays on its side of the surface.
    fn inside(&mut self, at: &At) -> u32 {
        match at.stop.crossing {
            SIMPLE => self.media.simple_inside(self.world, &at.stop.hit, at.outside(), at.stop.inside),
            _ => at.stop.inside,
        }
    }

    /// The branch of a child ray, unless depth or weight ends the tree here.
    fn child<P: Probe>(&mut self, parent: Branch, kind: RayKind, factor: Rgb, probe: &mut P) -> Option<Branch> {
        self.ask(1);
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
}

/// The way of a child ray.
fn onwards(at: &At, ways: &Ways, branch: Branch, direction: DVec3, spread: Option<Spread>) -> Way {
    let line = at.leave(direction);
    Way { ray: at.start(&line), line, branch, sample: *ways.sample(at.stop.way()), spread }
}

/// The normal of the facet that a ray leaves, chosen at random, if the surface is rough.
fn facet(at: &At, ways: &Ways, use_of: u32) -> Option<DVec3> {
    let roughness = at.stop.material.phong.roughness;
    if roughness == 0.0 {
        return None;
    }
    let normal = if at.wo().dot(at.normal()) > 0.0 { at.normal() } else { at.facing() };
    let place = ways.branch(at.stop.way()).place.of(use_of);
    Some(visible_facet(at.wo(), normal, f64::from(roughness), ways.sample(at.stop.way()).two(place)))
}

/// A mirrored direction that stays above the surface: where an interpolated normal would send it below, the geometric
/// normal mirrors instead.
fn above(direction: DVec3, at: &At) -> DVec3 {
    if direction.dot(at.facing()) > 0.0 { direction } else { reflect(at.wo(), at.facing()) }
}

/// A refracted direction that goes below the surface, likewise.
fn below(direction: DVec3, at: &At, eta_ratio: f64) -> DVec3 {
    if direction.dot(at.facing()) < 0.0 {
        direction
    } else {
        refract(at.wo(), at.facing(), eta_ratio).unwrap_or(-at.facing())
    }
}

/// How the ray that [`above`] gives spreads.
fn spread_above(at: &At, footprint: Option<&Footprint>) -> Option<Spread> {
    let footprint = footprint?;
    let stays = at.mirrored().dot(at.facing()) > 0.0;
    let (normal, bend) = if stays { (at.normal(), footprint.bend) } else { (at.facing(), DMat3::ZERO) };
    Some(footprint.spread.reflected(footprint.step, -at.wo(), normal, &bend))
}

/// How the ray that [`below`] gives spreads.
fn spread_below(at: &At, footprint: Option<&Footprint>, eta_ratio: f64) -> Option<Spread> {
    let footprint = footprint?;
    let stays = refract(at.wo(), at.normal(), eta_ratio).is_some_and(|direction| direction.dot(at.facing()) < 0.0);
    let (normal, bend) = if stays { (at.normal(), footprint.bend) } else { (at.facing(), DMat3::ZERO) };
    Some(footprint.spread.refracted(footprint.step, -at.wo(), normal, &bend, eta_ratio))
}
