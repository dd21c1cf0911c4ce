//! Facets: all surfaces of a world as flat triangles, for methods that need a surface's area.

use crate::math::{DRay, Transform};
use crate::shape::{Shape, ShapeHit, Surface, Tessellation, TooManyTriangles};
use crate::world::World;
use crate::world::data::geometry::Geometry;
use crate::world::data::instance::Instance;
use crate::world::trace::query::Hit;
use canaletto_bvh::{Aabb, Ray};
use glam::DVec3;
use std::f64::consts::FRAC_PI_2;

/// A triangle that stands for a part of a primitive's surface, in the world's space at time 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Facet {
    pub(crate) instance: u32,
    pub(crate) primitive: u32,
    pub(crate) part: u32,
    /// The corners, counter-clockwise when seen from the outer side.
    pub(crate) corners: [DVec3; 3],
    /// Whether the triangle lies in the surface, so that the surface is flat.
    pub(crate) is_flat: bool,
    /// Whether the whole surface is a polygon: a triangle, a plane or a box's face.
    pub(crate) is_polygon: bool,
    /// Whether the surface is only there for rays from its outer side.
    pub(crate) is_one_sided: bool,
    /// The index of the material.
    pub(crate) material: u32,
}

impl World {
    /// The facets of all surfaces. Curved surfaces are tessellated to a tolerance, a length in the world, with the area
    /// of the exact surface. Half the angle between facets of round lamps is at most `lamp_angle`. Each plane is
    /// covered inside its box. The order is that of instances and primitives, planes last.
    ///
    /// # Errors
    /// [`TooManyTriangles`] if there would be more than `limit`.
    pub(crate) fn facets(
        &self,
        tolerances: (f64, f64),
        plane_boxes: &[Aabb],
        limit: usize,
    ) -> Result<Vec<Facet>, TooManyTriangles> {
        let mut facets = Vec::new();
        for number in 0..self.geometry.root.leaves {
            self.with_instance(number, |instance| {
                self.facets_of_instance(number, instance, tolerances, limit, &mut facets)
            })?;
        }
        for ((primitive, unbounded), clip) in (0..).zip(&self.geometry.unbounded).zip(plane_boxes) {
            let hit = Hit { instance: Hit::UNBOUNDED, primitive, ..Hit::none(0.0, 0.0) };
            let first = Facet {
                instance: Hit::UNBOUNDED,
                primitive,
                part: 0,
                corners: [DVec3::ZERO; 3],
                is_flat: true,
                is_polygon: true,
                is_one_sided: false,
                material: self.material_index(&hit),
            };
            let tessellation = unbounded.shape.tessellate(tolerances.0, clip, limit)?;
            push_all(&mut facets, &tessellation, None, first, limit)?;
        }
        Ok(facets)
    }

    /// The number of curved primitives that may emit light.
    pub(crate) fn round_lamps(&self) -> usize {
        if !self.sources.may_emit {
            return 0;
        }
        let of_instance = |instance: &Instance| {
            let geometry = &self.geometry.geometries[instance.geometry as usize];
            let emits = |&primitive: &u32| {
                let is_flat = matches!(geometry, Geometry::Shapes { shapes, .. }
                    if shapes[primitive as usize].is_polygonal());
                !is_flat && self.shading.materials[self.material_of(instance, primitive) as usize].may_emit()
            };
            let is_mesh = matches!(geometry, Geometry::Mesh { .. });
            if is_mesh { 0 } else { (0..geometry.len() as u32).filter(emits).count() }
        };
        (0..self.geometry.root.leaves).map(|number| self.with_instance(number, |instance| of_instance(instance))).sum()
    }

    fn facets_of_instance(
        &self,
        number: u32,
        instance: &Instance,
        (tolerance, lamp_angle): (f64, f64),
        limit: usize,
        facets: &mut Vec<Facet>,
    ) -> Result<(), TooManyTriangles> {
        let to_world = instance.placed(&self.geometry.chains, 0.0);
        let to_world = to_world.as_ref();
        let tolerance = to_world.map_or(tolerance, |t| tolerance / t.max_stretch());
        let geometry = &self.geometry.geometries[instance.geometry as usize];
        if facets.len() + geometry.len() > limit {
            return Err(TooManyTriangles { limit });
        }
        for primitive in 0..geometry.len() as u32 {
            let id = primitive as usize;
            let first = Facet {
                instance: number,
                primitive,
                part: 0,
                corners: [DVec3::ZERO; 3],
                is_flat: true,
                is_polygon: true,
                is_one_sided: false,
                material: self.material_of(instance, primitive),
            };
            let shape = match geometry {
                Geometry::Mesh { mesh, .. } => {
                    let corners = placed(mesh.corners(id).map(|p| p.as_dvec3()), to_world);
                    push(facets, Facet { corners, is_one_sided: mesh.one_sided, ..first }, limit)?;
                    continue;
                }
                Geometry::Shapes { shapes, .. } => shapes[id],
                Geometry::Spheres { cloud, .. } => Shape::Sphere(cloud.sphere(id)),
                Geometry::Cylinders { cloud, .. } => Shape::Cylinder(cloud.cylinder(id)),
            };
            let is_one_sided = matches!(&shape, Shape::Triangle(triangle) if triangle.one_sided);
            let most_angle =
                if self.shading.materials[first.material as usize].may_emit() { lamp_angle } else { FRAC_PI_2 };
            let tolerances = (tolerance, most_angle);
            let tessellation = shape.tessellate_with_area(tolerances, &Aabb::EMPTY, limit, to_world)?;
            let is_flat = |part: u32| match shape {
                Shape::Box(_) | Shape::Triangle(_) | Shape::Rectangle(_) | Shape::Plane(_) | Shape::Disk(_) => true,
                Shape::Cylinder(_) | Shape::Cone(_) => part != 0,
                Shape::Partial(partial) => partial.is_flat(),
                Shape::Sphere(_) | Shape::Torus(_) => false,
            };
            let from = facets.len();
            push_all(facets, &tessellation, to_world, Facet { is_one_sided, ..first }, limit)?;
            let is_polygon = shape.is_polygonal();
            for facet in &mut facets[from..] {
                (facet.is_flat, facet.is_polygon) = (is_flat(facet.part), is_polygon);
            }
        }
        Ok(())
    }

    /// The surface of a primitive where the line hits it first, with the hit. The line's parameter runs up to 1.
    pub(crate) fn surface_of(&self, instance: u32, primitive: u32, line: DRay) -> Option<(Hit, Surface)> {
        let ray = Ray { origin: line.origin.as_vec3(), direction: line.direction.as_vec3() };
        let met = if instance == Hit::UNBOUNDED {
            self.geometry.unbounded[primitive as usize].shape.intersect(&ray, 1.0)
        } else {
            self.with_instance(instance, |placed| {
                let geometry = &self.geometry.geometries[placed.geometry as usize];
                placed.with_local_ray(&ray.prepare(), &self.geometry.chains, 0.0, |ray| {
                    geometry.intersect_one(primitive, ray, 1.0, 0.0)
                })
            })
        };
        let ShapeHit { t, part, uv } = met?;
        let hit = Hit { t, instance, primitive, part, uv, time: 0.0 };
        Some((hit, self.surface(line, &hit)))
    }

    /// Whether there is an instance of this number, and a primitive of its geometry.
    pub(crate) fn has_primitive(&self, instance: u32, primitive: u32) -> bool {
        let count = match instance {
            Hit::UNBOUNDED => self.geometry.unbounded.len(),
            _ if instance >= self.geometry.root.leaves => 0,
            _ => self.with_instance(instance, |placed| self.geometry.geometries[placed.geometry as usize].len()),
        };
        (primitive as usize) < count
    }

    /// The box of all surfaces that have bounds, in the world's coordinates.
    pub(crate) fn inner_bounds(&self) -> Aabb {
        self.geometry.root.tree.bounds()
    }
}

fn placed(corners: [DVec3; 3], to_world: Option<&Transform>) -> [DVec3; 3] {
    let Some(t) = to_world else { return corners };
    let [a, b, c] = corners.map(|p| t.point(p));
    // A mirroring transform turns the order of the corners round.
    if t.matrix().matrix3.determinant() < 0.0 { [a, c, b] } else { [a, b, c] }
}

fn push(facets: &mut Vec<Facet>, facet: Facet, limit: usize) -> Result<(), TooManyTriangles> {
    if facets.len() >= limit {
        return Err(TooManyTriangles { limit });
    }
    facets.push(facet);
    Ok(())
}

fn push_all(
    facets: &mut Vec<Facet>,
    tessellation: &Tessellation,
    to_world: Option<&Transform>,
    first: Facet,
    limit: usize,
) -> Result<(), TooManyTriangles> {
    for (&triangle, &part) in tessellation.triangles.iter().zip(&tessellation.parts) {
        let corners = placed(triangle.map(|v| tessellation.vertices[v as usize].point), to_world);
        push(facets, Facet { part, corners, ..first }, limit)?;
    }
    Ok(())
}
