//! The terms of lights, of radiosity and of developing in step.

use super::TermValue;
use super::ray::{short, spaced};
use super::walk::{UNKNOWN, Walk, exact, vector, word};
use crate::explain::light_text::is_behind;
use crate::explain::number::{Digits, Number};
use crate::explain::patch::{LightSum, PlaceNode, RadiosityNode, SourceNode};
use crate::explain::patch_text::{PARTS, shown_parts};
use crate::explain::tree::{HitNode, LightNode, PixelTree};
use glam::DVec3;

impl Walk<'_> {
    /// Compares the terms of all points of all lights at two hits.
    pub(super) fn lights(&mut self, [own, other]: [&HitNode; 2]) {
        let is_same = |a: &LightNode, b: &LightNode| a.light == b.light && a.point == b.point;
        for a in &own.lights {
            let b = other.lights.iter().find(|b| is_same(a, b));
            self.below(Some(light_name(a)), |walk| match b {
                Some(b) => walk.light([a, b], [own, other]),
                None => walk.single_light([Some(a), None]),
            });
        }
        for b in other.lights.iter().filter(|b| !own.lights.iter().any(|a| is_same(a, b))) {
            self.below(Some(light_name(b)), |walk| walk.single_light([None, Some(b)]));
        }
    }

    /// Compares with nothing a light that one hit has alone.
    fn single_light(&mut self, lights: [Option<&LightNode>; 2]) {
        let state = lights.map(|light| word(if light.is_some() { "there" } else { "none" }));
        self.term("light", None, state, || UNKNOWN);
        self.summand(
            "f_s (diffuse + specular)",
            Some("5.39a"),
            lights.map(|light| light.map(|l| l.contribution)),
            || UNKNOWN,
        );
    }

    fn light(&mut self, [a, b]: [&LightNode; 2], [own, other]: [&HitNode; 2]) {
        let pair = [a, b];
        if self.is_one_ray {
            let places = || [place_of(own, a), place_of(other, b)];
            self.term("L", None, pair.map(|light| vector(light.direction)), places);
            self.number("distance", None, pair.map(|light| exact(light.distance)));
            if let [Some(own), Some(other)] = pair.map(|light| light.steps) {
                self.color("intensity of the light", None, [own.intensity, other.intensity]);
                self.number("attenuation", None, [own.attenuation, other.attenuation].map(exact));
                self.number("cone factor", None, [own.cone, other.cone].map(exact));
            }
            self.color("l", None, pair.map(|light| light.intensity));
            self.number("n.L", None, pair.map(|light| exact(light.n_dot_l)));
        }
        let side = |light: &LightNode| word(if is_behind(light) { "behind the surface" } else { "in front" });
        let cosine = |light: &LightNode| Some(format!("n.L = {}", short(light.n_dot_l)));
        self.term("side of the light", None, pair.map(side), || pair.map(cosine));
        self.term("f_s", Some("5.39a"), pair.map(|light| TermValue::Number(exact(light.f_s))), || pair.map(blocked));
        if self.is_one_ray {
            self.color("diffuse l*kd*(n.L)", Some("5.32"), pair.map(|light| light.diffuse));
            self.number("r.L", None, pair.map(|light| exact(light.r_dot_l)));
            self.color("specular l*ks*(r.L)^n", Some("5.38"), pair.map(|light| light.specular));
        }
        let reason = |light: &LightNode| {
            Some(format!(
                "n.L = {}, r.L = {}, f_s = {}, l = {}",
                short(light.n_dot_l),
                short(light.r_dot_l),
                short(light.f_s),
                spaced(light.intensity)
            ))
        };
        let contributions = pair.map(|light| Some(light.contribution));
        self.summand("f_s (diffuse + specular)", Some("5.39a"), contributions, || pair.map(reason));
    }

    /// Compares the light of a solution at two hits: the patches, the places and their sources, and the blended light.
    pub(super) fn radiosity(&mut self, lights: [&RadiosityNode; 2]) {
        if !self.is_one_ray {
            return;
        }
        let [a, b] = lights;
        self.words("part of the solution's light", [&shown_parts(a.shown), &shown_parts(b.shown)]);
        let patch = |side: usize| self.terms[side].patches.iter().find(|patch| patch.number == lights[side].patch);
        if let [Some(own), Some(other)] = [patch(0), patch(1)] {
            // The sizes and numbers of patches follow from the light, so only their light is compared.
            self.below(Some(format!("patch {}", own.number)), |walk| {
                walk.numbers("reflectance", None, [&own.reflectance, &other.reflectance]);
                walk.numbers("emission", None, [&own.emission, &other.emission]);
                walk.light_sums([own, other].map(|patch| [&patch.direct, &patch.from_emitters, &patch.indirect]));
            });
        }
        for (index, (own, other)) in a.corners.iter().zip(&b.corners).enumerate() {
            let corners = [own, other];
            let place = |side: usize| {
                let is_place = |place: &&PlaceNode| match corners[side].vertex {
                    Some(vertex) => place.vertex == Some(vertex),
                    None => place.patch == Some(lights[side].patch),
                };
                self.terms[side].places.iter().find(is_place)
            };
            let places = [place(0), place(1)];
            self.below(Some(format!("blended place {}", index + 1)), |walk| {
                walk.number("weight", None, corners.map(|corner| corner.weight));
                if let [Some(own), Some(other)] = places {
                    walk.light_sums([own, other].map(|place| [&place.direct, &place.from_emitters, &place.indirect]));
                }
                walk.numbers(PARTS[0], None, [&own.direct, &other.direct]);
                walk.numbers(PARTS[1], None, [&own.from_emitters, &other.from_emitters]);
                walk.numbers(PARTS[2], None, [&own.indirect, &other.indirect]);
            });
        }
        self.numbers("light of the solution", None, [&a.light, &b.light]);
    }

    /// Compares the three parts of light at two patches or places, source by source.
    fn light_sums(&mut self, [own, other]: [[&LightSum; 3]; 2]) {
        for (part, (a, b)) in PARTS.into_iter().zip(own.into_iter().zip(other)) {
            self.below(Some(part.to_owned()), |walk| {
                let is_same = |a: &SourceNode, b: &SourceNode| a.kind == b.kind && a.name == b.name;
                let value = |source: Option<&SourceNode>| {
                    source.map_or(TermValue::None, |source| TermValue::Numbers(source.light.to_vec()))
                };
                for own in &a.sources {
                    let other = b.sources.iter().find(|other| is_same(own, other));
                    walk.term(&format!("from {}", own.name), None, [value(Some(own)), value(other)], || UNKNOWN);
                }
                for other in b.sources.iter().filter(|other| !a.sources.iter().any(|own| is_same(own, other))) {
                    walk.term(&format!("from {}", other.name), None, [TermValue::None, value(Some(other))], || UNKNOWN);
                }
                walk.numbers("sum", None, [&a.light, &b.light]);
            });
        }
    }

    /// Compares the way from linear light to the bytes.
    pub(super) fn developed(&mut self, trees: [&PixelTree; 2]) {
        let [a, b] = trees.map(|tree| &tree.developed);
        if self.is_one_ray {
            self.color("colour of the pixel", None, trees.map(|tree| tree.color));
        }
        if let [Some(a), Some(b)] = [a.alpha, b.alpha] {
            self.number("alpha", None, [a, b].map(f64::from));
        }
        if let [Some(a), Some(b)] = [a.exposure, b.exposure] {
            self.number("exposure", None, [a, b].map(f64::from));
        }
        self.words("tone", [a.tone, b.tone]);
        self.words("transfer", [a.transfer, b.transfer]);
        if let ([Some(a), Some(b)], true) = ([a.values, b.values], self.is_one_ray) {
            if trees.iter().any(|tree| tree.developed.exposure != Some(0.0)) {
                self.color("exposed colour", None, [a.exposed, b.exposed]);
            }
            self.color("toned colour", None, [a.toned, b.toned]);
            self.color("displayed colour", None, [a.displayed, b.displayed]);
            self.numbers("bytes", None, [&a.bytes.map(f64::from), &b.bytes.map(f64::from)]);
        }
    }
}

fn light_name(light: &LightNode) -> String {
    if light.point > 0 { format!("{}, point {}", light.light, light.point) } else { light.light.clone() }
}

/// Where a light is, as seen from a hit.
fn place_of(hit: &HitNode, light: &LightNode) -> Option<String> {
    if !light.distance.is_finite() {
        return Some("the light is at infinity".into());
    }
    let towards = DVec3::from(light.direction.map(f64::from)) * f64::from(light.distance);
    let place = light.position.map_or(DVec3::from(hit.point) + towards, DVec3::from);
    // The place is known to the digits of a distance in f32.
    let unit = libm::pow(10.0, (libm::log10(place.abs().max_element().max(f64::MIN_POSITIVE))).floor() - 4.0);
    let [x, y, z] = place.to_array().map(|v| Number((v / unit).round() * unit, Digits::Significant(5)));
    Some(format!("the light is at ({x}, {y}, {z})"))
}

/// What stands between a hit and a light.
fn blocked(light: &LightNode) -> Option<String> {
    let names: Vec<&str> = light.blockers.iter().map(|blocker| blocker.object.as_str()).collect();
    Some(match names[..] {
        [] if is_behind(light) => "the light is behind the surface".into(),
        [] => "nothing blocks it".into(),
        _ if light.f_s == 0.0 => format!("blocked by {}", names.join(", ")),
        _ => format!("weakened by {}", names.join(", ")),
    })
}
