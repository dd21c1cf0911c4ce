//! Origins of coordinates.
//!
//! Rays and surfaces are `f32`, which holds 24 bits: at 4,000,000 its steps are a quarter. Objects far from zero
//! therefore have coordinates relative to a nearby origin, and their transforms add the origin in `f64`. Each mesh and
//! cloud, each prototype, each moving part, and the world have an origin of their own. It is zero unless `f32` would
//! lose visible detail, so that scenes near zero are unaffected.

use crate::math::Transform;
use crate::scene::{Content, Extrinsics, Node, View};
use crate::shape::{CylinderCloud, Mesh, Shape, SphereCloud};
use crate::world::World;
use canaletto_parallel::prelude::*;
use glam::{DAffine3, DVec3, Vec3};

/// Coordinates are far from zero if they are more than this multiple of the object's size. `f32` then rounds them by
/// 2⁻¹⁴ of that size.
pub(in crate::world) const FAR: f64 = 1024.0;

/// An eye is far from zero if its coordinates are more than this multiple of its distance to its target. `f32` then
/// rounds them by 2⁻¹² of that distance, about a pixel.
const FAR_EYE: f64 = 4096.0;

/// An eye is beside an object if its distance is at most this multiple of the object's size.
const NEAR_EYE: f64 = 64.0;

/// The least and the largest coordinates of an object.
pub(in crate::world) type Span = [DVec3; 2];

const EMPTY: Span = [DVec3::INFINITY, DVec3::NEG_INFINITY];

fn join([a, b]: Span, [c, d]: Span) -> Span {
    [a.min(c), b.max(d)]
}

/// The span of these points.
pub(in crate::world) fn span(points: &[Vec3]) -> Span {
    let none = || [Vec3::INFINITY, Vec3::NEG_INFINITY];
    let join = |a: [Vec3; 2], b: [Vec3; 2]| [a[0].min(b[0]), a[1].max(b[1])];
    points.par_iter().map(|p| [*p, *p]).reduce(none, join).map(Vec3::as_dvec3)
}

/// The least power of two that isn't smaller than `size`.
fn power_of_two(size: f64) -> f64 {
    libm::exp2(libm::ceil(libm::log2(size)))
}

/// The size of a span, if it is positive and finite.
fn size([min, max]: Span) -> Option<f64> {
    Some((max - min).max_element()).filter(|size| size.is_finite() && *size > 0.0)
}

/// A point near the middle of the span if its coordinates are more than `far` times the span's size; otherwise zero.
/// Components that are small against the size become zero. The point is a multiple of a power of two, so that
/// differences of `f32` from it are exact. In a scene scaled by a power of two, it is scaled as well.
pub(in crate::world) fn origin_of(span: Span, far: f64) -> DVec3 {
    let Some(step) = size(span).map(power_of_two) else { return DVec3::ZERO };
    let middle = (span[0] + span[1]) * 0.5;
    if middle.abs().max_element() <= far * step {
        return DVec3::ZERO;
    }
    (middle / step).round() * step
}

/// The transform for coordinates relative to this origin.
pub(in crate::world) fn relative_to(origin: DVec3, transform: &Transform) -> Transform {
    if origin == DVec3::ZERO { *transform } else { transform.after(&Transform::translate(origin)) }
}

/// The transform into coordinates relative to this origin.
pub(in crate::world) fn away_from(origin: DVec3) -> Transform {
    if origin == DVec3::ZERO { Transform::IDENTITY } else { Transform::translate(-origin) }
}

/// The spans of meshes, clouds and prototypes in their own spaces.
#[derive(Default)]
pub(in crate::world) struct Spans {
    meshes: Vec<Span>,
    spheres: Vec<Span>,
    cylinders: Vec<Span>,
    prototypes: Vec<Option<Span>>,
}

impl Spans {
    pub(in crate::world) fn new(
        meshes: &[Mesh],
        spheres: &[SphereCloud],
        cylinders: &[CylinderCloud],
        prototypes: &[Node],
    ) -> Spans {
        let around = |points: &[Vec3], radii: &[f32], origin: DVec3| {
            let radius = DVec3::splat(radii.iter().fold(0.0, |most: f32, r| most.max(*r)).into());
            let [min, max] = span(points);
            [min - radius + origin, max + radius + origin]
        };
        let mut spans = Spans {
            meshes: meshes.iter().map(|m| around(&m.positions, &[], m.origin)).collect(),
            spheres: spheres.iter().map(|s| around(&s.centers, &s.radii, s.origin)).collect(),
            cylinders: cylinders.iter().map(|c| around(c.axes.as_flattened(), &c.radii, c.origin)).collect(),
            prototypes: vec![None; prototypes.len()],
        };
        for index in 0..prototypes.len() {
            spans.prototype(index, prototypes, 0);
        }
        spans
    }

    fn prototype(&mut self, index: usize, prototypes: &[Node], depth: usize) {
        if self.prototypes.get(index) != Some(&None) || depth > World::MAX_NESTING {
            return;
        }
        // A prototype that contains itself is rejected later.
        self.prototypes[index] = Some(EMPTY);
        self.referred(&prototypes[index], prototypes, depth);
        self.prototypes[index] = Some(self.of(&prototypes[index], 0));
    }

    /// Finds the spans of the prototypes that a node refers to.
    fn referred(&mut self, node: &Node, prototypes: &[Node], depth: usize) {
        match &node.content {
            Content::Group(children) if depth <= World::MAX_NESTING => {
                children.iter().for_each(|child| self.referred(child, prototypes, depth + 1));
            }
            Content::Instance(index) => self.prototype(*index as usize, prototypes, depth + 1),
            _ => {}
        }
    }

    /// The span of a node's content in the space around the node before it moves; empty for lights and planes.
    fn still(&self, node: &Node, depth: usize) -> Span {
        let at = |list: &[Span], index: u32| list.get(index as usize).copied().unwrap_or(EMPTY);
        let own = match &node.content {
            Content::Shape(shape) => shape_span(shape, &node.rest),
            Content::Mesh(index) => at(&self.meshes, *index),
            Content::Spheres(index) => at(&self.spheres, *index),
            Content::Cylinders(index) => at(&self.cylinders, *index),
            Content::Light(_) => EMPTY,
            Content::Group(children) if depth <= World::MAX_NESTING => {
                children.iter().fold(EMPTY, |all, child| join(all, self.of(child, depth + 1)))
            }
            Content::Group(_) => EMPTY,
            Content::Instance(index) => self.prototypes.get(*index as usize).copied().flatten().unwrap_or(EMPTY),
        };
        through(&node.transform, own)
    }

    /// The span of a node's content in the space around the node while the shutter is open.
    fn of(&self, node: &Node, depth: usize) -> Span {
        let still = self.still(node, depth);
        node.motion.iter().map(|pose| through(pose, still)).reduce(join).unwrap_or(still)
    }

    /// The origin of a prototype's coordinates.
    pub(in crate::world) fn prototype_origin(&self, node: &Node) -> DVec3 {
        origin_of(self.of(node, 0), FAR)
    }

    /// The origin of a moving part's coordinates before it moves.
    pub(in crate::world) fn moving_origin(&self, node: &Node) -> DVec3 {
        origin_of(self.still(node, 0), FAR)
    }

    /// The origin of the world's coordinates. It is a point near the eye if the eye is far from zero, relative to its
    /// target or to an object beside it. Otherwise it is a point near the middle of the scene if the scene is far from
    /// zero.
    pub(in crate::world) fn world(&self, nodes: &[Node], view: Option<&View>) -> DVec3 {
        let spans: Vec<Span> = nodes.par_iter().map(|node| self.of(node, 0)).collect();
        let all = spans.iter().copied().fold(EMPTY, join);
        if let Some(Extrinsics { eye, center, .. }) = view.map(|v| *v.motion.first().unwrap_or(&v.extrinsics)) {
            let far = |size: &f64| eye.abs().max_element() > FAR_EYE * power_of_two(*size);
            let beside = |span: &&Span| {
                let away = (span[0] - eye).max(eye - span[1]).max_element();
                size(**span).is_some_and(|size| away <= NEAR_EYE * size)
            };
            let seen = size([eye.min(center), eye.max(center)]).filter(far);
            let small = spans.iter().filter(beside).filter_map(|span| size(*span)).filter(far).reduce(f64::min);
            if let Some(step) = seen.or(small).map(|size| NEAR_EYE * power_of_two(size)) {
                return (eye / step).round() * step;
            }
        }
        origin_of(all, FAR)
    }
}

/// The span of a transformed box.
fn through(transform: &Transform, span: Span) -> Span {
    if transform.is_identity() || size(span).is_none() && span[0].cmpgt(span[1]).any() {
        return span;
    }
    let corner = |i: usize| DVec3::new(span[i & 1].x, span[i >> 1 & 1].y, span[i >> 2].z);
    (0..8).map(|i| transform.point(corner(i))).fold(EMPTY, |all, p| join(all, [p, p]))
}

/// A shape's or light's points with the parts that `f32` lost.
#[derive(Clone, Copy)]
pub(in crate::world) struct Exactly<'r> {
    /// The part of each point that `f32` lost.
    pub(in crate::world) rest: &'r [Vec3; 3],
    /// The origin of the points.
    pub(in crate::world) zero: DVec3,
}

impl Exactly<'_> {
    /// Point number `i`, which was rounded to `p`, relative to `zero`. Only this difference is rounded.
    pub(in crate::world) fn point(self, i: usize, p: Vec3) -> Vec3 {
        (p.as_dvec3() - self.zero + self.rest[i].as_dvec3()).as_vec3()
    }

    /// The points relative to the preimage of zero, and the transform that remains for them.
    pub(in crate::world) fn before(rest: &[Vec3; 3], transform: Transform) -> (Exactly<'_>, Transform) {
        let zero = transform.inverse().point(DVec3::ZERO);
        let [forward, back] = [transform.matrix(), transform.back()].map(|m| DAffine3::from_mat3(m.matrix3));
        (Exactly { rest, zero }, Transform::from_parts(forward, back))
    }
}

/// The span of a shape, from its points with the parts that `f32` lost.
pub(in crate::world) fn shape_span(shape: &Shape, rest: &[Vec3; 3]) -> Span {
    let (near, zero) = shape.relative_to_first_point(rest);
    near.bounds().map_or(EMPTY, |bounds| [zero + bounds.min.as_dvec3(), zero + bounds.max.as_dvec3()])
}

/// Whether rounding has moved a shape's points by more than 2⁻¹⁶ of its size.
pub(in crate::world) fn rounded_visibly(shape: &Shape, rest: &[Vec3; 3]) -> bool {
    let lost = rest.iter().fold(0.0, |most: f32, rest| most.max(rest.abs().max_element()));
    lost > 0.0 && size(shape_span(shape, rest)).is_none_or(|size| f64::from(lost) * 65_536.0 > size)
}
