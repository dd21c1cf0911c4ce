//! The difference of two trees of rays, term by term: each difference of a term belongs to one cause.
//!
//! Colours are sums of products of terms. The difference of a product is split as a b − a′ b′ = (a − a′) b′ + a (b −
//! b′), so that all parts sum to the whole difference.

use super::Cause;
use super::pixel::wide;
use crate::camera::Camera;
use crate::explain::{HitNode, LightNode, Outcome, PixelTree, RayNode, SampleNode};
use crate::integrator::RayKind;
use crate::material::Phong;
use glam::DVec3;

/// Where a difference arises.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Subject<'t> {
    /// The object that the reference sees, and the one that the other method shows.
    pub(super) object: Option<&'t str>,
    pub(super) other_object: Option<&'t str>,
    pub(super) light: Option<&'t str>,
}

/// The parts of a pixel's difference, one for each cause of a term, in linear light.
#[derive(Clone, Debug, Default)]
pub(super) struct TermDifferences<'t> {
    sums: [DVec3; Cause::OF_TERMS],
    /// The largest difference added for each cause, with its subject.
    largest: [(f64, Subject<'t>); Cause::OF_TERMS],
}

const CAUSES: [Cause; Cause::OF_TERMS] = [
    Cause::NearFar,
    Cause::Edge,
    Cause::Tessellation,
    Cause::Sampling,
    Cause::TextureFilter,
    Cause::Shadow,
    Cause::Mirror,
    Cause::Refraction,
    Cause::IndirectLight,
];

impl<'t> TermDifferences<'t> {
    fn add(&mut self, cause: Cause, difference: DVec3, subject: Subject<'t>) {
        let index = cause as usize;
        self.sums[index] += difference;
        let size = difference.abs().max_element();
        if size > self.largest[index].0 {
            self.largest[index] = (size, subject);
        }
    }

    /// Adds the difference of two whole pixels.
    pub(super) fn add_pixel(&mut self, cause: Cause, difference: DVec3, [tree, other]: [&'t PixelTree; 2]) {
        let first = |tree: &'t PixelTree| tree.samples.first().and_then(|sample| name(&sample.ray));
        let subject = Subject { object: first(tree), other_object: first(other), light: None };
        self.add(cause, difference, subject);
    }

    /// The parts that aren't zero.
    pub(super) fn causes(&self) -> impl Iterator<Item = (Cause, DVec3)> {
        CAUSES.into_iter().zip(self.sums).filter(|(_, sum)| *sum != DVec3::ZERO)
    }

    /// The place where most of a cause's difference arises.
    pub(super) fn subject(&self, cause: Cause) -> Option<Subject<'t>> {
        self.largest.get(cause as usize).filter(|(size, _)| *size > 0.0).map(|(_, subject)| *subject)
    }
}

fn hit_of(ray: &RayNode) -> Option<&HitNode> {
    if let Outcome::Hit(hit) = &ray.outcome { Some(hit) } else { None }
}

fn name(ray: &RayNode) -> Option<&str> {
    hit_of(ray).map(|hit| &*hit.object)
}

/// A surface in a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SeenSurface {
    object: u32,
    primitive: u32,
    /// The normal of flat faces, which have edges in between.
    normal: [f32; 3],
    pub(super) is_textured: bool,
}

/// The surfaces that camera rays of these trees see. The background is one.
pub(super) fn surfaces(trees: [&PixelTree; 2]) -> Vec<SeenSurface> {
    let mut all: Vec<SeenSurface> = Vec::new();
    for sample in trees.into_iter().flat_map(|tree| &tree.samples) {
        let surface = match hit_of(&sample.ray) {
            None => SeenSurface { object: 0, primitive: 0, normal: [0.0; 3], is_textured: false },
            Some(hit) => SeenSurface {
                object: hit.object_id,
                primitive: if hit.kind == "mesh" { 0 } else { hit.primitive },
                normal: if hit.kind == "box" { hit.normal } else { [0.0; 3] },
                is_textured: !hit.textures.is_empty(),
            },
        };
        if !all.contains(&surface) {
            all.push(surface);
        }
    }
    all
}

/// A comparison of the trees of two methods, whose samples have common places.
pub(super) struct Comparison<'a> {
    /// The camera in the scene's coordinates.
    pub(super) camera: &'a Camera,
    /// The distance in pixels between a curved surface and the triangles that the other method draws for it.
    pub(super) tolerance: f64,
}

impl Comparison<'_> {
    /// Adds the differences of two trees.
    pub(super) fn compare<'t>(&self, [reference, other]: [&'t PixelTree; 2], terms: &mut TermDifferences<'t>) {
        let total: f64 = other.samples.iter().map(|sample| sample.weight).sum();
        // A single sample is the pixel, whatever its weight.
        let share = |sample: &SampleNode| if other.samples.len() == 1 { 1.0 } else { sample.weight / total };
        let is_raster = other.samples.iter().any(|sample| sample.raster.is_some());
        for (index, sample) in other.samples.iter().enumerate() {
            let partner = if is_raster {
                reference.samples.iter().find(|own| own.position == sample.position)
            } else {
                reference.samples.get(index)
            };
            let Some(partner) = partner else { continue };
            self.sample([partner, sample], share(sample), terms);
        }
    }

    fn sample<'t>(&self, [own, other]: [&'t SampleNode; 2], weight: f64, terms: &mut TermDifferences<'t>) {
        let weight = DVec3::splat(weight);
        let subject = Subject { object: name(&own.ray), other_object: name(&other.ray), light: None };
        let whole = || weight * (wide(other.ray.color) - wide(own.ray.color));
        let is_raster = other.raster.is_some();
        if let Some(hit) = hit_of(&own.ray).filter(|_| is_raster) {
            if self.is_outside_planes(hit) {
                return terms.add(Cause::NearFar, whole(), subject);
            }
            // A rasteriser shows what lies behind a surface that is covered by less than a half.
            let behind = hit.behind.as_ref().and_then(hit_of);
            let shown = hit_of(&other.ray);
            if hit.coverage.is_some() && shown.map(|hit| hit.object_id) != Some(hit.object_id) {
                let is_behind = behind.map(|hit| hit.object_id) == shown.map(|hit| hit.object_id);
                return terms.add(if is_behind { Cause::Refraction } else { Cause::Edge }, whole(), subject);
            }
        }
        self.ray([&own.ray, &other.ray], weight, terms);
    }

    /// Whether a camera ray's hit lies in front of the near plane or beyond the far plane.
    fn is_outside_planes(&self, hit: &HitNode) -> bool {
        let camera = self.camera.at(0.0);
        let z = -(DVec3::from_array(hit.point) - camera.eye()).dot(camera.axes()[2]);
        !camera.is_between_planes(z)
    }

    fn ray<'t>(&self, [own, other]: [&'t RayNode; 2], weight: DVec3, terms: &mut TermDifferences<'t>) {
        let subject = Subject { object: name(own), other_object: name(other), light: None };
        let whole = || weight * (wide(other.color) - wide(own.color));
        match (&own.outcome, &other.outcome) {
            // Only footprints make lookups in one direction differ.
            (Outcome::Miss { .. }, Outcome::Miss { .. }) => terms.add(Cause::TextureFilter, whole(), subject),
            (Outcome::Hit(a), Outcome::Hit(b)) if self.is_one_surface([own, other], [a, b]) => {
                self.hit([a, b], [own, other], weight, subject, terms);
            }
            _ => terms.add(Cause::Edge, whole(), subject),
        }
    }

    /// Whether two hits lie on one smooth surface. The points on triangles that stand for a curved surface are as near
    /// to it as their tolerance.
    fn is_one_surface(&self, [own, other]: [&RayNode; 2], [a, b]: [&HitNode; 2]) -> bool {
        if a.object_id != b.object_id || a.side != b.side || (a.kind != "mesh" && a.primitive != b.primitive) {
            return false;
        }
        let vector = |v: [f32; 3]| DVec3::from_array(v.map(f64::from));
        let cosine = vector(a.normal).dot(vector(b.normal));
        // Corners and centres of triangles are shaded in place of the point itself.
        if own.direction != other.direction {
            return true;
        }
        if matches!(a.kind, "mesh" | "box" | "triangle" | "disk" | "plane") {
            return a.normal == b.normal || cosine > 1.0 - 1e-5;
        }
        let [a_point, b_point] = [a.point, b.point].map(DVec3::from_array);
        let distance = (b_point - a_point).dot(vector(a.normal)).abs();
        // Faces that meet at the rim of a cap have normals farther apart than this.
        cosine > 0.5 && distance <= 2.0 * (self.tolerance + 1.0) * self.pixel_width(a_point)
    }

    /// The width of a pixel at a point's distance.
    fn pixel_width(&self, point: DVec3) -> f64 {
        let camera = self.camera;
        if camera.is_orthographic() {
            return camera.window().y / f64::from(camera.size()[1]);
        }
        let z = (point - camera.eye()).dot(camera.axes()[2]).abs();
        z * camera.window().y / (camera.focal_distance() * f64::from(camera.size()[1]))
    }

    fn hit<'t>(
        &self,
        [own, other]: [&'t HitNode; 2],
        rays: [&'t RayNode; 2],
        mut weight: DVec3,
        subject: Subject<'t>,
        terms: &mut TermDifferences<'t>,
    ) {
        let colors = rays.map(|ray| wide(ray.color));
        if let (Some(a), Some(b)) = (own.unlit, other.unlit) {
            return terms.add(Cause::TextureFilter, weight * (wide(b) - wide(a)), subject);
        }
        // From the outside in: coverage, overlay, then the sum below both.
        let coverage = [own, other].map(|hit| f64::from(hit.coverage.unwrap_or(1.0)));
        let behind = [own, other].map(|hit| hit.behind.as_ref().map_or(DVec3::ZERO, light));
        let below = [0, 1].map(|i| if coverage[i] > 0.0 { (colors[i] - behind[i]) / coverage[i] } else { DVec3::ZERO });
        let cut_out = below[0] * (coverage[1] - coverage[0]) + behind[1] - behind[0];
        terms.add(Cause::Refraction, weight * cut_out, subject);
        weight *= coverage[1];
        let overlay = [own, other].map(|hit| hit.overlay.map_or((DVec3::ZERO, 0.0), |(c, s)| (wide(c), f64::from(s))));
        let sum = [sum_of(own), sum_of(other)];
        let print = overlay.map(|(color, share)| color * share);
        let overlaid = print[1] - print[0] + sum[0] * (overlay[0].1 - overlay[1].1);
        terms.add(Cause::TextureFilter, weight * overlaid, subject);
        weight *= 1.0 - overlay[1].1;

        let materials = [&own.phong, &other.phong];
        let ambient = [own, other].map(|hit| {
            let emitters = hit.emitters.as_ref().map(|emitters| emitters.contribution);
            [hit.ambient, emitters].into_iter().flatten().map(wide).sum::<DVec3>()
        });
        let of_ambient = if materials[0].kd == materials[1].kd { Cause::IndirectLight } else { Cause::TextureFilter };
        terms.add(of_ambient, weight * (ambient[1] - ambient[0]), subject);
        let emission = [own, other].map(|hit| hit.emission.map_or(DVec3::ZERO, wide));
        terms.add(Cause::TextureFilter, weight * (emission[1] - emission[0]), subject);
        let material = (own.phong != other.phong).then_some(materials[1]);
        self.lights([own, other], weight, subject, terms, material);
        for kinds in [&[RayKind::Reflected][..], &[RayKind::Refracted, RayKind::TotallyReflected]] {
            self.children([own, other], kinds, weight, subject, terms);
        }
    }

    /// Adds the differences of direct light. `material` is the other method's, if it differs.
    fn lights<'t>(
        &self,
        [own, other]: [&'t HitNode; 2],
        weight: DVec3,
        subject: Subject<'t>,
        terms: &mut TermDifferences<'t>,
        material: Option<&Phong>,
    ) {
        let is_same = |a: &LightNode, b: &LightNode| a.light == b.light && a.point == b.point;
        for (index, a) in own.lights.iter().enumerate() {
            let subject = Subject { light: Some(&a.light), ..subject };
            let b = other.lights.get(index).filter(|b| is_same(a, b));
            let Some(b) = b.or_else(|| other.lights.iter().find(|b| is_same(a, b))) else {
                // The other method takes this light from a solution for all surfaces.
                terms.add(Cause::IndirectLight, -weight * wide(a.contribution), subject);
                continue;
            };
            let unshadowed = [a, b].map(|light| wide(light.diffuse) + wide(light.specular));
            let is_lit = |light: &LightNode| light.n_dot_l > 0.0 && !light.behind && !light.intensity.is_black();
            let share = match [is_lit(a), is_lit(b)] {
                [true, true] => [a.f_s, b.f_s].map(f64::from),
                // The share of light from behind isn't known.
                [true, false] => [f64::from(a.f_s); 2],
                _ => [f64::from(b.f_s); 2],
            };
            terms.add(Cause::Shadow, weight * unshadowed[0] * (share[1] - share[0]), subject);
            let relit = material.map_or(unshadowed[0], |material| relit(a, material));
            terms.add(Cause::TextureFilter, weight * share[1] * (relit - unshadowed[0]), subject);
            if [a.n_dot_l, a.r_dot_l] != [b.n_dot_l, b.r_dot_l] || a.direction != b.direction {
                // Random points of a light are other samples.
                let cause = if a.position == b.position { Cause::Tessellation } else { Cause::Sampling };
                terms.add(cause, weight * share[1] * (unshadowed[1] - relit), subject);
            }
        }
        for b in other.lights.iter().filter(|b| !own.lights.iter().any(|a| is_same(a, b))) {
            terms.add(
                Cause::IndirectLight,
                weight * wide(b.contribution),
                Subject { light: Some(&b.light), ..subject },
            );
        }
    }

    /// Adds the differences of child rays of these kinds.
    fn children<'t>(
        &self,
        [own, other]: [&'t HitNode; 2],
        kinds: &[RayKind],
        weight: DVec3,
        subject: Subject<'t>,
        terms: &mut TermDifferences<'t>,
    ) {
        let cause = if kinds.contains(&RayKind::Reflected) { Cause::Mirror } else { Cause::Refraction };
        let child = |hit: &'t HitNode| hit.children.iter().find(|child| kinds.contains(&child.kind));
        match (child(own), child(other)) {
            (Some(a), Some(b)) if a.kind == b.kind => {
                let factors = [a, b].map(|child| wide(child.factor));
                terms.add(Cause::TextureFilter, weight * (factors[1] - factors[0]) * wide(a.color), subject);
                self.ray([a, b], weight * factors[1], terms);
            }
            (a, b) => {
                let [a, b] = [a, b].map(|child| child.map_or(DVec3::ZERO, light));
                terms.add(cause, weight * (b - a), subject);
            }
        }
    }
}

/// The light that a child ray adds.
fn light(child: &RayNode) -> DVec3 {
    wide(child.color) * wide(child.factor)
}

/// The sum of a hit's terms, below its overlay and coverage.
fn sum_of(hit: &HitNode) -> DVec3 {
    let emitters = hit.emitters.as_ref().map(|emitters| emitters.contribution);
    let terms = [hit.ambient, emitters, hit.emission, hit.unlit].into_iter().flatten().map(wide);
    let lights = hit.lights.iter().map(|light| wide(light.contribution));
    terms.chain(lights).chain(hit.children.iter().map(light)).sum()
}

/// The light of (5.32) and (5.38) on a surface of another material, without shadows.
fn relit(term: &LightNode, material: &Phong) -> DVec3 {
    let intensity = wide(term.intensity);
    let diffuse = intensity * wide(material.kd) * f64::from(term.n_dot_l.max(0.0));
    if term.specular.is_black() {
        return diffuse;
    }
    diffuse + intensity * wide(material.ks) * libm::pow(f64::from(term.r_dot_l.max(0.0)), f64::from(material.n))
}
