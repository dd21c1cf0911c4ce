//! From a place on a visible triangle back to a hit in the world, for the shading code of the ray tracer.

use super::coverage::{ScreenTriangle, Source};
use super::facets::{Facets, Tolerance};
use super::geometry::BinnedTriangles;
use super::triangle_hits::{TriangleHits, triangle_hit};
use crate::camera::Camera;
use crate::math::{DRay, Transform};
use crate::shape::{Shape, ShapeHit};
use crate::world::{Hit, MeshFacet, PlacedGeometry, Primitives, World};
use glam::{DVec3, Vec3};
use std::collections::HashMap;
use std::collections::hash_map::Entry;

/// A triangle of the world at hand: its corners and what is needed for hits on it.
pub(crate) struct VisibleTriangle<'a> {
    pub(crate) source: Source,
    /// The corners in the primitive's space.
    pub(crate) corners: [Vec3; 3],
    exact_corners: [DVec3; 3],
    pub(crate) to_world: Option<&'a Transform>,
    /// The part of the shape.
    part: u32,
    /// The tessellation, if the triangle isn't the surface itself.
    facets: Option<&'a Facets>,
    /// The geometry that holds a shape, unless the triangle is of a mesh.
    shapes: Option<Shapes<'a>>,
}

/// The geometry of a shape.
#[derive(Clone, Copy)]
enum Shapes<'a> {
    Unbounded(&'a Shape),
    Placed(Primitives<'a>),
}

/// What a thread knows of the geometries behind triangles.
#[derive(Default)]
pub(crate) struct FacetCache<'w> {
    placed: Vec<PlacedGeometry<'w>>,
    /// The place in `placed` of each instance.
    instances: HashMap<u32, usize>,
    /// The instance that was prepared last, and its place.
    last: Option<(u32, usize)>,
    facets: HashMap<[u32; 2], Facets>,
    /// The memory of `facets`.
    bytes: usize,
}

/// About the most memory of tessellations that a thread has at hand.
const MOST_BYTES: usize = 8 << 20;

impl<'w> FacetCache<'w> {
    /// Forgets everything.
    pub(crate) fn clear(&mut self) {
        self.placed.clear();
        self.instances.clear();
        self.facets.clear();
        self.bytes = 0;
        self.last = None;
    }

    /// Forgets tessellations that take too much memory.
    pub(crate) fn trim(&mut self) {
        if self.bytes > MOST_BYTES {
            self.facets.clear();
            self.bytes = 0;
        }
    }

    fn keep(&mut self, key: [u32; 2], facets: impl FnOnce() -> Facets) {
        if let Entry::Vacant(vacant) = self.facets.entry(key) {
            self.bytes += vacant.insert(facets()).bytes();
        }
    }

    /// The geometry of an instance that was prepared.
    #[inline]
    fn placed(&self, instance: u32) -> Option<&PlacedGeometry<'w>> {
        let place = match self.last {
            Some((last, place)) if last == instance => place,
            _ => *self.instances.get(&instance)?,
        };
        Some(&self.placed[place])
    }

    /// Makes sure that the triangle's geometry is at hand.
    #[inline]
    pub(crate) fn prepare(
        &mut self,
        source: Source,
        world: &'w World,
        binned: &BinnedTriangles,
        tolerance: &Tolerance,
    ) {
        if source.instance == Hit::UNBOUNDED {
            let shape = world.unbounded_shape(source.primitive);
            self.keep([source.instance, source.primitive], || Facets::new(shape, None, None, tolerance));
            return;
        }
        if self.last.is_none_or(|(last, _)| last != source.instance) {
            let place = *self.instances.entry(source.instance).or_insert_with(|| {
                self.placed.push(world.placed_geometry(source.instance, 0.0));
                self.placed.len() - 1
            });
            self.last = Some((source.instance, place));
        }
        if source.is_of_mesh || binned.kept(source.instance, source.primitive).is_some() {
            return;
        }
        let Some(placed) = self.last.map(|(_, place)| &self.placed[place]) else { return };
        if let Some((shape, color)) = placed.primitives.shape(source.primitive) {
            let to_world = placed.to_world;
            let key = [source.instance, source.primitive];
            self.keep(key, || Facets::new(&shape, color, to_world.as_ref(), tolerance));
        }
    }

    /// The triangle in the world, if its surface decides where it is and how deep.
    #[inline]
    pub(crate) fn triangle_to_refine<'a>(
        &'a mut self,
        triangle: &ScreenTriangle,
        world: &'w World,
        binned: &'a BinnedTriangles,
        tolerance: &Tolerance,
    ) -> Option<VisibleTriangle<'a>> {
        if !triangle.needs_refinement() {
            return None;
        }
        self.trim();
        self.prepare(triangle.source, world, binned, tolerance);
        self.triangle(triangle.source, world, binned)
    }

    /// A triangle, for which [`FacetCache::prepare`] was called.
    #[inline]
    pub(crate) fn triangle<'a>(
        &'a self,
        source: Source,
        world: &'a World,
        binned: &'a BinnedTriangles,
    ) -> Option<VisibleTriangle<'a>> {
        let (to_world, shapes) = if source.instance == Hit::UNBOUNDED {
            (None, Shapes::Unbounded(world.unbounded_shape(source.primitive)))
        } else {
            let placed = self.placed(source.instance)?;
            if let Primitives::Mesh(mesh) = placed.primitives {
                let (corners, to_world) = (mesh.corners(source.primitive as usize), placed.to_world.as_ref());
                let exact_corners = corners.map(Vec3::as_dvec3);
                let (part, facets, shapes) = (0, None, None);
                return Some(VisibleTriangle { source, corners, exact_corners, to_world, part, facets, shapes });
            }
            (placed.to_world.as_ref(), Shapes::Placed(placed.primitives))
        };
        let kept = binned.kept(source.instance, source.primitive);
        let facets = kept.or_else(|| self.facets.get(&[source.instance, source.primitive]))?;
        Some(VisibleTriangle {
            source,
            corners: facets.mesh.corners(source.triangle as usize),
            exact_corners: facets.corners(source.triangle),
            to_world,
            part: facets.parts[source.triangle as usize],
            facets: (!facets.is_exact).then_some(facets),
            shapes: Some(shapes),
        })
    }
}

impl VisibleTriangle<'_> {
    /// The facet to be evaluated in place of the shape's own surface.
    pub(crate) fn facet(&self) -> Option<MeshFacet<'_>> {
        self.facets.map(|facets| MeshFacet { mesh: &facets.mesh, triangle: self.source.triangle, color: facets.color })
    }

    /// The share of the surface that exists at a hit of a line.
    pub(crate) fn coverage(&self, world: &World, line: DRay, hit: &Hit) -> f32 {
        match self.facet() {
            Some(facet) => world.crossed_facet(line, hit, &facet).coverage,
            None => world.coverage_at(line, hit),
        }
    }

    /// Whether the triangle is of a tessellation.
    pub(crate) fn is_tessellated(&self) -> bool {
        self.shapes.is_some()
    }

    /// The shape that the triangle stands for.
    fn shape(&self) -> Option<Shape> {
        match self.shapes? {
            Shapes::Unbounded(shape) => Some(*shape),
            Shapes::Placed(primitives) => primitives.shape(self.source.primitive).map(|(shape, _)| shape),
        }
    }

    /// The parameter t where a line from the viewer meets the curved surface that the triangle stands for. `t` is where
    /// it meets the triangle; it is returned if the surface isn't met near it on the same side.
    pub(crate) fn surface_near(&self, line: &DRay, t: f64) -> f64 {
        self.crossing_near(line, t).map_or(t, |(t, _)| t)
    }

    /// The parameter t and the hit where a line from the viewer meets the curved surface that the triangle stands for,
    /// near the parameter where it meets the triangle.
    fn crossing_near(&self, line: &DRay, t: f64) -> Option<(f64, ShapeHit)> {
        let (facets, shape) = (self.facets?, self.shape()?);
        let local = self.to_local(line);
        let [a, b, c] = self.exact_corners;
        let slope = (b - a).cross(c - a).normalize_or_zero().dot(local.direction);
        let is_front = slope < 0.0;
        let place = DRay { origin: local.origin + local.direction * t, direction: local.direction };
        // A front is met where the line enters the body, a back where it leaves it.
        let met = |sign: f64| {
            let line = DRay { direction: place.direction * sign, ..place };
            let hit = shape.intersect(&line.rounded(), f32::INFINITY)?;
            let normal = shape.surface(line, &hit).normal;
            let step = f64::from(hit.t);
            // What lies farther from the triangle's plane than the tolerance is another part of the surface.
            let is_near = step * slope.abs() <= 2.0 * facets.tolerance_at(t);
            (is_near && (normal.dot(place.direction) < 0.0) == is_front).then_some((step * sign, hit))
        };
        let (step, hit) = match (met(-1.0), met(1.0)) {
            (Some(before), Some(after)) => {
                if -before.0 <= after.0 {
                    before
                } else {
                    after
                }
            }
            (Some(met), None) | (None, Some(met)) => met,
            (None, None) => return None,
        };
        Some((t + step, hit))
    }

    /// The hit of a line on the surface that the triangle stands for, where `hit` is that on the triangle. None where
    /// the line misses the surface, and where the triangle is the surface.
    pub(crate) fn surface_hit(&self, line: &DRay, hit: &Hit) -> Option<Hit> {
        let of = |met: ShapeHit| Hit { t: met.t, part: met.part, uv: met.uv, ..*hit };
        // The ray from the viewer finds the hit that a ray tracer has. It may be one on another part of the surface.
        let own = |shape: Shape| shape.intersect(&self.to_local(line).rounded(), f32::INFINITY);
        if self.facets.is_none() {
            return self.shape().filter(|shape| matches!(shape, Shape::Plane(_))).and_then(own).map(of);
        }
        let (t, near) = self.crossing_near(line, self.plane_distance(line)?)?;
        /// The relative distance of two roundings of one hit.
        const ROUNDINGS: f64 = 1.0 / (1u32 << 16) as f64;
        let first = self.shape().and_then(own).filter(|first| (f64::from(first.t) - t).abs() <= t * ROUNDINGS);
        Some(of(first.unwrap_or(ShapeHit { t: t as f32, ..near })))
    }

    /// The parameter where a line meets the triangle's plane.
    fn plane_distance(&self, line: &DRay) -> Option<f64> {
        let local = self.to_local(line);
        let [a, b, c] = self.exact_corners;
        let normal = (b - a).cross(c - a);
        let t = normal.dot(a - local.origin) / normal.dot(local.direction);
        (t.is_finite() && t > 0.0).then_some(t)
    }

    /// The distance along a line that the roundings of `f32` in a hit on the surface are certain to be less than.
    pub(crate) fn rounding(&self, line: &DRay) -> f64 {
        const ROUNDINGS: f64 = 1.0 / (1u32 << 20) as f64;
        let local = self.to_local(line);
        let corners = self.corners.map(|corner| f64::from(corner.abs().max_element()));
        corners.into_iter().fold(0.0, f64::max) * ROUNDINGS / local.direction.length()
    }

    /// The hit of a line on the triangle, or at the place of the triangle that is nearest to the line: a sample of a
    /// snapped triangle may lie just beside it.
    pub(crate) fn hit(&self, line: &DRay) -> Hit {
        self.hit_found(line, triangle_hit(&self.to_local(line).rounded(), &self.corners))
    }

    /// Adds the line to those whose hits are found together.
    #[inline]
    pub(crate) fn push_line(&self, line: &DRay, hits: &mut TriangleHits) {
        hits.push(&self.to_local(line).rounded(), &self.corners);
    }

    /// [`VisibleTriangle::hit`], where `found` is what [`TriangleHits`] found.
    #[inline(always)]
    pub(crate) fn hit_found(&self, line: &DRay, found: Option<(f32, [f32; 2])>) -> Hit {
        let (t, uv) = found.unwrap_or_else(|| self.nearest(&self.to_local(line)));
        self.source.hit(t, uv, self.part)
    }

    #[inline]
    fn to_local(&self, line: &DRay) -> DRay {
        self.to_world.map_or(*line, |to_world| line.to_local(to_world))
    }

    /// t and barycentric coordinates where the line meets the triangle's plane, moved into the triangle.
    #[cold]
    fn nearest(&self, line: &DRay) -> (f32, [f32; 2]) {
        let [a, b, c] = self.corners.map(Vec3::as_dvec3);
        let (ab, ac) = (b - a, c - a);
        let normal = ab.cross(ac);
        let t = normal.dot(a - line.origin) / normal.dot(line.direction);
        let at = line.origin + line.direction * t - a;
        let scale = 1.0 / normal.length_squared();
        let u = (at.cross(ac).dot(normal) * scale).clamp(0.0, 1.0);
        let v = (ab.cross(at).dot(normal) * scale).clamp(0.0, 1.0);
        let sum = (u + v).max(1.0);
        if !(t.is_finite() && u.is_finite() && v.is_finite()) {
            return self.at_weights(line, [1.0 / 3.0; 2]);
        }
        (t as f32, [(u / sum) as f32, (v / sum) as f32])
    }

    fn at_weights(&self, line: &DRay, [u, v]: [f32; 2]) -> (f32, [f32; 2]) {
        let point = self.point([u, v]);
        ((point - line.origin).dot(line.direction).max(0.0) as f32 / line.direction.length_squared() as f32, [u, v])
    }

    /// The point with these barycentric coordinates in the primitive's space.
    fn point(&self, [u, v]: [f32; 2]) -> DVec3 {
        let [a, b, c] = self.corners.map(Vec3::as_dvec3);
        a + (b - a) * f64::from(u) + (c - a) * f64::from(v)
    }

    /// The line from the camera to the point with these barycentric coordinates, and the hit there.
    pub(crate) fn seen_by(&self, camera: &Camera, uv: [f32; 2]) -> (DRay, Hit) {
        let local = self.point(uv);
        let point = self.to_world.map_or(local, |t| t.point(local));
        let (line, distance) = camera.line_to(point);
        (line, self.source.hit(distance as f32, uv, self.part))
    }
}
