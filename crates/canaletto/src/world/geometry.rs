//! Geometries: primitives of one kind in the order of their hierarchy's leaves.

use super::Census;
use super::instance::NONE;
use crate::math::Line;
use crate::shape::{CylinderCloud, Mesh, Patch, Shape, ShapeHit, SphereCloud, Surface};
use canaletto_bvh::{self as bvh, Aabb, Bvh, Leaf, PreparedRay, Triangles, sphere};
use glam::Vec3;
use rayon::prelude::*;

/// Primitives of one kind under one hierarchy: the second level. Primitive ids are positions in the description;
/// slots are positions in leaf order.
#[derive(Debug)]
pub(super) enum Geometry {
    /// Single shapes of any kind, with the object and material (or [`NONE`]) of each, by id.
    Shapes { bvh: Bvh, slots: Vec<Shape>, shapes: Vec<Shape>, objects: Vec<u32>, materials: Vec<u32> },
    /// A mesh; corners are stored once more as rays read them.
    Mesh { triangles: Triangles, mesh: Mesh },
    /// A cloud of spheres, its lists in id order; centre and radius in slot order.
    Spheres { bvh: Bvh, slots: Vec<(Vec3, f32)>, cloud: SphereCloud },
    /// A cloud of cylinders.
    Cylinders { bvh: Bvh, slots: Vec<Shape>, cloud: CylinderCloud },
}

/// The nearest hit inside one geometry so far.
#[derive(Clone, Copy, Debug)]
pub(super) struct Nearest {
    pub(super) t: f32,
    pub(super) primitive: u32,
    pub(super) part: u32,
    pub(super) uv: [f32; 2],
}

/// No primitive yet; larger than any id, so that ties go to a real one.
pub(super) const NO_PRIMITIVE: u32 = u32::MAX;

impl Nearest {
    /// Nothing up to `t_max`.
    #[inline]
    pub(super) fn before(t_max: f32) -> Nearest {
        Nearest { t: t_max, primitive: NO_PRIMITIVE, part: 0, uv: [0.0; 2] }
    }

    fn offer(&mut self, hit: ShapeHit, primitive: u32) {
        // Ties by the lowest id: the answer doesn't depend on the order in which leaves are met.
        if hit.t < self.t || (hit.t == self.t && primitive < self.primitive) {
            *self = Nearest { t: hit.t, primitive, part: hit.part, uv: hit.uv };
        }
    }
}

/// [`Shape::intersect`], with spheres, the most frequent shape, on the prepared ray.
#[inline]
fn meet(shape: &Shape, ray: &PreparedRay, t_max: f32) -> Option<ShapeHit> {
    match shape {
        Shape::Sphere(s) => sphere::intersect(ray, s.center, s.radius, t_max).map(plain),
        other => meet_other(other, ray, t_max),
    }
}

#[inline(never)]
fn meet_other(shape: &Shape, ray: &PreparedRay, t_max: f32) -> Option<ShapeHit> {
    shape.intersect(&ray.ray, t_max)
}

/// The first slot of a leaf for which `met` holds.
#[inline]
fn first(leaf: Leaf, mut met: impl FnMut(usize) -> bool) -> Option<u32> {
    leaf.slots().find(|&slot| met(slot as usize))
}

/// A hit that needs no more than t.
fn plain(t: f32) -> ShapeHit {
    ShapeHit { t, part: 0, uv: [0.0; 2] }
}

impl Geometry {
    pub(super) fn shapes(
        shapes: Vec<Shape>,
        objects: Vec<u32>,
        materials: Vec<u32>,
    ) -> Result<Geometry, bvh::BuildError> {
        let bounds: Vec<Aabb> = shapes.par_iter().map(|s| s.bounds().unwrap_or(Aabb::EMPTY)).collect();
        let bvh = Bvh::build(&bounds)?;
        let slots = bvh.order().iter().map(|&id| shapes[id as usize]).collect();
        Ok(Geometry::Shapes { bvh, slots, shapes, objects, materials })
    }

    pub(super) fn mesh(mesh: Mesh) -> Result<Geometry, bvh::BuildError> {
        let triangles = Triangles::build(mesh.len(), |id| mesh.corners(id as usize))?;
        Ok(Geometry::Mesh { triangles, mesh })
    }

    pub(super) fn spheres(cloud: SphereCloud) -> Result<Geometry, bvh::BuildError> {
        let bounds: Vec<Aabb> =
            (0..cloud.len()).into_par_iter().map(|id| sphere::bounds(cloud.centers[id], cloud.radius(id))).collect();
        let bvh = Bvh::build(&bounds)?;
        let slots = bvh.order().par_iter().map(|&id| (cloud.centers[id as usize], cloud.radius(id as usize))).collect();
        Ok(Geometry::Spheres { bvh, slots, cloud })
    }

    pub(super) fn cylinders(cloud: CylinderCloud) -> Result<Geometry, bvh::BuildError> {
        let shape = |id: usize| Shape::Cylinder(cloud.cylinder(id));
        let bounds: Vec<Aabb> =
            (0..cloud.len()).into_par_iter().map(|id| shape(id).bounds().unwrap_or(Aabb::EMPTY)).collect();
        let bvh = Bvh::build(&bounds)?;
        let slots = bvh.order().par_iter().map(|&id| shape(id as usize)).collect();
        Ok(Geometry::Cylinders { bvh, slots, cloud })
    }

    /// How many primitives it has.
    pub(super) fn len(&self) -> usize {
        match self {
            Geometry::Shapes { shapes, .. } => shapes.len(),
            Geometry::Mesh { triangles, .. } => triangles.len(),
            Geometry::Spheres { cloud, .. } => cloud.len(),
            Geometry::Cylinders { cloud, .. } => cloud.len(),
        }
    }

    /// The box around all of it.
    pub(super) fn bounds(&self) -> Aabb {
        match self {
            Geometry::Shapes { bvh, .. } | Geometry::Spheres { bvh, .. } | Geometry::Cylinders { bvh, .. } => {
                bvh.bounds()
            }
            Geometry::Mesh { triangles, .. } => triangles.bounds(),
        }
    }

    /// The first and last object of its shapes; `None` where the instance says which object it is.
    pub(super) fn objects(&self) -> Option<(u32, u32)> {
        match self {
            Geometry::Shapes { objects, .. } => Some((*objects.iter().min()?, *objects.iter().max()?)),
            _ => None,
        }
    }

    /// The materials that its primitives name, in any order, [`NONE`] for those that name none.
    pub(super) fn own_materials(&self) -> Vec<u32> {
        match self {
            Geometry::Shapes { materials, .. } => {
                let mut all = materials.clone();
                all.sort_unstable();
                all.dedup();
                all
            }
            Geometry::Mesh { mesh, .. } if !mesh.materials.is_empty() => mesh.materials.clone(),
            Geometry::Mesh { .. } | Geometry::Spheres { .. } | Geometry::Cylinders { .. } => vec![NONE],
        }
    }

    /// The nearest hit at or before `t_max` (ties with a hit elsewhere are the caller's).
    pub(super) fn intersect(&self, ray: &PreparedRay, t_max: f32) -> Option<Nearest> {
        let mut nearest = Nearest::before(t_max);
        let best = &mut nearest;
        match self {
            Geometry::Shapes { bvh, slots, .. } | Geometry::Cylinders { bvh, slots, .. } => {
                bvh.intersect(ray, t_max, |leaf, t_max| {
                    for slot in leaf.slots() {
                        if let Some(hit) = meet(&slots[slot as usize], ray, *t_max) {
                            best.offer(hit, bvh.order()[slot as usize]);
                            *t_max = best.t;
                        }
                    }
                });
            }
            Geometry::Mesh { triangles, mesh } => {
                let mut hit = bvh::Nearest::before(t_max);
                triangles.intersect(ray, &mut hit, mesh.one_sided);
                *best = Nearest { t: hit.t, primitive: hit.id, part: 0, uv: [hit.u, hit.v] };
            }
            Geometry::Spheres { bvh, slots, .. } => {
                bvh.intersect(ray, t_max, |leaf, t_max| {
                    for slot in leaf.slots() {
                        let (center, radius) = slots[slot as usize];
                        if let Some(t) = sphere::intersect(ray, center, radius, *t_max) {
                            best.offer(plain(t), bvh.order()[slot as usize]);
                            *t_max = best.t;
                        }
                    }
                });
            }
        }
        (nearest.primitive != NO_PRIMITIVE).then_some(nearest)
    }

    /// The slot of a primitive that is met at or before `t_max` and `blocks`, if there is one.
    pub(super) fn occluded(&self, ray: &PreparedRay, t_max: f32, mut blocks: impl FnMut(u32) -> bool) -> Option<u32> {
        let mut blocker = None;
        match self {
            Geometry::Shapes { bvh, slots, .. } | Geometry::Cylinders { bvh, slots, .. } => {
                bvh.occluded(ray, t_max, |leaf| {
                    blocker = first(leaf, |slot| meet(&slots[slot], ray, t_max).is_some() && blocks(bvh.order()[slot]));
                    blocker.is_some()
                });
            }
            Geometry::Mesh { triangles, mesh } => return triangles.occluded(ray, t_max, mesh.one_sided, blocks),
            Geometry::Spheres { bvh, slots, .. } => {
                bvh.occluded(ray, t_max, |leaf| {
                    blocker = first(leaf, |slot| {
                        let (center, radius) = slots[slot];
                        sphere::intersect(ray, center, radius, t_max).is_some() && blocks(bvh.order()[slot])
                    });
                    blocker.is_some()
                });
            }
        }
        blocker
    }

    /// Whether the primitive in this slot is met at or before `t_max`.
    pub(super) fn blocks(&self, slot: u32, ray: &PreparedRay, t_max: f32) -> bool {
        match self {
            Geometry::Shapes { slots, .. } | Geometry::Cylinders { slots, .. } => {
                meet(&slots[slot as usize], ray, t_max).is_some()
            }
            Geometry::Mesh { triangles, mesh } => triangles.blocks(slot, ray, t_max, mesh.one_sided),
            Geometry::Spheres { slots, .. } => {
                let (center, radius) = slots[slot as usize];
                sphere::intersect(ray, center, radius, t_max).is_some()
            }
        }
    }

    /// The same question answered by trying every primitive: the oracle that the hierarchy is tested against.
    pub(super) fn intersect_brute_force(&self, ray: &PreparedRay, t_max: f32) -> Option<Nearest> {
        let mut nearest = Nearest::before(t_max);
        match self {
            Geometry::Shapes { bvh, slots, .. } | Geometry::Cylinders { bvh, slots, .. } => {
                for (shape, &id) in slots.iter().zip(bvh.order()) {
                    if let Some(hit) = shape.intersect(&ray.ray, nearest.t) {
                        nearest.offer(hit, id);
                    }
                }
            }
            Geometry::Mesh { triangles, mesh } => {
                let mut hit = bvh::Nearest::before(t_max);
                triangles.intersect_brute_force(ray, &mut hit, mesh.one_sided);
                nearest = Nearest { t: hit.t, primitive: hit.id, part: 0, uv: [hit.u, hit.v] };
            }
            Geometry::Spheres { bvh, slots, .. } => {
                for (&(center, radius), &id) in slots.iter().zip(bvh.order()) {
                    if let Some(t) = sphere::intersect(ray, center, radius, nearest.t) {
                        nearest.offer(plain(t), id);
                    }
                }
            }
        }
        (nearest.primitive != NO_PRIMITIVE).then_some(nearest)
    }

    /// The second stage of a hit, in this geometry's space.
    pub(super) fn surface(&self, line: Line, primitive: u32, hit: &ShapeHit) -> Surface {
        let id = primitive as usize;
        match self {
            Geometry::Shapes { shapes, .. } => shapes[id].surface(line, hit),
            Geometry::Mesh { mesh, .. } => mesh.surface(id, hit.uv[0], hit.uv[1]),
            Geometry::Spheres { cloud, .. } => cloud.surface(id, line, hit),
            Geometry::Cylinders { cloud, .. } => cloud.surface(id, line, hit),
        }
    }

    /// The same for whoever doesn't read its texture coordinates, which may be left out.
    pub(super) fn bare_surface(&self, line: Line, primitive: u32, hit: &ShapeHit) -> Surface {
        let id = primitive as usize;
        match self {
            Geometry::Shapes { shapes, .. } => shapes[id].bare_surface(line, hit),
            Geometry::Mesh { mesh, .. } => mesh.surface(id, hit.uv[0], hit.uv[1]),
            Geometry::Spheres { cloud, .. } => cloud.bare_surface(id, line, hit),
            Geometry::Cylinders { cloud, .. } => cloud.bare_surface(id, line, hit),
        }
    }

    /// How the surface goes on around a hit with this surface, in this geometry's space.
    pub(super) fn patch(&self, primitive: u32, hit: &ShapeHit, surface: &Surface) -> Patch {
        let id = primitive as usize;
        match self {
            Geometry::Shapes { shapes, .. } => shapes[id].patch(surface, hit),
            Geometry::Mesh { mesh, .. } => mesh.patch(id, hit.uv[0], hit.uv[1]),
            Geometry::Spheres { cloud, .. } => cloud.patch(id, surface, hit),
            Geometry::Cylinders { cloud, .. } => cloud.patch(id, surface, hit),
        }
    }

    /// The bounds of the object that a primitive belongs to, in this geometry's space.
    pub(super) fn object_bounds(&self, primitive: u32) -> Option<Aabb> {
        match self {
            Geometry::Shapes { shapes, .. } => shapes[primitive as usize].bounds(),
            _ => Some(self.bounds()),
        }
    }

    pub(super) fn count(&self, census: &mut Census) {
        let n = self.len() as u64;
        let list = |bytes: usize, len: usize| (bytes * len) as u64;
        census.bytes += match self {
            Geometry::Shapes { bvh, .. } | Geometry::Spheres { bvh, .. } | Geometry::Cylinders { bvh, .. } => {
                bvh.statistics().bytes as u64
            }
            Geometry::Mesh { triangles, .. } => triangles.statistics().bytes as u64,
        };
        census.bytes += match self {
            Geometry::Shapes { slots, .. } => {
                census.shapes += n;
                list(2 * size_of::<Shape>() + 8, slots.len())
            }
            Geometry::Mesh { mesh, .. } => {
                census.triangles += n;
                list(12, mesh.positions.len() + mesh.normals.len() + mesh.colors.len() + mesh.triangles.len())
                    + list(8, mesh.uvs.len())
                    + list(4, mesh.slots.len())
            }
            Geometry::Spheres { cloud, .. } => {
                census.cloud_spheres += n;
                list(28, cloud.len()) + list(4, cloud.radii.len()) + list(12, cloud.colors.len())
            }
            Geometry::Cylinders { slots, cloud, .. } => {
                census.cloud_cylinders += n;
                list(size_of::<Shape>(), slots.len()) + list(28, cloud.len()) + list(12, cloud.colors.len())
            }
        };
    }
}
