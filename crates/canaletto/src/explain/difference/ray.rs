//! Camera, rays and hits in step.

use super::TermValue;
use super::walk::{UNKNOWN, Walk, exact, vector, wide, word};
use crate::explain::number::{Digits, Number};
use crate::explain::tree::{HitNode, Outcome, PixelTree, RayNode, SampleNode, Side, TextureNode, has_primitives};
use crate::integrator::{RasterNode, RayKind};
use crate::light::environment::EnvironmentLookup;
use crate::material::Parameter;
use crate::math::Rgb;
use glam::DVec3;

impl<'t> Walk<'t> {
    /// Compares the cameras of two trees.
    pub(super) fn camera(&mut self, trees: [&PixelTree; 2]) {
        self.numbers("size of the picture", None, [&trees[0].size.map(f64::from), &trees[1].size.map(f64::from)]);
        let [Some(a), Some(b)] = trees.map(|tree| tree.camera) else { return };
        self.below(Some("camera".into()), |walk| {
            walk.numbers("eye", None, [&a.eye, &b.eye]);
            for (index, name) in ["x_e", "y_e", "z_e"].into_iter().enumerate() {
                walk.numbers(name, Some("5.3"), [&a.axes[index], &b.axes[index]]);
            }
            walk.number("d_f", Some("5.2"), [a.d_f, b.d_f]);
            walk.number("height", Some("5.2"), [a.height, b.height]);
            walk.number("base", Some("5.2"), [a.base, b.base]);
        });
    }

    /// Compares samples, whose share in the pixel is given.
    pub(super) fn sample(&mut self, [a, b]: [&'t SampleNode; 2], share: f64) {
        if self.is_one_ray {
            self.numbers("place in the picture", Some("5.10"), [&a.position, &b.position]);
            self.number("weight", None, [a.weight, b.weight]);
            let time = |sample: &SampleNode| sample.time.map_or(TermValue::None, TermValue::Number);
            self.term("time", None, [time(a), time(b)], || UNKNOWN);
            let lens = |sample: &SampleNode| sample.lens.map_or(TermValue::None, |v| TermValue::Numbers(v.to_vec()));
            self.term("point of the lens", None, [lens(a), lens(b)], || UNKNOWN);
            self.numbers("d", Some("5.10"), [&a.chapter_direction, &b.chapter_direction]);
        }
        if let [Some(a), Some(b)] = [&a.raster, &b.raster] {
            let name = |raster: &RasterNode| {
                raster.triangle.as_ref().map_or(TermValue::None, |triangle| word(&triangle.object))
            };
            self.term("object of the visible triangle", None, [name(a), name(b)], || UNKNOWN);
            if let ([Some(a), Some(b)], true) = ([&a.triangle, &b.triangle], self.is_one_ray) {
                self.number("primitive of the triangle", None, [a.primitive, b.primitive].map(f64::from));
                self.numbers("corners of the triangle", None, [&a.corners.concat(), &b.corners.concat()]);
                self.number("z", None, [a.z, b.z]);
            }
        }
        self.weight = DVec3::splat(share);
        self.ray([&a.ray, &b.ray]);
    }

    /// Compares rays with all that lies below them. The weight is that of B's colour in the pixel.
    pub(super) fn ray(&mut self, rays: [&'t RayNode; 2]) {
        let [a, b] = rays;
        self.below(Some(kind_name(b.kind).into()), |walk| {
            if walk.is_one_ray {
                walk.numbers("o", None, [&a.origin, &b.origin]);
                walk.term("d", None, [vector(a.direction), vector(b.direction)], || UNKNOWN);
                let facet = |ray: &RayNode| ray.lobe.map_or(TermValue::None, |lobe| vector(lobe.facet));
                walk.term("n of the microfacet", None, [facet(a), facet(b)], || UNKNOWN);
            }
            let media = |ray: &RayNode| {
                let eta = |[from, into]: [f32; 2]| TermValue::Numbers(vec![exact(from), exact(into)]);
                ray.media.map_or(TermValue::None, eta)
            };
            walk.term("eta_i and eta_t", Some("5.43"), [media(a), media(b)], || UNKNOWN);
            walk.words("surfaces of hidden bodies", [&a.hidden.join(", "), &b.hidden.join(", ")]);
            walk.words("holes", [&a.holes.join(", "), &b.holes.join(", ")]);
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
                let place = |lookup: &Option<Box<EnvironmentLookup>>| {
                    lookup.as_ref().map(|lookup| format!("the {} has the value {}", lookup.kind, spaced(lookup.value)))
                };
                self.summand(name, None, [Some(*own), Some(*other)], || [place(from), place(to)]);
            }
            [own, other] => {
                let value = |outcome: &Outcome| hit_of(outcome).map_or(word("background"), |hit| word(&hit.object));
                self.term("object", None, [value(own), value(other)], || [met([a, b]), met([b, a])].map(Some));
                let change = wide(b.color) - wide(a.color);
                self.changed_summand("colour of the ray", None, [Some(a.color), Some(b.color)], change, || UNKNOWN);
            }
        }
    }

    fn hit(&mut self, hits: [&'t HitNode; 2]) {
        let [a, b] = hits;
        self.place_of_hit(hits);
        self.words("material", [&a.material, &b.material]);
        self.textures([&a.textures, &b.textures]);
        for parameter in Parameter::ALL {
            let value = |hit: &HitNode| match parameter.get(&hit.phong).to_vec()[..] {
                [number] => TermValue::Number(exact(number)),
                ref color => TermValue::Numbers(color.iter().map(|v| exact(*v)).collect()),
            };
            let reason = |hit: &HitNode| Some(format!("material \"{}\"", hit.material));
            self.term(parameter.symbol, None, [value(a), value(b)], || [reason(a), reason(b)]);
        }
        let weight = self.weight;
        let [coverage_a, coverage_b] = hits.map(|hit| hit.coverage.unwrap_or(1.0));
        let [(overlay_a, share_a), (overlay_b, share_b)] = hits.map(|hit| hit.overlay.unwrap_or((Rgb::BLACK, 0.0)));
        self.number("coverage", None, [exact(coverage_a), exact(coverage_b)]);
        self.number("share of the overlay", None, [exact(share_a), exact(share_b)]);
        self.weight *= f64::from(coverage_b);
        let change = wide(overlay_b) * f64::from(share_b) - wide(overlay_a) * f64::from(share_a);
        let overlays = hits.map(|hit| hit.overlay.map(|(color, _)| color));
        self.changed_summand("overlay by a texture", None, overlays, change, || UNKNOWN);
        self.weight *= 1.0 - f64::from(share_b);
        self.summand("unlit colour kd", None, [a.unlit, b.unlit], || UNKNOWN);
        if let [Some(own), Some(other)] = [&a.radiosity, &b.radiosity] {
            self.radiosity([own, other]);
        }
        let light = |hit: &HitNode| {
            hit.radiosity
                .as_ref()
                .map(|light| format!("the light of the solution, {}", spaced(Rgb::from(light.light.map(|v| v as f32)))))
        };
        self.summand("ambient Ia*kd", Some("5.33"), [a.ambient, b.ambient], || [light(a), light(b)]);
        let emitters = hits.map(|hit| hit.emitters.as_ref());
        let passed = |hit: &HitNode| {
            hit.emitters.as_ref().map(|light| format!("{} of {} shadow rays pass", light.passed, light.rays))
        };
        let contributions = emitters.map(|emitters| emitters.map(|light| light.contribution));
        self.summand("emitting surfaces E*kd", None, contributions, || [passed(a), passed(b)]);
        self.summand("emission", None, [a.emission, b.emission], || UNKNOWN);
        self.lights(hits);
        for kinds in [&[RayKind::Reflected][..], &[RayKind::Refracted, RayKind::TotallyReflected]] {
            let child = |hit: &'t HitNode| hit.children.iter().find(|child| kinds.contains(&child.kind));
            self.child(kinds, [child(a), child(b)], hits);
        }
        self.weight = weight;
        self.child(&[RayKind::Passed], hits.map(|hit| hit.behind.as_ref()), hits);
    }

    /// Compares where hits are.
    fn place_of_hit(&mut self, hits: [&HitNode; 2]) {
        let [a, b] = hits;
        let side = |hit: &HitNode| word(if hit.side == Side::Outside { "outside" } else { "inside" });
        self.term("side of the surface", None, [side(a), side(b)], || UNKNOWN);
        if !self.is_one_ray {
            if a.kind == "box" {
                self.term("face, by its normal", None, [vector(a.normal), vector(b.normal)], || UNKNOWN);
            }
            return;
        }
        if has_primitives(a.kind) {
            self.number("primitive", None, [a.primitive, b.primitive].map(f64::from));
        }
        self.number("t", None, [exact(a.t), exact(b.t)]);
        self.numbers("p", None, [&a.point, &b.point]);
        self.term("geometric n", None, [vector(a.normal), vector(b.normal)], || UNKNOWN);
        let textures = hits.map(|hit| {
            let bent = hit.textures.iter().find(|texture| matches!(texture.used, "bump" | "normal"));
            bent.map(|texture| format!("bent by the texture \"{}\"", texture.texture))
        });
        self.term("n", None, [vector(a.shading_normal), vector(b.shading_normal)], || textures);
        self.term("uv", None, hits.map(|hit| TermValue::Numbers(hit.uv.map(exact).to_vec())), || UNKNOWN);
    }

    fn textures(&mut self, [a, b]: [&[TextureNode]; 2]) {
        let names = |textures: &[TextureNode]| {
            let each = textures.iter().map(|texture| format!("{} for {}", texture.texture, texture.used));
            each.collect::<Vec<_>>().join(", ")
        };
        self.words("textures", [&names(a), &names(b)]);
        for (a, b) in a.iter().zip(b) {
            self.below(Some(format!("texture \"{}\"", a.texture)), |walk| {
                let value = |texture: &TextureNode| TermValue::Numbers(texture.value.map(exact).to_vec());
                let place = |texture: &TextureNode| {
                    let [x, y] = texture.readings.first()?.image?.texel;
                    Some(format!("texel ({x:.3}, {y:.3})"))
                };
                walk.term("value", None, [value(a), value(b)], || [place(a), place(b)]);
            });
        }
    }

    /// Compares child rays of these kinds, of which a hit has one at most.
    fn child(&mut self, kinds: &[RayKind], children: [Option<&'t RayNode>; 2], hits: [&HitNode; 2]) {
        let name = kind_name(kinds[0]);
        let state = |child: Option<&RayNode>| word(child.map_or("none", |child| kind_name(child.kind)));
        self.term(name, Some("5.39b"), children.map(state), || {
            let reason = |hit: &HitNode| {
                let cut = hit.cut.iter().any(|cut| kinds.contains(&cut.kind));
                cut.then(|| "the ray isn't traced, because of max-depth or min-weight".to_owned())
            };
            hits.map(reason)
        });
        let products = children.map(|child| child.map(|child| child.color * child.factor));
        match children {
            [Some(a), Some(b)] if a.kind == b.kind => {
                let change = (wide(b.factor) - wide(a.factor)) * wide(a.color);
                let factor = if a.kind == RayKind::Reflected { "k" } else { "1 - o" };
                let term = format!("factor {factor} of the {name}");
                let reasons =
                    || products.map(|product| product.map(|product| format!("the summand is {}", spaced(product))));
                self.changed_summand(&term, Some("5.39b"), [Some(a.factor), Some(b.factor)], change, reasons);
                let weight = self.weight;
                self.weight *= wide(b.factor);
                self.ray([a, b]);
                self.weight = weight;
            }
            [None, None] => {}
            _ => self.summand(&format!("summand of the {name}"), Some("5.39b"), products, || UNKNOWN),
        }
    }
}

fn hit_of(outcome: &Outcome) -> Option<&HitNode> {
    if let Outcome::Hit(hit) = outcome { Some(hit) } else { None }
}

/// Whether hits lie on one object. Objects of two scenes are one if they have one name and one kind.
fn is_one_object([a, b]: [&HitNode; 2]) -> bool {
    a.object == b.object && a.kind == b.kind
}

/// What the first of two rays meets, and why it doesn't meet what the other one meets.
fn met([own, other]: [&RayNode; 2]) -> String {
    let meets = match &own.outcome {
        Outcome::Hit(hit) => format!("meets {} ({}) at t = {}", hit.object, hit.kind, short(hit.t)),
        Outcome::Miss { .. } => "meets nothing".to_owned(),
    };
    let Some(wanted) = hit_of(&other.outcome) else { return meets };
    let tried = own.steps.iter().flat_map(|steps| &steps.tried).find(|tried| tried.object == wanted.object);
    match tried.map(|tried| (tried.t, &tried.missed)) {
        Some((None, Some(missed))) => format!("{meets}, misses {}: {missed}", wanted.object),
        Some((Some(_), _)) => format!("{meets}, before {}", wanted.object),
        Some((None, None)) => meets,
        None => format!("{meets}; there is no {}", wanted.object),
    }
}

pub(in crate::explain) fn kind_name(kind: RayKind) -> &'static str {
    match kind {
        RayKind::Eye => "camera ray",
        RayKind::Reflected => "reflected ray",
        RayKind::Refracted => "refracted ray",
        RayKind::TotallyReflected => "totally reflected ray",
        RayKind::Scattered => "scattered ray",
        RayKind::Passed => "straight ray",
    }
}

/// A number in a reason.
pub(super) fn short(v: f32) -> String {
    Number(v, Digits::Significant(6)).to_string()
}

/// A colour in a reason.
pub(super) fn spaced(color: Rgb) -> String {
    format!("({})", color.to_array().map(short).join(", "))
}
