//! Cameras, rays and hits in step.

use super::walk::Walk;
use crate::explain::ray_text::kind_name;
use crate::explain::term::{Line, Term, line, summand, wide};
use crate::explain::tree::{HitNode, Outcome, PixelTree, RayNode, SampleNode};
use crate::integrator::RayKind;
use glam::DVec3;

impl<'t> Walk<'t> {
    /// Compares the cameras of two trees.
    pub(super) fn camera(&mut self, trees: [&PixelTree; 2]) {
        self.lines(trees.map(|tree| [line!("{size of the picture}", tree.size.map(f64::from))]));
        if let [Some(a), Some(b)] = trees.map(|tree| tree.camera) {
            self.below(Some("camera".into()), |walk| walk.lines([a.lines(), b.lines()]));
        }
    }

    /// Compares samples, whose share in the pixel is given.
    pub(super) fn sample(&mut self, samples: [&'t SampleNode; 2], share: f64) {
        self.lines(samples.map(SampleNode::lines));
        if let [Some(a), Some(b)] = samples.map(|sample| sample.raster.as_ref()) {
            self.lines([a.lines(true), b.lines(true)]);
        }
        self.weight = DVec3::splat(share);
        self.ray(samples.map(|sample| &sample.ray));
    }

    /// Compares rays with all that lies below them. The weight is that of B's colour in the pixel.
    pub(super) fn ray(&mut self, rays: [&'t RayNode; 2]) {
        self.below(Some(kind_name(rays[1].kind).into()), |walk| {
            walk.lines(rays.map(RayNode::lines));
            walk.outcome(rays);
        });
    }

    fn outcome(&mut self, rays: [&'t RayNode; 2]) {
        let [a, b] = rays;
        match [&a.outcome, &b.outcome] {
            [Outcome::Hit(own), Outcome::Hit(other)] if is_one_object([own, other]) => {
                self.below(Some(own.object.clone()), |walk| walk.hit([own, other]));
            }
            [
                Outcome::Miss { background: own, environment: from },
                Outcome::Miss { background: other, environment: to },
            ] => {
                let name = if from.is_some() || to.is_some() { "environment" } else { "background" };
                let sides = [(own, from), (other, to)];
                self.pair(sides.map(|(color, lookup)| {
                    Some(summand(*color).named(name).because(|| {
                        let lookup = lookup.as_ref()?;
                        Some(line!("the {} has the value {}", lookup.kind, lookup.value))
                    }))
                }));
            }
            _ => {
                let object = |ray: &'t RayNode| hit_of(ray).map_or("background", |hit| &hit.object);
                let term = |[own, other]: [&'t RayNode; 2]| {
                    Some(Term::from(object(own)).named("object").because(move || Some(met([own, other]))))
                };
                self.pair([term([a, b]), term([b, a])]);
                self.pair(rays.map(|ray| Some(summand(ray.color).named("colour of the ray"))));
            }
        }
    }

    fn hit(&mut self, hits: [&'t HitNode; 2]) {
        let [a, b] = hits;
        if !self.is_one_ray && a.kind == "box" {
            self.lines(hits.map(|hit| [line!("{face, by its normal}", hit.normal)]));
        }
        self.lines(hits.map(HitNode::surface_lines));
        let names = |hit: &HitNode| {
            let each = hit.textures.iter().map(|texture| format!("{} for {}", texture.texture, texture.used));
            each.collect::<Vec<_>>().join(", ")
        };
        self.lines(hits.map(|hit| [line!("{material}{textures}", &hit.material, names(hit))]));
        for (a, b) in a.textures.iter().zip(&b.textures) {
            let name = format!("texture \"{}\"", a.texture);
            self.below(Some(name), |walk| walk.lines([a.value_lines(), b.value_lines()]));
        }
        self.lines(hits.map(HitNode::material_lines));
        let weight = self.weight;
        self.weight *= f64::from(b.coverage.unwrap_or(1.0));
        self.lines(hits.map(HitNode::covering_lines));
        self.weight *= 1.0 - f64::from(b.overlay.map_or(0.0, |(_, share)| share));
        if let [Some(own), Some(other)] = [&a.radiosity, &b.radiosity] {
            self.radiosity([own, other]);
        }
        self.lines(hits.map(HitNode::ambient_line));
        self.lines(hits.map(HitNode::emission_lines));
        self.lights(hits);
        for kinds in [&[RayKind::Reflected][..], &[RayKind::Refracted, RayKind::TotallyReflected]] {
            let child = |hit: &'t HitNode| hit.children.iter().find(|child| kinds.contains(&child.kind));
            self.child(kinds, hits.map(child), hits);
        }
        self.weight = weight;
        self.child(&[RayKind::Passed], hits.map(|hit| hit.behind.as_ref()), hits);
    }

    /// Compares child rays of these kinds, of which a hit has one at most.
    fn child(&mut self, kinds: &[RayKind], children: [Option<&'t RayNode>; 2], hits: [&HitNode; 2]) {
        let name = kind_name(kinds[0]);
        let state = |side: usize| {
            let state = children[side].map_or("none", |child| kind_name(child.kind));
            let is_cut = move || hits[side].cut.iter().any(|cut| kinds.contains(&cut.kind));
            let cut = move || is_cut().then(|| line!("the ray isn't traced, because of max-depth or min-weight"));
            Some(Term::from(state).named(name).of("5.39b").because(cut))
        };
        self.pair([state(0), state(1)]);
        let Some((a, b)) = children[0].zip(children[1]).filter(|(a, b)| a.kind == b.kind) else {
            let product = |child: &RayNode| summand(child.color * child.factor).named(format!("summand of the {name}"));
            return self.pair(children.map(|child| Some(product(child?).of("5.39b"))));
        };
        let factor = if a.kind == RayKind::Reflected { "k" } else { "1 - o" };
        self.pair([a, b].map(|child| {
            let amount = Some(wide(child.factor) * wide(a.color));
            let term = Term { amount, ..child.factor.into() }.named(format!("factor {factor} of the {name}"));
            let product = || Some(line!("the summand is {}", child.color * child.factor));
            Some(term.of("5.39b").because(product))
        }));
        let weight = self.weight;
        self.weight *= wide(b.factor);
        self.ray([a, b]);
        self.weight = weight;
    }
}

fn hit_of(ray: &RayNode) -> Option<&HitNode> {
    if let Outcome::Hit(hit) = &ray.outcome { Some(hit) } else { None }
}

/// Whether hits lie on one object. Objects of two scenes are one if they have one name and one kind.
fn is_one_object([a, b]: [&HitNode; 2]) -> bool {
    a.object == b.object && a.kind == b.kind
}

/// What the first of two rays meets, and why it doesn't meet what the other one meets.
fn met<'t>([own, other]: [&'t RayNode; 2]) -> Line<'t> {
    let meets = match hit_of(own) {
        Some(hit) => line!("meets {} ({}) at t = {}", &hit.object, hit.kind, hit.t),
        None => line!("meets nothing"),
    };
    let Some(wanted) = hit_of(other) else { return meets };
    let tried = own.steps.iter().flat_map(|steps| &steps.tried).find(|tried| tried.object == wanted.object);
    match tried.map(|tried| (tried.t, &tried.missed)) {
        Some((None, Some(missed))) => meets.and(line!(", misses {}: {}", &wanted.object, missed)),
        Some((Some(_), _)) => meets.and(line!(", before {}", &wanted.object)),
        Some((None, None)) => meets,
        None => meets.and(line!("; there is no {}", &wanted.object)),
    }
}
