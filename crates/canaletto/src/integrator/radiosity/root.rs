//! Roots: the flat surfaces of a world before they are subdivided, each for one side.

use super::RadiosityError;
use super::cuts::Polygon;
use super::outline::Outline;
use super::sources::light_points;
use crate::math::{DRay, offset_origin, rounding};
use crate::shape::Shape;
use crate::world::{Facet, Hit, Solids, World};
use canaletto_bvh::{Aabb, Bvh};
use canaletto_parallel::prelude::*;
use glam::{DVec3, Vec3};
use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::Arc;

/// The margin around a scene's bounds within which planes count, relative to the diagonal of the bounds.
const PLANE_MARGIN: f32 = 1.0;

/// The largest distance between the fourth corners of two triangles that count as one parallelogram, relative to its
/// diagonal.
const SAME_CORNER: f64 = 1e-6;

/// The distance from a flat surface at which lines through it begin, relative to its size.
const FLAT_REACH: f64 = 1e-2;

/// The largest distance from a facet of a curved surface at which lines through it begin, relative to its width.
const CURVED_REACH: f64 = 0.45;

/// The distance within which coordinates count as equal, relative to the largest: eight units in the last place.
const ROUNDING: f32 = 8.0 * f32::EPSILON;

/// One side of a flat surface, or of a facet of a curved one.
#[derive(Clone, Debug)]
pub(super) struct Root {
    pub(super) instance: u32,
    /// The primitives that the root stands for: one, or two triangles of a mesh.
    pub(super) primitives: [u32; 2],
    pub(super) part: u32,
    pub(super) material: u32,
    /// Whether this is the outer side.
    pub(super) is_outer: bool,
    pub(super) is_flat: bool,
    /// The unit normal of this side.
    pub(super) normal: DVec3,
    pub(super) outline: Outline,
    /// The first three corners of two joined triangles.
    pub(super) joined: [DVec3; 3],
    /// A bound of the rounding error of points of the surface, in each coordinate.
    pub(super) error: Vec3,
    /// The distance within which the exact surface lies.
    pub(super) reach: f64,
    /// The segments along which the surface was cut, and the distance within which points count as equal.
    pub(super) cuts: Arc<[[DVec3; 2]]>,
    pub(super) tolerance: f64,
    /// The boxes in which other surfaces may touch this one.
    pub(super) contacts: Vec<Aabb>,
}

impl Root {
    /// The bounds of the outline.
    fn bounds(outline: &Outline) -> Aabb {
        Aabb::from_points(outline.corners().iter().map(|p| p.as_vec3()))
    }

    /// The same side for an outline within its own. It keeps no cuts and no contacts.
    pub(super) fn part(&self, outline: Outline) -> Root {
        Root { outline, cuts: Arc::default(), contacts: Vec::new(), ..self.clone() }
    }

    /// The primitive that a point of the outline belongs to.
    pub(super) fn primitive_at(&self, point: DVec3) -> u32 {
        let [first, second] = self.primitives;
        if first == second {
            return first;
        }
        let [a, b, c] = self.joined;
        // The diagonal goes from the first corner to the third; the first triangle lies at the second corner.
        let across = self.normal.cross(c - a);
        if across.dot(point - a) * across.dot(b - a) >= 0.0 { first } else { second }
    }

    /// A line through the surface near a point of the outline, from this side. It ends at the parameter 1.
    pub(super) fn line_through(&self, point: DVec3) -> DRay {
        DRay { origin: point + self.normal * self.reach, direction: self.normal * (-2.0 * self.reach) }
    }

    /// A point of the outline, moved towards its middle until it lies on the surface. The triangles of a cap or a disk
    /// reach beyond its round rim.
    pub(super) fn within_rim(&self, world: &World, point: DVec3) -> DVec3 {
        let is_round = self.is_flat && self.outline.corners().len() == 3;
        if !is_round {
            return point;
        }
        let is_met = |p: &DVec3| {
            let met = world.surface_of(self.instance, self.primitive_at(*p), self.line_through(*p));
            met.is_some_and(|(hit, _)| hit.part == self.part)
        };
        let middle = self.outline.center();
        let nearer = |step: u32| point + (middle - point) * (f64::from(step) / 8.0);
        (0..5).map(nearer).find(is_met).unwrap_or(point)
    }

    /// The origin of rays that leave the surface on this side near a point of the outline.
    pub(super) fn ray_origin(&self, world: &World, point: DVec3) -> Vec3 {
        if !self.is_flat
            && let Some((_, surface)) =
                world.surface_of(self.instance, self.primitive_at(point), self.line_through(point))
        {
            let normal = if surface.normal.dot(self.normal) < 0.0 { -surface.normal } else { surface.normal };
            return offset_origin(surface.point, surface.error, normal, normal);
        }
        let point = self.within_rim(world, point);
        offset_origin(point.as_vec3(), self.error, self.normal, self.normal)
    }
}

/// The facets of a world, without the surfaces that show lights. Curved surfaces are tessellated to a tolerance, a
/// length, and round lamps by the wanted error, too: a lamp of few facets is brighter in some directions.
pub(super) fn facets(world: &World, tolerance: f64, error: f64, limit: usize) -> Result<Vec<Facet>, RadiosityError> {
    let boxes: Vec<Aabb> = world.unbounded_shapes().map(|plane| plane_box(world, plane)).collect();
    let facets = world.facets((tolerance, lamp_angle(world, error)), &boxes, limit);
    let mut facets = facets.map_err(|_| RadiosityError::TooManyPatches { limit })?;
    facets.retain(|facet| !world.is_of_light(facet.material));
    Ok(facets)
}

/// Half the largest angle between neighbouring facets of a round lamp, relative to the root of the wanted error, and
/// its bounds. The projected area of a ball of 2n columns and n rows varies over directions by 0.8 / n² at most.
const LAMP_ANGLE: f64 = 2.0;
const LAMP_ANGLES: [f64; 2] = [PI / 24.0, PI / 8.0];

/// About the most facets of all round lamps beyond those that the tolerance needs.
const LAMP_FACETS: f64 = 4096.0;

fn lamp_angle(world: &World, error: f64) -> f64 {
    let wanted = (LAMP_ANGLE * error.sqrt()).clamp(LAMP_ANGLES[0], LAMP_ANGLES[1]);
    // A ball of n rows has about 4 n² facets, and half the angle of a row is π / 2n.
    let coarsest = PI * (world.round_lamps() as f64 / LAMP_FACETS).sqrt();
    wanted.max(coarsest).min(FRAC_PI_2)
}

/// The solids of a world. Those with a light inside are hollow.
pub(super) fn solids<'w>(world: &'w World, facets: &[Facet]) -> Result<Solids<'w>, RadiosityError> {
    let mut lights: Vec<Vec3> = light_points(world);
    let emits = |facet: &&Facet| world.materials()[facet.material as usize].may_emit();
    let emitting: Vec<&Facet> = facets.iter().filter(emits).collect();
    let step = (emitting.len() / MOST_LIGHTS).max(1);
    lights.extend(emitting.iter().step_by(step).filter_map(|facet| {
        let outline = Outline::triangle(facet.corners);
        let (corner, normal) = (facet.corners[0].as_vec3(), outline.normal()?);
        let error = Vec3::splat(rounding_in(&Root::bounds(&outline)));
        Some(offset_origin(corner, error, normal, normal))
    }));
    let mut glowing: Vec<(u32, u32)> = emitting
        .iter()
        .filter(|facet| world.materials()[facet.material as usize].two_sided)
        .map(|facet| (facet.instance, facet.primitive))
        .collect();
    glowing.dedup();
    Solids::new(world, &lights, &glowing).map_err(|problem| RadiosityError::Hierarchy(problem.to_string()))
}

/// The number of places of emitting surfaces that tell which solids have light inside.
const MOST_LIGHTS: usize = 1024;

/// The roots of facets, cut where others touch them.
pub(super) fn roots(
    world: &World,
    solids: &Solids,
    facets: &[Facet],
    tolerance: f64,
    limit: usize,
) -> Result<Vec<Root>, RadiosityError> {
    let mut surfaces = Vec::new();
    let mut next = 0;
    while let Some(facet) = facets.get(next) {
        let joined = facets.get(next + 1).and_then(|other| joined(facet, other));
        next += if joined.is_some() { 2 } else { 1 };
        let outline = joined.map_or(Outline::triangle(facet.corners), |(outline, _)| outline);
        let last = joined.map_or(facet.primitive, |(_, primitive)| primitive);
        if outline.area() > 0.0 && outline.area().is_finite() {
            surfaces.push((facet, last, outline));
        }
    }
    let polygons: Vec<Option<Polygon>> =
        surfaces.par_iter().map(|(facet, _, outline)| polygon(facet, outline)).collect();
    let bounds: Vec<Aabb> = surfaces.par_iter().map(|(_, _, outline)| grown(&Root::bounds(outline))).collect();
    let tree = Bvh::build(&bounds).map_err(|problem| RadiosityError::Hierarchy(problem.to_string()))?;
    let sides = |number: usize| {
        let &(facet, last, outline) = &surfaces[number];
        let mut cuts: Arc<[[DVec3; 2]]> = Arc::default();
        let outlines = match &polygons[number] {
            None => vec![outline],
            Some(own) => {
                let mut near = Vec::new();
                tree.overlapping(&bounds[number], |leaf| {
                    near.extend(leaf.slots().map(|slot| tree.order()[slot as usize] as usize));
                    true
                });
                near.retain(|&other| other != number && bounds[other].overlaps(&bounds[number]));
                near.sort_unstable();
                let (pieces, segments) = own.cut(near.into_iter().filter_map(|other| polygons[other].as_ref()));
                cuts = segments.into();
                if pieces.len() == 1 { vec![outline] } else { pieces.iter().flat_map(Polygon::outlines).collect() }
            }
        };
        let solid = solids.of(facet.instance, facet.primitive);
        let is_open = solid.is_none_or(|solid| solids.is_hollow(solid)) && !facet.is_one_sided;
        let whole = root(world, solids, facet, last, outline, tolerance);
        let side = |outline: Outline| {
            let reach = if facet.is_flat { outline.radius() * FLAT_REACH } else { whole.reach };
            let outer = Root { outline, reach, cuts: cuts.clone(), ..whole.clone() };
            let (normal, outline) = (-outer.normal, outline.reversed());
            let inner = is_open.then(|| Root { is_outer: false, normal, outline, ..outer.clone() });
            std::iter::once(outer).chain(inner)
        };
        outlines.into_iter().filter(|outline| outline.area() > 0.0).flat_map(side).collect::<Vec<Root>>()
    };
    let roots: Vec<Vec<Root>> = (0..surfaces.len()).into_par_iter().map(sides).collect();
    let roots: Vec<Root> = roots.into_iter().flatten().collect();
    if roots.len() > limit { Err(RadiosityError::TooManyPatches { limit }) } else { Ok(roots) }
}

fn root(world: &World, solids: &Solids, facet: &Facet, last: u32, outline: Outline, tolerance: f64) -> Root {
    let bounds = Root::bounds(&outline);
    let far = bounds.min.abs().max(bounds.max.abs());
    // A flat surface needs a line that is long enough for its ends to be off the surface.
    // A line through a facet of a hollow body must not begin beyond the opposite wall.
    let reach = if facet.is_flat {
        outline.radius() * FLAT_REACH
    } else {
        (2.0 * tolerance).min(outline.width() * CURVED_REACH)
    };
    let mut root = Root {
        instance: facet.instance,
        primitives: [facet.primitive, last],
        part: facet.part,
        material: facet.material,
        is_outer: true,
        is_flat: facet.is_flat,
        normal: outline.normal().unwrap_or(DVec3::Z),
        outline,
        joined: [0, 1, 2].map(|i| outline.corners()[i]),
        error: rounding(far),
        reach,
        cuts: Arc::default(),
        tolerance: f64::from(rounding_in(&bounds)),
        contacts: Vec::new(),
    };
    let middle = root.outline.cell(0);
    if let Some((_, surface)) = world.surface_of(root.instance, root.primitive_at(middle), root.line_through(middle)) {
        root.error = root.error.max(surface.error);
    }
    root.contacts = solids.contacts(facet.instance, facet.primitive, &bounds);
    root
}

/// The distance within which points of a box count as equal.
fn rounding_in(bounds: &Aabb) -> f32 {
    bounds.min.abs().max(bounds.max.abs()).max_element() * ROUNDING
}

fn grown(bounds: &Aabb) -> Aabb {
    let near = Vec3::splat(rounding_in(bounds));
    Aabb { min: bounds.min - near, max: bounds.max + near }
}

/// The polygon of a surface that is one.
fn polygon(facet: &Facet, outline: &Outline) -> Option<Polygon> {
    let tolerance = f64::from(rounding_in(&Root::bounds(outline)));
    let corners = outline.corners().to_vec();
    facet.is_polygon.then(|| Some(Polygon { corners, normal: outline.normal()?, tolerance }))?
}

/// The parallelogram of two triangles of one flat surface that share an edge, and the second one's primitive.
fn joined(first: &Facet, second: &Facet) -> Option<(Outline, u32)> {
    let same = |facet: &Facet| (facet.instance, facet.part, facet.material, facet.is_one_sided, facet.is_flat);
    if same(first) != same(second) || !first.is_flat {
        return None;
    }
    (0..3).find_map(|i| {
        let [a, b, c] = [0, 1, 2].map(|k| first.corners[(i + k) % 3]);
        // The shared edge is c to a in the first triangle, and a to c in the second.
        let j = (0..3).find(|&j| second.corners[j] == a && second.corners[(j + 1) % 3] == c)?;
        let d = second.corners[(j + 2) % 3];
        let gap = (a + c - b - d).length();
        (gap <= SAME_CORNER * a.distance(c)).then(|| (Outline::quad([a, b, c, d]), second.primitive))
    })
}

/// The distance of a plane from all other surfaces from which it has no patches, relative to their diagonal.
const FAR_PLANE: f32 = 64.0;

/// The box inside which a plane counts: the scene's bounds, grown by their diagonal on each side. If the plane passes
/// outside this box, the box also has the part of the plane below the bounds.
fn plane_box(world: &World, plane: &Shape) -> Aabb {
    let inner = world.inner_bounds();
    let bounds = if inner.is_empty() { Aabb::from_points(light_points(world)) } else { inner };
    let Shape::Plane(plane) = plane else { return bounds };
    if bounds.is_empty() {
        return bounds;
    }
    let diagonal = |of: &Aabb| (of.max - of.min).length();
    let with_margin = |of: &Aabb| {
        let margin = Vec3::splat(diagonal(of) * PLANE_MARGIN);
        Aabb { min: of.min - margin, max: of.max + margin }
    };
    let normal = plane.normal.as_dvec3().normalize().as_vec3();
    let heights = |of: &Aabb| corners(of).map(|corner| (corner - plane.point).dot(normal));
    let grown = with_margin(&bounds);
    let is_above = heights(&grown).map(|height| height > 0.0);
    let nearest = heights(&bounds).into_iter().fold(f32::INFINITY, |nearest, height| nearest.min(height.abs()));
    let is_far = !inner.is_empty() && nearest > FAR_PLANE * diagonal(&bounds);
    if is_above.iter().any(|above| *above != is_above[0]) || is_far {
        return grown;
    }
    let feet = corners(&bounds).into_iter().zip(heights(&bounds)).map(|(corner, height)| corner - normal * height);
    with_margin(&bounds.union(Aabb::from_points(feet)))
}

fn corners(of: &Aabb) -> [Vec3; 8] {
    std::array::from_fn(|i| {
        let at = |axis: usize| if i >> axis & 1 == 1 { of.max[axis] } else { of.min[axis] };
        Vec3::new(at(0), at(1), at(2))
    })
}

/// The names of the planes that have no patches, since all other surfaces are far away.
pub(super) fn planes_without_patches(world: &World) -> Vec<String> {
    let has_none = |(_, plane): &(u32, &Shape)| {
        let tessellation = plane.tessellate(1.0, &plane_box(world, plane), 1 << 10);
        tessellation.is_ok_and(|tessellation| tessellation.triangles.is_empty())
    };
    let hit = |primitive: u32| Hit { instance: Hit::UNBOUNDED, primitive, ..Hit::none(0.0, 0.0) };
    let name = |(primitive, _): (u32, &Shape)| world.object(&hit(primitive)).name.clone();
    (0..).zip(world.unbounded_shapes()).filter(has_none).map(name).collect()
}
