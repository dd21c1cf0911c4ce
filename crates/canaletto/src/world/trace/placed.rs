//! The geometries of a world in their places, for whatever visits all surfaces: rasterisers and patches.

use crate::math::{DRay, Rgb, Transform};
use crate::shape::{CylinderCloud, Mesh, Shape, SphereCloud, Surface};
use crate::world::World;
use crate::world::data::geometry::Geometry;
use crate::world::trace::query::Hit;
use canaletto_bvh::Aabb;

/// A geometry in its place.
pub(crate) struct PlacedGeometry<'w> {
    /// The transform from the primitives' space to the world's; `None` is the identity.
    pub(crate) to_world: Option<Transform>,
    pub(crate) primitives: Primitives<'w>,
}

/// The primitives of one geometry. The index of a primitive is [`Hit::primitive`].
#[derive(Clone, Copy)]
pub(crate) enum Primitives<'w> {
    Shapes(&'w [Shape]),
    Mesh(&'w Mesh),
    Spheres(&'w SphereCloud),
    Cylinders(&'w CylinderCloud),
}

impl Primitives<'_> {
    /// The number of primitives.
    pub(crate) fn len(&self) -> usize {
        match self {
            Primitives::Shapes(shapes) => shapes.len(),
            Primitives::Mesh(mesh) => mesh.len(),
            Primitives::Spheres(cloud) => cloud.len(),
            Primitives::Cylinders(cloud) => cloud.len(),
        }
    }

    /// A primitive as a shape, and its own colour; `None` for triangles of meshes.
    pub(crate) fn shape(&self, primitive: u32) -> Option<(Shape, Option<Rgb>)> {
        let id = primitive as usize;
        match self {
            Primitives::Shapes(shapes) => Some((shapes[id], None)),
            Primitives::Mesh(_) => None,
            Primitives::Spheres(cloud) => Some((cloud.sphere(id).into(), cloud.color(id))),
            Primitives::Cylinders(cloud) => Some((cloud.cylinder(id).into(), cloud.color(id))),
        }
    }
}

/// A triangle of a mesh that stands for a part of a curved primitive. The hit's `uv` are its barycentric coordinates.
#[derive(Clone, Copy)]
pub(crate) struct MeshFacet<'a> {
    /// The triangles of the primitive, in its own space.
    pub(crate) mesh: &'a Mesh,
    pub(crate) triangle: u32,
    /// The primitive's own colour.
    pub(crate) color: Option<Rgb>,
}

impl MeshFacet<'_> {
    /// The surface at a hit, in the primitive's space.
    pub(in crate::world) fn surface(&self, line: &DRay, hit: &Hit) -> Surface {
        Surface { color: self.color, ..self.mesh.surface_at(self.triangle as usize, line, &hit.shape_hit(), hit.time) }
    }
}

impl World {
    /// The number of geometries in their places, besides shapes without bounds.
    pub(crate) fn placed_geometry_count(&self) -> u32 {
        self.geometry.root.leaves
    }

    /// The geometry of this number in its place at a time in 0..=1.
    pub(crate) fn placed_geometry(&self, number: u32, time: f32) -> PlacedGeometry<'_> {
        self.with_instance(number, |instance| {
            let primitives = match &self.geometry.geometries[instance.geometry as usize] {
                Geometry::Shapes { shapes, .. } => Primitives::Shapes(shapes),
                Geometry::Mesh { mesh, .. } => Primitives::Mesh(mesh),
                Geometry::Spheres { cloud, .. } => Primitives::Spheres(cloud),
                Geometry::Cylinders { cloud, .. } => Primitives::Cylinders(cloud),
            };
            PlacedGeometry { to_world: instance.placed(&self.geometry.chains, time), primitives }
        })
    }

    /// The box in the world around the geometry of this number, over all times.
    pub(crate) fn placed_bounds(&self, number: u32) -> Aabb {
        self.with_instance(number, |instance| self.bounds_of(instance))
    }

    /// The shapes without bounds, in the world's space. Their hits have the instance [`Hit::UNBOUNDED`] and their index
    /// as the primitive.
    pub(crate) fn unbounded_shapes(&self) -> impl Iterator<Item = &Shape> {
        self.geometry.unbounded.iter().map(|unbounded| &unbounded.shape)
    }

    /// A shape without bounds.
    pub(crate) fn unbounded_shape(&self, primitive: u32) -> &Shape {
        &self.geometry.unbounded[primitive as usize].shape
    }

    /// The bounds of everything that has bounds, in the world's coordinates.
    pub(crate) fn local_bounds(&self) -> Aabb {
        self.geometry.root.tree.bounds()
    }

    /// The surface of a facet at a hit of this line's ray, in the world's space.
    pub(crate) fn facet_surface(&self, line: DRay, hit: &Hit, facet: &MeshFacet) -> Surface {
        self.with_instance(hit.instance, |instance| match instance.placed(&self.geometry.chains, hit.time) {
            None => facet.surface(&line, hit),
            Some(t) => facet.surface(&line.to_local(&t), hit).transformed(&t),
        })
    }
}
