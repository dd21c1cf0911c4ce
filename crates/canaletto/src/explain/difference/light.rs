//! Lights and the light of radiosity in step.

use super::walk::Walk;
use crate::explain::patch::{CornerNode, LightSum, PatchNode, PlaceNode, RadiosityNode};
use crate::explain::patch_text::PARTS;
use crate::explain::term::{Term, line};
use crate::explain::tree::{HitNode, LightNode};

impl Walk<'_> {
    /// Compares all points of all lights at two hits.
    pub(super) fn lights(&mut self, [own, other]: [&HitNode; 2]) {
        let is_same = |a: &LightNode, b: &LightNode| a.light == b.light && a.point == b.point;
        for a in &own.lights {
            let b = other.lights.iter().find(|b| is_same(a, b));
            self.light([Some((a, own)), b.map(|b| (b, other))], a);
        }
        for b in other.lights.iter().filter(|b| !own.lights.iter().any(|a| is_same(a, b))) {
            self.light([None, Some((b, other))], b);
        }
    }

    /// Compares a light at two hits, or with nothing.
    fn light(&mut self, lights: [Option<(&LightNode, &HitNode)>; 2], named: &LightNode) {
        let point = if named.point > 0 { format!(", point {}", named.point) } else { String::new() };
        self.below(Some(format!("{}{point}", named.light)), |walk| {
            if lights.contains(&None) {
                let state = |is_there: bool| Term::from(if is_there { "there" } else { "none" }).named("light");
                walk.pair(lights.map(|light| Some(state(light.is_some()))));
            }
            walk.lines(lights.map(|light| light.map_or_else(Vec::new, |(light, hit)| light.lines(hit))));
        });
    }

    /// Compares the light of a solution at two hits: the patches, the places and their sources, and the blended light.
    pub(super) fn radiosity(&mut self, lights: [&RadiosityNode; 2]) {
        if !self.is_one_ray {
            return;
        }
        let ([a, b], terms) = (lights, self.terms);
        self.lines(lights.map(|light| [line!("{part of the solution's light}", light.shown_parts())]));
        if let (Some(own), Some(other)) = (terms[0].patch(a.patch), terms[1].patch(b.patch)) {
            // The sizes and numbers of patches follow from the light, so only their light is compared.
            self.below(Some(format!("patch {}", own.number)), |walk| {
                walk.lines([own, other].map(|patch| [patch.balance_line()]));
                walk.sums([own, other].map(PatchNode::sums));
            });
        }
        for (index, (own, other)) in a.corners.iter().zip(&b.corners).enumerate() {
            let places = [terms[0].place(a, own), terms[1].place(b, other)];
            self.below(Some(format!("blended place {}", index + 1)), |walk| {
                walk.lines([own, other].map(|corner| [line!("{weight}", corner.weight)]));
                if let [Some((_, own)), Some((_, other))] = places {
                    walk.sums([own, other].map(PlaceNode::sums));
                }
                walk.lines([own, other].map(CornerNode::lines));
            });
        }
        self.lines(lights.map(|light| [line!("{light of the solution}", light.light)]));
    }

    /// Compares the three parts of light at two patches or places, source by source.
    fn sums(&mut self, [own, other]: [[&LightSum; 3]; 2]) {
        for (part, (a, b)) in PARTS.into_iter().zip(own.into_iter().zip(other)) {
            self.below(Some(part.to_owned()), |walk| walk.lines([a.lines(part), b.lines(part)]));
        }
    }
}
